//! Topics of a bag with times in seconds: of the stamps in the messages, and for messages without them
//! of when they were written, less what writing took.

use super::super::common::series::{Rising, nearest};
use crate::log::{Log, Table, Values};
use crate::recording::Signal;
use crate::statistics::median;

/// Messages that were written this close to each other were late by the same time, s.
const TOGETHER_S: f64 = 1e-3;

/// The topics of a bag.
pub(super) struct Bag<'a> {
    pub(super) topics: Vec<Topic<'a>>,
}

/// A topic with its times.
pub(super) struct Topic<'a> {
    pub(super) table: &'a Table,
    rising: Rising,
    /// What was done to the times, if they are not stamps.
    pub(super) note: Option<String>,
}

impl<'a> Bag<'a> {
    /// Finds the times of all topics; says in `notes` what was done to them.
    pub(super) fn of(log: &'a Log, notes: &mut Vec<String>) -> Self {
        let delays: Vec<Option<Delay<'_>>> = log.tables.iter().map(Delay::of).collect();
        let mut topics = Vec::new();
        for (table, delay) in log.tables.iter().zip(&delays) {
            let (times, note) = match delay {
                Some(delay) => (delay.stamps_s.clone(), None),
                None => unstamped(table, &delays),
            };
            topics.push(Topic { table, rising: Rising::of(&times), note });
        }
        for topic in &topics {
            // Transforms and logs come from many places at once.
            if topic.rising.left_out > 0 && topic.table.column("pose.position.x").is_some() {
                notes.push(format!(
                    "{}: {} messages whose times go back or repeat are left out",
                    topic.table.name, topic.rising.left_out
                ));
            }
        }
        Self { topics }
    }

    /// Inertial sensors, the fastest first.
    pub(super) fn imus(&self) -> impl Iterator<Item = &Topic<'a>> {
        let mut imus: Vec<_> = self.topics.iter().filter(|topic| topic.is_a("Imu")).collect();
        imus.sort_by_key(|topic| std::cmp::Reverse(topic.table.rows));
        imus.into_iter()
    }
}

impl Topic<'_> {
    /// The topic's name without its last part.
    pub(super) fn namespace(&self) -> &str {
        namespace(self.table)
    }

    /// Whether messages are of a type, whichever package it is in.
    pub(super) fn is_a(&self, message: &str) -> bool {
        self.table.message_type.as_deref().and_then(|name| name.rsplit('/').next()) == Some(message)
    }

    /// Columns as a signal.
    pub(super) fn signal<const N: usize>(&self, names: [String; N]) -> Option<Signal<N>> {
        let values = self.table.group(names.each_ref().map(String::as_str))?;
        (self.rising.t.len() > 1).then(|| self.rising.signal(&self.table.name, &values))
    }
}

fn namespace(table: &Table) -> &str {
    table.name.rsplit_once('/').map_or("", |(namespace, _)| namespace)
}

/// How late the messages of a topic with stamps were written.
struct Delay<'a> {
    table: &'a Table,
    stamps_s: Vec<f64>,
    /// When messages were written, rising, and how late each was.
    written_s: Vec<f64>,
    late_s: Vec<f64>,
    median_s: f64,
}

impl<'a> Delay<'a> {
    /// Nothing for a topic without stamps. A stamp of zero is none: there, the time at which it was
    /// written stands in.
    fn of(table: &'a Table) -> Option<Self> {
        let Some(Values::I64(stamps)) = table.column("header.stamp") else { return None };
        if stamps.iter().all(|stamp| *stamp == 0) {
            return None;
        }
        let late = (stamps.iter().zip(&table.times))
            .filter(|(stamp, _)| **stamp != 0)
            .map(|(stamp, written)| written.saturating_sub(*stamp) as f64 * 1e-9);
        let median_s = median(late)?;
        let time = |(stamp, written): (&i64, &i64)| {
            if *stamp == 0 { *written as f64 * 1e-9 - median_s } else { *stamp as f64 * 1e-9 }
        };
        let stamps_s: Vec<f64> = stamps.iter().zip(&table.times).map(time).collect();
        let mut written: Vec<(f64, f64)> = table
            .times_s()
            .into_iter()
            .zip(&stamps_s)
            .map(|(written, stamp)| (written, written - stamp))
            .collect();
        written.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (written_s, late_s) = written.into_iter().unzip();
        Some(Self { table, stamps_s, written_s, late_s, median_s })
    }
}

/// Times of a topic without stamps, as late as those of a topic of the same craft; and a sentence that
/// says so.
fn unstamped(table: &Table, delays: &[Option<Delay<'_>>]) -> (Vec<f64>, Option<String>) {
    let times = table.times_s();
    let of_craft = delays.iter().flatten().filter(|delay| namespace(delay.table) == namespace(table));
    let Some(delay) = of_craft.max_by_key(|delay| delay.table.rows) else { return (times, None) };
    let note = format!(
        "{} has no stamps: its times are those at which it was written, \
         less the {:.1} ms by which {} was late",
        table.name,
        delay.median_s * 1e3,
        delay.table.name
    );
    let less = |time: f64| {
        let together = nearest(&delay.written_s, time, TOGETHER_S);
        time - together.map_or(delay.median_s, |row| delay.late_s[row])
    };
    (times.into_iter().map(less).collect(), Some(note))
}
