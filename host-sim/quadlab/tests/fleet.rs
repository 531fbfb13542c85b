//! `quadlab fleet` as a user runs it: read once, asked often, killed in the middle.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use common::{done_in, flights, json_in, run_in, shared};

/// A fleet of two craft: the five flights of the demo, and pieces of them.
fn fleet() -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    for craft in ["one", "two"] {
        let folder = root.path().join("fleet").join(craft);
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::copy(flights().join("vehicle.toml"), folder.join("vehicle.toml")).unwrap();
        for (day, name) in ["A", "B", "C", "D", "E"].iter().enumerate() {
            let text = std::fs::read_to_string(flights().join(format!("{name}.csv"))).unwrap();
            let (header, rows) = text.split_once('\n').unwrap();
            let rows: Vec<&str> = rows.lines().collect();
            let own = if craft == "one" { &rows[..] } else { &rows[rows.len() / 2..] };
            let file = folder.join(format!("2026-03-{:02}.csv", day + 1));
            std::fs::write(file, format!("{header}\n{}\n", own.join("\n"))).unwrap();
        }
    }
    root
}

#[test]
fn a_fleet_is_read_once_and_its_documents_are_valid() {
    let root = fleet();
    let first =
        json_in(root.path(), &["fleet", "fleet", "--no-causes", "--html", "fleet.html", "--out", "tables"]);
    schemas::assert_valid("fleet", &first);
    assert_eq!((first["read_now"].as_u64(), first["crafts"].as_array().unwrap().len()), (Some(10), 2));
    for craft in first["crafts"].as_array().unwrap() {
        assert_eq!((craft["flights"].as_u64(), craft["changes"].as_array().unwrap().len()), (Some(5), 0));
        assert_eq!(craft["span"][0]["date"], "2026-03-01 00:00");
    }
    let page = std::fs::read_to_string(root.path().join("fleet.html")).unwrap();
    assert!(page.contains("thrust.C_T") && page.contains("<svg"));
    for name in ["flights", "histories", "changes"] {
        assert!(root.path().join(format!("tables/{name}.csv")).exists());
    }
    let table = std::fs::read(root.path().join("tables/histories.parquet")).unwrap();
    let table = table::Table::from_parquet(table).unwrap();
    assert!(table.rows() > 100 && table.real("std_error").is_some());
    // The second time nothing is read, and pages and tables are not overwritten unasked.
    let mut again = json_in(root.path(), &["fleet", "fleet", "--no-causes"]);
    assert_eq!(again["read_now"].as_u64(), Some(0));
    again["read_now"] = first["read_now"].clone();
    assert_eq!(again, first);
    let refused = run_in(root.path(), &["fleet", "fleet", "--html", "fleet.html"]);
    assert_eq!(refused.status.code(), Some(2));
    let told = done_in(root.path(), &["fleet", "fleet", "--no-causes"]);
    assert!(told.starts_with("10 flights of 2 craft") && told.contains("No change is shown."), "{told}");
}

