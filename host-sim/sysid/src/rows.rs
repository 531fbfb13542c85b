//! Rows of the regression from a prepared flight: states, targets, and what effects contribute.
//!
//! 1. Targets. Force rows: specific force in body axes, from the IMU if logged, else from the derivative of the logged
//!    velocity, else from the twice differentiated position. Moment rows: derivative of the body rates.
//! 2. Regressors are formed from the mean state between two samples, which for rotors is that of their exponential:
//!    what a velocity gains from sample to sample is the mean acceleration between them, not that at either end.
//! 3. Every regressor goes through the same filter as its target ([`crate::filter`] says why). Accelerations that come
//!    from the tracker are formed in the inertial frame, so regressors of the force rows are turned there with the
//!    attitude of each sample, filtered, and turned back with the attitude of the row.
//!
//! **Fewer rows than samples.** Filtered signals end at 50 rad/s, the first zero of the smoother. Rows every
//! [`FIT_ROW_PERIOD_S`] hold all there is up to 78 rad/s; more of them repeat each other and cost time, so a fit takes
//! these, and filters are evaluated at these only. Residuals are wanted at every sample.
//!
//! A tracked point is brought to the centre of mass (4.7) before it is differentiated.

use std::iter::StepBy;
use std::ops::Range;

use model::{Adjustments, Axis, Effect, Model, Plant, Sample, SampleInput, Sink, Vehicle};
use nalgebra::{Matrix3, Vector3};

use crate::filter::{SideBySide, compose, weighted_sum};
use crate::prepare::{ForceTarget, Prepared, RotorTrack, Stretch, subtract, vector};

/// Time between the rows of a fit, s.
pub(crate) const FIT_ROW_PERIOD_S: f64 = 0.04;

/// The values of one parameter over the rows, for each axis that it acts on.
pub(crate) type RowColumn = [Option<Vec<f64>>; 6];

/// The states of a stretch.
pub(crate) struct States<'a> {
    stretch: &'a Stretch,
    adjust: &'a Adjustments,
    lever_m: Vector3<f64>,
    rotor: [RotorTrack; 4],
    period_s: f64,
}

impl States<'_> {
    pub(crate) fn len(&self) -> usize {
        self.stretch.time_s.len()
    }

    /// Inertial to body at a sample.
    fn dcm(&self, k: usize) -> Matrix3<f64> {
        self.adjust.true_dcm(&self.stretch.dcm[k])
    }

    /// At a sample, but for the accelerations.
    fn without_acceleration(&self, k: usize) -> SampleInput {
        let stretch = self.stretch;
        let dcm = self.dcm(k);
        let rate = vector(&stretch.rate_rad_s, k);
        let mut velocity = dcm * vector(&stretch.velocity_ned_m_s, k);
        let mut position = vector(&stretch.position_ned_m, k);
        if self.lever_m != Vector3::zeros() {
            velocity -= rate.cross(&self.lever_m);
            position -= dcm.tr_mul(&self.lever_m);
        }
        SampleInput {
            position_ned_m: position,
            dcm,
            velocity_m_s: velocity,
            rate_rad_s: rate,
            angular_acceleration_rad_s2: Vector3::zeros(),
            rotor_rad_s: self.rotor.each_ref().map(|r| r.speed_rad_s[k]),
            rotor_acceleration_rad_s2: [0.0; 4],
            battery_v: stretch.battery_v[k],
        }
    }

    /// At a sample.
    pub(crate) fn at(&self, k: usize) -> SampleInput {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(self.len() - 1));
        let rate = &self.stretch.rate_rad_s;
        let turned = vector(rate, after) - vector(rate, before);
        SampleInput {
            angular_acceleration_rad_s2: turned / ((after - before).max(1) as f64 * self.period_s),
            ..self.without_acceleration(k)
        }
    }

    /// Mean states between neighbouring samples, one fewer.
    fn between(&self) -> impl Iterator<Item = SampleInput> {
        let per_period = 1.0 / self.period_s;
        let mut a = self.without_acceleration(0);
        (1..self.len()).map(move |k| {
            let b = self.without_acceleration(k);
            let mean = SampleInput {
                position_ned_m: 0.5 * (a.position_ned_m + b.position_ned_m),
                // The mean of two attitudes a hundredth of a radian apart is a rotation to a part in 10^5.
                dcm: 0.5 * (a.dcm + b.dcm),
                velocity_m_s: 0.5 * (a.velocity_m_s + b.velocity_m_s),
                rate_rad_s: 0.5 * (a.rate_rad_s + b.rate_rad_s),
                angular_acceleration_rad_s2: per_period * (b.rate_rad_s - a.rate_rad_s),
                rotor_rad_s: self.rotor.each_ref().map(|r| r.mean_rad_s[k - 1]),
                rotor_acceleration_rad_s2: std::array::from_fn(|i| {
                    per_period * (b.rotor_rad_s[i] - a.rotor_rad_s[i])
                }),
                battery_v: 0.5 * (a.battery_v + b.battery_v),
            };
            a = b;
            mean
        })
    }
}

