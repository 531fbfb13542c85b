//! Columns of any names through the program: maps in files and vehicle files, mended flights, tables that are imported, and
//! columns that formulas name.

mod common;

use std::fmt::Write as _;
use std::path::Path;

use common::{copies, json_in, run_in, with_sets};

const FLIGHTS: [&str; 5] = ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"];

/// Header and rows of a flight file.
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Self { names: lines.next().unwrap(), rows: lines.collect() }
    }

    fn write(&self, path: &Path, separator: &str) {
        let mut text = self.names.join(separator);
        for row in &self.rows {
            let _ = write!(text, "\n{}", row.join(separator));
        }
        std::fs::write(path, text + "\n").unwrap();
    }

    fn at(&self, name: &str) -> usize {
        self.names.iter().position(|own| own == name).unwrap_or_else(|| panic!("no {name}: {:?}", self.names))
    }

    /// Other values for a column, by time and the old value.
    fn change(&mut self, name: &str, value: impl Fn(f64, f64) -> f64) {
        let (t, column) = (self.at("t"), self.at(name));
        for row in self.rows.iter_mut().filter(|row| !row[column].is_empty()) {
            row[column] = value(row[t].parse().unwrap(), row[column].parse().unwrap()).to_string();
        }
    }

    fn add(&mut self, name: &str, value: impl Fn(f64) -> f64) {
        let t = self.at("t");
        self.names.push(name.into());
        self.rows.iter_mut().for_each(|row| row.push(value(row[t].parse().unwrap()).to_string()));
    }

    fn rename(&mut self, old: &str, new: &str) {
        let column = self.at(old);
        self.names[column] = new.into();
    }
}

fn change_all(folder: &Path, change: impl Fn(&mut Table)) {
    for name in FLIGHTS {
        let mut table = Table::read(&folder.join(name));
        change(&mut table);
        table.write(&folder.join(name), ",");
    }
}

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = run_in(folder, arguments);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    stderr
}

const IDENTIFY: [&str; 5] = ["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"];

fn coefficients(model: &Path) -> Vec<f64> {
    let model = model::Model::read(model).unwrap();
    model.terms.iter().flat_map(|term| term.values()).collect()
}

/// The columns of the flights under other names, in other frames, in another order of motors; said in the vehicle file.
#[test]
fn the_vehicle_file_says_which_column_is_which_and_the_model_keeps_it() {
    let (plain, mapped) = (copies(), copies());
    let _ = json_in(plain.path(), &with_sets(&IDENTIFY));
    change_all(mapped.path(), |table| {
        table.change("t", |_, t| (1e6 * t).round());
        table.rename("t", "stamp");
        table.rename("q", "gyro_pitch");
        for (motor, theirs) in [("cmd1", "m4"), ("cmd2", "m1"), ("cmd3", "m2"), ("cmd4", "m3")] {
            table.rename(motor, theirs);
        }
    });
    let vehicle = std::fs::read_to_string(mapped.path().join("vehicle.toml")).unwrap();
    let vehicle = vehicle.replacen("[motors]", "[motors]\nlog_order = [4, 1, 2, 3]", 1)
        + "\n[columns]\nt = { column = \"stamp\", scale = 1e-6 }\nq = \"gyro_pitch\"\ncmd1 = \"m1\"\ncmd2 = \"m2\"\n\
           cmd3 = \"m3\"\ncmd4 = \"m4\"\n";
    std::fs::write(mapped.path().join("vehicle.toml"), &vehicle).unwrap();
    let _ = json_in(mapped.path(), &with_sets(&IDENTIFY));
    let (ours, theirs) =
        (coefficients(&plain.path().join("model.toml")), coefficients(&mapped.path().join("model.toml")));
    for (a, b) in ours.iter().zip(&theirs) {
        assert!((a - b).abs() <= 1e-6 * a.abs().max(1e-9), "{a} and {b}");
    }
    // The model reads them as the vehicle file did.
    let _ = json_in(mapped.path(), &["compare", "--model", "model.toml", "--flights", "D.csv"]);
    // The file beside the flights goes before the vehicle's.
    std::fs::write(mapped.path().join("columns.toml"), "").unwrap();
    let said = refused(mapped.path(), &with_sets(&[&IDENTIFY[..], &["--force"]].concat()));
    assert!(said.contains("\"t\" is missing"), "{said}");
    std::fs::remove_file(mapped.path().join("columns.toml")).unwrap();
    std::fs::write(mapped.path().join("vehicle.toml"), vehicle.replace("q = \"gyro_pitch\"", "q = \"gyro\""))
        .unwrap();
    let said = refused(mapped.path(), &with_sets(&[&IDENTIFY[..], &["--force"]].concat()));
    assert!(
        said.contains("column \"gyro\" is named under [columns] in the vehicle file and not there"),
        "{said}"
    );
    std::fs::write(mapped.path().join("vehicle.toml"), vehicle + "roll = \"a\"\n").unwrap();
    let said = refused(mapped.path(), &with_sets(&[&IDENTIFY[..], &["--force"]].concat()));
    assert!(said.contains("vehicle.toml: columns.roll: is no column of a flight file"), "{said}");
}

