//! Which effects join a model: a search over sets, then each member's own evidence.
//!
//! 1. All sets of up to three candidates are scored, linearised about the model ([`crate::subsets`]). The few best are fitted
//!    exactly and the best of those joins. From there once more, until no set gains.
//!    Candidates that have no derivative at zero to be linearised by (the length of a pendulum, a user's decay length) are fitted
//!    exactly, alone and beside the best set.
//! 2. Each member must be supported with the others in place; the weakest that is not leaves, and the rest are weighed
//!    again.
//! 3. A candidate that does as well in a member's place is confounded with it.

use std::cell::{OnceCell, RefCell};
use std::collections::HashMap;

use model::{Effect, Kind, Model};

use crate::finding::{EffectFinding, supported};
use crate::held_out::{Validated, examine, fit_and_validate, fit_more, validated};
use crate::observer::{Observer, Progress};
use crate::reason::{Reason, joined};
use crate::screen::Screen;
use crate::search_error::{SearchError, Steps, going_on};
use crate::significance::effect_p_value;
use crate::subsets::Subset;
use sysid::fit::produces_thrust;
use sysid::prepare::Prepared;
use sysid::{Fit, FitError};

/// Held-out log-likelihood that a coefficient must bring for its effect to be looked at: what one that is not there brings by
/// chance is below zero on average, and above this once in ten.
pub(crate) const PENALTY: f64 = 1.0;
/// Most effects in a set of the search.
pub(crate) const SET: usize = 3;
/// Sets that are fitted exactly in a round.
const CONTENDERS: usize = 4;
/// Part of the best set's score that a contender has, linearised; the exact fit may reverse the order of two as close as that.
pub(crate) const CONTENDER: f64 = 0.6;
/// p-value of the coefficients that an effect has by itself, from which on it is not tried with others.
const BY_CHANCE: f64 = 0.05;
/// Rounds of the search; most effects found is this times `SET`.
const ROUNDS: usize = 2;
/// Searches: another one without what was refused, for a set that ends in nonsense hides what joins it best.
const SEARCHES: usize = 2;

/// Whether an effect that is not there has such coefficients by itself once in twenty times.
pub(crate) fn differs_by_chance(fit: &Fit, effect: Effect, train: &[&Prepared]) -> bool {
    effect_p_value(fit, effect, train) > BY_CHANCE
}

/// What was found: the members of the set with their evidence, and the model with all that are supported.
pub(crate) struct Chosen {
    pub(crate) findings: Vec<EffectFinding>,
    /// Nothing where no effect is supported: the model as it was.
    pub(crate) validated: Option<Validated>,
}

/// Members of a set, and the model with them.
type Rest = (Vec<Effect>, Validated);

/// A set's held-out score, its members, and the model with them.
pub(crate) type Scored = (f64, Vec<Effect>, Validated);

/// The candidates for what a model lacks, and the flights to tell by.
pub(crate) struct Search<'a> {
    pub(crate) base: Validated,
    pub(crate) screen: Screen,
    /// Candidates that are fitted exactly: where the fit is a search over shapes, and users' effects.
    pub(crate) searched: Vec<Effect>,
    /// The base model with each of them by itself, once somebody asks.
    alone: OnceCell<Vec<Result<Validated, FitError>>>,
    /// What fits of sets came to, by all effects of their models: a search meets a set again and again. What they leave of the flights held
    /// out is formed anew, which is cheap: kept for all sets, it would take up more room than the flights.
    fits: RefCell<HashMap<Vec<Effect>, Fit>>,
    pub(crate) train: &'a [&'a Prepared],
    pub(crate) validate: &'a [&'a Prepared],
    /// Hears of every candidate, and may stop before each.
    pub(crate) observer: &'a dyn Observer,
}

