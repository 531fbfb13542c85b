//! A stretch of a flight without gaps, and how fast its rotors turned.

use model::rotor_lag::{RotorLag, decayed};
use model::{Adjustments, Vehicle};
use nalgebra::{Matrix3, Vector3};

use crate::filter::convolve;
use crate::prepare::hermite::hermite;

/// A stretch of a flight without gaps, evenly sampled.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Time of each sample, s.
    pub time_s: Vec<f64>,
    /// Position of the tracked point NED, m.
    pub position_ned_m: [Vec<f64>; 3],
    /// Phi, theta, psi as logged, unwrapped.
    pub euler_rad: [Vec<f64>; 3],
    /// Inertial to body, from the attitude as logged.
    pub dcm: Vec<Matrix3<f64>>,
    /// Of the tracked point: logged, or the derivative of the position.
    pub velocity_ned_m_s: [Vec<f64>; 3],
    /// Gyro less its bias.
    pub rate_rad_s: [Vec<f64>; 3],
    /// Motor commands, in the unit of the vehicle file.
    pub command: [Vec<f64>; 4],
    /// Rotor speeds as logged, rad/s.
    pub logged_rotor_rad_s: Option<[Vec<f64>; 4]>,
    /// Battery voltage, V.
    pub battery_v: Vec<f64>,
    /// Specific force along the body axes, m/s^2.
    pub imu_m_s2: Option<[Vec<f64>; 3]>,
    /// Whether a sample's sensor values were all logged, not filled in: only those carry the
    /// sensors' noise.
    pub measured: Vec<bool>,
}

/// One rotor over a stretch.
pub struct RotorTrack {
    /// Speed at every sample, rad/s.
    pub speed_rad_s: Vec<f64>,
    /// Mean speed between neighbouring samples, rad/s, one fewer.
    pub mean_rad_s: Vec<f64>,
}

impl Stretch {
    /// A part of it.
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        fn cut<const N: usize>(all: &[Vec<f64>; N], range: &std::ops::Range<usize>) -> [Vec<f64>; N] {
            all.each_ref().map(|one| one[range.clone()].to_vec())
        }
        Self {
            time_s: self.time_s[range.clone()].to_vec(),
            position_ned_m: cut(&self.position_ned_m, &range),
            euler_rad: cut(&self.euler_rad, &range),
            dcm: self.dcm[range.clone()].to_vec(),
            velocity_ned_m_s: cut(&self.velocity_ned_m_s, &range),
            rate_rad_s: cut(&self.rate_rad_s, &range),
            command: cut(&self.command, &range),
            logged_rotor_rad_s: self.logged_rotor_rad_s.as_ref().map(|all| cut(all, &range)),
            battery_v: self.battery_v[range.clone()].to_vec(),
            imu_m_s2: self.imu_m_s2.as_ref().map(|all| cut(all, &range)),
            measured: self.measured[range].to_vec(),
        }
    }

    /// Each rotor's speed. `late_s` is what the log's rotor samples come late: they are brought
    /// forward by it.
    pub fn rotors(
        &self,
        vehicle: &Vehicle,
        adjust: &Adjustments,
        period_s: f64,
        late_s: f64,
    ) -> [RotorTrack; 4] {
        let delay = (adjust.dead_time_s() - late_s) / period_s;
        if let Some(logged) = &self.logged_rotor_rad_s {
            return logged.each_ref().map(|speed| {
                let corrected: Vec<f64> = speed
                    .iter()
                    .zip(&self.battery_v)
                    .map(|(w, v)| adjust.corrected_speed_rad_s(*w, *v))
                    .collect();
                let speed_rad_s = if delay == 0.0 { corrected } else { shifted(&corrected, delay) };
                let mean_rad_s = speed_rad_s.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
                RotorTrack { speed_rad_s, mean_rad_s }
            });
        }
        let map = adjust.corrected_map(vehicle.rotor_map());
        let lag = adjust.lag_rad_s(vehicle.motors.lag);
        // The battery acts at the motor, without dead time and all the while: over a sample, the
        // mean of its ends. Held as it was at the sample's start, a sag would come half a sample
        // late and show as drag.
        let by_voltage: Vec<f64> = (0..self.battery_v.len())
            .map(|k| {
                let next = self.battery_v.get(k + 1).unwrap_or(&self.battery_v[k]);
                map.voltage * 0.5 * (self.battery_v[k] + next)
            })
            .collect();
        let by_voltage = lagged(&by_voltage, lag, -late_s / period_s, period_s);
        self.command.each_ref().map(|command| {
            let commanded: Vec<f64> = command.iter().map(|c| map.command * c + map.offset).collect();
            lagged(&commanded, lag, delay, period_s).plus(&by_voltage)
        })
    }
}

