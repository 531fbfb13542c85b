//! Messages that say something of the log as a whole: parameters, texts, units.

use std::collections::BTreeMap;

use crate::log::Log;

/// Texts that are kept. A log has a few dozens.
const MOST_TEXTS: usize = 256;

/// A message whose fields are found by name.
pub(super) trait Row {
    /// A text field.
    fn text(&self, label: &str) -> Option<String>;
    /// A number field.
    fn number(&self, label: &str) -> Option<f64>;
}

/// What is gathered on the way.
#[derive(Debug, Default)]
pub(super) struct Special {
    texts: usize,
    version: Option<String>,
    /// Letters of the units and of the multipliers by type.
    units: BTreeMap<u8, (String, String)>,
}

impl Special {
    /// Whether messages of a name say something.
    pub(super) fn wants(name: &str) -> bool {
        matches!(name, "PARM" | "MSG" | "VER" | "FMTU" | "UNIT" | "MULT")
    }

    /// Takes in a message of such a name.
    pub(super) fn take(&mut self, name: &str, row: &dyn Row, log: &mut Log) {
        match name {
            "PARM" => {
                if let (Some(name), Some(value)) =
                    (row.text("Name").filter(|name| !name.is_empty()), row.number("Value"))
                {
                    log.parameters.insert(name, value);
                }
            }
            "MSG" => self.message(row.text("Message"), log),
            "VER" => self.version = row.text("FWS").filter(|text| !text.is_empty()).or(self.version.take()),
            "FMTU" => {
                let kind = row.number("FmtType").map(|kind| kind as u8);
                if let (Some(kind), Some(units), Some(multipliers)) =
                    (kind, row.text("UnitIds"), row.text("MultIds"))
                {
                    self.units.insert(kind, (units, multipliers));
                }
            }
            "UNIT" => keep(log, "UNIT", row.number("Id"), row.text("Label")),
            "MULT" => {
                keep(log, "MULT", row.number("Id"), row.number("Mult").map(|factor| factor.to_string()))
            }
            _ => {}
        }
    }

    /// A text of the craft, numbered from 1; the first that names the program, and the first that names the frame.
    fn message(&mut self, text: Option<String>, log: &mut Log) {
        let Some(text) = text else { return };
        if log.firmware.is_none() && VEHICLES.iter().any(|vehicle| text.contains(vehicle)) {
            log.firmware = Some(text.clone());
        }
        if text.starts_with("Frame") {
            log.information.entry("frame".into()).or_insert_with(|| text.clone());
        }
        self.texts += 1;
        if self.texts <= MOST_TEXTS {
            log.information.insert(format!("MSG {:03}", self.texts), text);
        }
    }

    /// What can only be said at the end; `name` gives the name of a type.
    pub(super) fn finish(self, log: &mut Log, name: &dyn Fn(usize) -> Option<String>) {
        log.firmware = log.firmware.take().or(self.version);
        for (kind, (units, multipliers)) in self.units {
            if let Some(name) = name(kind.into()) {
                log.information.insert(format!("FMTU {name}"), format!("{units} {multipliers}"));
            }
        }
    }
}

/// The programs of ArduPilot by what their texts call them.
const VEHICLES: [&str; 8] = ["Copter", "Plane", "Rover", "Sub", "Tracker", "Blimp", "Heli", "QuadPlane"];

/// Keeps the meaning of a letter.
fn keep(log: &mut Log, what: &str, letter: Option<f64>, meaning: Option<String>) {
    let letter = letter.map(|letter| char::from(letter as u8)).filter(|letter| letter.is_ascii_graphic());
    if let (Some(letter), Some(meaning)) = (letter, meaning) {
        log.information.insert(format!("{what} {letter}"), meaning);
    }
}
