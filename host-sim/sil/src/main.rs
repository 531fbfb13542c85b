//! `sil`: flies the controller against the simulated craft and checks the flights.
#![forbid(unsafe_code)]

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, ValueEnum};
use control::Config;
use indicatif::{ProgressBar, ProgressStyle};
use model::Model;
use sil::endurance::{MonteCarlo, Soak, soak, survey};
use sil::{
    Emulation, FlightComputerError, FlightPlan, NoiseModel, Processor, Scenario, Settings, SilError, Suite,
    Transport, page,
};

/// Fly the controller against the simulated craft at 100 Hz and check the flights.
///
/// Exit status: 0 every flight meets its requirements, 1 one does not, 2 bad usage or input, 130
/// interrupted.
#[derive(Parser)]
#[command(name = "sil", version)]
struct Arguments {
    /// Flights: hover, roll-10, pitch-10, yaw-30 (degrees), z-0.5, x-1, y-1 (metres), roll-30,
    /// pattern, excitation; by default all but roll-30, which is beyond the design's limit
    #[arg(long = "scenario", value_name = "NAME", num_args = 1..)]
    scenarios: Vec<Scenario>,

    /// Model file of the craft to fly; without --gains, one that the thesis' gains suit (as from
    /// quadlab add) [default: the thesis' craft]
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,

    /// Gains file to fly with, as from quadlab design for this craft's model [default: the thesis'
    /// gains]
    #[arg(long, value_name = "TOML")]
    gains: Option<PathBuf>,

    /// Age of the pose that the controller gets, in samples of 10 ms [default: 2; --monte-carlo
    /// draws 1 or 2 for each flight]
    #[arg(long, value_name = "SAMPLES", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(0..=1000))]
    delay: Option<u16>,

    /// Noise of the sensors; off reproduces the reference responses
    #[arg(long, value_enum, default_value_t = Switch::Off)]
    noise: Switch,

    /// Seed of noise, excitation and the tour of `excitation`
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,

    /// Controller and plant in one process, or in two over shared memory; the results are the same
    /// to the last bit
    #[arg(long, value_enum, default_value_t = Way::Inproc)]
    transport: Way,

    /// Where the controller runs: host, or emulated armv7 (the craft computer's program) or
    /// cortex-m4 (the microcontroller); the results are the same to the last bit. `cargo xtask sil`
    /// builds what is needed
    #[arg(long, value_name = "PLACE", default_value = "host")]
    on: String,

    /// The program for --on (given by cargo xtask sil)
    #[arg(long, value_name = "PROGRAM", hide = true)]
    firmware: Option<PathBuf>,

    /// Compare a minute each of three flights, bit by bit and term by term, with the lockstep
    /// program of --on (cargo xtask arm)
    #[arg(long, hide = true, requires = "firmware")]
    same_bits: bool,

    /// Runge-Kutta steps of the plant in a tick of 10 ms [default: 1; 4 with a load, a product of inertia or effects of your own]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1000))]
    substeps: Option<u16>,

    /// Fly the failsafe drills instead and print the list: each rule with a flight that sets it off
    /// and one that just does not
    #[arg(long, conflicts_with_all = OF_SCENARIOS, conflicts_with = "delay")]
    failsafes: bool,

    /// Fly the drills with so many seeds, beginning with --seed
    #[arg(long, value_name = "N", default_value_t = 1, requires = "failsafes", value_parser = clap::value_parser!(u16).range(1..=1000))]
    seeds: u16,

    /// Fly one craft for so many hours of simulated time, mission after mission, and see that
    /// nothing happens and its memory does not grow
    #[arg(long, value_name = "HOURS", conflicts_with_all = OF_SCENARIOS, conflicts_with_all = ["failsafes", "monte_carlo", "delay"])]
    soak: Option<f64>,

    /// Fly so many flights of 15 s under conditions drawn from --seed and the seeds after it
    #[arg(long, value_name = "FLIGHTS", conflicts_with_all = OF_SCENARIOS, conflicts_with = "failsafes")]
    monte_carlo: Option<u64>,

