//! Tables that are both printed and shown on pages: each is built once as a [`Grid`].

use std::fmt::Write as _;

use diagnosis::Diagnosis;
use diagnosis::diagnose::{EffectFinding, Unexplained};
use model::{AXES, AxisError, Effect, HistoryEntry, Model, PerAxis};
use report::significant;
use sysid::checks::clocks::Clock;
use sysid::compare::HorizonError;
use sysid::{Comparison, Fault, MotorsOfFlights};

use diagnosis::workflow::{Explanation, FlightSets, LoadedFlight};

/// Printed lines are at most this long where a word allows it.
const LINE_LENGTH: usize = 100;
/// Narrowest last column that is worth breaking into lines.
const NARROWEST: usize = 20;
/// Smaller standard errors are written with an exponent.
const MOST_DECIMALS: f64 = 8.0;

#[derive(Clone, Copy, PartialEq)]
enum Content {
    Text,
    Number,
    /// "yes" or "no".
    Verdict,
}

struct Heading {
    name: &'static str,
    unit: &'static str,
    content: Content,
}

const fn text(name: &'static str) -> Heading {
    Heading { name, unit: "", content: Content::Text }
}

const fn number(name: &'static str, unit: &'static str) -> Heading {
    Heading { name, unit, content: Content::Number }
}

const fn verdict(name: &'static str) -> Heading {
    Heading { name, unit: "", content: Content::Verdict }
}

/// An empty table of words.
pub(crate) fn evidence_grid(caption: &str, names: &[&'static str]) -> Grid {
    Grid::new(caption, names.iter().map(|name| text(name)).collect::<Vec<_>>())
}

/// A table of words and numbers that are already written out.
pub(crate) struct Grid {
    caption: String,
    headings: Vec<Heading>,
    rows: Vec<Vec<String>>,
}

impl Grid {
    fn new(caption: impl Into<String>, headings: impl Into<Vec<Heading>>) -> Self {
        Self { caption: caption.into(), headings: headings.into(), rows: Vec::new() }
    }

    pub(crate) fn push(&mut self, row: impl IntoIterator<Item = String>) {
        self.rows.push(row.into_iter().collect());
    }

    /// Whether there is a row.
    pub(crate) fn has_rows(&self) -> bool {
        !self.rows.is_empty()
    }

    /// Aligned columns for a terminal; a last column of words is broken into lines.
    pub(crate) fn to_text(&self) -> String {
        let headings: Vec<String> = self.headings.iter().map(Heading::label).collect();
        let mut widths: Vec<usize> = headings.iter().map(|h| h.chars().count()).collect();
        for row in &self.rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = (*width).max(cell.chars().count());
            }
        }
        let last = widths.len().saturating_sub(1);
        let before: usize = widths.iter().take(last).map(|w| w + 2).sum::<usize>() + 2;
        if self.headings.last().is_some_and(|h| h.content == Content::Text) {
            widths[last] = widths[last].min(LINE_LENGTH.saturating_sub(before).max(NARROWEST));
        }
        let mut result = String::new();
        if !self.caption.is_empty() {
            result = format!("{}\n", self.caption);
        }
        self.line(&mut result, &headings, &widths);
        for row in &self.rows {
            self.line(&mut result, row, &widths);
        }
        result
    }

    fn line(&self, result: &mut String, cells: &[String], widths: &[usize]) {
        let mut line = String::new();
        let mut broken = Vec::new();
        for (index, ((cell, heading), width)) in cells.iter().zip(&self.headings).zip(widths).enumerate() {
            let mut shown = cell.as_str();
            if index + 1 == widths.len() && cell.chars().count() > *width {
                broken = wrap(cell, *width);
                shown = broken.first().map_or("", String::as_str);
            }
            let _ = match heading.content {
                Content::Number => write!(line, "  {shown:>width$}"),
                Content::Text | Content::Verdict => write!(line, "  {shown:<width$}"),
            };
        }
        let _ = writeln!(result, "{}", line.trim_end());
        let indent: usize = widths[..widths.len() - 1].iter().map(|w| w + 2).sum::<usize>() + 2;
        for more in broken.iter().skip(1) {
            let _ = writeln!(result, "{:indent$}{more}", "");
        }
    }

    /// The table of a page.
    pub(crate) fn to_table(&self) -> report::Table {
        let columns: Vec<report::Column> = self
            .headings
            .iter()
            .map(|h| match h.content {
                Content::Number => report::Column::number(h.name, h.unit),
                Content::Text | Content::Verdict => report::Column::text(h.name),
            })
            .collect();
        let mut table = report::Table::new(self.caption.clone(), columns);
        for row in &self.rows {
            table.push(row.iter().zip(&self.headings).map(|(cell, heading)| {
                let shown = report::Cell::from(cell.as_str());
                match (heading.content, cell.as_str()) {
                    (Content::Verdict, "yes") => shown.verdict(report::Verdict::Good),
                    (Content::Verdict, _) => shown.verdict(report::Verdict::Neutral),
                    _ => shown,
                }
            }));
        }
        table
    }
}

