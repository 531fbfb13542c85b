//! Do the four rotors give the same thrust, and is the centre of mass in their middle?
//!
//! The basic model has a coefficient for each rotor in roll and in pitch (2.7). So it takes in a weak motor or a shifted centre of mass,
//! and nothing is missing from it. But the coefficients say which it is. On an X frame, rotor `i` at `(x_i, y_i)` = `(+-d, +-d)` with
//! `d = l / sqrt(2)`, whose thrust is `1 + k_i` times the mean of the four, has
//!
//! `C_i^p = a_p (1 + k_i) |y_i - y_c| / d`, `C_i^q = a_q (1 + k_i) |x_i - x_c| / d`
//!
//! To first order, their logarithms are linear in the seven unknowns `ln a_p`, `ln a_q`, `k_1` to `k_3`, `x_c / d` and `y_c / d`. They are
//! fitted to the eight coefficients by generalised least squares. The equation that is left over says whether roll and pitch agree; where
//! they do not, the standard errors grow by the factor of their disagreement (Birge 1932), and as that is known from one equation alone,
//! only what is far larger is told. The coefficients of yaw are not asked: how reaction torque falls with thrust depends on what is wrong with
//! the rotor. But where it falls as the thrust does, rotors of unequal thrust turn at unequal speeds to keep the craft from yawing. Where they
//! turn as if all were alike, steady flight speaks against the coefficients, and again only what is far larger is told.
//!
//! Coefficients may follow how a flight was flown. So the same is asked of each flight by itself, and a standard error is no smaller than
//! that of the mean of the flights.

use model::{Effect, Estimate, Model, THRUST_DIFFERENCES, thrust_shares};
use nalgebra::{DMatrix, SMatrix, SVector};
use report::number::significant;
use schemars::JsonSchema;
use serde::Serialize;

use crate::fit::balance::mean_rotor_squared;
use crate::fit::closed_loop::{MotorsOfFlights, motors_of_flights};
use crate::fit::doubts::turns_too_weakly;
use crate::prepare::Prepared;
use crate::statistics::deviation;

/// Smallest difference that is told, as a share of the thrust or of the lever. Rotors from one bag differ by one percent.
const LEAST: f64 = 0.02;
/// Least difference in standard errors. Six differences are looked at, in each model that is fitted.
const DEVIATIONS: f64 = 4.0;
/// Square of the disagreement of roll and pitch, in standard errors, from which on they do disagree: once in a hundred times by chance.
const DISAGREE: f64 = 6.63;
/// Least difference in standard errors where they do, or where steady flight speaks against it: it is ten times what they disagree by.
const DEVIATIONS_IN_DISAGREEMENT: f64 = 10.0;
/// Steady flight speaks against differences by which yaw is out of balance by more than without them: by this part of what they change there.
const WORSE_IN_YAW: f64 = 0.5;
/// Change of the balance in yaw, as a share of the thrust, that says nothing: motors are no straighter on their arms.
const UNCHANGED_IN_YAW: f64 = 0.005;
/// Coefficients nearer to zero than this many standard errors have no logarithm to speak of.
const FIRM: f64 = 4.0;
/// By how much the other three may differ among each other beside one that differs from them, as a share of its difference.
const ALIKE: f64 = 0.25;
/// Fewest flights that show how coefficients scatter between flights.
const FEWEST_FLIGHTS: usize = 2;

/// Coefficients of roll and pitch.
const KNOWN: usize = 8;
/// Levels of roll and pitch, thrust of rotors 1 to 3, centre of mass forward and to the right.
const UNKNOWN: usize = 7;
/// Thrust of rotors 1 to 4, centre of mass forward and to the right.
const ANSWERS: usize = 6;
/// Where rotors 1 to 4 stand, forward and to the right of the middle, in levers.
const FORWARD: [f64; 4] = [1.0, 1.0, -1.0, -1.0];
const RIGHT: [f64; 4] = [-1.0, 1.0, 1.0, -1.0];

/// The thrust of a motor against others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct MotorThrust {
    /// 1 to 4.
    pub motor: usize,
    /// Thrust above theirs, percent; negative where it is weaker.
    pub thrust_percent: f64,
    /// Standard error, percent.
    pub std_error_percent: f64,
}

