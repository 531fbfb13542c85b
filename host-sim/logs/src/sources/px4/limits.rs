//! What a log cannot tell, and the setting that would log it.

use crate::recording::Recording;
use crate::spans::rate_hz;

/// Slower commands show nothing of what the rate loop does.
const SLOW_COMMANDS_HZ: f64 = 25.0;
/// Slower commands do not show all of it.
const FAST_COMMANDS_HZ: f64 = 80.0;
/// Slower attitude does not follow the craft's turning.
const FAST_ATTITUDE_HZ: f64 = 45.0;
const FAST_POSITION_HZ: f64 = 20.0;
/// Slower speeds do not follow the rotors.
const FAST_ROTORS_HZ: f64 = 50.0;

/// Default set, system identification, high rate: bits 0, 3 and 4.
const PROFILE: &str = "set SDLOG_PROFILE to 25 (default, system identification and high rate)";

/// Adds what follows from how fast quantities are logged.
pub(super) fn add(recording: &mut Recording) {
    let signals = &recording.signals;
    let rate = |t: Option<&Vec<f64>>| t.and_then(|t| rate_hz(t, &recording.airborne));
    let mut limits = Vec::new();
    match rate(signals.commands.as_ref().map(|signal| &signal.t)) {
        Some(hz) if hz < SLOW_COMMANDS_HZ => limits.push(format!(
            "motor commands are logged at {hz:.0} Hz: forces can be fitted, rotation cannot; {PROFILE}"
        )),
        Some(hz) if hz < FAST_COMMANDS_HZ => limits.push(format!(
            "motor commands are known at {hz:.0} Hz: forces and slow rotation can be fitted, fast rotation cannot; {PROFILE}"
        )),
        Some(_) => {}
        None => limits
            .push(format!("motor commands are not logged while flying: no model can be fitted; {PROFILE}")),
    }
    if let Some(hz) =
        rate(signals.attitude.as_ref().map(|signal| &signal.t)).filter(|hz| *hz < FAST_ATTITUDE_HZ)
    {
        limits.push(format!("attitude is logged at {hz:.0} Hz: fast rotation is smoothed out; {PROFILE}"));
    }
    match rate(signals.position.as_ref().map(|signal| &signal.t)) {
        Some(hz) if hz < FAST_POSITION_HZ => limits.push(format!(
            "position and velocity are logged at {hz:.0} Hz: to log them faster, list vehicle_local_position in etc/logging/logger_topics.txt on the SD card, \
             with every other topic you need, because that file replaces SDLOG_PROFILE"
        )),
        Some(_) => {}
        None => limits.push("position and velocity are not logged: thrust can be fitted from the accelerometer, drag and wind cannot".into()),
    }
    if let Some(hz) =
        rate(signals.rotor_speed.as_ref().map(|signal| &signal.t)).filter(|hz| *hz < FAST_ROTORS_HZ)
    {
        limits.push(format!(
            "rotor speeds are logged at {hz:.0} Hz: too slow to stand for the speed of the rotors; {PROFILE}"
        ));
    }
    if signals.rates.is_none() {
        limits.push(format!("body rates are not logged: rotation cannot be fitted; {PROFILE}"));
    }
    if signals.specific_force.is_none() {
        limits.push(format!("specific force is not logged; {PROFILE}"));
    }
    recording.limits.extend(limits);
}
