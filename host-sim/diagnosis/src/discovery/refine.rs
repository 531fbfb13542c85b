//! A form fitted exactly: its amplitudes and the parameters of its shapes beside all of the model's coefficients, by variable
//! projection, and what it is worth on each training flight when it is fitted to the others.

use nalgebra::{DMatrix, DVector};

use crate::discovery::form::{Form, FormTerms};
use crate::discovery::problem::{Problem, White};
use crate::discovery::variables::Variable;

/// Steps of a fit at most.
const STEPS: usize = 12;
/// A step that gains less than this ends the fit.
const CONVERGED: f64 = 1e-2;

/// A form as fitted.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub(crate) form: Form,
    /// Of each amplitude.
    pub(crate) amplitudes: Vec<f64>,
    /// Fall of the residual's squares on flights left out one by one, each with a fit to the others, in variances of the noise.
    pub(crate) gain_left_out: f64,
    /// Flights left out on which the squares fall.
    pub(crate) improved: usize,
}

/// A form at its parameters: the amplitudes that fit best, and what they take.
struct At {
    columns: Vec<White>,
    amplitudes: DVector<f64>,
    gain: f64,
}

impl At {
    fn new(problem: &Problem<'_>, form: &Form, variables: &[Variable]) -> Option<Self> {
        let mut columns = problem.columns(&FormTerms::new(form, variables));
        columns.iter_mut().for_each(|column| problem.take_out(column));
        let d = form.channel.amplitudes();
        let gram = gram(&columns[..d]);
        let right = with_residual(problem, &columns[..d]);
        let amplitudes = gram.cholesky()?.solve(&right);
        let gain = amplitudes.dot(&right);
        gain.is_finite().then_some(Self { columns, amplitudes, gain })
    }

    /// Columns of the amplitudes, then of the parameters at these amplitudes.
    fn jacobian(&self) -> Vec<White> {
        let d = self.amplitudes.len();
        let mut all: Vec<White> = self.columns[..d].to_vec();
        for slopes in self.columns[d..].chunks(d) {
            let mut sum: White = Default::default();
            for (slope, amplitude) in slopes.iter().zip(self.amplitudes.iter()) {
                for (sum, values) in sum.iter_mut().zip(slope) {
                    let Some(values) = values else { continue };
                    let sum = sum.get_or_insert_with(|| vec![0.0; values.len()]);
                    sum.iter_mut().zip(values).for_each(|(s, v)| *s += amplitude * v);
                }
            }
            all.push(sum);
        }
        all
    }
}

fn dot(a: &White, b: &White) -> f64 {
    a.iter()
        .zip(b)
        .filter_map(|(a, b)| Some(a.as_ref()?.iter().zip(b.as_ref()?).map(|(a, b)| a * b).sum::<f64>()))
        .sum()
}

fn gram(columns: &[White]) -> DMatrix<f64> {
    DMatrix::from_fn(columns.len(), columns.len(), |r, c| dot(&columns[r], &columns[c]))
}

fn with_residual(problem: &Problem<'_>, columns: &[White]) -> DVector<f64> {
    let of = |column: &White| {
        column
            .iter()
            .zip(&problem.residual)
            .filter_map(|(c, e)| Some(c.as_ref()?.iter().zip(e.iter()).map(|(c, e)| c * e).sum::<f64>()))
            .sum::<f64>()
    };
    DVector::from_iterator(columns.len(), columns.iter().map(of))
}

/// Fits a form from where a search found it; steps that turn out to be edges as such.
pub(crate) fn refine(problem: &Problem<'_>, form: &Form, variables: &[Variable]) -> Option<Refined> {
    let (mut form, mut here) = settled(problem, form.clone(), variables)?;
    let sharp = form.sharpened(variables);
    if sharp != form {
        (form, here) = settled(problem, sharp, variables)?;
    }
    let (gain_left_out, improved) = left_out(problem, &here);
    Some(Refined { form, amplitudes: here.amplitudes.iter().copied().collect(), gain_left_out, improved })
}

/// A form at the parameters that fit best near where they are.
fn settled(problem: &Problem<'_>, mut form: Form, variables: &[Variable]) -> Option<(Form, At)> {
    let mut here = At::new(problem, &form, variables)?;
    let parameters = form.parameters();
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        if parameters.is_empty() {
            break;
        }
        let jacobian = here.jacobian();
        let d = here.amplitudes.len();
        let mut normal = gram(&jacobian);
        // The residual is that without the form; the amplitudes' step is towards the best, from where they are.
        let mut right = with_residual(problem, &jacobian);
        for k in 0..right.len() {
            right[k] -= (0..d).map(|j| normal[(k, j)] * here.amplitudes[j]).sum::<f64>();
        }
        for k in 0..normal.nrows() {
            normal[(k, k)] *= 1.0 + damping;
        }
        let Some(step) = normal.cholesky().map(|factor| factor.solve(&right)) else { break };
        let mut ahead = form.clone();
        for (k, parameter) in parameters.iter().enumerate() {
            let [low, high] = form.possible(variables, *parameter);
            let value = form.value(*parameter);
            // A length changes by no more than half of itself, a place by no more than a part of where the quantity goes.
            let most = 0.5 * value.abs().max(0.2 * (high - low).abs() * 0.1);
            let moved = value + step[d + k].clamp(-most, most);
            ahead = ahead.with(*parameter, moved.clamp(low, high));
        }
        match At::new(problem, &ahead, variables) {
            Some(there) if there.gain > here.gain => {
                let gained = there.gain - here.gain;
                (form, here) = (ahead, there);
                damping = f64::max(0.1 * damping, 1e-6);
                if gained < CONVERGED {
                    break;
                }
            }
            _ if damping > 1e3 => break,
            _ => damping *= 10.0,
        }
    }
    Some((form, here))
}

/// What the form is worth on flights left out one by one, linearised about the fit to all of them.
fn left_out(problem: &Problem<'_>, at: &At) -> (f64, usize) {
    let jacobian = at.jacobian();
    let parts: Vec<(DMatrix<f64>, DVector<f64>)> = problem
        .ranges()
        .map(|range| {
            let cut = |values: &Option<Vec<f64>>| values.as_ref().map(|v| v[range.clone()].to_vec());
            let columns: Vec<White> = jacobian.iter().map(|column| column.each_ref().map(cut)).collect();
            let rest: White = problem.residual.each_ref().map(|e| Some(e.as_slice()[range.clone()].to_vec()));
            (gram(&columns), DVector::from_iterator(columns.len(), columns.iter().map(|c| dot(c, &rest))))
        })
        .collect();
    let (mut sum, mut improved) = (0.0, 0);
    for left in 0..parts.len() {
        let others = parts.iter().enumerate().filter(|(k, _)| *k != left);
        let mut normal = DMatrix::zeros(jacobian.len(), jacobian.len());
        let mut right = DVector::zeros(jacobian.len());
        for (_, (gram, with)) in others {
            normal += gram;
            right += with;
        }
        normal += DMatrix::from_diagonal(&(1e-9 * normal.diagonal()));
        let Some(factor) = normal.cholesky() else { return (f64::NEG_INFINITY, 0) };
        let step = factor.solve(&right);
        let (gram, with) = &parts[left];
        let gain = 2.0 * step.dot(with) - step.dot(&(gram * &step));
        sum += gain;
        improved += usize::from(gain > 0.0);
    }
    (sum, improved)
}
