//! Measured quantities that an unknown effect may depend on.

use std::borrow::Cow;
use std::sync::Arc;

use model::{Axis, Followed, Lag, LagId, Model, Quantity, RotorQuantity, Sample, user_effects};
use report::number::significant;
use sysid::prepare::Prepared;
use sysid::statistics::correlation;

use crate::discovery::center::{About, Center, Flown};
use crate::discovery::chosen::{
    Chosen, FINE_DEG, Grid, LAGS_S, OBLIQUE_DEG, SEARCHED_LAG_S, SEARCHED_OWN_LAG_S, Spelling, along,
    direction, lag_of, lags_of_rotors, rounded,
};
use crate::discovery::meaning::meaning;
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
    /// Distance from the center of the form's way to act: a point, or a vertical axis.
    FromCenter {
        is_point: bool,
    },
    /// Place along a horizontal direction: its angle from north to east, degrees, and its parts along north and east.
    Along(f64, [f64; 2]),
    /// The own speed of each rotor.
    OwnSpeed,
    /// The own acceleration of each rotor.
    OwnAcceleration,
    /// A quantity behind a lag, or two in a row.
    Lagged(&'static Quantity, Chosen),
    /// By how much each rotor is faster than its own speed behind such a lag.
    OwnAhead(f64),
    /// The integral of the rotors' power.
    Energy,
}

/// A measured quantity that an effect may depend on.
#[derive(Debug, Clone)]
pub(crate) struct Variable {
    /// For people and JSON.
    pub(crate) name: &'static str,
    /// How formulas spell it, but for what each rotor has and what is remembered.
    formula: Cow<'static, str>,
    /// As definitions of effects have it: rad/s for rotor speeds, even where commands stand in for them.
    pub(crate) unit: String,
    /// Its unit in commands, where these stand in for rotor speeds.
    in_commands: Option<&'static str>,
    /// Further column that a definition has to declare.
    pub(crate) declared: bool,
    source: Source,
    /// What it looks back at; of each rotor, where each has its own.
    lags: [Option<LagId>; 4],
    /// Where it goes in the flights.
    pub(crate) span: Span,
    /// Where the flights went, for distances.
    flown: Arc<Flown>,
}

