//! What people tune: the configuration of a controller, in physical, rate-free units.
//!
//! [`Config`] is read from a file (serde, unknown keys are errors) or made by [`Config::thesis`] and
//! [`Config::thesis_hand_tuned`]. [`Controller::new`](crate::Controller::new) checks every number by name and builds the
//! immutable laws from it. Configuration is in f64 because filters are designed in f64; flight is in f32.
//!
//! Every field is written, absent ones too (TOML leaves those out by itself): a format that does not describe itself, as
//! postcard in firmware images, could not tell which was skipped.
//!
//! Not here: memory (see the `...State` types beside each law) and anything that changes in flight.

use serde::{Deserialize, Serialize};

use crate::config::error::{ConfigError, Parameter};
use crate::config::supervision_limits::{BatteryLevels, Supervision};
use crate::dsp::filter::GainRule;

/// Everything that has to be known before the first tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Period of the control loop in s (thesis: 0.01). Every filter and integrator is built for it.
    pub sample_time_s: f64,
    /// Lowest and highest motor command, in the vehicle's command unit (thesis: microseconds of PWM). The lowest is idle.
    pub command_range: [f64; 2],
    /// Where positions may be commanded.
    pub position_limits: PositionLimits,
    /// How rates and voltage are obtained from measurements.
    pub estimation: Estimation,
    /// Do integrators stop while the motors (or a loop's own limit) refuse more in their direction?
    pub anti_windup: bool,
    /// What the motors get when they cannot have all that the loops ask for; absent: each is clipped, as in the thesis.
    #[serde(default)]
    pub saturation: Saturation,
    /// Is the thrust divided by `cos(phi) cos(theta)`, so that its vertical part is what altitude asks for? Absent: no, as in
    /// the thesis. For the model-based law, whose thrust is a force.
    #[serde(default)]
    pub tilt_compensation: bool,
    /// When the supervisor steps in; absent: the defaults.
    #[serde(default)]
    pub supervision: Supervision,
    /// The control law.
    pub law: Law,
}

/// What the motors get when they cannot have all that the loops ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Saturation {
    /// Each motor's command is clipped by itself, whatever axis that takes from. As in the thesis.
    #[default]
    Clip,
    /// Roll and pitch come before thrust, thrust before yaw ([`Mixer::share`](crate::allocation::mixer::Mixer::share)); where roll and pitch
    /// themselves take nearly all there is, less tilt than commanded is flown.
    AttitudeFirst,
}

/// The box of allowed position commands, inertial NED, in m (thesis 3: 4 m x 2 m x 2 m centred on the floor).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionLimits {
    /// Least and greatest x in m.
    pub x_m: [f64; 2],
    /// Least and greatest y in m.
    pub y_m: [f64; 2],
    /// Least and greatest z in m; z points down, so the floor (0) is the greatest.
    pub z_m: [f64; 2],
}

/// How rates and voltage are obtained from measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Estimation {
    /// Estimator of the Euler rates and of the vertical velocity.
    pub velocity: VelocityEstimator,
    /// How the gain of filters with a zero at the origin is matched (this estimator and the position loops' filter).
    pub gain_rule: GainRule,
    /// Blend the gyro into the body rates; absent: body rates come from the attitude alone, as in the thesis' flights.
    #[serde(default)]
    pub gyro: Option<GyroFusion>,
    /// Smooth the measured voltage; absent: it is used as measured.
    #[serde(default)]
    pub battery: Option<BatteryFilter>,
}

/// `w^2 s / (s^2 + 2 zeta w s + w^2)`, thesis (5.5).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VelocityEstimator {
    /// Natural frequency w in rad/s.
    pub natural_frequency_rad_s: f64,
    /// Damping ratio zeta; 1 is critically damped.
    pub damping_ratio: f64,
}

impl VelocityEstimator {
    /// `5625 s / (s^2 + 150 s + 5625)`: what the thesis' design numbers are made with.
    pub const CRITICAL_150: Self = Self { natural_frequency_rad_s: 75.0, damping_ratio: 1.0 };
    /// `2500 s / (s^2 + 100 s + 2500)`: the identification flights, thesis 4.2.3.
    pub const CRITICAL_100: Self = Self { natural_frequency_rad_s: 50.0, damping_ratio: 1.0 };
    /// `5625 s / (s^2 + 75 s + 5625)`: as thesis (5.24) and (5.25) print it.
    pub const PRINTED_75: Self = Self { natural_frequency_rad_s: 75.0, damping_ratio: 0.5 };
}

