//! Falls of errors as sentences tell them.

use model::Axis;

/// Percent by which a root mean square falls whose square falls by `percent`.
pub(crate) fn rms_fall_percent(percent: f64) -> f64 {
    100.0 * (1.0 - (1.0 - percent / 100.0).max(0.0).sqrt())
}

/// "rms error of u, v and w": of several axes, each counts in units of its noise.
pub(crate) fn rms_of(axes: &[Axis]) -> String {
    let names: Vec<&str> = axes.iter().map(|axis| axis.name()).collect();
    match names.as_slice() {
        all if all.len() == model::AXES.len() => "rms error of all axes".into(),
        [first @ .., last] if !first.is_empty() => format!("rms error of {} and {last}", first.join(", ")),
        few => format!("rms error of {}", few.concat()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_root_falls_less_than_its_square_and_rises_with_it() {
        for (squared, root) in [(0.0, 0.0), (75.0, 50.0), (100.0, 100.0), (-300.0, -100.0)] {
            assert!((rms_fall_percent(squared) - root).abs() < 1e-12, "{squared}");
        }
    }
}
