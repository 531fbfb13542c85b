//! What a craft is: its gains file and its vehicle file, and one hash of both.
//!
//! The hash is SHA-256 of the gains file with the vehicle file behind it, byte for byte: `cat
//! gains.toml vehicle.toml | sha256sum`. The craft's computer takes it of the files that it is
//! started with, the microcontroller carries it in the image that was built from them, and both
//! send it when they are asked for their identity. Two craft with equal hashes fly alike.

use std::ops::RangeInclusive;
use std::path::Path;

use control::Config;
use control::supervision_limits::BatteryLevels;
use serde::Deserialize;
use sha2::{Digest, Sha256};

use crate::{Gains, GainsError, VehicleId, read, toml_message};

/// The part of a vehicle file that a craft's program needs; the rest is for models.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Vehicle {
    /// Its name.
    pub name: String,
    /// Its motors.
    pub motors: Motors,
    /// Its battery.
    #[serde(default)]
    pub battery: Pack,
}

/// The battery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub struct Pack {
    /// Cells in series, if the file says it.
    pub cells: Option<u8>,
}

/// The motors' commands.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Motors {
    /// Unit of a command.
    pub command_unit: String,
    /// Lowest and highest command.
    pub command_range: [f64; 2],
}

/// Cells that a pack can have in series.
pub const CELLS: RangeInclusive<u8> = 1..=14;

/// The two files, read and found to belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct CraftFiles {
    /// What flies.
    pub config: Config,
    /// Which craft it flies.
    pub vehicle: Vehicle,
    /// [`craft_sha256`] of both.
    pub sha256: [u8; 32],
}

impl CraftFiles {
    /// Reads both. `measured_sha256` is that of the vehicle's measurements, if the gains are to be
    /// compared with it too.
    ///
    /// # Errors
    /// The first thing that is wrong: which file, what, and how to mend it. Gains that do not say
    /// which vehicle they are for, that are for another one, or for another range of commands.
    pub fn read(gains: &Path, vehicle: &Path, measured_sha256: Option<&str>) -> Result<Self, GainsError> {
        let (vehicle_text, gains_text) = (read(vehicle, "vehicle")?, read(gains, "gains")?);
        let sha256 = craft_sha256(gains_text.as_bytes(), vehicle_text.as_bytes());
        let refuse = |message: String| GainsError::Parse { path: vehicle.to_owned(), message };
        let vehicle: Vehicle =
            toml::from_str(&vehicle_text).map_err(|error| refuse(toml_message(&vehicle_text, &error)))?;
        if let Some(cells) = vehicle.battery.cells.filter(|cells| !CELLS.contains(cells)) {
            let message = format!("battery.cells = {cells} is impossible: cells in series, 1 to 14");
            return Err(refuse(message));
        }
        let config = flies(&vehicle, measured_sha256, Gains::parse(&gains_text, gains)?, gains)?;
        Ok(Self { config, vehicle, sha256 })
    }

    /// With battery levels for the supervisor where the gains have none: those of a pack of so many
    /// cells, and if that is not said, of the vehicle's.
    #[must_use]
    pub fn with_battery_levels(mut self, cells: Option<u8>) -> Self {
        let levels = &mut self.config.supervision.battery;
        if let Some(cells) = cells.or(self.vehicle.battery.cells)
            && !levels.are_given()
        {
            *levels = BatteryLevels::of_cells(cells);
        }
        self
    }
}

/// SHA-256 of a gains file with its vehicle file behind it.
pub fn craft_sha256(gains: &[u8], vehicle: &[u8]) -> [u8; 32] {
    Sha256::new().chain_update(gains).chain_update(vehicle).finalize().into()
}

/// The gains, if they are for this vehicle.
fn flies(
    vehicle: &Vehicle,
    measured_sha256: Option<&str>,
    gains: Gains,
    path: &Path,
) -> Result<Config, GainsError> {
    let refuse = |message: String| Err(GainsError::Parse { path: path.to_owned(), message });
    if gains.provenance.is_none() {
        return refuse(format!(
            "it has no [provenance] that says which vehicle it is for; `quadlab design` writes one, or add `vehicle = {:?}` yourself",
            vehicle.name
        ));
    }
    gains.belongs_to(&VehicleId { name: &vehicle.name, sha256: measured_sha256 }, path)?;
    if gains.config.command_range != vehicle.motors.command_range {
        return refuse(format!(
            "command_range is {:?}, the vehicle's is {:?}: design the gains anew with this vehicle file",
            gains.config.command_range, vehicle.motors.command_range
        ));
    }
    Ok(gains.config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn in_the_tree(name: &str) -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../host-sim/model/vehicles").join(name)
    }

    /// By coreutils.
    #[test]
    fn the_hash_is_what_anybody_can_compute() {
        let (gains, vehicle) = (in_the_tree("f330-gains.toml"), in_the_tree("f330.toml"));
        let files = CraftFiles::read(&gains, &vehicle, None).unwrap();
        let shell = format!("cat {} {} | sha256sum", gains.display(), vehicle.display());
        let said = std::process::Command::new("sh").args(["-c", &shell]).output().unwrap().stdout;
        let hash: String = files.sha256.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(String::from_utf8(said).unwrap().split(' ').next(), Some(hash.as_str()));
        assert_eq!((files.vehicle.name.as_str(), files.config), ("F330 (thesis)", Config::thesis()));
    }

    #[test]
    fn a_vehicle_file_that_is_none_is_named() {
        let gains = in_the_tree("f330-gains.toml");
        let message = CraftFiles::read(&gains, &gains, None).unwrap_err().to_string();
        assert!(message.contains("f330-gains.toml: ") && message.contains("name"), "{message}");
        let message = CraftFiles::read(&gains, Path::new("/none.toml"), None).unwrap_err().to_string();
        assert!(message.starts_with("/none.toml: cannot read the vehicle file: "), "{message}");
    }
}
