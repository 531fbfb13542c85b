//! The real program, real processes and real signals: whichever way it ends, the pulses are idle,
//! and the next start says why.
//!
//! How soon: at once when the loop dies (the kernel tells the guardian), after the guardian's
//! patience when it hangs, in the next tick when the guardian dies. [`SLACK`] is what a busy test
//! machine may add. With `QUADLAB_ALONE` set, as at night, nothing else runs: the guardian has its usual patience.

use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::{Bench, Ground, Held, PATIENCE, Program, is_alone, patient_law, signal};
use proto::{Ending, Message, Request, State};

const PROGRAM: &str = env!("CARGO_BIN_EXE_com");

/// The stated time is 100 ms from the death of either process to idle outputs; it takes some ms.
const SLACK: Duration = Duration::from_millis(100);
/// From a hang to idle outputs, stated.
const HANG: Duration = Duration::from_millis(100);
/// Of the guardian, where other programs run; long enough for a test machine that stands still for a moment.
const SILENCE: Duration = Duration::from_millis(500);

fn bench() -> Bench {
    let silence = if is_alone() { "" } else { "silence_s = 0.5\n" };
    Bench::new(
        &patient_law(),
        &format!("[guardian]\n{silence}last_end = 'last-end.toml'\nwatchdog = 'watchdog'\n"),
    )
}

/// A program whose craft has its motors up.
fn flying(bench: &Bench) -> (Program, Held) {
    fs::write(bench.path("watchdog"), "").unwrap();
    let mut program = Program::start(Path::new(PROGRAM), bench, |_| {});
    let mut held = Held::new(Ground::new(program.address()));
    held.take_off(bench);
    (program, held)
}

fn watchdog_was_stopped(bench: &Bench) -> bool {
    fs::read(bench.path("watchdog")).unwrap().ends_with(b"V")
}

/// Starts once more: what it says of the last end, in its log and to the ground; and the craft is disarmed.
fn next_start(bench: &Bench) -> (String, Ending) {
    let mut program = Program::start(Path::new(PROGRAM), bench, |_| {});
    let line = program.wait_for("the last run");
    let mut held = Held::new(Ground::new(program.address()));
    for _ in 0..20 {
        held.tick(bench, crate::common::IDLE);
    }
    assert_eq!(held.ground.state(), State::Disarmed);
    assert!(bench.is_idle());
    signal("TERM", program.child.id());
    assert_eq!(program.ended(), Some(0));
    (line, held.ground.last_end.expect("the ground is told"))
}

/// What systemd runs behind a program that died, whatever the pulses are.
#[test]
fn the_motors_can_be_idled_without_the_program() {
    let bench = bench();
    let duty = bench.path("pwm/pwmchip0/pwm2/duty_cycle");
    fs::write(&duty, "2000000\n").unwrap();
    let idle =
        || std::process::Command::new(PROGRAM).arg("idle").arg(bench.path("com.toml")).output().unwrap();
    let said = idle();
    assert!(said.status.success() && bench.is_idle(), "{said:?}");
    fs::remove_file(&duty).unwrap();
    assert_eq!(idle().status.code(), Some(2), "a channel that is not there");
}

#[test]
fn a_loop_that_is_killed_leaves_idle_motors() {
    let bench = bench();
    let (mut program, _held) = flying(&bench);
    let killed = Instant::now();
    signal("KILL", program.loop_pid());
    let took = bench.time_to_idle(killed);
    assert_eq!(program.ended(), Some(1));
    assert!(took < SLACK, "{took:?}");
    println!("idle {took:?} after kill -9 of the loop (kill itself takes some ms)");
    assert!(watchdog_was_stopped(&bench), "the outputs are idle: the board need not be reset");
    let (said, told) = next_start(&bench);
    assert!(said.contains("killed by signal 9"), "{said}");
    assert_eq!(told, Ending::LoopDied);
}

#[test]
fn a_loop_that_hangs_is_killed_and_leaves_idle_motors() {
    let bench = bench();
    let (mut program, _held) = flying(&bench);
    let stopped = Instant::now();
    signal("STOP", program.loop_pid());
    let took = bench.time_to_idle(stopped);
    assert_eq!(program.ended(), Some(1));
    println!("idle {took:?} after the loop hung");
    let (soonest, latest) = if is_alone() { (HANG / 2, HANG) } else { (SILENCE / 2, SILENCE + SLACK) };
    assert!(took < latest, "{took:?}");
    assert!(took > soonest, "{took:?}: the motors were idle for another reason");
    let (said, told) = next_start(&bench);
    assert!(said.contains("no sign of life"), "{said}");
    assert_eq!(told, Ending::LoopDied);
}

