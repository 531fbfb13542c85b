//! From a flight as logged to even stretches of samples that a regression can use (4.2.3 to 4.2.5).
//!
//! What is done, in order:
//! 1. Gross outliers become missing values (`spikes.rs`). The log is cut into stretches without gaps; jitter is taken out by interpolation to an even grid; single missing
//!    values are bridged. What was done is counted in [`Prepared::notes`].
//! 2. Angles are unwrapped. The gyro's bias is taken out: its mean difference from the rates of the tracked attitude
//!    (the low frequencies of (4.6); the gyro keeps the rest). So is an accelerometer's, against an estimator's velocity.
//! 3. Rotor speeds: logged ones, or the motor map (4.10) at the smoothed battery voltage, then the first-order lag,
//!    exactly for commands held over a sample. The voltage is freed from noise in `battery.rs`; the causal filter of 4.2.5
//!    would be half a second late against the load that makes the voltage sag.
//!
//! What the rows are made of is in `rows.rs`.

use std::borrow::Cow;

use model::{Adjustments, Vehicle, frames};
use nalgebra::{Matrix3, Vector3};

use crate::filter::{RegressionFilter, compose, convolve, sum_of_products};
use crate::prepare::corrections::{Alignment, Trim};
use crate::prepare::{battery, outliers};
use flights::{Column, Flight, median_step};

/// Steps longer than this many periods are gaps: nothing is interpolated across.
const GAP_PERIODS: f64 = 3.5;
/// Missing values in a row that are bridged.
const BRIDGED_SAMPLES: usize = 3;
/// Missing battery voltages in a row that are bridged.
const BRIDGED_BATTERY_SAMPLES: usize = 200;
/// Steps that differ from the period by more than this part are jitter to be interpolated away.
const JITTER: f64 = 0.02;

/// Where the force rows' targets come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceTarget {
    /// Specific force of the IMU.
    Imu,
    /// Derivative of the logged velocity.
    Velocity,
    /// Second derivative of the position.
    Position,
}

impl ForceTarget {
    /// For people.
    pub const fn name(self) -> &'static str {
        match self {
            ForceTarget::Imu => "IMU specific force",
            ForceTarget::Velocity => "derivative of the logged velocity",
            ForceTarget::Position => "second derivative of the position",
        }
    }
}

/// A stretch of a flight without gaps, evenly sampled.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Time of each sample, s.
    pub time_s: Vec<f64>,
    /// Position of the tracked point NED, m.
    pub position_ned_m: [Vec<f64>; 3],
    /// Phi, theta, psi as logged, unwrapped.
    pub euler_rad: [Vec<f64>; 3],
    /// Inertial to body, from the attitude as logged.
    pub dcm: Vec<Matrix3<f64>>,
    /// Of the tracked point: logged, or the derivative of the position.
    pub velocity_ned_m_s: [Vec<f64>; 3],
    /// Gyro less its bias.
    pub rate_rad_s: [Vec<f64>; 3],
    /// Motor commands, in the unit of the vehicle file.
    pub command: [Vec<f64>; 4],
    /// Rotor speeds as logged, rad/s.
    pub logged_rotor_rad_s: Option<[Vec<f64>; 4]>,
    /// Battery voltage, V.
    pub battery_v: Vec<f64>,
    /// Specific force along the body axes, m/s^2.
    pub imu_m_s2: Option<[Vec<f64>; 3]>,
    /// Whether a sample's sensor values were all logged, not filled in: only those carry the sensors' noise.
    pub measured: Vec<bool>,
}

/// A flight made ready for regression.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// File name.
    pub name: String,
    /// Sampling period, s.
    pub period_s: f64,
    /// Where the force rows' targets come from.
    pub force_target: ForceTarget,
    /// Whether positions, velocities and attitudes are an estimator's output rather than raw tracking.
    pub has_logged_velocity: bool,
    /// Gyro bias found and taken out, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Accelerometer bias along x and y found and taken out, m/s^2; zero without an accelerometer and
    /// for raw tracking.
    pub accelerometer_bias_m_s2: [f64; 2],
    /// What was mended or left out, for people.
    pub notes: Vec<String>,
    /// The clock of the rotor samples against that of the state, where it was looked at.
    pub alignment: Option<Alignment>,
    /// Constant part of the targets that belongs to this flight and not to the craft; m/s^2, rad/s^2.
    pub trim: Option<Trim>,
    /// Standard deviation of the log's times about an even grid, s.
    pub jitter_s: f64,
    /// Stretches without gaps, in order.
    pub stretches: Vec<Stretch>,
    /// Smooths and differentiates signals at rows.
    pub filter: RegressionFilter,
    /// Samples at the ends of a stretch that give no rows.
    pub margin: usize,
}

