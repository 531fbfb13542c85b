//! Several rotors in the place of what else looks like them.
//!
//! A heavier craft and one all of whose rotors give less thrust hover alike; two weak motors on one side hover like a heavier craft whose
//! centre of mass has moved. The moments tell them apart: with a heavier craft they stay what they were, with a moved centre of mass a
//! constant is added, and each rotor's own falls with its thrust. One change at a time does not show it, for rotors that have all changed are
//! four numbers. So wherever masses, centres of mass or single motors are named, they are held against four rotors, each by itself, with
//! whatever still adds to these, on all axes and on flights that neither was estimated from.

use std::ops::Range;

use model::{Axis, Effect, Model};
use nalgebra::DVector;
use sysid::prepare::Prepared;
use sysid::statistics::Blocks;
use sysid::{Residuals, errors, residuals};

use crate::change::{ALL_ROTORS, Change, HEAVIER, places};
use crate::change_examined::examine;
use crate::change_fit::{Fitted, fit_jointly};
use crate::change_scatter::scatter_of;
use crate::change_together::{Found, Together};
use crate::criteria::{MATTERS_PERCENT, SIGNIFICANCE};
use crate::finding::EffectFinding;
use crate::held_out::{judged_axes, take_gain};
use crate::reason::Reason;
use crate::significance::take_fall;

/// The largest loss of thrust from which on rotors are one change beside others. Every batch of propellers differs by as much.
const LEAST_LOSS: f64 = 0.01;
/// By how much losses of thrust may differ from their mean and still be alike, as a share of it.
const ALIKE: f64 = 0.25;
/// Standard errors from which on a change is one beside others. Each is a number of many that were tried.
const FIRM: f64 = 5.0;

/// What is named, held against four rotors.
pub(crate) struct Challenged {
    finding: EffectFinding,
    /// The first of what is named that four rotors may be.
    named: Change,
    /// With the rotors in the place of all that they may be.
    together: Together,
    /// The axis on which what is named leaves more, by how many percent of its squared error; and the same of the rotors.
    named_leaves: Option<(Axis, f64)>,
    rotors_leave: Option<(Axis, f64)>,
}

/// Whether it may be what several rotors look like.
fn may_be_rotors(change: &Change) -> bool {
    matches!(change.effect, Effect::MassChange | Effect::ComOffset | Effect::MotorEfficiency)
}

/// Nothing where the rotors are no change, or where what is named could not be they: one motor is fewer than four.
pub(crate) fn challenge(
    model: &Model,
    together: &Together,
    flights: &[&Prepared],
    candidates: usize,
) -> Option<Challenged> {
    let alike: Vec<Change> = together.changes.iter().copied().filter(may_be_rotors).collect();
    let named = *alike.first()?;
    if alike.len() == 1 && named.effect == ALL_ROTORS.effect {
        return None;
    }
    let of_rotors = beside(model, together, flights)
        .or_else(|| instead(model, (together, named), flights, candidates))?;
    let [of_named, rotors] =
        [&together.changes, &of_rotors.changes].map(|changes| held_out(model, changes, flights));
    Some(Challenged {
        finding: evidence(model, &of_rotors, &rotors, flights, candidates),
        named,
        named_leaves: leaves_more(&of_named, &rotors, flights),
        rotors_leave: leaves_more(&rotors, &of_named, flights),
        together: of_rotors,
    })
}

/// Four rotors and all else that is named, estimated at once and without what is then zero within its errors, the least certain first.
/// Nothing where that leaves no rotors, or the same changes as before.
fn beside(model: &Model, together: &Together, flights: &[&Prepared]) -> Option<Together> {
    let others = together.changes.iter().filter(|change| change.effect != ALL_ROTORS.effect);
    let mut changes: Vec<Change> = std::iter::once(&ALL_ROTORS).chain(others).copied().collect();
    loop {
        let fitted = fit_jointly((model, model), &changes, flights).ok()?;
        let losses = fitted.values.rows(0, ALL_ROTORS.coefficients().len());
        if losses.amax() < LEAST_LOSS {
            return None;
        }
        let certain: Vec<f64> = certainty(model, &changes, &fitted);
        let least = (0..changes.len()).min_by(|a, b| certain[*a].total_cmp(&certain[*b]))?;
        if certain[least] >= FIRM {
            let is_other = changes != together.changes && !is_inertia(&changes, &fitted.values);
            return is_other.then(|| Together { changes, ..Together::none(model) }.fitted_as(&fitted));
        }
        changes.remove(least);
        if changes.first() != Some(&ALL_ROTORS) {
            return None;
        }
    }
}

