//! A question to an index, and its answer. No log is read for it, but for the causes of changes that are not known yet.

use std::collections::BTreeMap;
use std::path::Path;

use diagnosis::workflow::{Observer, Progress};
use model::{Effect, PerAxis};
use rayon::prelude::*;
use sysid::Severity;

use crate::cause;
use crate::changes::Candidate;
use crate::compare::{BatteryComparison, CraftComparison, Current, Stratum, batteries, crafts};
use crate::document::{Answer, AxisAnswer, CoefficientAnswer, CraftAnswer, FaultAnswer, Unused};
use crate::error::FleetError;
use crate::events::{Event, Moment, events, explanations, motor_shares, odd_flights};
use crate::fit::{Asked, Estimate, Pooled, of_many};
use crate::history::{Flown, Kind, Series, Tests, voltages};
use crate::layout::{Craft, Fleet};
use crate::pass::{Indexed, save};
use crate::question::{FlightOf, Question, check, flights};
use crate::reference::Reference;
use crate::row::{Row, State};
use crate::scatter::mean;
use crate::unknown::Unknown;

/// A craft's flights and series, for tables and pages.
pub struct CraftHistory<'a> {
    /// Name of its folder.
    pub craft: String,
    /// Those that are fitted, in the order in which they were flown.
    pub flights: Vec<FlightOf<'a>>,
    /// The series over them.
    pub series: Vec<Series>,
}

/// An answer, and the histories behind it.
pub struct Answered<'a> {
    /// The document.
    pub answer: Answer,
    /// Each craft's.
    pub histories: Vec<CraftHistory<'a>>,
}

/// Looks up in the logs the causes of changes that are not known yet, puts them into the answer and keeps them. With nothing to look up,
/// nothing is read.
pub fn look_up_causes(
    answered: &mut Answered<'_>,
    fleet: &Fleet,
    indexed: &Indexed,
    path: &Path,
    observer: &dyn Observer,
) -> Result<(), FleetError> {
    let unknown = |craft: &CraftAnswer| craft.changes.iter().filter(|event| event.in_logs.is_none()).count();
    let wanted: usize = answered.answer.crafts.iter().map(unknown).sum();
    let mut found = BTreeMap::new();
    for (own, history) in answered.answer.crafts.iter_mut().zip(&answered.histories) {
        let rows: Vec<&Row> = history.flights.iter().map(|flight| flight.row).collect();
        let bounds = bounds(own.changes.iter().map(|event| event.at), rows.len());
        let Some(craft) = fleet.crafts.iter().find(|craft| craft.name == own.craft) else { continue };
        for (event, split) in own.changes.iter_mut().zip(bounds.windows(3)) {
            if event.in_logs.is_some() || observer.is_cancelled() {
                continue;
            }
            let activity = format!("{}: what changed with {}", own.craft, rows[split[1]].label());
            observer.progress(Progress { activity: &activity, steps: Some((found.len(), wanted)) });
            let sides = cause::flights(&rows, [split[0], split[1], split[2]]);
            let cause = cause::ask(fleet, craft, sides, observer);
            if !observer.is_cancelled() {
                found.insert(cause::key(sides), serde_json::to_value(&cause).unwrap_or_default());
                event.put_logs(Some(cause));
            }
        }
    }
    if !found.is_empty() {
        save(&indexed.index, &indexed.references, &found, path)?;
    }
    if observer.is_cancelled() { Err(FleetError::Cancelled) } else { Ok(()) }
}

/// The first flight, those before which something changed, and the one after the last.
fn bounds(changes: impl Iterator<Item = usize>, flights: usize) -> Vec<usize> {
    std::iter::once(0).chain(changes).chain([flights]).collect()
}

/// Answers a question from what is kept.
pub fn ask<'a>(fleet: &Fleet, indexed: &'a Indexed, question: &Question) -> Result<Answered<'a>, FleetError> {
    check(fleet, indexed, question)?;
    let is_asked = |name: &str| question.crafts.is_empty() || question.crafts.iter().any(|own| own == name);
    let crafts: Vec<_> = fleet.crafts.iter().filter(|craft| is_asked(&craft.name)).collect();
    let prepared: Vec<Prepared<'a>> =
        crafts.par_iter().map(|craft| Prepared::new(fleet, indexed, question, &craft.name)).collect();
    let tests = Tests::of(prepared.iter().flat_map(|own| &own.series));
    let answer = |(craft, own): (&&Craft, Prepared<'a>)| {
        let answer = own.answer(indexed, &craft.vehicle.name, tests);
        (answer, CraftHistory { craft: craft.name.clone(), flights: own.flights, series: own.series })
    };
    let (answers, histories): (Vec<CraftAnswer>, Vec<CraftHistory<'_>>) =
        crafts.par_iter().zip(prepared).map(answer).unzip();
    let vehicles: Vec<&[u8]> = crafts.iter().map(|craft| &craft.vehicle_bytes[..]).collect();
    let answer = Answer {
        read_now: indexed.read,
        gone: indexed.gone.clone(),
        unclaimed: fleet.unclaimed.clone(),
        unmatched: fleet.unmatched(indexed.index.rows.iter().map(|row| row.file.clone())),
        craft_against_craft: against_each_other(&answers, &histories, &vehicles),
        battery_against_battery: of_batteries(&answers, &histories),
        crafts: answers,
    };
    Ok(Answered { answer, histories })
}

