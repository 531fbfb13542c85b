//! The ground station without sockets, clocks and terminals: what comes in goes to the right place,
//! what is due goes out.
//!
//! The caller hands in packets, sightings, the pilot's requests and the time (us of one steady
//! clock), and takes packets out. What is sent:
//!
//! - poses, each as soon as it is seen;
//! - commands, [`Settings::command_hz`] times a second, from the first telemetry on: a craft that
//!   flies already is not cut;
//! - the ramp of time at irregular intervals ([`ramp_interval_s`](crate::link::ramp_interval_s));
//! - requests and gains, each [`AGAIN_S`] until the craft has done or refused them: UDP may lose
//!   them, and each is harmless twice;
//! - `Who` each second until there is an identity, and when telemetry stays out.
//!
//! What happens is reported as [`Notice`]s, once each: changes of state, faults by their names,
//! refusals, the clock's pace.

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
