//! Position, velocity, attitude, body rates, specific force.

use crate::log::{Log, Table};
use crate::recording::{Recording, Signal, Span};
use crate::spans::{joined, within};

use super::super::common::series::normalise;
use super::rows::{Rows, signal};
use super::topics::{topic, topic_of};

/// Around a jump of the estimator this much is not trusted, s.
const JUMP_MARGIN_S: f64 = 0.05;

/// What of the position a flag of PX4's speaks for.
struct Part {
    flag: &'static str,
    resets: &'static str,
    /// Of the position or of the velocity.
    velocity: bool,
    components: &'static [usize],
    what: &'static str,
}

const PARTS: [Part; 4] = [
    Part {
        flag: "xy_valid",
        resets: "xy_reset_counter",
        velocity: false,
        components: &[0, 1],
        what: "horizontal position",
    },
    Part { flag: "z_valid", resets: "z_reset_counter", velocity: false, components: &[2], what: "height" },
    Part {
        flag: "v_xy_valid",
        resets: "vxy_reset_counter",
        velocity: true,
        components: &[0, 1],
        what: "horizontal velocity",
    },
    Part {
        flag: "v_z_valid",
        resets: "vz_reset_counter",
        velocity: true,
        components: &[2],
        what: "vertical velocity",
    },
];

/// Attitude: unit quaternions w, x, y, z of continuous sign.
pub(super) fn attitude(log: &Log, notes: &mut Vec<String>) -> Option<Signal<4>> {
    let mut signal = signal(topic(log, "vehicle_attitude")?, ["q[0]", "q[1]", "q[2]", "q[3]"], notes)?;
    let quaternion = |row: usize| std::array::from_fn::<f64, 4, _>(|axis| signal.values[axis][row]);
    let lengths: Vec<f64> = (0..signal.t.len()).map(|row| length(quaternion(row))).collect();
    let keep: Vec<bool> = lengths.iter().map(|length| (0.5..1.5).contains(length)).collect();
    let lost = keep.iter().filter(|keep| !**keep).count();
    if lost > 0 {
        notes.push(format!("vehicle_attitude: {lost} rows without a unit quaternion are left out"));
        for list in signal.values.iter_mut().chain([&mut signal.t]) {
            let mut keep = keep.iter();
            list.retain(|_| keep.next() == Some(&true));
        }
    }
    normalise(&mut signal.values);
    (!signal.t.is_empty()).then_some(signal)
}

fn length(q: [f64; 4]) -> f64 {
    q.iter().map(|q| q * q).sum::<f64>().sqrt()
}

/// Body rates: the estimator's; before version 1.10 the gyro's.
pub(super) fn rates(log: &Log, notes: &mut Vec<String>) -> Option<Signal<3>> {
    let estimated = topic(log, "vehicle_angular_velocity");
    estimated.and_then(|table| signal(table, ["xyz[0]", "xyz[1]", "xyz[2]"], notes)).or_else(|| {
        signal(topic(log, "sensor_combined")?, ["gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"], notes)
    })
}

/// Specific force, at the rate of the sensor.
pub(super) fn specific_force(log: &Log, notes: &mut Vec<String>) -> Option<Signal<3>> {
    let axes = ["accelerometer_m_s2[0]", "accelerometer_m_s2[1]", "accelerometer_m_s2[2]"];
    let measured = topic(log, "sensor_combined").and_then(|table| {
        let rows = Rows::of(table, notes);
        let values = rows.columns(table, axes)?;
        Some(on_own_clock(table, &rows, values))
    });
    measured
        .or_else(|| signal(topic(log, "vehicle_acceleration")?, ["xyz[0]", "xyz[1]", "xyz[2]"], notes))
        .filter(|signal| !signal.t.is_empty())
}

