//! Where the craft is, as the three-dimensional views of other programs show it: Foxglove's messages, in frames whose z axis points up.
//!
//! Frame `room`: x east, y north, z up. Frame `craft`: x forward, y left, z up. Ours are north-east-down and forward-right-down; the
//! turns between the two pairs are constant.

use std::collections::VecDeque;

use model::frames::dcm_from_euler;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use proto::Pose;
use serde_json::{Value, json};

/// Between two points of the track, us.
const STEP_US: u64 = 200_000;
/// Between two messages of the track, us.
const TRACK_US: u64 = 1_000_000;
/// Points of the track: a minute.
const POINTS: usize = 300;

/// The way that the craft came.
#[derive(Debug, Default)]
pub(super) struct Trail {
    poses: VecDeque<Pose>,
    next_point_us: u64,
    next_track_us: u64,
}

impl Trail {
    /// Takes a pose that is a number, and gives the track where it is time to record it again.
    pub(super) fn push(&mut self, now_us: u64, pose: Pose) -> Option<&[Pose]> {
        if now_us >= self.next_point_us {
            self.next_point_us = now_us + STEP_US;
            if self.poses.len() == POINTS {
                self.poses.pop_front();
            }
            self.poses.push_back(pose);
        }
        if now_us < self.next_track_us {
            return None;
        }
        self.next_track_us = now_us + TRACK_US;
        Some(self.poses.make_contiguous())
    }
}

/// Whether all of it is a number: a tracker that has lost the craft says where it is not.
pub(super) fn is_known(pose: &Pose) -> bool {
    pose.position_m.iter().chain(&pose.attitude_rad).all(|value| value.is_finite())
}

/// `foxglove.FrameTransform`.
pub(super) fn transform(pose: &Pose, timestamp: &Value) -> Value {
    let (position, orientation) = seen_upwards(pose);
    json!({
        "timestamp": timestamp,
        "parent_frame_id": "room",
        "child_frame_id": "craft",
        "translation": position,
        "rotation": orientation,
    })
}

/// `foxglove.PosesInFrame`.
pub(super) fn track(poses: &[Pose], timestamp: &Value) -> Value {
    let pose = |pose: &Pose| {
        let (position, orientation) = seen_upwards(pose);
        json!({ "position": position, "orientation": orientation })
    };
    json!({ "timestamp": timestamp, "frame_id": "room", "poses": poses.iter().map(pose).collect::<Vec<_>>() })
}

/// Position and orientation in frames that point up.
fn seen_upwards(pose: &Pose) -> (Value, Value) {
    let [north, east, down] = pose.position_m.map(f64::from);
    let to_room = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let from_craft = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let attitude = dcm_from_euler(Vector3::from(pose.attitude_rad.map(f64::from)));
    let turned = Rotation3::from_matrix_unchecked(to_room * attitude.transpose() * from_craft);
    let turned = UnitQuaternion::from_rotation_matrix(&turned);
    (
        json!({ "x": east, "y": north, "z": -down }),
        json!({ "x": turned.i, "y": turned.j, "z": turned.k, "w": turned.w }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(position_m: [f32; 3], attitude_rad: [f32; 3]) -> Pose {
        Pose { position_m, attitude_rad }
    }

    fn turned(attitude_rad: [f32; 3], forward: Vector3<f64>) -> Vector3<f64> {
        let message = transform(&pose([0.0; 3], attitude_rad), &json!({}));
        let [x, y, z, w] = ["x", "y", "z", "w"].map(|part| message["rotation"][part].as_f64().unwrap());
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z)) * forward
    }

    #[test]
    fn north_is_y_east_is_x_and_height_is_up() {
        let message = transform(&pose([1.0, 2.0, -3.0], [0.0; 3]), &json!({}));
        assert_eq!(message["translation"], json!({ "x": 2.0, "y": 1.0, "z": 3.0 }));
    }

    #[test]
    fn a_craft_looks_where_it_looks() {
        let near = |a: Vector3<f64>, b: [f64; 3]| assert!((a - Vector3::from(b)).norm() < 1e-6, "{a} {b:?}");
        let (forward, left, up) = (Vector3::x(), Vector3::y(), Vector3::z());
        // Level and to the north, its left is west; turned to the east, its left is north.
        near(turned([0.0; 3], forward), [0.0, 1.0, 0.0]);
        near(turned([0.0; 3], left), [-1.0, 0.0, 0.0]);
        near(turned([0.0; 3], up), [0.0, 0.0, 1.0]);
        let quarter = std::f32::consts::FRAC_PI_2;
        near(turned([0.0, 0.0, quarter], forward), [1.0, 0.0, 0.0]);
        near(turned([0.0, 0.0, quarter], left), [0.0, 1.0, 0.0]);
        // Nose up by a quarter: it looks at the ceiling. Rolled to the right: its left is up.
        near(turned([0.0, quarter, 0.0], forward), [0.0, 0.0, 1.0]);
        near(turned([quarter, 0.0, 0.0], left), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn the_track_is_the_last_minute_five_times_a_second() {
        let mut trail = Trail::default();
        let mut tracks = Vec::new();
        for k in 0..10_000_u32 {
            let here = pose([k as f32, 0.0, 0.0], [0.0; 3]);
            if let Some(track) = trail.push(u64::from(k) * 10_000, here) {
                tracks.push(track.to_vec());
            }
        }
        assert_eq!(tracks.len(), 100);
        let last = tracks.last().unwrap();
        assert_eq!((last.len(), last[299].position_m[0] - last[0].position_m[0]), (300, 5980.0));
    }
}
