//! Counting answers.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::judge::{ConditionScore, conditions};
use crate::plan::{Hidden, Plan, Trial, catalogue};
use crate::trial::{ADEQUATE, Distance, NOT_IDENTIFIED, OfPlanted, Outcome, UNEXPLAINED};

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub(crate) struct Share {
    pub(crate) hits: usize,
    pub(crate) of: usize,
}

impl Share {
    pub(crate) fn of<'a>(
        outcomes: impl IntoIterator<Item = &'a Outcome>,
        hit: impl Fn(&Outcome) -> bool,
    ) -> Self {
        let mut share = Self::default();
        for outcome in outcomes {
            share.of += 1;
            share.hits += usize::from(hit(outcome));
        }
        share
    }

    pub(crate) fn percent(self) -> f64 {
        100.0 * self.hits as f64 / self.of.max(1) as f64
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.of == 0 { f.pad("-") } else { f.pad(&format!("{}/{}", self.hits, self.of)) }
    }
}

/// One effect of the catalogue, or one change: how often it was named first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct EffectScore {
    pub(crate) effect: String,
    pub(crate) by_strength: Vec<Share>,
    pub(crate) by_noise: Vec<Share>,
    pub(crate) by_size: Vec<Share>,
    pub(crate) all: Share,
    /// Found, and then nothing else; only where more than one round was asked for.
    pub(crate) clean: Share,
}

/// How well an effect's coefficients cover the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Coverage {
    pub(crate) effect: &'static str,
    pub(crate) coefficient: &'static str,
    pub(crate) size: &'static str,
    /// Inside their own 95 % interval.
    pub(crate) inside: Share,
    /// Mean distance in standard errors: a bias.
    pub(crate) mean_errors: f64,
    /// Root mean square distance in standard errors: 1 where they are honest.
    pub(crate) rms_errors: f64,
    /// Mean relative distance, percent of the truth.
    pub(crate) bias_percent: f64,
}

/// A wrong answer, with what it takes to see it again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Failure {
    pub(crate) trial: Trial,
    pub(crate) answer: String,
    pub(crate) found: Vec<&'static str>,
    pub(crate) planted: Vec<OfPlanted>,
    pub(crate) confounded_with: Vec<&'static str>,
    pub(crate) unexplained: Vec<String>,
}

/// A coefficient that came out far from the truth, by its own standard error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Far {
    pub(crate) trial: Trial,
    pub(crate) distance: Distance,
}

/// Beyond this many standard errors a coefficient is far from the truth: one in 1.7 million if
/// errors were honest.
const FAR: f64 = 5.0;

/// Everything counted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Scores {
    pub(crate) strengths: Vec<f64>,
    pub(crate) noises: Vec<f64>,
    pub(crate) seeds: u64,
    pub(crate) first_seed: u64,
    pub(crate) flight_s: f64,
    pub(crate) trials: usize,
    pub(crate) effects: Vec<EffectScore>,
    /// Named first, over all effects of the catalogue.
    pub(crate) named: Share,
    pub(crate) nothing_right: Share,
    /// Changes named with the right motor.
    pub(crate) changes_right: Share,
    /// Nothing changed, and said so.
    pub(crate) unchanged_right: Share,
    pub(crate) pairs_right: Share,
    /// Pairs in which at least both are among those found.
    pub(crate) pairs_both: Share,
    /// All three of three, and nothing else.
    pub(crate) triples_right: Share,
    /// Threes that are all among those found.
    pub(crate) triples_all: Share,
    /// One effect of the catalogue beside one that it does not have: the one found, nothing else, and something left.
    pub(crate) beside_right: Share,
    /// That one among those found.
    pub(crate) beside_found: Share,
    /// Something else called by the name of an effect.
    pub(crate) beside_misnamed: Share,
    pub(crate) outside_unexplained: Share,
    /// Outside the catalogue, and called by the name of an effect.
    pub(crate) outside_misnamed: Share,
    /// Covered, over all coefficients.
    pub(crate) covered: Share,
    pub(crate) coverage: Vec<Coverage>,
    /// Rows: what was hidden; columns: the first answer.
    pub(crate) confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Difficult flights and logs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) conditions: Vec<ConditionScore>,
    pub(crate) without_world: Vec<&'static str>,
    pub(crate) failures: Vec<Failure>,
    /// The farthest first.
    pub(crate) far: Vec<Far>,
}

