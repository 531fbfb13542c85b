//! Faults of logs: planted ones are found and named, sound flights are left alone.

use std::path::{Path, PathBuf};

use flights::{Column, Flight};
use model::{Effect, Model, Vehicle, frames};
use nalgebra::{Matrix3, Vector3, Vector4};
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use stories::shared;
use stories::world::{OUTSIDE, PLANTED, Pattern, Sensors, Size, World};
use sysid::checks::vehicle::{self, Likeness};
use sysid::{Fault, FaultKind, Prepared, Severity, examine};

use Column::*;

const ALL: [Column; 15] = [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];

/// The flight with what `edit` makes of each row.
fn edited(flight: &Flight, edit: impl Fn(&mut Row)) -> Flight {
    let has_imu = flight.column(Ax).is_some();
    let imu = if has_imu { &[Ax, Ay, Az][..] } else { &[] };
    let columns: Vec<Column> = ALL.iter().chain(imu).copied().collect();
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    for k in 0..flight.len() {
        let three = |c: [Column; 3]| Vector3::from(c.map(|c| flight.column(c).map_or(0.0, |v| v[k])));
        let mut row = Row {
            position: three([X, Y, Z]),
            euler: three([Phi, Theta, Psi]),
            rate: three([P, Q, R]),
            command: [Cmd1, Cmd2, Cmd3, Cmd4].map(|c| flight.column(c).unwrap()[k]),
            imu: three([Ax, Ay, Az]),
        };
        edit(&mut row);
        let (x, e, w, c, f) = (row.position, row.euler, row.rate, row.command, row.imu);
        let plain = |c: Column| flight.column(c).unwrap()[k];
        let new = [
            plain(T),
            x.x,
            x.y,
            x.z,
            e.x,
            e.y,
            e.z,
            w.x,
            w.y,
            w.z,
            c[0],
            c[1],
            c[2],
            c[3],
            plain(Vbat),
            f.x,
            f.y,
            f.z,
        ];
        values.iter_mut().zip(new).for_each(|(column, value)| column.push(value));
    }
    Flight::from_columns(flight.name.clone(), columns.into_iter().zip(values))
}

struct Row {
    position: Vector3<f64>,
    euler: Vector3<f64>,
    rate: Vector3<f64>,
    command: [f64; 4],
    imu: Vector3<f64>,
}

/// The 24 rotations of an axis system, the identity first.
fn rotations() -> Vec<Matrix3<f64>> {
    let mut all = Vec::new();
    for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]] {
        for bits in 0..8_u8 {
            let mut m = Matrix3::zeros();
            for i in 0..3 {
                m[(i, order[i])] = if bits >> i & 1 == 1 { -1.0 } else { 1.0 };
            }
            if m.determinant() > 0.0 {
                all.push(m);
            }
        }
    }
    all
}

fn worlds(seeds: std::ops::Range<u64>) -> impl Iterator<Item = (u64, Vehicle, Vec<Flight>)> {
    seeds.map(|seed| {
        let world = World::new(Size::ALL[(seed % 2) as usize], seed);
        let patterns = Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE);
        let sensors = Sensors::noisy([0.8, 1.0, 2.0][(seed % 3) as usize]);
        let flights = patterns.filter_map(|p| world.fly(p, 20.0, &sensors, 0).ok()).collect();
        (seed, world.vehicle, flights)
    })
}

type Order = fn(Vector4<f64>) -> Vector4<f64>;

/// Ways to misread a quaternion: what it is, and a word that its sentence has.
const ORDERS: [(&str, &str, Order); 3] = [
    ("conjugated", "conjugated", |q| Vector4::new(q[0], -q[1], -q[2], -q[3])),
    ("x, y, z, w read as w, x, y, z", "x, y, z, w", |q| Vector4::new(q[1], q[2], q[3], q[0])),
    ("w, x, y, z read as x, y, z, w", "w, x, y, z", |q| Vector4::new(q[3], q[0], q[1], q[2])),
];

