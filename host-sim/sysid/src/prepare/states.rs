//! The states of a craft over a prepared flight, at its samples and between them, and which samples give rows.

use std::iter::StepBy;
use std::ops::Range;

use model::{Adjustments, LagId, Lags, Memory, Pendulum, Plant, SampleInput, Untilt, Vehicle};
use nalgebra::{Matrix3, Vector3};

use crate::prepare::prepared::Prepared;
use crate::prepare::stretch::{RotorTrack, Stretch, vector};

/// Longest time between the rows of a fit, s.
const FIT_ROW_PERIOD_S: f64 = 0.03;

/// Samples of a stretch that are filtered together, and how a load swings at each of them: hanging still, where there is nothing.
pub struct Part {
    /// Samples of the stretch.
    pub samples: Range<usize>,
    /// How the load hangs at each of them.
    pub swings: Vec<Pendulum>,
}

impl Part {
    /// A whole stretch without a load.
    pub fn whole(stretch: &Stretch) -> Self {
        Self { samples: 0..stretch.time_s.len(), swings: Vec::new() }
    }
}

/// The states of a stretch.
pub struct States<'a> {
    stretch: &'a Stretch,
    /// From the tracked attitude to the body's, where they differ.
    untilt: Untilt,
    lever_m: Vector3<f64>,
    wind_ned_m_s: Vector3<f64>,
    rotor: [RotorTrack; 4],
    period_s: f64,
    /// What formulas look back at, at each sample; empty where none does.
    memory: Vec<Memory>,
}

impl States<'_> {
    /// How many samples there are.
    #[allow(clippy::len_without_is_empty, reason = "a flight has samples")]
    pub fn len(&self) -> usize {
        self.stretch.time_s.len()
    }

    /// Inertial to body at a sample.
    #[inline]
    pub fn dcm(&self, k: usize) -> Matrix3<f64> {
        let tracked = &self.stretch.dcm[k];
        self.untilt.body(tracked)
    }

    /// How the craft moves at a sample.
    #[inline(always)]
    fn motion(&self, k: usize) -> Motion {
        let stretch = self.stretch;
        let dcm = self.dcm(k);
        let rate_rad_s = vector(&stretch.rate_rad_s, k);
        // What the air does to the craft is all that looks at it.
        let mut velocity_m_s = dcm * (vector(&stretch.velocity_ned_m_s, k) - self.wind_ned_m_s);
        let mut position_ned_m = vector(&stretch.position_ned_m, k);
        if self.lever_m != Vector3::zeros() {
            velocity_m_s -= rate_rad_s.cross(&self.lever_m);
            position_ned_m -= dcm.tr_mul(&self.lever_m);
        }
        let rotor_rad_s = self.rotor.each_ref().map(|r| r.speed_rad_s[k]);
        Motion { position_ned_m, dcm, velocity_m_s, rate_rad_s, rotor_rad_s }
    }

    /// At a sample, but for the accelerations.
    #[inline]
    fn without_acceleration(&self, k: usize) -> SampleInput {
        let Motion { position_ned_m, dcm, velocity_m_s, rate_rad_s, rotor_rad_s } = self.motion(k);
        SampleInput {
            position_ned_m,
            dcm,
            velocity_m_s,
            rate_rad_s,
            angular_acceleration_rad_s2: Vector3::zeros(),
            rotor_rad_s,
            rotor_acceleration_rad_s2: [0.0; 4],
            battery_v: self.stretch.battery_v[k],
            pendulum: Pendulum::default(),
            memory: self.memory(k),
            further: self.stretch.further_at(k),
        }
    }

    /// What formulas look back at.
    #[inline]
    pub(crate) fn memory(&self, k: usize) -> Option<Memory> {
        self.memory.get(k).copied()
    }

    /// With what is remembered under a plant, from what it is at the first sample on.
    fn remembering(mut self, plant: &Plant, lags: &Lags, first: Memory) -> Self {
        let mut before = self.at(0);
        let mut memory = vec![first];
        for k in 1..self.len() {
            let after = self.at(k);
            let ends = [&plant.sample_of(&before), &plant.sample_of(&after)];
            memory.push(lags.after(&memory[k - 1], ends, self.period_s));
            before = after;
        }
        self.memory = memory;
        self
    }

    /// At a sample.
    pub fn at(&self, k: usize) -> SampleInput {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(self.len() - 1));
        let rate = &self.stretch.rate_rad_s;
        let turned = vector(rate, after) - vector(rate, before);
        SampleInput {
            angular_acceleration_rad_s2: turned / ((after - before).max(1) as f64 * self.period_s),
            ..self.without_acceleration(k)
        }
    }

    /// What a wind that wanders adds at a sample, body axes, m/s. The states are those without it.
    pub fn gust_at(&self, k: usize) -> Option<Vector3<f64>> {
        let [north, east] = self.stretch.gust_ned_m_s.as_ref()?;
        Some(self.dcm(k) * Vector3::new(north[k], east[k], 0.0))
    }

    /// The mean of it between a sample and the next.
    pub fn gust_after(&self, k: usize) -> Option<Vector3<f64>> {
        Some(0.5 * (self.gust_at(k)? + self.gust_at(k + 1)?))
    }

    /// Hands over the mean states between neighbouring samples of a part, one fewer.
    pub fn for_each_between(&self, part: &Part, mut take: impl FnMut(&SampleInput)) {
        let per_period = 1.0 / self.period_s;
        let first = part.samples.start;
        let battery_v = &self.stretch.battery_v;
        let mut a = self.motion(first);
        for k in first + 1..part.samples.end {
            let b = self.motion(k);
            take(&SampleInput {
                position_ned_m: 0.5 * (a.position_ned_m + b.position_ned_m),
                // The mean of two attitudes a hundredth of a radian apart is a rotation to a part in 10^5.
                dcm: 0.5 * (a.dcm + b.dcm),
                velocity_m_s: 0.5 * (a.velocity_m_s + b.velocity_m_s),
                rate_rad_s: 0.5 * (a.rate_rad_s + b.rate_rad_s),
                angular_acceleration_rad_s2: per_period * (b.rate_rad_s - a.rate_rad_s),
                rotor_rad_s: self.rotor.each_ref().map(|r| r.mean_rad_s[k - 1]),
                rotor_acceleration_rad_s2: std::array::from_fn(|i| {
                    per_period * (b.rotor_rad_s[i] - a.rotor_rad_s[i])
                }),
                battery_v: 0.5 * (battery_v[k - 1] + battery_v[k]),
                pendulum: match part.swings.get(k - 1 - first..=k - first) {
                    Some([before, after]) => before.middle(after),
                    _ => Pendulum::default(),
                },
                memory: self.memory_after(k - 1),
                further: self.stretch.further_after(k - 1),
            });
            a = b;
        }
    }

    /// What formulas look back at halfway between a sample and the next.
    #[inline]
    fn memory_after(&self, k: usize) -> Option<Memory> {
        Some(self.memory.get(k)?.middle(self.memory.get(k + 1)?))
    }
}

