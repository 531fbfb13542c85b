//! `quadlab excite`: a pattern file for an informative flight, and what it will tell, before it is
//! flown.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use control::Config;
use diagnosis::planning::information::{Expected, Parameter};
use model::Model;
use pattern::{Pattern, relative_peak_factor};
use report::number::{fixed, unit, value_and_error};
use report::significant;
use schemars::JsonSchema;
use serde::Serialize;
use sil::manoeuvre::{Injection, Signal, library};
use sil::next_flight::{BAND_HZ, GENTLE, known_error};
use sil::predict::{Course, Foreseen, Predictor, Prospect};

use crate::cli::next_flight::predictor;
use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::cli::progress;
use crate::render::excite_page;

/// Write an informative flight pattern, and predict how well it determines the model's coefficients.
///
/// The current model flies the pattern in simulation. The Fisher information of that flight, for
/// residuals coloured like those of real fits, gives the standard error of each coefficient and shows
/// which effects of the catalogue would stay unseen. Exit status 1 if the craft cannot fly it.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab excite --model model.toml --out pattern.csv\n  quadlab excite --model model.toml --path hover --signal thesis --amplitude 20 --seed 3 --out pattern.csv\n  quadlab excite --model model.toml --pattern pattern.csv      # only predict what it would show"
)]
pub(crate) struct Options {
    /// Model file: what is known so far, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Gains file of the controller that will fly it [default: gains designed for the model]
    #[arg(long, value_name = "TOML")]
    gains: Option<PathBuf>,

    /// Path to fly: hover, yaw-round, yaw-swings, height-steps, low-flight, climbs,
    /// dashes-forward, dashes-sideways, dashes-yawed, shuttle, circle, tour
    #[arg(long, value_name = "NAME", default_value = "tour")]
    path: String,

    /// Signal that is added to the motor commands
    #[arg(long, value_enum, default_value_t = Word::Multisine)]
    signal: Word,

    /// Amplitude, in command units, of a sine with the same power [default: 1.5 % of the command range]
    #[arg(long, value_name = "COMMAND", allow_negative_numbers = true)]
    amplitude: Option<f64>,

    /// Lowest and highest frequency of multisines and sweeps, Hz; the highest below half the sampling rate
    #[arg(long, value_name = "HZ", num_args = 2, default_values_t = BAND_HZ)]
    band: Vec<f64>,

    /// Duration, s; also the period of a multisine. Making a multisine of 60 s takes seconds, one of 300 s minutes
    #[arg(long, value_name = "S", default_value_t = 20.0)]
    duration: f64,

    /// Seed of random sines, phases and the tour
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Assess this pattern file instead of making one
    #[arg(long, value_name = "CSV", conflicts_with_all = ["path", "signal", "amplitude", "band", "duration", "out"])]
    pattern: Option<PathBuf>,

    /// Pattern file to write, for example: --out pattern.csv
    #[arg(long, value_name = "CSV", required_unless_present = "pattern")]
    out: Option<PathBuf>,

    /// Write a page with figures, for example: --html pattern.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Word {
    /// Random sines of the thesis (4.2.1)
    Thesis,
    /// Orthogonal multisines with a low peak factor
    Multisine,
    /// Linear frequency sweeps, one motor after the other
    LinearSweep,
    /// Logarithmic frequency sweeps, one motor after the other
    LogSweep,
    /// Nothing
    None,
}

#[derive(Debug, thiserror::Error)]
enum ExciteError {
    #[error("--path {given}: no such path; known are {known}")]
    NoPath { given: String, known: String },
    #[error("--duration {0}: give 8 to 600 seconds")]
    Duration(f64),
    #[error(
        "--band {} {}: the signal is sampled at {rate_hz} Hz, which shows only frequencies below {} Hz; give a lower band", .band_hz[0], .band_hz[1], 0.5 * rate_hz
    )]
    Band { band_hz: [f64; 2], rate_hz: f64 },
    #[error("--amplitude {0}: give a positive number of command units, at most half the command range")]
    Amplitude(f64),
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document {
    pattern: Option<String>,
    duration_s: f64,
    injection: InjectionEntry,
    flight: FlightEntry,
    noise: [f64; 6],
    coefficients: Vec<CoefficientEntry>,
    cannot_be_told_apart: Vec<String>,
    effects: Vec<EffectEntry>,
}

