//! One loop after the other: margins, poles, responses, and the plant's zero moved.

use control::Config;
use nalgebra::Complex;

use super::report::{ActuatorMargins, DisturbanceReport, LoopReport, MovedZero, Pair, StepReport};
use crate::analysis::{
    Band, LONG_S, LoopMargins, Margins, Response, Study, bare_step, commanded, disturbance_step,
    least_damped, step_metrics, value_at,
};
use crate::error::Result;
use crate::loops::{
    ClosedLoop, Gain, LoopName, LoopPlant, View, axis_channel, gain_mut, inner_gains, loops_of,
    with_moved_zero,
};

/// Times of the samples in the report, s.
const TIMES_S: [f64; 10] = [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0];
/// Zeros of Table A.1, rad/s; the canceller's own comes first.
const MOVED_ZEROS: [f64; 15] =
    [0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];

fn pairs(values: &[Complex<f64>]) -> Vec<Pair> {
    values.iter().map(|z| [z.re, z.im]).collect()
}

pub(super) fn loop_report(closed: &ClosedLoop, margins: &LoopMargins) -> Result<LoopReport> {
    let poles = closed.closed.poles()?;
    let (error, actuator) = (&margins.at_error, &margins.at_actuator);
    Ok(LoopReport {
        name: closed.name.name(),
        stable: margins.stable,
        phase_margin_deg: error.phase_margin_deg,
        gain_margin: error.gain_margin,
        gain_reduction_margin: error.gain_reduction_margin,
        crossover_rad_s: error.crossover_rad_s,
        phase_crossover_rad_s: error.phase_crossover_rad_s,
        delay_margin_s: margins.delay_margin_s,
        sensitivity_peak: error.sensitivity_peak,
        sensitivity_peak_rad_s: error.sensitivity_peak_rad_s,
        at_actuator: ActuatorMargins {
            phase_margin_deg: actuator.phase_margin_deg,
            gain_margin: actuator.gain_margin,
            gain_reduction_margin: actuator.gain_reduction_margin,
            crossover_rad_s: actuator.crossover_rad_s,
            phase_crossover_rad_s: actuator.phase_crossover_rad_s,
            sensitivity_peak: actuator.sensitivity_peak,
            sensitivity_peak_rad_s: actuator.sensitivity_peak_rad_s,
        },
        least_damped: least_damped(&poles, closed.closed.period_s.unwrap_or(0.0)),
        poles: pairs(&poles),
    })
}

pub(super) fn step_report(config: &Config, closed: &ClosedLoop) -> Result<StepReport> {
    let step = commanded(config, closed)?;
    let bare = bare_step(closed, LONG_S)?;
    let sample = |at: &f64| value_at(&step.values, step.period_s, *at).map(|y| [*at, y]);
    Ok(StepReport {
        name: closed.name.name(),
        commanded: step_metrics(&step.values, step.period_s),
        samples: TIMES_S.iter().filter_map(sample).collect(),
        without_prefilter: step_metrics(&bare.values, bare.period_s),
    })
}

pub(super) fn disturbance_report(
    config: &Config,
    plant: &LoopPlant,
    closed: &ClosedLoop,
    view: View,
) -> Result<DisturbanceReport> {
    let name = closed.name;
    let response = disturbance_step(closed, LONG_S)?;
    let mut without = *config;
    *gain_mut(&mut without, name, Gain::Integral) = 0.0;
    let without = ClosedLoop::new(&without, plant, name, view)?;
    let without = disturbance_step(&without, LONG_S)?;
    let last = |response: &Response| response.values.last().copied().unwrap_or(0.0);
    let (at, peak) = response
        .values
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .map_or((0, 0.0), |(k, y)| (k, *y));
    Ok(DisturbanceReport {
        name: name.name(),
        unit: match name {
            LoopName::Z => "m/N",
            LoopName::X | LoopName::Y => "m/(rad/s^2)",
            _ => "rad/(rad/s^2)",
        },
        peak,
        peak_s: at as f64 * response.period_s,
        last: last(&response),
        last_without_integral: last(&without),
    })
}

pub(super) fn moved_zeros(config: &Config, study: &Study, view: View) -> Result<Vec<MovedZero>> {
    let mut rows = Vec::new();
    for name in [LoopName::Roll, LoopName::Pitch] {
        let Some(canceller) = inner_gains(loops_of(config), name).canceller else { continue };
        let channel = axis_channel(&study.linear, name)?;
        if channel.zeros.len() != 1 {
            continue;
        }
        for zero_rad_s in std::iter::once(canceller.pole_rad_s).chain(MOVED_ZEROS) {
            let mut plant = with_moved_zero(&channel, zero_rad_s, study.linear.motor_lag_rad_s)?;
            plant.input_delay_s = study.linear.input_delay_s;
            let closed = ClosedLoop::new(config, &plant, name, view)?;
            let stable = closed.closed.is_stable()?;
            let margins = Margins::of(|w| closed.gain_at_error(w), Band::of(closed.closed.period_s), stable);
            rows.push(MovedZero {
                name: name.name(),
                zero_rad_s,
                phase_margin_deg: margins.phase_margin_deg,
                crossover_rad_s: margins.crossover_rad_s,
            });
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use model::Model;

    use super::*;

    /// The thesis' gains without delay: Table A.1's first row under the canceller, and a
    /// disturbance that the integral part takes away and 1/Kp is left of without it, (B.3).
    #[test]
    fn loops_are_reported_as_the_thesis_has_them() {
        let (model, config, view) = (Model::thesis(), Config::thesis(), View::Continuous);
        let study = Study::new(&model, &config, view).unwrap();
        let rows = moved_zeros(&config, &study, view).unwrap();
        assert_eq!(rows.iter().filter(|row| row.name == "roll").count(), 16);
        // The row without a zero, which holds whatever the model's own zero is.
        let bare = rows.iter().find(|row| row.name == "roll" && row.zero_rad_s == 0.0).unwrap();
        assert!((bare.phase_margin_deg.unwrap() - 47.6618).abs() < 0.02, "{bare:?}");
        let (plant, closed) = &study.loops[LoopName::Z as usize];
        let report = disturbance_report(&config, plant, closed, view).unwrap();
        let kp = loops_of(&config).altitude.kp;
        assert!((report.last_without_integral - 1.0 / kp).abs() < 1e-9 && report.unit == "m/N", "{report:?}");
        assert!(report.last.abs() < 0.1 * report.last_without_integral);
    }
}
