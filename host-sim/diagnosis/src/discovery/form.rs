//! A form: a way to act, times one or two shapes of measured quantities.

use model::{AXES, Axis, LagId, Sample, Sink};
use nalgebra::Vector3;
use sysid::fit::terms::Terms;

use crate::discovery::center::Center;
use crate::discovery::channels::Channel;
use crate::discovery::shapes::{Role, Shape, Slopes, Span};
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
/// Values of the quantities of a form at most: those of each rotor, or those at a place.
const MOST_VALUES: usize = 4 * MOST_FACTORS + 3;
/// Numbers that say what a shape is at a sample: its value, its slope over its quantity, and those over its parameters.
const OF_SHAPE: usize = 4;
/// Values of the shapes of a form at most: those of each rotor, or those at a place.
const MOST_SHAPED: usize = OF_SHAPE * 4 * MOST_FACTORS + 3;
/// Weights of a form at most: of four parts, for the parameters of its shapes and its center.
const MOST_WEIGHTS: usize = 4 * (2 * MOST_FACTORS + 3);

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

/// Terms of a form.
pub(crate) struct FormTerms<'a> {
    form: Form,
    variables: &'a [Variable],
    wanted: Wanted,
    /// What is formed once for all parameters.
    formed_once: FormedOnce,
}

enum Wanted {
    /// What each amplitude multiplies.
    Amplitudes,
    /// The slope of the form with these amplitudes over each parameter.
    Slopes(Vec<Parameter>, Vec<f64>),
}

impl<'a> FormTerms<'a> {
    /// What each amplitude multiplies.
    pub(crate) fn of_amplitudes(form: &Form, variables: &'a [Variable]) -> Self {
        let formed_once = FormedOnce(form.channel.parts());
        Self { form: form.clone(), variables, wanted: Wanted::Amplitudes, formed_once }
    }

    /// The slopes of a form with these amplitudes, over each of its parameters.
    pub(crate) fn slopes(form: &Form, amplitudes: &[f64], variables: &'a [Variable]) -> Self {
        let wanted = Wanted::Slopes(form.parameters(), amplitudes.to_vec());
        Self { wanted, ..Self::of_amplitudes(form, variables) }
    }

    /// What is formed once for all parameters: ways to act whose weighted sums these terms are.
    pub(crate) const fn formed_once(&self) -> &FormedOnce {
        &self.formed_once
    }

    /// Values that the weights are found from, at a sample: the variables of the factors, of each rotor where each has its own, and the
    /// place where there is a center.
    pub(crate) fn values(&self, sample: &Sample, values: &mut [f64]) {
        let of = |rotor: usize| {
            let factors = self.form.factors.iter();
            factors.map(move |f| self.variables[f.variable].of_rotor(sample, rotor))
        };
        let all = (0..self.rotors()).flat_map(of).chain(sample.input.position_ned_m.iter().copied());
        values.iter_mut().zip(all).for_each(|(own, value)| *own = value);
    }

    /// How many values these are.
    pub(crate) fn value_count(&self) -> usize {
        self.rotors() * self.form.factors.len() + if self.form.channel.center().is_some() { 3 } else { 0 }
    }

    /// How many of the rotors have variables of their own.
    fn rotors(&self) -> usize {
        if self.form.channel.is_each_rotor() { 4 } else { 1 }
    }

    /// The shapes at a sample, from those values: of each rotor where each has its own; then the place where there is a center.
    pub(crate) fn shapes(&self, values: &[f64], found: &mut [f64]) {
        let (values, place) = values.split_at(self.rotors() * self.form.factors.len());
        let (found, found_place) = found.split_at_mut(OF_SHAPE * values.len());
        found_place.iter_mut().zip(place).for_each(|(own, along)| *own = *along);
        let from = self.form.channel.center().map(|center| (center, Vector3::from_row_slice(place)));
        let shapes = found.as_chunks_mut::<OF_SHAPE>().0.iter_mut().zip(values);
        for ((own, value), factor) in shapes.zip(self.form.factors.iter().cycle()) {
            let value = match &from {
                Some((center, place)) if self.is_distance(factor) => center.distance_m(place),
                _ => *value,
            };
            let Slopes { value, over_x, over } = factor.shape.slopes(value);
            *own = [value, over_x, over[0], over[1]];
        }
    }

