//! How logged rotor speeds follow the commands: the map and the lag of each motor, as they are in flight.
//!
//! ```text
//! tau dw/dt = s - w,   measured = g w + b
//! ```
//!
//! with the speed `s` that the vehicle file's map says of command and voltage. The lag is simulated, not regressed on the measured speed,
//! whose noise would make it look shorter. Forces and moments of a log with rotor speeds say nothing of this, since they follow from the
//! speeds as they were; a flight that is simulated or designed for starts from the commands.

use model::Vehicle;
use model::rotor_lag::decayed;

use crate::prepare::{Prepared, Stretch};

/// Time constants that are tried, s, and how many.
const SHORTEST_S: f64 = 0.002;
const LONGEST_S: f64 = 0.5;
const TRIED: usize = 40;
/// Halvings of the step about the best of them.
const HALVINGS: usize = 12;
/// Beginning of each stretch that is left out, s: what was commanded before it is not known.
const BEGINNING_S: f64 = 0.5;
/// Part of the variance of the speed that the lagged command must explain for the lag to be told.
const EXPLAINED: f64 = 0.8;
/// Samples at least.
const FEWEST: usize = 500;

/// How a motor answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Mean speed over what the map says of the commands.
    pub speed_ratio: f64,
    /// Time constant, s; nothing where the commands hardly moved.
    pub time_constant_s: Option<f64>,
}

/// Of the four motors; nothing without logged speeds, commands, voltage or a map.
pub fn of_flight(flight: &Prepared, vehicle: &Vehicle) -> Option<[Response; 4]> {
    let is_logged = flight.stretches.iter().all(|stretch| stretch.logged_rotor_rad_s.is_some());
    let has_inputs = flight.has_commands && (flight.has_voltage || vehicle.rotor_map().voltage == 0.0);
    let samples: usize = flight.stretches.iter().map(|stretch| stretch.time_s.len()).sum();
    if !is_logged || !has_inputs || !vehicle.has_rotor_map() || samples < FEWEST {
        return None;
    }
    let of_motor = |motor| response(&Motor::new(flight, vehicle, motor));
    let all: Option<Vec<Response>> = (0..4).map(of_motor).collect();
    all?.try_into().ok()
}

/// A motor over a flight: for each stretch what was commanded, in terms of the speed, and the speed.
struct Motor<'a> {
    stretches: Vec<(Vec<f64>, &'a [f64])>,
    period_s: f64,
}

impl<'a> Motor<'a> {
    fn new(flight: &'a Prepared, vehicle: &Vehicle, motor: usize) -> Self {
        let map = vehicle.rotor_map();
        let of_stretch = |stretch: &'a Stretch| {
            let inputs = stretch.command[motor].iter().zip(&stretch.battery_v);
            let steady = inputs.map(|(command, voltage_v)| map.speed_rad_s(*command, *voltage_v)).collect();
            let measured = stretch.logged_rotor_rad_s.as_ref().map_or(&[][..], |all| &all[motor]);
            (steady, measured)
        };
        Self { stretches: flight.stretches.iter().map(of_stretch).collect(), period_s: flight.period_s }
    }

    /// The speed measured against the speed that follows the commands with a time constant.
    fn sums(&self, time_constant_s: f64) -> Sums {
        let decay = (-self.period_s / time_constant_s).exp();
        let beginning = (BEGINNING_S / self.period_s) as usize;
        let mut sums = Sums::default();
        for (steady, measured) in &self.stretches {
            let mut speed = steady.first().copied().unwrap_or(0.0);
            for (k, (steady, measured)) in steady.iter().zip(*measured).enumerate() {
                if k >= beginning && measured.is_finite() {
                    sums.add(speed, *measured);
                }
                speed = decayed(speed, *steady, decay);
            }
        }
        sums
    }
}

fn response(motor: &Motor<'_>) -> Option<Response> {
    let ratio = (LONGEST_S / SHORTEST_S).powf(1.0 / (TRIED - 1) as f64);
    let tried = (0..TRIED).map(|k| SHORTEST_S * ratio.powi(k as i32));
    let left = |time_constant_s: f64| motor.sums(time_constant_s).left();
    let (mut best_s, mut least) = tried
        .map(|time_constant_s| (time_constant_s, left(time_constant_s)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut step = ratio.sqrt();
    for _ in 0..HALVINGS {
        for near_s in [best_s / step, best_s * step] {
            let left = left(near_s);
            if left < least {
                (best_s, least) = (near_s, left);
            }
        }
        step = step.sqrt();
    }
    let sums = motor.sums(best_s);
    let speed_ratio = sums.mean_ratio()?;
    let is_told = least < (1.0 - EXPLAINED) * sums.variance() && (SHORTEST_S..LONGEST_S).contains(&best_s);
    Some(Response { speed_ratio, time_constant_s: is_told.then_some(best_s) })
}

/// Sums of a straight line through pairs.
#[derive(Default)]
struct Sums {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Sums {
    fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
    }

    /// Variance of y.
    fn variance(&self) -> f64 {
        (self.yy - self.y * self.y / self.count) / self.count
    }

    /// Variance of y about the line.
    fn left(&self) -> f64 {
        let xx = self.xx - self.x * self.x / self.count;
        let xy = self.xy - self.x * self.y / self.count;
        let along = if xx > 0.0 { xy * xy / xx } else { 0.0 };
        self.variance() - along / self.count
    }

    fn mean_ratio(&self) -> Option<f64> {
        (self.x > 0.0).then(|| self.y / self.x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A first-order lag under held commands has an exact solution: 40 ms, 3 % more speed than the map says.
    #[test]
    fn a_known_motor_answers_as_it_was_made() {
        let period_s = 0.01;
        let commanded = |k: usize| 600.0 + 80.0 * (0.37 * k as f64).sin() + 50.0 * (0.083 * k as f64).cos();
        let steady: Vec<f64> = (0..3000).map(commanded).collect();
        let decay = (-period_s / 0.04_f64).exp();
        let mut speed = 600.0;
        let measured: Vec<f64> = steady
            .iter()
            .map(|steady| {
                let now = 1.03 * speed;
                speed = decayed(speed, *steady, decay);
                now
            })
            .collect();
        let motor = Motor { stretches: vec![(steady, &measured)], period_s };
        let found = response(&motor).unwrap();
        assert!((found.speed_ratio - 1.03).abs() < 1e-3, "{found:?}");
        assert!((found.time_constant_s.unwrap() - 0.04).abs() < 1e-5, "{found:?}");
    }

    #[test]
    fn a_motor_that_turns_steadily_does_not_tell_its_lag() {
        let (steady, measured) = (vec![600.0; 3000], vec![594.0; 3000]);
        let found = response(&Motor { stretches: vec![(steady, &measured)], period_s: 0.01 }).unwrap();
        assert_eq!((found.speed_ratio, found.time_constant_s), (0.99, None));
    }
}
