//! Cubic Hermite interpolation.

/// The cubic between two samples `step` apart with these values and slopes there, at the part `s`
/// of the way, 0 to 1.
pub(crate) fn hermite(s: f64, step: f64, values: [f64; 2], slopes: [f64; 2]) -> f64 {
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * values[0]
        + (s3 - 2.0 * s2 + s) * step * slopes[0]
        + (3.0 * s2 - 2.0 * s3) * values[1]
        + (s3 - s2) * step * slopes[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_with_its_slopes_is_met_everywhere() {
        let cubic = |t: f64| 2.0 + t * (3.0 + t * (-4.0 + 5.0 * t));
        let slope = |t: f64| 3.0 + t * (-8.0 + 15.0 * t);
        let (start, step) = (0.4, 0.7);
        let end = start + step;
        for s in [0.0, 0.1, 0.5, 0.9, 1.0] {
            let found = hermite(s, step, [cubic(start), cubic(end)], [slope(start), slope(end)]);
            let exact = cubic(start + s * step);
            assert!((found - exact).abs() < 1e-13, "{s}: {found} instead of {exact}");
        }
    }
}
