//! The samples behind a fit, for figures.

use super::problem::{Fitted, Problem};
use super::result::Samples;
use super::terms::Terms;
use crate::stand::Stand;

pub(super) fn figures(problem: &Problem<'_>, terms: Terms, fitted: &Fitted, stand: &Stand) -> Samples {
    let mut samples = Samples::default();
    for (index, motor) in stand.motors.iter().enumerate() {
        for (k, residual) in problem.residuals(index, terms, fitted) {
            let point = problem.points[index][k];
            let late_s = fitted.shape.offset_s + fitted.shape.skew * (point.time_s - problem.middle_s);
            let Some(row) = problem.craft.holding(point.time_s + late_s) else { continue };
            samples.motor.push(motor.number);
            samples.time_s.push(point.time_s);
            samples.command.push(problem.craft.command[index][row]);
            samples.battery_v.push(problem.craft.volts[row]);
            samples.measured_rad_s.push(point.speed);
            samples.predicted_rad_s.push(point.speed - residual);
        }
    }
    samples
}
