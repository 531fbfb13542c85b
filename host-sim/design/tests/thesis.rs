//! The numbers of the thesis and of an independent recomputation of it (numpy and scipy,
//! polynomials instead of state space): linear model, transfer functions, margins, Table A.1,
//! responses, sampled loops.
//!
//! "Printed" is the thesis', "recomputed" the reference's. Loops are built around the *printed*
//! transfer functions where the reference did so, and around the model's own where the product
//! does.

use control::Config;
use control::filter::GainRule;
use control::gains::VelocityEstimator;
use design::analysis::{Band, LoopMargins, Margins};
use design::analysis::{bare_step, commanded_step, step_metrics, value_at};
use design::loops::{ClosedLoop, LoopName, LoopPlant, View, law_effect, loops_of, with_moved_zero};
use design::plant::TrimTarget;
use design::plant::{CANCEL_TOLERANCE, CHANNELS, Channel, Linear, with_perturbation};
use model::Model;
use nalgebra::Complex;

const LAG: Option<f64> = Some(21.5);
const ROLL: [f64; 4] = [1.0, -0.9888, 0.2274, 37.03];
const PITCH: [f64; 4] = [1.0, -1.769, -0.01226, 27.05];

fn printed_plant(name: LoopName) -> LoopPlant {
    let plant = match name {
        LoopName::Roll => LoopPlant::of_transfer(&[1.0, 0.2149], &ROLL, None, LAG),
        LoopName::Pitch => LoopPlant::of_transfer(&[1.0, 0.2076], &PITCH, None, LAG),
        LoopName::Yaw => LoopPlant::of_transfer(&[1.0], &[1.0, 0.4833, 0.0], None, LAG),
        LoopName::Z => LoopPlant::of_transfer(&[0.8237], &[1.0, 0.2149, 0.0], None, LAG),
        LoopName::X => LoopPlant::of_transfer(&[1.0, 0.2076], &PITCH, Some(&[0.1414, 9.808]), LAG),
        LoopName::Y => LoopPlant::of_transfer(&[1.0, 0.2149], &ROLL, Some(&[0.134, 9.808]), LAG),
    };
    plant.unwrap()
}

fn printed_loop(name: LoopName, config: &Config, view: View) -> ClosedLoop {
    ClosedLoop::new(config, &printed_plant(name), name, view).unwrap()
}

fn model_loop(name: LoopName, view: View) -> ClosedLoop {
    let (model, config) = (Model::thesis(), Config::thesis());
    let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
    let effect = law_effect(&model, &linear, &config, 11.1).unwrap();
    let plant = LoopPlant::new(&linear, &effect, name, CANCEL_TOLERANCE).unwrap();
    ClosedLoop::new(&config, &plant, name, view).unwrap()
}

fn near(got: f64, want: f64, tolerance: f64, what: &str) {
    assert!((got - want).abs() <= tolerance, "{what}: got {got}, want {want} +- {tolerance}");
}

fn has_pole(poles: &[Complex<f64>], re: f64, im: f64, tolerance: f64) {
    let nearest = poles.iter().map(|p| (p - Complex::new(re, im)).norm()).fold(f64::INFINITY, f64::min);
    assert!(nearest <= tolerance, "no pole at {re} + {im}j within {tolerance}: {poles:?}");
}

