//! What the residual would be if nothing were missing: the sensors' own noise, through the filters.
//!
//! The noise of a channel is read off its fourth differences, in which motion hardly shows and white noise does, and the
//! filters' taps say what becomes of it in a row. On flights of complete models the residual's variance is that, within
//! the scatter of a variance. A residual well above has a cause, whether or not it depends on anything measured: a
//! gust, a swinging load, an engine that ages. Its spectrum says at which frequency.
//!
//! Samples that were filled in (`prepare.rs`) have no noise of their own, and those at lost rows another: neither counts.
//!
//! An accelerometer has an offset besides, another one in each flight.
//!
//! Rotor speeds that were measured bring in their noise as well: what the model makes of it is found by shaking them once more by
//! as much.
//!
//! Logs of an estimator instead of sensors have no white noise to go by; their channels fail the test for whiteness
//! (the autocorrelation of fourth differences is known, and so is what they do over every other sample), and nothing is
//! said.

use std::f64::consts::TAU;

use fourier::Complex;
use model::Model;

use crate::dependence::Dependence;
use sysid::Residuals;
use sysid::prepare::{ForceTarget, Prepared, Stretch};

/// Variance of the fourth difference of unit white noise: 1 + 16 + 36 + 16 + 1.
const FOURTH_DIFFERENCE: f64 = 70.0;
/// Its autocorrelation at one and two samples: -56/70 and 28/70.
const WHITE: [f64; 2] = [-0.8, 0.4];
/// How far the autocorrelation may be off.
const WHITE_TOLERANCE: f64 = 0.08;
/// How far the variance by every other sample may be off that by every sample. White noise has the same; the sluggish noise
/// of a tracker, which the filters pass more of than its highest frequencies tell, has more.
const SAME_VARIANCE: f64 = 0.15;
/// Offset that an accelerometer may have in a flight, m/s^2: 20 mg, as data sheets have it (Bosch BMI088, zero-g offset).
const OFFSET_M_S2: f64 = 0.2;
/// Frequencies looked at, Hz: from what a flight is long enough for to where the filters end.
const FREQUENCIES_HZ: (f64, f64, usize) = (0.1, 5.0, 99);
/// An oscillation has this part of the excess within a sixth of its frequency.
const CONCENTRATED: f64 = 0.5;

/// Three channels of a stretch.
type Channels = fn(&Stretch) -> &[Vec<f64>; 3];

/// The channels that force rows come from, and what the filters make of the variance of their noise.
fn force_channels(flight: &Prepared) -> (Channels, f64) {
    let channels: Channels = match flight.force_target {
        ForceTarget::Imu => |s| s.imu_m_s2.as_ref().unwrap_or(&s.rate_rad_s),
        ForceTarget::Velocity => |s| &s.velocity_ned_m_s,
        ForceTarget::Position => |s| &s.position_ned_m,
    };
    (channels, energy(&force_noise_taps(flight)))
}

/// What the filters make of the noise of these channels.
fn force_noise_taps(flight: &Prepared) -> Vec<f64> {
    let filter = &flight.filter;
    match flight.force_target {
        ForceTarget::Imu => filter.smooth.clone(),
        ForceTarget::Velocity => filter.derivative.clone(),
        ForceTarget::Position => self_convolution(&filter.derivative),
    }
}

/// Spectral density that sensor noise alone has in the force rows of a flight, by the frequency in Hz: that of white noise is its variance, (m/s^2)^2.
pub(crate) fn force_density(flight: &Prepared) -> impl Fn(f64) -> f64 {
    let taps = force_noise_taps(flight);
    let white = sample_variance(flight);
    let period_s = flight.period_s;
    move |frequency_hz| white * gain(&taps, frequency_hz * period_s)
}

/// Variance of white noise in a sample of the force channels, a mean over them.
fn sample_variance(flight: &Prepared) -> f64 {
    floor(flight, (force_channels(flight).0, 1.0)).iter().sum::<f64>() / 3.0
}

