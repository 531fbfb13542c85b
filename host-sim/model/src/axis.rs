//! The six rows of the equations of motion that hold unknown coefficients.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A row of (4.3): u, v, w are body-axis accelerations in m/s^2 (what an accelerometer at the centre of mass
/// would feel, that is without gravity), p, q, r are body angular accelerations in rad/s^2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Forward acceleration, m/s^2.
    U,
    /// Rightward acceleration, m/s^2.
    V,
    /// Downward acceleration, m/s^2.
    W,
    /// Roll acceleration, rad/s^2.
    P,
    /// Pitch acceleration, rad/s^2.
    Q,
    /// Yaw acceleration, rad/s^2.
    R,
}

/// All axes in order.
pub const AXES: [Axis; 6] = [Axis::U, Axis::V, Axis::W, Axis::P, Axis::Q, Axis::R];

impl Axis {
    /// Position in arrays of six.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// One letter, as in files and JSON.
    pub const fn name(self) -> &'static str {
        ["u", "v", "w", "p", "q", "r"][self as usize]
    }

    /// Unit of the acceleration.
    pub const fn unit(self) -> &'static str {
        if (self as usize) < 3 { "m/s^2" } else { "rad/s^2" }
    }

    /// Whether this is a force row (u, v, w).
    pub const fn is_force(self) -> bool {
        (self as usize) < 3
    }
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// One value for each axis; a table with the keys u v w p q r in files and JSON.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "the six axes are documented at `Axis`")]
pub struct PerAxis<T> {
    pub u: T,
    pub v: T,
    pub w: T,
    pub p: T,
    pub q: T,
    pub r: T,
}

impl<T> PerAxis<T> {
    /// Calls `f` for each axis in order.
    pub fn from_fn(mut f: impl FnMut(Axis) -> T) -> Self {
        Self { u: f(Axis::U), v: f(Axis::V), w: f(Axis::W), p: f(Axis::P), q: f(Axis::Q), r: f(Axis::R) }
    }
}

impl<T> std::ops::Index<Axis> for PerAxis<T> {
    type Output = T;
    fn index(&self, axis: Axis) -> &T {
        match axis {
            Axis::U => &self.u,
            Axis::V => &self.v,
            Axis::W => &self.w,
            Axis::P => &self.p,
            Axis::Q => &self.q,
            Axis::R => &self.r,
        }
    }
}

impl<T> std::ops::IndexMut<Axis> for PerAxis<T> {
    fn index_mut(&mut self, axis: Axis) -> &mut T {
        match axis {
            Axis::U => &mut self.u,
            Axis::V => &mut self.v,
            Axis::W => &mut self.w,
            Axis::P => &mut self.p,
            Axis::Q => &mut self.q,
            Axis::R => &mut self.r,
        }
    }
}
