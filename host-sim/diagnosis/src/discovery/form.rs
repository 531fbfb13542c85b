//! A form: a way to act, times one or two shapes of measured quantities.

use model::{LagId, Sample, Sink};
use nalgebra::Vector3;
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

/// Factors of a form at most.
const MOST_FACTORS: usize = 4;
/// Parameters of their shapes at most, and one.
const MOST_PARAMETERS: usize = 2 * MOST_FACTORS + 1;

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
    /// Of these terms, the first that is wanted.
    first: usize,
    /// The parameter that each of the forms but the first has another value of.
    parameters: Vec<Parameter>,
    variables: &'a [Variable],
}

impl<'a> FormTerms<'a> {
    pub(crate) fn new(form: &Form, variables: &'a [Variable]) -> Self {
        let parameters = form.parameters();
        let ahead = parameters.iter().map(|parameter| {
            let step = form.step(variables, *parameter);
            (form.with(*parameter, form.value(*parameter) + step), step)
        });
        let forms = std::iter::once((form.clone(), 1.0)).chain(ahead).collect();
        Self { forms, first: 0, parameters, variables }
    }

    /// What the amplitudes multiply, and nothing else.
    pub(crate) fn of_amplitudes(form: &Form, variables: &'a [Variable]) -> Self {
        Self { forms: vec![(form.clone(), 1.0)], first: 0, parameters: Vec::new(), variables }
    }

    /// The slopes alone.
    pub(crate) fn slopes(form: &Form, variables: &'a [Variable]) -> Self {
        Self { first: form.channel.amplitudes(), ..Self::new(form, variables) }
    }

    /// What is formed once for all parameters: ways to act whose weighted sums these terms are.
    pub(crate) fn formed_once(&self) -> FormedOnce {
        FormedOnce(self.forms[0].0.channel.parts())
    }

    /// Values that the weights are found from, at a sample: the variables of the factors, of each rotor where each has its own, and the
    /// place where there is a center.
    pub(crate) fn values(&self, sample: &Sample, values: &mut [f64]) {
        let (form, _) = &self.forms[0];
        let of = |rotor: usize| {
            form.factors.iter().map(move |f| self.variables[f.variable].of_rotor(sample, rotor))
        };
        let all = (0..self.rotors()).flat_map(of).chain(sample.input.position_ned_m.iter().copied());
        values.iter_mut().zip(all).for_each(|(own, value)| *own = value);
    }

    /// How many values these are.
    pub(crate) fn value_count(&self) -> usize {
        let (form, _) = &self.forms[0];
        self.rotors() * form.factors.len() + if form.channel.center().is_some() { 3 } else { 0 }
    }

    /// How many of the rotors have variables of their own.
    fn rotors(&self) -> usize {
        if self.forms[0].0.channel.is_each_rotor() { 4 } else { 1 }
    }

    /// What each of the ways to act that are formed once is multiplied by, term by term.
    pub(crate) fn weights(&self, values: &[f64], weights: &mut [f64]) {
        let (form, _) = &self.forms[0];
        let count = form.factors.len();
        if form.channel.center().is_some() {
            return self.weights_about_center(values, weights);
        }
        let mut scalars = [0.0; MOST_PARAMETERS];
        let scalars = &mut scalars[..self.forms.len()];
        if form.channel.is_each_rotor() {
            for rotor in 0..4 {
                self.scalars(&values[rotor * count..][..count], scalars);
                let wanted = scalars[self.first..].iter().enumerate();
                wanted.for_each(|(k, scalar)| weights[4 * k + rotor] = *scalar);
            }
            return;
        }
        self.scalars(values, scalars);
        let amplitudes = form.channel.amplitudes();
        weights.fill(0.0);
        for (k, own) in (self.first..).zip(weights.chunks_exact_mut(amplitudes)) {
            own[k % amplitudes] = scalars[k / amplitudes];
        }
    }

    /// Along north, east and down.
    fn weights_about_center(&self, values: &[f64], weights: &mut [f64]) {
        let (form, _) = &self.forms[0];
        let (values, place) = values.split_at(form.factors.len());
        let place = Vector3::from_row_slice(place);
        let force = |form: &Form| {
            let Some(center) = form.channel.center() else { return Vector3::zeros() };
            let at = |(factor, value): (&Factor, &f64)| {
                let is_distance = self.variables[factor.variable].is_distance();
                factor.shape.at(if is_distance { center.distance_m(&place) } else { *value })
            };
            center.direction_from(&place) * form.factors.iter().zip(values).map(at).product::<f64>()
        };
        let here = force(form);
        let slopes = self.forms[1..].iter().map(|(ahead, step)| (force(ahead) - here) / *step);
        let wanted = std::iter::once(here).chain(slopes).skip(self.first);
        for (own, term) in weights.chunks_exact_mut(3).zip(wanted) {
            own.copy_from_slice(term.as_slice());
        }
    }

    /// What the way to act is multiplied by: the scalar, then its slope over each parameter of the shapes, from values of the variables of
    /// the factors.
    fn scalars(&self, values: &[f64], scalars: &mut [f64]) {
        let (form, _) = &self.forms[0];
        let mut own = [1.0; MOST_FACTORS];
        for ((own, factor), value) in own.iter_mut().zip(&form.factors).zip(values) {
            *own = factor.shape.at(*value);
        }
        let here: f64 = own.iter().product();
        scalars[0] = here;
        let ahead = self.forms[1..].iter().zip(&self.parameters);
        for (scalar, ((ahead, step), parameter)) in scalars[1..].iter_mut().zip(ahead) {
            let mut there = own;
            if let Parameter::OfShape { factor, .. } = *parameter {
                there[factor] = ahead.factors[factor].shape.at(values[factor]);
            }
            *scalar = (there.iter().product::<f64>() - here) / step;
        }
    }
}

/// Ways to act that are multiplied by nothing yet.
pub(crate) struct FormedOnce(pub(crate) Vec<Channel>);

impl Terms for FormedOnce {
    fn count(&self) -> usize {
        self.0.iter().map(|channel| channel.amplitudes()).sum()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let mut first = 0;
        for channel in &self.0 {
            channel.add(sample, [1.0; 4], first, sink);
            first += channel.amplitudes();
        }
    }
}

impl Terms for FormTerms<'_> {
    fn count(&self) -> usize {
        self.forms.len() * self.forms[0].0.channel.amplitudes() - self.first
    }

    fn lags(&self) -> Vec<LagId> {
        self.forms[0].0.lags(self.variables).collect()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let (form, _) = &self.forms[0];
        let here = form.at(self.variables, sample);
        let amplitudes = form.channel.amplitudes();
        if self.first == 0 {
            form.channel.add(sample, here, 0, sink);
        }
        for (index, (ahead, step)) in self.forms.iter().enumerate().skip(1) {
            let there = ahead.at(self.variables, sample);
            let first = index * amplitudes - self.first;
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
