//! A form in plain English: what acts, on what it depends and how, how strong it is, and which known physics behaves so.

use model::Axis;
use model::user_effects::{ConstantDefinition, Definition};
use report::number::significant;

use crate::discovery::center::About;
use crate::discovery::channels::Channel;
use crate::discovery::form::{Factor, Form, Parameter};
use crate::discovery::refine::Refined;
use crate::discovery::shapes::{Family, Shape, Span};
use crate::discovery::variables::Variable;

/// Digits that a number in a sentence has.
const DIGITS: usize = 3;

fn number(value: f64) -> String {
    significant(value, DIGITS)
}

/// What a form does, in a sentence.
pub(crate) fn sentence(term: &Refined, variables: &[Variable], thrust_coefficient: f64) -> String {
    let form = &term.form;
    let how: Vec<String> = (0..form.factors.len()).map(|index| shape_words(form, index, variables)).collect();
    let strongest = strongest(form, variables);
    let most: Vec<f64> = term.amplitudes.iter().map(|amplitude| amplitude * strongest).collect();
    let one = most.first().copied().unwrap_or(0.0);
    let size = match form.channel {
        Channel::Thrust => format!("{} % of the thrust", number((100.0 * one / thrust_coefficient).abs())),
        Channel::Rotor(..) | Channel::EachRotor(_) => format!("{} % of it", number((100.0 * one).abs())),
        Channel::RotorApart(..) => {
            let [moments, force] = [0, 1].map(|k| number(100.0 * most.get(k).map_or(0.0, |part| part.abs())));
            format!("{force} % of its force and {moments} % of its moments as the model has them")
        }
        Channel::Horizontal => {
            let [north, east] = [0, 1].map(|k| number(most.get(k).copied().unwrap_or(0.0)));
            format!("{north} N north and {east} N east")
        }
        channel => format!("{} {}", number(one.abs()), channel.unit()),
    };
    let how = how.join(" and ");
    let changes =
        |(index, factor): (usize, &Factor)| changes_sign(&factor.shape, &form.span(variables, index));
    if form.factors.iter().enumerate().any(changes) {
        let way = if term.amplitudes.first().is_some_and(|k| *k > 0.0) { "with" } else { "against" };
        return format!("{}, up to {size} in magnitude, {how}, {way} its sign", form.channel.meaning());
    }
    format!("{}, up to {size}, {how}", directed(form.channel, one))
}

/// Whether a shape takes both signs where its quantity went.
fn changes_sign(shape: &Shape, span: &Span) -> bool {
    let [low, high] = [shape.at(span.low), shape.at(span.high)];
    low * high < 0.0 && low.abs().min(high.abs()) > 0.05 * low.abs().max(high.abs())
}

/// The strongest value of the shapes of a form where their quantities went.
fn strongest(form: &Form, variables: &[Variable]) -> f64 {
    let of = |(index, factor): (usize, &Factor)| {
        let span = form.span(variables, index);
        let at = |k: i32| factor.shape.at(span.low + span.length() * f64::from(k) / 200.0);
        (0..=200).map(at).fold(0.0_f64, |most, value| if value.abs() > most.abs() { value } else { most })
    };
    form.factors.iter().enumerate().map(of).product()
}

/// A way to act with its direction.
fn directed(channel: Channel, amount: f64) -> String {
    let either =
        |positive: &str, negative: &str| if amount > 0.0 { positive.to_owned() } else { negative.to_owned() };
    match channel {
        Channel::Body(Axis::U) => either("A forward force", "A backward force"),
        Channel::Body(Axis::V) => either("A force to the right", "A force to the left"),
        Channel::Body(Axis::W) => {
            either("A downward force along the rotors' axis", "An upward force along the rotors' axis")
        }
        Channel::Earth(0) => either("A force to the north", "A force to the south"),
        Channel::Earth(1) => either("A force to the east", "A force to the west"),
        Channel::Earth(_) => either("A downward force", "An upward force"),
        Channel::Thrust => either("Extra thrust", "A loss of thrust"),
        Channel::Rotor(k, _) | Channel::RotorApart(k, _) => either(
            &format!("Extra thrust of motor {}", k + 1),
            &format!("A loss of thrust of motor {}", k + 1),
        ),
        Channel::EachRotor(_) => either("Extra thrust of each rotor", "A loss of thrust of each rotor"),
        Channel::Drag => either("Extra drag", "Less drag"),
        Channel::HorizontalDrag => either("Extra horizontal drag", "Less horizontal drag"),
        Channel::TiltDamping => either("Extra damping of roll and pitch", "Less damping of roll and pitch"),
        Channel::Body(Axis::P) => either("A roll acceleration", "A negative roll acceleration"),
        Channel::Body(Axis::Q) => either("A pitch acceleration", "A negative pitch acceleration"),
        Channel::Body(Axis::R) => either("A yaw acceleration", "A negative yaw acceleration"),
        Channel::Horizontal => "A horizontal force".into(),
        Channel::Center(center) => {
            let way = match center.about {
                About::Point | About::Axis => either("towards", "away from"),
                About::Around => {
                    either("clockwise (from above) around", "counter-clockwise (from above) around")
                }
            };
            format!("A force {way} {}", center.called())
        }
    }
}

