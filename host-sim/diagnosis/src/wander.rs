//! Is what is left along the horizontal axes the push of a wind that wanders?
//!
//! Such a wind is a random walk within seconds: the density of its push falls with the square of the frequency, over all frequencies at which
//! it stands out of the sensors' noise. A force that comes of where the craft is or of how it flies has the frequencies of the
//! flight, and a wind that turns evenly has one. In residuals without their slow part, a random walk has the same density everywhere, so that bands
//! of frequency are compared.

use std::f64::consts::TAU;

use model::{Axis, Effect, Model};
use sysid::Residuals;
use sysid::fit::slow::MEMORY_S;
use sysid::prepare::{Prepared, Stretch};
use sysid::statistics::squares_p_value;

use crate::dependence::Dependence;
use crate::finding::Unexplained;
use crate::noise;

/// Limits of the bands, Hz.
const LIMITS_HZ: [f64; BANDS + 1] = [0.05, 0.15, 0.3, 0.5, 0.8, 1.3, 2.0];
const BANDS: usize = 6;
/// Steps of frequency, Hz.
const STEP_HZ: f64 = 0.02;
/// Largest p-value of "it is a random walk" at which it is none.
const OTHERWISE: f64 = 1e-3;
/// Part by which the density of a wind is off that of a random walk: this times it is no evidence.
const NEARLY: f64 = 0.1;
/// Part of the frequencies that are independent of each other through Hann's window.
const INDEPENDENT: f64 = 2.0 / 3.0;
/// Shortest time of all flights together from which the shape can be told, s.
const LEAST_S: f64 = 60.0;

/// What is in a band.
#[derive(Default, Clone, Copy)]
struct Band {
    /// Power that was found.
    found: f64,
    /// That of a random walk of unit density.
    walk: f64,
    /// That of the sensors' noise.
    noise: f64,
    /// Independent values.
    count: f64,
}

/// Whether an effect cannot be told from a wind that wanders: one whose force follows the rates, if the wind turns the craft. The wind's push
/// stays in the residual, and the rates follow it.
pub(crate) fn looks_like(flights: &[&Prepared], model: &Model, effect: Effect) -> bool {
    let through =
        |effect: Effect, names: [&str; 2]| effect.quantities().iter().any(|name| names.contains(name));
    let turns = |effect: Effect| {
        effect.info().axes.iter().any(|axis| matches!(axis, Axis::P | Axis::Q)) && through(effect, ["u", "v"])
    };
    flights.iter().any(|flight| flight.has_gusts())
        && model.terms.iter().any(|term| turns(term.effect))
        && effect.info().axes.iter().all(|axis| matches!(axis, Axis::U | Axis::V))
        && through(effect, ["p", "q"])
}

/// Whether these flights tell a random walk from something else.
pub(crate) fn is_told_by(flights: &[&Prepared]) -> bool {
    let total_s: f64 = flights.iter().map(|flight| flight.rows() as f64 * flight.period_s).sum();
    total_s >= LEAST_S && noise::knows_forces(flights)
}

/// By what residuals without their slow part are no random walk: the band that stands out most, on both axes.
pub(crate) fn otherwise(flights: &[&Prepared], residuals: &[&Residuals]) -> Vec<Unexplained> {
    let mut bands = [Band::default(); BANDS];
    for (flight, residual) in flights.iter().zip(residuals) {
        let mut first = 0;
        for stretch in &flight.stretches {
            let over_ground = over_ground(flight, stretch, residual, first);
            first += over_ground.len();
            add(&mut bands, flight, &over_ground);
        }
    }
    let mut densities = bands.map(|b| ((b.found - b.noise) / b.walk).max(0.0));
    densities.sort_by(f64::total_cmp);
    let density = 0.5 * (densities[BANDS / 2 - 1] + densities[BANDS / 2]);
    let departures = bands.map(|b| (b.found / (density * b.walk + b.noise)).max(f64::MIN_POSITIVE).ln());
    let squares =
        departures.iter().zip(&bands).map(|(d, b)| d * d / (1.0 / b.count + NEARLY * NEARLY)).sum::<f64>();
    let count: f64 = bands.iter().map(|b| b.count).sum();
    let p_value = squares_p_value(squares, BANDS - 1, count);
    if p_value > OTHERWISE {
        return Vec::new();
    }
    let most = departures.iter().map(|d| d.abs()).fold(0.0, f64::max);
    let of = |axis| Unexplained {
        axis,
        depends_on: Dependence::SlowChanges,
        share_percent: 100.0 * (1.0 - (-most).exp()),
        p_value,
    };
    vec![of(Axis::U), of(Axis::V)]
}

/// The horizontal residual of a stretch, whose first row is `first`, north and east.
fn over_ground(flight: &Prepared, stretch: &Stretch, residuals: &Residuals, first: usize) -> Vec<[f64; 2]> {
    let samples = flight.margin..stretch.time_s.len() - flight.margin;
    let turned = |(row, k): (usize, usize)| {
        let (sine, cosine) = stretch.euler_rad[2][k].sin_cos();
        let [u, v] = [0, 1].map(|axis| residuals.residual[axis][row]);
        [cosine * u - sine * v, sine * u + cosine * v]
    };
    (first..).zip(samples).map(turned).collect()
}

