//! `forms`: how often is a form discovered that no catalogue has?
//!
//! Worlds that share no equation with the product's plant ([`stories::world`]) hide such a form, turbulence, or nothing. The product
//! identifies and discovers from the flights alone, as its user's command does. What the first proposal takes is held against what
//! the same craft leaves in the same patterns without the form: the floor of noise and of the model's own errors. Every second trial
//! has gross outliers in its log. Results depend on the seed and on nothing else.
#![forbid(unsafe_code)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use diagnosis::workflow::{self, FlightSets, Reading, Silent};
use diagnosis::{Discovery, DiscoveryVerdict, Options, Proposal};
use flights::Flight;
use model::{AXES, Effect, Model, PerAxis, QUANTITIES};
use rayon::prelude::*;
use serde_json::json;
use stories::world::{Pattern, Sensors, Size, World, draws};

/// Measure how often forms that no catalogue has are discovered
#[derive(Parser)]
#[command(
    name = "forms",
    version,
    after_help = "Examples:\n  cargo xtask bench forms --seeds 1\n  cargo xtask bench forms --only ceiling wall --strength 0.5 1"
)]
struct Arguments {
    /// Trials of each form on each craft at each strength
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=1000))]
    seeds: u64,

    /// Strengths of the hidden form; 1 is what a pilot would notice
    #[arg(long, value_name = "S", num_args = 1.., default_values_t = [1.0, 0.5, 0.25])]
    strength: Vec<f64>,

    /// Trials with nothing hidden, and as many in turbulence
    #[arg(long, value_name = "N", default_value_t = 10)]
    nothing: u64,

    /// Only these forms
    #[arg(long, value_name = "FORM", num_args = 1..)]
    only: Vec<String>,

    /// First seed
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Write the flights of each trial into a folder of its own under this one, for `quadlab discover`
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,

    /// Write what the basic model leaves in each trial, with all measured quantities, into folders under this one, for
    /// tests/peers/forms.py
    #[arg(long, value_name = "DIR")]
    libraries: Option<PathBuf>,

    /// Length of a flight, s
    #[arg(long, value_name = "S", default_value_t = 24.0)]
    duration: f64,
}

/// A form: its name among those that can be planted, sets of quantities of which one is right, and whether the search knows such a shape.
struct Form {
    id: &'static str,
    quantities: &'static [&'static [&'static str]],
    known: bool,
}

const fn form(id: &'static str, quantities: &'static [&'static [&'static str]]) -> Form {
    Form { id, quantities, known: true }
}

/// A shape or a way to act that the search has not.
const fn strange(id: &'static str, quantities: &'static [&'static [&'static str]]) -> Form {
    Form { id, quantities, known: false }
}