/// (5.16) with the tolerances of the reference: 3e-4 relative, A10,11 1.1e-2 (its coefficient has
/// one digit).
#[test]
fn a_and_b_are_those_of_5_16() {
    let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
    let printed = [
        (0, 3, 1.0, 1e-9),
        (1, 4, 1.0, 1e-9),
        (2, 5, 1.0, 1e-9),
        (6, 9, 1.0, 1e-9),
        (7, 10, 1.0, 1e-9),
        (8, 11, 1.0, 1e-9),
        (3, 3, -0.2076, 3e-4),
        (3, 7, -9.8080, 3e-4),
        (3, 10, -0.1414, 3e-4),
        (4, 4, -0.2211, 3e-4),
        (4, 6, 9.8080, 3e-4),
        (4, 9, 0.1340, 3e-4),
        (5, 5, -0.2149, 3e-4),
        (9, 4, -3.78, 3e-4),
        (9, 9, 1.2151, 3e-4),
        (9, 10, 0.0327, 1.1e-2),
        (10, 3, 2.754, 3e-4),
        // The signed rotor sum is -47.149 rad/s with the C_T behind the printed K^-1, -47.187 with
        // the rounded one.
        (10, 9, 0.2170, 7e-4),
        (10, 10, 1.9710, 3e-4),
        (11, 11, -0.4833, 3e-4),
    ];
    for (i, j, want, tolerance) in printed {
        near(linear.a[(i, j)], want, tolerance * f64::abs(want), &format!("A{},{}", i + 1, j + 1));
    }
    for i in 0..12 {
        for j in 0..12 {
            if !printed.iter().any(|p| (p.0, p.1) == (i, j)) {
                near(linear.a[(i, j)], 0.0, 0.0, &format!("A{},{} is zero", i + 1, j + 1));
            }
            if j < 4 {
                // -1/m, and ones: the twelve rows of the fourteen printed.
                let want = match (i, j) {
                    (5, 0) => -0.8237,
                    (9, 1) | (10, 2) | (11, 3) => 1.0,
                    _ => 0.0,
                };
                near(linear.b[(i, j)], want, 3e-4 * f64::abs(want), &format!("B{},{}", i + 1, j + 1));
            }
        }
    }
}

#[test]
fn the_gyroscopic_entry_is_printed_for_the_rounded_thrust_coefficient() {
    let mut model = Model::thesis();
    model.set(model::Effect::Thrust, &[0.0180]);
    let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
    near(linear.a[(10, 9)], 0.217_062, 1e-6, "A11,10, recomputed");
}

/// The 9.808 of the printed A is a finite difference over 2 degrees of 9.81 (reference section 1).
#[test]
fn the_printed_gravity_is_a_difference_over_two_degrees() {
    let linear = with_perturbation(&Model::thesis(), &TrimTarget::default(), 2_f64.to_radians()).unwrap();
    near(linear.a[(4, 6)], 9.8080, 1e-5, "A5,7");
    near(linear.a[(3, 7)], -9.8080, 1e-5, "A4,8");
}

fn channel(name: &str) -> Channel {
    let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
    let id = *CHANNELS.iter().find(|id| id.name == name).unwrap();
    linear.channel(id, CANCEL_TOLERANCE).unwrap()
}

/// (5.17) to (5.22): denominators 3e-4, except the small difference -0.01226 (1 %; recomputed from
/// unrounded tables -0.012144). The zero of (5.20) is the true 0.2211 = 0.2684/1.214, not the
/// printed one.
#[test]
fn transfer_functions_are_those_of_5_17_to_5_22() {
    let check = |name: &str, numerator: &[f64], denominator: &[f64]| {
        let channel = channel(name);
        let (n, d) = (channel.numerator(), channel.denominator());
        assert_eq!((n.len(), d.len()), (numerator.len(), denominator.len()), "{name}: {n:?} / {d:?}");
        for (got, want) in n.iter().zip(numerator).chain(d.iter().zip(denominator)) {
            let tolerance = if *want == -0.01226 { 1.1e-2 } else { 3e-4 };
            near(*got, *want, tolerance * want.abs() + 1e-9, name);
        }
    };
    check("roll", &[1.0, 0.2684 / 1.214], &ROLL);
    check("pitch", &[1.0, 0.2076], &PITCH);
    check("yaw", &[1.0], &[1.0, 0.4833, 0.0]);
    check("z", &[-0.8237], &[1.0, 0.2149, 0.0]);
    check("y", &[0.134, 9.808], &[1.0, -0.9888, 0.2274, 37.03, 0.0]);
    check("x", &[-0.1414, -9.808], &[1.0, -1.769, -0.01226, 27.05, 0.0]);
}

/// The three cancelled pairs of roll are pitch's poles, a few tenths of a per cent from zeros, and
/// the heave, yaw and position states were left out without any tolerance. With a tolerance of
/// nothing the coupled block stays whole.
#[test]
fn what_was_cancelled_is_said() {
    let roll = channel("roll");
    assert_eq!(roll.states, ["u", "v", "phi", "theta", "p", "q"]);
    assert_eq!(roll.cancelled.len(), 3);
    assert!(roll.cancelled.iter().all(|pair| pair.distance() > 1e-5 && pair.distance() < 0.01));
    let linear = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
    let whole = linear.channel(CHANNELS[0], 0.0).unwrap();
    assert_eq!((whole.poles.len(), whole.zeros.len()), (6, 4));
}

