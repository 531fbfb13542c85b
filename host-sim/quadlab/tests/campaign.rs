//! Campaigns as a user runs them: planned, flown in shards that may be killed, merged and told.

mod common;
#[path = "common/schemas.rs"]
mod schemas;
#[path = "common/slurm.rs"]
mod slurm;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use common::{done_in, json_in, run_in};

const DEFINITION: &str = "name = \"test\"\nseed = 3\ndraws = 40\nscenarios = [\"tour\", \"roll-10\"]\n[unknown]\nmass_kg = [-0.1, 0.1]\n\
                          wind_m_s = { mean = 0.0, deviation = 0.5 }\ngust_m_s = [0.0, 0.5]\ndelay_samples = [1, 3]\nfault = 0.3\n";
/// Two scenarios and the two gains that are built in.
const CASES: u64 = 160;

/// A folder with a plan in so many shards.
fn planned(shards: u64) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("c.toml"), DEFINITION).unwrap();
    let said = done_in(folder.path(), &["campaign", "plan", "c.toml", "--shards", &shards.to_string()]);
    assert!(said.contains(&format!("{CASES} flights in {shards} shard")), "{said}");
    folder
}

fn merged(folder: &Path) -> Vec<u8> {
    done_in(folder, &["campaign", "merge", "plan.json", "--parts", "parts"]);
    std::fs::read(folder.join("parts/cases.parquet")).unwrap()
}

const RUN: [&str; 5] = ["campaign", "run", "plan.json", "--out", "parts"];

#[test]
fn shards_in_any_number_and_order_merge_to_the_same_bytes() {
    let whole = planned(1);
    done_in(whole.path(), &RUN);
    let expected = merged(whole.path());
    let seven = planned(7);
    for shard in ["5", "0", "6", "3"] {
        done_in(seven.path(), &[&RUN[..], &["--shard", shard]].concat());
    }
    let why = run_in(seven.path(), &["campaign", "merge", "plan.json", "--parts", "parts"]);
    assert_eq!(why.status.code(), Some(2));
    let why = String::from_utf8(why.stderr).unwrap();
    let command =
        "shards 1, 2, 4 are missing (3 of 7); fly them with `quadlab campaign run plan.json --out parts`";
    assert!(why.contains(command), "{why}");
    // The environment of a cluster names a shard as well, and the rest is flown without one.
    let mut task = Command::new(env!("CARGO_BIN_EXE_quadlab"));
    task.args(RUN).env("SLURM_ARRAY_TASK_ID", "4").env("RAYON_NUM_THREADS", "1").current_dir(seven.path());
    assert!(task.stderr(Stdio::null()).stdout(Stdio::null()).status().unwrap().success());
    let said = done_in(seven.path(), &RUN);
    assert!(said.contains("shard 5 of 7 was flown before") && !said.contains("shard 1 of 7"), "{said}");
    assert!(merged(seven.path()) == expected, "the same bytes");
}

/// Killed at moments that differ from round to round, until it has come to its end.
#[test]
fn runs_that_are_killed_lose_nothing() {
    let whole = planned(1);
    done_in(whole.path(), &RUN);
    let killed = planned(16);
    let mut kills = 0;
    for round in 0..100 {
        let mut run = Command::new(env!("CARGO_BIN_EXE_quadlab"))
            .args(RUN)
            .current_dir(killed.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(20 + 13 * round % 170));
        if run.try_wait().unwrap().is_none() {
            kills += 1;
            run.kill().unwrap();
        }
        run.wait().unwrap();
    }
    done_in(killed.path(), &RUN);
    assert!(kills > 5, "{kills} kills");
    assert!(merged(killed.path()) == merged(whole.path()), "the same bytes after {kills} kills");
    let parts = std::fs::read_dir(killed.path().join("parts")).unwrap();
    let unfinished: Vec<_> = parts
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.ends_with(".parquet") && !name.ends_with(".json"))
        .collect();
    // A killed process cannot clean up after itself; what it left is named so that nobody takes it for a part.
    assert!(unfinished.iter().all(|name| name.starts_with('.')), "{unfinished:?}");
}

