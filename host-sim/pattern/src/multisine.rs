//! Orthogonal multisines with small peaks (Morelli 2003; Morelli 2012; Guillaume et al. 1991).
//!
//! ```text
//! u_j(t) = sqrt(1 / n) * sum over n harmonics k in K_j of cos(2 pi k t / T + phase_k)
//! ```
//!
//! All frequencies are multiples of 1/T, and each belongs to one input: the first to motor 1, the
//! next to motor 2, and so on round. Over a whole period T sums of products of different inputs are
//! then exactly zero, whatever the phases and in whatever order inputs are mixed, and all inputs
//! can be excited at once, at all frequencies of the band.
//!
//! Phases are free, and chosen for small peaks: a craft that may be moved by so much takes more
//! power. They start at Schroeder's (1970) or at random ones and minimise the 2p-norm of the signal
//! with p = 2, 4, ... 32 by L-BFGS (crate argmin); the limit of p is the peak. The measure is the
//! relative peak factor, [`relative_peak_factor`], 1 for a single sine. At last each input is
//! shifted in time so that it begins at zero: a shift moves all phases of one input and changes
//! neither peak nor power.

use std::f64::consts::{PI, SQRT_2, TAU};

use argmin::core::{CostFunction, Executor, Gradient, State as _};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Samples in a cycle of the highest frequency at which peaks are looked for: between them the
/// highest sine alone rises by 8 % at most, all of them by far less.
const SAMPLES_A_CYCLE: usize = 8;
/// Exponents of the norms that are minimised one after the other, halved.
const HALF_NORMS: [i32; 5] = [2, 4, 8, 16, 32];
/// Starts: Schroeder's and random ones.
const STARTS: usize = 5;
const STEPS: u64 = 40;
/// Most frequencies in all: beyond, the search takes minutes.
const MOST_FREQUENCIES: usize = 2000;

/// One sine of an input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sine {
    /// Multiple of 1/T.
    pub harmonic: u32,
    /// Phase of the cosine, rad.
    pub phase_rad: f64,
}

/// Four inputs of equal power that are orthogonal over a period.
#[derive(Debug, Clone, PartialEq)]
pub struct Multisine {
    period_s: f64,
    inputs: [Vec<Sine>; 4],
}

/// Why a multisine cannot be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "a multisine from {low_hz} to {high_hz} Hz with a period of {period_s} s has {found} frequencies: 8 to {MOST_FREQUENCIES} are needed, two for each motor at least; widen the band or lengthen the period"
)]
pub struct MultisineError {
    low_hz: f64,
    high_hz: f64,
    period_s: f64,
    found: usize,
}

/// (max - min) / (2 sqrt(2) rms): 1 for a sine.
pub fn relative_peak_factor(signal: &[f64]) -> f64 {
    let (low, high) =
        signal.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let rms = (signal.iter().map(|v| v * v).sum::<f64>() / signal.len() as f64).sqrt();
    (high - low) / (2.0 * SQRT_2 * rms)
}

impl Multisine {
    /// All multiples of `1 / period_s` within the band, dealt to the four inputs in turn, with
    /// phases for small peaks. Equal seeds give equal phases.
    ///
    /// # Errors
    /// A band with fewer than two frequencies for an input, or with too many.
    pub fn new(period_s: f64, band_hz: [f64; 2], seed: u64) -> Result<Self, MultisineError> {
        let [low_hz, high_hz] = band_hz;
        // A frequency that is meant to be in the band is, whatever its last bit.
        let first = (low_hz * period_s - 1e-9).ceil().max(1.0);
        let last = (high_hz * period_s + 1e-9).floor();
        let found = if last >= first { (last - first + 1.0).min(1e9) as usize } else { 0 };
        if !((8..=MOST_FREQUENCIES).contains(&found) && period_s > 0.0 && low_hz > 0.0) {
            return Err(MultisineError { low_hz, high_hz, period_s, found });
        }
        let first = first as u32;
        let inputs = std::array::from_fn(|j| {
            let harmonics: Vec<u32> = (first..first + found as u32).skip(j).step_by(4).collect();
            best_phases(&harmonics, seed.wrapping_add(j as u64))
        });
        Ok(Self { period_s, inputs })
    }

