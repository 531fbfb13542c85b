//! The descent to the least loss, and the standard errors at its end.

use model::Model;
use nalgebra::{DMatrix, DVector};

use super::error::RefineError;
use super::problem::Problem;
use crate::fit::quadratic::{Block, Quadratic, add_at, add_square_at, damped_step, scaled};

/// Most steps.
const MAX_STEPS: usize = 25;
/// Relative fall of the loss under which the last step was the last.
const CONVERGED: f64 = 1e-5;

impl Problem<'_> {
    /// Jackknife over blocks of time, over whole flights where their constants are left in the
    /// errors: how far the end of the descent moves without each of them, squared and summed.
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
    pub(super) fn descend(&self) -> Result<(Model, usize), RefineError> {
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
