//! Motor commands and rotor speeds, in quadlab's order of motors.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use crate::log::{Log, Table};
use crate::recording::{Recording, Signal};
use crate::spans::within;

use super::geometry::Layout;
use super::mixer::rebuild;
use super::rows::Rows;
use super::topics::{instances, topic, topic_of};

/// Least correlation with the logged commands, and greatest difference, at which rebuilt ones are taken.
const AGREEING: f64 = 0.99;
const DIFFERING: f64 = 0.02;
const FEWEST_COMPARED: usize = 50;

/// Finds the motor commands, their range and unit.
pub(super) fn commands(log: &Log, layout: &Layout, recording: &mut Recording) {
    let controls = topic(log, "actuator_motors").and_then(|table| of_motors(log, table, layout, recording));
    if controls.is_some() {
        recording.hints.command_range = Some([0.0, 1.0]);
        recording.hints.command_unit = Some("1".into());
        recording.signals.commands = controls;
    } else if let Some((signal, outputs)) = of_outputs(log, layout, recording) {
        let (range, unit) = range_of_outputs(&log.parameters, &signal, outputs);
        recording.hints.command_range = Some(range);
        recording.hints.command_unit = Some(unit.into());
        recording.signals.commands = Some(signal);
    }
}

/// Commands of `actuator_motors`: 0..1, NaN where a motor is off.
fn of_motors(log: &Log, table: &Table, layout: &Layout, recording: &mut Recording) -> Option<Signal<4>> {
    let rows = Rows::of(table, &mut recording.notes);
    let logged = rows.columns(table, ["control[0]", "control[1]", "control[2]", "control[3]"])?;
    if rows.us.is_empty() {
        return None;
    }
    let mut t = rows.times_s();
    let mut commands = None;
    if let Some(rebuilt) = layout.mixer.as_ref().and_then(|mixer| rebuild(log, mixer, (&rows, &logged))) {
        let (correlation, error, compared) = (rebuilt.correlation, rebuilt.error, rebuilt.compared);
        let agree = correlation > AGREEING && error < DIFFERING && compared >= FEWEST_COMPARED;
        let kept = if agree { "used between its rows" } else { "not used" };
        recording.notes.push(format!(
            "motor commands rebuilt from vehicle_torque_setpoint and vehicle_thrust_setpoint by CA_ROTORn \
             are {kept}: against actuator_motors correlation {correlation:.5}, rms difference {error:.4}, \
             {compared} samples"
        ));
        if agree {
            t = rebuilt.t;
            commands = Some(rebuilt.commands);
        }
    }
    let values = in_order(commands.unwrap_or(logged), layout.order);
    Some(Signal { source: topic_of(table).into(), t, values })
}

/// Commands of the `actuator_outputs` that move most while flying, and which of its outputs they are.
fn of_outputs(log: &Log, layout: &Layout, recording: &mut Recording) -> Option<(Signal<4>, [usize; 4])> {
    let outputs = outputs_of_motors(&log.parameters, layout.order);
    let names = outputs.map(|output| format!("output[{output}]"));
    let mut best: Option<(f64, Signal<4>)> = None;
    for table in instances(log, "actuator_outputs") {
        let rows = Rows::of(table, &mut recording.notes);
        let Some(values) = rows.columns(table, names.each_ref().map(String::as_str)) else { continue };
        let t = rows.times_s();
        let flying = within(&t, &recording.airborne);
        let moved = values.iter().map(|values| deviation(values, &flying)).sum::<f64>();
        if moved > best.as_ref().map_or(0.0, |(moved, _)| *moved) {
            best = Some((moved, Signal { source: table.name.clone(), t, values }));
        }
    }
    best.map(|(_, signal)| (signal, outputs))
}

/// Which outputs the motors are on: from version 1.13 parameters say it.
fn outputs_of_motors(parameters: &BTreeMap<String, f64>, order: [usize; 4]) -> [usize; 4] {
    const FIRST_MOTOR: f64 = 101.0;
    for prefix in ["PWM_MAIN_FUNC", "PWM_AUX_FUNC", "UAVCAN_EC_FUNC"] {
        let output = |motor: usize| {
            let function = FIRST_MOTOR + motor as f64;
            (0..16).find(|output| parameters.get(&format!("{prefix}{}", output + 1)) == Some(&function))
        };
        if let [Some(a), Some(b), Some(c), Some(d)] = order.map(output) {
            return [a, b, c, d];
        }
    }
    order
}

