//! Identification: a model structure fitted to flights, and what it predicts.
//!
//! Linear coefficients come from one least squares. Coefficients of adjusting effects (wind, lever, ground effect ...)
//! enter through the residual's derivative with respect to them, next to the linear columns, and the step is repeated
//! until it is small against its own standard error: Gauss and Newton's method on the same stacked problem, so
//! every coefficient gets a standard error of the same kind.
//!
//! Where they start decides where they end, for some: `starts.rs`.

use model::{Effect, Kind, Model, Vehicle};

use crate::fit::assembly::{assemble, timing};
use crate::fit::error::{FitError, check_finite, not_converged, unidentifiable};
use crate::fit::fitted::{Fit, finish};
use crate::fit::least_squares;
use crate::fit::linearise::step_scale;
use crate::fit::nonlinear::{settle, settle_carefully, stay};
use crate::fit::parameters::{Layout, store};
use crate::fit::residuals::spread;
use crate::fit::rotation::acts_on_rotation_alone;
use crate::fit::starts::{self, Demand};
use crate::fit::swing::Known;
use crate::fit::terms::coefficient_count;
use crate::fit::wide_swings;
use crate::prepare::Prepared;

/// Fits `effects` to `flights`. `start` gives first values of adjusting coefficients, where it has them; where it has all and the
/// flights lead nowhere from there, they stay.
pub fn fit(
    flights: &[&Prepared],
    vehicle: &Vehicle,
    effects: &[Effect],
    start: Option<&Model>,
) -> Result<Fit, FitError> {
    fit_if(flights, vehicle, effects, start, Demand::Best)
}

/// The same, if the search over the shapes of an unknown effect finds what is demanded.
pub fn fit_if(
    flights: &[&Prepared],
    vehicle: &Vehicle,
    effects: &[Effect],
    start: Option<&Model>,
    demand: Demand,
) -> Result<Fit, FitError> {
    if flights.is_empty() {
        return Err(FitError::NoFlights);
    }
    if !effects.contains(&Effect::RotorMoments)
        && let Some(effect) = effects.iter().find(|e| acts_on_rotation_alone(**e))
    {
        return Err(FitError::NoRotation { effect: effect.id() });
    }
    let mut model = beginning(flights, vehicle, effects, start);
    let flights = &wide_swings::followable(flights, &model)[..];
    let mut layout = Layout::new(effects);
    let linear = &layout.linear;
    let rows = assemble(flights, &model, linear, &[], &mut vec![Known::default(); flights.len()]).0;
    check_finite(flights, &rows, &model)?;
    let count: usize = linear.iter().map(|e| coefficient_count(*e)).sum();
    let priors = vec![None; count];
    let solution =
        least_squares::solve_without_errors(&rows, &priors).map_err(|why| unidentifiable(why, linear))?;
    store(&mut model, linear, solution.value.as_slice());
    if layout.adjusting.is_empty() {
        let solution = least_squares::with_errors_beside(solution, &rows, &priors, &timing(flights, &model));
        return Ok(finish(model, linear, solution));
    }
    let is_unknown = |effect: Effect| start.is_none_or(|m| !m.has(effect));
    layout.is_searched =
        layout.adjusting.iter().any(|effect| effect.info().special.hangs_load && is_unknown(*effect));
    // Values that a model was once given are no worse for steps that find no end from there.
    let known = (!layout.adjusting.iter().any(|effect| is_unknown(*effect))).then(|| model.clone());
    let (starts, flights) = starts::of(flights, model, &layout, is_unknown, demand)?;
    let best = best_of(starts, &flights, start, &layout);
    match known {
        Some(known) => best.or_else(|_| stay(&flights, known, &layout)),
        None => best,
    }
}

