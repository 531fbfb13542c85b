//! Air and gravity, by what craft measure of where they are.

/// Densities that a craft can meet, kg/m^3: -40 degrees at sea level down to 5 km.
pub(in crate::sources) const DENSITIES: std::ops::Range<f64> = 0.5..1.6;

/// Air density by the gas law, kg/m^3.
pub(in crate::sources) fn air_density(pressure_pa: f64, celsius: f64) -> f64 {
    const GAS_CONSTANT: f64 = 287.05;
    const ZERO_CELSIUS_K: f64 = 273.15;
    pressure_pa / (GAS_CONSTANT * (celsius + ZERO_CELSIUS_K))
}

/// Gravity at a latitude and a height over the ellipsoid, m/s^2; nothing for places where no craft can be.
pub(in crate::sources) fn gravity(latitude_deg: f64, height_m: f64) -> Option<f64> {
    let possible = latitude_deg.abs() <= 90.0 && (-1000.0..20_000.0).contains(&height_m);
    possible.then(|| normal_gravity(latitude_deg.to_radians(), height_m))
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
