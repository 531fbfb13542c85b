//! The ground station flies a pattern through the simulated laboratory, and what it recorded
//! identifies the craft.
//!
//! Everything passes through real sockets: the tracker's datagrams in Vicon's format, the ground's
//! packets up, the craft's packets down. Time is simulated, so that a busy machine changes nothing
//! and a minute of flight takes a second: the clock of the ground is the laboratory's, and each
//! tick waits for the packets that it knows to be under way.

use std::collections::BTreeMap;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::Duration;

use ground::link::{CraftLink, LinkSettings};
use ground::mission::{MissionStep, Progress};
use ground::mocap::frames::{Axes, Frames, xyz_from_rotation};
use ground::mocap::vicon_stream::{Block, Object};
use ground::mocap::{MocapReceiver, TrackerEvent, Vicon};
use ground::recording::{Level, Recorder, finish};
use ground::run::connect;
use ground::station::{PilotRequest, Settings, Station};
use model::{Effect, Model};
use pattern::{Excitation, Pattern};
use proto::State;
use rand::{RngExt, SeedableRng};
use sil::{FlightPlan, Laboratory, Radio, Script};

const HERE: &str = "127.0.0.1:0";
const SOON: Duration = Duration::from_secs(10);
const FRAMES: Frames = Frames::with_axes(Axes::Z_UP);

/// A laboratory and a ground station on one machine and one simulated clock.
struct Day {
    lab: Laboratory,
    radio: Radio,
    station: Station,
    vicon: Vicon,
    tracker: UdpSocket,
    socket: UdpSocket,
    frame: u32,
    /// The cameras see the craft, and its tracker runs.
    tracks: bool,
    /// What the network does on the way up and down.
    ways: [Way; 2],
    /// Datagrams to the station that are not the tracker's.
    forged: usize,
    /// How many frames of each tick the station took.
    seen: Vec<usize>,
    now_s: f64,
    /// When the ground station was started: its clock begins there.
    started_s: f64,
    told: Vec<(f64, Level, String)>,
}

/// One way through a network.
struct Way {
    dice: rand_pcg::Pcg64Mcg,
    /// Which part of the packets is lost; a tenth of the others comes twice.
    lost: f64,
    /// How late they are at least and at most, s: each by itself, so that they overtake each other.
    late_s: [f64; 2],
    /// When each that is under way arrives.
    under_way: Vec<(f64, Vec<u8>)>,
}

impl Way {
    fn new(seed: u64, lost: f64, late_s: [f64; 2]) -> Self {
        Self { dice: rand_pcg::Pcg64Mcg::seed_from_u64(seed), lost, late_s, under_way: Vec::new() }
    }

    /// Takes packets in; gives those that arrive by now, in the order of their arrival.
    fn pass(&mut self, now_s: f64, packets: impl IntoIterator<Item = Vec<u8>>) -> Vec<Vec<u8>> {
        let [shortest_s, longest_s] = self.late_s;
        if self.lost == 0.0 && longest_s == 0.0 {
            return packets.into_iter().collect();
        }
        for packet in packets {
            let copies = if self.dice.random_bool(self.lost) {
                0
            } else {
                1 + usize::from(self.dice.random_bool(0.1))
            };
            for _ in 0..copies {
                let late_s = shortest_s + (longest_s - shortest_s) * self.dice.random::<f64>();
                self.under_way.push((now_s + late_s, packet.clone()));
            }
        }
        self.under_way.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let arrived = self.under_way.partition_point(|(at_s, _)| *at_s <= now_s);
        self.under_way.drain(..arrived).map(|(_, packet)| packet).collect()
    }
}

