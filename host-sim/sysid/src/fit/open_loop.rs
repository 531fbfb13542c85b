//! Open-loop prediction: the model flies from every sample of a flight with nothing but the rotor speeds.

use flights::Column;
use model::{Effect, Model, Plant, State, frames};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

use crate::filter::RegressionFilter;
use crate::fit::rotation::has_rotation;
use crate::fit::swing;
use crate::prepare::{Prepared, Stretch, smoothed};

/// Longest horizon of the open-loop prediction, samples.
pub const LONGEST_HORIZON: usize = 50;

/// Window that takes half of the noise and nothing that a rotor does, s.
const BARELY_S: f64 = 0.1;

/// Mean norm of the open-loop error over all starting samples (attitude: geodesic angle). Of a model without rotation
/// position and velocity are predicted with the logged attitude and rates, and these are not numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct HorizonError {
    /// m.
    pub position_m: f64,
    /// m/s.
    pub velocity_m_s: f64,
    /// rad.
    pub attitude_rad: f64,
    /// rad/s.
    pub rate_rad_s: f64,
}

/// The sum over every horizon.
pub(crate) fn sum_of_horizons(by_horizon: &[HorizonError]) -> HorizonError {
    let sum = |f: fn(&HorizonError) -> f64| by_horizon.iter().map(f).sum();
    HorizonError {
        position_m: sum(|e| e.position_m),
        velocity_m_s: sum(|e| e.velocity_m_s),
        attitude_rad: sum(|e| e.attitude_rad),
        rate_rad_s: sum(|e| e.rate_rad_s),
    }
}

/// What predictions are judged by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Against {
    /// The samples as logged, outliers included.
    Logged,
    /// The samples as preparation leaves them.
    Cleaned,
}

/// Mean open-loop errors at each horizon from 1 to [`LONGEST_HORIZON`] samples, against the samples as logged: what
/// preparation took for an outlier counts, or a score would depend on what is left out.
pub fn open_loop(model: &Model, flights: &[&Prepared]) -> Vec<HorizonError> {
    open_loop_with(model, flights, true, Against::Logged, 1)
}

/// The same against the samples without their outliers; nothing where there are none.
pub(crate) fn open_loop_of_cleaned(model: &Model, flights: &[&Prepared]) -> Option<Vec<HorizonError>> {
    let cleaned = flights.iter().flat_map(|flight| &flight.stretches).any(|s| !s.outliers.is_empty());
    cleaned.then(|| open_loop_with(model, flights, true, Against::Cleaned, 1))
}

/// The same without the trim that training flights have, as if they had not been flown before, and from every `every`th sample only.
pub(crate) fn open_loop_without_trim(
    model: &Model,
    flights: &[&Prepared],
    every: usize,
) -> Vec<HorizonError> {
    open_loop_with(model, flights, false, Against::Logged, every)
}

fn open_loop_with(
    model: &Model,
    flights: &[&Prepared],
    with_trim: bool,
    against: Against,
    every: usize,
) -> Vec<HorizonError> {
    let plant = Plant::new(model);
    let mut sums = vec![HorizonError::default(); LONGEST_HORIZON];
    let mut starts = 0_u64;
    for flight in flights {
        for stretch in &flight.stretches {
            let trim = flight.trim.as_ref().filter(|_| with_trim).map_or([0.0; 6], |trim| trim.value);
            let stretch = (stretch, against);
            starts += add_rollouts(&plant, model, flight, stretch, &trim, (every, &mut sums));
        }
    }
    let n = starts.max(1) as f64;
    let turning = if has_rotation(model) { n } else { f64::NAN };
    for sum in &mut sums {
        sum.position_m /= n;
        sum.velocity_m_s /= n;
        sum.attitude_rad /= turning;
        sum.rate_rad_s /= turning;
    }
    sums
}

