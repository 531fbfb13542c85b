//! What the tables of several programs need on their way to signals.

pub(super) mod series;
pub(super) mod surroundings;

use crate::error::plain;

/// Names out of a log as part of a sentence, without control characters and not too long.
pub(crate) fn plain_list(names: &[&str]) -> String {
    let text = names.iter().map(|name| plain(name, 40)).collect::<Vec<_>>().join(", ");
    if text.chars().count() > 250 { text.chars().take(250).chain("...".chars()).collect() } else { text }
}
