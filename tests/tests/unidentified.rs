//! A model that the flights do not determine is said to be so, and what only looks like it is found.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

use diagnosis::workflow::{self, Explanation, FlightSets, FlightsOfOneKind, Reading, Silent};
use diagnosis::{Options, Verdict};
use model::{Axis, Effect, Group, Vehicle};
use stories::shared;
use stories::world::{Pattern, Sensors, Size, World};

fn explained(vehicle: &Vehicle, sets: &mut FlightSets) -> Explanation {
    workflow::explain(vehicle, &[], sets, &Options::default(), None, &Silent).unwrap()
}

/// Ixz/Ixx of 0.28, on the craft whose motors it turns the wrong way in a basic model: the yaw that they make rolls the craft.
#[test]
fn a_product_of_inertia_that_flips_the_signs_of_motors_is_found_and_the_rotation_is_identified_with_it() {
    for seed in [1, 2] {
        println!("seed {seed}");
        // At strength 1, Ixz/Ixx is 0.12.
        let world = World::new(Size::Small, seed).with("product-of-inertia", 0.28 / 0.12).unwrap();
        let fly =
            |pattern: Pattern| world.fly(pattern, 24.0, &Sensors::default(), 0).expect("the pilot copes");
        let (train, validate) = (Pattern::TRAIN.map(fly), Pattern::VALIDATE.map(fly));
        let vehicle = &world.vehicle;
        let mut sets =
            FlightSets::from_flights(&train, &validate, vehicle, Reading::default(), &Silent).unwrap();
        let basic: Vec<Effect> = Effect::basic().collect();
        let whole = sysid::fit(&sets.train(), vehicle, &basic, None).unwrap().model;
        assert_ne!(sysid::rotor_signs(&whole), [""; 0]);
        let explanation = explained(vehicle, &mut sets);
        assert_eq!(explanation.found(), [Effect::ProductOfInertia], "{}", explanation.conclusion());
        let verdicts = explanation.verdicts();
        assert_eq!((verdicts.translation, verdicts.rotation), (Verdict::Adequate, Verdict::MissingEffect));
        let record = explanation.model.fit.as_ref().unwrap();
        assert_eq!((record.verdicts, &record.not_identified[..]), (Some(verdicts), &[][..]));
        // What keeps a stand-in from mending a rotation that is not known is half of each axis.
        for axis in [Axis::P, Axis::Q, Axis::R] {
            println!("{axis}: R2 {}", record.held_out[axis].r2);
            assert!(record.held_out[axis].r2 > 0.8, "{axis}: {:?}", record.held_out[axis]);
        }
        let ratio = explanation.model.term(Effect::ProductOfInertia).unwrap().coefficients[0];
        assert!((ratio.value - 0.28).abs() < 5.0 * ratio.std_error.unwrap(), "{ratio:?}");

        // Without it in the catalogue, the rotation is refused, and never called adequate.
        let options = Options { without: vec![Effect::ProductOfInertia] };
        let unknown = workflow::explain(vehicle, &[], &mut sets, &options, None, &Silent).unwrap();
        assert!(!sysid::has_rotation(&unknown.model));
        assert_eq!(
            (unknown.verdict(), unknown.verdicts().rotation),
            (Verdict::NotIdentified, Verdict::NotIdentified)
        );
        let record = unknown.model.fit.as_ref().unwrap();
        assert!(!record.rotation_refused.is_empty());
        assert_eq!(record.not_identified[0].group, Group::Rotation);
    }
}

fn csv(folder: &Path, pick: impl Fn(&str) -> bool) -> Vec<PathBuf> {
    let name = |path: &PathBuf| path.file_stem().unwrap().to_string_lossy().into_owned();
    let all = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut all: Vec<PathBuf> =
        all.filter(|path| path.extension().is_some_and(|e| e == "csv") && pick(&name(path))).collect();
    all.sort();
    all
}

fn read(folder: &Path, train: &[PathBuf], validate: &[PathBuf]) -> (Vehicle, FlightSets) {
    let vehicle = Vehicle::read(&folder.join("vehicle.toml")).unwrap();
    let sets = FlightSets::read(train, validate, &vehicle, Reading::default(), &Silent).unwrap();
    (vehicle, sets)
}

/// Real, with clocks that wander within a flight: thrust follows the voltage, and nothing is known of the rotation.
#[test]
fn nanobench_has_a_finding_in_the_translation_and_no_rotation() {
    let Some(folder) = shared("data/nanobench") else { return };
    let held_out = |n: &str| n.starts_with("B3") || n.starts_with("B5");
    let (train, validate) = (csv(&folder, |n| !held_out(n)), csv(&folder, held_out));
    let (vehicle, mut sets) = read(&folder, &train, &validate);
    let explanation = explained(&vehicle, &mut sets);
    assert_eq!(explanation.found().first(), Some(&Effect::BatteryVoltage), "{}", explanation.conclusion());
    let verdicts = explanation.verdicts();
    assert_eq!(verdicts.rotation, Verdict::NotIdentified, "{}", explanation.conclusion());
    assert_ne!(verdicts.translation, Verdict::Adequate);
    assert_ne!(explanation.verdict(), Verdict::Adequate);
    assert!(explanation.conclusion().contains("The rotation is not identified by these flights"));
}

/// Real, slow shuttle flights with rates derived from the attitude: the model predicts no better than a mean, whichever log is
/// held out, and that is what is said.
#[test]
fn crazypad_has_no_rotation_and_is_never_adequate() {
    let Some(folder) = shared("data/crazypad") else { return };
    for craft in ["E8", "E9"] {
        for log in ["log00", "log03"] {
            let normal = |n: &str| n.contains(&format!("normal_flight__{craft}"));
            let train = csv(&folder, |n| normal(n) && !n.contains(log));
            let validate = csv(&folder, |n| normal(n) && n.contains(log));
            let (vehicle, mut sets) = read(&folder, &train, &validate);
            let model = workflow::identify(&vehicle, &[], &mut sets, None, &Silent).unwrap().model;
            let record = model.fit.as_ref().unwrap();
            assert!(
                record.not_identified.iter().any(|n| n.group == Group::Rotation),
                "{craft} {log}: {record:?}"
            );
            let explanation = explained(&vehicle, &mut sets);
            let (verdict, verdicts) = (explanation.verdict(), explanation.verdicts());
            println!("{craft} {log}: {verdict:?} {verdicts:?}: {}", explanation.conclusion());
            // What the residual depends on may be said, but nothing is found, and nothing is in order.
            assert!(
                matches!(verdicts.rotation, Verdict::NotIdentified | Verdict::Unexplained),
                "{craft} {log}: {}",
                explanation.conclusion()
            );
            assert_ne!(verdict, Verdict::Adequate, "{craft} {log}");
            let mut again = FlightsOfOneKind::read(&validate, &vehicle, Reading::default(), &Silent).unwrap();
            let changed = workflow::changed(&model, &[], &mut again, &Options::default(), &Silent).unwrap();
            // The steady balance of the rotors speaks for the rotation: it has not changed.
            assert_eq!(changed.verdict, Verdict::Adequate, "{craft} {log}: {}", changed.summary);
            assert!(
                changed.summary.contains("of its thrust in all of these flights would have"),
                "{craft} {log}: {}",
                changed.summary
            );
        }
    }
}
