//! Gazebo's SDFormat: a link for the craft, one for each rotor, and Gazebo's motor model on each of them.
//!
//! Gazebo's axes are forward, left, up. Its motor model (gz-sim, `MulticopterMotorModel`) follows the commanded speed with a first-order
//! lag, pulls along the rotor's axis with `motorConstant` w^2, turns the craft with `momentConstant` times that, and brakes what moves
//! across the axis with `rotorDragCoefficient` |w| v (Martin and Salaun, ICRA 2010).

use std::fmt::Write as _;

use model::{Effect, Model};
use nalgebra::{Matrix3, Vector3};

use crate::craft::{Craft, Rotor, is_of_rotors, rigid_coupling};
use crate::error::ExportError;
use crate::left_out::{Export, LeftOut, comments, escaped, left_out, none, without_ends_of_comments};

/// Time constant where the rotors follow at once: it has to have one, s.
const AT_ONCE_S: f64 = 1e-3;
/// Share of the craft's mass in the link of a rotor: a link without mass cannot be simulated, and the craft keeps its own.
const ROTOR_SHARE: f64 = 1e-3;
/// Gravity of a world that does not say it, m/s^2.
const GRAVITY_M_S2: f64 = 9.8;

pub(crate) fn export(craft: &Craft, model: &Model) -> Result<Export, ExportError> {
    let left_out = what_is_left_out(craft, model);
    let name = escaped(&model.vehicle.name);
    let mut text = head(craft, model, &left_out);
    let _ =
        writeln!(text, "<sdf version=\"1.9\">\n  <model name=\"{name}\">\n    <pose>0 0 0.1 0 0 0</pose>");
    hull(&mut text, craft);
    for (k, rotor) in craft.rotors.iter().enumerate() {
        link_of_rotor(&mut text, k, rotor, craft);
    }
    for (k, rotor) in craft.rotors.iter().enumerate() {
        motor(&mut text, k, rotor, craft);
    }
    text += "  </model>\n</sdf>\n";
    Ok(Export { text, left_out })
}

fn head(craft: &Craft, model: &Model, left_out: &[LeftOut]) -> String {
    let hover = speeds_in_hover(craft).map(|speed| report::significant(speed, 6)).join(", ");
    format!(
        r#"<?xml version="1.0"?>
<!--
  {}, from its identified model.
  Axes: forward, left, up. Rotors: front left, front right, rear right, rear left; {hover} rad/s in hover.
  Commands: speeds of the rotors, rad/s, as gz.msgs.Actuators on /craft/command/motor_speed.
{}-->
"#,
        without_ends_of_comments(&model.vehicle.name),
        without_ends_of_comments(&comments(left_out, "  ")),
    )
}

/// Mass and inertia of the rotor's link: a disc.
fn disc(craft: &Craft) -> (f64, Vector3<f64>) {
    let mass_kg = ROTOR_SHARE * craft.mass_kg;
    let square = mass_kg * craft.rotor_radius_m * craft.rotor_radius_m;
    (mass_kg, Vector3::new(0.25 * square, 0.25 * square, 0.5 * square))
}

fn place(rotor: &Rotor) -> Vector3<f64> {
    Vector3::new(rotor.forward_m, -rotor.right_m, 0.0)
}

/// Inertia of a mass at a place, about the origin.
fn of_point(mass_kg: f64, place_m: Vector3<f64>) -> Matrix3<f64> {
    mass_kg * (Matrix3::identity() * place_m.norm_squared() - place_m * place_m.transpose())
}

/// The craft without its rotors, so that both together have its mass, center of mass and inertia.
fn hull(text: &mut String, craft: &Craft) {
    let (rotor_kg, disc) = disc(craft);
    let mass_kg = craft.mass_kg - 4.0 * rotor_kg;
    let rotors_kg_m = craft.rotors.iter().map(|rotor| rotor_kg * place(rotor)).sum::<Vector3<f64>>();
    let center_m = -rotors_kg_m / mass_kg;
    let of_rotor = |rotor: &Rotor| Matrix3::from_diagonal(&disc) + of_point(rotor_kg, place(rotor));
    let own = Matrix3::from_diagonal(&Vector3::from(craft.inertia_kg_m2))
        - craft.rotors.iter().map(of_rotor).sum::<Matrix3<f64>>()
        - of_point(mass_kg, center_m);
    let _ = writeln!(
        text,
        r#"    <link name="craft">
{}
      <collision name="hull"><geometry><sphere><radius>0.04</radius></sphere></geometry></collision>
      <visual name="hull"><geometry><sphere><radius>0.04</radius></sphere></geometry></visual>
    </link>"#,
        inertial(mass_kg, center_m, &own)
    );
}

