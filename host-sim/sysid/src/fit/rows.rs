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
//! **Fewer rows than samples.** Filtered signals all but end at 50 rad/s, the first zero of the smoother. Rows every
//! 30 ms hold what there is up to 105 rad/s; more of them repeat each other and cost time, so a fit takes these, and
//! filters are evaluated at these only. On simulated flights at 100 Hz standard errors grow by 2 % (7 % at most) and no
//! estimate moves by more than 0.35 of them; 40 ms would be too far apart (26 %, 1.4). Residuals are wanted at every
//! sample.
//!
//! A tracked point is brought to the centre of mass (4.7) before it is differentiated.

use std::iter::StepBy;
use std::ops::Range;

use model::{Adjustments, Axis, Effect, Model, Plant, Quantity, SampleInput, Vehicle};
use nalgebra::{Matrix3, Vector3};

use crate::filter::{SideBySide, compose, sum_of_products};
use crate::fit::in_gust::InGust;
use crate::fit::least_squares::{FlightRows, RowColumn};
use crate::fit::slow;
use crate::fit::slung_load;
use crate::fit::terms::{
    Changes, ColumnsAndPredictions, Growing, LinearEffects, Predictions, Seen, Slots, Terms,
};
use crate::prepare::{ForceTarget, Part, Prepared, States, Stretch, subtract, vector};

/// A load on a cable as it was followed.
pub struct Hung<'a> {
    /// Of each stretch.
    pub parts: &'a [Vec<Part>],
    /// The part of a force along the cable that moves the load.
    pub part: f64,
}

impl Prepared {
    /// Targets of the six axes over the rows at every `stride`th sample.
    pub fn targets(&self, vehicle: &Vehicle, adjust: &Adjustments, stride: usize) -> [Vec<f64>; 6] {
        let half = self.filter.half();
        let mut targets: [Vec<f64>; 6] = Default::default();
        for stretch in &self.stretches {
            self.append_force_targets(stretch, vehicle, adjust, stride, &mut targets);
            for (target, rate) in targets[3..].iter_mut().zip(&stretch.rate_rad_s) {
                let rows = self.row_samples(stretch, stride);
                target.extend(rows.map(|k| sum_of_products(&rate[k - half..], &self.filter.derivative)));
            }
        }
        if let Some(trim) = &self.trim {
            for (target, trim) in targets.iter_mut().zip(trim.value) {
                target.iter_mut().for_each(|t| *t -= trim);
            }
        }
        targets
    }

