//! Missions one after the other, as a ground station flies them: for whoever brings a craft along.
//!
//! A mission: poses come, the ground asks to arm, the craft takes off, flies a script of its own, and
//! comes down when its battery is low: after every other mission because the pilot asks for it at the
//! warning, else because nobody does and the supervisor lands it at the critical level. Then it gets
//! a fresh battery. The ground's clock runs 50 parts in a million fast, and it is set so that the
//! clocks of ground and craft wrap at different times (each every 71.6 minutes).
//!
//! Nothing is forgiven: a state that is not that of the mission, a condition that is neither asked for
//! nor the battery's, a crash.

use ::craft::convert;
use control::{Condition, Conditions, Pose};
use proto::{Command, Message, Request, State, Supervision, TimedPose, Timer};

use super::crash::Watch;
use crate::flight::{Script, Start};

/// By how much the ground's clock is fast.
const GROUND_SKEW: f64 = 50e-6;
/// The ground's clock at the start, us: it wraps 20 minutes after.
const GROUND_START_US: u32 = 0_u32.wrapping_sub(1_200_000_000);
/// Poses come for so long before the ground asks to arm, s.
const ON_THE_FLOOR_S: f64 = 2.0;
/// It climbs for so long, where it stood, before the script begins, s.
const CLIMBS_S: f64 = 4.0;
/// A mission takes three minutes; one that takes so long, s, does not end.
const ENDLESS_S: f64 = 600.0;

/// What may be found in a mission: what was asked for, and what a battery does.
const EXPECTED: [Condition; 6] = [
    Condition::ArmRequested,
    Condition::FlightRequested,
    Condition::LandRequested,
    Condition::BatteryLow,
    Condition::BatteryCritical,
    Condition::Landed,
];

/// Where a mission is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// On the floor, with a fresh battery.
    Waiting,
    /// The ground has asked to arm.
    Arming,
    /// In the pilot's hands.
    Flying,
    /// Coming down.
    Landing,
}

/// What is seen of the craft in a tick.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// By the tracker, at the tick's beginning.
    pub pose: Pose,
    /// Where it really is, inertial NED, m.
    pub position_m: [f64; 3],
    /// What its telemetry says, if it came.
    pub supervision: Option<Supervision>,
}

/// The missions as they go on.
#[derive(Debug)]
pub struct Missions {
    watch: Watch,
    period_s: f64,
    /// The script of each mission, by its number.
    scripts: fn(u64) -> Script,
    seed: u64,
    time_s: f64,
    flown_s: f64,
    frame: u32,
    flown: u64,
    /// When the mission, and when its flight began, s.
    began_s: f64,
    took_off_s: f64,
    phase: Phase,
    state: State,
    script: Script,
    /// Over where it took off.
    start: Start,
    battery_low: bool,
    battery_due: bool,
}

impl Missions {
    /// Of a craft that is disarmed on the floor and ticks every `period_s`.
    pub fn new(scripts: fn(u64) -> Script, seed: u64, period_s: f64) -> Self {
        Self {
            watch: Watch::new(period_s, 0.0, State::Disarmed),
            period_s,
            scripts,
            seed,
            time_s: 0.0,
            flown_s: 0.0,
            frame: 0,
            flown: 0,
            began_s: 0.0,
            took_off_s: 0.0,
            phase: Phase::Waiting,
            state: State::Disarmed,
            script: scripts(seed),
            start: Start { position_m: [0.0, 0.0, -1.0], yaw_rad: 0.0 },
            battery_low: false,
            battery_due: false,
        }
    }

    /// A tour of the cage of its own for each mission.
    pub fn tours(seed: u64) -> Script {
        Script::tour(seed, ENDLESS_S)
    }

    /// Missions that were flown to their end.
    pub fn flown(&self) -> u64 {
        self.flown
    }

    /// Simulated time so far, and of which in the air, s.
    pub fn times_s(&self) -> [f64; 2] {
        [self.time_s, self.flown_s]
    }

    /// Says once after each mission that the craft is to get a fresh battery.
    pub fn battery_is_due(&mut self) -> bool {
        std::mem::take(&mut self.battery_due)
    }