/// Whether what all rotors seem to lack alike is the inertia of a mass that was added, or was taken off: it makes the craft turn more slowly
/// under the same thrust.
fn is_inertia(changes: &[Change], values: &DVector<f64>) -> bool {
    let of = |one: Change| {
        let (_, place) = places(changes).find(|(change, _)| *change == one)?;
        Some(values.rows(place.start, place.len()))
    };
    let (Some(losses), Some(mass)) = (of(ALL_ROTORS), of(HEAVIER)) else { return false };
    let mean = losses.mean();
    let are_alike = losses.iter().all(|loss| (loss - mean).abs() < ALIKE * mean.abs());
    are_alike && mean * mass[0] > 0.0
}

/// How many standard errors each of some changes is from zero by the most certain of its coefficients, the usual scatter between flights
/// among them.
fn certainty(model: &Model, changes: &[Change], fitted: &Fitted) -> Vec<f64> {
    let ratio = |effect: Effect, (k, place): (usize, usize)| {
        let name = effect.info().coefficients[k].name;
        let usual = scatter_of(model, effect, name).map_or(0.0, |scatter| scatter.deviation);
        let error = fitted.covariance[(place, place)].max(0.0).sqrt().hypot(usual);
        fitted.values[place].abs() / error.max(f64::MIN_POSITIVE)
    };
    let most = |(change, place): (Change, Range<usize>)| {
        let each = change.coefficients().into_iter().zip(place);
        each.map(|at| ratio(change.effect, at)).fold(0.0, f64::max)
    };
    places(changes).map(most).collect()
}

/// Four rotors in the place of all that they may be, with what still adds to them.
fn instead(
    model: &Model,
    (together, named): (&Together, Change),
    flights: &[&Prepared],
    candidates: usize,
) -> Option<Together> {
    let is_supported = |model: &Model, change| examine(model, change, flights, candidates).finding.supported;
    if named != HEAVIER || !is_supported(model, ALL_ROTORS) {
        return None;
    }
    let mut of_rotors = Together::of(model, &[ALL_ROTORS], flights).ok()?;
    for &change in together.changes.iter().filter(|change| !may_be_rotors(change)) {
        if is_supported(&of_rotors.model, change) {
            of_rotors = of_rotors.clone().and(change, flights).unwrap_or(of_rotors);
        }
    }
    Some(of_rotors)
}

/// The evidence for four rotors beside what else is named with them: what is left of the flights with all of it is `left`.
fn evidence(
    model: &Model,
    of_rotors: &Together,
    left: &[Residuals],
    flights: &[&Prepared],
    candidates: usize,
) -> EffectFinding {
    let mut finding = examine(model, ALL_ROTORS, flights, candidates).finding;
    let others: Vec<Change> = of_rotors.changes.iter().copied().filter(|c| *c != ALL_ROTORS).collect();
    if others.is_empty() {
        return finding;
    }
    let without = held_out(model, &others, flights);
    let sigma = model::AXES.map(|axis| errors(left)[axis].rms.max(f64::MIN_POSITIVE));
    let judged = (judged_axes(ALL_ROTORS.effect, model), &sigma);
    (finding.drop_percent_by_flight, finding.flights_improved[0]) = (Vec::new(), 0);
    take_gain(&mut finding, judged, flights, (&without, left));
    finding.supported = true;
    finding
}

