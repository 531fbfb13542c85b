//! A file of users' effects as it is written, and what can be wrong with it.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Most users' effects in one program.
pub const MAX_EFFECTS: usize = 16;
/// Most definitions in one program: an effect that is edited has one for each of its texts.
pub const MAX_DEFINITIONS: usize = 4096;
/// Most definitions of the program's own making, such as forms that a search tries: some hundred megabytes.
pub(super) const MAX_OWN_DEFINITIONS: usize = 65_536;
/// Largest file, bytes.
pub const MAX_FILE_BYTES: u64 = 64 * 1024;
/// Most coefficients of one effect.
pub const MAX_COEFFICIENTS: usize = 8;
pub(super) const MAX_CONSTANTS: usize = 32;
/// Longest identifier or name, and longest sentence, characters.
pub(super) const MAX_NAME: usize = 40;
pub(super) const MAX_SENTENCE: usize = 300;
/// Most starts of a fit.
pub(super) const MAX_STARTS: usize = 27;

/// One coefficient as a file gives it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoefficientDefinition {
    /// Name in formulas and in results.
    pub name: String,
    /// Unit, coherent SI.
    pub unit: String,
    /// Smallest and largest physically possible value.
    pub possible: [f64; 2],
    /// An ordinary magnitude.
    pub typical: f64,
}

/// A number with a unit that formulas can name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantDefinition {
    /// Name in formulas.
    pub name: String,
    /// Unit, coherent SI.
    pub unit: String,
    /// Value in that unit.
    pub value: f64,
}

/// A further column of flight files that formulas can name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnDefinition {
    /// Name in formulas and in the header of flight files.
    pub name: String,
    /// Unit, coherent SI.
    pub unit: String,
}

/// An effect as a file gives it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// The word for it.
    pub id: String,
    /// One sentence for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sentence: Option<String>,
    /// The manoeuvre that shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation: Option<String>,
    /// Formula of each row it acts on.
    pub acceleration: BTreeMap<String, String>,
    /// Effects that look alike, each with the manoeuvre that separates the two.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub confused_with: BTreeMap<String, String>,
    /// Its coefficients, in order.
    pub coefficient: Vec<CoefficientDefinition>,
    /// Its constants.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constant: Vec<ConstantDefinition>,
    /// Columns of flight files in its formulas.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub column: Vec<ColumnDefinition>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) effect: Vec<Definition>,
}

/// The text of a file of effects.
pub fn file_of(definitions: Vec<Definition>) -> String {
    // Tables, text and numbers alone: there is nothing in it that TOML cannot hold.
    toml::to_string(&File { effect: definitions }).unwrap_or_default()
}

/// Why a user's effect was refused.
#[derive(Debug, thiserror::Error)]
pub enum UserEffectError {
    /// The file cannot be read.
    #[error("{}: cannot read the file of effects: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Far larger than any definition.
    #[error("{}: is larger than {MAX_FILE_BYTES} bytes, which no file of effects is", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// Not TOML, a field missing, unknown or of the wrong type.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The parser's message on one line.
        message: String,
    },
    /// A field that cannot be right.
    #[error("{}: effect \"{effect}\": {field}: {problem}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The effect.
        effect: String,
        /// The field.
        field: String,
        /// What is wrong with it.
        problem: String,
    },
    /// More than are kept.
    #[error("{}: more than {MAX_EFFECTS} effects of users; leave out some", path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
    },
    /// More texts of effects than one program keeps.
    #[error("{}: more than {MAX_DEFINITIONS} effects have been tried; end quadlab and start it again", path.display())]
    TooManyChanges {
        /// The file.
        path: PathBuf,
    },
}
