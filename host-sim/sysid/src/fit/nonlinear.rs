//! Coefficients of adjusting effects (a wind, a lever, a load), by Gauss and Newton's steps about a
//! model, next to the coefficients of linear effects.

use std::ops::ControlFlow;

use model::{Coefficient, Effect, Model};
use nalgebra::DVector;

use crate::fit::assembly::{assemble, follow_up, left_by, timing};
use crate::fit::error::{FitError, check_finite, check_scales, not_converged, unidentifiable};
use crate::fit::fitted::{Fit, finish};
use crate::fit::gauss_newton::{self, Errors, Linearised, Problem, Rule};
use crate::fit::jackknife;
use crate::fit::least_squares::{self, FlightRows, Solution, Unidentifiable};
use crate::fit::linearise::step_scale;
use crate::fit::parameters::{Layout, is_bound, priors_of, step_end, store};
use crate::fit::pieces;
use crate::fit::slung_load;
use crate::fit::swing::Known;
use crate::fit::terms::coefficient_count;
use crate::prepare::Prepared;

/// Most Gauss-Newton steps; bilinear problems such as wind and drag take three or four.
const MAX_STEPS: usize = 12;
/// Where effects add accelerations, the steps crawl at the end (a swing's beginning is taken out between them): done when
/// the logarithms of the residuals' spreads together change by less than this.
const NO_FURTHER: f64 = 0.003;
/// They may rise by this in a step without it being a wrong one.
const WORSE: f64 = 0.2;
/// First steps of a load that was searched for and leaves more than none: a length that is off by a few percent is out of step with a swing
/// that is carried on from piece to piece, and would be led astray.
const ROUGH_STEPS: usize = 3;
/// Most halvings of a wrong step where effects add accelerations; else one, for where it does not help the next start is cheaper.
const HALVINGS: usize = 4;
/// Most steps and halvings of one step where whole steps found no end.
const CAREFUL_STEPS: usize = 40;
const CAREFUL_HALVINGS: usize = 6;
/// Where steps are halved until no more is left after them, what is left changes by less than this in the last: it is formed with other
/// weights than the step, so that at the end they pull to and fro.
const LEVEL: f64 = 1e-4;
/// A step this small against the standard error of white residuals, which is the smaller one, is the last: each step leaves
/// a tenth of the one before it or less.
const CONVERGED: f64 = 0.1;

/// Steps in a row that leave a scale where the possible ends, after which it is taken to have run away.
const AT_THE_END: usize = 3;

/// A step of less than this part of every coefficient (or of its ordinary magnitude) leaves the columns nearly as they are: the next one
/// takes them over, and only what is left is formed anew. The step after that is off by such a part of itself.
const SMALL: f64 = 0.03;

/// A step that takes back more than this part of the one before goes to and fro about where it should lead.
const TO_AND_FRO: f64 = 0.5;

/// Takes steps from where `model` stands until they are small.
pub(crate) fn settle(flights: &[&Prepared], model: Model, layout: &Layout) -> Result<Fit, FitError> {
    let (most_steps, most_halvings) =
        if layout.adds() { (MAX_STEPS + MAX_STEPS / 2, HALVINGS) } else { (MAX_STEPS, 1) };
    let rule = Rule { most_steps, most_halvings, worse: WORSE, asks_first: false, errors: Errors::White };
    let is_astray = || left_by(flights, &model) > left_by(flights, &slung_load::without_load(&model));
    let is_rough = layout.is_searched && is_astray();
    let no_further = if layout.adds() { NO_FURTHER } else { 0.0 };
    let mut problem = Nonlinear::new(flights, model, layout, (is_rough, no_further));
    if is_rough {
        gauss_newton::solve(&mut problem, Rule { most_steps: ROUGH_STEPS, ..rule })?;
        // A length that has run away does not come back in the steps that follow.
        let at_the_end = problem.at_the_end;
        problem =
            Nonlinear { at_the_end, ..Nonlinear::new(flights, problem.model, layout, (false, no_further)) };
    }
    gauss_newton::solve(&mut problem, rule)?.ok_or_else(|| not_converged(&layout.adjusting))
}

