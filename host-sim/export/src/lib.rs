//! A model in the words of other people's simulators and design tools.
//!
//! A simulator takes the craft as a rigid body with four rotors ([`Craft`]); a design tool takes it linear about an equilibrium
//! (crate `design`). No tool has all that a model can have: what one leaves out is said, by effect, in the file itself and in
//! [`Export::left_out`].
#![forbid(unsafe_code)]

mod craft;
mod error;
mod gains_in_c;
mod gazebo;
mod left_out;
mod linear;
mod mujoco;
mod px4;
mod rotorpy;

use design::plant::TrimTarget;
use model::Model;

pub use craft::{Craft, Rotor};
pub use error::ExportError;
pub use gains_in_c::gains_header;
pub use left_out::{Export, LeftOut};

/// What a model is written for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// MuJoCo's MJCF.
    Mujoco,
    /// Gazebo's SDFormat, with its motor model on each rotor.
    Gazebo,
    /// Parameters of rotorpy's `Multirotor`, a Python file.
    Rotorpy,
    /// Parameters of PX4's simulation in hardware and of its control allocation, as QGroundControl loads them.
    Px4,
    /// python-control: state space, rotors and transfer functions, a Python file.
    PythonControl,
    /// The same for MATLAB and GNU Octave.
    Octave,
}

/// Writes a model for another tool; design tools get it linear about `target`.
///
/// # Errors
/// When the model does not have what the tool needs, or has no equilibrium there.
pub fn export(model: &Model, to: Target, target: &TrimTarget) -> Result<Export, ExportError> {
    match to {
        Target::Mujoco => mujoco::export(&Craft::new(model)?, model),
        Target::Gazebo => gazebo::export(&Craft::new(model)?, model),
        Target::Rotorpy => rotorpy::export(&Craft::new(model)?, model),
        Target::Px4 => px4::export(&Craft::new(model)?, model),
        Target::PythonControl => linear::python(model, target),
        Target::Octave => linear::octave(model, target),
    }
}
