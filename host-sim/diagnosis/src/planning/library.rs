//! The library of a flight: what a regression on it chooses from, as plain numbers for other programs.
//!
//! Targets and columns are those that a fit stacks (`fit.rs`): the basic model's columns, and those of every candidate
//! effect of the catalogue. Adjusting effects, which are not linear in their coefficients, stand in with the derivative of the
//! residual at none of them.

use model::{Effect, Kind, Model};

use sysid::fit::linearise::About;
use sysid::fit::swing::Known;
use sysid::prepare::Prepared;

/// A column of a library: a coefficient of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LibraryColumn {
    /// The effect.
    pub effect: Effect,
    /// Index of the coefficient within the effect.
    pub coefficient: usize,
}

/// Targets and columns over the rows of one flight.
#[derive(Debug, Clone)]
pub struct Library {
    /// Specific force (m/s^2) and angular acceleration (rad/s^2) over the rows, for each axis.
    pub targets: [Vec<f64>; 6],
    /// What each column is.
    pub names: Vec<LibraryColumn>,
    /// The columns' values in units of the target per unit of the coefficient, on the axes on which they act.
    pub columns: Vec<[Option<Vec<f64>>; 6]>,
}

/// The library of a flight about `model`: its linear effects and all candidates that it does not have.
pub fn library(model: &Model, flight: &Prepared) -> Library {
    let stride = flight.fit_stride();
    let candidates = || Effect::candidates().filter(|effect| !model.has(*effect));
    let is_linear = |effect: &Effect| effect.info().kind != Kind::Adjusting;
    let linear: Vec<Effect> = model.effects().into_iter().chain(candidates()).filter(is_linear).collect();
    let adjusting: Vec<Effect> = candidates().filter(|effect| !is_linear(effect)).collect();
    let columns = About::new(flight, model, (&linear, &adjusting), stride, &Known::default()).columns;
    let name = |effect: &Effect| {
        let effect = *effect;
        (0..effect.info().coefficients.len()).map(move |coefficient| LibraryColumn { effect, coefficient })
    };
    let names: Vec<LibraryColumn> = linear.iter().chain(&adjusting).flat_map(name).collect();
    debug_assert_eq!(names.len(), columns.len());
    let targets = flight.targets(&model.vehicle, &model.adjustments(), stride);
    Library { targets, names, columns }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, prepared, truth};

    #[test]
    fn the_library_holds_the_models_linear_effects_and_every_other_candidate_once() {
        let mut model = truth();
        model.set(Effect::MassChange, &[0.1]);
        let flight = prepared(&truth(), 1..2, 4.0, &NONE).remove(0);
        let library = library(&model, &flight);
        assert_eq!(library.names.len(), library.columns.len());
        for (k, name) in library.names.iter().enumerate() {
            assert!(!library.names[..k].contains(name), "{name:?} twice");
        }
        let has = |effect| library.names.iter().any(|name| name.effect == effect);
        assert!(truth().effects().into_iter().all(has));
        assert!(Effect::candidates().filter(|effect| *effect != Effect::MassChange).all(has));
        // What adjusts and is in the model already has no column of its own.
        assert!(!has(Effect::MassChange));
        let rows = library.targets[0].len();
        assert!(library.columns.iter().flatten().flatten().all(|column| column.len() == rows));
    }

    #[test]
    fn the_true_coefficients_times_their_columns_are_the_targets_of_a_flight_without_noise() {
        let model = truth();
        let flight = prepared(&model, 1..2, 6.0, &NONE).remove(0);
        let library = library(&model, &flight);
        let mut left = library.targets.clone();
        for (name, column) in library.names.iter().zip(&library.columns) {
            let Some(term) = model.term(name.effect) else { continue };
            let value = term.coefficients[name.coefficient].value;
            for (left, column) in left.iter_mut().zip(column) {
                let Some(column) = column else { continue };
                left.iter_mut().zip(column).for_each(|(l, c)| *l -= value * c);
            }
        }
        for (axis, (left, target)) in left.iter().zip(&library.targets).enumerate() {
            let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
            assert!(square(left) < 1e-3 * square(target), "{axis}");
        }
    }
}
