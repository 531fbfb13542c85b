//! Users' effects: what is refused and how, what they mean in the equations, and the way through a model file.

use std::path::Path;
use std::time::{Duration, Instant};

use model::{Effect, Kind, Model, Plant, State, effects};
use nalgebra::Vector3;
use proptest::prelude::*;

const CABLE: &str = include_str!("my-cable.toml");

const BUMP: &str = r#"
[[effect]]
id = "bump"
acceleration.w = "-k * thrust * exp(-height / decay) + other * w / time"
coefficient = [
  { name = "k", unit = "1", possible = [0.0, 1.0], typical = 0.01 },
  { name = "decay", unit = "m", possible = [0.01, 3.0], typical = 0.3 },
  { name = "other", unit = "1", possible = [-1.0, 1.0], typical = 0.1 },
]
constant = [{ name = "time", unit = "s", value = 2.0 }]
"#;

fn refused(text: &str) -> String {
    let why = effects::parse(text, Path::new("my.toml")).expect_err(text).to_string();
    assert!(why.starts_with("my.toml: ") && why.lines().count() == 1, "{why}");
    why
}

fn effect(text: &str) -> Effect {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("my.toml");
    std::fs::write(&path, text).unwrap();
    effects::read(&path).unwrap()[0]
}

#[test]
fn what_cannot_be_right_is_refused_with_file_effect_and_field() {
    for (from, to, expected) in [
        ("/ mass\"", "/ mass + clock\"", "acceleration.north: unknown name \"clock\"; known are stiffness"),
        (
            "stiffness * north)",
            "stiffness * speed)",
            "acceleration.north: takes the difference of kg m/s^2 and kg m/s^3, ",
        ),
        (
            "- stiffness * down) / mass",
            "- stiffness * down)",
            "acceleration.down: has the unit kg m/s^2, the row needs m/s^2",
        ),
        (
            "(pull_east - stiffness * east) / mass",
            "exp(-height / 0.3) * gravity",
            "acceleration.east: names none of",
        ),
        (
            "(pull_east - stiffness * east) / mass",
            "pull_east/mass * exp(-height/0.3)",
            "takes exp of m, which must be a pure number",
        ),
        ("(pull_east - stiffness * east) / mass", "pull_east/mass ^ height", "exponent in m"),
        (
            "(pull_east - stiffness * east) / mass",
            "pull_east / mass)",
            "acceleration.east: a bracket is closed",
        ),
        (
            "acceleration.east",
            "acceleration.west",
            "acceleration.west: unknown row; rows are u, v, w, p, q, r (body), north",
        ),
        (
            "unit = \"N/m\"",
            "unit = \"N/mm\"",
            "coefficient \"stiffness\": unit: unknown unit \"mm\"; known are kg, m",
        ),
        ("[0.0, 1000.0]", "[1000.0, 0.0]", "coefficient \"stiffness\": possible: is [smallest, largest]"),
        ("typical = 1.0", "typical = -1.0", "coefficient \"stiffness\": typical"),
        ("typical = 1.0", "typical = nan", "coefficient \"stiffness\": typical"),
        ("name = \"stiffness\"", "name = \"height\"", "is the height over z = 0, -down; choose another name"),
        ("name = \"stiffness\"", "name = \"sin\"", "is a function's name"),
        ("name = \"pull_east\"", "name = \"pull_north\"", "the name is given twice"),
        ("id = \"my-cable\"", "id = \"tether\"", "effect \"tether\": id: is an effect of the catalogue"),
        ("id = \"my-cable\"", "id = \"My Cable\"", "id: is a word of a to z"),
        ("confused_with.tether", "confused_with.leash", "confused_with: unknown effect \"leash\""),
        ("sentence = \"A", "sentnce = \"A", "line 4: unknown field `sentnce`"),
        (
            "typical = 1.0 },\n]",
            "typical = 1.0 },\n{ name = \"x\", unit = \"1\", possible = [0.0, 1.0], typical = 1.0 }]",
            "coefficient x: is in no formula",
        ),
        ("[[effect]]", "[[effect]", "line 2: "),
    ] {
        assert!(CABLE.contains(from), "{from}");
        let why = refused(&CABLE.replacen(from, to, 1));
        assert!(why.contains(expected), "{to}: {why}");
    }
    assert!(
        refused(&CABLE.replacen("possible = [0.0, 1000.0]", "possible = [-inf, 1.0]", 1))
            .contains("possible")
    );
    assert!(refused(&CABLE.repeat(17)).contains("more than 16"));
}

