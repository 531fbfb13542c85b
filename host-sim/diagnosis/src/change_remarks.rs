//! What a reader is to know of the changes that are named: which have one cause, what they mean at the craft, and what was estimated with them.

use model::{Effect, Model};
use report::number::fixed;

use crate::change::{ALL_ROTORS, Change};
use crate::change_together::Found;
use crate::finding::{CoefficientFigures, EffectFinding};
use crate::leaning::{PROPELLER_TORQUE, lean};
use crate::reason::{Reason, joined};

/// Standard errors within which a tracked point has stayed where it was.
const SAME_ERRORS: f64 = 4.0;
/// By what part thrust and torque of a motor may differ and still have changed alike.
const ALIKE: f64 = 0.1;

/// What is to be known of the changes that are named, and of a torque that has changed [`alike`].
pub(crate) fn remarks(
    model: &Model,
    named: &[&Found],
    of_alike: Option<&Found>,
    revealed: &[Effect],
) -> String {
    let of_motors = named.iter().map(|found| leaning(model, found, named) + &torque(found, named));
    moved_together(named)
        + &of_motors.collect::<String>()
        + &together(of_alike)
        + &added_to(model, named)
        + &estimated_with(revealed)
}

fn find<'a>(named: &[&'a Found], effect: Effect) -> Option<&'a EffectFinding> {
    named.iter().find(|(change, _)| change.effect == effect).map(|(_, finding)| finding)
}

/// " com-offset and tracking-offset have the same cause, ..." A centre of mass that moves leaves the tracked point behind: two changes of the
/// model, one of the craft.
fn moved_together(named: &[&Found]) -> String {
    let of = |effect| find(named, effect).map(|finding| finding.coefficients.as_slice());
    let (Some(moved), Some(lever)) = (of(Effect::ComOffset), of(Effect::TrackingOffset)) else {
        return String::new();
    };
    let stays = |(moved, lever): (&CoefficientFigures, &CoefficientFigures)| {
        (moved.value + lever.value).abs() < SAME_ERRORS * moved.std_error.hypot(lever.std_error)
    };
    match moved.iter().zip(lever).all(stays) {
        true => " com-offset and tracking-offset have the same cause: the centre of mass has moved, and the tracked point has stayed where it was on the frame.".into(),
        false => String::new(),
    }
}

/// " The rotor axis of motor 1 (front left) is tilted by 6.0 deg toward the front right: ..."
fn leaning(model: &Model, (change, finding): &Found, named: &[&Found]) -> String {
    let of_one = change.motor.filter(|_| change.effect == Effect::MotorTilt);
    let Some((motor, lean)) =
        of_one.and_then(|motor| Some((motor, lean(model, motor, &finding.coefficients)?)))
    else {
        return String::new();
    };
    let tilted = format!("tilted by {} deg toward the {}", fixed(lean.angle_deg, 1), side(lean.towards_deg));
    let place = place(motor);
    let mut text = match rivals(finding).is_empty() {
        true => format!(" The rotor axis of {place} is {tilted}: its arm or mount is probably bent."),
        false => format!(
            " If {place} is the cause, its rotor axis is {tilted}: check its arm and mount, and the other possible causes."
        ),
    };
    let also = [Effect::ComOffset, Effect::MotorEfficiency, Effect::MassChange, Effect::MotorTorque];
    let beside: Vec<Change> =
        named.iter().map(|(change, _)| *change).filter(|change| also.contains(&change.effect)).collect();
    if !beside.is_empty() {
        text += &format!(
            " A bent arm also shifts the rotor, tilts its reaction torque and reduces its lift: this may explain {} as well.",
            joined(&beside, " and ")
        );
    }
    text
}

/// What explains new flights as well as a change, where that was asked.
fn rivals(finding: &EffectFinding) -> &[Change] {
    match &finding.reason {
        Reason::Changed { rivals, .. } | Reason::BalanceShifted { rivals, .. } => rivals,
        _ => &[],
    }
}

/// "motor 1 (front left)"
fn place(motor: u8) -> String {
    const PLACES: [&str; 4] = ["front left", "front right", "rear right", "rear left"];
    format!("motor {motor} ({})", PLACES[usize::from(motor - 1) % 4])
}

