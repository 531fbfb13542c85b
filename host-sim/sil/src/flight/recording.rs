//! What was recorded of a flight, and its flight file.

use control::Measurement;
use flights::{Column, Flight};
use model::{State, frames};
use nalgebra::Vector3;

use super::configuration::CAGE_M;
use super::script::StepAxis;

/// The craft as it is, in single precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Centre of mass, inertial NED, m.
    pub position_m: [f32; 3],
    /// Unit quaternion (w, x, y, z), body to inertial.
    pub attitude: [f32; 4],
    /// Velocity over ground, body components, m/s.
    pub velocity_m_s: [f32; 3],
    /// Body rates p, q, r, rad/s.
    pub rate_rad_s: [f32; 3],
    /// Rotor speeds, rad/s.
    pub rotor_rad_s: [f32; 4],
    /// Voltage at the battery's terminals, V.
    pub battery_v: f32,
}

/// One tick of a flight. Single precision is what sensors and controller have, and fresh memory for
/// rows is a third of the cost of a fast flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// The craft as it is.
    pub truth: Truth,
    /// What the sensors said of it, before the delay.
    pub sensed: Measurement,
    /// Commanded inertial x and y, m.
    pub position_command_m: [f32; 2],
    /// What the controller made of it.
    pub output: proto::Output,
    /// What the supervisor made of it.
    pub supervision: proto::Supervision,
}

impl Truth {
    #[inline]
    pub(super) fn new(state: &State, battery_v: f64) -> Self {
        let three = |v: &Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        Self {
            position_m: three(&state.position_ned_m),
            attitude: <[f64; 4]>::from(state.attitude).map(|q| q as f32),
            velocity_m_s: three(&state.velocity_m_s),
            rate_rad_s: three(&state.rate_rad_s),
            rotor_rad_s: state.rotor_rad_s.map(|w| w as f32),
            battery_v: battery_v as f32,
        }
    }

    /// Phi, theta, psi, rad.
    pub fn euler_rad(&self) -> [f64; 3] {
        frames::euler_from_quaternion(&self.attitude.map(f64::from).into()).into()
    }

    /// Cosine of the angle between the body's and the inertial z axis: 1 level, -1 upside down.
    #[inline]
    pub fn upright(&self) -> f64 {
        let [_, x, y, _] = self.attitude.map(f64::from);
        1.0 - 2.0 * (x * x + y * y)
    }
}

impl Row {
    /// Whether a motor command stands at an end of its range.
    #[inline]
    pub fn is_saturated(&self, command_range: [f64; 2]) -> bool {
        let [low, high] = command_range.map(|v| v as f32);
        // All four at once: a branch for each would cost more.
        self.output.pwm.iter().fold(false, |is, &pwm| is | (pwm <= low) | (pwm >= high))
    }

    /// How far inside the cage the craft is, m; negative outside of it and below the floor.
    #[inline]
    pub fn cage_margin_m(&self) -> f64 {
        let [x, y, z] = self.truth.position_m.map(f64::from);
        let [x_limit, y_limit, ceiling] = CAGE_M;
        (x_limit - x.abs()).min(y_limit - y.abs()).min(ceiling + z).min(-z)
    }
}

/// Follows a craft from row to row, so that its yaw runs on through a turn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Follower {
    turns: f64,
    /// Yaw of the row before, within half a turn, rad.
    before_rad: Option<f64>,
}

impl Follower {
    /// Phi, theta, psi in the next row, rad.
    pub(crate) fn euler_rad(&mut self, truth: &Truth) -> [f64; 3] {
        let [roll, pitch, yaw] = truth.euler_rad();
        if let Some(before) = self.before_rad {
            self.turns -= ((yaw - before) / std::f64::consts::TAU).round();
        }
        self.before_rad = Some(yaw);
        [roll, pitch, yaw + self.turns * std::f64::consts::TAU]
    }

    /// One quantity of the craft in the next row.
    #[inline]
    pub(crate) fn value(&mut self, axis: StepAxis, truth: &Truth) -> f64 {
        match axis {
            StepAxis::Roll => self.euler_rad(truth)[0],
            StepAxis::Pitch => self.euler_rad(truth)[1],
            StepAxis::Yaw => self.euler_rad(truth)[2],
            StepAxis::X => f64::from(truth.position_m[0]),
            StepAxis::Y => f64::from(truth.position_m[1]),
            StepAxis::Z => f64::from(truth.position_m[2]),
        }
    }
}

/// Time of a row of a flight, s.
pub fn time_of_row_s(row: usize, period_s: f64) -> f64 {
    // Through the nearest hundredth of a microsecond: 0.29 instead of 0.29000000000000004.
    (row as f64 * period_s * 1e8).round() / 1e8
}

/// A flight as flown.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// One row a tick, from t = 0.
    pub rows: Vec<Row>,
    /// Time between rows, s.
    pub period_s: f64,
    /// Whether the craft's state stayed finite to the end; otherwise the recording ends where it
    /// did not.
    pub complete: bool,
}

impl Recording {
    /// Time of a row, s.
    pub fn time_s(&self, row: usize) -> f64 {
        time_of_row_s(row, self.period_s)
    }

    /// Phi, theta, psi of the craft in each row, rad; yaw runs on through a turn.
    pub fn euler_rad(&self) -> Vec<[f64; 3]> {
        let mut follower = Follower::default();
        self.rows.iter().map(|row| follower.euler_rad(&row.truth)).collect()
    }

    /// One quantity of the craft in each row.
    pub fn series(&self, axis: StepAxis) -> Vec<f64> {
        let mut follower = Follower::default();
        self.rows.iter().map(|row| follower.value(axis, &row.truth)).collect()
    }

