//! What of a flight goes into a fit: its airborne parts, without outliers, and logs that hold less than they seem to.

mod common;

use std::path::{Path, PathBuf};

use common::{copies, done_in, identify, json_in, run_in, shared, with_sets};
use flights::{Column, Flight};
use model::Vehicle;
use serde_json::Value;
use sysid::{Examined, FaultKind};

/// Folders of the shared data, and the vehicle file of each where it has one for all.
const MOST_OF_SHORT: f64 = 20.0;
const FOLDERS: [&str; 8] =
    ["hidden", "unknown", "crazypad", "nanodrone", "nanobench", "neuralfly", "neuralswarm", "crazyswarm2"];

fn flights_in(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(flights_in(&path));
        } else if path.extension().is_some_and(|ending| ending == "csv") {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn vehicle_of(flight: &Path) -> Vehicle {
    let file = flight
        .ancestors()
        .skip(1)
        .flat_map(|folder| ["vehicle.toml", "vehicle_small.toml"].map(|name| folder.join(name)))
        .find(|file| file.exists())
        .unwrap();
    Vehicle::read(&file).unwrap()
}

fn each_flight(folder: &str, mut look: impl FnMut(&str, &Flight, &Examined)) {
    let Some(folder) = shared(&format!("data/{folder}")) else { return };
    for path in flights_in(&folder) {
        let flight = Flight::read(&path).unwrap();
        let examined = sysid::examine(&flight, &vehicle_of(&path)).unwrap();
        look(&path.strip_prefix(&folder).unwrap().display().to_string(), &flight, &examined);
    }
}

/// All of these logs were cut to what is flown by those who made them.
#[test]
fn flights_that_are_flown_from_end_to_end_keep_every_sample() {
    for folder in FOLDERS {
        each_flight(folder, |name, flight, examined| {
            let t = flight.required(Column::T);
            assert_eq!(
                examined.taken.parts,
                [[t[0], t[t.len() - 1]]],
                "{folder}/{name}: {:?}",
                examined.taken
            );
        });
    }
}

#[test]
fn of_brisk_real_flights_one_value_to_two_hundred_rows_is_an_outlier_at_most() {
    for folder in ["nanodrone", "nanobench", "neuralfly", "crazypad", "crazyswarm2"] {
        each_flight(folder, |name, flight, examined| {
            let count = examined.prepared.outliers.len();
            println!("{folder}/{name}: {count} of {} rows", flight.len());
            // Rows of fifteen to twenty-five values each; of short flights, a few.
            let most = f64::max(0.005 * flight.len() as f64, MOST_OF_SHORT);
            assert!(count as f64 <= most, "{folder}/{name}: {count}");
        });
    }
}

/// The commands of neuralfly were logged at 50 Hz and drawn to 100 Hz by straight lines; the rest of it runs along splines.
#[test]
fn only_logs_that_were_interpolated_are_said_to_be() {
    for folder in FOLDERS {
        each_flight(folder, |name, _, examined| {
            let said: Vec<&str> = examined
                .faults
                .iter()
                .filter(|fault| fault.kind == FaultKind::Interpolated)
                .map(|fault| fault.sentence.as_str())
                .collect();
            if folder == "neuralfly" {
                assert!(
                    said.len() == 1
                        && said[0].starts_with("cmd1, cmd2, cmd3, cmd4 look linearly interpolated"),
                    "{name}: {said:?}"
                );
                assert!(said[0].contains(" from 50 to 100 Hz"), "{name}: {said:?}");
            } else {
                assert!(said.is_empty(), "{folder}/{name}: {said:?}");
            }
        });
    }
}

/// The flight with seconds on the floor at both ends: motors stand, ramp up in one second, and down again. The floor is
/// where the craft starts, and where it ends.
fn with_floor(flight: &Flight, vehicle: &Vehicle, before_s: f64, after_s: f64) -> Flight {
    const COLUMNS: [Column; 15] = {
        use Column::*;
        [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat]
    };
    let t = flight.required(Column::T);
    let step_s = flights::median_step(t);
    let [first, last] = [0, flight.len() - 1];
    let [low, _] = vehicle.motors.command_range;
    let ground = |edge: usize, away_s: f64, column: Column| {
        let there = flight.required(column)[edge];
        // Of the size of a tracker's and a gyro's noise.
        let noise = (7919.0 * away_s + 1.7 * column as usize as f64).sin();
        match column {
            Column::T => t[edge] + if edge == 0 { -away_s } else { away_s },
            Column::X | Column::Y | Column::Z => there + 3e-4 * noise,
            Column::Phi | Column::Theta => 7e-4 * noise,
            Column::Psi => there + 7e-4 * noise,
            Column::P | Column::Q | Column::R => 0.012 * noise,
            Column::Vbat => there,
            _ => low + (there - low) * (1.0 - away_s).max(0.0),
        }
    };
    let count = |time_s: f64| (time_s / step_s) as usize;
    let values = COLUMNS.map(|column| {
        let before = (1..=count(before_s)).rev().map(|k| ground(first, k as f64 * step_s, column));
        let after = (1..=count(after_s)).map(|k| ground(last, k as f64 * step_s, column));
        (column, before.chain(flight.required(column).iter().copied()).chain(after).collect())
    });
    Flight::from_columns(flight.name.clone(), values)
}

/// Puts a floor under both ends of the five flights of a folder.
fn put_floors(folder: &Path) {
    let vehicle = Vehicle::read(&folder.join("vehicle.toml")).unwrap();
    for (i, name) in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"].into_iter().enumerate() {
        let path = folder.join(name);
        let flight =
            with_floor(&Flight::read(&path).unwrap(), &vehicle, 3.0 + i as f64, 4.0 - 0.5 * i as f64);
        std::fs::write(&path, flight.to_csv()).unwrap();
    }
}

