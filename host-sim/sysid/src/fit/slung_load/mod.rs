//! A load that hangs under the craft: its swing is followed over each flight.

mod pendulum;
mod shapes;

pub use pendulum::{
    BY_CHANCE_PERCENT, Beginning, Carried, Followed, Known, SWING_RAD, Unloaded, blocks, followed, of_model,
    without_load,
};
pub(crate) use shapes::LoadShapes;
