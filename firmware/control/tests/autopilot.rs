//! The autopilot as a board sees it: readings in, states and motor commands out.

mod common;

use common::{cases, configs};
use control::Preflight;
use control::{Autopilot, Command, Condition, Config, Pose, Readings, Request, State};
use proptest::prelude::*;

/// A craft on its stand, and what it hears.
struct Rig {
    autopilot: Autopilot,
    readings: Readings,
    tick: u32,
}

const STAND: Pose = Pose { position_m: [0.0, 0.0, -0.05], attitude_rad: [0.0; 3] };
const WAIT: Command = Command {
    mode: control::Mode::Attitude,
    attitude_rad: [0.0; 2],
    yaw_rad: 0.0,
    z_m: -1.0,
    position_m: [0.0; 2],
    cut_off: true,
    injection: [0.0; 4],
};

impl Rig {
    fn new(time_us: u32) -> Self {
        Self::with(&Config::thesis(), time_us)
    }

    fn with(config: &Config, time_us: u32) -> Self {
        let readings = Readings {
            time_us,
            pose: Some(STAND),
            pose_age_us: 0,
            gyro_rad_s: Some([0.0; 3]),
            battery_v: 11.5,
            command: Some(WAIT),
            request: None,
            outputs_ready: true,
        };
        Self { autopilot: Autopilot::new(config).unwrap(), readings, tick: 0 }
    }

    /// One tick 10 ms on; sensors shiver as real ones do.
    fn tick(&mut self, request: Option<Request>) -> control::Flight {
        self.tick += 1;
        self.readings.time_us = self.readings.time_us.wrapping_add(10_000);
        let shiver = (self.tick % 7) as f32 * 1e-5;
        let mut readings = Readings { request, ..self.readings };
        if let Some(pose) = &mut readings.pose {
            pose.position_m[0] += shiver;
        }
        if let Some(gyro) = &mut readings.gyro_rad_s {
            gyro[0] += shiver;
        }
        *self.autopilot.tick(&readings)
    }

    fn run(&mut self, ticks: u32) -> control::Flight {
        (0..ticks).map(|_| self.tick(None)).last().unwrap()
    }

    fn armed(time_us: u32) -> Self {
        Self::armed_with(&Config::thesis(), time_us)
    }

    fn armed_with(config: &Config, time_us: u32) -> Self {
        let mut rig = Self::with(config, time_us);
        rig.run(100);
        assert_eq!(rig.tick(Some(Request::Arm)).state, State::Armed);
        rig
    }

    fn flying(time_us: u32) -> Self {
        let mut rig = Self::armed(time_us);
        rig.readings.command = Some(Command { cut_off: false, ..WAIT });
        assert_eq!(rig.tick(None).state, State::Flying);
        rig
    }
}

fn idles(flight: &control::Flight) -> bool {
    flight.tick.pwm == [1000.0; 4]
}

#[test]
fn it_boots_disarmed_and_waits_for_half_a_second_of_commands() {
    let mut rig = Rig::new(0);
    for k in 1..=60 {
        let flight = rig.tick(Some(Request::Arm));
        assert!(idles(&flight));
        let link = flight.preflight.bits() & Preflight::LINK != 0;
        assert_eq!(link, k >= 50, "tick {k}: 0.5 s of good frames");
        assert_eq!(flight.state == State::Armed, k >= 50, "tick {k}");
        if flight.state == State::Armed {
            return;
        }
    }
    panic!("never armed");
}

#[test]
fn from_the_stand_to_the_air_and_back() {
    let mut rig = Rig::armed(0);
    assert!(idles(&rig.run(200)), "armed, motors idle");
    rig.readings.command = Some(Command { cut_off: false, ..WAIT });
    let flight = rig.run(50);
    assert_eq!(flight.state, State::Flying);
    assert!(!idles(&flight), "it climbs");
    assert_eq!(rig.tick(Some(Request::Land)).state, State::Land);
    let stands = (1..1000).find(|_| rig.tick(None).state == State::Disarmed);
    let in_time = stands.is_some_and(|ticks| (50..250).contains(&ticks));
    assert!(in_time, "on its stand it has landed once thrust is little: {stands:?} ticks");
    let flight = rig.run(500);
    assert!(idles(&flight) && flight.state == State::Disarmed, "a command does not take off again");
}

