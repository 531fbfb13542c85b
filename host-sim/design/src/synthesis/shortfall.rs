//! What of its specifications a design does not meet.

use control::Config;
use model::Model;

use super::specs::{Method, Specs};
use crate::analysis::{LoopMargins, StepMetrics, Study, commanded, step_metrics};
use crate::error::{Criterion, Result, Shortfall, SpecField, SpecKey, SpecTable};
use crate::loops::{LoopName, View, inner_gains, loops_of};

/// A specification of a loop that is not met.
pub(super) fn unmet(name: LoopName, what: Criterion, wanted: f64, reached: f64) -> Shortfall {
    Shortfall { name: name.name(), what, wanted, reached, key: spec_key(name, what) }
}

/// The entry of a specifications file that asks for a number of a loop; absent where there is none
/// to relax.
fn spec_key(name: LoopName, what: Criterion) -> Option<SpecKey> {
    let table = match name {
        LoopName::Roll | LoopName::Pitch => SpecTable::Attitude,
        LoopName::Yaw => SpecTable::Yaw,
        LoopName::Z => SpecTable::Altitude,
        LoopName::X | LoopName::Y => SpecTable::Position,
    };
    let field = match (what, table) {
        (Criterion::PhaseMargin | Criterion::PhaseMarginBeforeIntegral, _) => SpecField::PhaseMargin,
        (Criterion::GainMargin, _) => SpecField::GainMargin,
        (Criterion::Crossover, SpecTable::Attitude | SpecTable::Position) => SpecField::Crossover,
        (Criterion::OvershootByDamping, SpecTable::Attitude) => SpecField::DampingOvershoot,
        (Criterion::Overshoot | Criterion::OvershootByDamping, _) => SpecField::Overshoot,
        (Criterion::Rise, _) => SpecField::Rise,
        (Criterion::LeastAfterPeak, _) => SpecField::LeastAfterPeak,
        (Criterion::IntegralRate, _) => SpecField::Integral,
        (Criterion::LateStability, _) => return Some(SpecKey::StableDelaySamples),
        _ => return None,
    };
    Some(SpecKey::Of(table, field))
}

/// The shortfalls of one loop. A number that cannot be measured does not fall short.
struct Review {
    name: LoopName,
    list: Vec<Shortfall>,
}

impl Review {
    fn at_least(&mut self, what: Criterion, wanted: f64, reached: Option<f64>) {
        if let Some(reached) = reached.filter(|reached| *reached < wanted) {
            self.list.push(unmet(self.name, what, wanted, reached));
        }
    }

    fn at_most(&mut self, what: Criterion, wanted: f64, reached: Option<f64>) {
        if let Some(reached) = reached.filter(|reached| *reached > wanted) {
            self.list.push(unmet(self.name, what, wanted, reached));
        }
    }

    fn attitude(&mut self, config: &Config, specs: &Specs, margins: &LoopMargins, step: &StepMetrics) {
        let wanted = &specs.attitude;
        let error = &margins.at_error;
        self.at_least(Criterion::PhaseMargin, wanted.phase_margin_deg, error.phase_margin_deg);
        if specs.method == Method::Delay {
            let gains = inner_gains(loops_of(config), self.name);
            self.at_least(Criterion::IntegralRate, wanted.integral_rad_s, Some(gains.ki / gains.kp));
            self.at_least(Criterion::GainMargin, wanted.gain_margin, error.gain_margin);
            self.at_least(Criterion::LeastAfterPeak, wanted.least_after_peak, step.lowest_after_peak);
            self.at_most(Criterion::Overshoot, wanted.overshoot_percent, Some(step.overshoot_percent));
            self.at_most(Criterion::Rise, wanted.rise_s.unwrap_or(0.3), step.rise_s);
        }
    }

    fn yaw_or_altitude(&mut self, specs: &Specs, margins: &LoopMargins, step: &StepMetrics) {
        let wanted = if self.name == LoopName::Yaw { &specs.yaw } else { &specs.altitude };
        let error = &margins.at_error;
        if specs.method == Method::Delay {
            self.at_least(Criterion::PhaseMargin, wanted.phase_margin_deg, error.phase_margin_deg);
            self.at_least(Criterion::GainMargin, wanted.gain_margin, error.gain_margin);
        }
        self.at_most(Criterion::Overshoot, wanted.overshoot_percent, Some(step.overshoot_percent));
        self.at_most(Criterion::Rise, wanted.rise_s, step.rise_s);
    }

    fn position(&mut self, specs: &Specs, margins: &LoopMargins, step: &StepMetrics) {
        let wanted = &specs.position;
        let error = &margins.at_error;
        self.at_least(Criterion::PhaseMargin, wanted.phase_margin_deg, error.phase_margin_deg);
        self.at_most(Criterion::Overshoot, wanted.overshoot_percent, Some(step.overshoot_percent));
        if specs.method == Method::Delay {
            self.at_least(Criterion::GainMargin, wanted.gain_margin, error.gain_margin);
        }
    }
}

