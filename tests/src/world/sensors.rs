//! What the laboratory's instruments see of a flight: motion capture, gyro, battery, and the
//! commands as sent; where asked for, an accelerometer and the speeds of the rotors.

use flights::{Column, Flight};
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use super::body::{Body, STEP_S};
use super::craft::Craft;
use super::pilot::{Felt, PILOT_PERIOD_S};

/// Faults and noise of the instruments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Scales all noise: 1 is 0.25 mm, 0.7 mrad, 0.012 rad/s and 15 mV.
    pub noise: f64,
    /// Correlation time of the motion capture's noise, s; 0 is white.
    pub colour_s: f64,
    /// Root mean square lateness of samples behind an even grid, s.
    pub jitter_s: f64,
    /// Part of the rows that are lost, in bursts.
    pub dropout: f64,
    /// How much older the gyro's sample is than its row, s.
    pub gyro_age_s: f64,
    /// Length of a gap somewhere in the flight, s.
    pub gap_s: f64,
    /// Part of the rows with a gross outlier in the motion capture, and as many with one in the
    /// gyro.
    pub outliers: f64,
    /// Rows a second. The commands of a slower log are those of the moment; in a faster one they stay.
    pub rate_hz: f64,
    /// What the voltmeter adds to the battery's voltage, V.
    pub voltmeter_v: f64,
    /// Whether there is an accelerometer at the centre of mass, of a craft in the air.
    pub accelerometer: bool,
    /// Whether the speeds of the rotors are measured.
    pub tachometers: bool,
    /// Whether the pilot flies by the noise of gyro and attitude, as all do, and shakes no motor besides.
    pub are_flown_by: bool,
}

impl Default for Sensors {
    fn default() -> Self {
        Self {
            noise: 1.0,
            colour_s: 0.0,
            jitter_s: 0.0,
            dropout: 0.0,
            gyro_age_s: 0.0,
            gap_s: 0.0,
            outliers: 0.0,
            rate_hz: 1.0 / PILOT_PERIOD_S,
            voltmeter_v: 0.0,
            accelerometer: false,
            tachometers: false,
            are_flown_by: false,
        }
    }
}

impl Sensors {
    /// Position, m.
    pub const POSITION_M: f64 = 0.00025;
    /// Attitude about each body axis, rad.
    pub const ATTITUDE_RAD: f64 = 0.0007;
    /// Gyro, rad/s.
    pub const RATE_RAD_S: f64 = 0.012;
    /// Largest bias of the gyro, rad/s.
    pub const BIAS_RAD_S: f64 = 0.03;
    /// Largest outliers of each: 0.3 m, 0.4 rad, 6 rad/s; the least are a tenth.
    const OUTLIERS: [f64; 3] = [0.3, 0.4, 6.0];
    /// Battery, V.
    pub const BATTERY_V: f64 = 0.015;
    /// Accelerometer, m/s^2.
    pub const FORCE_M_S2: f64 = 0.05;
    /// Largest bias of the accelerometer, m/s^2.
    pub const FORCE_BIAS_M_S2: f64 = 0.05;
    /// Rotor speeds, part of them.
    pub const ROTOR: f64 = 0.002;

    /// Time between rows, s.
    fn period_s(&self) -> f64 {
        1.0 / self.rate_hz
    }

    /// A log as it is on a bad day: a clock that wobbles by half a millisecond, a row in fifty lost
    /// in bursts, two seconds missing somewhere.
    pub fn rough(factor: f64) -> Self {
        Self { jitter_s: 0.0005, dropout: 0.02, gap_s: 2.0, ..Self::noisy(factor) }
    }

    /// These sensors with one row in twenty whose motion capture is somewhere else, and as many
    /// with a gyro's garbled word.
    pub fn with_outliers(self) -> Self {
        Self { outliers: 0.05, ..self }
    }

    /// White noise of `factor` times the usual.
    pub fn noisy(factor: f64) -> Self {
        Self { noise: factor, ..Self::default() }
    }
}

/// Mean length of a burst of lost rows.
const BURST_ROWS: f64 = 12.0;

/// What the instruments always log, in the order of the file.
pub(super) const LOGGED: [Column; 15] = [
    Column::T,
    Column::X,
    Column::Y,
    Column::Z,
    Column::Phi,
    Column::Theta,
    Column::Psi,
    Column::P,
    Column::Q,
    Column::R,
    Column::Cmd1,
    Column::Cmd2,
    Column::Cmd3,
    Column::Cmd4,
    Column::Vbat,
];

