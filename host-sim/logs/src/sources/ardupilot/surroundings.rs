//! What the log says of the craft, the air and gravity.

use crate::log::Log;
use crate::recording::{Recording, Span};
use crate::statistics::median;

use super::super::common::surroundings::{self, DENSITIES};
use super::rows::Rows;
use super::vehicle::Layout;

/// Fills in the hints.
pub(super) fn hints(log: &Log, layout: &Layout, range: Span, recording: &mut Recording) {
    let hints = &mut recording.hints;
    hints.spin = Some(layout.spin);
    hints.command_range = Some(range);
    hints.command_unit = Some("us".into());
    hints.air_density = air_density(log);
    hints.gravity = gravity(log);
}

/// Air density by the gas law from the first barometer, kg/m^3.
fn air_density(log: &Log) -> Option<f64> {
    let rows = Rows::first_instance(log.table("BARO")?);
    let (pressure_pa, celsius) = (median(rows.column("Press")?)?, median(rows.column("Temp")?)?);
    Some(surroundings::air_density(pressure_pa, celsius)).filter(|density| DENSITIES.contains(density))
}

/// Gravity at the latitude and height where the first GPS had a fix, m/s^2.
fn gravity(log: &Log) -> Option<f64> {
    const FIX_3D: f64 = 3.0;
    let table = log.table("GPS")?;
    let status = table.column("Status")?.to_f64();
    let rows = Rows::of(table, |row| status.get(row).is_some_and(|status| *status >= FIX_3D));
    let (latitude, height_m) = (median(rows.column("Lat")?)?, median(rows.column("Alt")?)?);
    surroundings::gravity(latitude, height_m)
}