/// What runs on this machine without a server is run; of the others the script is there, and the sentence.
#[test]
fn shards_are_handed_to_engines() {
    let folder = planned(3);
    done_in(folder.path(), &RUN);
    let expected = merged(folder.path());
    // Python's packages for tests, HyperQueue's among them, come first where they are installed.
    let peers = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/peers/bin");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths(std::iter::once(peers).chain(std::env::split_paths(&path))).unwrap();
    let submit = |engine: &str, parts: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_quadlab"));
        command.args(["campaign", "submit", "plan.json", "--out", parts, "--engine", engine]);
        command.env("PATH", &path).current_dir(folder.path()).output().unwrap()
    };
    assert!(submit("local", "local").status.success());
    done_in(folder.path(), &["campaign", "merge", "plan.json", "--parts", "local"]);
    assert!(std::fs::read(folder.path().join("local/cases.parquet")).unwrap() == expected);
    for (engine, needs, script) in
        [("hq", "python3", "submit-hq.py"), ("parallel", "parallel", "submit-parallel.sh")]
    {
        let ran = submit(engine, engine);
        assert!(folder.path().join(engine).join(script).exists(), "{engine}");
        if ran.status.success() {
            done_in(folder.path(), &["campaign", "merge", "plan.json", "--parts", engine]);
            let bytes = std::fs::read(folder.path().join(engine).join("cases.parquet")).unwrap();
            assert!(bytes == expected, "{engine}: the same bytes");
        } else {
            let why = String::from_utf8(ran.stderr).unwrap();
            println!("SKIPPED: {engine} is not here ({})", why.trim());
            assert!(
                why.lines().count() <= 1 && (why.is_empty() || why.contains(needs) || why.contains("sh")),
                "{why}"
            );
        }
    }
    let args = [
        "campaign",
        "submit",
        "plan.json",
        "--out",
        "k8s",
        "--engine",
        "k8s",
        "--image",
        "quadlab:1",
        "--dry-run",
    ];
    done_in(folder.path(), &args);
    assert!(
        std::fs::read_to_string(folder.path().join("k8s/submit-k8s.yaml"))
            .unwrap()
            .contains("completions: 3")
    );
    assert!(folder.path().join("k8s/plan.json").exists());
}

/// A Slurm array on a node of its own: the same bytes as on this machine alone.
#[test]
fn slurm_flies_every_shard() {
    let Some(slurm) = slurm::Slurm::start() else {
        println!("SKIPPED: slurm is not installed: apt-get install --yes slurmctld slurmd slurm-client");
        return;
    };
    let folder = planned(5);
    done_in(folder.path(), &RUN);
    let expected = merged(folder.path());
    let (variable, value) = slurm.environment();
    let mut submit = Command::new(env!("CARGO_BIN_EXE_quadlab"));
    submit.args(["campaign", "submit", "plan.json", "--out", "there", "--engine", "slurm"]);
    let ran = submit.env(variable, value).current_dir(folder.path()).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    assert!(String::from_utf8_lossy(&ran.stdout).contains("5 shards submitted"));
    let ended = slurm.waits_until_idle();
    let logs = (0..5).map(|k| std::fs::read_to_string(folder.path().join(format!("there/slurm-{k}.log"))));
    let logs: Vec<String> = logs.map(Result::unwrap_or_default).collect();
    assert!(ended, "{logs:?}");
    assert!(logs.iter().all(|log| log.contains("flights in")), "{logs:?}");
    done_in(folder.path(), &["campaign", "merge", "plan.json", "--parts", "there"]);
    assert!(std::fs::read(folder.path().join("there/cases.parquet")).unwrap() == expected, "the same bytes");
}