    /// How many numbers these are.
    pub(crate) fn shaped_count(&self) -> usize {
        let of_shapes = self.rotors() * self.form.factors.len();
        self.value_count() + (OF_SHAPE - 1) * of_shapes
    }

    /// Whether a factor is of the distance from the center.
    fn is_distance(&self, factor: &Factor) -> bool {
        self.variables[factor.variable].is_distance()
    }

    /// What each of the ways to act that are formed once is multiplied by, term by term, from the shapes at a sample.
    pub(crate) fn weights(&self, shapes: &[f64], weights: &mut [f64]) {
        let count = self.form.factors.len();
        let (shapes, place) = shapes.split_at(OF_SHAPE * self.rotors() * count);
        let shapes = shapes.as_chunks::<OF_SHAPE>().0;
        if let Some(center) = self.form.channel.center() {
            return self.weights_about(center, &Product(shapes), &Vector3::from_row_slice(place), weights);
        }
        if self.form.channel.is_each_rotor() {
            for rotor in 0..4 {
                let product = Product(&shapes[rotor * count..][..count]);
                for (term, own) in weights.chunks_exact_mut(4).enumerate() {
                    own[rotor] = self.amplitude(term, 0) * self.scalar(&product, term);
                }
            }
            return;
        }
        let product = Product(shapes);
        for (term, own) in weights.chunks_exact_mut(self.form.channel.amplitudes()).enumerate() {
            let scalar = self.scalar(&product, term);
            own.iter_mut().enumerate().for_each(|(k, weight)| *weight = self.amplitude(term, k) * scalar);
        }
    }

    /// How much of a term acts by the way of an amplitude.
    fn amplitude(&self, term: usize, amplitude: usize) -> f64 {
        match &self.wanted {
            Wanted::Amplitudes => f64::from(u8::from(term == amplitude)),
            Wanted::Slopes(_, amplitudes) => amplitudes[amplitude],
        }
    }

    /// The value of the shapes, or their slope over a parameter.
    fn scalar(&self, product: &Product<'_>, term: usize) -> f64 {
        match self.parameter(term) {
            Some(Parameter::OfShape { factor, number }) => product.over(factor, number),
            Some(Parameter::Center(_)) => 0.0,
            None => product.value(),
        }
    }

    /// What a term is a slope over.
    fn parameter(&self, term: usize) -> Option<Parameter> {
        match &self.wanted {
            Wanted::Amplitudes => None,
            Wanted::Slopes(parameters, _) => Some(parameters[term]),
        }
    }

    /// Along north, east and down.
    fn weights_about(
        &self,
        center: Center,
        product: &Product<'_>,
        place: &Vector3<f64>,
        weights: &mut [f64],
    ) {
        let direction = center.direction_from(place);
        for (term, weights) in weights.chunks_exact_mut(3).enumerate() {
            let force = match self.parameter(term) {
                // A center that moves turns the force, and changes the distance.
                Some(Parameter::Center(axis)) => {
                    let (distance, turn) = center.slopes_along(axis, place);
                    let factors = self.form.factors.iter().enumerate();
                    let of_distance = factors.filter(|(_, factor)| self.is_distance(factor));
                    let over_distance: f64 = of_distance.map(|(k, _)| product.over_quantity(k)).sum();
                    turn * product.value() + direction * (over_distance * distance)
                }
                _ => direction * self.scalar(product, term),
            };
            weights.copy_from_slice((force * self.amplitude(term, 0)).as_slice());
        }
    }
}

/// The shapes of a form at a sample.
struct Product<'a>(&'a [[f64; OF_SHAPE]]);

