//! A form: a way to act, times one or two shapes of measured quantities.

use model::{LagId, Sample, Sink};
use sysid::fit::terms::Terms;

use crate::discovery::channels::Channel;
use crate::discovery::shapes::{Role, Shape};
use crate::discovery::variables::Variable;

/// A shape of one of the variables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Factor {
    /// Its place among the variables.
    pub(crate) variable: usize,
    pub(crate) shape: Shape,
}

/// A way to act, times shapes of measured quantities.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Form {
    pub(crate) channel: Channel,
    pub(crate) factors: Vec<Factor>,
}

impl Form {
    /// The scalar at a sample, for each rotor.
    #[inline]
    pub(crate) fn at(&self, variables: &[Variable], sample: &Sample) -> [f64; 4] {
        let of = |rotor: usize| -> f64 {
            self.factors.iter().map(|f| f.shape.at(variables[f.variable].of_rotor(sample, rotor))).product()
        };
        if self.channel.is_each_rotor() { std::array::from_fn(of) } else { [of(0); 4] }
    }

    /// What it looks back at.
    pub(crate) fn lags<'a>(&'a self, variables: &'a [Variable]) -> impl Iterator<Item = LagId> + 'a {
        self.factors.iter().flat_map(|factor| variables[factor.variable].lags())
    }

    /// Whether a further shape of a variable means something: what each rotor has of its own acts on each rotor, and the other way
    /// round.
    pub(crate) fn takes(&self, variable: &Variable) -> bool {
        let is_begun = !self.factors.is_empty();
        match (self.channel.is_each_rotor(), variable.is_own()) {
            (true, false) => is_begun,
            (each, own) => each == own,
        }
    }

    /// Parameters of its shapes: which factor, and which of its parameters.
    pub(crate) fn parameters(&self) -> Vec<(usize, usize)> {
        let of = |(index, factor): (usize, &Factor)| (0..factor.shape.count()).map(move |k| (index, k));
        self.factors.iter().enumerate().flat_map(of).collect()
    }

    /// How many coefficients it has.
    pub(crate) fn coefficients(&self) -> usize {
        self.channel.amplitudes() + self.parameters().len()
    }

    /// How many numbers are chosen for it.
    pub(crate) fn count(&self, variables: &[Variable]) -> usize {
        self.coefficients() + self.factors.iter().map(|f| variables[f.variable].count()).sum::<usize>()
    }

    pub(crate) fn value(&self, (factor, k): (usize, usize)) -> f64 {
        self.factors[factor].shape.parameters[k]
    }

    pub(crate) fn role(&self, (factor, k): (usize, usize)) -> Role {
        self.factors[factor].shape.family.parameters()[k].1
    }

    /// The form with another value of a parameter.
    pub(crate) fn with(&self, (factor, k): (usize, usize), value: f64) -> Self {
        let mut moved = self.clone();
        moved.factors[factor].shape.parameters[k] = value;
        moved
    }

    /// The form with edges for steps that are too narrow to tell from them.
    pub(crate) fn sharpened(&self, variables: &[Variable]) -> Self {
        let mut sharp = self.clone();
        for factor in &mut sharp.factors {
            factor.shape = variables[factor.variable].span.sharpened(factor.shape);
        }
        sharp
    }

    /// Where a parameter may lie.
    pub(crate) fn possible(&self, variables: &[Variable], parameter: (usize, usize)) -> [f64; 2] {
        variables[self.factors[parameter.0].variable].span.possible(self.role(parameter))
    }

    /// Step of a difference that stands for a derivative.
    pub(crate) fn step(&self, variables: &[Variable], parameter: (usize, usize)) -> f64 {
        match self.role(parameter) {
            Role::Length => 1e-5 * self.value(parameter),
            Role::Place => 1e-6 * variables[self.factors[parameter.0].variable].span.length(),
        }
    }

    /// The variables it depends on by its shapes, each once, in the order of its factors.
    pub(crate) fn variables(&self) -> Vec<usize> {
        let mut all: Vec<usize> = Vec::new();
        for factor in &self.factors {
            if !all.contains(&factor.variable) {
                all.push(factor.variable);
            }
        }
        all
    }
}

/// The terms of a form: what each amplitude multiplies, then the slope of that over each parameter of its shapes, amplitude by
/// amplitude.
pub(crate) struct FormTerms<'a> {
    forms: Vec<(Form, f64)>,
    variables: &'a [Variable],
}

impl<'a> FormTerms<'a> {
    pub(crate) fn new(form: &Form, variables: &'a [Variable]) -> Self {
        let ahead = form.parameters().into_iter().map(|parameter| {
            let step = form.step(variables, parameter);
            (form.with(parameter, form.value(parameter) + step), step)
        });
        Self { forms: std::iter::once((form.clone(), 1.0)).chain(ahead).collect(), variables }
    }
}

impl Terms for FormTerms<'_> {
    fn count(&self) -> usize {
        self.forms.len() * self.forms[0].0.channel.amplitudes()
    }

    fn lags(&self) -> Vec<LagId> {
        self.forms[0].0.lags(self.variables).collect()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let (form, _) = &self.forms[0];
        let here = form.at(self.variables, sample);
        let amplitudes = form.channel.amplitudes();
        form.channel.add(sample, here, 0, sink);
        for (index, (ahead, step)) in self.forms.iter().enumerate().skip(1) {
            let ahead = ahead.at(self.variables, sample);
            let slope = std::array::from_fn(|rotor| (ahead[rotor] - here[rotor]) / step);
            form.channel.add(sample, slope, index * amplitudes, sink);
        }
    }
}
