//! Which physical effect is missing?
//!
//! Every candidate is fitted together with the whole model on the training flights and judged on held-out flights.
//! A candidate is **supported** when all of this holds:
//! - its coefficients differ from zero on the training flights (Wald test with the coloured-residual covariance,
//!   F distribution, corrected for the number of candidates after Holm and Bonferroni's inequality);
//! - the held-out error falls by more than chance (one-sided t test against what noise does to the fall, summed over blocks of
//!   time, so that neighbouring samples are not counted as independent) and in most held-out flights;
//! - it falls by enough to matter;
//! - the coefficients are physically possible.
//!
//! Candidates overlap: a wind looks partly like a tilted tracker, and two missing effects can hide each other. So all sets of
//! up to three are compared, linearised about the model (`screen.rs`, [`crate::subsets`]); the best ones are fitted exactly, the
//! best of those joins the model, and the search goes on from there (`select.rs`). Each member must then be supported with the
//! others in place. What is not in the set is reported as explained by it, or, when it does as well in a member's place,
//! as confounded.
//!
//! What is left after the supported effects is searched for dependence on every measured quantity, by the same
//! held-out standard: that is the difference between "adequate" and "unexplained".

use std::collections::BTreeMap;

use model::{AxisError, Effect, Estimate, Model, PerAxis};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

use crate::noise;
use crate::residual_tests::{Structure, structure};
use crate::search::{Judged, Search, judge};
use sysid::fit::least_squares::WINDOW_S;
use sysid::fit::linearise::step_scale;
use sysid::fit::{has_rotation, slung_load, without_rotation};
use sysid::prepare::Prepared;
use sysid::{Fit, FitError, errors};

/// Largest corrected p-value of a finding.
pub(crate) const SIGNIFICANCE: f64 = 0.01;
/// Largest p-value of the held-out gain.
pub(crate) const HELD_OUT_SIGNIFICANCE: f64 = 0.05;
/// Smallest held-out drop, percent of an axis' squared error, that matters.
pub const MATTERS_PERCENT: f64 = 1.5;
/// Residual variance over that of the sensors' noise from which on something is missing. Complete models scatter from
/// 0.8 to 1.25 on two flights of 24 s.
const ABOVE_NOISE: f64 = 1.6;
/// Part of the excess over the noise that the right effects may leave. In simulated flights they leave none; a formula that is
/// only nearly right leaves a hundredth, a stand-in for something else a twentieth or more.
const LEFT_BY_THE_RIGHT: f64 = 0.03;

/// The conclusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// A known effect is missing.
    MissingEffect,
    /// No effect is supported and the residual shows no structure.
    Adequate,
    /// The residual shows structure that no known effect accounts for.
    Unexplained,
}

/// Errors of one axis without and with an effect, on the held-out flights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AxisDrop {
    /// Sum of squares without.
    pub sse_before: f64,
    /// Sum of squares with.
    pub sse_after: f64,
    /// Percent by which it falls.
    pub drop_percent: f64,
}

impl AxisDrop {
    /// Of two sums of squares.
    pub(crate) fn new(sse_before: f64, sse_after: f64) -> Self {
        let drop_percent = if sse_before > 0.0 { 100.0 * (1.0 - sse_after / sse_before) } else { 0.0 };
        Self { sse_before, sse_after, drop_percent }
    }
}

/// A coefficient of a candidate.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoefficientFigures {
    /// Name.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Standard error, coloured residuals accounted for.
    pub std_error: f64,
    /// Unit.
    pub unit: &'static str,
}

/// A candidate's evidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectFinding {
    /// Identifier.
    pub effect: &'static str,
    /// Whether the flights support it.
    pub supported: bool,
    /// Held-out drop of the squared error over the axes it acts on, each weighed by its noise, percent.
    pub drop_percent: f64,
    /// The axes it acts on.
    pub axes: BTreeMap<&'static str, AxisDrop>,
    /// Of the Wald test on the training flights, corrected for the number of candidates.
    pub p_value: f64,
    /// Of the gain on the held-out flights; nothing for an effect that was not fitted exactly, because it did not come
    /// into question.
    pub held_out_p_value: Option<f64>,
    /// Held-out flights on which the error falls, and how many there are.
    pub flights_improved: [usize; 2],
    /// Coefficients.
    pub coefficients: Vec<CoefficientFigures>,
    /// Effects that the flights cannot tell it from.
    pub confounded_with: Vec<&'static str>,
    /// Why it is or is not supported, one sentence.
    pub reason: String,
    /// Logarithm of the held-out likelihood ratio over all six axes: the rank.
    #[serde(skip)]
    pub(crate) gain: f64,
    /// The motor, for a change of one motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
}

