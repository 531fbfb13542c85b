//! The ground station without sockets, clocks and terminals: what comes in goes to the right place, what is due goes out.
//!
//! The caller hands in packets, sightings, wishes and the time (us of one steady clock), and takes packets out. What is sent:
//!
//! - poses, each as soon as it is seen;
//! - commands, [`Settings::command_hz`] times a second, from the first telemetry on: a craft that flies already is not cut;
//! - the ramp of time at irregular intervals ([`ramp_interval_s`]);
//! - requests and gains, each [`AGAIN_S`] until the craft has done or refused them: UDP may lose them, and each is harmless twice;
//! - `Who` each second until there is an identity, and when telemetry stays out.
//!
//! What happens is told as [`Told`] lines, once each: changes of state, faults by their names, refusals, the clock's pace.

use std::collections::VecDeque;

use control::condition::{Condition, Conditions};
use control::supervisor::Preflight;
use proto::{Gains, Identity, Message, Pose, Request, State, Statistics, Telemetry, TimedPose, Timer};

use crate::link::{Link, LinkError};
use crate::mission::{Ask, Known, Mission, Progress, Step};
use crate::mocap::Heard;
use crate::ramps::{ClockEvent, Pace, Ramps, ramp_interval_s};
use crate::recorder::{Entry, Level, LinkRecord, Recorder};

/// Between two sendings of a request that is not answered, s.
pub const AGAIN_S: f64 = 0.1;
/// Telemetry that stays out for so long is lost, s.
pub const SILENCE_S: f64 = 1.0;
/// Poses that stay out for so long are told, s.
const BLIND_S: f64 = 0.5;
/// Least rate at which commands may be sent: the craft holds after half a second without one.
pub const LEAST_COMMAND_HZ: f64 = 4.0;
/// Between two records of the link, us.
const LINK_EVERY_US: u64 = 250_000;
/// Rates and losses are averaged over this, us.
const AVERAGE_US: u64 = 2_000_000;
/// The same refusal is told again after this, us.
const TOLD_AGAIN_US: u64 = 10_000_000;

/// What people can wish for in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the words say it")]
pub enum Wish {
    Arm,
    TakeOff,
    Pattern,
    Land,
    Disarm,
    Cut,
}

/// A line for people.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// When, us of the ground's clock.
    pub at_us: u64,
    /// How bad it is.
    pub level: Level,
    /// The line.
    pub text: String,
}

/// What a station needs to know.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Commands in a second.
    pub command_hz: f64,
    /// What to do.
    pub steps: Vec<Step>,
    /// What [`Wish::Pattern`] does.
    pub pattern: Vec<Step>,
    /// Height of [`Wish::TakeOff`], m.
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
        "{0} commands a second: from {LEAST_COMMAND_HZ} (the craft holds after 0.5 s without one) to 500"
    )]
    CommandRate(f64),
    /// A height that is none.
    #[error("a take-off to {0} m: from 0.1 m to 100 m")]
    Height(f64),
}

/// Rate and loss of a stream over the last seconds, from counts that only grow.
#[derive(Debug, Clone, Default)]
struct Average {
    /// Times, counts that came and counts that did not.
    marks: VecDeque<(u64, u64, u64)>,
}

impl Average {
    fn mark(&mut self, now_us: u64, came: u64, lost: u64) {
        self.marks.push_back((now_us, came, lost));
        while self.marks.front().is_some_and(|(at, ..)| at + AVERAGE_US < now_us) {
            self.marks.pop_front();
        }
    }

    /// In a second, and the part that was lost.
    fn rate_and_loss(&self) -> (f64, f64) {
        let (Some(first), Some(last)) = (self.marks.front(), self.marks.back()) else { return (0.0, 0.0) };
        let (came, lost) = (last.1.saturating_sub(first.1) as f64, last.2.saturating_sub(first.2) as f64);
        let elapsed_s = last.0.saturating_sub(first.0) as f64 * 1e-6;
        let rate = if elapsed_s > 0.0 { came / elapsed_s } else { 0.0 };
        (rate, if lost > 0.0 { lost / (came + lost) } else { 0.0 })
    }
}

