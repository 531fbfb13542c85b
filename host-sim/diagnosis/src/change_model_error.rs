//! What the errors of a model's own coefficients mean for a change that was fitted on top of it.
//!
//! The model's coefficients stay while a change is fitted, as if they were exact. A wind is a force over a drag: where the drag is known to
//! half its size, so is the wind, however steadily it blows. To first order, the change `b` moves by `G = db/dtheta` with the model's
//! coefficients `theta`, and `G cov(theta) G'` adds to its covariance. `G` comes from fits on models that are moved by a tenth of each
//! standard error. It says nothing against there being a change: without one, the model's own error is in the scatter between its flights.

use model::{Effect, Model};
use nalgebra::{DMatrix, DVector};
use sysid::prepare::Prepared;

use crate::change::Change;
use crate::change_fit::{Fitted, fit_change};
use crate::finding::EffectFinding;

/// By how much of its standard error a coefficient of the model is moved.
const STEP: f64 = 0.1;

/// Widens the standard errors of a change's coefficients by what the errors of the model's own leave of them.
pub(crate) fn widen(model: &Model, change: Change, finding: &mut EffectFinding, flights: &[&Prepared]) {
    let Ok(fitted) = fit_change(model, change, flights) else { return };
    let errors = own_errors(model, change, &fitted, flights);
    for (coefficient, own) in finding.coefficients.iter_mut().zip(&errors) {
        coefficient.std_error = coefficient.std_error.hypot(*own);
    }
}

/// Standard errors of a change by those of the model's coefficients, which act where it does. Those that were fitted together with it are
/// in its errors already.
fn own_errors(model: &Model, change: Change, fitted: &Fitted, flights: &[&Prepared]) -> DVector<f64> {
    let coefficients: Vec<(Effect, usize, f64)> = model
        .terms
        .iter()
        .flat_map(|term| term.coefficients.iter().enumerate().map(|(k, c)| (term.effect, k, c)))
        .map(|(effect, k, c)| (effect, k, c.std_error.unwrap_or(0.0)))
        .collect();
    let axes = change.effect.info().axes;
    let acts = |effect: Effect| effect.info().axes.iter().any(|axis| axes.contains(axis));
    let mut slopes = DMatrix::zeros(fitted.values.len(), coefficients.len());
    for (column, (effect, k, std_error)) in coefficients.into_iter().enumerate() {
        if !(std_error > 0.0) || !acts(effect) || fitted.together.contains(&effect) {
            continue;
        }
        let moved = moved(model, effect, k, STEP * std_error);
        if let Ok(other) = fit_change(&moved, change, flights) {
            slopes.set_column(column, &((other.values - &fitted.values) / (STEP * std_error)));
        }
    }
    let covariance = &slopes * model.covariance() * slopes.transpose();
    covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
}

/// The model with one coefficient moved.
fn moved(model: &Model, effect: Effect, coefficient: usize, by: f64) -> Model {
    let mut moved = model.clone();
    for term in moved.terms.iter_mut().filter(|term| term.effect == effect) {
        term.coefficients[coefficient].value += by;
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::{HEAVIER, WIND};
    use crate::testing::{ORDINARY, prepared, truth};

    /// A force over a drag that is known to a tenth: so is the wind along each axis.
    #[test]
    fn a_wind_is_known_no_better_than_the_drag() {
        let mut windy = truth();
        windy.set(Effect::SteadyWind, &[3.0, 0.0]);
        let flights = prepared(&windy, 1..3, 12.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let mut model = truth();
        let drag = model.terms.iter_mut().find(|term| term.effect == Effect::LinearDrag).unwrap();
        drag.coefficients.iter_mut().for_each(|c| c.std_error = Some(0.1 * c.value.abs()));
        let fitted = fit_change(&model, WIND, &flights).unwrap();
        let errors = own_errors(&model, WIND, &fitted, &flights);
        assert!((errors[0] / 0.3 - 1.0).abs() < 0.4, "{errors}");
        let together = Fitted { together: vec![Effect::LinearDrag], ..fitted };
        assert_eq!(own_errors(&model, WIND, &together, &flights).norm(), 0.0);
    }

    #[test]
    fn a_load_is_weighed_as_well_as_the_thrust_is_known() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        let flights = prepared(&heavy, 1..3, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let mut model = truth();
        let thrust = model.terms.iter_mut().find(|term| term.effect == Effect::Thrust).unwrap();
        thrust.coefficients.iter_mut().for_each(|c| c.std_error = Some(0.02 * c.value));
        let fitted = fit_change(&model, HEAVIER, &flights).unwrap();
        let error = own_errors(&model, HEAVIER, &fitted, &flights)[0];
        let whole_kg = model.vehicle.mass + 0.15;
        assert!((error / (0.02 * whole_kg) - 1.0).abs() < 0.05, "{error}");
    }
}
