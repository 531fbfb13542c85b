//! The flights that the benches of the identification share: 60 s at 100 Hz made of sines. What is measured does not
//! depend on whether they obey physics.

use flights::{Column, Flight};
use model::{Effect, Vehicle};
use sysid::{Fit, Prepared};

const ROWS: usize = 6000;

/// Mean and size of each column but the time; motor commands in us.
const COLUMNS: [(Column, f64, f64); 14] = [
    (Column::X, 0.0, 1.0),
    (Column::Y, 0.0, 1.0),
    (Column::Z, -1.0, 0.3),
    (Column::Phi, 0.0, 0.1),
    (Column::Theta, 0.0, 0.1),
    (Column::Psi, 0.0, 0.5),
    (Column::P, 0.0, 0.3),
    (Column::Q, 0.0, 0.3),
    (Column::R, 0.0, 0.3),
    (Column::Cmd1, 1650.0, 30.0),
    (Column::Cmd2, 1650.0, 30.0),
    (Column::Cmd3, 1650.0, 30.0),
    (Column::Cmd4, 1650.0, 30.0),
    (Column::Vbat, 11.5, 0.1),
];

/// Five flights.
pub(crate) fn flights() -> Vec<Flight> {
    (0..5).map(flight).collect()
}

/// One flight; other numbers give other phases.
pub(crate) fn flight(number: usize) -> Flight {
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
    let waves =
        COLUMNS.into_iter().enumerate().map(|(i, (column, mean, size))| (column, wave(i, mean, size)));
    Flight::from_columns(format!("{number}.csv"), std::iter::once((Column::T, time)).chain(waves))
}

/// The flight's file, numbers with six decimals as most loggers write them.
pub(crate) fn text(flight: &Flight) -> String {
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

/// The flight file's numbers.
pub(crate) fn read(text: &str) -> Flight {
    Flight::parse(text.as_bytes(), std::path::Path::new("bench.csv")).expect("a good file")
}

/// Flights made ready for the regression.
pub(crate) fn prepare(flights: &[Flight]) -> Vec<Prepared> {
    let vehicle = Vehicle::thesis();
    flights.iter().map(|flight| Prepared::new(flight, &vehicle).expect("long enough")).collect()
}

/// The thesis' structure fitted to flights.
pub(crate) fn fit(flights: &[Prepared]) -> Fit {
    let all: Vec<&Prepared> = flights.iter().collect();
    let basic: Vec<Effect> = Effect::basic().collect();
    sysid::fit(&all, &Vehicle::thesis(), &basic, None).expect("excited")
}
