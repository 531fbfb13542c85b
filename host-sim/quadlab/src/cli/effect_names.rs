//! Effects by the names that users know them by.

use model::Effect;

/// A name that is no effect's.
#[derive(Debug, thiserror::Error)]
#[error("unknown effect \"{effect}\"; known are {known}")]
pub(crate) struct UnknownEffect {
    effect: String,
    known: String,
}

/// The effect of a name.
pub(crate) fn known_effect(id: &str) -> Result<Effect, UnknownEffect> {
    Effect::from_id(id).ok_or_else(|| {
        let candidates: Vec<Effect> = Effect::candidates().collect();
        UnknownEffect { effect: id.into(), known: listed(&candidates) }
    })
}

/// "thrust, linear-drag".
pub(crate) fn listed(effects: &[Effect]) -> String {
    effects.iter().map(|e| e.id()).collect::<Vec<_>>().join(", ")
}
