//! The map as it is reported, and how single motors differ from it.

use std::collections::BTreeMap;

use super::compare::PART_S;
use super::error::MotorMapError;
use super::fit::LAGS;
use super::result::{Estimated, Map, MotorMap};
use super::run::{Fitted, Free, Run};
use super::terms::Terms;
use crate::stand::Stand;

/// Standard error of the lag, part of it, beyond which it is not known.
const LAG_ERROR: f64 = 0.25;

pub(super) fn map_of(fitted: &Fitted, terms: Terms) -> Map {
    let lag = Estimated { value: fitted.shape.lag, std_error: fitted.errors[0] };
    Map {
        command: fitted.coefficients[0],
        voltage: (terms == Terms::Voltage).then(|| fitted.coefficients[1]),
        offset: fitted.coefficients[fitted.coefficients.len() - 1],
        lag,
        lag_is_known: lag.std_error < LAG_ERROR * lag.value && lag.value < 0.99 * LAGS.1,
        rms_rad_s: fitted.rms,
    }
}

/// Each motor with a map and a lag of its own on the common clock.
pub(super) fn each_motor(
    run: &Run<'_>,
    terms: Terms,
    common: &Fitted,
    stand: &Stand,
) -> Result<Vec<MotorMap>, MotorMapError> {
    (0..run.points.len())
        .map(|motor| {
            let own = run.fit(&[motor], terms, common.shape, Free::Lag)?;
            let faster_rad_s = mean_residual(run, motor, terms, common);
            Ok(MotorMap { motor: stand.motors[motor].number, map: map_of(&own, terms), faster_rad_s })
        })
        .collect()
}

/// Mean of what the common map leaves of a motor, with its error from parts of the run.
pub(super) fn mean_residual(run: &Run<'_>, motor: usize, terms: Terms, common: &Fitted) -> Estimated {
    let residuals = run.residuals(motor, terms, common);
    let mut parts: BTreeMap<i64, (f64, f64)> = BTreeMap::new();
    for (k, e) in &residuals {
        let part = parts.entry((run.points[motor][*k].time_s / PART_S) as i64).or_default();
        *part = (part.0 + e, part.1 + 1.0);
    }
    let means: Vec<f64> = parts.values().map(|(sum, n)| sum / n).collect();
    let count = means.len() as f64;
    let value = means.iter().sum::<f64>() / count;
    let spread = means.iter().map(|m| (m - value).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    Estimated { value, std_error: (spread / count).sqrt() }
}