/// What the accelerometer logs.
pub(super) const FORCE: [Column; 3] = [Column::Ax, Column::Ay, Column::Az];
/// What the tachometers log.
pub(super) const SPEEDS: [Column; 4] = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];

/// Takes samples of a flight.
pub(super) struct Recorder {
    sensors: Sensors,
    tilt: Rotation3<f64>,
    bias_rad_s: Vector3<f64>,
    rng: Pcg64,
    /// Step at which each row is taken.
    due: Vec<usize>,
    rows: [Vec<f64>; LOGGED.len()],
    force_bias_m_s2: Vector3<f64>,
    /// Rows of the accelerometer and of the tachometers; empty without them.
    forces: [Vec<f64>; FORCE.len()],
    speeds: [Vec<f64>; SPEEDS.len()],
    /// Rates of the last steps, the newest last.
    rates: Vec<Vector3<f64>>,
    /// Present noise of the motion capture: position, then attitude, standard deviation 1.
    mocap: [f64; 6],
    /// Noise of the latest row.
    felt: Felt,
    losing: bool,
}

impl Recorder {
    pub(super) fn new(craft: &Craft, sensors: &Sensors, duration_s: f64, mut rng: Pcg64) -> Self {
        let per_row = (sensors.period_s() / STEP_S).round();
        let count = (duration_s / sensors.period_s()).round() as usize;
        let due = (0..count)
            .map(|k| {
                let wobble: f64 = rng.sample(StandardNormal);
                // A logger is late, never early; under half a row, so that times keep rising.
                let steps = (sensors.jitter_s * wobble.abs() / STEP_S).round().min(0.4 * per_row);
                (k as f64 * per_row + steps) as usize
            })
            .collect();
        let [roll, pitch] = craft.tilt_rad;
        let scale = sensors.noise.min(1.0) * Sensors::BIAS_RAD_S;
        let bias_rad_s = Vector3::from_fn(|_, _| scale * rng.random_range(-1.0..1.0));
        let mocap = std::array::from_fn(|_| rng.sample(StandardNormal));
        let mut force_bias_m_s2 = Vector3::zeros();
        if sensors.accelerometer {
            let largest = sensors.noise.min(1.0) * Sensors::FORCE_BIAS_M_S2;
            force_bias_m_s2 = Vector3::from_fn(|_, _| largest * rng.random_range(-1.0..1.0));
        }
        Self {
            sensors: *sensors,
            tilt: Rotation3::new(Vector3::new(roll, pitch, 0.0)),
            bias_rad_s,
            rng,
            due,
            rows: std::array::from_fn(|_| Vec::with_capacity(count)),
            force_bias_m_s2,
            forces: Default::default(),
            speeds: Default::default(),
            rates: Vec::new(),
            mocap,
            felt: Felt::default(),
            losing: false,
        }
    }

    /// Called at every step before it is taken.
    pub(super) fn observe(&mut self, time_s: f64, body: &Body, craft: &Craft, command: &[f64; 4]) {
        let step = (time_s / STEP_S).round() as usize;
        let age = (self.sensors.gyro_age_s / STEP_S).round() as usize;
        if age > 0 {
            self.rates.push(body.rate_rad_s(craft));
            if self.rates.len() > age + 1 {
                self.rates.remove(0);
            }
        }
        // Jitter keeps rows apart, so a step has one row at most.
        if self.due.get(self.row()) != Some(&step) {
            return;
        }
        let rate = if age > 0 { self.rates[0] } else { body.rate_rad_s(craft) };
        self.record(step as f64 * STEP_S, body, craft, rate, command);
    }

    /// The noise that the pilot flies by.
    pub(super) fn felt(&self) -> Felt {
        if self.sensors.are_flown_by { self.felt } else { Felt::default() }
    }

    fn row(&self) -> usize {
        self.rows[0].len()
    }