impl Day {
    fn new(plan: &FlightPlan, clock_skew: f64, steps: Vec<MissionStep>, record: Option<&Path>) -> Self {
        let radio = Radio::open().unwrap();
        let socket = connect(radio.address().unwrap()).unwrap();
        socket.set_read_timeout(Some(SOON)).unwrap();
        let vicon = Vicon::listen(HERE.parse().unwrap(), None, Some("quad".into()), FRAMES).unwrap();
        let tracker = UdpSocket::bind(HERE).unwrap();
        tracker.connect(vicon.address().unwrap()).unwrap();
        let link = CraftLink::open(&LinkSettings::default(), radio.address().unwrap().ip()).unwrap();
        let recorder = record.map(|name| Recorder::begin(name, 0, &BTreeMap::new()).unwrap());
        let settings = Settings { command_hz: 100.0, steps, ..Settings::default() };
        Self {
            lab: Laboratory::new(plan, clock_skew).unwrap(),
            radio,
            station: Station::new(settings, link, recorder).unwrap(),
            vicon,
            tracker,
            socket,
            frame: 0,
            tracks: true,
            ways: [1, 2].map(|seed| Way::new(seed, 0.0, [0.0; 2])),
            forged: 0,
            seen: Vec::new(),
            now_s: 5.0,
            started_s: 0.0,
            told: Vec::new(),
        }
    }

    fn now_us(&self, later_s: f64) -> u64 {
        ((self.now_s - self.started_s + later_s) * 1e6) as u64
    }

    /// The ground sends; the craft hears all of it.
    fn up(&mut self, later_s: f64) {
        self.station.poll(self.now_us(later_s));
        let mut under_way = 0;
        for packet in self.ways[0].pass(self.now_s + later_s, self.station.take_packets()) {
            self.socket.send(&packet).unwrap();
            under_way += 1;
        }
        while under_way > 0 {
            under_way -= self.radio.receive(&mut self.lab).min(under_way);
        }
    }

    /// One tick of the craft: telemetry reaches the ground 2 ms later, the pose 3 ms later, and is
    /// in the craft with the next tick.
    fn tick(&mut self) {
        let pose = self.lab.tick();
        let under_way = self.radio.send(&mut self.lab);
        let mut buffer = [0; 2048];
        let said: Vec<Vec<u8>> = (0..under_way)
            .map(|_| {
                let length = self.socket.recv(&mut buffer).unwrap();
                buffer[..length].to_vec()
            })
            .collect();
        for packet in self.ways[1].pass(self.now_s, said) {
            self.station.on_packet(self.now_us(0.002), &packet);
        }
        let pose = proto::Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad };
        if self.tracks {
            self.tracker.send(&frame_of(self.frame, &pose)).unwrap();
            self.frame += 1;
        }
        let under_way = usize::from(self.tracks) + std::mem::take(&mut self.forged);
        let mut seen = 0;
        for _ in 0..under_way {
            let heard = self.vicon.next(SOON).unwrap();
            assert_ne!(heard, TrackerEvent::Nothing);
            seen += usize::from(matches!(heard, TrackerEvent::Seen(_)));
            self.station.on_tracker(self.now_us(0.003), heard);
        }
        self.seen.push(seen);
        // The ramp goes out whenever it is due; what comes between two ticks waits for the second. (The ground's clock does not go
        // back behind the pose that it has had.)
        let period_s = self.lab.period_s();
        for part in 3..=8 {
            self.up(period_s * f64::from(part) / 8.0 - 1e-4);
        }
        self.now_s += period_s;
        let told: Vec<_> = self.station.take_notices().collect();
        self.told.extend(told.into_iter().map(|told| (told.at_us as f64 * 1e-6, told.level, told.text)));
    }

    fn until(&mut self, limit_s: f64, holds: impl Fn(&Self) -> bool) {
        let end_s = self.now_s + limit_s;
        while !holds(self) {
            assert!(self.now_s < end_s, "not within {limit_s} s: {:#?} {:?}", self.told, self.lab.state());
            self.tick();
        }
    }

    fn state(&self) -> Option<State> {
        self.station.snapshot(0).telemetry.map(|(telemetry, _)| telemetry.supervision.state)
    }
}

/// A frame of the tracker, as its datagram.
fn frame_of(frame: u32, pose: &proto::Pose) -> Vec<u8> {
    let (position_m, rotation) = FRAMES.seen(pose);
    let quad = Object {
        name: "quad".into(),
        translation_mm: position_m.map(|m| m * 1e3),
        rotation_rad: xyz_from_rotation(&rotation),
    };
    let wand = Object { name: "wand".into(), translation_mm: [1.0; 3], rotation_rad: [0.0; 3] };
    Block { frame, objects: vec![wand, quad] }.to_bytes()
}

