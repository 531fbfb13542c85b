//! A user's effect in identification and diagnosis: found, measured right, and samples without a value left out.

mod common;

use common::{ORDINARY, fly, prepared, truth};
use diagnosis::{Options, Silent, Verdict, add, diagnose};
use model::{Effect, Model, effects};
use sysid::{Prepared, compare, fit};

fn effect(name: &str, text: &str) -> Effect {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("{name}.toml"));
    std::fs::write(&path, text).unwrap();
    effects::read(&path).unwrap()[0]
}

/// Linear, over the inertial frame.
fn current() -> Effect {
    effect(
        "current",
        "[[effect]]\nid = \"current\"\nsentence = \"A push that grows to the north.\"\n\
         acceleration.east = \"(a * north + b * north * height) / mass\"\n\
         acceleration.r = \"c * p * height\"\n\
         coefficient = [{ name = \"a\", unit = \"N/m\", possible = [-5.0, 5.0], typical = 0.5 },\n\
         { name = \"b\", unit = \"N/m^2\", possible = [-5.0, 5.0], typical = 0.5 },\n\
         { name = \"c\", unit = \"1/(m s)\", possible = [-5.0, 5.0], typical = 0.5 }]\n",
    )
}

/// Not linear: a decay length, which has no way to go at zero.
fn cushion() -> Effect {
    effect(
        "cushion",
        "[[effect]]\nid = \"cushion\"\nacceleration.w = \"-k * thrust * exp(-height / decay)\"\n\
         coefficient = [{ name = \"k\", unit = \"1\", possible = [-1.0, 1.0], typical = 0.01 },\n\
         { name = \"decay\", unit = \"m\", possible = [0.05, 5.0], typical = 1.0 }]\n",
    )
}

fn basic() -> Vec<Effect> {
    Effect::basic().collect()
}

#[test]
fn linear_and_nonlinear_ones_are_found_and_measured_right() {
    for (own, values) in [(current(), vec![0.4, -0.3, 0.6]), (cushion(), vec![0.01, 0.35])] {
        let mut world = truth();
        world.set(own, &values);
        let flights = prepared(&world, 10..15, 30.0, &ORDINARY);
        let all: Vec<&Prepared> = flights.iter().collect();
        let base = fit(&all[..3], &world.vehicle, &basic(), None).unwrap();
        let diagnosis = diagnose(&base.model, &all[..3], &all[3..], &Silent).unwrap();
        assert_eq!(diagnosis.verdict, Verdict::MissingEffect, "{own}: {}", diagnosis.summary);
        assert_eq!(diagnosis.best(), Some(own), "{own}: {}", diagnosis.summary);
        let added = add(&base.model, own, &all[..3], &all[3..], &Options::default()).unwrap();
        assert!(added.finding.supported, "{own}: {}", added.finding.reason);
        for (found, expected) in added.fit.model.term(own).unwrap().coefficients.iter().zip(values) {
            let error = found.std_error.unwrap();
            // Five coefficients: beyond 4 standard errors by chance once in three thousand.
            assert!((found.value - expected).abs() < 4.0 * error, "{own}: {found:?}, true {expected}");
            assert!(error < 0.5 * expected.abs(), "{own}: {found:?} says nothing");
        }
    }
}

/// Samples without a value are missing from both errors; what is left is right.
#[test]
fn samples_without_a_value_are_left_out_before_and_after_alike() {
    let own = effect(
        "root",
        "[[effect]]\nid = \"root\"\nacceleration.u = \"k * sqrt(height - low)\"\n\
         coefficient = [{ name = \"k\", unit = \"m^0.5/s^2\", possible = [-5.0, 5.0], typical = 0.3 }]\n\
         constant = [{ name = \"low\", unit = \"m\", value = 0.5 }]\n",
    );
    // Nothing like it in the craft: flights go below 0.5 m all the same.
    let world = truth();
    let mut flights: Vec<Prepared> = (30..34)
        .map(|seed| Prepared::new(&fly(&world, seed, 30.0, &ORDINARY), &world.vehicle).unwrap())
        .collect();
    let rows = |flights: &[Prepared]| flights.iter().map(Prepared::rows).sum::<usize>();
    let base = |flights: &[Prepared]| {
        fit(&flights[..3].iter().collect::<Vec<_>>(), &world.vehicle, &basic(), None).unwrap().model
    };
    let before = rows(&flights);
    // Unasked, the flights refuse it in a sentence instead of giving NaN.
    let all: Vec<&Prepared> = flights.iter().collect();
    let refused =
        add(&base(&flights), own, &all[..3], &all[3..], &Options::default()).unwrap_err().to_string();
    assert!(refused.contains("no finite prediction") && refused.contains("root"), "{refused}");

    let plain = Model::new(world.vehicle.clone());
    for flight in &mut flights {
        flight.leave_out_undefined(&plain, &[own, Effect::Tether]).unwrap();
    }
    assert!(rows(&flights) < before - 100 && rows(&flights) > before / 4, "{} of {before}", rows(&flights));
    let noted =
        flights.iter().filter(|f| f.notes.iter().any(|n| n.contains("\"k * sqrt(height - low)\""))).count();
    assert!(noted > 0, "{:?}", flights[0].notes);
    let all: Vec<&Prepared> = flights.iter().collect();
    let added = add(&base(&flights), own, &all[..3], &all[3..], &Options::default()).unwrap();
    let k = added.fit.model.term(own).unwrap().coefficients[0];
    assert!(k.value.abs() < 4.0 * k.std_error.unwrap(), "{k:?}");
    let comparison = compare(&added.fit.model, &all);
    assert!(model::AXES.iter().all(|a| comparison.total[*a].rms.is_finite()));
    let sum = comparison.horizons.sum_1_50;
    assert!(sum.position_m.is_finite() && sum.rate_rad_s > 0.0, "{sum:?}");
}
