//! The model was good once: what has changed since? And why, or why not, one change?

use std::fmt::Write;

use model::{Effect, Model};
use sysid::checks::vehicle::Likeness;
use sysid::{Fault, FaultKind, Reference, Severity};

use crate::change::{Change, WIND};
use crate::change_evidence::changes_of;
use crate::constant_force;
use crate::motor_answers;
use crate::observer::Observer;
use crate::tracker_mount;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::names;
use crate::workflow::own_winds::is_better;
use crate::workflow::sets::FlightsOfOneKind;
use crate::{Diagnosis, Options, WhyChanged, changes, why_changed};

/// Explains new flights by one change of a model whose coefficients stay. Where several flights were flown in different winds, each gets
/// what its own differs from their mean by, and the change is the mean.
pub fn changed(
    model: &Model,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    hold_against(model, effects, flights, observer)?;
    let tried = told_by(flights, options).changes(model);
    let mut found = search(model, &tried, flights, observer)?;
    let beside = [
        (FaultKind::MotorAnswers, motor_answers::changed(model, &flights.prepared())),
        (FaultKind::TrackerMoved, tracker_mount::changed(model, &flights.prepared())),
    ];
    for (kind, sentence) in beside.into_iter().filter_map(|(kind, said)| Some((kind, said?))) {
        let but = if found.best().is_some() { "Also," } else { "But" };
        let _ = write!(found.summary, " {but} {sentence}.");
        flights.faults.add("flights", Fault::of_all(kind, Severity::Warning, sentence));
    }
    Ok(found)
}

/// Without what only commands between the logged ones would tell, where these were logged less often than they were given.
fn told_by(flights: &FlightsOfOneKind, options: &Options) -> Options {
    match flights.faults.has(FaultKind::UnderSampled) {
        true => options.without_quick(),
        false => options.clone(),
    }
}

/// Searches flights whose clocks are set, and leaves them in the winds in which the answer was found.
fn search(
    model: &Model,
    tried: &[Change],
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<Diagnosis, WorkflowError> {
    let in_winds = |flights: &FlightsOfOneKind| {
        changes::changed(model, tried, &flights.prepared(), observer)
            .map_err(|why| WorkflowError::of_search(why, names(&flights.flights)))
    };
    let found = in_winds(flights)?;
    let own_winds = if tried.contains(&WIND) { flights.find_own_winds(model) } else { None };
    let Some(own_winds) = own_winds else { return Ok(found) };
    let mut in_own_winds = in_winds(flights)?;
    if is_better(&in_own_winds, &found) {
        own_winds.correct(&mut in_own_winds);
        flights.tell_own_winds(model, &in_own_winds);
        return Ok(in_own_winds);
    }
    flights.forget_own_winds();
    Ok(found)
}

/// The evidence for and against the changes that one effect can be.
pub fn changed_why(
    model: &Model,
    effect: Effect,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    options: &Options,
    observer: &dyn Observer,
) -> Result<WhyChanged, WorkflowError> {
    hold_against(model, effects, flights, observer)?;
    let of_why = |why, flights: &FlightsOfOneKind| WorkflowError::of_why(why, names(&flights.flights));
    let options = &told_by(flights, options);
    let (tried, _) = changes_of(model, effect, options).map_err(|why| of_why(why, flights))?;
    let diagnosis = search(model, &tried, flights, observer)?;
    why_changed(model, (effect, diagnosis), &flights.prepared(), options).map_err(|why| of_why(why, flights))
}

fn hold_against(
    model: &Model,
    effects: &[Effect],
    flights: &mut FlightsOfOneKind,
    observer: &dyn Observer,
) -> Result<(), WorkflowError> {
    flights.hold_against(model, effects, (Likeness::CHANGED, Reference::Flights), observer)?;
    flights.faults.add_of_commands(flights.flights.iter());
    let force_m_s2 = constant_force::taken_for_offset(model, &flights.prepared());
    for flight in &mut flights.flights {
        constant_force::put_back(&mut flight.prepared, force_m_s2);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    use crate::observer::Progress;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent};

    #[derive(Default)]
    struct Counting(Mutex<Vec<(usize, usize)>>);

    impl Observer for Counting {
        fn progress(&self, progress: Progress<'_>) {
            if progress.activity.starts_with("trying ") {
                self.0.lock().unwrap().extend(progress.steps);
            }
        }
    }

    #[test]
    fn a_heavier_craft_is_named_after_every_change_was_tried_once() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        let flights = [1, 2].map(|seed| fly(&heavy, seed, 8.0, &ORDINARY));
        let counting = Counting::default();
        let mut held =
            FlightsOfOneKind::from_flights(&flights, &heavy.vehicle, Reading::default(), &counting).unwrap();
        let diagnosis = changed(&truth(), &[], &mut held, &Options::default(), &counting).unwrap();
        assert_eq!(diagnosis.best(), Some(Effect::MassChange), "{}", diagnosis.summary);
        let count = Change::all(&truth()).len();
        let tried: Vec<(usize, usize)> = (0..count).map(|k| (k, count)).collect();
        assert_eq!(counting.0.into_inner().unwrap(), tried);
    }

    /// Winds of 6 and 2 m/s from the south: 4 in the mean, and each flight has its own by 2. In one wind of 4 m/s as well, no flight has one
    /// of its own.
    #[test]
    fn each_flight_has_its_own_wind_where_they_differ() {
        let mut known = truth();
        let drag = known.terms.iter_mut().find(|term| term.effect == Effect::LinearDrag).unwrap();
        drag.coefficients.iter_mut().for_each(|c| c.std_error = Some(0.01 * c.value.abs()));
        for (winds, differ) in [([6.0, 2.0], true), ([4.0, 4.0], false)] {
            let flights = [0, 1].map(|k: usize| {
                let mut windy = truth();
                windy.set(Effect::SteadyWind, &[winds[k], 0.0]);
                fly(&windy, k as u64 + 1, 12.0, &ORDINARY)
            });
            let mut held =
                FlightsOfOneKind::from_flights(&flights, &known.vehicle, Reading::default(), &Silent)
                    .unwrap();
            let diagnosis = changed(&known, &[], &mut held, &Options::default(), &Silent).unwrap();
            assert_eq!(diagnosis.best(), Some(Effect::SteadyWind), "{}", diagnosis.summary);
            let north = &diagnosis.effects[0].coefficients[0];
            assert!((north.value - 4.0).abs() < 0.2, "{winds:?}: {} ± {}", north.value, north.std_error);
            assert_eq!(held.faults.has(FaultKind::WindBetweenFlights), differ);
            for (flight, wind) in held.prepared().iter().zip(winds) {
                let own = if differ { wind - 4.0 } else { 0.0 };
                assert!((flight.wind_ned_m_s.x - own).abs() < 0.2, "{winds:?}: {}", flight.wind_ned_m_s);
            }
        }
    }

    /// Winds that differ are told from a mass that does not: the flights keep no wind where the craft is heavier and the air calm.
    #[test]
    fn flights_in_calm_air_keep_no_wind_of_their_own() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        let flights = [1, 2].map(|seed| fly(&heavy, seed, 8.0, &ORDINARY));
        let mut held =
            FlightsOfOneKind::from_flights(&flights, &heavy.vehicle, Reading::default(), &Silent).unwrap();
        changed(&truth(), &[], &mut held, &Options::default(), &Silent).unwrap();
        assert!(held.prepared().iter().all(|flight| flight.wind_ned_m_s.norm() == 0.0));
    }
}