/// A tour of the cage with the thesis' excitation, as a pattern file would have it.
fn tour(seed: u64, duration_s: f64) -> Box<Pattern> {
    let mut excitation = Excitation::new(seed, 0.01, 1.0);
    let rows = Script::tour(seed, duration_s)
        .rows(([0.0, 0.0, -1.0], 0.0), 0.01, duration_s, |_| excitation.next_sample().map(f64::from));
    let path = Path::new("tour.csv");
    let text = Pattern::new(rows, path).unwrap().to_csv();
    Box::new(Pattern::parse(text.as_bytes(), path).unwrap())
}

/// From the floor through a pattern to the floor; the flight file that is left.
fn flown(folder: &Path, seed: u64) -> PathBuf {
    let plan = FlightPlan::identification(Model::thesis(), seed, 1.0);
    let name = folder.join(format!("flight{seed}"));
    let steps = vec![
        MissionStep::Arm {},
        MissionStep::TakeOff { height_m: 1.0 },
        MissionStep::Fly { pattern: tour(seed, 25.0), times: 1, excite: None },
        MissionStep::Land {},
    ];
    let mut day = Day::new(&plan, 0.0, steps, Some(&name));
    day.until(90.0, |day| *day.station.progress() != Progress::Going);
    assert_eq!(*day.station.progress(), Progress::Done, "seed {seed}: {:#?}", day.told);
    assert!(!day.station.is_faulty());
    // Disarmed a hand's breadth over the floor, as the law's landing does.
    day.until(1.0, |day| day.lab.is_down());
    drop(day);
    let finished = finish(&name).unwrap();
    let [flight] = &finished.flights[..] else { panic!("seed {seed}: {finished:?}") };
    assert_messages_fit_their_schemas(&finished.mcap);
    flight.clone()
}

/// Every message of a recording is what the schema in the same file says, and those for Foxglove's 3-D panel are there.
fn assert_messages_fit_their_schemas(recording: &Path) {
    let bytes = std::fs::read(recording).unwrap();
    let (mut validators, mut counts) = (BTreeMap::new(), BTreeMap::<String, u32>::new());
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let validator = validators.entry(message.channel.id).or_insert_with(|| {
            let schema = message.channel.schema.as_ref().expect("a schema");
            let schema: serde_json::Value = serde_json::from_slice(&schema.data).unwrap();
            jsonschema::validator_for(&schema).unwrap()
        });
        let value = serde_json::from_slice(&message.data).unwrap();
        if let Err(why) = validator.validate(&value) {
            panic!("{}: {why}: {value}", message.channel.topic);
        }
        *counts.entry(message.channel.topic.clone()).or_default() += 1;
    }
    println!("{}: {counts:?}", recording.display());
    assert!(
        counts["/telemetry"] > 1000 && counts["/tf"] == counts["/pose"] && counts["/track"] > 20,
        "{counts:?}"
    );
}

#[test]
fn recorded_flights_identify_the_craft_that_flew() {
    let folder = tempfile::tempdir().unwrap();
    let truth = Model::thesis();
    let flights: Vec<_> = (1..=3).map(|seed| flown(folder.path(), seed)).collect();
    let prepared: Vec<_> = flights
        .iter()
        .map(|path| {
            let flight = flights::Flight::read(path).unwrap();
            flight.check_against(&truth.vehicle, path).unwrap();
            let examined = sysid::examine(&flight, &truth.vehicle).unwrap();
            println!("{}: {} rows, clocks {:?}", path.display(), flight.len(), examined.clocks);
            for fault in &examined.faults {
                println!("  {}", fault.sentence);
            }
            examined.prepared
        })
        .collect();
    // Everything that the craft has; a fit without some of it puts it into the rest.
    let effects: Vec<Effect> = truth.terms.iter().map(|term| term.effect).collect();
    let fit = sysid::fit(&prepared.iter().collect::<Vec<_>>(), &truth.vehicle, &effects, None).unwrap();
    let mut worst: f64 = 0.0;
    for term in &fit.model.terms {
        let wanted = truth.terms.iter().find(|t| t.effect == term.effect);
        for (k, (info, got)) in term.effect.info().coefficients.iter().zip(&term.coefficients).enumerate() {
            let wanted = wanted.map_or(0.0, |term| term.coefficients[k].value);
            let error = got.std_error.unwrap_or(f64::NAN);
            let off = (got.value - wanted) / error;
            println!(
                "{} {}: {:.6} +- {error:.6}, true {wanted:.6}, off by {off:.2} errors",
                term.effect.info().id,
                info.name,
                got.value
            );
            worst = worst.max(off.abs());
        }
    }
    // Some 24 coefficients: 4.5 standard errors is what is asked of identification on flights of
    // others, too.
    assert!(worst < 4.5, "{worst:.2} standard errors");
}

