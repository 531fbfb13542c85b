//! Root loci: where the poles of a loop go as one of its gains grows.

use control::Config;
use nalgebra::Complex;

use crate::error::Result;
use crate::loops::{ClosedLoop, Gain, LoopName, LoopPlant, View, gain_mut};

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
}
