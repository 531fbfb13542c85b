//! The ground station: what is asked of a craft goes up, what it does comes down and is kept (thesis chapter 3).
//!
//! ```text
//! tracker --UDP--> mocap -----+                    +--> link --UDP--> craft
//! script, keyboard -> mission +--> Station --------+
//! craft --UDP--> link --------+     |   |          +--> recorder --> MCAP, flight files --> quadlab identify
//!                                 ramps view
//! ```
//!
//! - [`mocap`]: trackers behind one trait: [`vicon`], [`optitrack`], [`replay`]; [`frames`] turns their axes into ours.
//! - [`mission`]: what is commanded when; [`link`]: packets with key and counters; [`ramps`]: delay, and the craft's clock.
//! - [`recorder`]: everything that is said, safe against crashes; [`flights`]: flight files of it.
//! - [`station`]: all of that as one value without sockets and clocks; [`run`]: sockets, threads, time; [`view`]: the terminal.
//!
//! Deliberately absent: the flight law. The craft's supervisor decides what is safe; this side asks, shows and records.
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
pub mod view;