#[test]
fn a_fast_clock_is_named_within_two_seconds_of_the_first_telemetry() {
    let plan = FlightPlan::identification(Model::thesis(), 1, 1.0);
    for (skew, word) in [(0.0118, "fast"), (-0.0118, "slow")] {
        let mut day = Day::new(&plan, skew, Vec::new(), None);
        day.until(1.0, |day| day.state().is_some());
        let heard_s = day.now_s;
        day.until(5.0, |day| day.told.iter().any(|(_, level, _)| *level == Level::Error));
        let (at_s, _, text) = day.told.iter().find(|(_, level, _)| *level == Level::Error).unwrap().clone();
        println!("after {:.2} s: {text}", at_s - heard_s);
        assert!(at_s - heard_s < 2.0 && text.contains(word), "{at_s} {heard_s} {text}");
        // 1.18 %, to the tenth of it that a second and a half of ramps can tell.
        assert!(text.contains("1.1") || text.contains("1.2"), "{text}");
        assert!(day.station.is_faulty());
    }
}

/// By hand: arm, take off, cut in the air. The craft falls, stays cut, and only a disarm lets it
/// arm again.
#[test]
fn a_person_flies_by_wishes() {
    let plan = FlightPlan::identification(Model::thesis(), 3, 1.0);
    let mut day = Day::new(&plan, 0.0, Vec::new(), None);
    day.until(2.0, |day| day.state() == Some(State::Disarmed));
    for _ in 0..100 {
        day.tick();
    }
    let wish = |day: &mut Day, wish| {
        let now_us = day.now_us(0.0);
        day.station.on_pilot_request(now_us, wish);
    };
    wish(&mut day, PilotRequest::Arm);
    day.until(1.0, |day| day.state() == Some(State::Armed));
    wish(&mut day, PilotRequest::TakeOff);
    day.until(6.0, |day| day.lab.position_m()[2] < -0.9);
    wish(&mut day, PilotRequest::Cut);
    let cut_s = day.now_s;
    day.until(1.0, |day| day.lab.state() == control::State::Cut);
    // Sent at once, heard with the next tick.
    assert!(day.now_s - cut_s < 0.035, "{} s", day.now_s - cut_s);
    day.until(2.0, |day| day.lab.is_down());
    wish(&mut day, PilotRequest::Arm);
    for _ in 0..700 {
        day.tick();
    }
    assert_eq!(day.lab.state(), control::State::Cut, "a cut craft does not arm");
    wish(&mut day, PilotRequest::Disarm);
    day.until(1.0, |day| day.state() == Some(State::Disarmed));
    wish(&mut day, PilotRequest::Arm);
    day.until(1.0, |day| day.state() == Some(State::Armed));
}

/// A ground station that is started anew while the craft flies, whose clock begins anew with it, takes
/// the craft over where it is, and lands it.
#[test]
fn a_restarted_ground_station_takes_a_flying_craft_over() {
    let plan = FlightPlan::identification(Model::thesis(), 4, 1.0);
    let mut day =
        Day::new(&plan, 0.0, vec![MissionStep::Arm {}, MissionStep::TakeOff { height_m: 1.0 }], None);
    day.until(20.0, |day| *day.station.progress() == Progress::Done && day.lab.position_m()[2] < -0.9);
    let peer: SocketAddr = day.radio.address().unwrap();
    let link = CraftLink::open(&LinkSettings::default(), peer.ip()).unwrap();
    let settings = Settings { command_hz: 100.0, ..Settings::default() };
    day.station = Station::new(settings, link, None).unwrap();
    day.started_s = day.now_s - 0.01;
    for _ in 0..300 {
        day.tick();
        assert_eq!(day.lab.state(), control::State::Flying, "{:#?}", day.told);
    }
    let [x, y, z] = day.lab.position_m();
    assert!(x.abs() < 0.15 && y.abs() < 0.15 && (z + 1.0).abs() < 0.2, "{x} {y} {z}");
    let now_us = day.now_us(0.0);
    day.station.on_pilot_request(now_us, PilotRequest::Land);
    day.until(20.0, |day| day.lab.is_down() && day.state() == Some(State::Disarmed));
}

