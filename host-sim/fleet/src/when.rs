//! When a flight was flown.
//!
//! The log's own clock of the day where it has one (UTC stamps of PX4, GPS time, bags written in Unix time), else a date in the
//! file's name or path (2026-03-04, 20260304, with a time of the day 15-30-00 or 153000 behind it), else when the file was last
//! changed. Dates in names are taken for UTC; they order flights and name moments, and nothing is computed from them.

use std::fmt;
use std::time::SystemTime;

use jiff::Timestamp;
use jiff::civil::{Date, DateTime, Time};
use jiff::tz::TimeZone;
use logs::Import;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where a date is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WhenFrom {
    /// The user's `fleet.toml`.
    Settings,
    /// The log.
    Log,
    /// The file's name or path.
    Name,
    /// When the file was last changed.
    File,
}

/// When a flight began.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct When {
    /// Unix time, s.
    pub unix_s: f64,
    /// Where that is from.
    pub from: WhenFrom,
}

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&day_and_time(self.unix_s))
    }
}

/// "2026-03-04 15:30", UTC.
pub fn day_and_time(unix_s: f64) -> String {
    let moment = Timestamp::from_second(unix_s as i64).map(|moment| TimeZone::UTC.to_datetime(moment));
    moment
        .map_or_else(|_| "unknown".into(), |at| format!("{} {:02}:{:02}", at.date(), at.hour(), at.minute()))
}

/// Seconds from 1970 to 2100: what is beyond is no date of a flight.
const DATES_S: std::ops::Range<f64> = 1e8..4.1e9;
/// GPS time is counted from 6 January 1980, and has been 18 s ahead of UTC since 2017.
const GPS_EPOCH_S: f64 = 315_964_800.0 - 18.0;

/// When a flight of a log began that is at `start_s` on the log's clock.
pub(crate) fn of_log(import: &Import, start_s: f64) -> Option<When> {
    let as_it_is = DATES_S.contains(&start_s).then_some(start_s);
    let by_pair = || {
        import.clocks.iter().find_map(|pair| {
            let epoch_s = match pair.reference.as_str() {
                "time_utc_usec" => 0.0,
                "GPS time" => GPS_EPOCH_S,
                _ => return None,
            };
            let is_log_clock = pair.clock == "timestamp" || pair.clock == "time of the log";
            let unix_s = start_s - 1e-3 * pair.offset_ms + epoch_s;
            (is_log_clock && DATES_S.contains(&unix_s)).then_some(unix_s)
        })
    };
    as_it_is.or_else(by_pair).map(|unix_s| When { unix_s, from: WhenFrom::Log })
}

/// A date in a path; a day of a folder and a time of the file's name go together.
pub(crate) fn of_name(file: &str) -> Option<When> {
    let bytes = file.as_bytes();
    let (date, end) = (0..bytes.len()).rev().find_map(|at| date_at(bytes, at))?;
    let time = bytes.get(end..).and_then(time_in).unwrap_or(Time::midnight());
    Some(When { unix_s: unix(DateTime::from_parts(date, time))?, from: WhenFrom::Name })
}

/// When a file was last changed.
pub(crate) fn of_file(changed: SystemTime) -> When {
    let since = changed.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    When { unix_s: since.as_secs_f64(), from: WhenFrom::File }
}

/// A date as a user writes it, with a time of the day or without.
pub fn of_text(text: &str) -> Option<f64> {
    let moment: DateTime = match text.parse::<DateTime>() {
        Ok(moment) => moment,
        Err(_) => DateTime::from_parts(text.parse::<Date>().ok()?, Time::midnight()),
    };
    unix(moment)
}

fn unix(moment: DateTime) -> Option<f64> {
    let moment = TimeZone::UTC.to_timestamp(moment).ok()?;
    Some(moment.as_second() as f64)
}

/// So many digits from a place on, which no other digit goes before.
fn number(bytes: &[u8], at: usize, digits: usize) -> Option<i16> {
    let own = bytes.get(at..at + digits)?;
    own.iter().all(u8::is_ascii_digit).then(|| own.iter().fold(0, |n, b| 10 * n + i16::from(b - b'0')))
}

/// The date that begins at a place, and where it ends.
fn date_at(bytes: &[u8], at: usize) -> Option<(Date, usize)> {
    if at > 0 && bytes[at - 1].is_ascii_digit() {
        return None;
    }
    let year = number(bytes, at, 4).filter(|year| (1990..2100).contains(year))?;
    let separated = bytes.get(at + 4).is_some_and(|b| matches!(b, b'-' | b'_' | b'.'));
    let (month, day, end) = match separated {
        true if bytes.get(at + 7) == bytes.get(at + 4) => (at + 5, at + 8, at + 10),
        true => return None,
        false => (at + 4, at + 6, at + 8),
    };
    let [month, day] = [month, day].map(|at| number(bytes, at, 2));
    let date = Date::new(year, month?.try_into().ok()?, day?.try_into().ok()?).ok()?;
    (!bytes.get(end).is_some_and(u8::is_ascii_digit)).then_some((date, end))
}

/// The time of the day right behind a date: "T15:30:00", "_15-30-00", "-153000", "/15_30".
fn time_in(rest: &[u8]) -> Option<Time> {
    let (first, rest) = rest.split_first()?;
    if !matches!(first, b'T' | b't' | b'_' | b'-' | b' ' | b'/') {
        return None;
    }
    let between = |at: usize| rest.get(at).is_some_and(|b| matches!(b, b':' | b'-' | b'_' | b'.' | b'h'));
    let step = if between(2) { 3 } else { 2 };
    let hour = number(rest, 0, 2)?;
    let minute = number(rest, step, 2)?;
    let has_second = step == 2 || between(5);
    let second = number(rest, 2 * step, 2).filter(|second| has_second && *second < 60).unwrap_or(0);
    Time::new(hour.try_into().ok()?, minute.try_into().ok()?, second.try_into().ok()?, 0).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_of_names() {
        for (file, expected) in [
            ("a/2026-03-04.csv", "2026-03-04 00:00"),
            ("a/20260304.csv", "2026-03-04 00:00"),
            ("a/log_2026-03-04-15-30-12.ulg", "2026-03-04 15:30"),
            ("a/2026-03-04/15_30_12.ulg", "2026-03-04 15:30"),
            ("a/20260304_153012_hover.bin", "2026-03-04 15:30"),
            ("a/2026-03-04T15:30.csv", "2026-03-04 15:30"),
            ("2024-01-01/b/2026-03-04.csv", "2026-03-04 00:00"),
        ] {
            assert_eq!(of_name(file).unwrap().to_string(), expected, "{file}");
        }
        for file in
            ["a/1.csv", "a/12345678901.csv", "a/2026-13-04.csv", "a/2026-03_04.csv", "flight-99.csv", ""]
        {
            assert_eq!(of_name(file), None, "{file}");
        }
    }

    /// 1 January 2026 is day 20454 of Unix time.
    #[test]
    fn dates_of_users_are_in_universal_time() {
        assert_eq!(of_text("2026-01-01"), Some(20454.0 * 86400.0));
        assert_eq!(of_text("2026-01-01T01:00"), Some(20454.0 * 86400.0 + 3600.0));
        assert_eq!(of_text("soon"), None);
    }

    #[test]
    fn a_file_tells_when_it_was_changed() {
        let when = of_file(SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(86400));
        assert_eq!((when.to_string().as_str(), when.from), ("1970-01-02 00:00", WhenFrom::File));
    }
}
