//! The craft's log: commands that hold from one sample to the next, and the battery's voltage
//! without the voltmeter's noise.

use flights::{GAP_PERIODS, median_step};
use model::rotor_lag::RotorLag;
use sysid::filter::RegressionFilter;
use sysid::prepare::smoothed;

use super::terms::Terms;
use super::voltage_noise::VoltageNoise;
use crate::stand::Stand;

/// Window over which the voltmeter's noise is smoothed away, s.
const VOLTAGE_WINDOW_S: f64 = 0.25;

/// The craft's log without missing values: commands centred and in parts of their range, for
/// numbers near one.
pub(super) struct CraftLog {
    pub(super) t: Vec<f64>,
    /// Of each motor.
    pub(super) command: Vec<Vec<f64>>,
    pub(super) volts: Vec<f64>,
    /// Noise of the voltage before it was smoothed.
    pub(super) noise: VoltageNoise,
    /// From which sample on there is no gap, for each sample.
    pub(super) since: Vec<usize>,
    pub(super) longest_s: f64,
}

impl CraftLog {
    pub(super) fn new(stand: &Stand) -> Self {
        let whole = |k: &usize| {
            stand.battery_v[*k].is_finite() && stand.motors.iter().all(|m| m.command[*k].is_finite())
        };
        let rows: Vec<usize> = (0..stand.craft_s.len()).filter(whole).collect();
        let pick = |column: &[f64]| -> Vec<f64> { rows.iter().map(|&k| column[k]).collect() };
        let t = pick(&stand.craft_s);
        let period_s = median_step(&t);
        let longest_s = GAP_PERIODS * period_s;
        let mut since = vec![0; t.len()];
        for k in 1..t.len() {
            since[k] = if t[k] - t[k - 1] > longest_s { k } else { since[k - 1] };
        }
        let raw = pick(&stand.battery_v);
        let taps = RegressionFilter::smoothing_taps(period_s, VOLTAGE_WINDOW_S);
        let mut volts = Vec::with_capacity(t.len());
        let mut start = 0;
        while start < t.len() {
            let end = (start..t.len()).find(|&k| since[k] > start).unwrap_or(t.len());
            volts.extend(smoothed(&raw[start..end], &taps));
            start = end;
        }
        let command = stand.motors.iter().map(|m| pick(&m.command)).collect();
        let noise = VoltageNoise::new(&raw, &since, taps, period_s);
        Self { t, command, volts, noise, since, longest_s }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.t.last().unwrap_or(&0.0) - self.t.first().unwrap_or(&0.0)
    }

    /// The features of a map at each sample, one vector a term. The battery acts all the while:
    /// over a sample, the mean of its ends.
    pub(super) fn features(&self, motor: usize, terms: Terms) -> Vec<Vec<f64>> {
        let count = terms.of(0.0, 0.0).len();
        let mut all = vec![Vec::with_capacity(self.t.len()); count];
        for (k, command) in self.command[motor].iter().enumerate() {
            let next = self.volts.get(k + 1).unwrap_or(&self.volts[k]);
            let volts = 0.5 * (self.volts[k] + next);
            all.iter_mut().zip(terms.of(*command, volts)).for_each(|(to, value)| to.push(value));
        }
        all
    }

    /// Sample that holds at a time of the craft's clock, if the log goes on there.
    pub(super) fn holding(&self, time_s: f64) -> Option<usize> {
        let k = self.t.partition_point(|t| *t <= time_s).checked_sub(1)?;
        let next = *self.t.get(k + 1)?;
        (next - self.t[k] <= self.longest_s).then_some(k)
    }
}

/// A feature after the lag: its value at samples, exact for features held between them.
pub(super) fn lagged(craft: &CraftLog, feature: &[f64], lag: RotorLag) -> Vec<f64> {
    let mut now = feature.first().copied().unwrap_or(0.0);
    (0..feature.len())
        .map(|k| {
            if k > 0 && craft.since[k] == k {
                now = feature[k];
            } else if k > 0 {
                now = lag.response(now, feature[k - 1], craft.t[k] - craft.t[k - 1]);
            }
            now
        })
        .collect()
}

pub(super) fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stand::Motor;

    /// 100 Hz, with a second without rows after 2 s. The command steps from 1 to 3 at 0.5 s.
    fn log() -> CraftLog {
        let craft_s: Vec<f64> =
            (0..400).map(|k| 0.01 * f64::from(k) + if k < 200 { 0.0 } else { 1.0 }).collect();
        let command = craft_s.iter().map(|t| if *t < 0.495 { 1.0 } else { 3.0 }).collect();
        let motor = Motor { number: 1, command, speed_rad_s: Vec::new() };
        let battery_v = craft_s.iter().map(|t| 12.0 - 0.1 * t).collect();
        CraftLog::new(&Stand { craft_s, battery_v, rotor_s: Vec::new(), motors: vec![motor] })
    }

    #[test]
    fn a_step_is_answered_by_the_exponential_and_a_gap_forgotten() {
        let craft = log();
        let answer = lagged(&craft, &craft.command[0], RotorLag::new(20.0));
        for (k, speed) in answer.iter().enumerate() {
            let since_s = craft.t[k] - 0.5;
            let exact = if since_s <= 0.0 || k >= 200 { 1.0 } else { 3.0 - 2.0 * (-20.0 * since_s).exp() };
            let exact = if k >= 200 { 3.0 } else { exact };
            assert!((speed - exact).abs() < 1e-12, "sample {k}: {speed} instead of {exact}");
        }
    }

    #[test]
    fn no_command_holds_within_a_gap() {
        let craft = log();
        assert_eq!(craft.holding(0.505), Some(50));
        assert_eq!(craft.holding(2.3), None);
        assert_eq!(craft.holding(3.005), Some(200));
        assert_eq!((craft.holding(-0.1), craft.holding(5.5)), (None, None));
    }

    /// The smoother is a polynomial fit and keeps a straight line, up to the gap's edges.
    #[test]
    fn smoothing_keeps_a_voltage_that_falls_evenly() {
        let craft = log();
        for (t, volts) in craft.t.iter().zip(&craft.volts) {
            assert!((volts - (12.0 - 0.1 * t)).abs() < 1e-9, "{t} s: {volts} V");
        }
    }
}