/// A craft that hovers at a metre.
fn hovering() -> Day {
    hovering_under(FlightPlan::identification(Model::thesis(), 5, 1.0).config)
}

/// The same under these gains.
fn hovering_under(config: control::Config) -> Day {
    let plan = FlightPlan { config, ..FlightPlan::identification(Model::thesis(), 5, 1.0) };
    let mut day =
        Day::new(&plan, 0.0, vec![MissionStep::Arm {}, MissionStep::TakeOff { height_m: 1.0 }], None);
    day.until(20.0, |day| *day.station.progress() == Progress::Done && day.lab.position_m()[2] < -0.9);
    for _ in 0..100 {
        day.tick();
    }
    assert_eq!(day.lab.state(), control::State::Flying);
    day
}

/// Flies on for some ticks, each after what an attacker does; the craft has to stay in the air where it is.
fn flies_on(day: &mut Day, ticks: u32, mut attack: impl FnMut(&mut Day, u32)) {
    let before = day.lab.position_m();
    for tick in 0..ticks {
        attack(day, tick);
        day.tick();
        assert_eq!(day.lab.state(), control::State::Flying, "tick {tick}: {:#?}", day.told);
    }
    let off = |n: usize| (day.lab.position_m()[n] - before[n]).abs();
    assert!(off(0) < 0.15 && off(1) < 0.15 && off(2) < 0.15, "{before:?} {:?}", day.lab.position_m());
}

/// 3 m from where the craft is.
const ELSEWHERE: proto::Pose = proto::Pose { position_m: [3.0, 0.0, -1.0], attitude_rad: [0.0; 3] };

#[test]
fn one_forged_datagram_of_the_tracker_changes_nothing() {
    // From another port, and as from the tracker's own.
    for is_own in [false, true] {
        for ahead in [1, 50, 999, 100_000] {
            let mut day = hovering();
            let forger = UdpSocket::bind(HERE).unwrap();
            let forger = if is_own { day.tracker.try_clone().unwrap() } else { forger };
            let to = day.vicon.address().unwrap();
            flies_on(&mut day, 300, |day, tick| {
                if tick == 10 {
                    let datagram = frame_of(day.frame + ahead, &ELSEWHERE);
                    let sent = if is_own { forger.send(&datagram) } else { forger.send_to(&datagram, to) };
                    assert_eq!(sent.unwrap(), datagram.len());
                    day.forged += 1;
                }
            });
            assert!(day.seen.iter().rev().take(300).all(|seen| *seen == 1), "{is_own} {ahead}");
        }
    }
}

#[test]
fn a_thousand_forged_datagrams_of_the_tracker_a_second_change_nothing() {
    // From another port, and as from the tracker's own.
    for is_own in [false, true] {
        let mut day = hovering();
        let forger = UdpSocket::bind(HERE).unwrap();
        forger.connect(day.vicon.address().unwrap()).unwrap();
        let forger = if is_own { day.tracker.try_clone().unwrap() } else { forger };
        let mut number = 1_000_000;
        flies_on(&mut day, 1000, |day, _| {
            for _ in 0..10 {
                forger.send(&frame_of(number, &ELSEWHERE)).unwrap();
                (number, day.forged) = (number + 1, day.forged + 1);
            }
        });
        assert!(day.seen.iter().rev().take(1000).all(|seen| *seen == 1), "{is_own}");
        let refused = day.station.snapshot(0).tracker.refused;
        assert!(refused >= 10_000, "{refused} are counted");
    }
}