fn inertial(mass_kg: f64, center_m: Vector3<f64>, own: &Matrix3<f64>) -> String {
    let [x, y, z] = [center_m.x, center_m.y, center_m.z];
    format!(
        "      <inertial>\n        <pose>{x} {y} {z} 0 0 0</pose>\n        <mass>{mass_kg}</mass>\n        \
         <inertia><ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz><ixy>{}</ixy><ixz>{}</ixz><iyz>{}</iyz></inertia>\n      </inertial>",
        own[(0, 0)],
        own[(1, 1)],
        own[(2, 2)],
        own[(0, 1)],
        own[(0, 2)],
        own[(1, 2)]
    )
}

fn link_of_rotor(text: &mut String, k: usize, rotor: &Rotor, craft: &Craft) {
    let (mass_kg, disc) = disc(craft);
    let at = place(rotor);
    let _ = writeln!(
        text,
        r#"    <link name="rotor{0}">
      <pose>{1} {2} 0 0 0 0</pose>
{3}
      <visual name="disc"><geometry><cylinder><radius>{4}</radius><length>0.01</length></cylinder></geometry></visual>
    </link>
    <joint name="rotor{0}_joint" type="revolute">
      <parent>craft</parent><child>rotor{0}</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-1e16</lower><upper>1e16</upper></limit></axis>
    </joint>"#,
        k + 1,
        at.x,
        at.y,
        inertial(mass_kg, Vector3::zeros(), &Matrix3::from_diagonal(&disc)),
        craft.rotor_radius_m
    );
}

fn motor(text: &mut String, k: usize, rotor: &Rotor, craft: &Craft) {
    // A rotor that turns counter-clockwise turns the nose to the right.
    let direction = if rotor.torque > 0.0 { "ccw" } else { "cw" };
    let time_constant_s = craft.lag_rad_s.map_or(AT_ONCE_S, |lag| 1.0 / lag);
    let _ = writeln!(
        text,
        r#"    <plugin filename="gz-sim-multicopter-motor-model-system" name="gz::sim::systems::MulticopterMotorModel">
      <robotNamespace>craft</robotNamespace>
      <jointName>rotor{0}_joint</jointName>
      <linkName>rotor{0}</linkName>
      <motorNumber>{k}</motorNumber>
      <motorType>velocity</motorType>
      <turningDirection>{direction}</turningDirection>
      <timeConstantUp>{time_constant_s}</timeConstantUp>
      <timeConstantDown>{time_constant_s}</timeConstantDown>
      <maxRotVelocity>{1}</maxRotVelocity>
      <motorConstant>{2}</motorConstant>
      <momentConstant>{3}</momentConstant>
      <rotorDragCoefficient>{4}</rotorDragCoefficient>
      <rollingMomentCoefficient>0</rollingMomentCoefficient>
      <rotorVelocitySlowdownSim>10</rotorVelocitySlowdownSim>
      <commandSubTopic>command/motor_speed</commandSubTopic>
    </plugin>"#,
        k + 1,
        craft.most_rad_s,
        rotor.thrust,
        rotor.torque.abs() / rotor.thrust,
        craft.drag_n_s_m[0] / speeds_in_hover(craft).iter().sum::<f64>()
    );
}

/// rad/s.
fn speeds_in_hover(craft: &Craft) -> [f64; 4] {
    std::array::from_fn(|k| (craft.hover_n[k] / craft.rotors[k].thrust).sqrt())
}

fn what_is_left_out(craft: &Craft, model: &Model) -> Vec<LeftOut> {
    let mut all = left_out(model, |effect| match effect {
        Effect::InertiaCoupling => rigid_coupling(craft, model),
        Effect::LinearDrag => Some(format!(
            "becomes drag of the rotors, which grows with their speed and brakes turning too. It matches the model's forward drag in \
             hover; it is {} N s/m to the side too, where the model has {}, and none up and down, where the model has {}",
            report::significant(craft.drag_n_s_m[0], 4),
            report::significant(craft.drag_n_s_m[1], 4),
            report::significant(craft.drag_n_s_m[2], 4)
        )),
        effect if is_of_rotors(effect) || effect == Effect::MotorLag => None,
        effect => none(model, effect),
    });
    let mut say = |effect: &str, why: String| all.push(LeftOut { effect: effect.into(), why });
    if (craft.gravity_m_s2 - GRAVITY_M_S2).abs() > 1e-9 {
        let own = craft.gravity_m_s2;
        say(
            "gravity",
            format!("belongs to the world: {GRAVITY_M_S2} m/s^2 without <gravity>0 0 -{own}</gravity>"),
        );
    }
    if craft.lag_rad_s.is_none() {
        say("motors.lag", format!("a rotor needs a time constant: {AT_ONCE_S} s, which is as good as none"));
    }
    all
}