impl Row {
    /// Reads its quaternion in this order.
    fn misread(&mut self, order: Order) {
        self.euler = frames::euler_from_quaternion(&order(frames::quaternion_from_euler(self.euler)));
    }
}

type Edit = Box<dyn Fn(&mut Row)>;

/// Every single fault that is to be found: what it is, a word that its sentence has, and how to
/// plant it.
fn planted() -> Vec<(String, &'static str, Edit)> {
    let mut all: Vec<(String, &'static str, Edit)> = Vec::new();
    for (k, m) in rotations().into_iter().enumerate().skip(1) {
        all.push((format!("gyro turned {k}"), "p, q, r", Box::new(move |r| r.rate = m * r.rate)));
        all.push((format!("position turned {k}"), "x, y, z", Box::new(move |r| r.position = m * r.position)));
    }
    for axis in 0..3 {
        all.push((format!("gyro axis {axis} mirrored"), "p, q, r", Box::new(move |r| r.rate[axis] *= -1.0)));
        all.push((
            format!("position axis {axis} mirrored"),
            "x, y, z",
            Box::new(move |r| r.position[axis] *= -1.0),
        ));
        all.push((format!("angle {axis} mirrored"), "wrong sign", Box::new(move |r| r.euler[axis] *= -1.0)));
    }
    for (name, word, order) in ORDERS {
        all.push((format!("quaternion {name}"), word, Box::new(move |r| r.misread(order))));
    }
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    let enu = Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    let to = move |e: Vector3<f64>, body: Matrix3<f64>, earth: Matrix3<f64>| {
        frames::euler_from_dcm(&(body * frames::dcm_from_euler(e) * earth))
    };
    all.push((
        "phi, theta exchanged".into(),
        "exchanged",
        Box::new(|r| r.euler = Vector3::new(r.euler.y, r.euler.x, r.euler.z)),
    ));
    all.push((
        "attitude NWU/FLU".into(),
        "front-left-up",
        Box::new(move |r| r.euler = to(r.euler, flip, flip)),
    ));
    all.push((
        "attitude ENU/FLU".into(),
        "east-north-up",
        Box::new(move |r| r.euler = to(r.euler, flip, enu)),
    ));
    all.push((
        "attitude NED/FLU".into(),
        "upside down",
        Box::new(move |r| r.euler = to(r.euler, flip, Matrix3::identity())),
    ));
    for (name, earth) in [("NWU", flip), ("ENU", enu)] {
        all.push((
            format!("log {name}/FLU"),
            "whole log",
            Box::new(move |r| {
                r.euler = to(r.euler, flip, earth);
                r.position = earth * r.position;
                r.rate = flip * r.rate;
            }),
        ));
    }
    for (name, earth) in [("NWU", flip), ("ENU", enu)] {
        all.push((
            format!("tracker {name}/FLU"),
            "tracker",
            Box::new(move |r| {
                r.euler = to(r.euler, flip, earth);
                r.position = earth * r.position;
            }),
        ));
    }
    all.push(("angles in degrees".into(), "degrees", Box::new(|r| r.euler = r.euler.map(f64::to_degrees))));
    all.push(("position in millimetres".into(), "millimetres", Box::new(|r| r.position *= 1000.0)));
    all
}

/// Each rotation of the axes of a signal together with each wrong order of the quaternion.
fn planted_pairs() -> Vec<(String, Edit)> {
    type Signal = fn(&mut Row) -> &mut Vector3<f64>;
    let signals: [(&str, Signal); 2] = [("gyro", |r| &mut r.rate), ("position", |r| &mut r.position)];
    let mut all: Vec<(String, Edit)> = Vec::new();
    for (signal, of) in signals {
        for (k, m) in rotations().into_iter().enumerate().skip(1) {
            for (name, _, order) in ORDERS {
                all.push((
                    format!("{signal} turned {k}, quaternion {name}"),
                    Box::new(move |r| {
                        r.misread(order);
                        let of = of(r);
                        *of = m * *of;
                    }),
                ));
            }
        }
    }
    all
}

fn refused(faults: &[Fault]) -> Option<&Fault> {
    faults.iter().find(|f| f.severity == Severity::Refused)
}

#[test]
fn planted_frames_are_found_and_named() {
    let flights: Vec<(u64, Vehicle, Flight)> = worlds(0..2)
        .flat_map(|(seed, vehicle, flights)| flights.into_iter().map(move |f| (seed, vehicle.clone(), f)))
        .collect();
    let judged = flights.par_iter().map(|(seed, vehicle, flight)| {
        let mut counts = [0, 0, 0];
        for (what, word, edit) in planted() {
            let faults = examine(&edited(flight, edit), vehicle).unwrap().faults;
            let fault = refused(&faults);
            let found = fault.is_some() || faults.iter().any(|f| f.kind == FaultKind::InconsistentFrames);
            let named = fault.is_some_and(|f| f.sentence.contains(word));
            counts = [counts[0] + 1, counts[1] + usize::from(found), counts[2] + usize::from(named)];
            if !named {
                println!("seed {seed} {} {what}: {faults:?}", flight.name);
            }
        }
        counts
    });
    let [count, found, named] = judged.reduce(|| [0; 3], |a, b| std::array::from_fn(|i| a[i] + b[i]));
    println!("{count} planted, {found} found, {named} named rightly");
    assert!(found as f64 >= 0.99 * count as f64);
    assert!(named as f64 >= 0.98 * count as f64);
}

/// Of the pairs, a flight has every so manyth, all of them where `QUADLAB_EXHAUSTIVE` is set, as at night.
const PAIRS_APART: usize = 5;

/// Two at once are noticed as one is; which two it is, is not asked. Each pair is planted in a fifth of the flights.
#[test]
fn planted_pairs_of_frames_are_noticed() {
    let flights: Vec<(u64, Vehicle, Flight)> = worlds(0..2)
        .flat_map(|(seed, vehicle, flights)| flights.into_iter().map(move |f| (seed, vehicle.clone(), f)))
        .collect();
    let apart = if std::env::var_os("QUADLAB_EXHAUSTIVE").is_some() { 1 } else { PAIRS_APART };
    let judged = flights.par_iter().enumerate().map(|(number, (seed, vehicle, flight))| {
        let mut counts = [0, 0];
        for (what, edit) in planted_pairs().into_iter().skip(number % apart).step_by(apart) {
            let faults = examine(&edited(flight, edit), vehicle).unwrap().faults;
            let is_noticed =
                refused(&faults).is_some() || faults.iter().any(|f| f.kind == FaultKind::InconsistentFrames);
            counts = [counts[0] + 1, counts[1] + usize::from(is_noticed)];
            if !is_noticed {
                println!("seed {seed} {} {what}: {faults:?}", flight.name);
            }
        }
        counts
    });
    let [count, noticed] = judged.reduce(|| [0; 2], |a, b| std::array::from_fn(|i| a[i] + b[i]));
    println!("{count} planted, {noticed} noticed");
    assert!(noticed as f64 >= 0.99 * count as f64);
}

#[test]
fn sound_flights_have_no_faults() {
    for (seed, vehicle, flights) in worlds(0..20) {
        for flight in flights {
            let examined = examine(&flight, &vehicle).unwrap();
            assert!(examined.faults.is_empty(), "seed {seed} {}: {:?}", flight.name, examined.faults);
        }
    }
}

/// The flight with an IMU: what a noise-free twin of it feels, in body axes, with noise of a
/// filtered accelerometer.
fn with_imu(world: &World, pattern: Pattern) -> Option<Flight> {
    let (exact, noisy) = (
        world.fly(pattern, 20.0, &Sensors::noisy(0.0), 0).ok()?,
        world.fly(pattern, 20.0, &Sensors::default(), 0).ok()?,
    );
    let count = exact.len().min(noisy.len());
    let at = |c: Column, k: usize| exact.column(c).unwrap()[k];
    let place = |k: usize| Vector3::from([X, Y, Z].map(|c| at(c, k)));
    let mut random = rand_pcg::Pcg64::seed_from_u64(7);
    let mut imu: [Vec<f64>; 3] = Default::default();
    for k in 0..count {
        let middle = k.clamp(1, count - 2);
        let acceleration = (place(middle + 1) - 2.0 * place(middle) + place(middle - 1)) / 1e-4;
        let euler = Vector3::from([Phi, Theta, Psi].map(|c| at(c, middle)));
        let force =
            frames::dcm_from_euler(euler) * (acceleration - Vector3::new(0.0, 0.0, world.vehicle.gravity));
        for i in 0..3 {
            imu[i].push(force[i] + random.random_range(-0.3..0.3));
        }
    }
    let columns = ALL.map(|c| (c, noisy.column(c).unwrap()[..count].to_vec()));
    Some(Flight::from_columns(pattern.name(), columns.into_iter().chain([Ax, Ay, Az].into_iter().zip(imu))))
}

#[test]
fn planted_imu_faults_are_found_and_named() {
    let (mut count, mut found) = (0, 0);
    for seed in 0..4 {
        let world = World::new(Size::ALL[(seed % 2) as usize], seed);
        for flight in Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE).filter_map(|p| with_imu(&world, p))
        {
            let examined = examine(&flight, &world.vehicle).unwrap();
            assert!(examined.faults.is_empty(), "seed {seed} {}: {:?}", flight.name, examined.faults);
            let mut faults: Vec<(String, &str, Edit)> = Vec::new();
            for (k, m) in rotations().into_iter().enumerate().skip(1) {
                faults.push((
                    format!("IMU turned {k}"),
                    "ax, ay, az look like",
                    Box::new(move |r| r.imu = m * r.imu),
                ));
            }
            faults.push(("reversed".into(), "wrong sign", Box::new(|r| r.imu *= -1.0)));
            faults.push(("in g".into(), "multiples of g", Box::new(|r| r.imu /= 9.81)));
            let down = |r: &Row| frames::dcm_from_euler(r.euler) * Vector3::new(0.0, 0.0, 9.81);
            faults.push(("no gravity".into(), "without gravity", Box::new(move |r| r.imu += down(r))));
            faults.push((
                "wrong gravity".into(),
                "gravity with the wrong sign",
                Box::new(move |r| r.imu += 2.0 * down(r)),
            ));
            for (what, word, edit) in faults {
                let examined = examine(&edited(&flight, edit), &world.vehicle).unwrap();
                count += 1;
                let right = refused(&examined.faults).is_some_and(|f| f.sentence.contains(word));
                found += usize::from(right);
                if !right {
                    println!("seed {seed} {} {what}: {:?}", flight.name, examined.faults);
                }
            }
        }
    }
    println!("{count} planted, {found} named rightly");
    assert!(found as f64 >= 0.99 * count as f64);
}

