//! Flight-seconds of many flights in a second of processor time: 1,000 of 20 s side by side, each of another craft, in a fresh process.
//!
//! Ideal sensors, no delay, one Runge-Kutta step a tick; the whole law and its supervisor, and each tick looked at. `cargo xtask bench`
//! runs it several times and takes the median; with `--against` it does so in turn with a reference of vector instructions.

mod common;

use cpu_time::ProcessTime;
use sil::FlightPlan;
use sil::endurance::{Deviations, Watched, fly_watched};

const FLIGHTS: u32 = 1000;
const FLIGHT_S: f64 = 20.0;
/// What is flown and forgotten at a time.
const TOGETHER: usize = 40;

fn main() {
    let plans: Vec<FlightPlan> = (0..FLIGHTS).map(plan).collect();
    let start = ProcessTime::now();
    let mut flight_s = 0.0;
    for some in plans.chunks(TOGETHER) {
        let seen = |_, flown: Watched| ((flown.recording.complete, flown.crash), flown.recording.rows);
        for flown in fly_watched(&some.iter().collect::<Vec<_>>(), seen) {
            let (complete, crash) = flown.expect("the thesis' plan can be flown");
            assert!(complete, "{crash:?}");
            flight_s += FLIGHT_S;
        }
    }
    let cpu_s = start.elapsed().as_secs_f64();
    println!(r#"{{"work":"flight-seconds of many flights","amount":{flight_s},"cpu_s":{cpu_s}}}"#);
}

/// The pattern of the other benches, with a craft of its own for each number.
fn plan(number: u32) -> FlightPlan {
    let mut plan = common::plan(FLIGHT_S);
    // Steps of the golden ratio leave no two craft alike.
    let spread =
        |k: u32, most: f64| most * (2.0 * (f64::from(7 * number + k) * 0.618_033_988_749_895).fract() - 1.0);
    let deviations = Deviations {
        extra_mass_kg: spread(0, 0.1),
        off_centre_m: [spread(1, 0.002), spread(2, 0.002)],
        slower_rotors_s: spread(3, 0.005),
        ..Deviations::default()
    };
    deviations.shift(&mut plan.model);
    for term in &mut plan.model.terms {
        if term.effect == model::Effect::LinearDrag {
            term.coefficients.iter_mut().for_each(|drag| drag.value *= 1.0 + spread(4, 0.1));
        }
    }
    plan
}
