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
/// The same where only the better of two ways is wanted.
const ROUGHLY_CONVERGED: f64 = 1e-3;

/// The end of a descent: coefficients and the flights' constants.
struct End {
    values: Vec<f64>,
    trims: Vec<[f64; 6]>,
    steps: usize,
}

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
        let End { values, trims, steps } = self.descend_to(CONVERGED)?;
        let covariance = self.covariance(&self.quadratic(&values, &trims))?;
        let mut model = self.with(&values);
        let first = |effect| -> usize {
            model.terms.iter().take_while(|t| t.effect != effect).map(|t| t.coefficients.len()).sum()
        };
        let places: Vec<usize> = self.free.iter().map(|free| first(free.effect) + free.index).collect();
        let own = covariance.view_range(..places.len(), ..places.len()).into_owned();
        model.set_covariance(&places, &own);
        Ok((model, steps))
    }

    /// The model near the end of the descent, without errors.
    pub(super) fn descend_roughly(&self) -> Result<Model, RefineError> {
        Ok(self.with(&self.descend_to(ROUGHLY_CONVERGED)?.values))
    }

    /// Descends until the loss falls by less than a part of itself.
    fn descend_to(&self, converged: f64) -> Result<End, RefineError> {
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
                if fall < converged {
                    break;
                }
                at = self.quadratic(&values, &trims);
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        Ok(End { values, trims, steps })
    }
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::super::problem::{Constants, Rows};
    use super::*;
    use crate::prepare::Prepared;
    use crate::testing::{NONE, fly, prepared, truth};

    /// The variance of a mean by leaving out one after the other is what textbooks have: of 1, 2 and 6 it is 14 / (3 * 2).
    /// Each of three coefficients is the mean of one number a flight, which two blocks of time share.
    #[test]
    fn left_out_one_by_one_flights_give_the_variance_of_their_mean() {
        let mut model = truth();
        model.terms.retain(|term| term.effect == Effect::AngularDamping);
        let flight = prepared(400, |_, _| {});
        let problem =
            Problem::new(&model, &[&flight, &flight, &flight], Rows::Moments, Constants::Left).unwrap();
        let block = |run: usize, part: f64| {
            let gradient = DVector::from_element(3, part * (3.0 - [1.0, 2.0, 6.0][run]));
            let flatter = DMatrix::from_diagonal_element(3, 3, part);
            Block { run, gradient, curvature: flatter.clone(), flatter }
        };
        let blocks = (0..3).flat_map(|run| [block(run, 0.25), block(run, 0.75)]).collect();
        let all = DMatrix::from_diagonal_element(3, 3, 3.0);
        let at = Quadratic {
            loss: 0.0,
            gradient: DVector::zeros(3),
            curvature: all.clone(),
            flatter: all,
            blocks,
        };
        let covariance = problem.covariance(&at).unwrap();
        // The three have the same numbers, so that they vary together.
        assert!(covariance.iter().all(|v| (v - 14.0 / 6.0).abs() < 1e-12), "{covariance}");
    }

    #[test]
    fn a_descent_ends_at_the_craft_that_flew_with_errors_of_what_it_moved() {
        let truth = truth();
        let flight = Prepared::new(&fly(&truth, 1, 6.0, &NONE), &truth.vehicle).unwrap();
        let mut wrong = truth.clone();
        wrong.set(Effect::AngularDamping, &[-2.0, 0.5, -1.5]);
        let problem = Problem::new(&wrong, &[&flight], Rows::Moments, Constants::Estimated).unwrap();
        let (model, steps) = problem.descend().unwrap();
        assert!((2..=MAX_STEPS).contains(&steps), "{steps}");
        let damping = &model.term(Effect::AngularDamping).unwrap().coefficients;
        for (found, right) in damping.iter().zip([-0.7, -0.65, -0.5]) {
            // Six seconds tell dampings and motors apart this well.
            assert!((found.value - right).abs() < 0.1, "{damping:?}");
        }
        for term in &model.terms {
            let is_moved = matches!(term.effect, Effect::RotorMoments | Effect::AngularDamping);
            let has_error = |c: &model::Estimate| c.std_error.is_some_and(|error| error > 0.0);
            assert!(term.coefficients.iter().all(|c| has_error(c) == is_moved), "{term:?}");
        }
    }
}
