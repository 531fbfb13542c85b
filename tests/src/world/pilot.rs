//! The pilot: five patterns, and a cascade from position over attitude and rates to motor commands.
//!
//! It sees the true state one tick late, knows the craft as it was designed (nothing of what was
//! planted), and shakes every motor a little, each with tones of its own. It is not the project's
//! flight controller.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{Rng, RngExt};

use super::body::Body;
use super::craft::{Cell, Craft, Size};
use super::floor::{Ends, Place, smooth};

/// Period of the commands, s.
pub(super) const PILOT_PERIOD_S: f64 = 0.01;

/// Each motor's shaking, part of hover speed.
const SHAKE: f64 = 0.008;

/// A way to fly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum Pattern {
    /// Figures of eight with low passes.
    A,
    /// Steps to the sides, higher up.
    B,
    /// Circles with wide turns in yaw.
    C,
    /// Climbs and diagonal steps.
    D,
    /// Quick passes along a line, turning.
    E,
    /// Nowhere: hovering on the spot with motors that are not shaken, of which little can be
    /// learned.
    Hover,
}

impl Pattern {
    /// Those that models are fitted on.
    pub const TRAIN: [Self; 3] = [Self::A, Self::B, Self::C];
    /// Those that models are judged on.
    pub const VALIDATE: [Self; 2] = [Self::D, Self::E];

    /// One letter.
    pub const fn name(self) -> &'static str {
        match self {
            Self::A => "A",
            Self::B => "B",
            Self::C => "C",
            Self::D => "D",
            Self::E => "E",
            Self::Hover => "hover",
        }
    }
}

impl std::fmt::Display for Pattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// How a pilot flies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// Small figures, slowly.
    Gentle,
    /// As usual.
    #[default]
    Usual,
    /// Wide figures, fast.
    Brisk,
}

impl Style {
    /// All.
    pub const ALL: [Self; 3] = [Self::Gentle, Self::Usual, Self::Brisk];

    /// Factors on the reach and on the periods of the figures.
    const fn factors(self) -> (f64, f64) {
        match self {
            Self::Gentle => (0.75, 1.25),
            Self::Usual => (1.0, 1.0),
            Self::Brisk => (1.2, 0.88),
        }
    }
}

/// A pattern with its sizes drawn.
#[derive(Debug, Clone)]
struct Path {
    pattern: Pattern,
    /// Lowest height, m.
    low_m: f64,
    /// Reach to each side, m.
    reach_m: f64,
    /// One for each period, about 1.
    pace: [f64; 4],
    phase: [f64; 4],
    /// Corners of the step patterns.
    corners: Vec<[f64; 3]>,
    /// How it is reached from the floor and left again; none for one that starts in the air.
    ends: Option<Ends>,
}

impl Path {
    fn at(&self, time_s: f64) -> Place {
        match &self.ends {
            Some(ends) => ends.place(time_s, |time_s| self.figure(time_s)),
            None => self.figure(time_s),
        }
    }

    fn figure(&self, time_s: f64) -> Place {
        let start = smooth(time_s / 2.5);
        let wave = |k: usize, period_s: f64| (TAU * time_s / (period_s * self.pace[k]) + self.phase[k]).sin();
        let dip = |k: usize, period_s: f64| 0.5 - 0.5 * wave(k, period_s);
        let (x, y, height, yaw) = match self.pattern {
            Pattern::A => {
                let turn = TAU * time_s / (7.0 * self.pace[0]) + self.phase[0];
                let (x, y) = (turn.sin(), (2.0 * turn).sin());
                (x, 0.55 * y, self.low_m + 0.8 * dip(1, 8.0), 0.65 * wave(2, 11.0))
            }
            Pattern::B => {
                let [x, y, z] = self.corner(time_s, 2.4);
                (x, y, 0.55 + 0.6 * (1.0 + z), 0.85 * wave(1, 9.0))
            }
            Pattern::C => {
                let turn = TAU * time_s / (6.0 * self.pace[0]) + self.phase[0];
                let yaw = 1.2 * wave(1, 5.0) + 0.25 * wave(3, 2.3);
                (1.1 * turn.cos(), 0.7 * turn.sin(), self.low_m + 0.07 + 0.65 * dip(2, 6.5), yaw)
            }
            Pattern::D => {
                let [x, y, z] = self.corner(time_s, 3.1);
                (0.9 * x, 0.9 * y, 0.5 + 0.65 * (1.0 + z), 0.6 * wave(1, 7.0) + 0.15 * wave(3, 2.9))
            }
            Pattern::E => {
                let sweep = wave(0, 5.0);
                let yaw = 1.05 * wave(1, 6.2);
                (1.15 * sweep, 0.6 * wave(2, 7.7), self.low_m + 0.1 + 0.55 * dip(3, 5.3), yaw)
            }
            Pattern::Hover => (0.0, 0.0, 0.6 + self.low_m, 0.0),
        };
        let place = Vector3::new(self.reach_m * x * start, self.reach_m * y * start, 0.0);
        // Start where the height of the pattern is reached without a jump.
        let height = 0.6 + self.low_m + (height - 0.6 - self.low_m) * start;
        (Vector3::new(place.x, place.y, -height), yaw * start)
    }

