//! What is not measured but computed from measurements.
//!
//! - Attitude: motion capture sends X-Y-Z angles; [`aerospace_from_xyz`] turns them into Z-Y-X
//!   ones, thesis (3.1).
//! - Euler rates and vertical velocity: second-order estimators on phi, theta, psi and z, thesis
//!   (5.5).
//! - Body rates: the inverse of thesis (2.3) on those Euler rates; with a gyro, the complementary
//!   filter (4.6).
//! - Voltage: first-order smoothing, thesis 4.2.5.
//!
//! Yaw may jump by whole turns: the estimator sees the short way. Every filter starts in the steady
//! state of its first input, so nothing kicks when the craft starts at z = -1 m.

use crate::config::gains::{Complement, Estimation, GyroFusion};
use crate::dsp::filter::{FirstOrder, FirstOrderState, SecondOrder, SecondOrderState};
use crate::dsp::trig::{sin_cos, wrap_angle};

/// Z-Y-X angles (phi, theta, psi) from X-Y-Z ones, all in rad, thesis (3.1).
///
/// Only the signs and the ratio of the arguments of `atan2` matter, so (3.1)'s division by
/// `cos(theta) >= 0` is left out and nothing is divided by zero with the nose straight up.
pub fn aerospace_from_xyz([phi, theta, psi]: [f32; 3]) -> [f32; 3] {
    let ((sf, cf), (st, ct), (sp, cp)) = (sin_cos(phi), sin_cos(theta), sin_cos(psi));
    let r11 = ct * cp;
    let r12 = cf * sp + sf * st * cp;
    let r13 = sf * sp - cf * st * cp;
    let r23 = sf * cp + cf * st * sp;
    let r33 = cf * ct;
    [libm::atan2f(r23, r33), -libm::asinf(r13.clamp(-1.0, 1.0)), libm::atan2f(r12, r11)]
}

/// Body rates p, q, r in rad/s from Euler rates in rad/s at roll and pitch in rad: the inverse of
/// thesis (2.3).
#[inline]
pub fn body_rates(euler_rates_rad_s: [f32; 3], roll_rad: f32, pitch_rad: f32) -> [f32; 3] {
    body_rates_and_upright(euler_rates_rad_s, roll_rad, pitch_rad).0
}

/// Body rates in rad/s, and `cos(phi) cos(theta)`: what of the thrust is vertical.
#[inline]
fn body_rates_and_upright(
    [d_phi, d_theta, d_psi]: [f32; 3],
    roll_rad: f32,
    pitch_rad: f32,
) -> ([f32; 3], f32) {
    let ((sf, cf), (st, ct)) = (sin_cos(roll_rad), sin_cos(pitch_rad));
    let turning = d_psi * ct;
    ([d_phi - d_psi * st, d_theta * cf + turning * sf, turning * cf - d_theta * sf], cf * ct)
}

/// Complementary filter for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fusion {
    low: FirstOrder,
    high: FirstOrder,
}

impl Fusion {
    fn new(params: &GyroFusion, estimation: &Estimation, period_s: f64) -> Self {
        let low = FirstOrder::low_pass(params.corner_rad_s, period_s);
        let high = match params.complement {
            Complement::Exact => low.complement(),
            Complement::MatchedPair => {
                FirstOrder::high_pass(params.corner_rad_s, period_s, estimation.gain_rule)
            }
        };
        Self { low: low.rounded(), high: high.rounded() }
    }
}

/// Memory of one axis of the complementary filter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct FusionState {
    low: FirstOrderState,
    high: FirstOrderState,
}

/// All estimators, for one period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimator {
    velocity: SecondOrder,
    fusion: Option<Fusion>,
    battery: FirstOrder,
}

/// Memory of an [`Estimator`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EstimatorState {
    phi: SecondOrderState,
    theta: SecondOrderState,
    psi: SecondOrderState,
    z: SecondOrderState,
    psi_rad: f32,
    fusion: [FusionState; 3],
    battery: FirstOrderState,
}