const FORMS: &[Form] = &[
    form("ceiling", &[&["height"]]),
    form("wall", &[&["east"]]),
    form("leak", &[&["time"], &["thrust", "time"], &["time", "u", "v", "w"]]),
    form("one-sided-drag", &[&["u"]]),
    form("settling", &[&["w"], &["thrust", "w"]]),
    form("stall", &[&["thrust"], &["rotor_speed"], &["rotor_speed", "thrust"]]),
    form("hot-motors", &[&["time"], &["thrust", "time"]]),
    form("loose-arm", &[&["omega1"]]),
    form("weathercock", &[&["v"]]),
    form("torsion", &[&["psi"]]),
    form("skewed-drag", &[&["v"]]),
    form("table", &[&["north"]]),
    form("column", &[&["east", "north"]]),
    form("failing", &[&["time"], &["omega2", "time"]]),
    form("heading-drag", &[&["psi", "u"], &["psi", "v"], &["psi", "u", "v"], &["psi", "u", "v", "w"]]),
    form("magnet", &[&["east", "height", "north"]]),
    form("fan", &[&["east", "north"], &["east", "height", "north"]]),
    strange("whirl", &[&["east", "north"]]),
    strange("draught", &[&["east", "north"]]),
    strange("wake-memory", &[&["w"], &["thrust", "w"]]),
    strange("hum", &[&["time"]]),
    strange("turning-wind", &[&["time"]]),
    strange("sluggish", &[&["rotor_speed"], &["rotor_acceleration"], &["rotor_acceleration", "rotor_speed"]]),
    strange("inflow", &[&["rotor_speed"]]),
    strange("bungee", &[]),
    strange("dead-zone", &[&["v"]]),
    strange("square-root-drag", &[&["u"]]),
    strange("ribs", &[&["north"]]),
    strange("bounded-pitching", &[&["u"]]),
    strange("antenna", &[&["v"]]),
    strange("two-lags", &[&["w"], &["thrust", "w"]]),
    strange("gusty-side", &[&["v"]]),
    strange("two-walls", &[&["east"]]),
    strange("wall-and-weathercock", &[&["east", "v"]]),
    strange("ceiling-and-door", &[&["height", "time"]]),
    strange("shear-layer", &[&["height"]]),
    strange("floor-damping", &[&["height", "p", "q"]]),
    strange("lorentz", &[&["north"]]),
    strange("climb", &[&["w"], &["thrust", "w"]]),
    strange("slanting-plane", &[&["height", "north"]]),
    strange("tired", &[&["energy"], &["energy", "thrust"], &["time"], &["thrust", "time"]]),
];

/// A world to be flown.
#[derive(Clone, Copy)]
struct Trial<'a> {
    hidden: Option<&'a Form>,
    /// Of the form, or of turbulence.
    strength: f64,
    size: Size,
    seed: u64,
    duration_s: f64,
}

/// What came of it.
struct Outcome {
    verdict: DiscoveryVerdict,
    known: Vec<Effect>,
    best: Option<Proposal>,
    refused: Option<String>,
    /// What the first proposal takes of what the form adds, percent.
    taken_percent: f64,
}

/// Gusts, where nothing else is planted and the strength is not 0.
const TURBULENCE: &str = "gusts";
/// What a proposal has to take, percent.
const ENOUGH_PERCENT: f64 = 80.0;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    workflow::prepare_to_discover();
    let trials = trials(arguments);
    let done = AtomicUsize::new(0);
    let outcomes: Vec<anyhow::Result<Outcome>> = trials
        .par_iter()
        .map(|trial| {
            let outcome = outcome(trial, arguments);
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            let _ = writeln!(std::io::stderr(), "{count} of {}", trials.len());
            outcome
        })
        .collect();
    let mut out = std::io::stdout();
    let mut judged = Vec::new();
    for (trial, outcome) in trials.iter().zip(outcomes) {
        match outcome {
            Ok(outcome) => {
                writeln!(out, "{}", line(trial, &outcome))?;
                judged.push((trial, outcome));
            }
            Err(why) => writeln!(out, "{}: {why:#}", trial.name())?,
        }
    }
    write!(out, "{}", counts(&judged))?;
    Ok(())
}

fn trials(arguments: &Arguments) -> Vec<Trial<'_>> {
    let mut all = Vec::new();
    let (first, duration_s) = (arguments.seed, arguments.duration);
    let is_asked = |form: &&Form| arguments.only.is_empty() || arguments.only.iter().any(|id| id == form.id);
    for hidden in FORMS.iter().filter(is_asked) {
        for &strength in &arguments.strength {
            for size in Size::MAIN {
                let of = |seed| Trial { hidden: Some(hidden), strength, size, seed, duration_s };
                all.extend((first..first + arguments.seeds).map(of));
            }
        }
    }
    for seed in first..first + arguments.nothing {
        let size = Size::ALL[(seed % 3) as usize];
        // From a breath to a storm.
        let turbulence = [0.3, 0.6, 1.0][(seed / 3 % 3) as usize];
        all.extend([0.0, turbulence].map(|strength| Trial {
            hidden: None,
            strength,
            size,
            seed,
            duration_s,
        }));
    }
    all
}

