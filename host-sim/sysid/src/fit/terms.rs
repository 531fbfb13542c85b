//! Terms of the equations of motion: parameters times what they multiply, and where their values go.

use std::ops::Range;

use model::{Axis, Effect, LagId, Plant, Quantity, Sample, Sink};
use nalgebra::{Matrix3, Vector3};

use crate::fit::least_squares::RowColumn;

/// Linear coefficients of an effect: none for an adjusting one.
pub fn coefficient_count(effect: Effect) -> usize {
    if effect.info().kind == model::Kind::Adjusting { 0 } else { effect.info().coefficients.len() }
}

/// Terms of the equations of motion: parameters times what they multiply. Which parameter acts on which axis, and the
/// order of the terms, do not depend on the state.
pub trait Terms {
    /// Parameters.
    fn count(&self) -> usize;
    /// What they look back at, beside what the model does that they are about.
    fn lags(&self) -> Vec<LagId> {
        Vec::new()
    }
    /// Adds what each parameter multiplies, by `sink.add(axis, parameter, value)`, once for each axis.
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink);
}

/// Linear effects and how many coefficients each has: a parameter is a coefficient.
pub(crate) struct LinearEffects {
    effects: Vec<(Effect, usize)>,
    pub(crate) count: usize,
}

impl LinearEffects {
    pub(crate) fn new(effects: &[Effect]) -> Self {
        let effects: Vec<(Effect, usize)> = effects.iter().map(|e| (*e, coefficient_count(*e))).collect();
        let count = effects.iter().map(|(_, count)| count).sum();
        Self { effects, count }
    }
}

impl Terms for LinearEffects {
    fn count(&self) -> usize {
        self.count
    }

    fn lags(&self) -> Vec<LagId> {
        self.effects.iter().flat_map(|(effect, _)| effect.lags()).collect()
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

/// A measured quantity, taken for what a parameter of the roll moment multiplies.
pub(crate) struct Seen<'a>(pub(crate) &'a Quantity);

impl Terms for Seen<'_> {
    fn count(&self) -> usize {
        1
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        sink.add(Axis::P, 0, self.0.at(sample));
    }
}

/// A sink whose first parameter is `first` of another.
pub(crate) struct From<'a, S> {
    first: usize,
    sink: &'a mut S,
}

impl<S: Sink> Sink for From<'_, S> {
    #[inline(always)]
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64) {
        self.sink.add(axis, self.first + coefficient, value);
    }
}

/// The six rows of the equations of motion of models that see the same states: each is a "parameter" that acts on all axes.
pub(crate) struct Predictions<'a>(pub(crate) Vec<&'a Plant>);

impl Terms for Predictions<'_> {
    fn count(&self) -> usize {
        self.0.len()
    }

    fn lags(&self) -> Vec<LagId> {
        self.0.iter().flat_map(|plant| plant.lags().ids()).collect()
    }

    #[inline]
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        for (index, plant) in self.0.iter().enumerate() {
            // The sample is the first one's.
            let accelerations = match index {
                0 => plant.accelerations(sample),
                _ => plant.accelerations(&plant.sample_of(sample.input)),
            };
            for (axis, value) in model::AXES.into_iter().zip(accelerations) {
                sink.add(axis, index, value);
            }
        }
    }
}

/// Linear effects about a model, then the predictions of this and of others.
pub(crate) struct Both<'a> {
    pub(crate) linear: LinearEffects,
    pub(crate) predictions: Predictions<'a>,
}

impl Terms for Both<'_> {
    fn count(&self) -> usize {
        self.linear.count() + self.predictions.count()
    }

    fn lags(&self) -> Vec<LagId> {
        self.linear.lags().into_iter().chain(self.predictions.lags()).collect()
    }

    #[inline]
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        self.linear.evaluate(sample, sink);
        self.predictions.evaluate(sample, &mut From { first: self.linear.count, sink });
    }
}

/// What a value is part of.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) parameter: usize,
    pub(crate) axis: usize,
}

/// The order of the values of terms at one state.
#[derive(Default)]
pub(crate) struct Slots {
    /// Slot of each value, in the order in which the terms add them.
    slots: Vec<usize>,
    /// What is in each slot: what is wanted, then the rest, each sorted by parameter.
    pub(crate) places: Vec<Place>,
    /// Values that are wanted.
    pub(crate) wanted: usize,
}

