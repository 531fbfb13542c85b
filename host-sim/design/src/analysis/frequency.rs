//! Frequency responses to draw: Bode and Nichols plots.

use nalgebra::Complex;

use super::margins::Band;
use super::response::path;
use crate::error::Result;
use crate::loops::ClosedLoop;
use crate::plant::StateSpace;

/// One point of a frequency response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrequencyPoint {
    /// rad/s.
    pub frequency_rad_s: f64,
    /// Magnitude, decibels.
    pub magnitude_db: f64,
    /// Phase, degrees, without jumps.
    pub phase_deg: f64,
}

/// Magnitude and phase over the band, the phase unwrapped from a start in (-360, 0].
pub fn bode(response: impl Fn(f64) -> Complex<f64>, band: Band) -> Vec<FrequencyPoint> {
    let mut previous: Option<f64> = None;
    band.grid()
        .map(|frequency_rad_s| {
            let value = response(frequency_rad_s);
            let raw = value.arg().to_degrees();
            let phase_deg = match previous {
                None if raw > 0.0 => raw - 360.0,
                None => raw,
                Some(before) => raw + 360.0 * ((before - raw) / 360.0).round(),
            };
            previous = Some(phase_deg);
            FrequencyPoint { frequency_rad_s, magnitude_db: 20.0 * value.norm().log10(), phase_deg }
        })
        .collect()
}

/// The loop gain at the error.
pub fn loop_bode(closed: &ClosedLoop) -> Vec<FrequencyPoint> {
    bode(|w| closed.gain_at_error(w), Band::of(closed.closed.period_s))
}

/// The loop gain at the actuator, through the pose and the gyro together.
pub fn actuator_bode(closed: &ClosedLoop) -> Vec<FrequencyPoint> {
    bode(|w| closed.gain_at_actuator(w).iter().sum(), Band::of(closed.closed.period_s))
}

/// The closed loop from its reference, and with its prefilter from its command.
pub fn closed_bode(closed: &ClosedLoop) -> Result<[Vec<FrequencyPoint>; 2]> {
    let bare = path(&closed.closed, 0, 0);
    let filtered = closed.prefilter.then(&bare)?;
    let band = Band::of(closed.closed.period_s);
    Ok([bare, filtered].map(|system: StateSpace| bode(|w| system.response(w, 0, 0), band)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phase_of_a_double_integrator_stays_at_180() {
        let points = bode(|w| -Complex::new(1.0 / (w * w), 1e-12), Band::of(None));
        assert!(points.iter().all(|p| (p.phase_deg + 180.0).abs() < 1e-3));
        assert!((points[0].magnitude_db + 40.0 * points[0].frequency_rad_s.log10()).abs() < 1e-9);
    }
}
