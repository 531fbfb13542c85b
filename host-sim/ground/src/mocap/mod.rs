//! Motion capture: trackers behind one trait, and their axes turned into ours.

pub mod frames;
pub mod optitrack;
mod receiver;
mod replay;
mod vicon;
pub mod vicon_stream;

pub use frames::{Axes, Frames};
pub use optitrack::OptiTrack;
pub use receiver::{MocapError, MocapReceiver, Sighting, TrackerEvent};
pub use replay::Replay;
pub use vicon::Vicon;
