//! Do the tracked attitude and the accelerometer agree where down is?
//!
//! ```text
//! R (p'' - g) - f = g (dtheta, -dphi, 0)
//! ```
//!
//! in the mean over a flight, for an attitude that is too large by dphi in roll and by dtheta in pitch. An accelerometer that is mounted at an
//! angle or has an offset looks the same. Where forces are fitted to the accelerometer, no effect of the model says so: gravity is in none
//! of its rows. What is predicted from such an attitude drifts off all the same, half a metre in a second where it leans by six degrees.

use nalgebra::Vector2;
use report::number::{fixed, with_error};

use crate::checks::accelerometer::Comparison;
use crate::checks::linear_sensor::SIGNIFICANT;
use crate::statistics::{deviation, mean};

/// Lean beyond what the offset of an accelerometer passes for, degrees: 0.5 m/s^2, or 50 mg, as of the less good ones.
const MATTERS_DEG: f64 = 3.0;
/// Rows that are one for the error of the mean: a second and a half, in which what moves the craft is forgotten.
const ROWS_TOGETHER: usize = 50;

/// How far they lean against each other, in a sentence if they do.
pub(super) fn check(Comparison { rows, gravity_m_s2, .. }: &Comparison) -> Vec<String> {
    let [x, y] = [0, 1].map(|axis| {
        let differences = rows.tracked[axis].iter().zip(&rows.sensed[axis]).map(|(t, s)| t - s);
        mean_and_error(&differences.collect::<Vec<_>>())
    });
    let leans = x.zip(y).and_then(|((x, x_error), (y, y_error))| {
        let [roll, pitch] = [-y, x].map(|force| (force / gravity_m_s2).to_degrees());
        sentence(Vector2::new(roll, pitch), (x_error.hypot(y_error) / gravity_m_s2).to_degrees())
    });
    leans.into_iter().collect()
}

/// Of values of which neighbours go together; nothing of too few.
fn mean_and_error(values: &[f64]) -> Option<(f64, f64)> {
    let blocks: Vec<f64> = values.chunks_exact(ROWS_TOGETHER).map(mean).collect();
    (blocks.len() > 2).then(|| (mean(&blocks), deviation(&blocks) / (blocks.len() as f64).sqrt()))
}

/// What is said of an attitude that is off by so much in roll and in pitch.
fn sentence(roll_pitch_deg: Vector2<f64>, error_deg: f64) -> Option<String> {
    let lean_deg = roll_pitch_deg.norm();
    (lean_deg > MATTERS_DEG.max(SIGNIFICANT * error_deg)).then(|| {
        format!(
            "the tracked attitude leans against the accelerometer by {} (roll {}, pitch {} deg): the attitude is off, or the accelerometer \
             is mounted at an angle or not calibrated; a craft that stands level shows which of the two reads wrong",
            with_error(lean_deg, error_deg, "deg"),
            fixed(roll_pitch_deg.x, 1),
            fixed(roll_pitch_deg.y, 1)
        )
    })
}

#[cfg(test)]
mod tests {
    use flights::Column;
    use model::Vehicle;
    use nalgebra::Vector3;

    use super::*;
    use crate::prepare::Prepared;
    use crate::testing::waving_with_imu;

    /// What is said of a waving flight of 40 s whose tracked attitude is off by so much, and its accelerometer by an offset.
    fn said([roll, pitch]: [f64; 2], offset_m_s2: Vector3<f64>) -> Vec<String> {
        let mut flight = waving_with_imu(4000, |force, _| force + offset_m_s2);
        for (column, deg) in [(Column::Phi, roll), (Column::Theta, pitch)] {
            let off = flight.required(column).iter().map(|angle| angle + deg.to_radians()).collect();
            flight.replace(column, off);
        }
        check(&Comparison::of(&Prepared::new(&flight, &Vehicle::thesis()).unwrap(), 9.81).unwrap())
    }

    #[test]
    fn an_attitude_that_is_off_is_told_with_its_size_and_the_offset_of_an_accelerometer_is_not() {
        let of_sensor = Vector3::new(0.2, -0.2, 0.4);
        assert_eq!(said([0.0, 0.0], of_sensor), [""; 0]);
        assert_eq!(said([1.5, 1.0], Vector3::zeros()), [""; 0]);
        let leaning = said([3.4, -3.4], Vector3::zeros());
        let [sentence] = &leaning[..] else { panic!("{leaning:?}") };
        let degrees = |after: &str| -> f64 {
            let (_, rest) = sentence.split_once(after).unwrap();
            rest.split([' ', ',']).next().unwrap().parse().unwrap()
        };
        assert!((degrees("accelerometer by ") - 4.8).abs() < 0.2, "{sentence}");
        assert!((degrees("(roll ") - 3.4).abs() < 0.2, "{sentence}");
        assert!((degrees(", pitch ") + 3.4).abs() < 0.2, "{sentence}");
    }

    #[test]
    fn a_lean_has_to_stand_out_from_its_error_and_needs_some_seconds() {
        assert!(sentence(Vector2::new(3.0, 1.0), 0.1).is_some());
        assert!(sentence(Vector2::new(3.0, 1.0), 1.0).is_none());
        assert_eq!(mean_and_error(&vec![1.0; 2 * ROWS_TOGETHER]), None);
        assert_eq!(mean_and_error(&vec![1.0; 3 * ROWS_TOGETHER]), Some((1.0, 0.0)));
    }
}
