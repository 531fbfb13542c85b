//! The whole check of a model and its gains.

use control::Config;
use control::gains::Law;
use model::Model;

use super::battery::battery_reports;
use super::loops::{disturbance_report, loop_report, moved_zeros, step_report};
use super::report::{CheckOptions, CheckReport};
use super::uncertainty::{has_errors, uncertainty};
use crate::analysis::{Study, extrapolated, steady_tilts};
use crate::error::Result;
use crate::loops::View;

/// Checks gains on a model.
pub fn check(model: &Model, config: &Config, options: &CheckOptions) -> Result<CheckReport> {
    let study = Study::new(model, config, options.view)?;
    let margins = study.margins()?;
    let mut notes = notes(model, config, &study, options.view);
    let (mut steps, mut disturbances) = (Vec::new(), Vec::new());
    for ((plant, closed), (name, margins)) in study.loops.iter().zip(&margins) {
        if !margins.stable {
            notes.push(format!("{name}: the closed loop is unstable, so it has no step response"));
            continue;
        }
        steps.push(step_report(config, closed)?);
        disturbances.push(disturbance_report(config, plant, closed, options.view)?);
    }
    let battery = battery_reports(model, config, options.view)?;
    let loops = study
        .loops
        .iter()
        .zip(&margins)
        .map(|((_, closed), (_, margins))| loop_report(closed, margins))
        .collect::<Result<Vec<_>>>()?;
    let together = study.together(model, config, options.view)?;
    let uncertainty = uncertainty(model, config, options);
    let holds = together.stable
        && loops.iter().all(|l| l.stable)
        && battery.iter().all(|b| b.loops.iter().all(|l| l.stable))
        && uncertainty.as_ref().is_none_or(|u| u.unstable + u.failed == 0);
    let steady_tilts = steady_tilts(model)?;
    notes.extend(extrapolated(model, &steady_tilts));
    Ok(CheckReport {
        vehicle: model.vehicle.name.clone(),
        view: match options.view {
            View::Continuous => "continuous",
            View::Sampled { .. } => "sampled",
        },
        delay_samples: match options.view {
            View::Continuous => None,
            View::Sampled { delay_samples } => Some(delay_samples),
        },
        holds,
        together,
        loops,
        steps,
        disturbances,
        moved_zero: moved_zeros(config, &study, options.view)?,
        uncertainty,
        battery,
        steady_tilts,
        notes,
    })
}

fn notes(model: &Model, config: &Config, study: &Study, view: View) -> Vec<String> {
    let mut notes = Vec::new();
    if study.linear.motor_lag_rad_s.is_none() {
        notes.push(
            "the model has no motor lag: the loops are computed without one, so their margins are too large"
                .into(),
        );
    }
    if study.linear.input_delay_s > 0.0 && view == View::Continuous {
        notes.push(format!(
            "the model's dead time of {:.4} s is left out of the continuous view",
            study.linear.input_delay_s
        ));
    }
    if view == View::Continuous {
        notes.push(
            "continuous as in the thesis: roll and pitch with the velocity estimator, a pure derivative in its place in the yaw and altitude loops and around the position loops"
                .into(),
        );
    }
    for (plant, _) in &study.loops {
        for note in &plant.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
    }
    if !has_errors(model) {
        notes.push(
            "the model has no standard errors, so there is no spread of margins over its uncertainty".into(),
        );
    }
    if let Law::HandTuned(_) = config.law {
        notes.push("hand-tuned law: the loops' outputs are motor commands, (4.5)".into());
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a check cannot know it says: no lag, no standard errors, a hand-tuned law.
    #[test]
    fn what_is_missing_is_noted() {
        let mut model = Model::thesis();
        model.vehicle.motors.lag = None;
        let options = CheckOptions { view: View::Continuous, samples: 5, seed: 0 };
        let report = check(&model, &Config::thesis(), &options).unwrap();
        let said = |what: &str| report.notes.iter().any(|note| note.contains(what));
        assert!(
            said("no motor lag") && said("no standard errors") && !said("hand-tuned"),
            "{:?}",
            report.notes
        );
        assert_eq!((report.uncertainty, report.view, report.delay_samples), (None, "continuous", None));
        let tuned = check(&Model::thesis(), &Config::thesis_hand_tuned(), &options).unwrap();
        assert!(tuned.notes.iter().any(|note| note.contains("hand-tuned")));
    }
}
