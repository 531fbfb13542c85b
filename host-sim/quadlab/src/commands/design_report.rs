//! `quadlab design report`: thesis chapter 5 and its appendices A and B for a model and its gains,
//! on one page, in the thesis' order and with its numbers beside the ones found.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Context as _;
use control::Config;
use design::analysis::{LoopMargins, Study, closed_bode, loop_bode};
use design::check::{CheckOptions, CheckReport, check};
use design::loops::{ClosedLoop, GAINS, Gain, LoopName, LoopPlant, View, gain_of};
use design::plant::CANCEL_TOLERANCE;
use design::thesis_values::{Compared, compare};
use model::Model;
use report::{Axis, Cell, Column, Figure, Mark, Page, Section, Series, Style, Table, Verdict, significant};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::commands::linearize;
use crate::render::design_pages;
use crate::render::design_tables::{failures, short};

/// Chapter 5 of the thesis on one page: every figure as computed here, with its numbers beside those
/// of the thesis. Exit status 1 if a loop is unstable as it flies, or if a number that the thesis
/// prints of its own vehicle is not reproduced.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab design report --out report.html                                      # the thesis' vehicle and gains\n  quadlab design report --model model.toml --gains gains.toml --out report.html"
)]
pub(crate) struct Options {
    /// Model file; the thesis' vehicle if not given
    #[arg(long, value_name = "TOML", requires = "gains")]
    model: Option<PathBuf>,

    /// Gains file; the thesis' gains if not given
    #[arg(long, value_name = "TOML", requires = "model")]
    gains: Option<PathBuf>,

    /// Age of the pose in the loops as they fly, samples
    #[arg(long, value_name = "SAMPLES", default_value_t = 2, value_parser = clap::value_parser!(u16).range(0..=100))]
    delay: u16,

    /// Number of random draws of the model's coefficients within their standard errors
    #[arg(long, value_name = "COUNT", default_value_t = 100, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    samples: u32,

    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Page to write, for example: --out report.html
    #[arg(long, value_name = "HTML", required = true)]
    out: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    vehicle: &'a str,
    thesis: bool,
    holds: bool,
    numbers: &'a [Compared],
    page: String,
}

/// Everything that the page shows.
struct Work {
    model: Model,
    config: Config,
    /// Whether it is the thesis' own vehicle and gains, whose printed numbers must come back.
    thesis: bool,
    delay_samples: usize,
    study: Study,
    flown: Study,
    continuous: CheckReport,
    sampled: CheckReport,
    numbers: Vec<Compared>,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let out = options.out.as_ref().context("--out: give the page to write")?;
    let inputs: Vec<&PathBuf> = options.model.iter().chain(&options.gains).collect();
    options.output.check([out], &inputs)?;
    let model = options.model.as_deref().map_or_else(|| Ok(Model::thesis()), Model::read)?;
    let config = match &options.gains {
        Some(path) => design::gains_match::read_for(path, &model)?.config,
        None => Config::thesis(),
    };
    let work = Work::new(model, config, options)?;
    let files: Vec<&std::path::Path> = inputs.iter().map(|path| path.as_path()).collect();
    page(&work)?.provenance(provenance(&files, [])).write(out)?;
    let missed: Vec<&Compared> = work.numbers.iter().filter(|n| work.thesis && !n.holds()).collect();
    let holds = work.sampled.holds && missed.is_empty();
    let page = out.display().to_string();
    let outcome = if options.output.json {
        Outcome::json(&Document {
            vehicle: &work.model.vehicle.name,
            thesis: work.thesis,
            holds,
            numbers: &work.numbers,
            page,
        })?
    } else {
        let mut text = String::new();
        for number in missed {
            let found = number.found.map_or_else(|| "nothing".into(), |x| significant(x, 6));
            let _ = writeln!(
                text,
                "NOT FOUND: {} {}: {}, here {found}",
                number.place, number.what, number.printed
            );
        }
        for failure in failures(&work.sampled) {
            let _ = writeln!(
                text,
                "NOT SAFE TO FLY with a pose that is {} samples old: {failure}",
                work.delay_samples
            );
        }
        let _ = writeln!(text, "page: {page}");
        Outcome::done(text)
    };
    Ok(Outcome { holds, ..outcome })
}

