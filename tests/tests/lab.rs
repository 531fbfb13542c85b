//! The laboratory's benchmark: the same seed gives the same answer on any number of threads, and
//! its files hold together.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn lab(out: &Path, threads: usize, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lab"))
        .args(arguments)
        .args(["--out".as_ref(), out.as_os_str()])
        .env("RAYON_NUM_THREADS", threads.to_string())
        .output()
        .unwrap()
}

/// Six trials of 14 s flights: enough for every kind of count, and quick in an unoptimised build.
const FEW: &[&str] = &["--quick", "--only", "nothing", "flapping-moment", "hum", "--duration", "14"];

#[test]
fn results_depend_on_the_seed_and_not_on_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, threads, more: &[&str]| {
        let out = folder.path().join(name);
        let output = lab(&out, threads, &[FEW, more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let read = |file| std::fs::read_to_string(out.join(file)).unwrap();
        (read("lab.json"), read("index.html"), String::from_utf8(output.stdout).unwrap())
    };
    let (json, page, text) = run("one", 1, &[]);
    let (again, page_again, _) = run("two", 2, &[]);
    assert_eq!(json, again);
    assert_eq!(page, page_again);
    let (other, _, _) = run("other", 2, &["--seed", "2"]);
    assert_ne!(json, other);

    let counts: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(counts["trials"], 6);
    assert_eq!(counts["nothing_right"]["of"], 4);
    assert_eq!(counts["effects"][0]["effect"], "flapping-moment");
    let answers =
        counts["confusion"].as_object().unwrap().values().flat_map(|row| row.as_object().unwrap().values());
    assert_eq!(answers.map(|count| count.as_u64().unwrap()).sum::<u64>(), 6);
    assert!(text.contains("flapping-moment") && page.contains("Confusion"));
}

/// What is asked of the counts is missed where no diagnosis can be right.
#[test]
fn counts_that_are_missed_are_a_failure() {
    let folder = tempfile::tempdir().unwrap();
    let counted = |strength: &str| {
        let few = ["--counts", "2", "--only", "flapping-moment", "nothing", "--strength", strength];
        let output = lab(folder.path(), 2, &few);
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    let (code, text) = counted("1");
    assert!(text.contains("holds  flapping-moment is named first: 2/2 (90 % at least)"), "{text}");
    assert!(text.contains("something is named where nothing is missing: 0/18 (5 % at most)"), "{text}");
    assert_eq!(code, Some(0), "{text}");
    let (code, text) = counted("0.001");
    assert!(text.contains("MISSED flapping-moment is named first: 0/2"), "{text}");
    assert_eq!(code, Some(1), "{text}");
}

#[test]
fn kept_failures_can_be_flown_again_from_their_files() {
    let folder = tempfile::tempdir().unwrap();
    // No diagnosis can see an effect of a thousandth of its usual size.
    let hopeless = [
        "--quick",
        "--only",
        "flapping-moment",
        "--strength",
        "0.001",
        "--duration",
        "14",
        "--keep-failures",
    ];
    let output = lab(folder.path(), 2, &hopeless);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let kept: Vec<_> =
        std::fs::read_dir(folder.path().join("failures")).unwrap().map(|f| f.unwrap().path()).collect();
    assert_eq!(kept.len(), 1);
    let vehicle = model::Vehicle::read(&kept[0].join("vehicle.toml")).unwrap();
    for name in ["A", "B", "C", "D", "E"] {
        let path = kept[0].join(format!("{name}.csv"));
        flights::Flight::read(&path).unwrap().check_against(&vehicle, &path).unwrap();
    }
}

#[test]
fn bad_usage_is_one_clear_line_and_status_2() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (["--only", "magnetism"], "no trial hides that"),
        (["--strength", "0"], "must be above 0"),
        (["--duration", "3"], "between 10 and 600"),
        (["--seeds", "0"], "1..=1000"),
    ] {
        let output = lab(folder.path(), 1, &arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(message.contains(expected), "{message}");
    }
}