#[test]
fn hostile_files_are_refused_at_once() {
    let deep = "(".repeat(100_000);
    let nested = format!("effect = {}{}", "[".repeat(100_000), "]".repeat(100_000));
    let bytes = "a".repeat(1_000_000);
    let formula = |text: &str| CABLE.replacen("pull_north - stiffness * north", text, 1);
    for text in [
        formula(&deep),
        formula(&"(".repeat(400)),
        formula(&"-".repeat(499)),
        formula(&"sqrt(".repeat(90)),
        nested[..60_000].to_owned(),
        nested,
        bytes,
        CABLE.replacen("my-cable", &"x".repeat(60_000), 1),
        CABLE.replacen("pull_north", &"x".repeat(400), 1),
    ] {
        let started = Instant::now();
        let why = refused(&text);
        assert!(started.elapsed() < Duration::from_millis(50), "{:?}", started.elapsed());
        assert!(why.len() < 1000, "{why}");
    }
}

#[test]
fn linear_is_what_is_linear() {
    let linear = |formula: &str| {
        let text = format!(
            "[[effect]]\nid = \"a\"\nacceleration.u = \"{formula}\"\n\
             coefficient = [{{ name = \"a\", unit = \"1/s\", possible = [0.0, 1.0], typical = 1.0 }},\n\
             {{ name = \"b\", unit = \"1/s\", possible = [0.0, 1.0], typical = 1.0 }}]"
        );
        let parsed = effects::parse(&text, Path::new("x")).unwrap_or_else(|why| panic!("{formula}: {why}"));
        parsed[0].is_linear()
    };
    for formula in
        ["a*u + b*v", "-(a - b)*u", "(a*u + b*v)*sin(phi)/2", "a*u + 0*b*u", "u*(3*a/2 - b)", "a*u+b^1*u"]
    {
        assert!(linear(formula), "{formula}");
    }
    for formula in [
        "a*u*b/a",
        "a*u + b*v + gravity",
        "sqrt(a*b)*u",
        "abs(a)*u + b*u",
        "a^2/b*u",
        "max(a,b)*u",
        "exp(a/b)*b*u",
    ] {
        assert!(!linear(formula), "{formula}");
    }
}

fn state() -> State {
    let mut state = State::at_rest(Vector3::new(0.7, -0.4, -1.3), [640.0, 620.0, 650.0, 610.0]);
    state.attitude = model::frames::quaternion_from_euler(Vector3::new(0.2, -0.3, 1.1));
    state.velocity_m_s = Vector3::new(1.0, -0.5, 0.2);
    state.rate_rad_s = Vector3::new(0.3, 0.2, -0.4);
    state
}

/// The cable of the catalogue, written by a user, moves the craft as the catalogue's does.
#[test]
fn a_users_cable_is_the_catalogues_tether() {
    let values = [0.8, 0.3, -0.2, -0.9];
    let fly = |effect: Option<Effect>| {
        let mut model = Model::thesis();
        effect.into_iter().for_each(|effect| model.set(effect, &values));
        model.set(Effect::SteadyWind, &[1.0, -0.5]);
        let plant = Plant::new(&model);
        let (mut state, substeps) = (state(), plant.substeps(0.01, 4));
        for _ in 0..100 {
            plant.step(&mut state, &[640.0, 630.0, 640.0, 630.0], 11.1, &substeps);
        }
        (plant.accelerations(&plant.sample_of(&plant.input(&state, &[640.0; 4], 11.1))), state)
    };
    let ((a, own), (b, catalogue)) = (fly(Some(effect(CABLE))), fly(Some(Effect::Tether)));
    // The same numbers in another order of additions, over 400 steps of an unstable craft.
    assert!((own.position_ned_m - catalogue.position_ned_m).norm() < 1e-9);
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    // The twin: without it the craft is elsewhere.
    let (_, without) = fly(None);
    assert!((own.position_ned_m - without.position_ned_m).norm() > 1e-3);
}

#[test]
fn a_model_with_users_effects_round_trips_and_needs_no_other_file() {
    let (cable, bump) = (effect(CABLE), effect(BUMP));
    assert_eq!((cable.info().kind, bump.info().kind), (Kind::Linear, Kind::Adjusting));
    assert_eq!(Effect::from_id("bump"), Some(bump));
    assert!(Effect::candidates().any(|e| e == bump));
    let mut model = Model::thesis();
    model.set(cable, &[0.1 + 0.2, 1.0 / 3.0, 0.0, -1.0]);
    model.set(bump, &[0.02, 0.4, 0.1]);
    let text = model.to_toml();
    let again = Model::parse(&text, Path::new("m.toml")).unwrap();
    assert_eq!(again, model);
    assert_eq!(again.to_toml(), text);
    // The same word for something else is an error, in a model as in a file of effects.
    let other = text.replacen("- stiffness * north", "- 2 * stiffness * north", 1);
    let why = Model::parse(&other, Path::new("m.toml")).unwrap_err().to_string();
    assert!(why.starts_with("m.toml: effect \"my-cable\": id: is already defined in another way"), "{why}");
    let (before, after) = text.rsplit_once("\"bump\"").unwrap();
    assert!(Model::parse(&format!("{before}\"bumb\"{after}"), Path::new("m.toml")).is_err());
}

