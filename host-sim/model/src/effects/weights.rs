//! The linear effects of a model with their coefficients, and the accelerations that they add up to.

use nalgebra::Vector3;

use crate::axis::Axis;
use crate::effect::{Kind, PlacedSink, Sink};
use crate::effects::{CATALOGUE, Effect, each_linear};
use crate::sample::Sample;
use crate::user_effects::User;

/// The linear effects of a model with the values of their coefficients, in the catalogue's order, and the users'.
#[derive(Debug, Clone)]
pub(crate) struct Weights {
    present: [bool; CATALOGUE.len()],
    /// Of adjusting effects as the model has them.
    coefficients: [[f64; WIDEST]; CATALOGUE.len()],
    users: Vec<(User, Vec<f64>)>,
    /// Whether there is nothing but effects of the thesis' model.
    of_thesis: bool,
    /// Passes in which the angular accelerations are solved for.
    passes: usize,
}

/// Whether an effect is part of the thesis' model.
const fn of_thesis(effect: Effect) -> bool {
    effect.info().special.of_thesis
}

/// Whether an effect is left out where no craft has it.
const fn is_slow(effect: Effect) -> bool {
    effect.info().special.is_slow
}

/// Whether an effect is summed in stages without a branch.
const fn is_straight<const OF_THESIS: bool>(effect: Effect) -> bool {
    of_thesis(effect) || !OF_THESIS && effect.info().special.passes == 1
}

/// Most coefficients of one effect.
pub(crate) const WIDEST: usize = {
    let (mut widest, mut index) = (0, 0);
    while index < CATALOGUE.len() {
        let count = CATALOGUE[index].info().coefficients.len();
        widest = if count > widest { count } else { widest };
        index += 1;
    }
    widest
};

impl Weights {
    /// From a model's effects and the values of their coefficients.
    pub(crate) fn new(terms: impl Iterator<Item = (Effect, Vec<f64>)>) -> Self {
        let mut weights = Self {
            present: [false; CATALOGUE.len()],
            coefficients: [[0.0; WIDEST]; CATALOGUE.len()],
            users: Vec::new(),
            of_thesis: true,
            passes: 1,
        };
        for (effect, values) in terms {
            let Some(index) = effect.place() else {
                if let Effect::User(user) = effect {
                    weights.users.push((user, values));
                    weights.of_thesis = false;
                }
                continue;
            };
            if effect.info().kind == Kind::Adjusting {
                weights.coefficients[index][..values.len()].copy_from_slice(&values);
                continue;
            }
            weights.present[index] = true;
            weights.of_thesis &= of_thesis(effect);
            weights.passes = weights.passes.max(effect.info().special.passes);
            for (sum, value) in weights.coefficients[index].iter_mut().zip(&values) {
                *sum += value;
            }
        }
        weights
    }

    /// Whether there are no other effects than the thesis'.
    pub(crate) fn of_thesis(&self) -> bool {
        self.of_thesis
    }

    /// Whether there is an adjusting effect that takes long.
    pub(crate) fn have_slow(&self) -> bool {
        let acts = |(effect, values): (&Effect, &[f64; WIDEST])| is_slow(*effect) && *values != [0.0; WIDEST];
        CATALOGUE.iter().zip(&self.coefficients).any(acts)
    }

    /// Adds the columns of the effects that `which` picks, times their coefficients.
    #[inline(always)]
    fn weighted_sum(&self, sample: &Sample, which: impl Fn(Effect) -> bool) -> [f64; 6] {
        let mut sink = WeightedSum { coefficients: &self.coefficients, place: 0, sum: [0.0; 6] };
        each_linear(sample, which, &mut sink);
        sink.sum
    }

    /// Whether no column looks at the accelerations, and no formula of a user's at anything.
    pub(crate) fn are_summed_once(&self) -> bool {
        self.passes == 1 && self.users.is_empty()
    }

    /// The six rows at `sample` where no column looks at the accelerations, and, if `OF_THESIS`, there are no other effects than the
    /// thesis'. To be inlined where it is integrated: without a branch, a stage stays in registers.
    #[inline(always)]
    pub(crate) fn straight_accelerations<const OF_THESIS: bool>(&self, sample: &Sample) -> [f64; 6] {
        self.weighted_sum(sample, is_straight::<OF_THESIS>)
    }

