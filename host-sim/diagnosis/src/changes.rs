//! The model was good once: what has changed since?
//!
//! The model's parameters stay; the residual of new flights is explained by one change at a time: a heavier craft, a weak
//! motor, a wind, a shifted battery (`change_fit.rs`), and what adds to the best of them (`change_rivals.rs`). The same standard of evidence as in [`diagnose`](crate::diagnose): each change is
//! estimated on all new flights but one and validated on that one (blocks of time where there is a single flight).
//!
//! A real craft differs a little from flight to flight (trim, battery seat, tracker calibration). How much, is known
//! from the flights the model was made from: the model file holds how far each change's estimate scatters between them.
//! A change must stand out from that scatter, not only from the noise. What no change accounts for is looked for by the errors of
//! those flights, too (`change_structure.rs`).

use model::Model;

use crate::anchor::Anchor;
use crate::balance;
use crate::change::Change;
use crate::change_conclusion::{OfRows, conclude};
use crate::change_fit::{Fitted, fit_change};
use crate::change_rivals::{Together, mark_rivals};
use crate::change_scatter::Scattered;
use crate::change_structure::structure_left;
use crate::criteria::{Asked, Evidence, rank_of_change, weigh};
use crate::finding::{CoefficientFigures, Diagnosis, EffectFinding, Unexplained};
use crate::held_out::{judged_axes, take_gain};
use crate::observer::Observer;
use crate::onset::onset;
use crate::reason::{Dependence, Reason};
use crate::search_error::{SearchError, Steps};
use crate::significance::zero_p_value;
use sysid::prepare::Prepared;
use sysid::{FitError, Residuals, residuals};

/// Names those of `changes` that explain new flights, with the model's parameters as they are.
pub fn changed(
    model: &Model,
    changes: &[Change],
    flights: &[&Prepared],
    observer: &dyn Observer,
) -> Result<Diagnosis, SearchError> {
    if flights.is_empty() {
        return Err(FitError::NoFlights.into());
    }
    let mut findings: Vec<(Change, EffectFinding)> = Vec::new();
    let mut steps = Steps::new(observer, changes.len());
    for &change in changes {
        steps.next(&format!("trying {change}"))?;
        findings.push((change, examine(model, change, flights, changes.len()).finding));
    }
    let score = |f: &EffectFinding| rank_of_change(f.gain, f.coefficients.len());
    findings.sort_by(|a, b| b.1.supported.cmp(&a.1.supported).then(score(&b.1).total_cmp(&score(&a.1))));
    let mut together = mark_rivals(model, &mut findings, flights, (changes, observer))?;
    let mut left = structure_left(together.as_ref().map_or(model, |with| &with.model), flights);
    let named = findings.iter_mut().map(|(_, finding)| finding).find(|finding| finding.supported);
    let refused = named.and_then(|finding| stands_in(finding, &left).map(|why| (finding, why)));
    if let Some((finding, why)) = refused {
        finding.refuse(why);
        together = None;
        left = structure_left(model, flights);
    }
    let together = together.unwrap_or_else(|| Together::none(model));
    let others = together.without_best(model, flights);
    let named = findings.iter().find(|(_, finding)| finding.supported);
    let began = named.and_then(|(change, finding)| onset(&others, (*change, finding), flights));
    let Together { changes: happened, revealed, .. } = together;
    let rows = OfRows { findings, began, happened, revealed, left };
    Ok(conclude(model, rows, balance::answer(model, flights, changes)))
}

/// Why the best change is none: bursts are left of an axis that are more of its error than the change takes away anywhere. Another
/// craft overhead presses this one down again and again, and drags a little air along all the time.
fn stands_in(finding: &EffectFinding, left: &[Unexplained]) -> Option<Reason> {
    let takes_percent = finding.largest_drop_percent();
    let of_whole = |u: &Unexplained| {
        let taken_percent = finding.axes.get(u.axis.name()).map_or(0.0, |axis| axis.drop_percent);
        u.share_percent * (1.0 - 0.01 * taken_percent)
    };
    let bursts = left.iter().find(|u| u.depends_on == Dependence::Bursts && of_whole(u) > takes_percent)?;
    let Unexplained { axis, depends_on, share_percent: left_percent, .. } = *bursts;
    Some(Reason::LeavesMore { takes_percent, left_percent, axis, depends_on })
}