fn add_rollouts(
    plant: &Plant,
    model: &Model,
    flight: &Prepared,
    (stretch, against): (&Stretch, Against),
    trim: &[f64; 6],
    (every, sums): (usize, &mut [HorizonError]),
) -> u64 {
    let states = reference_states(model, flight, stretch);
    let mut judges = states.clone();
    if against == Against::Logged {
        put_outliers_back(&mut judges, model, flight, stretch);
    }
    let velocities: Vec<Vector3<f64>> = judges.iter().map(velocity_ned_m_s).collect();
    let rotor_mean_rad_s = mean_rotor_speeds(model, flight, stretch);
    let track = Track::of(model, flight, stretch, &states, &rotor_mean_rad_s);
    let has_users = model.effects().iter().any(|effect| matches!(effect, Effect::User(_)));
    let mut starts = 0;
    let all = flight.margin..(states.len() - flight.margin).saturating_sub(sums.len());
    for start in all.step_by(every.max(1)) {
        // A user's formula may have no value where a prediction strays to.
        let mut finite = true;
        if has_users {
            track.roll_out(plant, trim, start, sums.len(), |_, state| finite &= state.is_finite());
        }
        if !finite {
            continue;
        }
        track.roll_out(plant, trim, start, sums.len(), |h, state| {
            let (sum, to) = (&mut sums[h - 1], start + h);
            let measured = &judges[to];
            sum.position_m += (state.position_ned_m - measured.position_ned_m).norm();
            sum.velocity_m_s += (velocity_ned_m_s(state) - velocities[to]).norm();
            sum.attitude_rad += frames::geodesic_angle_rad(&state.attitude, &measured.attitude);
            sum.rate_rad_s += (state.rate_rad_s - measured.rate_rad_s).norm();
        });
        starts += 1;
    }
    starts
}

/// What was measured and what was predicted the same number of samples ahead, at each sample of a flight that can be reached.
#[derive(Debug, Clone, Default)]
pub struct Ahead {
    /// Time of the sample, s.
    pub time_s: Vec<f64>,
    /// Measured: position NED in m, body velocity in m/s, roll, pitch and yaw in rad, body rates in rad/s.
    pub measured: [Vec<f64>; 12],
    /// The same, predicted.
    pub predicted: [Vec<f64>; 12],
}

/// Predicts a flight `samples` ahead of every sample, at most [`LONGEST_HORIZON`], with nothing but the rotor speeds. Yaw is
/// given without turns that the measured yaw does not make.
pub fn predict_ahead(model: &Model, flight: &Prepared, samples: usize) -> Ahead {
    let samples = samples.clamp(1, LONGEST_HORIZON);
    let plant = Plant::new(model);
    let trim = flight.trim.as_ref().map_or([0.0; 6], |trim| trim.value);
    let mut ahead = Ahead::default();
    for stretch in &flight.stretches {
        let states = reference_states(model, flight, stretch);
        let rotor_mean_rad_s = mean_rotor_speeds(model, flight, stretch);
        let track = Track::of(model, flight, stretch, &states, &rotor_mean_rad_s);
        for start in flight.margin..(states.len() - flight.margin).saturating_sub(samples) {
            let mut last = states[start];
            track.roll_out(&plant, &trim, start, samples, |_, state| last = *state);
            ahead.time_s.push(stretch.time_s[start + samples]);
            let measured = values_of(&states[start + samples]);
            let predicted = values_of(&last);
            for (place, (measured, predicted)) in measured.into_iter().zip(predicted).enumerate() {
                let is_angle = (6..9).contains(&place);
                let near = if is_angle { measured + without_turns(predicted - measured) } else { predicted };
                ahead.measured[place].push(measured);
                ahead.predicted[place].push(near);
            }
        }
    }
    ahead
}

/// The angle without whole turns, rad.
fn without_turns(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// Position, body velocity, angles and rates of a state.
fn values_of(state: &State) -> [f64; 12] {
    let euler = frames::euler_from_dcm(&frames::dcm_from_quaternion(&state.attitude));
    let parts = [state.position_ned_m, state.velocity_m_s, euler, state.rate_rad_s];
    std::array::from_fn(|place| parts[place / 3][place % 3])
}

/// Velocity over ground, inertial NED, m/s.
pub(crate) fn velocity_ned_m_s(state: &State) -> Vector3<f64> {
    frames::dcm_from_quaternion(&state.attitude).tr_mul(&state.velocity_m_s)
}

/// A stretch to predict open loop: states by sample, with the rotor speeds that drive the prediction.
pub(crate) struct Track<'a> {
    pub(crate) states: &'a [State],
    /// Mean rotor speeds between neighbouring samples, rad/s.
    pub(crate) rotor_mean_rad_s: &'a [[f64; 4]],
    /// Battery and further columns of it.
    pub(crate) stretch: &'a Stretch,
    pub(crate) period_s: f64,
    /// Whether the model predicts attitude and rates; the logged ones are taken otherwise.
    pub(crate) turns: bool,
}

