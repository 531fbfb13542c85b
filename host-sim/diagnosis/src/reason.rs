//! Why an effect is supported or not, and what a residual depends on: figures, turned into words where they are shown.

use std::fmt;

use model::{Axis, Effect, Estimate};
use serde::{Serialize, Serializer};
use sysid::FitError;

use crate::change::Change;

/// What the residual of an axis depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Dependence {
    /// Nothing measured: it is off by a constant.
    Constant,
    /// A measured quantity, by the name of its condition.
    Quantity(&'static str),
    /// What the axis was predicted to do shortly before.
    Past,
    /// Nothing measured: it oscillates.
    Oscillation {
        /// Frequency, Hz.
        frequency_hz: f64,
    },
    /// Nothing measured: it changes slowly.
    SlowChanges,
}

impl Dependence {
    /// The name of the measured quantity, where it is one.
    pub fn quantity(self) -> Option<&'static str> {
        match self {
            Self::Quantity(name) => Some(name),
            _ => None,
        }
    }
}

impl fmt::Display for Dependence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant => f.write_str("constant offset"),
            Self::Quantity(name) => f.write_str(name),
            Self::Past => f.write_str("accelerations of the last half second"),
            Self::Oscillation { frequency_hz } => write!(f, "an oscillation at {frequency_hz:.2} Hz"),
            Self::SlowChanges => f.write_str("slow changes in time"),
        }
    }
}

/// Why an effect is supported, or why not.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// Every criterion is met.
    ErrorFalls {
        /// Fall of the held-out squared error over the axes that it acts on, percent.
        percent: f64,
        /// Held-out flights on which the error falls.
        improved: usize,
        /// Held-out flights.
        flights: usize,
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
    /// Its estimates miss what its own file asks of them.
    OwnRule {
        /// The effect.
        effect: Effect,
        /// Its coefficients.
        estimates: Vec<Estimate>,
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
    /// As a change, its fall of the error does not matter.
    TooSmallChange {
        /// Largest fall of an axis, percent.
        largest_percent: f64,
    },
    /// As a change, it does not lower the error of the flights it was not estimated from.
    NotCarriedOver {
        /// Flights on which the error falls.
        improved: usize,
        /// Flights.
        flights: usize,
    },
    /// As a change, it needs a coefficient outside the possible.
    ImpossibleChange {
        /// The coefficient.
        coefficient: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// As a change, it is worth nothing once another has been accounted for.
    ExplainedBy {
        /// The other.
        other: Change,
    },
    /// As a change, it explains the flights as well as the best one.
    RivalOf {
        /// The best.
        best: Change,
    },
    /// As a change, every criterion is met.
    Changed {
        /// Fall of the squared error on flights it was not estimated from, percent.
        percent: f64,
        /// Changes that explain the flights as well.
        rivals: Vec<Change>,
    },
}

impl Reason {
    /// Whether its words name the effects that it is confounded with.
    pub fn names_rivals(&self) -> bool {
        match self {
            Self::Confounded { .. } | Self::RivalOf { .. } => true,
            Self::Changed { rivals, .. } => !rivals.is_empty(),
            _ => false,
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ErrorFalls { percent, improved, flights } => {
                write!(f, "held-out error falls by {percent:.1} % in {improved} of {flights} flights")
            }
            Self::NotExcited { excitation } => {
                write!(f, "not excited by these flights; to see it: {excitation}")
            }
            Self::HiddenByItsError { excitation } => write!(
                f,
                "not excited: one of ordinary size would not show in these flights; to see it: {excitation}"
            ),
            Self::LikeChance => f.write_str("its coefficients do not differ from zero by more than chance"),
            Self::TooSmall { largest_percent, matters_percent } => write!(
                f,
                "too small to matter: {largest_percent:.1} % of the held-out error at best, under the \
                 {matters_percent:.1} % that matters"
            ),
            Self::NotBorneOut { improved, flights, p_value } => {
                write!(f, "held-out flights do not bear it out ({improved} of {flights} improve")?;
                match p_value {
                    Some(p) => write!(f, ", p = {p:.2})"),
                    None => f.write_str(")"),
                }
            }
            Self::Impossible { coefficient, value, unit, possible: (low, high) } => {
                write!(f, "needs {coefficient} = {value:.3} {unit}, outside the possible {low} to {high}")
            }
            Self::OwnRule { effect, estimates } => {
                let objection = effect.info().special.requirement.map(|rule| (rule.objection)(estimates));
                f.write_str(&objection.unwrap_or_default())
            }
            Self::AnswersLate => f.write_str(
                "a stand-in at best: with it, what is left still follows what the rotors did in the last half second, which \
                 the right effect would have taken away",
            ),
            Self::AboveNoise { axis } => write!(
                f,
                "a stand-in at best: with it, what is left in {axis} is still well above the sensors' noise, which the \
                 right effect would leave"
            ),
            Self::LeavesMore { takes_percent, left_percent, axis, depends_on } => write!(
                f,
                "a stand-in at best: it takes {takes_percent:.1} %, and {left_percent:.1} % of what is left in {axis} \
                 depends on the {depends_on}"
            ),
            Self::OnlyLinearised => {
                f.write_str("promising by itself in a linearised fit, and not supported by an exact one")
            }
            Self::OnlyByItself => {
                f.write_str("supported by itself, and not with what else these flights show")
            }
            Self::AddsNothing { beside } => {
                write!(f, "adds nothing once {} is in the model", joined(beside, " and "))
            }
            Self::Confounded { with, separate } => {
                write!(f, "these flights cannot tell it from {with}")?;
                separate.map_or(Ok(()), |how| write!(f, "; to separate them: {how}"))
            }
            Self::Refused(refused) => refused.fmt(f),
            Self::WithinScatter { p_value } => write!(
                f,
                "does not stand out from noise and the scatter between flights (p = {p_value:.2})"
            ),
            Self::TooSmallChange { largest_percent } => {
                write!(f, "too small to matter: {largest_percent:.1} % of the error at best")
            }
            Self::NotCarriedOver { improved, flights } => {
                write!(f, "does not carry over from flight to flight ({improved} of {flights} improve)")
            }
            Self::ImpossibleChange { coefficient, value, unit } => {
                write!(f, "needs {coefficient} = {value:.3} {unit}, which is impossible")
            }
            Self::ExplainedBy { other } => write!(f, "adds nothing once {other} is accounted for"),
            Self::RivalOf { best } => write!(f, "these flights cannot tell it from {best}"),
            Self::Changed { percent, rivals } => {
                write!(f, "error on flights it was not estimated from falls by {percent:.1} %")?;
                match rivals.is_empty() {
                    true => Ok(()),
                    false => write!(f, "; these flights cannot tell it from {}", joined(rivals, ", ")),
                }
            }
        }
    }
}

/// Names in a row.
pub(crate) fn joined<T: fmt::Display>(all: &[T], between: &str) -> String {
    all.iter().map(T::to_string).collect::<Vec<_>>().join(between)
}

impl Serialize for Dependence {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Serialize for Reason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
