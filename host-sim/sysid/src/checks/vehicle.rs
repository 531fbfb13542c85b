//! Does what was fitted belong to a craft that can exist, and to the craft that it is said to be?
//!
//! **Typical numbers** (the ranges below are wider by a factor of two or more):
//! - Thrust coefficient, thrust over rho A (w R)^2: 0.018 for the thesis' F330; 0.026 for the Crazyflie 2 (2.9e-8 N s^2 a rotor of
//!   23 mm) and 0.022 for the AscTec Hummingbird (8.5e-6 N s^2, 0.1 m), as gym-pybullet-drones and RotorS have them. Static
//!   tests of small propellers give a thrust over rho n^2 D^4 of 0.06 to 0.15, which is 0.008 to 0.02 here.
//! - Moment of inertia in roll and pitch over mass times arm squared. All mass in the motors gives 0.5. F330: 0.44; Crazyflie 2:
//!   0.25 to 0.42 (1.4e-5 kg m^2 there, 2.4e-5 in Landry 2015); Hummingbird: 0.34; Iris: 0.36 (RotorS).
//! - Rotor radius over arm: 0.61, 0.50, 0.59 and 0.39 for these; rotors that do not overlap have at most 0.707.
//!
//! A vehicle whose map is identified has no rotor speed, so neither coefficient is judged.

use model::{Axis, Effect, Model, Vehicle};
use report::number::{fixed, significant, with_error};

use crate::checks::{Fault, FaultKind, Severity};
use crate::fit::linearise::residuals;
use crate::prepare::Prepared;

/// Plausible thrust coefficients.
const THRUST: (f64, f64) = (0.003, 0.06);
/// Plausible moments of inertia over mass times arm squared.
const INERTIA: (f64, f64) = (0.06, 1.0);
/// Plausible rotor radii over the arm.
const RADIUS: (f64, f64) = (0.35, 0.75);
/// Time to fit on under which everything is uncertain, s.
const LEAST_TRAINING_S: f64 = 10.0;
/// Standard error over the coefficient's ordinary size from which it is not determined.
const UNDETERMINED: f64 = 0.5;

/// Suspicions about a vehicle file by itself.
pub fn of_vehicle(vehicle: &Vehicle) -> Option<Fault> {
    let ratio = vehicle.rotor_radius / vehicle.arm_length;
    let suspicion = if ratio > RADIUS.1 {
        "rotors would overlap: is rotor_radius a diameter, or arm_length not that from the centre to a motor?"
    } else if ratio < RADIUS.0 {
        "rotors would be small: is arm_length the diagonal from motor to motor, or a length in another unit?"
    } else {
        return None;
    };
    Some(warning(
        FaultKind::ImplausibleVehicle,
        format!(
            "vehicle file: rotor_radius is {} of arm_length, craft have 0.4 to 0.65; {suspicion}",
            significant(ratio, 2)
        ),
    ))
}

/// Suspicions from a fitted model: mass, lengths and map against thrust and moments.
pub fn of_fit(model: &Model, rotor_speeds_logged: bool) -> Vec<Fault> {
    let mut faults: Vec<Fault> = undetermined(model).into_iter().collect();
    if !(model.vehicle.has_rotor_map() || rotor_speeds_logged) {
        return faults;
    }
    let values = |effect| -> Vec<f64> {
        model.term(effect).map_or_else(Vec::new, |t| t.coefficients.iter().map(|c| c.value).collect())
    };
    let Some(&thrust) = values(Effect::Thrust).first() else { return faults };
    if !(THRUST.0..=THRUST.1).contains(&thrust) {
        let hint = if thrust > THRUST.1 {
            "is mass in grams, rotor_radius too small, or the motor map in revolutions a minute or second?"
        } else {
            "is rotor_radius a diameter or in another unit, or mass too small?"
        };
        faults.push(warning(
            FaultKind::ImplausibleVehicle,
            format!(
                "vehicle file: mass, rotor_radius and rotor speeds together give a thrust coefficient of {}, propellers have \
                 0.008 to 0.026; {hint}",
                significant(thrust, 3)
            ),
        ));
    }
    faults.extend(inertia(model, thrust, &values(Effect::RotorMoments)));
    faults
}

/// Moments of inertia in roll and pitch that no craft has.
fn inertia(model: &Model, thrust: f64, moments: &[f64]) -> Option<Fault> {
    let scale = model.vehicle.mass * model.vehicle.arm_length.powi(2);
    let of = |range: std::ops::Range<usize>| {
        let some = moments.get(range)?;
        // C_i of (2.7) is C_T / (2 I): the thesis' arm is sqrt(2) l, geometry's l / sqrt(2).
        Some(0.5 * thrust * some.len() as f64 / some.iter().sum::<f64>() / scale)
    };
    let (roll, pitch) = (of(0..4)?, of(4..8)?);
    let plausible = |ratio: f64| (INERTIA.0..=INERTIA.1).contains(&ratio);
    (!plausible(roll) || !plausible(pitch)).then(|| {
        warning(
            FaultKind::ImplausibleVehicle,
            format!(
                "moments of inertia in roll and pitch come out as {} and {} of mass times arm_length squared, craft have \
                 0.25 to 0.45: mass or arm_length (centre to motor, metres) is wrong, commands come late against the \
                 motion, or a strong moment is not in the model",
                significant(roll, 2),
                significant(pitch, 2)
            ),
        )
    })
}