#[test]
fn a_loop_without_its_guardian_idles_the_motors() {
    let bench = bench();
    let (mut program, _held) = flying(&bench);
    let killed = Instant::now();
    let loop_pid = program.loop_pid();
    signal("KILL", program.child.id());
    let took = bench.time_to_idle(killed);
    assert!(took < SLACK, "{took:?}");
    program.ended();
    let started = Instant::now();
    while Path::new(&format!("/proc/{loop_pid}")).exists() {
        assert!(started.elapsed() < PATIENCE, "the loop goes on without its guardian");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(!watchdog_was_stopped(&bench), "nobody feeds the watchdog any more: it has to reset the board");
    let (said, told) = next_start(&bench);
    assert!(said.contains("the guardian was killed"), "{said}");
    assert_eq!(told, Ending::GuardianKilled);
}

#[test]
fn a_program_that_is_asked_to_stop_idles_the_motors_and_leaves() {
    let bench = bench();
    let (mut program, _held) = flying(&bench);
    signal("HUP", program.child.id());
    signal("HUP", program.loop_pid());
    std::thread::sleep(Duration::from_millis(50));
    assert!(!bench.is_idle(), "a terminal that is closed is no reason to fall");
    let asked = Instant::now();
    signal("INT", program.child.id());
    let took = bench.time_to_idle(asked);
    assert_eq!(program.ended(), Some(0));
    assert!(took < SLACK, "{took:?}");
    assert!(watchdog_was_stopped(&bench));
    let (said, told) = next_start(&bench);
    assert!(said.contains("SIGTERM or SIGINT"), "{said}");
    assert_eq!(told, Ending::Stopped);
}

#[test]
fn the_pilot_cuts_and_the_motors_idle() {
    let bench = bench();
    let (_program, mut held) = flying(&bench);
    let number = held.ground.request(Request::Cut).unwrap();
    let command = proto::Command { cut_off: false, ..crate::common::IDLE };
    held.until(&bench, command, "cut", |held| held.ground.state() == State::Cut);
    assert!(bench.is_idle());
    held.until(&bench, command, "answered", |held| {
        held.ground.answers.iter().any(|answer| answer.to == number && answer.done)
    });
}

/// Forged, damaged and foreign datagrams, ten times as many as genuine ones: the craft flies on and
/// counts them.
#[test]
fn junk_is_counted_and_does_no_harm() {
    let bench = bench();
    let (_program, mut held) = flying(&bench);
    let junk = vec![0x5a; 1400];
    let command = proto::Command { cut_off: false, ..crate::common::IDLE };
    for _ in 0..30 {
        for length in [0, 1, 11, 12, 40, 320, 352, 353, 1400, 1400] {
            held.ground.send_raw(&junk[..length]);
        }
        held.tick(&bench, command);
    }
    held.until(&bench, command, "counted", |held| {
        held.ground.telemetry.is_some_and(|telemetry| telemetry.counters.packets_refused >= 250)
    });
    assert_eq!(held.ground.state(), State::Flying);
    // A question from elsewhere is answered there, and the pilot keeps its telemetry.
    held.ground.say(&Message::Who);
    held.tick(&bench, command);
    assert_eq!(held.ground.state(), State::Flying);
}

#[test]
fn what_cannot_be_opened_ends_with_one_line_and_status_2() {
    let bench = bench();
    fs::write(bench.path("watchdog"), "").unwrap();
    let text = fs::read_to_string(bench.path("com.toml")).unwrap();
    let (before, after) = text.split_once("port = '").unwrap();
    let (_, after) = after.split_once('\'').unwrap();
    fs::write(bench.path("com.toml"), format!("{before}port = '/dev/no-such-port'{after}")).unwrap();
    let mut program = Program::start(Path::new(PROGRAM), &bench, |_| {});
    program.wait_for("/dev/no-such-port: cannot open the IMU's serial port");
    assert_eq!(program.ended(), Some(2));
    assert!(bench.is_idle(), "the outputs were opened before, idle");
}

/// systemd's side, as `man sd_notify` has it: a datagram socket named in the environment.
#[test]
fn systemd_hears_that_it_is_ready_and_that_it_lives() {
    let bench = bench();
    fs::write(bench.path("watchdog"), "").unwrap();
    let path = bench.path("notify");
    let systemd = UnixDatagram::bind(&path).unwrap();
    systemd.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut program = Program::start(Path::new(PROGRAM), &bench, |command| {
        command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "600000");
    });
    let told = |what: &str| {
        let mut buffer = [0; 256];
        loop {
            let length = systemd.recv(&mut buffer).unwrap();
            if String::from_utf8_lossy(&buffer[..length]).lines().any(|line| line == what) {
                return Instant::now();
            }
        }
    };
    told("READY=1");
    let first = told("WATCHDOG=1");
    let again = told("WATCHDOG=1").duration_since(first);
    assert!(again > Duration::from_millis(150), "{again:?}: a third of 600 ms");
    signal("TERM", program.child.id());
    told("STOPPING=1");
    assert_eq!(program.ended(), Some(0));
}
