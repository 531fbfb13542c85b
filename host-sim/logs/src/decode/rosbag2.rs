//! ROS 2 bags in sqlite.

use std::path::Path;

use crate::error::LogError;
use crate::log::Log;

pub(crate) fn decode(bytes: &[u8], path: &Path) -> Result<Log, LogError> {
    let _ = bytes;
    Err(LogError::Refused { path: path.into(), reason: "not read yet".into() })
}
