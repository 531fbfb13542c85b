//! The program `sil`: arguments, files, exit status, and two processes instead of one.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const SIL: &str = env!("CARGO_BIN_EXE_sil");

fn sil(arguments: &[&str], out: &Path) -> Output {
    Command::new(SIL).args(arguments).arg("--out").arg(out).output().expect("sil runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("one JSON document: {error}\n{}\n{}", text(&output.stdout), text(&output.stderr))
    })
}

/// What the middleware has left of runs started by process `id`.
fn left_behind(id: u32) -> Vec<String> {
    let prefix = format!("quadlab_{id:x}-");
    let names = ["/dev/shm".into(), std::env::temp_dir()]
        .into_iter()
        .flat_map(|folder| std::fs::read_dir(folder).into_iter().flatten().flatten());
    names.map(|e| e.file_name().to_string_lossy().into_owned()).filter(|n| n.starts_with(&prefix)).collect()
}

fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let started = Instant::now();
    while !condition() {
        assert!(started.elapsed() < Duration::from_secs(20), "waited 20 s for: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_run_writes_a_page_and_flight_files() {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("deep/sil");
    let output = sil(&["--scenario", "roll-10", "x-1"], &folder);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    assert!(table.contains("roll-10") && table.contains("pass") && !table.contains("FAIL"), "{table}");
    let mut names: Vec<_> =
        std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["index.html", "roll-10.csv", "x-1.csv"], "and no temporary file");
    let flight = flights::Flight::read(&folder.join("x-1.csv")).unwrap();
    assert_eq!(flight.len(), 4101);
    let page = std::fs::read_to_string(folder.join("index.html")).unwrap();
    assert!(page.contains("5.28") && page.contains("reference") && page.contains("</html>"));
}

