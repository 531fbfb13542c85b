//! Which fields of a log are kept.

/// Beginnings of the names of fields that are kept.
const KEPT: [&str; 15] = [
    "gyroADC",
    "gyroData",
    "accSmooth",
    "motor[",
    "eRPM",
    "vbat",
    "setpoint",
    "magADC",
    "BaroAlt",
    "baroAlt",
    "debug",
    "navPos",
    "navVel",
    "attitude",
    "imuQuaternion",
];

/// Whether a field is kept.
pub(super) fn is_kept(name: &str) -> bool {
    KEPT.iter().any(|kept| name.starts_with(kept))
}
