//! The catalogue: one file an effect. An effect's definition here is used to identify, to predict and to simulate.
//!
//! To add one: write its file (an `INFO`, and either `columns` or an `Adjustment`), then name it in the list below. Effects
//! that users define at run time ([`crate::user_effects`]) stand beside the catalogue.

pub(crate) mod adjusting;
mod adjustments;
mod catalogue;
mod timing;
pub(crate) mod weights;

use std::borrow::Cow;
use std::fmt;
use std::path::Path;

use nalgebra::Vector3;

use crate::effect::{EffectInfo, Kind, PlacedSink, Question, Sink};
use crate::memory::LagId;
use crate::sample::{AtRotor, Sample, SampleInput};
use crate::user_effects::{self, Definition, User, UserEffect, UserEffectError};
use adjusting::Adjusting;
pub use adjustments::Untilt;
use catalogue::catalogue;
pub use unequal_thrust::{THRUST_DIFFERENCES, thrust_shares};

catalogue! {
    columns {
        Thrust => thrust,
        LinearDrag => linear_drag,
        RotorMoments => rotor_moments,
        InertiaCoupling => inertia_coupling,
        Gyroscopic => gyroscopic,
        AngularDamping => angular_damping,
        QuadraticDrag => quadratic_drag,
        FlappingMoment => flapping_moment,
        RateCoupling => rate_coupling,
        RotorInertia => rotor_inertia,
        ProductOfInertia => product_of_inertia,
        QuadraticYawDamping => quadratic_yaw_damping,
        Tether => tether,
        MotorTilt => motor_tilt,
    }
    adjusting {
        GroundEffect => ground_effect,
        TranslationalLift => translational_lift,
        ThrustLinear => thrust_linear,
        UnequalThrust => unequal_thrust,
        MotorLag => motor_lag,
        InputDelay => input_delay,
        SteadyWind => steady_wind,
        WindShear => wind_shear,
        BatteryVoltage => battery_voltage,
        TrackingOffset => tracking_offset,
        AttitudeOffset => attitude_offset,
        MassChange => mass_change,
        ComOffset => com_offset,
        MotorEfficiency => motor_efficiency,
        MotorTorque => motor_torque,
        SlungLoad => slung_load,
    }
}

impl Effect {
    /// The effect of this identifier: of the catalogue, or a user's that has been read.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::all().find(|effect| effect.info().id == id)
    }

    /// The catalogue, then the users' effects that have been read.
    pub fn all() -> impl Iterator<Item = Self> {
        CATALOGUE.iter().copied().chain(user_effects::all().into_iter().map(Effect::User))
    }

    /// What its formulas look back at, if it is a user's.
    pub fn lags(self) -> Vec<LagId> {
        match self {
            Effect::User(user) => user.lags(),
            _ => Vec::new(),
        }
    }

    /// Where a fit that knows nothing of the effect starts: values of the coefficients that make its shape (a length, a
    /// frequency), none for those that least squares give once the shape is known. Nothing for an effect that can
    /// start at zero.
    pub fn starts(self) -> Vec<Vec<Option<f64>>> {
        match self {
            Effect::User(user) => user.starts(),
            known => (known.info().special.starts)(),
        }
    }

    /// Effects that it brings to light: they are fitted together with it ([`crate::Special::reveals`]).
    pub fn reveals(self) -> impl Iterator<Item = Self> {
        self.info().special.reveals.iter().filter_map(|id| Self::from_id(id))
    }

    /// The word for it in commands, files and pages.
    pub const fn id(self) -> &'static str {
        self.info().id
    }

    /// Names of the measured quantities that it shows in; of a user's, all that its formulas name.
    pub fn quantities(self) -> Vec<&'static str> {
        match self {
            Effect::User(user) => user.quantities(),
            known => known.info().through.to_vec(),
        }
    }

    /// The basic model of (4.3).
    pub fn basic() -> impl Iterator<Item = Self> {
        CATALOGUE.iter().copied().filter(|effect| effect.info().kind == Kind::Basic)
    }

    /// Effects that can be missing from a model.
    pub fn candidates() -> impl Iterator<Item = Self> {
        Self::all()
            .filter(|effect| effect.info().kind != Kind::Basic && effect.info().question != Question::Change)
    }

    /// Effects that can have come about since a model was good.
    pub fn changes() -> impl Iterator<Item = Self> {
        Self::all().filter(|effect| {
            effect.info().kind != Kind::Basic && effect.info().question != Question::Structure
        })
    }
}

