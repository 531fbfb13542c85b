//! The simulated worlds themselves: mechanics against closed forms, sensors against their data
//! sheet, and the same motion from the product's plant, which was written from other equations.

use flights::{Column, Flight};
use model::{Effect, Model, Plant, State};
use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use stories::world::{Body, Craft, OUTSIDE, PLANTED, Pattern, STEP_S, Sensors, Size, World, changes};

fn rng(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A craft without air: no thrust, no drag, no damping. Its rotors still turn.
fn in_vacuum(size: Size, seed: u64) -> Craft {
    let mut craft = World::new(size, seed).craft;
    (craft.thrust_n_s2, craft.torque_nm_s2) = (1e-12, 0.0);
    (craft.drag_n_s_m, craft.damping_nm_s) = ([0.0; 3], [0.0; 3]);
    (craft.battery.decay_v_s, craft.battery.sag_v) = (0.0, 0.0);
    craft
}

/// The craft at rest, its rotors at `speed` and staying there with the command that is returned.
fn with_rotors(craft: &Craft, speed_rad_s: f64) -> (Body, [f64; 4]) {
    let mut body = Body::hovering(craft, Vector3::zeros());
    body.rotor_rad_s = [speed_rad_s; 4];
    (body, [craft.map.command_for(speed_rad_s, craft.battery.full_v); 4])
}

fn steps(body: &mut Body, craft: &Craft, command: &[f64; 4], time_s: f64) {
    for step in 0..(time_s / STEP_S).round() as usize {
        body.step(craft, command, step as f64 * STEP_S, &mut rng(0));
    }
}

fn rotation_energy(body: &Body, craft: &Craft) -> f64 {
    let rate = body.rate_rad_s(craft);
    0.5 * rate.dot(&(craft.inertia_kg_m2 * rate))
}

#[test]
fn a_tumbling_body_keeps_its_energy_and_momentum_for_10_s() {
    let craft = in_vacuum(Size::F330, 3);
    let tumble = |craft: &Craft| {
        let (mut body, command) = with_rotors(craft, 600.0);
        body.set_rate_rad_s(craft, Vector3::new(2.0, 0.7, -1.1));
        let before = (rotation_energy(&body, craft), body.momentum);
        steps(&mut body, craft, &command, 10.0);
        let energy = rotation_energy(&body, craft) / before.0 - 1.0;
        (energy.abs(), (body.momentum - before.1).norm() / before.1.norm())
    };
    let (energy, momentum) = tumble(&craft);
    // The midpoint rule lets the energy swing by (step times rate)^2 / 12, here 1e-7, and does not
    // let it drift.
    assert!(energy < 1e-6, "{energy}");
    assert!(momentum < 1e-12, "{momentum}");
    // The twin: a little damping must be seen.
    let mut damped = craft;
    damped.damping_nm_s = [1e-5; 3];
    assert!(tumble(&damped).0 > 1e-4 && tumble(&damped).1 > 1e-5);
}

#[test]
fn a_body_of_revolution_precesses_as_euler_says() {
    let mut craft = in_vacuum(Size::F330, 4);
    craft.rotor_inertia_kg_m2 = 0.0;
    craft.inertia_kg_m2 = nalgebra::Matrix3::from_diagonal(&Vector3::new(0.014, 0.014, 0.024));
    let (mut body, command) = with_rotors(&craft, 500.0);
    body.set_rate_rad_s(&craft, Vector3::new(0.8, 0.0, 3.0));
    steps(&mut body, &craft, &command, 2.0);
    // Free precession in the body: the transverse rate turns with (Izz - Ixx) / Ixx times the axial
    // one.
    let turned = (0.024 - 0.014) / 0.014 * 3.0 * 2.0_f64;
    let expected = Vector3::new(0.8 * turned.cos(), 0.8 * turned.sin(), 3.0);
    let error = (body.rate_rad_s(&craft) - expected).norm();
    // Second order in the step: 2 s of a phase error of (3 rad/s * 0.5 ms)^2.
    assert!(error < 1e-5, "{error}");
}

#[test]
fn rotors_that_speed_up_turn_the_body_the_other_way() {
    let mut craft = in_vacuum(Size::Small, 5);
    let turned = |craft: &Craft| {
        let (mut body, _) = with_rotors(craft, 1000.0);
        body.set_rate_rad_s(craft, Vector3::zeros());
        let faster = craft.map.command_for(1200.0, craft.battery.full_v);
        let slower = craft.map.command_for(1000.0, craft.battery.full_v);
        // Rotors 1 and 3 of the small craft turn clockwise.
        steps(&mut body, craft, &[faster, slower, faster, slower], 2.0);
        body.rate_rad_s(craft).z
    };
    craft.spin_up_share = 1.0;
    let expected = -2.0 * craft.rotor_inertia_kg_m2 * 200.0 / craft.inertia_kg_m2[(2, 2)];
    assert!((turned(&craft) / expected - 1.0).abs() < 1e-9, "{} {expected}", turned(&craft));
    // The twin: without the share, the momentum that the rotors took is made up for.
    craft.spin_up_share = 0.0;
    assert!(turned(&craft).abs() < 1e-9 * expected.abs());
}

#[test]
fn a_thrown_body_follows_the_parabola() {
    let mut craft = in_vacuum(Size::Small, 6);
    let end = |craft: &Craft| {
        let (mut body, command) = with_rotors(craft, 0.0);
        body.velocity_ned_m_s = Vector3::new(1.0, -0.5, -3.0);
        steps(&mut body, craft, &command.map(|_| craft.map.command_for(-1.0, craft.battery.full_v)), 2.0);
        body.position_ned_m
    };
    let expected = Vector3::new(2.0, -1.0, -6.0 + 0.5 * 9.81 * 4.0);
    assert!((end(&craft) - expected).norm() < 1e-9, "{}", end(&craft));
    craft.drag_n_s_m = [0.001; 3];
    assert!((end(&craft) - expected).norm() > 1e-2, "drag must bend the parabola");
}

#[test]
fn a_pendulum_keeps_the_momentum_of_both_masses_and_swings_with_its_period() {
    let mut load = World::new(Size::F330, 7).with("slung-load", 1.0).unwrap().craft.load.unwrap();
    load.damping_s = 0.0;
    let mut craft = in_vacuum(Size::F330, 7);
    craft.load = Some(load);
    let both = |body: &Body, load_kg: f64| {
        let swing = load.length_m * body.link[1].cross(&body.link[0]);
        craft.mass_kg * body.velocity_ned_m_s + load_kg * (body.velocity_ned_m_s + swing)
    };
    let (mut body, command) = with_rotors(&craft, 0.0);
    body.link = [Vector3::new(0.3, 0.0, 1.0).normalize(), Vector3::new(0.0, 3.0, 0.0)];
    let drift = |body: &Body, end: &Body, load_kg: f64| {
        let gravity = Vector3::new(0.0, 0.0, (craft.mass_kg + load_kg) * craft.gravity_m_s2 * 1.0);
        (both(end, load_kg) - both(body, load_kg) - gravity).norm()
    };
    let mut end = body.clone();
    let idle = command.map(|_| craft.map.command_for(-1.0, craft.battery.full_v));
    steps(&mut end, &craft, &idle, 1.0);
    // Midpoint forces against end-of-step velocities: (step * swing rate)^2 of the load's 0.1 kg
    // m/s.
    assert!(drift(&body, &end, load.mass_kg) < 1e-5, "{}", drift(&body, &end, load.mass_kg));
    assert!(drift(&body, &end, 1.2 * load.mass_kg) > 1e-3, "a wrong load must show");
    assert!((end.link[0].norm() - 1.0).abs() < 1e-9, "the link keeps its length");

    // Hung from a craft as heavy as a house that hovers: a mathematical pendulum, period 2 pi
    // sqrt(l / g).
    let mut house = craft.clone();
    house.mass_kg = 1e6;
    house.thrust_n_s2 = house.mass_kg * house.gravity_m_s2 / (4.0 * 600.0 * 600.0);
    let (mut body, command) = with_rotors(&house, 600.0);
    body.link[0] = Vector3::new(0.02, 0.0, 1.0).normalize();
    let period_s = std::f64::consts::TAU * (load.length_m / house.gravity_m_s2).sqrt();
    steps(&mut body, &house, &command, period_s);
    assert!((body.link[0].x - 0.02).abs() < 1e-4, "back after one period: {}", body.link[0].x);
    let (mut body, _) = with_rotors(&house, 600.0);
    body.link[0] = Vector3::new(0.02, 0.0, 1.0).normalize();
    steps(&mut body, &house, &command, 0.5 * period_s);
    assert!((body.link[0].x + 0.02).abs() < 1e-4, "on the other side after half: {}", body.link[0].x);
}

#[test]
fn at_hover_speed_nothing_moves() {
    for size in Size::ALL {
        let mut craft = World::new(size, 8).craft;
        craft.battery.decay_v_s = 0.0;
        let hover = craft.hover_rad_s();
        let command = [craft.map.command_for(hover, craft.hover_v()); 4];
        let mut body = Body::hovering(&craft, Vector3::new(0.0, 0.0, -1.0));
        steps(&mut body, &craft, &command, 2.0);
        assert!((body.position_ned_m - Vector3::new(0.0, 0.0, -1.0)).norm() < 1e-9, "{size:?}");
        assert!(body.rate_rad_s(&craft).norm() < 1e-9 && (body.rotor_rad_s[2] / hover - 1.0).abs() < 1e-12);
        // The twin: one part in a thousand more speed is 0.2 % more thrust.
        let more = [craft.map.command_for(1.001 * hover, craft.hover_v()); 4];
        steps(&mut body, &craft, &more, 2.0);
        assert!(body.position_ned_m.z < -1.01, "{}", body.position_ned_m.z);
    }
}

/// The product's model with the world's true coefficients, or nothing where a planted effect has
/// none there.
fn true_model(world: &World) -> Option<Model> {
    let mut model = Model::new(world.vehicle.clone());
    let truth = world.truth();
    let planted = world.planted.iter().map(|p| Effect::from_id(p.id)).collect::<Option<Vec<_>>>()?;
    for effect in Effect::basic().chain(planted) {
        let values: Vec<f64> = truth.iter().filter(|t| t.effect == effect.id()).map(|t| t.value).collect();
        if values.len() != effect.info().coefficients.len() {
            return None;
        }
        model.set(effect, &values);
    }
    Some(model)
}

/// Largest distance between world and plant after an open-loop manoeuvre: m, rad and rad/s alike.
fn disagreement(world: &World, model: &Model) -> f64 {
    let mut craft = world.craft.clone();
    // The plant takes one voltage for a whole tick.
    (craft.battery.decay_v_s, craft.battery.sag_v) = (0.0, 0.0);
    let volts = craft.battery.full_v;
    let hover = craft.hover_rad_s();
    let start = Vector3::new(0.2, -0.3, -2.0 * craft.rotor_radius_m);
    let mut body = Body::hovering(&craft, start);
    let turn = Rotation3::from_euler_angles(0.1, -0.05, 0.4);
    body.attitude = turn;
    body.velocity_ned_m_s = Vector3::new(0.8, -0.5, 0.1);
    body.set_rate_rad_s(&craft, Vector3::new(0.4, -0.3, 0.9));
    let quaternion = nalgebra::UnitQuaternion::from_rotation_matrix(&turn);
    let mut state = State::at_rest(start, [hover; 4]);
    state.attitude = nalgebra::Vector4::new(quaternion.w, quaternion.i, quaternion.j, quaternion.k);
    state.velocity_m_s = turn.inverse() * body.velocity_ned_m_s;
    state.rate_rad_s = body.rate_rad_s(&craft);
    let plant = Plant::new(model);
    let substeps = plant.substeps(0.01, 20);
    let per_tick = (0.01 / STEP_S).round() as usize;
    let mut worst = 0.0_f64;
    for tick in 0..60 {
        let shake = |phase: f64| 1.0 + 0.04 * (0.35 * f64::from(tick) + phase).sin();
        let command =
            [0.0, 1.3, 2.9, 4.1].map(|phase| craft.map.command_for(1.01 * hover * shake(phase), volts));
        let commanded = plant.commanded_rad_s(&command, volts);
        plant.step(&mut state, &commanded, volts, &substeps);
        for step in 0..per_tick {
            let now_s = (tick as usize * per_tick + step) as f64 * STEP_S;
            body.step(&craft, &command, now_s, &mut rng(0));
        }
        let place = (state.position_ned_m - body.position_ned_m).norm();
        let dcm = model::frames::dcm_from_quaternion(&state.attitude);
        let attitude = (dcm - body.attitude.matrix().transpose()).norm();
        let rate = (state.rate_rad_s - body.rate_rad_s(&craft)).norm();
        worst = worst.max(place).max(attitude).max(rate);
    }
    worst
}

/// Over 0.6 s of hard flying. The world is second order in its step of 0.5 ms, against rotor lags
/// of up to 44 rad/s: (0.022)^2 / 12 of a rate of a few rad/s, grown over the manoeuvre.
const AGREEMENT: f64 = 2e-5;

#[test]
fn two_implementations_of_the_same_physics_agree() {
    for size in Size::ALL {
        for seed in 10..14 {
            let world = World::new(size, seed);
            let model = true_model(&world).unwrap();
            let off = disagreement(&world, &model);
            assert!(off < AGREEMENT, "{size:?}, seed {seed}: {off}");
        }
    }
}

#[test]
fn planted_effects_mean_the_same_in_the_plant() {
    // Seen by instruments only, or not simulated by the plant.
    let unseen =
        ["attitude-offset", "tracking-offset", "product-of-inertia", "input-delay", "battery-voltage"];
    let mut checked = 0;
    for effect in PLANTED.iter().filter(|e| !unseen.contains(&e.id) && !changes().any(|c| c == e.id)) {
        for size in Size::ALL {
            let world = World::new(size, 20).with(effect.id, 1.0).unwrap();
            let Some(model) = true_model(&world) else { continue };
            let off = disagreement(&world, &model);
            assert!(off < AGREEMENT, "{}, {size:?}: {off}", effect.id);
            let without = disagreement(&world, &true_model(&World::new(size, 20)).unwrap());
            assert!(without > 2.0 * AGREEMENT, "{} must move the craft: {without}", effect.id);
            checked += 1;
        }
    }
    assert!(checked >= 10, "{checked} cases only");
}

proptest! {
    // A pilot in a hurry may lose a craft with a strong effect; one in five is too many.
    #![proptest_config(ProptestConfig {
        cases: 24,
        max_global_rejects: 5,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_effect_can_be_flown_and_equal_seeds_fly_equally(
        seed in 0_u64..1_000_000,
        which in 0..PLANTED.len() + OUTSIDE.len(),
        small in any::<bool>(),
        pattern in prop::sample::select(vec![Pattern::A, Pattern::B, Pattern::C, Pattern::D, Pattern::E]),
    ) {
        let id = PLANTED.iter().chain(OUTSIDE).nth(which).unwrap().id;
        let size = if small { Size::Small } else { Size::F330 };
        let world = || World::new(size, seed).with(id, 1.2).unwrap();
        let fly = |world: World| world.fly(pattern, 24.0, &Sensors::default(), 0);
        let kept = |world: World| {
            fly(world).map_err(|lost| TestCaseError::reject(format!("{id} {size:?}: {lost}")))
        };
        let flight = kept(world())?;
        prop_assert_eq!(flight.len(), 2400);
        prop_assert_eq!(&fly(world()).unwrap(), &flight);
        prop_assert_ne!(&kept(World::new(size, seed + 1).with(id, 1.2).unwrap())?, &flight);
        world().vehicle.check(std::path::Path::new("vehicle.toml")).unwrap();
        flight.check_against(&world().vehicle, std::path::Path::new("A.csv")).unwrap();
        let [low, high] = world().vehicle.motors.command_range;
        let commands = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];
        for command in commands.iter().flat_map(|c| flight.column(*c).unwrap()) {
            prop_assert!((low..=high).contains(command), "{} {:?} {}", id, size, command);
        }
    }
}

