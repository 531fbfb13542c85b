//! Times that rise, rotations, and slopes: what every program's tables need on their way to signals.

use model::frames;
use nalgebra::Vector3;

use crate::recording::Signal;

/// A step further than this that is taken back at once is a wrong time, s.
const ABSURD_STEP_S: f64 = 60.0;

/// Rows of a table whose times rise strictly.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::sources) struct Rising {
    /// Times of the rows, s.
    pub(in crate::sources) t: Vec<f64>,
    rows: Vec<usize>,
    /// Rows that are left out, for their times go back, repeat or are absurd.
    pub(in crate::sources) left_out: usize,
}

impl Rising {
    /// Of all times of a table, s.
    pub(in crate::sources) fn of(times: &[f64]) -> Self {
        let mut rising = Self::default();
        let mut last = f64::NEG_INFINITY;
        for (row, &time) in times.iter().enumerate() {
            let next = times.get(row + 1).copied().unwrap_or(f64::INFINITY);
            let jumps = last.is_finite() && time - last > ABSURD_STEP_S && next > last && next < time;
            if time.is_finite() && time > last && !jumps {
                rising.t.push(time);
                rising.rows.push(row);
                last = time;
            }
        }
        rising.left_out = times.len() - rising.t.len();
        rising
    }

    /// Values of all rows as those of the rows that are kept.
    pub(in crate::sources) fn pick(&self, values: &[f64]) -> Vec<f64> {
        if self.left_out == 0 {
            return values.to_vec();
        }
        self.rows.iter().map(|&row| values.get(row).copied().unwrap_or(f64::NAN)).collect()
    }

    /// A signal of columns that are still those of all rows.
    pub(in crate::sources) fn signal<const N: usize>(
        &self,
        source: &str,
        values: &[Vec<f64>; N],
    ) -> Signal<N> {
        let values = values.each_ref().map(|column| self.pick(column));
        Signal { source: source.into(), t: self.t.clone(), values }
    }
}

/// Forward-left-up to forward-right-down, and the world likewise.
pub(in crate::sources) fn flip([x, mut y, mut z]: [Vec<f64>; 3]) -> [Vec<f64>; 3] {
    y.iter_mut().chain(&mut z).for_each(|value| *value = -*value);
    [x, y, z]
}

/// Multiplies all values.
pub(in crate::sources) fn scale<const N: usize>(mut values: [Vec<f64>; N], factor: f64) -> [Vec<f64>; N] {
    values.iter_mut().flatten().for_each(|value| *value *= factor);
    values
}

/// Makes quaternions w, x, y, z of unit length and their signs continuous; NaN where they have no length.
pub(in crate::sources) fn normalise(quaternions: &mut [Vec<f64>; 4]) {
    let mut before = [1.0, 0.0, 0.0, 0.0];
    for row in 0..quaternions[0].len() {
        let mut quaternion = at(quaternions, row);
        let length = quaternion.iter().map(|part| part * part).sum::<f64>().sqrt();
        let along: f64 = quaternion.iter().zip(&before).map(|(a, b)| a * b).sum();
        let divisor = if length < 0.1 || !length.is_finite() { f64::NAN } else { length.copysign(along) };
        quaternion.iter_mut().for_each(|part| *part /= divisor);
        if divisor.is_finite() {
            before = quaternion;
        }
        quaternions.iter_mut().zip(quaternion).for_each(|(column, part)| column[row] = part);
    }
}

/// A row of columns.
pub(in crate::sources) fn at<const N: usize>(columns: &[Vec<f64>; N], row: usize) -> [f64; N] {
    columns.each_ref().map(|column| column.get(row).copied().unwrap_or(f64::NAN))
}

/// Quaternion w, x, y, z of roll, pitch, yaw (ZYX), rad.
pub(in crate::sources) fn from_euler(roll: f64, pitch: f64, yaw: f64) -> [f64; 4] {
    frames::quaternion_from_euler(Vector3::new(roll, pitch, yaw)).into()
}

/// Quaternions w, x, y, z of roll, pitch and yaw, rad (front-right-down to north-east-down), with continuous
/// signs.
pub(in crate::sources) fn quaternions([roll, pitch, yaw]: [&[f64]; 3]) -> [Vec<f64>; 4] {
    let mut all = [const { Vec::new() }; 4];
    for ((&roll, &pitch), &yaw) in roll.iter().zip(pitch).zip(yaw) {
        all.iter_mut().zip(from_euler(roll, pitch, yaw)).for_each(|(all, part)| all.push(part));
    }
    normalise(&mut all);
    all
}

/// Turns a vector from body to inertial axes.
pub(in crate::sources) fn rotate([w, x, y, z]: [f64; 4], [a, b, c]: [f64; 3]) -> [f64; 3] {
    let (u, v, s) = (2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a));
    [a + w * u + y * s - z * v, b + w * v + z * u - x * s, c + w * s + x * v - y * u]
}

/// Turns a vector from inertial to body axes.
pub(in crate::sources) fn rotate_back([w, x, y, z]: [f64; 4], vector: [f64; 3]) -> [f64; 3] {
    rotate([w, -x, -y, -z], vector)
}

