//! What other flights held out would say. A load that swings shows where the craft brakes: held out, a flight that does not
//! brake confirms nothing. Where there are few flights, an answer must not hang on which of them were held out, so each is held
//! out once, and what most of these diagnoses find is found.

use model::{Effect, Model};
use sysid::prepare::Prepared;

use crate::conclusion::conclude;
use crate::criteria::SIGNIFICANCE;
use crate::diagnose::diagnose_with;
use crate::finding::{Diagnosis, EffectFinding};
use crate::observer::Observer;
use crate::options::Options;
use crate::reason::Reason;
use crate::search_error::{SearchError, Steps, going_on};

/// Most flights that are each held out once.
const FEW: usize = 6;

/// The diagnosis with the effect that it would have found with most other flights held out: one that is certain on the flights of the
/// fit, and that those held out do not confirm. `diagnosis` as it is, where it found an effect, or there is none.
pub(crate) fn or_by_other_splits(
    diagnosis: Diagnosis,
    model: &Model,
    flights: &[&Prepared],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, SearchError> {
    let is_lost =
        |f: &EffectFinding| matches!(f.reason, Reason::NotBorneOut { .. }) && f.p_value < SIGNIFICANCE;
    if diagnosis.best().is_some() || flights.len() > FEW || !diagnosis.effects.iter().any(is_lost) {
        return Ok(diagnosis);
    }
    let of = flights.len();
    let mut found: Vec<Effect> = Vec::new();
    let times = |found: &[Effect], effect: Effect| found.iter().filter(|other| **other == effect).count();
    let mut steps = Steps::new(observer, of);
    for (k, held_out) in flights.iter().enumerate() {
        // The splits that are left may be too few for any of them.
        let is_open = |f: &EffectFinding| is_lost(f) && 2 * (times(&found, f.effect) + of - k) > of;
        if !diagnosis.effects.iter().any(is_open) {
            break;
        }
        steps.next(&format!("diagnosing with {} held out", held_out.name))?;
        let rest: Vec<&Prepared> =
            flights.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, f)| *f).collect();
        // A split whose base model cannot be fitted finds nothing.
        found.extend(diagnose_with(model, &rest, &[held_out], options, observer).ok().and_then(|d| d.best()));
        going_on(observer)?;
    }
    let Diagnosis { mut effects, unexplained, not_identified, .. } = diagnosis;
    let confirmed = effects.iter_mut().find(|f| is_lost(f) && 2 * times(&found, f.effect) > of);
    if let Some(finding) = confirmed {
        finding.supported = true;
        finding.reason = Reason::OnOtherSplits { found: times(&found, finding.effect), of };
    }
    effects.sort_by_key(|finding| !finding.supported);
    Ok(conclude(effects, unexplained, not_identified))
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::observer::{Progress, Silent};
    use crate::testing::{ORDINARY, prepared, truth};

    /// Hears which flights are held out.
    #[derive(Default)]
    struct Listening(Mutex<Vec<String>>);

    impl Observer for Listening {
        fn progress(&self, progress: Progress<'_>) {
            if let Some(flight) = progress.activity.strip_prefix("diagnosing with ") {
                self.0.lock().unwrap().push(flight.to_owned());
            }
        }
    }

    /// An effect that is certain on the flights of the fit, and that those held out do not confirm.
    fn lost(effect: Effect) -> Diagnosis {
        let reason = Reason::NotBorneOut { improved: 0, flights: 1, p_value: None };
        let finding =
            EffectFinding { p_value: 0.5 * SIGNIFICANCE, ..EffectFinding::unsupported(effect, 1, reason) };
        conclude(vec![finding], Vec::new(), Vec::new())
    }

    /// The options of a search for one effect alone.
    fn only(effect: Effect) -> Options {
        Options { without: Effect::candidates().filter(|other| *other != effect).collect() }
    }

    /// A craft that the air brakes in yaw with -1.0 r |r| besides, which each flight shows by itself.
    #[test]
    fn an_effect_that_the_flights_held_out_in_turn_confirm_is_found() {
        let effect = Effect::QuadraticYawDamping;
        let mut world = truth();
        world.set(effect, &[-1.0]);
        let flights = prepared(&world, 60..63, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let found = or_by_other_splits(lost(effect), &truth(), &flights, &only(effect), &Silent).unwrap();
        assert_eq!(found.best(), Some(effect));
        assert_eq!(found.effects[0].reason, Reason::OnOtherSplits { found: 3, of: 3 });
    }

    /// Flights without rows cannot be fitted, so no split finds anything. Of four, three would have to: with two gone, it is over.
    #[test]
    fn splits_end_where_too_few_are_left_for_most() {
        let flights = prepared(&truth(), 1..2, 4.0, &ORDINARY);
        let empty =
            ["A", "B", "C", "D"].map(|name| Prepared { name: name.into(), ..flights[0].without_stretches() });
        let empty: Vec<&Prepared> = empty.iter().collect();
        let (before, options, listening) = (lost(Effect::Tether), Options::default(), Listening::default());
        let after = or_by_other_splits(before.clone(), &truth(), &empty, &options, &listening).unwrap();
        assert_eq!(after, before);
        assert_eq!(*listening.0.lock().unwrap(), ["A held out", "B held out"]);
    }

    /// One that was found, one that is not certain, and one of more flights than are few are not asked about again.
    #[test]
    fn a_diagnosis_that_lost_nothing_stays_as_it_is() {
        let flights = prepared(&truth(), 1..2, 4.0, &ORDINARY);
        let (few, many) = (vec![&flights[0]; 4], vec![&flights[0]; FEW + 1]);
        let (mut found, mut uncertain) = (lost(Effect::Tether), lost(Effect::Tether));
        found.effects.push(EffectFinding { supported: true, ..lost(Effect::SteadyWind).effects[0].clone() });
        uncertain.effects[0].p_value = 2.0 * SIGNIFICANCE;
        for (before, flights) in [(found, &few), (uncertain, &few), (lost(Effect::Tether), &many)] {
            let listening = Listening::default();
            let (model, options) = (truth(), Options::default());
            let after = or_by_other_splits(before.clone(), &model, flights, &options, &listening).unwrap();
            assert_eq!(after, before);
            assert!(listening.0.lock().unwrap().is_empty());
        }
    }
}
