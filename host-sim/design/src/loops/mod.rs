//! The loops of the law that flies, closed around the channels of a linear model.
//!
//! One network serves all loops: plant, delay, velocity estimator, proportional-integral part,
//! canceller, prefilter, and for x and y the position loop around it. What differs between the two
//! views is what a block is made of:
//!
//! - [`View::Continuous`]: as the thesis designs. Roll and pitch have the velocity estimator (5.5);
//!   in the yaw and altitude loops (5.3.2) and around the position loops (5.4) a pure derivative
//!   stands for it. No sampling, no delay.
//! - [`View::Sampled`]: as the law flies. The plant is held over each period, every filter is the
//!   matched-Z one of crate `control`, the integrator is backward Euler, the pose comes whole
//!   samples late, and so does the rotor command if the model has a dead time. A gyro, where the
//!   law uses one, is not late.
//!
//! Signs: every loop is written so that a positive output moves its variable up. Altitude takes
//! thrust away for z (down), and a positive pitch pushes along -x; both are turned round here, as
//! they are in the law.

mod actuation;
mod blocks;
mod closed_loop;
mod gains;
mod loop_plant;
mod name;
mod together;
mod wiring;

pub use actuation::law_effect;
pub use closed_loop::ClosedLoop;
pub use gains::{
    GAINS, Gain, gain_mut, gain_of, inner_gains, inner_gains_mut, loops_of, loops_of_mut, outer_gains,
};
pub use loop_plant::{LoopPlant, axis_channel, with_moved_zero};
pub use name::{LOOPS, LoopName, View};
pub use together::together;
