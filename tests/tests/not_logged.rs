//! What is identified from logs that leave something out.
#![forbid(unsafe_code)]

use diagnosis::workflow::{self, FlightSets, Reading, Silent};
use flights::Column;
use model::Effect;
use stories::world::{Pattern, Sensors, Size, World, log};

/// Drag coefficients along the body axes and their standard errors, N s/m, from flights without these columns.
fn drag_without(world: &World, lost: &[Column]) -> [(f64, f64); 3] {
    let sensors = Sensors { accelerometer: true, ..Sensors::default() };
    let fly = |pattern: Pattern| {
        log::without(&world.fly(pattern, 24.0, &sensors, 0).expect("the pilot copes"), lost)
    };
    let (train, validate) = (Pattern::TRAIN.map(fly), Pattern::VALIDATE.map(fly));
    let mut sets =
        FlightSets::from_flights(&train, &validate, &world.vehicle, Reading::default(), &Silent).unwrap();
    let model = workflow::identify(&world.vehicle, &[], &mut sets, None, &Silent).unwrap().model;
    let drag = &model.term(Effect::LinearDrag).expect("part of the basic model").coefficients;
    std::array::from_fn(|i| (-drag[i].value, drag[i].std_error.unwrap()))
}

#[test]
fn drag_is_found_from_the_accelerometer_where_no_position_is_logged() {
    use Column::*;
    for (size, seed) in [(Size::F330, 2), (Size::F330, 3), (Size::Small, 4), (Size::Large, 5)] {
        let world = World::new(size, seed);
        // Without an attitude either, the tilt that is integrated is drawn to what the accelerometer feels, and drag comes out low.
        let lost_and_low: [(&[Column], f64); 4] =
            [(&[], 0.05), (&[X, Y, Z], 0.06), (&[X, Y], 0.06), (&[X, Y, Z, Phi, Theta, Psi], 0.35)];
        for (lost, off) in lost_and_low {
            for ((found, std_error), truth) in
                drag_without(&world, lost).into_iter().zip(world.craft.drag_n_s_m)
            {
                let difference = (found - truth).abs();
                assert!(difference < off * truth + 3.0 * std_error, "{seed} {lost:?}: {found} for {truth}");
                assert!(std_error < 0.15 * found, "{seed} {lost:?}: {found} +- {std_error}");
            }
        }
    }
}
