//! Physical parameters of a craft from the coefficients of its model: mass, thrust and torque coefficients, moments of inertia.
//!
//! The coefficients of (2.6) to (2.8) are ratios. Mass and geometry are known from scale and tape measure, so that the
//! ratios give the parameters one after the other:
//! - (2.6): a rotor's thrust is `C_T beta w^2`, so `k_T = C_T beta`.
//! - (2.7): the model's lever is `sqrt(2) l` where geometry has `l / sqrt(2)`, and the moments' coefficients absorb the factor 2
//!   (reference section 5): `sqrt(2) l beta C_i^p / Ixx = (l / sqrt(2)) k_T / Ixx`, so `Ixx = C_T / (2 C_p / Ixx)` with the mean
//!   over the rotors, which have one C_T (section 4.1.1); `Iyy` alike.
//! - (2.7): `k_Q / Izz = beta R_R |C_i^r / Izz|`, the mean over the rotors.
//! - (2.8): `a = (Iyy - Izz) / Ixx` gives `Izz = Iyy - a Ixx`, and `b = (Izz - Ixx) / Iyy` gives `Izz = Ixx + b Iyy`: their mean by
//!   their errors. Where these two disagree, no rigid body is behind the ratios, and the error grows by the factor of their
//!   disagreement (Birge).
//!
//! Standard errors are those of the coefficients with their covariance, to first order. Mass and geometry count as exact.

use nalgebra::DVector;

use crate::effect::Estimate;
use crate::effects::Effect;
use crate::model::Model;
use crate::rotor_quantity::RotorQuantity;

/// A physical parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicalParameter {
    /// As people write it: `k_T`.
    pub symbol: &'static str,
    /// What it is.
    pub name: &'static str,
    /// In its unit.
    pub value: f64,
    /// Standard error; absent where it is not known or the value was measured otherwise.
    pub std_error: Option<f64>,
    /// Where commands stand in for rotor speeds, `cmd` is the command's unit.
    pub unit: &'static str,
    /// How it comes from coefficients and vehicle file, LaTeX.
    pub relation: &'static str,
    /// Where that is from.
    pub source: &'static str,
}

/// A parameter before there is a model.
struct Definition {
    symbol: &'static str,
    name: &'static str,
    /// With rotor speeds, and with commands in their place.
    units: [&'static str; 2],
    relation: &'static str,
    source: &'static str,
    /// Nothing where the model has no such effect, or the coefficients are none of a craft.
    value: fn(&Reading<'_>) -> Option<f64>,
    /// Whether the moment of inertia about z is in it.
    has_izz: bool,
}

const MASS: Definition = Definition {
    symbol: "m",
    name: "mass",
    units: ["kg"; 2],
    relation: "m",
    source: "the vehicle file",
    value: |reading| Some(reading.mass_kg()),
    has_izz: false,
};

/// Beside the mass; those about z are last.
const DEFINITIONS: [Definition; 8] = [
    Definition {
        symbol: "k_T",
        name: "thrust coefficient of a rotor",
        units: ["N/(rad/s)^2", "N/cmd^2"],
        relation: r"k_T = C_T \beta, \quad \beta = \rho \pi R_R^4",
        source: "(2.6)",
        value: |reading| reading.thrust(),
        has_izz: false,
    },
    Definition {
        symbol: "omega_h",
        name: "rotor speed in hover",
        units: ["rad/s", "cmd"],
        relation: r"\omega_h = \sqrt{\frac{m g}{4 k_T}}",
        source: "(2.6)",
        value: |reading| reading.hover(),
        has_izz: false,
    },
    Definition {
        symbol: "I_xx",
        name: "moment of inertia in roll",
        units: ["kg m^2"; 2],
        relation: r"I_{xx} = \frac{C_T}{2\, \overline{C_i^p / I_{xx}}}",
        source: "(2.6), (2.7)",
        value: |reading| reading.across(0),
        has_izz: false,
    },
    Definition {
        symbol: "I_yy",
        name: "moment of inertia in pitch",
        units: ["kg m^2"; 2],
        relation: r"I_{yy} = \frac{C_T}{2\, \overline{C_i^q / I_{yy}}}",
        source: "(2.6), (2.7)",
        value: |reading| reading.across(4),
        has_izz: false,
    },
    Definition {
        symbol: "k_Q/I_zz",
        name: "yaw acceleration by the reaction torque of a rotor",
        units: ["1", "1/(s^2 cmd^2)"],
        relation: r"\frac{k_Q}{I_{zz}} = \beta R_R\, \overline{|C_i^r / I_{zz}|}",
        source: "(2.7)",
        value: |reading| reading.torque_per_inertia(),
        has_izz: false,
    },
    Definition {
        symbol: "I_zz",
        name: "moment of inertia in yaw",
        units: ["kg m^2"; 2],
        relation: r"I_{zz} = I_{yy} - \frac{I_{yy} - I_{zz}}{I_{xx}} I_{xx}, \quad I_{zz} = I_{xx} + \frac{I_{zz} - I_{xx}}{I_{yy}} I_{yy}",
        source: "(2.8), the mean of both by their errors",
        value: |reading| reading.yaw_inertia(),
        has_izz: true,
    },
    Definition {
        symbol: "k_Q",
        name: "torque coefficient of a rotor",
        units: ["N m/(rad/s)^2", "N m/cmd^2"],
        relation: r"k_Q = \frac{k_Q}{I_{zz}} I_{zz}",
        source: "(2.7), (2.8)",
        value: |reading| Some(reading.torque_per_inertia()? * reading.yaw_inertia()?),
        has_izz: true,
    },
    Definition {
        symbol: "J_r",
        name: "moment of inertia of a rotor",
        units: ["kg m^2"; 2],
        relation: r"J_r = \frac{J_r}{I_{zz}} I_{zz}",
        source: "the effect rotor-inertia, (2.8)",
        value: |reading| Some(reading.one(Effect::RotorInertia, 0)? * reading.yaw_inertia()?),
        has_izz: true,
    },
];

/// A model and how its two moments of inertia about z are weighed.
struct Reading<'a> {
    model: &'a Model,
    weights: [f64; 2],
}

impl Reading<'_> {
    fn one(&self, effect: Effect, coefficient: usize) -> Option<f64> {
        self.model.term(effect)?.coefficients.get(coefficient).map(|estimate| estimate.value)
    }

