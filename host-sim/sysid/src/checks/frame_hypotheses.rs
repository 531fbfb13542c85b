//! Ways in which a log's axes, signs and units have been seen to be wrong, and what undoes each.

use model::frames;
use std::f64::consts::{FRAC_PI_2, PI};

use flights::{Column, Mend, MendedColumn};
use model::{BodyFrame, WorldFrame};
use nalgebra::{Matrix3, Vector3};

use crate::checks::tracks::Axes;

/// A way the attitude may have been written wrongly.
pub(super) struct Attitude {
    /// What the log looks like.
    pub(super) looks_like: &'static str,
    pub(super) mend: &'static str,
    /// From the logged angles to the body's attitude (inertial to body).
    pub(super) undo: fn(Vector3<f64>) -> Matrix3<f64>,
    /// The angles that undo it, where other angles do.
    pub(super) angles: &'static [MendedColumn],
}

const fn angle(own: Column, from: Column, scale: f64, offset: f64) -> MendedColumn {
    MendedColumn::new(own, from, scale, offset)
}

const PER_DEGREE: f64 = PI / 180.0;

const FLIP_YZ: Matrix3<f64> = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
/// From east-north-up to north-east-down and back.
const ENU: Matrix3<f64> = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);

pub(super) fn as_logged(euler: Vector3<f64>) -> Matrix3<f64> {
    frames::dcm_from_euler(euler)
}

fn signed(euler: Vector3<f64>, signs: [f64; 3]) -> Matrix3<f64> {
    frames::dcm_from_euler(euler.component_mul(&Vector3::from(signs)))
}

/// From a quaternion whose entries were taken in another order.
fn reordered(euler: Vector3<f64>, order: [usize; 4]) -> Matrix3<f64> {
    let q = frames::quaternion_from_euler(euler);
    frames::dcm_from_quaternion(&nalgebra::Vector4::from(order.map(|k| q[k])))
}

