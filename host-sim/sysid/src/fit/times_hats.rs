//! Terms times hats of one quantity after another, through the filters of the targets.
//!
//! A search over shapes asks for the same terms times hats of every quantity. What the terms multiply does not depend on the quantity: it
//! is formed once. Of all hats, two at most differ from zero at a sample. The rows are those of [`Prepared::columns_of_terms`] with the
//! hats in the terms.

use model::{LagId, Model, Plant, Sample, SampleInput};
use nalgebra::{Matrix3, Vector3};

use crate::fit::slow;
use crate::fit::terms::{Place, Slots, Terms, Turned};
use crate::prepare::{ForceTarget, Part, Prepared, States, Stretch};

/// What the parameters of terms multiply wherever regressors of a flight are formed, through no filter yet.
pub struct TermSignals {
    /// Moments first.
    layout: Slots,
    /// Parameters that act on forces.
    turned: Vec<Turned>,
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
struct Signals {
    width: usize,
    samples: Vec<f64>,
    taps: Vec<f64>,
    /// Samples at which the windows of the rows begin.
    windows: Vec<usize>,
}

/// A quantity wherever regressors of a flight are formed, by stretch.
pub struct QuantitySignal(Vec<Formed>);

/// A quantity in a stretch, where its regressors are formed.
struct Formed {
    forces: Vec<f64>,
    moments: Vec<f64>,
}

/// Hats over knots that are evenly spaced, each 1 at its own knot and 0 at the others.
#[derive(Debug, Clone, Copy)]
pub struct EvenHats {
    /// First and last knot.
    pub ends: [f64; 2],
    /// Knots, two at least.
    pub count: usize,
}

impl EvenHats {
    /// Where a knot lies.
    pub fn knot(&self, k: usize) -> f64 {
        let [low, high] = self.ends;
        low + (high - low) * k as f64 / (self.count - 1) as f64
    }

    /// The place of a value among the knots, from 0 to the last; what is beyond them is at their ends.
    #[inline]
    pub fn place(&self, value: f64) -> f64 {
        let [low, high] = self.ends;
        let last = (self.count - 1) as f64;
        ((value - low) * (last / (high - low))).clamp(0.0, last)
    }