/// Standard deviation of the values that are picked; 0 where there are none.
fn deviation(values: &[f64], picked: &[bool]) -> f64 {
    let picked = || values.iter().zip(picked).filter(|(value, picked)| **picked && value.is_finite());
    let count = picked().count().max(1) as f64;
    let mean = picked().map(|(value, _)| value).sum::<f64>() / count;
    (picked().map(|(value, _)| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Lowest and highest output: the parameters' for pulses, the protocol's else.
fn range_of_outputs(
    parameters: &BTreeMap<String, f64>,
    signal: &Signal<4>,
    outputs: [usize; 4],
) -> ([f64; 2], &'static str) {
    let highest = signal.values.iter().flatten().copied().fold(0.0, f64::max);
    let moving = signal.values.iter().flatten().copied().filter(|value| *value > 0.0);
    let lowest = moving.fold(f64::INFINITY, f64::min);
    if highest > 2200.0 {
        return ([0.0, 8191.0], "UAVCAN raw");
    }
    if lowest < 800.0 || has_dshot(parameters) {
        return ([0.0, 1999.0], "DShot");
    }
    let limit = |end: &str, default: f64| {
        let own = |output: usize| parameters.get(&format!("PWM_MAIN_{end}{}", output + 1));
        let all =
            || parameters.get(&format!("PWM_MAIN_{end}")).or_else(|| parameters.get(&format!("PWM_{end}")));
        let set = |value: Option<&f64>| value.copied().filter(|value| *value > 0.0);
        outputs.map(|output| set(own(output)).or_else(|| set(all())).unwrap_or(default))
    };
    let low = limit("MIN", 1000.0).into_iter().fold(f64::INFINITY, f64::min);
    let high = limit("MAX", 2000.0).into_iter().fold(0.0, f64::max);
    ([low, high], "us")
}

/// Whether outputs are set to DShot, of which 1 to 1999 are throttle: `src/drivers/dshot/DShot.h` of
/// PX4/PX4-Autopilot. From version 1.13 a parameter of each timer says it (-8 to -2), before that one of all.
fn has_dshot(parameters: &BTreeMap<String, f64>) -> bool {
    let timers = parameters
        .iter()
        .filter(|(name, _)| ["PWM_MAIN_TIM", "PWM_AUX_TIM"].iter().any(|timer| name.starts_with(timer)));
    parameters.get("DSHOT_CONFIG").is_some_and(|rate| *rate > 0.0)
        || timers.into_iter().any(|(_, setting)| (-8.0..=-2.0).contains(setting))
}

/// Rotor speeds that the speed controllers report.
pub(super) fn rotor_speed(log: &Log, layout: &Layout, notes: &mut Vec<String>) -> Option<Signal<4>> {
    let names = [0, 1, 2, 3].map(|esc| format!("esc[{esc}].esc_rpm"));
    for table in instances(log, "esc_status") {
        let rows = Rows::of(table, notes);
        let Some(rpm) = rows.columns(table, names.each_ref().map(String::as_str)) else { continue };
        if rpm.iter().flatten().any(|rpm| *rpm != 0.0) {
            // Some controllers sign the speed by the sense of turning.
            let speeds = rpm.map(|values| values.iter().map(|rpm| rpm.abs() * 2.0 * PI / 60.0).collect());
            let values = in_order(speeds, layout.order.map(|motor| esc_of(table, motor)));
            return Some(Signal { source: table.name.clone(), t: rows.times_s(), values });
        }
    }
    None
}

/// The speed controller of a motor: newer logs say it, else they are numbered alike.
fn esc_of(table: &Table, motor: usize) -> usize {
    const FIRST_MOTOR: f64 = 101.0;
    let function =
        |esc: usize| table.column(&format!("esc[{esc}].actuator_function"))?.to_f64().last().copied();
    (0..4).find(|&esc| function(esc) == Some(FIRST_MOTOR + motor as f64)).unwrap_or(motor)
}

/// Lists in another order.
fn in_order(mut lists: [Vec<f64>; 4], order: [usize; 4]) -> [Vec<f64>; 4] {
    let distinct = (0..4).all(|motor| order.contains(&motor));
    order.map(|motor| if distinct { std::mem::take(&mut lists[motor]) } else { lists[motor].clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dshot_is_told_from_pulses() {
        let signal =
            Signal { source: String::new(), t: vec![0.0], values: std::array::from_fn(|_| vec![1200.0]) };
        let range = |name: &str, setting: f64| {
            range_of_outputs(&BTreeMap::from([(name.to_owned(), setting)]), &signal, [0, 1, 2, 3])
        };
        for (name, setting) in [("PWM_MAIN_TIM0", -5.0), ("PWM_AUX_TIM2", -8.0), ("DSHOT_CONFIG", 600.0)] {
            assert_eq!(range(name, setting), ([0.0, 1999.0], "DShot"), "{name}");
        }
        for (name, setting) in [("PWM_MAIN_TIM0", 400.0), ("PWM_MAIN_TIM0", -1.0), ("DSHOT_CONFIG", 0.0)] {
            assert_eq!(range(name, setting), ([1000.0, 2000.0], "us"), "{name}");
        }
    }
}