/// A parameter that acts on forces, and its slots.
pub(crate) struct Turned {
    pub(crate) parameter: usize,
    pub(crate) slots: Range<usize>,
}

/// Notes which parameter acts where.
pub(crate) struct Touched(Vec<Place>);

impl Sink for Touched {
    fn add(&mut self, axis: Axis, parameter: usize, _: f64) {
        self.0.push(Place { parameter, axis: axis.index() });
    }
}

/// Writes values to their slots.
pub(crate) struct Writer<'a> {
    slots: std::slice::Iter<'a, usize>,
    row: &'a mut [f64],
}

impl Sink for Writer<'_> {
    #[inline(always)]
    fn add(&mut self, _: Axis, _: usize, value: f64) {
        if let Some(&slot) = self.slots.next() {
            self.row[slot] = value;
        }
    }
}

impl Slots {
    pub(crate) fn new(terms: &impl Terms, sample: &Sample, wanted: impl Fn(usize) -> bool) -> Self {
        let mut touched = Touched(Vec::new());
        terms.evaluate(sample, &mut touched);
        let added = touched.0;
        let mut order: Vec<usize> = (0..added.len()).collect();
        order.sort_by_key(|&k| (!wanted(added[k].axis), added[k].parameter));
        let mut slots = vec![0; added.len()];
        order.iter().enumerate().for_each(|(slot, &k)| slots[k] = slot);
        let wanted = added.iter().filter(|place| wanted(place.axis)).count();
        Self { slots, places: order.iter().map(|&k| added[k]).collect(), wanted }
    }

    #[inline]
    pub(crate) fn write(&self, terms: &impl Terms, sample: &Sample, row: &mut [f64]) {
        terms.evaluate(sample, &mut Writer { slots: self.slots.iter(), row });
    }

    /// All slots but those of forces along the horizontal body axes.
    pub(crate) fn slots_but_horizontal_forces(&self) -> impl Iterator<Item = usize> {
        self.places.iter().enumerate().filter(|(_, place)| place.axis >= 2).map(|(slot, _)| slot)
    }

    pub(crate) fn forces_by_parameter(&self) -> Vec<Turned> {
        let mut turned: Vec<Turned> = Vec::new();
        for (slot, place) in self.places.iter().enumerate().filter(|(_, place)| place.axis < 3) {
            match turned.last_mut().filter(|last| last.parameter == place.parameter) {
                Some(last) => last.slots.end = slot + 1,
                None => turned.push(Turned { parameter: place.parameter, slots: slot..slot + 1 }),
            }
        }
        turned
    }

    /// Forces from body to inertial axes.
    #[inline]
    pub(crate) fn turn_forces(&self, turned: &[Turned], dcm: &Matrix3<f64>, body: &[f64], ned: &mut [f64]) {
        let axes: [[f64; 3]; 3] = dcm.transpose().into();
        for (ned, Turned { slots, .. }) in ned.as_chunks_mut::<3>().0.iter_mut().zip(turned) {
            let mut sum = [0.0; 3];
            for (place, value) in self.places[slots.clone()].iter().zip(&body[slots.clone()]) {
                sum.iter_mut().zip(axes[place.axis]).for_each(|(s, a)| *s += a * value);
            }
            *ned = sum;
        }
    }
}

/// Appends filtered signals to the columns that they belong to.
pub(crate) fn append(places: &[Place], row: &[f64], result: &mut [RowColumn]) {
    for (place, value) in places.iter().zip(row) {
        result[place.parameter][place.axis].get_or_insert_default().push(*value);
    }
}

/// Appends filtered forces, back in body axes.
pub(crate) fn append_turned_back(
    turned: &[Turned],
    dcm: &Matrix3<f64>,
    row: &[f64],
    result: &mut [RowColumn],
) {
    for (Turned { parameter, .. }, force) in turned.iter().zip(row.chunks_exact(3)) {
        let body = dcm * Vector3::new(force[0], force[1], force[2]);
        for (column, value) in result[*parameter].iter_mut().zip(body.iter()) {
            column.get_or_insert_default().push(*value);
        }
    }
}
