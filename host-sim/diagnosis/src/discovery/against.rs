//! What the rows of forms are held against.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::discovery::problem::Problem;
use crate::discovery::products::{AT_ONCE, Columns};

/// What columns are held against on each axis: the basis of what the model takes, then residuals. The first of these is that which the
/// model leaves, the others have its colour and random phases.
pub(crate) struct Against {
    /// The vectors of the basis that differ from zero on the axis, then the residuals, side by side, then zeros up to as many as are taken
    /// at once: a column for each row of the problem. In single precision, as are the hats that are held against them: a search forms far
    /// more of these than are ever fitted.
    pub(crate) axes: [DMatrix<f32>; 6],
    /// Which vectors of the basis these are.
    pub(crate) of_basis: [Vec<usize>; 6],
    /// Vectors of the basis.
    pub(crate) taken: usize,
    /// Residuals.
    pub(crate) residuals: usize,
}

impl Against {
    pub(crate) fn new(problem: &Problem<'_>, others: &[[Vec<f64>; 6]]) -> Self {
        let residuals = 1 + others.len();
        let axes = std::array::from_fn(|axis| {
            let basis = problem.basis(axis);
            let own = basis.of.len();
            let mut all = DMatrix::zeros(problem.rows, (own + residuals).next_multiple_of(AT_ONCE));
            all.columns_mut(0, own).copy_from(&basis.columns);
            all.set_column(own, &problem.residual[axis]);
            for (k, other) in others.iter().enumerate() {
                all.column_mut(own + k + 1).copy_from_slice(&other[axis]);
            }
            all.transpose().cast()
        });
        let of_basis = std::array::from_fn(|axis| problem.basis(axis).of.clone());
        Self { axes, of_basis, taken: problem.taken, residuals }
    }

    /// Columns on an axis, those that are zero among them.
    pub(crate) fn count(&self, axis: usize) -> usize {
        self.axes[axis].nrows()
    }

    /// Some rows of the columns on an axis.
    pub(super) fn rows(&self, axis: usize, rows: Range<usize>) -> Columns<'_> {
        let count = self.count(axis);
        let rows = &self.axes[axis].as_slice()[rows.start * count..rows.end * count];
        Columns { rows, width: count, first: 0, count }
    }
}

#[cfg(test)]
mod tests {
    use sysid::Prepared;

    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// Put together from its axes, the basis is orthonormal, and nothing of it is in the residual. The other residual is `axis + 1` on each
    /// axis: its square is 1 + 4 + ... + 36 = 91 for each row.
    #[test]
    fn basis_and_residuals_stand_where_they_are_said_to() {
        let model = truth();
        let flights = prepared(&model, 30..31, 6.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let problem = Problem::new(&flights, &model);
        let other = std::array::from_fn(|axis| vec![axis as f64 + 1.0; problem.rows]);
        let against = Against::new(&problem, &[other]);
        assert_eq!(against.residuals, 2);
        let taken = against.taken;
        let mut products = DMatrix::<f32>::zeros(taken + 2, taken + 2);
        for (columns, of_basis) in against.axes.iter().zip(&against.of_basis) {
            let places: Vec<usize> = of_basis.iter().copied().chain([taken, taken + 1]).collect();
            let own = columns * columns.transpose();
            for (row, place) in places.iter().enumerate() {
                places.iter().enumerate().for_each(|(k, of)| products[(*place, *of)] += own[(row, k)]);
            }
        }
        // Sums of some hundred products in single precision.
        const NEAR: f32 = 1e-4;
        let basis = products.view((0, 0), (taken, taken));
        assert!((basis - DMatrix::identity(taken, taken)).amax() < NEAR, "{basis}");
        let [residual, other] = [taken, taken + 1].map(|k| products[(k, k)]);
        assert!(residual > 0.0 && products.view((0, taken), (taken, 1)).amax() < NEAR * residual.sqrt());
        assert!((other / (91.0 * problem.rows as f32) - 1.0).abs() < NEAR, "{other}");
    }
}