/// 0.15 s by the table. An old pose is none: it does not move the craft, and it is counted.
#[test]
fn a_pose_that_was_taken_long_ago_is_none() {
    let mut rig = Rig::flying(0);
    rig.readings.pose_age_us = 150_000;
    let flight = rig.run(50);
    assert!(flight.state == State::Flying && !flight.conditions.has(Condition::PoseOld));
    let refused = rig.autopilot.counters().poses_refused;
    rig.readings.pose_age_us = 150_001;
    let flight = rig.run(5);
    assert!(flight.conditions.has(Condition::PoseOld) && flight.conditions.has(Condition::PoseLate));
    assert_eq!((flight.state, rig.autopilot.counters().poses_refused - refused), (State::Hold, 5));
    assert_eq!(rig.run(40).state, State::Land);
}

/// 10 s by the table; a take-off in time goes on flying, and the next wait begins anew.
#[test]
fn an_armed_craft_that_is_not_flown_is_disarmed() {
    let mut rig = Rig::armed(0);
    assert_eq!(rig.run(998).state, State::Armed);
    let flight = rig.run(2);
    assert_eq!(flight.state, State::Disarmed);
    assert!(flight.conditions.has(Condition::IdleForLong));

    let mut rig = Rig::armed(0);
    rig.run(998);
    rig.readings.command = Some(Command { cut_off: false, ..WAIT });
    let flight = rig.run(300);
    assert!(flight.state == State::Flying && !flight.conditions.has(Condition::IdleForLong));
    rig.readings.command = Some(WAIT);
    rig.tick(Some(Request::Disarm));
    rig.run(100);
    assert_eq!(rig.tick(Some(Request::Arm)).state, State::Armed);
    assert_eq!(rig.run(998).state, State::Armed);
}

type Break = fn(&mut Rig);

/// One way to break each preflight check that inputs can break; the controller's own fault is
/// forced in a unit test.
const BREAKS: [(u16, Break); 9] = [
    (Preflight::LINK, |rig| rig.readings.command = None),
    (Preflight::POSE, |rig| rig.readings.pose = None),
    (Preflight::IMU, |rig| rig.readings.gyro_rad_s = None),
    (Preflight::BATTERY, |rig| rig.readings.battery_v = 10.5),
    (Preflight::LEVEL, |rig| rig.readings.pose.iter_mut().for_each(|pose| pose.attitude_rad[0] = 0.3)),
    (Preflight::INSIDE, |rig| rig.readings.pose.iter_mut().for_each(|pose| pose.position_m[1] = 2.5)),
    (Preflight::TIMING, |rig| rig.readings.time_us = rig.readings.time_us.wrapping_add(2_000_000)),
    (Preflight::OUTPUTS, |rig| rig.readings.outputs_ready = false),
    (Preflight::IDLE, |rig| rig.readings.command.iter_mut().for_each(|command| command.cut_off = false)),
];

/// All 512 combinations of the checks that inputs can break: it arms with none broken, and only so.
#[test]
fn it_arms_on_the_good_row_only() {
    for row in (0..512_u16).step_by(if cfg!(miri) { 73 } else { 1 }) {
        let mut rig = Rig::new(0);
        rig.run(100);
        let mut broken = 0;
        let timing = BREAKS[6].1;
        for (k, (check, break_it)) in BREAKS.iter().enumerate() {
            if row & 1 << k != 0 {
                broken |= check;
                // What was said before arming and what leaps is broken in the last tick.
                if k != 6 {
                    break_it(&mut rig);
                }
            }
        }
        let before = rig.run(150);
        if row & 1 << 6 != 0 {
            timing(&mut rig);
        }
        let flight = rig.tick(Some(Request::Arm));
        assert_eq!(flight.state, if row == 0 { State::Armed } else { State::Disarmed }, "row {row:09b}");
        // A craft without poses stands where it was last seen; without commands it has the last
        // one.
        let hidden = if broken & Preflight::POSE != 0 { Preflight::LEVEL | Preflight::INSIDE } else { 0 }
            | if broken & Preflight::LINK != 0 { Preflight::IDLE } else { 0 };
        assert_eq!(flight.preflight.bits() | hidden, Preflight::ALL.bits() & !broken | hidden, "{before:?}");
    }
}

#[test]
fn cut_is_latched() {
    let mut rig = Rig::flying(0);
    assert!(idles(&rig.tick(Some(Request::Cut))));
    for request in [None, Some(Request::Arm), Some(Request::Land), Some(Request::Cut)] {
        for _ in 0..200 {
            let flight = rig.tick(request);
            assert!(flight.state == State::Cut && idles(&flight));
        }
    }
    assert_eq!(rig.tick(Some(Request::Disarm)).state, State::Disarmed);
    assert_eq!(rig.run(300).state, State::Disarmed);
}