/// One rotor over a stretch.
pub struct RotorTrack {
    /// Speed at every sample, rad/s.
    pub speed_rad_s: Vec<f64>,
    /// Mean speed between neighbouring samples, rad/s, one fewer.
    pub mean_rad_s: Vec<f64>,
}

impl Prepared {
    /// Prepares a flight of `vehicle`. Errors are a sentence for people; the caller names the file.
    pub fn new(flight: &Flight, vehicle: &Vehicle) -> Result<Self, PrepareError> {
        let t = flight.required(Column::T);
        let period_s = rounded_period(median_step(t));
        let filter = RegressionFilter::new(period_s);
        let mut notes = Vec::new();
        let imu = flight.group([Column::Ax, Column::Ay, Column::Az]);
        let velocity = flight.group([Column::Vx, Column::Vy, Column::Vz]);
        let force_target = match (&imu, &velocity) {
            (Some(_), _) => ForceTarget::Imu,
            (None, Some(_)) => ForceTarget::Velocity,
            (None, None) => ForceTarget::Position,
        };
        // Differentiating the position twice takes two windows.
        let windows = if force_target == ForceTarget::Position { 2 } else { 1 };
        let margin = windows * filter.half();
        let shortest = 2 * margin + filter.smooth.len();
        let mut channels = Channels::new(flight, imu.is_some(), velocity.is_some());
        let spikes = channels.take_out_spikes(t, period_s);
        if spikes > 0 {
            let plural = if spikes == 1 { "" } else { "s" };
            notes.push(format!("{spikes} outlier{plural} taken out"));
        }
        if channels.rotor.is_none() && !vehicle.can_map_commands() {
            return Err(PrepareError::NoRotorSpeeds);
        }
        let measured = channels.measured();
        let bridged = bridge(t, &mut channels.columns, period_s);
        let columns = &channels.columns;
        if bridged > 0 {
            notes.push(format!("{bridged} single missing values bridged"));
        }
        let mut stretches = Vec::new();
        let (mut dropped, mut jitter_s) = (0, 0.0);
        for range in unbroken(t, columns, period_s) {
            if range.len() < shortest {
                dropped += range.len();
                continue;
            }
            let even = even_grid(t, columns, &measured, range, period_s, &mut notes);
            jitter_s = f64::max(jitter_s, even.jitter_s);
            stretches.push(channels.stretch(even, period_s, &filter, velocity.is_some()));
        }
        if dropped > 0 {
            notes.push(format!(
                "{dropped} samples in stretches under {:.1} s left out",
                shortest as f64 * period_s
            ));
        }
        if stretches.is_empty() {
            let duration_s = t.last().unwrap_or(&0.0) - t.first().unwrap_or(&0.0);
            let needed_s = shortest as f64 * period_s;
            return Err(PrepareError::TooShort { samples: t.len(), duration_s, needed_s });
        }
        battery::steady(&mut stretches, vehicle, period_s);
        let gyro_bias_rad_s = remove_gyro_bias(&mut stretches, &filter);
        let has_logged_velocity = velocity.is_some();
        let accelerometer_bias_m_s2 = if has_logged_velocity {
            remove_accelerometer_bias(&mut stretches, &filter, vehicle.gravity)
        } else {
            [0.0; 2]
        };
        let mut prepared = Self {
            name: flight.name.clone(),
            period_s,
            force_target,
            has_logged_velocity,
            gyro_bias_rad_s,
            accelerometer_bias_m_s2,
            notes,
            alignment: None,
            trim: None,
            jitter_s,
            stretches,
            filter,
            margin,
        };
        prepared.notes.dedup();
        Ok(prepared)
    }

