//! `quadlab linearize`: equilibrium, A, B, C, D, and the transfer function of each channel.

use std::fmt::Write as _;
use std::path::PathBuf;

use design::Complex;
use design::plant::{CANCEL_TOLERANCE, Channel, Linear};
use design::plant::{INPUT_UNITS, INPUTS, STATE_UNITS, STATES, TrimTarget};
use model::{Model, Plant};
use report::significant;
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::output::Outcome;

/// Linearise a model about an equilibrium: A, B, C, D and the transfer function of each channel.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  quadlab linearize --model model.toml\n\nA trim file for --at (every field may be left out):\n  velocity_ned_m_s = [2.0, 0.0, 0.0]\n  yaw_rad = 0.0\n  z_m = -1.0\n  battery_v = 11.1"
)]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Equilibrium to linearise about: "hover", or a trim file with the motion to hold
    #[arg(long, value_name = "hover|TOML", default_value = "hover")]
    at: PathBuf,

    /// Relative distance (a fraction) below which a pole and a zero cancel; 0 keeps them all
    #[arg(long, value_name = "SHARE", default_value_t = CANCEL_TOLERANCE)]
    cancel: f64,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document {
    vehicle: String,
    equilibrium: EquilibriumEntry,
    states: Vec<Named>,
    inputs: Vec<Named>,
    a: Vec<Vec<f64>>,
    b: Vec<Vec<f64>>,
    c: Vec<Vec<f64>>,
    d: Vec<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    b_input_derivative: Option<Vec<Vec<f64>>>,
    motor_lag_rad_s: Option<f64>,
    input_delay_s: f64,
    cancel_tolerance: f64,
    channels: Vec<ChannelEntry>,
}

#[derive(Serialize, JsonSchema)]
struct EquilibriumEntry {
    cost: f64,
    iterations: u64,
    state: [f64; 12],
    input: [f64; 4],
    rotor_rad_s: [f64; 4],
    /// Motor commands that the rotors need, in command units; absent where the vehicle file has no motor map.
    #[serde(skip_serializing_if = "Option::is_none")]
    command: Option<[f64; 4]>,
    /// Whether these are in the vehicle's command range.
    #[serde(skip_serializing_if = "Option::is_none")]
    within_command_range: Option<bool>,
    battery_v: f64,
}

#[derive(Serialize, JsonSchema)]
struct Named {
    name: &'static str,
    unit: &'static str,
}

#[derive(Serialize, JsonSchema)]
struct ChannelEntry {
    name: &'static str,
    input: &'static str,
    output: &'static str,
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    gain: f64,
    zeros: Vec<[f64; 2]>,
    poles: Vec<[f64; 2]>,
    states: Vec<&'static str>,
    cancelled: Vec<CancelledEntry>,
}

#[derive(Serialize, JsonSchema)]
struct CancelledEntry {
    pole: [f64; 2],
    zero: [f64; 2],
    distance_percent: f64,
}

/// A value of `--cancel` out of its range.
#[derive(Debug, thiserror::Error)]
#[error("--cancel {0}: give a share from 0 to 0.5")]
struct NoTolerance(f64);

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    if !(0.0..=0.5).contains(&options.cancel) {
        return Err(NoTolerance(options.cancel).into());
    }
    let target = match options.at.to_str() {
        Some("hover") => TrimTarget::default(),
        _ => TrimTarget::read(&options.at)?,
    };
    let model = Model::read_to_linearize(&options.model)?;
    let linear = Linear::new(&model, &target)?;
    let channels = linear.channels(options.cancel)?;
    if options.json {
        return Outcome::json(&document(options, &model, &linear, &channels));
    }
    Ok(Outcome::done(text(&model, &linear, &channels)))
}

/// Motor commands that hold the equilibrium, where the vehicle file can tell them.
fn commands(model: &Model, linear: &Linear) -> Option<[f64; 4]> {
    let e = &linear.equilibrium;
    let plant = || Plant::new(model).command_for(&e.rotor_rad_s, e.battery_v);
    model.vehicle.can_map_commands().then(plant)
}

fn is_within_range(model: &Model, command: &[f64; 4]) -> bool {
    let [low, high] = model.vehicle.motors.command_range;
    command.iter().all(|command| (low..=high).contains(command))
}

