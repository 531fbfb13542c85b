//! Which of the changes that explain new flights by themselves happened, and which are only other words for it?
//!
//! - What adds to the best change, on top of it, happened as well.
//! - What explains the axes of the best one nearly as well, or adds nothing to it nor it to that, cannot be told from it.
//! - What a mass, a centre of mass or one motor explains may be several rotors (`change_challenge.rs`).

use model::{Effect, Model};
use sysid::has_rotation;
use sysid::prepare::Prepared;

use crate::change::{ALL_ROTORS, Change, HEAVIER, WIND};
use crate::change_challenge::{challenge, take_challenge};
use crate::change_examined::examine;
use crate::change_fit::{fit_change, is_beyond_flown};
use crate::change_together::{Found, Together};
use crate::criteria::{AS_GOOD, RIVAL, SIGNIFICANCE};
use crate::finding::EffectFinding;
use crate::leaning::{PROPELLER_TORQUE, leaning};
use crate::observer::Observer;
use crate::reason::Reason;
use crate::search_error::{SearchError, going_on};

/// Changes that explain nearly as much as the best, and add nothing to it nor it to them, cannot be told from it. What happened,
/// where the best one is supported.
pub(crate) fn mark_rivals(
    model: &Model,
    findings: &mut Vec<Found>,
    flights: &[&Prepared],
    (changes, observer): (&[Change], &dyn Observer),
) -> Result<Option<Together>, SearchError> {
    let Some((best, best_finding)) = findings.first().filter(|(_, f)| f.supported).cloned() else {
        return Ok(None);
    };
    let Ok(with_best) = Together::none(model).and(best, flights) else { return Ok(None) };
    let is_held = is_held_by_its_lever(model, (best, &best_finding));
    let part = |finding: &EffectFinding| match is_held && finding.effect != best.effect {
        true => 0.0,
        false => gain_in_place_of(&best_finding, finding),
    };
    let supports = |model: &Model, change| examine(model, change, flights, changes.len()).finding.supported;
    let mut together = with_best.clone();
    let mut rivals = Vec::new();
    for (change, finding) in findings.iter_mut().skip(1).filter(|(_, f)| f.supported) {
        going_on(observer)?;
        let (change, as_good) = (*change, part(finding) > AS_GOOD);
        if is_moment_of_wind(model, &together.model, change) {
            finding.refuse_as_moment_of_wind();
            continue;
        }
        if change.effect != best.effect && !as_good && supports(&with_best.model, change) {
            let last = together.changes[together.changes.len() - 1];
            let beside_all = last == best || supports(&together.model, change);
            match together.clone().and(change, flights).ok().filter(|_| beside_all) {
                Some(more) => together = more,
                None => finding.refuse(Reason::ExplainedBy { other: last }),
            }
            continue;
        }
        let rival = as_good
            || part(finding) > RIVAL
                && fit_change(model, change, flights)
                    .is_ok_and(|with| change.effect == best.effect || !supports(&with.model, best));
        if rival {
            finding.refuse(Reason::RivalOf { best });
            finding.confounded_with.push(best.effect);
            rivals.push(change);
        } else {
            finding.refuse(Reason::ExplainedBy { other: best });
        }
    }
    if !is_held {
        add_pair(&mut rivals, as_good_together(findings, best), &together);
    }
    if has_rotation(model) && changes.iter().any(|c| c.effect == ALL_ROTORS.effect) {
        going_on(observer)?;
        let challenged = challenge(model, &together, flights, changes.len());
        together = take_challenge(findings, together, challenged, &mut rivals);
    }
    let together = together.settled(flights);
    together.write_sizes(findings);
    let finding = &mut findings[0].1;
    name(finding, Reason::Changed { axes: finding.judged_axes(), percent: finding.drop_percent, rivals });
    Ok(Some(together))
}

/// Whether a rotor leans whose yaw is that of its push, and more than a damaged propeller gives: nothing else yaws a craft so.
fn is_held_by_its_lever(model: &Model, (change, finding): (Change, &EffectFinding)) -> bool {
    leaning(model, change, &finding.coefficients).is_some_and(|of| of.yaw_percent > 100.0 * PROPELLER_TORQUE)
}