/// The row whose time is nearest, if it is within so many seconds.
pub(in crate::sources) fn nearest(t: &[f64], time: f64, within_s: f64) -> Option<usize> {
    let after = t.partition_point(|&t| t < time);
    let row = [after.checked_sub(1), Some(after)]
        .into_iter()
        .flatten()
        .filter(|&row| row < t.len())
        .min_by(|&a, &b| (t[a] - time).abs().total_cmp(&(t[b] - time).abs()))?;
    ((t[row] - time).abs() <= within_s).then_some(row)
}

/// The value at a time between two rows; NaN outside, and within gaps longer than `longest_s`.
pub(in crate::sources) fn interpolate(t: &[f64], values: &[f64], time: f64, longest_s: f64) -> f64 {
    let after = t.partition_point(|&t| t <= time);
    let Some(before) = after.checked_sub(1) else { return f64::NAN };
    if t[before] == time {
        return values[before];
    }
    let Some(end) = t.get(after) else { return f64::NAN };
    let step = end - t[before];
    if step > longest_s {
        return f64::NAN;
    }
    values[before] + (values[after] - values[before]) * (time - t[before]) / step
}

/// Body rates of an attitude, rad/s, in the middle between its rows, with their times.
pub(in crate::sources) fn rates_of_attitude(attitude: &Signal<4>) -> (Vec<f64>, [Vec<f64>; 3]) {
    let (mut times, mut rates) = (Vec::new(), [const { Vec::new() }; 3]);
    for (row, pair) in attitude.t.windows(2).enumerate() {
        let step = pair[1] - pair[0];
        let ([w, x, y, z], [a, b, c, d]) = (at(&attitude.values, row), at(&attitude.values, row + 1));
        // The vector part of the quaternion that leads from one to the next.
        let turn =
            [w * b - x * a - y * d + z * c, w * c + x * d - y * a - z * b, w * d - x * c + y * b - z * a];
        times.push(f64::midpoint(pair[0], pair[1]));
        rates.iter_mut().zip(turn).for_each(|(column, part)| column.push(2.0 * part / step));
    }
    (times, rates)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_that_go_back_and_absurd_ones_are_left_out() {
        let rising = Rising::of(&[1.0, 2.0, 2.0, 1.5, 5e9, 3.0, f64::NAN, 4.0]);
        assert_eq!((rising.t.clone(), rising.left_out), (vec![1.0, 2.0, 3.0, 4.0], 4));
        assert_eq!(rising.pick(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]), [0.0, 1.0, 5.0, 7.0]);
    }

    /// A quarter turn to the right: forward is east. Pitch up: forward is up.
    #[test]
    fn rotations_turn_as_aircraft_do() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14);
        assert!(close(rotate(from_euler(0.0, 0.0, quarter), [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]));
        assert!(close(rotate(from_euler(0.0, quarter, 0.0), [1.0, 0.0, 0.0]), [0.0, 0.0, -1.0]));
        assert!(close(rotate(from_euler(quarter, 0.0, 0.0), [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]));
        let both = from_euler(0.3, -0.2, 2.0);
        assert!(close(rotate_back(both, rotate(both, [1.0, 2.0, 3.0])), [1.0, 2.0, 3.0]));
    }

    /// A turn with constant body rates has those rates.
    #[test]
    fn rates_follow_from_attitude() {
        let rate = 0.5_f64;
        let t: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01).collect();
        let mut values = [const { Vec::new() }; 4];
        for time in &t {
            let angles = [0.0, rate * time, 0.0];
            let quaternion = from_euler(angles[0], angles[1], angles[2]);
            values.iter_mut().zip(quaternion).for_each(|(column, part)| column.push(part));
        }
        let (times, rates) = rates_of_attitude(&Signal { source: String::new(), t, values });
        assert!((times[0] - 0.005).abs() < 1e-12);
        assert!(rates[1].iter().all(|q| (q - rate).abs() < 1e-5));
        assert!(rates[0].iter().chain(&rates[2]).all(|other| other.abs() < 1e-12));
    }

    #[test]
    fn quaternions_keep_their_sign() {
        let mut quaternions =
            [vec![2.0, -1.0, 0.0], vec![0.0, 0.0, 0.0], vec![0.0, 0.0, 0.0], vec![0.0, -0.1, 0.0]];
        normalise(&mut quaternions);
        assert_eq!(quaternions[0][0], 1.0);
        assert!(quaternions[0][1] > 0.99 && quaternions[3][1] > 0.0);
        assert!(quaternions[0][2].is_nan());
    }

    #[test]
    fn between_rows() {
        assert_eq!(interpolate(&[0.0, 1.0, 3.0], &[0.0, 2.0, 4.0], 0.5, 1.5), 1.0);
        assert!(interpolate(&[0.0, 1.0, 3.0], &[0.0, 2.0, 4.0], 2.0, 1.5).is_nan());
        assert!(interpolate(&[0.0, 1.0], &[0.0, 2.0], 2.0, 1.5).is_nan());
        assert_eq!(interpolate(&[0.0, 3.0], &[0.0, 2.0], 3.0, 1.5), 2.0);
        assert_eq!(nearest(&[0.0, 1.0, 3.0], 1.9, 1.0), Some(1));
        assert_eq!(nearest(&[0.0, 1.0, 3.0], 9.0, 1.0), None);
    }
}