/// Identifiers that users cannot give to their own effects.
fn taken() -> Vec<&'static str> {
    CATALOGUE.iter().map(|effect| effect.id()).collect()
}

/// Reads a file of users' effects and makes them known to [`Effect::from_id`], [`Effect::candidates`] and the rest.
///
/// # Errors
/// A file that cannot be read, a definition that cannot be right, or one whose identifier already means something else.
pub fn read(path: &Path) -> Result<Vec<Effect>, UserEffectError> {
    Ok(user_effects::read(path, &taken())?.into_iter().map(Effect::User).collect())
}

/// Parses and checks the text of a file of users' effects without making them known; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, path: &Path) -> Result<Vec<UserEffect>, UserEffectError> {
    user_effects::parse(text, path, &taken())
}

/// Parses and checks the text of a file of users' effects, so that they can be fitted. Their identifiers go on to mean what they
/// meant ([`User::make_known`] changes that); `path` is for messages.
///
/// # Errors
/// As [`read`], and when more texts were tried than one program keeps.
pub fn draft(text: &str, path: &Path) -> Result<Vec<User>, UserEffectError> {
    user_effects::draft(text, path, &taken())
}

/// Checks a definition of the program's own making, so that it can be fitted, as [`draft`] does. It does not count among the texts that
/// users try.
///
/// # Errors
/// As [`draft`].
pub fn draft_one(definition: Definition, path: &Path) -> Result<User, UserEffectError> {
    user_effects::draft_one(definition, path, &taken())
}

/// Checks the text of a file of effects as [`draft`] does, and keeps nothing.
pub fn check(text: &str, path: &Path) -> Result<(), UserEffectError> {
    user_effects::parse(text, path, &taken()).map(drop)
}

/// Checks a definition and makes it known; `path` is for messages.
pub(crate) fn define(definition: Definition, path: &Path) -> Result<Effect, UserEffectError> {
    user_effects::define(definition, path, &taken()).map(Effect::User)
}

impl fmt::Debug for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id())
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id())
    }
}

/// As its identifier.
impl serde::Serialize for Effect {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id())
    }
}

/// A string: users' effects have identifiers of their own.
impl schemars::JsonSchema for Effect {
    fn schema_name() -> Cow<'static, str> {
        "Effect".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "Identifier of an effect: of the catalogue, or of a file of users' effects.",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Axis;
    use crate::effect::{Coefficient, Sink};
    use crate::pendulum::Pendulum;
    use crate::quantity::{COMBINATIONS, QUANTITIES, Quantity};
    use crate::rotor_quantity::RotorQuantity;
    use crate::sample::SampleInput;
    use crate::vehicle::Vehicle;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn identifiers_are_unique_and_found_again() {
        for &effect in CATALOGUE {
            assert_eq!(Effect::from_id(effect.id()), Some(effect));
            assert!(!effect.info().coefficients.is_empty());
            for coefficient in effect.info().coefficients {
                assert!(coefficient.possible.0 < coefficient.possible.1 && coefficient.typical > 0.0);
            }
            let info = effect.info();
            assert!(!info.equation.is_empty());
            assert!(info.through.len() == 1 || info.through.len() == info.axes.len(), "{effect}");
            for axis in info.axes {
                let through = info.acts_through(*axis).unwrap();
                assert!(Quantity::named(through).is_some(), "{effect} acts through {through}");
            }
            for (other, manoeuvre) in effect.info().confused_with {
                assert!(!manoeuvre.is_empty());
                assert_ne!(*other, effect.id());
            }
        }
        assert_eq!(Effect::from_id("no-such-effect"), None);
    }

