//! Altitude loop, thesis 5.3.2: `T = hover - (kp e + ki integral(e) - kd z')`, error = prefiltered
//! command - z.
//!
//! z is inertial and points down, so a positive error (the craft is too high) takes thrust away:
//! the plant (5.19) is `-1/m`, printed with its sign lost. No tilt compensation and no limit of the
//! thrust, as in the thesis.

use crate::allocation::mixer::Directions;
use crate::config::gains::InnerLoop;
use crate::dsp::prefilter::{Prefilter, PrefilterState};
use crate::law::attitude::LoopOutput;
use crate::law::pid::{Pid, PidState};

/// The altitude law for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AltitudeLoop {
    prefilter: Prefilter,
    pid: Pid,
    hover: f32,
}

/// Memory of an [`AltitudeLoop`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AltitudeLoopState {
    prefilter: PrefilterState,
    pid: PidState,
    /// What carries the craft beyond the law's hover thrust, as it was told, N (or command units).
    trim: f32,
}

impl AltitudeLoop {
    /// Builds the law; `hover` is the thrust in N (or the command) that carries the craft, period
    /// in s.
    pub fn new(gains: &InnerLoop, hover: f64, period_s: f64, anti_windup: bool) -> Self {
        Self {
            prefilter: Prefilter::new(gains.prefilter_rad_s, period_s),
            pid: Pid::of_inner_loop(gains, period_s, anti_windup),
            hover: hover as f32,
        }
    }

    /// Integrator at rest, the command (m of z) as if it had always been there.
    pub fn start(&self, command_m: f32) -> AltitudeLoopState {
        AltitudeLoopState { prefilter: self.prefilter.steady(command_m), ..AltitudeLoopState::default() }
    }

    /// The command as if it had always been there.
    pub(crate) fn settle(&self, state: &mut AltitudeLoopState, command_m: f32) {
        state.prefilter = self.prefilter.steady(command_m);
    }

    /// From now on so much thrust in N (or command units) where there is neither error nor rate,
    /// whatever the integral holds.
    pub(crate) fn carry(&self, state: &mut AltitudeLoopState, carrying: f32) {
        state.trim = carrying - (self.hover - self.pid.integral_part(&state.pid));
    }

    /// One period: command and z in m, its rate in m/s, what the motors refused of the thrust.
    /// Gives the loop and the thrust.
    #[inline]
    pub fn step(
        &self,
        state: &mut AltitudeLoopState,
        command_m: f32,
        z_m: f32,
        z_rate_m_s: f32,
        refused_thrust: Directions,
    ) -> (LoopOutput, f32) {
        let reference = self.prefilter.step(&mut state.prefilter, command_m);
        let error = reference - z_m;
        let terms = self.pid.step(&mut state.pid, error, z_rate_m_s, refused_thrust.swapped());
        (LoopOutput { reference, error, terms }, (self.hover - terms.output) + state.trim)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::{Config, Law};

    fn altitude() -> AltitudeLoop {
        let Law::ModelBased(law) = Config::thesis().law else { unreachable!() };
        AltitudeLoop::new(&law.loops.altitude, law.hover_thrust_n, 0.01, true)
    }

    const FREE: Directions = Directions::NONE;

    #[test]
    fn too_low_or_sinking_means_more_thrust() {
        let law = altitude();
        let mut state = law.start(-1.0);
        let (_, at_height) = law.step(&mut state, -1.0, -1.0, 0.0, FREE);
        // f32 near 12, and the prefilter's rest to 2e-6 m times 18 N/m.
        assert!((at_height - 11.9093).abs() < 5e-5);
        let (_, low) = law.step(&mut law.start(-1.0), -1.0, -0.9, 0.0, FREE);
        // 18 * 0.1 + 1 * 0.1 * 0.01
        assert!((low - 11.9093 - 1.801).abs() < 1e-4, "{low}");
        let (_, sinking) = law.step(&mut law.start(-1.0), -1.0, -1.0, 0.25, FREE);
        assert!((sinking - 11.9093 - 2.0).abs() < 1e-4, "{sinking}");
    }

    #[test]
    fn a_settled_loop_gives_what_carries_the_craft() {
        let law = altitude();
        let mut state = law.start(-1.0);
        for _ in 0..500 {
            law.step(&mut state, -1.0, -0.8, 0.1, FREE);
        }
        law.settle(&mut state, -0.8);
        law.carry(&mut state, 13.5);
        let (_, settled) = law.step(&mut state, -0.8, -0.8, 0.0, FREE);
        assert!((settled - 13.5).abs() < 1e-4, "{settled}");
        // Too high by 0.06 m: 18 * 0.06 N less.
        let (_, sinks) = (0..300).map(|_| law.step(&mut state, -0.74, -0.8, 0.0, FREE)).last().unwrap();
        assert!(sinks < 12.5 && sinks > 12.0, "{sinks}");
    }

    #[test]
    fn refused_thrust_stops_the_integral_that_asks_for_it() {
        let law = altitude();
        let more_refused = Directions::HIGH;
        let mut state = law.start(-1.0);
        let (out, _) = law.step(&mut state, -1.0, -0.5, 0.0, more_refused);
        assert_eq!(out.terms.i, 0.0, "too low, asks for more thrust, there is none");
        let (out, _) = law.step(&mut state, -1.0, -1.5, 0.0, more_refused);
        assert!(out.terms.i > 0.0, "too high, asks for less, there is some");
    }
}
