//! Why an effect is supported or not: figures, turned into words where they are shown.

use std::borrow::Cow;
use std::fmt;

use model::{Axis, Coefficient, Effect, Estimate};
use report::number::{self, fixed, p_equation, significant, with_error, with_unit};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};
use sysid::FitError;

use crate::change::Change;
use crate::dependence::Dependence;
use crate::figures::{rms_fall_percent, rms_of};

/// Why an effect is supported, or why not.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// Every criterion is met.
    ErrorFalls {
        /// The axes that it acts on.
        axes: &'static [Axis],
        /// Fall of the held-out squared error over the axes that it acts on, percent.
        percent: f64,
        /// Held-out flights on which the error falls.
        improved: usize,
        /// Held-out flights.
        flights: usize,
    },
    /// Not confirmed on the flights held out, but on most where each is held out in turn.
    OnOtherSplits {
        /// Flights that, held out, find it.
        found: usize,
        /// Flights.
        of: usize,
    },
    /// Its columns are zero on these flights.
    NotExcited {
        /// What to fly.
        excitation: &'static str,
    },
    /// One of ordinary size would hide in the error of its estimate.
    HiddenByItsError {
        /// What to fly.
        excitation: &'static str,
    },
    /// Its coefficients are zero within their errors.
    LikeChance,
    /// Its fall of the error does not matter.
    TooSmall {
        /// Largest fall of an axis, percent.
        largest_percent: f64,
        /// Smallest that matters, percent.
        matters_percent: f64,
    },
    /// The error on held-out flights does not fall, or no more than by chance.
    NotBorneOut {
        /// Held-out flights on which the error falls.
        improved: usize,
        /// Held-out flights.
        flights: usize,
        /// Chance of such a gain, where it is too high.
        p_value: Option<f64>,
    },
    /// A coefficient lies outside the possible.
    Impossible {
        /// The coefficient.
        coefficient: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Smallest and largest possible value.
        possible: (f64, f64),
    },
    /// It would be a cable that ends where nothing can hold it.
    NoAnchor {
        /// North, east, down, m.
        place_ned_m: [f64; 3],
    },
    /// A rotor that leans would yaw the craft by its lever times its push.
    YawWithoutPush,
    /// The torque of a motor has changed by the same fraction as its thrust.
    AlikeThrust,
    /// A rotor that leans would push the craft sideways.
    YawAlone,
    /// A rotor that leans along its arm only pushes, which other causes do as well.
    PushWithoutYaw,
    /// Its estimates miss what its own file asks of them.
    OwnRule {
        /// The effect.
        effect: Effect,
        /// Its first coefficient.
        first: Estimate,
    },
    /// With an effect of the actuators in place, the residual still follows what the rotors did before.
    AnswersLate,
    /// With it, the residual of its main axis stays above the sensors' noise.
    AboveNoise {
        /// Its main axis.
        axis: Axis,
    },
    /// With it, more structure is left than it takes away.
    LeavesMore {
        /// What it takes away, percent of the axis' error.
        takes_percent: f64,
        /// What is left.
        left_percent: f64,
        /// Where it is left.
        axis: Axis,
        /// What the rest depends on.
        depends_on: Dependence,
    },
    /// Promising linearised, and not when it was fitted exactly.
    OnlyLinearised,
    /// Supported by itself, and not together with what else was found.
    OnlyByItself,
    /// The flights support it, but a fit of the whole model with it does not come to an end.
    NotFittedTogether(FitError),
    /// Supported, but the model with it predicts held-out flights worse.
    MakesWorse {
        /// Held-out flights on which the error falls.
        improved: usize,
        /// Held-out flights.
        flights: usize,
    },
    /// A load that swings too seldom to be told from a drift.
    TooFewSwings {
        /// Swings in the longest stretch.
        swings: f64,
        /// What to fly.
        excitation: &'static str,
    },
    /// A load that explains only what is quicker than it swings.
    QuickerThanItsSwing {
        /// The frequency up to which a load explains what the craft does, Hz.
        up_to_hz: f64,
        /// Fall of the squared error up to there, percent.
        drop_percent: f64,
    },
    /// Rows at low frequency do not show it, and contradict those that have it.
    NotAtLowFrequency {
        /// How much of it they show, percent of what all rows have.
        part_percent: f64,
        /// p-value of "it is as in all rows".
        p_value: f64,
    },
    /// It takes error from some axes and adds as much or more to another.
    HarmsAxis {
        /// The axis.
        axis: Axis,
        /// Rise of its held-out squared error, percent.
        percent: f64,
    },
    /// Supported by itself, and worth nothing once others are in the model.
    AddsNothing {
        /// The others.
        beside: Vec<Effect>,
    },
    /// It does as well in the place of an effect that was found.
    Confounded {
        /// The effect that was found.
        with: Effect,
        /// What to fly to tell them apart, where it is known.
        separate: Option<&'static str>,
    },
    /// It could not be fitted.
    Refused(FitError),
    /// As a change, it does not stand out from what flights differ by anyway.
    WithinScatter {
        /// Chance of such a change.
        p_value: f64,
    },
    /// As a change, it is worth nothing once another has been accounted for.
    ExplainedBy {
        /// The other.
        other: Change,
    },
    /// As a change, it is a moment in a wind that is stronger than any that the model's flights have shown.
    MomentOfWind,
    /// As a change, it leaves more of these flights unexplained than another one.
    ExplainsLess {
        /// The other.
        than: Change,
        /// The axis on which it leaves most.
        axis: Axis,
        /// How much more of the axis' squared error it leaves, percent.
        percent: f64,
    },
    /// As a change, it explains the flights as well as the best one.
    RivalOf {
        /// The best.
        best: Change,
    },
    /// As a change, every criterion is met.
    Changed {
        /// The axes that it acts on.
        axes: &'static [Axis],
        /// Fall of the squared error on flights it was not estimated from, percent.
        percent: f64,
        /// Changes that explain the flights as well.
        rivals: Vec<Change>,
    },
    /// As a change, it explains how the rotors share the work in steady flight.
    BalanceShifted {
        /// Fall of the squared shift on flights it was not estimated from, percent.
        percent: f64,
        /// Changes that explain the shift as well.
        rivals: Vec<Change>,
    },
    /// The flights do not determine the rows that it acts on.
    NotJudged,
}

