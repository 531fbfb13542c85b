//! Responses over time, and what a step response is judged by; the definitions are those of the
//! reference the thesis was recomputed with.

use control::Config;
use nalgebra::Complex;
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::Result;
use crate::loops::{ClosedLoop, loops_of, outer_gains};
use crate::plant::StateSpace;

/// How long responses are followed, s: three time constants of the thesis' slowest closed-loop pole
/// (0.057 rad/s).
pub const LONG_S: f64 = 60.0;
/// Time step of continuous responses, s.
const FINE_S: f64 = 1e-3;

/// A response, one value every `period_s`, from the step on.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Time between values, s.
    pub period_s: f64,
    /// Divided by the size of the step.
    pub values: Vec<f64>,
}

impl Response {
    /// Time and value.
    pub fn points(&self) -> Vec<(f64, f64)> {
        self.values.iter().enumerate().map(|(k, y)| (k as f64 * self.period_s, *y)).collect()
    }

    fn of(system: &StateSpace, duration_s: f64, input: impl Fn(f64) -> f64) -> Result<Self> {
        let period_s = system.period_s.unwrap_or(FINE_S);
        let count = (duration_s / period_s).round() as usize + 1;
        let values = system.simulate(period_s, |k| input(k as f64 * period_s), count)?;
        Ok(Self { period_s, values })
    }
}

/// Which way through a closed loop, as a single-input system.
pub(crate) fn path(closed: &StateSpace, input: usize, output: usize) -> StateSpace {
    StateSpace {
        a: closed.a.clone(),
        b: closed.b.columns(input, 1).into_owned(),
        c: closed.c.rows(output, 1).into_owned(),
        d: closed.d.view((output, input), (1, 1)).into_owned(),
        period_s: closed.period_s,
    }
}

/// The response to a unit step of the command: through the prefilter, or for an outer loop through
/// its rate limit with a step of 1 m.
pub fn commanded_step(closed: &ClosedLoop, rate_limit_m_s: Option<f64>, duration_s: f64) -> Result<Response> {
    let system = closed.prefilter.then(&path(&closed.closed, 0, 0))?;
    match rate_limit_m_s {
        None => Response::of(&system, duration_s, |_| 1.0),
        Some(rate) => {
            // The law moves its reference before it uses it; the continuous ramp starts from zero.
            let ahead_s = closed.closed.period_s.unwrap_or(0.0);
            Response::of(&system, duration_s, |t| (rate * (t + ahead_s)).min(1.0))
        }
    }
}

/// The response to a commanded step as the law of `config` takes it, over [`LONG_S`]: through the
/// prefilter, or 1 m through the rate limit.
pub fn commanded(config: &Config, closed: &ClosedLoop) -> Result<Response> {
    let limit = outer_gains(loops_of(config), closed.name).map(|outer| outer.rate_limit_m_s);
    commanded_step(closed, limit, LONG_S)
}

/// The response to a unit step of the reference itself, without prefilter and rate limit.
pub fn bare_step(closed: &ClosedLoop, duration_s: f64) -> Result<Response> {
    Response::of(&path(&closed.closed, 0, 0), duration_s, |_| 1.0)
}

/// The response to a unit step of a disturbance at the actuator (appendix B), in the controlled
/// variable's unit per N or per rad/s^2.
pub fn disturbance_step(closed: &ClosedLoop, duration_s: f64) -> Result<Response> {
    Response::of(&path(&closed.closed, 1, 0), duration_s, |_| 1.0)
}

/// A mode of a closed loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Mode {
    /// Natural frequency, rad/s.
    pub frequency_rad_s: f64,
    /// Damping ratio; negative: grows.
    pub damping: f64,
}

/// The oscillating mode with the least damping, of the poles of a loop sampled every `period_s` (0:
/// continuous). Above 60 rad/s poles of filters ring too fast to be flown, and are left out.
pub fn least_damped(poles: &[Complex<f64>], period_s: f64) -> Option<Mode> {
    let continuous = |p: &Complex<f64>| if period_s > 0.0 { p.ln() / period_s } else { *p };
    let modes = poles
        .iter()
        .filter(|p| period_s == 0.0 || p.norm() > 1e-6)
        .map(continuous)
        .filter(|s| s.im > 1e-6 && s.im < 60.0)
        .map(|s| Mode { frequency_rad_s: s.norm(), damping: -s.re / s.norm() });
    modes.min_by(|a, b| a.damping.total_cmp(&b.damping))
}

/// The least damped mode that a step of the reference shows: modes whose part of the response is
/// less than a fiftieth of the step do not count. Such are slow ones that a zero of the closed loop
/// nearly cancels, whatever their damping.
///
/// The part of a mode at the pole p is twice its residue of T(s)/s, here `T(p + e) e / p` with a
/// small e.
pub(crate) fn least_damped_seen(closed: &StateSpace) -> Result<Option<Mode>> {
    const SEEN: f64 = 0.02;
    let mut poles = closed.poles()?;
    poles.retain(|pole| {
        let apart = Complex::new(1e-6 * pole.norm().max(1e-3), 0.0);
        let part = 2.0 * (closed.at(pole + apart, 0, 0) * apart / pole).norm();
        !(part < SEEN)
    });
    Ok(least_damped(&poles, 0.0))
}

/// Numbers of one step response, which is divided by the size of the step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct StepMetrics {
    /// How far the greatest value lies above 1, per cent, at least 0.
    pub overshoot_percent: f64,
    /// From 10 % to 90 %, first crossings, interpolated, s; `None` if either is not reached.
    pub rise_s: Option<f64>,
    /// Time from which on the response stays within 5 % of 1, s; `None` if it is outside at the
    /// end.
    pub settling_5_s: Option<f64>,
    /// Time from which on it stays within 2 % of 1, s; `None` if it is outside at the end.
    pub settling_2_s: Option<f64>,
    /// Mean of 1 minus the response over the last second.
    pub steady_state_error: f64,
    /// First local maximum above 0.3, and its time, s.
    pub first_peak: Option<(f64, f64)>,
    /// Least value after the first peak.
    pub lowest_after_peak: Option<f64>,
    /// Last value.
    pub last: f64,
}

