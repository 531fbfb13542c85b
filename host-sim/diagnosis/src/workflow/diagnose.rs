//! Which physical effect is missing from a model? And why, or why not, one of them?

use model::{Axis, Effect, GROUPS, Group, Model, NotIdentified};
use report::number::fixed;
use sysid::{FaultKind, Prepared, Residuals, errors, residuals};

use crate::conclusion::conclude;
use crate::criteria::{LEFT_BY_OWN_WINDS, LEFT_BY_OWN_WINDS_ALONE};
use crate::dependence::Dependence;
use crate::finding::{EffectFinding, supported};
use crate::not_logged::not_told;
use crate::observer::Observer;
use crate::options::{SLOW_S, SLOWER_S};
use crate::other_splits::or_by_other_splits;
use crate::workflow::error::WorkflowError;
use crate::workflow::headings::warn_of_one_heading;
use crate::workflow::loaded::names;
use crate::workflow::sets::FlightSets;
use crate::workflow::unlike_rotors::unlike_rotors;
use crate::{Diagnosis, Options, Verdict, Why, diagnose_with};

/// Diagnoses a model on flights; `effects` are users' own that may join it.
pub fn diagnose(
    model: &Model,
    effects: &[Effect],
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    sets.hold_against(model, effects, observer)?;
    let mut diagnosis = search(model, sets, options, observer)?;
    warn_of_one_heading(&supported(&diagnosis.effects), sets, observer);
    let rotation = diagnosis.verdicts.rotation;
    // Beside a moment that is missing, they say nothing of the motors.
    diagnosis.rotors = sets.compare_rotors(model).filter(|_| rotation != Verdict::MissingEffect);
    let nothing = diagnosis.best().is_none();
    diagnosis.summary.push_str(&unlike_rotors(diagnosis.rotors.as_ref(), rotation, nothing));
    Ok(diagnosis)
}

/// The evidence for and against one effect, missing from the model or in it.
pub fn why(
    model: &Model,
    effect: Effect,
    effects: &[Effect],
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Why, WorkflowError> {
    sets.hold_against(model, effects, observer)?;
    crate::why(model, effect, &sets.train(), &sets.validate(), options, observer)
        .map_err(|why| WorkflowError::of_why(why, names(sets.training.loaded())))
}

/// Diagnoses on flights whose clocks and trim are set. Where forces stay unexplained, each flight gets its own wind, if that
/// explains them, and else one that wanders. Its own wind it gets as well where that leaves far less of the horizontal forces than the
/// effect that was found ([`LEFT_BY_OWN_WINDS`]), or than the model where nothing was found ([`LEFT_BY_OWN_WINDS_ALONE`]).
pub(crate) fn search(
    model: &Model,
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    sets.follow_gusts(model);
    if sets.has_own_winds() {
        return search_in_own_winds(model, sets, options, observer);
    }
    let found = search_in_one_wind(model, sets, options, observer)?;
    let is_explained = |diagnosis: &Diagnosis| diagnosis.verdicts.translation != Verdict::Unexplained;
    let rival = Rival::of(&found).or_else(|| {
        let is_hidden = is_explained(&found) && found.best().is_none();
        is_hidden.then(|| Rival::nothing(&found, model, &sets.validate())).flatten()
    });
    if sets.has_weather() || (is_explained(&found) && rival.is_none()) {
        return Ok(found);
    }
    if let Some(windy) = sets.find_weather(model) {
        let is_less = |rival: &Rival| rival.leaves_more_than(&windy, &sets.validate());
        let beats_what_was_found = rival.as_ref().is_some_and(is_less);
        if beats_what_was_found || !is_explained(&found) {
            let in_own_winds = search_in_own_winds(model, sets, options, observer)?;
            if beats_what_was_found || is_explained(&in_own_winds) {
                sets.tell_weather();
                return Ok(in_own_winds);
            }
        }
        sets.forget_weather();
    }
    if is_explained(&found) {
        return Ok(found);
    }
    let is_left = |diagnosis: &Diagnosis| {
        diagnosis.unexplained.iter().any(|left| matches!(left.axis, Axis::U | Axis::V))
    };
    if is_left(&found) && sets.find_gusts(model) {
        let in_gusts = search_in_one_wind(model, sets, options, observer)?;
        // Whatever else is found, nothing may be left of the axes that tell the wind.
        if is_explained(&in_gusts) && !is_left(&in_gusts) {
            sets.tell_gusts();
            return Ok(in_gusts);
        }
        sets.forget_gusts();
    }
    Ok(found)
}

/// Diagnoses on flights in winds of their own: in those that they have beside a drag that only they reveal, where that is found.
fn search_in_own_winds(
    model: &Model,
    sets: &mut FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    if let Some(fair) = sets.reveal(model, options) {
        let Diagnosis { mut effects, unexplained, not_identified, .. } =
            search_in_one_wind(model, sets, options, observer)?;
        let is_named = |finding: &&mut EffectFinding| finding.supported && finding.effect == fair.effect;
        if let Some(finding) = effects.iter_mut().find(is_named) {
            // In the winds beside it, what is left without it says too much for it.
            *finding = fair;
            sets.tell_weather();
            return Ok(conclude(effects, unexplained, not_identified));
        }
        sets.conceal();
    }
    search_in_one_wind(model, sets, options, observer)
}

/// What was found of the horizontal forces, and would have to be beaten by a wind of each flight.
struct Rival {
    /// The axes along which the best effect acts, of u and v.
    axes: Vec<Axis>,
    /// Most that winds may leave of the held-out sum of squares along them, in the same unit.
    most: f64,
}

impl Rival {
    fn of(diagnosis: &Diagnosis) -> Option<Self> {
        let best = diagnosis.best()?;
        let finding = diagnosis.effects.iter().find(|finding| finding.effect == best)?;
        let along = |axis: &Axis| finding.axes.get(axis.name());
        let axes: Vec<Axis> = [Axis::U, Axis::V].into_iter().filter(|axis| along(axis).is_some()).collect();
        let left: f64 = axes.iter().filter_map(along).map(|drop| drop.sse_after).sum();
        (!axes.is_empty()).then_some(Self { axes, most: LEFT_BY_OWN_WINDS * left })
    }

    /// Nothing was found, but something is left along horizontal axes: where they are not identified, winds would stay hidden.
    fn nothing(diagnosis: &Diagnosis, model: &Model, flights: &[&Prepared]) -> Option<Self> {
        let is_left = |axis: &Axis| diagnosis.unexplained.iter().any(|left| left.axis == *axis);
        let axes: Vec<Axis> = [Axis::U, Axis::V].into_iter().filter(is_left).collect();
        let left = squares_left(model, &axes, flights);
        (!axes.is_empty()).then_some(Self { axes, most: LEFT_BY_OWN_WINDS_ALONE * left })
    }

    /// Whether winds of the flights' own leave far less.
    fn leaves_more_than(&self, windy: &Model, flights: &[&Prepared]) -> bool {
        squares_left(windy, &self.axes, flights) < self.most
    }
}

/// Sum of squares along some axes that a model leaves of flights.
fn squares_left(model: &Model, axes: &[Axis], flights: &[&Prepared]) -> f64 {
    let left: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, model)).collect();
    let errors = errors(&left);
    axes.iter().map(|axis| errors[*axis].sse).sum()
}

