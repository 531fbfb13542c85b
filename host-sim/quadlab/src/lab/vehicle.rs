//! The vehicle file of the folder: as it is, or drafted from the flights until the page's form has been filled in.

use std::path::{Path, PathBuf};

use diagnosis::workflow::{Observer, import_log};
use flights::ColumnMap;
use logs::Import;
use model::{MotorMapKind, Spin, Vehicle};
use serde::Deserialize;
use serde_json::{Value, json};
use toml_edit::{DocumentMut, Item, TableLike, value};

use super::refused::Refused;
use crate::cli::model_files::{VEHICLE, read_vehicle};

/// What is known of the craft.
#[derive(Debug, Clone)]
pub(super) struct Craft {
    pub(super) vehicle: Vehicle,
    /// The text of its file, or that of a draft.
    text: String,
    /// Whether the file is there.
    pub(super) is_written: bool,
}

/// What the form sends: fields of the vehicle file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Measured {
    name: String,
    mass: f64,
    arm_length: f64,
    rotor_radius: f64,
    air_density: f64,
    gravity: f64,
    tracked_point: [f64; 3],
    spin: [Spin; 4],
    command_range: [f64; 2],
    unmeasured: Vec<String>,
}

impl Craft {
    /// Reads the vehicle file of a folder; without one, a draft is made of what its flights tell. Flights that cannot be
    /// read say why in the list of flights.
    pub(super) fn of(folder: &Path, flights: &[PathBuf], observer: &dyn Observer) -> anyhow::Result<Self> {
        let path = folder.join(VEHICLE);
        if path.is_file() {
            let vehicle = read_vehicle(&path)?;
            return Ok(Self { vehicle, text: std::fs::read_to_string(&path)?, is_written: true });
        }
        let import = |path: &PathBuf| import_log(path, &ColumnMap::beside(path).ok()?, observer).ok();
        let imports: Vec<Import> = flights.iter().filter_map(import).collect();
        match logs::draft(&imports).map_err(anyhow::Error::msg)? {
            Some(draft) => Ok(Self { text: draft.to_toml(), vehicle: draft.vehicle, is_written: false }),
            None => anyhow::bail!(
                "there is no {VEHICLE}, and no flight in this folder that tells of the craft: drop flights or logs on the page"
            ),
        }
    }

    /// What the page says of it at all times.
    pub(super) fn entry(&self) -> Value {
        json!({ "name": self.vehicle.name, "written": self.is_written, "unmeasured": self.vehicle.unmeasured })
    }

    /// What the form shows.
    pub(super) fn document(&self) -> Value {
        let Vehicle { name, mass, arm_length, rotor_radius, air_density, gravity, tracked_point, .. } =
            &self.vehicle;
        let motors = &self.vehicle.motors;
        let how = |field: &String| Some((field.clone(), json!(logs::how_to_measure(field)?)));
        let is_mapped = motors.map != Some(MotorMapKind::Identify);
        json!({
            "written": self.is_written,
            "fields": {
                "name": name,
                "mass": mass,
                "arm_length": arm_length,
                "rotor_radius": rotor_radius,
                "air_density": air_density,
                "gravity": gravity,
                "tracked_point": tracked_point,
                "spin": motors.spin,
                "command_range": motors.command_range,
                "unmeasured": self.vehicle.unmeasured,
            },
            "command_unit": motors.command_unit,
            "has_rotor_map": is_mapped,
            "how": self.vehicle.unmeasured.iter().filter_map(how).collect::<serde_json::Map<_, _>>(),
        })
    }

    /// Writes what was measured into the vehicle file of the folder; the rest of it stays as it is, comments too.
    pub(super) fn write(&self, folder: &Path, measured: &Measured) -> Result<(), Refused> {
        let path = folder.join(VEHICLE);
        let text = with(&self.text, measured)
            .ok_or_else(|| Refused::new(format!("{VEHICLE}: cannot be edited here: edit it as a text")))?;
        Vehicle::parse(&text, Path::new(VEHICLE))?;
        Ok(report::write_atomic(path, text)?)
    }
}

