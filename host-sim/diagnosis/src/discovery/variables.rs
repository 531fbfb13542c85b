//! Measured quantities that an unknown effect may depend on.

use model::{Quantity, Sample, Vehicle, user_effects};
use sysid::prepare::Prepared;

use crate::discovery::shapes::Span;

/// Where its value comes from.
#[derive(Debug, Clone, Copy)]
enum Source {
    Quantity(&'static Quantity),
    /// A further column of the flights, by its place in a sample.
    Further(usize),
    Sine(&'static Quantity),
    Cosine(&'static Quantity),
    /// A quantity less a further column.
    From(&'static Quantity, usize),
    /// Horizontal distance from a place in two further columns.
    Distance([usize; 2]),
}

/// A measured quantity that an effect may depend on.
#[derive(Debug, Clone)]
pub(crate) struct Variable {
    /// For people and JSON.
    pub(crate) name: &'static str,
    /// How formulas spell it.
    pub(crate) formula: &'static str,
    pub(crate) unit: String,
    /// Further column that a definition has to declare.
    pub(crate) declared: bool,
    source: Source,
    /// Where it goes in the flights.
    pub(crate) span: Span,
}

/// Quantities that formulas name by themselves.
const PLAIN: [&str; 21] = [
    "height",
    "north",
    "east",
    "u",
    "v",
    "w",
    "speed",
    "north_speed",
    "east_speed",
    "down_speed",
    "p",
    "q",
    "r",
    "phi",
    "theta",
    "psi",
    "thrust",
    "omega1",
    "omega2",
    "omega3",
    "omega4",
];

/// Quantities that formulas spell out.
const SPELT: [(&str, &str); 2] =
    [("horizontal_speed", "sqrt(u^2 + v^2)"), ("rotor_speed", "((omega1 + omega2 + omega3 + omega4) / 4)")];

/// Places beside another craft: name, formula, quantity and column.
const BESIDE_ANOTHER: [(&str, &str, &str, &str); 3] = [
    ("place north of the other craft", "(north - other_north)", "north", "other_north"),
    ("place east of the other craft", "(east - other_east)", "east", "other_east"),
    ("place below the other craft", "(down - other_down)", "down", "other_down"),
];

impl Variable {
    /// Its value at a sample.
    #[inline]
    pub(crate) fn at(&self, sample: &Sample) -> f64 {
        match self.source {
            Source::Quantity(quantity) => quantity.at(sample),
            Source::Further(place) => sample.input.further[place],
            Source::Sine(quantity) => quantity.at(sample).sin(),
            Source::Cosine(quantity) => quantity.at(sample).cos(),
            Source::From(quantity, place) => quantity.at(sample) - sample.input.further[place],
            Source::Distance([north, east]) => {
                let from = |axis: usize, place: usize| {
                    sample.input.position_ned_m[axis] - sample.input.further[place]
                };
                from(0, north).hypot(from(1, east))
            }
        }
    }

    /// One for tests of words.
    #[cfg(test)]
    pub(crate) fn made_up(name: &'static str, unit: &str, span: Span) -> Self {
        Self { name, formula: name, unit: unit.into(), declared: false, source: Source::Further(0), span }
    }

    /// The measured quantity behind it.
    pub(crate) fn quantity(&self) -> &'static str {
        match self.source {
            Source::Sine(quantity) | Source::Cosine(quantity) => quantity.name,
            _ => self.name,
        }
    }

    /// All that flights of a vehicle have, where they move.
    pub(crate) fn all(flights: &[&Prepared], model: &model::Model) -> Vec<Self> {
        let vehicle: &Vehicle = &model.vehicle;
        let rotors = vehicle.rotor_quantity(flights.iter().all(|flight| flight.has_rotor_speeds()));
        let mut all: Vec<Self> = Vec::new();
        let mut put = |name, formula, source, unit: String, declared| {
            all.push(Self { name, formula, unit, declared, source, span: Span { low: 0.0, high: 0.0 } });
        };
        let named = |name: &str| Quantity::named(name);
        for name in PLAIN.into_iter().chain(["vbat"]) {
            let Some(quantity) = named(name) else { continue };
            put(name, name, Source::Quantity(quantity), quantity.unit_for(rotors).to_owned(), false);
        }
        for (name, formula) in SPELT {
            let Some(quantity) = named(name) else { continue };
            put(name, formula, Source::Quantity(quantity), quantity.unit_for(rotors).to_owned(), false);
        }
        if let Some(psi) = named("psi") {
            put("sine of the heading", "sin(psi)", Source::Sine(psi), "1".into(), false);
            put("cosine of the heading", "cos(psi)", Source::Cosine(psi), "1".into(), false);
        }
        let columns = user_effects::columns();
        for (place, name) in columns.iter().enumerate() {
            let usual = user_effects::usual_unit(name);
            put(name, name, Source::Further(place), usual.unwrap_or("1").to_owned(), usual.is_none());
        }
        let place_of = |name: &str| columns.iter().position(|own| *own == name);
        for (name, formula, quantity, column) in BESIDE_ANOTHER {
            if let (Some(quantity), Some(place)) = (named(quantity), place_of(column)) {
                put(name, formula, Source::From(quantity, place), "m".into(), false);
            }
        }
        if let (Some(north), Some(east)) = (place_of("other_north"), place_of("other_east")) {
            let formula = "sqrt((north - other_north)^2 + (east - other_east)^2)";
            put("distance to the other craft", formula, Source::Distance([north, east]), "m".into(), false);
        }
        all.retain_mut(|variable| variable.find_span(flights, model));
        all
    }

    /// Whether it moves in the flights, and where to: the middle 99 of 100 values.
    fn find_span(&mut self, flights: &[&Prepared], model: &model::Model) -> bool {
        let plant = model::Plant::new(model);
        let mut values = Vec::new();
        for flight in flights {
            for stretch in &flight.stretches {
                let states = flight.states(stretch, &model.vehicle, plant.adjustments());
                for k in (0..states.len()).step_by(5) {
                    let input = states.at(k);
                    values.push(self.at(&plant.sample_of(&input)));
                }
            }
        }
        if values.is_empty() || !values.iter().all(|value| value.is_finite()) {
            return false;
        }
        values.sort_by(f64::total_cmp);
        let at = |part: f64| values[((values.len() - 1) as f64 * part).round() as usize];
        self.span = Span { low: at(0.005), high: at(0.995) };
        self.span.length() > 1e-6 * (self.span.low.abs() + self.span.high.abs()) && self.span.length() > 1e-9
    }
}
