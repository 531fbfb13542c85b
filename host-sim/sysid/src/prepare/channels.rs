//! The channels of a log that preparation uses: mended as columns, then taken apart into stretches.

use std::borrow::Cow;

use flights::{Column, Flight, GAP_PERIODS};
use model::frames;

use crate::filter::{RegressionFilter, convolve};
use crate::prepare::columns::{BATTERY, COMMAND, EULER, OPTIONAL, POSITION, RATE};
use crate::prepare::grid::EvenGrid;
use crate::prepare::outliers;
use crate::prepare::stretch::{Stretch, vector};

/// The columns that preparation uses, in a fixed order.
pub(crate) struct Channels<'a> {
    /// As logged, unless something had to be mended.
    pub(crate) columns: Vec<Cow<'a, [f64]>>,
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
        let mut next = OPTIONAL;
        let mut add = |group: &[&'a [f64]]| {
            columns.extend(group.iter().map(|&c| Cow::from(c)));
            let at = next;
            next += group.len();
            at
        };
        let rotor = flight.group([Omega1, Omega2, Omega3, Omega4]).map(|g| add(&g));
        let imu = imu.then(|| flight.group([Ax, Ay, Az])).flatten().map(|g| add(&g));
        let velocity = velocity.then(|| flight.group([Vx, Vy, Vz])).flatten().map(|g| add(&g));
        Self { columns, rotor, imu, velocity }
    }

    /// Makes gross outliers of the sensors missing values (`outliers.rs`). Commands may be anything. Returns their number.
    pub(crate) fn take_out_spikes(&mut self, t: &[f64], period_s: f64) -> usize {
        let time: Vec<f64> = t.iter().map(|t| t / period_s).collect();
        let is_gap = |k: &usize| time[*k] - time[*k - 1] > GAP_PERIODS;
        let gaps: Vec<usize> = (1..time.len()).filter(is_gap).collect();
        let sensors = (POSITION..COMMAND).chain(BATTERY..self.columns.len());
        let rotors = self.rotor.map(|first| first..first + 4);
        let crowds = |column| !rotors.as_ref().is_some_and(|rotors| rotors.contains(&column));
        sensors
            .map(|column| outliers::take_out(&mut self.columns[column], &time, &gaps, crowds(column)))
            .sum()
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