/// Complementary filter of thesis (4.6): low frequencies from the attitude, high ones from the gyro.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroFusion {
    /// Corner in rad/s (thesis: 5).
    pub corner_rad_s: f64,
    /// How the high-pass is made.
    pub complement: Complement,
}

/// How the high-pass of the complementary filter is made from the low-pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Complement {
    /// `1 - low`: the two add up to 1 at every frequency.
    Exact,
    /// Both filters by the matched-Z rule, as the thesis says; they add up to 1 at DC only.
    MatchedPair,
}

/// `g / (z - (1 - g))`: first-order smoothing of the voltage (thesis 4.2.5: `0.02 / (z - 0.98)` at 100 Hz).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatteryFilter {
    /// Share g of the newest sample, in (0, 1].
    pub gain: f64,
}

/// The two control laws of the thesis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Law {
    /// Chapter 5: loops command thrust and angular accelerations, a model turns them into motor commands.
    ModelBased(ModelBased),
    /// Chapter 4.2.2: loops command motor commands directly through a matrix of signs; needs no model.
    HandTuned(HandTuned),
}

/// The model-based law, thesis chapter 5. Outputs of the loops: thrust in N, angular accelerations in rad/s^2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelBased {
    /// Thrust that carries the craft, in N (thesis (5.14): 11.9093).
    pub hover_thrust_n: f64,
    /// Gains of the loops.
    pub loops: Loops,
    /// From thrust and angular accelerations to squared rotor speeds.
    pub mixing: Mixing,
    /// From rotor speed to motor command.
    pub motor_map: MotorMapParams,
}

/// The hand-tuned law, thesis (4.5). Outputs of the loops are in the vehicle's command unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandTuned {
    /// Motor command that about carries the craft, in command units.
    pub hover_command: f64,
    /// Gains of the loops.
    pub loops: Loops,
}

/// Gains of all loops (thesis Tables 5.1 to 5.3). "Output" is rad/s^2 (attitude) and N (altitude) in the model-based law,
/// command units in the hand-tuned one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Loops {
    /// Roll, error in rad.
    pub roll: InnerLoop,
    /// Pitch, error in rad.
    pub pitch: InnerLoop,
    /// Yaw, error in rad, wrapped to the short way round.
    pub yaw: InnerLoop,
    /// Altitude, error in m of inertial z; its output is taken off the hover thrust.
    pub altitude: InnerLoop,
    /// Position along x; its output is an angle in rad.
    pub x: PositionLoop,
    /// Position along y; its output is an angle in rad.
    pub y: PositionLoop,
}

/// One inner loop: PID with velocity feedback, prefilter and lag canceller.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InnerLoop {
    /// Proportional gain, output per rad (or m).
    pub kp: f64,
    /// Integral gain, output per rad s (or m s).
    pub ki: f64,
    /// Velocity feedback gain, output per rad/s (or m/s).
    pub kd: f64,
    /// Corner of the low-pass on the command in rad/s; absent: none.
    #[serde(default)]
    pub prefilter_rad_s: Option<f64>,
    /// Lag canceller on proportional plus integral part; absent: none.
    #[serde(default)]
    pub canceller: Option<CancellerParams>,
    /// Greatest magnitude of the output; absent: no limit.
    #[serde(default)]
    pub output_limit: Option<f64>,
}

/// Lag canceller `(s/zero + 1) / (s/pole + 1)`, thesis (5.9).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CancellerParams {
    /// Where the zero is moved to, in rad/s (thesis: 0.6).
    pub zero_rad_s: f64,
    /// The plant's zero that the pole cancels, in rad/s (thesis: 0.2149 roll, 0.2076 pitch).
    pub pole_rad_s: f64,
}

/// One outer loop (thesis 5.4).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionLoop {
    /// Proportional gain in rad/m.
    pub kp: f64,
    /// Integral gain in rad/(m s).
    pub ki: f64,
    /// Velocity feedback gain in rad/(m/s).
    pub kd: f64,
    /// Corner a of the velocity filter `a s / (s + a)` in rad/s (thesis: 10).
    pub velocity_filter_rad_s: f64,
    /// Fastest motion of the reference in m/s (thesis: 0.5).
    pub rate_limit_m_s: f64,
    /// Greatest commanded angle in rad; absent: no limit.
    #[serde(default)]
    pub output_limit_rad: Option<f64>,
}

