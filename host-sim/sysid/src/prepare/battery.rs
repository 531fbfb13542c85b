//! The battery's voltage without the voltmeter's noise.
//!
//! A noisy regressor pulls its coefficient towards zero, and a smoother long enough to take the noise away takes the sag away
//! with it. The sag is known in its shape, though: it follows the current, and that the rotors' power. So the voltage is
//! split into what is proportional to the sum of the cubed rotor speeds, kept as fast as it is, and a rest (charge, warmth,
//! what the cubes do not say), which is smoothed over a second. The factor between load and sag is fitted to what is left of
//! both when that smoother has been taken off, over the whole flight.

use model::{Adjustments, Vehicle};

use crate::filter::{RegressionFilter, sum_of_products};
use crate::prepare::stretch::{Stretch, smoothed};

/// Window over which the rest is smoothed, s.
const SLOW_S: f64 = 1.0;

/// Splits the voltage of each stretch and puts it together without noise.
pub(crate) fn steady(stretches: &mut [Stretch], vehicle: &Vehicle, period_s: f64) {
    let taps = RegressionFilter::smoothing_taps(period_s, SLOW_S);
    let split: Vec<Split> = stretches.iter_mut().map(|s| Split::new(s, vehicle, &taps, period_s)).collect();
    let (mut shared, mut squares) = (0.0, 0.0);
    for Split { fast_load, fast_v, .. } in &split {
        shared += sum_of_products(fast_load, fast_v);
        squares += sum_of_products(fast_load, fast_load);
    }
    // A load lowers a voltage; anything else is chance.
    let sag = if squares > 0.0 { (shared / squares).min(0.0) } else { 0.0 };
    for (stretch, Split { slow_v, fast_load, .. }) in stretches.iter_mut().zip(split) {
        stretch.battery_v = slow_v.iter().zip(fast_load).map(|(slow, load)| slow + sag * load).collect();
    }
}

struct Split {
    slow_v: Vec<f64>,
    fast_v: Vec<f64>,
    /// Sum of the cubed rotor speeds less its smoothed self, rad^3/s^3.
    fast_load: Vec<f64>,
}

impl Split {
    /// Leaves the smoothed voltage in the stretch: a load computed at the noisy one would share its noise.
    fn new(stretch: &mut Stretch, vehicle: &Vehicle, taps: &[f64], period_s: f64) -> Self {
        let slow_v = smoothed(&stretch.battery_v, taps);
        let measured = std::mem::replace(&mut stretch.battery_v, slow_v.clone());
        let rotors = stretch.rotors(vehicle, &Adjustments::default(), period_s, 0.0);
        let cubes = |k: usize| rotors.iter().map(|r| r.speed_rad_s[k].powi(3)).sum::<f64>();
        let load: Vec<f64> = (0..slow_v.len()).map(cubes).collect();
        let less = |all: &[f64], slow: &[f64]| all.iter().zip(slow).map(|(a, s)| a - s).collect();
        Self { fast_v: less(&measured, &slow_v), fast_load: less(&load, &smoothed(&load, taps)), slow_v }
    }
}

#[cfg(test)]
mod tests {
    use crate::Prepared;
    use flights::Column;
    use flights::Flight;
    use model::Vehicle;

    /// Hover with commands that step at random, a first-order lag and a sag with the rotors' power: the voltage comes out
    /// with a fraction of the voltmeter's noise, and with the sag.
    #[test]
    fn the_noise_goes_and_the_sag_stays() {
        use rand::{RngExt, SeedableRng};
        let vehicle = Vehicle::thesis();
        let map = vehicle.rotor_map();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let count = 2000;
        let (mut rotor, mut command) = (635.0, 0.0);
        let (mut clean, mut columns) = (Vec::new(), vec![Vec::new(); 15]);
        for k in 0..count {
            let volts = 12.0 - 1e-4 * k as f64 - 0.5 * (rotor / 635.0_f64).powi(3);
            if k % 20 == 0 {
                command = map.command_for(rng.random_range(560.0..710.0), volts);
            }
            clean.push(volts);
            let noise = 0.02 * (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
            let row = [k as f64 * 0.01, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            for (column, value) in
                columns.iter_mut().zip(row.into_iter().chain([command; 4]).chain([volts + noise]))
            {
                column.push(value);
            }
            let lag = vehicle.motors.lag.unwrap_or(20.0);
            rotor += (map.speed_rad_s(command, volts) - rotor) * (1.0 - (-0.01 * lag).exp());
        }
        let names = [
            Column::T,
            Column::X,
            Column::Y,
            Column::Z,
            Column::Phi,
            Column::Theta,
            Column::Psi,
            Column::P,
            Column::Q,
            Column::R,
            Column::Cmd1,
            Column::Cmd2,
            Column::Cmd3,
            Column::Cmd4,
            Column::Vbat,
        ];
        let flight = Flight::from_columns("made up", names.into_iter().zip(columns));
        let prepared = Prepared::new(&flight, &vehicle).unwrap();
        let found = &prepared.stretches[0].battery_v;
        // The smoother's window does not fit at the ends.
        let inside = 60..count - 60;
        let n = inside.len() as f64;
        let error = inside.clone().map(|k| (found[k] - clean[k]).powi(2)).sum::<f64>() / n;
        let spread = inside.map(|k| (clean[k] - 11.4).powi(2)).sum::<f64>() / n;
        assert!(error.sqrt() < 0.005, "{} V of 0.02 V", error.sqrt());
        assert!(spread.sqrt() > 0.05, "the sag is there: {}", spread.sqrt());
    }
}
