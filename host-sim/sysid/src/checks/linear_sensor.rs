//! Does a sensor on board measure what the tracker does: to scale, at right angles, with a steady bias?
//!
//! ```text
//! tracked = N sensed + bias + drift t + further
//! ```
//!
//! A tracked frame that is turned against the sensor shows as a rotation, the part of N that changes its sign with its indices: that is no
//! fault of the sensor. About x and y it is left to `attitude-offset`, for gravity tells which of the two is turned; about z it is named.

use nalgebra::Matrix3;
use report::number::{fixed, with_error};

use crate::fit::least_squares::{self, FlightRows, RowColumn};

/// Time between the rows of a regression, s.
const ROW_PERIOD_S: f64 = 0.03;
/// Scales and cross axes that matter.
const MATTERS: f64 = 0.02;
/// Standard errors that a fault stands out by.
pub(super) const SIGNIFICANT: f64 = 5.0;
/// Rows of a regression at least: some seconds.
const FEWEST_ROWS: usize = 300;
/// Factors, biases and drifts.
const UNKNOWNS: usize = 15;

/// A motion as the sensor has it and as the tracker has it, row by row.
#[derive(Default, Clone)]
pub(super) struct Rows {
    pub(super) sensed: [Vec<f64>; 3],
    pub(super) tracked: [Vec<f64>; 3],
    /// What else the tracked point may have: a column for each unknown.
    pub(super) further: Vec<[Vec<f64>; 3]>,
    time_s: Vec<f64>,
    starts: Vec<usize>,
    period_s: f64,
}

/// What a sensor makes of the true vector, with standard errors.
pub(super) struct Linear {
    matrix: Matrix3<f64>,
    error: Matrix3<f64>,
    /// Of the bias of each axis, its unit per second.
    drift: [(f64, f64); 3],
    /// What the tracked motion has of each further column beside the sensed one, with its error.
    pub(super) further: Vec<(f64, f64)>,
    length_s: f64,
}

/// A sensor for people.
pub(super) struct Sensor {
    pub(super) name: &'static str,
    pub(super) columns: [&'static str; 3],
    /// What the tracker says of it.
    pub(super) tracked: &'static str,
    pub(super) unit: &'static str,
    /// Change of a bias over a flight that matters, in this unit.
    pub(super) drift_matters: f64,
}

impl Rows {
    /// None yet, of samples so far apart.
    pub(super) fn new(period_s: f64) -> Self {
        Self { period_s: Self::stride(period_s) as f64 * period_s, ..Self::default() }
    }

    /// Samples between two rows.
    pub(super) fn stride(period_s: f64) -> usize {
        ((ROW_PERIOD_S / period_s).round() as usize).max(1)
    }

    /// Says that the next row follows upon none.
    pub(super) fn begin(&mut self) {
        if self.starts.last() != Some(&self.time_s.len()) {
            self.starts.push(self.time_s.len());
        }
    }

    pub(super) fn push(&mut self, time_s: f64, sensed: [f64; 3], tracked: [f64; 3]) {
        self.time_s.push(time_s);
        for axis in 0..3 {
            self.sensed[axis].push(sensed[axis]);
            self.tracked[axis].push(tracked[axis]);
        }
    }

    /// The same with more that the tracked point may have.
    pub(super) fn with_further(&self, columns: &[[Vec<f64>; 3]]) -> Self {
        let mut with = self.clone();
        with.further.extend_from_slice(columns);
        with
    }

    /// A regression over these rows.
    pub(super) fn of(&self, targets: [Vec<f64>; 6], columns: Vec<RowColumn>) -> FlightRows {
        FlightRows { targets, columns, starts: self.starts.clone(), period_s: self.period_s }
    }

    /// What the sensor makes of the tracked motion, where its noise is small beside that of the tracker: that of the regressor makes
    /// factors too small.
    pub(super) fn sensor_by_tracked(&self) -> Option<Linear> {
        let found = self.regress(&self.tracked, &self.sensed, 1.0)?;
        // What the sensor gains is taken out of the tracked motion.
        let drift = found.drift.map(|(slope, error)| (-slope, error));
        Some(Linear { matrix: found.matrix.try_inverse()?, drift, ..found })
    }