#[derive(Serialize, JsonSchema)]
struct InjectionEntry {
    relative_peak_factor: [Option<f64>; 4],
    peak: [f64; 4],
    largest_correlation: f64,
}

#[derive(Serialize, JsonSchema)]
struct FlightEntry {
    roll_deg: f64,
    pitch_deg: f64,
    position_m: [[f64; 2]; 3],
    speed_m_s: f64,
    saturated_ticks: usize,
    command_correlation: [[f64; 4]; 4],
    trouble: Option<String>,
}

#[derive(Serialize, JsonSchema)]
struct CoefficientEntry {
    effect: &'static str,
    name: &'static str,
    unit: &'static str,
    value: f64,
    std_error: Option<f64>,
    std_error_known: Option<f64>,
}

#[derive(Serialize, JsonSchema)]
struct EffectEntry {
    effect: &'static str,
    excited: bool,
    deviations: Option<f64>,
    share_percent: Option<f64>,
    to_see_it: &'static str,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let inputs: Vec<&PathBuf> =
        std::iter::once(&options.model).chain(&options.gains).chain(&options.pattern).collect();
    options.output.check(options.out.iter().chain(&options.html), &inputs)?;
    let model = Model::read_to_simulate(&options.model)?;
    let given = options.pattern.as_ref().map(|path| Pattern::read(path)).transpose()?;
    let predictor = predictor(&model, &options.model, options.gains.as_deref(), options.seed)?;
    let pattern = match given {
        Some(pattern) => pattern,
        None => made(options, predictor.config())?,
    };
    let json = options.output.json;
    let foreseen =
        progress::during("flying the pattern in simulation", json, || predictor.foresee(&pattern))?;
    let document = document(options, &predictor, &pattern, &foreseen);
    let holds = document.flight.trouble.is_none();
    if let (Some(out), true) = (&options.out, holds) {
        report::write_atomic(out, pattern.to_csv())?;
    }
    if let Some(html) = &options.html {
        let files: Vec<&Path> = inputs.iter().map(|p| p.as_path()).collect();
        excite_page::page(described(&document, false), &pattern, &predictor)?
            .provenance(provenance(&files, []))
            .write(html)?;
    }
    let outcome = if options.output.json {
        Outcome::json(&document)?
    } else {
        Outcome::done(described(&document, options.out.is_some()))
    };
    Ok(Outcome { holds, ..outcome })
}

fn made(options: &Options, config: &Config) -> anyhow::Result<Pattern> {
    if !(8.0..=600.0).contains(&options.duration) {
        return Err(ExciteError::Duration(options.duration).into());
    }
    let [low, high] = config.command_range;
    let amplitude = options.amplitude.unwrap_or(GENTLE * (high - low));
    if !(amplitude > 0.0 && amplitude <= 0.5 * (high - low)) {
        return Err(ExciteError::Amplitude(amplitude).into());
    }
    let all = library(options.duration, options.seed);
    let Some(manoeuvre) = all.iter().find(|m| m.name == options.path) else {
        let known = all.iter().map(|m| m.name).collect::<Vec<_>>().join(", ");
        return Err(ExciteError::NoPath { given: options.path.clone(), known }.into());
    };
    let band_hz = [options.band[0], options.band[1]];
    let rate_hz = 1.0 / config.sample_time_s;
    let has_band = !matches!(options.signal, Word::Thesis | Word::None);
    if has_band && !(band_hz[1] < 0.5 * rate_hz) {
        return Err(ExciteError::Band { band_hz, rate_hz }.into());
    }
    let signal = match options.signal {
        Word::Thesis => Signal::Thesis,
        Word::Multisine => Signal::Multisine,
        Word::LinearSweep => Signal::LinearSweep,
        Word::LogSweep => Signal::LogSweep,
        Word::None => Signal::None,
    };
    let injection = Injection { signal, amplitude, band_hz, seed: options.seed };
    let path = options.out.as_deref().unwrap_or(Path::new("pattern"));
    // The phases of a multisine take a time that grows with the square of its duration.
    let make = || manoeuvre.pattern(&injection, config.sample_time_s, options.duration, path);
    Ok(progress::during("making the signal", options.output.json, make)?)
}

