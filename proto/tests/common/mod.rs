//! One of each message, with numbers that are told apart, and two ends that have a session.
#![allow(dead_code, reason = "each program of tests uses what it needs")]

use proto::*;

pub(crate) fn command() -> Command {
    Command {
        mode: Mode::Position,
        attitude_rad: [0.5, -0.5],
        yaw_rad: 1.0,
        z_m: -1.0,
        position_m: [2.0, -1.0],
        cut_off: false,
        injection: [1.0, -1.0, 2.0, -2.0],
    }
}

pub(crate) fn pose() -> Pose {
    Pose { position_m: [1.0, -2.0, 0.5], attitude_rad: [0.0, -0.0, -1.0] }
}

pub(crate) fn supervision() -> Supervision {
    Supervision { state: State::Hold, conditions: 64, preflight: 1023 }
}

pub(crate) fn telemetry() -> Telemetry {
    Telemetry {
        tick: 300,
        craft_us: u32::MAX,
        ground_us: 1,
        supervision: supervision(),
        mode: Mode::Attitude,
        attitude_command_rad: [1.0, 2.0, -1.0],
        z_command_m: -2.0,
        tracked: pose(),
        tracked_rates_rad_s: [0.5, -0.5, 1.0],
        imu: Some(ImuSample { gyro_rad_s: [1.0; 3], attitude_rad: None, acceleration_m_s2: Some([-1.0; 3]) }),
        thrust: 2.0,
        torque: [1.0, -1.0, 0.5],
        pwm: [1.0, 2.0, -1.0, -2.0],
        refused: Refusal { roll: [true, false], ..Refusal::default() },
        battery_v: 2.0,
        current_a: Some(1.0),
        counters: Counters {
            jitter_us: 1,
            overruns: 2,
            clock_jumps: 3,
            poses_refused: 4,
            imu_refused: 5,
            commands_refused: 6,
            faults: 7,
            packets_lost: 8,
            packets_refused: 128,
        },
    }
}

pub(crate) fn messages() -> Vec<Message> {
    let output = Output {
        tick: 127,
        pwm: [1.0, 2.0, -1.0, -2.0],
        attitude_command_rad: [0.5, -0.5, 1.0],
        z_command_m: -1.0,
        position_reference_m: None,
        thrust: 2.0,
        torque: [1.0, -1.0, 2.0],
        refused: Refusal::default(),
        faults: 2,
    };
    vec![
        Message::Readings(Readings {
            tick: 5,
            time_us: 128,
            pose: Some(pose()),
            gyro_rad_s: None,
            battery_v: 2.0,
            command: None,
            request: Some(Request::Cut),
            outputs_ready: true,
        }),
        Message::Outcome(Outcome { output, supervision: supervision() }),
        Message::Pose(TimedPose { frame: 1, ground_us: 2, pose: pose() }),
        Message::Command(command()),
        Message::Request(Request::Disarm),
        Message::Gains(Gains { of: Loop::Yaw, kp: 1.0, ki: 2.0, kd: -1.0 }),
        Message::Timer(Timer { ground_us: 300 }),
        Message::Who,
        Message::Telemetry(telemetry()),
        Message::Identity(Identity {
            versions: [MIN_VERSION, VERSION],
            program: [0, 1, 300],
            vehicle_sha256: [0xAB; 32],
            state: State::Disarmed,
        }),
        Message::Answer(Answer { to: 7, done: true, preflight: 1 }),
        Message::LastEnd(Ending::Watchdog),
    ]
}

/// A session on a wire at time 0, of random bytes that are known.
pub(crate) fn session(link: u16, key: Option<Key>) -> (GroundEnd, CraftEnd) {
    let (mut buffer, mut reply) = ([0; MAX_PACKET_LEN], [0; MAX_PACKET_LEN]);
    let mut ground = GroundEnd::new(link, key.clone(), [2; 32]);
    let mut craft = CraftEnd::new(link, key, [1; 32]);
    let hello = ground.greet(0, &mut buffer).unwrap();
    let Ok(Heard::Hello(challenge)) = craft.hear(0, None, hello, &mut reply) else { panic!("a challenge") };
    assert_eq!(ground.hear(0, challenge), Ok(None));
    (ground, craft)
}
