//! Flights that nobody here made: simulated by another program with a known hidden effect, and real
//! ones.

use std::path::{Path, PathBuf};

use diagnosis::workflow::{self, Explanation, FlightSets, Reading, Silent};
use diagnosis::{Diagnosis, Options, Verdict};
use model::{AXES, Axis, Effect, Model, Vehicle};
use serde_json::Value;
use stories::shared;
use sysid::{Comparison, compare};

/// Flights of a folder as a user of the program gives them.
struct Folder {
    vehicle: Vehicle,
    sets: FlightSets,
}

impl Folder {
    fn read(folder: &Path, train: &[String], validate: &[String]) -> Self {
        let vehicle = Vehicle::read(&folder.join("vehicle.toml")).unwrap();
        let paths = |names: &[String]| -> Vec<PathBuf> {
            names.iter().map(|name| folder.join(format!("{name}.csv"))).collect()
        };
        let reading = Reading::default();
        let sets = FlightSets::read(&paths(train), &paths(validate), &vehicle, reading, &Silent).unwrap();
        Self { vehicle, sets }
    }

    fn hidden(case: &str) -> Option<Self> {
        let names = |all: &[&str]| all.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
        let folder = shared(&format!("data/hidden/{case}"))?;
        Some(Self::read(&folder, &names(&["A", "B", "C"]), &names(&["D", "E"])))
    }

    fn explain(&mut self) -> Explanation {
        workflow::explain(&self.vehicle, &[], &mut self.sets, &Options::default(), None, &Silent).unwrap()
    }

    fn identify(&mut self) -> Model {
        workflow::identify(&self.vehicle, &[], &mut self.sets, None, &Silent).unwrap().model
    }

    fn diagnose(&mut self, model: &Model) -> Diagnosis {
        workflow::diagnose(model, &[], &mut self.sets, &Options::default(), &Silent).unwrap()
    }

    fn with(&mut self, model: &Model, effect: Effect) -> Model {
        workflow::add(model, effect, &mut self.sets, None, &Silent).unwrap().model
    }

    /// The model against the flights held out.
    fn compare(&self, model: &Model) -> Comparison {
        compare(model, &self.sets.validate())
    }
}

fn world(case: &str) -> Option<Value> {
    let text = std::fs::read_to_string(shared("data/hidden/truth.json")?).unwrap();
    Some(serde_json::from_str::<Value>(&text).unwrap()[case]["world"].clone())
}

fn number(world: &Value, name: &str) -> f64 {
    world[name].as_f64().unwrap_or_else(|| panic!("truth.json has no {name}"))
}

/// The simulator's parameters in the model's terms (README beside the data): name of effect,
/// coefficient, value.
fn truth(world: &Value, vehicle: &Vehicle) -> Vec<(Effect, usize, f64)> {
    let get = |name| number(world, name);
    let beta = vehicle.beta_kg_m();
    let thrust = get("kT") / beta;
    let mut all = vec![
        (Effect::Thrust, 0, thrust),
        (Effect::LinearDrag, 0, -get("du")),
        (Effect::LinearDrag, 1, -get("dv")),
        (Effect::LinearDrag, 2, -get("dw")),
        (Effect::AngularDamping, 0, -get("dp") / get("Ixx")),
        (Effect::AngularDamping, 1, -get("dq") / get("Iyy")),
        (Effect::AngularDamping, 2, -get("dr") / get("Izz")),
        (Effect::InertiaCoupling, 0, (get("Iyy") - get("Izz")) / get("Ixx")),
        (Effect::InertiaCoupling, 1, (get("Izz") - get("Ixx")) / get("Iyy")),
        (Effect::InertiaCoupling, 2, (get("Ixx") - get("Iyy")) / get("Izz")),
        (Effect::Gyroscopic, 0, get("Jr") / get("Ixx")),
        (Effect::Gyroscopic, 1, -get("Jr") / get("Iyy")),
    ];
    for rotor in 0..4 {
        // Arms: sqrt(2) l in the model, l / sqrt(2) in the simulator.
        all.push((Effect::RotorMoments, rotor, 0.5 * thrust / get("Ixx")));
        all.push((Effect::RotorMoments, 4 + rotor, 0.5 * thrust / get("Iyy")));
        let spin = vehicle.motors.spin[rotor].yaw_sign();
        all.push((
            Effect::RotorMoments,
            8 + rotor,
            spin * get("kQ") / (beta * vehicle.rotor_radius * get("Izz")),
        ));
    }
    all
}

