//! Models that `quadlab export` writes, flown in other people's simulators and answered by other people's design tools.
//!
//! Where these are not installed (`cargo xtask setup` puts them into `target/peers`), the stories are skipped by name.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::Command;

use design::plant::{INPUTS, Linear, STATES, TrimTarget};
use model::{Effect, Model, Plant, State, frames, physical_parameters};
use nalgebra::{DMatrix, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Python with the other tools; nothing (and a line that says so) where it is not there.
fn python() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/peers/bin/python");
    if path.exists() {
        return Some(path);
    }
    println!("SKIPPED: {} is not there: python3 tests/peers/tools/install.py target/peers", path.display());
    None
}

/// The thesis' craft as a rigid body with rotors and drag, all that other simulators have; `lag` in rad/s.
fn rigid(lag: Option<f64>, drag_n_s_m: f64) -> Model {
    let mut model = Model::thesis();
    model.vehicle.motors.lag = lag;
    let taken = [Effect::Thrust, Effect::RotorMoments, Effect::InertiaCoupling, Effect::LinearDrag];
    model.terms.retain(|term| taken.contains(&term.effect));
    model.set(Effect::LinearDrag, &[-drag_n_s_m; 3]);
    let own = physical_parameters(&model);
    let [x, y, z] =
        ["I_xx", "I_yy", "I_zz"].map(|symbol| own.iter().find(|one| one.symbol == symbol).unwrap().value);
    model.set(Effect::InertiaCoupling, &[(y - z) / x, (z - x) / y, (x - y) / z]);
    model
}

/// The real program's file for a tool, and what it says of it.
fn exported(folder: &Path, model: &Model, to: &str) -> (PathBuf, Value) {
    let (own, out) = (folder.join("model.toml"), folder.join("craft.out"));
    std::fs::write(&own, model.to_toml()).unwrap();
    let output = Command::new(stories::program("quadlab"))
        .args(["export", "--json", "--force", "--to", to, "--model"])
        .args([&own, Path::new("--out"), &out])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (out, serde_json::from_slice(&output.stdout).unwrap())
}

