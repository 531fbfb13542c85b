//! Logs of other programs through the program: what an import finds and makes, and answers straight from logs.

mod common;

use std::path::{Path, PathBuf};

use common::{run_in, shared};
use serde_json::Value;

/// The logs of the shared data with what their own decoders find in them.
fn logs() -> Vec<(PathBuf, Value)> {
    let Some(folder) = shared("data/logs") else { return Vec::new() };
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let all: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    all.into_iter().map(|(name, expected)| (folder.join(name), expected)).collect()
}

fn imported(folder: &Path, log: &Path, out: &str) -> (Option<i32>, Value, String) {
    let output = run_in(folder, &["import", log.to_str().unwrap(), "--out", out, "--json"]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    let document = serde_json::from_slice(&output.stdout).unwrap_or_else(|why| panic!("{why}: {stderr}"));
    (output.status.code(), document, stderr)
}

/// Name, count, first and last time of each kind of message as the format's own decoder has them.
fn expected_messages(expected: &Value) -> Vec<(String, u64, Option<[f64; 2]>)> {
    let ends = |entry: &Value| {
        let of = |which: &str| {
            ["", "_us", "_ms", "_ns"].iter().find_map(|unit| entry[&format!("{which}{unit}")].as_f64())
        };
        Some([of("first")?, of("last")?])
    };
    let tables = ["topics", "types", "events"].iter().find_map(|key| expected[*key].as_object());
    if let Some(tables) = tables {
        let counted =
            |(name, entry): (&String, &Value)| (name.clone(), entry["count"].as_u64().unwrap(), ends(entry));
        return tables.iter().map(counted).collect();
    }
    let logs = expected["logs"].as_array().map_or(&[][..], Vec::as_slice);
    logs.iter()
        .map(|log| (format!("log {}", log["index"]), log["rows"].as_u64().unwrap(), ends(log)))
        .collect()
}

#[test]
fn an_import_finds_what_the_formats_own_decoders_find() {
    let folder = tempfile::tempdir().unwrap();
    for (log, expected) in logs() {
        let (status, document, stderr) = imported(folder.path(), &log, "out");
        let entry = &document["logs"][0];
        assert_eq!(entry["format"], expected["format"], "{log:?}");
        let refused = entry["refused"].is_string();
        assert_eq!(
            status,
            Some(if refused && entry["sources"].is_null() { 2 } else { 0 }),
            "{log:?}: {stderr}"
        );
        if entry["sources"].is_null() {
            assert!(stderr.lines().count() == 1 && stderr.len() < 400, "{log:?}: {stderr}");
            assert!(stderr.contains(log.to_str().unwrap()), "{stderr}");
            continue;
        }
        let messages = entry["messages"].as_object().unwrap();
        for (name, count, ends) in expected_messages(&expected) {
            // A log of a file without a row has no message.
            let Some(found) = messages.get(&name).or((count == 0).then_some(&Value::Null)) else {
                panic!("{log:?}: no {name} among {:?}", messages.keys())
            };
            assert_eq!(found["count"].as_u64().unwrap_or(0), count, "{log:?}: {name}");
            if let (Some(ends), true) = (ends, count > 0) {
                let found = ["first", "last"].map(|which| found[which].as_f64().unwrap());
                assert_eq!(found, ends, "{log:?}: {name}");
            }
        }
        if let Some(sources) = expected["flight_format"].as_object() {
            for (quantity, source) in sources {
                assert_eq!(entry["sources"][quantity], *source, "{log:?}: {quantity}");
            }
        }
        for flight in entry["flights"].as_array().unwrap() {
            let rows = std::fs::read_to_string(folder.path().join(flight["file"].as_str().unwrap())).unwrap();
            assert_eq!(rows.lines().count() as u64, flight["rows"].as_u64().unwrap() + 1, "{log:?}");
        }
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
}

#[test]
fn an_import_writes_the_same_bytes_each_time_and_over_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let Some((log, _)) = logs().into_iter().find(|(log, _)| log.ends_with("px4_quadrotor.ulg")) else {
        return;
    };
    let read = |out: &str| {
        ["px4_quadrotor.csv", "vehicle.toml"]
            .map(|name| std::fs::read(folder.path().join(out).join(name)).unwrap())
    };
    assert_eq!(imported(folder.path(), &log, "first").0, Some(0));
    assert_eq!(imported(folder.path(), &log, "second").0, Some(0));
    assert!(read("first") == read("second"), "two imports of one log differ");
    let again = run_in(folder.path(), &["import", log.to_str().unwrap(), "--out", "first"]);
    let stderr = String::from_utf8(again.stderr).unwrap();
    assert!(again.status.code() == Some(2) && stderr.contains("--force"), "{stderr}");
    // What an operator has measured is not written over.
    let vehicle = folder.path().join("first/vehicle.toml");
    std::fs::write(&vehicle, "name = \"mine\"\n").unwrap();
    std::fs::remove_file(folder.path().join("first/px4_quadrotor.csv")).unwrap();
    assert_eq!(imported(folder.path(), &log, "first").0, Some(0));
    assert_eq!(std::fs::read_to_string(&vehicle).unwrap(), "name = \"mine\"\n");
}

/// No log of these was flown to identify a craft: an answer says so, and no model of nonsense is called one.
#[test]
fn explain_straight_on_a_log_answers_or_says_that_it_cannot() {
    let folder = tempfile::tempdir().unwrap();
    for (log, _) in logs() {
        let log = log.to_str().unwrap();
        let output = run_in(folder.path(), &["explain", log, "--out", "model.toml", "--force", "--json"]);
        let stderr = String::from_utf8_lossy(&output.stderr);
        println!("{log}: {:?}", output.status.code());
        match output.status.code() {
            Some(0 | 1) => {
                let document: Value = serde_json::from_slice(&output.stdout).unwrap();
                println!("  {}", document["summary"].as_str().unwrap());
            }
            Some(2) => {
                let last = stderr.lines().last().unwrap();
                println!("  {last}");
                assert!(last.starts_with("error: ") && last.len() < 500, "{log}: {stderr}");
            }
            status => panic!("{log}: {status:?}: {stderr}"),
        }
    }
}

#[test]
fn a_vehicle_file_is_made_of_a_log_and_says_what_to_measure() {
    let folder = tempfile::tempdir().unwrap();
    let Some((log, _)) = logs().into_iter().find(|(log, _)| log.ends_with("ardupilot_copter36_a.bin")) else {
        return;
    };
    let output = run_in(folder.path(), &["init", log.to_str().unwrap(), "--out", "vehicle.toml"]);
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("mass: weigh the craft ready to fly"), "{said}");
    let text = std::fs::read_to_string(folder.path().join("vehicle.toml")).unwrap();
    assert!(text.contains("command_unit = \"us\"") && text.contains("NOT MEASURED"), "{text}");
    // A command that uses it warns of what no one has measured.
    let explained = run_in(
        folder.path(),
        &["explain", log.to_str().unwrap(), "--vehicle", "vehicle.toml", "--out", "model.toml"],
    );
    assert!(String::from_utf8_lossy(&explained.stderr).contains("not been measured"));
}

