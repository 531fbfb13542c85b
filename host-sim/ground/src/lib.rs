//! The ground station.
#![forbid(unsafe_code)]

pub mod flights;
pub mod frames;
pub mod link;
pub mod mission;
pub mod mocap;
pub mod optitrack;
pub mod ramps;
pub mod recorder;
pub mod replay;
pub mod run;
pub mod station;
pub mod vicon;
