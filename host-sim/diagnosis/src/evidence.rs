//! Why is an effect supported, or why not? The evidence for and against one effect, each criterion with its number and its
//! threshold.
//!
//! An effect that the model has is taken out and put back: what would be lost without it? One that it has not is put in. Either
//! way two models are fitted, with and without, and what a diagnosis finds besides is taken into account as well: an effect
//! can be worth much by itself and nothing once the right one is in place.

use std::collections::BTreeMap;

use model::{AXES, Effect, Kind, Model, Question};
use nalgebra::DMatrix;
use report::number;
use schemars::JsonSchema;
use serde::Serialize;

use crate::criteria::{Applied, Evidence, applied};
use crate::diagnose::found;
use crate::figures::{rms_fall_percent, rms_of};
use crate::finding::{AxisDrop, CoefficientFigures, EffectFinding, supported};
use crate::held_out::{Validated, examine, fit_and_validate};
use crate::observer::Observer;
use crate::options::Options;
use crate::ranking::separating_manoeuvre;
use crate::reason::{Reason, joined};
use crate::screen::Screen;
use crate::search::{PENALTY, SET, Search};
use crate::search_error::SearchError;
use sysid::prepare::Prepared;
use sysid::{FitError, Residuals, errors};

/// Variance inflation from which on two effects cannot be told apart in practice.
const CONFUSED_VIF: f64 = 10.0;
/// Sets shown.
const SETS: usize = 5;

/// Why an effect cannot be asked about.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WhyError {
    /// Part of every model.
    #[error("{0} is part of every model: it can be neither missing nor removed")]
    Basic(Effect),
    /// Absorbed by a fit of everything.
    #[error(
        "{0} can only be seen as a change, because a fit of the whole model absorbs it; use --changed with flights made \
         after it appeared"
    )]
    Change(Effect),
    /// Nothing that can have come about since the model was good.
    #[error("{effect} is not among the changes that are tried on this model: {tried}")]
    NoChange {
        /// The effect.
        effect: Effect,
        /// The effects of the changes.
        tried: String,
    },
    /// The search without it.
    #[error(transparent)]
    Search(#[from] SearchError),
}

impl From<FitError> for WhyError {
    fn from(why: FitError) -> Self {
        Self::Search(why.into())
    }
}

/// One criterion of support.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Criterion {
    /// What is asked.
    pub question: &'static str,
    /// What was found.
    pub value: f64,
    /// Unit of value and threshold, empty for a probability.
    pub unit: &'static str,
    /// What it is held against.
    pub threshold: f64,
    /// Whether the value must be at most (rather than at least) the threshold.
    pub at_most: bool,
    /// Whether it is met.
    pub met: bool,
}

/// Errors of one held-out flight without and with the effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FlightDrop {
    /// Name of the flight.
    pub flight: String,
    /// Every axis.
    pub axes: BTreeMap<&'static str, AxisDrop>,
}

/// A coefficient with what is possible.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CoefficientEvidence {
    /// Value and error.
    #[serde(flatten)]
    pub figures: CoefficientFigures,
    /// Half width of its 95 % interval.
    pub half_width_95: f64,
    /// Smallest and largest physically possible value.
    pub possible: (f64, f64),
}

/// Another effect whose columns look like this one's to the model.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Likeness {
    /// The effect.
    pub effect: Effect,
    /// By how much the variance of a coefficient grows when both are fitted.
    pub variance_inflation: f64,
    /// What to fly to separate them, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub separate: Option<&'static str>,
}

/// A set of effects of the exhaustive search.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ScoredSet {
    /// Its members.
    pub effects: Vec<Effect>,
    /// Logarithm of its held-out likelihood ratio to the empty set, less one for each coefficient.
    pub score: f64,
}

