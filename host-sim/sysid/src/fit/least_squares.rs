//! Least squares by QR, with standard errors that hold for coloured residuals.
//!
//! The six rows of (4.3) are stacked. Each axis is reduced to the triangle R of its own [X | y]; triangles of flights
//! and of axes merge by another QR of themselves (least squares is a monoid), so a row block is touched once.
//! Axes are weighted by the inverse of their residual's standard deviation: coefficients that act on several axes
//! (a wind, a lever) then weigh each axis by what it can tell.
//!
//! Standard errors: the smoother (31 taps, twice for positions) and the flight make residuals coloured, and the
//! textbook formula is far too optimistic. The covariance here is the heteroskedasticity and autocorrelation
//! consistent one (Newey and West 1987) with a Bartlett window of [`WINDOW_S`], computed from overlapping sums
//! of the scores X'e, without crossing gaps or flights, and as much larger as short flights demand (Kiefer and
//! Vogelsang 2005): 95 % intervals of a craft that is simulated with white noise cover its coefficients in 93 of 100
//! runs at least.

use model::AXES;
use nalgebra::{DMatrix, DVector};

use crate::filter::sum_of_products;

/// Bartlett window of the covariance: over twice the span of the longest filter chain, s.
pub const WINDOW_S: f64 = 1.5;

/// Relative size of the smallest singular value (of column-scaled R) under which a fit is refused as singular.
const SINGULAR: f64 = 1e-7;

/// The values of one parameter over the rows, for each axis that it acts on.
pub type RowColumn = [Option<Vec<f64>>; 6];

/// One flight's part of a regression: for each axis the target, and for each parameter its column there.
pub struct FlightRows {
    /// Target of each axis; all of the same length.
    pub targets: [Vec<f64>; 6],
    /// Column of each parameter on each axis.
    pub columns: Vec<RowColumn>,
    /// Rows at which stretches begin.
    pub starts: Vec<usize>,
    /// Sampling period, s.
    pub period_s: f64,
}

impl FlightRows {
    /// How many rows there are.
    pub fn rows(&self) -> usize {
        self.targets[0].len()
    }
}

/// Parameters that cannot be told from the data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unidentifiable {
    /// A column without any excitation: the parameter's index.
    NotExcited(usize),
    /// Columns that repeat each other: the indices of those involved.
    Collinear(Vec<usize>),
}

/// A solved regression.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The estimates.
    pub value: DVector<f64>,
    /// Covariance, coloured residuals accounted for.
    pub covariance: DMatrix<f64>,
    /// Standard deviation of the residual of each axis.
    pub sigma: [f64; 6],
    /// Ratio of largest to smallest singular value of the column-scaled problem.
    pub condition: f64,
}

/// The triangle of [X | y] on one axis, over the parameters that act there.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisTriangle {
    /// Those that act there, in order.
    pub parameters: Vec<usize>,
    /// Of their columns and the target.
    pub triangle: DMatrix<f64>,
}

/// What is known of a parameter before any flight.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    /// Value the unknown would take, in its unit.
    pub expected: f64,
    /// Standard deviation, in its unit.
    pub deviation: f64,
}

/// Solves the stacked problem; a parameter may have a prior, which enters as one more row.
pub fn solve(flights: &[FlightRows], priors: &[Option<Prior>]) -> Result<Solution, Unidentifiable> {
    Ok(with_errors(solve_without_errors(flights, priors)?, flights, priors))
}

/// The same with the covariance of white residuals, which costs no second look at the rows: what an iteration needs.
pub fn solve_without_errors(
    flights: &[FlightRows],
    priors: &[Option<Prior>],
) -> Result<Solution, Unidentifiable> {
    let triangles = std::array::from_fn(|axis| axis_triangle(flights, axis, priors.len()));
    solve_triangles(&triangles, flights.iter().map(FlightRows::rows).sum(), priors)
}

