//! A form in plain English: what acts, on what it depends and how, how strong it is, and which known physics behaves so.

use model::Axis;
use report::number::significant;

use crate::discovery::channels::Channel;
use crate::discovery::form::Form;
use crate::discovery::refine::Refined;
use crate::discovery::shapes::Family;
use crate::discovery::variables::Variable;

/// Digits that a number in a sentence has.
const DIGITS: usize = 3;

fn number(value: f64) -> String {
    significant(value, DIGITS)
}

/// A quantity as people call it.
pub(crate) fn called(variable: &Variable) -> &str {
    match variable.name {
        "u" => "forward speed through the air",
        "v" => "sideward speed through the air",
        "w" => "sink rate through the air",
        "speed" => "airspeed",
        "horizontal_speed" => "horizontal airspeed",
        "north_speed" => "speed north",
        "east_speed" => "speed east",
        "down_speed" => "sink rate",
        "north" => "place north",
        "east" => "place east",
        "p" => "roll rate",
        "q" => "pitch rate",
        "r" => "yaw rate",
        "phi" => "roll angle",
        "theta" => "pitch angle",
        "psi" => "heading",
        "omega1" => "speed of rotor 1",
        "omega2" => "speed of rotor 2",
        "omega3" => "speed of rotor 3",
        "omega4" => "speed of rotor 4",
        "rotor_speed" => "mean rotor speed",
        "vbat" => "battery voltage",
        other => other,
    }
}

/// What a form does, in a sentence.
pub(crate) fn sentence(term: &Refined, variables: &[Variable], thrust_coefficient: f64) -> String {
    let form = &term.form;
    let how: Vec<String> = (0..form.factors.len()).map(|index| shape_words(form, index, variables)).collect();
    let size = size(term, variables, thrust_coefficient);
    let subject = form.channel.meaning();
    let mut text = format!("{subject} {}: {size}", how.join(", and "));
    if let Some(first) = text.get(..1) {
        text = format!("{}{}", first.to_uppercase(), &text[1..]);
    }
    text
}

/// How a form depends on one of its quantities.
fn shape_words(form: &Form, index: usize, variables: &[Variable]) -> String {
    let factor = &form.factors[index];
    let variable = &variables[factor.variable];
    let (name, unit) = (called(variable), if variable.unit == "1" { "" } else { &variable.unit });
    let value = |k: usize| {
        let value = number(form.value((index, k)));
        if unit.is_empty() { value } else { format!("{value} {unit}") }
    };
    match factor.shape.family {
        Family::Proportional => format!("grows in proportion to the {name}"),
        Family::Straight => format!("changes evenly with the {name} and is zero at {}", value(0)),
        Family::Square => format!("grows with the square of the {name}"),
        Family::Cube => format!("grows with the cube of the {name}"),
        Family::Modulus => format!("grows with the magnitude of the {name}"),
        Family::SignedSquare => format!("grows with the square of the {name} and follows its sign"),
        Family::HingeAbove => format!("sets in where the {name} exceeds {} and grows from there", value(0)),
        Family::HingeBelow => {
            format!("sets in where the {name} falls below {} and grows from there", value(0))
        }
        Family::Step => format!("sets in where the {name} passes {}, within about {}", value(0), value(1)),
        Family::Saturation => format!("follows the sign of the {name} and is full beyond about {}", value(0)),
        Family::Decay => format!("fades as the {name} grows, to 37 % every {}", value(0)),
        Family::Growth => format!("grows with the {name}, by a factor of 2.7 every {}", value(0)),
        Family::InverseSquare => format!("falls with the square of the {name} plus {}", value(0)),
        Family::Bump => format!("acts where the {name} is near {}, within about {}", value(0), value(1)),
    }
}

/// How strong it is at most, over where its quantities went.
fn size(term: &Refined, variables: &[Variable], thrust_coefficient: f64) -> String {
    let form = &term.form;
    let strongest = |index: usize| {
        let factor = &form.factors[index];
        let span = variables[factor.variable].span;
        let at = |k: i32| factor.shape.at(span.low + span.length() * f64::from(k) / 200.0);
        (0..=200).map(at).fold(0.0_f64, |most, value| if value.abs() > most.abs() { value } else { most })
    };
    let shape: f64 = (0..form.factors.len()).map(strongest).product();
    let most: Vec<f64> = term.amplitudes.iter().map(|amplitude| amplitude * shape).collect();
    let one = most.first().copied().unwrap_or(0.0);
    match form.channel {
        Channel::Thrust => {
            let percent = 100.0 * one / thrust_coefficient;
            format!("{} % of the thrust at most", number(percent))
        }
        Channel::Rotor(..) => format!("{} % of it at most", number(100.0 * one)),
        Channel::Horizontal => {
            let [north, east] = [0, 1].map(|k| number(most.get(k).copied().unwrap_or(0.0)));
            format!("{north} N north and {east} N east at most")
        }
        channel => format!("{} {} at most", number(one), channel.unit()),
    }
}

