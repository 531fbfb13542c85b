//! How strongly the motors turn the craft at several hertz, beside what a model says.
//!
//! Slow moments (the air's on rotors in forward flight, a wandering trim) are answered by the controller's motors, so that
//! the angular acceleration shows little of either, and least squares takes the motors for weaker than they are. Above some
//! hertz the motors are left to themselves. There the plainest statistic speaks: the frequency response from the model's
//! moment of the motors to the measured angular acceleration, which is 1 where the model is right. With spectra S of
//! Welch's method, the delay taken out,
//! `lower = Re S_xy / S_xx` and `upper = S_yy / Re S_xy` enclose it: noise in the rotor speeds lowers the one,
//! all that acts besides the motors raises the other (Bendat and Piersol 2010, section 6.1). The product of lower and 1 / upper is the
//! coherence.
//!
//! In closed loop the coherence alone proves nothing: where gyro noise is all that moves the motors, the response is that of the
//! controller turned round, `-s / C(s)`, with a coherence of 1 (Ljung 1999, section 13.4). Its phase tells: no delay
//! turns it to zero. So the delay of each flight is the one under which the responses at all frequencies agree in phase, whatever the phase,
//! and what is left of the phase is looked at.

use std::f64::consts::TAU;
use std::ops::Range;

use fourier::Complex;
use model::{Axis, Effect, Model, Plant};
use report::number::{fixed, significant};
use schemars::JsonSchema;
use serde::Serialize;

use crate::fit::rotation::has_rotation;
use crate::fit::segments::Segments;
use crate::fit::slung_load::without_load;
use crate::prepare::{Part, Prepared, Stretch};

/// Where the response is looked at, Hz: above what controllers answer, below where motors follow no more.
const BAND_HZ: Range<f64> = 4.0..16.0;
/// Where its halves meet, Hz. What gyro noise makes the motors do gives a response that grows with the frequency, and differs
/// between them.
const MIDDLE_HZ: f64 = 8.0;
/// Frequencies beyond this part of the sampling rate are left out.
const HIGHEST_PART: f64 = 0.3;
/// Length of a segment of Welch's method, s.
const SEGMENT_S: f64 = 2.56;
/// Delays that are tried for each flight, s, to either side.
const DELAY_S: f64 = 0.04;
/// Step between them, s.
const DELAY_STEP_S: f64 = 0.001;
/// Coherence from which on the response is believed.
const COHERENT: f64 = 0.5;
/// Phase up to which the response is that of the motors, rad.
const LARGEST_PHASE_RAD: f64 = 0.5;
/// How many times as strongly as the model says the motors must turn the craft for the model to be wrong.
const TOO_WEAK: f64 = 2.0;

/// How strongly the motors turn the craft about an axis over what the model says, between 4 and 16 Hz.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MotorResponse {
    /// p, q or r.
    pub axis: Axis,
    /// At least so many times as strongly, as far as nothing but the motors acts there.
    pub lower: f64,
    /// At most so many times, as far as the rotor speeds are without noise.
    pub upper: f64,
    /// Coherence of the motors' moment and the angular acceleration.
    pub coherence: f64,
    /// Phase of the response that no delay explains, rad: next to zero where the motors turn the craft, and not where gyro noise
    /// moves the motors.
    pub phase_rad: f64,
    /// Smallest `lower` and coherence of the halves of the band.
    #[serde(skip)]
    least: (f64, f64),
}

impl MotorResponse {
    /// Whether the motors certainly turn the craft more than twice as strongly as the model says.
    pub fn contradicts(&self) -> bool {
        let (lower, coherence) = self.least;
        coherence >= COHERENT && lower > TOO_WEAK && self.phase_rad.abs() < LARGEST_PHASE_RAD
    }

    /// The contradiction, for people.
    pub fn sentence(&self) -> String {
        format!(
            "{}: between {} and {} Hz the motors turn the craft {} to {} times as strongly as the model says (coherence {}); \
             at lower frequencies the controller answers disturbances, which hides what the motors do",
            motion_about(self.axis),
            BAND_HZ.start,
            BAND_HZ.end,
            significant(self.lower, 2),
            significant(self.upper, 2),
            fixed(self.coherence, 2)
        )
    }
}

/// The motion about an axis of the rotation, for people.
pub(crate) fn motion_about(axis: Axis) -> &'static str {
    match axis {
        Axis::P => "roll",
        Axis::Q => "pitch",
        _ => "yaw",
    }
}

/// The response of each axis that all flights together show; axes and models without are left out.
pub fn motor_responses(model: &Model, flights: &[&Prepared]) -> Vec<MotorResponse> {
    if !has_rotation(model) {
        return Vec::new();
    }
    let signals: Vec<_> = flights.iter().map(|flight| (*flight, signals(model, flight))).collect();
    [Axis::P, Axis::Q, Axis::R]
        .into_iter()
        .filter_map(|axis| {
            let place = axis.index() - 3;
            let mut halves = [Sums::default(); 2];
            for (flight, of_flight) in &signals {
                let spectra = spectra(of_flight.iter().map(|of_stretch| &of_stretch[place]), flight.period_s);
                add_without_delay(&spectra, &mut halves);
            }
            response(axis, halves)
        })
        .collect()
}