impl EffectFinding {
    /// Nothing known yet.
    pub(crate) fn unsupported(effect: Effect, flights: usize) -> Self {
        Self {
            effect: effect.id(),
            supported: false,
            drop_percent: 0.0,
            axes: BTreeMap::new(),
            p_value: 1.0,
            held_out_p_value: None,
            flights_improved: [0, flights],
            coefficients: Vec::new(),
            confounded_with: Vec::new(),
            reason: String::new(),
            gain: f64::NEG_INFINITY,
            motor: None,
        }
    }
}

/// Structure in the residual that no known effect accounts for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// Axis.
    pub axis: model::Axis,
    /// The measured quantity it depends on.
    pub depends_on: String,
    /// Share of the axis' held-out squared error, percent.
    pub share_percent: f64,
    /// Corrected p-value.
    pub p_value: f64,
}

/// A diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The conclusion.
    pub verdict: Verdict,
    /// The conclusion and its reason in plain English.
    pub summary: String,
    /// Candidates, best first.
    pub effects: Vec<EffectFinding>,
    /// What is left.
    pub unexplained: Vec<Unexplained>,
}

impl Diagnosis {
    /// The best supported effect.
    pub fn best(&self) -> Option<Effect> {
        self.effects.iter().find(|e| e.supported).and_then(|e| Effect::from_id(e.effect))
    }
}

/// What to diagnose with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// Effects that are treated as if nobody knew them.
    pub without: Vec<Effect>,
}

impl Options {
    /// What could be missing from a model. One without rotation lacks none of the rotation's alone.
    pub(crate) fn candidates(&self, model: &Model) -> Vec<Effect> {
        let missing = |e: &Effect| !model.has(*e) && !self.without.contains(e);
        let all: Vec<Effect> = Effect::candidates().filter(missing).collect();
        if has_rotation(model) { all } else { without_rotation(&all) }
    }
}

/// Diagnoses a model with the whole catalogue: which effect is missing from it?
///
/// `progress` is told of what is tried.
pub fn diagnose(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    progress: impl FnMut(&str),
) -> Result<Diagnosis, FitError> {
    diagnose_with(model, train, validate, &Options::default(), progress)
}

/// The same with options.
pub fn diagnose_with(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    options: &Options,
    mut progress: impl FnMut(&str),
) -> Result<Diagnosis, FitError> {
    let candidates = options.candidates(model);
    let search = Search::new(model, candidates, train, validate)?;
    let mut chosen = search.choose(&mut progress)?;
    progress("what is left");
    let noise_before = noise::excess(validate, &search.base.held_out);
    let unexplained = loop {
        let rest = chosen.judged.as_ref().unwrap_or(&search.base);
        let Structure { mut unexplained, answers_late } = structure(rest, train, validate);
        let noise_after = noise::excess(validate, &rest.held_out);
        unexplained.extend(above_noise(&noise_after, rest, validate));
        let proxies = incomplete(&noise_before, &noise_after);
        if !demote_stand_ins(&mut chosen.findings, &unexplained, &proxies, answers_late) {
            break unexplained;
        }
        search.refit(&mut chosen)?;
    };
    let findings = search.all_findings(chosen, &mut progress);
    let verdict = match (findings.iter().any(|f| f.supported), unexplained.is_empty()) {
        (true, _) => Verdict::MissingEffect,
        (false, true) => Verdict::Adequate,
        (false, false) => Verdict::Unexplained,
    };
    let summary = summary(verdict, &findings, &unexplained);
    Ok(Diagnosis { verdict, summary, effects: findings, unexplained })
}