pub(super) const ATTITUDES: [Attitude; 17] = [
    Attitude {
        looks_like: "phi and theta are exchanged",
        mend: "exchange the columns",
        undo: |e| frames::dcm_from_euler(Vector3::new(e.y, e.x, e.z)),
        angles: &[angle(Column::Phi, Column::Theta, 1.0, 0.0), angle(Column::Theta, Column::Phi, 1.0, 0.0)],
    },
    Attitude {
        looks_like: "theta has the wrong sign (as in logs of the Crazyflie firmware)",
        mend: "write -theta",
        undo: |e| signed(e, [1.0, -1.0, 1.0]),
        angles: &[angle(Column::Theta, Column::Theta, -1.0, 0.0)],
    },
    Attitude {
        looks_like: "phi has the wrong sign",
        mend: "write -phi",
        undo: |e| signed(e, [-1.0, 1.0, 1.0]),
        angles: &[angle(Column::Phi, Column::Phi, -1.0, 0.0)],
    },
    Attitude {
        looks_like: "psi has the wrong sign",
        mend: "write -psi",
        undo: |e| signed(e, [1.0, 1.0, -1.0]),
        angles: &[angle(Column::Psi, Column::Psi, -1.0, 0.0)],
    },
    Attitude {
        looks_like: "theta and psi are those of a body front-left-up in a frame north-west-up",
        mend: "write -theta and -psi",
        undo: |e| signed(e, [1.0, -1.0, -1.0]),
        angles: &[angle(Column::Theta, Column::Theta, -1.0, 0.0), angle(Column::Psi, Column::Psi, -1.0, 0.0)],
    },
    Attitude {
        looks_like: "phi and theta have the wrong sign",
        mend: "write -phi and -theta",
        undo: |e| signed(e, [-1.0, -1.0, 1.0]),
        angles: &[angle(Column::Phi, Column::Phi, -1.0, 0.0), angle(Column::Theta, Column::Theta, -1.0, 0.0)],
    },
    Attitude {
        looks_like: "phi and psi have the wrong sign",
        mend: "write -phi and -psi",
        undo: |e| signed(e, [-1.0, 1.0, -1.0]),
        angles: &[angle(Column::Phi, Column::Phi, -1.0, 0.0), angle(Column::Psi, Column::Psi, -1.0, 0.0)],
    },
    Attitude {
        looks_like: "the attitude is that from the inertial to the body frame (a conjugated quaternion, a transposed matrix)",
        mend: "conjugate the quaternion (or transpose the matrix) before taking angles from it",
        undo: |e| frames::dcm_from_euler(e).transpose(),
        angles: &[],
    },
    Attitude {
        looks_like: "the attitude is from a quaternion x, y, z, w that was read as w, x, y, z",
        mend: "put its last entry first before taking angles from it",
        undo: |e| reordered(e, [3, 0, 1, 2]),
        angles: &[],
    },
    Attitude {
        looks_like: "the attitude is from a quaternion w, x, y, z that was read as x, y, z, w",
        mend: "put its first entry last before taking angles from it",
        undo: |e| reordered(e, [1, 2, 3, 0]),
        angles: &[],
    },
    Attitude {
        looks_like: "the attitude is from a quaternion x, y, z, w that was read as w, x, y, z and conjugated",
        mend: "put its last entry first and conjugate it before taking angles from it",
        undo: |e| reordered(e, [3, 0, 1, 2]).transpose(),
        angles: &[],
    },
    Attitude {
        looks_like: "the attitude is from a conjugated quaternion w, x, y, z that was read as x, y, z, w",
        mend: "put its first entry last and conjugate it before taking angles from it",
        undo: |e| reordered(e, [1, 2, 3, 0]).transpose(),
        angles: &[],
    },
    Attitude {
        looks_like: "the attitude is that of a body front-left-up in a frame east-north-up",
        mend: "write phi, -theta and pi/2 - psi",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e) * ENU,
        angles: &[
            angle(Column::Theta, Column::Theta, -1.0, 0.0),
            angle(Column::Psi, Column::Psi, -1.0, FRAC_PI_2),
        ],
    },
    Attitude {
        looks_like: "the attitude is that of a body front-left-up (it is upside down)",
        mend: "turn it by half a turn about x: write phi + pi",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e),
        angles: &[angle(Column::Phi, Column::Phi, 1.0, PI)],
    },
    Attitude {
        looks_like: "the attitude is given in a frame north-west-up",
        mend: "turn the frame by half a turn about x",
        undo: |e| frames::dcm_from_euler(e) * FLIP_YZ,
        angles: &[
            angle(Column::Phi, Column::Phi, 1.0, PI),
            angle(Column::Theta, Column::Theta, -1.0, 0.0),
            angle(Column::Psi, Column::Psi, -1.0, 0.0),
        ],
    },
    Attitude {
        looks_like: "phi, theta and psi are in degrees",
        mend: "multiply by pi/180",
        undo: |e| frames::dcm_from_euler(e.map(f64::to_radians)),
        angles: &[
            angle(Column::Phi, Column::Phi, PER_DEGREE, 0.0),
            angle(Column::Theta, Column::Theta, PER_DEGREE, 0.0),
            angle(Column::Psi, Column::Psi, PER_DEGREE, 0.0),
        ],
    },
    Attitude {
        looks_like: "psi is in degrees",
        mend: "multiply by pi/180",
        undo: |e| frames::dcm_from_euler(Vector3::new(e.x, e.y, e.z.to_radians())),
        angles: &[angle(Column::Psi, Column::Psi, PER_DEGREE, 0.0)],
    },
];

/// Conventions in which several streams are wrong together: attitude, axes of the position, axes of
/// the gyro.
pub(super) struct Convention {
    pub(super) looks_like: &'static str,
    pub(super) mend: &'static str,
    pub(super) undo: fn(Vector3<f64>) -> Matrix3<f64>,
    pub(super) position: Axes,
    pub(super) gyro: Axes,
    /// What undoes all of it.
    pub(super) undone_by: fn() -> Mend,
}

const FLIPPED_YZ: Axes = Axes { from: [0, 1, 2], sign: [1.0, -1.0, -1.0] };
const FROM_ENU: Axes = Axes { from: [1, 0, 2], sign: [1.0, 1.0, -1.0] };