/// A search finds what draws miss, tells it in JSON by its schema and on a page, and ends with status 1.
#[test]
fn a_search_beside_sampling() {
    let folder = tempfile::tempdir().unwrap();
    let text = "name = \"corner\"\ndraws = 10\nscenarios = [\"hover\"]\n[unknown]\nmass_kg = [0.0, 0.45]\nthrust_loss = [0.0, 0.28]\n";
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    done_in(folder.path(), &["campaign", "plan", "c.toml"]);
    let search = ["campaign", "search", "plan.json", "--gains", "designed", "--flights", "240"];
    let ran = run_in(folder.path(), &[&search[..], &["--html", "search.html", "--json"]].concat());
    assert_eq!(ran.status.code(), Some(1), "{}", String::from_utf8_lossy(&ran.stderr));
    let found: serde_json::Value = serde_json::from_slice(&ran.stdout).unwrap();
    schemas::assert_valid("campaign-search", &found);
    let count = |key: &str| found[key].as_u64().unwrap();
    assert!(count("lost") > 3 * count("sampled_lost"), "{found}");
    assert!(
        std::fs::read_to_string(folder.path().join("search.html"))
            .unwrap()
            .contains("The worst flight so far")
    );
    let told = String::from_utf8(run_in(folder.path(), &search).stdout).unwrap();
    assert!(told.contains("flights of the search were lost") && told.contains("(needed)"), "{told}");
}

/// Gains are written only where they lose the craft as rarely as is asked.
#[test]
fn gains_are_designed_for_a_share_of_losses() {
    let folder = tempfile::tempdir().unwrap();
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../model/vehicles/f330-model.toml");
    let campaign = |wind: &str| {
        format!(
            "name = \"wind\"\ndraws = 80\nscenarios = [\"tour\"]\n[unknown]\nwind_m_s = {wind}\nnoise = [0.5, 1.5]\n"
        )
    };
    std::fs::write(folder.path().join("calm.toml"), campaign("[-0.2, 0.2]")).unwrap();
    std::fs::write(folder.path().join("storm.toml"), campaign("[8.0, 12.0]")).unwrap();
    let design = |campaign: &str, allow: &str, out: &str| {
        run_in(
            folder.path(),
            &["design", "--model", model, "--out", out, "--campaign", campaign, "--allow", allow],
        )
    };
    let calm = design("calm.toml", "5", "calm-gains.toml");
    let told = String::from_utf8_lossy(&calm.stdout).into_owned() + &String::from_utf8_lossy(&calm.stderr);
    assert!(calm.status.success() && told.contains("met: lost in tour: 0 of 80 draws"), "{told}");
    assert!(folder.path().join("calm-gains.toml").exists());
    let storm = design("storm.toml", "5", "storm-gains.toml");
    let told = String::from_utf8_lossy(&storm.stdout).into_owned() + &String::from_utf8_lossy(&storm.stderr);
    assert_eq!(storm.status.code(), Some(1), "{told}");
    assert!(
        told.contains("NOT MET: lost in tour") && !folder.path().join("storm-gains.toml").exists(),
        "{told}"
    );
    let few = design("calm.toml", "0.1", "few.toml");
    assert_eq!(few.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&few.stderr).contains("80 draws cannot show that"));
}

