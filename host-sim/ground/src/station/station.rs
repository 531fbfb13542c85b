//! The station itself: what comes in goes to its parts, what is due goes out.
use control::{Condition, Conditions, Preflight};
use proto::{Ending, Identity, Message, Request, State, Telemetry, TimedPose, Timer};

use super::notices::{Notice, Notices};
use super::parts::{CraftReports, Pending, Schedule, Tracking, Traffic};
use super::pilot::{Confirmation, PilotRequest, Verdict};
use super::settings::{Settings, SettingsError};
use super::snapshot::Snapshot;
use crate::link::{ClockEvent, ClockMonitor, CraftLink, Pace, ramp_interval_s};
use crate::mission::{Ask, CraftStatus, Mission, MissionStep, Progress};
use crate::mocap::TrackerEvent;
use crate::recording::{Entry, Level, LinkRecord, RecordError, Recorder};

/// Between two sendings of a request that is not answered, s.
pub const AGAIN_S: f64 = 0.1;
/// Telemetry that stays out for so long is lost, s.
pub const SILENCE_S: f64 = 1.0;
/// Poses that stay out for so long are told, s.
const BLIND_S: f64 = 0.5;
/// Between two records of the link, us.
const LINK_EVERY_US: u64 = 250_000;

/// The station.
#[derive(Debug)]
pub struct Station {
    settings: Settings,
    link: CraftLink,
    mission: Mission,
    clock: ClockMonitor,
    recorder: Option<Recorder>,
    craft: CraftReports,
    tracking: Tracking,
    traffic: Traffic,
    schedule: Schedule,
    notices: Notices,
    pending: Option<Pending>,
    confirmation: Confirmation,
    /// Something went wrong that a script has to answer for.
    faulty: bool,
}

impl Station {
    /// A station that has not received anything yet.
    ///
    /// # Errors
    /// Settings that cannot be used.
    pub fn new(
        settings: Settings,
        link: CraftLink,
        recorder: Option<Recorder>,
    ) -> Result<Self, SettingsError> {
        settings.check()?;
        let mission =
            Mission::new(settings.steps.clone(), 1.0 / settings.command_hz, settings.excitation_gain);
        Ok(Self {
            settings,
            link,
            mission,
            clock: ClockMonitor::default(),
            recorder,
            craft: CraftReports::default(),
            tracking: Tracking::default(),
            traffic: Traffic::default(),
            schedule: Schedule::default(),
            notices: Notices::default(),
            pending: None,
            confirmation: Confirmation::default(),
            faulty: false,
        })
    }

    /// A packet has come from the craft.
    pub fn on_packet(&mut self, now_us: u64, packet: &[u8]) {
        match self.link.unseal(now_us, packet) {
            Ok(None) => {}
            Ok(Some(Message::Telemetry(telemetry))) => self.on_telemetry(now_us, telemetry),
            Ok(Some(Message::Identity(identity))) => self.on_identity(now_us, identity),
            Ok(Some(Message::LastEnd(ending))) => self.on_last_end(now_us, ending),
            Ok(Some(Message::Answer(answer))) => {
                self.record(now_us, &Entry::Answer(&answer));
                self.on_answer(now_us, answer);
            }
            Ok(Some(_)) => self.refused(now_us, "a message that is not for a ground station".into()),
            Err(error) => self.refused(now_us, error.to_string()),
        }
    }

