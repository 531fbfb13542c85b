//! Terms times hats of one quantity after another, through the filters of the targets.
//!
//! A search over shapes asks for the same terms times hats of every quantity. What the terms multiply does not depend on the quantity: it
//! is formed once. Of all hats, two at most differ from zero at a sample. The rows are those of [`Prepared::columns_of_terms`] with the
//! hats in the terms.

use std::ops::Range;

use model::{LagId, Model, Plant, Sample, SampleInput};
use nalgebra::{Matrix3, Vector3};

use crate::filter::sum_of_products;
use crate::fit::even_hats::{EvenHats, Pair, add_products};
use crate::fit::least_squares::RowColumn;
use crate::fit::slow;
use crate::fit::terms::{Growing, Place, Slots, Terms, Turned};
use crate::prepare::{ForceTarget, Part, Prepared, States, Stretch};

/// What the parameters of terms multiply wherever regressors of a flight are formed, through no filter yet.
pub struct TermSignals {
    /// Moments first.
    layout: Slots,
    /// Parameters that act on forces.
    turned: Vec<Turned>,
    /// Parameters of the terms.
    parameters: usize,
    /// Whether forces are formed elsewhere than moments.
    apart: bool,
    stretches: Vec<StretchSignals>,
}

struct StretchSignals {
    /// Of forces, three for each parameter: over the ground, or in body axes for an accelerometer.
    forces: Signals,
    moments: Signals,
    /// From the axes of the forces' signals to those of the craft, at the rows.
    turns: Vec<Matrix3<f64>>,
}

/// Signals side by side, sample by sample, and the filter that makes rows of them.
#[derive(Default)]
struct Signals {
    width: usize,
    samples: Vec<f64>,
    taps: Vec<f64>,
    /// Samples at which the windows of the rows begin.
    windows: Vec<usize>,
}

/// A quantity, or several side by side, wherever regressors of a flight are formed.
pub struct QuantitySignal {
    /// How many values there are at a sample.
    width: usize,
    stretches: Vec<Formed>,
}

impl QuantitySignal {
    /// What follows from other quantities at a sample.
    pub fn of(others: &[Self], value: impl Fn(&[f64]) -> f64) -> Self {
        Self::several(others, 1, |values, found| found[0] = value(values))
    }

    /// So many values side by side, which `of` writes from those of other quantities at a sample.
    pub fn several(others: &[Self], width: usize, of: impl Fn(&[f64], &mut [f64])) -> Self {
        let stretches = others.first().map_or(0, |other| other.stretches.len());
        let apart = |index: usize| others.iter().any(|own| own.stretches[index].forces.is_some());
        let in_stretch = |index: usize| Formed {
            forces: apart(index).then(|| at_each_sample(others, (index, Formed::forces), width, &of)),
            moments: at_each_sample(others, (index, Formed::moments), width, &of),
        };
        Self { width, stretches: (0..stretches).map(in_stretch).collect() }
    }
}

/// A quantity in a stretch, where its regressors are formed.
struct Formed {
    /// Nothing where forces are formed with the moments.
    forces: Option<Vec<f64>>,
    moments: Vec<f64>,
}

impl Formed {
    fn forces(&self) -> &[f64] {
        self.forces.as_deref().unwrap_or(&self.moments)
    }

    fn moments(&self) -> &[f64] {
        &self.moments
    }
}

impl Prepared {
    /// What terms multiply about a model. Nothing where the slow part of forces is taken from columns: that asks for whole columns.
    pub fn term_signals(&self, terms: &impl Terms, model: &Model) -> Option<TermSignals> {
        if slow::is_taken(self) {
            return None;
        }
        let plant = Plant::new(model);
        let mut signals: Option<TermSignals> = None;
        for stretch in &self.stretches {
            let states = self.remembering_states(stretch, &model.vehicle, &plant, terms.lags());
            let signals = signals.get_or_insert_with(|| {
                let layout = Slots::new(terms, &plant.sample_of(&states.at(0)), |axis| axis >= 3);
                TermSignals {
                    turned: layout.forces_by_parameter(),
                    layout,
                    parameters: terms.count(),
                    apart: self.force_target == ForceTarget::Imu,
                    stretches: Vec::new(),
                }
            });
            let of_stretch = self.signals_of(signals, (terms, &plant), stretch, &states);
            signals.stretches.push(of_stretch);
        }
        signals
    }

