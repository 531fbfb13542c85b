//! The standard set with and without noise, and what a change in the loop does to it.

use sil::{NoiseModel, Scenario, Settings, Suite, Transport};

fn suite(scenarios: &[Scenario], settings: &Settings) -> Suite {
    Suite::fly(scenarios, settings, &Transport::InProcess, |_| {}).expect("scenarios can be flown")
}

fn standard() -> Vec<Scenario> {
    Scenario::standard().collect()
}

fn failed(suite: &Suite) -> Vec<&'static str> {
    suite.outcomes.iter().filter(|o| !o.pass()).map(|o| o.scenario.name()).collect()
}

#[test]
fn the_standard_set_passes_with_ideal_sensors() {
    assert_eq!(failed(&suite(&standard(), &Settings::default())), [""; 0]);
}

#[test]
fn the_standard_set_passes_with_noise_for_several_seeds() {
    for seed in 1..=6 {
        let settings = Settings { noise: Some(NoiseModel::default()), seed, ..Settings::default() };
        assert_eq!(failed(&suite(&standard(), &settings)), [""; 0], "seed {seed}");
    }
}

#[test]
fn a_sample_more_of_delay_fails() {
    let settings = Settings { delay_samples: 3, ..Settings::default() };
    let outcome = suite(&[Scenario::Roll10, Scenario::Pitch10], &settings);
    assert_eq!(failed(&outcome), ["roll-10", "pitch-10"]);
    assert!(outcome.outcomes.iter().all(|o| o.lost_control));
}

#[test]
fn roll_30_is_beyond_the_design() {
    let outcome = suite(&[Scenario::Roll30], &Settings::default());
    assert!(outcome.outcomes[0].lost_control && !outcome.pass());
}

#[test]
fn equal_runs_have_equal_hashes_and_unequal_ones_do_not() {
    let scenarios = [Scenario::Hover, Scenario::Yaw30];
    let noisy = |seed| Settings { noise: Some(NoiseModel::default()), seed, ..Settings::default() };
    let hash = |settings: &Settings| suite(&scenarios, settings).pwm_sha256;
    assert_eq!(hash(&noisy(1)), hash(&noisy(1)));
    assert_ne!(hash(&noisy(1)), hash(&noisy(2)));
    // Without noise the seed is of no consequence.
    let ideal = |seed| Settings { seed, ..Settings::default() };
    assert_eq!(hash(&ideal(1)), hash(&ideal(2)));
    let reversed = suite(&[Scenario::Yaw30, Scenario::Hover], &ideal(1)).pwm_sha256;
    assert_ne!(hash(&ideal(1)), reversed);
}

#[test]
fn json_has_the_fields_of_the_contract() {
    let suite = suite(&[Scenario::Roll10, Scenario::Hover], &Settings::default());
    let document: serde_json::Value = serde_json::from_str(&suite.to_json()).unwrap();
    assert_eq!(document["pwm_sha256"].as_str().unwrap().len(), 64);
    let roll = &document["scenarios"][0];
    for field in [
        "name",
        "pass",
        "lost_control",
        "overshoot_percent",
        "rise_s",
        "settling_5_s",
        "settling_2_s",
        "steady_state_error",
        "saturated_ticks",
        "samples",
    ] {
        assert!(roll.get(field).is_some(), "{field}");
    }
    let times: Vec<f64> =
        roll["samples"].as_array().unwrap().iter().map(|s| s[0].as_f64().unwrap()).collect();
    for time_s in [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0] {
        assert!(times.contains(&time_s), "{time_s} s in {times:?}");
    }
    assert_eq!(document["scenarios"][1]["name"], "hover");
}
