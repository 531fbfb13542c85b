//! Figures of flights and models: measured against predicted, residual against what it depends on, error of prediction.

use model::{Axis, Effect, Model, Quantity};
use report::number::percent;
use report::{Figure, Mark, Panels, Series, Style, bin_statistics, binned_scatter};
use sysid::Prepared;
use sysid::compare::HorizonError;

use crate::render::view::{View, clearest_axis};

/// Length over which the size of an error is taken in the course of a flight, s.
const LEVEL_S: f64 = 0.5;

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

/// A stack of figures and the sentence below it.
pub(crate) struct Captioned {
    pub(crate) panels: Panels,
    pub(crate) caption: String,
}

/// Measured against predicted for each of `axes`, over a whole flight. With `after`, the predictions of two models.
pub(crate) fn measured_against_predicted(before: &View, after: Option<&View>, axes: &[Axis]) -> Captioned {
    let panel = |axis: &Axis| {
        let measured = &before.residuals.measured[axis.index()];
        // Both predictions are drawn as measured minus residual, against one and the same measured line.
        let predicted = |view: &View| view.line(|row| measured[row] - view.residual(*axis)[row]);
        let (name, style) = match after {
            Some(_) => ("predicted before", Style::PredictedBefore),
            None => ("predicted", Style::PredictedAfter),
        };
        let figure = Figure::new(axis_name(*axis), time(), report::Axis::new(axis.name(), axis.unit()))
            .with(Series::line("measured", Style::Measured, before.line(|row| measured[row])))
            .with(Series::line(name, style, predicted(before)));
        match after {
            Some(after) => {
                figure.with(Series::line("predicted after", Style::PredictedAfter, predicted(after)))
            }
            None => figure,
        }
    };
    let caption = format!(
        "The whole flight {}. Forces are shown as an accelerometer feels them, without gravity.",
        before.name
    );
    Captioned { panels: Panels::new(axes.iter().map(panel).collect::<Vec<_>>()), caption }
}

/// How large the residual of each of `axes` is in the course of a flight, by a model without an effect and one with it.
pub(crate) fn error_over_time(without: &View, with: &View, axes: &[Axis]) -> Captioned {
    let panel = |axis: &Axis| {
        let line = |view: &View| {
            let level = level(view.residual(*axis), view.rows_in(LEVEL_S));
            view.line(|row| level[row])
        };
        Figure::new(
            axis_name(*axis),
            time(),
            report::Axis::new(format!("rms of {}", axis.name()), axis.unit()),
        )
        .with(Series::line("without it", Style::PredictedBefore, line(without)))
        .with(Series::line("with it", Style::PredictedAfter, line(with)))
    };
    let caption = format!(
        "The whole flight {}: root mean square of measured minus predicted over {LEVEL_S}\u{a0}s around each instant.",
        without.name
    );
    Captioned { panels: Panels::new(axes.iter().map(panel).collect::<Vec<_>>()), caption }
}

/// Root mean square over `rows` rows around each.
fn level(values: &[f64], rows: usize) -> Vec<f64> {
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(values.iter().scan(0.0, |sum, e| {
            *sum += e * e;
            Some(*sum)
        }))
        .collect();
    let around = |row: usize| {
        let (from, to) = (row.saturating_sub(rows / 2), (row + rows / 2 + 1).min(values.len()));
        ((sums[to] - sums[from]).max(0.0) / (to - from) as f64).sqrt()
    };
    (0..values.len()).map(around).collect()
}

fn time() -> report::Axis {
    report::Axis::new("time", "s")
}

/// The residual of one axis over a quantity that it may depend on.
pub(crate) fn residual_against(views: &[View], axis: Axis, quantity: &str) -> Option<Figure> {
    let unit = views.first()?.condition(quantity)?.unit;
    let points: Vec<(f64, f64)> = views
        .iter()
        .filter_map(|view| Some((view.condition(quantity)?, view.residual(axis))))
        .flat_map(|(quantity, residual)| quantity.values.iter().copied().zip(residual.iter().copied()))
        .collect();
    let title = format!("Residual of the {} over {quantity}", axis_name(axis));
    Some(binned_scatter(&title, report::Axis::new(quantity, unit), residual_axis(axis), &points, BINS))
}

pub(crate) fn residual_axis(axis: Axis) -> report::Axis {
    report::Axis::new(format!("measured − predicted {}", axis.name()), axis.unit())
}

/// What an effect acts through in a row, over all rows of all flights, and the axis that it is drawn on.
struct Through {
    axis: report::Axis,
    values: Vec<f64>,
}

