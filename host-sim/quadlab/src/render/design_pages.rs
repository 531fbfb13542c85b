//! The page of `quadlab design check`: the figures of thesis chapter 5 and its appendices, for
//! these gains on this model.

use control::Config;
use design::Complex;
use design::analysis::{
    FrequencyPoint, LONG_S, LoopMargins, Margins, Study, actuator_bode, bare_step, closed_bode, commanded,
    disturbance_step, loop_bode, root_locus,
};
use design::check::{CheckReport, Spread, Uncertainty};
use design::loops::{
    ClosedLoop, GAINS, Gain, LoopName, LoopPlant, View, axis_channel, gain_of, with_moved_zero,
};
use model::Model;
use report::{
    Axis, Cell, Column, Figure, Mark, Page, Panels, Section, Series, Style, Table, Verdict, significant,
};

use crate::render::design_tables::failures;

/// Factors on a gain along its root locus.
const LOCUS_POINTS: usize = 60;
/// A locus goes to this multiple of the gain.
const LOCUS_END: f64 = 3.0;
/// How much of a response is drawn, s.
const DRAWN_S: f64 = 15.0;

/// The page of a check.
pub(crate) fn check(
    model: &Model,
    config: &Config,
    view: View,
    report: &CheckReport,
) -> anyhow::Result<Page> {
    let study = Study::new(model, config, view)?;
    let how = match report.delay_samples {
        Some(delay) => format!("sampled, with a pose that is {delay} samples old"),
        None => "continuous, as the thesis designs".into(),
    };
    let failures = failures(report);
    let lead = match failures.is_empty() {
        true => format!("{}: stable in everything that was checked ({how}).", report.vehicle),
        false => format!("{}: not safe to fly ({how}): {}.", report.vehicle, failures.join("; ")),
    };
    let mut page = Page::new("Design check", lead).section(
        Section::new("Margins")
            .table(margins(report))
            .table(actuator_margins(report))
            .list(report.notes.clone()),
    );
    for (plant, closed) in &study.loops {
        page = page.section(section(config, view, plant, closed)?);
    }
    if !report.moved_zero.is_empty() {
        page = page.section(moved_zeros(config, view, &study, report)?);
    }
    if let Some(uncertainty) = &report.uncertainty {
        page = page.section(spread(uncertainty));
    }
    Ok(page.section(battery(report)).section(steady_tilts(report)))
}

/// The greatest tilts that the craft can hold.
pub(crate) fn steady_tilts(report: &CheckReport) -> Section {
    let section = Section::new("Greatest tilt that can be held");
    let Some(first) = report.steady_tilts.first() else {
        return section.paragraph("The vehicle file has no map from motor commands to rotor speeds.");
    };
    let columns = [
        Column::text("towards"),
        Column::number("tilt", "deg"),
        Column::number("speed", "m/s"),
        Column::text("limited by"),
    ];
    let mut table = Table::new("", columns);
    for tilt in &report.steady_tilts {
        table.push([
            Cell::from(tilt.direction.name()),
            Cell::number(tilt.tilt_deg, 3),
            Cell::number(tilt.speed_m_s, 3),
            Cell::from(tilt.limited_by()),
        ]);
    }
    section
        .paragraph(format!(
            "At a constant tilt the craft accelerates until drag balances it. Up to these tilts every motor then stays in its range, at {} V; a steeper tilt lasts only until that speed is reached.",
            significant(first.battery_v, 3)
        ))
        .table(table)
}

/// Zeros whose step responses are drawn, as in figure A.1.
const DRAWN_ZEROS: [f64; 5] = [0.0, 0.1, 0.2, 0.5, 1.0];