    /// Between corners, one a `hold_s`, each reached in half of it.
    fn corner(&self, time_s: f64, hold_s: f64) -> [f64; 3] {
        let hold_s = hold_s * self.pace[3];
        let number = (time_s / hold_s).floor();
        let part = smooth((time_s / hold_s - number) / 0.55);
        let of = |k: f64| self.corners[k as usize % self.corners.len()];
        let (from, to) = (of(number), of(number + 1.0));
        std::array::from_fn(|i| from[i] + (to[i] - from[i]) * part)
    }
}

/// Gains of the cascade.
#[derive(Debug, Clone, Copy)]
struct Gains {
    position_s2: f64,
    velocity_s: f64,
    position_integral_s3: f64,
    attitude_s: f64,
    rate_s: f64,
    rate_integral_s2: f64,
}

/// What gyro and attitude added to the rate and the attitude of a row, in body axes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Felt {
    pub(super) rate_rad_s: Vector3<f64>,
    pub(super) turn_rad: Vector3<f64>,
}

/// A pilot in flight.
#[derive(Debug, Clone)]
pub(super) struct Pilot {
    craft: Craft,
    path: Path,
    gains: Gains,
    /// (rad/s, rad) of each motor's tones.
    tones: [[(f64, f64); 5]; 4],
    position_integral: Vector3<f64>,
    rate_integral: Vector3<f64>,
    battery_v: f64,
    seen: Option<Body>,
    /// Size of each tone, part of the rotors' speed in hover.
    shake: f64,
}

impl Pilot {
    /// A pilot who knows the craft as `designed` and has trimmed `real` for hover; its load must
    /// not touch the floor.
    pub(super) fn new(
        designed: &Craft,
        real: &Craft,
        (pattern, style): (Pattern, Style),
        rng: &mut impl Rng,
    ) -> Self {
        let craft = designed;
        let (mut wide, mut slow) = style.factors();
        let clearance_m = real.load.map_or(0.0, |load| load.length_m);
        if real.load.is_some() {
            // Nobody flies a load so that it swings up to the rotors: accelerations of a third.
            (wide, slow) = (0.75 * wide, 1.5 * slow);
        }
        let corners = (0..40).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
        let path = Path {
            pattern,
            low_m: 1.3 * craft.rotor_radius_m + if clearance_m > 0.0 { clearance_m + 0.1 } else { 0.0 },
            reach_m: wide * rng.random_range(0.85..1.15),
            pace: std::array::from_fn(|_| slow * rng.random_range(0.88..1.14)),
            phase: std::array::from_fn(|_| rng.random_range(0.0..TAU)),
            corners,
            ends: None,
        };
        // Slow rotors allow slow loops only: the rate loop crosses at half the lag.
        let rate_s = match craft.size {
            Size::F330 => 8.0,
            Size::Large => 7.0,
            Size::Small => 12.0,
        };
        let gains = Gains {
            position_s2: 1.8,
            velocity_s: 2.2,
            position_integral_s3: 0.6,
            attitude_s: 0.42 * rate_s,
            rate_s,
            rate_integral_s2: 0.8 * rate_s,
        };
        let tones = std::array::from_fn(|_| {
            std::array::from_fn(|k| {
                let low_hz = 0.35 * 1.75_f64.powi(k as i32);
                (TAU * low_hz * rng.random_range(1.0..1.7), rng.random_range(0.0..TAU))
            })
        });
        let trim_m_s2 = craft.gravity_m_s2 * ((real.hover_rad_s() / craft.hover_rad_s()).powi(2) - 1.0);
        Self {
            craft: craft.clone(),
            path,
            gains,
            tones,
            position_integral: Vector3::new(0.0, 0.0, -trim_m_s2 / gains.position_integral_s3),
            rate_integral: Vector3::zeros(),
            battery_v: craft.hover_v(),
            seen: None,
            shake: SHAKE,
        }
    }

    /// The same pilot, who shakes no motor.
    pub(super) fn unshaken(self) -> Self {
        Self { shake: 0.0, ..self }
    }

    /// The same pilot from the floor to the floor.
    pub(super) fn between(mut self, ends: Ends) -> Self {
        self.path.ends = Some(ends);
        self
    }

    /// Where the flight starts, NED, m.
    pub(super) fn start(&self) -> Vector3<f64> {
        self.path.at(0.0).0
    }

