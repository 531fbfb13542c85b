//! Fits from what is kept are those of the flights themselves.

mod common;

use common::{ORDINARY, craft, fly, truth, updated};
use diagnosis::workflow::{FlightSets, Reading, Silent, identify};
use fleet::fit::{Asked, of_many, of_one};
use fleet::{PassOptions, Question};
use model::{Effect, Model};
use sysid::Prepared;

struct World {
    _root: tempfile::TempDir,
    fleet: fleet::Fleet,
    indexed: fleet::Indexed,
    flights: Vec<flights::Flight>,
}

fn world(seconds: f64) -> World {
    let root = tempfile::tempdir().unwrap();
    let folder = craft(root.path(), "quad-1");
    let flights: Vec<flights::Flight> = (1..=5).map(|seed| fly(&truth(), seed, seconds, &ORDINARY)).collect();
    for (day, flight) in flights.iter().enumerate() {
        std::fs::write(folder.join(format!("2026-03-{:02}.csv", day + 1)), flight.to_csv()).unwrap();
    }
    let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
    World { _root: root, fleet, indexed, flights }
}

/// The flights as the index looked at them, and the model about which it did.
fn prepared(world: &World) -> (Vec<Prepared>, Model) {
    let model = world.indexed.references["quad-1"].model.clone();
    let delay_s = model.fit.as_ref().and_then(|fit| fit.rotor_delay_s);
    let mut flights: Vec<Prepared> =
        world.flights.iter().map(|flight| sysid::examine(flight, &model.vehicle).unwrap().prepared).collect();
    sysid::align_to(&model, &mut flights.iter_mut().collect::<Vec<_>>(), sysid::Reference::Model(delay_s));
    (flights, model)
}

/// The basic effects, and one more: all flights together and one by one, against the fit that reads every row.
#[test]
fn fits_from_triangles_are_those_of_the_rows() {
    let world = world(20.0);
    let (flights, model) = prepared(&world);
    let columns = &world.indexed.references["quad-1"].columns;
    let equations: Vec<_> = world.indexed.index.rows.iter().map(|row| &row.equations).collect();
    let basic: Vec<Effect> = Effect::basic().collect();
    for effects in [basic.clone(), [&basic[..], &[Effect::QuadraticDrag]].concat()] {
        let asked = Asked::new(columns, columns.of(&effects));
        let all: Vec<&Prepared> = flights.iter().collect();
        let expected = sysid::fit(&all, &model.vehicle, &effects, Some(&model)).unwrap();
        let found = of_many(&equations, &asked);
        let coefficients = expected.model.terms.iter().flat_map(|term| &term.coefficients);
        for ((place, expected), found) in asked.parameters.iter().zip(coefficients).zip(&found.estimates) {
            let (found, error) = (found.unwrap(), expected.std_error.unwrap());
            let off = (found.value - expected.value).abs() / error;
            assert!(off < 1e-6, "{}: {found:?} {expected:?}", columns.parameters[*place].name());
            // The larger of the noise within flights and the scatter between them, so no smaller by much.
            let ratio = found.std_error / error;
            assert!((0.8..4.0).contains(&ratio), "{}: {ratio}", columns.parameters[*place].name());
        }
        for axis in 0..6 {
            assert!((found.rms[axis] / expected.sigma[axis] - 1.0).abs() < 1e-9);
        }
        for (flight, equations) in flights.iter().zip(&equations) {
            let expected = sysid::fit(&[flight], &model.vehicle, &effects, Some(&model)).unwrap().model;
            let coefficients = expected.terms.iter().flat_map(|term| &term.coefficients);
            for ((place, expected), found) in
                asked.parameters.iter().zip(coefficients).zip(of_one(equations, &asked))
            {
                let (found, error) = (found.unwrap(), expected.std_error.unwrap());
                assert!((found.value - expected.value).abs() / error < 1e-6);
                let ratio = found.std_error / error;
                // Exact, but that scores of different axes are taken for independent: forces have a little of all three axes in them. Those of
                // another set of effects are in proportion.
                let rotates =
                    columns.parameters[*place].effect.info().axes.iter().all(|axis| axis.index() >= 3);
                let bounds = match effects.len() == basic.len() {
                    true if rotates => 0.999_999..1.000_001,
                    true => 0.95..1.05,
                    false => 0.7..1.5,
                };
                assert!(bounds.contains(&ratio), "{}: {ratio}", columns.parameters[*place].name());
            }
        }
    }
}

/// `identify` sets the clocks of the flights against each other and counts the battery from its own mean; here that is the reference's.
#[test]
fn the_fit_of_a_craft_is_that_of_identify_but_for_the_clocks() {
    let world = world(20.0);
    let vehicle = truth().vehicle;
    let [a, b, c, d, e] = &world.flights[..] else { panic!("five flights") };
    let train = [a.clone(), b.clone(), c.clone(), d.clone()];
    let mut sets =
        FlightSets::from_flights(&train, std::slice::from_ref(e), &vehicle, Reading::default(), &Silent)
            .unwrap();
    let expected = identify(&vehicle, &[], &mut sets, None, &Silent).unwrap().model;
    let question = Question { leave_out: vec!["quad-1/2026-03-05.csv".into()], ..Question::default() };
    let answer = common::asked(&world.fleet, &world.indexed, &question);
    let coefficients = expected.terms.iter().flat_map(|term| &term.coefficients);
    let mut furthest = 0.0_f64;
    for (expected, found) in coefficients.zip(&answer.crafts[0].coefficients) {
        furthest = furthest.max((found.value.unwrap() - expected.value).abs() / expected.std_error.unwrap());
    }
    println!("identify and fleet differ by up to {furthest:.3} standard errors");
    assert!(furthest < 0.5, "{furthest}");
}
