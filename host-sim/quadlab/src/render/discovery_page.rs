//! What was discovered: each form over the residual that it came from.

use diagnosis::workflow::FlightSets;
use diagnosis::{Discovery, Proposal};
use model::{Axis, Effect, Model, Quantity, user_effects};
use report::number::with_error;
use report::{Figure, Mark, Page, Section, Series, Style, bin_statistics};
use sysid::Prepared;

use crate::render::figures::{self, axis_name, residual_axis};
use crate::render::grid::{Grid, text};
use crate::render::pages::Add;
use crate::render::tables;
use crate::render::view::{View, clearest_axis};

/// Ranges of equal count that a quantity is cut into.
const BINS: usize = 24;
/// Quantities that a form is drawn over.
const MOST_QUANTITIES: usize = 3;

/// The page of a discovery with its conclusion.
pub(crate) fn discovery(conclusion: &str, sets: &FlightSets, discovery: &Discovery) -> Page {
    let page = Page::new("What is missing, as a formula", conclusion);
    sections(sets, discovery).into_iter().fold(page, Page::section)
}

/// Its proposals and what is left.
pub(crate) fn sections(sets: &FlightSets, discovery: &Discovery) -> Vec<Section> {
    let mut all: Vec<Section> = Vec::new();
    for (place, proposal) in discovery.proposals.iter().enumerate() {
        let section = about(proposal);
        // The model of a discovery has the first proposal.
        all.push(if place == 0 { drawn(section, proposal, &discovery.model, sets) } else { section });
    }
    let left = tables::unexplained(&discovery.left);
    if left.has_rows() {
        all.push(Section::new("What is left").grid(&left));
    }
    all
}

/// A proposal in words and numbers.
fn about(proposal: &Proposal) -> Section {
    let mut coefficients = Grid::new("Coefficients", [text("name"), text("value")]);
    for c in proposal.coefficients.iter().chain(&proposal.constants) {
        coefficients.push([c.name.clone(), with_error(c.value, c.std_error, &c.unit)]);
    }
    let section = Section::new(proposal.id.clone())
        .paragraph(proposal.sentence.clone())
        .preformatted(proposal.formula.replace("; ", "\n"))
        .grid(&coefficients);
    let physics = proposal.physics.map(|physics| format!("Consistent with: {physics}."));
    let rivals = match &proposal.rivals[..] {
        [] => "No form in other quantities explains these flights about as well.".to_owned(),
        rivals => format!("These flights cannot distinguish it from: {}.", rivals.join("; ")),
    };
    let paragraphs = physics.into_iter().chain([rivals, format!("To confirm: {}.", proposal.excite)]);
    paragraphs.fold(section, Section::paragraph)
}

/// The form over the residual of flights that it has not seen, and how the error falls in the course of one.
fn drawn(section: Section, proposal: &Proposal, with: &Model, sets: &FlightSets) -> Section {
    let Some(&effect) = with.effects().last() else { return section };
    let others: Vec<Effect> = with.effects().into_iter().filter(|other| *other != effect).collect();
    let without = match sysid::fit(&sets.train(), &with.vehicle, &others, Some(with)) {
        Ok(without) => without.model,
        Err(refused) => {
            return section.paragraph(format!("The model cannot be fitted without it: {refused}."));
        }
    };
    let flights = sets.validate();
    let (before, after) = (View::all(&flights, &without), View::all(&flights, with));
    let mut section = section;
    for quantity in proposal.quantities.iter().take(MOST_QUANTITIES) {
        let Some(axis) = clearest_axis(effect, &before, &after) else { continue };
        if let Some((along, values)) = values_of(quantity, &flights, with) {
            let figure = form_over_residual(axis, along, &values, [&before, &after]);
            section = section.figure(
                figure,
                "The held-out flights. The form predicts the residual that the model leaves without it; with it the mean is zero.",
            );
        }
    }
    match (before.first(), after.first()) {
        (Some(before), Some(after)) => {
            section.captioned(figures::error_over_time(before, after, effect.info().axes))
        }
        _ => section,
    }
}

/// The values of a quantity over all rows of all flights.
fn values_of(name: &str, flights: &[&Prepared], model: &Model) -> Option<(report::Axis, Vec<f64>)> {
    if name == user_effects::TIME_COLUMN {
        let of = |flight: &&Prepared| {
            let began_s = flight.stretches.first().and_then(|stretch| stretch.time_s.first()).copied();
            let times = flight.conditions(&model.vehicle, &model.adjustments()).time_s;
            times.into_iter().map(|time| time - began_s.unwrap_or(0.0)).collect::<Vec<f64>>()
        };
        return Some((
            report::Axis::new("time from the flight's first row", "s"),
            flights.iter().flat_map(of).collect(),
        ));
    }
    let quantity = Quantity::named(name)?;
    let values = flights.iter().flat_map(|flight| flight.quantity(model, quantity)).collect();
    Some((report::Axis::new(quantity.meaning, quantity.unit_for(model.rotor_quantity())), values))
}

/// The residual without a form, the form, and the residual with it, over a quantity.
fn form_over_residual(
    axis: Axis,
    along: report::Axis,
    values: &[f64],
    [without, with]: [&[View]; 2],
) -> Figure {
    let rows = |views: &[View]| -> Vec<f64> {
        views.iter().flat_map(|view| view.residual(axis).iter().copied()).collect()
    };
    let (before, after) = (rows(without), rows(with));
    let over = |residual: &mut dyn Iterator<Item = f64>| -> Vec<(f64, f64)> {
        values.iter().copied().zip(residual).collect()
    };
    let means = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        bin_statistics(points, BINS).iter().map(|bin| (bin.x, bin.mean)).collect()
    };
    let cloud = over(&mut before.iter().copied());
    let form = means(&over(&mut before.iter().zip(&after).map(|(before, after)| before - after)));
    let (mean_before, mean_after) = (means(&cloud), means(&over(&mut after.iter().copied())));
    Figure::new(format!("Residual of the {}", axis_name(axis)), along, residual_axis(axis))
        .mark(Mark::Horizontal { name: String::new(), y: 0.0, style: Style::Reference })
        .with(Series::points("samples without it", Style::Muted, cloud))
        .with(Series::points("mean without it", Style::Measured, mean_before))
        .with(Series::line("the form", Style::PredictedAfter, form))
        .with(Series::line("mean with it", Style::PredictedBefore, mean_after))
}