/// What the estimators say about one sample.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimates {
    /// Euler rates in rad/s.
    pub euler_rates_rad_s: [f32; 3],
    /// Body rates p, q, r in rad/s.
    pub body_rates_rad_s: [f32; 3],
    /// Rate of inertial z in m/s, down positive.
    pub z_rate_m_s: f32,
    /// Voltage in V.
    pub battery_v: f32,
    /// `cos(phi) cos(theta)`: what of the thrust is vertical.
    pub upright: f32,
}

impl Estimator {
    /// Builds the estimators; period in s.
    pub fn new(params: &Estimation, period_s: f64) -> Self {
        let velocity = SecondOrder::velocity_estimator(
            params.velocity.natural_frequency_rad_s,
            params.velocity.damping_ratio,
            period_s,
            params.gain_rule,
        );
        Self {
            velocity: velocity.rounded(),
            fusion: params.gyro.as_ref().map(|gyro| Fusion::new(gyro, params, period_s)),
            battery: params.battery.map_or(FirstOrder::PASS, |b| FirstOrder::smoothing(b.gain).rounded()),
        }
    }

    /// Does this configuration use the gyro?
    pub fn uses_gyro(&self) -> bool {
        self.fusion.is_some()
    }

    /// The memory of a craft that has always been at this attitude (rad), z (m) and voltage (V),
    /// turning at the gyro's rates (rad/s) by the gyro and not at all by the attitude.
    pub fn start(
        &self,
        [phi, theta, psi]: [f32; 3],
        z_m: f32,
        battery_v: f32,
        gyro_rad_s: [f32; 3],
    ) -> EstimatorState {
        EstimatorState {
            phi: self.velocity.steady(phi),
            theta: self.velocity.steady(theta),
            psi: self.velocity.steady(psi),
            z: self.velocity.steady(z_m),
            psi_rad: psi,
            fusion: gyro_rad_s.map(|rate| FusionState {
                low: FirstOrderState::default(),
                high: self.fusion.map_or_else(FirstOrderState::default, |fusion| fusion.high.steady(rate)),
            }),
            battery: self.battery.steady(battery_v),
        }
    }

    /// The next attitude and the next z are off by so much, rad and m, by no motion: the past is
    /// moved along with them.
    pub(crate) fn leap(&self, state: &mut EstimatorState, [roll, pitch, yaw]: [f32; 3], down_m: f32) {
        state.phi.add(self.velocity.steady(roll));
        state.theta.add(self.velocity.steady(pitch));
        state.psi.add(self.velocity.steady(yaw));
        state.z.add(self.velocity.steady(down_m));
    }

    /// One sample: attitude in rad, z in m, voltage in V and, if there is one, the gyro in rad/s.
    #[inline]
    pub fn step(
        &self,
        state: &mut EstimatorState,
        [phi, theta, psi]: [f32; 3],
        z_m: f32,
        battery_v: f32,
        gyro_rad_s: Option<[f32; 3]>,
    ) -> Estimates {
        let turned = psi - state.psi_rad;
        let short = wrap_angle(turned);
        if short != turned {
            // The same past on the new branch of the angle.
            state.psi.add(self.velocity.steady(turned - short));
        }
        state.psi_rad = psi;
        let euler_rates_rad_s = [
            self.velocity.step(&mut state.phi, phi),
            self.velocity.step(&mut state.theta, theta),
            self.velocity.step(&mut state.psi, psi),
        ];
        let (from_attitude, upright) = body_rates_and_upright(euler_rates_rad_s, phi, theta);
        Estimates {
            euler_rates_rad_s,
            body_rates_rad_s: match &self.fusion {
                Some(fusion) => fuse(fusion, &mut state.fusion, from_attitude, gyro_rad_s),
                None => from_attitude,
            },
            z_rate_m_s: self.velocity.step(&mut state.z, z_m),
            battery_v: self.battery.step(&mut state.battery, battery_v),
            upright,
        }
    }
}

