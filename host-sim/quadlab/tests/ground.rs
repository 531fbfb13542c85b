//! `quadlab ground` as a program: real time, real sockets, a laboratory that is simulated.

mod common;

use common::{done_in, run_in};
use flights::Flight;

const SCRIPT: &str = r#"
    [[step]]
    do = "arm"
    [[step]]
    do = "take-off"
    height_m = 0.7
    [[step]]
    do = "step"
    axis = "x"
    size = 0.4
    for_s = 2.0
    [[step]]
    do = "land"
"#;

#[test]
fn a_script_is_flown_and_recorded() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), SCRIPT).unwrap();
    let text =
        done_in(folder.path(), &["ground", "--simulated", "--script", "s.toml", "--record", "a/b", "--json"]);
    let document: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(document["well"], true, "{document}");
    assert_eq!(document["flights"], serde_json::json!(["a/b-1.csv"]));
    let flight = Flight::read(&folder.path().join("a/b-1.csv")).unwrap();
    let column = |column| flight.column(column).unwrap().to_vec();
    let (x, z) = (column(flights::Column::X), column(flights::Column::Z));
    let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A step of 0.4 m at up to 2.5 m/s overshoots, and the landing stops a craft that may still move.
    assert!(
        (0.25..0.9).contains(&most(&x)) && (-1.0..-0.6).contains(&least(&z)),
        "{} {}",
        most(&x),
        least(&z)
    );
    assert!(document["messages"].as_u64().unwrap() > 500);
    assert!(!folder.path().join("a/b.mcap.part").exists());
    // The recording is a log like any other: the same flight comes out of it.
    let import = done_in(folder.path(), &["import", "a/b.mcap", "--out", "imported", "--json"]);
    let import: serde_json::Value = serde_json::from_str(&import).unwrap();
    let read = |path: &str| std::fs::read_to_string(folder.path().join(path)).unwrap();
    assert_eq!(import["logs"][0]["flights"][0]["file"], "imported/b.csv", "{import}");
    assert!(
        read("imported/b.csv") == read("a/b-1.csv"),
        "the import is another flight than the one beside it"
    );
    let clocks = import["logs"][0]["clocks"].as_array().unwrap();
    assert!(clocks.iter().any(|pair| pair["clock"] == "craft_us" && pair["skew_ppm"].is_f64()), "{clocks:?}");
    let text = done_in(folder.path(), &["import", "a/b.mcap", "--out", "imported", "--force"]);
    assert!(text.contains("clocks (offset") && text.contains("craft_us"), "{text}");
    // The same name again would overwrite a flight.
    let output = run_in(folder.path(), &["ground", "--simulated", "--script", "s.toml", "--record", "a/b"]);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && stderr.contains("b.mcap"), "{stderr}");
}

/// A model of one's own and gains of one's own fly in the simulated laboratory; gains of another craft do not.
#[test]
fn the_simulated_craft_can_be_another() {
    let folder = tempfile::tempdir().unwrap();
    let vehicles = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/vehicles");
    let [model, gains] = ["f330-model.toml", "f330-designed-gains.toml"]
        .map(|name| std::fs::read_to_string(vehicles.join(name)).unwrap());
    let at = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    at("model.toml", &model);
    at("gains.toml", &gains);
    at("other.toml", &gains.replace("vehicle = \"F330 (thesis)\"", "vehicle = \"another\""));
    at(
        "s.toml",
        "[[step]]\ndo = \"arm\"\n[[step]]\ndo = \"take-off\"\nheight_m = 0.3\n[[step]]\ndo = \"land\"\n",
    );
    let simulated =
        ["ground", "--simulated", "--script", "s.toml", "--no-record", "--plain", "--model", "model.toml"];
    for gains in [&[][..], &["--gains", "gains.toml"]] {
        done_in(folder.path(), &[&simulated, gains].concat());
    }
    let output = run_in(folder.path(), &[&simulated[..], &["--gains", "other.toml"]].concat());
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && stderr.contains("another vehicle"), "{stderr}");
}

/// Killed in the air: nothing of the recording is lost, and one command finishes it.
#[test]
fn a_recording_survives_a_kill() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), SCRIPT.replace("for_s = 2.0", "for_s = 60.0")).unwrap();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin!("quadlab"))
        .current_dir(folder.path())
        .args(["ground", "--simulated", "--script", "s.toml", "--record", "a"])
        .stderr(std::process::Stdio::null())
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let part = folder.path().join("a.mcap.part");
    let begun = std::time::Instant::now();
    // Some 1.5 kB a tick: up and flying for a few seconds.
    while std::fs::metadata(&part).map_or(0, |file| file.len()) < 1_500_000 {
        assert!(begun.elapsed().as_secs() < 60, "nothing is recorded");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let text = done_in(folder.path(), &["ground", "--recover", "a"]);
    assert!(text.contains("a.mcap") && text.contains("a-1.csv"), "{text}");
    assert!(!part.exists() && Flight::read(&folder.path().join("a-1.csv")).unwrap().len() > 50);
}

#[test]
fn bad_usage_is_one_line_and_status_2() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), "[[step]]\ndo = \"jump\"\n").unwrap();
    std::fs::write(folder.path().join("key"), "no key").unwrap();
    let cases: [(&[&str], &str); 11] = [
        (&[], "--craft"),
        (&["--craft", "10.0.0.1:14650", "--no-tracker"], "key"),
        (&["--craft", "127.0.0.1:1", "--key", "key"], "chmod 600"),
        (&["--craft", "127.0.0.1:1", "--script", "s.toml"], "jump"),
        (&["--craft", "127.0.0.1:1", "--pattern", "none.csv"], "none.csv"),
        (&["--craft", "127.0.0.1:1", "--replay", "none.csv"], "none.csv"),
        (&["--craft", "127.0.0.1:1", "--room", "x,y,-z"], "mirror image"),
        (&["--craft", "127.0.0.1:1"], "--vicon 192.168.7.3"),
        (&["--craft", "127.0.0.1:1", "--vicon", "nowhere at all"], "--vicon"),
        (&["--simulated", "--command-hz", "2", "--no-record"], "give 4"),
        (&["--recover", "nothing"], "nothing.mcap"),
    ];
    for (arguments, wanted) in cases {
        let arguments: Vec<&str> = ["ground"].iter().chain(arguments).copied().collect();
        let output = run_in(folder.path(), &arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(wanted) && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
    }
}
