//! Terms of the equations of motion: parameters times what they multiply, and where their values go.

use std::ops::Range;

use model::user_effects::User;
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

/// What an effect of the users does more with one of its coefficients a step further, for each over its step. Such an effect only adds
/// accelerations: all others stay as they are, and are not asked.
pub(crate) struct Changes {
    user: User,
    /// Coefficients without a step; nothing where the effect is not there.
    from: Option<Vec<f64>>,
    /// Coefficients with one, and its size.
    steps: Vec<(Vec<f64>, f64)>,
    axes: Vec<Axis>,
}

impl Changes {
    pub(crate) fn new(user: User, from: Option<Vec<f64>>, steps: Vec<(Vec<f64>, f64)>) -> Self {
        Self { user, from, steps, axes: user.axes() }
    }

    #[inline]
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        let from = self.from.as_ref().map_or([0.0; 6], |from| self.user.accelerations(sample, from));
        for (index, (coefficients, size)) in self.steps.iter().enumerate() {
            let to = self.user.accelerations(sample, coefficients);
            for axis in &self.axes {
                let row = axis.index();
                sink.add(*axis, index, (to[row] - from[row]) / size);
            }
        }
    }
}

/// Linear effects about a model and what effects of the users change by, then the predictions of this model and of others.
pub(crate) struct ColumnsAndPredictions<'a> {
    pub(crate) linear: LinearEffects,
    pub(crate) changes: &'a [Changes],
    pub(crate) predictions: Predictions<'a>,
}

impl ColumnsAndPredictions<'_> {
    /// Parameters before the predictions.
    pub(crate) fn columns(&self) -> usize {
        self.linear.count() + self.changes.iter().map(|own| own.steps.len()).sum::<usize>()
    }
}

impl Terms for ColumnsAndPredictions<'_> {
    fn count(&self) -> usize {
        self.columns() + self.predictions.count()
    }

    fn lags(&self) -> Vec<LagId> {
        let changes = self.changes.iter().flat_map(|own| own.user.lags());
        self.linear.lags().into_iter().chain(changes).chain(self.predictions.lags()).collect()
    }

    #[inline]
    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        self.linear.evaluate(sample, sink);
        let mut first = self.linear.count;
        for own in self.changes {
            own.evaluate(sample, &mut From { first, sink });
            first += own.steps.len();
        }
        self.predictions.evaluate(sample, &mut From { first, sink });
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

/// Columns that grow row by row, with room for all of their rows.
pub(crate) struct Growing {
    columns: Vec<RowColumn>,
    rows: usize,
}

impl Growing {
    /// So many that will have so many rows.
    pub(crate) fn new(columns: usize, rows: usize) -> Self {
        Self { columns: vec![RowColumn::default(); columns], rows }
    }

    /// Appends a value to one of them on an axis.
    #[inline]
    pub(crate) fn push(&mut self, parameter: usize, axis: usize, value: f64) {
        self.columns[parameter][axis].get_or_insert_with(|| Vec::with_capacity(self.rows)).push(value);
    }

    /// Appends filtered signals to the columns that they belong to.
    pub(crate) fn append(&mut self, places: &[Place], row: &[f64]) {
        for (place, value) in places.iter().zip(row) {
            self.push(place.parameter, place.axis, *value);
        }
    }

    /// Appends filtered forces, back in body axes.
    pub(crate) fn append_turned_back(&mut self, turned: &[Turned], dcm: &Matrix3<f64>, row: &[f64]) {
        for (Turned { parameter, .. }, force) in turned.iter().zip(row.chunks_exact(3)) {
            let body = dcm * Vector3::new(force[0], force[1], force[2]);
            for (axis, value) in body.iter().enumerate() {
                self.push(*parameter, axis, *value);
            }
        }
    }

    /// The columns with their rows.
    pub(crate) fn into_columns(self) -> Vec<RowColumn> {
        self.columns
    }
}

#[cfg(test)]
mod tests {
    use model::{Model, SampleInput, State};

    use super::*;
    use crate::testing::truth;

    /// What was added, in order.
    #[derive(Default)]
    struct Added(Vec<(Axis, usize, f64)>);

    impl Sink for Added {
        fn add(&mut self, axis: Axis, parameter: usize, value: f64) {
            self.0.push((axis, parameter, value));
        }
    }

    fn added(terms: &impl Terms, sample: &Sample) -> Vec<(Axis, usize, f64)> {
        let mut sink = Added::default();
        terms.evaluate(sample, &mut sink);
        sink.0
    }

    /// Rotors at 600 rad/s, 2 m/s forwards, 1 to the left, 0.5 down, and turning.
    fn moving(plant: &Plant) -> SampleInput {
        let mut state = State::at_rest(Vector3::zeros(), [600.0; 4]);
        state.velocity_m_s = Vector3::new(2.0, -1.0, 0.5);
        state.rate_rad_s = Vector3::new(0.4, -0.3, 0.2);
        plant.input(&state, &[600.0; 4], 12.0)
    }

