//! From the log of a running recording to an indexed log and flight files.

use std::collections::{BTreeMap, HashMap};
use std::fs::{self, File};
use std::io::{BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

use logs::{FlightCutter, OwnFlight, telemetry_from_json};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapResult, WriteOptions, Writer};

use super::entry::TOPICS;
use super::error::{RecordError, mcap_error};
use super::log::begin_mcap;
use super::recorder::{part_of, with_ending};
use super::records::{Completeness, Found, walk};

/// The files of a finished recording.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Finished {
    /// The log.
    pub mcap: PathBuf,
    /// The flights in it.
    pub flights: Vec<PathBuf>,
    /// How much of what was recorded is in the log.
    pub completeness: Completeness,
}

/// Finishes the recording of this name: `NAME.mcap.part` becomes `NAME.mcap` and flight files. What is damaged in it is left out,
/// counted, and said in the log's metadata.
///
/// # Errors
/// What cannot be read or written. The part is then still there.
pub fn finish(name: &Path) -> Result<Finished, RecordError> {
    let (part, mcap, temporary) = (part_of(name), with_ending(name, ".mcap"), with_ending(name, ".mcap.new"));
    if mcap.exists() {
        return Err(RecordError::Exists(mcap));
    }
    let refuse = |path: &Path, what| {
        let path = path.to_owned();
        move |source| RecordError::File { path, what, source }
    };
    let from = File::open(&part).map_err(refuse(&part, "read the recording"))?;
    let file = File::create(&temporary).map_err(refuse(&temporary, "write the log"))?;
    let recovered = recover((from, &part), (BufWriter::new(file), &temporary));
    let Recovered { log, flights, completeness } = recovered.inspect_err(|_| {
        // Of the part nothing is lost, and half a log would be in the way.
        let _ = fs::remove_file(&temporary);
    })?;
    let written = log.into_inner().map_err(std::io::IntoInnerError::into_error);
    written.and_then(|file| file.sync_all()).map_err(refuse(&temporary, "write the log"))?;
    let mut finished = Finished { mcap: mcap.clone(), flights: Vec::new(), completeness };
    for (k, own) in flights.iter().enumerate() {
        let path = with_ending(name, &format!("-{}.csv", k + 1));
        report::write_atomic(&path, own.flight.to_csv())?;
        finished.flights.push(path);
    }
    fs::rename(&temporary, &mcap).map_err(refuse(&mcap, "rename the log"))?;
    fs::remove_file(&part).map_err(refuse(&part, "remove the part"))?;
    Ok(finished)
}

/// What a recording became.
#[derive(Debug)]
pub struct Recovered<W> {
    /// The log, written.
    pub log: W,
    /// The flights in it.
    pub flights: Vec<OwnFlight>,
    /// How much of what was recorded is in it.
    pub completeness: Completeness,
}

/// Makes a log of what is left of a recording in progress. The paths are for messages.
///
/// # Errors
/// What cannot be read or written, and what holds nothing of a recording.
pub fn recover<W: Write + Seek>(
    (part, part_path): (impl Read, &Path),
    (log, log_path): (W, &Path),
) -> Result<Recovered<W>, RecordError> {
    let log_refuses = |source| mcap_error(log_path, "write the log")(source);
    let mut copy = Copy::begin(log).map_err(log_refuses)?;
    let channels: Vec<u16> = copy.channels.keys().copied().collect();
    let walked = walk(part, &channels, |found| copy.take(found).map_err(Stop::Log));
    let completeness = walked.map_err(|stop| match stop {
        Stop::Log(source) => log_refuses(source),
        Stop::Part(source) => {
            RecordError::File { path: part_path.into(), what: "read the recording", source }
        }
    })?;
    let completeness = completeness.ok_or_else(|| RecordError::NoRecording(part_path.into()))?;
    let (log, flights) = copy.end(&completeness).map_err(log_refuses)?;
    Ok(Recovered { log, flights, completeness })
}

/// Why copying stops.
enum Stop {
    Part(std::io::Error),
    Log(mcap::McapError),
}

impl From<std::io::Error> for Stop {
    fn from(source: std::io::Error) -> Self {
        Self::Part(source)
    }
}

/// Number of the schema of a channel that has none.
const NO_SCHEMA: u16 = 0;

/// What a recording becomes.
struct Copy<W: Write + Seek> {
    writer: Writer<W>,
    /// Channel of the log, and whether it is telemetry, by channel of the part: at first those that every recording of this version
    /// has, as their definitions may be lost.
    channels: HashMap<u16, (u16, bool)>,
    schemas: HashMap<u16, u16>,
    flights: FlightCutter,
}