/// The same from the triangle of each axis: what is left of so many rows once they have been forgotten. Parameters that act on several
/// axes join them.
pub fn solve_triangles(
    triangles: &[AxisTriangle; 6],
    rows: usize,
    priors: &[Option<Prior>],
) -> Result<Solution, Unidentifiable> {
    let mut sigma = [1.0; 6];
    let mut value = solve_merged(triangles, priors, &sigma)?.0;
    // Two passes: the first weights come from an unweighted fit, the second from a weighted one.
    let mut inverse = DMatrix::zeros(0, 0);
    let mut condition = 1.0;
    for _ in 0..2 {
        for (axis, triangle) in triangles.iter().enumerate() {
            sigma[axis] = residual_norm(triangle, &value) / (rows.max(1) as f64).sqrt();
            // An axis fitted to the last bit (made-up data) must not get infinite weight.
            sigma[axis] = sigma[axis].max(1e-9);
        }
        (value, inverse, condition) = solve_merged(triangles, priors, &sigma)?;
    }
    Ok(Solution { value, covariance: inverse, sigma, condition })
}

/// A solution with its covariance accounting for coloured residuals.
fn with_errors(solution: Solution, flights: &[FlightRows], priors: &[Option<Prior>]) -> Solution {
    with_errors_beside(solution, flights, priors, &[])
}

/// The same with what the targets may all be off by together: for each flight, one standard deviation of it.
pub fn with_errors_beside(
    solution: Solution,
    flights: &[FlightRows],
    priors: &[Option<Prior>],
    off: &[Option<[Option<Vec<f64>>; 6]>],
) -> Solution {
    let mut meat = scores_covariance(flights, &solution.value, &solution.sigma, priors.len());
    for (k, prior) in priors.iter().enumerate() {
        meat[(k, k)] += prior.map_or(0.0, |p| 1.0 / (p.deviation * p.deviation));
    }
    let mut common = DVector::<f64>::zeros(priors.len());
    for (flight, off) in flights.iter().zip(off) {
        for (axis, off) in off.iter().flatten().enumerate() {
            let Some(off) = off else { continue };
            let weight = 1.0 / (solution.sigma[axis] * solution.sigma[axis]);
            for (sum, column) in common.iter_mut().zip(&flight.columns) {
                *sum += column[axis].as_ref().map_or(0.0, |column| weight * sum_of_products(column, off));
            }
        }
    }
    meat.ger(1.0, &common, &common, 1.0);
    let short = short_record(flights.iter().map(|flight| flight.rows() as f64 * flight.period_s).sum());
    let covariance = &solution.covariance * meat * solution.covariance.transpose() * (short * short);
    Solution { covariance, ..solution }
}

/// By how much standard errors grow since windows are no small part of the flights: the covariance is an estimate that scatters, and
/// comes out too small. The 95 % point of Kiefer and Vogelsang (2005) for a Bartlett window of this part of the record, over the
/// normal one's.
pub fn short_record(record_s: f64) -> f64 {
    let b = (WINDOW_S / record_s).min(1.0);
    (1.96 + b * (2.9694 + b * (0.4160 - b * 0.5324))) / 1.96
}

/// Rows a block of the reduction takes at once: small enough for the nearest cache.
const BLOCK_ROWS: usize = 256;

/// The triangular factor of the stacked rows of one axis.
pub fn axis_triangle(flights: &[FlightRows], axis: usize, parameters: usize) -> AxisTriangle {
    let active: Vec<usize> =
        (0..parameters).filter(|&k| flights.iter().any(|f| f.columns[k][axis].is_some())).collect();
    let width = active.len() + 1;
    let mut triangle = DMatrix::zeros(width, width);
    let mut block = DMatrix::zeros(BLOCK_ROWS, width);
    for flight in flights {
        for start in (0..flight.rows()).step_by(BLOCK_ROWS) {
            let end = (start + BLOCK_ROWS).min(flight.rows());
            let columns = active.iter().map(|&k| flight.columns[k][axis].as_ref());
            for (c, column) in columns.chain([Some(&flight.targets[axis])]).enumerate() {
                let mut place = block.column_mut(c);
                let (rows, rest) = place.as_mut_slice().split_at_mut(end - start);
                match column {
                    Some(column) => rows.copy_from_slice(&column[start..end]),
                    None => rows.fill(0.0),
                }
                rest.fill(0.0);
            }
            absorb(&mut triangle, &mut block);
        }
    }
    AxisTriangle { parameters: active, triangle }
}