/// Quantities that formulas name by themselves.
const PLAIN: [&str; 22] = [
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
    "vbat",
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

/// Quantities that forms may look back at.
const REMEMBERED: [&str; 7] = ["u", "v", "w", "p", "q", "r", "thrust"];
/// Samples from one value of a span to the next.
const SPAN_STRIDE: usize = 5;
/// Correlation of the energy used with the time in flight up to which flights tell one from the other.
const TOLD_FROM_TIME: f64 = 0.98;

impl Variable {
    /// Its value at a sample for a rotor.
    #[inline]
    pub(crate) fn of_rotor(&self, sample: &Sample, rotor: usize) -> f64 {
        let place = &sample.input.position_ned_m;
        match self.source {
            Source::Quantity(quantity) => quantity.at(sample),
            Source::Further(place) => sample.input.further[place],
            Source::Sine(quantity) => quantity.at(sample).sin(),
            Source::Cosine(quantity) => quantity.at(sample).cos(),
            Source::From(quantity, column) => quantity.at(sample) - sample.input.further[column],
            Source::Distance([north, east]) => {
                let from = |axis: usize, column: usize| place[axis] - sample.input.further[column];
                from(0, north).hypot(from(1, east))
            }
            Source::Along(_, [north, east]) => north * place.x + east * place.y,
            Source::OwnSpeed => sample.input.rotor_rad_s[rotor],
            Source::OwnAcceleration => sample.input.rotor_acceleration_rad_s2[rotor],
            // Only its form knows the center.
            Source::FromCenter { .. } => f64::NAN,
            Source::Lagged(..) | Source::Energy => {
                self.lags[0].map_or(f64::NAN, |lag| sample.input.remembered(lag))
            }
            Source::OwnAhead(_) => {
                let behind = self.lags[rotor].map_or(f64::NAN, |lag| sample.input.remembered(lag));
                sample.input.rotor_rad_s[rotor] - behind
            }
        }
    }

    /// What it looks back at.
    pub(crate) fn lags(&self) -> impl Iterator<Item = LagId> {
        self.lags.iter().flatten().copied()
    }

    /// Whether it is the quantity whose slope an axis is, so short a time ago that the difference to what it is now is that slope: a model
    /// that damps the axis predicts by it what it is to explain.
    pub(crate) fn is_slope_along(&self, axis: Axis) -> bool {
        let Source::Lagged(quantity, chosen) = self.source else { return false };
        quantity.name == axis.name() && chosen.time_s().is_some_and(|time_s| time_s < LAGS_S[0])
    }

    /// Time of its lag, or of each of two, s.
    pub(crate) const fn lag_s(&self) -> Option<f64> {
        match self.source {
            Source::Lagged(_, chosen) => chosen.time_s(),
            Source::OwnAhead(time_s) => Some(time_s),
            _ => None,
        }
    }

    /// Whether each rotor has its own.
    pub(crate) const fn is_own(&self) -> bool {
        matches!(self.source, Source::OwnSpeed | Source::OwnAcceleration | Source::OwnAhead(_))
    }

    /// Whether it is the distance from the center of the form's way to act.
    #[inline]
    pub(crate) const fn is_distance(&self) -> bool {
        matches!(self.source, Source::FromCenter { .. })
    }

    /// The distance from a center, among all variables.
    pub(crate) fn distance_from(all: &[Self], center: Center) -> Option<usize> {
        let own = center.about == About::Point;
        let is_it =
            |variable: &Self| matches!(variable.source, Source::FromCenter { is_point } if is_point == own);
        all.iter().position(is_it)
    }

    /// Where the flights went.
    pub(crate) fn flown(&self) -> &Flown {
        &self.flown
    }

    /// The number in its formula that is chosen with the form.
    pub(crate) const fn chosen(&self) -> Option<Chosen> {
        match self.source {
            Source::Along(degrees, _) => Some(Chosen::BearingDeg(degrees)),
            Source::Lagged(_, chosen) => Some(chosen),
            Source::OwnAhead(time_s) => Some(Chosen::LagS(time_s)),
            _ => None,
        }
    }

    /// The same with another such number, near enough for it to go as far; nothing where there is none, or no room for another lag.
    pub(crate) fn with_chosen(&self, chosen: Chosen) -> Option<Self> {
        let mut other = self.clone();
        match (&mut other.source, chosen) {
            (Source::Along(own, toward), Chosen::BearingDeg(degrees)) => {
                (*own, *toward) = (degrees, direction(degrees));
                other.formula = along(*toward).into();
            }
            (Source::Lagged(quantity, own), _) => {
                *own = chosen;
                other.lags = [Some(lag_of(quantity, chosen)?), None, None, None];
            }
            (Source::OwnAhead(own), Chosen::LagS(time_s)) => {
                *own = time_s;
                other.lags = lags_of_rotors(time_s);
            }
            _ => return None,
        }
        Some(other)
    }

    /// A quantity behind a lag, behind two in a row instead that are much like it.
    pub(crate) fn behind_two_lags(&self) -> Option<Self> {
        match self.source {
            Source::Lagged(_, chosen) => self.with_chosen(chosen.in_two()?),
            _ => None,
        }
    }

    /// The same with the time of its lags times a factor; nothing where it has none.
    pub(crate) fn with_time_times(&self, factor: f64) -> Option<Self> {
        let chosen = match self.chosen()? {
            Chosen::BearingDeg(_) => return None,
            Chosen::LagS(time_s) => Chosen::LagS(rounded(factor * time_s)),
            Chosen::TwoLagsS(time_s) => Chosen::TwoLagsS(rounded(factor * time_s)),
        };
        self.with_chosen(chosen)
    }

    /// How formulas spell it; each rotor's own for one of them.
    pub(crate) fn formula(&self, rotor: Option<usize>, spelling: &Spelling) -> Cow<'_, str> {
        match (self.source, rotor, spelling) {
            (Source::Along(..), _, Spelling::Bearing(name)) => {
                format!("(cos({name}) * north + sin({name}) * east)").into()
            }
            (Source::Lagged(quantity, chosen), ..) => {
                spelling.lag(quantity.name, matches!(chosen, Chosen::TwoLagsS(_))).into()
            }
            (Source::OwnAhead(_), Some(k), _) => {
                let omega = format!("omega{}", k + 1);
                format!("({omega} - {})", spelling.lag(&omega, false)).into()
            }
            (Source::OwnSpeed, Some(k), _) => format!("omega{}", k + 1).into(),
            (Source::OwnAcceleration, Some(k), _) => format!("domega{}", k + 1).into(),
            _ => Cow::Borrowed(&self.formula),
        }
    }

    /// One for tests of words.
    #[cfg(test)]
    pub(crate) fn made_up(name: &'static str, unit: &str, span: Span) -> Self {
        Self { span, ..Self::new(name, name.into(), Source::Further(0), unit) }
    }

    /// The measured quantities behind it.
    pub(crate) fn quantities(&self) -> Vec<&'static str> {
        match self.source {
            Source::Sine(quantity) | Source::Cosine(quantity) => vec![quantity.name],
            Source::Along(..) => vec!["east", "north"],
            Source::Lagged(quantity, _) => vec![quantity.name],
            // Those of the way to act.
            Source::FromCenter { .. } => Vec::new(),
            _ => vec![self.name],
        }
    }

    /// For people.
    pub(crate) fn called(&self) -> Cow<'static, str> {
        let number = |value: f64| significant(value, 3);
        match self.source {
            Source::Along(degrees, _) => {
                format!("position along a bearing of {} degrees", number(degrees)).into()
            }
            Source::OwnSpeed => "rotor's own speed".into(),
            Source::OwnAcceleration => "rotor's own acceleration".into(),
            Source::Lagged(quantity, Chosen::TwoLagsS(time_s)) => {
                let time_s = number(time_s);
                format!("{}, averaged over the last {time_s} s, twice in a row", meaning(quantity.name))
                    .into()
            }
            Source::Lagged(quantity, chosen) => {
                let time_s = number(chosen.time_s().unwrap_or_default());
                format!("{}, averaged over the last {time_s} s", meaning(quantity.name)).into()
            }
            Source::OwnAhead(time_s) => {
                format!("rotor's own speed less its average over the last {} s", number(time_s)).into()
            }
            _ => meaning(self.name).into(),
        }
    }

    /// Its unit for people.
    pub(crate) fn unit_for_people(&self) -> &str {
        self.in_commands.unwrap_or(&self.unit)
    }

    /// Whether every form is tried over it; the best are tried over the others besides ([`Self::relatives`]).
    pub(crate) fn is_searched(&self) -> bool {
        match self.source {
            Source::Along(degrees, _) => OBLIQUE_DEG.contains(&degrees),
            Source::Lagged(_, chosen) => chosen == Chosen::LagS(SEARCHED_LAG_S),
            Source::OwnAhead(time_s) => time_s == SEARCHED_OWN_LAG_S,
            Source::FromCenter { .. } => false,
            _ => true,
        }
    }

    /// Numbers in its formula that are chosen with the form.
    pub(crate) fn count(&self) -> usize {
        usize::from(self.chosen().is_some())
    }

    /// Variables that differ from it in such a number alone, of those on a grid, nearest first.
    pub(super) fn relatives(&self, all: &[Self], grid: Grid) -> Vec<usize> {
        let is_alike = |other: &Self| match (self.source, other.source) {
            (Source::Lagged(own, _), Source::Lagged(theirs, _)) => own.name == theirs.name,
            (own, other) => std::mem::discriminant(&own) == std::mem::discriminant(&other),
        };
        let apart = |other: &Self| self.chosen()?.apart(other.chosen()?).filter(|_| is_alike(other));
        let is_other = |other: &Self| {
            other.chosen() != self.chosen() && other.chosen().is_some_and(|chosen| chosen.is_on(grid))
        };
        let others = all.iter().enumerate().filter(|(_, other)| is_other(other));
        let mut found: Vec<(f64, usize)> =
            others.filter_map(|(index, other)| Some((apart(other)?, index))).collect();
        found.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        found.into_iter().map(|(_, index)| index).collect()
    }

    /// All that flights of a vehicle have, where they move.
    pub(crate) fn all(flights: &[&Prepared], model: &Model) -> Vec<Self> {
        let rotors = model.vehicle.rotor_quantity(flights.iter().all(|flight| flight.has_rotor_speeds()));
        let mut all: Vec<Self> = Vec::new();
        let mut put = |name, formula: Cow<'static, str>, source, unit: &str| {
            all.push(Self::new(name, formula, source, unit));
        };
        for (name, formula) in PLAIN.map(|name| (name, name)).into_iter().chain(SPELT) {
            let Some(quantity) = Quantity::named(name) else { continue };
            put(name, formula.into(), Source::Quantity(quantity), quantity.unit);
        }
        if let Some(psi) = Quantity::named("psi") {
            put("sine of the heading", "sin(psi)".into(), Source::Sine(psi), "1");
            put("cosine of the heading", "cos(psi)".into(), Source::Cosine(psi), "1");
        }
        for degrees in (FINE_DEG..180).step_by(FINE_DEG).filter(|degrees| *degrees != 90) {
            let degrees = degrees as f64;
            let toward = direction(degrees);
            put("place", along(toward).into(), Source::Along(degrees, toward), "m");
        }
        let own = [("rotor_speed", Source::OwnSpeed), ("rotor_acceleration", Source::OwnAcceleration)];
        for (name, source) in own {
            let Some(quantity) = Quantity::named(name) else { continue };
            put(name, name.into(), source, quantity.unit);
        }
        if rotors == RotorQuantity::Command {
            all.iter_mut().for_each(|variable| {
                variable.in_commands =
                    Quantity::named(variable.name).and_then(|quantity| quantity.unit_in_commands);
            });
        }
        all.extend(of_columns());
        find_spans(&mut all, flights, model);
        all.retain(|variable| variable.span.is_wide());
        all.extend(remembered(&all));
        all.extend(energy_used(flights, model, rotors));
        all.extend(from_centers(flights));
        all
    }

    /// One whose span is not known yet.
    fn new(name: &'static str, formula: Cow<'static, str>, source: Source, unit: &str) -> Self {
        let (unit, span) = (unit.to_owned(), Span { low: 0.0, high: 0.0 });
        let flown = Arc::default();
        Self { name, formula, unit, in_commands: None, declared: false, source, lags: [None; 4], span, flown }
    }
}

