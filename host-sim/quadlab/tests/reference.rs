//! `quadlab reference`: a man page for each command, a page for each effect, and schemas that real documents meet.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::path::Path;

use common::{copies, done_in, identify, json_in, run_in, with_sets};
use schemas::{assert_valid, reference};

/// The names under `Commands:` of a program's help.
fn subcommands(folder: &Path, words: &[&str]) -> Vec<String> {
    let help = done_in(folder, &[words, &["--help"]].concat());
    let section = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let entries = section.take_while(|line| !line.is_empty());
    let names = entries.filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
    names.filter_map(|line| line.split_whitespace().next()).map(ToOwned::to_owned).collect()
}

#[test]
fn every_command_has_a_man_page_and_completions() {
    let man = reference().join("man");
    let mut commands = vec!["quadlab".to_owned()];
    for name in subcommands(&reference(), &[]).iter().filter(|name| *name != "help") {
        commands.push(format!("quadlab-{name}"));
        let below = subcommands(&reference(), &[name]);
        commands.extend(below.iter().filter(|name| *name != "help").map(|b| format!("quadlab-{name}-{b}")));
    }
    assert!(commands.len() > 13, "{commands:?}");
    for command in &commands {
        let page = std::fs::read_to_string(man.join(format!("{command}.1"))).expect(command);
        assert!(page.contains(".SH SYNOPSIS"), "{command}");
    }
    assert_eq!(std::fs::read_dir(&man).unwrap().count(), commands.len());
    for name in ["quadlab.bash", "_quadlab", "quadlab.fish", "_quadlab.ps1"] {
        let text = std::fs::read_to_string(reference().join("completions").join(name)).expect(name);
        assert!(text.contains("diagnose") && text.contains("changed"), "{name}");
    }
}

#[test]
fn every_effect_has_a_page_with_its_definition() {
    let effects = reference().join("effects");
    let listed = json_in(&reference(), &["effects"]);
    assert_valid("effects", &listed);
    let contents = std::fs::read_to_string(effects.join("SUMMARY.md")).unwrap();
    let listed = listed.as_array().unwrap();
    assert_eq!(contents.lines().count(), listed.len());
    let mut pictures = 0;
    for effect in listed {
        let id = effect["effect"].as_str().unwrap();
        assert!(contents.contains(&format!("(effects/{id}.md)")), "{id}");
        let page = std::fs::read_to_string(effects.join(format!("{id}.md"))).expect(id);
        let told = ["sentence", "excitation"].map(|field| effect[field].as_str().unwrap());
        assert!(told.iter().all(|text| page.contains(&text[1..])), "{id}");
        for coefficient in effect["coefficients"].as_array().unwrap() {
            assert!(page.contains(&format!("| `{}` |", coefficient["name"].as_str().unwrap())), "{id}");
        }
        for other in effect["confused_with"].as_array().unwrap() {
            assert!(page.contains(other["effect"].as_str().unwrap()), "{id}");
        }
        let picture = effects.join(format!("{id}.svg"));
        assert_eq!(page.contains(&format!("({id}.svg)")), picture.is_file(), "{id}");
        pictures += usize::from(picture.is_file());
    }
    assert!(10 * pictures >= 9 * listed.len(), "{pictures} pictures");
}

#[test]
fn documents_of_flights_meet_their_schemas() {
    let folder = copies();
    let at = folder.path();
    let first = ["identify", "--vehicle", "vehicle.toml", "--out", "model.toml"];
    assert_valid("identify", &json_in(at, &with_sets(&first)));
    let add = with_sets(&["add", "ground-effect", "--model", "model.toml", "--out", "more.toml"]);
    assert_valid("add", &json_in(at, &add));
    let one = ["compare", "--model", "model.toml", "--flights", "D.csv"];
    assert_valid("compare", &json_in(at, &one));
    let two = ["compare", "--model", "model.toml", "more.toml", "--flights", "D.csv"];
    assert_valid("compare-models", &json_in(at, &two));
    let diagnose = with_sets(&["diagnose", "--model", "model.toml"]);
    assert_valid("diagnose", &json_in(at, &diagnose));
    let why = with_sets(&["diagnose", "--model", "model.toml", "--why", "ground-effect"]);
    assert_valid("diagnose-why", &json_in(at, &why));
    let changed = ["diagnose", "--model", "more.toml", "--changed", "D.csv", "E.csv"];
    assert_valid("diagnose", &json_in(at, &changed));
    let changed_why = [changed.as_slice(), &["--why", "motor-efficiency"]].concat();
    assert_valid("diagnose-changed-why", &json_in(at, &changed_why));
    let explain = with_sets(&["explain", "--vehicle", "vehicle.toml", "--out", "best.toml"]);
    assert_valid("explain", &json_in(at, &explain));
}

#[test]
fn documents_of_models_meet_their_schemas() {
    let folder = copies();
    let at = folder.path();
    identify(at);
    let linearize = ["linearize", "--model", "model.toml"];
    assert_valid("linearize", &json_in(at, &linearize));
    let design = ["design", "--model", "model.toml", "--out", "gains.toml", "--json"];
    let output = run_in(at, &design);
    assert_valid("design", &serde_json::from_slice(&output.stdout).unwrap());
    let check = ["design", "check", "--model", "model.toml", "--gains", "gains.toml", "--json"];
    // Status 1 is an answer, too.
    let output = run_in(at, &check);
    assert_valid("design-check", &serde_json::from_slice(&output.stdout).unwrap());
    let excite = ["excite", "--model", "model.toml", "--gains", "gains.toml", "--out", "p.csv"];
    assert_valid("excite", &json_in(at, &excite));
    let plan = ["plan", "--model", "model.toml", "--gains", "gains.toml", "--shrink", "C_du"];
    assert_valid("plan", &json_in(at, &plan));
}
