//! From a tracker's axes to ours: inertial north-east-down, body front-right-down, Euler angles
//! Z-Y-X.
//!
//! Two right-handed frames whose axes lie along each other are told by three signed letters:
//! `x,-y,-z` says that our first axis is the tracker's x, the second its -y, the third its -z. That
//! is what a tracker with z up needs, in the room (north, east, down) and on the tracked object
//! (front, right, down), if x points north and to the craft's front.
//!
//! With C for the room (`ned = C t`), B for the object (`body = B o`), R the tracker's rotation
//! (object to room) and D the small turn of the body against the object as it was drawn in the
//! tracker's program:
//!
//! ```text
//! dcm (north-east-down to body) = D B R^T C^T          position = C t - origin
//! ```
//!
//! Not here: from the tracked point to the centre of mass. That is `tracked_point` in the vehicle
//! file, and identification's.

use std::fmt;
use std::str::FromStr;

use model::frames::{dcm_from_euler, euler_from_dcm};
use nalgebra::{Matrix3, Vector3};
use proto::Pose;

/// Our three axes as signed axes of another right-handed frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axes([Axis; 3]);

/// An axis of the other frame: which, and whether turned round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Axis {
    of: usize,
    negative: bool,
}

/// Why letters are not axes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AxesError {
    /// Not three signed letters.
    #[error("{0:?} are not axes: give three of x, y, z with their signs, such as x,-y,-z")]
    Letters(String),
    /// An axis twice.
    #[error("{0:?} names an axis twice: each of x, y and z has to be there once")]
    Twice(String),
    /// A mirror image.
    #[error("{0:?} is a mirror image of a right-handed frame: change the sign of one axis")]
    LeftHanded(String),
}

impl Axes {
    /// Axes that lie along ours.
    pub const SAME: Self = Self::of([(0, false), (1, false), (2, false)]);
    /// A frame with z up and x along ours: Vicon Tracker, and Motive if it is told to stream with z
    /// up.
    pub const Z_UP: Self = Self::of([(0, false), (1, true), (2, true)]);
    /// A frame with y up and x along ours: Motive's default (`x, z, -y` in PX4's guide to motion
    /// capture as well).
    pub const Y_UP: Self = Self::of([(0, false), (2, false), (1, true)]);

    const fn of([(a, s), (b, t), (c, u)]: [(usize, bool); 3]) -> Self {
        Self([Axis { of: a, negative: s }, Axis { of: b, negative: t }, Axis { of: c, negative: u }])
    }

    /// Turns components along the other frame's axes into components along ours.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| {
            let Axis { of, negative } = self.0[row];
            if of == column { if negative { -1.0 } else { 1.0 } } else { 0.0 }
        })
    }
}

impl FromStr for Axes {
    type Err = AxesError;

    fn from_str(text: &str) -> Result<Self, AxesError> {
        let axis = |word: &str| {
            let word = word.trim();
            let (negative, letter) = match word.strip_prefix('-') {
                Some(rest) => (true, rest),
                None => (false, word.strip_prefix('+').unwrap_or(word)),
            };
            let of = ["x", "y", "z"].iter().position(|name| *name == letter)?;
            Some(Axis { of, negative })
        };
        let found: Option<Vec<Axis>> = text.split(',').map(axis).collect();
        let axes: Option<[Axis; 3]> = found.and_then(|axes| axes.try_into().ok());
        let axes = Self(axes.ok_or_else(|| AxesError::Letters(text.into()))?);
        match axes.matrix().determinant() {
            d if d > 0.5 => Ok(axes),
            d if d < -0.5 => Err(AxesError::LeftHanded(text.into())),
            _ => Err(AxesError::Twice(text.into())),
        }
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, Axis { of, negative }) in self.0.iter().enumerate() {
            let (comma, sign) = (if k > 0 { "," } else { "" }, if *negative { "-" } else { "" });
            write!(f, "{comma}{sign}{}", ["x", "y", "z"][*of])?;
        }
        Ok(())
    }
}

