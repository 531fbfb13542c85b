//! Commands that change more often than they are logged.
//!
//! A controller at 100 Hz whose commands are logged at 50 Hz gives its motors a command between any two of the log. What these do
//! to the craft is in its motion and in nothing that was logged: slow noise in every moment, which looks like a missing effect
//! that depends on nothing.
//!
//! How large it is can be told from the log itself. Take away every other command, as if the log had half its rate: the residual of
//! roll and pitch grows by what these commands did. If n commands were given for each that was logged, a log with one in s of them
//! leaves a residual of variance (n s - 1) v, where v is what one unlogged command between two does: commands that hold for the
//! rest of the period are wrong by a step each, and steps of noise add up. So what is left with all logged commands, over what a
//! thinning by one adds, is (n - 1) / n: zero where every command was logged, a half to one where some were not. The gyro's own
//! noise, which is left as well, is known from its quick differences.
//!
//! What a model lacks is also left. So the moments are explained with all that could turn a craft (rates, airspeeds, their products,
//! the floor, rotors that follow late, rotors that are gyroscopes) and only frequencies around 1 Hz are looked at, and both axes must agree.

use model::{Adjustments, Spin, Vehicle};
use nalgebra::{DMatrix, DVector, Vector3};
use report::number::fixed;

use crate::filter::sum_of_products;
use crate::prepare::{Prepared, Stretch, vector};
use crate::statistics::median;

/// Width of each of the two means that smooth, s, and of those that are taken out.
const SMOOTH_S: f64 = 0.3;
const SLOW_S: f64 = 1.0;
/// Time between the rows, s: a smoothed signal says no more.
const ROW_S: f64 = 0.05;
/// Lag of rotors where it is not known, rad/s: of small craft.
const LAG_RAD_S: f64 = 20.0;
/// Thinning must add so many times what the gyro's noise leaves for a flight to be heard.
const ADDED: f64 = 2.0;
/// What is left over what thinning adds, in the flight where it is least: below the first every command was logged, and what
/// other flights leave is something else. Of 15 sets of five flights of a controller at 100 Hz, most of them with a hidden
/// effect, it was -0.05 to 0.09 logged at 100 Hz, and 0.28 to 0.67 logged at 50 and 25 Hz.
const LEAST_LEFT: f64 = 0.18;
/// In each flight at most this: unlogged commands leave one, and what leaves more is something else, such as the floor, or a wind that
/// grows with height.
const MOST_LEFT: f64 = 1.5;
/// Columns of the rotors: square, slope and bend of each, two near the floor, two as gyroscopes.
const OF_ROTORS: usize = 16;
/// Flights that must be heard: one alone may leave as much for another reason.
const FLIGHTS: usize = 3;

/// What thinning the commands shows, of roll and pitch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thinning {
    /// Variance that is left with all logged commands, less the gyro's, over what thinning them by one adds.
    pub left: [f64; 2],
    /// What thinning adds, over the variance that the gyro's noise leaves.
    pub added: [f64; 2],
}

/// What thinning the commands of a flight shows; nothing where rotor speeds were measured or there is too little of it.
pub fn thinning(flight: &Prepared, vehicle: &Vehicle) -> Option<Thinning> {
    if flight.has_rotor_speeds() {
        return None;
    }
    let mut vehicle = vehicle.clone();
    vehicle.motors.lag.get_or_insert(LAG_RAD_S);
    let longest = flight.stretches.iter().max_by_key(|stretch| stretch.time_s.len())?;
    let filter = Band::new(flight.period_s);
    let stride = ((ROW_S / flight.period_s) as usize).max(1);
    let rows = (longest.time_s.len() - 1).checked_sub(filter.taps.len())? / stride;
    let look = Look {
        stretch: longest,
        vehicle: &vehicle,
        period_s: flight.period_s,
        filter: &filter,
        stride,
        rows,
    };
    let motion = look.motion();
    // A regression that could explain anything explains nothing.
    if rows < 8 * (motion.len() + OF_ROTORS) {
        return None;
    }
    let targets = [0, 1].map(|axis| {
        let rate = &longest.rate_rad_s[axis];
        look.filtered(|k| (rate[k + 1] - rate[k]) / flight.period_s)
    });
    let left = |thinned: usize| look.residuals(&motion, &targets, thinned);
    let (all, half, third) = (left(1)?, left(2)?, left(3)?);
    let noise =
        [0, 1].map(|axis| filter.gain_of_rate(flight.period_s) * noise_variance(&longest.rate_rad_s[axis]));
    let added = [0, 1].map(|i| 0.5 * ((half[i] - all[i]) + 0.5 * (third[i] - all[i])));
    Some(Thinning {
        left: [0, 1].map(|i| (all[i] - noise[i]) / added[i]),
        added: [0, 1].map(|i| added[i] / noise[i].max(f64::MIN_POSITIVE)),
    })
}

