//! Hats over evenly spaced knots, and sums of products with them: every piecewise straight shape is a weighted sum of these.

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
    pub(super) fn pair(&self, value: f64) -> Pair {
        let place = self.place(value);
        if place.is_nan() {
            return Pair { first: 0, weights: [0.0; 2] };
        }
        let first = (place as usize).min(self.count - 2);
        let above = place - first as f64;
        Pair { first, weights: [1.0 - above, above] }
    }
}

/// The two hats that differ from zero at a value.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// The lower one.
    pub(super) first: usize,
    /// Of it and of the next one.
    pub(super) weights: [f64; 2],
}

/// Adds signals in a window times taps times hats to the sums of each hat.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
pub(super) fn add_products(samples: &[f64], taps: &[f64], pairs: &[Pair], sums: &mut [f64]) {
    let width = samples.len() / taps.len();
    let mut first = 0;
    // A quantity stays between the same two knots for some samples.
    for alike in pairs.chunk_by(|one, other| one.first == other.first) {
        let of = first..first + alike.len();
        let run = Run { samples: &samples[of.start * width..of.end * width], taps: &taps[of], pairs: alike };
        run.add(&mut sums[alike[0].first * width..][..2 * width]);
        first += alike.len();
    }
}

/// Neighbouring samples that the same two hats differ from zero at.
struct Run<'a> {
    samples: &'a [f64],
    taps: &'a [f64],
    pairs: &'a [Pair],
}

impl Run<'_> {
    /// Adds it to the sums of the lower hat and of the upper one behind it, as many signals at once as registers hold.
    #[inline(always)]
    fn add(&self, sums: &mut [f64]) {
        let width = sums.len() / 2;
        let mut signal = 0;
        while signal + 16 <= width {
            self.add_to::<16>(sums, signal);
            signal += 16;
        }
        if signal + 8 <= width {
            self.add_to::<8>(sums, signal);
            signal += 8;
        }
        // Forces come in threes.
        while signal + 3 <= width {
            self.add_to::<3>(sums, signal);
            signal += 3;
        }
        (signal..width).for_each(|signal| self.add_to::<1>(sums, signal));
    }

    /// Of so many signals from one on.
    #[inline(always)]
    fn add_to<const SIGNALS: usize>(&self, sums: &mut [f64], signal: usize) {
        let width = sums.len() / 2;
        let (lower, upper) = sums.split_at_mut(width);
        let [Some(lower), Some(upper)] = [lower, upper].map(|hat| hat[signal..].first_chunk_mut::<SIGNALS>())
        else {
            return;
        };
        let (mut below, mut above) = (*lower, *upper);
        for ((sample, tap), pair) in self.samples.chunks_exact(width).zip(self.taps).zip(self.pairs) {
            let Some(values) = sample[signal..].first_chunk::<SIGNALS>() else { return };
            let weights = pair.weights.map(|weight| tap * weight);
            for k in 0..SIGNALS {
                below[k] += weights[0] * values[k];
                above[k] += weights[1] * values[k];
            }
        }
        (*lower, *upper) = (below, above);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of so many signals that they are added 16, 8, 3 and 1 at a time, and of fewer: to the last bit what one after the other gives.
    #[test]
    fn signals_side_by_side_are_added_as_each_by_itself() {
        let wave = |k: usize| (0.7 * k as f64).sin();
        let hats = EvenHats { ends: [-1.0, 1.0], count: 5 };
        let pairs: Vec<Pair> = (0..23).map(|k| hats.pair((0.3 * k as f64).sin())).collect();
        let taps: Vec<f64> = (0..pairs.len()).map(|k| wave(k + 5)).collect();
        for width in (1..=5).chain([6, 16 + 8 + 3 + 1]) {
            let samples: Vec<f64> = (0..width * pairs.len()).map(wave).collect();
            let mut sums = vec![0.25; hats.count * width];
            let mut expected = sums.clone();
            add_products(&samples, &taps, &pairs, &mut sums);
            for ((sample, tap), pair) in samples.chunks(width).zip(&taps).zip(&pairs) {
                for (hat, weight) in (pair.first..).zip(pair.weights) {
                    let own = expected[hat * width..][..width].iter_mut().zip(sample);
                    own.for_each(|(sum, value)| *sum += tap * weight * value);
                }
            }
            assert_eq!(sums, expected, "{width}");
        }
    }
}
