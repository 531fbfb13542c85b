//! A form as an effect of a user: formulas with units, coefficients with where they may lie.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

use model::user_effects::{CoefficientDefinition, ColumnDefinition, ConstantDefinition, Definition};

use crate::discovery::chosen::{Chosen, Spelling};
use crate::discovery::form::{Factor, Form, Parameter};
use crate::discovery::refine::Refined;
use crate::discovery::shapes::Role;
use crate::discovery::variables::Variable;

/// An amplitude may be so many times what was found.
const AMPLITUDE_REACH: f64 = 20.0;

/// How much longer the second lag is that stands for the slope of the first over its time.
const LONGER: f64 = 1.1;
/// A time of a lag may be so many times what was found.
const LAG_REACH: f64 = 5.0;

/// Forms that act together, as one effect, and the values that were found of its coefficients.
pub(crate) struct Defined {
    pub(crate) definition: Definition,
    /// In the order of its coefficients.
    pub(crate) values: Vec<f64>,
    /// Their units for people: of commands where these stand in for rotor speeds.
    pub(crate) units: Vec<String>,
    /// The bearings and the times of lags among its coefficients.
    pub(crate) chosen: Vec<ChosenCoefficient>,
}

/// A bearing or the time of a lag that is a coefficient.
pub(crate) struct ChosenCoefficient {
    /// Its place among the coefficients.
    pub(crate) place: usize,
    /// Its variable: the term, and which of its factors.
    pub(crate) of: [usize; 2],
}

/// The effect that acts as forms do together.
pub(crate) fn define(id: &str, sentence: String, terms: &[Refined], variables: &[Variable]) -> Defined {
    written(id, sentence, (terms, variables), false)
}

/// The same with the bearings and the times of lags among the coefficients.
pub(crate) fn define_free(id: &str, sentence: String, terms: &[Refined], variables: &[Variable]) -> Defined {
    written(id, sentence, (terms, variables), true)
}

fn written(
    id: &str,
    sentence: String,
    (terms, variables): (&[Refined], &[Variable]),
    is_free: bool,
) -> Defined {
    let mut rows: BTreeMap<String, String> = BTreeMap::new();
    let names = Names { taken: Vec::new() };
    let mut own =
        Written { variables, names, constant: constants(terms), numbers: Vec::new(), chosen: Vec::new() };
    for (place, term) in terms.iter().enumerate() {
        let form = &term.form;
        let amplitudes = own.amplitudes(term);
        let center = own.center(form);
        let factors = 0..form.factors.len();
        let named: Vec<Named> = factors.map(|factor| own.factor(form, [place, factor], is_free)).collect();
        for row in form.channel.rows(&center) {
            let shapes = shapes_text(form, variables, (&center, &named), row.rotor);
            let text = format!("{}{}{shapes}{}", row.before, amplitudes[row.amplitude], row.after);
            rows.entry(row.row.to_owned()).and_modify(|sum| sum.push_str(&joined(&text))).or_insert(text);
        }
    }
    let Written { constant, numbers, chosen, .. } = own;
    let values = numbers.iter().map(|number| number.value).collect();
    let units = numbers.iter().map(|number| number.unit.clone()).collect();
    let definition = Definition {
        id: id.to_owned(),
        sentence: Some(sentence),
        excitation: None,
        acceleration: rows,
        confused_with: BTreeMap::new(),
        coefficient: numbers.into_iter().map(|number| number.definition).collect(),
        constant,
        column: columns(terms, variables),
    };
    Defined { definition, values, units, chosen }
}

/// A coefficient, its value, and its unit for people.
struct Number {
    definition: CoefficientDefinition,
    value: f64,
    unit: String,
}

/// What a definition has so far.
struct Written<'a> {
    variables: &'a [Variable],
    names: Names,
    constant: Vec<ConstantDefinition>,
    numbers: Vec<Number>,
    chosen: Vec<ChosenCoefficient>,
}

