//! Tables with times in seconds: those of the SD card have times, those of Parquet and CSV a column of
//! times.

use super::super::common::series::Rising;
use super::clock::{self, Clock};
use crate::log::{Log, Table};

/// Names of columns of times, the most certain first, with their unit in seconds.
const TIME_COLUMNS: [(&str, f64); 12] = [
    ("timestamp_us", 1e-6),
    ("timestamp_ns", 1e-9),
    ("timestamp_ms", 1e-3),
    ("timestamp_s", 1.0),
    ("time_us", 1e-6),
    ("time_ns", 1e-9),
    ("time_ms", 1e-3),
    ("time_s", 1.0),
    // Of cflib and cfusdlog.
    ("timestamp", 1e-3),
    ("tick", 1e-6),
    ("time", 1.0),
    ("t", 1.0),
];

/// Whether a column of this name is one of times.
pub(super) fn is_time(name: &str) -> bool {
    TIME_COLUMNS.iter().any(|(own, _)| *own == name)
}

/// The tables of a log and their times.
pub(super) struct Tables<'a> {
    all: Vec<(&'a Table, Rising)>,
    /// What was found about the clock.
    pub(super) slow_clock: Clock,
}

impl<'a> Tables<'a> {
    /// Mends the clock and leaves out what has no rising times; says both in `notes`.
    pub(super) fn of(log: &'a Log, notes: &mut Vec<String>) -> Self {
        let mut all: Vec<(&Table, Vec<f64>)> =
            log.tables.iter().filter_map(|table| Some((table, times_s(log, table)?))).collect();
        // The regular rows say how fast the clock is; events come when they come.
        let regular = all
            .iter()
            .find(|(table, _)| table.name == "fixedFrequency")
            .or_else(|| all.iter().max_by_key(|(table, _)| table.rows));
        let slow_clock = regular.map_or(Clock::Unknown, |(_, times)| Clock::of(times));
        if let Clock::Slow { period_ms, nominal_ms } = slow_clock {
            all.iter_mut().for_each(|(_, times)| times.iter_mut().for_each(|time| *time *= clock::MENDED));
            notes.push(format!(
                "the clock of the log ran 85/84 slow (rows every {period_ms:.3} ms instead of {nominal_ms} ms, \
                 as in firmware before bitcraze/crazyflie-firmware#1684): times are multiplied by 85/84"
            ));
        }
        let all = all.into_iter().map(|(table, times)| (table, Rising::of(&times))).collect::<Vec<_>>();
        for (table, rising) in &all {
            if rising.left_out > 0 {
                notes.push(format!(
                    "{}: {} rows whose times go back or repeat are left out",
                    table.name, rising.left_out
                ));
            }
        }
        Self { all, slow_clock }
    }

    /// The first table that has all variables, not all zero, and their values in all its rows.
    pub(super) fn group<const N: usize>(&self, names: [&str; N]) -> Option<(&Rising, [Vec<f64>; N])> {
        self.all.iter().find_map(|(table, rising)| {
            let values = table.group(names)?;
            let is_logged = values.iter().flatten().any(|value| *value != 0.0 && value.is_finite());
            (is_logged && rising.t.len() > 1).then_some((rising, values))
        })
    }

    /// Version of the log's format, as the decoder has it in the information; none for Parquet and CSV.
    pub(super) fn is_old(&self) -> bool {
        self.all.iter().any(|(table, _)| table.name == "(only)")
    }
}

/// Times of a table.
fn times_s(log: &Log, table: &Table) -> Option<Vec<f64>> {
    if !table.times.is_empty() {
        return Some(table.times_s());
    }
    TIME_COLUMNS.iter().find_map(|(name, unit)| {
        let column = table.columns.iter().find(|column| column.name.eq_ignore_ascii_case(name))?;
        let told = log.information.get(&format!("unit of {}", column.name)).map(String::as_str);
        let unit = match told {
            Some("ns") => 1e-9,
            Some("us") => 1e-6,
            Some("ms") => 1e-3,
            _ => *unit,
        };
        Some(column.values.to_f64().into_iter().map(|ticks| ticks * unit).collect())
    })
}
