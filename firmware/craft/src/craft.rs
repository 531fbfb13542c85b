//! A craft: its autopilot, the messages it has received, and those it has to send.

use control::gains::{InnerLoop, Law, PositionLoop};
use control::{Autopilot, Command, Config, ConfigError, Flight, Mode, Pose, Readings, Request, State};
use heapless::Deque;
use proto::{
    Answer, Counters, Ending, Gains, Identity, ImuSample, Loop, MIN_VERSION, Message, Opened, Telemetry,
    TimedPose, VERSION,
};

use crate::convert;
use crate::ground_clock::GroundClock;

/// How many answers may wait for the end of the tick. Further requests between two ticks take
/// effect without an answer.
const OUTBOX: usize = 8;

/// What is fixed when a craft boots, beside its configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Setup {
    /// SHA-256 of the gains and vehicle file that the configuration was read from:
    /// `gains_file::craft_sha256`.
    pub vehicle_sha256: [u8; 32],
    /// Version of the program: major, minor, patch.
    pub program: [u16; 3],
    /// Ticks from one telemetry message to the next; 0 counts as 1.
    pub telemetry_every: u16,
    /// How it ended before it was started.
    pub last_end: Ending,
}

/// What a program measured itself for one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inputs {
    /// The craft's monotonic clock, us modulo 2^32.
    pub time_us: u32,
    /// The newest IMU sample since the tick before, body FRD.
    pub imu: Option<ImuSample>,
    /// Battery voltage, V; NaN if it could not be measured.
    pub battery_v: f32,
    /// Battery current, A, if it is measured.
    pub current_a: Option<f32>,
    /// Do the program's outputs work, and did its own checks pass?
    pub outputs_ready: bool,
    /// How long after its time the tick began, us.
    pub lateness_us: u32,
}

/// What the link has counted, for telemetry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkStatus {
    /// Packets that never came, by the gaps in their numbers.
    pub lost: u32,
    /// Packets refused: damaged, forged, replayed, or bytes that were no packet.
    pub refused: u32,
}

impl From<proto::Statistics> for LinkStatus {
    fn from(counted: proto::Statistics) -> Self {
        let proto::Statistics { lost, refused, .. } = counted;
        Self { lost, refused }
    }
}

/// A request that has been heard, and the number of the packet that it came in.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Asked {
    number: u64,
    request: Request,
}

/// What has come since the tick before.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Inbox {
    pose: Option<Pose>,
    /// When it was taken, by the ground.
    taken_us: u32,
    command: Option<Command>,
    asked: Option<Asked>,
}

/// A craft, disarmed at first.
#[derive(Debug, Clone)]
pub struct Craft {
    setup: Setup,
    config: Config,
    autopilot: Autopilot,
    inbox: Inbox,
    outbox: Deque<Answer, OUTBOX>,
    /// Number of ticks so far, modulo 2^32.
    tick: u32,
    time_us: u32,
    ground_us: u32,
    ground_clock: GroundClock,
    /// When the newest pose was taken, by the ground.
    newest_pose_us: u32,
    mode: Mode,
    imu: Option<ImuSample>,
    battery_v: f32,
    current_a: Option<f32>,
    /// Greatest lateness since the telemetry before, us.
    jitter_us: u32,
    /// Messages that are not for a craft.
    misdirected: u32,
    /// Its identity is to be said, and then how it ended last.
    introduce: bool,
    tell_last_end: bool,
    /// Ticks until telemetry is due.
    until_telemetry: u16,
    telemetry_due: bool,
}

impl Craft {
    /// A disarmed craft that has received nothing yet.
    ///
    /// # Errors
    /// The first parameter that cannot be flown with, by name.
    pub fn new(config: &Config, setup: Setup) -> Result<Self, ConfigError> {
        Ok(Self {
            setup,
            config: *config,
            autopilot: Autopilot::new(config)?,
            inbox: Inbox::default(),
            outbox: Deque::new(),
            tick: 0,
            time_us: 0,
            ground_us: 0,
            ground_clock: GroundClock::default(),
            newest_pose_us: 0,
            mode: Mode::Attitude,
            imu: None,
            battery_v: f32::NAN,
            current_a: None,
            jitter_us: 0,
            misdirected: 0,
            introduce: false,
            tell_last_end: false,
            until_telemetry: 0,
            telemetry_due: false,
        })
    }

