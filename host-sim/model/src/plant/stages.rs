//! What a stage of an integration is, and how stages make a step: the same for one craft and for many side by side.

use nalgebra::{Matrix3, Vector3};

use crate::frames;
use crate::pendulum::Pendulum;
use crate::plant::state::{Derivative, Stage};
use crate::sample::{SampleInput, Surroundings};

/// Where in a step a stage is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// At its start.
    Start,
    /// In its middle.
    Middle,
    /// At its end.
    End,
}

/// What effects can look at in a stage.
#[inline(always)]
pub(super) fn input(
    state: &Stage,
    rotor_rad_s: &[f64; 4],
    rotor_acceleration_rad_s2: [f64; 4],
    around: &Surroundings,
) -> SampleInput {
    SampleInput {
        position_ned_m: state.position_ned_m,
        dcm: frames::dcm_from_quaternion(&state.attitude),
        velocity_m_s: state.velocity_m_s,
        rate_rad_s: state.rate_rad_s,
        angular_acceleration_rad_s2: Vector3::zeros(),
        rotor_rad_s: *rotor_rad_s,
        rotor_acceleration_rad_s2,
        battery_v: around.battery_v,
        pendulum: state.pendulum,
        memory: None,
        further: around.further,
    }
}

/// Acceleration of rotors with a lag, rad/s, on their way to what is commanded.
#[inline(always)]
pub(super) fn lagged_acceleration_rad_s2(lag_rad_s: f64, rotor: &[f64; 4], commanded: &[f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| lag_rad_s * (commanded[i] - rotor[i]))
}

/// What moves a craft over a step.
pub(super) trait Moves {
    /// The derivative in a stage. Where stages need no branch, it is always inlined.
    fn derivative(&self, stage: &Stage, part: Part) -> Derivative;
}

/// The state after a step of Runge and Kutta's classical fourth order, with an attitude of length 1.
#[inline(always)]
pub(super) fn runge_kutta_4(start: &Stage, h: f64, moves: &impl Moves) -> Stage {
    let k1 = moves.derivative(start, Part::Start);
    let k2 = moves.derivative(&start.moved(&k1, 0.5 * h), Part::Middle);
    let k3 = moves.derivative(&start.moved(&k2, 0.5 * h), Part::Middle);
    let k4 = moves.derivative(&start.moved(&k3, h), Part::End);
    let sixth = h / 6.0;
    let attitude = start.attitude + sixth * (k1.attitude + 2.0 * (k2.attitude + k3.attitude) + k4.attitude);
    let pendulum = start.pendulum.moved(&k1.pendulum, sixth).moved(&k2.pendulum, 2.0 * sixth);
    Stage {
        position_ned_m: start.position_ned_m
            + sixth * (k1.position + 2.0 * (k2.position + k3.position) + k4.position),
        attitude: attitude * (1.0 / attitude.norm()),
        velocity_m_s: start.velocity_m_s
            + sixth * (k1.velocity + 2.0 * (k2.velocity + k3.velocity) + k4.velocity),
        rate_rad_s: start.rate_rad_s + sixth * (k1.rate + 2.0 * (k2.rate + k3.rate) + k4.rate),
        pendulum: pendulum.moved(&k3.pendulum, 2.0 * sixth).moved(&k4.pendulum, sixth),
    }
}

/// (2.1) with the resolutions of reference section 5: velocity to inertial by the transpose of (2.2), gravity to
/// body by (2.2). Of accelerations as the rows of (4.3) give them; nothing hangs under the craft.
#[inline(always)]
pub(super) fn derivative(state: &Stage, dcm: &Matrix3<f64>, a: &[f64; 6], gravity_m_s2: f64) -> Derivative {
    let gravity = dcm.column(2) * gravity_m_s2;
    let force = Vector3::new(a[0], a[1], a[2]);
    Derivative {
        position: dcm.tr_mul(&state.velocity_m_s),
        attitude: frames::quaternion_derivative(&state.attitude, &state.rate_rad_s),
        velocity: force + gravity - state.rate_rad_s.cross(&state.velocity_m_s),
        rate: Vector3::new(a[3], a[4], a[5]),
        pendulum: Pendulum { direction: Vector3::zeros(), turning_rad_s: Vector3::zeros() },
    }
}
