//! Parameters of PX4: of its simulation-in-hardware (SIH, `SIH_*`), and the geometry of the rotors for control allocation (`CA_*`), in
//! the text format that QGroundControl loads.
//!
//! SIH's equations are those of `generate_force_and_torques` in PX4's `sih.cpp`: thrust and torque in proportion to the motors'
//! commands, which lag; one lever, one torque and one drag; rotors 1 and 2 turn the nose to the right.

use std::fmt::Write as _;

use model::{Effect, Model};

use crate::craft::{Craft, differs_by_rotor, is_of_rotors, rigid_coupling};
use crate::error::ExportError;
use crate::left_out::{Export, LeftOut, comments, left_out, none};

/// PX4's order of the rotors of an X: front right, rear left, front left, rear right, by their places among ours.
const ORDER: [usize; 4] = [1, 3, 0, 2];
/// MAVLink's numbers of types.
const REAL: u8 = 9;
const INTEGER: u8 = 6;

pub(crate) fn export(craft: &Craft, model: &Model) -> Result<Export, ExportError> {
    let left_out = what_is_left_out(craft, model);
    let square = craft.most_rad_s * craft.most_rad_s;
    let mean =
        |of: fn(&crate::Rotor) -> f64| craft.rotors.iter().map(|rotor| of(rotor).abs()).sum::<f64>() / 4.0;
    let [ixx, iyy, izz] = craft.inertia_kg_m2;
    let mut real = vec![
        ("SIH_MASS".to_owned(), craft.mass_kg),
        ("SIH_IXX".into(), ixx),
        ("SIH_IYY".into(), iyy),
        ("SIH_IZZ".into(), izz),
        ("SIH_IXY".into(), 0.0),
        ("SIH_IXZ".into(), 0.0),
        ("SIH_IYZ".into(), 0.0),
        ("SIH_T_MAX".into(), most_n(craft)),
        ("SIH_Q_MAX".into(), if turns_as_usual(craft) { 1.0 } else { -1.0 } * craft.mean_torque() * square),
        ("SIH_L_ROLL".into(), mean(|rotor| rotor.right_m)),
        ("SIH_L_PITCH".into(), mean(|rotor| rotor.forward_m)),
        ("SIH_KDV".into(), 0.5 * (craft.drag_n_s_m[0] + craft.drag_n_s_m[1])),
        ("SIH_KDW".into(), 0.0),
    ];
    if let Some(lag) = craft.lag_rad_s {
        real.push(("SIH_T_TAU".into(), 1.0 / lag));
    }
    for (k, place) in ORDER.into_iter().enumerate() {
        let rotor = craft.rotors[place];
        real.push((format!("CA_ROTOR{k}_PX"), rotor.forward_m));
        real.push((format!("CA_ROTOR{k}_PY"), rotor.right_m));
        // Positive where the rotor turns against the clock seen from above, so that the nose turns to the right.
        real.push((format!("CA_ROTOR{k}_KM"), rotor.torque / rotor.thrust));
    }
    let mut text = format!(
        "# {}, from its identified model: parameters of PX4.\n",
        report::plain_line(&model.vehicle.name)
    );
    text.push_str(&comments(&left_out, "# "));
    text.push_str("# Vehicle-Id Component-Id Name Value Type\n");
    let _ = writeln!(text, "1\t1\tCA_ROTOR_COUNT\t4\t{INTEGER}");
    for (name, value) in real {
        let _ = writeln!(text, "1\t1\t{name}\t{value}\t{REAL}");
    }
    Ok(Export { text, left_out })
}

/// Full thrust of a rotor, N.
fn most_n(craft: &Craft) -> f64 {
    craft.mean_thrust() * craft.most_rad_s * craft.most_rad_s
}

/// Whether rotors turn as PX4's simulation has them: front right and rear left against the clock seen from above.
fn turns_as_usual(craft: &Craft) -> bool {
    craft.rotors[ORDER[0]].torque > 0.0
}

fn what_is_left_out(craft: &Craft, model: &Model) -> Vec<LeftOut> {
    let mut all = left_out(model, |effect| match effect {
        Effect::InertiaCoupling => rigid_coupling(craft, model),
        Effect::LinearDrag => Some(format!(
            "one drag for all axes, the mean of forward and sideward; the model has {} N s/m forward, right and down",
            craft.drag_n_s_m.map(|drag| report::significant(drag, 4)).join(", ")
        )),
        Effect::RotorMoments => Some(
            "SIH has one lever and one torque for all rotors, their means; CA_ROTOR* has each rotor's own"
                .into(),
        ),
        effect if differs_by_rotor(effect) => {
            Some("every rotor has the mean thrust at the same speed".into())
        }
        effect if is_of_rotors(effect) || effect == Effect::MotorLag => None,
        effect => none(model, effect),
    });
    let share = craft.mass_kg * craft.gravity_m_s2 / (4.0 * most_n(craft));
    let map = format!(
        "thrust grows in proportion to the command in SIH, and the lag acts on it; {} of the full command hovers",
        report::significant(share, 3)
    );
    all.push(LeftOut { effect: "motors.map".into(), why: map });
    if !turns_as_usual(craft) {
        all.push(LeftOut {
            effect: "rotor directions".into(),
            why: "the rotors turn against PX4's usual directions: SIH_Q_MAX is negative for that, below its documented minimum of 0; \
                  with a positive one, yaw would diverge"
                .into(),
        });
    }
    all
}
