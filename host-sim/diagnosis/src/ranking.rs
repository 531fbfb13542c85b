//! Every candidate's evidence, ranked: that of the effects found with the others in place, that of the rest by themselves and
//! what became of them. And which candidates the flights cannot tell from those found.

use model::Effect;
use sysid::{FitError, errors, statistics};

use crate::criteria::{Evidence, SIGNIFICANCE, TIE, weigh};
use crate::finding::{AxisDrop, CoefficientFigures, EffectFinding, supported};
use crate::held_out::{Validated, examine, judged_axes};
use crate::reason::Reason;
use crate::search::{CONTENDER, Chosen, PENALTY, Search};
use crate::search_error::{SearchError, Steps};
use crate::significance::{independent_stretches, zero_p_value};
use crate::subsets::Subset;

/// Candidates examined for confusion with each member.
const RIVALS: usize = 3;

/// A member of the set that was found, and a candidate that does as well in its place.
pub(crate) type Confounded = (Effect, Effect);

/// Candidates that do as well in a member's place.
pub(crate) fn confounded(search: &Search<'_>, chosen: &Chosen) -> Result<Vec<Confounded>, SearchError> {
    let mut found = Vec::new();
    let Some(with_set) = &chosen.validated else { return Ok(found) };
    let set = supported(&chosen.findings);
    let screen = &search.screen;
    let members: Vec<usize> = set.iter().filter_map(|effect| screen.index(*effect)).collect();
    // Nothing is said of sets with a member that cannot be linearised.
    if members.len() < set.len() {
        return Ok(found);
    }
    let Some(own) = screen.problem.score(&members, PENALTY) else { return Ok(found) };
    for (k, &member) in set.iter().enumerate() {
        let mut rivals = rivals(search, &members, k, CONTENDER * own.score);
        rivals.truncate(RIVALS);
        let mut steps = Steps::new(search.observer, rivals.len());
        for rival in &rivals {
            let start = screen.start(rival);
            let other = start[k].0;
            steps.next(&format!("trying {other} in place of {member}"))?;
            let Ok(instead) = search.fitted(&search.base.fit.model, &start) else { continue };
            if screen.gain(&instead.held_out, &with_set.held_out) < TIE {
                found.push((member, other));
            }
        }
    }
    Ok(found)
}

/// Sets with another candidate, of no more coefficients, in the place of the `k`-th of the `members`, best first.
fn rivals(search: &Search<'_>, members: &[usize], k: usize, least_score: f64) -> Vec<Subset> {
    let problem = &search.screen.problem;
    let mut rivals: Vec<Subset> = (0..problem.groups.len())
        .filter(|c| !members.contains(c))
        .filter(|&c| problem.groups[c].len() <= problem.groups[members[k]].len())
        .filter_map(|c| {
            let mut other = members.to_vec();
            other[k] = c;
            problem.score(&other, PENALTY)
        })
        .filter(|rival| rival.score >= least_score)
        .collect();
    rivals.sort_by(|a, b| b.score.total_cmp(&a.score));
    rivals
}

/// Every candidate's evidence, best first: `findings` of those that were found, and that of the rest by themselves.
pub(crate) fn ranked(
    search: &Search<'_>,
    findings: Vec<EffectFinding>,
    confounded: &[Confounded],
) -> Result<Vec<EffectFinding>, SearchError> {
    let mut all = findings;
    let set = supported(&all);
    for (index, &effect) in search.screen.candidates.iter().enumerate() {
        if !all.iter().any(|f| f.effect == effect) {
            all.push(linearised(search, index, &set, confounded));
        }
    }
    for (effect, alone) in search.searched()? {
        if !all.iter().any(|f| f.effect == effect) {
            all.push(exact(search, effect, alone, &set));
        }
    }
    for finding in all.iter_mut().filter(|f| f.supported) {
        let mine = confounded.iter().filter(|(member, _)| *member == finding.effect);
        finding.confounded_with = mine.map(|(_, other)| *other).collect();
    }
    correct(&mut all);
    all.sort_by(|a, b| b.supported.cmp(&a.supported).then(b.gain.total_cmp(&a.gain)));
    Ok(all)
}

/// The evidence for an effect by itself that was fitted exactly, and what became of it.
fn exact(
    search: &Search<'_>,
    effect: Effect,
    alone: &Result<Validated, FitError>,
    set: &[Effect],
) -> EffectFinding {
    let flights = (search.train, search.validate);
    match alone {
        Ok(with) => {
            let mut finding = examine(&search.base, with, effect, flights, search.count());
            if finding.supported {
                finding.refuse(if set.is_empty() {
                    Reason::OnlyByItself
                } else {
                    Reason::AddsNothing { beside: set.to_vec() }
                });
            }
            finding
        }
        Err(refused) => {
            EffectFinding::unsupported(effect, search.validate.len(), Reason::Refused(refused.clone()))
        }
    }
}

