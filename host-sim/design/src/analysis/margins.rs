//! Margins of a loop: how much phase, gain and delay it can lose.
//!
//! All crossings of a loop gain L are found, on a logarithmic grid of frequencies and then by
//! bisection. Phase margin: 180 degrees plus the phase where |L| = 1. Gain margin: 1/|L| where the
//! phase is 180 degrees; a loop around an unstable plant has one upwards and one downwards.
//! Sensitivity peak: the greatest |1 / (1 + L)|, one over the least distance of the Nyquist curve
//! from -1. Delay margin: the age that the pose may gain before the loop is unstable.

use nalgebra::Complex;
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::Result;
use crate::loops::ClosedLoop;

/// A place where the loop gain has magnitude 1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct GainCrossing {
    /// Frequency, rad/s.
    pub frequency_rad_s: f64,
    /// 180 degrees plus the phase, in (-180, 180].
    pub phase_margin_deg: f64,
}

/// A place where the loop gain is real and negative.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct PhaseCrossing {
    /// Frequency, rad/s.
    pub frequency_rad_s: f64,
    /// Factor on the gain that puts the loop gain on -1.
    pub gain_margin: f64,
}

/// Margins at one cut of a loop.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Margins {
    /// Least phase margin, degrees; absent if the gain never crosses 1. Of a stable loop it is
    /// positive: the phase that it can lose, or gain where that is less (loops around unstable
    /// plants).
    pub phase_margin_deg: Option<f64>,
    /// Gain crossover frequency it belongs to, rad/s.
    pub crossover_rad_s: Option<f64>,
    /// Least factor above 1 by which the gain may grow (of an unstable loop: the factor nearest to
    /// 1 that would make it cross -1); absent if it may grow without end.
    pub gain_margin: Option<f64>,
    /// Frequency it belongs to, rad/s.
    pub phase_crossover_rad_s: Option<f64>,
    /// Greatest factor below 1 to which the gain may fall; absent if it may fall to nothing.
    pub gain_reduction_margin: Option<f64>,
    /// Greatest |1/(1+L)|.
    pub sensitivity_peak: f64,
    /// Frequency of that peak, rad/s.
    pub sensitivity_peak_rad_s: f64,
    /// All crossings of magnitude 1.
    pub gain_crossings: Vec<GainCrossing>,
    /// All crossings of 180 degrees.
    pub phase_crossings: Vec<PhaseCrossing>,
}

/// Frequencies between which crossings are looked for, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Lowest.
    pub low_rad_s: f64,
    /// Highest.
    pub high_rad_s: f64,
    /// Points of the grid.
    pub points: usize,
}

impl Band {
    /// From twenty times below the slowest loop's crossover to half the sampling rate (continuous:
    /// to ten times the rotors').
    pub fn of(period_s: Option<f64>) -> Self {
        let high_rad_s = period_s.map_or(300.0, |period_s| 0.999 * std::f64::consts::PI / period_s);
        Self { low_rad_s: 0.02, high_rad_s, points: 600 }
    }

    /// A coarser grid over the band of [`Band::of`]: enough to search on, but it could miss two
    /// crossings that lie close together.
    pub fn coarse(period_s: Option<f64>) -> Self {
        Self { points: 300, ..Self::of(period_s) }
    }

    /// The grid, evenly spaced in the logarithm.
    pub fn grid(&self) -> impl Iterator<Item = f64> + '_ {
        let ratio = self.high_rad_s / self.low_rad_s;
        (0..self.points).map(move |k| self.low_rad_s * ratio.powf(k as f64 / (self.points - 1) as f64))
    }
}