/// Where the inverse mixing matrix comes from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Mixing {
    /// The inverse itself: row i gives `omega_i^2` in rad^2/s^2 from thrust (N) and roll, pitch, yaw acceleration (rad/s^2).
    Inverse([[f64; 4]; 4]),
    /// The matrix K of thesis (5.11): rows thrust, roll, pitch, yaw; columns rotors. It is inverted at build.
    Matrix([[f64; 4]; 4]),
    /// The identified coefficients that K is made of.
    Coefficients(RotorCoefficients),
}

/// Identified rotor coefficients and the measured lengths behind K, thesis (5.11).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotorCoefficients {
    /// Air density in kg/m^3.
    pub air_density_kg_m3: f64,
    /// Rotor radius in m.
    pub rotor_radius_m: f64,
    /// Distance from centre to motor in m.
    pub arm_length_m: f64,
    /// Thrust coefficient C_T, common to the rotors.
    pub thrust: f64,
    /// `C_i^p / I_xx` per rotor, as identified: magnitudes, the rotor's side gives the sign.
    pub roll: [f64; 4],
    /// `C_i^q / I_yy` per rotor, as identified: magnitudes, the rotor's side gives the sign.
    pub pitch: [f64; 4],
    /// `C_i^r / I_zz` per rotor, as identified: the sign is the rotor's direction of turn.
    pub yaw: [f64; 4],
}

/// Rotor speed in rad/s = `command * cmd + voltage * vbat + offset` (the vehicle file's `[motors]`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorMapParams {
    /// rad/s per command unit; positive.
    pub command: f64,
    /// rad/s per volt.
    pub voltage: f64,
    /// rad/s.
    pub offset: f64,
    /// An inverse to use as it is given, rounding included; absent: the exact inverse.
    #[serde(default)]
    pub inverse: Option<InverseMotorMap>,
}

/// Motor command = `speed * omega + voltage * vbat + offset`, thesis (5.12).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InverseMotorMap {
    /// Command units per rad/s.
    pub speed: f64,
    /// Command units per volt.
    pub voltage: f64,
    /// Command units.
    pub offset: f64,
}

/// The inverse mixing matrix as printed in thesis (5.11).
pub const THESIS_INVERSE_MIXING: [[f64; 4]; 4] = [
    [31389.0, 4243.0, 4067.0, 18755.0],
    [33789.0, -3788.0, 4022.0, -17395.0],
    [33715.0, -5054.0, -4065.0, 19532.0],
    [36340.0, 4599.0, -4025.0, -20893.0],
];

/// The motor map and its rounded inverse as printed in thesis (4.11) and (5.12).
pub const THESIS_MOTOR_MAP: MotorMapParams = MotorMapParams {
    command: 0.7850,
    voltage: 44.6505,
    offset: -1205.1,
    inverse: Some(InverseMotorMap { speed: 1.2739, voltage: -56.8796, offset: 1535.2 }),
};

/// The identified rotor coefficients of thesis Tables 3.1, 4.6, 4.8, 4.10 and 4.12.
pub const THESIS_ROTORS: RotorCoefficients = RotorCoefficients {
    air_density_kg_m3: 1.225,
    rotor_radius_m: 0.1016,
    arm_length_m: 0.167,
    thrust: 0.0180,
    roll: [0.6170, 0.6229, 0.5510, 0.5574],
    pitch: [0.6008, 0.7203, 0.6058, 0.6267],
    yaw: [0.3554, -0.3326, 0.2981, -0.2743],
};

impl Config {
    /// The thesis' craft (DJI F330) and its model-based law: Tables 5.1 to 5.3, printed inverse mixing and motor map.
    pub const fn thesis() -> Self {
        Self {
            sample_time_s: 0.01,
            command_range: [1000.0, 2000.0],
            position_limits: PositionLimits { x_m: [-2.0, 2.0], y_m: [-1.0, 1.0], z_m: [-2.0, 0.0] },
            estimation: Estimation {
                velocity: VelocityEstimator::CRITICAL_150,
                gain_rule: GainRule::Matlab,
                gyro: None,
                battery: None,
            },
            anti_windup: true,
            saturation: Saturation::Clip,
            tilt_compensation: false,
            supervision: Supervision { battery: BatteryLevels::THREE_CELLS, ..Supervision::DEFAULT },
            law: Law::ModelBased(ModelBased {
                hover_thrust_n: 11.9093,
                loops: Loops {
                    roll: thesis_tilt(0.2149),
                    pitch: thesis_tilt(0.2076),
                    yaw: InnerLoop {
                        kp: 15.0,
                        ki: 1.0,
                        kd: 5.0,
                        prefilter_rad_s: Some(4.0),
                        canceller: None,
                        output_limit: None,
                    },
                    altitude: InnerLoop {
                        kp: 18.0,
                        ki: 1.0,
                        kd: 8.0,
                        prefilter_rad_s: Some(2.0),
                        canceller: None,
                        output_limit: None,
                    },
                    x: THESIS_POSITION,
                    y: THESIS_POSITION,
                },
                mixing: Mixing::Inverse(THESIS_INVERSE_MIXING),
                motor_map: THESIS_MOTOR_MAP,
            }),
        }
    }

