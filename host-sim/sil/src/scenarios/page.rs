//! The page of a run: the figures 5.25 to 5.30 of the thesis, as flown here.

use report::{
    Axis, Cell, Column, Figure, Page, Panels, Provenance, Section, Series, Style, Table, Verdict, significant,
};

use super::reference::{Variant, response};
use super::scenario::{RequirementCheck, Settings, step_of};
use super::suite::{ScenarioResult, Suite};
use crate::flight::{FlightPlan, Recording, Row, Script, StepAxis};

const MOTORS: [&str; 4] = ["1 front-left", "2 front-right", "3 rear-right", "4 rear-left"];

/// The page of a suite flown with `settings`.
pub fn page(suite: &Suite, settings: &Settings, provenance: Provenance) -> Page {
    let passed = suite.outcomes.iter().filter(|outcome| outcome.pass()).count();
    let lead = format!(
        "{passed} of {} flights did what they had to. The pose reaches the controller {} samples late; sensors are {}.",
        suite.outcomes.len(),
        settings.delay_samples,
        if settings.noise.is_some() { "noisy" } else { "ideal" },
    );
    let overview = Section::new("Outcome")
        .table(outcome_table(suite))
        .preformatted(format!("SHA-256 of all motor commands: {}", suite.pwm_sha256));
    let page = Page::new("Software in the loop", lead).section(overview);
    suite
        .outcomes
        .iter()
        .fold(page, |page, outcome| page.section(section(outcome, settings)))
        .provenance(provenance)
}

fn outcome_table(suite: &Suite) -> Table {
    let columns = [
        Column::text("flight"),
        Column::text("verdict"),
        Column::number("overshoot", "%"),
        Column::number("rise", "s"),
        Column::number("settling 5 %", "s"),
        Column::number("settling 2 %", "s"),
        Column::number("error at the end", "of the step"),
        Column::number("saturated", "ticks"),
    ];
    let mut table = Table::new("", columns);
    for outcome in &suite.outcomes {
        let metrics = outcome.metrics.as_ref();
        let number = |value: Option<f64>| Cell::number(value.unwrap_or(f64::NAN), 3);
        let verdict = if outcome.pass() { Verdict::Good } else { Verdict::Bad };
        table.push([
            Cell::from(outcome.scenario.name()),
            Cell::from(if outcome.pass() { "holds" } else { "fails" }).verdict(verdict),
            number(metrics.map(|m| m.overshoot_percent)),
            number(metrics.and_then(|m| m.rise_s)),
            number(metrics.and_then(|m| m.settling_5_s)),
            number(metrics.and_then(|m| m.settling_2_s)),
            number(metrics.map(|m| m.steady_state_error)),
            Cell::number(outcome.saturated_ticks as f64, 6),
        ]);
    }
    table
}

/// All requirements of a flight with what was found, on one line.
pub fn requirements(outcome: &ScenarioResult) -> String {
    let mut parts: Vec<String> = outcome
        .checks
        .iter()
        .map(|check| {
            let RequirementCheck { requirement, found, .. } = check;
            format!("{requirement} ({found})")
        })
        .collect();
    if outcome.lost_control {
        parts.push("control kept (lost)".into());
    }
    parts.join("; ")
}

fn section(outcome: &ScenarioResult, settings: &Settings) -> Section {
    let scenario = outcome.scenario;
    let heading = match scenario.thesis_figure() {
        Some(figure) => format!("{scenario} (thesis figure {figure})"),
        None => scenario.to_string(),
    };
    let section = Section::new(heading).paragraph(requirements(outcome));
    let section = match step_of(&outcome.plan) {
        Some((step, _)) => {
            let points = reference_points(outcome, settings, step.axis);
            let caption = match points {
                Some(_) => "Command and response; points: the reference response.",
                None => "Command and response.",
            };
            section.figure(response_panels(outcome, step.axis, points), caption)
        }
        None => section.figure(motion_panels(&outcome.recording), "Height and attitude."),
    };
    with_track_and_motors(section, &outcome.plan, &outcome.recording)
}