impl Work {
    fn new(model: Model, config: Config, options: &Options) -> anyhow::Result<Self> {
        let delay_samples = usize::from(options.delay);
        let (smooth, late) = (View::Continuous, View::Sampled { delay_samples });
        let study = Study::new(&model, &config, smooth)?;
        let continuous = check(&model, &config, &CheckOptions { view: smooth, samples: 0, seed: 0 })?;
        let samples = options.samples as usize;
        let sampled = check(&model, &config, &CheckOptions { view: late, samples, seed: options.seed })?;
        let numbers = compare(&model, &study, &continuous)?;
        Ok(Self {
            thesis: model.vehicle == Model::thesis().vehicle && config == Config::thesis(),
            delay_samples,
            flown: Study::new(&model, &config, late)?,
            study,
            continuous,
            sampled,
            numbers,
            model,
            config,
        })
    }

    fn of(&self, name: LoopName) -> Option<(&LoopPlant, &ClosedLoop)> {
        self.study.loops.iter().find(|(_, closed)| closed.name == name).map(|(plant, closed)| (plant, closed))
    }

    /// The printed numbers whose description or place begins so.
    fn numbers(&self, begins: &[&str]) -> Table {
        let columns = [
            Column::text("place in the thesis"),
            Column::text("number"),
            Column::text("unit"),
            Column::number("thesis", ""),
            Column::number("here", ""),
            Column::number("apart", "%"),
            Column::text(""),
        ];
        let mut table = Table::new("", columns);
        let fits = |n: &&Compared| begins.iter().any(|b| n.what.starts_with(b) || n.place.starts_with(b));
        for n in self.numbers.iter().filter(fits) {
            let apart = n.found.map_or(f64::NAN, |found| 100.0 * (found / n.printed - 1.0));
            // Less than the last printed digit says nothing.
            let apart = if apart.abs() < 1e-3 { 0.0 } else { apart };
            let note = match (self.thesis, n.holds()) {
                (true, true) => Cell::from(n.why).verdict(Verdict::Good),
                (true, false) => Cell::from(n.why).verdict(Verdict::Bad),
                (false, _) => Cell::from(""),
            };
            table.push([
                Cell::from(n.place),
                Cell::from(n.what.as_str()),
                Cell::from(n.unit),
                Cell::number(n.printed, 6),
                Cell::number(n.found.unwrap_or(f64::NAN), 6),
                Cell::number(apart, 2),
                note,
            ]);
        }
        table
    }
}

fn page(work: &Work) -> anyhow::Result<Page> {
    let missed = work.numbers.iter().filter(|n| !n.holds()).count();
    let lead = match work.thesis {
        true => format!(
            "{}: {} of the {} numbers that the thesis prints are reproduced here.",
            work.model.vehicle.name,
            work.numbers.len() - missed,
            work.numbers.len()
        ),
        false => format!(
            "{}, with the numbers of the thesis' vehicle ({}) beside it.",
            work.model.vehicle.name,
            Model::thesis().vehicle.name
        ),
    };
    let mut page = Page::new("Chapter 5: from the model to gains", lead).section(linear(work)?);
    let tilt = [LoopName::Roll, LoopName::Pitch];
    let slow = [LoopName::Z, LoopName::Yaw];
    let outer = [LoopName::X, LoopName::Y];
    page = page
        .section(group(work, "Roll and pitch (5.3.1)", tilt, ["5.2", "5.3", "5.4", "5.5", "5.6", "5.7"])?)
        .section(group(
            work,
            "Altitude and yaw (5.3.2)",
            slow,
            ["5.12", "5.12", "5.13", "5.13", "5.14", "5.14"],
        )?)
        .section(group(work, "Position (5.4)", outer, ["5.17", "5.18", "5.19", "5.20", "5.21", "5.22"])?)
        .section(flown(work)?);
    page = page.section(ages(work)?);
    if !work.continuous.moved_zero.is_empty() {
        page = page.section(
            design_pages::moved_zeros(&work.config, View::Continuous, &work.study, &work.continuous)?
                .table(work.numbers(&["Table A.1"])),
        );
    }
    page = page.section(disturbances(work)?);
    if let Some(uncertainty) = &work.sampled.uncertainty {
        page = page.section(design_pages::spread(uncertainty));
    }
    Ok(page.section(design_pages::battery(&work.sampled)).section(design_pages::steady_tilts(&work.sampled)))
}

