//! The craft's program against the simulated craft, in real time: UDP, a serial line, and the files
//! of the kernel's PWM interface between them, as in the air; and with `quadlab ground` at the
//! other end, all that there is.
//!
//! The plant goes by the craft's clock: each telemetry packet on its way to the ground moves it on
//! to that tick, with the pulses that are in the files. So a busy machine that leaves out ticks
//! flies worse and not in another time.
#![forbid(unsafe_code)]

#[path = "../../../firmware/com/tests/whole/common/mod.rs"]
mod common;
mod disks;
mod hall;

use std::fs;
use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use common::{Bench, Ground, IDLE, PATIENCE, Program, patient_law, signal};
use ground::link::{LinkSettings, PORT};
use hall::{Hall, LINK, free_udp_address, keyed_bench, write_key};
use model::{Battery, Model, Plant};
use nalgebra::Vector3;
use pattern::{Excitation, Pattern};
use proto::{MAX_PACKET_LEN, Message, Mode, Pose, Request, State, Telemetry, Timer};
use serde_json::Value;
use sil::{FlightPlan, NoiseModel, Script, Sensors, SimulatedCraft, for_identification};
use stories::program;

const PERIOD_S: f64 = 0.01;

/// The craft in somebody's hand, and then in the air.
struct World {
    bench: Bench,
    ground: Ground,
    craft: SimulatedCraft,
    ticks: u16,
}

impl World {
    /// One tick of the craft's program: the pulses that it gives move the plant, the plant's
    /// sensors answer.
    fn tick(&mut self, command: proto::Command) {
        let voltage_v = self.craft.voltage_v();
        if self.ground.state() == State::Flying || self.is_up() {
            let pwm = self.bench.pulses_ns().map(|pulse_ns| pulse_ns as f32 / 1000.0);
            self.craft.advance(&pwm, voltage_v);
        }
        let seen = self.craft.sense(voltage_v);
        self.ticks = self.ticks.wrapping_add(1);
        self.bench.send_imu(self.ticks, seen.gyro_rad_s.unwrap(), seen.battery_v);
        self.ground.send(Pose { position_m: seen.position_m, attitude_rad: seen.attitude_rad }, command);
        self.ground.hear(Duration::from_millis(15));
    }

    fn is_up(&self) -> bool {
        self.craft.state.rotor_rad_s.iter().any(|rotor| *rotor > 0.0)
    }

    fn until(&mut self, command: proto::Command, what: &str, holds: impl Fn(&Self) -> bool) {
        let started = Instant::now();
        while !holds(self) {
            assert!(started.elapsed() < PATIENCE, "never {what}: {:?}", self.ground.telemetry);
            self.tick(command);
        }
    }

    fn position_m(&self) -> [f64; 3] {
        self.craft.state.position_ned_m.into()
    }
}

