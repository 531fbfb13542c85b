//! Desaturation: what the axes get where the rotors cannot give all that they ask for.
//!
//! Roll and pitch come before thrust, thrust before yaw. Roll and pitch together get the largest
//! fraction of their demand that some thrust allows; then the thrust is the nearest to the one
//! asked for; then yaw gets the largest fraction that still fits. A craft that clips its motors one
//! by one tips over when one of them is at its end; this one sinks.
//!
//! The thesis does none of this; a configuration asks for it with [`Saturation::AttitudeFirst`].
//! All demands are divided by the rotor's answer to 1 of thrust, so that they and the headroom are
//! in units of thrust. For rotors that all lift.
//!
//! [`Saturation::AttitudeFirst`]: crate::config::gains::Saturation::AttitudeFirst

use crate::allocation::mixer::{Directions, Mixer, Refused};

/// What [`Mixer::desaturate`] makes of demands that cannot all be met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Desaturated {
    /// A squared rotor speed (or a command) for each rotor, within its range.
    pub mixed: [f32; 4],
    /// What could not be met.
    pub refused: Refused,
    /// Whether roll and pitch take nearly all there is, so that little is left to hold the craft
    /// with.
    pub nearly_saturated: bool,
}

/// Fraction of the greatest roll and pitch at any thrust beyond which the craft counts as nearly
/// saturated.
const NEARLY_SATURATED: f32 = 0.8;

/// What one rotor can give and what it is asked for, each divided by its answer to 1 of thrust.
#[derive(Clone, Copy)]
struct Headroom {
    low: f32,
    high: f32,
    /// By roll and pitch together.
    tilt_demand: f32,
    yaw_demand: f32,
}

impl Headroom {
    /// Least and greatest thrust beside a fraction of the tilt demand.
    fn thrust_range(&self, tilt_fraction: f32) -> (f32, f32) {
        (self.low - tilt_fraction * self.tilt_demand, self.high - tilt_fraction * self.tilt_demand)
    }
}

/// `fraction`, or the smaller one, at least 0, at which the demand fits into the margin.
fn fitting(fraction: f32, demand: f32, margin: f32) -> f32 {
    if fraction * demand <= margin {
        fraction
    } else if margin > 0.0 {
        margin / demand
    } else {
        0.0
    }
}

fn at_most_whole(fraction: f32) -> f32 {
    if fraction < 1.0 { fraction } else { 1.0 }
}

/// In which direction an axis was refused, if it was.
fn refused_direction(demand: f32, met: bool) -> Directions {
    Directions::new(!met && demand > 0.0, !met && demand < 0.0)
}

impl Mixer {
    /// The least answer of a rotor to 1 of thrust: positive if every one lifts, as
    /// [`Mixer::desaturate`] needs it.
    pub(crate) fn least_thrust(&self) -> f64 {
        self.rows.iter().map(|row| f64::from(row.thrust)).fold(f64::INFINITY, f64::min)
    }

    /// As [`Mixer::mix`] with every result from `low` to `high`, and what that refuses. Each
    /// fraction is the largest there is, so nothing is lost to a rotor that has headroom.
    #[cold]
    pub fn desaturate(
        &self,
        thrust: f32,
        [roll, pitch, yaw]: [f32; 3],
        low: [f32; 4],
        high: [f32; 4],
    ) -> Desaturated {
        let mut rotors = [Headroom { low: 0.0, high: 0.0, tilt_demand: 0.0, yaw_demand: 0.0 }; 4];
        for (((rotor, row), low), high) in rotors.iter_mut().zip(&self.rows).zip(low).zip(high) {
            let per_thrust = 1.0 / row.thrust;
            *rotor = Headroom {
                low: per_thrust * low,
                high: per_thrust * high,
                tilt_demand: per_thrust * (row.roll * roll + row.pitch * pitch),
                yaw_demand: per_thrust * row.yaw * yaw,
            };
        }
        // The thrust moves all rotors alike: what counts is how far two of them are asked apart,
        // from one's end to the other's.
        let mut tilt_headroom = 1.0 / NEARLY_SATURATED;
        for up in &rotors {
            for down in &rotors {
                tilt_headroom = fitting(tilt_headroom, up.tilt_demand - down.tilt_demand, up.high - down.low);
            }
        }
        let tilt_fraction = at_most_whole(tilt_headroom);
        let given = nearest_thrust(thrust, &rotors, tilt_fraction);
        let mut yaw_fraction = 1.0;
        for rotor in &rotors {
            let (low, high) = rotor.thrust_range(tilt_fraction);
            yaw_fraction = fitting(yaw_fraction, rotor.yaw_demand, high - given);
            yaw_fraction = fitting(yaw_fraction, -rotor.yaw_demand, given - low);
        }
        let refused = Refused {
            thrust: Directions::new(given < thrust, given > thrust),
            roll: refused_direction(roll, tilt_fraction >= 1.0),
            pitch: refused_direction(pitch, tilt_fraction >= 1.0),
            yaw: refused_direction(yaw, yaw_fraction >= 1.0),
        };
        let mixed = self.mix(given, [tilt_fraction * roll, tilt_fraction * pitch, yaw_fraction * yaw]);
        Desaturated { mixed, refused, nearly_saturated: tilt_headroom < 1.0 / NEARLY_SATURATED }
    }
}

