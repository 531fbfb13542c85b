//! The least squares of a run: its unknowns, its rows, its residuals. `fit.rs` solves it.

use flights::median_step;
use sysid::fit::least_squares::FlightRows;

use super::craft_log::CraftLog;
use super::error::MotorMapError;
use super::result::Estimated;
use super::rows::{Point, Shape, combined, rows};
use super::terms::Terms;

/// Shortest run, s.
pub(super) const NEEDED_S: f64 = 5.0;

pub(super) struct Run<'a> {
    pub(super) craft: &'a CraftLog,
    /// Points of each motor.
    pub(super) points: Vec<Vec<Point>>,
    pub(super) middle_s: f64,
}

/// A fit of motors that share a map.
#[derive(Debug, Clone)]
pub(super) struct Fitted {
    pub(super) coefficients: Vec<Estimated>,
    pub(super) shape: Shape,
    /// Standard errors of lag, offset, skew.
    pub(super) errors: [f64; 3],
    pub(super) rms: f64,
    pub(super) rows: usize,
}

/// Which parts of the shape are searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Free {
    LagAndClock,
    Lag,
}

impl Run<'_> {
    pub(super) fn too_short(&self) -> MotorMapError {
        let rotor_s = self.points.iter().filter_map(|p| Some(p.last()?.time_s - p.first()?.time_s));
        MotorMapError::TooShort {
            craft_s: self.craft.duration_s(),
            rotor_s: rotor_s.fold(0.0, f64::max),
            needed_s: NEEDED_S,
        }
    }

    pub(super) fn assemble(
        &self,
        motors: &[usize],
        terms: Terms,
        shape: Shape,
        coefficients: &[f64],
        free: Free,
    ) -> Vec<FlightRows> {
        motors
            .iter()
            .map(|&motor| {
                let points = &self.points[motor];
                let rows = rows(self.craft, motor, terms, points, shape, self.middle_s);
                let times: Vec<f64> = rows.points.iter().map(|&k| points[k].time_s).collect();
                let target: Vec<f64> = rows.points.iter().map(|&k| points[k].speed).collect();
                let mut columns = rows.features;
                if !coefficients.is_empty() {
                    columns.push(combined(&rows.by_lag, coefficients));
                    if free == Free::LagAndClock {
                        let by_time = combined(&rows.by_time, coefficients);
                        let late = times.iter().map(|t| t - self.middle_s);
                        let by_skew = by_time.iter().zip(late).map(|(slope, t)| slope * t).collect();
                        columns.push(by_time);
                        columns.push(by_skew);
                    }
                }
                let period_s = median_step(&times).max(1e-4);
                let starts = std::iter::once(0)
                    .chain((1..times.len()).filter(|&k| times[k] - times[k - 1] > 10.0 * period_s))
                    .collect();
                let rest = || vec![0.0; target.len()];
                FlightRows {
                    targets: [target.clone(), rest(), rest(), rest(), rest(), rest()],
                    columns: columns.into_iter().map(|c| [Some(c), None, None, None, None, None]).collect(),
                    starts,
                    period_s,
                }
            })
            .collect()
    }

    /// Measured less predicted of one motor: index of the point and residual.
    pub(super) fn residuals(&self, motor: usize, terms: Terms, fitted: &Fitted) -> Vec<(usize, f64)> {
        let points = &self.points[motor];
        let rows = rows(self.craft, motor, terms, points, fitted.shape, self.middle_s);
        let weights: Vec<f64> = fitted.coefficients.iter().map(|c| c.value).collect();
        let predicted = combined(&rows.features, &weights);
        rows.points.iter().zip(predicted).map(|(&k, p)| (k, points[k].speed - p)).collect()
    }
}