impl<'a> Search<'a> {
    /// Fits the model as it is and linearises the candidates about it.
    pub(crate) fn new(
        model: &Model,
        candidates: Vec<Effect>,
        train: &'a [&'a Prepared],
        validate: &'a [&'a Prepared],
        observer: &'a dyn Observer,
    ) -> Result<Self, SearchError> {
        going_on(observer)?;
        observer.progress(Progress { activity: "fitting the model as it is", steps: None });
        let base = fit_and_validate(model, &model.effects(), train, validate)?;
        // A user's formula may have no value at some sample: that must not spoil the others.
        let is_searched = |effect: &Effect| !effect.starts().is_empty() || matches!(effect, Effect::User(_));
        let (searched, linearised): (Vec<Effect>, Vec<Effect>) =
            candidates.into_iter().partition(is_searched);
        going_on(observer)?;
        observer.progress(Progress { activity: "linearising the candidates", steps: None });
        let screen = Screen::new(&base.fit, &linearised, train, validate)?;
        Ok(Self {
            base,
            screen,
            searched,
            alone: OnceCell::new(),
            fits: RefCell::default(),
            train,
            validate,
            observer,
        })
    }

    /// Candidates that are fitted exactly, each with the base model.
    pub(crate) fn searched(
        &self,
    ) -> Result<impl Iterator<Item = (Effect, &Result<Validated, FitError>)>, SearchError> {
        let alone = match self.alone.get() {
            Some(alone) => alone,
            None => {
                let mut steps = Steps::new(self.observer, self.searched.len());
                let mut alone = Vec::new();
                for effect in &self.searched {
                    steps.next(&format!("trying {effect}"))?;
                    alone.push(self.more(&self.base, &[*effect]));
                }
                self.alone.get_or_init(|| alone)
            }
        };
        Ok(self.searched.iter().copied().zip(alone))
    }

    /// A model with more effects, of which nothing is known.
    pub(crate) fn more(&self, from: &Validated, members: &[Effect]) -> Result<Validated, FitError> {
        fit_more(&from.fit.model, members, (self.train, self.validate))
    }

    /// Candidates.
    pub(crate) fn count(&self) -> usize {
        self.screen.candidates.len() + self.searched.len()
    }

    /// Finds the set, without candidates that were refused before.
    pub(crate) fn choose_without(&self, refused: &[Effect]) -> Result<Chosen, SearchError> {
        let (mut refused, mut chosen) = (refused.to_vec(), Chosen { findings: Vec::new(), validated: None });
        for _ in 0..SEARCHES {
            let before = supported(&chosen.findings);
            let (set, with) = self.grown(before.clone(), chosen.validated.clone(), &refused)?;
            if set.len() == before.len() {
                break;
            }
            let (findings, validated) = self.prune(set.clone(), with)?;
            chosen = Chosen { findings, validated };
            let kept = supported(&chosen.findings);
            let known = refused.len();
            refused.extend(set.into_iter().filter(|effect| !kept.contains(effect)));
            if refused.len() == known {
                break;
            }
        }
        Ok(chosen)
    }

    /// A set that the model gains by, from `set` on, without what was `refused`; and the model with it.
    fn grown(
        &self,
        mut set: Vec<Effect>,
        mut current: Option<Validated>,
        refused: &[Effect],
    ) -> Result<(Vec<Effect>, Option<Validated>), SearchError> {
        for _ in 0..ROUNDS {
            if set.len() >= ROUNDS * SET {
                break;
            }
            let out: Vec<Effect> = set.iter().chain(refused).copied().collect();
            let again;
            let screen = if out.is_empty() {
                &self.screen
            } else {
                again = self.screen_about(current.as_ref(), &out)?;
                &again
            };
            let sets = self.promising(screen)?;
            let from = current.as_ref().unwrap_or(&self.base);
            let best = self.best_exact(from, screen, &sets)?;
            let Some((members, validated)) = self.with_searched(from, screen, &out, best)? else {
                break;
            };
            set.extend(members);
            current = Some(validated);
        }
        Ok((set, current))
    }

    /// The candidates but for those that are `out`, about a model that was found, or the base model.
    fn screen_about(&self, found: Option<&Validated>, out: &[Effect]) -> Result<Screen, FitError> {
        let Some(found) = found else { return Ok(self.screen.without(out)) };
        let candidates = self.screen.candidates.iter().copied();
        let rest: Vec<Effect> = candidates.filter(|effect| !out.contains(effect)).collect();
        Screen::new(&found.fit, &rest, self.train, self.validate)
    }

    /// Every set of candidates that gains, linearised, best first.
    fn promising(&self, screen: &Screen) -> Result<Vec<Subset>, SearchError> {
        let told = |done, all| {
            going_on(self.observer)?;
            let activity = "scoring sets of effects";
            self.observer.progress(Progress { activity, steps: Some((done, all)) });
            Ok(())
        };
        screen.problem.search_told(SET, PENALTY, told)
    }

    /// The best of the promising sets, each fitted exactly; nothing where none gains.
    fn best_exact(
        &self,
        from: &Validated,
        screen: &Screen,
        sets: &[Subset],
    ) -> Result<Option<Scored>, SearchError> {
        let near = sets.iter().take_while(|set| set.score >= CONTENDER * sets[0].score).take(CONTENDERS);
        let best = self.best_of(from, screen, &near.collect::<Vec<_>>())?;
        if best.is_some() {
            return Ok(best);
        }
        // Sets that end in nonsense hide a member that by itself does not.
        let single = sets.iter().filter(|set| set.members.len() == 1).take(CONTENDERS);
        self.best_of(from, screen, &single.collect::<Vec<_>>())
    }

    fn best_of(
        &self,
        from: &Validated,
        screen: &Screen,
        sets: &[&Subset],
    ) -> Result<Option<Scored>, SearchError> {
        let mut best: Option<Scored> = None;
        let mut steps = Steps::new(self.observer, sets.len());
        for set in sets {
            let start = screen.start(set);
            let members: Vec<Effect> = start.iter().map(|(effect, _)| *effect).collect();
            steps.next(&format!("trying {}", joined(&members, " and ")))?;
            let Ok(validated) = self.fitted(&from.fit.model, &start) else { continue };
            if !produces_thrust(&validated.fit.model) {
                continue;
            }
            let score = screen.gain(&from.held_out, &validated.held_out) - PENALTY * set.values.len() as f64;
            if score > best.as_ref().map_or(0.0, |b| b.0) {
                best = Some((score, members, validated));
            }
        }
        Ok(best)
    }

    /// The better of the best set and those with a candidate that cannot be linearised, alone and beside that set. What is `out`
    /// is in the model or was refused.
    fn with_searched(
        &self,
        from: &Validated,
        screen: &Screen,
        out: &[Effect],
        best: Option<Scored>,
    ) -> Result<Option<(Vec<Effect>, Validated)>, SearchError> {
        let linearised = best.as_ref().map_or_else(Vec::new, |(_, members, _)| members.clone());
        let mut best = best;
        let mut steps = Steps::new(self.observer, self.searched.len());
        for (effect, alone) in self.searched()?.filter(|(effect, _)| !out.contains(effect)) {
            steps.next(&format!("trying {effect} beside the others"))?;
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
            let mut start = from.fit.model.clone();
            if let Some(term) = alone.fit.model.term(effect) {
                start.set(effect, &term.coefficients.iter().map(|c| c.value).collect::<Vec<_>>());
            }
            let mut beside = vec![Vec::new()];
            if !linearised.is_empty() {
                beside.push(linearised.clone());
            }
            for mut members in beside {
                going_on(self.observer)?;
                members.push(effect);
                let mut effects = from.fit.model.effects();
                effects.extend(&members);
                // By itself on top of the base model it has been fitted already.
                let validated =
                    match members.len() + from.fit.model.terms.len() - self.base.fit.model.terms.len() {
                        1 => Ok(alone.clone()),
                        _ => fit_and_validate(&start, &effects, self.train, self.validate),
                    };
                let Ok(validated) = validated else { continue };
                let score = screen.gain(&from.held_out, &validated.held_out) - penalty(&members);
                if score > best.as_ref().map_or(0.0, |b| b.0) {
                    best = Some((score, members, validated));
                }
            }
        }
        Ok(best.map(|(_, members, validated)| (members, validated)))
    }

    /// The model with more effects, from their linearised values on, or from none where that way ends nowhere.
    pub(crate) fn fitted(&self, model: &Model, more: &[(Effect, Vec<f64>)]) -> Result<Validated, FitError> {
        let mut effects = model.effects();
        effects.extend(more.iter().map(|(effect, _)| *effect));
        let mut start = model.clone();
        for (effect, values) in more.iter().filter(|(e, _)| e.info().kind == Kind::Adjusting) {
            let possible = effect.info().coefficients.iter().zip(values);
            let values: Vec<f64> = possible.map(|(c, v)| v.clamp(c.possible.0, c.possible.1)).collect();
            start.set(*effect, &values);
        }
        self.fitted_once([&start, model], &effects)
    }

    /// The fit of all effects of a model, unless it is known: from the first start, or from the second where that way ends nowhere.
    fn fitted_once(&self, starts: [&Model; 2], effects: &[Effect]) -> Result<Validated, FitError> {
        if let Some(fit) = self.fits.borrow().get(effects) {
            return validated(fit.clone(), self.validate);
        }
        let from = |start: &Model| fit_and_validate(start, effects, self.train, self.validate);
        let found = from(starts[0]).or_else(|_| from(starts[1]))?;
        self.fits.borrow_mut().insert(effects.to_vec(), found.fit.clone());
        Ok(found)
    }

    /// The base model with `set`.
    fn with(&self, start: &Model, set: &[Effect]) -> Result<Validated, FitError> {
        let mut effects = self.base.fit.model.effects();
        effects.extend(set);
        // Values from a larger set can lie where an effect saturates: then from the base model's.
        self.fitted_once([start, &self.base.fit.model], &effects)
    }

    /// Weighs each member with the others in place; those that are not supported leave, the weakest first.
    pub(crate) fn prune(
        &self,
        mut set: Vec<Effect>,
        mut with: Option<Validated>,
    ) -> Result<(Vec<EffectFinding>, Option<Validated>), SearchError> {
        let count = self.count();
        while let Some(all) = with.take().filter(|_| !set.is_empty()) {
            let mut weighed: Vec<(EffectFinding, Option<Rest>)> = Vec::new();
            let mut steps = Steps::new(self.observer, set.len());
            for (k, &effect) in set.iter().enumerate() {
                steps.next(&format!("weighing {effect}"))?;
                let without = self.without(&all, &set, k);
                // Where nothing can be fitted without it, it is weighed against the base model.
                let reference = without.as_ref().map_or(&self.base, |(_, rest)| rest);
                let finding = examine(reference, &all, effect, (self.train, self.validate), count);
                weighed.push((finding, without));
            }
            let weakest = (0..set.len())
                .filter(|&k| !weighed[k].0.supported)
                .min_by(|&a, &b| weighed[a].0.gain.total_cmp(&weighed[b].0.gain));
            let Some(k) = weakest else {
                let findings = weighed.into_iter().map(|(finding, _)| finding).collect();
                return Ok((findings, Some(all)));
            };
            let Some((members, rest)) = weighed.swap_remove(k).1 else { break };
            (set, with) = (members, Some(rest));
        }
        Ok((Vec::new(), None))
    }

    /// The set without its `k`-th member, and the model with it. Where that cannot be fitted, another member leaves as well: the one
    /// whose place is missed least. Nothing where none can be fitted or none is left.
    fn without(&self, all: &Validated, set: &[Effect], k: usize) -> Option<Rest> {
        let less = |set: &[Effect], k: usize| {
            let mut rest = set.to_vec();
            rest.remove(k);
            rest
        };
        let rest = less(set, k);
        if rest.is_empty() {
            return None;
        }
        let fitted = |rest: Vec<Effect>| Some((rest.clone(), self.with(&all.fit.model, &rest).ok()?));
        fitted(rest.clone()).or_else(|| {
            let fewer = (0..rest.len()).map(|other| less(&rest, other)).filter(|fewer| !fewer.is_empty());
            let gain = |rest: &Rest| self.screen.gain(&self.base.held_out, &rest.1.held_out);
            fewer.filter_map(fitted).max_by(|a, b| gain(a).total_cmp(&gain(b)))
        })
    }

    /// Fits the members that are still supported again. One that keeps the fit from coming to an end
    /// loses its support: the others, and what is left, still have an answer.
    pub(crate) fn refit(&self, chosen: &mut Chosen) -> Result<(), SearchError> {
        loop {
            going_on(self.observer)?;
            let set: Vec<Effect> = supported(&chosen.findings);
            let Some(from) = chosen.validated.take().filter(|_| !set.is_empty()) else { return Ok(()) };
            match self.with(&from.fit.model, &set) {
                Ok(again) => {
                    chosen.validated = Some(again);
                    return Ok(());
                }
                Err(why) => {
                    refuse_unfitted(&mut chosen.findings, why);
                    chosen.validated = Some(from);
                }
            }
        }
    }
}