#[test]
fn what_cannot_be_asked_is_refused_in_one_line() {
    let root = fleet();
    done_in(root.path(), &["fleet", "fleet", "--no-causes"]);
    for (arguments, said) in [
        (&["fleet", "nowhere"][..], "nowhere: cannot be read"),
        (&["fleet", "tables"], "tables: no craft here"),
        (&["fleet", "fleet", "--craft", "three"], "no such craft; there are one, two"),
        (&["fleet", "fleet", "--leave-out", "x.csv"], "no such flight"),
        (&["fleet", "fleet", "--effects", "magic"], "magic"),
        (&["fleet", "fleet", "--effects", "slung-load"], "--effects slung-load: the index keeps nothing"),
        (&["fleet", "fleet", "--since", "soon"], "--since soon: is no date"),
        (&["fleet", "fleet", "--since", "2027-01-01"], "the flights are from 2026-03-01 00:00 to 2026-03-05"),
        (&["fleet", "fleet", "--out", "fleet/tables"], "lies in the fleet's folder"),
    ] {
        std::fs::create_dir_all(root.path().join("tables")).unwrap();
        let output = run_in(root.path(), arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {told}");
        assert!(told.contains(said) && told.trim().lines().count() == 1, "{arguments:?}: {told}");
    }
}

/// A craft's folder with some logs of the data, a day each, in this order.
fn flown_a_day_each(folder: &Path, data: &Path, logs: impl Iterator<Item = String>) {
    std::fs::create_dir_all(folder).unwrap();
    std::fs::copy(data.join("vehicle.toml"), folder.join("vehicle.toml")).unwrap();
    for (day, log) in logs.enumerate() {
        std::fs::copy(data.join(&log), folder.join(format!("2026-03-{:02}_{log}", day + 1))).unwrap();
    }
}

/// Two Crazyflies as CrazyPAD flew them, those flights first that nothing was done to; only those, or all.
fn crazyflies(root: &Path, data: &Path, only_normal: bool) {
    let mut logs: Vec<_> = std::fs::read_dir(data).unwrap().map(|entry| entry.unwrap().path()).collect();
    logs.sort_by_key(|path| (!path.to_string_lossy().contains("normal_flight"), path.clone()));
    for craft in ["E8", "E9"] {
        let name = |path: &std::path::PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        let own = logs.iter().map(name).filter(|name| {
            name.contains(&format!("__{craft}_")) && (!only_normal || name.contains("normal_flight"))
        });
        flown_a_day_each(&root.join("fleet").join(craft), data, own);
    }
}

/// Where nothing was done, nothing is said to have changed; one craft has a weight near a motor, then cut propellers.
#[test]
fn real_craft_change_when_something_was_done_to_them() {
    let Some(data) = shared("data/crazypad") else { return };
    let normal = tempfile::tempdir().unwrap();
    crazyflies(normal.path(), &data, true);
    let answer = json_in(normal.path(), &["fleet", "fleet"]);
    for craft in answer["crafts"].as_array().unwrap() {
        assert_eq!((craft["flights"].as_u64(), craft["changes"].as_array().unwrap().len()), (Some(8), 0));
    }
    let all = tempfile::tempdir().unwrap();
    crazyflies(all.path(), &data, false);
    let answer = json_in(all.path(), &["fleet", "fleet"]);
    schemas::assert_valid("fleet", &answer);
    let of = |craft: &str| {
        let crafts = answer["crafts"].as_array().unwrap();
        crafts.iter().find(|own| own["craft"] == craft).unwrap()["changes"].as_array().unwrap().clone()
    };
    let [change, cut] = &of("E9")[..] else { panic!("{:?}", of("E9")) };
    let from = |change: &serde_json::Value| change["from"]["flight"].as_str().unwrap().to_owned();
    assert!(from(change).contains("2026-03-09_motor__add_weight_W3_near_M3"), "{change}");
    assert!(from(cut).contains("2026-03-11_motor__cut_M2_1.5mm"), "{cut}");
    // A weight near a motor and a weaker motor are the same to these logs: no single cause is sure.
    let logs = &change["in_logs"];
    let is_sure = logs["confounded_with"].as_array().is_some_and(Vec::is_empty);
    assert!(change["causes_disagree"] == true || !is_sure, "{change}");
}

/// Pieces of the demo's flights: two hundred of half a second more each.
fn many(root: &Path) {
    let folder = root.join("fleet/quad");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::copy(flights().join("vehicle.toml"), folder.join("vehicle.toml")).unwrap();
    let text = std::fs::read_to_string(flights().join("A.csv")).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    for k in 0..200 {
        let first = (7 * k) % (rows.len() - 400);
        let own = rows[first..first + 400].join("\n");
        std::fs::write(folder.join(format!("{k:03}.csv")), format!("{header}\n{own}\n")).unwrap();
    }
}

#[test]
fn a_pass_that_is_killed_loses_nothing() {
    let root = tempfile::tempdir().unwrap();
    many(root.path());
    let of = |index: &'static str| ["fleet", "fleet", "--no-causes", "--index", index];
    let whole = done_in(root.path(), &of("whole.parquet"));
    let mut kills = 0;
    for round in 0..40_u64 {
        let mut run = Command::new(env!("CARGO_BIN_EXE_quadlab"))
            .args(of("killed.parquet"))
            .current_dir(root.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(300 + 217 * (round % 7)));
        if run.try_wait().unwrap().is_none() {
            kills += 1;
            run.kill().unwrap();
        }
        run.wait().unwrap();
        if root.path().join("killed.parquet").exists() {
            break;
        }
    }
    let killed = done_in(root.path(), &of("killed.parquet"));
    println!("{kills} kills");
    assert!(kills > 0);
    let bytes = |index: &str| std::fs::read(root.path().join(index)).unwrap();
    assert!(bytes("whole.parquet") == bytes("killed.parquet"), "the same bytes after {kills} kills");
    // But for how many were read now.
    let after = |text: &str| text.split_once(" read now.").map(|(_, rest)| rest.to_owned());
    assert_eq!(after(&killed), after(&whole));
}

/// What is said of a real craft that flew these logs, two legs each.
fn crazypad(data: &Path, craft: &str, logs: &[&str]) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let legs = logs.iter().flat_map(|log| {
        let (what, number) = log.split_once(' ').unwrap();
        [1, 2].map(|leg| format!("motor__{what}__{craft}_{number}_leg{leg}.csv"))
    });
    flown_a_day_each(folder.path(), data, legs);
    json_in(folder.path(), &["fleet", ".", "--no-causes"])["crafts"][0].clone()
}

/// Two flights after eight. The mean command falls and rises with the battery, by more than a weight of a few grams changes it.
#[test]
fn changes_of_real_craft_are_found_at_their_flight() {
    let Some(root) = shared("data/crazypad") else { return };
    let normal = ["normal_flight log00", "normal_flight log01", "normal_flight log02", "normal_flight log03"];
    let after = |craft: &str, changed: &[&str]| crazypad(&root, craft, &[&normal, changed].concat());
    for (craft, changed, motors) in [
        ("E8", "cut_M3_3mm_3mm_41mm log00", &[4][..]),
        ("E9", "add_weight_W3_near_M3 log00", &[4]),
        ("E9", "cut_M2_1.5mm_1.5mm_44mm_M1_1.5mm_1.5mm_44mm log03", &[1, 2]),
        ("E9", "cut_M2_3.5mm_3.5mm_40mm_M1_3.5mm_3.5mm_40mm log03", &[1]),
    ] {
        let answer = after(craft, &[changed]);
        let [event] = &answer["changes"].as_array().unwrap()[..] else { panic!("{changed}: {answer:#}") };
        let flight = event["from"]["flight"].as_str().unwrap();
        assert!(flight.contains("2026-03-09"), "{changed}: {flight}");
        let moved = event["moved"].as_array().unwrap();
        for motor in motors {
            let share = format!("share of motor {motor} in the mean command");
            assert!(moved.iter().any(|own| own["series"] == share), "{changed}: {moved:#?}");
        }
    }
    for (craft, unchanged) in
        [("E8", &["tape_on_M3 log00", "tape_on_M3 log01"][..]), ("E8", &[]), ("E9", &[])]
    {
        let answer = after(craft, unchanged);
        assert_eq!(answer["changes"].as_array().unwrap().len(), 0, "{craft} {unchanged:?}: {answer:#}");
    }
}
