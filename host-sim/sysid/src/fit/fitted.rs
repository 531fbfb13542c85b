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

#[cfg(test)]
mod tests {
    use model::Vehicle;
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// What was solved for the coefficients of `order`, of which each has a value, a variance and a covariance with each
    /// other by its name.
    fn solved(order: &[Effect], variance: impl Fn(&str, &str) -> f64) -> least_squares::Solution {
        let names: Vec<&str> = order.iter().flat_map(|e| e.info().coefficients).map(|c| c.name).collect();
        let value = DVector::from_iterator(names.len(), names.iter().map(|name| value_of(name)));
        let covariance = DMatrix::from_fn(names.len(), names.len(), |r, c| variance(names[r], names[c]));
        least_squares::Solution { value, covariance, sigma: [0.5; 6], condition: 7.0 }
    }

    fn value_of(name: &str) -> f64 {
        match name {
            "C_T" => 0.01,
            "C_du" => -0.1,
            "C_dv" => -0.2,
            "C_dw" => -0.3,
            _ => 5.0,
        }
    }

    fn began(effects: &[Effect]) -> Model {
        let mut model = Model::new(Vehicle::thesis());
        effects.iter().for_each(|e| model.set(*e, &vec![0.0; e.info().coefficients.len()]));
        model
    }

    /// Solved for drag, then thrust: variances 1, 4, 9 and 16, and 2 between forward drag and thrust.
    #[test]
    fn a_solution_in_another_order_comes_back_in_that_of_the_model() {
        let order = [Effect::LinearDrag, Effect::Thrust];
        let variance = |a: &str, b: &str| match (a, b) {
            ("C_du", "C_du") => 1.0,
            ("C_dv", "C_dv") => 4.0,
            ("C_dw", "C_dw") => 9.0,
            ("C_T", "C_T") => 16.0,
            ("C_du", "C_T") | ("C_T", "C_du") => 2.0,
            _ => 0.0,
        };
        let fit = finish(began(&[Effect::Thrust, Effect::LinearDrag]), &order, solved(&order, variance));
        assert_eq!(fit.model.effects(), [Effect::Thrust, Effect::LinearDrag]);
        assert_eq!(fit.model.term(Effect::Thrust).unwrap().values(), [0.01]);
        assert_eq!(fit.model.term(Effect::LinearDrag).unwrap().values(), [-0.1, -0.2, -0.3]);
        let expected = [16.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 9.0];
        assert_eq!(fit.covariance, DMatrix::from_row_slice(4, 4, &expected));
        let errors: Vec<Option<f64>> =
            fit.model.terms.iter().flat_map(|t| &t.coefficients).map(|c| c.std_error).collect();
        assert_eq!(errors, [4.0, 1.0, 2.0, 3.0].map(Some));
        // 2 / (4 * 1).
        assert_eq!(fit.model.correlation.unwrap().rows[1], [0.5]);
    }

    #[test]
    fn the_order_of_the_parameters_changes_nothing_in_the_fit() {
        let effects = [Effect::Thrust, Effect::LinearDrag, Effect::MassChange];
        let size = |name: &str| name.bytes().map(f64::from).sum::<f64>();
        let variance = |a: &str, b: &str| if a == b { 4.0 * size(a) } else { (size(a) * size(b)).sqrt() };
        let as_it_is = finish(began(&effects), &effects, solved(&effects, variance));
        for turned in [[1, 2, 0], [2, 0, 1], [1, 0, 2]] {
            let order = turned.map(|k| effects[k]);
            let fit = finish(began(&effects), &order, solved(&order, variance));
            assert_eq!((&fit.model, &fit.covariance), (&as_it_is.model, &as_it_is.covariance));
        }
    }
}