/// An effect that leaves more structure on its axes than it takes away is a stand-in for something else: naming it would
/// be confidently wrong. Returns whether any was demoted.
///
/// So is one of the rotors' answer to commands where what is left answers later still: air and parts that follow look like a slow or an
/// early rotor.
///
/// So is one on an axis where all that was found together leaves a good part of the residual above the sensors' noise: the
/// right effects leave the noise and nothing else.
fn demote_stand_ins(
    findings: &mut [EffectFinding],
    unexplained: &[Unexplained],
    incomplete: &[bool; 6],
    answers_late: bool,
) -> bool {
    let mut any = false;
    for finding in findings.iter_mut().filter(|f| f.supported) {
        if answers_late && Effect::from_id(finding.effect).is_some_and(|e| e.info().special.of_actuators) {
            finding.supported = false;
            finding.reason = "a stand-in at best: with it, what is left still follows what the rotors did in the last half second, which \
                              the right effect would have taken away"
                .into();
            any = true;
            continue;
        }
        let strongest = finding.axes.iter().max_by(|a, b| a.1.drop_percent.total_cmp(&b.1.drop_percent));
        let strongest = strongest.and_then(|(name, _)| model::AXES.into_iter().find(|a| a.name() == *name));
        if let Some(axis) = strongest.filter(|a| incomplete[a.index()]) {
            finding.supported = false;
            finding.reason = format!(
                "a stand-in at best: with it, what is left in {axis} is still well above the sensors' noise, which the \
                 right effect would leave"
            );
            any = true;
            continue;
        }
        let worth = finding.axes.values().map(|a| a.drop_percent).fold(0.0, f64::max);
        let left = unexplained.iter().filter(|u| finding.axes.contains_key(u.axis.name()));
        let Some(most) = left.max_by(|a, b| a.share_percent.total_cmp(&b.share_percent)) else { continue };
        if most.share_percent > worth {
            finding.supported = false;
            finding.reason = format!(
                "a stand-in at best: it takes {worth:.1} %, and {:.1} % of what is left in {} depends on the {}",
                most.share_percent, most.axis, most.depends_on
            );
            any = true;
        }
    }
    any
}

/// The manoeuvre that separates two effects, where one is known.
pub(crate) fn separate(a: Effect, b: Effect) -> String {
    let known = |x: Effect, y: Effect| {
        x.info().confused_with.iter().find(|(id, _)| *id == y.id()).map(|(_, how)| *how)
    };
    known(a, b).or_else(|| known(b, a)).map_or(String::new(), |how| format!("; to separate them: {how}"))
}

/// The evidence for `effect`: a judged model with it against the one without.
pub(crate) fn evidence(
    without: &Judged,
    with: &Judged,
    effect: Effect,
    (train, validate): (&[&Prepared], &[&Prepared]),
    candidates: usize,
) -> EffectFinding {
    let mut finding = EffectFinding::unsupported(effect, validate.len());
    let estimates = estimates(&with.fit, effect);
    let info = effect.info();
    finding.coefficients = info
        .coefficients
        .iter()
        .zip(&estimates)
        .map(|(c, e)| CoefficientFigures {
            name: c.name,
            value: e.value,
            std_error: e.std_error.unwrap_or(0.0),
            unit: c.unit,
        })
        .collect();
    finding.p_value = (wald_p_value(&with.fit, effect, train) * candidates as f64).min(1.0);
    let gain = held_out_gain(without, with, effect, validate);
    let (before, after) = (errors(&without.held_out), errors(&with.held_out));
    for &axis in info.axes {
        finding.axes.insert(axis.name(), AxisDrop::new(before[axis].sse, after[axis].sse));
    }
    finding.drop_percent = gain.drop_percent;
    finding.held_out_p_value = Some(gain.p_value);
    finding.flights_improved[0] = gain.flights_improved;
    finding.gain = log_likelihood_ratio(&before, &after);
    (finding.supported, finding.reason) = weigh(&finding, effect, &with.fit.model);
    finding
}

fn estimates(fit: &Fit, effect: Effect) -> Vec<Estimate> {
    fit.model.term(effect).map_or_else(Vec::new, |term| term.coefficients.clone())
}

/// Smallest held-out drop of an effect that matters, percent: what the free beginnings of a load's swing take away by chance is
/// none of its doing.
pub(crate) fn matters_percent(effect: Effect) -> f64 {
    MATTERS_PERCENT + if effect.info().special.hangs_load { slung_load::BY_CHANCE_PERCENT } else { 0.0 }
}