fn assert_near_truth(case: &str, model: &Model, expected: &[(Effect, usize, f64)], errors: f64) {
    for &(effect, k, value) in expected {
        let found = model.term(effect).unwrap().coefficients[k];
        let name = effect.info().coefficients[k].name;
        let distance = (found.value - value).abs() / found.std_error.unwrap();
        assert!(distance < errors, "{case}: {effect} {name}: {found:?}, true {value}");
    }
}

/// Reads coefficients of a hidden effect off the simulator's parameters: effect, index, value.
type OwnTruth = dyn Fn(&Value) -> Vec<(Effect, usize, f64)>;

/// A case, what is hidden in it, and the true values of its coefficients where they have the same
/// meaning there.
fn check_case(case: &str, hidden: &[Effect], own: &OwnTruth) {
    let (Some(mut folder), Some(world)) = (Folder::hidden(case), world(case)) else { return };
    let explanation = folder.explain();
    assert_eq!(explanation.found(), hidden, "{case}: {}", explanation.conclusion());
    let left = &explanation.last_diagnosis;
    assert_eq!(left.verdict, Verdict::Adequate, "{case}: {}", left.summary);
    // 24 to 27 coefficients a case and seven cases: beyond 4.5 standard errors once in a thousand
    // such suites if nothing were approximate (rotors turn exponentially between samples, the
    // filters see straight lines).
    assert_near_truth(case, &explanation.model, &truth(&world, &folder.vehicle), 4.5);
    assert_near_truth(case, &explanation.model, &own(&world), 4.5);
}

#[test]
fn calm_is_adequate_and_its_coefficients_right() {
    check_case("calm", &[], &|_| Vec::new());
}

#[test]
fn case_01_ground_effect() {
    check_case("case-01", &[Effect::GroundEffect], &|w| {
        vec![(Effect::GroundEffect, 0, number(w, "ge_gain"))]
    });
}

#[test]
fn case_02_flapping_moment() {
    check_case("case-02", &[Effect::FlappingMoment], &|w| {
        let moment = |name, inertia| number(w, name) / number(w, inertia);
        vec![
            (Effect::FlappingMoment, 0, -moment("flap_lat", "Ixx")),
            (Effect::FlappingMoment, 1, moment("flap", "Iyy")),
        ]
    });
}

#[test]
fn case_03_tracking_offset() {
    check_case("case-03", &[Effect::TrackingOffset], &|w| {
        vec![
            (Effect::TrackingOffset, 0, number(w, "lever_x")),
            (Effect::TrackingOffset, 1, 0.0),
            (Effect::TrackingOffset, 2, number(w, "lever_z")),
        ]
    });
}

#[test]
fn case_04_battery_voltage() {
    check_case("case-04", &[Effect::BatteryVoltage], &|w| {
        vec![(Effect::BatteryVoltage, 0, number(w, "mapB"))]
    });
}

#[test]
fn case_05_quadratic_drag() {
    check_case("case-05", &[Effect::QuadraticDrag], &|w| {
        vec![(Effect::QuadraticDrag, 0, -number(w, "qd_xy")), (Effect::QuadraticDrag, 1, -number(w, "qd_z"))]
    });
}

#[test]
fn case_06_wind_then_ground_effect() {
    check_case("case-06", &[Effect::SteadyWind, Effect::GroundEffect], &|w| {
        vec![
            (Effect::SteadyWind, 0, number(w, "wind_n")),
            (Effect::SteadyWind, 1, number(w, "wind_e")),
            (Effect::GroundEffect, 0, number(w, "ge_gain")),
        ]
    });
}

#[test]
fn case_08_tether() {
    check_case("case-08", &[Effect::Tether], &|w| {
        let stiffness = number(w, "tether_k");
        vec![
            (Effect::Tether, 0, stiffness),
            (Effect::Tether, 1, 0.0),
            (Effect::Tether, 2, 0.0),
            (Effect::Tether, 3, stiffness * number(w, "tether_z")),
        ]
    });
}

fn csv_names(folder: &Path, pick: impl Fn(&str) -> bool) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .filter_map(|entry| entry.unwrap().file_name().to_str()?.strip_suffix(".csv").map(str::to_owned))
        .filter(|name| pick(name))
        .collect();
    names.sort();
    names
}

