//! What logs say of times, for the effects that delay the rotors.

use crate::effect::Estimate;

/// Shortest lag or dead time that a log shows, s.
const RESOLVED_S: f64 = 0.001;

/// A lag or a dead time of a fraction of a millisecond: logs do not tell when their commands took effect as exactly as that
/// (times jitter, commands are held), and no loop at 100 Hz feels it.
pub(super) fn below_the_clocks(estimates: &[Estimate]) -> Option<String> {
    let timing = estimates.first()?;
    (timing.value.abs() < RESOLVED_S).then(|| {
        format!(
            "too small to matter: {:.2} ms, under the {:.0} ms that a log's times resolve",
            1e3 * timing.value,
            1e3 * RESOLVED_S
        )
    })
}
