//! What people tune: the configuration of a controller, in physical, rate-free units.
//!
//! [`Config`] is read from a file (serde, unknown keys are errors) or made by [`Config::thesis`]
//! and [`Config::thesis_hand_tuned`]. [`Controller::new`](crate::Controller::new) checks every
//! number by name and builds the immutable laws from it. Configuration is in f64 because filters
//! are designed in f64; flight is in f32.
//!
//! Every field is written, absent ones too (TOML leaves those out by itself): a format that does
//! not describe itself, such as postcard in firmware images, could not know which was skipped.
//!
//! Not here: memory (see the `...State` types beside each law) and anything that changes in flight.

use serde::{Deserialize, Serialize};

use crate::config::supervision_limits::Supervision;
use crate::dsp::filter::GainRule;

/// Everything that has to be known before the first tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// Period of the control loop in s (thesis: 0.01). Every filter and integrator is built for it.
    pub sample_time_s: f64,
    /// Lowest and highest motor command, in the vehicle's command unit (thesis: microseconds of
    /// PWM). The lowest is idle.
    pub command_range: [f64; 2],
    /// Where positions may be commanded.
    pub position_limits: PositionLimits,
    /// How rates and voltage are obtained from measurements.
    pub estimation: Estimation,
    /// Do integrators stop while the motors (or a loop's own limit) refuse more in their direction?
    pub anti_windup: bool,
    /// What the motors get when they cannot give all that the loops ask for; absent: each is
    /// clipped, as in the thesis.
    #[serde(default)]
    pub saturation: Saturation,
    /// Is the thrust divided by `cos(phi) cos(theta)`, so that its vertical part is what altitude
    /// asks for? Absent: no, as in the thesis. For the model-based law, whose thrust is a force.
    #[serde(default)]
    pub tilt_compensation: bool,
    /// When the supervisor steps in; absent: the defaults.
    #[serde(default)]
    pub supervision: Supervision,
    /// The control law.
    pub law: Law,
}

/// What the motors get when they cannot give all that the loops ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Saturation {
    /// Each motor's command is clipped by itself, whatever axis that takes from. As in the thesis.
    #[default]
    Clip,
    /// Roll and pitch come before thrust, thrust before yaw
    /// ([`desaturation`](crate::allocation::desaturation)); where roll and pitch themselves take
    /// nearly all there is, less tilt than commanded is flown.
    AttitudeFirst,
}

/// The box of allowed position commands, inertial NED, in m (thesis 3: 4 m x 2 m x 2 m centred on
/// the floor).
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
    /// How the gain of filters with a zero at the origin is matched (this estimator and the
    /// position loops' filter).
    pub gain_rule: GainRule,
    /// Blend the gyro into the body rates; absent: body rates come from the attitude alone, as in
    /// the thesis' flights.
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

/// Complementary filter of thesis (4.6): low frequencies from the attitude, high ones from the
/// gyro.
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

/// `g / (z - (1 - g))`: first-order smoothing of the voltage (thesis 4.2.5: `0.02 / (z - 0.98)` at
/// 100 Hz).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BatteryFilter {
    /// Weight g of the newest sample, in (0, 1].
    pub gain: f64,
}

/// The two control laws of the thesis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Law {
    /// Chapter 5: loops command thrust and angular accelerations, a model turns them into motor
    /// commands.
    ModelBased(ModelBased),
    /// Chapter 4.2.2: loops command motor commands directly through a matrix of signs; needs no
    /// model.
    HandTuned(HandTuned),
}

/// The model-based law, thesis chapter 5. Outputs of the loops: thrust in N, angular accelerations
/// in rad/s^2.
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

/// Gains of all loops (thesis Tables 5.1 to 5.3). "Output" is rad/s^2 (attitude) and N (altitude)
/// in the model-based law, command units in the hand-tuned one.
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
    /// The inverse itself: row i gives `omega_i^2` in rad^2/s^2 from thrust (N) and roll, pitch,
    /// yaw acceleration (rad/s^2).
    Inverse([[f64; 4]; 4]),
    /// The matrix K of thesis (5.11): rows thrust, roll, pitch, yaw; columns rotors. It is inverted
    /// at build.
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

/// Rotor speed in rad/s = `command * cmd + voltage * vbat + offset` (the vehicle file's
/// `[motors]`).
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg_attr(
        miri,
        ignore = "reads TOML again and again, which no craft does; the defaults' test does it once"
    )]
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
    #[cfg_attr(
        miri,
        ignore = "reads TOML again and again, which no craft does; the defaults' test does it once"
    )]
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
