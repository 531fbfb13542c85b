//! Equations of effects as a browser draws them.

use model::{Effect, Model, physical_parameters};
use pulldown_latex::config::DisplayMode;
use pulldown_latex::{Parser, RenderConfig, Storage, push_mathml};
use serde_json::{Value, json};

/// What an effect does: its sentence, its equation in MathML, and where that is from. What a user wrote has no equation but
/// the formulas that the page shows as text.
pub(super) fn of(effect: Effect) -> Value {
    let info = effect.info();
    let mathml = match effect {
        Effect::User(_) => None,
        _ => mathml(info.equation),
    };
    json!({ "effect": info.id, "sentence": info.sentence, "mathml": mathml, "source": info.source })
}

/// Mass, thrust and torque coefficients and moments of inertia, with where each comes from.
pub(super) fn physical(model: &Model) -> Vec<Value> {
    let entry = |one: model::PhysicalParameter| {
        json!({
            "symbol": one.symbol,
            "name": one.name,
            "value": one.value,
            "std_error": one.std_error,
            "unit": one.unit,
            "mathml": mathml(one.relation),
            "source": one.source,
        })
    };
    physical_parameters(model).into_iter().map(entry).collect()
}

/// Nothing where the equation cannot be read.
fn mathml(latex: &str) -> Option<String> {
    let storage = Storage::new();
    let events = Parser::new(latex, &storage).collect::<Result<Vec<_>, _>>().ok()?;
    let config = RenderConfig { display_mode: DisplayMode::Block, xml: true, ..RenderConfig::default() };
    let mut text = String::new();
    push_mathml(&mut text, events.into_iter().map(Ok::<_, std::convert::Infallible>), config).ok()?;
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_of_the_catalogue_has_an_equation_that_is_well_formed() {
        for effect in Effect::all().filter(|effect| !matches!(effect, Effect::User(_))) {
            let text = mathml(effect.info().equation)
                .unwrap_or_else(|| panic!("{effect}: {}", effect.info().equation));
            assert!(text.starts_with("<math") && text.trim_end().ends_with("</math>"), "{effect}: {text}");
            assert!(!text.contains("merror"), "{effect}: {text}");
        }
        assert!(mathml(r"\frac{1}{").is_none());
    }

    #[test]
    fn every_physical_parameter_says_where_it_comes_from() {
        let all = physical(&Model::thesis());
        assert_eq!(all.len(), 8, "all but the rotors' own inertia");
        for one in all {
            let relation = one["mathml"].as_str().unwrap_or_else(|| panic!("{one}"));
            assert!(
                !relation.contains("merror") && one["source"].as_str().is_some_and(|s| !s.is_empty()),
                "{one}"
            );
        }
    }
}
