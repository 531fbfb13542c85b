//! Flights of an independent simulator with physics that no catalogue has (shared data): the form of what is hidden is found, with
//! its sizes, by the real command; nothing is proposed where nothing is hidden, or only turbulence.

mod common;
#[path = "common/schemas.rs"]
mod schemas;

use std::path::Path;

use common::{json_of_case, shared};
use serde_json::Value;

/// What is proposed for a case: the document, and the folder with the basic model and the effects that were written.
fn discovered(root: &Path, case: &str) -> (Value, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let vehicle = root.join(case).join("vehicle.toml").display().to_string();
    let identify = ["identify", "--vehicle", &vehicle, "--out", "model.toml"];
    json_of_case(folder.path(), &identify, &root.join(case));
    let discover = ["discover", "--model", "model.toml", "--out", "effects.toml", "--html", "discovery.html"];
    let document = json_of_case(folder.path(), &discover, &root.join(case));
    schemas::assert_valid("discover", &document);
    let page = std::fs::read_to_string(folder.path().join("discovery.html")).unwrap();
    // A page has each form over the residual; of nothing there is no figure.
    let proposals = document["proposals"].as_array().unwrap();
    assert_eq!(page.contains("the form"), !proposals.is_empty(), "{case}");
    (document, folder)
}

fn truth(root: &Path, case: &str) -> Value {
    let text = std::fs::read_to_string(root.join("truth.json")).unwrap();
    serde_json::from_str::<Value>(&text).unwrap()[case].clone()
}

fn words(value: &Value) -> Vec<&str> {
    let mut words: Vec<&str> = value.as_array().unwrap().iter().map(|word| word.as_str().unwrap()).collect();
    words.sort_unstable();
    words
}

/// The first proposal depends on the right quantities only, by one formula of the right numbers, and takes most of what the true
/// form takes.
#[test]
fn hidden_forms_are_found_with_their_sizes() {
    let Some(root) = shared("data/unknown") else { return };
    let renamed = |name: &str| match name {
        "t0" | "n0" => "center",
        "s" => "width",
        "c" => "beyond",
        _ => "k",
    };
    for case in ["unknown-01", "unknown-02", "unknown-05", "unknown-06"] {
        let truth = truth(&root, case);
        let (document, folder) = discovered(&root, case);
        assert_eq!(document["verdict"], "proposed", "{case}");
        let best = &document["proposals"][0];
        assert_eq!(words(&best["quantities"]), words(&truth["variables"]), "{case}");
        assert!(best["p_value"].as_f64().unwrap() < 1e-4, "{case}: {best}");
        let oracle = truth["oracle"]["coef"].as_object().unwrap();
        let found = best["coefficients"].as_array().unwrap();
        assert_eq!(found.len(), oracle.len(), "{case}: {best}");
        for name in oracle.keys() {
            let own =
                found.iter().find(|c| c["name"] == renamed(name)).unwrap_or_else(|| panic!("{case}: {name}"));
            // Its size is what the true form's fit to the same flights gives.
            let expected = truth["oracle_fit"][name].as_f64().unwrap();
            let (value, error) = (own["value"].as_f64().unwrap(), own["std_error"].as_f64().unwrap());
            assert!(
                (value - expected).abs() < 3.0 * error + 0.01 * expected.abs(),
                "{case}: {name} {own} {expected}"
            );
        }
        assert!(best["share_of_structure_percent"].as_f64().unwrap() > 80.0, "{case}: {best}");
        assert_errors_fall_as_with_the_true_form(case, best, &truth);
        assert!(folder.path().join("effects.toml").is_file());
    }
}

/// At least 80 % of the fall of the squared error by the true form, each axis in units of what that leaves.
fn assert_errors_fall_as_with_the_true_form(case: &str, best: &Value, truth: &Value) {
    let (mut found, mut oracle) = (0.0, 0.0);
    for (axis, drop) in best["drop_percent"].as_object().unwrap() {
        let of = |which: &str| truth[which][axis].as_f64().unwrap();
        oracle += (of("sse_basic") - of("sse_oracle")) / of("sse_oracle");
        found += of("sse_basic") * drop.as_f64().unwrap() / 100.0 / of("sse_oracle");
    }
    assert!(found > 0.8 * oracle, "{case}: {found} of {oracle}");
}

#[test]
fn where_nothing_is_hidden_nothing_is_proposed_and_turbulence_is_no_formula() {
    let Some(root) = shared("data/unknown") else { return };
    for (case, verdict) in [("unknown-03", "nothing"), ("unknown-04", "not-a-formula")] {
        let (document, folder) = discovered(&root, case);
        assert_eq!(document["verdict"], verdict, "{case}");
        assert_eq!(document["proposals"], Value::Array(Vec::new()), "{case}");
        assert!(!folder.path().join("effects.toml").exists(), "nothing proposed, nothing written");
    }
}

/// What was written is an effect as any other: it joins the model with the sizes that were told.
#[test]
fn a_proposal_is_added_like_any_other_effect() {
    let Some(root) = shared("data/unknown") else { return };
    let (document, folder) = discovered(&root, "unknown-06");
    let add =
        ["add", "discovered-1", "--effects", "effects.toml", "--model", "model.toml", "--out", "better.toml"];
    let added = json_of_case(folder.path(), &add, &root.join("unknown-06"));
    assert_eq!(added["supported"], true, "{added}");
    let told = document["proposals"][0]["coefficients"].as_array().unwrap();
    for (own, told) in added["finding"]["coefficients"].as_array().unwrap().iter().zip(told) {
        let off = own["value"].as_f64().unwrap() - told["value"].as_f64().unwrap();
        assert!(off.abs() < 0.1 * told["std_error"].as_f64().unwrap(), "{own} {told}");
    }
    let left = ["discover", "--model", "better.toml"];
    let left = json_of_case(folder.path(), &left, &root.join("unknown-06"));
    assert_eq!(left["verdict"], "nothing", "{left}");
}

/// The step of `explain` proposes what the command by itself does.
#[test]
fn an_explanation_ends_with_what_is_discovered() {
    let Some(root) = shared("data/unknown") else { return };
    let folder = tempfile::tempdir().unwrap();
    let vehicle = root.join("unknown-02/vehicle.toml").display().to_string();
    let explain = ["explain", "--discover", "--vehicle", &vehicle, "--out", "explained.toml"];
    let explained = json_of_case(folder.path(), &explain, &root.join("unknown-02"));
    schemas::assert_valid("explain", &explained);
    assert_eq!(explained["discovery"]["proposals"][0]["formula"], "r: k * w", "{explained}");
    let discover = ["discover", "--vehicle", &vehicle];
    let alone = json_of_case(folder.path(), &discover, &root.join("unknown-02"));
    assert_eq!(alone["proposals"], explained["discovery"]["proposals"]);
}