/// Whether the evidence suffices, and the reason in a sentence.
pub(crate) fn weigh(finding: &EffectFinding, effect: Effect, model: &Model) -> (bool, String) {
    let largest = finding.axes.values().map(|a| a.drop_percent).fold(f64::NEG_INFINITY, f64::max);
    let [improved, flights] = finding.flights_improved;
    if finding.p_value > SIGNIFICANCE {
        if let Some(unseen) = not_excited(finding, effect, model) {
            return (false, unseen);
        }
        return (false, "its coefficients do not differ from zero by more than chance".into());
    }
    let matters = matters_percent(effect);
    if largest < matters {
        let least =
            format!("{largest:.1} % of the held-out error at best, under the {matters:.1} % that matters");
        return (false, format!("too small to matter: {least}"));
    }
    let by_chance = finding.held_out_p_value.filter(|p| *p > HELD_OUT_SIGNIFICANCE);
    if by_chance.is_some() || 2 * improved <= flights && flights > 1 {
        let p = by_chance.map_or_else(String::new, |p| format!(", p = {p:.2}"));
        return (false, format!("held-out flights do not bear it out ({improved} of {flights} improve{p})"));
    }
    let objection = impossible(finding, effect, model).or_else(|| objection(finding, effect));
    if let Some(what) = objection {
        return (false, what);
    }
    (
        true,
        format!("held-out error falls by {:.1} % in {improved} of {flights} flights", finding.drop_percent),
    )
}

/// What an effect itself has to say against estimates that are significant and possible.
fn objection(finding: &EffectFinding, effect: Effect) -> Option<String> {
    let estimates: Vec<Estimate> = finding
        .coefficients
        .iter()
        .map(|c| Estimate { value: c.value, std_error: Some(c.std_error) })
        .collect();
    (effect.info().special.objection)(&estimates)
}

/// "Not seen" is not "not there": when an effect of ordinary size would hide in the error of its estimate, say so and
/// what to fly.
fn not_excited(finding: &EffectFinding, effect: Effect, model: &Model) -> Option<String> {
    let info = effect.info();
    let has_map = model.vehicle.has_rotor_map();
    let hidden = |(k, c): (usize, &CoefficientFigures)| {
        info.coefficients[k].prior.is_none() && 2.0 * c.std_error > step_scale(has_map, effect, k)
    };
    finding.coefficients.iter().enumerate().any(hidden).then(|| {
        format!(
            "not excited: one of ordinary size would not show in these flights; to see it: {}",
            info.excitation
        )
    })
}

/// A coefficient outside its physical range by more than its error allows, as a sentence.
fn impossible(finding: &EffectFinding, effect: Effect, model: &Model) -> Option<String> {
    // Without a rotor map, rotor "speeds" are commands and ranges in rad/s mean nothing.
    if effect.info().is_in_rotor_speed() && !model.vehicle.has_rotor_map() {
        return None;
    }
    finding.coefficients.iter().zip(effect.info().coefficients).find_map(|(e, c)| {
        let slack = 2.0 * e.std_error;
        let (low, high) = c.possible;
        (e.value < low - slack || e.value > high + slack).then(|| {
            format!("needs {} = {:.3} {}, outside the possible {low} to {high}", c.name, e.value, c.unit)
        })
    })
}

/// p-value of the hypothesis that all coefficients of `effect` are zero.
pub(crate) fn wald_p_value(fit: &Fit, effect: Effect, train: &[&Prepared]) -> f64 {
    let first: usize =
        fit.model.terms.iter().take_while(|t| t.effect != effect).map(|t| t.coefficients.len()).sum();
    let values: Vec<f64> = estimates(fit, effect).iter().map(|e| e.value).collect();
    let count = values.len();
    let covariance = fit.covariance.view((first, first), (count, count)).into_owned();
    zero_p_value(&values, &covariance, effect.info().coefficients, independent_stretches(train))
}

/// p-value of the hypothesis that all `coefficients` are zero: Wald's statistic against the F distribution.
///
/// Coefficients with a prior only qualify the others (an offset, a shift): zero is no hypothesis about them. `independent` is what
/// the covariance is known from: stretches of time, see [`independent_stretches`], or fewer.
pub(crate) fn zero_p_value<'a>(
    values: &[f64],
    covariance: &DMatrix<f64>,
    coefficients: impl IntoIterator<Item = &'a model::Coefficient>,
    independent: f64,
) -> f64 {
    let is_tested = |(i, c): (usize, &model::Coefficient)| c.prior.is_none().then_some(i);
    let tested: Vec<usize> = coefficients.into_iter().enumerate().filter_map(is_tested).collect();
    let k = tested.len();
    let theta = DVector::from_iterator(k, tested.iter().map(|&i| values[i]));
    let covariance = DMatrix::from_fn(k, k, |r, c| covariance[(tested[r], tested[c])]);
    let Some(cholesky) = covariance.cholesky() else { return 1.0 };
    let wald = theta.dot(&cholesky.solve(&theta)) / k as f64;
    let freedom = (independent - k as f64).max(1.0);
    FisherSnedecor::new(k as f64, freedom).map_or(1.0, |f| f.sf(wald))
}

