//! A stretch of a flight without gaps, and how fast its rotors turned.

use flights::hermite;
use model::rotor_lag::{RotorLag, decayed};
use model::{Adjustments, Further, NO_FURTHER, Surroundings, Vehicle};
use nalgebra::{Matrix3, Vector3};

use crate::filter::convolve;
use crate::prepare::outliers::Outlier;

/// A stretch of a flight without gaps, evenly sampled.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Time of each sample, s.
    pub time_s: Vec<f64>,
    /// Position of the tracked point NED, m.
    pub position_ned_m: [Vec<f64>; 3],
    /// Phi, theta, psi as logged, unwrapped.
    pub euler_rad: [Vec<f64>; 3],
    /// Inertial to body, from the attitude as logged.
    pub dcm: Vec<Matrix3<f64>>,
    /// Of the tracked point: logged, or the derivative of the position.
    pub velocity_ned_m_s: [Vec<f64>; 3],
    /// Gyro less its bias.
    pub rate_rad_s: [Vec<f64>; 3],
    /// Motor commands, in the unit of the vehicle file.
    pub command: [Vec<f64>; 4],
    /// Rotor speeds as logged, rad/s.
    pub logged_rotor_rad_s: Option<[Vec<f64>; 4]>,
    /// Battery voltage, V.
    pub battery_v: Vec<f64>,
    /// Specific force along the body axes, m/s^2.
    pub imu_m_s2: Option<[Vec<f64>; 3]>,
    /// Whether a sample's sensor values were all logged, not filled in: only those carry the
    /// sensors' noise.
    pub measured: Vec<bool>,
    /// Outliers in the place of which there are other values now, by sample of the stretch.
    pub outliers: Vec<Outlier>,
    /// Wind that wanders within the flight at each sample, north and east, m/s, beside the constant one; nothing where none was found.
    pub gust_ned_m_s: Option<[Vec<f64>; 2]>,
    /// Further columns that formulas name, by their places in a sample; NaN where nothing is known. None at all where the flight has none.
    pub further: Vec<Further>,
    /// The places of those that the flight has.
    pub further_places: Vec<usize>,
}

/// One rotor over a stretch.
pub struct RotorTrack {
    /// Speed at every sample, rad/s.
    pub speed_rad_s: Vec<f64>,
    /// Mean speed between neighbouring samples, rad/s, one fewer.
    pub mean_rad_s: Vec<f64>,
}

impl Stretch {
    /// A part of it.
    pub fn part(&self, range: std::ops::Range<usize>) -> Self {
        fn cut<const N: usize>(all: &[Vec<f64>; N], range: &std::ops::Range<usize>) -> [Vec<f64>; N] {
            all.each_ref().map(|one| one[range.clone()].to_vec())
        }
        Self {
            time_s: self.time_s[range.clone()].to_vec(),
            position_ned_m: cut(&self.position_ned_m, &range),
            euler_rad: cut(&self.euler_rad, &range),
            dcm: self.dcm[range.clone()].to_vec(),
            velocity_ned_m_s: cut(&self.velocity_ned_m_s, &range),
            rate_rad_s: cut(&self.rate_rad_s, &range),
            command: cut(&self.command, &range),
            logged_rotor_rad_s: self.logged_rotor_rad_s.as_ref().map(|all| cut(all, &range)),
            battery_v: self.battery_v[range.clone()].to_vec(),
            imu_m_s2: self.imu_m_s2.as_ref().map(|all| cut(all, &range)),
            measured: self.measured[range.clone()].to_vec(),
            outliers: self
                .outliers
                .iter()
                .filter(|outlier| range.contains(&outlier.row))
                .map(|outlier| Outlier { row: outlier.row - range.start, ..*outlier })
                .collect(),
            gust_ned_m_s: self.gust_ned_m_s.as_ref().map(|all| cut(all, &range)),
            further: self.further.get(range).map_or_else(Vec::new, <[Further]>::to_vec),
            further_places: self.further_places.clone(),
        }
    }

