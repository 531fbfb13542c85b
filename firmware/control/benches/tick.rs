//! Speed of one control tick, in attitude and in position mode. Inputs differ from tick to tick, as in flight.

use control::{Command, Config, Controller, Measurement, Mode};
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

/// A second of slight wobbling about hover at 100 Hz; no motor reaches its end.
fn measurements() -> Vec<Measurement> {
    (0..100)
        .map(|k| {
            let a = (f64::from(k) * 0.0628) as f32;
            Measurement {
                position_m: [0.02 * libm::sinf(a), 0.02 * libm::cosf(a), -1.0 + 0.01 * libm::sinf(2.0 * a)],
                attitude_rad: [0.01 * libm::cosf(a), 0.01 * libm::sinf(a), 0.05 * libm::sinf(a)],
                gyro_rad_s: None,
                battery_v: 11.1,
            }
        })
        .collect()
}

#[divan::bench(sample_size = 1000, args = [Mode::Attitude, Mode::Position])]
fn tick(bencher: Bencher, mode: &Mode) {
    let measurements = measurements();
    let mut controller = Controller::new(&Config::thesis()).expect("the thesis' configuration is valid");
    let command = Command { mode: *mode, z_m: -1.0, ..Command::default() };
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % measurements.len();
        controller.tick(black_box(&measurements[k]), black_box(&command))
    });
}
