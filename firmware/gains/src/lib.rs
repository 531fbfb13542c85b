//! The gains file: a [`control::Config`] in TOML, with a `[provenance]` table that says which
//! vehicle it is for and how it was made. The configuration is what flies; the provenance is for
//! people, and to refuse the file on another vehicle.
//!
//! One reader serves all who fly or judge gains: the craft's computer, the simulation, the design.
//! [`Gains::read`] checks every number; [`Gains::belongs_to`] refuses another vehicle, by name and,
//! where the file has one, by the SHA-256 of what the operator measured of it
//! (`model::Vehicle::sha256`, which `quadlab design` writes). The craft's computer has no model, so
//! it is given both; a program with a model also compares what the law does with its rotors
//! (`design::gains_match`). [`CraftFiles`] are the gains with the vehicle file that they fly: what
//! every craft's program is built or started with, and the hash that identifies it.
//!
//! Deliberately absent: writing to disk, and what the numbers mean (`control::gains`).
#![forbid(unsafe_code)]

mod craft_files;

use std::path::{Path, PathBuf};

use control::Config;
pub use craft_files::{CELLS, CraftFiles, Motors, Vehicle, craft_sha256};
use serde::{Deserialize, Serialize};

/// Where gains come from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the vehicle they are for, as in its vehicle file.
    pub vehicle: String,
    /// SHA-256 of what is known of the vehicle, hexadecimal; absent: the name has to do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vehicle_sha256: Option<String>,
    /// How they were made, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// SHA-256 of the model file they were designed on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_sha256: Option<String>,
    /// What was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specs: Option<toml::Table>,
    /// What was reached: margins of each loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margins: Option<toml::Table>,
}

/// A vehicle as a gains file knows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VehicleId<'a> {
    /// Its name, as in its vehicle file.
    pub name: &'a str,
    /// SHA-256 of what is known of it, hexadecimal; absent: only the name is compared.
    pub sha256: Option<&'a str>,
}

/// A gains file.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// What flies.
    pub config: Config,
    /// Where it comes from, if the file says so.
    pub provenance: Option<Provenance>,
}

/// Why a gains file was refused: one clear line each.
#[derive(Debug, thiserror::Error)]
pub enum GainsError {
    /// The file cannot be read.
    #[error("{}: cannot read the {what} file: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What it should be.
        what: &'static str,
        /// What the system said.
        reason: std::io::Error,
    },
    /// Not TOML, a field missing, unknown or impossible.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong, on one line.
        message: String,
    },
    /// The gains belong to another vehicle.
    #[error("{}: these gains belong to another vehicle: {reason}", path.display())]
    OtherVehicle {
        /// The gains file.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
}

const PROVENANCE: &str = "provenance";
/// Longest gains file, bytes: a hundred times what `quadlab design` writes. In memory a table takes a hundred times its text.
const LONGEST_BYTES: usize = 1 << 18;

impl Gains {
    /// Reads and checks a gains file.
    ///
    /// # Errors
    /// A file that cannot be read, is not a gains file, or holds a number that cannot be flown.
    pub fn read(path: &Path) -> Result<Self, GainsError> {
        Self::parse(&read(path, "gains")?, path)
    }

    /// Parses and checks the text of a gains file; `path` is for messages.
    ///
    /// # Errors
    /// As [`Gains::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, GainsError> {
        let refuse = |message: String| GainsError::Parse { path: path.to_owned(), message };
        if text.len() > LONGEST_BYTES {
            return Err(refuse(format!(
                "has {} bytes, and no gains file has more than {LONGEST_BYTES}",
                text.len()
            )));
        }
        let mut table: toml::Table = toml::from_str(text).map_err(|e| refuse(toml_message(text, &e)))?;
        let provenance = table
            .remove(PROVENANCE)
            .map(Provenance::deserialize)
            .transpose()
            .map_err(|e| refuse(format!("[provenance]: {}", e.message().replace('\n', " "))))?;
        // Parsed from the text again where it can be, so that errors carry a line.
        let config = match provenance {
            None => toml::from_str(text).map_err(|e| refuse(toml_message(text, &e)))?,
            Some(_) => Config::deserialize(table).map_err(|e| refuse(e.message().replace('\n', " ")))?,
        };
        config.check().map_err(|e| refuse(e.to_string()))?;
        Ok(Self { config, provenance })
    }

    /// The text of the gains file.
    ///
    /// # Panics
    /// Never: numbers, strings and tables always become TOML.
    pub fn to_toml(&self) -> String {
        let mut text = toml::to_string(&self.config).expect("numbers and tables are always TOML");
        if let Some(provenance) = &self.provenance {
            let mut table = toml::Table::new();
            let value = toml::Value::try_from(provenance).expect("strings and tables are always TOML");
            table.insert(PROVENANCE.into(), value);
            text.push('\n');
            text.push_str(&toml::to_string(&table).expect("strings and tables are always TOML"));
        }
        text
    }

    /// Refuses gains whose provenance names another vehicle, or the same name with other
    /// measurements. A file without provenance says nothing about its vehicle and passes. `path` is
    /// for messages.
    ///
    /// # Errors
    /// [`GainsError::OtherVehicle`].
    pub fn belongs_to(&self, vehicle: &VehicleId, path: &Path) -> Result<(), GainsError> {
        let refuse = |reason| Err(GainsError::OtherVehicle { path: path.to_owned(), reason });
        let Some(provenance) = &self.provenance else { return Ok(()) };
        let name = vehicle.name;
        if provenance.vehicle != name {
            return refuse(format!("they are for \"{}\", this is \"{name}\"", provenance.vehicle));
        }
        match (&provenance.vehicle_sha256, vehicle.sha256) {
            (Some(theirs), Some(ours)) if theirs != ours => refuse(format!(
                "they are for a \"{name}\" with other measurements (vehicle_sha256 {}..., this one {}...); design them again for this vehicle",
                start(theirs),
                start(ours)
            )),
            _ => Ok(()),
        }
    }
}

