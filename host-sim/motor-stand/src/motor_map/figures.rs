//! The samples behind a fit, for figures.

use super::result::Samples;
use super::run::{Fitted, Run};
use super::terms::Terms;
use crate::stand::Stand;

pub(super) fn figures(run: &Run<'_>, terms: Terms, fitted: &Fitted, stand: &Stand) -> Samples {
    let mut samples = Samples::default();
    for (index, motor) in stand.motors.iter().enumerate() {
        for (k, residual) in run.residuals(index, terms, fitted) {
            let point = run.points[index][k];
            let late_s = fitted.shape.offset_s + fitted.shape.skew * (point.time_s - run.middle_s);
            let Some(row) = run.craft.holding(point.time_s + late_s) else { continue };
            samples.motor.push(motor.number);
            samples.time_s.push(point.time_s);
            samples.command.push(run.craft.command[index][row]);
            samples.battery_v.push(run.craft.volts[row]);
            samples.measured_rad_s.push(point.speed);
            samples.predicted_rad_s.push(point.speed - residual);
        }
    }
    samples
}
