//! The simulated craft: plant, battery and sensors, and what can go wrong with each of them.

mod delay;
mod fault;
mod gusts;
mod noise;
mod sensors;
mod simulated_craft;
mod team;

pub(crate) use delay::Delay;
pub(crate) use fault::Faults;
pub use fault::{Fault, FaultKind};
pub use gusts::GustModel;
pub use noise::{Coloured, NoiseModel};
pub use sensors::Sensors;
pub use simulated_craft::SimulatedCraft;
pub(crate) use team::Team;
