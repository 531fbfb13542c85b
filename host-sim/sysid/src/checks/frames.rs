//! Frames and signs: do attitude, rates, position and acceleration describe one motion in the axes they claim?
//!
//! A log in other axes (front-left-up, east-north-up, a quaternion read in another order, a gyro mounted a quarter turn
//! round) fits no model, but a regression always returns something. Kinematics tell, without any model of the craft:
//!
//! 1. the gyro is the rate of the tracked attitude;
//! 2. the tracked point accelerates by gravity and by a thrust along the tracked -z axis of the body, less a drag along
//!    its velocity;
//! 3. the IMU's specific force is that acceleration less gravity, in body axes ([`crate::checks::imu`], once clocks agree).
//!
//! Every single fault of a list (24 rotations of an axis system and their mirror images, quaternions in other orders,
//! conjugated or swapped angles, the conventions of other programs, wrong units) is undone in turn. A fault is named only
//! where the log as it is clearly contradicts a relation and undoing that fault makes all of them hold; where nothing
//! mends a contradiction, that is said. Clocks may be off by up to a quarter of a second: each hypothesis gets the
//! best of all shifts.
//!
//! Deliberately absent: faults in two streams at once other than whole conventions, and small misalignments, which are
//! effects (`attitude-offset`).

use model::{Vehicle, frames};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use crate::checks::tracks::{self, Axes, Lags, Match};
use crate::filter::{RegressionFilter, compose, sum_of_products};
use crate::prepare::{Prepared, Stretch, vector};

/// Correlation under which a relation is in doubt, so that other axes are tried.
const IN_DOUBT: f64 = 0.6;
/// Correlation under which a relation is contradicted, whether something mends it or not.
const CONTRADICTED: f64 = 0.25;
/// Correlation from which a relation in doubt is mended, and how much more it has to be than before.
pub(crate) const MENDED: f64 = 0.8;
const MENDED_BY: f64 = 0.3;
/// How much better than a simpler fault a later one of the list has to be.
pub(crate) const BETTER_BY: f64 = 0.02;
/// Rates under this tell nothing, rad/s.
const EXCITED_RAD_S: f64 = 0.12;
/// Accelerations under this tell nothing, m/s^2.
const EXCITED_M_S2: f64 = 0.3;
/// The same for vertical ones, which the rotors explain with less noise.
const EXCITED_VERTICAL_M_S2: f64 = 0.12;
/// Window of the filters for accelerations, s: a tracker differentiated twice needs a long one.
const WINDOW_S: f64 = 0.7;
pub(crate) const ROW_PERIOD_S: f64 = 0.05;
/// Fewer rows than this tell nothing: two seconds.
pub(crate) const LEAST_ROWS: usize = 40;
/// What was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameFault {
    /// For people: what it looks like and how to mend it.
    pub sentence: String,
    /// Whether one fault explains it.
    pub named: bool,
}

/// How a relation fares: the smallest correlation of its axes, nothing where no axis is excited.
pub(crate) type Relation = Option<f64>;

pub(crate) fn below(relation: Relation, limit: f64) -> bool {
    relation.is_some_and(|value| value < limit)
}

/// Whether a relation that was `old` is right, or no worse than it was, when it is `new`.
fn is_mended(old: Relation, new: Relation) -> bool {
    match (old, new) {
        (Some(old), Some(new)) if old < IN_DOUBT => new >= MENDED.max(old + MENDED_BY),
        (Some(old), Some(new)) => new >= old - 0.1,
        (None, new) => new.is_none_or(|new| new >= IN_DOUBT),
        // What was excited is excited in any axes.
        (Some(_), None) => false,
    }
}

/// A way the attitude may have been written wrongly.
struct Attitude {
    /// What the log looks like.
    looks_like: &'static str,
    mend: &'static str,
    /// From the logged angles to the body's attitude (inertial to body).
    undo: fn(Vector3<f64>) -> Matrix3<f64>,
}

const FLIP_YZ: Matrix3<f64> = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
/// From east-north-up to north-east-down and back.
const ENU: Matrix3<f64> = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);

fn as_logged(euler: Vector3<f64>) -> Matrix3<f64> {
    frames::dcm_from_euler(euler)
}

fn signed(euler: Vector3<f64>, signs: [f64; 3]) -> Matrix3<f64> {
    frames::dcm_from_euler(euler.component_mul(&Vector3::from(signs)))
}

