//! Logs that no flight of a quadcopter can be made of, refused by name.

use std::collections::BTreeSet;

use crate::log::Log;

use super::spans;
use super::topics::{topic, topic_of};

/// Why a log is refused, if it is.
pub(super) fn check(log: &Log) -> Result<(), String> {
    if let Some(craft) = other_craft(log) {
        return Err(format!("comes from {craft}; quadlab reads only quadcopters"));
    }
    if topic(log, "vehicle_attitude").is_none() {
        return Err(no_attitude(log));
    }
    match spans::armed(log) {
        Some(armed) if armed.is_empty() => Err("was never armed: there is no flight in it".into()),
        _ => Ok(()),
    }
}

/// What to say of a log without an attitude.
pub(super) fn no_attitude(log: &Log) -> String {
    const SHOWN: usize = 6;
    let topics: BTreeSet<&str> = log.tables.iter().map(topic_of).collect();
    if topics.is_empty() {
        return "has no rows of any topic: log a flight, or copy the file from the craft again".into();
    }
    let further = topics.len().saturating_sub(SHOWN);
    let mut named: Vec<String> =
        topics.iter().take(SHOWN).map(|name| name.chars().take(30).collect()).collect();
    if further > 0 {
        named.push(format!("{further} more"));
    }
    format!("has no attitude (topic vehicle_attitude), only {}: log PX4's default topics", named.join(", "))
}

/// The kind of craft by MAV_TYPE, if it is no quadcopter.
fn other_craft(log: &Log) -> Option<String> {
    let of_status = || Some(*topic(log, "vehicle_status")?.column("system_type")?.to_f64().last()?);
    let kind = log.parameters.get("MAV_TYPE").copied().or_else(of_status)?;
    let name = match kind as i64 {
        // A craft that does not say what it is may be a quadcopter.
        0 | 2 => return None,
        1 => "a fixed-wing aircraft",
        3 => "a coaxial helicopter",
        4 => "a helicopter",
        7 => "an airship",
        8 => "a balloon",
        10 => "a ground rover",
        11 => "a boat",
        12 => "a submarine",
        13 => "a hexacopter (six rotors)",
        14 => "an octocopter (eight rotors)",
        15 => "a tricopter (three rotors)",
        16 => "a flapping wing",
        19..=25 => "a VTOL aircraft",
        29 => "a dodecacopter (twelve rotors)",
        35 => "a decacopter (ten rotors)",
        _ => "another kind of craft",
    };
    Some(format!("{name} (MAV_TYPE {kind})"))
}