/// What a script of `tests/peers/tools` says of cases.
fn told(python: &Path, script: &str, file: &Path, cases: &Value) -> Value {
    let folder = TempDir::new().unwrap();
    let written = folder.path().join("cases.json");
    std::fs::write(&written, cases.to_string()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/tools").join(script);
    let output = Command::new(python).args([&script, file, &written]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Forward, right, down to forward, left, up, and north, east, down to north, west, up.
fn up(v: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// A state in the axes of other simulators, with thrust and speed of each rotor.
fn described(state: &State, thrust: f64, commanded: &[f64; 4]) -> Value {
    let q = state.attitude;
    let velocity = frames::dcm_from_quaternion(&q).transpose() * state.velocity_m_s;
    let thrusts = |speeds: &[f64; 4]| speeds.map(|speed| thrust * speed * speed);
    json!({
        "position": up(state.position_ned_m).as_slice(),
        "attitude": [q[0], q[1], -q[2], -q[3]],
        "velocity": up(velocity).as_slice(),
        "rates": up(state.rate_rad_s).as_slice(),
        "thrust": thrusts(commanded),
        "thrust_now": thrusts(&state.rotor_rad_s),
        "rotors": state.rotor_rad_s,
        "commanded": commanded,
    })
}

/// The state at the end of a flight in their axes: place, attitude, velocity over ground, rates.
fn end(state: &State) -> Vec<f64> {
    let q = state.attitude;
    let velocity = frames::dcm_from_quaternion(&q).transpose() * state.velocity_m_s;
    let mut all = up(state.position_ned_m).as_slice().to_vec();
    all.extend([q[0], q[1], -q[2], -q[3]]);
    all.extend(up(velocity).iter().chain(up(state.rate_rad_s).iter()));
    all
}

/// Acceleration over ground and of the rates, in their axes.
fn accelerations(model: &Model, state: &State) -> Vec<f64> {
    let plant = Plant::new(model);
    let a = plant.accelerations(&plant.sample_of(&plant.input(state, &state.rotor_rad_s, 11.1)));
    let dcm = frames::dcm_from_quaternion(&state.attitude);
    let gravity = Vector3::new(0.0, 0.0, model.vehicle.gravity);
    let over_ground = dcm.transpose() * Vector3::new(a[0], a[1], a[2]) + gravity;
    up(over_ground).iter().chain(up(Vector3::new(a[3], a[4], a[5])).iter()).copied().collect()
}

fn random_states(hover: f64, with_speeds: bool) -> Vec<State> {
    let seed = 17;
    println!("seed {seed}");
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut draw = |most: f64| most * (2.0 * rng.random::<f64>() - 1.0);
    (0..40)
        .map(|_| {
            let mut state = State::at_rest(Vector3::new(draw(2.0), draw(2.0), -3.0), [hover; 4]);
            state.attitude = frames::quaternion_from_euler(Vector3::new(draw(1.0), draw(1.0), draw(3.0)));
            state.velocity_m_s = Vector3::new(draw(3.0), draw(3.0), draw(3.0));
            state.rate_rad_s = Vector3::new(draw(4.0), draw(4.0), draw(4.0));
            if with_speeds {
                state.rotor_rad_s = [0; 4].map(|_| hover * (1.0 + draw(0.25)));
            }
            state
        })
        .collect()
}

/// The end of a flight of the plant with held commands.
fn flown(model: &Model, start: &State, commanded: &[f64; 4], duration_s: f64) -> State {
    let plant = Plant::new(model);
    let substeps = plant.substeps(0.002, 1);
    let mut state = *start;
    for _ in 0..(duration_s / 0.002).round() as usize {
        plant.step(&mut state, commanded, 11.1, &substeps);
    }
    state
}

fn near(found: &[f64], expected: &[f64], most: f64, what: &str) {
    assert_eq!(found.len(), expected.len());
    for (found_one, one) in found.iter().zip(expected) {
        assert!((found_one - one).abs() < most, "{what}: {found:?}, expected {expected:?}");
    }
}

/// That another tool's accelerations at states are those of our plant.
fn have_our_accelerations(found: &Value, model: &Model, states: &[State]) {
    for (state, found) in states.iter().zip(found["accelerations"].as_array().unwrap()) {
        near(&numbers(found), &accelerations(model, state), 1e-6, "accelerations");
    }
}

fn value(document: &Value, symbol: &str) -> f64 {
    let all = document["physical"].as_array().unwrap();
    all.iter().find(|one| one["symbol"] == symbol).unwrap()["value"].as_f64().unwrap()
}

/// Without drag, which MuJoCo does not have: the same accelerations everywhere, and the same flights, to the rounding of both.
#[test]
fn mujoco_flies_the_same_craft() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let model = rigid(None, 0.0);
    let (file, document) = exported(folder.path(), &model, "mujoco");
    let (thrust, hover) = (value(&document, "k_T"), value(&document, "omega_h"));
    let states = random_states(hover, true);
    let commanded = [0.999, 1.001, 1.0005, 0.9995].map(|part| part * hover * 1.02);
    let mut start = State::at_rest(Vector3::new(0.0, 0.0, -1.0), commanded);
    start.velocity_m_s = Vector3::new(0.5, -0.3, 0.0);
    start.rate_rad_s = Vector3::new(0.2, -0.1, 0.3);
    let mut flight = described(&start, thrust, &commanded);
    flight["duration_s"] = json!(1.0);
    let told_of: Vec<Value> =
        states.iter().map(|state| described(state, thrust, &state.rotor_rad_s)).collect();
    let found = told(&python, "fly_mujoco.py", &file, &json!({ "states": told_of, "flights": [flight] }));
    have_our_accelerations(&found, &model, &states);
    let expected = flown(&model, &start, &commanded, 1.0);
    // After a second the craft has turned by more than half a turn and is 2 m away.
    near(&numbers(&found["flights"][0]), &end(&expected), 1e-5, "flight");
    assert!((expected.position_ned_m - start.position_ned_m).norm() > 0.3);
}

/// The lag of the rotors is one of the thrust in MuJoCo: the same for small changes.
#[test]
fn mujocos_rotors_follow_as_ours_do() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let model = rigid(Some(21.5), 0.0);
    let (file, document) = exported(folder.path(), &model, "mujoco");
    let (thrust, hover) = (value(&document, "k_T"), value(&document, "omega_h"));
    let start = State::at_rest(Vector3::new(0.0, 0.0, -1.0), [hover; 4]);
    let flights = [0.05, 0.15].map(|duration_s| {
        let mut flight = described(&start, thrust, &[1.01 * hover; 4]);
        flight["duration_s"] = json!(duration_s);
        (flight, flown(&model, &start, &[1.01 * hover; 4], duration_s))
    });
    let cases = json!({ "states": [], "flights": flights.each_ref().map(|(flight, _)| flight) });
    let found = told(&python, "fly_mujoco.py", &file, &cases);
    for ((_, expected), found) in flights.iter().zip(found["flights"].as_array().unwrap()) {
        let (found, expected) = (numbers(found)[9], end(expected)[9]);
        assert!(expected > 1e-4 && (found / expected - 1.0).abs() < 0.02, "{found} m/s, expected {expected}");
    }
    let left_out = document["left_out"].to_string();
    assert!(left_out.contains("motors.lag"), "{left_out}");
    // The thrusts of the key hold a craft whose rotors differ.
    near(&numbers(&found["hover"]), &[0.0; 6], 1e-9, "accelerations in hover");
}

/// The thesis' craft with rotors that are all alike, as rotorpy has them.
fn with_equal_rotors(lag: Option<f64>, drag_n_s_m: f64) -> Model {
    let mut model = rigid(lag, drag_n_s_m);
    let moments = model.term(Effect::RotorMoments).unwrap().values();
    let mean = |from: usize| moments[from..from + 4].iter().map(|one| one.abs()).sum::<f64>() / 4.0;
    let signed = moments.iter().enumerate().map(|(k, one)| mean(k / 4 * 4).copysign(*one));
    model.set(Effect::RotorMoments, &signed.collect::<Vec<f64>>());
    model
}

/// Without drag: the same accelerations everywhere, and the same flight with the lag of the rotors.
#[test]
fn rotorpy_flies_the_same_craft() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let model = with_equal_rotors(Some(21.5), 0.0);
    let (file, document) = exported(folder.path(), &model, "rotorpy");
    let hover = value(&document, "omega_h");
    let states = random_states(hover, true);
    let start = State::at_rest(Vector3::new(0.0, 0.0, -1.0), [hover; 4]);
    let commanded = [1.01, 1.0, 1.002, 1.01].map(|part| part * hover);
    let mut flight = described(&start, 1.0, &commanded);
    flight["duration_s"] = json!(1.0);
    let told_of: Vec<Value> = states.iter().map(|state| described(state, 1.0, &state.rotor_rad_s)).collect();
    let found = told(&python, "fly_rotorpy.py", &file, &json!({ "states": told_of, "flights": [flight] }));
    have_our_accelerations(&found, &model, &states);
    let expected = end(&flown(&model, &start, &commanded, 1.0));
    near(&numbers(&found["flights"][0]), &expected, 1e-4, "flight");
    assert!(expected[10..].iter().any(|rate| rate.abs() > 0.5), "{expected:?}");
}

/// rotorpy's drag goes with the speed of the rotors, and brakes turning too: it is ours where the rotors turn as in hover and the craft
/// does not turn.
#[test]
fn rotorpys_drag_in_hover_is_that_of_the_model() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let model = with_equal_rotors(None, 0.27);
    let (file, document) = exported(folder.path(), &model, "rotorpy");
    let mut states = random_states(value(&document, "omega_h"), false);
    states.iter_mut().for_each(|state| state.rate_rad_s = Vector3::zeros());
    let told_of: Vec<Value> = states.iter().map(|state| described(state, 1.0, &state.rotor_rad_s)).collect();
    let found = told(&python, "fly_rotorpy.py", &file, &json!({ "states": told_of, "flights": [] }));
    have_our_accelerations(&found, &model, &states);
    let left_out = document["left_out"].to_string();
    assert!(left_out.contains("linear-drag") && left_out.contains("time constant"), "{left_out}");
}