fn document(options: &Options, predictor: &Predictor, pattern: &Pattern, foreseen: &Foreseen) -> Document {
    let model = predictor.model();
    let (expected, alike) = match foreseen.information.expected(&model.effects()) {
        Ok(expected) => (Some(expected), Vec::new()),
        Err(alike) => (None, alike.0.iter().map(name).collect()),
    };
    let written = options.out.as_ref().filter(|_| foreseen.course.trouble.is_none());
    Document {
        pattern: written.map(|p| p.display().to_string()),
        duration_s: pattern.duration_s(),
        injection: injected(pattern),
        flight: flight(&foreseen.course),
        noise: predictor.noise(),
        coefficients: coefficients(model, expected.as_ref()),
        cannot_be_told_apart: alike,
        effects: predictor.prospects(&foreseen.information).iter().map(effect).collect(),
    }
}

fn name(p: &Parameter) -> String {
    format!("{} of {}", p.info().name, p.effect)
}

fn injected(pattern: &Pattern) -> InjectionEntry {
    let motor = |k: usize| -> Vec<f64> { pattern.rows().iter().map(|row| row.injection[k]).collect() };
    let motors: [Vec<f64>; 4] = std::array::from_fn(motor);
    let peak = motors.each_ref().map(|m| m.iter().fold(0.0_f64, |a, b| a.max(b.abs())));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut largest = 0.0_f64;
    for a in 0..4 {
        for b in 0..a {
            let power = dot(&motors[a], &motors[a]) * dot(&motors[b], &motors[b]);
            if power > 0.0 {
                largest = largest.max((dot(&motors[a], &motors[b]) / power.sqrt()).abs());
            }
        }
    }
    InjectionEntry {
        relative_peak_factor: std::array::from_fn(|k| {
            (peak[k] > 0.0).then(|| relative_peak_factor(&motors[k]))
        }),
        peak,
        largest_correlation: largest,
    }
}

fn flight(course: &Course) -> FlightEntry {
    FlightEntry {
        roll_deg: course.tilt_rad[0].to_degrees(),
        pitch_deg: course.tilt_rad[1].to_degrees(),
        position_m: course.position_m,
        speed_m_s: course.speed_m_s,
        saturated_ticks: course.saturated_ticks,
        command_correlation: course.correlation,
        trouble: course.trouble.clone(),
    }
}

fn coefficients(model: &Model, expected: Option<&Expected>) -> Vec<CoefficientEntry> {
    let entry = |effect: model::Effect, index: usize, value: f64| {
        let parameter = Parameter { effect, index };
        let info = parameter.info();
        CoefficientEntry {
            effect: effect.id(),
            name: info.name,
            unit: info.unit_for(model.rotor_quantity()),
            value,
            std_error: expected.and_then(|e| e.std_error(parameter)),
            std_error_known: known_error(model, parameter),
        }
    };
    let terms = model.terms.iter();
    terms
        .flat_map(|t| t.coefficients.iter().enumerate().map(move |(k, c)| (t.effect, k, c.value)))
        .map(|(effect, index, value)| entry(effect, index, value))
        .collect()
}

fn effect(prospect: &Prospect) -> EffectEntry {
    let info = prospect.effect.info();
    EffectEntry {
        effect: info.id,
        excited: prospect.is_excited(),
        deviations: prospect.sight.map(|s| s.deviations),
        share_percent: prospect.sight.map(|s| s.share_percent),
        to_see_it: info.excitation,
    }
}

/// `wanted`: whether a pattern file was asked for.
fn described(document: &Document, wanted: bool) -> String {
    let mut text = String::new();
    describe_flight(&mut text, document);
    describe_injection(&mut text, document);
    let noise: Vec<String> = document.noise.iter().map(|n| significant(*n, 2)).collect();
    let _ = writeln!(
        text,
        "Assumed residual: u v w {} m/s^2, p q r {} rad/s^2",
        noise[..3].join(" "),
        noise[3..].join(" ")
    );
    if !document.cannot_be_told_apart.is_empty() {
        let _ = writeln!(text, "\nCannot be told apart: {}", document.cannot_be_told_apart.join(", "));
    }
    describe_coefficients(&mut text, document);
    describe_effects(&mut text, document);
    text.push('\n');
    if let Some(path) = &document.pattern {
        let _ = writeln!(text, "\npattern file: {path}");
    } else if wanted {
        text.push_str("\nno pattern file written\n");
    }
    text
}

