//! Diagnoses with the whole catalogue on five 60 s flights at 100 Hz, after reading; one core. The aim is a second each, and 0.3 s for
//! the exhaustive search over all sets of up to three of twenty candidates.

use diagnosis::subsets::Problem;
use diagnosis::{Silent, diagnose};
use divan::{Bencher, black_box};
use model::{Effect, Model};
use nalgebra::DMatrix;
use stories::world::{Pattern, Sensors, Size, World};
use sysid::{Prepared, fit};

fn main() {
    divan::main();
}

/// Five flights of a world with `hidden` effects, and the basic model of the first three.
fn flown(hidden: &[&str], sensors: &Sensors) -> (Model, Vec<Prepared>) {
    let calm = World::new(Size::F330, 1);
    let world = hidden.iter().fold(calm, |world, id| world.with(id, 1.0).expect("an effect of the worlds"));
    let flights: Vec<Prepared> = Pattern::TRAIN
        .into_iter()
        .chain(Pattern::VALIDATE)
        .map(|pattern| {
            let flight = world.fly(pattern, 60.0, sensors, 0).expect("the pilot copes");
            Prepared::new(&flight, &world.vehicle).expect("long enough")
        })
        .collect();
    let train: Vec<&Prepared> = flights[..3].iter().collect();
    let basic: Vec<Effect> = Effect::basic().collect();
    let model = fit(&train, &world.vehicle, &basic, None).expect("excited").model;
    (model, flights)
}

fn diagnose_flights(bencher: Bencher, hidden: &[&str], sensors: &Sensors) {
    let (model, flights) = flown(hidden, sensors);
    let all: Vec<&Prepared> = flights.iter().collect();
    let (train, validate) = all.split_at(3);
    bencher.bench_local(|| diagnose(black_box(&model), train, validate, &Silent).expect("a diagnosis"));
}

/// What worlds of the bench hide.
const HIDDEN: [&[&str]; 7] = [
    &[],
    &["ground-effect"],
    &["steady-wind", "ground-effect"],
    &["tether"],
    &["slung-load"],
    &["slung-load", "ground-effect"],
    &["tether", "steady-wind"],
];

#[divan::bench(args = HIDDEN, sample_count = 10)]
fn diagnose_five_flights(bencher: Bencher, hidden: &[&str]) {
    diagnose_flights(bencher, hidden, &Sensors::default());
}

/// One sample in twenty of every sensor is an outlier.
#[divan::bench(args = [&[][..], &["steady-wind", "ground-effect"]], sample_count = 10)]
fn diagnose_five_flights_with_outliers(bencher: Bencher, hidden: &[&str]) {
    diagnose_flights(bencher, hidden, &Sensors::default().with_outliers());
}

/// Twenty candidates of two coefficients, 1350 sets, six axes.
#[divan::bench(sample_count = 20)]
fn search_all_sets_of_three(bencher: Bencher) {
    let wave = |r: usize, c: usize| (0.37 * (r + 1) as f64 * (c + 2) as f64).sin();
    let cross = |rows: usize, shift: usize| {
        let x = DMatrix::from_fn(rows, 41, |r, c| {
            if c < 40 {
                wave(r + shift, c)
            } else {
                wave(r + shift, 3) - wave(r + shift, 17) + 2.0 * wave(r, 999 + shift)
            }
        });
        x.transpose() * x
    };
    let problem = Problem {
        groups: (0..20).map(|g| 2 * g..2 * g + 2).collect(),
        train: cross(2000, 0),
        held_out: std::array::from_fn(|axis| cross(500, 3000 + 700 * axis)),
        effective_rows: [300.0; 6],
        admissible: vec![(f64::NEG_INFINITY, f64::INFINITY); 40],
    };
    bencher.bench_local(|| black_box(&problem).search(3, 1.0));
}
