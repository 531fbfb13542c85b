//! Output-error refinement: coefficients that predict half a second, not the next sample alone.
//!
//! Least squares on accelerations (equation error) is quick and sure, and biased where the rows' signals are: a rate that
//! an estimator has smoothed, a moment that the controller answers within a few samples. Here the model flies
//! open loop from logged states over [`LONGEST_HORIZON`] samples, and the coefficients are moved until the predicted
//! states meet the logged ones (Gauss and Newton's method with Levenberg and Marquardt's damping, from the
//! least-squares start). Only the moment rows are moved unless asked: forces from an accelerometer are better seen
//! sample by sample than through an integral of them.
//!
//! **Loss.** For position, velocity, attitude (rotation vector) and rate at every `HORIZON_STEP`th horizon the norm of
//! the error over its mean at the start of the descent; so all four quantities weigh the same and so does every horizon. A
//! norm, not its square: it is what `sum_1_50` of a comparison reports, and a stretch in which the model is lost (a
//! collision, a gust) does not decide the fit. Towards zero the norm turns into a square (`ROUNDED`); each step
//! solves the reweighted least squares.
//!
//! **What stays.** Inertia ratios and gyroscopic torque are products of rates, which half a second averages away, and
//! `rotor-inertia` acts within samples: least squares on accelerations sees them better, and so they keep its
//! values. Every coefficient stays within its physically possible range.
//!
//! **Nuisance.** Each training flight has a constant moment of its own (trim, a battery's seat). Estimated along and
//! forgotten, the coefficients come nearer to the craft's; left in, they come nearer to what predicts a flight whose
//! constants nobody knows. Which of the two is better for flights that were not fitted depends on the flights, and is decided by
//! them: half of the training flights are refined either way and the other half is predicted, and the other way round. With
//! fewer than `FEWEST_TO_DECIDE` flights the constants are estimated.
//!
//! **Standard errors.** Errors along a rollout are one error seen fifty times, and the smoother spreads noise from one
//! rollout to the next: the formula for white noise would be far too optimistic. They are the jackknife's over blocks
//! of `BLOCK_S`, longer than both (the sandwich of scores with each block's leverage taken out); over whole flights where
//! their constants are left in.
//!
//! **What is refused.** Coefficients of impossible sign, drag or damping that feeds energy in where it did not before, and
//! anything that does not lower the open-loop error of held-out flights.

use model::{Axis, Effect, Kind, Model, Plant, State};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion, Vector3, Vector4};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::fit::doubts::impossible_signs;
use crate::fit::open_loop::{
    HorizonError, LONGEST_HORIZON, barely_smoothed_states, mean_rotor_speeds, open_loop,
    open_loop_without_trim, sum_of_horizons,
};
use crate::fit::quadratic::{Block, Quadratic, add_at, add_square_at, damped_step, scaled};
use crate::fit::rotation::has_rotation;
use crate::prepare::Prepared;

/// Horizons that enter the loss are multiples of this, samples.
const HORIZON_STEP: usize = 5;
/// Time from one rollout's start to the next, s.
const START_STEP_S: f64 = 0.5;
/// Norms are rounded off below about this part of the quantity's mean.
const ROUNDED: f64 = 0.4;
/// Blocks of time that are taken as independent, s.
const BLOCK_S: f64 = 1.5;
/// Stiffness of the tie between flights' constants, of the curvature of all.
const TIED: f64 = 1e3;
/// Most steps.
const MAX_STEPS: usize = 25;
/// Relative fall of the loss under which the last step was the last.
const CONVERGED: f64 = 1e-5;
/// Training flights from which on they decide whether constants of single flights are estimated along.
const FEWEST_TO_DECIDE: usize = 6;
/// A quantity of held-out flights may grow by this much while the others fall, percent.
const TOLERATED_PERCENT: f64 = 1.0;

/// Which rows' coefficients are moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub enum Rows {
    /// Those that act on p, q and r alone.
    Moments,
    /// Every linear coefficient.
    All,
}

/// What a refinement came to.
#[derive(Debug, Clone)]
pub struct Refinement {
    /// The refined model; the one given when the refinement was refused.
    pub model: Model,
    /// Figures for people and files.
    pub outcome: RefinementOutcome,
}

