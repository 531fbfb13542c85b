//! Interpolation of a sampled signal: cubic Hermite arcs.

/// The cubic between two samples `step` apart with these values and slopes there, at the part `s`
/// of the way, 0 to 1.
pub fn hermite(s: f64, step: f64, values: [f64; 2], slopes: [f64; 2]) -> f64 {
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * values[0]
        + (s3 - 2.0 * s2 + s) * step * slopes[0]
        + (3.0 * s2 - 2.0 * s3) * values[1]
        + (s3 - s2) * step * slopes[1]
}

/// Cubic Hermite interpolation between samples `at` and `at + 1`, with the slopes of the parabolas
/// through each of them and its neighbours: exact for a parabola however the samples lie, and in
/// the middle of even ones a cubic through four.
pub fn interpolated(t: &[f64], y: &[f64], at: usize, time: f64) -> f64 {
    let secant = |k: usize| (y[k + 1] - y[k]) / (t[k + 1] - t[k]);
    let slope = |k: usize| {
        if k == 0 {
            return secant(0);
        }
        if k + 1 == t.len() {
            return secant(k - 1);
        }
        let (before, after) = (t[k] - t[k - 1], t[k + 1] - t[k]);
        (secant(k - 1) * after + secant(k) * before) / (before + after)
    };
    let step = t[at + 1] - t[at];
    hermite((time - t[at]) / step, step, [y[at], y[at + 1]], [slope(at), slope(at + 1)])
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
