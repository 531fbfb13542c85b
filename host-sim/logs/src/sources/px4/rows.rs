//! Rows in rising order of the time that their values are of.

use crate::log::{Table, Values};
use crate::recording::Signal;

use super::topics::topic_of;

/// Times of a publication and of what it is made of differ by milliseconds; more is damage.
const LATEST_US: u64 = 10_000_000;

/// A few rows this far from all others have a damaged time.
const APART_US: i64 = 60_000_000;
const FEW: usize = 10;

/// Rows of a table in strictly rising order of time.
pub(super) struct Rows {
    /// Times on the log's clock, us.
    pub(super) us: Vec<i64>,
    /// Where each row is in the table.
    order: Vec<usize>,
}

impl Rows {
    /// Puts the rows of a table in order, and notes what had to be left out.
    pub(super) fn of(table: &Table, notes: &mut Vec<String>) -> Self {
        let times = sample_times_us(table);
        let mut order: Vec<usize> = (0..times.len()).collect();
        let back = times.windows(2).filter(|pair| pair[1] < pair[0]).count();
        if back > 0 {
            order.sort_by_key(|&row| times[row]);
        }
        order.dedup_by_key(|row| times[*row]);
        let repeated = times.len() - order.len();
        let parts = || order.chunk_by(|&a, &b| times[b].saturating_sub(times[a]) <= APART_US);
        let least = if parts().any(|part| part.len() >= FEW) { FEW } else { 0 };
        let kept: Vec<usize> = parts().filter(|part| part.len() >= least).flatten().copied().collect();
        let apart = order.len() - kept.len();
        let mut note = |count: usize, what: &str| {
            if count > 0 {
                notes.push(format!("{}: {count} {what}", table.name));
            }
        };
        note(back, "times that go back: rows were put in order");
        note(repeated, "rows with a time that was there before are left out");
        note(apart, "rows more than a minute from all others are left out");
        Self { us: kept.iter().map(|&row| times[row]).collect(), order: kept }
    }

    /// The rows of a table that is written when something happens: they may be few and far apart.
    pub(super) fn of_events(table: &Table) -> Self {
        let mut order: Vec<usize> = (0..table.times.len()).collect();
        order.sort_by_key(|&row| table.times[row]);
        Self { us: order.iter().map(|&row| table.times[row]).collect(), order }
    }

    /// Times on the log's clock, s.
    pub(super) fn times_s(&self) -> Vec<f64> {
        self.us.iter().map(|&us| us as f64 * 1e-6).collect()
    }

    /// A column's values in this order.
    pub(super) fn pick(&self, values: &Values) -> Vec<f64> {
        let values = values.to_f64();
        self.order.iter().map(|&row| values[row]).collect()
    }

    /// Columns of the table these rows are of, if all are there.
    pub(super) fn columns<const N: usize>(&self, table: &Table, names: [&str; N]) -> Option<[Vec<f64>; N]> {
        let mut found = [const { Vec::new() }; N];
        for (slot, name) in found.iter_mut().zip(names) {
            *slot = self.pick(table.column(name)?);
        }
        Some(found)
    }
}

/// A quantity whose components are columns of a table.
pub(super) fn signal<const N: usize>(
    table: &Table,
    names: [&str; N],
    notes: &mut Vec<String>,
) -> Option<Signal<N>> {
    if names.iter().any(|name| table.column(name).is_none()) {
        return None;
    }
    let rows = Rows::of(table, notes);
    let values = rows.columns(table, names)?;
    (!rows.us.is_empty()).then(|| Signal { source: topic_of(table).into(), t: rows.times_s(), values })
}

/// The time that each row's values are of: `timestamp_sample` where it is set, else `timestamp`.
fn sample_times_us(table: &Table) -> Vec<i64> {
    let Some(Values::U64(samples)) = table.column("timestamp_sample") else { return table.times.clone() };
    let times = table.times.iter().zip(samples);
    times
        .map(|(&time, &sample)| match i64::try_from(sample) {
            Ok(sample) if sample > 0 && time.abs_diff(sample) < LATEST_US => sample,
            _ => time,
        })
        .collect()
}