/// That the craft cannot fly at the equilibrium.
fn beyond_range(model: &Model, linear: &Linear) -> Option<String> {
    let command = commands(model, linear).filter(|command| !is_within_range(model, command))?;
    let [low, high] = model.vehicle.motors.command_range;
    Some(format!(
        "BEYOND THE COMMAND RANGE: the motors need commands of {} {}, and the vehicle takes {low} to {high}; the craft cannot hold this \
         equilibrium",
        command.map(|command| format!("{command:.0}")).join(" "),
        model.vehicle.motors.command_unit
    ))
}

fn named(names: &'static [&'static str], units: &'static [&'static str]) -> Vec<Named> {
    names.iter().zip(units).map(|(name, unit)| Named { name, unit }).collect()
}

fn rows(count: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
    (0..count).map(|i| (0..columns).map(|j| entry(i, j)).collect()).collect()
}

fn document(options: &Options, model: &Model, linear: &Linear, channels: &[Channel]) -> Document {
    let e = &linear.equilibrium;
    let command = commands(model, linear);
    let moved = linear.b_derivative.iter().any(|x| *x != 0.0);
    Document {
        vehicle: model.vehicle.name.clone(),
        equilibrium: EquilibriumEntry {
            cost: e.cost,
            iterations: e.iterations,
            state: e.state,
            input: e.inputs,
            rotor_rad_s: e.rotor_rad_s,
            command,
            within_command_range: command.map(|command| is_within_range(model, &command)),
            battery_v: e.battery_v,
        },
        states: named(&STATES, &STATE_UNITS),
        inputs: named(&INPUTS, &INPUT_UNITS),
        a: rows(12, 12, |i, j| linear.a[(i, j)]),
        b: rows(12, 4, |i, j| linear.b[(i, j)]),
        c: rows(12, 12, |i, j| f64::from(i == j)),
        d: rows(12, 4, |_, _| 0.0),
        b_input_derivative: moved.then(|| rows(12, 4, |i, j| linear.b_derivative[(i, j)])),
        motor_lag_rad_s: linear.motor_lag_rad_s,
        input_delay_s: linear.input_delay_s,
        cancel_tolerance: options.cancel,
        channels: channels.iter().map(entry).collect(),
    }
}

fn entry(channel: &Channel) -> ChannelEntry {
    let cancelled = channel.cancelled.iter().map(|pair| CancelledEntry {
        pole: [pair.pole.re, pair.pole.im],
        zero: [pair.zero.re, pair.zero.im],
        distance_percent: 100.0 * pair.distance(),
    });
    ChannelEntry {
        name: channel.id.name,
        input: INPUTS[channel.id.input],
        output: STATES[channel.id.output],
        numerator: channel.numerator(),
        denominator: channel.denominator(),
        gain: channel.gain,
        zeros: channel.zeros.iter().map(|z| [z.re, z.im]).collect(),
        poles: channel.poles.iter().map(|p| [p.re, p.im]).collect(),
        states: channel.states.clone(),
        cancelled: cancelled.collect(),
    }
}

/// A number for a table, with zero as "0".
fn number(x: f64) -> String {
    // What rounding leaves of an equilibrium says nothing.
    if x.abs() < 1e-9 { "0".into() } else { significant(x, 5) }
}

pub(crate) fn text(model: &Model, linear: &Linear, channels: &[Channel]) -> String {
    let mut text = String::new();
    let e = &linear.equilibrium;
    let _ = writeln!(text, "Equilibrium (5.13), cost J = {:.2e} after {} iterations", e.cost, e.iterations);
    for (name, unit, value) in (0..12)
        .map(|i| (STATES[i], STATE_UNITS[i], e.state[i]))
        .chain((0..4).map(|i| (INPUTS[i], INPUT_UNITS[i], e.inputs[i])))
        .filter(|(name, _, value)| value.abs() >= 1e-9 || INPUTS.contains(name))
    {
        let _ = writeln!(text, "  {name} = {} {unit}", number(value));
    }
    let speeds: Vec<String> = e.rotor_rad_s.iter().map(|w| significant(*w, 6)).collect();
    let _ = writeln!(
        text,
        "  rotors {} {} at {} V; all other states 0",
        speeds.join(" "),
        model.rotor_quantity().unit(),
        number(e.battery_v)
    );
    if let Some(beyond) = beyond_range(model, linear) {
        let _ = writeln!(text, "  {beyond}");
    }
    matrix(&mut text, "A", &STATES, |i, j| linear.a[(i, j)]);
    matrix(&mut text, "B", &INPUTS, |i, j| linear.b[(i, j)]);
    if linear.b_derivative.iter().any(|x| *x != 0.0) {
        matrix(&mut text, "N (of the inputs' derivative)", &INPUTS, |i, j| linear.b_derivative[(i, j)]);
    }
    text.push_str("\nC is the identity, D is zero. States: ");
    let states: Vec<String> = STATES.iter().zip(STATE_UNITS).map(|(s, u)| format!("{s} [{u}]")).collect();
    let inputs: Vec<String> = INPUTS.iter().zip(INPUT_UNITS).map(|(s, u)| format!("{s} [{u}]")).collect();
    let _ = writeln!(text, "{}\nInputs: {}", states.join(", "), inputs.join(", "));
    match linear.motor_lag_rad_s {
        Some(lag) => {
            let _ = writeln!(text, "Before each input: the rotors' lag {0}/(s + {0}).", significant(lag, 5));
        }
        None => text.push_str("The model has no motor lag.\n"),
    }
    for channel in channels {
        describe(&mut text, channel);
    }
    text
}