/// How a tracker's room and object lie to ours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frames {
    /// North, east, down as axes of the tracker's room.
    pub room: Axes,
    /// Front, right, down as axes of the tracked object.
    pub object: Axes,
    /// Our origin, inertial north-east-down from the tracker's, m.
    pub origin_m: [f64; 3],
    /// From the object's axes (after `object`) to the body's: roll, pitch, yaw, rad. Small: how
    /// crooked the object was drawn.
    pub turn_rad: [f64; 3],
}

impl Frames {
    /// Equal axes in room and on the object.
    pub const fn with_axes(axes: Axes) -> Self {
        Self { room: axes, object: axes, origin_m: [0.0; 3], turn_rad: [0.0; 3] }
    }

    /// Our pose of a tracker's: `position_m` along its axes in m, `rotation` from the object to the
    /// room. None if it is not all finite.
    pub fn pose(&self, position_m: [f64; 3], rotation: &Matrix3<f64>) -> Option<Pose> {
        let room = self.room.matrix();
        let position = room * Vector3::from(position_m) - Vector3::from(self.origin_m);
        let turn = dcm_from_euler(Vector3::from(self.turn_rad));
        let dcm = turn * self.object.matrix() * rotation.transpose() * room.transpose();
        let euler = euler_from_dcm(&dcm);
        let single = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        let pose = Pose { position_m: single(position), attitude_rad: single(euler) };
        let finite = |v: [f32; 3]| v.iter().all(|x| x.is_finite());
        (finite(pose.position_m) && finite(pose.attitude_rad)).then_some(pose)
    }

    /// The way back: what the tracker would say of a pose. For simulated trackers.
    pub fn seen(&self, pose: &Pose) -> ([f64; 3], Matrix3<f64>) {
        let room = self.room.matrix();
        let position = Vector3::from(pose.position_m.map(f64::from)) + Vector3::from(self.origin_m);
        let turn = dcm_from_euler(Vector3::from(self.turn_rad));
        let dcm = dcm_from_euler(Vector3::from(pose.attitude_rad.map(f64::from)));
        let rotation = room.transpose() * dcm.transpose() * turn * self.object.matrix();
        ((room.transpose() * position).into(), rotation)
    }
}

/// Rotation (object to room) of angles about x, then the new y, then the newest z: a Vicon
/// tracker's, thesis (3.1).
pub fn rotation_from_xyz([x, y, z]: [f64; 3]) -> Matrix3<f64> {
    let ((sx, cx), (sy, cy), (sz, cz)) = (x.sin_cos(), y.sin_cos(), z.sin_cos());
    Matrix3::new(
        cy * cz,
        -cy * sz,
        sy,
        cx * sz + sx * sy * cz,
        cx * cz - sx * sy * sz,
        -sx * cy,
        sx * sz - cx * sy * cz,
        sx * cz + cx * sy * sz,
        cx * cy,
    )
}

/// The angles about x, the new y and the newest z of a rotation (object to room), rad.
pub fn xyz_from_rotation(r: &Matrix3<f64>) -> [f64; 3] {
    let y = r[(0, 2)].clamp(-1.0, 1.0).asin();
    [(-r[(1, 2)]).atan2(r[(2, 2)]), y, (-r[(0, 1)]).atan2(r[(0, 0)])]
}