    fn on_telemetry(&mut self, now_us: u64, telemetry: Telemetry) {
        self.record(now_us, &Entry::Telemetry(&telemetry));
        let Telemetry { craft_us, ground_us, tick, supervision, counters, .. } = telemetry;
        if let Some(event) = self.clock.heard(craft_us, ground_us, tick, now_us) {
            self.on_clock(now_us, event);
        }
        let before = self.craft.telemetry.map(|(before, _)| before.supervision);
        self.craft.telemetry = Some((telemetry, now_us));
        if before.is_some_and(|before| before.state != supervision.state) {
            self.craft.found = supervision.conditions;
        }
        let statistics = self.link.statistics();
        self.traffic.down.mark(now_us, u64::from(statistics.accepted), u64::from(statistics.lost));
        let lost_up = u64::from(counters.packets_lost);
        self.traffic.up.mark(now_us, self.traffic.sent.saturating_sub(lost_up), lost_up);
        if self.craft.silent {
            self.craft.silent = false;
            self.tell(now_us, Level::Info, "telemetry again".into());
        }
        let Some(before) = before else {
            self.tell(
                now_us,
                Level::Info,
                format!("the craft is connected, its state is {:?}", supervision.state),
            );
            if let Some(known) = self.craft_status() {
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

    /// Reports new faults and those that are over, by name. On the floor a missing link or pose is
    /// normal.
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
            ClockEvent::Recovered => Level::Info,
            ClockEvent::Jumped { .. } => Level::Warning,
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
            self.mission.instead([MissionStep::Land {}]);
        }
    }

    fn on_identity(&mut self, now_us: u64, identity: Identity) {
        self.record(now_us, &Entry::Identity(&identity));
        if self.craft.identity != Some(Identity { state: State::Disarmed, ..identity }) {
            let [major, minor, patch] = identity.program;
            let hash: String = identity.vehicle_sha256.iter().take(4).map(|b| format!("{b:02x}")).collect();
            self.tell(
                now_us,
                Level::Info,
                format!("craft's program {major}.{minor}.{patch}, gains and vehicle {hash}"),
            );
        }
        // Leave out what changes all the time: it does not make another craft.
        self.craft.identity = Some(Identity { state: State::Disarmed, ..identity });
    }

    /// Told once of each start: one that is started anew has been silent before.
    fn on_last_end(&mut self, now_us: u64, ending: Ending) {
        self.record(now_us, &Entry::LastEnd(ending));
        let is_known = self.craft.last_end.replace(ending) == Some(ending);
        if (is_known && !self.craft.silent) || ending == Ending::Unknown {
            return;
        }
        let level = if ending.is_fault() { Level::Warning } else { Level::Info };
        self.tell(now_us, level, format!("the craft was started: {ending}"));
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
                let told = if done { "the craft has taken" } else { "the craft refuses" };
                let level = if done { Level::Info } else { Level::Warning };
                self.tell(now_us, level, format!("{told} new gains of {:?}", gains.of));
            }
            // The state in telemetry ends it.
            (Ask::Request(_), true) => {}
            (Ask::Request(request), false) => {
                let missing: Vec<_> = Preflight::from_bits(answer.preflight).missing().collect();
                let why = match (request, missing.is_empty()) {
                    (Request::Arm, false) => format!("these checks fail: {}", missing.join(", ")),
                    _ => "not done".into(),
                };
                self.refused(now_us, format!("{request:?}: {why}"));
            }
        }
    }

    /// The tracker has sent something.
    pub fn on_tracker(&mut self, now_us: u64, heard: TrackerEvent) {
        match heard {
            TrackerEvent::Seen(sighting) => {
                let age_us = u64::try_from(sighting.age.as_micros()).unwrap_or(u64::MAX);
                let pose = TimedPose {
                    frame: sighting.frame,
                    ground_us: now_us.saturating_sub(age_us) as u32,
                    pose: sighting.pose,
                };
                self.send(now_us, &Message::Pose(pose));
                self.record(now_us, &Entry::Pose(&pose));
                if self.tracking.tracker.last.is_none() {
                    self.tell(now_us, Level::Info, "the tracker sees the craft".into());
                }
                let tracker = &mut self.tracking.tracker;
                tracker.seen += 1;
                (tracker.last, tracker.age_s) = (Some((sighting.pose, now_us)), sighting.age.as_secs_f64());
                self.tracking.poses.mark(now_us, self.tracking.tracker.seen, self.tracking.tracker.not_seen);
            }
            TrackerEvent::NotSeen { .. } => self.tracking.tracker.not_seen += 1,
            TrackerEvent::Refused(why) => {
                self.tracking.tracker.refused += 1;
                self.refused(now_us, why);
            }
            TrackerEvent::End => self.tell(now_us, Level::Info, "the tracker has ended".into()),
            TrackerEvent::Nothing => {}
        }
    }

    /// The pilot asks for something.
    pub fn on_pilot_request(&mut self, now_us: u64, request: PilotRequest) {
        let state = self.craft.telemetry.as_ref().map(|(telemetry, _)| telemetry.supervision.state);
        let request = match self.confirmation.judge(request, state, now_us) {
            Verdict::Do(request) => request,
            Verdict::Wait(why) => return self.tell(now_us, Level::Warning, why.into()),
        };
        let steps = match request {
            PilotRequest::Arm => vec![MissionStep::Arm {}],
            PilotRequest::TakeOff => vec![MissionStep::TakeOff { height_m: self.settings.take_off_m }],
            PilotRequest::Pattern if self.settings.pattern.is_empty() => {
                return self.tell(
                    now_us,
                    Level::Warning,
                    "there is no pattern: give one with --pattern".into(),
                );
            }
            PilotRequest::Pattern => self.settings.pattern.clone(),
            PilotRequest::Land => vec![MissionStep::Land {}],
            PilotRequest::Disarm | PilotRequest::Confirm => vec![MissionStep::Disarm {}],
            PilotRequest::Cut => vec![MissionStep::Cut {}],
        };
        self.tell(now_us, Level::Info, format!("asked for: {request:?}"));
        self.pending = None;
        self.mission.instead(steps);
    }

    /// Sends what is due.
    pub fn poll(&mut self, now_us: u64) {
        let started_us = *self.schedule.started_us.get_or_insert(now_us);
        self.traffic.out.extend(self.link.greet(now_us));
        if now_us >= self.schedule.ramp_us {
            self.send(now_us, &Message::Timer(Timer { ground_us: now_us as u32 }));
            self.schedule.ramp_us = now_us + (ramp_interval_s(self.schedule.ramps_sent) * 1e6) as u64;
            self.schedule.ramps_sent += 1;
        }
        self.watch_craft(now_us, started_us);
        self.watch_tracker(now_us);
        self.watch_recording(now_us);
        if let (Some(status), true) = (self.craft_status(), now_us >= self.schedule.command_us) {
            self.command(now_us, &status);
        }
        if now_us >= self.schedule.link_us {
            self.schedule.link_us = now_us + LINK_EVERY_US;
            if let Some(link) = self.link_record() {
                self.record(now_us, &Entry::Link(&link));
            }
        }
    }

    /// Sends the command of now, and what the mission asks for.
    fn command(&mut self, now_us: u64, status: &CraftStatus) {
        let period_us = (1e6 / self.settings.command_hz) as u64;
        // In step with the first one; after a stall from now on.
        self.schedule.command_us = match self.schedule.command_us + period_us {
            next if next > now_us => next,
            _ => now_us + period_us,
        };
        let before = self.mission.progress().clone();
        let command = self.mission.command(now_us as f64 * 1e-6, status);
        self.send(now_us, &Message::Command(command));
        self.record(now_us, &Entry::Command(&command));
        if *self.mission.progress() != before
            && let Progress::Failed(why) = self.mission.progress().clone()
        {
            self.tell(now_us, Level::Error, why);
        }
        self.ask(now_us, status);
    }

    /// Asks who the craft is while that is not known, and tells when its telemetry stops.
    fn watch_craft(&mut self, now_us: u64, started_us: u64) {
        let heard_us = self.craft.telemetry.map_or(started_us, |(_, at)| at);
        let silent_s = now_us.saturating_sub(heard_us) as f64 * 1e-6;
        if (self.craft.identity.is_none() || silent_s > SILENCE_S)
            && now_us >= self.schedule.who_us
            && self.send(now_us, &Message::Who).is_some()
        {
            self.schedule.who_us = now_us + 1_000_000;
        }
        if silent_s > SILENCE_S && !self.craft.silent {
            self.craft.silent = true;
            let text = match self.craft.telemetry {
                Some(_) => "telemetry has stopped: is the craft in reach, and its program running?",
                None => "no telemetry yet: is this the craft's address, and do both sides have the same key?",
            };
            self.tell(now_us, Level::Error, text.into());
        }
    }

    fn watch_tracker(&mut self, now_us: u64) {
        let Some((_, at_us)) = self.tracking.tracker.last else { return };
        let blind = now_us.saturating_sub(at_us) as f64 * 1e-6 > BLIND_S;
        if blind != self.tracking.blind {
            self.tracking.blind = blind;
            let (level, told) = match blind {
                true => (Level::Warning, "the tracker has lost the craft"),
                false => (Level::Info, "the tracker sees the craft again"),
            };
            self.tell(now_us, level, told.into());
        }
    }

    /// Asks for what the mission needs, again and again until its state is there.
    fn ask(&mut self, now_us: u64, known: &CraftStatus) {
        let wanted = self.mission.ask().filter(|ask| !ask.is_fulfilled(known.state));
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

    /// Seals and queues a message; its number. Before the craft has been heard nothing can be said.
    fn send(&mut self, now_us: u64, message: &Message) -> Option<u64> {
        let (number, packet) = self.link.seal(now_us, message).ok()?;
        self.traffic.sent += 1;
        self.traffic.out.push(packet);
        Some(number)
    }

    fn record(&mut self, now_us: u64, entry: &Entry<'_>) {
        if let Some(recorder) = &mut self.recorder {
            recorder.write(now_us, entry);
        }
    }

    /// Tells people how the recording's disk does.
    fn watch_recording(&mut self, now_us: u64) {
        if let Some((level, text)) = self.recorder.as_mut().and_then(Recorder::news) {
            self.tell(now_us, level, text);
        }
    }

    /// Tells a refusal once in a while, however often it comes.
    fn refused(&mut self, now_us: u64, why: String) {
        if self.notices.is_news(now_us, &why) {
            self.tell(now_us, Level::Warning, why);
        }
    }

    /// Tells people a line.
    pub fn tell(&mut self, at_us: u64, level: Level, text: String) {
        self.record(at_us, &Entry::Log(level, &text));
        self.notices.push(Notice { at_us, level, text });
    }

    /// Lines that have not been taken yet.
    pub fn take_notices(&mut self) -> impl Iterator<Item = Notice> + use<'_> {
        self.notices.take()
    }

    /// Packets to send, in order.
    pub fn take_packets(&mut self) -> impl Iterator<Item = Vec<u8>> + use<'_> {
        self.traffic.out.drain(..)
    }

    /// When [`poll`](Self::poll) has something to do next, us.
    pub fn next_due_us(&self) -> u64 {
        let command_us = if self.craft.telemetry.is_some() { self.schedule.command_us } else { u64::MAX };
        self.schedule.ramp_us.min(command_us).min(self.schedule.link_us)
    }

    fn craft_status(&self) -> Option<CraftStatus> {
        let (telemetry, _) = self.craft.telemetry.as_ref()?;
        // The tracker's pose is fresher than the one that went to the craft and back.
        let pose = self.tracking.tracker.last.map_or(telemetry.tracked, |(pose, _)| pose);
        let (state, preflight) = (telemetry.supervision.state, telemetry.supervision.preflight);
        Some(CraftStatus { state, pose, preflight, found: self.craft.found })
    }

    fn link_record(&self) -> Option<LinkRecord> {
        let timing = self.clock.timing()?;
        let ((_, lost_down), (_, lost_up), (pose_hz, _)) = (
            self.traffic.down.rate_and_loss(),
            self.traffic.up.rate_and_loss(),
            self.tracking.poses.rate_and_loss(),
        );
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
        let state = self.craft.telemetry.map(|(telemetry, _)| telemetry.supervision.state);
        self.mission.is_flying() || matches!(state, Some(State::Flying | State::Hold | State::Land))
    }

    /// Has something gone wrong that a script has to answer for: the craft's clock, the recording?
    pub fn is_faulty(&self) -> bool {
        self.faulty
    }

    /// How long telemetry has been out, s; none before the first.
    pub fn silence_s(&self, now_us: u64) -> Option<f64> {
        self.craft.telemetry.map(|(_, at_us)| now_us.saturating_sub(at_us) as f64 * 1e-6)
    }

    /// Everything about now.
    pub fn snapshot(&self, now_us: u64) -> Snapshot {
        Snapshot {
            now_us,
            telemetry: self.craft.telemetry,
            identity: self.craft.identity,
            link: self.link_record(),
            pace: self.clock.timing().map_or(Pace::Unknown, |timing| timing.pace),
            tracker: self.tracking.tracker,
            statistics: self.link.statistics(),
            doing: self.mission.describe(),
            notices: self.notices.last(),
            recording: self.recorder.as_ref().map(|recorder| recorder.path().display().to_string()),
        }
    }

    /// Ends the recording, for [`finish`](crate::recording::finish).
    ///
    /// # Errors
    /// Messages that are missing from it.
    pub fn end_recording(&mut self) -> Result<(), RecordError> {
        self.recorder.take().map_or(Ok(()), Recorder::close)
    }
}