/// The side of a craft, from a direction clockwise from ahead.
fn side(towards_deg: f64) -> &'static str {
    const SIDES: [&str; 8] =
        ["front", "front right", "right", "rear right", "rear", "rear left", "left", "front left"];
    SIDES[(towards_deg.rem_euclid(360.0) / 45.0).round() as usize % 8]
}

/// What another reaction torque means.
fn torque((change, finding): &Found, named: &[&Found]) -> String {
    let of_one = change.motor.filter(|_| change.effect == Effect::MotorTorque);
    let (Some(motor), [size]) = (of_one, finding.coefficients.as_slice()) else { return String::new() };
    let may_be_another = rivals(finding).iter().any(|other| other.effect == change.effect);
    let weak = |of: &&&Found| of.0 == Change { motor: Some(motor), ..ALL_ROTORS };
    let thrust = named.iter().find(weak).and_then(|(_, finding)| finding.coefficients.first());
    if size.value.abs() > PROPELLER_TORQUE {
        bent(motor, size.value, may_be_another, find(named, Effect::MotorTilt).is_some())
    } else if let Some(loss) = thrust {
        of_propeller(&place(motor), loss)
    } else if named.iter().any(|(other, _)| *other == ALL_ROTORS) {
        " Several rotors have changed: only the net yaw moment is known well, not each rotor's share of the torque.".into()
    } else if may_be_another {
        " These flights do not show which motor's torque has changed, only that the yaw moment has.".into()
    } else {
        String::new()
    }
}

/// Of a torque that no propeller has.
fn bent(motor: u8, size: f64, may_be_another: bool, pushes: bool) -> String {
    let whose = match may_be_another {
        true => "an arm or mount is probably bent, but these flights do not show which".to_owned(),
        false => format!("the arm or mount of {} is probably bent", place(motor)),
    };
    let push = if pushes { "" } else { " The sideways force of a bent arm does not show in these flights." };
    format!(" A propeller does not change its torque by {} %: {whose}.{push}", fixed(100.0 * size, 0))
}

/// Of a motor whose thrust and torque have changed by different fractions.
fn of_propeller(place: &str, loss: &CoefficientFigures) -> String {
    let which = if loss.value > 0.0 { "a damaged propeller" } else { "another propeller" };
    format!(" motor-efficiency and motor-torque of {place} probably have one cause: {which}.")
}

/// The torque of a motor whose thrust has changed by the same fraction: one change, of its speed or its propeller.
pub(crate) fn alike<'a>(named: &[&'a Found]) -> Option<&'a Found> {
    let is_alike = |(change, finding): &Found| {
        let thrust = Change { motor: change.motor, ..ALL_ROTORS };
        let loss =
            named.iter().find(|(other, _)| *other == thrust).map(|(_, finding)| &finding.coefficients[..]);
        let (Some([loss]), [torque]) = (loss, &finding.coefficients[..]) else { return false };
        let allowed = ALIKE * loss.value.abs() + SAME_ERRORS * loss.std_error.hypot(torque.std_error);
        (loss.value + torque.value).abs() < allowed
    };
    let of_one = |found: &&&Found| found.0.effect == Effect::MotorTorque && found.0.motor.is_some();
    named.iter().copied().find(|found| of_one(&found) && is_alike(found))
}

/// " Thrust and torque of motor 2 (front right) have changed alike (torque by -14.0 %): ..."
fn together(torque: Option<&Found>) -> String {
    let Some((Change { motor: Some(motor), .. }, finding)) = torque else { return String::new() };
    let size = finding.coefficients.first().map_or(0.0, |torque| torque.value);
    let turns = if size < 0.0 { "more slowly" } else { "faster" };
    format!(
        " Thrust and torque of {} have changed alike (torque by {} %): it turns {turns} than the model expects, or has another propeller.",
        place(*motor),
        fixed(100.0 * size, 1)
    )
}

/// " The model already includes steady-wind: the size is the difference from the model's."
fn added_to(model: &Model, named: &[&Found]) -> String {
    let known: Vec<Effect> =
        named.iter().map(|(change, _)| change.effect).filter(|effect| model.has(*effect)).collect();
    match known.as_slice() {
        [] => String::new(),
        known => {
            format!(
                " The model already includes {}: the size is the difference from the model's.",
                joined(known, " and ")
            )
        }
    }
}

