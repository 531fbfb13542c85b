//! From recorded telemetry to flight files: what identification reads.
//!
//! A flight is a stretch in which the craft flies (flying, hold or land), from the first to the
//! last row in which it is more than [`IN_THE_AIR_M`] above where it stood: on the floor other
//! forces act. Rows are the craft's ticks, `t` its own clock from the first row on, columns as the
//! craft told them (thesis 4.2.3: everything goes through the COM, so that it is in step with the
//! law): poses as they were flown with, the gyro's rates, motor commands, voltage, and the
//! accelerometer if there is one. Nothing is put on another grid: these rows are what the law flew with.
//!
//! A pose that the craft flew with once more because no new one had come is a missing value, not a
//! measurement. A craft without a gyro has the rates from motion capture instead.

use std::path::Path;

use flights::{Column, Flight};
use proto::{State, Telemetry, Unwrapped};

use crate::error::LogError;
use crate::log::Log;

/// Higher than this above where it stood, the craft flies, m.
const IN_THE_AIR_M: f64 = 0.1;
/// Fewer rows than this are not a flight.
const SHORTEST: usize = 50;

/// Cuts telemetry into flights.
#[derive(Debug, Clone, Default)]
pub struct FlightCutter {
    clock: Unwrapped,
    /// Where the craft stood last, z in m.
    floor_z_m: Option<f64>,
    rows: Vec<(i64, Telemetry)>,
    flights: Vec<OwnFlight>,
}

/// A flight of quadlab's own recording.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnFlight {
    /// Its rows; times start at zero.
    pub flight: Flight,
    /// Time of the first row on the craft's clock, s.
    pub start_s: f64,
}

/// All flights in quadlab's own recording; nothing where the log is of another program.
pub(crate) fn own_flights(log: &Log, path: &Path) -> Result<Option<Vec<OwnFlight>>, LogError> {
    let is_own = |name: &str| name.starts_with("quadlab.");
    if !log.tables.iter().any(|table| table.message_type.as_deref().is_some_and(is_own)) {
        return Ok(None);
    }
    if log.telemetry.is_empty() {
        let reason = "is a recording of quadlab's own ground station in which the craft was never heard: \
             there is no flight in it"
            .into();
        return Err(LogError::Refused { path: path.into(), reason });
    }
    let mut cutter = FlightCutter::default();
    log.telemetry.iter().for_each(|telemetry| cutter.push(telemetry));
    Ok(Some(cutter.finish()))
}

impl FlightCutter {
    /// The next telemetry message.
    pub fn push(&mut self, telemetry: &Telemetry) {
        let time_us = self.clock.push(telemetry.craft_us);
        if !matches!(telemetry.supervision.state, State::Flying | State::Hold | State::Land) {
            self.cut();
            self.floor_z_m = Some(height(telemetry)).filter(|z| z.is_finite());
            return;
        }
        // A craft that was restarted, or messages out of order, are the end of a flight.
        if self.rows.last().is_some_and(|(last, _)| time_us <= *last || time_us > last + 10_000_000) {
            self.cut();
        }
        self.rows.push((time_us, *telemetry));
    }

    /// A flight may end here.
    fn cut(&mut self) {
        let mut rows = std::mem::take(&mut self.rows);
        let up = |(_, row): &(i64, Telemetry)| {
            self.floor_z_m.is_none_or(|floor_z_m| floor_z_m - height(row) > IN_THE_AIR_M)
        };
        let first = rows.iter().position(up).unwrap_or(rows.len());
        let last = rows.iter().rposition(up).map_or(first, |k| k + 1);
        rows.truncate(last);
        rows.drain(..first.min(last));
        if rows.len() >= SHORTEST {
            let name = format!("flight {}", self.flights.len() + 1);
            let start_s = rows[0].0 as f64 / 1e6;
            self.flights.push(OwnFlight { flight: flight(name, &rows), start_s });
        }
    }

    /// All flights, the one that was going on when the log ended among them.
    pub fn finish(mut self) -> Vec<OwnFlight> {
        self.cut();
        self.flights
    }
}

/// Down, m.
fn height(telemetry: &Telemetry) -> f64 {
    let [_, _, z] = telemetry.tracked.position_m;
    f64::from(z)
}

/// The number that the digits say which were recorded: 0.1, not 0.10000000149.
fn recorded(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::NAN)
}

