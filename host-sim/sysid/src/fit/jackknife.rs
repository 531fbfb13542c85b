//! What a covariance from residuals leaves out: a stretch of time that decides a coefficient draws the fit to itself, and its
//! residual says too little of its error.
//!
//! The damping of a swing shows in the few seconds after a hard stop, and how it swung when each piece began is estimated from the
//! same seconds. With A = X'WX, and S and A_b the scores X'We and the part of A of a block b, leaving the block out moves the coefficients
//! by `(A - A_b)^-1 S`, while the usual covariance counts `A^-1 S`. The sum of squares of the first over all blocks is the
//! jackknife's covariance (Bell and McCaffrey 2002, "CR3"; Cameron and Miller 2015); the difference of the two sums is what is
//! added here.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::fit::least_squares::{FlightRows, Solution};

/// The jackknife's covariance over that of the scores, of the blocks of rows of each flight, on the axes of forces: its positive part.
/// Nothing for a block without which the rest would not be determined.
pub(crate) fn of_blocks(
    flights: &[FlightRows],
    blocks: &[Vec<Range<usize>>],
    solution: &Solution,
) -> DMatrix<f64> {
    // Scaled: coefficients are of all magnitudes.
    let scale = solution.covariance.diagonal().map(f64::sqrt);
    let surplus = surplus(flights, blocks, solution);
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |r, c| surplus[(r, c)] / (scale[r] * scale[c]));
    let eigen = scaled.symmetric_eigen();
    let more = eigen.eigenvalues.map(|value| value.max(0.0));
    let vectors = DMatrix::from_diagonal(&scale) * eigen.eigenvectors;
    &vectors * DMatrix::from_diagonal(&more) * vectors.transpose()
}

/// The difference as it is.
fn surplus(flights: &[FlightRows], blocks: &[Vec<Range<usize>>], solution: &Solution) -> DMatrix<f64> {
    let count = solution.value.len();
    let mut surplus = DMatrix::zeros(count, count);
    let Some(normal) = solution.covariance.clone().try_inverse() else { return surplus };
    for (flight, blocks) in flights.iter().zip(blocks) {
        for rows in blocks {
            let (own, scores) = of_block(flight, rows, solution);
            let counted = &solution.covariance * &scores;
            let scale = DVector::from_fn(count, |k, _| normal[(k, k)].sqrt());
            let rest =
                DMatrix::from_fn(count, count, |r, c| (normal[(r, c)] - own[(r, c)]) / (scale[r] * scale[c]));
            let Some(factor) = rest.cholesky() else { continue };
            let moved = factor.solve(&scores.component_div(&scale)).component_div(&scale);
            surplus += &moved * moved.transpose() - &counted * counted.transpose();
        }
    }
    surplus
}

/// A block's part of X'WX, and its scores, on the axes of forces.
fn of_block(flight: &FlightRows, rows: &Range<usize>, solution: &Solution) -> (DMatrix<f64>, DVector<f64>) {
    let count = solution.value.len();
    let (mut own, mut scores) = (DMatrix::zeros(count, count), DVector::zeros(count));
    for axis in 0..3 {
        let weight = 1.0 / (solution.sigma[axis] * solution.sigma[axis]);
        let active: Vec<(usize, &[f64])> = flight
            .columns
            .iter()
            .enumerate()
            .filter_map(|(k, column)| Some((k, &column[axis].as_ref()?[rows.clone()])))
            .collect();
        let mut residual = flight.targets[axis][rows.clone()].to_vec();
        for (k, column) in &active {
            residual.iter_mut().zip(*column).for_each(|(r, c)| *r -= solution.value[*k] * c);
        }
        let product = |a: &[f64], b: &[f64]| weight * a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (i, (k, column)) in active.iter().enumerate() {
            scores[*k] += product(column, &residual);
            for (l, other) in &active[..=i] {
                let both = product(column, other);
                own[(*k, *l)] += both;
                if k != l {
                    own[(*l, *k)] += both;
                }
            }
        }
    }
    (own, scores)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::least_squares::solve_without_errors;

    /// Rows of y = a x + b z with a residual, on the axis u.
    fn made_up(first: usize, rows: usize) -> FlightRows {
        let x = |k: usize| (0.37 * (first + k) as f64).sin();
        let z = |k: usize| (0.05 * (first + k) as f64).cos();
        let mut targets: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; rows]);
        targets[0] = (0..rows).map(|k| 2.0 * x(k) - z(k) + (1.9 * (first + k) as f64).sin()).collect();
        let columns = [(0..rows).map(x).collect(), (0..rows).map(z).collect()];
        let column = |values: Vec<f64>| [Some(values), None, None, None, None, None];
        FlightRows { targets, columns: columns.map(column).into(), starts: vec![0], period_s: 0.01 }
    }

    /// Against fits that really leave a block out: for a linear problem of one axis they are the same.
    #[test]
    fn leaving_blocks_out_is_what_it_says() {
        let (rows, at) = (90, 30);
        let whole = [made_up(0, rows)];
        let solution = solve_without_errors(&whole, &[None; 2]).unwrap();
        let mut expected = DMatrix::zeros(2, 2);
        for (left_out, kept) in [(0..at, made_up(at, rows - at)), (at..rows, made_up(0, at))] {
            let moved = &solution.value - solve_without_errors(&[kept], &[None; 2]).unwrap().value;
            let (_, scores) = of_block(&whole[0], &left_out, &solution);
            let counted = &solution.covariance * scores;
            expected += &moved * moved.transpose() - &counted * counted.transpose();
        }
        let blocks = [vec![0..at, at..rows]];
        let surplus = surplus(&whole, &blocks, &solution);
        // Normal equations of two coefficients against QR.
        assert!((&surplus - &expected).norm() < 1e-10 * expected.norm(), "{surplus} {expected}");
        // The positive part takes nothing away from any coefficient.
        let part = of_blocks(&whole, &blocks, &solution);
        assert!((0..2).all(|k| part[(k, k)] >= surplus[(k, k)] && part[(k, k)] >= 0.0), "{part}");
    }
}
