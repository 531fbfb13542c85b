//! `quadlab fleet`: all flights of all craft of a folder, over time.

use std::path::{Path, PathBuf};

use fleet::{Answered, Fleet, PassOptions, Question, ask, look_up_causes, pass, tables};
use model::Effect;

use crate::cli::colour;
use crate::cli::effect_names::known_effect;
use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::terminal::Terminal;
use crate::render;

/// Follow many flights of many craft: each craft's model over time, what changed when and why, which craft and batteries differ, which
/// loggers have faults.
///
/// Each flight is read once; an index keeps its normal equations, so that new flights, fewer flights or other effects are answered
/// without reading a log again.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab fleet flights\n  quadlab fleet flights --html fleet.html --out tables\n  quadlab fleet flights --effects quadratic-drag\n  quadlab fleet flights --leave-out quad-1/2026-03-04.csv --craft quad-1\n\nA fleet's folder:\n  flights/quad-1/vehicle.toml           each craft's folder has its vehicle file\n  flights/quad-1/2026-03-04_hover.csv   flights and logs, in folders as you like\n  flights/quad-1/battery-B7/log12.ulg   a battery, by the name of a folder or file\n  flights/fleet.toml                    batteries and dates that names do not tell (see the book)"
)]
pub(crate) struct Options {
    /// Folder with a folder for each craft, or of one craft
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// Index to keep what was read in [default: .quadlab/fleet.parquet in the folder]
    #[arg(long, value_name = "PARQUET")]
    index: Option<PathBuf>,

    /// Compare the content of every file with the index, even if its size and modification time match
    #[arg(long)]
    verify: bool,

    /// Rebuild the reference model of each craft, and read all flights again with it
    #[arg(long)]
    refresh: bool,

    /// Forget flights whose files are gone
    #[arg(long)]
    forget: bool,

    /// Fit these effects beside the basic ones, for example: --effects quadratic-drag,ground-effect
    #[arg(long, value_name = "EFFECT", value_delimiter = ',')]
    effects: Vec<String>,

    /// Leave these effects out of the fit, for example: --without angular-damping
    #[arg(long, value_name = "EFFECT", value_delimiter = ',')]
    without: Vec<String>,

    /// Look at these craft only
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    craft: Vec<String>,

    /// Leave flights out, by their paths in the folder
    #[arg(long, value_name = "NAME", num_args = 1..)]
    leave_out: Vec<String>,

    /// Look at flights from this date on, for example: --since 2026-03-04
    #[arg(long, value_name = "DATE")]
    since: Option<String>,

    /// Look at flights up to this date
    #[arg(long, value_name = "DATE")]
    until: Option<String>,

    /// Do not search the logs around a change for its cause (what `quadlab diagnose --changed` does)
    #[arg(long)]
    no_causes: bool,

    /// Exit status 1 if a craft changed
    #[arg(long)]
    check: bool,

    /// Folder for tables of flights, histories and changes, as Parquet and CSV
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Page to write, for example: --html fleet.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    options.output.check(&options.html, &[])?;
    if let Some(out) = &options.out {
        check_folder(out, options)?;
    }
    let index = options.index.clone().unwrap_or_else(|| options.folder.join(".quadlab/fleet.parquet"));
    let question = question(options)?;
    let terminal = Terminal::new(options.output.json);
    let fleet = Fleet::find(&options.folder, &index)?;
    let how = PassOptions { verify: options.verify, refresh: options.refresh, forget: options.forget };
    let indexed = pass(&fleet, &index, how, &terminal)?;
    let mut answered = ask(&fleet, &indexed, &question)?;
    if question.looks_up_causes() {
        look_up_causes(&mut answered, &fleet, &indexed, &index, &terminal)?;
    }
    terminal.clear();
    if let Some(out) = &options.out {
        write_tables(&answered, out)?;
    }
    if let Some(path) = &options.html {
        let page = render::fleet::page(&answered).provenance(provenance(&[], []));
        report::write_atomic(path, page.render())?;
    }
    let changed = answered.answer.crafts.iter().any(|craft| !craft.changes.is_empty());
    let holds = !(options.check && changed);
    if options.output.json {
        return Ok(Outcome { holds, ..Outcome::json(&answered.answer)? });
    }
    for sentence in render::fleet::warnings(&answered.answer) {
        colour::warn(&sentence);
    }
    Ok(Outcome { holds, ..Outcome::done(render::fleet::to_text(&answered)) })
}

fn question(options: &Options) -> anyhow::Result<Question> {
    let effects = |names: &[String]| -> anyhow::Result<Vec<Effect>> {
        names.iter().map(|name| Ok(known_effect(name)?)).collect()
    };
    let date = |flag: &str, text: &Option<String>, end_of_day_s: f64| -> anyhow::Result<Option<f64>> {
        let Some(text) = text else { return Ok(None) };
        let has_time = text.contains(['T', ' ']);
        match fleet::of_text(text) {
            Some(unix_s) => Ok(Some(if has_time { unix_s } else { unix_s + end_of_day_s })),
            None => anyhow::bail!("--{flag} {text}: is no date; write 2026-03-04 or 2026-03-04T15:30"),
        }
    };
    Ok(Question {
        effects: (!options.effects.is_empty()).then(|| effects(&options.effects)).transpose()?,
        without: effects(&options.without)?,
        crafts: options.craft.clone(),
        leave_out: options.leave_out.clone(),
        span_s: [date("since", &options.since, 0.0)?, date("until", &options.until, 86400.0)?],
        causes: !options.no_causes,
    })
}

/// Names of the tables' files.
fn table_files(out: &Path) -> Vec<PathBuf> {
    let names = ["flights", "histories", "changes"];
    names
        .iter()
        .flat_map(|name| ["parquet", "csv"].map(|ending| out.join(format!("{name}.{ending}"))))
        .collect()
}

/// Tables in the fleet's own folder would be read as flights the next time.
fn check_folder(out: &Path, options: &Options) -> anyhow::Result<()> {
    std::fs::create_dir_all(out)
        .map_err(|why| anyhow::anyhow!("{}: the folder cannot be made: {why}", out.display()))?;
    if let (Ok(own), Ok(of_fleet)) = (out.canonicalize(), options.folder.canonicalize())
        && own.starts_with(&of_fleet)
    {
        anyhow::bail!(
            "--out {}: lies in the fleet's folder, where its tables would be taken for flights; give another folder",
            out.display()
        );
    }
    options.output.check(&table_files(out), &[])
}

fn write_tables(answered: &Answered<'_>, out: &Path) -> anyhow::Result<()> {
    for (name, table) in tables(answered) {
        report::write_atomic(out.join(format!("{name}.parquet")), table.to_parquet()?)?;
        report::write_atomic(out.join(format!("{name}.csv")), table.to_csv())?;
    }
    Ok(())
}