#[test]
fn a_position_that_is_late_against_the_imu_is_put_right() {
    for seed in 0..4 {
        let world = World::new(Size::ALL[(seed % 2) as usize], seed);
        for flight in Pattern::TRAIN.into_iter().filter_map(|p| with_imu(&world, p)) {
            let late = 4;
            let columns = ALL.into_iter().chain([Ax, Ay, Az]).map(|c| {
                let values = flight.column(c).unwrap();
                let tracked = [X, Y, Z].contains(&c);
                let range = if tracked { 0..values.len() - late } else { late..values.len() };
                (c, values[range].to_vec())
            });
            let examined =
                examine(&Flight::from_columns(flight.name.clone(), columns), &world.vehicle).unwrap();
            let clock = examined.clocks.position.unwrap();
            println!(
                "seed {seed} {}: {:.1} +- {:.1} ms",
                flight.name,
                1e3 * clock.offset_s,
                1e3 * clock.offset_std_error_s
            );
            // An acceleration from a position is noisy: three standard errors, half a sample at
            // least.
            let slack = 0.005_f64.max(3.0 * clock.offset_std_error_s);
            assert!((clock.offset_s - 0.04).abs() < slack, "seed {seed} {}: {clock:?}", flight.name);
            assert!(examined.clocks.aligned, "seed {seed} {}", flight.name);
        }
    }
}

