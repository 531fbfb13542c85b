//! The rows of a fit about a model, from all its flights.

use model::{Effect, Model};

use crate::fit::least_squares::FlightRows;
use crate::fit::linearise::{About, residuals_at_rows};
use crate::fit::parameters::Layout;
use crate::fit::residuals::Residuals;
use crate::fit::rotation::has_rotation;
use crate::fit::rows::RowColumn;
use crate::fit::swing::Known;
use crate::fit::terms::coefficient_count;
use crate::prepare::Prepared;

/// How far the moments at which commands took effect may lie from the middle of a log's jittering times, in standard deviations of
/// the jitter: a logger that is only ever late is 1 of them off (exponential lateness) to 1.7 (even).
const LATENESS: f64 = 1.4;

/// By what the residual of each flight changes if its commands took effect one such deviation away; nothing where times are even or
/// the clock of measured rotor speeds was found.
pub(crate) fn timing(flights: &[&Prepared], model: &Model) -> Vec<Option<RowColumn>> {
    let of = |flight: &&Prepared| {
        let is_known = flight.has_rotor_speeds() && flight.alignment.is_some();
        (flight.jitter_s > 0.0 && !is_known).then(|| {
            let stride = flight.fit_stride();
            let about = About::new(flight, model, (&[], &[Effect::InputDelay]), stride, &Known::default());
            let mut off: RowColumn = about.columns.into_iter().next().unwrap_or_default();
            let deviation_s = LATENESS * flight.jitter_s;
            off.iter_mut().flatten().flatten().for_each(|value| *value *= deviation_s);
            off
        })
    };
    flights.iter().map(of).collect()
}

/// Rows of the regression about a model: columns of the linear effects, then residual derivatives of the adjusting
/// ones, whose targets are shifted so that the solution gives values for the former and steps for the latter. With the logarithm
/// of the spread of what the model leaves, over all axes, where any effect is adjusting. `begun` is how a load was found to begin in
/// each flight, to go on from.
pub(crate) fn assemble(
    flights: &[&Prepared],
    model: &Model,
    linear: &[Effect],
    adjusting: &[Effect],
    begun: &mut [Known],
) -> (Vec<FlightRows>, f64) {
    let adds = adjusting.iter().any(|effect| effect.info().special.adds_accelerations);
    let mut sums = Squares::default();
    let rows = flights
        .iter()
        .zip(begun)
        .map(|(flight, begun)| {
            let stride = flight.fit_stride();
            let all_targets = || flight.targets(&model.vehicle, &model.adjustments(), stride);
            let (targets, columns) = if adjusting.is_empty() {
                (all_targets(), flight.columns(linear, model, stride, None))
            } else {
                let about = About::new(flight, model, (linear, adjusting), stride, begun);
                let Residuals { residual, .. } = about.residuals;
                sums.add(&residual, model);
                begun.begun = about.begun;
                let targets =
                    if adds { less_added(residual, model, linear, &about.columns) } else { all_targets() };
                (targets, about.columns)
            };
            flight.rows_of_fit(targets, columns)
        })
        .collect();
    (rows, sums.spread())
}

/// Sums of squares of what is left on each axis that the model speaks of.
#[derive(Default)]
struct Squares([f64; 6]);

impl Squares {
    fn add(&mut self, residual: &[Vec<f64>; 6], model: &Model) {
        let axes = if has_rotation(model) { 6 } else { 3 };
        let left = residual[..axes].iter().map(|r| r.iter().map(|e| e * e).sum::<f64>());
        self.0.iter_mut().zip(left).for_each(|(sum, left)| *sum += left);
    }

    /// Logarithm of the spread over all axes.
    fn spread(&self) -> f64 {
        self.0.iter().map(|sum| 0.5 * sum.max(f64::MIN_POSITIVE).ln()).sum()
    }
}

/// Logarithm of the spread of what a model leaves, over all axes.
pub(crate) fn left_by(flights: &[&Prepared], model: &Model) -> f64 {
    let mut sums = Squares::default();
    for flight in flights {
        sums.add(&residuals_at_rows(flight, model, flight.fit_stride()).residual, model);
    }
    sums.spread()
}

/// Rows that were formed about a model near this one: the derivatives of adjusting effects stay, the rest moves with the model. `begun` as
/// in [`assemble`], whose second value this hands over.
pub(crate) fn follow_up(
    rows: &mut [FlightRows],
    flights: &[&Prepared],
    model: &Model,
    layout: &Layout,
    begun: &mut [Known],
) -> f64 {
    let mut sums = Squares::default();
    let count: usize = layout.linear.iter().map(|e| coefficient_count(*e)).sum();
    for ((rows, flight), begun) in rows.iter_mut().zip(flights).zip(begun) {
        let stride = flight.fit_stride();
        if layout.adds() {
            let about = About::new(flight, model, (&[], &[]), stride, begun);
            sums.add(&about.residuals.residual, model);
            begun.begun = about.begun;
            rows.targets = less_added(about.residuals.residual, model, &layout.linear, &rows.columns);
        } else {
            rows.targets = flight.targets(&model.vehicle, &model.adjustments(), stride);
            let columns = flight.columns(&layout.linear, model, stride, None);
            rows.columns.splice(..count, columns);
            sums.add(&added(rows.targets.clone(), model, &layout.linear, &rows.columns, -1.0), model);
        }
    }
    sums.spread()
}

/// The targets less what effects add that have no columns: the residual plus what the linear effects predict.
pub(crate) fn less_added(
    residual: [Vec<f64>; 6],
    model: &Model,
    linear: &[Effect],
    columns: &[RowColumn],
) -> [Vec<f64>; 6] {
    added(residual, model, linear, columns, 1.0)
}

/// Signals plus a number of times what the linear effects predict.
fn added(
    signals: [Vec<f64>; 6],
    model: &Model,
    linear: &[Effect],
    columns: &[RowColumn],
    times: f64,
) -> [Vec<f64>; 6] {
    let mut targets = signals;
    let values = linear.iter().flat_map(|e| model.term(*e)).flat_map(|t| &t.coefficients).map(|c| c.value);
    for (value, column) in values.zip(columns) {
        for (target, column) in targets.iter_mut().zip(column) {
            let Some(column) = column else { continue };
            target.iter_mut().zip(column).for_each(|(t, c)| *t += times * value * c);
        }
    }
    targets
}
