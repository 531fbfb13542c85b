//! Can it be true? Questions about poses that need no memory. Comparisons are written so that NaN falls on the bad side.

use crate::dsp::trig::{sin_cos, wrap_angle};
use crate::inputs::input_checks::{ANGLE_LIMIT_RAD, POSITION_LIMIT_M, magnitude};
use crate::inputs::readings::Pose;
use crate::safety::limits::Limits;

/// `|roll| + |pitch|` in rad, never less than the tilt as long as that is under a right angle.
#[inline]
pub(crate) fn tilt_bound([roll, pitch, _]: [f32; 3]) -> f32 {
    roll.abs() + pitch.abs()
}

/// Inside the box? NaN is not.
#[inline]
pub(crate) fn is_inside([x, y, z]: [f32; 3], limits: &Limits) -> bool {
    let ([cx, cy, cz], [hx, hy, hz]) = (limits.fence_centre_m, limits.fence_half_m);
    (x - cx).abs() <= hx && (y - cy).abs() <= hy && (z - cz).abs() <= hz
}

/// Do two vectors differ? (Written out: a comparison of arrays is a loop.)
#[inline]
pub(crate) fn differ([a, b, c]: &[f32; 3], [x, y, z]: &[f32; 3]) -> bool {
    a != x || b != y || c != z
}

/// Numbers within reason?
#[cold]
pub(crate) fn is_pose(pose: &Pose) -> bool {
    pose.position_m.iter().all(|x| magnitude(*x) <= POSITION_LIMIT_M.to_bits())
        && pose.attitude_rad.iter().all(|x| magnitude(*x) <= ANGLE_LIMIT_RAD.to_bits())
}

/// Can the craft have got there? NaN cannot.
#[inline]
pub(crate) fn is_reachable(
    pose: &Pose,
    [x0, y0, z0]: [f32; 3],
    [roll0, pitch0, yaw0]: [f32; 3],
    reach_m: f32,
    limits: &Limits,
) -> bool {
    let ([x, y, z], [roll, pitch, yaw]) = (pose.position_m, pose.attitude_rad);
    let (dx, dy, dz) = (x - x0, y - y0, z - z0);
    let jump_rad = limits.jump_rad;
    let (turned_roll, turned_pitch, turned_yaw) = (roll - roll0, pitch - pitch0, yaw - yaw0);
    dx * dx + dy * dy + dz * dz <= reach_m * reach_m
        && turned_pitch.abs() <= jump_rad
        && ((turned_roll.abs() <= jump_rad && turned_yaw.abs() <= jump_rad)
            || went_the_short_way(turned_roll, turned_yaw, jump_rad))
}

/// Roll and yaw may have gone through half a turn.
#[cold]
fn went_the_short_way(roll_rad: f32, yaw_rad: f32, jump_rad: f32) -> bool {
    // Beyond reason an angle has no short way.
    let turned = |angle: f32| angle.abs() <= 2.0 * ANGLE_LIMIT_RAD && wrap_angle(angle).abs() <= jump_rad;
    turned(roll_rad) && turned(yaw_rad)
}

/// Is the tilt beyond its limit? `cos(tilt) = cos(roll) cos(pitch)`; NaN is beyond.
#[cold]
pub(crate) fn is_tilted_beyond([roll, pitch, _]: [f32; 3], limits: &Limits) -> bool {
    let ((_, cos_roll), (_, cos_pitch)) = (sin_cos(roll), sin_cos(pitch));
    !(cos_roll * cos_pitch >= limits.tilt_cosine)
}