/// An identifier that comes to mean another formula changes no model that has the old one.
#[test]
fn an_edited_effect_is_another_one_and_models_keep_theirs() {
    let text = |formula: &str| {
        format!(
            "[[effect]]\nid = \"edited\"\nacceleration.u = \"{formula}\"\n\
             coefficient = [{{ name = \"k\", unit = \"1/s\", possible = [-1.0, 1.0], typical = 0.1 }}]"
        )
    };
    let path = Path::new("edited.toml");
    let draft = |formula: &str| effects::draft(&text(formula), path).unwrap()[0];
    let (first, second) = (draft("-k * u"), draft("k * v"));
    assert_eq!(Effect::from_id("edited"), None, "what is only tried is no candidate");
    assert_eq!((first, first.info().id), (draft("-k * u"), "edited"));
    assert_ne!(first, second);

    first.make_known(path).unwrap();
    assert_eq!(Effect::from_id("edited"), Some(Effect::User(first)));
    let mut model = Model::thesis();
    model.set(Effect::User(first), &[0.2]);
    let before = model.to_toml();
    second.make_known(path).unwrap();
    assert_eq!(Effect::from_id("edited"), Some(Effect::User(second)));
    assert_eq!(Effect::candidates().filter(|effect| effect.id() == "edited").count(), 1);
    assert_eq!(model.to_toml(), before);
    assert!(model.has(Effect::User(first)) && !model.has(Effect::User(second)));

    second.forget();
    assert_eq!(Effect::from_id("edited"), None);
    assert_eq!(Model::parse(&before, Path::new("m.toml")).unwrap(), model);
    first.forget();
}

/// The file of the other effect may be elsewhere.
#[test]
fn a_model_file_is_read_without_the_effects_that_its_own_is_confused_with() {
    let text = |id: &str, more: &str| {
        format!(
            "[[effect]]\nid = \"{id}\"\nacceleration.u = \"-k * u\"\n{more}\n\
             coefficient = [{{ name = \"k\", unit = \"1/s\", possible = [-1.0, 1.0], typical = 0.1 }}]"
        )
    };
    let path = Path::new("x.toml");
    let other = effects::draft(&text("other-one", ""), path).unwrap()[0];
    other.make_known(path).unwrap();
    let more = "confused_with.other-one = \"fly slowly\"";
    let mut model = Model::thesis();
    model.set(Effect::User(effects::draft(&text("confused-one", more), path).unwrap()[0]), &[0.1]);
    other.forget();
    assert!(effects::draft(&text("confused-two", more), path).is_err());
    assert_eq!(Model::parse(&model.to_toml(), Path::new("m.toml")).unwrap(), model);
}

#[test]
fn a_formula_without_a_value_is_named_not_flown_over() {
    let root = effect(
        "[[effect]]\nid = \"root\"\nacceleration.u = \"k * sqrt(height - low)\"\n\
         coefficient = [{ name = \"k\", unit = \"m^0.5/s^2\", possible = [-1.0, 1.0], typical = 0.1 }]\n\
         constant = [{ name = \"low\", unit = \"m\", value = 1.0 }]",
    );
    let mut model = Model::thesis();
    model.set(root, &[0.1]);
    let plant = Plant::new(&model);
    let substeps = plant.substeps(0.01, 4);
    let step = |height_m: f64| {
        let mut state = State::at_rest(Vector3::new(0.0, 0.0, -height_m), [300.0; 4]);
        state.velocity_m_s.z = 1.0;
        let before = state;
        plant.step(&mut state, &[300.0; 4], 11.1, &substeps);
        (state.is_finite(), plant.undefined_in_step(&before, &[300.0; 4], 11.1, &substeps))
    };
    assert_eq!(step(1.5), (true, None));
    // Below the height at once, and in the middle of the step.
    for height_m in [0.9, 1.005] {
        let (finite, undefined) = step(height_m);
        let undefined = undefined.expect("the formula is named").to_string();
        assert!(!finite, "{height_m}");
        assert_eq!(
            undefined,
            "effect \"root\": acceleration.u = \"k * sqrt(height - low)\" is not a finite number"
        );
    }
}

