//! Bad input is refused with one line that names the file and the place and says how to mend it, exit status 2, and
//! nothing written.

mod common;

use std::path::Path;

use common::{copies, identify, run_in, with_sets};

const IDENTIFY: [&str; 5] = ["identify", "--vehicle", "vehicle.toml", "--out", "out.toml"];

fn names_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Runs the command; it has to refuse with one line that holds all of `expected`, and leave the folder as it was.
fn refused(folder: &Path, arguments: &[&str], expected: &[&str]) {
    let before = names_in(folder);
    let output = run_in(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
    assert!(output.stdout.is_empty(), "{arguments:?} printed {:?}", String::from_utf8_lossy(&output.stdout));
    assert!(stderr.starts_with("error: ") && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
    assert!(stderr.matches("os error").count() < 2, "{arguments:?} tells its cause twice: {stderr}");
    assert!(stderr.trim_end().chars().count() < 400 + "error: ".len(), "{arguments:?}: {stderr}");
    for text in expected {
        assert!(stderr.contains(text), "{arguments:?}: \"{text}\" is not in: {stderr}");
    }
    assert_eq!(names_in(folder), before, "{arguments:?} wrote something");
}

/// Changes the fields of every row of a flight file; the header is row 0.
fn edit_rows(path: &Path, edit: impl Fn(usize, &mut Vec<String>)) {
    let text = std::fs::read_to_string(path).unwrap();
    let rows = text.lines().enumerate().map(|(row, line)| {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        edit(row, &mut fields);
        fields.join(",")
    });
    std::fs::write(path, rows.collect::<Vec<_>>().join("\n") + "\n").unwrap();
}

fn scaled(field: &mut String, factor: f64) {
    *field = (field.parse::<f64>().unwrap() * factor).to_string();
}

/// Columns of the simulated flights.
const T: usize = 0;
const Z: usize = 3;
const PHI: usize = 4;
const CMD1: usize = 10;
const VBAT: usize = 14;

#[test]
fn flights_that_cannot_be_right_are_refused_by_file_and_column() {
    type Edit = fn(usize, &mut Vec<String>);
    let cases: [(&str, Edit, &[&str]); 12] = [
        ("missing column", |_, f| drop(f.remove(Z)), &["row 1", "\"z\""]),
        (
            "degrees",
            |row, f| {
                if row > 0 {
                    scaled(&mut f[PHI], 57.3)
                }
            },
            &["\"phi\"", "degrees", "pi/180"],
        ),
        (
            "milliseconds",
            |row, f| {
                if row > 0 {
                    scaled(&mut f[T], 1000.0)
                }
            },
            &["\"t\"", "divide milliseconds"],
        ),
        (
            "millivolts",
            |row, f| {
                if row > 0 {
                    scaled(&mut f[VBAT], 1000.0)
                }
            },
            &["\"vbat\"", "divide millivolts"],
        ),
        (
            "normalised commands",
            |row, f| {
                if row > 0 {
                    scaled(&mut f[CMD1], 0.001)
                }
            },
            &["\"cmd1\"", "vehicle file"],
        ),
        (
            "time goes back",
            |row, f| {
                if row == 100 {
                    f[T] = "0.5".into()
                }
            },
            &["row 101", "times must rise"],
        ),
        (
            "time repeats",
            |row, f| {
                if row == 100 {
                    f[T] = "0.98".into()
                }
            },
            &["row 101", "times must rise"],
        ),
        (
            "not a number",
            |row, f| {
                if row == 7 {
                    f[Z] = "high".into()
                }
            },
            &["row 8", "\"z\"", "\"high\""],
        ),
        (
            "empty column",
            |row, f| {
                if row > 0 {
                    f[Z] = String::new()
                }
            },
            &["\"z\"", "no values"],
        ),
        (
            "NaN column",
            |row, f| {
                if row > 0 {
                    f[Z] = "NaN".into()
                }
            },
            &["\"z\""],
        ),
        (
            "a field too few",
            |row, f| {
                if row == 9 {
                    drop(f.pop())
                }
            },
            &["row 10", "fields"],
        ),
        (
            "no time",
            |row, f| {
                if row == 9 {
                    f[T] = String::new()
                }
            },
            &["row 10", "\"t\""],
        ),
    ];
    for (what, edit, expected) in cases {
        println!("{what}");
        let folder = copies();
        edit_rows(&folder.path().join("B.csv"), edit);
        let mut expected = expected.to_vec();
        expected.push("B.csv: ");
        refused(folder.path(), &with_sets(&IDENTIFY), &expected);
    }
}

#[test]
fn files_that_are_no_flights_are_refused() {
    let folder = copies();
    let path = folder.path().join("B.csv");
    let keep = |rows: usize| {
        let text = std::fs::read_to_string(folder.path().join("A.csv")).unwrap();
        text.lines().take(rows).map(|line| format!("{line}\n")).collect::<String>()
    };
    let cases = [
        (String::new(), "is empty"),
        (keep(1), "at least"),
        (keep(2), "at least"),
        (keep(60), "at least"),
        ("\u{0}\u{1}\u{2}".into(), "row 1"),
    ];
    for (text, expected) in cases {
        std::fs::write(&path, text).unwrap();
        refused(folder.path(), &with_sets(&IDENTIFY), &["B.csv: ", expected]);
    }
    std::fs::remove_file(&path).unwrap();
    refused(folder.path(), &with_sets(&IDENTIFY), &["B.csv: ", "cannot read"]);
    std::fs::create_dir(&path).unwrap();
    refused(folder.path(), &with_sets(&IDENTIFY), &["B.csv: ", "no flight file"]);
}

#[test]
fn vehicle_files_are_refused_by_field() {
    let folder = copies();
    let path = folder.path().join("vehicle.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    for (from, to, expected) in [
        ("gravity", "gravty", "gravty"),
        ("mass = 1.214", "mass = -1.214", "mass = -1.214 is impossible"),
        ("mass = 1.214", "mass = \"heavy\"", "line "),
        ("mass = 1.214", "", "mass"),
        ("mass = 1.214", "mass = ", "line "),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        refused(folder.path(), &with_sets(&IDENTIFY), &["vehicle.toml: ", expected]);
    }
    std::fs::remove_file(&path).unwrap();
    refused(folder.path(), &with_sets(&IDENTIFY), &["vehicle.toml: ", "cannot read"]);
}

#[test]
fn a_flight_is_given_once() {
    let folder = copies();
    let sets = |train: &[&'static str], validate: &[&'static str]| -> Vec<&'static str> {
        IDENTIFY
            .into_iter()
            .chain(["--train"])
            .chain(train.iter().copied())
            .chain(["--validate"])
            .chain(validate.iter().copied())
            .collect()
    };
    refused(
        folder.path(),
        &sets(&["A.csv", "B.csv"], &["A.csv"]),
        &["A.csv: ", "is given to both --train and --validate", "a flight used for the fit cannot test it"],
    );
    std::fs::copy(folder.path().join("A.csv"), folder.path().join("X.csv")).unwrap();
    refused(folder.path(), &sets(&["A.csv", "B.csv"], &["X.csv"]), &["X.csv: ", "the same flight as A.csv"]);
    refused(folder.path(), &sets(&["A.csv", "X.csv"], &["B.csv"]), &["X.csv: ", "give each flight once"]);
    identify(folder.path());
    let compare = ["compare", "--model", "model.toml", "--flights", "D.csv", "D.csv"];
    refused(folder.path(), &compare, &["D.csv: ", "give each flight once"]);
}

#[test]
fn effects_that_cannot_be_added_are_refused() {
    let folder = copies();
    identify(folder.path());
    let add = |effect| with_sets(&["add", effect, "--model", "model.toml", "--out", "out.toml"]);
    refused(
        folder.path(),
        &add("ground-efect"),
        &["\"ground-efect\"", "known are", "ground-effect", "steady-wind"],
    );
    refused(folder.path(), &add("thrust"), &["model.toml: ", "already has", "\"thrust\""]);
    let arguments = add("ground-effect");
    common::done_in(folder.path(), &arguments);
    let again = with_sets(&["add", "ground-effect", "--model", "out.toml", "--out", "more.toml"]);
    refused(folder.path(), &again, &["out.toml: ", "already has"]);
}

#[test]
fn models_that_cannot_be_read_are_refused() {
    let folder = copies();
    identify(folder.path());
    let text = std::fs::read_to_string(folder.path().join("model.toml")).unwrap();
    let diagnose = with_sets(&["diagnose", "--model", "bad.toml", "--html", "page.html"]);
    for (from, to, expected) in [
        ("version = 2", "version = 9", "version 9"),
        ("id = \"thrust\"", "id = \"thurst\"", "unknown effect"),
        ("format", "fromat", "line "),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(folder.path().join("bad.toml"), text.replacen(from, to, 1)).unwrap();
        refused(folder.path(), &diagnose, &["bad.toml: ", expected]);
    }
    std::fs::remove_file(folder.path().join("bad.toml")).unwrap();
    refused(folder.path(), &diagnose, &["bad.toml: ", "cannot read"]);
}

#[test]
fn outputs_without_a_place_are_refused_before_the_work() {
    let folder = copies();
    // The flights are broken too: had the work begun, they would be the error.
    std::fs::write(folder.path().join("B.csv"), "").unwrap();
    let to = |out| with_sets(&["identify", "--vehicle", "vehicle.toml", "--out", out]);
    refused(folder.path(), &to("absent/model.toml"), &["absent/model.toml", "no folder absent", "create it"]);
    refused(folder.path(), &to("."), &["is a folder"]);
    refused(folder.path(), &to("A.csv"), &["A.csv: ", "would be overwritten"]);
    refused(folder.path(), &to("vehicle.toml"), &["vehicle.toml: ", "would be overwritten"]);
}

/// Whatever way leads to it, whether it is there already or not.
#[test]
fn two_outputs_are_two_files() {
    let folder = copies();
    std::fs::write(folder.path().join("B.csv"), "").unwrap();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("old"), "precious").unwrap();
    let explain = |out, html| {
        with_sets(&["explain", "--vehicle", "vehicle.toml", "--force", "--out", out, "--html", html])
    };
    for (out, html) in [("x", "x"), ("x", "./x"), ("sub/../x", "x"), ("old", "sub/../old")] {
        refused(folder.path(), &explain(out, html), &["is given for two outputs", "a name of its own"]);
    }
    let excite = ["excite", "--model", "model.toml", "--out", "x", "--html", "x"];
    refused(folder.path(), &excite, &["x: is given for two outputs"]);
    // A device takes both: the flight is the error.
    refused(folder.path(), &explain("/dev/null", "/dev/null"), &["B.csv: "]);
}

