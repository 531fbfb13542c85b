//! The blocks of one loop, linked to each other and to the plant.

use super::blocks::{Blocks, OuterBlocks, Rate};
use crate::plant::{Block, Input, Network, Output, StateSpace};

/// Where a loop is cut.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Cut {
    Nowhere,
    Error,
    Actuator,
}

/// Where the plant meets a loop.
pub(super) struct Place {
    pub(super) actuator: Input,
    pub(super) controlled: Output,
    pub(super) rate: Output,
    /// Position and velocity, for an outer loop.
    pub(super) position: Option<[Output; 2]>,
}

/// Where a loop is entered and left.
pub(super) struct Ends {
    pub(super) reference: Input,
    pub(super) controlled: Output,
    pub(super) measured: Output,
    pub(super) law_output: Output,
    /// What goes to the actuator: by the pose, and by the gyro.
    pub(super) to_actuator: [Output; 2],
}

/// Adds the law's blocks of one loop to a network and links them to the plant.
pub(super) fn wire(net: &mut Network, blocks: &Blocks, plant: &Place, cut: Cut) -> Ends {
    let inner = wire_inner(net, blocks, plant, cut);
    match (&blocks.outer, plant.position) {
        (Some(outer), Some(position)) => wire_outer(net, blocks, outer, position, cut, &inner),
        _ => inner,
    }
}

fn wire_inner(net: &mut Network, blocks: &Blocks, plant: &Place, cut: Cut) -> Ends {
    let (error, output, gyro_output) = (unit(net), unit(net), unit(net));
    let pi = net.add(blocks.proportional_integral.clone());
    let canceller = net.add(blocks.canceller.clone());
    let measured = net.add(blocks.delay.clone());
    net.link(plant.controlled, measured.input(0), 1.0);

    // Error, proportional-integral, canceller, output.
    if !(cut == Cut::Error && blocks.outer.is_none()) {
        net.link(measured.output(0), error.input(0), -1.0);
    }
    net.link(error.output(0), pi.input(0), 1.0);
    net.link(pi.output(0), canceller.input(0), 1.0);
    net.link(canceller.output(0), output.input(0), 1.0);

    // Velocity feedback; through the gyro, where there is one, by a way of its own.
    let rate = rate_of(net, &blocks.rate, plant.rate, measured.output(0));
    match &blocks.fusion {
        None => net.link(rate, output.input(0), -blocks.kd),
        Some((low, high)) => {
            let (low, high) = (net.add(low.clone()), net.add(high.clone()));
            net.link(rate, low.input(0), 1.0);
            net.link(plant.rate, high.input(0), 1.0);
            net.link(low.output(0), output.input(0), -blocks.kd);
            net.link(high.output(0), gyro_output.input(0), -blocks.kd);
        }
    }
    if cut != Cut::Actuator {
        net.link(output.output(0), plant.actuator, 1.0);
        net.link(gyro_output.output(0), plant.actuator, 1.0);
    }
    Ends {
        reference: error.input(0),
        controlled: plant.controlled,
        measured: measured.output(0),
        law_output: output.output(0),
        to_actuator: [output.output(0), gyro_output.output(0)],
    }
}

/// The position loop around an inner one, which takes the angle that it commands.
fn wire_outer(
    net: &mut Network,
    blocks: &Blocks,
    outer: &OuterBlocks,
    [position, velocity]: [Output; 2],
    cut: Cut,
    inner: &Ends,
) -> Ends {
    let prefilter = net.add(blocks.prefilter.clone());
    let late = net.add(blocks.delay.clone());
    let pi = net.add(outer.proportional_integral.clone());
    let (error_m, angle) = (unit(net), unit(net));
    net.link(position, late.input(0), 1.0);
    if cut != Cut::Error {
        net.link(late.output(0), error_m.input(0), -1.0);
    }
    net.link(error_m.output(0), pi.input(0), 1.0);
    net.link(pi.output(0), angle.input(0), 1.0);
    let velocity = rate_of(net, &outer.rate, velocity, late.output(0));
    net.link(velocity, angle.input(0), -outer.kd);
    net.link(angle.output(0), prefilter.input(0), 1.0);
    net.link(prefilter.output(0), inner.reference, 1.0);
    Ends {
        reference: error_m.input(0),
        controlled: position,
        measured: late.output(0),
        law_output: angle.output(0),
        to_actuator: inner.to_actuator,
    }
}

/// A signal's sum point.
fn unit(net: &mut Network) -> Block {
    net.add(StateSpace::gain(1.0, net.period_s()))
}

fn rate_of(net: &mut Network, rate: &Rate, own: Output, measured: Output) -> Output {
    match rate {
        Rate::True => own,
        Rate::Estimated(filter) => {
            let filter = net.add(filter.clone());
            net.link(measured, filter.input(0), 1.0);
            filter.output(0)
        }
    }
}