impl Written<'_> {
    fn put(&mut self, definition: CoefficientDefinition, value: f64, unit: String) {
        self.numbers.push(Number { definition, value, unit });
    }

    /// Adds a constant: its name.
    fn constant(&mut self, name: &str, unit: &str, value: f64) -> String {
        let name = self.names.new_one(name);
        self.constant.push(ConstantDefinition { name: name.clone(), unit: unit.to_owned(), value });
        name
    }

    /// Adds the amplitudes of a term: their names.
    fn amplitudes(&mut self, term: &Refined) -> Vec<String> {
        let form = &term.form;
        let names: Vec<String> =
            form.channel.amplitude_names().iter().map(|name| self.names.new_one(name)).collect();
        for (name, value) in names.iter().zip(&term.amplitudes) {
            let reach = AMPLITUDE_REACH * value.abs();
            let unit = amplitude_unit(form, self.variables, |variable| variable.unit.as_str());
            let possible = [-reach, reach];
            let definition =
                CoefficientDefinition { name: name.clone(), unit, possible, typical: value.abs() };
            self.put(definition, *value, amplitude_unit(form, self.variables, Variable::unit_for_people));
        }
        names
    }

    /// Adds where the center of a form is: the names of its numbers.
    fn center(&mut self, form: &Form) -> Vec<String> {
        let of_center = form.channel.center().map_or(&[][..], |own| own.about.names());
        let names: Vec<String> = of_center.iter().map(|name| self.names.new_one(name)).collect();
        for (axis, name) in names.iter().enumerate() {
            let parameter = Parameter::Center(axis);
            let definition = fitted(form, self.variables, parameter, (name.clone(), "m"));
            self.put(definition, form.value(parameter), "m".to_owned());
        }
        names
    }

    /// Adds a factor: the names of its numbers.
    fn factor(&mut self, form: &Form, of @ [_, index]: [usize; 2], is_free: bool) -> Named {
        let factor = &form.factors[index];
        let (family, variable) = (factor.shape.family, &self.variables[factor.variable]);
        let mut names: Vec<String> =
            family.parameters().iter().map(|(name, _)| self.names.new_one(name)).collect();
        for (number, name) in names.iter().enumerate() {
            let parameter = Parameter::OfShape { factor: index, number };
            let definition = fitted(form, self.variables, parameter, (name.clone(), &variable.unit));
            self.put(definition, form.value(parameter), variable.unit_for_people().to_owned());
        }
        if let Some(held) = family.held() {
            let value = factor.shape.parameters[family.parameters().len()];
            names.push(self.constant(held, &variable.unit, value));
        }
        (names, self.spelling(variable, of, is_free))
    }

    /// How a formula spells the number of a variable that was chosen with the form: a constant, or a coefficient where it is free.
    fn spelling(&mut self, variable: &Variable, of: [usize; 2], is_free: bool) -> Spelling {
        let (name, unit, value, possible, typical) = match variable.chosen() {
            None => return Spelling::Plain,
            Some(Chosen::BearingDeg(_)) if !is_free => return Spelling::Plain,
            Some(Chosen::LagS(time_s) | Chosen::TwoLagsS(time_s)) if !is_free => {
                return Spelling::Constant(self.constant("memory", "s", time_s));
            }
            Some(Chosen::BearingDeg(degrees)) => {
                let value = degrees.to_radians();
                ("bearing", "rad", value, [value - FRAC_PI_2, value + FRAC_PI_2], 1.0)
            }
            Some(Chosen::LagS(time_s) | Chosen::TwoLagsS(time_s)) => {
                ("memory", "s", time_s, [time_s / LAG_REACH, LAG_REACH * time_s], time_s)
            }
        };
        let name = self.names.new_one(name);
        self.chosen.push(ChosenCoefficient { place: self.numbers.len(), of });
        let definition =
            CoefficientDefinition { name: name.clone(), unit: unit.to_owned(), possible, typical };
        self.put(definition, value, unit.to_owned());
        match variable.chosen() {
            Some(Chosen::LagS(_) | Chosen::TwoLagsS(_)) => {
                let from = self.constant("from_memory", "s", value);
                let to = self.constant("to_memory", "s", LONGER * value);
                Spelling::Between { time: name, from, to }
            }
            _ => Spelling::Bearing(name),
        }
    }
}

/// Names of the parameters of a shape, and how its variable is spelt.
type Named = (Vec<String>, Spelling);

