//! From a flight as logged to rows of a regression (4.2.3 to 4.2.5).
//!
//! What is done, in order:
//! 1. The log is cut into stretches without gaps; jitter is taken out by interpolation to an even grid; single missing
//!    values are bridged. What was done is counted in [`Prepared::notes`].
//! 2. Angles are unwrapped. The gyro's bias is taken out: its mean difference from the rates of the tracked attitude
//!    (the low frequencies of (4.6); the gyro keeps the rest).
//! 3. Rotor speeds: logged ones, or the motor map (4.10) at the smoothed battery voltage, then the first-order lag,
//!    exactly for commands held over a sample. The voltage is smoothed without lag, over a tenth of a
//!    second; the causal filter of 4.2.5 would be half a second late against the load that makes the voltage sag, and a
//!    long window would take the sag away.
//! 4. Targets. Force rows: specific force in body axes, from the IMU if logged, else from the derivative of the logged
//!    velocity, else from the twice differentiated position. Moment rows: derivative of the body rates.
//! 5. Regressors are formed from the mean state between two samples, which for rotors is that of their exponential:
//!    what a velocity gains from sample to sample is the mean acceleration between them, not that at either end.
//! 6. Every regressor goes through the same filter as its target ([`crate::filter`] says why). Accelerations that come
//!    from the tracker are formed in the inertial frame, so regressors of the force rows are turned there with the
//!    attitude of each sample, filtered, and turned back with the attitude of the row.
//!
//! The tracked point is brought to the centre of mass (4.7) before it is differentiated.

use model::{Adjustments, Axis, Effect, Model, Plant, RotorMap, SampleInput, Sink, Vehicle, frames};
use nalgebra::{Matrix3, Vector3};

use crate::filter::{RegressionFilter, convolve, convolve_between};
use crate::flight::{Column, Flight, median_step};

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
pub(crate) struct Stretch {
    pub(crate) time_s: Vec<f64>,
    pub(crate) position_ned_m: [Vec<f64>; 3],
    /// Smoothed phi, theta, psi, unwrapped; as logged at the ends, where the window does not fit.
    pub(crate) euler_rad: [Vec<f64>; 3],
    /// Inertial to body, from the attitude as logged.
    pub(crate) dcm: Vec<Matrix3<f64>>,
    /// Of the tracked point: logged, or the derivative of the position.
    pub(crate) velocity_ned_m_s: [Vec<f64>; 3],
    /// Gyro less its bias.
    pub(crate) rate_rad_s: [Vec<f64>; 3],
    pub(crate) smooth_rate_rad_s: [Vec<f64>; 3],
    command: [Vec<f64>; 4],
    logged_rotor_rad_s: Option<[Vec<f64>; 4]>,
    pub(crate) battery_v: Vec<f64>,
    pub(crate) imu_m_s2: Option<[Vec<f64>; 3]>,
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
    /// What was mended or left out, for people.
    pub notes: Vec<String>,
    pub(crate) stretches: Vec<Stretch>,
    pub(crate) filter: RegressionFilter,
    /// Samples at the ends of a stretch that give no rows.
    pub(crate) margin: usize,
}

/// States of a stretch.
pub(crate) struct States {
    /// At its samples.
    pub(crate) at: Vec<SampleInput>,
    /// Mean states between neighbouring samples, one fewer.
    pub(crate) between: Vec<SampleInput>,
}

/// One rotor over a stretch.
pub(crate) struct RotorTrack {
    /// Speed at every sample, rad/s.
    pub(crate) speed_rad_s: Vec<f64>,
    /// Mean speed between neighbouring samples, rad/s, one fewer.
    pub(crate) mean_rad_s: Vec<f64>,
}

/// A column of the regression over one flight: the six axes, each a vector over the rows or nothing.
#[derive(Debug, Clone, Default)]
pub(crate) struct RowColumn {
    pub(crate) axes: [Option<Vec<f64>>; 6],
}

