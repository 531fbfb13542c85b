//! Text that a program is known by the names of: a table for what `blackbox_decode` and Bitcraze's client write.
//!
//! `blackbox_decode` leaves the header of the log away. Its gyro and accelerometer are taken in the units that it writes behind
//! the names; without them, what a count is worth is not known.

use std::path::Path;

use flights::text_columns;

use crate::error::LogError;
use crate::format::{Format, TextOf, text_of};
use crate::log::{Column, Log, Table, TimeUnit, Values};

/// Gravity that the accelerometer's unit stands for in [`crate::sources`], m/s^2.
const GRAVITY: f64 = 9.81;

/// A log from text; nothing where its names are of no program that is known.
pub(crate) fn decode(bytes: &[u8], path: &Path) -> Result<Option<Log>, LogError> {
    match text_of(bytes) {
        Some(TextOf::Crazyflie) => Ok(Some(crazyflie(bytes))),
        Some(TextOf::Blackbox) => blackbox(bytes, path).map(Some),
        None => Ok(None),
    }
}

fn crazyflie(bytes: &[u8]) -> Log {
    let (names, values) = text_columns(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let rows = values.iter().map(Vec::len).max().unwrap_or(0);
    // A column with text in it, or cut short, is left out.
    let columns = names.into_iter().zip(values).filter(|(_, values)| values.len() == rows);
    one_table(TimeUnit::Milliseconds, "rows", Vec::new(), rows, columns.collect())
}

fn blackbox(bytes: &[u8], path: &Path) -> Result<Log, LogError> {
    let refuse = |reason: &str| LogError::Refused { path: path.into(), reason: reason.into() };
    let (names, values) = text_columns(bytes);
    let mut times = Vec::new();
    let mut columns = Vec::new();
    let mut has_gyro = false;
    for (name, values) in names.into_iter().zip(values) {
        let (own, unit) = (bare(&name).to_owned(), unit(&name));
        let scale = match own.split('[').next().unwrap_or_default() {
            "time" => {
                let to_us = match unit {
                    Some("s") => 1e6,
                    Some("ms") => 1e3,
                    _ => 1.0,
                };
                times = values.iter().map(|time| (to_us * time).round() as i64).collect();
                continue;
            }
            "gyroADC" => match unit {
                Some("deg/s") => 1.0,
                Some("rad/s") => 1.0_f64.to_degrees(),
                _ => {
                    return Err(refuse(
                        "gyroADC is in counts, and what one is worth stands in the log only: import the log itself, or decode it \
                         with blackbox_decode --unit-rotation deg/s --unit-acceleration m/s2",
                    ));
                }
            },
            "accSmooth" => match unit {
                Some("g") => 1.0,
                Some("m/s/s" | "m/s2" | "m/s^2") => 1.0 / GRAVITY,
                _ => continue,
            },
            "motor" | "setpoint" | "navPos" | "navVel" | "attitude" => 1.0,
            _ => continue,
        };
        has_gyro |= own.starts_with("gyroADC");
        columns.push((own, values.into_iter().map(|value| scale * value).collect::<Vec<f64>>()));
    }
    let rows = times.len();
    columns.retain(|(_, values)| values.len() == rows);
    if rows == 0 || !has_gyro {
        return Err(refuse("has no rows with a time and a gyro (gyroADC): decode the log again"));
    }
    let mut log = one_table(TimeUnit::Microseconds, "log 1", times, rows, columns);
    // One degree a second, one g.
    log.information.insert("log 1: gyro_scale".into(), format!("0x{:08x}", 1.0_f32.to_bits()));
    log.information.insert("log 1: acc_1G".into(), "1".into());
    Ok(log)
}

fn one_table(
    time_unit: TimeUnit,
    name: &str,
    times: Vec<i64>,
    rows: usize,
    columns: Vec<(String, Vec<f64>)>,
) -> Log {
    let columns = columns.into_iter().map(|(name, values)| Column { name, values: Values::F64(values) });
    let columns = columns.collect();
    let table = Table { name: name.into(), message_type: None, time_unit, times, rows, columns };
    Log { tables: vec![table], ..Log::new(Format::Csv) }
}

/// A name without the unit behind it.
fn bare(name: &str) -> &str {
    name.split_once('(').map_or(name, |(bare, _)| bare).trim()
}

/// The unit behind a name.
fn unit(name: &str) -> Option<&str> {
    Some(name.split_once('(')?.1.trim().strip_suffix(')')?.trim())
}
