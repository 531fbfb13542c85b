//! A flight seen by a model: what is left of it, and what that is judged by.

use model::{Axis, Effect, Model};
use sysid::prepare::conditions::Condition;
use sysid::{Prepared, Residuals, residuals};

/// A flight seen by a model.
pub(crate) struct View {
    pub(crate) name: String,
    period_s: f64,
    pub(crate) residuals: Residuals,
    conditions: Vec<Condition>,
    pub(crate) time_s: Vec<f64>,
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

    /// Points of a series over the whole flight, in seconds from its start; a gap in time breaks the line.
    pub(crate) fn line(&self, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let start = self.time_s.first().copied().unwrap_or(0.0);
        let mut points = Vec::with_capacity(self.time_s.len());
        for (row, time_s) in self.time_s.iter().enumerate() {
            if row > 0 && time_s - self.time_s[row - 1] > 3.0 * self.period_s {
                points.push((time_s - start, f64::NAN));
            }
            points.push((time_s - start, value(row)));
        }
        points
    }

    /// How many rows there are in so many seconds.
    pub(crate) fn rows_in(&self, seconds: f64) -> usize {
        (seconds / self.period_s) as usize
    }

    /// What is left of an axis.
    pub(crate) fn residual(&self, axis: Axis) -> &[f64] {
        &self.residuals.residual[axis.index()]
    }

    /// All quantities that residuals are judged by.
    pub(crate) fn conditions(&self) -> impl Iterator<Item = &Condition> {
        self.conditions.iter()
    }

    /// A quantity that residuals are judged by, over the rows.
    pub(crate) fn condition(&self, name: &str) -> Option<&Condition> {
        self.conditions.iter().find(|condition| condition.name == name)
    }
}

/// Squared error of an axis over flights.
pub(crate) fn squared_error(views: &[View], axis: Axis) -> f64 {
    views.iter().flat_map(|view| view.residual(axis)).map(|e| e * e).sum()
}

/// The row in which an effect takes away the largest part of the error.
pub(crate) fn clearest_axis(effect: Effect, before: &[View], after: &[View]) -> Option<Axis> {
    let left = |axis: Axis| squared_error(after, axis) / squared_error(before, axis).max(f64::MIN_POSITIVE);
    effect.info().axes.iter().copied().min_by(|a, b| left(*a).total_cmp(&left(*b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(residual: Vec<f64>) -> View {
        let rows = residual.len();
        let mut residuals = Residuals::default();
        residuals.residual[Axis::W.index()] = residual;
        let time_s = (0..rows).map(|k| 100.0 + k as f64 * 0.01 + if k < 5 { 0.0 } else { 1.0 }).collect();
        View { name: "A".into(), period_s: 0.01, residuals, conditions: Vec::new(), time_s }
    }

    #[test]
    fn a_line_covers_the_whole_flight_and_breaks_at_gaps() {
        let view = view(vec![1.0; 10]);
        let line = view.line(|row| view.residual(Axis::W)[row]);
        assert_eq!(line[0], (0.0, 1.0));
        let last = line[line.len() - 1];
        assert!((last.0 - 1.09).abs() < 1e-9, "{last:?}");
        let gaps: Vec<usize> = (0..line.len()).filter(|&k| line[k].1.is_nan()).collect();
        assert_eq!(gaps, [5], "one more point than rows, before the row after the gap");
    }

    #[test]
    fn the_row_is_drawn_in_which_most_is_taken_away() {
        let with = |w: f64, u: f64| {
            let mut view = view(vec![w; 10]);
            view.residuals.residual[Axis::U.index()] = vec![u; 10];
            view.residuals.residual[Axis::V.index()] = vec![1.0; 10];
            vec![view]
        };
        assert_eq!(
            clearest_axis(Effect::QuadraticDrag, &with(1.0, 2.0), &with(0.9, 0.5)),
            Some(Axis::U),
            "three quarters of u against a tenth of w"
        );
    }
}
