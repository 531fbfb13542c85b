//! What a log cannot tell, and the setting that would log it.

use crate::log::Log;
use crate::recording::Recording;

use crate::spans::rate_hz;

/// Slower commands show nothing of what the rate loop does.
const FAST_COMMANDS_HZ: f64 = 45.0;
/// Slower attitude does not follow the craft's turning.
const FAST_ATTITUDE_HZ: f64 = 45.0;
/// Bits of LOG_BITMASK by their names.
const FAST: &str = "set LOG_BITMASK to hold Fast Attitude (1), RC Output (1024) and Fast IMU (262144)";

/// Adds what follows from what is missing and how fast the rest is logged.
pub(super) fn add(log: &Log, recording: &mut Recording) {
    let signals = &recording.signals;
    let rate = |t: Option<&Vec<f64>>| t.and_then(|t| rate_hz(t, &[]));
    let mut limits = Vec::new();
    match rate(signals.commands.as_ref().map(|signal| &signal.t)) {
        Some(hz) if hz < FAST_COMMANDS_HZ => {
            limits.push(format!(
                "motor commands (RCOU) are logged at {hz:.0} Hz: forces can be fitted, rotation cannot; \
                 {FAST}"
            ));
        }
        Some(_) => {}
        None => limits.push(
            "motor commands (RCOU) are not logged: no model can be fitted; set LOG_BITMASK \
                 to hold RC Output (1024)"
                .into(),
        ),
    }
    match rate(signals.attitude.as_ref().map(|signal| &signal.t)) {
        Some(hz) if hz < FAST_ATTITUDE_HZ => {
            limits.push(format!(
                "attitude (ATT) is logged at {hz:.0} Hz: fast rotation is smoothed out; {FAST}"
            ));
        }
        Some(_) => {}
        None => limits.push("attitude (ATT) is not logged: set LOG_BITMASK to hold Fast Attitude (1)".into()),
    }
    if signals.rates.is_none() {
        limits.push(
            "gyro and accelerometer (IMU) are not logged: set LOG_BITMASK to hold Fast IMU (262144)".into(),
        );
    }
    if signals.position.is_none() && !recording.limits.iter().any(|limit| limit.starts_with("position")) {
        limits.push(
            "position and velocity (XKF1, NKF1) are not logged: forces are known from the \
                 accelerometer alone"
                .into(),
        );
    }
    if signals.voltage.is_none() {
        limits.push(
            "the battery's voltage is not logged: set BATT_MONITOR, and LOG_BITMASK to hold \
                 Battery Monitor (512)"
                .into(),
        );
    }
    if signals.rotor_speed.is_none() && log.table("ESC").is_none() {
        limits.push(
            "rotor speeds are not logged: ESCs with telemetry (SERVO_BLH_AUTO, SERVO_DSHOT_ESC) \
                 would log them (ESC)"
                .into(),
        );
    }
    recording.limits.extend(limits);
}
