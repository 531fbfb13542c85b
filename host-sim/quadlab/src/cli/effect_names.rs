//! Effects by the names that users know them by.

use model::Effect;

/// A name that is no effect's.
#[derive(Debug, thiserror::Error)]
#[error("unknown effect \"{effect}\"; {}known are {known}", did_you_mean(*nearest))]
pub(crate) struct UnknownEffect {
    effect: String,
    nearest: Option<Effect>,
    known: String,
}

/// The effect of a name.
pub(crate) fn known_effect(id: &str) -> Result<Effect, UnknownEffect> {
    Effect::from_id(id).ok_or_else(|| {
        let candidates: Vec<Effect> = Effect::candidates().collect();
        UnknownEffect { effect: id.into(), nearest: nearest(id, &candidates), known: listed(&candidates) }
    })
}

/// "did you mean ground-effect? ", or nothing.
fn did_you_mean(nearest: Option<Effect>) -> String {
    nearest.map_or_else(String::new, |effect| format!("did you mean {effect}? "))
}

/// The effect that a misspelt name is likely to mean: with as few letters to change as a slip of the hand leaves.
pub(crate) fn nearest(misspelt: &str, effects: &[Effect]) -> Option<Effect> {
    let letters = |effect: &Effect| strsim::levenshtein(misspelt, effect.id());
    let best = effects.iter().copied().min_by_key(letters)?;
    (letters(&best) <= misspelt.chars().count() / 4).then_some(best)
}

/// "thrust, linear-drag".
pub(crate) fn listed(effects: &[Effect]) -> String {
    effects.iter().map(|e| e.id()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_told_what_it_means_and_another_word_is_not() {
        let said = |id: &str| known_effect(id).unwrap_err().to_string();
        assert!(
            said("ground-efect")
                .starts_with("unknown effect \"ground-efect\"; did you mean ground-effect? known are ")
        );
        assert!(said("fog").starts_with("unknown effect \"fog\"; known are "));
    }
}
