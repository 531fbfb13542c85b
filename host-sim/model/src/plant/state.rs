//! The state of a craft.

use nalgebra::{Vector3, Vector4};

use crate::frames;
use crate::memory::Memory;
use crate::pendulum::Pendulum;

/// State of the craft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Centre of mass, inertial NED, m.
    pub position_ned_m: Vector3<f64>,
    /// Unit quaternion (w, x, y, z), body to inertial.
    pub attitude: Vector4<f64>,
    /// Velocity over ground, body components, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Body rates p, q, r, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Rotor speeds, rad/s.
    pub rotor_rad_s: [f64; 4],
    /// Where a slung load hangs; still where there is none.
    pub pendulum: Pendulum,
    /// What formulas of the model look back at; nothing until the first step, which takes it for what has always been.
    pub memory: Memory,
}

impl State {
    /// At rest, level, heading north.
    pub fn at_rest(position_ned_m: Vector3<f64>, rotor_rad_s: [f64; 4]) -> Self {
        Self {
            position_ned_m,
            attitude: Vector4::new(1.0, 0.0, 0.0, 0.0),
            velocity_m_s: Vector3::zeros(),
            rate_rad_s: Vector3::zeros(),
            rotor_rad_s,
            pendulum: Pendulum::default(),
            memory: Memory::default(),
        }
    }

    /// Phi, theta, psi, rad.
    pub fn euler_rad(&self) -> Vector3<f64> {
        frames::euler_from_quaternion(&self.attitude)
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        let all =
            self.position_ned_m.sum() + self.attitude.sum() + self.velocity_m_s.sum() + self.rate_rad_s.sum();
        let pendulum = self.pendulum.direction.sum() + self.pendulum.turning_rad_s.sum();
        (all + self.rotor_rad_s.iter().sum::<f64>() + pendulum).is_finite() && self.memory.is_finite()
    }
}

/// What a state changes by in a second, rotors aside.
#[derive(Clone, Copy)]
pub(super) struct Derivative {
    pub(super) position: Vector3<f64>,
    pub(super) attitude: Vector4<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) rate: Vector3<f64>,
    pub(super) pendulum: Pendulum,
}

/// What a stage of an integration moves: a state but for its rotors and what it remembers.
#[derive(Clone, Copy)]
pub(super) struct Stage {
    pub(super) position_ned_m: Vector3<f64>,
    pub(super) attitude: Vector4<f64>,
    pub(super) velocity_m_s: Vector3<f64>,
    pub(super) rate_rad_s: Vector3<f64>,
    pub(super) pendulum: Pendulum,
}

impl Stage {
    #[inline(always)]
    pub(super) fn of(state: &State) -> Self {
        Self {
            position_ned_m: state.position_ned_m,
            attitude: state.attitude,
            velocity_m_s: state.velocity_m_s,
            rate_rad_s: state.rate_rad_s,
            pendulum: state.pendulum,
        }
    }

    /// Makes it the state of a craft, whose rotors and memory stay, and whose load does unless it has one.
    #[inline(always)]
    pub(super) fn put_into<const WITH_LOAD: bool>(&self, state: &mut State) {
        state.position_ned_m = self.position_ned_m;
        state.attitude = self.attitude;
        state.velocity_m_s = self.velocity_m_s;
        state.rate_rad_s = self.rate_rad_s;
        if WITH_LOAD {
            state.pendulum = self.pendulum.normalized();
        }
    }

    /// After `time_s` at a rate.
    #[inline(always)]
    pub(super) fn moved(&self, rate: &Derivative, time_s: f64) -> Self {
        Self {
            position_ned_m: self.position_ned_m + time_s * rate.position,
            attitude: self.attitude + time_s * rate.attitude,
            velocity_m_s: self.velocity_m_s + time_s * rate.velocity,
            rate_rad_s: self.rate_rad_s + time_s * rate.rate,
            pendulum: self.pendulum.moved(&rate.pendulum, time_s),
        }
    }
}