#[test]
fn what_is_no_log_is_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str]| {
        let output = run_in(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    std::fs::write(folder.path().join("empty.ulg"), "").unwrap();
    assert!(refused(&["import", "empty.ulg", "--out", "out"]).contains("empty.ulg: is not in a log format"));
    assert!(refused(&["import", "none.ulg", "--out", "out"]).contains("none.ulg: cannot read the log"));
    std::fs::write(folder.path().join("cut.ulg"), b"ULog\x01\x12\x35").unwrap();
    assert!(refused(&["import", "cut.ulg", "--out", "out"]).starts_with("error: cut.ulg: "));
    std::fs::create_dir(folder.path().join("bare")).unwrap();
    assert!(
        refused(&["import", "bare", "--out", "out"])
            .contains("bare: no flight file (*.csv) and no log in this folder")
    );
}

/// Files that begin as a log of each format and go on with nothing, with the greatest lengths and counts, or with anything; and files
/// that begin as none.
#[test]
fn files_of_nothing_and_of_absurd_lengths_are_refused_with_a_sentence() {
    const MAGIC: [(&str, &[u8]); 9] = [
        ("a.ulg", b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0"),
        ("a.bin", &[0xa3, 0x95, 0x80]),
        ("a.log", b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"),
        ("a.bbl", b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n"),
        ("log01", &[0xbc, 2, 0]),
        ("a.bag", b"#ROSBAG V2.0\n"),
        ("a.mcap", b"\x89MCAP0\r\n\x01"),
        ("a.db3", b"SQLite format 3\0"),
        ("a.parquet", b"PAR1"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, what: &str, bytes: &[u8]| {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let started = std::time::Instant::now();
        let output = run_in(folder.path(), &["import", name, "--out", "out"]);
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}, {what}: {text}");
        assert!(text.starts_with(&format!("error: {name}: ")), "{name}, {what}: {text}");
        assert!(text.lines().count() == 1 && text.len() < 400, "{name}, {what}: {text}");
        assert!(started.elapsed().as_secs() < 2, "{name}, {what}: {:?}", started.elapsed());
        let written = std::fs::read_dir(folder.path().join("out")).map_or(0, Iterator::count);
        assert_eq!(written, 0, "{name}, {what}: files were written");
    };
    for (name, magic) in MAGIC {
        refused(name, "nothing", b"");
        refused(name, "zeros", &vec![0; 1_000_000]);
        refused(name, "another format", b"GIF89a\x01\x00\x01\x00\x80\x01\x00\xff\xff\xff");
        refused(name, "its beginning", magic);
        refused(name, "its beginning and zeros", &[magic, &[0; 10_000]].concat());
        // Each length or count that comes next is the greatest there is; then the greatest of 31 bits.
        refused(name, "the greatest numbers", &[magic, &[0xff; 10_000]].concat());
        refused(
            name,
            "the greatest numbers of 31 bits",
            &[magic, &[0xff, 0xff, 0xff, 0x7f].repeat(2500)].concat(),
        );
    }
    refused("a.parquet", "a footer of 4 GiB", &[b"PAR1", &[0; 100][..], &[0xff; 4], b"PAR1"].concat());
}