/// What has come of the tracker.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tracker {
    /// The last pose, and when it came.
    pub last: Option<(Pose, u64)>,
    /// Frames with the craft in them.
    pub seen: u64,
    /// Frames in which the cameras had lost it.
    pub not_seen: u64,
    /// Datagrams that could not be used.
    pub refused: u64,
    /// Age of the last frame when it came, s, as far as the tracker says.
    pub age_s: f64,
}

/// Everything about now, for a view.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// The ground's clock, us.
    pub now_us: u64,
    /// The last telemetry, and when it came.
    pub telemetry: Option<(Telemetry, u64)>,
    /// Who the craft is.
    pub identity: Option<Identity>,
    /// Delay, pace and losses.
    pub link: Option<LinkRecord>,
    /// What is made of the pace.
    pub pace: Pace,
    /// The tracker.
    pub tracker: Tracker,
    /// What has come from the craft.
    pub statistics: Statistics,
    /// What is being done.
    pub doing: String,
    /// The last lines that were told, oldest first.
    pub told: Vec<Told>,
    /// The file that is being recorded.
    pub recording: Option<String>,
}

/// Something that is asked for again and again.
#[derive(Debug, Clone, Copy)]
struct Pending {
    ask: Ask,
    /// Numbers of the packets in which it was asked, oldest and newest.
    numbers: [u64; 2],
    next_us: u64,
}

/// The station.
#[derive(Debug)]
pub struct Station {
    settings: Settings,
    link: Link,
    mission: Mission,
    ramps: Ramps,
    recorder: Option<Recorder>,
    telemetry: Option<(Telemetry, u64)>,
    /// Conditions in the tick in which the craft went into its state.
    found: u32,
    identity: Option<Identity>,
    tracker: Tracker,
    pending: Option<Pending>,
    next_command_us: u64,
    next_ramp_us: u64,
    ramps_sent: u64,
    next_who_us: u64,
    next_link_us: u64,
    packets_sent: u64,
    down: Average,
    up: Average,
    poses: Average,
    told: VecDeque<Told>,
    untold: VecDeque<Told>,
    refusals: Vec<(String, u64)>,
    out: Vec<Vec<u8>>,
    silent: bool,
    blind: bool,
    /// Something went wrong that a script has to answer for.
    faulty: bool,
    started_us: Option<u64>,
}

/// Lines that a view can show.
const REMEMBERED: usize = 200;

impl Station {
    /// A station that has heard nothing yet.
    ///
    /// # Errors
    /// Settings that cannot be used.
    pub fn new(settings: Settings, link: Link, recorder: Option<Recorder>) -> Result<Self, SettingsError> {
        if !(settings.command_hz >= LEAST_COMMAND_HZ && settings.command_hz <= 500.0) {
            return Err(SettingsError::CommandRate(settings.command_hz));
        }
        if !(settings.take_off_m >= 0.1 && settings.take_off_m <= 100.0) {
            return Err(SettingsError::Height(settings.take_off_m));
        }
        let mission =
            Mission::new(settings.steps.clone(), 1.0 / settings.command_hz, settings.excitation_gain);
        Ok(Self {
            settings,
            link,
            mission,
            ramps: Ramps::default(),
            recorder,
            telemetry: None,
            found: 0,
            identity: None,
            tracker: Tracker::default(),
            pending: None,
            next_command_us: 0,
            next_ramp_us: 0,
            ramps_sent: 0,
            next_who_us: 0,
            next_link_us: 0,
            packets_sent: 0,
            down: Average::default(),
            up: Average::default(),
            poses: Average::default(),
            told: VecDeque::new(),
            untold: VecDeque::new(),
            refusals: Vec::new(),
            out: Vec::new(),
            silent: false,
            blind: false,
            faulty: false,
            started_us: None,
        })
    }

    /// A packet has come from the craft.
    pub fn on_packet(&mut self, now_us: u64, packet: &[u8]) {
        match self.link.unseal(packet) {
            Ok(Message::Telemetry(telemetry)) => self.on_telemetry(now_us, telemetry),
            Ok(Message::Identity(identity)) => self.on_identity(now_us, identity),
            Ok(Message::Answer(answer)) => {
                self.record(now_us, &Entry::Answer(&answer));
                self.on_answer(now_us, answer);
            }
            Ok(_) => self.refused(now_us, "a message that is not for a ground station".into()),
            Err(error) => self.refused(now_us, error.to_string()),
        }
    }