    /// Receives what has come in a session. To whoever begins one the craft introduces itself; a ground
    /// station that begins one has been started anew, and its clock with it.
    pub fn receive(&mut self, opened: &Opened) {
        if opened.is_first {
            self.introduce();
            if opened.is_of_station() {
                self.ground_clock = GroundClock::default();
            }
        }
        let is_overtaken_by_a_newer_one = |timed: &TimedPose| {
            opened.is_overtaken && timed.ground_us.wrapping_sub(self.newest_pose_us).cast_signed() <= 0
        };
        match &opened.message {
            Message::Pose(timed) if is_overtaken_by_a_newer_one(timed) => {}
            message => self.hear(opened.number, message),
        }
    }

    /// Receives a message of the ground, in the packet with this number. It takes effect in the
    /// next tick; gains do at once, while disarmed.
    pub fn hear(&mut self, number: u64, message: &Message) {
        match message {
            Message::Pose(timed) => {
                (self.inbox.pose, self.inbox.taken_us) = (Some(convert::pose(&timed.pose)), timed.ground_us);
                self.newest_pose_us = timed.ground_us;
            }
            Message::Command(command) => self.inbox.command = Some(convert::command(command)),
            Message::Request(request) => self.ask(Asked { number, request: convert::request(*request) }),
            Message::Gains(gains) => {
                let done = self.retune(gains).is_ok();
                self.answer(number, done);
            }
            Message::Timer(timer) => {
                self.ground_us = timer.ground_us;
                self.ground_clock.hear(timer.ground_us, self.time_us);
            }
            Message::Who => self.introduce(),
            Message::Input(_)
            | Message::Output(_)
            | Message::Readings(_)
            | Message::Outcome(_)
            | Message::Telemetry(_)
            | Message::Identity(_)
            | Message::Answer(_)
            | Message::LastEnd(_) => self.misdirected = self.misdirected.saturating_add(1),
        }
    }

    /// The identity goes out with the next messages.
    fn introduce(&mut self) {
        (self.introduce, self.tell_last_end) = (true, true);
    }

    /// One control period. Total: whatever came, the motor commands `tick.pwm` are finite and
    /// inside the range.
    #[inline]
    pub fn tick(&mut self, inputs: &Inputs) -> &Flight {
        let Inbox { pose, taken_us, command, asked } = core::mem::take(&mut self.inbox);
        let readings = Readings {
            time_us: inputs.time_us,
            pose,
            pose_age_us: self.ground_clock.age_us(taken_us, inputs.time_us),
            gyro_rad_s: inputs.imu.map(|imu| imu.gyro_rad_s),
            battery_v: inputs.battery_v,
            command,
            request: asked.map(|asked| asked.request),
            outputs_ready: inputs.outputs_ready,
        };
        self.autopilot.tick(&readings);
        self.tick = self.tick.wrapping_add(1);
        (self.time_us, self.imu) = (inputs.time_us, inputs.imu);
        (self.battery_v, self.current_a) = (inputs.battery_v, inputs.current_a);
        self.jitter_us = self.jitter_us.max(inputs.lateness_us);
        self.mode = match self.autopilot.flight().tick.terms.outer {
            Some(_) => Mode::Position,
            None => Mode::Attitude,
        };
        if let Some(Asked { number, request }) = asked {
            self.answer(number, is_done(request, self.autopilot.state()));
        }
        match self.until_telemetry.checked_sub(1) {
            Some(left @ 1..) => self.until_telemetry = left,
            _ => (self.until_telemetry, self.telemetry_due) = (self.setup.telemetry_every.max(1), true),
        }
        self.autopilot.flight()
    }

    /// The next message to the ground: answers, identity, last end, telemetry, in this order. To be called
    /// after a tick until there are no more.
    pub fn next_message(&mut self, link: &LinkStatus) -> Option<Message> {
        if let Some(answer) = self.outbox.pop_front() {
            return Some(Message::Answer(answer));
        }
        if core::mem::take(&mut self.introduce) {
            return Some(Message::Identity(self.identity()));
        }
        if core::mem::take(&mut self.tell_last_end) {
            return Some(Message::LastEnd(self.setup.last_end));
        }
        core::mem::take(&mut self.telemetry_due).then(|| {
            let telemetry = self.telemetry(link);
            self.jitter_us = 0;
            Message::Telemetry(telemetry)
        })
    }

    /// The craft's identity.
    pub fn identity(&self) -> Identity {
        Identity {
            versions: [MIN_VERSION, VERSION],
            program: self.setup.program,
            vehicle_sha256: self.setup.vehicle_sha256,
            state: convert::state_message(self.autopilot.state()),
        }
    }

