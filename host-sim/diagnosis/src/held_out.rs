//! Fits, what they predict of flights held out, and what an effect gains there.

use model::{Axis, AxisError, Effect, Model, PerAxis};
use sysid::fit::slung_load::Carried;
use sysid::fit::starts::Demand;
use sysid::fit::{check_residuals, fit_if, slung_load};
use sysid::prepare::Prepared;
use sysid::statistics::Blocks;
use sysid::{Fit, FitError, Residuals, errors, has_rotation, residuals};

use crate::anchor::anchor_of;
use crate::criteria::{Evidence, HELD_OUT_SIGNIFICANCE, RISE_PERCENT, weigh};
use crate::finding::{AxisDrop, CoefficientFigures, EffectFinding, Swing};
use crate::late_attitude::attitude_late_s;
use crate::low_frequency::found_at_low_frequency;
use crate::reason::Reason;
use crate::significance::{effect_p_value, take_fall};
use crate::swing_band;
use crate::tracker_tilt::tracker_tilt_deg;

/// A model refitted on the training flights and its residuals on the held-out ones.
#[derive(Clone)]
pub(crate) struct Validated {
    pub(crate) fit: Fit,
    pub(crate) held_out: Vec<Residuals>,
}

/// Fits `effects`, from the values of `model` on, and predicts the held-out flights.
pub(crate) fn fit_and_validate(
    model: &Model,
    effects: &[Effect],
    train: &[&Prepared],
    validate: &[&Prepared],
) -> Result<Validated, FitError> {
    validated(sysid::fit(train, &model.vehicle, effects, Some(model))?, validate)
}

/// A model with more effects, of which nothing is known.
pub(crate) fn fit_more(
    from: &Model,
    members: &[Effect],
    (train, validate): (&[&Prepared], &[&Prepared]),
) -> Result<Validated, FitError> {
    let effects = [from.effects().as_slice(), members].concat();
    validated(fit_if(train, &from.vehicle, &effects, Some(from), Demand::Promising)?, validate)
}

/// What a fit predicts of the held-out flights.
pub(crate) fn validated(fit: Fit, validate: &[&Prepared]) -> Result<Validated, FitError> {
    let held_out: Vec<Residuals> = validate.iter().map(|flight| residuals(flight, &fit.model)).collect();
    check_residuals(validate, &held_out, &fit.model)?;
    Ok(Validated { fit, held_out })
}

/// The evidence for `effect`: a fit with it against the one without.
pub(crate) fn examine(
    without: &Validated,
    with: &Validated,
    effect: Effect,
    flights: (&[&Prepared], &[&Prepared]),
    candidates: usize,
) -> EffectFinding {
    examine_along(judged_axes(effect, &with.fit.model), without, with, effect, flights, candidates)
}

/// The same on some of the axes that the effect acts on, the first ones.
pub(crate) fn examine_along(
    axes: &[Axis],
    without: &Validated,
    with: &Validated,
    effect: Effect,
    (train, validate): (&[&Prepared], &[&Prepared]),
    candidates: usize,
) -> EffectFinding {
    let mut finding = EffectFinding::unsupported(effect, validate.len(), Reason::LikeChance);
    let estimates = with.fit.model.term(effect).map_or(&[][..], |term| &term.coefficients);
    let info = effect.info();
    finding.coefficients = info
        .coefficients
        .iter()
        .zip(estimates)
        .map(|(c, e)| CoefficientFigures::new(c, e.value, e.std_error.unwrap_or(0.0), &with.fit.model))
        .collect();
    let carried = slung_load::of_model(&with.fit.model).filter(|_| info.special.hangs_load);
    finding.swing = carried.map(|carried| {
        let up_to_hz = swing_band::up_to_hz(&carried);
        let both = (&without.held_out[..], &with.held_out[..]);
        let drop_percent = swing_band::drop_percent(validate, both, up_to_hz);
        Swing { count: swings(&carried, &[train, validate].concat()), up_to_hz, drop_percent }
    });
    finding.attitude_late_s = attitude_late_s(&with.fit.model, effect, train);
    finding.tracker_tilt_deg = tracker_tilt_deg(&with.fit.model, effect, train);
    finding.anchor = anchor_of(&finding, &[train, validate].concat());
    finding.p_value = (effect_p_value(&with.fit, effect, train) * candidates as f64).min(1.0);
    take_gain(&mut finding, (axes, &with.fit.sigma), validate, (&without.held_out, &with.held_out));
    let weighed = |finding: &EffectFinding| weigh(&Evidence::missing(finding, &with.fit.model));
    (finding.supported, finding.reason) = weighed(&finding);
    if finding.supported && axes.iter().any(|axis| !axis.is_force()) {
        finding.at_low_frequency = found_at_low_frequency(&with.fit, effect, train);
        (finding.supported, finding.reason) = weighed(&finding);
    }
    finding
}