    /// Whether the craft is where a craft under control would be and off the floor, and a load
    /// below it: one that swings higher would be among the rotors, or its cable slack.
    pub(super) fn is_content(&self, body: &Body, craft: &Craft) -> bool {
        let level = body.attitude.matrix()[(2, 2)] > 0.3;
        let place = body.position_ned_m;
        let hangs = craft.load.is_none() || body.link[0].z > 0.5;
        // Where the floor acts on the rotors, the formula of its effect ends on the landing gear.
        let clear = craft.ground_gain == 0.0 || body.lowest_hub_m(craft) > 0.0;
        level && hangs && clear && place.xy().norm() < 6.0 && (-6.0..0.2).contains(&place.z)
    }

    /// Motor commands at a tick; `felt` is the noise of what was seen at the last one.
    pub(super) fn command(&mut self, time_s: f64, body: &Body, battery: &Cell, felt: &Felt) -> [f64; 4] {
        let seen = self.seen.replace(body.clone()).unwrap_or_else(|| body.clone());
        let measured_v = battery.voltage_v(time_s, &seen.rotor_rad_s);
        self.battery_v += (measured_v - self.battery_v) * PILOT_PERIOD_S / 0.5;
        let wanted = self.wanted_acceleration(time_s, &seen);
        let attitude = seen.attitude.matrix();
        let down = -wanted.normalize();
        let thrust_n = self.craft.mass_kg * (-wanted.dot(&attitude.column(2))).max(2.0);
        let torque = self.torque(time_s, &seen, felt, &down);
        self.mixed(time_s, thrust_n, torque)
    }

    /// Specific force asked for, inertial, m/s^2.
    fn wanted_acceleration(&mut self, time_s: f64, seen: &Body) -> Vector3<f64> {
        let d = 0.01;
        let [before, now, after] = [-d, 0.0, d].map(|shift| self.path.at(time_s + shift).0);
        let velocity = (after - before) / (2.0 * d);
        let acceleration = (after - 2.0 * now + before) / (d * d);
        let error = now - seen.position_ned_m;
        self.position_integral += error * PILOT_PERIOD_S;
        let g = &self.gains;
        let wanted = acceleration
            + g.velocity_s * (velocity - seen.velocity_ned_m_s)
            + g.position_s2 * error
            + g.position_integral_s3 * self.position_integral;
        let limited =
            Vector3::new(wanted.x.clamp(-4.0, 4.0), wanted.y.clamp(-4.0, 4.0), wanted.z.clamp(-4.0, 4.0));
        limited - Vector3::new(0.0, 0.0, self.craft.gravity_m_s2)
    }

    /// Torque that turns the body's z axis to `down` and its nose to the pattern's yaw, N m.
    fn torque(&mut self, time_s: f64, seen: &Body, felt: &Felt, down: &Vector3<f64>) -> Vector3<f64> {
        let yaw = self.path.at(time_s).1;
        let yaw_rate = (self.path.at(time_s + 0.01).1 - self.path.at(time_s - 0.01).1) / 0.02;
        let nose = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
        let right = down.cross(&nose).normalize();
        let wanted = Matrix3::from_columns(&[right.cross(down), right, *down]);
        let turn = wanted.tr_mul((seen.attitude * Rotation3::new(felt.turn_rad)).matrix());
        let error = 0.5
            * Vector3::new(
                turn[(2, 1)] - turn[(1, 2)],
                turn[(0, 2)] - turn[(2, 0)],
                turn[(1, 0)] - turn[(0, 1)],
            );
        let g = self.gains;
        let wanted_rate = -g.attitude_s * error + Vector3::new(0.0, 0.0, yaw_rate);
        let off = wanted_rate - seen.rate_rad_s(&self.craft) - felt.rate_rad_s;
        self.rate_integral += off * PILOT_PERIOD_S;
        let turning = g.rate_s * off + g.rate_integral_s2 * self.rate_integral;
        self.craft.inertia_kg_m2.diagonal().component_mul(&turning)
    }

    /// Thrust and torque shared out to the rotors, shaken, as commands.
    fn mixed(&self, time_s: f64, thrust_n: f64, torque: Vector3<f64>) -> [f64; 4] {
        let craft = &self.craft;
        let hover = craft.hover_rad_s();
        let hover_n = craft.thrust_n_s2 * hover * hover;
        let ratio_m = craft.torque_nm_s2 / craft.thrust_n_s2;
        let hubs = craft.hubs_m();
        std::array::from_fn(|i| {
            let [x, y] = hubs[i];
            let share = thrust_n - torque.x / y + torque.y / x + craft.spin[i] * torque.z / ratio_m;
            let speed = ((0.25 * share).clamp(0.1 * hover_n, 2.2 * hover_n) / craft.thrust_n_s2).sqrt();
            let tones = if self.path.pattern == Pattern::Hover { &[][..] } else { &self.tones[i][..] };
            let shake: f64 = tones.iter().map(|(w, phase)| (w * time_s + phase).sin()).sum();
            let [low, high] = craft.command_range();
            craft.map.command_for(speed + self.shake * hover * shake, self.battery_v).clamp(low, high)
        })
    }
}