    fn mass_kg(&self) -> f64 {
        self.model.vehicle.mass + self.one(Effect::MassChange, 0).unwrap_or(0.0)
    }

    fn thrust(&self) -> Option<f64> {
        Some(self.one(Effect::Thrust, 0)? * self.model.vehicle.beta_kg_m())
    }

    /// Only where thrust is all quadratic.
    fn hover(&self) -> Option<f64> {
        let is_quadratic = !self.model.has(Effect::ThrustLinear);
        let weight_n = self.mass_kg() * self.model.vehicle.gravity;
        self.thrust()
            .filter(|thrust| is_quadratic && *thrust > 0.0)
            .map(|thrust| (weight_n / (4.0 * thrust)).sqrt())
    }

    /// Mean of the moments' coefficients of the four rotors on an axis, whose first one stands at this place.
    fn mean_moment(&self, first: usize) -> Option<f64> {
        let four = self.model.term(Effect::RotorMoments)?.coefficients.get(first..first + 4)?;
        let mean = four.iter().map(|estimate| estimate.value.abs()).sum::<f64>() / 4.0;
        (mean > 0.0).then_some(mean)
    }

    fn across(&self, first: usize) -> Option<f64> {
        Some(self.one(Effect::Thrust, 0)? / (2.0 * self.mean_moment(first)?))
    }

    fn torque_per_inertia(&self) -> Option<f64> {
        let vehicle = &self.model.vehicle;
        Some(vehicle.beta_kg_m() * vehicle.rotor_radius * self.mean_moment(8)?)
    }

    /// By the coupling that rolls, and by the one that pitches.
    fn yaw_inertias(&self) -> Option<[f64; 2]> {
        let (ixx, iyy) = (self.across(0)?, self.across(4)?);
        let [a, b] = [0, 1].map(|place| self.one(Effect::InertiaCoupling, place));
        Some([iyy - a? * ixx, ixx + b? * iyy])
    }

    fn yaw_inertia(&self) -> Option<f64> {
        let [by_roll, by_pitch] = self.yaw_inertias()?;
        let inertia = self.weights[0] * by_roll + self.weights[1] * by_pitch;
        (inertia > 0.0).then_some(inertia)
    }
}

