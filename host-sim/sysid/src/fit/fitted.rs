//! A fitted model, with what its errors are judged by.

use model::{Effect, Model};

use crate::fit::least_squares;
use crate::fit::parameters::store;

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
    /// Whether the steps found an end; else its adjusting effects stand where they were.
    pub is_settled: bool,
}

/// The model with a solution whose parameters are the coefficients of the effects in `order`.
pub(crate) fn finish(mut model: Model, order: &[Effect], solution: least_squares::Solution) -> Fit {
    store(&mut model, order, solution.value.as_slice());
    let covariance = in_model_order(&model, order, &solution.covariance);
    let all: Vec<usize> = (0..covariance.nrows()).collect();
    model.set_covariance(&all, &covariance);
    Fit { model, sigma: solution.sigma, covariance, condition: solution.condition, is_settled: true }
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
