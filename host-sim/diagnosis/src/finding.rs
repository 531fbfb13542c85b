//! What a diagnosis says: the conclusion, the evidence for each effect, and what is left.

use std::collections::BTreeMap;

pub use model::Verdict;
use model::{Axis, Coefficient, Effect, Model, NotIdentified, PerGroup};
use report::number::fixed;
use schemars::JsonSchema;
use serde::Serialize;
use sysid::RotorComparison;

use crate::dependence::Dependence;
use crate::figures::rms_fall_percent;
use crate::reason::Reason;

/// Errors of one axis without and with an effect, on the held-out flights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct AxisDrop {
    /// Sum of squares without.
    pub sse_before: f64,
    /// Sum of squares with.
    pub sse_after: f64,
    /// Percent by which it falls.
    pub drop_percent: f64,
}

impl AxisDrop {
    /// From two sums of squares.
    pub(crate) fn new(sse_before: f64, sse_after: f64) -> Self {
        let drop_percent = if sse_before > 0.0 { 100.0 * (1.0 - sse_after / sse_before) } else { 0.0 };
        Self { sse_before, sse_after, drop_percent }
    }
}

/// A coefficient of a candidate.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CoefficientFigures {
    /// Name.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Standard error, coloured residuals accounted for.
    pub std_error: f64,
    /// Unit.
    pub unit: &'static str,
    /// Smallest and largest physically possible value.
    #[serde(skip)]
    pub(crate) possible: (f64, f64),
}

impl CoefficientFigures {
    /// What was found of a coefficient of a model.
    pub(crate) fn new(coefficient: &Coefficient, value: f64, std_error: f64, model: &Model) -> Self {
        let unit = coefficient.unit_for(model.rotor_quantity());
        let possible = coefficient.possible_for(model.vehicle.arm_length);
        Self { name: coefficient.name, value, std_error, unit, possible }
    }

    /// By how much a coefficient of an effect has changed since the model was fitted. What is possible of that depends on the model's own.
    pub(crate) fn of_change((effect, k): (Effect, usize), size: f64, std_error: f64, model: &Model) -> Self {
        let own = model.term(effect).map_or(0.0, |term| term.coefficients[k].value);
        let figures = Self::new(&effect.info().coefficients[k], size, std_error, model);
        let (low, high) = figures.possible;
        Self { possible: (low - own, high - own), ..figures }
    }
}

/// The place where a cable would end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Anchor {
    /// North, east, down, m.
    pub(crate) place_ned_m: [f64; 3],
    /// Its distance from the space that was flown, and how far a cable reaches, m.
    pub(crate) distance_m: f64,
    pub(crate) reach_m: f64,
    /// How far it lies under the floor, m: that is at zero, or as low as was flown.
    pub(crate) depth_m: f64,
}

/// How a slung load swings, as it was estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Swing {
    /// Swings in the longest stretch that it was followed over.
    pub(crate) count: f64,
    /// The frequency up to which a load explains what the craft does, Hz.
    pub(crate) up_to_hz: f64,
    /// Held-out drop of the squared error of u and v up to there, percent; nothing where no stretch is long enough to tell.
    pub(crate) drop_percent: Option<f64>,
}

/// What rows at low frequency say of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AtLowFrequency {
    /// How much of it there is, as a part of what all rows have.
    pub(crate) part: f64,
    /// p-value of "its coefficients are those of all rows".
    pub(crate) same_p_value: f64,
}

/// A candidate's evidence.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct EffectFinding {
    /// The effect.
    pub effect: Effect,
    /// Whether the flights support it.
    pub supported: bool,
    /// Held-out drop of the squared error over the axes it acts on, each weighed by its noise, percent.
    pub drop_percent: f64,
    /// The axes it acts on.
    pub axes: BTreeMap<&'static str, AxisDrop>,
    /// Of the Wald test on the training flights, corrected for the number of candidates.
    pub p_value: f64,
    /// Of the gain on the held-out flights; nothing for an effect that was not fitted exactly, because it did not come
    /// into question.
    pub held_out_p_value: Option<f64>,
    /// Held-out flights on which the error falls, and how many there are.
    pub flights_improved: [usize; 2],
    /// Held-out drop of the squared error of each flight over the axes it acts on, each weighed by its noise, percent.
    #[serde(skip)]
    pub drop_percent_by_flight: Vec<f64>,
    /// Coefficients.
    pub coefficients: Vec<CoefficientFigures>,
    /// Effects that the flights cannot tell it from.
    pub confounded_with: Vec<Effect>,
    /// Why it is or is not supported.
    pub reason: Reason,
    /// Logarithm of the held-out likelihood ratio over all six axes: the rank.
    #[serde(skip)]
    pub(crate) gain: f64,
    /// The axis whose held-out squared error rises most with it, beyond chance, and by how many percent.
    #[serde(skip)]
    pub(crate) rise: Option<(Axis, f64)>,
    /// What all such rises take from the logarithm of the likelihood, percent of what the falls add to it.
    #[serde(skip)]
    pub(crate) harm_percent: f64,
    /// How a slung load swings.
    #[serde(skip)]
    pub(crate) swing: Option<Swing>,
    /// What rows at low frequency say of it, for an effect that moments show and all other rules support.
    #[serde(skip)]
    pub(crate) at_low_frequency: Option<AtLowFrequency>,
    /// By how many degrees the vertical of the tracker would be off if it passed for this wind.
    #[serde(skip)]
    pub(crate) tracker_tilt_deg: Option<f64>,
    /// How late the attitude would be against the position if that passed for it, s.
    #[serde(skip)]
    pub(crate) attitude_late_s: Option<f64>,
    /// Where the cable ends that it would be.
    #[serde(skip)]
    pub(crate) anchor: Option<Anchor>,
    /// Logarithm of the held-out likelihood ratio of each axis.
    #[serde(skip)]
    pub(crate) gain_of: [f64; 6],
    /// The motor, for a change of one motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
}

