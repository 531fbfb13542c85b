//! The polynomial regression filter of section 4.2.4, and the smoothing that belongs to its derivative.
//!
//! A polynomial of order M = 4 is fitted by least squares to a window of W = 0.3 s about each sample (4.8), (4.9); its
//! value and slope there are the smoothed signal and its derivative. Both are symmetric FIR filters without lag. The
//! thesis prints the derivative per sample; here it is divided by the sampling period.
//!
//! **Why a third filter.** The thesis regresses the filtered *derivative* of a velocity on *smoothed* regressors. The two
//! filters do not pass the same frequencies (at 20 rad/s the derivative is 13 % low, the smoother 2 %), so whatever
//! the motors do at several hertz is underestimated: on simulated flights with known truth the rotor moment
//! coefficients come out 3 % low. The derivative filter is the exact derivative of *some* smoother: `D y = sum d_k y_k`
//! rearranges, by summation by parts, to a weighted mean of the increments of `y`. Applying that same weighted mean
//! ([`RegressionFilter::between`]) to the regressors puts both sides of the equation through one filter, and the bias is gone.
//!
//! **Speed.** The widest vector instructions of the machine at hand are chosen when the program runs, without fused
//! multiply-add and with sums in a fixed order, so that every machine gives the same bits.

/// The taps, from n = -half to n = half, for use as `sum over n of tap[n] * signal[center + n]`.
#[derive(Debug, Clone, PartialEq)]
pub struct RegressionFilter {
    /// Smoothing taps: first row of G in (4.9).
    pub smooth: Vec<f64>,
    /// Derivative taps in 1/s: second row of G divided by the sampling period.
    pub derivative: Vec<f64>,
    /// The smoother whose derivative `derivative` is: weights of the means of a signal *between* neighbouring samples, one
    /// fewer than the other taps.
    pub between: Vec<f64>,
    /// The same for a signal known at samples, whose mean between two of them is taken as that of its ends.
    pub matched: Vec<f64>,
}

impl RegressionFilter {
    /// Order of the polynomial, M in (4.8).
    pub const ORDER: usize = 4;
    /// Window, W in (4.8), s.
    pub const WINDOW_S: f64 = 0.3;

    /// The filter for a sampling period in s.
    pub fn new(period_s: f64) -> Self {
        Self::with_window(period_s, Self::WINDOW_S)
    }

    /// The filter for a sampling period and a window of its own, both in s.
    pub fn with_window(period_s: f64, window_s: f64) -> Self {
        let [smooth, slope] = polynomial_taps(half_of(period_s, window_s));
        let derivative: Vec<f64> = slope.iter().map(|g| g / period_s).collect();
        let between = between_taps(&slope);
        Self { smooth, matched: matched_taps(&between), between, derivative }
    }

    /// The smoothing taps alone, over a window of `window_s`.
    pub fn smoothing_taps(period_s: f64, window_s: f64) -> Vec<f64> {
        let [smooth, _] = polynomial_taps(half_of(period_s, window_s));
        smooth
    }

    /// Fewest samples that give as many rows as the filter has taps, where `margin` of them have none at either end.
    pub(crate) fn shortest_stretch(&self, margin: usize) -> usize {
        2 * margin + self.smooth.len()
    }

    /// Samples on either side of the center.
    pub fn half(&self) -> usize {
        self.smooth.len() / 2
    }
}

/// Samples on either side of the center of a window. It needs more samples than the polynomial has coefficients.
fn half_of(period_s: f64, window_s: f64) -> usize {
    ((0.5 * window_s / period_s).round() as usize).max(3)
}

/// Value and slope (per sample) at the center of the least-squares polynomial of order 4 over 2 half + 1 samples.
///
/// The window is symmetric, so even and odd powers separate and the normal equations (4.9) split into one system of
/// three and one of two unknowns, solved in closed form with window sums that are exact integers.
fn polynomial_taps(half: usize) -> [Vec<f64>; 2] {
    let moment = |power: i32| (1..=half).map(|n| 2.0 * (n as f64).powi(power)).sum::<f64>();
    let (s0, s2, s4, s6, s8) = (moment(0) + 1.0, moment(2), moment(4), moment(6), moment(8));
    // Cofactors of the first row of [[s0 s2 s4][s2 s4 s6][s4 s6 s8]].
    let (c0, c2, c4) = (s4 * s8 - s6 * s6, s4 * s6 - s2 * s8, s2 * s6 - s4 * s4);
    let even = s0 * c0 + s2 * c2 + s4 * c4;
    let odd = s2 * s6 - s4 * s4;
    let positions = -(half as i64)..=half as i64;
    let smooth = positions.clone().map(|n| {
        let n2 = (n * n) as f64;
        (c0 + n2 * (c2 + n2 * c4)) / even
    });
    let slope = positions.map(|n| {
        let n1 = n as f64;
        n1 * (s6 - s4 * n1 * n1) / odd
    });
    [smooth.collect(), slope.collect()]
}

