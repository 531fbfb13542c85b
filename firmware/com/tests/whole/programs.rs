//! The small commands around flying, and the link with a key, as whole programs.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use control::Config;
use craft::Lockstep;
use proto::{MAX_PACKET_LEN, Message, Mode, Opener, Outcome, Pose, Readings, Role, Sealer, State};
use rand::{RngExt, SeedableRng};
use serde_json::Value;

use crate::common::{Bench, Ground, Held, IDLE, PATIENCE, Program, patient_law, signal};

const PROGRAM: &str = env!("CARGO_BIN_EXE_com");

fn com(arguments: &[&str]) -> Output {
    Command::new(PROGRAM).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The simulator's side of a lockstep over UDP.
struct Simulator {
    socket: UdpSocket,
    sealer: Sealer,
    opener: Opener,
}

impl Simulator {
    fn ask(&mut self, readings: Readings) -> Outcome {
        let mut buffer = [0; MAX_PACKET_LEN];
        let (_, packet) = self.sealer.seal(&Message::Readings(readings), &mut buffer).unwrap();
        self.socket.send(packet).unwrap();
        let length = self.socket.recv(&mut buffer).unwrap();
        match self.opener.unseal(&buffer[..length]).unwrap() {
            (_, Message::Outcome(outcome)) => outcome,
            other => panic!("{other:?}"),
        }
    }
}

/// The law in another process gives the bits that it gives here; a tick asked for twice is ticked
/// once.
#[test]
fn lockstep_over_udp_is_the_law_bit_for_bit() {
    let law = Config::thesis();
    let mut child =
        Command::new(PROGRAM).arg("lockstep").stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    writeln!(stdin, "{}", serde_json::to_string(&law).unwrap()).unwrap();
    let mut address = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(address.trim()).unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut simulator =
        Simulator { socket, sealer: Sealer::new(Role::Ground, 0), opener: Opener::new(Role::Craft, 0) };
    let mut here = Lockstep::new(&law).unwrap();
    let seed = 41;
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    for tick in 0..1000_u32 {
        let mut near = |centre: f32, spread: f32| centre + spread * random.random_range(-1.0..1.0_f32);
        let readings = Readings {
            tick,
            time_us: tick.wrapping_mul(10_000),
            pose: Some(Pose {
                position_m: [near(0.0, 0.1), near(0.0, 0.1), near(-1.0, 0.1)],
                attitude_rad: [near(0.0, 0.1), near(0.0, 0.1), near(0.0, 0.1)],
            }),
            gyro_rad_s: Some([near(0.0, 0.2), near(0.0, 0.2), near(0.0, 0.2)]),
            battery_v: near(11.1, 0.1),
            command: Some(proto::Command { cut_off: false, mode: Mode::Position, ..IDLE }),
            request: None,
            outputs_ready: true,
        };
        let expected = here.answer(&Message::Readings(readings)).unwrap();
        let got = simulator.ask(readings);
        // Equal as text means equal in every bit but the sign of a NaN: f32 prints with all its
        // digits.
        assert_eq!(format!("{got:?}"), format!("{expected:?}"), "tick {tick}, seed {seed}");
        if tick % 100 == 7 {
            assert_eq!(simulator.ask(readings), expected, "asked again at {tick}");
        }
    }
    drop(stdin);
    assert!(child.wait().unwrap().success(), "it leaves when the simulator is done");
}

#[test]
fn a_simulator_elsewhere_has_to_be_let_in() {
    let bench = Bench::new(&Config::thesis(), "");
    let gains = bench.path("gains.toml");
    let output = com(&["lockstep", "--gains", gains.to_str().unwrap(), "--listen", "0.0.0.0:0"]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(error.contains("is not on this machine") && error.lines().count() == 1, "{error}");
}

#[test]
fn a_configuration_is_checked_and_named() {
    let bench = Bench::new(&Config::thesis(), "");
    let config = bench.path("com.toml");
    let config = config.to_str().unwrap();
    let said = String::from_utf8(com(&["check", config]).stdout).unwrap();
    assert!(said.contains("valid, for \"F330 (thesis)\""), "{said}");
    assert_eq!(bench.pulses_ns(), [0; 4], "no device was touched");
    let identity = json(&com(&["identity", config]));
    assert_eq!(identity["program"], env!("CARGO_PKG_VERSION"));
    assert_eq!(identity["has_key"], false);
    fs::remove_file(bench.path("gains.toml")).unwrap();
    let output = com(&["run", config]);
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(String::from_utf8(output.stderr).unwrap().lines().count(), 1);
}

/// What a line quotes is a file's name and what is in it: neither moves a cursor, renames a window or reads backwards.
#[test]
fn what_an_error_quotes_steers_no_terminal() {
    let bench = Bench::new(&Config::thesis(), "");
    let name = format!("a\u{1b}[2J\r\u{202e}vsc\u{2066}{}.toml", "x".repeat(200));
    let odd = bench.path(&name);
    fs::write(&odd, "[\u{202e}x\u{1b}]0;title\u{7}]\n").unwrap();
    let gains = bench.path("com.toml");
    let text = fs::read_to_string(&gains).unwrap();
    fs::write(&gains, text.replace("gains.toml", "g\u{202e}\u{85}.toml")).unwrap();
    for arguments in [["check", odd.to_str().unwrap()], ["run", gains.to_str().unwrap()]] {
        let output = com(&arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), stderr.lines().count()), (Some(2), 1), "{stderr:?}");
        let line = stderr.trim_end_matches('\n');
        assert_eq!(line, format!("com: {}", plain_line::error_line(&line["com: ".len()..])), "{line:?}");
        assert!(line.contains('\u{fffd}'), "{line:?}");
    }
}