/// How a craft moves at a sample.
#[derive(Clone, Copy)]
struct Motion {
    position_ned_m: Vector3<f64>,
    dcm: Matrix3<f64>,
    velocity_m_s: Vector3<f64>,
    rate_rad_s: Vector3<f64>,
    rotor_rad_s: [f64; 4],
}

impl Prepared {
    /// Samples from one row of a fit to the next.
    pub fn fit_stride(&self) -> usize {
        // A quotient that is whole but for rounding is whole.
        (FIT_ROW_PERIOD_S / self.period_s + 1e-6).max(1.0) as usize
    }

    /// The samples of a stretch at which there are rows.
    pub(crate) fn row_samples(&self, stretch: &Stretch, stride: usize) -> StepBy<Range<usize>> {
        (self.margin..stretch.time_s.len() - self.margin).step_by(stride)
    }

    /// Times of the rows of a fit, in the flight's own time, s.
    pub fn fit_row_times_s(&self) -> Vec<f64> {
        self.row_times_s(self.fit_stride())
    }

    /// Times of the rows at every `stride`th sample, in the flight's own time, s.
    pub fn row_times_s(&self, stride: usize) -> Vec<f64> {
        let of_stretch = |stretch: &Stretch| {
            self.row_samples(stretch, stride).map(|k| stretch.time_s[k]).collect::<Vec<f64>>()
        };
        self.stretches.iter().flat_map(of_stretch).collect()
    }

    /// Of the rows at every sample, those at which a fit has rows.
    pub fn row_samples_of_conditions(&self) -> Vec<usize> {
        let stride = self.fit_stride();
        let mut first = 0;
        let mut all = Vec::new();
        for stretch in &self.stretches {
            let rows = stretch.time_s.len() - 2 * self.margin;
            all.extend((first..first + rows).step_by(stride));
            first += rows;
        }
        all
    }

    /// Rows at which stretches begin: neighbours across these are not neighbours in time.
    pub fn starts_of_rows(&self, stride: usize) -> Vec<usize> {
        let mut next = 0;
        let start = |stretch| {
            let start = next;
            next += self.row_samples(stretch, stride).len();
            start
        };
        self.stretches.iter().map(start).collect()
    }