    /// Sines of each input.
    pub fn inputs(&self) -> &[Vec<Sine>; 4] {
        &self.inputs
    }

    /// The four inputs at `time_s`. Each has the root mean square of a sine of amplitude 1.
    pub fn at(&self, time_s: f64) -> [f64; 4] {
        let turn = TAU * (time_s / self.period_s);
        self.inputs.each_ref().map(|sines| value(sines, turn))
    }
}

/// Sum of the sines of one input at an angle of the period, with the root mean square of a sine of
/// amplitude 1.
fn value(sines: &[Sine], turn: f64) -> f64 {
    let scale = (1.0 / sines.len() as f64).sqrt();
    scale * sines.iter().map(|s| (f64::from(s.harmonic) * turn + s.phase_rad).cos()).sum::<f64>()
}

fn sampled(sines: &[Sine]) -> Vec<f64> {
    let count = samples(sines.iter().map(|s| s.harmonic));
    (0..count).map(|i| value(sines, TAU * i as f64 / count as f64)).collect()
}

fn samples(harmonics: impl Iterator<Item = u32>) -> usize {
    SAMPLES_A_CYCLE * harmonics.max().unwrap_or(1) as usize
}

fn best_phases(harmonics: &[u32], seed: u64) -> Vec<Sine> {
    let mut generator = Pcg64::seed_from_u64(seed);
    let problem = Peak::new(harmonics);
    let candidates = (0..STARTS).map(|start| {
        let phases: Vec<f64> = match start {
            0 => schroeder(harmonics.len()),
            _ => harmonics.iter().map(|_| generator.random_range(0.0..TAU)).collect(),
        };
        let phases = problem.minimised(phases);
        let sines: Vec<Sine> =
            harmonics.iter().zip(phases).map(|(&harmonic, phase_rad)| Sine { harmonic, phase_rad }).collect();
        (relative_peak_factor(&sampled(&sines)), sines)
    });
    let best = candidates.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, sines)| sines).unwrap_or_default();
    from_zero(best)
}

/// Schroeder's phases for sines of equal power.
fn schroeder(count: usize) -> Vec<f64> {
    (0..count).map(|n| -PI * (n * n) as f64 / count as f64).collect()
}

/// The signal shifted in time to where it rises through zero.
fn from_zero(sines: Vec<Sine>) -> Vec<Sine> {
    let signal = sampled(&sines);
    let count = signal.len();
    let rising = (0..count).find(|&i| signal[i] <= 0.0 && signal[(i + 1) % count] > 0.0).unwrap_or(0);
    // Halving the interval between the two samples, to the last bit.
    let (mut below, mut above) =
        (TAU * rising as f64 / count as f64, TAU * (rising + 1) as f64 / count as f64);
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (below + above);
        if value(&sines, middle) <= 0.0 { below = middle } else { above = middle }
    }
    let turn = above;
    let shifted = |s: Sine| Sine { phase_rad: (s.phase_rad + f64::from(s.harmonic) * turn) % TAU, ..s };
    sines.into_iter().map(shifted).collect()
}

/// The signal as a function of its phases, with the sines of time looked up.
struct Peak {
    /// Cosine and sine of each sample, one harmonic after the other.
    waves: Vec<(Vec<f64>, Vec<f64>)>,
    count: usize,
}

impl Peak {
    fn new(harmonics: &[u32]) -> Self {
        let count = samples(harmonics.iter().copied());
        let wave = |harmonic: &u32| {
            let angles = (0..count).map(|i| TAU * ((i as u64 * u64::from(*harmonic)) % count as u64) as f64);
            angles.map(|a| (a / count as f64).sin_cos()).map(|(s, c)| (c, s)).unzip()
        };
        Self { waves: harmonics.iter().map(wave).collect(), count }
    }

    fn signal(&self, phases: &[f64]) -> Vec<f64> {
        let mut signal = vec![0.0; self.count];
        let scale = (1.0 / self.waves.len() as f64).sqrt();
        for ((cosine, sine), phase) in self.waves.iter().zip(phases) {
            let (s, c) = phase.sin_cos();
            let (s, c) = (scale * s, scale * c);
            for (value, (a, b)) in signal.iter_mut().zip(cosine.iter().zip(sine)) {
                *value += c * a - s * b;
            }
        }
        signal
    }