fn who(address: &str, more: &[&str]) -> Output {
    com(&[&["who", address, "--wait", "1"], more].concat())
}

/// A link with a key: only who has it is heard, and nothing is heard twice, not even by the
/// program's next run. Who plays recordings gets no answer.
#[test]
fn a_key_keeps_strangers_and_echoes_out() {
    let bench = Bench::new(&patient_law(), "");
    let text = fs::read_to_string(bench.path("com.toml")).unwrap();
    fs::write(bench.path("com.toml"), text.replace("[imu]", "key = 'key'\nnumber = 5\n[imu]")).unwrap();
    let key_bytes = [0x5a; 32];
    for (name, text) in [("key", "5a".repeat(32)), ("other", "a5".repeat(32))] {
        fs::write(bench.path(name), text).unwrap();
        fs::set_permissions(bench.path(name), fs::Permissions::from_mode(0o600)).unwrap();
    }
    let mut program = Program::start(Path::new(PROGRAM), &bench, |_| {});
    let address = program.address();
    let mut held = Held::new(Ground::keyed(address, key_bytes));
    held.until(&bench, IDLE, "heard", |held| held.ground.telemetry.is_some());
    held.ground.request(proto::Request::Disarm);

    // An echo: the very bytes that were heard before, from elsewhere.
    let replayer = UdpSocket::bind("127.0.0.1:0").unwrap();
    replayer.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    let replay = |address, said: &[Vec<u8>]| {
        let mut answered = 0;
        for packet in said {
            replayer.send_to(packet, address).unwrap();
        }
        while let Ok(length) = replayer.recv(&mut [0; MAX_PACKET_LEN]) {
            answered += length;
        }
        // Hellos are answered by a challenge of their length each, and nothing else is.
        answered <= said.iter().filter(|packet| packet[1] & 4 != 0).map(Vec::len).sum()
    };
    let refused =
        |held: &Held| held.ground.telemetry.map_or(0, |telemetry| telemetry.counters.packets_refused);
    let before = refused(&held);
    assert!(replay(address, &held.ground.said));
    held.until(&bench, IDLE, "refused", |held| refused(held) > before);
    // A stranger without a key, and one with another.
    let before = refused(&held);
    Ground::new(address).request(proto::Request::Arm);
    let key = |name: &str| bench.path(name).to_str().unwrap().to_owned();
    let asked = |name: &str| who(&address.to_string(), &["--number", "5", "--key", &key(name)]);
    assert_eq!(asked("other").status.code(), Some(1), "nobody answers");
    assert_eq!(who(&address.to_string(), &["--number", "5"]).status.code(), Some(1), "nobody answers");
    held.until(&bench, IDLE, "refused", |held| refused(held) > before + 2);
    assert_eq!(held.ground.state(), State::Disarmed);
    for again in 0..3 {
        assert_eq!(json(&asked("key"))["state"], "disarmed", "{again}");
    }

    signal("TERM", program.child.id());
    assert_eq!(program.ended(), Some(0));
    let mut program = Program::start(Path::new(PROGRAM), &bench, |_| {});
    let address = program.address();
    assert!(replay(address, &held.ground.said), "what the run before heard says nothing to this one");
    // Of another session, or too old: whichever is seen first.
    program.wait_for(&format!("from {}: a packet ", replayer.local_addr().unwrap()));
}

/// Without a key, whoever forges an address sends nobody more than was sent to the craft; and
/// telemetry ends when its reader does.
#[test]
fn an_open_link_sends_nothing_to_who_did_not_ask() {
    let bench = Bench::new(&patient_law(), "");
    let mut program = Program::start(Path::new(PROGRAM), &bench, |_| {});
    let address = program.address();
    let mut held = Held::new(Ground::new(address));
    held.until(&bench, IDLE, "heard", |held| held.ground.telemetry.is_some());
    // A victim's address sends what somebody else said, and hellos of its own that it never follows.
    let victim = UdpSocket::bind("127.0.0.1:0").unwrap();
    victim.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let (mut sent, mut came) = (0, 0);
    for packet in &held.ground.said {
        sent += victim.send_to(packet, address).unwrap();
    }
    while let Ok(length) = victim.recv(&mut [0; MAX_PACKET_LEN]) {
        came += length;
    }
    assert!(came <= sent, "{came} bytes for {sent}");
    // The reader falls silent: in a while nothing comes any more.
    std::thread::sleep(Duration::from_millis(u64::from(proto::LISTENING_MS) + 500));
    while held.ground.hear(Duration::from_millis(1)).is_some() {}
    assert_eq!(held.ground.hear(Duration::from_millis(500)), None, "telemetry for nobody");
}

#[test]
fn jitter_is_measured() {
    let said = String::from_utf8(com(&["measure-jitter", "0.2", "--busy", "1"]).stdout).unwrap();
    assert!(said.starts_with("20 beats: late by "), "{said}");
}