    fn on_telemetry(&mut self, now_us: u64, telemetry: Telemetry) {
        self.record(now_us, &Entry::Telemetry(&telemetry));
        let Telemetry { craft_us, ground_us, tick, supervision, counters, .. } = telemetry;
        if let Some(event) = self.ramps.heard(craft_us, ground_us, tick, now_us) {
            self.on_clock(now_us, event);
        }
        let before = self.telemetry.map(|(before, _)| before.supervision);
        self.telemetry = Some((telemetry, now_us));
        if before.is_some_and(|before| before.state != supervision.state) {
            self.found = supervision.conditions;
        }
        let statistics = self.link.statistics();
        self.down.mark(now_us, u64::from(statistics.accepted), u64::from(statistics.lost));
        let lost_up = u64::from(counters.packets_lost);
        self.up.mark(now_us, self.packets_sent.saturating_sub(lost_up), lost_up);
        if self.silent {
            self.silent = false;
            self.tell(now_us, Level::Info, "telemetry again".into());
        }
        let Some(before) = before else {
            self.tell(
                now_us,
                Level::Info,
                format!("the craft is heard, its state is {:?}", supervision.state),
            );
            if let Some(known) = self.known() {
                self.mission.adopt(&known);
            }
            return;
        };
        if before.state != supervision.state {
            let told = format!("{:?} -> {:?}", before.state, supervision.state);
            let level = if supervision.state == State::Cut { Level::Error } else { Level::Info };
            self.tell(now_us, level, told);
        }
        self.tell_conditions(now_us, before.conditions, supervision.conditions, supervision.state);
    }

    /// New faults and those that are over, by name. On the floor a missing link or pose is no news.
    fn tell_conditions(&mut self, now_us: u64, before: u32, after: u32, state: State) {
        let faults = |bits: u32| Conditions::from_bits(bits).iter().filter(|c| !c.is_asked_for());
        let names = |faults: Vec<Condition>| faults.iter().map(|c| c.name()).collect::<Vec<_>>().join(", ");
        let new: Vec<_> = faults(after & !before).collect();
        let over: Vec<_> = faults(before & !after).collect();
        let in_the_air = matches!(state, State::Flying | State::Hold | State::Land | State::Cut);
        if !new.is_empty() {
            let level = if in_the_air { Level::Warning } else { Level::Info };
            self.tell(now_us, level, names(new));
        }
        if !over.is_empty() && in_the_air {
            self.tell(now_us, Level::Info, format!("over: {}", names(over)));
        }
    }

    fn on_clock(&mut self, now_us: u64, event: ClockEvent) {
        let level = match event {
            ClockEvent::Well => Level::Info,
            ClockEvent::Leapt { .. } => Level::Warning,
            ClockEvent::Off { .. } => {
                self.faulty = true;
                Level::Error
            }
        };
        self.tell(now_us, level, event.to_string());
        if matches!(event, ClockEvent::Off { .. })
            && self.settings.land_on_clock_fault
            && self.mission.is_flying()
        {
            self.mission.instead([Step::Land {}]);
        }
    }

    fn on_identity(&mut self, now_us: u64, identity: Identity) {
        self.record(now_us, &Entry::Identity(&identity));
        if self.identity != Some(Identity { accepts_from: 0, state: State::Disarmed, ..identity }) {
            let [major, minor, patch] = identity.program;
            let hash: String = identity.vehicle_sha256.iter().take(4).map(|b| format!("{b:02x}")).collect();
            self.tell(
                now_us,
                Level::Info,
                format!("craft's program {major}.{minor}.{patch}, gains and vehicle {hash}"),
            );
        }
        // What changes all the time is no other craft.
        self.identity = Some(Identity { accepts_from: 0, state: State::Disarmed, ..identity });
    }