/// A craft's flights, fitted.
struct Prepared<'a> {
    craft: String,
    all: Vec<FlightOf<'a>>,
    flights: Vec<FlightOf<'a>>,
    series: Vec<Series>,
    asked: Option<Asked>,
    candidates: Vec<Candidate>,
    fit: Option<Pooled>,
    reference_fit: Option<Pooled>,
    unknown: Unknown,
    copies: Vec<Unused>,
}

/// A craft's flights that are fitted, in the order in which they were flown, and the places before which it changed, with the first and
/// last flight that may as well be the first after the change.
pub(crate) struct History<'a> {
    pub(crate) rows: Vec<&'a Row>,
    pub(crate) events: Vec<(usize, [usize; 2])>,
}

/// The histories of all craft, by the usual question.
pub(crate) fn histories<'a>(fleet: &Fleet, indexed: &'a Indexed) -> Vec<History<'a>> {
    let prepare = |craft: &Craft| Prepared::new(fleet, indexed, &Question::default(), &craft.name);
    let prepared: Vec<Prepared<'a>> = fleet.crafts.par_iter().map(prepare).collect();
    let tests = Tests::of(prepared.iter().flat_map(|own| &own.series));
    let history = |own: Prepared<'a>| History {
        rows: own.flights.iter().map(|flight| flight.row).collect(),
        events: events(&own.series, tests).into_iter().map(|(at, likely, _)| (at, likely)).collect(),
    };
    prepared.into_par_iter().map(history).collect()
}

impl<'a> Prepared<'a> {
    fn new(fleet: &Fleet, indexed: &'a Indexed, question: &Question, craft: &str) -> Self {
        let (mut all, copies) = flights(fleet, &indexed.index, question, craft);
        all.sort_by(|a, b| a.when.unix_s.total_cmp(&b.when.unix_s).then(a.row.place().cmp(&b.row.place())));
        let (used, all): (Vec<_>, Vec<_>) = all
            .into_iter()
            .partition(|flight| flight.row.state == State::Used && flight.row.equations.rows > 0);
        let mut own = Self {
            craft: craft.into(),
            all,
            flights: used,
            series: Vec::new(),
            asked: None,
            candidates: Vec::new(),
            fit: None,
            reference_fit: None,
            unknown: Unknown::default(),
            copies,
        };
        own.fit(indexed, question);
        own
    }

    fn fit(&mut self, indexed: &'a Indexed, question: &Question) {
        let Some(reference) = indexed.references.get(&self.craft) else { return };
        if self.flights.is_empty() {
            return;
        }
        let of_reference = reference.model.effects();
        let mut effects = match &question.effects {
            Some(more) => {
                Effect::basic().filter(|e| of_reference.contains(e)).chain(more.iter().copied()).collect()
            }
            None => of_reference,
        };
        effects.retain(|effect: &Effect| !question.without.contains(effect));
        let columns = &reference.columns;
        // What flights determine beside other effects, only the signs tell.
        if question.effects.is_none() {
            self.unknown = Unknown::of_reference(&reference.model);
        }
        self.fit_known(reference, &effects, question);
        if self.unknown.add_signs(&reference.model, columns, &self.series) {
            self.fit_known(reference, &effects, question);
        }
    }

    /// Fits what is not unknown of some effects.
    fn fit_known(&mut self, reference: &Reference, effects: &[Effect], question: &Question) {
        let columns = &reference.columns;
        let known = |effects: &[Effect]| {
            let mut parameters = columns.of(effects);
            parameters.retain(|k| !self.unknown.drops(&columns.parameters[*k]));
            Asked::new(columns, parameters)
        };
        let asked = known(effects);
        self.candidates = Candidate::all(&reference.model, columns);
        self.candidates.retain(|candidate| !effects.contains(&candidate.change.effect));
        let rows: Vec<&Row> = self.flights.iter().map(|flight| flight.row).collect();
        let flown = Flown { rows: &rows, model: &reference.model, columns, asked: &asked };
        let fit = of_many(&flown.equations(), &asked);
        if !question.is_usual() {
            let usual = known(&reference.model.effects());
            self.reference_fit = Some(of_many(&flown.equations(), &usual));
        }
        self.series = flown.series(&fit, &self.candidates);
        (self.fit, self.asked) = (Some(fit), Some(asked));
    }

