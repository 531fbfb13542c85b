//! What changed of a craft is found at the right flight and named; a craft that stayed the same is left in peace.

mod common;

use common::{asked, craft, flight, truth, updated};
use diagnosis::workflow::Silent;
use fleet::{Answer, PassOptions, Question, ask, look_up_causes};
use model::{Effect, Model};

/// A craft that flies 20 times, from flight `at` on as `after` says.
fn fleet_with(after: &Model, at: u64, seed: u64) -> (tempfile::TempDir, Answer) {
    let root = tempfile::tempdir().unwrap();
    let folder = craft(root.path(), "quad-1");
    for day in 1..=20 {
        let model = if day < at { truth() } else { after.clone() };
        flight(&folder, &model, day, seed + day, 12.0);
    }
    let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
    let answer = asked(&fleet, &indexed, &Question::default());
    (root, answer)
}

fn with(effect: Effect, values: &[f64]) -> Model {
    let mut model = truth();
    model.set(effect, values);
    model
}

#[test]
fn each_change_is_found_at_its_flight_and_named() {
    // Another battery whose voltage lies by as much throughout is no other than a craft of another mass (kg) to flights of this length.
    let cases = [
        (with(Effect::MotorEfficiency, &[0.0, 0.0, -0.05, 0.0]), 13, Effect::MotorEfficiency, Some(3)),
        (with(Effect::MassChange, &[0.04]), 9, Effect::MassChange, None),
        (with(Effect::ComOffset, &[0.004, 0.0]), 15, Effect::ComOffset, None),
        (with(Effect::BatteryVoltage, &[25.0, 0.0]), 11, Effect::MassChange, None),
    ];
    for (k, (after, at, effect, motor)) in cases.iter().enumerate() {
        let (_root, answer) = fleet_with(after, *at, 100 * k as u64);
        let [event] = &answer.crafts[0].changes[..] else {
            panic!("{effect}: {} changes", answer.crafts[0].changes.len())
        };
        assert_eq!(event.from.flight, format!("quad-1/2026-03-{at:02}.csv"), "{effect}");
        let best = &event.explanations[0];
        assert_eq!((best.effect, best.motor), (*effect, *motor), "{event:#?}");
    }
}

#[test]
fn a_craft_that_stays_the_same_has_not_changed() {
    let (_root, answer) = fleet_with(&truth(), 99, 900);
    assert_eq!(answer.crafts[0].changes, []);
    assert_eq!(answer.crafts[0].odd_flights, []);
}

#[test]
fn the_logs_are_asked_once_for_the_cause() {
    let root = tempfile::tempdir().unwrap();
    let folder = craft(root.path(), "quad-1");
    let (unchanged, heavier) = (truth(), with(Effect::MassChange, &[0.06]));
    for day in 1..=10 {
        flight(&folder, if day < 6 { &unchanged } else { &heavier }, day, day, 10.0);
    }
    let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
    let question = Question { causes: true, ..Question::default() };
    let path = common::index(root.path());
    let mut answered = ask(&fleet, &indexed, &question).unwrap();
    look_up_causes(&mut answered, &fleet, &indexed, &path, &Silent).unwrap();
    let event = answered.answer.crafts[0].changes[0].clone();
    let logs = event.in_logs.as_ref().unwrap();
    assert_eq!(logs.effect.as_deref(), Some("mass-change"), "{}", logs.summary);
    assert!(!event.causes_disagree, "{event:#?}");
    let [size] = &logs.coefficients[..] else { panic!("{logs:?}") };
    assert!(size.name == "extra_mass" && (size.value - 0.06).abs() < 0.001, "{size:?}");
    // The logs may go: the answer stays, and nothing is looked up.
    for day in 1..=10 {
        std::fs::remove_file(folder.join(format!("2026-03-{day:02}.csv"))).unwrap();
    }
    let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
    let mut answered = ask(&fleet, &indexed, &question).unwrap();
    assert_eq!(answered.answer.crafts[0].changes[0], event);
    look_up_causes(&mut answered, &fleet, &indexed, &path, &Silent).unwrap();
    assert_eq!(answered.answer.crafts[0].changes, [event]);
}

/// Five flights before a change and five after it: a first reference is from both. What is named, and how large it is, is that of a model of
/// the flights before, by the usual effects and by others.
#[test]
fn causes_and_sizes_are_those_about_the_flights_before() {
    let cases = [
        (with(Effect::MotorEfficiency, &[0.0, 0.14, 0.0, 0.0]), Effect::MotorEfficiency, Some(2), 0.14),
        (with(Effect::MassChange, &[0.1]), Effect::MassChange, None, 0.1),
        (with(Effect::ComOffset, &[0.0044, 0.0]), Effect::ComOffset, None, 0.0044),
    ];
    for (k, (after, effect, motor, size)) in cases.iter().enumerate() {
        let root = tempfile::tempdir().unwrap();
        let folder = craft(root.path(), "quad-1");
        for day in 1..=10 {
            let model = if day < 6 { truth() } else { after.clone() };
            flight(&folder, &model, day, 200 * k as u64 + day, 12.0);
        }
        let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
        assert_eq!(indexed.read, 10, "files, however often they were read");
        let reference = &indexed.references["quad-1"].model;
        let flights = &reference.fit.as_ref().unwrap().flights;
        assert!(flights.iter().all(|flight| *flight.name < *"2026-03-06"), "{flights:?}");
        let usual = Question::default();
        let other = Question { without: vec![Effect::LinearDrag], ..Question::default() };
        for question in [usual, other] {
            let answer = asked(&fleet, &indexed, &question);
            let [event] = &answer.crafts[0].changes[..] else { panic!("{effect}: {:#?}", answer.crafts[0]) };
            let best = &event.explanations[0];
            assert_eq!((best.effect, best.motor), (*effect, *motor), "{event:#?}");
            let found = &best.coefficients[0];
            println!("{effect} without {:?}: {} +- {}", question.without, found.value, found.std_error);
            assert!((found.value / size - 1.0).abs() < 0.02, "{effect}: {found:?}");
        }
        // What the craft is now is not a mean of what it was and is.
        let now = &asked(&fleet, &indexed, &Question::default()).crafts[0].coefficients[0];
        let (together, alone) = (now.value.unwrap(), now.now.unwrap());
        assert!((together - alone.value).abs() < 5.0 * alone.std_error, "{now:?}");
        assert_eq!(updated(root.path(), PassOptions::default(), &Silent).1.read, 0);
    }
}