    /// Everything about the last tick.
    pub fn telemetry(&self, link: &LinkStatus) -> Telemetry {
        let flight = self.autopilot.flight();
        let terms = &flight.tick.terms;
        Telemetry {
            // The first tick has number 0.
            tick: self.tick.wrapping_sub(1),
            craft_us: self.time_us,
            ground_us: self.ground_us,
            supervision: convert::supervision(flight),
            mode: convert::mode_message(self.mode),
            attitude_command_rad: terms.attitude_command_rad,
            z_command_m: terms.z_command_m,
            tracked: proto::Pose { position_m: terms.position_m, attitude_rad: terms.attitude_rad },
            tracked_rates_rad_s: terms.body_rates_rad_s,
            imu: self.imu,
            thrust: terms.thrust,
            torque: terms.torque,
            pwm: flight.tick.pwm,
            refused: convert::refusal(&flight.tick.refused),
            battery_v: self.battery_v,
            current_a: self.current_a,
            counters: self.counters(link),
        }
    }

    /// What the craft is doing.
    pub fn state(&self) -> State {
        self.autopilot.state()
    }

    /// The motor, 0 to 3, that failed first, until the pilot has taken note of it.
    pub fn failed_motor(&self) -> Option<u8> {
        self.autopilot.failed_motor()
    }

    /// All of the last tick.
    pub fn flight(&self) -> &Flight {
        self.autopilot.flight()
    }

    fn counters(&self, link: &LinkStatus) -> Counters {
        let found = self.autopilot.counters();
        Counters {
            jitter_us: self.jitter_us,
            overruns: found.overruns,
            clock_jumps: found.clock_jumps,
            poses_refused: found.poses_refused,
            imu_refused: found.imu_refused,
            commands_refused: found.commands_refused,
            faults: convert::fault_count(&self.autopilot.flight().tick.faults),
            packets_lost: link.lost,
            packets_refused: link.refused.saturating_add(self.misdirected),
        }
    }

    /// Keeps the more severe of two requests; the other one is not done.
    fn ask(&mut self, new: Asked) {
        let dropped = match self.inbox.asked {
            Some(kept) if severity(kept.request) > severity(new.request) => Some(new),
            kept => {
                self.inbox.asked = Some(new);
                // A repeated request is one request; the newest packet gets the answer.
                kept.filter(|kept| kept.request != new.request)
            }
        };
        if let Some(Asked { number, .. }) = dropped {
            self.answer(number, false);
        }
    }

    fn answer(&mut self, to: u64, done: bool) {
        let answer = Answer { to, done, preflight: self.autopilot.flight().preflight.bits() };
        // A full outbox keeps what is in it.
        let _ = self.outbox.push_back(answer);
    }

    /// Flies with other gains of one loop from now on, if they can be flown with and nothing flies
    /// yet.
    fn retune(&mut self, gains: &Gains) -> Result<(), NotRetuned> {
        let mut config = self.config;
        let loops = match &mut config.law {
            Law::ModelBased(law) => &mut law.loops,
            Law::HandTuned(law) => &mut law.loops,
        };
        let set_inner = |inner: &mut InnerLoop| (inner.kp, inner.ki, inner.kd) = gains_of(gains);
        let set_outer = |outer: &mut PositionLoop| (outer.kp, outer.ki, outer.kd) = gains_of(gains);
        match gains.of {
            Loop::Roll => set_inner(&mut loops.roll),
            Loop::Pitch => set_inner(&mut loops.pitch),
            Loop::Yaw => set_inner(&mut loops.yaw),
            Loop::Altitude => set_inner(&mut loops.altitude),
            Loop::X => set_outer(&mut loops.x),
            Loop::Y => set_outer(&mut loops.y),
        }
        if self.autopilot.retune(&config).map_err(|_| NotRetuned)? {
            self.config = config;
            return Ok(());
        }
        Err(NotRetuned)
    }
}

/// The ground learns only that it was not done: the gains were out of range, or the craft was not
/// disarmed.
struct NotRetuned;

fn gains_of(gains: &Gains) -> (f64, f64, f64) {
    (f64::from(gains.kp), f64::from(gains.ki), f64::from(gains.kd))
}

/// The supervisor's order.
fn severity(request: Request) -> u8 {
    match request {
        Request::Arm => 0,
        Request::Land => 1,
        Request::Cut => 2,
        Request::Disarm => 3,
    }
}

