//! Identification: a model structure fitted to flights, and what it predicts.
//!
//! Linear coefficients come from one least squares. Coefficients of adjusting effects (wind, lever, ground effect ...)
//! enter through the residual's derivative with respect to them, next to the linear columns, and the step is repeated
//! until it is small against its own standard error: Gauss and Newton's method on the same stacked problem, so
//! every coefficient gets a standard error of the same kind.
//!
//! Where they start decides where they end, for some: `starts.rs`.

use model::{Effect, Kind, Model, Vehicle};

use crate::fit::assembly::{assemble, follow_up, left_by, timing};
use crate::fit::error::{FitError, check_finite, check_scales, not_converged, unidentifiable};
use crate::fit::jackknife;
use crate::fit::least_squares::{self, FlightRows};
use crate::fit::linearise::step_scale;
use crate::fit::parameters::{Layout, is_bound, priors_of, step_end, store};
use crate::fit::pieces;
use crate::fit::residuals::spread;
use crate::fit::rotation::acts_on_rotation_alone;
use crate::fit::rows::coefficient_count;
use crate::fit::slung_load;
use crate::fit::starts::{self, Demand};
use crate::fit::swing::Known;
use crate::prepare::Prepared;

/// Most Gauss-Newton steps; bilinear problems such as wind and drag take three or four.
const MAX_STEPS: usize = 12;
/// Where effects add accelerations, the steps crawl at the end (a swing's beginning is taken out between them): done when
/// the logarithms of the residuals' spreads together change by less than this.
const NO_FURTHER: f64 = 0.003;
/// They may rise by this in a step without it being a wrong one.
const WORSE: f64 = 0.2;
/// First steps of a load that was searched for and leaves more than none: a length that is off by a few percent is out of step with a swing
/// that is carried on from piece to piece, and would be led astray.
const ROUGH_STEPS: usize = 3;
/// Most halvings of a wrong step where effects add accelerations; else one, for where it does not help the next start is cheaper.
const HALVINGS: usize = 4;
/// A step this small against the standard error of white residuals, which is the smaller one, is the last: each step leaves
/// a tenth of the one before it or less.
const CONVERGED: f64 = 0.1;

/// A step of less than this part of every coefficient (or of its ordinary magnitude) leaves the columns nearly as they are: the next one
/// takes them over, and only what is left is formed anew. The step after that is off by such a part of itself.
const SMALL: f64 = 0.03;

/// A fitted model with what its errors are judged by.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model: vehicle, effects, coefficients with standard errors. Fit record and history are the caller's.
    pub model: Model,
    /// Standard deviation of the training residual of each axis.
    pub sigma: [f64; 6],
    /// Covariance of all coefficients in the model's order.
    pub covariance: nalgebra::DMatrix<f64>,
    /// Condition number of the column-scaled problem.
    pub condition: f64,
}

/// Fits `effects` to `flights`. `start` gives first values of adjusting coefficients, where it has them.
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
    let mut model = Model::new(vehicle.clone());
    model.reference.battery_v = match start {
        Some(start) => start.reference.battery_v,
        None => {
            let rows: f64 = flights.iter().map(|f| f.rows() as f64).sum();
            flights.iter().map(|f| f.mean_battery_v() * f.rows() as f64).sum::<f64>() / rows
        }
    };
    for &effect in effects {
        let zeros = vec![0.0; effect.info().coefficients.len()];
        model.set(effect, &zeros);
        if let (Kind::Adjusting, Some(known)) = (effect.info().kind, start.and_then(|m| m.term(effect))) {
            let values: Vec<f64> = known.coefficients.iter().map(|c| c.value).collect();
            model.set(effect, &values);
        }
    }
    let adjusting: Vec<Effect> =
        effects.iter().copied().filter(|e| e.info().kind == Kind::Adjusting).collect();
    let linear: Vec<Effect> = effects.iter().copied().filter(|e| e.info().kind != Kind::Adjusting).collect();
    let order: Vec<Effect> = linear.iter().chain(&adjusting).copied().collect();

    let rows = assemble(flights, &model, &linear, &[], &mut vec![Known::default(); flights.len()]).0;
    check_finite(flights, &rows, &model)?;
    let count: usize = linear.iter().map(|e| coefficient_count(*e)).sum();
    let priors = vec![None; count];
    let solution =
        least_squares::solve_without_errors(&rows, &priors).map_err(|why| unidentifiable(why, &linear))?;
    store(&mut model, &linear, solution.value.as_slice());
    if adjusting.is_empty() {
        let solution = least_squares::with_errors_beside(solution, &rows, &priors, &timing(flights, &model));
        return Ok(finish(model, &linear, solution));
    }
    let is_unknown = |effect: Effect| start.is_none_or(|m| !m.has(effect));
    let is_searched = adjusting.iter().any(|effect| effect.info().special.hangs_load && is_unknown(*effect));
    let layout = Layout { linear, adjusting, order, is_searched };
    let starts = starts::of(flights, model, &layout, is_unknown, demand)?;
    let only = (starts.len() == 1).then(|| starts[0].clone());
    let ends = starts.into_iter().map(|start| settle(flights, start, &layout));
    let best = ends.reduce(|best, end| match (best, end) {
        (Ok(a), Ok(b)) => Ok(if spread(&b.sigma) < spread(&a.sigma) { b } else { a }),
        (Ok(fit), Err(_)) | (Err(_), Ok(fit)) => Ok(fit),
        (Err(why), Err(_)) => Err(why),
    });
    let best = best.unwrap_or(Err(FitError::NoFlights));
    let Some(only) = only else { return best };
    // The first step from zero can end where an effect saturates (a lag of nothing): set out from either side as well.
    let from = |side: f64| {
        let other = ordinary(&only, &layout.adjusting, start, side);
        if other == only { Err(not_converged(&layout.adjusting)) } else { settle(flights, other, &layout) }
    };
    best.or_else(|why| from(1.0).or_else(|_| from(-1.0)).map_err(|_| why))
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

