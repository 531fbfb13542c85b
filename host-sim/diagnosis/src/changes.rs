//! The model was good once: what has changed since?
//!
//! The model's parameters stay; the residual of new flights is explained by one change at a time: a heavier craft, a weak
//! motor, a wind, a shifted battery. The same standard of evidence as in [`diagnose`](crate::diagnose): each change is
//! estimated on all new flights but one and validated on that one (blocks of time where there is a single flight).
//!
//! A real craft differs a little from flight to flight (trim, battery seat, tracker calibration). How much, is known
//! from the flights the model was made from: the model file holds how far each change's estimate scatters between them.
//! A change must stand out from that scatter, not only from the noise.

use std::ops::ControlFlow;

use model::{ChangeScatter, Model};
use nalgebra::{DMatrix, DVector};
use report::number::{percent, with_error};

use crate::change::Change;
use crate::criteria::{AS_GOOD, Asked, Evidence, RIVAL, SIGNIFICANCE, weigh};
use crate::figures::rms_of;
use crate::finding::{CoefficientFigures, Diagnosis, EffectFinding, Verdict};
use crate::held_out::take_gain;
use crate::observer::Observer;
use crate::reason::{Reason, joined};
use crate::search_error::{SearchError, Steps, going_on};
use crate::significance::{independent_stretches, zero_p_value};
use crate::unidentified::{recorded, verdicts_of_change};
use sysid::fit::gauss_newton::{self, Linearised, Problem, Rule};
use sysid::fit::least_squares::{FlightRows, Prior, Solution, Unidentifiable};
use sysid::fit::linearise::About;
use sysid::fit::step_end;
use sysid::fit::swing::Known;
use sysid::prepare::Prepared;
use sysid::{FitError, Residuals, residuals};

/// Most Gauss-Newton steps.
const MAX_STEPS: usize = 8;
/// A step this small against its standard error is the last.
const CONVERGED: f64 = 0.01;
/// Part of its gain that a change loses in rank for each coefficient: of two that explain as much, the simpler comes first.
const FOR_A_COEFFICIENT: f64 = 0.02;

/// A change fitted to flights with the model's parameters fixed.
struct Fitted {
    model: Model,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    sigma: [f64; 6],
}

/// Fits a change to flights, starting from none, on top of `model`.
fn fit_change(model: &Model, change: Change, flights: &[&Prepared]) -> Result<Fitted, FitError> {
    let info = change.effect.info();
    let values = model.term(change.effect).map_or_else(
        || vec![0.0; info.coefficients.len()],
        |t| t.coefficients.iter().map(|c| c.value).collect(),
    );
    let mut problem =
        ChangeFit { change, free: change.coefficients(), flights, changed: model.clone(), values };
    gauss_newton::solve(&mut problem, Rule::of_steps(MAX_STEPS))?
        .ok_or(FitError::NotConverged { effect: info.id, excitation: info.excitation })
}

/// A change that steps lead to what the flights show.
struct ChangeFit<'a> {
    change: Change,
    /// Which coefficients of its effect are unknown.
    free: Vec<usize>,
    flights: &'a [&'a Prepared],
    changed: Model,
    /// All coefficients of its effect.
    values: Vec<f64>,
}

impl ChangeFit<'_> {
    fn rows(&self, flight: &Prepared) -> FlightRows {
        let acts = (&[][..], &[self.change.effect][..]);
        let About { residuals, columns: mut derivatives, .. } =
            About::new(flight, &self.changed, acts, flight.fit_stride(), &Known::default());
        let columns = self.free.iter().map(|&k| std::mem::take(&mut derivatives[k])).collect();
        flight.rows_of_fit(residuals.residual, columns)
    }
}

