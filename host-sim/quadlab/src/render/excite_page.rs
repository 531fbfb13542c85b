//! The page of `quadlab excite`: a pattern as the current model flies it, and what it will tell.

use pattern::Pattern;
use report::{Axis, Figure, Page, Panels, Section, Series, Style};
use sil::predict::Predictor;

/// The page: the pattern as the model flies it, and `text`, what it will tell.
pub(crate) fn page(text: String, pattern: &Pattern, predictor: &Predictor) -> anyhow::Result<Page> {
    let recording = sil::fly(&predictor.plan(pattern))?;
    let time = || Axis::new("time", "s");
    let of = |pick: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..recording.rows.len()).map(|k| (recording.time_s(k), pick(k))).collect()
    };
    let euler = recording.euler_rad();
    let unit = predictor.model().vehicle.motors.command_unit.as_str();
    let injection = (0..4).fold(
        Figure::new("Signals on the motors", time(), Axis::new("injection", unit)),
        |figure, motor| {
            let data: Vec<(f64, f64)> = pattern.rows().iter().map(|r| (r.t_s, r.injection[motor])).collect();
            figure.with(Series::line(format!("motor {}", motor + 1), Style::Category(motor), data))
        },
    );
    let attitude = ["roll", "pitch"].into_iter().enumerate().fold(
        Figure::new("Attitude", time(), Axis::new("angle", "deg")),
        |figure, (axis, name)| {
            figure.with(Series::line(name, Style::Category(axis), of(&|k| euler[k][axis].to_degrees())))
        },
    );
    let position = ["x", "y", "height"].into_iter().enumerate().fold(
        Figure::new("Position", time(), Axis::new("position", "m")),
        |figure, (axis, name)| {
            let sign = if axis == 2 { -1.0 } else { 1.0 };
            let value = |k: usize| sign * f64::from(recording.rows[k].truth.position_m[axis]);
            figure.with(Series::line(name, Style::Category(axis), of(&value)))
        },
    );
    Ok(Page::new(
        "An informative flight",
        "What a pattern will show, predicted from a simulated flight of the current model.",
    )
    .section(
        Section::new("The flight")
            .figure(Panels::new([injection, attitude, position]), "As the model flies it, without noise."),
    )
    .section(Section::new("What it will show").preformatted(text)))
}