/// The model before any fit: effects without values, but for those of adjusting effects that `start` has.
fn beginning(flights: &[&Prepared], vehicle: &Vehicle, effects: &[Effect], start: Option<&Model>) -> Model {
    let mut model = Model::new(vehicle.clone());
    model.reference.battery_v = match start {
        Some(start) => start.reference.battery_v,
        None => {
            let rows: f64 = flights.iter().map(|f| f.rows() as f64).sum();
            flights.iter().map(|f| f.mean_battery_v() * f.rows() as f64).sum::<f64>() / rows
        }
    };
    model.reference.rotor_speeds_logged =
        !vehicle.has_rotor_map() && flights.iter().all(|f| f.has_rotor_speeds());
    for &effect in effects {
        let zeros = vec![0.0; effect.info().coefficients.len()];
        model.set(effect, &zeros);
        if let (Kind::Adjusting, Some(known)) = (effect.info().kind, start.and_then(|m| m.term(effect))) {
            let values: Vec<f64> = known.coefficients.iter().map(|c| c.value).collect();
            model.set(effect, &values);
        }
    }
    model
}

/// The fit that leaves least, of those that settle from `starts`; where none does, of those that smaller steps settle.
fn best_of(
    starts: Vec<Model>,
    flights: &[&Prepared],
    start: Option<&Model>,
    layout: &Layout,
) -> Result<Fit, FitError> {
    let why = match least_left(starts.iter().map(|start| settle(flights, start.clone(), layout))) {
        // All its shapes were tried: other starts of the others do not bring it back.
        Err(why @ FitError::RanAway { .. }) => return Err(why),
        Err(why) => why,
        best => return best,
    };
    let carefully = || {
        if layout.adds() {
            return Err(FitError::NoFlights);
        }
        least_left(starts.iter().map(|start| settle_carefully(flights, start.clone(), layout)))
    };
    let [only] = &starts[..] else { return carefully().map_err(|_| why) };
    // The first step from zero can end where an effect saturates (a lag of nothing): set out from either side as well.
    let from = |side: f64| {
        let other = ordinary(only, &layout.adjusting, start, side);
        if other == *only { Err(not_converged(&layout.adjusting)) } else { settle(flights, other, layout) }
    };
    from(1.0).or_else(|_| from(-1.0)).or_else(|_| carefully()).map_err(|_| why)
}

/// Of several fits, the one that leaves least; the first reason where there is none.
fn least_left(ends: impl Iterator<Item = Result<Fit, FitError>>) -> Result<Fit, FitError> {
    let best = ends.reduce(|best, end| match (best, end) {
        (Ok(a), Ok(b)) => Ok(if spread(&b.sigma) < spread(&a.sigma) { b } else { a }),
        (Ok(fit), Err(_)) | (Err(_), Ok(fit)) => Ok(fit),
        (Err(why), Err(_)) => Err(why),
    });
    best.unwrap_or(Err(FitError::NoFlights))
}

