//! All loops closed at once, with what one axis does to another.

use control::Config;
use nalgebra::{DMatrix, Matrix4};

use super::blocks::Blocks;
use super::loop_plant::LoopPlant;
use super::name::{LoopName, View};
use super::wiring::{Cut, Place, wire};
use crate::error::Result;
use crate::plant::{Linear, Network, StateSpace};

/// All loops closed at once around all twelve states: the references of yaw, z, x and y, and what
/// they move. What the loops one by one leave out, how one axis moves another, is in it. (Left out
/// even so: that the law turns rates from Euler's angles to the body's at the angle of the
/// equilibrium, which is some degrees.)
pub fn together(config: &Config, linear: &Linear, effect: &Matrix4<f64>, view: View) -> Result<StateSpace> {
    let plant =
        LoopPlant { system: motion(linear, effect)?, input_delay_s: linear.input_delay_s, notes: Vec::new() };
    let mut net = Network::new(match view {
        View::Continuous => None,
        View::Sampled { .. } => Some(config.sample_time_s),
    });
    let plant = net.add(plant.in_view(view, config.sample_time_s)?);
    let (mut references, mut controlled) = (Vec::new(), Vec::new());
    for name in [LoopName::Yaw, LoopName::Z, LoopName::X, LoopName::Y] {
        let inner = name.inner().channel();
        let outer = name.channel().output;
        let place = Place {
            actuator: plant.input(inner.input),
            controlled: plant.output(inner.output),
            rate: plant.output(12 + inner.output),
            position: name.is_outer().then(|| [plant.output(outer), plant.output(12 + outer)]),
        };
        let ends = wire(&mut net, &Blocks::new(config, name, view), &place, Cut::Nowhere);
        references.push(vec![(ends.reference, 1.0)]);
        controlled.push(vec![(ends.controlled, 1.0)]);
    }
    net.close(&references, &controlled)
}

/// Rotors and motion in continuous time. Outputs are the twelve states and what they change by, z
/// and x turned round.
fn motion(linear: &Linear, effect: &Matrix4<f64>) -> Result<StateSpace> {
    let mut motion = Network::new(None);
    let b = linear.proper_b() * effect;
    let turned = |i: usize| if i == 0 || i == 2 { -1.0 } else { 1.0 };
    let c = DMatrix::from_fn(24, 12, |i, j| {
        let state = i % 12;
        turned(state)
            * match (i < 12, state == j) {
                (true, same) => f64::from(same),
                (false, _) => linear.a[(state, j)],
            }
    });
    let body = motion.add(StateSpace {
        a: DMatrix::from_fn(12, 12, |i, j| linear.a[(i, j)]),
        b: DMatrix::from_fn(12, 4, |i, j| b[(i, j)]),
        c,
        d: DMatrix::zeros(24, 4),
        period_s: None,
    });
    let entries: Vec<_> = (0..4)
        .map(|k| match linear.motor_lag_rad_s {
            None => vec![(body.input(k), 1.0)],
            Some(lag) => {
                let rotors = motion.add(StateSpace::transfer(&[lag], &[1.0, lag], None));
                motion.link(rotors.output(0), body.input(k), 1.0);
                vec![(rotors.input(0), 1.0)]
            }
        })
        .collect();
    let outputs: Vec<_> = (0..24).map(|k| vec![(body.output(k), 1.0)]).collect();
    motion.close(&entries, &outputs)
}

#[cfg(test)]
mod tests {
    use model::Model;

    use super::*;
    use crate::loops::{ClosedLoop, law_effect};
    use crate::plant::{CANCEL_TOLERANCE, TrimTarget};

    /// Yaw and altitude of the thesis' craft stand apart at hover: the poles of their own loops are
    /// among those of the whole.
    #[test]
    fn loops_that_nothing_couples_keep_their_poles() {
        let (model, config) = (Model::thesis(), Config::thesis());
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        // Exactly what is asked for, so that the mixing couples nothing.
        let effect = Matrix4::identity();
        assert!((law_effect(&model, &linear, &config, 11.1).unwrap() - effect).abs().max() < 1e-3);
        let view = View::Continuous;
        let whole = together(&config, &linear, &effect, view).unwrap().poles().unwrap();
        for name in [LoopName::Yaw, LoopName::Z] {
            let plant = LoopPlant::new(&linear, &effect, name, CANCEL_TOLERANCE).unwrap();
            for pole in ClosedLoop::new(&config, &plant, name, view).unwrap().closed.poles().unwrap() {
                let nearest = whole.iter().map(|p| (p - pole).norm()).fold(f64::INFINITY, f64::min);
                assert!(nearest < 1e-6 * pole.norm().max(1.0), "{name}: {pole} in {whole:?}");
            }
        }
    }
}