/// The model's moment of the motors and the measured angular acceleration between samples of an axis, rad/s^2.
type Signals = [Vec<f64>; 2];

/// Those of the three axes, by stretch.
fn signals(model: &Model, flight: &Prepared) -> Vec<[Signals; 3]> {
    let whole = without_load(model);
    let mut others = whole.clone();
    others.terms.retain(|term| term.effect != Effect::RotorMoments);
    let (whole, others) = (Plant::new(&whole), Plant::new(&others));
    let of_stretch = |stretch: &Stretch| {
        let mut signals: [Signals; 3] = Default::default();
        let states = flight.remembering_states(stretch, &model.vehicle, &whole, []);
        states.for_each_between(&Part::whole(stretch), |input| {
            let all = whole.accelerations(&whole.sample_of(input));
            let rest = others.accelerations(&others.sample_of(input));
            for (place, [moment, acceleration]) in signals.iter_mut().enumerate() {
                moment.push(all[3 + place] - rest[3 + place]);
                acceleration.push(input.angular_acceleration_rad_s2[place]);
            }
        });
        signals
    };
    flight.stretches.iter().map(of_stretch).collect()
}

/// Welch's spectra of a flight within the band, each with its frequency in Hz.
fn spectra<'a>(stretches: impl Iterator<Item = &'a Signals>, period_s: f64) -> Vec<(f64, Sums)> {
    let length = (SEGMENT_S / period_s).round() as usize;
    let frequency = |bin: usize| bin as f64 / (length as f64 * period_s);
    let highest = BAND_HZ.end.min(HIGHEST_PART / period_s);
    let bins: Vec<usize> =
        (1..length / 2).filter(|bin| (BAND_HZ.start..highest).contains(&frequency(*bin))).collect();
    let mut spectra: Vec<(f64, Sums)> = bins.iter().map(|bin| (frequency(*bin), Sums::default())).collect();
    if bins.is_empty() {
        return spectra;
    }
    let segments = Segments::new(length);
    for [moment, acceleration] in stretches {
        for (x, y) in segments.of(moment).zip(segments.of(acceleration)) {
            for ((_, sums), &bin) in spectra.iter_mut().zip(&bins) {
                sums.moment += x[bin].norm_sqr();
                sums.acceleration += y[bin].norm_sqr();
                sums.cross += x[bin].conj() * y[bin];
            }
        }
    }
    spectra
}

/// S_xx, S_yy and S_xy of a part of the band.
#[derive(Clone, Copy, Default)]
struct Sums {
    moment: f64,
    acceleration: f64,
    cross: Complex<f64>,
}

impl Sums {
    fn plus(self, other: Self) -> Self {
        Self {
            moment: self.moment + other.moment,
            acceleration: self.acceleration + other.acceleration,
            cross: self.cross + other.cross,
        }
    }

    /// Lower and upper bound of the response, and coherence.
    fn bounds(&self) -> Option<(f64, f64, f64)> {
        let in_phase = self.cross.re;
        let is_there = self.moment > 0.0 && self.acceleration > 0.0 && in_phase > 0.0;
        let coherence = in_phase * in_phase / (self.moment * self.acceleration);
        is_there.then_some((in_phase / self.moment, self.acceleration / in_phase, coherence))
    }
}

/// Adds a flight to the halves of the band, under the delay with which the response has most nearly one phase.
fn add_without_delay(spectra: &[(f64, Sums)], halves: &mut [Sums; 2]) {
    let turned = |(frequency_hz, sums): &(f64, Sums), delay_s: f64| {
        sums.cross * Complex::from_polar(1.0, TAU * frequency_hz * delay_s)
    };
    let steps = (DELAY_S / DELAY_STEP_S).round() as i32;
    let delays = (-steps..=steps).map(|step| f64::from(step) * DELAY_STEP_S);
    let total =
        |delay_s: f64| spectra.iter().map(|bin| turned(bin, delay_s)).sum::<Complex<f64>>().norm_sqr();
    let Some(delay_s) = delays.max_by(|a, b| total(*a).total_cmp(&total(*b))) else { return };
    for bin in spectra {
        let half = &mut halves[usize::from(bin.0 >= MIDDLE_HZ)];
        *half = half.plus(Sums { cross: turned(bin, delay_s), ..bin.1 });
    }
}