    /// The same where the noise of both may count: of the regressions of one on the other and of the other on the one, that which says
    /// less, and nothing where they contradict each other.
    pub(super) fn sensor_either_way(&self) -> Option<Linear> {
        let one = self.sensor_by_tracked()?;
        let other = self.regress(&self.sensed, &self.tracked, -1.0)?;
        let same = Matrix3::identity();
        let excess = |of: &Linear, i, j| (of.matrix - same)[(i, j)];
        let matrix = Matrix3::from_fn(|i, j| same[(i, j)] + less(excess(&one, i, j), excess(&other, i, j)));
        let error = Matrix3::from_fn(|i, j| one.error[(i, j)].max(other.error[(i, j)]));
        let further = one.further.iter().zip(&other.further);
        let further = further.map(|(a, b)| (less(a.0, b.0), a.1.max(b.1))).collect();
        Some(Linear { matrix, error, further, ..one })
    }

    /// One motion by the other, with further columns times a sign.
    fn regress(&self, target: &[Vec<f64>; 3], on: &[Vec<f64>; 3], sign: f64) -> Option<Linear> {
        let count = self.time_s.len();
        if count < FEWEST_ROWS {
            return None;
        }
        let (first_s, last_s) = (self.time_s[0], self.time_s[count - 1]);
        let column = |axis: usize, values: Vec<f64>| {
            let mut column = RowColumn::default();
            column[3 + axis] = Some(values);
            column
        };
        let times: Vec<f64> = self.time_s.iter().map(|time| time - 0.5 * (first_s + last_s)).collect();
        let mut columns: Vec<RowColumn> = (0..9).map(|k| column(k / 3, on[k % 3].clone())).collect();
        columns.extend((0..3).map(|axis| column(axis, vec![1.0; count])));
        columns.extend((0..3).map(|axis| column(axis, times.clone())));
        for further in &self.further {
            let mut joint = RowColumn::default();
            for (axis, values) in further.iter().enumerate() {
                joint[3 + axis] = Some(values.iter().map(|value| sign * value).collect());
            }
            columns.push(joint);
        }
        let mut targets: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; count]);
        targets[3..].clone_from_slice(target);
        let unknowns = columns.len();
        let solution = least_squares::solve(&[self.of(targets, columns)], &vec![None; unknowns]).ok()?;
        let of = |k: usize| (solution.value[k], solution.covariance[(k, k)].max(0.0).sqrt());
        Some(Linear {
            matrix: Matrix3::from_fn(|i, j| of(3 * i + j).0),
            error: Matrix3::from_fn(|i, j| of(3 * i + j).1),
            drift: std::array::from_fn(|i| of(UNKNOWNS - 3 + i)),
            further: (UNKNOWNS..unknowns).map(of).collect(),
            length_s: last_s - first_s,
        })
    }
}

/// The smaller of two values that agree in sign; nothing where they do not.
fn less(one: f64, other: f64) -> f64 {
    if one * other <= 0.0 { 0.0 } else { one.signum() * one.abs().min(other.abs()) }
}

impl Linear {
    /// By how many degrees the sensor is turned about z against the tracked frame, and the error of that.
    pub(super) fn turned_about_z_deg(&self) -> (f64, f64) {
        let turn = 0.5 * (self.matrix[(0, 1)] - self.matrix[(1, 0)]);
        let error = 0.5 * self.error[(0, 1)].hypot(self.error[(1, 0)]);
        (turn.to_degrees(), error.to_degrees())
    }