impl Problem for ChangeFit<'_> {
    type End = Fitted;
    type Error = FitError;

    fn linearise(&mut self) -> Result<Linearised, FitError> {
        self.changed.set(self.change.effect, &self.values);
        let rows = self.flights.iter().map(|flight| self.rows(flight)).collect();
        let known = |k: usize| {
            let prior = self.change.effect.info().coefficients[k].prior;
            prior.map(|deviation| Prior { expected: -self.values[k], deviation })
        };
        Ok(Linearised { rows, priors: self.free.iter().map(|&k| known(k)).collect(), left: None })
    }

    fn unidentifiable(&self, _: Unidentifiable) -> FitError {
        let info = self.change.effect.info();
        FitError::NotExcited {
            effect: info.id,
            coefficient: info.coefficients[self.free[0]].name,
            excitation: info.excitation,
        }
    }

    fn step(&mut self, _: Linearised, solution: Solution) -> Result<ControlFlow<Fitted>, FitError> {
        let mut is_settled = true;
        for (i, &k) in self.free.iter().enumerate() {
            let info = &self.change.effect.info().coefficients[k];
            let step = solution.value[i];
            is_settled &= step.abs() < CONVERGED * solution.covariance[(i, i)].sqrt() + 1e-9 * info.typical;
            self.values[k] = step_end(self.values[k], step, info);
        }
        if !is_settled {
            return Ok(ControlFlow::Continue(()));
        }
        self.changed.set(self.change.effect, &self.values);
        let free = self.free.iter().map(|&k| self.values[k]);
        Ok(ControlFlow::Break(Fitted {
            values: DVector::from_iterator(self.free.len(), free),
            model: self.changed.clone(),
            covariance: solution.covariance,
            sigma: solution.sigma,
        }))
    }
}

/// How far each change's estimate scatters between the flights a model was made from: for the model file.
pub fn scatter(model: &Model, flights: &[&Prepared]) -> Vec<ChangeScatter> {
    let mut result = Vec::new();
    for change in Change::all(model) {
        let names = change.coefficients().into_iter().map(|k| change.effect.info().coefficients[k].name);
        let estimates: Vec<Fitted> =
            flights.iter().filter_map(|flight| fit_change(model, change, &[flight]).ok()).collect();
        if estimates.len() < 2 {
            continue;
        }
        // Each flight had its part in the model that it is held against; a new one has none.
        let count = estimates.len() as f64;
        let of_a_new_one = count / (count - 1.0);
        for (i, name) in names.enumerate() {
            // About zero, not about the mean: the model is the reference.
            let mean_square = estimates.iter().map(|e| e.values[i] * e.values[i]).sum::<f64>() / count;
            result.push(ChangeScatter {
                effect: change.effect.id().into(),
                coefficient: name.into(),
                deviation: of_a_new_one * mean_square.sqrt(),
            });
        }
    }
    result
}

/// Names the one of `changes` that explains new flights, with the model's parameters as they are.
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
    let score = |f: &EffectFinding| f.gain * (1.0 - FOR_A_COEFFICIENT * f.coefficients.len() as f64);
    findings.sort_by(|a, b| b.1.supported.cmp(&a.1.supported).then(score(&b.1).total_cmp(&score(&a.1))));
    mark_rivals(model, &mut findings, flights, (changes.len(), observer))?;
    let best = findings.iter().find(|(_, f)| f.supported);
    let verdict = if best.is_some() { Verdict::MissingEffect } else { Verdict::Adequate };
    Ok(Diagnosis {
        verdict,
        verdicts: verdicts_of_change(model, verdict, best.map(|(change, _)| change.effect)),
        summary: summary(best),
        effects: findings.into_iter().map(|(_, finding)| finding).collect(),
        unexplained: Vec::new(),
        not_identified: recorded(model),
    })
}

/// The conclusion in sentences.
fn summary(best: Option<&(Change, EffectFinding)>) -> String {
    let Some((change, finding)) = best else {
        return "No change stands out from the scatter between the flights that the model was fitted to."
            .into();
    };
    let size: Vec<String> = finding
        .coefficients
        .iter()
        .map(|c| format!("{} = {}", c.name, with_error(c.value, c.std_error, c.unit)))
        .collect();
    let rivals = match &finding.reason {
        Reason::Changed { rivals, .. } if !rivals.is_empty() => {
            format!(" These flights cannot tell it from {}.", joined(rivals, ", "))
        }
        _ => String::new(),
    };
    format!(
        "Since the model was fitted, one thing has changed: {change} ({}). With it, the {} falls by {} % on flights that \
         it was not estimated from.{rivals}",
        size.join(", "),
        rms_of(change.effect.info().axes),
        percent(finding.rms_fall_percent())
    )
}

