//! What a model leaves of flights, and how much that is.

use model::{AxisError, PerAxis};

/// Residuals (measured minus predicted) of one flight over its rows.
#[derive(Debug, Clone, Default)]
pub struct Residuals {
    /// Measured, for each axis.
    pub measured: [Vec<f64>; 6],
    /// Measured minus predicted, for each axis.
    pub residual: [Vec<f64>; 6],
}

/// Errors of each axis over several flights.
pub fn errors<'a>(all: impl IntoIterator<Item = &'a Residuals>) -> PerAxis<AxisError> {
    let mut sums = PerAxis::<(f64, f64, f64, u64)>::default();
    for one in all {
        for axis in model::AXES {
            let sum = &mut sums[axis];
            for (e, y) in one.residual[axis.index()].iter().zip(&one.measured[axis.index()]) {
                sum.0 += e * e;
                sum.1 += y;
                sum.2 += y * y;
                sum.3 += 1;
            }
        }
    }
    PerAxis::from_fn(|axis| {
        let (sse, total, squares, samples) = sums[axis];
        let n = samples.max(1) as f64;
        let about_mean = squares - total * total / n;
        AxisError {
            sse,
            rms: (sse / n).sqrt(),
            r2: if about_mean > 0.0 { 1.0 - sse / about_mean } else { 0.0 },
            samples,
        }
    })
}

/// Logarithm of the residuals' standard deviations over all axes: the likelihood, but for sign and scale.
pub(crate) fn spread(sigma: &[f64; 6]) -> f64 {
    sigma.iter().map(|s| s.ln()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_w(measured: &[f64], residual: &[f64]) -> Residuals {
        let mut all = Residuals::default();
        (all.measured[2], all.residual[2]) = (measured.to_vec(), residual.to_vec());
        all
    }

    /// Measured 1, 2, 3, 6 about their mean of 3 have squares of 14; the residuals' are 7.
    #[test]
    fn errors_are_of_all_flights_together_about_the_common_mean() {
        let flights = [on_w(&[1.0, 2.0], &[1.0, -1.0]), on_w(&[3.0, 6.0], &[2.0, 1.0])];
        let w = errors(&flights).w;
        assert_eq!((w.sse, w.samples), (7.0, 4));
        assert!((w.rms - 1.75_f64.sqrt()).abs() < 1e-15 && (w.r2 - 0.5).abs() < 1e-15);
    }

    #[test]
    fn what_never_varies_has_nothing_to_explain_and_no_rows_have_no_error() {
        let constant = errors([&on_w(&[2.0, 2.0], &[0.5, 0.5])]).w;
        assert_eq!((constant.r2, constant.rms), (0.0, 0.5));
        assert_eq!(errors([]).w, AxisError::default());
    }

    #[test]
    fn a_model_worse_than_the_mean_has_a_negative_share() {
        assert!((errors([&on_w(&[-1.0, 1.0], &[-2.0, 2.0])]).w.r2 + 3.0).abs() < 1e-15);
    }

    #[test]
    fn the_spread_grows_by_the_logarithm_of_the_unit_of_each_axis() {
        let sigma = [0.1, 0.2, 0.3, 1.0, 2.0, 3.0];
        let doubled = sigma.map(|s| 2.0 * s);
        assert!((spread(&doubled) - spread(&sigma) - 6.0 * 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!(spread(&[1.0; 6]), 0.0);
    }
}