    fn on_answer(&mut self, now_us: u64, answer: proto::Answer) {
        let Some(pending) = self.pending else { return };
        let [first, last] = pending.numbers;
        if !(first..=last).contains(&answer.to) {
            return;
        }
        match (pending.ask, answer.done) {
            (Ask::Gains(gains), done) => {
                self.mission.answered(done);
                self.pending = None;
                let told = if done { "the craft flies with" } else { "the craft refuses" };
                let level = if done { Level::Info } else { Level::Warning };
                self.tell(now_us, level, format!("{told} other gains of {:?}", gains.of));
            }
            // The state in telemetry ends it.
            (Ask::Request(_), true) => {}
            (Ask::Request(request), false) => {
                let missing: Vec<_> = Preflight::from_bits(answer.preflight).missing().collect();
                let why = match (request, missing.is_empty()) {
                    (Request::Arm, false) => format!("not good yet: {}", missing.join(", ")),
                    _ => "not done".into(),
                };
                self.refused(now_us, format!("{request:?}: {why}"));
            }
        }
    }

    /// The tracker has been heard.
    pub fn on_tracker(&mut self, now_us: u64, heard: Heard) {
        match heard {
            Heard::Seen(sighting) => {
                let age_us = u64::try_from(sighting.age.as_micros()).unwrap_or(u64::MAX);
                let pose = TimedPose {
                    frame: sighting.frame,
                    ground_us: now_us.saturating_sub(age_us) as u32,
                    pose: sighting.pose,
                };
                self.send(now_us, &Message::Pose(pose));
                self.record(now_us, &Entry::Pose(&pose));
                if self.tracker.last.is_none() {
                    self.tell(now_us, Level::Info, "the tracker sees the craft".into());
                }
                let tracker = &mut self.tracker;
                tracker.seen += 1;
                (tracker.last, tracker.age_s) = (Some((sighting.pose, now_us)), sighting.age.as_secs_f64());
                self.poses.mark(now_us, self.tracker.seen, self.tracker.not_seen);
            }
            Heard::NotSeen { .. } => self.tracker.not_seen += 1,
            Heard::Refused(why) => {
                self.tracker.refused += 1;
                self.refused(now_us, why);
            }
            Heard::End => self.tell(now_us, Level::Info, "nothing more comes from the tracker".into()),
            Heard::Nothing => {}
        }
    }

    /// Somebody wishes for something.
    pub fn on_wish(&mut self, now_us: u64, wish: Wish) {
        let steps = match wish {
            Wish::Arm => vec![Step::Arm {}],
            Wish::TakeOff => vec![Step::TakeOff { height_m: self.settings.take_off_m }],
            Wish::Pattern if self.settings.pattern.is_empty() => {
                return self.tell(
                    now_us,
                    Level::Warning,
                    "there is no pattern: give one with --pattern".into(),
                );
            }
            Wish::Pattern => self.settings.pattern.clone(),
            Wish::Land => vec![Step::Land {}],
            Wish::Disarm => vec![Step::Disarm {}],
            Wish::Cut => vec![Step::Cut {}],
        };
        self.tell(now_us, Level::Info, format!("asked for: {wish:?}"));
        self.pending = None;
        self.mission.instead(steps);
    }

    /// Sends what is due.
    pub fn poll(&mut self, now_us: u64) {
        let started_us = *self.started_us.get_or_insert(now_us);
        if now_us >= self.next_ramp_us {
            self.send(now_us, &Message::Timer(Timer { ground_us: now_us as u32 }));
            self.next_ramp_us = now_us + (ramp_interval_s(self.ramps_sent) * 1e6) as u64;
            self.ramps_sent += 1;
        }
        let heard_us = self.telemetry.map_or(started_us, |(_, at)| at);
        let out_s = now_us.saturating_sub(heard_us) as f64 * 1e-6;
        if (self.identity.is_none() || out_s > SILENCE_S) && now_us >= self.next_who_us {
            self.send(now_us, &Message::Who);
            self.next_who_us = now_us + 1_000_000;
        }
        if out_s > SILENCE_S && !self.silent {
            self.silent = true;
            let told = match self.telemetry {
                Some(_) => "no telemetry any more: is the craft in reach, and its program running?",
                None => "no telemetry yet: is this the craft's address, and do both sides have the same key?",
            };
            self.tell(now_us, Level::Error, told.into());
        }
        self.watch_tracker(now_us);
        if let (Some(known), true) = (self.known(), now_us >= self.next_command_us) {
            let period_us = (1e6 / self.settings.command_hz) as u64;
            // In step with the first one; after a stall from now on.
            self.next_command_us = match self.next_command_us + period_us {
                next if next > now_us => next,
                _ => now_us + period_us,
            };
            let before = self.mission.progress().clone();
            let command = self.mission.command(now_us as f64 * 1e-6, &known);
            self.send(now_us, &Message::Command(command));
            self.record(now_us, &Entry::Command(&command));
            if *self.mission.progress() != before
                && let Progress::Failed(why) = self.mission.progress().clone()
            {
                self.tell(now_us, Level::Error, why);
            }
            self.ask(now_us, &known);
        }
        if now_us >= self.next_link_us {
            self.next_link_us = now_us + LINK_EVERY_US;
            if let Some(link) = self.link_record() {
                self.record(now_us, &Entry::Link(&link));
            }
        }
    }