/// Swings of a load over the longest stretch of flights.
fn swings(carried: &Carried, flights: &[&Prepared]) -> f64 {
    let seconds = |flight: &&Prepared| {
        let samples = flight.stretches.iter().map(|stretch| stretch.time_s.len()).max().unwrap_or(0);
        samples as f64 * flight.period_s
    };
    let longest_s = flights.iter().map(seconds).fold(0.0, f64::max);
    longest_s / carried.swing_s()
}

/// The axes that the evidence for an effect is taken on: those that it acts on. A model of forces alone predicts nothing of the
/// rotation, and what it leaves there would hide what the effect takes of the forces; only an effect of moments is asked for those.
pub(crate) fn judged_axes(effect: Effect, model: &Model) -> &'static [Axis] {
    let axes = effect.info().axes;
    match axes.iter().take_while(|axis| axis.is_force()).count() {
        forces if forces > 0 && !has_rotation(model) => &axes[..forces],
        _ => axes,
    }
}

/// Writes into a finding by how much the squared error of `flights` falls from the residuals `before` to those `after`,
/// over the `axes` that it is judged on, each in units of the noise variance `sigma` squared.
pub(crate) fn take_gain(
    finding: &mut EffectFinding,
    (axes, sigma): (&[Axis], &[f64; 6]),
    flights: &[&Prepared],
    (before, after): (&[Residuals], &[Residuals]),
) {
    let mut blocks = Blocks::default();
    let (mut fall, mut total) = (0.0, 0.0);
    for ((flight, a), b) in flights.iter().zip(before).zip(after) {
        let weights = axes.iter().map(|axis| (*axis, 1.0 / (sigma[axis.index()] * sigma[axis.index()])));
        let squares = |(axis, weight): (Axis, f64)| -> f64 {
            weight * a.residual[axis.index()].iter().map(|x| x * x).sum::<f64>()
        };
        let own_total: f64 = weights.clone().map(squares).sum();
        let own_fall = take_fall(&mut blocks, flight, weights, (a, b));
        finding.drop_percent_by_flight.push(if own_total > 0.0 { 100.0 * own_fall / own_total } else { 0.0 });
        finding.flights_improved[0] += usize::from(own_fall > 0.0);
        fall += own_fall;
        total += own_total;
    }
    let (errors_before, errors_after) = (errors(before), errors(after));
    for &axis in axes {
        let drop = AxisDrop::new(errors_before[axis].sse, errors_after[axis].sse);
        finding.axes.insert(axis.name(), drop);
    }
    let rises: Vec<(Axis, f64)> =
        axes.iter().filter_map(|axis| rise(*axis, finding, flights, (before, after))).collect();
    finding.harm_percent = harm_percent(finding, &rises);
    finding.rise = rises.into_iter().max_by(|one, other| one.1.total_cmp(&other.1));
    finding.drop_percent = if total > 0.0 { 100.0 * fall / total } else { 0.0 };
    finding.held_out_p_value = Some(blocks.p_value());
    finding.gain_of = log_likelihood_ratios(&errors_before, &errors_after);
    finding.gain = finding.gain_of.iter().sum();
}

/// What rises of the squared error of some axes take, percent of what the falls of the others add: logarithms, as of likelihoods.
fn harm_percent(finding: &EffectFinding, rises: &[(Axis, f64)]) -> f64 {
    let loss: f64 = rises.iter().map(|(_, percent)| (1.0 + 0.01 * percent).ln()).sum();
    let falls = finding.axes.values().map(|axis| axis.drop_percent).filter(|percent| *percent > 0.0);
    let gain: f64 = falls.map(|percent| -(1.0 - 0.01 * percent).max(f64::MIN_POSITIVE).ln()).sum();
    if loss > 0.0 { 100.0 * loss / gain.max(f64::MIN_POSITIVE) } else { 0.0 }
}

/// By how many percent the squared error of an axis rises; nothing where it does not by an amount that counts, or where noise would make
/// it rise as much.
fn rise(
    axis: Axis,
    finding: &EffectFinding,
    flights: &[&Prepared],
    (before, after): (&[Residuals], &[Residuals]),
) -> Option<(Axis, f64)> {
    let percent = -finding.axes.get(axis.name())?.drop_percent;
    if percent <= RISE_PERCENT {
        return None;
    }
    let mut blocks = Blocks::default();
    for ((flight, a), b) in flights.iter().zip(before).zip(after) {
        take_fall(&mut blocks, flight, [(axis, 1.0)], (b, a));
    }
    (blocks.p_value() <= HELD_OUT_SIGNIFICANCE).then_some((axis, percent))
}

