//! Flights that were made from a log by somebody else, to compare what we find in the log with.
#![allow(dead_code, reason = "not every test needs all of it")]

use std::collections::HashMap;
use std::path::Path;

use logs::{Recording, Signal};

/// Columns of a flight file.
pub(crate) const POSITION: [&str; 3] = ["x", "y", "z"];
/// Columns of a flight file.
pub(crate) const VELOCITY: [&str; 3] = ["vx", "vy", "vz"];
/// Columns of a flight file.
pub(crate) const ANGLES: [&str; 3] = ["phi", "theta", "psi"];
/// Columns of a flight file.
pub(crate) const RATES: [&str; 3] = ["p", "q", "r"];
/// Columns of a flight file.
pub(crate) const FORCE: [&str; 3] = ["ax", "ay", "az"];
/// Columns of a flight file.
pub(crate) const COMMANDS: [&str; 4] = ["cmd1", "cmd2", "cmd3", "cmd4"];

/// Columns of a flight file; NaN where a field is empty.
pub(crate) struct Reference {
    columns: HashMap<String, Vec<f64>>,
}

impl Reference {
    pub(crate) fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next().unwrap().split(',').collect();
        let mut columns: HashMap<String, Vec<f64>> = HashMap::new();
        for line in lines {
            for (name, field) in names.iter().zip(line.split(',')) {
                columns.entry((*name).into()).or_default().push(field.parse().unwrap_or(f64::NAN));
            }
        }
        Self { columns }
    }

    pub(crate) fn column(&self, name: &str) -> &[f64] {
        &self.columns[name]
    }

    /// Largest and mean difference of a column from values at times, `offset_s` after which the flight
    /// begins.
    pub(crate) fn differences(&self, name: &str, t: &[f64], values: &[f64], offset_s: f64) -> (f64, f64) {
        let differences: Vec<f64> = self
            .column("t")
            .iter()
            .zip(self.column(name))
            .filter_map(|(time, value)| Some((between(t, values, time + offset_s)? - value).abs()))
            .collect();
        // Too few rows compared agree by chance.
        if differences.len() * 100 < self.column("t").len() * 95 {
            return (f64::INFINITY, f64::INFINITY);
        }
        let largest = differences.iter().copied().fold(0.0, f64::max);
        (largest, differences.iter().sum::<f64>() / differences.len() as f64)
    }

    /// When the flight begins on the clock of a position. The first 30 samples of the log were cut off,
    /// and gaps among them: so it is where it fits best.
    pub(crate) fn begin(&self, position: &Signal<3>, prepare: impl Fn(&[f64]) -> Vec<f64>) -> f64 {
        let misfit = |offset: &f64| -> f64 {
            let parts = POSITION.iter().zip(&position.values);
            parts.map(|(name, values)| self.differences(name, &position.t, &prepare(values), *offset).1).sum()
        };
        let offsets = (30..100).map(|k| position.t[0] + f64::from(k) * 0.01);
        offsets.min_by(|a, b| misfit(a).total_cmp(&misfit(b))).unwrap()
    }

    /// Asserts that a column is near.
    pub(crate) fn near(
        &self,
        name: &str,
        t: &[f64],
        values: &[f64],
        offset_s: f64,
        [largest, mean]: [f64; 2],
    ) {
        let found = self.differences(name, t, values, offset_s);
        assert!(found.0 <= largest && found.1 <= mean, "{name}: largest and mean difference {found:?}");
    }
}

/// Linear between rows; nothing outside.
fn between(t: &[f64], values: &[f64], time: f64) -> Option<f64> {
    let after = t.partition_point(|&t| t <= time);
    let (before, end) = (after.checked_sub(1)?, *t.get(after)?);
    Some(values[before] + (values[after] - values[before]) * (time - t[before]) / (end - t[before]))
}

/// Mean of each value and its two neighbours, as the reference conversion smooths.
pub(crate) fn smooth(values: &[f64]) -> Vec<f64> {
    let at = |k: usize| values[k.clamp(1, values.len()) - 1];
    (1..=values.len()).map(|k| (at(k - 1) + at(k) + at(k + 1)) / 3.0).collect()
}

/// Roll, pitch and yaw (unwrapped) of an attitude.
pub(crate) fn angles(attitude: &Signal<4>) -> [Vec<f64>; 3] {
    let mut angles = [const { Vec::new() }; 3];
    let mut last_yaw = 0.0;
    for row in 0..attitude.t.len() {
        let [w, x, y, z] = attitude.values.each_ref().map(|column| column[row]);
        angles[0].push((2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)));
        angles[1].push((2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin());
        let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
        let turns = ((last_yaw - yaw) / std::f64::consts::TAU).round();
        last_yaw = if turns.is_finite() { yaw + turns * std::f64::consts::TAU } else { yaw };
        angles[2].push(last_yaw);
    }
    angles
}

/// That a flight is that of a recording, made by the same steps from the same rows: means of three
/// rows, then 100 Hz by interpolation. Doing both here leaves the five digits that it is written with,
/// 5e-5 of the value: of 10 m/s^2, 5 rad/s or rad, 1 m.
pub(crate) fn smoothed_agrees(recording: &Recording, reference: &Reference) {
    let signals = &recording.signals;
    let position = signals.position.as_ref().unwrap();
    let smooth_near = |name: &str, t: &[f64], values: &[f64], offset: f64, tolerance: f64| {
        reference.near(name, t, &smooth(values), offset, [tolerance, tolerance]);
    };
    let offset = reference.begin(position, smooth);
    for (name, values) in POSITION.iter().zip(&position.values) {
        smooth_near(name, &position.t, values, offset, 6e-5);
    }
    let three = |names: [&str; 3], signal: &Signal<3>, tolerance: f64| {
        for (name, values) in names.iter().zip(&signal.values) {
            smooth_near(name, &signal.t, values, offset, tolerance);
        }
    };
    three(VELOCITY, signals.velocity.as_ref().unwrap(), 6e-5);
    three(RATES, signals.rates.as_ref().unwrap(), 3e-4);
    three(FORCE, signals.specific_force.as_ref().unwrap(), 1e-3);
    let attitude = signals.attitude.as_ref().unwrap();
    for (name, values) in ANGLES.iter().zip(&angles(attitude)) {
        smooth_near(name, &attitude.t, values, offset, 6e-5);
    }
    let commands = signals.commands.as_ref().unwrap();
    for (name, values) in COMMANDS.iter().zip(&commands.values) {
        smooth_near(name, &commands.t, values, offset, 6e-5);
    }
    let names: Vec<&str> = signals.extra.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["load_north", "load_east", "load_down"]);
    for (name, signal) in &signals.extra {
        // Written with four digits.
        smooth_near(name, &signal.t, &signal.values[0], offset, 6e-4);
    }
}