/// How (5.20) came to its zero: with all twelve states and a tolerance of 3 %, the drag along y
/// (0.2211) goes against the pole of the heave (0.2149) and the heave's own zero is left.
#[test]
fn the_printed_zero_of_roll_is_a_wrong_cancellation() {
    let roll = channel("roll");
    let (zero, heave) = (roll.zeros[0].re, channel("z").poles[0].re);
    near(zero, -0.2211, 1e-4, "drag along y");
    near(heave, -0.2149, 1e-4, "heave");
    assert!((zero - heave).abs() < 0.03 * heave.abs(), "within 3 %");
    assert!((zero - heave).abs() > CANCEL_TOLERANCE * heave.abs(), "not within ours");
}

/// Reference 2.1, recomputed values: margins 1e-3 deg and 1e-4 (their last printed digits), poles
/// half their last digit.
#[test]
fn attitude_loops_as_the_reference_has_them() {
    let cases = [
        (LoopName::Roll, VelocityEstimator::CRITICAL_150, 47.6546, 5.3533, 2.7952, 12.161),
        (LoopName::Roll, VelocityEstimator::PRINTED_75, 44.2077, 5.1024, 3.5681, 12.684),
        (LoopName::Pitch, VelocityEstimator::CRITICAL_150, 45.8471, 5.4843, 2.4991, 11.600),
        (LoopName::Pitch, VelocityEstimator::PRINTED_75, 42.5931, 5.1740, 3.2130, 12.084),
    ];
    for (name, estimator, phase, crossover, gain, at) in cases {
        let mut config = Config::thesis();
        config.estimation.velocity = estimator;
        let margins = LoopMargins::of(&printed_loop(name, &config, View::Continuous)).unwrap();
        let what = format!("{name} {estimator:?}");
        assert!(margins.stable, "{what}");
        near(margins.at_error.phase_margin_deg.unwrap(), phase, 1e-4, &what);
        near(margins.at_error.crossover_rad_s.unwrap(), crossover, 1e-4, &what);
        near(margins.at_error.gain_margin.unwrap(), gain, 1e-4, &what);
        near(margins.at_error.phase_crossover_rad_s.unwrap(), at, 1e-3, &what);
    }
    let poles = |name| printed_loop(name, &Config::thesis(), View::Continuous).closed.poles().unwrap();
    for (name, wanted) in [
        (LoopName::Roll, [(-0.2535, 0.0), (-2.7107, 2.6443), (-3.8229, 9.8400), (-78.5952, 15.4597)]),
        (LoopName::Pitch, [(-0.2877, 0.0), (-2.9127, 2.2412), (-3.2522, 9.4997), (-78.5568, 15.4044)]),
    ] {
        let poles = poles(name);
        for (re, im) in wanted {
            has_pole(&poles, re, im, 1e-4);
            has_pole(&poles, re, -im, 1e-4);
        }
    }
}