/// The accelerometer's times are given from those of the gyro, whose table it is.
fn on_own_clock(table: &Table, rows: &Rows, values: [Vec<f64>; 3]) -> Signal<3> {
    // The largest number says that there is no sample.
    const FURTHEST_US: f64 = 1e6;
    let mut signal =
        Signal { source: topic_of(table).into(), t: Vec::new(), values: [const { Vec::new() }; 3] };
    let relative = table.column("accelerometer_timestamp_relative").map(|column| rows.pick(column));
    for (row, &us) in rows.us.iter().enumerate() {
        let offset = relative.as_ref().map_or(0.0, |relative| relative[row]);
        let t = (us as f64 + offset) * 1e-6;
        if offset.abs() < FURTHEST_US && signal.t.last().is_none_or(|&last| t > last) {
            signal.t.push(t);
            for (list, from) in signal.values.iter_mut().zip(&values) {
                list.push(from[row]);
            }
        }
    }
    signal
}

/// Position, velocity, and when they are not to be trusted.
pub(super) fn position_and_velocity(log: &Log, recording: &mut Recording) {
    if let Some(table) = topic(log, "vehicle_local_position") {
        let rows = Rows::of(table, &mut recording.notes);
        if !rows.us.is_empty() {
            estimate(table, &rows, recording);
        }
    }
    jumps_of_attitude(log, recording);
    recording.untrusted = joined(std::mem::take(&mut recording.untrusted));
}

fn estimate(table: &Table, rows: &Rows, recording: &mut Recording) {
    let t = rows.times_s();
    let mut position = rows.columns(table, ["x", "y", "z"]);
    let mut velocity = rows.columns(table, ["vx", "vy", "vz"]);
    let flying = within(&t, &recording.airborne);
    let mut never = Vec::new();
    for part in &PARTS {
        let valid = table.column(part.flag).map(|flag| rows.pick(flag));
        let count = |with: f64| {
            let valid = valid.iter().flatten().zip(&flying);
            valid.filter(|(valid, flying)| **flying && **valid == with).count()
        };
        if count(0.0) > count(1.0) {
            never.push(part.what);
            let all = if part.velocity { &mut velocity } else { &mut position };
            for &component in part.components {
                if let Some(values) = all {
                    values[component].fill(f64::NAN);
                }
            }
            continue;
        }
        if let Some(valid) = valid {
            add_invalid(&t, &valid, &mut recording.untrusted);
        }
        add_jumps(&t, table, rows, part.resets, &mut recording.untrusted);
    }
    let mut turned = Vec::new();
    add_jumps(&t, table, rows, "heading_reset_counter", &mut turned);
    recording.untrusted.extend(&turned);
    recording.untrusted_attitude.extend(turned);
    if !never.is_empty() {
        let what = never.join(", ");
        recording.limits.push(format!(
            "the estimator was not sure of {what} in most of the flight: left out; \
             fly with GPS, motion capture or optical flow"
        ));
    }
    let source = topic_of(table);
    let signal = |values| Signal { source: source.into(), t: t.clone(), values };
    recording.signals.position = position.map(signal);
    recording.signals.velocity = velocity.map(signal);
}

/// From the last row that was valid to the next one that is.
fn add_invalid(t: &[f64], valid: &[f64], untrusted: &mut Vec<Span>) {
    for (index, _) in valid.iter().enumerate().filter(|(_, valid)| **valid == 0.0) {
        untrusted.push([t[index.saturating_sub(1)], t[(index + 1).min(t.len() - 1)]]);
    }
}

/// Between the rows where a counter of jumps changes.
fn add_jumps(t: &[f64], table: &Table, rows: &Rows, counter: &str, untrusted: &mut Vec<Span>) {
    let Some(counts) = table.column(counter).map(|column| rows.pick(column)) else { return };
    let changed = counts.windows(2).zip(t.windows(2)).filter(|(counts, _)| counts[0] != counts[1]);
    untrusted.extend(changed.map(|(_, t)| [t[0] - JUMP_MARGIN_S, t[1] + JUMP_MARGIN_S]));
}

fn jumps_of_attitude(log: &Log, recording: &mut Recording) {
    let mut spans = std::mem::take(&mut recording.untrusted_attitude);
    if let Some(table) = topic(log, "vehicle_attitude") {
        let rows = Rows::of(table, &mut Vec::new());
        let counted = spans.len();
        add_jumps(&rows.times_s(), table, &rows, "quat_reset_counter", &mut spans);
        recording.untrusted.extend(&spans[counted..]);
    }
    recording.untrusted_attitude = joined(spans);
}
