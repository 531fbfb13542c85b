//! Gusts: a wind that wanders about zero.
//!
//! Each axis is a first-order Gauss-Markov process, `n' = a n + s sqrt(1 - a^2) w` with `a = exp(-Ts / tau)`: the spectrum of Dryden's
//! longitudinal gusts at one airspeed (MIL-F-8785C, 3.7.2). Within a tick the air moves evenly, and a craft in evenly moving air flies as
//! in still air seen by somebody who moves along: that is how it is simulated, for any model, by [`Gusts::enter`] and
//! [`Gusts::leave`]. What depends on the place sees the craft off by a gust's way in one tick, some millimetres.

use model::{State, frames};
use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use pattern::random::{Purpose, stream};

/// How gusty the air is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GustModel {
    /// Standard deviation of the wind on each of north, east and down, m/s.
    pub deviation_m_s: f64,
    /// Correlation time tau, s.
    pub time_s: f64,
}

/// The gusts of a flight.
#[derive(Debug, Clone)]
pub(crate) struct Gusts {
    /// North, east, down, m/s.
    wind_m_s: Vector3<f64>,
    keep: f64,
    kick_m_s: f64,
    generator: Pcg64,
}

impl Gusts {
    /// Those of a seed, in ticks of `period_s`.
    pub(crate) fn new(model: GustModel, period_s: f64, seed: u64) -> Self {
        let keep = (-period_s / model.time_s).exp();
        let mut gusts = Self {
            wind_m_s: Vector3::zeros(),
            keep: 0.0,
            kick_m_s: model.deviation_m_s,
            generator: stream(seed, Purpose::Gusts),
        };
        // The first is as strong as any.
        gusts.blow();
        Self { keep, kick_m_s: model.deviation_m_s * (1.0 - keep * keep).sqrt(), ..gusts }
    }

    /// The wind of the next tick.
    #[inline]
    fn blow(&mut self) {
        for wind in &mut self.wind_m_s {
            let kick: f64 = StandardNormal.sample(&mut self.generator);
            *wind = self.keep * *wind + self.kick_m_s * kick;
        }
    }

    /// A craft over ground as somebody sees it who moves with the air of the next tick.
    #[inline]
    pub(crate) fn enter(&mut self, state: &mut State) {
        self.blow();
        state.velocity_m_s -= frames::dcm_from_quaternion(&state.attitude) * self.wind_m_s;
    }

    /// Back over ground, `period_s` later.
    #[inline]
    pub(crate) fn leave(&self, state: &mut State, period_s: f64) {
        state.velocity_m_s += frames::dcm_from_quaternion(&state.attitude) * self.wind_m_s;
        state.position_ned_m += period_s * self.wind_m_s;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over 2000 s the standard deviation is that of the model to 5 %, and the correlation over tau is 1 / e.
    #[test]
    fn gusts_have_the_spread_and_the_memory_of_their_model() {
        let model = GustModel { deviation_m_s: 0.8, time_s: 0.5 };
        let mut gusts = Gusts::new(model, 0.01, 3);
        let north: Vec<f64> = (0..200_000)
            .map(|_| {
                gusts.blow();
                gusts.wind_m_s.x
            })
            .collect();
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / 2e5;
        let square = mean(&mut north.iter().map(|v| v * v));
        assert!((square.sqrt() / 0.8 - 1.0).abs() < 0.05, "{square}");
        let lagged = mean(&mut north.iter().zip(&north[50..]).map(|(a, b)| a * b));
        assert!((lagged / square - (-1.0_f64).exp()).abs() < 0.05, "{}", lagged / square);
    }

    /// In and out again without a step between: only the air's way is left.
    #[test]
    fn a_craft_keeps_its_motion_over_ground() {
        let mut gusts = Gusts::new(GustModel { deviation_m_s: 2.0, time_s: 0.5 }, 0.01, 1);
        let mut state = State::at_rest(Vector3::new(1.0, 2.0, -3.0), [600.0; 4]);
        state.attitude = frames::quaternion_from_euler(Vector3::new(0.2, -0.1, 1.0));
        state.velocity_m_s = Vector3::new(0.3, 0.1, -0.2);
        let before = state;
        gusts.enter(&mut state);
        assert!((state.velocity_m_s - before.velocity_m_s).norm() > 0.1);
        gusts.leave(&mut state, 0.01);
        assert!((state.velocity_m_s - before.velocity_m_s).norm() < 1e-12);
        let way = state.position_ned_m - before.position_ned_m;
        assert!((way - 0.01 * gusts.wind_m_s).norm() < 1e-12);
    }
}