impl<'a> Track<'a> {
    /// A stretch of a flight as a model predicts it.
    fn of(
        model: &Model,
        flight: &Prepared,
        stretch: &'a Stretch,
        states: &'a [State],
        rotor_mean_rad_s: &'a [[f64; 4]],
    ) -> Self {
        Self { states, rotor_mean_rad_s, stretch, period_s: flight.period_s, turns: has_rotation(model) }
    }

    /// Predicts `samples` from `start` on with nothing but the rotor speeds; `see` is handed each horizon and its state.
    /// `trim`: constant accelerations of the flight, m/s^2 and rad/s^2.
    #[inline]
    pub(crate) fn roll_out(
        &self,
        plant: &Plant,
        trim: &[f64; 6],
        start: usize,
        samples: usize,
        mut see: impl FnMut(usize, &State),
    ) {
        let mut state = self.states[start];
        let push = trim.map(|t| t * self.period_s);
        for h in 1..=samples {
            let (from, to) = (start + h - 1, start + h);
            let (before, after) = (&self.states[from].rotor_rad_s, &self.states[to].rotor_rad_s);
            plant.step_through(
                &mut state,
                [before, &self.rotor_mean_rad_s[from], after],
                self.stretch.surroundings_after(from),
                self.period_s,
            );
            state.velocity_m_s += Vector3::new(push[0], push[1], push[2]);
            state.rate_rad_s += Vector3::new(push[3], push[4], push[5]);
            if !self.turns {
                state.attitude = self.states[to].attitude;
                state.rate_rad_s = self.states[to].rate_rad_s;
            }
            see(h, &state);
        }
    }
}

/// Each rotor's mean speed between neighbouring samples, rad/s.
pub(crate) fn mean_rotor_speeds(model: &Model, flight: &Prepared, stretch: &Stretch) -> Vec<[f64; 4]> {
    let rotor = stretch.rotors(&model.vehicle, &model.adjustments(), flight.period_s, flight.rotor_late_s());
    (1..stretch.time_s.len()).map(|k| std::array::from_fn(|i| rotor[i].mean_rad_s[k - 1])).collect()
}

/// The state at every sample that predictions start from and are judged by: an onboard estimator's as logged, raw
/// tracking smoothed without lag.
pub(crate) fn reference_states(model: &Model, flight: &Prepared, stretch: &Stretch) -> Vec<State> {
    states_of(model, flight, stretch, &flight.filter.smooth)
}

/// Puts back into the states what was logged in the place of outliers. The velocity of raw tracking is no logged value.
fn put_outliers_back(states: &mut [State], model: &Model, flight: &Prepared, stretch: &Stretch) {
    use Column::*;
    let adjust = model.adjustments();
    let lever = Vector3::from(model.vehicle.tracked_point) + adjust.tracked_point_m();
    let untilt = adjust.untilt();
    let mut cleaned: Vec<usize> = stretch.outliers.iter().map(|outlier| outlier.row).collect();
    cleaned.sort_unstable();
    cleaned.dedup();
    for k in cleaned {
        let of = |columns: [Column; 3], there: Vector3<f64>| {
            let mut values = there;
            for outlier in stretch.outliers.iter().filter(|outlier| outlier.row == k) {
                if let Some(i) = columns.iter().position(|column| *column == outlier.column) {
                    values[i] = outlier.value;
                }
            }
            values
        };
        let state = &mut states[k];
        let dcm = frames::dcm_from_quaternion(&state.attitude);
        let bias = Vector3::from(flight.gyro_bias_rad_s);
        let position = state.position_ned_m + dcm.tr_mul(&lever);
        let velocity = dcm.tr_mul(&(state.velocity_m_s + state.rate_rad_s.cross(&lever)));
        let tracked = frames::euler_from_dcm(&adjust.measured_dcm(&dcm));
        let rate = of([P, Q, R], state.rate_rad_s + bias) - bias;
        let dcm = untilt.body(&frames::dcm_from_euler(of([Phi, Theta, Psi], tracked)));
        *state = State {
            position_ned_m: of([X, Y, Z], position) - dcm.tr_mul(&lever),
            attitude: frames::quaternion_from_euler(frames::euler_from_dcm(&dcm)),
            velocity_m_s: dcm * of([Vx, Vy, Vz], velocity) - rate.cross(&lever),
            rate_rad_s: rate,
            ..*state
        };
    }
}