/// Whether a shifted centre of mass may be the moment of a wind that is stronger than the air was in the model's flights: of what the air
/// does to rotors and body at such speeds, the model knows nothing.
fn is_moment_of_wind(model: &Model, with: &Model, change: Change) -> bool {
    let speed_m_s = WIND.size(with, model).iter().map(|v| v * v).sum::<f64>().sqrt();
    change.effect == Effect::ComOffset && speed_m_s > 0.0 && is_beyond_flown(model, speed_m_s)
}

/// The reason for the best change, with its rivals.
fn name(finding: &mut EffectFinding, reason: Reason) {
    if let Reason::Changed { rivals, .. } | Reason::BalanceShifted { rivals, .. } = &reason {
        finding.confounded_with = rivals.iter().map(|rival| rival.effect).collect();
        finding.confounded_with.sort_unstable_by_key(|effect| effect.id());
        finding.confounded_with.dedup();
    }
    finding.reason = reason;
}

/// Where no moment is known, every rotor by itself is a rival of a heavier craft.
pub(crate) fn add_rotors_to(best: Change, finding: &mut EffectFinding) {
    if best != HEAVIER {
        return;
    }
    let mut reason = finding.reason.clone();
    if let Reason::Changed { rivals, .. } | Reason::BalanceShifted { rivals, .. } = &mut reason {
        rivals.push(ALL_ROTORS);
    }
    name(finding, reason);
}

/// Part of what the best change explains on its own axes that another explains there: what it explains elsewhere does not make it
/// another word for the best one.
fn gain_in_place_of(best: &EffectFinding, other: &EffectFinding) -> f64 {
    let on_its_axes = |finding: &EffectFinding| {
        best.judged_axes().iter().map(|axis| finding.gain_of[axis.index()]).sum::<f64>()
    };
    on_its_axes(other) / on_its_axes(best).max(f64::MIN_POSITIVE)
}

/// Adds those of a pair that are neither named nor rivals already.
fn add_pair(rivals: &mut Vec<Change>, pair: Vec<Change>, together: &Together) {
    for change in pair {
        if !together.changes.contains(&change) && !rivals.contains(&change) {
            rivals.push(change);
        }
    }
}

