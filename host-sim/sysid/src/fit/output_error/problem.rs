//! The refinement as a minimisation: which coefficients and constants are free, the loss, and its
//! reweighted quadratic approximation.

use model::{Axis, Effect, Kind, Model, Plant};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::error::RefineError;
use super::rollouts::{HORIZONS, PER_START, Run, norm, slopes};
use crate::fit::open_loop::{LONGEST_HORIZON, barely_smoothed_states, mean_rotor_speeds, velocity_ned_m_s};
use crate::fit::quadratic::{Block, Quadratic, add_at, add_square_at};
use crate::prepare::Prepared;

/// Time from one rollout's start to the next, s.
const START_STEP_S: f64 = 0.5;
/// Norms are rounded off below about this part of the quantity's mean.
const ROUNDED: f64 = 0.4;
/// Blocks of time that are taken as independent, s.
const BLOCK_S: f64 = 1.5;
/// Stiffness of the tie between flights' constants, of the curvature of all.
const TIED: f64 = 1e3;

/// Which rows' coefficients are moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub enum Rows {
    /// Those that act on p, q and r alone.
    Moments,
    /// Every linear coefficient.
    All,
}

/// What is done about a constant moment (or force) of a single flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Constants {
    /// Estimated along.
    Estimated,
    /// Left in the errors, as in flights that are to be predicted.
    Left,
}

/// A coefficient that is moved.
#[derive(Clone, Copy)]
pub(super) struct Free {
    pub(super) effect: Effect,
    pub(super) index: usize,
}

pub(super) struct Problem<'a> {
    pub(super) model: Model,
    pub(super) free: Vec<Free>,
    /// Axes on which each flight has a constant of its own.
    pub(super) own_axes: std::ops::Range<usize>,
    pub(super) flights: usize,
    pub(super) runs: Vec<Run<'a>>,
    /// Mean norm of the error of each quantity at each horizon at the start of the descent.
    pub(super) scale: Vec<f64>,
    pub(super) trims: Vec<[f64; 6]>,
}

impl<'a> Problem<'a> {
    pub(super) fn new(
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
                    velocities: states.iter().map(velocity_ned_m_s).collect(),
                    states,
                    rotor_mean_rad_s: mean_rotor_speeds(model, flight, stretch),
                    stretch,
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

    pub(super) fn values(&self) -> Vec<f64> {
        let value = |f: &Free| self.model.term(f.effect).map_or(0.0, |t| t.coefficients[f.index].value);
        self.free.iter().map(value).collect()
    }

    pub(super) fn with(&self, values: &[f64]) -> Model {
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

    pub(super) fn loss(&self, values: &[f64], trims: &[[f64; 6]]) -> f64 {
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

    pub(super) fn parameters(&self) -> usize {
        self.free.len() + self.flights * self.own_axes.len()
    }

    /// Place of a run's own parameters: the coefficients', then its flight's constants'.
    pub(super) fn places(&self, run: &Run) -> Vec<usize> {
        let own = self.own_axes.len();
        let first = self.free.len() + run.flight * own;
        (0..self.free.len()).chain(first..first + own).collect()
    }

    pub(super) fn quadratic(&self, values: &[f64], trims: &[[f64; 6]]) -> Quadratic {
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
    pub(super) fn possible(&self, k: usize, value: f64) -> f64 {
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
}
