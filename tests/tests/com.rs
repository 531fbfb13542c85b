//! The craft's program against the simulated craft, in real time: UDP, a serial line, and the files of the kernel's PWM
//! interface between them, as in the air.
#![forbid(unsafe_code)]

#[path = "../../firmware/com/tests/whole/common/mod.rs"]
mod common;

use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use common::{Bench, Ground, IDLE, PATIENCE, Program, patient_law};
use model::{Battery, Model, Plant};
use nalgebra::Vector3;
use proto::{Mode, Pose, Request, State};
use sil::{Craft, NoiseModel, Sensors};

const PERIOD_S: f64 = 0.01;

/// The program as this workspace builds it.
fn program() -> PathBuf {
    let mut path = std::env::current_exe().unwrap();
    path.pop();
    if path.ends_with("deps") {
        path.pop();
    }
    let path = path.join("com");
    if !path.exists() {
        let built = Command::new(env!("CARGO")).args(["build", "-p", "com", "--bin", "com"]).status();
        assert!(built.unwrap().success() && path.exists(), "{} is not there", path.display());
    }
    path
}

/// The craft in somebody's hand, and then in the air.
struct World {
    bench: Bench,
    ground: Ground,
    craft: Craft,
    ticks: u16,
}

impl World {
    /// One tick of the craft's program: the pulses that it gives move the plant, the plant's sensors answer.
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

/// Arm, climb, fly half a metre to the side, cut: what the program makes of it through all its ports moves the identified
/// plant where it should go.
#[test]
fn the_program_flies_the_plant_through_its_ports() {
    let model = Model::thesis();
    let bench = Bench::new(&patient_law(), "[guardian]\nsilence_s = 2.0\n");
    let mut program = Program::start(&program(), &bench, |_| {});
    let ground = Ground::new(program.address());
    let sensors = Sensors::new(&model, Some(NoiseModel::default()), PERIOD_S, 7);
    // Rotors at rest; a hand's breadth under where it is asked to be.
    let state = model::State::at_rest(Vector3::new(0.0, 0.0, -0.8), [0.0; 4]);
    let craft = Craft::new(Plant::new(&model), Battery::constant(11.1), sensors, state, PERIOD_S, 4);
    let mut world = World { bench, ground, craft, ticks: 0 };

    let idle = proto::Command { z_m: -0.8, ..IDLE };
    world.until(idle, "ready", |world| {
        world.ground.telemetry.is_some_and(|telemetry| telemetry.supervision.preflight == 0b11_1111_1111)
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
    // 1 s of rate-limited way and 4 s to settle: the thesis' loop is within 15 % of a step then (5.5, reference).
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