/// Further columns of the flights, and what they say of another craft.
fn of_columns() -> Vec<Variable> {
    let columns = user_effects::columns();
    let mut all = Vec::new();
    for (place, name) in columns.iter().copied().enumerate() {
        let usual = user_effects::usual_unit(name);
        let variable = Variable::new(name, name.into(), Source::Further(place), usual.unwrap_or("1"));
        all.push(Variable { declared: usual.is_none(), ..variable });
    }
    let place_of = |name: &str| columns.iter().position(|own| *own == name);
    for (name, formula, quantity, column) in BESIDE_ANOTHER {
        if let (Some(quantity), Some(place)) = (Quantity::named(quantity), place_of(column)) {
            all.push(Variable::new(name, formula.into(), Source::From(quantity, place), "m"));
        }
    }
    if let (Some(north), Some(east)) = (place_of("other_north"), place_of("other_east")) {
        let formula = "sqrt((north - other_north)^2 + (east - other_east)^2)";
        let source = Source::Distance([north, east]);
        all.push(Variable::new("distance to the other craft", formula.into(), source, "m"));
    }
    all
}

/// Distances from centers, where flights say where they were.
fn from_centers(flights: &[&Prepared]) -> Vec<Variable> {
    if !flights.iter().all(|flight| flight.has_position) {
        return Vec::new();
    }
    let flown = Arc::new(Flown::new(flights));
    let one = |(name, is_point): (&'static str, bool)| {
        let variable = Variable::new(name, name.into(), Source::FromCenter { is_point }, "m");
        Variable { flown: flown.clone(), ..variable }
    };
    [("distance from this point", true), ("distance from this axis", false)].map(one).into()
}

