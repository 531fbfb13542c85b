//! The channels of a log that preparation uses: mended as columns, then taken apart into stretches.

use std::borrow::Cow;

use flights::{Column, Flight, GAP_PERIODS};
use model::frames;

use crate::filter::{RegressionFilter, convolve};
use crate::prepare::columns::{BATTERY, COMMAND, EULER, OPTIONAL, POSITION, RATE};
use crate::prepare::grid::EvenGrid;
use crate::prepare::outliers::{self, Outlier};
use crate::prepare::stretch::{Stretch, vector};

/// The columns that preparation uses, in a fixed order.
pub(crate) struct Channels<'a> {
    /// As logged, unless something had to be mended.
    pub(crate) columns: Vec<Cow<'a, [f64]>>,
    /// What each of them is.
    names: Vec<Column>,
    /// What was taken out of them.
    pub(crate) outliers: Vec<Outlier>,
    pub(crate) rotor: Option<usize>,
    pub(crate) imu: Option<usize>,
    pub(crate) velocity: Option<usize>,
}

impl<'a> Channels<'a> {
    pub(crate) fn new(flight: &'a Flight, imu: bool, velocity: bool) -> Self {
        use Column::*;
        let required = [X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
        let mut columns: Vec<Cow<[f64]>> = required.iter().map(|&c| flight.required(c).into()).collect();
        for angle in &mut columns[EULER..RATE] {
            unwrap_angle(angle);
        }
        let mut names = required.to_vec();
        let mut add = |group: &[Column], values: &[&'a [f64]]| {
            let at = columns.len();
            columns.extend(values.iter().map(|&c| Cow::from(c)));
            names.extend(group);
            at
        };
        let (rotors, force, speed) = ([Omega1, Omega2, Omega3, Omega4], [Ax, Ay, Az], [Vx, Vy, Vz]);
        let rotor = flight.group(rotors).map(|g| add(&rotors, &g));
        let imu = imu.then(|| flight.group(force)).flatten().map(|g| add(&force, &g));
        let velocity = velocity.then(|| flight.group(speed)).flatten().map(|g| add(&speed, &g));
        Self { columns, names, outliers: Vec::new(), rotor, imu, velocity }
    }

    /// Makes gross outliers of the sensors missing values (`outliers.rs`) and keeps what they were. Commands may be anything.
    pub(crate) fn take_out_spikes(&mut self, t: &[f64], period_s: f64) {
        let time: Vec<f64> = t.iter().map(|t| t / period_s).collect();
        let is_gap = |k: &usize| time[*k] - time[*k - 1] > GAP_PERIODS;
        let gaps: Vec<usize> = (1..time.len()).filter(is_gap).collect();
        let sensors = (POSITION..COMMAND).chain(BATTERY..self.columns.len());
        let rotors = self.rotor.map(|first| first..first + 4);
        let crowds = |column| !rotors.as_ref().is_some_and(|rotors| rotors.contains(&column));
        for column in sensors {
            let logged = self.columns[column].clone();
            let found = outliers::take_out(&mut self.columns[column], &time, &gaps, crowds(column));
            self.outliers.extend(found.into_iter().map(|row| Outlier {
                row,
                t_s: t[row],
                column: self.names[column],
                value: logged[row],
            }));
        }
    }

    /// Whether all of the sensors' values of a row are there; the battery's, which are smoothed, aside.
    pub(crate) fn measured(&self) -> Vec<bool> {
        let mut all = vec![true; self.columns[0].len()];
        for column in (POSITION..COMMAND).chain(OPTIONAL..self.columns.len()) {
            all.iter_mut().zip(self.columns[column].iter()).for_each(|(all, v)| *all &= v.is_finite());
        }
        all
    }

    pub(crate) fn stretch(&self, mut even: EvenGrid, period_s: f64, filter: &RegressionFilter) -> Stretch {
        let position_ned_m = even.take(POSITION);
        let euler = even.take(EULER);
        let dcm = (0..even.time_s.len()).map(|k| frames::dcm_from_euler(vector(&euler, k))).collect();
        let velocity_ned_m_s = match self.velocity {
            Some(first) => even.take(first),
            None => {
                // Plain differences at the ends: rows there are never used, but filters must not spread a NaN.
                position_ned_m
                    .each_ref()
                    .map(|p| convolve(p, &filter.derivative, |k| central_difference(p, k, period_s)))
            }
        };
        Stretch {
            position_ned_m,
            dcm,
            velocity_ned_m_s,
            euler_rad: euler,
            rate_rad_s: even.take(RATE),
            command: even.take(COMMAND),
            logged_rotor_rad_s: self.rotor.map(|first| even.take(first)),
            battery_v: even.columns[BATTERY].clone(),
            imu_m_s2: self.imu.map(|first| even.take(first)),
            outliers: Vec::new(),
            gust_ned_m_s: None,
            further: Vec::new(),
            further_places: Vec::new(),
            measured: even.measured,
            time_s: even.time_s,
        }
    }
}

fn unwrap_angle(angle: &mut Cow<[f64]>) {
    use std::f64::consts::{PI, TAU};
    let jumps = |w: &[f64]| (w[1] - w[0]).abs() > PI || !w[1].is_finite();
    if !angle.windows(2).any(jumps) {
        return;
    }
    let mut turns = 0.0;
    let mut last = f64::NAN;
    for value in angle.to_mut().iter_mut().filter(|v| v.is_finite()) {
        let raw = *value;
        if raw - last > PI {
            turns -= ((raw - last) / TAU).round();
        } else if raw - last < -PI {
            turns += ((last - raw) / TAU).round();
        }
        last = raw;
        *value = raw + turns * TAU;
    }
}

fn central_difference(signal: &[f64], k: usize, period_s: f64) -> f64 {
    let (before, after) = (k.saturating_sub(1), (k + 1).min(signal.len() - 1));
    (signal[after] - signal[before]) / ((after - before).max(1) as f64 * period_s)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;
    use crate::testing::{flight, prepared};

    fn wrapped(angle: f64) -> f64 {
        (angle + PI).rem_euclid(TAU) - PI
    }

    fn unwrapped(angle: &[f64]) -> Vec<f64> {
        let mut angle = Cow::from(angle);
        unwrap_angle(&mut angle);
        angle.into_owned()
    }

    #[test]
    fn an_angle_comes_out_without_jumps_after_many_turns_either_way() {
        for way in [1.0, -1.0] {
            let truth: Vec<f64> = (0..200).map(|k| way * 0.3 * f64::from(k) + 0.1).collect();
            let logged: Vec<f64> = truth.iter().map(|a| wrapped(*a)).collect();
            for (value, truth) in unwrapped(&logged).iter().zip(&truth) {
                assert!((value - truth).abs() < 1e-10, "{value} {truth}");
            }
        }
    }

    #[test]
    fn missing_angles_stay_missing_and_do_not_hide_a_turn() {
        let truth: Vec<f64> = (0..40).map(|k| 3.0 + 0.05 * f64::from(k)).collect();
        let mut logged: Vec<f64> = truth.iter().map(|a| wrapped(*a)).collect();
        // The angle passes pi in the hole; the first value is missing, too.
        logged[0] = f64::NAN;
        logged[1..6].fill(f64::NAN);
        let values = unwrapped(&logged[..]);
        assert!(values[..6].iter().all(|v| v.is_nan()));
        // Nothing before the hole says which turn it was.
        let turns = values[6] - truth[6];
        assert!(values[6..].iter().zip(&truth[6..]).all(|(v, a)| (v - a - turns).abs() < 1e-12));
        let mut logged: Vec<f64> = truth.iter().map(|a| wrapped(*a)).collect();
        logged[2..5].fill(f64::NAN);
        let values = unwrapped(&logged);
        assert!(values[5..].iter().zip(&truth[5..]).all(|(v, a)| (v - a).abs() < 1e-12));
    }

    #[test]
    fn an_angle_that_never_wraps_is_not_copied() {
        let angle = [0.0, 3.0, -0.1, 1.0];
        let mut column = Cow::from(&angle[..]);
        unwrap_angle(&mut column);
        assert!(matches!(column, Cow::Borrowed(_)));
    }

    #[test]
    fn a_difference_is_central_inside_one_sided_at_the_ends_and_zero_of_one_sample() {
        let parabola: Vec<f64> = (0..5).map(|k| f64::from(k * k)).collect();
        // Per sample: (4 - 0) / 2 at 1, and 1 and 16 - 9 at the ends; a sample takes half a second.
        assert_eq!(central_difference(&parabola, 1, 0.5), 4.0);
        assert_eq!(central_difference(&parabola, 0, 0.5), 2.0);
        assert_eq!(central_difference(&parabola, 4, 0.5), 14.0);
        assert_eq!(central_difference(&[3.0], 0, 0.5), 0.0);
    }

    #[test]
    fn spikes_are_taken_from_sensors_and_left_in_commands() {
        let flight = flight(400, |t, row| {
            row.position_ned_m[0] = (2.0 * t).sin();
            if (t - 2.0).abs() < 1e-6 {
                row.position_ned_m[0] = 500.0;
                row.command[2] = 1e6;
            }
        });
        let mut channels = Channels::new(&flight, false, false);
        let t = flight.required(Column::T);
        channels.take_out_spikes(t, 0.01);
        let outlier = Outlier { row: 200, t_s: t[200], column: Column::X, value: 500.0 };
        assert_eq!(channels.outliers, [outlier]);
        assert!(channels.columns[POSITION][200].is_nan());
        assert_eq!(channels.columns[COMMAND + 2][200], 1e6);
        let measured = channels.measured();
        assert!((0..400).all(|k| measured[k] == (k != 200)));
    }

    #[test]
    fn a_missing_battery_voltage_leaves_a_row_measured_and_a_missing_rotor_speed_does_not() {
        let mut flight = flight(10, |_, _| {});
        let with_hole = |hole: usize| {
            let mut values = vec![600.0; 10];
            values[hole] = f64::NAN;
            values
        };
        flight.replace(Column::Vbat, with_hole(3));
        for column in [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4] {
            flight.replace(column, with_hole(7));
        }
        let measured = Channels::new(&flight, false, false).measured();
        assert!((0..10).all(|k| measured[k] == (k != 7)), "{measured:?}");
    }

    /// Rows within one window of an end are not compared: there the velocity is a plain difference.
    #[test]
    fn the_velocity_of_raw_tracking_is_the_slope_of_the_position() {
        let prepared = prepared(300, |t, row| row.position_ned_m = [t * t, -2.0 * t, t * t * t]);
        let stretch = &prepared.stretches[0];
        for k in 15..285 {
            let t = stretch.time_s[k];
            let v = vector(&stretch.velocity_ned_m_s, k);
            let truth = nalgebra::Vector3::new(2.0 * t, -2.0, 3.0 * t * t);
            assert!((v - truth).norm() < 1e-9, "{t} s: {v:?}");
        }
        assert!(stretch.velocity_ned_m_s.iter().flatten().all(|v| v.is_finite()));
    }
}
