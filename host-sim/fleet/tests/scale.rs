//! What a large fleet costs, and how often a fleet in which nothing changed is said to have changed. Long: run by name.

mod common;

use std::time::Instant;

use common::{asked, craft, flight, truth, updated};
use diagnosis::workflow::Silent;
use fleet::{PassOptions, Question};
use model::{Effect, Model};
use rayon::prelude::*;

/// CPU time of this process, s, and its largest memory, MB.
fn used() -> (f64, f64) {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    let ticks: f64 = [11, 12].iter().map(|k| fields[*k].parse::<f64>().unwrap()).sum();
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    (ticks / 100.0, peak.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0)
}

/// Flights of 60 s in ten craft; `FLIGHTS` of them in all.
#[test]
#[ignore = "some minutes and a gigabyte of flights"]
fn a_large_fleet() {
    let count: usize = std::env::var("FLIGHTS").map_or(200, |text| text.parse().unwrap());
    let root = tempfile::tempdir().unwrap();
    let crafts = 10.min(count / 10).max(1);
    (0..count).into_par_iter().for_each(|k| {
        let folder = craft(root.path(), &format!("quad-{}", k % crafts));
        let flown = common::fly(&truth(), k as u64, 60.0, &common::ORDINARY);
        std::fs::write(folder.join(format!("{k:05}.csv")), flown.to_csv()).unwrap();
    });
    let (cpu_before, _) = used();
    let began = Instant::now();
    let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
    let (cpu, peak) = used();
    println!(
        "first pass: {} flights, {:.0} MB, {:.1} s, {:.1} CPU-s ({:.1} MB a CPU-second), peak memory {peak:.0} MB",
        indexed.read,
        indexed.read_mb,
        began.elapsed().as_secs_f64(),
        cpu - cpu_before,
        indexed.read_mb / (cpu - cpu_before)
    );
    drop((fleet, indexed));
    let index = common::index(root.path());
    println!("index: {:.1} MB", std::fs::metadata(&index).unwrap().len() as f64 * 1e-6);
    for (name, question) in [
        ("the same again", Question::default()),
        ("another effect", Question { effects: Some(vec![Effect::QuadraticDrag]), ..Question::default() }),
    ] {
        let (cpu_before, _) = used();
        let began = Instant::now();
        let (fleet, indexed) = updated(root.path(), PassOptions::default(), &Silent);
        let opened = began.elapsed().as_secs_f64();
        let answer = asked(&fleet, &indexed, &question);
        let changes: usize = answer.crafts.iter().map(|craft| craft.changes.len()).sum();
        println!(
            "{name}: {:.2} s ({opened:.2} s to open), {:.2} CPU-s, peak memory {:.0} MB, {changes} changes",
            began.elapsed().as_secs_f64(),
            used().0 - cpu_before,
            used().1
        );
    }
}

/// A craft whose coefficients differ a little from flight to flight, as those of real craft do, with nothing else to find.
fn scattered(seed: u64) -> Model {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut gauss = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let mut model = truth();
    let thrust = truth().term(Effect::Thrust).unwrap().coefficients[0].value;
    model.set(Effect::Thrust, &[thrust * (1.0 + 0.01 * gauss())]);
    model.set(Effect::ComOffset, &[0.0003 * gauss(), 0.0003 * gauss()]);
    model
}

#[test]
#[ignore = "a hundred fleets of twenty flights"]
fn fleets_in_which_nothing_changed() {
    let fleets: u64 = std::env::var("FLEETS").map_or(100, |text| text.parse().unwrap());
    let alarms: Vec<u64> = (0..fleets)
        .into_par_iter()
        .filter(|fleet| {
            let root = tempfile::tempdir().unwrap();
            let folder = craft(root.path(), "quad-1");
            (1..=20).for_each(|day| {
                flight(&folder, &scattered(1000 * fleet + day), day, 1000 * fleet + day, 10.0)
            });
            let (found, indexed) = updated(root.path(), PassOptions::default(), &Silent);
            let answer = asked(&found, &indexed, &Question::default());
            let own = &answer.crafts[0];
            for event in &own.changes {
                println!("fleet {fleet}: {} p {}", event.moved[0].series, event.moved[0].p_value);
            }
            for odd in &own.odd_flights {
                println!(
                    "fleet {fleet}: {} stands out in {} p {}",
                    odd.flight.flight, odd.series, odd.p_value
                );
            }
            !own.changes.is_empty()
        })
        .collect();
    println!("{} of {fleets} fleets in which nothing changed are said to have changed", alarms.len());
    assert!(alarms.len() as u64 <= fleets / 50, "{alarms:?}");
}
