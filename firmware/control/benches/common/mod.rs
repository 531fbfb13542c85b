//! The flight that the tick's benches share: a craft wobbling slightly about hover, whose inputs differ from tick to
//! tick, with no motor at an end of its range.

use std::hint::black_box;

use control::{Command, Config, Controller, Measurement, Mode, Tick};

/// A controller of the thesis' configuration and what it is fed.
pub(crate) struct Flight {
    controller: Controller,
    measurements: Vec<Measurement>,
    command: Command,
    next: usize,
}

impl Flight {
    /// The flight in a mode, before its first tick.
    pub(crate) fn new(mode: Mode) -> Self {
        Self {
            controller: Controller::new(&Config::thesis()).expect("the thesis' configuration is valid"),
            measurements: (0..100).map(measurement).collect(),
            command: Command { mode, z_m: -1.0, ..Command::default() },
            next: 0,
        }
    }

    /// The next tick.
    #[inline]
    pub(crate) fn tick(&mut self) -> Tick {
        let measurement = &self.measurements[self.next];
        self.next = (self.next + 1) % self.measurements.len();
        self.controller.tick(black_box(measurement), black_box(&self.command))
    }
}

/// Sample `k` at 100 Hz; the wobble repeats after a second.
fn measurement(k: u8) -> Measurement {
    let a = (f64::from(k) * 0.0628) as f32;
    Measurement {
        position_m: [0.02 * libm::sinf(a), 0.02 * libm::cosf(a), -1.0 + 0.01 * libm::sinf(2.0 * a)],
        attitude_rad: [0.01 * libm::cosf(a), 0.01 * libm::sinf(a), 0.05 * libm::sinf(a)],
        gyro_rad_s: None,
        battery_v: 11.1,
    }
}
