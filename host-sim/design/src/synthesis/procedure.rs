//! The steps of a design in their order, inner loops before outer ones.

use control::Config;
use control::filter::GainRule;
use control::gains::{InnerLoop, Law, Mixing, MotorMapParams, PositionLoop, Saturation};
use control::supervision_limits::BatteryLevels;
use model::Model;

use super::attitude::attitude;
use super::draft::{Draft, Step};
use super::flown::{search_attitude, search_slow, starts};
use super::position::position;
use super::shortfall::shortfalls;
use super::specs::{Method, Specs};
use super::yaw_altitude::yaw_altitude;
use crate::error::{DesignError, Result, Shortfall};
use crate::loops::{Gain, LoopName, gain_of};
use crate::plant::{Linear, TrimTarget};

/// What a lithium-polymer cell has in the middle of a flight, under load, V.
const CELL_IN_FLIGHT_V: f64 = 3.75;

/// Gains, and how each was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Designed {
    /// What flies.
    pub config: Config,
    /// The steps in order.
    pub steps: Vec<Step>,
    /// Specifications that are not met; empty: all are.
    pub shortfalls: Vec<Shortfall>,
}

/// Designs gains for a model.
///
/// # Errors
/// A model that cannot be linearised at hover or controlled, or that no motor map can be made for.
pub fn design(model: &Model, specs: &Specs) -> Result<Designed> {
    let linear = Linear::new(model, &TrimTarget::default())?;
    let specs = &specs.for_craft(&linear);
    let config = blank(model, &linear, specs)?;
    let mut draft = Draft { model, linear, specs: *specs, config, steps: Vec::new() };
    battery_levels(&mut draft);
    for name in [LoopName::Roll, LoopName::Pitch, LoopName::Yaw, LoopName::Z] {
        inner(&mut draft, name)?;
    }
    if specs.method == Method::Delay {
        search_attitude(&mut draft)?;
        for name in [LoopName::Yaw, LoopName::Z] {
            search_slow(&mut draft, name)?;
        }
    }
    for name in [LoopName::X, LoopName::Y] {
        position(&mut draft, name)?;
    }
    let shortfalls = shortfalls(model, &draft.config, specs)?;
    Ok(Designed { config: draft.config, steps: draft.steps, shortfalls })
}

/// A configuration for the model's craft without gains: its mixing, motor map and hover.
fn blank(model: &Model, linear: &Linear, specs: &Specs) -> Result<Config> {
    let mut config = Config::thesis();
    let vehicle = &model.vehicle;
    config.command_range = vehicle.motors.command_range;
    if specs.method == Method::Delay {
        // A rate that is measured 6.5 % too large is gain that the margins do not have.
        config.estimation.gain_rule = GainRule::Slope;
        // What the linear loops do not see: motors at their ends, and a thrust that leans.
        config.saturation = Saturation::AttitudeFirst;
        config.tilt_compensation = true;
    }
    let map = vehicle.rotor_map();
    let k = &linear.effectiveness;
    let Law::ModelBased(law) = &mut config.law else {
        return Err(DesignError::Numerics("the thesis' configuration"));
    };
    law.hover_thrust_n = linear.equilibrium.inputs[0];
    law.mixing = Mixing::Matrix(std::array::from_fn(|i| std::array::from_fn(|j| k[(i, j)])));
    law.motor_map =
        MotorMapParams { command: map.command, voltage: map.voltage, offset: map.offset, inverse: None };
    let still = |prefilter_rad_s: f64| InnerLoop {
        kp: 0.0,
        ki: 0.0,
        kd: 0.0,
        prefilter_rad_s: Some(prefilter_rad_s),
        canceller: None,
        output_limit: None,
    };
    let position = PositionLoop {
        kp: 0.0,
        ki: 0.0,
        kd: 0.0,
        velocity_filter_rad_s: specs.position.velocity_filter_rad_s,
        rate_limit_m_s: specs.position.rate_limit_m_s,
        output_limit_rad: None,
    };
    law.loops.roll = still(specs.attitude.prefilter_rad_s);
    law.loops.pitch = law.loops.roll;
    law.loops.yaw = still(specs.yaw.prefilter_rad_s);
    law.loops.altitude = still(specs.altitude.prefilter_rad_s);
    (law.loops.x, law.loops.y) = (position, position);
    Ok(config)
}

