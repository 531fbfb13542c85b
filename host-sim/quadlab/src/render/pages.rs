//! Pages: what a command found, with the figures that show it.

use diagnosis::Diagnosis;
use diagnosis::workflow::{Explanation, Faults, FlightSets, LoadedFlight};
use model::{AXES, Axis, Effect, Model};
use report::{Page, Section};
use sysid::Comparison;

use crate::render::figures::{self, Captioned, View};
use crate::render::tables::{self, Grid};

/// Most residual plots on a page.
const MOST_RESIDUALS: usize = 4;

trait Add {
    fn captioned(self, figure: Captioned) -> Self;
    fn grid(self, grid: &Grid) -> Self;
}

impl Add for Section {
    fn captioned(self, figure: Captioned) -> Self {
        self.figure(figure.panels, figure.caption)
    }

    /// A table, if it has rows.
    fn grid(self, grid: &Grid) -> Self {
        if grid.has_rows() { self.table(grid.to_table()) } else { self }
    }
}

/// The page with what was found in the flights before anything was fitted.
pub(crate) fn with_checks<'a>(
    page: Page,
    flights: impl IntoIterator<Item = &'a LoadedFlight>,
    faults: &Faults,
) -> Page {
    let mut section = Section::new("What was checked");
    let found = tables::faults(&faults.all());
    if !found.has_rows() {
        section = section
            .paragraph("Channels, axes and signs, motor order, clocks and vehicle file: nothing is wrong.");
    }
    page.section(section.grid(&found).grid(&tables::clocks(flights)))
}

/// A model against flights.
pub(crate) fn compare(model: &Model, flights: &[LoadedFlight], comparison: &Comparison) -> Page {
    let prepared: Vec<_> = flights.iter().map(|flight| &flight.prepared).collect();
    let views = View::all(&prepared, model);
    let effects: Vec<&str> = model.effects().iter().map(|e| e.id()).collect();
    let lead = format!(
        "How well the model of “{}” predicts {} flight{}.",
        model.vehicle.name,
        flights.len(),
        if flights.len() == 1 { "" } else { "s" },
    );
    let mut page = Page::new("Model against flights", lead)
        .section(
            Section::new("Error of each axis")
                .paragraph(format!("Effects in the model: {}.", effects.join(", ")))
                .grid(&tables::comparison(comparison)),
        )
        .section(where_it_fails(&views, comparison))
        .section(prediction(comparison, None));
    if let Some(view) = views.first() {
        let section = Section::new("Measured against predicted");
        page = page.section(section.captioned(figures::measured_against_predicted(view, None, &AXES)));
    }
    page
}

/// The conditions with more than their share of the error, each axis and quantity drawn once.
fn where_it_fails(views: &[View], comparison: &Comparison) -> Section {
    let worst = tables::worst(comparison);
    let mut section = Section::new("Where it fails");
    if !worst.has_rows() {
        return section.paragraph("No condition holds more than its share of the error.");
    }
    section = section.grid(&worst).paragraph(
        "In the figures, means that leave the zero line are something the model misses; where only the spread grows, it may \
         be noise.",
    );
    let mut drawn: Vec<(Axis, &str)> = Vec::new();
    for found in &comparison.worst {
        if drawn.len() == MOST_RESIDUALS || drawn.contains(&(found.axis, found.quantity)) {
            continue;
        }
        drawn.push((found.axis, found.quantity));
        if let Some(figure) = figures::residual_against(views, found.axis, found.quantity) {
            section = section.figure(figure, "");
        }
    }
    section
}

fn prediction(first: &Comparison, after: Option<&Comparison>) -> Section {
    let figure = figures::prediction_error(&first.by_horizon, after.map(|c| c.by_horizon.as_slice()));
    let section = Section::new("Prediction without looking").captioned(figure);
    match after {
        None => section.grid(&tables::horizons(first)),
        Some(after) => section.grid(&tables::horizons_before_after(first, after)),
    }
}

/// A diagnosis, with the residual of the best effect before and after.
pub(crate) fn diagnose(model: &Model, sets: &FlightSets, diagnosis: &Diagnosis) -> Page {
    let before = View::all(&sets.validate(), model);
    let mut page = Page::new("What does the model lack?", diagnosis.summary.clone());
    if let Some(effect) = diagnosis.best()
        && let Ok(addition) = diagnosis::add(model, effect, &sets.train(), &sets.validate())
    {
        let after = View::all(&sets.validate(), &addition.fit.model);
        page = page.section(difference(effect, &before, &after));
    }
    page = page.section(
        Section::new("Evidence")
            .grid(&tables::evidence(diagnosis))
            .grid(&tables::candidates(diagnosis, false)),
    );
    page = page.section(left(&before, diagnosis));
    page.section(meanings(&all_effects(diagnosis)))
}

