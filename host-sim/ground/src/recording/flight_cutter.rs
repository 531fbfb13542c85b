//! From recorded telemetry to flight files: what identification reads.
//!
//! A flight is a stretch in which the craft flies (flying, hold or land), from the first to the
//! last row in which it is more than [`IN_THE_AIR_M`] above where it stood: on the floor other
//! forces act. Rows are the craft's ticks, `t` its own clock from the first row on, columns as the
//! craft told them (thesis 4.2.3: everything goes through the COM, so that it is in step with the
//! law): poses as they were flown with, the gyro's rates, motor commands, voltage, and the
//! accelerometer if there is one.
//!
//! A pose that the craft flew with once more because no new one had come is a missing value, not a
//! measurement. A craft without a gyro has the rates from motion capture instead.

use flights::{Column, Flight};
use serde_json::Value;

use crate::link::Unwrapped;

/// Higher than this above where it stood, the craft flies, m.
pub const IN_THE_AIR_M: f64 = 0.1;
/// Fewer rows than this are not a flight.
const SHORTEST: usize = 50;

#[derive(Debug, Clone, Copy)]
struct Row {
    time_us: i64,
    pose: [f64; 6],
    gyro: Option<[f64; 3]>,
    rates: [f64; 3],
    acceleration: Option<[f64; 3]>,
    pwm: [f64; 4],
    battery_v: f64,
}

/// Cuts telemetry into flights.
#[derive(Debug, Clone, Default)]
pub struct FlightCutter {
    clock: Unwrapped,
    /// Where the craft stood last, z in m.
    floor_z_m: Option<f64>,
    rows: Vec<Row>,
    flights: Vec<Flight>,
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    value.as_array()?;
    Some(std::array::from_fn(|k| number(&value[k])))
}

impl FlightCutter {
    /// The next telemetry message, as JSON.
    pub fn push(&mut self, telemetry: &Value) {
        let none = f64::NAN;
        let Some(craft_us) = telemetry["craft_us"].as_u64().and_then(|us| u32::try_from(us).ok()) else {
            return;
        };
        let time_us = self.clock.push(craft_us);
        let position = numbers(&telemetry["tracked"]["position_m"]).unwrap_or([none; 3]);
        let attitude = numbers(&telemetry["tracked"]["attitude_rad"]).unwrap_or([none; 3]);
        let ([x, y, z], [phi, theta, psi]) = (position, attitude);
        if !matches!(telemetry["supervision"]["state"].as_str(), Some("Flying" | "Hold" | "Land")) {
            self.cut();
            self.floor_z_m = Some(z).filter(|z| z.is_finite());
            return;
        }
        // A craft that was restarted, or messages out of order, are the end of a flight.
        if self.rows.last().is_some_and(|last| time_us <= last.time_us || time_us > last.time_us + 10_000_000)
        {
            self.cut();
        }
        self.rows.push(Row {
            time_us,
            pose: [x, y, z, phi, theta, psi],
            gyro: numbers(&telemetry["imu"]["gyro_rad_s"]),
            rates: numbers(&telemetry["tracked_rates_rad_s"]).unwrap_or([none; 3]),
            acceleration: numbers(&telemetry["imu"]["acceleration_m_s2"]),
            pwm: numbers(&telemetry["pwm"]).unwrap_or([none; 4]),
            battery_v: number(&telemetry["battery_v"]),
        });
    }

    /// A flight may end here.
    fn cut(&mut self) {
        let mut rows = std::mem::take(&mut self.rows);
        let up = |row: &Row| {
            let [_, _, z, ..] = row.pose;
            self.floor_z_m.is_none_or(|floor_z_m| floor_z_m - z > IN_THE_AIR_M)
        };
        let first = rows.iter().position(up).unwrap_or(rows.len());
        let last = rows.iter().rposition(up).map_or(first, |k| k + 1);
        rows.truncate(last);
        rows.drain(..first.min(last));
        if rows.len() >= SHORTEST {
            let name = format!("flight {}", self.flights.len() + 1);
            self.flights.push(flight(name, &rows));
        }
    }

    /// All flights, the one that was going on when the log ended among them.
    pub fn finish(mut self) -> Vec<Flight> {
        self.cut();
        self.flights
    }
}

