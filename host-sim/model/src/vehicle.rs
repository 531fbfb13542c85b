//! The vehicle file: what the operator knows before any flight.
//!
//! Mass and geometry from scale and tape measure, the rotor map from a motor test stand (4.11). Unknown keys and
//! impossible values are errors that name the field.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::log_columns::{LogColumns, LogFrames};
use crate::rotor_quantity::RotorQuantity;

/// Direction of rotation of a rotor, seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Spin {
    /// Counter-clockwise seen from above: its reaction torque yaws the craft right (+r).
    Ccw,
    /// Clockwise seen from above: its reaction torque yaws the craft left (-r).
    Cw,
}

impl Spin {
    /// +1 where a faster rotor yaws the craft right (counter-clockwise), -1 where it yaws left.
    pub const fn yaw_sign(self) -> f64 {
        match self {
            Spin::Ccw => 1.0,
            Spin::Cw => -1.0,
        }
    }
}

/// Where rotor speeds come from when they are not logged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotorMapKind {
    /// No test stand: the command itself stands in for the rotor speed and the fit absorbs the scale.
    Identify,
}

/// The `[motors]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motors {
    /// Direction of rotation of rotors 1..4 seen from above.
    pub spin: [Spin; 4],
    /// Unit of the commands, for people: "us", "normalised", ...
    pub command_unit: String,
    /// Smallest and largest command.
    pub command_range: [f64; 2],
    /// `"identify"` when there is no test stand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MotorMapKind>,
    /// Rotor speed per command, rad/s per command unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<f64>,
    /// Rotor speed per volt, rad/s/V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voltage: Option<f64>,
    /// Rotor speed offset, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// First-order lag of the rotor speed, rad/s; absent = unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag: Option<f64>,
    /// Numbers in the log of the motors front-left, front-right, rear-right, rear-left; absent = 1, 2, 3, 4. All else in this
    /// table is in our order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_order: Option<[usize; 4]>,
}

/// Refuses a field's value; the last word is what it should be.
type Refuse<'a> = &'a dyn Fn(&'static str, String, &'static str) -> Result<(), VehicleError>;

impl Motors {
    fn check(&self, refuse: Refuse<'_>) -> Result<(), VehicleError> {
        let [low, high] = self.command_range;
        if !(low.is_finite() && high.is_finite() && low < high) {
            return refuse(
                "motors.command_range",
                format!("{:?}", self.command_range),
                "[smallest, largest]",
            );
        }
        let turning: f64 = self.spin.iter().map(|s| s.yaw_sign()).sum();
        if turning != 0.0 {
            return refuse(
                "motors.spin",
                format!("{:?}", self.spin),
                "two rotors each way, or yaw cannot be balanced",
            );
        }
        if let Some(lag) = self.lag
            && !(lag > 0.0 && lag < 1000.0)
        {
            return refuse(
                "motors.lag",
                lag.to_string(),
                "rad/s, above 0 and below 1000 (leave out if unknown)",
            );
        }
        match (self.map, self.command) {
            (Some(MotorMapKind::Identify), None) if self.voltage.is_none() && self.offset.is_none() => Ok(()),
            (Some(MotorMapKind::Identify), _) => refuse(
                "motors.map",
                "\"identify\"".into(),
                "leave out motors.command, voltage and offset when the map is to be identified",
            ),
            (None, Some(gain)) if gain.is_finite() && gain > 0.0 => {
                let finite =
                    self.voltage.unwrap_or(0.0).is_finite() && self.offset.unwrap_or(0.0).is_finite();
                if finite {
                    Ok(())
                } else {
                    refuse("motors.voltage/offset", "not finite".into(), "finite numbers")
                }
            }
            (None, Some(gain)) => {
                refuse("motors.command", gain.to_string(), "rad/s per command unit, above 0")
            }
            // No map at all: flights must log their rotor speeds (omega1..4).
            (None, None) if self.voltage.is_none() && self.offset.is_none() => Ok(()),
            (None, None) => refuse(
                "motors.command",
                "missing".into(),
                "a map needs motors.command besides voltage and offset; leave out all three if rotor speeds are logged",
            ),
        }
    }
}