/// What forms may look back at. A lag goes no further than what it follows.
fn remembered(all: &[Variable]) -> Vec<Variable> {
    let mut found = Vec::new();
    for time_s in LAGS_S {
        for variable in all {
            match variable.source {
                Source::Quantity(quantity) if REMEMBERED.contains(&quantity.name) => {
                    let chosen = Chosen::LagS(time_s);
                    let lags = [lag_of(quantity, chosen), None, None, None];
                    let source = Source::Lagged(quantity, chosen);
                    found.push(Variable { source, lags, ..variable.clone() });
                }
                Source::OwnSpeed => {
                    let lags = lags_of_rotors(time_s);
                    let reach = 0.5 * variable.span.length();
                    let span = Span { low: -reach, high: reach };
                    found.push(Variable { source: Source::OwnAhead(time_s), lags, span, ..variable.clone() });
                }
                _ => (),
            }
        }
    }
    found
}

/// The energy that the rotors have used, where flights tell it from the time in flight.
fn energy_used(flights: &[&Prepared], model: &Model, rotors: RotorQuantity) -> Option<Variable> {
    let power = Quantity::named("power")?;
    let lag = Lag { of: Followed::Quantity(power), time_s: None }.id()?;
    let plant = model::Plant::new(model);
    let (mut times_s, mut values) = (Vec::new(), Vec::new());
    for flight in flights {
        for stretch in &flight.stretches {
            let states = flight.remembering_states(stretch, &model.vehicle, &plant, [lag]);
            for k in (0..states.len()).step_by(SPAN_STRIDE) {
                times_s.push(stretch.time_s[k]);
                values.push(states.at(k).remembered(lag));
            }
        }
    }
    if correlation(&times_s, &values) > TOLD_FROM_TIME {
        return None;
    }
    let variable = Variable::new("energy", "integral(power)".into(), Source::Energy, "J");
    let in_commands = (rotors == RotorQuantity::Command).then_some("kg m^2 cmd^3 s");
    Some(Variable { lags: [Some(lag), None, None, None], in_commands, span: span_of(values)?, ..variable })
}

