//! What is left of a flight, made white: the noise of the sensors behind the filters is loud where motion is quick and silent where
//! it is slow, and an effect that acts slowly is found only where that is taken into account.
//!
//! The noise of a row is modelled as two parts: white noise of the sensor through the taps that differentiate it, and white
//! accelerations (gusts, motors) through those that smooth. Their ratio is the one under which the residual is most likely. The
//! predictor is that of Levinson and Durbin (Durbin, Rev. Int. Stat. Inst. 28, 1960, p. 233).

/// Neighbouring rows that a row is predicted from.
pub(crate) const ORDER: usize = 12;
/// Part of the variance that is white at the rows whatever the taps say: rounding, jitter.
const FLOOR: f64 = 0.01;
/// Part of accelerations in the variance of the noise, tried.
const PARTS: [f64; 9] = [0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 0.95];

/// Predicts a row from those before it, by as many as there are.
#[derive(Debug, Clone)]
pub(crate) struct Whitening {
    /// Of each order: the predictor's coefficients, and the prediction's variance as a part of the whole.
    orders: Vec<(Vec<f64>, f64)>,
}

impl Whitening {
    /// Of noise with this autocovariance at multiples of the rows' period.
    pub(crate) fn new(autocovariance: &[f64]) -> Self {
        let scale = autocovariance[0];
        let r = |lag: usize| autocovariance.get(lag).map_or(0.0, |value| value / scale);
        let mut orders = vec![(Vec::new(), 1.0)];
        let (mut a, mut variance) = (Vec::<f64>::new(), 1.0_f64);
        for order in 1..=ORDER {
            let ahead: f64 = a.iter().enumerate().map(|(k, a)| a * r(order - 1 - k)).sum();
            let reflection = (r(order) - ahead) / variance;
            let mut next: Vec<f64> = (0..order - 1).map(|k| a[k] - reflection * a[order - 2 - k]).collect();
            next.push(reflection);
            variance *= 1.0 - reflection * reflection;
            a = next;
            orders.push((a.clone(), variance));
        }
        Self { orders }
    }

    /// A signal over rows with what its past predicts taken out, each row at the scale of its prediction; pieces begin at `starts`.
    pub(crate) fn apply(&self, signal: &[f64], starts: &[usize]) -> Vec<f64> {
        let mut white = Vec::with_capacity(signal.len());
        for (index, &start) in starts.iter().enumerate() {
            let piece = &signal[start..starts.get(index + 1).copied().unwrap_or(signal.len())];
            for k in 0..piece.len() {
                let (a, variance) = &self.orders[k.min(ORDER)];
                let predicted: f64 = a.iter().zip(piece[..k].iter().rev()).map(|(a, past)| a * past).sum();
                white.push((piece[k] - predicted) / variance.sqrt());
            }
        }
        white
    }

    /// The same for signals side by side in single precision, `width` values to a row, times `scale`. The first `past` rows stay as they
    /// are: the others are predicted from them too. The first of the others is row `first` of its flight.
    pub(crate) fn apply_to_rows(
        &self,
        (rows, width): (&mut [f32], usize),
        (past, first): (usize, usize),
        starts: &[usize],
        scale: f64,
    ) {
        if width == 0 {
            return;
        }
        // From the last to the first, so that what a row is predicted from is still as it was.
        for row in (past..rows.len() / width).rev() {
            let in_flight = first + row - past;
            let begun = starts.partition_point(|start| *start <= in_flight);
            let start = begun.checked_sub(1).map_or(0, |piece| starts[piece]);
            let (a, variance) = &self.orders[(in_flight - start).min(ORDER)];
            let (before, ahead) = rows.split_at_mut(row * width);
            take_out_predicted(&mut ahead[..width], before, a, (scale / variance.sqrt()) as f32);
        }
    }

    /// Logarithm of the variances of the predictions over pieces of rows, but for what long pieces have in common per row.
    fn log_variance(&self, starts: &[usize], rows: usize) -> f64 {
        let mut sum = 0.0;
        for (index, &start) in starts.iter().enumerate() {
            let length = starts.get(index + 1).copied().unwrap_or(rows) - start;
            sum += (0..length).map(|k| self.orders[k.min(ORDER)].1.ln()).sum::<f64>();
        }
        sum
    }
}

/// Takes out of a row what those before it predict, the nearest at the end of `past`; the rest times `scale`.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn take_out_predicted(row: &mut [f32], past: &[f32], a: &[f64], scale: f32) {
    let mut coefficients = [0.0; ORDER];
    coefficients.iter_mut().zip(a).for_each(|(own, a)| *own = *a as f32);
    let by = (past, row.len(), &coefficients[..a.len()], scale);
    // As many values at once as registers hold.
    let rest = take_out::<64>(row, by);
    let rest = take_out::<16>(rest, by);
    let rest = take_out::<4>(rest, by);
    take_out::<1>(rest, by);
}

/// The same for the last values of a row, so many at once. Those at its end that are fewer are handed back.
#[inline(always)]
fn take_out<'a, const VALUES: usize>(
    last: &'a mut [f32],
    (past, width, a, scale): (&[f32], usize, &[f32], f32),
) -> &'a mut [f32] {
    let first = width - last.len();
    let (groups, rest) = last.as_chunks_mut::<VALUES>();
    for (group, values) in groups.iter_mut().enumerate() {
        let mut left = *values;
        for (a, before) in a.iter().zip(past.rchunks_exact(width)) {
            let Some(before) = before[first + group * VALUES..].first_chunk::<VALUES>() else { break };
            left.iter_mut().zip(before).for_each(|(value, before)| *value -= a * before);
        }
        *values = left.map(|value| value * scale);
    }
    rest
}