/// What Drake, which reads Gazebo's files, and the equations of Gazebo's motor model make of an exported craft at states.
fn in_gazebo(python: &Path, file: &Path, model: &Model, states: &[State]) -> Value {
    let told_of: Vec<Value> = states.iter().map(|state| described(state, 1.0, &state.rotor_rad_s)).collect();
    told(python, "fly_gazebo.py", file, &json!({ "states": told_of, "gravity": model.vehicle.gravity }))
}

/// Without drag, with rotors that differ: the same accelerations everywhere, and the mass and the inertia of the whole.
#[test]
fn gazebos_craft_has_the_same_accelerations() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let mut model = rigid(Some(21.5), 0.0);
    model.set(Effect::UnequalThrust, &[0.02, -0.03, 0.01]);
    let (file, document) = exported(folder.path(), &model, "gazebo");
    let states = random_states(value(&document, "omega_h"), true);
    let found = in_gazebo(&python, &file, &model, &states);
    have_our_accelerations(&found, &model, &states);
    near(&[found["mass"].as_f64().unwrap()], &[value(&document, "m")], 1e-12, "mass, kg");
    near(&numbers(&found["center"]), &[0.0; 3], 1e-12, "center of mass, m");
    let inertia: Vec<f64> = found["inertia"].as_array().unwrap().iter().flat_map(numbers).collect();
    let [x, y, z] = ["I_xx", "I_yy", "I_zz"].map(|symbol| value(&document, symbol));
    near(&inertia, &[x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z], 1e-12, "inertia, kg m^2");
    near(&numbers(&found["lag"]), &[1.0 / 21.5; 4], 1e-12, "time constants, s");
}