/// The shapes of a form as factors, with the names of their parameters.
fn shapes_text(
    form: &Form,
    variables: &[Variable],
    (center, named): (&[String], &[Named]),
    rotor: Option<usize>,
) -> String {
    let shape = |(factor, (names, spelling)): (&Factor, &Named)| {
        let variable = &variables[factor.variable];
        let text = match form.channel.center() {
            Some(own) if variable.is_distance() => own.about.distance(center).into(),
            _ => variable.formula(rotor, spelling),
        };
        format!(" * {}", factor.shape.formula(&text, names))
    };
    form.factors.iter().zip(named).map(shape).collect()
}

/// A further term of a row.
fn joined(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(rest) => format!(" - {rest}"),
        None => format!(" + {text}"),
    }
}

/// Constants of the ways to act, each once.
fn constants(terms: &[Refined]) -> Vec<ConstantDefinition> {
    let mut all: Vec<ConstantDefinition> = Vec::new();
    for (name, unit, value) in terms.iter().flat_map(|term| term.form.channel.constants()) {
        if !all.iter().any(|constant| constant.name == name) {
            all.push(ConstantDefinition { name, unit: unit.into(), value });
        }
    }
    all
}

/// Columns that have to be declared.
fn columns(terms: &[Refined], variables: &[Variable]) -> Vec<ColumnDefinition> {
    let mut all: Vec<ColumnDefinition> = Vec::new();
    for variable in terms.iter().flat_map(|term| term.form.variables()).map(|index| &variables[index]) {
        if variable.declared && !all.iter().any(|column| column.name == variable.name) {
            all.push(ColumnDefinition { name: variable.name.to_owned(), unit: variable.unit.clone() });
        }
    }
    all
}

/// The definition of a parameter of this name and unit.
fn fitted(
    form: &Form,
    variables: &[Variable],
    parameter: Parameter,
    (name, unit): (String, &str),
) -> CoefficientDefinition {
    CoefficientDefinition {
        name,
        unit: unit.to_owned(),
        possible: form.possible(variables, parameter),
        typical: typical(form, variables, parameter),
    }
}

/// An ordinary magnitude of a parameter: that which was found, or a part of where its quantity goes.
fn typical(form: &Form, variables: &[Variable], parameter: Parameter) -> f64 {
    let value = form.value(parameter).abs();
    match form.role(parameter) {
        Role::Length => value,
        Role::Place => value.max(1e-3 * form.span_of(variables, parameter).length()),
    }
}

/// Names that are not given twice.
struct Names {
    taken: Vec<String>,
}

impl Names {
    fn new_one(&mut self, name: &str) -> String {
        let numbered = (2..).map(|k| format!("{name}_{k}"));
        let free = std::iter::once(name.to_owned()).chain(numbered).find(|name| !self.taken.contains(name));
        let name = free.unwrap_or_else(|| name.to_owned());
        self.taken.push(name.clone());
        name
    }
}

/// Unit of the amplitudes of a form: that of its way to act over those of its shapes.
fn amplitude_unit(form: &Form, variables: &[Variable], of: impl Fn(&Variable) -> &str) -> String {
    let mut unit = Unit::default();
    unit.take(form.channel.unit(), 1);
    for factor in &form.factors {
        unit.take(of(&variables[factor.variable]), -factor.shape.family.power());
    }
    unit.text()
}

/// A unit by the powers of its parts, in the order in which they came.
#[derive(Default)]
struct Unit {
    parts: Vec<(String, i32)>,
}

impl Unit {
    /// Multiplies by a power of a unit such as `N s/m` or `1/(kg m^2)`.
    fn take(&mut self, unit: &str, power: i32) {
        let (above, below) = unit.split_once('/').unwrap_or((unit, ""));
        for (side, sign) in [(above, 1), (below, -1)] {
            for part in side.trim_matches(['(', ')']).split_whitespace().filter(|part| *part != "1") {
                let (name, own) = part.split_once('^').unwrap_or((part, "1"));
                let all = sign * power * own.parse::<i32>().unwrap_or(1);
                match self.parts.iter_mut().find(|(known, _)| known == name) {
                    Some((_, sum)) => *sum += all,
                    None => self.parts.push((name.to_owned(), all)),
                }
            }
        }
    }

