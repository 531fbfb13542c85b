//! Recordings: everything that is sent and heard, as MCAP, and each flight in it as a flight file.
//!
//! **While it runs** the log is `NAME.mcap.part`: MCAP without chunks, each message written to the system before the next one is
//! looked at, so a killed program or a full disk loses nothing that came before. **When it ends** [`finish`] reads that log
//! and writes `NAME.mcap` (with chunks and indices, as Foxglove and PlotJuggler like it) and `NAME-1.csv`, `NAME-2.csv` ... (one
//! flight each, see [`flights`](crate::flights)), each under a temporary name first; then the part goes. A part that a crash left
//! behind is finished in the same way.
//!
//! Messages are JSON with a JSON schema each, in SI units, the fields those of crate `proto`:
//!
//! | topic | what |
//! |---|---|
//! | `/telemetry` | from the craft, each tick |
//! | `/pose`, `/command`, `/request`, `/gains` | to the craft |
//! | `/identity`, `/answer` | from the craft |
//! | `/link` | delay, skew and losses, four times a second |
//! | `/log` | what people were told (`foxglove.Log`) |
//!
//! Times are nanoseconds of the machine's wall clock at the start plus the ground's clock since. A number that is none (a pose
//! before the first) is `null`. Deliberately absent: compression (`mcap compress` does it).

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::sans_io::LinearReaderOptions;
use mcap::{WriteOptions, Writer};
use proto::{
    Answer, Command, Counters, Gains, Identity, ImuSample, Loop, Mode, Pose, Refusal, Request, State,
    Supervision, Telemetry, TimedPose,
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Why something cannot be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file system.
    #[error("{}: cannot {what}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// The log.
    #[error("{}: cannot {what}: {source}", path.display())]
    Mcap {
        /// Which file.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// What was wrong.
        source: Box<mcap::McapError>,
    },
    /// A recording of that name is there.
    #[error("{}: is there already; give another name, or move it away", .0.display())]
    Exists(PathBuf),
    /// An output file.
    #[error(transparent)]
    Output(#[from] report::Error),
}

/// What is known of the link, for the log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LinkRecord {
    /// Half of the mean round trip, s (thesis 5.5).
    pub one_way_s: f64,
    /// Half of the least round trip, s.
    pub least_one_way_s: f64,
    /// By which part the craft's clock runs fast.
    pub skew: f64,
    /// Of `skew`.
    pub skew_std_error: f64,
    /// Ticks of the craft in a second of the ground.
    pub tick_hz: f64,
    /// Part of the craft's packets that was lost, of late.
    pub lost_down: f64,
    /// Part of the ground's packets that was lost, of late.
    pub lost_up: f64,
    /// Frames of the tracker in a second.
    pub pose_hz: f64,
}

/// How bad something is that people are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Level {
    /// Good to know.
    Info,
    /// Something to look at.
    Warning,
    /// Something that has to be acted on.
    Error,
}

impl Level {
    /// Foxglove's number.
    fn number(self) -> u8 {
        match self {
            Self::Info => 2,
            Self::Warning => 3,
            Self::Error => 4,
        }
    }
}