/// Height and attitude, the track, and the motors of a flight without a name.
pub fn flight(heading: impl Into<String>, plan: &FlightPlan, recording: &Recording) -> Section {
    let section = Section::new(heading).figure(motion_panels(recording), "Height and attitude.");
    with_track_and_motors(section, plan, recording)
}

fn with_track_and_motors(section: Section, plan: &FlightPlan, recording: &Recording) -> Section {
    let section = match plan.script {
        Script::Waypoints { .. } | Script::Pattern(_) => {
            section.figure(track(recording), "The track from above.")
        }
        Script::Hold | Script::Step(_) => section,
    };
    section.figure(
        motor_panels(plan, recording),
        "Motor commands; thrust and angular accelerations that the law asks for.",
    )
}

fn time() -> Axis {
    Axis::new("time", "s")
}

/// A series over time.
fn over_time(recording: &Recording, value: impl Fn(usize, &Row) -> f64) -> Vec<(f64, f64)> {
    recording.rows.iter().enumerate().map(|(k, row)| (recording.time_s(k), value(k, row))).collect()
}

/// Name, unit and factor from SI to that unit.
fn quantity(axis: StepAxis) -> (&'static str, &'static str, f64) {
    let degrees = 1_f64.to_degrees();
    match axis {
        StepAxis::Roll => ("roll", "deg", degrees),
        StepAxis::Pitch => ("pitch", "deg", degrees),
        StepAxis::Yaw => ("yaw", "deg", degrees),
        StepAxis::X => ("x", "m", 1.0),
        StepAxis::Y => ("y", "m", 1.0),
        StepAxis::Z => ("z (down)", "m", 1.0),
    }
}

/// What the loop of `axis` was asked for in a row, SI.
fn commanded(axis: StepAxis, row: &Row) -> f64 {
    let [roll, pitch, yaw] = row.output.attitude_command_rad;
    f64::from(match axis {
        StepAxis::Roll => roll,
        StepAxis::Pitch => pitch,
        StepAxis::Yaw => yaw,
        StepAxis::Z => row.output.z_command_m,
        StepAxis::X => row.position_command_m[0],
        StepAxis::Y => row.position_command_m[1],
    })
}

/// Command and response of one loop.
fn loop_figure(recording: &Recording, axis: StepAxis) -> Figure {
    let (name, unit, factor) = quantity(axis);
    let series = recording.series(axis);
    Figure::new("", time(), Axis::new(name, unit))
        .with(Series::line(
            "command",
            Style::Reference,
            over_time(recording, |_, row| factor * commanded(axis, row)),
        ))
        .with(Series::line(
            "response",
            Style::PredictedAfter,
            over_time(recording, |k, _| factor * series[k]),
        ))
}

/// The reference response in the units of the plot, where the flight was one of the reference's.
fn reference_points(
    outcome: &ScenarioResult,
    settings: &Settings,
    axis: StepAxis,
) -> Option<Vec<(f64, f64)>> {
    let another = settings.config.is_some() || settings.model.is_some();
    if another || settings.noise.is_some() || settings.delay_samples != 2 {
        return None;
    }
    let (step, base) = step_of(&outcome.plan)?;
    let reference = response(Variant::A, outcome.scenario.name())?;
    let (_, _, factor) = quantity(axis);
    let point = |&(after_s, value): &(f64, f64)| (step.at_s + after_s, factor * (base + step.size * value));
    Some(reference.samples.iter().map(point).collect())
}

fn response_panels(outcome: &ScenarioResult, axis: StepAxis, points: Option<Vec<(f64, f64)>>) -> Panels {
    let recording = &outcome.recording;
    let mut first = loop_figure(recording, axis);
    if let Some(points) = points {
        first = first.with(Series::points("reference", Style::Category(5), points));
    }
    let mut figures = vec![first];
    match axis {
        StepAxis::X => figures.push(loop_figure(recording, StepAxis::Pitch)),
        StepAxis::Y => figures.push(loop_figure(recording, StepAxis::Roll)),
        _ => {}
    }
    Panels::new(figures)
}