/// Gauss and Newton's steps from where `model` stands.
fn settle(flights: &[&Prepared], mut model: Model, layout: &Layout) -> Result<Fit, FitError> {
    let Layout { linear, adjusting, order, .. } = layout;
    let count: usize = linear.iter().map(|e| coefficient_count(*e)).sum();
    let adds = layout.adds();
    // Where the last step came from, and what was left there.
    let mut last: Option<(Model, f64)> = None;
    let is_astray = || left_by(flights, &model) > left_by(flights, &slung_load::without_load(&model));
    let rough_steps = if layout.is_searched && is_astray() { ROUGH_STEPS } else { 0 };
    let mut begun = vec![Known { begun: Vec::new(), is_rough: rough_steps > 0 }; flights.len()];
    let (most_steps, most_halvings) =
        if adds { (MAX_STEPS + MAX_STEPS / 2, HALVINGS) } else { (MAX_STEPS, 1) };
    let mut halvings = 0;
    let mut kept: Option<Vec<FlightRows>> = None;
    for number in 0..rough_steps + most_steps {
        if number == rough_steps {
            begun.fill(Known::default());
            (kept, last) = (None, None);
        }
        let is_full = kept.is_none();
        let (rows, left) = match kept.take() {
            None => assemble(flights, &model, linear, adjusting, &mut begun),
            Some(mut rows) => {
                let left = follow_up(&mut rows, flights, &model, layout, &mut begun);
                (rows, left)
            }
        };
        check_finite(flights, &rows, &model)?;
        let left_before = last.as_ref().map(|(_, left)| *left);
        if let Some((before, left_before)) = &last
            && left > left_before + WORSE
            && halvings < most_halvings
        {
            halvings += 1;
            halve(before, &mut model);
            continue;
        }
        halvings = 0;
        let mut priors = vec![None; count];
        priors.extend(adjusting.iter().flat_map(|effect| priors_of(&model, *effect)));
        let solution =
            least_squares::solve_without_errors(&rows, &priors).map_err(|why| unidentifiable(why, order))?;
        // The linear part comes out as values, the adjusting part as steps from where the columns were formed.
        let mut values = solution.value.clone();
        let mut settled = true;
        let mut is_small = is_full;
        let mut at = count;
        for effect in adjusting {
            let known: Vec<f64> =
                model.term(*effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect();
            for (k, (now, info)) in known.iter().zip(effect.info().coefficients).enumerate() {
                let step = solution.value[at];
                let ordinary = step_scale(model.vehicle.has_rotor_map(), *effect, k);
                values[at] = step_end(*now, step, info);
                // At a bound that no step crosses, there is no further.
                let is_held = values[at] == *now && is_bound(info);
                settled &= is_held
                    || step.abs() < CONVERGED * solution.covariance[(at, at)].sqrt() + 1e-9 * ordinary;
                is_small &= step.abs() < SMALL * now.abs().max(ordinary);
                at += 1;
            }
        }
        settled |= adds && left_before.is_some_and(|before| (before - left).abs() < NO_FURTHER);
        let before = model.clone();
        store(&mut model, order, values.as_slice());
        last = Some((before, left));
        if settled && number >= rough_steps {
            check_scales(&model, adjusting)?;
            let surplus = slung_load::of_model(&model).map(|carried| {
                let blocks = |flight: &&Prepared| pieces::blocks(flight, &carried, flight.fit_stride());
                let blocks: Vec<_> = flights.iter().map(blocks).collect();
                jackknife::of_blocks(&rows, &blocks, &solution)
            });
            let mut solution =
                least_squares::with_errors_beside(solution, &rows, &priors, &timing(flights, &model));
            if let Some(surplus) = surplus {
                solution.covariance += surplus;
            }
            return Ok(finish(model, order, least_squares::Solution { value: values, ..solution }));
        }
        kept = is_small.then_some(rows);
    }
    Err(not_converged(adjusting))
}

/// Halves a step that makes things worse: far from the end, a residual that is not convex may do so.
fn halve(before: &Model, model: &mut Model) {
    for term in &mut model.terms {
        let Some(old) = before.term(term.effect) else { continue };
        for (new, old) in term.coefficients.iter_mut().zip(&old.coefficients) {
            new.value = 0.5 * (new.value + old.value);
        }
    }
}

fn finish(mut model: Model, order: &[Effect], solution: least_squares::Solution) -> Fit {
    store(&mut model, order, solution.value.as_slice());
    let covariance = in_model_order(&model, order, &solution.covariance);
    let all: Vec<usize> = (0..covariance.nrows()).collect();
    model.set_covariance(&all, &covariance);
    Fit { model, sigma: solution.sigma, covariance, condition: solution.condition }
}

/// The covariance with rows and columns in the order of the model's terms.
fn in_model_order(
    model: &Model,
    order: &[Effect],
    covariance: &nalgebra::DMatrix<f64>,
) -> nalgebra::DMatrix<f64> {
    let first = |effect: Effect| -> usize {
        order.iter().take_while(|e| **e != effect).map(|e| e.info().coefficients.len()).sum()
    };
    let index: Vec<usize> = model
        .terms
        .iter()
        .flat_map(|t| (0..t.coefficients.len()).map(move |k| first(t.effect) + k))
        .collect();
    nalgebra::DMatrix::from_fn(index.len(), index.len(), |r, c| covariance[(index[r], index[c])])
}
