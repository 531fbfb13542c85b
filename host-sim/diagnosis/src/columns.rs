//! Columns of effects about a model, as a regression on a flight sees them.

use model::{Effect, Kind, Model};
use sysid::fit::least_squares::FlightRows;
use sysid::fit::least_squares::RowColumn;
use sysid::fit::linearise::About;
use sysid::fit::swing::Known;
use sysid::fit::terms::coefficient_count;
use sysid::prepare::Prepared;

/// Columns of effects about a model, over the residual as target, at the rows of a fit: those of linear effects, and for
/// adjusting ones minus the residual's derivative.
pub(crate) fn rows_about(flight: &Prepared, model: &Model, effects: &[Effect]) -> FlightRows {
    let stride = flight.fit_stride();
    let is_adjusting = |e: &Effect| e.info().kind == Kind::Adjusting;
    let (adjusting, linear): (Vec<Effect>, Vec<Effect>) = effects.iter().copied().partition(is_adjusting);
    let mut about = About::new(flight, model, (&linear, &adjusting), stride, &Known::default());
    // Each to its place.
    let mut derivatives =
        about.columns.split_off(linear.iter().map(|e| coefficient_count(*e)).sum()).into_iter();
    let mut formed = about.columns.into_iter();
    let columns: Vec<RowColumn> = effects
        .iter()
        .flat_map(|effect| match is_adjusting(effect) {
            true => derivatives.by_ref().take(effect.info().coefficients.len()).collect::<Vec<_>>(),
            false => formed.by_ref().take(coefficient_count(*effect)).collect(),
        })
        .collect();
    flight.rows_of_fit(about.residuals.residual, columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, prepared, truth};

    #[test]
    fn columns_come_in_the_order_of_the_effects_whatever_their_kind() {
        let model = truth();
        let flight = prepared(&model, 1..2, 4.0, &NONE).remove(0);
        let effects = [Effect::MassChange, Effect::QuadraticDrag, Effect::SteadyWind, Effect::Tether];
        let all = rows_about(&flight, &model, &effects);
        let mut columns = all.columns.into_iter();
        for effect in effects {
            let alone = rows_about(&flight, &model, &[effect]);
            assert_eq!(alone.columns.len(), effect.info().coefficients.len(), "{effect}");
            for column in alone.columns {
                assert!(columns.next().unwrap() == column, "{effect}");
            }
            assert_eq!(alone.targets, all.targets);
        }
        assert!(columns.next().is_none());
    }

    #[test]
    fn the_target_is_what_the_model_leaves_and_the_rows_are_those_of_a_fit() {
        let model = truth();
        let flight = prepared(&model, 1..2, 4.0, &NONE).remove(0);
        let rows = rows_about(&flight, &model, &[]);
        assert!(rows.columns.is_empty());
        let left = sysid::fit::linearise::residuals_at_rows(&flight, &model, 3);
        assert_eq!(rows.targets, left.residual);
        assert!((rows.period_s - 0.03).abs() < 1e-12);
        assert_eq!(rows.starts, [0]);
    }
}