/// Gazebo's drag goes with the speed of the rotors, brakes turning too, and not along their axes: it is ours in hover, for a level craft
/// that moves along the ground.
#[test]
fn gazebos_drag_in_hover_is_that_of_the_model() {
    let Some(python) = python() else { return };
    let folder = TempDir::new().unwrap();
    let model = with_equal_rotors(None, 0.27);
    let (file, document) = exported(folder.path(), &model, "gazebo");
    let mut states = random_states(value(&document, "omega_h"), false);
    states.iter_mut().for_each(|state| {
        state.rate_rad_s = Vector3::zeros();
        state.velocity_m_s.z = 0.0;
    });
    have_our_accelerations(&in_gazebo(&python, &file, &model, &states), &model, &states);
    let left_out = document["left_out"].to_string();
    assert!(
        ["linear-drag", "time constant", "9.8 m/s^2"].iter().all(|own| left_out.contains(own)),
        "{left_out}"
    );
}

/// PX4's simulation, by the equations of `generate_force_and_torques` in its `sih.cpp`: the same accelerations where each motor's
/// command is its part of the full thrust. With rotors that turn against PX4's usual directions, as the thesis' do, and with them.
#[test]
fn px4s_simulation_has_the_same_accelerations() {
    for turns in [1.0, -1.0] {
        let folder = TempDir::new().unwrap();
        let mut model = with_equal_rotors(None, 0.0);
        let moments = model.term(Effect::RotorMoments).unwrap().values();
        let turned = moments.iter().enumerate().map(|(k, one)| if k < 8 { *one } else { turns * one });
        model.set(Effect::RotorMoments, &turned.collect::<Vec<f64>>());
        let (file, document) = exported(folder.path(), &model, "px4");
        let text = std::fs::read_to_string(&file).unwrap();
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        let all: std::collections::BTreeMap<&str, f64> = lines
            .map(|line| line.split('\t').collect::<Vec<_>>())
            .map(|fields| (fields[2], fields[3].parse().unwrap()))
            .collect();
        let of = |name: &str| all[name];
        // PX4's rotors: front right, rear left, front left, rear right.
        let order = [1, 3, 0, 2];
        let most = {
            let plant = Plant::new(&model);
            plant.commanded_rad_s(&[model.vehicle.motors.command_range[1]; 4], model.reference.battery_v)[0]
        };
        for mut state in random_states(value(&document, "omega_h"), true) {
            state.rate_rad_s = Vector3::zeros();
            state.velocity_m_s = Vector3::zeros();
            let u = order.map(|own| (state.rotor_rad_s[own] / most).powi(2));
            let force = of("SIH_T_MAX") * u.iter().sum::<f64>();
            let moment = Vector3::new(
                of("SIH_L_ROLL") * of("SIH_T_MAX") * (-u[0] + u[1] + u[2] - u[3]) / of("SIH_IXX"),
                of("SIH_L_PITCH") * of("SIH_T_MAX") * (u[0] - u[1] + u[2] - u[3]) / of("SIH_IYY"),
                of("SIH_Q_MAX") * (u[0] + u[1] - u[2] - u[3]) / of("SIH_IZZ"),
            );
            let dcm = frames::dcm_from_quaternion(&state.attitude);
            let gravity = Vector3::new(0.0, 0.0, model.vehicle.gravity);
            let over_ground = dcm.transpose() * Vector3::new(0.0, 0.0, -force / of("SIH_MASS")) + gravity;
            let expected: Vec<f64> = up(over_ground).iter().chain(up(moment).iter()).copied().collect();
            near(&accelerations(&model, &state), &expected, 1e-5, "accelerations");
        }
        for (k, own) in order.into_iter().enumerate() {
            let yaw = model.term(Effect::RotorMoments).unwrap().values()[8 + own];
            assert_eq!(of(&format!("CA_ROTOR{k}_KM")).signum(), yaw.signum(), "rotor {k} of PX4");
        }
        let said = document["left_out"].to_string().contains("SIH_Q_MAX is negative");
        assert_eq!(said, of("SIH_Q_MAX") < 0.0);
    }
}

