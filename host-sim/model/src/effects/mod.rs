//! The catalogue: one file an effect. An effect's definition here is used to identify, to predict and to simulate.
//!
//! To add one: write its file (an `INFO` and either `columns` or `adjust`), then name it in the list below. Effects that
//! users define at run time ([`crate::user_effect`]) stand beside the catalogue.

use std::fmt;

use crate::user_effect::{self, User};
use crate::{Adjustments, Axis, EffectInfo, Kind, Question, Sample, Sink, Term};

macro_rules! catalogue {
    (columns { $($linear:ident => $linear_file:ident),* $(,)? } adjusting { $($other:ident => $other_file:ident),* $(,)? }) => {
        $(mod $linear_file;)*
        $(mod $other_file;)*

        /// A physical effect: one term of the equations of motion, or something that changes what the terms see.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Effect {
            $(#[doc = concat!("See `", stringify!($linear_file), ".rs`.")] $linear,)*
            $(#[doc = concat!("See `", stringify!($other_file), ".rs`.")] $other,)*
            /// Defined by a user, in a file.
            User(User),
        }

        /// Places in the catalogue.
        enum Place { $($linear,)* $($other,)* }

        /// Every effect known beforehand, the basic model's first.
        pub const CATALOGUE: &[Effect] = &[$(Effect::$linear,)* $(Effect::$other,)*];

        impl Effect {
            /// What the effect says of itself.
            pub const fn info(self) -> &'static EffectInfo {
                match self {
                    $(Effect::$linear => &$linear_file::INFO,)*
                    $(Effect::$other => &$other_file::INFO,)*
                    Effect::User(user) => user.info(),
                }
            }

            /// Place in the catalogue; none for a user's.
            const fn place(self) -> Option<usize> {
                match self {
                    $(Effect::$linear => Some(Place::$linear as usize),)*
                    $(Effect::$other => Some(Place::$other as usize),)*
                    Effect::User(_) => None,
                }
            }

            /// Hands the effect's columns at `sample` to `sink`; nothing for an adjusting effect.
            #[inline]
            pub fn columns(self, sample: &Sample, sink: &mut impl Sink) {
                match self {
                    $(Effect::$linear => $linear_file::columns(sample, sink),)*
                    $(Effect::$other => {})*
                    Effect::User(user) => user.columns(sample, sink),
                }
            }

            /// Writes what the coefficients mean into `adjust`; nothing for a linear effect.
            pub fn adjust(self, coefficients: &[f64], adjust: &mut Adjustments) {
                match self {
                    $(Effect::$linear => {})*
                    $(Effect::$other => $other_file::adjust(coefficients, adjust),)*
                    Effect::User(_) => {}
                }
            }
        }

        impl Weights {
            /// Adds the columns of the effects that `which` picks, times their coefficients, which are 0 where the model
            /// does not have the effect. Straight-line code over the catalogue: `columns` is inlined with its effect's
            /// own coefficients, and what no effect looks at is never computed.
            #[inline(always)]
            fn weighted_sum(&self, sample: &Sample, which: impl Fn(Effect) -> bool) -> [f64; 6] {
                let mut sum = [0.0; 6];
                $({
                    let index = Place::$linear as usize;
                    if which(Effect::$linear) {
                        let mut sink = WeightedSum { coefficients: &self.coefficients[index], sum: &mut sum };
                        $linear_file::columns(sample, &mut sink);
                    }
                })*
                sum
            }
        }
    };
}

/// The linear effects of a model with the values of their coefficients, in the catalogue's order, and the users'.
#[derive(Debug, Clone)]
pub(crate) struct Weights {
    present: [bool; CATALOGUE.len()],
    coefficients: [[f64; WIDEST]; CATALOGUE.len()],
    users: Vec<(User, Vec<f64>)>,
    /// Whether there is nothing but effects of the thesis' model.
    of_thesis: bool,
}

/// Whether an effect is part of the thesis' model (tables 4.2 to 4.12), which most flights are simulated with.
const fn of_thesis(effect: Effect) -> bool {
    matches!(effect.info().kind, Kind::Basic)
        || matches!(effect, Effect::FlappingMoment | Effect::RateCoupling)
}

/// Most coefficients of one effect.
const WIDEST: usize = {
    let (mut widest, mut index) = (0, 0);
    while index < CATALOGUE.len() {
        let count = CATALOGUE[index].info().coefficients.len();
        widest = if count > widest { count } else { widest };
        index += 1;
    }
    widest
};