impl<W: Write + Seek> Copy<W> {
    fn begin(file: W) -> McapResult<Self> {
        let (writer, channels) = begin_mcap(file, WriteOptions::new().use_chunks(true))?;
        let channels = channels.into_iter().zip(TOPICS).map(|(id, topic)| (id, (id, topic == TOPICS[0])));
        let channels = channels.collect();
        Ok(Self { writer, channels, schemas: HashMap::new(), flights: FlightCutter::default() })
    }

    fn take(&mut self, found: Found<'_>) -> McapResult<()> {
        match found {
            Found::Head | Found::End => {}
            Found::Schema { id, name, encoding, text } => {
                self.schemas.insert(id, self.writer.add_schema(name, encoding, text)?);
            }
            Found::Channel { id, schema, topic, encoding } => {
                let schema = self.schemas.get(&schema).copied();
                // Of a channel whose schema is lost, that of this version will do; one that this version does not have goes without.
                if schema.is_some() || !self.channels.contains_key(&id) {
                    let schema = schema.unwrap_or(NO_SCHEMA);
                    let own = self.writer.add_channel(schema, topic, encoding, &BTreeMap::new())?;
                    self.channels.insert(id, (own, topic == TOPICS[0].0));
                }
            }
            Found::Message { channel, sequence, log_time, publish_time, data } => {
                let Some(&(channel_id, is_telemetry)) = self.channels.get(&channel) else { return Ok(()) };
                let header = MessageHeader { channel_id, sequence, log_time, publish_time };
                self.writer.write_to_known_channel(&header, data)?;
                if is_telemetry && let Some(telemetry) = telemetry_from_json(data) {
                    self.flights.push(&telemetry);
                }
            }
        }
        Ok(())
    }