    /// Quantities about a model that look back at `lags`; `of` writes their values at a sample.
    pub fn quantity_signals(
        &self,
        count: usize,
        lags: &[LagId],
        model: &Model,
        of: impl Fn(&Sample, &mut [f64]),
    ) -> Vec<QuantitySignal> {
        let plant = Plant::new(model);
        let empty = |_| QuantitySignal { width: 1, stretches: Vec::new() };
        let mut all: Vec<QuantitySignal> = (0..count).map(empty).collect();
        let mut values = vec![0.0; count];
        for stretch in &self.stretches {
            let states = self.remembering_states(stretch, &model.vehicle, &plant, lags.iter().copied());
            let empty = || vec![Vec::with_capacity(states.len()); count];
            let mut moments = empty();
            let mut put = |input: &SampleInput, signals: &mut [Vec<f64>]| {
                of(&plant.sample_of(input), &mut values);
                signals.iter_mut().zip(&values).for_each(|(signal, value)| signal.push(*value));
            };
            states.for_each_between(&Part::whole(stretch), |input| put(input, &mut moments));
            let mut forces = vec![None; count];
            if self.force_target == ForceTarget::Imu {
                let mut apart = empty();
                (0..states.len()).for_each(|k| put(&states.at(k), &mut apart));
                forces = apart.into_iter().map(Some).collect();
            }
            let formed = forces.into_iter().zip(moments).map(|(forces, moments)| Formed { forces, moments });
            all.iter_mut().zip(formed).for_each(|(signal, formed)| signal.stretches.push(formed));
        }
        all
    }

    fn signals_of(
        &self,
        of: &TermSignals,
        (terms, plant): (&impl Terms, &Plant),
        stretch: &Stretch,
        states: &States<'_>,
    ) -> StretchSignals {
        let imu = self.force_target == ForceTarget::Imu;
        let layout = &of.layout;
        let mut values = vec![0.0; layout.places.len()];
        let (mut forces, mut moments) = (Vec::new(), Vec::new());
        let push_forces = |values: &[f64], dcm: &Matrix3<f64>, forces: &mut Vec<f64>| {
            let first = forces.len();
            forces.resize(first + 3 * of.turned.len(), 0.0);
            layout.turn_forces(&of.turned, dcm, values, &mut forces[first..]);
        };
        states.for_each_between(&Part::whole(stretch), |input| {
            layout.write(terms, &plant.sample_of(input), &mut values);
            moments.extend_from_slice(&values[..layout.wanted]);
            if !imu {
                push_forces(&values, &input.dcm, &mut forces);
            }
        });
        if imu {
            for k in 0..states.len() {
                layout.write(terms, &plant.sample_of(&states.at(k)), &mut values);
                push_forces(&values, &Matrix3::identity(), &mut forces);
            }
        }
        let rows = || self.row_samples(stretch, self.fit_stride());
        let signals = |width, samples, taps: Vec<f64>| {
            // As in a filter that takes samples in one by one: half of the taps are ahead of the row, that of the middle among these.
            let windows = rows().map(|row| row + taps.len().div_ceil(2) - taps.len()).collect();
            Signals { width, samples, taps, windows }
        };
        StretchSignals {
            forces: signals(3 * of.turned.len(), forces, self.force_taps()),
            moments: signals(layout.wanted, moments, self.filter.between.clone()),
            turns: rows().map(|row| if imu { Matrix3::identity() } else { states.dcm(row) }).collect(),
        }
    }
}

