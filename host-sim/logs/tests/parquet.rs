//! Parquet: what pyarrow finds in it.

mod common;

use std::path::Path;

use common::flight::{Reference, smoothed_agrees};
use common::mutations::survives;
use common::{expected, expected_sum, shared};
use logs::{Format, record};

#[test]
fn columns_hold_what_pyarrow_finds() {
    let Some((log, expected)) = expected("crazyflie_log203.parquet") else { return };
    assert_eq!(log.format, Format::Parquet);
    assert_eq!(log.losses.damage, Vec::<String>::new());
    let table = log.table("rows").unwrap();
    assert_eq!(table.rows as u64, expected["rows"].as_u64().unwrap());
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    let told: Vec<&str> =
        expected["columns"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(names, told);
    for (name, sum) in expected["sums"].as_object().unwrap() {
        expected_sum(table, name, sum.as_f64().unwrap(), 10);
    }
}

/// Names and units are the firmware's, its slow clock too.
#[test]
fn log203_is_its_flight() {
    let Some((log, _)) = expected("crazyflie_log203.parquet") else { return };
    let Some(path) = shared("data/crazyswarm2/log203.csv") else { return };
    let recording = record(&log, Path::new("log203")).unwrap();
    assert!(recording.notes[0].contains("85/84"), "{:?}", recording.notes);
    smoothed_agrees(&recording, &Reference::read(&path));
}

#[test]
fn damaged_files_do_no_harm() {
    let Some(path) = shared("data/logs/crazyflie_log203.parquet") else { return };
    survives("log203.parquet", &std::fs::read(path).unwrap(), 1500);
}
