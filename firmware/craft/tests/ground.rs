//! A craft as the ground sees it: messages in, messages out, with the flight law behind.

#[path = "../../control/tests/common/cases.rs"]
mod cases;

use cases::cases;
use control::Preflight;
use control::{Config, State};
use craft::{Craft, Inputs, LinkStatus, Setup, digest};
use proptest::prelude::*;
use proto::{
    Answer, Command, Gains, ImuSample, Loop, Message, Mode, Opened, Pose, Request, TimedPose, Timer,
};

const SETUP: Setup = Setup {
    vehicle_sha256: [7; 32],
    program: [1, 2, 3],
    telemetry_every: 1,
    last_end: proto::Ending::BrownOut,
};

const IDLE: Command = Command { z_m: -1.0, ..Command::IDLE };

/// A craft on the floor with good sensors, and a ground that speaks to it.
struct Bench {
    craft: Craft,
    ticks: u32,
    number: u64,
    link: LinkStatus,
    /// When the ground's clock began, ticks.
    ground_from: u32,
}

impl Bench {
    fn new(setup: Setup) -> Self {
        let craft = Craft::new(&Config::thesis(), setup).unwrap();
        Self { craft, ticks: 0, number: 0, link: LinkStatus::default(), ground_from: 0 }
    }

    fn say(&mut self, message: Message) -> u64 {
        self.number += 1;
        self.craft.hear(self.number, &message);
        self.number
    }

    /// What the ground's clock shows.
    fn ground_us(&self) -> u32 {
        (self.ticks - self.ground_from) * 10_000
    }

    /// Says it as the first message of a session.
    fn begin_session(&mut self, session: u64, message: Message) {
        self.number += 1;
        self.craft.receive(&Opened {
            session,
            is_first: true,
            is_overtaken: false,
            number: self.number,
            message,
        });
    }

    /// One tick with a pose, this command and a gyro that moves a little; what the craft says to
    /// it.
    fn tick(&mut self, command: Command) -> Vec<Message> {
        // Sensors that stand still are taken for stuck ones.
        let dither = 1e-4 * (self.ticks % 7) as f32;
        self.say(Message::Pose(TimedPose {
            frame: self.ticks,
            ground_us: self.ground_us(),
            pose: Pose { position_m: [dither, 0.0, -0.05], attitude_rad: [0.0; 3] },
        }));
        self.say(Message::Command(command));
        self.run(Some([dither; 3]), 0)
    }

    fn run(&mut self, gyro_rad_s: Option<[f32; 3]>, lateness_us: u32) -> Vec<Message> {
        self.ticks += 1;
        let imu = |gyro_rad_s| ImuSample { gyro_rad_s, attitude_rad: None, acceleration_m_s2: None };
        self.craft.tick(&Inputs {
            time_us: self.ticks * 10_000,
            imu: gyro_rad_s.map(imu),
            battery_v: 11.8,
            current_a: Some(0.5),
            outputs_ready: true,
            lateness_us,
        });
        std::iter::from_fn(|| self.craft.next_message(&self.link)).collect()
    }

    fn ready(setup: Setup) -> Self {
        let mut bench = Self::new(setup);
        for _ in 0..300 {
            bench.tick(IDLE);
        }
        assert!(bench.craft.flight().preflight.ready(), "{:?}", bench.craft.flight());
        bench
    }
}

fn answers(messages: &[Message]) -> Vec<(u64, bool)> {
    let answer = |m: &Message| if let Message::Answer(a) = m { Some((a.to, a.done)) } else { None };
    messages.iter().filter_map(answer).collect()
}