    /// Keep the flights of --monte-carlo in this file, and go on from those that are in it
    #[arg(long, value_name = "FILE", requires = "monte_carlo")]
    resume: Option<PathBuf>,

    /// Fly a pattern file instead (as from quadlab excite or plan), at the speed and angles of an
    /// identification flight
    #[arg(long, value_name = "CSV", conflicts_with_all = ["scenarios", "failsafes", "transport"])]
    pattern: Option<PathBuf>,

    /// Folder for index.html and one flight file per flight
    #[arg(long, value_name = "DIR", default_value = "out/sil")]
    out: PathBuf,

    /// Print one JSON document on standard output and nothing else
    #[arg(long)]
    json: bool,

    /// Serve as the controller of a run (started by sil itself)
    #[arg(long, value_name = "RUN", hide = true)]
    controller: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Switch {
    Off,
    On,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Way {
    Inproc,
    Iceoryx2,
}

/// What means something to scenarios and patterns only.
const OF_SCENARIOS: [&str; 8] =
    ["scenarios", "pattern", "transport", "model", "noise", "substeps", "on", "json"];
/// The craft's ticks are counted to 2^32; a tenth of that is enough.
const MOST_HOURS: f64 = 1000.0;
const BAD_USAGE: u8 = 2;
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return usage(&error),
    };
    let outcome = match &arguments.controller {
        Some(run) => {
            sil::serve(run).map(|()| ExitCode::SUCCESS).map_err(|error| SilError::from(error).into())
        }
        None => run(&arguments),
    };
    outcome.unwrap_or_else(|error| {
        eprintln!("error: {}", report::error_line(&format!("{error:#}")));
        let interrupted =
            matches!(error.downcast_ref(), Some(SilError::FlightComputer(FlightComputerError::Interrupted)));
        ExitCode::from(if interrupted { INTERRUPTED } else { BAD_USAGE })
    })
}

/// Prints help as it is, and a mistake as one line.
fn usage(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        let _ = error.print();
        return ExitCode::SUCCESS;
    }
    let text = error.to_string();
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let said: Vec<&str> =
        lines.take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more")).collect();
    eprintln!("{}", report::error_line(&format!("{} (see sil --help)", said.join(" "))));
    ExitCode::from(BAD_USAGE)
}

fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let processor = processor(&arguments.on)?;
    if let (true, Some(processor), Some(program)) = (arguments.same_bits, processor, &arguments.firmware) {
        return same_bits(arguments, processor, program);
    }
    let scenarios = match arguments.scenarios.as_slice() {
        [] => Scenario::standard().collect(),
        named => named.to_vec(),
    };
    let model =
        arguments.model.as_deref().map(|path| sil::flyable(path, arguments.gains.is_some())).transpose()?;
    let craft =
        |path: &PathBuf| design::gains_match::read_for(path, model.as_ref().unwrap_or(&Model::thesis()));
    let gains = arguments.gains.as_ref().map(craft).transpose()?;
    if arguments.soak.is_some() || arguments.monte_carlo.is_some() {
        return long_run(arguments, gains.map_or_else(sil::designed_config, |gains| Ok(gains.config))?);
    }
    if arguments.failsafes {
        return failsafes(arguments, &gains.map_or_else(Config::thesis, |gains| gains.config));
    }
    let settings = Settings {
        config: gains.map(|gains| gains.config),
        model,
        delay_samples: arguments.delay.map_or(Settings::default().delay_samples, usize::from),
        noise: (arguments.noise == Switch::On).then(NoiseModel::default),
        seed: arguments.seed,
        substeps: arguments.substeps.map(u32::from),
    };
    if let Some(path) = &arguments.pattern {
        anyhow::ensure!(processor.is_none(), "--pattern with --on: a pattern flies on this machine");
        return fly_pattern(arguments, path, settings);
    }
    let transport = transport(arguments, processor)?;
    let suite = fly_suite(&scenarios, &settings, &transport)?;
    let provenance = report::Provenance {
        command_line: std::env::args().collect::<Vec<_>>().join(" "),
        version: format!("sil {}", env!("CARGO_PKG_VERSION")),
        ..report::Provenance::default()
    };
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot create the folder {}", arguments.out.display()))?;
    suite.write_flights(&arguments.out)?;
    let index = arguments.out.join("index.html");
    page::page(&suite, &settings, provenance).write(&index)?;
    report::print(&text(arguments, &suite, &index))?;
    Ok(ExitCode::from(u8::from(!suite.pass())))
}

