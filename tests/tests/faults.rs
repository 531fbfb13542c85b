//! Faults of logs: planted ones are found and named, sound flights are left alone.

use std::path::{Path, PathBuf};

use model::{Vehicle, frames};
use nalgebra::{Matrix3, Vector3, Vector4};
use stories::shared;
use stories::world::{Pattern, Sensors, Size, World};
use sysid::{Column, Fault, FaultKind, Flight, Severity, examine};

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

fn quaternion(q: Vector4<f64>) -> Vector3<f64> {
    frames::euler_from_quaternion(&q)
}

type Edit = Box<dyn Fn(&mut Row)>;

/// Every single fault that is to be found: what it is, a word that its sentence has, and how to plant it.
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
    let orders: [(&str, &str, fn(Vector4<f64>) -> Vector4<f64>); 3] = [
        ("conjugated", "conjugated", |q| Vector4::new(q[0], -q[1], -q[2], -q[3])),
        ("x, y, z, w read as w, x, y, z", "x, y, z, w", |q| Vector4::new(q[1], q[2], q[3], q[0])),
        ("w, x, y, z read as x, y, z, w", "w, x, y, z", |q| Vector4::new(q[3], q[0], q[1], q[2])),
    ];
    for (name, word, order) in orders {
        all.push((
            format!("quaternion {name}"),
            word,
            Box::new(move |r| r.euler = quaternion(order(frames::quaternion_from_euler(r.euler)))),
        ));
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
    all.push((
        "log NWU/FLU".into(),
        "whole log",
        Box::new(move |r| {
            r.euler = to(r.euler, flip, flip);
            r.position = flip * r.position;
            r.rate = flip * r.rate;
        }),
    ));
    all.push((
        "log ENU/FLU".into(),
        "whole log",
        Box::new(move |r| {
            r.euler = to(r.euler, flip, enu);
            r.position = enu * r.position;
            r.rate = flip * r.rate;
        }),
    ));
    all.push((
        "tracker NWU/FLU".into(),
        "tracker",
        Box::new(move |r| {
            r.euler = to(r.euler, flip, flip);
            r.position = flip * r.position;
        }),
    ));
    all.push((
        "tracker ENU/FLU".into(),
        "tracker",
        Box::new(move |r| {
            r.euler = to(r.euler, flip, enu);
            r.position = enu * r.position;
        }),
    ));
    all.push(("angles in degrees".into(), "degrees", Box::new(|r| r.euler = r.euler.map(f64::to_degrees))));
    all.push(("position in millimetres".into(), "millimetres", Box::new(|r| r.position *= 1000.0)));
    all
}

fn refused(faults: &[Fault]) -> Option<&Fault> {
    faults.iter().find(|f| f.severity == Severity::Refused)
}

#[test]
fn planted_frames_are_found_and_named() {
    let (mut count, mut found, mut named) = (0, 0, 0);
    for (seed, vehicle, flights) in worlds(0..4) {
        for flight in flights {
            for (what, word, edit) in planted() {
                let wrong = edited(&flight, edit);
                let Ok(examined) = examine(&wrong, &vehicle) else { panic!("{what}") };
                count += 1;
                let fault = refused(&examined.faults);
                found += usize::from(
                    fault.is_some()
                        || examined.faults.iter().any(|f| f.kind == FaultKind::InconsistentFrames),
                );
                let right = fault.is_some_and(|f| f.sentence.contains(word));
                named += usize::from(right);
                if !right {
                    println!("seed {seed} {} {what}: {:?}", flight.name, examined.faults);
                }
            }
        }
    }
    println!("{count} planted, {found} found, {named} named rightly");
    assert!(found as f64 >= 0.99 * count as f64);
    assert!(named as f64 >= 0.99 * count as f64);
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

#[test]
fn flights_of_others_are_not_refused() {
    let Some(root) = shared("data") else { return };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(root.join("hidden"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.is_dir())
        .collect();
    folders.push(root.join("hidden/case-07/base"));
    folders.sort();
    let hidden = folders.len();
    folders.extend(["nanodrone", "nanobench", "crazypad"].map(|n| root.join(n)));
    for (k, folder) in folders.iter().enumerate() {
        if !folder.join("vehicle.toml").exists() {
            println!("no vehicle in {}", folder.display());
            continue;
        }
        let (vehicle, flights) = folder_flights(folder);
        for (path, flight) in flights {
            let start = std::time::Instant::now();
            let examined = examine(&flight, &vehicle).unwrap();
            println!(
                "{} {:.0} ms att {:?} pos {:?}",
                path.display(),
                1e3 * start.elapsed().as_secs_f64(),
                examined.clocks.attitude.map(|c| (
                    c.offset_s * 1e3,
                    c.offset_std_error_s * 1e3,
                    c.skew,
                    c.skew_std_error,
                    c.matters
                )),
                examined.clocks.position.map(|c| (
                    c.offset_s * 1e3,
                    c.offset_std_error_s * 1e3,
                    c.skew,
                    c.matters
                ))
            );
            for f in &examined.faults {
                println!("   {:?} {}", f.kind, f.sentence);
            }
            assert!(refused(&examined.faults).is_none(), "{}: {:?}", path.display(), examined.faults);
            if k < hidden {
                assert!(examined.faults.is_empty(), "{}: {:?}", path.display(), examined.faults);
            }
        }
    }
}
