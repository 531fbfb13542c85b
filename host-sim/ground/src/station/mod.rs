//! The ground station as one value, without sockets, clocks and terminals.

mod notices;
mod parts;
mod pilot;
mod settings;
mod snapshot;
#[expect(clippy::module_inception, reason = "the station of this folder")]
mod station;
mod stream_rate;

pub use notices::Notice;
pub use pilot::PilotRequest;
pub use settings::{LEAST_COMMAND_HZ, Settings, SettingsError};
pub use snapshot::{Snapshot, Tracker};
pub use station::{AGAIN_S, SILENCE_S, Station};