#[cfg(test)]
mod tests {
    //! Against a craft of a few lines: what is sent, how often, and what people are told.

    use super::*;
    use crate::link::LinkSettings;
    use crate::mocap::Sighting;
    use proptest::prelude::*;
    use proto::{Answer, Counters, CraftEnd, Heard, MAX_PACKET_LEN, Mode, Pose, Refusal, Supervision};
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
        craft: CraftEnd,
        session: Option<u64>,
        tick: u32,
    }

    impl Bench {
        fn new(settings: Settings) -> Self {
            let link = CraftLink::open(&LinkSettings::default(), IpAddr::V4(Ipv4Addr::LOCALHOST)).unwrap();
            let station = Station::new(settings, link, None).unwrap();
            Self { station, craft: CraftEnd::new(0, None, [1; 32]), session: None, tick: 0 }
        }

        /// What the station sends: numbers and messages.
        fn sent(&mut self, now_us: u64) -> Vec<(u64, Message)> {
            let (mut sent, now_ms) = (Vec::new(), (now_us / 1000) as u32);
            for packet in self.station.take_packets().collect::<Vec<_>>() {
                match self.craft.hear(now_ms, None, &packet, &mut [0; MAX_PACKET_LEN]).unwrap() {
                    Heard::Hello(challenge) => self.station.on_packet(now_us, challenge),
                    Heard::Message(opened) => {
                        self.session = Some(opened.session);
                        sent.push((opened.number, opened.message));
                    }
                }
            }
            sent
        }

        fn hear(&mut self, now_us: u64, message: &Message) {
            let Some(session) = self.session else { return };
            let (mut buffer, now_ms) = ([0; MAX_PACKET_LEN], (now_us / 1000) as u32);
            let (_, packet) = self.craft.seal(now_ms, session, message, &mut buffer).unwrap();
            self.station.on_packet(now_us, packet);
        }

        /// So many milliseconds, telemetry every ten; what was sent, with its packet's number and
        /// its time.
        fn run(&mut self, from_ms: u64, ms: u64, state: Option<State>) -> Vec<(u64, u64, Message)> {
            let mut sent = Vec::new();
            for now_ms in from_ms..from_ms + ms {
                let now_us = now_ms * 1000;
                if let Some(state) = state.filter(|_| now_ms % 10 == 0) {
                    self.hear(now_us, &Message::Telemetry(telemetry(self.tick, state, 0)));
                    self.tick += 1;
                }
                self.station.poll(now_us);
                let said = self.sent(now_us);
                sent.extend(said.into_iter().map(|(number, message)| (now_ms, number, message)));
            }
            sent
        }

        fn told(&mut self) -> String {
            self.station.take_notices().map(|notice| notice.text + "\n").collect()
        }
    }

    fn count(sent: &[(u64, u64, Message)], of: fn(&Message) -> bool) -> usize {
        sent.iter().filter(|(_, _, message)| of(message)).count()
    }

    #[test]
    fn how_a_craft_ended_last_is_told_once_of_each_start() {
        let mut bench = Bench::new(Settings::default());
        bench.run(0, 500, Some(State::Disarmed));
        bench.told();
        let end = |bench: &mut Bench, now_ms: u64, ending| {
            bench.hear(now_ms * 1000, &Message::LastEnd(ending));
            bench.told()
        };
        assert_eq!(end(&mut bench, 500, Ending::Unknown), "");
        assert!(
            end(&mut bench, 510, Ending::Watchdog).contains("the craft was started: its watchdog reset it")
        );
        assert_eq!(end(&mut bench, 520, Ending::Watchdog), "", "asked who it is once more");
        assert!(end(&mut bench, 530, Ending::PowerOff).contains("its power was off"));
        // The same again after a silence is another start.
        bench.run(530, 3000, None);
        bench.told();
        assert!(end(&mut bench, 3540, Ending::PowerOff).contains("its power was off"));
    }

    #[test]
    fn commands_come_at_their_rate_and_only_to_a_craft_that_is_heard() {
        for (command_hz, expected) in [(4.0, 8), (50.0, 100), (100.0, 200)] {
            let mut bench = Bench::new(Settings { command_hz, ..Settings::default() });
            let silent = bench.run(0, 2000, None);
            assert_eq!(count(&silent, |m| matches!(m, Message::Command(_))), 0);
            // Identities and ramps are asked for and sent all the same: telemetry goes to whoever
            // sends the clock. (This craft has answered a hello, and says no more.)
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
            let link = CraftLink::open(&LinkSettings::default(), IpAddr::V4(Ipv4Addr::LOCALHOST)).unwrap();
            assert!(Station::new(Settings { command_hz, ..Settings::default() }, link, None).is_err());
        }
    }

    #[test]
    fn a_pose_goes_out_at_once_with_the_time_it_was_taken_at() {
        let mut bench = Bench::new(Settings::default());
        let pose = Pose { position_m: [1.0, 2.0, -3.0], attitude_rad: [0.1; 3] };
        let age = Duration::from_millis(7);
        bench.run(4_999_990, 10, None);
        bench.station.on_tracker(5_000_000_000, TrackerEvent::Seen(Sighting { frame: 9, pose, age }));
        // Modulo 2^32.
        assert_eq!(
            bench.sent(5_000_000_000)[0].1,
            Message::Pose(TimedPose { frame: 9, ground_us: (4_999_993_000_u64 % (1 << 32)) as u32, pose })
        );
    }

    #[test]
    fn a_request_is_repeated_until_its_state_is_there_and_says_why_not() {
        let mut bench = Bench::new(Settings::default());
        bench.run(0, 100, Some(State::Disarmed));
        bench.station.on_pilot_request(100_000, PilotRequest::Arm);
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
        assert!(told.contains("Arm: these checks fail: IMU") && told.lines().count() == 1, "{told}");
        let sent = bench.run(1100, 1000, Some(State::Armed));
        assert_eq!(count(&sent, |m| matches!(m, Message::Request(_))), 0);
        assert_eq!(*bench.station.progress(), Progress::Done);
    }

    #[test]
    fn disarming_in_the_air_is_asked_for_twice() {
        let mut bench = Bench::new(Settings::default());
        bench.run(0, 100, Some(State::Flying));
        let disarms = |sent: &[(u64, u64, Message)]| count(sent, |m| *m == Message::Request(Request::Disarm));
        bench.told();
        for k in 0..5 {
            bench.station.on_pilot_request(100_000, PilotRequest::Disarm);
            let sent = bench.run(100 + 100 * k, 100, Some(State::Flying));
            assert_eq!(disarms(&sent), 0);
        }
        assert!(bench.told().contains("Y within 3 s"));
        bench.station.on_pilot_request(600_000, PilotRequest::Confirm);
        let sent = bench.run(600, 200, Some(State::Flying));
        assert!(disarms(&sent) > 0);
    }

    #[test]
    fn silence_and_faults_are_told_once_by_name() {
        let mut bench = Bench::new(Settings::default());
        bench.run(0, 500, Some(State::Flying));
        assert!(bench.told().contains("the craft is connected, its state is Flying"));
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
        assert!(told.contains("telemetry has stopped") && told.lines().count() == 1, "{told}");
        bench.tick = 100;
        bench.run(3600, 30, Some(State::Flying));
        let told = bench.told();
        assert!(told.contains("telemetry again") && told.contains("over: pose late, battery low"), "{told}");
    }

    proptest! {
        /// Junk from the network and from the tracker does no harm and does not grow.
        #[test]
        fn junk_does_no_harm(junk in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..400), 0..300)) {
            let mut bench = Bench::new(Settings::default());
            bench.run(0, 50, Some(State::Disarmed));
            for (k, bytes) in junk.iter().enumerate() {
                bench.station.on_packet(50_000 + k as u64, bytes);
                bench.station.on_tracker(50_000, TrackerEvent::Refused(format!("{bytes:?}")));
            }
            prop_assert!(bench.station.take_notices().count() <= 60);
            let sent = bench.run(1000, 100, Some(State::Disarmed));
            prop_assert!(count(&sent, |m| matches!(m, Message::Command(_))) >= 4);
        }
    }
}