/// What to say where the commands of flights of one craft were logged less often than they were given.
pub fn of_flights(thinnings: &[Option<Thinning>]) -> Option<String> {
    let heard = thinnings.iter().flatten().filter(|t| t.added.iter().all(|added| *added > ADDED));
    let mut left: Vec<f64> = heard.map(|t| 0.5 * (t.left[0] + t.left[1])).collect();
    let usual = median(&mut left)?;
    if left.len() < FLIGHTS || left[0] < LEAST_LEFT || left[left.len() - 1] > MOST_LEFT {
        return None;
    }
    Some(format!(
        "cmd1 to cmd4 look under-sampled: in each of {} flights the craft rolls and pitches as if there were commands \
         between the logged ones (the residual is {} times what leaving out every other command adds; it is 0 if every \
         command is logged), so forces and moments may stay unexplained or be mistaken for motor-lag; log the commands \
         at the rate of the controller",
        left.len(),
        fixed(usual, 1)
    ))
}

/// Variance of the noise of a signal, from differences so quick that a craft has no part in them.
pub(super) fn noise_variance(signal: &[f64]) -> f64 {
    let mut fifth: Vec<f64> =
        signal.windows(6).map(|w| (w[5] - w[0] - 5.0 * (w[4] - w[1]) + 10.0 * (w[3] - w[2])).abs()).collect();
    // The squares of 1 5 10 10 5 1 add up to 252; the median of |x| is 0.6745 of a normal deviation.
    median(&mut fifth).map_or(0.0, |middle| (middle / 0.6745).powi(2) / 252.0)
}

/// A filter that lets pass what is slower than the smoothing and faster than what is taken out.
struct Band {
    taps: Vec<f64>,
}

impl Band {
    fn new(period_s: f64) -> Self {
        let mean = |time_s: f64| {
            let count = ((time_s / period_s).round() as usize | 1).max(3);
            vec![1.0 / count as f64; count]
        };
        let smooth = folded(&mean(SMOOTH_S), &mean(SMOOTH_S));
        let slow = folded(&mean(SLOW_S), &mean(SLOW_S));
        let mut less: Vec<f64> = slow.iter().map(|tap| -tap).collect();
        less[slow.len() / 2] += 1.0;
        Self { taps: folded(&smooth, &less) }
    }

    /// Variance of what a rate's white noise of one leaves in the filtered acceleration.
    fn gain_of_rate(&self, period_s: f64) -> f64 {
        folded(&self.taps, &[1.0 / period_s, -1.0 / period_s]).iter().map(|tap| tap * tap).sum()
    }
}

/// Two filters one after the other.
fn folded(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut both = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            both[i + j] += x * y;
        }
    }
    both
}

/// A stretch that is looked at, between its samples.
struct Look<'a> {
    stretch: &'a Stretch,
    vehicle: &'a Vehicle,
    period_s: f64,
    filter: &'a Band,
    stride: usize,
    rows: usize,
}

