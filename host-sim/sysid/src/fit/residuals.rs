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