impl TermSignals {
    /// The parameters that act on each axis. One that acts on a force acts on all three.
    pub fn parameters_by_axis(&self) -> [Vec<usize>; 6] {
        std::array::from_fn(|axis| match axis {
            0..3 => self.turned.iter().map(|turned| turned.parameter).collect(),
            _ => self.moments().iter().filter(|at| at.axis == axis).map(|at| at.parameter).collect(),
        })
    }

    /// What the signals of moments are.
    fn moments(&self) -> &[Place] {
        &self.layout.places[..self.layout.wanted]
    }

    /// So many columns, each a sum of the terms: `weights` writes for each column what each parameter of the terms is multiplied by, from
    /// the values of the quantities at a sample.
    pub fn weighted(
        &self,
        quantities: &[QuantitySignal],
        columns: usize,
        weights: impl Fn(&[f64], &mut [f64]),
    ) -> Vec<RowColumn> {
        let size = columns * self.parameters;
        let rows = self.stretches.iter().map(|stretch| stretch.turns.len()).sum();
        let mut all = Growing::new(columns, rows);
        for (index, stretch) in self.stretches.iter().enumerate() {
            let of_moments = at_each_sample(quantities, (index, Formed::moments), size, &weights);
            let apart =
                self.apart.then(|| at_each_sample(quantities, (index, Formed::forces), size, &weights));
            let of_forces = apart.as_ref().unwrap_or(&of_moments);
            for k in 0..columns {
                let first = k * self.parameters;
                for axis in 3..6 {
                    let acting = self.moments().iter().enumerate().filter(|(_, place)| place.axis == axis);
                    let pairs: Vec<[usize; 2]> =
                        acting.map(|(signal, place)| [signal, first + place.parameter]).collect();
                    if !pairs.is_empty() {
                        let rows = stretch.moments.weighted(&pairs, &of_moments, size);
                        rows.into_iter().for_each(|value| all.push(k, axis, value));
                    }
                }
                if self.turned.is_empty() {
                    continue;
                }
                let along = stretch.forces.weighted_forces(&self.turned, of_forces, (first, size));
                for (row, turn) in stretch.turns.iter().enumerate() {
                    let body = turn * Vector3::from(along.each_ref().map(|axis| axis[row]));
                    body.iter().enumerate().for_each(|(axis, value)| all.push(k, axis, *value));
                }
            }
        }
        all.into_columns()
    }

    /// Terms that are weighted sums of these, which act on forces alone; the weights as in [`Self::weighted`].
    pub fn recombined(
        &self,
        quantities: &[QuantitySignal],
        parameters: usize,
        weights: impl Fn(&[f64], &mut [f64]),
    ) -> Self {
        let size = parameters * self.parameters;
        let of_stretch = |(index, stretch): (usize, &StretchSignals)| {
            let found = at_each_sample(quantities, (index, Formed::forces), size, &weights);
            StretchSignals {
                forces: stretch.forces.recombined(&self.turned, &found, [parameters, self.parameters]),
                moments: Signals::default(),
                turns: stretch.turns.clone(),
            }
        };
        Self {
            layout: Slots::default(),
            turned: (0..parameters).map(|parameter| Turned { parameter, slots: 0..0 }).collect(),
            parameters,
            apart: self.apart,
            stretches: self.stretches.iter().enumerate().map(of_stretch).collect(),
        }
    }

    /// The rows of a fit with a quantity: its products with every hat.
    pub fn times_hats<'a>(&'a self, quantity: &'a QuantitySignal, hats: EvenHats) -> TimesHats<'a> {
        let by_axis = self.parameters_by_axis();
        // Where a signal goes: axis, and place among the parameters of the axis.
        let place =
            |at: &Place| (at.axis, by_axis[at.axis].iter().position(|own| *own == at.parameter).unwrap_or(0));
        let moment_places: Vec<(usize, usize)> = self.moments().iter().map(place).collect();
        let parameters = by_axis.each_ref().map(Vec::len);
        TimesHats {
            signals: self,
            quantity,
            hats,
            moment_places,
            parameters,
            stretch: 0,
            row: 0,
            pairs: [vec![], vec![]],
        }
    }
}