    fn minimised(&self, mut phases: Vec<f64>) -> Vec<f64> {
        for half_norm in HALF_NORMS {
            let problem = Norm { peak: self, half_norm };
            let solver = LBFGS::new(MoreThuenteLineSearch::new(), 7);
            let start = phases.clone();
            let run =
                Executor::new(problem, solver).configure(|state| state.param(start).max_iters(STEPS)).run();
            // A line search that finds nothing better leaves the phases as they are.
            if let Ok(result) = run
                && let Some(best) = result.state().get_best_param()
            {
                phases.clone_from(best);
            }
        }
        phases
    }
}

/// ln of the 2p-norm, the mean over samples in place of the sum.
struct Norm<'a> {
    peak: &'a Peak,
    half_norm: i32,
}

impl Norm<'_> {
    /// Signal over its peak, and the peak: powers of it stay within numbers.
    fn scaled(&self, phases: &[f64]) -> (Vec<f64>, f64) {
        let mut signal = self.peak.signal(phases);
        let largest = signal.iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
        signal.iter_mut().for_each(|v| *v /= largest);
        (signal, largest)
    }
}

impl CostFunction for Norm<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, phases: &Self::Param) -> Result<f64, argmin::core::Error> {
        let (signal, largest) = self.scaled(phases);
        let mean = signal.iter().map(|v| (v * v).powi(self.half_norm)).sum::<f64>() / signal.len() as f64;
        Ok(largest.ln() + mean.ln() / f64::from(2 * self.half_norm))
    }
}

