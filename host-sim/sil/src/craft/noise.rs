//! Sensor noise: the thesis' recipe (5.5) as a model.
//!
//! The thesis took flights, subtracted the smoothed track from the raw one and replayed the rest,
//! because it "did not appear to match additive white Gaussian noise". Here that rest is a
//! first-order Gauss-Markov process for position and attitude, `n' = a n + s sqrt(1 - a^2) w` with
//! `a = exp(-Ts/tau)`, white noise with a constant bias for the gyro, white noise for the voltage.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use pattern::random::{Purpose, stream};

/// Noise with a memory.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coloured {
    /// Standard deviation, unit of the quantity.
    pub deviation: f64,
    /// Correlation time tau, s; 0 is white.
    pub correlation_s: f64,
}

/// How noisy the sensors are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseModel {
    /// Each coordinate of the tracked point, m.
    pub position: Coloured,
    /// Each tracked angle, rad.
    pub attitude: Coloured,
    /// Gyro, white part, rad/s.
    pub gyro_rad_s: f64,
    /// Gyro, spread of the bias that each flight draws for each axis, rad/s.
    pub gyro_bias_rad_s: f64,
    /// Battery voltage, V.
    pub battery_v: f64,
}

impl Default for NoiseModel {
    /// Origin of the numbers:
    /// - correlation times: recorded Vicon tracks of the NanoBench data set (BSD-3, 11 flights at
    ///   100 Hz) minus their 31-point quartic smoothing, as in thesis 5.5: correlation over one
    ///   sample 0.37, over two -0.04 (position). White noise would leave -0.12, so one sample's own
    ///   correlation is near 0.45: tau = 12 ms.
    /// - position 0.3 mm: NanoBench leaves 0.06 to 0.09 mm in a cage of 2 m; a system for a cage of
    ///   7.6 m x 5.2 m (thesis chapter 3) is taken to be four times coarser. Assumed, not measured.
    /// - attitude 1 mrad: 0.3 mm over markers some 0.3 m apart. (NanoBench's 1.5 to 3.5 mrad are
    ///   mostly motion.)
    /// - gyro: MPU-6000 of the APM, 0.005 deg/s per root Hz over 50 Hz is 0.6 mrad/s at rest; 10
    ///   mrad/s allows for vibration in flight. Bias: its data sheet's 20 deg/s after the
    ///   calibration at start-up; 10 mrad/s. Assumed.
    /// - voltage 15 mV: about half a step of the 10-bit converter over its 3:1 divider. Assumed.
    fn default() -> Self {
        Self {
            position: Coloured { deviation: 3e-4, correlation_s: 0.012 },
            attitude: Coloured { deviation: 1e-3, correlation_s: 0.012 },
            gyro_rad_s: 0.01,
            gyro_bias_rad_s: 0.01,
            battery_v: 0.015,
        }
    }
}

impl NoiseModel {
    /// Everything so many times as noisy.
    pub fn times(self, factor: f64) -> Self {
        let coloured = |noise: Coloured| Coloured { deviation: factor * noise.deviation, ..noise };
        Self {
            position: coloured(self.position),
            attitude: coloured(self.attitude),
            gyro_rad_s: factor * self.gyro_rad_s,
            gyro_bias_rad_s: factor * self.gyro_bias_rad_s,
            battery_v: factor * self.battery_v,
        }
    }
}

/// One sample of everything that is added.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct NoiseSample {
    pub(crate) position_m: [f64; 3],
    pub(crate) attitude_rad: [f64; 3],
    pub(crate) gyro_rad_s: [f64; 3],
    pub(crate) battery_v: f64,
}

/// The noise of one flight.
#[derive(Debug, Clone)]
pub(crate) struct NoiseSource {
    model: NoiseModel,
    /// `a` and `s sqrt(1 - a^2)` of position and attitude.
    position: [f64; 2],
    attitude: [f64; 2],
    gyro_bias_rad_s: [f64; 3],
    now: NoiseSample,
    generator: Pcg64,
}

impl Coloured {
    fn recursion(&self, period_s: f64) -> [f64; 2] {
        let a = if self.correlation_s > 0.0 { (-period_s / self.correlation_s).exp() } else { 0.0 };
        [a, self.deviation * (1.0 - a * a).sqrt()]
    }
}

