//! Ramps of time: microseconds modulo 2^32, 71.6 minutes.

/// Turns microseconds modulo 2^32 into ones that go on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwrapped {
    last: Option<(u32, i64)>,
}

impl Unwrapped {
    /// The next value; steps of up to 35 minutes either way are understood.
    pub fn push(&mut self, us: u32) -> i64 {
        let whole = match self.last {
            None => i64::from(us),
            Some((before, whole)) => whole + i64::from(us.wrapping_sub(before).cast_signed()),
        };
        self.last = Some((us, whole));
        whole
    }
}

/// From every residue of 2^32 with a boundary to every other one, and each of every 1,021st u32 (at
/// night, of all) as a step: against wide integers.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::residues::{FEW, TURN, residues, stride};

    /// The nearest time to `before` that shows `us`; the earlier one of two.
    fn nearest(before: i128, us: u32) -> i128 {
        let later = (i128::from(us) - before).rem_euclid(TURN);
        before + if later < TURN / 2 { later } else { later - TURN }
    }

    #[test]
    fn a_ramp_goes_on_to_the_nearest_time() {
        for first in residues() {
            for second in residues() {
                for third in FEW {
                    let mut ramp = Unwrapped::default();
                    let (one, two) = (ramp.push(first), ramp.push(second));
                    assert_eq!(one, i64::from(first));
                    assert_eq!(i128::from(two), nearest(one.into(), second), "{first} {second}");
                    assert_eq!(i128::from(ramp.push(third)), nearest(two.into(), third), "{second} {third}");
                }
            }
        }
    }

    #[test]
    fn any_step_is_understood() {
        for step in (0..=u32::MAX).step_by(stride(1021)) {
            let mut ramp = Unwrapped::default();
            ramp.push(u32::MAX - 5);
            let us = (u32::MAX - 5).wrapping_add(step);
            assert_eq!(i128::from(ramp.push(us)), nearest((u32::MAX - 5).into(), us), "{step}");
        }
    }
}
