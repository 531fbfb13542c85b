//! A page for each effect of the catalogue, from its definition, with a picture from a simulated flight.

use std::fmt::Write as _;
use std::path::Path;

use diagnosis::workflow::LoadedFlight;
use model::{Coefficient, Effect, EffectInfo, Kind, Model, Quantity, Question};
use rayon::prelude::*;

use crate::cli::demo_effect;
use crate::render::figures;
use crate::render::view::View;

/// Length of the flight behind a picture, s.
const FLIGHT_S: f64 = 40.0;
/// Seed of its tour and of its noise.
const SEED: u64 = 1;
/// Shares of an effect's typical size to try one after the other until the craft stays in the air.
const SIZES: [f64; 3] = [1.0, 0.5, 0.25];
/// Size of a picture, px.
const PICTURE_PX: (u32, u32) = (900, 420);

/// Writes the pages, their pictures and a table of contents.
pub(crate) fn write(folder: &Path) -> anyhow::Result<()> {
    let catalogue: Vec<Effect> = Effect::all().collect();
    let pages: Vec<String> =
        catalogue.par_iter().map(|&effect| write_page(effect, folder)).collect::<anyhow::Result<_>>()?;
    report::write_atomic(folder.join("SUMMARY.md"), pages.concat())?;
    Ok(())
}

/// Writes the page of an effect; its line in the table of contents.
fn write_page(effect: Effect, folder: &Path) -> anyhow::Result<String> {
    let info = effect.info();
    let shown = picture(effect)?;
    if let Some(shown) = &shown {
        report::write_atomic(folder.join(format!("{}.svg", info.id)), &shown.svg)?;
    }
    report::write_atomic(folder.join(format!("{}.md", info.id)), page(info, shown.as_ref()))?;
    Ok(format!("- [{}](effects/{}.md)\n", title(info.id), info.id))
}

/// `ground-effect` is "Ground effect".
fn title(id: &str) -> String {
    capitalised(&id.replace('-', " "))
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn page(info: &EffectInfo, shown: Option<&Picture>) -> String {
    let mut text = format!("# {}\n\n`{}`: {}\n\n", title(info.id), info.id, info.sentence);
    let _ = writeln!(text, "{}\n\n## Equation\n\n```latex\n{}\n```\n", place(info), info.equation);
    if let Some(source) = info.source {
        let _ = writeln!(text, "Source: {source}.\n");
    }
    text += &acts_on(info);
    text += &coefficients(info.coefficients);
    let _ = writeln!(text, "## What to fly to see it\n\n{}\n", capitalised(&sentence(info.excitation)));
    text += &look_alikes(info);
    text += "## What it leaves in a model without it\n\n";
    match shown {
        Some(shown) => {
            let _ =
                writeln!(text, "![Residual without and with {0}]({0}.svg)\n\n{1}", info.id, shown.caption);
        }
        None => text += "There is no picture: the simulated craft cannot fly with this effect.\n",
    }
    text
}

/// Where the effect stands among the models, in a paragraph.
fn place(info: &EffectInfo) -> &'static str {
    match (info.kind, info.question) {
        (Kind::Basic, _) => "It belongs to the basic model, so every model has it.",
        (_, Question::Structure) => "It can be missing from a model.",
        (_, Question::Both) => "It can be missing from a model, or have appeared since the model was fitted.",
        (_, Question::Change) => {
            "It can only be seen as a change since the model was fitted (`quadlab diagnose --changed`). A fit of the whole \
             model absorbs it."
        }
    }
}

fn acts_on(info: &EffectInfo) -> String {
    let how = match info.kind {
        Kind::Basic | Kind::Linear => "It is linear in its coefficients.",
        Kind::Adjusting => "It changes what the other terms see, and is fitted by iteration.",
    };
    let mut text = format!("## What it acts on\n\n{how}\n\n| axis | through | unit |\n|---|---|---|\n");
    for axis in info.axes {
        let through = info.acts_through(*axis).and_then(Quantity::named);
        let (meaning, unit) = through.map_or(("", ""), |quantity| (quantity.meaning, quantity.unit));
        let _ = writeln!(text, "| {} | {meaning} | {unit} |", figures::axis_name(*axis));
    }
    text + "\n"
}