#[test]
fn arm_take_off_and_land_by_messages_alone() {
    let mut bench = Bench::ready(SETUP);
    let armed = bench.say(Message::Request(Request::Arm));
    let said = bench.tick(IDLE);
    let all = Preflight::ALL.bits();
    assert_eq!(said[0], Message::Answer(Answer { to: armed, done: true, preflight: all }));
    assert_eq!(bench.craft.state(), State::Armed);
    bench.tick(Command { cut_off: false, ..IDLE });
    assert_eq!(bench.craft.state(), State::Flying);
    for _ in 0..5 {
        bench.tick(Command { cut_off: false, ..IDLE });
    }
    assert!(bench.craft.flight().tick.pwm.iter().all(|pwm| *pwm > 1000.0), "{:?}", bench.craft.flight().tick);
    let landed = bench.say(Message::Request(Request::Land));
    let said = bench.tick(Command { cut_off: false, ..IDLE });
    assert_eq!(answers(&said), [(landed, true)]);
}

#[test]
fn a_craft_that_is_not_ready_says_what_is_missing() {
    let mut bench = Bench::new(SETUP);
    let asked = bench.say(Message::Request(Request::Arm));
    // No pose, no command, no gyro has come.
    let said = bench.run(None, 0);
    let Message::Answer(Answer { to, done, preflight }) = said[0] else { panic!("{said:?}") };
    assert!(to == asked && !done);
    for missing in [Preflight::LINK, Preflight::POSE, Preflight::IMU] {
        assert_eq!(preflight & missing, 0, "{preflight:b}");
    }
    assert_eq!(bench.craft.state(), State::Disarmed);
}

/// Both orders of each pair; the state after the tick shows which one was flown.
#[test]
fn of_two_requests_in_one_tick_the_more_severe_is_done() {
    let pairs = [
        (Request::Cut, Request::Arm, State::Cut),
        (Request::Cut, Request::Land, State::Cut),
        (Request::Disarm, Request::Cut, State::Disarmed),
        (Request::Disarm, Request::Arm, State::Disarmed),
        (Request::Land, Request::Arm, State::Land),
    ];
    let flying = |bench: &mut Bench| {
        bench.say(Message::Request(Request::Arm));
        bench.tick(IDLE);
        bench.tick(Command { cut_off: false, ..IDLE });
    };
    for (severe, other, state) in pairs {
        for swap in [false, true] {
            let mut bench = Bench::ready(SETUP);
            flying(&mut bench);
            let [first, second] = if swap { [other, severe] } else { [severe, other] };
            let a = bench.say(Message::Request(first));
            let b = bench.say(Message::Request(second));
            let said = bench.tick(Command { cut_off: false, ..IDLE });
            assert_eq!(bench.craft.state(), state, "{first:?} {second:?}");
            let [kept, dropped] = if swap { [b, a] } else { [a, b] };
            assert_eq!(answers(&said), [(dropped, false), (kept, true)]);
        }
    }
}

#[test]
fn the_newest_pose_and_command_count() {
    let mut bench = Bench::ready(SETUP);
    let pose = |x| Pose { position_m: [x, 0.0, -0.05], attitude_rad: [0.0; 3] };
    for x in [0.05, 0.02] {
        bench.say(Message::Pose(TimedPose { frame: 0, ground_us: 0, pose: pose(x) }));
    }
    let said = bench.run(Some([0.0; 3]), 0);
    let [Message::Telemetry(telemetry)] = said[..] else { panic!("{said:?}") };
    assert_eq!(telemetry.tracked.position_m[0], 0.02);
}

#[test]
fn telemetry_tells_what_went_in() {
    let mut bench = Bench::ready(SETUP);
    bench.link = LinkStatus { lost: 3, refused: 4 };
    bench.say(Message::Timer(Timer { ground_us: 77 }));
    bench.say(Message::Answer(Answer { to: 0, done: true, preflight: 0 }));
    let said = bench.run(Some([0.1, 0.2, 0.3]), 250);
    let [Message::Telemetry(telemetry)] = said[..] else { panic!("{said:?}") };
    assert_eq!(telemetry.tick, bench.ticks - 1);
    assert_eq!((telemetry.craft_us, telemetry.ground_us), (bench.ticks * 10_000, 77));
    assert_eq!(telemetry.imu.unwrap().gyro_rad_s, [0.1, 0.2, 0.3]);
    assert_eq!((telemetry.battery_v, telemetry.current_a), (11.8, Some(0.5)));
    assert_eq!(telemetry.pwm, [1000.0; 4]);
    let counters = telemetry.counters;
    assert_eq!((counters.packets_lost, counters.packets_refused), (3, 5), "one message was not for a craft");
    assert_eq!(counters.jitter_us, 250);
    let said = bench.run(None, 20);
    let [Message::Telemetry(telemetry)] = said[..] else { panic!("{said:?}") };
    assert_eq!(telemetry.counters.jitter_us, 20, "counted anew after each telemetry");
    assert_eq!(telemetry.imu, None);
}

