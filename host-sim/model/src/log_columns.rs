//! How the columns of a log become ours, as its owner writes it: in the vehicle file, or in `columns.toml` beside flights.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// `[columns]`: for our columns by name, what they are in the log.
pub type LogColumns = BTreeMap<String, LogColumn>;

/// What a column is in the log: its name there, with `-` before it for the other sign, or its name with scale and offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum LogColumn {
    /// `"gyro_roll"`, `"-gyro_roll"`.
    Name(String),
    /// `{ column = "stamp", scale = 1e-6, offset = 0.0 }`: scale * theirs + offset.
    Scaled(ScaledColumn),
}

/// A column with its scale and offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScaledColumn {
    /// Its name in the log.
    pub column: String,
    /// What it is multiplied by.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
    /// What is added then.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// `[frames]`: the frames that a log is in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogFrames {
    /// Of positions, velocities and the attitude.
    pub world: WorldFrame,
    /// Of rates, specific force and the attitude.
    pub body: BodyFrame,
    /// Which way its quaternion turns.
    pub quaternion: QuaternionTurn,
}

impl LogFrames {
    /// Whether they are ours.
    pub fn are_ours(&self) -> bool {
        *self == Self::default()
    }
}

/// An inertial frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WorldFrame {
    /// North, east, down.
    #[default]
    Ned,
    /// East, north, up.
    Enu,
    /// North, west, up.
    Nwu,
}

/// A frame of the body.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BodyFrame {
    /// Front, right, down.
    #[default]
    Frd,
    /// Front, left, up.
    Flu,
}

/// What a quaternion turns into what.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum QuaternionTurn {
    /// Body into inertial components.
    #[default]
    BodyToWorld,
    /// Inertial into body components.
    WorldToBody,
}
