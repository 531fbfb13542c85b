//! The microsecond clock of the firmware: its prescaler divided by 85 instead of 84 until
//! bitcraze/crazyflie-firmware#1684, August 2026. So times were 84/85 of what they should be.
//!
//! Rows are logged at a rate of whole milliseconds, by the loop that the inertial sensor drives: on the
//! log's clock their period tells which of the two it is. The sensor's own clock is off by less than
//! half a percent.

use crate::statistics::median;

/// What slow times are to be multiplied by.
pub(super) const MENDED: f64 = 85.0 / 84.0;
/// What is said where the log does not tell.
pub(super) const UNKNOWN: &str = "whether the log's clock ran 85/84 slow, as in firmware before \
    bitcraze/crazyflie-firmware#1684, cannot be told from the times of its rows: log at a fixed rate of 50 Hz or more";
/// Longest period that tells, ms: of longer ones, 84/85 of one whole number is near another.
const LONGEST_MS: f64 = 20.0;
/// How far the sensor's clock may be off.
const TOLERANCE: f64 = 0.005;
/// Fewest rows that tell.
const FEWEST: usize = 50;

/// What the rows say of the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Clock {
    Right,
    Slow { period_ms: f64, nominal_ms: f64 },
    Unknown,
}

impl Clock {
    /// By the times of rows at a fixed rate, s.
    pub(super) fn of(times: &[f64]) -> Self {
        let steps: Vec<f64> =
            times.windows(2).map(|pair| (pair[1] - pair[0]) * 1e3).filter(|step| *step > 0.0).collect();
        let Some(median) = median(steps.iter().copied()).filter(|_| steps.len() >= FEWEST) else {
            return Self::Unknown;
        };
        // Lost rows make steps of two periods and more.
        let single = || steps.iter().filter(|step| **step < 1.5 * median);
        let period_ms = single().sum::<f64>() / single().count() as f64;
        let nominal_ms = (period_ms * MENDED.sqrt()).round();
        let ratio = period_ms / nominal_ms;
        if !(1.0..=LONGEST_MS).contains(&nominal_ms) {
            Self::Unknown
        } else if (ratio * MENDED - 1.0).abs() < TOLERANCE {
            Self::Slow { period_ms, nominal_ms }
        } else if (ratio - 1.0).abs() < TOLERANCE {
            Self::Right
        } else {
            Self::Unknown
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(period_s: f64) -> Vec<f64> {
        // Every seventh row is lost, and rows are late by up to 30 us.
        (0..500).filter(|k| k % 7 != 0).map(|k| f64::from(k) * period_s + f64::from(k % 4) * 1e-5).collect()
    }

    #[test]
    fn rates_tell_the_clock() {
        for nominal_ms in [1.0, 2.0, 4.0, 5.0, 10.0, 20.0] {
            assert_eq!(Clock::of(&times(nominal_ms * 1e-3)), Clock::Right, "{nominal_ms}");
            let slow = Clock::of(&times(nominal_ms * 1e-3 / MENDED));
            assert!(matches!(slow, Clock::Slow { nominal_ms: found, .. } if found == nominal_ms), "{slow:?}");
        }
        assert_eq!(Clock::of(&times(0.1)), Clock::Unknown);
        assert_eq!(Clock::of(&times(0.0104)), Clock::Unknown);
        assert_eq!(Clock::of(&[]), Clock::Unknown);
    }
}