#[test]
fn the_report_is_told_and_a_case_flown_again_ends_as_in_its_shard() {
    let folder = planned(2);
    done_in(folder.path(), &RUN);
    let report = json_in(folder.path(), &["campaign", "report", "plan.json", "--parts", "parts"]);
    schemas::assert_valid("campaign", &report);
    assert_eq!(report["cases"], CASES);
    let in_any = |rate: &&&serde_json::Value| rate["scenario"].is_null();
    let all: Vec<_> = report["rates"].as_array().unwrap().iter().collect();
    let all: Vec<_> = all.iter().filter(in_any).collect();
    let count = |rate: &serde_json::Value, key: &str| rate[key].as_u64().unwrap();
    for rate in &all {
        assert_eq!(
            ["completed", "aborted", "lost"].map(|key| count(rate, key)).iter().sum::<u64>(),
            count(rate, "draws")
        );
        assert_eq!(count(rate, "draws") + count(&report, "impossible"), 40);
    }
    // The thesis' gains have 8 % of gain margin in pitch with two samples of delay.
    let lost = |gains: &str| count(all.iter().find(|rate| rate["gains"] == gains).unwrap(), "lost");
    assert!(lost("thesis") > 8 + lost("designed"), "{all:?}");
    assert!(report["pairs"][0]["p_value"].as_f64().unwrap() < 0.01, "{report}");
    let faults = report["faults"].as_array().unwrap();
    assert!(faults.len() > 4 && faults.iter().any(|fault| fault["fault"] == ""), "{faults:?}");
    let worst = &report["worst"]["thesis"][0];
    let case = worst["case"].to_string();
    let said = done_in(
        folder.path(),
        &["campaign", "replay", "plan.json", &case, "--html", "case.html", "--out", "case.csv"],
    );
    let expected = format!(
        "lost after {:.2} s: {}",
        worst["after_s"].as_f64().unwrap(),
        worst["lost_by"].as_str().unwrap()
    );
    let told = said.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(told.contains(&expected), "{told} / {expected}");
    assert!(
        std::fs::read_to_string(folder.path().join("case.html")).unwrap().contains("The track from above.")
    );
    let replayed = json_in(folder.path(), &["campaign", "replay", "plan.json", &case]);
    schemas::assert_valid("campaign-replay", &replayed);
    assert_eq!([&replayed["lost_by"], &replayed["lost_after_s"]], [&worst["lost_by"], &worst["after_s"]]);
    let planned = json_in(folder.path(), &["campaign", "plan", "c.toml", "--out", "again.json"]);
    schemas::assert_valid("campaign-plan", &planned);
    assert_eq!(
        [&planned["flights"], &planned["file"]],
        [&serde_json::json!(CASES), &serde_json::json!("again.json")]
    );
    let causes = json_in(folder.path(), &["campaign", "why", "plan.json", &case]);
    schemas::assert_valid("campaign-why", &causes);
    assert_eq!(causes["after_s"], worst["after_s"]);
    // Late poses, gusts or a fault: a heavier craft alone was never lost.
    let needed: Vec<&str> =
        causes["needed"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert!(!needed.is_empty() || !causes["fault"].is_null(), "{causes}");
    assert!(needed != ["mass_kg"] && needed.len() < 5, "{causes}");
    let kept = run_in(folder.path(), &["campaign", "why", "plan.json", "0"]);
    assert!(
        kept.status.code() == Some(0) || String::from_utf8(kept.stderr).unwrap().contains("was not lost")
    );
    let args = ["campaign", "report", "plan.json", "--parts", "parts", "--allow", "15", "--html", "all.html"];
    let refused = run_in(folder.path(), &args);
    assert_eq!(refused.status.code(), Some(1), "the thesis' gains are not allowed");
    let said = String::from_utf8(refused.stdout).unwrap();
    assert!(said.contains("NOT ALLOWED: thesis in any scenario: up to "), "{said}");
}

#[test]
fn mistakes_are_one_line_each() {
    let folder = planned(2);
    let path = folder.path();
    let refused = |args: &[&str], expected: &str| {
        let run = run_in(path, args);
        let why = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(2), "{args:?}: {why}");
        assert!(why.lines().count() == 1 && why.contains(expected), "{args:?}: {why}");
    };
    let definitions = [
        ("draws = 40", "draws = 0", "draws: 0 asks for no flight"),
        ("draws = 40", "draws = 9223372036854775807", "are more than 200 million flights"),
        (
            "draws = 40",
            "draws = 100000000",
            "draws: 100000000 draws times scenarios times gains are more than",
        ),
        ("draws = 40", "", "d.toml: missing field `draws`; a definition needs name, draws and scenarios"),
        (
            "deviation = 0.5",
            "deviation = 1e9",
            "unknown.wind_m_s: 100 % of a normal distribution with deviation",
        ),
        ("draws = 40", "draws = 40\nflights = 3", "unknown field `flights`"),
        ("\"tour\"", "\"loop\"", "there is no such scenario"),
        ("[-0.1, 0.1]", "[0.1, -0.1]", "unknown.mass_kg: [0.1, -0.1] is not a valid range"),
        ("[-0.1, 0.1]", "[-5, 0.1]", "unknown.mass_kg: must be from -"),
        ("mass_kg", "thrust_loss = [0, 20]\nmass_kg", "unknown.thrust_loss: must be from -0.500 to 1"),
        ("mass_kg", "noise = [-1, 2]\nmass_kg", "unknown.noise: must be from 0 to 100"),
        ("deviation = 0.5", "deviation = -0.5", "unknown.wind_m_s: the deviation -0.5 must not be negative"),
        (
            "[-0.1, 0.1]",
            "\"heavy\"",
            "line 6, mass_kg = \"heavy\": give a range [low, high] or { mean = ..., deviation = ... }",
        ),
        ("[1, 3]", "[1.0, 3.5]", "delay_samples = [1.0, 3.5]: give two whole numbers, [fewest, most]"),
        ("\"roll-10\"", "\"tour\"", "scenarios: tour is named twice"),
        ("fault = 0.3", "fault = 3", "unknown.fault: 3 is not a share"),
        ("fault = 0.3", "coefficients = true", "the model has no standard errors"),
        ("[unknown]", "model = \"none.toml\"\n[unknown]", "none.toml: cannot be read"),
        ("[unknown]", "[gains]\nmine = \"c.toml\"\n[unknown]", "mine: "),
    ];
    for (from, to, expected) in definitions {
        std::fs::write(path.join("d.toml"), DEFINITION.replacen(from, to, 1)).unwrap();
        refused(&["campaign", "plan", "d.toml", "--out", "d.json"], expected);
        assert!(!path.join("d.json").exists());
    }
    std::fs::write(path.join("heavy.toml"), DEFINITION.replacen("[-0.1, 0.1]", "[2.0, 2.0]", 1)).unwrap();
    done_in(path, &["campaign", "plan", "heavy.toml", "--out", "heavy.json"]);
    refused(&["campaign", "why", "heavy.json", "0"], "case 0: no gains could fly it: ");
    refused(&[&RUN[..], &["--shard", "2"]].concat(), "there is no shard 2: the plan has shards 0 to 1");
    refused(&["campaign", "replay", "plan.json", "160"], "there is no case 160: the plan has cases 0 to 159");
    refused(
        &["campaign", "run", "c.toml", "--out", "parts"],
        "c.toml: is not a campaign's plan; make one with",
    );
    let plan = std::fs::read_to_string(path.join("plan.json")).unwrap();
    std::fs::write(path.join("changed.json"), plan.replace("\"seed\": 3", "\"seed\": 4")).unwrap();
    refused(&["campaign", "run", "changed.json", "--out", "parts"], "was changed after it was made");
    done_in(path, &RUN);
    let report = ["campaign", "report", "plan.json", "--parts", "parts", "--allow"];
    refused(
        &[&report[..], &["0.1"]].concat(),
        "40 draws cannot show that: even with no loss, up to 8.8 % may be lost",
    );
    refused(&[&report[..], &["0"]].concat(), "above 0 and at most 100");
    std::fs::write(path.join("e.toml"), DEFINITION.replace("seed = 3", "seed = 4")).unwrap();
    done_in(path, &["campaign", "plan", "e.toml", "--out", "e.json"]);
    refused(&["campaign", "run", "e.json", "--out", "parts"], "holds parts of another campaign");
    let part = path.join("parts/part-000001-of-000002.parquet");
    let mut bytes = std::fs::read(&part).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&part, bytes).unwrap();
    let merge = ["campaign", "merge", "plan.json", "--parts", "parts"];
    refused(&merge, "is damaged; `quadlab campaign run` flies its shard again");
    let other = "holds parts of another campaign; give the folder in which this plan was flown with --parts";
    refused(&["campaign", "report", "e.json", "--parts", "parts"], other);
    // The command that is named mends it.
    let said = done_in(path, &RUN);
    assert!(
        said.contains("shard 0 of 2 was flown before") && said.contains("shard 1 of 2 was flown again"),
        "{said}"
    );
    done_in(path, &merge);
}

