//! The ground station.
#![forbid(unsafe_code)]

pub mod frames;
pub mod mocap;
pub mod optitrack;
pub mod ramps;
pub mod replay;
pub mod vicon;