#[test]
fn an_old_output_survives_bad_input() {
    let folder = copies();
    std::fs::write(folder.path().join("out.toml"), "precious").unwrap();
    refused(folder.path(), &with_sets(&IDENTIFY), &["out.toml: ", "already exists", "--force"]);
    std::fs::write(folder.path().join("B.csv"), "").unwrap();
    let forced = [&IDENTIFY[..], &["--force"]].concat();
    refused(folder.path(), &with_sets(&forced), &["B.csv: "]);
    assert_eq!(std::fs::read_to_string(folder.path().join("out.toml")).unwrap(), "precious");
}

/// A name that a stranger has given: it neither moves the cursor, nor reads from right to left, nor fills the screen.
#[test]
fn what_an_error_quotes_steers_no_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let name = format!("a\u{1b}[2J\r\u{202e}vsc\u{2066}{}.csv", "x".repeat(200));
    std::fs::write(folder.path().join(&name), "t,\u{202e}x\u{1b}]0;title\u{7}\n1,2\n").unwrap();
    std::fs::write(folder.path().join("vehicle.toml"), "").unwrap();
    for arguments in [
        vec![
            "identify",
            "--vehicle",
            "vehicle.toml",
            "--out",
            "m.toml",
            "--train",
            &name,
            "--validate",
            &name,
        ],
        vec!["compare", "--model", &name, "--flights", &name],
        vec!["import", &name, "--out", "."],
        vec![&name],
        vec!["identify", "--out", &name, &name],
    ] {
        let output = run_in(folder.path(), &arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr:?}");
        for line in stderr.lines() {
            assert!(line.chars().count() < 400 + "error: ".len(), "{line:?}");
            assert!(!line.contains(['\u{1b}', '\r', '\u{7}', '\u{202e}', '\u{2066}']), "{line:?}");
        }
        assert_eq!(stderr.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{stderr:?}");
    }
}

