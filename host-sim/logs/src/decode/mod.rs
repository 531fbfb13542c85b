//! Files into tables, one module a format.

mod blackbox;
mod common;
mod crazyflie;
mod csv;
mod dataflash;
mod mcap;
#[cfg(feature = "all-formats")]
mod parquet;
mod ros_messages;
mod rosbag1;
#[cfg(feature = "all-formats")]
mod rosbag2;
mod telemetry;
mod ulog;

use std::path::Path;

use bytes::Bytes;

use crate::error::LogError;
use crate::format::Format;
use crate::log::Log;
use crate::progress::{Decoding, UNWATCHED, Watch};

pub use telemetry::{LEFT_OUT, telemetry_from_json};

pub(crate) use csv::decode as decode_text;

/// Decodes the bytes of a log; `path` is for messages.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Log, LogError> {
    match Format::of(bytes) {
        #[cfg(feature = "all-formats")]
        Some(Format::Parquet) => parquet::decode(Bytes::copy_from_slice(bytes), path),
        _ => decode_slice(bytes, path, UNWATCHED),
    }
}

/// Decodes the bytes of a log without another copy of them, and tells who watches how far it is.
pub(crate) fn decode_watched(bytes: &Bytes, path: &Path, watch: Watch<'_>) -> Result<Log, LogError> {
    match Format::of(bytes) {
        #[cfg(feature = "all-formats")]
        Some(Format::Parquet) => parquet::decode(bytes.clone(), path),
        _ => decode_slice(bytes, path, watch),
    }
}

fn decode_slice(bytes: &[u8], path: &Path, watch: Watch<'_>) -> Result<Log, LogError> {
    let mut progress = Decoding::new(watch, bytes.len());
    match Format::of(bytes) {
        Some(Format::Ulog) => ulog::decode(bytes, path, &mut progress),
        Some(Format::Dataflash) => dataflash::decode(bytes, path, &mut progress),
        Some(Format::Blackbox) => blackbox::decode(bytes, path, &mut progress),
        Some(Format::Crazyflie) => crazyflie::decode(bytes, path),
        Some(Format::Rosbag1) => rosbag1::decode(bytes, path, &mut progress),
        #[cfg(feature = "all-formats")]
        Some(Format::Rosbag2) => rosbag2::decode(bytes, path),
        #[cfg(not(feature = "all-formats"))]
        Some(Format::Rosbag2) => Err(LogError::Format {
            path: path.into(),
            what: "needs a program that was built with SQLite".into(),
            mend: "build crate `logs` with its feature `all-formats`".into(),
        }),
        Some(Format::Mcap) => mcap::decode(bytes, path, &mut progress),
        Some(Format::Csv | Format::Parquet) | None => Err(LogError::Format {
            path: path.into(),
            what: "is not in a log format that is supported".into(),
            mend: "see `quadlab import --help` for the formats".into(),
        }),
    }
}
