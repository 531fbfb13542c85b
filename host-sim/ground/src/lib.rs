//! The ground station: what is asked of a craft goes up, what it does comes down and is kept
//! (thesis chapter 3).
//!
//! ```text
//! tracker --UDP--> mocap -----+                    +--> link --UDP--> craft
//! script, keyboard -> mission +--> Station --------+
//! craft --UDP--> link --------+        |           +--> recording --> MCAP, flight files --> quadlab identify
//!                                     view
//! ```
//!
//! - [`mocap`]: trackers behind one trait (Vicon, OptiTrack, the replay of a flight), and their
//!   axes turned into ours.
//! - [`mission`]: scripts, and what is commanded when.
//! - [`link`]: packets with a key, their delay, and the pace of the craft's clock.
//! - [`recording`]: everything that is sent and heard, safe against crashes, and flight files of
//!   it.
//! - [`station`]: all of that as one value without sockets and clocks.
//! - [`run`]: sockets, threads and time around it; [`view`]: the terminal.
//!
//! Deliberately absent: the flight law. The craft's supervisor decides what is safe; this side
//! asks, shows and records.
#![forbid(unsafe_code)]

pub mod link;
pub mod mission;
pub mod mocap;
pub mod recording;
pub mod run;
pub mod station;
pub mod view;
