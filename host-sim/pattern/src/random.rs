//! One seed, several independent streams of random numbers.

use rand::SeedableRng;
use rand_pcg::Pcg64;

/// What the numbers are for. Each purpose has its own stream, so that more noise does not change the way-points.
#[derive(Debug, Clone, Copy)]
pub enum Purpose {
    /// Of the sensors.
    Noise = 1,
    /// Of the motors.
    Excitation = 2,
    /// Of a tour.
    Waypoints = 3,
}

/// The stream of `seed` for one purpose. PCG 64 gives the same numbers on every machine.
pub fn stream(seed: u64, purpose: Purpose) -> Pcg64 {
    // Seeding from one u64 is mixed by the generator; the odd multiplier keeps neighbouring seeds' streams apart.
    Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(purpose as u64))
}
