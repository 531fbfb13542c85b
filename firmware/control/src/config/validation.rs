//! Whether a configuration can be built and flown: the range of every number in it.

use crate::config::error::{ConfigError, Parameter};
use crate::config::gains::{Config, Estimation, InnerLoop, Law, Loops, Mixing, MotorMapParams, PositionLoop};
use crate::config::range_check::RangeCheck;

/// Greatest gain: beyond it an error of 1 overflows every motor's range by far.
const GAIN_MAX: f64 = 1e6;

impl Config {
    /// Is this a configuration that can be built and flown? (A mixing matrix is inverted, and
    /// refused, only at build.)
    ///
    /// # Errors
    /// The first parameter that is not finite or out of range, by name.
    pub fn check(&self) -> Result<(), ConfigError> {
        let top = RangeCheck { group: "" };
        top.within("sample_time_s", self.sample_time_s, 1e-4, 0.1)?;
        top.range("command_range", self.command_range)?;
        let limits = RangeCheck { group: "position_limits" };
        limits.range("x_m", self.position_limits.x_m)?;
        limits.range("y_m", self.position_limits.y_m)?;
        limits.range("z_m", self.position_limits.z_m)?;
        // Above half the sampling rate there is nothing to filter.
        let highest_rad_s = core::f64::consts::PI / self.sample_time_s;
        self.estimation.check(self.sample_time_s, highest_rad_s)?;
        self.supervision.check()?;
        match &self.law {
            Law::ModelBased(law) => {
                RangeCheck { group: "law" }.within("hover_thrust_n", law.hover_thrust_n, 1e-4, 1e5)?;
                law.mixing.check()?;
                law.motor_map.check()?;
                law.loops.check(highest_rad_s)
            }
            Law::HandTuned(law) => {
                if self.tilt_compensation {
                    let parameter = Parameter { group: "", name: "tilt_compensation" };
                    return Err(ConfigError::NotApplicable { parameter });
                }
                let [low, high] = self.command_range;
                RangeCheck { group: "law" }.within("hover_command", law.hover_command, low, high)?;
                law.loops.check(highest_rad_s)
            }
        }
    }
}

impl Estimation {
    fn check(&self, sample_time_s: f64, highest_rad_s: f64) -> Result<(), ConfigError> {
        let check = RangeCheck { group: "estimation" };
        let velocity = &self.velocity;
        // Two poles nearer to 1 than this are one with it in f32, and what is divided by their distance is no number.
        let lowest_rad_s = 1e-3 / sample_time_s;
        let natural_frequency_rad_s = velocity.natural_frequency_rad_s;
        check.within("natural_frequency_rad_s", natural_frequency_rad_s, lowest_rad_s, highest_rad_s)?;
        check.within("damping_ratio", velocity.damping_ratio, 0.05, 10.0)?;
        check.optional("corner_rad_s", self.gyro.map(|gyro| gyro.corner_rad_s), 1e-2, highest_rad_s)?;
        check.optional("gain", self.battery.map(|battery| battery.gain), 1e-6, 1.0)
    }
}

impl Loops {
    fn check(&self, highest_rad_s: f64) -> Result<(), ConfigError> {
        self.roll.check("roll", highest_rad_s)?;
        self.pitch.check("pitch", highest_rad_s)?;
        self.yaw.check("yaw", highest_rad_s)?;
        self.altitude.check("altitude", highest_rad_s)?;
        if self.altitude.canceller.is_some() {
            // The altitude loop has no place for one; silently leaving it out would be worse.
            let parameter = Parameter { group: "altitude", name: "canceller" };
            return Err(ConfigError::NotApplicable { parameter });
        }
        self.x.check("x", highest_rad_s)?;
        self.y.check("y", highest_rad_s)
    }
}

impl InnerLoop {
    fn check(&self, group: &'static str, highest_rad_s: f64) -> Result<(), ConfigError> {
        let check = RangeCheck { group };
        check.within("kp", self.kp, 0.0, GAIN_MAX)?;
        check.within("ki", self.ki, 0.0, GAIN_MAX)?;
        check.within("kd", self.kd, 0.0, GAIN_MAX)?;
        check.optional("prefilter_rad_s", self.prefilter_rad_s, 1e-2, highest_rad_s)?;
        check.optional("zero_rad_s", self.canceller.map(|c| c.zero_rad_s), 1e-3, highest_rad_s)?;
        check.optional("pole_rad_s", self.canceller.map(|c| c.pole_rad_s), 1e-3, highest_rad_s)?;
        check.optional("output_limit", self.output_limit, 1e-9, 1e9)
    }
}

impl PositionLoop {
    fn check(&self, group: &'static str, highest_rad_s: f64) -> Result<(), ConfigError> {
        let check = RangeCheck { group };
        check.within("kp", self.kp, 0.0, GAIN_MAX)?;
        check.within("ki", self.ki, 0.0, GAIN_MAX)?;
        check.within("kd", self.kd, 0.0, GAIN_MAX)?;
        check.within("velocity_filter_rad_s", self.velocity_filter_rad_s, 1e-2, highest_rad_s)?;
        check.within("rate_limit_m_s", self.rate_limit_m_s, 1e-4, 100.0)?;
        check.optional("output_limit_rad", self.output_limit_rad, 1e-6, core::f64::consts::FRAC_PI_2)
    }
}