#[test]
fn a_restarted_tracker_is_heard_again_in_flight() {
    let mut day = hovering();
    let before = day.lab.position_m();
    // Its program ends, and comes again at another port with frames from 0 on.
    day.tracks = false;
    for _ in 0..12 {
        day.tick();
    }
    // What counts as silent is time of this machine.
    std::thread::sleep(Duration::from_millis(120));
    day.tracker = UdpSocket::bind(HERE).unwrap();
    day.tracker.connect(day.vicon.address().unwrap()).unwrap();
    (day.tracks, day.frame) = (true, 0);
    for _ in 0..300 {
        day.tick();
    }
    assert_eq!(day.seen[day.seen.len() - 300..][..3], [0, 0, 1]);
    assert_eq!(day.lab.state(), control::State::Flying, "{:#?}", day.told);
    let [x, y, z] = day.lab.position_m();
    let off = [x - before[0], y - before[1], z - before[2]];
    assert!(off.iter().all(|off| off.abs() < 0.15), "{off:?}");
}

/// Packets that are lost, come twice, late, and in another order, each way, for 10 s: the craft flies on or holds, lands if it has to,
/// never falls, and goes on flying when the link is good again. It stays where it is to half a metre.
#[test]
fn a_bad_link_is_flown_over_held_or_landed() {
    use control::State::{Disarmed, Flying, Hold, Land};
    let thesis = FlightPlan::identification(Model::thesis(), 5, 1.0).config;
    let designed = sil::for_identification(sil::designed_config().unwrap());
    let cases: [(f64, [f64; 2], &[control::State]); 9] = [
        (0.1, [0.0, 0.0], &[Flying]),
        (0.1, [0.0, 0.03], &[Flying]),
        (0.3, [0.0, 0.05], &[Flying, Hold]),
        (0.0, [0.0, 0.2], &[Flying, Hold]),
        (0.5, [0.0, 0.0], &[Flying, Hold]),
        (0.5, [0.0, 0.05], &[Flying, Hold]),
        (0.5, [0.0, 0.2], &[Flying, Hold, Land, Disarmed]),
        (0.0, [0.08, 0.08], &[Flying, Hold]),
        (0.1, [0.05, 0.08], &[Flying, Hold]),
    ];
    for (lost, late_s, allowed) in cases {
        for seed in [3, 5, 7] {
            fly_over_bad_link(&thesis, seed, lost, late_s, allowed);
            fly_over_bad_link(&designed, seed, lost, late_s, allowed);
        }
    }
    fly_over_bad_link(&designed, 3, 0.1, [0.0, 0.05], &[Flying]);
}

/// 10 s of a bad link, and 3 s of a good one.
fn fly_over_bad_link(
    config: &control::Config,
    seed: u64,
    lost: f64,
    late_s: [f64; 2],
    allowed: &[control::State],
) {
    use control::State::{Disarmed, Flying, Land};
    let link = format!("seed {seed}, {lost} lost, {late_s:?} s late");
    let mut day = hovering_under(*config);
    let before = day.lab.position_m();
    let mut went = vec![Flying];
    for (ticks, lost, late_s) in [(1000, lost, late_s), (300, 0.0, [0.0; 2])] {
        day.ways = [seed, seed + 1].map(|seed| Way::new(seed, lost, late_s));
        for tick in 0..ticks {
            day.tick();
            let state = day.lab.state();
            assert!(allowed.contains(&state), "{link}, tick {tick}: {state:?} {:#?}", day.told);
            assert!(state != Disarmed || day.lab.is_down(), "{link}, tick {tick}: it falls");
            if went.last() != Some(&state) {
                went.push(state);
            }
        }
    }
    let last = went[went.len() - 1];
    let has_landed = went.contains(&Land);
    assert!(if has_landed { matches!(last, Land | Disarmed) } else { last == Flying }, "{link}: {went:?}");
    let [x, y, _] = day.lab.position_m();
    let off_m = (x - before[0]).hypot(y - before[1]);
    println!("{link}: {off_m:.2} m off, {} states", went.len());
    assert!(off_m < 0.5, "{link}: {x} {y}, from {before:?}");
}