impl Weights {
    pub(crate) fn new(terms: &[Term]) -> Self {
        let mut weights = Self {
            present: [false; CATALOGUE.len()],
            coefficients: [[0.0; WIDEST]; CATALOGUE.len()],
            users: Vec::new(),
            of_thesis: true,
        };
        for term in terms {
            if let Effect::User(user) = term.effect {
                weights.users.push((user, term.coefficients.iter().map(|c| c.value).collect()));
                weights.of_thesis = false;
            }
            let Some(index) = term.effect.place() else { continue };
            if term.effect.info().kind == Kind::Adjusting {
                continue;
            }
            weights.present[index] = true;
            weights.of_thesis &= of_thesis(term.effect);
            for (sum, estimate) in weights.coefficients[index].iter_mut().zip(&term.coefficients) {
                *sum += estimate.value;
            }
        }
        weights
    }
}

impl Weights {
    /// Whether [`Self::accelerations_of_thesis`] is all there is.
    pub(crate) fn of_thesis(&self) -> bool {
        self.of_thesis
    }

    /// The six rows at `sample` of a model without other effects than the thesis'. To be inlined where it is integrated:
    /// without a branch, a stage stays in registers.
    #[inline(always)]
    pub(crate) fn accelerations_of_thesis(&self, sample: &Sample) -> [f64; 6] {
        self.weighted_sum(sample, of_thesis)
    }

    /// The six rows at `sample`. A product of inertia couples the angular accelerations with each other: their values are
    /// iterated, the ratios being a few percent, until they agree to rounding.
    #[inline(never)]
    pub(crate) fn accelerations(&self, sample: &Sample) -> [f64; 6] {
        let present = |effect: Effect| effect.place().is_some_and(|place| self.present[place]);
        let mut sum = self.weighted_sum(sample, present);
        if present(Effect::ProductOfInertia) {
            let mut input = *sample.input;
            for _ in 1..PRODUCT_OF_INERTIA_PASSES {
                input.angular_acceleration_rad_s2 = nalgebra::Vector3::new(sum[3], sum[4], sum[5]);
                sum = self.weighted_sum(&Sample { input: &input, ..*sample }, present);
            }
        }
        for (user, coefficients) in &self.users {
            user.add_accelerations(sample, coefficients, &mut sum);
        }
        sum
    }

    /// The users' effects with the values of their coefficients.
    pub(crate) fn users(&self) -> &[(User, Vec<f64>)] {
        &self.users
    }
}

/// Each pass gains a factor Ixz / I, at least a digit.
const PRODUCT_OF_INERTIA_PASSES: usize = 12;

/// Multiplies columns by coefficients and sums them.
struct WeightedSum<'a> {
    coefficients: &'a [f64; WIDEST],
    sum: &'a mut [f64; 6],
}

impl Sink for WeightedSum<'_> {
    #[inline(always)]
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64) {
        self.sum[axis.index()] += self.coefficients[coefficient] * value;
    }
}

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
    }
    adjusting {
        GroundEffect => ground_effect,
        TranslationalLift => translational_lift,
        ThrustLinear => thrust_linear,
        MotorLag => motor_lag,
        InputDelay => input_delay,
        SteadyWind => steady_wind,
        BatteryVoltage => battery_voltage,
        TrackingOffset => tracking_offset,
        AttitudeOffset => attitude_offset,
        MassChange => mass_change,
        ComOffset => com_offset,
        MotorEfficiency => motor_efficiency,
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
        CATALOGUE.iter().copied().chain(user_effect::all().into_iter().map(Effect::User))
    }

    /// Where a fit that knows nothing of the effect starts: values of the coefficients that make its shape (a length, a
    /// frequency), none for those that least squares give once the shape is known. Nothing for an effect that can
    /// start at zero.
    pub fn starts(self) -> Vec<Vec<Option<f64>>> {
        match self {
            Effect::User(user) => user.starts(),
            Effect::SlungLoad => slung_load::STARTING_LENGTHS_M
                .iter()
                .map(|length_m| vec![None, Some(*length_m), Some(slung_load::STARTING_DAMPING)])
                .collect(),
            _ => Vec::new(),
        }
    }

    /// Whether the effect is adjusting and yet adds accelerations of its own, which no column shows.
    pub fn adds_accelerations(self) -> bool {
        matches!(self, Effect::User(_) | Effect::SlungLoad) && self.info().kind == Kind::Adjusting
    }

    /// The word for it in commands, files and pages.
    pub const fn id(self) -> &'static str {
        self.info().id
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_are_unique_and_found_again() {
        for &effect in CATALOGUE {
            assert_eq!(Effect::from_id(effect.id()), Some(effect));
            assert!(!effect.info().coefficients.is_empty());
            for coefficient in effect.info().coefficients {
                assert!(coefficient.possible.0 < coefficient.possible.1 && coefficient.typical > 0.0);
            }
            for (other, manoeuvre) in effect.info().confused_with {
                assert!(!manoeuvre.is_empty());
                assert_ne!(*other, effect.id());
            }
        }
        assert_eq!(Effect::from_id("no-such-effect"), None);
    }
}
