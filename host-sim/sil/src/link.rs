//! The way from the sensors to the controller and back.

use control::{Command, Config, Controller, Measurement, Mode, Tick};

/// What can go wrong between controller and plant.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The controller's process could not be started.
    #[error("cannot start the controller's process {program}: {reason}")]
    Start {
        /// The program.
        program: String,
        /// What the system said.
        reason: std::io::Error,
    },
    /// The configuration did not get from one process to the other.
    #[error("cannot hand the configuration to the controller's process: {reason}")]
    Configure {
        /// What the system said.
        reason: std::io::Error,
    },
    /// The other process is gone.
    #[error(
        "the controller's process ended in the middle of a flight ({status}); run again with --transport inproc to see whether the controller itself fails"
    )]
    PeerGone {
        /// How it ended.
        status: String,
    },
    /// The other process does not answer.
    #[error("the controller's process has not answered for {seconds} s; is the machine overloaded?")]
    Silent {
        /// How long.
        seconds: u64,
    },
    /// The other process answered something else.
    #[error("the controller's process answered tick {expected} with {found}")]
    WrongAnswer {
        /// The tick asked about.
        expected: u32,
        /// What came.
        found: String,
    },
    /// A message that cannot be read.
    #[error("between the processes: {0}")]
    Message(#[from] proto::Error),
    /// The middleware refused something.
    #[error("iceoryx2 cannot {what}: {reason}; is /dev/shm writable and not full?")]
    Middleware {
        /// What was tried.
        what: &'static str,
        /// What it said.
        reason: String,
    },
    /// Ctrl-C or a request to end.
    #[error("interrupted")]
    Interrupted,
}

/// Something that answers ticks.
pub trait Link {
    /// One tick of the controller.
    ///
    /// # Errors
    /// What goes wrong on the way; never in process.
    fn tick(
        &mut self,
        tick: u32,
        measurement: &Measurement,
        command: &Command,
    ) -> Result<proto::Output, LinkError>;
}

/// The controller in the same process.
#[derive(Debug, Clone)]
pub struct InProcess {
    controller: Controller,
}

impl InProcess {
    /// A fresh controller.
    ///
    /// # Errors
    /// The first parameter that cannot be flown with, by name.
    pub fn new(config: &Config) -> Result<Self, control::ConfigError> {
        Ok(Self { controller: Controller::new(config)? })
    }
}

impl Link for InProcess {
    #[inline]
    fn tick(
        &mut self,
        tick: u32,
        measurement: &Measurement,
        command: &Command,
    ) -> Result<proto::Output, LinkError> {
        Ok(output(tick, &self.controller.tick(measurement, command)))
    }
}

/// What of a tick is recorded and sent.
#[inline]
pub(crate) fn output(tick: u32, outcome: &Tick) -> proto::Output {
    let Tick { pwm, terms, refused, faults } = outcome;
    let directions = |d: control::mixer::Directions| [d.high, d.low];
    let count = |fault: control::supervisor::Fault| fault.count;
    proto::Output {
        tick,
        pwm: *pwm,
        attitude_command_rad: terms.attitude_command_rad,
        z_command_m: terms.z_command_m,
        position_reference_m: terms.outer.map(|outer| outer.reference_m),
        thrust: terms.thrust,
        torque: terms.torque,
        refused: proto::Refusal {
            thrust: directions(refused.thrust),
            roll: directions(refused.roll),
            pitch: directions(refused.pitch),
            yaw: directions(refused.yaw),
        },
        faults: count(faults.measurement)
            .saturating_add(count(faults.command))
            .saturating_add(count(faults.battery))
            .saturating_add(count(faults.internal)),
    }
}

pub(crate) fn input(tick: u32, measurement: &Measurement, command: &Command) -> proto::Input {
    proto::Input {
        tick,
        measurement: proto::Measurement {
            position_m: measurement.position_m,
            attitude_rad: measurement.attitude_rad,
            gyro_rad_s: measurement.gyro_rad_s,
            battery_v: measurement.battery_v,
        },
        command: proto::Command {
            mode: match command.mode {
                Mode::Attitude => proto::Mode::Attitude,
                Mode::Position => proto::Mode::Position,
            },
            attitude_rad: command.attitude_rad,
            yaw_rad: command.yaw_rad,
            z_m: command.z_m,
            position_m: command.position_m,
            cut_off: command.cut_off,
            injection: command.injection,
        },
    }
}

pub(crate) fn arguments(input: &proto::Input) -> (Measurement, Command) {
    let proto::Input { measurement: m, command: c, .. } = input;
    let measurement = Measurement {
        position_m: m.position_m,
        attitude_rad: m.attitude_rad,
        gyro_rad_s: m.gyro_rad_s,
        battery_v: m.battery_v,
    };
    let command = Command {
        mode: match c.mode {
            proto::Mode::Attitude => Mode::Attitude,
            proto::Mode::Position => Mode::Position,
        },
        attitude_rad: c.attitude_rad,
        yaw_rad: c.yaw_rad,
        z_m: c.z_m,
        position_m: c.position_m,
        cut_off: c.cut_off,
        injection: c.injection,
    };
    (measurement, command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_survive_the_way_through_a_message() {
        let measurement = Measurement {
            position_m: [1.0, 2.0, 3.0],
            attitude_rad: [4.0, 5.0, 6.0],
            gyro_rad_s: Some([7.0, 8.0, 9.0]),
            battery_v: 10.0,
        };
        let command = Command {
            mode: Mode::Position,
            attitude_rad: [11.0, 12.0],
            yaw_rad: 13.0,
            z_m: 14.0,
            position_m: [15.0, 16.0],
            cut_off: true,
            injection: [17.0, 18.0, 19.0, 20.0],
        };
        assert_eq!(arguments(&input(3, &measurement, &command)), (measurement, command));
    }
}