    /// The states of a stretch under `adjust`; a load hangs still.
    pub fn states<'a>(&self, stretch: &'a Stretch, vehicle: &Vehicle, adjust: &Adjustments) -> States<'a> {
        States {
            stretch,
            untilt: adjust.untilt(),
            lever_m: Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m(),
            wind_ned_m_s: self.wind_ned_m_s,
            rotor: stretch.rotors(vehicle, adjust, self.period_s, self.rotor_late_s()),
            period_s: self.period_s,
            memory: Vec::new(),
        }
    }

    /// The states of a stretch with what a plant and further lags remember: as if the stretch had begun as it was in its first sample,
    /// but for integrals, which the rest of the flight is known for.
    pub fn remembering_states<'a>(
        &'a self,
        stretch: &'a Stretch,
        vehicle: &Vehicle,
        plant: &Plant,
        further: impl IntoIterator<Item = LagId>,
    ) -> States<'a> {
        let lags = &Lags::new(plant.lags().ids().chain(further));
        let states = self.states(stretch, vehicle, plant.adjustments());
        if lags.is_empty() || states.len() == 0 {
            return states;
        }
        let start_s = stretch.time_s[0];
        let earlier = if lags.any_integral() { &self.stretches[..] } else { &[] };
        let earlier = earlier.iter().filter(|earlier| earlier.time_s[0] < start_s);
        let last = earlier.fold(None, |last, stretch| {
            let states = self.states(stretch, vehicle, plant.adjustments());
            let first = first_memory(plant, lags, last.as_ref(), &states);
            Some(states.remembering(plant, lags, first))
        });
        let first = first_memory(plant, lags, last.as_ref(), &states);
        states.remembering(plant, lags, first)
    }
}

/// What is remembered at the first sample of a stretch, after the stretch before it. A craft that has not flown yet uses little.
fn first_memory(plant: &Plant, lags: &Lags, before: Option<&States<'_>>, own: &States<'_>) -> Memory {
    let input = own.at(0);
    let first = plant.sample_of(&input);
    let last = before.and_then(|states| Some((states, states.len() - 1, states.memory(states.len() - 1)?)));
    last.map_or_else(
        || lags.settled(&first),
        |(states, k, memory)| {
            let gap_s = own.stretch.time_s[0] - states.stretch.time_s[k];
            lags.resumed(&memory, [&plant.sample_of(&states.at(k)), &first], gap_s)
        },
    )
}

#[cfg(test)]
mod tests {
    use model::{Effect, Followed, Lag, Model, Quantity};

    use super::*;
    use crate::testing::prepared;

    #[test]
    fn rows_of_a_fit_are_three_hundredths_of_a_second_apart_at_most() {
        let mut flight = prepared(300, |_, _| {});
        for (period_s, stride) in [(0.01, 3), (0.005, 6), (0.03, 1), (0.0299, 1), (0.02, 1), (0.1, 1)] {
            flight.period_s = period_s;
            assert_eq!(flight.fit_stride(), stride, "{period_s} s");
        }
    }

    /// Two stretches of 200 and 161 samples lose 60 each; every third of 140 and 101 rows is 47 and
    /// 34.
    #[test]
    fn strided_rows_start_anew_in_every_stretch() {
        let mut flight = prepared(400, |_, _| {});
        assert_eq!(flight.margin, 30);
        let whole = flight.stretches[0].clone();
        flight.stretches = vec![whole.part(0..200), whole.part(210..371)];
        assert_eq!(flight.rows(), 241);
        assert_eq!(flight.row_starts(), [0, 140]);
        assert_eq!(flight.starts_of_rows(3), [0, 47]);
        let times = flight.fit_row_times_s();
        assert_eq!(times.len(), 47 + 34);
        assert_eq!([times[0], times[1], times[47]].map(|t| (100.0 * t).round()), [30.0, 33.0, 240.0]);
        let rows = flight.row_samples_of_conditions();
        assert_eq!(rows.len(), 47 + 34);
        assert_eq!((rows[1], rows[46], rows[47], rows[48]), (3, 138, 140, 143));
    }

    /// A craft that yaws on the spot about its centre; the tracked point circles at the end of a
    /// lever.
    #[test]
    fn the_centre_rests_while_the_tracked_point_circles() {
        let rate_rad_s = 0.8;
        let lever = [0.1, 0.0, -0.05];
        let flight = prepared(400, |t, row| {
            let (sin, cos) = (rate_rad_s * t).sin_cos();
            row.position_ned_m = [2.0 + lever[0] * cos, lever[0] * sin, -1.0 + lever[2]];
            row.euler_rad = [0.0, 0.0, rate_rad_s * t];
            row.rate_rad_s = [0.0, 0.0, rate_rad_s];
        });
        // Half of the lever is in the vehicle file, half in the model.
        let mut vehicle = Vehicle::thesis();
        vehicle.tracked_point = lever.map(|l| 0.5 * l);
        let mut model = Model::new(vehicle);
        let mut values = vec![0.0; Effect::TrackingOffset.info().coefficients.len()];
        values.iter_mut().zip(lever).for_each(|(value, l)| *value = 0.5 * l);
        model.set(Effect::TrackingOffset, &values);
        let states = flight.states(&flight.stretches[0], &model.vehicle, &model.adjustments());
        for k in 30..370 {
            let at = states.at(k);
            assert!((at.position_ned_m - Vector3::new(2.0, 0.0, -1.0)).norm() < 1e-9, "{k}");
            assert!(at.velocity_m_s.norm() < 1e-6, "{k}: {:?}", at.velocity_m_s);
        }
    }

