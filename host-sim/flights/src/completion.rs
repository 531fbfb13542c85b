//! What a log leaves out, made of what it has: fewer columns must do, and what stands in for them is told.
//!
//! | not logged | what stands in |
//! |---|---|
//! | `phi, theta, psi` | the quaternion `qw, qx, qy, qz` (body to inertial); else gyro and accelerometer in a complementary filter |
//! | `p, q, r` | the derivative of the attitude |
//! | `cmd1..cmd4` | the rotor speeds |
//! | `vbat` | a constant |
//! | `x, y, z` or `x, y` | a point that stays where it is, if there is an accelerometer |

use std::borrow::Cow;
use std::path::Path;

use model::frames;
use nalgebra::{Vector3, Vector4};

use crate::columns::{COLUMNS, Column};
use crate::error::FlightError;
use crate::flight::Flight;
use crate::stand_in::StandIn;

/// Voltage of a battery that was not logged: a number that no one takes for a measurement, V.
pub const UNKNOWN_VOLTAGE_V: f64 = 1.0;

impl Flight {
    /// What stands in for columns that were not logged.
    pub fn stand_ins(&self) -> &[StandIn] {
        &self.stand_ins
    }

    /// The flight with all columns that a model is fitted to; as it is, where it has them.
    pub fn completed(&self, path: &Path) -> Result<Cow<'_, Self>, FlightError> {
        let groups = [&ANGLES[..], &RATES, &COMMANDS, &[Column::Vbat], StandIn::NoPosition.columns()];
        let is_there = |column: &Column| self.column(*column).is_some();
        let has_values = |values: &Vec<f64>| values.iter().any(|v| !v.is_nan());
        if groups.into_iter().flatten().all(is_there) && self.columns.iter().flatten().all(has_values) {
            return Ok(Cow::Borrowed(self));
        }
        let mut flight = self.clone();
        flight.complete(path)?;
        Ok(Cow::Owned(flight))
    }

    /// Gives the flight all columns that a model is fitted to, from those that were logged; `path` is for messages. A column
    /// without a single value was not logged.
    pub fn complete(&mut self, path: &Path) -> Result<(), FlightError> {
        for column in &mut self.columns[1..] {
            if column.as_ref().is_some_and(|values| values.iter().all(|v| v.is_nan())) {
                *column = None;
            }
        }
        self.complete_attitude(path)?;
        self.complete_rates(path)?;
        self.complete_motors(path)?;
        if self.column(Column::Vbat).is_none() {
            self.stand_in(StandIn::ConstantVoltage, vec![vec![UNKNOWN_VOLTAGE_V; self.len()]]);
        }
        self.complete_position(path)
    }

    /// Without north and east, a height by itself is kept.
    fn complete_position(&mut self, path: &Path) -> Result<(), FlightError> {
        let horizontal = StandIn::HeightOnly.columns();
        let only_height =
            self.column(Column::Z).is_some() && horizontal.iter().all(|c| self.column(*c).is_none());
        if !only_height && self.all_or_none(StandIn::NoPosition.columns(), path)? {
            return Ok(());
        }
        if self.group(FORCE).is_none() {
            return Err(self.lacks(
                Column::X,
                "is missing, and there is no accelerometer (ax, ay, az) in its place",
                path,
            ));
        }
        let what = if only_height { StandIn::HeightOnly } else { StandIn::NoPosition };
        self.stand_in(what, vec![vec![0.0; self.len()]; what.columns().len()]);
        Ok(())
    }

    fn complete_attitude(&mut self, path: &Path) -> Result<(), FlightError> {
        if self.all_or_none(&ANGLES, path)? {
            return Ok(());
        }
        if self.all_or_none(&QUATERNION, path)? {
            let angles = self.angles_of_quaternion();
            self.stand_in(StandIn::AnglesOfQuaternion, angles);
            return Ok(());
        }
        let (Some(rates), Some(force)) = (self.group(RATES), self.group(FORCE)) else {
            return Err(self.lacks(
                Column::Phi,
                "is missing, and there is no quaternion (qw, qx, qy, qz) nor gyro and accelerometer in its place",
                path,
            ));
        };
        let angles = angles_of_gyro(self.required(Column::T), rates, force);
        self.stand_in(StandIn::AnglesOfGyro, angles);
        Ok(())
    }

    fn complete_rates(&mut self, path: &Path) -> Result<(), FlightError> {
        if !self.all_or_none(&RATES, path)? {
            let rates = self.rates_of_attitude();
            self.stand_in(StandIn::RatesOfAttitude, rates);
        }
        Ok(())
    }

    fn complete_motors(&mut self, path: &Path) -> Result<(), FlightError> {
        if self.all_or_none(&COMMANDS, path)? {
            return Ok(());
        }
        let Some(speeds) = self.group(SPEEDS) else {
            return Err(self.lacks(
                Column::Cmd1,
                "is missing, and there are no rotor speeds (omega1..omega4) in its place",
                path,
            ));
        };
        let speeds = speeds.map(<[f64]>::to_vec);
        self.stand_in(StandIn::RotorSpeeds, speeds.into());
        Ok(())
    }

    fn stand_in(&mut self, what: StandIn, values: Vec<Vec<f64>>) {
        for (column, values) in what.columns().iter().zip(values) {
            self.columns[*column as usize] = Some(values);
        }
        self.stand_ins.push(what);
    }

    /// Whether all columns of a group are there; one alone is a mistake of the log.
    fn all_or_none(&self, columns: &[Column], path: &Path) -> Result<bool, FlightError> {
        let missing: Vec<&Column> = columns.iter().filter(|c| self.column(**c).is_none()).collect();
        match missing.first() {
            None => Ok(true),
            Some(_) if missing.len() == columns.len() => Ok(false),
            Some(column) => Err(self.lacks(**column, "is missing or has no values", path)),
        }
    }

    fn lacks(&self, column: Column, problem: &'static str, path: &Path) -> FlightError {
        let logged = COLUMNS.iter().zip(&self.columns).filter(|(_, values)| values.is_some());
        let logged: Vec<&str> = logged.map(|(name, _)| *name).collect();
        FlightError::Header {
            path: path.into(),
            column: COLUMNS[column as usize].into(),
            problem,
            found: format!("the columns with values are {}", logged.join(",")),
        }
    }

    fn angles_of_quaternion(&self) -> Vec<Vec<f64>> {
        let [w, x, y, z] = QUATERNION.map(|column| self.required(column));
        let mut angles = vec![Vec::new(); 3];
        for k in 0..w.len() {
            let euler = frames::euler_from_quaternion(&Vector4::new(w[k], x[k], y[k], z[k]).normalize());
            angles.iter_mut().zip(euler.iter()).for_each(|(angle, value)| angle.push(*value));
        }
        angles
    }

    /// Body rates, rad/s, from the turn between the neighbours of each row: the rotation that takes one attitude to the other, over the
    /// time between them.
    pub fn rates_of_attitude(&self) -> Vec<Vec<f64>> {
        let t = self.required(Column::T);
        let angles = ANGLES.map(|column| self.required(column));
        let attitude =
            |k: usize| frames::dcm_from_euler(Vector3::new(angles[0][k], angles[1][k], angles[2][k]));
        let mut rates = vec![Vec::new(); 3];
        for k in 0..t.len() {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(t.len() - 1));
            // Inertial to body: the turn seen from the body is the transpose of the later on the earlier.
            let turn = attitude(before) * attitude(after).transpose();
            let rate = small_angle(&turn) / (t[after] - t[before]);
            rates.iter_mut().zip(rate.iter()).for_each(|(axis, value)| axis.push(*value));
        }
        rates
    }
}

