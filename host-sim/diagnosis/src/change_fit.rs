//! One change fitted to new flights, on top of a model whose coefficients stay.
//!
//! But for those that the change brings to light ([`model::Special::reveals`]): a wind takes the craft to airspeeds that it was
//! never flown at, and drag there is what the model extrapolates from slow flight. With the drag held as it is, the wind
//! comes out too strong by what the drag grows: in a wind tunnel by 1.6 to 1.9 times. So both are fitted together, where
//! the flights show that the model's drag does not hold.

use std::ops::ControlFlow;

use model::{Axis, Coefficient, Effect, Model};
use nalgebra::{DMatrix, DVector};

use crate::change::Change;
use crate::significance::independent_stretches;
use crate::tracker_tilt::sideways_at_rest_m_s2;
use sysid::fit::gauss_newton::{self, Linearised, Problem, Rule};
use sysid::fit::least_squares::{FlightRows, Prior, RowColumn, Solution, Unidentifiable};
use sysid::fit::linearise::About;
use sysid::fit::step_end;
use sysid::fit::swing::Known;
use sysid::prepare::Prepared;
use sysid::{FitError, statistics};

/// Most Gauss-Newton steps.
const MAX_STEPS: usize = 8;
/// The same where a wind and the drag in it are fitted together: their product bends more.
const MAX_STEPS_TOGETHER: usize = 24;
/// Where the steps set out, part of the change by itself, and the most halvings of one that leads astray: a wind by itself is too
/// strong by what the drag grows, up to twice.
const ATTEMPTS: [(f64, usize); 3] = [(1.0, 0), (0.6, 0), (0.6, 4)];
/// Rise of the logarithm of what is left from which on a step leads astray.
const WORSE: f64 = 0.01;
/// A step this small against its standard error is the last.
const CONVERGED: f64 = 0.01;
/// How far a coefficient that is held moves, part of an ordinary one.
const HELD: f64 = 1e-6;
/// Largest p-value, of "they are what the model says", of coefficients that are fitted together with a change: as of a
/// finding.
const REVEALED: f64 = 0.01;
/// Part of a coefficient by which it may be off where the model was never flown.
const HOLDS_TO: f64 = 0.25;
/// How far the power of the airspeed with which drag grows in a wind may be from the square: from 1.5, of rotors that lean, to 2.5.
const POWER_ERROR: f64 = 0.5;
/// Part of its size by which a wind may be off where the drag in it could not be fitted: with the drag of slow flight it came out up to
/// 1.9 times too strong in a wind tunnel (neuralfly), which is nearly half of what it came out as.
const UNKNOWN_LAW: f64 = 0.45;

/// A change fitted to flights.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    /// The model with the change, and with what it brought to light.
    pub(crate) model: Model,
    /// By how much the change's coefficients are more than the model's.
    pub(crate) values: DVector<f64>,
    /// Of the change's coefficients, whatever else was fitted.
    pub(crate) covariance: DMatrix<f64>,
    /// Standard deviation of the residual of each axis.
    pub(crate) sigma: [f64; 6],
    /// Effects that were fitted together with it.
    pub(crate) together: Vec<Effect>,
    /// Part of its size by which the change may be off because the law of what was fitted together with it is not known.
    pub(crate) law_error: f64,
}

impl Fitted {
    /// Whether the law of what came to light with it is known, as far as these flights tell.
    pub(crate) fn knows_its_law(&self) -> bool {
        self.law_error < UNKNOWN_LAW
    }
}

/// Fits a change to flights, starting from none, on top of `model`: with what it brings to light, where the flights show that.
pub(crate) fn fit_change(model: &Model, change: Change, flights: &[&Prepared]) -> Result<Fitted, FitError> {
    let alone = fit_alone(model, change, flights)?;
    let revealed: Vec<Effect> = change.effect.reveals().collect();
    if revealed.is_empty() || !goes_beyond(model, &alone) {
        return Ok(alone);
    }
    Ok(match fit_together(model, &alone, change, &revealed, flights) {
        Together::Fitted(together) => *together,
        Together::AsExpected => alone,
        // The change by itself still has an end, though nothing is known of the drag in it.
        Together::NoEnd => Fitted { law_error: UNKNOWN_LAW, ..alone },
    })
}

/// What comes of a change fitted together with what it brings to light.
enum Together {
    Fitted(Box<Fitted>),
    /// The flights agree with what the model says of that.
    AsExpected,
    /// The steps have no end.
    NoEnd,
}