impl Heading {
    fn label(&self) -> String {
        if self.unit.is_empty() { self.name.into() } else { format!("{} [{}]", self.name, self.unit) }
    }
}

/// Breaks a text at spaces into lines of at most `width` characters; a longer word stays whole.
pub(crate) fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

/// A sentence on lines of at most 100 characters.
pub(crate) fn paragraph(text: &str) -> String {
    wrap(text, LINE_LENGTH).join("\n") + "\n"
}

/// Three significant digits for what is compared by eye.
fn short(value: f64) -> String {
    if value.is_nan() { "-".into() } else { significant(value, 3) }
}

/// Three decimals for a coefficient of determination.
fn determination(r2: f64) -> String {
    if r2.is_nan() { "-".into() } else { format!("{r2:.3}") }
}

/// One decimal; what rounds to nothing has no sign.
fn percent(value: f64) -> String {
    let text = format!("{value:.1}");
    if text == "-0.0" { "0.0".into() } else { text }
}

/// A p-value: below what a table can tell apart, only its bound.
pub(crate) fn probability(p: f64) -> String {
    if p < 1e-12 {
        "<1e-12".into()
    } else if p < 0.001 {
        format!("{p:.0e}")
    } else {
        format!("{p:.3}")
    }
}

fn yes_no(holds: bool) -> String {
    if holds { "yes".into() } else { "no".into() }
}

/// A value and its standard error with the same decimals, as many as show two digits of the error.
fn value_and_error(value: f64, std_error: Option<f64>) -> [String; 2] {
    let Some(error) = std_error else { return [significant(value, 4), "-".into()] };
    let decimals = 1.0 - error.log10().floor();
    if error > 0.0 && (0.0..=MOST_DECIMALS).contains(&decimals) {
        let decimals = decimals as usize;
        [value, error].map(|v| format!("{v:.decimals$}"))
    } else {
        [significant(value, 4), significant(error, 2)]
    }
}

/// Every coefficient of a model.
pub(crate) fn coefficients(model: &Model) -> Grid {
    let mut grid = Grid::new(
        "Coefficients",
        [text("effect"), text("name"), number("value", ""), number("std. error", ""), text("unit")],
    );
    for term in &model.terms {
        let info = term.effect.info();
        for (c, estimate) in info.coefficients.iter().zip(&term.coefficients) {
            let [value, error] = value_and_error(estimate.value, estimate.std_error);
            grid.push([info.id.into(), c.name.into(), value, error, c.unit.into()]);
        }
    }
    grid
}

