//! The steady balance of the rotors: in slow flight their moments add to zero and their thrust to the weight.
//!
//! A mean over a window of seconds needs no clock, no derivative and no moment of inertia, and the motor map's scale cancels in
//! the rotors' shares of the thrust. What is left is how unequally the rotors work:
//! - lift: what the model leaves of the specific force along z, in units of gravity;
//! - roll, pitch: thrust of the left (front) rotors less that of the right (rear) ones, part of the whole;
//! - yaw: squared speed of the rotors that yaw the craft right less that of the others, part of the whole.
//!
//! A craft is never quite the same in two flights: battery, tracker and weather leave each a constant of its own, a random
//! effect. What a change must stand out from is the scatter of these.

use model::{Axis, BalanceRecord, BalanceRow, Effect, Model, Plant, SampleInput};
use nalgebra::Vector3;

use crate::fit::random_effects::{self, Group};
use crate::fit::residuals::Residuals;
use crate::prepare::{Prepared, Stretch};

/// Length of a window, s: long against the loops of a craft, which settle within half a second, and short against a flight.
const WINDOW_S: f64 = 1.0;
/// Conditions whose standard deviation is below this are constants; V, m/s.
const VARIES: f64 = 1e-3;

/// Means over a window of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Middle of the window, in the flight's own time, s.
    pub time_s: f64,
    /// Lift, roll, pitch, yaw.
    pub balance: [f64; 4],
    /// What each of them may depend on: battery voltage in V, velocity to the right and forwards in m/s, nothing.
    pub condition: [f64; 4],
    /// Squared speeds of the rotors, (rad/s)^2 or commands^2.
    pub rotor_squared: [f64; 4],
}

/// How the rotors of a model share the work.
pub struct Rotors {
    plant: Plant,
}

impl Rotors {
    /// Those of `model`: its thrust, with levers as the vehicle file says.
    ///
    /// Only ratios count, so one coefficient stands for all thrusts and one for all reaction torques; those that were fitted
    /// would bring in their errors, and a rotation that was refused has none.
    pub fn new(model: &Model) -> Self {
        let mut even = Model::new(model.vehicle.clone());
        for term in model.terms.iter().filter(|term| term.effect.info().acts_on_balance()) {
            even.set(term.effect, &term.values());
        }
        even.set(Effect::Thrust, &[1.0]);
        let spin = model.vehicle.motors.spin.map(|spin| spin.yaw_sign());
        let moments: Vec<f64> = [1.0; 8].into_iter().chain(spin).collect();
        even.set(Effect::RotorMoments, &moments);
        Self { plant: Plant::new(&even) }
    }

    /// Sum of the thrusts, and the parts of it that roll, pitch and yaw the craft.
    pub fn shares(&self, rotor_squared: &[f64; 4]) -> (f64, [f64; 3]) {
        let at = |squared: [f64; 4]| {
            let input = hovering(squared.map(|square| square.max(0.0).sqrt()));
            self.plant.accelerations(&self.plant.sample_of(&input))
        };
        let [_, _, w, p, q, r] = at(*rotor_squared);
        // One rotor by itself rolls, pitches and yaws by its whole thrust.
        let [_, _, w1, p1, q1, r1] = at([1.0, 0.0, 0.0, 0.0]);
        let share = |moment: f64, of_one: f64| (moment / -w) / (of_one / w1).abs();
        (-w, [share(p, p1), share(q, q1), share(r, r1)])
    }
}

/// A craft that stands still in the air with rotors that turn so.
fn hovering(rotor_rad_s: [f64; 4]) -> SampleInput {
    SampleInput {
        position_ned_m: Vector3::new(0.0, 0.0, -10.0),
        dcm: nalgebra::Matrix3::identity(),
        velocity_m_s: Vector3::zeros(),
        rate_rad_s: Vector3::zeros(),
        angular_acceleration_rad_s2: Vector3::zeros(),
        rotor_rad_s,
        rotor_acceleration_rad_s2: [0.0; 4],
        battery_v: 0.0,
        pendulum: model::Pendulum::default(),
        memory: None,
        // Nothing hangs from it, and no one flies beside it.
        further: [0.0; model::MAX_FURTHER],
    }
}