/// The evidence for an effect by itself, linearised, and what became of it.
fn linearised(search: &Search<'_>, index: usize, set: &[Effect], confounded: &[Confounded]) -> EffectFinding {
    let effect = search.screen.candidates[index];
    let mut finding = by_itself(search, index);
    if finding.coefficients.is_empty() {
        return finding;
    }
    let (alone, reason) = weigh(&Evidence::missing(&finding, &search.base.fit.model));
    finding.reason = match (alone, confounded.iter().find(|(_, other)| *other == effect)) {
        (_, Some((member, _))) => {
            finding.confounded_with.push(*member);
            Reason::Confounded { with: *member, separate: separating_manoeuvre(effect, *member) }
        }
        (true, None) if set.is_empty() => Reason::OnlyLinearised,
        (true, None) => Reason::AddsNothing { beside: set.to_vec() },
        (false, None) => reason,
    };
    finding
}

/// The figures of a linearised candidate by itself; no coefficients where the flights do not move it.
fn by_itself(search: &Search<'_>, index: usize) -> EffectFinding {
    let effect = search.screen.candidates[index];
    let info = effect.info();
    let not_excited = Reason::NotExcited { excitation: info.excitation };
    let mut finding = EffectFinding::unsupported(effect, search.validate.len(), not_excited);
    let axes = judged_axes(effect, &search.base.fit.model);
    let Some(single) = search.screen.single(index, (axes, &search.base.fit.sigma)) else { return finding };
    finding.coefficients = info
        .coefficients
        .iter()
        .enumerate()
        .map(|(k, c)| {
            let std_error = single.covariance[(k, k)].max(0.0).sqrt();
            CoefficientFigures::new(c, single.values[k], std_error, &search.base.fit.model)
        })
        .collect();
    let before = errors(&search.base.held_out);
    for &axis in axes {
        let sse = before[axis].sse;
        finding.axes.insert(axis.name(), AxisDrop::new(sse, sse * single.ratio[axis.index()]));
    }
    finding.drop_percent = single.drop_percent;
    finding.flights_improved[0] = single.flights_improved;
    finding.gain = single.gain;
    let independent = independent_stretches(search.train);
    let p_value = zero_p_value(single.values.as_slice(), &single.covariance, info.coefficients, independent);
    finding.p_value = (p_value * search.count() as f64).min(1.0);
    finding
}

/// The manoeuvre that separates two effects, where one is known.
pub fn separating_manoeuvre(a: Effect, b: Effect) -> Option<&'static str> {
    let known = |x: Effect, y: Effect| {
        x.info().confused_with.iter().find(|(id, _)| *id == y.id()).map(|(_, how)| *how)
    };
    known(a, b).or_else(|| known(b, a))
}

/// Makes Bonferroni's correction, under which each p-value counts as one of all candidates, Holm's.
fn correct(findings: &mut [EffectFinding]) {
    let mut p_values: Vec<f64> = findings.iter().map(|f| f.p_value).collect();
    statistics::holm(&mut p_values);
    for (finding, p_value) in findings.iter_mut().zip(p_values) {
        finding.p_value = p_value;
    }
    debug_assert!(findings.iter().all(|f| !f.supported || f.p_value <= SIGNIFICANCE));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manoeuvre_that_separates_is_found_from_either_side() {
        let how = separating_manoeuvre(Effect::Tether, Effect::SteadyWind);
        assert!(how.is_some_and(|how| how.contains("corners")));
        assert_eq!(how, separating_manoeuvre(Effect::SteadyWind, Effect::Tether));
        assert_eq!(separating_manoeuvre(Effect::Tether, Effect::QuadraticYawDamping), None);
    }

    /// Four candidates, the p-values of R's `p.adjust` with method "holm".
    #[test]
    fn p_values_are_corrected_after_holm() {
        let mut all: Vec<EffectFinding> = [0.04, 0.16, 0.12, 0.02]
            .map(|bonferroni| {
                let mut finding = EffectFinding::unsupported(Effect::Tether, 2, Reason::LikeChance);
                finding.p_value = bonferroni;
                finding
            })
            .into();
        correct(&mut all);
        for (finding, expected) in all.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((finding.p_value - expected).abs() < 1e-12);
        }
    }
}
