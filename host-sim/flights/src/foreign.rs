//! Files of other programs, told by how they begin, for where a flight file and nothing else will do.

/// How other log files begin, what they are, and how flight files are made of them.
const FOREIGN: [(&[u8], &str, &str); 10] = [
    (b"ULog\x01\x12\x35", "a PX4 ULog", IMPORT),
    (b"\xbc", "a Crazyflie SD-card log", IMPORT),
    (b"\xa3\x95", "an ArduPilot DataFlash log", IMPORT),
    (b"H Product:Blackbox", "a Betaflight blackbox log", IMPORT),
    (b"#ROSBAG V2", "a ROS 1 bag", IMPORT),
    (b"SQLite format 3\0", "a ROS 2 bag", IMPORT),
    (b"\x89MCAP", "an MCAP file", IMPORT),
    (b"PAR1", "a Parquet file", IMPORT),
    (b"PK\x03\x04", "a zip archive or spreadsheet", "unpack it, or save the sheet as CSV with commas"),
    (b"\x1f\x8b", "a gzip archive", "unpack it with gunzip"),
];

/// What to do with a log of another program.
const IMPORT: &str = "make flight files of it with quadlab import";

/// What a file is that is no text, by how it begins.
pub(crate) fn foreign(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let known = FOREIGN.iter().find(|(magic, _, _)| bytes.starts_with(magic));
    // Text has no control characters in its first line but tabs and ends of lines.
    let first = &bytes[..bytes.len().min(512)];
    let binary = first.iter().any(|b| *b < b' ' && !b.is_ascii_whitespace());
    known.map(|(_, what, mend)| (*what, *mend)).or_else(|| {
        binary.then_some((
            "a binary file",
            "write its values as text with a header row such as t,x,y,z,phi,theta,psi,p,q,r,cmd1,...",
        ))
    })
}
