//! What logs say of times, for the effects that delay the rotors.

use crate::effect::Requirement;

/// Shortest lag or dead time that a log shows, ms: a tenth of a sample.
const RESOLVED_MS: f64 = 1.0;

/// Logs do not tell when their commands took effect more exactly than that (times jitter, commands are held), and no loop
/// at 100 Hz feels it.
pub(super) const CAN_BE_TIMED: Requirement = Requirement {
    question: "can be resolved: size of the lag or dead time",
    unit: "ms",
    figures: |estimates| (estimates.first().map_or(0.0, |time| 1e3 * time.value.abs()), RESOLVED_MS),
    objection: "too small to matter, because the time stamps of a log resolve 1 ms",
};
