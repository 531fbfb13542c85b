//! From the log of a running recording to an indexed log and flight files.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use logs::{FlightCutter, telemetry_from_json};
use mcap::WriteOptions;

use super::entry::TOPICS;
use super::error::{RecordError, mcap_error};
use super::log::{begin_mcap, for_each_message};
use super::recorder::{part_of, with_ending};

/// The files of a finished recording.
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
    let mut flights = FlightCutter::default();
    let mut messages = 0;
    for_each_message(&part, |message| {
        writer.write(message).map_err(|source| mcap_error(&temporary, "write the log")(source))?;
        messages += 1;
        if message.channel.topic == TOPICS[0].0
            && let Some(telemetry) = telemetry_from_json(&message.data)
        {
            flights.push(&telemetry);
        }
        Ok(())
    })?;
    writer.finish().map_err(|source| mcap_error(&temporary, "write the log")(source))?;
    let written = writer.into_inner().into_inner().map_err(std::io::IntoInnerError::into_error);
    written.and_then(|file| file.sync_all()).map_err(refuse(&temporary, "write the log"))?;
    let mut finished = Finished { mcap: mcap.clone(), flights: Vec::new(), messages };
    for (k, own) in flights.finish().iter().enumerate() {
        let path = with_ending(name, &format!("-{}.csv", k + 1));
        report::write_atomic(&path, own.flight.to_csv())?;
        finished.flights.push(path);
    }
    fs::rename(&temporary, &mcap).map_err(refuse(&mcap, "rename the log"))?;
    fs::remove_file(&part).map_err(refuse(&part, "remove the part"))?;
    Ok(finished)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proto::{Request, Telemetry};
    use serde_json::{Value, json};

    use super::super::entry::{Entry, Level};
    use super::super::log::read_log;
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

    /// With the crate's own summary reader: topics, encodings and schemas are those of a file that
    /// viewers open by its index.
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
            let known = schema["properties"].as_object().unwrap();
            assert!(value.as_object().unwrap().keys().all(|field| known.contains_key(field)), "{value}");
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
