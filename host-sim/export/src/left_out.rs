//! A file for another tool, with what it does not take of the model.

use model::{Coefficient, Effect, Model};
use schemars::JsonSchema;
use serde::Serialize;

/// A part of a model that another tool does not take, or not as it is.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LeftOut {
    /// Identifier of the effect.
    pub effect: String,
    /// What becomes of it.
    pub why: String,
}

/// A file for another tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    /// The file.
    pub text: String,
    /// What of the model is not in it.
    pub left_out: Vec<LeftOut>,
}

/// What becomes of the effects of a model: `taken` says nothing of those that the tool takes as they are, and else what it does with
/// them.
pub(crate) fn left_out(model: &Model, taken: impl Fn(Effect) -> Option<String>) -> Vec<LeftOut> {
    let of = |effect: Effect| Some(LeftOut { effect: effect.to_string(), why: taken(effect)? });
    model.effects().into_iter().filter_map(of).collect()
}

/// That an effect is not in the file, and how large it is.
pub(crate) fn none(model: &Model, effect: Effect) -> Option<String> {
    let coefficients = effect.info().coefficients;
    let values = model.term(effect)?.values();
    let told = |(coefficient, value): (&Coefficient, f64)| {
        let unit = Some(coefficient.unit_for(model.rotor_quantity()))
            .filter(|unit| *unit != "1")
            .unwrap_or_default();
        format!("{} = {} {unit}", coefficient.name, report::significant(value, 4)).trim_end().to_owned()
    };
    let all: Vec<String> = coefficients.iter().zip(values).map(told).collect();
    Some(if all.is_empty() {
        "not in the file".into()
    } else {
        format!("not in the file ({})", all.join(", "))
    })
}

/// As lines of comments, each behind `mark`.
pub(crate) fn comments(left_out: &[LeftOut], mark: &str) -> String {
    if left_out.is_empty() {
        return format!("{mark}All effects of the model are in this file.\n");
    }
    let lines = left_out.iter().map(|one| format!("{mark}  {}: {}\n", one.effect, one.why));
    format!("{mark}Not as in the model:\n{}", lines.collect::<String>())
}

/// For an attribute of XML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// For a comment of XML, which two hyphens would end.
pub(crate) fn without_ends_of_comments(text: &str) -> String {
    text.replace("--", "- -")
}
