//! A flight of a campaign as it is planned, and what came of it.

use sil::endurance::Feasibility;
use sil::{FlightPlan, SilError};

use crate::draw::{Drawn, Flies};
use crate::error::CampaignError;
use crate::plan::{Case, Ready};

/// State of the supervisor in a flight that was flown as commanded.
pub(crate) const FLYING: &str = "flying";
/// Between names of conditions.
pub(crate) const SEPARATOR: &str = "; ";

/// What came of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// Which.
    pub case: Case,
    /// What was drawn for it.
    pub drawn: Drawn,
    /// How long it was to be, s.
    pub duration_s: f64,
    /// How the craft was lost, and after how many s: a crash, the motors cut, or upside down. A reason of physics does not count.
    pub lost: Option<(String, f64)>,
    /// Why no gains could fly this craft in this air: it cannot hover.
    pub impossible: Option<String>,
    /// Who had the craft at the end: the state of the supervisor.
    pub ended: String,
    /// Conditions that the supervisor saw in the flight.
    pub events: String,
    /// Whether the scenario's requirements hold; nothing of a tour.
    pub requirements_hold: Option<bool>,
    /// Overshoot of a step, percent.
    pub overshoot_percent: f64,
    /// Rise time of a step, s.
    pub rise_s: f64,
    /// Greatest tilt, deg.
    pub tilt_deg: f64,
    /// Root mean square of the distance from the commanded height, m.
    pub height_error_m: f64,
    /// Share of the ticks with a motor at an end of its range, percent.
    pub saturated_percent: f64,
}

/// A flight before it is flown.
pub(crate) struct Planned {
    pub(crate) case: Case,
    pub(crate) drawn: Drawn,
    pub(crate) flies: Flies,
    pub(crate) plan: FlightPlan,
}

impl Planned {
    pub(crate) fn new(ready: &Ready<'_>, case: Case, drawn: Drawn) -> Self {
        let flies = ready.flies[case.scenario];
        Self { case, flies, plan: drawn.plan(flies, &ready.configs[case.gains]), drawn }
    }

    pub(crate) fn refused(&self, why: &SilError) -> CampaignError {
        CampaignError::Flight { case: self.case.number, why: why.to_string() }
    }

    /// What came of it, with whether anybody could have flown it, which is no matter of how it was flown.
    pub(crate) fn judged(&self, mut flown: Flown, feasibility: &mut Feasibility) -> Flown {
        flown.impossible = feasibility.impossible(&self.plan).map(|why| why.to_string());
        flown.lost = flown.lost.filter(|_| flown.impossible.is_none());
        flown
    }
}