fn explained(folder: &Path) -> Value {
    let arguments =
        with_sets(&["explain", "--vehicle", "vehicle.toml", "--out", "explained.toml", "--force", "--json"]);
    let output = run_in(folder, &arguments);
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    let status = i32::from(answer["verdict"] == "not-identified");
    assert_eq!(output.status.code(), Some(status), "{}", String::from_utf8_lossy(&output.stderr));
    answer
}

#[test]
fn seconds_on_the_floor_change_no_answer() {
    let folder = copies();
    let flown = explained(folder.path());
    put_floors(folder.path());
    let with_floor = explained(folder.path());
    assert_eq!(with_floor["verdict"], flown["verdict"]);
    let effects = |answer: &Value| -> Vec<Value> {
        answer["added"].as_array().unwrap().iter().map(|added| added["effect"].clone()).collect()
    };
    assert_eq!(effects(&with_floor), effects(&flown));
    for axis in common::AXES {
        let [with, without] = [&with_floor, &flown].map(|answer| answer["sse_last"][axis].as_f64().unwrap());
        // A few tenths of a second at each end are left out as well, and what is no higher than a bounce beside them.
        assert!((with / without - 1.0).abs() < 0.15, "{axis}: {with} {without}");
    }
    let used = with_floor["used"].as_array().unwrap();
    assert_eq!(used.len(), 5);
    for flight in used {
        let left_out = flight["left_out"].as_array().unwrap();
        assert_eq!(left_out.len(), 2, "{flight}");
        assert!(left_out.iter().all(|part| part["why"] == "standing"), "{flight}");
        assert_eq!(flight["parts"].as_array().unwrap().len(), 1);
    }
    let said = |fault: &&Value| fault["kind"] == "not-airborne" && fault["severity"] == "warning";
    assert_eq!(with_floor["faults"].as_array().unwrap().iter().filter(said).count(), 5);
}