#[test]
fn motors_in_another_order_are_named() {
    let (mut count, mut found) = (0, 0);
    for (seed, vehicle, flights) in worlds(0..4) {
        for flight in flights {
            for order in orders().into_iter().skip(1) {
                let wrong = edited(&flight, move |r| r.command = order.map(|i| r.command[i]));
                let examined = examine(&wrong, &vehicle).unwrap();
                count += 1;
                // The columns cmd1.. hold the commands of motors order[0] + 1, ...
                let words: Vec<String> =
                    (0..4).map(|k| format!("cmd{} of motor {} ", k + 1, order[k] + 1)).collect();
                let fault = refused(&examined.faults);
                let right = fault.is_some_and(|f| words.iter().all(|w| f.sentence.contains(w)));
                found += usize::from(right);
                if !right {
                    println!("seed {seed} {} {order:?}: {:?}", flight.name, examined.faults);
                }
            }
            let mut turned = vehicle.clone();
            turned.motors.spin.rotate_left(1);
            let examined = examine(&flight, &turned).unwrap();
            count += 1;
            found += usize::from(refused(&examined.faults).is_some_and(|f| f.sentence.contains("spin")));
        }
    }
    println!("{count} planted, {found} named rightly");
    assert!(found as f64 >= 0.99 * count as f64);
}