/// The thrust nearest to the one asked for that every rotor can give beside a fraction of the tilt
/// demand.
fn nearest_thrust(thrust: f32, rotors: &[Headroom; 4], tilt_fraction: f32) -> f32 {
    let (mut least, mut most) = (f32::NEG_INFINITY, f32::INFINITY);
    for rotor in rotors {
        let (low, high) = rotor.thrust_range(tilt_fraction);
        least = if low > least { low } else { least };
        most = if high < most { high } else { most };
    }
    let below = if thrust > most { most } else { thrust };
    if below < least { least } else { below }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocation::mixer::inverse;
    use crate::config::gains::Mixing;
    use crate::config::thesis::THESIS_INVERSE_MIXING;
    use proptest::prelude::*;

    /// Unit ranges and the sign matrix, worked out by hand.
    #[test]
    fn attitude_comes_before_thrust_and_thrust_before_yaw() {
        let mixer = Mixer::signs();
        let desaturate = |thrust, torque| {
            let Desaturated { mixed, refused, nearly_saturated } =
                mixer.desaturate(thrust, torque, [0.0; 4], [1.0; 4]);
            // With unit ranges two rotors can be asked 1 apart: roll, or roll and pitch together,
            // by 0.5.
            let [roll, pitch, _]: [f32; 3] = torque;
            assert_eq!(nearly_saturated, 2.0 * (roll.abs() + pitch.abs()) > 0.8);
            (mixed, refused)
        };
        let (high, low) = (Directions::HIGH, Directions::LOW);
        // Everything fits.
        assert_eq!(
            desaturate(0.5, [0.25, 0.125, 0.0]),
            (mixer.mix(0.5, [0.25, 0.125, 0.0]), Refused::default())
        );
        // And so it does with seven eighths of the roll that there is: no refusal, but a warning.
        assert_eq!(desaturate(0.5, [0.4375, 0.0, 0.0]).1, Refused::default());
        // Roll wants 0.25 above the thrust: the thrust gives way.
        let (mixed, refused) = desaturate(0.9, [0.25, 0.0, 0.0]);
        assert_eq!((mixed, refused), ([1.0, 0.5, 0.5, 1.0], Refused { thrust: high, ..Refused::default() }));
        // And so from below.
        let (mixed, refused) = desaturate(0.125, [0.0, -0.25, 0.0]);
        assert_eq!((mixed, refused), ([0.0, 0.0, 0.5, 0.5], Refused { thrust: low, ..Refused::default() }));
        // Yaw gets what is left beside the thrust, in its own direction.
        let (mixed, refused) = desaturate(0.75, [0.125, 0.0, -0.5]);
        assert_eq!(mixed, [0.75, 0.75, 0.5, 1.0]);
        assert_eq!(refused, Refused { yaw: low, ..Refused::default() });
        // More roll and pitch than the rotors have at any thrust: halved together, thrust in the
        // middle, no yaw.
        let (mixed, refused) = desaturate(0.75, [0.5, 0.5, 0.125]);
        assert_eq!(mixed, [1.0, 0.5, 0.0, 0.5]);
        assert_eq!(refused, Refused { thrust: high, roll: high, pitch: high, yaw: high });
        // What an axis does not ask for is not refused.
        let (mixed, refused) = desaturate(0.5, [0.75, 0.0, 0.0]);
        assert_eq!((mixed, refused), ([1.0, 0.0, 0.0, 1.0], Refused { roll: high, ..Refused::default() }));
        let (mixed, refused) = desaturate(0.5, [0.0, -0.75, 0.0]);
        assert_eq!((mixed, refused), ([0.0, 0.0, 1.0, 1.0], Refused { pitch: low, ..Refused::default() }));
    }

    /// Rotors of 1, 3, -2 and 4 to one of thrust: one pushes down.
    #[test]
    fn the_least_thrust_is_that_of_the_weakest_rotor() {
        let mut inverse = THESIS_INVERSE_MIXING;
        inverse.iter_mut().zip([1.0, 3.0, -2.0, 4.0]).for_each(|(row, thrust)| row[0] = thrust);
        assert_eq!(Mixer::new(&Mixing::Inverse(inverse)).unwrap().least_thrust(), -2.0);
        inverse[2][0] = 2.5;
        assert_eq!(Mixer::new(&Mixing::Inverse(inverse)).unwrap().least_thrust(), 1.0);
    }

    proptest! {
        #![proptest_config(crate::cases::cases(5_000))]

        /// On the thesis' matrix, whatever is asked for: all rotors inside their range; what is
        /// refused is refused for a rotor at its end; roll and pitch keep their direction and are
        /// whole wherever some thrust allows it; yaw is not reversed.
        #[test]
        fn what_can_be_met_is_met(
            thrust in -10.0_f32..40.0, roll in -200.0_f32..200.0, pitch in -200.0_f32..200.0, yaw in -60.0_f32..60.0
        ) {
            let mixer = Mixer::new(&Mixing::Inverse(THESIS_INVERSE_MIXING)).unwrap();
            let forward = inverse(&THESIS_INVERSE_MIXING).unwrap();
            let (low, high) = ([9e4_f32; 4], [7.4e5_f32; 4]);
            let Desaturated { mixed, refused, .. } = mixer.desaturate(thrust, [roll, pitch, yaw], low, high);
            // f32 holds 7.4e5 to 0.03; sums of four such, and quotients.
            let slack = 1.0;
            prop_assert!(mixed.iter().all(|w2| *w2 > 9e4 - slack && *w2 < 7.4e5 + slack), "{mixed:?}");
            let given = forward.map(|row| row.iter().zip(mixed).map(|(k, w2)| k * f64::from(w2)).sum::<f64>());
            let [got_thrust, got_roll, got_pitch, got_yaw] = given;
            let [wanted_thrust, wanted_roll, wanted_pitch, wanted_yaw] = [thrust, roll, pitch, yaw].map(f64::from);
            // The forward matrix turns 1 of w^2 into 1e-4 rad/s^2 and 1e-5 N.
            let near = |a: f64, b: f64, tolerance: f64| (a - b).abs() < tolerance;
            if !refused.roll.high() && !refused.roll.low() {
                prop_assert!(near(got_roll, wanted_roll, 1e-3) && near(got_pitch, wanted_pitch, 1e-3));
            } else {
                let fraction = (got_roll * wanted_roll + got_pitch * wanted_pitch)
                    / (wanted_roll * wanted_roll + wanted_pitch * wanted_pitch);
                prop_assert!(fraction > -1e-3 && fraction < 1.0 + 1e-3, "{fraction}");
                prop_assert!(near(got_roll, fraction * wanted_roll, 1e-2) && near(got_pitch, fraction * wanted_pitch, 1e-2));
                // Before yaw moves them, one is at one end and one at the other: no thrust would
                // give more.
                let Desaturated { mixed: alone, .. } = mixer.desaturate(thrust, [roll, pitch, 0.0], low, high);
                let least = alone.into_iter().fold(f32::MAX, f32::min);
                let most = alone.into_iter().fold(0.0, f32::max);
                prop_assert!(least < 9e4 + slack && most > 7.4e5 - slack, "{alone:?}");
            }
            // Less given than asked for is refused, and what is refused is not given; within the
            // rounding it may be either.
            let missing = wanted_thrust - got_thrust;
            prop_assert!(missing < 1e-4 || refused.thrust.high(), "{missing}");
            prop_assert!(missing > -1e-4 || refused.thrust.low(), "{missing}");
            prop_assert!(missing > -1e-4 || !refused.thrust.high(), "{missing}");
            prop_assert!(missing < 1e-4 || !refused.thrust.low(), "{missing}");
            if !refused.yaw.high() && !refused.yaw.low() {
                prop_assert!(near(got_yaw, wanted_yaw, 1e-3));
            } else {
                let given = got_yaw * wanted_yaw.signum();
                prop_assert!(given > -1e-3 && given < wanted_yaw.abs() + 1e-3, "{given}");
                // More would take a rotor beyond its end.
                let at_end = |w2: &f32| *w2 < 9e4 + slack || *w2 > 7.4e5 - slack;
                prop_assert!(mixed.iter().any(at_end), "{mixed:?}");
            }
        }

        /// Any bits: nothing panics, and a result that is a number is inside the range or next to
        /// it.
        #[test]
        fn any_bits_can_be_desaturated(bits in any::<[u32; 4]>()) {
            let [thrust, roll, pitch, yaw] = bits.map(f32::from_bits);
            let mixer = Mixer::new(&Mixing::Inverse(THESIS_INVERSE_MIXING)).unwrap();
            let Desaturated { mixed, .. } = mixer.desaturate(thrust, [roll, pitch, yaw], [0.0; 4], [7.4e5; 4]);
            if [thrust, roll, pitch, yaw].iter().all(|x| x.abs() < 1e6) {
                prop_assert!(mixed.iter().all(|w2| *w2 > -1e2 && *w2 < 7.5e5), "{mixed:?}");
            }
        }
    }
}
