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

#[cfg(test)]
mod tests {
    use control::Config;
    use model::Model;

    use super::*;
    use crate::loops::gain_of;
    use crate::plant::{Linear, TrimTarget};
    use crate::synthesis::specs::Specs;

    /// By hand, (5.29): the velocity loop of yaw is s^2 + (0.4833 + 21.5) s + 21.5 (0.4833 + Kd),
    /// whose poles meet, as far left as the slower one goes, at Kd = 5.135. The grid's step is 2.3 %.
    #[test]
    fn yaw_has_the_velocity_gain_at_which_its_poles_meet() {
        let model = Model::thesis();
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        let (specs, config) = (Specs::thesis(), Config::thesis());
        let mut draft = Draft { model: &model, linear, specs, config, steps: Vec::new() };
        draft.config = draft.with(LoopName::Yaw, Gain::Integral, 0.0);
        yaw_altitude(&mut draft, LoopName::Yaw).unwrap();
        let of = |gain| gain_of(&draft.config, LoopName::Yaw, gain);
        let kd = (21.9833_f64.powi(2) / 4.0 / 21.5) - 0.4833;
        assert!((of(Gain::Velocity) / kd - 1.0).abs() < 0.03, "{} {kd}", of(Gain::Velocity));
        // Table 5.2 has 15 and 1.
        assert!((of(Gain::Proportional) / 15.0 - 1.0).abs() < 0.1);
        assert!((of(Gain::Integral) * 15.0 - of(Gain::Proportional)).abs() < 1e-9);
    }
}
