//! Curves to draw: Bode, Nichols, root loci.

use control::Config;
use nalgebra::Complex;

use crate::error::Result;
use crate::loops::{ClosedLoop, LoopName, LoopPlant, View, inner_gains_mut, loops_of_mut};
use crate::margins::Band;
use crate::response::path;
use crate::state_space::StateSpace;

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

/// The closed loop from its reference, and with its prefilter from its command.
pub fn closed_bode(closed: &ClosedLoop) -> Result<[Vec<FrequencyPoint>; 2]> {
    let bare = path(&closed.closed, 0, 0);
    let filtered = closed.prefilter.then(&bare)?;
    let band = Band::of(closed.closed.period_s);
    Ok([bare, filtered].map(|system: StateSpace| bode(|w| system.response(w, 0, 0), band)))
}

/// A gain of a loop that a root locus follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gain {
    /// Velocity feedback, with the velocity loop alone: (5.25), (5.29).
    Velocity,
    /// Proportional, with the velocity loop closed and no integral: (5.27), (5.30).
    Proportional,
    /// Integral, with the rest closed: (5.28), (5.31).
    Integral,
}

/// The gains of a root locus in the order of the design.
pub const GAINS: [Gain; 3] = [Gain::Velocity, Gain::Proportional, Gain::Integral];

impl Gain {
    /// Its symbol.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Velocity => "Kd",
            Self::Proportional => "Kp",
            Self::Integral => "Ki",
        }
    }
}

/// The value that a configuration gives a gain of a loop.
pub fn gain_of(config: &Config, name: LoopName, gain: Gain) -> f64 {
    let mut config = *config;
    *gain_mut(&mut config, name, gain)
}

/// A gain of a loop, to change.
pub fn gain_mut(config: &mut Config, name: LoopName, gain: Gain) -> &mut f64 {
    let loops = loops_of_mut(config);
    let [kd, kp, ki] = match name {
        LoopName::X => [&mut loops.x.kd, &mut loops.x.kp, &mut loops.x.ki],
        LoopName::Y => [&mut loops.y.kd, &mut loops.y.kp, &mut loops.y.ki],
        _ => {
            let inner = inner_gains_mut(loops, name);
            [&mut inner.kd, &mut inner.kp, &mut inner.ki]
        }
    };
    match gain {
        Gain::Velocity => kd,
        Gain::Proportional => kp,
        Gain::Integral => ki,
    }
}

/// Closed-loop poles for each value of a gain, the gains that the procedure finds later being zero.
pub fn root_locus(
    config: &Config,
    plant: &LoopPlant,
    name: LoopName,
    view: View,
    gain: Gain,
    values: &[f64],
) -> Result<Vec<Vec<Complex<f64>>>> {
    let at = |value: &f64| {
        let mut config = *config;
        *gain_mut(&mut config, name, gain) = *value;
        if gain == Gain::Velocity {
            *gain_mut(&mut config, name, Gain::Proportional) = 0.0;
        }
        if gain != Gain::Integral {
            *gain_mut(&mut config, name, Gain::Integral) = 0.0;
        }
        let closed = ClosedLoop::new(&config, plant, name, view)?;
        let alone = gain == Gain::Velocity && !name.is_outer();
        if alone { closed.velocity_loop.poles() } else { closed.closed.poles() }
    };
    values.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (5.29) for yaw without lag: `s (s + 0.4833 + kd)`.
    #[test]
    fn the_velocity_locus_of_yaw_moves_one_pole() {
        let plant = LoopPlant::of_transfer(&[1.0], &[1.0, 0.4833, 0.0], None, None).unwrap();
        let locus = root_locus(
            &Config::thesis(),
            &plant,
            LoopName::Yaw,
            View::Continuous,
            Gain::Velocity,
            &[0.0, 5.0],
        )
        .unwrap();
        for (poles, kd) in locus.iter().zip([0.0, 5.0]) {
            assert!((poles[0].re).abs() < 1e-12 && (poles[1].re + 0.4833 + kd).abs() < 1e-12, "{poles:?}");
        }
    }

    #[test]
    fn the_phase_of_a_double_integrator_stays_at_180() {
        let points = bode(|w| -Complex::new(1.0 / (w * w), 1e-12), Band::of(None));
        assert!(points.iter().all(|p| (p.phase_deg + 180.0).abs() < 1e-3));
        assert!((points[0].magnitude_db + 40.0 * points[0].frequency_rad_s.log10()).abs() < 1e-9);
    }
}