/// Takes back the support of the member that an error is about, or of the weakest.
fn refuse_unfitted(findings: &mut [EffectFinding], why: FitError) {
    let is_named = |finding: &EffectFinding| why.effect() == Some(finding.effect.id());
    let named = findings.iter().position(|f| f.supported && is_named(f));
    let weakest = || {
        let members = (0..findings.len()).filter(|&k| findings[k].supported);
        members.min_by(|&a, &b| findings[a].gain.total_cmp(&findings[b].gain))
    };
    if let Some(k) = named.or_else(weakest) {
        findings[k].refuse(Reason::NotFittedTogether(why));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::Silent;
    use crate::testing::{ORDINARY, prepared, truth};

    fn with_search(world: &Model, candidates: &[Effect], look: impl FnOnce(&Search<'_>)) {
        let flights = prepared(world, 40..45, 12.0, &ORDINARY);
        let all: Vec<&Prepared> = flights.iter().collect();
        let (train, validate) = all.split_at(3);
        let mut base = world.clone();
        base.terms.retain(|term| term.effect.info().kind == Kind::Basic);
        look(&Search::new(&base, candidates.to_vec(), train, validate, &Silent).unwrap());
    }

    #[test]
    fn a_missing_drag_is_chosen_and_what_is_not_there_is_not() {
        let mut world = truth();
        world.set(Effect::QuadraticDrag, &[-0.3; 2]);
        let candidates = [Effect::SteadyWind, Effect::QuadraticDrag, Effect::QuadraticYawDamping];
        with_search(&world, &candidates, |search| {
            let chosen = search.choose_without(&[]).unwrap();
            assert_eq!(supported(&chosen.findings), [Effect::QuadraticDrag]);
            let model = chosen.validated.unwrap().fit.model;
            assert!(model.has(Effect::QuadraticDrag) && !model.has(Effect::SteadyWind));
        });
    }

    /// Against the rows formed again.
    #[test]
    fn candidates_that_are_out_change_nothing_for_the_others() {
        let candidates = [Effect::SteadyWind, Effect::QuadraticDrag, Effect::MassChange, Effect::Tether];
        with_search(&truth(), &candidates, |search| {
            let out = [Effect::QuadraticDrag];
            let less = search.screen_about(None, &out).unwrap();
            let anew = search.screen_about(Some(&search.base), &out).unwrap();
            assert_eq!(less.candidates, [Effect::SteadyWind, Effect::MassChange, Effect::Tether]);
            assert_eq!(less.candidates, anew.candidates);
            // A reward instead of a penalty: every set counts.
            let penalty = -10.0;
            let [less, anew] = [less, anew].map(|screen| screen.problem.search(SET, penalty));
            assert!(less.len() > 3 && less.len() == anew.len());
            for (less, anew) in less.iter().zip(&anew) {
                assert_eq!(less.members, anew.members);
                assert!((less.score - anew.score).abs() < 1e-6 * (1.0 + anew.score.abs()));
                for (one, other) in less.values.iter().zip(&anew.values) {
                    assert!((one - other).abs() < 1e-6 * (1.0 + other.abs()), "{one} {other}");
                }
            }
        });
    }

    #[test]
    fn of_a_complete_model_nothing_is_chosen() {
        with_search(&truth(), &[Effect::SteadyWind, Effect::QuadraticDrag], |search| {
            let chosen = search.choose_without(&[]).unwrap();
            assert!(chosen.findings.is_empty() && chosen.validated.is_none());
        });
        with_search(&truth(), &[], |search| {
            assert_eq!(search.count(), 0);
            assert!(search.choose_without(&[]).unwrap().validated.is_none());
        });
    }

    #[test]
    fn what_has_no_derivative_at_zero_is_fitted_exactly_and_counts_as_well() {
        with_search(&truth(), &[Effect::SteadyWind, Effect::SlungLoad], |search| {
            assert_eq!(search.count(), 2);
            assert_eq!(search.screen.candidates, [Effect::SteadyWind]);
            let exact: Vec<Effect> = search.searched().unwrap().map(|(effect, _)| effect).collect();
            assert_eq!(exact, [Effect::SlungLoad]);
        });
    }

    /// A fit from another start ends within a tenth of a standard error of it, not at the same numbers.
    #[test]
    fn a_set_that_was_fitted_is_not_fitted_again() {
        with_search(&truth(), &[Effect::SteadyWind], |search| {
            let model = &search.base.fit.model;
            let wind = |with: Result<Validated, FitError>| {
                with.unwrap().fit.model.term(Effect::SteadyWind).unwrap().values()
            };
            let from = |start: [f64; 2]| wind(search.fitted(model, &[(Effect::SteadyWind, start.to_vec())]));
            let first = from([0.1, 0.1]);
            assert_eq!(from([-0.6, 0.3]), first);
            assert_eq!(wind(search.with(model, &[Effect::SteadyWind])), first);
            assert_eq!(search.fits.borrow().len(), 1);
        });
    }

    #[test]
    fn a_linearised_value_that_means_nothing_does_not_spoil_the_exact_fit() {
        with_search(&truth(), &[], |search| {
            let model = &search.base.fit.model;
            let gale = vec![1e6; Effect::SteadyWind.info().coefficients.len()];
            let validated = search.fitted(model, &[(Effect::SteadyWind, gale)]).unwrap();
            let wind = validated.fit.model.term(Effect::SteadyWind).unwrap().values();
            assert!(wind.iter().all(|w| w.abs() < 1.0), "{wind:?} m/s");
        });
    }

    #[test]
    fn what_is_no_longer_supported_leaves_the_model() {
        with_search(&truth(), &[Effect::SteadyWind], |search| {
            let refused = EffectFinding::unsupported(Effect::SteadyWind, 2, crate::Reason::LikeChance);
            let mut chosen = Chosen { findings: vec![refused], validated: Some(search.base.clone()) };
            search.refit(&mut chosen).unwrap();
            assert!(chosen.validated.is_none());
        });
    }

    #[test]
    fn the_member_that_keeps_a_fit_from_ending_loses_its_support_or_else_the_weakest() {
        let finding = |effect, gain| {
            let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
            (finding.supported, finding.gain) = (true, gain);
            finding
        };
        let mut findings = [
            finding(Effect::SteadyWind, 30.0),
            finding(Effect::QuadraticDrag, 10.0),
            finding(Effect::Tether, 20.0),
        ];
        let not_converged = FitError::NotConverged { effect: "steady-wind", excitation: "hover" };
        refuse_unfitted(&mut findings, not_converged.clone());
        assert_eq!(supported(&findings), [Effect::QuadraticDrag, Effect::Tether]);
        assert_eq!(findings[0].reason, Reason::NotFittedTogether(not_converged.clone()));
        // Named again, but no longer a member.
        refuse_unfitted(&mut findings, not_converged);
        assert_eq!(supported(&findings), [Effect::Tether]);
        refuse_unfitted(&mut findings, FitError::Collinear { coefficients: Vec::new() });
        assert_eq!(supported(&findings), []);
    }
}
