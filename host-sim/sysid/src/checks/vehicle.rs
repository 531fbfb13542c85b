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
//! A vehicle whose map is identified has no rotor speed, so its thrust coefficient is not judged; in the moments of inertia, which are
//! that coefficient over those of the moments, commands cancel as speeds do.

use model::{Axis, Effect, Model, RotorQuantity, Vehicle};
use report::number::{fixed, significant, with_error};

use crate::checks::{Fault, FaultKind, Severity};
use crate::fit::inertia_ratios;
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
        "the rotors would overlap: is rotor_radius a diameter, or arm_length not measured from the centre to a motor?"
    } else if ratio < RADIUS.0 {
        "the rotors would be small: is arm_length the diagonal from motor to motor, or a length in another unit?"
    } else {
        return None;
    };
    Some(warning(
        FaultKind::ImplausibleVehicle,
        format!(
            "vehicle file: rotor_radius is {} times arm_length, while real craft have 0.4 to 0.65; {}",
            significant(ratio, 2),
            typical(vehicle).unwrap_or_else(|| suspicion.into())
        ),
    ))
}

/// What to do where a length is none of this craft's: nobody mistook a diameter for it.
fn typical(vehicle: &Vehicle) -> Option<String> {
    let is_typical = |field: &&str| vehicle.unmeasured.iter().any(|other| other == field);
    let typical: Vec<&str> = ["rotor_radius", "arm_length"].into_iter().filter(is_typical).collect();
    match typical[..] {
        [] => None,
        [one] => Some(format!("{one} is a typical value that has not been measured: measure it")),
        _ => Some(format!(
            "{} are typical values that have not been measured: measure them",
            typical.join(" and ")
        )),
    }
}

/// What of a vehicle file no one has measured yet.
pub fn unmeasured(vehicle: &Vehicle) -> Option<Fault> {
    if vehicle.unmeasured.is_empty() {
        return None;
    }
    Some(warning(
        FaultKind::UnmeasuredVehicle,
        format!(
            "vehicle file: {} not been measured; typical values are used: forces, loads and lengths of the model scale with them; \
             measure them and take them out of `unmeasured`",
            match &vehicle.unmeasured[..] {
                [one] => format!("{one} has"),
                [rest @ .., last] => format!("{} and {last} have", rest.join(", ")),
                [] => String::new(),
            }
        ),
    ))
}

/// Suspicions from a fitted model: mass, lengths and map against thrust and moments.
pub fn of_fit(model: &Model) -> Vec<Fault> {
    let mut faults: Vec<Fault> = undetermined(model).into_iter().collect();
    let Some(thrust) = model.term(Effect::Thrust).map(|term| term.coefficients[0].value) else {
        return faults;
    };
    let is_judged = model.rotor_quantity() == RotorQuantity::Speed;
    if is_judged && !(THRUST.0..=THRUST.1).contains(&thrust) {
        let hint = if thrust > THRUST.1 {
            "is mass in grams, rotor_radius too small, or the motor map in revolutions a minute or second?"
        } else {
            "is rotor_radius a diameter or in another unit, or mass too small?"
        };
        faults.push(warning(
            FaultKind::ImplausibleVehicle,
            format!(
                "vehicle file: mass, rotor_radius and rotor speeds together give a thrust coefficient of {}, while real \
                 propellers have 0.008 to 0.026; {hint}",
                significant(thrust, 3)
            ),
        ));
    }
    faults.extend(inertia(model));
    faults
}