/// Errors of each axis on the flights fitted on and on those held out.
pub(crate) fn fit_errors(train: &PerAxis<AxisError>, held_out: &PerAxis<AxisError>) -> Grid {
    let mut grid = Grid::new(
        "Error of each axis: measured minus predicted acceleration",
        [
            text("axis"),
            text("unit"),
            number("train rms", ""),
            number("R2", ""),
            number("held-out rms", ""),
            number("R2", ""),
        ],
    );
    for axis in AXES {
        let (t, h) = (train[axis], held_out[axis]);
        grid.push([
            axis.name().into(),
            axis.unit().into(),
            short(t.rms),
            determination(t.r2),
            short(h.rms),
            determination(h.r2),
        ]);
    }
    grid
}

/// What was found out about each flight while it was prepared.
pub(crate) fn flights(sets: &FlightSets) -> Grid {
    let mut grid = Grid::new(
        "Flights",
        [
            text("flight"),
            text("role"),
            number("rows", ""),
            number("gyro bias p q r", "rad/s"),
            number("rotors late", "ms"),
            text("force rows from"),
            text("notes"),
        ],
    );
    let train = sets.training.loaded().iter().map(|flight| (flight, "train"));
    let validate = sets.held_out.loaded().iter().map(|flight| (flight, "validate"));
    for (flight, role) in train.chain(validate) {
        let p = &flight.prepared;
        let bias: Vec<String> = p.gyro_bias_rad_s.iter().map(|b| format!("{b:.4}")).collect();
        grid.push([
            p.name.clone(),
            role.into(),
            p.rows().to_string(),
            bias.join(" "),
            rotors_late(p),
            p.force_target.name().into(),
            notes(p),
        ]);
    }
    grid
}

/// What is wrong with flights, vehicle file and fit.
pub(crate) fn faults(faults: &[Fault]) -> Grid {
    let mut grid = Grid::new(
        "What was found before anything was fitted, and in the fit",
        [text("kind"), text("flight"), text("what it is and how to mend it")],
    );
    for fault in faults {
        grid.push([
            fault.kind.id().into(),
            fault.flight.clone().unwrap_or("-".into()),
            fault.sentence.clone(),
        ]);
    }
    grid
}

/// The tracker's clock against the sensors on board, where flights tell.
pub(crate) fn clocks<'a>(flights: impl IntoIterator<Item = &'a LoadedFlight>) -> Grid {
    let mut grid = Grid::new(
        "Clocks: how late the tracker is against the sensors on board (a skew: the tracker runs ahead)",
        [
            text("flight"),
            number("attitude against gyro", "ms"),
            number("skew", "%"),
            number("position against IMU", "ms"),
            verdict("corrected"),
        ],
    );
    let offset = |clock: Option<Clock>| match clock {
        Some(c) => format!("{:.2} ± {:.2}", 1e3 * c.offset_s, 1e3 * c.offset_std_error_s),
        None => "-".into(),
    };
    for flight in flights {
        let c = &flight.clocks;
        let skew = c
            .attitude
            .map_or("-".into(), |a| format!("{:.3} ± {:.3}", 100.0 * a.skew, 100.0 * a.skew_std_error));
        let corrected = if c.aligned { "yes" } else { "no" };
        let name = flight.prepared.name.clone();
        grid.push([name, offset(c.attitude), skew, offset(c.position), corrected.into()]);
    }
    grid
}

fn notes(flight: &sysid::Prepared) -> String {
    let [x, y] = flight.accelerometer_bias_m_s2;
    let bias = (x != 0.0 || y != 0.0).then(|| format!("accelerometer bias x y {x:.3} {y:.3} m/s^2"));
    let all: Vec<String> = bias.into_iter().chain(flight.notes.iter().cloned()).collect();
    if all.is_empty() { "-".into() } else { all.join("; ") }
}

/// Constants that training flights have of their own, where they stand out.
pub(crate) fn trim(flights: &[LoadedFlight]) -> Grid {
    let mut grid = Grid::new(
        "Trim of single flights beyond the mean of all (u v w in m/s^2, p q r in rad/s^2); held-out flights have none",
        std::iter::once(text("flight")).chain(AXES.map(|axis| number(axis.name(), ""))).collect::<Vec<_>>(),
    );
    for flight in flights {
        let Some(trim) = &flight.prepared.trim else { continue };
        let cells = trim.value.map(|v| if v == 0.0 { "-".into() } else { short(v) });
        grid.push(std::iter::once(flight.prepared.name.clone()).chain(cells));
    }
    grid
}