fn coefficients(coefficients: &[Coefficient]) -> String {
    let mut text = String::from(
        "## Coefficients\n\n| name | unit | possible | typical size | known beforehand (standard deviation) |\n|---|---|---|---|---|\n",
    );
    for c in coefficients {
        let known = c.prior.map_or_else(String::new, |deviation| format!("± {deviation}"));
        let (low, high) = c.possible;
        let unit = c
            .unit_in_commands
            .map_or_else(|| c.unit.into(), |other| format!("{}; in commands {other}", c.unit));
        let _ = writeln!(text, "| `{}` | {unit} | {low} to {high} | {} | {known} |", c.name, c.typical);
    }
    if coefficients.iter().any(|c| c.in_rotor_speed) {
        text += "\nRanges and sizes are for vehicles with a motor map; without one, rotor speeds are commands near 1.\n";
    }
    if coefficients.iter().any(|c| c.unit_in_commands.is_some()) {
        text += "\nIn commands: for vehicles without a motor map, where a command (cmd) stands in for a rotor speed.\n";
    }
    text + "\n"
}

fn look_alikes(info: &EffectInfo) -> String {
    let mut text = String::from("## What looks like it\n\n");
    if info.confused_with.is_empty() {
        text += "Nothing else in the catalogue is known to look like it.\n";
    }
    for (other, manoeuvre) in info.confused_with {
        let name = match Effect::from_id(other) {
            Some(_) => format!("[{other}]({other}.md)"),
            None => (*other).to_owned(),
        };
        let _ = writeln!(text, "- {name}. To tell them apart: {}", sentence(manoeuvre));
    }
    text + "\n"
}

/// With a full stop.
fn sentence(text: &str) -> String {
    format!("{}.", text.trim_end_matches('.'))
}

struct Picture {
    svg: String,
    caption: String,
}

/// The residual of a simulated flight by the craft's own model without the effect and with it; none when the craft does
/// not fly with it.
fn picture(effect: Effect) -> anyhow::Result<Option<Picture>> {
    let (craft, mut without) = (demo_effect::craft(), demo_effect::craft());
    without.terms.retain(|term| term.effect != effect);
    for size in SIZES {
        let mut with = craft.clone();
        if !craft.has(effect) {
            let values: Vec<f64> = demo_effect::typical(effect).iter().map(|value| size * value).collect();
            with.set(effect, &values);
        }
        let recording = sil::fly(&demo_effect::flight_plan(&with, SEED, FLIGHT_S))?;
        if !recording.complete || recording.cage_margin_m() < 0.0 {
            continue;
        }
        let flight =
            LoadedFlight::from_flight(&recording.to_flight(effect.id(), false), &with.vehicle)?.prepared;
        let [before, after] = [&without, &with].map(|model| View::all(&[&flight], model));
        let figure = figures::residual_with_and_without(effect, &[&flight], &with, [&before, &after]);
        return Ok(figure.map(|figure| Picture {
            svg: figure.panels.to_svg(PICTURE_PX.0, PICTURE_PX.1),
            caption: format!("{} {}", flown(effect, &with), figure.caption),
        }));
    }
    Ok(None)
}

/// What flew, in a sentence.
fn flown(effect: Effect, craft: &Model) -> String {
    let values = craft.term(effect).map(model::Term::values).unwrap_or_default();
    let named = std::iter::zip(effect.info().coefficients, values).map(|(c, value)| {
        let unit = if c.unit == "1" { String::new() } else { format!(" {}", c.unit) };
        format!("{} = {}{unit}", c.name, report::significant(value, 3))
    });
    format!(
        "A simulated flight of {FLIGHT_S} s by the craft of `quadlab demo` with {}. Its own model is shown without and with \
         the effect; nothing else is changed, and nothing is fitted.",
        named.collect::<Vec<_>>().join(", ")
    )
}
