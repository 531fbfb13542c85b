//! Does a load explain the motions that it would make, or only quicker ones?
//!
//! A load moves the craft at its swing and more slowly; above that it hangs nearly still in the air, and pulls the craft back to where it
//! is: by `-m_l w0^2 x`. The noise of a tracker looks the same there. The rows of forces are second derivatives of the place, and the
//! noise in them is `-w^2` times that in the place which drives the load. So where the noise is not white a short cable with a heavy
//! load takes some of it away, above its swing, and pays below. A real load lowers the error at its swing.

use fourier::{Complex, Planner};
use sysid::Residuals;
use sysid::fit::slung_load::Carried;
use sysid::prepare::Prepared;

use crate::noise::hann;
use crate::significance::rows_of_stretches;

/// What belongs to a swing, in frequencies of the craft and the load against each other: half the width of its peak, damped by a tenth.
const WITHIN: f64 = 1.1;
/// Swings in a stretch of rows from which on its frequencies are told apart.
const LEAST_SWINGS: f64 = 3.0;

/// The frequency up to which a load explains what the craft does, Hz: left to themselves, craft and load swing against each other.
pub(crate) fn up_to_hz(carried: &Carried) -> f64 {
    WITHIN * (1.0 + carried.share).sqrt() / carried.swing_s()
}

/// By how many percent the squared error along the horizontal body axes falls at frequencies up to `up_to_hz`; nothing where no stretch is
/// long enough to tell.
pub(crate) fn drop_percent(
    flights: &[&Prepared],
    (before, after): (&[Residuals], &[Residuals]),
    up_to_hz: f64,
) -> Option<f64> {
    let mut planner = Planner::new();
    let (mut had, mut left) = (0.0, 0.0);
    for ((flight, before), after) in flights.iter().zip(before).zip(after) {
        for rows in rows_of_stretches(flight) {
            let length_s = rows.len() as f64 * flight.period_s;
            if length_s * up_to_hz < LEAST_SWINGS {
                continue;
            }
            let highest = (up_to_hz * length_s).floor() as usize;
            for axis in 0..2 {
                had += power(&mut planner, &before.residual[axis][rows.clone()], highest);
                left += power(&mut planner, &after.residual[axis][rows.clone()], highest);
            }
        }
    }
    (had > 0.0).then(|| 100.0 * (1.0 - left / had))
}

/// Power of a signal up to a number of cycles in its length, through Hann's window.
fn power(planner: &mut Planner, signal: &[f64], highest: usize) -> f64 {
    let n = signal.len();
    let mut values: Vec<Complex<f64>> =
        signal.iter().enumerate().map(|(k, e)| Complex::new(hann(k, n) * e, 0.0)).collect();
    planner.forward(n).process(&mut values);
    values.iter().take(highest.min(n / 2) + 1).map(Complex::norm_sqr).sum::<f64>() / n as f64
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use model::Effect;
    use sysid::fit::slung_load;

    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// 0.2 kg on 0.5 m under 1.214 kg: 0.705 Hz under a craft that is held, and sqrt(1 + 0.2 / 1.214) times as much with one that gives way.
    #[test]
    fn a_load_and_its_craft_swing_against_each_other() {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.2, 0.5, 0.1]);
        let carried = slung_load::of_model(&model).unwrap();
        let alone_hz = (9.81_f64 / 0.5).sqrt() / TAU;
        let together_hz = alone_hz * (1.0 + 0.2 / model.vehicle.mass).sqrt();
        assert!((up_to_hz(&carried) / together_hz - WITHIN).abs() < 1e-12);
    }

    /// Waves of 0.5 and 3 Hz, of which the one or the other goes.
    #[test]
    fn only_what_is_slow_enough_counts() {
        let flights = prepared(&truth(), 30..31, 12.0, &ORDINARY);
        let flight = &flights[0];
        let rows = flight.rows();
        let waves = |parts: [f64; 2]| {
            let at = |k: usize| -> f64 {
                let turns = TAU * k as f64 * flight.period_s;
                parts[0] * (0.5 * turns).sin() + parts[1] * (3.0 * turns).sin()
            };
            let signal: Vec<f64> = (0..rows).map(at).collect();
            let residual =
                std::array::from_fn(|axis| if axis < 2 { signal.clone() } else { vec![0.0; rows] });
            vec![Residuals { measured: residual.clone(), residual }]
        };
        let drop = |parts| drop_percent(&[flight], (&waves([1.0, 5.0]), &waves(parts)), 1.0).unwrap();
        assert!((drop([0.0, 5.0]) - 100.0).abs() < 0.5, "{}", drop([0.0, 5.0]));
        assert!(drop([1.0, 0.0]).abs() < 0.5, "{}", drop([1.0, 0.0]));
        // Half the amplitude is a quarter of the square.
        assert!((drop([0.5, 0.0]) - 75.0).abs() < 0.5);
        assert!((drop([2.0, 0.0]) + 300.0).abs() < 2.0);
        assert_eq!(drop_percent(&[flight], (&waves([1.0, 1.0]), &waves([0.0, 0.0])), 0.1), None);
    }
}
