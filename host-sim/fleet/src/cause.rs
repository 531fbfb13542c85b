//! The cause of a change as `quadlab diagnose --changed` finds it in the logs: a model of the last flights before it is held against
//! the first flights after it. It reads these logs only, and what it says is kept in the index.

use std::path::PathBuf;

use diagnosis::workflow::{FlightsOfOneKind, LoadedFlight, Observer, Silent, changed, identify, sha256};
use diagnosis::{CoefficientFigures, Options};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::changes::Size;
use crate::error::one_line;
use crate::layout::{Craft, Fleet, READING};
use crate::reference::{is_good, sets_of};
use crate::row::Row;
use crate::words::word;

/// Flights before a change that a model is made of, and flights after it that are held against it.
const BEFORE: usize = 6;
const AFTER: usize = 4;
/// A change of what an answer holds is a new number: the logs are asked again.
const ANSWER: &str = "2";

/// What the logs say of a change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CauseInLogs {
    /// "missing-effect" where a change accounts for it, "adequate" where nothing changed, "unexplained" where no known change accounts
    /// for it, "not-identified" where the flights do not tell, "not-asked" where the logs could not be used.
    pub verdict: String,
    /// The conclusion in plain English, or why there is none.
    pub summary: String,
    /// The change.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effect: Option<String>,
    /// Its motor, for a change of one motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
    /// Its size, fitted without linearisation.
    #[serde(default)]
    pub coefficients: Vec<Size>,
    /// Changes that these flights cannot tell from it.
    #[serde(default)]
    pub confounded_with: Vec<String>,
    /// The flights that the model is made of.
    pub before: Vec<String>,
    /// The flights that were held against it.
    pub after: Vec<String>,
}

/// Where the logs could not be used.
const NOT_ASKED: &str = "not-asked";

impl CauseInLogs {
    /// Whether the logs could be asked.
    pub fn is_answer(&self) -> bool {
        self.verdict != NOT_ASKED
    }
}

/// The flights that are asked about a change before the flight at `at`.
pub(crate) fn flights<'a>(rows: &'a [&'a Row], [from, at, to]: [usize; 3]) -> [&'a [&'a Row]; 2] {
    [&rows[from.max(at.saturating_sub(BEFORE))..at], &rows[at..to.min(at + AFTER)]]
}

/// What an answer is kept under.
pub(crate) fn key([before, after]: [&[&Row]; 2]) -> String {
    let told = |rows: &[&Row]| {
        let of = |row: &&Row| format!("{} {} {}", row.sha256, row.part, row.context);
        rows.iter().map(of).collect::<Vec<_>>().join("\n")
    };
    sha256(format!("{ANSWER}\n{}\n|\n{}", told(before), told(after)).as_bytes())
}

/// Asks the logs.
pub(crate) fn ask(
    fleet: &Fleet,
    craft: &Craft,
    [before, after]: [&[&Row]; 2],
    observer: &dyn Observer,
) -> CauseInLogs {
    let names = |rows: &[&Row]| rows.iter().map(|row| row.label()).collect::<Vec<_>>();
    let answer = CauseInLogs {
        verdict: NOT_ASKED.into(),
        summary: String::new(),
        effect: None,
        motor: None,
        coefficients: Vec::new(),
        confounded_with: Vec::new(),
        before: names(before),
        after: names(after),
    };
    match answered(fleet, craft, [before, after], observer) {
        Ok(found) => CauseInLogs { before: answer.before, after: answer.after, ..found },
        Err(summary) => CauseInLogs { summary, ..answer },
    }
}

fn answered(
    fleet: &Fleet,
    craft: &Craft,
    [before, after]: [&[&Row]; 2],
    observer: &dyn Observer,
) -> Result<CauseInLogs, String> {
    let mut sets = sets_of(load(fleet, craft, before)?.flights, craft)?;
    let model = identify(&craft.vehicle, &[], &mut sets, None, &Silent).map_err(one_line)?.model;
    let mut after = load(fleet, craft, after)?;
    let diagnosis = changed(&model, &[], &mut after, &Options::default(), observer).map_err(one_line)?;
    let best = diagnosis.effects.iter().find(|finding| finding.supported);
    Ok(CauseInLogs {
        verdict: word(&diagnosis.verdict),
        summary: diagnosis.summary.clone(),
        effect: best.map(|finding| finding.effect.id().to_owned()),
        motor: best.and_then(|finding| finding.motor),
        coefficients: best.map(|finding| finding.coefficients.iter().map(size).collect()).unwrap_or_default(),
        confounded_with: best
            .map(|finding| finding.confounded_with.iter().map(|other| other.id().to_owned()).collect())
            .unwrap_or_default(),
        before: Vec::new(),
        after: Vec::new(),
    })
}

fn size(figures: &CoefficientFigures) -> Size {
    let CoefficientFigures { name, value, std_error, unit, .. } = *figures;
    Size { name: name.into(), value, std_error, unit: unit.into() }
}

/// The flights of some rows, read again.
fn load(fleet: &Fleet, craft: &Craft, rows: &[&Row]) -> Result<FlightsOfOneKind, String> {
    let mut paths: Vec<PathBuf> = rows.iter().map(|row| fleet.folder.join(&row.file)).collect();
    paths.dedup();
    let read = FlightsOfOneKind::read(&paths, &craft.vehicle, READING, &Silent).map_err(one_line)?;
    let is_asked =
        |flight: &LoadedFlight| is_good(flight) && rows.iter().any(|row| row.name == flight.prepared.name);
    let flights = read.flights.into_iter().filter(is_asked).collect();
    FlightsOfOneKind::from_loaded(flights, &craft.vehicle, READING).map_err(one_line)
}