impl Trial<'_> {
    fn name(&self) -> String {
        let hidden = match self.hidden {
            Some(form) => form.id,
            None if self.strength > 0.0 => TURBULENCE,
            None => "nothing",
        };
        format!("{hidden:16} {:4} {:5} {}", self.strength, self.size.name(), self.seed)
    }

    fn folder(&self) -> String {
        self.name().split_whitespace().map(str::to_lowercase).collect::<Vec<_>>().join("-")
    }

    /// The five flights of a world.
    fn flights(&self, world: &World) -> anyhow::Result<Vec<Flight>> {
        let sensors = Sensors::noisy(1.0);
        let sensors = if self.seed.is_multiple_of(2) { sensors.with_outliers() } else { sensors };
        let patterns = Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE);
        patterns.map(|pattern| Ok(world.fly(pattern, self.duration_s, &sensors, 0)?)).collect()
    }
}

/// A craft that its pilot cannot keep is no answer: another is drawn.
fn outcome(trial: &Trial<'_>, arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut last = None;
    for seed in draws(trial.seed) {
        let trial = Trial { seed, ..*trial };
        let calm = World::new(trial.size, trial.seed);
        let id = trial.hidden.map_or(TURBULENCE, |form| form.id);
        let world = if trial.strength > 0.0 { calm.clone().with(id, trial.strength)? } else { calm.clone() };
        match (trial.flights(&calm), trial.flights(&world)) {
            (Ok(calm_flights), Ok(flights)) => {
                if let Some(folder) = &arguments.keep {
                    world.write(&folder.join(trial.folder()), &flights.iter().collect::<Vec<_>>())?;
                }
                let library = arguments.libraries.as_ref().map(|folder| folder.join(trial.folder()));
                return judged(&calm, &calm_flights, &flights, library.as_deref());
            }
            (Err(why), _) | (_, Err(why)) => last = Some(why),
        }
    }
    Err(last.unwrap_or_else(|| anyhow::anyhow!("no craft was drawn")))
}

/// Discovers, and holds what is found against the calm flights.
fn judged(
    world: &World,
    calm: &[Flight],
    flights: &[Flight],
    library: Option<&Path>,
) -> anyhow::Result<Outcome> {
    let (floor, ..) = identified(world, calm)?;
    let (before, model, mut sets) = identified(world, flights)?;
    if let Some(folder) = library {
        write_library(folder, &model, &sets)?;
    }
    let Discovery { proposals, verdict, known, refused, model, .. } =
        workflow::discover(&model, &[], &mut sets, &Options::default(), &Silent)?;
    let after = squares(&model, &sets);
    let (mut fall, mut all) = (0.0, 0.0);
    for axis in AXES {
        fall += (before[axis] - after[axis]) / floor[axis];
        all += (before[axis] - floor[axis]) / floor[axis];
    }
    let best = proposals.into_iter().next();
    if let Some(folder) = library {
        let of = |squares: &PerAxis<f64>| AXES.map(|axis| squares[axis]);
        let told = json!({ "floor": of(&floor), "before": of(&before), "after": of(&after) });
        report::write_atomic(folder.join("squares.json"), told.to_string())?;
    }
    Ok(Outcome { verdict, known, best, refused, taken_percent: 100.0 * fall / all })
}

/// The basic model of flights, and what it leaves of those held out.
fn identified(world: &World, flights: &[Flight]) -> anyhow::Result<(PerAxis<f64>, Model, FlightSets)> {
    let (train, validate) = flights.split_at(Pattern::TRAIN.len());
    let mut sets = FlightSets::from_flights(train, validate, &world.vehicle, Reading::default(), &Silent)?;
    let model = workflow::identify(&world.vehicle, &[], &mut sets, None, &Silent)?.model;
    Ok((squares(&model, &sets), model, sets))
}

/// Mean squares of what a model leaves of the flights held out.
fn squares(model: &Model, sets: &FlightSets) -> PerAxis<f64> {
    let total = sysid::compare::compare(model, &sets.validate()).total;
    PerAxis::from_fn(|axis| total[axis].rms * total[axis].rms)
}