/// Appendix A: table A.1, figures A.1 and A.2.
pub(crate) fn moved_zeros(
    config: &Config,
    view: View,
    study: &Study,
    report: &CheckReport,
) -> anyhow::Result<Section> {
    let columns = [
        Column::text("loop"),
        Column::number("zero", "rad/s"),
        Column::number("phase margin", "deg"),
        Column::number("crossover", "rad/s"),
    ];
    let mut table = Table::new("", columns);
    for row in &report.moved_zero {
        table.push([
            Cell::from(row.name),
            Cell::number(row.zero_rad_s, 4),
            Cell::number(row.phase_margin_deg.unwrap_or(f64::NAN), 6),
            Cell::number(row.crossover_rad_s.unwrap_or(f64::NAN), 5),
        ]);
    }
    let mut section = Section::new("The plant's zero moved (thesis appendix A)")
        .paragraph("The canceller stays as it is; in the first row of each loop the zero lies on the canceller's pole.")
        .table(table);
    let channel = axis_channel(&study.linear, LoopName::Roll)?;
    if report.moved_zero.iter().any(|row| row.name == LoopName::Roll.name()) {
        let mut steps = Figure::new("", Axis::new("time", "s"), Axis::new("response over step", "1"));
        let mut magnitude = Figure::new("", frequency(), Axis::new("magnitude", "dB"));
        let mut phase = Figure::new("", frequency(), Axis::new("phase", "deg"));
        for (k, zero_rad_s) in DRAWN_ZEROS.into_iter().enumerate() {
            let mut plant = with_moved_zero(&channel, zero_rad_s, study.linear.motor_lag_rad_s)?;
            plant.input_delay_s = study.linear.input_delay_s;
            let closed = ClosedLoop::new(config, &plant, LoopName::Roll, view)?;
            let name = format!("{zero_rad_s} rad/s");
            let bode = loop_bode(&closed);
            magnitude = magnitude.with(line(&bode, &name, Style::Category(k), |p| p.magnitude_db));
            phase = phase.with(line(&bode, "", Style::Category(k), |p| p.phase_deg));
            if closed.closed.is_stable()? {
                let response = drawn(commanded(config, &closed)?.points());
                steps = steps.with(Series::line(name, Style::Category(k), response));
            }
        }
        section =
            section.figure(steps, "Roll: step responses with the plant's zero moved (figure A.1).").figure(
                Panels::new([magnitude, phase]),
                "Roll: loop gain with the plant's zero moved (figure A.2).",
            );
    }
    Ok(section)
}

/// Margins over draws of the model.
pub(crate) fn spread(uncertainty: &Uncertainty) -> Section {
    let columns = [
        Column::text("loop"),
        Column::number("unstable", "draws"),
        Column::number("phase margin: worst", "deg"),
        Column::number("5 % below", "deg"),
        Column::number("gain margin: worst", ""),
        Column::number("5 % below", ""),
        Column::number("delay margin: worst", "ms"),
    ];
    let mut table = Table::new("", columns);
    for l in &uncertainty.loops {
        let of =
            |spread: Option<Spread>, pick: fn(Spread) -> f64| Cell::number(spread.map_or(f64::NAN, pick), 3);
        table.push([
            Cell::from(l.name),
            Cell::number(l.unstable as f64, 6),
            of(l.phase_margin_deg, |s| s.min),
            of(l.phase_margin_deg, |s| s.p05),
            of(l.gain_margin, |s| s.min),
            of(l.gain_margin, |s| s.p05),
            of(l.delay_margin_s, |s| 1000.0 * s.min),
        ]);
    }
    let unstable = match uncertainty.unstable {
        0 => "All loops are stable in every draw.".to_owned(),
        count => format!("At least one loop is unstable in {count} of them."),
    };
    Section::new("Over the model's uncertainty")
        .paragraph(format!(
            "{} random draws of {} coefficients from their standard errors, {}. {unstable}",
            uncertainty.samples,
            uncertainty.coefficients,
            if uncertainty.correlated { "with their correlations" } else { "taken as independent" }
        ))
        .table(table)
}

pub(crate) fn margins(report: &CheckReport) -> Table {
    let columns = [
        Column::text("loop"),
        Column::text("closed"),
        Column::number("phase margin", "deg"),
        Column::number("crossover", "rad/s"),
        Column::number("gain margin", ""),
        Column::number("delay margin", "ms"),
        Column::number("sensitivity peak", ""),
        Column::number("overshoot", "%"),
        Column::number("rise", "s"),
    ];
    let mut table = Table::new("", columns);
    let number = |value: Option<f64>| Cell::number(value.unwrap_or(f64::NAN), 4);
    for l in &report.loops {
        let step = report.steps.iter().find(|s| s.name == l.name);
        let (verdict, word) = if l.stable { (Verdict::Good, "stable") } else { (Verdict::Bad, "unstable") };
        table.push([
            Cell::from(l.name),
            Cell::from(word).verdict(verdict),
            number(l.phase_margin_deg),
            number(l.crossover_rad_s),
            number(l.gain_margin),
            number(l.delay_margin_s.map(|s| 1000.0 * s)),
            number(Some(l.sensitivity_peak)),
            number(step.map(|s| s.commanded.overshoot_percent)),
            number(step.and_then(|s| s.commanded.rise_s)),
        ]);
    }
    table
}

