//! How a log is sampled: its period, and what is a gap in it.

/// Steps longer than this many periods are gaps: nothing is interpolated or held across.
pub const GAP_PERIODS: f64 = 3.5;

/// Median sampling period, s.
pub fn median_step(t: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        return f64::NAN;
    }
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_rows_do_not_change_the_period() {
        let t = [0.0, 0.01, 0.02, 0.05, 0.06, 0.07, 3.0, 3.01];
        assert!((median_step(&t) - 0.01).abs() < 1e-12);
    }

    #[test]
    fn a_single_row_has_no_period() {
        assert!(median_step(&[1.0]).is_nan());
    }
}
