//! What other flights held out would say. A load that swings shows where the craft brakes: held out, a flight that does not
//! brake confirms nothing. Where there are few flights, an answer must not hang on which of them were held out, so each is held
//! out once, and what most of these diagnoses find is found.

use model::{Effect, Model};
use sysid::prepare::Prepared;

use crate::conclusion::conclude;
use crate::criteria::{Left, SIGNIFICANCE, stand_in};
use crate::diagnose::{diagnose_with, excess};
use crate::finding::{Diagnosis, EffectFinding};
use crate::held_out::{examine, fit_and_validate, fit_more};
use crate::observer::Observer;
use crate::options::Options;
use crate::reason::Reason;
use crate::search_error::{SearchError, Steps, going_on};
use crate::stand_ins::incomplete;

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
    if diagnosis.best().is_some() || flights.len() > FEW {
        return Ok(diagnosis);
    }
    let lost: Vec<Effect> = diagnosis.effects.iter().filter(|f| is_lost(f)).map(|f| f.effect).collect();
    if lost.is_empty() {
        return Ok(diagnosis);
    }
    let Some((effect, found)) = found_by_most(&lost, model, flights, options, observer)? else {
        return Ok(diagnosis);
    };
    let Diagnosis { mut effects, unexplained, not_identified, .. } = diagnosis;
    for finding in effects.iter_mut().filter(|finding| finding.effect == effect) {
        finding.supported = true;
        finding.reason = Reason::OnOtherSplits { found, of: flights.len() };
    }
    effects.sort_by_key(|finding| !finding.supported);
    Ok(conclude(effects, unexplained, not_identified))
}

