//! Topics of a bag, each with the reader of its messages.

use std::collections::HashMap;

use super::super::common::budget::Budget;
use super::super::common::faults::Faults;
use super::builtin;
use super::definition::{Definitions, Dialect, full_type_name, short_type_name};
use super::reader::Reader;
use super::serialised::Serialised;
use crate::log::{Table, TimeUnit};

/// Topics of a bag.
#[derive(Debug)]
pub(in crate::decode) struct Topics {
    all: Vec<Topic>,
    by_name: HashMap<(String, String), usize>,
    budget: Budget,
}

/// How messages are serialised, as far as this is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::decode) enum Encoding {
    /// ROS 1 or 2.
    Ros(Dialect),
    /// Something else: messages are counted.
    Other,
}

#[derive(Debug)]
struct Topic {
    name: String,
    message_type: String,
    dialect: Dialect,
    /// How messages are read, or why they are only counted.
    reader: Result<Reader, Option<String>>,
    times: Vec<i64>,
    damaged: usize,
}

impl Topics {
    /// For a bag of this size.
    pub(in crate::decode) fn new(file_bytes: usize) -> Self {
        Self { all: Vec::new(), by_name: HashMap::new(), budget: Budget::for_columns(file_bytes) }
    }

    /// The number of a topic, which is new or known. Without a definition, that of a common message is
    /// taken.
    pub(in crate::decode) fn add(
        &mut self,
        name: &str,
        message_type: &str,
        encoding: Encoding,
        definition: Option<&str>,
    ) -> usize {
        let key = (name.to_owned(), full_type_name(message_type));
        if let Some(&known) = self.by_name.get(&key) {
            return known;
        }
        let (dialect, reader) = match encoding {
            Encoding::Ros(dialect) => (dialect, reader(message_type, dialect, definition).map_err(Some)),
            // Nothing is wrong with them.
            Encoding::Other => (Dialect::Ros2, Err(None)),
        };
        let number = self.all.len();
        self.all.push(Topic {
            name: name.into(),
            message_type: key.1.clone(),
            dialect,
            reader,
            times: Vec::new(),
            damaged: 0,
        });
        self.by_name.insert(key, number);
        number
    }

    /// Adds a message with the time at which it was written, ns.
    pub(in crate::decode) fn read(&mut self, topic: usize, time_ns: i64, message: &[u8]) {
        let Some(topic) = self.all.get_mut(topic) else { return };
        if let Ok(reader) = &mut topic.reader {
            let message = match topic.dialect {
                Dialect::Ros1 => Some(Serialised::ros1(message)),
                Dialect::Ros2 => Serialised::cdr(message),
            };
            if !message.is_some_and(|message| reader.read(message, &mut self.budget)) {
                topic.damaged += 1;
                return;
            }
        }
        topic.times.push(time_ns);
    }

    /// A table of each topic that has messages.
    pub(in crate::decode) fn into_tables(self, faults: &mut Faults) -> Vec<Table> {
        let mut tables = Vec::new();
        for topic in self.all {
            if topic.damaged > 0 {
                faults.say(format!("{}: {} messages are damaged and left out", topic.name, topic.damaged));
            }
            let columns = match topic.reader {
                Ok(reader) => reader.into_columns(),
                Err(why) => {
                    if let Some(why) = why.filter(|_| !topic.times.is_empty()) {
                        faults.say(format!("{}: messages are only counted, for {why}", topic.name));
                    }
                    Vec::new()
                }
            };
            if topic.times.is_empty() {
                continue;
            }
            tables.push(Table {
                name: topic.name,
                message_type: Some(topic.message_type),
                time_unit: TimeUnit::Nanoseconds,
                rows: topic.times.len(),
                times: topic.times,
                columns,
            });
        }
        tables
    }
}

fn reader(message_type: &str, dialect: Dialect, definition: Option<&str>) -> Result<Reader, String> {
    let name = short_type_name(message_type);
    let own = definition.filter(|text| !text.trim().is_empty());
    // An empty text with a name is an empty message only in ROS 1, where the text is always there.
    let text = match (own, dialect) {
        (Some(text), _) => text.to_owned(),
        (None, Dialect::Ros1) if definition.is_some() => String::new(),
        (None, _) => {
            builtin::definition(&name).ok_or_else(|| format!("{message_type} is not defined in the bag"))?
        }
    };
    Reader::new(&name, Definitions::parse(&name, &text, dialect)?)
}