impl Prepared {
    /// Samples from one row of a fit to the next.
    pub(crate) fn fit_stride(&self) -> usize {
        (FIT_ROW_PERIOD_S / self.period_s).round().max(1.0) as usize
    }

    /// The samples of a stretch at which there are rows.
    fn row_samples(&self, stretch: &Stretch, stride: usize) -> StepBy<Range<usize>> {
        (self.margin..stretch.time_s.len() - self.margin).step_by(stride)
    }

    /// Rows at which stretches begin: neighbours across these are not neighbours in time.
    pub(crate) fn starts_of_rows(&self, stride: usize) -> Vec<usize> {
        let mut next = 0;
        let start = |stretch| {
            let start = next;
            next += self.row_samples(stretch, stride).len();
            start
        };
        self.stretches.iter().map(start).collect()
    }

    /// The states of a stretch under `adjust`.
    pub(crate) fn states<'a>(
        &self,
        stretch: &'a Stretch,
        vehicle: &Vehicle,
        adjust: &'a Adjustments,
    ) -> States<'a> {
        States {
            stretch,
            adjust,
            lever_m: Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m,
            rotor: stretch.rotors(vehicle, adjust, self.period_s),
            period_s: self.period_s,
        }
    }

    /// Targets of the six axes over the rows at every `stride`th sample.
    pub(crate) fn targets(&self, vehicle: &Vehicle, adjust: &Adjustments, stride: usize) -> [Vec<f64>; 6] {
        let half = self.filter.half();
        let mut targets: [Vec<f64>; 6] = Default::default();
        for stretch in &self.stretches {
            self.append_force_targets(stretch, vehicle, adjust, stride, &mut targets);
            for (target, rate) in targets[3..].iter_mut().zip(&stretch.rate_rad_s) {
                let rows = self.row_samples(stretch, stride);
                target.extend(rows.map(|k| weighted_sum(&rate[k - half..], &self.filter.derivative)));
            }
        }
        targets
    }

    /// Specific force in body axes.
    fn append_force_targets(
        &self,
        stretch: &Stretch,
        vehicle: &Vehicle,
        adjust: &Adjustments,
        stride: usize,
        targets: &mut [Vec<f64>; 6],
    ) {
        let rows = self.row_samples(stretch, stride);
        if let (ForceTarget::Imu, Some(imu)) = (self.force_target, &stretch.imu_m_s2) {
            for (target, signal) in targets.iter_mut().zip(imu) {
                let half = self.filter.half();
                target.extend(rows.clone().map(|k| weighted_sum(&signal[k - half..], &self.filter.smooth)));
            }
            return;
        }
        let lever = Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m;
        let slope = &self.filter.derivative;
        let (tracked, taps) = match self.force_target {
            ForceTarget::Position => (&stretch.position_ned_m, compose(slope, slope)),
            _ => (&stretch.velocity_ned_m_s, slope.clone()),
        };
        let corrected = (lever != Vector3::zeros()).then(|| {
            let mut signal = tracked.clone();
            for k in 0..stretch.time_s.len() {
                let arm = match self.force_target {
                    ForceTarget::Position => lever,
                    _ => vector(&stretch.rate_rad_s, k).cross(&lever),
                };
                subtract(&mut signal, k, adjust.true_dcm(&stretch.dcm[k]).tr_mul(&arm));
            }
            signal
        });
        let signal = corrected.as_ref().unwrap_or(tracked);
        let half = taps.len() / 2;
        for k in rows {
            let acceleration = Vector3::from(signal.each_ref().map(|s| weighted_sum(&s[k - half..], &taps)));
            let force = acceleration - Vector3::new(0.0, 0.0, vehicle.gravity);
            let body = adjust.true_dcm(&stretch.dcm[k]) * force;
            targets.iter_mut().zip(body.iter()).for_each(|(target, b)| target.push(*b));
        }
    }

    /// The regression columns of linear effects, one for each coefficient in order.
    pub(crate) fn columns(&self, effects: &[Effect], model: &Model, stride: usize) -> Vec<RowColumn> {
        let effects: Vec<(Effect, usize)> = effects.iter().map(|e| (*e, coefficient_count(*e))).collect();
        let count = effects.iter().map(|(_, count)| count).sum();
        self.filtered(&Plant::new(model), &model.vehicle, &LinearEffects { effects, count }, stride)
    }

    /// What a model predicts of the targets.
    pub(crate) fn predicted(&self, model: &Model, stride: usize) -> RowColumn {
        let plant = Plant::new(model);
        self.filtered(&plant, &model.vehicle, &Prediction(&plant), stride).pop().unwrap_or_default()
    }

    /// The terms through the filters of the targets, at the rows.
    fn filtered(
        &self,
        plant: &Plant,
        vehicle: &Vehicle,
        terms: &impl Terms,
        stride: usize,
    ) -> Vec<RowColumn> {
        let mut result = vec![RowColumn::default(); terms.count()];
        let adjust = plant.adjustments();
        let force_taps = match self.force_target {
            ForceTarget::Imu => self.filter.smooth.clone(),
            ForceTarget::Velocity => self.filter.between.clone(),
            ForceTarget::Position => compose(&self.filter.between, &self.filter.matched),
        };
        let imu = self.force_target == ForceTarget::Imu;
        for stretch in &self.stretches {
            let states = self.states(stretch, vehicle, adjust);
            let mut values = Values::new(terms, &plant.sample_of(states.at(0)));
            let rows = || self.row_samples(stretch, stride);
            let width = if imu { values.forces.len() } else { 3 * values.turned.len() };
            let mut forces = FilteredRows::new(&force_taps, width, rows());
            let mut moments = FilteredRows::new(&self.filter.between, values.moments.len(), rows());
            for input in states.between() {
                values.set(terms, &plant.sample_of(input));
                if moments.push(|row| values.copy_moments(row)).is_some() {
                    values.append(&values.moments, &moments.row, &mut result);
                }
                if imu || width == 0 {
                    continue;
                }
                if let Some(k) = forces.push(|row| values.turn_forces(&input.dcm, row)) {
                    values.append_turned_back(&states.dcm(k), &forces.row, &mut result);
                }
            }
            for k in 0..if imu && width > 0 { states.len() } else { 0 } {
                values.set(terms, &plant.sample_of(states.at(k)));
                if forces.push(|row| values.copy_forces(row)).is_some() {
                    values.append(&values.forces, &forces.row, &mut result);
                }
            }
        }
        result
    }
}

