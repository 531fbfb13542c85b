//! A log from file to flights, with what is told of it on the way.

use std::path::{Path, PathBuf};

use bytes::Bytes;
use flights::{Column, ColumnMap};

use crate::clocks::{self, ClockPair};
use crate::conversion::{Part, convert};
use crate::decode::{decode_text, decode_watched};
use crate::error::{LogError, plain};
use crate::format::Format;
use crate::log::{Log, Losses, Table, TimeUnit};
use crate::progress::{Progress, REPORTED_BYTES, UNWATCHED, Watch};
use crate::recording::{Hints, Recording};
use crate::sources::{OwnFlight, own_flights, record};
use crate::tables::{self, FlightOfTable};

/// How much of a file tells its format.
const HEAD_BYTES: usize = 4096;

/// What was found in a log, and the flights made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Import {
    /// The file.
    pub path: PathBuf,
    /// Its format.
    pub format: Format,
    /// The program that wrote it.
    pub firmware: Option<String>,
    /// Kinds of messages.
    pub messages: Vec<Messages>,
    /// Which of them became which quantity.
    pub sources: Sources,
    /// Every pair of clocks that stamp the same rows.
    pub clocks: Vec<ClockPair>,
    /// The flights.
    pub flights: Vec<Part>,
    /// What the log says about the craft.
    pub hints: Hints,
    /// What was lost or damaged.
    pub losses: Losses,
    /// What this log cannot tell, a sentence each.
    pub limits: Vec<String>,
    /// What was done to it, a sentence each.
    pub notes: Vec<String>,
}

/// How many messages of a kind there are, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct Messages {
    /// The format's own name.
    pub name: String,
    /// Rows.
    pub count: usize,
    /// Times of the first and the last row in the unit that the format counts in; nothing where rows have no times.
    pub first_last: Option<[f64; 2]>,
}

/// The format's own name of what became each quantity; nothing where it is not logged.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Sources {
    /// Position.
    pub position: Option<String>,
    /// Attitude.
    pub attitude: Option<String>,
    /// Body rates.
    pub rates: Option<String>,
    /// Specific force.
    pub specific_force: Option<String>,
    /// Motor commands.
    pub commands: Option<String>,
    /// Rotor speeds.
    pub rotor_speed: Option<String>,
    /// Battery voltage.
    pub voltage: Option<String>,
}

/// The format of a file if it is a log; nothing for flight files and what cannot be read.
pub fn format_of(path: &Path) -> Option<Format> {
    use std::io::Read as _;
    let mut head = Vec::new();
    std::fs::File::open(path).ok()?.take(HEAD_BYTES as u64).read_to_end(&mut head).ok()?;
    Format::of(&head)
}

/// The path that stands for standard input.
pub const STANDARD_INPUT: &str = "-";

/// All bytes of standard input.
pub fn read_standard_input() -> Result<Vec<u8>, LogError> {
    use std::io::Read as _;
    let mut bytes = Vec::new();
    let read = std::io::stdin().lock().read_to_end(&mut bytes);
    read.map_err(|source| LogError::Read { path: STANDARD_INPUT.into(), source })?;
    Ok(bytes)
}

/// Reads a log, `-` for standard input, and makes flights of it. Tables of other programs are read through `map`.
pub fn import(path: &Path, map: &ColumnMap) -> Result<Import, LogError> {
    import_watched(path, map, UNWATCHED)
}

/// The same, and tells who watches how far it is.
pub fn import_watched(path: &Path, map: &ColumnMap, watch: Watch<'_>) -> Result<Import, LogError> {
    let bytes = if path == Path::new(STANDARD_INPUT) {
        watch(Progress { stage: "reading", bytes: None });
        read_standard_input()?
    } else {
        read_file(path, watch).map_err(|source| LogError::Read { path: path.into(), source })?
    };
    bytes_watched(bytes.into(), path, map, watch)
}