    fn record(&mut self, time_s: f64, body: &Body, craft: &Craft, rate: Vector3<f64>, command: &[f64; 4]) {
        let noise = self.sensors.noise;
        let mocap = self.mocap_noise();
        let shake = Vector3::new(mocap[3], mocap[4], mocap[5]) * (noise * Sensors::ATTITUDE_RAD);
        let seen = body.attitude * self.tilt * Rotation3::new(shake);
        let (phi, theta, psi) = seen.euler_angles();
        let place = body.position_ned_m + body.attitude * craft.lever_m;
        let hum = self.white3() * (noise * Sensors::RATE_RAD_S);
        self.felt = Felt { rate_rad_s: hum, turn_rad: shake };
        let gyro = rate + self.bias_rad_s + hum;
        let volts = body.battery_v + self.white() * noise * Sensors::BATTERY_V + self.sensors.voltmeter_v;
        let position = noise * Sensors::POSITION_M;
        let values = [
            time_s,
            place.x + position * mocap[0],
            place.y + position * mocap[1],
            place.z + position * mocap[2],
            phi,
            theta,
            psi,
            gyro.x,
            gyro.y,
            gyro.z,
            command[0],
            command[1],
            command[2],
            command[3],
            volts,
        ];
        self.rows.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
        self.garble();
        self.record_more(body);
    }

    /// Samples of the instruments that not every craft has.
    fn record_more(&mut self, body: &Body) {
        let noise = self.sensors.noise;
        if self.sensors.accelerometer {
            let felt = body.specific_force_m_s2 + self.force_bias_m_s2;
            let felt = felt + self.white3() * (noise * Sensors::FORCE_M_S2);
            self.forces.iter_mut().zip(felt.iter()).for_each(|(row, value)| row.push(*value));
        }
        if self.sensors.tachometers {
            for (rotor, speed) in body.rotor_rad_s.iter().enumerate() {
                let off = 1.0 + noise * Sensors::ROTOR * self.white();
                self.speeds[rotor].push(speed * off);
            }
        }
    }

    /// Makes some of the latest row's values gross outliers.
    fn garble(&mut self) {
        let share = self.sensors.outliers;
        if share <= 0.0 {
            return;
        }
        let (tracker, gyro) = (self.rng.random_bool(share), self.rng.random_bool(share));
        for (row, value) in self.rows.iter_mut().enumerate().skip(1).take(9) {
            let kind = (row - 1) / 3;
            let off = Sensors::OUTLIERS[kind] * self.rng.random_range(0.1..1.0);
            let sign = if self.rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let hit = if kind < 2 { tracker } else { gyro };
            if let Some(last) = value.last_mut().filter(|_| hit) {
                *last += sign * off;
            }
        }
    }

    fn white(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }

    fn white3(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.rng.sample(StandardNormal))
    }

    /// Standard normal each; successive rows correlated where the noise has a colour.
    fn mocap_noise(&mut self) -> [f64; 6] {
        let colour_s = self.sensors.colour_s;
        let keep = if colour_s > 0.0 { (-self.sensors.period_s() / colour_s).exp() } else { 0.0 };
        let fresh = (1.0 - keep * keep).sqrt();
        for k in 0..self.mocap.len() {
            let kick = self.white();
            self.mocap[k] = keep * self.mocap[k] + fresh * kick;
        }
        self.mocap
    }

    /// The flight, without the rows that were lost.
    pub(super) fn flight(mut self, name: &str) -> Flight {
        let gap = self.gap();
        let kept: Vec<bool> = (0..self.row()).map(|k| self.is_kept() && !gap.contains(&k)).collect();
        let always = LOGGED.into_iter().zip(std::mem::take(&mut self.rows));
        let forces = FORCE.into_iter().zip(std::mem::take(&mut self.forces));
        let speeds = SPEEDS.into_iter().zip(std::mem::take(&mut self.speeds));
        let rows = always.chain(forces.filter(|_| self.sensors.accelerometer));
        let rows = rows.chain(speeds.filter(|_| self.sensors.tachometers));
        let of_kept = |row: Vec<f64>| {
            row.into_iter().zip(&kept).filter(|(_, kept)| **kept).map(|(value, _)| value).collect()
        };
        Flight::from_columns(name, rows.map(|(column, row)| (column, of_kept(row))))
    }

    /// Rows of the gap: anywhere in the middle half of the flight.
    fn gap(&mut self) -> std::ops::Range<usize> {
        let length = (self.sensors.gap_s / self.sensors.period_s()).round() as usize;
        if length == 0 {
            return 0..0;
        }
        let start = self.rng.random_range(self.row() / 4..=self.row() / 2);
        start..start + length
    }

    /// Two states, losing and keeping, with the wanted share and mean length of a burst.
    fn is_kept(&mut self) -> bool {
        let share = self.sensors.dropout;
        if share > 0.0 {
            let leave = 1.0 / BURST_ROWS;
            let enter = leave * share / (1.0 - share);
            let draw = self.rng.random_range(0.0..1.0);
            self.losing = if self.losing { draw >= leave } else { draw < enter };
        }
        !self.losing
    }
}