/// Linear coefficients of an effect: none for an adjusting one.
pub(crate) fn coefficient_count(effect: Effect) -> usize {
    if effect.info().kind == model::Kind::Adjusting { 0 } else { effect.info().coefficients.len() }
}

/// Terms of the equations of motion: parameters times what they multiply. Which axes a parameter acts on does not
/// depend on the state.
trait Terms {
    /// Parameters.
    fn count(&self) -> usize;
    /// Adds what each parameter multiplies, by `sink.add(axis, parameter, value)`.
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink);
}

/// Linear effects and how many coefficients each has: a parameter is a coefficient.
struct LinearEffects {
    effects: Vec<(Effect, usize)>,
    count: usize,
}

impl Terms for LinearEffects {
    fn count(&self) -> usize {
        self.count
    }

    #[inline]
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let mut first = 0;
        for (effect, count) in &self.effects {
            effect.columns(sample, &mut From { first, sink });
            first += count;
        }
    }
}

/// A sink whose first parameter is `first` of another.
struct From<'a, S> {
    first: usize,
    sink: &'a mut S,
}

impl<S: Sink> Sink for From<'_, S> {
    #[inline(always)]
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64) {
        self.sink.add(axis, self.first + coefficient, value);
    }
}

/// The six rows of the equations of motion: one "parameter" that acts on all axes.
struct Prediction<'a>(&'a Plant);

impl Terms for Prediction<'_> {
    fn count(&self) -> usize {
        1
    }

    #[inline]
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        for (axis, value) in model::AXES.into_iter().zip(self.0.accelerations(sample)) {
            sink.add(axis, 0, value);
        }
    }
}

/// Where one parameter acts.
struct Place {
    parameter: usize,
    axis: usize,
    /// Its value in [`Values::values`].
    slot: usize,
    /// First of the three places of its force in the inertial frame.
    turned: usize,
}