proptest! {
    /// Whatever a file holds: an answer in one line, and at once.
    #[test]
    fn mutated_files_are_parsed_or_refused(
        cuts in prop::collection::vec((0_usize..1200, 0_usize..1200, 0_usize..12), 1..4),
        bump in any::<bool>(),
    ) {
        let scraps = ["(", ")", "\"", "^", "-", "9e999", " = ", "\n", "[[effect]]", "{", "nan", "\u{e9}"];
        let mut text = if bump { BUMP.to_owned() } else { CABLE.to_owned() };
        for (from, to, scrap) in cuts {
            let (from, to) = (from.min(to) % text.len(), from.max(to) % text.len());
            let (from, to) = (from.min(to), from.max(to).min(from.min(to) + 8));
            if text.is_char_boundary(from) && text.is_char_boundary(to) {
                text.replace_range(from..to, scraps[scrap]);
            }
        }
        if let Err(why) = effects::parse(&text, Path::new("my.toml")) {
            prop_assert_eq!(why.to_string().lines().count(), 1, "{}", why);
        }
    }

    #[test]
    fn random_text_is_refused(text in "\\PC{0,200}") {
        if let Err(why) = effects::parse(&text, Path::new("my.toml")) {
            prop_assert_eq!(why.to_string().lines().count(), 1);
        }
    }
}

const WAKE: &str = r#"
[[effect]]
id = "wake"
acceleration.w = "k * lag(w, memory) + k * lag(lag(w, memory), slower)"
coefficient = [{ name = "k", unit = "1/s", possible = [-3.0, 3.0], typical = 0.1 }]
constant = [
  { name = "memory", unit = "s", value = 0.4 },
  { name = "slower", unit = "s", value = 0.7 },
  { name = "length", unit = "m", value = 0.4 },
  { name = "long", unit = "s", value = 99.0 },
]
"#;

#[test]
fn a_look_back_names_a_quantity_and_a_constant_time() {
    assert_eq!(effect(WAKE).info().kind, Kind::Linear);
    for (to, expected) in [
        ("lag(w, 0.4)", "\"0.4\" is no constant of the effect; the time of a lag is one"),
        ("lag(w, k)", "\"k\" is no constant of the effect"),
        ("lag(w, length)", "\"length\" is the time of a lag: 0.01 to 60 s"),
        ("lag(w, long)", "\"long\" is the time of a lag: 0.01 to 60 s"),
        ("lag(k, memory)", "\"k\" does not change: lag(...) takes a measured quantity first"),
        ("lag(w + u, memory)", "lag(...) takes the name of a quantity and that of a constant"),
        ("lag(w)", "lag(...) takes a quantity and a constant, such as lag(w, memory)"),
        ("lag(lag(lag(w, memory), memory), memory)", "lags are nested deeper than 2"),
        ("lag(wind, memory)", "unknown name \"wind\""),
        ("lag(w, memory", "a bracket is not closed"),
        ("lag + w", "lag is a function; write lag(...)"),
        ("lag(height, memory)", "adds m/s and m/s^2, which must have the same unit"),
    ] {
        let why = refused(&WAKE.replacen("lag(w, memory)", to, 1));
        assert!(why.contains(expected), "{to}: {why}");
    }
}

const TIRED: &str = r#"
[[effect]]
id = "tired"
acceleration.w = "thrust * k * integral(power)"
coefficient = [{ name = "k", unit = "1/J", possible = [-1.0, 1.0], typical = 1e-6 }]
constant = [{ name = "memory", unit = "s", value = 0.4 }]
"#;

#[test]
fn an_integral_has_its_own_unit_and_takes_a_quantity() {
    effect(TIRED);
    effect(&TIRED.replace("integral(power)", "integral(lag(power, memory))").replace("tired", "tired-later"));
    for (to, expected) in [
        ("power", "has the unit m/s^3"),
        ("integral(k)", "\"k\" does not change: integral(...) takes a measured quantity first"),
        ("integral(power, memory)", "integral(...) takes a quantity, such as integral(power)"),
        ("integral()", "integral(...) takes a quantity, such as integral(power)"),
        ("integral(2 * power)", "integral(...) takes the name of a quantity, such as integral(power)"),
        ("integral + power", "integral is a function; write integral(...)"),
        ("integral(integral(integral(power)))", "lags are nested deeper than 2"),
        ("integral(energy)", "unknown name \"energy\""),
    ] {
        let why = refused(&TIRED.replacen("integral(power)", to, 1));
        assert!(why.contains(expected), "{to}: {why}");
    }
}

