//! What is recorded, and its JSON.

use proto::{Answer, Command, Ending, Gains, Identity, Pose, Request, Telemetry, TimedPose};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{nulls, scene};

/// What is known of the link, for the log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LinkRecord {
    /// Half of the mean round trip, s (thesis 5.5).
    pub one_way_s: f64,
    /// Half of the least round trip, s.
    pub least_one_way_s: f64,
    /// How fast the craft's clock runs: 0.01 is 1 % fast.
    pub skew: f64,
    /// Standard error of `skew`.
    pub skew_std_error: f64,
    /// Ticks of the craft in a second of the ground.
    pub tick_hz: f64,
    /// Share of the craft's packets lost in the last seconds.
    pub lost_down: f64,
    /// Share of the ground's packets lost in the last seconds.
    pub lost_up: f64,
    /// Frames of the tracker in a second.
    pub pose_hz: f64,
}

/// How serious a line for people is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Level {
    /// Good to know.
    Info,
    /// Something to look at.
    Warning,
    /// Something that has to be acted on.
    Error,
}

impl Level {
    /// Foxglove's number.
    fn number(self) -> u8 {
        match self {
            Self::Info => 2,
            Self::Warning => 3,
            Self::Error => 4,
        }
    }
}

/// Something to record.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the table in the head of the folder says what each is")]
pub enum Entry<'a> {
    Telemetry(&'a Telemetry),
    Pose(&'a TimedPose),
    Command(&'a Command),
    Request(Request),
    Gains(&'a Gains),
    Identity(&'a Identity),
    Answer(&'a Answer),
    Link(&'a LinkRecord),
    Log(Level, &'a str),
    Transform(&'a Pose),
    Track(&'a [Pose]),
    LastEnd(Ending),
}

/// Longest line for people that is recorded, characters: far below the longest record, whatever JSON makes of each.
const MOST_WORDS: usize = 20_000;

/// Topic and schema name of each entry, in the order of the channels.
pub(super) const TOPICS: [(&str, &str); 12] = [
    ("/telemetry", "quadlab.Telemetry"),
    ("/pose", "quadlab.TimedPose"),
    ("/command", "quadlab.Command"),
    ("/request", "quadlab.Request"),
    ("/gains", "quadlab.Gains"),
    ("/identity", "quadlab.Identity"),
    ("/answer", "quadlab.Answer"),
    ("/link", "quadlab.Link"),
    ("/log", "foxglove.Log"),
    ("/tf", "foxglove.FrameTransform"),
    ("/track", "foxglove.PosesInFrame"),
    ("/last_end", "quadlab.LastEnd"),
];

impl Entry<'_> {
    pub(super) fn channel(&self) -> usize {
        match self {
            Self::Telemetry(_) => 0,
            Self::Pose(_) => 1,
            Self::Command(_) => 2,
            Self::Request(_) => 3,
            Self::Gains(_) => 4,
            Self::Identity(_) => 5,
            Self::Answer(_) => 6,
            Self::Link(_) => 7,
            Self::Log(..) => 8,
            Self::Transform(_) => 9,
            Self::Track(_) => 10,
            Self::LastEnd(_) => 11,
        }
    }

    /// Its JSON, numbers with the fewest digits that give them back.
    pub(super) fn json(&self, log_ns: u64) -> String {
        use nulls::without_nulls as of;
        let timestamp = json!({ "sec": log_ns / 1_000_000_000, "nsec": log_ns % 1_000_000_000 });
        match self {
            Self::Telemetry(telemetry) => of(telemetry),
            Self::Pose(pose) => of(pose),
            Self::Command(command) => of(command),
            Self::Request(request) => of(&json!({ "request": request })),
            Self::Gains(gains) => of(gains),
            Self::Identity(identity) => of(identity),
            Self::Answer(answer) => of(answer),
            Self::Link(link) => of(link),
            Self::Log(level, message) => of(&json!({
                "timestamp": timestamp,
                "level": level.number(),
                "message": message.chars().take(MOST_WORDS).collect::<String>(),
                "name": "ground",
                "file": "",
                "line": 0,
            })),
            Self::Transform(pose) => of(&scene::transform(pose, &timestamp)),
            Self::Track(poses) => of(&scene::track(poses, &timestamp)),
            Self::LastEnd(ending) => of(&json!({ "last_end": ending })),
        }
    }
}