    /// A flight in which everything moves, with rotor speeds counted in a unit that is `finer` times as fine.
    fn counted(finer: f64) -> SampleInput {
        SampleInput {
            position_ned_m: Vector3::new(0.3, -0.2, -0.2),
            dcm: Matrix3::identity(),
            velocity_m_s: Vector3::new(1.0, 0.5, 0.2),
            rate_rad_s: Vector3::new(0.5, -0.4, 0.3),
            angular_acceleration_rad_s2: Vector3::new(2.0, 3.0, -1.0),
            rotor_rad_s: [600.0, 610.0, 620.0, 630.0].map(|w| finer * w),
            rotor_acceleration_rad_s2: [10.0, 20.0, 40.0, 80.0].map(|a| finer * a),
            battery_v: 11.0,
            pendulum: Pendulum::default(),
            memory: None,
            further: crate::sample::NO_FURTHER,
        }
    }

    /// The power of "cmd" in a unit.
    fn power_of_commands(unit: &str) -> i32 {
        let power = |part: &str| match part.split_once("cmd") {
            Some((_, rest)) => rest.strip_prefix('^').map_or(1, |digits| digits[..1].parse().unwrap()),
            None => 0,
        };
        let (above, below) = unit.split_once('/').unwrap_or((unit, ""));
        power(above) - power(below)
    }

    /// Products of columns and coefficients.
    struct Products<'a>(&'a [f64], Vec<f64>);

    impl Sink for Products<'_> {
        fn add(&mut self, _: Axis, coefficient: usize, value: f64) {
            self.1.push(self.0[coefficient] * value);
        }
    }

    /// What an effect of ordinary size does, in units that the rotors' has no part in, when its coefficients follow the unit
    /// of rotor speeds as their own units say.
    fn done_by(effect: Effect, finer: f64) -> Vec<f64> {
        let size =
            |c: &Coefficient| c.typical * finer.powi(power_of_commands(c.unit_for(RotorQuantity::Command)));
        let values: Vec<f64> = effect.info().coefficients.iter().map(size).collect();
        let (input, mut adjust) = (counted(finer), Adjustments::default());
        adjust.take_up(effect, &values, 11.5);
        let constants = adjust.constants(&Vehicle::thesis());
        let sample = adjust.sample(&input, &constants);
        let mut products = Products(&values, Vec::new());
        effect.columns(&sample, &mut products);
        let thrust = sample.rotor_thrust_rad2_s2.map(|t| t / finer.powi(2));
        let speed = adjust.corrected_speed_rad_s(input.rotor_rad_s[0], 11.0) / finer;
        products.1.into_iter().chain(thrust).chain([speed]).collect()
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
    }

    /// Commands are rotor speeds in an unknown unit: that must be in the units of whatever contains them, and in no other.
    #[test]
    fn units_in_commands_have_the_power_of_rotor_speeds_that_the_equations_have() {
        for &effect in CATALOGUE {
            let (ordinary, finer) = (done_by(effect, 1.0), done_by(effect, 3.0));
            assert_eq!(ordinary.len(), finer.len());
            let alike = std::iter::zip(&ordinary, &finer).all(|(a, b)| near(*a, *b));
            assert!(alike, "{effect}: {ordinary:?} {finer:?}");
            let others = effect.info().coefficients.iter().filter_map(|c| c.unit_in_commands);
            for unit in others {
                assert!(unit.contains("cmd") && !unit.contains("rad"), "{effect}: {unit}");
            }
        }
        let constants = Adjustments::default().constants(&Vehicle::thesis());
        for quantity in QUANTITIES.iter().chain(COMBINATIONS) {
            let at = |finer| quantity.at(&Adjustments::default().sample(&counted(finer), &constants));
            let power = power_of_commands(quantity.unit_for(RotorQuantity::Command));
            assert!(near(at(3.0), at(1.0) * 3.0_f64.powi(power)), "{}", quantity.name);
            assert_eq!(quantity.unit_for(RotorQuantity::Speed), quantity.unit);
        }
    }
}
