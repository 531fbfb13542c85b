//! The microcontroller's own program over serial lines, in QEMU: boots, arms, takes off, flies
//! missions and lands, with a plant and a ground station at the other ends. No tick may be missed.
//!
//! The chip's time is QEMU's count of instructions, 8 ns each: 125 million a second, what an STM32F405
//! of 168 MHz does with four cycles for three. So a tick is late when the program takes too long for
//! it, whatever else the machine that emulates has to do; while the board waits for the plant, its
//! clock stands still (`mcu::simulator`). By the machine's own clock the figure would be its
//! scheduler's.
//!
//! `QUADLAB_SERIAL_S` says for how long, `QUADLAB_KEY` with which key the program was built; `cargo xtask test --nightly serial` flies
//! with one, then ten minutes without.
#![forbid(unsafe_code)]

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use control::{Config, Pose};
use mcu::simulator::{Request, Sample};
use proto::{Deframer, GroundEnd, MAX_PACKET_LEN, MAX_STREAM_LEN, Message, Supervision, enframe};
use sil::endurance::{Missions, Seen};
use sil::{FlightPlan, NoiseModel, Room, Scenario, Script, Settings};

/// How long QEMU may take for anything.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long it flies, s, if nothing else is said: arming, take-off, some of the pattern.
const SHORT_S: f64 = 12.0;
/// Of all ticks, so many may be missed.
const MISSED: f64 = 1e-5;

/// The emulated board; it does not outlive its owner.
struct Board {
    qemu: Child,
    link: UnixStream,
    simulator: UnixStream,
    /// What has come from the board for the ground, and was not asked for yet.
    said: Vec<u8>,
    _folder: tempfile::TempDir,
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
    }
}

fn accepted(listener: &UnixListener, qemu: &mut Child) -> UnixStream {
    listener.set_nonblocking(true).unwrap();
    let began = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => return stream,
            Err(error) => assert_eq!(error.kind(), ErrorKind::WouldBlock, "{error}"),
        }
        assert_eq!(qemu.try_wait().unwrap(), None, "QEMU ended");
        assert!(began.elapsed() < PATIENCE, "QEMU does not connect");
        std::thread::sleep(Duration::from_millis(5));
    }
}