/// Measures a response that starts at the step, one value every `period_s`.
///
/// # Panics
/// When `response` is empty.
pub fn step_metrics(response: &[f64], period_s: f64) -> StepMetrics {
    let last = response[response.len() - 1];
    let greatest = response.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let tail = ((1.0 / period_s).round() as usize).clamp(1, response.len());
    let mean = response[response.len() - tail..].iter().sum::<f64>() / tail as f64;
    let peak = (2..response.len()).map(|k| k - 1).find(|&k| {
        response[k] - response[k - 1] > 0.0 && response[k + 1] - response[k] <= 0.0 && response[k] > 0.3
    });
    StepMetrics {
        overshoot_percent: (100.0 * (greatest - 1.0)).max(0.0),
        rise_s: crossing_s(response, period_s, 0.9)
            .zip(crossing_s(response, period_s, 0.1))
            .map(|(high, low)| high - low),
        settling_5_s: settling_s(response, period_s, 0.05),
        settling_2_s: settling_s(response, period_s, 0.02),
        steady_state_error: 1.0 - mean,
        first_peak: peak.map(|k| (response[k], k as f64 * period_s)),
        lowest_after_peak: peak.map(|k| response[k..].iter().copied().fold(f64::INFINITY, f64::min)),
        last,
    }
}

fn crossing_s(response: &[f64], period_s: f64, level: f64) -> Option<f64> {
    let after = response.iter().position(|&value| value >= level)?;
    let Some(before) = after.checked_sub(1) else { return Some(0.0) };
    let part = (level - response[before]) / (response[after] - response[before]);
    Some((before as f64 + part) * period_s)
}

fn settling_s(response: &[f64], period_s: f64, band: f64) -> Option<f64> {
    match response.iter().rposition(|value| !((value - 1.0).abs() <= band)) {
        None => Some(0.0),
        Some(outside) if outside + 1 < response.len() => Some((outside + 1) as f64 * period_s),
        Some(_) => None,
    }
}

/// The response `after_s` after the step, interpolated; `None` beyond its end.
pub fn value_at(response: &[f64], period_s: f64, after_s: f64) -> Option<f64> {
    let place = after_s / period_s;
    // A time that is a whole number of samples but for rounding is that sample.
    let nearest = place.round();
    let place = if (place - nearest).abs() < 1e-6 { nearest } else { place };
    let before = place.floor() as usize;
    let part = place - place.floor();
    let first = *response.get(before)?;
    if part == 0.0 {
        return Some(first);
    }
    Some(first + part * (response.get(before + 1)? - first))
}

#[cfg(test)]
mod tests {
    //! Against the closed forms of first- and second-order systems.

    use super::*;

    const PERIOD_S: f64 = 0.001;

    fn response(duration_s: f64, value: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..=(duration_s / PERIOD_S) as usize).map(|k| value(k as f64 * PERIOD_S)).collect()
    }

    #[test]
    fn first_order_lag() {
        let metrics = step_metrics(&response(10.0, |t| 1.0 - (-t).exp()), PERIOD_S);
        // Rise ln 9, settling ln 20 and ln 50 time constants; times are known to a sample, the rise
        // by interpolation.
        assert!((metrics.rise_s.unwrap() - 9.0_f64.ln()).abs() < 1e-5);
        assert!((metrics.settling_5_s.unwrap() - 20.0_f64.ln()).abs() <= PERIOD_S);
        assert!((metrics.settling_2_s.unwrap() - 50.0_f64.ln()).abs() <= PERIOD_S);
        assert_eq!(metrics.overshoot_percent, 0.0);
        assert_eq!(metrics.first_peak, None);
        assert!(metrics.steady_state_error < 2e-4);
    }

    #[test]
    fn second_order_oscillation() {
        let (zeta, w) = (0.3_f64, 4.0_f64);
        let wd = w * (1.0 - zeta * zeta).sqrt();
        let y = |t: f64| 1.0 - (-zeta * w * t).exp() * ((wd * t).cos() + zeta * w / wd * (wd * t).sin());
        let metrics = step_metrics(&response(10.0, y), PERIOD_S);
        let overshoot = 100.0 * (-std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
        assert!((metrics.overshoot_percent - overshoot).abs() < 1e-3, "{metrics:?} {overshoot}");
        let (peak, time_s) = metrics.first_peak.unwrap();
        assert!(
            (time_s - std::f64::consts::PI / wd).abs() <= PERIOD_S
                && (peak - 1.0 - overshoot / 100.0).abs() < 1e-5
        );
    }

    #[test]
    fn what_is_not_reached_is_none() {
        let slow = step_metrics(&response(1.0, |t| 0.5 * t), PERIOD_S);
        assert_eq!((slow.rise_s, slow.settling_5_s, slow.settling_2_s), (None, None, None));
        let gone = step_metrics(&[0.0, 0.5, f64::NAN], PERIOD_S);
        assert_eq!(gone.settling_5_s, None);
    }

    #[test]
    fn values_between_samples_are_interpolated() {
        let line = response(1.0, |t| t);
        for after_s in [0.0, 0.3, 0.4567, 1.0] {
            assert!((value_at(&line, PERIOD_S, after_s).unwrap() - after_s).abs() < 1e-12);
        }
        assert_eq!(value_at(&line, PERIOD_S, 1.01), None);
    }
}
