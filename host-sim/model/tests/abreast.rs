//! Craft that are integrated side by side against each by itself: the same bits, for any craft, state and command.

mod common;

use common::{craft, state};
use model::{Abreast, Effect, Hold, Holds, Kind, LANES, Model, Plant, State, effects::CATALOGUE};
use proptest::prelude::*;

/// What flies by itself only.
const ALONE: [&str; 2] = ["slung-load", "product-of-inertia"];

/// Two commands in a period of 0.01 s, the first of which may be missing, with so many steps.
fn holds(plant: &Plant, x: &[f64], counts: [u32; 2]) -> Holds {
    let commanded_rad_s = |k: usize| [0, 1, 2, 3].map(|rotor| 600.0 + 250.0 * x[k + rotor]);
    let part_s = 0.005 + 0.004 * x[0];
    let hold = |k, time_s, count| Hold {
        commanded_rad_s: commanded_rad_s(k),
        substeps: plant.substeps(time_s, count),
    };
    let first = (counts[0] > 0).then(|| hold(0, part_s, counts[0]));
    [first, Some(hold(4, 0.01 - part_s, counts[1]))]
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0_f64, 12)
}

fn bits(state: &State) -> Vec<u64> {
    let parts = [
        state.position_ned_m.as_slice(),
        state.attitude.as_slice(),
        state.velocity_m_s.as_slice(),
        state.rate_rad_s.as_slice(),
        &state.rotor_rad_s,
    ];
    parts.concat().into_iter().map(f64::to_bits).collect()
}

/// Which effects a craft has, their sizes, its state, and the steps of the parts of a period.
type Drawn = (u32, Vec<f64>, Vec<f64>, [u32; 2]);

/// Flies craft for some periods, by themselves and side by side. `shape` limits the effects that there are.
fn compared(shape: u32, all: &[Drawn]) -> Result<(), TestCaseError> {
    let plants: Vec<Plant> =
        all.iter().map(|(which, sizes, ..)| Plant::new(&craft(which & shape, sizes, &ALONE))).collect();
    let mut abreast = Abreast::new();
    let mut alone: Vec<State> = all.iter().map(|(_, _, x, _)| state(x)).collect();
    let mut together = alone.clone();
    for (lane, plant) in plants.iter().enumerate() {
        prop_assert!(abreast.enter(lane, plant));
    }
    for period in 0..5 {
        for (lane, (_, sizes, x, counts)) in all.iter().enumerate() {
            let drawn = if period % 2 == 0 { x } else { sizes };
            let holds = holds(&plants[lane], drawn, *counts);
            for hold in holds.iter().flatten() {
                plants[lane].step(&mut alone[lane], &hold.commanded_rad_s, 11.1, &hold.substeps);
            }
            // One is not always flown.
            if lane != 1 || period != 2 {
                abreast.put(lane, &together[lane], &holds);
            } else {
                together[lane] = alone[lane];
            }
        }
        abreast.advance();
        for (lane, (own, other)) in alone.iter().zip(&mut together).enumerate() {
            if lane != 1 || period != 2 {
                abreast.take(lane, other);
            }
            prop_assert_eq!(bits(own), bits(other), "lane {}, period {}", lane, period);
            prop_assert!(own.is_finite());
        }
    }
    Ok(())
}

/// Effects of the catalogue that are adjusting.
fn adjusting() -> u32 {
    let is_adjusting =
        |(place, effect): (usize, &Effect)| u32::from(effect.info().kind == Kind::Adjusting) << place;
    CATALOGUE.iter().enumerate().map(is_adjusting).sum()
}

proptest! {
    #[test]
    fn craft_side_by_side_fly_as_each_by_itself(
        all in prop::collection::vec((any::<u32>(), numbers(), numbers(), [0..4_u32, 1..5_u32]), 1..=LANES),
    ) {
        // Any effects; adjusting ones besides the thesis' only; none besides them.
        for shape in [u32::MAX, adjusting(), 0] {
            compared(shape, &all)?;
        }
    }
}

#[test]
fn what_flies_by_itself_only_is_not_let_in() {
    let mut abreast = Abreast::new();
    for id in ALONE {
        let effect = Effect::from_id(id).unwrap();
        let mut model = Model::thesis();
        let typical: Vec<f64> = effect.info().coefficients.iter().map(|c| c.typical).collect();
        assert!(abreast.enter(0, &Plant::new(&model)));
        model.set(effect, &typical);
        assert!(!abreast.enter(0, &Plant::new(&model)), "{id}");
    }
}

/// A lane goes from one craft to the next, whatever the first was.
#[test]
fn a_lane_can_be_given_to_another_craft() {
    let sizes = [0.7; 12];
    let (first, second) = (Plant::new(&craft(u32::MAX, &sizes, &ALONE)), Plant::new(&Model::thesis()));
    let begin = state(&[0.3; 12]);
    let mut abreast = Abreast::new();
    abreast.enter(3, &first);
    abreast.put(3, &begin, &holds(&first, &[0.2; 12], [1, 2]));
    abreast.advance();
    abreast.enter(3, &second);
    let (mut alone, mut together) = (begin, begin);
    let held = holds(&second, &[0.2; 12], [1, 2]);
    abreast.put(3, &begin, &held);
    abreast.advance();
    abreast.take(3, &mut together);
    for hold in held.iter().flatten() {
        second.step(&mut alone, &hold.commanded_rad_s, 11.1, &hold.substeps);
    }
    assert_eq!(bits(&alone), bits(&together));
    assert_ne!(bits(&alone), bits(&begin));
}
