//! All candidates at once, linearised about a fitted model.
//!
//! An adjusting effect enters through the residual's derivative at zero, a linear one through its columns. Their rows are formed
//! once, a flight at a time, and reduced to triangles; what the model's own coefficients can absorb is projected out. What
//! remains is small and answers everything a diagnosis asks first: what each candidate would be worth by itself, which few
//! together are worth most ([`crate::subsets`]), which cannot be told apart. Only what looks promising here is fitted
//! exactly.
//!
//! The residual that errors are estimated from is the model's, without any candidate: while much is missing, errors come out too large
//! rather than too small.

use std::ops::Range;

use model::{Axis, Effect, Kind, Model};
use nalgebra::{DMatrix, DVector};

use crate::columns::rows_about;
use crate::subsets::{Problem, Subset};
use sysid::fit::least_squares::{AxisTriangle, FlightRows, WINDOW_S, axis_triangle, scores_covariance};
use sysid::fit::priors_of;
use sysid::prepare::Prepared;
use sysid::{Fit, FitError, Residuals, errors};

/// A coefficient this many standard errors outside the possible is inadmissible in a linearised fit.
const IMPOSSIBLE_ERRORS: f64 = 3.0;

/// Candidates linearised about a model.
pub(crate) struct Screen {
    /// In the order of `problem.groups`.
    pub(crate) candidates: Vec<Effect>,
    /// Their cross products.
    pub(crate) problem: Problem,
    /// Of each held-out flight and axis, as in `problem`.
    flights: Vec<[DMatrix<f64>; 6]>,
    /// Covariance of the scores of the candidates' columns, coloured residuals accounted for.
    meat: DMatrix<f64>,
    /// Part of each column's square that the model's own columns leave.
    pub(crate) left: Vec<f64>,
}

/// What a candidate would be worth by itself, linearised.
pub(crate) struct Single {
    pub(crate) values: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
    /// Held-out sum of squares of each axis with it over that without.
    pub(crate) ratio: [f64; 6],
    /// Weighted over the axes that the effect is judged on, percent.
    pub(crate) drop_percent: f64,
    /// Held-out flights on which the weighted error falls.
    pub(crate) flights_improved: usize,
    /// Logarithm of the held-out likelihood ratio in effectively independent rows.
    pub(crate) gain: f64,
}

/// Columns of a model's own effects and of candidates, in this order, over the residual as target.
struct Structure {
    model: Model,
    own: Vec<Effect>,
    candidates: Vec<Effect>,
}

fn is_adjusting(effect: &Effect) -> bool {
    effect.info().kind == Kind::Adjusting
}

impl Structure {
    fn of(fit: &Fit, candidates: &[Effect]) -> Self {
        Self { model: fit.model.clone(), own: fit.model.effects(), candidates: candidates.to_vec() }
    }

    fn width(effects: &[Effect]) -> usize {
        effects.iter().map(|e| e.info().coefficients.len()).sum()
    }

    fn rows(&self, flight: &Prepared) -> FlightRows {
        let all: Vec<Effect> = self.own.iter().chain(&self.candidates).copied().collect();
        rows_about(flight, &self.model, &all)
    }
}

/// A triangle over the active parameters as rows over all of them and the target.
fn embed(part: &AxisTriangle, width: usize) -> DMatrix<f64> {
    let mut full = DMatrix::zeros(part.triangle.nrows(), width + 1);
    for (from, &to) in part.parameters.iter().chain([&width]).enumerate() {
        full.column_mut(to).copy_from(&part.triangle.column(from));
    }
    full
}

impl Screen {
    /// Linearises `candidates` about a fitted model.
    pub(crate) fn new(
        fit: &Fit,
        candidates: &[Effect],
        train: &[&Prepared],
        validate: &[&Prepared],
    ) -> Result<Self, FitError> {
        let structure = Structure::of(fit, candidates);
        let own = Structure::width(&structure.own);
        let count = Structure::width(candidates);
        let (parts, meat) = training_rows(&structure, fit, train);
        let mut projection = Projection::new(&parts, own, count).ok_or(FitError::NoFlights)?;
        let (flights, effective_rows) = held_out_rows(&structure, &projection, validate);
        let mut held_out: [DMatrix<f64>; 6] = std::array::from_fn(|_| DMatrix::zeros(count + 1, count + 1));
        for flight in &flights {
            held_out.iter_mut().zip(flight).for_each(|(sum, cross)| *sum += cross);
        }
        for (k, coefficient) in coefficients(candidates).enumerate() {
            // Where the effect is not there yet, its qualifying coefficients are at zero, as expected.
            projection.train[(k, k)] += coefficient.prior.map_or(0.0, |d| 1.0 / (d * d));
        }
        let meat = projection.of_square(&meat);
        let problem = Problem {
            groups: groups(candidates),
            train: projection.train,
            held_out,
            effective_rows,
            admissible: vec![(f64::NEG_INFINITY, f64::INFINITY); count],
        };
        let mut screen =
            Self { candidates: candidates.to_vec(), problem, flights, meat, left: projection.left };
        screen.limit(&structure.model);
        Ok(screen)
    }