impl Look<'_> {
    /// A signal between samples, filtered, at the rows.
    fn filtered(&self, signal: impl Fn(usize) -> f64) -> Vec<f64> {
        let values: Vec<f64> = (0..self.stretch.time_s.len() - 1).map(signal).collect();
        let at = |row: usize| sum_of_products(&values[row * self.stride..], &self.filter.taps);
        (0..self.rows).map(at).collect()
    }

    /// What turns a craft beside its rotors: rates, airspeeds and their products.
    fn motion(&self) -> Vec<Vec<f64>> {
        let stretch = self.stretch;
        let middle = |signal: &[Vec<f64>; 3], k: usize| 0.5 * (vector(signal, k) + vector(signal, k + 1));
        let states: Vec<[Vector3<f64>; 5]> = (0..stretch.time_s.len() - 1)
            .map(|k| {
                let v: Vector3<f64> = stretch.dcm[k] * middle(&stretch.velocity_ned_m_s, k);
                let w = middle(&stretch.rate_rad_s, k);
                let s = v.norm();
                let products = Vector3::new(w.x * w.y, w.y * w.z, w.x * w.z);
                [w, v, s * v, products, v.z * v]
            })
            .collect();
        (0..15).map(|i| self.filtered(|k| states[k][i / 3][i % 3])).collect()
    }

    /// Variances that roll and pitch leave when only every so-manieth command is known.
    fn residuals(&self, motion: &[Vec<f64>], targets: &[Vec<f64>; 2], thinned: usize) -> Option<[f64; 2]> {
        let mut stretch = self.stretch.clone();
        for command in &mut stretch.command {
            *command = (0..command.len()).map(|k| command[k - k % thinned]).collect();
        }
        let rotors = stretch.rotors(self.vehicle, &Adjustments::default(), self.period_s, 0.0);
        let squares =
            rotors.each_ref().map(|rotor| rotor.mean_rad_s.iter().map(|w| w * w).collect::<Vec<f64>>());
        let last = squares[0].len() - 1;
        let mut columns: Vec<Vec<f64>> = motion.to_vec();
        for square in &squares {
            let slope = |k: usize| square[(k + 1).min(last)] - square[k.saturating_sub(1)];
            let bend = |k: usize| square[(k + 1).min(last)] - 2.0 * square[k] + square[k.saturating_sub(1)];
            columns.extend([self.filtered(|k| square[k]), self.filtered(slope), self.filtered(bend)]);
        }
        // Close to a floor the rotors do more.
        let near = |k: usize| (-stretch.position_ned_m[2][k]).max(0.1).powi(-2);
        let [a, b, c, d] = &squares;
        columns.push(self.filtered(|k| (a[k] + d[k] - b[k] - c[k]) * near(k)));
        columns.push(self.filtered(|k| (a[k] + b[k] - c[k] - d[k]) * near(k)));
        // In the reference craft pitch shows them ten times as much as noise, where roll hardly does.
        let spins = self.vehicle.motors.spin.map(Spin::yaw_sign);
        let turning = |k: usize| -> f64 {
            rotors.iter().zip(spins).map(|(rotor, sign)| sign * rotor.mean_rad_s[k]).sum()
        };
        columns.extend([0, 1].map(|axis| self.filtered(|k| stretch.rate_rad_s[axis][k] * turning(k))));
        let mut matrix = DMatrix::from_fn(self.rows, columns.len(), |row, column| columns[column][row]);
        for mut column in matrix.column_iter_mut() {
            let size = column.norm();
            column.scale_mut(if size > 0.0 { 1.0 / size } else { 0.0 });
        }
        let base = matrix.qr().q();
        let free = (self.rows - columns.len()) as f64;
        Some(targets.each_ref().map(|target| {
            let target = DVector::from_column_slice(target);
            let explained = &base * base.tr_mul(&target);
            (target - explained).norm_squared() / free
        }))
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::testing::truth;
    use flights::{Column, Flight};
    use model::{Plant, State};

    /// A craft that is kept level by a controller at 100 Hz with noise in its commands, 20 s, logged at every so-manieth row.
    fn flown(seed: u64, logged: usize) -> Flight {
        flown_yawing(seed, logged, 0.0)
    }

    /// The same with rotors of the one spin that go so much quicker and slower than those of the other, rad/s.
    fn flown_yawing(seed: u64, logged: usize, apart_rad_s: f64) -> Flight {
        let model = truth();
        let plant = Plant::new(&model);
        let substeps = plant.substeps(0.01, 4);
        let map = model.vehicle.rotor_map();
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut noise = move |size: f64| size * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
        let mut state = State::at_rest(Vector3::new(0.0, 0.0, -5.0), [635.0; 4]);
        let mut rows: Vec<[f64; 15]> = Vec::new();
        for k in 0..2000 {
            let t = 0.01 * f64::from(k);
            let euler = state.euler_rad();
            let w = state.rate_rad_s;
            let roll = 60.0 * (0.15 * (1.1 * t).sin() + 0.08 * (5.3 * t).sin() - euler.x) - 14.0 * w.x;
            let pitch = 60.0 * (0.15 * (1.7 * t).cos() + 0.08 * (6.1 * t).cos() - euler.y) - 14.0 * w.y;
            let yaw = apart_rad_s * (2.3 * t).sin();
            let command = [(1.0, 1.0, 1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0), (1.0, -1.0, -1.0)].map(
                |(r, p, y)| {
                    let speed = 635.0 + 2.0 * r * roll + 2.0 * p * pitch + y * yaw;
                    map.command_for(speed, 12.0) + noise(2.5)
                },
            );
            let mut row = [0.0; 15];
            row[0] = t;
            for i in 0..3 {
                row[1 + i] = state.position_ned_m[i] + noise(2e-4);
                row[4 + i] = euler[i] + noise(5e-4);
                row[7 + i] = w[i] + noise(0.005);
            }
            row[10..14].copy_from_slice(&command);
            row[14] = 12.0;
            rows.push(row);
            plant.step(&mut state, &plant.commanded_rad_s(&command, 12.0), 12.0, &substeps);
        }
        use Column::*;
        let columns = [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
        let every = |i: usize| rows.iter().step_by(logged).map(|row| row[i]).collect();
        Flight::from_columns("flown", columns.into_iter().enumerate().map(|(i, column)| (column, every(i))))
    }

    fn of(flights: &[Flight]) -> Vec<Option<Thinning>> {
        let vehicle = truth().vehicle;
        flights.iter().map(|f| thinning(&Prepared::new(f, &vehicle).unwrap(), &vehicle)).collect()
    }

    #[test]
    fn a_log_of_every_command_leaves_nothing_and_one_of_some_commands_is_named() {
        for (logged, named) in [(1, false), (2, true), (4, true)] {
            let found = of(&[1, 2, 3].map(|seed| flown(seed, logged)));
            let said = of_flights(&found);
            assert_eq!(said.is_some(), named, "1 of {logged}: {found:?}");
            if let Some(fault) = said {
                assert!(fault.starts_with("cmd1 to cmd4 look under-sampled: in each of 3 flights"));
            }
        }
    }

    /// Rotors that turn faster one way than the other make a pitch of a roll.
    #[test]
    fn rotors_that_are_gyroscopes_are_no_missing_commands() {
        let found = of(&[1, 2, 3].map(|seed| flown_yawing(seed, 1, 40.0)));
        assert!(found.iter().all(Option::is_some));
        assert_eq!(of_flights(&found), None, "{found:?}");
    }

    /// Logged at 50 Hz and held for as long: all commands are there.
    #[test]
    fn commands_that_are_held_between_the_rows_are_not_under_sampled() {
        let model = truth();
        let at_100_hz = [1, 2, 3].map(|seed| flown(seed, 1));
        // The same samples taken for those of a slower clock: a craft half as quick.
        let mut vehicle = model.vehicle.clone();
        vehicle.motors.lag = vehicle.motors.lag.map(|lag| 0.5 * lag);
        let found: Vec<Option<Thinning>> = at_100_hz
            .iter()
            .map(|flight| {
                let mut slow = flight.clone();
                slow.replace(Column::T, flight.required(Column::T).iter().map(|t| 2.0 * t).collect());
                for column in [Column::P, Column::Q, Column::R] {
                    slow.replace(column, flight.required(column).iter().map(|w| 0.5 * w).collect());
                }
                thinning(&Prepared::new(&slow, &vehicle).unwrap(), &vehicle)
            })
            .collect();
        assert!(found.iter().all(Option::is_some));
        assert_eq!(of_flights(&found), None, "{found:?}");
    }

    #[test]
    fn one_flight_that_leaves_nothing_speaks_for_all_and_two_are_too_few() {
        let with = |left: f64| Some(Thinning { left: [left; 2], added: [5.0; 2] });
        assert!(of_flights(&[with(0.5), with(0.9), with(0.6)]).is_some());
        assert_eq!(of_flights(&[with(0.5), with(0.05), with(0.6), with(0.7)]), None);
        assert_eq!(of_flights(&[with(0.5), with(0.9), None]), None);
        assert_eq!(of_flights(&[with(3.0), with(0.9), with(4.0)]), None);
        let faint = Some(Thinning { left: [0.6; 2], added: [5.0, 1.0] });
        assert_eq!(of_flights(&[with(0.5), with(0.9), faint]), None);
    }

    /// Variance of white noise of a hundredth on a slow curve.
    #[test]
    fn noise_is_told_from_motion() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let signal: Vec<f64> = (0..4000)
            .map(|k| {
                let noise = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                (0.05 * f64::from(k)).sin() + 0.01 * noise
            })
            .collect();
        // The median of 4000 correlated values: to a few percent.
        assert!((noise_variance(&signal) / 1e-4 - 1.0).abs() < 0.1, "{}", noise_variance(&signal));
    }
}