fn search_in_one_wind(
    model: &Model,
    sets: &FlightSets,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    let (train, validate) = (sets.train(), sets.validate());
    let options = &match sets.faults.has(FaultKind::UnderSampled) {
        true => options.without_quick(),
        false => options.clone(),
    };
    let mut diagnosis = diagnose_with(model, &train, &validate, options, observer)
        .and_then(|found| or_by_other_splits(found, model, &[train, validate].concat(), options, observer))
        .map_err(|why| WorkflowError::of_search(why, names(sets.training.loaded())))?;
    diagnosis.not_identified.extend(sets.faults.not_identified());
    diagnosis.not_identified.extend(not_in_the_log(&diagnosis, &sets.train()));
    let all: Vec<&Prepared> = sets.all().map(|flight| &flight.prepared).collect();
    diagnosis.not_identified.extend(not_told(&diagnosis.unexplained, &all, &model.vehicle));
    let Diagnosis { effects, unexplained, not_identified, .. } = diagnosis;
    Ok(conclude(effects, unexplained, not_identified))
}

/// A rotation that answers to the past in a slow or interpolated log answers to what happened between its rows, and so do forces that
/// answer to it; where the rows are further apart, all forces do. In smoothed rates it is the rotation alone.
fn not_in_the_log(diagnosis: &Diagnosis, flights: &[&Prepared]) -> Vec<NotIdentified> {
    let answers_to_the_past = |group: &Group| {
        let left = &diagnosis.unexplained;
        left.iter().any(|u| Group::of(u.axis) == *group && u.depends_on == Dependence::Past)
    };
    if !answers_to_the_past(&Group::Rotation) {
        return Vec::new();
    }
    let period_s = flights.iter().map(|flight| flight.period_s).fold(0.0, f64::max);
    let faster = "log at 100 Hz or more";
    let (why, excitation, groups): (String, _, Vec<Group>) = if flights.iter().any(|f| f.is_interpolated) {
        let why =
            "the log is interpolated: the craft also responds to what happened between the original rows";
        (why.into(), faster, GROUPS.to_vec())
    } else if period_s > SLOW_S {
        let why = format!(
            "the motor commands are under-sampled at {} Hz: the craft also responds to those between the rows",
            fixed(1.0 / period_s, 0)
        );
        let is_unknown = |group: &Group| period_s > SLOWER_S || answers_to_the_past(group);
        (why, faster, GROUPS.into_iter().filter(is_unknown).collect())
    } else if flights.iter().any(|flight| flight.has_derived_rates) {
        let why = "the body rates are smoothed derivatives of the attitude and lack the fast rotation";
        (why.into(), "log gyro rates", vec![Group::Rotation])
    } else {
        return Vec::new();
    };
    let of = |group: Group| NotIdentified {
        leaves_findings: true,
        ..NotIdentified::of_group(group, why.clone(), excitation)
    };
    groups.into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use flights::Flight;

    use super::*;
    use crate::finding::Unexplained;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent, identify};

    struct Stopping;

    impl Observer for Stopping {
        fn is_cancelled(&self) -> bool {
            true
        }
    }

    fn sets() -> FlightSets {
        let flown = |seed| fly(&truth(), seed, 4.0, &ORDINARY);
        let (train, validate) = ([flown(1), flown(2)], [flown(3)]);
        let vehicle = truth().vehicle;
        FlightSets::from_flights(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap()
    }

    #[test]
    fn a_cancelled_search_has_no_conclusion() {
        let stopped = diagnose(&truth(), &[], &mut sets(), &Options::default(), &Stopping);
        assert!(matches!(stopped, Err(WorkflowError::Cancelled)));
    }

    /// The basic model is what everything is told from.
    #[test]
    fn an_effect_that_cannot_be_missing_is_not_asked_about() {
        let asked = why(&truth(), Effect::Thrust, &[], &mut sets(), &Options::default(), &Silent);
        assert!(matches!(asked, Err(WorkflowError::Why(crate::WhyError::Basic(Effect::Thrust)))));
    }

    fn flown_as(effect: Effect, values: &[f64], seed: u64) -> Flight {
        let mut model = truth();
        model.set(effect, values);
        fly(&model, seed, 10.0, &ORDINARY)
    }

    fn diagnosed(train: &[Flight], validate: &[Flight]) -> (Diagnosis, FlightSets) {
        let vehicle = truth().vehicle;
        let mut sets =
            FlightSets::from_flights(train, validate, &vehicle, Reading::default(), &Silent).unwrap();
        let basic = identify(&vehicle, &[], &mut sets, None, &Silent).unwrap().model;
        let found = diagnose(&basic, &[], &mut sets, &Options::default(), &Silent).unwrap();
        (found, sets)
    }

    /// The same residual in logs of several kinds.
    #[test]
    fn what_a_log_lacks_is_said_of_the_groups_that_answer_to_it() {
        let flown = Prepared::new(&fly(&truth(), 1, 4.0, &ORDINARY), &truth().vehicle).unwrap();
        let unknown = |axes: &[Axis], period_s: f64, has_derived_rates: bool, is_interpolated: bool| {
            let left = |axis: &Axis| Unexplained {
                axis: *axis,
                depends_on: Dependence::Past,
                share_percent: 20.0,
                p_value: 0.0,
            };
            let diagnosis = conclude(Vec::new(), axes.iter().map(left).collect(), Vec::new());
            let flight = Prepared { period_s, has_derived_rates, is_interpolated, ..flown.clone() };
            let of = not_in_the_log(&diagnosis, &[&flight]);
            of.into_iter().map(|unknown| unknown.group).collect::<Vec<Group>>()
        };
        let (both, rotation) = ([Axis::W, Axis::P], [Axis::P]);
        assert_eq!(unknown(&both, 0.01, false, false), []);
        assert_eq!(unknown(&[Axis::W], 0.04, true, true), [], "the rotation does not answer to the past");
        assert_eq!(unknown(&both, 0.01, true, false), [Group::Rotation]);
        assert_eq!(unknown(&both, 0.02, false, false), GROUPS);
        assert_eq!(unknown(&rotation, 0.02, false, false), [Group::Rotation]);
        assert_eq!(unknown(&rotation, 0.04, false, false), GROUPS);
        assert_eq!(unknown(&rotation, 0.01, true, true), GROUPS);
    }

    /// The basic model takes in a motor that is weak in all flights: nothing is missing from its rotation, but it is told.
    #[test]
    fn a_motor_that_is_weak_in_all_flights_is_told() {
        let mut world = truth();
        let moments = [0.6, 0.54, 0.6, 0.6, 0.5, 0.45, 0.5, 0.5, 0.3, -0.27, 0.3, -0.3];
        world.set(Effect::RotorMoments, &moments);
        let flights: Vec<Flight> = (1..6).map(|seed| fly(&world, seed, 20.0, &ORDINARY)).collect();
        let (found, _) = diagnosed(&flights[..3], &flights[3..]);
        let weak = found.rotors.as_ref().and_then(|rotors| rotors.different_motor).map(|weak| weak.motor);
        assert_eq!(weak, Some(2), "{}", found.summary);
        assert!(found.summary.contains("motor 2 gives"), "{}", found.summary);
    }

    /// Nothing of the craft is missing where each flight has a wind of its own.
    #[test]
    fn flights_in_winds_of_their_own_are_each_given_theirs() {
        let winds = [[1.5, 0.2], [-1.0, 0.8], [0.1, -1.2], [-0.5, -1.0], [1.0, 1.0]];
        let flights: Vec<Flight> =
            (1..6).map(|seed| flown_as(Effect::SteadyWind, &winds[seed - 1], seed as u64)).collect();
        let (found, sets) = diagnosed(&flights[..3], &flights[3..]);
        assert_eq!(found.best(), None, "{}", found.summary);
        assert!(sets.faults.has(FaultKind::WindBetweenFlights), "{}", found.summary);
    }
}