/// Reference 2.1: unfiltered overshoot (2 digits) and rise (4), prefiltered samples (5 digits),
/// first peak and dip.
#[test]
fn attitude_steps_as_the_reference_has_them() {
    let times = [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0];
    let cases = [
        (
            LoopName::Roll,
            (14.98, 0.2086),
            [0.10457, 0.59030, 0.91794, 0.90417, 0.81579, 0.67344, 0.68317, 0.76285, 0.85692, 0.95971],
            (0.9381, 0.674, 0.6652),
        ),
        (
            LoopName::Pitch,
            (22.78, 0.1983),
            [0.10482, 0.61479, 0.97410, 0.95324, 0.86690, 0.74702, 0.74261, 0.80813, 0.89231, 0.97445],
            (0.9948, 0.670, 0.7332),
        ),
    ];
    for (name, (overshoot, rise), samples, (peak, peak_s, dip)) in cases {
        let closed = printed_loop(name, &Config::thesis(), View::Continuous);
        let bare = bare_step(&closed, 40.0).unwrap();
        let metrics = step_metrics(&bare.values, bare.period_s);
        near(metrics.overshoot_percent, overshoot, 5e-3, "overshoot");
        near(metrics.rise_s.unwrap(), rise, 5e-5, "rise");
        let filtered = commanded_step(&closed, None, 40.0).unwrap();
        for (at, want) in times.into_iter().zip(samples) {
            near(value_at(&filtered.values, filtered.period_s, at).unwrap(), want, 6e-6, "sample");
        }
        let metrics = step_metrics(&filtered.values, filtered.period_s);
        let (got, at) = metrics.first_peak.unwrap();
        near(got, peak, 5e-5, "first peak");
        near(at, peak_s, 1e-3, "its time");
        near(metrics.lowest_after_peak.unwrap(), dip, 5e-5, "dip");
    }
}

const TABLE_A_1: [(f64, f64, f64); 16] = [
    (0.2149, 47.6555, 5.3531),
    (0.0000, 47.6618, 5.2146),
    (0.0500, 47.6598, 5.2463),
    (0.1000, 47.6582, 5.2783),
    (0.1500, 47.6570, 5.3106),
    (0.2000, 47.6558, 5.3433),
    (0.2500, 47.6546, 5.3764),
    (0.3000, 47.6531, 5.4098),
    (0.3500, 47.6510, 5.4436),
    (0.4000, 47.6483, 5.4777),
    (0.5000, 47.6400, 5.5472),
    (0.6000, 47.6262, 5.6182),
    (0.7000, 47.5912, 5.6936),
    (0.8000, 47.5626, 5.7674),
    (0.9000, 47.5305, 5.8416),
    (1.0000, 47.4733, 5.9198),
];

/// All rows of Table A.1 around the model's own denominator. 0.02 deg and 0.003 rad/s: the printed
/// crossovers of the rows 0.7 and 0.8 are inexact by that much; the other rows agree to a fifth of
/// it.
#[test]
fn table_a_1() {
    let roll = channel("roll");
    for (zero, phase, crossover) in TABLE_A_1 {
        let plant = with_moved_zero(&roll, zero, LAG).unwrap();
        let closed = ClosedLoop::new(&Config::thesis(), &plant, LoopName::Roll, View::Continuous).unwrap();
        let margins = Margins::of(|w| closed.gain_at_error(w), Band::of(None), true);
        let what = format!("zero {zero}");
        near(margins.phase_margin_deg.unwrap(), phase, 0.02, &what);
        near(margins.crossover_rad_s.unwrap(), crossover, 0.003, &what);
        if zero != 0.7 && zero != 0.8 {
            near(margins.phase_margin_deg.unwrap(), phase, 0.002, &what);
            near(margins.crossover_rad_s.unwrap(), crossover, 0.0004, &what);
        }
    }
}

/// Reference 2.3: overshoot 0.02 percentage points and rise 0.005 s against the printed values, and
/// five digits against the recomputed ones; margins and poles to their printed digits.
#[test]
fn yaw_and_altitude() {
    let cases = [
        (LoopName::Z, (2.15, 1.24), (2.14535, 1.24419), (70.37, 2.138), [-11.1336, -0.0570]),
        (LoopName::Yaw, (3.54, 0.665), (3.53949, 0.66446), (61.47, 2.583), [-15.8120, -0.0684]),
    ];
    for (name, printed, recomputed, (phase, crossover), poles) in cases {
        let closed = printed_loop(name, &Config::thesis(), View::Continuous);
        let step = commanded_step(&closed, None, 60.0).unwrap();
        let metrics = step_metrics(&step.values, step.period_s);
        near(metrics.overshoot_percent, printed.0, 0.02, "printed overshoot");
        near(metrics.rise_s.unwrap(), printed.1, 0.005, "printed rise");
        near(metrics.overshoot_percent, recomputed.0, 1e-5, "overshoot");
        near(metrics.rise_s.unwrap(), recomputed.1, 1e-5, "rise");
        let margins = LoopMargins::of(&closed).unwrap();
        near(margins.at_error.phase_margin_deg.unwrap(), phase, 5e-3, "phase margin");
        near(margins.at_error.crossover_rad_s.unwrap(), crossover, 5e-4, "crossover");
        for pole in poles {
            has_pole(&closed.closed.poles().unwrap(), pole, 0.0, 1e-4);
        }
    }
}