/// Products of terms, a quantity and hats of it as rows of a fit, some at a time: all of a flight would be more than a processor keeps at
/// hand.
pub struct TimesHats<'a> {
    signals: &'a TermSignals,
    quantity: &'a QuantitySignal,
    hats: EvenHats,
    moment_places: Vec<(usize, usize)>,
    /// Parameters that act on each axis.
    parameters: [usize; 6],
    /// Where the next rows are.
    stretch: usize,
    row: usize,
    /// Hats of the quantity in this stretch, where forces and where moments are formed.
    pairs: [Vec<Pair>; 2],
}

/// Some rows of a fit with a quantity.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SomeRows {
    /// Those that were formed before.
    pub past: usize,
    /// Those behind them, which were not.
    pub count: usize,
    /// The hats that they have: all others are zero in all of them.
    pub hats: Range<usize>,
}

impl TimesHats<'_> {
    /// Puts the next rows of each axis in the place of those that there are, so many at most, behind up to `past` that were formed before:
    /// for each parameter that acts on the axis, in order, the filtered products with the hats that are not zero in all of them. Nothing at
    /// the end of the flight. A search forms so many that they are kept in single precision: each is a sum in double precision.
    pub fn next_rows(&mut self, [most, past]: [usize; 2], rows: &mut [Vec<f32>; 6]) -> Option<SomeRows> {
        let Self { signals, quantity, hats, parameters, .. } = *self;
        let (stretch, formed) = (signals.stretches.get(self.stretch)?, quantity.stretches.get(self.stretch)?);
        if self.row == 0 {
            let pairs = |signal: &[f64]| signal.iter().map(|value| hats.pair(*value)).collect();
            self.pairs = [pairs(formed.forces()), pairs(formed.moments())];
        }
        let count = most.min(stretch.turns.len() - self.row);
        let past = past.min(self.row);
        let first_row = self.row - past;
        let of = first_row..self.row + count;
        let [forces, moments] = [(&stretch.forces, &self.pairs[0]), (&stretch.moments, &self.pairs[1])]
            .map(|(signals, pairs)| signals.hats(of.clone(), pairs));
        let live = forces.start.min(moments.start)..forces.end.max(moments.end);
        let widths = parameters.map(|parameters| parameters * live.len());
        for (axis, width) in rows.iter_mut().zip(widths) {
            axis.clear();
            axis.resize(of.len() * width, 0.0);
        }
        let at = |axis: usize, row: usize, place: usize, hat: usize| {
            (row - first_row) * widths[axis] + place * live.len() + hat - live.start
        };
        stretch.moments.for_each_row(of.clone(), &self.pairs[1], hats.count, |row, hat, sums| {
            for ((axis, place), sum) in self.moment_places.iter().zip(sums) {
                rows[*axis][at(*axis, row, *place, hat)] = *sum as f32;
            }
        });
        stretch.forces.for_each_row(of, &self.pairs[0], hats.count, |row, hat, sums| {
            for (place, sum) in sums.as_chunks::<3>().0.iter().enumerate() {
                let body = stretch.turns[row] * Vector3::from(*sum);
                for axis in 0..3 {
                    rows[axis][at(axis, row, place, hat)] = body[axis] as f32;
                }
            }
        });
        self.row += count;
        if self.row == stretch.turns.len() {
            (self.stretch, self.row) = (self.stretch + 1, 0);
        }
        Some(SomeRows { past, count, hats: live })
    }
}

