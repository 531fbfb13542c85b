//! A tick's digest: every bit of it in one number, so that two targets can be compared over a slow
//! link.

use control::{Fault, Faults, Flight, OuterTerms, PidTerms, Refused, Terms, Tick};

/// FNV-1a, 64 bits, over everything in `flight`: motor commands, each internal term, refusals,
/// faults, state, conditions and preflight checks. Equal bits give equal numbers on every target;
/// numbers that differ in a sign of zero or in the payload of a NaN give others.
pub fn digest(flight: &Flight) -> u64 {
    let mut fnv = Fnv(0xcbf2_9ce4_8422_2325);
    // Taken apart without `..`: a field that is added later cannot be forgotten.
    let Flight { tick, state, conditions, preflight } = flight;
    let Tick { pwm, terms, refused, faults } = tick;
    fnv.floats(pwm);
    fnv.terms(terms);
    let Refused { thrust, roll, pitch, yaw } = refused;
    for directions in [thrust, roll, pitch, yaw] {
        fnv.bytes(&[u8::from(directions.high()), u8::from(directions.low())]);
    }
    let Faults { measurement, command, battery, internal } = faults;
    for Fault { now, count } in [measurement, command, battery, internal] {
        fnv.bytes(&[u8::from(*now)]);
        fnv.bytes(&count.to_le_bytes());
    }
    fnv.bytes(&[*state as u8]);
    fnv.bytes(&conditions.bits().to_le_bytes());
    fnv.bytes(&preflight.bits().to_le_bytes());
    fnv.0
}

/// Fowler-Noll-Vo, variant 1a, 64 bits.
struct Fnv(u64);

impl Fnv {
    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn floats(&mut self, values: &[f32]) {
        for value in values {
            self.bytes(&value.to_bits().to_le_bytes());
        }
    }

    /// Whether there is something, and what.
    fn present<T>(&mut self, value: Option<&T>, mut add: impl FnMut(&mut Self, &T)) {
        self.bytes(&[u8::from(value.is_some())]);
        if let Some(value) = value {
            add(self, value);
        }
    }

    fn pid(&mut self, terms: &PidTerms) {
        let PidTerms { p, i, d, output } = *terms;
        self.floats(&[p, i, d, output]);
    }

    fn outer(&mut self, terms: &OuterTerms) {
        let OuterTerms { reference_m, error_m, velocity_m_s, x, y } = terms;
        for pair in [reference_m, error_m, velocity_m_s] {
            self.floats(pair);
        }
        self.pid(x);
        self.pid(y);
    }

    fn terms(&mut self, terms: &Terms) {
        let Terms {
            position_m,
            attitude_rad,
            battery_v,
            euler_rates_rad_s,
            body_rates_rad_s,
            z_rate_m_s,
            outer,
            attitude_command_rad,
            z_command_m,
            attitude_reference_rad,
            z_reference_m,
            attitude_error_rad,
            z_error_m,
            roll,
            pitch,
            yaw,
            altitude,
            thrust,
            torque,
            rotor_speed_rad_s,
        } = terms;
        let triples = [
            position_m,
            attitude_rad,
            euler_rates_rad_s,
            body_rates_rad_s,
            attitude_command_rad,
            attitude_reference_rad,
            attitude_error_rad,
            torque,
        ];
        triples.into_iter().for_each(|triple| self.floats(triple));
        self.floats(&[*battery_v, *z_rate_m_s, *z_command_m, *z_reference_m, *z_error_m, *thrust]);
        [roll, pitch, yaw, altitude].into_iter().for_each(|terms| self.pid(terms));
        self.present(outer.as_ref(), Self::outer);
        self.present(rotor_speed_rad_s.as_ref(), |fnv, speeds| fnv.floats(speeds));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test vectors of the authors (FNV test suite: "", "a", "foobar").
    #[test]
    fn the_hash_is_fnv_1a() {
        for (text, hash) in
            [("", 0xcbf2_9ce4_8422_2325_u64), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut fnv = Fnv(0xcbf2_9ce4_8422_2325);
            fnv.bytes(text.as_bytes());
            assert_eq!(fnv.0, hash, "{text:?}");
        }
    }

    /// Every byte onto every hash with a boundary of 2^64, against a product that does not wrap.
    #[test]
    fn the_product_wraps_at_64_bits() {
        for hash in crate::residues::residues_u64() {
            for byte in 0..=u8::MAX {
                let mut fnv = Fnv(hash);
                fnv.bytes(&[byte]);
                let product = u128::from(hash ^ u64::from(byte)) * 0x0100_0000_01b3;
                assert_eq!(u128::from(fnv.0), product % (1 << 64));
            }
        }
    }

    /// One bit in a term that no motor shows yet.
    #[test]
    fn one_bit_anywhere_is_seen() {
        let flight = Flight::default();
        let changes: [fn(&mut Flight); 8] = [
            |f| f.tick.pwm[3] = -0.0,
            |f| f.tick.terms.yaw.i = f32::from_bits(1),
            |f| f.tick.terms.outer = Some(OuterTerms::default()),
            |f| f.tick.terms.rotor_speed_rad_s = Some([0.0; 4]),
            |f| f.tick.refused.yaw = control::Directions::LOW,
            |f| f.tick.faults.internal.count = 1,
            |f| f.state = control::State::Armed,
            |f| f.conditions = control::Conditions::from_bits(1),
        ];
        let mut seen = vec![digest(&flight)];
        for change in changes {
            let mut changed = flight;
            change(&mut changed);
            let hash = digest(&changed);
            assert!(!seen.contains(&hash), "{changed:?}");
            seen.push(hash);
        }
    }
}