fn warning(kind: FaultKind, sentence: String) -> Fault {
    Fault::of_all(kind, Severity::Warning, sentence)
}

/// Drag and rotor moments whose standard error is as large as themselves.
fn undetermined(model: &Model) -> Option<Fault> {
    let mut names: Vec<String> = Vec::new();
    let mut fly: Vec<&str> = Vec::new();
    for term in model.terms.iter().filter(|t| t.effect.info().special.must_be_determined) {
        let info = term.effect.info();
        let ordinary = term.coefficients.iter().map(|e| e.value.abs()).fold(0.0, f64::max);
        for (estimate, c) in term.coefficients.iter().zip(info.coefficients) {
            let Some(error) = estimate.std_error else { continue };
            // A drag next to zero with a small error is determined.
            let small = if model.vehicle.has_rotor_map() { c.typical.min(ordinary) } else { ordinary };
            if error > estimate.value.abs() && error > UNDETERMINED * small {
                names.push(format!("{} = {}", c.name, with_error(estimate.value, error, c.unit)));
                if !fly.contains(&info.excitation) {
                    fly.push(info.excitation);
                }
            }
        }
    }
    (!names.is_empty()).then(|| {
        let list = names.join(", ");
        warning(
            FaultKind::NotExcited,
            format!("the flights do not determine {list}; fly more: {}", fly.join("; ")),
        )
    })
}

/// Too few flights, or too short ones.
pub fn of_set(train: &[&Prepared], validate: &[&Prepared]) -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut few = |sentence: String| faults.push(warning(FaultKind::TooFewFlights, sentence));
    if train.len() == 1 {
        few("only one flight to fit on: whether a finding repeats from flight to flight cannot be judged; give three, each \
             another pattern"
            .into());
    }
    if validate.len() == 1 {
        few("only one flight to judge by: a finding may belong to that flight alone; give two or more".into());
    }
    let seconds: f64 = train.iter().map(|f| f.rows() as f64 * f.period_s).sum();
    if seconds < LEAST_TRAINING_S {
        few(format!(
            "only {} s to fit on: errors are large and drifts unseen; give at least three flights of 20 s",
            fixed(seconds, 1)
        ));
    }
    faults
}

/// How far flights may be from a model before they are said to be another craft's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likeness {
    /// Ratio of thrusts, either way.
    thrust: f64,
    /// Ratio of angular accelerations, either way.
    moment: f64,
}

impl Likeness {
    /// The same craft, as it was.
    pub const SAME: Self = Self { thrust: 1.25, moment: 2.0 };
    /// The same craft after a change that a pilot would try to fly: half as heavy again, a motor weaker.
    pub const CHANGED: Self = Self { thrust: 1.6, moment: 3.0 };
}

/// What sets flights apart from a model: thrust at hover, size and sign of the moments.
pub fn differences(model: &Model, flights: &[&Prepared], likeness: Likeness) -> Vec<String> {
    let mut sums = [Sums::default(); 6];
    for flight in flights {
        let r = residuals(flight, model);
        for axis in [Axis::W, Axis::P, Axis::Q].map(Axis::index) {
            for (m, e) in r.measured[axis].iter().zip(&r.residual[axis]) {
                sums[axis].add(*m, m - e);
            }
        }
    }
    let mut found = Vec::new();
    let thrust = &sums[Axis::W.index()];
    let ratio = thrust.product / thrust.predicted.max(f64::MIN_POSITIVE);
    if !(1.0 / likeness.thrust..=likeness.thrust).contains(&ratio) {
        let way = if ratio > 1.0 { "above" } else { "below" };
        found.push(format!("the thrust is {} % {way} the model's", fixed(100.0 * (ratio - 1.0).abs(), 0)));
    }
    for (axis, name) in [(Axis::P, "roll"), (Axis::Q, "pitch")] {
        let (slope, correlation) = sums[axis.index()].about_means();
        if correlation < -0.4 {
            found.push(format!("the motors {name} the craft the other way round"));
        } else if correlation > 0.6 && !(1.0 / likeness.moment..=likeness.moment).contains(&slope) {
            found.push(format!("the motors {name} the craft {} times as strongly", fixed(slope, 1)));
        }
    }
    found
}

/// Products of measured and predicted accelerations.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    mean_measured: f64,
    mean_predicted: f64,
    product: f64,
    measured: f64,
    predicted: f64,
}

impl Sums {
    fn add(&mut self, measured: f64, predicted: f64) {
        self.count += 1.0;
        self.mean_measured += measured;
        self.mean_predicted += predicted;
        self.product += measured * predicted;
        self.measured += measured * measured;
        self.predicted += predicted * predicted;
    }

    /// Slope of measured over predicted, and correlation.
    fn about_means(&self) -> (f64, f64) {
        let n = self.count.max(1.0);
        let product = self.product - self.mean_measured * self.mean_predicted / n;
        let predicted = self.predicted - self.mean_predicted.powi(2) / n;
        let measured = self.measured - self.mean_measured.powi(2) / n;
        let floor = f64::MIN_POSITIVE;
        (product / predicted.max(floor), product / (predicted * measured).sqrt().max(floor))
    }
}