fn orders() -> Vec<[usize; 4]> {
    let mut all = Vec::new();
    for code in 0..256_usize {
        let order = [code / 64, code / 16 % 4, code / 4 % 4, code % 4];
        if (0..4).all(|i| order.contains(&i)) {
            all.push(order);
        }
    }
    all
}

/// The flight with other values in some columns.
fn with_columns(flight: &Flight, change: impl Fn(Column, &[f64]) -> Vec<f64>) -> Flight {
    Flight::from_columns(flight.name.clone(), ALL.map(|c| (c, change(c, flight.column(c).unwrap()))))
}

#[test]
fn trackers_that_freeze_or_jump_are_cut_out() {
    let pose = [X, Y, Z, Phi, Theta, Psi];
    for (seed, vehicle, flights) in worlds(0..4) {
        for flight in flights {
            let sound = examine(&flight, &vehicle).unwrap().prepared.rows();
            let frozen = with_columns(&flight, |c, v| {
                let mut v = v.to_vec();
                if pose.contains(&c) {
                    let held = v[600];
                    v[600..650].fill(held);
                }
                v
            });
            let jumped = with_columns(&flight, |c, v| {
                let far = if c == Y { 0.4 } else { 0.0 };
                v.iter()
                    .enumerate()
                    .map(|(k, v)| if (700..715).contains(&k) { v + far } else { *v })
                    .collect()
            });
            let moved = with_columns(&flight, |c, v| {
                let far = if c == X { 0.2 } else { 0.0 };
                v.iter().enumerate().map(|(k, v)| if k >= 800 { v + far } else { *v }).collect()
            });
            for (wrong, kind, lost) in [
                (frozen, FaultKind::FrozenChannel, 49),
                (jumped, FaultKind::TrackerJump, 15),
                (moved, FaultKind::TrackerJump, 1),
            ] {
                let examined = examine(&wrong, &vehicle).unwrap();
                let kinds: Vec<FaultKind> = examined
                    .faults
                    .iter()
                    .filter(|f| f.severity == Severity::Warning)
                    .map(|f| f.kind)
                    .collect();
                assert_eq!(kinds, [kind], "seed {seed} {}: {:?}", flight.name, examined.faults);
                // Ends of stretches give no rows either: two windows at each side of the cut.
                let rows = examined.prepared.rows();
                assert!(rows + lost <= sound && rows + lost + 80 > sound, "{rows} of {sound}");
            }
        }
    }
}

