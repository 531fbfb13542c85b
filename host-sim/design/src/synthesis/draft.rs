//! A design in the making: what it is made for, the gains so far, and how each was found.

use control::Config;
use control::gains::CancellerParams;
use model::Model;
use schemars::JsonSchema;
use serde::Serialize;

use super::specs::Specs;
use crate::error::Result;
use crate::loops::{
    Gain, LoopName, LoopPlant, axis_channel, gain_mut, inner_gains_mut, law_effect, loops_of_mut,
};
use crate::plant::{CANCEL_TOLERANCE, Linear};

/// A gain that a step of the design found, and why.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Step {
    /// The loop.
    #[serde(rename = "loop")]
    pub name: &'static str,
    /// The gain's symbol.
    pub gain: &'static str,
    /// Its value.
    pub value: f64,
    /// The rule, in words.
    pub rule: String,
}

/// A design in the making.
pub(super) struct Draft<'a> {
    pub(super) model: &'a Model,
    pub(super) linear: Linear,
    pub(super) specs: Specs,
    pub(super) config: Config,
    pub(super) steps: Vec<Step>,
}

impl Draft<'_> {
    /// The plant that the loop `name` is closed around.
    pub(super) fn plant(&self, name: LoopName) -> Result<LoopPlant> {
        let effect = law_effect(self.model, &self.linear, &self.config, self.linear.equilibrium.battery_v)?;
        LoopPlant::new(&self.linear, &effect, name, CANCEL_TOLERANCE)
    }

    /// Keeps a gain, and why it is what it is.
    pub(super) fn found(&mut self, name: LoopName, gain: Gain, value: f64, rule: impl Into<String>) {
        *gain_mut(&mut self.config, name, gain) = value;
        self.note(name.name(), gain.symbol(), value, rule);
    }

    /// Notes a step that is not one of the three gains of a loop.
    pub(super) fn note(
        &mut self,
        name: &'static str,
        gain: &'static str,
        value: f64,
        rule: impl Into<String>,
    ) {
        self.steps.push(Step { name, gain, value, rule: rule.into() });
    }

    /// The configuration so far with another value of a gain.
    pub(super) fn with(&self, name: LoopName, gain: Gain, value: f64) -> Config {
        let mut config = self.config;
        *gain_mut(&mut config, name, gain) = value;
        config
    }

    /// Puts the canceller's pole on the plant's slow zero, where there is one, and its zero at
    /// `zero_rad_s`, (5.26).
    pub(super) fn canceller(&mut self, name: LoopName, zero_rad_s: f64) -> Result<()> {
        let channel = axis_channel(&self.linear, name)?;
        let slow = channel.zeros.iter().find(|z| z.im == 0.0 && z.re < 0.0 && -z.re < zero_rad_s);
        if let Some(slow) = slow {
            let pole_rad_s = -slow.re;
            inner_gains_mut(loops_of_mut(&mut self.config), name).canceller =
                Some(CancellerParams { zero_rad_s, pole_rad_s });
            let rule = format!("on the plant's slow zero, which moves to {zero_rad_s} rad/s (5.26)");
            self.note(name.name(), "canceller pole", pole_rad_s, rule);
        }
        Ok(())
    }
}

/// What the law's unit of output accelerates its variable by.
pub(super) fn plant_gain(linear: &Linear, name: LoopName) -> Result<f64> {
    Ok(axis_channel(linear, name)?.gain.abs().max(1e-9))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::{gain_of, inner_gains, loops_of};
    use crate::plant::TrimTarget;

    #[test]
    fn a_step_is_kept_with_its_reason() {
        let model = Model::thesis();
        let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
        let config = Config::thesis();
        let mut draft = Draft { model: &model, linear, specs: Specs::thesis(), config, steps: Vec::new() };
        assert_eq!(draft.with(LoopName::Yaw, Gain::Integral, 3.0).law, {
            let mut other = config;
            *gain_mut(&mut other, LoopName::Yaw, Gain::Integral) = 3.0;
            other.law
        });
        draft.found(LoopName::Yaw, Gain::Integral, 2.0, "because");
        assert_eq!(gain_of(&draft.config, LoopName::Yaw, Gain::Integral), 2.0);
        // The slow zero of roll is the side drag over the mass, 0.2211 rad/s; yaw has none.
        draft.canceller(LoopName::Yaw, 0.6).unwrap();
        assert_eq!(draft.steps.len(), 1);
        draft.canceller(LoopName::Roll, 0.6).unwrap();
        let canceller = inner_gains(loops_of(&draft.config), LoopName::Roll).canceller.unwrap();
        assert!((canceller.pole_rad_s - 0.2684 / 1.214).abs() < 1e-4, "{canceller:?}");
        assert_eq!(draft.steps[1].gain, "canceller pole");
    }

    /// Thrust lifts by 1/m, (5.19); a roll acceleration is one, (5.20).
    #[test]
    fn the_gain_of_a_plant_is_that_of_its_channel() {
        let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
        assert!((plant_gain(&linear, LoopName::Z).unwrap() - 1.0 / 1.214).abs() < 1e-6);
        assert!((plant_gain(&linear, LoopName::Roll).unwrap() - 1.0).abs() < 1e-6);
    }
}