pub(super) const CONVENTIONS: [Convention; 5] = [
    Convention {
        looks_like: "the whole log is in the frames north-west-up and front-left-up",
        mend: "write -y, -z, -theta, -psi, -q, -r (and -ay, -az, -vy, -vz), or world = \"nwu\" and body = \"flu\" under [frames] in \
               columns.toml beside it",
        undo: |e| signed(e, [1.0, -1.0, -1.0]),
        position: FLIPPED_YZ,
        gyro: FLIPPED_YZ,
        undone_by: || Mend::Frames(WorldFrame::Nwu, BodyFrame::Flu),
    },
    Convention {
        looks_like: "the whole log is in the frames east-north-up and front-left-up (as ROS has it)",
        mend: "write y, x, -z for x, y, z; -theta and pi/2 - psi; -q, -r (and vy, vx, -vz; -ay, -az), or world = \"enu\" and body = \
               \"flu\" under [frames] in columns.toml beside it",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e) * ENU,
        position: FROM_ENU,
        gyro: FLIPPED_YZ,
        undone_by: || Mend::Frames(WorldFrame::Enu, BodyFrame::Flu),
    },
    Convention {
        looks_like: "the tracker is in the frames north-west-up and front-left-up",
        mend: "write -y, -z, -theta, -psi (and -vy, -vz)",
        undo: |e| signed(e, [1.0, -1.0, -1.0]),
        position: FLIPPED_YZ,
        gyro: Axes::SAME,
        undone_by: tracker_north_west_up,
    },
    Convention {
        looks_like: "the tracker is in the frames east-north-up and front-left-up (as ROS has it)",
        mend: "write y, x, -z for x, y, z; -theta and pi/2 - psi (and vy, vx, -vz)",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e) * ENU,
        position: FROM_ENU,
        gyro: Axes::SAME,
        undone_by: tracker_east_north_up,
    },
    Convention {
        looks_like: "the body's axes are front-left-up in attitude and gyro",
        mend: "turn the attitude by half a turn about x and write -q, -r (and -ay, -az)",
        undo: |e| FLIP_YZ * frames::dcm_from_euler(e),
        position: Axes::SAME,
        gyro: FLIPPED_YZ,
        undone_by: || Mend::Frames(WorldFrame::Ned, BodyFrame::Flu),
    },
];

/// The tracker's columns out of a frame north-west-up with a body front-left-up.
fn tracker_north_west_up() -> Mend {
    use Column::*;
    Mend::Columns(
        [Y, Z, Theta, Psi, Vy, Vz].map(|column| MendedColumn::new(column, column, -1.0, 0.0)).into(),
    )
}

/// The tracker's columns out of a frame east-north-up with a body front-left-up.
fn tracker_east_north_up() -> Mend {
    use Column::*;
    let turned = [(X, Y, 1.0), (Y, X, 1.0), (Z, Z, -1.0), (Vx, Vy, 1.0), (Vy, Vx, 1.0), (Vz, Vz, -1.0)];
    let mut all = turned.map(|(own, from, sign)| MendedColumn::new(own, from, sign, 0.0)).to_vec();
    all.extend([MendedColumn::new(Theta, Theta, -1.0, 0.0), MendedColumn::new(Psi, Psi, -1.0, FRAC_PI_2)]);
    Mend::Columns(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An attitude that no symmetry maps onto itself.
    fn tilted() -> Vector3<f64> {
        Vector3::new(0.31, -0.17, 0.83)
    }

    #[test]
    fn every_hypothesis_gives_a_rotation() {
        let undone = ATTITUDES
            .iter()
            .map(|one| (one.looks_like, (one.undo)(tilted())))
            .chain(CONVENTIONS.iter().map(|one| (one.looks_like, (one.undo)(tilted()))));
        for (name, dcm) in undone {
            // A few roundings of numbers of one.
            assert!((dcm * dcm.transpose() - Matrix3::identity()).norm() < 1e-14, "{name}");
            assert!((dcm.determinant() - 1.0).abs() < 1e-14, "{name}: a mirror image");
        }
    }

    #[test]
    fn no_two_hypotheses_of_the_attitude_are_one() {
        let mut all: Vec<(&str, Matrix3<f64>)> = vec![("as logged", as_logged(tilted()))];
        all.extend(ATTITUDES.iter().map(|one| (one.looks_like, (one.undo)(tilted()))));
        for (k, (name, dcm)) in all.iter().enumerate() {
            for (other_name, other) in &all[..k] {
                assert!((dcm - other).norm() > 1e-3, "\"{name}\" and \"{other_name}\"");
            }
        }
    }

    /// What a program does that reads a quaternion x, y, z, w as w, x, y, z, done to a known one.
    #[test]
    fn a_quaternion_read_in_another_order_is_put_right() {
        let q = frames::quaternion_from_euler(tilted());
        let misread = nalgebra::Vector4::new(q[1], q[2], q[3], q[0]);
        let logged = frames::euler_from_quaternion(&misread);
        let name = "the attitude is from a quaternion x, y, z, w that was read as w, x, y, z";
        let hypothesis = ATTITUDES.iter().find(|one| one.looks_like == name).unwrap();
        assert!(((hypothesis.undo)(logged) - as_logged(tilted())).norm() < 1e-12);
    }
}