#[test]
fn stuck_motors_and_commands_at_their_ends_are_told() {
    for (seed, vehicle, flights) in worlds(0..2) {
        let [low, high] = vehicle.motors.command_range;
        for flight in flights {
            let stuck = edited(&flight, |r| r.command[2] = 0.5 * (low + high));
            let dead = edited(&flight, |r| r.rate.z = 0.0);
            let at_end = with_columns(&flight, |c, v| {
                let end = |(k, v): (usize, &f64)| if c == Cmd2 && k % 8 == 0 { high } else { *v };
                v.iter().enumerate().map(end).collect()
            });
            for (wrong, kind, word) in [
                (stuck, FaultKind::FrozenChannel, "cmd3 never changes"),
                (dead, FaultKind::FrozenChannel, "r never changes"),
                (at_end, FaultKind::SaturatedCommands, "cmd2 in 12 % of the samples"),
            ] {
                let faults = examine(&wrong, &vehicle).unwrap().faults;
                let told = faults.iter().any(|f| f.kind == kind && f.sentence.contains(word));
                assert!(told, "seed {seed} {}: {faults:?}", flight.name);
            }
        }
    }
}

#[test]
fn pieces_and_copies_of_a_flight_are_recognised() {
    for (seed, vehicle, flights) in worlds(0..4) {
        let prepared: Vec<_> = flights.iter().map(|f| examine(f, &vehicle).unwrap().prepared).collect();
        for (k, flight) in flights.iter().enumerate() {
            for (j, other) in prepared.iter().enumerate().filter(|(j, _)| *j != k) {
                assert!(!sysid::checks::overlap::share_samples(&prepared[k], other), "seed {seed} {k} {j}");
            }
            let piece = with_columns(flight, |_, v| v[431..1400].to_vec());
            let rounded = with_columns(flight, |c, v| {
                let digits = if c == T { 1e3 } else { 1e4 };
                v.iter().map(|v| (v * digits).round() / digits).collect()
            });
            for again in [piece, rounded] {
                let again = examine(&again, &vehicle).unwrap().prepared;
                assert!(sysid::checks::overlap::share_samples(&prepared[k], &again), "seed {seed} {k}");
            }
        }
    }
}

type Change = fn(&mut Vehicle);

#[test]
fn wrong_vehicle_files_and_other_craft_are_suspected() {
    for (seed, vehicle, flights) in worlds(0..6) {
        if flights.len() < 5 {
            continue;
        }
        let basic: Vec<Effect> = Effect::basic().collect();
        let model_of = |vehicle: &Vehicle| {
            let prepared: Vec<_> = flights.iter().map(|f| examine(f, vehicle).unwrap().prepared).collect();
            let model =
                sysid::fit(&prepared.iter().collect::<Vec<_>>(), vehicle, &basic, None).unwrap().model;
            (model, prepared)
        };
        let suspicions = |vehicle: &Vehicle| {
            let (model, _) = model_of(vehicle);
            vehicle::of_vehicle(vehicle).into_iter().chain(vehicle::of_fit(&model)).count()
        };
        assert_eq!(suspicions(&vehicle), 0, "seed {seed}");
        let edits: [(&str, Change); 5] = [
            ("grams", |v| v.mass *= 1000.0),
            ("diameter", |v| v.rotor_radius *= 2.0),
            ("diagonal", |v| v.arm_length *= 2.0),
            ("centimetres", |v| v.rotor_radius *= 0.1),
            ("revolutions a minute", |v| {
                for k in [&mut v.motors.command, &mut v.motors.voltage, &mut v.motors.offset] {
                    *k = k.map(|k| k * 60.0 / std::f64::consts::TAU);
                }
            }),
        ];
        for (what, edit) in edits {
            let mut wrong = vehicle.clone();
            edit(&mut wrong);
            assert!(suspicions(&wrong) > 0, "seed {seed}: {what}");
        }
        // Flights of a craft half as large again as the model's.
        let (mut model, prepared) = model_of(&vehicle);
        let all: Vec<_> = prepared.iter().collect();
        assert_eq!(vehicle::differences(&model, &all, Likeness::SAME), Vec::<String>::new(), "seed {seed}");
        let scaled = |model: &mut Model, effect: Effect, factor: f64| {
            let term = model.terms.iter_mut().find(|t| t.effect == effect).unwrap();
            term.coefficients.iter_mut().for_each(|c| c.value *= factor);
        };
        // A third heavier is a finding of --changed, not another craft.
        scaled(&mut model, Effect::Thrust, 1.35);
        assert_eq!(
            vehicle::differences(&model, &all, Likeness::CHANGED),
            Vec::<String>::new(),
            "seed {seed}"
        );
        assert_eq!(vehicle::differences(&model, &all, Likeness::SAME).len(), 1, "seed {seed}");
        scaled(&mut model, Effect::Thrust, 1.5);
        assert_eq!(vehicle::differences(&model, &all, Likeness::CHANGED).len(), 1, "seed {seed}");
        scaled(&mut model, Effect::RotorMoments, -1.0);
        assert_eq!(vehicle::differences(&model, &all, Likeness::CHANGED).len(), 3, "seed {seed}");
    }
}