    /// One tick of the craft, and what the ground says to it.
    ///
    /// # Errors
    /// What must not be, in words.
    pub fn tick(&mut self, seen: &Seen) -> Result<Vec<Message>, String> {
        let taken_us = self.ground_us();
        self.time_s += self.period_s;
        if let Some(Supervision { state, conditions, .. }) = seen.supervision {
            if self.phase == Phase::Waiting {
                let ([x, y, _], [_, _, yaw]) = (seen.pose.position_m, seen.pose.attitude_rad);
                self.start = Start { position_m: [x.into(), y.into(), -1.0], yaw_rad: yaw.into() };
            }
            let mission = self.flown + 1;
            let at_s = self.time_s;
            self.see(seen.position_m, state, conditions)
                .map_err(|problem| format!("mission {mission} after {at_s:.2} s: {problem}"))?;
        }
        let pose = convert::pose_message(&seen.pose);
        let mut said = vec![
            Message::Timer(Timer { ground_us: self.ground_us() }),
            Message::Pose(TimedPose { frame: self.frame, ground_us: taken_us, pose }),
            Message::Command(self.command()),
        ];
        self.frame = self.frame.wrapping_add(1);
        said.extend(self.request().map(Message::Request));
        Ok(said)
    }

    /// The ground's clock now.
    fn ground_us(&self) -> u32 {
        // A day of microseconds is exact in f64; the clock counts modulo 2^32.
        GROUND_START_US.wrapping_add((self.time_s * (1.0 + GROUND_SKEW) * 1e6) as u64 as u32)
    }

    /// What the ground sees of the craft.
    fn see(&mut self, position_m: [f64; 3], state: State, conditions: u32) -> Result<(), String> {
        if let Some(crash) = self.watch.look(position_m, state, conditions) {
            return Err(format!("{crash:?}"));
        }
        let found = Conditions::from_bits(conditions);
        // While nobody flies, a tracker and a ground that begin to speak are no faults.
        let flies = matches!(self.phase, Phase::Flying | Phase::Landing);
        if let Some(other) = found.iter().find(|found| flies && !EXPECTED.contains(found)) {
            return Err(format!("{other:?} in {state:?}"));
        }
        self.battery_low |= flies && found.has(Condition::BatteryLow);
        let mission_s = self.time_s - self.began_s;
        if mission_s > ENDLESS_S {
            return Err(format!("{:?} does not end, in {state:?}", self.phase));
        }
        self.state = state;
        self.flown_s += if flies { self.period_s } else { 0.0 };
        match (self.phase, state) {
            (Phase::Waiting, State::Disarmed) if mission_s >= ON_THE_FLOOR_S => self.phase = Phase::Arming,
            (Phase::Waiting, State::Disarmed)
            | (Phase::Arming, State::Disarmed | State::Armed)
            | (Phase::Flying, State::Flying)
            | (Phase::Landing, State::Land) => {}
            (Phase::Arming, State::Flying) => {
                (self.phase, self.took_off_s, self.battery_low) = (Phase::Flying, self.time_s, false);
            }
            (Phase::Flying, State::Land) if self.battery_low => self.phase = Phase::Landing,
            (Phase::Landing, State::Disarmed) => self.change_battery(),
            (phase, state) => return Err(format!("{state:?} while {phase:?}")),
        }
        Ok(())
    }

    /// The mission is over.
    fn change_battery(&mut self) {
        self.flown += 1;
        self.battery_due = true;
        (self.phase, self.began_s) = (Phase::Waiting, self.time_s);
        self.script = (self.scripts)(self.seed.wrapping_add(self.flown));
    }

    fn command(&self) -> Command {
        match self.phase {
            Phase::Waiting => Command::IDLE,
            Phase::Arming if self.state == State::Disarmed => Command::IDLE,
            Phase::Arming | Phase::Flying | Phase::Landing => {
                let flying_s = if self.phase == Phase::Arming { 0.0 } else { self.time_s - self.took_off_s };
                let tour_s = (flying_s - CLIMBS_S).max(0.0);
                convert::command_message(&self.script.command(&self.start, tour_s))
            }
        }
    }

    fn request(&self) -> Option<Request> {
        let lands_itself = self.flown % 2 == 1;
        match self.phase {
            Phase::Arming if self.state == State::Disarmed => Some(Request::Arm),
            Phase::Flying if self.battery_low && !lands_itself => Some(Request::Land),
            _ => None,
        }
    }
}