/// The same smoothed over a tenth of a second at most: what is fitted to must not be smoother than the rotors that drive
/// it, and a start with all its noise would be taken for damping.
pub(crate) fn barely_smoothed_states(model: &Model, flight: &Prepared, stretch: &Stretch) -> Vec<State> {
    let taps = RegressionFilter::smoothing_taps(flight.period_s, BARELY_S);
    states_of(model, flight, stretch, &taps)
}

fn states_of(model: &Model, flight: &Prepared, stretch: &Stretch, taps: &[f64]) -> Vec<State> {
    let adjust = model.adjustments();
    let untilt = adjust.untilt();
    let lever = Vector3::from(model.vehicle.tracked_point) + adjust.tracked_point_m();
    let rotor = stretch.rotors(&model.vehicle, &adjust, flight.period_s, flight.rotor_late_s());
    let at = |parts: &[Vec<f64>; 3], k: usize| Vector3::new(parts[0][k], parts[1][k], parts[2][k]);
    let swings = swing::followed(flight, stretch, model);
    let plant = Plant::new(model);
    let looked_back =
        (!plant.lags().is_empty()).then(|| flight.remembering_states(stretch, &model.vehicle, &plant, []));
    let smooth = (!flight.has_logged_velocity).then(|| {
        [&stretch.euler_rad, &stretch.rate_rad_s].map(|s| s.each_ref().map(|one| smoothed(one, taps)))
    });
    (0..stretch.time_s.len())
        .map(|k| {
            let (tracked, rate) = match &smooth {
                None => (stretch.dcm[k], at(&stretch.rate_rad_s, k)),
                Some([euler, rate]) => (frames::dcm_from_euler(at(euler, k)), at(rate, k)),
            };
            let dcm = untilt.body(&tracked);
            State {
                position_ned_m: at(&stretch.position_ned_m, k) - dcm.tr_mul(&lever),
                attitude: frames::quaternion_from_euler(frames::euler_from_dcm(&dcm)),
                velocity_m_s: dcm * at(&stretch.velocity_ned_m_s, k) - rate.cross(&lever),
                rate_rad_s: rate,
                rotor_rad_s: std::array::from_fn(|i| rotor[i].speed_rad_s[k]),
                pendulum: swings.get(k).copied().unwrap_or_default(),
                memory: looked_back.as_ref().and_then(|states| states.memory(k)).unwrap_or_default(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prepare::Trim;
    use crate::testing::{NONE, fly, truth};

    fn flown(model: &Model) -> Prepared {
        Prepared::new(&fly(model, 1, 6.0, &NONE), &model.vehicle).unwrap()
    }

    #[test]
    fn every_horizon_counts_in_the_sum() {
        let at =
            |h: f64| HorizonError { position_m: h, velocity_m_s: 1.0, attitude_rad: -h, rate_rad_s: 0.5 };
        let sum = sum_of_horizons(&[at(1.0), at(2.0), at(4.0)]);
        let expected =
            HorizonError { position_m: 7.0, velocity_m_s: 3.0, attitude_rad: -7.0, rate_rad_s: 1.5 };
        assert_eq!(sum, expected);
        assert_eq!(sum_of_horizons(&[]), HorizonError::default());
    }

    #[test]
    fn the_true_model_stays_near_a_flight_for_half_a_second_and_a_wrong_one_does_not() {
        let model = truth();
        let flight = flown(&model);
        let right = open_loop(&model, &[&flight]);
        assert_eq!(right.len(), LONGEST_HORIZON);
        assert!(right[49].position_m < 0.005, "{:?}", right[49]);
        assert!(right[49].attitude_rad < 0.01, "{:?}", right[49]);
        let mut wrong = model.clone();
        let thrust = 1.1 * model.term(Effect::Thrust).unwrap().coefficients[0].value;
        wrong.set(Effect::Thrust, &[thrust]);
        let error = open_loop(&wrong, &[&flight])[49];
        // A tenth of gravity for half a second: 0.98 / 2 * 0.25 m and 0.49 m/s.
        assert!((error.position_m - 0.123).abs() < 0.015, "{error:?}");
        assert!((error.velocity_m_s - 0.49).abs() < 0.05, "{error:?}");
    }

    #[test]
    fn a_model_of_forces_alone_takes_the_logged_attitude_and_says_nothing_of_it() {
        let mut model = truth();
        let flight = flown(&model);
        model.terms.retain(|term| matches!(term.effect, Effect::Thrust | Effect::LinearDrag));
        let error = open_loop(&model, &[&flight])[49];
        assert!(error.position_m < 0.005, "{error:?}");
        assert!(error.attitude_rad.is_nan() && error.rate_rad_s.is_nan());
    }

    #[test]
    fn the_true_model_predicts_every_quantity_and_a_heavier_one_sinks() {
        let model = truth();
        let flight = flown(&model);
        let right = predict_ahead(&model, &flight, 50);
        assert_eq!(right.time_s.len(), right.predicted[11].len());
        for (measured, predicted) in std::iter::zip(&right.measured, &right.predicted) {
            let worst = std::iter::zip(measured, predicted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 0.1, "{worst}");
        }
        let mut weak = model.clone();
        let thrust = 0.9 * model.term(Effect::Thrust).unwrap().coefficients[0].value;
        weak.set(Effect::Thrust, &[thrust]);
        let low = predict_ahead(&weak, &flight, 50);
        let sunk: f64 = std::iter::zip(&low.predicted[2], &low.measured[2]).map(|(p, m)| p - m).sum();
        // A tenth of gravity for half a second.
        assert!((sunk / low.time_s.len() as f64 - 0.123).abs() < 0.015, "{sunk}");
    }

    #[test]
    fn without_flights_there_is_no_error_and_no_attitude_of_what_does_not_turn() {
        assert_eq!(open_loop(&truth(), &[]), vec![HorizonError::default(); LONGEST_HORIZON]);
    }

    /// The trim of a flight pushes the prediction as the craft was pushed: forwards by 0.4 m/s^2
    /// for a tenth of a second.
    #[test]
    fn a_flights_own_constants_push_its_prediction_unless_they_are_left_out() {
        let model = truth();
        let mut flight = flown(&model);
        let without = open_loop(&model, &[&flight]);
        flight.trim = Some(Trim { value: [0.4, 0.0, 0.0, 0.0, 0.0, 0.0], std_error: [0.1; 6] });
        let pushed = open_loop(&model, &[&flight])[9];
        assert!((pushed.velocity_m_s - 0.04).abs() < 0.005, "{pushed:?}");
        assert_eq!(open_loop_without_trim(&model, &[&flight], 1), without);
    }

    /// One sample of the rate about z is off by 30 rad/s: it counts at each horizon that ends there, once.
    #[test]
    fn an_outlier_counts_as_logged_and_is_gone_from_the_cleaned_samples() {
        let model = truth();
        let flown = fly(&model, 1, 6.0, &NONE);
        let mut spiky = flown.clone();
        let mut r = spiky.required(Column::R).to_vec();
        r[300] += 30.0;
        spiky.replace(Column::R, r);
        let [clean, spiky] = [flown, spiky].map(|f| Prepared::new(&f, &model.vehicle).unwrap());
        assert_eq!(spiky.outliers.len(), 1);
        assert_eq!(open_loop_of_cleaned(&model, &[&clean]), None);
        let without = open_loop(&model, &[&clean]);
        let logged = open_loop(&model, &[&spiky]);
        let cleaned = open_loop_of_cleaned(&model, &[&spiky]).unwrap();
        let starts = (spiky.rows() - LONGEST_HORIZON) as f64;
        for (h, ((logged, cleaned), without)) in logged.iter().zip(&cleaned).zip(&without).enumerate() {
            let extra = (logged.rate_rad_s - cleaned.rate_rad_s) * starts;
            assert!((extra - 30.0).abs() < 0.3, "{h}: {extra}");
            assert!((cleaned.rate_rad_s - without.rate_rad_s).abs() < 2e-3, "{h}: {cleaned:?} {without:?}");
            assert_eq!(logged.position_m, cleaned.position_m);
        }
    }

    #[test]
    fn a_roll_out_hands_over_each_sample_from_the_state_it_starts_at() {
        let model = truth();
        let flight = flown(&model);
        let stretch = &flight.stretches[0];
        let states = reference_states(&model, &flight, stretch);
        let rotor = mean_rotor_speeds(&model, &flight, stretch);
        assert_eq!(rotor.len() + 1, states.len());
        let track = Track::of(&model, &flight, stretch, &states, &rotor);
        let mut seen = Vec::new();
        track.roll_out(&Plant::new(&model), &[0.0; 6], 100, 3, |h, state| seen.push((h, *state)));
        assert_eq!(seen.iter().map(|(h, _)| *h).collect::<Vec<_>>(), [1, 2, 3]);
        for (h, state) in &seen {
            assert!((velocity_ned_m_s(state) - velocity_ned_m_s(&states[100 + h])).norm() < 2e-3);
        }
    }
}