fn flight(name: String, rows: &[Row]) -> Flight {
    let start_us = rows.first().map_or(0, |row| row.time_us);
    let repeated = |k: usize| k > 0 && rows[k].pose == rows[k - 1].pose;
    let column = |value: &dyn Fn(&Row) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let pose = |axis: usize| {
        let value = |(k, row): (usize, &Row)| if repeated(k) { f64::NAN } else { row.pose[axis] };
        rows.iter().enumerate().map(value).collect::<Vec<f64>>()
    };
    let has_gyro = rows.iter().any(|row| row.gyro.is_some());
    let rate = |axis: usize| {
        column(&|row: &Row| {
            if has_gyro { row.gyro.map_or(f64::NAN, |gyro| gyro[axis]) } else { row.rates[axis] }
        })
    };
    let pwm = |motor: usize| column(&|row: &Row| row.pwm[motor]);
    let mut columns = vec![
        (Column::T, column(&|row: &Row| (row.time_us - start_us) as f64 / 1e6)),
        (Column::X, pose(0)),
        (Column::Y, pose(1)),
        (Column::Z, pose(2)),
        (Column::Phi, pose(3)),
        (Column::Theta, pose(4)),
        (Column::Psi, pose(5)),
        (Column::P, rate(0)),
        (Column::Q, rate(1)),
        (Column::R, rate(2)),
        (Column::Cmd1, pwm(0)),
        (Column::Cmd2, pwm(1)),
        (Column::Cmd3, pwm(2)),
        (Column::Cmd4, pwm(3)),
        (Column::Vbat, column(&|row: &Row| row.battery_v)),
    ];
    if rows.iter().any(|row| row.acceleration.is_some()) {
        for (k, axis) in [Column::Ax, Column::Ay, Column::Az].into_iter().enumerate() {
            columns.push((axis, column(&|row: &Row| row.acceleration.map_or(f64::NAN, |a| a[k]))));
        }
    }
    Flight::from_columns(name, columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    fn row(craft_us: u32, state: &str, z: f64, imu: Value) -> Value {
        json!({
            "craft_us": craft_us, "supervision": { "state": state },
            "tracked": { "position_m": [1.0, 2.0, z], "attitude_rad": [0.1, 0.2, 0.3] },
            "tracked_rates_rad_s": [7.0, 8.0, 9.0], "imu": imu,
            "pwm": [1500.0, 1501.0, 1502.0, 1503.0], "battery_v": 11.25,
        })
    }

    fn imu() -> Value {
        json!({ "gyro_rad_s": [0.01, 0.02, 0.03], "attitude_rad": null, "acceleration_m_s2": [0.0, 0.0, -9.8] })
    }

    /// Two flights from a floor at z = 0.05, the clock wrapping in the first; a hop of 20 rows
    /// between them is none.
    #[test]
    fn flights_are_what_happens_in_the_air() {
        let mut cutter = FlightCutter::default();
        let mut clock_us = u32::MAX - 600_000;
        let mut fly = |state: &str, z: f64, count: u32| {
            for k in 0..count {
                clock_us = clock_us.wrapping_add(10_000);
                cutter.push(&row(clock_us, state, z - f64::from(k) * 1e-6, imu()));
            }
        };
        fly("Disarmed", 0.05, 10);
        fly("Armed", 0.05, 10);
        fly("Flying", 0.04, 10);
        fly("Flying", -1.0, 80);
        fly("Land", -0.5, 20);
        fly("Land", 0.0, 5);
        fly("Disarmed", 0.05, 5);
        fly("Flying", -1.0, 20);
        fly("Disarmed", 0.05, 5);
        fly("Hold", -1.0, 60);
        let flights = cutter.finish();
        let [first, second] = &flights[..] else { panic!("{} flights", flights.len()) };
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
            let z = -1.0 - f64::from(k / 2) * 0.01;
            cutter.push(&row(k * 10_000, "Flying", z, Value::Null));
        }
        let flights = cutter.finish();
        let z = flights[0].column(Column::Z).unwrap();
        assert!((0..60).all(|k| z[k].is_nan() == (k % 2 == 1)), "{z:?}");
        assert_eq!(
            flights[0].column(Column::R).unwrap()[1],
            9.0,
            "without a gyro, rates from motion capture"
        );
        assert!(flights[0].column(Column::Ax).is_none());
    }

    #[test]
    fn a_restarted_craft_is_another_flight() {
        let mut cutter = FlightCutter::default();
        for start_us in [5_000_000, 0] {
            for k in 0..60_u32 {
                cutter.push(&row(start_us + k * 10_000, "Flying", -1.0 - f64::from(k) * 1e-3, imu()));
            }
        }
        assert_eq!(cutter.finish().len(), 2);
    }

    proptest! {
        #[test]
        fn no_json_panics(words in prop::collection::vec(("[a-z_]{1,12}", any::<i64>()), 0..6), craft_us: u32) {
            let mut cutter = FlightCutter::default();
            let mut value: Value = words.into_iter().map(|(k, v)| (k, json!(v))).collect::<serde_json::Map<_, _>>().into();
            cutter.push(&value);
            value["craft_us"] = craft_us.into();
            value["supervision"] = json!({ "state": "Flying" });
            value["imu"] = json!([1, 2]);
            value["pwm"] = json!("none");
            for _ in 0..60 {
                cutter.push(&value);
            }
            let _ = cutter.finish();
        }
    }
}