/// Neighbouring samples are not independent; stretches as long as the covariance's window stand in for them.
pub(crate) fn independent_stretches(flights: &[&Prepared]) -> f64 {
    flights.iter().map(|f| f.rows() as f64 * f.period_s).sum::<f64>() / WINDOW_S
}

/// Of two models of the same flights, Gaussian residuals: sum over the axes of n/2 ln(sse before / sse after). Effects that
/// act on different axes are compared by it, whatever the axes' noise.
pub(crate) fn log_likelihood_ratio(before: &PerAxis<AxisError>, after: &PerAxis<AxisError>) -> f64 {
    let ratio = |a: model::Axis| 0.5 * before[a].samples as f64 * (before[a].sse / after[a].sse).ln();
    model::AXES.into_iter().map(ratio).filter(|r| r.is_finite()).sum()
}

struct Gain {
    drop_percent: f64,
    p_value: f64,
    flights_improved: usize,
}

/// The fall of the held-out squared error over the axes an effect acts on, each in units of the noise variance that
/// is left on the training flights with it.
fn held_out_gain(base: &Judged, with: &Judged, effect: Effect, validate: &[&Prepared]) -> Gain {
    let mut blocks = Blocks::default();
    let (mut total, mut before) = (0.0, 0.0);
    let mut flights_improved = 0;
    for ((flight, a), b) in validate.iter().zip(&base.held_out).zip(&with.held_out) {
        let mut difference = vec![0.0; flight.rows()];
        let mut chance = difference.clone();
        for axis in effect.info().axes.iter().map(|a| a.index()) {
            let weight = 1.0 / (with.fit.sigma[axis] * with.fit.sigma[axis]);
            let sums = difference.iter_mut().zip(&mut chance);
            for (((d, c), x), y) in sums.zip(&a.residual[axis]).zip(&b.residual[axis]) {
                *d += weight * (x * x - y * y);
                *c += weight * 2.0 * y * (x - y);
                before += weight * x * x;
            }
        }
        let sum: f64 = difference.iter().sum();
        flights_improved += usize::from(sum > 0.0);
        total += sum;
        blocks.gain.extend(block_sums(flight, &difference));
        blocks.chance.extend(block_sums(flight, &chance));
    }
    Gain {
        drop_percent: if before > 0.0 { 100.0 * total / before } else { 0.0 },
        p_value: blocks.p_value(),
        flights_improved,
    }
}

/// A held-out gain, block by block. With e left by the better model, which predicts d more than the other, the gain is
/// (e + d)^2 - e^2 = d^2 + 2 e d, and 2 e d is the part that noise has in it.
///
/// The spread of the gain itself is no measure of chance: an effect that shows in one low pass of a flight has all its gain in
/// one block, and a t test over blocks then calls it luck, however large it is.
#[derive(Default)]
pub(crate) struct Blocks {
    pub(crate) gain: Vec<f64>,
    pub(crate) chance: Vec<f64>,
}

impl Blocks {
    /// Takes in blocks of another axis, in units of its own.
    pub(crate) fn extend_by(&mut self, other: &Self, scale: f64) {
        self.gain.extend(other.gain.iter().map(|gain| scale * gain));
        self.chance.extend(other.chance.iter().map(|chance| scale * chance));
    }

    /// p-value of "the gain is no more than noise made it", by Student's t over the blocks.
    pub(crate) fn p_value(&self) -> f64 {
        let n = self.gain.len() as f64;
        if self.gain.len() < 3 {
            return 1.0;
        }
        let gain: f64 = self.gain.iter().sum();
        let spread = self.chance.iter().map(|c| c * c).sum::<f64>().sqrt();
        if !(spread > 0.0) {
            return if gain > 0.0 { 0.0 } else { 1.0 };
        }
        StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |d| d.sf(gain / spread))
    }
}

/// Sums over blocks of time as long as the covariance's window, not across gaps.
pub(crate) fn block_sums(flight: &Prepared, values: &[f64]) -> Vec<f64> {
    let length = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
    let starts = flight.row_starts();
    let mut blocks = Vec::new();
    for (i, &start) in starts.iter().enumerate() {
        let end = starts.get(i + 1).copied().unwrap_or(values.len());
        blocks.extend(
            values[start..end]
                .chunks(length)
                .filter(|c| 2 * c.len() >= length)
                .map(|c| c.iter().sum::<f64>()),
        );
    }
    blocks
}