    fn watch_tracker(&mut self, now_us: u64) {
        let Some((_, at_us)) = self.tracker.last else { return };
        let blind = now_us.saturating_sub(at_us) as f64 * 1e-6 > BLIND_S;
        if blind != self.blind {
            self.blind = blind;
            let (level, told) = match blind {
                true => (Level::Warning, "the tracker does not see the craft any more"),
                false => (Level::Info, "the tracker sees the craft again"),
            };
            self.tell(now_us, level, told.into());
        }
    }

    /// Asks for what the mission needs, again and again until its state is there.
    fn ask(&mut self, now_us: u64, known: &Known) {
        let wanted = self.mission.ask().filter(|ask| !is_there(ask, known.state));
        let Some(ask) = wanted else {
            self.pending = None;
            return;
        };
        let pending = self.pending.filter(|pending| pending.ask == ask);
        if pending.is_some_and(|pending| now_us < pending.next_us) {
            return;
        }
        let message = match ask {
            Ask::Request(request) => Message::Request(request),
            Ask::Gains(gains) => Message::Gains(gains),
        };
        let Some(number) = self.send(now_us, &message) else { return };
        match (pending, ask) {
            (Some(_), _) => {}
            (None, Ask::Request(request)) => self.record(now_us, &Entry::Request(request)),
            (None, Ask::Gains(gains)) => self.record(now_us, &Entry::Gains(&gains)),
        }
        let first = pending.map_or(number, |pending| pending.numbers[0]);
        let next_us = now_us + (AGAIN_S * 1e6) as u64;
        self.pending = Some(Pending { ask, numbers: [first, number], next_us });
    }

    /// Seals and queues a message; its number.
    fn send(&mut self, now_us: u64, message: &Message) -> Option<u64> {
        match self.link.seal(message) {
            Ok((number, packet)) => {
                self.packets_sent += 1;
                self.out.push(packet);
                Some(number)
            }
            Err(error) => {
                self.faulty |= matches!(error, LinkError::File(_));
                self.refused(now_us, format!("nothing can be sent: {error}"));
                None
            }
        }
    }

    fn record(&mut self, now_us: u64, entry: &Entry<'_>) {
        let Some(recorder) = &mut self.recorder else { return };
        if let Err(error) = recorder.write(now_us, entry) {
            self.recorder = None;
            self.faulty = true;
            self.tell(now_us, Level::Error, format!("recording ends here: {error}"));
        }
    }

    /// Tells a refusal once in a while, however often it comes.
    fn refused(&mut self, now_us: u64, why: String) {
        self.refusals.retain(|(_, at_us)| at_us + TOLD_AGAIN_US > now_us);
        // Whoever sends junk cannot fill memory with it.
        if self.refusals.len() >= 50 || self.refusals.iter().any(|(told, _)| *told == why) {
            return;
        }
        self.refusals.push((why.clone(), now_us));
        self.tell(now_us, Level::Warning, why);
    }

    /// Tells people a line.
    pub fn tell(&mut self, at_us: u64, level: Level, text: String) {
        self.record(at_us, &Entry::Log(level, &text));
        let told = Told { at_us, level, text };
        self.told.push_back(told.clone());
        self.untold.push_back(told);
        for lines in [&mut self.told, &mut self.untold] {
            while lines.len() > REMEMBERED {
                lines.pop_front();
            }
        }
    }

