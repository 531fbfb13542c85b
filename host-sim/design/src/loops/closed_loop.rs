//! One loop closed around its plant, and cut open at its error and at the actuator.

use control::Config;
use nalgebra::Complex;

use super::blocks::Blocks;
use super::gains::{inner_gains_mut, loops_of_mut};
use super::loop_plant::LoopPlant;
use super::name::{LoopName, View};
use super::wiring::{Cut, Place, wire};
use crate::error::Result;
use crate::plant::{Network, StateSpace};

/// A loop as systems: closed, and cut open at two places.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedLoop {
    /// Which loop it is.
    pub name: LoopName,
    /// Inputs: reference, disturbance added to the law's output at the actuator. Outputs:
    /// controlled variable, law's output (the angle command of an outer loop).
    pub closed: StateSpace,
    /// The filter before the reference; a gain of 1 for an outer loop, whose rate limit is not
    /// linear.
    pub prefilter: StateSpace,
    /// Cut at the error of this loop, velocity feedback and inner loops closed: the loop gain that
    /// the thesis judges.
    pub at_error: StateSpace,
    /// Cut at the actuator, everything open: loop gain through the pose, and through the gyro.
    pub at_actuator: StateSpace,
    /// The velocity loop alone, (5.24): closed, without proportional and integral part. Of the
    /// inner loop.
    pub velocity_loop: StateSpace,
}

impl ClosedLoop {
    /// Closes the loop `name` of `config` around `plant`.
    pub fn new(config: &Config, plant: &LoopPlant, name: LoopName, view: View) -> Result<Self> {
        let sampled = plant.in_view(view, config.sample_time_s)?;
        let blocks = Blocks::new(config, name, view);
        let mut still = *config;
        let gains = inner_gains_mut(loops_of_mut(&mut still), name);
        (gains.kp, gains.ki, gains.canceller) = (0.0, 0.0, None);
        let alone = Blocks { outer: None, ..Blocks::new(&still, name, view) };
        Ok(Self {
            name,
            closed: assemble(&sampled, &blocks, Cut::Nowhere)?,
            prefilter: if name.is_outer() {
                StateSpace::gain(1.0, blocks.period_s)
            } else {
                blocks.prefilter.clone()
            },
            at_error: assemble(&sampled, &blocks, Cut::Error)?,
            at_actuator: assemble(&sampled, &blocks, Cut::Actuator)?,
            velocity_loop: assemble(&sampled, &alone, Cut::Nowhere)?,
        })
    }

    /// The loop gain at the error, at a frequency in rad/s.
    pub fn gain_at_error(&self, frequency_rad_s: f64) -> Complex<f64> {
        self.at_error.response(frequency_rad_s, 0, 0)
    }

    /// The loop gain at the actuator, at a frequency in rad/s: through the pose, and through the
    /// gyro.
    pub fn gain_at_actuator(&self, frequency_rad_s: f64) -> [Complex<f64>; 2] {
        [0, 1].map(|output| self.at_actuator.response(frequency_rad_s, output, 0))
    }
}

fn assemble(plant: &StateSpace, blocks: &Blocks, cut: Cut) -> Result<StateSpace> {
    let mut net = Network::new(blocks.period_s);
    let plant = net.add(plant.clone());
    let place = Place {
        actuator: plant.input(0),
        controlled: plant.output(0),
        rate: plant.output(1),
        position: blocks.outer.is_some().then(|| [plant.output(2), plant.output(3)]),
    };
    let ends = wire(&mut net, blocks, &place, cut);
    match cut {
        Cut::Nowhere => net.close(
            &[vec![(ends.reference, 1.0)], vec![(place.actuator, 1.0)]],
            &[vec![(ends.controlled, 1.0)], vec![(ends.law_output, 1.0)]],
        ),
        Cut::Error => net.close(&[vec![(ends.reference, 1.0)]], &[vec![(ends.measured, 1.0)]]),
        Cut::Actuator => {
            net.close(&[vec![(place.actuator, 1.0)]], &ends.to_actuator.map(|output| vec![(output, -1.0)]))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// T = L / (1 + L): what the closed loop does to its reference is what the cut one says, at any
    /// frequency and in both views. The cut one ends at the measurement, which is two samples later
    /// than the variable.
    #[test]
    fn the_closed_loop_is_the_cut_one_closed() {
        let plant = LoopPlant::of_transfer(&[0.2, 1.0], &[1.0, 0.5, 0.0], None, Some(21.5)).unwrap();
        for view in [View::Continuous, View::Sampled { delay_samples: 2 }] {
            for name in [LoopName::Roll, LoopName::Yaw] {
                let config = Config::thesis();
                let closed = ClosedLoop::new(&config, &plant, name, view).unwrap();
                for w in [0.3, 2.0, 9.0] {
                    let cut = closed.gain_at_error(w);
                    let late = match view {
                        View::Continuous => Complex::new(1.0, 0.0),
                        View::Sampled { .. } => Complex::from_polar(1.0, -2.0 * w * config.sample_time_s),
                    };
                    let measured = closed.closed.response(w, 0, 0) * late;
                    // Solves of a dozen states whose poles crowd near z = 1.
                    assert!((measured - cut / (cut + 1.0)).norm() < 1e-9, "{name} {view:?} {w}");
                }
            }
        }
    }

    /// Poles are where one plus the loop gain at the actuator is zero: with everything cut there,
    /// none is left out.
    #[test]
    fn poles_close_the_loop_at_the_actuator() {
        let plant = LoopPlant::of_transfer(&[1.0], &[1.0, 0.5, 0.0], None, Some(21.5)).unwrap();
        let closed = ClosedLoop::new(&Config::thesis(), &plant, LoopName::Yaw, View::Continuous).unwrap();
        for pole in closed.closed.poles().unwrap() {
            let gain = closed.at_actuator.at(pole, 0, 0) + closed.at_actuator.at(pole, 1, 0);
            assert!((gain + 1.0).norm() < 1e-6, "{pole}: {gain}");
        }
    }
}