/// Poles and channels of the whole thesis' model, and what small steps of the rotors do to the nonlinear plant.
fn answers_as_the_plant_does(interpreter: &Path, to: &str, script: &str) {
    let folder = TempDir::new().unwrap();
    let model = Model::thesis();
    let (file, _) = exported(folder.path(), &model, to);
    let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
    let frequencies = [0.3, 1.0, 4.0, 15.0];
    let (size, duration_s) = (0.05, 0.4);
    let step = |input: &str, output: &str| json!({ "input": input, "output": output, "size": size, "duration_s": duration_s });
    let channels =
        [("roll", "tau_phi", "phi", "p"), ("pitch", "tau_theta", "theta", "q"), ("z", "T_Z", "z_e", "w")];
    let steps: Vec<Value> = channels.iter().map(|(_, input, _, output)| step(input, output)).collect();
    let found =
        told(interpreter, script, &file, &json!({ "frequencies_rad_s": frequencies, "steps": steps }));
    let a = DMatrix::from_fn(12, 12, |i, j| linear.a[(i, j)]);
    let expected = a.complex_eigenvalues();
    for pole in found["poles"].as_array().unwrap() {
        let [re, im] = numbers(pole)[..] else { panic!("{pole}") };
        let distance = expected.iter().map(|own| (own.re - re).hypot(own.im - im)).fold(f64::MAX, f64::min);
        // The integrators of place stand on each other: their poles are the least exact.
        assert!(distance < 1e-4, "{pole}");
    }
    for ((_, input, _, output), found) in channels.iter().zip(found["steps"].as_array().unwrap()) {
        let input = INPUTS.iter().position(|name| name == input).unwrap();
        let mut inputs = Vector4::zeros();
        inputs[input] = size;
        let squares = linear.effectiveness.try_inverse().unwrap() * inputs;
        let hover = linear.equilibrium.rotor_rad_s;
        let commanded: [f64; 4] = std::array::from_fn(|k| (hover[k] * hover[k] + squares[k]).sqrt());
        let start = State::at_rest(Vector3::new(0.0, 0.0, -1.0), hover);
        let state = flown(&model, &start, &commanded, duration_s);
        let row = STATES.iter().position(|name| name == output).unwrap();
        let expected = match row {
            3..6 => state.velocity_m_s[row - 3],
            9..12 => state.rate_rad_s[row - 9],
            _ => panic!("{output}"),
        };
        let found = found.as_f64().unwrap();
        assert!((found / expected - 1.0).abs() < 0.02, "{output}: {found}, the plant {expected}");
    }
    for (name, ..) in channels {
        let own = linear.channels(design::plant::CANCEL_TOLERANCE).unwrap();
        let channel = own.iter().find(|channel| channel.id.name == name).unwrap();
        let at = |coefficients: &[f64], s: design::Complex<f64>| {
            coefficients.iter().fold(design::Complex::new(0.0, 0.0), |sum, c| sum * s + c)
        };
        for (frequency, found) in frequencies.iter().zip(found["channels"][name].as_array().unwrap()) {
            let s = design::Complex::new(0.0, *frequency);
            let expected = at(&channel.numerator(), s) / at(&channel.denominator(), s);
            near(&numbers(found), &[expected.re, expected.im], 1e-9 * expected.norm().max(1.0), name);
        }
    }
}