/// A folder belongs to one plan, and a second one changes nothing in it.
#[test]
fn no_plan_replaces_another_beside_its_parts() {
    let folder = planned(2);
    let path = folder.path();
    let submit = |plan: &str, engine: &str| {
        let args = ["campaign", "submit", plan, "--out", "there", "--engine", engine, "--dry-run"];
        let run = run_in(path, &args);
        (run.status.code(), String::from_utf8(run.stderr).unwrap())
    };
    assert_eq!(submit("plan.json", "local").0, Some(0));
    let all = || {
        let files = std::fs::read_dir(path.join("there")).unwrap().map(|entry| entry.unwrap().path());
        let mut all: Vec<_> = files.map(|file| (std::fs::read(&file).unwrap(), file)).collect();
        all.sort();
        all
    };
    let before = all();
    std::fs::write(path.join("e.toml"), DEFINITION.replace("seed = 3", "seed = 4")).unwrap();
    done_in(path, &["campaign", "plan", "e.toml", "--out", "e.json"]);
    done_in(path, &["campaign", "plan", "c.toml", "--shards", "5", "--out", "five.json"]);
    for (plan, expected) in [
        ("e.json", "is there already and is not the plan of this campaign; choose another folder with --out"),
        ("five.json", "is a plan of this campaign in 2 shards, not 5"),
    ] {
        for engine in ["local", "slurm"] {
            let (code, why) = submit(plan, engine);
            assert!(code == Some(2) && why.lines().count() == 1 && why.contains(expected), "{plan}: {why}");
            assert!(all() == before, "{plan} with {engine} changed the folder");
        }
    }
    // The folder is this campaign's before anything was flown, and its own plan can be submitted again.
    let run = run_in(path, &["campaign", "run", "e.json", "--out", "there"]);
    assert!(String::from_utf8(run.stderr).unwrap().contains("holds parts of another campaign"));
    assert!(all() == before);
    assert_eq!(submit("plan.json", "local").0, Some(0));
}

