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

#[cfg(test)]
mod tests {
    use super::*;

    fn at(curvature: DMatrix<f64>, gradient: DVector<f64>) -> Quadratic {
        Quadratic { loss: 0.0, gradient, flatter: curvature.clone(), curvature, blocks: Vec::new() }
    }

    /// [4 1; 1 3] times (1, -2) is (2, -5).
    #[test]
    fn without_damping_the_step_solves_the_normal_equations_and_with_it_leans_on_the_diagonal() {
        let quadratic =
            at(DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 3.0]), DVector::from_vec(vec![2.0, -5.0]));
        let newton = damped_step(&quadratic, 0.0).unwrap();
        assert!((newton - DVector::from_vec(vec![1.0, -2.0])).norm() < 1e-12);
        // Steepest descent, scaled by the diagonal.
        let damped = damped_step(&quadratic, 1e9).unwrap() * 1e9;
        assert!((damped - DVector::from_vec(vec![0.5, -5.0 / 3.0])).norm() < 1e-6);
    }

    #[test]
    fn units_that_differ_by_twelve_orders_are_no_obstacle() {
        let matrix = DMatrix::from_row_slice(2, 2, &[1e-12, 0.5, 0.5, 1e12]);
        let right = &matrix * DVector::from_vec(vec![3e6, -2e-6]);
        let found = scaled(&matrix).unwrap().solve(&right);
        assert!((found[0] / 3e6 - 1.0).abs() < 1e-9 && (found[1] / -2e-6 - 1.0).abs() < 1e-9, "{found}");
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        for entries in [[0.0, 0.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 1.0], [1.0, 2.0, 2.0, 1.0], [f64::NAN; 4]] {
            assert!(scaled(&DMatrix::from_row_slice(2, 2, &entries)).is_none(), "{entries:?}");
        }
        assert!(damped_step(&at(DMatrix::zeros(2, 2), DVector::zeros(2)), 1.0).is_none());
    }

    #[test]
    fn parts_are_added_where_their_places_say() {
        let mut vector = DVector::from_vec(vec![1.0, 1.0, 1.0]);
        add_at(&mut vector, &DVector::from_vec(vec![5.0, 7.0]), &[2, 0]);
        assert_eq!(vector.as_slice(), [8.0, 1.0, 6.0]);
        let mut matrix = DMatrix::zeros(3, 3);
        add_square_at(&mut matrix, &DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 3.0, 4.0]), &[2, 0], -2.0);
        // The part's rows and columns 0, 1 are the whole's 2, 0.
        assert_eq!(
            (matrix[(2, 2)], matrix[(2, 0)], matrix[(0, 2)], matrix[(0, 0)]),
            (-2.0, -4.0, -6.0, -8.0)
        );
        assert_eq!(matrix.iter().filter(|v| **v != 0.0).count(), 4);
    }
}
