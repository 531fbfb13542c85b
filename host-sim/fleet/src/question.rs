//! What is asked of an index, and which flights it is about.

use std::collections::BTreeMap;

use model::Effect;

use crate::document::Unused;
use crate::equations::Columns;
use crate::error::FleetError;
use crate::index::Index;
use crate::layout::Fleet;
use crate::pass::Indexed;
use crate::row::{Row, State};
use crate::when::{self, When, day_and_time};

/// A flight of a craft as the tables and pages need it.
pub struct FlightOf<'a> {
    /// What is kept of it.
    pub row: &'a Row,
    /// When it was flown.
    pub when: When,
    /// Its battery, where that is known.
    pub battery: Option<String>,
}

/// What is asked.
#[derive(Debug, Clone, Default)]
pub struct Question {
    /// Effects beside the basic ones, in the place of those of each craft's reference.
    pub effects: Option<Vec<Effect>>,
    /// Effects that are left out.
    pub without: Vec<Effect>,
    /// Craft; all where none is named.
    pub crafts: Vec<String>,
    /// Flights that are left out, by their path in the fleet's folder.
    pub leave_out: Vec<String>,
    /// First and last moment, Unix time in s.
    pub span_s: [Option<f64>; 2],
    /// Whether logs may be read for the causes of changes.
    pub causes: bool,
}

impl Question {
    /// Whether the causes of changes may be looked up: what `quadlab diagnose --changed` says is about the usual effects.
    pub fn looks_up_causes(&self) -> bool {
        self.causes && self.is_usual()
    }

    /// Whether a moment lies in the span, Unix time in s.
    fn spans(&self, unix_s: f64) -> bool {
        self.span_s[0].is_none_or(|from| unix_s >= from) && self.span_s[1].is_none_or(|to| unix_s <= to)
    }

    /// Whether it is about the usual effects.
    pub(crate) fn is_usual(&self) -> bool {
        self.effects.is_none() && self.without.is_empty()
    }
}

/// Whether what is asked for is there.
pub(crate) fn check(fleet: &Fleet, indexed: &Indexed, question: &Question) -> Result<(), FleetError> {
    let craft_names = || fleet.crafts.iter().map(|craft| craft.name.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(wrong) =
        question.crafts.iter().find(|own| fleet.crafts.iter().all(|craft| craft.name != **own))
    {
        return Err(FleetError::Asked(format!(
            "--craft {wrong}: no such craft; there are {}",
            craft_names()
        )));
    }
    let is_there =
        |own: &String| indexed.index.rows.iter().any(|row| row.file == *own || row.label() == *own);
    if let Some(wrong) = question.leave_out.iter().find(|own| !is_there(own)) {
        return Err(FleetError::Asked(format!(
            "--leave-out {wrong}: no such flight; give its path in the fleet's folder, such as {}",
            indexed.index.rows.first().map(Row::label).unwrap_or_default()
        )));
    }
    if let Some(effect) = question.effects.iter().flatten().find(|effect| !Columns::have(**effect)) {
        return Err(FleetError::Asked(format!(
            "--effects {effect}: the index keeps nothing to fit it from; quadlab add {effect} fits it to flights"
        )));
    }
    check_span(fleet, indexed, question)
}

/// Whether any flight was flown in the span that is asked for.
fn check_span(fleet: &Fleet, indexed: &Indexed, question: &Question) -> Result<(), FleetError> {
    let [since, until] = question.span_s;
    if since.is_none() && until.is_none() {
        return Ok(());
    }
    let is_asked = |row: &&Row| {
        let is_craft = question.crafts.is_empty() || question.crafts.contains(&row.craft);
        is_craft && row.state == State::Used && !fleet.settings.excludes(&row.file)
    };
    let rows = indexed.index.rows.iter().filter(is_asked);
    let mut times: Vec<f64> = rows.map(|row| when_of(fleet, row).unix_s).collect();
    times.sort_by(f64::total_cmp);
    let ([first, .., last] | [first @ last]) = times[..] else { return Ok(()) };
    if times.iter().any(|time| question.spans(*time)) {
        return Ok(());
    }
    let bounds = [
        since.map(|at| format!("from {} on (--since)", day_and_time(at))),
        until.map(|at| format!("up to {} (--until)", day_and_time(at))),
    ];
    let bounds: Vec<String> = bounds.into_iter().flatten().collect();
    let [first, last] = [first, last].map(day_and_time);
    Err(FleetError::Asked(format!(
        "no flight is {}; the flights are from {first} to {last}",
        bounds.join(" and ")
    )))
}

/// A craft's flights that are asked for, and those that are copies of others.
pub(crate) fn flights<'a>(
    fleet: &Fleet,
    index: &'a Index,
    question: &Question,
    craft: &str,
) -> (Vec<FlightOf<'a>>, Vec<Unused>) {
    let mut first: BTreeMap<(&str, usize), &str> = BTreeMap::new();
    let (mut all, mut copies) = (Vec::new(), Vec::new());
    for row in index.rows.iter().filter(|row| row.craft == craft && !fleet.settings.excludes(&row.file)) {
        if let (Some(own), State::Used) = (first.get(&(row.sha256.as_str(), row.part)), row.state) {
            copies.push(Unused { file: row.label(), why: format!("is a copy of {own}") });
            continue;
        }
        first.insert((&row.sha256, row.part), &row.file);
        let when = when_of(fleet, row);
        let is_left_out = question.leave_out.iter().any(|own| *own == row.file || *own == row.label());
        if question.spans(when.unix_s) && !is_left_out {
            all.push(FlightOf { row, when, battery: fleet.settings.battery(&row.file) });
        }
    }
    (all, copies)
}

/// When a flight was flown.
pub(crate) fn when_of(fleet: &Fleet, row: &Row) -> When {
    let logged = row.logged_unix_s.map(|unix_s| When { unix_s, from: when::WhenFrom::Log });
    let by_file = || {
        let changed = std::time::Duration::from_nanos(u64::try_from(row.changed_ns).unwrap_or(0));
        when::of_file(std::time::UNIX_EPOCH + changed)
    };
    let said = fleet.settings.date(&row.file);
    said.or(logged).or_else(|| when::of_name(&row.file)).unwrap_or_else(by_file)
}
