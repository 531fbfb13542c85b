//! Attitude: as quaternion, packed quaternion, or angles in two conventions.

use super::super::common::series::{from_euler, normalise};
use super::tables::Tables;
use crate::recording::Signal;

/// Variables of a quaternion of the firmware's frames: the name that it is known by, w, x, y, z.
const QUATERNIONS: [(&str, [&str; 4]); 2] = [
    ("stateEstimate.q", ["stateEstimate.qw", "stateEstimate.qx", "stateEstimate.qy", "stateEstimate.qz"]),
    ("kalman.q0", ["kalman.q0", "kalman.q1", "kalman.q2", "kalman.q3"]),
];
/// Roll, pitch (nose up) and yaw in degrees.
const NOSE_UP: [(&str, [&str; 3]); 2] = [
    ("stateEstimate.roll", ["stateEstimate.roll", "stateEstimate.pitch", "stateEstimate.yaw"]),
    ("stabilizer.roll", ["stabilizer.roll", "stabilizer.pitch", "stabilizer.yaw"]),
];
/// Roll, pitch (nose down) and yaw in rad.
const NOSE_DOWN: [(&str, [&str; 3]); 2] = [
    ("ctrlLee.rpyx", ["ctrlLee.rpyx", "ctrlLee.rpyy", "ctrlLee.rpyz"]),
    ("ctrlLeeP.rpyx", ["ctrlLeeP.rpyx", "ctrlLeeP.rpyy", "ctrlLeeP.rpyz"]),
];

/// The first attitude that is logged, in our frames.
pub(super) fn attitude(tables: &Tables<'_>) -> Option<Signal<4>> {
    let mut signal = packed(tables)
        .or_else(|| quaternion(tables, &QUATERNIONS[0]))
        .or_else(|| angles(tables, &NOSE_UP[0], 1.0_f64.to_radians(), -1.0))
        .or_else(|| NOSE_DOWN.iter().find_map(|names| angles(tables, names, 1.0, 1.0)))
        .or_else(|| angles(tables, &NOSE_UP[1], 1.0_f64.to_radians(), -1.0))
        .or_else(|| quaternion(tables, &QUATERNIONS[1]))?;
    normalise(&mut signal.values);
    Some(signal)
}

fn quaternion(tables: &Tables<'_>, (source, names): &(&str, [&str; 4])) -> Option<Signal<4>> {
    let (rising, [w, x, y, z]) = tables.group(*names)?;
    let negative = |values: Vec<f64>| values.into_iter().map(|value| -value).collect();
    Some(rising.signal(source, &[w, x, negative(y), negative(z)]))
}

/// Angles in the firmware's frames but for the sign of pitch, +1 where it is nose down.
fn angles(
    tables: &Tables<'_>,
    (source, names): &(&str, [&str; 3]),
    unit: f64,
    pitch_sign: f64,
) -> Option<Signal<4>> {
    let (rising, [roll, pitch, yaw]) = tables.group(*names)?;
    let mut values = [const { Vec::new() }; 4];
    for row in 0..roll.len() {
        let quaternion = from_euler(roll[row] * unit, -pitch_sign * pitch[row] * unit, -yaw[row] * unit);
        values.iter_mut().zip(quaternion).for_each(|(column, part)| column.push(part));
    }
    Some(rising.signal(source, &values))
}

fn packed(tables: &Tables<'_>) -> Option<Signal<4>> {
    let (rising, [packed]) = tables.group(["stateEstimateZ.quat"])?;
    let mut values = [const { Vec::new() }; 4];
    for &number in &packed {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the variable has 32 bits"
        )]
        let [x, y, z, w] = unpack(number as u32);
        values.iter_mut().zip([w, x, -y, -z]).for_each(|(column, part)| column.push(part));
    }
    Some(rising.signal("stateEstimateZ.quat", &values))
}

/// Quaternion x, y, z, w out of 32 bits (`quatcompress.h` of the firmware): two bits tell which part is
/// largest, then, from x on, for each other part its sign and nine bits of its size in 1/511 of the
/// square root of one half.
fn unpack(packed: u32) -> [f64; 4] {
    let largest = (packed >> 30) as usize;
    let mut quaternion = [0.0; 4];
    let mut bits = packed;
    for part in (0..4).rev().filter(|part| *part != largest) {
        let size = f64::from(bits & 0x1ff) / 511.0 * std::f64::consts::FRAC_1_SQRT_2;
        quaternion[part] = if bits & 0x200 == 0 { size } else { -size };
        bits >>= 10;
    }
    let squares: f64 = quaternion.iter().map(|part| part * part).sum();
    quaternion[largest] = (1.0 - squares).max(0.0).sqrt();
    quaternion
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `quatcompress` packs: largest part last but one, x and w of 1/511 steps.
    #[test]
    fn packed_quaternions() {
        assert_eq!(unpack(3 << 30), [0.0, 0.0, 0.0, 1.0]);
        // y largest: x = 511 steps, z = -256 steps, w = 0.
        let [x, y, z, w] = unpack(1 << 30 | 511 << 20 | (0x200 | 256) << 10);
        assert!((x - 0.5_f64.sqrt()).abs() < 1e-12 && w == 0.0);
        assert!((z + 256.0 / 511.0 * 0.5_f64.sqrt()).abs() < 1e-12);
        assert!((x * x + y * y + z * z + w * w - 1.0).abs() < 1e-12);
    }
}
