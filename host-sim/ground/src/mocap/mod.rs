//! Motion capture: where a tracker sees the craft, whatever the tracker.
//!
//! A [`MocapReceiver`] waits for frames and gives poses in our frames. Three are here: [`Vicon`]
//! (UDP object stream, see [`vicon_stream`]), [`OptiTrack`] (NatNet) and [`Replay`] (a flight
//! file). [`frames`] turns their axes into ours. A simulated laboratory speaks Vicon's format.
//!
//! Nothing that comes in over the network ends a receiver: what cannot be used is refused by name
//! and counted. Trackers do not show who they are, so a frame has to go on where the last one was
//! (`gate`); let the tracker have a network of its own all the same.

pub mod frames;
mod gate;
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