/// What of the two is named: the first finding then, with what cannot be told from it among the `rivals`.
pub(crate) fn take_challenge(
    findings: &mut Vec<Found>,
    together: Together,
    challenged: Option<Challenged>,
    rivals: &mut Vec<Change>,
) -> Together {
    let Some(Challenged { mut finding, named, together: of_rotors, named_leaves, rotors_leave }) = challenged
    else {
        return together;
    };
    let less = |than, (axis, percent)| Reason::ExplainsLess { than, axis, percent };
    match (named_leaves, rotors_leave) {
        (Some(leaves), _) => {
            let is_gone =
                |change: &Change| together.changes.contains(change) && !of_rotors.changes.contains(change);
            for (_, gone) in findings.iter_mut().filter(|(change, _)| is_gone(change)) {
                gone.refuse(less(ALL_ROTORS, leaves));
            }
            findings.insert(0, (ALL_ROTORS, finding));
            // What stood for the others is none of the rotors.
            rivals.clear();
            of_rotors
        }
        (None, Some(leaves)) => {
            finding.refuse(less(named, leaves));
            findings.insert(1, (ALL_ROTORS, finding));
            together
        }
        (None, None) => {
            finding.refuse(Reason::RivalOf { best: named });
            finding.confounded_with.push(named.effect);
            if named == findings[0].0 {
                rivals.push(ALL_ROTORS);
            } else if let Some((_, own)) = findings.iter_mut().find(|(change, _)| *change == named) {
                own.confounded_with.push(ALL_ROTORS.effect);
            }
            findings.insert(1, (ALL_ROTORS, finding));
            together
        }
    }
}

/// Residuals of each flight with changes that were estimated from the others; a single one by itself.
fn held_out(model: &Model, changes: &[Change], flights: &[&Prepared]) -> Vec<Residuals> {
    let of_flight = |left_out: usize| {
        let others = flights.iter().enumerate().filter(|(i, _)| *i != left_out || flights.len() == 1);
        let others: Vec<&Prepared> = others.map(|(_, flight)| *flight).collect();
        let with = Together::of(model, changes, &others).map(|with| with.settled(&others));
        residuals(flights[left_out], with.as_ref().map_or(model, |with| &with.model))
    };
    (0..flights.len()).map(of_flight).collect()
}

/// The axis on which some residuals are larger than others, and by how many percent of their squares: where all axes together are,
/// by more than chance, and that axis by enough to matter.
fn leaves_more(more: &[Residuals], less: &[Residuals], flights: &[&Prepared]) -> Option<(Axis, f64)> {
    let (of_more, of_less) = (errors(more), errors(less));
    let mut blocks = Blocks::default();
    let noise = |axis: Axis| of_less[axis].rms.min(of_more[axis].rms).max(f64::MIN_POSITIVE);
    let weights = model::AXES.map(|axis| (axis, 1.0 / (noise(axis) * noise(axis))));
    for ((flight, a), b) in flights.iter().zip(more).zip(less) {
        take_fall(&mut blocks, flight, weights, (a, b));
    }
    let excess = |axis: Axis| 100.0 * (of_more[axis].sse / of_less[axis].sse - 1.0);
    let worst = model::AXES.into_iter().max_by(|a, b| excess(*a).total_cmp(&excess(*b)))?;
    let counts = blocks.p_value() < SIGNIFICANCE && excess(worst) > MATTERS_PERCENT;
    counts.then(|| (worst, excess(worst)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera makes the craft heavier and slower to turn; stronger motors do not make it lighter to turn.
    #[test]
    fn what_all_rotors_lack_alike_beside_more_mass_is_its_inertia() {
        let com = Change { effect: Effect::ComOffset, motor: None };
        let changes = [ALL_ROTORS, com, HEAVIER];
        let is = |losses: [f64; 4], mass_kg: f64| {
            let values = losses.into_iter().chain([0.006, 0.0, mass_kg]);
            is_inertia(&changes, &DVector::from_iterator(7, values))
        };
        assert!(is([0.033, 0.032, 0.033, 0.032], 0.055) && is([-0.03; 4], -0.05));
        assert!(!is([-0.04; 4], 0.06), "stronger motors");
        assert!(!is([0.05, 0.0, 0.03, 0.0], 0.05), "two weak motors");
        assert!(!is_inertia(&changes[..2], &DVector::from_element(6, 0.03)), "no mass");
    }
}
