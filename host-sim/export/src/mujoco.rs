//! MuJoCo's MJCF: a free body with a site for each rotor and an actuator that pulls and turns there.
//!
//! MuJoCo's axes are forward, left, up; the control of an actuator is the rotor's thrust, N.

use std::fmt::Write as _;

use model::{Effect, Model};

use crate::craft::{Craft, differs_by_rotor, is_of_rotors, rigid_coupling};
use crate::error::ExportError;
use crate::left_out::{Export, LeftOut, comments, escaped, left_out, none, without_ends_of_comments};

/// Step of the simulation, s: far below the rotors' lag.
const STEP_S: f64 = 0.002;

pub(crate) fn export(craft: &Craft, model: &Model) -> Result<Export, ExportError> {
    let left_out = what_is_left_out(craft, model);
    let mut text = head(craft, model, &left_out);
    body(&mut text, craft);
    rotors(&mut text, craft);
    let thrusts = craft.hover_n.map(|thrust| thrust.to_string()).join(" ");
    let now = craft.lag_rad_s.map_or_else(String::new, |_| format!(r#" act="{thrusts}""#));
    let _ = writeln!(
        text,
        r#"  <keyframe>
    <key name="hover" qpos="0 0 1 1 0 0 0" ctrl="{thrusts}"{now}/>
  </keyframe>"#
    );
    text += r#"  <sensor>
    <framepos objtype="body" objname="craft"/>
    <framequat objtype="body" objname="craft"/>
  </sensor>
</mujoco>
"#;
    Ok(Export { text, left_out })
}

fn head(craft: &Craft, model: &Model, left_out: &[LeftOut]) -> String {
    format!(
        r#"<!--
  {}, from its identified model.
  Axes: forward, left, up. Controls: thrust of each rotor, N, in the order front left, front right, rear right,
  rear left; the key "hover" has those that hold the craft. A rotor at w rad/s pulls with {:e} w^2 N.
{}-->
<mujoco model="{}">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{STEP_S}" gravity="0 0 {}" integrator="RK4"/>
"#,
        without_ends_of_comments(&model.vehicle.name),
        craft.mean_thrust(),
        without_ends_of_comments(&comments(left_out, "  ")),
        escaped(&model.vehicle.name),
        -craft.gravity_m_s2
    )
}

/// The floor, and the craft with a place for each rotor.
fn body(text: &mut String, craft: &Craft) {
    let [ixx, iyy, izz] = craft.inertia_kg_m2;
    let _ = writeln!(
        text,
        r#"  <worldbody>
    <light pos="0 0 4"/>
    <geom name="floor" type="plane" size="10 10 0.1" rgba="0.8 0.8 0.8 1"/>
    <body name="craft" pos="0 0 1">
      <freejoint name="craft"/>
      <inertial pos="0 0 0" mass="{}" diaginertia="{ixx} {iyy} {izz}"/>"#,
        craft.mass_kg
    );
    for (k, rotor) in craft.rotors.iter().enumerate() {
        let (x, y) = (rotor.forward_m, -rotor.right_m);
        let _ = writeln!(
            text,
            r#"      <site name="rotor{}" pos="{x} {y} 0"/>
      <geom type="cylinder" pos="{x} {y} 0" size="{} 0.005" mass="0" contype="0" conaffinity="0" rgba="0.2 0.4 0.7 0.4"/>"#,
            k + 1,
            craft.rotor_radius_m
        );
    }
    *text += r#"      <geom name="hull" type="sphere" size="0.04" mass="0" rgba="0.1 0.1 0.1 1"/>
    </body>
  </worldbody>
"#;
}

fn rotors(text: &mut String, craft: &Craft) {
    let filter = craft
        .lag_rad_s
        .map_or_else(String::new, |lag| format!(r#" dyntype="filterexact" dynprm="{}""#, 1.0 / lag));
    *text += "  <actuator>\n";
    for (k, rotor) in craft.rotors.iter().enumerate() {
        let _ = writeln!(
            text,
            r#"    <general name="rotor{0}" site="rotor{0}" gear="0 0 1 0 0 {1}" ctrlrange="0 {2}"{filter}/>"#,
            k + 1,
            -rotor.torque / rotor.thrust,
            rotor.thrust * craft.most_rad_s * craft.most_rad_s
        );
    }
    *text += "  </actuator>\n";
}

fn what_is_left_out(craft: &Craft, model: &Model) -> Vec<LeftOut> {
    let lag =
        "the lag acts on the thrust of each rotor instead of its speed, which is the same for small changes";
    let mut all = left_out(model, |effect| match effect {
        Effect::InertiaCoupling => rigid_coupling(craft, model),
        Effect::MotorLag => Some(lag.into()),
        effect if differs_by_rotor(effect) => {
            Some("the controls are thrusts: at the same speed each rotor gives the mean thrust".into())
        }
        effect if is_of_rotors(effect) => None,
        effect => none(model, effect),
    });
    if craft.lag_rad_s.is_some() && !model.has(Effect::MotorLag) {
        all.push(LeftOut { effect: "motors.lag".into(), why: lag.into() });
    }
    all
}