/// Margins with the loop cut at the actuator.
fn actuator_margins(report: &CheckReport) -> Table {
    let columns = [
        Column::text("loop"),
        Column::number("phase margin", "deg"),
        Column::number("crossover", "rad/s"),
        Column::number("gain margin", ""),
        Column::number("phase crossover", "rad/s"),
        Column::number("gain may fall to", ""),
        Column::number("sensitivity peak", ""),
    ];
    let mut table = Table::new("Cut at the actuator, with all of the feedback in the loop gain", columns);
    let number = |value: Option<f64>| Cell::number(value.unwrap_or(f64::NAN), 4);
    for l in &report.loops {
        let margins = &l.at_actuator;
        table.push([
            Cell::from(l.name),
            number(margins.phase_margin_deg),
            number(margins.crossover_rad_s),
            number(margins.gain_margin),
            number(margins.phase_crossover_rad_s),
            number(margins.gain_reduction_margin),
            number(Some(margins.sensitivity_peak)),
        ]);
    }
    table
}

/// Margins for a caption.
pub(crate) fn margin_words(margins: &Margins) -> String {
    let at = |value: Option<f64>, unit: &str, frequency: Option<f64>| match value.zip(frequency) {
        Some((value, frequency)) => {
            format!("{}{unit} at {} rad/s", significant(value, 3), significant(frequency, 3))
        }
        None => "unlimited".into(),
    };
    format!(
        "phase margin {}, gain margin {}",
        at(margins.phase_margin_deg, " deg", margins.crossover_rad_s),
        at(margins.gain_margin, "", margins.phase_crossover_rad_s)
    )
}

fn section(config: &Config, view: View, plant: &LoopPlant, closed: &ClosedLoop) -> anyhow::Result<Section> {
    let (bode, margins) = (loop_bode(closed), LoopMargins::of(closed)?);
    let mut section = Section::new(closed.name.name())
        .figure(
            bode_panels(&bode, &margins.at_error),
            format!(
                "Loop gain, cut at the error with the velocity feedback closed: {}.",
                margin_words(&margins.at_error)
            ),
        )
        .figure(
            bode_panels(&actuator_bode(closed), &margins.at_actuator),
            format!(
                "Loop gain, cut at the actuator, with all of the feedback in it: {}.",
                margin_words(&margins.at_actuator)
            ),
        )
        .figure(
            nichols(&bode),
            "Nichols plot of the loop gain at the error; the curve must keep away from the cross.",
        );
    for gain in GAINS {
        let symbol = gain.symbol();
        section = section.figure(
            locus(config, view, plant, closed, gain)?,
            format!(
                "Root locus of {symbol}, from 0 to {LOCUS_END} times its value; crosses: {symbol} as it is."
            ),
        );
    }
    if closed.closed.is_stable()? {
        let [bare, filtered] = closed_bode(closed)?;
        section = section
            .figure(
                two_bodes(&bare, &filtered),
                "Closed loop: from the reference, and through the prefilter.",
            )
            .figure(
                steps(config, closed)?,
                "Step response with and without prefilter (x, y: 1 m with and without rate limit).",
            )
            .figure(disturbance(closed)?, "Response to a step disturbance at the actuator.");
    }
    Ok(section)
}

fn frequency() -> Axis {
    Axis::logarithmic("frequency", "rad/s")
}

fn line(
    points: &[FrequencyPoint],
    name: &str,
    style: Style,
    value: impl Fn(&FrequencyPoint) -> f64,
) -> Series {
    let data: Vec<_> = points.iter().map(|p| (p.frequency_rad_s, value(p))).collect();
    Series::line(name, style, data)
}

