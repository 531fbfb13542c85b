//! Air and gravity.

use crate::log::Log;

use super::topics::{instances, topic};

/// Densities that a craft can meet, kg/m^3: -40 degrees at sea level down to 5 km.
const DENSITIES: std::ops::Range<f64> = 0.5..1.6;

/// Air density, kg/m^3: PX4's own, else by the gas law from pressure and temperature.
pub(super) fn air_density(log: &Log) -> Option<f64> {
    const GAS_CONSTANT: f64 = 287.05;
    const ZERO_CELSIUS_K: f64 = 273.15;
    let median = |table: &str, column: &str| median(topic(log, table)?.column(column)?.to_f64());
    let plausible = |density: &f64| DENSITIES.contains(density);
    let law = |pressure_pa: f64, celsius: f64| pressure_pa / (GAS_CONSTANT * (celsius + ZERO_CELSIUS_K));
    let told = || median("vehicle_air_data", "rho");
    let by_air_data = || {
        let pressure_pa = median("vehicle_air_data", "baro_pressure_pa")?;
        let celsius = median("vehicle_air_data", "ambient_temperature")
            .or_else(|| median("vehicle_air_data", "baro_temp_celcius"))?;
        Some(law(pressure_pa, celsius))
    };
    let by_sensor = || {
        let pressure = median("sensor_baro", "pressure")?;
        // In millibar before version 1.14.
        let pressure_pa = if pressure < 2000.0 { pressure * 100.0 } else { pressure };
        Some(law(pressure_pa, median("sensor_baro", "temperature")?))
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
            median(fixed.map(|(value, _)| value * unit).collect())
        };
        // Degrees and metres; before version 1.15 1e-7 degrees and millimetres.
        let latitude = picked("latitude_deg", 1.0).or_else(|| picked("lat", 1e-7))?;
        let height_m =
            picked("altitude_ellipsoid_m", 1.0).or_else(|| picked("alt_ellipsoid", 1e-3)).unwrap_or(0.0);
        let possible = latitude.abs() <= 90.0 && (-1000.0..20_000.0).contains(&height_m);
        possible.then(|| normal_gravity(latitude.to_radians(), height_m))
    })
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

/// The middle of all finite values.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::normal_gravity;

    /// WGS84's published values at the equator, at 45 degrees and at the poles.
    #[test]
    fn gravity_of_the_ellipsoid() {
        for (degrees, gravity) in [(0.0_f64, 9.780_325_335_9), (45.0, 9.806_197_769), (90.0, 9.832_184_937_8)]
        {
            assert!((normal_gravity(degrees.to_radians(), 0.0) - gravity).abs() < 1e-8, "{degrees}");
        }
    }
}