fn folder_flights(folder: &Path) -> (Vehicle, Vec<(PathBuf, Flight)>) {
    let vehicle = Vehicle::read(&folder.join("vehicle.toml")).unwrap();
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|x| x == "csv"))
        .collect();
    paths.sort();
    (vehicle, paths.into_iter().map(|p| (p.clone(), Flight::read(&p).unwrap())).collect())
}

/// What is wrong with flights, their vehicle file and their fit, but for notes.
fn everything_wrong(vehicle: &Vehicle, flights: &[Flight]) -> Vec<Fault> {
    let examined: Vec<_> = flights.iter().map(|f| examine(f, vehicle).unwrap()).collect();
    let mut faults: Vec<Fault> = examined.iter().flat_map(|e| e.faults.clone()).collect();
    let prepared: Vec<_> = examined.iter().map(|e| &e.prepared).collect();
    let (train, validate) = prepared.split_at(prepared.len().saturating_sub(2));
    let basic: Vec<Effect> = Effect::basic().collect();
    if let Ok(fit) = sysid::fit(train, vehicle, &basic, None) {
        faults.extend(vehicle::of_vehicle(vehicle));
        faults.extend(vehicle::of_fit(&fit.model));
        for sentence in vehicle::differences(&fit.model, validate, Likeness::SAME) {
            faults.push(Fault::of_all(FaultKind::OtherVehicle, Severity::Warning, sentence));
        }
    }
    faults.retain(|f| f.severity != Severity::Note);
    faults
}

