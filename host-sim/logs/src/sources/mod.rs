//! Tables into quantities: which table is the position, which the commands, in which frame and unit. One module a program that logs.

mod ardupilot;
mod blackbox;
mod crazyflie;
mod px4;
mod ros;
mod series;

use std::path::Path;

use crate::error::LogError;
use crate::format::Format;
use crate::log::Log;
use crate::recording::Recording;

/// Finds the quantities of a log and puts them into quadlab's frames and units; `path` is for messages.
pub fn record(log: &Log, path: &Path) -> Result<Recording, LogError> {
    match log.format {
        Format::Ulog => px4::record(log, path),
        Format::Dataflash => ardupilot::record(log, path),
        Format::Blackbox => blackbox::record(log, path),
        Format::Crazyflie | Format::Parquet | Format::Csv => crazyflie::record(log, path),
        Format::Rosbag1 | Format::Rosbag2 | Format::Mcap => ros::record(log, path),
    }
}

/// Names out of a log as part of a sentence, without control characters and not too long.
fn plain_list(names: &[&str]) -> String {
    let plain =
        |name: &&str| name.chars().map(|c| if c.is_control() { '?' } else { c }).take(40).collect::<String>();
    let text = names.iter().map(plain).collect::<Vec<_>>().join(", ");
    if text.chars().count() > 250 { text.chars().take(250).chain("...".chars()).collect() } else { text }
}