    /// All but the samples.
    pub fn without_stretches(&self) -> Self {
        Self {
            name: self.name.clone(),
            notes: self.notes.clone(),
            alignment: self.alignment.clone(),
            stretches: Vec::new(),
            filter: self.filter.clone(),
            ..*self
        }
    }

    /// Rows the flight gives.
    pub fn rows(&self) -> usize {
        self.stretches.iter().map(|s| s.time_s.len() - 2 * self.margin).sum()
    }

    /// Whether rotor speeds were measured, rather than computed from commands.
    pub fn has_rotor_speeds(&self) -> bool {
        self.stretches.iter().any(|s| s.logged_rotor_rad_s.is_some())
    }

    /// By how much the rotor samples (measured speeds or commands) come late against the state, s, where it is corrected.
    pub fn rotor_late_s(&self) -> f64 {
        self.alignment.as_ref().map_or(0.0, Alignment::corrected_s)
    }

    /// Mean battery voltage, V.
    pub fn mean_battery_v(&self) -> f64 {
        let (sum, count) = self
            .stretches
            .iter()
            .fold((0.0, 0), |(sum, n), s| (sum + s.battery_v.iter().sum::<f64>(), n + s.battery_v.len()));
        sum / count as f64
    }

    /// Rows at which stretches begin: neighbours across these are not neighbours in time.
    pub fn row_starts(&self) -> Vec<usize> {
        self.starts_of_rows(1)
    }

    /// Signals without their high frequencies; as they are at the ends, where the window does not fit.
    pub fn smooth(&self, signals: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        signals.each_ref().map(|signal| smoothed(signal, &self.filter.smooth))
    }
}

/// Why a flight cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// Too short.
    #[error(
        "has {samples} samples over {duration_s:.2} s; at least {needed_s:.2} s without gaps or missing values are needed"
    )]
    TooShort {
        /// Samples in the file.
        samples: usize,
        /// First to last time, s.
        duration_s: f64,
        /// Length without gaps that is needed, s.
        needed_s: f64,
    },
    /// Neither rotor speeds nor a map.
    #[error(
        "has no rotor speeds (omega1..4) and the vehicle file has no motor map; give [motors] command, voltage and offset, or map = \"identify\""
    )]
    NoRotorSpeeds,
    /// A user's formula has no value anywhere for long enough.
    #[error("has nothing left to use: {reason} nearly everywhere")]
    Undefined {
        /// Which formula.
        reason: String,
    },
}

impl Stretch {
    /// A part of it.
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        fn cut<const N: usize>(all: &[Vec<f64>; N], range: &std::ops::Range<usize>) -> [Vec<f64>; N] {
            all.each_ref().map(|one| one[range.clone()].to_vec())
        }
        Self {
            time_s: self.time_s[range.clone()].to_vec(),
            position_ned_m: cut(&self.position_ned_m, &range),
            euler_rad: cut(&self.euler_rad, &range),
            dcm: self.dcm[range.clone()].to_vec(),
            velocity_ned_m_s: cut(&self.velocity_ned_m_s, &range),
            rate_rad_s: cut(&self.rate_rad_s, &range),
            command: cut(&self.command, &range),
            logged_rotor_rad_s: self.logged_rotor_rad_s.as_ref().map(|all| cut(all, &range)),
            battery_v: self.battery_v[range.clone()].to_vec(),
            imu_m_s2: self.imu_m_s2.as_ref().map(|all| cut(all, &range)),
            measured: self.measured[range].to_vec(),
        }
    }

    /// Each rotor's speed. `late_s` is what the log's rotor samples come late: they are brought forward by it.
    pub fn rotors(
        &self,
        vehicle: &Vehicle,
        adjust: &Adjustments,
        period_s: f64,
        late_s: f64,
    ) -> [RotorTrack; 4] {
        let delay = (adjust.dead_time_s() - late_s) / period_s;
        if let Some(logged) = &self.logged_rotor_rad_s {
            return logged.each_ref().map(|speed| {
                let corrected: Vec<f64> = speed
                    .iter()
                    .zip(&self.battery_v)
                    .map(|(w, v)| adjust.corrected_speed_rad_s(*w, *v))
                    .collect();
                let speed_rad_s = if delay == 0.0 { corrected } else { shifted(&corrected, delay) };
                let mean_rad_s = speed_rad_s.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
                RotorTrack { speed_rad_s, mean_rad_s }
            });
        }
        let map = adjust.corrected_map(vehicle.rotor_map());
        let lag = adjust.lag_rad_s(vehicle.motors.lag);
        // The battery acts at the motor, without dead time and all the while: over a sample, the mean of its ends. Held as
        // it was at the sample's start, a sag would come half a sample late and show as drag.
        let by_voltage: Vec<f64> = (0..self.battery_v.len())
            .map(|k| {
                let next = self.battery_v.get(k + 1).unwrap_or(&self.battery_v[k]);
                map.voltage * 0.5 * (self.battery_v[k] + next)
            })
            .collect();
        let by_voltage = lagged(&by_voltage, lag, -late_s / period_s, period_s);
        self.command.each_ref().map(|command| {
            let commanded: Vec<f64> = command.iter().map(|c| map.command * c + map.offset).collect();
            lagged(&commanded, lag, delay, period_s).plus(&by_voltage)
        })
    }
}

