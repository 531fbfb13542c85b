//! `quadlab design check` as text: tables of numbers, and what does not hold.

use std::fmt::Write as _;

use design::check::{CheckReport, Spread};
use report::significant;

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

/// The report as text.
pub(crate) fn text(report: &CheckReport) -> String {
    let mut text = String::new();
    let view = match report.delay_samples {
        Some(delay) => format!("sampled, with a pose that is {delay} samples old"),
        None => "continuous, without delay".into(),
    };
    let _ = writeln!(text, "{}: {view}\n", report.vehicle);
    margins(&mut text, report);
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
    text.push('\n');
    for failure in failures(report) {
        let _ = writeln!(text, "NOT SAFE TO FLY: {failure}");
    }
    if report.holds {
        text.push_str("Stable in everything that was checked.\n");
    }
    text
}

/// Margins at both cuts, then what is judged beside them.
fn margins(text: &mut String, report: &CheckReport) {
    text.push_str(
        "Margins: of the loop opened at its error signal, and of the loop opened at the actuator with all of its feedback\n",
    );
    let mut rows = vec![cells([
        "loop",
        "",
        "phase deg",
        "at rad/s",
        "gain",
        "at rad/s",
        "actuator: phase deg",
        "at rad/s",
        "gain",
        "at rad/s",
    ])];
    for l in &report.loops {
        rows.push(vec![
            l.name.into(),
            if l.stable { "stable" } else { "UNSTABLE" }.into(),
            number(l.phase_margin_deg, 4),
            number(l.crossover_rad_s, 4),
            number(l.gain_margin, 4),
            number(l.phase_crossover_rad_s, 4),
            number(l.at_actuator.phase_margin_deg, 3),
            number(l.at_actuator.crossover_rad_s, 4),
            number(l.at_actuator.gain_margin, 3),
            number(l.at_actuator.phase_crossover_rad_s, 4),
        ]);
    }
    columns(text, &rows);
    text.push('\n');
    let mut rows = vec![cells([
        "loop",
        "delay margin ms",
        "gain may fall to",
        "actuator",
        "peak sensitivity",
        "actuator",
        "damping",
        "at rad/s",
    ])];
    for l in &report.loops {
        rows.push(vec![
            l.name.into(),
            number(l.delay_margin_s.map(|s| 1000.0 * s), 3),
            number(l.gain_reduction_margin, 3),
            number(l.at_actuator.gain_reduction_margin, 3),
            significant(l.sensitivity_peak, 3),
            significant(l.at_actuator.sensitivity_peak, 3),
            number(l.least_damped.map(|m| m.damping), 3),
            number(l.least_damped.map(|m| m.frequency_rad_s), 4),
        ]);
    }
    columns(text, &rows);
}

/// One sentence for each way in which the gains do not hold.
pub(crate) fn failures(report: &CheckReport) -> Vec<String> {
    let mut failures = Vec::new();
    let names = |names: Vec<&str>| names.join(", ");
    let unstable: Vec<&str> = report.loops.iter().filter(|l| !l.stable).map(|l| l.name).collect();
    if !unstable.is_empty() {
        failures.push(format!("unstable: {}", names(unstable)));
    }
    if !report.together.stable {
        failures.push("unstable: all loops together".into());
    }
    for at in &report.battery {
        let unstable: Vec<&str> = at.loops.iter().filter(|l| !l.stable).map(|l| l.name).collect();
        if !unstable.is_empty() {
            failures.push(format!("unstable at {} V: {}", significant(at.battery_v, 3), names(unstable)));
        }
    }
    if let Some(u) = &report.uncertainty {
        if u.unstable > 0 {
            let counts = u.loops.iter().filter(|l| l.unstable > 0);
            let counts: Vec<String> = counts.map(|l| format!("{} in {}", l.name, l.unstable)).collect();
            failures.push(format!(
                "unstable in {} of {} random draws of the model: {}",
                u.unstable,
                u.samples,
                counts.join(", ")
            ));
        }
        if u.failed > 0 {
            failures.push(format!(
                "{} of {} random draws of the model cannot hover or be controlled",
                u.failed, u.samples
            ));
        }
    }
    failures
}

fn steps(text: &mut String, report: &CheckReport) {
    if report.steps.is_empty() {
        return;
    }
    text.push_str(
        "\nStep of the command (through the prefilter; x and y: 1 m through the rate limit), and of the loop alone\n",
    );
    let mut rows =
        vec![cells(["loop", "over %", "rise s", "5 % s", "2 % s", "dip to", "alone: over %", "rise s"])];
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
    text.push_str("\nStep disturbance at the actuator (thesis appendix B)\n");
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
    text.push_str("\nThe zero of the plant moved, with the canceller unchanged (thesis appendix A)\n");
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
        "\nOver {} random draws of {} coefficients from their standard errors, {} (seed {}; {} could not be analysed): worst, 5 %, median, 95 %",
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
        "\nGreatest tilt that can be held in steady flight, with every motor inside its range at {} V",
        significant(first.battery_v, 3)
    );
    let mut rows = vec![cells(["towards", "tilt deg", "speed m/s", "limited by"])];
    for tilt in &report.steady_tilts {
        rows.push(vec![
            tilt.direction.name().into(),
            significant(tilt.tilt_deg, 3),
            significant(tilt.speed_m_s, 3),
            tilt.limited_by(),
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
