//! ROS messages.
use std::path::Path;

use crate::error::LogError;
use crate::log::Log;
use crate::recording::Recording;

pub(crate) fn record(log: &Log, path: &Path) -> Result<Recording, LogError> {
    let _ = log;
    Err(LogError::Refused { path: path.into(), reason: "not read yet".into() })
}
