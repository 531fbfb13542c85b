//! How the rotors of a model differ, in words: what is unlike in all flights is in its coefficients, and nothing is missing from it.

use model::Verdict;
use sysid::RotorComparison;

/// What else a motor may be that seems weak in a rotation that is not explained.
const ODD_MOTOR: &str =
    "Because the rotation is still unexplained, a motor that seems weak may instead be slow or sticking.";

/// How the rotors differ, in sentences that each begin with a space; nothing where the rotation is not identified. `after_nothing`: where
/// nothing else was found, after which nobody reads on.
pub(crate) fn unlike_rotors(
    rotors: Option<&RotorComparison>,
    rotation: Verdict,
    after_nothing: bool,
) -> String {
    let Some(rotors) = rotors.filter(|_| rotation != Verdict::NotIdentified) else {
        return String::new();
    };
    let doubt = (rotors.differ && rotation == Verdict::Unexplained).then(|| ODD_MOTOR.to_string());
    let mut sentences: Vec<String> = rotors.sentences().into_iter().chain(doubt).collect();
    if let Some(first) = sentences.first_mut().filter(|_| after_nothing) {
        *first = format!("But {}{}", first[..1].to_lowercase(), &first[1..]);
    }
    sentences.into_iter().map(|sentence| format!(" {sentence}")).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use sysid::{AtSame, CenterOfMass, MotorThrust};

    /// Motor 2 weak by 6 %.
    pub(crate) fn weak() -> RotorComparison {
        let of = |motor, thrust_percent| MotorThrust { motor, thrust_percent, std_error_percent: 0.1 };
        let center_of_mass = CenterOfMass {
            forward_m: 0.0,
            forward_std_error_m: 1e-4,
            right_m: 0.0,
            right_std_error_m: 1e-4,
            off_center: false,
        };
        RotorComparison {
            at_same: AtSame::Speed,
            motors: [of(1, 1.5), of(2, -4.5), of(3, 1.5), of(4, 1.5)],
            differ: true,
            different_motor: Some(of(2, -6.0)),
            center_of_mass,
        }
    }

    #[test]
    fn a_weak_motor_is_told_unless_the_flights_do_not_determine_the_rotation() {
        let weak = weak();
        let told = |rotation, after_nothing| unlike_rotors(Some(&weak), rotation, after_nothing);
        let same = "the same speed, motor 2 gives 6.0 % less thrust than the mean of the other three (standard error of the fit 0.1 %).";
        assert_eq!(told(Verdict::Adequate, true), format!(" But at {same}"));
        assert_eq!(told(Verdict::Adequate, false), format!(" At {same}"));
        assert_eq!(told(Verdict::Unexplained, true), format!(" But at {same} {ODD_MOTOR}"));
        assert_eq!(told(Verdict::NotIdentified, true), "");
        assert_eq!(unlike_rotors(None, Verdict::Adequate, true), "");
    }
}