/// The same by steps that are halved wherever more is left after them: slower, and further where whole steps run astray. A lag or
/// a dead time steps past where its columns end, and a motor map without a test stand bends with the voltage.
pub(crate) fn settle_carefully(
    flights: &[&Prepared],
    model: Model,
    layout: &Layout,
) -> Result<Fit, FitError> {
    let mut problem = Nonlinear::new(flights, model, layout, (false, LEVEL));
    let rule = Rule {
        most_steps: CAREFUL_STEPS,
        most_halvings: CAREFUL_HALVINGS,
        worse: 0.0,
        asks_first: true,
        errors: Errors::White,
    };
    gauss_newton::solve(&mut problem, rule)?.ok_or_else(|| not_converged(&layout.adjusting))
}

/// The adjusting effects as `model` has them, where steps find no end: with errors as of coefficients that are all free.
pub(crate) fn stay(flights: &[&Prepared], model: Model, layout: &Layout) -> Result<Fit, FitError> {
    let mut problem = Nonlinear::new(flights, model, layout, (false, 0.0));
    let at = problem.linearise()?;
    let solution = least_squares::solve_without_errors(&at.rows, &at.priors)
        .map_err(|why| unidentifiable(why, &layout.order))?;
    let values: Vec<f64> = layout.order.iter().flat_map(|effect| problem.values_of(*effect)).collect();
    Ok(Fit { is_settled: false, ..problem.end(&at, solution, values.into())? })
}

/// A model that steps lead to what the flights show.
struct Nonlinear<'a> {
    flights: &'a [&'a Prepared],
    layout: &'a Layout,
    model: Model,
    /// Whether these are the first steps of a load that was searched for: none of them is the last.
    is_rough: bool,
    /// Change of what is left under which a step is the last, whatever its size.
    no_further: f64,
    /// How the load was found to begin in each flight.
    begun: Vec<Known>,
    /// Rows of the step before, where it was small.
    kept: Option<Vec<FlightRows>>,
    /// Whether the present rows were all formed anew.
    is_full: bool,
    /// Where the last step came from, and what was left there.
    last: Option<(Model, Option<f64>)>,
    /// The last step of the coefficients of adjusting effects.
    last_step: Vec<f64>,
    /// Steps in a row after which a scale was where the possible ends.
    at_the_end: usize,
}