/// A place on the body, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct CenterOfMass {
    /// In front of the middle of the rotors; negative behind it.
    pub forward_m: f64,
    /// Standard error.
    pub forward_std_error_m: f64,
    /// To the right of it; negative to the left.
    pub right_m: f64,
    /// Standard error.
    pub right_std_error_m: f64,
    /// Whether that is more than errors and small differences explain.
    pub off_center: bool,
}

/// What is the same for motors that are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AtSame {
    /// The speeds of their rotors, which are logged: what differs is the thrust.
    Speed,
    /// Their commands: what differs may be the thrust or the speed.
    Command,
}

impl AtSame {
    fn of(model: &Model) -> Self {
        if model.reference.rotor_speeds_logged { Self::Speed } else { Self::Command }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Command => "command",
        }
    }
}

/// The rotors of a model against each other.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RotorComparison {
    /// `speed` if rotor speeds are logged, else `command`.
    pub at_same: AtSame,
    /// Each motor against the mean of the four.
    pub motors: [MotorThrust; 4],
    /// Whether any of them differs from the others by more than errors and small differences explain.
    pub differ: bool,
    /// The one motor that differs, against the mean of the other three; nothing where all are alike or more than one differs.
    pub different_motor: Option<MotorThrust>,
    /// Where the centre of mass is, if no constant moment acts on the craft.
    pub center_of_mass: CenterOfMass,
}

impl RotorComparison {
    /// What differs, in sentences; none where nothing does.
    pub fn sentences(&self) -> Vec<String> {
        let one = self.different_motor.map(|one| one.sentence(self.at_same));
        let motors = one.or_else(|| self.differ.then(|| self.thrusts()));
        motors.into_iter().chain(self.center_of_mass.sentence()).collect()
    }

    fn thrusts(&self) -> String {
        let thrusts = self.motors.map(|one| format!("{:+.1}", one.thrust_percent)).join(", ");
        let error = self.motors.iter().map(|one| one.std_error_percent).fold(0.0, f64::max);
        let same = self.at_same.name();
        format!(
            "The motors differ in thrust: at the same {same}, motors 1 to 4 give {thrusts} % relative to their mean (standard error of the fit up to {} %).",
            significant(error, 1)
        )
    }
}

impl MotorThrust {
    /// Of the one that differs from the other three.
    fn sentence(&self, at_same: AtSame) -> String {
        let Self { motor, thrust_percent, std_error_percent } = self;
        let (less, error) =
            (if *thrust_percent < 0.0 { "less" } else { "more" }, significant(*std_error_percent, 1));
        let (size, same) = (thrust_percent.abs(), at_same.name());
        format!(
            "At the same {same}, motor {motor} gives {size:.1} % {less} thrust than the mean of the other three (standard error of the fit {error} %)."
        )
    }
}

impl CenterOfMass {
    /// Where it is, if it is off the centre; each direction that is more than its error.
    fn sentence(&self) -> Option<String> {
        let mm = |m: f64| significant(1e3 * m, 2);
        let forward = (self.forward_m, self.forward_std_error_m, ["in front of", "behind"]);
        let right = (self.right_m, self.right_std_error_m, ["to the right of", "to the left of"]);
        let firm = |(m, error, _): &(f64, f64, [&str; 2])| m.abs() >= DEVIATIONS * error;
        let words: Vec<String> = [forward, right]
            .into_iter()
            .filter(firm)
            .map(|(m, _, [ahead, back])| format!("{} mm {}", mm(m.abs()), if m > 0.0 { ahead } else { back }))
            .collect();
        let error = mm(self.forward_std_error_m.max(self.right_std_error_m));
        self.off_center.then(|| {
            format!(
                "The centre of mass is {} the middle of the rotors (standard error of the fit up to {error} mm), or a constant moment acts on the craft.",
                words.join(" and ")
            )
        })
    }
}

/// Compares the rotors of a model that was fitted to some of these flights; nothing where its coefficients do not tell: without rotation,
/// without errors, too uncertain, of motors that hardly turn the craft, beside effects that change what the coefficients mean, or where they follow how the flights were flown.
pub fn compare_rotors(model: &Model, flights: &[&Prepared]) -> Option<RotorComparison> {
    let answers = of_coefficients(model)?.of_flights(model, flights)?;
    Some(answers.told(model.vehicle.arm_length / 2_f64.sqrt(), AtSame::of(model)))
}

