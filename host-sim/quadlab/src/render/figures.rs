//! Figures of flights and models: measured against predicted, residual against what it depends on, error of prediction.

use model::{Axis, Model};
use report::{Figure, Mark, Panels, Series, Style, bin_statistics, binned_scatter};
use sysid::compare::HorizonError;
use sysid::prepare::conditions::Condition;
use sysid::{Prepared, Residuals, residuals};

/// Length of the stretch shown of a flight, s: long enough for a few manoeuvres, short enough to see each.
const SHOWN_S: f64 = 12.0;
/// Ranges of equal count that a condition is cut into.
const BINS: usize = 16;

/// Full name of an axis for people.
pub(crate) const fn axis_name(axis: Axis) -> &'static str {
    match axis {
        Axis::U => "forward acceleration (u)",
        Axis::V => "sideward acceleration (v)",
        Axis::W => "downward acceleration (w)",
        Axis::P => "roll acceleration (p)",
        Axis::Q => "pitch acceleration (q)",
        Axis::R => "yaw acceleration (r)",
    }
}

/// A flight seen by a model: residuals and what they can be judged by.
pub(crate) struct View {
    name: String,
    period_s: f64,
    residuals: Residuals,
    conditions: Vec<Condition>,
    time_s: Vec<f64>,
}

impl View {
    pub(crate) fn new(flight: &Prepared, model: &Model) -> Self {
        let conditions = flight.conditions(&model.vehicle, &model.adjustments());
        Self {
            name: flight.name.clone(),
            period_s: flight.period_s,
            residuals: residuals(flight, model),
            time_s: conditions.time_s.clone(),
            conditions: conditions.all(),
        }
    }

    pub(crate) fn all(flights: &[&Prepared], model: &Model) -> Vec<Self> {
        flights.iter().map(|flight| Self::new(flight, model)).collect()
    }

    /// Points of a series over a range of rows; a gap in time breaks the line.
    fn line(&self, rows: std::ops::Range<usize>, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(rows.len());
        for row in rows.clone() {
            if row > rows.start && self.time_s[row] - self.time_s[row - 1] > 3.0 * self.period_s {
                points.push((self.time_s[row], f64::NAN));
            }
            points.push((self.time_s[row], value(row)));
        }
        points
    }
}

/// The stretch in which the model fails most: rows, over the axes, each weighed by its own error over the flight.
fn worst_stretch(view: &View, axes: &[Axis]) -> std::ops::Range<usize> {
    let rows = view.time_s.len();
    let length = ((SHOWN_S / view.period_s) as usize).min(rows);
    let mut cost = vec![0.0; rows];
    for axis in axes {
        let errors = &view.residuals.residual[axis.index()];
        let total: f64 = errors.iter().map(|e| e * e).sum();
        if total > 0.0 {
            cost.iter_mut().zip(errors).for_each(|(c, e)| *c += e * e / total);
        }
    }
    let mut sum: f64 = cost[..length].iter().sum();
    let (mut best, mut most) = (0, sum);
    for start in 1..=rows - length {
        sum += cost[start + length - 1] - cost[start - 1];
        if sum > most {
            (best, most) = (start, sum);
        }
    }
    best..best + length
}

/// A stack of figures and the sentence below it.
pub(crate) struct Captioned {
    pub(crate) panels: Panels,
    pub(crate) caption: String,
}

/// Measured against predicted for each of `axes`, over the stretch of the flight where the model fails most. With
/// `after`, the predictions of two models.
pub(crate) fn measured_against_predicted(before: &View, after: Option<&View>, axes: &[Axis]) -> Captioned {
    let rows = worst_stretch(before, axes);
    let figures: Vec<Figure> = axes
        .iter()
        .map(|axis| {
            let k = axis.index();
            let measured = &before.residuals.measured[k];
            // Both predictions are drawn as measured minus residual, against one and the same measured line.
            let predicted =
                |view: &View| view.line(rows.clone(), |row| measured[row] - view.residuals.residual[k][row]);
            let (name, style) = match after {
                Some(_) => ("predicted before", Style::PredictedBefore),
                None => ("predicted", Style::PredictedAfter),
            };
            let mut figure = Figure::new(
                axis_name(*axis),
                report::Axis::new("time", "s"),
                report::Axis::new(axis.name(), axis.unit()),
            )
            .with(Series::line("measured", Style::Measured, before.line(rows.clone(), |row| measured[row])))
            .with(Series::line(name, style, predicted(before)));
            if let Some(after) = after {
                figure =
                    figure.with(Series::line("predicted after", Style::PredictedAfter, predicted(after)));
            }
            figure
        })
        .collect();
    let caption = format!(
        "{}, the {:.0} s in which the {}model fails most. Accelerations are felt ones, without gravity.",
        before.name,
        rows.len() as f64 * before.period_s,
        if after.is_some() { "first " } else { "" },
    );
    Captioned { panels: Panels::new(figures), caption }
}