impl Reason {
    /// Whether its words name the effects that it is confounded with.
    pub fn names_rivals(&self) -> bool {
        match self {
            Self::Confounded { .. } | Self::RivalOf { .. } => true,
            Self::Changed { rivals, .. } | Self::BalanceShifted { rivals, .. } => !rivals.is_empty(),
            _ => false,
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ErrorFalls { axes, percent, improved, flights } => {
                let (rms, fall) = (rms_of(axes), number::percent(rms_fall_percent(*percent)));
                write!(f, "the held-out {rms} falls by {fall} %, in {improved} of {flights} flights")
            }
            Self::NotExcited { excitation } => {
                write!(f, "these flights do not excite it; to see it: {excitation}")
            }
            Self::HiddenByItsError { excitation } => write!(
                f,
                "these flights do not excite it enough: an effect of typical size would not show; to see it: {excitation}"
            ),
            Self::LikeChance => f.write_str("its coefficients do not differ significantly from zero"),
            Self::TooSmall { largest_percent, .. } if *largest_percent <= 0.0 => {
                f.write_str("it predicts no axis of the held-out flights better")
            }
            Self::TooSmall { largest_percent, matters_percent } => write!(
                f,
                "too small to matter: at best, the held-out squared error of an axis falls by {} %, and {} % is \
                 needed",
                number::percent(*largest_percent),
                number::percent(*matters_percent)
            ),
            Self::Impossible { coefficient, value, unit, possible: (low, high) } => write!(
                f,
                "needs {coefficient} = {}, outside the physically possible range {low} to {high}",
                with_unit(&significant(*value, 3), unit)
            ),
            Self::NoAnchor { place_ned_m } => write_no_anchor(f, *place_ned_m),
            Self::OwnRule { effect, first } => {
                let info = effect.info();
                let objection = info.special.requirement.map_or("", |rule| rule.objection);
                let Coefficient { name, unit, .. } = info.coefficients[0];
                let found = with_error(first.value, first.std_error.unwrap_or(0.0), unit);
                write!(f, "{objection}: {name} = {found}")
            }
            Self::AnswersLate | Self::AboveNoise { .. } | Self::LeavesMore { .. } => self.write_stand_in(f),
            Self::OnOtherSplits { .. }
            | Self::NotBorneOut { .. }
            | Self::HarmsAxis { .. }
            | Self::TooFewSwings { .. }
            | Self::QuickerThanItsSwing { .. }
            | Self::NotAtLowFrequency { .. } => self.write_of_flights(f),
            Self::OnlyLinearised
            | Self::NotFittedTogether(_)
            | Self::MakesWorse { .. }
            | Self::OnlyByItself
            | Self::AddsNothing { .. }
            | Self::Confounded { .. } => self.write_beside_others(f),
            Self::Refused(refused) => refused.fmt(f),
            _ => self.write_of_change(f),
        }
    }
}

