//! The thesis' craft (DJI F330) as a configuration: its two laws and the numbers that the thesis
//! prints for them.

use crate::config::gains::{
    CancellerParams, Config, Estimation, HandTuned, InnerLoop, InverseMotorMap, Law, Loops, Mixing,
    ModelBased, MotorMapParams, PositionLimits, PositionLoop, RotorCoefficients, Saturation,
    VelocityEstimator,
};
use crate::config::supervision_limits::{BatteryLevels, Supervision};
use crate::dsp::filter::GainRule;

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
    /// The thesis' craft (DJI F330) and its model-based law: Tables 5.1 to 5.3, printed inverse
    /// mixing and motor map.
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

    /// The thesis' craft under the hand-tuned law of its identification flights (4.2.2): PD on
    /// roll, pitch and yaw, PID on altitude and position, estimated velocity feedback, `2500 s /
    /// (s^2 + 100 s + 2500)` (4.2.3), sign matrix (4.5).
    ///
    /// The thesis prints no gains. These were found by a grid search on its nonlinear model (100
    /// Hz, 2 samples of delay): proportional and velocity gains of roll and pitch first, so that
    /// small steps die out with up to 3 samples of delay; then the position gains with the least
    /// mean error after a 1 m step; yaw and altitude are Table 5.2 divided by what one microsecond
    /// does at hover (0.052 rad/s^2, 0.0295 N), with more integral in altitude to carry the
    /// voltage, which this law does not know. All loops together stay stable on that model for
    /// delays of 0 to 3 samples, for 0.8 to 1.25 times the inner gains, and from 10.8 V to 12 V. A
    /// yaw step ends about 10 % long: PD has no integral, and the four rotors are not equal. The
    /// hover command is the mean of the four at 11.1 V.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Thesis (5.14): the thrust that carries 1.214 kg (Table 3.1) at 9.81 m/s^2, four decimals.
    #[test]
    fn hover_thrust_is_the_weight() {
        let Law::ModelBased(law) = Config::thesis().law else { panic!("the model-based law") };
        assert!((law.hover_thrust_n - 1.214 * 9.81).abs() < 5e-5);
    }

    /// Thesis (5.12) is (4.11) solved for the command, to the digits that are printed.
    #[test]
    fn the_printed_inverse_is_that_of_the_printed_map() {
        let map = THESIS_MOTOR_MAP;
        let inverse = map.inverse.expect("it is printed");
        assert!((inverse.speed - 1.0 / map.command).abs() < 5e-5);
        assert!((inverse.voltage + map.voltage / map.command).abs() < 5e-4);
        assert!((inverse.offset + map.offset / map.command).abs() < 0.05);
    }

    #[test]
    fn both_laws_can_be_flown() {
        assert_eq!((Config::thesis().check(), Config::thesis_hand_tuned().check()), (Ok(()), Ok(())));
    }
}