/// (condition, residual) of all flights.
fn points(views: &[View], axis: Axis, condition: usize) -> Vec<(f64, f64)> {
    views
        .iter()
        .flat_map(|view| {
            let values = view.conditions[condition].values.iter().copied();
            values.zip(view.residuals.residual[axis.index()].iter().copied())
        })
        .collect()
}

/// Share of the squared residual that its mean in each range of the condition accounts for.
fn share(points: &[(f64, f64)]) -> f64 {
    let total: f64 = points.iter().map(|(_, e)| e * e).sum();
    let means: f64 = bin_statistics(points, BINS).iter().map(|b| b.count as f64 * b.mean * b.mean).sum();
    if total > 0.0 { means / total } else { 0.0 }
}

/// The axis and measured quantity on which the residual depends most.
pub(crate) fn strongest_dependence(views: &[View], axes: &[Axis]) -> Option<(Axis, usize)> {
    let conditions = views.first().map_or(0, |view| view.conditions.len());
    let pairs = axes.iter().flat_map(|axis| (0..conditions).map(|condition| (*axis, condition)));
    let judged = pairs.map(|(axis, condition)| (share(&points(views, axis, condition)), axis, condition));
    judged.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, axis, condition)| (axis, condition))
}

fn residual_axes(views: &[View], axis: Axis, condition: usize) -> (report::Axis, report::Axis) {
    let info = &views[0].conditions[condition];
    let y = report::Axis::new(format!("measured − predicted {}", axis.name()), axis.unit());
    (report::Axis::new(info.name, info.unit), y)
}

/// The residual of one axis over a quantity that it may depend on.
pub(crate) fn residual_against(views: &[View], axis: Axis, quantity: &str) -> Option<Figure> {
    let condition = views.first()?.conditions.iter().position(|c| c.name == quantity)?;
    let (x, y) = residual_axes(views, axis, condition);
    let title = format!("Residual of the {} over {quantity}", axis_name(axis));
    Some(binned_scatter(&title, x, y, &points(views, axis, condition), BINS))
}

/// The same residual before and after a change of the model: the means, over the cloud of before.
pub(crate) fn residual_before_after(
    before: &[View],
    after: &[View],
    axis: Axis,
    condition: usize,
) -> Captioned {
    let (x, y) = residual_axes(before, axis, condition);
    let quantity = x.label.clone();
    let cloud = points(before, axis, condition);
    let means = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        bin_statistics(points, BINS).iter().map(|bin| (bin.x, bin.mean)).collect()
    };
    let after = points(after, axis, condition);
    let (share_before, share_after) = (100.0 * share(&cloud), 100.0 * share(&after));
    let (means_before, means_after) = (means(&cloud), means(&after));
    let title = format!("Residual of the {} over {quantity}", axis_name(axis));
    let figure = Figure::new(title, x, y)
        .mark(Mark::Horizontal { name: String::new(), y: 0.0, style: Style::Reference })
        .with(Series::points("samples before", Style::Muted, cloud))
        .with(Series::line("mean before", Style::PredictedBefore, means_before.clone()))
        .with(Series::points("", Style::PredictedBefore, means_before))
        .with(Series::line("mean after", Style::PredictedAfter, means_after.clone()))
        .with(Series::points("", Style::PredictedAfter, means_after));
    let caption = format!(
        "All held-out flights. A model that knows the effect leaves means on the zero line: of the squared residual, the \
         means account for {share_before:.1} % before and {share_after:.1} % after."
    );
    Captioned { panels: figure.into(), caption }
}

/// Mean error of open-loop prediction over the number of samples predicted, for one or two models.
pub(crate) fn prediction_error(first: &[HorizonError], after: Option<&[HorizonError]>) -> Captioned {
    type Quantity = (&'static str, &'static str, fn(&HorizonError) -> f64);
    let quantities: [Quantity; 4] = [
        ("position", "m", |e| e.position_m),
        ("velocity", "m/s", |e| e.velocity_m_s),
        ("attitude", "rad", |e| e.attitude_rad),
        ("rate", "rad/s", |e| e.rate_rad_s),
    ];
    let figures: Vec<Figure> = quantities
        .iter()
        .map(|(name, unit, value)| {
            let line = |errors: &[HorizonError]| -> Vec<(f64, f64)> {
                errors.iter().enumerate().map(|(k, e)| ((k + 1) as f64, value(e))).collect()
            };
            let figure = Figure::new(
                format!("{name} error"),
                report::Axis::new("samples predicted", ""),
                report::Axis::new(*name, *unit),
            );
            match after {
                None => figure.with(Series::line("", Style::PredictedAfter, line(first))),
                Some(after) => figure
                    .with(Series::line("before", Style::PredictedBefore, line(first)))
                    .with(Series::line("after", Style::PredictedAfter, line(after))),
            }
        })
        .collect();
    let caption = "Mean error of predictions started from every sample of the flights and told nothing of the future but \
                   the motor commands and the battery voltage.";
    Captioned { panels: Panels::new(figures), caption: caption.into() }
}