/// Rotation of a unit quaternion `x, y, z, w` (Motive's order). None if it is far from unit length.
pub fn rotation_from_xyzw([x, y, z, w]: [f64; 4]) -> Option<Matrix3<f64>> {
    let length = (x * x + y * y + z * z + w * w).sqrt();
    if !((length - 1.0).abs() < 1e-2) {
        return None;
    }
    let q = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    Some(q.to_rotation_matrix().into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn near(got: [f32; 3], want: [f64; 3], tolerance: f64) {
        for (got, want) in got.iter().zip(want) {
            let error = (f64::from(*got) - want + PI).rem_euclid(2.0 * PI) - PI;
            assert!(error.abs() < tolerance, "{got:?} {want:?}");
        }
    }

    /// Thesis (3.1), written down as printed.
    fn thesis_3_1([phi, theta, psi]: [f64; 3]) -> [f64; 3] {
        let r11 = theta.cos() * psi.cos();
        let r12 = phi.cos() * psi.sin() + phi.sin() * theta.sin() * psi.cos();
        let r13 = phi.sin() * psi.sin() - phi.cos() * theta.sin() * psi.cos();
        let r23 = phi.sin() * psi.cos() + phi.cos() * theta.sin() * psi.sin();
        let r33 = phi.cos() * theta.cos();
        let pitch = -r13.asin();
        [(r23 / pitch.cos()).atan2(r33 / pitch.cos()), pitch, (r12 / pitch.cos()).atan2(r11 / pitch.cos())]
    }

    proptest! {
        #[test]
        fn vicon_angles_become_ours_by_thesis_3_1(x in -3.1..3.1f64, y in -1.5..1.5f64, z in -3.1..3.1f64) {
            let want = thesis_3_1([x, y, z]);
            let pose = Frames::with_axes(Axes::SAME).pose([0.0; 3], &rotation_from_xyz([x, y, z])).unwrap();
            // Single precision, and the arcsine near the vertical.
            near(pose.attitude_rad, want, 1e-6 / want[1].cos().max(1e-2));
        }

        #[test]
        fn rotations_are_nalgebras(x in -3.1..3.1f64, y in -1.5..1.5f64, z in -3.1..3.1f64) {
            let axis = Rotation3::from_axis_angle;
            let (ex, ey, ez) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
            let composed = axis(&ex, x) * axis(&ey, y) * axis(&ez, z);
            prop_assert!((composed.matrix() - rotation_from_xyz([x, y, z])).norm() < 1e-12);
            for (got, want) in xyz_from_rotation(composed.matrix()).iter().zip([x, y, z]) {
                prop_assert!((got - want).abs() < 1e-9, "{} {}", got, want);
            }
            let q = nalgebra::UnitQuaternion::from_rotation_matrix(&composed);
            let again = rotation_from_xyzw([q.i, q.j, q.k, q.w]).unwrap();
            prop_assert!((composed.matrix() - again).norm() < 1e-12);
        }

        #[test]
        fn a_pose_survives_the_way_to_a_tracker_and_back(
            position in prop::array::uniform3(-5.0f32..5.0), roll in -3.0f32..3.0, pitch in -1.4f32..1.4, yaw in -3.1f32..3.1,
            which in 0usize..3, turn in prop::array::uniform3(-0.1..0.1f64),
        ) {
            let axes = [Axes::SAME, Axes::Z_UP, Axes::Y_UP][which];
            let frames = Frames { origin_m: [1.0, -2.0, 0.5], turn_rad: turn, ..Frames::with_axes(axes) };
            let pose = Pose { position_m: position, attitude_rad: [roll, pitch, yaw] };
            let (position_m, rotation) = frames.seen(&pose);
            let back = frames.pose(position_m, &rotation).unwrap();
            near(back.attitude_rad, pose.attitude_rad.map(f64::from), 1e-5);
            near(back.position_m, pose.position_m.map(f64::from), 1e-5);
        }
    }

    /// By hand, with the right-hand rule in a room with z up: about x (front) the left side rises,
    /// which is a roll to the right; about y (left) the nose goes down; about z (up) the nose goes
    /// left.
    #[test]
    fn a_tracker_with_z_up_by_hand() {
        let frames = Frames::with_axes(Axes::Z_UP);
        let attitude = |angles| frames.pose([0.0; 3], &rotation_from_xyz(angles)).unwrap().attitude_rad;
        near(attitude([0.3, 0.0, 0.0]), [0.3, 0.0, 0.0], 1e-6);
        near(attitude([0.0, 0.3, 0.0]), [0.0, -0.3, 0.0], 1e-6);
        near(attitude([0.0, 0.0, FRAC_PI_2]), [0.0, 0.0, -FRAC_PI_2], 1e-6);
        let place = frames.pose([1.0, 2.0, 3.0], &Matrix3::identity()).unwrap().position_m;
        assert_eq!(place, [1.0, -2.0, -3.0], "to the left is west, up is negative");
    }

    /// PX4's guide: of a room with x to the front, z to the right and y up, `x, z, -y` are ours.
    #[test]
    fn a_tracker_with_y_up_by_hand() {
        let frames = Frames::with_axes(Axes::Y_UP);
        let place = frames.pose([1.0, 2.0, 3.0], &Matrix3::identity()).unwrap().position_m;
        assert_eq!(place, [1.0, 3.0, -2.0]);
        // A quarter turn about y, upwards: counter-clockwise from above, the nose goes left.
        let half = FRAC_PI_2 / 2.0;
        let rotation = rotation_from_xyzw([0.0, half.sin(), 0.0, half.cos()]).unwrap();
        near(frames.pose([0.0; 3], &rotation).unwrap().attitude_rad, [0.0, 0.0, -FRAC_PI_2], 1e-6);
    }

    #[test]
    fn an_object_drawn_backwards_is_turned_round() {
        let object: Axes = "-x,y,-z".parse().unwrap();
        let frames = Frames { object, ..Frames::with_axes(Axes::Z_UP) };
        // The object's x points to the craft's tail: standing along north in the tracker, the craft
        // heads south.
        let pose = frames.pose([0.0; 3], &Matrix3::identity()).unwrap();
        near(pose.attitude_rad, [0.0, 0.0, PI], 1e-6);
        let crooked = Frames { turn_rad: [0.02, 0.0, 0.0], ..Frames::with_axes(Axes::Z_UP) };
        near(crooked.pose([0.0; 3], &Matrix3::identity()).unwrap().attitude_rad, [0.02, 0.0, 0.0], 1e-6);
    }

    #[test]
    fn all_48_signed_axes_are_24_frames_and_24_mirror_images() {
        let mut counts = [0; 3];
        let letters = ["x", "-x", "y", "-y", "z", "-z"];
        for a in letters {
            for b in letters {
                for c in letters {
                    let text = format!("{a},{b},{c}");
                    match text.parse::<Axes>() {
                        Ok(axes) => {
                            counts[0] += 1;
                            assert_eq!(axes.to_string(), text);
                            assert!(
                                (axes.matrix() * axes.matrix().transpose() - Matrix3::identity()).norm()
                                    < 1e-15
                            );
                        }
                        Err(AxesError::LeftHanded(_)) => counts[1] += 1,
                        Err(_) => counts[2] += 1,
                    }
                }
            }
        }
        assert_eq!(counts, [24, 24, 216 - 48]);
        for text in ["", "x", "x,y", "x,y,z,x", "x,y,w", "x y z", "--x,y,z", "é,y,z"] {
            assert!(matches!(text.parse::<Axes>(), Err(AxesError::Letters(_))), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_is_no_pose() {
        let frames = Frames::with_axes(Axes::Z_UP);
        assert_eq!(frames.pose([f64::NAN, 0.0, 0.0], &Matrix3::identity()), None);
        assert_eq!(frames.pose([1e300, 0.0, 0.0], &Matrix3::identity()), None);
        assert_eq!(frames.pose([0.0; 3], &rotation_from_xyz([f64::NAN; 3])), None);
        assert_eq!(rotation_from_xyzw([0.0; 4]), None);
        assert_eq!(rotation_from_xyzw([f64::NAN; 4]), None);
    }
}
