//! ROS messages: poses, odometry, inertial sensors, batteries, and arrays of motor commands.
//!
//! World z up, body forward-left-up, quaternion x, y, z, w (REP 103): flipped to north-east-down and
//! forward-right-down. PX4's own messages over ROS 2 keep PX4's frames and go the way of its logs.

mod bag;
mod motors;
mod px4;
mod vehicle;

use std::path::Path;

use super::common::series::{at, flip, interpolate, normalise, rotate};
use crate::error::LogError;
use crate::log::Log;
use crate::recording::{Recording, Signal};
use bag::{Bag, Topic};
pub(super) use px4::as_px4_log;
use vehicle::Poses;

/// Attitude and position this far apart do not go together, s.
const LONGEST_GAP_S: f64 = 0.2;

pub(crate) fn record(log: &Log, path: &Path) -> Result<Recording, LogError> {
    let mut recording = Recording::default();
    let bag = Bag::of(log, &mut recording.notes);
    let poses = Poses::of(&bag);
    let namespace =
        poses.craft.map(|topic| topic.namespace()).or_else(|| bag.imus().next().map(Topic::namespace));
    let Some(namespace) = namespace else {
        return Err(LogError::Refused { path: path.into(), reason: nothing(&bag) });
    };
    recording.hints.name = namespace.rsplit('/').next().filter(|name| !name.is_empty()).map(Into::into);
    fill(&mut recording, &bag, &poses, namespace);
    if let Some(load) = poses.load {
        recording.signals.extra = position_as(load, ["load_north", "load_east", "load_down"]);
    }
    if let [other] = &poses.others[..]
        && other.namespace() != namespace
        && poses.load.is_none_or(|load| load.namespace() != other.namespace())
    {
        recording.signals.extra.extend(position_as(other, ["other_north", "other_east", "other_down"]));
        let sentence =
            "is kept as other_north, other_east and other_down, which formulas of effects can name";
        recording.notes.push(format!("the pose {} {sentence}", other.table.name));
    } else if !poses.others.is_empty() {
        let names: Vec<&str> = poses.others.iter().map(|topic| topic.table.name.as_str()).collect();
        recording
            .notes
            .push(format!("other poses in the bag are left alone: {}", crate::error::plain_list(&names)));
    }
    limits(&mut recording, &bag);
    Ok(recording)
}

fn nothing(bag: &Bag<'_>) -> String {
    let names: Vec<&str> = bag.topics.iter().map(|topic| topic.table.name.as_str()).collect();
    format!(
        "no pose, odometry or inertial sensor of a craft among the topics: {}",
        if names.is_empty() { "none".into() } else { crate::error::plain_list(&names) }
    )
}

/// Finds the quantities of the craft whose topics begin with a namespace.
fn fill(recording: &mut Recording, bag: &Bag<'_>, poses: &Poses<'_, '_>, namespace: &str) {
    let imu = bag.imus().find(|topic| topic.namespace() == namespace).or_else(|| bag.imus().next());
    let signals = &mut recording.signals;
    signals.position = poses.craft.and_then(|topic| topic.vector(&["pose.position", "pose.pose.position"]));
    signals.attitude = poses
        .craft
        .and_then(|topic| attitude(topic, &["pose.orientation", "pose.pose.orientation"]))
        .or_else(|| {
            imu.filter(|topic| topic.has_orientation()).and_then(|topic| attitude(topic, &["orientation"]))
        });
    let odometry = poses.craft.filter(|topic| topic.table.column("twist.twist.angular.x").is_some());
    signals.rates = imu
        .and_then(|topic| topic.vector(&["angular_velocity"]))
        .or_else(|| odometry.and_then(|topic| topic.vector(&["twist.twist.angular"])));
    signals.specific_force = imu.and_then(|topic| topic.vector(&["linear_acceleration"]));
    recording.signals.velocity = velocity(recording, bag, odometry, namespace);
    recording.signals.voltage = voltage(bag, namespace);
    motors::commands(recording, bag, namespace);
}

/// An attitude out of x, y, z, w, in our frames.
fn attitude(topic: &Topic<'_>, prefixes: &[&str]) -> Option<Signal<4>> {
    let mut signal = prefixes
        .iter()
        .find_map(|prefix| topic.signal(["w", "x", "y", "z"].map(|part| format!("{prefix}.{part}"))))?;
    signal.values[2].iter_mut().for_each(|y| *y = -*y);
    signal.values[3].iter_mut().for_each(|z| *z = -*z);
    normalise(&mut signal.values);
    Some(signal)
}

