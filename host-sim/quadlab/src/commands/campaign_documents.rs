//! What `quadlab campaign plan` and `replay` print with `--json`.

use std::path::Path;

use campaign::{CaseFlight, Needed, Plan, Truncation};
use schemars::JsonSchema;
use serde::Serialize;

/// A plan that was made.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Planned<'a> {
    /// The plan file.
    file: &'a Path,
    /// Flights that it has.
    flights: u64,
    /// Shards that it is flown in.
    shards: u64,
    /// Normal distributions that are truncated, because they reach beyond what can be simulated.
    truncations: Vec<Truncation>,
}

impl<'a> Planned<'a> {
    pub(crate) fn new(file: &'a Path, plan: &Plan) -> Self {
        Self { file, flights: plan.cases(), shards: plan.shards, truncations: plan.truncations() }
    }
}

/// What came of a case.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Replayed<'a> {
    case: u64,
    draw: u64,
    scenario: &'a str,
    gains: &'a str,
    /// How the craft was lost; absent where it was kept.
    lost_by: Option<&'a str>,
    /// After how many s.
    lost_after_s: Option<f64>,
    /// Why no gains could fly this craft in this air; absent where some can.
    impossible: Option<&'a str>,
    /// State of the supervisor at the end.
    ended: &'a str,
    /// Conditions that the supervisor saw.
    events: &'a str,
    /// Whether the scenario's requirements hold; absent for a tour.
    requirements_hold: Option<bool>,
    /// Greatest tilt, deg.
    tilt_deg: f64,
    /// Root mean square of the distance from the commanded height, m.
    height_error_m: f64,
    /// Share of the ticks with a motor at an end of its range, percent.
    saturated_percent: f64,
    /// The fault, where there is one.
    fault: Option<String>,
    /// What was drawn.
    inputs: Vec<Needed>,
}

impl<'a> Replayed<'a> {
    pub(crate) fn new(plan: &'a Plan, flight: &'a CaseFlight) -> Self {
        let flown = &flight.flown;
        Self {
            case: flown.case.number,
            draw: flown.case.draw,
            scenario: &plan.campaign.scenarios[flown.case.scenario],
            gains: &plan.campaign.gains[flown.case.gains].name,
            lost_by: flown.lost.as_ref().map(|(why, _)| why.as_str()),
            lost_after_s: flown.lost.as_ref().map(|(_, after_s)| *after_s),
            impossible: flown.impossible.as_deref(),
            ended: &flown.ended,
            events: &flown.events,
            requirements_hold: flown.requirements_hold,
            tilt_deg: flown.tilt_deg,
            height_error_m: flown.height_error_m,
            saturated_percent: flown.saturated_percent,
            fault: flown.drawn.fault.map(|fault| fault.to_string()),
            inputs: flown.drawn.inputs.iter().cloned().map(Needed::from).collect(),
        }
    }
}