/// Motor coefficients flight by flight, of axes on which they are in doubt.
pub(crate) fn motors(all: &[MotorsOfFlights]) -> Grid {
    let mut grid = Grid::new(
        "Motor coefficients of single flights, the rest of the model held [1/(kg m^2)]: they follow how it was flown",
        [text("axis"), text("flight"), number("1", ""), number("2", ""), number("3", ""), number("4", "")],
    );
    for motors in all.iter().filter(|m| m.warning.is_some()) {
        for flight in &motors.flights {
            let cells = flight.value.iter().zip(&flight.std_error).map(|(v, e)| {
                let [value, error] = value_and_error(*v, Some(*e));
                format!("{value} +- {error}")
            });
            grid.push([motors.axis.name().into(), flight.name.clone()].into_iter().chain(cells));
        }
    }
    grid
}

/// "12.3 +- 0.4" ms, in brackets where it is left alone.
pub(crate) fn rotors_late(flight: &sysid::Prepared) -> String {
    let Some(alignment) = &flight.alignment else { return "-".into() };
    let text = format!("{:.1} +- {:.1}", 1e3 * alignment.late_s, 1e3 * alignment.std_error_s);
    if alignment.corrected { text } else { format!("({text})") }
}

/// Root mean square error of each flight and axis, and of all flights together.
pub(crate) fn comparison(comparison: &Comparison) -> Grid {
    let mut grid = Grid::new(
        "Root mean square error of each axis, measured minus predicted (u v w in m/s^2, p q r in rad/s^2)",
        std::iter::once(text("flight"))
            .chain([number("samples", "")])
            .chain(AXES.map(|axis| number(axis.name(), "")))
            .collect::<Vec<_>>(),
    );
    for flight in &comparison.flights {
        let figures = AXES.map(|axis| short(flight.axes[axis].rms));
        grid.push([flight.name.clone(), flight.samples.to_string()].into_iter().chain(figures));
    }
    let samples: usize = comparison.flights.iter().map(|f| f.samples).sum();
    let total = AXES.map(|axis| short(comparison.total[axis].rms));
    grid.push(["all flights".into(), samples.to_string()].into_iter().chain(total));
    let r2 = AXES.map(|axis| determination(comparison.total[axis].r2));
    grid.push(["R2 of all flights".into(), String::new()].into_iter().chain(r2));
    grid
}

/// In mm, mm/s, mrad and mrad/s: the sizes these errors have.
fn thousandths(e: &HorizonError) -> [String; 4] {
    [e.position_m, e.velocity_m_s, e.attitude_rad, e.rate_rad_s].map(|v| short(1000.0 * v))
}

/// Open-loop prediction errors at the contract's horizons.
pub(crate) fn horizons(comparison: &Comparison) -> Grid {
    let h = &comparison.horizons;
    let mut grid = Grid::new(
        "Open-loop prediction: mean error after so many samples",
        [
            text("samples"),
            number("position", "mm"),
            number("velocity", "mm/s"),
            number("attitude", "mrad"),
            number("rate", "mrad/s"),
        ],
    );
    for (name, e) in [("1", h.one), ("10", h.ten), ("50", h.fifty), ("sum of 1 to 50", h.sum_1_50)] {
        let values = thousandths(&e);
        grid.push(std::iter::once(name.to_owned()).chain(values));
    }
    grid
}