impl Gradient for Norm<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, phases: &Self::Param) -> Result<Vec<f64>, argmin::core::Error> {
        let (signal, largest) = self.scaled(phases);
        // d ln(norm) / d signal_i = signal_i^(2p-1) / sum of signal^2p.
        let weights: Vec<f64> = signal.iter().map(|v| (v * v).powi(self.half_norm - 1) * v).collect();
        let sum: f64 = weights.iter().zip(&signal).map(|(w, v)| w * v).sum();
        let scale = (1.0 / self.peak.waves.len() as f64).sqrt() / (sum * largest);
        let slope = |((cosine, sine), phase): (&(Vec<f64>, Vec<f64>), &f64)| {
            let (s, c) = phase.sin_cos();
            let dot: f64 =
                weights.iter().zip(cosine.iter().zip(sine)).map(|(w, (a, b))| w * (s * a + c * b)).sum();
            -scale * dot
        };
        Ok(self.peak.waves.iter().zip(phases).map(slope).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    fn all_samples(multisine: &Multisine, count: usize) -> Vec<[f64; 4]> {
        (0..count).map(|i| multisine.at(multisine.period_s * i as f64 / count as f64)).collect()
    }

    /// Morelli (2003): sums of products over a whole period vanish; here to rounding, at 100 Hz as
    /// it is flown.
    #[test]
    fn inputs_are_orthogonal_over_a_period_and_of_equal_power() {
        let multisine = Multisine::new(20.0, [0.2, 5.0], 1).unwrap();
        let samples = all_samples(&multisine, 2000);
        for a in 0..4 {
            for b in 0..4 {
                let mean = samples.iter().map(|s| s[a] * s[b]).sum::<f64>() / 2000.0;
                let expected = if a == b { 0.5 } else { 0.0 };
                assert!((mean - expected).abs() < 1e-12, "{a} {b}: {mean}");
            }
            assert!(samples.iter().map(|s| s[a]).sum::<f64>().abs() < 1e-9, "no mean");
            assert!(samples[0][a].abs() < 1e-9, "begins at zero: {}", samples[0][a]);
        }
        // Mixed into roll, pitch, yaw and thrust they stay orthogonal.
        let mixed = |s: &[f64; 4]| [s[0] + s[3] - s[1] - s[2], s[0] + s[1] - s[2] - s[3]];
        let cross: f64 = samples.iter().map(mixed).map(|[roll, pitch]| roll * pitch).sum();
        assert!(cross.abs() < 1e-8, "{cross}");
    }

    #[test]
    fn frequencies_are_dealt_in_turn_and_cover_the_band() {
        let multisine = Multisine::new(20.0, [0.2, 5.0], 1).unwrap();
        let harmonics = |j: usize| multisine.inputs[j].iter().map(|s: &Sine| s.harmonic).collect::<Vec<_>>();
        assert_eq!(harmonics(0)[..3], [4, 8, 12]);
        assert_eq!(harmonics(3)[..3], [7, 11, 15]);
        let mut all: Vec<u32> = (0..4).flat_map(harmonics).collect();
        all.sort_unstable();
        assert_eq!(all, (4..=100).collect::<Vec<_>>());
    }

    /// Random phases give relative peak factors near 2, Schroeder's 1.2 to 1.5 for spectra with
    /// gaps; Morelli and Klein (2016, 9.3) call about 1.0 to 1.2 what optimised phases reach.
    #[test]
    fn peaks_are_as_small_as_published() {
        for (period_s, band_hz, seed) in
            [(20.0, [0.2, 5.0], 1), (20.0, [0.2, 5.0], 2), (30.0, [0.1, 4.0], 3), (10.0, [0.5, 8.0], 4)]
        {
            let multisine = Multisine::new(period_s, band_hz, seed).unwrap();
            for (j, sines) in multisine.inputs.iter().enumerate() {
                let signal = sampled(sines);
                let found = relative_peak_factor(&signal);
                let start: Vec<Sine> = sines
                    .iter()
                    .zip(schroeder(sines.len()))
                    .map(|(s, phase_rad)| Sine { phase_rad, ..*s })
                    .collect();
                let before = relative_peak_factor(&sampled(&start));
                assert!(
                    found < 1.15 && found < before,
                    "{period_s} s {band_hz:?} input {j}: {before:.3} -> {found:.3}"
                );
            }
        }
    }

    /// Guillaume, Schoukens, Pintelon and Kollar (1991): flat multisines of consecutive harmonics
    /// reach crest factors of about 1.4, which a sine has (1.414); Schroeder's phases have about
    /// 1.7.
    #[test]
    fn consecutive_harmonics_reach_the_crest_factor_of_a_sine() {
        let harmonics: Vec<u32> = (1..=31).collect();
        let sines = best_phases(&harmonics, 3);
        let peak = sampled(&sines).iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        // The root mean square is that of a sine of amplitude 1.
        let crest = peak / FRAC_1_SQRT_2;
        assert!((1.3..1.45).contains(&crest), "{crest}");
    }

    #[test]
    fn a_sine_has_the_factor_one_and_gradients_are_those_of_the_cost() {
        let sine: Vec<f64> = (0..1000).map(|k| 3.0 * (TAU * f64::from(k) / 100.0).sin()).collect();
        assert!((relative_peak_factor(&sine) - 1.0).abs() < 1e-12);
        let peak = Peak::new(&[2, 5, 9, 13]);
        let norm = Norm { peak: &peak, half_norm: 4 };
        let phases = vec![0.3, 1.0, -2.0, 0.7];
        for (k, slope) in norm.gradient(&phases).unwrap().into_iter().enumerate() {
            let at = |step: f64| {
                let mut moved = phases.clone();
                moved[k] += step;
                norm.cost(&moved).unwrap()
            };
            // A central difference over 1e-5 is off by 1e-10 of the third derivative and 1e-11 of
            // rounding.
            assert!(((at(1e-5) - at(-1e-5)) / 2e-5 - slope).abs() < 1e-8, "{k}");
        }
    }

    #[test]
    fn bands_without_enough_frequencies_are_refused() {
        for (period_s, band_hz) in [
            (5.0, [0.2, 1.0]),
            (20.0, [2.0, 1.0]),
            (f64::NAN, [0.1, 1.0]),
            (1e9, [0.1, 1.0]),
            (20.0, [0.0, 5.0]),
        ] {
            let error = Multisine::new(period_s, band_hz, 1).unwrap_err().to_string();
            assert!(error.contains("frequencies") && !error.contains('\n'), "{error}");
        }
    }
}