/// Adds a stretch to the bands that it is long enough for.
fn add(bands: &mut [Band; BANDS], flight: &Prepared, over_ground: &[[f64; 2]]) {
    let corner_hz = 1.0 / (TAU * MEMORY_S);
    let taps = flight.force_taps();
    let noise_of = noise::force_density(flight);
    let length_s = over_ground.len() as f64 * flight.period_s;
    for (band, limits) in bands.iter_mut().zip(LIMITS_HZ.windows(2)) {
        if length_s * (limits[1] - limits[0]) < 1.0 {
            continue;
        }
        let steps = ((limits[1] - limits[0]) / STEP_HZ).round();
        for step in 0..steps as usize {
            let frequency_hz = limits[0] + (step as f64 + 0.5) * STEP_HZ;
            let cycles = frequency_hz * flight.period_s;
            let passed = 1.0 / (frequency_hz * frequency_hz + corner_hz * corner_hz);
            let independent = 2.0 * INDEPENDENT * STEP_HZ * length_s;
            band.found += independent * power(over_ground, cycles);
            band.walk += independent * passed * noise::gain(&taps, cycles);
            band.noise += independent * passed * frequency_hz * frequency_hz * noise_of(frequency_hz);
            band.count += independent;
        }
    }
}

/// Mean spectral density of two signals at so many cycles a sample, through Hann's window.
fn power(signals: &[[f64; 2]], cycles: f64) -> f64 {
    let (mut sums, mut weights) = ([[0.0; 2]; 2], 0.0);
    for (k, signal) in signals.iter().enumerate() {
        let hann = noise::hann(k, signals.len());
        weights += hann * hann;
        let (sine, cosine) = (TAU * cycles * k as f64).sin_cos();
        for (sum, value) in sums.iter_mut().zip(signal) {
            sum[0] += hann * value * cosine;
            sum[1] += hann * value * sine;
        }
    }
    sums.iter().flatten().map(|s| s * s).sum::<f64>() / (2.0 * weights)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use sysid::fit::slow;

    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// Residuals of forces over the ground, by the sample, through the filters of the rows and less their slow part.
    fn residuals(flight: &Prepared, force: &mut impl FnMut(usize) -> [f64; 2]) -> Residuals {
        let taps = flight.force_taps();
        let stretch = &flight.stretches[0];
        let forces: Vec<[f64; 2]> = (0..stretch.time_s.len()).map(force).collect();
        let mut left = Residuals::default();
        for k in flight.margin..forces.len() - flight.margin {
            let window = &forces[k - taps.len() / 2..];
            let [north, east] =
                [0, 1].map(|axis| taps.iter().zip(window).map(|(tap, f)| tap * f[axis]).sum::<f64>());
            let (sine, cosine) = stretch.euler_rad[2][k].sin_cos();
            left.residual[0].push(cosine * north + sine * east);
            left.residual[1].push(cosine * east - sine * north);
        }
        slow::take_from_targets(flight, 1, &mut left.residual);
        left
    }

    fn judged(mut force: impl FnMut(usize) -> [f64; 2]) -> Vec<Unexplained> {
        let flights = prepared(&truth(), 1..5, 24.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        assert!(is_told_by(&flights) && !is_told_by(&flights[..1]));
        let left: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, &mut force)).collect();
        otherwise(&flights, &left.iter().collect::<Vec<_>>())
    }

    /// First-order processes of 4 s and a push of 0.25 m/s^2: a random walk within seconds.
    #[test]
    fn a_wind_that_wanders_is_a_random_walk() {
        for seed in 0..8 {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let (mut push, keep) = ([0.0; 2], (-0.01f64 / 4.0).exp());
            let spread = 0.25 * (1.0 - keep * keep).sqrt();
            let found = judged(|_| {
                push.iter_mut().for_each(|p| {
                    let normal = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
                    *p = keep * *p + spread * normal;
                });
                push
            });
            assert_eq!(found, [], "seed {seed}");
        }
    }

    #[test]
    fn a_force_that_follows_rates_is_told_unless_the_wind_turns_the_craft() {
        let mut flights = prepared(&truth(), 1..2, 4.0, &ORDINARY);
        let looks = |flight: &Prepared, model: &Model| {
            [Effect::RateCoupling, Effect::GroundEffect, Effect::TrackingOffset]
                .map(|effect| looks_like(&[flight], model, effect))
        };
        let mut turned = Model::thesis();
        turned.terms.retain(|term| term.effect != Effect::FlappingMoment);
        let blown = turned.clone();
        turned.set(Effect::FlappingMoment, &[0.0; 2]);
        assert_eq!(looks(&flights[0], &turned), [false; 3]);
        sysid::fit::gusts::expect(&mut [&mut flights[0]]);
        assert_eq!(looks(&flights[0], &turned), [true, false, false]);
        assert_eq!(looks(&flights[0], &blown), [false; 3]);
    }

    #[test]
    fn a_force_of_one_frequency_or_of_none_is_not() {
        let wave = |period_s: f64| {
            move |k: usize| {
                let (sine, cosine) = (TAU * 0.01 * k as f64 / period_s).sin_cos();
                [0.25 * sine, 0.25 * cosine]
            }
        };
        for period_s in [1.4, 5.0, 16.0] {
            let found = judged(wave(period_s));
            assert_eq!(found.len(), 2, "{period_s}");
            assert!(found.iter().all(|left| left.p_value < OTHERWISE && left.share_percent > 50.0));
        }
    }
}
