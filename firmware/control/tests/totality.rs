//! The tick is total: whatever bits come in, finite motor commands inside the range come out, and
//! the controller flies on when the bits are good again. 120,000 runs with every kind of f32 (NaNs,
//! infinities, subnormals, huge, ordinary), each over many ticks, under every law and option;
//! proptest prints the seed of a failure.

mod common;

use common::{cases, configs};
use control::gains::{Law, Mixing};
use control::{Command, Config, Controller, Measurement, Mode, Tick};
use proptest::prelude::*;

/// Any bits, with the dangerous and the ordinary ones made frequent.
fn any_f32() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => any::<u32>().prop_map(f32::from_bits),
        3 => -3.0_f32..3.0,
        1 => prop::sample::select(vec![
            f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, f32::MIN_POSITIVE, 1e-45, -1e-45, 0.0, -0.0,
        ]),
    ]
}

fn measurement() -> impl Strategy<Value = Measurement> {
    let gyro = prop::option::of([any_f32(), any_f32(), any_f32()]);
    ([any_f32(), any_f32(), any_f32()], [any_f32(), any_f32(), any_f32()], gyro, any_f32()).prop_map(
        |(position_m, attitude_rad, gyro_rad_s, battery_v)| Measurement {
            position_m,
            attitude_rad,
            gyro_rad_s,
            battery_v,
        },
    )
}

fn command() -> impl Strategy<Value = Command> {
    (
        any::<bool>(),
        [any_f32(), any_f32()],
        any_f32(),
        any_f32(),
        [any_f32(), any_f32()],
        prop::bool::weighted(0.1),
        [any_f32(), any_f32(), any_f32(), any_f32()],
    )
        .prop_map(|(position, attitude_rad, yaw_rad, z_m, position_m, cut_off, injection)| Command {
            mode: if position { Mode::Position } else { Mode::Attitude },
            attitude_rad,
            yaw_rad,
            z_m,
            position_m,
            cut_off,
            injection,
        })
}

fn assert_inside(tick: &Tick) -> Result<(), TestCaseError> {
    for pwm in tick.pwm {
        prop_assert!((1000.0..=2000.0).contains(&pwm), "{tick:?}");
    }
    Ok(())
}

const HOVER: Measurement = Measurement {
    position_m: [0.0, 0.0, -1.0],
    attitude_rad: [0.0; 3],
    gyro_rad_s: Some([0.0; 3]),
    battery_v: 11.1,
};

proptest! {
    #![proptest_config(cases(120_000))]

    #[test]
    fn any_bits_give_commands_inside_the_range(
        which in 0..configs().len(),
        start_good in any::<bool>(),
        inputs in prop::collection::vec((measurement(), command()), 1..12),
    ) {
        let mut controller = Controller::new(&configs()[which]).unwrap();
        if start_good {
            assert_inside(&controller.tick(&HOVER, &Command { z_m: -1.0, ..Command::default() }))?;
        }
        for (measurement, command) in &inputs {
            // Each input for a few ticks: integrators and filters get somewhere.
            for _ in 0..3 {
                let tick = controller.tick(measurement, command);
                assert_inside(&tick)?;
                prop_assert_eq!(tick.faults.internal.count, 0, "the input checks keep overflow out");
                prop_assert!(tick.terms.thrust.is_finite() && tick.terms.torque.iter().all(|x| x.is_finite()));
            }
        }
        // Good inputs again: no fault is raised, and after a reset nothing is left of the past.
        let command = Command { z_m: -1.0, ..Command::default() };
        let tick = controller.tick(&HOVER, &command);
        prop_assert!(!tick.faults.measurement.now && !tick.faults.command.now && !tick.faults.battery.now);
        controller.reset();
        let mut fresh = Controller::new(&configs()[which]).unwrap();
        prop_assert_eq!(controller.tick(&HOVER, &command), fresh.tick(&HOVER, &command));
    }
}

/// The greatest gains and matrix entries that the checks let pass, and the greatest inputs that the
/// input checks let pass, for a thousand seconds of integration: no overflow. (What happens if
/// there is one all the same is a unit test.)
#[test]
fn nothing_that_is_allowed_overflows() {
    let mut config = Config::thesis();
    config.anti_windup = false;
    let Law::ModelBased(law) = &mut config.law else { unreachable!() };
    law.loops.roll.kp = 1e6;
    law.loops.roll.ki = 1e6;
    law.loops.roll.kd = 1e6;
    law.loops.altitude.ki = 1e6;
    law.mixing = Mixing::Inverse(control::mixer::SIGN_MATRIX.map(|row| row.map(|sign| 1e12 * sign)));
    let mut controller = Controller::new(&config).unwrap();
    for k in 0..if cfg!(miri) { 100 } else { 100_000 } {
        let roll = if k % 1000 < 500 { 900.0 } else { -900.0 };
        let measurement =
            Measurement { attitude_rad: [roll, 0.0, 0.0], position_m: [0.0, 0.0, 9e4], ..HOVER };
        let tick = controller.tick(&measurement, &Command::default());
        assert!(tick.pwm.iter().all(|pwm| (1000.0..=2000.0).contains(pwm)));
        assert_eq!(tick.faults.internal.count, 0);
    }
}
