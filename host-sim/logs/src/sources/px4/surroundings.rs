//! Air and gravity.

use crate::log::Log;
use crate::statistics::median;

use super::super::common::surroundings::{self, DENSITIES};
use super::topics::{instances, topic};

/// Air density, kg/m^3: PX4's own, else by the gas law from pressure and temperature.
pub(super) fn air_density(log: &Log) -> Option<f64> {
    let median = |table: &str, column: &str| median(topic(log, table)?.column(column)?.to_f64());
    let plausible = |density: &f64| DENSITIES.contains(density);
    let told = || median("vehicle_air_data", "rho");
    let by_air_data = || {
        let pressure_pa = median("vehicle_air_data", "baro_pressure_pa")?;
        let celsius = median("vehicle_air_data", "ambient_temperature")
            .or_else(|| median("vehicle_air_data", "baro_temp_celcius"))?;
        Some(surroundings::air_density(pressure_pa, celsius))
    };
    let by_sensor = || {
        let pressure = median("sensor_baro", "pressure")?;
        // In millibar before version 1.14.
        let pressure_pa = if pressure < 2000.0 { pressure * 100.0 } else { pressure };
        Some(surroundings::air_density(pressure_pa, median("sensor_baro", "temperature")?))
    };
    told()
        .filter(plausible)
        .or_else(|| by_air_data().filter(plausible))
        .or_else(|| by_sensor().filter(plausible))
}

/// Gravity, m/s^2, at the latitude and height of the first GPS that has a fix.
pub(super) fn gravity(log: &Log) -> Option<f64> {
    ["vehicle_gps_position", "sensor_gps"].iter().flat_map(|name| instances(log, name)).find_map(|table| {
        const FIX_3D: f64 = 3.0;
        let picked = |column: &str, unit: f64| -> Option<f64> {
            let fixes = table.column("fix_type")?.to_f64();
            let values = table.column(column)?.to_f64();
            let fixed = values.iter().zip(fixes).filter(|(_, fix)| *fix >= FIX_3D);
            median(fixed.map(|(value, _)| value * unit))
        };
        // Degrees and metres; before version 1.15 1e-7 degrees and millimetres.
        let latitude = picked("latitude_deg", 1.0).or_else(|| picked("lat", 1e-7))?;
        let height_m =
            picked("altitude_ellipsoid_m", 1.0).or_else(|| picked("alt_ellipsoid", 1e-3)).unwrap_or(0.0);
        surroundings::gravity(latitude, height_m)
    })
}
