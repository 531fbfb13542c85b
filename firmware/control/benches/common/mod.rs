//! The flight that the tick's benches share: a craft wobbling slightly about hover, whose inputs
//! differ from tick to tick, with no motor at an end of its range.

use std::hint::black_box;

use control::{Autopilot, Command, Config, Mode, Pose, Readings};

/// An autopilot of the thesis' configuration and what it is fed.
pub(crate) struct Flight {
    autopilot: Autopilot,
    readings: Vec<Readings>,
    next: usize,
    time_us: u32,
}

impl Flight {
    /// The flight in a mode, before its first tick.
    pub(crate) fn new(mode: Mode) -> Self {
        let command = Command { mode, z_m: -1.0, ..Command::default() };
        Self {
            autopilot: Autopilot::in_flight(&Config::thesis()).expect("the thesis' configuration is valid"),
            readings: (0..100).map(|k| readings(k, command)).collect(),
            next: 0,
            time_us: 0,
        }
    }

    /// The next tick; gives the motor commands.
    #[inline]
    pub(crate) fn tick(&mut self) -> [f32; 4] {
        let readings = &mut self.readings[self.next];
        readings.time_us = self.time_us;
        let flight = black_box(self.autopilot.tick(black_box(readings)));
        self.time_us = self.time_us.wrapping_add(10_000);
        self.next = (self.next + 1) % 100;
        flight.tick.pwm
    }
}

/// Sample `k` at 100 Hz; the wobble repeats after a second.
fn readings(k: u8, command: Command) -> Readings {
    let a = (f64::from(k) * 0.0628) as f32;
    let pose = Pose {
        position_m: [0.02 * libm::sinf(a), 0.02 * libm::cosf(a), -1.0 + 0.01 * libm::sinf(2.0 * a)],
        attitude_rad: [0.01 * libm::cosf(a), 0.01 * libm::sinf(a), 0.05 * libm::sinf(a)],
    };
    Readings {
        time_us: 0,
        pose: Some(pose),
        pose_age_us: 0,
        gyro_rad_s: Some([-0.01 * libm::sinf(a), 0.01 * libm::cosf(a), 0.05 * libm::cosf(a)]),
        battery_v: 11.1,
        command: Some(command),
        request: None,
        outputs_ready: true,
    }
}
