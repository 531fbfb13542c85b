//! `quadlab design check`: gains on a model, loop by loop.

use std::fmt::Write as _;
use std::path::PathBuf;

use design::check::{CheckOptions, CheckReport, Spread, check};
use design::loops::View;
use model::Model;
use report::significant;

use crate::cli::output::{Outcome, check_outputs, provenance};
use crate::render::design_pages;

/// Oldest pose that makes sense: a second at 100 Hz.
const MOST_DELAY: usize = 100;

/// Check gains on a model: margins, poles, responses, worst cases. Exit status 1 if a loop is unstable.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  quadlab design check --model model.toml --gains gains.toml --delay 2\n  quadlab design check --model model.toml --gains gains.toml --continuous --html check.html"
)]
pub(crate) struct Options {
    /// Model file, for example: --model model.toml
    #[arg(long, value_name = "TOML")]
    model: PathBuf,

    /// Gains file, for example: --gains gains.toml
    #[arg(long, value_name = "TOML")]
    gains: PathBuf,

    /// Age of the pose that the law gets, samples (thesis 5.5: about 2)
    #[arg(long, value_name = "SAMPLES", default_value_t = 2, conflicts_with = "continuous")]
    delay: usize,

    /// As the thesis designs: continuous, without sampling and delay
    #[arg(long)]
    continuous: bool,

    /// Draws of the model's coefficients from their standard errors
    #[arg(long, value_name = "COUNT", default_value_t = 100)]
    samples: usize,

    /// Seed of the draws
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Page with figures to write, for example: --html check.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

/// More than any craft could be flown with.
#[derive(Debug, thiserror::Error)]
#[error("--{option} {value}: give a number from 0 to {most}")]
struct TooMany {
    option: &'static str,
    value: usize,
    most: usize,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let refuse =
        |option, value, most| if value > most { Err(TooMany { option, value, most }) } else { Ok(()) };
    refuse("delay", options.delay, MOST_DELAY)?;
    refuse("samples", options.samples, 100_000)?;
    check_outputs(&options.html, &[&options.model, &options.gains])?;
    let model = Model::read(&options.model)?;
    let gains = design::gains_match::read_for(&options.gains, &model)?;
    let view = match options.continuous {
        true => View::Continuous,
        false => View::Sampled { delay_samples: options.delay },
    };
    let settings = CheckOptions { view, samples: options.samples, seed: options.seed };
    let report = check(&model, &gains.config, &settings)?;
    if let Some(path) = &options.html {
        design_pages::check(&model, &gains.config, view, &report)?
            .provenance(provenance(&[&options.model, &options.gains], []))
            .write(path)?;
    }
    let outcome = if options.json { Outcome::json(&report)? } else { Outcome::done(text(options, &report)) };
    Ok(Outcome { holds: report.holds, ..outcome })
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "-".into(), |x| short(x, digits))
}

/// Less than a thousandth of anything in these tables (degrees, seconds, per cent) is nothing.
pub(crate) fn short(value: f64, digits: usize) -> String {
    if value.abs() < 1e-3 { "0".into() } else { significant(value, digits) }
}

/// Rows of equal columns.
fn columns(text: &mut String, rows: &[Vec<String>]) {
    let count = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |k: usize| rows.iter().filter_map(|r| r.get(k)).map(|c| c.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..count).map(width).collect();
    for row in rows {
        let mut line = String::new();
        for (k, cell) in row.iter().enumerate() {
            let width = widths[k];
            line.push_str(&if k == 0 { format!("{cell:<width$}") } else { format!("  {cell:>width$}") });
        }
        let _ = writeln!(text, "{}", line.trim_end());
    }
}

fn cells<const N: usize>(cells: [&str; N]) -> Vec<String> {
    cells.map(str::to_owned).to_vec()
}

fn text(options: &Options, report: &CheckReport) -> String {
    let mut text = String::new();
    let view = match report.delay_samples {
        Some(delay) => format!("sampled, pose {delay} samples late"),
        None => "continuous, no delay".into(),
    };
    let _ = writeln!(text, "{}: {view}\n", report.vehicle);
    let mut rows = vec![cells([
        "loop",
        "",
        "phase deg",
        "at rad/s",
        "gain",
        "gain down",
        "delay ms",
        "peak S",
        "damping",
        "at rad/s",
        "actuator: phase deg",
        "gain",
    ])];
    for l in &report.loops {
        rows.push(vec![
            l.name.into(),
            if l.stable { "stable" } else { "UNSTABLE" }.into(),
            number(l.phase_margin_deg, 4),
            number(l.crossover_rad_s, 4),
            number(l.gain_margin, 4),
            number(l.gain_reduction_margin, 3),
            number(l.delay_margin_s.map(|s| 1000.0 * s), 3),
            significant(l.sensitivity_peak, 3),
            number(l.least_damped.map(|m| m.damping), 3),
            number(l.least_damped.map(|m| m.frequency_rad_s), 4),
            number(l.at_actuator.phase_margin_deg, 3),
            number(l.at_actuator.gain_margin, 3),
        ]);
    }
    columns(&mut text, &rows);
    let together = &report.together;
    let _ = writeln!(
        text,
        "\nAll loops together: {}, slowest mode {} at {} 1/s{}",
        if together.stable { "stable" } else { "UNSTABLE" },
        if together.slowest_1_s < 0.0 { "grows" } else { "decays" },
        significant(together.slowest_1_s.abs(), 3),
        together.least_damped.map_or_else(String::new, |m| format!(
            ", least damping {} at {} rad/s",
            significant(m.damping, 3),
            significant(m.frequency_rad_s, 3)
        ))
    );
    steps(&mut text, report);
    disturbances(&mut text, report);
    moved_zeros(&mut text, report);
    uncertainty(&mut text, report);
    battery(&mut text, report);
    steady_tilts(&mut text, report);
    for note in &report.notes {
        let _ = writeln!(text, "\nnote: {note}");
    }
    if let Some(path) = &options.html {
        let _ = writeln!(text, "\npage: {}", path.display());
    }
    text
}