    /// Ticks in which a motor command stood at an end of its range.
    pub fn saturated_ticks(&self, command_range: [f64; 2]) -> usize {
        self.rows.iter().filter(|row| row.is_saturated(command_range)).count()
    }

    /// How far the craft stayed inside the cage at its closest, m; negative if it left it or hit
    /// the floor.
    pub fn cage_margin_m(&self) -> f64 {
        self.rows.iter().map(Row::cage_margin_m).fold(f64::INFINITY, f64::min)
    }

    /// The flight file of contract columns: poses as the sensors took them, gyro with its bias,
    /// measured voltage; with `rotor_speeds` the rotor speeds too, which a craft without
    /// tachometers does not log.
    pub fn to_flight(&self, name: impl Into<String>, rotor_speeds: bool) -> Flight {
        let column = |value: &dyn Fn(&Row) -> f64| -> Vec<f64> {
            self.rows.iter().map(|row| rounded(value(row))).collect()
        };
        let of = |pick: fn(&Row) -> f32| column(&|row| f64::from(pick(row)));
        let gyro =
            |k: usize| column(&|row| row.sensed.gyro_rad_s.map_or(f64::NAN, |rates| f64::from(rates[k])));
        let motor = |k: usize| column(&|row| f64::from(row.output.pwm[k]));
        let rotor = |k: usize| column(&|row| f64::from(row.truth.rotor_rad_s[k]));
        let time = (0..self.rows.len()).map(|row| self.time_s(row)).collect();
        let mut columns = vec![
            (Column::T, time),
            (Column::X, of(|row| row.sensed.position_m[0])),
            (Column::Y, of(|row| row.sensed.position_m[1])),
            (Column::Z, of(|row| row.sensed.position_m[2])),
            (Column::Phi, of(|row| row.sensed.attitude_rad[0])),
            (Column::Theta, of(|row| row.sensed.attitude_rad[1])),
            (Column::Psi, of(|row| row.sensed.attitude_rad[2])),
            (Column::P, gyro(0)),
            (Column::Q, gyro(1)),
            (Column::R, gyro(2)),
            (Column::Cmd1, motor(0)),
            (Column::Cmd2, motor(1)),
            (Column::Cmd3, motor(2)),
            (Column::Cmd4, motor(3)),
            (Column::Vbat, of(|row| row.sensed.battery_v)),
        ];
        if rotor_speeds {
            let omega = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];
            columns.extend(omega.into_iter().enumerate().map(|(k, column)| (column, rotor(k))));
        }
        Flight::from_columns(name, columns)
    }
}

/// To nine decimals: finer than any sensor, and free of the digits that widening an f32 brings.
fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(position_m: [f32; 3], pwm: [f32; 4]) -> Row {
        let truth = Truth { position_m, ..Truth::new(&State::at_rest(Vector3::zeros(), [600.0; 4]), 11.1) };
        let sensed = Measurement { position_m, attitude_rad: [0.0; 3], gyro_rad_s: None, battery_v: 11.1 };
        let output = proto::Output {
            tick: 0,
            pwm,
            attitude_command_rad: [0.0; 3],
            z_command_m: 0.0,
            position_reference_m: None,
            thrust: 0.0,
            torque: [0.0; 3],
            refused: proto::Refusal::default(),
            faults: 0,
        };
        let supervision = proto::Supervision { state: proto::State::Flying, conditions: 0, preflight: 0 };
        Row { truth, sensed, position_command_m: [0.0; 2], output, supervision }
    }

    #[test]
    fn the_margin_is_to_the_nearest_of_walls_ceiling_and_floor() {
        let margin_m = |places: &[[f32; 3]]| {
            let rows = places.iter().map(|place| row(*place, [1500.0; 4])).collect();
            Recording { rows, period_s: 0.01, complete: true }.cage_margin_m()
        };
        assert_eq!(margin_m(&[[0.0, 0.0, -1.0]]), 1.0);
        assert_eq!(margin_m(&[[3.5, 0.0, -1.0], [0.0, 0.0, -1.0]]), 3.8 - 3.5);
        assert!((margin_m(&[[0.0, -2.5, -1.0]]) - 0.1).abs() < 1e-12);
        assert!((margin_m(&[[0.0, 0.0, -3.0]]) + 0.2).abs() < 1e-12, "above the ceiling");
        assert_eq!(margin_m(&[[0.0, 0.0, 0.5]]), -0.5, "below the floor");
    }

    #[test]
    fn a_tick_is_saturated_at_either_end_of_the_range() {
        let pwm = [[1500.0; 4], [1000.0, 1500.0, 1500.0, 1500.0], [1500.0, 1500.0, 2000.0, 1500.0]];
        let rows = pwm.iter().map(|pwm| row([0.0, 0.0, -1.0], *pwm)).collect();
        let recording = Recording { rows, period_s: 0.01, complete: true };
        assert_eq!(recording.saturated_ticks([1000.0, 2000.0]), 2);
        assert_eq!(recording.time_s(29), 0.29);
    }

    #[test]
    fn upright_is_the_cosine_of_the_tilt() {
        let tilted = |roll_rad: f64| {
            let mut state = State::at_rest(Vector3::zeros(), [600.0; 4]);
            state.attitude = frames::quaternion_from_euler(Vector3::new(roll_rad, 0.0, 0.4));
            Truth::new(&state, 11.1).upright()
        };
        for roll_rad in [0.0, 0.5, 2.0, std::f64::consts::PI] {
            assert!((tilted(roll_rad) - roll_rad.cos()).abs() < 1e-6, "{roll_rad}");
        }
    }
}
