//! What subcommands share: options, flights as they are named on the command line, faults, progress, output.

pub(crate) mod colour;
pub(crate) mod demo_effect;
pub(crate) mod demo_flights;
pub(crate) mod effect_names;
pub(crate) mod faults;
pub(crate) mod flights;
pub(crate) mod invocation;
pub(crate) mod logs;
pub(crate) mod model_files;
pub(crate) mod motion_clocks;
pub(crate) mod next_flight;
pub(crate) mod output;
pub(crate) mod progress;
pub(crate) mod refine;
pub(crate) mod terminal;
pub(crate) mod user_effects;