    /// The thesis' craft under the hand-tuned law of its identification flights (4.2.2): PD on roll, pitch and yaw, PID on
    /// altitude and position, estimated velocity feedback, `2500 s / (s^2 + 100 s + 2500)` (4.2.3), sign matrix (4.5).
    ///
    /// The thesis prints no gains. These were found by a grid search on its nonlinear model (100 Hz, 2 samples of delay):
    /// proportional and velocity gains of roll and pitch first, so that small steps die out with up to 3 samples of delay;
    /// then the position gains with the least mean error after a 1 m step; yaw and altitude are Table 5.2 divided by what
    /// one microsecond does at hover (0.052 rad/s^2, 0.0295 N), with more integral in altitude to carry the voltage, which
    /// this law does not know. All loops together stay stable on that model for delays of 0 to 3 samples, for 0.8 to 1.25
    /// times the inner gains, and from 10.8 V to 12 V. A yaw step ends about 10 % long: PD has no integral, and the four
    /// rotors are not equal. The hover command is the mean of the four at 11.1 V.
    pub const fn thesis_hand_tuned() -> Self {
        let mut config = Self::thesis();
        config.estimation.velocity = VelocityEstimator::CRITICAL_100;
        let position = PositionLoop { kp: 0.5, ki: 0.1, kd: 0.2, ..THESIS_POSITION };
        config.law = Law::HandTuned(HandTuned {
            hover_command: 1711.9,
            loops: Loops {
                roll: hand_tuned(70.0, 0.0, 36.0),
                pitch: hand_tuned(64.0, 0.0, 33.0),
                yaw: hand_tuned(280.0, 0.0, 95.0),
                altitude: hand_tuned(600.0, 100.0, 270.0),
                x: position,
                y: position,
            },
        });
        config
    }
}

/// A loop without prefilter and canceller: gains in us per rad (or m), rad s and rad/s.
const fn hand_tuned(kp: f64, ki: f64, kd: f64) -> InnerLoop {
    InnerLoop { kp, ki, kd, prefilter_rad_s: None, canceller: None, output_limit: None }
}

/// Thesis Table 5.1 with the plant zero that the canceller's pole stands on, in rad/s.
const fn thesis_tilt(pole_rad_s: f64) -> InnerLoop {
    InnerLoop {
        kp: 100.0,
        ki: 100.0,
        kd: 10.0,
        prefilter_rad_s: Some(5.0),
        canceller: Some(CancellerParams { zero_rad_s: 0.6, pole_rad_s }),
        output_limit: None,
    }
}

/// Thesis Table 5.3 and section 5.4.
const THESIS_POSITION: PositionLoop = PositionLoop {
    kp: 0.3,
    ki: 0.02,
    kd: 0.2,
    velocity_filter_rad_s: 10.0,
    rate_limit_m_s: 0.5,
    output_limit_rad: None,
};

/// Checks the numbers of one table of the configuration, and names the first bad one.
pub(crate) struct Check {
    pub(crate) group: &'static str,
}

impl Check {
    pub(crate) fn within(
        &self,
        name: &'static str,
        value: f64,
        minimum: f64,
        maximum: f64,
    ) -> Result<(), ConfigError> {
        let parameter = Parameter { group: self.group, name };
        if !value.is_finite() {
            return Err(ConfigError::NotFinite { parameter, value });
        }
        if value < minimum || value > maximum {
            return Err(ConfigError::OutOfRange { parameter, value, minimum, maximum });
        }
        Ok(())
    }

    fn optional(
        &self,
        name: &'static str,
        value: Option<f64>,
        minimum: f64,
        maximum: f64,
    ) -> Result<(), ConfigError> {
        value.map_or(Ok(()), |value| self.within(name, value, minimum, maximum))
    }

    fn all(&self, name: &'static str, values: &[f64], minimum: f64, maximum: f64) -> Result<(), ConfigError> {
        values.iter().try_for_each(|value| self.within(name, *value, minimum, maximum))
    }