/// The same before and after a change of the model.
pub(crate) fn horizons_before_after(before: &Comparison, after: &Comparison) -> Grid {
    let mut grid = Grid::new(
        "Open-loop prediction: mean error after so many samples",
        [
            text("samples"),
            text("model"),
            number("position", "mm"),
            number("velocity", "mm/s"),
            number("attitude", "mrad"),
            number("rate", "mrad/s"),
        ],
    );
    let (b, a) = (&before.horizons, &after.horizons);
    let rows = [
        ("1", b.one, a.one),
        ("10", b.ten, a.ten),
        ("50", b.fifty, a.fifty),
        ("sum of 1 to 50", b.sum_1_50, a.sum_1_50),
    ];
    for (name, before, after) in rows {
        for (model, e) in [("before", before), ("after", after)] {
            let values = thousandths(&e);
            grid.push([name.to_owned(), model.to_owned()].into_iter().chain(values));
        }
    }
    grid
}

/// Held-out errors of the basic model and after each effect that joined it.
pub(crate) fn falling_error(explanation: &Explanation) -> Grid {
    let mut grid = Grid::new(
        "Held-out root mean square error (u v w in m/s^2, p q r in rad/s^2) and of the position predicted 0.5 s ahead",
        std::iter::once(text("model"))
            .chain(AXES.map(|axis| number(axis.name(), "")))
            .chain([number("position", "mm")])
            .collect::<Vec<_>>(),
    );
    let added = explanation.steps.iter().map(|step| (format!("+ {}", step.effect), &step.comparison));
    for (name, comparison) in
        std::iter::once(("basic".to_owned(), &explanation.basic_comparison)).chain(added)
    {
        let rms = AXES.map(|axis| short(comparison.total[axis].rms));
        let position = short(1000.0 * comparison.horizons.fifty.position_m);
        grid.push(std::iter::once(name).chain(rms).chain([position]));
    }
    grid
}

/// Conditions under which an axis fails most.
pub(crate) fn worst(comparison: &Comparison) -> Grid {
    let mut grid = Grid::new(
        "Where it fails most: a fifth of the samples each, with their share of the axis' squared error",
        [text("axis"), text("condition"), number("rms", ""), number("share", "%")],
    );
    for w in &comparison.worst {
        grid.push([w.axis.name().into(), w.condition.clone(), short(w.rms), percent(w.share_percent)]);
    }
    grid
}

/// The candidates, ranked.
pub(crate) fn evidence(diagnosis: &Diagnosis) -> Grid {
    let mut grid = Grid::new(
        "Evidence for each effect on flights that it was not fitted on, best first",
        [text("effect"), verdict("supported"), number("drop", "%"), number("p", ""), text("reason")],
    );
    for finding in &diagnosis.effects {
        let known = !finding.coefficients.is_empty();
        let number = |text: String| if known { text } else { "-".into() };
        grid.push([
            named(finding),
            yes_no(finding.supported),
            number(percent(finding.drop_percent)),
            number(probability(finding.p_value)),
            reason(finding),
        ]);
    }
    grid
}

/// "motor-efficiency 2" for a change of motor 2.
fn named(finding: &EffectFinding) -> String {
    finding.motor.map_or_else(|| finding.effect.into(), |motor| format!("{} {motor}", finding.effect))
}

fn reason(finding: &EffectFinding) -> String {
    let confounded = &finding.confounded_with;
    if confounded.is_empty() || finding.reason.contains("cannot tell") {
        return finding.reason.clone();
    }
    format!("{}; confounded with {}", finding.reason, confounded.join(", "))
}

/// Coefficients of candidates, each fitted together with the whole model: of all, or only of those supported.
pub(crate) fn candidates(diagnosis: &Diagnosis, supported_only: bool) -> Grid {
    let mut grid = Grid::new(
        "Coefficients, each effect fitted together with the whole model",
        [text("effect"), text("name"), number("value", ""), number("std. error", ""), text("unit")],
    );
    for finding in diagnosis.effects.iter().filter(|f| f.supported || !supported_only) {
        for c in &finding.coefficients {
            let [value, error] = value_and_error(c.value, Some(c.std_error));
            grid.push([named(finding), c.name.into(), value, error, c.unit.into()]);
        }
    }
    grid
}