    fn moment(&self, at: usize) -> Moment {
        Moment::new(self.flights[at].row.label(), self.flights[at].when)
    }

    fn answer(&self, indexed: &Indexed, vehicle: &str, tests: Tests) -> CraftAnswer {
        let kept = indexed.index.references.get(&self.craft);
        let changes = self.changes(indexed, tests);
        let bounds = bounds(changes.iter().map(|event| event.at), self.flights.len());
        let since = bounds[bounds.len() - 2];
        let last = self.flights.len().checked_sub(1);
        let effects =
            indexed.references.get(&self.craft).zip(self.asked.as_ref()).map(|(reference, asked)| {
                let mut effects: Vec<Effect> =
                    asked.parameters.iter().map(|k| reference.columns.parameters[*k].effect).collect();
                effects.dedup();
                effects
            });
        CraftAnswer {
            craft: self.craft.clone(),
            vehicle: vehicle.into(),
            flights: self.flights.len(),
            airborne_s: self.flights.iter().map(|flight| flight.row.airborne_s).sum(),
            span: last.map(|last| [self.moment(0), self.moment(last)]),
            no_model: kept.filter(|kept| kept.model.is_empty()).map(|kept| kept.why.clone()),
            effects: effects.unwrap_or_default(),
            not_identified: self.unknown.reasons.clone(),
            coefficients: self.coefficients(indexed, since),
            axes: self.axes(),
            odd_flights: odd_flights(&self.series, &bounds, tests, &|at| self.moment(at)),
            changes,
            faults: self.faults(),
            unused: self.unused(),
        }
    }

    fn changes(&self, indexed: &Indexed, tests: Tests) -> Vec<Event> {
        let (Some(reference), Some(asked)) = (indexed.references.get(&self.craft), &self.asked) else {
            return Vec::new();
        };
        let rows: Vec<&Row> = self.flights.iter().map(|flight| flight.row).collect();
        let flown = Flown { rows: &rows, model: &reference.model, columns: &reference.columns, asked };
        let found = events(&self.series, tests);
        let bounds = bounds(found.iter().map(|(at, ..)| *at), rows.len());
        let event = |((at, likely, moved), split): ((usize, [usize; 2], _), &[usize])| {
            let split = [split[0], split[1], split[2]];
            let key = cause::key(cause::flights(&rows, split));
            let kept = indexed.index.causes.get(&key);
            let mut event = Event {
                from: self.moment(at),
                last_before: self.moment(at - 1),
                likely: likely.map(|place| rows[place].label()),
                flights: [split[1] - split[0], split[2] - split[1]],
                moved,
                explanations: explanations(&flown, &self.candidates, split),
                in_logs: None,
                causes_disagree: false,
                motor_shares: motor_shares(&flown, split),
                at,
            };
            event.put_logs(kept.and_then(|kept| serde_json::from_value(kept.clone()).ok()));
            event
        };
        found.into_iter().zip(bounds.windows(3)).map(event).collect()
    }

    fn coefficients(&self, indexed: &Indexed, since: usize) -> Vec<CoefficientAnswer> {
        let (Some(reference), Some(asked), Some(fit)) =
            (indexed.references.get(&self.craft), &self.asked, &self.fit)
        else {
            return Vec::new();
        };
        // A fit to flights from both sides of a change is of neither.
        let since_then = (since > 0).then(|| {
            let equations = self.flights[since..].iter().map(|flight| &flight.row.equations);
            of_many(&equations.collect::<Vec<_>>(), asked)
        });
        let estimates = &since_then.as_ref().unwrap_or(fit).estimates;
        let series = self.series.iter().filter(|series| series.kind == Kind::Coefficient);
        let of = |((&parameter, estimate), series): ((&usize, &Option<Estimate>), &Series)| {
            let own = reference.columns.parameters[parameter];
            let first = series.at.partition_point(|at| *at < since);
            (!self.unknown.hides(&own)).then(|| CoefficientAnswer {
                effect: own.effect,
                name: own.effect.info().coefficients[own.coefficient].name.into(),
                unit: series.unit.clone(),
                value: estimate.map(|estimate| estimate.value),
                std_error: estimate.map(|estimate| estimate.std_error),
                now: mean(&series.values[first..]),
            })
        };
        asked.parameters.iter().zip(estimates).zip(series).filter_map(of).collect()
    }

