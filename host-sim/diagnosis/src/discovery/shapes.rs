//! Shapes that a force can have over one quantity: the functions that known physics is made of.

use std::fmt;

/// A family of functions of one quantity x. Parameters a, b are in the unit of x.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Family {
    /// x.
    Proportional,
    /// x - a.
    Straight,
    /// x^2.
    Square,
    /// x^3.
    Cube,
    /// |x|.
    Modulus,
    /// x |x|.
    SignedSquare,
    /// x - a above a, nothing below.
    HingeAbove,
    /// a - x below a, nothing above.
    HingeBelow,
    /// From nothing to one about a, within b.
    Step,
    /// The same within less than flights can tell: b is held.
    Edge,
    /// tanh(x / a).
    Saturation,
    /// exp(-(x - b) / a), b held at the bottom of where x goes: the amplitude is what there is there. At zero, which may be far away, it would
    /// be a guess.
    Decay,
    /// exp((x - b) / a), b held at the top in the same way.
    Growth,
    /// 1 / (x + a)^2.
    InverseSquare,
    /// exp(-((x - a) / b)^2 / 2).
    Bump,
    /// cos(2 pi (x - a) / b).
    Wave,
}

/// The families that are tried, simple ones first. A step may become an edge ([`Span::sharpened`]).
pub(crate) const FAMILIES: [Family; 15] = [
    Family::Proportional,
    Family::Straight,
    Family::Square,
    Family::Cube,
    Family::Modulus,
    Family::SignedSquare,
    Family::HingeAbove,
    Family::HingeBelow,
    Family::Saturation,
    Family::Decay,
    Family::Growth,
    Family::InverseSquare,
    Family::Step,
    Family::Bump,
    Family::Wave,
];

/// What a parameter of a shape is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// A value of the quantity.
    Place,
    /// A distance between values of the quantity, above zero.
    Length,
}

