//! Forms that no search lists as they are: sums of two, other shapes, other kinds of memory.
//!
//! At strength 1 each pushes about as hard as those of [`super::craft::Strange`]: some tenths of a m/s^2 or rad/s^2.

use nalgebra::{Matrix3, Vector3};

/// Which form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Odd {
    /// Air from the side pushes only beyond 0.4 m/s, with the square of what is beyond.
    DeadZone,
    /// Drag forward with the root of the speed.
    SquareRoot,
    /// Ribs on the floor from south to north, 0.9 m apart, that lift or do not.
    Ribs,
    /// A pitching moment of the forward speed that ends at a bound.
    Bounded,
    /// An antenna that swings at 0.8 Hz in the air from the side, and turns the craft.
    Antenna,
    /// Loss of thrust behind two lags of 0.25 s of the speed down through the air.
    TwoLags,
    /// A push from the side by as much as the air is ahead of its own mean of 0.7 s.
    Ahead,
    /// Pulls to two walls, one stronger than the other.
    TwoWalls,
    /// A wall, and air from the side that turns the craft.
    WallAndWeathercock,
    /// A ceiling, and a door that is open for 3 s.
    CeilingAndDoor,
    /// Wind from 0.9 m of height on.
    ShearLayer,
    /// Rolling and pitching are damped close to the floor.
    FloorDamping,
    /// A jet across the room with the wide skirts of a Lorentz curve.
    Lorentz,
    /// Thrust that is lost in a climb, with the power 1.5 of its speed.
    Climb,
    /// A push north above a slanting plane.
    SlantingPlane,
    /// Thrust that is lost with the square of the energy used.
    Tired,
}

/// What forms see.
pub(super) struct Seen<'a> {
    pub(super) position_ned_m: &'a Vector3<f64>,
    /// Through the air, body, m/s.
    pub(super) air_m_s: &'a Vector3<f64>,
    /// Body, rad/s.
    pub(super) rate_rad_s: &'a Vector3<f64>,
    pub(super) attitude: &'a Matrix3<f64>,
    pub(super) time_s: f64,
    pub(super) past: &'a Past,
}

/// What forms remember.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Past {
    /// Where the antenna is, m/s, and how fast it swings.
    antenna: [f64; 2],
    /// Speed down behind one lag and behind two, m/s.
    sunk_m_s: [f64; 2],
    /// Mean of the air from the side, m/s.
    side_m_s: f64,
    /// Energy used, that of hovering for a second being 1.
    used_s: f64,
}

/// What a form does.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Push {
    /// Inertial, m/s^2.
    pub(super) force_m_s2: Vector3<f64>,
    /// Body, rad/s^2.
    pub(super) turn_rad_s2: Vector3<f64>,
}

impl Past {
    /// A while later; the rotors' power is 1 in hover.
    pub(super) fn step(&mut self, step_s: f64, air_m_s: &Vector3<f64>, power: f64) {
        const SWING_RAD_S: f64 = std::f64::consts::TAU * 0.8;
        let [place, speed] = self.antenna;
        let pull = SWING_RAD_S * SWING_RAD_S * (air_m_s.y - place) - 0.6 * SWING_RAD_S * speed;
        self.antenna[1] = speed + step_s * pull;
        self.antenna[0] = place + step_s * self.antenna[1];
        let [first, second] = self.sunk_m_s;
        self.sunk_m_s =
            [first + step_s / 0.25 * (air_m_s.z - first), second + step_s / 0.25 * (first - second)];
        self.side_m_s += step_s / 0.7 * (air_m_s.y - self.side_m_s);
        self.used_s += step_s * power;
    }
}

impl Odd {
    /// What it does at a strength.
    pub(super) fn push(self, strength: f64, seen: &Seen<'_>) -> Push {
        let (body, ned) = self.accelerations_m_s2(seen);
        Push {
            force_m_s2: strength * (seen.attitude * body + ned),
            turn_rad_s2: strength * self.turn_rad_s2(seen),
        }
    }

    /// In body and in inertial axes, m/s^2.
    fn accelerations_m_s2(self, seen: &Seen<'_>) -> (Vector3<f64>, Vector3<f64>) {
        let Seen { position_ned_m: place, air_m_s: air, past, .. } = *seen;
        let close = |distance_m: f64| (-distance_m / 0.25).exp().min(2.0);
        let height = -place.z;
        let (none, x, y, z) = (Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z());
        match self {
            Self::DeadZone => (-1.5 * air.y.signum() * (air.y.abs() - 0.4).max(0.0).powi(2) * y, none),
            Self::SquareRoot => (-0.5 * air.x.signum() * air.x.abs().sqrt() * x, none),
            Self::TwoLags => (0.6 * past.sunk_m_s[1] * z, none),
            Self::Ahead => (0.6 * (air.y - past.side_m_s) * y, none),
            Self::Ribs => {
                let wave = (std::f64::consts::TAU * place.x / 0.9).sin();
                (none, -0.4 * (4.0 * wave).tanh() * z)
            }
            Self::TwoWalls => (none, (0.8 * close(0.8 - place.y) - 0.5 * close(0.8 + place.y)) * y),
            Self::WallAndWeathercock => (none, 0.8 * close(0.8 - place.y) * y),
            Self::CeilingAndDoor => {
                let edge = |at_s: f64| 0.5 * (1.0 + ((seen.time_s - at_s) / 0.2).tanh());
                (none, -0.7 * close(1.9 - height) * z + 0.5 * (edge(6.0) - edge(9.0)) * x)
            }
            Self::Lorentz => (none, 0.6 / (1.0 + ((place.x - 0.2) / 0.3).powi(2)) * y),
            Self::SlantingPlane => (none, 1.2 * (0.6 * place.x + 0.8 * (height - 1.0)).max(0.0) * x),
            Self::Bounded
            | Self::Antenna
            | Self::ShearLayer
            | Self::FloorDamping
            | Self::Climb
            | Self::Tired => (none, none),
        }
    }

    /// Body axes, rad/s^2.
    fn turn_rad_s2(self, seen: &Seen<'_>) -> Vector3<f64> {
        let Seen { air_m_s: air, rate_rad_s: rate, .. } = *seen;
        match self {
            Self::Bounded => 0.8 * air.x * air.x.abs() / (air.x * air.x + 0.25) * Vector3::y(),
            Self::Antenna => seen.past.antenna[0] * Vector3::z(),
            Self::WallAndWeathercock => 0.5 * air.y * Vector3::z(),
            Self::FloorDamping => {
                let damping = 3.0 * (seen.position_ned_m.z / 0.4).exp().min(1.0);
                -damping * Vector3::new(rate.x, rate.y, 0.0)
            }
            _ => Vector3::zeros(),
        }
    }

    /// North wind that it adds, m/s.
    pub(super) fn wind_m_s(self, strength: f64, height_m: f64) -> f64 {
        let is_it = self == Self::ShearLayer;
        if is_it { strength * 1.5 * 0.5 * (1.0 + ((height_m - 0.9) / 0.1).tanh()) } else { 0.0 }
    }

    /// Share of the thrust that it takes.
    pub(super) fn lost(self, strength: f64, air_m_s: &Vector3<f64>, past: &Past) -> f64 {
        match self {
            Self::Climb => strength * 0.06 * (-air_m_s.z).max(0.0).powf(1.5),
            Self::Tired => strength * 0.08 * (past.used_s / 20.0).powi(2),
            _ => 0.0,
        }
    }
}
