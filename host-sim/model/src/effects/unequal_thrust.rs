//! The rotors do not give the same thrust at the same speed: another propeller, a bent blade, the wake of the body. The mean of the four is
//! the thrust coefficient's; what is left are three differences.
//!
//! In roll and pitch each rotor has a coefficient of its own (2.7), which takes it in; in the lift (2.6) all have one.

use crate::axis::Axis;
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::effects::adjusting::Adjusting;
use crate::sample::AtRotor;

const fn coefficient(name: &'static str) -> Coefficient {
    Coefficient::new(name, "1", (-0.5, 0.5), 0.03)
}

/// By how much rotors 1 to 4 differ from their mean for each coefficient.
pub const THRUST_DIFFERENCES: [[f64; 4]; 3] = [[1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0]];

pub(super) const INFO: EffectInfo = EffectInfo {
    id: "unequal-thrust",
    sentence: "The rotors give different thrusts at the same speed.",
    equation: r"T_i \to T_i (1 \pm \lambda_{left} \pm \lambda_{front} \pm \lambda_{diagonal})",
    source: None,
    kind: Kind::Adjusting,
    question: Question::Structure,
    axes: &[Axis::W],
    through: &["thrust"],
    coefficients: &[coefficient("left"), coefficient("front"), coefficient("diagonal")],
    excitation: "excite each motor by itself (quadlab excite writes such a flight)",
    confused_with: &[],
    special: Special { is_slow: true, ..Special::NOTHING },
};

/// Thrust of rotors 1 to 4 over their mean, by the coefficients of the effect.
pub fn thrust_shares(c: &[f64]) -> [f64; 4] {
    std::array::from_fn(|rotor| 1.0 + (0..3).map(|k| THRUST_DIFFERENCES[k][rotor] * c[k]).sum::<f64>())
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Adjustment {
    /// Beyond the mean of the four.
    more: [f64; 4],
}

impl Adjustment {
    #[inline(always)]
    pub(super) fn new(c: &[f64], _: f64) -> Self {
        Self { more: thrust_shares(c).map(|share| share - 1.0) }
    }
}

impl Adjusting for Adjustment {
    #[inline(always)]
    fn changes_thrust(&self) -> bool {
        self.more != [0.0; 4]
    }

    #[inline(always)]
    fn thrust_factor(&self, at: &AtRotor) -> f64 {
        1.0 + self.more[at.rotor]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_leave_the_mean_as_it_is_and_tell_left_from_front() {
        // A weak motor 4: behind, on the left.
        let weak = thrust_shares(&[-0.02, 0.02, 0.02]);
        for (share, expected) in weak.into_iter().zip([1.02, 1.02, 1.02, 0.94]) {
            assert!((share - expected).abs() < 1e-12, "{weak:?}");
        }
        for c in [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.03, -0.2, 0.15]] {
            assert!((thrust_shares(&c).iter().sum::<f64>() - 4.0).abs() < 1e-12);
        }
        assert_eq!(thrust_shares(&[0.1, 0.0, 0.0]), [1.1, 0.9, 0.9, 1.1], "rotors 1 and 4 are on the left");
    }
}