/// How plant and controller are joined.
fn transport(arguments: &Arguments, processor: Option<Processor>) -> anyhow::Result<Transport> {
    Ok(match (arguments.transport, processor) {
        (Way::Inproc, None) => Transport::InProcess,
        (Way::Iceoryx2, None) => Transport::Iceoryx2 { program: std::env::current_exe()? },
        (Way::Inproc, Some(processor)) => {
            let program = arguments.firmware.clone().with_context(|| {
                format!(
                    "--on {0}: which program? `cargo xtask sil --on {0}` builds and names it",
                    arguments.on
                )
            })?;
            Transport::Emulated(Emulation { processor, program })
        }
        (Way::Iceoryx2, Some(_)) => {
            anyhow::bail!("--transport iceoryx2 with --on {}: leave --transport out", arguments.on)
        }
    })
}

/// Flies all scenarios behind a progress bar.
fn fly_suite(scenarios: &[Scenario], settings: &Settings, transport: &Transport) -> anyhow::Result<Suite> {
    let bar = ProgressBar::new(scenarios.len() as u64)
        .with_style(ProgressStyle::with_template("{bar:20} {pos}/{len} {msg}")?);
    let mut flown = 0;
    let suite = Suite::fly(scenarios, settings, transport, |scenario| {
        bar.set_position(flown);
        bar.set_message(scenario.name());
        flown += 1;
    });
    bar.finish_and_clear();
    Ok(suite?)
}

/// The emulated processor of this name; none for this machine's.
fn processor(name: &str) -> anyhow::Result<Option<Processor>> {
    match Processor::named(name) {
        None if name != "host" => {
            anyhow::bail!("--on {name}: not a place to run; use --on host, armv7 or cortex-m4")
        }
        found => Ok(found),
    }
}

/// Compares bit by bit with an emulated processor; status 1 when a bit differs.
fn same_bits(
    arguments: &Arguments,
    processor: Processor,
    program: &std::path::Path,
) -> anyhow::Result<ExitCode> {
    let mut same = true;
    let mut flights = Vec::new();
    let mut text = String::new();
    for flown in sil::same_bits::fly_all(arguments.seed)? {
        let difference = flown.replay(processor, program, &flown.config).map_err(SilError::from)?;
        same &= difference.is_none();
        let (ticks, saturated, sha256) = (flown.ticks.len(), flown.saturated_ticks(), flown.sha256());
        if !arguments.json {
            let name = &flown.name;
            let _ = writeln!(text, "{name}: {ticks} ticks, {saturated} of them saturated, sha256 {sha256}");
            let _ = match &difference {
                None => writeln!(text, "  the same bits on {}", arguments.on),
                Some(found) => writeln!(text, "  DIFFERS from tick {} on: here {:?}", found.tick, found.here),
            };
        }
        flights.push(serde_json::json!({
            "name": flown.name,
            "ticks": ticks,
            "saturated_ticks": saturated,
            "sha256": sha256,
            "differs_at": difference.map(|found| found.tick),
        }));
    }
    if arguments.json {
        let document = serde_json::json!({ "on": arguments.on, "same": same, "flights": flights });
        let _ = writeln!(text, "{document}");
    }
    report::print(&text)?;
    Ok(ExitCode::from(u8::from(!same)))
}

