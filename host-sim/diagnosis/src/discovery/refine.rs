//! A form fitted exactly: its amplitudes and the parameters of its shapes beside all of the model's coefficients, by variable
//! projection, and what it is worth on each training flight when it is fitted to the others.

use std::borrow::Borrow;
use std::ops::Range;
use std::sync::Arc;

use model::{LagId, Sample};
use nalgebra::{DMatrix, DVector};
use sysid::Prepared;
use sysid::filter::sum_of_products;
use sysid::fit::terms::Terms;
use sysid::fit::times_hats::{QuantitySignal, TermSignals};

use crate::discovery::form::{Form, FormTerms};
use crate::discovery::problem::{Problem, White};
use crate::discovery::variables::Variable;

/// Steps of a fit at most.
const STEPS: usize = 12;
/// A step that gains less than this, in variances of the noise, ends the fit.
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
    shapes: Shapes,
    /// Of the amplitudes.
    columns: Columns,
    amplitudes: DVector<f64>,
    gain: f64,
}

/// The shapes of a form at the samples of each flight; nothing where whole columns are wanted.
type Shapes = Option<Vec<QuantitySignal>>;

/// Columns, and how much of what the model's own coefficients can take there is in them: a column of numbers for each.
#[derive(Clone)]
struct Columns {
    white: Vec<Arc<White>>,
    absorbed: DMatrix<f64>,
}

impl Columns {
    fn new(problem: &Problem<'_>, white: Vec<White>) -> Self {
        let absorbed: Vec<DVector<f64>> = white.iter().map(|column| problem.absorbed(column)).collect();
        Self {
            absorbed: DMatrix::from_fn(problem.taken, white.len(), |k, c| absorbed[c][k]),
            white: white.into_iter().map(Arc::new).collect(),
        }
    }

    fn append(&mut self, more: Self) {
        let (own, others) = (self.white.len(), more.white.len());
        self.white.extend(more.white);
        self.absorbed = std::mem::take(&mut self.absorbed).resize_horizontally(own + others, 0.0);
        self.absorbed.columns_mut(own, others).copy_from(&more.absorbed);
    }

    /// Their products with each other, what the model's own coefficients can take left out.
    fn gram(&self, problem: &Problem<'_>) -> DMatrix<f64> {
        gram(&self.white, &(0..problem.rows)) - self.absorbed.tr_mul(&self.absorbed)
    }
}

/// Where forms with one way to act and the same variables are fitted.
struct Place<'a> {
    problem: &'a Problem<'a>,
    variables: &'a [Variable],
    /// What does not depend on the parameters, in each flight; nothing where whole columns are wanted.
    formed: Option<Vec<(TermSignals, Vec<QuantitySignal>)>>,
}

impl<'a> Place<'a> {
    fn new(problem: &'a Problem<'a>, form: &Form, variables: &'a [Variable]) -> Self {
        let terms = FormTerms::of_amplitudes(form, variables);
        let lags: Vec<LagId> = form.lags(variables).collect();
        let of_flight = |flight: &Prepared| {
            let signals = flight.term_signals(terms.formed_once(), problem.model)?;
            let values = |sample: &Sample, values: &mut [f64]| terms.values(sample, values);
            Some((signals, flight.quantity_signals(terms.value_count(), &lags, problem.model, values)))
        };
        Self { problem, variables, formed: problem.prepared().map(of_flight).collect() }
    }

    fn shapes(&self, terms: &FormTerms<'_>) -> Shapes {
        let of_flight = |(_, quantities): &(TermSignals, Vec<QuantitySignal>)| {
            let shapes = |values: &[f64], shapes: &mut [f64]| terms.shapes(values, shapes);
            QuantitySignal::several(quantities, terms.shaped_count(), shapes)
        };
        self.formed.as_ref().map(|formed| formed.iter().map(of_flight).collect())
    }

    fn columns(&self, terms: &FormTerms<'_>, shapes: &Shapes) -> Columns {
        Columns::new(self.problem, self.white(terms, shapes))
    }