    /// A regression on this flight: targets and columns over the rows of a fit ([`Self::fit_stride`]).
    pub fn rows_of_fit(&self, mut targets: [Vec<f64>; 6], mut columns: Vec<RowColumn>) -> FlightRows {
        let stride = self.fit_stride();
        if slow::is_taken(self) {
            slow::take_from_targets(self, stride, &mut targets);
            columns.iter_mut().for_each(|column| slow::take_from_column(self, stride, column));
        }
        let starts = self.starts_of_rows(stride);
        FlightRows { targets, columns, starts, period_s: self.period_s * stride as f64 }
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
                target
                    .extend(rows.clone().map(|k| sum_of_products(&signal[k - half..], &self.filter.smooth)));
            }
            return;
        }
        let untilt = adjust.untilt();
        let lever = Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m();
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
                subtract(&mut signal, k, untilt.body(&stretch.dcm[k]).tr_mul(&arm));
            }
            signal
        });
        let signal = corrected.as_ref().unwrap_or(tracked);
        let half = taps.len() / 2;
        for k in rows {
            let acceleration =
                Vector3::from(signal.each_ref().map(|s| sum_of_products(&s[k - half..], &taps)));
            let force = acceleration - Vector3::new(0.0, 0.0, vehicle.gravity);
            let body = untilt.body(&stretch.dcm[k]) * force;
            targets.iter_mut().zip(body.iter()).for_each(|(target, b)| target.push(*b));
        }
    }

    /// The regression columns of linear effects, one for each coefficient in order.
    pub fn columns(
        &self,
        effects: &[Effect],
        model: &Model,
        stride: usize,
        hung: Option<&Hung>,
    ) -> Vec<RowColumn> {
        let (plant, effects) = (Plant::new(model), LinearEffects::new(effects));
        self.filtered(&plant, &model.vehicle, &effects, stride, hung)
    }

    /// What terms of a caller's own would contribute about a model, at the rows of a fit.
    pub fn columns_of_terms(&self, terms: &impl Terms, model: &Model) -> Vec<RowColumn> {
        self.filtered(&Plant::new(model), &model.vehicle, terms, self.fit_stride(), None)
    }

    /// A measured quantity at the rows, through the filter of the moments.
    pub fn quantity(&self, model: &Model, quantity: &Quantity) -> Vec<f64> {
        let plant = Plant::new(&slung_load::without_load(model));
        let mut columns = self.filtered(&plant, &model.vehicle, &Seen(quantity), 1, None);
        columns.pop().and_then(|mut column| column[Axis::P.index()].take()).unwrap_or_default()
    }

    /// What models of one vehicle predict of the targets, but for the pull of a load that comes of its swing.
    pub fn predicted_by(&self, models: &[&Model], stride: usize, hung: Option<&Hung>) -> Vec<RowColumn> {
        self.columns_and_predicted_by((&[], &[]), models, stride, hung).1
    }

    /// The columns of linear effects and of changes about the first of some models of one vehicle, and what they predict of the targets, but
    /// for the pull of a load that comes of its swing. Models that see the same states are evaluated side by side.
    pub(crate) fn columns_and_predicted_by(
        &self,
        (linear, changes): (&[Effect], &[Changes]),
        models: &[&Model],
        stride: usize,
        hung: Option<&Hung>,
    ) -> (Vec<RowColumn>, Vec<RowColumn>) {
        let mut columns = Vec::new();
        let plants: Vec<Plant> =
            models.iter().map(|model| Plant::new(&slung_load::without_load(model))).collect();
        let mut predicted = vec![RowColumn::default(); models.len()];
        let mut left: Vec<usize> = (0..plants.len()).collect();
        while let Some(&first) = left.first() {
            let own = plants[first].adjustments();
            let sees_alike = |k: &usize| plants[*k].adjustments().same_states(own);
            let (group, rest): (Vec<usize>, Vec<usize>) = left.into_iter().partition(sees_alike);
            let (linear, changes) = if first == 0 { (linear, changes) } else { Default::default() };
            let terms = ColumnsAndPredictions {
                linear: LinearEffects::new(linear),
                changes,
                predictions: Predictions(group.iter().map(|&k| &plants[k]).collect()),
            };
            let mut of_group = self.filtered(&plants[first], &models[first].vehicle, &terms, stride, hung);
            let predicted_by_group = of_group.split_off(terms.columns());
            group.into_iter().zip(predicted_by_group).for_each(|(k, column)| predicted[k] = column);
            columns.append(&mut of_group);
            left = rest;
        }
        (columns, predicted)
    }

    /// Specific forces that a model predicts of each stretch but for the pull of a load, inertial, where regressors are formed:
    /// between samples, or at them for an IMU; m/s^2.
    pub fn predicted_forces_ned_m_s2(&self, model: &Model) -> Vec<Vec<Vector3<f64>>> {
        let plant = Plant::new(&slung_load::without_load(model));
        let force = |input: &SampleInput| {
            let [u, v, w, ..] = plant.accelerations(&plant.sample_of(input));
            input.dcm.tr_mul(&Vector3::new(u, v, w))
        };
        let of_stretch = |stretch| {
            let states = self.remembering_states(stretch, &model.vehicle, &plant, []);
            if self.force_target == ForceTarget::Imu {
                return (0..states.len()).map(|k| force(&states.at(k))).collect();
            }
            let mut forces = Vec::with_capacity(states.len());
            states.for_each_between(&Part::whole(stretch), |input| forces.push(force(input)));
            forces
        };
        self.stretches.iter().map(of_stretch).collect()
    }

    /// The filter that makes the force rows of what is formed at the places of regressors.
    pub fn force_taps(&self) -> Vec<f64> {
        match self.force_target {
            ForceTarget::Imu => self.filter.smooth.clone(),
            ForceTarget::Velocity => self.filter.between.clone(),
            ForceTarget::Position => compose(&self.filter.between, &self.filter.matched),
        }
    }

    /// The terms through the filters of the targets, at the rows.
    fn filtered(
        &self,
        plant: &Plant,
        vehicle: &Vehicle,
        terms: &impl Terms,
        stride: usize,
        hung: Option<&Hung>,
    ) -> Vec<RowColumn> {
        let cable = hung.map(|hung| hung.part);
        let row_count = self.stretches.iter().map(|stretch| self.row_samples(stretch, stride).len()).sum();
        let mut result = Growing::new(terms.count(), row_count);
        let force_taps = self.force_taps();
        let imu = self.force_target == ForceTarget::Imu;
        for (index, stretch) in self.stretches.iter().enumerate() {
            let states = self.remembering_states(stretch, vehicle, plant, terms.lags());
            let whole = [Part::whole(stretch)];
            for part in hung.and_then(|hung| hung.parts.get(index)).map_or(&whole[..], Vec::as_slice) {
                let first = part.samples.start;
                let rows = || (self.margin..part.samples.len() - self.margin).step_by(stride);
                let layout = Slots::new(terms, &plant.sample_of(&states.at(first)), |axis| axis >= 3);
                let mut moments =
                    FilteredRows::new(&self.filter.between, layout.places.len(), layout.wanted, rows());
                let turned = if imu { Vec::new() } else { layout.forces_by_parameter() };
                let mut forces = FilteredRows::new(&force_taps, 3 * turned.len(), 3 * turned.len(), rows());
                let (mut in_gust, mut k) = (InGust::default(), first);
                states.for_each_between(part, |input| {
                    let (dcm, direction) = (input.dcm, input.pendulum.direction);
                    let gust = states.gust_after(k);
                    k += 1;
                    let write = |row: &mut [f64]| match gust {
                        None => layout.write(terms, &plant.sample_of(input), row),
                        Some(gust) => in_gust.write((&layout, terms, plant), input, gust, row),
                    };
                    if moments.push(write).is_some() {
                        result.append(&layout.places, &moments.row);
                    }
                    if turned.is_empty() {
                        return;
                    }
                    let body = moments.filter.latest();
                    let at_row = forces.push(|row| {
                        layout.turn_forces(&turned, &dcm, body, row);
                        carry(row, cable, &direction);
                    });
                    if let Some(k) = at_row {
                        result.append_turned_back(&turned, &states.dcm(first + k), &forces.row);
                    }
                });
                if imu {
                    self.append_imu_forces(terms, plant, (&states, part), (stride, cable), &mut result);
                }
            }
        }
        result.into_columns()
    }

    /// The force rows of an IMU: in body axes throughout.
    fn append_imu_forces(
        &self,
        terms: &impl Terms,
        plant: &Plant,
        (states, part): (&States, &Part),
        (stride, cable): (usize, Option<f64>),
        result: &mut Growing,
    ) {
        let first = part.samples.start;
        let rows = (self.margin..part.samples.len() - self.margin).step_by(stride);
        let taps = self.force_taps();
        let layout = Slots::new(terms, &plant.sample_of(&states.at(first)), |axis| axis < 3);
        if cable.is_none() {
            let mut forces = FilteredRows::new(&taps, layout.places.len(), layout.wanted, rows);
            let mut in_gust = InGust::default();
            for k in part.samples.clone() {
                let input = states.at(k);
                let write = |row: &mut [f64]| match states.gust_at(k) {
                    None => layout.write(terms, &plant.sample_of(&input), row),
                    Some(gust) => in_gust.write((&layout, terms, plant), &input, gust, row),
                };
                if forces.push(write).is_some() {
                    result.append(&layout.places, &forces.row);
                }
            }
            return;
        }
        // Along a cable, a force on one axis acts on all three.
        let turned = layout.forces_by_parameter();
        let body_axes = Matrix3::identity();
        let mut sparse = vec![0.0; layout.places.len()];
        let mut forces = FilteredRows::new(&taps, 3 * turned.len(), 3 * turned.len(), rows);
        for k in part.samples.clone() {
            let input = states.at(k);
            let direction = input.dcm * part.swings.get(k - first).copied().unwrap_or_default().direction;
            layout.write(terms, &plant.sample_of(&input), &mut sparse);
            let at_row = forces.push(|row| {
                layout.turn_forces(&turned, &body_axes, &sparse, row);
                carry(row, cable, &direction);
            });
            if at_row.is_some() {
                result.append_turned_back(&turned, &body_axes, &forces.row);
            }
        }
    }
}

