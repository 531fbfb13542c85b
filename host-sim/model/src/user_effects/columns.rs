//! Further columns of flight files that formulas can name: where a load hangs, what it weighs, where another craft flies.
//!
//! A definition declares them with their units; some that importers write have theirs anyway. Each name has a place in every
//! sample, kept to the end of the program as the effects themselves are.

use std::sync::{PoisonError, RwLock};

use crate::quantity::QUANTITIES;
use crate::sample::MAX_FURTHER;
use crate::user_effects::definition::MAX_NAME;
use crate::user_effects::scanner::functions;

/// The column that every flight has by its rows, and none by its file: time since the flight's first row, s.
pub const TIME_COLUMN: &str = "time";

/// Columns that need no declaration, with their units.
pub const USUAL_COLUMNS: [(&str, &str); 8] = [
    (TIME_COLUMN, "s"),
    ("load_north", "m"),
    ("load_east", "m"),
    ("load_down", "m"),
    ("other_north", "m"),
    ("other_east", "m"),
    ("other_down", "m"),
    ("payload_kg", "kg"),
];

static KNOWN: RwLock<Vec<&'static str>> = RwLock::new(Vec::new());

/// The columns that formulas name which have been read, by their place in a sample.
pub fn columns() -> Vec<&'static str> {
    KNOWN.read().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Whether formulas could name a column so: a word that means nothing else in them.
pub fn can_be_column(name: &str) -> bool {
    is_word(name) && !is_function(name) && !QUANTITIES.iter().any(|quantity| quantity.name == name)
}

/// Whether a name is a word.
pub(super) fn is_word(name: &str) -> bool {
    let in_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(in_word) && name.len() <= MAX_NAME
}

/// Whether a name is that of a function.
pub(super) fn is_function(name: &str) -> bool {
    functions().any(|function| function == name)
}

/// Unit of a column that needs no declaration.
pub fn usual_unit(name: &str) -> Option<&'static str> {
    USUAL_COLUMNS.iter().find(|(usual, _)| *usual == name).map(|(_, unit)| *unit)
}

/// A column of flight files and its place in a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FurtherColumn {
    pub(super) name: &'static str,
    pub(super) place: usize,
}

/// The place of a column in every sample that is prepared from now on; nothing where all are taken.
pub fn place_of_column(name: &str) -> Option<usize> {
    placed(name).map(|column| column.place)
}

/// Finds the place of a column, or gives it one; nothing where all are taken.
pub(super) fn placed(name: &str) -> Option<FurtherColumn> {
    let mut known = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
    if let Some(place) = known.iter().position(|own| *own == name) {
        return Some(FurtherColumn { name: known[place], place });
    }
    if known.len() >= MAX_FURTHER {
        return None;
    }
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    known.push(name);
    Some(FurtherColumn { name, place: known.len() - 1 })
}