fn motor_panels(plan: &FlightPlan, recording: &Recording) -> Panels {
    let unit = plan.model.vehicle.motors.command_unit.as_str();
    let mut motors = Figure::new("", time(), Axis::new("motor command", unit));
    for (k, name) in MOTORS.into_iter().enumerate() {
        let data = over_time(recording, |_, row| f64::from(row.output.pwm[k]));
        motors = motors.with(Series::line(name, Style::Category(k), data));
    }
    let thrust = Figure::new("", time(), Axis::new("thrust", "N")).with(Series::line(
        "commanded",
        Style::Category(0),
        over_time(recording, |_, row| f64::from(row.output.thrust)),
    ));
    let mut torque = Figure::new("", time(), Axis::new("angular acceleration", "rad/s^2"));
    for (k, name) in ["roll", "pitch", "yaw"].into_iter().enumerate() {
        let data = over_time(recording, |_, row| f64::from(row.output.torque[k]));
        torque = torque.with(Series::line(name, Style::Category(k), data));
    }
    Panels::new([motors, thrust, torque])
}

fn track(recording: &Recording) -> Figure {
    let line = |pick: fn(&Row) -> (f64, f64)| recording.rows.iter().map(pick).collect::<Vec<_>>();
    Figure::new("", Axis::new("x (north)", "m"), Axis::new("y (east)", "m"))
        .with(Series::line(
            "command",
            Style::Reference,
            line(|row| (f64::from(row.position_command_m[0]), f64::from(row.position_command_m[1]))),
        ))
        .with(Series::line(
            "flown",
            Style::PredictedAfter,
            line(|row| (f64::from(row.truth.position_m[0]), f64::from(row.truth.position_m[1]))),
        ))
        .equal_scale()
}

fn motion_panels(recording: &Recording) -> Panels {
    let height = Figure::new("", time(), Axis::new("height", "m"))
        .with(Series::line(
            "command",
            Style::Reference,
            over_time(recording, |_, row| -f64::from(row.output.z_command_m)),
        ))
        .with(Series::line(
            "flown",
            Style::PredictedAfter,
            over_time(recording, |_, row| -f64::from(row.truth.position_m[2])),
        ));
    let angles = [StepAxis::Roll, StepAxis::Pitch, StepAxis::Yaw];
    let attitude = angles.into_iter().map(|axis| loop_figure(recording, axis));
    Panels::new([height].into_iter().chain(attitude).collect::<Vec<_>>())
}

/// The table of a suite for a terminal.
pub fn text_table(suite: &Suite) -> String {
    let header =
        ["flight", "over %", "rise s", "5 % s", "2 % s", "error", "saturated", "", "requirement (found)"];
    let mut rows = vec![header.map(str::to_owned)];
    for outcome in &suite.outcomes {
        let metrics = outcome.metrics.as_ref();
        let number = |value: Option<f64>| value.map_or("-".into(), |v| significant(v, 3));
        rows.push([
            outcome.scenario.to_string(),
            number(metrics.map(|m| m.overshoot_percent)),
            number(metrics.and_then(|m| m.rise_s)),
            number(metrics.and_then(|m| m.settling_5_s)),
            number(metrics.and_then(|m| m.settling_2_s)),
            number(metrics.map(|m| m.steady_state_error)),
            outcome.saturated_ticks.to_string(),
            if outcome.pass() { "pass".into() } else { "FAIL".into() },
            requirements(outcome),
        ]);
    }
    let width = |k: usize| rows.iter().map(|row| row[k].chars().count()).max().unwrap_or(0);
    let widths: [usize; 9] = std::array::from_fn(width);
    let line = |row: &[String; 9]| {
        let [name, numbers @ .., verdict, requirement] = row;
        let mut line = format!("{name:<0$}", widths[0]);
        for (number, width) in numbers.iter().zip(&widths[1..]) {
            line.push_str(&format!("  {number:>width$}"));
        }
        format!("{line}  {verdict:<4}  {requirement}\n")
    };
    rows.iter().map(line).collect()
}