/// The windows of a flight of which a model leaves so much, in order; a remainder of less than one is left out.
pub fn windows(flight: &Prepared, model: &Model, left: &Residuals) -> Vec<Window> {
    let mut lift = left.residual[Axis::W.index()].iter().map(|w| w / model.vehicle.gravity);
    let rotors = Rotors::new(model);
    let length = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
    let mut all = Vec::new();
    for stretch in &flight.stretches {
        let rows: Vec<usize> = (flight.margin..stretch.time_s.len() - flight.margin).collect();
        let of_stretch: Vec<f64> = lift.by_ref().take(rows.len()).collect();
        let seen = Seen::new(flight, stretch, model);
        for (samples, lift) in rows.chunks_exact(length).zip(of_stretch.chunks_exact(length)) {
            all.push(seen.window(samples, lift, &rotors));
        }
    }
    all
}

/// A stretch with its rotors.
struct Seen<'a> {
    stretch: &'a Stretch,
    states: crate::prepare::States<'a>,
}

impl<'a> Seen<'a> {
    fn new(flight: &Prepared, stretch: &'a Stretch, model: &Model) -> Self {
        Self { stretch, states: flight.states(stretch, &model.vehicle, &model.adjustments()) }
    }

    fn window(&self, samples: &[usize], lift: &[f64], rotors: &Rotors) -> Window {
        let count = samples.len() as f64;
        let mut mean = Window {
            time_s: 0.5 * (self.stretch.time_s[samples[0]] + self.stretch.time_s[samples[samples.len() - 1]]),
            balance: [0.0; 4],
            condition: [0.0; 4],
            rotor_squared: [0.0; 4],
        };
        for &k in samples {
            let at = self.states.at(k);
            mean.condition[0] += at.battery_v / count;
            mean.condition[1] += at.velocity_m_s.y / count;
            mean.condition[2] += at.velocity_m_s.x / count;
            mean.rotor_squared.iter_mut().zip(at.rotor_rad_s).for_each(|(sum, w)| *sum += w * w / count);
        }
        let (_, [roll, pitch, yaw]) = rotors.shares(&mean.rotor_squared);
        mean.balance = [crate::statistics::mean(lift), roll, pitch, yaw];
        mean
    }
}

/// Mean squared speeds of the rotors of a flight, (rad/s)^2 or commands^2.
pub(crate) fn mean_rotor_squared(flight: &Prepared, model: &Model) -> [f64; 4] {
    let (mut sum, mut count) = ([0.0; 4], 0.0);
    for stretch in &flight.stretches {
        let seen = Seen::new(flight, stretch, model);
        for k in flight.margin..stretch.time_s.len() - flight.margin {
            sum.iter_mut().zip(seen.states.at(k).rotor_rad_s).for_each(|(sum, w)| *sum += w * w);
            count += 1.0;
        }
    }
    sum.map(|sum| sum / f64::max(count, 1.0))
}

/// The balance of a craft over the flights a model was made from, with what it leaves of them; nothing where they are too few.
pub fn record<'a>(
    model: &Model,
    flights: impl IntoIterator<Item = (&'a Prepared, &'a Residuals)>,
) -> Option<BalanceRecord> {
    let mut all: Vec<Vec<Window>> =
        flights.into_iter().map(|(flight, left)| windows(flight, model, left)).collect();
    all.retain(|windows| !windows.is_empty());
    let volts: Vec<f64> = all.iter().flatten().map(|window| window.condition[0]).collect();
    let battery_v = crate::statistics::mean(&volts);
    all.iter_mut().flatten().for_each(|window| window.condition[0] -= battery_v);
    let row = |k: usize| row(&all, k);
    let flights = all.len() as u64;
    Some(BalanceRecord { flights, battery_v, lift: row(0)?, roll: row(1)?, pitch: row(2)?, yaw: row(3)? })
}