/// The first of some effects that is found with most of the flights held out, one after the other, and with how many.
fn found_by_most(
    lost: &[Effect],
    model: &Model,
    flights: &[&Prepared],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Option<(Effect, usize)>, SearchError> {
    let of = flights.len();
    let splits: Vec<Split> = (0..of).map(|k| Split::new(flights, k)).collect();
    let mut promising: Vec<Vec<Effect>> = Vec::new();
    let mut steps = Steps::new(observer, of);
    for split in &splits {
        steps.next(&format!("holding out {}", split.held_out[0].name))?;
        promising.push(split.promising(model, lost));
    }
    let mut found: Vec<Effect> = Vec::new();
    let times = |found: &[Effect], effect: &Effect| found.iter().filter(|other| *other == effect).count();
    let mut steps = Steps::new(observer, of);
    for (k, split) in splits.iter().enumerate() {
        // The splits that are left may be too few.
        let left = |effect: &Effect| promising[k..].iter().filter(|some| some.contains(effect)).count();
        let is_open = |effect: &&Effect| 2 * (times(&found, effect) + left(effect)) > of;
        let open: Vec<&Effect> = lost.iter().filter(is_open).collect();
        if open.is_empty() {
            return Ok(None);
        }
        if !open.iter().any(|effect| promising[k].contains(effect)) {
            continue;
        }
        steps.next(&format!("diagnosing with {} held out", split.held_out[0].name))?;
        let diagnosis = diagnose_with(model, &split.train, &split.held_out, options, observer);
        found.extend(diagnosis.ok().and_then(|d| d.best()));
        going_on(observer)?;
    }
    let times = |effect: &Effect| (*effect, times(&found, effect));
    Ok(lost.iter().map(times).find(|(_, found)| 2 * found > of))
}

/// One flight held out, and the others.
struct Split<'a> {
    train: Vec<&'a Prepared>,
    held_out: [&'a Prepared; 1],
}

impl<'a> Split<'a> {
    fn new(flights: &[&'a Prepared], held_out: usize) -> Self {
        let rest = flights.iter().enumerate().filter(|(k, _)| *k != held_out).map(|(_, flight)| *flight);
        Self { train: rest.collect(), held_out: [flights[held_out]] }
    }

    /// Those of some effects whose search may find them: each must be supported by itself, and must not leave what the right effect would
    /// take. That costs a fit, where the search costs dozens.
    fn promising(&self, model: &Model, effects: &[Effect]) -> Vec<Effect> {
        let flights = (&self.train[..], &self.held_out[..]);
        let Ok(base) = fit_and_validate(model, &model.effects(), flights.0, flights.1) else {
            return Vec::new();
        };
        let noise_before = excess(&base, flights.1);
        let is_promising = |effect: &Effect| {
            fit_more(&base.fit.model, &[*effect], flights).is_ok_and(|with| {
                let finding = examine(&base, &with, *effect, flights, 1);
                let incomplete = incomplete(&noise_before, &excess(&with, flights.1));
                let left = Left { unexplained: &[], incomplete, answers_late: false };
                finding.supported && stand_in(&finding, &left).is_none()
            })
        };
        effects.iter().copied().filter(is_promising).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::ops::Range;
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

    /// Flights of a craft that the air brakes in yaw with -1.0 r |r| besides, which each shows by itself.
    fn braked_in_yaw(seeds: Range<u64>) -> Vec<Prepared> {
        let mut world = truth();
        world.set(Effect::QuadraticYawDamping, &[-1.0]);
        prepared(&world, seeds, 8.0, &ORDINARY)
    }

    #[test]
    fn an_effect_that_the_flights_held_out_in_turn_confirm_is_found() {
        let effect = Effect::QuadraticYawDamping;
        let flights = braked_in_yaw(60..63);
        let flights: Vec<&Prepared> = flights.iter().collect();
        assert!((0..3).all(|k| Split::new(&flights, k).promising(&truth(), &[effect]) == [effect]));
        let found = or_by_other_splits(lost(effect), &truth(), &flights, &only(effect), &Silent).unwrap();
        assert_eq!(found.best(), Some(effect));
        assert_eq!(found.effects[0].reason, Reason::OnOtherSplits { found: 3, of: 3 });
    }

    /// Each flight confirms the effect by itself, but the searches look for another. Of four, three would have to find it: with two gone,
    /// it is over.
    #[test]
    fn splits_end_where_too_few_are_left_for_most() {
        let effect = Effect::QuadraticYawDamping;
        let flights: Vec<Prepared> = braked_in_yaw(60..64)
            .into_iter()
            .zip(["A", "B", "C", "D"])
            .map(|(flight, name)| Prepared { name: name.into(), ..flight })
            .collect();
        let flights: Vec<&Prepared> = flights.iter().collect();
        let (before, options, listening) = (lost(effect), only(Effect::MotorLag), Listening::default());
        let after = or_by_other_splits(before.clone(), &truth(), &flights, &options, &listening).unwrap();
        assert_eq!(after, before);
        assert_eq!(*listening.0.lock().unwrap(), ["A held out", "B held out"]);
    }

    /// Of a craft without it, no flight confirms the effect by itself: no search is begun.
    #[test]
    fn effects_that_no_flight_confirms_by_itself_are_not_searched_for() {
        let effect = Effect::QuadraticYawDamping;
        let flights = prepared(&truth(), 60..64, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        assert!((0..4).all(|k| Split::new(&flights, k).promising(&truth(), &[effect]).is_empty()));
        let (before, listening) = (lost(effect), Listening::default());
        let after =
            or_by_other_splits(before.clone(), &truth(), &flights, &only(effect), &listening).unwrap();
        assert_eq!(after, before);
        assert!(listening.0.lock().unwrap().is_empty());
    }

    /// The craft of the first two has it: what would be the effect of all leaves much of it.
    #[test]
    fn an_effect_of_some_flights_leaves_too_much_to_be_promising() {
        let effect = Effect::QuadraticYawDamping;
        let without = prepared(&truth(), 62..64, 8.0, &ORDINARY);
        let flights: Vec<Prepared> = braked_in_yaw(60..62).into_iter().chain(without).collect();
        let flights: Vec<&Prepared> = flights.iter().collect();
        assert!((0..4).all(|k| Split::new(&flights, k).promising(&truth(), &[effect]).is_empty()));
    }

    /// Flights without rows cannot be fitted.
    #[test]
    fn a_split_without_a_base_model_promises_nothing() {
        let empty =
            prepared(&truth(), 1..3, 4.0, &ORDINARY).into_iter().map(|flight| flight.without_stretches());
        let empty: Vec<Prepared> = empty.collect();
        let split = Split::new(&empty.iter().collect::<Vec<_>>(), 0);
        assert!(split.promising(&truth(), &[Effect::Tether]).is_empty());
    }

    /// A load is searched for over its shapes.
    #[test]
    fn an_effect_without_a_way_from_zero_is_promising_where_it_is() {
        let mut world = truth();
        world.set(Effect::SlungLoad, &[0.05, 0.4, 0.05]);
        let of = |world: &Model| prepared(world, 40..43, 12.0, &ORDINARY);
        for (flights, expected) in [(of(&world), vec![Effect::SlungLoad]), (of(&truth()), vec![])] {
            let flights: Vec<&Prepared> = flights.iter().collect();
            assert_eq!(Split::new(&flights, 2).promising(&truth(), &[Effect::SlungLoad]), expected);
        }
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
