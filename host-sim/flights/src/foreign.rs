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

/// What a TOML file is, by its first line that is no comment: an assignment or the head of a table, of which a header row has none.
fn toml(first: &[u8]) -> Option<&'static str> {
    let text = String::from_utf8_lossy(first);
    let line = text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'))?;
    let is_key =
        |key: &str| key.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'-' | b'.'));
    let is_table = line.strip_prefix('[').and_then(|head| head.strip_suffix(']')).is_some_and(is_key);
    match line.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
        Some(("format", "\"quadlab-model\"")) => Some("a quadlab model (TOML)"),
        Some((key, value)) if !key.is_empty() && is_key(key) && !value.is_empty() => Some("a TOML file"),
        _ => is_table.then_some("a TOML file"),
    }
}

/// What a file is that is no flight file, by how it begins.
pub(crate) fn foreign(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let known = FOREIGN.iter().find(|(magic, _, _)| bytes.starts_with(magic));
    let first = &bytes[..bytes.len().min(512)];
    if let Some(what) = toml(first) {
        return Some((what, "name a flight file or a log here"));
    }
    // Text has no control characters in its first line but tabs and ends of lines.
    let binary = first.iter().any(|b| *b < b' ' && !b.is_ascii_whitespace());
    known.map(|(_, what, mend)| (*what, *mend)).or_else(|| {
        binary.then_some((
            "a binary file",
            "write its values as text with a header row such as t,x,y,z,phi,theta,psi,p,q,r,cmd1,...",
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_toml_file_is_told_as_such_and_a_header_row_is_none() {
        let what = |text: &str| foreign(text.as_bytes()).map(|(what, _)| what);
        assert_eq!(what("format = \"quadlab-model\"\nversion = 3\n"), Some("a quadlab model (TOML)"));
        assert_eq!(what("# measured in May\nname = \"F330\"\n"), Some("a TOML file"));
        assert_eq!(what("\n[motors]\nspin = []\n"), Some("a TOML file"));
        for header in ["t,x,y,z", "# a comment\nt,x,y,z", "t;a=b;c", "[s],[m]", ""] {
            assert_eq!(what(header), None, "{header}");
        }
    }
}
