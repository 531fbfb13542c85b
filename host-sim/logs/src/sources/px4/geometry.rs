//! Where the motors sit and which way they turn, by PX4's parameters.

use std::collections::BTreeMap;

use super::mixer::{Mixer, Rotor};

/// The motors of a quadcopter in X, in quadlab's order: front-left, front-right, rear-right, rear-left.
pub(super) struct Layout {
    /// PX4's number, from 0, of each motor.
    pub(super) order: [usize; 4],
    /// Seen from above.
    pub(super) spin: [&'static str; 4],
    /// From the centre of mass, front and right.
    pub(super) positions_m: Option<[[f64; 2]; 4]>,
    /// From torques and thrust to PX4's motors, where the log says how.
    pub(super) mixer: Option<Mixer>,
}

/// The layout that parameters say, PX4's own where they say none; refused where it is not an X.
pub(super) fn layout(parameters: &BTreeMap<String, f64>) -> Result<Layout, String> {
    if let Some(airframe) = parameters.get("CA_AIRFRAME").filter(|airframe| **airframe != 0.0) {
        return Err(format!(
            "comes from a craft with other actuators (CA_AIRFRAME {airframe}); quadlab reads only plain quadcopters"
        ));
    }
    match parameters.get("CA_ROTOR_COUNT") {
        Some(4.0) => of_rotors(parameters),
        // A count of nothing is a craft that was not set up: it cannot have flown by these parameters.
        Some(count) if *count != 0.0 => Err(format!(
            "comes from a craft with {count} rotors (CA_ROTOR_COUNT); quadlab reads only quadcopters"
        )),
        _ => match parameters.get("SYS_AUTOSTART") {
            Some(airframe) if (5000.0..6000.0).contains(airframe) => Err(format!(
                "comes from a quadcopter in plus (SYS_AUTOSTART {airframe}); quadlab reads only X frames"
            )),
            _ => Ok(Layout {
                order: [2, 0, 3, 1],
                spin: ["cw", "ccw", "cw", "ccw"],
                positions_m: None,
                mixer: None,
            }),
        },
    }
}

fn of_rotors(parameters: &BTreeMap<String, f64>) -> Result<Layout, String> {
    let mut rotors = [Rotor { x: 0.0, y: 0.0, thrust: 0.0, torque_ratio: 0.0 }; 4];
    for (number, rotor) in rotors.iter_mut().enumerate() {
        let of = |name: &str, default: f64| {
            parameters
                .get(&format!("CA_ROTOR{number}_{name}"))
                .copied()
                .filter(|value| value.is_finite())
                .unwrap_or(default)
        };
        if of("AX", 0.0).hypot(of("AY", 0.0)) > 0.1 * of("AZ", -1.0).abs() || of("AZ", -1.0) >= 0.0 {
            return Err(format!(
                "comes from a craft with rotor {} tilted (CA_ROTOR{number}_AX..AZ); quadlab reads only upright rotors",
                number + 1
            ));
        }
        *rotor =
            Rotor { x: of("PX", 0.0), y: of("PY", 0.0), thrust: of("CT", 6.5), torque_ratio: of("KM", 0.05) };
    }
    let order = corners(&rotors)?;
    let spin = order.map(|motor| if rotors[motor].torque_ratio > 0.0 { "ccw" } else { "cw" });
    if spin[0] != spin[2] || spin[1] != spin[3] || spin[0] == spin[1] {
        return Err(format!(
            "comes from a quadcopter whose motors turn {} (front-left, front-right, rear-right, rear-left; \
             CA_ROTORn_KM): opposite motors must turn the same way",
            spin.join(", ")
        ));
    }
    let positions = order.map(|motor| [rotors[motor].x, rotors[motor].y]);
    // The mixer needs only proportions: many crafts fly with 1 m on each axis, which is not where
    // their rotors are.
    let measured = positions.as_flattened().iter().any(|length| length.abs() != 1.0);
    Ok(Layout { order, spin, positions_m: measured.then_some(positions), mixer: Mixer::of(&rotors) })
}

/// Which motor sits at the front left, front right, rear right, rear left.
fn corners(rotors: &[Rotor; 4]) -> Result<[usize; 4], String> {
    const CORNERS: [(f64, f64); 4] = [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
    // sin 15 degrees: a rotor nearer to an axis than that is at the front or at the side.
    const NEAR_AXIS: f64 = 0.26;
    let at_axis = |rotor: &Rotor| rotor.x.abs().min(rotor.y.abs()) <= NEAR_AXIS * rotor.x.hypot(rotor.y);
    if rotors.iter().all(at_axis) {
        let reason = "comes from a quadcopter in plus (by CA_ROTORn_PX, PY); quadlab reads only X frames";
        return Err(reason.into());
    }
    let mut order = [0; 4];
    for (slot, (front, right)) in order.iter_mut().zip(CORNERS) {
        let here = |rotor: &Rotor| !at_axis(rotor) && rotor.x * front > 0.0 && rotor.y * right > 0.0;
        let Some(motor) = rotors.iter().position(here) else {
            return Err(
                "comes from a quadcopter that is no X (CA_ROTORn_PX, PY): one rotor must be in each corner"
                    .into(),
            );
        };
        *slot = motor;
    }
    Ok(order)
}
