//! What to fly next: manoeuvres of the library, each flown in simulation, ranked by what they would
//! tell us.
//!
//! Two questions. Which flight tells two effects apart: with either of them of ordinary size in the
//! craft and both in the fit, by how many standard errors does it stand out? (The noncentrality of
//! the test that it is the other one alone; the smaller of both ways counts.) And which flight
//! makes the standard error of a coefficient smallest, with what the model's file says of all of
//! them as a start?

use std::path::Path;

use diagnosis::planning::information::Parameter;
use model::{Effect, Model};
use pattern::{Multisine, Pattern};
use rayon::prelude::*;

use super::manoeuvre::{Manoeuvre, ManoeuvreError, library};
use super::predict::{Course, Foreseen, PredictError, Predictor};

/// Amplitude of the multisine beside every manoeuvre, and of a strong one, part of the command
/// range: the thesis' 15 us are 0.015.
pub const GENTLE: f64 = 0.015;
/// See [`GENTLE`].
pub const STRONG: f64 = 0.035;
/// Its band, Hz: what moves the craft and passes the regression's filter.
pub const BAND_HZ: [f64; 2] = [0.2, 5.0];
/// Manoeuvres that are also flown with a strong multisine.
const WITH_STRONG: [&str; 2] = ["hover", "tour"];
/// Standard errors from which on two effects are told apart.
pub const APART: f64 = 4.0;

/// Flights within this factor of the best tell us about as much: 1.7 times the flight time makes up
/// for it.
const ABOUT_AS_MUCH: f64 = 1.3;

/// What is wanted of the next flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Two effects told apart.
    Separate(Effect, Effect),
    /// The error of a coefficient made small.
    Shrink(Parameter),
}

