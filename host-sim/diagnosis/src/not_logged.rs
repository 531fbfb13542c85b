//! What flights cannot tell because their logs leave something out: effects that are not looked for, and parts of which what is left
//! is no finding.

use model::{Axis, Effect, GROUPS, Group, NotIdentified, Vehicle};
use sysid::Prepared;

use crate::finding::Unexplained;

/// Quantities made of place and of speed through the air.
const OF_PLACE: [&str; 12] = [
    "u",
    "v",
    "w",
    "speed",
    "horizontal_speed",
    "north_speed",
    "east_speed",
    "down_speed",
    "north",
    "east",
    "down",
    "height",
];

/// Whether some flight does not say where the craft is.
pub(crate) fn lack_position(flights: &[&Prepared]) -> bool {
    flights.iter().any(|flight| !flight.has_position)
}

/// Whether the flights leave out what it takes to tell an effect from others.
pub(crate) fn hide(flights: &[&Prepared], effect: Effect) -> bool {
    let shows_in = |names: &[&str]| effect.quantities().iter().any(|name| names.contains(name));
    lack_position(flights) && (is_sideways(effect) || effect == Effect::TrackingOffset || shows_in(&OF_PLACE))
        || flights.iter().any(|flight| !flight.has_voltage) && shows_in(&["vbat"])
        // Rotors that were measured answer before their commands do, if these stand for them.
        || flights.iter().any(|flight| !flight.has_commands) && matches!(effect, Effect::InputDelay | Effect::MotorLag)
}

/// Whether all of it is a force to the sides. The drag there looks like any other, if nobody knows the speed.
fn is_sideways(effect: Effect) -> bool {
    effect.info().axes.iter().all(|axis| is_to_a_side(*axis))
}

const fn is_to_a_side(axis: Axis) -> bool {
    matches!(axis, Axis::U | Axis::V)
}

/// Drops what is left of forces to the sides, if the flights do not tell the drag there.
pub(crate) fn without_sides(unexplained: &mut Vec<Unexplained>, flights: &[&Prepared]) {
    if lack_position(flights) {
        unexplained.retain(|left| !is_to_a_side(left.axis));
    }
}

/// Parts of which nobody can say that no known effect accounts for what is left there, because effects that could were not looked for.
pub(crate) fn not_told(
    unexplained: &[Unexplained],
    flights: &[&Prepared],
    vehicle: &Vehicle,
) -> Vec<NotIdentified> {
    let is_left = |group: Group| unexplained.iter().any(|left| Group::of(left.axis) == group);
    let of = |group: Group, why: &str, fly: &str| NotIdentified {
        leaves_findings: true,
        ..NotIdentified::of_group(group, why.into(), fly)
    };
    let mut found = Vec::new();
    if lack_position(flights) && is_left(Group::Rotation) {
        let why = "no position is logged, and what is left may go with the speed through the air";
        let fly = "log x, y and z, from motion capture or from the estimator on board";
        found.push(of(Group::Rotation, why, fly));
    }
    let guesses_speeds = |flight: &&Prepared| !flight.has_voltage && !flight.has_rotor_speeds();
    if !vehicle.has_rotor_map() && flights.iter().any(guesses_speeds) {
        let why = "neither the battery voltage is logged nor the motors' map known, so the rotor speeds are uncertain";
        let fly = "log vbat, or measure the motors' map";
        found.extend(GROUPS.into_iter().filter(|group| is_left(*group)).map(|group| of(group, why, fly)));
    }
    found
}