/// Commanded rotor speed from command and voltage, (4.10): `command * cmd + voltage * vbat + offset`, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotorMap {
    /// rad/s per command unit.
    pub command: f64,
    /// rad/s per volt.
    pub voltage: f64,
    /// rad/s.
    pub offset: f64,
}

impl RotorMap {
    /// Commanded rotor speed in rad/s, never below zero: an electronic speed controller does not brake into reverse.
    #[inline]
    pub fn speed_rad_s(&self, command: f64, battery_v: f64) -> f64 {
        (self.command * command + self.voltage * battery_v + self.offset).max(0.0)
    }

    /// The command that asks for a rotor speed at a battery voltage.
    pub fn command_for(&self, speed_rad_s: f64, battery_v: f64) -> f64 {
        (speed_rad_s - self.voltage * battery_v - self.offset) / self.command
    }
}

/// The `[battery]` table: what the craft's program warns and lands by where gains and com.toml say nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pack {
    /// Cells in series, 1 to 14; absent = unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cells: Option<u8>,
}

impl Pack {
    /// Cells that a pack can have in series.
    pub const CELLS: RangeInclusive<u8> = 1..=14;

    /// Whether nothing is said of it.
    pub fn is_unknown(&self) -> bool {
        self.cells.is_none()
    }
}

/// A vehicle file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vehicle {
    /// Name for people.
    pub name: String,
    /// kg.
    pub mass: f64,
    /// Centre of mass to motor, m.
    pub arm_length: f64,
    /// m.
    pub rotor_radius: f64,
    /// kg/m^3.
    pub air_density: f64,
    /// m/s^2.
    pub gravity: f64,
    /// From the centre of mass to the tracked point, body FRD, m.
    #[serde(default)]
    pub tracked_point: [f64; 3],
    /// Fields that stand at usual values because no one has measured them yet: "mass", "motors.spin".
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unmeasured: Vec<String>,
    /// Motors, rotors and their map.
    pub motors: Motors,
    /// Its battery.
    #[serde(default, skip_serializing_if = "Pack::is_unknown")]
    pub battery: Pack,
    /// Which column of its flights is which, where no `columns.toml` lies beside them.
    #[serde(default, skip_serializing_if = "LogColumns::is_empty")]
    pub columns: LogColumns,
    /// Frames of its flights, where no `columns.toml` lies beside them.
    #[serde(default, skip_serializing_if = "LogFrames::are_ours")]
    pub frames: LogFrames,
}

/// Why a vehicle file was refused.
#[derive(Debug, thiserror::Error)]
pub enum VehicleError {
    /// The file cannot be read.
    #[error("{}: cannot read the vehicle file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML, a field missing, unknown or of the wrong type.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The parser's message on one line.
        message: String,
    },
    /// A value that no vehicle has.
    #[error("{}: {field} = {value} is impossible: {expected}", path.display())]
    Impossible {
        /// The file.
        path: PathBuf,
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
        /// What it should be.
        expected: &'static str,
    },
}

impl Vehicle {
    /// SHA-256, hexadecimal, of everything the file says of the craft, whatever its layout: which vehicle gains were designed for.
    /// Equal for a vehicle file and for the models identified with it. How its logs are written is not of the craft, and neither is
    /// the battery, which is changed.
    pub fn sha256(&self) -> String {
        let mut hash = Sha256::new();
        let mut text = |text: &str| {
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text);
        };
        text(&self.name);
        text(&self.motors.command_unit);
        let m = &self.motors;
        let mut number = |number: f64| hash.update((number + 0.0).to_le_bytes());
        let lengths = [self.mass, self.arm_length, self.rotor_radius, self.air_density, self.gravity];
        let turns = m.spin.map(Spin::yaw_sign);
        for x in lengths.into_iter().chain(self.tracked_point).chain(turns).chain(m.command_range) {
            number(x);
        }
        // A number that is not given is none that could be: all of them are finite.
        for x in [m.command, m.voltage, m.offset, m.lag] {
            number(x.unwrap_or(f64::INFINITY));
        }
        number(f64::from(u8::from(m.map.is_some())));
        hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Reads and checks a vehicle file.
    pub fn read(path: &Path) -> Result<Self, VehicleError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| VehicleError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Parses and checks the text of a vehicle file; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self, VehicleError> {
        if let Some(message) = too_long(text, "a vehicle file") {
            return Err(VehicleError::Parse { path: path.to_owned(), message });
        }
        let vehicle: Self = toml::from_str(text).map_err(|error| VehicleError::Parse {
            path: path.to_owned(),
            message: toml_message(text, &error),
        })?;
        vehicle.check(path)?;
        Ok(vehicle)
    }