/// Whether a change of the air is beyond what the flights of a model have shown: then drag is extrapolated. Within that, the
/// model's drag was measured, and letting it go would only make it take what else is different.
fn goes_beyond(model: &Model, alone: &Fitted) -> bool {
    is_beyond_flown(model, alone.values.norm())
}

/// Whether the flights of a model have shown no such speed through the air, or it is not known what they have shown.
pub(crate) fn is_beyond_flown(model: &Model, speed_m_s: f64) -> bool {
    let shown_m_s = model.fit.as_ref().and_then(|fit| fit.flown_speed_m_s);
    shown_m_s.is_none_or(|shown| speed_m_s > shown)
}

/// Fits a change to flights with every coefficient of `model` as it is.
pub(crate) fn fit_alone(model: &Model, change: Change, flights: &[&Prepared]) -> Result<Fitted, FitError> {
    fit_jointly((model, model), &[change], flights)
}

/// Fits several changes of a model at once, from where another model has them, with every other coefficient of that as it is. The values
/// are those of one change after the other.
pub(crate) fn fit_jointly(
    (model, from): (&Model, &Model),
    changes: &[Change],
    flights: &[&Prepared],
) -> Result<Fitted, FitError> {
    let mut changed = from.clone();
    for effect in changes.iter().map(|change| change.effect) {
        if !changed.has(effect) {
            changed.set(effect, &vec![0.0; effect.info().coefficients.len()]);
        }
    }
    let changes = changes.to_vec();
    let first = changes[0];
    let mut problem = ChangeFit { model, changes, revealed: Vec::new(), flights, changed, before: None };
    let solved = gauss_newton::solve(&mut problem, Rule::of_steps(MAX_STEPS))?;
    solved.map(|end| end.fitted).ok_or_else(|| not_converged(first))
}

fn not_converged(change: Change) -> FitError {
    let info = change.effect.info();
    FitError::NotConverged { effect: info.id, excitation: info.excitation }
}

/// A change with what it brings to light, from where it ends `alone` on.
fn fit_together(
    model: &Model,
    alone: &Fitted,
    change: Change,
    effects: &[Effect],
    flights: &[&Prepared],
) -> Together {
    let mut start = alone.model.clone();
    let mut revealed = Vec::new();
    for &effect in effects {
        if !start.has(effect) {
            start.set(effect, &vec![0.0; effect.info().coefficients.len()]);
        }
        revealed.extend(Revealed::all(model, effect));
    }
    start = change.undone(&start, model);
    let attempt = |&(part, most_halvings): &(f64, usize)| {
        let mut changed = start.clone();
        change.add(&mut changed, (part * &alone.values).as_slice());
        let (changes, revealed) = (vec![change], revealed.clone());
        let mut problem = ChangeFit { model, changes, revealed, flights, changed, before: None };
        let worse = if most_halvings > 0 { WORSE } else { f64::INFINITY };
        let rule = Rule { most_halvings, worse, ..Rule::of_steps(MAX_STEPS_TOGETHER) };
        let end = gauss_newton::solve(&mut problem, rule).ok()??;
        Some((problem, end))
    };
    let Some((problem, end)) = ATTEMPTS.iter().find_map(attempt) else { return Together::NoEnd };
    let free: Vec<usize> = (0..problem.revealed.len()).filter(|&k| !problem.revealed[k].is_held).collect();
    let difference =
        |k: &usize| problem.revealed[*k].value(&end.fitted.model) - problem.revealed[*k].expected;
    let differences = DVector::from_iterator(free.len(), free.iter().map(difference));
    let covariance = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        // The model's own value is not exact either.
        let own = if i == j { problem.revealed[free[i]].std_error.powi(2) } else { 0.0 };
        end.covariance[(free[i], free[j])] + own
    });
    let p_value = statistics::wald_p_value(&differences, covariance, independent_stretches(flights));
    if p_value >= REVEALED {
        return Together::AsExpected;
    }
    let law_error = law_error(&end.fitted.model, change);
    Together::Fitted(Box::new(Fitted { law_error, ..end.fitted }))
}

