//! `quadlab fleet` as a user runs it: read once, asked often, killed in the middle.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use common::{done_in, flights, json_in, run_in};

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
        (&["fleet", "fleet", "--since", "soon"], "--since soon: is no date"),
        (&["fleet", "fleet", "--out", "fleet/tables"], "lies in the fleet's folder"),
    ] {
        std::fs::create_dir_all(root.path().join("tables")).unwrap();
        let output = run_in(root.path(), arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {told}");
        assert!(told.contains(said) && told.trim().lines().count() == 1, "{arguments:?}: {told}");
    }
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