/// The evidence for and against one effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Why {
    /// The effect.
    pub effect: Effect,
    /// Whether the model has it; it was then taken out.
    pub in_model: bool,
    /// Whether every criterion is met by itself.
    pub supported: bool,
    /// In a sentence.
    pub summary: String,
    /// Each criterion.
    pub criteria: Vec<Criterion>,
    /// Each held-out flight.
    pub flights: Vec<FlightDrop>,
    /// Coefficients.
    pub coefficients: Vec<CoefficientEvidence>,
    /// By how much the variance of its worst coefficient is inflated because the model's own terms look like it.
    pub variance_inflation: f64,
    /// Effects that look like it, the most alike first.
    pub alike: Vec<Likeness>,
    /// What a diagnosis finds in the model without it.
    pub found: Vec<Effect>,
    /// What it adds once the others that were found are in the model, percent of the held-out squared error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop_percent_beside_found: Option<f64>,
    /// The best sets of effects of the exhaustive search.
    pub best_sets: Vec<ScoredSet>,
    /// The best sets that hold it.
    pub best_sets_with_it: Vec<ScoredSet>,
    /// What to fly to see it.
    pub to_see_it: &'static str,
}

/// Examines one effect.
pub fn why(
    model: &Model,
    effect: Effect,
    train: &[&Prepared],
    validate: &[&Prepared],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Why, WhyError> {
    let info = effect.info();
    if info.kind == Kind::Basic {
        return Err(WhyError::Basic(effect));
    }
    if info.question == Question::Change {
        return Err(WhyError::Change(effect));
    }
    let mut without = model.clone();
    without.terms.retain(|term| term.effect != effect);
    let candidates = options.candidates_with(effect, &without);
    let search = Search::new(&without, candidates, train, validate, observer)?;
    let start = if model.has(effect) { model } else { &search.base.fit.model };
    let mut effects = without.effects();
    effects.push(effect);
    let with = fit_and_validate(start, &effects, train, validate);
    let finding = match &with {
        Ok(with) => examine(&search.base, with, effect, (train, validate), search.count()),
        Err(why) => EffectFinding::unsupported(effect, validate.len(), Reason::Refused(why.clone())),
    };
    let findings = found(&search)?.chosen.findings;
    let found = supported(&findings);
    let beside = beside_found(&search, &without, effect, &found, (train, validate))?;
    let refused = findings.into_iter().find(|one| one.effect == effect && !one.supported);
    let diagnosis = Diagnosed { found, beside, refused: refused.map(|refused| refused.reason) };
    Ok(assemble(model.has(effect), &search, (with.as_ref().ok(), &finding), diagnosis, validate))
}

/// What a diagnosis makes of the effect.
struct Diagnosed {
    /// The effects that it finds.
    found: Vec<Effect>,
    /// What the effect adds to those of them that are others, percent.
    beside: Option<f64>,
    /// Why it refuses the effect, which it tried.
    refused: Option<Reason>,
}

/// What the effect adds, percent of the held-out squared error over its axes, with the others that were found in place.
fn beside_found(
    search: &Search<'_>,
    without: &Model,
    effect: Effect,
    found: &[Effect],
    (train, validate): (&[&Prepared], &[&Prepared]),
) -> Result<Option<f64>, FitError> {
    let others: Vec<Effect> = found.iter().copied().filter(|e| *e != effect).collect();
    if others.is_empty() {
        return Ok(None);
    }
    let mut effects = without.effects();
    effects.extend(&others);
    let Ok(reference) = fit_and_validate(&search.base.fit.model, &effects, train, validate) else {
        return Ok(None);
    };
    effects.push(effect);
    let Ok(with) = fit_and_validate(&reference.fit.model, &effects, train, validate) else {
        return Ok(Some(0.0));
    };
    let count = search.count();
    Ok(Some(examine(&reference, &with, effect, (train, validate), count).drop_percent))
}

fn assemble(
    in_model: bool,
    search: &Search<'_>,
    (with, finding): (Option<&Validated>, &EffectFinding),
    diagnosis: Diagnosed,
    validate: &[&Prepared],
) -> Why {
    let effect = finding.effect;
    let screen = &search.screen;
    let index = screen.index(effect);
    let left = index.map_or(1.0, |i| {
        let live = screen.problem.groups[i].clone().filter(|&k| screen.problem.train[(k, k)] > 0.0);
        live.map(|k| screen.left[k]).fold(1.0, f64::min)
    });
    let sets = screen.problem.search(SET, PENALTY);
    let scored = |holds: &dyn Fn(&[usize]) -> bool| -> Vec<ScoredSet> {
        let shown = sets.iter().filter(|set| holds(&set.members)).take(SETS);
        let named = |set: &crate::subsets::Subset| ScoredSet {
            effects: set.members.iter().map(|&m| screen.candidates[m]).collect(),
            score: set.score,
        };
        shown.map(named).collect()
    };
    Why {
        effect,
        in_model,
        supported: finding.supported,
        summary: summary(in_model, finding, &diagnosis),
        criteria: with.map_or_else(Vec::new, |with| criteria(&Evidence::missing(finding, &with.fit.model))),
        flights: with
            .map_or_else(Vec::new, |with| flights((&search.base.held_out, &with.held_out), validate)),
        coefficients: coefficients(finding),
        variance_inflation: 1.0 / left.max(f64::MIN_POSITIVE),
        alike: index.map_or_else(Vec::new, |i| alike(screen, i)),
        found: diagnosis.found,
        drop_percent_beside_found: diagnosis.beside,
        best_sets: scored(&|_| true),
        best_sets_with_it: scored(&|members| index.is_some_and(|i| members.contains(&i))),
        to_see_it: effect.info().excitation,
    }
}

fn summary(in_model: bool, finding: &EffectFinding, diagnosis: &Diagnosed) -> String {
    let EffectFinding { effect, reason, supported, .. } = finding;
    let what = match (in_model, supported) {
        (true, true) => format!("{effect} is in the model, and these flights support it: {reason}."),
        (true, false) => format!("{effect} is in the model, but these flights do not support it: {reason}."),
        (false, true) => format!("{effect} is supported by itself: {reason}."),
        (false, false) => format!("{effect} is not supported: {reason}."),
    };
    let Diagnosed { found, beside, refused } = diagnosis;
    let others: Vec<Effect> = found.iter().copied().filter(|other| other != effect).collect();
    match beside {
        Some(percent) => {
            let rms = rms_of(effect.info().axes);
            let fall = if *percent <= 0.0 {
                format!("does not lower the held-out {rms}")
            } else {
                format!("lowers the held-out {rms} by {} %", number::percent(rms_fall_percent(*percent)))
            };
            let others = joined(&others, " and ");
            format!("{what} With {others} in the model, which the diagnosis finds, it {fall}.")
        }
        None if found.contains(effect) => format!("{what} The diagnosis finds it as well."),
        None => match refused.as_ref().filter(|_| *supported) {
            Some(reason) => format!("{what} The diagnosis refuses it all the same: {reason}."),
            None => what,
        },
    }
}

/// Every rule that applies to the effect.
pub(crate) fn criteria(evidence: &Evidence<'_>) -> Vec<Criterion> {
    let shown = |Applied { question, unit, at_most, value, threshold, met, .. }| Criterion {
        question,
        value,
        unit,
        threshold,
        at_most,
        met,
    };
    applied(evidence).into_iter().map(shown).collect()
}

/// What was found of the effect's coefficients, or of a motor's.
pub(crate) fn coefficients(finding: &EffectFinding) -> Vec<CoefficientEvidence> {
    let evidence = |figures: &CoefficientFigures| CoefficientEvidence {
        half_width_95: 1.96 * figures.std_error,
        figures: figures.clone(),
        possible: figures.possible,
    };
    finding.coefficients.iter().map(evidence).collect()
}

/// Errors of each flight by its residuals without and with the effect.
pub(crate) fn flights(
    (without, with): (&[Residuals], &[Residuals]),
    flights: &[&Prepared],
) -> Vec<FlightDrop> {
    let each = flights.iter().zip(without.iter().zip(with));
    each.map(|(flight, (a, b))| {
        let (before, after) = (errors([a]), errors([b]));
        let drop = |axis: model::Axis| (axis.name(), AxisDrop::new(before[axis].sse, after[axis].sse));
        FlightDrop { flight: flight.name.clone(), axes: AXES.into_iter().map(drop).collect() }
    })
    .collect()
}

/// Other candidates by how much a coefficient's variance grows when both are fitted: 1 / (1 - the largest canonical correlation
/// squared) of their columns, the model's own projected out.
fn alike(screen: &Screen, index: usize) -> Vec<Likeness> {
    let effect = screen.candidates[index];
    let live = |i: usize| -> Vec<usize> {
        screen.problem.groups[i].clone().filter(|&k| screen.problem.train[(k, k)] > 0.0).collect()
    };
    let own = live(index);
    let mut all: Vec<Likeness> = (0..screen.candidates.len())
        .filter(|&other| other != index)
        .filter_map(|other| {
            let inflation = variance_inflation(&screen.problem.train, &own, &live(other))?;
            let other = screen.candidates[other];
            (inflation > CONFUSED_VIF).then(|| Likeness {
                effect: other,
                variance_inflation: inflation,
                separate: separating_manoeuvre(effect, other),
            })
        })
        .collect();
    all.sort_by(|a, b| b.variance_inflation.total_cmp(&a.variance_inflation));
    all
}

fn variance_inflation(cross: &DMatrix<f64>, a: &[usize], b: &[usize]) -> Option<f64> {
    if a.is_empty() || b.is_empty() {
        return None;
    }
    let part = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |r, c| {
            let (i, j) = (rows[r], columns[c]);
            cross[(i, j)] / (cross[(i, i)] * cross[(j, j)]).sqrt()
        })
    };
    // Canonical correlations are the singular values of La^-1 Cab Lb^-T.
    let (la, lb) = (part(a, a).cholesky()?.l(), part(b, b).cholesky()?.l());
    let left = la.solve_lower_triangular(&part(a, b))?;
    let both = lb.solve_lower_triangular(&left.transpose())?;
    let largest = both.singular_values().max().min(1.0 - 1e-12);
    Some(1.0 / (1.0 - largest * largest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criteria::weigh;
    use crate::reason::Reason;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// A finding with figures on both sides of every threshold, more often on the good one.
    fn random_finding(effect: Effect, rng: &mut Pcg64Mcg) -> EffectFinding {
        let flights = 1 + rng.random_range(0..4_usize);
        let mut finding = EffectFinding::unsupported(effect, flights, Reason::LikeChance);
        let mut pick = |good: f64, bad: f64| {
            let around = 0.5 + rng.random::<f64>();
            around * if rng.random::<f64>() < 0.9 { good } else { bad }
        };
        finding.p_value = pick(0.005, 0.02);
        finding.held_out_p_value = Some(pick(0.02, 0.2));
        finding.harm_percent = pick(15.0, 60.0);
        finding.rise = Some((effect.info().axes[0], 20.0));
        finding.swing = effect.info().special.hangs_load.then(|| crate::finding::Swing {
            count: pick(8.0, 1.0),
            up_to_hz: 0.8,
            drop_percent: Some(pick(10.0, -20.0)),
        });
        finding.at_low_frequency =
            Some(crate::finding::AtLowFrequency { part: pick(1.0, 0.2), same_p_value: pick(0.1, 0.001) });
        for axis in effect.info().axes {
            finding.axes.insert(axis.name(), AxisDrop::new(100.0, 100.0 - pick(6.0, 0.5)));
        }
        // All at once: some are judged by their size together.
        let size = pick(1.0, 0.01);
        finding.coefficients = effect
            .info()
            .coefficients
            .iter()
            .map(|c| {
                let value = pick(c.typical, 20.0 * (c.possible.1 - c.possible.0));
                let value = value * size * pick(1.0, -1.0).signum();
                let std_error = pick(0.1, 1.0) * c.typical;
                CoefficientFigures { name: c.name, value, std_error, unit: c.unit, possible: c.possible }
            })
            .collect();
        finding.flights_improved[0] = rng.random_range(0..flights + 1);
        finding.anchor = effect.info().special.is_anchored.then(|| crate::finding::Anchor {
            place_ned_m: [0.0; 3],
            distance_m: rng.random_range(0.0..8.0),
            reach_m: 5.0,
            depth_m: rng.random_range(-5.0..2.0),
        });
        finding
    }

    /// `--why` shows a "no" exactly when an effect is not supported: random findings of every candidate, with and without a
    /// motor map. Each rule is broken by itself at least once.
    #[test]
    fn a_no_is_shown_exactly_when_an_effect_is_not_supported() {
        let mut rng = Pcg64Mcg::seed_from_u64(12);
        let (mut supported, mut refused) = (0, 0);
        let mut broken_alone = std::collections::BTreeSet::new();
        for round in 0..1000 {
            for effect in Effect::candidates() {
                let finding = random_finding(effect, &mut rng);
                let mut evidence = Evidence::missing(&finding, &Model::thesis());
                evidence.has_rotor_map = round % 2 == 0;
                evidence.leaning = (round % 4 < 2).then(|| crate::leaning::Leaning {
                    push_errors: rng.random_range(4.0..50.0),
                    difference_percent: rng.random_range(0.0..110.0),
                    yaw_percent: rng.random_range(8.0..100.0),
                    push_is_doubted: rng.random_bool(0.5),
                });
                let shown = criteria(&evidence);
                let (is_supported, reason) = weigh(&evidence);
                let no: Vec<&str> = shown.iter().filter(|c| !c.met).map(|c| c.question).collect();
                assert_eq!(is_supported, no.is_empty(), "seed 12, {effect}: {reason}, but {shown:#?}");
                supported += usize::from(is_supported);
                refused += usize::from(!is_supported);
                if let [alone] = no[..] {
                    broken_alone.insert(alone);
                }
            }
        }
        assert!(supported > 500 && refused > 500, "{supported} supported, {refused} not");
        let own_rules: std::collections::BTreeSet<&str> =
            Effect::candidates().filter_map(|e| Some(e.info().special.requirement?.question)).collect();
        assert_eq!(broken_alone.len(), crate::criteria::RULES.len() + own_rules.len(), "{broken_alone:#?}");
    }

    /// Supported by itself, and what the diagnosis makes of it: found, found beside others, or refused with the reason it gives itself.
    #[test]
    fn a_summary_says_what_the_diagnosis_makes_of_the_effect() {
        let mut finding = EffectFinding::unsupported(Effect::ThrustLinear, 2, Reason::LikeChance);
        finding.supported = true;
        let said = |found: &[Effect], beside: Option<f64>, refused: Option<Reason>| {
            summary(false, &finding, &Diagnosed { found: found.to_vec(), beside, refused })
        };
        let is_found = said(&[Effect::ThrustLinear], None, None);
        assert!(is_found.ends_with(" The diagnosis finds it as well."), "{is_found}");
        let refused = said(&[], None, Some(Reason::AnswersLate));
        let reason = Reason::AnswersLate.to_string();
        assert!(
            refused.ends_with(&format!(" The diagnosis refuses it all the same: {reason}.")),
            "{refused}"
        );
        let beside = said(&[Effect::BatteryVoltage], Some(-1.0), Some(Reason::AnswersLate));
        assert!(
            beside
                .contains(" With battery-voltage in the model, which the diagnosis finds, it does not lower"),
            "{beside}"
        );
        assert!(!said(&[], None, None).contains("The diagnosis"));
    }

    /// Columns at an angle have its cosine as their only canonical correlation: 1 / sin^2.
    #[test]
    fn the_variance_inflation_of_columns_at_an_angle() {
        for angle in [1.5_f64, 0.8, 0.1] {
            let cross = DMatrix::from_row_slice(2, 2, &[4.0, 6.0 * angle.cos(), 6.0 * angle.cos(), 9.0]);
            let found = variance_inflation(&cross, &[0], &[1]).unwrap();
            assert!((found * angle.sin().powi(2) - 1.0).abs() < 1e-9, "{angle}: {found}");
        }
        assert_eq!(variance_inflation(&DMatrix::identity(2, 2), &[], &[1]), None);
    }

    /// Two planes that share no direction but whose second canonical correlation is 0.6: the largest counts, whatever the base of
    /// each plane.
    #[test]
    fn the_largest_canonical_correlation_counts() {
        let mut joint = DMatrix::identity(4, 4);
        for (i, correlation) in [(0, 0.6), (1, 0.3)] {
            joint[(i, i + 2)] = correlation;
            joint[(i + 2, i)] = correlation;
        }
        let base = DMatrix::from_row_slice(
            4,
            4,
            &[2.0, 1.0, 0.0, 0.0, -1.0, 3.0, 0.0, 0.0, 0.0, 0.0, 1.0, 5.0, 0.0, 0.0, 0.5, 1.0],
        );
        let cross = base.transpose() * joint * base;
        let found = variance_inflation(&cross, &[0, 1], &[2, 3]).unwrap();
        assert!((found - 1.0 / (1.0 - 0.36)).abs() < 1e-9, "{found}");
    }
}