    /// The same without some candidates: no row is formed again.
    pub(crate) fn without(&self, out: &[Effect]) -> Self {
        let kept: Vec<usize> =
            (0..self.candidates.len()).filter(|&k| !out.contains(&self.candidates[k])).collect();
        let candidates: Vec<Effect> = kept.iter().map(|&k| self.candidates[k]).collect();
        let columns = self.problem.columns(&kept);
        let with_residual: Vec<usize> =
            columns.iter().copied().chain([self.problem.train.ncols() - 1]).collect();
        let part = |of: &DMatrix<f64>, places: &[usize]| of.select_rows(places).select_columns(places);
        let crossed = |of: &[DMatrix<f64>; 6]| of.each_ref().map(|cross| part(cross, &with_residual));
        let problem = Problem {
            groups: groups(&candidates),
            train: part(&self.problem.train, &with_residual),
            held_out: crossed(&self.problem.held_out),
            effective_rows: self.problem.effective_rows,
            admissible: columns.iter().map(|&k| self.problem.admissible[k]).collect(),
        };
        Self {
            candidates,
            problem,
            flights: self.flights.iter().map(crossed).collect(),
            meat: part(&self.meat, &columns),
            left: columns.iter().map(|&k| self.left[k]).collect(),
        }
    }

    /// Coefficients must be possible within their errors.
    fn limit(&mut self, model: &Model) {
        let has_map = model.vehicle.has_rotor_map();
        for (group, effect) in self.problem.groups.clone().into_iter().zip(&self.candidates) {
            if effect.info().is_in_rotor_speed() && !has_map {
                continue;
            }
            let columns: Vec<usize> = group.collect();
            let Some(covariance) = self.covariance(&columns) else { continue };
            for (i, (&k, c)) in columns.iter().zip(effect.info().coefficients).enumerate() {
                let slack = IMPOSSIBLE_ERRORS * covariance[(i, i)].max(0.0).sqrt();
                // A linearised step may overshoot what is possible on the far side by as much again.
                let (low, high) = c.possible;
                let reach = high - low;
                let (below, above) =
                    (if low < 0.0 { reach } else { 0.0 }, if high > 0.0 { reach } else { 0.0 });
                self.problem.admissible[k] = (low - slack - below, high + slack + above);
            }
        }
    }

    /// Of the coefficients of a set of columns, coloured residuals accounted for.
    pub(crate) fn covariance(&self, columns: &[usize]) -> Option<DMatrix<f64>> {
        let inverse = self.problem.inverse(columns)?;
        let k = columns.len();
        let meat = DMatrix::from_fn(k, k, |r, c| self.meat[(columns[r], columns[c])]);
        Some(&inverse * meat * &inverse)
    }

    /// Index of a candidate.
    pub(crate) fn index(&self, effect: Effect) -> Option<usize> {
        self.candidates.iter().position(|c| *c == effect)
    }

    /// Columns of a candidate that the flights excite at all; a height offset shows only where there is a ground effect.
    fn excited(&self, candidate: usize) -> Vec<usize> {
        let live = |&k: &usize| self.problem.train[(k, k)] > 0.0;
        self.problem.groups[candidate].clone().filter(live).collect()
    }