/// Rows of all flights: which is held out, measured quantities as the rows' filter leaves them, and what the model leaves.
fn write_library(folder: &Path, model: &Model, sets: &FlightSets) -> anyhow::Result<()> {
    let quantities: Vec<_> = QUANTITIES.iter().collect();
    let names = quantities.iter().map(|quantity| quantity.name).chain(["time"]);
    let axes = AXES.map(|axis| format!("left_{}", axis.name()));
    let mut text = format!("held_out,{},{}\n", names.collect::<Vec<_>>().join(","), axes.join(","));
    for (held_out, flights) in [("0", sets.train()), ("1", sets.validate())] {
        for flight in flights {
            let mut columns: Vec<Vec<f64>> =
                quantities.iter().map(|quantity| flight.quantity(model, quantity)).collect();
            columns.push(flight.conditions(&model.vehicle, &model.adjustments()).time_s);
            columns.extend(sysid::residuals(flight, model).residual);
            for row in 0..columns[0].len() {
                let values = columns.iter().map(|column| column[row].to_string());
                text.push_str(&format!("{held_out},{}\n", values.collect::<Vec<_>>().join(",")));
            }
        }
    }
    std::fs::create_dir_all(folder)?;
    Ok(report::write_atomic(folder.join("rows.csv"), text)?)
}

impl Outcome {
    /// Whether the first proposal depends on what the form depends on.
    fn is_named(&self, form: &Form) -> bool {
        self.best.as_ref().is_some_and(|best| form.quantities.contains(&&best.quantities[..]))
    }

    fn is_enough(&self) -> bool {
        self.taken_percent >= ENOUGH_PERCENT
    }
}

fn line(trial: &Trial<'_>, outcome: &Outcome) -> String {
    let named = match trial.hidden {
        Some(form) if outcome.is_named(form) => "right",
        Some(_) => "OTHER",
        None if outcome.best.is_some() => "FALSE",
        None => "",
    };
    let said = match (&outcome.best, &outcome.refused) {
        (Some(best), _) => {
            format!("{} of {} (p {:.0e})", best.formula, best.quantities.join(", "), best.p_value)
        }
        (None, why) => format!("{:?} {}", outcome.verdict, why.as_deref().unwrap_or_default()),
    };
    let known: Vec<&str> = outcome.known.iter().map(|effect| effect.id()).collect();
    format!("{} {:6.1} % {named:5} [{}] {said}", trial.name(), outcome.taken_percent, known.join(" "))
}

/// The counts that matter.
fn counts(judged: &[(&Trial<'_>, Outcome)]) -> String {
    let mut text = String::new();
    let mut count =
        |what: &str, of: &dyn Fn(&Trial<'_>) -> bool, hit: &dyn Fn(&Trial<'_>, &Outcome) -> bool| {
            let of: Vec<_> = judged.iter().filter(|(trial, _)| of(trial)).collect();
            let hits = of.iter().filter(|(trial, outcome)| hit(trial, outcome)).count();
            if !of.is_empty() {
                text.push_str(&format!("{what}: {hits} of {}\n", of.len()));
            }
        };
    for (known, which) in [(true, "forms that the search knows"), (false, "other forms")] {
        let of = |trial: &Trial<'_>| trial.hidden.is_some_and(|form| form.known == known);
        let is_named = |trial: &Trial<'_>, o: &Outcome| trial.hidden.is_some_and(|form| o.is_named(form));
        count(&format!("{which}: 80 % taken"), &of, &|_, outcome| outcome.is_enough());
        count(&format!("{which}: quantities right"), &of, &is_named);
    }
    let proposes = |_: &Trial<'_>, outcome: &Outcome| outcome.best.is_some();
    count(
        "nothing hidden: something proposed",
        &|trial| trial.hidden.is_none() && trial.strength == 0.0,
        &proposes,
    );
    count(
        "turbulence: something proposed",
        &|trial| trial.hidden.is_none() && trial.strength > 0.0,
        &proposes,
    );
    text
}
