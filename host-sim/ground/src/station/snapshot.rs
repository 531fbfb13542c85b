//! Everything about now, for a view.

use proto::{Identity, Pose, Statistics, Telemetry};

use super::notices::Notice;
use crate::link::Pace;
use crate::recording::LinkRecord;

/// What has come from the tracker.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tracker {
    /// The last pose, and when it came.
    pub last: Option<(Pose, u64)>,
    /// Frames with the craft in them.
    pub seen: u64,
    /// Frames in which the cameras had lost it.
    pub not_seen: u64,
    /// Datagrams that could not be used.
    pub refused: u64,
    /// Age of the last frame when it came, s, as far as the tracker says.
    pub age_s: f64,
}

/// Everything about now, for a view.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// The ground's clock, us.
    pub now_us: u64,
    /// The last telemetry, and when it came.
    pub telemetry: Option<(Telemetry, u64)>,
    /// Who the craft is.
    pub identity: Option<Identity>,
    /// Delay, pace and losses.
    pub link: Option<LinkRecord>,
    /// What is made of the pace.
    pub pace: Pace,
    /// The tracker.
    pub tracker: Tracker,
    /// What has come from the craft.
    pub statistics: Statistics,
    /// What is being done.
    pub doing: String,
    /// The last lines, oldest first.
    pub notices: Vec<Notice>,
    /// The file that is being recorded.
    pub recording: Option<String>,
}
