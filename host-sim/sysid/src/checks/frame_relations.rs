//! What kinematics ask of a log, under a hypothesis of its attitude: the gyro is the rate of the
//! tracked attitude (relation 1), and the tracked point accelerates by gravity and a thrust along
//! the body's -z axis, less a drag along its velocity (relation 2).

use model::Vehicle;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::checks::frame_taps::Taps;
use crate::checks::tracks::{self, Axes, Lags, Match};
use crate::prepare::{Prepared, Stretch, vector};
use crate::statistics::{correlation, deviation, mean};

/// Correlation from which a relation in doubt is mended.
pub(super) const MENDED: f64 = 0.8;
/// Rates under this tell nothing, rad/s.
const EXCITED_RAD_S: f64 = 0.12;
/// Accelerations under this tell nothing, m/s^2.
const EXCITED_M_S2: f64 = 0.3;
/// Vertical accelerations under this tell nothing; the rotors explain them with less noise.
const EXCITED_VERTICAL_M_S2: f64 = 0.12;
/// Time from one row to the next, s.
pub(super) const ROW_PERIOD_S: f64 = 0.05;
/// Fewer rows than this tell nothing: two seconds.
pub(super) const LEAST_ROWS: usize = 40;

/// How a relation fares: the smallest correlation of its axes, nothing where no axis is excited.
pub(super) type Relation = Option<f64>;

pub(super) fn below(relation: Relation, limit: f64) -> bool {
    relation.is_some_and(|value| value < limit)
}

/// A flight under a hypothesis of its attitude.
pub(super) struct Seen {
    lags: Option<Lags>,
    rows: Vec<ForceRow>,
    gravity: f64,
    /// Rotor speeds vary enough to tell up from down.
    thrust_varies: bool,
}

/// What relation 2 needs at a row, all through one filter.
struct ForceRow {
    acceleration: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Body z in inertial axes.
    down: Vector3<f64>,
    /// `down` times the sum of the squares of the rotor speeds over its mean.
    pull: Vector3<f64>,
}

impl Seen {
    pub(super) fn new(flight: &Prepared, vehicle: &Vehicle, undo: fn(Vector3<f64>) -> Matrix3<f64>) -> Self {
        let attitude = |k: usize, stretch: &Stretch| undo(vector(&stretch.euler_rad, k));
        let pairs = tracks::rates(flight, attitude);
        let lags = (!pairs.is_empty()).then(|| Lags::new(&pairs, flight.period_s));
        let (rows, thrust_varies) = force_rows(flight, vehicle, &attitude);
        Self { lags, rows, gravity: vehicle.gravity, thrust_varies }
    }

    /// Relation 1 for each hypothesis of the gyro's axes.
    pub(super) fn rates(&self, hypotheses: &[Axes]) -> Vec<Relation> {
        let Some(lags) = &self.lags else { return vec![None; hypotheses.len()] };
        let one = |(axes, found): (&Axes, Match)| {
            let excited = |i: usize| lags.rms_onboard[i].max(lags.rms_tracked[axes.from[i]]) > EXCITED_RAD_S;
            let told = (0..3).filter(|&i| excited(i)).map(|i| found.correlation[i]);
            // Equal in size as well: degrees correlate with radians.
            told.min_by(f64::total_cmp).map(|worst| worst.min(found.similarity))
        };
        hypotheses.iter().zip(lags.best(hypotheses)).map(one).collect()
    }

    /// Relation 2 with the position's axes and unit mended.
    pub(super) fn force(&self, axes: Axes, scale: f64) -> Relation {
        if self.rows.len() < LEAST_ROWS {
            return None;
        }
        let mended = |v: Vector3<f64>| scale * axes.of(v);
        let measured: Vec<Vector3<f64>> = self.rows.iter().map(|r| mended(r.acceleration)).collect();
        // Unknown: thrust with the rotors, thrust besides, drag, and constants to the sides (wind,
        // a tilted tracker).
        let mut free = [true; 5];
        for _ in 0..3 {
            let columns = |r: &ForceRow| -> [Vector3<f64>; 5] {
                [-r.pull, -r.down, -mended(r.velocity), Vector3::x(), Vector3::y()]
            };
            let solution = self.solve(&measured, columns, free);
            // A thrust that falls with the rotors' speed, or a drag that drives, is no explanation.
            let wrong = [0, 2].into_iter().find(|&k| free[k] && solution[k] < 0.0);
            if let Some(k) = wrong {
                free[k] = false;
                continue;
            }
            let predicted: Vec<Vector3<f64>> = self
                .rows
                .iter()
                .map(|r| {
                    let sum: Vector3<f64> = columns(r).iter().zip(&solution).map(|(c, s)| *c * *s).sum();
                    sum + Vector3::new(0.0, 0.0, self.gravity)
                })
                .collect();
            let thrust = solution[0] + solution[1];
            return self.judged(thrust, &measured, &predicted);
        }
        Some(-1.0)
    }