/// Where a cable would end that nothing can hold.
fn write_no_anchor(f: &mut fmt::Formatter<'_>, place_ned_m: [f64; 3]) -> fmt::Result {
    let [north, east, down] = place_ned_m.map(|metres| fixed(metres, 1));
    write!(f, "the cable would end where nothing can hold it: {north} m north, {east} m east, {down} m down")
}

impl Reason {
    /// Whether the effect explains part of the error, and was taken for a stand-in of something unknown.
    pub(crate) fn is_stand_in(&self) -> bool {
        matches!(self, Self::AnswersLate | Self::AboveNoise { .. } | Self::LeavesMore { .. })
    }

    /// What the flights say of an effect that is certain on those of the fit.
    fn write_of_flights(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OnOtherSplits { found, of } => write!(
                f,
                "the held-out flights do not show it, but when each of the {of} flights is held out in turn, {found} of them do"
            ),
            Self::NotBorneOut { improved, flights, p_value } => {
                write!(f, "not confirmed on held-out flights ({improved} of {flights} improve")?;
                p_value.map_or(Ok(()), |p| write!(f, ", {}", p_equation(p)))?;
                f.write_str(")")
            }
            Self::HarmsAxis { axis, percent } => write!(
                f,
                "with it, the held-out rms error of {axis} rises by {} %",
                number::percent(-rms_fall_percent(-percent))
            ),
            Self::TooFewSwings { swings, excitation } => write!(
                f,
                "it would swing only {} times in the longest flight, where a slow drift looks the same; to see it, fly longer: \
                 {excitation}",
                fixed(*swings, 1)
            ),
            Self::QuickerThanItsSwing { up_to_hz, drop_percent } => write!(
                f,
                "it lowers the error only at frequencies above {} Hz, where noise of the tracker looks the same; at its swing and below, \
                 the held-out rms error of u and v {} by {} %",
                fixed(*up_to_hz, 2),
                if *drop_percent > 0.0 { "falls only" } else { "rises" },
                number::percent(rms_fall_percent(*drop_percent).abs())
            ),
            Self::NotAtLowFrequency { part_percent, p_value } => write!(
                f,
                "only {} % of it shows at low frequency ({}); at higher frequencies, gyro noise fed back by the controller looks the same",
                number::percent(part_percent.max(0.0)),
                p_equation(*p_value)
            ),
            _ => Ok(()),
        }
    }

    /// Why an effect is taken for a stand-in.
    fn write_stand_in(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AnswersLate => write!(
                f,
                "{STAND_IN}: with it, the residual still depends on what the rotors did in the last half second"
            ),
            Self::AboveNoise { axis } => {
                write!(
                    f,
                    "{STAND_IN}: with it, the residual of {axis} is still well above the sensors' noise"
                )
            }
            Self::LeavesMore { takes_percent, left_percent, axis, depends_on } => write!(
                f,
                "{STAND_IN}: it explains {} % of the squared error, and the rest of {axis} {} ({} % of it)",
                number::percent(*takes_percent),
                depends_on.predicate(),
                number::percent(*left_percent)
            ),
            _ => Ok(()),
        }
    }

    /// What became of an effect that does well by itself.
    fn write_beside_others(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OnlyLinearised => {
                f.write_str("promising by itself in a linearised fit, but an exact fit does not support it")
            }
            Self::MakesWorse { improved, flights } => write!(
                f,
                "the model with it predicts held-out flights worse (better in {improved} of {flights} flights)"
            ),
            Self::NotFittedTogether(why) => {
                write!(f, "it lowers the held-out error, but the whole model with it cannot be fitted: {why}")
            }
            Self::OnlyByItself => f.write_str(
                "supported by itself, but not together with the other effects that these flights show",
            ),
            Self::AddsNothing { beside } => {
                let verb = if beside.len() == 1 { "is" } else { "are" };
                write!(f, "adds nothing once {} {verb} in the model", joined(beside, " and "))
            }
            Self::Confounded { with, separate } => {
                write!(f, "these flights cannot tell it from {with}")?;
                separate.map_or(Ok(()), |how| write!(f, "; to separate them: {how}"))
            }
            _ => Ok(()),
        }
    }

    /// What is said of changes alone.
    fn write_of_change(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AlikeThrust => f.write_str(
                "it has changed by the same fraction as the thrust of this motor: one change, named as motor-efficiency",
            ),
            Self::YawAlone => f.write_str("no sideways push shows: a yaw alone is a change of torque"),
            Self::YawWithoutPush => f.write_str("its yaw does not fit a sideways push at that motor"),
            Self::PushWithoutYaw => f.write_str(
                "it is a sideways push alone, and the model leaves the translation of its own flights unexplained",
            ),
            Self::WithinScatter { p_value } => {
                write!(f, "within the noise and the usual scatter between flights ({})", p_equation(*p_value))
            }
            Self::ExplainedBy { other } => write!(f, "adds nothing once {other} is accounted for"),
            Self::MomentOfWind => f.write_str(
                "the wind is faster than the air was in the model's flights, and the moment it exerts on the craft looks the same",
            ),
            Self::ExplainsLess { than, axis, percent } => {
                let more = number::percent(-rms_fall_percent(-*percent));
                write!(f, "explains less than {than}: with it, the rms error of {axis} is {more} % larger")
            }
            Self::RivalOf { best } => write!(f, "these flights cannot tell it from {best}"),
            Self::Changed { axes, percent, rivals } => {
                let (rms, fall) = (rms_of(axes), number::percent(rms_fall_percent(*percent)));
                write!(f, "the {rms} on flights it was not estimated from falls by {fall} %")?;
                match rivals.is_empty() {
                    true => Ok(()),
                    false => write!(f, "; these flights cannot tell it from {}", joined(rivals, ", ")),
                }
            }
            Self::BalanceShifted { percent, rivals } => {
                let fall = number::percent(*percent);
                write!(f, "it explains {fall} % of the squared shift in the rotors' steady balance")?;
                match rivals.is_empty() {
                    true => Ok(()),
                    false => write!(f, "; these flights cannot tell it from {}", joined(rivals, ", ")),
                }
            }
            Self::NotJudged => {
                f.write_str("the model's rotation is not identified, so this cannot be judged")
            }
            _ => Ok(()),
        }
    }
}

