//! Speed of the loop in process: ideal sensors, no delay, one Runge-Kutta step a tick.
//!
//! `cargo bench -p sil`; the items a second of the flight of 60,000 ticks are closed-loop steps a second.

use divan::{Bencher, black_box, counter::ItemsCount};
use model::{Model, Plant, State};
use nalgebra::Vector3;
use sil::{ClosedLoop, FlightPlan, Scenario, Settings, fly};

fn main() {
    divan::main();
}

/// The repeating pattern: outer and inner loops, four terms of aerodynamics, never at rest.
fn plan(duration_s: f64) -> FlightPlan {
    let settings = Settings { delay_samples: 0, substeps: 1, ..Settings::default() };
    FlightPlan { duration_s, ..Scenario::Pattern.plan(&settings) }
}

#[divan::bench]
fn plant_step(bencher: Bencher) {
    let plant = Plant::new(&Model::thesis());
    let substeps = plant.substeps(0.01, 1);
    let mut state = State::at_rest(Vector3::new(0.0, 0.0, -1.0), [635.0; 4]);
    bencher.bench_local(|| {
        plant.step(black_box(&mut state), black_box(&[634.0, 635.0, 636.0, 635.0]), 11.1, &substeps);
    });
}

#[divan::bench]
fn closed_loop_step(bencher: Bencher) {
    let plan = plan(60.0);
    let mut flight = ClosedLoop::in_process(&plan).expect("the thesis' plan can be flown");
    bencher.bench_local(|| black_box(flight.step()));
}

#[divan::bench(sample_count = 30)]
fn flight_of_60000_ticks(bencher: Bencher) {
    let plan = plan(600.0);
    bencher.counter(ItemsCount::new(60_000_u32)).bench_local(|| black_box(fly(&plan)));
}