    fn solve(
        &self,
        measured: &[Vector3<f64>],
        columns: impl Fn(&ForceRow) -> [Vector3<f64>; 5],
        free: [bool; 5],
    ) -> [f64; 5] {
        let (mut normal, mut right) = (DMatrix::<f64>::zeros(5, 5), DVector::<f64>::zeros(5));
        for (row, y) in self.rows.iter().zip(measured) {
            let c = columns(row);
            let y = y - Vector3::new(0.0, 0.0, self.gravity);
            for i in 0..5 {
                right[i] += c[i].dot(&y);
                for j in 0..5 {
                    normal[(i, j)] += c[i].dot(&c[j]);
                }
            }
        }
        let count = self.rows.len() as f64;
        for k in 0..5 {
            // Rotors that keep their speed cannot tell the two thrusts apart.
            normal[(k, k)] += 1e-4 * count;
            if !free[k] {
                normal[(k, k)] += 1e9 * count;
            }
        }
        let solution = normal.cholesky().map_or_else(|| DVector::zeros(5), |c| c.solve(&right));
        std::array::from_fn(|k| if free[k] { solution[k] } else { 0.0 })
    }

    fn judged(&self, thrust: f64, measured: &[Vector3<f64>], predicted: &[Vector3<f64>]) -> Relation {
        if !(0.3..3.0).contains(&(thrust / self.gravity)) {
            return Some(-1.0);
        }
        let told = (0..3).filter_map(|axis| {
            let of = |v: &[Vector3<f64>]| v.iter().map(|v| v[axis]).collect::<Vec<f64>>();
            let m = of(measured);
            if axis < 2 {
                return (deviation(&m) > EXCITED_M_S2).then(|| correlation(&m, &of(predicted)));
            }
            // Up and down the rotors themselves are asked: a fit would leave out a thrust of the
            // wrong sign. A sagging battery and the floor blur it, so that half of a correlation is
            // as good as all of it.
            let lift: Vec<f64> = self.rows.iter().map(|r| -r.pull.z).collect();
            let excited = self.thrust_varies && deviation(&m) > EXCITED_VERTICAL_M_S2;
            // Weak motion that the rotors do not explain is a draught or noise, strong motion is
            // not.
            let strong = deviation(&m) > EXCITED_M_S2;
            excited
                .then(|| (2.0 * correlation(&m, &lift)).clamp(-1.0, 1.0))
                .filter(|c| strong || c.abs() > MENDED)
        });
        told.min_by(f64::total_cmp)
    }
}

fn force_rows(
    flight: &Prepared,
    vehicle: &Vehicle,
    attitude: &impl Fn(usize, &Stretch) -> Matrix3<f64>,
) -> (Vec<ForceRow>, bool) {
    let taps = Taps::new(flight.period_s);
    let stride = ((ROW_PERIOD_S / flight.period_s).round() as usize).max(1);
    let squares: Vec<Vec<f64>> =
        flight.stretches.iter().map(|s| sum_of_squares(flight, s, vehicle)).collect();
    let all: Vec<f64> = squares.iter().flatten().copied().collect();
    let middle = mean(&all).max(1e-12);
    let mut rows = Vec::new();
    for (stretch, squares) in flight.stretches.iter().zip(&squares) {
        let count = stretch.time_s.len();
        if count <= 2 * taps.half() {
            continue;
        }
        let (mut down, mut pull): ([Vec<f64>; 3], [Vec<f64>; 3]) = Default::default();
        for (k, square) in squares.iter().enumerate() {
            let axis = attitude(k, stretch).row(2).transpose();
            for i in 0..3 {
                down[i].push(axis[i]);
                pull[i].push(axis[i] * square / middle);
            }
        }
        for k in (taps.half()..count - taps.half()).step_by(stride) {
            rows.push(ForceRow {
                acceleration: taps.at(&taps.second, &stretch.position_ned_m, k),
                velocity: taps.at(&taps.first, &stretch.position_ned_m, k),
                down: taps.at(&taps.smooth, &down, k),
                pull: taps.at(&taps.smooth, &pull, k),
            });
        }
    }
    (rows, deviation(&all) > 0.02 * middle)
}

/// Sum of the squares of the rotor speeds (or of what stands in for them).
fn sum_of_squares(flight: &Prepared, stretch: &Stretch, vehicle: &Vehicle) -> Vec<f64> {
    let rotors =
        stretch.rotors(vehicle, &model::Adjustments::default(), flight.period_s, flight.rotor_late_s());
    (0..stretch.time_s.len()).map(|k| rotors.iter().map(|r| r.speed_rad_s[k].powi(2)).sum()).collect()
}

#[cfg(test)]
mod tests {
    use model::frames;

    use super::*;
    use crate::testing::{NONE, fly, prepared, truth};