/// The text of a vehicle file with other values; nothing where it has no table of motors.
fn with(text: &str, measured: &Measured) -> Option<String> {
    let mut document: DocumentMut = text.parse().ok()?;
    let known: Vec<&str> = measured.unmeasured.iter().map(String::as_str).collect();
    let table = document.as_table_mut();
    put(table, "name", "name", value(measured.name.as_str()), &known);
    for (field, number) in [
        ("mass", measured.mass),
        ("arm_length", measured.arm_length),
        ("rotor_radius", measured.rotor_radius),
        ("air_density", measured.air_density),
        ("gravity", measured.gravity),
    ] {
        put(table, field, field, value(number), &known);
    }
    let array = |numbers: &[f64]| value(numbers.iter().copied().collect::<toml_edit::Array>());
    put(table, "tracked_point", "tracked_point", array(&measured.tracked_point), &known);
    if known.is_empty() {
        table.remove("unmeasured");
    } else {
        put(
            table,
            "unmeasured",
            "unmeasured",
            value(known.iter().copied().collect::<toml_edit::Array>()),
            &known,
        );
    }
    let motors = table.get_mut("motors")?.as_table_like_mut()?;
    let spin = measured.spin.map(|spin| if spin == Spin::Cw { "cw" } else { "ccw" });
    put(motors, "spin", "motors.spin", value(spin.into_iter().collect::<toml_edit::Array>()), &known);
    put(motors, "command_range", "motors.command_range", array(&measured.command_range), &known);
    Some(document.to_string())
}

/// Puts a value in the place of an old one, whose comment stays unless it says that nobody has measured it.
fn put(table: &mut dyn TableLike, key: &str, field: &str, mut new: Item, unmeasured: &[&str]) {
    if let (Some(old), Some(new)) = (table.get(key).and_then(Item::as_value), new.as_value_mut()) {
        *new.decor_mut() = old.decor().clone();
        let comment = old.decor().suffix().and_then(|suffix| suffix.as_str()).unwrap_or_default();
        if comment.contains("NOT MEASURED") && !unmeasured.contains(&field) {
            new.decor_mut().set_suffix("");
        }
    }
    // Inserting would make a new key, without the comment above it.
    match table.get_mut(key) {
        Some(old) => *old = new,
        None => _ = table.insert(key, new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured() -> Measured {
        Measured {
            name: "F450 \"one\"".into(),
            mass: 1.3,
            arm_length: 0.225,
            rotor_radius: 0.12,
            air_density: 1.2,
            gravity: 9.81,
            tracked_point: [0.0, 0.0, -0.03],
            spin: [Spin::Cw, Spin::Ccw, Spin::Cw, Spin::Ccw],
            command_range: [1100.0, 1900.0],
            unmeasured: vec!["tracked_point".into()],
        }
    }

    #[test]
    fn what_is_measured_goes_into_the_file_and_all_else_stays() {
        let text = "# mine\nname = \"old\"\nmass = 1.5   # NOT MEASURED: weigh it\narm_length = 0.2   # with a ruler\n\
                    rotor_radius = 0.1\nair_density = 1.225\ngravity = 9.81\ntracked_point = [0.0, 0.0, 0.0]   # NOT MEASURED: x\n\
                    unmeasured = [\"mass\", \"tracked_point\"]\n\n[motors]\nspin = [\"ccw\", \"cw\", \"ccw\", \"cw\"]\n\
                    command_unit = \"us\"\ncommand_range = [1000.0, 2000.0]\nmap = \"identify\"   # no stand\n";
        let new = with(text, &measured()).unwrap();
        let vehicle = Vehicle::parse(&new, Path::new("vehicle.toml")).unwrap();
        assert_eq!((vehicle.name.as_str(), vehicle.mass), ("F450 \"one\"", 1.3));
        assert_eq!(vehicle.motors.spin[0], Spin::Cw);
        assert_eq!(vehicle.motors.command_range, [1100.0, 1900.0]);
        assert_eq!(vehicle.unmeasured, ["tracked_point"]);
        assert!(
            new.starts_with("# mine\n") && new.contains("# with a ruler") && new.contains("# no stand"),
            "{new}"
        );
        assert!(!new.contains("weigh it") && new.contains("# NOT MEASURED: x"), "{new}");
        let all = Measured { unmeasured: Vec::new(), ..measured() };
        assert!(!with(&new, &all).unwrap().contains("easured"), "{new}");
    }

    #[test]
    fn impossible_values_leave_the_file_alone() {
        let folder = tempfile::tempdir().unwrap();
        let vehicle = Vehicle::thesis();
        let text = toml::to_string(&vehicle).unwrap();
        let craft = Craft { vehicle, text, is_written: false };
        let refused = craft.write(folder.path(), &Measured { mass: -1.0, ..measured() }).unwrap_err();
        assert!(refused.sentence().starts_with("vehicle.toml: mass = -1 is impossible"), "{refused:?}");
        assert!(!folder.path().join("vehicle.toml").exists());
        craft.write(folder.path(), &measured()).unwrap();
        assert_eq!(Vehicle::read(&folder.path().join("vehicle.toml")).unwrap().mass, 1.3);
    }
}