/// Whether it helped, and by how much on held-out flights.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct RefinementOutcome {
    /// Which coefficients were moved.
    pub rows: Rows,
    /// Whether the refined coefficients were kept.
    pub kept: bool,
    /// Why, one sentence.
    pub reason: String,
    /// Open-loop error of the held-out flights, summed over horizons of 1 to 50 samples, before.
    pub before: HorizonError,
    /// And with the refined coefficients.
    pub after: HorizonError,
    /// Steps taken.
    pub steps: usize,
}

/// Why there is nothing to refine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RefineError {
    /// No coefficient acts on the rows that are to be refined.
    #[error("the model has no coefficient to refine")]
    NothingToRefine,
    /// Half a second without the rotation says nothing.
    #[error("the model has no rotation to predict with: these flights did not determine it")]
    NoRotation,
    /// Too short for a rollout.
    #[error("the training flights have no stretch long enough to predict 50 samples ahead")]
    TooShort,
    /// The loss does not depend on a coefficient.
    #[error("the training flights do not determine the coefficients over half a second")]
    Singular,
}

/// Refines the linear coefficients of `model` on training flights and judges the result on held-out ones.
pub fn refine(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    rows: Rows,
) -> Result<Refinement, RefineError> {
    let (refined, steps) = descend(model, train, rows)?;
    let before = sum_of_horizons(&open_loop(model, validate));
    let after = sum_of_horizons(&open_loop(&refined, validate));
    let (kept, reason) = judge(model, &refined, &before, &after);
    let model = if kept { refined } else { model.clone() };
    Ok(Refinement { model, outcome: RefinementOutcome { rows, kept, reason, before, after, steps } })
}

/// The refined coefficients whatever they are, with standard errors.
pub fn refined(model: &Model, train: &[&Prepared], rows: Rows) -> Result<Model, RefineError> {
    Ok(descend(model, train, rows)?.0)
}

fn descend(model: &Model, train: &[&Prepared], rows: Rows) -> Result<(Model, usize), RefineError> {
    if !has_rotation(model) {
        return Err(RefineError::NoRotation);
    }
    let constants = constants(model, train, rows)?;
    Problem::new(model, train, rows, constants)?.descend()
}

/// What is done about a constant moment (or force) of a single flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Constants {
    /// Estimated along.
    Estimated,
    /// Left in the errors, as in flights that are to be predicted.
    Left,
}

/// Decided by how well each half of the training flights is predicted with coefficients of the other half.
fn constants(model: &Model, train: &[&Prepared], rows: Rows) -> Result<Constants, RefineError> {
    if train.len() < FEWEST_TO_DECIDE {
        return Ok(Constants::Estimated);
    }
    // Every other one: files of one trajectory are often next to each other.
    let half = |odd: usize| -> Vec<&Prepared> { train.iter().skip(odd).step_by(2).copied().collect() };
    let halves = [half(0), half(1)];
    let mut ratio = 0.0;
    for (fitted, judge) in [(&halves[0], &halves[1]), (&halves[1], &halves[0])] {
        let error = |constants| -> Result<HorizonError, RefineError> {
            let (refined, _) = Problem::new(model, fitted, rows, constants)?.descend()?;
            Ok(sum_of_horizons(&open_loop_without_trim(&refined, judge)))
        };
        let (left, estimated) = (error(Constants::Left)?, error(Constants::Estimated)?);
        let quantities: [fn(&HorizonError) -> f64; 4] =
            [|e| e.position_m, |e| e.velocity_m_s, |e| e.attitude_rad, |e| e.rate_rad_s];
        ratio += quantities.iter().map(|of| of(&left) / of(&estimated)).sum::<f64>() / 8.0;
    }
    Ok(if ratio < 1.0 { Constants::Left } else { Constants::Estimated })
}

