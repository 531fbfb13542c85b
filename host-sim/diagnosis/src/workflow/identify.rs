//! The basic model fitted to flights and judged on others.

use model::{Effect, Model, Vehicle};
use report::number::fixed;
use sysid::fit::output_error::Rows;
use sysid::statistics::median;
use sysid::{MotorsOfFlights, Prepared, RefinementOutcome, RotorComparison};

use crate::Options;
use crate::mending::mending;
use crate::observer::{Observer, Progress};
use crate::workflow::corrections::basic_model;
use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::names;
use crate::workflow::record::rotation_refused;
use crate::workflow::refinement::refine;
use crate::workflow::sets::FlightSets;

/// A basic model and how well determined it is.
pub struct Identified {
    /// The model, with its fit record.
    pub model: Model,
    /// Condition number of the column-scaled problem.
    pub condition: f64,
    /// Motor coefficients flight by flight.
    pub motors: Vec<MotorsOfFlights>,
    /// The rotors against each other, where the coefficients tell.
    pub rotors: Option<RotorComparison>,
    /// What a refinement did, where one was asked for.
    pub refinement: Option<RefinementOutcome>,
}

/// Fits the basic model; `effects` are users' own, whose formulas must have a value at every sample that is used.
pub fn identify(
    vehicle: &Vehicle,
    effects: &[Effect],
    sets: &mut FlightSets,
    rows: Option<Rows>,
    observer: &dyn Observer,
) -> Result<Identified, WorkflowError> {
    sets.leave_out_undefined(&Model::new(vehicle.clone()), effects, observer)?;
    let identified = fit_basic(vehicle, sets, Rotation::Mended(&Options::default()), observer)?;
    let motors = tell_doubts(&identified.model, sets, observer);
    warn_of_clocks(sets, observer);
    let rotors = sets.compare_rotors(&identified.model);
    let (mut model, refinement) = refine(identified.model, sets, rows, observer)?;
    sets.record_for_changes(&mut model);
    Ok(Identified { model, condition: identified.condition, motors, rotors, refinement })
}

/// What becomes of a rotation that is in doubt.
#[derive(Clone, Copy)]
pub(crate) enum Rotation<'a> {
    /// It is kept where motors push the wrong way only because an effect of those that the options leave is missing.
    Mended(&'a Options),
    /// It is refused.
    Refused,
}

/// A basic model as it was fitted.
pub(crate) struct Basic {
    pub(crate) model: Model,
    /// Condition number of the column-scaled problem.
    condition: f64,
}

/// Fits the basic model, without rotation where that is refused.
pub(crate) fn fit_basic(
    vehicle: &Vehicle,
    sets: &mut FlightSets,
    rotation: Rotation<'_>,
    observer: &dyn Observer,
) -> Result<Basic, WorkflowError> {
    if observer.is_cancelled() {
        return Err(WorkflowError::Cancelled);
    }
    observer.progress(Progress { activity: "fitting the basic model", steps: None });
    let basic: Vec<Effect> = Effect::basic().collect();
    let aligned = sets.align_training(&basic_model(vehicle));
    let mut fit = sysid::fit(&sets.train(), vehicle, &basic, None).map_err(|why| sets.blame(why))?;
    sets.align_held_out(aligned.as_ref().unwrap_or(&fit.model));
    let refused = doubts(&fit.model, sets, rotation, observer)?;
    if !refused.is_empty() {
        let forces = sysid::without_rotation(&basic);
        fit = sysid::fit(&sets.train(), vehicle, &forces, None).map_err(|why| sets.blame(why))?;
        sets.align_training(&fit.model);
        sets.align_held_out(&fit.model);
    }
    if !refused.is_empty() {
        observer.warning(&rotation_refused(&refused));
    }
    let mut model = fit.model;
    model.fit = Some(sets.record(&model, refused));
    Ok(Basic { model, condition: fit.condition })
}

