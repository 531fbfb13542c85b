//! What happens to logs after the flight: rows or columns get lost, are interpolated, or rates are
//! made up from the attitude.

use std::f64::consts::{PI, TAU};

use flights::{Column, Flight};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::sensors::{FORCE, LOGGED, SPEEDS};

const ANGLES: [Column; 3] = [Column::Phi, Column::Theta, Column::Psi];
/// Pose and rates: what comes from the tracker and the gyro.
const STATES: [Column; 9] = [
    Column::X,
    Column::Y,
    Column::Z,
    Column::Phi,
    Column::Theta,
    Column::Psi,
    Column::P,
    Column::Q,
    Column::R,
];

/// Logs the states only in one row of `every`, and fills them in linearly between; commands and
/// voltage stay. Rows after the last that is kept are dropped.
pub fn interpolated(flight: &Flight, every: usize) -> Flight {
    let rows = (flight.len().max(1) - 1) / every * every + 1;
    let mut columns: Vec<(Column, Vec<f64>)> =
        LOGGED.iter().map(|c| (*c, flight.required(*c)[..rows].to_vec())).collect();
    for (column, values) in columns.iter_mut().filter(|(column, _)| STATES.contains(column)) {
        for start in (0..rows - 1).step_by(every) {
            let (from, to) = (values[start], values[start + every]);
            let step = if ANGLES.contains(column) { turn(to - from) } else { to - from };
            for k in 1..every {
                values[start + k] = from + step * k as f64 / every as f64;
            }
        }
    }
    Flight::from_columns(&flight.name, columns)
}

/// Loses three to six pieces of 0.1 to 0.5 s.
pub fn with_gaps(flight: &Flight, seed: u64) -> Flight {
    let mut rng = Pcg64::seed_from_u64(seed);
    let t = flight.required(Column::T);
    let (first_s, last_s) = (t[0], t[t.len() - 1]);
    let gaps: Vec<(f64, f64)> = (0..rng.random_range(3..=6))
        .map(|_| (rng.random_range(first_s + 0.5..last_s - 1.0), rng.random_range(0.1..0.5)))
        .collect();
    let is_kept =
        |t: f64| !gaps.iter().any(|(start_s, length_s)| (*start_s..start_s + length_s).contains(&t));
    let columns = LOGGED.iter().map(|column| {
        let values = flight.required(*column).iter().zip(t);
        (*column, values.filter(|(_, t)| is_kept(**t)).map(|(value, _)| *value).collect())
    });
    Flight::from_columns(&flight.name, columns)
}

/// Loses columns.
pub fn without(flight: &Flight, lost: &[Column]) -> Flight {
    let kept = LOGGED.iter().chain(&FORCE).chain(&SPEEDS).filter(|column| !lost.contains(column));
    let logged = kept.filter_map(|column| Some((*column, flight.column(*column)?.to_vec())));
    Flight::from_columns(&flight.name, logged)
}

/// Rows on either side of the mean that smooths derived rates: 50 ms at 100 Hz.
const SMOOTHED: usize = 2;

/// Replaces the gyro by what the attitude says: central differences, smoothed over five rows.
pub fn with_derived_rates(flight: &Flight) -> Flight {
    let t = flight.required(Column::T);
    let angles = ANGLES.map(|column| unwrapped(flight.required(column)));
    let slopes = angles.each_ref().map(|values| smoothed(&slopes(t, values)));
    let mut rates: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(t.len()));
    for k in 0..t.len() {
        let (phi, theta) = (angles[0][k], angles[1][k]);
        let [dphi, dtheta, dpsi] = slopes.each_ref().map(|slope| slope[k]);
        rates[0].push(dphi - theta.sin() * dpsi);
        rates[1].push(phi.cos() * dtheta + phi.sin() * theta.cos() * dpsi);
        rates[2].push(-phi.sin() * dtheta + phi.cos() * theta.cos() * dpsi);
    }
    let mut derived = flight.clone();
    for (column, values) in [Column::P, Column::Q, Column::R].into_iter().zip(rates) {
        derived.replace(column, values);
    }
    derived
}