    /// The six rows at `sample`. The columns that look at the angular accelerations are iterated until their values agree to
    /// rounding; the others are summed once.
    #[inline(never)]
    pub(crate) fn accelerations(&self, sample: &Sample) -> [f64; 6] {
        let present = |effect: Effect| effect.place().is_some_and(|place| self.present[place]);
        let iterated = |effect: Effect| effect.info().special.passes > 1;
        let mut sum = self.weighted_sum(sample, |effect| !iterated(effect) && present(effect));
        if self.passes > 1 {
            let once = sum;
            let mut input = *sample.input;
            for pass in 0..self.passes {
                if pass > 0 {
                    input.angular_acceleration_rad_s2 = Vector3::new(sum[3], sum[4], sum[5]);
                }
                let more = self.weighted_sum(&Sample { input: &input, ..*sample }, |effect| {
                    iterated(effect) && present(effect)
                });
                sum = std::array::from_fn(|axis| once[axis] + more[axis]);
            }
        }
        for (user, coefficients) in &self.users {
            user.add_accelerations(sample, coefficients, &mut sum);
        }
        sum
    }

    /// The users' effects with the values of their coefficients.
    pub(crate) fn users(&self) -> &[(User, Vec<f64>)] {
        &self.users
    }
}

/// Multiplies columns by coefficients and sums them.
struct WeightedSum<'a> {
    coefficients: &'a [[f64; WIDEST]; CATALOGUE.len()],
    place: usize,
    sum: [f64; 6],
}

impl Sink for WeightedSum<'_> {
    #[inline(always)]
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64) {
        self.sum[axis.index()] += self.coefficients[self.place][coefficient] * value;
    }
}

impl PlacedSink for WeightedSum<'_> {
    #[inline(always)]
    fn begin(&mut self, place: usize) {
        self.place = place;
    }
}

/// The coefficients of craft side by side.
#[derive(Debug, Clone)]
pub(crate) struct WeightsAbreast<const LANES: usize> {
    coefficients: [[[f64; LANES]; WIDEST]; CATALOGUE.len()],
}

impl<const LANES: usize> WeightsAbreast<LANES> {
    /// Of craft that nothing acts on.
    pub(crate) fn new() -> Self {
        Self { coefficients: [[[0.0; LANES]; WIDEST]; CATALOGUE.len()] }
    }

    /// Those of one lane's craft.
    pub(crate) fn set(&mut self, lane: usize, weights: &Weights) {
        for (rows, values) in self.coefficients.iter_mut().zip(&weights.coefficients) {
            rows.iter_mut().zip(values).for_each(|(row, value)| row[lane] = *value);
        }
    }

    /// The coefficients of one effect in one lane, by its place; without `SLOW`, of an effect that takes long those of one that is not
    /// there, which the compiler then leaves out.
    #[inline(always)]
    pub(crate) fn of<const SLOW: bool>(&self, place: usize, lane: usize) -> [f64; WIDEST] {
        if !SLOW && is_slow(CATALOGUE[place]) {
            return [0.0; WIDEST];
        }
        std::array::from_fn(|k| self.coefficients[place][k][lane])
    }

    /// As [`Weights::straight_accelerations`] in one lane.
    #[inline(always)]
    pub(crate) fn straight_accelerations<const OF_THESIS: bool>(
        &self,
        sample: &Sample,
        lane: usize,
    ) -> [f64; 6] {
        let mut sink = SumInLane { coefficients: &self.coefficients, lane, place: 0, sum: [0.0; 6] };
        each_linear(sample, is_straight::<OF_THESIS>, &mut sink);
        sink.sum
    }
}

/// Multiplies columns by the coefficients of one lane and sums them.
struct SumInLane<'a, const LANES: usize> {
    coefficients: &'a [[[f64; LANES]; WIDEST]; CATALOGUE.len()],
    lane: usize,
    place: usize,
    sum: [f64; 6],
}

impl<const LANES: usize> Sink for SumInLane<'_, LANES> {
    #[inline(always)]
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64) {
        self.sum[axis.index()] += self.coefficients[self.place][coefficient][self.lane] * value;
    }
}

impl<const LANES: usize> PlacedSink for SumInLane<'_, LANES> {
    #[inline(always)]
    fn begin(&mut self, place: usize) {
        self.place = place;
    }
}
