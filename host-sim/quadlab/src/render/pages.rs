//! Pages: what a command found, with the figures that show it.

use diagnosis::workflow::{Explanation, Faults, FlightSets, FlightsOfOneKind, LoadedFlight};
use diagnosis::{Change, Diagnosis, EffectFinding};
use model::{AXES, Axis, Effect, Model, Term};
use report::{Page, Section};
use sysid::{Comparison, Prepared};

use crate::render::figures::{self, Captioned};
use crate::render::stand_ins;
use crate::render::tables::{self, Grid};
use crate::render::view::{self, View};

/// Most residual plots on a page.
const MOST_RESIDUALS: usize = 4;

pub(crate) trait Add {
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
        section = section.paragraph(
            "No fault was found in channels, axes and signs, motor order, clocks and vehicle file.",
        );
    }
    let section = faults
        .withdrawn()
        .iter()
        .fold(section.grid(&found), |section, sentence| section.paragraph(format!("{sentence}.")));
    page.section(section.grid(&tables::clocks(flights)))
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

/// Several models against the same flights.
pub(crate) fn compare_models(
    models: &[(&Model, &FlightsOfOneKind)],
    comparisons: &[(String, &Comparison)],
) -> Page {
    let names: Vec<&str> = comparisons.iter().map(|(name, _)| name.as_str()).collect();
    let lead = format!("How well {} predict the same flights.", names.join(", "));
    let mut page = Page::new("Models side by side", lead)
        .section(Section::new("Error of each axis").grid(&tables::side_by_side(comparisons)))
        .section(Section::new("Open-loop prediction").grid(&tables::horizons_side_by_side(comparisons)));
    let views: Vec<Option<View>> = models
        .iter()
        .map(|(model, flights)| View::all(&flights.prepared(), model).into_iter().next())
        .collect();
    if let Some(Some(first)) = views.first() {
        for ((name, _), view) in comparisons.iter().zip(&views).skip(1) {
            let section = Section::new(format!("{} (before) and {name} (after)", names[0]));
            let figure = figures::measured_against_predicted(first, view.as_ref(), &AXES);
            page = page.section(section.captioned(figure));
        }
    }
    page
}