/// " quadratic-drag was estimated together with it, ..."
fn estimated_with(together: &[Effect]) -> String {
    let were = if together.len() == 1 { "was" } else { "were" };
    match together {
        [] => String::new(),
        effects => format!(
            " {} {were} estimated together with it, because these flights show more of it than those of the model.",
            joined(effects, " and ")
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reason::Reason;
    use crate::testing::truth;

    fn found(effect: Effect, motor: Option<u8>, values: &[f64]) -> Found {
        let change = Change { effect, motor };
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        (finding.supported, finding.motor) = (true, motor);
        let figures =
            |(k, value): (usize, &f64)| CoefficientFigures::of_change((effect, k), *value, 1e-4, &truth());
        finding.coefficients = change.coefficients().into_iter().zip(values).map(figures).collect();
        (change, finding)
    }

    fn said(named: &[Found]) -> String {
        let mut named: Vec<&Found> = named.iter().collect();
        let of_alike = alike(&named);
        named.retain(|found| of_alike.is_none_or(|torque| torque.0 != found.0));
        remarks(&truth(), &named, of_alike, &[])
    }

    #[test]
    fn a_leaning_motor_is_told_in_degrees_and_sides() {
        let thrust = truth().term(Effect::Thrust).unwrap().values()[0];
        let push = thrust * 5_f64.to_radians().tan() / 2_f64.sqrt();
        let tilted = found(Effect::MotorTilt, Some(3), &[-push, push, 0.1]);
        assert_eq!(
            said(std::slice::from_ref(&tilted)),
            " The rotor axis of motor 3 (rear right) is tilted by 5.0 deg toward the rear right: its arm or mount is probably bent."
        );
        let mut doubted = tilted.clone();
        let rivals = vec![Change { effect: Effect::AttitudeOffset, motor: None }];
        doubted.1.reason = Reason::Changed { axes: &[], percent: 90.0, rivals };
        assert!(said(&[doubted]).contains("If motor 3 (rear right) is the cause"));
        let moved = found(Effect::ComOffset, None, &[0.001, 0.0]);
        assert!(said(&[tilted.clone(), moved]).ends_with("this may explain com-offset as well."));
        let sides = [0.0, 22.0, 23.0, -90.0, -179.0, 359.0].map(side);
        assert_eq!(sides, ["front", "front", "front right", "left", "rear", "front"]);
        // Half of it was known.
        let mut model = truth();
        let mut known = vec![0.0; 12];
        (known[6], known[7]) = (-push, push);
        model.set(Effect::MotorTilt, &known);
        assert!(
            leaning(&model, &tilted, &[]).contains("tilted by 9.9 deg"),
            "{}",
            leaning(&model, &tilted, &[])
        );
    }

    #[test]
    fn a_torque_is_a_propellers_or_a_bent_arms() {
        let torque = |size| found(Effect::MotorTorque, Some(2), &[size]);
        let weak = |motor, losses: &[f64]| found(Effect::MotorEfficiency, motor, losses);
        let bent = said(&[torque(0.99)]);
        assert!(
            bent.contains("by 99 %: the arm or mount of motor 2 (front right) is probably bent."),
            "{bent}"
        );
        let mut doubted = torque(0.99);
        let rivals = vec![Change { effect: Effect::MotorTorque, motor: Some(4) }];
        doubted.1.reason = Reason::Changed { axes: &[], percent: 90.0, rivals };
        assert!(said(&[doubted]).contains("do not show which"));
        assert_eq!(said(&[torque(-0.05)]), "");
        assert!(said(&[weak(Some(2), &[0.08]), torque(-0.05)]).contains("a damaged propeller"));
        assert!(said(&[weak(Some(2), &[0.08]), torque(-0.082)]).contains("turns more slowly"));
        assert!(said(&[weak(Some(2), &[-0.04]), torque(0.04)]).contains("turns faster"));
        assert_eq!(said(&[weak(Some(1), &[0.08]), torque(-0.05)]), "");
        assert!(
            said(&[weak(None, &[0.0, 0.06, 0.0, 0.04]), torque(-0.05)]).contains("only the net yaw moment")
        );
    }
}
