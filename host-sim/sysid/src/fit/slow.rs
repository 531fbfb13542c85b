//! The slow part of the horizontal forces, taken away.
//!
//! A wind that wanders pushes a craft by a force that is nearly what it was a moment ago, whatever the craft does: a random walk over the
//! ground. Its differences are noise, and so is what it deviates by from the mean of its own past, weighted by an exponential that
//! forgets: that of a random walk beside white noise is a Kalman filter's innovation. Targets and columns are treated alike, so that what is
//! fitted is the same coefficients, by generalised least squares.
//!
//! Without a position the same is done over a second: how fast a craft moves is known that long.

use std::borrow::Cow;

use crate::fit::least_squares::RowColumn;
use crate::prepare::Prepared;

/// Time constant of the mean, s: a wind whose standard deviation is 1 m/s and that wanders within 4 s stands out of a motion capture's
/// noise up to 2 Hz.
pub const MEMORY_S: f64 = 0.1;
/// The same where the velocity is carried on by an accelerometer, s.
const CARRIED_MEMORY_S: f64 = 1.0;

/// Whether the slow part of the horizontal forces is none of a model's in a flight.
pub fn is_taken(flight: &Prepared) -> bool {
    flight.has_gusts() || !flight.has_position
}

fn memory_s(flight: &Prepared) -> f64 {
    if flight.has_position { MEMORY_S } else { CARRIED_MEMORY_S }
}

/// Targets, residuals or the like at every `stride`th sample as a fit has them: without it, where it is none of the model's.
pub(crate) fn less<'a>(
    flight: &Prepared,
    stride: usize,
    targets: &'a [Vec<f64>; 6],
) -> Cow<'a, [Vec<f64>; 6]> {
    let mut targets = Cow::Borrowed(targets);
    if is_taken(flight) {
        take_from_targets(flight, stride, targets.to_mut());
    }
    targets
}

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
    let keep = (-flight.period_s * stride as f64 / memory_s(flight)).exp();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::prepared;

    /// A craft that yaws evenly, and a force over the ground as it is felt along the body axes.
    fn felt(force_m_s2: impl Fn(f64) -> [f64; 2]) -> (Prepared, [Vec<f64>; 2]) {
        let rate_rad_s = 0.9;
        let flight = prepared(800, |t, row| {
            row.euler_rad[2] = rate_rad_s * t;
            row.rate_rad_s[2] = rate_rad_s;
        });
        let stretch = &flight.stretches[0];
        let mut felt: [Vec<f64>; 2] = Default::default();
        for k in flight.row_samples(stretch, 1) {
            let ([north, east], (sine, cosine)) =
                (force_m_s2(stretch.time_s[k]), stretch.euler_rad[2][k].sin_cos());
            felt[0].push(cosine * north + sine * east);
            felt[1].push(cosine * east - sine * north);
        }
        (flight, felt)
    }

    fn norms(forces: &[Vec<f64>; 2]) -> Vec<f64> {
        forces[0].iter().zip(&forces[1]).map(|(u, v)| u.hypot(*v)).collect()
    }

    #[test]
    fn a_force_that_stays_over_the_ground_is_gone_however_the_craft_turns() {
        let (flight, [u, v]) = felt(|_| [0.8, -0.3]);
        let left = steadied(&flight, 1, [Some(&u), Some(&v)]);
        assert!(norms(&left).iter().all(|left| *left < 1e-9));
    }

    /// Of one that grows evenly, the mean of the past is behind by the time constant (and a sample, for the mean is of what was before).
    #[test]
    fn one_that_grows_evenly_is_ahead_of_its_mean_by_the_memory() {
        let (flight, [u, v]) = felt(|t| [0.5 * t, 0.0]);
        let left = steadied(&flight, 1, [Some(&u), Some(&v)]);
        let decay = (-flight.period_s / MEMORY_S).exp();
        let behind_s = flight.period_s / (1.0 - decay);
        assert!((behind_s - MEMORY_S).abs() < flight.period_s);
        for left in &norms(&left)[200..] {
            assert!((left - 0.5 * behind_s).abs() < 1e-6, "{left}");
        }
    }

    /// What is much quicker than the memory stays as it is: noise is not taken for wind.
    #[test]
    fn what_is_quick_stays() {
        let (flight, [u, v]) = felt(|t| [0.4 * (60.0 * t).sin(), 0.0]);
        let left = steadied(&flight, 1, [Some(&u), Some(&v)]);
        let power = |forces: &[Vec<f64>; 2]| norms(forces).iter().map(|n| n * n).sum::<f64>();
        let kept = power(&left) / power(&[u, v]);
        assert!((0.9..1.1).contains(&kept), "{kept}");
    }

    #[test]
    fn every_stretch_begins_anew_and_columns_are_treated_as_targets_are() {
        let (mut flight, _) = felt(|_| [0.0; 2]);
        let whole = flight.stretches[0].clone();
        flight.stretches = vec![whole.part(0..300), whole.part(400..800)];
        let starts = flight.starts_of_rows(3);
        let rows = flight.fit_row_times_s().len();
        let mut targets: [Vec<f64>; 6] = std::array::from_fn(|axis| vec![axis as f64 + 1.0; rows]);
        let mut column: RowColumn = targets.clone().map(Some);
        take_from_targets(&flight, 3, &mut targets);
        take_from_column(&flight, 3, &mut column);
        assert_eq!(targets.clone().map(Some), column);
        assert!(starts.iter().all(|&row| targets[0][row] == 0.0 && targets[1][row] == 0.0));
        assert!(
            targets[2..].iter().zip(3..).all(|(axis, value)| axis.iter().all(|v| *v == f64::from(value)))
        );
        let mut of_moments = RowColumn::default();
        of_moments[3] = Some(vec![1.0; rows]);
        take_from_column(&flight, 3, &mut of_moments);
        assert!(of_moments[0].is_none() && of_moments[1].is_none());
    }
}