/// Hann's window over `count` samples, at sample `k`.
pub(crate) fn hann(k: usize, count: usize) -> f64 {
    0.5 - 0.5 * (TAU * k as f64 / count as f64).cos()
}

/// What a filter makes of the power of an oscillation of so many cycles a sample.
pub(crate) fn gain(taps: &[f64], cycles: f64) -> f64 {
    let part = |turn: fn(f64) -> f64| -> f64 {
        taps.iter().enumerate().map(|(k, tap)| tap * turn(TAU * cycles * k as f64)).sum()
    };
    part(f64::cos).powi(2) + part(f64::sin).powi(2)
}

/// Whether the noise of the force rows is known.
pub(crate) fn knows_forces(flights: &[&Prepared]) -> bool {
    is_white(&signals(flights, force_channels))
}

fn gyro_channels(flight: &Prepared) -> (Channels, f64) {
    (|s| &s.rate_rad_s, energy(&flight.filter.derivative))
}

fn energy(taps: &[f64]) -> f64 {
    taps.iter().map(|t| t * t).sum()
}

/// Variance that sensor noise alone leaves in a row of each of three axes of a flight, (unit of the axis)^2.
fn floor(flight: &Prepared, (channels, gain): (Channels, f64)) -> [f64; 3] {
    std::array::from_fn(|i| {
        let differences: Vec<Vec<f64>> =
            flight.stretches.iter().map(|s| fourth_differences(&channels(s)[i], &s.measured, 1)).collect();
        gain * variance(&differences)
    })
}

/// Sum of squares that sensor noise alone leaves in the rows of each axis; nothing where the noise is not white.
pub(crate) fn squares_of_noise(flights: &[&Prepared]) -> [Option<f64>; 6] {
    let forces = squares_of(flights, force_channels);
    let rates = squares_of(flights, gyro_channels);
    std::array::from_fn(|axis| if axis < 3 { forces.map(|f| f[axis]) } else { rates.map(|r| r[axis - 3]) })
}

fn squares_of(flights: &[&Prepared], channels: impl Fn(&Prepared) -> (Channels, f64)) -> Option<[f64; 3]> {
    if !is_white(&signals(flights, &channels)) {
        return None;
    }
    let of_flight =
        |flight: &&Prepared| floor(flight, channels(flight)).map(|floor| floor * flight.rows() as f64);
    let all: Vec<[f64; 3]> = flights.iter().map(of_flight).collect();
    Some(std::array::from_fn(|axis| all.iter().map(|squares| squares[axis]).sum()))
}

/// A signal, and which of its samples were measured.
type Signal<'a> = (&'a [f64], &'a [bool]);

/// Signals of three channels, over all flights.
fn signals<'a>(
    flights: &'a [&'a Prepared],
    channels: impl Fn(&Prepared) -> (Channels, f64),
) -> Vec<Signal<'a>> {
    let of_stretch = |channels: Channels, s: &'a Stretch| {
        channels(s).each_ref().map(|signal| (signal.as_slice(), s.measured.as_slice()))
    };
    let of_flight =
        |f: &&'a Prepared| f.stretches.iter().flat_map(|s| of_stretch(channels(f).0, s)).collect::<Vec<_>>();
    flights.iter().flat_map(of_flight).collect()
}

/// Measured rotor speeds of a flight, if there are any.
fn rotor_signals(flight: &Prepared) -> impl Iterator<Item = Signal<'_>> {
    flight.stretches.iter().flat_map(|s| {
        s.logged_rotor_rad_s.iter().flatten().map(|signal| (signal.as_slice(), s.measured.as_slice()))
    })
}