fn response(axis: Axis, halves: [Sums; 2]) -> Option<MotorResponse> {
    let all = halves[0].plus(halves[1]);
    let (lower, upper, coherence) = all.bounds()?;
    let of_halves =
        halves.map(|half| half.bounds().map_or((0.0, 0.0), |(lower, _, coherence)| (lower, coherence)));
    let least = (of_halves[0].0.min(of_halves[1].0), of_halves[0].1.min(of_halves[1].1));
    Some(MotorResponse { axis, lower, upper, coherence, phase_rad: all.cross.arg(), least })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// A moment of several sines within the band, and its answer after 7 ms.
    fn sines(gain: f64, disturbance: impl Fn(f64) -> f64) -> Signals {
        let moment =
            |t: f64| (1..40).map(|k| (0.45 * TAU * f64::from(k) * t + f64::from(k * k)).sin()).sum::<f64>();
        let times = || (0..6000).map(|k| 0.01 * f64::from(k));
        [times().map(moment).collect(), times().map(|t| gain * moment(t - 0.007) + disturbance(t)).collect()]
    }

    /// Sines of other frequencies of the band, as strong.
    fn noise(t: f64) -> f64 {
        (1..40).map(|k| (0.41 * TAU * f64::from(k) * t + f64::from(k * k * k)).sin()).sum()
    }

    fn of(signals: &Signals) -> MotorResponse {
        let mut halves = [Sums::default(); 2];
        add_without_delay(&spectra([signals].into_iter(), 0.01), &mut halves);
        response(Axis::P, halves).unwrap()
    }

    #[test]
    fn a_late_answer_has_the_gain_of_the_motors_whatever_goes_on_below_the_band() {
        let quiet = of(&sines(3.0, |_| 0.0));
        assert!((quiet.lower - 3.0).abs() < 0.03 && (quiet.upper - 3.0).abs() < 0.03, "{quiet:?}");
        assert!(quiet.contradicts());
        // Ten times as strong, at a tenth of the lowest frequency.
        let slow = of(&sines(3.0, |t| 30.0 * (TAU * 0.4 * t).sin()));
        assert!((slow.lower - 3.0).abs() < 0.03 && slow.contradicts(), "{slow:?}");
        assert!(!of(&sines(1.9, |_| 0.0)).contradicts());
        assert_eq!(
            quiet.sentence(),
            "roll: between 4 and 16 Hz the motors turn the craft 3.0 to 3.0 times as strongly as the model says (coherence 1.00); \
             at lower frequencies the controller answers disturbances, which hides what the motors do"
        );
    }

    #[test]
    fn noise_of_either_signal_widens_the_bounds_on_its_own_side() {
        let besides = of(&sines(1.0, noise));
        assert!((besides.lower - 1.0).abs() < 0.15 && besides.upper > 1.7, "{besides:?}");
        let mut signals = sines(1.0, |_| 0.0);
        signals[0].iter_mut().enumerate().for_each(|(k, moment)| *moment += noise(0.01 * k as f64));
        let rotors = of(&signals);
        assert!((rotors.upper - 1.0).abs() < 0.15 && rotors.lower < 0.6, "{rotors:?}");
    }

    #[test]
    fn the_true_model_is_right_and_one_of_a_third_of_its_moments_is_not() {
        let mut model = truth();
        let flight = Prepared::new(&fly(&model, 1, 24.0, &NONE), &model.vehicle).unwrap();
        for response in motor_responses(&model, &[&flight]) {
            assert!(!response.contradicts() && response.lower < 1.1, "{response:?}");
        }
        let third: Vec<f64> =
            model.term(Effect::RotorMoments).unwrap().values().iter().map(|value| value / 3.0).collect();
        model.set(Effect::RotorMoments, &third);
        let responses = motor_responses(&model, &[&flight]);
        for response in &responses {
            assert!(response.lower > 2.7 && response.lower < 3.1 && response.upper > 3.0, "{response:?}");
        }
        // Beyond 8 Hz this flight hardly rolls: of the roll nothing is said.
        let said = |response: &MotorResponse| response.contradicts();
        assert_eq!(responses.iter().map(said).collect::<Vec<_>>(), [false, true, true], "{responses:?}");
    }

    #[test]
    fn a_controller_that_answers_gyro_noise_is_not_taken_for_the_motors() {
        // Rates are noise n, the moment is -K n two samples later: the response is -s / K, delay apart.
        let times = || (0..6000).map(|k| 0.01 * f64::from(k));
        let slope = |t: f64| (noise(t + 0.005) - noise(t - 0.005)) / 0.01;
        let turned_round: Signals =
            [times().map(|t| -5.0 * noise(t - 0.02)).collect(), times().map(slope).collect()];
        let mut halves = [Sums::default(); 2];
        add_without_delay(&spectra([&turned_round].into_iter(), 0.01), &mut halves);
        let found = response(Axis::P, halves);
        assert!(found.as_ref().is_none_or(|found| !found.contradicts()), "{found:?}");
        assert!(halves[0].plus(halves[1]).cross.arg().abs() > 1.0, "{found:?}");
    }

    #[test]
    fn models_of_forces_and_flights_too_short_have_none() {
        let mut model = truth();
        let short = Prepared::new(&fly(&model, 1, 2.0, &NONE), &model.vehicle).unwrap();
        assert_eq!(motor_responses(&model, &[&short]), []);
        assert_eq!(motor_responses(&model, &[]), []);
        model.terms.retain(|term| term.effect == Effect::Thrust);
        assert_eq!(motor_responses(&model, &[&short]), []);
    }
}