    fn white(&self, terms: &FormTerms<'_>, shapes: &Shapes) -> Vec<White> {
        let (Some(formed), Some(shapes)) = (&self.formed, shapes) else { return self.problem.columns(terms) };
        let of_flight = |((signals, _), shapes): (&(TermSignals, Vec<QuantitySignal>), &QuantitySignal)| {
            let weights = |shapes: &[f64], weights: &mut [f64]| terms.weights(shapes, weights);
            signals.weighted(std::slice::from_ref(shapes), terms.count(), weights)
        };
        self.problem.white_columns(formed.iter().zip(shapes).map(of_flight).collect())
    }
}

impl At {
    fn new(place: &Place<'_>, form: &Form) -> Option<Self> {
        let problem = place.problem;
        let terms = FormTerms::of_amplitudes(form, place.variables);
        let shapes = place.shapes(&terms);
        let columns = place.columns(&terms, &shapes);
        let gram = columns.gram(problem);
        // The residual has nothing in it that the model's own coefficients can take.
        let right = with_residual(problem, &columns.white, &(0..problem.rows));
        let amplitudes = gram.cholesky()?.solve(&right);
        let gain = amplitudes.dot(&right);
        gain.is_finite().then_some(Self { shapes, columns, amplitudes, gain })
    }

    /// Columns of the amplitudes, then of the parameters at these amplitudes. The form is that which this is of.
    fn jacobian(&self, place: &Place<'_>, form: &Form) -> Columns {
        let mut all = self.columns.clone();
        if !form.parameters().is_empty() {
            let slopes = FormTerms::slopes(form, self.amplitudes.as_slice(), place.variables);
            all.append(place.columns(&slopes, &self.shapes));
        }
        all
    }
}

/// The product of two columns over some rows.
fn dot<'a>(
    a: impl IntoIterator<Item = Option<&'a [f64]>>,
    b: impl IntoIterator<Item = Option<&'a [f64]>>,
    rows: &Range<usize>,
) -> f64 {
    let on_axis = |(a, b): (Option<&[f64]>, Option<&[f64]>)| {
        Some(sum_of_products(&a?[rows.clone()], &b?[rows.clone()]))
    };
    a.into_iter().zip(b).filter_map(on_axis).sum()
}

/// Columns with each other, over some rows.
fn gram(columns: &[impl Borrow<White>], rows: &Range<usize>) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(columns.len(), columns.len());
    for (r, one) in columns.iter().enumerate() {
        for (c, other) in columns.iter().enumerate().take(r + 1) {
            let product = dot(by_axis(one.borrow()), by_axis(other.borrow()), rows);
            (all[(r, c)], all[(c, r)]) = (product, product);
        }
    }
    all
}

fn with_residual(problem: &Problem<'_>, columns: &[impl Borrow<White>], rows: &Range<usize>) -> DVector<f64> {
    let residual = || problem.residual.iter().map(|axis| Some(axis.as_slice()));
    DVector::from_iterator(
        columns.len(),
        columns.iter().map(|own| dot(by_axis(own.borrow()), residual(), rows)),
    )
}

fn by_axis(column: &White) -> impl Iterator<Item = Option<&[f64]>> {
    column.iter().map(Option::as_deref)
}

/// Fits a form from where a search found it; steps that turn out to be edges as such.
pub(crate) fn refine(problem: &Problem<'_>, form: &Form, variables: &[Variable]) -> Option<Refined> {
    let place = Place::new(problem, form, variables);
    let (mut form, mut here) = settled(&place, form.clone())?;
    let sharp = form.sharpened(variables);
    if sharp != form {
        (form, here) = settled(&place, sharp)?;
    }
    let (gain_left_out, improved) = left_out(&place, (&form, &here));
    Some(Refined { form, amplitudes: here.amplitudes.iter().copied().collect(), gain_left_out, improved })
}

/// What a form takes of the residual at the parameters that fit best near where they are.
pub(crate) fn gain_of(problem: &Problem<'_>, form: &Form, variables: &[Variable]) -> Option<f64> {
    settled(&Place::new(problem, form, variables), form.clone()).map(|(_, at)| at.gain)
}