/// From a quaternion whose entries were taken in another order.
fn reordered(euler: Vector3<f64>, order: [usize; 4]) -> Matrix3<f64> {
    let q = frames::quaternion_from_euler(euler);
    frames::dcm_from_quaternion(&nalgebra::Vector4::from(order.map(|k| q[k])))
}

const ATTITUDES: [Attitude; 17] = [
    Attitude {
        looks_like: "phi and theta are exchanged",
        mend: "exchange the columns",
        undo: |e| frames::dcm_from_euler(Vector3::new(e.y, e.x, e.z)),
    },
    Attitude {
        looks_like: "theta has the wrong sign (as in logs of the Crazyflie firmware)",
        mend: "write -theta",
        undo: |e| signed(e, [1.0, -1.0, 1.0]),
    },
    Attitude {
        looks_like: "phi has the wrong sign",
        mend: "write -phi",
        undo: |e| signed(e, [-1.0, 1.0, 1.0]),
    },
    Attitude {
        looks_like: "psi has the wrong sign",
        mend: "write -psi",
        undo: |e| signed(e, [1.0, 1.0, -1.0]),
    },
    Attitude {
        looks_like: "theta and psi are those of a body front-left-up in a frame north-west-up",
        mend: "write -theta and -psi",
        undo: |e| signed(e, [1.0, -1.0, -1.0]),
    },
    Attitude {
        looks_like: "phi and theta have the wrong sign",
        mend: "write -phi and -theta",
        undo: |e| signed(e, [-1.0, -1.0, 1.0]),
    },
    Attitude {
        looks_like: "phi and psi have the wrong sign",
        mend: "write -phi and -psi",
        undo: |e| signed(e, [-1.0, 1.0, -1.0]),
    },
    Attitude {
        looks_like: "the attitude is that from the inertial to the body frame (a conjugated quaternion, a transposed matrix)",
        mend: "conjugate the quaternion (or transpose the matrix) before taking angles from it",
        undo: |e| frames::dcm_from_euler(e).transpose(),
    },
    Attitude {
        looks_like: "the attitude is from a quaternion x, y, z, w that was read as w, x, y, z",
        mend: "put its last entry first before taking angles from it",
        undo: |e| reordered(e, [3, 0, 1, 2]),
    },
    Attitude {
        looks_like: "the attitude is from a quaternion w, x, y, z that was read as x, y, z, w",
        mend: "put its first entry last before taking angles from it",
        undo: |e| reordered(e, [1, 2, 3, 0]),
    },
    Attitude {
        looks_like: "the attitude is from a quaternion x, y, z, w that was read as w, x, y, z and conjugated",
        mend: "put its last entry first and conjugate it before taking angles from it",
        undo: |e| reordered(e, [3, 0, 1, 2]).transpose(),
    },
    Attitude {
        looks_like: "the attitude is from a conjugated quaternion w, x, y, z that was read as x, y, z, w",
        mend: "put its first entry last and conjugate it before taking angles from it",
        undo: |e| reordered(e, [1, 2, 3, 0]).transpose(),
    },
    Attitude {
        looks_like: "the attitude is that of a body front-left-up in a frame east-north-up",
        mend: "write phi, -theta and pi/2 - psi",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e) * ENU,
    },
    Attitude {
        looks_like: "the attitude is that of a body front-left-up (it is upside down)",
        mend: "turn it by half a turn about x: write phi + pi",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e),
    },
    Attitude {
        looks_like: "the attitude is given in a frame north-west-up",
        mend: "turn the frame by half a turn about x",
        undo: |e| frames::dcm_from_euler(e) * FLIP_YZ,
    },
    Attitude {
        looks_like: "phi, theta and psi are in degrees",
        mend: "multiply by pi/180",
        undo: |e| frames::dcm_from_euler(e.map(f64::to_radians)),
    },
    Attitude {
        looks_like: "psi is in degrees",
        mend: "multiply by pi/180",
        undo: |e| frames::dcm_from_euler(Vector3::new(e.x, e.y, e.z.to_radians())),
    },
];

/// Conventions in which several streams are wrong together: attitude, axes of the position, axes of the gyro.
struct Convention {
    looks_like: &'static str,
    mend: &'static str,
    undo: fn(Vector3<f64>) -> Matrix3<f64>,
    position: Axes,
    gyro: Axes,
}

const FLIPPED_YZ: Axes = Axes { from: [0, 1, 2], sign: [1.0, -1.0, -1.0] };
const FROM_ENU: Axes = Axes { from: [1, 0, 2], sign: [1.0, 1.0, -1.0] };