fn column(flight: &Flight, column: Column) -> &[f64] {
    flight.column(column).unwrap()
}

fn flown(sensors: &Sensors) -> Flight {
    World::new(Size::F330, 30).fly(Pattern::A, 60.0, sensors, 0).unwrap()
}

/// Difference of a column between two flights, less its mean.
fn noise(a: &Flight, b: &Flight, which: Column) -> Vec<f64> {
    let difference: Vec<f64> = column(a, which).iter().zip(column(b, which)).map(|(a, b)| a - b).collect();
    let mean = difference.iter().sum::<f64>() / difference.len() as f64;
    difference.iter().map(|d| d - mean).collect()
}

fn spread(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn sensors_are_as_noisy_as_they_say() {
    let silent = flown(&Sensors::noisy(0.0));
    for factor in [1.0, 2.0] {
        let noisy = flown(&Sensors::noisy(factor));
        for (which, expected) in [
            (Column::X, Sensors::POSITION_M),
            (Column::Z, Sensors::POSITION_M),
            (Column::Phi, Sensors::ATTITUDE_RAD),
            (Column::P, Sensors::RATE_RAD_S),
            (Column::R, Sensors::RATE_RAD_S),
            (Column::Vbat, Sensors::BATTERY_V),
        ] {
            let found = spread(&noise(&noisy, &silent, which));
            // 6000 samples give a spread to 0.9 %; 4 of that.
            assert!((found / (factor * expected) - 1.0).abs() < 0.037, "{which:?}: {found}, not {expected}");
        }
        let bias = column(&noisy, Column::P).iter().zip(column(&silent, Column::P)).map(|(a, b)| a - b);
        let bias = bias.sum::<f64>() / noisy.len() as f64;
        assert!(bias.abs() <= Sensors::BIAS_RAD_S + 0.001 && bias != 0.0, "{bias}");
        assert_eq!(
            column(&noisy, Column::Cmd2),
            column(&silent, Column::Cmd2),
            "noise does not move the craft"
        );
    }
}

#[test]
fn a_pilot_who_flies_by_the_gyro_answers_its_noise_a_tick_later() {
    let hovering = |noise: f64, are_flown_by| {
        let sensors = Sensors { are_flown_by, ..Sensors::noisy(noise) };
        World::new(Size::F330, 30).fly(Pattern::Hover, 20.0, &sensors, 0).unwrap()
    };
    let roll = |flight: &Flight| -> Vec<f64> {
        let of = |which: [Column; 4], k: usize| which.map(|c| column(flight, c)[k]);
        let commands = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];
        (0..flight.len()).map(|k| of(commands, k)).map(|[a, b, c, d]| a - b - c + d).collect()
    };
    assert_eq!(
        roll(&hovering(0.0, true)),
        roll(&hovering(0.0, false)),
        "without noise there is nothing to answer"
    );
    assert_eq!(roll(&hovering(1.0, false)), roll(&hovering(0.0, false)));
    let noisy = hovering(1.0, true);
    let quick = |values: &[f64]| values.windows(2).map(|w| w[1] - w[0]).collect::<Vec<f64>>();
    let (answer, noise) = (quick(&roll(&noisy)), quick(column(&noisy, Column::P)));
    let product: f64 = answer[1..].iter().zip(&noise).map(|(a, n)| a * n).sum();
    let alike = product / (noise.len() as f64 * spread(&answer) * spread(&noise));
    assert!(alike < -0.9, "{alike}");
}