#[test]
fn telemetry_comes_every_so_many_ticks_with_the_worst_lateness_between() {
    let mut bench = Bench::new(Setup { telemetry_every: 5, ..SETUP });
    let mut came = Vec::new();
    for k in 0..20 {
        for message in bench.run(None, if k == 7 { 900 } else { k }) {
            let Message::Telemetry(telemetry) = message else { panic!("{message:?}") };
            came.push((telemetry.tick, telemetry.counters.jitter_us));
        }
    }
    assert_eq!(came, [(0, 0), (5, 5), (10, 900), (15, 15)]);
}

/// Who asks a craft what it is. (The highest bit of a session's name says so.)
const ASKER: u64 = 1 << 63 | 5;

/// A ground station that starts anew in flight has a clock that begins anew: its poses count from its
/// first packet on. Whoever only asks leaves the clock as it is: poses of long ago stay refused.
#[test]
fn a_ground_station_that_starts_anew_brings_its_clock() {
    let mut bench = Bench::ready(SETUP);
    bench.say(Message::Request(Request::Arm));
    bench.tick(IDLE);
    let fly = Command { cut_off: false, ..IDLE };
    let flown = |bench: &mut Bench, ticks: u32| {
        for _ in 0..ticks {
            bench.say(Message::Timer(Timer { ground_us: bench.ground_us() }));
            bench.tick(fly);
        }
        bench.craft.state()
    };
    bench.begin_session(3, Message::Who);
    assert_eq!(flown(&mut bench, 100), State::Flying);
    let refused = |bench: &Bench| bench.craft.telemetry(&bench.link).counters.poses_refused;
    let before = refused(&bench);
    // Four seconds back.
    bench.ground_from = bench.ticks;
    bench.begin_session(4, Message::Who);
    assert_eq!(flown(&mut bench, 100), State::Flying);
    assert_eq!(refused(&bench), before, "its poses are new from the first on");
    bench.begin_session(ASKER, Message::Who);
    // Half a second back, and no clock with it.
    bench.ground_from += 50;
    bench.tick(fly);
    assert_eq!(refused(&bench), before + 1);
}

#[test]
fn who_is_answered_with_the_identity() {
    let mut bench = Bench::new(SETUP);
    bench.say(Message::Who);
    let said = bench.run(None, 0);
    let Message::Identity(identity) = said[0] else { panic!("{said:?}") };
    assert_eq!(identity.versions, [proto::MIN_VERSION, proto::VERSION]);
    assert_eq!((identity.program, identity.vehicle_sha256), ([1, 2, 3], [7; 32]));
    assert_eq!(identity.state, proto::State::Disarmed);
    assert_eq!(said[1], Message::LastEnd(proto::Ending::BrownOut));
    assert!(!bench.run(None, 0).iter().any(|m| matches!(m, Message::Identity(_))), "once");
}