    /// Lines that have not been taken yet.
    pub fn take_told(&mut self) -> impl Iterator<Item = Told> + use<'_> {
        self.untold.drain(..)
    }

    /// Packets to send, in order.
    pub fn take_packets(&mut self) -> impl Iterator<Item = Vec<u8>> + use<'_> {
        self.out.drain(..)
    }

    /// When [`poll`](Self::poll) has something to do next, us.
    pub fn next_due_us(&self) -> u64 {
        let command_us = if self.telemetry.is_some() { self.next_command_us } else { u64::MAX };
        self.next_ramp_us.min(command_us).min(self.next_link_us)
    }

    fn known(&self) -> Option<Known> {
        let (telemetry, _) = self.telemetry.as_ref()?;
        // The tracker's pose is fresher than the one that went to the craft and back.
        let pose = self.tracker.last.map_or(telemetry.tracked, |(pose, _)| pose);
        let (state, preflight) = (telemetry.supervision.state, telemetry.supervision.preflight);
        Some(Known { state, pose, preflight, found: self.found })
    }

    fn link_record(&self) -> Option<LinkRecord> {
        let timing = self.ramps.timing()?;
        let ((_, lost_down), (_, lost_up), (pose_hz, _)) =
            (self.down.rate_and_loss(), self.up.rate_and_loss(), self.poses.rate_and_loss());
        Some(LinkRecord {
            one_way_s: timing.one_way_s,
            least_one_way_s: timing.least_one_way_s,
            skew: timing.skew,
            skew_std_error: timing.skew_std_error,
            tick_hz: timing.tick_hz,
            lost_down,
            lost_up,
            pose_hz,
        })
    }

    /// How the mission goes.
    pub fn progress(&self) -> &Progress {
        self.mission.progress()
    }

    /// Is the craft off the floor, by what it says and what was asked of it?
    pub fn is_flying(&self) -> bool {
        let state = self.telemetry.map(|(telemetry, _)| telemetry.supervision.state);
        self.mission.is_flying() || matches!(state, Some(State::Flying | State::Hold | State::Land))
    }

    /// Has something gone wrong that a script has to answer for: the craft's clock, the recording, the packet counters?
    pub fn is_faulty(&self) -> bool {
        self.faulty
    }

    /// How long telemetry has been out, s; none before the first.
    pub fn silence_s(&self, now_us: u64) -> Option<f64> {
        self.telemetry.map(|(_, at_us)| now_us.saturating_sub(at_us) as f64 * 1e-6)
    }

    /// Everything about now.
    pub fn snapshot(&self, now_us: u64) -> Snapshot {
        Snapshot {
            now_us,
            telemetry: self.telemetry,
            identity: self.identity,
            link: self.link_record(),
            pace: self.ramps.timing().map_or(Pace::Unknown, |timing| timing.pace),
            tracker: self.tracker,
            statistics: self.link.statistics(),
            doing: self.mission.describe(),
            told: self.told.iter().cloned().collect(),
            recording: self.recorder.as_ref().map(|recorder| recorder.path().display().to_string()),
        }
    }

    /// Ends the recording, for [`finish`](crate::recorder::finish).
    pub fn end_recording(&mut self) {
        self.recorder = None;
    }
}

/// Is the craft where the request would bring it?
fn is_there(ask: &Ask, state: State) -> bool {
    match ask {
        Ask::Gains(Gains { .. }) => false,
        Ask::Request(Request::Arm) => !matches!(state, State::Disarmed | State::Cut),
        Ask::Request(Request::Land) => matches!(state, State::Land | State::Disarmed | State::Cut),
        Ask::Request(Request::Disarm) => state == State::Disarmed,
        Ask::Request(Request::Cut) => state == State::Cut,
    }
}

#[cfg(test)]
mod tests {
    //! Against a craft of a few lines: what is sent, how often, and what people are told.

    use super::*;
    use crate::link::LinkSettings;
    use crate::mocap::Sighting;
    use proptest::prelude::*;
    use proto::{Answer, Counters, MAX_PACKET_LEN, Mode, Opener, Refusal, Role, Sealer, Supervision};
    use std::net::{IpAddr, Ipv4Addr};
    use std::time::Duration;

