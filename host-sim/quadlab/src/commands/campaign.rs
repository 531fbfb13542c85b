//! `quadlab campaign`: many flights over everything that is not known.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use campaign::{
    Answer, CaseFlight, Causes, Definition, Flown, Input, MERGED, MOST_SHARDS, Needed, Plan, Rate,
    ShardFlown, Summary, Table, merge, run_shard,
};
use clap::Subcommand;
use report::significant;

use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::progress;
use crate::commands::campaign_documents::{Planned, Replayed};
use crate::commands::{campaign_search, campaign_submit};
use crate::render;

/// Fly thousands of simulated flights over all uncertain quantities: how often is the craft lost with
/// these gains, which gains are safer, and what drives the losses?
///
/// A definition is a TOML file that says what to fly and what is uncertain; a plan is made of it. A draw is
/// one sample of all uncertain quantities. It is flown in every scenario with every set of gains; each of
/// these flights is a case, numbered from 0. The craft is lost in a case if it hits the floor at more than
/// 1 m/s, leaves the cage, turns upside down, or has its motors cut or disarmed in the air; a draw counts as
/// lost if any of its cases is.
///
/// A shard is the share of the cases that one process flies, and a part is the file with its results. An
/// engine is a program that runs the shards on one or many machines, such as Slurm.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab campaign plan campaign.toml --out plan.json\n  quadlab campaign run plan.json --out parts\n  quadlab campaign report plan.json --parts parts --html campaign.html\n  quadlab campaign replay plan.json 17 --html case.html   # case 17; report names cases\n  quadlab campaign why plan.json 17\n  quadlab campaign search plan.json --gains mine\n\nOn a cluster, each task flies one shard:\n  quadlab campaign submit plan.json --out parts --engine slurm\n  quadlab campaign run plan.json --out parts --shard 3\n\nA definition:\n  name = \"mine\"\n  seed = 1\n  draws = 1000\n  scenarios = [\"tour\", \"x-1\"]\n  model = \"model.toml\"        # default: the thesis' craft\n  [gains]\n  mine = \"gains.toml\"\n  [unknown]\n  coefficients = true         # drawn from the model's covariance\n  mass_kg = [-0.1, 0.1]       # more than the model's; a range, or\n  wind_m_s = { mean = 0.0, deviation = 0.5 }   # a normal distribution\n  gust_m_s = [0.0, 0.5]\n  fault = 0.2                 # share of draws with a fault"
)]
pub(crate) struct Options {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Plan(PlanOptions),
    Run(RunOptions),
    Submit(campaign_submit::Options),
    Merge(MergeOptions),
    Report(ReportOptions),
    Replay(ReplayOptions),
    Why(WhyOptions),
    Search(campaign_search::Options),
}

/// Make a plan of a definition: one file with everything that its flights need
#[derive(clap::Args)]
struct PlanOptions {
    /// Definition (TOML), for example: campaign.toml
    #[arg(value_name = "TOML")]
    definition: PathBuf,

    /// Plan file to write
    #[arg(long, value_name = "JSON", default_value = "plan.json")]
    out: PathBuf,

    /// Shards that it is flown in [default: one for each 2000 flights]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_SHARDS))]
    shards: Option<u64>,

    #[command(flatten)]
    output: OutputOptions,
}

/// Fly a plan, or one shard of it. Shards whose parts are in the folder already, and whole, are not flown again
#[derive(clap::Args)]
struct RunOptions {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Folder for the parts
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Only this shard, counted from 0 [default: that of the cluster's environment, else all]
    #[arg(long, value_name = "I")]
    shard: Option<u64>,
}

/// Join the parts of a plan into one Parquet file: a row for each flight
#[derive(clap::Args)]
struct MergeOptions {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Folder with the parts; cases.parquet is written there
    #[arg(long, value_name = "DIR")]
    parts: PathBuf,
}

/// Report how often the craft was lost, which gains are safer, and what drives it. Exit status 1 if it was lost more often than --allow
/// says
#[derive(clap::Args)]
struct ReportOptions {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Folder with the parts
    #[arg(long, value_name = "DIR")]
    parts: PathBuf,

    /// Maximum losses allowed, percent of the draws: fails unless the upper end of the 95 % interval is below it for all gains in every scenario
    #[arg(long, value_name = "PERCENT")]
    allow: Option<f64>,