    /// The further columns at a sample.
    #[inline]
    pub fn further_at(&self, k: usize) -> Further {
        self.further.get(k).copied().unwrap_or(NO_FURTHER)
    }

    /// The further columns halfway between a sample and the next.
    #[inline]
    pub(crate) fn further_after(&self, k: usize) -> Further {
        let Some([here, next]) = self.further.get(k..k + 2) else { return NO_FURTHER };
        std::array::from_fn(|place| 0.5 * (here[place] + next[place]))
    }

    /// Battery at a sample, and the further columns halfway to the next.
    #[inline]
    pub(crate) fn surroundings_after(&self, k: usize) -> Surroundings {
        Surroundings::new(self.battery_v[k], self.further_after(k))
    }

    /// Each rotor's speed. `late_s` is what the log's rotor samples come late: they are brought
    /// forward by it.
    pub fn rotors(
        &self,
        vehicle: &Vehicle,
        adjust: &Adjustments,
        period_s: f64,
        late_s: f64,
    ) -> [RotorTrack; 4] {
        let delay = (adjust.dead_time_s() - late_s) / period_s;
        if let Some(logged) = &self.logged_rotor_rad_s {
            return logged.each_ref().map(|speed| {
                let corrected: Vec<f64> = speed
                    .iter()
                    .zip(&self.battery_v)
                    .map(|(w, v)| adjust.corrected_speed_rad_s(*w, *v))
                    .collect();
                let speed_rad_s = if delay == 0.0 { corrected } else { shifted(&corrected, delay) };
                let mean_rad_s = speed_rad_s.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
                RotorTrack { speed_rad_s, mean_rad_s }
            });
        }
        let map = adjust.corrected_map(vehicle.rotor_map());
        let lag = adjust.lag_rad_s(vehicle.motors.lag);
        // The battery acts at the motor, without dead time and all the while: over a sample, the
        // mean of its ends. Held as it was at the sample's start, a sag would come half a sample
        // late and show as drag.
        let by_voltage: Vec<f64> = (0..self.battery_v.len())
            .map(|k| {
                let next = self.battery_v.get(k + 1).unwrap_or(&self.battery_v[k]);
                map.voltage * 0.5 * (self.battery_v[k] + next)
            })
            .collect();
        let [a, b, c, d] = self
            .command
            .each_ref()
            .map(|command| command.iter().map(|c| map.command * c + map.offset).collect::<Vec<f64>>());
        let [a, b, c, d, by_voltage] = Lag::new(lag, period_s).lagged([a, b, c, d, by_voltage]);
        let by_voltage = by_voltage.late(-late_s / period_s);
        [a, b, c, d].map(|rotor| rotor.late(delay).plus(&by_voltage))
    }
}

impl RotorTrack {
    /// The sum of two parts of the speed; a rotor does not turn backwards.
    fn plus(mut self, other: &Self) -> Self {
        let add = |to: &mut [f64], part: &[f64]| {
            to.iter_mut().zip(part).for_each(|(speed, part)| *speed = (*speed + part).max(0.0));
        };
        add(&mut self.speed_rad_s, &other.speed_rad_s);
        add(&mut self.mean_rad_s, &other.mean_rad_s);
        self
    }
}

/// A first-order lag (at once, without one) under commands held over a sample. Exact: between samples the response is an exponential.
#[derive(Clone, Copy)]
struct Lag {
    rad_s: f64,
    period_s: f64,
    /// What is left of a difference after a sample.
    over_sample: f64,
}

/// A lag's response to commands.
struct Lagged {
    lag: Lag,
    commanded: Vec<f64>,
    at_samples: Vec<f64>,
}

impl Lag {
    fn new(rad_s: Option<f64>, period_s: f64) -> Self {
        // At once: an exponential that has died out within any part of a sample.
        let rad_s = rad_s.unwrap_or(1e6 / period_s);
        Self { rad_s, period_s, over_sample: RotorLag::new(rad_s).decay(period_s) }
    }