#[test]
fn what_the_checks_propose_is_written_and_the_command_goes_on() {
    let (plain, folder) = (copies(), copies());
    let _ = json_in(plain.path(), &with_sets(&IDENTIFY));
    change_all(folder.path(), |table| {
        table.change("q", |_, q| -q.to_degrees());
        table.rename("q", "Pitch Rate [deg/s]");
        // Their second motor is our first.
        for (old, new) in [("cmd1", "a"), ("cmd2", "cmd1"), ("a", "cmd2")] {
            table.rename(old, new);
        }
    });
    let said = refused(folder.path(), &with_sets(&IDENTIFY));
    assert!(said.contains("--apply"), "{said}");
    let output = run_in(folder.path(), &with_sets(&[&IDENTIFY[..], &["--apply"]].concat()));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stderr.contains("columns.toml: written: [columns] q = "), "{stderr}");
    let written = std::fs::read_to_string(folder.path().join("columns.toml")).unwrap();
    assert!(written.contains("Pitch Rate [deg/s]") && written.contains("order = [2, 1, 3, 4]"), "{written}");
    let (ours, theirs) =
        (coefficients(&plain.path().join("model.toml")), coefficients(&folder.path().join("model.toml")));
    for (a, b) in ours.iter().zip(&theirs) {
        assert!((a - b).abs() <= 1e-6 * a.abs().max(1e-9), "{a} and {b}");
    }
    // Nothing is left to write, and a second run says nothing of it.
    let again = [&IDENTIFY[..], &["--apply", "--force"]].concat();
    let _ = json_in(folder.path(), &with_sets(&again));
    assert_eq!(std::fs::read_to_string(folder.path().join("columns.toml")).unwrap(), written);
    // What an operator has written is not overruled.
    std::fs::write(folder.path().join("columns.toml"), "[motors]\norder = [1, 2, 3, 4]\n").unwrap();
    let said = refused(folder.path(), &with_sets(&again));
    assert!(said.contains("--apply does nothing") && said.contains("columns.toml"), "{said}");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("columns.toml")).unwrap(),
        "[motors]\norder = [1, 2, 3, 4]\n"
    );
}

#[test]
fn tables_of_any_names_are_imported_with_further_columns_and_the_vehicle() {
    let folder = copies();
    let at = |name: &str| folder.path().join(name);
    let mut table = Table::read(&at("A.csv"));
    table.change("phi", |_, phi| phi.to_degrees());
    table.rename("phi", "Roll (deg)");
    table.add("payload_kg", |t| if t < 5.0 { 0.25 } else { 0.5 });
    table.add("mode", |_| f64::NAN);
    table.write(&at("A.csv"), ";");
    let mut table = Table::read(&at("B.csv"));
    table.rename("t", "stamp");
    table.rename("x", "northing");
    table.write(&at("B.csv"), "\t");
    std::fs::create_dir(at("b")).unwrap();
    std::fs::rename(at("B.csv"), at("b/B.csv")).unwrap();
    std::fs::write(at("b/columns.toml"), "[columns]\nt = \"stamp\"\nx = \"northing\"\n").unwrap();
    let document = json_in(folder.path(), &["import", "A.csv", "b/B.csv", "--out", "out"]);
    assert_eq!(document["logs"][0]["format"], "csv");
    assert_eq!(document["logs"][0]["sources"]["attitude"], "Roll (deg)");
    assert_eq!(document["logs"][1]["sources"]["position"], "northing");
    assert_eq!(document["missing"].as_array().unwrap().len(), 0, "the vehicle file beside A.csv is known");
    let (a, original) = (Table::read(&at("out/A.csv")), Table::read(&common::flights().join("A.csv")));
    assert_eq!(a.rows.len(), original.rows.len());
    assert_eq!(a.names.last().unwrap(), "payload_kg");
    let value =
        |table: &Table, name: &str, row: usize| table.rows[row][table.at(name)].parse::<f64>().unwrap();
    for row in [0, 100, 700] {
        assert!((value(&a, "phi", row) - value(&original, "phi", row)).abs() < 1e-12);
        assert_eq!(value(&a, "payload_kg", row), if value(&a, "t", row) < 5.0 { 0.25 } else { 0.5 });
    }
    let vehicle = |path: &str| model::Vehicle::read(&at(path)).unwrap();
    assert_eq!(vehicle("out/vehicle.toml"), vehicle("vehicle.toml"));
    // Over no input, and not under a map that would be applied once more.
    let said = refused(folder.path(), &["import", "A.csv", "--out", ".", "--force"]);
    assert!(said.contains("is read by this command"), "{said}");
    let said = refused(folder.path(), &["import", "A.csv", "--out", "b"]);
    assert!(said.contains("b/columns.toml: would be applied"), "{said}");
    std::fs::write(at("odd.csv"), "stamp,alpha,beta\n0,1,2\n1,2,3\n").unwrap();
    let said = refused(folder.path(), &["import", "odd.csv", "--out", "odd", "--json"]);
    assert!(said.contains("stamp, alpha, beta") && said.contains("columns.toml"), "{said}");
}