/// Arm, climb, fly half a metre to the side, cut: what the program makes of it through all its
/// ports moves the identified plant where it should go.
#[test]
fn the_program_flies_the_plant_through_its_ports() {
    let model = Model::thesis();
    let bench = Bench::new(&patient_law(), "[guardian]\nsilence_s = 2.0\nwatchdog = 'none'\n");
    let mut program = Program::start(&program("com"), &bench, |_| {});
    let ground = Ground::new(program.address());
    let sensors = Sensors::new(&model, Some(NoiseModel::default()), PERIOD_S, 7);
    // Rotors at rest; a hand's breadth under where it is asked to be.
    let state = model::State::at_rest(Vector3::new(0.0, 0.0, -0.8), [0.0; 4]);
    let craft = SimulatedCraft::new(Plant::new(&model), Battery::constant(11.1), sensors, state, PERIOD_S, 4);
    let mut world = World { bench, ground, craft, ticks: 0 };

    let idle = proto::Command { z_m: -0.8, ..IDLE };
    world.until(idle, "ready", |world| {
        world
            .ground
            .telemetry
            .is_some_and(|telemetry| telemetry.supervision.preflight == control::Preflight::ALL.bits())
    });
    world.ground.request(Request::Arm);
    world.until(idle, "armed", |world| world.ground.state() == State::Armed);

    let hover = proto::Command { mode: Mode::Position, z_m: -1.0, cut_off: false, ..IDLE };
    world.until(hover, "flying", |world| world.ground.state() == State::Flying);
    let began = Instant::now();
    for _ in 0..500 {
        world.tick(hover);
    }
    let [x, y, z] = world.position_m();
    // Integrators have just begun to carry what the battery and the noise leave.
    assert!(x.abs() < 0.1 && y.abs() < 0.1 && (z + 1.0).abs() < 0.1, "{x} {y} {z} after 5 s");

    let aside = proto::Command { position_m: [0.5, 0.0], ..hover };
    for _ in 0..500 {
        world.tick(aside);
    }
    let [x, y, z] = world.position_m();
    // 1 s of rate-limited way and 4 s to settle: the thesis' loop is within 15 % of a step then
    // (5.5, reference).
    assert!(
        (x - 0.5).abs() < 0.1 && y.abs() < 0.1 && (z + 1.0).abs() < 0.1,
        "{x} {y} {z} after a step of 0.5 m"
    );
    let telemetry = world.ground.telemetry.unwrap();
    assert_eq!(telemetry.supervision.state, State::Flying);
    assert!(began.elapsed() > Duration::from_secs(9), "{:?} for 1000 ticks of 10 ms", began.elapsed());
    println!(
        "flown in {:?}; ticks late by up to {} us in the last one; overruns {}, lost packets {}",
        began.elapsed(),
        telemetry.counters.jitter_us,
        telemetry.counters.overruns,
        telemetry.counters.packets_lost
    );

    world.ground.request(Request::Cut);
    world.until(aside, "cut", |world| world.ground.state() == State::Cut);
    assert!(world.bench.is_idle());
}

/// Some seconds of the thesis' identification flight (4.2.1), as a pattern file.
fn excited_tour(path: &Path) {
    const LASTS_S: f64 = 5.0;
    let mut excitation = Excitation::new(3, PERIOD_S, 1.0);
    let rows = Script::tour(3, LASTS_S)
        .rows(([0.0, 0.0, -0.6], 0.0), PERIOD_S, LASTS_S, |_| excitation.next_sample().map(f64::from));
    fs::write(path, Pattern::new(rows, path).unwrap().to_csv()).unwrap();
}