/// What a craft is told flies like what it was built with.
#[test]
fn gains_of_the_ground_fly_like_gains_of_the_file() {
    use control::gains::Law;
    let mut config = Config::thesis();
    let Law::ModelBased(law) = &mut config.law else { unreachable!() };
    (law.loops.roll.kp, law.loops.roll.ki, law.loops.roll.kd) = (60.0, 20.0, 8.0);
    (law.loops.y.kp, law.loops.y.ki, law.loops.y.kd) = (0.25, 0.0, 0.125);
    let told = |of, kp, ki, kd| Message::Gains(Gains { of, kp, ki, kd });
    let fly = |bench: &mut Bench| -> Vec<u64> {
        for _ in 0..300 {
            bench.tick(IDLE);
        }
        bench.say(Message::Request(Request::Arm));
        bench.tick(IDLE);
        let mut hashes = Vec::new();
        for k in 0..200 {
            let aside = 0.01 * k as f32;
            bench.tick(Command { cut_off: false, position_m: [0.0, aside], ..IDLE });
            hashes.push(digest(bench.craft.flight()));
        }
        assert_eq!(bench.craft.state(), State::Flying);
        hashes
    };
    let mut from_file = Bench::new(SETUP);
    from_file.craft = Craft::new(&config, SETUP).unwrap();
    let mut from_ground = Bench::new(SETUP);
    let roll = from_ground.say(told(Loop::Roll, 60.0, 20.0, 8.0));
    let y = from_ground.say(told(Loop::Y, 0.25, 0.0, 0.125));
    assert_eq!(answers(&from_ground.tick(IDLE)), [(roll, true), (y, true)]);
    from_file.tick(IDLE);
    let flown = fly(&mut from_file);
    assert_eq!(fly(&mut from_ground), flown);
    assert_ne!(fly(&mut Bench::new(SETUP)), flown, "other gains fly otherwise");
}

#[test]
fn bad_gains_and_gains_in_flight_change_nothing() {
    let mut bench = Bench::ready(SETUP);
    let mut twin = Bench::ready(SETUP);
    for kp in [f32::NAN, f32::INFINITY, -1.0, 1e30] {
        let asked = bench.say(Message::Gains(Gains { of: Loop::Pitch, kp, ki: 0.0, kd: 0.0 }));
        assert_eq!(answers(&bench.tick(IDLE)), [(asked, false)]);
        twin.tick(IDLE);
    }
    for bench in [&mut bench, &mut twin] {
        bench.say(Message::Request(Request::Arm));
        bench.tick(IDLE);
    }
    let asked = bench.say(Message::Gains(Gains { of: Loop::Pitch, kp: 1.0, ki: 0.0, kd: 0.0 }));
    assert_eq!(answers(&bench.tick(IDLE)), [(asked, false)], "armed is too late");
    twin.tick(IDLE);
    for _ in 0..50 {
        bench.tick(Command { cut_off: false, ..IDLE });
        twin.tick(Command { cut_off: false, ..IDLE });
        assert_eq!(digest(bench.craft.flight()), digest(twin.craft.flight()));
    }
}

/// Any bits, special ones often.
fn any_f32() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -3.0_f32..3.0,
        1 => any::<u32>().prop_map(f32::from_bits),
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, 0.0, -0.0, 1e9]),
    ]
}

fn any_message() -> impl Strategy<Value = Message> {
    let three = || prop::array::uniform3(any_f32());
    let pose = (three(), three(), any::<u32>()).prop_map(|(position_m, attitude_rad, n)| {
        Message::Pose(TimedPose { frame: n, ground_us: n, pose: Pose { position_m, attitude_rad } })
    });
    let command = (any::<bool>(), three(), three(), any::<bool>(), prop::array::uniform4(any_f32()))
        .prop_map(|(position, [roll, pitch, yaw_rad], [x, y, z_m], cut_off, injection)| {
            Message::Command(Command {
                mode: if position { Mode::Position } else { Mode::Attitude },
                attitude_rad: [roll, pitch],
                yaw_rad,
                z_m,
                position_m: [x, y],
                cut_off,
                injection,
            })
        });
    let request = prop::sample::select(vec![Request::Arm, Request::Disarm, Request::Land, Request::Cut])
        .prop_map(Message::Request);
    let of = prop::sample::select(vec![Loop::Roll, Loop::Pitch, Loop::Yaw, Loop::Altitude, Loop::X, Loop::Y]);
    let gains = (of, three()).prop_map(|(of, [kp, ki, kd])| Message::Gains(Gains { of, kp, ki, kd }));
    let answer = any::<u64>().prop_map(|to| Message::Answer(Answer { to, done: true, preflight: 0 }));
    prop_oneof![4 => pose, 4 => command, 2 => request, 1 => gains, 1 => answer, 1 => Just(Message::Who)]
}