/// Values of terms at one state, only where they act.
struct Values {
    /// Slot of each parameter on each axis; none where it does not act.
    slots: Vec<[usize; 6]>,
    values: Vec<f64>,
    forces: Vec<Place>,
    moments: Vec<Place>,
    /// Parameters that act on forces.
    turned: Vec<usize>,
}

/// Notes which parameter acts where.
struct Touched(Vec<(usize, usize)>);

impl Sink for Touched {
    fn add(&mut self, axis: Axis, parameter: usize, _: f64) {
        self.0.push((parameter, axis.index()));
    }
}

impl Values {
    fn new(terms: &impl Terms, sample: &Sample) -> Self {
        let mut touched = Touched(Vec::new());
        terms.evaluate(sample, &mut touched);
        let mut places = touched.0;
        places.sort_unstable();
        places.dedup();
        let mut new = Self {
            slots: vec![[usize::MAX; 6]; terms.count()],
            values: vec![0.0; places.len()],
            forces: Vec::new(),
            moments: Vec::new(),
            turned: Vec::new(),
        };
        for (slot, (parameter, axis)) in places.into_iter().enumerate() {
            new.slots[parameter][axis] = slot;
            if axis < 3 && new.turned.last() != Some(&parameter) {
                new.turned.push(parameter);
            }
            let turned = 3 * new.turned.len().saturating_sub(1);
            let place = Place { parameter, axis, slot, turned };
            if axis < 3 { new.forces.push(place) } else { new.moments.push(place) }
        }
        new
    }

    #[inline]
    fn set(&mut self, terms: &impl Terms, sample: &Sample) {
        self.values.fill(0.0);
        terms.evaluate(sample, self);
    }

    fn copy_moments(&self, row: &mut [f64]) {
        row.iter_mut().zip(&self.moments).for_each(|(r, place)| *r = self.values[place.slot]);
    }

    fn copy_forces(&self, row: &mut [f64]) {
        row.iter_mut().zip(&self.forces).for_each(|(r, place)| *r = self.values[place.slot]);
    }

    /// Forces from body to inertial axes.
    fn turn_forces(&self, dcm: &Matrix3<f64>, row: &mut [f64]) {
        row.fill(0.0);
        for place in &self.forces {
            let value = self.values[place.slot];
            for (r, direction) in
                row[place.turned..place.turned + 3].iter_mut().zip(dcm.row(place.axis).iter())
            {
                *r += direction * value;
            }
        }
    }

    fn append(&self, places: &[Place], row: &[f64], result: &mut [RowColumn]) {
        for (place, value) in places.iter().zip(row) {
            result[place.parameter][place.axis].get_or_insert_default().push(*value);
        }
    }

    /// Appends filtered forces, back in body axes.
    fn append_turned_back(&self, dcm: &Matrix3<f64>, row: &[f64], result: &mut [RowColumn]) {
        for (&parameter, force) in self.turned.iter().zip(row.chunks_exact(3)) {
            let body = dcm * Vector3::new(force[0], force[1], force[2]);
            for (column, value) in result[parameter].iter_mut().zip(body.iter()) {
                column.get_or_insert_default().push(*value);
            }
        }
    }
}

impl Sink for Values {
    #[inline(always)]
    fn add(&mut self, axis: Axis, parameter: usize, value: f64) {
        self.values[self.slots[parameter][axis.index()]] += value;
    }
}

/// Signals side by side through a filter, at rows only.
struct FilteredRows<'a> {
    filter: SideBySide<'a>,
    rows: StepBy<Range<usize>>,
    next: Option<usize>,
    /// Samples taken in.
    taken: usize,
    /// The filtered signals at the latest row.
    row: Vec<f64>,
}

impl<'a> FilteredRows<'a> {
    fn new(taps: &'a [f64], width: usize, mut rows: StepBy<Range<usize>>) -> Self {
        let next = rows.next();
        Self { filter: SideBySide::new(taps, width), rows, next, taken: 0, row: vec![0.0; width] }
    }

    /// Takes in the next sample, which `fill` writes. The sample of the row whose window this completes, if it does.
    #[inline]
    fn push(&mut self, fill: impl FnOnce(&mut [f64])) -> Option<usize> {
        fill(self.filter.push());
        self.taken += 1;
        let row = self.next.filter(|row| row + self.filter.reach() == self.taken)?;
        self.next = self.rows.next();
        self.filter.filtered(&mut self.row);
        Some(row)
    }
}