impl Margins {
    /// Margins of a loop gain, which closes to a stable loop or not.
    pub fn of(gain: impl Fn(f64) -> Complex<f64>, band: Band, stable: bool) -> Self {
        let points: Vec<(f64, Complex<f64>)> = band.grid().map(|w| (w, gain(w))).collect();
        let mut gain_crossings = Vec::new();
        let mut phase_crossings = Vec::new();
        for pair in points.windows(2) {
            let [(w0, l0), (w1, l1)] = [pair[0], pair[1]];
            if (l0.norm() - 1.0) * (l1.norm() - 1.0) < 0.0 {
                let w = bisect(w0, w1, |w| gain(w).norm() - 1.0);
                gain_crossings
                    .push(GainCrossing { frequency_rad_s: w, phase_margin_deg: phase_margin_deg(gain(w)) });
            }
            if l0.im * l1.im < 0.0 && l0.re < 0.0 && l1.re < 0.0 {
                let w = bisect(w0, w1, |w| gain(w).im);
                phase_crossings.push(PhaseCrossing { frequency_rad_s: w, gain_margin: 1.0 / gain(w).norm() });
            }
        }
        let (sensitivity_peak_rad_s, sensitivity_peak) = sensitivity_peak(&points, &gain);
        let least = if stable {
            gain_crossings.iter().min_by(|a, b| a.phase_margin_deg.abs().total_cmp(&b.phase_margin_deg.abs()))
        } else {
            gain_crossings.iter().min_by(|a, b| a.phase_margin_deg.total_cmp(&b.phase_margin_deg))
        };
        let nearness = |c: &&PhaseCrossing| c.gain_margin.ln().abs();
        let nearest = |above: Option<bool>| {
            phase_crossings
                .iter()
                .filter(|c| above.is_none_or(|above| (c.gain_margin > 1.0) == above))
                .min_by(|a, b| nearness(a).total_cmp(&nearness(b)))
        };
        let upwards = nearest(stable.then_some(true));
        Self {
            phase_margin_deg: least
                .map(|c| if stable { c.phase_margin_deg.abs() } else { c.phase_margin_deg }),
            crossover_rad_s: least.map(|c| c.frequency_rad_s),
            gain_margin: upwards.map(|c| c.gain_margin),
            phase_crossover_rad_s: upwards.map(|c| c.frequency_rad_s),
            gain_reduction_margin: stable.then(|| nearest(Some(false)).map(|c| c.gain_margin)).flatten(),
            sensitivity_peak,
            sensitivity_peak_rad_s,
            gain_crossings,
            phase_crossings,
        }
    }
}

/// 180 degrees plus the phase of a loop gain, in (-180, 180].
pub fn phase_margin_deg(gain: Complex<f64>) -> f64 {
    // The phase of -L is 180 degrees more than that of L.
    (-gain).arg().to_degrees()
}

fn sensitivity_peak(points: &[(f64, Complex<f64>)], gain: &impl Fn(f64) -> Complex<f64>) -> (f64, f64) {
    let sensitivity = |l: Complex<f64>| 1.0 / (l + 1.0).norm();
    let peak = (0..points.len())
        .max_by(|&i, &j| sensitivity(points[i].1).total_cmp(&sensitivity(points[j].1)))
        .unwrap_or(0);
    let mut low = points[peak.saturating_sub(1)].0;
    let mut high = points[(peak + 1).min(points.len() - 1)].0;
    // Golden section between the neighbours of the greatest point of the grid.
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    while high - low > 1e-6 * high {
        let (left, right) = (high - ratio * (high - low), low + ratio * (high - low));
        if sensitivity(gain(left)) > sensitivity(gain(right)) {
            high = right;
        } else {
            low = left;
        }
    }
    let w = 0.5 * (low + high);
    (w, sensitivity(gain(w)))
}