#[test]
fn an_armed_craft_that_loses_anything_is_disarmed() {
    for (k, (_, break_it)) in BREAKS.iter().enumerate().filter(|(k, _)| *k != 8) {
        let mut rig = Rig::armed(0);
        break_it(&mut rig);
        // A tilt has to last, and the limit in flight is wider.
        if k == 4 {
            rig.readings.pose.iter_mut().for_each(|pose| pose.attitude_rad[0] = 1.2);
        }
        assert_eq!(rig.run(150).state, State::Disarmed, "check {k}");
    }
}

/// The same second of trouble from several starts of the clock: across the wrap and the half way it
/// is the same.
#[test]
fn timers_do_not_care_when_the_clock_wraps() {
    let story = |start: u32| -> Vec<(State, u32)> {
        let mut rig = Rig::flying(start);
        let mut states = vec![(rig.tick(None).state, 0)];
        for k in 0..1000 {
            match k {
                100 => rig.readings.command = None,
                170 => rig.readings.command = Some(Command { cut_off: false, ..WAIT }),
                400 => rig.readings.pose = None,
                420 => rig.readings.pose = Some(STAND),
                600 => rig.readings.battery_v = 10.2,
                _ => {}
            }
            let flight = rig.tick(None);
            if states.last().unwrap().0 != flight.state {
                states.push((flight.state, k));
            }
        }
        states
    };
    let expected = story(1_000_000);
    let names: Vec<State> = expected.iter().map(|(state, _)| *state).collect();
    use State::{Disarmed, Flying, Hold, Land};
    assert_eq!(names, [Flying, Hold, Flying, Hold, Flying, Land, Disarmed]);
    // A story is a thousand ticks: an interpreter has time for a few.
    let starts = [0_u32, 1 << 31, (1 << 31) - 5_000_000, 0_u32.wrapping_sub(30_000_000)];
    for start in starts.into_iter().skip(if cfg!(miri) { 3 } else { 0 }) {
        assert_eq!(story(start), expected, "start {start}");
    }
    for before_wrap_us in (0..12_000_000).step_by(if cfg!(miri) { 7_000_000 } else { 510_000 }) {
        assert_eq!(
            story(0_u32.wrapping_sub(before_wrap_us)),
            expected,
            "{before_wrap_us} us before the wrap"
        );
    }
}

#[test]
fn without_any_clock_there_is_a_fault() {
    let mut rig = Rig::flying(0);
    rig.readings.time_us = rig.readings.time_us.wrapping_sub(10_000);
    let flight = rig.tick(None);
    assert!(flight.conditions.has(Condition::ClockJumped), "the clock stands still");
    assert_eq!(flight.state, State::Land);
}

fn any_f32() -> impl Strategy<Value = f32> {
    prop_oneof![
        3 => any::<u32>().prop_map(f32::from_bits),
        6 => -2.0_f32..2.0,
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-45, -0.0]),
    ]
}

fn any_readings() -> impl Strategy<Value = Readings> {
    let three = || [any_f32(), any_f32(), any_f32()];
    let pose = prop::option::of((three(), three()))
        .prop_map(|pose| pose.map(|(position_m, attitude_rad)| Pose { position_m, attitude_rad }));
    let command =
        prop::option::of((any::<bool>(), [any_f32(), any_f32(), any_f32(), any_f32()], any::<bool>()))
            .prop_map(|command| {
                command.map(|(position, [a, b, c, d], cut_off)| Command {
                    mode: if position { control::Mode::Position } else { control::Mode::Attitude },
                    attitude_rad: [a, b],
                    yaw_rad: c,
                    z_m: d,
                    position_m: [b, c],
                    cut_off,
                    injection: [d, a, b, c],
                })
            });
    let request = prop::sample::select(vec![
        None,
        None,
        None,
        Some(Request::Arm),
        Some(Request::Disarm),
        Some(Request::Land),
        Some(Request::Cut),
    ]);
    let clock = prop_oneof![4 => Just(10_000_u32), 1 => any::<u32>(), 1 => 0_u32..200_000];
    let age = prop_oneof![4 => Just(0_u32), 1 => any::<u32>()];
    (clock, pose, age, prop::option::of(three()), any_f32(), command, request, any::<bool>()).prop_map(
        |(time_us, pose, pose_age_us, gyro_rad_s, battery, command, request, outputs_ready)| Readings {
            time_us,
            pose,
            pose_age_us,
            gyro_rad_s,
            battery_v: battery + 10.5,
            command,
            request,
            outputs_ready,
        },
    )
}

