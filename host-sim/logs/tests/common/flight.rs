//! Flights that were made from a log by somebody else, to compare what we find in the log with.
#![allow(dead_code, reason = "not every test needs all of it")]

use std::collections::HashMap;
use std::path::Path;

use logs::Signal;

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

    /// Largest and mean difference of a column from values at times, `offset_s` after which the flight begins.
    pub(crate) fn differences(&self, name: &str, t: &[f64], values: &[f64], offset_s: f64) -> (f64, f64) {
        let differences: Vec<f64> = self
            .column("t")
            .iter()
            .zip(self.column(name))
            .filter_map(|(time, value)| Some((between(t, values, time + offset_s)? - value).abs()))
            .collect();
        assert!(differences.len() * 100 > self.column("t").len() * 95, "{name}: {} rows compared", differences.len());
        let largest = differences.iter().copied().fold(0.0, f64::max);
        (largest, differences.iter().sum::<f64>() / differences.len() as f64)
    }

    /// Asserts that a column is near.
    pub(crate) fn near(&self, name: &str, t: &[f64], values: &[f64], offset_s: f64, [largest, mean]: [f64; 2]) {
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