impl Mixing {
    fn check(&self) -> Result<(), ConfigError> {
        let check = RangeCheck { group: "mixing" };
        match self {
            Self::Inverse(rows) => rows.iter().try_for_each(|row| check.all("inverse", row, -1e12, 1e12)),
            Self::Matrix(rows) => rows.iter().try_for_each(|row| check.all("matrix", row, -1e12, 1e12)),
            Self::Coefficients(c) => {
                check.within("air_density_kg_m3", c.air_density_kg_m3, 1e-3, 10.0)?;
                check.within("rotor_radius_m", c.rotor_radius_m, 1e-3, 10.0)?;
                check.within("arm_length_m", c.arm_length_m, 1e-3, 10.0)?;
                check.within("thrust", c.thrust, 1e-9, 1e3)?;
                check.all("roll", &c.roll, 1e-9, 1e6)?;
                check.all("pitch", &c.pitch, 1e-9, 1e6)?;
                check.all("yaw", &c.yaw, -1e6, 1e6)
            }
        }
    }
}

impl MotorMapParams {
    fn check(&self) -> Result<(), ConfigError> {
        let check = RangeCheck { group: "motor_map" };
        check.within("command", self.command, 1e-6, 1e6)?;
        check.within("voltage", self.voltage, -1e6, 1e6)?;
        check.within("offset", self.offset, -1e9, 1e9)?;
        let Some(inverse) = &self.inverse else { return Ok(()) };
        let check = RangeCheck { group: "motor_map.inverse" };
        check.within("speed", inverse.speed, 1e-6, 1e6)?;
        check.within("voltage", inverse.voltage, -1e9, 1e9)?;
        check.within("offset", inverse.offset, -1e9, 1e9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::{BatteryFilter, ModelBased, RotorCoefficients};
    use crate::config::thesis::THESIS_ROTORS;
    use crate::law::controller::Controller;

    fn model_based(change: impl FnOnce(&mut ModelBased)) -> Config {
        let mut config = Config::thesis();
        let Law::ModelBased(law) = &mut config.law else { unreachable!() };
        change(law);
        config
    }

    fn changed(change: impl FnOnce(&mut Config)) -> Config {
        let mut config = Config::thesis();
        change(&mut config);
        config
    }

    #[test]
    fn the_thesis_configurations_can_be_flown() {
        assert!(Controller::new(&Config::thesis()).is_ok());
        assert!(Controller::new(&Config::thesis_hand_tuned()).is_ok());
        assert!(Controller::new(&model_based(|l| l.mixing = Mixing::Coefficients(THESIS_ROTORS))).is_ok());
    }

    /// Each mistake, and the words with which its message must begin.
    #[test]
    fn mistakes_are_named() {
        let cases = [
            (changed(|c| c.sample_time_s = 0.0), "sample_time_s is 0:"),
            (changed(|c| c.sample_time_s = f64::NAN), "sample_time_s is NaN:"),
            (changed(|c| c.command_range = [2000.0, 1000.0]), "command_range is [2000, 1000]:"),
            (changed(|c| c.position_limits.y_m = [1.0, 1.0]), "position_limits.y_m is [1, 1]:"),
            (changed(|c| c.estimation.velocity.damping_ratio = -1.0), "estimation.damping_ratio is -1:"),
            (
                changed(|c| c.estimation.velocity.natural_frequency_rad_s = 400.0),
                "estimation.natural_frequency_rad_s is 400:",
            ),
            (
                changed(|c| c.estimation.velocity.natural_frequency_rad_s = 0.09),
                "estimation.natural_frequency_rad_s is 0.09:",
            ),
            (changed(|c| c.estimation.battery = Some(BatteryFilter { gain: 0.0 })), "estimation.gain is 0:"),
            (changed(|c| c.supervision.link.hold_after_s = -1.0), "supervision.link.hold_after_s is -1:"),
            (changed(|c| c.supervision.pose.cut_after_s = 0.1), "supervision.pose.cut_after_s is 0.1:"),
            (changed(|c| c.supervision.battery.empty_v = 11.0), "supervision.battery.empty_v is 11:"),
            (changed(|c| c.supervision.fence.z_m = [0.0, -2.0]), "supervision.fence.z_m is [0, -2]:"),
            (changed(|c| c.supervision.tilt.limit_rad = f64::NAN), "supervision.tilt.limit_rad is NaN:"),
            (model_based(|l| l.loops.roll.kp = -1.0), "roll.kp is -1:"),
            (model_based(|l| l.loops.pitch.ki = f64::INFINITY), "pitch.ki is inf:"),
            (model_based(|l| l.loops.yaw.prefilter_rad_s = Some(0.0)), "yaw.prefilter_rad_s is 0:"),
            (
                model_based(|l| l.loops.altitude.canceller = l.loops.roll.canceller),
                "altitude.canceller has no effect",
            ),
            (model_based(|l| l.loops.x.rate_limit_m_s = -0.5), "x.rate_limit_m_s is -0.5:"),
            (model_based(|l| l.loops.y.output_limit_rad = Some(3.0)), "y.output_limit_rad is 3:"),
            (model_based(|l| l.hover_thrust_n = f64::NAN), "law.hover_thrust_n is NaN:"),
            (model_based(|l| l.motor_map.command = 0.0), "motor_map.command is 0:"),
            (
                model_based(|l| l.mixing = Mixing::Matrix([[1.0; 4]; 4])),
                "mixing: the matrix has no usable inverse",
            ),
            (
                model_based(|l| {
                    l.mixing =
                        Mixing::Coefficients(RotorCoefficients { rotor_radius_m: -0.1, ..THESIS_ROTORS })
                }),
                "mixing.rotor_radius_m is -0.1:",
            ),
        ];
        for (config, message) in cases {
            let error = Controller::new(&config).expect_err(message).to_string();
            assert!(error.starts_with(message), "{error:?} should start with {message:?}");
        }
    }
}