    /// Page to write, for example: --html campaign.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

/// Fly one case of a plan again, to look at it
#[derive(clap::Args)]
struct ReplayOptions {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Number of the case
    #[arg(value_name = "CASE")]
    case: u64,

    /// Page to write, for example: --html case.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    /// Flight file to write, for example: --out case.csv
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

/// Find a minimal set of conditions that causes the loss in a case, with all others nominal
#[derive(clap::Args)]
struct WhyOptions {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Number of the case
    #[arg(value_name = "CASE")]
    case: u64,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    match &options.command {
        Command::Plan(options) => make_plan(options),
        Command::Run(options) => fly(options),
        Command::Submit(options) => campaign_submit::run(options),
        Command::Merge(options) => join(options),
        Command::Report(options) => tell(options),
        Command::Replay(options) => replay(options),
        Command::Why(options) => why(options),
        Command::Search(options) => campaign_search::run(options),
    }
}

fn make_plan(options: &PlanOptions) -> anyhow::Result<Outcome> {
    options.output.check([&options.out], &[&options.definition])?;
    let plan = Plan::new(&Definition::read(&options.definition)?, &options.definition, options.shards)?;
    report::write_atomic(&options.out, plan.to_json())?;
    if options.output.json {
        return Outcome::json(&Planned::new(&options.out, &plan));
    }
    let file = options.out.display();
    let mut text = format!(
        "{} flights in {}; plan written to {file}\n",
        plan.cases(),
        render::campaign::shards(plan.shards)
    );
    for truncation in plan.truncations() {
        text += &render::grid::paragraph(&render::campaign::truncated(&truncation));
    }
    writeln!(text, "to fly it: quadlab campaign run {file} --out parts")?;
    Ok(Outcome::done(text))
}

/// Where engines of clusters put the number of a task, from 0 or from what the user said.
const TASK_VARIABLES: [&str; 5] = [
    "HQ_TASK_ID",
    "SLURM_ARRAY_TASK_ID",
    "JOB_COMPLETION_INDEX",
    "PBS_ARRAY_INDEX",
    "AWS_BATCH_JOB_ARRAY_INDEX",
];

/// The shard that the environment names.
fn shard_of_environment() -> anyhow::Result<Option<u64>> {
    for variable in TASK_VARIABLES {
        if let Ok(value) = std::env::var(variable) {
            let number =
                value.parse().map_err(|_| anyhow::anyhow!("{variable}={value}: is no number of a shard"));
            return number.map(Some);
        }
    }
    Ok(None)
}

/// Shards that were flown.
pub(crate) struct FlownShards {
    cases: u64,
    /// Those of them that had been flown before.
    before: Vec<u64>,
    /// Those of them whose parts could not be used and were replaced.
    replaced: Vec<u64>,
}

/// Flies shards of the plan of a file into a folder, and shows how far it is.
pub(crate) fn fly_shards(
    (plan, file): (&Plan, &Path),
    shards: &[u64],
    out: &Path,
    json: bool,
) -> anyhow::Result<FlownShards> {
    let mut cases = 0;
    for shard in shards {
        let of = plan.cases_of(*shard)?;
        cases += of.end - of.start;
    }
    let progress = progress::bar(cases as usize, json);
    let (done, lost) = (AtomicU64::new(0), AtomicU64::new(0));
    let told = |flown: u64, lost_now: u64| {
        let done = done.fetch_add(flown, Ordering::Relaxed) + flown;
        let lost = lost.fetch_add(lost_now, Ordering::Relaxed) + lost_now;
        progress.set_activity(&format!("flying, {lost} lost"), done, cases);
    };
    let (mut before, mut replaced) = (Vec::new(), Vec::new());
    for shard in shards {
        match run_shard(plan, file, *shard, out, &told)? {
            ShardFlown::Now => (),
            ShardFlown::Again => replaced.push(*shard),
            ShardFlown::Before => {
                let of = plan.cases_of(*shard)?;
                told(of.end - of.start, 0);
                before.push(*shard);
            }
        }
    }
    progress.finish_and_clear();
    Ok(FlownShards { cases, before, replaced })
}

fn fly(options: &RunOptions) -> anyhow::Result<Outcome> {
    let plan = Plan::read(&options.plan)?;
    let shard = options.shard.map_or_else(shard_of_environment, |shard| Ok(Some(shard)))?;
    let shards: Vec<u64> = shard.map_or_else(|| (0..plan.shards).collect(), |shard| vec![shard]);
    let flown = fly_shards((&plan, &options.plan), &shards, &options.out, false)?;
    let mut text = String::new();
    for shard in flown.before {
        writeln!(text, "shard {shard} of {} was flown before", plan.shards)?;
    }
    for shard in flown.replaced {
        writeln!(text, "shard {shard} of {} was flown again: its part was damaged", plan.shards)?;
    }
    let cases = flown.cases;
    let (file, folder) = (options.plan.display(), options.out.display());
    writeln!(text, "{cases} flights in {folder}; next: quadlab campaign report {file} --parts {folder}")?;
    Ok(Outcome::done(text))
}

/// All cases of a plan; the merged file is written, too.
fn merged(plan: &Plan, file: &Path, parts: &Path) -> anyhow::Result<Table> {
    let command = format!("quadlab campaign run {} --out {}", file.display(), parts.display());
    let (table, bytes) = merge(plan, parts, &command)?;
    report::write_atomic(parts.join(MERGED), bytes)?;
    Ok(table)
}

fn join(options: &MergeOptions) -> anyhow::Result<Outcome> {
    let plan = Plan::read(&options.plan)?;
    let table = merged(&plan, &options.plan, &options.parts)?;
    let path = options.parts.join(MERGED);
    Ok(Outcome::done(format!("{} flights in {}\n", table.rows(), path.display())))
}

fn tell(options: &ReportOptions) -> anyhow::Result<Outcome> {
    options.output.check(&options.html, &[&options.plan])?;
    let plan = Plan::read(&options.plan)?;
    if let Some(percent) = options.allow {
        check_allowed(percent, plan.campaign.draws)?;
    }
    let table = merged(&plan, &options.plan, &options.parts)?;
    let Some(summary) = Summary::new(&plan, &table) else {
        anyhow::bail!(
            "{}: is no table of a campaign; remove it and merge again",
            options.parts.join(MERGED).display()
        );
    };
    if let Some(path) = &options.html {
        let page = render::campaign::page(&summary, &plan).provenance(provenance(&[&options.plan], []));
        report::write_atomic(path, page.render())?;
    }
    let is_beyond =
        |rate: &&Rate| options.allow.is_some_and(|allowed| rate.is_below(allowed) != Answer::Shown);
    let beyond: Vec<&Rate> = summary.rates.iter().filter(is_beyond).collect();
    let holds = beyond.is_empty();
    if options.output.json {
        return Ok(Outcome { holds, ..Outcome::json(&summary)? });
    }
    let mut text = render::campaign::to_text(&summary, &options.plan.display().to_string());
    for rate in beyond {
        writeln!(
            text,
            "{}: {} in {}: up to {} % lost (upper end of the 95 % interval), below {} % allowed",
            match rate.is_below(options.allow.unwrap_or_default()) {
                Answer::Refuted => "NOT ALLOWED",
                _ => "NOT SHOWN",
            },
            rate.gains,
            render::campaign::scenario_of(rate),
            significant(rate.lost_interval_percent[1], 2),
            options.allow.unwrap_or_default()
        )?;
    }
    if let (true, Some(allowed)) = (holds, options.allow) {
        writeln!(
            text,
            "ALLOWED: below {allowed} % lost, by the upper end of the 95 % interval, for all gains in every scenario"
        )?;
    }
    Ok(Outcome { holds, ..Outcome::done(text) })
}

/// A limit that so many draws can show at all.
pub(crate) fn check_allowed(percent: f64, draws: u64) -> anyhow::Result<()> {
    if !(percent > 0.0 && percent <= 100.0) {
        anyhow::bail!("--allow {percent}: give a percentage of draws, above 0 and at most 100");
    }
    let least = 100.0 * campaign::exact_interval(0, draws).high;
    if least >= percent {
        anyhow::bail!(
            "--allow {percent}: {draws} draws cannot show that: even with no loss, up to {} % may be lost; plan more draws",
            significant(least, 2)
        );
    }
    Ok(())
}

fn replay(options: &ReplayOptions) -> anyhow::Result<Outcome> {
    let outputs: Vec<&PathBuf> = options.html.iter().chain(&options.out).collect();
    options.output.check(outputs, &[&options.plan])?;
    let plan = Plan::read(&options.plan)?;
    let flight = plan.replay(options.case, &options.plan)?;
    let sentence = sentence(&plan, &flight);
    if let Some(path) = &options.html {
        let page = render::campaign::case_page(&plan, &flight, &sentence);
        report::write_atomic(path, page.provenance(provenance(&[&options.plan], [])).render())?;
    }
    if let Some(path) = &options.out {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        report::write_atomic(path, flight.recording.to_flight(name, false).to_csv())?;
    }
    if options.output.json {
        return Outcome::json(&Replayed::new(&plan, &flight));
    }
    let mut text = render::grid::paragraph(&sentence);
    for Input { name, value, usual } in &flight.flown.drawn.inputs {
        writeln!(text, "  {name} = {} (nominal {})", short(*value), short(*usual))?;
    }
    Ok(Outcome::done(text))
}

fn why(options: &WhyOptions) -> anyhow::Result<Outcome> {
    let plan = Plan::read(&options.plan)?;
    let Some(causes) = plan.causes(options.case, &options.plan)? else {
        anyhow::bail!(
            "case {}: the craft was not lost; quadlab campaign report names cases in which it was",
            options.case
        )
    };
    if options.json {
        return Outcome::json(&causes);
    }
    let mut text = render::grid::paragraph(&because(&causes));
    for Needed { name, value, usual } in &causes.needed {
        writeln!(text, "  {name} = {} (nominal {})", short(*value), short(*usual))?;
    }
    Ok(Outcome::done(text))
}

/// Causes as a sentence.
fn because(causes: &Causes) -> String {
    let Causes { case, lost_by, after_s, needed, fault, enough_percent, flights } = causes;
    let lost = format!("Case {case} was lost after {after_s:.2} s: {lost_by}.");
    let why = match (needed.len(), fault) {
        (0, None) => "It is lost even with everything nominal.".to_owned(),
        (0, Some(fault)) => format!("Its fault alone is enough: {fault}."),
        (1, None) if enough_percent.is_none() => {
            format!(
                "{} = {} alone is enough: all others can be nominal.",
                needed[0].name,
                short(needed[0].value)
            )
        }
        (count, fault) => {
            let numbers = if count == 1 {
                "one value causes".to_owned()
            } else {
                format!("{count} values together cause")
            };
            let fault = fault.as_ref().map(|fault| format!(", with its fault ({fault})")).unwrap_or_default();
            let enough = enough_percent
                .filter(|percent| *percent < 99.0)
                .map(|percent| {
                    format!(
                        " {} % of these deviations is enough (a delay stays as drawn).",
                        significant(percent, 2)
                    )
                })
                .unwrap_or_default();
            format!(
                "Of all that was drawn, {numbers} the loss{fault}; without any one of these conditions the craft survives, and all others can be nominal.{enough}"
            )
        }
    };
    format!("{lost} {why} ({flights} flights.)")
}

/// Whole numbers as such, others with four digits.
fn short(value: f64) -> String {
    if value.fract() == 0.0 { value.to_string() } else { significant(value, 4) }
}

/// What came of a case.
fn sentence(plan: &Plan, flight: &CaseFlight) -> String {
    let Flown { case, lost, impossible, ended, events, drawn, tilt_deg, .. } = &flight.flown;
    let scenario = &plan.campaign.scenarios[case.scenario];
    let gains = &plan.campaign.gains[case.gains].name;
    let how = match (lost, impossible) {
        (_, Some(why)) => format!("no gains could fly it: {why}"),
        (Some((why, at_s)), _) => format!("lost after {at_s:.2} s: {why}"),
        (None, None) => format!("not lost; at the end it was {ended}"),
    };
    let fault = drawn.fault.map(|fault| format!(" Fault: {fault}.")).unwrap_or_default();
    let events = if events.is_empty() { String::new() } else { format!(" The supervisor saw: {events}.") };
    format!(
        "Case {}, draw {}: {scenario} under {gains}: {how}. Greatest tilt {} deg.{fault}{events}",
        case.number,
        case.draw,
        significant(*tilt_deg, 3)
    )
}