    /// A candidate by itself.
    pub(crate) fn single(&self, candidate: usize, (axes, sigma): (&[Axis], &[f64; 6])) -> Option<Single> {
        let columns = self.excited(candidate);
        if columns.is_empty() {
            return None;
        }
        let some = self.problem.solve(&columns)?;
        let some_covariance = self.covariance(&columns)?;
        let all: Vec<usize> = self.problem.groups[candidate].clone().collect();
        let place = |k: usize| columns.iter().position(|c| *c == k);
        let values = DVector::from_fn(all.len(), |r, _| place(all[r]).map_or(0.0, |i| some[i]));
        let covariance =
            DMatrix::from_fn(all.len(), all.len(), |r, c| match (place(all[r]), place(all[c])) {
                (Some(i), Some(j)) => some_covariance[(i, j)],
                _ => 0.0,
            });
        let is_judged = |axis: usize| axes.iter().any(|judged| judged.index() == axis);
        let mut ratio = [1.0; 6];
        let (mut before_all, mut fall, mut gain) = (0.0, 0.0, 0.0);
        let mut by_flight = vec![0.0; self.flights.len()];
        for axis in 0..6 {
            let (mut before, mut after) = (0.0, 0.0);
            for (flight, sum) in self.flights.iter().zip(&mut by_flight) {
                let (b, a) = before_and_after(&flight[axis], &all, &values);
                before += b;
                after += a;
                if is_judged(axis) {
                    *sum += (b - a) / (sigma[axis] * sigma[axis]);
                }
            }
            if !(before > 0.0 && after > 0.0) {
                continue;
            }
            ratio[axis] = after / before;
            gain -= 0.5 * self.problem.effective_rows[axis] * ratio[axis].ln();
            if is_judged(axis) {
                let weight = 1.0 / (sigma[axis] * sigma[axis]);
                before_all += weight * before;
                fall += weight * (before - after);
            }
        }
        Some(Single {
            values,
            covariance,
            ratio,
            drop_percent: if before_all > 0.0 { 100.0 * fall / before_all } else { 0.0 },
            flights_improved: by_flight.iter().filter(|fall| **fall > 0.0).count(),
            gain,
        })
    }

    /// Logarithm of the held-out likelihood ratio between two models, in effectively independent rows.
    pub(crate) fn gain(&self, before: &[Residuals], after: &[Residuals]) -> f64 {
        let (before, after) = (errors(before), errors(after));
        model::AXES
            .into_iter()
            .map(|a| 0.5 * self.problem.effective_rows[a.index()] * (before[a].sse / after[a].sse).ln())
            .filter(|ratio| ratio.is_finite())
            .sum()
    }

    /// Effects of a set with their linearised values.
    pub(crate) fn start(&self, subset: &Subset) -> Vec<(Effect, Vec<f64>)> {
        let mut values = subset.values.iter().copied();
        subset
            .members
            .iter()
            .map(|&m| (self.candidates[m], values.by_ref().take(self.problem.groups[m].len()).collect()))
            .collect()
    }
}

/// Triangles of the training flights' weighted rows with the priors of the model's own effects above
/// them, and the covariance of the scores.
fn training_rows(structure: &Structure, fit: &Fit, train: &[&Prepared]) -> (Vec<DMatrix<f64>>, DMatrix<f64>) {
    let width = Structure::width(&structure.own) + Structure::width(&structure.candidates);
    let mut parts = own_priors(structure, width);
    let mut covariance = DMatrix::zeros(width, width);
    for flight in train {
        let rows = structure.rows(flight);
        let rows = std::slice::from_ref(&rows);
        for axis in 0..6 {
            parts.push(embed(&axis_triangle(rows, axis, width), width) / fit.sigma[axis]);
        }
        covariance += scores_covariance(rows, &DVector::zeros(width), &fit.sigma, width);
    }
    (parts, covariance)
}

/// Cross products of each held-out flight and axis, and how many effectively independent rows each
/// axis has in all.
fn held_out_rows(
    structure: &Structure,
    projection: &Projection,
    validate: &[&Prepared],
) -> (Vec<[DMatrix<f64>; 6]>, [f64; 6]) {
    let width = Structure::width(&structure.own) + Structure::width(&structure.candidates);
    let mut sums = [(0.0, 0.0); 6];
    let flights = validate
        .iter()
        .map(|flight| {
            let rows = structure.rows(flight);
            std::array::from_fn(|axis| {
                let (count, coloured) = colour(&rows, axis);
                sums[axis].0 += count;
                sums[axis].1 += coloured;
                let triangle = axis_triangle(std::slice::from_ref(&rows), axis, width);
                projection.cross(&embed(&triangle, width))
            })
        })
        .collect();
    (flights, sums.map(|(count, coloured)| count * count / f64::max(coloured, count)))
}

