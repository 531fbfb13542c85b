//! The evidence for one change: estimated on all new flights but one, and validated on that one.

use model::Model;

use crate::anchor::anchor_of;
use crate::change::Change;
use crate::change_fit::{Fitted, fit_change};
use crate::change_scatter::Scattered;
use crate::criteria::{Asked, Evidence, weigh};
use crate::finding::{CoefficientFigures, EffectFinding};
use crate::held_out::{judged_axes, take_gain};
use crate::leaning::{Leaning, leaning};
use crate::reason::Reason;
use crate::significance::zero_p_value;
use crate::tracker_tilt::changed_tilt_deg;
use sysid::prepare::Prepared;
use sysid::{Residuals, residuals};

/// The evidence for a change by itself.
pub(crate) struct Examined {
    pub(crate) finding: EffectFinding,
    /// Standard errors of its coefficients, without what flights differ by anyway.
    std_errors: Vec<f64>,
    /// Residuals of each flight without the change, and with it as it was estimated from the others.
    pub(crate) residuals: Option<[Vec<Residuals>; 2]>,
    leaning: Option<Leaning>,
    has_rotor_map: bool,
}

impl Examined {
    /// What the rules look at.
    pub(crate) fn evidence(&self) -> Evidence<'_> {
        Evidence {
            asked: Asked::Changed,
            finding: &self.finding,
            std_errors: self.std_errors.clone(),
            leaning: self.leaning,
            has_rotor_map: self.has_rotor_map,
        }
    }
}

/// The evidence for a change, one of so many `candidates`.
pub(crate) fn examine(model: &Model, change: Change, flights: &[&Prepared], candidates: usize) -> Examined {
    let info = change.effect.info();
    let fitted = fit_change(model, change, flights);
    let not_weighed = fitted.as_ref().err().map_or(Reason::LikeChance, |e| Reason::Refused(e.clone()));
    let mut finding = EffectFinding::unsupported(change.effect, flights.len(), not_weighed);
    finding.motor = change.motor;
    let has_rotor_map = model.vehicle.has_rotor_map();
    let Ok(fitted) = fitted else {
        return Examined { finding, std_errors: Vec::new(), residuals: None, leaning: None, has_rotor_map };
    };
    let free = change.coefficients();
    let Scattered { total, from_usual, tested, independent } = Scattered::of(model, change, &fitted, flights);
    finding.coefficients = free
        .iter()
        .enumerate()
        .map(|(i, &k)| {
            // What is uncertain in proportion to the size says nothing against there being a change.
            let std_error = total[(i, i)].max(0.0).sqrt().hypot(fitted.law_error * fitted.values[i]);
            CoefficientFigures::of_change((change.effect, k), fitted.values[i], std_error, model)
        })
        .collect();
    finding.tracker_tilt_deg = changed_tilt_deg(model, &fitted.model, change.effect, flights);
    finding.anchor = anchor_of(&finding, flights);
    let coefficients = free.iter().map(|&k| &info.coefficients[k]);
    let p_value = zero_p_value(from_usual.as_slice(), &tested, coefficients, independent);
    finding.p_value = (p_value * candidates as f64).min(1.0);
    let residuals = cross_validate(model, change, flights, &fitted, &mut finding);
    let std_errors = (0..free.len()).map(|i| fitted.covariance[(i, i)].max(0.0).sqrt()).collect();
    let leaning = leaning(model, change, &finding.coefficients);
    let residuals = Some(residuals);
    let mut examined = Examined { finding, std_errors, residuals, leaning, has_rotor_map };
    let (supported, reason) = weigh(&examined.evidence());
    (examined.finding.supported, examined.finding.reason) = (supported, reason);
    examined
}

/// Errors on flights the change was not estimated from, and the residuals without and with it.
fn cross_validate(
    model: &Model,
    change: Change,
    flights: &[&Prepared],
    fitted: &Fitted,
    finding: &mut EffectFinding,
) -> [Vec<Residuals>; 2] {
    let before: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, model)).collect();
    let after: Vec<Residuals> = (0..flights.len())
        .map(|left_out| {
            let rest: Vec<&Prepared> =
                flights.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, f)| *f).collect();
            // A single flight can only be validated on itself; the scatter then guards against chance.
            let other = if rest.is_empty() { None } else { fit_change(model, change, &rest).ok() };
            residuals(flights[left_out], other.as_ref().map_or(&fitted.model, |o| &o.model))
        })
        .collect();
    let judged = (judged_axes(change.effect, model), &fitted.sigma);
    take_gain(finding, judged, flights, (&before, &after));
    [before, after]
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::change::HEAVIER;
    use crate::testing::{ORDINARY, prepared, truth};

    #[test]
    fn a_heavier_craft_is_found_and_weighed() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        let flights = prepared(&heavy, 30..32, 10.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let fitted = fit_change(&truth(), HEAVIER, &flights).unwrap();
        assert!((fitted.values[0] - 0.15).abs() < 0.01, "{}", fitted.values);
        assert!(fitted.covariance[(0, 0)].sqrt() < 0.01);
        // Every other coefficient stays as it was.
        let mut back = fitted.model.clone();
        back.terms.retain(|term| term.effect != Effect::MassChange);
        assert_eq!(back, truth());
        let finding = examine(&truth(), HEAVIER, &flights, 20).finding;
        assert!(finding.supported && finding.drop_percent > 50.0, "{}", finding.reason);
    }

    #[test]
    fn flights_of_the_model_show_no_heavier_craft() {
        let flights = prepared(&truth(), 30..32, 10.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let finding = examine(&truth(), HEAVIER, &flights, 20).finding;
        assert!(!finding.supported);
        assert!(finding.coefficients[0].value.abs() < 0.01, "{:?}", finding.coefficients);
    }
}
