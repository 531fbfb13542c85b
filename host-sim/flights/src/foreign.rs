//! Files of other programs, told by how they begin.

/// How other log files begin, what they are, and how flight files are made of them.
const FOREIGN: [(&[u8], &str, &str); 7] = [
    (
        b"ULog\x01\x12\x35",
        "a PX4 ULog",
        "export its topics with ulog2csv and join vehicle_local_position, vehicle_attitude, vehicle_angular_velocity, \
         actuator_outputs and battery_status into the columns t, x, y, z, phi, ...",
    ),
    (
        b"\xbc",
        "a Crazyflie SD-card log",
        "decode it with the firmware's cfusdlog.py and write its variables into the columns t, x, y, z, phi, ... (north-east-down, radians)",
    ),
    (
        b"\xa3\x95",
        "an ArduPilot DataFlash log",
        "export it with mavlogdump.py --format csv and join its messages into the columns t, x, y, z, phi, ...",
    ),
    (
        b"H Product:Blackbox",
        "a Betaflight blackbox log",
        "decode it with blackbox_decode and write its fields into the columns t, x, y, z, phi, ...",
    ),
    (b"PK\x03\x04", "a zip archive or spreadsheet", "unpack it, or save the sheet as CSV with commas"),
    (b"\x1f\x8b", "a gzip archive", "unpack it with gunzip"),
    (b"PAR1", "a Parquet file", "write its columns as CSV"),
];

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
