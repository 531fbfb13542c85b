//! ArduPilot messages. Frames are ours already: north-east-down, front-right-down; units are degrees and PWM.

mod flying;
mod limits;
mod motors;
mod rows;
mod surroundings;
mod vehicle;

use std::path::Path;

use crate::error::LogError;
use crate::log::Log;
use crate::recording::{Recording, Signal, Signals};

use super::common::series::quaternions;
use rows::Rows;

/// Position and velocity by preference: of EKF3, EKF2, the first EKF.
const ESTIMATORS: [&str; 3] = ["XKF1", "NKF1", "EKF1"];

pub(crate) fn record(log: &Log, path: &Path) -> Result<Recording, LogError> {
    let refused = |reason: String| LogError::Refused { path: path.into(), reason };
    let layout = vehicle::layout(log).map_err(refused)?;
    let mut notes = layout.notes.clone();
    let estimator =
        ESTIMATORS.iter().find(|name| log.table(name).is_some()).copied().unwrap_or(ESTIMATORS[0]);
    let mut table = |name: &str| -> Option<Rows> {
        let rows = Rows::first_instance(log.table(name)?);
        notes.extend(rows.note(name));
        Some(rows)
    };
    let estimated = table(estimator);
    let imu = table("IMU");
    let attitude = table("ATT");
    let outputs = table("RCOU");
    let (battery, current) = (table("BAT"), table("CURR"));
    let rate = |rows: &Option<Rows>, source: &str, names| rows.as_ref()?.signal(source, names);
    let signals = Signals {
        position: rate(&estimated, estimator, ["PN", "PE", "PD"]),
        velocity: rate(&estimated, estimator, ["VN", "VE", "VD"]),
        attitude: attitude.as_ref().and_then(turned),
        rates: rate(&imu, "IMU", ["GyrX", "GyrY", "GyrZ"]),
        specific_force: rate(&imu, "IMU", ["AccX", "AccY", "AccZ"]),
        commands: outputs.as_ref().and_then(|outputs| motors::commands(outputs, &layout)),
        rotor_speed: motors::speeds(log, &layout),
        voltage: voltage(battery.as_ref(), "BAT").or_else(|| voltage(current.as_ref(), "CURR")),
        extra: Vec::new(),
    };
    if signals.attitude.is_none() && signals.rates.is_none() {
        return Err(refused(
            "holds neither attitude (ATT) nor gyro (IMU): set LOG_BITMASK as for a normal flight".into(),
        ));
    }
    let range = motors::range(log);
    let airborne = flying::airborne(log, signals.commands.as_ref(), range);
    let [untrusted, untrusted_attitude] = flying::untrusted(log, estimator);
    let mut recording =
        Recording { signals, airborne, untrusted, untrusted_attitude, notes, ..Recording::default() };
    flying::drop_blind_position(log, estimator, &mut recording);
    surroundings::hints(log, &layout, range, &mut recording);
    limits::add(log, &mut recording);
    Ok(recording)
}

/// Attitude of `ATT`, degrees.
fn turned(rows: &Rows) -> Option<Signal<4>> {
    let [roll, pitch, yaw] = rows
        .group(["Roll", "Pitch", "Yaw"])?
        .map(|angle| angle.into_iter().map(f64::to_radians).collect::<Vec<_>>());
    let values = quaternions([&roll, &pitch, &yaw]);
    Some(Signal { source: "ATT".into(), t: rows.t.clone(), values })
}

/// Battery voltage; none if no sensor is there. Whole numbers are hundredths of a volt (`CURR` before 3.3).
fn voltage(rows: Option<&Rows>, source: &str) -> Option<Signal<1>> {
    const LEAST_V: f64 = 1.0;
    let rows = rows?;
    let mut signal: Signal<1> = rows.signal(source, ["Volt"])?;
    if rows.is_whole("Volt") {
        signal.values[0].iter_mut().for_each(|volt| *volt *= 0.01);
    }
    signal.values[0].iter().any(|&volt| volt > LEAST_V).then_some(signal)
}
