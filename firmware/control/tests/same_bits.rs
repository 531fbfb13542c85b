//! Same source, same bits: 2,000 ticks of pseudo-random inputs under both laws, and a hash of
//! everything they computed.
//!
//! The number below came out of x86-64 and of a Cortex-M4F (thumbv7em-none-eabihf, in QEMU) alike.
//! On one machine this test only notices that results changed; run on the other target it notices
//! that they differ. A change of the law that is meant changes the number: take the new one only
//! when both targets give it.

use control::{Command, Config, Controller, Measurement, Mode, Tick};

const HASH: u32 = 2_341_975_116;

/// FNV-1a, 32 bits.
struct Fnv(u32);

impl Fnv {
    fn add(&mut self, tick: &Tick) {
        let terms = &tick.terms;
        for value in
            tick.pwm.iter().chain(&terms.torque).chain(&terms.body_rates_rad_s).chain([&terms.thrust])
        {
            for byte in value.to_le_bytes() {
                self.0 = (self.0 ^ u32::from(byte)).wrapping_mul(16_777_619);
            }
        }
    }
}

/// Linear congruential numbers in [-0.5, 0.5); 24 bits, exact in f32.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / 16_777_216.0 - 0.5
    }

    fn measurement(&mut self) -> Measurement {
        Measurement {
            position_m: [self.next() * 0.1, self.next() * 0.1, -1.0 + self.next() * 0.05],
            attitude_rad: [self.next() * 0.3, self.next() * 0.3, self.next() * 6.5],
            gyro_rad_s: None,
            battery_v: 11.1 + self.next(),
        }
    }

    fn command(&mut self, tick: u32) -> Command {
        Command {
            mode: if tick % 200 < 100 { Mode::Position } else { Mode::Attitude },
            attitude_rad: [self.next() * 0.2, self.next() * 0.2],
            yaw_rad: self.next() * 6.0,
            z_m: -1.0 + self.next(),
            position_m: [self.next() * 3.0, self.next() * 2.0],
            cut_off: tick == 777,
            injection: [self.next() * 20.0, 0.0, 0.0, 0.0],
        }
    }
}

#[test]
fn two_thousand_ticks() {
    let (mut hash, mut noise) = (Fnv(2_166_136_261), Noise(12_345));
    for config in [Config::thesis(), Config::thesis_hand_tuned()] {
        let mut controller = Controller::new(&config).unwrap();
        for tick in 0..1000 {
            let measurement = noise.measurement();
            let command = noise.command(tick);
            hash.add(&controller.tick(&measurement, &command));
        }
    }
    assert_eq!(hash.0, HASH);
}
