//! A form fitted exactly: its amplitudes and the parameters of its shapes beside all of the model's coefficients, by variable
//! projection, and what it is worth on each training flight when it is fitted to the others.

use model::{LagId, Sample};
use nalgebra::{DMatrix, DVector};
use sysid::Prepared;
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
    /// Of the amplitudes.
    columns: Columns,
    amplitudes: DVector<f64>,
    gain: f64,
}

/// Columns, and how much of what the model's own coefficients can take there is in them: a column of numbers for each.
#[derive(Clone)]
struct Columns {
    white: Vec<White>,
    absorbed: DMatrix<f64>,
}

impl Columns {
    fn new(problem: &Problem<'_>, white: Vec<White>) -> Self {
        let absorbed: Vec<DVector<f64>> = white.iter().map(|column| problem.absorbed(column)).collect();
        Self { absorbed: DMatrix::from_fn(problem.taken, white.len(), |k, c| absorbed[c][k]), white }
    }

    /// Their products with each other, what the model's own coefficients can take left out.
    fn gram(&self) -> DMatrix<f64> {
        gram(&self.white) - self.absorbed.tr_mul(&self.absorbed)
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
        let terms = FormTerms::new(form, variables);
        let lags: Vec<LagId> = form.lags(variables).collect();
        let of_flight = |flight: &Prepared| {
            let signals = flight.term_signals(&terms.formed_once(), problem.model)?;
            let values = |sample: &Sample, values: &mut [f64]| terms.values(sample, values);
            Some((signals, flight.quantity_signals(terms.value_count(), &lags, problem.model, values)))
        };
        Self { problem, variables, formed: problem.prepared().map(of_flight).collect() }
    }

    fn columns(&self, terms: &FormTerms<'_>) -> Columns {
        Columns::new(self.problem, self.white(terms))
    }

    fn white(&self, terms: &FormTerms<'_>) -> Vec<White> {
        let Some(formed) = &self.formed else { return self.problem.columns(terms) };
        let of_flight = |(signals, quantities): &(TermSignals, Vec<QuantitySignal>)| {
            signals.weighted(quantities, terms.count(), |values, weights| terms.weights(values, weights))
        };
        self.problem.white_columns(formed.iter().map(of_flight).collect())
    }
}

impl At {
    fn new(place: &Place<'_>, form: &Form) -> Option<Self> {
        let problem = place.problem;
        let columns = place.columns(&FormTerms::of_amplitudes(form, place.variables));
        let gram = columns.gram();
        // The residual has nothing in it that the model's own coefficients can take.
        let right = with_residual(problem, &columns.white);
        let amplitudes = gram.cholesky()?.solve(&right);
        let gain = amplitudes.dot(&right);
        gain.is_finite().then_some(Self { columns, amplitudes, gain })
    }

    /// Columns of the amplitudes, then of the parameters at these amplitudes. The form is that which this is of.
    fn jacobian(&self, place: &Place<'_>, form: &Form) -> Columns {
        if form.parameters().is_empty() {
            return self.columns.clone();
        }
        let d = self.amplitudes.len();
        let Columns { white: slopes, absorbed: of_slopes } =
            place.columns(&FormTerms::slopes(form, place.variables));
        let mut all: Vec<White> = self.columns.white.clone();
        let mut absorbed = self.columns.absorbed.clone().resize_horizontally(d + slopes.len() / d, 0.0);
        for (k, slopes) in slopes.chunks(d).enumerate() {
            let mut sum: White = Default::default();
            for (slope, amplitude) in slopes.iter().zip(self.amplitudes.iter()) {
                for (sum, values) in sum.iter_mut().zip(slope) {
                    let Some(values) = values else { continue };
                    let sum = sum.get_or_insert_with(|| vec![0.0; values.len()]);
                    sum.iter_mut().zip(values).for_each(|(s, v)| *s += amplitude * v);
                }
            }
            all.push(sum);
            absorbed.set_column(d + k, &(of_slopes.columns(k * d, d) * &self.amplitudes));
        }
        Columns { white: all, absorbed }
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
    let Place { problem, variables, .. } = *place;
    let mut here = At::new(place, &form)?;
    let parameters = form.parameters();
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        if parameters.is_empty() {
            break;
        }
        let jacobian = here.jacobian(place, &form);
        let d = here.amplitudes.len();
        let mut normal = jacobian.gram();
        // The residual is that without the form; the amplitudes' step is towards the best, from where they are.
        let mut right = with_residual(problem, &jacobian.white);
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
        match At::new(place, &ahead) {
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
fn left_out(place: &Place<'_>, (form, at): (&Form, &At)) -> (f64, usize) {
    let problem = place.problem;
    let Columns { white: mut jacobian, absorbed } = at.jacobian(place, form);
    for (column, absorbed) in jacobian.iter_mut().zip(absorbed.column_iter()) {
        problem.take_out_absorbed(column, &absorbed.into_owned());
    }
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
        for form in forms {
            let place = Place::new(&problem, &form, &variables);
            assert!(place.formed.is_some());
            let found = place.white(&FormTerms::new(&form, &variables));
            let expected = problem.columns(&FormTerms::new(&form, &variables));
            assert_eq!(found.len(), expected.len());
            let amplitudes = place.white(&FormTerms::of_amplitudes(&form, &variables));
            let slopes = place.white(&FormTerms::slopes(&form, &variables));
            assert_eq!([amplitudes, slopes].concat(), found);
            let slopes = problem.columns(&FormTerms::slopes(&form, &variables));
            assert_eq!(slopes, expected[form.channel.amplitudes()..]);
            for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
                let expected = expected.clone().unwrap_or_else(|| vec![0.0; problem.rows]);
                let found = found.clone().unwrap_or_else(|| vec![0.0; problem.rows]);
                let most = expected.iter().fold(1e-6_f64, |most, value| most.max(value.abs()));
                // Slopes are differences over a millionth of where a quantity goes.
                let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6 * most;
                let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(found.iter().zip(&expected).all(near), "{form:?}: {worst} of {most}");
            }
        }
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
        let mut white = problem.columns(&FormTerms::new(&form, &variables));
        let found = Columns::new(&problem, white.clone()).gram();
        white.iter_mut().for_each(|column| problem.take_out(column));
        let expected = gram(&white);
        assert!((&found - &expected).amax() < 1e-9 * expected.amax(), "{found} {expected}");
        assert!(
            expected[(0, 0)] < 0.999 * gram(&problem.columns(&FormTerms::new(&form, &variables)))[(0, 0)]
        );
        // Nothing of them is in the basis any more.
        assert!(white.iter().all(|column| problem.absorbed(column).amax() < 1e-6 * found[(0, 0)].sqrt()));
    }
}