/// Whether the refined coefficients are possible and better.
fn judge(model: &Model, refined: &Model, before: &HorizonError, after: &HorizonError) -> (bool, String) {
    let known = impossible_signs(model);
    if let Some(doubt) = impossible_signs(refined).into_iter().find(|doubt| !known.contains(doubt)) {
        return (false, format!("refused: {doubt}"));
    }
    if let Some(what) = feeds_energy(model, refined) {
        return (false, format!("refused: {what}"));
    }
    let fall = |name, before: f64, after: f64| (name, 100.0 * (1.0 - after / before));
    let falls = [
        fall("position", before.position_m, after.position_m),
        fall("velocity", before.velocity_m_s, after.velocity_m_s),
        fall("attitude", before.attitude_rad, after.attitude_rad),
        fall("rate", before.rate_rad_s, after.rate_rad_s),
    ];
    let mean = falls.iter().map(|(_, fall)| fall).sum::<f64>() / 4.0;
    let listed: Vec<String> = falls.iter().map(|(name, fall)| format!("{name} {fall:.1} %")).collect();
    let listed = listed.join(", ");
    let worse = falls.iter().any(|(_, fall)| !(*fall > -TOLERATED_PERCENT));
    if worse || !(mean > 0.0) {
        return (false, format!("did not help: the open-loop error of held-out flights falls by {listed}"));
    }
    (true, format!("the open-loop error of held-out flights falls by {listed}"))
}

/// Damping or drag that brakes before and pushes after, as a sentence.
fn feeds_energy(model: &Model, refined: &Model) -> Option<String> {
    refined.terms.iter().filter(|t| t.effect.info().special.brakes).find_map(|term| {
        let was = &model.term(term.effect)?.coefficients;
        let pairs = term.coefficients.iter().zip(was).zip(term.effect.info().coefficients);
        pairs.into_iter().find_map(|((now, was), info)| {
            let slack = 2.0 * now.std_error.unwrap_or(0.0);
            (now.value > slack && was.value <= 0.0)
                .then(|| format!("{} = {:.4} {} would accelerate the craft", info.name, now.value, info.unit))
        })
    })
}

/// A coefficient that is moved.
#[derive(Clone, Copy)]
struct Free {
    effect: Effect,
    index: usize,
}

/// A stretch with what rollouts need.
struct Run<'a> {
    flight: usize,
    states: Vec<State>,
    rotor_mean_rad_s: Vec<[f64; 4]>,
    velocities: Vec<Vector3<f64>>,
    battery_v: &'a [f64],
    period_s: f64,
    starts: Vec<usize>,
    /// Starts in one block of the covariance.
    block: usize,
}

struct Problem<'a> {
    model: Model,
    free: Vec<Free>,
    /// Axes on which each flight has a constant of its own.
    own_axes: std::ops::Range<usize>,
    flights: usize,
    runs: Vec<Run<'a>>,
    /// Mean norm of the error of each quantity at each horizon at the start of the descent.
    scale: Vec<f64>,
    trims: Vec<[f64; 6]>,
}

/// Position, velocity, attitude and rate of one horizon.
const PER_HORIZON: usize = 12;
const HORIZONS: usize = LONGEST_HORIZON / HORIZON_STEP;
const PER_START: usize = PER_HORIZON * HORIZONS;

