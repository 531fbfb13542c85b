//! Flights of the product's own plant under a simple state feedback, with sensor noise: for tests of the estimation
//! alone. Flights made by other programs and by the flying controller are tested in the crate `stories`.
#![allow(dead_code, reason = "each test binary uses its own part")]

use flights::{Column, Flight};
use model::{Effect, Model, Plant, State, Vehicle};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};

/// The thesis' vehicle with a physical basic model: damping that damps, inertia ratios of one tensor.
pub(crate) fn truth() -> Model {
    let thesis = Model::thesis();
    let mut model = Model::new(Vehicle::thesis());
    for effect in [Effect::Thrust, Effect::LinearDrag, Effect::RotorMoments] {
        let values: Vec<f64> = thesis.term(effect).unwrap().coefficients.iter().map(|c| c.value).collect();
        model.set(effect, &values);
    }
    // Ixx, Iyy, Izz = 0.0140, 0.0150, 0.0240 kg m^2, one rotor 3.5e-5 kg m^2.
    model.set(Effect::InertiaCoupling, &[-0.009 / 0.014, 0.010 / 0.015, -0.001 / 0.024]);
    model.set(Effect::Gyroscopic, &[0.0025, -0.0023]);
    model.set(Effect::AngularDamping, &[-0.7, -0.65, -0.5]);
    model.reference.battery_v = 11.5;
    model
}

/// Standard deviations of the sensors' noise; the sizes of section 5.5 of the thesis and of common gyros.
pub(crate) struct Noise {
    pub(crate) position_m: f64,
    pub(crate) attitude_rad: f64,
    pub(crate) rate_rad_s: f64,
    pub(crate) battery_v: f64,
    /// Whether the controller answers the gyro's noise. Then nothing else excites the motors.
    pub(crate) is_fed_back: bool,
}

pub(crate) const ORDINARY: Noise =
    Noise { position_m: 2.5e-4, attitude_rad: 7e-4, rate_rad_s: 0.012, battery_v: 0.015, is_fed_back: false };
pub(crate) const NONE: Noise =
    Noise { position_m: 0.0, attitude_rad: 0.0, rate_rad_s: 0.0, battery_v: 0.0, is_fed_back: false };
/// A noisy gyro that the controller flies by, as all do.
pub(crate) const FED_BACK: Noise = Noise { rate_rad_s: 0.02, is_fed_back: true, ..ORDINARY };

/// Flies `model` for `seconds` through sines in all directions and yaw, every motor excited by itself.
pub(crate) fn fly(model: &Model, seed: u64, seconds: f64, noise: &Noise) -> Flight {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let plant = Plant::new(model);
    let adjust = *plant.adjustments();
    let map = model.vehicle.rotor_map();
    let substeps = plant.substeps(0.01, 4);
    let mut uniform = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let path: Vec<[f64; 3]> =
        (0..4).map(|_| [uniform(0.6, 1.2), uniform(0.5, 1.4), uniform(0.0, std::f64::consts::TAU)]).collect();
    let excite: Vec<[f64; 3]> = (0..4)
        .map(|_| [uniform(4.0, 10.0), uniform(4.0, 20.0), uniform(0.0, std::f64::consts::TAU)])
        .collect();
    let mut gauss = || {
        // Twelve uniforms make a near enough normal deviate without another dependency.
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    };
    let bias = [0.01, -0.006, 0.004];
    let mut state = State::at_rest(Vector3::new(0.0, 0.0, -0.9), [635.0; 4]);
    let mut rows: Vec<[f64; 15]> = Vec::new();
    for k in 0..(seconds / 0.01) as usize {
        let t = k as f64 * 0.01;
        let wave = |i: usize| path[i][0] * (path[i][1] * t + path[i][2]).sin();
        let battery = 12.1 - 0.02 * t - 0.3 * (state.rotor_rad_s.iter().sum::<f64>() / 2540.0 - 1.0);
        let euler = state.euler_rad();
        let target = Vector3::new(1.3 * wave(0), 1.2 * wave(1), -0.95 + 0.7 * wave(2));
        let dcm = model::frames::dcm_from_quaternion(&state.attitude);
        let error = dcm * (target - state.position_ned_m);
        let v = state.velocity_m_s;
        let felt = match noise.is_fed_back {
            true => Vector3::from_fn(|_, _| noise.rate_rad_s * gauss()),
            false => Vector3::zeros(),
        };
        let w = state.rate_rad_s + felt;
        let clamp = |x: f64| x.clamp(-0.35, 0.35);
        let (roll_c, pitch_c) = (clamp(0.12 * error.y - 0.14 * v.y), clamp(-0.12 * error.x + 0.14 * v.x));
        let mut yaw_error = 0.8 * wave(3) - euler.z;
        yaw_error = yaw_error.sin().atan2(yaw_error.cos());
        let roll = 60.0 * (roll_c - euler.x) - 14.0 * w.x;
        let pitch = 60.0 * (pitch_c - euler.y) - 14.0 * w.y;
        let yaw = 4.0 * yaw_error - 3.0 * w.z;
        // Rotor speed deltas that give about these accelerations on this vehicle.
        let lift = -9.0 * error.z + 9.0 * v.z;
        let speeds: [f64; 4] = std::array::from_fn(|i| {
            let (r, p, y) = ([1.0, -1.0, -1.0, 1.0][i], [1.0, 1.0, -1.0, -1.0][i], [1.0, -1.0, 1.0, -1.0][i]);
            635.0 + 32.0 * lift.clamp(-3.0, 3.0) / 3.0 + 2.0 * r * roll + 2.0 * p * pitch + 12.0 * y * yaw
        });
        let command: [f64; 4] = std::array::from_fn(|i| {
            let size = if noise.is_fed_back { 0.0 } else { excite[i][0] };
            let excitation = size * (excite[i][1] * t + excite[i][2]).sin();
            (map.command_for(speeds[i], battery) + excitation).clamp(1050.0, 1990.0)
        });
        let lever = adjust.tracked_point_m();
        let tracked = state.position_ned_m + dcm.tr_mul(&lever);
        let attitude = model::frames::euler_from_dcm(&adjust.measured_dcm(&dcm));
        let mut row = [0.0; 15];
        row[0] = t;
        for i in 0..3 {
            row[1 + i] = tracked[i] + noise.position_m * gauss();
            row[4 + i] = attitude[i] + noise.attitude_rad * gauss();
            let unfelt = if noise.is_fed_back { 0.0 } else { noise.rate_rad_s * gauss() };
            row[7 + i] = w[i] + bias[i] + unfelt;
        }
        row[10..14].copy_from_slice(&command);
        row[14] = battery + noise.battery_v * gauss();
        rows.push(row);
        plant.step(&mut state, &plant.commanded_rad_s(&command, battery), battery, &substeps);
        assert!(
            state.is_finite() && state.position_ned_m.norm() < 20.0,
            "the test flight of seed {seed} crashed at {t} s"
        );
    }
    use Column::*;
    let columns = [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
    let values = columns.into_iter().enumerate().map(|(i, c)| (c, rows.iter().map(|r| r[i]).collect()));
    Flight::from_columns(format!("flight-{seed}.csv"), values)
}