fn read_file(path: &Path, watch: Watch<'_>) -> std::io::Result<Vec<u8>> {
    use std::io::Read as _;
    let mut file = std::fs::File::open(path)?;
    let all = usize::try_from(file.metadata()?.len()).unwrap_or(usize::MAX);
    let mut bytes = Vec::new();
    // A file that cannot be held is the reader's to refuse.
    let _ = bytes.try_reserve_exact(all);
    loop {
        watch(Progress { stage: "reading", bytes: Some((bytes.len(), all)) });
        if file.by_ref().take(REPORTED_BYTES as u64).read_to_end(&mut bytes)? == 0 {
            return Ok(bytes);
        }
    }
}

/// Makes flights of the bytes of a log; `path` is for messages and gives the flights their names.
pub fn import_bytes(bytes: impl Into<Bytes>, path: &Path, map: &ColumnMap) -> Result<Import, LogError> {
    bytes_watched(bytes.into(), path, map, UNWATCHED)
}

/// The bytes are given up once they are decoded.
fn bytes_watched(bytes: Bytes, path: &Path, map: &ColumnMap, watch: Watch<'_>) -> Result<Import, LogError> {
    if matches!(Format::of(&bytes), None | Some(Format::Csv)) && tables::is_text(&bytes) {
        return import_text(&bytes, path, map);
    }
    let log = decode_watched(&bytes, path, watch)?;
    drop(bytes);
    watch(Progress { stage: "making flights", bytes: None });
    if log.format == Format::Parquet && (map.says_something() || tables::has_usual_names(&log)) {
        return Ok(of_table(tables::of_parquet(&log, path, map)?, path));
    }
    if let Some(flights) = own_flights(&log, path)? {
        return Ok(own(log, flights, path));
    }
    let recordings = record(&log, path)?;
    Ok(imported(log, recordings, path))
}

/// How the list of a ROS 2 bag's files begins, which lies beside them.
const LIST_OF_BAG: &[u8] = b"rosbag2_bagfile_information:";

/// Text is a flight file under whatever names, unless a program is known by them.
fn import_text(bytes: &[u8], path: &Path, map: &ColumnMap) -> Result<Import, LogError> {
    if bytes.starts_with(LIST_OF_BAG) {
        return Err(LogError::Format {
            path: path.into(),
            what: "only lists the files of a ROS 2 bag".into(),
            mend: "give the .db3 or .mcap file beside it".into(),
        });
    }
    if map.says_something() {
        return Ok(of_table(tables::of_text(bytes, path, map)?, path));
    }
    match decode_text(bytes, path)? {
        Some(log) => {
            let recordings = record(&log, path)?;
            Ok(imported(log, recordings, path))
        }
        None => Ok(of_table(tables::of_text(bytes, path, map)?, path)),
    }
}

fn of_table(table: FlightOfTable, path: &Path) -> Import {
    let sources = Sources {
        position: table.source(&["x", "z"]),
        attitude: table.source(&["phi", "qw"]),
        rates: table.source(&["p"]),
        specific_force: table.source(&["ax"]),
        commands: table.source(&["cmd1"]),
        rotor_speed: table.source(&["omega1"]),
        voltage: table.source(&["vbat"]),
    };
    let (format, limits) = (table.format, table.limits());
    let mut part = table.into_part();
    name(std::slice::from_mut(&mut part), path);
    let messages = Messages { name: "rows".into(), count: part.flight.len(), first_last: Some(part.span) };
    Import {
        path: path.into(),
        format,
        firmware: None,
        messages: vec![messages],
        sources,
        clocks: Vec::new(),
        flights: vec![part],
        hints: Hints::default(),
        losses: Losses::default(),
        limits,
        notes: Vec::new(),
    }
}

fn imported(log: Log, recordings: Vec<Recording>, path: &Path) -> Import {
    let first = recordings.first();
    let sources = first.map_or_else(Sources::default, Sources::of);
    let hints = first.map_or_else(Hints::default, |recording| recording.hints.clone());
    // The tables of the log are given up before flights are made, and each recording when its flights are.
    let mut import = Import { sources, hints, ..Import::of(log, path) };
    for recording in recordings {
        let (made, left_out) = convert(&recording);
        import.flights.extend(made);
        add_new(&mut import.limits, recording.limits.into_iter());
        add_new(&mut import.notes, recording.notes.into_iter().chain(left_out));
    }
    name(&mut import.flights, path);
    import
}