/// The formula of a form with its numbers left as names: one row after the other.
pub(crate) fn formula(rows: &std::collections::BTreeMap<String, String>) -> String {
    rows.iter().map(|(row, text)| format!("{row}: {text}")).collect::<Vec<_>>().join("; ")
}

/// A form in short, to tell rivals apart.
pub(crate) fn short(form: &Form, variables: &[Variable]) -> String {
    let names: Vec<&str> = form.variables().iter().map(|index| called(&variables[*index])).collect();
    format!("{} that depends on the {}", form.channel.meaning(), names.join(" and the "))
}

/// Known physics that behaves so, with its source.
pub(crate) fn known_physics(form: &Form, variables: &[Variable]) -> Option<&'static str> {
    let names: Vec<&str> = form.variables().iter().map(|index| variables[*index].name).collect();
    let on = |of: &[&str]| names.iter().any(|name| of.contains(name));
    let family = form.factors.first()?.shape.family;
    let upright = matches!(form.channel, Channel::Thrust | Channel::Body(Axis::W) | Channel::Earth(2));
    let sideward = matches!(
        form.channel,
        Channel::Horizontal | Channel::Earth(0 | 1) | Channel::Body(Axis::U | Axis::V)
    );
    let drag = matches!(form.channel, Channel::Drag | Channel::HorizontalDrag);
    let told = match (form.channel, family) {
        _ if names.iter().any(|name| name.starts_with("other_") || name.ends_with("the other craft")) => {
            "the downwash of another craft does so"
        }
        (_, Family::Growth) if upright && on(&["height"]) => {
            "a ceiling does so (Rossow, NASA TM-86754, 1985; Hsiao and Chirarattananon, IEEE/ASME Trans. Mechatronics 24, 2019)"
        }
        _ if upright && on(&["height"]) => {
            "the ground does so (Cheeseman and Bennett, ARC R&M 3021, 1955), or a magnet or a cord at the floor"
        }
        (_, Family::HingeAbove | Family::Step | Family::Bump) if upright && on(&["w", "down_speed"]) => {
            "the vortex ring state does so (Johnson, NASA/TP-2005-213477)"
        }
        _ if upright && on(&["time", "vbat"]) => "motors that warm up, or a battery that weakens, do so",
        _ if upright && on(&["north", "east"]) => {
            "the edge of a table, or a downdraught in a part of the room, does so"
        }
        (Channel::Rotor(..), _) if on(&["time"]) => "a motor or a propeller that fails does so",
        (Channel::Body(Axis::R), _) if on(&["v"]) => {
            "a craft that turns into the wind like a weathercock does so"
        }
        (Channel::Body(Axis::R), _) if on(&["psi", "sine of the heading", "cosine of the heading"]) => {
            "a cable that twists does so"
        }
        _ if drag && on(&["north", "east", "height"]) => {
            "moving air in a part of the room, such as a curtain of it, does so"
        }
        _ if sideward && on(&["time"]) => "a draught does so: a door that opens, a fan that is switched on",
        _ if sideward && on(&["north", "east", "height"]) => {
            "the jet of a fan, a wall, or wind that changes with height does so"
        }
        _ => return None,
    };
    Some(told)
}

/// What to fly so that quantities that go together in these flights part.
pub(crate) fn to_fly(form: &Form, rivals: &[Form], variables: &[Variable]) -> String {
    let own = form.variables();
    let names = |of: &[usize]| {
        of.iter().map(|index| called(&variables[*index])).collect::<Vec<_>>().join(" and the ")
    };
    let mut others: Vec<usize> =
        rivals.iter().flat_map(Form::variables).filter(|index| !own.contains(index)).collect();
    others.sort_unstable();
    others.dedup();
    let is_time = |index: &usize| variables[*index].name == model::user_effects::TIME_COLUMN;
    match (own.iter().any(is_time), others.is_empty()) {
        (true, _) => {
            "fly the same pattern again at another time: what depends on the time stays where it was".into()
        }
        (false, true) => format!("vary the {} over more than these flights did", names(&own)),
        (false, false) => format!("vary the {} while the {} stays the same", names(&own), names(&others)),
    }
}
