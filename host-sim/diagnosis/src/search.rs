//! Which effects join a model: a search over sets, then each member's own evidence.
//!
//! 1. All sets of up to three candidates are scored, linearised about the model ([`crate::subsets`]). The few best are fitted
//!    exactly and the best of those joins. From there once more, until no set gains.
//!    Candidates that have no derivative at zero to be linearised by (the length of a pendulum, a user's decay length) are fitted
//!    exactly, alone and beside the best set.
//! 2. Each member must be supported with the others in place; the weakest that is not leaves, and the rest are weighed
//!    again.
//! 3. A candidate that does as well in a member's place is confounded with it.

use std::cell::OnceCell;

use model::{Effect, Kind, Model};

use crate::diagnose::{
    AxisDrop, CoefficientFigures, EffectFinding, SIGNIFICANCE, evidence, independent_stretches, separate,
    wald_p_value, weigh, zero_p_value,
};
use crate::screen::Screen;
use crate::subsets::Subset;
use sysid::fit::starts::Demand;
use sysid::fit::{check_residuals, fit_if, lifts};
use sysid::prepare::Prepared;
use sysid::{Fit, FitError, Residuals, errors, residuals};

/// Held-out log-likelihood that a coefficient must bring for its effect to be looked at: what one that is not there brings by
/// chance is below zero on average, and above this once in ten.
pub(crate) const PENALTY: f64 = 1.0;
/// Most effects in a set of the search.
pub(crate) const SET: usize = 3;
/// Sets that are fitted exactly in a round.
const CONTENDERS: usize = 4;
/// Part of the best set's score that a contender has, linearised; the exact fit may reverse the order of two as close as that.
const CONTENDER: f64 = 0.6;
/// p-value of the coefficients that an effect has by itself, from which on it is not tried with others.
const BY_CHANCE: f64 = 0.05;
/// Rounds of the search; most effects found is this times `SET`.
const ROUNDS: usize = 2;
/// Logarithm of the likelihood ratio under which two sets do equally well: odds of 20 to 1.
const TIE: f64 = 3.0;
/// Candidates examined for confusion with each member.
const RIVALS: usize = 3;

/// A model refitted on the training flights and its residuals on the held-out ones.
#[derive(Clone)]
pub(crate) struct Judged {
    pub(crate) fit: Fit,
    pub(crate) held_out: Vec<Residuals>,
}

/// Fits `effects`, from the values of `model` on, and predicts the held-out flights.
pub(crate) fn judge(
    model: &Model,
    effects: &[Effect],
    train: &[&Prepared],
    validate: &[&Prepared],
) -> Result<Judged, FitError> {
    judged(sysid::fit(train, &model.vehicle, effects, Some(model))?, validate)
}

/// What a fit predicts of the held-out flights.
fn judged(fit: Fit, validate: &[&Prepared]) -> Result<Judged, FitError> {
    let held_out: Vec<Residuals> = validate.iter().map(|flight| residuals(flight, &fit.model)).collect();
    check_residuals(validate, &held_out, &fit.model)?;
    Ok(Judged { fit, held_out })
}

/// Whether an effect that is not there has such coefficients by itself once in twenty times.
fn differs_by_chance(fit: &Fit, effect: Effect, train: &[&Prepared]) -> bool {
    wald_p_value(fit, effect, train) > BY_CHANCE
}

/// What was found: the members of the set with their evidence, and the model with all that are supported.
pub(crate) struct Chosen {
    pub(crate) findings: Vec<EffectFinding>,
    /// Nothing where no effect is supported: the model as it was.
    pub(crate) judged: Option<Judged>,
    confounded: Vec<(Effect, Effect)>,
}

/// A set's held-out score, its members, and the model with them.
type Scored = (f64, Vec<Effect>, Judged);

/// The candidates for what a model lacks, and the flights to tell by.
pub(crate) struct Search<'a> {
    pub(crate) base: Judged,
    pub(crate) screen: Screen,
    /// Candidates that are fitted exactly: where the fit is a search over shapes, and users' effects.
    searched: Vec<Effect>,
    /// The base model with each of them by itself, once somebody asks.
    alone: OnceCell<Vec<Result<Judged, FitError>>>,
    train: &'a [&'a Prepared],
    validate: &'a [&'a Prepared],
}

