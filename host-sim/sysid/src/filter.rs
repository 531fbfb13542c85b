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
        // A window needs more samples than the polynomial has coefficients.
        let half = ((0.5 * Self::WINDOW_S / period_s).round() as usize).max(3);
        let [smooth, slope] = polynomial_taps(half);
        let derivative: Vec<f64> = slope.iter().map(|g| g / period_s).collect();
        let between = between_taps(&slope);
        Self { smooth, matched: matched_taps(&between), between, derivative }
    }

    /// Smoothing taps over a tenth of a second, for signals that follow the rotors (the battery's voltage sags with the load):
    /// the long window would take the sag away with the noise.
    pub fn short_smooth(period_s: f64) -> Vec<f64> {
        let [smooth, _] = polynomial_taps(((0.05 / period_s).round() as usize).max(3));
        smooth
    }

    /// Samples on either side of the center.
    pub fn half(&self) -> usize {
        self.smooth.len() / 2
    }
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

/// Filters `signal` where the window fits; the first and last `taps.len() / 2` values of the result are NaN.
pub fn convolve(signal: &[f64], taps: &[f64]) -> Vec<f64> {
    let half = taps.len() / 2;
    let mut result = vec![f64::NAN; signal.len()];
    if signal.len() < taps.len() {
        return result;
    }
    let last = signal.len() - half;
    weighted_sums(signal, taps, &mut result[half..last]);
    result
}

/// Filters a signal known between samples (its first value lies between the first two) with [`RegressionFilter::between`];
/// the result is at the samples, NaN where the window does not fit.
pub fn convolve_between(signal: &[f64], taps: &[f64]) -> Vec<f64> {
    let half = taps.len() / 2;
    let mut result = vec![f64::NAN; signal.len() + 1];
    if signal.len() >= taps.len() {
        let last = result.len() - half;
        weighted_sums(signal, taps, &mut result[half..last]);
    }
    result
}

/// `out[i] = sum over k of taps[k] * signal[i + k]`. Most of an identification's time is spent here: the widest vector
/// instructions of the machine at hand are chosen when the program runs (without fused multiply-add, so that
/// every machine gives the same bits).
#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+avx512f", "aarch64+neon"))]
fn weighted_sums(signal: &[f64], taps: &[f64], out: &mut [f64]) {
    // Blocks that stay in the first-level cache; four taps at a time halve the traffic of the running sums.
    const BLOCK: usize = 512;
    for (block, out) in out.chunks_mut(BLOCK).enumerate() {
        let signal = &signal[block * BLOCK..];
        let length = out.len();
        out.fill(0.0);
        let groups = taps.chunks_exact(4);
        let rest = groups.remainder();
        let mut k = 0;
        for group in groups {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| &signal[k + i..k + i + length]);
            for i in 0..length {
                out[i] += (group[0] * a[i] + group[1] * b[i]) + (group[2] * c[i] + group[3] * d[i]);
            }
            k += 4;
        }
        for tap in rest {
            for (o, s) in out.iter_mut().zip(&signal[k..k + length]) {
                *o += tap * s;
            }
            k += 1;
        }
    }
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
        let (smooth, derivative) = (convolve(&signal, &filter.smooth), convolve(&signal, &filter.derivative));
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
        let (a, b) = (convolve(&y, &filter.derivative), convolve_between(&means, &filter.between));
        for k in 15..65 {
            assert!((a[k] - b[k]).abs() < 1e-11, "{k}: {} {}", a[k], b[k]);
        }
        assert!(b[14].is_nan() && b[65].is_nan() && b.len() == 80);
    }

    #[test]
    fn other_sampling_rates_keep_the_window() {
        assert_eq!(RegressionFilter::new(0.005).half(), 30);
        assert_eq!(RegressionFilter::new(0.02).half(), 8);
        assert_eq!(RegressionFilter::new(0.1).half(), 3);
    }
}