/// Reference 2.4: crossovers 0.005 rad/s against the printed ones, 1e-4 against the recomputed, the
/// rate-limited 1 m.
#[test]
fn outer_loops() {
    let cases = [
        (LoopName::X, 1.17, 1.1740, 48.813, 15.0, 15.237),
        (LoopName::Y, 1.12, 1.1197, 47.635, 17.0, 16.675),
    ];
    for (name, printed, crossover, phase, printed_overshoot, overshoot) in cases {
        let closed = printed_loop(name, &Config::thesis(), View::Continuous);
        let margins = LoopMargins::of(&closed).unwrap();
        near(margins.at_error.crossover_rad_s.unwrap(), printed, 0.005, "printed crossover");
        near(margins.at_error.crossover_rad_s.unwrap(), crossover, 1e-4, "crossover");
        near(margins.at_error.phase_margin_deg.unwrap(), phase, 1e-3, "phase margin");
        let step = commanded_step(&closed, Some(0.5), 60.0).unwrap();
        let metrics = step_metrics(&step.values, step.period_s);
        near(metrics.overshoot_percent, printed_overshoot, 0.5, "printed overshoot");
        // The reference holds the ramp's slope over 10 ms, we hold its value over 1 ms.
        near(metrics.overshoot_percent, overshoot, 2e-3, "overshoot");
    }
}

/// Reference 2.5, every row: gain margin and least damped mode to their printed digits.
#[test]
fn sampled_attitude_loops() {
    use VelocityEstimator as V;
    let rows = [
        (LoopName::Roll, V::CRITICAL_150, GainRule::Matlab, 0, 2.239, 11.27, 0.231),
        (LoopName::Roll, V::CRITICAL_150, GainRule::Matlab, 2, 1.246, 10.67, 0.053),
        (LoopName::Roll, V::CRITICAL_150, GainRule::Matlab, 3, 0.908, 10.34, -0.021),
        (LoopName::Roll, V::CRITICAL_150, GainRule::Slope, 2, 1.236, 10.19, 0.057),
        (LoopName::Roll, V::PRINTED_75, GainRule::Matlab, 2, 1.748, 10.94, 0.175),
        (LoopName::Roll, V::PRINTED_75, GainRule::Matlab, 3, 1.343, 10.62, 0.083),
        (LoopName::Pitch, V::CRITICAL_150, GainRule::Matlab, 0, 2.001, 10.86, 0.199),
        (LoopName::Pitch, V::CRITICAL_150, GainRule::Matlab, 2, 1.085, 10.36, 0.019),
        (LoopName::Pitch, V::CRITICAL_150, GainRule::Matlab, 3, 0.765, 10.07, -0.055),
        (LoopName::Pitch, V::CRITICAL_150, GainRule::Slope, 2, 1.078, 9.89, 0.020),
        (LoopName::Pitch, V::PRINTED_75, GainRule::Matlab, 2, 1.566, 10.54, 0.140),
        (LoopName::Pitch, V::PRINTED_75, GainRule::Matlab, 3, 1.185, 10.28, 0.047),
    ];
    for (name, estimator, rule, delay_samples, gain_margin, frequency, damping) in rows {
        let mut config = Config::thesis();
        config.estimation.velocity = estimator;
        config.estimation.gain_rule = rule;
        let closed = printed_loop(name, &config, View::Sampled { delay_samples });
        let margins = LoopMargins::of(&closed).unwrap();
        let what = format!("{name} {estimator:?} {rule:?} delay {delay_samples}");
        assert_eq!(margins.stable, gain_margin > 1.0, "{what}");
        near(margins.at_error.gain_margin.unwrap(), gain_margin, 6e-4, &what);
        let mode = design::analysis::least_damped(&closed.closed.poles().unwrap(), 0.01).unwrap();
        near(mode.frequency_rad_s, frequency, 6e-3, &what);
        near(mode.damping, damping, 6e-4, &what);
    }
}

