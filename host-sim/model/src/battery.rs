//! A battery that decays and sags under load.

use serde::{Deserialize, Serialize};

/// Terminal voltage as a function of time and rotor load.
///
/// A lithium-polymer pack in mid-discharge: a straight fall with time, and a sag in proportion to the current, which
/// follows the rotors' power, that is the cube of their speed. The thesis left both out of its simulation and
/// found that "performance is heavily dependent on battery voltage" (section 5.6).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Battery {
    /// Voltage at rest at time zero, V.
    pub full_v: f64,
    /// Fall with time, V/s.
    pub decay_v_per_s: f64,
    /// Sag at hover load, V.
    pub hover_sag_v: f64,
    /// Rotor speed that counts as hover load, rad/s.
    pub hover_speed_rad_s: f64,
}

impl Battery {
    /// A constant voltage.
    pub fn constant(volts: f64) -> Self {
        Self { full_v: volts, decay_v_per_s: 0.0, hover_sag_v: 0.0, hover_speed_rad_s: 1.0 }
    }

    /// Terminal voltage at `time_s` with rotors at `rotor_rad_s`.
    #[inline]
    pub fn voltage_v(&self, time_s: f64, rotor_rad_s: &[f64; 4]) -> f64 {
        if self.hover_sag_v == 0.0 {
            return self.full_v - self.decay_v_per_s * time_s;
        }
        let load: f64 = rotor_rad_s.iter().map(|w| (w / self.hover_speed_rad_s).powi(3)).sum::<f64>() * 0.25;
        self.full_v - self.decay_v_per_s * time_s - self.hover_sag_v * load
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voltage_falls_with_time_and_load() {
        let battery =
            Battery { full_v: 12.4, decay_v_per_s: 0.01, hover_sag_v: 0.5, hover_speed_rad_s: 635.0 };
        assert!((battery.voltage_v(0.0, &[635.0; 4]) - 11.9).abs() < 1e-12);
        assert!((battery.voltage_v(10.0, &[0.0; 4]) - 12.3).abs() < 1e-12);
        assert_eq!(Battery::constant(11.1).voltage_v(60.0, &[900.0; 4]), 11.1);
    }
}
