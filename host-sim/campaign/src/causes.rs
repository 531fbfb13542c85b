//! Why a flight was lost: the fewest of its conditions that lose it.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use crate::draw::{DELAY, Drawn, Input};
use crate::error::CampaignError;
use crate::plan::{Case, Plan, Ready};

/// Halvings of the departures that are needed.
const HALVINGS: usize = 7;

/// The fewest conditions of a flight that lose it: with any one of them as in the model and the scenario, the craft is kept.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Causes {
    /// The case.
    pub case: u64,
    /// How it was lost, and after how many s.
    pub lost_by: String,
    /// See `lost_by`.
    pub after_s: f64,
    /// Numbers that have to be as they were drawn; all others can be as in the model and the scenario.
    pub needed: Vec<Needed>,
    /// The fault, where the craft is lost with it alone or with `needed`, and not without.
    pub fault: Option<String>,
    /// The smallest share of the departures of `needed` that still loses it, percent; absent where none can be made smaller.
    pub enough_percent: Option<f64>,
    /// Flights that were flown to find it.
    pub flights: u64,
}

/// A number that has to be as it was drawn.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Needed {
    /// Its name.
    pub name: String,
    /// What was drawn.
    pub value: f64,
    /// What it is in the model and the scenario.
    pub usual: f64,
}

impl From<Input> for Needed {
    fn from(Input { name, value, usual }: Input) -> Self {
        Self { name, value, usual }
    }
}

/// Flights of one case with some conditions as in the model and the scenario.
struct Trials<'a> {
    ready: &'a Ready<'a>,
    case: Case,
    drawn: Drawn,
    flown: u64,
}

impl Trials<'_> {
    /// How the craft is lost where only these conditions are as drawn, each at a share of its departure; nothing where it is kept.
    fn lost(
        &mut self,
        kept: &[bool],
        with_fault: bool,
        share: f64,
    ) -> Result<Option<(String, f64)>, CampaignError> {
        let is_kept = |input: &Input| {
            let place = self.drawn.inputs.iter().position(|own| own.name == input.name);
            place.is_some_and(|place| kept[place])
        };
        let change = |input: &Input| match (is_kept(input), is_whole(input)) {
            (false, _) => input.usual,
            (true, true) => input.value,
            (true, false) => input.usual + share * (input.value - input.usual),
        };
        let drawn = self.drawn.changed(change, with_fault, &self.ready.model);
        self.flown += 1;
        let flown = self.ready.flown_as(self.case, drawn)?;
        Ok(flown.lost.or_else(|| flown.impossible.map(|why| (why, f64::NAN))))
    }
}

/// Whether a number has no parts.
pub(crate) fn is_whole(input: &Input) -> bool {
    input.name == DELAY
}

impl Plan {
    /// The fewest conditions of a case that lose it; nothing where it was kept. Conditions are taken back to what they are in the model
    /// and the scenario one after the other, the fault first, as long as the craft is lost all the same, and over again until none can be.
    ///
    /// # Errors
    /// A case that there is not or that nobody could fly, or a plan that cannot be flown.
    pub fn causes(&self, case: u64, path: &Path) -> Result<Option<Causes>, CampaignError> {
        let (case, ready) = (self.case(case)?, self.ready(path)?);
        let drawn = self.drawn(case.draw, &ready.model);
        if let Some(why) = ready.fly(case)?.flown.impossible {
            return Err(CampaignError::Flight {
                case: case.number,
                why: format!("no gains could fly it: {why}"),
            });
        }
        ready.causes(case, drawn)
    }
}

impl Ready<'_> {
    /// The same of a flight with any numbers.
    pub(crate) fn causes(&self, case: Case, drawn: Drawn) -> Result<Option<Causes>, CampaignError> {
        let mut kept: Vec<bool> = drawn.inputs.iter().map(|input| input.value != input.usual).collect();
        let mut with_fault = drawn.fault.is_some();
        let mut trials = Trials { ready: self, case, drawn, flown: 0 };
        let Some((lost_by, after_s)) = trials.lost(&kept, with_fault, 1.0)? else { return Ok(None) };
        loop {
            let before = (kept.clone(), with_fault);
            if with_fault && trials.lost(&kept, false, 1.0)?.is_some() {
                with_fault = false;
            }
            for place in 0..kept.len() {
                if std::mem::replace(&mut kept[place], false) {
                    kept[place] = trials.lost(&kept, with_fault, 1.0)?.is_none();
                }
            }
            if (kept.clone(), with_fault) == before {
                break;
            }
        }
        let needed: Vec<Input> = trials
            .drawn
            .inputs
            .iter()
            .zip(&kept)
            .filter(|(_, kept)| **kept)
            .map(|(input, _)| input.clone())
            .collect();
        let enough = needed
            .iter()
            .any(|input| !is_whole(input))
            .then(|| trials.smallest(&kept, with_fault))
            .transpose()?;
        Ok(Some(Causes {
            case: case.number,
            lost_by,
            after_s,
            needed: needed.into_iter().map(Needed::from).collect(),
            fault: trials.drawn.fault.filter(|_| with_fault).map(|fault| fault.to_string()),
            enough_percent: enough.map(|share| 100.0 * share),
            flights: trials.flown,
        }))
    }
}

impl Trials<'_> {
    /// The smallest share of the departures that loses the craft, by halving between one that does and one that does not.
    fn smallest(&mut self, kept: &[bool], with_fault: bool) -> Result<f64, CampaignError> {
        let (mut keeps, mut loses) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (keeps + loses);
            if self.lost(kept, with_fault, middle)?.is_some() {
                loses = middle;
            } else {
                keeps = middle;
            }
        }
        Ok(loses)
    }
}