/// A flight that could be next.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// Name of the manoeuvre.
    pub name: &'static str,
    /// What to fly, in words.
    pub words: &'static str,
    /// Amplitude of the multisine on the motors, command units.
    pub amplitude: f64,
    /// The flight.
    pub pattern: Pattern,
    /// How it goes.
    pub course: Course,
    /// What it would tell: standard errors between the effects (to be large), or the coefficient's
    /// error (to be small); none where it tells nothing.
    pub worth: Option<f64>,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// A flight that cannot be predicted.
    #[error(transparent)]
    Predict(#[from] PredictError),
    /// A pattern that cannot be made.
    #[error(transparent)]
    Manoeuvre(#[from] ManoeuvreError),
    /// A name that no coefficient has.
    #[error("\"{name}\" is not a coefficient of the model or of an effect it lacks; known are {known}")]
    NoCoefficient {
        /// As given.
        name: String,
        /// Those there are.
        known: String,
    },
    /// A name that several coefficients have.
    #[error("\"{name}\" is a coefficient of several effects: say which, {known}")]
    SeveralCoefficients {
        /// As given.
        name: String,
        /// Which.
        known: String,
    },
    /// An effect that cannot be planned for.
    #[error("{effect}: {why}")]
    Effect {
        /// Which.
        effect: String,
        /// Why not.
        why: &'static str,
    },
}

/// The coefficient of a name: `C_du`, or `linear-drag.C_du`.
///
/// # Errors
/// None, or several.
pub fn coefficient(predictor: &Predictor, name: &str) -> Result<Parameter, PlanError> {
    let effects = predictor.model().effects().into_iter().chain(predictor.candidates().iter().copied());
    let all: Vec<Parameter> = effects
        .flat_map(|effect| {
            (0..effect.info().coefficients.len()).map(move |index| Parameter { effect, index })
        })
        .collect();
    let long = |p: &Parameter| format!("{}.{}", p.effect, p.info().name);
    let found: Vec<&Parameter> = all.iter().filter(|p| p.info().name == name || long(p) == name).collect();
    let listed = |list: &[&Parameter]| list.iter().map(|p| long(p)).collect::<Vec<_>>().join(", ");
    match found.as_slice() {
        [one] => Ok(**one),
        [] => Err(PlanError::NoCoefficient {
            name: name.into(),
            known: listed(&all.iter().collect::<Vec<_>>()),
        }),
        several => Err(PlanError::SeveralCoefficients { name: name.into(), known: listed(several) }),
    }
}

/// Whether flights can be planned for an effect.
///
/// # Errors
/// Why not.
pub fn check_effect(predictor: &Predictor, effect: Effect) -> Result<(), PlanError> {
    let refuse = |why| Err(PlanError::Effect { effect: effect.id().into(), why });
    if effect.info().kind == model::Kind::Basic {
        return refuse("is part of every model: ask for one of its coefficients with --shrink");
    }
    if !predictor.model().has(effect) && !predictor.candidates().contains(&effect) {
        return refuse(
            "cannot be predicted: the fit of all effects absorbs it, or its fit needs a start of its own",
        );
    }
    Ok(())
}

/// Every manoeuvre, the one to fly first, the others by what they tell, and those that cannot be
/// flown so at the end. To fly is the gentlest (by its largest roll or pitch) of those that tell
/// about as much as the best.
///
/// # Errors
/// A model that cannot be flown at all.
pub fn plan(
    predictor: &Predictor,
    goal: Goal,
    duration_s: f64,
    seed: u64,
) -> Result<Vec<Proposal>, PlanError> {
    let [low, high] = predictor.config().command_range;
    let flights: Vec<(Manoeuvre, f64)> = library(duration_s, seed)
        .into_iter()
        .flat_map(|m| {
            let strong = WITH_STRONG.contains(&m.name).then(|| (m.clone(), STRONG));
            std::iter::once((m, GENTLE)).chain(strong)
        })
        .map(|(m, part)| (m, part * (high - low)))
        .collect();
    let period_s = predictor.config().sample_time_s;
    // The search for phases takes as long as several flights: once for all.
    let sines = Multisine::new(duration_s, BAND_HZ, seed).map_err(ManoeuvreError::from)?;
    let mut proposals: Vec<Proposal> = flights
        .par_iter()
        .map(|(manoeuvre, amplitude)| {
            let added = |time_s: f64| sines.at(time_s).map(|v| amplitude * v);
            let path = Path::new(manoeuvre.name);
            let pattern =
                manoeuvre.pattern_with(added, period_s, duration_s, path).map_err(ManoeuvreError::from)?;
            let foreseen = predictor.foresee(&pattern)?;
            let worth = worth(predictor, &foreseen, goal);
            let Foreseen { course, .. } = foreseen;
            let (name, words) = (manoeuvre.name, manoeuvre.words);
            Ok(Proposal { name, words, amplitude: *amplitude, pattern, course, worth })
        })
        .collect::<Result<_, PlanError>>()?;
    rank(&mut proposals, goal);
    Ok(proposals)
}

/// Sorts proposals by what they tell, those that cannot be flown so at the end, and puts the one to
/// fly first.
fn rank(proposals: &mut [Proposal], goal: Goal) {
    let key = |p: &Proposal| {
        let worth = match (goal, p.worth) {
            (Goal::Separate(..), worth) => -worth.unwrap_or(0.0),
            (Goal::Shrink(_), worth) => worth.unwrap_or(f64::INFINITY),
        };
        (p.course.trouble.is_some(), worth)
    };
    proposals.sort_by(|a, b| {
        let ((a_bad, a), (b_bad, b)) = (key(a), key(b));
        a_bad.cmp(&b_bad).then(a.total_cmp(&b))
    });
    if let Some(best) = proposals.first().and_then(|p| p.worth) {
        let as_good = |p: &&(usize, &Proposal)| {
            let near = match (goal, p.1.worth) {
                (Goal::Separate(..), Some(worth)) => {
                    worth * ABOUT_AS_MUCH >= best && (worth >= APART || best < APART)
                }
                (Goal::Shrink(_), Some(worth)) => worth <= best * ABOUT_AS_MUCH,
                (_, None) => false,
            };
            near && p.1.course.trouble.is_none()
        };
        let tilt = |p: &Proposal| p.course.tilt_rad[0].max(p.course.tilt_rad[1]);
        let all: Vec<(usize, &Proposal)> = proposals.iter().enumerate().collect();
        let gentlest = all.iter().filter(as_good).min_by(|a, b| tilt(a.1).total_cmp(&tilt(b.1)));
        if let Some(&(index, _)) = gentlest {
            proposals[..=index].rotate_right(1);
        }
    }
}

fn worth(predictor: &Predictor, foreseen: &Foreseen, goal: Goal) -> Option<f64> {
    match goal {
        Goal::Separate(a, b) => {
            let one = predictor.apart(&foreseen.information, a, b)?;
            let other = predictor.apart(&foreseen.information, b, a)?;
            Some(one.deviations.min(other.deviations))
        }
        Goal::Shrink(parameter) => {
            let model = predictor.model();
            let mut effects = model.effects();
            if !effects.contains(&parameter.effect) {
                effects.push(parameter.effect);
            }
            let expected = foreseen.information.expected(&effects).ok()?;
            expected.knowing(model).std_error(parameter)
        }
    }
}

/// Standard error in the model's file.
pub fn known_error(model: &Model, parameter: Parameter) -> Option<f64> {
    model.term(parameter.effect)?.coefficients.get(parameter.index)?.std_error
}
