//! A form: a way to act, times one or two shapes of measured quantities.

use model::{LagId, Sample, Sink};
use sysid::fit::terms::Terms;

use crate::discovery::center::Center;
use crate::discovery::channels::Channel;
use crate::discovery::shapes::{Role, Shape, Span};
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

/// A number of a form that is fitted beside its amplitudes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Parameter {
    /// Where the center of its way to act is, along north, east or down.
    Center(usize),
    /// Of the shape of a factor.
    OfShape { factor: usize, number: usize },
}

impl Form {
    /// The scalar at a sample, for each rotor.
    #[inline]
    pub(crate) fn at(&self, variables: &[Variable], sample: &Sample) -> [f64; 4] {
        let of = |rotor: usize| -> f64 {
            let value = |f: &Factor| f.shape.at(self.value_of(&variables[f.variable], sample, rotor));
            self.factors.iter().map(value).product()
        };
        if self.channel.is_each_rotor() { std::array::from_fn(of) } else { [of(0); 4] }
    }

    /// A variable at a sample for a rotor, as this form sees it: distances are those from its own center.
    #[inline]
    pub(crate) fn value_of(&self, variable: &Variable, sample: &Sample, rotor: usize) -> f64 {
        match self.channel.center() {
            Some(center) if variable.is_distance() => center.distance_m(&sample.input.position_ned_m),
            _ => variable.of_rotor(sample, rotor),
        }
    }

    /// Where the variable of a factor went.
    pub(crate) fn span(&self, variables: &[Variable], factor: usize) -> Span {
        let variable = &variables[self.factors[factor].variable];
        match self.channel.center() {
            Some(center) if variable.is_distance() => variable.flown().distances(center),
            _ => variable.span,
        }
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

    /// Its parameters, in the order of its coefficients.
    pub(crate) fn parameters(&self) -> Vec<Parameter> {
        let of_center = (0..self.channel.center().map_or(0, Center::count)).map(Parameter::Center);
        let of = |(factor, own): (usize, &Factor)| {
            (0..own.shape.count()).map(move |number| Parameter::OfShape { factor, number })
        };
        of_center.chain(self.factors.iter().enumerate().flat_map(of)).collect()
    }

    /// How many coefficients it has.
    pub(crate) fn coefficients(&self) -> usize {
        self.channel.amplitudes() + self.parameters().len()
    }

    /// How many numbers are chosen for it.
    pub(crate) fn count(&self, variables: &[Variable]) -> usize {
        self.coefficients() + self.factors.iter().map(|f| variables[f.variable].count()).sum::<usize>()
    }

    pub(crate) fn value(&self, parameter: Parameter) -> f64 {
        match parameter {
            Parameter::Center(axis) => self.channel.center().map_or(f64::NAN, |own| own.place_ned_m[axis]),
            Parameter::OfShape { factor, number } => self.factors[factor].shape.parameters[number],
        }
    }

    pub(crate) fn role(&self, parameter: Parameter) -> Role {
        match parameter {
            Parameter::Center(_) => Role::Place,
            Parameter::OfShape { factor, number } => self.factors[factor].shape.family.parameters()[number].1,
        }
    }

    /// The form with another value of a parameter.
    pub(crate) fn with(&self, parameter: Parameter, value: f64) -> Self {
        let mut moved = self.clone();
        match parameter {
            Parameter::Center(axis) => {
                if let Channel::Center(center) = &mut moved.channel {
                    center.place_ned_m[axis] = value;
                }
            }
            Parameter::OfShape { factor, number } => moved.factors[factor].shape.parameters[number] = value,
        }
        moved
    }

    /// The form with edges for steps that are too narrow to tell from them.
    pub(crate) fn sharpened(&self, variables: &[Variable]) -> Self {
        let mut sharp = self.clone();
        for (index, factor) in sharp.factors.iter_mut().enumerate() {
            factor.shape = self.span(variables, index).sharpened(factor.shape);
        }
        sharp
    }

    /// Where the quantity of a parameter went.
    pub(crate) fn span_of(&self, variables: &[Variable], parameter: Parameter) -> Span {
        match parameter {
            Parameter::Center(axis) => {
                let distances = self.factors.iter().map(|f| &variables[f.variable]).find(|v| v.is_distance());
                distances.map_or(Span { low: 0.0, high: 0.0 }, |distance| distance.flown().along(axis))
            }
            Parameter::OfShape { factor, .. } => self.span(variables, factor),
        }
    }

    /// Where a parameter may lie.
    pub(crate) fn possible(&self, variables: &[Variable], parameter: Parameter) -> [f64; 2] {
        self.span_of(variables, parameter).possible(self.role(parameter))
    }

    /// Step of a difference that stands for a derivative.
    pub(crate) fn step(&self, variables: &[Variable], parameter: Parameter) -> f64 {
        match self.role(parameter) {
            Role::Length => 1e-5 * self.value(parameter),
            Role::Place => 1e-6 * self.span_of(variables, parameter).length(),
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
            let there = ahead.at(self.variables, sample);
            let first = index * amplitudes;
            if ahead.channel == form.channel {
                let slope = std::array::from_fn(|rotor| (there[rotor] - here[rotor]) / step);
                form.channel.add(sample, slope, first, sink);
            } else {
                // A center that moves turns the force.
                ahead.channel.add(sample, there.map(|value| value / step), first, sink);
                form.channel.add(sample, here.map(|value| -value / step), first, sink);
            }
        }
    }
}
