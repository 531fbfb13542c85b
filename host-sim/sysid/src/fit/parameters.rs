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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::truth;

    #[test]
    fn a_scale_is_halved_or_doubled_at_most_and_stays_possible() {
        // A cable of 0.08 to 10 m.
        let length = &Effect::SlungLoad.info().coefficients[1];
        let end = |now, step| step_end(now, step, length);
        assert_eq!((end(1.0, 0.3), end(1.0, -5.0), end(1.0, 5.0)), (1.3, 0.5, 2.0));
        assert_eq!((end(0.1, -5.0), end(8.0, 50.0)), (0.08, 10.0));
        // What is not there yet is no scale: as far again outside the possible.
        assert_eq!((end(0.0, 0.4), end(0.0, -50.0)), (0.4, 0.08 - 9.92));
    }

    #[test]
    fn a_damping_does_not_step_below_zero_and_a_mass_may() {
        // Possible from 0 to 100 kg and from 0 to 0.5; a step ends as far again outside.
        let [mass, _, damping] = Effect::SlungLoad.info().coefficients else { panic!("three coefficients") };
        assert!(is_bound(damping) && !is_bound(mass));
        assert_eq!((step_end(0.1, -5.0, damping), step_end(0.1, 5.0, damping)), (0.0, 1.0));
        assert_eq!((step_end(0.0, -5.0, mass), step_end(0.0, -500.0, mass)), (-5.0, -100.0));
    }

    #[test]
    fn what_is_known_of_the_next_step_leads_back_to_zero() {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.1, 0.7, 0.02]);
        let priors: Vec<Option<Prior>> = priors_of(&model, Effect::SlungLoad).collect();
        assert!(priors[0].is_none());
        let [length, damping] = [1, 2].map(|k| priors[k].unwrap());
        assert_eq!((length.expected, length.deviation), (-0.7, 30.0));
        assert_eq!((damping.expected, damping.deviation), (-0.02, 0.1));
        assert_eq!(priors_of(&truth(), Effect::SlungLoad).count(), 0);
    }

    #[test]
    fn values_are_stored_effect_by_effect_and_new_ones_last() {
        let mut model = truth();
        let before = model.effects();
        store(&mut model, &[Effect::MassChange, Effect::LinearDrag], &[0.5, 1.0, 2.0, 3.0]);
        assert_eq!(model.effects(), [&before[..], &[Effect::MassChange]].concat());
        assert_eq!(model.term(Effect::MassChange).unwrap().values(), [0.5]);
        assert_eq!(model.term(Effect::LinearDrag).unwrap().values(), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn only_some_adjusting_effects_add_accelerations() {
        let layout = |adjusting: Vec<Effect>| Layout {
            linear: vec![Effect::Thrust],
            order: Vec::new(),
            is_searched: false,
            adjusting,
        };
        assert!(!layout(Vec::new()).adds());
        assert!(!layout(vec![Effect::MassChange]).adds());
        assert!(layout(vec![Effect::MassChange, Effect::SlungLoad]).adds());
    }
}