/// Flies a pattern file and leaves its flight file. Exit status 1 where the craft is lost or leaves
/// the cage.
fn fly_pattern(
    arguments: &Arguments,
    path: &std::path::Path,
    settings: Settings,
) -> anyhow::Result<ExitCode> {
    let Settings { model, config, delay_samples, noise, seed, substeps } = settings;
    let pattern = pattern::Pattern::read(path)?;
    let config = sil::for_identification(config.unwrap_or_else(Config::thesis));
    let plan = FlightPlan::pattern(model.unwrap_or_else(Model::thesis), config, pattern, seed);
    let recording = sil::fly(&FlightPlan { delay_samples, noise, substeps, ..plan })?;
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot create the folder {}", arguments.out.display()))?;
    let name =
        path.with_extension("").file_name().map_or("pattern".into(), |n| n.to_string_lossy().into_owned());
    let file = arguments.out.join(format!("{name}-flight.csv"));
    report::write_atomic(&file, recording.to_flight(name, false).to_csv())?;
    let (margin_m, saturated) = (recording.cage_margin_m(), recording.saturated_ticks(config.command_range));
    let pass = recording.complete && margin_m >= 0.0;
    let text = if arguments.json {
        let document = serde_json::json!({
            "pass": pass, "complete": recording.complete, "cage_margin_m": margin_m,
            "saturated_ticks": saturated, "flight": file.display().to_string(),
        });
        format!("{document}\n")
    } else {
        let how = if recording.complete { "flown to its end" } else { "LOST" };
        format!(
            "{}: {how}, {} m from floor and cage at the closest, {saturated} saturated ticks\nflight file: {}\n",
            path.display(),
            report::significant(margin_m, 3),
            file.display()
        )
    };
    report::print(&text)?;
    Ok(ExitCode::from(u8::from(!pass)))
}

/// A soak or a Monte Carlo survey; status 1 where something happened.
fn long_run(arguments: &Arguments, config: Config) -> anyhow::Result<ExitCode> {
    let seed = arguments.seed;
    let (text, holds) = match arguments.soak {
        Some(hours) => {
            anyhow::ensure!(
                hours > 0.0 && hours <= MOST_HOURS,
                "--soak {hours}: give hours, above 0 and up to {MOST_HOURS}"
            );
            let found = soak(&Soak { duration_s: 3600.0 * hours, config, seed })?;
            (found.to_string(), found.holds())
        }
        None => {
            let flights = arguments.monte_carlo.unwrap_or_default();
            let delay_samples = arguments.delay.map(usize::from);
            let plan = MonteCarlo { flights, config, seed, delay_samples };
            let found = survey(&plan, arguments.resume.as_deref())?;
            (found.text(&again(arguments)), found.holds())
        }
    };
    report::print(&text)?;
    Ok(ExitCode::from(u8::from(!holds)))
}

/// The options of a Monte Carlo survey that one of its flights needs too.
fn again(arguments: &Arguments) -> String {
    let mut options = String::new();
    if let Some(delay) = arguments.delay {
        let _ = write!(options, " --delay {delay}");
    }
    if let Some(gains) = &arguments.gains {
        let _ = write!(options, " --gains {}", gains.display());
    }
    options
}

fn failsafes(arguments: &Arguments, config: &Config) -> anyhow::Result<ExitCode> {
    let seeds = arguments.seed..arguments.seed.saturating_add(arguments.seeds.into());
    let (table, all) = sil::failsafe::table(seeds, config)?;
    report::print(&table)?;
    Ok(ExitCode::from(u8::from(!all)))
}

fn text(arguments: &Arguments, suite: &Suite, index: &std::path::Path) -> String {
    if arguments.json {
        return suite.to_json() + "\n";
    }
    format!(
        "{}motor commands sha256 {}\npage and flight files: {}\n",
        page::text_table(suite),
        suite.pwm_sha256,
        index.display()
    )
}
