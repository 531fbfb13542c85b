//! Frequency sweeps, one motor after the other: what moves one motor at a time cannot be
//! correlated.
//!
//! `u(t) = A sin(phase(t))` with `phase' = 2 pi f(t)`, f from the low end of the band to the high
//! end over a quarter of the time, in equal steps of hertz (linear) or of octaves (logarithmic,
//! which stays longer where a craft moves slowly). A short rise at the beginning and fall at the
//! end keep steps out of the commands.

use std::f64::consts::TAU;

/// How the frequency rises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spacing {
    /// Equal times for equal differences.
    Linear,
    /// Equal times for equal ratios.
    Logarithmic,
}

/// Sweeps of four motors in turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sweep {
    spacing: Spacing,
    band_hz: [f64; 2],
    leg_s: f64,
}

/// Why a sweep cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "a sweep from {low_hz} to {high_hz} Hz in {leg_s} s a motor: the band must rise from above 0, with at least one cycle of its lowest frequency in that time"
)]
pub struct SweepError {
    low_hz: f64,
    high_hz: f64,
    leg_s: f64,
}

/// Rise and fall, part of a sweep.
const TAPER: f64 = 0.05;

impl Sweep {
    /// Sweeps of four motors in turn within `duration_s`.
    ///
    /// # Errors
    /// A band that does not rise from above zero, or a time too short for its low end.
    pub fn new(spacing: Spacing, band_hz: [f64; 2], duration_s: f64) -> Result<Self, SweepError> {
        let leg_s = duration_s / 4.0;
        let [low_hz, high_hz] = band_hz;
        let possible = low_hz > 0.0 && high_hz > low_hz && high_hz.is_finite() && low_hz * leg_s >= 1.0;
        if !possible {
            return Err(SweepError { low_hz, high_hz, leg_s });
        }
        Ok(Self { spacing, band_hz, leg_s })
    }

    /// The four motors at `time_s`, for an amplitude of 1; zero before and after.
    pub fn at(&self, time_s: f64) -> [f64; 4] {
        let leg = (time_s / self.leg_s).floor();
        let mut values = [0.0; 4];
        if (0.0..4.0).contains(&leg) {
            let within_s = time_s - leg * self.leg_s;
            let edge = (within_s.min(self.leg_s - within_s) / (TAPER * self.leg_s)).clamp(0.0, 1.0);
            let rise = 0.5 - 0.5 * (0.5 * TAU * edge).cos();
            values[leg as usize] = rise * self.phase_rad(within_s).sin();
        }
        values
    }

    /// Phase at a time within a sweep, rad.
    fn phase_rad(&self, within_s: f64) -> f64 {
        let [low_hz, high_hz] = self.band_hz;
        let cycles = match self.spacing {
            Spacing::Linear => {
                low_hz * within_s + 0.5 * (high_hz - low_hz) / self.leg_s * within_s * within_s
            }
            Spacing::Logarithmic => {
                let octaves = (high_hz / low_hz).ln();
                low_hz * self.leg_s / octaves * ((octaves * within_s / self.leg_s).exp() - 1.0)
            }
        };
        TAU * cycles
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy.signal.chirp(t, f0=0.5, t1=5, f1=8, method, phi=-90), scipy 1.17, at t = 0.3, 1.7,
    /// 3.1, 4.4 s.
    #[test]
    fn sweeps_are_those_of_scipy() {
        let expected = [
            (Spacing::Linear, [0.979_222_811, 0.109_734_311, -0.998_889_875, -0.982_287_251]),
            (Spacing::Logarithmic, [0.854_924_306, 0.520_859_224, 0.723_743_350, 0.355_729_476]),
        ];
        for (spacing, values) in expected {
            let sweep = Sweep::new(spacing, [0.5, 8.0], 20.0).unwrap();
            for (t, value) in [0.3, 1.7, 3.1, 4.4].into_iter().zip(values) {
                assert!(
                    (sweep.phase_rad(t).sin() - value).abs() < 1e-6,
                    "{spacing:?} {t}: {}",
                    sweep.phase_rad(t).sin()
                );
            }
        }
    }

    #[test]
    fn one_motor_moves_at_a_time_and_the_band_is_crossed() {
        for spacing in [Spacing::Linear, Spacing::Logarithmic] {
            let sweep = Sweep::new(spacing, [0.5, 8.0], 40.0).unwrap();
            for k in 0..4000 {
                let t = f64::from(k) * 0.01;
                let values = sweep.at(t);
                assert!(
                    values.iter().filter(|v| **v != 0.0).count() <= 1
                        && values.iter().all(|v| v.abs() <= 1.0)
                );
            }
            // The derivative of the phase, at the ends of the band.
            let frequency = |t: f64| (sweep.phase_rad(t + 1e-6) - sweep.phase_rad(t)) / 1e-6 / TAU;
            assert!((frequency(0.0) - 0.5).abs() < 1e-4 && (frequency(10.0) - 8.0).abs() < 1e-4);
            assert_eq!(sweep.at(40.0), [0.0; 4]);
        }
        for (band, duration) in
            [([0.0, 1.0], 40.0), ([2.0, 1.0], 40.0), ([0.05, 1.0], 40.0), ([0.5, f64::NAN], 40.0)]
        {
            assert!(Sweep::new(Spacing::Linear, band, duration).is_err(), "{band:?}");
        }
    }
}