/// Columns of each candidate.
fn groups(candidates: &[Effect]) -> Vec<Range<usize>> {
    let mut first = 0;
    candidates
        .iter()
        .map(|effect| {
            let group = first..first + effect.info().coefficients.len();
            first = group.end;
            group
        })
        .collect()
}

fn coefficients(effects: &[Effect]) -> impl Iterator<Item = &'static model::Coefficient> {
    effects.iter().flat_map(|e| e.info().coefficients)
}

/// What is known of the model's own adjusting coefficients before any flight, as rows: steps lead back to zero.
fn own_priors(structure: &Structure, width: usize) -> Vec<DMatrix<f64>> {
    let mut at = 0;
    let mut rows = Vec::new();
    for effect in &structure.own {
        if is_adjusting(effect) {
            for (k, prior) in priors_of(&structure.model, *effect).enumerate() {
                let Some(prior) = prior else { continue };
                let mut row = DMatrix::zeros(1, width + 1);
                row[(0, at + k)] = 1.0 / prior.deviation;
                row[(0, width)] = prior.expected / prior.deviation;
                rows.push(row);
            }
        }
        at += effect.info().coefficients.len();
    }
    rows
}

/// What the model's own coefficients do when a candidate's moves: columns less what the model absorbs of them.
struct Projection {
    own: usize,
    /// From coefficients of candidates and the residual to all coefficients and the residual.
    lift: DMatrix<f64>,
    /// Cross products of the candidates' columns and the residual with the model's columns projected out.
    train: DMatrix<f64>,
    left: Vec<f64>,
}

impl Projection {
    /// From weighted rows. Nothing where the model's own columns are singular.
    fn new(parts: &[DMatrix<f64>], own: usize, count: usize) -> Option<Self> {
        let height: usize = parts.iter().map(DMatrix::nrows).sum();
        let width = own + count;
        let mut stacked = DMatrix::zeros(height.max(width + 1), width + 1);
        let mut at = 0;
        for part in parts {
            stacked.rows_mut(at, part.nrows()).copy_from(part);
            at += part.nrows();
        }
        let r = stacked.qr().unpack_r();
        let absorbed =
            r.view((0, 0), (own, own)).solve_upper_triangular(&r.view((0, own), (own, count + 1)))?;
        let mut lift = DMatrix::identity(width + 1, width + 1).columns(own, count + 1).into_owned();
        lift.rows_mut(0, own).copy_from(&-absorbed);
        let rest = r.view((own, own), (count + 1, count + 1));
        let train = rest.transpose() * rest;
        let left = |k: usize| {
            let square = r.column(own + k).norm_squared();
            // Of a dead column, nothing is absorbed.
            if square > 0.0 { train[(k, k)] / square } else { 1.0 }
        };
        Some(Self { own, left: (0..count).map(left).collect(), lift, train })
    }

    /// Cross products of rows over all coefficients and the residual.
    fn cross(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let lifted = rows * &self.lift;
        lifted.transpose() * lifted
    }

    /// A square form over all coefficients as one over the candidates'.
    fn of_square(&self, form: &DMatrix<f64>) -> DMatrix<f64> {
        let width = form.nrows();
        let lift = self.lift.view((0, 0), (width, width - self.own));
        lift.transpose() * form * lift
    }
}

/// Rows of an axis, and rows times one plus twice the sum of squared autocorrelations of the residual: a variance of n such rows
/// is known as well as one of n^2 over that many independent ones (Bartlett 1946).
fn colour(rows: &FlightRows, axis: usize) -> (f64, f64) {
    let e = &rows.targets[axis];
    let n = e.len() as f64;
    let mean = e.iter().sum::<f64>() / n.max(1.0);
    let power: f64 = e.iter().map(|e| (e - mean) * (e - mean)).sum();
    if !(power > 0.0) {
        return (n, n);
    }
    let lags = (WINDOW_S / rows.period_s).round() as usize;
    let squared = |lag: usize| {
        let product: f64 = e.iter().zip(e.iter().skip(lag)).map(|(a, b)| (a - mean) * (b - mean)).sum();
        (product / power).powi(2)
    };
    (n, n * (1.0 + 2.0 * (1..=lags).map(squared).sum::<f64>()))
}

