//! Can it be true? Questions about poses that need no memory. Comparisons are written so that NaN
//! falls on the bad side.

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
    from_m: [f32; 3],
    from_rad: [f32; 3],
    reach_m: f32,
    limits: &Limits,
) -> bool {
    is_within(pose.position_m, from_m, reach_m) && is_turned_so(pose.attitude_rad, from_rad, limits)
}

/// Are two positions as near as that? NaN is not.
#[inline]
pub(crate) fn is_within([x, y, z]: [f32; 3], [x0, y0, z0]: [f32; 3], reach_m: f32) -> bool {
    let (dx, dy, dz) = (x - x0, y - y0, z - z0);
    dx * dx + dy * dy + dz * dz <= reach_m * reach_m
}

/// Can the craft have turned so? NaN cannot.
#[inline]
pub(crate) fn is_turned_so(
    [roll, pitch, yaw]: [f32; 3],
    [roll0, pitch0, yaw0]: [f32; 3],
    limits: &Limits,
) -> bool {
    let jump_rad = limits.jump_rad;
    let (turned_roll, turned_pitch, turned_yaw) = (roll - roll0, pitch - pitch0, yaw - yaw0);
    turned_pitch.abs() <= jump_rad
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;
    use crate::config::supervision_limits::Fence;
    use core::f32::consts::PI;
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    fn limits() -> Limits {
        Limits::new(&Config::thesis())
    }

    proptest! {
        /// The tilt by nalgebra's rotation matrix; f32 angles of up to 3 rad hold 3e-7.
        #[test]
        fn the_bound_is_no_less_than_the_tilt(roll in -1.5_f32..1.5, pitch in -1.5_f32..1.5, yaw in -3.0_f32..3.0) {
            let body = Rotation3::from_euler_angles(f64::from(roll), f64::from(pitch), f64::from(yaw));
            let tilt = (body * Vector3::z()).angle(&Vector3::z());
            prop_assume!(tilt < core::f64::consts::FRAC_PI_2);
            prop_assert!(f64::from(tilt_bound([roll, pitch, yaw])) > tilt - 1e-6);
            // The limit is 60 degrees; f32's cosine decides within 1e-6 of it.
            prop_assume!((tilt - core::f64::consts::FRAC_PI_3).abs() > 1e-6);
            let beyond = tilt > core::f64::consts::FRAC_PI_3;
            prop_assert_eq!(is_tilted_beyond([roll, pitch, yaw], &limits()), beyond);
        }
    }

    #[test]
    fn the_walls_belong_to_the_box_and_nan_does_not() {
        let limits = limits();
        assert!(is_inside([3.4, -2.2, -2.6], &limits) && is_inside([0.0, 0.0, 0.5], &limits));
        for outside in
            [[3.5, 0.0, 0.0], [0.0, -2.3, 0.0], [0.0, 0.0, -2.7], [0.0, 0.0, 0.6], [f32::NAN, 0.0, 0.0]]
        {
            assert!(!is_inside(outside, &limits), "{outside:?}");
        }
    }

    #[test]
    fn a_box_lies_where_its_walls_are() {
        let mut config = Config::thesis();
        let walls_m = [[-1.0, 3.0], [2.0, 4.0], [-2.5, 0.5]];
        let [x_m, y_m, z_m] = walls_m;
        config.supervision.fence = Fence { x_m, y_m, z_m, for_s: 0.2 };
        let limits = Limits::new(&config);
        for (axis, walls_m) in walls_m.into_iter().enumerate() {
            for (wall_m, outwards) in walls_m.into_iter().zip([-1.0, 1.0]) {
                let beyond = |off_m: f32| {
                    let mut position_m = [1.0, 3.0, -1.0];
                    position_m[axis] = wall_m as f32 + outwards * off_m;
                    !is_inside(position_m, &limits)
                };
                assert!(!beyond(0.0) && !beyond(-0.1) && beyond(1e-3), "axis {axis}, {wall_m} m");
            }
        }
    }

    #[test]
    fn vectors_differ_where_one_number_does() {
        let vector = [1.0, 2.0, 3.0];
        assert!(!differ(&vector, &vector));
        for axis in 0..3 {
            let mut other = vector;
            other[axis] += 1e-6;
            assert!(differ(&vector, &other), "axis {axis}");
        }
    }

    /// 3^2 + 4^2 + 12^2 = 13^2, in every order and direction, from a place that is not the origin.
    #[test]
    fn what_is_within_reach_is_a_ball() {
        let from_m = [1.0, -2.0, 0.5];
        for [x, y, z] in [[3.0, 4.0, 12.0], [4.0, 12.0, 3.0], [12.0, 3.0, 4.0]] {
            for signs in 0..8_u8 {
                let sign = |axis: u8| if signs >> axis & 1 == 0 { 1.0 } else { -1.0 };
                let to_m = [1.0 + sign(0) * x, -2.0 + sign(1) * y, 0.5 + sign(2) * z];
                assert!(is_within(to_m, from_m, 13.0) && !is_within(to_m, from_m, 12.999), "{to_m:?}");
            }
        }
    }

    /// At the limit it can have turned so, about each axis; about roll and yaw the short way, both of them.
    #[test]
    fn a_turn_is_limited_about_each_axis() {
        let limits = limits();
        let jump_rad = limits.jump_rad;
        for axis in 0..3 {
            let turned = |angle_rad: f32| {
                let mut to_rad = [0.0; 3];
                to_rad[axis] = angle_rad;
                is_turned_so(to_rad, [0.0; 3], &limits) && is_turned_so([0.0; 3], to_rad, &limits)
            };
            assert!(turned(jump_rad) && !turned(jump_rad + 1e-6), "axis {axis}");
            let from_rad = [0.5, -0.4, 0.3];
            let from = |angle_rad: f32| {
                let mut to_rad = from_rad;
                to_rad[axis] += angle_rad;
                is_turned_so(to_rad, from_rad, &limits)
            };
            assert!(from(0.99 * jump_rad) && from(-0.99 * jump_rad), "axis {axis}");
            assert!(!from(1.01 * jump_rad) && !from(-1.01 * jump_rad), "axis {axis}");
        }
        let round = 2.0 * PI;
        assert!(is_turned_so([round, 0.0, -round], [0.1, 0.0, -0.1], &limits));
        assert!(!is_turned_so([round, 0.0, 2.0], [0.0; 3], &limits), "yaw has turned");
        assert!(!is_turned_so([2.0, 0.0, round], [0.0; 3], &limits), "roll has turned");
        // Two angles within reason are at most twice as far apart.
        assert!(went_the_short_way(318.0 * round, 0.0, jump_rad), "1998 rad");
        assert!(!went_the_short_way(319.0 * round, 0.0, jump_rad), "2004 rad");
    }

    #[test]
    fn a_pose_is_reachable_by_the_short_way_round_only() {
        let limits = limits();
        let from = |attitude_rad: [f32; 3], position_m: [f32; 3]| {
            let pose = Pose { position_m, attitude_rad };
            is_reachable(&pose, [0.0; 3], [0.0, 0.0, PI - 0.1], 0.5, &limits)
        };
        assert!(from([0.0, 0.0, PI - 0.1], [0.5, 0.0, 0.0]));
        assert!(from([0.0, 0.0, -PI + 0.1], [0.0; 3]), "0.2 rad through half a turn");
        assert!(!from([0.0, 0.0, 0.0], [0.0; 3]), "nearly half a turn");
        assert!(!from([0.0, 1.1, PI - 0.1], [0.0; 3]), "pitch has no other way");
        assert!(!from([0.0, 0.0, PI - 0.1], [0.4, 0.4, 0.0]), "0.57 m");
        assert!(!from([0.0, 0.0, f32::NAN], [0.0; 3]) && !from([0.0, 0.0, PI], [f32::NAN, 0.0, 0.0]));
        assert!(!from([0.0, 0.0, 1e30], [0.0; 3]), "no angle at all");
    }

    #[test]
    fn a_first_pose_may_be_anywhere_within_reason() {
        let pose = |x, yaw| Pose { position_m: [x, 0.0, 0.0], attitude_rad: [0.0, 0.0, yaw] };
        assert!(is_pose(&pose(1e5, -1000.0)));
        for bad in [pose(1.1e5, 0.0), pose(f32::NAN, 0.0), pose(0.0, 1001.0), pose(0.0, f32::INFINITY)] {
            assert!(!is_pose(&bad), "{bad:?}");
        }
    }
}
