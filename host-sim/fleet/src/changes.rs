//! How much of each change a flight shows, with every coefficient of the model as it is: what `diagnose --changed` asks of logs, from
//! what is kept of them.
//!
//! A change is one of those that can have come about (a heavier craft, a weak motor, a shifted centre of mass, a wind ...). Its size in
//! a flight is a least squares of what the model leaves on the change's own columns, the axes weighed by what the model leaves of
//! them. Columns of adjusting effects are taken at the reference: a change that is not small against what its columns hold for comes
//! out a little too large or too small, and is no less visible.

use diagnosis::Change;
use model::{Coefficient, Effect, Model};
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sysid::fit::least_squares::short_record;

use crate::equations::{AxisEquations, Columns, Equations, place};
use crate::fit::{Estimate, Pooled};

/// How large a change is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Size {
    /// Name.
    pub name: String,
    /// Value after less that before.
    pub value: f64,
    /// Standard error, scatter between flights included.
    pub std_error: f64,
    /// Unit.
    pub unit: String,
}

/// A change that flights have columns for.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The change.
    pub change: Change,
    /// Its coefficients' places among the craft's columns.
    pub parameters: Vec<usize>,
}

impl Candidate {
    /// All that can have happened to a craft of this model, and that flights have columns for.
    pub fn all(model: &Model, columns: &Columns) -> Vec<Self> {
        // Whether a yaw is that of a rotor's push is asked of flights, not of their sums.
        let is_asked = |change: &Change| change.effect != Effect::MotorTilt;
        let with_columns = |change: Change| {
            let of_effect = columns.of(&[change.effect]);
            let parameters: Vec<usize> =
                change.coefficients().into_iter().filter_map(|k| of_effect.get(k).copied()).collect();
            (!parameters.is_empty()).then_some(Self { change, parameters })
        };
        Change::all(model).into_iter().filter(is_asked).filter_map(with_columns).collect()
    }

    /// What is said of one of its coefficients.
    pub fn coefficient(&self, columns: &Columns, place: usize) -> &'static Coefficient {
        let own = columns.parameters[self.parameters[place]];
        &own.effect.info().coefficients[own.coefficient]
    }
}

/// The model that changes are counted from.
#[derive(Debug, Clone)]
pub(crate) struct Base {
    /// Value of every column; zero of those that are not in it.
    value: Vec<f64>,
    /// What it leaves of each axis, root mean square.
    sigma: [f64; 6],
}

/// The normal equations of a change.
#[derive(Debug, Clone)]
pub(crate) struct Shown {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    scores: DMatrix<f64>,
    /// Weighted squares that the base leaves on the axes where the change acts.
    squares: f64,
    record_s: f64,
}

impl Base {
    /// A fit of some of a craft's coefficients; what it does not determine is as in the reference.
    pub(crate) fn new(columns: &Columns, parameters: &[usize], fit: &Pooled) -> Self {
        let mut value = vec![0.0; columns.parameters.len()];
        for (&k, estimate) in parameters.iter().zip(&fit.estimates) {
            value[k] = estimate.map_or(columns.parameters[k].reference, |estimate| estimate.value);
        }
        Self { value, sigma: fit.rms }
    }

    /// What it leaves of a flight on an axis, as the triangle has it.
    fn left(&self, axis: &AxisEquations) -> Vec<f64> {
        let width = axis.parameters.len();
        if axis.triangle.is_empty() {
            return Vec::new();
        }
        let mut left = axis.triangle[place(0, width)..].to_vec();
        for (at, k) in axis.parameters.iter().enumerate().filter(|(_, k)| self.value[**k] != 0.0) {
            let column = &axis.triangle[place(0, at)..=place(at, at)];
            left.iter_mut().zip(column).for_each(|(left, r)| *left -= self.value[*k] * r);
        }
        left
    }

