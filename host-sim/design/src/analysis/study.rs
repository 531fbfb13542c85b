//! All loops of a configuration around a model, one by one and together.

use control::Config;
use model::Model;
use schemars::JsonSchema;
use serde::Serialize;

use super::margins::LoopMargins;
use super::response::{Mode, least_damped};
use crate::error::Result;
use crate::loops::{ClosedLoop, LOOPS, LoopName, LoopPlant, View, law_effect, together};
use crate::plant::{CANCEL_TOLERANCE, Linear, TrimTarget};

/// All loops closed at once, with what one axis does to another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Together {
    /// Whether they are stable.
    pub stable: bool,
    /// How fast the slowest mode decays, 1/s; below 0: it grows.
    pub slowest_1_s: f64,
    /// Oscillating mode with the least damping.
    pub least_damped: Option<Mode>,
}

/// Loops of a configuration around a model, built once.
#[derive(Debug, Clone)]
pub struct Study {
    /// The linear model.
    pub linear: Linear,
    /// Plant and loop of each of [`LOOPS`].
    pub loops: Vec<(LoopPlant, ClosedLoop)>,
}

impl Study {
    /// Linearises `model` at hover and closes the loops of `config`.
    pub fn new(model: &Model, config: &Config, view: View) -> Result<Self> {
        let linear = Linear::new(model, &TrimTarget::default())?;
        Self::around(model, linear, config, view)
    }

    /// Closes the loops of `config` around a linear model of `model`.
    pub fn around(model: &Model, linear: Linear, config: &Config, view: View) -> Result<Self> {
        let effect = law_effect(model, &linear, config, linear.equilibrium.battery_v)?;
        let close = |name: &LoopName| {
            let plant = LoopPlant::new(&linear, &effect, *name, CANCEL_TOLERANCE)?;
            let closed = ClosedLoop::new(config, &plant, *name, view)?;
            Ok((plant, closed))
        };
        let loops = LOOPS.iter().map(close).collect::<Result<_>>()?;
        Ok(Self { linear, loops })
    }

    /// All loops of `config` closed at once.
    pub fn together(&self, model: &Model, config: &Config, view: View) -> Result<Together> {
        let effect = law_effect(model, &self.linear, config, self.linear.equilibrium.battery_v)?;
        let closed = together(config, &self.linear, &effect, view)?;
        let poles = closed.poles()?;
        let worst = poles.first().copied().unwrap_or_default();
        let slowest_1_s = match closed.period_s {
            Some(period_s) => -worst.norm().ln() / period_s,
            None => -worst.re,
        };
        Ok(Together {
            stable: closed.is_stable()?,
            slowest_1_s,
            least_damped: least_damped(&poles, closed.period_s.unwrap_or(0.0)),
        })
    }

    /// Margins of each loop.
    pub fn margins(&self) -> Result<Vec<(LoopName, LoopMargins)>> {
        self.loops.iter().map(|(_, closed)| Ok((closed.name, LoopMargins::of(closed)?))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The thesis' gains hold the thesis' craft, and the slowest mode of all loops together is that
    /// of the altitude's integral, -0.0570 1/s (reference 2.3); with three samples of delay roll
    /// and pitch are lost, and so is the whole.
    #[test]
    fn the_whole_is_as_stable_as_its_loops() {
        let (model, config) = (Model::thesis(), Config::thesis());
        let study = |view| Study::new(&model, &config, view).unwrap();
        let all = |view| {
            let study = study(view);
            let margins = study.margins().unwrap();
            (margins.iter().all(|(_, m)| m.stable), study.together(&model, &config, view).unwrap())
        };
        let (each, whole) = all(View::Continuous);
        assert!(each && whole.stable && (whole.slowest_1_s - 0.0570).abs() < 2e-4, "{whole:?}");
        let (each, whole) = all(View::Sampled { delay_samples: 3 });
        assert!(!each && !whole.stable && whole.slowest_1_s < 0.0, "{whole:?}");
    }
}
