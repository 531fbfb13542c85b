//! The header of a log: lines of text that say how its frames are written.

use std::collections::BTreeMap;

/// A frame has no more fields.
pub(super) const MOST_FIELDS: usize = 128;
/// A line is no longer.
const LONGEST_LINE: usize = 8192;
/// Settings that are kept: what the craft is, and the scales of its fields.
const KEPT: [&str; 27] = [
    "Firmware type",
    "Firmware revision",
    "Firmware date",
    "Board information",
    "Log start datetime",
    "Craft name",
    "Pilot name",
    "I interval",
    "P interval",
    "P ratio",
    "minthrottle",
    "maxthrottle",
    "motorOutput",
    "motor_poles",
    "motor_pwm_protocol",
    "dshot_bidir",
    "gyro_scale",
    "gyro.scale",
    "acc_1G",
    "vbat_scale",
    "vbatscale",
    "vbatref",
    "looptime",
    "pid_process_denom",
    "debug_mode",
    "blackbox_high_resolution",
    "Data version",
];

/// How the fields of a kind of frame are written.
#[derive(Debug, Default, Clone)]
pub(super) struct Fields {
    pub(super) names: Vec<String>,
    pub(super) signed: Vec<i64>,
    pub(super) predictors: Vec<i64>,
    pub(super) encodings: Vec<i64>,
}

/// What a header says.
#[derive(Debug, Default)]
pub(super) struct Header {
    /// Kinds of frames by their letters.
    pub(super) fields: BTreeMap<u8, Fields>,
    /// Other lines, those of `KEPT`.
    pub(super) settings: BTreeMap<String, String>,
    /// Lines that cannot be read.
    pub(super) damaged_lines: usize,
}

/// Reads the lines at the start of a log; answers where its frames begin.
pub(super) fn read(bytes: &[u8]) -> (Header, usize) {
    let mut header = Header::default();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &bytes[at..];
        let end = memchr::memchr(b'\n', &rest[..rest.len().min(LONGEST_LINE)]);
        let line = end.map(|end| &rest[..end]).filter(|line| line.iter().all(|&byte| byte >= b' '));
        match line {
            Some(line) if line.starts_with(b"H ") => {
                if !header.line(&String::from_utf8_lossy(&line[2..])) {
                    header.damaged_lines += 1;
                }
                at += line.len() + 1;
            }
            // A line whose first bytes are damaged: another line follows it.
            Some(line) if rest[line.len() + 1..].starts_with(b"H ") => {
                header.damaged_lines += 1;
                at += line.len() + 1;
            }
            _ if b"IPGES".contains(&rest[0]) => break,
            // Garbage: on to the next line or frame.
            _ => {
                at +=
                    1 + rest[1..].iter().position(|byte| b"\nIPGES".contains(byte)).unwrap_or(rest.len() - 1)
            }
        }
    }
    (header, at)
}

impl Header {
    /// Takes in a line without its `H `; answers whether it is one.
    fn line(&mut self, line: &str) -> bool {
        let Some((key, value)) = line.split_once(':') else { return false };
        let Some(field) = key.strip_prefix("Field ") else {
            if KEPT.contains(&key) {
                self.settings.insert(key.into(), value.trim().chars().filter(|c| !c.is_control()).collect());
            }
            return true;
        };
        let (Some(&frame), Some(what)) = (field.as_bytes().first(), field.get(1..)) else { return false };
        if !b"IPGHS".contains(&frame) {
            return false;
        }
        let fields = self.fields.entry(frame).or_default();
        match what.trim() {
            "name" => fields.names = value.split(',').take(MOST_FIELDS + 1).map(str::to_owned).collect(),
            "signed" => fields.signed = numbers(value),
            "predictor" => fields.predictors = numbers(value),
            "encoding" => fields.encodings = numbers(value),
            _ => {}
        }
        true
    }

    /// A setting as whole numbers, separated by commas.
    pub(super) fn numbers(&self, key: &str) -> Vec<i64> {
        self.settings.get(key).map_or_else(Vec::new, |value| numbers(value))
    }

    /// A setting that is one whole number.
    pub(super) fn number(&self, key: &str) -> Option<i64> {
        self.numbers(key).first().copied()
    }
}

/// Whole numbers separated by commas; what is none is 0.
fn numbers(text: &str) -> Vec<i64> {
    text.split(',').take(MOST_FIELDS + 1).map(|number| number.trim().parse().unwrap_or(0)).collect()
}