/// What is cut off a normal distribution is told by the plan, the report and its page.
#[test]
fn a_truncated_normal_distribution_is_said_aloud() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let text = "name = \"late\"\ndraws = 8\nscenarios = [\"hover\"]\n[unknown]\ndead_time_s = { mean = 0.0, deviation = 0.002 }\n";
    std::fs::write(path.join("c.toml"), text).unwrap();
    let unwrapped = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let expected = "dead_time_s: 50 % of the normal distribution with mean 0 and deviation 0.002 lies outside 0 to 0.500";
    let said = unwrapped(&done_in(path, &["campaign", "plan", "c.toml"]));
    assert!(said.contains(expected), "{said}");
    let document = json_in(path, &["campaign", "plan", "c.toml", "--out", "j.json"]);
    schemas::assert_valid("campaign-plan", &document);
    assert_eq!(document["truncations"][0]["quantity"], "dead_time_s");
    done_in(path, &RUN);
    let report = ["campaign", "report", "plan.json", "--parts", "parts", "--html", "r.html"];
    let said = unwrapped(&done_in(path, &report));
    assert!(said.contains(expected), "{said}");
    assert!(std::fs::read_to_string(path.join("r.html")).unwrap().contains(expected));
    std::fs::write(path.join("d.toml"), text.replace("mean = 0.0", "mean = 0.1")).unwrap();
    let said = done_in(path, &["campaign", "plan", "d.toml", "--out", "d.json"]);
    assert!(!said.contains("normal distribution"), "{said}");
}
