//! The link to the craft: packets with a key, its delay, and the pace of the craft's
//! clock.

mod clock_monitor;
mod craft_link;

pub use clock_monitor::{ClockEvent, ClockMonitor, Pace, Timing, ramp_interval_s};
pub use craft_link::{CraftLink, CraftLinkError, LinkSettings, PORT};
