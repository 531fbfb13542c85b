//! Parameters of rotorpy's `Multirotor` (Folk, Paulos and Kumar 2023, arXiv 2306.04485): a Python file with `quad_params`.
//!
//! Its axes are forward, left, up. Its drag of the rotors is linear in the air's speed and in the speed of the rotors: in hover it is
//! that of the model.

use std::fmt::Write as _;

use model::{Effect, Model};

use crate::craft::{Craft, Rotor, differs_by_rotor, hover_n, is_of_rotors, rigid_coupling};
use crate::error::ExportError;
use crate::left_out::{Export, LeftOut, comments, left_out, none};

/// Time constant where the rotors follow at once: it has to have one, s.
const AT_ONCE_S: f64 = 1e-3;

/// What rotorpy has, whatever the place.
const GRAVITY_M_S2: f64 = 9.81;

pub(crate) fn export(craft: &Craft, model: &Model) -> Result<Export, ExportError> {
    let left_out = what_is_left_out(craft, model);
    let hover_rad_s = hover_rad_s(craft)?;
    let mut text = String::new();
    let _ = writeln!(
        text,
        "# {}, from its identified model: parameters of rotorpy's Multirotor.",
        report::plain_line(&model.vehicle.name)
    );
    let _ = writeln!(
        text,
        "# Axes: forward, left, up. Rotors: front left, front right, rear right, rear left; {} rad/s in hover.",
        hover_rad_s.map(|speed| report::significant(speed, 6)).join(", ")
    );
    text.push_str(&comments(&left_out, "# "));
    let [ixx, iyy, izz] = craft.inertia_kg_m2;
    let _ = writeln!(text, "import numpy as np\n\nquad_params = {{");
    let _ = writeln!(
        text,
        "    'mass': {}, 'Ixx': {ixx}, 'Iyy': {iyy}, 'Izz': {izz}, 'Ixy': 0.0, 'Iyz': 0.0, 'Ixz': 0.0,",
        craft.mass_kg
    );
    let _ = writeln!(text, "    'num_rotors': 4, 'rotor_radius': {},", craft.rotor_radius_m);
    text.push_str("    'rotor_pos': {\n");
    for (k, rotor) in craft.rotors.iter().enumerate() {
        let _ =
            writeln!(text, "        'r{}': np.array([{}, {}, 0.0]),", k + 1, rotor.forward_m, -rotor.right_m);
    }
    // A rotor that turns the nose to the right turns it against the axis up.
    let directions = craft.rotors.map(|rotor| if rotor.torque > 0.0 { -1 } else { 1 });
    let _ = writeln!(text, "    }},\n    'rotor_directions': np.array({directions:?}),");
    let _ = writeln!(text, "    'rI': np.array([0.0, 0.0, 0.0]),");
    let _ = writeln!(text, "    'c_Dx': 0.0, 'c_Dy': 0.0, 'c_Dz': 0.0,");
    let (hover, [x, _, z]) = (hover_rad_s.iter().sum::<f64>(), craft.drag_n_s_m);
    let _ = writeln!(text, "    'k_eta': {}, 'k_m': {},", craft.mean_thrust(), craft.mean_torque());
    let _ = writeln!(text, "    'k_d': {}, 'k_z': {}, 'k_h': 0.0, 'k_flap': 0.0,", x / hover, z / hover);
    let tau_s = craft.lag_rad_s.map_or(AT_ONCE_S, |lag| 1.0 / lag);
    let _ = writeln!(
        text,
        "    'tau_m': {tau_s}, 'rotor_speed_min': 0.0, 'rotor_speed_max': {},",
        craft.most_rad_s
    );
    let _ = writeln!(text, "    'motor_noise_std': 0.0,\n}}");
    Ok(Export { text, left_out })
}

/// Speeds at which rotorpy's rotors, which all have the same thrust and torque, hold the craft.
fn hover_rad_s(craft: &Craft) -> Result<[f64; 4], ExportError> {
    let (thrust, torque) = (craft.mean_thrust(), craft.mean_torque());
    let same = craft.rotors.map(|rotor| Rotor { thrust, torque: torque.copysign(rotor.torque), ..rotor });
    let thrusts = hover_n(&same, craft.mass_kg * craft.gravity_m_s2).ok_or(ExportError::NoHover)?;
    Ok(thrusts.map(|newton| (newton / thrust).sqrt()))
}

fn what_is_left_out(craft: &Craft, model: &Model) -> Vec<LeftOut> {
    let mut all = left_out(model, |effect| match effect {
        Effect::InertiaCoupling => rigid_coupling(craft, model),
        Effect::LinearDrag => Some(format!(
            "becomes drag of the rotors, which grows with their speed and brakes turning too. It matches the model in hover, with the \
             forward coefficient {} N s/m to the side too, where the model has {}",
            craft.drag_n_s_m[0], craft.drag_n_s_m[1]
        )),
        Effect::RotorMoments => Some("every rotor has the mean torque; their levers are the model's".into()),
        effect if differs_by_rotor(effect) => {
            Some("every rotor has the mean thrust at the same speed".into())
        }
        effect if is_of_rotors(effect) || effect == Effect::MotorLag => None,
        effect => none(model, effect),
    });
    if (craft.gravity_m_s2 - GRAVITY_M_S2).abs() > 1e-9 {
        let why = format!("rotorpy has {GRAVITY_M_S2} m/s^2, the model {}", craft.gravity_m_s2);
        all.push(LeftOut { effect: "gravity".into(), why });
    }
    if craft.lag_rad_s.is_none() {
        all.push(LeftOut {
            effect: "motors.lag".into(),
            why: format!(
                "rotorpy needs a time constant of the rotors: {AT_ONCE_S} s, which is as good as none"
            ),
        });
    }
    all
}