/// Where a flight of any readings begins: on the stand, armed, flying from it, or in the air.
fn beginning(of: usize, config: &Config) -> Rig {
    match of % 4 {
        0 => Rig::with(config, 0),
        1 => Rig::armed_with(config, 0),
        2 => {
            let mut rig = Rig::armed_with(config, 0);
            rig.readings.command = Some(Command { cut_off: false, ..WAIT });
            rig.tick(None);
            rig
        }
        _ => Rig { autopilot: Autopilot::in_flight(config).unwrap(), ..Rig::with(config, 0) },
    }
}

/// What is wrong with a tick, if anything: motor commands have to be inside the range, idle where
/// they have to be, nothing arms without a request, and cut is left by disarm alone.
fn wrong(before: State, input: &Readings, flight: &control::Flight) -> Option<&'static str> {
    let asked = |request| input.request == Some(request);
    let takes_off = before.motors_idle() && !flight.state.motors_idle();
    let arms = flight.state == State::Armed && before != State::Armed;
    let may_arm = before == State::Disarmed && asked(Request::Arm) && flight.preflight.ready();
    let rules = [
        (flight.tick.pwm.iter().all(|pwm| (1000.0..=2000.0).contains(pwm)), "a command out of range"),
        (!flight.state.motors_idle() || idles(flight), "motors that should idle"),
        (flight.tick.faults.internal.count == 0, "a result that is no number"),
        (!takes_off || (before, flight.state) == (State::Armed, State::Flying), "it takes off unarmed"),
        (before != State::Cut || flight.state == State::Cut || asked(Request::Disarm), "cut is left"),
        (!arms || may_arm, "it arms by itself"),
        (!flight.conditions.has(Condition::OutputsFailed) || flight.state != State::Flying, "it flies on"),
    ];
    rules.into_iter().find_map(|(holds, what)| (!holds).then_some(what))
}

proptest! {
    #![proptest_config(cases(10_000))]

    /// Whatever comes, in whatever order, from wherever, under every configuration.
    #[test]
    fn any_readings_are_survived(
        which in 0..configs().len(),
        from in 0_usize..4,
        inputs in prop::collection::vec(any_readings(), 1..40),
    ) {
        let mut rig = beginning(from, &configs()[which]);
        let mut time_us = rig.readings.time_us;
        for input in inputs {
            let before = rig.autopilot.state();
            time_us = time_us.wrapping_add(input.time_us);
            let input = Readings { time_us, ..input };
            let flight = *rig.autopilot.tick(&input);
            prop_assert_eq!(wrong(before, &input, &flight), None, "{:?} {:?}", before, flight);
        }
    }
}

/// Readings that a generator makes of its state: as above, without what it takes to shrink them.
struct Dice(u64);

impl Dice {
    /// SplitMix64.
    fn throw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let a = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let b = (a ^ a >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        b ^ b >> 31
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.throw().is_multiple_of(n)
    }

    fn float(&mut self) -> f32 {
        let bits = self.throw();
        match bits % 16 {
            0 | 1 => f32::from_bits((bits >> 32) as u32),
            2 => [f32::NAN, f32::INFINITY, f32::MAX, 1e-45][(bits >> 32) as usize % 4],
            _ => ((bits >> 32) as f32) * (4.0 / u32::MAX as f32) - 2.0,
        }
    }

    fn three(&mut self) -> [f32; 3] {
        [(); 3].map(|()| self.float())
    }

    fn readings(&mut self, time_us: u32) -> Readings {
        let position_m = [(); 3].map(|()| 0.1 * self.float());
        let pose = Pose { position_m, attitude_rad: [(); 3].map(|()| 0.1 * self.float()) };
        let mode = if self.one_in(2) { control::Mode::Position } else { control::Mode::Attitude };
        let ([a, b, c], injection) = (self.three(), [(); 4].map(|()| 10.0 * self.float()));
        let command = Command {
            mode,
            attitude_rad: [a, b],
            yaw_rad: c,
            z_m: self.float(),
            position_m: [b, c],
            cut_off: self.one_in(8),
            injection,
        };
        let requests = [Request::Arm, Request::Disarm, Request::Land, Request::Cut];
        let request = requests[self.throw() as usize % 4];
        Readings {
            time_us,
            pose: (!self.one_in(4)).then_some(pose),
            pose_age_us: if self.one_in(8) { self.throw() as u32 } else { 0 },
            gyro_rad_s: (!self.one_in(4)).then(|| self.three()),
            battery_v: 10.5 + self.float(),
            command: (!self.one_in(4)).then_some(command),
            request: self.one_in(10).then_some(request),
            outputs_ready: !self.one_in(4),
        }
    }
}

