//! Motor commands and rotor speeds, in our order of the motors.

use super::super::common::series::{Rising, scale};
use super::tables::Tables;
use crate::recording::Signal;

/// Highest PWM.
const MOST_PWM: f64 = 65_535.0;
/// From the centre to a motor, m, and torque over thrust of a rotor, m:
/// `power_distribution_quadrotor.c`, Crazyflie 2.1.
const ARM_M: f64 = 0.046 * std::f64::consts::FRAC_1_SQRT_2;
const TORQUE_PER_THRUST_M: f64 = 0.005_964_552;
/// Force of a rotor at full command, N.
const MOST_FORCE_N: f64 = 0.15;

/// PWM of m4, m1, m2, m3: front-left, front-right, rear-right, rear-left.
const PWM: [(&str, [&str; 4]); 2] = [
    ("pwm.m1", ["pwm.m4_pwm", "pwm.m1_pwm", "pwm.m2_pwm", "pwm.m3_pwm"]),
    ("motor.m1", ["motor.m4", "motor.m1", "motor.m2", "motor.m3"]),
];
/// Thrust and torques of a controller: the name that they are known by, thrust, roll, pitch, yaw.
const WRENCHES: [(&str, [&str; 4]); 4] = [
    ("ctrlLee.thrustS", ["ctrlLee.thrustSI", "ctrlLee.torquex", "ctrlLee.torquey", "ctrlLee.torquez"]),
    ("ctrlLee.thrustS", ["ctrlLee.thrustSi", "ctrlLee.torquex", "ctrlLee.torquey", "ctrlLee.torquez"]),
    ("ctrlLeeP.thrustS", ["ctrlLeeP.thrustSI", "ctrlLeeP.torquex", "ctrlLeeP.torquey", "ctrlLeeP.torquez"]),
    ("ctrlLeeP.thrustS", ["ctrlLeeP.thrustSi", "ctrlLeeP.torquex", "ctrlLeeP.torquey", "ctrlLeeP.torquez"]),
];
const FORCES: [&str; 4] =
    ["powerDist.m4force", "powerDist.m1force", "powerDist.m2force", "powerDist.m3force"];
/// A quarter of the thrust and what roll, pitch and yaw add to it, N.
const PARTS: [&str; 4] =
    ["powerDist.thrustPart", "powerDist.rollPart", "powerDist.pitchPart", "powerDist.yawPart"];

/// Commands from 0 to 1.
pub(super) fn commands(tables: &Tables<'_>, notes: &mut Vec<String>) -> Option<Signal<4>> {
    for (source, names) in &PWM {
        if let Some((rising, values)) = tables.group(*names) {
            return Some(rising.signal(source, &scale(values, 1.0 / MOST_PWM)));
        }
    }
    let (source, rising, forces) = forces(tables)?;
    notes.push(format!(
        "no PWM is logged: commands are rebuilt from {source} as the firmware shares it out among the motors, \
         as square roots of forces over {MOST_FORCE_N} N"
    ));
    let command = |force: &f64| (force.max(0.0) / MOST_FORCE_N).sqrt();
    Some(rising.signal(source, &forces.map(|forces| forces.iter().map(command).collect())))
}

/// Forces of front-left, front-right, rear-right, rear-left, N.
fn forces<'a>(tables: &'a Tables<'_>) -> Option<(&'static str, &'a Rising, [Vec<f64>; 4])> {
    if let Some((rising, parts)) = tables.group(PARTS) {
        return Some(("powerDist.thrustPart", rising, share(&parts)));
    }
    if let Some((rising, forces)) = tables.group(FORCES) {
        return Some(("powerDist.m1force", rising, forces));
    }
    WRENCHES.iter().find_map(|(source, names)| {
        let (rising, [thrust, roll, pitch, yaw]) = tables.group(*names)?;
        let [roll, pitch] = scale([roll, pitch], 0.25 / ARM_M);
        let ([thrust], [yaw]) = (scale([thrust], 0.25), scale([yaw], 0.25 / TORQUE_PER_THRUST_M));
        Some((*source, rising, share(&[thrust, roll, pitch, yaw])))
    })
}

/// Shares out thrust, roll, pitch and yaw (pitch nose down, yaw to the left) among the motors.
fn share([thrust, roll, pitch, yaw]: &[Vec<f64>; 4]) -> [Vec<f64>; 4] {
    let motor = |r: f64, p: f64, y: f64| {
        (0..thrust.len()).map(|k| thrust[k] + r * roll[k] + p * pitch[k] + y * yaw[k]).collect()
    };
    [motor(1.0, -1.0, 1.0), motor(-1.0, -1.0, -1.0), motor(-1.0, 1.0, 1.0), motor(1.0, 1.0, -1.0)]
}

/// Rotor speeds, rad/s.
pub(super) fn rotor_speed(tables: &Tables<'_>) -> Option<Signal<4>> {
    let (rising, values) = tables.group(["rpm.m4", "rpm.m1", "rpm.m2", "rpm.m3"])?;
    Some(rising.signal("rpm.m1", &scale(values, std::f64::consts::TAU / 60.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A roll to the right asks more of the left rotors, nose down more of the rear ones, a yaw to the
    /// left more of those that turn cw.
    #[test]
    fn torques_are_shared_out() {
        let one = |number: f64| vec![number];
        let shared = |parts: [f64; 4]| share(&parts.map(one)).map(|motor| motor[0]);
        assert_eq!(shared([1.0, 0.5, 0.0, 0.0]), [1.5, 0.5, 0.5, 1.5]);
        assert_eq!(shared([1.0, 0.0, 0.5, 0.0]), [0.5, 0.5, 1.5, 1.5]);
        assert_eq!(shared([1.0, 0.0, 0.0, 0.5]), [1.5, 0.5, 1.5, 0.5]);
    }
}
