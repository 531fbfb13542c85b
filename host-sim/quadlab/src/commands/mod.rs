//! One file a subcommand: its options, what it runs, what it prints and writes.

pub(crate) mod add;
pub(crate) mod campaign;
pub(crate) mod campaign_documents;
pub(crate) mod campaign_search;
pub(crate) mod campaign_submit;
pub(crate) mod compare;
pub(crate) mod design;
pub(crate) mod design_check;
pub(crate) mod design_losses;
pub(crate) mod design_report;
pub(crate) mod diagnose;
pub(crate) mod discover;
pub(crate) mod effects;
pub(crate) mod excite;
pub(crate) mod explain;
pub(crate) mod export;
pub(crate) mod fleet;
pub(crate) mod ground;
pub(crate) mod identify;
pub(crate) mod import;
pub(crate) mod init;
pub(crate) mod lab;
pub(crate) mod linearize;
pub(crate) mod motor_map;
pub(crate) mod plan;
pub(crate) mod reference;
pub(crate) mod reference_effects;
pub(crate) mod reference_schemas;
pub(crate) mod simulated_laboratory;

use clap::Subcommand;

use crate::cli::output::Outcome;
use crate::demo;

#[derive(Subcommand)]
pub(crate) enum Command {
    Init(init::Options),
    Import(import::Options),
    Lab(lab::Options),
    Identify(identify::Options),
    Compare(compare::Options),
    Diagnose(diagnose::Options),
    Add(add::Options),
    Explain(explain::Options),
    Discover(discover::Options),
    Effects(effects::Options),
    Demo(demo::Options),
    Linearize(linearize::Options),
    Export(export::Options),
    Ground(Box<ground::Options>),
    Design(design::Options),
    Campaign(campaign::Options),
    Fleet(Box<fleet::Options>),
    MotorMap(motor_map::Options),
    Excite(excite::Options),
    Plan(plan::Options),
    #[command(hide = true)]
    Reference(reference::Options),
}

/// Runs a command; `program` is all of them, for their reference.
pub(crate) fn outcome(command: Command, program: fn() -> clap::Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Init(options) => init::run(&options),
        Command::Import(options) => import::run(&options),
        Command::Lab(options) => lab::run(&options),
        Command::Identify(options) => identify::run(&options),
        Command::Compare(options) => compare::run(&options),
        Command::Diagnose(options) => diagnose::run(&options),
        Command::Add(options) => add::run(&options),
        Command::Explain(options) => explain::run(&options),
        Command::Discover(options) => discover::run(&options),
        Command::Effects(options) => effects::run(&options),
        Command::Demo(options) => demo::run(&options),
        Command::Linearize(options) => linearize::run(&options),
        Command::Export(options) => export::run(&options),
        Command::Ground(options) => ground::run(&options),
        Command::Design(options) => design::run(&options),
        Command::Campaign(options) => campaign::run(&options),
        Command::Fleet(options) => fleet::run(&options),
        Command::MotorMap(options) => motor_map::run(&options),
        Command::Excite(options) => excite::run(&options),
        Command::Plan(options) => plan::run(&options),
        Command::Reference(options) => reference::run(&options, program()),
    }
}