/// Part of a wind's size by which it may be off. Force F and slope s are what the flights show of a drag a v + b v^n, and then
/// v = F / (a + (s - a) / n): of the part f of the force that is not linear, dv / v = f / n dn.
fn law_error(model: &Model, change: Change) -> f64 {
    let Some(wind) = model.term(change.effect).map(model::Term::values) else { return 0.0 };
    let drag = |part: f64| {
        let mut model = model.clone();
        model.set(change.effect, &wind.iter().map(|w| part * w).collect::<Vec<_>>());
        sideways_at_rest_m_s2(&model).norm()
    };
    let (whole, half) = (drag(1.0), drag(0.5));
    let beyond_linear = if whole > 0.0 { (2.0 * (whole - 2.0 * half) / whole).clamp(0.0, 1.0) } else { 0.0 };
    0.5 * POWER_ERROR * beyond_linear
}

/// A coefficient that is fitted together with a change.
#[derive(Debug, Clone, Copy)]
struct Revealed {
    effect: Effect,
    coefficient: usize,
    /// What the model says of it; zero where it lacks the effect.
    expected: f64,
    /// Standard error of that.
    std_error: f64,
    /// How far it may be off: beside the standard error, by a part of itself, since the flights of a model tell nothing of what they
    /// did not show. Nothing is known of what the model lacks.
    allowance: Option<f64>,
    /// Held at what the model says: the flights would make it a drag that drives, so they do not determine it. Without drag to
    /// the side, any small push to the side would be a gale.
    is_held: bool,
}

impl Revealed {
    fn all(model: &Model, effect: Effect) -> impl Iterator<Item = Self> {
        let known = model.term(effect).cloned();
        (0..effect.info().coefficients.len()).map(move |coefficient| {
            let estimate = known.as_ref().map(|term| term.coefficients[coefficient]);
            let std_error = estimate.and_then(|e| e.std_error).unwrap_or(0.0);
            Self {
                effect,
                coefficient,
                expected: estimate.map_or(0.0, |e| e.value),
                std_error,
                allowance: estimate.map(|e| std_error.hypot(HOLDS_TO * e.value)),
                is_held: false,
            }
        })
    }

    fn info(&self) -> &'static Coefficient {
        &self.effect.info().coefficients[self.coefficient]
    }

    /// Whether a value is beyond what drag can be.
    fn drives(&self, value: f64) -> bool {
        self.effect.info().special.brakes && value > 0.0
    }

    fn value(&self, model: &Model) -> f64 {
        model.term(self.effect).map_or(0.0, |term| term.coefficients[self.coefficient].value)
    }

    /// What is known of the step from where `model` stands.
    fn prior(&self, model: &Model) -> Option<Prior> {
        let now = self.value(model);
        if self.is_held {
            return Some(Prior { expected: self.expected - now, deviation: HELD * self.info().typical });
        }
        self.allowance.map(|deviation| Prior { expected: self.expected - now, deviation })
    }
}

/// A change that steps lead to what the flights show. Its parameters: what is fitted together with it, then its own.
struct ChangeFit<'a> {
    /// Without the changes.
    model: &'a Model,
    changes: Vec<Change>,
    revealed: Vec<Revealed>,
    flights: &'a [&'a Prepared],
    changed: Model,
    /// Where the last step of several effects together came from.
    before: Option<Model>,
}

/// Where the steps end.
struct End {
    fitted: Fitted,
    /// Of all parameters.
    covariance: DMatrix<f64>,
}