#[test]
fn python_control_answers_as_the_plant_does() {
    let Some(python) = python() else { return };
    answers_as_the_plant_does(&python, "python-control", "respond_control.py");
}

#[test]
fn octave_answers_as_the_plant_does() {
    let has = Command::new("octave-cli").args(["--eval", "pkg load control"]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        println!(
            "SKIPPED: octave is not installed: apt-get install --yes --no-install-recommends octave octave-control"
        );
        return;
    }
    answers_as_the_plant_does(Path::new("octave-cli"), "octave", "respond_octave.m");
}

/// Models that other tools cannot take are refused in one line that says what to do.
#[test]
fn what_cannot_be_exported_is_refused_in_one_line() {
    let folder = TempDir::new().unwrap();
    let refused = |change: &dyn Fn(&mut Model), arguments: &[&str]| {
        let mut model = Model::thesis();
        change(&mut model);
        let own = folder.path().join("model.toml");
        std::fs::write(&own, model.to_toml()).unwrap();
        let output = Command::new(stories::program("quadlab"))
            .current_dir(folder.path())
            .args(["export", "--model", "model.toml", "--out", "craft.out"])
            .args(arguments)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(!folder.path().join("craft.out").exists());
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        said
    };
    let without = |effect: Effect| move |model: &mut Model| model.terms.retain(|term| term.effect != effect);
    let said = refused(&without(Effect::InertiaCoupling), &["--to", "mujoco"]);
    assert!(said.contains("moment of inertia in yaw") && said.contains("inertia-coupling"), "{said}");
    let said = refused(&without(Effect::RotorMoments), &["--to", "px4"]);
    assert!(said.contains("rotor-moments"), "{said}");
    let body = |model: &mut Model| model.set(Effect::InertiaCoupling, &[0.91, -1.0, 0.0]);
    let said = refused(&body, &["--to", "rotorpy"]);
    assert!(said.contains("are impossible"), "{said}");
    let said = refused(&|_| {}, &["--to", "mujoco", "--at", "trim.toml"]);
    assert!(said.contains("python-control"), "{said}");
    for to in ["c", "simulink"] {
        let said = refused(&|_| {}, &["--to", to]);
        assert!(said.contains("--gains"), "{to}: {said}");
    }
}
