//! A loss about a point as a quadratic, and steps to its lowest place.

use nalgebra::{DMatrix, DVector};

/// Gradient and curvature of the loss, coefficients first, then each flight's own constants.
pub(crate) struct Quadratic {
    pub(crate) loss: f64,
    pub(crate) gradient: DVector<f64>,
    /// Of the reweighted least squares: an upper bound, for the steps.
    pub(crate) curvature: DMatrix<f64>,
    /// Of the loss itself, which is flatter along an error than across it, for the covariance.
    pub(crate) flatter: DMatrix<f64>,
    pub(crate) blocks: Vec<Block>,
}

/// The part of a block of time in gradient and curvature, over the parameters of its flight.
pub(crate) struct Block {
    pub(crate) run: usize,
    pub(crate) gradient: DVector<f64>,
    pub(crate) curvature: DMatrix<f64>,
    pub(crate) flatter: DMatrix<f64>,
}

/// Levenberg and Marquardt's step: curvature with its diagonal raised.
pub(crate) fn damped_step(at: &Quadratic, damping: f64) -> Option<DVector<f64>> {
    let mut raised = at.curvature.clone();
    for k in 0..raised.nrows() {
        raised[(k, k)] *= 1.0 + damping;
    }
    Some(scaled(&raised)?.solve(&at.gradient))
}

pub(crate) fn add_at(to: &mut DVector<f64>, part: &DVector<f64>, places: &[usize]) {
    places.iter().zip(part.iter()).for_each(|(&place, value)| to[place] += value);
}

pub(crate) fn add_square_at(to: &mut DMatrix<f64>, part: &DMatrix<f64>, places: &[usize], factor: f64) {
    for (i, &row) in places.iter().enumerate() {
        for (j, &column) in places.iter().enumerate() {
            to[(row, column)] += factor * part[(i, j)];
        }
    }
}

/// A Cholesky factor of a matrix whose units differ widely, by its scaled one.
pub(crate) struct Scaled {
    scale: DVector<f64>,
    factor: nalgebra::Cholesky<f64, nalgebra::Dyn>,
}

pub(crate) fn scaled(matrix: &DMatrix<f64>) -> Option<Scaled> {
    let scale = matrix.diagonal().map(|d| 1.0 / d.sqrt());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let unit = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |r, c| matrix[(r, c)] * scale[r] * scale[c]);
    Some(Scaled { scale, factor: unit.cholesky()? })
}

impl Scaled {
    pub(crate) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(&right.component_mul(&self.scale)).component_mul(&self.scale)
    }
}