#[test]
fn coloured_noise_has_its_colour() {
    let silent = flown(&Sensors::noisy(0.0));
    let neighbours = |colour_s| {
        let noise = noise(&flown(&Sensors { colour_s, ..Sensors::default() }), &silent, Column::Y);
        let product: f64 = noise.windows(2).map(|w| w[0] * w[1]).sum();
        (product / noise.iter().map(|v| v * v).sum::<f64>(), spread(&noise))
    };
    let expected = (-0.01 / 0.03_f64).exp();
    let (found, coloured) = neighbours(0.03);
    // 6000 samples give an autocorrelation to 0.013; the effective number of samples is a quarter
    // for the spread.
    assert!((found - expected).abs() < 0.04, "{found}, not {expected}");
    assert!((coloured / Sensors::POSITION_M - 1.0).abs() < 0.08, "{coloured}");
    assert!(neighbours(0.0).0.abs() < 0.05);
}

#[test]
fn rows_jitter_drop_out_and_age_as_asked() {
    let t = |flight: &Flight| column(flight, Column::T).to_vec();
    let jittery = t(&flown(&Sensors { jitter_s: 0.001, ..Sensors::default() }));
    let off: Vec<f64> = jittery.iter().enumerate().map(|(k, t)| t - 0.01 * k as f64).collect();
    assert!((0.0009..0.0011).contains(&spread(&off)), "{}", spread(&off));
    assert!(jittery.windows(2).all(|w| w[1] > w[0]));

    let lossy = flown(&Sensors { dropout: 0.05, ..Sensors::default() });
    let lost = 1.0 - lossy.len() as f64 / 6000.0;
    // Bursts of 12 rows: some 25 of them, so a fifth of scatter, twice.
    assert!((0.02..0.085).contains(&lost), "{lost}");

    let (prompt, late) =
        (flown(&Sensors::noisy(0.0)), flown(&Sensors { noise: 0.0, gyro_age_s: 0.01, ..Sensors::default() }));
    let (prompt, late) = (column(&prompt, Column::Q), column(&late, Column::Q));
    assert_eq!(late[1..], prompt[..prompt.len() - 1], "a gyro one period late shows the row before");
}

