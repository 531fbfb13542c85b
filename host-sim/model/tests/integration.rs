//! How finely a plant is integrated, against a fiftieth of the step.

mod common;

use common::{craft, state};
use model::{Plant, State, effects::CATALOGUE};

/// A control period, s.
const PERIOD_S: f64 = 0.01;
/// Any numbers.
const NUMBERS: [f64; 12] = [0.3, -0.2, 0.5, -0.4, 0.25, 0.6, -0.7, 0.35, -0.15, 0.4, -0.3, 0.2];

/// Where a craft is after half a second of commands that change with every period.
fn flown(plant: &Plant, mut state: State, step_s: f64) -> State {
    for period in 0..50 {
        let commanded_rad_s = [0, 1, 2, 3].map(|rotor| 600.0 + 10.0 * NUMBERS[(period + 5 * rotor) % 12]);
        let substeps = plant.substeps(PERIOD_S, (PERIOD_S / step_s).round() as u32);
        plant.step(&mut state, &commanded_rad_s, 11.1, &substeps);
    }
    state
}

/// By how much a coarse flight differs from a fine one: position, m; attitude, rad; rates, rad/s.
fn difference(coarse: &State, fine: &State) -> [f64; 3] {
    [
        (coarse.position_ned_m - fine.position_ned_m).norm(),
        2.0 * (coarse.attitude - fine.attitude).norm(),
        (coarse.rate_rad_s - fine.rate_rad_s).norm(),
    ]
}

/// A craft with each effect of the catalogue besides the thesis', of either sign, that turns by 5 to 14 rad/s. The noise of a
/// flight's sensors is some 3e-4 m, 1e-3 rad and 1e-2 rad/s.
#[test]
fn enough_steps_are_enough_for_every_effect() {
    let mut worst = [0.0_f64; 3];
    for place in 0..CATALOGUE.len() {
        for sign in [1.0, -1.0] {
            let plant = Plant::new(&craft(1 << place, &[sign; 12], &[]));
            let mut start = state(&NUMBERS);
            // Low over the floor: the closer it is, the sooner its effect changes.
            start.position_ned_m.z = -0.5;
            let step_s = PERIOD_S / f64::from(plant.enough_substeps(PERIOD_S));
            let [coarse, fine] = [step_s, step_s / 50.0].map(|step_s| flown(&plant, start, step_s));
            for (worst, off) in worst.iter_mut().zip(difference(&coarse, &fine)) {
                *worst = worst.max(off);
            }
        }
    }
    assert!(worst[0] < 1e-5 && worst[1] < 5e-6 && worst[2] < 1e-5, "{worst:?}");
    assert!(worst[0] > 1e-8, "a step that is far too short would pass too: {worst:?}");
}

/// Periods of laws that tick more or less often than the thesis' one.
#[test]
fn a_longer_period_is_cut_into_more_steps() {
    let plant = Plant::new(&craft(0, &[], &[]));
    for (period_s, steps) in [(0.001, 1), (0.01, 1), (0.010_000_1, 2), (0.02, 2), (0.1, 10)] {
        assert_eq!(plant.enough_substeps(period_s), steps, "{period_s} s");
    }
    let load = CATALOGUE.iter().position(|effect| effect.id() == "slung-load").unwrap();
    let with_load = Plant::new(&craft(1 << load, &[0.5; 3], &[]));
    assert_eq!(with_load.enough_substeps(0.01), 4);
}