impl Product<'_> {
    fn value(&self) -> f64 {
        self.0.iter().map(|[value, ..]| value).product()
    }

    /// With a slope in the place of the value of a factor.
    fn with(&self, factor: usize, slope: f64) -> f64 {
        let others = self.0.iter().enumerate().filter(|(k, _)| *k != factor);
        others.map(|(_, [value, ..])| value).product::<f64>() * slope
    }

    /// Its slope over a parameter of a factor.
    fn over(&self, factor: usize, number: usize) -> f64 {
        let [_, _, over @ ..] = self.0[factor];
        self.with(factor, over[number])
    }

    /// Its slope over the quantity of a factor.
    fn over_quantity(&self, factor: usize) -> f64 {
        let [_, over_quantity, ..] = self.0[factor];
        self.with(factor, over_quantity)
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
        match &self.wanted {
            Wanted::Amplitudes => self.form.channel.amplitudes(),
            Wanted::Slopes(parameters, _) => parameters.len(),
        }
    }

    fn lags(&self) -> Vec<LagId> {
        self.form.lags(self.variables).collect()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let mut formed = Formed::default();
        self.formed_once.evaluate(sample, &mut formed);
        let parts = self.formed_once.count();
        let mut values = [0.0; MOST_VALUES];
        let values = &mut values[..self.value_count()];
        self.values(sample, values);
        let mut shapes = [0.0; MOST_SHAPED];
        let shapes = &mut shapes[..self.shaped_count()];
        self.shapes(values, shapes);
        let mut weights = [0.0; MOST_WEIGHTS];
        let weights = &mut weights[..self.count() * parts];
        self.weights(shapes, weights);
        let has_several = self.form.channel.amplitudes() > 1;
        for (term, weights) in weights.chunks_exact(parts).enumerate() {
            let acts = |part: &usize| !has_several || self.amplitude(term, *part) != 0.0;
            let own = (0..parts).filter(acts);
            for (axis, by_part) in AXES.into_iter().zip(&formed.0) {
                let values = own.clone().filter_map(|part| Some(by_part[part]? * weights[part]));
                if let Some(sum) = values.reduce(|sum, value| sum + value) {
                    sink.add(axis, term, sum);
                }
            }
        }
    }
}

/// What parts of a way to act do on each axis.
#[derive(Default)]
struct Formed([[Option<f64>; 4]; 6]);

impl Sink for Formed {
    fn add(&mut self, axis: Axis, part: usize, value: f64) {
        self.0[axis.index()][part] = Some(value);
    }
}

/// For tests.
#[cfg(test)]
impl Form {
    /// A horizontal force over a bump of a variable: two amplitudes and two parameters.
    pub(crate) fn made_up(variable: usize) -> Self {
        let shape = Shape { family: crate::discovery::shapes::Family::Bump, parameters: [0.5; 2] };
        Self { channel: Channel::Horizontal, factors: vec![Factor { variable, shape }] }
    }

    /// A force along an axis of the room in proportion to a variable: one amplitude and no parameter.
    pub(crate) fn in_proportion(axis: usize, variable: usize) -> Self {
        let shape = Shape { family: crate::discovery::shapes::Family::Proportional, parameters: [0.0; 2] };
        Self { channel: Channel::Earth(axis), factors: vec![Factor { variable, shape }] }
    }
}

#[cfg(test)]
mod tests {
    use model::{Plant, State};
    use sysid::Prepared;

    use super::*;
    use crate::discovery::center::About;
    use crate::discovery::shapes::Family;
    use crate::testing::{NONE, prepared, truth};

    struct Sums(Vec<[f64; 6]>);

    impl Sink for Sums {
        fn add(&mut self, axis: Axis, term: usize, value: f64) {
            self.0[term][axis.index()] += value;
        }
    }

    /// What terms add on each axis, at a place, level, heading north, with 3 in the first further column.
    fn at_place(terms: &FormTerms<'_>, place_ned_m: [f64; 3]) -> Vec<[f64; 6]> {
        let plant = Plant::new(&truth());
        let mut input = plant.input(&State::at_rest(place_ned_m.into(), [600.0; 4]), &[600.0; 4], 11.5);
        input.further[0] = 3.0;
        let mut sums = Sums(vec![[0.0; 6]; terms.count()]);
        terms.evaluate(&plant.sample_of(&input), &mut sums);
        sums.0
    }