/// What an effect does to the residual it was found in.
fn difference(effect: Effect, before: &[View], after: &[View]) -> Section {
    let axes = effect.info().axes;
    let mut section = Section::new(format!("With and without {effect}")).paragraph(effect.info().sentence);
    if let Some((axis, condition)) = figures::strongest_dependence(before, axes) {
        section = section.captioned(figures::residual_before_after(before, after, axis, condition));
    }
    match (before.first(), after.first()) {
        (Some(b), Some(a)) => section.captioned(figures::measured_against_predicted(b, Some(a), axes)),
        _ => section,
    }
}

/// Structure that no effect accounts for, in a table and drawn.
fn left(views: &[View], diagnosis: &Diagnosis) -> Section {
    let section = Section::new("What is left");
    if diagnosis.unexplained.is_empty() {
        return section.paragraph("What is left depends on none of the measured quantities.");
    }
    let section = section.grid(&tables::unexplained(&diagnosis.unexplained));
    let figures = diagnosis
        .unexplained
        .iter()
        .take(MOST_RESIDUALS)
        .filter_map(|u| figures::residual_against(views, u.axis, &u.depends_on));
    figures.fold(section, |section, figure| section.figure(figure, "Residual of the model as given."))
}

fn all_effects(diagnosis: &Diagnosis) -> Vec<Effect> {
    diagnosis.effects.iter().filter_map(|f| Effect::from_id(f.effect)).collect()
}

fn meanings(effects: &[Effect]) -> Section {
    let lines = effects.iter().map(|effect| {
        let info = effect.info();
        format!("{}: {} To see it: {}.", info.id, info.sentence, info.excitation)
    });
    Section::new("What the effects mean").list(lines)
}

/// The whole loop. `lead` says what was found and, where it is known, what was hidden.
pub(crate) fn explanation(lead: &str, sets: &FlightSets, explanation: &Explanation) -> Page {
    let validate = sets.validate();
    let before = View::all(&validate, &explanation.basic);
    let after = View::all(&validate, explanation.last_model());
    let mut page = Page::new("From flights to a better model", lead).section(
        Section::new("The error falls")
            .paragraph(format!(
                "The model was fitted to {} and judged on {}, which no fit has seen.",
                listed(sets.training.loaded()),
                listed(sets.held_out.loaded())
            ))
            .grid(&tables::falling_error(explanation))
            .grid(&tables::history(&explanation.last_model().history)),
    );
    for step in &explanation.steps {
        page = page.section(
            Section::new(format!("Found: {}", step.effect))
                .paragraph(step.diagnosis.summary.clone())
                .grid(&tables::evidence(&step.diagnosis)),
        );
    }
    for effect in explanation.found() {
        page = page.section(difference(effect, &before, &after));
    }
    page.section(prediction(&explanation.basic_comparison, Some(explanation.last_comparison())))
        .section(
            left(&after, &explanation.last_diagnosis)
                .paragraph(explanation.last_diagnosis.summary.clone())
                .grid(&tables::evidence(&explanation.last_diagnosis)),
        )
        .section(Section::new("The model").grid(&tables::coefficients(explanation.last_model())))
        .section(flights(sets, explanation.last_model()))
        .section(meanings(&Effect::candidates().collect::<Vec<_>>()))
}

/// What single flights have of their own: clocks, biases, trim, and motors that follow how they were flown.
fn flights(sets: &FlightSets, model: &Model) -> Section {
    let motors = sysid::motors_of_flights(model, &sets.train());
    let section =
        Section::new("The flights").grid(&tables::flights(sets)).grid(&tables::trim(sets.training.loaded()));
    let warned = motors.iter().filter_map(|m| m.warning.clone()).fold(section, Section::paragraph);
    warned.grid(&tables::motors(&motors))
}

fn listed(flights: &[LoadedFlight]) -> String {
    flights.iter().map(|f| f.prepared.name.as_str()).collect::<Vec<_>>().join(", ")
}