/// Sum of squares of one axis of one flight without and with coefficients.
fn before_and_after(cross: &DMatrix<f64>, columns: &[usize], values: &DVector<f64>) -> (f64, f64) {
    let residual = cross.ncols() - 1;
    let before = cross[(residual, residual)];
    let mut after = before;
    for (&r, a) in columns.iter().zip(values.iter()) {
        after -= 2.0 * a * cross[(r, residual)];
        after += a * columns.iter().zip(values.iter()).map(|(&c, b)| cross[(r, c)] * b).sum::<f64>();
    }
    (before, after)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without a pattern between -1 and 1.
    fn noise(rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |r, c| {
            let x = (12.9898 * (r + 1) as f64 + 78.233 * (c + 1) as f64).sin() * 43_758.545_3;
            2.0 * (x - x.floor()) - 1.0
        })
    }

    fn rows_of(target: Vec<f64>, period_s: f64) -> FlightRows {
        let rest = || vec![0.0; target.len()];
        FlightRows {
            targets: [target.clone(), rest(), rest(), rest(), rest(), rest()],
            columns: Vec::new(),
            starts: vec![0],
            period_s,
        }
    }

    /// Columns 0 and 1 are the model's, 2 to 4 the candidates', 5 is the residual. What the
    /// projection leaves is what a regression on the model's columns leaves.
    #[test]
    fn the_projection_leaves_what_a_regression_on_the_models_columns_leaves() {
        let all = noise(60, 6);
        let projection = Projection::new(&[all.rows(0, 25).into(), all.rows(25, 35).into()], 2, 3).unwrap();
        let own = all.columns(0, 2).into_owned();
        let others = all.columns(2, 4).into_owned();
        let absorbed = (own.transpose() * &own).cholesky().unwrap().solve(&(own.transpose() * &others));
        let rest = &others - &own * absorbed;
        let expected = rest.transpose() * &rest;
        // Sums of 60 products of numbers of one.
        assert!((&projection.train - &expected).norm() < 1e-11);
        assert!((projection.cross(&all) - &expected).norm() < 1e-11);
        for k in 0..3 {
            let part = expected[(k, k)] / others.column(k).norm_squared();
            assert!((projection.left[k] - part).abs() < 1e-12);
        }
    }

    #[test]
    fn a_copy_of_the_models_column_leaves_nothing() {
        let mut all = noise(40, 4);
        let copy = 3.0 * all.column(0);
        all.set_column(1, &copy);
        let projection = Projection::new(&[all], 1, 2).unwrap();
        assert!(projection.left[0] < 1e-12 && projection.left[1] > 0.5, "{:?}", projection.left);
    }

    #[test]
    fn sums_of_squares_are_those_of_the_residuals_themselves() {
        let all = noise(50, 4);
        let cross = all.transpose() * &all;
        let values = DVector::from_vec(vec![0.7, -1.3]);
        let (before, after) = before_and_after(&cross, &[0, 2], &values);
        let left = all.column(3) - 0.7 * all.column(0) + 1.3 * all.column(2);
        assert!((before - all.column(3).norm_squared()).abs() < 1e-12);
        assert!((after - left.norm_squared()).abs() < 1e-12);
    }

    /// The autocorrelation of numbers that alternate is (n - lag) / n up to its sign.
    #[test]
    fn rows_that_alternate_count_as_bartlett_has_it() {
        let (n, period_s) = (400, 0.05);
        let alternating = (0..n).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let lags = (WINDOW_S / period_s).round() as usize;
        let squares: f64 = (1..=lags).map(|lag| (1.0 - lag as f64 / n as f64).powi(2)).sum();
        let (rows, coloured) = colour(&rows_of(alternating, period_s), 0);
        assert_eq!(rows, n as f64);
        assert!((coloured / (n as f64 * (1.0 + 2.0 * squares)) - 1.0).abs() < 1e-12, "{coloured}");
    }

    #[test]
    fn a_residual_that_does_not_move_is_not_coloured() {
        assert_eq!(colour(&rows_of(vec![0.5; 30], 0.05), 0), (30.0, 30.0));
    }

    #[test]
    fn each_candidate_has_its_columns_after_those_before_it() {
        let candidates = [Effect::GroundEffect, Effect::SteadyWind, Effect::MotorLag];
        let groups = groups(&candidates);
        assert_eq!(groups[0].start, 0);
        for (k, effect) in candidates.iter().enumerate() {
            assert_eq!(groups[k].len(), effect.info().coefficients.len());
            assert!(k == 0 || groups[k].start == groups[k - 1].end);
        }
    }
}