/// Autocovariance at multiples of `stride` samples of unit white noise behind taps.
pub(crate) fn behind(taps: &[f64], stride: usize) -> Vec<f64> {
    (0..=ORDER)
        .map(|lag| taps.iter().skip(lag * stride).zip(taps).map(|(ahead, tap)| ahead * tap).sum())
        .collect()
}

/// Rows of one axis of one flight, and the taps that its noise went through.
pub(crate) struct NoisyRows<'a> {
    pub(crate) signal: &'a [f64],
    pub(crate) starts: &'a [usize],
    /// Autocovariance of the sensor's noise at the rows.
    pub(crate) sensor: &'a [f64],
    /// Autocovariance of white accelerations at the rows.
    pub(crate) acceleration: &'a [f64],
}

impl NoisyRows<'_> {
    fn whitening(&self, part: f64) -> Whitening {
        let mut mixed: Vec<f64> = self
            .sensor
            .iter()
            .zip(self.acceleration)
            .map(|(s, a)| (1.0 - part) * s / self.sensor[0] + part * a / self.acceleration[0])
            .collect();
        mixed[0] += FLOOR;
        Whitening::new(&mixed)
    }
}

/// The whitening of each flight under which their residuals are most likely together, and the standard deviation of what it leaves.
pub(crate) fn most_likely(flights: &[NoisyRows<'_>]) -> (Vec<Whitening>, f64) {
    let rows: usize = flights.iter().map(|flight| flight.signal.len()).sum();
    let judged = PARTS.map(|part| {
        let whitenings: Vec<Whitening> = flights.iter().map(|flight| flight.whitening(part)).collect();
        let (mut squares, mut volume) = (0.0, 0.0);
        for (flight, whitening) in flights.iter().zip(&whitenings) {
            squares += whitening.apply(flight.signal, flight.starts).iter().map(|e| e * e).sum::<f64>();
            volume += whitening.log_variance(flight.starts, flight.signal.len());
        }
        let variance = squares / rows.max(1) as f64;
        (rows as f64 * variance.max(f64::MIN_POSITIVE).ln() + volume, whitenings, variance.sqrt())
    });
    let best = judged.into_iter().min_by(|one, other| one.0.total_cmp(&other.0));
    best.map_or((Vec::new(), 1.0), |(_, whitenings, deviation)| (whitenings, deviation.max(1e-12)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A signal whose next value is 0.8 of the last and a new one has the autocovariance 0.8^lag, and its best predictor is that.
    #[test]
    fn the_predictor_of_a_first_order_signal_is_its_recursion() {
        let covariance: Vec<f64> = (0..=ORDER).map(|lag| 2.5 * 0.8_f64.powi(lag as i32)).collect();
        let whitening = Whitening::new(&covariance);
        let (a, variance) = &whitening.orders[ORDER];
        assert!((a[0] - 0.8).abs() < 1e-12 && a[1..].iter().all(|a| a.abs() < 1e-12), "{a:?}");
        assert!((variance - 0.36).abs() < 1e-12);
    }

    #[test]
    fn pieces_are_predicted_from_their_own_past_alone() {
        let covariance: Vec<f64> = (0..=ORDER).map(|lag| 0.5_f64.powi(lag as i32)).collect();
        let whitening = Whitening::new(&covariance);
        let white = whitening.apply(&[1.0, 0.5, 0.25, 1.0, 0.5], &[0, 3]);
        let expected = [1.0, 0.0, 0.0, 1.0, 0.0];
        assert!(white.iter().zip(expected).all(|(w, e)| (w - e).abs() < 1e-12), "{white:?}");
    }

    /// So many that they are taken 64, 16, 4 and 1 at a time, and fewer.
    #[test]
    fn signals_side_by_side_become_what_each_becomes_by_itself() {
        let covariance: Vec<f64> = (0..=ORDER).map(|lag| 0.7_f64.powi(lag as i32)).collect();
        let whitening = Whitening::new(&covariance);
        let starts = [0, 17];
        for width in [3, 64 + 16 + 4 + 1] {
            let signal = |k: usize| (0..40).map(|row| (0.1 * (row * row + 3 * k) as f64).sin()).collect();
            let signals: Vec<Vec<f64>> = (0..width).map(signal).collect();
            let mut rows: Vec<f32> =
                (0..40).flat_map(|row| signals.iter().map(move |s| s[row] as f32)).collect();
            // All at once, and the last 15 behind the 25 before them.
            let mut last = rows.clone();
            whitening.apply_to_rows((&mut last, width), (25, 25), &starts, 2.0);
            whitening.apply_to_rows((&mut rows, width), (0, 0), &starts, 2.0);
            assert_eq!(last[25 * width..], rows[25 * width..]);
            for (k, signal) in signals.iter().enumerate() {
                let white = whitening.apply(signal, &starts);
                let own = rows.iter().skip(k).step_by(width);
                assert!(own.zip(white).all(|(row, white)| (f64::from(*row) - 2.0 * white).abs() < 1e-6));
            }
        }
    }

    /// Behind (1, -1), unit white noise has the variance 2 and is the opposite of its neighbours by half.
    #[test]
    fn noise_behind_a_difference_is_known() {
        assert_eq!(behind(&[1.0, -1.0], 1)[..3], [2.0, -1.0, 0.0]);
        assert_eq!(behind(&[1.0, -1.0], 2)[..2], [2.0, 0.0]);
    }
}