const CONVENTIONS: [Convention; 5] = [
    Convention {
        looks_like: "the whole log is in the frames north-west-up and front-left-up",
        mend: "write -y, -z, -theta, -psi, -q, -r (and -ay, -az, -vy, -vz)",
        undo: |e| signed(e, [1.0, -1.0, -1.0]),
        position: FLIPPED_YZ,
        gyro: FLIPPED_YZ,
    },
    Convention {
        looks_like: "the whole log is in the frames east-north-up and front-left-up (as ROS has it)",
        mend: "write y, x, -z for x, y, z; -theta and pi/2 - psi; -q, -r (and vy, vx, -vz; -ay, -az)",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e) * ENU,
        position: FROM_ENU,
        gyro: FLIPPED_YZ,
    },
    Convention {
        looks_like: "the tracker is in the frames north-west-up and front-left-up",
        mend: "write -y, -z, -theta, -psi (and -vy, -vz)",
        undo: |e| signed(e, [1.0, -1.0, -1.0]),
        position: FLIPPED_YZ,
        gyro: Axes::SAME,
    },
    Convention {
        looks_like: "the tracker is in the frames east-north-up and front-left-up (as ROS has it)",
        mend: "write y, x, -z for x, y, z; -theta and pi/2 - psi (and vy, vx, -vz)",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e) * ENU,
        position: FROM_ENU,
        gyro: Axes::SAME,
    },
    Convention {
        looks_like: "the body's axes are front-left-up in attitude and gyro",
        mend: "turn the attitude by half a turn about x and write -q, -r (and -ay, -az)",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e),
        position: Axes::SAME,
        gyro: FLIPPED_YZ,
    },
];

/// Checks relations 1 and 2.
pub fn check(flight: &Prepared, vehicle: &Vehicle) -> Option<FrameFault> {
    let as_is = Seen::new(flight, vehicle, as_logged);
    let rates = as_is.rates(&[Axes::SAME])[0];
    let force = as_is.force(Axes::SAME, 1.0);
    if !below(rates, IN_DOUBT) && !below(force, IN_DOUBT) {
        return None;
    }
    let mut best: Option<(f64, String)> = None;
    let mut consider = |new_rates: Relation, new_force: Relation, sentence: &dyn Fn() -> String| {
        let score = new_rates.unwrap_or(0.0) + new_force.unwrap_or(0.0);
        let better = best.as_ref().is_none_or(|(s, _)| score > s + BETTER_BY);
        if better && is_mended(rates, new_rates) && is_mended(force, new_force) {
            best = Some((score, sentence()));
        }
    };
    let axes = Axes::all();
    for (axes, new) in axes.iter().zip(as_is.rates(&axes)).skip(1) {
        consider(new, force, &|| gyro_sentence(*axes));
    }
    for hypothesis in &ATTITUDES {
        let seen = Seen::new(flight, vehicle, hypothesis.undo);
        consider(seen.rates(&[Axes::SAME])[0], seen.force(Axes::SAME, 1.0), &|| {
            format!("{}: {}", hypothesis.looks_like, hypothesis.mend)
        });
    }
    // Before mirrored positions: a log that is upside down in all streams looks the same as a position mirrored in all axes.
    for c in &CONVENTIONS {
        let seen = Seen::new(flight, vehicle, c.undo);
        consider(seen.rates(&[c.gyro])[0], seen.force(c.position, 1.0), &|| {
            format!("{}: {}", c.looks_like, c.mend)
        });
    }
    for axes in axes.iter().skip(1) {
        consider(rates, as_is.force(*axes, 1.0), &|| position_sentence(*axes));
    }
    for (unit, scale) in [("millimetres", 1e-3), ("centimetres", 1e-2)] {
        consider(rates, as_is.force(Axes::SAME, scale), &|| {
            format!("x, y, z look like {unit}: multiply by {scale}")
        });
    }
    match best {
        Some((_, sentence)) => Some(FrameFault { sentence, named: true }),
        None if below(rates, CONTRADICTED) || below(force, CONTRADICTED) => {
            Some(FrameFault { sentence: unnamed(rates, force), named: false })
        }
        None => None,
    }
}