proptest! {
    #![proptest_config(cases(200))]

    /// Whatever the ground says and the sensors measure: motors get finite commands inside their
    /// range, idle unless somebody armed; every message out can be sent.
    #[test]
    fn nothing_the_ground_says_breaks_a_craft(
        ticks in prop::collection::vec(
            (prop::collection::vec(any_message(), 0..12), any::<u32>(), prop::option::of(prop::array::uniform3(any_f32())), any_f32(), any::<bool>()),
            1..60,
        ),
        prepared in any::<bool>(),
    ) {
        let mut bench = if prepared { Bench::ready(SETUP) } else { Bench::new(SETUP) };
        let mut may_fly = false;
        for (messages, clock, gyro, battery_v, on_time) in ticks {
            let asks = |m: &Message| matches!(m, Message::Request(Request::Arm));
            may_fly |= messages.iter().any(asks);
            let heard = messages.len();
            for message in messages {
                bench.say(message);
            }
            bench.ticks += 1;
            let imu = gyro.map(|gyro_rad_s| ImuSample { gyro_rad_s, attitude_rad: None, acceleration_m_s2: None });
            let time_us = if on_time { bench.ticks * 10_000 } else { clock };
            bench.craft.tick(&Inputs {
                time_us, imu, battery_v, current_a: None, outputs_ready: true, lateness_us: clock,
            });
            let pwm = bench.craft.flight().tick.pwm;
            prop_assert!(pwm.iter().all(|pwm| (1000.0..=2000.0).contains(pwm)), "{pwm:?}");
            if !may_fly {
                prop_assert_eq!(pwm, [1000.0; 4]);
            }
            let said: Vec<Message> = std::iter::from_fn(|| bench.craft.next_message(&bench.link)).collect();
            // As many answers as the outbox holds; who it is, and how its program ended the last time; telemetry.
            prop_assert!(said.len() <= heard.min(8) + 3, "{said:?}");
            for message in &said {
                prop_assert!(proto::encode(message, &mut [0; proto::MAX_FRAME_LEN]).is_ok());
            }
        }
    }
}

/// Of two poses the newer one counts, in whichever order they come; the ground's clock wraps between them.
#[test]
fn an_overtaken_pose_counts_where_it_is_the_newest() {
    let mut bench = Bench::new(SETUP);
    let hear = |bench: &mut Bench, at_us: i32, is_overtaken: bool| {
        let pose = Pose { position_m: [at_us as f32 * 1e-6, 0.0, -0.05], attitude_rad: [0.0; 3] };
        let message = Message::Pose(TimedPose { frame: 0, ground_us: at_us.cast_unsigned(), pose });
        bench.craft.receive(&Opened { session: 1, is_first: false, is_overtaken, number: 0, message });
    };
    let mut seen_x_m = |said: [(i32, bool); 2]| {
        said.into_iter().for_each(|(at_us, is_overtaken)| hear(&mut bench, at_us, is_overtaken));
        bench.run(Some([0.0; 3]), 0);
        bench.craft.flight().tick.terms.position_m[0]
    };
    assert_eq!(seen_x_m([(-20_000, false), (-30_000, true)]), -0.02);
    assert_eq!(seen_x_m([(-20_000, true), (-10_000, true)]), -0.01);
    assert_eq!(seen_x_m([(10_000, true), (0, true)]), 0.01);
    assert_eq!(seen_x_m([(10_000, true), (5_000, true)]), 0.01, "it has none that is new");
}
