//! The loop's thread allocates nothing: not with packets, not with junk, not when the state changes
//! or an output fails.

use std::time::Duration;

use crate::common::{Bench, Ground, Held};
use com::clock::Beat;
use com::config::Setup;
use com::flight::FlightLoop;
use com::pwm::Motors;
use control::State;
use proto::{Gains, Loop, Message, Request, Timer};

#[test]
fn a_tick_allocates_nothing() {
    let bench = Bench::new(&crate::common::patient_law(), "");
    let setup = Setup::read(&bench.path("com.toml")).unwrap();
    let motors = Motors::open(&setup.pwm_root, &setup.outputs, setup.pulses).unwrap();
    let (mut flight, events) = FlightLoop::open(&setup, motors).unwrap();
    let mut held = Held::new(Ground::new(flight.link().address()));
    let mut states = Vec::new();
    for number in 0..600_u32 {
        match number {
            300 => drop(held.ground.request(Request::Arm)),
            400 => {
                let roll = Gains { of: Loop::Roll, kp: 90.0, ki: 90.0, kd: 9.0 };
                held.ground.say(&Message::Gains(roll));
                held.ground.say(&Message::Timer(Timer { ground_us: 1 }));
                held.ground.say(&Message::Who);
            }
            500 => drop(held.ground.request(Request::Cut)),
            _ => held.ground.send_raw(&[7; 64]),
        }
        held.tick(&bench, proto::Command { cut_off: number < 350, ..crate::common::IDLE });
        // The line and its thread, the socket: some hundred us each.
        std::thread::sleep(Duration::from_micros(500));
        let beat = Beat { time_us: number * 10_000, late_us: 3, missed: 0 };
        let count = allocation_counter::measure(|| flight.tick(beat));
        assert_eq!(count.count_total, 0, "tick {number} in {:?}", flight.state());
        states.push(flight.state());
    }
    for state in [State::Disarmed, State::Armed, State::Flying, State::Cut] {
        assert!(states.contains(&state), "{state:?} was never flown through");
    }
    assert!(events.try_iter().count() >= 3, "states and refusals are told to the log");
}