impl EffectFinding {
    /// What the effect is, and what looks the same without being one.
    pub fn sentence(&self) -> String {
        format!("{}{}", self.effect.info().sentence, self.looks_the_same())
    }

    /// What looks the same as the effect without being one: a sentence behind a space, or nothing.
    pub(crate) fn looks_the_same(&self) -> String {
        let of_tilt = |tilt_deg| {
            format!(
                " In a log without an accelerometer, a tracker whose vertical is {}° off looks the same.",
                fixed(tilt_deg, 1)
            )
        };
        self.tracker_tilt_deg.map_or_else(String::new, of_tilt) + &self.late_attitude()
    }

    /// Which delay looks the same: a sentence behind a space, or nothing.
    pub(crate) fn late_attitude(&self) -> String {
        let of_delay = |late_s: f64| {
            let way = if late_s > 0.0 { "late" } else { "early" };
            format!(
                " In a log without an accelerometer, an attitude that is {} ms {way} relative to the position looks the same as {}.",
                fixed(1e3 * late_s.abs(), 1),
                self.effect
            )
        };
        self.attitude_late_s.map_or_else(String::new, of_delay)
    }

    /// An effect of which nothing is known yet but why not.
    pub(crate) fn unsupported(effect: Effect, flights: usize, reason: Reason) -> Self {
        Self {
            effect,
            supported: false,
            drop_percent: 0.0,
            axes: BTreeMap::new(),
            p_value: 1.0,
            held_out_p_value: None,
            flights_improved: [0, flights],
            drop_percent_by_flight: Vec::new(),
            coefficients: Vec::new(),
            confounded_with: Vec::new(),
            reason,
            gain: f64::NEG_INFINITY,
            rise: None,
            harm_percent: 0.0,
            swing: None,
            at_low_frequency: None,
            tracker_tilt_deg: None,
            attitude_late_s: None,
            anchor: None,
            gain_of: [0.0; 6],
            motor: None,
        }
    }

    /// Takes back the support.
    pub(crate) fn refuse(&mut self, reason: Reason) {
        self.supported = false;
        self.reason = reason;
    }

    /// Not supported, for it may be the moment of a wind beyond any that the model was flown in.
    pub(crate) fn refuse_as_moment_of_wind(&mut self) {
        self.refuse(Reason::MomentOfWind);
        self.confounded_with.push(Effect::SteadyWind);
    }

    /// The axes that its evidence is taken on: of those that it acts on, the ones that the model speaks of.
    pub(crate) fn judged_axes(&self) -> &'static [Axis] {
        let all = self.effect.info().axes;
        match all.iter().take_while(|axis| self.axes.contains_key(axis.name())).count() {
            0 => all,
            judged => &all[..judged],
        }
    }

    /// Held-out fall of the root mean square error over the axes it is judged on, each weighed by its noise, percent.
    pub fn rms_fall_percent(&self) -> f64 {
        rms_fall_percent(self.drop_percent)
    }

    /// Largest drop of an axis, percent.
    pub(crate) fn largest_drop_percent(&self) -> f64 {
        self.axes.values().map(|a| a.drop_percent).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The axis with the largest drop.
    pub(crate) fn main_axis(&self) -> Option<Axis> {
        let (main, _) = self.axes.iter().max_by(|a, b| a.1.drop_percent.total_cmp(&b.1.drop_percent))?;
        model::AXES.into_iter().find(|axis| axis.name() == *main)
    }
}

/// Structure in the residual that no known effect accounts for.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Unexplained {
    /// Axis.
    pub axis: Axis,
    /// What it depends on.
    pub depends_on: Dependence,
    /// Share of the axis' held-out squared error, percent.
    pub share_percent: f64,
    /// Corrected p-value.
    pub p_value: f64,
}

