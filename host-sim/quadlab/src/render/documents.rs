//! Parts of JSON documents that several commands and the lab's page have in common.

use model::Model;
use schemars::JsonSchema;
use serde::Serialize;

/// A coefficient of a model.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct CoefficientEntry {
    effect: &'static str,
    name: &'static str,
    value: f64,
    std_error: Option<f64>,
    unit: &'static str,
}

/// All coefficients of a model, in its order.
pub(crate) fn coefficient_entries(model: &Model) -> Vec<CoefficientEntry> {
    let of_term = |term: &model::Term| {
        let info = term.effect.info();
        let both = info.coefficients.iter().zip(&term.coefficients);
        let entries = both.map(|(coefficient, estimate)| CoefficientEntry {
            effect: info.id,
            name: coefficient.name,
            value: estimate.value,
            std_error: estimate.std_error,
            unit: coefficient.unit_for(model.rotor_quantity()),
        });
        entries.collect::<Vec<_>>()
    };
    model.terms.iter().flat_map(of_term).collect()
}
