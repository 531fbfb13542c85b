//! Missions: scripts, the steps of one after the other, and the command of now.

mod active_step;
#[expect(clippy::module_inception, reason = "the mission of this folder")]
mod mission;
mod preflight;
pub mod script;
mod status;

pub use mission::Mission;
pub use script::{Axis, MissionStep, ScriptError, parse_script, read_script};
pub use status::{Ask, CraftStatus, Progress};
