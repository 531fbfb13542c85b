//! Conversion of the flight law's values to messages and back: fields keep their names.
//!
//! `control` and `proto` do not know each other; here they meet. Floating-point numbers pass bit
//! for bit.

use control::mixer::Directions;
use control::{Command, Flight, Mode, Pose, Readings, Request, State};

/// A pose out of a message.
#[inline]
pub fn pose(pose: &proto::Pose) -> Pose {
    Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad }
}

/// A pose for a message.
#[inline]
pub fn pose_message(pose: &Pose) -> proto::Pose {
    proto::Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad }
}

/// A command out of a message.
#[inline]
pub fn command(command: &proto::Command) -> Command {
    let proto::Command { mode, attitude_rad, yaw_rad, z_m, position_m, cut_off, injection } = *command;
    let mode = match mode {
        proto::Mode::Attitude => Mode::Attitude,
        proto::Mode::Position => Mode::Position,
    };
    Command { mode, attitude_rad, yaw_rad, z_m, position_m, cut_off, injection }
}

/// A command for a message.
#[inline]
pub fn command_message(command: &Command) -> proto::Command {
    let Command { mode, attitude_rad, yaw_rad, z_m, position_m, cut_off, injection } = *command;
    proto::Command { mode: mode_message(mode), attitude_rad, yaw_rad, z_m, position_m, cut_off, injection }
}

/// Which loops are closed, for a message.
#[inline]
pub fn mode_message(mode: Mode) -> proto::Mode {
    match mode {
        Mode::Attitude => proto::Mode::Attitude,
        Mode::Position => proto::Mode::Position,
    }
}

/// A request out of a message.
#[inline]
pub fn request(request: proto::Request) -> Request {
    match request {
        proto::Request::Arm => Request::Arm,
        proto::Request::Disarm => Request::Disarm,
        proto::Request::Land => Request::Land,
        proto::Request::Cut => Request::Cut,
    }
}

/// A request for a message.
#[inline]
pub fn request_message(request: Request) -> proto::Request {
    match request {
        Request::Arm => proto::Request::Arm,
        Request::Disarm => proto::Request::Disarm,
        Request::Land => proto::Request::Land,
        Request::Cut => proto::Request::Cut,
    }
}

/// What the craft is doing, for a message.
#[inline]
pub fn state_message(state: State) -> proto::State {
    match state {
        State::Disarmed => proto::State::Disarmed,
        State::Armed => proto::State::Armed,
        State::Flying => proto::State::Flying,
        State::Hold => proto::State::Hold,
        State::Land => proto::State::Land,
        State::Cut => proto::State::Cut,
    }
}

/// The readings of a message.
#[inline]
pub fn readings(message: &proto::Readings) -> Readings {
    Readings {
        time_us: message.time_us,
        pose: message.pose.as_ref().map(pose),
        // A simulator's pose is as old as the simulator makes it.
        pose_age_us: 0,
        gyro_rad_s: message.gyro_rad_s,
        battery_v: message.battery_v,
        command: message.command.as_ref().map(command),
        request: message.request.map(request),
        outputs_ready: message.outputs_ready,
    }
}

/// The message that readings travel in.
#[inline]
pub fn readings_message(tick: u32, readings: &Readings) -> proto::Readings {
    proto::Readings {
        tick,
        time_us: readings.time_us,
        pose: readings.pose.as_ref().map(pose_message),
        gyro_rad_s: readings.gyro_rad_s,
        battery_v: readings.battery_v,
        command: readings.command.as_ref().map(command_message),
        request: readings.request.map(request_message),
        outputs_ready: readings.outputs_ready,
    }
}

/// What the supervisor made of a tick.
#[inline]
pub fn supervision(flight: &Flight) -> proto::Supervision {
    proto::Supervision {
        state: state_message(flight.state),
        conditions: flight.conditions.bits(),
        preflight: flight.preflight.bits(),
    }
}

/// Directions in which the motors could not follow.
#[inline]
pub fn refusal(refused: &control::Refused) -> proto::Refusal {
    let directions = |d: Directions| [d.high(), d.low()];
    proto::Refusal {
        thrust: directions(refused.thrust),
        roll: directions(refused.roll),
        pitch: directions(refused.pitch),
        yaw: directions(refused.yaw),
    }
}

/// Ticks so far with a fault of the controller's inputs or results; stays at the greatest number.
#[inline]
pub fn fault_count(faults: &control::Faults) -> u32 {
    let kinds = [faults.measurement, faults.command, faults.battery, faults.internal];
    kinds.iter().fold(0, |sum: u32, kind| sum.saturating_add(kind.count))
}

/// The outcome of tick number `tick`.
#[inline]
pub fn outcome(tick: u32, flight: &Flight) -> proto::Outcome {
    let control::Tick { pwm, terms, refused, faults } = &flight.tick;
    let output = proto::Output {
        tick,
        pwm: *pwm,
        attitude_command_rad: terms.attitude_command_rad,
        z_command_m: terms.z_command_m,
        position_reference_m: terms.outer.map(|outer| outer.reference_m),
        thrust: terms.thrust,
        torque: terms.torque,
        refused: refusal(refused),
        faults: fault_count(faults),
    };
    proto::Outcome { output, supervision: supervision(flight) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_survive_the_way_through_a_message() {
        let full = Readings {
            time_us: 21,
            pose: Some(Pose { position_m: [1.0, 2.0, 3.0], attitude_rad: [4.0, 5.0, 6.0] }),
            pose_age_us: 0,
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
            assert_eq!(readings(&readings_message(3, &sent)), sent);
        }
    }

    /// Each name is its own counterpart: the words are compared, not the numbers.
    #[test]
    fn names_mean_the_same_on_both_sides() {
        for state in State::ALL {
            assert_eq!(format!("{state:?}"), format!("{:?}", state_message(state)));
        }
        for request in [Request::Arm, Request::Disarm, Request::Land, Request::Cut] {
            assert_eq!(format!("{request:?}"), format!("{:?}", request_message(request)));
            assert_eq!(super::request(request_message(request)), request);
        }
    }
}