    fn text(&self) -> String {
        let side = |sign: i32| -> Vec<String> {
            let of = self.parts.iter().filter(|(_, power)| power * sign > 0);
            of.map(|(name, power)| match power.abs() {
                1 => name.clone(),
                more => format!("{name}^{more}"),
            })
            .collect()
        };
        let above = match side(1) {
            none if none.is_empty() => "1".to_owned(),
            some => some.join(" "),
        };
        match &side(-1)[..] {
            [] => above,
            [one] => format!("{above}/{one}"),
            several => format!("{above}/({})", several.join(" ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use model::user_effects::file_of;
    use model::{Axis, MotorMapKind};

    use super::*;
    use crate::discovery::center::{About, Center};
    use crate::discovery::channels::Channel;
    use crate::discovery::shapes::{Family, Shape};
    use crate::testing::{ORDINARY, fly, truth};

    /// Over every variable that flights have, with rotor speeds and with commands in their place, a form is an effect that users could
    /// have written.
    #[test]
    fn a_form_over_any_variable_is_an_effect_of_users() {
        crate::workflow::prepare_to_discover();
        let flown = fly(&truth(), 1, 6.0, &ORDINARY);
        let mut by_command = truth();
        let motors = &mut by_command.vehicle.motors;
        (motors.map, motors.command, motors.voltage, motors.offset) =
            (Some(MotorMapKind::Identify), None, None, None);
        for model in [truth(), by_command] {
            let flight = sysid::Prepared::new(&flown, &model.vehicle).unwrap();
            let variables = Variable::all(&[&flight], &model);
            assert!(variables.len() > 80);
            for variable in 0..variables.len() {
                let each = || Channel::all(&truth()).into_iter().find(|channel| channel.is_each_rotor());
                let about = [About::Point, About::Axis, About::Around]
                    .map(|about| Center { about, place_ned_m: [0.3, -0.2, 0.1] })
                    .into_iter()
                    .find(|center| Variable::distance_from(&variables, *center) == Some(variable));
                let channel = match about {
                    Some(center) => Channel::Center(center),
                    None if variables[variable].is_own() => each().unwrap(),
                    None => Channel::Body(Axis::W),
                };
                for family in [Family::Proportional, Family::Growth] {
                    let shape = Shape { family, parameters: [0.3, 1.2] };
                    let form = Form { channel, factors: vec![Factor { variable, shape }] };
                    let term = Refined { form, amplitudes: vec![0.1], gain_left_out: 0.0, improved: 0 };
                    let defined = define("form", "A form.".into(), &[term], &variables);
                    let file = file_of(vec![defined.definition]);
                    let drafted = model::effects::draft(&file, Path::new("test"));
                    assert!(drafted.is_ok(), "{drafted:?}: {file}");
                }
            }
        }
    }

    /// About a point, an axis and around one, an effect does at every place what the form does.
    #[test]
    fn a_form_about_a_center_is_what_its_formula_says() {
        let flown = fly(&truth(), 1, 6.0, &ORDINARY);
        let flight = sysid::Prepared::new(&flown, &truth().vehicle).unwrap();
        let variables = Variable::all(&[&flight], &truth());
        for about in [About::Point, About::Axis, About::Around] {
            let center = Center { about, place_ned_m: [0.3, -0.2, 0.1] };
            let distance = Variable::distance_from(&variables, center).unwrap();
            let shape = Shape { family: Family::Bump, parameters: [0.4, 0.7] };
            let factors = vec![Factor { variable: distance, shape }];
            let form = Form { channel: Channel::Center(center), factors };
            let term = Refined { form: form.clone(), amplitudes: vec![0.6], gain_left_out: 0.0, improved: 0 };
            let defined = define("form", "A form.".into(), &[term], &variables);
            let file = file_of(vec![defined.definition]);
            let [user] = model::effects::draft(&file, Path::new("test")).unwrap()[..] else {
                panic!("{file}")
            };
            let mut with = truth();
            with.set(model::Effect::User(user), &defined.values);
            let [without, with] = [truth(), with].map(|model| model::Plant::new(&model));
            for [north, east, down] in [[0.0, 0.0, -1.0], [0.9, -0.2, -0.4], [-0.6, 0.5, -1.7]] {
                let mut state = model::State::at_rest(nalgebra::Vector3::new(north, east, down), [600.0; 4]);
                state.attitude = nalgebra::Vector4::new(0.8, 0.2, -0.1, 0.5).normalize();
                let by = |plant: &model::Plant| {
                    plant.accelerations(&plant.sample_of(&plant.input(&state, &[600.0; 4], 11.5)))
                };
                let mut expected = Rows([0.0; 6]);
                let input = without.input(&state, &[600.0; 4], 11.5);
                let sample = without.sample_of(&input);
                form.channel.add(
                    &sample,
                    form.at(&variables, &sample).map(|value| 0.6 * value),
                    0,
                    &mut expected,
                );
                let (with, without) = (by(&with), by(&without));
                for (axis, expected) in expected.0.into_iter().enumerate() {
                    assert!((with[axis] - without[axis] - expected).abs() < 1e-9, "{about:?} {axis}");
                }
            }
        }
    }

    struct Rows([f64; 6]);

    impl model::Sink for Rows {
        fn add(&mut self, axis: Axis, _: usize, value: f64) {
            self.0[axis.index()] += value;
        }
    }

    /// The most that terms of a formula can name: what each rotor has of its own, by two shapes with all of their parameters.
    #[test]
    fn terms_that_act_on_each_rotor_join_in_one_effect() {
        let flown = fly(&truth(), 1, 6.0, &ORDINARY);
        let flight = sysid::Prepared::new(&flown, &truth().vehicle).unwrap();
        let variables = Variable::all(&[&flight], &truth());
        let channel = Channel::all(&truth()).into_iter().find(|channel| channel.is_each_rotor()).unwrap();
        let own: Vec<usize> = (0..variables.len()).filter(|k| variables[*k].is_own()).collect();
        let shape = |family| Shape { family, parameters: [0.3, 1.2] };
        let term = |k: usize, families: [Family; 2]| {
            let factors = families.map(|family| Factor { variable: own[k], shape: shape(family) }).into();
            let form = Form { channel, factors };
            Refined { form, amplitudes: vec![0.1], gain_left_out: 0.0, improved: 0 }
        };
        let last = own.len() - 1;
        let terms =
            [term(last, [Family::Bump, Family::Decay]), term(last - 1, [Family::Step, Family::Growth])];
        let file = file_of(vec![define("form", "Terms.".into(), &terms, &variables).definition]);
        let checked = model::effects::check(&file, Path::new("test"));
        assert!(checked.is_ok(), "{checked:?}: {file}");
    }

    #[test]
    fn names_are_not_given_twice() {
        let mut names = Names { taken: Vec::new() };
        let given: Vec<String> =
            ["k", "width", "k", "k"].into_iter().map(|name| names.new_one(name)).collect();
        assert_eq!(given, ["k", "width", "k_2", "k_3"]);
    }

    #[test]
    fn units_are_written_as_people_write_them() {
        let unit = |parts: &[(&str, i32)]| {
            let mut unit = Unit::default();
            parts.iter().for_each(|(part, power)| unit.take(part, *power));
            unit.text()
        };
        assert_eq!(unit(&[("N", 1), ("m", -1)]), "N/m");
        assert_eq!(unit(&[("N s/m", 1), ("m/s", -1)]), "N s^2/m^2");
        assert_eq!(unit(&[("rad/s^2", 1), ("rad/s", -1), ("V", -1)]), "1/(s V)");
        assert_eq!(unit(&[("N", 1), ("m", 2)]), "N m^2");
        assert_eq!(unit(&[("1/(kg m^2)", 1), ("1", -2)]), "1/(kg m^2)");
        assert_eq!(unit(&[("m", 1), ("m", -1)]), "1");
    }

    #[test]
    fn a_term_that_is_taken_away_is_joined_with_its_sign() {
        assert_eq!(joined("-u * k / mass"), " - u * k / mass");
        assert_eq!(joined("k / mass"), " + k / mass");
    }
}
