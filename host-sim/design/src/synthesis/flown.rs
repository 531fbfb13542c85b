//! The search on the loops as they fly: roll and pitch with one estimator for both, yaw and
//! altitude where the thesis' steps fall short.

use control::Config;
use control::gains::VelocityEstimator;

use super::draft::{Draft, plant_gain};
use super::search::{RESERVE, Search};
use super::specs::{Specs, delay_s};
use crate::error::Result;
use crate::loops::{
    GAINS, LoopName, LoopPlant, gain_of, inner_gains, inner_gains_mut, loops_of, loops_of_mut,
};
use crate::plant::Linear;

/// Starts of a search beside the thesis' steps.
const STARTS: usize = 3;
/// Estimators that are tried; none is faster than the thesis', whose noise is known to fly.
const ESTIMATORS: [VelocityEstimator; 3] = [
    VelocityEstimator::CRITICAL_150,
    VelocityEstimator { natural_frequency_rad_s: 75.0, damping_ratio: 0.7 },
    VelocityEstimator::PRINTED_75,
];

/// Roll and pitch on the loops as they fly. They share the estimator: each of a few is tried, and
/// the one with the lower cost of both axes together flies.
pub(super) fn search_attitude(draft: &mut Draft) -> Result<()> {
    let both = [LoopName::Roll, LoopName::Pitch];
    let start = draft.config;
    let mut found: Option<(f64, Config)> = None;
    for estimator in ESTIMATORS {
        let mut config = start;
        config.estimation.velocity = estimator;
        let mut cost = 0.0;
        for name in both {
            cost += search_axis(draft, &mut config, name)?;
        }
        if found.as_ref().is_none_or(|(least, _)| cost < *least) {
            found = Some((cost, config));
        }
    }
    let Some((mut cost, mut config)) = found else { return Ok(()) };
    // Where the thesis' gains are too far from what this craft needs, others to start from.
    for name in both {
        cost += search_anew(draft, &mut config, name)?;
    }
    draft.config = config;
    let VelocityEstimator { natural_frequency_rad_s, damping_ratio } = config.estimation.velocity;
    let rule = format!(
        "of {} estimators the one with the least cost ({cost:.3}) over roll and pitch; natural frequency {natural_frequency_rad_s} rad/s",
        ESTIMATORS.len()
    );
    draft.note("roll", "estimator damping", damping_ratio, rule);
    for name in both {
        note_attitude(draft, name);
    }
    Ok(())
}

/// Notes what the search has found for roll or pitch.
fn note_attitude(draft: &mut Draft, name: LoopName) {
    let rule = searched(&draft.specs);
    for gain in GAINS {
        let value = gain_of(&draft.config, name, gain);
        draft.found(name, gain, value, rule.clone());
    }
    let gains = *inner_gains(loops_of(&draft.config), name);
    if let Some(corner) = gains.prefilter_rad_s {
        let rule = format!(
            "searched with the gains: rise of at most {:.3} s with at most {} % overshoot",
            draft.specs.attitude.rise_s.unwrap_or(0.3),
            draft.specs.attitude.overshoot_percent
        );
        draft.note(name.name(), "prefilter", corner, rule);
    }
    if let Some(canceller) = gains.canceller {
        let rule = "searched with the gains: further out it lifts the dip and costs phase";
        draft.note(name.name(), "canceller zero", canceller.zero_rad_s, rule);
    }
}

fn searched(specs: &Specs) -> String {
    format!(
        "searched on the sampled loop with {} samples of delay, stable with {}",
        specs.delay_samples, specs.stable_delay_samples
    )
}

/// Yaw or altitude as it flies, where the thesis' steps leave something short of the
/// specifications.
pub(super) fn search_slow(draft: &mut Draft, name: LoopName) -> Result<()> {
    let mut config = draft.config;
    if !lacks(draft, &config, name)? {
        return Ok(());
    }
    search_axis(draft, &mut config, name)?;
    search_anew(draft, &mut config, name)?;
    draft.config = config;
    let rule = format!("{}: the thesis' steps fall short there", searched(&draft.specs));
    for gain in GAINS {
        draft.found(name, gain, gain_of(&config, name, gain), rule.clone());
    }
    Ok(())
}

