//! Yaw and altitude, thesis 5.3.2: velocity gain, proportional gain, integral gain.

use super::damping::undamped;
use super::draft::{Draft, plant_gain};
use super::judging::{seen_overshoot, slowest_moved};
use super::scan::{best, largest};
use crate::error::Result;
use crate::loops::{ClosedLoop, Gain, LoopName, View};

/// Finds the gains of yaw or altitude.
pub(super) fn yaw_altitude(draft: &mut Draft, name: LoopName) -> Result<()> {
    let plant = draft.plant(name)?;
    let specs = if name == LoopName::Yaw { draft.specs.yaw } else { draft.specs.altitude };
    // In the channel's own unit: N for altitude, whose acceleration is a force over the mass.
    let unit = 1.0 / plant_gain(&draft.linear, name)?;
    let slowest = |kd: f64| -> Result<f64> {
        let config = draft.with(name, Gain::Velocity, kd);
        slowest_moved(&ClosedLoop::new(&config, &plant, name, View::Continuous)?.velocity_loop)
    };
    let kd = best(0.05 * unit, 500.0 * unit, slowest)?;
    draft.found(
        name,
        Gain::Velocity,
        kd,
        "moves the slowest pole of the velocity loop, rotors' lag included, as far left as it goes (5.29)",
    );
    let allowed = |kp: f64| {
        let config = draft.with(name, Gain::Proportional, kp);
        let closed = ClosedLoop::new(&config, &plant, name, View::Continuous)?;
        Ok(seen_overshoot(&closed)?.is_some_and(|percent| percent <= specs.overshoot_percent))
    };
    let Some(kp) = largest(0.05 * unit, 1000.0 * unit, allowed)? else {
        return Err(undamped(draft, name, &plant, specs.overshoot_percent, unit)?);
    };
    let rule = format!("largest with {} % overshoot by damping (5.30)", specs.overshoot_percent);
    draft.found(name, Gain::Proportional, kp, rule);
    let rule = format!("takes constant disturbances away at {:.3} rad/s (5.31)", specs.integral_rad_s);
    draft.found(name, Gain::Integral, specs.integral_rad_s * kp, rule);
    Ok(())
}