/// Changes that explain nearly as much as the best, and add nothing to it nor it to them, cannot be told from it.
fn mark_rivals(
    model: &Model,
    findings: &mut [(Change, EffectFinding)],
    flights: &[&Prepared],
    (candidates, observer): (usize, &dyn Observer),
) -> Result<(), SearchError> {
    let Some((best, best_gain)) = findings.first().filter(|(_, f)| f.supported).map(|(c, f)| (*c, f.gain))
    else {
        return Ok(());
    };
    let Ok(with_best) = fit_change(model, best, flights) else { return Ok(()) };
    let mut rivals = Vec::new();
    for (change, finding) in findings.iter_mut().skip(1).filter(|(_, f)| f.supported) {
        going_on(observer)?;
        let as_good = finding.gain > AS_GOOD * best_gain;
        let adds =
            change.effect != best.effect && is_supported(&with_best.model, *change, flights, candidates);
        if adds && !as_good {
            continue;
        }
        let rival = as_good
            || finding.gain > RIVAL * best_gain
                && fit_change(model, *change, flights).is_ok_and(|with| {
                    change.effect == best.effect || !is_supported(&with.model, best, flights, candidates)
                });
        if rival {
            finding.refuse(Reason::RivalOf { best });
            finding.confounded_with.push(best.effect);
            rivals.push(*change);
        } else {
            finding.refuse(Reason::ExplainedBy { other: best });
        }
    }
    rivals.extend(as_good_together(findings, best, best_gain));
    let finding = &mut findings[0].1;
    finding.confounded_with = rivals.iter().map(|rival| rival.effect).collect();
    finding.confounded_with.sort_unstable_by_key(|effect| effect.id());
    finding.confounded_with.dedup();
    let axes = best.effect.info().axes;
    finding.reason = Reason::Changed { axes, percent: finding.drop_percent, rivals };
    Ok(())
}

