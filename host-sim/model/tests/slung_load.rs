//! A load on a cable: the plant against the laws of mechanics, the pendulum driven by a log against the plant.

use model::{Effect, Model, Pendulum, Plant, SlungLoad, State, Vehicle};
use nalgebra::Vector3;

const LOAD: SlungLoad = SlungLoad { mass_kg: 0.2, cable_length_m: 0.5, damping_ratio: 0.0 };
const GRAVITY_M_S2: f64 = 9.81;

/// A craft that hovers on a thrust along its own z and carries the load.
fn flown(start: Pendulum, velocity_m_s: Vector3<f64>, time_s: f64) -> State {
    let vehicle = Vehicle::thesis();
    let mut model = Model::new(vehicle.clone());
    let speed = 600.0;
    // Four rotors carry craft and load.
    let carried = (vehicle.mass + LOAD.mass_kg) * vehicle.gravity;
    model.set(Effect::Thrust, &[carried / (vehicle.beta_kg_m() * 4.0 * speed * speed)]);
    model.set(Effect::SlungLoad, &[LOAD.mass_kg, LOAD.cable_length_m, 0.0]);
    let plant = Plant::new(&model);
    let mut state = State::at_rest(Vector3::zeros(), [speed; 4]);
    (state.pendulum, state.velocity_m_s) = (start, velocity_m_s);
    let steps = 400;
    let substeps = plant.substeps(time_s / f64::from(steps), 1);
    for _ in 0..steps {
        plant.step(&mut state, &[speed; 4], 11.1, &substeps);
    }
    state
}

fn swing(angle_rad: f64, turning_rad_s: Vector3<f64>) -> Pendulum {
    Pendulum { direction: Vector3::new(angle_rad.sin(), 0.0, angle_rad.cos()), turning_rad_s }
}

#[test]
fn craft_and_load_keep_their_momentum_however_wide_they_swing() {
    let mass = Vehicle::thesis().mass;
    let momentum = |s: &State, load_kg: f64| {
        let load = s.pendulum.turning_rad_s.cross(&s.pendulum.direction) * LOAD.cable_length_m;
        mass * s.velocity_m_s + load_kg * (s.velocity_m_s + load)
    };
    let start = swing(0.6, Vector3::new(0.5, 2.0, 0.0).cross(&swing(0.6, Vector3::zeros()).direction));
    let velocity = Vector3::new(0.5, -0.2, 0.0);
    let end = flown(start, velocity, 1.0);
    let before = State { pendulum: start, velocity_m_s: velocity, ..end };
    let drift = |load_kg: f64| (momentum(&end, load_kg) - momentum(&before, load_kg)).norm();
    // Fourth order with steps of 2.5 ms at some rad/s, and thrust that balances both weights.
    assert!(drift(LOAD.mass_kg) < 1e-7, "{}", drift(LOAD.mass_kg));
    assert!(drift(0.0) > 1e-2, "without the load's part the craft's own momentum changes");
    assert!((end.pendulum.direction.norm() - 1.0).abs() < 1e-12);
}

#[test]
fn they_swing_against_each_other_faster_than_the_load_would_by_itself() {
    let mass_ratio = LOAD.mass_kg / Vehicle::thesis().mass;
    let frequency = (GRAVITY_M_S2 / LOAD.cable_length_m * (1.0 + mass_ratio)).sqrt();
    let half_period_s = std::f64::consts::PI / frequency;
    let start = swing(0.01, Vector3::zeros());
    let end = flown(start, Vector3::zeros(), half_period_s);
    // A swing of 0.01 rad is 1e-5 / 16 slower than a small one: nothing to first order at its turning point.
    assert!((end.pendulum.direction.x + start.direction.x).abs() < 1e-7, "{:?}", end.pendulum);
    // Alone it would not be back yet.
    assert!((mass_ratio * 0.01).abs() > 1e-4);
}

#[test]
fn a_driven_load_follows_the_closed_form() {
    // The craft swings by 1 mm at 3 rad/s: the load by 1 / (1 - (3 / w)^2) of that, and the free swing that makes it
    // start with the craft.
    let (amplitude, drive) = (0.001, 3.0_f64);
    let w = LOAD.stiffness_rad2_s2(GRAVITY_M_S2).sqrt();
    let gain = 1.0 / (1.0 - (drive / w).powi(2));
    let period_s = 0.002;
    let time = |k: usize| period_s * k as f64;
    let place = |k: usize| Vector3::new(amplitude * (drive * time(k)).sin(), 0.3, -1.0);
    let swings = LOAD.driven(&(0..3000).map(place).collect::<Vec<_>>(), [0.0; 4], period_s, GRAVITY_M_S2);
    for k in (0..3000).step_by(50) {
        let t = time(k);
        let load = amplitude * (gain * (drive * t).sin() + (1.0 - gain) * drive / w * (w * t).sin());
        let offset_m = LOAD.cable_length_m * swings[k].direction;
        // The velocity at the start is the mean of 0.05 s: 0.4 % of 3 mm/s low, over 4.4 rad/s.
        assert!((offset_m.x - (load - place(k).x)).abs() < 4e-6, "{k}");
        assert!(offset_m.y.abs() < 1e-12);
    }
}