/// Four rotors at one speed for half a second: beta R omega^3 each.
#[test]
fn energy_used_is_that_of_the_rotors_and_pulls_on_the_craft() {
    let tired = effect(&TIRED.replace("\"tired\"", "\"tired-battery\""));
    let mut model = Model::thesis();
    let k = 1e-6;
    model.set(tired, &[k]);
    let without = Plant::new(&Model::thesis());
    let plant = Plant::new(&model);
    let speed_rad_s = 500.0;
    let mut state = State::at_rest(Vector3::zeros(), [speed_rad_s; 4]);
    for _ in 0..50 {
        plant.step(&mut state, &[speed_rad_s; 4], 11.1, &plant.substeps(0.01, 1));
    }
    let vehicle = &model.vehicle;
    let energy_j = 4.0 * vehicle.beta_kg_m() * vehicle.rotor_radius * speed_rad_s.powi(3) * 0.5;
    let own = |plant: &Plant| {
        plant.accelerations(&plant.sample_of(&plant.input(&state, &[speed_rad_s; 4], 11.1)))[2]
    };
    let thrust_m_s2 = 4.0 * vehicle.beta_kg_m() * speed_rad_s.powi(2) / vehicle.mass;
    let expected = k * energy_j * thrust_m_s2;
    assert!(
        ((own(&plant) - own(&without)) / expected - 1.0).abs() < 1e-6,
        "{} {expected}",
        own(&plant) - own(&without)
    );
}

/// Held at a speed through the air, the first lag comes to it as 1 - exp(-t / a), and the second behind it as
/// 1 - (a exp(-t / a) - b exp(-t / b)) / (a - b). In still air a craft that falls freely gains g t, and its first lag is g a
/// (t / a - 1 + exp(-t / a)).
#[test]
fn a_falling_craft_remembers_how_it_sank() {
    let wake = effect(WAKE);
    let mut model = Model::new(Model::thesis().vehicle);
    let k = 0.25;
    model.set(wake, &[k]);
    let (plant, gravity) = (Plant::new(&model), model.vehicle.gravity);
    let still = |state: &State| {
        let sample = plant.input(state, &[0.0; 4], 11.1);
        plant.accelerations(&plant.sample_of(&sample))[2]
    };
    let substeps = plant.substeps(0.01, 2);
    let mut state = State::at_rest(Vector3::zeros(), [0.0; 4]);
    // w' = g + k m + k n, m' = (w - m) / a, n' = (m - n) / b, by steps of 20 us.
    let (mut w, mut m, mut n, step_s) = (0.0, 0.0, 0.0, 2e-5);
    for tick in 1..=100 {
        plant.step(&mut state, &[0.0; 4], 11.1, &substeps);
        for _ in 0..500 {
            let (slope, first, second) = (gravity + k * (m + n), (w - m) / 0.4, (m - n) / 0.7);
            w += step_s * slope;
            m += step_s * first;
            n += step_s * second;
        }
        assert!((state.velocity_m_s.z - w).abs() < 1e-3 * w, "{tick}: {} {w}", state.velocity_m_s.z);
        assert!((still(&state) - k * (m + n)).abs() < 1e-3 * (1.0 + k * (m + n)), "{tick}");
    }
    assert!(w > 1.05 * gravity, "what is remembered pushes: {w}");
}

/// What has not been flown yet has been so for ever.
#[test]
fn a_flight_that_begins_in_motion_remembers_that_motion() {
    let wake = effect(WAKE);
    let mut model = Model::new(Model::thesis().vehicle);
    model.set(wake, &[0.3]);
    let plant = Plant::new(&model);
    let mut state = State::at_rest(Vector3::zeros(), [0.0; 4]);
    state.velocity_m_s.z = 2.0;
    plant.step(&mut state, &[0.0; 4], 11.1, &plant.substeps(1e-4, 1));
    let rows = plant.accelerations(&plant.sample_of(&plant.input(&state, &[0.0; 4], 11.1)));
    assert!((rows[2] - 0.3 * 4.0).abs() < 1e-2, "{rows:?}");
}

#[test]
fn a_model_that_looks_back_is_flown_and_not_linearised() {
    let wake = effect(WAKE);
    let mut model = Model::thesis();
    model.set(wake, &[0.1]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wake.toml");
    std::fs::write(&path, model.to_toml()).unwrap();
    assert!(Model::read_to_simulate(&path).is_ok());
    let why = Model::read_to_linearize(&path).unwrap_err().to_string();
    assert!(why.contains("effect \"wake\" looks back with lag(...)"), "{why}");
}