/// The conditions with more than their share of the error, each axis and quantity drawn once.
fn where_it_fails(views: &[View], comparison: &Comparison) -> Section {
    let worst = tables::worst(comparison);
    let mut section = Section::new("Where it fails");
    if !worst.has_rows() {
        return section.paragraph("No condition has more than its share of the error.");
    }
    section = section.grid(&worst).paragraph(
        "In the figures, a mean that leaves the zero line shows something that the model misses; where only the spread \
         grows, it may be noise.",
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
    let section = Section::new("Prediction").captioned(figure);
    match after {
        None => section.grid(&tables::horizons(first)),
        Some(after) => {
            let models = [("before".to_owned(), first), ("after".to_owned(), after)];
            section.grid(&tables::horizons_side_by_side(&models))
        }
    }
}

/// A diagnosis, with the residual of the best effect before and after.
pub(crate) fn diagnose(model: &Model, sets: &FlightSets, diagnosis: &Diagnosis) -> Page {
    let before = View::all(&sets.validate(), model);
    let mut page = Page::new("What does the model lack?", diagnosis.summary.clone());
    if let Some(effect) = diagnosis.best()
        && let Ok(addition) =
            diagnosis::add(model, effect, &sets.train(), &sets.validate(), &diagnosis::Options::default())
    {
        page = page.section(difference(effect, &addition.fit.model, sets));
    }
    page = page.section(
        Section::new("Evidence")
            .grid(&tables::evidence(diagnosis))
            .grid(&tables::candidates(diagnosis, false)),
    );
    page = page.section(left(&before, diagnosis));
    page.section(meanings(&all_effects(diagnosis)))
}

/// What an effect of a model does to the residual: the model against one with everything but it, fitted to the same flights.
fn difference(effect: Effect, with: &Model, sets: &FlightSets) -> Section {
    let section = Section::new(format!("With and without {effect}")).paragraph(effect.info().sentence);
    let others: Vec<Effect> = with.effects().into_iter().filter(|other| *other != effect).collect();
    match sysid::fit(&sets.train(), &with.vehicle, &others, Some(with)) {
        Ok(without) => {
            let section = section.paragraph(
                "Both models are fitted to the same flights with everything else, and differ by this effect alone; the \
                 figures show flights that neither has seen.",
            );
            shown(section, effect, &sets.validate(), &without.model, with)
        }
        Err(refused) => section.paragraph(format!("The model cannot be fitted without it: {refused}.")),
    }
}

/// Figures of what an effect does, by a model without and one with it.
fn shown(section: Section, effect: Effect, flights: &[&Prepared], without: &Model, with: &Model) -> Section {
    let (before, after) = (View::all(flights, without), View::all(flights, with));
    let mut section = section;
    if let Some(figure) = figures::residual_with_and_without(effect, flights, with, [&before, &after]) {
        section = section.captioned(figure);
    }
    let axes = effect.info().axes;
    match (before.first(), after.first()) {
        (Some(b), Some(a)) => section
            .captioned(figures::error_over_time(b, a, axes))
            .captioned(figures::measured_against_predicted(b, Some(a), axes)),
        _ => section,
    }
}

/// What has changed since a model was good.
pub(crate) fn changed(model: &Model, flights: &[LoadedFlight], diagnosis: &Diagnosis) -> Page {
    let flights: Vec<&Prepared> = flights.iter().map(|flight| &flight.prepared).collect();
    let mut page = Page::new("What has changed?", diagnosis.summary.clone());
    let named: Vec<&EffectFinding> = diagnosis.effects.iter().filter(|finding| finding.supported).collect();
    if let Some(with) = &diagnosis.with_changes {
        let changes: Vec<Effect> = named.iter().map(|finding| finding.effect).collect();
        page = page.section(sizes(diagnosis, &named, &estimated_anew((model, with), &changes)));
        for finding in &named {
            page = page.section(of_change(model, with, finding, (&flights, named.len() > 1)));
        }
        let (before, after) = (View::all(&flights, model), View::all(&flights, with));
        let axes: Vec<Axis> =
            AXES.into_iter().filter(|axis| named.iter().any(|f| acts_on(f, *axis))).collect();
        page = page.section(since(&axes, (&before, &after), named.len() == 1));
        page = named.iter().fold(page, |page, finding| page.section(rivals(finding)));
    }
    let evidence = Section::new("Evidence")
        .grid(&tables::evidence(diagnosis))
        .grid(&tables::not_identified(&diagnosis.not_identified));
    page.section(evidence).section(meanings(&all_effects(diagnosis)))
}

fn acts_on(finding: &EffectFinding, axis: Axis) -> bool {
    finding.effect.info().axes.contains(&axis)
}

fn sizes(diagnosis: &Diagnosis, named: &[&EffectFinding], estimated_anew: &[Effect]) -> Section {
    let names: Vec<String> = named.iter().map(|finding| tables::named(finding)).collect();
    let title = if names.len() == 1 { "The change" } else { "The changes" };
    Section::new(format!("{title}: {}", names.join(" and ")))
        .grid(&tables::change(diagnosis))
        .paragraph(others_stay(estimated_anew))
}

/// Effects of the model that have other coefficients in the model with the changes and are none of them.
fn estimated_anew((model, with): (&Model, &Model), changes: &[Effect]) -> Vec<Effect> {
    let values = |of: &Model, effect: Effect| of.term(effect).map(Term::values);
    let differs =
        |effect: &Effect| !changes.contains(effect) && values(model, *effect) != values(with, *effect);
    with.effects().into_iter().filter(differs).collect()
}

fn others_stay(estimated_anew: &[Effect]) -> String {
    let stay = "All other coefficients of the model stay as they were fitted.";
    let names: Vec<&str> = estimated_anew.iter().map(|effect| effect.info().id).collect();
    match names.as_slice() {
        [] => stay.into(),
        names => format!("Coefficients of {} were estimated at the same time. {stay}", names.join(" and ")),
    }
}

/// What a change does, in figures: the model with all changes that were found against the same model without this one.
fn of_change(
    model: &Model,
    with: &Model,
    finding: &EffectFinding,
    (flights, is_one_of_several): (&[&Prepared], bool),
) -> Section {
    let change = Change { effect: finding.effect, motor: finding.motor };
    let without = match is_one_of_several {
        true => {
            "\"with it\" is the model with all changes that were found, and \"without it\" is the same model without this one."
        }
        false => {
            "\"with it\" is the model with the change, and \"without it\" is the model as it was fitted."
        }
    };
    let section = Section::new(format!("With and without {}", tables::named(finding)))
        .paragraph(finding.sentence())
        .paragraph(format!("In the figures, {without}"));
    shown(section, finding.effect, flights, &change.undone(with, model), with)
}

/// In which of the flights the change shows.
fn since(axes: &[Axis], (before, after): (&[View], &[View]), is_alone: bool) -> Section {
    let grid = tables::flight_by_flight(axes, before, after);
    let better = |(b, a): (&View, &View)| {
        let error = |view: &View| {
            let of = |axis: &Axis| {
                view::squared_error(std::slice::from_ref(view), *axis) / view::squared_error(before, *axis)
            };
            axes.iter().map(of).sum::<f64>()
        };
        error(a) < error(b)
    };
    let shows: Vec<bool> = before.iter().zip(after).map(better).collect();
    let with = if is_alone { "With it" } else { "With all of them" };
    let sentence = match shows.iter().position(|shows| *shows) {
        Some(0) if shows.iter().all(|shows| *shows) => {
            let from_the_first = match is_alone {
                true => format!(": the change was there from the first of them ({}) on", before[0].name),
                false => String::new(),
            };
            format!("{with}, the error falls in each of these flights{from_the_first}.")
        }
        Some(first) => {
            let names =
                before.iter().zip(&shows).filter(|(_, shows)| !**shows).map(|(view, _)| view.name.as_str());
            format!(
                "{with}, the error first falls in {}. It does not fall in {}.",
                before[first].name,
                names.collect::<Vec<_>>().join(", ")
            )
        }
        None => format!("{with}, the error of no single flight falls."),
    };
    Section::new("Flight by flight").paragraph(sentence).grid(&grid)
}

/// What these flights cannot tell a change from.
fn rivals(finding: &EffectFinding) -> Section {
    let section = Section::new(format!("What else {} could be", tables::named(finding)));
    if finding.confounded_with.is_empty() {
        return section.paragraph("These flights distinguish it from every other change that was tried.");
    }
    let separated = |rival: &Effect| match diagnosis::separating_manoeuvre(finding.effect, *rival) {
        Some(how) => format!("{rival}. To separate them, {how}."),
        None => rival.to_string(),
    };
    section
        .paragraph("These flights cannot distinguish it from:")
        .list(finding.confounded_with.iter().map(separated))
}

/// Structure that no effect accounts for, in a table and drawn, after what the flights do not determine.
fn left(views: &[View], diagnosis: &Diagnosis) -> Section {
    let section = Section::new("What is left").grid(&tables::not_identified(&diagnosis.not_identified));
    if diagnosis.unexplained.is_empty() {
        return match diagnosis.not_identified.is_empty() {
            true => section.paragraph("What is left depends on none of the measured quantities."),
            false => section,
        };
    }
    let section = section
        .grid(&tables::unexplained(&diagnosis.unexplained))
        .grid(&stand_ins::table(&diagnosis.stand_ins()));
    let figures = diagnosis
        .unexplained
        .iter()
        .take(MOST_RESIDUALS)
        .filter_map(|u| figures::residual_against(views, u.axis, u.depends_on.quantity()?));
    figures.fold(section, |section, figure| section.figure(figure, "Residual of the given model."))
}

fn all_effects(diagnosis: &Diagnosis) -> Vec<Effect> {
    diagnosis.effects.iter().map(|f| f.effect).collect()
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
    let after = View::all(&sets.validate(), explanation.last_model());
    let mut page = Page::new("From flights to a better model", lead).section(
        Section::new("The error falls")
            .paragraph(format!(
                "The model was fitted to {} and tested on {}, which no fit has used.",
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
        page = page.section(difference(effect, explanation.last_model(), sets));
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
    warned.grid(&tables::motors(model, &motors))
}

fn listed(flights: &[LoadedFlight]) -> String {
    flights.iter().map(|f| f.prepared.name.as_str()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wind that brought the drag in it to light.
    #[test]
    fn what_was_estimated_together_with_a_change_has_not_stayed() {
        let (model, mut with) = (Model::thesis(), Model::thesis());
        with.set(Effect::SteadyWind, &[4.0, 0.0]);
        let drag: Vec<f64> = model.term(Effect::LinearDrag).unwrap().values();
        with.set(Effect::LinearDrag, &drag.iter().map(|c| 1.2 * c).collect::<Vec<_>>());
        with.set(Effect::QuadraticDrag, &[-0.1, 0.0]);
        let anew = estimated_anew((&model, &with), &[Effect::SteadyWind]);
        assert_eq!(anew, [Effect::LinearDrag, Effect::QuadraticDrag]);
        let said = "Coefficients of linear-drag and quadratic-drag were estimated at the same time. All other coefficients";
        assert!(others_stay(&anew).starts_with(said), "{}", others_stay(&anew));
        assert!(others_stay(&[]).starts_with("All other coefficients"));
    }
}
