//! What is kept of a flight: a row of the index.

use serde::{Deserialize, Serialize};

use sysid::Severity;

use crate::equations::Equations;

/// What became of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    /// It is fitted.
    Used,
    /// Its checks found a fault that makes every conclusion wrong, or nothing in it flies.
    Refused,
    /// The file cannot be read.
    NotReadable,
    /// It could be read, and the craft has no model to look at it with.
    NoModel,
}

/// A fault that the checks of a log found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct LoggerFault {
    /// Its kind, such as "clock-offset".
    pub kind: String,
    /// What is done about it.
    pub severity: Severity,
    /// What was found.
    pub sentence: String,
}

/// A flight as it is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The craft.
    pub craft: String,
    /// Path in the fleet's folder.
    pub file: String,
    /// Which flight of the file, from 0.
    pub part: usize,
    /// Name of the flight.
    pub name: String,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// When the file was last changed, Unix time in ns.
    pub changed_ns: i64,
    /// SHA-256 of the file, hexadecimal.
    pub sha256: String,
    /// SHA-256 of all else that the row depends on: vehicle file, files beside the flight, reference model, this program's way to
    /// prepare flights.
    pub context: String,
    /// What became of it.
    pub state: State,
    /// Why it is not used.
    pub why: String,
    /// When it began by its log, Unix time in s.
    pub logged_unix_s: Option<f64>,
    /// Time in the air that is used, s.
    pub airborne_s: f64,
    /// Parts of the log that are used: first and last time of each, s.
    pub parts_s: Vec<f64>,
    /// Sampling period, s.
    pub period_s: f64,
    /// Mean and lowest voltage, V; NaN where none was logged.
    pub mean_v: f64,
    /// Lowest voltage, V.
    pub lowest_v: f64,
    /// How late the motors' samples are, s; NaN where that was not found.
    pub late_s: f64,
    /// Mean command of each motor over the mean of all four.
    pub motor_shares: [f64; 4],
    /// Mean command of all motors, in the vehicle file's unit.
    pub mean_command: f64,
    /// What the checks found.
    pub faults: Vec<LoggerFault>,
    /// Its normal equations; empty where it is not used.
    pub equations: Equations,
}

impl Row {
    /// A file that gave no flight.
    pub(crate) fn without_flight(state: State, why: String) -> Self {
        Self {
            craft: String::new(),
            file: String::new(),
            part: 0,
            name: String::new(),
            bytes: 0,
            changed_ns: 0,
            sha256: String::new(),
            context: String::new(),
            state,
            why,
            logged_unix_s: None,
            airborne_s: 0.0,
            parts_s: Vec::new(),
            period_s: f64::NAN,
            mean_v: f64::NAN,
            lowest_v: f64::NAN,
            late_s: f64::NAN,
            motor_shares: [f64::NAN; 4],
            mean_command: f64::NAN,
            faults: Vec::new(),
            equations: Equations::default(),
        }
    }

    /// Where it belongs in the index.
    pub(crate) fn place(&self) -> (&str, &str, usize) {
        (&self.craft, &self.file, self.part)
    }

    /// The path that flights are told apart by: with the number of the flight, where a log has several.
    pub fn label(&self) -> String {
        if self.part == 0 { self.file.clone() } else { format!("{}#{}", self.file, self.part + 1) }
    }
}
