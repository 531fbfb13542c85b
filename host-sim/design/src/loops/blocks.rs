//! The blocks of the law in one view: what a filter, an integrator and a delay are made of.

use control::filter::{FirstOrder, SecondOrder};
use control::gains::{Complement, Config, Estimation, InnerLoop, PositionLoop};

use super::gains::{inner_gains, loops_of, outer_gains};
use super::name::{LoopName, View};
use crate::plant::StateSpace;

/// Where the law takes a rate from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Rate {
    /// The plant's own.
    True,
    /// A filter on the measured variable.
    Estimated(StateSpace),
}

/// The blocks of one loop, and of the position loop around it.
pub(super) struct Blocks {
    pub(super) period_s: Option<f64>,
    pub(super) delay: StateSpace,
    pub(super) prefilter: StateSpace,
    pub(super) proportional_integral: StateSpace,
    pub(super) canceller: StateSpace,
    pub(super) rate: Rate,
    /// Low- and high-pass of the complementary filter (4.6).
    pub(super) fusion: Option<(StateSpace, StateSpace)>,
    pub(super) kd: f64,
    pub(super) outer: Option<OuterBlocks>,
}

/// The blocks of a position loop.
pub(super) struct OuterBlocks {
    pub(super) proportional_integral: StateSpace,
    pub(super) rate: Rate,
    pub(super) kd: f64,
}

impl Blocks {
    /// The blocks of the loop `name` in a view.
    pub(super) fn new(config: &Config, name: LoopName, view: View) -> Self {
        let loops = loops_of(config);
        let (gains, outer) = (inner_gains(loops, name), outer_gains(loops, name));
        match view {
            View::Continuous => Self::continuous(&config.estimation, name, gains, outer),
            View::Sampled { delay_samples } => Self::sampled(config, name, gains, outer, delay_samples),
        }
    }

    fn continuous(
        estimation: &Estimation,
        name: LoopName,
        gains: &InnerLoop,
        outer: Option<&PositionLoop>,
    ) -> Self {
        let is_tilt = matches!(name, LoopName::Roll | LoopName::Pitch);
        let pass = || StateSpace::gain(1.0, None);
        Self {
            period_s: None,
            delay: pass(),
            prefilter: gains
                .prefilter_rad_s
                .map_or_else(pass, |a| StateSpace::transfer(&[a], &[1.0, a], None)),
            proportional_integral: continuous_pi(gains.kp, gains.ki),
            canceller: gains.canceller.map_or_else(pass, |c| {
                StateSpace::transfer(&[1.0 / c.zero_rad_s, 1.0], &[1.0 / c.pole_rad_s, 1.0], None)
            }),
            rate: if is_tilt { Rate::Estimated(continuous_estimator(estimation)) } else { Rate::True },
            fusion: estimation.gyro.as_ref().filter(|_| is_tilt).map(|gyro| {
                let a = gyro.corner_rad_s;
                (
                    StateSpace::transfer(&[a], &[1.0, a], None),
                    StateSpace::transfer(&[1.0, 0.0], &[1.0, a], None),
                )
            }),
            kd: gains.kd,
            outer: outer.map(|outer| OuterBlocks {
                proportional_integral: continuous_pi(outer.kp, outer.ki),
                rate: Rate::True,
                kd: outer.kd,
            }),
        }
    }

    fn sampled(
        config: &Config,
        name: LoopName,
        gains: &InnerLoop,
        outer: Option<&PositionLoop>,
        delay_samples: usize,
    ) -> Self {
        let (estimation, period_s) = (&config.estimation, config.sample_time_s);
        let prefilter = gains.prefilter_rad_s.map_or(FirstOrder::PASS, |a| FirstOrder::low_pass(a, period_s));
        let canceller = gains
            .canceller
            .map_or(FirstOrder::PASS, |c| FirstOrder::lag(c.zero_rad_s, c.pole_rad_s, period_s));
        Self {
            period_s: Some(period_s),
            delay: StateSpace::delay(delay_samples, period_s),
            prefilter: first_order(prefilter, period_s),
            proportional_integral: sampled_pi(gains.kp, gains.ki, period_s),
            canceller: first_order(canceller, period_s),
            rate: Rate::Estimated(sampled_estimator(estimation, period_s)),
            // Altitude has no gyro.
            fusion: sampled_fusion(estimation, period_s).filter(|_| name != LoopName::Z),
            kd: gains.kd,
            outer: outer.map(|outer| OuterBlocks {
                proportional_integral: sampled_pi(outer.kp, outer.ki, period_s),
                rate: Rate::Estimated(first_order(
                    FirstOrder::derivative(outer.velocity_filter_rad_s, period_s, estimation.gain_rule),
                    period_s,
                )),
                kd: outer.kd,
            }),
        }
    }
}

