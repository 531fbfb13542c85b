//! What the tables of several programs need on their way to signals.

pub(super) mod series;
pub(super) mod surroundings;

/// Names out of a log as part of a sentence, without control characters and not too long.
pub(super) fn plain_list(names: &[&str]) -> String {
    let plain =
        |name: &&str| name.chars().map(|c| if c.is_control() { '?' } else { c }).take(40).collect::<String>();
    let text = names.iter().map(plain).collect::<Vec<_>>().join(", ");
    if text.chars().count() > 250 { text.chars().take(250).chain("...".chars()).collect() } else { text }
}
