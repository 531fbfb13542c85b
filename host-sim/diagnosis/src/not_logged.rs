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
        let why = "no position is logged, and the residual may depend on the airspeed";
        let fly = "log x, y and z, from motion capture or from the estimator on board";
        found.push(of(Group::Rotation, why, fly));
    }
    let guesses_speeds = |flight: &&Prepared| !flight.has_voltage && !flight.has_rotor_speeds();
    if !vehicle.has_rotor_map() && flights.iter().any(guesses_speeds) {
        let why = "neither the battery voltage nor the motor map is known, so the rotor speeds are uncertain";
        let fly = "log vbat, or measure the motor map";
        found.extend(GROUPS.into_iter().filter(|group| is_left(*group)).map(|group| of(group, why, fly)));
    }
    found
}

#[cfg(test)]
mod tests {
    use model::MotorMapKind;

    use super::*;
    use crate::dependence::Dependence;
    use crate::finding::Unexplained;
    use crate::testing::{NONE, prepared, truth};

    fn left(axis: Axis) -> Unexplained {
        Unexplained { axis, depends_on: Dependence::Past, share_percent: 10.0, p_value: 0.0 }
    }

    /// A flight that logs everything but what is left out of it.
    fn without(leave_out: impl Fn(&mut Prepared)) -> Prepared {
        let mut flight = prepared(&truth(), 1..2, 4.0, &NONE).remove(0);
        leave_out(&mut flight);
        flight
    }

    /// By physics: winds, drags and tethers take a place or a speed, the battery its voltage, delays the commands; what turns the craft by
    /// its own rates takes none of them.
    #[test]
    fn an_effect_is_hidden_by_what_it_shows_in() {
        let of_place = [
            Effect::SteadyWind,
            Effect::QuadraticDrag,
            Effect::GroundEffect,
            Effect::Tether,
            Effect::TranslationalLift,
            Effect::TrackingOffset,
        ];
        let hidden = |flight: &Prepared| -> Vec<Effect> {
            let others =
                [Effect::BatteryVoltage, Effect::InputDelay, Effect::MotorLag, Effect::QuadraticYawDamping];
            of_place.into_iter().chain(others).filter(|effect| hide(&[flight], *effect)).collect()
        };
        let whole = without(|_| ());
        assert_eq!(hidden(&whole), []);
        let nowhere = without(|flight| flight.has_position = false);
        assert_eq!(hidden(&nowhere), of_place);
        assert_eq!(hidden(&without(|flight| flight.has_voltage = false)), [Effect::BatteryVoltage]);
        assert_eq!(
            hidden(&without(|flight| flight.has_commands = false)),
            [Effect::InputDelay, Effect::MotorLag]
        );
        assert!(hide(&[&whole, &nowhere], Effect::SteadyWind), "one flight is enough");
    }

    #[test]
    fn forces_to_the_sides_mean_nothing_where_nobody_knows_the_place() {
        let (whole, nowhere) = (without(|_| ()), without(|flight| flight.has_position = false));
        let axes = |flight: &Prepared| {
            let mut unexplained = model::AXES.map(left).to_vec();
            without_sides(&mut unexplained, &[flight]);
            unexplained.iter().map(|left| left.axis).collect::<Vec<Axis>>()
        };
        assert_eq!(axes(&whole), model::AXES);
        assert_eq!(axes(&nowhere), [Axis::W, Axis::P, Axis::Q, Axis::R]);
    }

    /// Without a position it is the rotation, where rotor speeds are a guess it is what is left in either; findings stand.
    #[test]
    fn what_could_be_due_to_what_was_not_logged_is_not_told() {
        let (known, mut unknown) = (truth().vehicle, truth().vehicle);
        (unknown.motors.map, unknown.motors.command) = (Some(MotorMapKind::Identify), None);
        let nowhere = without(|flight| flight.has_position = false);
        let no_voltage = without(|flight| flight.has_voltage = false);
        let groups = |axes: &[Axis], flight: &Prepared, vehicle: &Vehicle| {
            let unexplained: Vec<Unexplained> = axes.iter().copied().map(left).collect();
            let found = not_told(&unexplained, &[flight], vehicle);
            assert!(found.iter().all(|part| part.leaves_findings && part.axis.is_none()));
            found.into_iter().map(|part| (part.group, part.fly)).collect::<Vec<_>>()
        };
        let [(Group::Rotation, fly)] = &groups(&[Axis::W, Axis::P], &nowhere, &known)[..] else {
            panic!("the rotation alone")
        };
        assert!(fly.starts_with("log x, y and z"), "{fly}");
        assert_eq!(groups(&[Axis::W], &nowhere, &known), []);
        assert_eq!(groups(&[Axis::W, Axis::P], &no_voltage, &known), []);
        let [(Group::Translation, _), (Group::Rotation, fly)] =
            &groups(&[Axis::W, Axis::P], &no_voltage, &unknown)[..]
        else {
            panic!("both")
        };
        assert!(fly.starts_with("log vbat"), "{fly}");
        assert_eq!(groups(&[], &no_voltage, &unknown), []);
    }
}