/// How a form depends on one of its quantities.
fn shape_words(form: &Form, index: usize, variables: &[Variable]) -> String {
    let factor = &form.factors[index];
    let variable = &variables[factor.variable];
    let unit = Some(variable.unit_for_people()).filter(|unit| *unit != "1").unwrap_or_default();
    let name = variable.called();
    let value = |k: usize| {
        let value = number(form.value(Parameter::OfShape { factor: index, number: k }));
        if unit.is_empty() { value } else { format!("{value} {unit}") }
    };
    match factor.shape.family {
        Family::Proportional => format!("proportional to the {name}"),
        Family::Straight => format!("linear in the {name}, zero at {}", value(0)),
        Family::Square => format!("growing with the square of the {name}"),
        Family::Cube => format!("growing with the cube of the {name}"),
        Family::Modulus => format!("growing with the magnitude of the {name}"),
        Family::SignedSquare => format!("growing with the square of the {name}"),
        Family::HingeAbove => format!("where the {name} exceeds {}, growing from there", value(0)),
        Family::HingeBelow => format!("where the {name} is below {}, growing from there", value(0)),
        Family::Step => format!("where the {name} is above {} (the step is {} wide)", value(0), value(1)),
        Family::Edge => format!("where the {name} is above {}", value(0)),
        Family::Saturation => format!("following the {name}, saturated beyond about {}", value(0)),
        Family::Decay => format!("decaying with the {name} (by a factor of e per {})", value(0)),
        Family::Growth => format!("growing with the {name} (by a factor of e per {})", value(0)),
        Family::InverseSquare => format!("inversely proportional to ({name} + {})^2", value(0)),
        Family::Wave => format!("as a wave over the {name} (period {}, crest at {})", value(1), value(0)),
        Family::Bump => format!("around {name} = {} (standard deviation {})", value(0), value(1)),
    }
}

/// The formula of an effect with what is fitted left as names, and what is held as numbers: one row after the other.
pub(crate) fn formula(definition: &Definition) -> String {
    let row =
        |(row, text): (&String, &String)| format!("{row}: {}", with_numbers(text, &definition.constant));
    definition.acceleration.iter().map(row).collect::<Vec<_>>().join("; ")
}

/// A formula with numbers in place of constants.
fn with_numbers(text: &str, constants: &[ConstantDefinition]) -> String {
    let is_of_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut told = String::new();
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let length = rest.find(|c| !is_of_word(c)).unwrap_or(rest.len()).max(next.len_utf8());
        let (word, after) = rest.split_at(length);
        rest = after;
        match constants.iter().find(|constant| constant.name == word) {
            Some(constant) => push_number(&mut told, constant.value),
            None => told.push_str(word),
        }
    }
    told
}

/// Appends a number to a formula; what is less than zero turns the sign before it.
fn push_number(formula: &mut String, value: f64) {
    // Five digits, without the zeros that would tell a precision.
    let number = format!("{:.4e}", value.abs()).parse::<f64>().unwrap_or(value.abs());
    if value < 0.0 {
        let (kept, sign) = [(" - ", " + "), (" + ", " - "), ("-", "")]
            .into_iter()
            .find_map(|(own, other)| Some((formula.strip_suffix(own)?.len(), other)))
            .unwrap_or((formula.len(), "-"));
        formula.truncate(kept);
        formula.push_str(sign);
    }
    formula.push_str(&number.to_string());
}