const ANGLES: [Column; 3] = [Column::Phi, Column::Theta, Column::Psi];
const QUATERNION: [Column; 4] = [Column::Qw, Column::Qx, Column::Qy, Column::Qz];
const RATES: [Column; 3] = [Column::P, Column::Q, Column::R];
const FORCE: [Column; 3] = [Column::Ax, Column::Ay, Column::Az];
const COMMANDS: [Column; 4] = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];
const SPEEDS: [Column; 4] = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];

/// Rotation vector of a rotation matrix by less than half a turn, rad.
fn small_angle(turn: &nalgebra::Matrix3<f64>) -> Vector3<f64> {
    let axis =
        Vector3::new(turn[(2, 1)] - turn[(1, 2)], turn[(0, 2)] - turn[(2, 0)], turn[(1, 0)] - turn[(0, 1)]);
    let sine = 0.5 * axis.norm();
    let angle = sine.atan2(0.5 * (turn.trace() - 1.0));
    if sine > 1e-12 { axis * (angle / (2.0 * sine)) } else { axis * 0.5 }
}

/// How fast the accelerometer pulls the attitude level, rad/s: slow against manoeuvres, fast against a gyro's drift.
const LEVELLING_RAD_S: f64 = 0.2;

/// Attitude from gyro and accelerometer by a complementary filter (Mahony et al., IEEE Trans. Automatic Control 53, 2008, without
/// its bias estimate): the gyro turns it, and where the specific force is near one g its direction pulls it level.
fn angles_of_gyro(t: &[f64], rates: [&[f64]; 3], force: [&[f64]; 3]) -> Vec<Vec<f64>> {
    let at = |of: &[&[f64]; 3], k: usize| Vector3::new(of[0][k], of[1][k], of[2][k]);
    let resting =
        (0..t.len()).map(|k| at(&force, k)).find(|f| f.iter().all(|v| v.is_finite()) && f.norm() > 1.0);
    let up = resting.map_or_else(|| -Vector3::z(), |f| f.normalize());
    let level = Vector3::new((-up.y).atan2(-up.z), up.x.clamp(-1.0, 1.0).asin(), 0.0);
    let mut q = frames::quaternion_from_euler(level);
    let mut angles = vec![Vec::new(); 3];
    for k in 0..t.len() {
        let euler = frames::euler_from_quaternion(&q);
        angles.iter_mut().zip(euler.iter()).for_each(|(angle, value)| angle.push(*value));
        let Some(next) = t.get(k + 1) else { break };
        let (mut rate, f) = (at(&rates, k), at(&force, k));
        if !rate.iter().all(|v| v.is_finite()) {
            continue;
        }
        if f.iter().all(|v| v.is_finite()) && (0.8..1.2).contains(&(f.norm() / 9.81)) {
            // Seen from the body, up is where the specific force of a craft at rest points.
            let estimated_up = -(frames::dcm_from_quaternion(&q) * Vector3::z());
            rate += LEVELLING_RAD_S * f.normalize().cross(&estimated_up);
        }
        q = (q + frames::quaternion_derivative(&q, &rate) * (next - t[k])).normalize();
    }
    angles
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.01;

    /// A craft that rocks and turns: attitude, rates and specific force of one motion.
    fn rocking(columns: &[Column]) -> Flight {
        let rows = 2000;
        let t: Vec<f64> = (0..rows).map(|k| STEP_S * f64::from(k)).collect();
        let angle =
            |t: f64| Vector3::new(0.2 * (1.3 * t).sin(), 0.15 * (0.9 * t).sin(), 0.4 * (0.5 * t).sin());
        let angle_rate =
            |t: f64| Vector3::new(0.26 * (1.3 * t).cos(), 0.135 * (0.9 * t).cos(), 0.2 * (0.5 * t).cos());
        let value = |column: Column, t: f64| {
            let euler = angle(t);
            let rate = frames::body_rates_from_euler(euler, angle_rate(t));
            let force = frames::dcm_from_euler(euler) * Vector3::new(0.0, 0.0, -9.81);
            let q = frames::quaternion_from_euler(euler);
            match column {
                Column::Phi | Column::Theta | Column::Psi => euler[column as usize - Column::Phi as usize],
                Column::P | Column::Q | Column::R => rate[column as usize - Column::P as usize],
                Column::Ax | Column::Ay | Column::Az => force[column as usize - Column::Ax as usize],
                Column::Qw | Column::Qx | Column::Qy | Column::Qz => q[column as usize - Column::Qw as usize],
                _ => 1.0,
            }
        };
        let others = columns.iter().map(|c| (*c, t.iter().map(|t| value(*c, *t)).collect()));
        Flight::from_columns("rocking", std::iter::once((Column::T, t.clone())).chain(others))
    }

    fn completed(columns: &[Column]) -> Result<Flight, String> {
        let mut flight = rocking(columns);
        flight.complete(Path::new("A.csv")).map_err(|error| error.to_string())?;
        Ok(flight)
    }

    fn largest_difference(a: &Flight, b: &Flight, columns: [Column; 3]) -> f64 {
        let of = |column| -> f64 {
            let pairs = a.required(column).iter().zip(b.required(column)).skip(1).take(1998);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        columns.map(of).into_iter().fold(0.0, f64::max)
    }

    #[test]
    fn a_quaternion_stands_for_angles_without_loss() {
        let flight = completed(&[&QUATERNION[..], &RATES, &SPEEDS, &FORCE].concat()).unwrap();
        let stand_ins = [
            StandIn::AnglesOfQuaternion,
            StandIn::RotorSpeeds,
            StandIn::ConstantVoltage,
            StandIn::NoPosition,
        ];
        assert_eq!(flight.stand_ins(), stand_ins);
        assert!(largest_difference(&flight, &rocking(&ANGLES), ANGLES) < 1e-12);
        assert_eq!(flight.required(Column::Cmd1), flight.required(Column::Omega1));
    }

    /// The second difference's error of a sine of 1.3 rad/s at 100 Hz is below 1e-5 of it.
    #[test]
    fn rates_are_those_of_the_attitude() {
        let columns = [&ANGLES[..], &COMMANDS, &FORCE].concat();
        let flight = completed(&columns).unwrap();
        assert!(flight.stand_ins().contains(&StandIn::RatesOfAttitude));
        assert!(largest_difference(&flight, &rocking(&RATES), RATES) < 2e-4);
    }

    /// At rest in the mean, the accelerometer shows where down is, and the gyro how the craft turns.
    #[test]
    fn an_attitude_comes_from_gyro_and_accelerometer() {
        let flight = completed(&[&RATES[..], &COMMANDS, &FORCE].concat()).unwrap();
        assert!(flight.stand_ins().contains(&StandIn::AnglesOfGyro));
        let error_rad = largest_difference(&flight, &rocking(&ANGLES), ANGLES);
        assert!(error_rad < 0.01, "{error_rad}");
    }

    #[test]
    fn half_a_group_and_nothing_in_its_place_are_refused_by_name() {
        let said = |columns: &[&[Column]]| completed(&columns.concat()).unwrap_err();
        let most = [Column::X, Column::Y, Column::Z];
        assert!(
            said(&[&ANGLES, &RATES[..2], &COMMANDS, &most]).contains(
                "column \"r\" is missing or has no values; the columns with values are t,x,y,z,phi"
            )
        );
        assert!(said(&[&ANGLES, &RATES, &most]).contains("no rotor speeds (omega1..omega4) in its place"));
        assert!(said(&[&ANGLES, &RATES, &COMMANDS]).contains("no accelerometer (ax, ay, az) in its place"));
        assert!(said(&[&RATES, &COMMANDS, &most]).contains("no quaternion (qw, qx, qy, qz)"));
    }

    #[test]
    fn what_stands_in_is_not_written_to_a_file() {
        let flight = completed(&[&ANGLES[..], &COMMANDS, &FORCE].concat()).unwrap();
        let text = flight.to_csv();
        assert_eq!(text.lines().next().unwrap(), "t,phi,theta,psi,cmd1,cmd2,cmd3,cmd4,ax,ay,az");
    }
}