/// Least magnitude that is drawn, dB: far below it nothing is judged, and margins would be too
/// small to see.
const LEAST_DB: f64 = -40.0;

/// Magnitude and phase of a loop gain, with its margins as bars at their crossover frequencies.
pub(crate) fn bode_panels(points: &[FrequencyPoint], margins: &Margins) -> Panels {
    let seen: Vec<_> = points.iter().copied().filter(|p| p.magnitude_db > LEAST_DB).collect();
    let mut magnitude = Figure::new("", frequency(), Axis::new("magnitude", "dB"))
        .with(line(&seen, "loop gain", Style::PredictedAfter, |p| p.magnitude_db))
        .mark(Mark::limit("gain 1", 0.0));
    let mut phase = Figure::new("", frequency(), Axis::new("phase", "deg")).with(line(
        &seen,
        "",
        Style::PredictedAfter,
        |p| p.phase_deg,
    ));
    if let (Some(margin), Some(at)) = (margins.gain_margin, margins.phase_crossover_rad_s) {
        let margin_db = 20.0 * margin.log10();
        let name = format!(
            "gain margin {} ({} dB) at {} rad/s",
            significant(margin, 3),
            significant(margin_db, 3),
            significant(at, 3)
        );
        magnitude = magnitude.with(Series::line(name, MARGIN, [(at, 0.0), (at, -margin_db)]));
        (magnitude, phase) = (magnitude.mark(Mark::event("", at)), phase.mark(Mark::event("", at)));
    }
    let crossing = margins.gain_crossings.iter().find(|c| Some(c.frequency_rad_s) == margins.crossover_rad_s);
    // The odd multiple of 180 degrees that the margin is measured from.
    let mut from_deg = -180.0;
    if let (Some(crossing), Some(margin)) = (crossing, margins.phase_margin_deg) {
        let at = crossing.frequency_rad_s;
        let name = format!("phase margin {} deg at {} rad/s", significant(margin, 3), significant(at, 3));
        let top = phase_at(points, at);
        from_deg = (top - crossing.phase_margin_deg).round();
        phase = phase.with(Series::line(name, MARGIN, [(at, top), (at, from_deg)]));
        (magnitude, phase) = (magnitude.mark(Mark::event("", at)), phase.mark(Mark::event("", at)));
    }
    Panels::new([magnitude, phase.mark(Mark::limit(format!("{from_deg} deg"), from_deg))])
}

/// Bars of margins: wide and solid.
const MARGIN: Style = Style::Category(4);

/// The unwrapped phase at a frequency between two points, degrees.
fn phase_at(points: &[FrequencyPoint], frequency_rad_s: f64) -> f64 {
    let after = points.partition_point(|p| p.frequency_rad_s < frequency_rad_s).clamp(1, points.len() - 1);
    let (a, b) = (&points[after - 1], &points[after]);
    let share = (frequency_rad_s / a.frequency_rad_s).ln() / (b.frequency_rad_s / a.frequency_rad_s).ln();
    a.phase_deg + share * (b.phase_deg - a.phase_deg)
}

pub(crate) fn two_bodes(bare: &[FrequencyPoint], filtered: &[FrequencyPoint]) -> Panels {
    let panel = |label, unit, value: fn(&FrequencyPoint) -> f64| {
        Figure::new("", frequency(), Axis::new(label, unit))
            .with(line(bare, "from the reference", Style::PredictedBefore, value))
            .with(line(filtered, "through the prefilter", Style::PredictedAfter, value))
    };
    Panels::new([panel("magnitude", "dB", |p| p.magnitude_db), panel("phase", "deg", |p| p.phase_deg)])
}

/// The part of a Nichols plot around the critical point.
pub(crate) fn nichols(points: &[FrequencyPoint]) -> Figure {
    let data: Vec<_> = points
        .iter()
        .filter(|p| p.magnitude_db.abs() < 40.0)
        .map(|p| (p.phase_deg, p.magnitude_db))
        .collect();
    Figure::new("", Axis::new("phase", "deg"), Axis::new("magnitude", "dB"))
        .with(Series::line("loop gain", Style::PredictedAfter, data))
        .with(Series::points("-1", Style::Category(5), [(-180.0, 0.0)]))
}

