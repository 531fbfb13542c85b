//! Columns of effects about a model, as a regression on a flight sees them.

use model::{Effect, Kind, Model};
use sysid::fit::least_squares::FlightRows;
use sysid::fit::linearise::About;
use sysid::fit::rows::RowColumn;
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