/// Of quadlab's own recording, whose rows are in its frames and units already.
fn own(log: Log, flights: Vec<OwnFlight>, path: &Path) -> Import {
    let has = |column| flights.iter().any(|own| own.flight.column(column).is_some());
    let field = |name: &str| Some(format!("/telemetry {name}"));
    let sources = Sources {
        position: field("tracked.position_m"),
        attitude: field("tracked.attitude_rad"),
        rates: field(if log.telemetry.iter().any(|row| row.imu.is_some()) {
            "imu.gyro_rad_s"
        } else {
            "tracked_rates_rad_s"
        }),
        specific_force: has(Column::Ax).then(|| field("imu.acceleration_m_s2")).flatten(),
        commands: field("pwm"),
        rotor_speed: None,
        voltage: field("battery_v"),
    };
    let notes = vec!["is a recording of quadlab's own ground station: its rows are taken as they are".into()];
    let mut flights: Vec<Part> = flights.into_iter().map(Part::of_own).collect();
    name(&mut flights, path);
    Import { sources, notes, flights, ..Import::of(log, path) }
}

/// Flights of one file have its name, and are numbered where there are several.
fn name(flights: &mut [Part], path: &Path) {
    let stem = match path.file_stem() {
        Some(stem) if path != Path::new(STANDARD_INPUT) => stem.to_string_lossy().into_owned(),
        _ => "log".to_owned(),
    };
    let several = flights.len() > 1;
    for (index, part) in flights.iter_mut().enumerate() {
        part.flight.name = if several { format!("{stem}-{}.csv", index + 1) } else { format!("{stem}.csv") };
    }
}

impl Import {
    /// What a log says without knowing which program wrote it, and no flights yet.
    fn of(log: Log, path: &Path) -> Self {
        Self {
            path: path.into(),
            format: log.format,
            clocks: clocks::pairs(&log),
            messages: log.tables.iter().map(|table| Messages::of(table, log.format)).collect(),
            firmware: log.firmware,
            sources: Sources::default(),
            flights: Vec::new(),
            hints: Hints::default(),
            losses: log.losses,
            limits: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// Sentences that are not there yet: recordings of one file mostly lack the same.
fn add_new(told: &mut Vec<String>, sentences: impl Iterator<Item = String>) {
    const LONGEST: usize = 600;
    for sentence in sentences {
        let sentence = plain(&sentence, LONGEST);
        if !told.contains(&sentence) {
            told.push(sentence);
        }
    }
}

impl Messages {
    fn of(table: &Table, format: Format) -> Self {
        // A Crazyflie's clock counts microseconds; its own decoder shows milliseconds.
        let shown_as = match (format, table.time_unit) {
            (Format::Crazyflie, TimeUnit::Microseconds) if table.name != "(only)" => 1e3,
            _ => 1.0,
        };
        let ends = table.times.first().zip(table.times.last());
        let first_last = ends.map(|(first, last)| [*first as f64 / shown_as, *last as f64 / shown_as]);
        Self { name: table.name.clone(), count: table.rows, first_last }
    }
}

impl Sources {
    fn of(recording: &Recording) -> Self {
        let signals = &recording.signals;
        // A file of several logs names the log before the field.
        let bare = |source: &str| source.rsplit_once(": ").map_or(source, |(_, field)| field).to_owned();
        Self {
            position: signals.position.as_ref().map(|s| bare(&s.source)),
            attitude: signals.attitude.as_ref().map(|s| bare(&s.source)),
            rates: signals.rates.as_ref().map(|s| bare(&s.source)),
            specific_force: signals.specific_force.as_ref().map(|s| bare(&s.source)),
            commands: signals.commands.as_ref().map(|s| bare(&s.source)),
            rotor_speed: signals.rotor_speed.as_ref().map(|s| bare(&s.source)),
            voltage: signals.voltage.as_ref().map(|s| bare(&s.source)),
        }
    }
}