    /// Of the time itself, which a column holds: half its square, also across a gap.
    #[test]
    fn an_integral_goes_on_across_a_gap_and_a_lag_begins_anew() {
        let mut flight = prepared(400, |_, _| {});
        let whole = flight.stretches[0].clone();
        flight.stretches = vec![whole.part(20..200), whole.part(210..371)];
        let lag = |quantity, time_s| {
            let of = Followed::Quantity(Quantity::named(quantity).unwrap());
            Lag { of, time_s }.id().unwrap()
        };
        for stretch in &mut flight.stretches {
            stretch.battery_v = stretch.time_s.iter().map(|time_s| 1.0 + time_s).collect();
        }
        let (energy, late) = (lag("vbat", None), lag("vbat", Some(5.0)));
        let (model, lags) = (Model::thesis(), Lags::new([energy, late]));
        let plant = Plant::new(&model);
        for stretch in &flight.stretches {
            let states = flight.remembering_states(stretch, &model.vehicle, &plant, lags.ids());
            assert_eq!(states.memory(0).unwrap().of(late), stretch.battery_v[0]);
            let end = states.len() - 1;
            let [from_s, to_s] = [flight.stretches[0].time_s[0], stretch.time_s[end]];
            let expected = (to_s - from_s) + 0.5 * (to_s * to_s - from_s * from_s);
            let found = states.memory(end).unwrap().of(energy);
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn a_rate_that_grows_evenly_is_one_angular_acceleration_up_to_the_ends() {
        let flight = prepared(300, |_, _| {});
        let mut stretch = flight.stretches[0].clone();
        stretch.rate_rad_s[1] = stretch.time_s.iter().map(|t| 3.0 * t).collect();
        let states = flight.states(&stretch, &Vehicle::thesis(), &Adjustments::default());
        assert_eq!(states.len(), 300);
        for k in [0, 1, 150, 299] {
            let acceleration = states.at(k).angular_acceleration_rad_s2;
            assert!((acceleration - Vector3::new(0.0, 3.0, 0.0)).norm() < 1e-9, "{k}: {acceleration:?}");
        }
    }

    #[test]
    fn between_samples_there_is_one_state_fewer_halfway_between_its_neighbours() {
        let flight = prepared(300, |_, _| {});
        let mut stretch = flight.stretches[0].clone();
        stretch.rate_rad_s[2] = stretch.time_s.iter().map(|t| t * t).collect();
        stretch.battery_v = stretch.time_s.iter().map(|t| 12.0 - t).collect();
        stretch.logged_rotor_rad_s = Some(std::array::from_fn(|i| {
            stretch.time_s.iter().map(|t| 500.0 + (i + 1) as f64 * t).collect()
        }));
        let states = flight.states(&stretch, &Vehicle::thesis(), &Adjustments::default());
        let still = Pendulum::default();
        let swung = Pendulum { turning_rad_s: Vector3::new(1.0, 0.0, 0.0), ..still };
        let part = Part { samples: 100..104, swings: vec![still, swung, swung, still] };
        let mut between = Vec::new();
        states.for_each_between(&part, |state| between.push(*state));
        assert_eq!(between.len(), 3);
        for (i, state) in between.iter().enumerate() {
            let (a, b) = (1.0 + 0.01 * i as f64, 1.01 + 0.01 * i as f64);
            assert!((state.rate_rad_s.z - 0.5 * (a * a + b * b)).abs() < 1e-12);
            assert!((state.angular_acceleration_rad_s2.z - (a + b)).abs() < 1e-9);
            assert!((state.battery_v - (12.0 - 0.5 * (a + b))).abs() < 1e-12);
            assert!((state.rotor_rad_s[3] - (500.0 + 2.0 * (a + b))).abs() < 1e-9);
            assert!((state.rotor_acceleration_rad_s2[3] - 4.0).abs() < 1e-6);
        }
        let turning: Vec<f64> = between.iter().map(|s| s.pendulum.turning_rad_s.x).collect();
        assert_eq!(turning, [0.5, 1.0, 0.5]);
    }
}