impl Through {
    /// Where an effect declares nothing, as a user's does, what it adds to the prediction stands for it.
    fn new(effect: Effect, axis: Axis, flights: &[&Prepared], model: &Model, seen: [&[View]; 2]) -> Self {
        if let Some(quantity) = effect.info().acts_through(axis).and_then(Quantity::named) {
            let values = flights.iter().flat_map(|flight| flight.quantity(model, quantity)).collect();
            return Self {
                axis: report::Axis::new(quantity.meaning, quantity.unit_for(model.rotor_quantity())),
                values,
            };
        }
        let [without, with] = seen;
        let values = std::iter::zip(without, with)
            .flat_map(|(b, a)| std::iter::zip(b.residual(axis), a.residual(axis)).map(|(b, a)| b - a))
            .collect();
        Self { axis: report::Axis::new(format!("what {effect} adds to the prediction"), axis.unit()), values }
    }
}

/// The residual in which an effect shows most, over what the effect acts through, by two models that differ in it alone, of which `model` has it: the
/// means, over the cloud of the model without it.
pub(crate) fn residual_with_and_without(
    effect: Effect,
    flights: &[&Prepared],
    model: &Model,
    [without, with]: [&[View]; 2],
) -> Option<Captioned> {
    let axis = clearest_axis(effect, without, with)?;
    let through = Through::new(effect, axis, flights, model, [without, with]);
    let points = |views: &[View]| -> Vec<(f64, f64)> {
        let residual = views.iter().flat_map(|view| view.residual(axis).iter().copied());
        through.values.iter().copied().zip(residual).collect()
    };
    let means = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        bin_statistics(points, BINS).iter().map(|bin| (bin.x, bin.mean)).collect()
    };
    let (cloud, after) = (points(without), points(with));
    let shares = [&cloud, &after].map(|points| percent(100.0 * share(points)));
    let (means_without, means_with) = (means(&cloud), means(&after));
    let title = format!("Residual of the {}", axis_name(axis));
    let figure = Figure::new(title, through.axis, residual_axis(axis))
        .mark(Mark::Horizontal { name: String::new(), y: 0.0, style: Style::Reference })
        .with(Series::points("samples without it", Style::Muted, cloud))
        .with(Series::line("mean without it", Style::PredictedBefore, means_without.clone()))
        .with(Series::points("", Style::PredictedBefore, means_without))
        .with(Series::line("mean with it", Style::PredictedAfter, means_with.clone()))
        .with(Series::points("", Style::PredictedAfter, means_with));
    let caption = format!(
        "A model that knows the effect leaves means on the zero line. The means account for {} % of the squared residual \
         without the effect, and for {} % with it.",
        shares[0], shares[1]
    );
    Some(Captioned { panels: figure.into(), caption })
}

/// Share of the squared residual that its mean in each range of the condition accounts for.
fn share(points: &[(f64, f64)]) -> f64 {
    let total: f64 = points.iter().map(|(_, e)| e * e).sum();
    let means: f64 = bin_statistics(points, BINS).iter().map(|b| b.count as f64 * b.mean * b.mean).sum();
    if total > 0.0 { means / total } else { 0.0 }
}

/// Mean error of open-loop prediction over the number of samples predicted, for one or two models.
pub(crate) fn prediction_error(first: &[HorizonError], after: Option<&[HorizonError]>) -> Captioned {
    type Quantity = (&'static str, &'static str, fn(&HorizonError) -> f64);
    let quantities: [Quantity; 4] = [
        ("position", "mm", |e| 1e3 * e.position_m),
        ("velocity", "mm/s", |e| 1e3 * e.velocity_m_s),
        ("attitude", "mrad", |e| 1e3 * e.attitude_rad),
        ("rate", "mrad/s", |e| 1e3 * e.rate_rad_s),
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
    let caption = "Mean error of predictions started from every sample of the flights with no knowledge of the future \
                   except the motor commands and the battery voltage.";
    Captioned { panels: Panels::new(figures), caption: caption.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_level_of_an_error_is_its_root_mean_square_nearby() {
        let mut values = vec![3.0; 100];
        values[50..].fill(-1.0);
        let level = level(&values, 10);
        assert!((level[20] - 3.0).abs() < 1e-12 && (level[99] - 1.0).abs() < 1e-12);
        // Around row 50 there are five values of 3 and six of -1.
        assert!((level[50] - ((5.0 * 9.0 + 6.0) / 11.0_f64).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn means_account_for_all_of_a_dependence_and_for_nothing_of_noise() {
        let depends: Vec<(f64, f64)> =
            (0..1600).map(|k| (f64::from(k / 100), f64::from(k / 100) - 8.0)).collect();
        assert!((share(&depends) - 1.0).abs() < 1e-12);
        let alternates: Vec<(f64, f64)> =
            (0..1600).map(|k| (f64::from(k / 100), if k % 2 == 0 { 1.0 } else { -1.0 })).collect();
        assert!(share(&alternates) < 1e-12);
    }
}
