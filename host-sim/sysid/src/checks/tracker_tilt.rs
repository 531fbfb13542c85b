//! Is the tracker's frame level?
//!
//! In a frame that leans, gravity has a part along x and y, the same wherever the craft is and however it turns. The bias of an accelerometer, or a
//! tracked attitude that is turned against it, is the same in the body's axes instead. A craft that turns about its vertical axis tells them
//! apart; one that always heads the same way does not, and then the error of the lean is large and nothing is said.

use nalgebra::Vector2;
use report::number::{fixed, with_error};

use crate::checks::accelerometer::Comparison;
use crate::checks::linear_sensor::SIGNIFICANT;

/// Leans that matter, degrees: 0.09 m/s^2 to the side.
const MATTERS_DEG: f64 = 0.5;

/// How far the frame leans, in a sentence if it does.
pub(super) fn check(Comparison { rows, sideways, .. }: &Comparison) -> Vec<String> {
    let found = rows.with_further(sideways).sensor_either_way();
    let leans = found.and_then(|sensor| {
        let [(x, x_error), (y, y_error)] = sensor.further.last_chunk()?;
        let down = Vector2::new(*x, *y);
        sentence(down.map(f64::to_degrees), x_error.hypot(*y_error).to_degrees())
    });
    leans.into_iter().collect()
}

/// What is said of gravity that leans so far along x and y of the tracker's axes.
fn sentence(down_deg: Vector2<f64>, error_deg: f64) -> Option<String> {
    let lean_deg = down_deg.norm();
    (lean_deg > MATTERS_DEG.max(SIGNIFICANT * error_deg)).then(|| {
        format!(
            "the tracker's frame is not level: by the accelerometer, gravity is tilted {} from the tracker's z axis ({} deg towards +x, \
             {} deg towards +y); in a log without an accelerometer this passes for a steady wind; level the frame (recalibrate its ground plane)",
            with_error(lean_deg, error_deg, "deg"),
            fixed(down_deg.x, 2),
            fixed(down_deg.y, 2)
        )
    })
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};
    use model::Vehicle;
    use nalgebra::{Matrix3, Rotation3, Vector3};

    use super::*;
    use crate::prepare::Prepared;
    use crate::testing::waving_with_imu;

    /// A waving flight of 40 s as a tracker sees it whose frame is turned against the level one by `lean`, with an accelerometer that `told` describes.
    fn seen(lean: Rotation3<f64>, told: impl Fn(Vector3<f64>, Matrix3<f64>) -> Vector3<f64>) -> Flight {
        let mut flight = waving_with_imu(4000, told);
        let rows = flight.required(Column::T).len();
        let of = |columns: [Column; 3], row: usize| {
            Vector3::from(columns.map(|column| flight.required(column)[row]))
        };
        let (position, angles) =
            ([Column::X, Column::Y, Column::Z], [Column::Phi, Column::Theta, Column::Psi]);
        let mut told: [Vec<f64>; 6] = Default::default();
        for row in 0..rows {
            let moved = lean * of(position, row);
            let [phi, theta, psi] = of(angles, row).into();
            let (phi, theta, psi) = (lean * Rotation3::from_euler_angles(phi, theta, psi)).euler_angles();
            let values = moved.iter().copied().chain([phi, theta, psi]);
            told.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        }
        for (column, values) in position.into_iter().chain(angles).zip(told) {
            flight.replace(column, values);
        }
        flight
    }

    fn said(flight: &Flight) -> Vec<String> {
        check(&Comparison::of(&Prepared::new(flight, &Vehicle::thesis()).unwrap(), 9.81).unwrap())
    }

    #[test]
    fn a_frame_that_leans_is_told_from_an_accelerometer_that_is_off() {
        let biased = |force: Vector3<f64>, _: Matrix3<f64>| force + Vector3::new(0.2, -0.3, 0.4);
        let turned =
            |force: Vector3<f64>, _: Matrix3<f64>| Rotation3::from_euler_angles(0.03, -0.02, 0.04) * force;
        assert_eq!(said(&seen(Rotation3::identity(), biased)), [""; 0]);
        assert_eq!(said(&seen(Rotation3::identity(), turned)), [""; 0]);
        // Turned by 1.5 degrees about x: what was down, z, leans to -y.
        let leaning = said(&seen(Rotation3::from_euler_angles(1.5_f64.to_radians(), 0.0, 0.0), biased));
        let [sentence] = &leaning[..] else { panic!("{leaning:?}") };
        let degrees = |after: &str| -> f64 {
            let (_, rest) = sentence.split_once(after).unwrap();
            rest.split(' ').next().unwrap().parse().unwrap()
        };
        assert!((degrees("gravity is tilted ") - 1.5).abs() < 0.02, "{sentence}");
        assert!((degrees("+x, ") + 1.5).abs() < 0.02, "{sentence}");
    }

    #[test]
    fn a_lean_has_to_matter_and_to_stand_out_from_its_error() {
        let is_said = |x: f64, y: f64, error: f64| sentence(Vector2::new(x, y), error).is_some();
        assert!(is_said(0.4, -0.4, 0.01) && !is_said(0.4, 0.1, 0.01) && !is_said(0.4, -0.4, 0.2));
    }
}