/// Whether the rotors of a model differ, as [`compare_rotors`] says. It looks at the flights only if the coefficients alone say so.
pub fn rotors_differ(model: &Model, flights: &[&Prepared]) -> bool {
    let by_coefficients = of_coefficients(model).filter(Answers::any_differs);
    let answers = by_coefficients.and_then(|alone| alone.of_flights(model, flights));
    answers.is_some_and(|answers| answers.any_differs())
}

/// Thrust of each rotor beyond the mean of the four, and centre of mass in levers.
#[derive(Debug, Clone)]
struct Answers {
    values: SVector<f64, ANSWERS>,
    errors: SVector<f64, ANSWERS>,
    /// How many standard errors a difference must have.
    deviations: f64,
}

/// What the coefficients of a model say by themselves.
fn of_coefficients(model: &Model) -> Option<Answers> {
    let changed = [Effect::MotorEfficiency, Effect::ComOffset].iter().any(|effect| model.has(*effect));
    let term = model.term(Effect::RotorMoments).filter(|_| !changed && !turns_too_weakly(model))?;
    let is_firm = |c: &Estimate| c.std_error.is_some_and(|error| error > 0.0 && c.value > FIRM * error);
    let coefficients = term.coefficients.get(..KNOWN).filter(|all| all.iter().all(is_firm))?;
    let shares = shares(model);
    let logarithms = SVector::<f64, KNOWN>::from_fn(|i, _| (coefficients[i].value * shares[i % 4]).ln());
    let slopes = slopes(model, coefficients, &shares);
    let weights = (&slopes * model.covariance() * slopes.transpose()).cholesky()?.inverse();
    let weights = SMatrix::<f64, KNOWN, KNOWN>::from_fn(|i, j| weights[(i, j)]);
    let design = design();
    let unknown = (design.transpose() * weights * design).cholesky()?.inverse();
    let values = unknown * design.transpose() * weights * logarithms;
    let left = logarithms - design * values;
    let disagreement = left.dot(&(weights * left)).max(1.0);
    let deviations = if disagreement > DISAGREE { DEVIATIONS_IN_DISAGREEMENT } else { DEVIATIONS };
    let answers = answers();
    let variances = (answers * unknown * answers.transpose()).diagonal();
    let errors = variances.map(|v| (v * disagreement).max(0.0).sqrt());
    Some(Answers { values: answers * values, errors, deviations })
}

/// Thrust of the rotors that is in the model beside the coefficients of their moments.
fn shares(model: &Model) -> [f64; 4] {
    model.term(Effect::UnequalThrust).map_or([1.0; 4], |term| thrust_shares(&term.values()))
}

/// Derivatives of the logarithms by all coefficients of the model.
fn slopes(model: &Model, moments: &[Estimate], shares: &[f64; 4]) -> DMatrix<f64> {
    let places =
        || model.terms.iter().flat_map(|term| (0..term.coefficients.len()).map(|k| (term.effect, k)));
    let mut slopes = DMatrix::zeros(KNOWN, places().count());
    for (column, (effect, k)) in places().enumerate() {
        match effect {
            Effect::RotorMoments if k < KNOWN => slopes[(k, column)] = 1.0 / moments[k].value,
            Effect::UnequalThrust => {
                (0..KNOWN).for_each(|i| slopes[(i, column)] = THRUST_DIFFERENCES[k][i % 4] / shares[i % 4]);
            }
            _ => {}
        }
    }
    slopes
}

