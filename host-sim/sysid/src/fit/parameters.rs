//! The parameters of a fit: their order, what is known of them, how far a step goes, and how they are written into a model.

use model::{Effect, Estimate, Kind, Model, Term};

use crate::fit::least_squares::Prior;

/// The effects of a fit, in the order of its parameters.
pub(crate) struct Layout {
    /// Effects that are linear in their coefficients.
    pub(crate) linear: Vec<Effect>,
    /// Effects that change what the others see.
    pub(crate) adjusting: Vec<Effect>,
    pub(crate) order: Vec<Effect>,
    /// Whether a search gave a load's first values.
    pub(crate) is_searched: bool,
}

impl Layout {
    /// Linear effects first, then adjusting ones, each in the order given.
    pub(crate) fn new(effects: &[Effect]) -> Self {
        let (adjusting, linear): (Vec<Effect>, Vec<Effect>) =
            effects.iter().copied().partition(|e| e.info().kind == Kind::Adjusting);
        let order = linear.iter().chain(&adjusting).copied().collect();
        Self { linear, adjusting, order, is_searched: false }
    }

    /// Whether any effect adds accelerations that no column shows.
    pub(crate) fn adds(&self) -> bool {
        self.adjusting.iter().any(|effect| effect.info().special.adds_accelerations)
    }
}

/// Where a step of an adjusting coefficient ends. Far outside the possible there is nothing to find, and the columns lose
/// their meaning: it ends there.
pub fn step_end(now: f64, step: f64, info: &model::Coefficient) -> f64 {
    let (low, high) = info.possible;
    let reach = high - low;
    if low > 0.0 && now > 0.0 {
        // What cannot be zero is a scale: no step takes more than half of it away or more than doubles it, and beyond the
        // possible it means something else.
        return (now + step).clamp(0.5 * now, 2.0 * now).clamp(low, high);
    }
    (now + step).clamp(if is_bound(info) { low } else { low - reach }, high + reach)
}

/// Whether no step leads below the least that is possible: a damping that adds energy makes a swing grow beyond all measure.
pub(crate) fn is_bound(info: &model::Coefficient) -> bool {
    info.possible.0 == 0.0 && info.prior.is_some()
}

/// What is known of the next step of an adjusting effect's coefficients: it leads back to zero.
pub fn priors_of(model: &Model, effect: Effect) -> impl Iterator<Item = Option<Prior>> {
    let values: Vec<f64> =
        model.term(effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect();
    let known = effect.info().coefficients.iter().zip(values);
    known.map(|(c, now)| c.prior.map(|deviation| Prior { expected: -now, deviation }))
}

/// Writes values of `effects` in order into the model, without errors.
pub(crate) fn store(model: &mut Model, effects: &[Effect], values: &[f64]) {
    let mut at = 0;
    for effect in effects {
        let count = effect.info().coefficients.len();
        let estimates = (at..at + count).map(|k| Estimate { value: values[k], std_error: None });
        let term = Term { effect: *effect, coefficients: estimates.collect() };
        match model.terms.iter_mut().find(|t| t.effect == *effect) {
            Some(known) => *known = term,
            None => model.terms.push(term),
        }
        at += count;
    }
}