fn continuous_pi(kp: f64, ki: f64) -> StateSpace {
    if ki == 0.0 { StateSpace::gain(kp, None) } else { StateSpace::transfer(&[kp, ki], &[1.0, 0.0], None) }
}

/// `kp + ki Ts z / (z - 1)`: the integral is updated before it is used.
fn sampled_pi(kp: f64, ki: f64, period_s: f64) -> StateSpace {
    let period = Some(period_s);
    if ki == 0.0 {
        return StateSpace::gain(kp, period);
    }
    StateSpace::transfer(&[kp + ki * period_s, -kp], &[1.0, -1.0], period)
}

/// The velocity estimator (5.5).
fn continuous_estimator(estimation: &Estimation) -> StateSpace {
    let (w, zeta) = (estimation.velocity.natural_frequency_rad_s, estimation.velocity.damping_ratio);
    StateSpace::transfer(&[w * w, 0.0], &[1.0, 2.0 * zeta * w, w * w], None)
}

fn sampled_estimator(estimation: &Estimation, period_s: f64) -> StateSpace {
    let filter: SecondOrder<f64> = SecondOrder::velocity_estimator(
        estimation.velocity.natural_frequency_rad_s,
        estimation.velocity.damping_ratio,
        period_s,
        estimation.gain_rule,
    );
    StateSpace::transfer(&[filter.b0, filter.b1, filter.b2], &[1.0, filter.a1, filter.a2], Some(period_s))
}

/// Low- and high-pass of the complementary filter, if the law uses a gyro.
fn sampled_fusion(estimation: &Estimation, period_s: f64) -> Option<(StateSpace, StateSpace)> {
    estimation.gyro.as_ref().map(|gyro| {
        let low = FirstOrder::low_pass(gyro.corner_rad_s, period_s);
        let high = match gyro.complement {
            Complement::Exact => low.complement(),
            Complement::MatchedPair => {
                FirstOrder::high_pass(gyro.corner_rad_s, period_s, estimation.gain_rule)
            }
        };
        (first_order(low, period_s), first_order(high, period_s))
    })
}

fn first_order(filter: FirstOrder<f64>, period_s: f64) -> StateSpace {
    if filter == FirstOrder::PASS {
        return StateSpace::gain(1.0, Some(period_s));
    }
    StateSpace::transfer(&[filter.b0, filter.b1], &[1.0, filter.a1], Some(period_s))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.01;

    /// A constant error of 1: the output starts at Kp + Ki Ts and rises by Ki Ts each period.
    #[test]
    fn the_sampled_integral_is_used_in_the_period_it_is_updated_in() {
        let response = sampled_pi(3.0, 2.0, PERIOD_S).simulate(PERIOD_S, |_| 1.0, 4).unwrap();
        for (k, value) in response.iter().enumerate() {
            // Rounding of a few additions.
            assert!((value - (3.0 + 2.0 * PERIOD_S * (k + 1) as f64)).abs() < 1e-14, "{response:?}");
        }
    }

    /// Both views are of one law: at 1 rad/s, where a period is a hundredth of a radian, each
    /// sampled block responds as the continuous one does, to within 1 %.
    #[test]
    fn slow_signals_pass_both_views_alike() {
        let config = Config::thesis();
        let both = [View::Continuous, View::Sampled { delay_samples: 0 }];
        let [smooth, sampled] = both.map(|view| Blocks::new(&config, LoopName::Roll, view));
        let estimator = |blocks: &Blocks| match &blocks.rate {
            Rate::Estimated(filter) => filter.clone(),
            Rate::True => panic!("roll has an estimator"),
        };
        for (what, a, b) in [
            ("prefilter", smooth.prefilter.clone(), sampled.prefilter.clone()),
            ("integral", smooth.proportional_integral.clone(), sampled.proportional_integral.clone()),
            ("canceller", smooth.canceller.clone(), sampled.canceller.clone()),
            ("estimator", estimator(&smooth), estimator(&sampled)),
        ] {
            let (a, b) = (a.response(1.0, 0, 0), b.response(1.0, 0, 0));
            // MATLAB's gain rule makes the estimator 6.5 % too large, (5.5).
            let tolerance = if what == "estimator" { 0.08 } else { 0.01 };
            assert!((a - b).norm() < tolerance * a.norm(), "{what}: {a} {b}");
        }
    }
}