    fn decay(self, time_s: f64) -> f64 {
        RotorLag::new(self.rad_s).decay(time_s)
    }

    /// Responses to signals of one length. Side by side: each value waits for the one before it, but not for the other signals.
    fn lagged<const N: usize>(self, commanded: [Vec<f64>; N]) -> [Lagged; N] {
        let samples = commanded.first().map_or(0, Vec::len);
        let mut now = commanded.each_ref().map(|signal| signal.first().copied().unwrap_or(0.0));
        let mut all: [Vec<f64>; N] = std::array::from_fn(|_| Vec::with_capacity(samples));
        for k in 0..samples {
            for ((at_samples, now), commanded) in all.iter_mut().zip(&mut now).zip(&commanded) {
                at_samples.push(*now);
                // `decayed` as a weighted mean: equal, but rounded otherwise, and results keep their bits.
                *now = commanded[k] * (1.0 - self.over_sample) + *now * self.over_sample;
            }
        }
        let mut all = all.into_iter();
        commanded.map(|commanded| Lagged { lag: self, commanded, at_samples: all.next().unwrap_or_default() })
    }
}

impl Lagged {
    /// The speeds `delay` samples late.
    fn late(self, delay: f64) -> RotorTrack {
        let Self { lag, commanded, at_samples } = self;
        let Lag { rad_s, period_s, over_sample } = lag;
        if delay == 0.0 {
            let weight = (1.0 - over_sample) / (rad_s * period_s);
            let mean_of = |(now, target): (&f64, &f64)| target + (now - target) * weight;
            let steps = commanded.len().saturating_sub(1);
            let mean_rad_s = at_samples.iter().zip(&commanded).take(steps).map(mean_of).collect();
            return RotorTrack { speed_rad_s: at_samples, mean_rad_s };
        }
        let whole = delay.floor();
        // The sample before the moment asked for, and the time from it to that moment.
        let (back, part_s) = if delay == whole {
            (whole as isize, 0.0)
        } else {
            (whole as isize + 1, (1.0 - delay + whole) * period_s)
        };
        let last = commanded.len() as isize - 1;
        let clamped = |k: isize| k.clamp(0, last) as usize;
        let part_decay = lag.decay(part_s);
        let speed_rad_s = (0..=last)
            .map(|k| {
                let from = clamped(k - back);
                decayed(at_samples[from], commanded[from], part_decay)
            })
            .collect();
        // From the moment to the next sample under one command, then as long under the next one as
        // makes a period.
        let (first_s, first_weight, second_weight) =
            (period_s - part_s, (part_decay - over_sample) / rad_s, (1.0 - part_decay) / rad_s);
        let mean_rad_s = (0..last)
            .map(|k| {
                let (a, b) = (clamped(k - back), clamped(k - back + 1));
                let first = commanded[a] * first_s + (at_samples[a] - commanded[a]) * first_weight;
                let second = commanded[b] * part_s + (at_samples[b] - commanded[b]) * second_weight;
                (first + second) / period_s
            })
            .collect();
        RotorTrack { speed_rad_s, mean_rad_s }
    }
}

/// A signal `delay` samples late (early if negative), along cubic Hermite arcs.
fn shifted(signal: &[f64], delay: f64) -> Vec<f64> {
    let last = signal.len() as isize - 1;
    let value = |k: isize| signal[k.clamp(0, last) as usize];
    (0..=last)
        .map(|k| {
            let place = k as f64 - delay;
            let at = place.floor();
            let s = place - at;
            let at = at as isize;
            let [a, b, c, d] = [value(at - 1), value(at), value(at + 1), value(at + 2)];
            let (slope_b, slope_c) = (0.5 * (c - a), 0.5 * (d - b));
            hermite(s, 1.0, [b, c], [slope_b, slope_c])
        })
        .collect()
}