/// A form at the parameters that fit best near where they are.
fn settled(place: &Place<'_>, mut form: Form) -> Option<(Form, At)> {
    let mut here = At::new(place, &form)?;
    if form.parameters().is_empty() {
        return Some((form, here));
    }
    let mut tangent = None;
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let Some(step) = tangent.get_or_insert_with(|| Tangent::new(place, &form, &here)).step(damping)
        else {
            break;
        };
        let ahead = moved(&form, place.variables, &step.as_slice()[here.amplitudes.len()..]);
        match At::new(place, &ahead) {
            Some(there) if there.gain > here.gain => {
                let gained = there.gain - here.gain;
                (form, here, tangent) = (ahead, there, None);
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

/// Normal equations of the amplitudes and parameters of a form about where they are.
struct Tangent {
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl Tangent {
    fn new(place: &Place<'_>, form: &Form, here: &At) -> Self {
        let jacobian = here.jacobian(place, form);
        let normal = jacobian.gram(place.problem);
        // The residual is that without the form; the amplitudes' step is towards the best, from where they are.
        let mut right = with_residual(place.problem, &jacobian.white, &(0..place.problem.rows));
        right -= normal.columns(0, here.amplitudes.len()) * &here.amplitudes;
        Self { normal, right }
    }

    /// What the amplitudes and parameters move by.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let damped = &self.normal + DMatrix::from_diagonal(&(damping * self.normal.diagonal()));
        Some(damped.cholesky()?.solve(&self.right))
    }
}

/// A form with its parameters moved on, as far as one step may.
fn moved(form: &Form, variables: &[Variable], step: &[f64]) -> Form {
    form.parameters().into_iter().zip(step).fold(form.clone(), |ahead, (parameter, step)| {
        let [low, high] = form.possible(variables, parameter);
        let value = form.value(parameter);
        // A length changes by no more than half of itself, a place by no more than a part of where the quantity goes.
        let most = 0.5 * value.abs().max(0.2 * (high - low).abs() * 0.1);
        ahead.with(parameter, (value + step.clamp(-most, most)).clamp(low, high))
    })
}

/// What the form is worth on flights left out one by one, linearised about the fit to all of them.
fn left_out(place: &Place<'_>, (form, at): (&Form, &At)) -> (f64, usize) {
    let problem = place.problem;
    let Columns { white: mut jacobian, absorbed } = at.jacobian(place, form);
    for (column, absorbed) in jacobian.iter_mut().zip(absorbed.column_iter()) {
        problem.take_out_absorbed(Arc::make_mut(column), &absorbed.into_owned());
    }
    let of_flight = |rows| (gram(&jacobian, &rows), with_residual(problem, &jacobian, &rows));
    let parts: Vec<(DMatrix<f64>, DVector<f64>)> = problem.ranges().map(of_flight).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discovery::center::{About, Center};
    use crate::discovery::channels::Channel;
    use crate::discovery::form::Factor;
    use crate::discovery::shapes::{Family, Shape};
    use crate::testing::{ORDINARY, prepared, truth};

    /// A form of that way to act over some variables, a bump over each.
    fn form(channel: Channel, variables: &[Variable], indices: &[usize]) -> Form {
        let factor = |index: &usize| {
            let span = variables[*index].span;
            // How far distances from a place go is not known beforehand.
            let length = if span.length() > 0.0 { span.length() } else { 1.0 };
            let parameters = [span.low + 0.4 * length, 0.3 * length];
            Factor { variable: *index, shape: Shape { family: Family::Bump, parameters } }
        };
        Form { channel, factors: indices.iter().map(factor).collect() }
    }

    /// Terms that are evaluated sample by sample, and weighted sums of what is formed once: the same columns.
    #[test]
    fn what_is_formed_once_gives_the_columns_of_the_terms() {
        let model = truth();
        let flights = prepared(&model, 30..32, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let problem = Problem::new(&flights, &model);
        let variables = Variable::all(&flights, &model);
        let find = |of: &dyn Fn(&Variable) -> bool| variables.iter().position(of).unwrap();
        let height = find(&|variable| variable.name == "height");
        let lagged = find(&|variable| variable.lag_s().is_some() && !variable.is_own());
        let own = find(&|variable| variable.is_own() && variable.lag_s().is_some());
        let center = |about| Center { about, place_ned_m: [0.3, -0.2, -0.9] };
        let distance = |about| Variable::distance_from(&variables, center(about)).unwrap();
        let mut forms = vec![
            form(Channel::Horizontal, &variables, &[height, lagged]),
            form(Channel::Center(center(About::Point)), &variables, &[distance(About::Point), height]),
            form(Channel::Center(center(About::Around)), &variables, &[distance(About::Around)]),
        ];
        for channel in Channel::all(&model) {
            let over = if channel.is_each_rotor() { [own, height] } else { [height, lagged] };
            forms.push(form(channel, &variables, &over));
            forms.extend(channel.wider().map(|wider| form(wider, &variables, &over)));
        }
        let every = 0..problem.rows;
        for form in forms {
            let place = Place::new(&problem, &form, &variables);
            assert!(place.formed.is_some());
            let near = |found: &[White], expected: &[White], tolerance: f64, of: &str| {
                assert_eq!(found.len(), expected.len());
                for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
                    let square = |of: &White| dot(by_axis(of), by_axis(of), &every);
                    let off = square(&combined(found, 1.0, expected, -1.0)) / square(expected);
                    assert!(off < tolerance * tolerance, "{form:?}: {of} {k}: {}", off.sqrt());
                }
            };
            let amplitudes = &[0.7, -0.4][..form.channel.amplitudes()];
            let of_amplitudes = FormTerms::of_amplitudes(&form, &variables);
            let shapes = place.shapes(&of_amplitudes);
            near(&place.white(&of_amplitudes, &shapes), &problem.columns(&of_amplitudes), 1e-9, "amplitude");
            let slopes = FormTerms::slopes(&form, amplitudes, &variables);
            near(&place.white(&slopes, &shapes), &problem.columns(&slopes), 1e-9, "slope");
            // Slopes against differences of what the amplitudes multiply.
            let with = |parameter, by: f64| {
                let moved = form.with(parameter, form.value(parameter) + by);
                let columns = problem.columns(&FormTerms::of_amplitudes(&moved, &variables));
                let nothing = White::default();
                let add =
                    |sum: White, (column, amplitude): (&White, &f64)| combined(&sum, 1.0, column, *amplitude);
                columns.iter().zip(amplitudes).fold(nothing, add)
            };
            let by_difference = |parameter| {
                let step = 1e-5;
                combined(&with(parameter, step), 0.5 / step, &with(parameter, -step), -0.5 / step)
            };
            let expected: Vec<White> = form.parameters().into_iter().map(by_difference).collect();
            near(&place.white(&slopes, &shapes), &expected, 1e-6, "difference");
        }
    }

    /// A sum of two columns.
    fn combined(one: &White, by: f64, other: &White, by_other: f64) -> White {
        std::array::from_fn(|axis| match (&one[axis], &other[axis]) {
            (Some(a), Some(b)) => Some(a.iter().zip(b).map(|(a, b)| by * a + by_other * b).collect()),
            (Some(a), None) => Some(a.iter().map(|a| by * a).collect()),
            (None, Some(b)) => Some(b.iter().map(|b| by_other * b).collect()),
            (None, None) => None,
        })
    }

    /// Products of columns without what the model takes of them: formed from the columns, and from what is left of them.
    #[test]
    fn what_the_model_takes_is_left_out_of_products() {
        let model = truth();
        let flights = prepared(&model, 30..32, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let problem = Problem::new(&flights, &model);
        let variables = Variable::all(&flights, &model);
        let height = variables.iter().position(|variable| variable.name == "height").unwrap();
        let form = form(Channel::Earth(2), &variables, &[height]);
        let terms = FormTerms::slopes(&form, &[1.0], &variables);
        let mut white = problem.columns(&terms);
        let every = 0..problem.rows;
        let found = Columns::new(&problem, white.clone()).gram(&problem);
        white.iter_mut().for_each(|column| problem.take_out(column));
        let expected = gram(&white, &every);
        assert!((&found - &expected).amax() < 1e-9 * expected.amax(), "{found} {expected}");
        assert!(expected[(0, 0)] < 0.999 * gram(&problem.columns(&terms), &every)[(0, 0)]);
        // Nothing of them is in the basis any more.
        assert!(white.iter().all(|column| problem.absorbed(column).amax() < 1e-6 * found[(0, 0)].sqrt()));
    }
}