/// Where variables go in flights: the middle 99 of 100 values. What is not known everywhere has no width.
fn find_spans(variables: &mut [Variable], flights: &[&Prepared], model: &Model) {
    let plant = model::Plant::new(model);
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); variables.len()];
    for flight in flights {
        for stretch in &flight.stretches {
            let states = flight.states(stretch, &model.vehicle, plant.adjustments());
            for k in (0..states.len()).step_by(SPAN_STRIDE) {
                let input = states.at(k);
                let sample = plant.sample_of(&input);
                for (values, variable) in values.iter_mut().zip(&*variables) {
                    let rotors = if variable.is_own() { 4 } else { 1 };
                    values.extend((0..rotors).map(|rotor| variable.of_rotor(&sample, rotor)));
                }
            }
        }
    }
    for (values, variable) in values.into_iter().zip(variables) {
        variable.span = span_of(values).unwrap_or(variable.span);
    }
}

/// The middle 99 of 100 values; nothing where some are not known.
fn span_of(mut values: Vec<f64>) -> Option<Span> {
    if values.is_empty() || !values.iter().all(|value| value.is_finite()) {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let at = |part: f64| values[((values.len() - 1) as f64 * part).round() as usize];
    Some(Span { low: at(0.005), high: at(0.995) })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use model::{Plant, State, frames};
    use nalgebra::Vector3;

    use super::*;
    use crate::testing::{NONE, prepared, truth};

    /// A level craft 3 m north and 4 m east of where the first two further columns say, heading east.
    fn value(source: Source) -> f64 {
        let plant = Plant::new(&truth());
        let mut state = State::at_rest(Vector3::new(4.0, 6.0, -1.0), [600.0; 4]);
        state.attitude = frames::quaternion_from_euler(Vector3::new(0.0, 0.0, FRAC_PI_2));
        let mut input = plant.input(&state, &[600.0; 4], 11.5);
        input.further[..2].copy_from_slice(&[1.0, 2.0]);
        Variable::new("x", "x".into(), source, "1").of_rotor(&plant.sample_of(&input), 0)
    }

    #[test]
    fn places_are_taken_along_a_bearing_and_from_what_columns_say() {
        let [north, psi] = ["north", "psi"].map(|name| Quantity::named(name).unwrap());
        for (source, expected) in [
            // cos(60 degrees) is a half.
            (Source::Along(60.0, direction(60.0)), 0.5 * 4.0 + 0.75_f64.sqrt() * 6.0),
            (Source::Distance([0, 1]), 5.0),
            (Source::From(north, 0), 3.0),
            (Source::Further(1), 2.0),
            (Source::Sine(psi), 1.0),
            (Source::Cosine(psi), 0.0),
            (Source::OwnSpeed, 600.0),
        ] {
            // Parts of a direction have four digits.
            assert!((value(source) - expected).abs() < 1e-3, "{source:?}: {}", value(source));
        }
        assert!(value(Source::FromCenter { is_point: true }).is_nan());
    }

    #[test]
    fn a_span_is_the_middle_99_of_100_values() {
        let shuffled: Vec<f64> = (0..1001).map(|k| f64::from(k * 389 % 1001)).collect();
        let span = span_of(shuffled.clone()).unwrap();
        assert_eq!((span.low, span.high), (5.0, 995.0));
        assert!(span_of(Vec::new()).is_none());
        assert!(span_of([shuffled, vec![f64::NAN]].concat()).is_none());
    }

    /// Nothing flies through a column that nobody logged, and what does not move is no variable.
    #[test]
    fn what_flights_have_is_searched_and_what_stands_still_is_not() {
        let flights = prepared(&truth(), 1..3, 6.0, &NONE);
        let all = Variable::all(&flights.iter().collect::<Vec<&Prepared>>(), &truth());
        let has = |name: &str| all.iter().any(|variable| variable.name == name);
        assert!(has("height") && has("thrust") && has("u") && !has("other_north"));
        let relatives_of = |name: &str| {
            let own = all.iter().find(|v| v.name == name && v.chosen().is_some()).expect(name);
            own.relatives(&all, Grid::Fine).into_iter().map(|k| &all[k]).collect::<Vec<_>>()
        };
        // The shortest lag that is searched is none yet.
        let lagged = all.iter().find(|v| v.quantities() == ["q"] && v.lag_s() == Some(LAGS_S[0])).unwrap();
        let shorter = lagged.with_time_times(0.5).unwrap();
        let is_slope = |variable: &Variable| model::AXES.map(|axis| variable.is_slope_along(axis));
        assert_eq!(is_slope(lagged), [false; 6]);
        assert_eq!(is_slope(&shorter), [false, false, false, false, true, false]);
        // Of a place along a bearing: places along others.
        let places = relatives_of("place");
        assert!(!places.is_empty() && places.iter().all(|v| v.quantities() == ["east", "north"]));
    }
}