/// Moments of inertia in roll and pitch that no craft has.
fn inertia(model: &Model) -> Option<Fault> {
    let [roll, pitch] = inertia_ratios(model)?;
    let plausible = |ratio: f64| (INERTIA.0..=INERTIA.1).contains(&ratio);
    (!plausible(roll) || !plausible(pitch)).then(|| {
        warning(
            FaultKind::ImplausibleVehicle,
            format!(
                "moments of inertia in roll and pitch come out as {} and {} times mass times arm_length squared, while real \
                 craft have 0.25 to 0.45: mass or arm_length (centre to motor, metres) is wrong, commands are late \
                 relative to the motion, or the model lacks a strong moment",
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
                names.push(format!(
                    "{} = {}",
                    c.name,
                    with_error(estimate.value, error, c.unit_for(model.rotor_quantity()))
                ));
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
        few("only one training flight, so nothing shows whether a finding repeats from flight to flight; give three, each \
             with another pattern"
            .into());
    }
    if validate.len() == 1 {
        few("only one validation flight: a finding may hold for that flight alone; give two or more".into());
    }
    let seconds: f64 = train.iter().map(|f| f.rows() as f64 * f.period_s).sum();
    if seconds < LEAST_TRAINING_S {
        few(format!(
            "only {} s of training flights: errors are large and drifts go unnoticed; give at least three flights \
             of 20 s",
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

/// Correlation of the vertical acceleration with what a model makes of the motors, under which a flight is upside down. Without motion of
/// its own, it is near zero.
const UPSIDE_DOWN: f64 = -0.4;

/// A flight that accelerates down where the model of all flights says that its motors push up: one log in other axes among others. What
/// kinematics alone say of it ([`crate::checks::frames`]) drowns in the noise of gentle flights.
pub fn upside_down(model: &Model, flight: &Prepared) -> Option<Fault> {
    let r = residuals(flight, model);
    let mut sums = Sums::default();
    let vertical = Axis::W.index();
    r.measured[vertical].iter().zip(&r.residual[vertical]).for_each(|(m, e)| sums.add(*m, m - e));
    let (_, correlation) = sums.about_means();
    (correlation < UPSIDE_DOWN).then(|| {
        let sentence = format!(
            "against the model, the craft accelerates down when its motors push up, and up when they push less (correlation {}): is z \
             upside down in this flight? It must point down",
            fixed(correlation, 2)
        );
        Fault { flight: Some(flight.name.clone()), ..warning(FaultKind::InconsistentFrames, sentence) }
    })
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
    // What a model says of an axis that it does not explain on other flights is no likeness to judge by.
    let explains = |axis: Axis| {
        model.fit.as_ref().is_none_or(|fit| fit.held_out[axis].samples == 0 || fit.held_out[axis].r2 > 0.0)
    };
    for (axis, name) in
        [(Axis::P, "roll"), (Axis::Q, "pitch")].into_iter().filter(|(axis, _)| explains(*axis))
    {
        let (slope, correlation) = sums[axis.index()].about_means();
        if correlation < -0.4 {
            found.push(format!("the motors {name} the craft in the opposite direction"));
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

#[cfg(test)]
mod tests {
    use flights::Column;
    use model::Estimate;

    use super::*;
    use crate::testing::{NONE, fly, prepared, truth};

    fn sentences(faults: &[Fault]) -> Vec<&str> {
        faults.iter().map(|fault| fault.sentence.as_str()).collect()
    }

    #[test]
    fn the_thesis_vehicle_and_its_model_are_above_suspicion() {
        assert_eq!(of_vehicle(&Vehicle::thesis()), None);
        assert_eq!(of_fit(&Model::thesis()), []);
    }

    #[test]
    fn a_diameter_for_a_radius_and_a_diagonal_for_an_arm_are_suspected() {
        let mut vehicle = Vehicle::thesis();
        vehicle.rotor_radius *= 2.0;
        assert_eq!(
            of_vehicle(&vehicle).unwrap().sentence,
            "vehicle file: rotor_radius is 1.2 times arm_length, while real craft have 0.4 to 0.65; the rotors would overlap: is rotor_radius a diameter, or arm_length not measured from the centre to a motor?"
        );
        let mut vehicle = Vehicle::thesis();
        vehicle.arm_length *= 2.0;
        assert_eq!(
            of_vehicle(&vehicle).unwrap().sentence,
            "vehicle file: rotor_radius is 0.30 times arm_length, while real craft have 0.4 to 0.65; the rotors would be small: is arm_length the diagonal from motor to motor, or a length in another unit?"
        );
    }

    #[test]
    fn a_length_that_nobody_measured_is_not_called_a_mistake() {
        let mut vehicle = Vehicle::thesis();
        vehicle.arm_length *= 2.0;
        vehicle.unmeasured = vec!["mass".into(), "rotor_radius".into()];
        let said = of_vehicle(&vehicle).unwrap().sentence;
        assert!(
            said.ends_with("0.65; rotor_radius is a typical value that has not been measured: measure it"),
            "{said}"
        );
    }

    #[test]
    fn a_thrust_coefficient_of_no_propeller_is_told_with_what_may_be_wrong() {
        let mut model = truth();
        model.set(Effect::Thrust, &[0.8]);
        let faults = of_fit(&model);
        assert!(
            sentences(&faults)[0].starts_with(
                "vehicle file: mass, rotor_radius and rotor speeds together give a thrust coefficient of \
                 0.800, while real propellers have 0.008 to 0.026; is mass in grams"
            ),
            "{faults:?}"
        );
        model.set(Effect::Thrust, &[0.001]);
        assert!(sentences(&of_fit(&model))[0].contains("is rotor_radius a diameter"));
        // Rotor "speeds" that are commands have no such coefficient, unless they were logged.
        model.vehicle.motors.map = Some(model::MotorMapKind::Identify);
        assert!(of_fit(&model).iter().all(|fault| fault.sentence.starts_with("moments of inertia")));
        model.reference.rotor_speeds_logged = true;
        assert!(!of_fit(&model).is_empty());
    }

    /// The moments of the thesis' craft are 0.44 of mass times arm squared.
    #[test]
    fn four_times_the_arm_makes_the_inertia_implausible() {
        let mut model = truth();
        assert_eq!(of_fit(&model), []);
        model.vehicle.arm_length *= 4.0;
        let faults = of_fit(&model);
        assert!(
            sentences(&faults)[0]
                .starts_with("moments of inertia in roll and pitch come out as 0.028 and 0.026"),
            "{faults:?}"
        );
    }

    #[test]
    fn a_motor_whose_error_is_as_large_as_itself_asks_for_another_flight() {
        let mut model = truth();
        let term = model.terms.iter_mut().find(|t| t.effect == Effect::RotorMoments).unwrap();
        let info = Effect::RotorMoments.info();
        let value = term.coefficients[0].value;
        let coefficient = |error: f64| Estimate { value, std_error: Some(error) };
        term.coefficients[0] = coefficient(0.9 * value.abs());
        assert_eq!(of_fit(&model), []);
        let term = model.terms.iter_mut().find(|t| t.effect == Effect::RotorMoments).unwrap();
        term.coefficients[0] = coefficient(2.0 * value.abs());
        let faults = of_fit(&model);
        assert_eq!(faults[0].kind, FaultKind::NotExcited);
        assert_eq!(
            faults[0].sentence,
            format!(
                "the flights do not determine {} = {}; fly more: {}",
                info.coefficients[0].name,
                with_error(value, 2.0 * value.abs(), info.coefficients[0].unit),
                info.excitation
            )
        );
    }

    #[test]
    fn few_and_short_flights_are_told_apart() {
        // 300 samples give 240 rows.
        let flight = prepared(300, |_, _| {});
        let faults = of_set(&[&flight], &[&flight]);
        assert_eq!(
            sentences(&faults),
            [
                "only one training flight, so nothing shows whether a finding repeats from flight to flight; give three, each with another pattern",
                "only one validation flight: a finding may hold for that flight alone; give two or more",
                "only 2.4 s of training flights: errors are large and drifts go unnoticed; give at least three flights of 20 s",
            ]
        );
        assert_eq!(of_set(&[&flight; 5], &[&flight; 2]), []);
        assert_eq!(of_set(&[&flight; 5], &[]), []);
    }

    #[test]
    fn a_flight_of_the_model_is_like_it_and_one_of_half_the_thrust_is_not() {
        let model = truth();
        let flight = Prepared::new(&fly(&model, 5, 12.0, &NONE), &model.vehicle).unwrap();
        assert_eq!(differences(&model, &[&flight], Likeness::SAME), [""; 0]);
        let mut stronger = model.clone();
        let thrust = model.term(Effect::Thrust).unwrap().coefficients[0].value;
        stronger.set(Effect::Thrust, &[2.0 * thrust]);
        assert_eq!(
            differences(&stronger, &[&flight], Likeness::CHANGED),
            ["the thrust is 50 % below the model's"]
        );
        let mut turned = model.clone();
        let mut moments = model.term(Effect::RotorMoments).unwrap().values();
        moments[4..8].iter_mut().for_each(|c| *c = -*c);
        moments[..4].iter_mut().for_each(|c| *c /= 4.0);
        turned.set(Effect::RotorMoments, &moments);
        let found = differences(&turned, &[&flight], Likeness::CHANGED);
        assert_eq!(found[1], "the motors pitch the craft in the opposite direction", "{found:?}");
        assert!(
            found[0].starts_with("the motors roll the craft ") && found[0].ends_with(" times as strongly")
        );
    }

    /// The motors of the flight as they were, and the other way about.
    #[test]
    fn a_flight_whose_z_is_turned_round_is_upside_down() {
        let model = truth();
        let mut flown = fly(&model, 5, 12.0, &NONE);
        let upright = Prepared::new(&flown, &model.vehicle).unwrap();
        assert_eq!(upside_down(&model, &upright), None);
        let up: Vec<f64> = flown.column(Column::Z).unwrap().iter().map(|z| -z).collect();
        flown.replace(Column::Z, up);
        let turned = Prepared::new(&flown, &model.vehicle).unwrap();
        let fault = upside_down(&model, &turned).unwrap();
        assert!(fault.flight.is_some() && fault.sentence.ends_with("It must point down"), "{fault:?}");
    }

    /// Measured 2 p + 7 for p = 0, 1, 2.
    #[test]
    fn the_slope_is_about_the_means() {
        let mut sums = Sums::default();
        (0..3).for_each(|p| sums.add(2.0 * f64::from(p) + 7.0, f64::from(p)));
        let (slope, correlation) = sums.about_means();
        assert!((slope - 2.0).abs() < 1e-12 && (correlation - 1.0).abs() < 1e-12);
        assert_eq!(Sums::default().about_means(), (0.0, 0.0));
    }
}