/// Logarithms of the likelihood ratios of two models of the same flights, Gaussian residuals: n/2 ln(sse before / sse after) of each axis.
/// Effects that act on different axes are compared by their sums, whatever the axes' noise.
fn log_likelihood_ratios(before: &PerAxis<AxisError>, after: &PerAxis<AxisError>) -> [f64; 6] {
    model::AXES.map(|axis| {
        let ratio = 0.5 * before[axis].samples as f64 * (before[axis].sse / after[axis].sse).ln();
        if ratio.is_finite() { ratio } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// Halving the error's deviation on n samples of one axis: n ln 2. An axis without errors says nothing.
    #[test]
    fn the_likelihood_ratio_of_halved_errors() {
        let all = |sse: f64| {
            PerAxis::from_fn(|a| AxisError {
                samples: 100,
                sse: if a.is_force() { sse } else { 0.0 },
                ..AxisError::default()
            })
        };
        let found = log_likelihood_ratios(&all(4.0), &all(1.0)).iter().sum::<f64>();
        assert!((found - 3.0 * 100.0 * 2_f64.ln()).abs() < 1e-9, "{found}");
    }

    /// Falls of 50 and 10 % add ln 2 + ln(1/0.9), a rise of 20 % takes ln 1.2: 22.8 % of it.
    #[test]
    fn what_rises_take_is_told_by_what_falls_add() {
        let mut finding = EffectFinding::unsupported(Effect::Tether, 2, Reason::LikeChance);
        for (axis, after) in [("u", 50.0), ("v", 90.0), ("w", 120.0)] {
            finding.axes.insert(axis, AxisDrop::new(100.0, after));
        }
        let expected = 100.0 * 1.2_f64.ln() / (2.0_f64.ln() - 0.9_f64.ln());
        assert!((harm_percent(&finding, &[(Axis::W, 20.0)]) - expected).abs() < 1e-9);
        assert_eq!(harm_percent(&finding, &[]), 0.0);
    }

    /// A battery acts on thrust and moments: where no moment is predicted, what is left of p, q and r is none of its doing.
    #[test]
    fn a_model_of_forces_alone_judges_effects_by_their_forces() {
        let whole = truth();
        let mut forces = truth();
        forces.terms.retain(|term| term.effect != Effect::RotorMoments);
        assert_eq!(judged_axes(Effect::BatteryVoltage, &whole), [Axis::W, Axis::P, Axis::Q, Axis::R]);
        assert_eq!(judged_axes(Effect::BatteryVoltage, &forces), [Axis::W]);
        let moments = [Axis::P, Axis::Q, Axis::R];
        assert_eq!(judged_axes(Effect::AngularDamping, &forces), moments);
        for effect in Effect::all() {
            let axes = effect.info().axes;
            assert!(axes.is_sorted_by_key(|axis| axis.index()), "{effect}: {axes:?}");
        }
    }

    /// Of twice the noise in w and as much in p, the whole of w is taken away.
    #[test]
    fn what_is_not_predicted_does_not_hide_what_an_effect_takes_away() {
        let flights = prepared(&truth(), 30..31, 4.0, &ORDINARY);
        let left = |w: f64| {
            let all = [0.0, 0.0, w, 2.0, 0.0, 0.0].map(|value| vec![value; flights[0].rows()]);
            [Residuals { residual: all, ..residuals(&flights[0], &truth()) }]
        };
        let fall = |axes: &[Axis]| {
            let mut finding = EffectFinding::unsupported(Effect::BatteryVoltage, 1, Reason::LikeChance);
            take_gain(&mut finding, (axes, &[1.0; 6]), &[&flights[0]], (&left(2.0), &left(0.0)));
            assert_eq!(finding.judged_axes(), axes);
            finding.drop_percent
        };
        assert!((fall(&[Axis::W]) - 100.0).abs() < 1e-9);
        assert!((fall(&[Axis::W, Axis::P]) - 50.0).abs() < 1e-9);
    }

    /// A cable of 0.5 m swings 7.05 times in ten seconds.
    #[test]
    fn swings_are_counted_in_the_longest_stretch() {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.05, 0.5, 0.05]);
        let flights = prepared(&truth(), 30..31, 10.0, &ORDINARY);
        let found = swings(&slung_load::of_model(&model).unwrap(), &[&flights[0]]);
        assert!((found - 7.05).abs() < 0.1, "{found}");
    }
}