fn matrix(text: &mut String, name: &str, columns: &[&str], entry: impl Fn(usize, usize) -> f64) {
    let _ = write!(text, "\n{name}\n{:>6}", "");
    for column in columns {
        let _ = write!(text, "{column:>10}");
    }
    for (i, state) in STATES.iter().enumerate() {
        let _ = write!(text, "\n{state:>6}");
        for j in 0..columns.len() {
            let _ = write!(text, "{:>10}", number(entry(i, j)));
        }
    }
    text.push('\n');
}

fn polynomial(coefficients: &[f64]) -> String {
    let degree = coefficients.len() - 1;
    let mut text = String::new();
    for (k, value) in coefficients.iter().enumerate() {
        let power = degree - k;
        if value.abs() < 1e-9 {
            continue;
        }
        let sign = match (text.is_empty(), *value < 0.0) {
            (true, false) => "",
            (true, true) => "-",
            (false, false) => " + ",
            (false, true) => " - ",
        };
        let size = significant(value.abs(), 5);
        let factor = if size == "1" || size == "1.0000" {
            if power == 0 { "1".to_owned() } else { String::new() }
        } else {
            size
        };
        let unknown = match power {
            0 => String::new(),
            1 => "s".into(),
            _ => format!("s^{power}"),
        };
        let space = if factor.is_empty() || unknown.is_empty() { "" } else { " " };
        text.push_str(&format!("{sign}{factor}{space}{unknown}"));
    }
    if text.is_empty() { "0".into() } else { text }
}

/// Roots in words: each conjugate pair once.
fn roots(roots: &[Complex<f64>]) -> String {
    let shown: Vec<String> = roots
        .iter()
        .filter(|root| root.im >= 0.0)
        .map(|root| match root.im == 0.0 {
            true => number(root.re),
            false => format!("{} +- {}j", number(root.re), number(root.im)),
        })
        .collect();
    if shown.is_empty() { "none".into() } else { shown.join(", ") }
}

fn describe(text: &mut String, channel: &Channel) {
    let id = channel.id;
    let _ = writeln!(
        text,
        "\n{}: {}/{} = ({}) / ({})",
        id.name,
        STATES[id.output],
        INPUTS[id.input],
        polynomial(&channel.numerator()),
        polynomial(&channel.denominator())
    );
    let _ = writeln!(
        text,
        "  poles {}; zeros {}; gain {}",
        roots(&channel.poles),
        roots(&channel.zeros),
        number(channel.gain)
    );
    if !channel.cancelled.is_empty() {
        let pairs: Vec<String> = channel
            .cancelled
            .iter()
            .filter(|pair| pair.pole.im >= 0.0)
            .map(|pair| {
                format!(
                    "pole {} with zero {} ({} % apart)",
                    roots(&[pair.pole]),
                    roots(&[pair.zero]),
                    significant(100.0 * pair.distance(), 2)
                )
            })
            .collect();
        let _ = writeln!(text, "  minimal: cancelled {}", pairs.join("; "));
    }
    let left_out: Vec<&str> = STATES.iter().copied().filter(|s| !channel.states.contains(s)).collect();
    let _ = writeln!(text, "  states that take no part: {}", left_out.join(" "));
}
