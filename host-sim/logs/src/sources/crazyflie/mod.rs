//! Crazyflie log variables, on the SD card, in Parquet or CSV.
//!
//! World z up, body forward-left-up: flipped to north-east-down and forward-right-down, (x, -y, -z).
//! Motors of the firmware: m1 front-right ccw, m2 rear-right cw, m3 rear-left ccw, m4 front-left cw.
//! What a variable is, in which unit: `src/modules/src` of bitcraze/crazyflie-firmware; checked on logs
//! where `import.md` says so.

mod attitude;
mod clock;
mod commands;
mod rates;
mod tables;

use std::path::Path;

use model::user_effects;

use super::common::series::{at, flip, nearest, rotate_back, scale};
use crate::error::LogError;
use crate::format::Format;
use crate::log::Log;
use crate::recording::{Hints, Recording, Signal, Span};
use tables::Tables;

/// Standard gravity of the firmware, m/s^2.
const GRAVITY: f64 = 9.81;
/// An attitude no further away than this turns a specific force, s.
const NEAR_S: f64 = 0.02;

pub(crate) fn record(log: &Log, path: &Path) -> Result<Recording, LogError> {
    let mut recording = Recording { hints: hints(), ..Recording::default() };
    let tables = Tables::of(log, &mut recording.notes);
    if tables.slow_clock == clock::Clock::Unknown && log.format == Format::Crazyflie {
        recording.limits.push(clock::UNKNOWN.into());
    }
    let signals = &mut recording.signals;
    signals.position = vector(&tables, &POSITION);
    signals.velocity = vector(&tables, &VELOCITY);
    signals.attitude = attitude::attitude(&tables);
    signals.rates = rates::rates(&tables, signals.attitude.as_ref(), &mut recording.notes);
    signals.specific_force = specific_force(&tables, signals.attitude.as_ref());
    signals.commands = commands::commands(&tables, &mut recording.notes);
    signals.rotor_speed = commands::rotor_speed(&tables);
    signals.voltage = voltage(&tables);
    signals.extra = load(&tables);
    signals.extra.extend(further(log, &tables));
    recording.airborne = airborne(&tables);
    limits(&mut recording);
    let signals = &recording.signals;
    let moves = signals.position.is_some() || signals.attitude.is_some() || signals.rates.is_some();
    if !moves && signals.specific_force.is_none() {
        let variables: Vec<&str> =
            log.tables.iter().flat_map(|table| &table.columns).map(|c| c.name.as_str()).take(12).collect();
        let reason = format!(
            "no position, attitude, rates or acceleration of a craft among the variables: {}",
            crate::error::plain_list(&variables)
        );
        return Err(LogError::Refused { path: path.into(), reason });
    }
    Ok(recording)
}

fn hints() -> Hints {
    Hints {
        spin: Some(["cw", "ccw", "cw", "ccw"]),
        command_range: Some([0.0, 1.0]),
        command_unit: Some("1".into()),
        ..Hints::default()
    }
}

/// Variables that hold a vector: the name that it is known by, the three variables, their unit in SI units.
type Vector = (&'static str, [&'static str; 3], f64);