    /// Checks every value against what a quadcopter can have; `path` is for messages.
    pub fn check(&self, path: &Path) -> Result<(), VehicleError> {
        let refuse = |field, value: String, expected| {
            Err(VehicleError::Impossible { path: path.to_owned(), field, value, expected })
        };
        let ranges: [(&'static str, f64, f64, f64, &'static str); 5] = [
            ("mass", self.mass, 0.001, 1000.0, "kilograms, between 0.001 and 1000"),
            (
                "arm_length",
                self.arm_length,
                0.005,
                10.0,
                "metres from the centre to a motor, between 0.005 and 10",
            ),
            ("rotor_radius", self.rotor_radius, 0.002, 5.0, "metres, between 0.002 and 5"),
            ("air_density", self.air_density, 0.1, 5.0, "kg/m^3, between 0.1 and 5"),
            ("gravity", self.gravity, 1.0, 30.0, "m/s^2, between 1 and 30"),
        ];
        for (field, value, low, high, expected) in ranges {
            if !(value >= low && value <= high) {
                return refuse(field, value.to_string(), expected);
            }
        }
        if self.tracked_point.iter().any(|x| x.is_nan() || x.abs() > 10.0) {
            return refuse("tracked_point", format!("{:?}", self.tracked_point), "metres, each within 10");
        }
        if let Some(cells) = self.battery.cells
            && !Pack::CELLS.contains(&cells)
        {
            return refuse("battery.cells", cells.to_string(), "cells in series, 1 to 14");
        }
        self.motors.check(&refuse)
    }

    /// The vehicle of flights that are in our columns, frames and motor order.
    #[must_use]
    pub fn with_our_columns(mut self) -> Self {
        (self.columns, self.frames, self.motors.log_order) = Default::default();
        self
    }

    /// The rotor map. Without a test stand the command stands in for the speed: gain 1, so that "speeds" are in
    /// command units and the coefficients absorb the scale.
    pub fn rotor_map(&self) -> RotorMap {
        match self.motors.map {
            Some(MotorMapKind::Identify) => RotorMap { command: 1.0, voltage: 0.0, offset: 0.0 },
            None => RotorMap {
                command: self.motors.command.unwrap_or(1.0),
                voltage: self.motors.voltage.unwrap_or(0.0),
                offset: self.motors.offset.unwrap_or(0.0),
            },
        }
    }

    /// Whether rotor speeds can be computed from commands; if not, flights must log them.
    pub fn can_map_commands(&self) -> bool {
        self.motors.map.is_some() || self.motors.command.is_some()
    }

    /// Whether rotor speeds computed by [`Self::rotor_map`] are real rad/s.
    pub fn has_rotor_map(&self) -> bool {
        self.motors.map.is_none()
    }

    /// What stands for the speed of a rotor in a model of this vehicle: its speed where there is a map, or where it is
    /// logged, which then takes the map's place.
    pub fn rotor_quantity(&self, rotor_speeds_logged: bool) -> RotorQuantity {
        if self.has_rotor_map() || rotor_speeds_logged {
            RotorQuantity::Speed
        } else {
            RotorQuantity::Command
        }
    }

    /// Rotor hubs in the body frame, forward and right of the centre, m: +-l/sqrt(2).
    pub fn hubs_m(&self) -> [[f64; 2]; 4] {
        let reach = self.arm_length * std::f64::consts::FRAC_1_SQRT_2;
        [[reach, -reach], [reach, reach], [-reach, reach], [-reach, -reach]]
    }

    /// beta = rho A_R R_R^2 with the disk area A_R = pi R_R^2 (reference section 1), kg m: thrust is C_T beta sum w^2.
    pub fn beta_kg_m(&self) -> f64 {
        let area_m2 = std::f64::consts::PI * self.rotor_radius * self.rotor_radius;
        self.air_density * area_m2 * self.rotor_radius * self.rotor_radius
    }