fn unnamed(rates: Relation, force: Relation) -> String {
    let which = match (below(rates, CONTRADICTED), below(force, CONTRADICTED)) {
        (true, true) => {
            "the rates are not those of the attitude, and the acceleration is not along its thrust axis"
        }
        (true, false) => "the gyro does not show the rates of the attitude",
        _ => "the acceleration of the position is not along the thrust axis of the attitude",
    };
    format!(
        "attitude, rates and acceleration do not fit together ({which}), and no single wrong axis, sign or unit explains it: \
         check how the log was converted"
    )
}

fn gyro_sentence(axes: Axes) -> String {
    let names = ["p", "q", "r"];
    format!(
        "p, q, r look like {} of this craft's attitude: write {} into p, q, r",
        axes.named(names),
        axes.inverse().named(names)
    )
}

/// `axes` undoes the fault.
fn position_sentence(axes: Axes) -> String {
    let names = ["x", "y", "z"];
    let (is, mend) = (axes.inverse().named(names), axes.named(names));
    let up = if axes == (Axes { from: [0, 1, 2], sign: [1.0, 1.0, -1.0] }) { " (z points up)" } else { "" };
    format!("x, y, z look like {is} of the frame of the attitude{up}: write {mend} into x, y, z")
}

/// A flight under a hypothesis of its attitude.
struct Seen {
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
    /// The same times the sum of the squares of the rotor speeds over its mean.
    pull: Vector3<f64>,
}

impl Seen {
    fn new(flight: &Prepared, vehicle: &Vehicle, undo: fn(Vector3<f64>) -> Matrix3<f64>) -> Self {
        let attitude = |k: usize, stretch: &Stretch| undo(vector(&stretch.euler_rad, k));
        let pairs = tracks::rates(flight, attitude);
        let lags = (!pairs.is_empty()).then(|| Lags::new(&pairs, flight.period_s));
        let (rows, thrust_varies) = force_rows(flight, vehicle, &attitude);
        Self { lags, rows, gravity: vehicle.gravity, thrust_varies }
    }

    /// Relation 1 for each hypothesis of the gyro's axes.
    fn rates(&self, hypotheses: &[Axes]) -> Vec<Relation> {
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
    fn force(&self, axes: Axes, scale: f64) -> Relation {
        if self.rows.len() < LEAST_ROWS {
            return None;
        }
        let mended = |v: Vector3<f64>| scale * axes.of(v);
        let measured: Vec<Vector3<f64>> = self.rows.iter().map(|r| mended(r.acceleration)).collect();
        // Unknown: thrust with the rotors, thrust besides, drag, and constants to the sides (wind, a tilted tracker).
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
            // Up and down the rotors themselves are asked: a fit would leave out a thrust of the wrong sign. A sagging
            // battery and the floor blur it, so that half of a correlation is as good as all of it.
            let lift: Vec<f64> = self.rows.iter().map(|r| -r.pull.z).collect();
            let excited = self.thrust_varies && deviation(&m) > EXCITED_VERTICAL_M_S2;
            // Weak motion that the rotors do not explain is a draught or noise, strong motion is not.
            let strong = deviation(&m) > EXCITED_M_S2;
            excited
                .then(|| (2.0 * correlation(&m, &lift)).clamp(-1.0, 1.0))
                .filter(|c| strong || c.abs() > MENDED)
        });
        told.min_by(f64::total_cmp)
    }
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

pub(crate) fn deviation(values: &[f64]) -> f64 {
    let middle = mean(values);
    mean(&values.iter().map(|v| (v - middle).powi(2)).collect::<Vec<_>>()).sqrt()
}

pub(crate) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let product = a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>() / a.len().max(1) as f64;
    product / (deviation(a) * deviation(b)).max(1e-12)
}

/// Filters for the second derivative, for the first through the same window, and for what is as it is.
pub(crate) struct Taps {
    pub(crate) second: Vec<f64>,
    first: Vec<f64>,
    pub(crate) smooth: Vec<f64>,
}

impl Taps {
    pub(crate) fn new(period_s: f64) -> Self {
        let filter = RegressionFilter::with_window(period_s, WINDOW_S);
        Self {
            second: compose(&filter.derivative, &filter.derivative),
            first: compose(&filter.derivative, &filter.matched),
            smooth: compose(&filter.matched, &filter.matched),
        }
    }

    pub(crate) fn half(&self) -> usize {
        self.second.len() / 2
    }

    pub(crate) fn at(&self, taps: &[f64], signal: &[Vec<f64>; 3], k: usize) -> Vector3<f64> {
        Vector3::from(signal.each_ref().map(|s| sum_of_products(&s[k - self.half()..], taps)))
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