/// Whether the noise of signals is white: the autocorrelation of fourth differences, and their variance over every other sample.
fn is_white(signals: &[Signal<'_>]) -> bool {
    let (fine, coarse) = (scaled(signals, 1), scaled(signals, 2));
    let correlated = WHITE
        .iter()
        .zip(1..)
        .all(|(w, lag)| (lagged(&fine, lag) / lagged(&fine, 0) - w).abs() < WHITE_TOLERANCE);
    correlated && (variance(&coarse) / variance(&fine) - 1.0).abs() < SAME_VARIANCE
}

/// Fourth differences over every `step`-th sample, each in units of the signal's own noise: channels of unequal noise weigh the same.
fn scaled(signals: &[Signal<'_>], step: usize) -> Vec<Vec<f64>> {
    let each = signals.iter();
    each.map(|(signal, measured)| {
        let differences = fourth_differences(signal, measured, step);
        let scale = variance(std::slice::from_ref(&fourth_differences(signal, measured, 1))).sqrt();
        differences.into_iter().map(|d| d / scale).collect()
    })
    .collect()
}

/// Mean product of values so many samples apart.
fn lagged(signals: &[Vec<f64>], lag: usize) -> f64 {
    let pairs = signals.iter().flat_map(|d| d.iter().zip(d.iter().skip(lag)));
    let (sum, count) = pairs
        .map(|(a, b)| a * b)
        .filter(|product| product.is_finite())
        .fold((0.0, 0.0), |(sum, count), product| (sum + product, count + 1.0));
    sum / count
}

/// Fourth differences of unit steps of a random walk: third differences of the steps, 1 + 9 + 9 + 1, and what these have one and two
/// samples apart.
const OF_STEPS: [f64; 3] = [20.0, -15.0, 6.0];

/// A tracker's noise that is white noise on a random walk. Trackers smooth what they see, and markers tremble: what a filter makes of
/// their slow noise is told by this, from its quick part.
struct Wandering {
    /// Variances of the white noise and of the walk's steps, of that which fourth differences tell.
    white: f64,
    step: f64,
}

impl Wandering {
    /// By the variances over every sample and over every other one; nothing where the autocorrelation of fourth differences is not that of
    /// such a noise.
    fn of(signals: &[Signal<'_>]) -> Option<Self> {
        let (fine, coarse) = (scaled(signals, 1), scaled(signals, 2));
        let ratio = (variance(&coarse) / variance(&fine)).max(1.0);
        if !(ratio < 2.0 + SAME_VARIANCE) {
            return None;
        }
        let noise = Self { white: 2.0 - ratio, step: (ratio - 1.0) * FOURTH_DIFFERENCE / OF_STEPS[0] };
        let expected =
            |lag: usize| noise.white * WHITE[lag - 1] + noise.step * OF_STEPS[lag] / FOURTH_DIFFERENCE;
        let off = |lag: usize| (lagged(&fine, lag) / lagged(&fine, 0) - expected(lag)).abs();
        (1..=2).all(|lag| off(lag) < WHITE_TOLERANCE).then_some(noise)
    }

    /// What a filter that takes constants away makes of its variance.
    fn gain(&self, taps: &[f64]) -> f64 {
        let of_steps: Vec<f64> = taps
            .iter()
            .scan(0.0, |sum, tap| {
                *sum += tap;
                Some(*sum)
            })
            .collect();
        self.white.max(0.0) * energy(taps) + self.step * energy(&of_steps)
    }
}

/// Ratio of the residual's variance along the body axes to what a tracker's noise explains that is white noise on a random walk; nothing where it is not.
pub(crate) fn excess_over_wandering(flights: &[&Prepared], residuals: &[Residuals]) -> Option<[f64; 3]> {
    if flights.iter().any(|flight| flight.force_target == ForceTarget::Imu) {
        return None;
    }
    let noise = Wandering::of(&signals(flights, force_channels))?;
    let (mut found, mut expected) = ([0.0; 3], 0.0);
    for (flight, residual) in flights.iter().zip(residuals) {
        expected += noise.gain(&force_noise_taps(flight)) * sample_variance(flight) * flight.rows() as f64;
        for (found, axis) in found.iter_mut().zip(&residual.residual) {
            *found += axis.iter().map(|e| e * e).sum::<f64>();
        }
    }
    Some(found.map(|found| found / expected))
}

/// Fourth differences over every `step`-th sample; NaN where one of the five was filled in.
fn fourth_differences(signal: &[f64], measured: &[bool], step: usize) -> Vec<f64> {
    let window = |(w, measured): (&[f64], &[bool])| {
        if (0..5).any(|k| !measured[k * step]) {
            return f64::NAN;
        }
        w[0] - 4.0 * w[step] + 6.0 * w[2 * step] - 4.0 * w[3 * step] + w[4 * step]
    };
    let length = 4 * step + 1;
    signal.windows(length).zip(measured.windows(length)).map(window).collect()
}

/// Variance behind fourth differences, by the median of their squares: a glitch does not count. NaN without any.
fn variance(differences: &[Vec<f64>]) -> f64 {
    let mut squares: Vec<f64> =
        differences.iter().flatten().map(|d| d * d).filter(|square| square.is_finite()).collect();
    let middle = squares.len() / 2;
    if squares.is_empty() {
        return f64::NAN;
    }
    // The median of a squared normal deviate is 0.4549 of its variance.
    *squares.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.4549 / FOURTH_DIFFERENCE
}

fn self_convolution(taps: &[f64]) -> Vec<f64> {
    let mut result = vec![0.0; 2 * taps.len() - 1];
    for (i, a) in taps.iter().enumerate() {
        for (j, b) in taps.iter().enumerate() {
            result[i + j] += a * b;
        }
    }
    result
}

/// What the noise of measured rotor speeds, if white, leaves in a row of each axis of what a model predicts of a flight: what the
/// prediction changes by when as much is added to them.
fn rotor_floor(flight: &Prepared, model: &Model) -> [f64; 6] {
    let signals: Vec<Signal<'_>> = rotor_signals(flight).collect();
    if signals.is_empty() || !is_white(&signals) {
        return [0.0; 6];
    }
    let mut shaken = flight.clone();
    let mut random = SHAKING;
    for rotor in 0..4 {
        let of_rotor = |s: &Stretch| {
            let signal = s.logged_rotor_rad_s.as_ref().map(|all| &all[rotor]);
            signal.map_or_else(Vec::new, |signal| fourth_differences(signal, &s.measured, 1))
        };
        let differences: Vec<Vec<f64>> = flight.stretches.iter().map(of_rotor).collect();
        let deviation = variance(&differences).sqrt();
        let speeds = shaken.stretches.iter_mut().filter_map(|s| s.logged_rotor_rad_s.as_mut());
        for speed in speeds.flat_map(|all| &mut all[rotor]) {
            *speed += if coin(&mut random) { deviation } else { -deviation };
        }
    }
    let (still, shaken) = (sysid::residuals(flight, model), sysid::residuals(&shaken, model));
    std::array::from_fn(|axis| {
        let pairs = still.residual[axis].iter().zip(&shaken.residual[axis]);
        let squares: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
        squares / still.residual[axis].len().max(1) as f64
    })
}

/// Where the coins of the shaking begin.
const SHAKING: u64 = 0x9E37_79B9_7F4A_7C15;

/// Heads or tails, by Marsaglia's xorshift (Journal of Statistical Software 8(14), 2003).
fn coin(state: &mut u64) -> bool {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state >> 63 == 1
}

/// Ratio of the residual's variance to what the sensors' noise explains, for each axis over several flights; nothing
/// where the noise is not white. Residuals of a `model` have the noise of measured rotor speeds in them.
pub(crate) fn excess(
    flights: &[&Prepared],
    residuals: &[Residuals],
    model: Option<&Model>,
) -> [Option<f64>; 6] {
    let (force, turning) =
        (is_white(&signals(flights, force_channels)), is_white(&signals(flights, gyro_channels)));
    let (mut found, mut expected) = ([0.0; 6], [0.0; 6]);
    for (flight, residual) in flights.iter().zip(residuals) {
        let mut noise = floor(flight, force_channels(flight));
        if flight.force_target != ForceTarget::Imu {
            // Inertial axes and body axes share the mean: a tracker is about as good in each direction.
            noise = [noise.iter().sum::<f64>() / 3.0; 3];
        }
        let noise = noise.into_iter().chain(floor(flight, gyro_channels(flight)));
        let of_rotors = model.map_or([0.0; 6], |model| rotor_floor(flight, model));
        for (axis, noise) in noise.enumerate() {
            let noise = noise + of_rotors[axis];
            let of_axis = &residual.residual[axis];
            found[axis] += of_axis.iter().map(|e| e * e).sum::<f64>();
            if axis < 3 && flight.force_target == ForceTarget::Imu {
                found[axis] -= of_axis.len() as f64 * offset(of_axis).powi(2);
            }
            expected[axis] += noise * flight.rows() as f64;
        }
    }
    std::array::from_fn(|axis| {
        let known = if axis < 3 { force } else { turning };
        (known && expected[axis] > 0.0).then(|| found[axis] / expected[axis])
    })
}

/// What may be an accelerometer's own offset in the mean of a flight's residual, m/s^2.
fn offset(residual: &[f64]) -> f64 {
    let mean = residual.iter().sum::<f64>() / residual.len().max(1) as f64;
    mean.clamp(-OFFSET_M_S2, OFFSET_M_S2)
}

/// Where in frequency a residual stands out most from white noise through the filters: an oscillation, or slow
/// changes when it is spread out.
pub(crate) fn strongest_frequency(flights: &[&Prepared], residuals: &[Residuals], axis: usize) -> Dependence {
    let (low, high, count) = FREQUENCIES_HZ;
    let grid: Vec<f64> = (0..count).map(|k| low + (high - low) * k as f64 / (count - 1) as f64).collect();
    let mut power = vec![0.0; count];
    for (flight, residual) in flights.iter().zip(residuals) {
        let signal = &residual.residual[axis];
        let n = signal.len() as f64;
        let windowed: Vec<f64> = signal.iter().enumerate().map(|(k, e)| hann(k, signal.len()) * e).collect();
        for (sum, frequency) in power.iter_mut().zip(&grid) {
            // The wave turns on from sample to sample, which is a multiplication and no cosine.
            let turn = Complex::cis(TAU * frequency * flight.period_s);
            let (mut wave, mut found) = (Complex::new(1.0, 0.0), Complex::new(0.0, 0.0));
            for e in &windowed {
                found += wave * *e;
                wave *= turn;
            }
            *sum += found.norm_sqr() / n;
        }
    }
    let total: f64 = power.iter().sum();
    let peak = (0..count).max_by(|a, b| power[*a].total_cmp(&power[*b])).unwrap_or(0);
    let near = |k: usize| (grid[k] / grid[peak] - 1.0).abs() < 1.0 / 6.0 || k.abs_diff(peak) <= 1;
    let around: f64 = (0..count).filter(|k| near(*k)).map(|k| power[k]).sum();
    if around > CONCENTRATED * total && grid[peak] > 0.25 {
        Dependence::Oscillation { frequency_hz: grid[peak] }
    } else {
        Dependence::SlowChanges
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Sums of twelve uniform numbers less six: normal of variance one, nearly.
    fn white(count: usize, seed: u64) -> Vec<f64> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        (0..count).map(|_| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0).collect()
    }

    /// Noise of deviation 0.2 on a motion a hundred times as large. The median of 2400 squares of differences that overlap is known to
    /// a tenth; glitches do not move it.
    #[test]
    fn noise_is_read_off_under_motion_and_glitches() {
        let noise = white(2400, 3);
        let mut signal: Vec<f64> =
            noise.iter().enumerate().map(|(k, e)| 20.0 * (0.02 * k as f64).sin() + 0.2 * e).collect();
        (0..2400).step_by(240).for_each(|k| signal[k] += 30.0);
        let found = variance(&[fourth_differences(&signal, &[true; 2400], 1)]);
        assert!((found / 0.04 - 1.0).abs() < 0.15, "{found}");
    }

    /// Fourth differences take away cubics, and unit white noise leaves them a variance of 70 with correlations -0.8 and 0.4: the
    /// squares and products of 1 -4 6 -4 1.
    #[test]
    fn fourth_differences_by_their_definition() {
        let cubic: Vec<f64> = (0..20).map(|k| f64::from(k).powi(3)).collect();
        assert!(fourth_differences(&cubic, &[true; 20], 2).iter().all(|d| *d == 0.0));
        let weights = [1.0, -4.0, 6.0, -4.0, 1.0];
        let product = |lag: usize| -> f64 { weights.iter().zip(&weights[lag..]).map(|(a, b)| a * b).sum() };
        assert_eq!(product(0), FOURTH_DIFFERENCE);
        assert_eq!(WHITE, [product(1) / product(0), product(2) / product(0)]);
        let mut measured = [true; 9];
        measured[4] = false;
        assert!(fourth_differences(&[0.0; 9], &measured, 1).iter().all(|d| d.is_nan()));
        assert!(variance(&[]).is_nan());
    }

    /// Of white noise of variance 1 on a random walk with steps of variance 2: fourth differences have 70 + 2 * 20, every other
    /// sample's 70 + 4 * 20.
    #[test]
    fn noise_on_a_random_walk_is_told_from_white_and_from_smooth_noise() {
        let of = |white_part: f64, step: f64, seed: u64| -> Vec<f64> {
            let (fast, slow) = (white(20_000, seed), white(20_000, seed + 1));
            let walk = slow.iter().scan(0.0, |sum, e| {
                *sum += step * e;
                Some(*sum)
            });
            fast.iter().zip(walk).map(|(e, w)| white_part * e + w).collect()
        };
        let all = vec![true; 20_000];
        let step = |signal: &[f64]| Wandering::of(&[(signal, &all)]).map(|noise| noise.step);
        let ratio = |signal: &[f64]| step(signal).map(|step| 1.0 + step * OF_STEPS[0] / FOURTH_DIFFERENCE);
        let found = ratio(&of(1.0, 2f64.sqrt(), 5)).unwrap();
        assert!((found - 150.0 / 110.0).abs() < 0.06, "{found}");
        assert!((ratio(&of(0.0, 1.0, 7)).unwrap() - 2.0).abs() < 0.1);
        assert!((ratio(&of(1.0, 0.0, 9)).unwrap() - 1.0).abs() < 0.1);
        let noise = of(1.0, 0.0, 11);
        let smooth: Vec<f64> = noise.windows(3).map(|w| w.iter().sum()).collect();
        assert!(Wandering::of(&[(&smooth, &all[2..])]).is_none());
    }

    #[test]
    fn an_offset_is_what_an_accelerometer_may_have() {
        assert!((offset(&[0.05, 0.15]) - 0.1).abs() < 1e-12);
        assert_eq!(offset(&[-0.7, -0.9]), -OFFSET_M_S2);
        assert_eq!(offset(&[]), 0.0);
    }

    #[test]
    fn a_window_of_four_samples() {
        let window: Vec<f64> = (0..4).map(|k| hann(k, 4)).collect();
        assert!(window.iter().zip([0.0, 0.5, 1.0, 0.5]).all(|(a, b)| (a - b).abs() < 1e-15), "{window:?}");
    }

    #[test]
    fn a_convolution_with_itself() {
        assert_eq!(self_convolution(&[1.0, 2.0, 3.0]), [1.0, 4.0, 10.0, 12.0, 9.0]);
        assert_eq!(energy(&[1.0, -2.0, 3.0]), 14.0);
    }
}
