//! ROS 2 bags in sqlite: tables `topics` and `messages`, since ROS 2 Iron also `message_definitions`.
//!
//! The file is opened in memory, as a copy. It may be hostile: no view or virtual table is read,
//! nothing is longer than the file, and sqlite stops after a number of steps that goes with the size of
//! the file.

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

use rusqlite::limits::Limit;
use rusqlite::{Connection, Statement};

use super::common::budget::Budget;
use super::common::decompress::{Compression, decompress};
use super::common::faults::Faults;
use super::ros_messages::{Dialect, Encoding, Topics, full_type_name};
use crate::error::{LogError, plain};
use crate::format::Format;
use crate::log::Log;

/// Bytes of the header of a database.
const HEADER_BYTES: usize = 100;
/// First bytes of messages that the recorder compressed, each by itself.
const ZSTANDARD: &[u8] = b"\x28\xb5\x2f\xfd";
/// Bytes of a bag for which reading goes on once behind rows that cannot be read, and the bounds of how often it does: a row that claims
/// to have gigabytes takes sqlite some 20 ms.
const RESTART_BYTES: usize = 1000;
const RESTARTS: [usize; 2] = [10, 60];
/// Characters of a message of sqlite's.
const LONGEST_MESSAGE: usize = 120;
/// Steps of sqlite's machine between two looks at how many there were.
const STEPS: i32 = 1000;

pub(crate) fn decode(bytes: &[u8], path: &Path) -> Result<Log, LogError> {
    let refuse = |error: rusqlite::Error| LogError::Format {
        path: path.into(),
        what: format!("is no ROS 2 bag that can be read: {}", plain(&error.to_string(), LONGEST_MESSAGE)),
        mend: "`ros2 bag reindex` or `sqlite3 BAG .recover` may save it".into(),
    };
    let mut faults = Faults::default();
    let database = open(bytes, &mut faults).map_err(refuse)?;
    let journal =
        path.with_file_name(format!("{}-wal", path.file_name().unwrap_or_default().to_string_lossy()));
    if journal.metadata().is_ok_and(|journal| journal.len() > 0) {
        faults.say(
            "the file ending in -wal beside the bag holds its last messages: open the bag once with sqlite3",
        );
    }
    let mut bag = Bag {
        topics: Topics::new(bytes.len()),
        by_id: HashMap::new(),
        budget: Budget::for_decompression(bytes.len()),
        restarts: (bytes.len() / RESTART_BYTES).clamp(RESTARTS[0], RESTARTS[1]),
        lost_messages: 0,
    };
    bag.read_topics(&database).map_err(refuse)?;
    bag.read_messages(&database, &mut faults).map_err(refuse)?;
    if bag.lost_messages > 0 {
        faults.say(format!(
            "{} messages are of topics that are not in the bag, or are damaged",
            bag.lost_messages
        ));
    }
    let mut log = Log::new(Format::Rosbag2);
    log.tables = bag.topics.into_tables(&mut faults);
    log.losses.damage = faults.into_sentences();
    Ok(log)
}

/// Opens a copy of the bag in memory.
fn open(bytes: &[u8], faults: &mut Faults) -> rusqlite::Result<Connection> {
    let (head, rest) = bytes.split_at(bytes.len().min(HEADER_BYTES));
    let mut header = head.to_vec();
    if let Some(header) = header.first_chunk_mut::<HEADER_BYTES>() {
        // Write-ahead mode needs files beside the bag, which are not in memory.
        header[18..20].fill(1);
        let pages = u32::from_be_bytes([header[28], header[29], header[30], header[31]]);
        let page_bytes = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            bytes => u64::from(bytes),
        };
        if u64::from(pages) * page_bytes > bytes.len() as u64 {
            faults.say("the bag is cut off: its end is missing");
        }
        // Without a number of pages here, sqlite takes it from the size, instead of refusing a bag that
        // is cut off.
        header[28..32].fill(0);
    }
    let mut database = Connection::open_in_memory()?;
    let longest = i32::try_from(bytes.len()).unwrap_or(i32::MAX).max(1000);
    database.deserialize_read_exact("main", header.chain(rest), bytes.len(), true)?;
    database.set_limit(Limit::SQLITE_LIMIT_LENGTH, longest)?;
    let mut looks_left = bytes.len() / 100 + 10_000;
    database.progress_handler(
        STEPS,
        Some(move || {
            looks_left = looks_left.saturating_sub(1);
            looks_left == 0
        }),
    )?;
    database.execute_batch("PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON;")?;
    Ok(database)
}

