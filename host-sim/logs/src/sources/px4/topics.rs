//! Tables by topic and instance.

use crate::log::{Log, Table};

/// The lowest instance of a topic that has rows.
pub(super) fn topic<'a>(log: &'a Log, name: &str) -> Option<&'a Table> {
    instances(log, name).next()
}

/// All instances of a topic, in the order of the log.
pub(super) fn instances<'a>(log: &'a Log, name: &str) -> impl Iterator<Item = &'a Table> {
    let mut tables: Vec<_> =
        log.tables.iter().filter(|table| topic_of(table) == name && table.rows > 0).collect();
    tables.sort_by_key(|table| instance_of(table));
    tables.into_iter()
}

/// The topic of a table: its name without the instance.
pub(super) fn topic_of(table: &Table) -> &str {
    table.name.split_once('[').map_or(table.name.as_str(), |(topic, _)| topic)
}

fn instance_of(table: &Table) -> u8 {
    let instance =
        table.name.split_once('[').and_then(|(_, instance)| instance.trim_end_matches(']').parse().ok());
    instance.unwrap_or(0)
}