/// Velocity in the world, from odometry or a twist: in which axes it is, its agreement with the
/// position tells.
fn velocity(
    recording: &mut Recording,
    bag: &Bag<'_>,
    odometry: Option<&Topic<'_>>,
    namespace: &str,
) -> Option<Signal<3>> {
    let twist =
        || bag.topics.iter().find(|topic| topic.namespace() == namespace && topic.is_a("TwistStamped"));
    let (signal, is_odometry) = match odometry.and_then(|topic| topic.vector(&["twist.twist.linear"])) {
        Some(signal) => (signal, true),
        None => (twist()?.vector(&["twist.linear"])?, false),
    };
    let Some(attitude) = &recording.signals.attitude else { return (!is_odometry).then_some(signal) };
    let turned = in_world(&signal, attitude);
    let position = recording.signals.position.as_ref();
    let errors = position.and_then(|position| Some((misfit(&signal, position)?, misfit(&turned, position)?)));
    // Without a position, as REP 103 and nav_msgs say: odometry in the axes of the body, else in those
    // of the world.
    let in_body = errors.map_or(is_odometry, |(as_it_is, as_turned)| as_turned < as_it_is);
    if in_body != is_odometry {
        let axes = if in_body { "the body" } else { "the world" };
        recording
            .notes
            .push(format!("the velocity of {} is in the axes of {axes}, by the position", signal.source));
    }
    Some(if in_body { turned } else { signal })
}

fn in_world(signal: &Signal<3>, attitude: &Signal<4>) -> Signal<3> {
    let mut turned = signal.clone();
    for (row, &time) in signal.t.iter().enumerate() {
        let quaternion =
            attitude.values.each_ref().map(|part| interpolate(&attitude.t, part, time, LONGEST_GAP_S));
        let vector = rotate(quaternion, at(&signal.values, row));
        turned.values.iter_mut().zip(vector).for_each(|(column, part)| column[row] = part);
    }
    turned
}

/// Mean squared difference of a velocity and the slope of the position.
fn misfit(velocity: &Signal<3>, position: &Signal<3>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for row in 0..position.t.len().saturating_sub(1) {
        let step = position.t[row + 1] - position.t[row];
        let middle = position.t[row] + step / 2.0;
        for (velocity_part, position_part) in velocity.values.iter().zip(&position.values) {
            let slope = (position_part[row + 1] - position_part[row]) / step;
            let difference = interpolate(&velocity.t, velocity_part, middle, LONGEST_GAP_S) - slope;
            if difference.is_finite() && step < LONGEST_GAP_S {
                sum += difference * difference;
                count += 1.0;
            }
        }
    }
    (count > 0.0).then_some(sum / count)
}

fn voltage(bag: &Bag<'_>, namespace: &str) -> Option<Signal<1>> {
    let batteries = || bag.topics.iter().filter(|topic| topic.is_a("BatteryState"));
    let own = batteries().find(|topic| topic.namespace().starts_with(namespace));
    own.or_else(|| batteries().next())
        .and_then(|topic| topic.signal(["voltage".to_owned()]))
        .or_else(|| {
            let mut states = bag.topics.iter().filter(|topic| topic.namespace() == namespace);
            states.find_map(|topic| topic.signal(["battery_voltage".to_owned()]))
        })
        .filter(|signal| signal.values[0].iter().any(|voltage| *voltage > 0.0))
}

/// A position that is not the craft's, in three columns.
fn position_as(topic: &Topic<'_>, names: [&str; 3]) -> Vec<(String, Signal<1>)> {
    let Some(Signal { source, t, values }) = topic.vector(&["pose.position", "pose.pose.position"]) else {
        return Vec::new();
    };
    let signal = |(name, values): (&str, Vec<f64>)| {
        (name.to_owned(), Signal { source: source.clone(), t: t.clone(), values: [values] })
    };
    names.into_iter().zip(values).map(signal).collect()
}

impl Topic<'_> {
    /// A vector in our frames, of the first prefix whose columns are there.
    fn vector(&self, prefixes: &[&str]) -> Option<Signal<3>> {
        let mut signal = prefixes
            .iter()
            .find_map(|prefix| self.signal(["x", "y", "z"].map(|part| format!("{prefix}.{part}"))))?;
        signal.values = flip(signal.values);
        Some(signal)
    }

    /// Whether an inertial sensor says that it knows the attitude.
    fn has_orientation(&self) -> bool {
        let covariance = self.table.column("orientation_covariance[0]").map(crate::log::Values::to_f64);
        !covariance.is_some_and(|values| values.first() == Some(&-1.0))
    }
}

/// What is missing, and the topics that would hold it.
fn limits(recording: &mut Recording, bag: &Bag<'_>) {
    let signals = &recording.signals;
    let missing = [
        (
            signals.position.is_none(),
            "no position: record a geometry_msgs/PoseStamped or nav_msgs/Odometry of the craft",
        ),
        (
            signals.attitude.is_none(),
            "no attitude: record a geometry_msgs/PoseStamped or nav_msgs/Odometry of the craft",
        ),
        (signals.rates.is_none(), "no body rates: record the sensor_msgs/Imu of the craft"),
        (signals.specific_force.is_none(), "no accelerometer: record the sensor_msgs/Imu of the craft"),
        (signals.voltage.is_none(), "no battery voltage: record a sensor_msgs/BatteryState of the craft"),
    ];
    let sentences =
        missing.into_iter().filter(|(is_missing, _)| *is_missing).map(|(_, sentence)| sentence.into());
    recording.limits.extend(sentences);
    for topic in bag.topics.iter().filter(|topic| topic.is_a("GenericLogData")) {
        recording.limits.push(format!(
            "{} has values without names, which cannot be told apart: log them on the craft's SD card",
            crate::error::plain_list(&[&topic.table.name])
        ));
    }
}