/// `quadlab` with these arguments in a folder: the JSON document that it prints.
fn quadlab(folder: &Path, arguments: &[&str]) -> Value {
    let output =
        Command::new(program("quadlab")).current_dir(folder).args(arguments).arg("--json").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Everything there is, as a user has it: the craft's program, its serial line and outputs, a
/// tracker, an access point, a key, and `quadlab ground` with a script that flies twice. What it
/// recorded is compared with the craft that flew, and identified.
#[test]
fn the_ground_station_flies_the_program_and_its_recording_is_identified() {
    let mut law = for_identification(control::Config::thesis());
    // A test machine that stands still is forgiven; coming down takes less of the test's time.
    law.supervision = control::Supervision { fence: law.supervision.fence, ..patient_law().supervision };
    law.supervision.landing.descent_m_s = 0.6;
    let plan = FlightPlan { config: law, ..FlightPlan::identification(Model::thesis(), 11, 1.0) };
    let bench = keyed_bench(&law);
    let mut craft = Program::start(&program("com"), &bench, |_| {});
    let vicon = free_udp_address();
    let mut hall = Hall::open(bench, craft.address(), &plan, vicon);

    let folder = tempfile::tempdir().unwrap();
    write_key(&folder.path().join("craft.key"));
    excited_tour(&folder.path().join("tour.csv"));
    let step = |what: &str| format!("[[step]]\ndo = {what}\n");
    let flight =
        ["'arm'", "'take-off'\nheight_m = 0.6", "'pattern'\nfile = 'tour.csv'", "'land'"].map(step).concat();
    fs::write(folder.path().join("twice.toml"), flight.repeat(2)).unwrap();
    let ground = Command::new(program("quadlab"))
        .current_dir(folder.path())
        .args(["ground", "--key", "craft.key", "--link", "5", "--object", "quad", "--script", "twice.toml"])
        .args(["--craft", &hall.air.address().to_string(), "--vicon", &vicon.to_string()])
        .args(["--record", "a", "--command-hz", "100", "--plain", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let output = hall.until_ended(ground);
    let told = String::from_utf8_lossy(&output.stderr);
    println!("{told}\nflown in {:?}, up to {:?} m high and north", begun.elapsed(), hall.reached_m);
    assert!(output.status.success(), "{told}");
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["well"], true, "{document}");
    assert_eq!(document["flights"], serde_json::json!(["a-1.csv", "a-2.csv"]));
    // Disarmed a hand's breadth over the floor, as the law's landing does.
    for _ in 0..100 {
        hall.turn();
    }
    assert_eq!(hall.state(), Some(State::Disarmed));
    assert!(hall.bench.is_idle() && hall.room.is_down(), "{:?}", hall.room.position_m());
    assert!(hall.reached_m[0] > 0.5, "{:?}", hall.reached_m);
    assert!(fs::read(folder.path().join("a.mcap")).unwrap().starts_with(b"\x89MCAP0\r\n"));

    let vehicles = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/model/vehicles");
    let [model, vehicle] =
        ["f330-model.toml", "f330.toml"].map(|name| vehicles.join(name).display().to_string());
    let compared = quadlab(folder.path(), &["compare", "--model", &model, "--flights", "a-1.csv", "a-2.csv"]);
    let explained = |axis: &str| compared["total"][axis]["r2"].as_f64().unwrap();
    // The craft that flew, to what a busy machine's late poses and left-out ticks spoil: 0.996 and
    // more on a quiet one, 0.90 along w with four busy threads and no real-time priority, 0.58 to 0.7
    // on a virtual one that shares its processors. Along u and v this short flight is too gentle to
    // say anything.
    for (axis, least) in [("w", 0.5), ("p", 0.7), ("q", 0.7), ("r", 0.7)] {
        println!("{axis}: {} explained", explained(axis));
        assert!(explained(axis) > least, "{axis}: {}", compared["total"]);
    }
    let sets = ["--train", "a-1.csv", "--validate", "a-2.csv", "--out", "m.toml"];
    let identified = quadlab(folder.path(), &[&["identify", "--vehicle", &vehicle], &sets[..]].concat());
    let thrust = identified["coefficients"].as_array().unwrap().iter().find(|c| c["name"] == "C_T").unwrap();
    println!("{thrust}");
    // The thesis' 0.0180325 (table 4.1, unrounded); 0.05 % off on a quiet machine.
    assert!((thrust["value"].as_f64().unwrap() / 0.018_032_5 - 1.0).abs() < 0.03, "{thrust}");
}

/// The ground's end of the link with its files, and everything that passed over it.
struct Pilot {
    folder: tempfile::TempDir,
    link: ground::link::CraftLink,
    socket: UdpSocket,
    said: u32,
    up: Vec<Vec<u8>>,
    down: Vec<Vec<u8>>,
    telemetry: Option<Telemetry>,
}

impl Pilot {
    fn new(craft: SocketAddr) -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_key(&folder.path().join("key"));
        let (link, socket) = (Self::link(folder.path()), Self::socket(craft));
        Self { folder, link, socket, said: 0, up: Vec::new(), down: Vec::new(), telemetry: None }
    }

    fn link(folder: &Path) -> ground::link::CraftLink {
        let key = Some(folder.join("key"));
        let settings = LinkSettings { number: LINK, key, ..LinkSettings::default() };
        ground::link::CraftLink::open(&settings, "127.0.0.1".parse().unwrap()).unwrap()
    }

    fn socket(craft: SocketAddr) -> UdpSocket {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(craft).unwrap();
        socket.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
        socket
    }

    /// As after kill -9: nothing is left. (Nothing is stored, so a clean end is no other.)
    fn killed(&mut self) {
        self.link = Self::link(self.folder.path());
    }

    /// A packet to the craft, and what comes until the next is due.
    fn exchange(&mut self) {
        self.said += 1;
        let now_us = com::clock::monotonic_ns() / 1000;
        if let Some(hello) = self.link.greet(now_us) {
            let _ = self.socket.send(&hello);
        }
        if let Ok((_, packet)) = self.link.seal(now_us, &Message::Timer(Timer { ground_us: self.said })) {
            let _ = self.socket.send(&packet);
            self.up.push(packet);
        }
        let mut buffer = [0; MAX_PACKET_LEN];
        if let Ok(length) = self.socket.recv(&mut buffer) {
            let packet = &buffer[..length];
            if let Ok(Some(message)) = self.link.unseal(now_us, packet) {
                self.down.push(packet.to_vec());
                if let Message::Telemetry(telemetry) = message {
                    self.telemetry = Some(telemetry);
                }
            }
        }
    }

    /// Until the craft answers what it is told from now on, and is heard: after so many packets.
    fn until_heard(&mut self) -> u32 {
        let before = self.said;
        let started = Instant::now();
        while self.telemetry.is_none_or(|telemetry| telemetry.ground_us <= before) {
            assert!(started.elapsed() < PATIENCE, "never heard");
            self.exchange();
        }
        self.said - before
    }

    fn refused(&self) -> u32 {
        self.telemetry.map_or(0, |telemetry| telemetry.counters.packets_refused)
    }

    /// Plays everything again that was ever said, in both directions: the craft counts it, and
    /// nobody takes it.
    fn replay(&mut self) {
        let (before, count) = (self.refused(), self.up.len() as u32);
        for (k, packet) in self.up.iter().enumerate() {
            self.socket.send(packet).unwrap();
            // The craft opens some of them in a tick; the kernel keeps no more than so many.
            if k % 20 == 0 {
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        let started = Instant::now();
        while self.refused() < before + count {
            assert!(started.elapsed() < PATIENCE, "{} of {count} refused", self.refused() - before);
            self.exchange();
        }
        for packet in &self.down {
            let now_us = com::clock::monotonic_ns() / 1000;
            assert!(self.link.unseal(now_us, packet).is_err(), "the ground takes an echo");
        }
    }
}

/// Packets until both are heard after a restart: a ground station notices within half a second that
/// its craft has started anew, and says something every 20 ms then; more on a busy machine.
const SOON: u32 = 100;

/// Either side ends or is killed, or both are: they go on at once, and what was said before stays
/// said.
#[test]
fn a_restart_of_either_side_loses_no_time_and_lets_no_echo_in() {
    let bench = keyed_bench(&patient_law());
    let start = || Program::start(&program("com"), &bench, |_| {});
    let mut craft = start();
    let mut pilot = Pilot::new(craft.address());
    pilot.until_heard();
    for (what, ground, com) in [
        ("the ground station is killed", true, None),
        ("the craft's program ends", false, Some("TERM")),
        ("the craft's program is killed", false, Some("KILL")),
        ("both are killed", true, Some("KILL")),
        ("the ground station is killed again", true, None),
    ] {
        for _ in 0..20 {
            pilot.exchange();
        }
        if let Some(name) = com {
            signal(name, if name == "KILL" { craft.loop_pid() } else { craft.child.id() });
            craft.ended();
            craft = start();
            pilot.socket = Pilot::socket(craft.address());
        }
        if ground {
            pilot.killed();
        }
        let packets = pilot.until_heard();
        println!("{what}: heard after {packets} packets");
        assert!(packets < SOON, "{what}: {packets} packets");
        pilot.replay();
    }
}

/// Whoever copies the example and leaves the port out finds the craft.
#[test]
fn the_examples_port_is_the_ground_stations() {
    let example = include_str!("../../../firmware/com/com.toml");
    let listens = format!("listen = \"127.0.0.1:{PORT}\"        # with a key: 0.0.0.0:{PORT}");
    assert!(example.lines().any(|line| line == listens), "{listens}");
}

/// The craft's computer, the microcontroller's image and anybody with coreutils agree on what a
/// craft is.
#[test]
fn both_programs_tell_one_hash() {
    let bench = Bench::new(&control::Config::thesis(), "");
    let vehicles = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/model/vehicles");
    for (from, to) in [("f330.toml", "vehicle.toml"), ("f330-gains.toml", "gains.toml")] {
        fs::copy(vehicles.join(from), bench.path(to)).unwrap();
    }
    let com = com::config::Setup::read(&bench.path("com.toml")).unwrap().vehicle_sha256;
    let (config, mcu) = craft::image::decode(mcu::GAINS_IMAGE).unwrap();
    assert_eq!(config, control::Config::thesis(), "built without QUADLAB_GAINS");
    assert_eq!(com, mcu);
    let shell = "cat gains.toml vehicle.toml | sha256sum";
    let said =
        Command::new("sh").args(["-c", shell]).current_dir(bench.folder.path()).output().unwrap().stdout;
    let hash: String = com.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(String::from_utf8(said).unwrap().split(' ').next(), Some(hash.as_str()));
}