impl Family {
    /// Its parameters: names in formulas and what they are.
    pub(crate) const fn parameters(self) -> &'static [(&'static str, Role)] {
        match self {
            Self::Proportional | Self::Square | Self::Cube | Self::Modulus | Self::SignedSquare => &[],
            Self::Straight => &[("zero", Role::Place)],
            Self::HingeAbove | Self::HingeBelow => &[("from", Role::Place)],
            Self::Step => &[("at", Role::Place), ("within", Role::Length)],
            Self::Edge => &[("at", Role::Place)],
            Self::Saturation => &[("full", Role::Length)],
            Self::Decay | Self::Growth => &[("decay", Role::Length)],
            Self::InverseSquare => &[("beyond", Role::Length)],
            Self::Bump => &[("center", Role::Place), ("width", Role::Length)],
            Self::Wave => &[("crest", Role::Place), ("period", Role::Length)],
        }
    }

    /// The parameter that is not fitted.
    pub(crate) const fn held(self) -> Option<&'static str> {
        match self {
            Self::Edge => Some("within"),
            Self::Decay => Some("bottom"),
            Self::Growth => Some("top"),
            _ => None,
        }
    }

    /// Power of the quantity's unit in the shape's value.
    pub(crate) const fn power(self) -> i32 {
        match self {
            Self::Proportional | Self::Straight | Self::Modulus | Self::HingeAbove | Self::HingeBelow => 1,
            Self::Square | Self::SignedSquare => 2,
            Self::Cube => 3,
            Self::InverseSquare => -2,
            Self::Step
            | Self::Edge
            | Self::Saturation
            | Self::Decay
            | Self::Growth
            | Self::Bump
            | Self::Wave => 0,
        }
    }

    /// Its value and its slopes.
    #[inline]
    fn slopes(self, x: f64, [a, b]: [f64; 2]) -> Slopes {
        // Of what only moves with the first parameter.
        let moved = |value: f64, over_x: f64, sign: f64| Slopes { value, over_x, over: [sign * over_x, 0.0] };
        match self {
            Self::Proportional => moved(x, 1.0, 0.0),
            Self::Straight => moved(x - a, 1.0, -1.0),
            Self::Square => moved(x * x, 2.0 * x, 0.0),
            Self::Cube => moved(x * x * x, 3.0 * x * x, 0.0),
            Self::Modulus => moved(x.abs(), x.signum(), 0.0),
            Self::SignedSquare => moved(x * x.abs(), 2.0 * x.abs(), 0.0),
            Self::HingeAbove => moved((x - a).max(0.0), if x > a { 1.0 } else { 0.0 }, -1.0),
            Self::HingeBelow => moved((a - x).max(0.0), if x < a { -1.0 } else { 0.0 }, -1.0),
            Self::Step | Self::Edge => {
                let off = (x - a) / b;
                // (1 + tanh(off)) / 2.
                let value = 1.0 / (1.0 + (-2.0 * off).exp());
                let over_x = 2.0 * value * (1.0 - value) / b;
                Slopes { value, over_x, over: [-over_x, -over_x * off] }
            }
            Self::Saturation => {
                let tanh = (x / a).tanh();
                let over_x = (1.0 - tanh * tanh) / a;
                Slopes { value: tanh, over_x, over: [-over_x * x / a, 0.0] }
            }
            Self::Decay => {
                let value = (-(x - b) / a).exp();
                Slopes { value, over_x: -value / a, over: [value * (x - b) / (a * a), value / a] }
            }
            Self::Growth => {
                let value = ((x - b) / a).exp();
                Slopes { value, over_x: value / a, over: [-value * (x - b) / (a * a), -value / a] }
            }
            Self::InverseSquare => moved((x + a).powi(-2), -2.0 * (x + a).powi(-3), 1.0),
            Self::Bump => {
                let off = (x - a) / b;
                let value = (-0.5 * off.powi(2)).exp();
                let over_x = -value * off / b;
                Slopes { value, over_x, over: [-over_x, -over_x * off] }
            }
            Self::Wave => {
                let phase = std::f64::consts::TAU * (x - a) / b;
                let (sin, cos) = phase.sin_cos();
                let over_x = -sin * std::f64::consts::TAU / b;
                Slopes { value: cos, over_x, over: [-over_x, -over_x * (x - a) / b] }
            }
        }
    }

    /// Its formula over `x`, with the names of its parameters.
    fn formula(self, x: &str, names: &[String]) -> String {
        let name = |k: usize| names.get(k).map_or("", String::as_str);
        let (a, b) = (name(0), name(1));
        match self {
            Self::Proportional => x.to_owned(),
            Self::Straight => format!("({x} - {a})"),
            Self::Square => format!("{x}^2"),
            Self::Cube => format!("{x}^3"),
            Self::Modulus => format!("abs({x})"),
            Self::SignedSquare => format!("{x} * abs({x})"),
            Self::HingeAbove => format!("max(0, {x} - {a})"),
            Self::HingeBelow => format!("max(0, {a} - {x})"),
            Self::Step | Self::Edge => format!("(1 + tanh(({x} - {a}) / {b})) / 2"),
            Self::Saturation => format!("tanh({x} / {a})"),
            Self::Decay => format!("exp(-({x} - {b}) / {a})"),
            Self::Growth => format!("exp(({x} - {b}) / {a})"),
            Self::InverseSquare => format!("({x} + {a})^(-2)"),
            Self::Bump => format!("exp(-(({x} - {a}) / {b})^2 / 2)"),
            Self::Wave => format!("cos(2 * pi * ({x} - {a}) / {b})"),
        }
    }
}

/// The value of a shape at a value x of its quantity, and its slopes there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slopes {
    pub(crate) value: f64,
    /// Over x.
    pub(crate) over_x: f64,
    /// Over each of its parameters.
    pub(crate) over: [f64; 2],
}

/// A shape: a family with values of its parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape {
    pub(crate) family: Family,
    pub(crate) parameters: [f64; 2],
}

impl Shape {
    /// How many parameters it has.
    pub(crate) fn count(&self) -> usize {
        self.family.parameters().len()
    }

    #[inline]
    pub(crate) fn at(&self, x: f64) -> f64 {
        self.slopes(x).value
    }

    #[inline]
    pub(crate) fn slopes(&self, x: f64) -> Slopes {
        self.family.slopes(x, self.parameters)
    }

    pub(crate) fn formula(&self, x: &str, names: &[String]) -> String {
        self.family.formula(x, names)
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.parameters.map(|value| format!("{value:.3}"));
        f.write_str(&self.formula("x", &names))
    }
}