#[test]
fn logs_are_as_fast_as_asked_and_commands_stay_for_a_tick() {
    for (rate_hz, rows) in [(25.0, 1500), (50.0, 3000), (200.0, 12_000), (400.0, 24_000), (1000.0, 60_000)] {
        let flight = flown(&Sensors { rate_hz, ..Sensors::noisy(0.0) });
        assert_eq!(flight.len(), rows);
        let t = column(&flight, Column::T);
        assert!(t.windows(2).all(|w| (w[1] - w[0] - 1.0 / rate_hz).abs() < 1e-9), "{rate_hz} Hz");
        let commands = column(&flight, Column::Cmd1);
        let changes = commands.windows(2).filter(|w| w[0] != w[1]).count();
        assert!(changes < 6000 && changes > rows.min(6000) * 9 / 10, "{rate_hz} Hz: {changes}");
    }
    let usual = flown(&Sensors::noisy(0.0));
    let slow = flown(&Sensors { rate_hz: 25.0, ..Sensors::noisy(0.0) });
    let taken: Vec<f64> = column(&usual, Column::Cmd2).iter().step_by(4).copied().collect();
    assert_eq!(column(&slow, Column::Cmd2), taken, "a slower log takes some of the rows");
}

#[test]
fn a_voltmeter_that_is_off_does_not_move_the_craft() {
    let right = flown(&Sensors::noisy(0.0));
    let off = flown(&Sensors { voltmeter_v: 0.2, ..Sensors::noisy(0.0) });
    assert!(noise(&off, &right, Column::X).iter().all(|d| *d == 0.0));
    let added = column(&off, Column::Vbat)[7] - column(&right, Column::Vbat)[7];
    assert!((added - 0.2).abs() < 1e-12, "{added}");
}