/// Low frequencies from the attitude, high ones from the gyro; without a gyro the attitude stands
/// in for it.
fn fuse(
    fusion: &Fusion,
    states: &mut [FusionState; 3],
    from_attitude: [f32; 3],
    gyro_rad_s: Option<[f32; 3]>,
) -> [f32; 3] {
    let mut rates = from_attitude;
    let gyro = gyro_rad_s.unwrap_or(from_attitude);
    for ((rate, state), fast) in rates.iter_mut().zip(states).zip(gyro) {
        *rate = fusion.low.step(&mut state.low, *rate) + fusion.high.step(&mut state.high, fast);
    }
    rates
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::{BatteryFilter, Config};
    use core::f32::consts::PI;
    use nalgebra::{Rotation3, Vector3};
    use proptest::prelude::*;

    fn rotation(axis: Vector3<f64>, angle: f32) -> Rotation3<f64> {
        Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(axis), f64::from(angle))
    }

    proptest! {
        #![proptest_config(crate::cases::cases(20_000))]

        /// Against nalgebra: the rotation put together from X-Y-Z turns equals the one put together
        /// from Z-Y-X turns by the converted angles. 1e-6 is a few roundings of f32; near the pole
        /// theta = pi/2 `asin` magnifies one rounding of r13 to its square root, so the pole itself
        /// is left to the test below.
        #[test]
        fn both_orders_describe_one_rotation(phi in -3.1_f32..3.1, theta in -1.5_f32..1.5, psi in -3.1_f32..3.1) {
            let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
            let measured = rotation(x, phi) * rotation(y, theta) * rotation(z, psi);
            let [f, t, p] = aerospace_from_xyz([phi, theta, psi]);
            prop_assume!(t.abs() < 1.55);
            let ours = rotation(z, p) * rotation(y, t) * rotation(x, f);
            let difference = (measured.matrix() - ours.matrix()).abs().max();
            prop_assert!(difference < 2e-5, "{difference}");
        }

        /// Kinematics by finite differences of the rotation itself (nalgebra): body rates are the
        /// axial vector of R^T dR/dt. The step 1e-6 s leaves about 1e-6 of difference error; f32
        /// adds 1e-6.
        #[test]
        fn body_rates_are_those_of_the_turning_frame(
            phi in -1.0_f32..1.0, theta in -1.0_f32..1.0, psi in -3.0_f32..3.0, rates in any::<[i8; 3]>()
        ) {
            let rates = rates.map(|r| f32::from(r) / 32.0);
            let at = |t: f64| Rotation3::from_euler_angles(
                f64::from(phi) + t * f64::from(rates[0]),
                f64::from(theta) + t * f64::from(rates[1]),
                f64::from(psi) + t * f64::from(rates[2]),
            );
            let h = 1e-6;
            let w = at(0.0).matrix().transpose() * (at(h).matrix() - at(-h).matrix()) / (2.0 * h);
            let [p, q, r] = body_rates(rates, phi, theta).map(f64::from);
            for (got, want) in [(p, w[(2, 1)]), (q, w[(0, 2)]), (r, w[(1, 0)])] {
                prop_assert!((got - want).abs() < 5e-6, "{got} {want}");
            }
        }

        #[test]
        fn conversion_is_total(angles in proptest::array::uniform3(-1000.0_f32..1000.0)) {
            prop_assert!(aerospace_from_xyz(angles).iter().all(|a| a.is_finite()));
        }
    }

    #[test]
    fn single_turns_are_the_same_in_both_orders() {
        for angle in [-1.2_f32, -0.1, 0.0, 0.4, 1.3] {
            for axis in 0..3 {
                let mut angles = [0.0; 3];
                angles[axis] = angle;
                for (got, want) in aerospace_from_xyz(angles).into_iter().zip(angles) {
                    assert!((got - want).abs() < 1e-6, "{got} {want}");
                }
            }
        }
        assert!((aerospace_from_xyz([0.0, PI / 2.0, 0.0])[1] - PI / 2.0).abs() < 1e-3, "nose straight up");
    }

    fn estimator(estimation: &Estimation) -> Estimator {
        Estimator::new(estimation, 0.01)
    }

    #[test]
    fn yaw_rate_does_not_notice_the_branch() {
        let e = estimator(&Config::thesis().estimation);
        let mut state = e.start([0.0, 0.0, 3.0], -1.0, 11.1, [0.0; 3]);
        let mut plain = e.start([0.0, 0.0, 3.0], -1.0, 11.1, [0.0; 3]);
        for k in 0..400 {
            let psi = 3.0 + k as f32 * 0.01;
            let got = e.step(&mut state, [0.0, 0.0, wrap_angle(psi)], -1.0, 11.1, None).body_rates_rad_s[2];
            let want = e.step(&mut plain, [0.0, 0.0, psi], -1.0, 11.1, None).body_rates_rad_s[2];
            // One rounding of psi (2.4e-7 at 4 rad) times the estimator's gain of 30, a few times
            // over.
            assert!((got - want).abs() < 1e-4, "{k}: {got} {want}");
        }
    }

    #[test]
    fn starting_aloft_gives_no_kick() {
        let e = estimator(&Config::thesis().estimation);
        let attitude = [0.1, -0.2, 2.0];
        let mut state = e.start(attitude, -1.3, 11.1, [0.0; 3]);
        for _ in 0..100 {
            let out = e.step(&mut state, attitude, -1.3, 11.1, None);
            assert_eq!((out.z_rate_m_s, out.body_rates_rad_s), (0.0, [0.0; 3]));
            assert_eq!(out.battery_v, 11.1);
        }
    }

    /// A gyro bias dies out, a fast motion that only the gyro sees comes through.
    #[test]
    fn fusion_drops_the_bias_and_keeps_the_fast_part() {
        for complement in [Complement::Exact, Complement::MatchedPair] {
            let estimation = Estimation {
                gyro: Some(GyroFusion { corner_rad_s: 5.0, complement }),
                ..Config::thesis().estimation
            };
            let e = estimator(&estimation);
            let mut state = e.start([0.0; 3], 0.0, 11.1, [0.0; 3]);
            let mut last = 0.0;
            for _ in 0..500 {
                last = e.step(&mut state, [0.0; 3], 0.0, 11.1, Some([0.3, 0.0, 0.0])).body_rates_rad_s[0];
            }
            assert!(last.abs() < 1e-6, "a constant bias of 0.3 rad/s is gone after 5 s: {last}");
            let jump = e.step(&mut state, [0.0; 3], 0.0, 11.1, Some([1.3, 0.0, 0.0])).body_rates_rad_s[0];
            let want = if complement == Complement::Exact { 1.0 } else { 0.975_817_9 };
            assert!((jump - want).abs() < 1e-6, "{jump}");
        }
    }

    /// A steady turn seen by attitude and gyro alike is reported as it is, without gyro too.
    #[test]
    fn fusion_of_equal_signals_is_that_signal() {
        let estimation = Estimation {
            gyro: Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::Exact }),
            gain_rule: crate::dsp::filter::GainRule::Slope,
            ..Config::thesis().estimation
        };
        let e = estimator(&estimation);
        for with_gyro in [true, false] {
            let mut state = e.start([0.0; 3], 0.0, 11.1, [0.0; 3]);
            let mut last = 0.0;
            for k in 0..600 {
                let psi = wrap_angle(k as f32 * 0.005);
                let gyro = with_gyro.then_some([0.0, 0.0, 0.5]);
                last = e.step(&mut state, [0.0, 0.0, psi], 0.0, 11.1, gyro).body_rates_rad_s[2];
            }
            // Rounding of psi (2.4e-7) times 28 per tick.
            assert!((last - 0.5).abs() < 2e-5, "{last}");
        }
    }

    #[test]
    fn voltage_is_smoothed_as_printed() {
        let estimation =
            Estimation { battery: Some(BatteryFilter { gain: 0.02 }), ..Config::thesis().estimation };
        let e = estimator(&estimation);
        let mut state = e.start([0.0; 3], 0.0, 12.0, [0.0; 3]);
        for k in 0..300 {
            let got = e.step(&mut state, [0.0; 3], 0.0, 11.0, None).battery_v;
            let want = 11.0 + libm::pow(0.98, f64::from(k));
            // Rounding of f32 near 12 (5e-7), piled up over 1/0.02.
            assert!((f64::from(got) - want).abs() < 3e-5, "{k}: {got} {want}");
        }
    }
}