/// What is known at the rows besides the regression, to judge residuals by.
#[derive(Debug, Clone, Default)]
pub struct Conditions {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Position NED, m.
    pub position_ned_m: [Vec<f64>; 3],
    /// Body velocity, m/s.
    pub velocity_m_s: [Vec<f64>; 3],
    /// Body rates, rad/s.
    pub rate_rad_s: [Vec<f64>; 3],
    /// Phi, theta, psi, rad.
    pub euler_rad: [Vec<f64>; 3],
    /// Mean rotor speed, rad/s.
    pub mean_rotor_rad_s: Vec<f64>,
    /// Battery voltage, V.
    pub battery_v: Vec<f64>,
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
        if channels.rotor.is_none() && !vehicle.can_map_commands() {
            return Err(PrepareError::NoRotorSpeeds);
        }
        let bridged = bridge(&mut channels.columns);
        let columns = &channels.columns;
        if bridged > 0 {
            notes.push(format!("{bridged} single missing values bridged"));
        }
        let mut stretches = Vec::new();
        let mut dropped = 0;
        for range in unbroken(t, columns, period_s) {
            if range.len() < shortest {
                dropped += range.len();
                continue;
            }
            let even = even_grid(t, columns, range, period_s, &mut notes);
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
        let gyro_bias_rad_s = remove_gyro_bias(&mut stretches, &filter);
        for stretch in &mut stretches {
            stretch.smooth_rate_rad_s = stretch.rate_rad_s.clone().map(|rate| smoothed(rate, &filter));
        }
        let has_logged_velocity = velocity.is_some();
        let mut prepared = Self {
            name: flight.name.clone(),
            period_s,
            force_target,
            has_logged_velocity,
            gyro_bias_rad_s,
            notes,
            stretches,
            filter,
            margin,
        };
        prepared.notes.dedup();
        Ok(prepared)
    }

    /// Rows the flight gives.
    pub fn rows(&self) -> usize {
        self.stretches.iter().map(|s| s.time_s.len() - 2 * self.margin).sum()
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
    pub(crate) fn row_starts(&self) -> Vec<usize> {
        let mut starts = Vec::new();
        let mut row = 0;
        for stretch in &self.stretches {
            starts.push(row);
            row += stretch.time_s.len() - 2 * self.margin;
        }
        starts
    }

    /// The states of a stretch under `adjust`, at its samples and between them.
    pub(crate) fn states(&self, stretch: &Stretch, vehicle: &Vehicle, adjust: &Adjustments) -> States {
        let lever = Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m;
        let rotor = stretch.rotors(vehicle, adjust, self.period_s);
        let turning = stretch.rate_rad_s.each_ref().map(|rate| central_difference(rate, self.period_s));
        let at: Vec<SampleInput> = (0..stretch.time_s.len())
            .map(|k| {
                let dcm = adjust.true_dcm(&stretch.dcm[k]);
                let rate = vector(&stretch.rate_rad_s, k);
                let mut velocity = dcm * vector(&stretch.velocity_ned_m_s, k);
                let mut position = vector(&stretch.position_ned_m, k);
                if lever != Vector3::zeros() {
                    velocity -= rate.cross(&lever);
                    position -= dcm.tr_mul(&lever);
                }
                SampleInput {
                    position_ned_m: position,
                    dcm,
                    velocity_m_s: velocity,
                    rate_rad_s: rate,
                    angular_acceleration_rad_s2: vector(&turning, k),
                    rotor_rad_s: std::array::from_fn(|i| rotor[i].speed_rad_s[k]),
                    rotor_acceleration_rad_s2: [0.0; 4],
                    battery_v: stretch.battery_v[k],
                }
            })
            .collect();
        let between = at
            .windows(2)
            .enumerate()
            .map(|(k, pair)| {
                let (a, b) = (&pair[0], &pair[1]);
                SampleInput {
                    position_ned_m: 0.5 * (a.position_ned_m + b.position_ned_m),
                    // The mean of two attitudes a hundredth of a radian apart is a rotation to a part in 10^5.
                    dcm: 0.5 * (a.dcm + b.dcm),
                    velocity_m_s: 0.5 * (a.velocity_m_s + b.velocity_m_s),
                    rate_rad_s: 0.5 * (a.rate_rad_s + b.rate_rad_s),
                    angular_acceleration_rad_s2: (b.rate_rad_s - a.rate_rad_s) / self.period_s,
                    rotor_rad_s: std::array::from_fn(|i| rotor[i].mean_rad_s[k]),
                    rotor_acceleration_rad_s2: std::array::from_fn(|i| {
                        (rotor[i].speed_rad_s[k + 1] - rotor[i].speed_rad_s[k]) / self.period_s
                    }),
                    battery_v: 0.5 * (a.battery_v + b.battery_v),
                }
            })
            .collect();
        States { at, between }
    }

    /// Targets of the six axes over the rows.
    pub(crate) fn targets(&self, vehicle: &Vehicle, adjust: &Adjustments) -> [Vec<f64>; 6] {
        let mut targets: [Vec<f64>; 6] = Default::default();
        for stretch in &self.stretches {
            let inside = self.margin..stretch.time_s.len() - self.margin;
            for (target, values) in targets.iter_mut().zip(self.force_targets(stretch, vehicle, adjust)) {
                target.extend_from_slice(&values[inside.clone()]);
            }
            for (axis, rate) in stretch.rate_rad_s.iter().enumerate() {
                let acceleration = convolve(rate, &self.filter.derivative);
                targets[3 + axis].extend_from_slice(&acceleration[inside.clone()]);
            }
        }
        targets
    }

    /// Specific force in body axes at every sample of a stretch (NaN in the margins).
    fn force_targets(&self, stretch: &Stretch, vehicle: &Vehicle, adjust: &Adjustments) -> [Vec<f64>; 3] {
        let smooth = |signal: &Vec<f64>| convolve(signal, &self.filter.smooth);
        let slope = |signal: &Vec<f64>| convolve(signal, &self.filter.derivative);
        let lever = Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m;
        let acceleration_ned = match (self.force_target, &stretch.imu_m_s2) {
            (ForceTarget::Imu, Some(imu)) => return imu.each_ref().map(smooth),
            (ForceTarget::Velocity, _) => {
                let mut velocity = stretch.velocity_ned_m_s.clone();
                if lever != Vector3::zeros() {
                    for k in 0..stretch.time_s.len() {
                        let swing = vector(&stretch.rate_rad_s, k).cross(&lever);
                        subtract(&mut velocity, k, adjust.true_dcm(&stretch.dcm[k]).tr_mul(&swing));
                    }
                }
                velocity.each_ref().map(slope)
            }
            _ => {
                let mut position = stretch.position_ned_m.clone();
                if lever != Vector3::zeros() {
                    for k in 0..stretch.time_s.len() {
                        subtract(&mut position, k, adjust.true_dcm(&stretch.dcm[k]).tr_mul(&lever));
                    }
                }
                position.each_ref().map(|p| slope(&slope(p)))
            }
        };
        let mut force: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(stretch.time_s.len()));
        for k in 0..stretch.time_s.len() {
            let a = vector(&acceleration_ned, k) - Vector3::new(0.0, 0.0, vehicle.gravity);
            let body = adjust.true_dcm(&stretch.dcm[k]) * a;
            force.iter_mut().zip(body.iter()).for_each(|(f, b)| f.push(*b));
        }
        force
    }