fn steps(text: &mut String, report: &CheckReport) {
    if report.steps.is_empty() {
        return;
    }
    text.push_str(
        "\nStep of the command (prefilter; x and y: 1 m through the rate limit), and of the bare loop\n",
    );
    let mut rows =
        vec![cells(["loop", "over %", "rise s", "5 % s", "2 % s", "dip to", "bare: over %", "rise s"])];
    for s in &report.steps {
        rows.push(vec![
            s.name.into(),
            short(s.commanded.overshoot_percent, 3),
            number(s.commanded.rise_s, 3),
            number(s.commanded.settling_5_s, 3),
            number(s.commanded.settling_2_s, 3),
            number(s.commanded.lowest_after_peak, 3),
            short(s.without_prefilter.overshoot_percent, 3),
            number(s.without_prefilter.rise_s, 3),
        ]);
    }
    columns(text, &rows);
}

fn disturbances(text: &mut String, report: &CheckReport) {
    if report.disturbances.is_empty() {
        return;
    }
    text.push_str("\nStep disturbance at the actuator (appendix B)\n");
    let mut rows = vec![cells(["loop", "peak", "at s", "after 60 s", "without integral", "unit"])];
    for d in &report.disturbances {
        rows.push(vec![
            d.name.into(),
            significant(d.peak, 3),
            significant(d.peak_s, 3),
            short(d.last, 2),
            short(d.last_without_integral, 3),
            d.unit.into(),
        ]);
    }
    columns(text, &rows);
}

fn moved_zeros(text: &mut String, report: &CheckReport) {
    if report.moved_zero.is_empty() {
        return;
    }
    text.push_str("\nThe plant's zero moved under the same canceller (appendix A)\n");
    let mut rows = vec![cells(["loop", "zero rad/s", "phase margin deg", "crossover rad/s"])];
    for row in &report.moved_zero {
        rows.push(vec![
            row.name.into(),
            format!("{:.4}", row.zero_rad_s),
            number(row.phase_margin_deg, 6),
            number(row.crossover_rad_s, 5),
        ]);
    }
    columns(text, &rows);
}

fn uncertainty(text: &mut String, report: &CheckReport) {
    let Some(u) = &report.uncertainty else { return };
    let _ = writeln!(
        text,
        "\nOver {} draws of {} coefficients from their standard errors, {} (seed {}; {} could not be analysed): worst, 5 %, median, 95 %",
        u.samples,
        u.coefficients,
        if u.correlated { "with their correlations" } else { "taken as independent" },
        u.seed,
        u.failed
    );
    let spread = |s: Option<Spread>, factor: f64| {
        s.map_or_else(
            || "-".into(),
            |s| [s.min, s.p05, s.median, s.p95].map(|x| significant(factor * x, 3)).join(" "),
        )
    };
    let mut rows = vec![cells(["loop", "unstable", "phase margin deg", "gain margin", "delay margin ms"])];
    for l in &u.loops {
        rows.push(vec![
            l.name.into(),
            l.unstable.to_string(),
            spread(l.phase_margin_deg, 1.0),
            spread(l.gain_margin, 1.0),
            spread(l.delay_margin_s, 1000.0),
        ]);
    }
    columns(text, &rows);
}

fn steady_tilts(text: &mut String, report: &CheckReport) {
    let Some(first) = report.steady_tilts.first() else { return };
    let _ = writeln!(
        text,
        "\nTilt that can be held for ever: drag holds the slide, every motor inside its range at {} V",
        significant(first.battery_v, 3)
    );
    let mut rows = vec![cells(["towards", "tilt deg", "speed m/s", "at its end"])];
    for tilt in &report.steady_tilts {
        rows.push(vec![
            tilt.direction.name().into(),
            significant(tilt.tilt_deg, 3),
            significant(tilt.speed_m_s, 3),
            tilt.motor.map_or_else(|| "none".into(), |motor| format!("motor {motor}")),
        ]);
    }
    columns(text, &rows);
}

fn battery(text: &mut String, report: &CheckReport) {
    if report.battery.is_empty() {
        return;
    }
    text.push_str("\nOver battery voltage: phase margin deg / gain margin\n");
    let mut head = cells(["V", "thrust/weight"]);
    head.extend(report.loops.iter().map(|l| l.name.to_owned()));
    let mut rows = vec![head];
    for at in &report.battery {
        let mut row = vec![significant(at.battery_v, 3), significant(at.thrust_to_weight, 3)];
        row.extend(at.loops.iter().map(|l| match l.stable {
            true => format!("{} / {}", number(l.phase_margin_deg, 3), number(l.gain_margin, 3)),
            false => "UNSTABLE".into(),
        }));
        rows.push(row);
    }
    columns(text, &rows);
}