impl<'a> Nonlinear<'a> {
    fn new(
        flights: &'a [&'a Prepared],
        model: Model,
        layout: &'a Layout,
        (is_rough, no_further): (bool, f64),
    ) -> Self {
        let begun = vec![Known { begun: Vec::new(), is_rough }; flights.len()];
        Self {
            flights,
            layout,
            model,
            is_rough,
            no_further,
            begun,
            kept: None,
            is_full: true,
            last: None,
            last_step: Vec::new(),
            at_the_end: 0,
        }
    }

    fn values_of(&self, effect: Effect) -> Vec<f64> {
        self.model.term(effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect()
    }

    /// Where a step leads, and how large it is: linear coefficients come out as values, those of
    /// adjusting effects as steps from where the columns were formed.
    fn reach(&self, solution: &Solution) -> Reach {
        let mut values = solution.value.clone();
        let (mut is_settled, mut is_small) = (true, true);
        let (mut steps, mut std_errors) = (Vec::new(), Vec::new());
        let mut at: usize = self.layout.linear.iter().map(|e| coefficient_count(*e)).sum();
        for effect in &self.layout.adjusting {
            let known = self.values_of(*effect);
            for (k, (now, info)) in known.iter().zip(effect.info().coefficients).enumerate() {
                let step = solution.value[at];
                let ordinary = step_scale(self.model.vehicle.has_rotor_map(), *effect, k);
                values[at] = step_end(*now, step, info);
                let std_error = solution.covariance[(at, at)].sqrt();
                is_settled &=
                    is_held(*now, values[at], info) || step.abs() < CONVERGED * std_error + 1e-9 * ordinary;
                is_small &= step.abs() < SMALL * now.abs().max(ordinary);
                steps.push(values[at] - now);
                std_errors.push(std_error);
                at += 1;
            }
        }
        let part = part_of_step(&self.last_step, &steps, &std_errors);
        Reach { values, is_settled, is_small, steps, part }
    }

    /// Goes back along the last step, to that part of it.
    fn back_to(&mut self, part: f64) {
        let Some((before, _)) = &self.last else { return };
        for term in &mut self.model.terms {
            let Some(old) = before.term(term.effect) else { continue };
            for (new, old) in term.coefficients.iter_mut().zip(&old.coefficients) {
                new.value = part * new.value + (1.0 - part) * old.value;
            }
        }
        self.last_step.iter_mut().for_each(|step| *step *= part);
    }

    /// Ends steps that have left a scale where the possible ends for some time.
    fn check_running_away(&mut self) -> Result<(), FitError> {
        match check_scales(&self.model, &self.layout.adjusting) {
            Ok(()) => self.at_the_end = 0,
            Err(why) if self.at_the_end + 1 == AT_THE_END => return Err(why),
            Err(_) => self.at_the_end += 1,
        }
        Ok(())
    }

    /// The fit where the last step has ended, with errors for coloured residuals.
    fn end(&self, at: &Linearised, solution: Solution, value: DVector<f64>) -> Result<Fit, FitError> {
        let Self { flights, layout, model, .. } = self;
        check_scales(model, &layout.adjusting)?;
        let surplus = slung_load::of_model(model).map(|carried| {
            let blocks = |flight: &&Prepared| pieces::blocks(flight, &carried, flight.fit_stride());
            let blocks: Vec<_> = flights.iter().map(blocks).collect();
            jackknife::of_blocks(&at.rows, &blocks, &solution)
        });
        let mut solution =
            least_squares::with_errors_beside(solution, &at.rows, &at.priors, &timing(flights, model));
        if let Some(surplus) = surplus {
            solution.covariance += surplus;
        }
        Ok(finish(model.clone(), &layout.order, Solution { value, ..solution }))
    }
}

/// Where a step leads.
struct Reach {
    values: DVector<f64>,
    /// Whether it is small against its own standard error.
    is_settled: bool,
    /// Whether it leaves the columns nearly as they are.
    is_small: bool,
    /// Those of the coefficients of adjusting effects.
    steps: Vec<f64>,
    /// Of the step, to be taken.
    part: f64,
}

/// Part of a step to be taken after the one before, by their lengths in standard errors: all of it, unless it takes back much of that one.
/// Of steps of which each is `-r` times the one before, so much leads to where they all lead (Aitken 1926).
fn part_of_step(before: &[f64], step: &[f64], std_errors: &[f64]) -> f64 {
    let product = |one: &[f64], other: &[f64]| -> f64 {
        let scaled = one.iter().zip(other).zip(std_errors).map(|((a, b), e)| a * b / (e * e));
        scaled.filter(|product| product.is_finite()).sum()
    };
    let taken_back = -product(before, step) / product(before, before);
    if taken_back > TO_AND_FRO { 1.0 / (1.0 + taken_back.min(1.0)) } else { 1.0 }
}

/// At a bound that no step crosses, there is no further.
fn is_held(now: f64, next: f64, info: &Coefficient) -> bool {
    next == now && is_bound(info)
}