/// Takes out of forces the part along a cable that moves the load, in the axes of `direction`.
#[inline]
fn carry(forces: &mut [f64], cable: Option<f64>, direction: &Vector3<f64>) {
    let Some(part) = cable else { return };
    for force in forces.as_chunks_mut::<3>().0 {
        let along = part * (force[0] * direction.x + force[1] * direction.y + force[2] * direction.z);
        force.iter_mut().zip(direction.iter()).for_each(|(f, n)| *f -= along * n);
    }
}

/// Signals side by side through a filter, at rows only.
struct FilteredRows {
    filter: SideBySide,
    rows: StepBy<Range<usize>>,
    next: Option<usize>,
    /// Samples taken in.
    taken: usize,
    /// The filtered signals at the latest row.
    row: Vec<f64>,
}

impl FilteredRows {
    /// For samples of `signals` values, of which the first `filtered` are filtered.
    fn new(taps: &[f64], signals: usize, filtered: usize, mut rows: StepBy<Range<usize>>) -> Self {
        let next = rows.next();
        Self { filter: SideBySide::new(taps, signals), rows, next, taken: 0, row: vec![0.0; filtered] }
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

#[cfg(test)]
mod tests {
    use model::Pendulum;

    use super::*;
    use crate::testing::{NONE, fly, prepared, truth};

    /// Heading east, pushed north by 0.6, east by 0.2 and up by 0.4 m/s^2: 0.2 forwards, 0.6 to the left. The gyro's
    /// rates grow by 0.7, -0.3 and 0.1 rad/s^2.
    #[test]
    fn targets_are_the_specific_force_along_the_body_axes_and_the_slopes_of_the_rates() {
        let flight = prepared(400, |t, row| {
            row.position_ned_m = [0.3 * t * t, 0.1 * t * t, -0.2 * t * t];
            row.euler_rad = [0.0, 0.0, std::f64::consts::FRAC_PI_2];
            row.rate_rad_s = [0.7 * t, -0.3 * t, 0.1 * t];
        });
        let targets = flight.targets(&Vehicle::thesis(), &Adjustments::default(), 7);
        for (target, expected) in targets.iter().zip([0.2, -0.6, -10.21, 0.7, -0.3, 0.1]) {
            assert_eq!(target.len(), flight.rows().div_ceil(7));
            // Parabolas come out exactly; positions of some metres are differentiated twice.
            assert!(target.iter().all(|value| (value - expected).abs() < 1e-9), "{expected}: {}", target[0]);
        }
    }

    /// A tenth of a metre ahead of a centre that rests, a point is pulled inwards by 0.8^2 * 0.1 m/s^2.
    #[test]
    fn a_point_that_circles_about_a_resting_centre_feels_no_force_once_its_lever_is_known() {
        let flight = prepared(400, |t, row| {
            let (sin, cos) = (0.8 * t).sin_cos();
            row.position_ned_m = [0.1 * cos, 0.1 * sin, -1.0];
            row.euler_rad = [0.0, 0.0, 0.8 * t];
            row.rate_rad_s = [0.0, 0.0, 0.8];
        });
        let mut vehicle = Vehicle::thesis();
        let check = |vehicle: &Vehicle, inwards: f64| {
            let targets = flight.targets(vehicle, &Adjustments::default(), 1);
            for (target, expected) in targets.iter().zip([inwards, 0.0, -9.81]) {
                // The filter lets 0.8 rad/s pass but for a part in 10^6.
                assert!(target.iter().all(|v| (v - expected).abs() < 1e-7), "{expected}: {}", target[0]);
            }
        };
        check(&vehicle, -0.064);
        vehicle.tracked_point = [0.1, 0.0, 0.0];
        check(&vehicle, 0.0);
    }

    /// The plant integrates, preparation differentiates: both sides of each row are one motion.
    #[test]
    fn columns_times_the_coefficients_that_flew_are_the_targets() {
        let model = truth();
        let flight = Prepared::new(&fly(&model, 3, 8.0, &NONE), &model.vehicle).unwrap();
        let stride = flight.fit_stride();
        let targets = flight.targets(&model.vehicle, &model.adjustments(), stride);
        let columns = flight.columns(&model.effects(), &model, stride, None);
        let values: Vec<f64> = model.terms.iter().flat_map(|term| term.values()).collect();
        assert_eq!(columns.len(), values.len());
        for (axis, target) in targets.iter().enumerate() {
            let (mut left, mut all) = (0.0, 0.0);
            for (row, target) in target.iter().enumerate() {
                let part = |(column, value): (&RowColumn, &f64)| {
                    column[axis].as_ref().map_or(0.0, |column| column[row] * value)
                };
                let told: f64 = columns.iter().zip(&values).map(part).sum();
                left += (target - told).powi(2);
                all += target.powi(2);
            }
            // The mean state of two samples stands for what is between them.
            assert!(left < 0.003_f64.powi(2) * all, "axis {axis}: {}", (left / all).sqrt());
        }
    }

    /// Along (0.6, 0, 0.8), a force of (1, 2, 3) is 3: half of it is 1.5 times that direction.
    #[test]
    fn a_cable_takes_its_part_of_a_force_along_it_and_nothing_across() {
        let hung = Pendulum { direction: Vector3::new(0.6, 0.0, 0.8), ..Pendulum::default() };
        let mut forces = [1.0, 2.0, 3.0, -0.8, 5.0, 0.6];
        carry(&mut forces, Some(0.5), &hung.direction);
        for (force, expected) in forces.iter().zip([0.1, 2.0, 1.8, -0.8, 5.0, 0.6]) {
            assert!((force - expected).abs() < 1e-15, "{forces:?}");
        }
        let before = forces;
        carry(&mut forces, None, &hung.direction);
        assert_eq!(forces, before);
    }
}