/// Physical parameters of a model, as far as its effects give them.
pub fn physical_parameters(model: &Model) -> Vec<PhysicalParameter> {
    let (weights, disagreement) = weigh_yaw_inertias(model);
    let parameter = |definition: &Definition| {
        let value = (definition.value)(&Reading { model, weights })?;
        let error = deviation(model, weights, definition.value)?;
        let factor = if definition.has_izz { disagreement } else { 1.0 };
        Some(PhysicalParameter {
            symbol: definition.symbol,
            name: definition.name,
            value,
            std_error: Some(error * factor).filter(|error| *error > 0.0),
            unit: definition.units[usize::from(model.rotor_quantity() == RotorQuantity::Command)],
            relation: definition.relation,
            source: definition.source,
        })
    };
    std::iter::once(&MASS).chain(&DEFINITIONS).filter_map(parameter).collect()
}

/// Weights of the two moments of inertia about z, and by what their disagreement is larger than their errors, 1 at least.
fn weigh_yaw_inertias(model: &Model) -> ([f64; 2], f64) {
    let even = [0.5, 0.5];
    let error = |of: fn(&Reading<'_>) -> Option<f64>| deviation(model, even, of).filter(|error| *error > 0.0);
    let by_roll = error(|reading| reading.yaw_inertias().map(|two| two[0]));
    let by_pitch = error(|reading| reading.yaw_inertias().map(|two| two[1]));
    let apart = error(|reading| reading.yaw_inertias().map(|[a, b]| a - b));
    let both = Reading { model, weights: even }.yaw_inertias();
    let (Some(first), Some(second), Some(apart), Some([a, b])) = (by_roll, by_pitch, apart, both) else {
        return (even, 1.0);
    };
    let [one, two] = [first, second].map(|error| 1.0 / (error * error));
    ([one / (one + two), two / (one + two)], ((a - b).abs() / apart).max(1.0))
}

/// Standard error of a function of the coefficients, to first order; nothing where it has no value.
fn deviation(model: &Model, weights: [f64; 2], of: fn(&Reading<'_>) -> Option<f64>) -> Option<f64> {
    let covariance = model.covariance();
    let mut moved = model.clone();
    let mut slopes = Vec::with_capacity(covariance.nrows());
    for term in 0..model.terms.len() {
        for coefficient in 0..model.terms[term].coefficients.len() {
            let Estimate { value, std_error } = model.terms[term].coefficients[coefficient];
            let step = 1e-3 * std_error.unwrap_or(0.0);
            let mut at = |value: f64| {
                moved.terms[term].coefficients[coefficient].value = value;
                of(&Reading { model: &moved, weights })
            };
            let rise = at(value + step)? - at(value - step)?;
            at(value)?;
            slopes.push(if step > 0.0 { rise / (2.0 * step) } else { 0.0 });
        }
    }
    let slopes = DVector::from_vec(slopes);
    Some((slopes.transpose() * covariance * &slopes)[(0, 0)].max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(all: &[PhysicalParameter], symbol: &str) -> f64 {
        all.iter().find(|one| one.symbol == symbol).unwrap_or_else(|| panic!("no {symbol}")).value
    }

    fn close(found: f64, expected: f64, part: f64) {
        assert!((found / expected - 1.0).abs() < part, "{found}, expected {expected}");
    }

    /// Reference section 1: beta and the equal speed in hover, 635.106 rad/s with the C_T of table 4.6.
    #[test]
    fn the_thesis_craft_hovers_at_the_speed_of_the_reference() {
        let mut model = Model::thesis();
        let mut thrust = model.term(Effect::Thrust).unwrap().values();
        thrust[0] = 0.0180;
        model.set(Effect::Thrust, &thrust);
        let all = physical_parameters(&model);
        close(value(&all, "k_T"), 0.0180 * 4.100726391e-04, 1e-9);
        // The reference takes the weight as the thesis prints it.
        let (weight_n, printed_n) = (11.90934_f64, 11.9093);
        close(value(&all, "omega_h"), 635.1063762307807 * (weight_n / printed_n).sqrt(), 1e-9);
        assert_eq!(value(&all, "m"), 1.214);
        assert!(all.iter().all(|one| one.std_error.is_none()), "the tables have no errors");
        // By hand from tables 4.6, 4.8, 4.10 and 4.12: the arms of an X frame are l / sqrt(2) long.
        let lever = 0.167 / 2_f64.sqrt() * 0.0180 * 4.100726391e-04;
        let model_lever = 2_f64.sqrt() * 0.167 * 4.100726391e-04;
        let mean = |four: [f64; 4]| four.iter().sum::<f64>() / 4.0;
        let ixx = lever / (model_lever * mean([0.617, 0.6229, 0.551, 0.5574]));
        let iyy = lever / (model_lever * mean([0.6008, 0.7203, 0.6058, 0.6267]));
        close(value(&all, "I_xx"), ixx, 1e-9);
        close(value(&all, "I_yy"), iyy, 1e-9);
        let izz = 0.5 * (iyy + 0.141 * ixx + ixx + 0.761 * iyy);
        close(value(&all, "I_zz"), izz, 1e-9);
        let torque = 4.100726391e-04 * 0.1016 * mean([0.3554, 0.3326, 0.2981, 0.2743]);
        close(value(&all, "k_Q/I_zz"), torque, 1e-9);
        close(value(&all, "k_Q"), torque * izz, 1e-9);
    }

    /// Coefficients of a craft whose parameters are known, forwards through Newton's and Euler's equations.
    fn craft(error: f64) -> Model {
        let mut model = Model::thesis();
        let vehicle = model.vehicle.clone();
        let (thrust, torque, [ixx, iyy, izz]) = (7.4e-6, 2.65e-7, [0.0140, 0.0150, 0.0240]);
        let reach = vehicle.arm_length / 2_f64.sqrt();
        let arm = 2_f64.sqrt() * vehicle.arm_length * vehicle.beta_kg_m();
        let yaw = vehicle.beta_kg_m() * vehicle.rotor_radius;
        let [p, q, r] = [thrust * reach / ixx / arm, thrust * reach / iyy / arm, torque / izz / yaw];
        model.set(Effect::Thrust, &[thrust / vehicle.beta_kg_m()]);
        model.set(Effect::RotorMoments, &[p, p, p, p, q, q, q, q, r, -r, r, -r]);
        model.set(Effect::InertiaCoupling, &[(iyy - izz) / ixx, (izz - ixx) / iyy, (ixx - iyy) / izz]);
        for estimate in model.terms.iter_mut().flat_map(|term| &mut term.coefficients) {
            estimate.std_error = Some(error * estimate.value.abs());
        }
        model.correlation = None;
        model
    }

    #[test]
    fn the_parameters_behind_coefficients_come_back() {
        let all = physical_parameters(&craft(0.01));
        let known = [("k_T", 7.4e-6), ("k_Q", 2.65e-7), ("I_xx", 0.0140), ("I_yy", 0.0150), ("I_zz", 0.0240)];
        for (symbol, expected) in known {
            close(value(&all, symbol), expected, 1e-9);
        }
        // Relative errors add in squares: of C_T once, of a mean of four half as much; of a root half as much.
        let error = |symbol: &str| {
            let one = all.iter().find(|one| one.symbol == symbol).unwrap();
            one.std_error.unwrap() / one.value
        };
        close(error("k_T"), 0.01, 1e-6);
        close(error("omega_h"), 0.005, 1e-5);
        close(error("I_xx"), (0.01_f64.powi(2) + 0.005_f64.powi(2)).sqrt(), 1e-5);
        close(error("k_Q/I_zz"), 0.005, 1e-6);
        assert!(all[0].std_error.is_none(), "the mass was weighed");
    }

    #[test]
    fn ratios_of_no_rigid_body_have_a_larger_error() {
        let error = |model: &Model| {
            let all = physical_parameters(model);
            all.iter().find(|one| one.symbol == "I_zz").unwrap().std_error.unwrap()
        };
        let mut strange = craft(0.01);
        let good = error(&strange);
        let coupling = strange.terms.iter_mut().find(|term| term.effect == Effect::InertiaCoupling).unwrap();
        coupling.coefficients[0].value = -0.141;
        assert!(error(&strange) > 5.0 * good);
    }

    #[test]
    fn commands_in_place_of_speeds_are_in_the_units() {
        let mut model = craft(0.01);
        let motors = &mut model.vehicle.motors;
        (motors.map, motors.command) = (Some(crate::MotorMapKind::Identify), None);
        (motors.voltage, motors.offset) = (None, None);
        let all = physical_parameters(&model);
        let unit = |symbol: &str| all.iter().find(|one| one.symbol == symbol).unwrap().unit;
        assert_eq!((unit("k_T"), unit("k_Q"), unit("omega_h")), ("N/cmd^2", "N m/cmd^2", "cmd"));
        assert_eq!(unit("I_xx"), "kg m^2");
    }

    #[test]
    fn forces_alone_give_no_moments() {
        let mut model = craft(0.01);
        model.terms.retain(|term| term.effect == Effect::Thrust);
        let symbols: Vec<&str> = physical_parameters(&model).iter().map(|one| one.symbol).collect();
        assert_eq!(symbols, ["m", "k_T", "omega_h"]);
        model.terms.clear();
        assert_eq!(physical_parameters(&model).len(), 1);
    }
}