/// Why the rotation of a model is to be refused. Where motors push the wrong way, missing effects are tried first: one that mends
/// it is for the diagnosis to name.
fn doubts(
    model: &Model,
    sets: &FlightSets,
    rotation: Rotation<'_>,
    observer: &dyn Observer,
) -> Result<Vec<String>, WorkflowError> {
    let (train, validate) = (sets.train(), sets.validate());
    let doubts = sysid::rotation_doubts(model, &train);
    let Rotation::Mended(options) = rotation else { return Ok(doubts) };
    if sysid::rotor_signs(model).is_empty() {
        return Ok(doubts);
    }
    let mended = mending(model, &train, &validate, options, observer)
        .map_err(|why| WorkflowError::of_search(why, names(sets.training.loaded())))?;
    Ok(if mended.is_some() { Vec::new() } else { doubts })
}

/// Warns of rotor clocks that wander. For the end of the work: an effect that joins the model may explain them.
pub(crate) fn warn_of_clocks(sets: &FlightSets, observer: &dyn Observer) {
    for flight in sets.all().filter(|flight| flight.wanders()) {
        if let Some(note) = flight.prepared.alignment.as_ref().and_then(sysid::Alignment::note) {
            observer.warning(&format!("{}: {note}", flight.path.display()));
        }
    }
    if let Some(late_s) = late_in_all(&sets.train()) {
        observer.warning(&format!(
            "all logs stamp the motor commands about {} ms late: the craft seems to answer before its command. They are shifted earlier \
             before the fit; fix the logger's time stamps",
            fixed(1e3 * late_s, 0)
        ));
    }
}

/// How late the commands of all flights are by their logs, where they were put right; nothing where some were in time. Flights that differ by
/// a clock of their own are counted from their median, so some of them are in time or early.
fn late_in_all(flights: &[&Prepared]) -> Option<f64> {
    let late_s = |flight: &&Prepared| Some(flight.rotor_late_s()).filter(|late_s| *late_s > 0.0);
    let mut all: Vec<f64> = flights.iter().map(late_s).collect::<Option<_>>()?;
    let of_commands = flights.len() > 1 && flights.iter().all(|flight| !flight.has_rotor_speeds());
    median(&mut all).filter(|_| of_commands)
}

/// Says what of a model is in doubt: signs, motors that follow how the flights were flown, a vehicle file or flights of another craft. For
/// the end of the work: with a strong moment missing, motors come out too weak. Returns the motors flight by flight.
pub(crate) fn tell_doubts(
    model: &Model,
    sets: &mut FlightSets,
    observer: &dyn Observer,
) -> Vec<MotorsOfFlights> {
    for doubt in sysid::impossible_signs(model) {
        observer.warning(&doubt);
    }
    let motors = sysid::motors_of_flights(model, &sets.train());
    for warning in motors.iter().filter_map(|m| m.warning.as_ref()) {
        observer.warning(warning);
    }
    sets.add_faults_of_fit(model);
    motors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, fly, truth};
    use crate::workflow::{Reading, Silent};

    #[test]
    fn the_coefficients_of_the_craft_come_back_within_their_errors() {
        let flown = |seed| fly(&truth(), seed, 12.0, &ORDINARY);
        let (train, validate) = ([flown(1), flown(2), flown(3)], [flown(4), flown(5)]);
        let vehicle = truth().vehicle;
        let mut sets =
            FlightSets::from_flights(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap();
        let identified = identify(&vehicle, &[], &mut sets, None, &Silent).unwrap();
        assert!(identified.refinement.is_none() && identified.condition > 1.0);
        for (found, real) in identified.model.terms.iter().zip(&truth().terms) {
            assert_eq!(found.effect, real.effect);
            for (found, real) in found.coefficients.iter().zip(&real.coefficients) {
                let error = found.std_error.unwrap();
                // Errors from twelve seconds of coloured residuals are themselves known to a third.
                assert!((found.value - real.value).abs() < 6.0 * error, "{found:?}, true {}", real.value);
            }
        }
        let record = identified.model.fit.unwrap();
        assert_eq!(record.flights.len(), 5);
        assert!(record.rotation_refused.is_empty() && record.held_out.w.r2 > 0.5);
    }
}