pub(crate) fn vector(parts: &[Vec<f64>; 3], k: usize) -> Vector3<f64> {
    Vector3::new(parts[0][k], parts[1][k], parts[2][k])
}

/// Appends a vector to its three parts.
pub(crate) fn push(parts: &mut [Vec<f64>; 3], value: Vector3<f64>) {
    parts.iter_mut().zip(value.iter()).for_each(|(part, v)| part.push(*v));
}

pub(crate) fn subtract(parts: &mut [Vec<f64>; 3], k: usize, amount: Vector3<f64>) {
    parts.iter_mut().zip(amount.iter()).for_each(|(part, a)| part[k] -= a);
}

/// The smoothed signal, and the signal itself where the window does not fit.
pub fn smoothed(signal: &[f64], taps: &[f64]) -> Vec<f64> {
    convolve(signal, taps, |k| signal[k])
}

#[cfg(test)]
mod tests {
    use model::{Effect, Model};

    use super::*;
    use crate::testing::prepared;

    const PERIOD_S: f64 = 0.01;

    /// A command through a lag.
    fn lagged(commanded: &[f64], lag_rad_s: Option<f64>, delay: f64, period_s: f64) -> RotorTrack {
        let [lagged] = Lag::new(lag_rad_s, period_s).lagged([commanded.to_vec()]);
        lagged.late(delay)
    }

    /// A command that jumps from 0 to 1 at sample 5 and back at sample 12.
    fn pulse() -> Vec<f64> {
        (0..30).map(|k| if (5..12).contains(&k) { 1.0 } else { 0.0 }).collect()
    }

    /// Answer to the pulse of a first-order lag, at a time.
    fn answer(lag_rad_s: f64, time_s: f64) -> f64 {
        let step =
            |from_s: f64| if time_s > from_s { 1.0 - (-lag_rad_s * (time_s - from_s)).exp() } else { 0.0 };
        step(5.0 * PERIOD_S) - step(12.0 * PERIOD_S)
    }

    #[test]
    fn a_lag_answers_a_pulse_with_exponentials_whatever_the_dead_time() {
        for lag_rad_s in [5.0, 21.5, 80.0] {
            for delay in [0.0, 1.0, 0.3, 2.75, -1.0, -0.4] {
                let track = lagged(&pulse(), Some(lag_rad_s), delay, PERIOD_S);
                for (k, speed) in track.speed_rad_s.iter().enumerate().take(27) {
                    let truth = answer(lag_rad_s, (k as f64 - delay) * PERIOD_S);
                    assert!(
                        (speed - truth).abs() < 1e-12,
                        "{lag_rad_s} rad/s, {delay}, {k}: {speed} {truth}"
                    );
                }
            }
        }
    }

    /// By the rule of Simpson over a hundred pieces of a sample, whose ends fall on the jumps.
    #[test]
    fn the_mean_speed_between_samples_is_the_mean_of_the_exponentials() {
        let lag_rad_s = 21.5;
        for delay in [0.0, 2.0, 0.25, 1.5, -0.75] {
            let track = lagged(&pulse(), Some(lag_rad_s), delay, PERIOD_S);
            assert_eq!(track.mean_rad_s.len(), 29);
            for (k, mean) in track.mean_rad_s.iter().enumerate().take(27) {
                let at = |j: f64| answer(lag_rad_s, (k as f64 + 0.01 * j - delay) * PERIOD_S);
                let piece = |j: f64| (at(j) + 4.0 * at(j + 0.5) + at(j + 1.0)) / 6.0;
                let truth = 0.01 * (0..100).map(|j| piece(f64::from(j))).sum::<f64>();
                assert!((mean - truth).abs() < 1e-9, "{delay}, {k}: {mean} {truth}");
            }
        }
    }

    #[test]
    fn without_a_lag_the_speed_follows_at_once_and_holds_over_the_sample() {
        let track = lagged(&pulse(), None, 0.0, PERIOD_S);
        for (mean, command) in track.mean_rad_s.iter().zip(pulse()) {
            assert!((mean - command).abs() < 1e-5, "{mean} {command}");
        }
    }

