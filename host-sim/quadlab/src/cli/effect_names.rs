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
    let letters = |effect: &Effect| edits(misspelt, effect.id());
    let best = effects.iter().copied().min_by_key(letters)?;
    (letters(&best) <= misspelt.chars().count() / 4).then_some(best)
}

/// Letters to insert, delete or replace to make one word the other (Levenshtein's distance).
fn edits(from: &str, to: &str) -> usize {
    let to: Vec<char> = to.chars().collect();
    let mut row: Vec<usize> = (0..=to.len()).collect();
    for (place, letter) in from.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], place + 1);
        for (column, other) in to.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[to.len()]
}

/// "thrust, linear-drag".
pub(crate) fn listed(effects: &[Effect]) -> String {
    effects.iter().map(|e| e.id()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_letters_between_two_words_are_counted() {
        for (from, to, letters) in
            [("kitten", "sitting", 3), ("", "abc", 3), ("abc", "abc", 0), ("flaw", "lawn", 2)]
        {
            assert_eq!(edits(from, to), letters, "{from} {to}");
            assert_eq!(edits(to, from), letters, "{to} {from}");
        }
    }

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
