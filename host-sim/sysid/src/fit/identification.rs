//! Identification: a model structure fitted to flights, and what it predicts.
//!
//! Linear coefficients come from one least squares. Coefficients of adjusting effects (wind, lever, ground effect ...)
//! enter through the residual's derivative with respect to them, next to the linear columns, and the step is repeated
//! until it is small against its own standard error: Gauss and Newton's method on the same stacked problem, so
//! every coefficient gets a standard error of the same kind.
//!
//! Where they start decides where they end, for some: `starts.rs`.

use model::{Axis, AxisError, Effect, Estimate, Kind, Model, PerAxis, Term, Vehicle};

use crate::fit::jackknife;
use crate::fit::least_squares::{self, FlightRows, Prior, Unidentifiable};
use crate::fit::linearise::{About, residuals_at_rows, step_scale};
use crate::fit::rows::{RowColumn, coefficient_count};
use crate::fit::slung_load::{self, Known};
use crate::fit::starts::{self, Demand};
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

/// Why a fit was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No flight to fit on.
    #[error("no flights to fit on")]
    NoFlights,
    /// A coefficient that the flights never excited.
    #[error("the flights do not excite {coefficient} of {effect}: {excitation}")]
    NotExcited {
        /// The effect.
        effect: &'static str,
        /// The coefficient.
        coefficient: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
    /// Coefficients that the flights cannot tell apart.
    #[error("the flights cannot tell apart {}; fly so that they move separately", coefficients.join(", "))]
    Collinear {
        /// "effect coefficient" of each.
        coefficients: Vec<String>,
    },
    /// A user's formula without a finite value at a sample that was not left out beforehand.
    #[error(
        "{flight}: the model has no finite prediction: a formula of {effect} takes a root, a logarithm or a quotient of what they do not exist for"
    )]
    NotFinite {
        /// The flight.
        flight: String,
        /// Users' effects in the model.
        effect: String,
    },
    /// A moment without the rotors' moments.
    #[error(
        "{effect} acts on the rotation alone, which this model does not have: these flights did not determine it \
         (see `rotation_refused` in the model file)"
    )]
    NoRotation {
        /// The effect.
        effect: &'static str,
    },
    /// An effect of which no shape explains anything.
    #[error("no possible {effect} of any shape lowers the error of these flights; to see one: {excitation}")]
    ExplainsNothing {
        /// The effect.
        effect: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
    /// The iteration for an adjusting effect ran away.
    #[error(
        "the fit of {effect} does not settle, these flights do not determine it; to see it: {excitation}"
    )]
    NotConverged {
        /// The effect.
        effect: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
}

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