#[test]
fn bad_usage_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (vec![], "no command"),
        (vec!["identfy"], "identfy"),
        (vec!["identify"], "--out"),
        (vec!["compare", "--model", "m.toml"], "--flights"),
        (vec!["compare", "--model", "m.toml", "--flights"], "--flights"),
        (vec!["effects", "--jsno"], "--jsno"),
        (vec!["demo", "--seed", "-1"], "-1"),
        (vec!["add", "--model", "m.toml"], "EFFECT"),
    ] {
        refused(folder.path(), &arguments, &[expected]);
    }
    for (arguments, help) in [
        (vec!["identify"], "(see quadlab identify --help)"),
        (vec!["design", "check", "--modle", "m.toml"], "(see quadlab design check --help)"),
        (vec!["identfy"], "(see quadlab --help)"),
    ] {
        refused(folder.path(), &arguments, &[help]);
    }
    // An option that a command does not have is no value for it either.
    let said = run_in(folder.path(), &["import", "log.ulg", "--html"]).stderr;
    let said = String::from_utf8_lossy(&said);
    assert!(said.contains("--html") && !said.contains("tip"), "{said}");
}

/// A device that is always full, where the system has one.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_behind_standard_output_is_told_as_such() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_quadlab")).arg("effects").stdout(full).output();
    let run = run.unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.code() == Some(2) && said.contains("standard output: "), "{said}");
}