/// Summation by parts: `sum d_n y_n = sum K_n (y_{n+1} - y_n)` with `K_n = -(d_{-half} + ... + d_n)`; an increment is the
/// mean of y' over one period, times the period.
fn between_taps(slope: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    slope[..slope.len() - 1]
        .iter()
        .map(|d| {
            sum -= d;
            sum
        })
        .collect()
}

fn matched_taps(between: &[f64]) -> Vec<f64> {
    let mut taps = vec![0.0; between.len() + 1];
    for (k, weight) in between.iter().enumerate() {
        taps[k] += 0.5 * weight;
        taps[k + 1] += 0.5 * weight;
    }
    taps
}

/// Filters `signal` where the window fits; the first and last `taps.len() / 2` values are `end(k)`.
pub fn convolve(signal: &[f64], taps: &[f64], end: impl Fn(usize) -> f64) -> Vec<f64> {
    let half = taps.len() / 2;
    if signal.len() < taps.len() {
        return (0..signal.len()).map(end).collect();
    }
    let last = signal.len() - half;
    let mut result = Vec::with_capacity(signal.len());
    result.extend((0..half).map(&end));
    append_weighted_sums(signal, taps, &mut result);
    result.extend((last..signal.len()).map(&end));
    result
}

/// The taps of one filter after another.
pub fn compose(first: &[f64], second: &[f64]) -> Vec<f64> {
    let mut taps = vec![0.0; first.len() + second.len() - 1];
    for (k, a) in first.iter().enumerate() {
        taps[k..].iter_mut().zip(second).for_each(|(tap, b)| *tap += a * b);
    }
    taps
}

/// Numbers of the widest vector registers, or of two of the next smaller ones.
const LANES: usize = 8;

/// `sum over k of taps[k] * signal[k]`, a filter at one place; `signal` may go on.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
pub fn sum_of_products(signal: &[f64], taps: &[f64]) -> f64 {
    let signal = &signal[..taps.len()];
    let mut sums = [0.0; LANES];
    let (signals, signal_rest) = signal.as_chunks::<LANES>();
    let (groups, tap_rest) = taps.as_chunks::<LANES>();
    for (s, t) in signals.iter().zip(groups) {
        for i in 0..LANES {
            sums[i] += s[i] * t[i];
        }
    }
    let rest: f64 = signal_rest.iter().zip(tap_rest).map(|(s, t)| s * t).sum();
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (c + g)) + ((b + f) + (d + h)) + rest
}

/// Signals side by side through one symmetric filter: samples come in one at a time, results are formed where they are
/// wanted. Only a few windows of samples are kept, in the nearest caches.
pub struct SideBySide {
    /// From the ends of the window inwards; half of the centre's, which is met from both sides.
    folded_taps: Vec<f64>,
    /// Samples in a window.
    window: usize,
    signals: usize,
    /// Groups of signals in a sample, the last filled up.
    groups: usize,
    samples: Vec<[f64; LANES]>,
    /// Groups of `samples` in use.
    filled: usize,
}

impl SideBySide {
    /// Room for so many `signals` that all pass the filter of these `taps`.
    pub fn new(taps: &[f64], signals: usize) -> Self {
        let mut folded_taps = taps[..taps.len().div_ceil(2)].to_vec();
        if let (1, Some(centre)) = (taps.len() % 2, folded_taps.last_mut()) {
            *centre *= 0.5;
        }
        let groups = signals.div_ceil(LANES);
        let samples = vec![[0.0; LANES]; 3 * taps.len() * groups];
        Self { folded_taps, window: taps.len(), signals, groups, samples, filled: 0 }
    }

    /// Samples from the centre of the window to its end, the centre's included where it falls on one.
    pub fn reach(&self) -> usize {
        self.folded_taps.len()
    }

    /// Room for the next sample of all signals.
    #[inline]
    pub fn push(&mut self) -> &mut [f64] {
        if self.filled == self.samples.len() {
            let kept = (self.window - 1) * self.groups;
            self.samples.copy_within(self.filled - kept.., 0);
            self.filled = kept;
        }
        let start = self.filled;
        self.filled += self.groups;
        &mut self.samples[start..self.filled].as_flattened_mut()[..self.signals]
    }

    /// The latest sample.
    pub fn latest(&self) -> &[f64] {
        &self.samples[self.filled - self.groups..self.filled].as_flattened()[..self.signals]
    }