/// A form in short, to tell rivals apart.
pub(crate) fn short(form: &Form, variables: &[Variable]) -> String {
    let names: Vec<_> = form.variables().iter().map(|index| variables[*index].called()).collect();
    format!("{} that depends on the {}", form.channel.meaning(), names.join(" and the "))
}

/// Known physics of this form, with its source.
pub(crate) fn known_physics(term: &Refined, variables: &[Variable]) -> Option<&'static str> {
    let form = &term.form;
    let names: Vec<&str> = form.variables().iter().map(|index| variables[*index].name).collect();
    let on = |of: &[&str]| names.iter().any(|name| of.contains(name));
    let family = form.factors.first()?.shape.family;
    let amount = term.amplitudes.first()? * strongest(form, variables);
    // Which way it pushes, where it acts upwards or downwards.
    let upward = match form.channel {
        Channel::Thrust => Some(amount > 0.0),
        Channel::Body(Axis::W) | Channel::Earth(2) => Some(amount < 0.0),
        _ => None,
    };
    let sideward = matches!(
        form.channel,
        Channel::Horizontal | Channel::Earth(0 | 1) | Channel::Body(Axis::U | Axis::V)
    );
    let drag = matches!(form.channel, Channel::Drag | Channel::HorizontalDrag);
    let fades = matches!(family, Family::Decay | Family::InverseSquare | Family::HingeBelow);
    let grows =
        matches!(family, Family::Growth | Family::HingeAbove | Family::Proportional | Family::Straight);
    let told = match (form.channel, upward) {
        _ if names.iter().any(|name| name.starts_with("other_") || name.ends_with("the other craft")) => {
            "the downwash of another craft"
        }
        (Channel::Rotor(..) | Channel::RotorApart(..) | Channel::EachRotor(_), _) => {
            return physics_of_rotors(form.channel, &names);
        }
        (_, Some(true)) if on(&["height"]) && fades => {
            "ground effect (Cheeseman and Bennett, ARC R&M 3021, 1955)"
        }
        (_, Some(true)) if on(&["height"]) && grows => {
            "a ceiling (Rossow, NASA TM-86754, 1985; Hsiao and Chirarattananon, IEEE/ASME Trans. Mechatronics 24, 2019)"
        }
        (_, Some(false)) if on(&["height"]) && fades => "an attraction to the floor, such as a magnet",
        (_, Some(false)) if on(&["height"]) && grows => "a tether or a cord",
        (_, Some(false)) if on(&["w", "down_speed"]) => {
            "the vortex ring state (Johnson, NASA/TP-2005-213477)"
        }
        (_, Some(_)) if on(&["time", "energy", "vbat"]) => "motors that warm up, or a battery that weakens",
        (_, Some(_)) if on(&["north", "east"]) => {
            "the edge of a table, or vertical air in a part of the room"
        }
        (Channel::Body(Axis::R), _) if on(&["v"]) => "a craft that turns into the wind like a weathercock",
        (Channel::Body(Axis::R), _) if on(&["psi", "sine of the heading", "cosine of the heading"]) => {
            "a cable that twists"
        }
        (Channel::Center(center), _) => {
            return Some(physics_about(center.about, amount, fades));
        }
        _ if drag && on(&["north", "east", "height"]) => {
            "a curtain of air, a net or a cloth in a part of the room"
        }
        _ if sideward && on(&["time"]) => "a draught, such as a door that opens or a fan that is switched on",
        _ if sideward && on(&["north", "east", "height"]) => {
            "the jet of a fan, a wall, or wind that changes with height"
        }
        _ => return None,
    };
    Some(told)
}

/// Known physics about a point or an axis.
fn physics_about(about: About, amount: f64, fades: bool) -> &'static str {
    match about {
        About::Around => "a whirl of air, such as the swirl behind a fan",
        _ if amount < 0.0 => "air that spreads from there, such as below a fan",
        _ if fades => "an attraction, such as a magnet or air that is drawn in",
        _ => "a cable or an elastic cord that is tied there",
    }
}

/// Known physics of single rotors.
fn physics_of_rotors(channel: Channel, names: &[&str]) -> Option<&'static str> {
    let on = |name: &str| names.contains(&name);
    match channel {
        Channel::EachRotor(_) if on("rotor_acceleration") => {
            Some("air that takes time to follow the rotors (Carpenter and Fridovich, NACA TN 3044, 1953)")
        }
        Channel::EachRotor(_) if on("rotor_speed") => Some(
            "blades that stall, air that takes time to follow the rotors, or thrust that does not follow the square of the speed",
        ),
        Channel::Rotor(..) | Channel::RotorApart(..) if on("time") || on("energy") => {
            Some("a motor or a propeller that fails")
        }
        _ => None,
    }
}