/// Voltages at which the craft warns and lands, for the battery that the model was made with. The
/// thesis' levels are those of three cells; a craft of another voltage would land at once or never.
/// Without a voltage they stay.
fn battery_levels(draft: &mut Draft) {
    let made_at_v = draft.model.reference.battery_v;
    if !(made_at_v > 0.0) {
        return;
    }
    let cells = (made_at_v / CELL_IN_FLIGHT_V).round().max(1.0);
    let levels = &mut draft.config.supervision.battery;
    for level in [&mut levels.warn_v, &mut levels.land_v, &mut levels.empty_v] {
        *level *= cells / 3.0;
    }
    let BatteryLevels { warn_v, land_v, .. } = *levels;
    let rule = format!(
        "lithium-polymer, by the model's {made_at_v:.1} V: warns under {warn_v:.1} V, lands under {land_v:.1} V"
    );
    draft.note("all", "battery cells", cells, rule);
}

/// An inner loop by the thesis' steps. Where they lead nowhere, a search begins at a start of its
/// own.
fn inner(draft: &mut Draft, name: LoopName) -> Result<()> {
    let (config, steps) = (draft.config, draft.steps.len());
    let is_tilt = matches!(name, LoopName::Roll | LoopName::Pitch);
    let found = if is_tilt { attitude(draft, name) } else { yaw_altitude(draft, name) };
    match found {
        Err(DesignError::Unmet(unmet)) if draft.specs.method == Method::Delay => {
            draft.config = config;
            draft.steps.truncate(steps);
            if is_tilt {
                draft.canceller(name, draft.specs.attitude.zero_rad_s)?;
            }
            let plant = draft.plant(name)?;
            if let Some((_, start)) = starts(draft, &draft.config, name, &plant)?.into_iter().next() {
                draft.config = start;
            }
            let rule = format!(
                "a start for the search: the thesis' steps end at {}, wanted {:.3}, reached {:.3}",
                unmet.what.label(),
                unmet.wanted,
                unmet.reached
            );
            let kd = gain_of(&draft.config, name, Gain::Velocity);
            draft.found(name, Gain::Velocity, kd, rule);
            Ok(())
        }
        found => found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A craft with a single cell warns and lands at a third of the thesis' voltages, and says so.
    #[test]
    fn battery_levels_go_with_the_cells() {
        let mut model = Model::thesis();
        model.reference.battery_v = 3.7;
        let thesis = Config::thesis();
        let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
        let specs = Specs::thesis();
        let mut draft = Draft { model: &model, linear, specs, config: thesis, steps: Vec::new() };
        battery_levels(&mut draft);
        let (ours, theirs) = (draft.config.supervision.battery, thesis.supervision.battery);
        assert!((3.0 * ours.warn_v - theirs.warn_v).abs() < 1e-9 && draft.steps[0].value == 1.0);
        assert!((3.0 * ours.land_v - theirs.land_v).abs() < 1e-9);
        model.reference.battery_v = 0.0;
        let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
        let mut draft = Draft { model: &model, linear, specs, config: thesis, steps: Vec::new() };
        battery_levels(&mut draft);
        assert_eq!((draft.config, draft.steps.len()), (thesis, 0));
    }

    /// Before any gain is found nothing is fed back, but hover thrust and mixing are the model's
    /// own.
    #[test]
    fn a_blank_configuration_hovers_and_feeds_nothing_back() {
        let model = Model::thesis();
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        let config = blank(&model, &linear, &Specs::thesis()).unwrap();
        for name in crate::loops::LOOPS {
            for gain in crate::loops::GAINS {
                assert_eq!(gain_of(&config, name, gain), 0.0);
            }
        }
        let Law::ModelBased(law) = &config.law else { panic!("a model-based law") };
        assert!((law.hover_thrust_n - 1.214 * 9.81).abs() < 1e-9);
    }
}
