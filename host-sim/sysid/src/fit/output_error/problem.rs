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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, prepared, truth};

    fn moved(problem: &Problem) -> Vec<Effect> {
        let mut effects: Vec<Effect> = problem.free.iter().map(|free| free.effect).collect();
        effects.dedup();
        effects
    }

    #[test]
    fn moments_are_moved_alone_unless_all_are_and_never_what_half_a_second_averages_away() {
        let flight = prepared(400, |_, _| {});
        let new = |model: &Model, rows| Problem::new(model, &[&flight], rows, Constants::Estimated);
        let moments = new(&truth(), Rows::Moments).unwrap();
        assert_eq!(moved(&moments), [Effect::RotorMoments, Effect::AngularDamping]);
        assert_eq!((moments.own_axes.clone(), moments.parameters()), (3..6, 12 + 3 + 3));
        let all = new(&truth(), Rows::All).unwrap();
        let [thrust, drag] = [Effect::Thrust, Effect::LinearDrag];
        assert_eq!(moved(&all), [thrust, drag, Effect::RotorMoments, Effect::AngularDamping]);
        assert_eq!((all.own_axes.clone(), all.parameters()), (0..6, 1 + 3 + 12 + 3 + 6));
        let mut forces = truth();
        forces.terms.retain(|term| term.effect == thrust || term.effect == drag);
        assert_eq!(new(&forces, Rows::Moments).err(), Some(RefineError::NothingToRefine));
        // 30 samples at either end, and 50 to predict.
        let short = prepared(110, |_, _| {});
        let of_short = Problem::new(&truth(), &[&short], Rows::All, Constants::Left);
        assert_eq!(of_short.err(), Some(RefineError::TooShort));
    }

    /// 3, 4, 5 and 8, 15, 17: roots of 0.3^2 + 0.4^2 and of 0.75^2 + 0.4^2.
    #[test]
    fn a_norm_counts_in_its_scale_and_is_a_square_near_zero() {
        let flight = prepared(400, |_, _| {});
        let mut problem = Problem::new(&truth(), &[&flight], Rows::Moments, Constants::Left).unwrap();
        problem.scale[1] = 10.0;
        let rounded = |of: f64| problem.rounded(1, &[10.0 * of, 0.0, 0.0]);
        assert_eq!(rounded(0.0), 0.0);
        assert!((rounded(0.3) - 0.1).abs() < 1e-15 && (rounded(-0.75) - 0.45).abs() < 1e-15);
        // r^2 / (2 * 0.4), and r - 0.4 but for 0.4^2 / 2 r.
        assert!((rounded(1e-3) / 1.25e-6 - 1.0).abs() < 1e-5 && (rounded(1e3) - 999.6).abs() < 1e-4);
        // The second start has the same quantities and horizons.
        assert_eq!(problem.rounded(1 + 4 * HORIZONS, &[0.0, 3.0, 0.0]), rounded(0.3));
    }

    /// Near a wrong model, by coefficients and by a constant moment of the flight.
    #[test]
    fn the_gradient_is_the_slope_of_the_loss() {
        let mut model = truth();
        let flight = Prepared::new(&fly(&model, 1, 4.0, &NONE), &model.vehicle).unwrap();
        model.set(Effect::AngularDamping, &[-2.0, -1.5, -1.0]);
        let problem = Problem::new(&model, &[&flight], Rows::Moments, Constants::Estimated).unwrap();
        let (values, trims) = (problem.values(), [[0.0, 0.0, 0.0, 0.1, -0.1, 0.05]]);
        let gradient = problem.quadratic(&values, &trims).gradient;
        for k in 0..problem.parameters() {
            let along = |step: f64| {
                let (mut values, mut trims) = (values.clone(), trims);
                match k.checked_sub(values.len()) {
                    None => values[k] += step,
                    Some(own) => trims[0][3 + own] += step,
                }
                problem.loss(&values, &trims)
            };
            let step = if k < values.len() { 1e-5 * values[k].abs() } else { 1e-5 };
            let slope = (along(step) - along(-step)) / (2.0 * step);
            // The columns are differences to one side.
            assert!((gradient[k] - slope).abs() < 1e-3 * slope.abs(), "{k}: {} {slope}", gradient[k]);
        }
    }

    /// Two flights with constants about three axes, behind fifteen coefficients.
    #[test]
    fn what_constants_of_flights_have_in_common_costs_and_what_they_differ_by_does_not() {
        let flight = prepared(400, |_, _| {});
        let problem = Problem::new(&truth(), &[&flight, &flight], Rows::Moments, Constants::Estimated);
        let problem = problem.unwrap();
        let count = problem.parameters();
        assert_eq!(problem.places(&problem.runs[1])[14..], [14, 18, 19, 20]);
        let mut at = Quadratic {
            loss: 0.0,
            gradient: DVector::zeros(count),
            curvature: DMatrix::identity(count, count),
            flatter: DMatrix::identity(count, count),
            blocks: Vec::new(),
        };
        problem.tie_trims(&mut at);
        let cost = |first: f64, second: f64| {
            let mut step = DVector::zeros(count);
            (step[16], step[19]) = (first, second);
            step.dot(&(&at.curvature * &step))
        };
        assert_eq!(cost(1.0, -1.0), 2.0);
        // A thousand times the curvature of both, times the square of their sum.
        assert_eq!(cost(1.0, 1.0), 2.0 + 2000.0 * 4.0);
        assert_eq!(at.curvature, at.flatter);
        // A rotor pulls upwards, whatever a step says.
        assert_eq!((problem.possible(0, -3.0), problem.possible(0, 0.7)), (0.0, 0.7));
    }
}