/// What to fly so that quantities that go together in these flights part.
pub(crate) fn to_fly(form: &Form, rivals: &[Form], variables: &[Variable]) -> String {
    let own = form.variables();
    let names = |of: &[usize]| {
        of.iter().map(|index| variables[*index].called()).collect::<Vec<_>>().join(" and the ")
    };
    let mut others: Vec<usize> =
        rivals.iter().flat_map(Form::variables).filter(|index| !own.contains(index)).collect();
    others.sort_unstable();
    others.dedup();
    let is_time = |index: &usize| variables[*index].name == model::user_effects::TIME_COLUMN;
    if own.iter().any(is_time) {
        return "repeat a flight and start its pattern some seconds later in the log: what depends on time keeps its time, what \
                depends on place moves with the pattern"
            .into();
    }
    if !others.is_empty() {
        return format!("vary the {} while the {} stays the same", names(&own), names(&others));
    }
    let factor_of = |index: &usize| form.factors.iter().position(|factor| factor.variable == *index);
    let flown: Vec<String> = own
        .iter()
        .filter_map(|index| Some((&variables[*index], form.span(variables, factor_of(index)?))))
        .map(|(v, span)| {
            let [low, high] = [span.low, span.high].map(number);
            format!("{} {low} to {high} {}", v.called(), v.unit_for_people())
        })
        .collect();
    format!("fly another pattern over a wider range (flown: {})", flown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn term(channel: Channel, family: Family, amplitude: f64) -> Refined {
        let shape = Shape { family, parameters: [0.4, 0.1] };
        Refined {
            form: Form { channel, factors: vec![Factor { variable: 0, shape }] },
            amplitudes: vec![amplitude],
            gain_left_out: 1.0,
            improved: 3,
        }
    }

    #[test]
    fn a_sentence_says_which_way_and_the_physics_are_those_of_that_way() {
        let height = [Variable::made_up("height", "m", Span { low: 0.1, high: 1.6 })];
        let down = term(Channel::Earth(2), Family::InverseSquare, 0.24);
        assert_eq!(
            sentence(&down, &height, 0.02),
            "A downward force, up to 0.960 N, inversely proportional to (height + 0.400 m)^2"
        );
        assert!(known_physics(&down, &height).unwrap().contains("magnet"));
        let up = term(Channel::Thrust, Family::Decay, 0.004);
        assert!(
            sentence(&up, &height, 0.02).starts_with("Extra thrust, up to 20.0 % of the thrust, decaying")
        );
        assert!(known_physics(&up, &height).unwrap().starts_with("ground effect"));
        assert_eq!(
            known_physics(&term(Channel::Thrust, Family::Growth, -0.004), &height),
            Some("a tether or a cord")
        );
    }

    #[test]
    fn what_is_held_stands_in_formulas_as_a_number() {
        let constants = [("top", -1.25), ("memory", 0.4), ("roll1", -0.03125), ("bottom", 0.074_112_6)]
            .map(|(name, value)| ConstantDefinition { name: name.into(), unit: "1".into(), value });
        for (text, expected) in [
            ("k * exp((north - top) / decay_top)", "k * exp((north + 1.25) / decay_top)"),
            (
                "roll1 * omega1^2 * k + roll1 * lag(w, memory)",
                "-0.03125 * omega1^2 * k - 0.03125 * lag(w, 0.4)",
            ),
            ("-roll1 * k", "0.03125 * k"),
            (
                "-thrust * k * exp(-(height - bottom) / decay)",
                "-thrust * k * exp(-(height - 0.074113) / decay)",
            ),
        ] {
            assert_eq!(with_numbers(text, &constants), expected);
        }
    }

    #[test]
    fn what_takes_both_signs_has_a_magnitude() {
        let w = [Variable::made_up("w", "m/s", Span { low: -0.6, high: 0.5 })];
        let yaw = term(Channel::Body(Axis::R), Family::Proportional, 1.0);
        assert_eq!(
            sentence(&yaw, &w, 0.02),
            "A yaw acceleration, up to 0.600 rad/s^2 in magnitude, proportional to the airspeed w along the rotors' axis (positive \
             down), with its sign"
        );
    }
}