pub(crate) fn locus(
    config: &Config,
    view: View,
    plant: &LoopPlant,
    closed: &ClosedLoop,
    gain: Gain,
) -> anyhow::Result<Figure> {
    let own = gain_of(config, closed.name, gain);
    let end = if own > 0.0 { LOCUS_END * own } else { 1.0 };
    let values: Vec<f64> = (0..=LOCUS_POINTS).map(|k| end * k as f64 / LOCUS_POINTS as f64).collect();
    let all = root_locus(config, plant, closed.name, view, gain, &values)?;
    let here = root_locus(config, plant, closed.name, view, gain, &[own])?;
    // The fast poles of filters and rotors would shrink the picture to a dot.
    let sampled = closed.closed.period_s.is_some();
    let near = |p: &&Complex<f64>| if sampled { p.re > 0.5 } else { p.norm() < 25.0 };
    let flat = |poles: &[Vec<Complex<f64>>]| {
        poles.iter().flatten().filter(near).map(|p| (p.re, p.im)).collect::<Vec<_>>()
    };
    let (label, unit) = if sampled { ("real part of z", "1") } else { ("real part of s", "rad/s") };
    let figure = Figure::new("", Axis::new(label, unit), Axis::new("imaginary part", unit))
        .equal_scale()
        .with(Series::points("0 to 3 times the gain", Style::Muted, flat(&all)))
        .with(Series::points("gain 0", Style::Category(0), flat(&all[..1])))
        .with(Series::points("the gain chosen", Style::Category(5), flat(&here)));
    Ok(if sampled {
        // As much of it as the poles reach.
        let reach = all.iter().flatten().filter(near).map(|p| p.im.abs()).fold(0.02, f64::max);
        let end = (1.2 * reach).min(0.87).asin();
        let circle: Vec<_> =
            (-30..=30).map(|k| f64::from(k) / 30.0 * end).map(|angle| (angle.cos(), angle.sin())).collect();
        figure.with(Series::line("unit circle", Style::Limit, circle))
    } else {
        figure.mark(Mark::event("stability", 0.0))
    })
}

pub(crate) fn drawn(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.into_iter().filter(|(t, _)| *t <= DRAWN_S).collect()
}

pub(crate) fn steps(config: &Config, closed: &ClosedLoop) -> anyhow::Result<Figure> {
    let time = Axis::new("time", "s");
    Ok(Figure::new("", time, Axis::new("response over step", "1"))
        .with(Series::line(
            "without prefilter or rate limit",
            Style::PredictedBefore,
            drawn(bare_step(closed, LONG_S)?.points()),
        ))
        .with(Series::line("commanded", Style::PredictedAfter, drawn(commanded(config, closed)?.points())))
        .mark(Mark::limit("", 1.0)))
}

pub(crate) fn disturbance(closed: &ClosedLoop) -> anyhow::Result<Figure> {
    let unit = if closed.name.unit() == "m" { "m" } else { "rad" };
    Ok(Figure::new("", Axis::new("time", "s"), Axis::new("response to a unit disturbance", unit))
        .with(Series::line("as it is", Style::PredictedAfter, disturbance_step(closed, LONG_S)?.points())))
}

pub(crate) fn battery(report: &CheckReport) -> Section {
    let section = Section::new("Over battery voltage");
    if report.battery.is_empty() {
        return section.paragraph("The model does not hold the battery voltage that it was made at.");
    }
    let mut columns = vec![Column::number("battery", "V"), Column::number("thrust over weight", "")];
    columns.extend(report.loops.iter().map(|l| Column::number(format!("{}: phase margin", l.name), "deg")));
    let mut table = Table::new("", columns);
    for at in &report.battery {
        let margins = at.loops.iter().map(|l| {
            let margin = if l.stable { l.phase_margin_deg.unwrap_or(f64::NAN) } else { f64::NAN };
            Cell::number(margin, 3)
        });
        let first = [Cell::number(at.battery_v, 3), Cell::number(at.thrust_to_weight, 3)];
        table.push(first.into_iter().chain(margins));
    }
    section.table(table)
}