impl Problem for Nonlinear<'_> {
    type End = Fit;
    type Error = FitError;

    fn linearise(&mut self) -> Result<Linearised, FitError> {
        let Self { flights, layout, model, begun, .. } = self;
        self.is_full = self.kept.is_none();
        let (rows, left) = match self.kept.take() {
            None => assemble(flights, model, &layout.linear, &layout.adjusting, begun),
            Some(mut rows) => {
                let left = follow_up(&mut rows, flights, model, layout, begun);
                (rows, left)
            }
        };
        check_finite(flights, &rows, model)?;
        let count: usize = layout.linear.iter().map(|e| coefficient_count(*e)).sum();
        let mut priors = vec![None; count];
        priors.extend(layout.adjusting.iter().flat_map(|effect| priors_of(model, *effect)));
        Ok(Linearised { rows, priors, left: Some(left) })
    }

    fn unidentifiable(&self, why: Unidentifiable) -> FitError {
        unidentifiable(why, &self.layout.order)
    }

    fn step(&mut self, at: Linearised, solution: Solution) -> Result<ControlFlow<Fit>, FitError> {
        let reach = self.reach(&solution);
        let before = self.last.as_ref().and_then(|(_, left)| *left);
        let is_level =
            before.zip(at.left).is_some_and(|(before, left)| (before - left).abs() < self.no_further);
        let is_settled = reach.is_settled || is_level;
        self.last = Some((self.model.clone(), at.left));
        store(&mut self.model, &self.layout.order, reach.values.as_slice());
        if is_settled && !self.is_rough {
            return self.end(&at, solution, reach.values).map(ControlFlow::Break);
        }
        self.kept = (self.is_full && reach.is_small).then_some(at.rows);
        self.last_step = reach.steps;
        if reach.part < 1.0 {
            self.back_to(reach.part);
        }
        self.check_running_away()?;
        Ok(ControlFlow::Continue(()))
    }

    fn spread_left(&mut self) -> Option<f64> {
        // Rows that are kept say it as cheaply, and how a load begins its pieces is known with the rows alone.
        let is_asked = self.kept.is_none() && !self.layout.adds();
        is_asked.then(|| left_by(self.flights, &self.model)).filter(|left| left.is_finite())
    }

    fn halve(&mut self) {
        self.back_to(0.5);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// Asked or not, to the bit: a step is as wrong in either way.
    #[test]
    fn what_is_left_is_what_a_regression_says_of_it() {
        let mut model = truth();
        let flight = Prepared::new(&fly(&model, 3, 8.0, &NONE), &model.vehicle).unwrap();
        let flights = [&flight];
        let effects: Vec<Effect> =
            Effect::basic().chain([Effect::SteadyWind, Effect::InputDelay, Effect::MotorLag]).collect();
        let layout = Layout::new(&effects);
        for (effect, values) in [
            (Effect::SteadyWind, &[0.7, -0.4][..]),
            (Effect::InputDelay, &[0.012]),
            (Effect::MotorLag, &[0.01]),
        ] {
            model.set(effect, values);
        }
        let mut problem = Nonlinear::new(&flights, model, &layout, (false, LEVEL));
        let asked = problem.spread_left();
        assert!(asked.is_some());
        assert_eq!(asked, problem.linearise().unwrap().left);
    }

    /// Steps each -r times the one before, from 1 on, lead to 1 / (1 + r).
    #[test]
    fn steps_to_and_fro_are_cut_to_where_they_lead() {
        for r in [0.6, 0.87, 1.0] {
            let part = part_of_step(&[1.0, 2.0], &[-r, -2.0 * r], &[0.1, 0.3]);
            let reached = 1.0 - part * r;
            assert!((reached - 1.0 / (1.0 + r)).abs() < 1e-12, "{r}: {reached}");
        }
    }

    #[test]
    fn steps_onwards_sideways_or_a_little_back_are_taken_whole() {
        for step in [[0.5, 1.0], [2.0, -1.0], [-0.2, -0.4], [0.0, 0.0]] {
            assert_eq!(part_of_step(&[1.0, 2.0], &step, &[1.0, 1.0]), 1.0, "{step:?}");
        }
        assert_eq!(part_of_step(&[], &[1.0], &[1.0]), 1.0);
        assert_eq!(part_of_step(&[0.0], &[1.0], &[0.0]), 1.0);
    }
}