impl Scores {
    pub(crate) fn of(plan: &Plan, outcomes: &[Outcome]) -> Self {
        let plain = || outcomes.iter().filter(|o| o.trial.condition.is_none());
        let kind = |wanted: fn(&Hidden) -> bool| plain().filter(move |o| wanted(&o.trial.hidden));
        let one = || kind(|h| matches!(h, Hidden::One(_)));
        let changes = || kind(|h| matches!(h, Hidden::Change(Some(_))));
        let nothing = || kind(|h| matches!(h, Hidden::Nothing));
        let pairs = || kind(|h| matches!(h, Hidden::Together(effects) if effects.len() == 2));
        let triples = || kind(|h| matches!(h, Hidden::Together(effects) if effects.len() == 3));
        let beside = || kind(|h| matches!(h, Hidden::Beside(_)));
        let known = |o: &Outcome| o.trial.planted()[0].0;
        let outside = || kind(|h| matches!(h, Hidden::Outside(_)));
        let is_verdict = |answer: &str| [ADEQUATE, UNEXPLAINED, NOT_IDENTIFIED].contains(&answer);
        let all = |o: &Outcome| o.trial.planted().iter().all(|(id, _)| o.found.contains(id));
        let distances = || outcomes.iter().flat_map(|o| &o.coefficients);
        Self {
            strengths: plan.strengths.clone(),
            noises: plan.noises.clone(),
            seeds: plan.seeds,
            first_seed: plan.first_seed,
            flight_s: plan.duration_s,
            trials: outcomes.len(),
            effects: effects(plan, &one().chain(changes()).collect::<Vec<_>>()),
            named: Share::of(one(), Outcome::is_right),
            nothing_right: Share::of(nothing(), Outcome::is_right),
            changes_right: Share::of(changes(), Outcome::is_right),
            unchanged_right: Share::of(kind(|h| matches!(h, Hidden::Change(None))), Outcome::is_right),
            pairs_right: Share::of(pairs(), Outcome::is_right),
            pairs_both: Share::of(pairs(), all),
            triples_right: Share::of(triples(), Outcome::is_right),
            triples_all: Share::of(triples(), all),
            beside_right: Share::of(beside(), Outcome::is_right),
            beside_found: Share::of(beside(), |o| o.found.contains(&known(o))),
            beside_misnamed: Share::of(beside(), |o| o.found.iter().any(|found| *found != known(o))),
            outside_unexplained: Share::of(outside(), Outcome::is_right),
            outside_misnamed: Share::of(outside(), |o| !is_verdict(&o.answer)),
            covered: Share { hits: distances().filter(|d| d.is_covered()).count(), of: distances().count() },
            coverage: coverage(outcomes),
            confusion: confusion(plain()),
            conditions: conditions(outcomes),
            without_world: catalogue().into_iter().filter(|(_, can)| !can).map(|(id, _)| id).collect(),
            failures: outcomes.iter().filter(|o| !o.is_right()).map(failure).collect(),
            far: far(outcomes),
        }
    }
}

/// The coefficient of a trial that came out farthest from the truth, where one came out far.
pub(crate) fn farthest(outcome: &Outcome) -> Option<&Distance> {
    let farthest = outcome.coefficients.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    (size(farthest) > FAR).then_some(farthest)
}

fn size(distance: &Distance) -> f64 {
    distance.errors.abs()
}

/// The farthest coefficient of every trial that has one.
fn far(outcomes: &[Outcome]) -> Vec<Far> {
    let mut far: Vec<Far> = outcomes
        .iter()
        .filter_map(|outcome| {
            Some(Far { trial: outcome.trial.clone(), distance: farthest(outcome)?.clone() })
        })
        .collect();
    far.sort_by(|a, b| size(&b.distance).total_cmp(&size(&a.distance)));
    far
}

fn failure(outcome: &Outcome) -> Failure {
    Failure {
        trial: outcome.trial.clone(),
        answer: outcome.answer.clone(),
        found: outcome.found.clone(),
        planted: outcome.planted.clone(),
        confounded_with: outcome.confounded_with.clone(),
        unexplained: outcome.unexplained.clone(),
    }
}

fn effects(plan: &Plan, outcomes: &[&Outcome]) -> Vec<EffectScore> {
    let of = |hidden: &Hidden, also: &dyn Fn(&Trial) -> bool, hit: fn(&Outcome) -> bool| {
        let mine = outcomes.iter().filter(|o| o.trial.hidden == *hidden && also(&o.trial));
        Share::of(mine.copied(), hit)
    };
    let mut kinds: Vec<&Trial> = Vec::new();
    for outcome in outcomes {
        if !kinds.iter().any(|known| known.hidden == outcome.trial.hidden) {
            kinds.push(&outcome.trial);
        }
    }
    let right = Outcome::is_right;
    kinds
        .into_iter()
        .map(|kind| (kind, &kind.hidden))
        .map(|(kind, effect)| EffectScore {
            effect: kind.label(),
            by_strength: plan.strengths.iter().map(|s| of(effect, &|t| t.strength == *s, right)).collect(),
            by_noise: plan.noises.iter().map(|n| of(effect, &|t| t.noise == *n, right)).collect(),
            by_size: stories::world::Size::ALL
                .iter()
                .map(|size| of(effect, &|t| t.size == *size, right))
                .collect(),
            all: of(effect, &|_| true, right),
            clean: of(effect, &|t| t.rounds > 1, Outcome::is_clean),
        })
        .collect()
}

fn coverage(outcomes: &[Outcome]) -> Vec<Coverage> {
    type Key = (&'static str, &'static str, &'static str);
    let mut order: Vec<Key> = Vec::new();
    let mut all: BTreeMap<Key, Vec<&Distance>> = BTreeMap::new();
    for outcome in outcomes {
        for distance in &outcome.coefficients {
            let key = (distance.effect, distance.coefficient, outcome.trial.size.name());
            if !all.contains_key(&key) {
                order.push(key);
            }
            all.entry(key).or_default().push(distance);
        }
    }
    order
        .into_iter()
        .map(|key| {
            let distances = &all[&key];
            let mean = |f: &dyn Fn(&Distance) -> f64| {
                distances.iter().map(|d| f(d)).sum::<f64>() / distances.len() as f64
            };
            Coverage {
                effect: key.0,
                coefficient: key.1,
                size: key.2,
                inside: Share {
                    hits: distances.iter().filter(|d| d.is_covered()).count(),
                    of: distances.len(),
                },
                mean_errors: mean(&|d| d.errors),
                rms_errors: mean(&|d| d.errors * d.errors).sqrt(),
                bias_percent: if distances.iter().all(|d| d.truth != 0.0) {
                    100.0 * mean(&|d| (d.value - d.truth) / d.truth)
                } else {
                    0.0
                },
            }
        })
        .collect()
}

fn confusion<'a>(outcomes: impl Iterator<Item = &'a Outcome>) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut rows: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for outcome in outcomes.filter(|o| !o.trial.hidden.is_several()) {
        *rows.entry(outcome.trial.label()).or_default().entry(outcome.answer.clone()).or_default() += 1;
    }
    rows
}
