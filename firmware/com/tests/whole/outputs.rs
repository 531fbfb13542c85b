//! An output that takes no pulse any more, while the real program flies: it lands, and where the motors have to stand the channel is
//! switched off. A library loaded before the system's makes the kernel's interface refuse what it is told.

use std::fs;
use std::path::Path;

use control::{Condition, Conditions};
use proto::{Request, State};

use crate::common::{Bench, Ground, Held, IDLE, Program, compile, patient_law};

const OUTPUT: &str = "pwm/pwmchip0/pwm2";

#[test]
fn an_output_that_fails_in_flight_ends_in_a_landing_and_is_switched_off_with_the_motors() {
    let bench = Bench::new(&patient_law(), "");
    let (library, broken) = (bench.path("failing_output.so"), bench.path("broken"));
    compile(env!("CARGO_MANIFEST_DIR"), "tests/whole/failing_output.c", &library);
    let mut program = Program::start(Path::new(env!("CARGO_BIN_EXE_com")), &bench, |command| {
        command.env("LD_PRELOAD", &library).env("OUTPUT", OUTPUT).env("OUTPUT_FAILS", &broken);
    });
    let mut held = Held::new(Ground::new(program.address()));
    held.take_off(&bench);
    let climb = proto::Command { cut_off: false, ..IDLE };
    let switches = |bench: &Bench| {
        [0, 1, 2, 3].map(|channel| {
            let enable = bench.path(&format!("pwm/pwmchip0/pwm{channel}/enable"));
            fs::read_to_string(enable).unwrap().trim().to_owned()
        })
    };

    fs::write(&broken, "").unwrap();
    let before = bench.pulses_ns()[2];
    let first = held.ground.telemetry.unwrap().tick;
    held.until(&bench, climb, "landing", |held| held.ground.state() == State::Land);
    let telemetry = held.ground.telemetry.unwrap();
    let conditions = Conditions::from_bits(telemetry.supervision.conditions);
    assert!(conditions.has(Condition::OutputsFailed), "{conditions:?}");
    // 0.05 s of refusals, and the two ticks in which it is told and seen.
    assert!(telemetry.tick - first < 12, "{} ticks", telemetry.tick - first);
    assert_eq!((bench.pulses_ns()[2], switches(&bench)), (before, ["1"; 4].map(String::from)));
    program.wait_for("an output cannot be written");

    held.ground.request(Request::Cut);
    held.until(&bench, climb, "cut", |held| held.ground.state() == State::Cut);
    held.until(&bench, climb, "switched off", |_| switches(&bench)[2] == "0");
    assert_eq!(switches(&bench), ["1", "1", "0", "1"]);
    let idle = |pulse_ns: u32| pulse_ns.abs_diff(1_000_000) <= 20;
    assert_eq!(bench.pulses_ns().map(idle), [true, true, false, true]);

    fs::remove_file(&broken).unwrap();
    held.until(&bench, climb, "mended", |_| bench.is_idle() && switches(&bench) == ["1"; 4]);
    program.wait_for("the outputs can be written again");
}