/// Two other changes that act on different axes and together take away as much as the best one: a weight under a motor, which
/// shifts the centre of mass and adds to the mass, looks like a motor that gives less thrust.
fn as_good_together(findings: &[(Change, EffectFinding)], best: Change, best_gain: f64) -> Vec<Change> {
    let others = || findings.iter().skip(1).filter(|(c, f)| c.effect != best.effect && f.gain > 0.0);
    let apart = |a: Change, b: Change| a.effect.info().axes.iter().all(|x| !b.effect.info().axes.contains(x));
    let mut pair: Option<(f64, [Change; 2])> = None;
    for (a, first) in others().filter(|(_, f)| f.p_value < SIGNIFICANCE) {
        for (b, second) in others().filter(|(b, _)| apart(*a, *b)) {
            let sum = first.gain + second.gain;
            if sum > AS_GOOD * best_gain && pair.is_none_or(|(most, _)| sum > most) {
                pair = Some((sum, [*a, *b]));
            }
        }
    }
    pair.map_or_else(Vec::new, |(_, both)| both.to_vec())
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

fn is_supported(model: &Model, change: Change, flights: &[&Prepared], candidates: usize) -> bool {
    examine(model, change, flights, candidates).finding.supported
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
    let (free, rotors) = (change.coefficients(), model.rotor_quantity());
    let (total, independent) = with_scatter(model, change, &fitted, flights);
    finding.coefficients = free
        .iter()
        .enumerate()
        .map(|(i, &k)| {
            let std_error = total[(i, i)].max(0.0).sqrt();
            CoefficientFigures::new(&info.coefficients[k], fitted.values[i], std_error, rotors)
        })
        .collect();
    let coefficients = free.iter().map(|&k| &info.coefficients[k]);
    let p_value = zero_p_value(fitted.values.as_slice(), &total, coefficients, independent);
    finding.p_value = (p_value * candidates as f64).min(1.0);
    let residuals = cross_validate(model, change, flights, &fitted, &mut finding);
    let std_errors = (0..free.len()).map(|i| fitted.covariance[(i, i)].max(0.0).sqrt()).collect();
    let mut examined = Examined { finding, std_errors, residuals: Some(residuals), has_rotor_map };
    let (supported, reason) = weigh(&examined.evidence());
    (examined.finding.supported, examined.finding.reason) = (supported, reason);
    examined
}

/// The covariance of an estimate with what the base flights scatter by, and what it is known from: a scatter seen in a few flights
/// is itself uncertain (Welch 1947 and Satterthwaite 1946 for the sum). New flights of one day share the trim of that day, so several
/// of them scatter no less than one.
fn with_scatter(
    model: &Model,
    change: Change,
    fitted: &Fitted,
    flights: &[&Prepared],
) -> (DMatrix<f64>, f64) {
    let mut total = fitted.covariance.clone();
    let stretches = independent_stretches(flights);
    let Some(fit) = &model.fit else { return (total, stretches) };
    let base_flights = fit.flights.len().max(2) as f64;
    let mut independent = stretches;
    for (i, k) in change.coefficients().into_iter().enumerate() {
        let name = change.effect.info().coefficients[k].name;
        let known = fit.scatter.iter().find(|s| s.effect == change.effect.id() && s.coefficient == name);
        let Some(known) = known else { continue };
        let (noise, scatter) = (total[(i, i)], known.deviation * known.deviation);
        total[(i, i)] = noise + scatter;
        let spread = noise * noise / stretches + scatter * scatter / base_flights;
        if spread > 0.0 {
            independent = independent.min(total[(i, i)].powi(2) / spread);
        }
    }
    (total, independent)
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
    take_gain(finding, &fitted.sigma, flights, (&before, &after));
    [before, after]
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
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

    /// Two flights that had their part in the model: twice the root of the mean square.
    #[test]
    fn the_scatter_is_about_the_model_and_that_of_a_new_flight() {
        let flights = prepared(&truth(), 30..32, 4.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let scatter = scatter(&truth(), &flights);
        let mass = scatter.iter().find(|s| s.effect == "mass-change").unwrap();
        let [a, b] = [0, 1].map(|k| fit_change(&truth(), HEAVIER, &[flights[k]]).unwrap().values[0]);
        assert!((mass.deviation / (2.0 * (0.5 * (a * a + b * b)).sqrt()) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_single_flight_scatters_from_nothing_and_no_flight_tells_of_no_change() {
        let flights = prepared(&truth(), 30..31, 4.0, &ORDINARY);
        assert!(scatter(&truth(), &[&flights[0]]).is_empty());
        assert_eq!(changed(&truth(), &[], &[], &Silent).err(), Some(FitError::NoFlights.into()));
    }

    /// What base flights scatter by adds to the variance of an estimate, and is known from few of
    /// them.
    #[test]
    fn the_scatter_of_the_base_flights_adds_to_the_error() {
        let flights = prepared(&truth(), 30..31, 10.0, &ORDINARY);
        let flights = [&flights[0]];
        let fitted = fit_change(&truth(), HEAVIER, &flights).unwrap();
        let mut model = truth();
        let (bare, stretches) = with_scatter(&model, HEAVIER, &fitted, &flights);
        assert_eq!(bare, fitted.covariance);
        model.fit = Some(model::FitRecord {
            scatter: vec![ChangeScatter {
                effect: "mass-change".into(),
                coefficient: "extra_mass".into(),
                deviation: 0.3,
            }],
            ..Default::default()
        });
        let (total, independent) = with_scatter(&model, HEAVIER, &fitted, &flights);
        assert!((total[(0, 0)] - bare[(0, 0)] - 0.09).abs() < 1e-12);
        // Two flights at least are behind a scatter, next to which the noise is nothing.
        assert!((independent - 2.0).abs() < 0.1 && stretches > independent, "{independent} {stretches}");
    }

    #[test]
    fn nothing_that_stands_out_is_said_so_and_what_does_with_its_size_and_rivals() {
        assert_eq!(
            summary(None),
            "No change stands out from the scatter between the flights that the model was fitted to."
        );
        let (change, mut found) = finding(Effect::MassChange, None, 5.0);
        found.drop_percent = 61.27;
        let (name, unit) = ("extra_mass", "kg");
        found.coefficients = vec![CoefficientFigures { name, value: 0.1512, std_error: 0.0123, unit }];
        let rival = Change { effect: Effect::MotorEfficiency, motor: Some(2) };
        found.reason =
            Reason::Changed { axes: Effect::MassChange.info().axes, percent: 61.27, rivals: vec![rival] };
        assert_eq!(
            summary(Some(&(change, found))),
            "Since the model was fitted, one thing has changed: mass-change (extra_mass = 0.151 ± 0.012 kg). With it, \
             the rms error of w falls by 37.8 % on flights that it was not estimated from. These flights \
             cannot tell it from motor-efficiency of motor 2."
        );
    }

    /// Mass acts on forces and the centre of mass on moments: 60 and 35 are more than nine tenths
    /// of 100.
    #[test]
    fn two_changes_on_different_axes_rival_one_that_they_explain_together() {
        let best = finding(Effect::MotorEfficiency, Some(1), 100.0);
        let pair = |mass_gain: f64| {
            let findings = [
                best.clone(),
                finding(Effect::MotorEfficiency, Some(2), 99.0),
                finding(Effect::MassChange, None, mass_gain),
                finding(Effect::ComOffset, None, 35.0),
            ];
            let pair = as_good_together(&findings, best.0, 100.0);
            pair.iter().map(|change| change.effect).collect::<Vec<_>>()
        };
        assert_eq!(pair(60.0), [Effect::MassChange, Effect::ComOffset]);
        assert!(pair(54.0).is_empty());
    }
}
