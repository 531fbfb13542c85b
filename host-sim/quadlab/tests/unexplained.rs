//! What no effect of the catalogue accounts for is said, also where nothing that was measured goes with it.

mod common;

use std::path::Path;

use common::{copies, json_in, with_sets};

/// Moves a craft to the north as a force does that nothing measured follows: sines of 2 to 4 rad/s, 1 m/s^2 altogether.
fn push(path: &Path, flight: u32) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let place = |name: &str| header.split(',').position(|own| own == name).unwrap();
    let (t, x) = (place("t"), place("x"));
    let mut pushed = vec![header.to_owned()];
    for line in lines {
        let mut row: Vec<String> = line.split(',').map(str::to_owned).collect();
        let time: f64 = row[t].parse().unwrap();
        if let Ok(north) = row[x].parse::<f64>() {
            let moved = |k: u32| {
                let rate_rad_s = 2.0 + 0.5 * f64::from(k) + 0.07 * f64::from(flight);
                0.25 / rate_rad_s.powi(2) * (rate_rad_s * time + f64::from(k * flight)).sin()
            };
            row[x] = (north - (0..4).map(moved).sum::<f64>()).to_string();
        }
        pushed.push(row.join(","));
    }
    std::fs::write(path, pushed.join("\n") + "\n").unwrap();
}

#[test]
fn a_force_that_nothing_measured_follows_is_unexplained() {
    let folder = copies();
    let explain = with_sets(&["explain", "--vehicle", "vehicle.toml", "--out", "model.toml", "--force"]);
    let translation =
        |found: &serde_json::Value| found["verdicts"]["translation"].as_str().unwrap().to_owned();
    let found = json_in(folder.path(), &explain);
    // An effect is hidden in the craft, and found.
    assert_eq!(translation(&found), "missing-effect");
    assert_eq!(found["unexplained"].as_array().unwrap().len(), 0, "{}", found["unexplained"]);
    for (name, flight) in ["A.csv", "B.csv", "C.csv", "D.csv", "E.csv"].into_iter().zip(1..) {
        push(&folder.path().join(name), flight);
    }
    let found = json_in(folder.path(), &explain);
    assert_eq!(translation(&found), "unexplained");
    let axes: Vec<&str> =
        found["unexplained"].as_array().unwrap().iter().map(|left| left["axis"].as_str().unwrap()).collect();
    assert!(axes.contains(&"u") && !axes.contains(&"p"), "{axes:?}");
}