    /// The normal equations of some candidates in a flight.
    pub(crate) fn shown(&self, flight: &Equations, candidates: &[Candidate]) -> Vec<Shown> {
        let mut all: Vec<Shown> = candidates
            .iter()
            .map(|candidate| {
                let size = candidate.parameters.len();
                let (normal, right) = (DMatrix::zeros(size, size), DVector::zeros(size));
                Shown { scores: normal.clone(), normal, right, squares: 0.0, record_s: flight.record_s }
            })
            .collect();
        for (axis, sigma) in flight.axes.iter().zip(self.sigma) {
            if !(sigma > 0.0) || axis.triangle.is_empty() {
                continue;
            }
            let left = self.left(axis);
            let squares: f64 = left.iter().map(|v| v * v).sum();
            let ratio = squares / flight.rows.max(1) as f64 / axis.sigma.max(1e-9).powi(2);
            for (candidate, shown) in candidates.iter().zip(&mut all) {
                add(shown, axis, &candidate.parameters, &left, (1.0 / (sigma * sigma), ratio, squares));
            }
        }
        all
    }
}

fn add(shown: &mut Shown, axis: &AxisEquations, parameters: &[usize], left: &[f64], of: (f64, f64, f64)) {
    let (weight, ratio, squares) = of;
    let at: Vec<Option<usize>> = parameters.iter().map(|k| axis.parameters.binary_search(k).ok()).collect();
    if at.iter().all(Option::is_none) {
        return;
    }
    let column = |at: usize| &axis.triangle[place(0, at)..=place(at, at)];
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for (r, row) in at.iter().enumerate() {
        let Some(row) = *row else { continue };
        shown.right[r] += weight * product(column(row), left);
        for (c, other) in at.iter().enumerate() {
            let Some(other) = *other else { continue };
            shown.normal[(r, c)] += weight * product(column(row), column(other));
            let scores = axis.scores[place(row.min(other), row.max(other))];
            shown.scores[(r, c)] += weight * weight * ratio * scores;
        }
    }
    shown.squares += weight * squares;
}

impl Shown {
    /// That of two flights together.
    pub(crate) fn and(mut self, other: &Self) -> Self {
        self.normal += &other.normal;
        self.right += &other.right;
        self.scores += &other.scores;
        self.squares += other.squares;
        self.record_s += other.record_s;
        self
    }

    /// The change's coefficients; nothing of one that the flight does not determine.
    pub(crate) fn estimates(&self) -> Vec<Option<Estimate>> {
        let size = self.right.len();
        let told: Vec<usize> = (0..size).filter(|k| self.normal[(*k, *k)] > 0.0).collect();
        let mut found = vec![None; size];
        let (normal, right) = self.of(&told);
        let Some(inverse) = normal.cholesky().map(|cholesky| cholesky.inverse()) else { return found };
        let value = &inverse * right;
        let scores = self.scores.select_rows(&told).select_columns(&told);
        let short = short_record(self.record_s);
        let covariance = &inverse * scores * &inverse * (short * short);
        for (at, k) in told.into_iter().enumerate() {
            let std_error = covariance[(at, at)].max(0.0).sqrt();
            found[k] = (std_error > 0.0).then_some(Estimate { value: value[at], std_error });
        }
        found
    }

    fn of(&self, told: &[usize]) -> (DMatrix<f64>, DVector<f64>) {
        (self.normal.select_rows(told).select_columns(told), self.right.select_rows(told))
    }

    /// By how much the change lowers the weighted squares, and what part of them that is.
    pub(crate) fn gain(&self) -> (f64, f64) {
        let told: Vec<usize> = (0..self.right.len()).filter(|k| self.normal[(*k, *k)] > 0.0).collect();
        let (normal, right) = self.of(&told);
        let gain = normal.cholesky().map_or(0.0, |cholesky| right.dot(&cholesky.solve(&right)));
        (gain, if self.squares > 0.0 { gain / self.squares } else { 0.0 })
    }
}