    /// The states that force rows and moment rows are formed from: what an IMU measures is a value at a sample, what
    /// comes from differences is a mean between samples.
    pub(crate) fn force_states<'a>(&self, states: &'a States) -> &'a [SampleInput] {
        if self.force_target == ForceTarget::Imu { &states.at } else { &states.between }
    }

    /// Passes values of the six axes through the filters of their targets and appends the rows. Force axes are given at
    /// [`Self::force_states`], moment axes between samples. Axes without values stay without.
    pub(crate) fn append_rows(
        &self,
        states: &States,
        mut axes: [Option<Vec<f64>>; 6],
        rows: &mut [Option<Vec<f64>>; 6],
        rows_before: usize,
    ) {
        let length = states.at.len();
        let inside = self.margin..length - self.margin;
        if axes[..3].iter().any(Option::is_some) && self.force_target != ForceTarget::Imu {
            let mut ned: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(length));
            for (k, state) in states.between.iter().enumerate() {
                let body = Vector3::from_fn(|i, _| axes[i].as_ref().map_or(0.0, |a| a[k]));
                let turned = state.dcm.tr_mul(&body);
                ned.iter_mut().zip(turned.iter()).for_each(|(n, t)| n.push(*t));
            }
            let twice = self.force_target == ForceTarget::Position;
            let ned = ned.map(|signal| {
                let once = convolve_between(&signal, &self.filter.between);
                if twice { convolve(&once, &self.filter.matched) } else { once }
            });
            let mut body: [Vec<f64>; 3] = std::array::from_fn(|_| vec![f64::NAN; length]);
            for k in inside.clone() {
                let turned = states.at[k].dcm * vector(&ned, k);
                body.iter_mut().zip(turned.iter()).for_each(|(b, t)| b[k] = *t);
            }
            for (slot, values) in axes.iter_mut().zip(body) {
                *slot = Some(values);
            }
        } else {
            for slot in axes[..3].iter_mut().flatten() {
                *slot = convolve(slot, &self.filter.smooth);
            }
        }
        for slot in axes[3..].iter_mut().flatten() {
            *slot = convolve_between(slot, &self.filter.between);
        }
        for (row, values) in rows.iter_mut().zip(axes) {
            if let Some(values) = values {
                let row = row.get_or_insert_with(|| vec![0.0; rows_before]);
                row.extend_from_slice(&values[inside.clone()]);
            } else if let Some(row) = row {
                row.resize(rows_before + inside.len(), 0.0);
            }
        }
    }

    /// The regression columns of linear effects, one for each coefficient in order.
    pub(crate) fn columns(&self, effects: &[Effect], model: &Model) -> Vec<RowColumn> {
        let plant = Plant::new(model);
        let (vehicle, adjust) = (&model.vehicle, plant.adjustments());
        let count: usize = effects.iter().map(|e| coefficient_count(*e)).sum();
        let mut result = vec![RowColumn::default(); count];
        let mut rows_before = 0;
        for stretch in &self.stretches {
            let states = self.states(stretch, vehicle, adjust);
            let mut raw = RawColumns::new(count, &plant, &states.between, effects);
            if self.force_target == ForceTarget::Imu {
                raw.take_forces(RawColumns::new(count, &plant, &states.at, effects));
            }
            for (column, axes) in result.iter_mut().zip(raw.values) {
                self.append_rows(&states, axes, &mut column.axes, rows_before);
            }
            rows_before += stretch.time_s.len() - 2 * self.margin;
        }
        result
    }

    /// What the residuals can be judged by, at the rows.
    pub fn conditions(&self, vehicle: &Vehicle, adjust: &Adjustments) -> Conditions {
        let mut c = Conditions::default();
        for stretch in &self.stretches {
            let inputs = self.states(stretch, vehicle, adjust).at;
            for (k, input) in inputs.iter().enumerate().take(inputs.len() - self.margin).skip(self.margin) {
                c.time_s.push(stretch.time_s[k]);
                for i in 0..3 {
                    c.position_ned_m[i].push(input.position_ned_m[i]);
                    c.velocity_m_s[i].push(input.velocity_m_s[i]);
                    c.rate_rad_s[i].push(stretch.smooth_rate_rad_s[i][k]);
                    c.euler_rad[i].push(stretch.euler_rad[i][k]);
                }
                c.mean_rotor_rad_s.push(input.rotor_rad_s.iter().sum::<f64>() / 4.0);
                c.battery_v.push(input.battery_v);
            }
        }
        c
    }
}