    /// The thesis' craft has 1.214 kg and beta = 4.100726391e-4 kg m.
    #[test]
    fn parameters_follow_those_of_the_effect_before_and_an_adjusting_effect_has_none() {
        let plant = Plant::new(&Model::new(model::Vehicle::thesis()));
        let input = moving(&plant);
        let terms = LinearEffects::new(&[Effect::Thrust, Effect::MassChange, Effect::LinearDrag]);
        assert_eq!((terms.count(), coefficient_count(Effect::MassChange)), (4, 0));
        let expected = [
            (Axis::W, 0, -4.0 * 600.0 * 600.0 * 4.100726391e-4 / 1.214),
            (Axis::U, 1, 2.0 / 1.214),
            (Axis::V, 2, -1.0 / 1.214),
            (Axis::W, 3, 0.5 / 1.214),
        ];
        let found = added(&terms, &plant.sample_of(&input));
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!((found.0, found.1), (expected.0, expected.1));
            assert!((found.2 / expected.2 - 1.0).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn predictions_come_after_linear_terms_and_are_their_sum() {
        let model = truth();
        let mut weak = model.clone();
        weak.set(Effect::Thrust, &[0.5 * model.term(Effect::Thrust).unwrap().values()[0]]);
        let plants = [&model, &weak].map(Plant::new);
        let input = moving(&plants[0]);
        let both = ColumnsAndPredictions {
            changes: &[],
            linear: LinearEffects::new(&model.effects()),
            predictions: Predictions(plants.iter().collect()),
        };
        let values: Vec<f64> = model.terms.iter().flat_map(|term| term.values()).collect();
        assert_eq!(both.count(), values.len() + 2);
        let mut rows = [[0.0; 3]; 6];
        for (axis, parameter, value) in added(&both, &plants[0].sample_of(&input)) {
            let [sum, predicted @ ..] = &mut rows[axis.index()];
            match parameter.checked_sub(values.len()) {
                None => *sum += values[parameter] * value,
                Some(model) => predicted[model] += value,
            }
        }
        for [sum, predicted, _] in rows {
            // Moments of some 20 rad/s^2 cancel.
            assert!((sum - predicted).abs() < 1e-12, "{rows:?}");
        }
        // Half of the thrust and all of the drag, -0.5 m/s times C_dw a mass.
        let drag = 0.5 * model.term(Effect::LinearDrag).unwrap().values()[2] / 1.214;
        let [_, whole, half] = rows[Axis::W.index()];
        assert!((half - drag - 0.5 * (whole - drag)).abs() < 1e-12, "{rows:?}");
    }

    /// Of three parameters, the first acts forwards and about yaw, the second right and down, the third about roll.
    struct Three;

    impl Terms for Three {
        fn count(&self) -> usize {
            3
        }

        fn evaluate(&self, _: &Sample, sink: &mut impl Sink) {
            sink.add(Axis::V, 1, 10.0);
            sink.add(Axis::P, 2, 20.0);
            sink.add(Axis::W, 1, 30.0);
            sink.add(Axis::R, 0, 40.0);
            sink.add(Axis::U, 0, 50.0);
        }
    }

    /// The slots of the three, moments wanted, with their values.
    fn slots_of_three() -> (Slots, Vec<f64>) {
        let plant = Plant::new(&truth());
        let input = moving(&plant);
        let sample = plant.sample_of(&input);
        let slots = Slots::new(&Three, &sample, |axis| axis >= 3);
        let mut row = vec![0.0; slots.places.len()];
        slots.write(&Three, &sample, &mut row);
        (slots, row)
    }

    #[test]
    fn what_is_wanted_comes_first_and_each_half_by_its_parameters() {
        let (slots, row) = slots_of_three();
        assert_eq!((slots.wanted, &row[..]), (2, &[40.0, 20.0, 50.0, 10.0, 30.0][..]));
        let places: Vec<(usize, usize)> = slots.places.iter().map(|p| (p.parameter, p.axis)).collect();
        assert_eq!(places, [(0, 5), (2, 3), (0, 0), (1, 1), (1, 2)]);
        assert_eq!(slots.slots_but_horizontal_forces().collect::<Vec<_>>(), [0, 1, 4]);
        let mut growing = Growing::new(3, 1);
        growing.append(&slots.places[..2], &row);
        let columns = growing.into_columns();
        assert_eq!((&columns[0][5], &columns[2][3]), (&Some(vec![40.0]), &Some(vec![20.0])));
        assert_eq!(columns.iter().flatten().flatten().count(), 2);
    }

    /// Heading east, forwards is east and right is south.
    #[test]
    fn forces_are_turned_to_the_ground_and_back() {
        let (slots, row) = slots_of_three();
        let turned = slots.forces_by_parameter();
        let east = model::frames::dcm_from_euler(Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let mut ned = [0.0; 6];
        slots.turn_forces(&turned, &east, &row, &mut ned);
        for (found, expected) in ned.iter().zip([0.0, 50.0, 0.0, -10.0, 0.0, 30.0]) {
            assert!((found - expected).abs() < 1e-13, "{ned:?}");
        }
        let mut growing = Growing::new(3, 1);
        growing.append_turned_back(&turned, &east, &ned);
        let columns = growing.into_columns();
        for (parameter, forces) in [(0, [50.0, 0.0, 0.0]), (1, [0.0, 10.0, 30.0])] {
            for (axis, expected) in forces.into_iter().enumerate() {
                let found = columns[parameter][axis].as_ref().unwrap()[0];
                assert!((found - expected).abs() < 1e-13, "{parameter} {axis}: {found}");
            }
        }
        assert_eq!(columns[2], RowColumn::default());
    }
}