/// Whether gains fall short of the specifications on the loop as it flies.
fn lacks(draft: &Draft, config: &Config, name: LoopName) -> Result<bool> {
    let plant = draft.plant(name)?;
    let search = Search { plant: &plant, config: *config, name, specs: draft.specs };
    Ok(search.worth(config, 0.0)?.shortfall > 0.0)
}

/// Searches one axis from gains made for its delays, slower and faster ones, if it falls short;
/// returns what the cost falls by, not above zero.
fn search_anew(draft: &Draft, config: &mut Config, name: LoopName) -> Result<f64> {
    if !lacks(draft, config, name)? {
        return Ok(0.0);
    }
    let plant = draft.plant(name)?;
    let cost = |config: &Config| -> Result<f64> {
        let search = Search { plant: &plant, config: *config, name, specs: draft.specs };
        Ok(search.worth(config, RESERVE)?.cost())
    };
    let before = cost(config)?;
    let mut least = before;
    for (_, mut other) in starts(draft, config, name, &plant)?.into_iter().take(STARTS) {
        search_axis(draft, &mut other, name)?;
        let reached = cost(&other)?;
        if reached < least {
            (*config, least) = (other, reached);
        }
    }
    Ok(least - before)
}

/// Searches the gains of one axis in `config`; returns the cost reached.
fn search_axis(draft: &Draft, config: &mut Config, name: LoopName) -> Result<f64> {
    let plant = draft.plant(name)?;
    let search = Search { plant: &plant, config: *config, name, specs: draft.specs };
    let (cost, found) = search.run()?;
    *config = found;
    Ok(cost)
}

/// Gains to start a search from with their costs, the best first: slower and faster ones, soft and
/// stiff. (A craft that the air tips over as it gains speed is held by stiffness alone, and one
/// that it rights by none.)
pub(super) fn starts(
    draft: &Draft,
    config: &Config,
    name: LoopName,
    plant: &LoopPlant,
) -> Result<Vec<(f64, Config)>> {
    let mut starts = Vec::new();
    for pace in [0.5, 1.0, 2.0] {
        for stiffness in [0.5, 1.0, 2.0, 4.0, 8.0] {
            let mut other = started(config, &draft.linear, name, &draft.specs, pace);
            let gains = inner_gains_mut(loops_of_mut(&mut other), name);
            (gains.kp, gains.ki) = (stiffness * gains.kp, stiffness * gains.ki);
            let search = Search { plant, config: other, name, specs: draft.specs };
            starts.push((search.worth(&other, RESERVE)?.cost(), other));
        }
    }
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(starts)
}

/// Gains for a double integrator behind the delays of the loop. The velocity loop crosses where
/// those delays take 20 degrees, the proportional one at a third of that; `pace` is how much
/// faster.
fn started(config: &Config, linear: &Linear, name: LoopName, specs: &Specs, pace: f64) -> Config {
    let mut config = *config;
    let delay_s = delay_s(&config, linear, specs.delay_samples);
    let unit = 1.0 / plant_gain(linear, name).unwrap_or(1.0);
    let velocity_rad_s = pace * 0.35 / delay_s;
    let angle_rad_s = velocity_rad_s / 3.0;
    let gains = inner_gains_mut(loops_of_mut(&mut config), name);
    gains.kd = unit * velocity_rad_s;
    gains.kp = gains.kd * angle_rad_s;
    gains.ki = 0.1 * gains.kp * angle_rad_s;
    if matches!(name, LoopName::Roll | LoopName::Pitch) {
        gains.prefilter_rad_s = Some(3.0 * angle_rad_s);
    }
    config
}

#[cfg(test)]
mod tests {
    use model::Model;

    use super::*;
    use crate::plant::TrimTarget;

    /// By hand, for yaw of the thesis' craft with two samples: 98.2 ms of delay, 0.35 of a radian,
    /// gain 1.
    #[test]
    fn a_start_is_made_for_the_delays() {
        let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
        let config = started(&Config::thesis(), &linear, LoopName::Yaw, &Specs::default(), 1.0);
        let gains = inner_gains(loops_of(&config), LoopName::Yaw);
        let kd = 0.35 / (1.0 / 21.5 + 0.025 + 2.0 / 75.0);
        assert!((gains.kd / kd - 1.0).abs() < 1e-6, "{gains:?}");
        assert!((gains.kp / (kd * kd / 3.0) - 1.0).abs() < 1e-6, "{gains:?}");
        assert!((gains.ki / gains.kp - kd / 30.0).abs() < 1e-6, "{gains:?}");
    }
}