/// Structure that no effect accounts for.
pub(crate) fn unexplained(all: &[Unexplained]) -> Grid {
    let mut grid = Grid::new(
        "Left unexplained",
        [text("axis"), text("depends on"), number("share of its error", "%"), number("p", "")],
    );
    for u in all {
        grid.push([
            u.axis.name().into(),
            u.depends_on.clone(),
            percent(u.share_percent),
            probability(u.p_value),
        ]);
    }
    grid
}

/// Held-out error of each axis before and after.
pub(crate) fn before_after(caption: &str, before: &PerAxis<f64>, after: &PerAxis<f64>) -> Grid {
    let mut grid =
        Grid::new(caption, [text("axis"), number("before", ""), number("after", ""), number("drop", "%")]);
    let drop = before.drop_percent(after);
    for axis in AXES {
        grid.push([
            axis.name().into(),
            significant(before[axis], 4),
            significant(after[axis], 4),
            percent(drop[axis]),
        ]);
    }
    grid
}

/// The effects that were added to a model and what each was worth.
pub(crate) fn history(entries: &[HistoryEntry]) -> Grid {
    let mut grid = Grid::new(
        "Effects added, with the drop of the held-out squared error of each axis in percent",
        std::iter::once(text("effect"))
            .chain([verdict("supported")])
            .chain(AXES.map(|axis| number(axis.name(), "")))
            .collect::<Vec<_>>(),
    );
    for entry in entries {
        let drop = entry.sse_before.drop_percent(&entry.sse_after);
        let cells = AXES.map(|axis| percent(drop[axis]));
        grid.push([entry.effect.clone(), yes_no(entry.supported)].into_iter().chain(cells));
    }
    grid
}

/// Coefficients of the hidden effect beside what the flights say of them.
pub(crate) fn hidden(truth: &Model, effect: Effect, found: &Model) -> Grid {
    let mut grid = Grid::new(
        format!("Hidden: {effect}"),
        [text("name"), number("hidden", ""), number("found", ""), number("std. error", ""), text("unit")],
    );
    let hidden = truth.term(effect).into_iter().flat_map(|term| &term.coefficients);
    for (index, (c, hidden)) in effect.info().coefficients.iter().zip(hidden).enumerate() {
        let estimate = found.term(effect).and_then(|term| term.coefficients.get(index));
        let [value, error] =
            estimate.map_or_else(|| ["-".into(), "-".into()], |e| value_and_error(e.value, e.std_error));
        grid.push([c.name.into(), significant(hidden.value, 4), value, error, c.unit.into()]);
    }
    grid
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_align_and_the_last_is_broken_at_words() {
        let mut grid = Grid::new("Things", [text("name"), number("size", "m"), text("why")]);
        grid.push(["a".into(), "1.5".into(), "short".into()]);
        grid.push(["long name".into(), "123".into(), "word ".repeat(30)]);
        let lines: Vec<String> = grid.to_text().lines().map(str::to_owned).collect();
        assert_eq!(lines[1], "  name       size [m]  why");
        assert_eq!(lines[2], "  a               1.5  short");
        assert!(lines.len() > 4 && lines.iter().all(|line| line.len() <= LINE_LENGTH), "{lines:#?}");
        assert!(lines[4].starts_with(&" ".repeat(lines[1].find("why").unwrap())), "{lines:#?}");
    }

    #[test]
    fn values_go_as_far_as_their_error() {
        let text = |value, error| value_and_error(value, error).join(" ");
        assert_eq!(text(1.234567, Some(0.0123)), "1.235 0.012");
        assert_eq!(text(0.01803252, Some(0.0000021)), "0.0180325 0.0000021");
        assert_eq!(text(0.1, Some(3.0)), "0.1 3.0");
        assert_eq!(text(0.25, None), "0.2500 -");
        assert_eq!(text(1234.5, Some(123.0)), "1234 120");
        assert_eq!(text(0.0, Some(0.0)), "0 0");
    }
}