    fn telemetry(tick: u32, state: State, conditions: u32) -> Telemetry {
        Telemetry {
            tick,
            craft_us: tick.wrapping_mul(10_000),
            ground_us: 0,
            supervision: Supervision {
                state,
                conditions,
                preflight: Preflight::ALL.bits() & !Preflight::IMU,
            },
            mode: Mode::Position,
            attitude_command_rad: [0.0; 3],
            z_command_m: 0.0,
            tracked: Pose { position_m: [0.0, 0.0, -1.0], attitude_rad: [0.0; 3] },
            tracked_rates_rad_s: [0.0; 3],
            imu: None,
            thrust: 0.0,
            torque: [0.0; 3],
            pwm: [1000.0; 4],
            refused: Refusal::default(),
            battery_v: 11.0,
            current_a: None,
            counters: Counters::default(),
        }
    }

    struct Bench {
        station: Station,
        sealer: Sealer,
        opener: Opener,
        tick: u32,
    }

    impl Bench {
        fn new(settings: Settings) -> Self {
            let link = Link::open(&LinkSettings::default(), IpAddr::V4(Ipv4Addr::LOCALHOST)).unwrap();
            let station = Station::new(settings, link, None).unwrap();
            let (sealer, opener) = (Sealer::open(Role::Craft, 0), Opener::open(Role::Ground, 0));
            Self { station, sealer, opener, tick: 0 }
        }

        fn hear(&mut self, now_us: u64, message: &Message) {
            let mut buffer = [0; MAX_PACKET_LEN];
            let (_, packet) = self.sealer.seal(message, &mut buffer).unwrap();
            self.station.on_packet(now_us, packet);
        }

        /// So many milliseconds, telemetry every ten; what was sent, with its packet's number and its time.
        fn run(&mut self, from_ms: u64, ms: u64, state: Option<State>) -> Vec<(u64, u64, Message)> {
            let mut sent = Vec::new();
            for now_ms in from_ms..from_ms + ms {
                let now_us = now_ms * 1000;
                if let Some(state) = state.filter(|_| now_ms % 10 == 0) {
                    self.hear(now_us, &Message::Telemetry(telemetry(self.tick, state, 0)));
                    self.tick += 1;
                }
                self.station.poll(now_us);
                for packet in self.station.take_packets().collect::<Vec<_>>() {
                    let (number, message) = self.opener.unseal(&packet).unwrap();
                    sent.push((now_ms, number, message));
                }
            }
            sent
        }

        fn told(&mut self) -> String {
            self.station.take_told().map(|told| told.text + "\n").collect()
        }
    }

    fn count(sent: &[(u64, u64, Message)], of: fn(&Message) -> bool) -> usize {
        sent.iter().filter(|(_, _, message)| of(message)).count()
    }

    #[test]
    fn commands_come_at_their_rate_and_only_to_a_craft_that_is_heard() {
        for (command_hz, expected) in [(4.0, 8), (50.0, 100), (100.0, 200)] {
            let mut bench = Bench::new(Settings { command_hz, ..Settings::default() });
            let silent = bench.run(0, 2000, None);
            assert_eq!(count(&silent, |m| matches!(m, Message::Command(_))), 0);
            // Identities and ramps are asked for and sent all the same: telemetry goes to whoever sends the clock.
            assert_eq!(count(&silent, |m| matches!(m, Message::Who)), 2);
            let ramps = count(&silent, |m| matches!(m, Message::Timer(_)));
            assert!((190..=210).contains(&ramps), "{ramps} in 2 s, 10 ms apart in the mean");
            assert!(bench.told().contains("no telemetry yet"));
            let sent = bench.run(2000, 2000, Some(State::Disarmed));
            let commands = count(&sent, |m| matches!(m, Message::Command(_)));
            assert!(commands.abs_diff(expected) <= 1, "{commands} at {command_hz} Hz");
            assert!(sent.iter().all(|(_, _, m)| !matches!(m, Message::Command(c) if !c.cut_off)));
        }
        for command_hz in [3.9, f64::NAN, 1e6] {
            let link = Link::open(&LinkSettings::default(), IpAddr::V4(Ipv4Addr::LOCALHOST)).unwrap();
            assert!(Station::new(Settings { command_hz, ..Settings::default() }, link, None).is_err());
        }
    }

