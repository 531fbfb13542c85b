//! The way from the sensors to the controller and back.

use control::{Autopilot, Command, Config, Flight, Mode, Pose, Readings, Request, State, Tick};

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
    /// One tick of the autopilot.
    ///
    /// # Errors
    /// What goes wrong on the way; never in process.
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, LinkError>;
}

/// The autopilot in the same process.
#[derive(Debug, Clone)]
pub struct InProcess {
    autopilot: Autopilot,
}

impl InProcess {
    /// A fresh autopilot of a craft in the air.
    ///
    /// # Errors
    /// The first parameter that cannot be flown with, by name.
    pub fn new(config: &Config) -> Result<Self, control::ConfigError> {
        Ok(Self { autopilot: Autopilot::in_flight(config)? })
    }
}

impl Link for InProcess {
    #[inline]
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<proto::Outcome, LinkError> {
        Ok(outcome(tick, self.autopilot.tick(readings)))
    }
}

/// What of a tick is recorded and sent, of the law and of the supervisor.
#[inline]
pub(crate) fn outcome(tick: u32, flight: &Flight) -> proto::Outcome {
    proto::Outcome {
        output: output(tick, &flight.tick),
        supervision: proto::Supervision {
            state: match flight.state {
                State::Disarmed => proto::State::Disarmed,
                State::Armed => proto::State::Armed,
                State::Flying => proto::State::Flying,
                State::Hold => proto::State::Hold,
                State::Land => proto::State::Land,
                State::Cut => proto::State::Cut,
            },
            conditions: flight.conditions.bits(),
            preflight: flight.preflight.bits(),
        },
    }
}

#[inline]
fn output(tick: u32, outcome: &Tick) -> proto::Output {
    let Tick { pwm, terms, refused, faults } = outcome;
    let directions = |d: control::mixer::Directions| [d.high, d.low];
    let count = |fault: control::Fault| fault.count;
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

/// The message that readings travel in.
pub(crate) fn message(tick: u32, readings: &Readings) -> proto::Readings {
    proto::Readings {
        tick,
        time_us: readings.time_us,
        pose: readings
            .pose
            .map(|pose| proto::Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad }),
        gyro_rad_s: readings.gyro_rad_s,
        battery_v: readings.battery_v,
        command: readings.command.map(|command| proto::Command {
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
        }),
        request: readings.request.map(|request| match request {
            Request::Arm => proto::Request::Arm,
            Request::Disarm => proto::Request::Disarm,
            Request::Land => proto::Request::Land,
            Request::Cut => proto::Request::Cut,
        }),
        outputs_ready: readings.outputs_ready,
    }
}

/// The readings of a message.
pub(crate) fn readings(message: &proto::Readings) -> Readings {
    Readings {
        time_us: message.time_us,
        pose: message.pose.map(|pose| Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad }),
        gyro_rad_s: message.gyro_rad_s,
        battery_v: message.battery_v,
        command: message.command.map(|command| Command {
            mode: match command.mode {
                proto::Mode::Attitude => Mode::Attitude,
                proto::Mode::Position => Mode::Position,
            },
            attitude_rad: command.attitude_rad,
            yaw_rad: command.yaw_rad,
            z_m: command.z_m,
            position_m: command.position_m,
            cut_off: command.cut_off,
            injection: command.injection,
        }),
        request: message.request.map(|request| match request {
            proto::Request::Arm => Request::Arm,
            proto::Request::Disarm => Request::Disarm,
            proto::Request::Land => Request::Land,
            proto::Request::Cut => Request::Cut,
        }),
        outputs_ready: message.outputs_ready,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_survive_the_way_through_a_message() {
        let full = Readings {
            time_us: 21,
            pose: Some(Pose { position_m: [1.0, 2.0, 3.0], attitude_rad: [4.0, 5.0, 6.0] }),
            gyro_rad_s: Some([7.0, 8.0, 9.0]),
            battery_v: 10.0,
            command: Some(Command {
                mode: Mode::Position,
                attitude_rad: [11.0, 12.0],
                yaw_rad: 13.0,
                z_m: 14.0,
                position_m: [15.0, 16.0],
                cut_off: true,
                injection: [17.0, 18.0, 19.0, 20.0],
            }),
            request: Some(Request::Land),
            outputs_ready: true,
        };
        let empty = Readings { pose: None, gyro_rad_s: None, command: None, request: None, ..full };
        for sent in [full, empty] {
            assert_eq!(readings(&message(3, &sent)), sent);
        }
    }
}