/// What `of` writes for the values of quantities, `size` values at each sample of a stretch, where forces or where moments are formed.
fn at_each_sample(
    quantities: &[QuantitySignal],
    (stretch, formed): (usize, fn(&Formed) -> &[f64]),
    size: usize,
    of: &impl Fn(&[f64], &mut [f64]),
) -> Vec<f64> {
    let signals: Vec<(&[f64], usize)> =
        quantities.iter().map(|own| (formed(&own.stretches[stretch]), own.width)).collect();
    let samples = signals.first().map_or(0, |(signal, width)| signal.len() / width);
    let mut all = vec![0.0; samples * size];
    let mut values = Vec::with_capacity(signals.iter().map(|(_, width)| width).sum());
    for (k, found) in all.chunks_exact_mut(size).enumerate() {
        if let [(signal, width)] = signals[..] {
            of(&signal[k * width..][..width], found);
            continue;
        }
        values.clear();
        for (signal, width) in &signals {
            // One by one: there are few, and a call to copy them would take longer.
            signal[k * width..][..*width].iter().for_each(|value| values.push(*value));
        }
        of(&values, found);
    }
    all
}

/// The sum of forces, each times the weight of its parameter.
#[inline]
fn weighted_sum(forces: &[f64], turned: &[Turned], weights: &[f64]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (force, turned) in forces.as_chunks::<3>().0.iter().zip(turned) {
        let weight = weights[turned.parameter];
        sum.iter_mut().zip(force).for_each(|(sum, along)| *sum += weight * along);
    }
    sum
}

impl Signals {
    /// Weighted sums of forces, so many of so many.
    fn recombined(&self, turned: &[Turned], weights: &[f64], [parameters, of]: [usize; 2]) -> Self {
        let width = 3 * parameters;
        let mut samples = vec![0.0; self.samples.len() / self.width * width];
        let rows = samples.chunks_exact_mut(width).zip(self.samples.chunks_exact(self.width));
        for ((sums, own), weights) in rows.zip(weights.chunks_exact(parameters * of)) {
            for (sum, weights) in sums.as_chunks_mut::<3>().0.iter_mut().zip(weights.chunks_exact(of)) {
                *sum = weighted_sum(own, turned, weights);
            }
        }
        Self { width, samples, taps: self.taps.clone(), windows: self.windows.clone() }
    }

    /// The rows of a sum of forces along three axes: of each of these times its weight, which is behind the first one's at each sample.
    fn weighted_forces(
        &self,
        turned: &[Turned],
        weights: &[f64],
        (first, size): (usize, usize),
    ) -> [Vec<f64>; 3] {
        let mut along = [0; 3].map(|_| Vec::with_capacity(self.samples.len() / self.width));
        for (own, weights) in self.samples.chunks_exact(self.width).zip(weights.chunks_exact(size)) {
            let sum = weighted_sum(own, turned, &weights[first..]);
            along.iter_mut().zip(sum).for_each(|(along, sum)| along.push(sum));
        }
        along.map(|sum| self.filtered(&sum))
    }

    /// The rows of a signal.
    fn filtered(&self, signal: &[f64]) -> Vec<f64> {
        let row = |start: &usize| sum_of_products(&signal[*start..start + self.taps.len()], &self.taps);
        self.windows.iter().map(row).collect()
    }

    /// The rows of a sum: of each of these signals times a weight, of which there are `size` at each sample.
    fn weighted(&self, pairs: &[[usize; 2]], weights: &[f64], size: usize) -> Vec<f64> {
        let at = |(sample, weights): (&[f64], &[f64])| -> f64 {
            pairs.iter().map(|[signal, weight]| sample[*signal] * weights[*weight]).sum()
        };
        let samples = self.samples.chunks_exact(self.width).zip(weights.chunks_exact(size));
        self.filtered(&samples.map(at).collect::<Vec<f64>>())
    }