    #[test]
    fn a_pose_goes_out_at_once_with_the_time_it_was_taken_at() {
        let mut bench = Bench::new(Settings::default());
        let pose = Pose { position_m: [1.0, 2.0, -3.0], attitude_rad: [0.1; 3] };
        let age = Duration::from_millis(7);
        bench.station.on_tracker(5_000_000_000, Heard::Seen(Sighting { frame: 9, pose, age }));
        let packet = bench.station.take_packets().next().unwrap();
        let (_, message) = bench.opener.unseal(&packet).unwrap();
        // Modulo 2^32.
        assert_eq!(
            message,
            Message::Pose(TimedPose { frame: 9, ground_us: (4_999_993_000_u64 % (1 << 32)) as u32, pose })
        );
    }

    #[test]
    fn a_request_is_repeated_until_its_state_is_there_and_says_why_not() {
        let mut bench = Bench::new(Settings::default());
        bench.run(0, 100, Some(State::Disarmed));
        bench.station.on_wish(100_000, Wish::Arm);
        let sent = bench.run(100, 1000, Some(State::Disarmed));
        let asked: Vec<_> = sent.iter().filter(|(_, _, m)| *m == Message::Request(Request::Arm)).collect();
        assert!((9..=11).contains(&asked.len()), "{} in a second", asked.len());
        let (_, number, _) = asked[3];
        let preflight = Preflight::ALL.bits() & !Preflight::IMU;
        bench.told();
        for _ in 0..3 {
            bench.hear(1_100_000, &Message::Answer(Answer { to: *number, done: false, preflight }));
        }
        let told = bench.told();
        assert!(told.contains("Arm: not good yet: IMU") && told.lines().count() == 1, "{told}");
        let sent = bench.run(1100, 1000, Some(State::Armed));
        assert_eq!(count(&sent, |m| matches!(m, Message::Request(_))), 0);
        assert_eq!(*bench.station.progress(), Progress::Done);
    }

    #[test]
    fn silence_and_faults_are_told_once_by_name() {
        let mut bench = Bench::new(Settings::default());
        bench.run(0, 500, Some(State::Flying));
        assert!(bench.told().contains("the craft is heard, its state is Flying"));
        let conditions =
            Condition::BatteryLow.bit() | Condition::PoseLate.bit() | Condition::LandRequested.bit();
        for tick in 50..60 {
            bench.hear(
                u64::from(tick) * 10_000,
                &Message::Telemetry(telemetry(tick, State::Hold, conditions)),
            );
        }
        let told = bench.told();
        assert!(told.contains("Flying -> Hold") && told.contains("pose late, battery low"), "{told}");
        assert_eq!(told.lines().count(), 2, "{told}");
        bench.run(600, 3000, None);
        let told = bench.told();
        assert!(told.contains("no telemetry any more") && told.lines().count() == 1, "{told}");
        bench.tick = 100;
        bench.run(3600, 10, Some(State::Flying));
        let told = bench.told();
        assert!(told.contains("telemetry again") && told.contains("over: pose late, battery low"), "{told}");
    }

    #[test]
    fn losses_and_rates_are_those_of_the_last_seconds() {
        let mut average = Average::default();
        let mut lost = 0;
        for k in 0..1000_u64 {
            // A fifth is lost in the second half.
            lost += u64::from(k >= 500 && k % 4 == 0);
            average.mark(k * 10_000, k, lost);
        }
        let (rate, loss) = average.rate_and_loss();
        assert!((rate - 100.0).abs() < 1.0 && (loss - 0.2).abs() < 0.01, "{rate} {loss}");
        assert_eq!(Average::default().rate_and_loss(), (0.0, 0.0));
    }

    proptest! {
        /// Junk from the network and from the tracker does no harm and does not grow.
        #[test]
        fn junk_does_no_harm(junk in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..400), 0..300)) {
            let mut bench = Bench::new(Settings::default());
            bench.run(0, 50, Some(State::Disarmed));
            for (k, bytes) in junk.iter().enumerate() {
                bench.station.on_packet(50_000 + k as u64, bytes);
                bench.station.on_tracker(50_000, Heard::Refused(format!("{bytes:?}")));
            }
            prop_assert!(bench.station.take_told().count() <= 60);
            let sent = bench.run(1000, 100, Some(State::Disarmed));
            prop_assert!(count(&sent, |m| matches!(m, Message::Command(_))) >= 4);
        }
    }
}