fn read(path: &Path, what: &'static str) -> Result<String, GainsError> {
    std::fs::read_to_string(path).map_err(|reason| GainsError::Read { path: path.to_owned(), what, reason })
}

/// As much of a hash as people compare.
fn start(hash: &str) -> String {
    hash.chars().take(12).collect()
}

/// A TOML error as one line with the line number, without the excerpt.
pub fn toml_message(text: &str, error: &toml::de::Error) -> String {
    let reason = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => {
            let line = text[..span.start.min(text.len())].matches('\n').count() + 1;
            format!("line {line}: {reason}")
        }
        None => reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const THESIS: &str = include_str!("../../../host-sim/model/vehicles/f330-gains.toml");

    fn parse(text: &str) -> Result<Gains, GainsError> {
        Gains::parse(text, Path::new("g.toml"))
    }

    #[test]
    fn the_file_in_the_tree_is_the_thesis_configuration() {
        assert_eq!(parse(THESIS).unwrap().config, Config::thesis());
    }

    fn provenance() -> Provenance {
        Provenance {
            vehicle: "a \"craft\"".into(),
            vehicle_sha256: Some("ab".repeat(32)),
            source: "design".into(),
            model_sha256: Some("00ff".into()),
            specs: Some(toml::toml! { phase_margin_deg = 45.0 }),
            margins: None,
        }
    }

    #[test]
    fn a_gains_file_round_trips_exactly() {
        for provenance in [None, Some(provenance())] {
            for config in [Config::thesis(), Config::thesis_hand_tuned()] {
                let gains = Gains { config, provenance: provenance.clone() };
                let text = gains.to_toml();
                assert_eq!(parse(&text).unwrap(), gains, "{text}");
            }
        }
    }

    #[test]
    fn mistakes_are_named() {
        for (from, to, expected) in [
            ("kp = 100.0", "kpp = 100.0", "kpp"),
            ("kp = 100.0", "kp = nan", "kp is NaN"),
            ("sample_time_s = 0.01", "sample_time_s = 0.0", "sample_time_s"),
            ("vehicle = ", "vehicel = ", "vehicel"),
            ("[provenance]", "[provenance", "line"),
        ] {
            assert!(THESIS.contains(from), "{from}");
            let error = parse(&THESIS.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.starts_with("g.toml: ") && error.contains(expected), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        let gone = Gains::read(Path::new("/nowhere/g.toml")).unwrap_err().to_string();
        assert!(gone.starts_with("/nowhere/g.toml: cannot read"), "{gone}");
    }

    #[test]
    fn another_vehicle_is_refused_by_name_and_by_hash() {
        let gains = Gains { config: Config::thesis(), provenance: Some(provenance()) };
        let (hash, other) = ("ab".repeat(32), "cd".repeat(32));
        let check = |name: &str, sha256: Option<&str>| {
            gains.belongs_to(&VehicleId { name, sha256 }, Path::new("g.toml")).map_err(|e| e.to_string())
        };
        assert_eq!(check("a \"craft\"", Some(&hash)), Ok(()));
        assert_eq!(check("a \"craft\"", None), Ok(()), "nothing to compare with");
        let by_name = check("other", Some(&hash)).unwrap_err();
        assert!(by_name.contains("\"other\"") && by_name.lines().count() == 1, "{by_name}");
        let by_hash = check("a \"craft\"", Some(&other)).unwrap_err();
        assert!(by_hash.contains("abababababab...") && by_hash.contains("cdcdcdcdcdcd..."), "{by_hash}");
        let silent = Gains { provenance: None, ..gains.clone() };
        assert!(silent.belongs_to(&VehicleId { name: "any", sha256: None }, Path::new("g.toml")).is_ok());
    }
}