impl<'a> Problem<'a> {
    fn new(
        model: &Model,
        train: &[&'a Prepared],
        rows: Rows,
        constants: Constants,
    ) -> Result<Self, RefineError> {
        let moment = |axes: &[Axis]| axes.iter().all(|a| a.index() >= 3);
        let free: Vec<Free> = model
            .terms
            .iter()
            .filter(|t| t.effect.info().kind != Kind::Adjusting)
            .filter(|t| rows == Rows::All || moment(t.effect.info().axes))
            .filter(|t| !t.effect.info().special.seen_by_the_sample)
            .flat_map(|t| (0..t.coefficients.len()).map(|index| Free { effect: t.effect, index }))
            .collect();
        if free.is_empty() {
            return Err(RefineError::NothingToRefine);
        }
        let mut runs = Vec::new();
        for (index, flight) in train.iter().enumerate() {
            let step = (START_STEP_S / flight.period_s).round().max(1.0) as usize;
            for stretch in &flight.stretches {
                let last = stretch.time_s.len() - flight.margin;
                let starts: Vec<usize> =
                    (flight.margin..last.saturating_sub(LONGEST_HORIZON)).step_by(step).collect();
                let states = barely_smoothed_states(model, flight, stretch);
                runs.push(Run {
                    flight: index,
                    velocities: states.iter().map(crate::fit::open_loop::velocity_ned_m_s).collect(),
                    states,
                    rotor_mean_rad_s: mean_rotor_speeds(model, flight, stretch),
                    battery_v: &stretch.battery_v,
                    period_s: flight.period_s,
                    starts,
                    block: (BLOCK_S / START_STEP_S).round() as usize,
                });
            }
        }
        runs.retain(|run| !run.starts.is_empty());
        if runs.is_empty() {
            return Err(RefineError::TooShort);
        }
        let own_axes = match (constants, rows) {
            (Constants::Left, _) => 0..0,
            (Constants::Estimated, Rows::All) => 0..6,
            (Constants::Estimated, Rows::Moments) => 3..6,
        };
        let mut problem = Self {
            model: model.clone(),
            free,
            own_axes,
            flights: train.len(),
            runs,
            scale: vec![1.0; 4 * HORIZONS],
            trims: vec![[0.0; 6]; train.len()],
        };
        problem.scale = problem.mean_norms();
        Ok(problem)
    }

    fn values(&self) -> Vec<f64> {
        let value = |f: &Free| self.model.term(f.effect).map_or(0.0, |t| t.coefficients[f.index].value);
        self.free.iter().map(value).collect()
    }

    fn with(&self, values: &[f64]) -> Model {
        let mut model = self.model.clone();
        for (free, value) in self.free.iter().zip(values) {
            for term in model.terms.iter_mut().filter(|t| t.effect == free.effect) {
                term.coefficients[free.index] = model::Estimate { value: *value, std_error: None };
            }
        }
        model
    }

    fn mean_norms(&self) -> Vec<f64> {
        let plant = Plant::new(&self.model);
        let mut sums = vec![0.0; 4 * HORIZONS];
        let mut count = 0.0;
        for run in &self.runs {
            for start in run.errors(&plant, &[0.0; 6]).chunks_exact(PER_START) {
                for (sum, part) in sums.iter_mut().zip(start.chunks_exact(3)) {
                    *sum += norm(part);
                }
                count += 1.0;
            }
        }
        sums.iter().map(|s| if *s > 0.0 && s.is_finite() { s / count } else { 1.0 }).collect()
    }

    fn loss(&self, values: &[f64], trims: &[[f64; 6]]) -> f64 {
        let plant = Plant::new(&self.with(values));
        let losses: Vec<f64> = self
            .runs
            .par_iter()
            .map(|run| {
                let errors = run.errors(&plant, &trims[run.flight]);
                errors.chunks_exact(3).enumerate().map(|(k, part)| self.rounded(k, part)).sum::<f64>()
            })
            .collect();
        losses.iter().sum()
    }

    /// Norm of the `k`-th part of the errors in units of its quantity's mean, rounded off at zero.
    fn rounded(&self, k: usize, part: &[f64]) -> f64 {
        let relative = norm(part) / self.scale[k % (4 * HORIZONS)];
        (relative * relative + ROUNDED * ROUNDED).sqrt() - ROUNDED
    }

    fn parameters(&self) -> usize {
        self.free.len() + self.flights * self.own_axes.len()
    }

    /// Place of a run's own parameters: the coefficients', then its flight's constants'.
    fn places(&self, run: &Run) -> Vec<usize> {
        let own = self.own_axes.len();
        let first = self.free.len() + run.flight * own;
        (0..self.free.len()).chain(first..first + own).collect()
    }

    fn quadratic(&self, values: &[f64], trims: &[[f64; 6]]) -> Quadratic {
        let plant = Plant::new(&self.with(values));
        let plants: Vec<(f64, Plant)> = (0..self.free.len())
            .map(|k| {
                let step = 1e-3 * values[k].abs().max(self.typical(k));
                let mut moved = values.to_vec();
                moved[k] += step;
                (step, Plant::new(&self.with(&moved)))
            })
            .collect();
        let parts: Vec<(f64, Vec<Block>)> = (0..self.runs.len())
            .into_par_iter()
            .map(|run| self.of_run(run, &plant, &plants, &trims[self.runs[run].flight]))
            .collect();
        let count = self.parameters();
        let mut sum = Quadratic {
            loss: 0.0,
            gradient: DVector::zeros(count),
            curvature: DMatrix::zeros(count, count),
            flatter: DMatrix::zeros(count, count),
            blocks: Vec::new(),
        };
        for (loss, blocks) in parts {
            sum.loss += loss;
            for block in &blocks {
                let places = self.places(&self.runs[block.run]);
                add_at(&mut sum.gradient, &block.gradient, &places);
                add_square_at(&mut sum.curvature, &block.curvature, &places, 1.0);
                add_square_at(&mut sum.flatter, &block.flatter, &places, 1.0);
            }
            sum.blocks.extend(blocks);
        }
        self.tie_trims(&mut sum);
        sum
    }

    /// What flights have in common is the craft's: their constants sum to zero.
    fn tie_trims(&self, sum: &mut Quadratic) {
        let own = self.own_axes.len();
        for axis in 0..own {
            let places = || (0..self.flights).map(|flight| self.free.len() + flight * own + axis);
            let stiff = TIED * places().map(|k| sum.curvature[(k, k)]).sum::<f64>();
            for row in places() {
                for column in places() {
                    sum.curvature[(row, column)] += stiff;
                    sum.flatter[(row, column)] += stiff;
                }
            }
        }
    }

    fn typical(&self, k: usize) -> f64 {
        let free = self.free[k];
        free.effect.info().coefficients[free.index].typical
    }

    /// The value, or the nearest that is physically possible.
    fn possible(&self, k: usize, value: f64) -> f64 {
        let free = self.free[k];
        let (low, high) = free.effect.info().coefficients[free.index].possible;
        value.clamp(low, high)
    }

    fn of_run(
        &self,
        index: usize,
        plant: &Plant,
        plants: &[(f64, Plant)],
        trim: &[f64; 6],
    ) -> (f64, Vec<Block>) {
        let run = &self.runs[index];
        let base = run.errors(plant, trim);
        let mut columns: Vec<Vec<f64>> =
            plants.iter().map(|(step, moved)| slopes(&base, run.errors(moved, trim), *step)).collect();
        for axis in self.own_axes.clone() {
            let step = 1e-3;
            let mut moved = *trim;
            moved[axis] += step;
            columns.push(slopes(&base, run.errors(plant, &moved), step));
        }
        let width = columns.len();
        let mut loss = 0.0;
        let mut blocks = Vec::new();
        for block in 0..run.starts.len().div_ceil(run.block) {
            let (from, to) = (block * run.block, ((block + 1) * run.block).min(run.starts.len()));
            let range = from * PER_START..to * PER_START;
            let height = range.len();
            let mut weighted = DMatrix::zeros(height, width);
            let mut errors = DVector::zeros(height);
            let mut along = DMatrix::zeros(height / 3, width);
            for (k, part) in base[range.clone()].chunks_exact(3).enumerate() {
                let scale = self.scale[k % (4 * HORIZONS)];
                let relative = norm(part) / scale;
                loss += self.rounded(k, part);
                // Square root of the weight under which least squares has the loss' gradient.
                let root = 1.0 / (scale * (relative * relative + ROUNDED * ROUNDED).sqrt().sqrt());
                for i in 3 * k..3 * k + 3 {
                    errors[i] = root * base[range.start + i];
                    for (c, column) in columns.iter().enumerate() {
                        weighted[(i, c)] = root * column[range.start + i];
                        along[(k, c)] += root * column[range.start + i] * base[range.start + i];
                    }
                }
                let length = scale * (relative * relative + ROUNDED * ROUNDED).sqrt();
                along.row_mut(k).unscale_mut(length);
            }
            let curvature = weighted.tr_mul(&weighted);
            blocks.push(Block {
                run: index,
                gradient: weighted.tr_mul(&errors),
                flatter: &curvature - along.tr_mul(&along),
                curvature,
            });
        }
        (loss, blocks)
    }

    /// Jackknife over blocks of time, over whole flights where their constants are left in the errors: how far the end of
    /// the descent moves without each of them, squared and summed.
    fn covariance(&self, at: &Quadratic) -> Result<DMatrix<f64>, RefineError> {
        let count = self.parameters();
        let by_flight = self.own_axes.is_empty();
        let same = |a: &Block, b: &Block| by_flight && self.runs[a.run].flight == self.runs[b.run].flight;
        let groups: Vec<&[Block]> = at.blocks.chunk_by(same).collect();
        let mut sum = DMatrix::zeros(count, count);
        for group in &groups {
            let mut without = at.flatter.clone();
            let mut gradient = DVector::zeros(count);
            for block in *group {
                let places = self.places(&self.runs[block.run]);
                add_square_at(&mut without, &block.flatter, &places, -1.0);
                add_at(&mut gradient, &block.gradient, &places);
            }
            let moved = scaled(&without).ok_or(RefineError::Singular)?.solve(&gradient);
            sum.ger(1.0, &moved, &moved, 1.0);
        }
        let count = groups.len().max(1) as f64;
        Ok(sum * ((count - 1.0) / count))
    }

    /// The model at the end of the descent, with standard errors.
    fn descend(&self) -> Result<(Model, usize), RefineError> {
        let mut values = self.values();
        let mut trims = self.trims.clone();
        let mut damping = 1e-3;
        let mut at = self.quadratic(&values, &trims);
        let mut steps = 0;
        while steps < MAX_STEPS {
            steps += 1;
            let step = damped_step(&at, damping).ok_or(RefineError::Singular)?;
            let tried: Vec<f64> = (0..values.len()).map(|k| self.possible(k, values[k] - step[k])).collect();
            let mut tried_trims = trims.clone();
            for (flight, trim) in tried_trims.iter_mut().enumerate() {
                for (i, axis) in self.own_axes.clone().enumerate() {
                    trim[axis] -= step[self.free.len() + flight * self.own_axes.len() + i];
                }
            }
            let loss = self.loss(&tried, &tried_trims);
            if loss.is_finite() && loss < at.loss {
                let fall = 1.0 - loss / at.loss;
                (values, trims) = (tried, tried_trims);
                damping = (0.2 * damping).max(1e-9);
                at = self.quadratic(&values, &trims);
                if fall < CONVERGED {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        let covariance = self.covariance(&at)?;
        let mut model = self.with(&values);
        let first = |effect| -> usize {
            model.terms.iter().take_while(|t| t.effect != effect).map(|t| t.coefficients.len()).sum()
        };
        let places: Vec<usize> = self.free.iter().map(|free| first(free.effect) + free.index).collect();
        let own = covariance.view_range(..places.len(), ..places.len()).into_owned();
        model.set_covariance(&places, &own);
        Ok((model, steps))
    }
}

impl Run<'_> {
    /// Predicted less logged states: for each start and horizon position, velocity, attitude, rate.
    fn errors(&self, plant: &Plant, trim: &[f64; 6]) -> Vec<f64> {
        let track = crate::fit::open_loop::Track {
            states: &self.states,
            rotor_mean_rad_s: &self.rotor_mean_rad_s,
            battery_v: self.battery_v,
            period_s: self.period_s,
            turns: true,
        };
        let mut errors = Vec::with_capacity(self.starts.len() * PER_START);
        for &start in &self.starts {
            track.roll_out(plant, trim, start, LONGEST_HORIZON, |h, state| {
                if h % HORIZON_STEP != 0 {
                    return;
                }
                let logged = &self.states[start + h];
                let velocity = crate::fit::open_loop::velocity_ned_m_s(state) - self.velocities[start + h];
                let parts = [
                    state.position_ned_m - logged.position_ned_m,
                    velocity,
                    turn_between(&logged.attitude, &state.attitude),
                    state.rate_rad_s - logged.rate_rad_s,
                ];
                errors.extend(parts.iter().flat_map(|part| part.iter().copied()));
            });
        }
        errors
    }
}

/// Rotation vector from one attitude (w, x, y, z) to another, rad.
fn turn_between(from: &Vector4<f64>, to: &Vector4<f64>) -> Vector3<f64> {
    let unit = |q: &Vector4<f64>| UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    (unit(from).inverse() * unit(to)).scaled_axis()
}

fn norm(part: &[f64]) -> f64 {
    part.iter().map(|e| e * e).sum::<f64>().sqrt()
}

fn slopes(base: &[f64], mut moved: Vec<f64>, step: f64) -> Vec<f64> {
    moved.iter_mut().zip(base).for_each(|(m, b)| *m = (*m - b) / step);
    moved
}