    /// The hats that differ from zero in the windows of some rows.
    fn hats(&self, rows: Range<usize>, pairs: &[Pair]) -> Range<usize> {
        let starts = self.windows.get(rows).filter(|_| self.width > 0).unwrap_or_default();
        let of_rows = match starts {
            [first, .., last] => &pairs[*first..last + self.taps.len()],
            [only] => &pairs[*only..only + self.taps.len()],
            [] => &[],
        };
        let firsts = || of_rows.iter().map(|pair| pair.first);
        // Where nothing acts, none: neither the lowest nor the highest.
        firsts().min().unwrap_or(usize::MAX)..firsts().max().map_or(0, |last| last + 2)
    }

    /// Hands over, for each row and each hat that differs from zero in its window, the filtered products of the signals with the hat.
    fn for_each_row(
        &self,
        rows: Range<usize>,
        pairs: &[Pair],
        hats: usize,
        mut take: impl FnMut(usize, usize, &[f64]),
    ) {
        if self.width == 0 {
            return;
        }
        let mut sums = vec![0.0; hats * self.width];
        for row in rows {
            let start = self.windows[row];
            let pairs = &pairs[start..start + self.taps.len()];
            let samples = &self.samples[start * self.width..][..self.taps.len() * self.width];
            add_products(samples, &self.taps, pairs, &mut sums);
            let first = pairs.iter().map(|pair| pair.first).min().unwrap_or(0);
            let last = pairs.iter().map(|pair| pair.first + 1).max().unwrap_or(0);
            for hat in first..=last {
                let sums = &mut sums[hat * self.width..][..self.width];
                take(row, hat, sums);
                sums.fill(0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use flights::Flight;
    use model::{Axis, Sink};

    use super::*;
    use crate::testing::{flight, waving_with_imu};

    const HATS: EvenHats = EvenHats { ends: [-1.2, -0.7], count: 5 };

    /// A force on one axis, drag and two moments, each times every hat of the height, or of nothing.
    struct Pushes(Option<EvenHats>);

    impl Terms for Pushes {
        fn count(&self) -> usize {
            4 * self.0.map_or(1, |hats| hats.count)
        }

        fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
            let count = self.0.map_or(1, |hats| hats.count);
            for hat in 0..count {
                let value = match &self.0 {
                    Some(hats) => (1.0 - (hats.place(down(sample)) - hat as f64).abs()).max(0.0),
                    None => 1.0,
                };
                sink.add(Axis::V, hat, value);
                for (axis, speed) in
                    [Axis::U, Axis::V, Axis::W].into_iter().zip(sample.air_velocity_m_s.iter())
                {
                    sink.add(axis, count + hat, -value * speed);
                }
                sink.add(Axis::P, 2 * count + hat, value);
                sink.add(Axis::W, 3 * count + hat, value * sample.input.rate_rad_s.y);
                sink.add(Axis::R, 3 * count + hat, value * sample.input.rate_rad_s.z);
            }
        }
    }

    fn down(sample: &Sample) -> f64 {
        sample.input.position_ned_m.z
    }

    /// Rows of some hats with zeros for the others.
    fn with_all_hats(rows: &[f32], hats: &Range<usize>) -> Vec<f32> {
        let with_zeros = |own: &[f32]| {
            let mut all = [0.0; HATS.count];
            all[hats.clone()].copy_from_slice(own);
            all
        };
        rows.chunks_exact(hats.len()).flat_map(with_zeros).collect()
    }

    /// With hats among the terms, and with terms times hats: the same rows.
    fn agree(flight: &Flight, target: ForceTarget) {
        let model = Model::new(model::Vehicle::thesis());
        let prepared = Prepared::new(flight, &model.vehicle).unwrap();
        assert_eq!(prepared.force_target, target);
        let expected = prepared.columns_of_terms(&Pushes(Some(HATS)), &model);
        let signals = prepared.term_signals(&Pushes(None), &model).unwrap();
        let down = prepared.quantity_signals(1, &[], &model, |sample, values| values[0] = down(sample));
        let mut rows: [Vec<f32>; 6] = Default::default();
        let mut parts = signals.times_hats(&down[0], HATS);
        let mut some: [Vec<f32>; 6] = Default::default();
        let mut before: Option<[Vec<f32>; 6]> = None;
        while let Some(own) = parts.next_rows([7, 3], &mut some) {
            assert!((1..=7).contains(&own.count) && own.past == if before.is_some() { 3 } else { 0 });
            let all = some.each_ref().map(|rows| with_all_hats(rows, &own.hats));
            let split = |axis: usize| all[axis].split_at(all[axis].len() / (own.past + own.count) * own.past);
            if let Some(before) = before {
                (0..6).for_each(|axis| assert!(before[axis].ends_with(split(axis).0), "formed again"));
            }
            (0..6).for_each(|axis| rows[axis].extend(split(axis).1));
            before = Some(all);
        }
        let parameters = signals.parameters_by_axis();
        assert_eq!(parameters, [vec![0, 1, 3], vec![0, 1, 3], vec![0, 1, 3], vec![2], vec![], vec![3]]);
        for (axis, parameters) in parameters.iter().enumerate() {
            let width = parameters.len() * HATS.count;
            for (place, parameter) in parameters.iter().enumerate() {
                for hat in 0..HATS.count {
                    let expected = expected[parameter * HATS.count + hat][axis].as_deref();
                    for (row, values) in rows[axis].chunks_exact(width).enumerate() {
                        let expected = expected.map_or(0.0, |column| column[row]);
                        let value = values[place * HATS.count + hat];
                        let rounding = f64::from(f32::EPSILON) * expected.abs();
                        assert!(
                            (f64::from(value) - expected).abs() <= rounding + 1e-12,
                            "{axis} {parameter} {hat} {row}: {value} {expected}"
                        );
                    }
                }
            }
            assert_eq!(rows[axis].len(), width * prepared.fit_row_times_s().len());
        }
        let hat = |value: f64, hat: usize| (1.0 - (HATS.place(value) - hat as f64).abs()).max(0.0);
        let columns = signals.weighted(&down, 4 * HATS.count, |values, weights| {
            weights.fill(0.0);
            for (k, own) in weights.chunks_exact_mut(4).enumerate() {
                own[k / HATS.count] = hat(values[0], k % HATS.count);
            }
        });
        for (column, expected) in columns.iter().flatten().zip(expected.iter().flatten()) {
            let (own, expected) = (column.as_deref().unwrap_or(&[]), expected.as_deref().unwrap_or(&[]));
            // What a parameter does not act on is zero.
            let at = |k: usize| expected.get(k).copied().unwrap_or(0.0);
            assert!(own.iter().enumerate().all(|(k, own)| (own - at(k)).abs() < 1e-12));
            assert!(own.len() >= expected.len());
        }
    }

    #[test]
    fn terms_times_hats_are_the_columns_of_terms_with_hats() {
        let waving = |samples| {
            flight(samples, |_, row| {
                row.wave();
            })
        };
        agree(&waving(400), ForceTarget::Position);
        agree(&waving_with_imu(400, |force, _| force), ForceTarget::Imu);
    }

    #[test]
    fn a_value_is_shared_by_its_two_hats() {
        let pair = |value| HATS.pair(value);
        assert_eq!((pair(-1.2).first, pair(-1.2).weights), (0, [1.0, 0.0]));
        assert_eq!((pair(-0.7).first, pair(9.0).weights), (3, [0.0, 1.0]));
        let [below, above] = pair(-0.95 + 0.25 * 0.125).weights;
        assert!((below - 0.75).abs() < 1e-12 && (above - 0.25).abs() < 1e-12);
        assert_eq!(pair(f64::NAN).weights, [0.0; 2]);
    }
}