fn linear(work: &Work) -> anyhow::Result<Section> {
    let channels = work.study.linear.channels(CANCEL_TOLERANCE)?;
    Ok(Section::new("Equilibrium and linear model (5.2)")
        .paragraph("Thrust in N, angular accelerations in rad/s^2; states in the order of (5.13).")
        .table(work.numbers(&["(5."]))
        .preformatted(linearize::text(&work.model, &work.study.linear, &channels)))
}

/// Two loops that the thesis designs side by side: root loci in the order of the design, Bode and
/// Nichols, closed loop, steps.
fn group(work: &Work, heading: &str, names: [LoopName; 2], figures: [&str; 6]) -> anyhow::Result<Section> {
    let thesis = Config::thesis();
    let [bode, closed, step] = match names[0] {
        LoopName::Roll => ["Figure 5.8: ", "Figure 5.9: ", "Figure 5.10: "],
        LoopName::Z => ["", "", "Figure 5.15: "],
        _ => ["Figure 5.23: ", "", "Figure 5.24: "],
    };
    let both = names.map(|name| format!("{name}:"));
    let beginnings: Vec<&str> = both.iter().map(String::as_str).collect();
    let of_loops =
        |n: &&Compared| beginnings.iter().any(|b| n.what.starts_with(b)) && n.place.starts_with("5.");
    let mut section = Section::new(heading);
    if work.numbers.iter().any(|n| of_loops(&n)) {
        let places: Vec<String> =
            work.numbers.iter().filter(|n| of_loops(n)).map(|n| n.what.clone()).collect();
        section = section.table(work.numbers(&places.iter().map(String::as_str).collect::<Vec<_>>()));
    }
    for (k, gain) in GAINS.into_iter().enumerate() {
        for (j, name) in names.into_iter().enumerate() {
            let Some((plant, around)) = work.of(name) else { continue };
            let symbol = gain.symbol();
            let caption = format!(
                "Figure {}: root locus of {symbol} of {name}, {}; {symbol} = {} (thesis: {}).",
                figures[2 * k + j],
                match gain {
                    Gain::Velocity if !name.is_outer() => "the velocity loop alone",
                    Gain::Velocity => "without the other gains",
                    Gain::Proportional => "velocity loop closed, no integral",
                    Gain::Integral => "the rest closed",
                },
                significant(gain_of(&work.config, name, gain), 4),
                significant(gain_of(&thesis, name, gain), 4),
            );
            section = section
                .figure(design_pages::locus(&work.config, View::Continuous, plant, around, gain)?, caption);
        }
    }
    for name in names {
        let Some((_, around)) = work.of(name) else { continue };
        let curve = loop_bode(around);
        let found = LoopMargins::of(around)?.at_error;
        section = section
            .figure(
                design_pages::bode_panels(&curve, &found),
                format!("{bode}loop gain of {name}: {}.", design_pages::margin_words(&found)),
            )
            .figure(design_pages::nichols(&curve), format!("Nichols plot of the loop gain of {name}."));
        if around.closed.is_stable()? {
            let [bare, filtered] = closed_bode(around)?;
            section = section
                .figure(design_pages::two_bodes(&bare, &filtered), format!("{closed}{name}, closed loop."))
                .figure(
                    design_pages::steps(&work.config, around)?,
                    format!("{step}{}", step_numbers(work, name)),
                );
        }
    }
    Ok(section)
}

fn step_numbers(work: &Work, name: LoopName) -> String {
    let with = match name.is_outer() {
        true => "1 m with and without rate limit",
        false => "step with and without prefilter",
    };
    let Some(step) = work.continuous.steps.iter().find(|s| s.name == name.name()) else {
        return format!("{name}: {with}.");
    };
    let rise = step.commanded.rise_s.map_or_else(|| "-".into(), |x| significant(x, 3));
    format!(
        "{name}: {with}; commanded: overshoot {} %, rise {rise} s.",
        short(step.commanded.overshoot_percent, 3)
    )
}