/// Does the craft do what was requested?
fn is_done(request: Request, state: State) -> bool {
    match request {
        Request::Arm => state == State::Armed,
        Request::Disarm => state == State::Disarmed,
        Request::Land => matches!(state, State::Land | State::Disarmed),
        Request::Cut => state == State::Cut,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETUP: Setup =
        Setup { vehicle_sha256: [1; 32], program: [0, 1, 2], telemetry_every: 3, last_end: Ending::Watchdog };
    const LINK: LinkStatus = LinkStatus { lost: 0, refused: 0 };
    const INPUTS: Inputs = Inputs {
        time_us: 0,
        imu: None,
        battery_v: 11.1,
        current_a: None,
        outputs_ready: true,
        lateness_us: 0,
    };

    fn messages(craft: &mut Craft) -> Vec<Message> {
        core::iter::from_fn(|| craft.next_message(&LINK)).collect()
    }

    /// The order of the state machine: whatever disarms or cuts is never undone by what comes
    /// behind it.
    #[test]
    fn the_most_severe_request_counts_and_each_is_answered() {
        let mut craft = Craft::new(&Config::thesis(), SETUP).unwrap();
        for (number, request) in [
            (1, proto::Request::Arm),
            (2, proto::Request::Cut),
            (3, proto::Request::Arm),
            (4, proto::Request::Land),
        ] {
            craft.hear(number, &Message::Request(request));
        }
        craft.tick(&INPUTS);
        assert_eq!(craft.state(), State::Cut);
        let answers: Vec<(u64, bool)> = messages(&mut craft)
            .iter()
            .filter_map(|message| if let Message::Answer(a) = message { Some((a.to, a.done)) } else { None })
            .collect();
        assert_eq!(answers, [(1, false), (3, false), (4, false), (2, true)]);
    }

    #[test]
    fn telemetry_comes_every_third_tick_and_the_identity_when_asked() {
        let mut craft = Craft::new(&Config::thesis(), SETUP).unwrap();
        let telemetry = [(); 7].map(|()| {
            craft.tick(&INPUTS);
            matches!(messages(&mut craft)[..], [Message::Telemetry(_)])
        });
        assert_eq!(telemetry, [true, false, false, true, false, false, true]);
        craft.hear(9, &Message::Who);
        let [Message::Identity(identity), Message::LastEnd(ending)] = messages(&mut craft)[..] else {
            panic!("the identity and the last end")
        };
        assert_eq!((identity.program, ending), ([0, 1, 2], Ending::Watchdog));
        assert_eq!(messages(&mut craft), []);
    }

    /// Of every length of the wait up to 300 ticks, and the longest ones: 0 counts as 1.
    #[test]
    fn telemetry_comes_in_its_ticks_and_their_number_wraps() {
        let longest = [1 << 15, u16::MAX - 1, u16::MAX].into_iter().filter(|_| !cfg!(miri));
        let lengths = (0..if cfg!(miri) { 4 } else { 300 }).chain(longest);
        for telemetry_every in lengths {
            let mut craft = Craft::new(&Config::thesis(), Setup { telemetry_every, ..SETUP }).unwrap();
            craft.tick = u32::MAX - 1;
            let every = u64::from(telemetry_every.max(1));
            for k in 0..2 * every + 1 {
                craft.tick(&INPUTS);
                let due = core::mem::take(&mut craft.telemetry_due);
                assert_eq!(due, k % every == 0, "{k} of {telemetry_every}");
                let number = (u64::from(u32::MAX - 1) + k) % (1 << 32);
                assert_eq!(u64::from(craft.telemetry(&LINK).tick), number);
            }
        }
    }

    /// Counts of the link and of messages for others, about the greatest number.
    #[test]
    fn counts_of_refused_packets_stay_at_the_greatest_number() {
        let mut craft = Craft::new(&Config::thesis(), SETUP).unwrap();
        for (misdirected, refused) in
            crate::residues::residues().into_iter().flat_map(|a| crate::residues::FEW.map(|b| (a, b)))
        {
            craft.misdirected = misdirected;
            craft.hear(0, &Message::Answer(Answer { to: 0, done: true, preflight: 0 }));
            let counted = craft.telemetry(&LinkStatus { lost: 0, refused }).counters.packets_refused;
            let least = |wide: u64| wide.min(u32::MAX.into());
            assert_eq!(u64::from(counted), least(least(u64::from(misdirected) + 1) + u64::from(refused)));
        }
    }
}