impl NoiseSource {
    /// The noise of flight `seed`, in its steady state from the first sample.
    pub(crate) fn new(model: NoiseModel, period_s: f64, seed: u64) -> Self {
        let mut generator = stream(seed, Purpose::Noise);
        let mut draw = |deviation: f64| -> [f64; 3] {
            std::array::from_fn(|_| {
                let w: f64 = StandardNormal.sample(&mut generator);
                deviation * w
            })
        };
        let now = NoiseSample {
            position_m: draw(model.position.deviation),
            attitude_rad: draw(model.attitude.deviation),
            ..NoiseSample::default()
        };
        let gyro_bias_rad_s = draw(model.gyro_bias_rad_s);
        Self {
            position: model.position.recursion(period_s),
            attitude: model.attitude.recursion(period_s),
            model,
            gyro_bias_rad_s,
            now,
            generator,
        }
    }

    /// The next sample.
    pub(crate) fn sample(&mut self) -> &NoiseSample {
        let Self { model, position, attitude, gyro_bias_rad_s, now, generator } = self;
        let mut white = || -> f64 { StandardNormal.sample(generator) };
        for value in &mut now.position_m {
            *value = position[0] * *value + position[1] * white();
        }
        for value in &mut now.attitude_rad {
            *value = attitude[0] * *value + attitude[1] * white();
        }
        for (value, bias) in now.gyro_rad_s.iter_mut().zip(gyro_bias_rad_s) {
            *value = *bias + model.gyro_rad_s * white();
        }
        now.battery_v = model.battery_v * white();
        now
    }
}

#[cfg(test)]
mod tests {
    //! The samples have the statistics they claim. With 40,000 samples correlated over about 2.5, a
    //! deviation is known to 0.6 % and a correlation to 0.01; five times that is allowed.

    use super::*;

    const SAMPLES: usize = 40_000;

    fn record(model: NoiseModel, pick: impl Fn(&NoiseSample) -> f64) -> Vec<f64> {
        let mut source = NoiseSource::new(model, 0.01, 7);
        (0..SAMPLES).map(|_| pick(source.sample())).collect()
    }

    fn moments(values: &[f64]) -> (f64, f64, f64) {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        let lag = values.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum::<f64>() / n;
        (mean, variance.sqrt(), lag / variance)
    }

    #[test]
    fn position_noise_has_its_deviation_and_its_memory() {
        let model = NoiseModel::default();
        let (mean, deviation, correlation) = moments(&record(model, |s| s.position_m[1]));
        assert!(mean.abs() < 3e-5 && (deviation / 3e-4 - 1.0).abs() < 0.03, "{mean} {deviation}");
        let expected = (-0.01_f64 / 0.012).exp();
        assert!((correlation - expected).abs() < 0.05, "{correlation} {expected}");
    }

    #[test]
    fn white_noise_has_no_memory() {
        let mut model = NoiseModel::default();
        model.attitude.correlation_s = 0.0;
        let (_, deviation, correlation) = moments(&record(model, |s| s.attitude_rad[2]));
        assert!(
            (deviation / 1e-3 - 1.0).abs() < 0.03 && correlation.abs() < 0.05,
            "{deviation} {correlation}"
        );
        let (_, deviation, correlation) = moments(&record(model, |s| s.battery_v));
        assert!(
            (deviation / 0.015 - 1.0).abs() < 0.03 && correlation.abs() < 0.05,
            "{deviation} {correlation}"
        );
    }

    #[test]
    fn the_gyro_has_one_bias_a_flight_and_seeds_differ() {
        let model = NoiseModel { gyro_rad_s: 0.0, ..NoiseModel::default() };
        let values = record(model, |s| s.gyro_rad_s[0]);
        assert!(values.iter().all(|v| *v == values[0]) && values[0] != 0.0);
        let first = |seed| *NoiseSource::new(model, 0.01, seed).sample();
        assert_eq!(first(1), first(1));
        assert_ne!(first(1).position_m, first(2).position_m);
        assert_ne!(first(1).gyro_rad_s, first(2).gyro_rad_s);
    }
}
