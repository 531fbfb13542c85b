//! One seed, several independent streams of random numbers.

use rand::SeedableRng;
use rand_pcg::Pcg64;

/// What the numbers are for. Each purpose has its own stream, so that more noise does not change
/// the way-points.
#[derive(Debug, Clone, Copy)]
pub enum Purpose {
    /// Noise of the sensors.
    Noise = 1,
    /// Excitation of the motors.
    Excitation = 2,
    /// Way-points of a tour.
    Waypoints = 3,
    /// Craft, air, battery and faults of a flight that is drawn.
    Conditions = 4,
    /// Gusts.
    Gusts = 5,
}

/// The stream of `seed` for one purpose. PCG 64 gives the same numbers on every machine.
pub fn stream(seed: u64, purpose: Purpose) -> Pcg64 {
    // Seeding from one u64 is mixed by the generator; the odd multiplier keeps neighbouring seeds'
    // streams apart.
    Pcg64::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(purpose as u64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn purposes_and_seeds_have_streams_of_their_own() {
        let first = |seed, purpose| stream(seed, purpose).random_range(0..u64::MAX);
        let all = [
            first(1, Purpose::Noise),
            first(1, Purpose::Excitation),
            first(1, Purpose::Waypoints),
            first(1, Purpose::Conditions),
            first(2, Purpose::Noise),
        ];
        for (k, number) in all.iter().enumerate() {
            assert!(!all[..k].contains(number), "{all:?}");
        }
        assert_eq!(first(1, Purpose::Noise), all[0]);
    }
}