/// The loops as they fly beside the loops as they are designed.
fn flown(work: &Work) -> anyhow::Result<Section> {
    let heading = format!("As it flies: 100 Hz, pose {} samples late (5.5)", work.delay_samples);
    let mut section = Section::new(heading)
        .paragraph(
            "The design in the thesis leaves out sampling, the filters as they are computed, and the age of the pose. Figures 5.25 to 5.30 are flights of the nonlinear simulation; `cargo xtask sil` draws them.",
        )
        .table(design_pages::margins(&work.sampled))
        .list(work.sampled.notes.clone());
    for (_, late) in &work.flown.loops {
        let name = late.name;
        if !late.closed.is_stable()? {
            section = section.paragraph(format!("{name} is unstable."));
            continue;
        }
        let mut figure = Figure::new("", Axis::new("time", "s"), Axis::new("response over step", "1"));
        if let Some((_, smooth)) = work.of(name)
            && smooth.closed.is_stable()?
        {
            let designed = design_pages::drawn(design::analysis::commanded(&work.config, smooth)?.points());
            figure = figure.with(Series::line("as designed", Style::PredictedBefore, designed));
        }
        let points = design_pages::drawn(design::analysis::commanded(&work.config, late)?.points());
        figure =
            figure.with(Series::line("as flown", Style::PredictedAfter, points)).mark(Mark::limit("", 1.0));
        let found = design_pages::margin_words(&LoopMargins::of(late)?.at_error);
        section = section.figure(figure, format!("{name}: commanded step; as flown {found}."));
    }
    Ok(section)
}

/// What a late pose costs: the margins that are left as it gets older.
fn ages(work: &Work) -> anyhow::Result<Section> {
    let names = work.sampled.loops.iter().map(|l| Column::text(l.name));
    let columns: Vec<Column> =
        std::iter::once(Column::number("age of the pose", "samples")).chain(names).collect();
    let mut table = Table::new("", columns);
    for delay_samples in 0..=OLDEST_POSE {
        let study = Study::new(&work.model, &work.config, View::Sampled { delay_samples })?;
        let cells = study.margins()?.into_iter().map(|(_, margins)| {
            if !margins.stable {
                return Cell::from("unstable").verdict(Verdict::Bad);
            }
            let number = |value: Option<f64>| value.map_or_else(|| "-".into(), |x| significant(x, 3));
            let error = &margins.at_error;
            Cell::from(format!("{} deg, {}", number(error.phase_margin_deg), number(error.gain_margin)))
        });
        table.push(std::iter::once(Cell::number(delay_samples as f64, 2)).chain(cells));
    }
    Ok(Section::new("What a late pose costs")
        .paragraph("Phase margin and gain margin of each loop at its error, by the age of the pose.")
        .table(table))
}

/// Age of the oldest pose in the table, samples.
const OLDEST_POSE: usize = 6;

/// Appendix B: what the integral part is for.
fn disturbances(work: &Work) -> anyhow::Result<Section> {
    let mut section = Section::new("Constant disturbances (appendix B)").paragraph(
        "A step of 1 N or 1 rad/s^2 at the actuator: the integral part removes its effect; proportional and velocity feedback alone do not.",
    );
    for (plant, closed) in &work.study.loops {
        if !closed.closed.is_stable()? {
            continue;
        }
        let mut without = work.config;
        *design::loops::gain_mut(&mut without, closed.name, Gain::Integral) = 0.0;
        let without = ClosedLoop::new(&without, plant, closed.name, View::Continuous)?;
        let mut figure = design_pages::disturbance(closed)?;
        if without.closed.is_stable()? {
            let points = design::analysis::disturbance_step(&without, design::analysis::LONG_S)?.points();
            figure = figure.with(Series::line("without integral", Style::PredictedBefore, points));
        }
        let numbers = work.continuous.disturbances.iter().find(|d| d.name == closed.name.name());
        let caption = numbers.map_or_else(String::new, |d| {
            format!(
                "{}: peak {} {} after {} s; after {} s {}, without integral {}.",
                d.name,
                significant(d.peak, 3),
                d.unit,
                significant(d.peak_s, 3),
                design::analysis::LONG_S,
                significant(d.last, 2),
                significant(d.last_without_integral, 3)
            )
        });
        section = section.figure(figure, caption);
    }
    Ok(section)
}