impl RotorTrack {
    /// The sum of two parts of the speed; a rotor does not turn backwards.
    fn plus(mut self, other: &Self) -> Self {
        let add = |to: &mut [f64], part: &[f64]| {
            to.iter_mut().zip(part).for_each(|(speed, part)| *speed = (*speed + part).max(0.0));
        };
        add(&mut self.speed_rad_s, &other.speed_rad_s);
        add(&mut self.mean_rad_s, &other.mean_rad_s);
        self
    }
}

/// Response of a first-order lag (at once, without one) to commands held over a sample, `delay` samples late. Exact: between
/// samples the response is an exponential.
fn lagged(commanded: &[f64], lag_rad_s: Option<f64>, delay: f64, period_s: f64) -> RotorTrack {
    // At once: an exponential that has died out within any part of a sample.
    let lag = lag_rad_s.unwrap_or(1e6 / period_s);
    let decay = |time_s: f64| (-lag * time_s).exp();
    let over_sample = decay(period_s);
    let mut at_samples = Vec::with_capacity(commanded.len());
    let mut now = commanded.first().copied().unwrap_or(0.0);
    for &target in commanded {
        at_samples.push(now);
        now = target * (1.0 - over_sample) + now * over_sample;
    }
    if delay == 0.0 {
        let weight = (1.0 - over_sample) / (lag * period_s);
        let mean_of = |(now, target): (&f64, &f64)| target + (now - target) * weight;
        let steps = commanded.len().saturating_sub(1);
        let mean_rad_s = at_samples.iter().zip(commanded).take(steps).map(mean_of).collect();
        return RotorTrack { speed_rad_s: at_samples, mean_rad_s };
    }
    let whole = delay.floor();
    // The sample before the moment asked for, and the time from it to that moment.
    let (back, part_s) = if delay == whole {
        (whole as isize, 0.0)
    } else {
        (whole as isize + 1, (1.0 - delay + whole) * period_s)
    };
    let last = commanded.len() as isize - 1;
    let clamped = |k: isize| k.clamp(0, last) as usize;
    let part_decay = decay(part_s);
    let speed_rad_s = (0..=last)
        .map(|k| {
            let from = clamped(k - back);
            commanded[from] + (at_samples[from] - commanded[from]) * part_decay
        })
        .collect();
    // From the moment to the next sample under one command, then as long under the next one as makes a period.
    let (first_s, first_weight, second_weight) =
        (period_s - part_s, (part_decay - over_sample) / lag, (1.0 - part_decay) / lag);
    let mean_rad_s = (0..last)
        .map(|k| {
            let (a, b) = (clamped(k - back), clamped(k - back + 1));
            let first = commanded[a] * first_s + (at_samples[a] - commanded[a]) * first_weight;
            let second = commanded[b] * part_s + (at_samples[b] - commanded[b]) * second_weight;
            (first + second) / period_s
        })
        .collect();
    RotorTrack { speed_rad_s, mean_rad_s }
}

