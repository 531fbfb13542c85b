//! What an answer says: the document of `--json`.

use model::{Effect, NotIdentified, PerAxis};
use schemars::JsonSchema;
use serde::Serialize;
use sysid::Severity;

use crate::compare::{BatteryComparison, CraftComparison};
use crate::events::{Event, Moment, OddFlight};
use crate::scatter::Mean;

/// What a fleet's flights say.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Answer {
    /// Files that were read for it now.
    pub read_now: usize,
    /// Files that are gone; their flights are still counted.
    pub gone: Vec<String>,
    /// Folders with flights and no vehicle file.
    pub unclaimed: Vec<String>,
    /// What `fleet.toml` says of flights that there are not, one sentence each.
    pub unmatched: Vec<String>,
    /// Each craft.
    pub crafts: Vec<CraftAnswer>,
    /// Craft against craft, each since its last change.
    pub craft_against_craft: CraftComparison,
    /// Battery against battery, on the same craft between the same changes.
    pub battery_against_battery: BatteryComparison,
}

/// What a craft's flights say.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CraftAnswer {
    /// Name of its folder.
    pub craft: String,
    /// Name in its vehicle file.
    pub vehicle: String,
    /// Flights that are fitted.
    pub flights: usize,
    /// Time in the air behind them, s.
    pub airborne_s: f64,
    /// The first and the last of them.
    pub span: Option<[Moment; 2]>,
    /// Why the craft has no model, where it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_model: Option<String>,
    /// The effects that are fitted.
    pub effects: Vec<Effect>,
    /// What of the model the flights do not determine; its coefficients are not listed and not compared.
    pub not_identified: Vec<NotIdentified>,
    /// The coefficients of its flights since the last change.
    pub coefficients: Vec<CoefficientAnswer>,
    /// What is left of each axis.
    pub axes: Option<PerAxis<AxisAnswer>>,
    /// What changed.
    pub changes: Vec<Event>,
    /// Single flights that stand out.
    pub odd_flights: Vec<OddFlight>,
    /// What the checks of its logs found, by kind.
    pub faults: Vec<FaultAnswer>,
    /// Files that are not used.
    pub unused: Vec<Unused>,
}

/// A coefficient of a craft.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CoefficientAnswer {
    /// The effect.
    pub effect: Effect,
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Of the flights since the last change, fitted together; nothing where they do not determine it.
    pub value: Option<f64>,
    /// Standard error: by the noise within flights, or by how flights differ where that is more.
    pub std_error: Option<f64>,
    /// Of the flights fitted one by one since the last change.
    pub now: Option<Mean>,
}

/// What is left of an axis: m/s^2 of u v w, rad/s^2 of p q r; root mean square.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct AxisAnswer {
    /// Of the flights fitted together.
    pub rms: f64,
    /// Of each flight under the fit of all others.
    pub held_out_rms: f64,
    /// The same with the effects of the reference; equal where these are asked for.
    pub held_out_rms_of_reference: f64,
}

/// A kind of fault in a craft's logs.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FaultAnswer {
    /// Its kind, such as "clock-offset".
    pub kind: String,
    /// What is done about it.
    pub severity: Severity,
    /// Flights with it, and how many were looked at.
    pub flights: [usize; 2],
    /// The first and the last flight with it.
    pub span: [Moment; 2],
    /// What was found in the last one.
    pub sentence: String,
}

/// A file or flight that is not used.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Unused {
    /// Path in the fleet's folder.
    pub file: String,
    /// Why.
    pub why: String,
}