#[test]
fn effects_and_poor_sensors_are_no_faults() {
    let sensors = [
        Sensors::default(),
        Sensors::noisy(2.0),
        Sensors { colour_s: 0.05, ..Sensors::default() },
        Sensors { jitter_s: 0.002, dropout: 0.02, ..Sensors::default() },
    ];
    let ids: Vec<&str> = PLANTED.iter().chain(OUTSIDE).map(|s| s.id).collect();
    let cases: Vec<(usize, &str)> = ids.into_iter().enumerate().collect();
    let wrong: Vec<String> = cases
        .par_iter()
        .flat_map(|(k, id)| {
            let seed = *k as u64;
            let world = World::new(Size::ALL[k % 2], seed).with(id, 1.2).unwrap();
            let patterns = Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE);
            let flights: Vec<Flight> =
                patterns.filter_map(|p| world.fly(p, 20.0, &sensors[k % 4], 0).ok()).collect();
            let faults = everything_wrong(&world.vehicle, &flights);
            faults.into_iter().map(|f| format!("{id} (seed {seed}): {f:?}")).collect::<Vec<_>>()
        })
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn faults_are_found_though_clocks_are_off() {
    let flights: Vec<(u64, Vehicle, Flight)> = worlds(4..6)
        .flat_map(|(seed, vehicle, flights)| flights.into_iter().map(move |f| (seed, vehicle.clone(), f)))
        .collect();
    let (mut planted_count, mut right) = (0, 0);
    for (k, (seed, vehicle, flight)) in flights.iter().enumerate() {
        // Whole samples: what is old in one stream is not interpolated.
        let late = [-20_isize, -9, 6, 18][k % 4];
        let count = flight.len() as isize;
        let kept = late.abs()..count - late.abs();
        let shifted = with_columns(flight, |c, v| {
            let by = if [X, Y, Z, Phi, Theta, Psi].contains(&c) { late } else { 0 };
            kept.clone().map(|k| v[(k - by) as usize]).collect()
        });
        let examined = examine(&shifted, vehicle).unwrap();
        let kinds: Vec<FaultKind> = examined.faults.iter().map(|f| f.kind).collect();
        assert_eq!(kinds, [FaultKind::ClockOffset], "seed {seed} {}: {:?}", flight.name, examined.faults);
        let offset_s = examined.clocks.attitude.unwrap().offset_s;
        assert!((offset_s - 0.01 * late as f64).abs() < 0.002, "{offset_s} of {late} samples");
        for (what, word, edit) in planted().into_iter().step_by(3) {
            let faults = examine(&edited(&shifted, edit), vehicle).unwrap().faults;
            let named = refused(&faults).is_some_and(|f| f.sentence.contains(word));
            planted_count += 1;
            right += usize::from(named);
            if !named {
                println!("seed {seed} {} {what}: {faults:?}", flight.name);
            }
        }
    }
    println!("{planted_count} planted, {right} named rightly");
    assert!(right as f64 >= 0.98 * planted_count as f64);
}

#[test]
fn flights_of_others_are_not_refused() {
    let Some(root) = shared("data") else { return };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(root.join("hidden"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.is_dir())
        .collect();
    folders.sort();
    let hidden = folders.len();
    folders.extend(["nanodrone", "nanobench", "crazypad"].map(|n| root.join(n)));
    for (k, folder) in folders.iter().enumerate() {
        let (vehicle, flights) = folder_flights(folder);
        for (path, flight) in flights {
            let examined = examine(&flight, &vehicle).unwrap();
            assert!(refused(&examined.faults).is_none(), "{}: {:?}", path.display(), examined.faults);
            if k < hidden {
                // A few of the noise's own largest values may be taken for outliers, which is a
                // note.
                let is_sound = examined.faults.iter().all(|f| f.severity == Severity::Note);
                assert!(is_sound, "{}: {:?}", path.display(), examined.faults);
            }
        }
    }
}

/// Hovering says what the rotors lift and little else: no model is made of it, and the refusal
/// names a coefficient and what to fly for it.
#[test]
fn flights_that_only_hover_say_what_to_fly() {
    for seed in 0..4 {
        let world = World::new(Size::ALL[(seed % 2) as usize], seed);
        let flights: Vec<Prepared> = (0..3)
            .filter_map(|again| world.fly(Pattern::Hover, 20.0, &Sensors::default(), again).ok())
            .map(|flight| examine(&flight, &world.vehicle).unwrap().prepared)
            .collect();
        let basic: Vec<Effect> = Effect::basic().collect();
        let fitted = sysid::fit(&flights.iter().collect::<Vec<_>>(), &world.vehicle, &basic, None);
        let said =
            fitted.map(|fit| fit.model.to_toml()).expect_err("hovering determines no model").to_string();
        println!("seed {seed}: {said}");
        let (what, fly) = said.split_once(": ").expect("a manoeuvre follows");
        assert!(what.starts_with("the flights do not excite "), "seed {seed}: {said}");
        let known = basic.iter().any(|effect| fly.contains(effect.info().excitation));
        assert!(known, "seed {seed}: {said}");
    }
}