    /// Rows of a craft of 9.81 m/s^2 that tilts and pulls: 7 m/s^2 with its rotors, 2.81 besides, less 0.3 a second of drag,
    /// in a wind of 0.4 m/s^2 to the north and -0.2 to the east. The rotors as logged vary by `told` times what they do.
    fn tilting(count: usize, told: f64) -> Seen {
        let row = |k: usize| {
            let wave = |w: f64| (w * k as f64).sin();
            let down = Vector3::new(0.25 * wave(0.13), 0.2 * wave(0.17), 1.0).normalize();
            let velocity = Vector3::new(wave(0.11), wave(0.19), 0.5 * wave(0.07));
            let pull = |part: f64| down * (1.0 + 0.3 * part * wave(0.23));
            let push = Vector3::new(0.4, -0.2, 9.81);
            let acceleration = push - 7.0 * pull(1.0) - 2.81 * down - 0.3 * velocity;
            ForceRow { acceleration, velocity, down, pull: pull(told) }
        };
        Seen { lags: None, rows: (0..count).map(row).collect(), gravity: 9.81, thrust_varies: true }
    }

    #[test]
    fn thrust_drag_and_wind_are_told_apart() {
        let seen = tilting(400, 1.0);
        let measured: Vec<Vector3<f64>> = seen.rows.iter().map(|row| row.acceleration).collect();
        let columns = |r: &ForceRow| [-r.pull, -r.down, -r.velocity, Vector3::x(), Vector3::y()];
        let found = seen.solve(&measured, columns, [true; 5]);
        for (found, expected) in found.iter().zip([7.0, 2.81, 0.3, 0.4, -0.2]) {
            // What holds the two thrusts together is a thousandth of what tells them apart.
            assert!((found - expected).abs() < 0.02, "{found}, not {expected}");
        }
        let without_drag = seen.solve(&measured, columns, [true, true, false, true, true]);
        assert_eq!(without_drag[2], 0.0);
        assert!(seen.force(Axes::SAME, 1.0).is_some_and(|worst| worst > 0.999));
    }

    #[test]
    fn a_thrust_that_is_too_large_or_falls_with_the_rotors_is_no_explanation() {
        assert_eq!(tilting(400, 1.0).force(Axes::SAME, 1e3), Some(-1.0));
        let upside_down = Axes { from: [0, 1, 2], sign: [1.0, 1.0, -1.0] };
        let contradicted =
            [tilting(400, -1.0).force(Axes::SAME, 1.0), tilting(400, 1.0).force(upside_down, 1.0)];
        assert!(contradicted.iter().all(|relation| below(*relation, -0.9)), "{contradicted:?}");
        // Two seconds, and motion of more than millimetres.
        assert_eq!(tilting(LEAST_ROWS - 1, 1.0).force(Axes::SAME, 1.0), None);
        assert_eq!(tilting(400, 1.0).force(Axes::SAME, 1e-3), None);
        assert!(!below(None, 1.0));
    }

    /// Streams that differ by a factor k are alike by 2 k / (1 + k^2): 0.8 for double rates.
    #[test]
    fn rates_of_another_size_or_sign_are_not_those_of_the_attitude() {
        let seen = |factor: f64| {
            let flight = prepared(1200, |_, row| {
                row.wave();
                row.rate_rad_s = row.rate_rad_s.map(|rate| factor * rate);
            });
            Seen::new(&flight, &Vehicle::thesis(), frames::dcm_from_euler)
        };
        let mirrored = Axes { from: [0, 1, 2], sign: [-1.0; 3] };
        for (factor, expected) in [(1.0, 1.0), (2.0, 0.8), (0.5, 0.8)] {
            let found = seen(factor).rates(&[Axes::SAME, mirrored]);
            // The best of all shifts gains a little by what falls off the ends.
            assert!((found[0].unwrap() - expected).abs() < 5e-4, "{factor}: {found:?}");
            assert!(below(found[1], 0.0), "{factor}: {found:?}");
        }
        let still = Seen::new(&prepared(1200, |_, _| {}), &Vehicle::thesis(), frames::dcm_from_euler);
        assert_eq!(still.rates(&[Axes::SAME]), [None]);
    }

    /// A quarter of a turn to the right: north becomes east, east becomes south.
    #[test]
    fn turning_the_tracked_frame_about_the_vertical_changes_nothing() {
        let model = truth();
        let flight = Prepared::new(&fly(&model, 1, 12.0, &NONE), &model.vehicle).unwrap();
        let quarter = |euler: Vector3<f64>| {
            frames::dcm_from_euler(euler + Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2))
        };
        let right = Axes { from: [1, 0, 2], sign: [-1.0, 1.0, 1.0] };
        let seen = Seen::new(&flight, &model.vehicle, frames::dcm_from_euler);
        let turned = Seen::new(&flight, &model.vehicle, quarter);
        let (as_it_is, both) = (seen.force(Axes::SAME, 1.0).unwrap(), turned.force(right, 1.0).unwrap());
        assert!(as_it_is > 0.99 && (as_it_is - both).abs() < 1e-9, "{as_it_is} {both}");
        // One without the other contradicts itself.
        assert!(below(turned.force(Axes::SAME, 1.0), 0.5) && below(seen.force(right, 1.0), 0.5));
        let rates = [&seen, &turned].map(|seen| seen.rates(&[Axes::SAME])[0].unwrap());
        assert!((rates[0] - rates[1]).abs() < 1e-9, "{rates:?}");
    }
}
