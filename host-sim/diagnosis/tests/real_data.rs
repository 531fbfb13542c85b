//! Real flights (shared data, beside the repository or where `QUADLAB_SHARED` points): a Crazyflie with measured rotor
//! speeds, and one without, whose clocks wander. A few flights of each keep this quick; trajectories that judge
//! have a shape that no training flight has.

mod common;

use std::path::Path;

use common::shared;
use flights::Flight;
use model::{Effect, Model, Vehicle};
use sysid::fit::output_error::Rows;
use sysid::{Prepared, Reference, align, align_to, compare, fit, impossible_signs, refine, rotation_doubts};

fn read(folder: &Path, names: &[&str]) -> (Vehicle, Vec<Prepared>) {
    let vehicle = Vehicle::read(&folder.join("vehicle.toml")).unwrap();
    let one = |name: &&str| {
        let flight = Flight::read(&folder.join(format!("{name}.csv"))).unwrap();
        Prepared::new(&flight, &vehicle).unwrap()
    };
    let flights = names.iter().map(one).collect();
    (vehicle, flights)
}

fn zeros(vehicle: &Vehicle, effects: &[Effect]) -> Model {
    let mut model = Model::new(vehicle.clone());
    effects.iter().for_each(|e| model.set(*e, &vec![0.0; e.info().coefficients.len()]));
    model
}

#[test]
fn a_crazyflie_is_aligned_and_refined_and_predicts_a_shape_it_was_not_fitted_to() {
    let Some(folder) = shared("data/nanodrone") else { return };
    let names = ["multisine_run1", "random1_run1", "random1_run3", "square_run1", "square_run3"];
    let (vehicle, mut train) = read(&folder, &names);
    let (_, mut held_out) = read(&folder, &["random2_run4"]);
    let effects: Vec<Effect> =
        Effect::basic().chain([Effect::RotorInertia, Effect::FlappingMoment]).collect();
    align(&mut train.iter_mut().collect::<Vec<_>>(), &zeros(&vehicle, &effects));
    let all: Vec<&Prepared> = train.iter().collect();
    let start = fit(&all, &vehicle, &effects, None).unwrap().model;
    align_to(&start, &mut held_out.iter_mut().collect::<Vec<_>>(), Reference::Model(None));
    for flight in train.iter().chain(&held_out) {
        // The data's readme: 0.25 to 3.25 samples; found to a third of a sample.
        let found = flight.alignment.as_ref().unwrap();
        assert!(found.corrected && found.std_error_s < 0.0035, "{}: {found:?}", flight.name);
        assert!((0.002..0.036).contains(&-found.late_s), "{}: {found:?}", flight.name);
    }

    let judges: Vec<&Prepared> = held_out.iter().collect();
    let refinement = refine(&start, &all, &judges, Rows::Moments).unwrap();
    assert!(refinement.outcome.kept, "{}", refinement.outcome.reason);
    let (before, after) = (refinement.outcome.before, refinement.outcome.after);
    // A fifth of the attitude and rate error at least; two thirds of it stay, with or without a few flights more.
    assert!(after.attitude_rad < 0.8 * before.attitude_rad, "{before:?} {after:?}");
    assert!(after.rate_rad_s < 0.8 * before.rate_rad_s, "{before:?} {after:?}");
    assert_eq!(compare(&refinement.model, &judges).horizons.sum_1_50, after);
    // And it is a model: motors push the way they are mounted, drag is where others found it.
    assert_eq!(impossible_signs(&refinement.model), Vec::<String>::new());
    let drag = refinement.model.term(Effect::LinearDrag).unwrap();
    for c in &drag.coefficients[..2] {
        let per_s = -c.value / vehicle.mass;
        assert!((0.40..0.46).contains(&per_s), "{per_s}");
    }
}

#[test]
fn rotation_of_a_crazyflie_with_wandering_clocks_is_refused_and_its_thrust_follows_the_battery() {
    let Some(folder) = shared("data/nanobench") else { return };
    // All that were not held out: a battery's voltage shows between flights.
    let names = [
        "B2_circle_fast_rep1",
        "B2_circle_slow_rep2",
        "B7_oval_fast_rep2",
        "B7_oval_medium_rep1",
        "B9_trefoil_fast_rep12",
        "B9_trefoil_slow_rep10",
        "B9_trefoil_slow_rep2",
    ];
    let (vehicle, train) = read(&folder, &names);
    let (_, held_out) =
        read(&folder, &["B3_figure8_fast_rep1", "B5_helix_fast_mell_rep1", "B5_helix_medium_rep1"]);
    let (all, judges): (Vec<&Prepared>, Vec<&Prepared>) = (train.iter().collect(), held_out.iter().collect());
    let basic: Vec<Effect> = Effect::basic().collect();
    let whole = fit(&all, &vehicle, &basic, None).unwrap().model;
    assert_ne!(rotation_doubts(&whole, &all), Vec::<String>::new());

    let forces = sysid::without_rotation(&basic);
    let with_battery: Vec<Effect> = forces.iter().copied().chain([Effect::BatteryVoltage]).collect();
    let thrust_error = |effects: &[Effect]| {
        let model = fit(&all, &vehicle, effects, None).unwrap().model;
        let comparison = compare(&model, &judges);
        assert!(comparison.total.p.rms.is_nan() && comparison.horizons.fifty.rate_rad_s.is_nan());
        (comparison.total.w.rms, comparison.total.u.r2)
    };
    let (without, _) = thrust_error(&forces);
    let (with, lateral_r2) = thrust_error(&with_battery);
    // The data's readme: about 0.21 m/s^2 with the voltage.
    assert!(with < 0.26 && with < 0.6 * without, "{with} {without}");
    assert!(lateral_r2 > 0.5, "{lateral_r2}");
}

/// Whichever flight is left out, the others determine the voltage's coefficients, alike, and the thrust of that flight follows them.
#[test]
fn every_flight_of_a_crazyflie_follows_the_voltage_of_the_others() {
    let Some(folder) = shared("data/nanobench") else { return };
    let mut names: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "csv"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let (vehicle, flights) = read(&folder, &names);
    let forces = sysid::without_rotation(&Effect::basic().collect::<Vec<_>>());
    let with_battery: Vec<Effect> = forces.iter().copied().chain([Effect::BatteryVoltage]).collect();
    let mut squares = [0.0; 2];
    for (k, flight) in flights.iter().enumerate() {
        let others: Vec<&Prepared> =
            flights.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, f)| f).collect();
        for (sum, effects) in squares.iter_mut().zip([&forces, &with_battery]) {
            let model = fit(&others, &vehicle, effects, None)
                .unwrap_or_else(|why| panic!("without {}: {why}", names[k]))
                .model;
            *sum += compare(&model, &[flight]).total.w.sse;
            if let Some(battery) = model.term(Effect::BatteryVoltage) {
                let per_volt = battery.coefficients[0].value;
                assert!((0.25..0.35).contains(&per_volt), "without {}: {per_volt}", names[k]);
            }
        }
    }
    // 0.86 to 0.25 m/s^2 in all.
    assert!(squares[1] < 0.12 * squares[0], "{squares:?}");
}
