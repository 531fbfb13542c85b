//! Does the gyro measure what the tracked attitude does: to scale, at right angles, with a steady bias?
//!
//! The rates of the attitude and the gyro go through filters of equal response (`tracks.rs`), once the clocks agree. The gyro is the
//! regressor (`linear_sensor.rs`): its noise is small beside that of a differentiated attitude, so that the factors are hardly too small.

use report::number::with_error;

use crate::checks::linear_sensor::{Linear, Rows, SIGNIFICANT, Sensor};
use crate::checks::tracks;
use crate::prepare::Prepared;

const GYRO: Sensor = Sensor {
    name: "gyro",
    columns: ["p", "q", "r"],
    tracked: "the rate of the tracked attitude",
    unit: "rad/s",
    drift_matters: 0.02,
};

/// Turns about z that matter, degrees: roll commands pitch the craft by 1.7 %.
const TURN_MATTERS_DEG: f64 = 1.0;

/// Faults of the gyro, in sentences.
pub fn check(flight: &Prepared) -> Vec<String> {
    let mut rows = Rows::new(flight.period_s);
    for pair in tracks::rates(flight, |k, stretch| stretch.dcm[k]) {
        rows.begin();
        for k in (0..pair.len()).step_by(Rows::stride(flight.period_s)) {
            let at = |signals: &[Vec<f64>; 3]| signals.each_ref().map(|signal| signal[k]);
            rows.push(pair.start_s + k as f64 * flight.period_s, at(&pair.onboard), at(&pair.tracked));
        }
    }
    let Some(gyro) = rows.sensor_by_tracked() else { return Vec::new() };
    let mut found = gyro.faults(&GYRO, [true; 3]);
    found.extend(turned(&gyro));
    found
}

/// Against the tracked attitude. Neither thrust nor gravity tells which of the two is turned, as they do about x and y.
fn turned(gyro: &Linear) -> Option<String> {
    let (turn_deg, error_deg) = gyro.turned_about_z_deg();
    (turn_deg.abs() > TURN_MATTERS_DEG.max(SIGNIFICANT * error_deg)).then(|| {
        format!(
            "the gyro's axes are rotated by {} about z relative to the tracked attitude: the gyro or the tracker's rigid body is misaligned \
             with the craft; align both with the craft's axes",
            with_error(turn_deg, error_deg, "deg")
        )
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::prepared;

    /// A waving flight of 40 s whose gyro makes of the true rates what `told` says, with noise of tracker and gyro.
    fn told(told: impl Fn(f64, Vector3<f64>) -> Vector3<f64>) -> Vec<String> {
        let noise = std::cell::RefCell::new(rand_pcg::Pcg64::seed_from_u64(9));
        let flight = prepared(4000, |t, row| {
            row.wave();
            let draw = |size: f64| size * (noise.borrow_mut().random::<f64>() - 0.5);
            let rates = told(t, row.rate_rad_s.into());
            row.rate_rad_s = std::array::from_fn(|i| rates[i] + draw(0.03));
            row.euler_rad.iter_mut().for_each(|angle| *angle += draw(0.002));
        });
        check(&flight)
    }

    #[test]
    fn a_gyro_without_faults_has_none_and_one_that_leans_is_left_to_the_attitude() {
        assert_eq!(told(|_, rates| rates), [""; 0]);
        let turned = nalgebra::Rotation3::from_euler_angles(0.03, -0.02, 0.01);
        assert_eq!(told(|_, rates| turned * rates), [""; 0]);
    }

    /// Axes that are turned by 2 degrees see p cos 2 + q sin 2 as p.
    #[test]
    fn a_gyro_that_is_turned_about_z_is_named() {
        let turned = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), -2.0_f64.to_radians());
        let found = told(|_, rates| turned * rates);
        assert_eq!(found.len(), 1, "{found:?}");
        let (start, deg) = found[0].split_once(" by ").unwrap();
        assert_eq!(start, "the gyro's axes are rotated");
        let deg: f64 = deg.split_whitespace().next().unwrap().parse().unwrap();
        assert!((deg - 2.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn scale_cross_axis_and_drift_are_named_with_their_sizes() {
        let scaled = told(|_, rates| rates.component_mul(&Vector3::new(1.0, 0.94, 1.0)));
        assert_eq!(scaled.len(), 1, "{scaled:?}");
        let percent: f64 = scaled[0].split_whitespace().nth(4).unwrap().parse().unwrap();
        assert!(scaled[0].starts_with("the gyro's q is ") && (percent - 6.0).abs() < 0.2, "{scaled:?}");
        assert!(scaled[0].contains("smaller than") && scaled[0].contains("scale = 1.06"), "{scaled:?}");
        let crossed =
            told(|_, rates| Vector3::new(rates.x + 0.05 * rates.y, rates.y + 0.05 * rates.x, rates.z));
        assert_eq!(crossed.len(), 1, "{crossed:?}");
        assert!(
            crossed[0].starts_with("the gyro's p and q are not at right angles: each measures "),
            "{crossed:?}"
        );
        let drifting = told(|t, rates| rates + Vector3::new(0.0, 0.0, 0.002 * (t - 20.0)));
        assert_eq!(drifting.len(), 1, "{drifting:?}");
        assert!(drifting[0].starts_with("the bias of the gyro's r drifts by 0.1"), "{drifting:?}");
    }
}