/// Standard errors of the means of the flights' own answers; nothing of fewer flights than show it.
fn scatter([roll, pitch]: [&MotorsOfFlights; 2]) -> Option<SVector<f64, ANSWERS>> {
    let design = design();
    let plain = (design.transpose() * design).cholesky()?.inverse() * design.transpose();
    let own = |name: &str, roll: &[f64; 4]| {
        let pitch = pitch.flights.iter().find(|flight| flight.name == name)?.value;
        let all = SVector::<f64, KNOWN>::from_iterator(roll.iter().chain(&pitch).copied());
        all.iter().all(|c| *c > 0.0).then(|| answers() * plain * all.map(f64::ln))
    };
    let of_flights: Vec<SVector<f64, ANSWERS>> =
        roll.flights.iter().filter_map(|flight| own(&flight.name, &flight.value)).collect();
    let count = of_flights.len();
    (count >= FEWEST_FLIGHTS).then(|| {
        SVector::from_fn(|k, _| {
            let values: Vec<f64> = of_flights.iter().map(|flight| flight[k]).collect();
            deviation(&values) / ((count - 1) as f64).sqrt()
        })
    })
}

impl Answers {
    /// With standard errors that are no smaller than those of the mean of the flights; nothing where they follow how these were flown.
    fn of_flights(self, model: &Model, flights: &[&Prepared]) -> Option<Self> {
        if flights.len() < FEWEST_FLIGHTS {
            return None;
        }
        let all = motors_of_flights(model, flights);
        let [roll, pitch, _] = all.as_slice() else { return None };
        let follows = roll.warning.is_some() || pitch.warning.is_some();
        let scatter = scatter([roll, pitch]).filter(|_| !follows)?;
        let (errors, spin) =
            (self.errors.sup(&scatter), model.vehicle.motors.spin.map(|spin| spin.yaw_sign()));
        let squares = flights.iter().map(|flight| mean_rotor_squared(flight, model));
        let mean_squares =
            squares.fold([0.0; 4], |sum, own| std::array::from_fn(|rotor| sum[rotor] + own[rotor]));
        let deviations = match self.unbalances_yaw(&mean_squares, &spin) {
            true => DEVIATIONS_IN_DISAGREEMENT,
            false => self.deviations,
        };
        Some(Self { errors, deviations, ..self })
    }

    /// Whether rotors that turn so fast balance in yaw much better if they are alike than if they differ so.
    fn unbalances_yaw(&self, rotor_squared: &[f64; 4], spin: &[f64; 4]) -> bool {
        let yaw = |shares: [f64; 4]| {
            let thrusts: [f64; 4] = std::array::from_fn(|rotor| shares[rotor] * rotor_squared[rotor]);
            let torque: f64 = thrusts.iter().zip(spin).map(|(thrust, spin)| thrust * spin).sum();
            torque / thrusts.iter().sum::<f64>()
        };
        let (alike, different) = (yaw([1.0; 4]), yaw(std::array::from_fn(|rotor| self.values[rotor].exp())));
        let change = (different - alike).abs();
        change > UNCHANGED_IN_YAW && different.abs() - alike.abs() > WORSE_IN_YAW * change
    }

    fn told(&self, lever_m: f64, at_same: AtSame) -> RotorComparison {
        let differs: [bool; 4] = std::array::from_fn(|motor| self.differs(motor));
        let [forward_m, right_m] = [4, 5].map(|k| lever_m * self.values[k]);
        let [forward_std_error_m, right_std_error_m] = [4, 5].map(|k| lever_m * self.errors[k]);
        RotorComparison {
            at_same,
            motors: std::array::from_fn(|motor| thrust(motor, self.values[motor], self.errors[motor])),
            differ: self.any_differs(),
            different_motor: self.only_one(differs),
            center_of_mass: CenterOfMass {
                forward_m,
                forward_std_error_m,
                right_m,
                right_std_error_m,
                off_center: [4, 5].into_iter().any(|k| self.stands_out(k, self.values[k])),
            },
        }
    }

    /// Against the mean of the other three, whose thrust makes up for what this one lacks of the mean of all.
    fn against_the_others(&self, motor: usize) -> f64 {
        4.0 / 3.0 * self.values[motor]
    }

    fn differs(&self, motor: usize) -> bool {
        self.stands_out(motor, self.against_the_others(motor))
    }

    fn any_differs(&self) -> bool {
        (0..4).any(|motor| self.differs(motor))
    }

    fn stands_out(&self, answer: usize, size: f64) -> bool {
        size.abs() >= LEAST && self.values[answer].abs() >= self.deviations * self.errors[answer]
    }