    /// The faults of a sensor, in sentences; those of scale and cross axis only between axes that tell.
    pub(super) fn faults(&self, sensor: &Sensor, tells: [bool; 3]) -> Vec<String> {
        let Sensor { name, columns, unit, .. } = sensor;
        let mut found = Vec::new();
        for i in (0..3).filter(|i| tells[*i]) {
            let (more, error) = (self.matrix[(i, i)] - 1.0, self.error[(i, i)]);
            if more.abs() > MATTERS.max(SIGNIFICANT * error) {
                found.push(sensor.scale_sentence(columns[i], more, error));
            }
        }
        for (i, j) in [(0, 1), (0, 2), (1, 2)].into_iter().filter(|(i, j)| tells[*i] && tells[*j]) {
            let shared = 0.5 * (self.matrix[(i, j)] + self.matrix[(j, i)]);
            let error = 0.5 * self.error[(i, j)].hypot(self.error[(j, i)]);
            if shared.abs() > MATTERS.max(SIGNIFICANT * error) {
                found.push(format!(
                    "the {name}'s {} and {} are not at right angles: each measures {} of the other",
                    columns[i],
                    columns[j],
                    with_error(100.0 * shared, 100.0 * error, "%")
                ));
            }
        }
        for (column, (slope, error)) in columns.iter().zip(self.drift) {
            if (slope * self.length_s).abs() > sensor.drift_matters.max(SIGNIFICANT * error * self.length_s) {
                let drift = with_error(60.0 * slope, 60.0 * error, unit);
                found.push(format!("the bias of the {name}'s {column} drifts by {drift} in a minute"));
            }
        }
        found
    }
}