impl<'a> Search<'a> {
    /// Fits the model as it is and linearises the candidates about it.
    pub(crate) fn new(
        model: &Model,
        candidates: Vec<Effect>,
        train: &'a [&'a Prepared],
        validate: &'a [&'a Prepared],
    ) -> Result<Self, FitError> {
        let base = judge(model, &model.effects(), train, validate)?;
        // A user's formula may have no value at some sample: that must not spoil the others.
        let is_searched = |effect: &Effect| !effect.starts().is_empty() || matches!(effect, Effect::User(_));
        let (searched, linearised): (Vec<Effect>, Vec<Effect>) =
            candidates.into_iter().partition(is_searched);
        let screen = Screen::new(&base.fit, &linearised, train, validate)?;
        Ok(Self { base, screen, searched, alone: OnceCell::new(), train, validate })
    }

    /// Candidates that are fitted exactly, each with the base model.
    fn searched(&self) -> impl Iterator<Item = (Effect, &Result<Judged, FitError>)> {
        let with = |effect: &Effect| {
            let mut effects = self.base.fit.model.effects();
            effects.push(*effect);
            let model = &self.base.fit.model;
            let fit = fit_if(self.train, &model.vehicle, &effects, Some(model), Demand::Promising)?;
            judged(fit, self.validate)
        };
        let alone = self.alone.get_or_init(|| self.searched.iter().map(with).collect());
        self.searched.iter().copied().zip(alone)
    }

    /// Candidates.
    pub(crate) fn count(&self) -> usize {
        self.screen.candidates.len() + self.searched.len()
    }

    /// Finds the set.
    pub(crate) fn choose(&self, progress: &mut impl FnMut(&str)) -> Result<Chosen, FitError> {
        let mut set: Vec<Effect> = Vec::new();
        let mut current: Option<Judged> = None;
        for round in 0..ROUNDS {
            let again;
            let screen = match &current {
                None => &self.screen,
                Some(judged) => {
                    let rest: Vec<Effect> =
                        self.screen.candidates.iter().copied().filter(|e| !set.contains(e)).collect();
                    again = Screen::new(&judged.fit, &rest, self.train, self.validate)?;
                    &again
                }
            };
            let sets = screen.problem.search(SET, PENALTY);
            let from = current.as_ref().unwrap_or(&self.base);
            let best = self.best_exact(from, screen, &sets, progress);
            let Some((members, judged)) = self.with_searched(from, screen, &set, best, progress) else {
                break;
            };
            set.extend(members);
            current = Some(judged);
            if round + 1 == ROUNDS {
                break;
            }
        }
        let (findings, judged) = self.prune(set, current, progress)?;
        let mut chosen = Chosen { findings, judged, confounded: Vec::new() };
        self.mark_confounded(&mut chosen, progress);
        Ok(chosen)
    }

    /// The best of the promising sets, each fitted exactly; nothing where none gains.
    fn best_exact(
        &self,
        from: &Judged,
        screen: &Screen,
        sets: &[Subset],
        progress: &mut impl FnMut(&str),
    ) -> Option<Scored> {
        let near = sets.iter().take_while(|set| set.score >= CONTENDER * sets[0].score).take(CONTENDERS);
        let best = self.best_of(from, screen, near, progress);
        // Sets that end in nonsense hide a member that by itself does not.
        let single = sets.iter().filter(|set| set.members.len() == 1).take(CONTENDERS);
        best.or_else(|| self.best_of(from, screen, single, progress))
    }

    fn best_of<'s>(
        &self,
        from: &Judged,
        screen: &Screen,
        sets: impl Iterator<Item = &'s Subset>,
        progress: &mut impl FnMut(&str),
    ) -> Option<Scored> {
        let mut best: Option<Scored> = None;
        for set in sets {
            let start = screen.start(set);
            let members: Vec<Effect> = start.iter().map(|(effect, _)| *effect).collect();
            progress(&members.iter().map(|e| e.id()).collect::<Vec<_>>().join(" and "));
            let Ok(judged) = self.fitted(&from.fit.model, &start) else { continue };
            if !lifts(&judged.fit.model) {
                continue;
            }
            let score = screen.gain(&from.held_out, &judged.held_out) - PENALTY * set.values.len() as f64;
            if score > best.as_ref().map_or(0.0, |b| b.0) {
                best = Some((score, members, judged));
            }
        }
        best
    }

    /// The better of the best set and those with a candidate that cannot be linearised, alone and beside that set.
    fn with_searched(
        &self,
        from: &Judged,
        screen: &Screen,
        set: &[Effect],
        best: Option<Scored>,
        progress: &mut impl FnMut(&str),
    ) -> Option<(Vec<Effect>, Judged)> {
        let linearised = best.as_ref().map_or_else(Vec::new, |(_, members, _)| members.clone());
        let mut best = best;
        for (effect, alone) in self.searched().filter(|(effect, _)| !set.contains(effect)) {
            let penalty = |effects: &[Effect]| -> f64 {
                let count: usize = effects.iter().map(|e| e.info().coefficients.len()).sum();
                PENALTY * count as f64
            };
            // One that cannot be fitted or is worth nothing to the base model is not tried again.
            let Ok(alone) = alone else { continue };
            if screen.gain(&self.base.held_out, &alone.held_out) <= penalty(&[effect])
                || differs_by_chance(&alone.fit, effect, self.train)
            {
                continue;
            }
            progress(effect.id());
            let mut start = from.fit.model.clone();
            if let Some(term) = alone.fit.model.term(effect) {
                start.set(effect, &term.coefficients.iter().map(|c| c.value).collect::<Vec<_>>());
            }
            let mut beside = vec![Vec::new()];
            if !linearised.is_empty() {
                beside.push(linearised.clone());
            }
            for mut members in beside {
                members.push(effect);
                let mut effects = from.fit.model.effects();
                effects.extend(&members);
                // By itself on top of the base model it has been fitted already.
                let judged = match members.len() + set.len() {
                    1 => Ok(alone.clone()),
                    _ => judge(&start, &effects, self.train, self.validate),
                };
                let Ok(judged) = judged else { continue };
                let score = screen.gain(&from.held_out, &judged.held_out) - penalty(&members);
                if score > best.as_ref().map_or(0.0, |b| b.0) {
                    best = Some((score, members, judged));
                }
            }
        }
        best.map(|(_, members, judged)| (members, judged))
    }

    /// The model with more effects, from their linearised values on, or from none where that way ends nowhere.
    fn fitted(&self, model: &Model, more: &[(Effect, Vec<f64>)]) -> Result<Judged, FitError> {
        let mut effects = model.effects();
        effects.extend(more.iter().map(|(effect, _)| *effect));
        let mut start = model.clone();
        for (effect, values) in more.iter().filter(|(e, _)| e.info().kind == Kind::Adjusting) {
            let possible = effect.info().coefficients.iter().zip(values);
            let values: Vec<f64> = possible.map(|(c, v)| v.clamp(c.possible.0, c.possible.1)).collect();
            start.set(*effect, &values);
        }
        judge(&start, &effects, self.train, self.validate)
            .or_else(|_| judge(model, &effects, self.train, self.validate))
    }

    /// The base model with `set`.
    fn with(&self, start: &Model, set: &[Effect]) -> Result<Judged, FitError> {
        let mut effects = self.base.fit.model.effects();
        effects.extend(set);
        // Values from a larger set can lie where an effect saturates: then from the base model's.
        judge(start, &effects, self.train, self.validate)
            .or_else(|_| judge(&self.base.fit.model, &effects, self.train, self.validate))
    }

    /// Weighs each member with the others in place; those that are not supported leave, the weakest first.
    fn prune(
        &self,
        mut set: Vec<Effect>,
        mut with: Option<Judged>,
        progress: &mut impl FnMut(&str),
    ) -> Result<(Vec<EffectFinding>, Option<Judged>), FitError> {
        let count = self.count();
        while let Some(all) = with.take().filter(|_| !set.is_empty()) {
            let mut weighed: Vec<(EffectFinding, Option<Judged>)> = Vec::new();
            for (k, &effect) in set.iter().enumerate() {
                progress(effect.id());
                let mut rest = set.clone();
                rest.remove(k);
                // Where the rest cannot be fitted without it, it is weighed against the base model.
                let without = if rest.is_empty() { None } else { self.with(&all.fit.model, &rest).ok() };
                let reference = without.as_ref().unwrap_or(&self.base);
                let finding = evidence(reference, &all, effect, (self.train, self.validate), count);
                weighed.push((finding, without));
            }
            let weakest = (0..set.len())
                .filter(|&k| !weighed[k].0.supported)
                .min_by(|&a, &b| weighed[a].0.gain.total_cmp(&weighed[b].0.gain));
            let Some(k) = weakest else {
                let findings = weighed.into_iter().map(|(finding, _)| finding).collect();
                return Ok((findings, Some(all)));
            };
            set.remove(k);
            with = weighed.swap_remove(k).1;
        }
        Ok((Vec::new(), None))
    }

    /// Fits the members that are still supported again.
    pub(crate) fn refit(&self, chosen: &mut Chosen) -> Result<(), FitError> {
        let set: Vec<Effect> = supported(&chosen.findings);
        chosen.judged = match &chosen.judged {
            Some(judged) if !set.is_empty() => Some(self.with(&judged.fit.model, &set)?),
            _ => None,
        };
        Ok(())
    }

    /// Candidates that do as well in a member's place.
    fn mark_confounded(&self, chosen: &mut Chosen, progress: &mut impl FnMut(&str)) {
        let Some(judged) = &chosen.judged else { return };
        let set = supported(&chosen.findings);
        let problem = &self.screen.problem;
        let index = |effect: &Effect| self.screen.index(*effect);
        let members: Vec<usize> = set.iter().filter_map(index).collect();
        // Nothing is said of sets with a member that cannot be linearised.
        if members.len() < set.len() {
            return;
        }
        let Some(own) = problem.judge(&members, PENALTY) else { return };
        for (k, &member) in set.iter().enumerate() {
            let mut rivals: Vec<Subset> = (0..problem.groups.len())
                .filter(|c| !members.contains(c))
                .filter(|&c| problem.groups[c].len() <= problem.groups[members[k]].len())
                .filter_map(|c| {
                    let mut other = members.clone();
                    other[k] = c;
                    problem.judge(&other, PENALTY)
                })
                .filter(|rival| rival.score >= CONTENDER * own.score)
                .collect();
            rivals.sort_by(|a, b| b.score.total_cmp(&a.score));
            for rival in rivals.iter().take(RIVALS) {
                let start = self.screen.start(rival);
                let other = start[k].0;
                progress(other.id());
                let Ok(instead) = self.fitted(&self.base.fit.model, &start) else { continue };
                if self.screen.gain(&instead.held_out, &judged.held_out) < TIE {
                    chosen.confounded.push((member, other));
                }
            }
        }
    }

    /// Every candidate's evidence, best first: that of the members with the others in place, that of the rest by themselves.
    pub(crate) fn all_findings(
        &self,
        chosen: Chosen,
        _progress: &mut impl FnMut(&str),
    ) -> Vec<EffectFinding> {
        let Chosen { findings: mut all, confounded, .. } = chosen;
        let set = supported(&all);
        for (index, &effect) in self.screen.candidates.iter().enumerate() {
            if !all.iter().any(|f| f.effect == effect.id()) {
                all.push(self.linearised(index, effect, &set, &confounded));
            }
        }
        for (effect, alone) in self.searched() {
            if !all.iter().any(|f| f.effect == effect.id()) {
                all.push(self.exact(effect, alone, &set));
            }
        }
        for finding in all.iter_mut().filter(|f| f.supported) {
            let mine = confounded.iter().filter(|(member, _)| member.id() == finding.effect);
            finding.confounded_with = mine.map(|(_, other)| other.id()).collect();
        }
        holm(&mut all);
        all.sort_by(|a, b| b.supported.cmp(&a.supported).then(b.gain.total_cmp(&a.gain)));
        all
    }

    /// The evidence for an effect by itself that was fitted exactly, and what became of it.
    fn exact(&self, effect: Effect, alone: &Result<Judged, FitError>, set: &[Effect]) -> EffectFinding {
        match alone {
            Ok(with) => {
                let flights = (self.train, self.validate);
                let mut finding = evidence(&self.base, with, effect, flights, self.count());
                if finding.supported {
                    finding.supported = false;
                    let names: Vec<&str> = set.iter().map(|e| e.id()).collect();
                    finding.reason = if names.is_empty() {
                        "supported by itself, and not with what else these flights show".into()
                    } else {
                        format!("adds nothing once {} is in the model", names.join(" and "))
                    };
                }
                finding
            }
            Err(refused) => {
                let mut finding = EffectFinding::unsupported(effect, self.validate.len());
                finding.reason = refused.to_string();
                finding
            }
        }
    }

    /// The evidence for an effect by itself, linearised, and what became of it.
    fn linearised(
        &self,
        index: usize,
        effect: Effect,
        set: &[Effect],
        confounded: &[(Effect, Effect)],
    ) -> EffectFinding {
        let mut finding = EffectFinding::unsupported(effect, self.validate.len());
        let info = effect.info();
        let sigma = &self.base.fit.sigma;
        let Some(single) = self.screen.single(index, sigma) else {
            finding.reason = format!("not excited by these flights; to see it: {}", info.excitation);
            return finding;
        };
        finding.coefficients = info
            .coefficients
            .iter()
            .enumerate()
            .map(|(k, c)| CoefficientFigures {
                name: c.name,
                value: single.values[k],
                std_error: single.covariance[(k, k)].max(0.0).sqrt(),
                unit: c.unit,
            })
            .collect();
        let before = errors(&self.base.held_out);
        for &axis in info.axes {
            let sse = before[axis].sse;
            finding.axes.insert(axis.name(), AxisDrop::new(sse, sse * single.ratio[axis.index()]));
        }
        finding.drop_percent = single.drop_percent;
        finding.flights_improved[0] = single.flights_improved;
        finding.gain = single.gain;
        let independent = independent_stretches(self.train);
        let p_value =
            zero_p_value(single.values.as_slice(), &single.covariance, info.coefficients, independent);
        finding.p_value = (p_value * self.count() as f64).min(1.0);
        let (alone, reason) = weigh(&finding, effect, &self.base.fit.model);
        finding.reason = match (alone, confounded.iter().find(|(_, other)| *other == effect)) {
            (_, Some((member, _))) => {
                finding.confounded_with.push(member.id());
                format!("these flights cannot tell it from {member}{}", separate(effect, *member))
            }
            (true, None) if set.is_empty() => {
                "promising by itself in a linearised fit, and not supported by an exact one".into()
            }
            (true, None) => {
                let names: Vec<&str> = set.iter().map(|e| e.id()).collect();
                format!("adds nothing once {} is in the model", names.join(" and "))
            }
            (false, None) => reason,
        };
        finding
    }
}

fn supported(findings: &[EffectFinding]) -> Vec<Effect> {
    findings.iter().filter(|f| f.supported).filter_map(|f| Effect::from_id(f.effect)).collect()
}

/// Bonferroni's correction, under which each p-value counts as one of all candidates, made Holm's (1979): the k-th smallest
/// is one of those that are left, and none is smaller than one before it.
fn holm(findings: &mut [EffectFinding]) {
    let count = findings.len();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| findings[a].p_value.total_cmp(&findings[b].p_value));
    let mut largest = 0.0_f64;
    for (rank, &k) in order.iter().enumerate() {
        let adjusted = findings[k].p_value * (count - rank) as f64 / count as f64;
        // What Bonferroni cut at 1 stays there: its own value is not known.
        let adjusted = if findings[k].p_value >= 1.0 { 1.0 } else { adjusted };
        largest = largest.max(adjusted);
        findings[k].p_value = largest.min(1.0);
    }
    debug_assert!(findings.iter().all(|f| !f.supported || f.p_value <= SIGNIFICANCE));
}