/// A million flights, every configuration from every beginning. The number of a flight is its seed.
#[test]
fn a_million_flights_of_any_readings_are_survived() {
    let configs = configs();
    for (k, config) in configs.iter().enumerate() {
        for of in 0..4 {
            let beginning = beginning(of, config);
            for flight_number in 0..u64::from(cases(50_000).cases) {
                let mut autopilot = beginning.autopilot;
                let mut dice = Dice(flight_number << 8 | (4 * k + of) as u64);
                let mut time_us = beginning.readings.time_us;
                for _ in 0..1 + dice.throw() % 16 {
                    let leap = if dice.one_in(16) { dice.throw() as u32 } else { 10_000 };
                    time_us = time_us.wrapping_add(leap);
                    let (before, input) = (autopilot.state(), dice.readings(time_us));
                    let flight = autopilot.tick(&input);
                    let wrong = wrong(before, &input, flight);
                    assert!(
                        wrong.is_none(),
                        "{wrong:?}: {before:?} configuration {k} from {of}, flight {flight_number}"
                    );
                }
            }
        }
    }
}

/// Every number of a configuration in its place.
fn numbers(value: &mut toml::Value) -> Vec<&mut toml::Value> {
    match value {
        toml::Value::Table(table) => table.iter_mut().flat_map(|(_, value)| numbers(value)).collect(),
        toml::Value::Array(list) => list.iter_mut().flat_map(numbers).collect(),
        toml::Value::Float(_) | toml::Value::Integer(_) => vec![value],
        _ => Vec::new(),
    }
}

/// What could stand in the place of a number: what is none, the ends of all ranges, and any bits.
fn odd(dice: &mut Dice, was: &toml::Value, draw: u64) -> toml::Value {
    const ODD: [f64; 14] = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        5e-324,
        1e-45,
        3.5e38,
        1e12,
        -1.0,
        0.0,
        -0.0,
        1.0,
    ];
    let bits = dice.throw();
    match was {
        toml::Value::Integer(_) => {
            [0, 1, -1, i64::from(u32::MAX), i64::MAX, bits as i64][draw as usize % 6].into()
        }
        toml::Value::Float(was) => match (ODD.get(draw as usize), draw % 3) {
            (Some(odd), _) => (*odd).into(),
            (None, 0) => f64::from_bits(bits).into(),
            // Where ranges end: up to 2^16 times more or less, of either sign.
            (None, 1) => {
                let part = f64::from(1_u32 << (bits % 17)) * if bits >> 63 == 0 { 1.0 } else { -1.0 };
                if bits >> 62 & 1 == 0 { was * part } else { was / part }.into()
            }
            (None, _) => (was * (0.5 + (bits >> 11) as f64 / (1_u64 << 53) as f64)).into(),
        },
        other => other.clone(),
    }
}

/// Whatever stands in the place of any number of a gains file is refused, or what flies with it gives commands inside the file's range.
#[test]
fn any_number_of_a_configuration_is_refused_or_flown_inside_the_range() {
    let mut dice = Dice(7);
    // As many draws as usual, or every so manyth of them: the first ones are those of `ODD`.
    let every = (2000 / cases(2000).cases.max(1) as usize).max(1);
    let (mut tried, mut refused, mut flown) = (0, 0, 0);
    for config in configs() {
        let mut table = toml::Value::try_from(config).unwrap();
        for place in (0..numbers(&mut table).len()).step_by(if cfg!(miri) { 29 } else { 1 }) {
            for draw in (0..2000).step_by(every) {
                tried += 1;
                let mut changed = table.clone();
                let number = numbers(&mut changed).swap_remove(place);
                *number = odd(&mut dice, number, draw);
                let config = changed.try_into::<Config>();
                let autopilot = config.ok().and_then(|c| Some((c, Autopilot::in_flight(&c).ok()?)));
                let Some((config, mut autopilot)) = autopilot else {
                    refused += 1;
                    continue;
                };
                flown += 1;
                let [low, high] = config.command_range.map(|end| end as f32);
                for tick in 1..=8 {
                    let flight = autopilot.tick(&dice.readings(tick * 10_000));
                    let is_inside = flight.tick.pwm.iter().all(|pwm| (low..=high).contains(pwm));
                    assert!(is_inside && flight.tick.faults.internal.count == 0, "{config:?}: {flight:?}");
                }
            }
        }
    }
    println!("{refused} configurations were refused, {flown} flown");
    assert!(refused > tried / 10 && flown > tried / 10, "{refused} {flown} of {tried}");
}
