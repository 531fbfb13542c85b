//! What a search for unknown effects answers.

use std::collections::BTreeMap;

use model::user_effects::Definition;
use model::{Axis, Effect, Model};
use schemars::JsonSchema;
use serde::Serialize;

use crate::finding::{EffectFinding, Unexplained};

/// What a search for unknown effects ends with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DiscoveryVerdict {
    /// Something is left, and has a form.
    Proposed,
    /// Nothing is left beyond noise.
    Nothing,
    /// Something is left, of which no formula generalises.
    NotAFormula,
}

/// A number in the formula of a form.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FormNumber {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard error, coloured residuals accounted for.
    pub std_error: f64,
    /// Unit; of commands where these stand in for rotor speeds.
    pub unit: String,
}

/// By how much the error of a flight falls.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FlightFall {
    /// The flight.
    pub flight: String,
    /// Of the squared error, percent.
    pub drop_percent: f64,
}

/// A form of what is left, with its evidence.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Proposal {
    /// Identifier under which `--out` writes it.
    pub id: String,
    /// The axes that it acts on.
    pub axes: Vec<Axis>,
    /// Its rows as formulas of users' effects: `row: formula`, several with `; ` between them.
    pub formula: String,
    /// Measured quantities that it depends on.
    pub quantities: Vec<&'static str>,
    /// What it does, in plain English.
    pub sentence: String,
    /// Known physics that behaves so, with its source.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub physics: Option<&'static str>,
    /// Its coefficients, fitted together with all of the model's.
    pub coefficients: Vec<FormNumber>,
    /// Bearings and times of lags: constants in the formula, estimated beside the coefficients. Those that these flights do not determine
    /// are left out.
    pub constants: Vec<FormNumber>,
    /// Fall of the held-out squared error of each axis, percent.
    pub drop_percent: BTreeMap<&'static str, f64>,
    /// Share that it takes of what sensors' noise leaves of the held-out squared error unexplained on its axes, percent; of all of
    /// that error where the noise is not known.
    pub share_of_structure_percent: f64,
    /// The larger of two chances: that the same search finds one of such worth in residuals of the same colour and random phases, and
    /// that noise makes the held-out error fall as much.
    pub p_value: f64,
    /// Training flights on which it helps when it is fitted to the others, and how many there are.
    pub splits: [usize; 2],
    /// Held-out flights on which the error falls, and how many there are.
    pub flights_improved: [usize; 2],
    /// Fall of the squared error of each held-out flight over those axes, each weighed by its noise.
    pub flights: Vec<FlightFall>,
    /// Forms over other quantities that take about as much: these flights do not tell them apart.
    pub rivals: Vec<String>,
    /// What to fly so that they part.
    pub excite: String,
    /// The effect of users that it is.
    #[serde(skip)]
    pub definition: Definition,
    /// The evidence as for any other effect.
    #[serde(skip)]
    pub finding: EffectFinding,
}

/// What a search for unknown effects answers.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// The forms, best first.
    pub proposals: Vec<Proposal>,
    /// The conclusion.
    pub verdict: DiscoveryVerdict,
    /// Known effects that were missing, which come first.
    pub known: Vec<Effect>,
    /// The best form that was not proposed, and why.
    pub refused: Option<String>,
    /// What is left after the first proposal, or of the model where there is none.
    pub left: Vec<Unexplained>,
    /// Chance that residuals of random phases have a form of such worth.
    pub search_p_value: f64,
    /// The model with the known effects, and with the first proposal where there is one.
    pub model: Model,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reason::Reason;

    /// Scripts read a proposal by these words; what the program keeps for itself stays out, and so does physics where none is known.
    #[test]
    fn a_proposal_is_words_and_numbers_in_json() {
        let definition = Definition {
            id: "height_force".into(),
            sentence: None,
            excitation: None,
            acceleration: BTreeMap::new(),
            confused_with: BTreeMap::new(),
            coefficient: Vec::new(),
            constant: Vec::new(),
            column: Vec::new(),
        };
        let proposal = Proposal {
            id: "height_force".into(),
            axes: vec![Axis::U, Axis::P],
            formula: "u: k * height / mass".into(),
            quantities: vec!["height"],
            sentence: String::new(),
            physics: None,
            coefficients: Vec::new(),
            constants: Vec::new(),
            drop_percent: BTreeMap::from([("u", 12.5)]),
            share_of_structure_percent: 50.0,
            p_value: 0.001,
            splits: [2, 3],
            flights_improved: [1, 2],
            flights: Vec::new(),
            rivals: Vec::new(),
            excite: String::new(),
            definition,
            finding: EffectFinding::unsupported(Effect::Tether, 2, Reason::LikeChance),
        };
        let json = serde_json::to_value(&proposal).unwrap();
        assert_eq!(json["axes"], serde_json::json!(["u", "p"]));
        assert_eq!((&json["drop_percent"]["u"], &json["splits"]), (&12.5.into(), &vec![2, 3].into()));
        assert!(["physics", "definition", "finding"].iter().all(|kept| json.get(kept).is_none()), "{json}");
        let verdicts = [DiscoveryVerdict::Proposed, DiscoveryVerdict::Nothing, DiscoveryVerdict::NotAFormula];
        let words = verdicts.map(|verdict| serde_json::to_value(verdict).unwrap());
        assert_eq!(words, ["proposed", "nothing", "not-a-formula"]);
    }
}