    /// The first of the signals, as many as `out` takes, filtered; the window ends at the latest sample.
    pub fn filtered(&self, out: &mut [f64]) {
        let window = &self.samples[self.filled - self.window * self.groups..self.filled];
        for (group, out) in out.chunks_mut(LANES).enumerate() {
            let sums = folded_sums(window, self.groups, group, &self.folded_taps);
            out.copy_from_slice(&sums[..out.len()]);
        }
    }
}

/// A group of signals through a symmetric filter: the two samples of a tap are added first.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn folded_sums(window: &[[f64; LANES]], groups: usize, group: usize, folded_taps: &[f64]) -> [f64; LANES] {
    let (ahead, back) = (window.chunks_exact(groups), window.rchunks_exact(groups));
    let mut sums = [0.0; LANES];
    for ((a, b), tap) in ahead.zip(back).zip(folded_taps) {
        let (a, b) = (&a[group], &b[group]);
        for i in 0..LANES {
            sums[i] += tap * (a[i] + b[i]);
        }
    }
    sums
}

/// Appends `sum over k of taps[k] * signal[i + k]` for every i where the window fits.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn append_weighted_sums(signal: &[f64], taps: &[f64], out: &mut Vec<f64>) {
    // As many running sums as stay in registers.
    const BLOCK: usize = 4 * LANES;
    let count = signal.len() + 1 - taps.len();
    for start in (0..count - count % BLOCK).step_by(BLOCK) {
        let mut sums = [0.0; BLOCK];
        for (k, tap) in taps.iter().enumerate() {
            let Some(window) = signal[start + k..].first_chunk::<BLOCK>() else { break };
            for i in 0..BLOCK {
                sums[i] += tap * window[i];
            }
        }
        out.extend_from_slice(&sums);
    }
    out.extend((count - count % BLOCK..count).map(|start| sum_of_products(&signal[start..], taps)));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact rationals of reference section 4, from n = 0 up.
    const SMOOTH: [(f64, f64); 16] = [
        (1127.0, 9889.0),
        (1105.0, 9889.0),
        (1040.0, 9889.0),
        (85.0, 899.0),
        (795.0, 9889.0),
        (57.0, 899.0),
        (40.0, 899.0),
        (245.0, 9889.0),
        (5.0, 899.0),
        (-115.0, 9889.0),
        (-8.0, 319.0),
        (-325.0, 9889.0),
        (-325.0, 9889.0),
        (-225.0, 9889.0),
        (0.0, 1.0),
        (13.0, 341.0),
    ];
    const DERIVATIVE: [(f64, f64); 16] = [
        (0.0, 1.0),
        (14975.0, 59334.0),
        (1000325.0, 2017356.0),
        (727775.0, 1008678.0),
        (309475.0, 336226.0),
        (33125.0, 30566.0),
        (220525.0, 183396.0),
        (1278725.0, 1008678.0),
        (640825.0, 504339.0),
        (404225.0, 336226.0),
        (2125625.0, 2017356.0),
        (74825.0, 91698.0),
        (484475.0, 1008678.0),
        (12675.0, 336226.0),
        (-12075.0, 23188.0),
        (-41875.0, 34782.0),
    ];

    #[test]
    fn taps_are_the_rationals_of_the_reference() {
        let filter = RegressionFilter::new(0.01);
        assert_eq!(filter.half(), 15);
        for n in 0..=15 {
            let (smooth, derivative) = (SMOOTH[n].0 / SMOOTH[n].1, DERIVATIVE[n].0 / DERIVATIVE[n].1);
            // 1e-14: a few roundings of numbers below 1 (the derivative reaches 1.3 with sums 100 times larger).
            assert!(
                (filter.smooth[15 + n] - smooth).abs() < 1e-14
                    && (filter.smooth[15 - n] - smooth).abs() < 1e-14
            );
            assert!((filter.derivative[15 + n] - derivative).abs() < 1e-12, "{n}");
            assert!((filter.derivative[15 - n] + derivative).abs() < 1e-12, "{n}");
        }
    }

    #[test]
    fn a_quartic_and_its_derivative_come_out_exactly() {
        let filter = RegressionFilter::new(0.01);
        let y = |t: f64| 0.3 - 2.0 * t + 5.0 * t.powi(2) - 1.5 * t.powi(3) + 4.0 * t.powi(4);
        let slope = |t: f64| -2.0 + 10.0 * t - 4.5 * t.powi(2) + 16.0 * t.powi(3);
        let signal: Vec<f64> = (0..100).map(|k| y(f64::from(k) * 0.01)).collect();
        let [smooth, derivative] =
            [&filter.smooth, &filter.derivative].map(|taps| convolve(&signal, taps, |_| f64::NAN));
        for k in 15..85 {
            let t = k as f64 * 0.01;
            assert!((smooth[k] - y(t)).abs() < 1e-12 && (derivative[k] - slope(t)).abs() < 1e-10);
        }
        assert!(smooth[14].is_nan() && smooth[85].is_nan() && !smooth[84].is_nan());
    }

    #[test]
    fn response_numbers_of_the_reference() {
        let filter = RegressionFilter::new(0.01);
        let gain = |taps: &[f64], w: f64, phase: fn(f64) -> f64| -> f64 {
            taps.iter().enumerate().map(|(k, tap)| tap * phase(w * 0.01 * (k as f64 - 15.0))).sum()
        };
        // -3 dB, first zero, and white-noise power gain, reference section 4.
        assert!((gain(&filter.smooth, 34.50265, f64::cos) - 0.5_f64.sqrt()).abs() < 1e-6);
        assert!(gain(&filter.smooth, 49.76137, f64::cos).abs() < 1e-6);
        assert!((gain(&filter.derivative, 23.82, f64::sin) - 18.10061).abs() < 1e-5);
        let power: f64 = filter.derivative.iter().map(|d| d * d).sum();
        assert!((power - 25.386983425).abs() < 1e-8);
    }

    #[test]
    fn the_matched_smoother_has_the_derivative_filters_response() {
        // D(jw) = jw * matched(jw), up to the trapezoid between samples, whose exact factor is (w T / 2) / tan(w T / 2).
        let filter = RegressionFilter::new(0.01);
        assert!((filter.matched.iter().sum::<f64>() - 1.0).abs() < 1e-13);
        for w in [1.0, 5.0, 10.0, 20.0, 30.0, 60.0_f64] {
            let sum = |taps: &[f64], phase: fn(f64) -> f64| -> f64 {
                taps.iter().enumerate().map(|(k, tap)| tap * phase(w * 0.01 * (k as f64 - 15.0))).sum()
            };
            let trapezoid = (0.5 * w * 0.01) / (0.5 * w * 0.01_f64).tan();
            let (derivative, matched) = (sum(&filter.derivative, f64::sin), sum(&filter.matched, f64::cos));
            assert!((derivative / w * trapezoid - matched).abs() < 1e-12, "{w}: {derivative} {matched}");
        }
    }

    #[test]
    fn a_derivative_filtered_between_samples_is_the_filtered_derivative() {
        // y = t^3 sin: the means of y' between samples are its increments, so both ways agree to rounding.
        let y: Vec<f64> =
            (0..80).map(|k| (0.01 * f64::from(k)).powi(3) * (0.7 * f64::from(k)).sin()).collect();
        let means: Vec<f64> = y.windows(2).map(|w| (w[1] - w[0]) / 0.01).collect();
        let filter = RegressionFilter::new(0.01);
        let a = convolve(&y, &filter.derivative, |_| f64::NAN);
        let mut side_by_side = SideBySide::new(&filter.between, 9);
        assert_eq!(side_by_side.reach(), 15);
        for (k, mean) in means.iter().enumerate() {
            let scaled = |i: usize| mean * (i + 1) as f64;
            side_by_side.push().iter_mut().enumerate().for_each(|(i, value)| *value = scaled(i));
            // The window of row m ends with the mean between samples m + 14 and m + 15.
            let Some(row) = (k + 1).checked_sub(15).filter(|row| *row >= 15) else { continue };
            let mut b = [0.0; 9];
            side_by_side.filtered(&mut b);
            for (i, b) in b.iter().enumerate() {
                assert!((a[row] * (i + 1) as f64 - b).abs() < 1e-10, "{row}, {i}: {} {b}", a[row]);
            }
        }
    }

    #[test]
    fn a_composed_filter_is_one_after_the_other() {
        let y: Vec<f64> = (0..100).map(|k| (0.7 * f64::from(k)).sin() + 0.01 * f64::from(k * k)).collect();
        let taps = RegressionFilter::new(0.01).derivative;
        let slope = |signal: &[f64]| convolve(signal, &taps, |_| f64::NAN);
        let twice = slope(&slope(&y));
        let composed = compose(&taps, &taps);
        for k in 30..70 {
            // Sums of 61 products of numbers up to 10^3.
            assert!((twice[k] - sum_of_products(&y[k - 30..], &composed)).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn other_sampling_rates_keep_the_window() {
        assert_eq!(RegressionFilter::new(0.005).half(), 30);
        assert_eq!(RegressionFilter::new(0.02).half(), 8);
        assert_eq!(RegressionFilter::new(0.1).half(), 3);
    }
}