/// Why a flight cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
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
}

/// Linear coefficients of an effect: none for an adjusting one.
pub(crate) fn coefficient_count(effect: Effect) -> usize {
    if effect.info().kind == model::Kind::Adjusting { 0 } else { effect.info().coefficients.len() }
}

struct RawColumns {
    values: Vec<[Option<Vec<f64>>; 6]>,
    first: usize,
    sample: usize,
    samples: usize,
}

impl RawColumns {
    /// The columns of `effects` at every state.
    fn new(count: usize, plant: &Plant, states: &[SampleInput], effects: &[Effect]) -> Self {
        let mut raw =
            Self { values: vec![Default::default(); count], first: 0, sample: 0, samples: states.len() };
        for (k, state) in states.iter().enumerate() {
            let sample = plant.sample_of(*state);
            raw.sample = k;
            raw.first = 0;
            for effect in effects {
                effect.columns(&sample, &mut raw);
                raw.first += coefficient_count(*effect);
            }
        }
        raw
    }

    /// Takes the force axes of other columns in place of its own.
    fn take_forces(&mut self, other: Self) {
        for (mine, theirs) in self.values.iter_mut().zip(other.values) {
            let [u, v, w, ..] = theirs;
            mine[0] = u;
            mine[1] = v;
            mine[2] = w;
        }
    }
}

impl Sink for RawColumns {
    #[inline]
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64) {
        let column = &mut self.values[self.first + coefficient][axis.index()];
        column.get_or_insert_with(|| vec![0.0; self.samples])[self.sample] += value;
    }
}

