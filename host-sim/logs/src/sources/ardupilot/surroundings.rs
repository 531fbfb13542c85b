//! What the log says of the craft, the air and gravity.

use crate::log::Log;
use crate::recording::{Recording, Span};

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
    const GAS_CONSTANT: f64 = 287.05;
    const ZERO_CELSIUS_K: f64 = 273.15;
    /// -40 degrees at sea level down to 5 km.
    const DENSITIES: std::ops::Range<f64> = 0.5..1.6;
    let rows = Rows::first_instance(log.table("BARO")?);
    let (pressure_pa, celsius) = (median(rows.column("Press")?)?, median(rows.column("Temp")?)?);
    Some(pressure_pa / (GAS_CONSTANT * (celsius + ZERO_CELSIUS_K)))
        .filter(|density| DENSITIES.contains(density))
}

/// Gravity at the latitude and height where the first GPS had a fix, m/s^2.
fn gravity(log: &Log) -> Option<f64> {
    const FIX_3D: f64 = 3.0;
    let table = log.table("GPS")?;
    let status = table.column("Status")?.to_f64();
    let rows = Rows::of(table, |row| status.get(row).is_some_and(|status| *status >= FIX_3D));
    let (latitude, height_m) = (median(rows.column("Lat")?)?, median(rows.column("Alt")?)?);
    let possible = latitude.abs() <= 90.0 && (-1000.0..20_000.0).contains(&height_m);
    possible.then(|| normal_gravity(latitude.to_radians(), height_m))
}

/// WGS84's gravity on the ellipsoid (Somigliana), less what height takes.
fn normal_gravity(latitude: f64, height_m: f64) -> f64 {
    const AT_EQUATOR: f64 = 9.780_325_335_9;
    const K: f64 = 0.001_931_852_652_41;
    const ECCENTRICITY_SQUARED: f64 = 0.006_694_379_990_13;
    const PER_METRE: f64 = 3.086e-6;
    let sine_squared = latitude.sin().powi(2);
    AT_EQUATOR * (1.0 + K * sine_squared) / (1.0 - ECCENTRICITY_SQUARED * sine_squared).sqrt()
        - PER_METRE * height_m
}

/// Median of what is finite.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that NIMA TR8350.2 prints: equator 9.7803253359, poles 9.8321849378.
    #[test]
    fn gravity_of_the_ellipsoid() {
        assert!((normal_gravity(0.0, 0.0) - 9.780_325_335_9).abs() < 1e-9);
        assert!((normal_gravity(90.0_f64.to_radians(), 0.0) - 9.832_184_937_8).abs() < 1e-8);
    }
}