/// Whether there is a real table of this name, without columns that are computed.
fn has_table(database: &Connection, name: &str) -> rusqlite::Result<bool> {
    let query = "SELECT count(*) FROM sqlite_schema WHERE type='table' AND name=?1 \
                 AND sql LIKE 'CREATE TABLE%' AND NOT EXISTS (SELECT 1 FROM pragma_table_xinfo(?1) WHERE hidden<>0)";
    database.query_row(query, [name], |row| row.get::<_, i64>(0)).map(|count| count > 0)
}

struct Bag {
    topics: Topics,
    /// Topic by its id in the bag.
    by_id: HashMap<i64, usize>,
    budget: Budget,
    /// How often reading goes on behind rows that cannot be read.
    restarts: usize,
    lost_messages: usize,
}

impl Bag {
    fn read_topics(&mut self, database: &Connection) -> rusqlite::Result<()> {
        for table in ["topics", "messages"] {
            if !has_table(database, table)? {
                return Err(rusqlite::Error::InvalidColumnName(format!("no table {table}")));
            }
        }
        let mut definitions = HashMap::new();
        if has_table(database, "message_definitions")? {
            let query = "SELECT topic_type, encoded_message_definition FROM message_definitions \
                         WHERE encoding='ros2msg'";
            let mut statement = database.prepare(query)?;
            let mut rows = statement.query([])?;
            while let Some(row) = rows.next()? {
                definitions.insert(full_type_name(&row.get::<_, String>(0)?), row.get::<_, String>(1)?);
            }
        }
        let mut statement = database.prepare("SELECT id, name, type, serialization_format FROM topics")?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let message_type = full_type_name(&row.get::<_, String>(2)?);
            let encoding = match row.get::<_, String>(3)?.as_str() {
                "cdr" => Encoding::Ros(Dialect::Ros2),
                _ => Encoding::Other,
            };
            let definition = definitions.get(&message_type).map(String::as_str);
            let topic = self.topics.add(&row.get::<_, String>(1)?, &message_type, encoding, definition);
            self.by_id.insert(row.get(0)?, topic);
        }
        Ok(())
    }

    /// Reads all messages in the order of the file, and goes on behind pages that cannot be read.
    fn read_messages(&mut self, database: &Connection, faults: &mut Faults) -> rusqlite::Result<()> {
        let query = "SELECT rowid, topic_id, timestamp, data FROM messages WHERE rowid > ?1 ORDER BY rowid";
        let mut statement = database.prepare(query)?;
        let mut last = i64::MIN;
        let (mut step, mut restarts) = (1_i64, 0);
        loop {
            let before = last;
            match self.read_from(&mut statement, &mut last) {
                Ok(()) => break,
                Err(error) if restarts == 0 => faults.say(format!(
                    "the bag is damaged behind message {}: {}",
                    last.max(0),
                    plain(&error.to_string(), LONGEST_MESSAGE)
                )),
                Err(_) => {}
            }
            restarts += 1;
            if restarts > self.restarts {
                faults.say(format!("reading was given up behind message {}", last.max(0)));
                break;
            }
            // A page that cannot be read holds some messages: jump further each time that nothing came.
            step = if last == before { step.saturating_mul(2) } else { 1 };
            last = last.max(0).saturating_add(step);
            if last == i64::MAX {
                break;
            }
        }
        Ok(())
    }

    fn read_from(&mut self, statement: &mut Statement<'_>, last: &mut i64) -> rusqlite::Result<()> {
        let mut rows = statement.query([*last])?;
        while let Some(row) = rows.next()? {
            *last = row.get(0)?;
            let (id, time) = (row.get_ref(1)?.as_i64(), row.get_ref(2)?.as_i64());
            let (Ok(id), Ok(time), Ok(data)) = (id, time, row.get_ref(3)?.as_blob()) else {
                self.lost_messages += 1;
                continue;
            };
            let Some(&topic) = self.by_id.get(&id) else {
                self.lost_messages += 1;
                continue;
            };
            if data.starts_with(ZSTANDARD) {
                let plain = decompress(data, Compression::Zstandard, usize::MAX, &mut self.budget);
                self.topics.read(topic, time, &plain.bytes);
            } else {
                self.topics.read(topic, time, data);
            }
        }
        Ok(())
    }
}