impl Sensor {
    fn scale_sentence(&self, column: &str, more: f64, error: f64) -> String {
        let Self { name, tracked, .. } = self;
        let than = if more > 0.0 { "larger" } else { "smaller" };
        let by = with_error(100.0 * more.abs(), 100.0 * error, "%");
        let scale = fixed(1.0 / (1.0 + more), 3);
        format!(
            "the {name}'s {column} is {by} {than} than {tracked}: if the tracker is right, write {column} = {{ column = \"{column}\", \
             scale = {scale} }} under [columns] in columns.toml"
        )
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    use super::*;

    const SENSOR: Sensor = Sensor {
        name: "sensor",
        columns: ["a", "b", "c"],
        tracked: "the tracked one",
        unit: "m/s^2",
        drift_matters: 0.1,
    };

    /// Waves of amplitude 1 on three axes, as the sensor and as the tracker make them, for some rows at 100 Hz.
    fn rows(
        count: usize,
        sensed: impl Fn(f64, Vector3<f64>) -> Vector3<f64>,
        mut tracked: impl FnMut(Vector3<f64>) -> Vector3<f64>,
    ) -> Rows {
        let mut rows = Rows::new(0.01);
        rows.begin();
        for k in 0..count {
            let t = 0.03 * k as f64;
            let wave = Vector3::new((1.9 * t).sin(), (2.3 * t + 1.0).sin(), (3.1 * t + 2.0).sin());
            rows.push(t, sensed(t, wave).into(), tracked(wave).into());
        }
        rows
    }

    /// The sensor's third axis drifts by 0.02 a second.
    #[test]
    fn what_a_sensor_makes_of_the_true_vector_is_found_beside_bias_and_drift() {
        let own = Matrix3::new(1.1, 0.03, 0.0, -0.02, 0.9, 0.0, 0.0, 0.0, 1.0);
        let sensed = |t: f64, v: Vector3<f64>| own * v + Vector3::new(0.5, -0.3, 0.02 * t);
        let found = rows(400, sensed, |v| v).sensor_by_tracked().unwrap();
        assert!((found.matrix - own).norm() < 1e-9, "{}", found.matrix);
        for ((slope, _), expected) in found.drift.iter().zip([0.0, 0.0, 0.02]) {
            assert!((slope - expected).abs() < 1e-9, "{:?}", found.drift);
        }
        // Twelve seconds less one row: 3 in a hundred seconds.
        assert!((found.length_s - 11.97).abs() < 1e-9);
        assert!(rows(299, sensed, |v| v).sensor_by_tracked().is_none());
    }

    /// White noise of variance 1/12 on waves of variance 1/2 makes factors a seventh too small either way.
    #[test]
    fn noise_of_both_is_no_fault_of_scale_and_what_is_larger_is_so_either_way() {
        let seed = 5;
        println!("seed {seed}");
        let noise = std::cell::RefCell::new(rand_pcg::Pcg64Mcg::seed_from_u64(seed));
        let draw = |size: f64| Vector3::from_fn(|_, _| size * (noise.borrow_mut().random::<f64>() - 0.5));
        let noisy = rows(2000, |_, v| v + draw(1.0), |v| v + draw(1.0));
        let (one, either) = (noisy.sensor_by_tracked().unwrap(), noisy.sensor_either_way().unwrap());
        for axis in 0..3 {
            let by_tracked = one.matrix[(axis, axis)];
            // 2000 rows know it to a hundredth.
            assert!((by_tracked - 7.0 / 6.0).abs() < 0.03, "{by_tracked}");
            assert_eq!(either.matrix[(axis, axis)], 1.0);
        }
        let larger = rows(2000, |_, v| 1.2 * v + draw(0.1), |v| v + draw(0.1)).sensor_either_way().unwrap();
        assert!((larger.matrix - Matrix3::from_diagonal_element(1.2)).amax() < 0.01, "{}", larger.matrix);
    }

    /// Turned by 0.05 rad, out of square by 0.05, or both.
    #[test]
    fn a_turned_sensor_has_no_fault_and_a_crooked_one_where_both_axes_tell() {
        let faults = |ab: f64, ba: f64, tells| {
            let matrix = Matrix3::new(1.0, ab, 0.0, ba, 1.0, 0.0, 0.0, 0.0, 1.0);
            let error = Matrix3::from_element(0.001);
            Linear { matrix, error, drift: [(0.0, 1e-4); 3], further: Vec::new(), length_s: 40.0 }
                .faults(&SENSOR, tells)
        };
        assert_eq!(faults(0.05, -0.05, [true; 3]), [""; 0]);
        for (ab, ba) in [(0.05, 0.05), (0.1, 0.0)] {
            let found = faults(ab, ba, [true; 3]);
            assert_eq!(found.len(), 1, "{found:?}");
            let start = "the sensor's a and b are not at right angles: each measures 5.0";
            assert!(found[0].starts_with(start), "{found:?}");
            assert_eq!(faults(ab, ba, [true, false, true]), [""; 0]);
        }
    }

    /// 3 % of scale with an error of 0.5 % stands out and matters, with one of 1 % it could be chance; 1 % never matters.
    #[test]
    fn a_fault_has_to_matter_and_to_stand_out_from_its_error() {
        let faults = |scale: f64, error: f64, slope: f64| {
            let matrix = Matrix3::from_diagonal(&Vector3::new(1.0, scale, 1.0));
            let drift = [(0.0, 1e-5), (0.0, 1e-5), (slope, 1e-4)];
            let error = Matrix3::from_element(error);
            Linear { matrix, error, drift, further: Vec::new(), length_s: 40.0 }.faults(&SENSOR, [true; 3])
        };
        let found = faults(1.03, 0.005, 0.0);
        assert!(found.len() == 1 && found[0].starts_with("the sensor's b is 3.0"), "{found:?}");
        assert!(found[0].contains("larger than") && found[0].contains("scale = 0.971"), "{found:?}");
        assert_eq!((faults(1.03, 0.01, 0.0), faults(0.99, 1e-4, 0.0)), (Vec::new(), Vec::new()));
        // Over 40 s: 0.08, and 0.2 m/s^2 of 0.3 m/s^2 in a minute.
        assert_eq!(faults(1.0, 0.001, 0.002), [""; 0]);
        let drifts = faults(1.0, 0.001, -0.005);
        let start = "the bias of the sensor's c drifts by -0.30";
        assert!(drifts.len() == 1 && drifts[0].starts_with(start), "{drifts:?}");
    }
}