impl AxisTriangle {
    /// The triangle of this one's rows and of those of `other`, which speaks of the same parameters.
    pub fn absorb(&mut self, other: &Self) {
        debug_assert_eq!(self.parameters, other.parameters);
        absorb(&mut self.triangle, &mut other.triangle.clone());
    }

    /// Norm of what these values of all parameters leave.
    pub fn left(&self, value: &DVector<f64>) -> f64 {
        residual_norm(self, value)
    }
}

/// The triangle of a triangle over a block of rows, by Householder reflections (Golub and Van Loan 2013, section 5.2);
/// each leaves all rows of the triangle but one alone. The block's rows are used up.
fn absorb(triangle: &mut DMatrix<f64>, block: &mut DMatrix<f64>) {
    for k in 0..triangle.ncols() {
        let (x, mut rest) = block.columns_range_pair_mut(k, k + 1..);
        let x = x.as_slice();
        let head = triangle[(k, k)];
        let below = sum_of_products(x, x);
        if below == 0.0 {
            continue;
        }
        let norm = (head * head + below).sqrt().copysign(head);
        let pivot = head + norm;
        let scale = 2.0 / (pivot * pivot + below);
        triangle[(k, k)] = -norm;
        for (c, mut column) in (k + 1..).zip(rest.column_iter_mut()) {
            let column = column.as_mut_slice();
            let factor = scale * (pivot * triangle[(k, c)] + sum_of_products(x, column));
            triangle[(k, c)] -= factor * pivot;
            subtract_multiple(column, factor, x);
        }
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn subtract_multiple(from: &mut [f64], factor: f64, values: &[f64]) {
    from.iter_mut().zip(values).for_each(|(f, v)| *f -= factor * v);
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn add_products(to: &mut [f64], a: &[f64], b: &[f64]) {
    to.iter_mut().zip(a.iter().zip(b)).for_each(|(t, (a, b))| *t += a * b);
}

fn residual_norm(axis: &AxisTriangle, value: &DVector<f64>) -> f64 {
    let width = axis.triangle.ncols();
    let c = DVector::from_iterator(width, axis.parameters.iter().map(|&k| -value[k]).chain([1.0]));
    (&axis.triangle * c).norm()
}

/// Value, inverse of X'WX, and condition number of the column-scaled problem.
fn solve_merged(
    axes: &[AxisTriangle],
    priors: &[Option<Prior>],
    sigma: &[f64; 6],
) -> Result<(DVector<f64>, DMatrix<f64>, f64), Unidentifiable> {
    let parameters = priors.len();
    let known = priors.iter().flatten().count();
    let height: usize = axes.iter().map(|a| a.triangle.nrows()).sum::<usize>() + known;
    let mut stacked = DMatrix::zeros(height, parameters + 1);
    let mut at = 0;
    for (axis, weight) in axes.iter().zip(sigma) {
        for row in 0..axis.triangle.nrows() {
            for (c, &k) in axis.parameters.iter().chain([&parameters]).enumerate() {
                stacked[(at + row, k)] = axis.triangle[(row, c)] / weight;
            }
        }
        at += axis.triangle.nrows();
    }
    for (k, prior) in priors.iter().enumerate() {
        if let Some(prior) = prior {
            stacked[(at, k)] = 1.0 / prior.deviation;
            stacked[(at, parameters)] = prior.expected / prior.deviation;
            at += 1;
        }
    }
    let scale: Vec<f64> = (0..parameters).map(|k| stacked.column(k).norm()).collect();
    if let Some(k) = scale.iter().position(|s| !(*s > 0.0) || !s.is_finite()) {
        return Err(Unidentifiable::NotExcited(k));
    }
    for (k, s) in scale.iter().enumerate() {
        stacked.column_mut(k).unscale_mut(*s);
    }
    if height < parameters {
        return Err(Unidentifiable::Collinear((0..parameters).collect()));
    }
    let triangle = stacked.qr().unpack_r();
    let r = triangle.view((0, 0), (parameters, parameters)).into_owned();
    let y = triangle.view((0, parameters), (parameters, 1)).column(0).into_owned();
    let singular_values = r.singular_values();
    let (smallest, largest) = (singular_values.min(), singular_values.max());
    if !(smallest > SINGULAR * largest) {
        return Err(Unidentifiable::Collinear(nearly_collinear(r)));
    }
    let identity = DMatrix::identity(parameters, parameters);
    let (Some(value), Some(inverse)) = (r.solve_upper_triangular(&y), r.solve_upper_triangular(&identity))
    else {
        return Err(Unidentifiable::Collinear((0..parameters).collect()));
    };
    let unscale = DMatrix::from_diagonal(&DVector::from_iterator(parameters, scale.iter().map(|s| 1.0 / s)));
    let inverse = &unscale * inverse;
    Ok((&unscale * value, &inverse * inverse.transpose(), largest / smallest))
}

/// The columns that a triangle's smallest singular value is of.
fn nearly_collinear(triangle: DMatrix<f64>) -> Vec<usize> {
    let svd = triangle.svd(false, true);
    let row = svd.singular_values.imin();
    let involved = |v_t: &DMatrix<f64>| (0..v_t.ncols()).filter(|k| v_t[(row, *k)].abs() > 0.1).collect();
    svd.v_t.as_ref().map_or_else(Vec::new, involved)
}

/// Newey and West's estimate of the covariance of X'W e.
pub fn scores_covariance(
    flights: &[FlightRows],
    value: &DVector<f64>,
    sigma: &[f64; 6],
    parameters: usize,
) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(parameters, parameters);
    for flight in flights {
        let scores = scores(flight, value, sigma, parameters);
        let window = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
        for (i, &start) in flight.starts.iter().enumerate() {
            let end = flight.starts.get(i + 1).copied().unwrap_or(flight.rows());
            add_window_sums(&mut sum, &scores, start..end, window);
        }
    }
    sum
}

/// X'W e of each row, one vector a parameter.
fn scores(flight: &FlightRows, value: &DVector<f64>, sigma: &[f64; 6], parameters: usize) -> Vec<Vec<f64>> {
    let mut scores = vec![vec![0.0; flight.rows()]; parameters];
    for axis in AXES.map(|a| a.index()) {
        let mut weighted = flight.targets[axis].clone();
        for (k, column) in flight.columns.iter().enumerate() {
            if let Some(column) = &column[axis] {
                subtract_multiple(&mut weighted, value[k], column);
            }
        }
        let weight = 1.0 / (sigma[axis] * sigma[axis]);
        weighted.iter_mut().for_each(|e| *e *= weight);
        for (score, column) in scores.iter_mut().zip(&flight.columns) {
            if let Some(column) = &column[axis] {
                add_products(score, column, &weighted);
            }
        }
    }
    scores
}

/// Adds (1 / window) sum of S S' over all windows that touch the range, S being the sum of scores in the window:
/// the Bartlett-weighted sum of autocovariances. Windows are placed every tenth of their length, which changes the
/// sum by far less than its own scatter.
fn add_window_sums(
    sum: &mut DMatrix<f64>,
    scores: &[Vec<f64>],
    range: std::ops::Range<usize>,
    window: usize,
) {
    let stride = (window / 10).max(1);
    let parameters = scores.len();
    let prefix: Vec<Vec<f64>> = scores
        .iter()
        .map(|score| {
            let mut total = 0.0;
            std::iter::once(0.0)
                .chain(score[range.clone()].iter().map(|s| {
                    total += s;
                    total
                }))
                .collect()
        })
        .collect();
    let length = range.len();
    let weight = stride as f64 / window as f64;
    let mut last = stride;
    while last < length + window {
        let (from, to) = (last.saturating_sub(window).min(length), last.min(length));
        let s = DVector::from_iterator(parameters, prefix.iter().map(|p| p[to] - p[from]));
        sum.ger(weight, &s, &s, 1.0);
        last += stride;
    }
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::prepare::Prepared;
    use crate::testing;
    use rand::{RngExt, SeedableRng};

    /// Rows of y = X c + e on axis u and, with a shared first parameter, on axis v.
    fn made_up(rows: usize, noise: impl Fn(usize) -> f64) -> FlightRows {
        let x = |k: usize, seed: f64| (0.37 * seed * k as f64).sin() + 0.2 * (0.011 * seed * k as f64).cos();
        let a: Vec<f64> = (0..rows).map(|k| x(k, 1.0)).collect();
        let b: Vec<f64> = (0..rows).map(|k| x(k, 2.3)).collect();
        let mut targets: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; rows]);
        targets[0] = (0..rows).map(|k| 3.0 * a[k] - 2.0 * b[k] + noise(k)).collect();
        targets[1] = (0..rows).map(|k| 3.0 * b[k]).collect();
        let columns =
            vec![[Some(a), Some(b.clone()), None, None, None, None], [Some(b), None, None, None, None, None]];
        FlightRows { targets, columns, starts: vec![0], period_s: 0.01 }
    }

    #[test]
    fn exact_data_gives_the_coefficients_exactly() {
        let flights = [made_up(700, |_| 0.0), made_up(333, |_| 0.0)];
        let solution = solve(&flights, &[None; 2]).unwrap();
        assert!((solution.value[0] - 3.0).abs() < 1e-12 && (solution.value[1] + 2.0).abs() < 1e-12);
    }

    #[test]
    fn agrees_with_the_normal_equations() {
        let flight = made_up(500, |k| 0.3 * (k as f64 * 1.7).sin());
        let x = DMatrix::from_fn(500, 2, |r, c| flight.columns[c][0].as_ref().unwrap()[r]);
        let y = DVector::from_vec(flight.targets[0].clone());
        let expected = (x.transpose() * &x).try_inverse().unwrap() * x.transpose() * y;
        let mut alone = flight;
        alone.columns[0][1] = None;
        alone.targets[1].fill(0.0);
        let solution = solve(&[alone], &[None; 2]).unwrap();
        assert!((solution.value - expected).norm() < 1e-12);
    }

    /// R'R is X'X whatever the blocks, here two full ones and a part.
    #[test]
    fn blocks_add_up_to_the_normal_equations() {
        let flight = made_up(2 * BLOCK_ROWS + 100, |k| 0.3 * (k as f64 * 1.7).sin());
        let AxisTriangle { triangle, .. } = axis_triangle(std::slice::from_ref(&flight), 0, 2);
        let columns = [0, 1].map(|k| flight.columns[k][0].clone().unwrap());
        let [a, b] = columns.map(DVector::from_vec);
        let x = DMatrix::from_columns(&[a, b, DVector::from_vec(flight.targets[0].clone())]);
        let (found, expected) = (triangle.transpose() * &triangle, x.transpose() * &x);
        // Sums of 600 products of numbers near 1.
        assert!((found - &expected).norm() < 1e-13 * expected.norm());
        assert!(triangle.lower_triangle().iter().filter(|v| **v != 0.0).count() <= 3, "{triangle}");
    }

    /// Triangles of shards, in any order, hold what one QR of all rows holds.
    #[test]
    fn triangles_of_shards_merge_to_that_of_all() {
        let shards: Vec<FlightRows> = [700, 333, 64, 1]
            .into_iter()
            .map(|rows| made_up(rows, |k| 0.3 * (k as f64 * 1.7).sin()))
            .collect();
        let one = axis_triangle(&shards, 0, 2).triangle;
        for order in [[0, 1, 2, 3], [3, 1, 0, 2]] {
            let mut stacked = DMatrix::zeros(12, 3);
            for (place, &shard) in order.iter().enumerate() {
                let part = axis_triangle(std::slice::from_ref(&shards[shard]), 0, 2).triangle;
                stacked.rows_mut(3 * place, 3).copy_from(&part);
            }
            let merged = stacked.qr().unpack_r();
            let solved = |r: &DMatrix<f64>| {
                r.view((0, 0), (2, 2)).solve_upper_triangular(&r.view((0, 2), (2, 1))).unwrap()
            };
            // Two ways to sum a thousand products.
            assert!(
                (solved(&merged) / solved(&one).norm() - &solved(&one) / solved(&one).norm()).norm() < 1e-10
            );
            assert!((merged[(2, 2)].abs() / one[(2, 2)].abs() - 1.0).abs() < 1e-10);
        }
    }

    /// More parameters than rows, a column that hardly differs from a constant one, and scales that are 10^12 apart.
    #[test]
    fn what_rows_do_not_determine_is_refused_and_scales_do_not_matter() {
        let column = |rows: usize, seed: f64| {
            (0..rows).map(|k| (seed * (k * k + 1) as f64).sin()).collect::<Vec<f64>>()
        };
        let flight = |columns: Vec<Vec<f64>>, rows: usize| {
            let mut targets: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; rows]);
            targets[0] = column(rows, 0.1);
            let columns = columns.into_iter().map(|c| [Some(c), None, None, None, None, None]).collect();
            FlightRows { targets, columns, starts: vec![0], period_s: 0.01 }
        };
        let many = (0..30).map(|k| column(20, 0.3 + f64::from(k))).collect();
        assert!(matches!(solve(&[flight(many, 20)], &[None; 30]), Err(Unidentifiable::Collinear(_))));
        let (one, nearly): (Vec<f64>, Vec<f64>) = (0..200).map(|k| (1.0, 1.0 + 1e-9 * f64::from(k))).unzip();
        assert_eq!(
            solve(&[flight(vec![one, nearly], 200)], &[None; 2]).unwrap_err(),
            Unidentifiable::Collinear(vec![0, 1])
        );
        let scaled = |scale: f64| {
            let small = column(200, 0.7).into_iter().map(|value| value * scale).collect();
            solve(&[flight(vec![small, column(200, 1.9)], 200)], &[None; 2]).unwrap()
        };
        let (plain, far) = (scaled(1.0), scaled(1e-12));
        assert!((far.value[0] * 1e-12 / plain.value[0] - 1.0).abs() < 1e-9 && far.value[1].is_finite());
        assert!((far.covariance[(0, 0)].sqrt() * 1e-12 / plain.covariance[(0, 0)].sqrt() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn dead_and_repeated_columns_are_refused_by_index() {
        let mut flight = made_up(200, |_| 0.1);
        flight.columns.push([None, None, Some(vec![0.0; 200]), None, None, None]);
        assert_eq!(solve(&[flight], &[None; 3]).unwrap_err(), Unidentifiable::NotExcited(2));
        let mut flight = made_up(200, |_| 0.1);
        let twice: Vec<f64> = flight.columns[1][0].as_ref().unwrap().iter().map(|v| 2.0 * v).collect();
        flight.columns.push([Some(twice), None, None, None, None, None]);
        assert_eq!(solve(&[flight], &[None; 3]).unwrap_err(), Unidentifiable::Collinear(vec![1, 2]));
    }

    /// Standard error of a slope under residuals and regressor with the same strong colour: the truth by simulation,
    /// our estimate, and the textbook's.
    #[test]
    fn errors_of_white_residuals_cover_the_truth_in_95_of_100() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(2);
        let mut white = |rows: usize| (0..rows).map(|_| rng.random::<f64>() - 0.5).collect::<Vec<f64>>();
        let runs = 4000;
        let covered = (0..runs)
            .filter(|_| {
                let (x, mut targets) = (white(3000), std::array::from_fn(|_| vec![0.0; 3000]));
                targets[0] = white(3000);
                let columns = vec![[Some(x), None, None, None, None, None]];
                let flight = FlightRows { targets, columns, starts: vec![0, 1000, 2000], period_s: 0.01 };
                let solution = solve(&[flight], &[None]).unwrap();
                solution.value[0].abs() < 1.96 * solution.covariance[(0, 0)].sqrt()
            })
            .count();
        let share = 100.0 * covered as f64 / f64::from(runs);
        // 4000 runs know the share to 0.35 %.
        assert!((93.0..97.0).contains(&share), "{share} %");
    }

    /// The regression of a craft whose coefficients are known, with white noise on its rows.
    #[test]
    fn intervals_of_a_simulated_craft_cover_its_coefficients_under_white_noise() {
        let truth = testing::truth();
        let effects: Vec<Effect> = Effect::basic().filter(|effect| truth.has(*effect)).collect();
        let known = effects.iter().flat_map(|effect| &truth.term(*effect).unwrap().coefficients);
        let known: Vec<f64> = known.map(|coefficient| coefficient.value).collect();
        let flights = [1, 2, 3].map(|seed| {
            let flight = testing::fly(&truth, seed, 24.0, &testing::NONE);
            let flight = Prepared::new(&flight, &truth.vehicle).unwrap();
            let columns = flight.columns(&effects, &truth, flight.fit_stride(), None);
            let exact: [Vec<f64>; 6] = std::array::from_fn(|axis| {
                let mut exact = vec![0.0; columns[0].iter().flatten().next().unwrap().len()];
                for (column, value) in columns.iter().zip(&known) {
                    let column = column[axis].iter().flatten();
                    exact.iter_mut().zip(column).for_each(|(sum, column)| *sum += column * value);
                }
                exact
            });
            (flight, columns, exact)
        });
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let mut covered = vec![0; known.len()];
        let runs = 200;
        for _ in 0..runs {
            let mut noisy = |(flight, columns, exact): &(Prepared, Vec<RowColumn>, [Vec<f64>; 6])| {
                let noisy = exact.clone().map(|target| {
                    target.into_iter().map(|value| value + rng.random::<f64>() - 0.5).collect::<Vec<f64>>()
                });
                flight.rows_of_fit(noisy, columns.clone())
            };
            let rows: Vec<FlightRows> = flights.iter().map(&mut noisy).collect();
            let solution = solve(&rows, &vec![None; known.len()]).unwrap();
            for (i, (covered, known)) in covered.iter_mut().zip(&known).enumerate() {
                let error = solution.covariance[(i, i)].sqrt();
                *covered += usize::from((solution.value[i] - known).abs() < 1.96 * error);
            }
        }
        let all = covered.iter().sum::<usize>() as f64 / (runs * known.len()) as f64;
        assert!((0.93..=0.97).contains(&all), "{all}");
        // One coefficient's share is known to 1.7 %, and some columns are large for moments only.
        assert!(covered.iter().all(|count| (170..=200).contains(count)), "{covered:?}");
    }

    #[test]
    fn standard_errors_hold_for_coloured_residuals() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        let mut coloured = |rows: usize| {
            let mut state = 0.0;
            (0..rows)
                .map(|_| {
                    state = 0.9 * state + (rng.random::<f64>() - 0.5);
                    state
                })
                .collect::<Vec<f64>>()
        };
        let (rows, runs) = (3000, 200);
        let (mut covered, mut by_white, mut spread, mut claimed) = (0, 0, 0.0, 0.0);
        for _ in 0..runs {
            let x = coloured(rows);
            let mut targets: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; rows]);
            targets[0] = coloured(rows);
            let columns = vec![[Some(x), None, None, None, None, None]];
            let flight = FlightRows { targets, columns, starts: vec![0, 1000, 2000], period_s: 0.01 };
            let textbook =
                solve_without_errors(std::slice::from_ref(&flight), &[None]).unwrap().covariance[(0, 0)];
            let solution = solve(&[flight], &[None]).unwrap();
            by_white += usize::from(solution.value[0].abs() < 1.96 * textbook.sqrt());
            let error = solution.covariance[(0, 0)].sqrt();
            covered += usize::from(solution.value[0].abs() < 1.96 * error);
            spread += solution.value[0].powi(2);
            claimed += error * error;
        }
        // Truth over claim within 30 %: 200 runs give the spread to about 5 %, the Bartlett window is a little short.
        let ratio = (spread / claimed).sqrt();
        assert!((0.8..1.3).contains(&ratio), "{ratio}");
        assert!((180..=196).contains(&covered), "{covered} of {runs} intervals cover the truth");
        // What the textbook says of white residuals is far too good here.
        assert!(by_white < 120, "{by_white} of {runs} intervals of white residuals cover the truth");
    }
}