/// The specifications that the gains do not meet, in the view of their method.
///
/// # Errors
/// A model that cannot be linearised at hover, or loops that cannot be built around it.
pub fn shortfalls(model: &Model, config: &Config, specs: &Specs) -> Result<Vec<Shortfall>> {
    let view = specs.view();
    let study = Study::new(model, config, view)?;
    let specs = &specs.for_craft(&study.linear);
    let mut list = Vec::new();
    for ((_, closed), (name, margins)) in study.loops.iter().zip(study.margins()?) {
        let mut review = Review { name, list: Vec::new() };
        review.at_least(Criterion::Stability, 1.0, Some(f64::from(margins.stable)));
        if margins.stable {
            let step = commanded(config, closed)?;
            let step = step_metrics(&step.values, step.period_s);
            match name {
                LoopName::Roll | LoopName::Pitch => review.attitude(config, specs, &margins, &step),
                LoopName::Yaw | LoopName::Z => review.yaw_or_altitude(specs, &margins, &step),
                LoopName::X | LoopName::Y => review.position(specs, &margins, &step),
            }
        }
        list.extend(review.list);
    }
    let together = study.together(model, config, view)?;
    list.extend((!together.stable).then_some(Shortfall {
        name: "all loops together",
        what: Criterion::DecayTogether,
        wanted: 0.0,
        reached: together.slowest_1_s,
        key: None,
    }));
    if specs.method == Method::Delay {
        let late = Study::new(model, config, View::Sampled { delay_samples: specs.stable_delay_samples })?;
        for (name, margins) in late.margins()? {
            let mut review = Review { name, list: Vec::new() };
            review.at_least(Criterion::LateStability, 1.0, Some(f64::from(margins.stable)));
            list.extend(review.list);
        }
    }
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::LOOPS;
    use crate::synthesis::specs::AttitudeSpecs;

    /// Asked for no overshoot at all, the thesis' gains in pitch, which overshoot by 2 % with two
    /// samples of delay, fall short of 0 by a positive number: not of -0, and not by -2.
    #[test]
    fn an_overshoot_above_zero_is_positive() {
        let mut specs = Specs { stable_delay_samples: 2, ..Specs::default() };
        specs.attitude = AttitudeSpecs { overshoot_percent: 0.0, ..specs.attitude };
        let list = shortfalls(&Model::thesis(), &Config::thesis(), &specs).unwrap();
        let over = list.iter().find(|s| s.what == Criterion::Overshoot && s.name == "pitch").unwrap();
        assert!((over.reached - 1.96).abs() < 0.01, "{over:?}");
        assert!(over.wanted == 0.0 && over.wanted.is_sign_positive());
        assert_eq!(over.key.unwrap().to_string(), "attitude.overshoot_percent");
    }

    /// What the thesis' gains promise they keep, without delay; with three samples roll and pitch
    /// are unstable, which no specification can be relaxed for.
    #[test]
    fn unstable_loops_have_no_specification_to_relax() {
        let (model, config) = (Model::thesis(), Config::thesis());
        assert_eq!(shortfalls(&model, &config, &Specs::thesis()).unwrap(), []);
        let late = Specs { delay_samples: 3, stable_delay_samples: 3, ..Specs::default() };
        let list = shortfalls(&model, &config, &late).unwrap();
        let unstable: Vec<_> =
            list.iter().filter(|s| s.what == Criterion::Stability).map(|s| (s.name, s.key)).collect();
        assert!(unstable.contains(&("roll", None)) && unstable.contains(&("pitch", None)), "{list:?}");
        assert!(list.iter().any(|s| s.what == Criterion::DecayTogether && s.reached < 0.0));
        let key = list.iter().find(|s| s.what == Criterion::LateStability).unwrap().key;
        assert_eq!(key, Some(SpecKey::StableDelaySamples));
    }

    /// A key that the file does not have would be a wrong hint.
    #[test]
    fn every_key_can_be_written_in_a_file() {
        for name in LOOPS {
            for what in [
                Criterion::PhaseMargin,
                Criterion::PhaseMarginBeforeIntegral,
                Criterion::GainMargin,
                Criterion::Crossover,
                Criterion::OvershootByDamping,
                Criterion::Overshoot,
            ] {
                let Some(key) = spec_key(name, what) else { continue };
                let read = Specs::parse(&format!("{key} = 2.0"), std::path::Path::new("s.toml"));
                assert!(read.is_ok(), "{name} {what:?}: {read:?}");
            }
        }
        assert_eq!(spec_key(LoopName::Yaw, Criterion::Crossover), None);
    }
}