impl Board {
    fn boot(program: &PathBuf) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["link", "simulator"].map(|name| folder.path().join(name));
        let [link, simulator] = paths.each_ref().map(|path| UnixListener::bind(path).unwrap());
        let mut command = Command::new("qemu-system-arm");
        command.args(["-machine", "mps2-an386", "-cpu", "cortex-m4", "-display", "none", "-monitor", "none"]);
        // 2^3 ns an instruction; who waits for time does not sleep.
        command.args(["-icount", "shift=3,sleep=off"]);
        for path in &paths {
            command.arg("-serial").arg(format!("unix:{}", path.display()));
        }
        command.arg("-kernel").arg(program).stdin(Stdio::null()).stderr(Stdio::null());
        let mut qemu = command.spawn().expect("qemu-system-arm");
        let [link, simulator] = [&link, &simulator].map(|listener| accepted(listener, &mut qemu));
        link.set_nonblocking(true).unwrap();
        simulator.set_nonblocking(true).unwrap();
        Self { qemu, link, simulator, said: Vec::new(), _folder: folder }
    }

    /// The board's next question. What it says to the ground meanwhile is taken: of bytes that come one by one a socket holds some hundred
    /// only, and the board would wait for room.
    fn asks(&mut self, deframer: &mut Deframer) -> Request {
        let (mut byte, began) = ([0], Instant::now());
        loop {
            match self.simulator.read(&mut byte) {
                Ok(0) => panic!("QEMU has closed the simulator's line"),
                Ok(_) => {
                    if let Some(frame) = deframer.push(byte[0]) {
                        return Request::from_bytes(frame).expect("a request");
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    assert!(began.elapsed() < PATIENCE, "the board asks nothing");
                    self.listen();
                    std::thread::sleep(Duration::from_micros(50));
                }
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Takes what has come from the board for the ground.
    fn listen(&mut self) {
        let mut bytes = [0; 4096];
        loop {
            match self.link.read(&mut bytes) {
                Ok(0) => panic!("QEMU has closed the line"),
                Ok(count) => self.said.extend_from_slice(&bytes[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Bytes that have come from the board for the ground.
    fn said(&mut self) -> Vec<u8> {
        self.listen();
        std::mem::take(&mut self.said)
    }
}

/// The ground's end of the line.
struct Ground {
    end: GroundEnd,
    deframer: Deframer,
    sent: u32,
    refused: u32,
}

impl Ground {
    fn send(&mut self, board: &mut Board, packet: &[u8]) {
        let mut stream = [0; MAX_STREAM_LEN];
        let bytes = enframe(packet, &mut stream).expect("it fits");
        // A tick's packets are far fewer than a socket holds.
        board.link.write_all(bytes).unwrap();
        self.sent = self.sent.wrapping_add(bytes.len() as u32);
    }

    fn say(&mut self, board: &mut Board, now_ms: u32, messages: &[Message]) {
        let mut packet = [0; MAX_PACKET_LEN];
        if let Some(hello) = self.end.greet(now_ms, &mut packet).map(<[u8]>::to_vec) {
            self.send(board, &hello);
        }
        for message in messages.iter().filter(|_| self.end.is_open()).copied().collect::<Vec<_>>() {
            let mut packet = [0; MAX_PACKET_LEN];
            let sealed = self.end.seal(now_ms, &message, &mut packet).expect("a session").1.to_vec();
            self.send(board, &sealed);
        }
    }

    /// What the craft's telemetry says, if it came.
    fn hear(&mut self, board: &mut Board, now_ms: u32) -> Option<Supervision> {
        let mut newest = None;
        for byte in board.said() {
            let Some(packet) = self.deframer.push(byte) else { continue };
            match self.end.hear(now_ms, packet) {
                Ok(Some((_, Message::Telemetry(telemetry)))) => newest = Some(telemetry.supervision),
                Ok(_) => {}
                Err(_) => self.refused += 1,
            }
        }
        newest
    }
}

/// Ticks that were, ticks that were missed.
#[derive(Debug, Default)]
struct Ticks {
    seen: u64,
    missed: u64,
    last_us: Option<u32>,
}

impl Ticks {
    fn count(&mut self, time_us: u32, period_us: u32) {
        if let Some(last_us) = self.last_us.replace(time_us) {
            let periods = time_us.wrapping_sub(last_us).saturating_add(period_us / 2) / period_us;
            self.missed += u64::from(periods.saturating_sub(1));
        }
        self.seen += 1;
    }
}

/// The pattern of the thesis again and again: what the gains that are built in are for.
fn pattern(_: u64) -> Script {
    Scenario::Pattern.plan(&Settings::default()).script
}

/// The key that the program was built with, if it was.
fn key() -> Option<proto::Key> {
    let file = std::env::var_os("QUADLAB_KEY")?;
    Some(proto_files::read_key(file.as_ref()).expect("the link's key"))
}

#[test]
fn the_microcontroller_flies_missions_over_its_serial_lines_and_misses_no_tick() {
    let Some(program) = std::env::var_os("QUADLAB_CORTEX_M4_MCU").map(PathBuf::from) else {
        println!(
            "SKIPPED: QUADLAB_CORTEX_M4_MCU is not set: `cargo xtask test` builds the ARM programs where `cargo xtask setup` was run"
        );
        return;
    };
    let duration_s = std::env::var("QUADLAB_SERIAL_S").map_or(SHORT_S, |text| text.parse().expect("seconds"));
    let began = Instant::now();
    let config = Config::thesis();
    let (period_s, period_us) = (config.sample_time_s, 10_000);
    let plan = FlightPlan {
        config,
        noise: Some(NoiseModel::default()),
        ..FlightPlan::identification(model::Model::thesis(), 1, 1.0)
    };
    let mut room = Room::new(&plan, period_s).unwrap();
    let mut missions = Missions::new(pattern, 1, period_s);
    let mut board = Board::boot(&program);
    let mut ground =
        Ground { end: GroundEnd::new(0, key(), [7; 32]), deframer: Deframer::new(), sent: 0, refused: 0 };
    let (mut deframer, mut ticks) = (Deframer::new(), Ticks::default());
    // A first byte: the board learns that there is a simulator.
    board.simulator.write_all(&[0]).unwrap();
    while missions.times_s()[0] < duration_s {
        let request = board.asks(&mut deframer);
        ticks.count(request.time_us, period_us);
        let idle = request.commands.iter().all(|command| *command <= config.command_range[0] as f32);
        room.advance(&request.commands, idle);
        let now_ms = (missions.times_s()[0] * 1000.0) as u32;
        let supervision = ground.hear(&mut board, now_ms);
        let sensed = room.sense();
        let pose = Pose { position_m: sensed.position_m, attitude_rad: sensed.attitude_rad };
        let said = missions.tick(&Seen { pose, position_m: room.position_m(), supervision });
        ground.say(&mut board, now_ms, &said.expect("nothing but low batteries"));
        if missions.battery_is_due() {
            room.change_battery();
        }
        let gyro_rad_s = sensed.gyro_rad_s.expect("a gyro");
        let sample = Sample { gyro_rad_s, battery_v: sensed.battery_v, link_bytes: ground.sent };
        let mut stream = [0; MAX_STREAM_LEN];
        board.simulator.write_all(enframe(&sample.to_bytes(), &mut stream).unwrap()).unwrap();
    }
    let [simulated_s, flown_s] = missions.times_s();
    let Ticks { seen, missed, .. } = ticks;
    println!(
        "{simulated_s:.0} s of the craft's time, {flown_s:.0} s of them in flight, {} missions: {seen} ticks, {missed} missed, {} packets refused; {:.0} s of this machine's",
        missions.flown(),
        ground.refused,
        began.elapsed().as_secs_f64()
    );
    assert!(missed as f64 <= MISSED * seen as f64, "{missed} of {seen} ticks missed");
    assert!(flown_s > 0.3 * simulated_s && ground.refused == 0, "{flown_s} s of {simulated_s} s in flight");
}