/// How every reason begins that takes an effect for a stand-in.
const STAND_IN: &str = "probably a stand-in for another effect";

/// Names in a row.
pub(crate) fn joined<T: fmt::Display>(all: &[T], between: &str) -> String {
    all.iter().map(T::to_string).collect::<Vec<_>>().join(between)
}

impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl JsonSchema for Reason {
    fn schema_name() -> Cow<'static, str> {
        "Reason".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "description": "Why an effect is supported or not, in words." })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_sentences_with_their_figures() {
        let left = Reason::LeavesMore {
            takes_percent: 9.0,
            left_percent: 12.0,
            axis: Axis::W,
            depends_on: Dependence::Oscillation { frequency_hz: 0.7 },
        };
        let expected = "probably a stand-in for another effect: it explains 9.0 % of the squared error, and the rest of w shows an \
                        oscillation at 0.70 Hz (12.0 % of it)";
        assert_eq!(left.to_string(), expected);
        let beside = Reason::AddsNothing { beside: vec![Effect::Tether, Effect::SteadyWind] };
        assert_eq!(beside.to_string(), "adds nothing once tether and steady-wind are in the model");
        let small = |largest_percent| Reason::TooSmall { largest_percent, matters_percent: 1.5 }.to_string();
        assert!(small(1.2).ends_with("of an axis falls by 1.2 %, and 1.5 % is needed"), "{}", small(1.2));
        assert_eq!(small(-583.4), "it predicts no axis of the held-out flights better");
        let p_value = Some(0.3);
        let refuted = Reason::NotBorneOut { improved: 1, flights: 2, p_value };
        assert_eq!(refuted.to_string(), "not confirmed on held-out flights (1 of 2 improve, p = 0.300)");
    }

    /// An error that becomes half as large has a quarter of its square.
    #[test]
    fn the_fall_that_is_told_is_that_of_the_rms() {
        let falls = |axes| Reason::ErrorFalls { axes, percent: 75.0, improved: 2, flights: 3 }.to_string();
        assert_eq!(falls(&[Axis::W]), "the held-out rms error of w falls by 50.0 %, in 2 of 3 flights");
        assert!(
            falls(&[Axis::U, Axis::V, Axis::W]).starts_with("the held-out rms error of u, v and w falls")
        );
        assert!(falls(&model::AXES).starts_with("the held-out rms error of all axes falls"));
    }

    #[test]
    fn rivals_are_named_once() {
        let best = Change { effect: Effect::MotorEfficiency, motor: Some(2) };
        assert!(Reason::RivalOf { best }.names_rivals());
        let changed = |rivals: Vec<Change>| Reason::Changed { axes: &[Axis::W], percent: 50.0, rivals };
        assert!(!changed(Vec::new()).names_rivals());
        assert!(changed(vec![best]).names_rivals());
        assert!(changed(vec![best]).to_string().ends_with("cannot tell it from motor-efficiency of motor 2"));
    }
}