fn describe_flight(text: &mut String, document: &Document) {
    let f = &document.flight;
    if let Some(trouble) = &f.trouble {
        let _ = writeln!(
            text,
            "DO NOT FLY THIS: {trouble}. Try a smaller --amplitude, another --path, or gains for this model (--gains).\n"
        );
    }
    let [x, y, z] = f.position_m;
    let _ = writeln!(
        text,
        "Flight of {} s: roll up to {:.1}, pitch up to {:.1} deg, {:.1} m/s; x {:.2} to {:.2}, y {:.2} to {:.2}, height \
         {:.2} to {:.2} m; {} saturated samples",
        document.duration_s,
        f.roll_deg,
        f.pitch_deg,
        f.speed_m_s,
        x[0],
        x[1],
        y[0],
        y[1],
        -z[1],
        -z[0],
        f.saturated_ticks
    );
}

fn describe_injection(text: &mut String, document: &Document) {
    let i = &document.injection;
    let factors: Vec<String> =
        i.relative_peak_factor.iter().map(|v| v.map_or_else(|| "-".into(), |v| format!("{v:.2}"))).collect();
    let _ = writeln!(
        text,
        "Signals on the motors: peaks {}, relative peak factors {} (a sine has 1), correlation between motors at most \
         {:.3}; between the commands as flown at most {:.2}",
        i.peak.map(|p| significant(p, 3)).join(" "),
        factors.join(" "),
        i.largest_correlation,
        largest(&document.flight.command_correlation)
    );
}

fn describe_coefficients(text: &mut String, document: &Document) {
    let _ = writeln!(
        text,
        "\n{:<19}{:<16}{:>11}{:>12}{:>9}{:>12}  unit",
        "effect", "coefficient", "value", "std. error", "percent", "so far"
    );
    for c in &document.coefficients {
        let number = |v: Option<f64>| v.map_or_else(|| "-".into(), |v| significant(v, 2));
        let [value, error] = value_and_error(c.value, c.std_error);
        let percent = c.std_error.map(|e| 100.0 * e / c.value.abs()).filter(|p| p.is_finite());
        let _ = writeln!(
            text,
            "{:<19}{:<16}{:>11}{:>12}{:>9}{:>12}  {}",
            c.effect,
            c.name,
            value,
            error,
            number(percent),
            number(c.std_error_known),
            unit(c.unit)
        );
    }
}

/// Effects that the flight would show, and those that it would not.
fn describe_effects(text: &mut String, document: &Document) {
    let (seen, unseen): (Vec<&EffectEntry>, Vec<&EffectEntry>) =
        document.effects.iter().partition(|e| e.excited);
    let seen: Vec<String> =
        seen.iter().map(|e| format!("{} ({:.0})", e.effect, e.deviations.unwrap_or(0.0))).collect();
    let none = |list: String| if list.is_empty() { "none".into() } else { list };
    let _ = writeln!(
        text,
        "\nWould be found at their typical size (in brackets: standard errors from zero): {}",
        none(seen.join(", "))
    );
    text.push_str("Not excited:");
    if unseen.is_empty() {
        text.push_str(" none\n");
    }
    for e in unseen {
        let how = match (e.deviations, e.share_percent) {
            (Some(d), Some(s)) => {
                format!("{} standard errors, {} % of the squared error", fixed(d, 1), fixed(s, 2))
            }
            _ => "does not act in this flight, or acts exactly like something else".into(),
        };
        let _ = write!(text, "\n  {:<22}{how}; to see it: {}", e.effect, e.to_see_it);
    }
}

fn largest(correlation: &[[f64; 4]; 4]) -> f64 {
    let mut largest = 0.0_f64;
    for (a, row) in correlation.iter().enumerate() {
        largest = row[..a].iter().fold(largest, |m, v| m.max(v.abs()));
    }
    largest
}
