//! What cannot be right in a flight: values missing, time going back, another unit.

use std::path::Path;

use model::Vehicle;

use crate::columns::{COLUMNS, Column};
use crate::error::FlightError;
use crate::flight::Flight;
use crate::sampling::median_step;
use crate::stand_in::StandIn;

impl Flight {
    /// Times that are missing or go back.
    pub(crate) fn check_times(&self, path: &Path) -> Result<(), FlightError> {
        let t = self.required(Column::T);
        if let Some(row) = t.iter().position(|t| !t.is_finite()) {
            let (row, column, text) = (row + 2, "t".to_owned(), String::new());
            return Err(FlightError::Field { path: path.into(), row, column, text });
        }
        if let Some(k) = t.windows(2).position(|w| w[1] <= w[0]) {
            let (before, after) = (t[k], t[k + 1]);
            return Err(FlightError::Time { path: path.into(), row: k + 3, before, after });
        }
        if t.len() < 2 {
            return Err(FlightError::TooShort { path: path.into(), rows: t.len() });
        }
        Ok(())
    }

    /// What cannot be right whatever the vehicle: columns in another unit.
    pub(crate) fn check_units(&self, path: &Path) -> Result<(), FlightError> {
        let refuse = |column: &str, observed: String, advice| {
            Err(FlightError::Unit { path: path.into(), column: column.into(), observed, advice })
        };
        let t = self.required(Column::T);
        let period = median_step(t);
        if !(0.0005..0.2).contains(&period) {
            let advice = "seconds are expected at 5 to 2000 samples a second; divide milliseconds by 1000";
            return refuse("t", format!("steps by {period}"), advice);
        }
        let largest = |column: Column| {
            self.required(column).iter().filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()))
        };
        for column in [Column::Phi, Column::Theta] {
            let peak = largest(column);
            if peak > 3.3 {
                let advice = "radians are expected; these look like degrees: multiply by pi/180";
                return refuse(COLUMNS[column as usize], format!("reaches {peak}"), advice);
            }
        }
        for column in [Column::X, Column::Y, Column::Z] {
            let (low, high) = finite_range(self.required(column));
            if high - low > 500.0 {
                let advice = "metres are expected; these look like millimetres: divide by 1000";
                return refuse(COLUMNS[column as usize], format!("ranges over {}", high - low), advice);
            }
        }
        for (rate, angle) in [(Column::P, Column::Phi), (Column::Q, Column::Theta)] {
            let factor = rate_factor(t, self.required(angle), self.required(rate));
            if factor.is_some_and(|f| f > 20.0) {
                let advice = "radians per second are expected; these look like degrees per second";
                let observed = format!("is {:.0} times the rate of the attitude", factor.unwrap_or(0.0));
                return refuse(COLUMNS[rate as usize], observed, advice);
            }
        }
        let volts = largest(Column::Vbat);
        if volts > 200.0 {
            let advice = "volts are expected; divide millivolts by 1000";
            return refuse("vbat", format!("reaches {volts}"), advice);
        }
        Ok(())
    }

    /// What cannot be right for this vehicle: commands in another unit, no voltage where the motors' map needs it.
    pub fn check_against(&self, vehicle: &Vehicle, path: &Path) -> Result<(), FlightError> {
        if self.stand_ins.contains(&StandIn::RotorSpeeds) {
            return Ok(());
        }
        let maps_speeds = self.column(Column::Omega1).is_none();
        if self.stand_ins.contains(&StandIn::ConstantVoltage)
            && maps_speeds
            && vehicle.rotor_map().voltage != 0.0
        {
            return Err(FlightError::VoltageNeeded { path: path.into(), vehicle: vehicle.name.clone() });
        }
        let [low, high] = vehicle.motors.command_range;
        let margin = 0.25 * (high - low);
        for column in [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4] {
            let mut sorted: Vec<f64> =
                self.required(column).iter().copied().filter(|v| v.is_finite()).collect();
            sorted.sort_by(f64::total_cmp);
            let Some(&median) = sorted.get(sorted.len() / 2) else { continue };
            if !(low - margin..=high + margin).contains(&median) {
                return Err(FlightError::Unit {
                    path: path.into(),
                    column: COLUMNS[column as usize].into(),
                    observed: format!(
                        "has the median {median}, the vehicle \"{}\" takes {low} to {high} {}",
                        vehicle.name, vehicle.motors.command_unit
                    ),
                    advice: "use the vehicle file that belongs to the flight, or convert the commands to its unit",
                });
            }
        }
        Ok(())
    }
}

fn finite_range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)))
}

/// How much larger a logged rate is than the rate of change of the angle; nothing when the craft
/// hardly turned.
fn rate_factor(t: &[f64], angle: &[f64], rate: &[f64]) -> Option<f64> {
    const SPAN: usize = 10;
    let (mut logged, mut differenced) = (0.0, 0.0);
    for k in (0..t.len().saturating_sub(SPAN)).step_by(SPAN) {
        let turn = (angle[k + SPAN] - angle[k]) / (t[k + SPAN] - t[k]);
        let mean = rate[k..k + SPAN].iter().sum::<f64>() / SPAN as f64;
        if turn.is_finite() && mean.is_finite() && turn.abs() < 20.0 {
            logged += mean * turn;
            differenced += turn * turn;
        }
    }
    (differenced > 1e-3).then(|| logged / differenced)
}
