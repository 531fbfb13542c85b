//! What the rows of forms are held against.

use nalgebra::DMatrix;

use crate::discovery::problem::Problem;

/// What columns are held against on each axis: the basis of what the model takes, then residuals. The first of these is that which the
/// model leaves, the others have its colour and random phases.
pub(crate) struct Against {
    /// Columns: the vectors of the basis that differ from zero on the axis, then the residuals. In single precision, as are the hats that
    /// are held against them: a search forms far more of these than are ever fitted.
    pub(crate) axes: [DMatrix<f32>; 6],
    /// Which vectors of the basis these are.
    pub(crate) of_basis: [Vec<usize>; 6],
    /// Vectors of the basis.
    pub(crate) taken: usize,
}

impl Against {
    pub(crate) fn new(problem: &Problem<'_>, others: &[[Vec<f64>; 6]]) -> Self {
        let axes = std::array::from_fn(|axis| {
            let basis = problem.basis(axis);
            let own = basis.of.len();
            let mut all = DMatrix::zeros(problem.rows, own + 1 + others.len());
            all.columns_mut(0, own).copy_from(&basis.columns);
            all.set_column(own, &problem.residual[axis]);
            for (k, other) in others.iter().enumerate() {
                all.column_mut(own + k + 1).copy_from_slice(&other[axis]);
            }
            all.cast()
        });
        let of_basis = std::array::from_fn(|axis| problem.basis(axis).of.clone());
        Self { axes, of_basis, taken: problem.taken }
    }

    pub(crate) fn residuals(&self) -> usize {
        self.axes[0].ncols() - self.of_basis[0].len()
    }
}
