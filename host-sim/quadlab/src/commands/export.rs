//! `quadlab export`: a model in the words of another simulator or design tool.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use design::plant::TrimTarget;
use export::{LeftOut, Target};
use model::{Model, physical_parameters};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::output::{Outcome, OutputOptions};
use crate::render::tables;

/// Write a model for another simulator or design tool.
///
/// What the file omits or approximates is listed in it and on standard output.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  quadlab export --model model.toml --to mujoco --out craft.xml\n  \
                        quadlab export --model model.toml --to python-control --out craft.py")]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Target tool
    #[arg(long, value_name = "TOOL")]
    to: To,

    /// Gains file, for --to c only, for example: --gains gains.toml
    #[arg(long, value_name = "TOML")]
    gains: Option<PathBuf>,

    /// For design tools only: equilibrium to linearise about, "hover" or a trim file with the motion to hold, as for linearize
    #[arg(long, value_name = "hover|TOML", default_value = "hover")]
    at: PathBuf,

    /// File to write, for example: --out craft.xml
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum To {
    /// MuJoCo: an MJCF file; the controls are the rotors' thrusts
    Mujoco,
    /// Gazebo: an SDFormat file with its motor model on each rotor; the commands are the rotors' speeds
    Gazebo,
    /// rotorpy: a Python file with the parameters of its Multirotor
    Rotorpy,
    /// PX4: parameters of its simulation-in-hardware (SIH) and rotor geometry for control allocation, for QGroundControl
    Px4,
    /// python-control: state space, rotors and transfer functions about an equilibrium
    #[value(alias = "control")]
    PythonControl,
    /// GNU Octave and MATLAB (`matlab` is the same): as python-control
    #[value(alias = "matlab")]
    Octave,
    /// C and Simulink: gains as a header for the flight law as a static library (firmware/law-c)
    #[value(alias = "simulink")]
    C,
}

impl To {
    /// The tool that gets the model; nothing where the gains go.
    const fn target(self) -> Option<Target> {
        Some(match self {
            Self::Mujoco => Target::Mujoco,
            Self::Gazebo => Target::Gazebo,
            Self::Rotorpy => Target::Rotorpy,
            Self::Px4 => Target::Px4,
            Self::PythonControl => Target::PythonControl,
            Self::Octave => Target::Octave,
            Self::C => return None,
        })
    }

    /// Whether the tool gets the model linear about an equilibrium.
    const fn is_linear(self) -> bool {
        matches!(self, Self::PythonControl | Self::Octave)
    }
}

/// A motion to hold, for a tool that asks for none.
#[derive(Debug, thiserror::Error)]
#[error("--at {}: applies to design tools only (python-control, octave); leave it out", .0.display())]
struct NoEquilibrium(PathBuf);

/// Gains for a tool that gets the model.
#[derive(Debug, thiserror::Error)]
#[error("--gains {}: applies to --to c only; leave it out", .0.display())]
struct NoGains(PathBuf);

/// No gains for a tool that gets these.
#[derive(Debug, thiserror::Error)]
#[error("--to c (simulink) needs --gains; give the gains file, for example: --gains gains.toml")]
struct GainsMissing;

/// What to do with the header.
const FOR_C: &str = "include it beside quadlab_law.h of firmware/law-c, and link with libquadlab_law.a (cargo build --release --package law-c)";

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    file: &'a Path,
    /// What of the model is not in the file, or not as it is.
    left_out: &'a [LeftOut],
    /// Physical parameters of the craft.
    physical: Vec<Physical>,
}

#[derive(Serialize, JsonSchema)]
struct Physical {
    symbol: &'static str,
    name: &'static str,
    value: f64,
    std_error: Option<f64>,
    unit: &'static str,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let hover = options.at.as_os_str() == "hover";
    if !hover && !options.to.is_linear() {
        return Err(NoEquilibrium(options.at.clone()).into());
    }
    let Some(to) = options.to.target() else { return run_gains(options) };
    if let Some(gains) = &options.gains {
        return Err(NoGains(gains.clone()).into());
    }
    options.output.check([&options.out], &[&options.model])?;
    let target = if hover { TrimTarget::default() } else { TrimTarget::read(&options.at)? };
    let model = if options.to.is_linear() {
        Model::read_to_linearize(&options.model)?
    } else {
        Model::read(&options.model)?
    };
    let export = export::export(&model, to, &target)
        .map_err(|why| anyhow::anyhow!("{}: {why}", options.model.display()))?;
    report::write_atomic(&options.out, &export.text)?;
    let physical: Vec<Physical> = physical_parameters(&model).into_iter().map(entry).collect();
    if options.output.json {
        return Outcome::json(&Document { file: &options.out, left_out: &export.left_out, physical });
    }
    Ok(Outcome::done(text(options, &export.left_out, &physical)))
}

/// Writes gains, which have to belong to the model, as a header.
fn run_gains(options: &Options) -> anyhow::Result<Outcome> {
    let Some(path) = &options.gains else { return Err(GainsMissing.into()) };
    options.output.check([&options.out], &[&options.model, path])?;
    let gains = design::gains_match::read_for(path, &Model::read_to_linearize(&options.model)?)?;
    let model = Model::read(&options.model)?;
    report::write_atomic(&options.out, export::gains_header(&gains, &model)?)?;
    if options.output.json {
        return Outcome::json(&Document { file: &options.out, left_out: &[], physical: Vec::new() });
    }
    Ok(Outcome::done(format!("{} written: {FOR_C}\n", options.out.display())))
}

fn entry(one: model::PhysicalParameter) -> Physical {
    let model::PhysicalParameter { symbol, name, value, std_error, unit, .. } = one;
    Physical { symbol, name, value, std_error, unit }
}

fn text(options: &Options, left_out: &[LeftOut], physical: &[Physical]) -> String {
    let mut text = String::from("Physical parameters\n");
    for one in physical {
        let error =
            one.std_error.map_or_else(String::new, |error| format!(" +- {}", report::significant(error, 2)));
        let value = report::significant(one.value, 5);
        text.push_str(&format!("  {:9} {value}{error} {} ({})\n", one.symbol, one.unit, one.name));
    }
    if left_out.is_empty() {
        let how = if options.to.is_linear() { ", linear about the equilibrium" } else { "" };
        text.push_str(&format!("\nAll effects of the model are in the file{how}.\n"));
    } else {
        text.push_str("\nNot as in the model:\n");
        for one in left_out {
            text.push_str(&tables::paragraph(&format!("- {}: {}", one.effect, one.why)));
        }
    }
    text + &format!("\n{} written\n", options.out.display())
}