impl Stretch {
    /// Each rotor's speed.
    pub(crate) fn rotors(&self, vehicle: &Vehicle, adjust: &Adjustments, period_s: f64) -> [RotorTrack; 4] {
        let delay = adjust.input_delay_s / period_s;
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
        let map: RotorMap = vehicle.rotor_map();
        let lag = adjust.lag_rad_s(vehicle.motors.lag);
        self.command.each_ref().map(|command| {
            let commanded: Vec<f64> = command
                .iter()
                .zip(&self.battery_v)
                .map(|(c, v)| adjust.corrected_speed_rad_s(map.speed_rad_s(*c, *v), *v))
                .collect();
            lagged(&commanded, lag, delay, period_s)
        })
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
        now = target + (now - target) * over_sample;
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

fn central_difference(signal: &[f64], period_s: f64) -> Vec<f64> {
    let last = signal.len() - 1;
    (0..=last)
        .map(|k| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            (signal[after] - signal[before]) / ((after - before).max(1) as f64 * period_s)
        })
        .collect()
}

fn vector(parts: &[Vec<f64>; 3], k: usize) -> Vector3<f64> {
    Vector3::new(parts[0][k], parts[1][k], parts[2][k])
}

fn subtract(parts: &mut [Vec<f64>; 3], k: usize, amount: Vector3<f64>) {
    parts.iter_mut().zip(amount.iter()).for_each(|(part, a)| part[k] -= a);
}

/// The smoothed signal, and the signal itself where the window does not fit.
fn smoothed(signal: Vec<f64>, filter: &RegressionFilter) -> Vec<f64> {
    smoothed_by(signal, &filter.smooth)
}

fn smoothed_by(signal: Vec<f64>, taps: &[f64]) -> Vec<f64> {
    let smooth = convolve(&signal, taps);
    smooth.into_iter().zip(signal).map(|(s, raw)| if s.is_nan() { raw } else { s }).collect()
}

/// A period within 0.1 % of a whole number of tenths of a millisecond is that number: clocks tick evenly.
fn rounded_period(period_s: f64) -> f64 {
    let rounded = (period_s * 1e4).round() / 1e4;
    if (rounded - period_s).abs() < 1e-3 * period_s { rounded } else { period_s }
}

/// The columns that preparation uses, in a fixed order.
struct Channels {
    columns: Vec<Vec<f64>>,
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

impl Channels {
    fn new(flight: &Flight, imu: bool, velocity: bool) -> Self {
        use Column::*;
        let required = [X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
        let mut columns: Vec<Vec<f64>> = required.iter().map(|&c| flight.required(c).to_vec()).collect();
        for angle in &mut columns[EULER..RATE] {
            unwrap_angle(angle);
        }
        let mut next = OPTIONAL;
        let mut add = |group: &[&[f64]]| {
            columns.extend(group.iter().map(|c| c.to_vec()));
            let at = next;
            next += group.len();
            at
        };
        let rotor = flight.group([Omega1, Omega2, Omega3, Omega4]).map(|g| add(&g));
        let imu = imu.then(|| flight.group([Ax, Ay, Az])).flatten().map(|g| add(&g));
        let velocity = velocity.then(|| flight.group([Vx, Vy, Vz])).flatten().map(|g| add(&g));
        Self { columns, rotor, imu, velocity }
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
                position_ned_m.each_ref().map(|p| with_ends(p, convolve(p, &filter.derivative), period_s))
            }
        };
        Stretch {
            position_ned_m,
            dcm,
            velocity_ned_m_s,
            euler_rad: euler.map(|angle| smoothed(angle, filter)),
            rate_rad_s: even.take(RATE),
            // Smoothed once the bias is known.
            smooth_rate_rad_s: Default::default(),
            command: even.take(COMMAND),
            logged_rotor_rad_s: self.rotor.map(|first| even.take(first)),
            battery_v: smoothed_by(
                std::mem::take(&mut even.columns[BATTERY]),
                &RegressionFilter::short_smooth(period_s),
            ),
            imu_m_s2: self.imu.map(|first| even.take(first)),
            time_s: even.time_s,
        }
    }
}

/// A derivative filled at the ends of the stretch, where the window does not fit, with plain differences: rows there
/// are never used, but the filters that follow must not spread a NaN.
fn with_ends(signal: &[f64], derivative: Vec<f64>, period_s: f64) -> Vec<f64> {
    let ends = central_difference(signal, period_s);
    derivative.into_iter().zip(ends).map(|(d, end)| if d.is_nan() { end } else { d }).collect()
}

fn unwrap_angle(angle: &mut [f64]) {
    use std::f64::consts::{PI, TAU};
    let mut turns = 0.0;
    let mut last = f64::NAN;
    for value in angle.iter_mut().filter(|v| v.is_finite()) {
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

/// Bridges runs of up to [`BRIDGED_SAMPLES`] missing values by a straight line. Returns the number of values filled
/// in, the battery's aside.
fn bridge(columns: &mut [Vec<f64>]) -> usize {
    let mut count = 0;
    for (index, column) in columns.iter_mut().enumerate() {
        // A battery is slow and often logged at a tenth of the rate.
        let longest = if index == BATTERY { BRIDGED_BATTERY_SAMPLES } else { BRIDGED_SAMPLES };
        let mut k = 0;
        while k < column.len() {
            if column[k].is_finite() {
                k += 1;
                continue;
            }
            let end = (k..column.len()).find(|&j| column[j].is_finite()).unwrap_or(column.len());
            if k > 0 && end < column.len() && end - k <= longest {
                let (from, to, span) = (column[k - 1], column[end], (end - k + 1) as f64);
                for (step, value) in column[k..end].iter_mut().enumerate() {
                    *value = from + (to - from) * (step + 1) as f64 / span;
                    count += usize::from(index != BATTERY);
                }
            }
            k = end;
        }
    }
    count
}

/// Ranges of samples without gaps in time and without missing values.
fn unbroken(t: &[f64], columns: &[Vec<f64>], period_s: f64) -> Vec<std::ops::Range<usize>> {
    let complete: Vec<bool> = (0..t.len()).map(|k| columns.iter().all(|c| c[k].is_finite())).collect();
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
    columns: Vec<Vec<f64>>,
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
    columns: &[Vec<f64>],
    range: std::ops::Range<usize>,
    period_s: f64,
    notes: &mut Vec<String>,
) -> EvenGrid {
    let times = &t[range.clone()];
    let uneven = times.windows(2).filter(|w| ((w[1] - w[0]) / period_s - 1.0).abs() > JITTER).count();
    if uneven == 0 {
        return EvenGrid {
            time_s: times.to_vec(),
            columns: columns.iter().map(|c| c[range.clone()].to_vec()).collect(),
        };
    }
    notes.push(format!("{uneven} uneven sampling steps interpolated to {:.1} Hz", 1.0 / period_s));
    let count = ((times[times.len() - 1] - times[0]) / period_s).floor() as usize + 1;
    let grid: Vec<f64> = (0..count).map(|k| times[0] + k as f64 * period_s).collect();
    let columns = columns.iter().enumerate().map(|(index, column)| {
        let values = &column[range.clone()];
        let held = (COMMAND..BATTERY).contains(&index);
        let mut at = 0;
        grid.iter()
            .map(|&time| {
                while at + 2 < times.len() && times[at + 1] <= time {
                    at += 1;
                }
                if held {
                    values[at + usize::from(time >= times[at + 1])]
                } else {
                    hermite(times, values, at, time)
                }
            })
            .collect()
    });
    EvenGrid { time_s: grid.clone(), columns: columns.collect() }
}

/// Cubic Hermite interpolation between samples `at` and `at + 1` with the slopes of the neighbours.
fn hermite(t: &[f64], y: &[f64], at: usize, time: f64) -> f64 {
    let slope = |k: usize| {
        let (a, b) = (k.saturating_sub(1), (k + 1).min(t.len() - 1));
        (y[b] - y[a]) / (t[b] - t[a])
    };
    let step = t[at + 1] - t[at];
    let s = (time - t[at]) / step;
    let (s2, s3) = (s * s, s * s * s);
    (2.0 * s3 - 3.0 * s2 + 1.0) * y[at]
        + (s3 - 2.0 * s2 + s) * step * slope(at)
        + (3.0 * s2 - 2.0 * s3) * y[at + 1]
        + (s3 - s2) * step * slope(at + 1)
}

/// Takes out the mean difference between the gyro and the rates of the tracked attitude over the whole flight.
fn remove_gyro_bias(stretches: &mut [Stretch], filter: &RegressionFilter) -> [f64; 3] {
    let mut sum = Vector3::zeros();
    let mut count = 0.0;
    for stretch in stretches.iter() {
        let slopes = stretch.euler_rad.each_ref().map(|angle| convolve(angle, &filter.derivative));
        // A mean needs no more than ten values a second.
        let inside = 2 * filter.half()..stretch.time_s.len() - 2 * filter.half();
        for k in inside.step_by(10) {
            let rates = frames::body_rates_from_euler(vector(&stretch.euler_rad, k), vector(&slopes, k));
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