    fn axes(&self) -> Option<PerAxis<AxisAnswer>> {
        let fit = self.fit.as_ref()?;
        let usual = self.reference_fit.as_ref().unwrap_or(fit);
        Some(PerAxis::from_fn(|axis| AxisAnswer {
            rms: fit.rms[axis.index()],
            held_out_rms: fit.held_out_rms[axis.index()],
            held_out_rms_of_reference: usual.held_out_rms[axis.index()],
        }))
    }

    fn faults(&self) -> Vec<FaultAnswer> {
        let mut looked_at: Vec<&FlightOf<'_>> = self.flights.iter().chain(&self.all).collect();
        looked_at.retain(|flight| flight.row.state != State::NotReadable);
        looked_at.sort_by(|a, b| a.when.unix_s.total_cmp(&b.when.unix_s));
        let mut all: BTreeMap<(&str, Severity), (Vec<&FlightOf<'_>>, &str)> = BTreeMap::new();
        for flight in &looked_at {
            for fault in &flight.row.faults {
                let own = all.entry((&fault.kind, fault.severity)).or_insert((Vec::new(), ""));
                if own.0.last().is_none_or(|last| last.row.place() != flight.row.place()) {
                    own.0.push(flight);
                }
                own.1 = &fault.sentence;
            }
        }
        let moment = |flight: &FlightOf<'_>| Moment::new(flight.row.label(), flight.when);
        let mut faults: Vec<FaultAnswer> = all
            .into_iter()
            .map(|((kind, severity), (flights, sentence))| FaultAnswer {
                kind: kind.into(),
                severity,
                flights: [flights.len(), looked_at.len()],
                span: [moment(flights[0]), moment(flights[flights.len() - 1])],
                sentence: sentence.into(),
            })
            .collect();
        faults.sort_by_key(|fault| std::cmp::Reverse(fault.flights[0]));
        faults
    }

    fn unused(&self) -> Vec<Unused> {
        let of = |flight: &FlightOf<'_>| {
            let why = match flight.row.state {
                State::NotReadable => format!("not readable: {}", flight.row.why),
                _ => flight.row.why.clone(),
            };
            Unused { file: flight.row.label(), why }
        };
        self.all.iter().map(of).chain(self.copies.iter().cloned()).collect()
    }
}

/// The series but for coefficients that are not listed, as they are not identified, and changes by themselves.
fn listed(answer: &CraftAnswer, series: &[Series]) -> Vec<Series> {
    let name = |own: &CoefficientAnswer| format!("{}.{}", own.effect.id(), own.name);
    let names: Vec<String> = answer.coefficients.iter().map(name).collect();
    let is_listed = |series: &&Series| match series.kind {
        Kind::Coefficient => names.contains(&series.name),
        Kind::Change => false,
        Kind::Plain => true,
    };
    series.iter().filter(is_listed).cloned().collect()
}

fn against_each_other(
    answers: &[CraftAnswer],
    histories: &[CraftHistory<'_>],
    vehicles: &[&[u8]],
) -> CraftComparison {
    let current = |((answer, history), vehicle): ((&'_ CraftAnswer, &'_ CraftHistory<'_>), &&[u8])| {
        let from = answer.changes.last().map_or(0, |event| event.at);
        (answer.craft.clone(), vehicle.to_vec(), listed(answer, &history.series), from)
    };
    let all: Vec<_> = answers.iter().zip(histories).zip(vehicles).map(current).collect();
    let borrowed: Vec<Current<'_>> = all
        .iter()
        .map(|(craft, vehicle, series, from)| Current { craft, vehicle, series, from: *from })
        .collect();
    crafts(&borrowed)
}

fn of_batteries(answers: &[CraftAnswer], histories: &[CraftHistory<'_>]) -> BatteryComparison {
    let of_craft: Vec<_> = answers
        .iter()
        .zip(histories)
        .map(|(answer, history)| {
            let rows: Vec<&Row> = history.flights.iter().map(|flight| flight.row).collect();
            let mut series = listed(answer, &history.series);
            series.extend(voltages(&rows));
            let batteries: Vec<_> = history.flights.iter().map(|flight| flight.battery.clone()).collect();
            (series, batteries, bounds(answer.changes.iter().map(|event| event.at), rows.len()))
        })
        .collect();
    let strata: Vec<Stratum<'_>> = of_craft
        .iter()
        .flat_map(|(series, batteries, bounds)| {
            bounds.windows(2).map(move |range| Stratum { series, range: [range[0], range[1]], batteries })
        })
        .collect();
    batteries(&strata)
}