#[test]
fn a_wandering_wind_has_its_spread_and_its_time() {
    let calm = World::new(Size::F330, 30);
    let mut windy = calm.clone();
    windy.craft.strange.wandering_m_s = 1.0;
    let fly = |world: &World| world.fly(Pattern::Hover, 60.0, &Sensors::noisy(0.0), 0).unwrap();
    let (still, blown) = (fly(&calm), fly(&windy));
    // Drag of the wind is carried by a tilt: 0.27 N s/m over 1.2 kg over g, 0.02 rad for 1 m/s.
    let tilt = spread(column(&blown, Column::Theta));
    assert!(spread(column(&still, Column::Theta)) < 1e-3);
    assert!((0.008..0.05).contains(&tilt), "{tilt}");
    let theta = column(&blown, Column::Theta);
    let product = |lag: usize| theta.iter().zip(&theta[lag..]).map(|(a, b)| a * b).sum::<f64>();
    // Half of exp(-1/4) after a second: what the pilot does takes part of it.
    assert!(product(100) > 0.4 * product(0), "{}", product(100) / product(0));
}

#[test]
fn files_read_back_as_written() {
    let folder = tempfile::tempdir().unwrap();
    let world = World::new(Size::Small, 31).with("battery-voltage", 1.0).unwrap();
    let flight = world.fly(Pattern::D, 12.0, &Sensors::default(), 0).unwrap();
    world.write(folder.path(), &[&flight]).unwrap();
    let vehicle = model::Vehicle::read(&folder.path().join("vehicle.toml")).unwrap();
    assert_eq!(vehicle, world.vehicle);
    let read = Flight::read(&folder.path().join("D.csv")).unwrap();
    assert_eq!(read.to_csv(), flight.to_csv());
}

#[test]
fn an_unknown_effect_is_named() {
    let error = World::new(Size::F330, 1).with("magnetism", 1.0).unwrap_err();
    assert_eq!(error.to_string(), "no effect of the simulated worlds is called magnetism");
}