#[test]
fn a_table_with_wrong_axes_is_mended_on_its_way_in() {
    let folder = copies();
    change_all(folder.path(), |table| table.change("q", |_, q| -q));
    // A flight file that is in the way is seen before a map is written.
    std::fs::create_dir(folder.path().join("taken")).unwrap();
    std::fs::copy(folder.path().join("A.csv"), folder.path().join("taken/A.csv")).unwrap();
    let said = refused(folder.path(), &["import", "A.csv", "--apply", "--out", "taken"]);
    assert!(said.contains("already exists") && !folder.path().join("columns.toml").exists(), "{said}");
    let arguments = ["import", "A.csv", "B.csv", "--apply", "--out", "out", "--json"];
    let output = run_in(folder.path(), &arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(0) && stderr.contains("[columns] q = \"-q\""), "{stderr}");
    let (made, original) =
        (Table::read(&folder.path().join("out/A.csv")), Table::read(&common::flights().join("A.csv")));
    assert_eq!(made.rows[50][made.at("q")], original.rows[50][original.at("q")]);
}

/// Slow sines of where a load hangs: size in m, rad/s, rad.
const SWINGS: [(f64, f64, f64); 2] = [(0.6, 0.31, 0.3), (0.3, 0.47, 1.1)];
/// Drag of the craft of the demo over its mass, 1/s: 0.235 N s/m.
const DRAG_PER_S: f64 = 0.235 / 1.214;

fn load_m(t: f64) -> f64 {
    SWINGS.iter().map(|(size, w, phase)| size * (w * t + phase).sin()).sum()
}

/// How far the load moves a craft that it pulls by 1 m/s^2 for each metre, against its drag: the solution by hand.
fn moved_m(t: f64) -> f64 {
    let moved = |(size, w, phase): &(f64, f64, f64)| {
        let (sin, cos) = (w * t + phase).sin_cos();
        -size / (w * w + DRAG_PER_S * DRAG_PER_S) * (sin + DRAG_PER_S / w * cos)
    };
    SWINGS.iter().map(moved).sum()
}

const PULL: &str = r#"
[[effect]]
id = "other-craft"
sentence = "A load pulls the craft north."
acceleration.north = "stiffness * load_north / mass"
coefficient = [{ name = "stiffness", unit = "N/m", possible = [-100.0, 100.0], typical = 1.0 }]
"#;

#[test]
fn a_formula_names_a_column_of_the_flights() {
    let folder = copies();
    let mass = model::Vehicle::read(&folder.path().join("vehicle.toml")).unwrap().mass;
    change_all(folder.path(), |table| {
        table.change("x", |t, x| x + moved_m(t));
        table.add("load_north", load_m);
    });
    std::fs::write(folder.path().join("pull.toml"), PULL).unwrap();
    let plain = ["explain", "--vehicle", "vehicle.toml", "--out", "plain.toml"];
    let without = json_with_any_status(folder.path(), &with_sets(&plain));
    assert_eq!(without["verdict"], "unexplained", "{without}");
    let with = ["explain", "--vehicle", "vehicle.toml", "--effects", "pull.toml", "--out", "model.toml"];
    let explained = json_with_any_status(folder.path(), &with_sets(&with));
    let added: Vec<&str> =
        explained["added"].as_array().unwrap().iter().map(|e| e["effect"].as_str().unwrap()).collect();
    assert_eq!(added[0], "other-craft", "{explained}");
    assert_eq!(explained["unexplained"], serde_json::json!([]), "{explained}");
    let model = model::Model::read(&folder.path().join("model.toml")).unwrap();
    let own = model.terms.iter().find(|term| term.effect.id() == "other-craft").unwrap();
    let stiffness = own.coefficients[0];
    let off = (stiffness.value - mass).abs();
    assert!(off < 0.05 * mass, "{stiffness:?} for {mass}");
    // The model needs no other file, and a flight without the column is refused by name.
    let compared =
        |model: &str| json_in(folder.path(), &["compare", "--model", model, "--flights", "D.csv", "E.csv"]);
    let position = |json: &serde_json::Value| json["horizons"]["50"]["position_m"].as_f64().unwrap();
    assert!(position(&compared("model.toml")) < 0.3 * position(&compared("plain.toml")));
    std::fs::copy(common::flights().join("D.csv"), folder.path().join("D.csv")).unwrap();
    let said = refused(folder.path(), &["compare", "--model", "model.toml", "--flights", "D.csv"]);
    assert!(
        said.contains("D.csv: has no column \"load_north\", which the effect \"other-craft\" names"),
        "{said}"
    );
    let said = refused(folder.path(), &["linearize", "--model", "model.toml"]);
    assert!(said.contains("names the column \"load_north\" of flight files"), "{said}");
}

fn json_with_any_status(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let arguments: Vec<&str> = arguments.iter().copied().chain(["--json"]).collect();
    let output = run_in(folder, &arguments);
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|why| panic!("{why}: {}", String::from_utf8_lossy(&output.stderr)))
}
