//! Tables into quantities: which table is the position, which the commands, in which frame and unit. One
//! module a program that logs.

mod ardupilot;
mod blackbox;
mod common;
mod crazyflie;
mod px4;
mod quadlab;
mod ros;

use std::path::Path;

use crate::error::LogError;
use crate::format::Format;
use crate::log::Log;
use crate::recording::Recording;

pub(crate) use quadlab::own_flights;
pub use quadlab::{FlightCutter, OwnFlight};

/// Finds the quantities of a log and puts them into quadlab's frames and units; `path` is for messages.
/// More than one recording where a file holds several logs (blackbox): one for each that holds anything.
pub fn record(log: &Log, path: &Path) -> Result<Vec<Recording>, LogError> {
    let one = |recording: Result<Recording, LogError>| recording.map(|recording| vec![recording]);
    match log.format {
        Format::Ulog => px4::record(log, path),
        Format::Dataflash => one(ardupilot::record(log, path)),
        Format::Blackbox => blackbox::record(log, path),
        Format::Csv if blackbox::is_decoded(log) => blackbox::record(log, path),
        Format::Crazyflie | Format::Parquet | Format::Csv => one(crazyflie::record(log, path)),
        // PX4's own messages over ROS 2 are the topics of its logs.
        Format::Rosbag1 | Format::Rosbag2 | Format::Mcap => match ros::as_px4_log(log) {
            Some(log) => px4::record(&log, path),
            None => one(ros::record(log, path)),
        },
    }
}