    /// The thesis' F330 of table 3.1.
    pub fn thesis() -> Self {
        let text = include_str!("../vehicles/f330.toml");
        Self::parse(text, Path::new("f330.toml")).expect("the vehicle file in the source tree is tested")
    }
}

/// Longest file of a vehicle, of a model, or of a map of columns, bytes: a hundred times a long one. In memory a table takes a
/// hundred times its text.
pub const LONGEST_TOML_BYTES: usize = 1 << 18;

/// Why a text is too long to be such a file, if it is. `expected` names the kind of file: "a model file".
pub fn too_long(text: &str, expected: &str) -> Option<String> {
    (text.len() > LONGEST_TOML_BYTES).then(|| {
        format!(
            "is too large for {expected}: it has {} bytes, the limit is {LONGEST_TOML_BYTES}; give {expected}",
            text.len()
        )
    })
}

/// A TOML error as one line with the line number, without the excerpt.
pub(crate) fn toml_message(text: &str, error: &toml::de::Error) -> String {
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

    fn with(edit: impl Fn(&str) -> String) -> Result<Vehicle, VehicleError> {
        Vehicle::parse(&edit(include_str!("../vehicles/f330.toml")), Path::new("v.toml"))
    }

    #[test]
    fn thesis_vehicle_has_the_beta_of_the_reference() {
        assert!((Vehicle::thesis().beta_kg_m() / 4.100726391e-04 - 1.0).abs() < 1e-9);
    }

    /// Layout and comments do not matter, each number does.
    #[test]
    fn the_hash_tells_vehicles_apart_and_not_their_files() {
        let hash = Vehicle::thesis().sha256();
        assert_eq!(hash.len(), 64);
        let same = |text: &str| with(|_| text.to_owned()).unwrap().sha256() == hash;
        let text = include_str!("../vehicles/f330.toml");
        assert!(same(&toml::to_string(&Vehicle::thesis()).unwrap()));
        assert!(same(&format!("# a comment\n{text}")));
        for (from, to) in [
            ("mass = 1.214", "mass = 1.215"),
            ("lag = 21.5", ""),
            ("lag = 21.5", "lag = 21.6"),
            ("name = \"F330", "name = \"F331"),
        ] {
            assert!(text.contains(from), "{from}");
            assert!(!same(&text.replace(from, to)), "{from} -> {to}");
        }
        assert!(same(&format!("{text}\n[battery]\ncells = 3\n")));
        let error = with(|text| format!("{text}\n[battery]\ncells = 15\n")).unwrap_err().to_string();
        assert!(error.contains("battery.cells = 15 is impossible: cells in series, 1 to 14"), "{error}");
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line() {
        let error = with(|t| t.replace("gravity", "gravty")).unwrap_err().to_string();
        assert!(error.starts_with("v.toml: line ") && error.contains("gravty"), "{error}");
        assert_eq!(error.lines().count(), 1);
    }

    #[test]
    fn impossible_values_are_refused_by_name() {
        for (from, to, field) in [
            ("mass = 1.214", "mass = -1.0", "mass"),
            ("mass = 1.214", "mass = nan", "mass"),
            ("arm_length = 0.167", "arm_length = 167.0", "arm_length"),
            ("lag = 21.5", "lag = 0.0", "motors.lag"),
            ("command = 0.7850", "command = -0.7850", "motors.command"),
            ("\"ccw\", \"cw\", \"ccw\", \"cw\"", "\"ccw\", \"cw\", \"ccw\", \"ccw\"", "motors.spin"),
            ("[1000.0, 2000.0]", "[2000.0, 1000.0]", "motors.command_range"),
        ] {
            let error = with(|t| {
                assert!(t.contains(from), "{from}");
                t.replace(from, to)
            })
            .unwrap_err()
            .to_string();
            assert!(error.contains(field), "{error}");
        }
    }

    #[test]
    fn map_and_inverse_are_inverse() {
        let map = Vehicle::thesis().rotor_map();
        for command in [1100.0, 1500.0, 1900.0] {
            let speed = map.speed_rad_s(command, 11.1);
            assert!((map.command_for(speed, 11.1) - command).abs() < 1e-9);
        }
        // Reference section 1: largest speed at 11.1 V and 2000 us.
        assert!((map.speed_rad_s(2000.0, 11.1) - 860.52).abs() < 0.01);
    }
}