/// Residuals (measured minus predicted) of one flight over its rows.
#[derive(Debug, Clone, Default)]
pub struct Residuals {
    /// Measured, for each axis.
    pub measured: [Vec<f64>; 6],
    /// Measured minus predicted, for each axis.
    pub residual: [Vec<f64>; 6],
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

/// Whether an effect has rows of p, q and r and no others.
pub fn acts_on_rotation_alone(effect: Effect) -> bool {
    effect.info().axes.iter().all(|axis| axis.index() >= 3)
}

/// Whether a model says anything about the rotation: one whose rotor moments were refused has force rows alone.
pub fn has_rotation(model: &Model) -> bool {
    model.has(Effect::RotorMoments)
}

/// Effects without those of the rotation.
pub fn without_rotation(effects: &[Effect]) -> Vec<Effect> {
    effects.iter().copied().filter(|e| !acts_on_rotation_alone(*e)).collect()
}

/// Logarithm of the residuals' standard deviations over all axes: the likelihood, but for sign and scale.
pub fn spread(sigma: &[f64; 6]) -> f64 {
    sigma.iter().map(|s| s.ln()).sum()
}

/// The effects of a fit, in the order of its parameters.
pub struct Layout {
    /// Effects that are linear in their coefficients.
    pub linear: Vec<Effect>,
    /// Effects that change what the others see.
    pub adjusting: Vec<Effect>,
    order: Vec<Effect>,
    /// Whether a search gave a load's first values.
    is_searched: bool,
}

impl Layout {
    /// Whether any effect adds accelerations that no column shows.
    fn adds(&self) -> bool {
        self.adjusting.iter().any(|effect| effect.info().special.adds_accelerations)
    }
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
                let blocks = |flight: &&Prepared| slung_load::blocks(flight, &carried, flight.fit_stride());
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

fn not_converged(adjusting: &[Effect]) -> FitError {
    FitError::NotConverged { effect: adjusting[0].id(), excitation: adjusting[0].info().excitation }
}

/// How far the moments at which commands took effect may lie from the middle of a log's jittering times, in standard deviations of
/// the jitter: a logger that is only ever late is 1 of them off (exponential lateness) to 1.7 (even).
const LATENESS: f64 = 1.4;

/// By what the residual of each flight changes if its commands took effect one such deviation away; nothing where times are even or
/// the clock of measured rotor speeds was found.
fn timing(flights: &[&Prepared], model: &Model) -> Vec<Option<RowColumn>> {
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

/// Halves a step that makes things worse: far from the end, a residual that is not convex may do so.
fn halve(before: &Model, model: &mut Model) {
    for term in &mut model.terms {
        let Some(old) = before.term(term.effect) else { continue };
        for (new, old) in term.coefficients.iter_mut().zip(&old.coefficients) {
            new.value = 0.5 * (new.value + old.value);
        }
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
fn is_bound(info: &model::Coefficient) -> bool {
    info.possible.0 == 0.0 && info.prior.is_some()
}

/// A length or another scale that ended where the possible ends was not found but ran away.
pub fn check_scales(model: &Model, adjusting: &[Effect]) -> Result<(), FitError> {
    let ran_away = |effect: &&Effect| {
        let values = model.term(**effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value);
        values.zip(effect.info().coefficients).any(|(value, c)| {
            let (low, high) = c.possible;
            c.prior.is_some() && low > 0.0 && (value <= low || value >= high)
        })
    };
    match adjusting.iter().find(ran_away) {
        None => Ok(()),
        Some(effect) => {
            Err(FitError::NotConverged { effect: effect.id(), excitation: effect.info().excitation })
        }
    }
}

/// A formula of a user may have no value at a state that nobody thought of.
fn check_finite(flights: &[&Prepared], rows: &[FlightRows], model: &Model) -> Result<(), FitError> {
    let finite = |rows: &FlightRows| {
        rows.columns.iter().flatten().flatten().chain(&rows.targets).flatten().all(|value| value.is_finite())
    };
    blame_users(model, flights.iter().zip(rows).find(|(_, rows)| !finite(rows)).map(|(flight, _)| *flight))
}

/// The same for residuals of flights.
pub fn check_residuals(
    flights: &[&Prepared],
    residuals: &[Residuals],
    model: &Model,
) -> Result<(), FitError> {
    let finite = |r: &Residuals| r.residual.iter().flatten().all(|value| value.is_finite());
    blame_users(model, flights.iter().zip(residuals).find(|(_, r)| !finite(r)).map(|(flight, _)| *flight))
}

fn blame_users(model: &Model, not_finite: Option<&Prepared>) -> Result<(), FitError> {
    let users: Vec<&str> =
        model.effects().iter().filter(|e| matches!(e, Effect::User(_))).map(|e| e.id()).collect();
    match not_finite {
        Some(flight) if !users.is_empty() => {
            Err(FitError::NotFinite { flight: flight.name.clone(), effect: users.join(", ") })
        }
        _ => Ok(()),
    }
}

/// What is known of the next step of an adjusting effect's coefficients: it leads back to zero.
pub fn priors_of(model: &Model, effect: Effect) -> impl Iterator<Item = Option<Prior>> {
    let values: Vec<f64> =
        model.term(effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect();
    let known = effect.info().coefficients.iter().zip(values);
    known.map(|(c, now)| c.prior.map(|deviation| Prior { expected: -now, deviation }))
}

/// Writes values of `effects` in order into the model, without errors.
pub fn store(model: &mut Model, effects: &[Effect], values: &[f64]) {
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

fn unidentifiable(why: Unidentifiable, order: &[Effect]) -> FitError {
    let find = |parameter: usize| {
        let mut left = parameter;
        for effect in order {
            let info = effect.info();
            if left < info.coefficients.len() {
                return (info, info.coefficients[left].name);
            }
            left -= info.coefficients.len();
        }
        unreachable!("a parameter beyond the last coefficient")
    };
    match why {
        Unidentifiable::NotExcited(k) => {
            let (info, coefficient) = find(k);
            FitError::NotExcited { effect: info.id, coefficient, excitation: info.excitation }
        }
        Unidentifiable::Collinear(all) => {
            let coefficients = all.into_iter().map(|k| {
                let (info, name) = find(k);
                format!("{name} of {}", info.id)
            });
            FitError::Collinear { coefficients: coefficients.collect() }
        }
    }
}

/// Rows of the regression about a model: columns of the linear effects, then residual derivatives of the adjusting
/// ones, whose targets are shifted so that the solution gives values for the former and steps for the latter. With the logarithm
/// of the spread of what the model leaves, over all axes, where any effect is adjusting. `begun` is how a load was found to begin in
/// each flight, to go on from.
fn assemble(
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
            FlightRows {
                targets,
                columns,
                starts: flight.starts_of_rows(stride),
                period_s: flight.period_s * stride as f64,
            }
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
fn left_by(flights: &[&Prepared], model: &Model) -> f64 {
    let mut sums = Squares::default();
    for flight in flights {
        sums.add(&residuals_at_rows(flight, model, flight.fit_stride()).residual, model);
    }
    sums.spread()
}

/// Rows that were formed about a model near this one: the derivatives of adjusting effects stay, the rest moves with the model. `begun` as
/// in [`assemble`], whose second value this hands over.
fn follow_up(
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
pub fn less_added(
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

/// Coefficients of the basic model whose sign contradicts the craft's geometry or physics by more than their error, each as
/// a sentence. A fit with a motor that pushes the wrong way can predict well and is no model: it holds rates and damps
/// them.
pub fn impossible_signs(model: &Model) -> Vec<String> {
    doubts(model).into_iter().map(|(_, doubt)| doubt).collect()
}

/// Whether thrust points up. A term that makes it negative is no effect but a polynomial that happens to fit.
pub fn lifts(model: &Model) -> bool {
    doubts(model).iter().all(|(effect, _)| *effect != Effect::Thrust)
}

/// A model whose rotation explains less than this of every moment row knows nothing of it.
const LEAST_ROTATION_R2: f64 = 0.1;

/// Why the rotation is not identifiable from the flights a model was fitted to: rotors that push the wrong way, or moment
/// rows of which nothing is explained. Empty where it is.
pub fn rotation_doubts(model: &Model, flights: &[&Prepared]) -> Vec<String> {
    let motors = |(effect, doubt): (Effect, String)| (effect == Effect::RotorMoments).then_some(doubt);
    let mut found: Vec<String> = doubts(model).into_iter().filter_map(motors).collect();
    let all: Vec<Residuals> = flights.iter().map(|f| residuals_at_rows(f, model, f.fit_stride())).collect();
    let fitted = errors(&all);
    let largest =
        [Axis::P, Axis::Q, Axis::R].map(|axis| fitted[axis].r2).into_iter().fold(f64::MIN, f64::max);
    if largest < LEAST_ROTATION_R2 {
        found.push(format!(
            "motor commands explain {:.0} % of the angular accelerations at best: clocks that wander within flights, or \
             too little excitation",
            100.0 * largest.max(0.0)
        ));
    }
    found
}

fn doubts(model: &Model) -> Vec<(Effect, String)> {
    let spin = model.vehicle.motors.spin.map(|s| s.yaw_sign());
    let mut found = Vec::new();
    for term in model.terms.iter().filter(|t| t.effect.info().kind == Kind::Basic) {
        for (estimate, info) in term.coefficients.iter().zip(term.effect.info().coefficients) {
            let Some(expected) = info.expected_sign(&spin) else { continue };
            let slack = 2.0 * estimate.std_error.unwrap_or(0.0);
            if estimate.value * expected < -slack {
                let should = if expected > 0.0 { "positive" } else { "negative" };
                found.push((term.effect, format!(
                    "{} = {:.4} +- {:.4} {} must be {should}: rotor order or spin in the vehicle file, a clock offset \
                     between commands and motion, or too little excitation",
                    info.name,
                    estimate.value,
                    0.5 * slack,
                    info.unit
                )));
            }
        }
    }
    found
}

/// Errors of each axis over several flights.
pub fn errors<'a>(all: impl IntoIterator<Item = &'a Residuals>) -> PerAxis<AxisError> {
    let mut sums = PerAxis::<(f64, f64, f64, u64)>::default();
    for one in all {
        for axis in model::AXES {
            let sum = &mut sums[axis];
            for (e, y) in one.residual[axis.index()].iter().zip(&one.measured[axis.index()]) {
                sum.0 += e * e;
                sum.1 += y;
                sum.2 += y * y;
                sum.3 += 1;
            }
        }
    }
    PerAxis::from_fn(|axis| {
        let (sse, total, squares, samples) = sums[axis];
        let n = samples.max(1) as f64;
        let about_mean = squares - total * total / n;
        AxisError {
            sse,
            rms: (sse / n).sqrt(),
            r2: if about_mean > 0.0 { 1.0 - sse / about_mean } else { 0.0 },
            samples,
        }
    })
}