/// p-value of "the mean is not above zero", by Student's t over the blocks.
pub(crate) fn one_sided_p_value(blocks: &[f64]) -> f64 {
    let n = blocks.len() as f64;
    if blocks.len() < 3 {
        return 1.0;
    }
    let mean = blocks.iter().sum::<f64>() / n;
    let variance = blocks.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if variance <= 0.0 {
        return if mean > 0.0 { 0.0 } else { 1.0 };
    }
    let t = mean / (variance / n).sqrt();
    StudentsT::new(0.0, 1.0, n - 1.0).map_or(1.0, |d| d.sf(t))
}

/// Axes whose residual is well above the sensors' noise without depending on a measured quantity: with what frequency.
fn above_noise(ratios: &[Option<f64>; 6], rest: &Judged, validate: &[&Prepared]) -> Vec<Unexplained> {
    model::AXES
        .into_iter()
        .filter_map(|axis| {
            let ratio = ratios[axis.index()].filter(|ratio| *ratio > ABOVE_NOISE)?;
            let depends_on = noise::frequency(validate, &rest.held_out, axis.index());
            Some(Unexplained { axis, depends_on, share_percent: 100.0 * (1.0 - 1.0 / ratio), p_value: 0.0 })
        })
        .collect()
}

/// Axes on which the effects found leave more of the residual's excess over the noise than right ones would.
fn incomplete(before: &[Option<f64>; 6], after: &[Option<f64>; 6]) -> [bool; 6] {
    std::array::from_fn(|axis| match (before[axis], after[axis]) {
        (Some(before), Some(after)) => {
            after > ABOVE_NOISE && (after - 1.0) > LEFT_BY_THE_RIGHT * (before - 1.0)
        }
        _ => false,
    })
}

fn summary(verdict: Verdict, findings: &[EffectFinding], unexplained: &[Unexplained]) -> String {
    let supported: Vec<&EffectFinding> = findings.iter().filter(|f| f.supported).collect();
    match verdict {
        Verdict::MissingEffect => {
            let best = supported[0];
            let sentence = Effect::from_id(best.effect).map_or("", |e| e.info().sentence);
            let also: Vec<&str> = supported[1..].iter().map(|f| f.effect).collect();
            let also = if also.is_empty() {
                String::new()
            } else {
                format!(" Also supported: {}.", also.join(", "))
            };
            let [improved, flights] = best.flights_improved;
            format!(
                "The model lacks {}. {sentence} With it the error on flights that were not used for the fit falls by \
                 {:.1} % ({improved} of {flights} flights, p = {:.1e}).{also}",
                best.effect, best.drop_percent, best.p_value
            )
        }
        Verdict::Adequate => {
            "No known effect lowers the error on held-out flights by an amount that matters, and what \
                              is left depends on none of the measured quantities."
                .into()
        }
        Verdict::Unexplained => {
            let worst = &unexplained[0];
            format!(
                "The residual of {} {} ({:.1} % of its held-out error), and no known effect accounts for it.",
                worst.axis,
                match worst.depends_on.as_str() {
                    "constant offset" => "has a constant offset".to_owned(),
                    time if time.starts_with("an ") || time.starts_with("slow ") => format!("shows {time}"),
                    quantity => format!("depends on the {quantity}"),
                },
                worst.share_percent
            )
        }
    }
}

/// An effect added to a model: the better model and the held-out errors without and with it.
#[derive(Debug, Clone)]
pub struct Addition {
    /// The refitted model with the effect.
    pub fit: Fit,
    /// The evidence.
    pub finding: EffectFinding,
    /// Held-out errors of the model refitted without it.
    pub before: PerAxis<f64>,
    /// Held-out errors with it.
    pub after: PerAxis<f64>,
}

/// Adds an effect to a model, refits everything on the training flights and judges it on the held-out ones.
pub fn add(
    model: &Model,
    effect: Effect,
    train: &[&Prepared],
    validate: &[&Prepared],
) -> Result<Addition, FitError> {
    let base = judge(model, &model.effects(), train, validate)?;
    let mut effects = model.effects();
    effects.push(effect);
    let with = judge(&base.fit.model, &effects, train, validate)?;
    let candidates = Options::default().candidates(model).len();
    let finding = evidence(&base, &with, effect, (train, validate), candidates);
    let (before, after) = (errors(&base.held_out), errors(&with.held_out));
    Ok(Addition {
        fit: with.fit,
        finding,
        before: PerAxis::from_fn(|a| before[a].sse),
        after: PerAxis::from_fn(|a| after[a].sse),
    })
}
