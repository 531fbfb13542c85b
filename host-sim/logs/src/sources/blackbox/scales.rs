//! What a count of each field is worth, by the header and the version.

use std::f64::consts::PI;

use crate::log::Log;
use crate::recording::Span;

/// Scales of a log's fields.
#[derive(Debug)]
pub(super) struct Scales {
    /// rad/s.
    pub(super) gyro_rad_s: Option<f64>,
    /// Counts for the acceleration of gravity.
    pub(super) acceleration_per_g: Option<f64>,
    /// Volts of a count of `vbatLatest`, and of `vbat`.
    pub(super) volts: [f64; 2],
    /// Rotor speed of a count of eRPM, rad/s.
    pub(super) speed_rad_s: Option<f64>,
    /// Lowest and highest motor command.
    pub(super) motor_range: Option<Span>,
}

impl Scales {
    /// Scales of one log of a file.
    pub(super) fn new(log: &Log, name: &str) -> Self {
        let text = |key: &str| log.information.get(&format!("{name}: {key}")).map(String::as_str);
        let number = |key: &str| {
            text(key).and_then(|text| text.trim().parse::<f64>().ok()).filter(|number| number.is_finite())
        };
        let version = Version::of(text("Firmware revision").unwrap_or_default());
        // Ten counts each where the log was set to be finer.
        let resolution = if number("blackbox_high_resolution") == Some(1.0) { 0.1 } else { 1.0 };
        Self {
            gyro_rad_s: gyro_degrees_s(&text).map(|degrees| (degrees * resolution).to_radians()),
            acceleration_per_g: number("acc_1G").filter(|per_g| *per_g > 0.0),
            volts: [version.volts(number("vbat_scale").or(number("vbatscale"))), HUNDREDTH],
            speed_rad_s: number("motor_poles")
                .filter(|poles| *poles >= 2.0)
                .map(|poles| 100.0 * 2.0 * PI / 60.0 / (poles / 2.0)),
            motor_range: text("motorOutput")
                .and_then(range)
                .or_else(|| Some([number("minthrottle")?, number("maxthrottle")?]).filter(is_range)),
        }
    }

    /// Pulses are in us; digital commands have no unit.
    pub(super) fn motor_unit(&self) -> Option<&'static str> {
        self.motor_range.map(|[low, high]| if low >= 900.0 && high <= 2500.0 { "us" } else { "1" })
    }
}

/// Degrees a second of a count: a float's bits in hexadecimal.
fn gyro_degrees_s<'log>(text: &dyn Fn(&str) -> Option<&'log str>) -> Option<f64> {
    let float = |text: &str| {
        u32::from_str_radix(text.trim().trim_start_matches("0x"), 16)
            .ok()
            .map(|bits| f64::from(f32::from_bits(bits)))
    };
    let degrees = text("gyro_scale").and_then(float);
    // Baseflight's is in radians a microsecond.
    let old = || text("gyro.scale").and_then(float).map(|scale| (scale * 1e6).to_degrees());
    degrees.or_else(old).filter(|scale| scale.is_finite() && *scale > 0.0)
}

/// Two numbers separated by a comma.
fn range(text: &str) -> Option<Span> {
    let (low, high) = text.split_once(',')?;
    Some([low.trim().parse().ok()?, high.trim().parse().ok()?]).filter(is_range)
}

fn is_range([low, high]: &Span) -> bool {
    low.is_finite() && high.is_finite() && high > low
}

/// Volts of a count of INAV's `vbat`: taken for hundredths, for no source was found that states the unit.
const HUNDREDTH: f64 = 0.01;

/// The program and its version.
#[derive(Debug, PartialEq)]
enum Version {
    Betaflight([u32; 2]),
    Cleanflight([u32; 2]),
    Other,
}

impl Version {
    fn of(revision: &str) -> Self {
        let mut words = revision.split_whitespace();
        let numbers = |word: &str| {
            let mut parts = word.split('.').map(str::parse);
            Some([parts.next()?.ok()?, parts.next()?.ok()?])
        };
        match (words.next(), words.next().and_then(numbers)) {
            (Some("Betaflight"), Some(version)) => Self::Betaflight(version),
            (Some("Cleanflight"), Some(version)) => Self::Cleanflight(version),
            _ => Self::Other,
        }
    }

    /// Hundredths of a volt, tenths before Betaflight 4, and before Betaflight 3.1 and Cleanflight 2 what a
    /// converter of 12 bits and 3.3 V measures behind a divider of so many tenths, which INAV has kept:
    /// `src/flightlog_fields_presenter.js` and `vbatADCToMillivolts` of betaflight/blackbox-log-viewer.
    fn volts(&self, divider: Option<f64>) -> f64 {
        const USUAL_DIVIDER: f64 = 110.0;
        match self {
            Self::Betaflight(version) if *version >= [4, 0] => HUNDREDTH,
            Self::Betaflight(version) if *version >= [3, 1] => 0.1,
            Self::Cleanflight(version) if *version >= [2, 0] => 0.1,
            _ => 3.3 / 4095.0 * divider.filter(|tenths| *tenths > 0.0).unwrap_or(USUAL_DIVIDER) / 10.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_of_revisions() {
        assert_eq!(Version::of("Betaflight 4.2.11 (948ba6339) STM32F7X2"), Version::Betaflight([4, 2]));
        assert_eq!(Version::of("Betaflight 2025.12.0 (abc) STM32H743"), Version::Betaflight([2025, 12]));
        assert_eq!(Version::of("INAV 7.1.0 (abc) MATEKF405"), Version::Other);
        assert_eq!(Version::of("Cleanflight 2.4.0 (abc) SPRACINGF3"), Version::Cleanflight([2, 4]));
        let volts = |version: [u32; 2], divider| Version::Betaflight(version).volts(divider);
        assert_eq!([volts([4, 0], None), volts([3, 5], None)], [0.01, 0.1]);
        // A battery of 12 V behind a divider of 11 is 1.09 V at the converter.
        assert!((volts([3, 0], Some(110.0)) * 1354.0 - 12.0).abs() < 0.01);
        assert_eq!(Version::Other.volts(Some(110.0)), volts([2, 8], None));
    }
}