/// A signal `delay` samples late (early if negative), along cubic Hermite arcs.
fn shifted(signal: &[f64], delay: f64) -> Vec<f64> {
    let last = signal.len() as isize - 1;
    let value = |k: isize| signal[k.clamp(0, last) as usize];
    (0..=last)
        .map(|k| {
            let place = k as f64 - delay;
            let at = place.floor();
            let s = place - at;
            let at = at as isize;
            let [a, b, c, d] = [value(at - 1), value(at), value(at + 1), value(at + 2)];
            let (slope_b, slope_c) = (0.5 * (c - a), 0.5 * (d - b));
            let (s2, s3) = (s * s, s * s * s);
            (2.0 * s3 - 3.0 * s2 + 1.0) * b
                + (s3 - 2.0 * s2 + s) * slope_b
                + (3.0 * s2 - 2.0 * s3) * c
                + (s3 - s2) * slope_c
        })
        .collect()
}

fn central_difference(signal: &[f64], k: usize, period_s: f64) -> f64 {
    let (before, after) = (k.saturating_sub(1), (k + 1).min(signal.len() - 1));
    (signal[after] - signal[before]) / ((after - before).max(1) as f64 * period_s)
}

pub(crate) fn vector(parts: &[Vec<f64>; 3], k: usize) -> Vector3<f64> {
    Vector3::new(parts[0][k], parts[1][k], parts[2][k])
}

pub(crate) fn subtract(parts: &mut [Vec<f64>; 3], k: usize, amount: Vector3<f64>) {
    parts.iter_mut().zip(amount.iter()).for_each(|(part, a)| part[k] -= a);
}

/// The smoothed signal, and the signal itself where the window does not fit.
pub fn smoothed(signal: &[f64], taps: &[f64]) -> Vec<f64> {
    convolve(signal, taps, |k| signal[k])
}

/// A period within 0.1 % of a whole number of tenths of a millisecond is that number: clocks tick evenly.
fn rounded_period(period_s: f64) -> f64 {
    let rounded = (period_s * 1e4).round() / 1e4;
    if (rounded - period_s).abs() < 1e-3 * period_s { rounded } else { period_s }
}

/// The columns that preparation uses, in a fixed order.
struct Channels<'a> {
    /// As logged, unless something had to be mended.
    columns: Vec<Cow<'a, [f64]>>,
    rotor: Option<usize>,
    imu: Option<usize>,
    velocity: Option<usize>,
}

const POSITION: usize = 0;
const EULER: usize = 3;
const RATE: usize = 6;
const COMMAND: usize = 9;
const BATTERY: usize = 13;
const OPTIONAL: usize = 14;