    /// The motor that differs most, where the other three are alike.
    fn only_one(&self, differs: [bool; 4]) -> Option<MotorThrust> {
        let motor = (0..4)
            .filter(|motor| differs[*motor])
            .max_by(|a, b| self.values[*a].abs().total_cmp(&self.values[*b].abs()))?;
        let (own, error) = (self.against_the_others(motor), 4.0 / 3.0 * self.errors[motor]);
        let is_alike = |other: usize| {
            // The three make up for it together.
            let apart = self.values[other] + self.values[motor] / 3.0;
            apart.abs() <= f64::max(ALIKE * own.abs(), self.deviations * self.errors[other])
        };
        (0..4).filter(|other| *other != motor).all(is_alike).then(|| thrust(motor, own, error))
    }
}

/// From the logarithm of a share.
fn thrust(motor: usize, logarithm: f64, error: f64) -> MotorThrust {
    MotorThrust {
        motor: motor + 1,
        thrust_percent: 100.0 * logarithm.exp_m1(),
        std_error_percent: 100.0 * logarithm.exp() * error,
    }
}

/// Logarithms of the coefficients from the unknowns.
fn design() -> SMatrix<f64, KNOWN, UNKNOWN> {
    let mut design = SMatrix::<f64, KNOWN, UNKNOWN>::zeros();
    for rotor in 0..4 {
        for (axis, (of_center, side)) in [(6, RIGHT), (5, FORWARD)].into_iter().enumerate() {
            let row = 4 * axis + rotor;
            design[(row, axis)] = 1.0;
            design[(row, of_center)] = -side[rotor];
            match rotor {
                3 => (2..5).for_each(|k| design[(row, k)] = -1.0),
                _ => design[(row, 2 + rotor)] = 1.0,
            }
        }
    }
    design
}