    fn factor(variable: usize, family: Family, parameters: [f64; 2]) -> Factor {
        Factor { variable, shape: Shape { family, parameters } }
    }

    /// (x - 1) max(0, x - 1.5) at x = 3 is 3, and its slopes over 1 and 1.5 are -1.5 and -2.
    #[test]
    fn a_form_is_the_product_of_its_shapes() {
        let variables = [Variable::made_up("x", "1", Span { low: 0.0, high: 4.0 })];
        let factors =
            vec![factor(0, Family::Straight, [1.0, 0.0]), factor(0, Family::HingeAbove, [1.5, 0.0])];
        let form = Form { channel: Channel::Body(Axis::P), factors };
        let rolled = |terms: &FormTerms<'_>| -> Vec<f64> {
            at_place(terms, [0.0; 3]).iter().map(|axes| axes[Axis::P.index()]).collect()
        };
        assert_eq!(rolled(&FormTerms::of_amplitudes(&form, &variables)), [3.0]);
        assert_eq!(rolled(&FormTerms::slopes(&form, &[0.5], &variables)), [-0.75, -1.0]);
    }

    /// A force in proportion to the distance is k (c - x): over each place of its center, its slope is k along that axis, wherever the
    /// craft is. Around an axis it is that turned: k (c_east - east) along north, and -k (c_north - north) along east.
    #[test]
    fn a_spring_follows_its_center() {
        let flights = prepared(&truth(), 1..2, 4.0, &NONE);
        let variables = Variable::all(&flights.iter().collect::<Vec<&Prepared>>(), &truth());
        for about in [About::Point, About::Around] {
            let center = Center { about, place_ned_m: [1.0, 0.5, -1.0] };
            let distance = Variable::distance_from(&variables, center).unwrap();
            let factors = vec![factor(distance, Family::Proportional, [0.0; 2])];
            let form = Form { channel: Channel::Center(center), factors };
            assert_eq!(form.coefficients(), 1 + center.count());
            // In newtons, where the craft has 1.214 kg.
            let near = |found: [f64; 6], [x, y, z]: [f64; 3]| {
                let off = |(found, expected): (f64, f64)| (1.214 * found - expected).abs();
                let is_near = found.into_iter().zip([x, y, z, 0.0, 0.0, 0.0]).map(off).all(|off| off < 1e-12);
                assert!(is_near, "{about:?}: {found:?}");
            };
            let force = at_place(&FormTerms::of_amplitudes(&form, &variables), [0.4, -0.3, -1.0]);
            let slopes = at_place(&FormTerms::slopes(&form, &[0.6], &variables), [0.4, -0.3, -1.0]);
            let (force_n, slopes_n_m) = match about {
                About::Point => ([0.6, 0.8, 0.0], vec![[0.6, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.6]]),
                _ => ([0.8, -0.6, 0.0], vec![[0.0, -0.6, 0.0], [0.6, 0.0, 0.0]]),
            };
            near(force[0], force_n);
            assert_eq!(slopes.len(), slopes_n_m.len());
            slopes.into_iter().zip(slopes_n_m).for_each(|(found, expected)| near(found, expected));
        }
    }

    #[test]
    fn parameters_are_read_and_moved_one_by_one_the_center_first() {
        let center = Center { about: About::Point, place_ned_m: [1.0, 2.0, 3.0] };
        let factors = vec![factor(0, Family::Bump, [4.0, 5.0]), factor(1, Family::Decay, [6.0, 0.0])];
        let form = Form { channel: Channel::Center(center), factors };
        let values = |form: &Form| form.parameters().iter().map(|p| form.value(*p)).collect::<Vec<f64>>();
        assert_eq!(values(&form), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        for (k, parameter) in form.parameters().into_iter().enumerate() {
            let mut expected = values(&form);
            expected[k] = -7.0;
            assert_eq!(values(&form.with(parameter, -7.0)), expected);
        }
        let roles: Vec<Role> = form.parameters().into_iter().map(|p| form.role(p)).collect();
        assert_eq!(roles[..4], [Role::Place; 4]);
        assert_eq!(roles[4..], [Role::Length; 2]);
    }
}