impl<'a> Channels<'a> {
    fn new(flight: &'a Flight, imu: bool, velocity: bool) -> Self {
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

    /// Makes gross outliers of the sensors missing values (`spikes.rs`). Commands may be anything. Returns their number.
    fn take_out_spikes(&mut self, t: &[f64], period_s: f64) -> usize {
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
    fn measured(&self) -> Vec<bool> {
        let mut all = vec![true; self.columns[0].len()];
        for column in (POSITION..COMMAND).chain(OPTIONAL..self.columns.len()) {
            all.iter_mut().zip(self.columns[column].iter()).for_each(|(all, v)| *all &= v.is_finite());
        }
        all
    }

    fn stretch(
        &self,
        mut even: EvenGrid,
        period_s: f64,
        filter: &RegressionFilter,
        logged_velocity: bool,
    ) -> Stretch {
        let position_ned_m = even.take(POSITION);
        let euler = even.take(EULER);
        let dcm = (0..even.time_s.len()).map(|k| frames::dcm_from_euler(vector(&euler, k))).collect();
        let velocity_ned_m_s = match self.velocity.filter(|_| logged_velocity) {
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

/// Bridges runs of up to [`BRIDGED_SAMPLES`] missing values: along cubic arcs, as a straight line under a turn would be low by
/// more than the noise; the battery and commands, which are held, by a straight line. Nothing but the battery is bridged across a gap
/// in time. Returns the number of values filled in, the battery's aside.
fn bridge(t: &[f64], columns: &mut [Cow<[f64]>], period_s: f64) -> usize {
    let has_gap = |rows: &[usize]| (rows[0]..rows[1]).any(|k| t[k + 1] - t[k] > GAP_PERIODS * period_s);
    let mut count = 0;
    for (index, column) in columns.iter_mut().enumerate() {
        // A battery is slow and often logged at a tenth of the rate.
        let longest = if index == BATTERY { BRIDGED_BATTERY_SAMPLES } else { BRIDGED_SAMPLES };
        // Without leaving early, which is quicker where all are there.
        if column.iter().fold(true, |all, v| all & v.is_finite()) {
            continue;
        }
        let there: Vec<usize> = (0..column.len()).filter(|&k| column[k].is_finite()).collect();
        let (times, values): (Vec<f64>, Vec<f64>) = there.iter().map(|&k| (t[k], column[k])).unzip();
        let straight = (COMMAND..=BATTERY).contains(&index);
        let column = column.to_mut();
        for (at, ends) in there.windows(2).enumerate() {
            let missing = ends[1] - ends[0] - 1;
            if missing == 0 || missing > longest || (index != BATTERY && has_gap(ends)) {
                continue;
            }
            for k in ends[0] + 1..ends[1] {
                column[k] = if straight {
                    let part = (t[k] - times[at]) / (times[at + 1] - times[at]);
                    values[at] + (values[at + 1] - values[at]) * part
                } else {
                    hermite(&times, &values, at, t[k])
                };
                count += usize::from(index != BATTERY);
            }
        }
    }
    count
}

/// Ranges of samples without gaps in time and without missing values.
fn unbroken(t: &[f64], columns: &[Cow<[f64]>], period_s: f64) -> Vec<std::ops::Range<usize>> {
    let mut complete = vec![true; t.len()];
    for column in columns {
        complete.iter_mut().zip(column.iter()).for_each(|(all, v)| *all &= v.is_finite());
    }
    let mut ranges = Vec::new();
    let mut start = None;
    for k in 0..t.len() {
        let gap = k > 0 && t[k] - t[k - 1] > GAP_PERIODS * period_s;
        if let Some(from) = start
            && (gap || !complete[k])
        {
            ranges.push(from..k);
            start = None;
        }
        if complete[k] && start.is_none() {
            start = Some(k);
        }
    }
    if let Some(from) = start {
        ranges.push(from..t.len());
    }
    ranges
}

struct EvenGrid {
    time_s: Vec<f64>,
    /// Standard deviation of the samples' times about the grid, s.
    jitter_s: f64,
    columns: Vec<Vec<f64>>,
    measured: Vec<bool>,
}

impl EvenGrid {
    /// Columns from `first` on, moved out.
    fn take<const N: usize>(&mut self, first: usize) -> [Vec<f64>; N] {
        std::array::from_fn(|i| std::mem::take(&mut self.columns[first + i]))
    }
}

/// The samples on an even grid: as they are when the log is even, else interpolated (commands are held, the rest runs
/// along cubic Hermite arcs).
fn even_grid(
    t: &[f64],
    columns: &[Cow<[f64]>],
    measured: &[bool],
    range: std::ops::Range<usize>,
    period_s: f64,
    notes: &mut Vec<String>,
) -> EvenGrid {
    let times = &t[range.clone()];
    let uneven = times.windows(2).filter(|w| ((w[1] - w[0]) / period_s - 1.0).abs() > JITTER).count();
    if uneven == 0 {
        return EvenGrid {
            time_s: times.to_vec(),
            jitter_s: 0.0,
            columns: columns.iter().map(|c| c[range.clone()].to_vec()).collect(),
            measured: measured[range].to_vec(),
        };
    }
    notes.push(format!("{uneven} uneven sampling steps interpolated to {:.1} Hz", 1.0 / period_s));
    let (start, jitter_s) = grid_start(times, period_s);
    let count = ((times[times.len() - 1] - start) / period_s).floor() as usize + 1;
    let grid: Vec<f64> = (0..count).map(|k| start + k as f64 * period_s).collect();
    // The sample before each moment of the grid.
    let mut at = 0;
    let before: Vec<usize> = grid
        .iter()
        .map(|&time| {
            while at + 2 < times.len() && times[at + 1] <= time {
                at += 1;
            }
            at
        })
        .collect();
    let measured = before.iter().map(|&at| {
        let lost_rows = times[at + 1] - times[at] > 1.5 * period_s;
        !lost_rows && measured[range.start + at] && measured[range.start + at + 1]
    });
    let measured = measured.collect();
    let columns = columns.iter().enumerate().map(|(index, column)| {
        let values = &column[range.clone()];
        let held = (COMMAND..BATTERY).contains(&index);
        let at_time = |(&time, &at): (&f64, &usize)| {
            if held {
                // A row that is a little late tells of a command that has already been there.
                values[at + usize::from(times[at + 1] - time < 0.5 * period_s)]
            } else {
                hermite(times, values, at, time)
            }
        };
        grid.iter().zip(&before).map(at_time).collect()
    });
    EvenGrid { time_s: grid.clone(), jitter_s, columns: columns.collect(), measured }
}

/// Where an even grid starts that lies in the middle of jittering times: one that began at a late row would be late throughout,
/// and every command on it. With the standard deviation of the times about it.
fn grid_start(times: &[f64], period_s: f64) -> (f64, f64) {
    let off = |t: &f64| {
        let periods = (t - times[0]) / period_s;
        periods - periods.round()
    };
    let count = times.len() as f64;
    let mean = times.iter().map(off).sum::<f64>() / count;
    let variance = times.iter().map(|t| (off(t) - mean).powi(2)).sum::<f64>() / count;
    let start = times[0] + period_s * mean;
    (if start < times[0] { start + period_s } else { start }, period_s * variance.sqrt())
}

/// Cubic Hermite interpolation between samples `at` and `at + 1`, with the slopes of the parabolas through each of them and its
/// neighbours: exact for a parabola however the samples lie, and in the middle of even ones a cubic through four.
fn hermite(t: &[f64], y: &[f64], at: usize, time: f64) -> f64 {
    let secant = |k: usize| (y[k + 1] - y[k]) / (t[k + 1] - t[k]);
    let slope = |k: usize| {
        if k == 0 {
            return secant(0);
        }
        if k + 1 == t.len() {
            return secant(k - 1);
        }
        let (before, after) = (t[k] - t[k - 1], t[k + 1] - t[k]);
        (secant(k - 1) * after + secant(k) * before) / (before + after)
    };
    let step = t[at + 1] - t[at];
    let s = (time - t[at]) / step;
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * y[at]
        + (s3 - 2.0 * s2 + s) * step * slope(at)
        + (3.0 * s2 - 2.0 * s3) * y[at + 1]
        + (s3 - s2) * step * slope(at + 1)
}

/// Takes out the mean difference between the accelerometer and the accelerations of the tracked motion over the whole
/// flight, along x and y: there a bias stands for a drag, a wind or a cable that is not there. Forces move the craft and
/// the accelerometer alike, so none of them is taken out with it. Along z the scale of the thrust hides it. Only for logs
/// of an estimator, which levels its attitude by the motion: of raw tracking the same difference is the tilt of the
/// tracked frame.
fn remove_accelerometer_bias(
    stretches: &mut [Stretch],
    filter: &RegressionFilter,
    gravity_m_s2: f64,
) -> [f64; 2] {
    let half = 2 * filter.half();
    let gravity = Vector3::new(0.0, 0.0, gravity_m_s2);
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for stretch in stretches.iter() {
        let Some(imu) = &stretch.imu_m_s2 else { continue };
        let at = |signal: &[Vec<f64>; 3], k: usize, taps: &[f64]| {
            Vector3::from(signal.each_ref().map(|s| sum_of_products(&s[k - taps.len() / 2..], taps)))
        };
        for k in (half..stretch.time_s.len() - half).step_by(10) {
            let moved = at(&stretch.velocity_ned_m_s, k, &filter.derivative) - gravity;
            let difference = at(imu, k, &filter.smooth) - stretch.dcm[k] * moved;
            if difference.iter().all(|d| d.is_finite()) {
                sum += difference;
                count += 1.0;
            }
        }
    }
    let bias = if count > 0.0 { [sum.x / count, sum.y / count] } else { [0.0; 2] };
    for stretch in stretches {
        for (signal, b) in stretch.imu_m_s2.iter_mut().flatten().zip(bias) {
            signal.iter_mut().for_each(|value| *value -= b);
        }
    }
    bias
}

/// Takes out the mean difference between the gyro and the rates of the smoothed attitude over the whole flight.
fn remove_gyro_bias(stretches: &mut [Stretch], filter: &RegressionFilter) -> [f64; 3] {
    let half = filter.half();
    let slope_of_smoothed = compose(&filter.smooth, &filter.derivative);
    let mut sum = Vector3::zeros();
    let mut count = 0.0;
    for stretch in stretches.iter() {
        let at = |k: usize, taps: &[f64]| {
            let start = k - taps.len() / 2;
            Vector3::from(stretch.euler_rad.each_ref().map(|angle| sum_of_products(&angle[start..], taps)))
        };
        // A mean needs no more than ten values a second.
        for k in (2 * half..stretch.time_s.len() - 2 * half).step_by(10) {
            let rates = frames::body_rates_from_euler(at(k, &filter.smooth), at(k, &slope_of_smoothed));
            let difference = vector(&stretch.rate_rad_s, k) - rates;
            if difference.iter().all(|d| d.is_finite()) {
                sum += difference;
                count += 1.0;
            }
        }
    }
    let bias = if count > 0.0 { sum / count } else { Vector3::zeros() };
    for stretch in stretches {
        for (rate, b) in stretch.rate_rad_s.iter_mut().zip(bias.iter()) {
            rate.iter_mut().for_each(|r| *r -= b);
        }
    }
    bias.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every value that can be missing comes back: a cubic's in the middle of four even samples, a parabola's anywhere, a straight
    /// line's of what is held.
    #[test]
    fn missing_values_come_back() {
        let even: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        let uneven: Vec<f64> = even.iter().map(|t| t + 0.002 * (700.0 * t).sin()).collect();
        let cubic = |t: f64| 1.0 + t * (3.0 + t * (20.0 - 90.0 * t));
        let parabola = |t: f64| 1.0 + t * (3.0 - 20.0 * t);
        let line = |t: f64| 1.0 - 3.0 * t;
        let check = |t: &[f64], column: usize, missing: &[usize], curve: &dyn Fn(f64) -> f64| {
            let mut columns: Vec<Cow<[f64]>> = vec![Cow::Owned(t.to_vec()); OPTIONAL];
            let with_holes = |(k, t): (usize, &f64)| if missing.contains(&k) { f64::NAN } else { curve(*t) };
            columns[column] = t.iter().enumerate().map(with_holes).collect::<Vec<f64>>().into();
            let filled = bridge(t, &mut columns, 0.01);
            assert_eq!(filled, if column == BATTERY { 0 } else { missing.len() });
            for (value, t) in columns[column].iter().zip(t) {
                assert!((value - curve(*t)).abs() < 1e-12, "column {column}, {t} s: {value}");
            }
        };
        check(&even, POSITION, &[7, 20, 30], &cubic);
        check(&uneven, RATE, &[7, 8, 9, 20, 30, 31], &parabola);
        check(&uneven, COMMAND, &[7, 8, 20], &line);
        check(&uneven, BATTERY, &[7, 8, 20, 21, 22, 23, 24, 25], &line);
    }

    #[test]
    fn nothing_is_bridged_across_a_gap_or_over_four_values() {
        let mut t: Vec<f64> = (0..40).map(|k| 0.01 * f64::from(k)).collect();
        t[20..].iter_mut().for_each(|t| *t += 2.0);
        let mut columns: Vec<Cow<[f64]>> = vec![Cow::Owned(t.clone()); OPTIONAL];
        for k in [5, 6, 7, 8, 19] {
            columns[RATE].to_mut()[k] = f64::NAN;
        }
        assert_eq!(bridge(&t, &mut columns, 0.01), 0);
        assert_eq!(columns[RATE].iter().filter(|v| v.is_nan()).count(), 5);
    }
}
