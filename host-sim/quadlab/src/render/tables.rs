//! Every table that is printed or shown on a page.

use diagnosis::workflow::{Explanation, FlightSets, LoadedFlight};
use diagnosis::{Diagnosis, EffectFinding, Unexplained};
use model::{AXES, Axis, AxisError, Effect, HistoryEntry, Model, NotIdentified, PerAxis};
use report::number::{fixed, p_value, percent, unit, value_and_error, with_error};
use report::significant;
use sysid::checks::clocks::Clock;
use sysid::compare::HorizonError;
use sysid::{Comparison, Fault, MotorsOfFlights};

pub(crate) use crate::render::grid::{Grid, paragraph, wrap};
use crate::render::grid::{number, text, verdict};
use crate::render::view::View;

/// An empty table of words.
pub(crate) fn evidence_grid(caption: &str, names: &[&'static str]) -> Grid {
    Grid::new(caption, names.iter().map(|name| text(name)).collect::<Vec<_>>())
}

/// Three significant digits for what is compared by eye.
fn short(value: f64) -> String {
    if value.is_nan() { "-".into() } else { significant(value, 3) }
}

/// Three decimals for a coefficient of determination.
fn determination(r2: f64) -> String {
    fixed(r2, 3)
}

fn yes_no(holds: bool) -> String {
    if holds { "yes".into() } else { "no".into() }
}

/// Every coefficient of a model.
pub(crate) fn coefficients(model: &Model) -> Grid {
    let mut grid = Grid::new(
        "Coefficients",
        [text("effect"), text("name"), number("value", ""), number("std. error", ""), text("unit")],
    );
    let rotors = model.rotor_quantity();
    for term in &model.terms {
        let info = term.effect.info();
        for (c, estimate) in info.coefficients.iter().zip(&term.coefficients) {
            let [value, error] = value_and_error(estimate.value, estimate.std_error);
            grid.push([info.id.into(), c.name.into(), value, error, unit(c.unit_for(rotors)).into()]);
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
        let bias: Vec<String> = p.gyro_bias_rad_s.iter().map(|b| fixed(*b, 4)).collect();
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
        "Faults found in the flights, the vehicle file and the fit",
        [text("kind"), text("flight"), text("what is wrong and how to fix it")],
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
        "Clocks: delay of the tracker relative to the sensors on board (positive skew: the delay grows)",
        [
            text("flight"),
            number("attitude against gyro", "ms"),
            number("skew", "%"),
            number("position against IMU", "ms"),
            verdict("corrected"),
        ],
    );
    let offset = |clock: Option<Clock>| match clock {
        Some(c) => with_error(1e3 * c.offset_s, 1e3 * c.offset_std_error_s, ""),
        None => "-".into(),
    };
    for flight in flights {
        let c = &flight.clocks;
        let skew =
            c.attitude.map_or("-".into(), |a| with_error(100.0 * a.skew, 100.0 * a.skew_std_error, ""));
        let corrected = if c.aligned { "yes" } else { "no" };
        let name = flight.prepared.name.clone();
        grid.push([name, offset(c.attitude), skew, offset(c.position), corrected.into()]);
    }
    grid
}

fn notes(flight: &sysid::Prepared) -> String {
    let [x, y] = flight.accelerometer_bias_m_s2;
    let bias = (x != 0.0 || y != 0.0)
        .then(|| format!("accelerometer bias x y {} {} m/s^2", fixed(x, 3), fixed(y, 3)));
    let all: Vec<String> = bias.into_iter().chain(flight.notes.iter().cloned()).collect();
    if all.is_empty() { "-".into() } else { all.join("; ") }
}

/// Constants that training flights have of their own, where they stand out.
pub(crate) fn trim(flights: &[LoadedFlight]) -> Grid {
    let mut grid = Grid::new(
        "Trim of each flight relative to the mean of all (u v w in m/s^2, p q r in rad/s^2); held-out flights have none",
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
pub(crate) fn motors(model: &Model, all: &[MotorsOfFlights]) -> Grid {
    let unit = Effect::RotorMoments.info().coefficients[0].unit_for(model.rotor_quantity());
    let mut grid = Grid::new(
        format!(
            "Motor coefficients of each flight, the rest of the model fixed [{unit}]: they depend on how it was flown"
        ),
        [text("axis"), text("flight"), number("1", ""), number("2", ""), number("3", ""), number("4", "")],
    );
    for motors in all.iter().filter(|m| m.warning.is_some()) {
        for flight in &motors.flights {
            let cells = flight.value.iter().zip(&flight.std_error).map(|(v, e)| with_error(*v, *e, ""));
            grid.push([motors.axis.name().into(), flight.name.clone()].into_iter().chain(cells));
        }
    }
    grid
}

/// "12.3 ± 0.4" ms, in brackets where it is left alone.
pub(crate) fn rotors_late(flight: &sysid::Prepared) -> String {
    let Some(alignment) = &flight.alignment else { return "-".into() };
    let text = with_error(1e3 * alignment.late_s, 1e3 * alignment.std_error_s, "");
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
        "Open-loop prediction: mean error after the given number of samples",
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
    if let Some(cleaned) = &comparison.horizons_cleaned {
        let values = thousandths(&cleaned.sum_1_50);
        grid.push(std::iter::once("sum without the outliers".to_owned()).chain(values));
    }
    grid
}

/// Open-loop prediction errors of several models at the contract's horizons.
pub(crate) fn horizons_side_by_side(models: &[(String, &Comparison)]) -> Grid {
    let mut grid = Grid::new(
        "Open-loop prediction: mean error after the given number of samples",
        [
            text("samples"),
            text("model"),
            number("position", "mm"),
            number("velocity", "mm/s"),
            number("attitude", "mrad"),
            number("rate", "mrad/s"),
        ],
    );
    for (index, name) in ["1", "10", "50", "sum of 1 to 50"].into_iter().enumerate() {
        for (model, comparison) in models {
            let h = &comparison.horizons;
            let values = thousandths(&[h.one, h.ten, h.fifty, h.sum_1_50][index]);
            grid.push([name.to_owned(), model.clone()].into_iter().chain(values));
        }
    }
    grid
}

/// Errors of several models over all flights, and by how much each is below the first model's.
pub(crate) fn side_by_side(models: &[(String, &Comparison)]) -> Grid {
    let mut grid = Grid::new(
        "Error of each axis over all flights (rms; u v w in m/s^2, p q r in rad/s^2), R2, and the reduction relative to the \
         first model",
        std::iter::once(text("model"))
            .chain([text("")])
            .chain(AXES.map(|axis| number(axis.name(), "")))
            .collect::<Vec<_>>(),
    );
    let first = models.first().map(|(_, comparison)| comparison.total);
    for (index, (model, comparison)) in models.iter().enumerate() {
        let mut row = |what: &str, figures: [String; 6]| {
            grid.push([model.clone(), what.to_owned()].into_iter().chain(figures));
        };
        row("rms", AXES.map(|axis| short(comparison.total[axis].rms)));
        row("R2", AXES.map(|axis| determination(comparison.total[axis].r2)));
        if let Some(first) = first.filter(|_| index > 0) {
            let fall = |axis| 100.0 * (1.0 - comparison.total[axis].rms / first[axis].rms);
            row("reduction of the rms, %", AXES.map(|axis| short(fall(axis))));
        }
    }
    grid
}

/// Held-out errors of the basic model and after each effect that joined it.
pub(crate) fn falling_error(explanation: &Explanation) -> Grid {
    let mut grid = Grid::new(
        "Held-out root mean square error of each axis (u v w in m/s^2, p q r in rad/s^2) and of the position predicted 0.5 \
         s ahead",
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
        "Where it fails most: each row is a fifth of the samples, with its share of the axis' squared error",
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
        [text("effect"), verdict("supported"), number("rms falls by", "%"), number("p", ""), text("reason")],
    );
    for finding in &diagnosis.effects {
        let known = !finding.coefficients.is_empty();
        let number = |text: String| if known { text } else { "-".into() };
        grid.push([
            named(finding),
            yes_no(finding.supported),
            number(percent(finding.rms_fall_percent())),
            number(p_value(finding.p_value)),
            reason(finding),
        ]);
    }
    grid
}

/// "motor-efficiency 2" for a change of motor 2.
pub(crate) fn named(finding: &EffectFinding) -> String {
    finding.motor.map_or_else(|| finding.effect.to_string(), |motor| format!("{} {motor}", finding.effect))
}

fn reason(finding: &EffectFinding) -> String {
    if finding.confounded_with.is_empty() || finding.reason.names_rivals() {
        return finding.reason.to_string();
    }
    let others: Vec<&str> = finding.confounded_with.iter().map(|effect| effect.id()).collect();
    format!("{}; confounded with {}", finding.reason, others.join(", "))
}

/// Coefficients of candidates, each fitted together with the whole model: of all, or only of those supported.
pub(crate) fn candidates(diagnosis: &Diagnosis, supported_only: bool) -> Grid {
    findings("Coefficients, each effect fitted together with the whole model", diagnosis, supported_only)
}

/// Coefficients of the change that is supported.
pub(crate) fn change(diagnosis: &Diagnosis) -> Grid {
    findings("Coefficients of the change", diagnosis, true)
}

fn findings(caption: &str, diagnosis: &Diagnosis, supported_only: bool) -> Grid {
    let mut grid = Grid::new(
        caption,
        [text("effect"), text("name"), number("value", ""), number("std. error", ""), text("unit")],
    );
    for finding in diagnosis.effects.iter().filter(|f| f.supported || !supported_only) {
        for c in &finding.coefficients {
            let [value, error] = value_and_error(c.value, Some(c.std_error));
            grid.push([named(finding), c.name.into(), value, error, unit(c.unit).into()]);
        }
    }
    grid
}

/// Error of each flight without and with a change.
pub(crate) fn flight_by_flight(axes: &[Axis], before: &[View], after: &[View]) -> Grid {
    let mut grid = Grid::new(
        "Root mean square error of each flight (u v w in m/s^2, p q r in rad/s^2)",
        [
            text("flight"),
            text("axis"),
            number("without", ""),
            number("with", ""),
            number("error falls by", "%"),
        ],
    );
    for (b, a) in before.iter().zip(after) {
        for axis in axes {
            let rms = |view: &View| {
                let residual = view.residual(*axis);
                (residual.iter().map(|e| e * e).sum::<f64>() / residual.len().max(1) as f64).sqrt()
            };
            let (without, with) = (rms(b), rms(a));
            let fall = percent(100.0 * (1.0 - with / without));
            grid.push([b.name.clone(), axis.name().into(), short(without), short(with), fall]);
        }
    }
    grid
}

/// Structure that no effect accounts for.
pub(crate) fn unexplained(all: &[Unexplained]) -> Grid {
    let mut grid = Grid::new(
        "Left unexplained",
        [text("axis"), text("depends on"), number("share of its squared error", "%"), number("p", "")],
    );
    for u in all {
        let depends_on = u.depends_on.to_string();
        grid.push([u.axis.name().into(), depends_on, percent(u.share_percent), p_value(u.p_value)]);
    }
    grid
}

/// What flights do not determine of a model.
pub(crate) fn not_identified(all: &[NotIdentified]) -> Grid {
    let mut grid = Grid::new(
        "Not identified: what these flights do not determine",
        [text("part"), text("axis"), text("why, and what to fly")],
    );
    for one in all {
        let axis = one.axis.map_or("all", Axis::name);
        let why = format!("{}; to determine it: {}", one.reason, one.fly);
        grid.push([one.group.name().into(), axis.into(), why]);
    }
    grid
}

/// Held-out error of each axis before and after.
pub(crate) fn before_after(caption: &str, before: &PerAxis<f64>, after: &PerAxis<f64>) -> Grid {
    let mut grid = Grid::new(
        caption,
        [text("axis"), number("before", ""), number("after", ""), number("falls by", "%")],
    );
    let drop = before.drop_percent(after);
    for axis in AXES {
        grid.push([axis.name().into(), short(before[axis]), short(after[axis]), percent(drop[axis])]);
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
        grid.push([
            c.name.into(),
            significant(hidden.value, 4),
            value,
            error,
            unit(c.unit_for(found.rotor_quantity())).into(),
        ]);
    }
    grid
}
