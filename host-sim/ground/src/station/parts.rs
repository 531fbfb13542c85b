//! What a station keeps of the craft, the tracker, its packets, and what is due.

use proto::{Ending, Identity, Telemetry};

use super::snapshot::Tracker;
use super::stream_rate::StreamRate;
use crate::mission::Ask;

/// A request that is repeated until it is answered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pending {
    pub(super) ask: Ask,
    /// Numbers of the packets in which it was asked, oldest and newest.
    pub(super) numbers: [u64; 2],
    pub(super) next_us: u64,
}

/// When each kind of message is due, us of the ground's clock.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Schedule {
    pub(super) started_us: Option<u64>,
    pub(super) command_us: u64,
    pub(super) ramp_us: u64,
    pub(super) ramps_sent: u64,
    pub(super) who_us: u64,
    pub(super) link_us: u64,
}

/// What the craft has reported.
#[derive(Debug, Default)]
pub(super) struct CraftReports {
    /// The last telemetry, and when it came.
    pub(super) telemetry: Option<(Telemetry, u64)>,
    /// Conditions in the tick in which the craft went into its state.
    pub(super) found: u32,
    pub(super) identity: Option<Identity>,
    /// How it ended before it was started.
    pub(super) last_end: Option<Ending>,
    /// Its telemetry has stopped.
    pub(super) silent: bool,
}

/// Packets both ways.
#[derive(Debug, Default)]
pub(super) struct Traffic {
    /// Packets to send.
    pub(super) out: Vec<Vec<u8>>,
    pub(super) sent: u64,
    pub(super) down: StreamRate,
    pub(super) up: StreamRate,
}

/// What the tracker has reported.
#[derive(Debug, Default)]
pub(super) struct Tracking {
    pub(super) tracker: Tracker,
    pub(super) poses: StreamRate,
    /// It has lost sight of the craft.
    pub(super) blind: bool,
}
