//! Where Gauss and Newton's steps start.
//!
//! From zero, mostly. Two kinds of effects need more:
//! - Where a coefficient qualifies another one (a height offset, a voltage shift), the way from zero can end in a side
//!   valley: an ordinary value is a second start.
//! - Where the residual is not convex in a coefficient (the length of a pendulum), or at zero there is no way to
//!   go (a decay length), the effect names starts of its shape ([`model::Effect::starts`]). At each of them the remaining
//!   coefficients follow from one least squares on the axes that the effect acts on; the steps go on from the best.

use model::{Effect, Model};

use crate::FitError;
use crate::fit::{self, Layout, residuals_at, spread, step_scale, targets_less_added};
use crate::prepare::Prepared;
use crate::regress::{self, FlightRows};
use crate::rows::RowColumn;

/// The starts of a fit. `model` has the linear coefficients of a fit without the adjusting effects that are unknown.
pub(crate) fn of(
    flights: &[&Prepared],
    mut model: Model,
    layout: &Layout,
    is_unknown: impl Fn(Effect) -> bool,
) -> Result<Vec<Model>, FitError> {
    let unknown: Vec<Effect> = layout.adjusting.iter().copied().filter(|e| is_unknown(*e)).collect();
    let (searched, ordinary): (Vec<Effect>, Vec<Effect>) =
        unknown.into_iter().partition(|effect| !effect.starts().is_empty());
    for effect in searched {
        search(flights, &mut model, layout, effect)?;
    }
    let second = second(&model, &ordinary);
    Ok(std::iter::once(model).chain(second).collect())
}

/// The model with ordinary values for effects that have a qualifying coefficient.
fn second(model: &Model, unknown: &[Effect]) -> Option<Model> {
    let mut second = model.clone();
    let mut any = false;
    let qualified = |effect: &&Effect| effect.info().coefficients.iter().any(|c| c.prior.is_some());
    for effect in unknown.iter().filter(qualified) {
        let values: Vec<f64> = (0..effect.info().coefficients.len())
            .map(|k| {
                let qualifies = effect.info().coefficients[k].prior.is_some();
                if qualifies { 0.0 } else { step_scale(model.vehicle.has_rotor_map(), *effect, k) }
            })
            .collect();
        second.set(*effect, &values);
        any = true;
    }
    any.then_some(second)
}

/// Sets an effect to the best of its starts.
fn search(
    flights: &[&Prepared],
    model: &mut Model,
    layout: &Layout,
    effect: Effect,
) -> Result<(), FitError> {
    let linear = linear_columns(flights, model, layout, effect);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for start in effect.starts() {
        let values: Vec<f64> = start.iter().map(|value| value.unwrap_or(0.0)).collect();
        model.set(effect, &values);
        let free: Vec<usize> = (0..start.len()).filter(|k| start[*k].is_none()).collect();
        let Some((score, found)) = solve(flights, model, layout, effect, &free, &linear) else { continue };
        if best.as_ref().is_none_or(|(least, _)| score < *least) {
            best = Some((score, found));
        }
    }
    let info = effect.info();
    let Some((_, values)) = best else {
        return Err(FitError::NotExcited {
            effect: info.id,
            coefficient: info.coefficients[0].name,
            excitation: info.excitation,
        });
    };
    model.set(effect, &values);
    Ok(())
}

/// Of a flight: columns of the linear effects that act where an effect does, and all of them.
struct LinearColumns {
    acting: Vec<RowColumn>,
    all: Vec<RowColumn>,
}

fn linear_columns(
    flights: &[&Prepared],
    model: &Model,
    layout: &Layout,
    effect: Effect,
) -> Vec<LinearColumns> {
    let acts = |column: &&RowColumn| effect.info().axes.iter().any(|axis| column[axis.index()].is_some());
    let of = |flight: &&Prepared| {
        let all = flight.columns(&layout.linear, model, flight.fit_stride());
        LinearColumns { acting: all.iter().filter(acts).cloned().collect(), all }
    };
    flights.iter().map(of).collect()
}

/// The `free` coefficients of an effect together with the linear ones, on the axes it acts on, and how much is left. Nothing
/// where they are not determined or not finite.
fn solve(
    flights: &[&Prepared],
    model: &Model,
    layout: &Layout,
    effect: Effect,
    free: &[usize],
    linear: &[LinearColumns],
) -> Option<(f64, Vec<f64>)> {
    let axes = effect.info().axes;
    let rows: Vec<FlightRows> = flights
        .iter()
        .zip(linear)
        .map(|(flight, linear)| {
            let stride = flight.fit_stride();
            let mut targets = targets_less_added(flight, model, &layout.linear, &linear.all, stride);
            let mut columns = linear.acting.clone();
            columns.extend(slopes(flight, model, effect, free, stride));
            for axis in model::AXES.into_iter().filter(|axis| !axes.contains(axis)) {
                targets[axis.index()].fill(0.0);
                columns.iter_mut().for_each(|column| column[axis.index()] = None);
            }
            let period_s = flight.period_s * stride as f64;
            FlightRows { targets, columns, starts: flight.starts_of_rows(stride), period_s }
        })
        .collect();
    let count = rows.first()?.columns.len();
    let solution = regress::solve(&rows, &vec![None; count]).ok()?;
    let score = spread(&solution.sigma);
    let mut values: Vec<f64> = model.term(effect)?.coefficients.iter().map(|c| c.value).collect();
    for (k, step) in free.iter().zip(solution.value.iter().skip(count - free.len())) {
        values[*k] = fit::step_end(values[*k], *step, &effect.info().coefficients[*k]);
    }
    (score.is_finite() && values.iter().all(|v| v.is_finite())).then_some((score, values))
}

/// Minus the derivative of the residual with respect to coefficients that enter linearly.
fn slopes(flight: &Prepared, model: &Model, effect: Effect, free: &[usize], stride: usize) -> Vec<RowColumn> {
    let base: Vec<f64> =
        model.term(effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect();
    let here = residuals_at(flight, model, stride).residual;
    let mut moved = model.clone();
    free.iter()
        .map(|&k| {
            let step = 0.01 * step_scale(model.vehicle.has_rotor_map(), effect, k);
            let mut values = base.clone();
            values[k] += step;
            moved.set(effect, &values);
            let ahead = residuals_at(flight, &moved, stride).residual;
            std::array::from_fn(|axis| {
                let slope: Vec<f64> =
                    here[axis].iter().zip(&ahead[axis]).map(|(h, a)| (h - a) / step).collect();
                slope.iter().any(|d| *d != 0.0).then_some(slope)
            })
        })
        .collect()
}