    /// The end of the log says how much of the recording it holds.
    fn end(mut self, completeness: &Completeness) -> McapResult<(W, Vec<OwnFlight>)> {
        let word = |yes: bool| if yes { "yes" } else { "no" }.to_owned();
        let mut metadata = BTreeMap::from([
            ("complete".into(), word(completeness.is_complete())),
            ("messages".into(), completeness.messages.to_string()),
            ("lost_messages".into(), completeness.lost_messages.to_string()),
            ("left_out_messages".into(), completeness.left_out_messages.to_string()),
            ("damaged_bytes".into(), completeness.damaged_bytes.to_string()),
            ("closed".into(), word(completeness.closed)),
        ]);
        metadata.extend(completeness.missing().map(|missing| ("missing".into(), missing)));
        self.writer.write_metadata(&Metadata { name: "quadlab.completeness".into(), metadata })?;
        self.writer.finish()?;
        Ok((self.writer.into_inner(), self.flights.finish()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use proto::{Request, Telemetry};
    use serde_json::{Value, json};

    use super::super::entry::{Entry, Level};
    use super::super::recorder::Recorder;
    use super::super::schema::samples;
    use super::*;

    fn telemetry(tick: u32) -> Telemetry {
        let mut value = samples()[0].clone();
        value["tick"] = tick.into();
        value["craft_us"] = (tick * 10_000).into();
        value["battery_v"] = json!(0.1);
        let state = if (10..110).contains(&tick) { "Flying" } else { "Disarmed" };
        value["supervision"]["state"] = state.into();
        value["tracked"]["position_m"] = json!([0.25, 0.0, if tick < 20 { 0.0 } else { -1.0 }]);
        serde_json::from_value(value).unwrap()
    }

    fn record(name: &Path, ticks: u32) -> Recorder {
        let mut recorder = Recorder::begin(name, 1_000_000_000, &BTreeMap::new()).unwrap();
        for tick in 0..ticks {
            recorder.write(u64::from(tick) * 10_000, &Entry::Telemetry(&telemetry(tick)));
        }
        recorder
    }

    /// Ticks of the telemetry in a log, by the crate's own reader.
    fn ticks_in(path: &Path) -> Vec<u64> {
        let bytes = fs::read(path).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap());
        let ticks = messages.map(|message| {
            let value: Value = serde_json::from_slice(&message.data).unwrap();
            value["tick"].as_u64().unwrap()
        });
        ticks.collect()
    }

    /// A recording that was not closed, and where each of its messages ends.
    fn unclosed(name: &Path, ticks: u32) -> (Vec<u8>, Vec<usize>) {
        let mut recorder = Recorder::begin(name, 0, &BTreeMap::new()).unwrap();
        let length = |recorder: &Recorder| fs::metadata(recorder.path()).unwrap().len() as usize;
        // What a kill would leave: nothing is held back for longer than a write takes.
        let ends = (0..ticks).map(|tick| {
            recorder.write(u64::from(tick), &Entry::Telemetry(&telemetry(tick)));
            recorder.wait_for_disk();
            length(&recorder)
        });
        let ends: Vec<usize> = ends.collect();
        let bytes = fs::read(recorder.path()).unwrap();
        assert_eq!(bytes.len(), *ends.last().unwrap());
        (bytes, ends)
    }

    /// What a damaged part becomes.
    fn finished_of(name: &Path, bytes: &[u8]) -> Finished {
        fs::write(part_of(name), bytes).unwrap();
        finish(name).unwrap()
    }

    #[test]
    fn a_recording_becomes_a_log_and_flight_files() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a.b");
        let mut recorder = record(&name, 120);
        recorder.write(1_200_000, &Entry::Log(Level::Warning, "link late"));
        drop(recorder);
        let finished = finish(&name).unwrap();
        assert_eq!(finished.completeness.messages, 121);
        assert!(!part_of(&name).exists());
        let [flight] = &finished.flights[..] else { panic!("{finished:?}") };
        let flight = flights::Flight::read(flight).unwrap();
        // Flying from tick 10 on, in the air from 20 to 109.
        assert_eq!(flight.len(), 90);
        assert_eq!(flight.column(flights::Column::T).unwrap()[89], 0.89);
        assert!(matches!(Recorder::begin(&name, 0, &BTreeMap::new()), Err(RecordError::Exists(_))));
    }

    /// With the crate's own summary reader: topics, encodings and schemas are those of a file that
    /// viewers open by its index.
    #[test]
    fn the_log_is_indexed_and_each_message_fits_its_schema() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a");
        let mut recorder = record(&name, 5);
        for sample in 0..3 {
            recorder.write(sample, &Entry::Request(Request::Land));
        }
        drop(recorder);
        let bytes = fs::read(finish(&name).unwrap().mcap).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, 8);
        assert!(!summary.chunk_indexes.is_empty());
        assert_eq!(summary.channels.len(), TOPICS.len());
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            let schema = message.channel.schema.clone().unwrap();
            assert_eq!(
                (message.channel.message_encoding.as_str(), schema.encoding.as_str()),
                ("json", "jsonschema")
            );
            let schema: Value = serde_json::from_slice(&schema.data).unwrap();
            let value: Value = serde_json::from_slice(&message.data).unwrap();
            let known = schema["properties"].as_object().unwrap();
            assert!(value.as_object().unwrap().keys().all(|field| known.contains_key(field)), "{value}");
            assert_eq!(value["battery_v"].as_f64().unwrap_or(0.1), 0.1, "not 0.10000000149011612");
            assert_eq!(schema["type"], "object", "viewers ask for an object");
        }
    }

    #[test]
    fn a_recording_cut_off_anywhere_keeps_all_that_came_before() {
        let folder = tempfile::tempdir().unwrap();
        let (bytes, ends) = unclosed(&folder.path().join("whole"), 30);
        let before = ends[0] - (ends[1] - ends[0]);
        for (k, length) in (before..bytes.len()).step_by(61).enumerate() {
            let finished = finished_of(&folder.path().join(format!("cut{k}")), &bytes[..length]);
            let expected = ends.iter().filter(|end| **end <= length).count();
            let Completeness { messages, lost_messages, damaged_places, tail_bytes, closed, .. } =
                finished.completeness;
            assert_eq!((messages, lost_messages, damaged_places), (expected as u64, 0, 0), "cut at {length}");
            assert!(!closed, "cut at {length}");
            if let Some(end) = ends[..expected].last() {
                assert_eq!(tail_bytes as usize, length - end, "cut at {length}");
            }
        }
    }

    /// Every page in turn, that of the head among them: what came before is there and what comes after, but for the messages that
    /// the page touches; how many those are is said.
    #[test]
    fn a_zeroed_page_costs_what_stood_on_it_and_nothing_else() {
        const PAGE: usize = 4096;
        let folder = tempfile::tempdir().unwrap();
        let (bytes, ends) = unclosed(&folder.path().join("whole"), 120);
        let begins = |k: usize| if k == 0 { ends[0] - (ends[1] - ends[0]) } else { ends[k - 1] };
        let pages = bytes.len().div_ceil(PAGE);
        assert!(pages > 20, "{pages}");
        for page in 0..pages {
            let mut damaged = bytes.clone();
            let zeroed = page * PAGE..((page + 1) * PAGE).min(bytes.len());
            damaged[zeroed.clone()].fill(0);
            let finished = finished_of(&folder.path().join(format!("page{page}")), &damaged);
            let is_whole = |k: &usize| ends[*k] <= zeroed.start || begins(*k) >= zeroed.end;
            let expected: Vec<u64> = (0..ends.len()).filter(is_whole).map(|k| k as u64).collect();
            assert_eq!(ticks_in(&finished.mcap), expected, "page {page}");
            let complete = &finished.completeness;
            let is_last = zeroed.end == bytes.len();
            let lost = if is_last { 0 } else { ends.len() - expected.len() };
            assert_eq!(complete.lost_messages, lost as u64, "page {page}");
            let told = complete.missing().unwrap();
            assert!(complete.first_damage.is_some() != is_last && told.contains("not closed"), "{told}");
        }
    }

    #[test]
    fn flipped_bits_cost_the_message_that_they_are_in_at_most() {
        let folder = tempfile::tempdir().unwrap();
        let (bytes, ends) = unclosed(&folder.path().join("whole"), 30);
        let first = ends[0] - (ends[1] - ends[0]);
        // Each bit of kind, length, channel and the beginning of the data; then some of everything.
        let head = (ends[9] * 8..(ends[9] + 40) * 8).chain((first * 8..bytes.len() * 8).step_by(997));
        let bits: BTreeSet<usize> = head.chain((0..first * 8).step_by(1009)).collect();
        for bit in bits {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let finished = finished_of(&folder.path().join(format!("bit{bit}")), &damaged);
            assert!(finished.completeness.messages >= 29, "bit {bit}: {finished:?}");
        }
    }

    /// A channel of another version, whose schema stood on a damaged page.
    #[test]
    fn messages_of_a_channel_whose_schema_is_lost_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let (mut bytes, _) = unclosed(&folder.path().join("whole"), 3);
        let record = |kind: u8, content: &[&[u8]]| {
            let content = content.concat();
            [&[kind][..], &(content.len() as u64).to_le_bytes(), &content].concat()
        };
        let (id, lost_schema) = (100_u16.to_le_bytes(), 200_u16.to_le_bytes());
        let channel: [&[u8]; 7] =
            [&id, &lost_schema, &5_u32.to_le_bytes(), b"/wind", &4_u32.to_le_bytes(), b"json", &[0; 4]];
        let message: [&[u8]; 3] = [&id, &[0; 4 + 8 + 8], b"{\"tick\":77}"];
        bytes.extend(record(mcap::records::op::CHANNEL, &channel));
        bytes.extend(record(mcap::records::op::MESSAGE, &message));
        let finished = finished_of(&folder.path().join("other"), &bytes);
        assert_eq!(finished.completeness.messages, 4);
        assert_eq!(ticks_in(&finished.mcap), [0, 1, 2, 77]);
    }

    #[test]
    fn a_log_says_whether_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let told = |finished: &Finished| {
            let bytes = fs::read(&finished.mcap).unwrap();
            let index = mcap::Summary::read(&bytes).unwrap().unwrap().metadata_indexes.remove(0);
            mcap::read::metadata(&bytes, &index).unwrap().metadata
        };
        let name = folder.path().join("closed");
        drop(record(&name, 20));
        let closed = finish(&name).unwrap();
        assert!(closed.completeness.is_complete() && closed.completeness.missing().is_none(), "{closed:?}");
        assert_eq!((&*told(&closed)["complete"], &*told(&closed)["messages"]), ("yes", "20"));
        let (bytes, ends) = unclosed(&folder.path().join("whole"), 20);
        let mut damaged = bytes;
        damaged[ends[4]..ends[6]].fill(0xff);
        let open = finished_of(&folder.path().join("open"), &damaged);
        let told = told(&open);
        assert_eq!((&*told["complete"], &*told["lost_messages"], &*told["closed"]), ("no", "2", "no"));
        assert!(told["missing"].contains("; messages lost there: 2"), "{told:?}");
    }

    #[test]
    fn what_is_no_recording_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("x");
        let message = finish(&name).unwrap_err().to_string();
        assert!(message.contains("x.mcap"), "{message}");
        fs::write(part_of(&name), "t,x,y\n1,2,3\n and more of it").unwrap();
        let message = finish(&name).unwrap_err().to_string();
        assert!(message.contains("x.mcap.part") && message.lines().count() == 1, "{message}");
        assert!(part_of(&name).exists());
    }
}