impl ChangeFit<'_> {
    fn rows(&self, flight: &Prepared, effects: &[Effect]) -> FlightRows {
        let adjusting = self.changed_effects();
        let acts = (effects, &adjusting[..]);
        let About { residuals, columns: mut derivatives, .. } =
            About::new(flight, &self.changed, acts, flight.fit_stride(), &Known::default());
        let count = |effects: &[Effect]| effects.iter().map(|e| e.info().coefficients.len()).sum::<usize>();
        let own = count(effects);
        let first = |effect: Effect| {
            own + count(&adjusting[..adjusting.iter().position(|other| *other == effect).unwrap_or(0)])
        };
        let places = (0..own).chain(self.free().map(|(effect, k)| first(effect) + k));
        let mut columns: Vec<RowColumn> = places.map(|k| std::mem::take(&mut derivatives[k])).collect();
        if !self.revealed.is_empty() {
            columns.iter_mut().skip(own).for_each(|column| self.leave_own_axes(column));
        }
        flight.rows_of_fit(residuals.residual, columns)
    }

    /// What the model extrapolates beside the change's own axes tells nothing of it: the thrust of rotors in a wind is not that of
    /// the same rotors in calm air.
    fn leave_own_axes(&self, column: &mut RowColumn) {
        for axis in model::AXES.iter().filter(|axis| !self.acts_on(**axis)) {
            column[axis.index()] = None;
        }
    }

    fn acts_on(&self, axis: Axis) -> bool {
        self.changes.iter().any(|change| change.effect.info().axes.contains(&axis))
    }

    /// The effects of the changes, each once.
    fn changed_effects(&self) -> Vec<Effect> {
        let mut effects: Vec<Effect> = Vec::new();
        for change in &self.changes {
            if !effects.contains(&change.effect) {
                effects.push(change.effect);
            }
        }
        effects
    }

    /// The coefficients that the changes free.
    fn free(&self) -> impl Iterator<Item = (Effect, usize)> {
        self.changes.iter().flat_map(|change| change.coefficients().into_iter().map(|k| (change.effect, k)))
    }

    /// Effects that are fitted together with the change, in the order of the parameters.
    fn effects(&self) -> Vec<Effect> {
        let mut effects: Vec<Effect> = self.revealed.iter().map(|r| r.effect).collect();
        effects.dedup();
        effects
    }

    fn values(&self, effect: Effect) -> Vec<f64> {
        self.changed.term(effect).map_or_else(Vec::new, |t| t.coefficients.iter().map(|c| c.value).collect())
    }

    /// Logarithm of the error on the change's own axes.
    fn left(&self, rows: &[FlightRows]) -> f64 {
        let square = |axis: usize| rows.iter().flat_map(|r| &r.targets[axis]).map(|e| e * e).sum::<f64>();
        let axes = model::AXES.into_iter().filter(|axis| self.acts_on(*axis));
        axes.map(|axis| 0.5 * square(axis.index()).max(f64::MIN_POSITIVE).ln()).sum()
    }

    fn fitted(&self, solution: &Solution) -> Fitted {
        let own = self.revealed.len();
        let free: Vec<(Effect, usize)> = self.free().collect();
        let size = |change: &Change| change.size(&self.changed, self.model);
        Fitted {
            values: DVector::from_iterator(free.len(), self.changes.iter().flat_map(size)),
            model: self.changed.clone(),
            covariance: solution.covariance.view((own, own), (free.len(), free.len())).into_owned(),
            sigma: solution.sigma,
            together: self.effects(),
            law_error: 0.0,
        }
    }
}