/// The log's way and the plant's way to the same pendulum, wide and with the craft climbing.
#[test]
fn a_load_driven_by_places_swings_as_in_the_plant() {
    let mut model = Model::thesis();
    model.set(Effect::SlungLoad, &[0.1, 0.4, 0.05]);
    let load = SlungLoad { mass_kg: 0.1, cable_length_m: 0.4, damping_ratio: 0.05 };
    let plant = Plant::new(&model);
    // The thesis' craft hovers at these (reference section 1), faster by the load's weight.
    let hover = [611.4090, 634.3527, 633.6577, 657.8632].map(|w: f64| w * (1.0 + 0.1_f64 / 1.214).sqrt());
    let mut state = State::at_rest(Vector3::new(0.0, 0.0, -1.0), hover);
    let substeps = plant.substeps(0.002, 2);
    let (mut places, mut flown) = (Vec::new(), Vec::new());
    for k in 0..500 {
        places.push(state.position_ned_m);
        flown.push(state.pendulum);
        let t = 0.002 * f64::from(k);
        let (lift, tilt) = (15.0 * (4.0 * t).sin(), 3.0 * (4.0 * t).cos());
        let shares = [lift + tilt, lift + tilt, lift - tilt, lift - tilt];
        let commanded = std::array::from_fn(|i| hover[i] + shares[i]);
        plant.step(&mut state, &commanded, 11.1, &substeps);
    }
    let widest = flown.iter().map(|s| s.direction.xy().norm()).fold(0.0, f64::max);
    assert!((0.05..1.0).contains(&widest), "{widest}");
    let swings = load.driven(&places, [0.0; 4], 0.002, model.vehicle.gravity);
    let off = |(a, b): (&Pendulum, &Pendulum)| (a.direction - b.direction).norm();
    let worst = swings.iter().zip(&flown).map(off).fold(0.0, f64::max);
    // Second order in the sample of 2 ms, and a velocity at the start from a twentieth of a second.
    assert!(worst < 0.003 * widest, "{worst} of {widest}");
}

/// A load that is let go under a craft at rest swings as the free solutions say, to the cube of the angle.
#[test]
fn a_load_begins_where_it_is_told() {
    let load = SlungLoad { damping_ratio: 0.04, ..LOAD };
    let (period_s, begun) = (0.01, [0.02, -0.05, -0.01, 0.08]);
    let swings = load.driven(&vec![Vector3::zeros(); 300], begun, period_s, GRAVITY_M_S2);
    let free = load.free(300, period_s, GRAVITY_M_S2);
    for (k, (pendulum, [offset, velocity])) in swings.iter().zip(free).enumerate() {
        let found = load.cable_length_m * pendulum.direction;
        let expected = [offset * begun[0] + velocity * begun[1], offset * begun[2] + velocity * begun[3]];
        // First order at the first step of the two, 1 % of a swing of 25 mm.
        assert!((found.x - expected[0]).abs() < 6e-4 && (found.y - expected[1]).abs() < 6e-4, "{k}");
    }
}

#[test]
fn free_swings_are_damped_cosines_and_sines() {
    let load = SlungLoad { damping_ratio: 0.1, ..LOAD };
    let w = load.stiffness_rad2_s2(GRAVITY_M_S2).sqrt();
    let damped = w * (1.0 - 0.01_f64).sqrt();
    for (k, [offset, velocity]) in load.free(500, 0.01, GRAVITY_M_S2).into_iter().enumerate() {
        let t = 0.01 * k as f64;
        let decay = (-0.1 * w * t).exp();
        let cosine = decay * ((damped * t).cos() + 0.1 * w / damped * (damped * t).sin());
        assert!((offset - cosine).abs() < 1e-12, "{k}");
        assert!((velocity - decay * (damped * t).sin() / damped).abs() < 1e-12, "{k}");
    }
}

/// Each as by itself, to the bit, however long the others are.
#[test]
fn loads_followed_side_by_side_do_not_touch_each_other() {
    let place =
        |k: usize, speed: f64| Vector3::new(speed * 0.01 * k as f64, 0.3 * (0.02 * k as f64).sin(), -1.0);
    let ways: [Vec<Vector3<f64>>; 4] =
        std::array::from_fn(|i| (0..[0, 1, 120, 77][i]).map(|k| place(k, i as f64)).collect());
    let begun: [[f64; 4]; 4] = std::array::from_fn(|i| [0.01 * i as f64, -0.02, 0.03, 0.1]);
    let of_load: [(&[Vector3<f64>], [f64; 4]); 4] = std::array::from_fn(|i| (&ways[i][..], begun[i]));
    let together = LOAD.driven_side_by_side(of_load, 0.01, GRAVITY_M_S2);
    for ((way, begun), swings) in ways.iter().zip(begun).zip(together) {
        assert_eq!(swings, LOAD.driven(way, begun, 0.01, GRAVITY_M_S2));
        assert_eq!(swings.len(), way.len());
    }
}
