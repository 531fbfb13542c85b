//! Which vehicle flew, and which of its outputs drives which rotor.

use crate::log::Log;

/// Where the motors are, and how they turn.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// The output, from 1, that drives each rotor in our order.
    pub(super) outputs: [usize; 4],
    /// Seen from above, in our order.
    pub(super) spin: [&'static str; 4],
    /// What had to be assumed.
    pub(super) notes: Vec<String>,
}

/// Programs for other vehicles, by what their texts call them.
const OTHERS: [(&str, &str); 5] = [
    ("Plane", "a fixed wing (ArduPlane)"),
    ("Rover", "a rover (ArduRover)"),
    ("Sub", "a submarine (ArduSub)"),
    ("Tracker", "an antenna tracker"),
    ("Blimp", "a blimp"),
];

/// FRAME_CLASS of other craft than quadcopters.
const CLASSES: [(i64, &str); 16] = [
    (2, "hexacopter"),
    (3, "octocopter"),
    (4, "coaxial octocopter"),
    (5, "Y6"),
    (6, "helicopter"),
    (7, "tricopter"),
    (8, "single copter"),
    (9, "coaxial copter"),
    (10, "bicopter"),
    (11, "dual helicopter"),
    (12, "dodecacopter"),
    (13, "quad helicopter"),
    (14, "decacopter"),
    (15, "scripted frame"),
    (16, "six-degree-of-freedom frame"),
    (17, "scripted dynamic frame"),
];

/// FRAME_TYPE of quadcopters that are not read.
const TYPES: [(i64, &str); 9] = [
    (0, "plus"),
    (2, "V"),
    (3, "H"),
    (4, "V-tail"),
    (5, "A-tail"),
    (6, "reversed plus"),
    (16, "plus without yaw torque"),
    (17, "X without yaw torque"),
    (19, "Y4"),
];

/// A quad X turns so: front left, front right, rear right, rear left.
const SPIN: [&str; 4] = ["cw", "ccw", "cw", "ccw"];
/// The other way.
const REVERSED: [&str; 4] = ["ccw", "cw", "ccw", "cw"];

/// The layout of the craft, or why it is none of ours.
pub(super) fn layout(log: &Log) -> Result<Layout, String> {
    refuse_other_vehicles(log)?;
    let mut notes = Vec::new();
    refuse_other_frames(log, &mut notes)?;
    let old_name = log.parameters.get("FRAME").filter(|_| !log.parameters.contains_key("FRAME_CLASS"));
    let kind = match log.parameters.get("FRAME_TYPE").or(old_name) {
        Some(&kind) => kind as i64,
        None => {
            notes.push("the log does not say how the arms stand (FRAME_TYPE): taken for an X".into());
            1
        }
    };
    // Motor numbers in our order, as AP_MotorsMatrix has them.
    let (motors, spin) = match kind {
        1 => ([3, 1, 4, 2], SPIN),
        12 => ([4, 2, 1, 3], SPIN),
        13 => ([2, 1, 4, 3], SPIN),
        14 => ([4, 1, 2, 3], SPIN),
        18 => ([4, 2, 1, 3], REVERSED),
        _ => {
            let name = TYPES.iter().find(|(number, _)| *number == kind).map_or("unknown", |(_, name)| name);
            return Err(format!("a quadcopter of frame type {kind} ({name}): only X frames are read"));
        }
    };
    Ok(Layout { outputs: outputs(log, motors)?, spin, notes })
}

/// Refuses what is no copter, by name.
fn refuse_other_vehicles(log: &Log) -> Result<(), String> {
    let firmware = log.firmware.as_deref().unwrap_or_default();
    if firmware.contains("Copter") {
        return Ok(());
    }
    if let Some((_, what)) = OTHERS.iter().find(|(name, _)| firmware.contains(name)) {
        return Err(format!("comes from {what}, {}; quadlab reads only quadcopters", short(firmware)));
    }
    let is_copter = ["FRAME_CLASS", "FRAME", "MOT_SPIN_ARM", "MOT_SPIN_ARMED"]
        .iter()
        .any(|name| log.parameters.contains_key(*name));
    if is_copter {
        Ok(())
    } else {
        Err("does not say which vehicle it comes from (no MSG, no parameters); quadlab reads only quadcopters".into())
    }
}

/// Refuses copters with other than four rotors, by name.
fn refuse_other_frames(log: &Log, notes: &mut Vec<String>) -> Result<(), String> {
    let text = log.information.get("frame").map(|text| text.trim_start_matches("Frame:").trim());
    match log.parameters.get("FRAME_CLASS").map(|&class| class as i64) {
        Some(1) => return Ok(()),
        Some(0) | None => {}
        Some(class) => {
            let name =
                CLASSES.iter().find(|(number, _)| *number == class).map_or("unknown frame", |(_, name)| name);
            return Err(format!("comes from a {name} (FRAME_CLASS {class}); quadlab reads only quadcopters"));
        }
    }
    match text {
        Some(text) if text.starts_with("QUAD") => Ok(()),
        Some(text) => {
            Err(format!("comes from a copter of frame {}; quadlab reads only quadcopters", short(text)))
        }
        None => {
            notes.push("the log does not say how many rotors there are (FRAME_CLASS): taken for four".into());
            Ok(())
        }
    }
}

/// The outputs that drive the motors.
fn outputs(log: &Log, motors: [usize; 4]) -> Result<[usize; 4], String> {
    const MOTOR_1: usize = 33;
    const MOST_OUTPUTS: usize = 32;
    let output = |motor: usize| {
        let function = (MOTOR_1 + motor - 1) as f64;
        (1..=MOST_OUTPUTS)
            .find(|output| log.parameters.get(&format!("SERVO{output}_FUNCTION")) == Some(&function))
    };
    let found = motors.map(output);
    match found {
        [Some(a), Some(b), Some(c), Some(d)] => Ok([a, b, c, d]),
        // Before 3.5 motors are on the outputs of their number.
        [None, None, None, None] => Ok(motors),
        _ => Err("names outputs for some of its four motors only (SERVOn_FUNCTION 33 to 36): the log is damaged, or \
                 no quadcopter's".into()),
    }
}

/// A name from the log, cut to a length that a message can bear.
fn short(text: &str) -> String {
    text.chars().take(60).collect()
}
