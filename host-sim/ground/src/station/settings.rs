//! What a station needs to know.

use crate::mission::MissionStep;

/// Least rate at which commands may be sent: the craft holds after half a second without one.
pub const LEAST_COMMAND_HZ: f64 = 4.0;

/// What a station needs to know.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Commands in a second.
    pub command_hz: f64,
    /// What to do.
    pub steps: Vec<MissionStep>,
    /// What [`PilotRequest::Pattern`](super::PilotRequest::Pattern) does.
    pub pattern: Vec<MissionStep>,
    /// Height of [`PilotRequest::TakeOff`](super::PilotRequest::TakeOff), m.
    pub take_off_m: f64,
    /// Command units for one microsecond of the thesis' excitation.
    pub excitation_gain: f64,
    /// Land and fail when the craft's clock is off.
    pub land_on_clock_fault: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            command_hz: 50.0,
            steps: Vec::new(),
            pattern: Vec::new(),
            take_off_m: 1.0,
            excitation_gain: 1.0,
            land_on_clock_fault: false,
        }
    }
}

/// Why settings cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// Commands too rare or too often.
    #[error(
        "{0} commands a second: give {LEAST_COMMAND_HZ} (the craft holds after 0.5 s without one) to 500"
    )]
    CommandRate(f64),
    /// A height out of range.
    #[error("a take-off to {0} m: give 0.1 m to 100 m")]
    Height(f64),
}

impl Settings {
    pub(super) fn check(&self) -> Result<(), SettingsError> {
        if !(self.command_hz >= LEAST_COMMAND_HZ && self.command_hz <= 500.0) {
            return Err(SettingsError::CommandRate(self.command_hz));
        }
        if !(self.take_off_m >= 0.1 && self.take_off_m <= 100.0) {
            return Err(SettingsError::Height(self.take_off_m));
        }
        Ok(())
    }
}