/// Other gains give another table, and gains that keep no craft in the air fail.
#[test]
fn failsafes_are_flown_with_the_gains_that_are_named() {
    let out = tempfile::tempdir().unwrap();
    let vehicles = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/vehicles");
    let designed = std::fs::read_to_string(vehicles.join("f330-designed-gains.toml")).unwrap();
    let kp = designed.lines().find(|line| line.starts_with("kp = ")).unwrap();
    let value: f64 = kp["kp = ".len()..].trim().parse().unwrap();
    let wild = out.path().join("wild.toml");
    std::fs::write(&wild, designed.replace(kp, &format!("kp = {}", 40.0 * value))).unwrap();
    let flown = |gains: &Path| {
        let output = sil(&["--failsafes", "--gains", gains.to_str().unwrap()], out.path());
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let own = sil(&["--failsafes"], out.path());
    let [thesis, designed] =
        ["f330-gains.toml", "f330-designed-gains.toml"].map(|name| flown(&vehicles.join(name)));
    assert_eq!((thesis.0, designed.0), (Some(0), Some(0)), "{} {}", thesis.1, designed.1);
    assert_eq!(thesis.1, text(&own.stdout), "the thesis' gains are those of nobody else");
    assert_ne!(thesis.1, designed.1);
    let (status, table, why) = flown(&wild);
    assert!(status == Some(1) && table.contains("NOT AS EXPECTED"), "{status:?} {table} {why}");
}

#[test]
fn a_pattern_file_is_flown() {
    let out = tempfile::tempdir().unwrap();
    let injection = sil::manoeuvre::Injection {
        signal: sil::manoeuvre::Signal::Multisine,
        amplitude: 15.0,
        band_hz: [0.2, 5.0],
        seed: 1,
    };
    let circle = sil::manoeuvre::library(12.0, 1).into_iter().find(|m| m.name == "circle").unwrap();
    let pattern = circle.pattern(&injection, 0.01, 12.0, Path::new("circle")).unwrap();
    let file = out.path().join("circle.csv");
    std::fs::write(&file, pattern.to_csv()).unwrap();
    let output = sil(&["--pattern", file.to_str().unwrap(), "--json"], out.path());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(json(&output)["pass"], true);
    let flight = flights::Flight::read(&out.path().join("circle-flight.csv")).unwrap();
    assert_eq!(flight.len(), 1201);
    // Round the circle: 2 m across.
    let x = flight.column(flights::Column::X).unwrap();
    assert!(x.iter().any(|x| *x > 1.5) && x[0] == 0.0);
    let missing = sil(&["--pattern", "no-such.csv"], out.path());
    assert_eq!((missing.status.code(), text(&missing.stderr).lines().count()), (Some(2), 1));
}

#[test]
fn exit_status_and_json_say_the_same() {
    let out = tempfile::tempdir().unwrap();
    for (arguments, status) in
        [(&["--scenario", "hover", "--json"][..], 0), (&["--scenario", "roll-30", "--json"], 1)]
    {
        let output = sil(arguments, out.path());
        assert_eq!(output.status.code(), Some(status), "{arguments:?}");
        assert_eq!(json(&output)["scenarios"][0]["pass"], status == 0);
    }
}

#[test]
fn bad_usage_is_one_line_and_status_2() {
    let out = tempfile::tempdir().unwrap();
    for (arguments, words) in [
        (&["--scenario", "loop"][..], "known are hover, roll-10"),
        (&["--delay", "-1"], "--delay"),
        (&["--delay", "two"], "--delay"),
        (&["--noise", "some"], "--noise"),
        (&["--substeps", "0"], "--substeps"),
        (&["--transport", "udp"], "--transport"),
        (&["--nonsense"], "--nonsense"),
        (&["--on", "armv7"], "cargo xtask sil --on armv7"),
        (&["--on", "cortex-m4"], "cargo xtask sil --on cortex-m4"),
        (&["--on", "armv7", "--transport", "iceoryx2"], "leave --transport out"),
        (&["--on", "moon"], "--on host"),
        (&["--monte-carlo", "5", "--noise", "off"], "cannot be used with '--noise <NOISE>'"),
        (&["--soak", "1", "--delay", "3"], "cannot be used with '--delay <SAMPLES>'"),
        (&["--failsafes", "--model", "craft.toml"], "cannot be used with '--model <TOML>'"),
    ] {
        let output = sil(arguments, out.path());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(
            message.contains(words) && message.trim_end().lines().count() == 1,
            "{arguments:?}: {message}"
        );
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    let file = out.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let output = sil(&["--scenario", "hover"], &file);
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

#[test]
fn both_transports_give_the_same_bits_and_leave_nothing_behind() {
    let out = tempfile::tempdir().unwrap();
    let arguments =
        ["--scenario", "hover", "pitch-10", "yaw-30", "excitation", "--noise", "on", "--seed", "7", "--json"];
    let one = json(&sil(&arguments, &out.path().join("one")));
    let mut child = Command::new(SIL)
        .args(arguments)
        .args(["--transport", "iceoryx2", "--out"])
        .arg(out.path().join("two"))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let id = child.id();
    let mut stdout = child.stdout.take().unwrap();
    let two: serde_json::Value = serde_json::from_reader(&mut stdout).unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(one, two);
    for name in ["hover.csv", "excitation.csv"] {
        let read = |run: &str| std::fs::read(out.path().join(run).join(name)).unwrap();
        assert_eq!(read("one"), read("two"), "{name}");
    }
    assert_eq!(left_behind(id), [""; 0]);
}

/// Process numbers of the children of a process (Linux).
fn children(id: u32) -> Vec<u32> {
    let list = std::fs::read_to_string(format!("/proc/{id}/task/{id}/children")).unwrap_or_default();
    list.split_whitespace().filter_map(|id| id.parse().ok()).collect()
}

fn signal(id: u32, name: &str) {
    let status = Command::new("kill").args([format!("-{name}"), id.to_string()]).status().unwrap();
    assert!(status.success(), "kill -{name} {id}");
}

fn is_running(id: u32) -> bool {
    // A zombie has no command line any more.
    std::fs::read(format!("/proc/{id}/cmdline")).is_ok_and(|line| !line.is_empty())
}

/// Starts a flight that takes seconds (many integration steps a tick) and waits until it is well
/// under way.
fn long_run(out: &Path) -> (std::process::Child, u32) {
    let child = Command::new(SIL)
        .args(["--scenario", "pattern", "--substeps", "1000", "--transport", "iceoryx2", "--json", "--out"])
        .arg(out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until("the controller's process", || !children(child.id()).is_empty());
    let controller = children(child.id())[0];
    // Two hundredths of a second of its own time: it has started up and answers.
    wait_until("the flight", || ticks_of_the_processor(controller) >= 2);
    (child, controller)
}

/// Processor time of a process in hundredths of a second (Linux).
fn ticks_of_the_processor(id: u32) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    // Fields count from the closing bracket of the name: user time is the 12th, system time the
    // 13th.
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    [11, 12].iter().filter_map(|&k| fields.get(k)?.parse::<u64>().ok()).sum()
}

#[cfg(target_os = "linux")]
#[test]
fn a_killed_controller_is_an_error_at_once() {
    let out = tempfile::tempdir().unwrap();
    let (child, controller) = long_run(out.path());
    let id = child.id();
    signal(controller, "KILL");
    let killed = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(killed.elapsed() < Duration::from_secs(5), "{:?}", killed.elapsed());
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(
        message.contains("process ended in the middle of a flight")
            && message.trim_end().lines().count() == 1
    );
    assert_eq!(left_behind(id), [""; 0]);
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupt_ends_both_processes() {
    let out = tempfile::tempdir().unwrap();
    let (child, controller) = long_run(out.path());
    let id = child.id();
    // As a terminal does with Ctrl-C: the whole process group gets it, which the controller is not
    // in.
    signal(id, "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("interrupted"));
    wait_until("the controller to leave", || !is_running(controller));
    assert_eq!(left_behind(id), [""; 0]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_killed_plant_takes_the_controller_with_it() {
    let out = tempfile::tempdir().unwrap();
    let (mut child, controller) = long_run(out.path());
    let id = child.id();
    child.kill().unwrap();
    child.wait().unwrap();
    wait_until("the controller to leave", || !is_running(controller));
    assert_eq!(left_behind(id), [""; 0]);
}

/// `sil ... | head -1`: a reader that has seen enough is no error and no panic.
#[test]
fn a_closed_output_is_a_quiet_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_sil"))
        .args(["--scenario", "hover", "--out", "out"])
        .current_dir(folder.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Killed a hundred times at any moment, a survey ends with the bytes of one that was left alone.
#[test]
fn a_survey_that_is_killed_a_hundred_times_ends_with_the_same_bytes() {
    use rand::{RngExt, SeedableRng};
    let folder = tempfile::tempdir().unwrap();
    let [alone, killed] = ["alone", "killed"].map(|name| folder.path().join(name));
    let survey = |file: &Path| {
        let mut command = Command::new(SIL);
        command.args(["--monte-carlo", "200", "--seed", "9", "--resume"]).arg(file);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let bits = |output: &Output| {
        let said = text(&output.stdout);
        // Of what little is left to fly, the memory is not flat: no more is asked of it here than an answer.
        assert_ne!(output.status.code(), Some(2), "{said}{}", text(&output.stderr));
        said.lines().filter(|line| !line.starts_with("memory")).map(str::to_owned).collect::<Vec<_>>()
    };
    let started = Instant::now();
    let expected = bits(&survey(&alone).output().unwrap());
    let whole_s = started.elapsed().as_secs_f64();
    let expected_file = std::fs::read(&alone).unwrap();
    let seed = 62;
    let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
    let length = || std::fs::metadata(&killed).map_or(0, |file| file.len() as usize);
    let (mut kills, mut within) = (0, 0);
    while kills < 100 {
        let mut child = survey(&killed).spawn().unwrap();
        // Every other one by what is written, not by a time: a busy machine may need longer to start than `whole_s`.
        if kills % 2 == 0 {
            std::thread::sleep(Duration::from_secs_f64(random.random_range(0.0..0.4 * whole_s)));
        } else {
            let wanted = random.random_range(200..expected_file.len());
            while length() < wanted && child.try_wait().unwrap().is_none() {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        if child.try_wait().unwrap().is_some() {
            // To its end, in spite of all that was killed before it: once more from the beginning.
            assert_eq!(std::fs::read(&killed).unwrap(), expected_file, "seed {seed}, {kills} kills");
            std::fs::remove_file(&killed).unwrap();
            continue;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        within += usize::from((200..expected_file.len()).contains(&length()));
    }
    println!("{kills} kills, {within} of them amid the flights");
    assert!(within > 20, "{within}");
    assert_eq!(bits(&survey(&killed).output().unwrap()), expected, "seed {seed}");
    assert_eq!(std::fs::read(&killed).unwrap(), expected_file, "seed {seed}");
}