fn row(flights: &[Vec<Window>], row: usize) -> Option<BalanceRow> {
    let conditions: Vec<f64> = flights.iter().flatten().map(|window| window.condition[row]).collect();
    let varies = crate::statistics::deviation(&conditions) > VARIES;
    let observation = |window: &Window| {
        let x = if varies { vec![1.0, window.condition[row]] } else { vec![1.0] };
        (window.balance[row], x)
    };
    let groups: Vec<Group> =
        flights.iter().map(|windows| windows.iter().map(observation).collect()).collect();
    let found = random_effects::estimate(&groups)?;
    let covariance = &found.covariance;
    let (slope, of_slope) = match varies {
        true => (found.value[1], [covariance[(0, 1)], covariance[(1, 1)]]),
        false => (0.0, [0.0; 2]),
    };
    Some(BalanceRow {
        mean: found.value[0],
        slope,
        covariance: [covariance[(0, 0)], of_slope[0], of_slope[1]],
        between: found.between,
        within: found.within,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::linearise::residuals;
    use crate::testing::{prepared, truth};

    fn windows(flight: &Prepared, model: &Model) -> Vec<Window> {
        super::windows(flight, model, &residuals(flight, model))
    }

    fn record(model: &Model, flights: &[&Prepared]) -> Option<BalanceRecord> {
        let left: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, model)).collect();
        super::record(model, flights.iter().copied().zip(&left))
    }

    #[test]
    fn a_rotor_by_itself_rolls_pitches_and_yaws_by_its_whole_thrust() {
        let rotors = Rotors::new(&truth());
        let spin = truth().vehicle.motors.spin.map(|spin| spin.yaw_sign());
        let expected = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        for motor in 0..4 {
            let mut squared = [0.0; 4];
            squared[motor] = 4e5;
            let (lift, [roll, pitch, yaw]) = rotors.shares(&squared);
            assert!(lift > 0.0);
            for (share, sign) in
                [roll, pitch, yaw].iter().zip([expected[motor][0], expected[motor][1], spin[motor]])
            {
                assert!((share - sign).abs() < 1e-9, "motor {}: {share}", motor + 1);
            }
        }
    }

    #[test]
    fn equal_rotors_are_balanced_and_a_tenth_more_on_the_left_is_a_share_of_the_whole() {
        let rotors = Rotors::new(&truth());
        let (_, even) = rotors.shares(&[1e5; 4]);
        assert!(even.iter().all(|share| share.abs() < 1e-12));
        let (_, [roll, pitch, _]) = rotors.shares(&[1.1e5, 1e5, 1e5, 1.1e5]);
        assert!((roll - 0.2 / 4.2).abs() < 1e-9 && pitch.abs() < 1e-12);
    }

    #[test]
    fn a_flight_has_a_window_for_each_whole_second_of_rows() {
        let flight = prepared(400, |t, row| {
            row.battery_v = 12.0 - 0.1 * t;
            row.position_ned_m[1] = 0.5 * t;
        });
        let all = windows(&flight, &truth());
        assert_eq!(all.len(), (400 - 2 * flight.margin) / 100);
        for window in &all {
            assert!((window.condition[0] - (12.0 - 0.1 * window.time_s)).abs() < 0.02, "{window:?}");
            assert!((window.condition[1] - 0.5).abs() < 1e-3 && window.condition[2].abs() < 1e-3);
            assert!(window.balance[1..].iter().all(|share| share.abs() < 1e-6), "{window:?}");
        }
    }

    /// Two flights whose left rotors work 1 and 3 % harder: the mean lies between them, and the scatter is their distance's.
    #[test]
    fn flights_scatter_by_what_they_differ_by() {
        let flight = |more: f64| {
            prepared(500, move |t, row| {
                row.command = [1600.0 + more, 1600.0, 1600.0, 1600.0 + more];
                row.battery_v = 12.0 - 0.01 * t;
            })
        };
        let [a, b] = [flight(8.0), flight(24.0)];
        let share = |flight: &Prepared| windows(flight, &truth())[0].balance[1];
        let (first, second) = (share(&a), share(&b));
        let record = record(&truth(), &[&a, &b]).unwrap();
        assert_eq!(record.flights, 2);
        assert!((record.roll.mean - 0.5 * (first + second)).abs() < 1e-4, "{record:?}");
        // Two flights know little of a scatter: the penalty takes the larger end of what they allow.
        let ratio = record.roll.between / ((second - first).abs() / 2_f64.sqrt());
        assert!((1.0..1.5).contains(&ratio), "{ratio} {record:?}");
        assert!(record.pitch.between < 1e-6 && record.pitch.slope == 0.0, "{record:?}");
    }

    #[test]
    fn one_flight_scatters_from_nothing() {
        let flight = prepared(500, |_, _| {});
        assert_eq!(record(&truth(), &[&flight]), None);
        assert_eq!(record(&truth(), &[]), None);
    }
}