#[test]
fn the_operator_says_which_parts_to_use() {
    let folder = copies();
    let path = folder.path();
    identify(path);
    let used = |more: &[&str]| {
        let first = ["compare", "--model", "model.toml", "--flights", "D.csv"];
        let arguments: Vec<&str> = first.iter().chain(more).copied().collect();
        json_in(path, &arguments)["used"][0]["parts"].clone()
    };
    assert_eq!(used(&["--from", "2", "--to", "9.5"]), serde_json::json!([[2.0, 9.5]]));
    std::fs::write(path.join("D.use.toml"), "use = [[1, 4], [6.0, 12.0]]\n").unwrap();
    assert_eq!(used(&[]), serde_json::json!([[1.0, 4.0], [6.0, 12.0]]));
    assert_eq!(used(&["--to", "9.5"])[0][1], 9.5);
    let refused = |more: &[&str]| {
        let first = ["compare", "--model", "model.toml", "--flights", "D.csv"];
        let output = run_in(path, &first.iter().chain(more).copied().collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(refused(&["--from", "9", "--to", "2"]).contains("--from 9 --to 2: the first time has to be"));
    assert!(refused(&["--from", "900"]).contains("D.csv: has no sample in the parts that are asked for"));
    std::fs::write(path.join("D.use.toml"), "use = [[4, 1]]\n").unwrap();
    let said = refused(&[]);
    assert!(said.contains("D.use.toml: use: part 1 is [4.0, 1.0]") && said.lines().count() == 1, "{said}");
}

/// One sample of the gyro is off by 30 rad/s: named with its time and column, and counted in the scores.
#[test]
fn an_outlier_is_told_with_its_time_and_column_and_counts_in_the_scores() {
    let folder = copies();
    let path = folder.path();
    identify(path);
    let compare = ["compare", "--model", "model.toml", "--flights", "D.csv"];
    let clean = json_in(path, &compare);
    let mut flight = Flight::read(&path.join("D.csv")).unwrap();
    let mut q = flight.required(Column::Q).to_vec();
    q[700] += 30.0;
    let (t_s, value) = (flight.required(Column::T)[700], q[700]);
    flight.replace(Column::Q, q);
    std::fs::write(path.join("D.csv"), flight.to_csv()).unwrap();
    let spiky = json_in(path, &compare);
    let told = serde_json::json!([{ "t_s": t_s, "column": "q", "value": value }]);
    assert_eq!(spiky["used"][0]["outliers"], told);
    assert!(clean.get("horizons_cleaned").is_none());
    let rate =
        |document: &Value, horizons: &str| document[horizons]["sum_1_50"]["rate_rad_s"].as_f64().unwrap();
    let (logged, cleaned) = (rate(&spiky, "horizons"), rate(&spiky, "horizons_cleaned"));
    assert!((cleaned / rate(&clean, "horizons") - 1.0).abs() < 0.01, "{cleaned}");
    // Fifty horizons end there, each in one prediction of all.
    let starts = spiky["flights"][0]["samples"].as_f64().unwrap() - 50.0;
    assert!(((logged - cleaned) * starts / (50.0 * 30.0) - 1.0).abs() < 0.02, "{logged} {cleaned}");
    assert!(done_in(path, &compare).contains("sum without the outliers"));
}

/// Every second or fourth row of a log at 100 Hz of a controller at 100 Hz.
fn thinned(flight: &Flight, every: usize) -> Flight {
    let keep: Vec<bool> = (0..flight.len()).map(|k| k % every == 0).collect();
    flight.with_rows(&keep)
}

#[test]
fn commands_between_the_rows_of_a_log_are_missed_and_those_of_a_whole_log_are_not() {
    for folder in ["hidden", "unknown"] {
        let Some(folder) = shared(&format!("data/{folder}")) else { continue };
        let mut cases: Vec<PathBuf> =
            flights_in(&folder).iter().map(|f| f.parent().unwrap().into()).collect();
        cases.dedup();
        for case in cases {
            let vehicle = vehicle_of(&case.join("A.csv"));
            for (every, missed) in [(1, false), (2, true), (4, true)] {
                let thinnings: Vec<_> = ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"]
                    .iter()
                    .map(|name| {
                        let flight = thinned(&Flight::read(&case.join(name)).unwrap(), every);
                        sysid::examine(&flight, &vehicle).unwrap().thinning
                    })
                    .collect();
                let said = sysid::checks::under_sampled::of_flights(&thinnings);
                assert_eq!(said.is_some(), missed, "{} 1 of {every}: {thinnings:?}", case.display());
            }
        }
    }
}

/// Kinds of faults that are not notes.
fn warned(answer: &Value) -> Vec<&str> {
    let faults = answer["faults"].as_array().unwrap();
    faults.iter().filter(|f| f["severity"] != "note").map(|f| f["kind"].as_str().unwrap()).collect()
}

/// The operator hears of commands at 25 Hz of a controller at 100 Hz, and of nothing at 100 Hz. What was not logged is not identified.
#[test]
fn explain_names_under_sampled_commands() {
    let Some(calm) = shared("data/hidden/calm") else { return };
    let told = [(1, &[][..], "adequate"), (4, &["under-sampled"][..], "not-identified")];
    for (every, kinds, verdict) in told {
        let folder = tempfile::tempdir().unwrap();
        std::fs::copy(calm.join("vehicle.toml"), folder.path().join("vehicle.toml")).unwrap();
        for name in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"] {
            let flight = thinned(&Flight::read(&calm.join(name)).unwrap(), every);
            std::fs::write(folder.path().join(name), flight.to_csv()).unwrap();
        }
        let answer = explained(folder.path());
        assert_eq!(warned(&answer), kinds, "1 of {every}");
        assert_eq!(answer["verdict"], verdict, "1 of {every}");
    }
}

/// Commands at 50 Hz, drawn to 100 Hz by straight lines.
#[test]
fn explain_names_interpolated_commands_and_looks_for_no_dead_time() {
    let folder = copies();
    for name in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"] {
        let path = folder.path().join(name);
        let mut flight = Flight::read(&path).unwrap();
        for column in [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4] {
            let values = flight.required(column).to_vec();
            let next = |k: usize| values[(k + 1).min(values.len() - 1)];
            let drawn =
                |k: usize| if k.is_multiple_of(2) { values[k] } else { 0.5 * (values[k - 1] + next(k)) };
            flight.replace(column, (0..values.len()).map(drawn).collect());
        }
        std::fs::write(&path, flight.to_csv()).unwrap();
    }
    let answer = explained(folder.path());
    let said = answer["faults"].as_array().unwrap().iter().filter(|f| f["kind"] == "interpolated");
    let said: Vec<&str> = said.map(|f| f["sentence"].as_str().unwrap()).collect();
    assert_eq!(said.len(), 5, "{said:?}");
    assert!(said[0].starts_with("cmd1, cmd2, cmd3, cmd4 look linearly interpolated from 50 to 100 Hz"));
    assert!(!answer.to_string().contains("\"effect\":\"input-delay\""));
}