/// The model with half the ordinary values, of one sign, for adjusting effects without a known value.
fn ordinary(model: &Model, adjusting: &[Effect], start: Option<&Model>, side: f64) -> Model {
    let mut model = model.clone();
    let has_map = model.vehicle.has_rotor_map();
    let unknown = |e: &&Effect| start.is_none_or(|m| !m.has(**e)) && e.starts().is_empty();
    for effect in adjusting.iter().filter(unknown) {
        let values: Vec<f64> = (0..effect.info().coefficients.len())
            .map(|k| 0.5 * side * step_scale(has_map, *effect, k))
            .collect();
        model.set(*effect, &values);
    }
    model
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, prepared, truth};

    #[test]
    fn a_craft_flown_without_noise_gives_its_coefficients_back() {
        let model = truth();
        let flights =
            [1, 2].map(|seed| Prepared::new(&fly(&model, seed, 12.0, &NONE), &model.vehicle).unwrap());
        let fit = fit(&flights.each_ref(), &model.vehicle, &model.effects(), None).unwrap();
        assert!(fit.is_settled);
        for effect in [Effect::Thrust, Effect::LinearDrag, Effect::RotorMoments] {
            let [found, right] = [&fit.model, &model].map(|of| of.term(effect).unwrap().values());
            for (found, right) in found.iter().zip(&right) {
                // The mean state of two samples stands for what is between them.
                assert!((found / right - 1.0).abs() < 0.002, "{effect}: {found}, not {right}");
            }
        }
    }

    #[test]
    fn without_flights_or_with_moments_but_not_the_rotors_there_is_no_fit() {
        let flight = prepared(400, |_, _| {});
        let vehicle = Vehicle::thesis();
        let refused = |flights: &[&Prepared], effects: &[Effect]| fit(flights, &vehicle, effects, None).err();
        assert_eq!(refused(&[], &[Effect::Thrust]), Some(FitError::NoFlights));
        let effects = [Effect::Thrust, Effect::AngularDamping];
        assert_eq!(refused(&[&flight], &effects), Some(FitError::NoRotation { effect: "angular-damping" }));
        // A craft that hovers has no speed by which drag could be seen.
        let what = refused(&[&flight], &[Effect::Thrust, Effect::LinearDrag]);
        assert!(matches!(what, Some(FitError::NotExcited { effect: "linear-drag", .. })), "{what:?}");
    }

    /// 440 rows at 12 V and 140 at 10 V: 6680 V over 580 rows.
    #[test]
    fn a_fit_begins_at_the_mean_voltage_of_all_rows_with_the_adjusting_values_that_are_known() {
        let flights = [(500, 12.0), (200, 10.0)].map(|(samples, volts)| {
            let flight = prepared(samples, |_, row| row.battery_v = volts);
            assert_eq!(flight.rows(), samples - 60);
            flight
        });
        let effects = [Effect::Thrust, Effect::MassChange, Effect::SteadyWind];
        let vehicle = Vehicle::thesis();
        let anew = beginning(&flights.each_ref(), &vehicle, &effects, None);
        assert!((anew.reference.battery_v - 6680.0 / 580.0).abs() < 1e-9, "{}", anew.reference.battery_v);
        assert!(anew.terms.iter().flat_map(|term| term.values()).all(|value| value == 0.0));
        let mut known = truth();
        known.set(Effect::MassChange, &[0.3]);
        let again = beginning(&flights.each_ref(), &vehicle, &effects, Some(&known));
        assert_eq!(again.reference.battery_v, 11.5);
        assert_eq!(again.effects(), effects);
        assert_eq!(again.term(Effect::MassChange).unwrap().values(), [0.3]);
        // A linear coefficient is solved for, wherever it was.
        assert_eq!(again.term(Effect::Thrust).unwrap().values(), [0.0]);
    }

    /// Less on one axis is worth more on another: what counts is the product over all.
    #[test]
    fn of_several_ends_the_one_that_leaves_least_is_taken() {
        let end = |sigma: [f64; 6]| {
            let covariance = nalgebra::DMatrix::zeros(0, 0);
            Ok(Fit { model: truth(), sigma, covariance, condition: 1.0, is_settled: true })
        };
        let plain = [1.0; 6];
        let better = [0.1, 5.0, 1.0, 1.0, 1.0, 1.0];
        let worse = [0.5, 5.0, 1.0, 1.0, 1.0, 1.0];
        let failed = |effect| Err(FitError::NoRotation { effect });
        let taken = |ends: Vec<Result<Fit, FitError>>| least_left(ends.into_iter()).map(|fit| fit.sigma);
        assert_eq!(taken(vec![end(plain), end(better), end(worse)]), Ok(better));
        assert_eq!(taken(vec![end(worse), failed("a"), end(plain), failed("b")]), Ok(plain));
        assert_eq!(taken(vec![failed("a"), failed("b")]), Err(FitError::NoRotation { effect: "a" }));
        assert_eq!(taken(Vec::new()), Err(FitError::NoFlights));
    }
}