/// Something to record.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the table in the module's head says what each is")]
pub enum Entry<'a> {
    Telemetry(&'a Telemetry),
    Pose(&'a TimedPose),
    Command(&'a Command),
    Request(Request),
    Gains(&'a Gains),
    Identity(&'a Identity),
    Answer(&'a Answer),
    Link(&'a LinkRecord),
    Log(Level, &'a str),
}

/// Topic and schema name of each entry, in the order of the channels.
const TOPICS: [(&str, &str); 9] = [
    ("/telemetry", "quadlab.Telemetry"),
    ("/pose", "quadlab.TimedPose"),
    ("/command", "quadlab.Command"),
    ("/request", "quadlab.Request"),
    ("/gains", "quadlab.Gains"),
    ("/identity", "quadlab.Identity"),
    ("/answer", "quadlab.Answer"),
    ("/link", "quadlab.Link"),
    ("/log", "foxglove.Log"),
];

impl Entry<'_> {
    fn channel(&self) -> usize {
        match self {
            Self::Telemetry(_) => 0,
            Self::Pose(_) => 1,
            Self::Command(_) => 2,
            Self::Request(_) => 3,
            Self::Gains(_) => 4,
            Self::Identity(_) => 5,
            Self::Answer(_) => 6,
            Self::Link(_) => 7,
            Self::Log(..) => 8,
        }
    }

    /// Its JSON, numbers with the fewest digits that give them back. Serialising plain data does not fail.
    fn json(&self, log_ns: u64) -> String {
        fn of(value: &impl Serialize) -> String {
            serde_json::to_string(value).unwrap_or_else(|_| "{}".into())
        }
        match self {
            Self::Telemetry(telemetry) => of(telemetry),
            Self::Pose(pose) => of(pose),
            Self::Command(command) => of(command),
            Self::Request(request) => of(&json!({ "request": request })),
            Self::Gains(gains) => of(gains),
            Self::Identity(identity) => of(identity),
            Self::Answer(answer) => of(answer),
            Self::Link(link) => of(link),
            Self::Log(level, message) => of(&json!({
                "timestamp": { "sec": log_ns / 1_000_000_000, "nsec": log_ns % 1_000_000_000 },
                "level": level.number(),
                "message": message,
                "name": "ground",
                "file": "",
                "line": 0,
            })),
        }
    }
}

/// A message of each topic with every field in it, to draw the schemas from.
fn samples() -> [Value; 9] {
    let pose = Pose { position_m: [0.5; 3], attitude_rad: [0.5; 3] };
    let telemetry = Telemetry {
        tick: 0,
        craft_us: 0,
        ground_us: 0,
        supervision: Supervision { state: State::Disarmed, conditions: 0, preflight: 0 },
        mode: Mode::Position,
        attitude_command_rad: [0.5; 3],
        z_command_m: 0.5,
        tracked: pose,
        tracked_rates_rad_s: [0.5; 3],
        imu: Some(ImuSample {
            gyro_rad_s: [0.5; 3],
            attitude_rad: Some([0.5; 3]),
            acceleration_m_s2: Some([0.5; 3]),
        }),
        thrust: 0.5,
        torque: [0.5; 3],
        pwm: [0.5; 4],
        refused: Refusal::default(),
        battery_v: 0.5,
        current_a: Some(0.5),
        counters: Counters::default(),
    };
    let command = Command {
        mode: Mode::Position,
        attitude_rad: [0.5; 2],
        yaw_rad: 0.5,
        z_m: 0.5,
        position_m: [0.5; 2],
        cut_off: true,
        injection: [0.5; 4],
    };
    let identity = Identity {
        versions: [0; 2],
        program: [0; 3],
        vehicle_sha256: [0; 32],
        accepts_from: 0,
        state: State::Disarmed,
    };
    let link = LinkRecord {
        one_way_s: 0.5,
        least_one_way_s: 0.5,
        skew: 0.5,
        skew_std_error: 0.5,
        tick_hz: 0.5,
        lost_down: 0.5,
        lost_up: 0.5,
        pose_hz: 0.5,
    };
    [
        Entry::Telemetry(&telemetry),
        Entry::Pose(&TimedPose { frame: 0, ground_us: 0, pose }),
        Entry::Command(&command),
        Entry::Request(Request::Arm),
        Entry::Gains(&Gains { of: Loop::Roll, kp: 0.5, ki: 0.5, kd: 0.5 }),
        Entry::Identity(&identity),
        Entry::Answer(&Answer { to: 0, done: true, preflight: 0 }),
        Entry::Link(&link),
        Entry::Log(Level::Info, "words"),
    ]
    .map(|entry| serde_json::from_str(&entry.json(0)).unwrap_or_default())
}

/// The JSON schema of values like this one. Every number may be `null`, since JSON has no other word for one that is none.
fn schema(title: &str, sample: &Value) -> Value {
    fn kind(value: &Value) -> Value {
        match value {
            Value::Object(fields) => {
                let properties: serde_json::Map<String, Value> =
                    fields.iter().map(|(name, value)| (name.clone(), kind(value))).collect();
                json!({ "type": "object", "properties": properties })
            }
            Value::Array(items) => {
                json!({ "type": "array", "items": items.first().map_or(json!({}), kind) })
            }
            Value::Number(number) if number.is_f64() => json!({ "type": "number" }),
            Value::Number(_) => json!({ "type": "integer" }),
            Value::Bool(_) => json!({ "type": "boolean" }),
            Value::String(_) => json!({ "type": "string" }),
            Value::Null => json!({}),
        }
    }
    let mut schema = kind(sample);
    if let Value::Object(fields) = &mut schema {
        fields.insert("title".into(), title.into());
        fields.insert("$schema".into(), "https://json-schema.org/draft/2020-12/schema".into());
    }
    schema
}

/// A recording that runs.
pub struct Recorder {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: Vec<u16>,
    sequences: [u32; TOPICS.len()],
    /// Wall clock at the ground's time zero, ns since 1970.
    epoch_ns: u64,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("path", &self.path).finish_non_exhaustive()
    }
}

/// The file that a recording of this name grows in.
pub fn part_of(name: &Path) -> PathBuf {
    with_ending(name, ".mcap.part")
}

fn with_ending(name: &Path, ending: &str) -> PathBuf {
    let mut path = name.as_os_str().to_owned();
    path.push(ending);
    path.into()
}

impl Recorder {
    /// Begins `NAME.mcap.part`; its first line of `/log` says what it is `about`.
    ///
    /// # Errors
    /// A recording of that name that is there, finished or not; a folder that cannot be written.
    pub fn begin(name: &Path, epoch_ns: u64, about: &BTreeMap<String, String>) -> Result<Self, RecordError> {
        let path = part_of(name);
        if let Some(there) = [with_ending(name, ".mcap"), path.clone()].into_iter().find(|p| p.exists()) {
            return Err(RecordError::Exists(there));
        }
        if let Some(folder) = name.parent().filter(|p| !p.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(|source| RecordError::File {
                path: folder.into(),
                what: "make the folder",
                source,
            })?;
        }
        let file = File::create_new(&path).map_err(|source| RecordError::File {
            path: path.clone(),
            what: "begin the recording",
            source,
        })?;
        let refuse = |source| mcap_error(&path, "begin the recording")(source);
        let (mut writer, channels) =
            begin_mcap(BufWriter::new(file), WriteOptions::new().use_chunks(false)).map_err(refuse)?;
        writer.flush().map_err(refuse)?;
        let mut recorder =
            Self { path: path.clone(), writer, channels, sequences: [0; TOPICS.len()], epoch_ns };
        if !about.is_empty() {
            let words: Vec<String> = about.iter().map(|(name, value)| format!("{name} {value}")).collect();
            recorder.write(0, &Entry::Log(Level::Info, &words.join(", ")))?;
        }
        Ok(recorder)
    }

    /// Records something at this time of the ground's clock. It is with the system when this returns.
    ///
    /// # Errors
    /// A disk that is full or gone.
    pub fn write(&mut self, now_us: u64, entry: &Entry<'_>) -> Result<(), RecordError> {
        let channel = entry.channel();
        let log_time = self.epoch_ns.saturating_add(now_us.saturating_mul(1000));
        let header = MessageHeader {
            channel_id: self.channels.get(channel).copied().unwrap_or_default(),
            sequence: self.sequences[channel],
            log_time,
            publish_time: log_time,
        };
        self.sequences[channel] = self.sequences[channel].wrapping_add(1);
        let data = entry.json(log_time);
        let written = self.writer.write_to_known_channel(&header, data.as_bytes());
        written.and_then(|()| self.writer.flush()).map_err(mcap_error(&self.path, "write to the recording"))
    }

    /// The file that grows.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

fn mcap_error<'a>(path: &'a Path, what: &'static str) -> impl FnOnce(mcap::McapError) -> RecordError + 'a {
    move |source| RecordError::Mcap { path: path.into(), what, source: Box::new(source) }
}

/// A log with its channels, which have the same numbers in all.
fn begin_mcap<W: Write + std::io::Seek>(
    file: W,
    options: WriteOptions,
) -> mcap::McapResult<(Writer<W>, Vec<u16>)> {
    let library = concat!("quadlab ", env!("CARGO_PKG_VERSION"));
    let mut writer = options.compression(None).library(library).create(file)?;
    let mut channels = Vec::new();
    for ((topic, name), sample) in TOPICS.iter().zip(samples()) {
        let schema = writer.add_schema(name, "jsonschema", schema(name, &sample).to_string().as_bytes())?;
        channels.push(writer.add_channel(schema, topic, "json", &BTreeMap::new())?);
    }
    Ok((writer, channels))
}

/// A message of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Logged {
    /// Its topic.
    pub topic: String,
    /// ns since 1970.
    pub log_time_ns: u64,
    /// What it says.
    pub value: Value,
}

/// Reads a log, finished or not, up to where it was cut off; each message goes to `each`.
///
/// # Errors
/// A file that cannot be read, or whose first bytes are no MCAP.
pub fn read_log(
    path: &Path,
    mut each: impl FnMut(Logged) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    for_each_message(path, |message| {
        let Ok(value) = serde_json::from_slice(&message.data) else { return Ok(()) };
        each(Logged { topic: message.channel.topic.clone(), log_time_ns: message.log_time, value })
    })
}

fn for_each_message(
    path: &Path,
    mut each: impl FnMut(&mcap::Message<'_>) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    let refuse = |source| RecordError::File { path: path.into(), what: "read the recording", source };
    let file = BufReader::new(File::open(path).map_err(refuse)?);
    let options = LinearReaderOptions::default().with_skip_end_magic(true);
    for message in mcap::io::MessageReader::new_with_options(file, options) {
        match message {
            Ok(message) => each(&message)?,
            Err(error @ mcap::McapError::BadMagic) => {
                return Err(mcap_error(path, "read the recording")(error));
            }
            // Cut off in the middle of a record: the end.
            Err(_) => break,
        }
    }
    Ok(())
}

/// What a recording has become.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Finished {
    /// The log.
    pub mcap: PathBuf,
    /// The flights in it.
    pub flights: Vec<PathBuf>,
    /// Messages in the log.
    pub messages: u64,
}

/// Finishes the recording of this name: `NAME.mcap.part` becomes `NAME.mcap` and flight files.
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
    let file = File::create(&temporary).map_err(refuse(&temporary, "write the log"))?;
    let mcap_refuses = |source| mcap_error(&temporary, "write the log")(source);
    let (mut writer, _) =
        begin_mcap(BufWriter::new(file), WriteOptions::new().use_chunks(true)).map_err(mcap_refuses)?;
    let mut flights = crate::flights::Cutter::default();
    let mut messages = 0;
    for_each_message(&part, |message| {
        writer.write(message).map_err(|source| mcap_error(&temporary, "write the log")(source))?;
        messages += 1;
        if message.channel.topic == TOPICS[0].0
            && let Ok(telemetry) = serde_json::from_slice::<Value>(&message.data)
        {
            flights.push(&telemetry);
        }
        Ok(())
    })?;
    writer.finish().map_err(|source| mcap_error(&temporary, "write the log")(source))?;
    let written = writer.into_inner().into_inner().map_err(std::io::IntoInnerError::into_error);
    written.and_then(|file| file.sync_all()).map_err(refuse(&temporary, "write the log"))?;
    let mut finished = Finished { mcap: mcap.clone(), flights: Vec::new(), messages };
    for (k, flight) in flights.finish().iter().enumerate() {
        let path = with_ending(name, &format!("-{}.csv", k + 1));
        report::write_atomic(&path, flight.to_csv())?;
        finished.flights.push(path);
    }
    fs::rename(&temporary, &mcap).map_err(refuse(&mcap, "rename the log"))?;
    fs::remove_file(&part).map_err(refuse(&part, "remove the part"))?;
    Ok(finished)
}

#[cfg(test)]
mod tests {
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
            recorder.write(u64::from(tick) * 10_000, &Entry::Telemetry(&telemetry(tick))).unwrap();
        }
        recorder
    }

    fn ticks_in(path: &Path) -> Vec<u64> {
        let mut ticks = Vec::new();
        read_log(path, |logged| {
            ticks.push(logged.value["tick"].as_u64().unwrap());
            Ok(())
        })
        .unwrap();
        ticks
    }

    #[test]
    fn a_recording_becomes_a_log_and_flight_files() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a.b");
        let mut recorder = record(&name, 120);
        recorder.write(1_200_000, &Entry::Log(Level::Warning, "link late")).unwrap();
        drop(recorder);
        let finished = finish(&name).unwrap();
        assert_eq!(finished.messages, 121);
        assert!(!part_of(&name).exists());
        let [flight] = &finished.flights[..] else { panic!("{finished:?}") };
        let flight = flights::Flight::read(flight).unwrap();
        // Flying from tick 10 on, in the air from 20 to 109.
        assert_eq!(flight.len(), 90);
        assert_eq!(flight.column(flights::Column::T).unwrap()[89], 0.89);
        assert!(matches!(Recorder::begin(&name, 0, &BTreeMap::new()), Err(RecordError::Exists(_))));
    }

    /// With the crate's own summary reader: topics, encodings and schemas are those of a file that viewers open by its index.
    #[test]
    fn the_log_is_indexed_and_each_message_fits_its_schema() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a");
        let mut recorder = record(&name, 5);
        for sample in 0..3 {
            recorder.write(sample, &Entry::Request(Request::Land)).unwrap();
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
            let fields: Vec<_> = value.as_object().unwrap().keys().collect();
            let known: Vec<_> = schema["properties"].as_object().unwrap().keys().collect();
            assert_eq!(fields, known);
            assert_eq!(value["battery_v"].as_f64().unwrap_or(0.1), 0.1, "not 0.10000000149011612");
            assert_eq!(schema["type"], "object", "viewers ask for an object");
        }
    }

    #[test]
    fn a_recording_cut_off_anywhere_keeps_all_that_came_before() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole");
        let mut ends = Vec::new();
        let mut recorder = Recorder::begin(&whole, 0, &BTreeMap::new()).unwrap();
        for tick in 0..30 {
            recorder.write(u64::from(tick), &Entry::Telemetry(&telemetry(tick))).unwrap();
            // What a kill would leave: nothing is held back.
            ends.push(fs::metadata(recorder.path()).unwrap().len() as usize);
        }
        let bytes = fs::read(recorder.path()).unwrap();
        assert_eq!(bytes.len(), *ends.last().unwrap());
        let before = ends[0] - (ends[1] - ends[0]);
        for (k, length) in (before..bytes.len()).step_by(61).enumerate() {
            let name = folder.path().join(format!("cut{k}"));
            fs::write(part_of(&name), &bytes[..length]).unwrap();
            let expected = ends.iter().filter(|end| **end <= length).count();
            assert_eq!(finish(&name).unwrap().messages, expected as u64, "cut at {length}");
        }
        assert_eq!(ticks_in(recorder.path()), (0..30).collect::<Vec<_>>());
    }

    #[test]
    fn numbers_that_are_none_are_null_and_read_back_as_missing() {
        let mut told = telemetry(0);
        told.tracked.position_m[1] = f32::NAN;
        let value: Value = serde_json::from_str(&Entry::Telemetry(&told).json(0)).unwrap();
        assert_eq!(value["tracked"]["position_m"][1], Value::Null);
        assert_eq!(value["supervision"]["state"], "Disarmed");
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