impl Problem for ChangeFit<'_> {
    type End = End;
    type Error = FitError;

    fn linearise(&mut self) -> Result<Linearised, FitError> {
        let effects = self.effects();
        let rows: Vec<FlightRows> = self.flights.iter().map(|flight| self.rows(flight, &effects)).collect();
        let known = |(effect, k): (Effect, usize)| {
            let prior = effect.info().coefficients[k].prior;
            let before = self.model.term(effect).map_or(0.0, |term| term.coefficients[k].value);
            prior.map(|deviation| Prior { expected: before - self.values(effect)[k], deviation })
        };
        let together = self.revealed.iter().map(|revealed| revealed.prior(&self.changed));
        let priors = together.chain(self.free().map(known)).collect();
        // A single change takes its few steps as they are.
        let left = (!self.revealed.is_empty()).then(|| self.left(&rows));
        Ok(Linearised { rows, priors, left })
    }

    fn unidentifiable(&self, _: Unidentifiable) -> FitError {
        let first = self.changes[0];
        let info = first.effect.info();
        FitError::NotExcited {
            effect: info.id,
            coefficient: info.coefficients[first.coefficients()[0]].name,
            excitation: info.excitation,
        }
    }

    fn step(&mut self, _: Linearised, solution: Solution) -> Result<ControlFlow<End>, FitError> {
        let together = self.revealed.iter().map(|r| (r.effect, r.coefficient));
        let parameters: Vec<(Effect, usize)> = together.chain(self.free()).collect();
        let mut is_settled = true;
        self.before = Some(self.changed.clone());
        for (i, (effect, k)) in parameters.into_iter().enumerate() {
            let info = &effect.info().coefficients[k];
            let step = solution.value[i];
            let is_held = self.revealed.get(i).is_some_and(|r| r.is_held);
            is_settled &=
                is_held || step.abs() < CONVERGED * solution.covariance[(i, i)].sqrt() + 1e-9 * info.typical;
            let mut values = self.values(effect);
            values[k] = step_end(values[k], step, info);
            if let Some(revealed) = self.revealed.get_mut(i).filter(|r| !r.is_held && r.drives(values[k])) {
                (revealed.is_held, is_settled, values[k]) = (true, false, revealed.expected);
            }
            self.changed.set(effect, &values);
        }
        if !is_settled {
            return Ok(ControlFlow::Continue(()));
        }
        let fitted = self.fitted(&solution);
        Ok(ControlFlow::Break(End { fitted, covariance: solution.covariance }))
    }

    fn halve(&mut self) {
        let Some(before) = &self.before else { return };
        for term in &mut self.changed.terms {
            let Some(old) = before.term(term.effect) else { continue };
            for (new, old) in term.coefficients.iter_mut().zip(&old.coefficients) {
                new.value = 0.5 * (new.value + old.value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use model::{FitRecord, Vehicle};

    use super::*;
    use crate::change::WIND;
    use crate::testing::{ORDINARY, prepared, truth};

    /// A load of 150 g, and its error below one.
    #[test]
    fn a_load_is_weighed_within_its_error() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        let flights = prepared(&heavy, 1..3, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let change = Change { effect: Effect::MassChange, motor: None };
        let fitted = fit_change(&truth(), change, &flights).unwrap();
        let (value, error) = (fitted.values[0], fitted.covariance[(0, 0)].sqrt());
        assert!((value - 0.15).abs() < 4.0 * error && error < 0.001, "{value} +- {error}");
        assert_eq!(fitted.model.term(Effect::MassChange).unwrap().values(), [value]);
        assert!(fitted.together.is_empty() && fitted.knows_its_law());
    }

    /// A drag of 0.252 v + 0.1 v^2 in a wind of 5 m/s, of which the model knows the linear part. Held at that, the same force is a wind of
    /// (0.252 * 5 + 0.1 * 25) / 0.252 = 14.9 m/s, but for the craft's own speed of some 1 m/s. Of the force, 2.5 / 3.76 is not linear.
    #[test]
    fn a_wind_beyond_what_was_flown_comes_with_the_drag_in_it() {
        let mut known = truth();
        let drag = known.terms.iter_mut().find(|term| term.effect == Effect::LinearDrag).unwrap();
        drag.coefficients.iter_mut().for_each(|c| c.std_error = Some(0.01 * c.value.abs()));
        let mut windy = truth();
        windy.set(Effect::SteadyWind, &[5.0, 0.0]);
        windy.set(Effect::QuadraticDrag, &[-0.1, -0.1]);
        let flights = prepared(&windy, 1..3, 12.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let mut flown_at = |speed_m_s: f64| {
            known.fit = Some(FitRecord { flown_speed_m_s: Some(speed_m_s), ..FitRecord::default() });
            fit_change(&known, WIND, &flights).unwrap()
        };
        let beyond = flown_at(2.0);
        assert_eq!(beyond.together, [Effect::LinearDrag, Effect::QuadraticDrag]);
        let error = beyond.covariance[(0, 0)].sqrt();
        assert!((beyond.values[0] - 5.0).abs() < 4.0 * error && error < 0.05, "{} +- {error}", beyond.values);
        assert!((beyond.law_error - 0.25 * 2.5 / 3.76).abs() < 0.005, "{}", beyond.law_error);
        let within = flown_at(20.0);
        assert!(within.together.is_empty() && within.law_error == 0.0);
        assert!((within.values[0] - 14.9).abs() < 1.5, "{}", within.values);
    }

    /// At rest in a wind of 2 m/s, a drag of 0.2 v + 0.1 v^2 is half beyond linear, and dv / v = f / n dn = 0.5 / 2 * 0.5. All of a square is
    /// beyond linear, nothing of a drag in proportion.
    #[test]
    fn a_law_that_is_not_known_makes_a_wind_uncertain_by_what_is_beyond_linear() {
        for (linear, quadratic, expected) in
            [(-0.2, -0.1, 0.125), (0.0, -0.1, 0.25), (-0.2, 0.0, 0.0), (0.0, 0.0, 0.0)]
        {
            let mut model = Model::new(Vehicle::thesis());
            assert_eq!(law_error(&model, WIND), 0.0);
            model.set(Effect::LinearDrag, &[linear; 3]);
            model.set(Effect::QuadraticDrag, &[quadratic; 2]);
            model.set(Effect::SteadyWind, &[2.0, 0.0]);
            assert!((law_error(&model, WIND) - expected).abs() < 1e-12, "{linear}, {quadratic}");
        }
    }
}
