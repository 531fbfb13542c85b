//! `quadlab diagnose --why`: the evidence for and against one effect or change, as text.

use diagnosis::evidence::{CoefficientEvidence, Criterion, FlightDrop};
use diagnosis::{ChangeEvidence, Why, WhyChanged};
use model::Effect;

use report::number::{fixed, p_value, percent, unit, value_and_error};

use crate::cli::colour;
use crate::render::grid;
use crate::render::tables::{self, Grid};

/// Everything that was found out about it.
pub(crate) fn text(why: &Why) -> String {
    let mut text = colour::lead(&tables::paragraph(&why.summary));
    push_grids(
        &mut text,
        &[
            criteria("What an effect must do to be supported", &why.criteria),
            flights("held-out flight", &why.flights),
            coefficients("Its coefficients, everything fitted again", &why.coefficients),
            sets(why),
            alike(why),
        ],
    );
    let own = match why.variance_inflation {
        inflation if inflation > 10.0 => format!(
            "The model's own terms look like it: they inflate the variance of its coefficients {} times. ",
            fixed(inflation, 0)
        ),
        _ => String::new(),
    };
    text.push('\n');
    text.push_str(&tables::paragraph(&format!("{own}To see it: {}.", why.to_see_it)));
    text
}

/// Everything that was found out about a change, motor by motor where it is a motor's: the answer first, then the changes that are
/// supported, then the others.
pub(crate) fn text_of_change(why: &WhyChanged) -> String {
    let mut text = colour::lead(&tables::paragraph(&why.diagnosis));
    text.push('\n');
    let (supported, others): (Vec<_>, Vec<_>) = why.changes.iter().partition(|change| is_supported(change));
    for change in supported.into_iter().chain(others) {
        text.push_str(&colour::lead(&tables::paragraph(&change.summary)));
        push_grids(
            &mut text,
            &[
                criteria("What a change must do to be supported", &change.criteria),
                flights("flight", &change.flights),
                coefficients("Its coefficients, on top of the model as it is", &change.coefficients),
            ],
        );
        text.push('\n');
        if let Some(balance) = &change.balance {
            text.push_str(&tables::paragraph(&balance.summary));
            text.push('\n');
        }
    }
    text.push_str(&tables::paragraph(&format!("To see it: {}.", why.to_see_it)));
    text
}

/// Whether the motion or the steady balance of the rotors supports it.
fn is_supported(change: &ChangeEvidence) -> bool {
    change.supported || change.balance.as_ref().is_some_and(|balance| balance.supported)
}

fn push_grids(text: &mut String, grids: &[Grid]) {
    for grid in grids.iter().filter(|grid| grid.has_rows()) {
        text.push_str(&format!("\n{}", grid.to_text()));
    }
}

fn criteria(caption: &str, criteria: &[Criterion]) -> Grid {
    let mut grid = Grid::new(
        caption,
        [grid::text("criterion"), grid::text("found"), grid::text("needed"), grid::verdict("met")],
    );
    for c in criteria {
        let shown = |value: f64| match c.unit {
            "%" => format!("{} %", percent(value)),
            "" => p_value(value),
            unit => format!("{} {unit}", fixed(value, 1)),
        };
        let sign = if c.at_most { "at most" } else { "at least" };
        grid.push([
            c.question.into(),
            shown(c.value),
            format!("{sign} {}", shown(c.threshold)),
            if c.met { "yes" } else { "no" }.into(),
        ]);
    }
    grid
}

fn flights(heading: &'static str, flights: &[FlightDrop]) -> Grid {
    let mut grid = tables::evidence_grid(
        "Fall of the squared error with it, percent",
        &[heading, "u", "v", "w", "p", "q", "r"],
    );
    for flight in flights {
        let drops = model::AXES.iter().map(|axis| percent(flight.axes[axis.name()].drop_percent));
        grid.push([flight.flight.clone()].into_iter().chain(drops));
    }
    grid
}

fn coefficients(caption: &str, coefficients: &[CoefficientEvidence]) -> Grid {
    let mut grid = tables::evidence_grid(caption, &["name", "value", "± (95 %)", "unit", "possible"]);
    for c in coefficients {
        let (low, high) = c.possible;
        let [value, half_width] = value_and_error(c.figures.value, Some(c.half_width_95));
        grid.push([
            c.figures.name.into(),
            value,
            half_width,
            unit(c.figures.unit).into(),
            format!("{low} to {high}"),
        ]);
    }
    grid
}

fn sets(why: &Why) -> Grid {
    let mut grid = tables::evidence_grid(
        "Best sets of effects, linearised (score: held-out log-likelihood less one for each coefficient)",
        &["set", "score"],
    );
    let all = why.best_sets.iter().chain(&why.best_sets_with_it);
    let mut shown: Vec<&[Effect]> = Vec::new();
    for set in all {
        if !shown.contains(&set.effects.as_slice()) {
            shown.push(&set.effects);
            grid.push([ids(&set.effects).join(" + "), fixed(set.score, 1)]);
        }
    }
    grid
}

fn ids(effects: &[Effect]) -> Vec<&'static str> {
    effects.iter().map(|effect| effect.id()).collect()
}

fn alike(why: &Why) -> Grid {
    let mut grid = tables::evidence_grid(
        "Effects that these flights can hardly tell from it",
        &["effect", "variance inflation", "to separate them"],
    );
    for other in &why.alike {
        grid.push([
            other.effect.to_string(),
            fixed(other.variance_inflation, 0),
            other.separate.unwrap_or("fly so that they vary independently").into(),
        ]);
    }
    grid
}
