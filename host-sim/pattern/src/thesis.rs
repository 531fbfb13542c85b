//! Excitation of identification flights, thesis 4.2.1: a sine on each motor command whose frequency
//! and amplitude are drawn anew at another interval for each motor.
//!
//! The thesis draws both with Simulink's Band-Limited White Noise block: noise power 0.1 for the
//! frequency, times 8 Hz and the absolute value taken; noise power 0.25 for the amplitude, times 15
//! us plus 15 us and the absolute value taken. That block holds a normal random number of variance
//! (noise power) / (its sample time). Our reading: its sample time is the interval at which that
//! motor's values change (2, 2.1, 1.8, 2.31 s), because the values are "kept constant for several
//! seconds and then changed". So frequencies are |N(0, 8 Hz sqrt(0.1 / 2 s))|, 1.4 Hz in the mean,
//! and amplitudes |15 us + N(0, 15 us sqrt(0.25 / 2 s))|, mostly 10 to 20 us. (With the loop's 0.01
//! s as sample time frequencies would be 20 Hz, which motors with a lag of 21.5 rad/s do not
//! follow.)
//!
//! The phase runs on through a change: the thesis does not say, and a jump would add nothing that
//! is wanted.

use std::f64::consts::TAU;

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::random::{Purpose, stream};

/// Interval at which each motor's sine changes, s.
const CHANGE_S: [f64; 4] = [2.0, 2.1, 1.8, 2.31];
const FREQUENCY_NOISE_POWER: f64 = 0.1;
const FREQUENCY_SCALE_HZ: f64 = 8.0;
const AMPLITUDE_NOISE_POWER: f64 = 0.25;
const AMPLITUDE_SCALE_US: f64 = 15.0;
const AMPLITUDE_OFFSET_US: f64 = 15.0;

/// The four sines of one flight.
#[derive(Debug, Clone)]
pub struct Excitation {
    motors: [Sine; 4],
    period_s: f64,
    gain: f64,
    tick: u32,
    generator: Pcg64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sine {
    frequency_hz: f64,
    amplitude: f64,
    phase_rad: f64,
    change_tick: u32,
}

impl Excitation {
    /// The excitation of flight `seed`. `gain` is command units for one microsecond (1 for the
    /// thesis' craft).
    pub fn new(seed: u64, period_s: f64, gain: f64) -> Self {
        Self {
            motors: [Sine::default(); 4],
            period_s,
            gain,
            tick: 0,
            generator: stream(seed, Purpose::Excitation),
        }
    }

    /// What is added to the four motor commands in this tick, command units.
    #[inline]
    pub fn next_sample(&mut self) -> [f32; 4] {
        let Self { motors, period_s, gain, tick, generator } = self;
        let now = *tick;
        *tick += 1;
        std::array::from_fn(|k| {
            let (sine, change_s) = (&mut motors[k], CHANGE_S[k]);
            if now >= sine.change_tick {
                (sine.frequency_hz, sine.amplitude) = draw(generator, change_s, *gain);
                sine.change_tick += (change_s / *period_s).round().max(1.0) as u32;
            }
            let value = sine.amplitude * sine.phase_rad.sin();
            sine.phase_rad = (sine.phase_rad + TAU * sine.frequency_hz * *period_s) % TAU;
            value as f32
        })
    }
}

/// A frequency in Hz and an amplitude in command units.
fn draw(generator: &mut Pcg64, change_s: f64, gain: f64) -> (f64, f64) {
    let mut block = |noise_power: f64| -> f64 {
        let w: f64 = StandardNormal.sample(generator);
        (noise_power / change_s).sqrt() * w
    };
    let frequency_hz = (FREQUENCY_SCALE_HZ * block(FREQUENCY_NOISE_POWER)).abs();
    let amplitude = (AMPLITUDE_OFFSET_US + AMPLITUDE_SCALE_US * block(AMPLITUDE_NOISE_POWER)).abs();
    (frequency_hz, gain * amplitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawn_values_have_the_statistics_of_the_text() {
        let mut generator = stream(1, Purpose::Excitation);
        let draws: Vec<_> = (0..20_000).map(|_| draw(&mut generator, 2.0, 1.0)).collect();
        let mean = |pick: fn(&(f64, f64)) -> f64| draws.iter().map(pick).sum::<f64>() / draws.len() as f64;
        // |N(0, s)| has the mean s sqrt(2/pi); s = 8 sqrt(0.1/2). 20,000 draws know it to 0.5 %, thrice that is allowed.
        let expected = 8.0 * (0.05_f64).sqrt() * (2.0 / std::f64::consts::PI).sqrt();
        assert!((mean(|d| d.0) / expected - 1.0).abs() < 0.016, "{} {expected}", mean(|d| d.0));
        // The fold at zero (15 us are 2.8 deviations away) shifts the mean by 0.01 us.
        assert!((mean(|d| d.1) - 15.0).abs() < 0.15, "{}", mean(|d| d.1));
        let deviation = (draws.iter().map(|d| (d.1 - 15.0).powi(2)).sum::<f64>() / 20_000.0).sqrt();
        assert!((deviation / (15.0 * 0.125_f64.sqrt()) - 1.0).abs() < 0.03, "{deviation}");
    }

    #[test]
    fn sines_run_smoothly_and_change_when_they_should() {
        let mut excitation = Excitation::new(5, 0.01, 1.0);
        let mut amplitudes = [0.0; 4];
        let mut changes: [Vec<u32>; 4] = Default::default();
        for tick in 0..1000 {
            let sample = excitation.next_sample();
            assert!(sample.iter().all(|v| v.abs() < 50.0), "{sample:?}");
            for (k, sine) in excitation.motors.iter().enumerate() {
                if sine.amplitude != amplitudes[k] {
                    amplitudes[k] = sine.amplitude;
                    changes[k].push(tick);
                }
            }
        }
        assert_eq!(changes[0], [0, 200, 400, 600, 800]);
        assert_eq!(changes[2], [0, 180, 360, 540, 720, 900]);
        assert_eq!(changes[3], [0, 231, 462, 693, 924]);
    }

    #[test]
    fn motors_are_not_correlated_and_seeds_differ() {
        let record = |seed| -> Vec<[f32; 4]> {
            let mut excitation = Excitation::new(seed, 0.01, 1.0);
            (0..6000).map(|_| excitation.next_sample()).collect()
        };
        let one = record(1);
        assert_eq!(one, record(1));
        assert_ne!(one, record(2));
        let dot = |a: usize, b: usize| one.iter().map(|s| f64::from(s[a] * s[b])).sum::<f64>();
        for (a, b) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let correlation = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
            // 60 s hold about 30 draws a motor; sines that meet by chance in one of them add up to
            // a few per cent.
            assert!(correlation.abs() < 0.3, "{a} {b} {correlation}");
        }
    }
}
