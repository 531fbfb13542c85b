//! Rows whose times can be right.

use crate::log::{Table, Values};
use crate::recording::Signal;

/// Longer jumps of the clock are a mistake of it, unless the log goes on from there, s.
const LONGEST_JUMP_S: f64 = 60.0;
/// So many rows are no mistake.
const ENOUGH_ROWS: usize = 3;
/// How a table counts sensors, batteries and cores.
const INSTANCE: [&str; 4] = ["I", "Inst", "Instance", "C"];

/// Rows of a table in the order of their times, which rise strictly.
#[derive(Debug)]
pub(super) struct Rows<'log> {
    table: &'log Table,
    kept: Vec<usize>,
    /// Their times, s.
    pub(super) t: Vec<f64>,
    left_out: usize,
}

impl<'log> Rows<'log> {
    /// Rows of the first sensor, battery or core where a table holds several.
    pub(super) fn first_instance(table: &'log Table) -> Self {
        let instances = INSTANCE.iter().find_map(|name| table.column(name)).map(Values::to_f64);
        let first = instances.as_ref().and_then(|all| all.iter().copied().min_by(f64::total_cmp));
        match (instances, first) {
            (Some(instances), Some(first)) => Self::of(table, |row| instances.get(row) == Some(&first)),
            _ => Self::of(table, |_| true),
        }
    }

    /// Rows of one instance.
    pub(super) fn instance(table: &'log Table, instance: f64) -> Self {
        let instances =
            INSTANCE.iter().find_map(|name| table.column(name)).map(Values::to_f64).unwrap_or_default();
        Self::of(table, |row| instances.get(row) == Some(&instance))
    }

    /// Chosen rows.
    pub(super) fn of(table: &'log Table, chosen: impl Fn(usize) -> bool) -> Self {
        let times = table.times_s();
        let rows: Vec<usize> = (0..times.len()).filter(|&row| chosen(row)).collect();
        let (mut kept, mut t) = (Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
        for run in runs_that_follow(&rows, &times) {
            for row in run {
                if t.last().is_none_or(|&last| times[row] > last) {
                    kept.push(row);
                    t.push(times[row]);
                }
            }
        }
        let left_out = rows.len() - kept.len();
        Self { table, kept, t, left_out }
    }

    /// What was left out, in a sentence.
    pub(super) fn note(&self, name: &str) -> Option<String> {
        (self.left_out > 0).then(|| {
            format!(
                "{} rows of {name} were left out: their times stand still, go back or jump by more than a \
                 minute",
                self.left_out
            )
        })
    }

    /// A column of these rows.
    pub(super) fn column(&self, name: &str) -> Option<Vec<f64>> {
        let all = self.table.column(name)?.to_f64();
        Some(self.kept.iter().map(|&row| all.get(row).copied().unwrap_or(f64::NAN)).collect())
    }

    /// Whether a column is logged in whole numbers.
    pub(super) fn is_whole(&self, name: &str) -> bool {
        self.table.column(name).is_some_and(|values| !matches!(values, Values::F32(_) | Values::F64(_)))
    }

    /// Columns of these rows, if all are there.
    pub(super) fn group<const N: usize>(&self, names: [&str; N]) -> Option<[Vec<f64>; N]> {
        let mut found = [const { Vec::new() }; N];
        for (slot, name) in found.iter_mut().zip(names) {
            *slot = self.column(name)?;
        }
        Some(found)
    }

    /// A quantity of these rows, if there are any and all its columns are there.
    pub(super) fn signal<const N: usize>(&self, source: &str, names: [&str; N]) -> Option<Signal<N>> {
        let values = self.group(names).filter(|_| !self.t.is_empty())?;
        Some(Signal { source: source.into(), t: self.t.clone(), values })
    }
}

/// Runs of rows without a jump, without those that are too short to be the log going on elsewhere,
/// nor those that lie before what precedes them. The longest run is taken for right.
fn runs_that_follow(rows: &[usize], times: &[f64]) -> Vec<Vec<usize>> {
    let mut runs = runs(rows, times);
    if runs.iter().any(|run| run.len() >= ENOUGH_ROWS) {
        runs.retain(|run| run.len() >= ENOUGH_ROWS);
    }
    let bounds: Vec<[f64; 2]> = runs
        .iter()
        .map(|run| {
            let reach = |[low, high]: [f64; 2], &row: &usize| [low.min(times[row]), high.max(times[row])];
            run.iter().fold([f64::INFINITY, f64::NEG_INFINITY], reach)
        })
        .collect();
    let Some(longest) = (0..runs.len()).max_by_key(|&run| (runs[run].len(), std::cmp::Reverse(run))) else {
        return runs;
    };
    let [mut start, mut end] = bounds[longest];
    let mut follows = vec![false; runs.len()];
    follows[longest] = true;
    for run in (0..longest).rev() {
        if bounds[run][1] < start {
            start = bounds[run][0];
            follows[run] = true;
        }
    }
    for run in longest + 1..runs.len() {
        if bounds[run][0] > end {
            end = bounds[run][1];
            follows[run] = true;
        }
    }
    runs.into_iter().zip(follows).filter_map(|(run, follows)| follows.then_some(run)).collect()
}

/// Rows cut where the clock jumps. A row goes on with one of the last few runs if it can.
fn runs(rows: &[usize], times: &[f64]) -> Vec<Vec<usize>> {
    const LAST: usize = 4;
    let mut runs: Vec<Vec<usize>> = Vec::new();
    for &row in rows {
        let continues = |run: &&mut Vec<usize>| {
            run.last().is_some_and(|&last| (times[row] - times[last]).abs() <= LONGEST_JUMP_S)
        };
        match runs.iter_mut().rev().take(LAST).find(continues) {
            Some(run) => run.push(row),
            None => runs.push(vec![row]),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::TimeUnit;

    fn kept(times: &[i64]) -> Vec<f64> {
        let table = Table {
            name: "ATT".into(),
            message_type: None,
            time_unit: TimeUnit::Milliseconds,
            times: times.iter().map(|t| t * 1000).collect(),
            rows: times.len(),
            columns: Vec::new(),
        };
        Rows::of(&table, |_| true).t
    }

    #[test]
    fn absurd_times_are_left_out_and_pauses_are_not() {
        assert_eq!(kept(&[1, 2, 4_000_000_000, 3, 4, 4, 3, 5]), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(kept(&[9_999_999, 1, 2, 3]), [1.0, 2.0, 3.0]);
        assert_eq!(kept(&[1, 2, 3, 4, 1000, 1001, 1002]), [1.0, 2.0, 3.0, 4.0, 1000.0, 1001.0, 1002.0]);
        assert_eq!(kept(&[5001, 5002, 5003, 1, 2, 3, 4]), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(kept(&[1, 100, 200]), [1.0, 100.0, 200.0]);
        assert!(kept(&[]).is_empty());
    }
}