fn turn(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

fn unwrapped(angles: &[f64]) -> Vec<f64> {
    let mut now = angles.first().copied().unwrap_or(0.0);
    angles
        .iter()
        .map(|angle| {
            now += turn(angle - now);
            now
        })
        .collect()
}

fn slopes(t: &[f64], values: &[f64]) -> Vec<f64> {
    let last = t.len() - 1;
    let ends = |k: usize| (k.saturating_sub(1), (k + 1).min(last));
    (0..t.len()).map(ends).map(|(a, b)| (values[b] - values[a]) / (t[b] - t[a])).collect()
}

fn smoothed(values: &[f64]) -> Vec<f64> {
    let window = |k: usize| &values[k.saturating_sub(SMOOTHED)..(k + SMOOTHED + 1).min(values.len())];
    (0..values.len()).map(window).map(|window| window.iter().sum::<f64>() / window.len() as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::{Pattern, Sensors, Size, World};

    fn flown(sensors: &Sensors) -> Flight {
        World::new(Size::F330, 30).fly(Pattern::C, 12.0, sensors, 0).expect("a calm craft is kept")
    }

    #[test]
    fn interpolated_states_are_straight_between_rows_that_were_logged() {
        let flight = flown(&Sensors::default());
        let slow = interpolated(&flight, 4);
        assert_eq!(slow.len(), 1197);
        for column in STATES {
            let (before, after) = (flight.required(column), slow.required(column));
            assert_eq!(before[400], after[400], "{column:?}");
            assert_ne!(before[402], after[402], "{column:?}");
            let bend = after[401] - 2.0 * after[402] + after[403];
            assert!(bend.abs() < 1e-12, "{column:?}: {bend}");
        }
        assert_eq!(flight.required(Column::Cmd3)[..1197], *slow.required(Column::Cmd3));
    }

    #[test]
    fn angles_are_interpolated_the_short_way_round() {
        let mut flight = flown(&Sensors::noisy(0.0));
        let psi = flight.required(Column::Psi).iter().map(|psi| turn(psi + PI)).collect();
        flight.replace(Column::Psi, psi);
        let steps = interpolated(&flight, 4).required(Column::Psi).to_vec();
        // 3 rad/s of yaw at most.
        assert!(steps.windows(2).all(|w| turn(w[1] - w[0]).abs() < 0.03));
    }

    #[test]
    fn three_to_six_gaps_of_a_tenth_to_half_a_second_are_cut() {
        let flight = flown(&Sensors::default());
        for seed in 0..20 {
            let cut = with_gaps(&flight, seed);
            let gaps: Vec<f64> =
                cut.required(Column::T).windows(2).map(|w| w[1] - w[0]).filter(|step| *step > 0.05).collect();
            // Gaps may run into each other.
            assert!((1..=6).contains(&gaps.len()), "{gaps:?}");
            assert!(gaps.iter().all(|gap| (0.1..1.5).contains(gap)), "{gaps:?}");
            assert_eq!(cut, with_gaps(&flight, seed));
            assert_ne!(cut, with_gaps(&flight, seed + 1));
        }
    }

    #[test]
    fn derived_rates_are_those_of_the_body_but_for_the_smoothing() {
        let flight = flown(&Sensors::noisy(0.0));
        let derived = with_derived_rates(&flight);
        for column in [Column::P, Column::Q, Column::R] {
            let (gyro, made) = (flight.required(column), derived.required(column));
            let rms = |values: &mut dyn Iterator<Item = f64>| {
                values.map(|v| v * v).sum::<f64>().sqrt() / (gyro.len() as f64).sqrt()
            };
            let off = rms(&mut gyro.iter().zip(made).skip(10).take(1100).map(|(a, b)| a - b));
            // A mean over 50 ms flattens a motion of 10 rad/s by (0.5)^2 / 24, one part in a hundred;
            // the shaken motors move faster by some more.
            assert!(off < 0.1 * rms(&mut gyro.iter().copied()), "{column:?}: {off}");
            assert!(off > 0.0);
        }
    }
}