#[test]
fn a_vehicle_file_given_for_a_model_is_recognised_and_the_other_way_round() {
    let folder = copies();
    identify(folder.path());
    let compare = ["compare", "--model", "vehicle.toml", "--flights", "D.csv"];
    refused(folder.path(), &compare, &["vehicle.toml: is a vehicle file", "quadlab identify"]);
    let explain = ["explain", "--vehicle", "model.toml", "--out", "out.toml"];
    refused(folder.path(), &with_sets(&explain), &["model.toml: is a model file"]);
}

#[test]
fn folders_and_patterns_stand_for_their_flights() {
    let folder = copies();
    identify(folder.path());
    let named =
        ["compare", "--model", "model.toml", "--flights", "A.csv", "B.csv", "C.csv", "D.csv", "E.csv"];
    let one_by_one = common::done_in(folder.path(), &named);
    for flights in ["*.csv", "."] {
        let compare = ["compare", "--model", "model.toml", "--flights", flights];
        assert_eq!(common::done_in(folder.path(), &compare).replace("./", ""), one_by_one);
    }
    refused(
        folder.path(),
        &["compare", "--model", "model.toml", "--flights", "Z*.csv"],
        &["Z*.csv: matches no file"],
    );
}

#[test]
fn flights_that_do_not_determine_the_model_say_what_to_fly() {
    let folder = copies();
    // The same command in every row: nothing that a rotor does can be seen.
    for name in ["A.csv", "B.csv", "C.csv"] {
        edit_rows(&folder.path().join(name), |row, fields| {
            if row > 0 {
                fields[CMD1..CMD1 + 4].iter_mut().for_each(|command| *command = "1500".into());
                let distinct = format!("11.{}", name.as_bytes()[0]);
                fields[VBAT] = distinct;
            }
        });
    }
    refused(folder.path(), &with_sets(&IDENTIFY), &["A.csv, B.csv, C.csv: ", "the flights "]);
}