    /// The two hats that differ from zero at a value.
    fn pair(&self, value: f64) -> Pair {
        let place = self.place(value);
        if place.is_nan() {
            return Pair { first: 0, weights: [0.0; 2] };
        }
        let first = (place as usize).min(self.count - 2);
        let above = place - first as f64;
        Pair { first, weights: [1.0 - above, above] }
    }
}

#[derive(Debug, Clone, Copy)]
struct Pair {
    first: usize,
    weights: [f64; 2],
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
                TermSignals { turned: layout.forces_by_parameter(), layout, stretches: Vec::new() }
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
        let mut all: Vec<QuantitySignal> = (0..count).map(|_| QuantitySignal(Vec::new())).collect();
        let mut values = vec![0.0; count];
        for stretch in &self.stretches {
            let states = self.remembering_states(stretch, &model.vehicle, &plant, lags.iter().copied());
            let empty = || vec![Vec::with_capacity(states.len()); count];
            let (mut moments, mut forces) = (empty(), empty());
            let mut put = |input: SampleInput, signals: &mut [Vec<f64>]| {
                of(&plant.sample_of(&input), &mut values);
                signals.iter_mut().zip(&values).for_each(|(signal, value)| signal.push(*value));
            };
            states.for_each_between(&Part::whole(stretch), |input| put(input, &mut moments));
            if self.force_target == ForceTarget::Imu {
                (0..states.len()).for_each(|k| put(states.at(k), &mut forces));
            } else {
                forces.clone_from(&moments);
            }
            let formed = forces.into_iter().zip(moments).map(|(forces, moments)| Formed { forces, moments });
            all.iter_mut().zip(formed).for_each(|(signal, formed)| signal.0.push(formed));
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
            layout.write(terms, &plant.sample_of(&input), &mut values);
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

    /// Appends the rows of a fit to those of each axis: for each parameter that acts on it, in order, the filtered products with every
    /// hat.
    pub fn append_times_hats(&self, quantity: &QuantitySignal, hats: &EvenHats, rows: &mut [Vec<f64>; 6]) {
        let by_axis = self.parameters_by_axis();
        // Where a signal goes: axis, and place among the parameters of the axis.
        let place =
            |at: &Place| (at.axis, by_axis[at.axis].iter().position(|own| *own == at.parameter).unwrap_or(0));
        let moment_places: Vec<(usize, usize)> = self.moments().iter().map(place).collect();
        let widths = by_axis.each_ref().map(|parameters| parameters.len() * hats.count);
        for (stretch, formed) in self.stretches.iter().zip(&quantity.0) {
            let firsts = rows.each_ref().map(Vec::len);
            for ((axis, first), width) in rows.iter_mut().zip(firsts).zip(widths) {
                axis.resize(first + stretch.turns.len() * width, 0.0);
            }
            stretch.moments.for_each_row(&formed.moments, hats, |row, hat, sums| {
                for ((axis, place), sum) in moment_places.iter().zip(sums) {
                    rows[*axis][firsts[*axis] + row * widths[*axis] + place * hats.count + hat] = *sum;
                }
            });
            stretch.forces.for_each_row(&formed.forces, hats, |row, hat, sums| {
                for (place, sum) in sums.as_chunks::<3>().0.iter().enumerate() {
                    let body = stretch.turns[row] * Vector3::from(*sum);
                    for axis in 0..3 {
                        rows[axis][firsts[axis] + row * widths[axis] + place * hats.count + hat] = body[axis];
                    }
                }
            });
        }
    }
}

impl Signals {
    /// Hands over, for each row and each hat that differs from zero in its window, the filtered products of the signals with the hat.
    fn for_each_row(&self, quantity: &[f64], hats: &EvenHats, mut take: impl FnMut(usize, usize, &[f64])) {
        if self.width == 0 {
            return;
        }
        let pairs: Vec<Pair> = quantity.iter().map(|value| hats.pair(*value)).collect();
        let mut sums = vec![0.0; hats.count * self.width];
        for (row, &start) in self.windows.iter().enumerate() {
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

/// Adds signals in a window times taps times hats to the sums of each hat.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn add_products(samples: &[f64], taps: &[f64], pairs: &[Pair], sums: &mut [f64]) {
    let width = samples.len() / taps.len();
    for ((sample, tap), pair) in samples.chunks_exact(width).zip(taps).zip(pairs) {
        let [below, above] = pair.weights.map(|weight| tap * weight);
        let (lower, upper) = sums[pair.first * width..][..2 * width].split_at_mut(width);
        for ((lower, upper), value) in lower.iter_mut().zip(upper).zip(sample) {
            *lower += below * value;
            *upper += above * value;
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

    /// With hats among the terms, and with terms times hats: the same rows.
    fn agree(flight: &Flight, target: ForceTarget) {
        let model = Model::new(model::Vehicle::thesis());
        let prepared = Prepared::new(flight, &model.vehicle).unwrap();
        assert_eq!(prepared.force_target, target);
        let expected = prepared.columns_of_terms(&Pushes(Some(HATS)), &model);
        let signals = prepared.term_signals(&Pushes(None), &model).unwrap();
        let down = prepared.quantity_signals(1, &[], &model, |sample, values| values[0] = down(sample));
        let mut rows: [Vec<f64>; 6] = Default::default();
        signals.append_times_hats(&down[0], &HATS, &mut rows);
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
                        assert!(
                            (value - expected).abs() < 1e-12,
                            "{axis} {parameter} {hat} {row}: {value} {expected}"
                        );
                    }
                }
            }
            assert_eq!(rows[axis].len(), width * prepared.fit_row_times_s().len());
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