/// The delay margin is what it says: a tenth of a sample less is stable, a tenth more is not. The
/// extra age is given to the rotor command, which the same loop goes through.
#[test]
fn the_delay_margin_is_where_the_loop_goes_unstable() {
    for name in [LoopName::Roll, LoopName::Pitch, LoopName::Yaw, LoopName::Z, LoopName::X, LoopName::Y] {
        let view = View::Sampled { delay_samples: 1 };
        let margin_s =
            LoopMargins::of(&printed_loop(name, &Config::thesis(), view)).unwrap().delay_margin_s.unwrap();
        for (late_s, stable) in [(margin_s - 0.001, true), (margin_s + 0.001, false)] {
            let mut plant = printed_plant(name);
            plant.input_delay_s = late_s;
            let closed = ClosedLoop::new(&Config::thesis(), &plant, name, view).unwrap();
            assert_eq!(closed.closed.is_stable().unwrap(), stable, "{name} {late_s} {margin_s}");
        }
    }
}

/// The whole chain, from the model file to the margins, against the printed values. The zero of
/// roll is the true 0.2211 (+0.0041 rad/s), everything else as above.
#[test]
fn the_product_finds_the_printed_margins_from_the_model() {
    let at = |name| LoopMargins::of(&model_loop(name, View::Continuous)).unwrap().at_error;
    for (name, phase, crossover, tolerance_deg) in [
        (LoopName::Roll, 47.6555, 5.3531, 0.02),
        (LoopName::Pitch, 45.8471, 5.4843, 0.02),
        (LoopName::Yaw, 61.47, 2.583, 0.02),
        (LoopName::Z, 70.37, 2.138, 0.02),
        (LoopName::X, 48.813, 1.17, 0.02),
        // The true zero adds 0.07 deg here.
        (LoopName::Y, 47.635, 1.12, 0.1),
    ] {
        let margins = at(name);
        near(margins.phase_margin_deg.unwrap(), phase, tolerance_deg, name.name());
        near(margins.crossover_rad_s.unwrap(), crossover, 0.005, name.name());
    }
    let sampled =
        |name| LoopMargins::of(&model_loop(name, View::Sampled { delay_samples: 2 })).unwrap().at_error;
    // The true zero takes 0.2 % of it, in pitch (whose zero is as printed) nothing.
    near(sampled(LoopName::Roll).gain_margin.unwrap(), 1.246, 3e-3, "roll, 2 samples");
    near(sampled(LoopName::Pitch).gain_margin.unwrap(), 1.085, 2e-3, "pitch, 2 samples");
}

/// Appendix B: with the integrator a constant disturbance leaves nothing, without it 1/Kp, (B.3)
/// and (B.4).
#[test]
fn integral_action_removes_a_constant_disturbance() {
    let final_value = |ki: f64| {
        let mut config = Config::thesis();
        design::loops::loops_of_mut(&mut config).altitude.ki = ki;
        let closed = printed_loop(LoopName::Z, &config, View::Continuous);
        let step = design::analysis::disturbance_step(&closed, 200.0).unwrap();
        *step.values.last().unwrap()
    };
    near(final_value(0.0), 1.0 / loops_of(&Config::thesis()).altitude.kp, 1e-9, "(B.3)");
    // The slow pole 0.057 rad/s leaves exp(-11.4) of it.
    near(final_value(1.0), 0.0, 1e-5, "(B.4)");
}

/// At 100 m/s the air asks for more than the motors have: an error, and soon.
#[test]
fn a_speed_without_equilibrium_is_an_error_and_no_endless_search() {
    for speed in [60.0, 100.0, 300.0] {
        let target = TrimTarget { velocity_ned_m_s: [speed, 0.0, 0.0], ..TrimTarget::default() };
        let Err(error) = design::plant::equilibrium(&Model::thesis(), &target) else { continue };
        assert!(error.to_string().contains("equilibrium"), "{error}");
    }
    let target = TrimTarget { velocity_ned_m_s: [1000.0, 0.0, 0.0], ..TrimTarget::default() };
    assert!(design::plant::equilibrium(&Model::thesis(), &target).is_err());
}