/// Two other changes that act on different axes and together take away as much as the best one: a weight under a motor, which
/// shifts the centre of mass and adds to the mass, looks like a motor that gives less thrust.
fn as_good_together(findings: &[Found], best: Change) -> Vec<Change> {
    let Some((_, of_best)) = findings.first() else { return Vec::new() };
    let is_possible = |f: &EffectFinding| {
        !matches!(f.reason, Reason::Impossible { .. } | Reason::NoAnchor { .. } | Reason::OwnRule { .. })
    };
    let others =
        || findings.iter().skip(1).filter(|(c, f)| c.effect != best.effect && f.gain > 0.0 && is_possible(f));
    let apart = |a: Change, b: Change| a.effect.info().axes.iter().all(|x| !b.effect.info().axes.contains(x));
    let mut pair: Option<(f64, [Change; 2])> = None;
    for (a, first) in others().filter(|(_, f)| f.p_value < SIGNIFICANCE) {
        for (b, second) in others().filter(|(b, f)| f.p_value < SIGNIFICANCE && apart(*a, *b)) {
            let sum = gain_in_place_of(of_best, first) + gain_in_place_of(of_best, second);
            if sum > AS_GOOD && pair.is_none_or(|(most, _)| sum > most) {
                pair = Some((sum, [*a, *b]));
            }
        }
    }
    pair.map_or_else(Vec::new, |(_, both)| both.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::changes::changed;
    use crate::finding::Diagnosis;
    use crate::observer::Silent;
    use crate::testing::{ORDINARY, prepared, truth};

    fn finding(effect: Effect, motor: Option<u8>, gain: f64) -> Found {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        (finding.gain, finding.p_value) = (gain, 0.0);
        let axes = effect.info().axes;
        axes.iter().for_each(|axis| finding.gain_of[axis.index()] = gain / axes.len() as f64);
        (Change { effect, motor }, finding)
    }

    /// In air that is faster than any that the model was flown in.
    #[test]
    fn a_moment_in_a_strong_wind_is_no_shifted_centre_of_mass() {
        let mut model = truth();
        let fit = |speed_m_s| model::FitRecord { flown_speed_m_s: Some(speed_m_s), ..Default::default() };
        let mut windy = model.clone();
        windy.set(Effect::SteadyWind, &[3.0, 4.0]);
        let shifted = Change { effect: Effect::ComOffset, motor: None };
        for (flown_m_s, with, change, expected) in [
            (2.0, &windy, shifted, true),
            (6.0, &windy, shifted, false),
            (2.0, &truth(), shifted, false),
            (2.0, &windy, HEAVIER, false),
        ] {
            model.fit = Some(fit(flown_m_s));
            assert_eq!(is_moment_of_wind(&model, with, change), expected, "{flown_m_s} {change}");
        }
    }

    /// Mass acts on forces and the centre of mass on moments: 60 and 35 are more than nine tenths
    /// of 100.
    #[test]
    fn two_changes_on_different_axes_rival_one_that_they_explain_together() {
        let best = finding(Effect::MotorEfficiency, Some(1), 100.0);
        let pair = |mass_gain: f64| {
            let findings = [
                best.clone(),
                finding(Effect::MotorEfficiency, Some(2), 99.0),
                finding(Effect::MassChange, None, mass_gain),
                finding(Effect::ComOffset, None, 35.0),
            ];
            let pair = as_good_together(&findings, best.0);
            pair.iter().map(|change| change.effect).collect::<Vec<_>>()
        };
        assert_eq!(pair(60.0), [Effect::MassChange, Effect::ComOffset]);
        assert!(pair(54.0).is_empty());
        let mut pushing = finding(Effect::MassChange, None, 60.0);
        pushing.1.reason = Reason::NoAnchor { place_ned_m: [0.0, 0.0, 9.0] };
        let findings = [best.clone(), pushing, finding(Effect::ComOffset, None, 35.0)];
        assert!(as_good_together(&findings, best.0).is_empty(), "what cannot be stands for nothing");
    }

    /// A wind pushes to the side, however hard: nothing of what a mass explains in w.
    #[test]
    fn what_explains_other_axes_stands_for_nothing() {
        let mass = finding(Effect::MassChange, None, 100.0);
        let wind = finding(Effect::SteadyWind, None, 200.0);
        assert_eq!(gain_in_place_of(&mass.1, &wind.1), 0.0);
        let findings = [mass.clone(), wind, finding(Effect::MotorLag, None, 3.0)];
        assert!(as_good_together(&findings, mass.0).is_empty());
    }

    /// What is said of flights of a model with these effects beside the true one.
    fn of(effects: &[(Effect, &[f64])], flown: impl Fn(&Model) -> Vec<Prepared>) -> Diagnosis {
        let mut world = truth();
        effects.iter().for_each(|(effect, values)| world.set(*effect, values));
        let flights = flown(&world);
        let flights: Vec<&Prepared> = flights.iter().collect();
        changed(&truth(), &Change::all(&truth()), &flights, &Silent).unwrap()
    }

    fn lively(world: &Model) -> Vec<Prepared> {
        prepared(world, 30..33, 10.0, &ORDINARY)
    }

    #[test]
    fn all_rotors_that_give_less_thrust_are_no_heavier_craft() {
        for losses in [[0.04; 4], [0.06, 0.0, 0.06, 0.0]] {
            let diagnosis = of(&[(Effect::MotorEfficiency, &losses)], lively);
            let best = &diagnosis.effects[0];
            assert_eq!((best.effect, best.motor), (ALL_ROTORS.effect, None), "{}", diagnosis.summary);
            assert!(best.supported && best.confounded_with.is_empty(), "{}", best.reason);
            for (found, loss) in best.coefficients.iter().zip(losses) {
                assert!((found.value - loss).abs() < 0.005, "{losses:?}: {found:?}");
            }
            let mass = diagnosis.effects.iter().find(|f| f.effect == HEAVIER.effect).unwrap();
            assert!(matches!(mass.reason, Reason::ExplainsLess { than: ALL_ROTORS, .. }), "{}", mass.reason);
        }
    }

    #[test]
    fn a_heavier_craft_whose_moments_stay_is_none_with_weaker_rotors() {
        let diagnosis = of(&[(Effect::MassChange, &[0.1])], lively);
        assert_eq!(diagnosis.best(), Some(HEAVIER.effect));
        assert!(diagnosis.effects[0].confounded_with.is_empty(), "{}", diagnosis.summary);
        let rotors = diagnosis.effects.iter().find(|f| f.effect == ALL_ROTORS.effect && f.motor.is_none());
        let reason = &rotors.unwrap().reason;
        assert!(matches!(reason, Reason::ExplainsLess { than: HEAVIER, .. }), "{reason}");
    }

    /// The model was fitted in a wind, and knows it.
    #[test]
    fn another_wind_than_the_models_is_a_change_by_what_is_added_to_it() {
        let (mut model, mut world) = (truth(), truth());
        model.set(Effect::SteadyWind, &[0.8, -0.4]);
        world.set(Effect::SteadyWind, &[-0.2, 0.3]);
        world.set(Effect::MassChange, &[0.1]);
        let flights = lively(&world);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let diagnosis = changed(&model, &Change::all(&model), &flights, &Silent).unwrap();
        let size = |effect: Effect| {
            let found = diagnosis.effects.iter().find(|f| f.effect == effect && f.supported).unwrap();
            found.coefficients.iter().map(|c| c.value).collect::<Vec<_>>()
        };
        let (wind, mass) = (size(Effect::SteadyWind), size(Effect::MassChange));
        assert!((wind[0] + 1.0).abs() < 0.05 && (wind[1] - 0.7).abs() < 0.05, "{wind:?}");
        assert!((mass[0] - 0.1).abs() < 0.003, "{mass:?}");
        assert!(
            diagnosis.summary.contains(" The model already includes steady-wind: "),
            "{}",
            diagnosis.summary
        );
        let with = diagnosis.with_changes.as_ref().unwrap().term(Effect::SteadyWind).unwrap().values();
        assert!((with[0] + 0.2).abs() < 0.05 && (with[1] - 0.3).abs() < 0.05, "{with:?}");
    }

    /// By one change at a time, these are a moved centre of mass and more mass.
    #[test]
    fn two_weak_motors_are_neither_mass_nor_centre_of_mass() {
        let diagnosis = of(&[(Effect::MotorEfficiency, &[0.0, 0.0, 0.05, 0.03])], lively);
        let supported = crate::finding::supported(&diagnosis.effects);
        assert_eq!(supported, [Effect::MotorEfficiency], "{}", diagnosis.summary);
        for (found, loss) in diagnosis.effects[0].coefficients.iter().zip([0.0, 0.0, 0.05, 0.03]) {
            assert!((found.value - loss).abs() < 0.005, "{found:?}");
        }
    }

    #[test]
    fn rotors_and_mass_that_hide_each_other_are_both_named() {
        let changed = [(Effect::MassChange, &[0.06][..]), (Effect::MotorEfficiency, &[-0.04; 4])];
        let diagnosis = of(&changed, lively);
        let supported = crate::finding::supported(&diagnosis.effects);
        assert_eq!(supported.len(), 2, "{}", diagnosis.summary);
        let mass = diagnosis.effects.iter().find(|f| f.effect == HEAVIER.effect).unwrap();
        assert!(mass.supported && (mass.coefficients[0].value - 0.06).abs() < 0.01, "{}", diagnosis.summary);
    }

    #[test]
    fn a_heavier_craft_in_a_wind_has_changed_twice() {
        let diagnosis = of(&[(Effect::MassChange, &[0.1]), (Effect::SteadyWind, &[0.8, 0.0])], lively);
        let supported = crate::finding::supported(&diagnosis.effects);
        assert_eq!(supported.len(), 2, "{}", diagnosis.summary);
        assert!(supported.contains(&HEAVIER.effect) && supported.contains(&Effect::SteadyWind));
        let said = "Since the model was fitted, more than one thing has changed: ";
        assert!(diagnosis.summary.starts_with(said), "{}", diagnosis.summary);
        assert!(!diagnosis.summary.contains("cannot tell"), "{}", diagnosis.summary);
        let with = diagnosis.with_changes.as_ref().unwrap();
        for finding in diagnosis.effects.iter().filter(|finding| finding.supported) {
            let sizes: Vec<f64> = finding.coefficients.iter().map(|c| c.value).collect();
            assert_eq!(with.term(finding.effect).unwrap().values(), sizes);
        }
    }
}