/// A root of `f` between two frequencies where it has different signs.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let sign = f(low).is_sign_negative();
    while high - low > 1e-12 * high {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if f(middle).is_sign_negative() == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// By how much the pose may get older before a stable loop is unstable, s; absent: by any amount.
///
/// The loop is cut at the actuator, where all that the pose does goes through: proportional,
/// integral and velocity feedback, and for an outer loop position and attitude together. What a
/// gyro does stays closed.
pub fn delay_margin_s(closed: &ClosedLoop, band: Band) -> Result<Option<f64>> {
    let (pose, gyro) = (closed.at_actuator.sweep(0, 0)?, closed.at_actuator.sweep(1, 0)?);
    let gain = |w: f64| pose.response(w) / (gyro.response(w) + 1.0);
    let margins = Margins::of(gain, band, true);
    let delay = |c: &GainCrossing| {
        let lag = c.phase_margin_deg.to_radians().rem_euclid(2.0 * std::f64::consts::PI);
        lag / c.frequency_rad_s
    };
    Ok(margins.gain_crossings.iter().map(delay).min_by(f64::total_cmp))
}

/// All margins of a loop: at its error, at the actuator, and in delay.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopMargins {
    /// Whether the closed loop is stable.
    pub stable: bool,
    /// Cut at the error, velocity feedback closed: what the thesis judges.
    pub at_error: Margins,
    /// Cut at the actuator: what an error of the rotors' effect does.
    pub at_actuator: Margins,
    /// Age that the pose may gain, s; 0 if the loop is unstable; absent if it may gain any.
    pub delay_margin_s: Option<f64>,
}

impl LoopMargins {
    /// All margins of one loop.
    pub fn of(closed: &ClosedLoop) -> Result<Self> {
        let band = Band::of(closed.closed.period_s);
        let stable = closed.closed.is_stable()?;
        let error = closed.at_error.sweep(0, 0)?;
        let (pose, gyro) = (closed.at_actuator.sweep(0, 0)?, closed.at_actuator.sweep(1, 0)?);
        Ok(Self {
            stable,
            at_error: Margins::of(|w| error.response(w), band, stable),
            at_actuator: Margins::of(|w| pose.response(w) + gyro.response(w), band, stable),
            delay_margin_s: if stable { delay_margin_s(closed, band)? } else { Some(0.0) },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// L = 4 / (s (s + 1)^2): phase -180 at 1 rad/s with |L| = 2, so the loop is unstable and its gain margin is 1/2.
    /// With a fifth of the gain it is stable, margin 2.5; |L| = 1 where w (w^2 + 1) = 0.8.
    #[test]
    fn the_textbook_loop() {
        let loop_gain = |k: f64| {
            move |w: f64| {
                let s = Complex::new(0.0, w);
                k / (s * (s + 1.0) * (s + 1.0))
            }
        };
        let band = Band::of(None);
        let unstable = Margins::of(loop_gain(4.0), band, false);
        assert!((unstable.gain_margin.unwrap() - 0.5).abs() < 1e-9);
        assert!(unstable.phase_margin_deg.unwrap() < 0.0);
        let stable = Margins::of(loop_gain(0.8), band, true);
        let w = stable.crossover_rad_s.unwrap();
        assert!((w * (w * w + 1.0) - 0.8).abs() < 1e-9);
        assert!((stable.phase_margin_deg.unwrap() - (90.0 - 2.0 * w.atan().to_degrees())).abs() < 1e-8);
        assert!((stable.gain_margin.unwrap() - 2.5).abs() < 1e-9);
        assert_eq!(stable.gain_reduction_margin, None);
        // The greatest sensitivity is no less than at either margin's frequency.
        let by_gain = 1.0 / (1.0 - 1.0 / 2.5);
        assert!(stable.sensitivity_peak >= by_gain, "{}", stable.sensitivity_peak);
    }

    #[test]
    fn around_an_unstable_plant_the_gain_must_not_fall() {
        // L = 3 / (s - 1) needs a gain above 1/3, and has no upper limit.
        let margins = Margins::of(|w| 3.0 / (Complex::new(0.0, w) - 1.0), Band::of(None), true);
        assert_eq!(margins.gain_margin, None);
        // |L| = 1 at sqrt(8), where the phase of 1/(jw - 1) is -180 + atan(w).
        assert!((margins.crossover_rad_s.unwrap() - 8.0_f64.sqrt()).abs() < 1e-9);
        assert!((margins.phase_margin_deg.unwrap() - 8.0_f64.sqrt().atan().to_degrees()).abs() < 1e-8);
    }
}