/// When a change began.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Since {
    /// The flight.
    pub flight: String,
    /// Most likely moment, in the flight's own time, s.
    pub t_s: f64,
    /// Whether it may have been there before this flight began.
    pub before_flight: bool,
    /// Earliest likely moment (95 %), in the time of this flight; its first window's, where that is in an earlier flight.
    pub t_low_s: f64,
    /// Latest likely moment (95 %), in the time of this flight; its last window's, where that is in a later flight.
    pub t_high_s: f64,
}

/// A diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Diagnosis {
    /// The conclusion.
    pub verdict: Verdict,
    /// That of the translation and that of the rotation.
    pub verdicts: PerGroup<Verdict>,
    /// The conclusion and its reason in plain English.
    pub summary: String,
    /// Candidates, best first.
    pub effects: Vec<EffectFinding>,
    /// What is left.
    pub unexplained: Vec<Unexplained>,
    /// When the change began, where it has a beginning.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since: Option<Since>,
    /// What the flights do not determine, and why.
    pub not_identified: Vec<NotIdentified>,
    /// The rotors against each other, where nothing is missing from the rotation and the model's coefficients tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotors: Option<RotorComparison>,
    /// The model with every change that is supported, where changes were asked for.
    #[serde(skip)]
    pub with_changes: Option<Model>,
}

impl Diagnosis {
    /// The best supported effect.
    pub fn best(&self) -> Option<Effect> {
        self.effects.iter().find(|e| e.supported).map(|e| e.effect)
    }
}

/// The effects that are supported, in their order.
pub(crate) fn supported(findings: &[EffectFinding]) -> Vec<Effect> {
    findings.iter().filter(|f| f.supported).map(|f| f.effect).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(effect: Effect) -> EffectFinding {
        EffectFinding::unsupported(effect, 2, Reason::LikeChance)
    }

    #[test]
    fn the_best_effect_is_the_first_that_is_supported() {
        let mut all = vec![finding(Effect::Tether), finding(Effect::MotorLag), finding(Effect::SteadyWind)];
        let diagnosis = |effects: &[EffectFinding]| Diagnosis {
            verdict: Verdict::Adequate,
            verdicts: PerGroup::from_fn(|_| Verdict::Adequate),
            summary: String::new(),
            effects: effects.to_vec(),
            unexplained: Vec::new(),
            since: None,
            rotors: None,
            with_changes: None,
            not_identified: Vec::new(),
        };
        assert_eq!(diagnosis(&all).best(), None);
        all[1].supported = true;
        all[2].supported = true;
        assert_eq!(diagnosis(&all).best(), Some(Effect::MotorLag));
        assert_eq!(supported(&all), [Effect::MotorLag, Effect::SteadyWind]);
    }

    #[test]
    fn a_wind_says_which_tilt_of_the_tracker_looks_the_same() {
        let mut wind = finding(Effect::SteadyWind);
        assert_eq!(wind.sentence(), Effect::SteadyWind.info().sentence);
        wind.tracker_tilt_deg = Some(1.46);
        assert!(wind.sentence().contains("a tracker whose vertical is 1.5° off"), "{}", wind.sentence());
    }

    #[test]
    fn a_rate_coupling_says_which_delay_of_the_attitude_looks_the_same() {
        let mut coupling = finding(Effect::RateCoupling);
        assert_eq!(coupling.late_attitude(), "");
        for (late_s, expected) in [(0.0049, "4.9 ms late"), (-0.01, "10.0 ms early")] {
            coupling.attitude_late_s = Some(late_s);
            assert!(coupling.sentence().contains(expected), "{}", coupling.sentence());
        }
    }

    #[test]
    fn the_main_axis_is_that_of_the_largest_drop() {
        let mut finding = finding(Effect::Tether);
        assert_eq!(finding.main_axis(), None);
        for (axis, after) in [("u", 9.0), ("v", 4.0), ("w", 11.0)] {
            finding.axes.insert(axis, AxisDrop::new(10.0, after));
        }
        assert_eq!(finding.main_axis(), Some(Axis::V));
        assert_eq!(finding.largest_drop_percent(), 60.0);
        assert_eq!(AxisDrop::new(0.0, 1.0).drop_percent, 0.0);
    }

    /// Files and scripts know effects, reasons and dependences by their words.
    #[test]
    fn effects_and_reasons_are_words_in_json() {
        let mut finding = finding(Effect::Tether);
        finding.confounded_with.push(Effect::SteadyWind);
        let json = serde_json::to_value(&finding).unwrap();
        assert_eq!(json["effect"], "tether");
        assert_eq!(json["confounded_with"][0], "steady-wind");
        assert_eq!(json["reason"], finding.reason.to_string());
        assert!(json.get("motor").is_none() && json.get("gain").is_none());
    }
}
