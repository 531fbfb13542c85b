//! Writes a page with every kind of figure and table: `cargo run -p report --example gallery -- gallery.html`.
//!
//! The curves are closed-form signals made for this page, not measurements.

use std::f64::consts::TAU;
use std::process::ExitCode;

use report::{
    Axis, Cell, Column, Figure, InputFile, Mark, Page, Panels, Provenance, Sample, Section, Series, Style,
    Table, Verdict, binned_scatter, histogram,
};

fn main() -> ExitCode {
    let Some(path) = std::env::args().nth(1) else {
        eprintln!("usage: gallery FILE.html");
        return ExitCode::from(2);
    };
    match page().write(&path) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn page() -> Page {
    Page::new("Gallery of figures and tables", "Every element a report can contain, with signals made from formulas.")
        .section(
            Section::new("Flight <script>alert(1)</script> & friends")
                .paragraph("Names come from files, so everything is escaped. The gap near 6 s is missing data; the single spike at 3 s survives the reduction of 20 000 samples to the pixels there are.")
                .figure(residual_panels(), "Three panels over one time axis: the change removes the error of the prediction.")
                .table(table()),
        )
        .section(
            Section::new("Distributions and dependence")
                .figure(one_histogram(), "One set of values as bars.")
                .figure(two_histograms(), "Two sets as outlines over common bins.")
                .figure(scatter(), "The mean leaves the zero line with airspeed: drag is missing from the model."),
        )
        .section(
            Section::new("Other axes")
                .figure(spectrum(), "Both axes logarithmic; the limit is a line, the resonance a band.")
                .figure(motors(), "Four equals, one step signal each.")
                .figure(track(), "One metre is as long to the north as to the east.")
                .figure(small_numbers(), "Values far from one move their power of ten into the label.")
                .figure(Figure::new("Nothing was recorded", time(), Axis::new("thrust", "N")), "A figure without data says so."),
        )
        .section(
            Section::new("Text")
                .list(["first point", "second point"])
                .preformatted("  column a   column b\n       1.0        2.0\n  a < b && c > d\n"),
        )
        .provenance(Provenance {
            command_line: "cargo run -p report --example gallery -- gallery.html".into(),
            version: format!("report {}", env!("CARGO_PKG_VERSION")),
            date: String::new(),
            inputs: vec![InputFile { path: "none, all signals are formulas".into(), hash: String::new() }],
        })
}

fn time() -> Axis {
    Axis::new("time", "s")
}

/// Deterministic noise in [-1, 1): the fractional part of a large multiple of a sine.
fn noise(i: u32) -> f64 {
    2.0 * (f64::from(i).sin() * 43_758.545_3).rem_euclid(1.0) - 1.0
}

fn sampled(count: u32, value: impl Fn(f64, u32) -> f64) -> Vec<(f64, f64)> {
    (0..count).map(|i| (10.0 * f64::from(i) / f64::from(count), i)).map(|(t, i)| (t, value(t, i))).collect()
}

fn residual_panels() -> Panels {
    let truth = |t: f64| 0.8 * (TAU * 0.4 * t).sin() + 0.3 * (TAU * 1.1 * t).cos();
    let measured = sampled(20_000, |t, i| match t {
        t if (5.8..6.4).contains(&t) => f64::NAN,
        _ if i == 6000 => 2.4,
        t => truth(t) + 0.12 * noise(i),
    });
    let before = sampled(2000, |t, _| 0.7 * truth(t - 0.03));
    let after = sampled(2000, |t, _| truth(t));
    let error = |prediction: &[(f64, f64)]| -> Vec<_> {
        prediction.iter().zip(measured.iter().step_by(10)).map(|(p, m)| (p.0, m.1 - p.1)).collect()
    };
    let rate = Figure::new("Roll rate", time(), Axis::new("roll rate", "rad/s"))
        .with(Series::line("measured", Style::Measured, measured.clone()))
        .with(Series::line("predicted before", Style::PredictedBefore, before.clone()))
        .with(Series::line("predicted after", Style::PredictedAfter, after.clone()))
        .mark(Mark::limit("limit ±1.5 rad/s", 1.5))
        .mark(Mark::limit("", -1.5));
    let residual = Figure::new("", time(), Axis::new("error of the predicted roll rate", "rad/s"))
        .with(Series::line("before", Style::PredictedBefore, error(&before)))
        .with(Series::line("after", Style::PredictedAfter, error(&after)))
        .mark(Mark::allowed("allowed", (-0.25, 0.25)));
    let command = Figure::new("", time(), Axis::new("set-point", "rad/s"))
        .with(Series::step("set-point", Style::Reference, sampled(12, |t, _| (TAU * 0.4 * t).sin().round())))
        .mark(Mark::event("wind on", 4.0));
    Panels::new([rate, residual, command])
}

fn table() -> Table {
    let columns = [
        Column::text("flight"),
        Column::number("rms error", "rad/s"),
        Column::number("change", "%"),
        Column::text("limit kept"),
    ];
    Table::new("Error of the predicted roll rate", columns)
        .row([
            "<script>".into(),
            Cell::number(0.020_31, 3),
            Cell::number(-41.2, 3),
            Cell::from("yes").verdict(Verdict::Good),
        ])
        .row([
            "B".into(),
            Cell::number(0.5, 3),
            Cell::number(12.0, 3),
            Cell::from("no").verdict(Verdict::Bad),
        ])
        .row([
            "C".into(),
            Cell::number(f64::NAN, 3),
            Cell::from(""),
            Cell::from("not flown").verdict(Verdict::Neutral),
        ])
}

/// Roughly bell-shaped: the sum of several uniform values.
fn bell(seed: u32, spread: f64) -> Vec<f64> {
    (0..4000).map(|i| spread * (0..6).map(|k| noise(seed + 7 * i + k)).sum::<f64>()).collect()
}

fn one_histogram() -> Figure {
    let values = bell(1, 0.03);
    histogram(
        "Residual",
        Axis::new("residual", "N"),
        &[Sample { name: "residual", style: Style::PredictedAfter, values: &values }],
        40,
    )
    .mark(Mark::VerticalBand { name: "allowed".into(), x: (-0.1, 0.1), style: Style::Reference })
}

fn two_histograms() -> Figure {
    let (before, after) = (bell(1, 0.06), bell(99_999, 0.03));
    let samples = [
        Sample { name: "before", style: Style::PredictedBefore, values: &before },
        Sample { name: "after", style: Style::PredictedAfter, values: &after },
    ];
    histogram("Residual before and after", Axis::new("residual", "N"), &samples, 50)
}

fn scatter() -> Figure {
    let points: Vec<_> = (0..20_000)
        .map(|i| (4.0 * noise(i), noise(i + 77_777)))
        .map(|(speed, scatter)| (speed, -0.02 * speed * speed.abs() + 0.15 * scatter))
        .collect();
    binned_scatter(
        "Residual against airspeed",
        Axis::new("forward airspeed", "m/s"),
        Axis::new("force residual", "N"),
        &points,
        16,
    )
}

fn spectrum() -> Figure {
    let gain = |f: f64| 1.0 / ((1.0 - (f / 12.0).powi(2)).powi(2) + (0.1 * f / 12.0).powi(2)).sqrt();
    let frequencies = (0..600).map(|i| 10_f64.powf(-1.0 + f64::from(i) * 3.5 / 599.0));
    let data: Vec<_> = frequencies.map(|f| (f, gain(f))).collect();
    Figure::new("Frequency response", Axis::logarithmic("frequency", "Hz"), Axis::logarithmic("gain", ""))
        .with(Series::line("closed loop", Style::PredictedAfter, data))
        .mark(Mark::limit("largest allowed gain", 5.0))
        .mark(Mark::VerticalBand { name: "pendulum".into(), x: (9.0, 15.0), style: Style::PredictedBefore })
}

fn motors() -> Figure {
    let start = Figure::new("Rotor speeds", time(), Axis::new("rotor speed", "rad/s"));
    (0..4).fold(start, |figure, motor| {
        let phase = f64::from(motor);
        let data = sampled(60, |t, _| 620.0 + 40.0 * (TAU * 0.2 * t + phase).sin());
        figure.with(Series::step(format!("motor {}", motor + 1), Style::Category(motor as usize), data))
    })
}

fn track() -> Figure {
    let circle: Vec<_> = (0..=200)
        .map(|i| TAU * f64::from(i) / 200.0)
        .map(|a| (3.0 * a.sin(), 2.0 * (2.0 * a).sin()))
        .collect();
    let flown: Vec<_> = circle
        .iter()
        .zip(0..)
        .step_by(4)
        .map(|(p, i)| (p.0 + 0.1 * noise(i), p.1 + 0.1 * noise(i + 500)))
        .collect();
    Figure::new("Track over ground", Axis::new("east", "m"), Axis::new("north", "m"))
        .with(Series::line("planned", Style::Reference, circle))
        .with(Series::points("flown", Style::Category(1), flown))
        .equal_scale()
}

fn small_numbers() -> Figure {
    let estimates: Vec<_> = (1..=9).map(|i| (f64::from(i), 3.1e-6 + 2e-7 * noise(i as u32))).collect();
    Figure::new(
        "Thrust coefficient by flight",
        Axis::new("flight", ""),
        Axis::new("thrust coefficient of the fitted rotor model", "N s²"),
    )
    .with(Series::points("fitted", Style::PredictedAfter, estimates))
    .mark(Mark::Horizontal { name: "bench".into(), y: 3.1e-6, style: Style::Reference })
}