    pub(crate) fn range(&self, name: &'static str, [low, high]: [f64; 2]) -> Result<(), ConfigError> {
        self.all(name, &[low, high], -1e5, 1e5)?;
        if low < high {
            return Ok(());
        }
        Err(ConfigError::EmptyRange { parameter: Parameter { group: self.group, name }, low, high })
    }
}

/// Greatest gain: beyond it an error of 1 overflows every motor's range by far.
const GAIN_MAX: f64 = 1e6;

impl Config {
    /// Is this a configuration that can be built and flown? (A mixing matrix is inverted, and refused, only at build.)
    ///
    /// # Errors
    /// The first parameter that is not finite or out of range, by name.
    pub fn check(&self) -> Result<(), ConfigError> {
        let top = Check { group: "" };
        top.within("sample_time_s", self.sample_time_s, 1e-4, 0.1)?;
        top.range("command_range", self.command_range)?;
        let limits = Check { group: "position_limits" };
        limits.range("x_m", self.position_limits.x_m)?;
        limits.range("y_m", self.position_limits.y_m)?;
        limits.range("z_m", self.position_limits.z_m)?;
        // Above half the sampling rate there is nothing to filter.
        let highest_rad_s = core::f64::consts::PI / self.sample_time_s;
        self.estimation.check(highest_rad_s)?;
        self.supervision.check()?;
        match &self.law {
            Law::ModelBased(law) => {
                Check { group: "law" }.within("hover_thrust_n", law.hover_thrust_n, 1e-4, 1e5)?;
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
                Check { group: "law" }.within("hover_command", law.hover_command, low, high)?;
                law.loops.check(highest_rad_s)
            }
        }
    }
}

impl Estimation {
    fn check(&self, highest_rad_s: f64) -> Result<(), ConfigError> {
        let check = Check { group: "estimation" };
        let velocity = &self.velocity;
        check.within("natural_frequency_rad_s", velocity.natural_frequency_rad_s, 1e-2, highest_rad_s)?;
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
        let check = Check { group };
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
        let check = Check { group };
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
        let check = Check { group: "mixing" };
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
        let check = Check { group: "motor_map" };
        check.within("command", self.command, 1e-6, 1e6)?;
        check.within("voltage", self.voltage, -1e6, 1e6)?;
        check.within("offset", self.offset, -1e9, 1e9)?;
        let Some(inverse) = &self.inverse else { return Ok(()) };
        let check = Check { group: "motor_map.inverse" };
        check.within("speed", inverse.speed, 1e-6, 1e6)?;
        check.within("voltage", inverse.voltage, -1e9, 1e9)?;
        check.within("offset", inverse.offset, -1e9, 1e9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Controller;

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

    #[test]
    fn files_round_trip() {
        let mut full = Config::thesis();
        full.estimation.gyro = Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::MatchedPair });
        full.estimation.battery = Some(BatteryFilter { gain: 0.02 });
        for config in [Config::thesis(), Config::thesis_hand_tuned(), full] {
            let text = toml::to_string(&config).unwrap();
            assert_eq!(toml::from_str::<Config>(&text).unwrap(), config, "{text}");
        }
    }

    /// A file from before there was a supervisor, and one that names a single key of its table.
    #[test]
    fn files_without_supervision_have_the_defaults() {
        let text = toml::to_string(&Config::thesis()).unwrap();
        let (before, from) = text.split_once("[supervision").unwrap();
        let after = from.find("\n[law").map_or("", |k| &from[k..]);
        let old = format!("{before}{after}");
        assert!(!old.contains("supervision"), "{old}");
        let read = toml::from_str::<Config>(&old).unwrap();
        assert_eq!(read, Config { supervision: Supervision::default(), ..Config::thesis() });
        let one = format!("{before}[supervision.tilt]\nlimit_rad = 0.5\n{after}");
        let mut expected = read;
        expected.supervision.tilt.limit_rad = 0.5;
        assert_eq!(toml::from_str::<Config>(&one).unwrap(), expected);
    }

    #[test]
    fn unknown_keys_are_errors() {
        let text = toml::to_string(&Config::thesis()).unwrap();
        for (key, misspelt) in [
            ("anti_windup", "antiwindup"),
            ("prefilter_rad_s", "prefilter"),
            ("kd =", "kd_ ="),
            ("coast_s", "coast"),
        ] {
            assert!(text.contains(key));
            assert!(toml::from_str::<Config>(&text.replace(key, misspelt)).is_err(), "{misspelt}");
        }
    }
}