/// Where a quantity goes in flights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Span {
    pub(crate) fn length(&self) -> f64 {
        self.high - self.low
    }

    /// Whether the quantity moves at all.
    pub(crate) fn is_wide(&self) -> bool {
        self.length() > 1e-6 * (self.low.abs() + self.high.abs()) && self.length() > 1e-9
    }

    /// Whether the quantity goes to both sides of zero, so that shapes about zero mean something.
    fn is_about_zero(&self) -> bool {
        self.low < -0.15 * self.length() && self.high > 0.15 * self.length()
    }

    fn places(&self, count: usize) -> impl Iterator<Item = f64> + Clone {
        let (low, step) = (self.low, self.length() / (count + 1) as f64);
        (1..=count).map(move |k| low + k as f64 * step)
    }

    /// The shapes that are tried over the span.
    pub(crate) fn shapes(&self) -> Vec<Shape> {
        let length = self.length();
        let lengths = |parts: &'static [f64]| parts.iter().map(move |part| part * length);
        let mut all = Vec::new();
        for family in FAMILIES {
            let mut put = |a: f64, b: f64| all.push(Shape { family, parameters: [a, b] });
            match family {
                Family::Proportional
                | Family::Square
                | Family::Cube
                | Family::Modulus
                | Family::SignedSquare => {
                    if self.is_about_zero() || family == Family::Proportional || family == Family::Square {
                        put(0.0, 0.0);
                    }
                }
                Family::Straight => put(0.5 * (self.low + self.high), 0.0),
                Family::HingeAbove | Family::HingeBelow => self.places(9).for_each(|at| put(at, 0.0)),
                Family::Saturation if self.is_about_zero() => {
                    lengths(&[0.05, 0.1, 0.2, 0.4]).for_each(|full| put(full, 0.0));
                }
                Family::Saturation => (),
                Family::Decay | Family::Growth => {
                    let end = if family == Family::Decay { self.low } else { self.high };
                    lengths(&[0.08, 0.15, 0.3, 0.6, 1.2]).for_each(|decay| put(decay, end));
                }
                Family::InverseSquare if self.low >= 0.0 => {
                    lengths(&[0.03, 0.1, 0.25, 0.5, 1.0]).for_each(|beyond| put(beyond, 0.0));
                }
                Family::InverseSquare => (),
                Family::Edge => (),
                Family::Step => {
                    for within in lengths(&[0.02, 0.06, 0.15]) {
                        self.places(15).for_each(|at| put(at, within));
                    }
                }
                Family::Bump => {
                    for width in lengths(&[0.03, 0.06, 0.12, 0.24]) {
                        self.places(19).for_each(|center| put(center, width));
                    }
                }
                Family::Wave => {
                    // Half a period on is the same with the other sign.
                    for period in lengths(&[0.35, 0.5, 0.7, 1.0, 1.4]) {
                        (0..6).for_each(|k| put(self.low + period * f64::from(k) / 12.0, period));
                    }
                }
            }
        }
        all
    }

    /// A step that is as narrow as can be told, as an edge.
    pub(crate) fn sharpened(&self, shape: Shape) -> Shape {
        let [narrowest, _] = self.possible(Role::Length);
        let is_edge = shape.family == Family::Step && shape.parameters[1] < 1.5 * narrowest;
        if is_edge { Shape { family: Family::Edge, ..shape } } else { shape }
    }

    /// Where a parameter of a role may lie.
    pub(crate) fn possible(&self, role: Role) -> [f64; 2] {
        let length = self.length();
        match role {
            Role::Place => [self.low - length, self.high + length],
            Role::Length => [0.005 * length, 5.0 * length],
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const SPAN: Span = Span { low: -1.2, high: 2.0 };

    /// The formula of every shape is read as an effect of users with its unit, and has the shape's values.
    #[test]
    fn formulas_say_what_shapes_do() {
        for family in FAMILIES.into_iter().chain([Family::Edge]) {
            let names = family.parameters().iter().map(|(name, _)| *name).chain(family.held());
            let parameters: Vec<String> = names.map(ToOwned::to_owned).collect();
            let value = [0.7, 0.4];
            let constants: String = parameters
                .iter()
                .zip(value)
                .map(|(name, value)| format!("{{ name = \"{name}\", unit = \"m\", value = {value} }}, "))
                .collect();
            let unit = format!("m/s^2/m^({})", family.power());
            let text = format!(
                "[[effect]]\nid = \"shape\"\nacceleration.w = \"k * {}\"\ncoefficient = [{{ name = \"k\", unit = \"{unit}\", \
                 possible = [-1.0, 1.0], typical = 1.0 }}]\nconstant = [{constants}]\n",
                family.formula("north", &parameters)
            );
            let [user] = model::effects::draft(&text, Path::new("test")).unwrap()[..] else {
                panic!("one effect")
            };
            let plant = model::Plant::new(&model::Model::thesis());
            for x in [-1.1, -0.2, 0.0, 0.3, 0.9, 1.7] {
                let state = model::State::at_rest(nalgebra::Vector3::new(x, 0.0, 0.0), [0.0; 4]);
                let input = plant.input(&state, &[0.0; 4], 11.5);
                let sample = plant.sample_of(&input);
                let mut column = Taken(0.0);
                model::Effect::User(user).columns(&sample, &mut column);
                let expected = family.slopes(x, value).value;
                assert!((column.0 - expected).abs() < 1e-12 * expected.abs().max(1.0), "{family:?} at {x}");
            }
        }
    }

    /// Slopes against differences, of every family, away from where it bends.
    #[test]
    fn slopes_are_what_small_steps_give() {
        const STEP: f64 = 1e-6;
        for family in FAMILIES.into_iter().chain([Family::Edge]) {
            for x in [-1.1, -0.2, 0.31, 0.9, 1.7] {
                let parameters = [0.7, 0.4];
                let at = |x: f64, parameters: [f64; 2]| Shape { family, parameters }.at(x);
                let near = |slope: f64, [ahead, behind]: [f64; 2]| {
                    let difference = (ahead - behind) / (2.0 * STEP);
                    let is_near = (slope - difference).abs() < 1e-7 * difference.abs().max(1.0);
                    assert!(is_near, "{family:?} at {x}: {slope}, by differences {difference}");
                };
                let slopes = Shape { family, parameters }.slopes(x);
                near(slopes.over_x, [at(x + STEP, parameters), at(x - STEP, parameters)]);
                for k in 0..2 {
                    let moved = |by: f64| {
                        let mut moved = parameters;
                        moved[k] += by;
                        at(x, moved)
                    };
                    near(slopes.over[k], [moved(STEP), moved(-STEP)]);
                }
            }
        }
    }

    struct Taken(f64);

    impl model::Sink for Taken {
        fn add(&mut self, _: model::Axis, _: usize, value: f64) {
            self.0 = value;
        }
    }

    #[test]
    fn all_shapes_are_finite_where_their_quantity_goes() {
        for span in [SPAN, Span { low: 0.2, high: 1.5 }, Span { low: 10.9, high: 12.3 }] {
            let shapes = span.shapes();
            assert!(shapes.len() > 100);
            for shape in &shapes {
                let at = |k: i32| shape.at(span.low + span.length() * f64::from(k) / 50.0);
                assert!((0..=50).all(|k| at(k).is_finite()), "{shape} over {span:?}");
                for (k, (_, role)) in shape.family.parameters().iter().enumerate() {
                    let [low, high] = span.possible(*role);
                    assert!((low..=high).contains(&shape.parameters[k]), "{shape}");
                }
            }
        }
    }

    #[test]
    fn a_step_that_is_too_narrow_to_tell_is_an_edge() {
        let step = |within| Shape { family: Family::Step, parameters: [0.3, within] };
        let edge = SPAN.sharpened(step(0.005 * SPAN.length()));
        assert_eq!((edge.family, edge.count()), (Family::Edge, 1));
        assert_eq!(edge.parameters, [0.3, 0.016]);
        assert_eq!(SPAN.sharpened(step(0.1)), step(0.1));
    }

    #[test]
    fn shapes_about_zero_are_for_quantities_that_go_to_both_sides_of_it() {
        let has = |span: Span, family| span.shapes().iter().any(|shape| shape.family == family);
        assert!(
            has(SPAN, Family::Saturation) && has(SPAN, Family::Modulus) && !has(SPAN, Family::InverseSquare)
        );
        let height = Span { low: 0.1, high: 1.5 };
        assert!(
            !has(height, Family::Saturation)
                && !has(height, Family::Modulus)
                && has(height, Family::InverseSquare)
        );
    }
}