const POSITION: [Vector; 4] = [
    ("stateEstimateZ.x", ["stateEstimateZ.x", "stateEstimateZ.y", "stateEstimateZ.z"], 1e-3),
    ("stateEstimate.x", ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z"], 1.0),
    ("locSrv.x", ["locSrv.x", "locSrv.y", "locSrv.z"], 1.0),
    ("kalman.stateX", ["kalman.stateX", "kalman.stateY", "kalman.stateZ"], 1.0),
];
const VELOCITY: [Vector; 2] = [
    ("stateEstimateZ.vx", ["stateEstimateZ.vx", "stateEstimateZ.vy", "stateEstimateZ.vz"], 1e-3),
    ("stateEstimate.vx", ["stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz"], 1.0),
];
const ACCELEROMETER: [Vector; 1] = [("acc.x", ["acc.x", "acc.y", "acc.z"], GRAVITY)];
/// In world axes: mm/s^2 with gravity.
const WORLD_FORCE: [Vector; 1] =
    [("stateEstimateZ.ax", ["stateEstimateZ.ax", "stateEstimateZ.ay", "stateEstimateZ.az"], 1e-3)];
/// In world axes: g without gravity.
const WORLD_ACCELERATION: [Vector; 1] =
    [("stateEstimate.ax", ["stateEstimate.ax", "stateEstimate.ay", "stateEstimate.az"], GRAVITY)];
const LOAD: [Vector; 1] =
    [("stateEstimateZ.px", ["stateEstimateZ.px", "stateEstimateZ.py", "stateEstimateZ.pz"], 1e-3)];

/// The first vector of several that is logged, in our frame.
fn vector(tables: &Tables<'_>, alternatives: &[Vector]) -> Option<Signal<3>> {
    alternatives.iter().find_map(|(source, names, unit)| {
        let (rising, values) = tables.group(*names)?;
        Some(rising.signal(source, &flip(scale(values, *unit))))
    })
}

fn specific_force(tables: &Tables<'_>, attitude: Option<&Signal<4>>) -> Option<Signal<3>> {
    if let Some(signal) = vector(tables, &ACCELEROMETER) {
        return Some(signal);
    }
    let attitude = attitude?;
    let mut signal = vector(tables, &WORLD_FORCE).or_else(|| {
        let mut signal = vector(tables, &WORLD_ACCELERATION)?;
        signal.values[2].iter_mut().for_each(|down| *down -= GRAVITY);
        Some(signal)
    })?;
    for row in 0..signal.t.len() {
        let body = nearest(&attitude.t, signal.t[row], NEAR_S).map_or([f64::NAN; 3], |turned| {
            rotate_back(at(&attitude.values, turned), at(&signal.values, row))
        });
        signal.values.iter_mut().zip(body).for_each(|(column, value)| column[row] = value);
    }
    Some(signal)
}

fn voltage(tables: &Tables<'_>) -> Option<Signal<1>> {
    [("pm.vbat", 1.0), ("pm.vbatMV", 1e-3)].into_iter().find_map(|(name, unit)| {
        let (rising, values) = tables.group([name])?;
        Some(rising.signal("pm.vbat", &scale(values, unit)))
    })
}

/// Where a load is that hangs from the craft, as the firmware's payload controller logs it.
fn load(tables: &Tables<'_>) -> Vec<(String, Signal<1>)> {
    let Some(Signal { source, t, values }) = vector(tables, &LOAD) else { return Vec::new() };
    let signal = |(name, values): (&str, Vec<f64>)| {
        (name.to_owned(), Signal { source: source.clone(), t: t.clone(), values: [values] })
    };
    ["load_north", "load_east", "load_down"].into_iter().zip(values).map(signal).collect()
}

/// Columns of a table of someone's own that formulas can name: `payload_kg`. The firmware's variables have a point in their names.
fn further(log: &Log, tables: &Tables<'_>) -> Vec<(String, Signal<1>)> {
    if log.format == Format::Crazyflie {
        return Vec::new();
    }
    let names = log.tables.iter().flat_map(|table| &table.columns).map(|column| column.name.as_str());
    names
        .filter(|name| {
            user_effects::can_be_column(name) && !flights::is_known_name(name) && !tables::is_time(name)
        })
        .filter_map(|name| {
            let (rising, values) = tables.group([name])?;
            Some((name.to_owned(), rising.signal(name, &values)))
        })
        .collect()
}

/// When the firmware says that it flies.
fn airborne(tables: &Tables<'_>) -> Vec<Span> {
    /// Bit 4 of `supervisor.info`.
    const FLYING: u64 = 1 << 4;
    let flying = |name, is_flying: fn(f64) -> bool| {
        let (rising, [values]) = tables.group([name])?;
        Some((rising.t.clone(), rising.pick(&values).into_iter().map(is_flying).collect::<Vec<bool>>()))
    };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the variable has 16 bits")]
    let by_supervisor = flying("supervisor.info", |bits| bits as u64 & FLYING != 0);
    let Some((t, flying)) = by_supervisor.or_else(|| flying("sys.isFlying", |flag| flag != 0.0)) else {
        return Vec::new();
    };
    let mut spans: Vec<Span> = Vec::new();
    for row in 0..t.len() {
        match spans.last_mut() {
            Some(span) if flying[row] && row > 0 && flying[row - 1] => span[1] = t[row],
            _ if flying[row] => spans.push([t[row], t[row]]),
            _ => {}
        }
    }
    spans
}

/// What is missing, and the variables that would hold it.
fn limits(recording: &mut Recording) {
    let signals = &recording.signals;
    let missing = [
        (signals.position.is_none(), "no position: log stateEstimateZ.x, .y and .z"),
        (signals.velocity.is_none(), "no velocity: log stateEstimateZ.vx, .vy and .vz"),
        (signals.attitude.is_none(), "no attitude: log stateEstimateZ.quat"),
        (signals.rates.is_none(), "no body rates: log gyro.x, .y and .z"),
        (signals.specific_force.is_none(), "no accelerometer: log acc.x, .y and .z"),
        (signals.commands.is_none(), "no motor commands: log motor.m1, .m2, .m3 and .m4"),
        (signals.voltage.is_none(), "no battery voltage: log pm.vbat"),
    ];
    let sentences =
        missing.into_iter().filter(|(is_missing, _)| *is_missing).map(|(_, sentence)| sentence.into());
    recording.limits.extend(sentences);
}
