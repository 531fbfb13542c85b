//! Flights and logs that no craft flies, through every command that reads them: one line and no more memory than the flight
//! is worth, whatever its clock says and however still it stands.

mod common;

use std::path::Path;
use std::process::{Command, Output};

use common::{copies, identify, with_sets};

/// Address space of a command, KiB: several times what the flights of these tests need.
const MOST_MEMORY_KIB: u64 = 4 << 20;

/// Runs the command with so much memory and no more.
fn bounded(folder: &Path, arguments: &[&str]) -> Output {
    let script = format!("ulimit -v {MOST_MEMORY_KIB} && exec \"$@\"");
    let mut command = Command::new("sh");
    command.current_dir(folder).args(["-c", &script, "sh", env!("CARGO_BIN_EXE_quadlab")]).args(arguments);
    command.output().expect("the shell starts")
}

/// What the command answers: it ends by itself, and what it refuses is one line.
fn answered(folder: &Path, arguments: &[&str]) -> String {
    let output = bounded(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(matches!(output.status.code(), Some(0..=2)), "{arguments:?}: {}: {stderr}", output.status);
    assert!(!stderr.contains("panicked"), "{arguments:?}: {stderr}");
    let errors: Vec<&str> = stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), usize::from(output.status.code() == Some(2)), "{arguments:?}: {stderr}");
    stderr
}

/// Rewrites the columns of every flight; the header stays.
fn rewrite(folder: &Path, edit: impl Fn(usize, &mut [f64])) {
    for name in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"] {
        let path = folder.join(name);
        let text = std::fs::read_to_string(&path).unwrap();
        let (header, rows) = text.split_once('\n').unwrap();
        let rows = rows.lines().enumerate().map(|(row, line)| {
            let mut fields: Vec<f64> =
                line.split(',').map(|field| field.parse().unwrap_or(f64::NAN)).collect();
            edit(row, &mut fields);
            let fields = fields.iter().map(|v| if v.is_nan() { String::new() } else { v.to_string() });
            fields.collect::<Vec<_>>().join(",")
        });
        let rows: Vec<String> = rows.collect();
        std::fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    }
}

/// Every command that reads flights, with more arguments.
fn commands<'a>(more: &[&'a str]) -> Vec<Vec<&'a str>> {
    let of = |before: &[&'a str]| [&with_sets(before)[..], more].concat();
    vec![
        of(&["identify", "--vehicle", "vehicle.toml", "--out", "out.toml", "--force"]),
        of(&["explain", "--vehicle", "vehicle.toml", "--out", "out.toml", "--force"]),
        of(&["diagnose", "--model", "model.toml"]),
        of(&["add", "ground-effect", "--model", "model.toml", "--out", "out.toml", "--force"]),
        [&["compare", "--model", "model.toml", "--flights", "A.csv"], more].concat(),
    ]
}

/// Copies of the flights, and a model of the good ones.
fn with_model() -> tempfile::TempDir {
    let folder = copies();
    identify(folder.path());
    folder
}

/// Which part of the flights is used makes no difference, nor whether faults are accepted.
const WAYS: [&[&str]; 3] = [&[], &["--from", "0"], &["--from", "0", "--accept-faults"]];

fn refused(folder: &Path, more: &[&str], expected: &str) {
    for command in commands(more) {
        let stderr = answered(folder, &command);
        assert!(stderr.contains("error: ") && stderr.contains(expected), "{command:?}: {stderr}");
    }
}

#[test]
fn columns_that_never_change_end_no_command() {
    let folder = with_model();
    rewrite(folder.path(), |_, fields| {
        fields[1..].fill(0.0);
        fields[3] = -1.0;
        fields[10..14].fill(1500.0);
        fields[14..].fill(11.5);
    });
    for command in WAYS.iter().flat_map(|way| commands(way)) {
        answered(folder.path(), &command);
    }
}

#[test]
fn a_log_of_motors_at_rest_is_named() {
    let folder = with_model();
    rewrite(folder.path(), |_, fields| fields[10..14].fill(1000.0));
    for way in WAYS {
        refused(folder.path(), way, "motors at rest: cmd1..4 are at most 1000");
    }
}

#[test]
fn a_leap_of_the_clock_is_refused_and_costs_nothing() {
    for leap_s in [3601.0, 1e6, 1e9, 1e12] {
        let folder = with_model();
        rewrite(folder.path(), |row, fields| fields[0] += if row > 700 { leap_s } else { 0.0 });
        refused(folder.path(), &[], "gaps over an hour");
    }
}

#[test]
fn many_gaps_just_under_an_hour_cost_no_more_than_their_rows() {
    let folder = with_model();
    rewrite(folder.path(), |row, fields| fields[0] += 3599.0 * (row / 120) as f64);
    let of = |command| with_sets(&[command, "--vehicle", "vehicle.toml", "--out", "out.toml", "--force"]);
    answered(folder.path(), &of("identify"));
    answered(folder.path(), &["compare", "--model", "model.toml", "--flights", "A.csv"]);
}
