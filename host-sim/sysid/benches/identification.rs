//! The hot paths from flight file to model: reading, preprocessing and regression of five 60 s flights at 100 Hz.
//!
//! The flights are made of sines: what is timed does not depend on whether they obey physics.

use divan::counter::BytesCount;
use divan::{Bencher, black_box};
use model::{Effect, Vehicle};
use sysid::{Column, Flight, Prepared};

const FLIGHTS: usize = 5;
const ROWS: usize = 6000;

fn main() {
    divan::main();
}

fn flight(number: usize) -> Flight {
    use Column::*;
    let wave = |column: usize, mean: f64, size: f64| -> Vec<f64> {
        let seed = (column + 31 * number) as f64;
        (0..ROWS)
            .map(|k| {
                let t = k as f64 * 0.01;
                let slow = (0.7 * t + seed).sin() + (1.9 * t + 2.0 * seed).cos();
                mean + size * (slow + 0.05 * (23.0 * t + seed * seed).sin())
            })
            .collect()
    };
    let time: Vec<f64> = (0..ROWS).map(|k| (k as f64 * 0.01 * 1000.0).round() / 1000.0).collect();
    let columns = [
        (X, 0.0, 1.0),
        (Y, 0.0, 1.0),
        (Z, -1.0, 0.3),
        (Phi, 0.0, 0.1),
        (Theta, 0.0, 0.1),
        (Psi, 0.0, 0.5),
        (P, 0.0, 0.3),
        (Q, 0.0, 0.3),
        (R, 0.0, 0.3),
        (Cmd1, 1650.0, 30.0),
        (Cmd2, 1650.0, 30.0),
        (Cmd3, 1650.0, 30.0),
        (Cmd4, 1650.0, 30.0),
        (Vbat, 11.5, 0.1),
    ];
    let waves =
        columns.into_iter().enumerate().map(|(i, (column, mean, size))| (column, wave(i, mean, size)));
    Flight::from_columns(format!("{number}.csv"), std::iter::once((T, time)).chain(waves))
}

fn flights() -> Vec<Flight> {
    (0..FLIGHTS).map(flight).collect()
}

/// Numbers with six decimals, as most loggers write them.
fn text(flight: &Flight) -> String {
    let long = flight.to_csv();
    let mut lines = long.lines();
    let mut short = format!("{}\n", lines.next().unwrap_or_default());
    for line in lines {
        let fields = line.split(',').map(|f| f.parse::<f64>().map_or(String::new(), |v| format!("{v:.6}")));
        short.push_str(&fields.collect::<Vec<_>>().join(","));
        short.push('\n');
    }
    short
}

fn prepared(vehicle: &Vehicle) -> Vec<Prepared> {
    flights().iter().map(|f| Prepared::new(f, vehicle).expect("long enough")).collect()
}

#[divan::bench]
fn read_flight_file(bencher: Bencher) {
    let text = text(&flight(0));
    let path = std::path::Path::new("bench.csv");
    bencher
        .counter(BytesCount::of_str(&text))
        .bench(|| Flight::parse(black_box(text.as_bytes()), path).expect("a good file"));
}

#[divan::bench]
fn prepare_five_flights(bencher: Bencher) {
    let (vehicle, flights) = (Vehicle::thesis(), flights());
    bencher.bench(|| {
        flights
            .iter()
            .map(|f| Prepared::new(black_box(f), &vehicle).expect("long enough").rows())
            .sum::<usize>()
    });
}

#[divan::bench]
fn fit_five_flights(bencher: Bencher) {
    let vehicle = Vehicle::thesis();
    let prepared = prepared(&vehicle);
    let all: Vec<&Prepared> = prepared.iter().collect();
    let basic: Vec<Effect> = Effect::basic().collect();
    bencher.bench(|| sysid::fit(black_box(&all), &vehicle, &basic, None).expect("excited"));
}

/// Identification after reading, as the aim is stated: preprocessing and regression together.
#[divan::bench]
fn identify_five_flights(bencher: Bencher) {
    let (vehicle, flights) = (Vehicle::thesis(), flights());
    let basic: Vec<Effect> = Effect::basic().collect();
    bencher.bench(|| {
        let prepared: Vec<Prepared> =
            flights.iter().map(|f| Prepared::new(black_box(f), &vehicle).expect("long enough")).collect();
        let all: Vec<&Prepared> = prepared.iter().collect();
        sysid::fit(&all, &vehicle, &basic, None).expect("excited")
    });
}