fn flight(name: String, rows: &[(i64, Telemetry)]) -> Flight {
    use Column::*;
    let start_us = rows.first().map_or(0, |(time_us, _)| *time_us);
    let column = |value: &dyn Fn(&Telemetry) -> f32| {
        rows.iter().map(|(_, row)| recorded(value(row))).collect::<Vec<f64>>()
    };
    let pose = |value: &dyn Fn(&Telemetry) -> f32| {
        let mut values = column(value);
        for k in 1..rows.len() {
            if rows[k].1.tracked == rows[k - 1].1.tracked {
                values[k] = f64::NAN;
            }
        }
        values
    };
    let has_gyro = rows.iter().any(|(_, row)| row.imu.is_some());
    let rate = |row: &Telemetry, axis: usize| {
        if has_gyro {
            row.imu.map_or(f32::NAN, |imu| imu.gyro_rad_s[axis])
        } else {
            row.tracked_rates_rad_s[axis]
        }
    };
    let time = rows.iter().map(|(time_us, _)| (time_us - start_us) as f64 / 1e6).collect();
    let mut columns = vec![(T, time), (Vbat, column(&|row| row.battery_v))];
    for (k, name) in [X, Y, Z].into_iter().enumerate() {
        columns.push((name, pose(&|row| row.tracked.position_m[k])));
    }
    for (k, name) in [Phi, Theta, Psi].into_iter().enumerate() {
        columns.push((name, pose(&|row| row.tracked.attitude_rad[k])));
    }
    for (k, name) in [P, Q, R].into_iter().enumerate() {
        columns.push((name, column(&|row| rate(row, k))));
    }
    for (k, name) in [Cmd1, Cmd2, Cmd3, Cmd4].into_iter().enumerate() {
        columns.push((name, column(&|row| row.pwm[k])));
    }
    let acceleration = |row: &Telemetry| row.imu.and_then(|imu| imu.acceleration_m_s2);
    if rows.iter().any(|(_, row)| acceleration(row).is_some()) {
        for (k, name) in [Ax, Ay, Az].into_iter().enumerate() {
            columns.push((name, column(&|row| acceleration(row).map_or(f32::NAN, |a| a[k]))));
        }
    }
    Flight::from_columns(name, columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::{Counters, ImuSample, Mode, Pose, Refusal, Supervision};

    fn row(craft_us: u32, state: State, z: f32, imu: Option<ImuSample>) -> Telemetry {
        Telemetry {
            tick: 0,
            craft_us,
            ground_us: 0,
            supervision: Supervision { state, conditions: 0, preflight: 0 },
            mode: Mode::Position,
            attitude_command_rad: [0.0; 3],
            z_command_m: 0.0,
            tracked: Pose { position_m: [1.0, 2.0, z], attitude_rad: [0.1, 0.2, 0.3] },
            tracked_rates_rad_s: [7.0, 8.0, 9.0],
            imu,
            thrust: 0.0,
            torque: [0.0; 3],
            pwm: [1500.0, 1501.0, 1502.0, 1503.0],
            refused: Refusal::default(),
            battery_v: 11.25,
            current_a: None,
            counters: Counters::default(),
        }
    }

    fn imu() -> Option<ImuSample> {
        let acceleration_m_s2 = Some([0.0, 0.0, -9.8]);
        Some(ImuSample { gyro_rad_s: [0.01, 0.02, 0.03], attitude_rad: None, acceleration_m_s2 })
    }

    /// Two flights from a floor at z = 0.05, the clock wrapping in the first; a hop of 20 rows
    /// between them is none.
    #[test]
    fn flights_are_what_happens_in_the_air() {
        let mut cutter = FlightCutter::default();
        let mut clock_us = u32::MAX - 600_000;
        let mut fly = |state: State, z: f32, count: u32| {
            for k in 0..count {
                clock_us = clock_us.wrapping_add(10_000);
                cutter.push(&row(clock_us, state, z - k as f32 * 1e-5, imu()));
            }
        };
        fly(State::Disarmed, 0.05, 10);
        fly(State::Armed, 0.05, 10);
        fly(State::Flying, 0.04, 10);
        fly(State::Flying, -1.0, 80);
        fly(State::Land, -0.5, 20);
        fly(State::Land, 0.0, 5);
        fly(State::Disarmed, 0.05, 5);
        fly(State::Flying, -1.0, 20);
        fly(State::Disarmed, 0.05, 5);
        fly(State::Hold, -1.0, 60);
        let flights = cutter.finish();
        let [OwnFlight { flight: first, .. }, OwnFlight { flight: second, .. }] = &flights[..] else {
            panic!("{} flights", flights.len())
        };
        assert_eq!((first.len(), second.len()), (100, 60));
        let column = |flight: &Flight, column| flight.column(column).unwrap().to_vec();
        assert_eq!(column(first, Column::T)[..3], [0.0, 0.01, 0.02]);
        assert_eq!(column(first, Column::T)[99], 0.99);
        assert_eq!(column(first, Column::Cmd3)[5], 1502.0);
        assert_eq!(column(first, Column::Az)[5], -9.8);
        assert_eq!(column(first, Column::Q)[5], 0.02);
        let text = first.to_csv();
        assert_eq!(&Flight::parse(text.as_bytes(), std::path::Path::new("flight 1")).unwrap(), first);
    }

    #[test]
    fn a_pose_flown_with_again_is_a_missing_value() {
        let mut cutter = FlightCutter::default();
        for k in 0..60_u32 {
            let z = -1.0 - (k / 2) as f32 * 0.01;
            cutter.push(&row(k * 10_000, State::Flying, z, None));
        }
        let flights = cutter.finish();
        let z = flights[0].flight.column(Column::Z).unwrap();
        assert!((0..60).all(|k| z[k].is_nan() == (k % 2 == 1)), "{z:?}");
        assert_eq!(
            flights[0].flight.column(Column::R).unwrap()[1],
            9.0,
            "without a gyro, rates from motion capture"
        );
        assert!(flights[0].flight.column(Column::Ax).is_none());
    }

    #[test]
    fn a_restarted_craft_is_another_flight() {
        let mut cutter = FlightCutter::default();
        for start_us in [5_000_000, 0] {
            for k in 0..60_u32 {
                cutter.push(&row(start_us + k * 10_000, State::Flying, -1.0 - k as f32 * 1e-3, imu()));
            }
        }
        assert_eq!(cutter.finish().len(), 2);
    }
}