    #[test]
    fn nothing_and_one_command_are_tracks_of_their_length() {
        for delay in [0.0, 0.5, -2.0] {
            let none = lagged(&[], Some(20.0), delay, PERIOD_S);
            assert!(none.speed_rad_s.is_empty() && none.mean_rad_s.is_empty());
            let one = lagged(&[3.0], Some(20.0), delay, PERIOD_S);
            assert_eq!((one.speed_rad_s, one.mean_rad_s.len()), (vec![3.0], 0));
        }
    }

    #[test]
    fn a_parabola_is_shifted_exactly_and_held_at_its_ends() {
        let parabola = |x: f64| 2.0 - 3.0 * x + 0.5 * x * x;
        let signal: Vec<f64> = (0..20).map(|k| parabola(f64::from(k))).collect();
        for delay in [0.0, 0.4, 2.0, -1.3] {
            let moved = shifted(&signal, delay);
            assert_eq!(moved.len(), 20);
            for (k, value) in moved.iter().enumerate().take(16).skip(4) {
                assert!((value - parabola(k as f64 - delay)).abs() < 1e-12, "{delay}, {k}: {value}");
            }
        }
        assert_eq!(shifted(&signal, 5.0)[..3], [2.0; 3]);
        assert!(shifted(&[], 1.0).is_empty());
    }

    #[test]
    fn samples_that_come_late_are_brought_forward_and_a_dead_time_puts_them_back() {
        let flight = prepared(300, |t, row| row.command[0] = if t < 0.995 { 1500.0 } else { 1700.0 });
        let (stretch, vehicle) = (&flight.stretches[0], Vehicle::thesis());
        // Speed of the first sample above the one at rest.
        let rises = |adjust: &Adjustments, late_s: f64| {
            let [rotor, ..] = stretch.rotors(&vehicle, adjust, PERIOD_S, late_s);
            rotor.speed_rad_s.iter().position(|w| *w > rotor.speed_rad_s[0] + 1.0).unwrap()
        };
        let none = Adjustments::default();
        assert_eq!((rises(&none, 0.0), rises(&none, 0.03)), (101, 98));
        let mut model = Model::new(vehicle.clone());
        model.set(Effect::InputDelay, &[0.02]);
        let delay = model.adjustments();
        assert!((delay.dead_time_s() - 0.02).abs() < 1e-12);
        assert_eq!((rises(&delay, 0.0), rises(&delay, 0.02)), (103, 101));
    }

    #[test]
    fn a_rotor_stands_where_the_map_asks_it_to_turn_backwards() {
        let flight = prepared(300, |_, row| row.command = [0.0, 1600.0, 1600.0, 1600.0]);
        let [standing, turning, ..] =
            flight.stretches[0].rotors(&Vehicle::thesis(), &Adjustments::default(), PERIOD_S, 0.0);
        assert!(standing.speed_rad_s.iter().chain(&standing.mean_rad_s).all(|w| *w == 0.0));
        assert!(turning.speed_rad_s.iter().all(|w| (w - 586.706).abs() < 1e-9));
    }

    #[test]
    fn a_part_holds_the_same_samples_of_every_channel() {
        let flight = prepared(300, |t, row| {
            row.position_ned_m = [t, 2.0 * t, 3.0 * t];
            row.command = [1500.0 + t; 4];
        });
        let whole = &flight.stretches[0];
        let part = whole.part(40..50);
        assert_eq!(part.time_s, whole.time_s[40..50]);
        assert_eq!(part.position_ned_m[2][9], whole.position_ned_m[2][49]);
        assert_eq!(part.command[3][0], whole.command[3][40]);
        let lengths = [part.dcm.len(), part.battery_v.len(), part.measured.len(), part.rate_rad_s[1].len()];
        assert_eq!(lengths, [10; 4]);
        assert!(whole.part(7..7).time_s.is_empty());
    }
}