/// Real, with measured rotor speed and IMU: motors with the right signs, drag where others found
/// it, the rotors' inertia in yaw and the moment of the airflow that its authors could not model.
#[test]
fn nanodrone_has_right_signs_drag_rotor_inertia_and_flapping_moment() {
    let Some(path) = shared("data/nanodrone") else { return };
    let train = csv_names(&path, |n| !n.ends_with("run4"));
    let mut folder = Folder::read(&path, &train, &csv_names(&path, |n| n.ends_with("run4")));
    let base = folder.identify();
    let value = |effect, k: usize| base.term(effect).unwrap().coefficients[k].value;
    for rotor in 0..4 {
        assert!(value(Effect::RotorMoments, rotor) > 0.0 && value(Effect::RotorMoments, 4 + rotor) > 0.0);
        let spin = folder.vehicle.motors.spin[rotor].yaw_sign();
        assert!(value(Effect::RotorMoments, 8 + rotor) * spin > 0.0);
    }
    for axis in 0..2 {
        let drag_per_s = -value(Effect::LinearDrag, axis) / folder.vehicle.mass;
        assert!((0.40..0.46).contains(&drag_per_s), "{drag_per_s}");
    }
    let diagnosis = folder.diagnose(&base);
    assert_eq!(diagnosis.best(), Some(Effect::RotorInertia), "{}", diagnosis.summary);
    assert!(
        diagnosis.effects.iter().any(|e| e.effect == Effect::FlappingMoment && e.supported),
        "{}",
        diagnosis.summary
    );
    let with_inertia = folder.with(&base, Effect::RotorInertia);
    let with_both = folder.with(&with_inertia, Effect::FlappingMoment);
    let (before, after) = (folder.compare(&base), folder.compare(&with_both));
    let attitude = |c: &Comparison| c.horizons.sum_1_50.attitude_rad;
    assert!(attitude(&after) < 0.8 * attitude(&before), "{} {}", attitude(&before), attitude(&after));
}

/// Real, before a fan wall: an effect whose fit does not come to an end takes no answer away.
#[test]
fn a_flight_in_strong_wind_gets_an_answer_though_a_fit_does_not_settle() {
    let Some(path) = shared("data/neuralfly") else { return };
    let names = |name: &str| vec![name.to_owned()];
    let mut folder = Folder::read(&path, &names("L1_70wind"), &names("baseline_70wind"));
    let explanation = folder.explain();
    assert_ne!(explanation.verdict(), Verdict::Adequate, "{}", explanation.conclusion());
}

/// Real, brushed motors without a map: thrust follows the voltage, and nothing holds the craft. Without the second third of the flights a
/// thrust that is linear in the commands stands in for the voltage better than the voltage does itself.
#[test]
fn nanobench_thrust_follows_the_voltage() {
    let Some(path) = shared("data/nanobench") else { return };
    let all = csv_names(&path, |_| true);
    for third in 0..2 {
        let (held_out, train): (Vec<_>, Vec<_>) =
            all.iter().cloned().enumerate().partition(|(k, _)| k % 3 == third);
        let [train, held_out] =
            [train, held_out].map(|set| set.into_iter().map(|(_, name)| name).collect::<Vec<_>>());
        let mut folder = Folder::read(&path, &train, &held_out);
        let base = folder.identify();
        let diagnosis = folder.diagnose(&base);
        let found: Vec<Effect> = diagnosis.effects.iter().filter(|e| e.supported).map(|e| e.effect).collect();
        assert_eq!(found, [Effect::BatteryVoltage], "{held_out:?}: {}", diagnosis.summary);
        if third > 0 {
            continue;
        }
        let with = folder.with(&base, Effect::BatteryVoltage);
        let after = folder.compare(&with);
        assert!(after.total.w.rms < 0.5 * folder.compare(&base).total.w.rms);
        // Its clocks wander inside a flight: the rotation is refused, and nothing is said of it.
        assert!(!base.fit.as_ref().unwrap().rotation_refused.is_empty());
        let says = |axis: &Axis| after.total[*axis].rms.is_finite();
        assert_eq!(AXES.into_iter().filter(says).collect::<Vec<_>>(), [Axis::U, Axis::V, Axis::W]);
    }
}
