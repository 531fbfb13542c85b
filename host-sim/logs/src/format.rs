//! The formats of logs, and how a file tells which it is.

/// The formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// PX4 ULog.
    Ulog,
    /// ArduPilot DataFlash, binary or text.
    Dataflash,
    /// Betaflight or INAV blackbox.
    Blackbox,
    /// Crazyflie's SD card (cfusdlog), version 0 (before the magic), 1 and 2.
    Crazyflie,
    /// ROS 1 bag.
    Rosbag1,
    /// ROS 2 bag, sqlite.
    Rosbag2,
    /// ROS 2 messages or quadlab's own recording in MCAP.
    Mcap,
    /// Parquet.
    Parquet,
    /// Separated text: a program's that is known by its names, or a table with a column a quantity.
    Csv,
}

impl Format {
    /// The name as people write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ulog => "ULog",
            Self::Dataflash => "DataFlash",
            Self::Blackbox => "Blackbox",
            Self::Crazyflie => "Crazyflie",
            Self::Rosbag1 => "ROS 1 bag",
            Self::Rosbag2 => "ROS 2 bag",
            Self::Mcap => "MCAP",
            Self::Parquet => "Parquet",
            Self::Csv => "CSV",
        }
    }

    /// The format of a file by its first kilobytes; none for what is not known and for text without names of a program.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        const MAGIC: [(&[u8], Format); 8] = [
            (b"ULog\x01\x12\x35", Format::Ulog),
            (b"\xa3\x95", Format::Dataflash),
            (b"FMT, ", Format::Dataflash),
            (b"\xbc", Format::Crazyflie),
            (b"#ROSBAG V2", Format::Rosbag1),
            (b"SQLite format 3\0", Format::Rosbag2),
            (b"\x89MCAP0\r\n", Format::Mcap),
            (b"PAR1", Format::Parquet),
        ];
        // Firmware writes blank bytes before the first header of a blackbox log.
        let head = &bytes[..bytes.len().min(4096)];
        MAGIC
            .iter()
            .find(|(magic, _)| bytes.starts_with(magic))
            .map(|(_, format)| *format)
            .or_else(|| memchr::memmem::find(head, b"H Product:Blackbox").map(|_| Self::Blackbox))
            .or_else(|| crazyflie_before_magic(head).then_some(Self::Crazyflie))
            .or_else(|| text_of(head).map(|_| Self::Csv))
    }
}

/// A program that is known by the names in a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TextOf {
    /// Bitcraze's clients, with the names of the firmware's variables.
    Crazyflie,
    /// `blackbox_decode`.
    Blackbox,
}

/// Beginnings of the names of the Crazyflie's variables that say how it moves.
const CRAZYFLIE: [&str; 8] =
    ["stateEstimate.", "stateEstimateZ.", "stabilizer.", "kalman.", "locSrv.", "gyro.", "acc.", "ctrlLee."];

/// The program whose names stand in the header of a text.
pub(crate) fn text_of(bytes: &[u8]) -> Option<TextOf> {
    let names = flights::header_names(bytes);
    // A flight file may have further columns of any names.
    if names.iter().any(|name| name == "t") {
        return None;
    }
    if names.iter().any(|name| CRAZYFLIE.iter().any(|group| name.starts_with(group))) {
        return (names.len() > 1).then_some(TextOf::Crazyflie);
    }
    names.iter().any(|name| name == "loopIteration").then_some(TextOf::Blackbox)
}

/// Whether bytes are of a Crazyflie log from before its magic number: the number of variables, then
/// that many `group.name(t),` as far as the bytes go.
pub(crate) fn crazyflie_before_magic(bytes: &[u8]) -> bool {
    const LONGEST: usize = 64;
    let Some((&count, mut rest)) = bytes.split_first() else { return false };
    for variable in 0..count {
        let Some(end) = memchr::memchr(b',', &rest[..rest.len().min(LONGEST)]) else {
            // Only the last variable that is there may be cut off.
            return variable > 0 && rest.len() < LONGEST;
        };
        let [name @ .., b'(', letter, b')'] = &rest[..end] else { return false };
        let plain = |c: &u8| c.is_ascii_alphanumeric() || matches!(c, b'_' | b'.');
        if name.is_empty() || !name.iter().all(plain) || !letter.is_ascii_alphabetic() {
            return false;
        }
        rest = &rest[end + 1..];
    }
    count > 0
}