impl RotorTrack {
    /// The sum of two parts of the speed; a rotor does not turn backwards.
    fn plus(mut self, other: &Self) -> Self {
        let add = |to: &mut [f64], part: &[f64]| {
            to.iter_mut().zip(part).for_each(|(speed, part)| *speed = (*speed + part).max(0.0));
        };
        add(&mut self.speed_rad_s, &other.speed_rad_s);
        add(&mut self.mean_rad_s, &other.mean_rad_s);
        self
    }
}

/// Response of a first-order lag (at once, without one) to commands held over a sample, `delay`
/// samples late. Exact: between samples the response is an exponential.
fn lagged(commanded: &[f64], lag_rad_s: Option<f64>, delay: f64, period_s: f64) -> RotorTrack {
    // At once: an exponential that has died out within any part of a sample.
    let lag = lag_rad_s.unwrap_or(1e6 / period_s);
    let decay = |time_s: f64| RotorLag::new(lag).decay(time_s);
    let over_sample = decay(period_s);
    let mut at_samples = Vec::with_capacity(commanded.len());
    let mut now = commanded.first().copied().unwrap_or(0.0);
    for &target in commanded {
        at_samples.push(now);
        // `decayed` as a weighted mean: equal, but rounded otherwise, and results keep their bits.
        now = target * (1.0 - over_sample) + now * over_sample;
    }
    if delay == 0.0 {
        let weight = (1.0 - over_sample) / (lag * period_s);
        let mean_of = |(now, target): (&f64, &f64)| target + (now - target) * weight;
        let steps = commanded.len().saturating_sub(1);
        let mean_rad_s = at_samples.iter().zip(commanded).take(steps).map(mean_of).collect();
        return RotorTrack { speed_rad_s: at_samples, mean_rad_s };
    }
    let whole = delay.floor();
    // The sample before the moment asked for, and the time from it to that moment.
    let (back, part_s) = if delay == whole {
        (whole as isize, 0.0)
    } else {
        (whole as isize + 1, (1.0 - delay + whole) * period_s)
    };
    let last = commanded.len() as isize - 1;
    let clamped = |k: isize| k.clamp(0, last) as usize;
    let part_decay = decay(part_s);
    let speed_rad_s = (0..=last)
        .map(|k| {
            let from = clamped(k - back);
            decayed(at_samples[from], commanded[from], part_decay)
        })
        .collect();
    // From the moment to the next sample under one command, then as long under the next one as
    // makes a period.
    let (first_s, first_weight, second_weight) =
        (period_s - part_s, (part_decay - over_sample) / lag, (1.0 - part_decay) / lag);
    let mean_rad_s = (0..last)
        .map(|k| {
            let (a, b) = (clamped(k - back), clamped(k - back + 1));
            let first = commanded[a] * first_s + (at_samples[a] - commanded[a]) * first_weight;
            let second = commanded[b] * part_s + (at_samples[b] - commanded[b]) * second_weight;
            (first + second) / period_s
        })
        .collect();
    RotorTrack { speed_rad_s, mean_rad_s }
}

/// A signal `delay` samples late (early if negative), along cubic Hermite arcs.
fn shifted(signal: &[f64], delay: f64) -> Vec<f64> {
    let last = signal.len() as isize - 1;
    let value = |k: isize| signal[k.clamp(0, last) as usize];
    (0..=last)
        .map(|k| {
            let place = k as f64 - delay;
            let at = place.floor();
            let s = place - at;
            let at = at as isize;
            let [a, b, c, d] = [value(at - 1), value(at), value(at + 1), value(at + 2)];
            let (slope_b, slope_c) = (0.5 * (c - a), 0.5 * (d - b));
            hermite(s, 1.0, [b, c], [slope_b, slope_c])
        })
        .collect()
}

pub(crate) fn vector(parts: &[Vec<f64>; 3], k: usize) -> Vector3<f64> {
    Vector3::new(parts[0][k], parts[1][k], parts[2][k])
}

pub(crate) fn subtract(parts: &mut [Vec<f64>; 3], k: usize, amount: Vector3<f64>) {
    parts.iter_mut().zip(amount.iter()).for_each(|(part, a)| part[k] -= a);
}

/// The smoothed signal, and the signal itself where the window does not fit.
pub fn smoothed(signal: &[f64], taps: &[f64]) -> Vec<f64> {
    convolve(signal, taps, |k| signal[k])
}
