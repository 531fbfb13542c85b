//! All forms at once: every way to act, over hats of every variable, against what the model leaves.
//!
//! A shape on the knots of the hats is a weighted sum of their columns. With the hats' cross products, what a shape would take of
//! the residual costs a few products of numbers, so that all of them are tried on the residual and on residuals of random phases.

use nalgebra::{DMatrix, DVector};

use crate::discovery::form::{Factor, Form, Hats};
use crate::discovery::problem::{Problem, White};
use crate::discovery::shapes::{Shape, Span};
use crate::discovery::variables::Variable;

/// Part of a shape's square that the model must leave.
const LEAST_LEFT: f64 = 1e-3;

/// A form and what it would take of the residual.
#[derive(Debug, Clone)]
pub(crate) struct Scored {
    pub(crate) form: Form,
    /// Numbers that are chosen for it.
    pub(crate) count: usize,
    /// Fall of the residual's squares, in variances of the noise.
    pub(crate) gain: f64,
}

impl Scored {
    /// The gain less what as many numbers cost by chance.
    pub(crate) fn worth(&self, rows: usize) -> f64 {
        self.gain - cost(self.count, rows)
    }
}

/// What fitted numbers cost (Schwarz 1978).
pub(crate) fn cost(count: usize, rows: usize) -> f64 {
    count as f64 * (rows.max(2) as f64).ln()
}

/// What was found over one variable.
pub(crate) struct Found {
    /// The best shapes of each base.
    pub(crate) best: Vec<Scored>,
    /// The greatest worth for each of the residuals of random phases.
    pub(crate) by_chance: Vec<f64>,
}

/// What columns are held against on each axis: the basis of what the model takes, then residuals. The first of these is that which the
/// model leaves, the others have its colour and random phases.
pub(crate) struct Against {
    axes: [DMatrix<f64>; 6],
    taken: usize,
}

impl Against {
    pub(crate) fn new(problem: &Problem<'_>, others: &[[Vec<f64>; 6]]) -> Self {
        let taken = problem.basis(0).ncols();
        let axes = std::array::from_fn(|axis| {
            let mut all = DMatrix::zeros(problem.rows, taken + 1 + others.len());
            all.columns_mut(0, taken).copy_from(problem.basis(axis));
            all.set_column(taken, &problem.residual[axis]);
            for (k, other) in others.iter().enumerate() {
                all.column_mut(taken + k + 1).copy_from_slice(&other[axis]);
            }
            all
        });
        Self { axes, taken }
    }

    fn residuals(&self) -> usize {
        self.axes[0].ncols() - self.taken
    }
}

/// Knots over a span.
pub(crate) fn knots(span: &Span, count: usize) -> Vec<f64> {
    (0..count).map(|k| span.low + span.length() * k as f64 / (count - 1) as f64).collect()
}

/// Cross products of the hats of one base.
struct Products {
    /// Of the hats with each other, what the model takes left out.
    gram: DMatrix<f64>,
    /// With nothing left out.
    whole: DMatrix<f64>,
    /// With the residuals.
    with_residual: DMatrix<f64>,
    amplitudes: usize,
}

/// Tries all shapes of one variable with all bases.
pub(crate) fn over_variable(
    problem: &Problem<'_>,
    against: &Against,
    (bases, variables, variable): (&[Form], &[Variable], usize),
    knot_count: usize,
) -> Found {
    let mut by_chance = vec![f64::NEG_INFINITY; against.residuals() - 1];
    let bases: Vec<Form> = bases.iter().filter(|base| base.takes(&variables[variable])).cloned().collect();
    if bases.is_empty() {
        return Found { best: Vec::new(), by_chance };
    }
    let span = variables[variable].span;
    let knots = knots(&span, knot_count);
    let hats = Hats { bases: &bases, variables, variable, knots: &knots };
    let columns = problem.columns(&hats);
    let shapes = span.shapes();
    let mut best = Vec::new();
    for (index, base) in bases.iter().enumerate() {
        let first = hats.first(index);
        let width = knots.len() * base.channel.amplitudes();
        let products =
            Products::new(problem.rows, against, &columns[first..first + width], base.channel.amplitudes());
        let mut scored: Vec<Scored> = Vec::new();
        for shape in &shapes {
            let Some(gains) = products.gains(&knots, shape) else { continue };
            let mut form = base.clone();
            form.factors.push(Factor { variable, shape: *shape });
            let count = form.count(variables);
            let numbers = cost(count, problem.rows);
            for (most, gain) in by_chance.iter_mut().zip(gains.iter().skip(1)) {
                *most = most.max(gain - numbers);
            }
            scored.push(Scored { form, count, gain: gains[0] });
        }
        best.extend(best_of_each_family(scored, problem.rows));
    }
    Found { best, by_chance }
}

/// The best two families, each by its best shape.
fn best_of_each_family(mut scored: Vec<Scored>, rows: usize) -> Vec<Scored> {
    scored.sort_by(|one, other| other.worth(rows).total_cmp(&one.worth(rows)));
    let family = |scored: &Scored| scored.form.factors.last().map(|factor| factor.shape.family);
    let mut kept: Vec<Scored> = Vec::new();
    for one in scored {
        if kept.len() < 2 && !kept.iter().any(|other| family(other) == family(&one)) {
            kept.push(one);
        }
    }
    kept
}

impl Products {
    fn new(rows: usize, against: &Against, columns: &[White], amplitudes: usize) -> Self {
        let width = columns.len();
        let mut whole = DMatrix::zeros(width, width);
        let mut products = DMatrix::zeros(width, against.axes[0].ncols());
        for axis in 0..6 {
            if columns.iter().all(|column| column[axis].is_none()) {
                continue;
            }
            let mut values = Vec::with_capacity(rows * width);
            for column in columns {
                match &column[axis] {
                    Some(of_axis) => values.extend_from_slice(of_axis),
                    None => values.extend(std::iter::repeat_n(0.0, rows)),
                }
            }
            let upright = DMatrix::from_vec(rows, width, values);
            let lying = upright.transpose();
            whole += &lying * &upright;
            products += &lying * &against.axes[axis];
        }
        let absorbed = products.columns(0, against.taken);
        let gram = &whole - absorbed * absorbed.transpose();
        let with_residual = products.columns(against.taken, against.residuals()).into_owned();
        Self { gram, whole, with_residual, amplitudes }
    }

    /// What a shape takes of each residual; nothing where the model takes the shape itself.
    fn gains(&self, knots: &[f64], shape: &Shape) -> Option<DVector<f64>> {
        let d = self.amplitudes;
        let values: Vec<f64> = knots.iter().map(|x| shape.at(*x)).collect();
        if !values.iter().all(|value| value.is_finite()) {
            return None;
        }
        let weights =
            DMatrix::from_fn(self.gram.nrows(), d, |row, k| if row % d == k { values[row / d] } else { 0.0 });
        let square = weights.tr_mul(&(&self.gram * &weights));
        let whole = weights.tr_mul(&(&self.whole * &weights));
        if (0..d).any(|k| {
            square[(k, k)].partial_cmp(&(LEAST_LEFT * whole[(k, k)])) != Some(std::cmp::Ordering::Greater)
        }) {
            return None;
        }
        let right = weights.tr_mul(&self.with_residual);
        let solved = square.cholesky()?.solve(&right);
        Some(DVector::from_fn(right.ncols(), |k, _| right.column(k).dot(&solved.column(k))))
    }
}