/// What is asked for, from the unknowns.
fn answers() -> SMatrix<f64, ANSWERS, UNKNOWN> {
    let mut answers = SMatrix::<f64, ANSWERS, UNKNOWN>::zeros();
    for k in 0..3 {
        answers[(k, 2 + k)] = 1.0;
        answers[(3, 2 + k)] = -1.0;
    }
    answers[(4, 5)] = 1.0;
    answers[(5, 6)] = 1.0;
    answers
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fit;
    use crate::testing::{NONE, fly, truth};

    /// A craft of equal rotors but for these losses of thrust and this centre of mass, forward and right in levers, by Newton's and
    /// Euler's equations; every coefficient with this relative error.
    fn craft(losses: [f64; 4], center: [f64; 2], error: f64) -> Model {
        let mut model = truth();
        let mut values = model.term(Effect::RotorMoments).unwrap().values();
        for rotor in 0..4 {
            let thrust = 1.0 - losses[rotor];
            values[rotor] = 0.6 * thrust * (RIGHT[rotor] - center[1]).abs();
            values[4 + rotor] = 0.5 * thrust * (FORWARD[rotor] - center[0]).abs();
        }
        model.set(Effect::RotorMoments, &values);
        model.correlation = None;
        for estimate in model.terms.iter_mut().flat_map(|term| &mut term.coefficients) {
            estimate.std_error = Some(error * estimate.value.abs());
        }
        model
    }

    fn told(model: &Model) -> RotorComparison {
        of_coefficients(model).unwrap().told(model.vehicle.arm_length / 2_f64.sqrt(), AtSame::Speed)
    }

    #[test]
    fn a_weak_motor_and_a_shifted_centre_of_mass_are_told_apart() {
        let found = told(&craft([0.0, 0.0, 0.0, 0.06], [0.03, -0.02], 0.001));
        let weak = found.different_motor.unwrap();
        assert_eq!(weak.motor, 4);
        assert!((weak.thrust_percent + 6.0).abs() < 0.1, "{weak:?}");
        let lever_m = truth().vehicle.arm_length / 2_f64.sqrt();
        let CenterOfMass { forward_m, right_m, off_center, .. } = found.center_of_mass;
        assert!(off_center && (forward_m / lever_m - 0.03).abs() < 1e-3, "{forward_m}");
        assert!((right_m / lever_m + 0.02).abs() < 1e-3, "{right_m}");
    }

    #[test]
    fn equal_rotors_about_the_centre_of_mass_are_alike() {
        let found = told(&craft([0.0; 4], [0.0; 2], 0.001));
        assert!(!found.differ && found.different_motor.is_none() && !found.center_of_mass.off_center);
        assert!(found.motors.iter().all(|motor| motor.thrust_percent.abs() < 1e-9));
    }

    #[test]
    fn two_weak_motors_are_not_one() {
        let found = told(&craft([0.1, 0.1, 0.0, 0.0], [0.0; 2], 0.001));
        assert!(found.differ && found.different_motor.is_none(), "{found:?}");
        assert!(found.motors[0].thrust_percent < -4.0 && found.motors[2].thrust_percent > 4.0);
    }

    #[test]
    fn what_is_small_or_within_its_errors_is_not_told() {
        assert!(!told(&craft([0.01, 0.0, 0.0, 0.0], [0.01, 0.0], 1e-5)).differ, "a percent");
        let uncertain = told(&craft([0.06, 0.0, 0.0, 0.0], [0.03, 0.0], 0.03));
        assert!(!uncertain.differ && !uncertain.center_of_mass.off_center, "{uncertain:?}");
    }

    /// Tables 4.8 and 4.10 with 1 % of error each, by numpy's lstsq: roll and pitch disagree by 47 times the square of that.
    #[test]
    fn the_thesis_coefficients_agree_on_nothing() {
        let mut model = Model::thesis();
        for estimate in model.terms.iter_mut().flat_map(|term| &mut term.coefficients) {
            estimate.std_error = Some(0.01 * estimate.value.abs());
        }
        let found = told(&model);
        let expected = [-1.0307770275284622, 13.029629829636423, -4.756745447052124, -6.141565339891198];
        for (motor, expected) in found.motors.iter().zip(expected) {
            assert!((motor.thrust_percent - expected).abs() < 1e-6, "{motor:?}");
        }
        assert!((found.motors[0].std_error_percent - 0.9896922 * 5.429689464607805).abs() < 1e-5);
        let center = found.center_of_mass;
        assert!((center.forward_m - 0.0027551150465687335).abs() < 1e-9, "{center:?}");
        assert!((center.right_m - 0.0044140554002035405).abs() < 1e-9, "{center:?}");
        assert!(!found.differ && !center.off_center);
    }

    /// Of a rotor that gives a fifth less, steady flight wants a quarter more of squared speed, if its torque falls as its thrust does.
    #[test]
    fn rotors_that_turn_as_if_they_were_alike_speak_against_differences() {
        let spin = [1.0, -1.0, 1.0, -1.0];
        let weak = of_coefficients(&craft([0.0, 0.0, 0.2, 0.0], [0.0; 2], 0.001)).unwrap();
        let pair = of_coefficients(&craft([0.2, 0.2, 0.0, 0.0], [0.0; 2], 0.001)).unwrap();
        assert!(weak.unbalances_yaw(&[1.0; 4], &spin));
        assert!(weak.unbalances_yaw(&[1.0, 1.0, 1.02, 1.0], &spin));
        assert!(!weak.unbalances_yaw(&[1.0, 1.0, 1.25, 1.0], &spin));
        assert!(!weak.unbalances_yaw(&[1.1, 1.1, 1.4, 1.0], &spin), "with a motor that leans");
        assert!(!pair.unbalances_yaw(&[1.0; 4], &spin), "neighbours turn against each other");
    }

    /// Motor 2 of the thesis has a fifth more in pitch and as much as the others in roll: in simulated flights of that craft, 4.5 standard
    /// errors.
    #[test]
    fn what_roll_and_pitch_disagree_about_must_be_far_larger() {
        let mut model = Model::thesis();
        for estimate in model.terms.iter_mut().flat_map(|term| &mut term.coefficients) {
            estimate.std_error = Some(0.001 * estimate.value.abs());
        }
        let contradictory = of_coefficients(&model).unwrap();
        let clear = of_coefficients(&craft([0.0, 0.1, 0.0, 0.0], [0.0; 2], 0.001)).unwrap();
        let errors = SVector::from_element(0.2 / 4.5);
        let values = SVector::from([-0.05, 0.15, -0.05, -0.05, 0.2, 0.0]);
        for (answers, differ) in [(contradictory, false), (clear, true)] {
            let found = Answers { values, errors: 0.75 * errors, ..answers }.told(0.1, AtSame::Speed);
            assert_eq!((found.differ, found.center_of_mass.off_center), (differ, differ), "{found:?}");
        }
    }

    #[test]
    fn coefficients_that_say_nothing_are_not_compared() {
        let good = craft([0.0; 4], [0.0; 2], 0.001);
        let edits: [fn(&mut Model); 5] = [
            |model| model.terms.retain(|term| term.effect == Effect::Thrust),
            |model| model.set(Effect::MotorEfficiency, &[0.1, 0.0, 0.0, 0.0]),
            |model| model.set(Effect::ComOffset, &[0.01, 0.0]),
            |model| {
                model
                    .terms
                    .iter_mut()
                    .for_each(|t| t.coefficients.iter_mut().for_each(|c| c.std_error = None))
            },
            |model| {
                let moments =
                    model.terms.iter_mut().find(|term| term.effect == Effect::RotorMoments).unwrap();
                moments.coefficients[5].std_error = Some(0.2);
            },
        ];
        assert!(of_coefficients(&good).is_some());
        for (number, edit) in edits.into_iter().enumerate() {
            let mut model = good.clone();
            edit(&mut model);
            assert!(of_coefficients(&model).is_none(), "{number}");
        }
    }

    #[test]
    fn what_differs_is_told_in_sentences() {
        let found = |losses, center| told(&craft(losses, center, 0.001));
        let sentences = |losses, center| found(losses, center).sentences();
        let nothing: [&str; 0] = [];
        assert_eq!(sentences([0.0; 4], [0.0; 2]), nothing);
        assert_eq!(
            sentences([0.0, 0.0, 0.0, 0.06], [0.03, -0.02]),
            [
                "At the same speed, motor 4 gives 6.0 % less thrust than the mean of the other three (standard error of the fit 0.1 %).",
                "The centre of mass is 3.5 mm in front of and 2.4 mm to the left of the middle of the rotors (standard error of the \
                 fit up to 0.084 mm), or a constant moment acts on the craft."
            ]
        );
        assert_eq!(
            sentences([0.1, 0.1, 0.0, 0.0], [0.0, 0.0]),
            [
                "The motors differ in thrust: at the same speed, motors 1 to 4 give -5.1, -5.1, +5.4, +5.4 % relative to their mean \
                 (standard error of the fit up to 0.08 %)."
            ]
        );
    }

    /// Without logged speeds, a motor may be slow or its thrust weak.
    #[test]
    fn commands_are_the_same_where_no_speeds_are_logged() {
        let mut model = craft([0.0, 0.0, 0.0, 0.06], [0.0; 2], 0.001);
        for (logged, same) in [(true, "speed"), (false, "command")] {
            model.reference.rotor_speeds_logged = logged;
            let one = RotorComparison { at_same: AtSame::of(&model), ..told(&model) };
            let all = RotorComparison { different_motor: None, ..one.clone() };
            let [one, all] = [one, all].map(|told| told.sentences().swap_remove(0));
            assert!(one.starts_with(&format!("At the same {same}, motor 4 gives")), "{one}");
            assert!(all.contains(&format!("at the same {same}, motors 1 to 4 give")), "{all}");
        }
    }

    /// A motor that is weak in every flight, fitted as a user would.
    #[test]
    fn a_motor_that_is_weak_in_all_flights_is_named() {
        let world = craft([0.0, 0.07, 0.0, 0.0], [0.0, 0.0], 0.0);
        let flights: Vec<Prepared> = (1..4)
            .map(|seed| Prepared::new(&fly(&world, seed, 20.0, &NONE), &world.vehicle).unwrap())
            .collect();
        let flights: Vec<&Prepared> = flights.iter().collect();
        let model = fit(&flights, &world.vehicle, &world.effects(), None).unwrap().model;
        let found = compare_rotors(&model, &flights).unwrap();
        let weak = found.different_motor.unwrap();
        assert_eq!(weak.motor, 2, "{found:?}");
        assert!((weak.thrust_percent + 7.0).abs() < 4.0 * weak.std_error_percent.max(0.1), "{weak:?}");
        assert_eq!(compare_rotors(&model, &flights[..1]), None, "one flight shows no scatter");
    }
}