/// The evidence for a change by itself.
pub(crate) struct Examined {
    pub(crate) finding: EffectFinding,
    /// Standard errors of its coefficients, without what flights differ by anyway.
    std_errors: Vec<f64>,
    /// Residuals of each flight without the change, and with it as it was estimated from the others.
    pub(crate) residuals: Option<[Vec<Residuals>; 2]>,
    has_rotor_map: bool,
}

impl Examined {
    /// What the rules look at.
    pub(crate) fn evidence(&self) -> Evidence<'_> {
        Evidence {
            asked: Asked::Changed,
            finding: &self.finding,
            std_errors: self.std_errors.clone(),
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
        return Examined { finding, std_errors: Vec::new(), residuals: None, has_rotor_map };
    };
    let free = change.coefficients();
    let Scattered { total, from_usual, tested, independent } = Scattered::of(model, change, &fitted, flights);
    finding.coefficients = free
        .iter()
        .enumerate()
        .map(|(i, &k)| {
            // What is uncertain in proportion to the size says nothing against there being a change.
            let std_error = total[(i, i)].max(0.0).sqrt().hypot(fitted.law_error * fitted.values[i]);
            CoefficientFigures::new(&info.coefficients[k], fitted.values[i], std_error, model)
        })
        .collect();
    finding.anchor = Anchor::of(&finding, flights);
    let coefficients = free.iter().map(|&k| &info.coefficients[k]);
    let p_value = zero_p_value(from_usual.as_slice(), &tested, coefficients, independent);
    finding.p_value = (p_value * candidates as f64).min(1.0);
    let residuals = cross_validate(model, change, flights, &fitted, &mut finding);
    let std_errors = (0..free.len()).map(|i| fitted.covariance[(i, i)].max(0.0).sqrt()).collect();
    let mut examined = Examined { finding, std_errors, residuals: Some(residuals), has_rotor_map };
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
    use model::{Axis, Effect};

    use super::*;
    use crate::finding::AxisDrop;
    use crate::observer::Silent;
    use crate::testing::{ORDINARY, prepared, truth};

    const HEAVIER: Change = Change { effect: Effect::MassChange, motor: None };

    fn finding(effect: Effect, motor: Option<u8>, gain: f64) -> (Change, EffectFinding) {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        (finding.gain, finding.p_value) = (gain, 0.0);
        (Change { effect, motor }, finding)
    }

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

    #[test]
    fn no_flight_tells_of_no_change() {
        assert_eq!(changed(&truth(), &[], &[], &Silent).err(), Some(FitError::NoFlights.into()));
    }

    /// Bursts that are 90 % of p are more than a wind takes of u, unless that is more: and what is left of u counts as the part of all of it.
    #[test]
    fn bursts_beyond_what_a_change_takes_refuse_it() {
        let burst = |axis, share_percent| Unexplained {
            axis,
            depends_on: Dependence::Bursts,
            share_percent,
            p_value: 0.0,
        };
        let wind = |percent: f64| {
            let mut wind = finding(Effect::SteadyWind, None, 1.0).1;
            wind.axes.insert("u", AxisDrop::new(100.0, 100.0 - percent));
            wind
        };
        assert!(stands_in(&wind(20.0), &[burst(Axis::P, 90.0)]).is_some());
        assert!(stands_in(&wind(95.0), &[burst(Axis::P, 90.0)]).is_none());
        assert!(stands_in(&wind(60.0), &[burst(Axis::U, 90.0)]).is_none());
        let slow = Unexplained { depends_on: Dependence::SlowChanges, ..burst(Axis::P, 90.0) };
        assert!(stands_in(&wind(20.0), &[slow]).is_none());
    }
}
