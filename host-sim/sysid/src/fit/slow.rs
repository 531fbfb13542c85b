//! The slow part of the horizontal forces, taken away.
//!
//! A wind that wanders pushes a craft by a force that is nearly what it was a moment ago, whatever the craft does: a random walk over the
//! ground. Its differences are noise, and so is what it deviates by from the mean of its own past, weighted by an exponential that
//! forgets: that of a random walk beside white noise is a Kalman filter's innovation. Targets and columns are treated alike, so that what is
//! fitted is the same coefficients, by generalised least squares.

use crate::fit::least_squares::RowColumn;
use crate::prepare::Prepared;

/// Time constant of the mean, s: a wind whose standard deviation is 1 m/s and that wanders within 4 s stands out of a motion capture's
/// noise up to 2 Hz.
pub const MEMORY_S: f64 = 0.1;

/// Takes it from targets, residuals or the like at every `stride`th sample.
pub fn take_from_targets(flight: &Prepared, stride: usize, targets: &mut [Vec<f64>; 6]) {
    let [u, v, ..] = targets;
    [*u, *v] = steadied(flight, stride, [Some(u), Some(v)]);
}

/// Takes it from a column at every `stride`th sample.
pub fn take_from_column(flight: &Prepared, stride: usize, column: &mut RowColumn) {
    let [u, v, ..] = column;
    if u.is_some() || v.is_some() {
        let taken = steadied(flight, stride, [u.as_deref(), v.as_deref()]);
        [*u, *v] = taken.map(Some);
    }
}

/// Forces along the horizontal body axes less their slow part over the ground; nothing stands for zeros.
pub fn steadied(flight: &Prepared, stride: usize, forces: [Option<&[f64]>; 2]) -> [Vec<f64>; 2] {
    let rows = forces.iter().flatten().map(|f| f.len()).max().unwrap_or(0);
    let mut result = [0, 1].map(|_| Vec::with_capacity(rows));
    let keep = (-flight.period_s * stride as f64 / MEMORY_S).exp();
    let mut row = 0;
    for stretch in &flight.stretches {
        let mut mean: Option<[f64; 2]> = None;
        for k in flight.row_samples(stretch, stride) {
            let (sine, cosine) = stretch.euler_rad[2][k].sin_cos();
            let [u, v] = forces.map(|force| force.map_or(0.0, |force| force[row]));
            row += 1;
            let now = [cosine * u - sine * v, sine * u + cosine * v];
            let before = mean.get_or_insert(now);
            let [north, east] = [now[0] - before[0], now[1] - before[1]];
            before.iter_mut().zip(now).for_each(|(b, n)| *b = keep * *b + (1.0 - keep) * n);
            result[0].push(cosine * north + sine * east);
            result[1].push(cosine * east - sine * north);
        }
    }
    result
}
