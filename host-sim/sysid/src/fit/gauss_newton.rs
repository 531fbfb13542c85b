//! Gauss and Newton's method: the one loop of every regression that is not linear in its coefficients.
//! (Refinement on rollouts descends by Levenberg and Marquardt's: `output_error/descent.rs`.)
//!
//! A [`Problem`] is linearised about its present values, the linear problem is solved, and the
//! problem takes the step, until it says that this was the last. A step after which more is left
//! than before is wrong, since a residual far from its minimum need not be convex: it is halved
//! ([`Rule`]). Nocedal and Wright 2006, section 10.3.

use std::ops::ControlFlow;

use crate::fit::least_squares::{self, FlightRows, Prior, Solution, Unidentifiable};

/// A fit that is linearised again and again.
pub trait Problem {
    /// What the last step leaves behind.
    type End;
    /// Why it cannot be solved.
    type Error;

    /// The regression about the present values.
    fn linearise(&mut self) -> Result<Linearised, Self::Error>;

    /// What it means that `linearised` does not determine its parameters.
    fn unidentifiable(&self, why: Unidentifiable) -> Self::Error;

    /// Takes the step that solves `linearised`. Breaks where it was the last.
    fn step(
        &mut self,
        linearised: Linearised,
        solution: Solution,
    ) -> Result<ControlFlow<Self::End>, Self::Error>;

    /// Logarithm of the spread that the present values leave, as [`Linearised::left`] has it, where it can be told without a regression.
    fn spread_left(&mut self) -> Option<f64> {
        None
    }

    /// Goes back by half of the last step. Only asked of problems that say what is left.
    fn halve(&mut self) {}
}

/// A regression about the present values of a [`Problem`].
pub struct Linearised {
    /// The rows of each flight.
    pub rows: Vec<FlightRows>,
    /// What is known of each parameter before any flight.
    pub priors: Vec<Option<Prior>>,
    /// Logarithm of the spread that the present values leave, where wrong steps are looked for.
    pub left: Option<f64>,
}

impl Linearised {
    /// A regression whose parameters are all unknown, of a problem that looks for no wrong steps.
    pub fn without_priors(rows: Vec<FlightRows>) -> Self {
        let count = rows.first().map_or(0, |rows| rows.columns.len());
        Self { rows, priors: vec![None; count], left: None }
    }
}

/// Covariance that comes with each step's solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Errors {
    /// As if the residuals were white: costs no second look at the rows.
    White,
    /// Coloured residuals accounted for.
    Coloured,
}

/// How far the steps may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rule {
    /// Most steps, halved ones included.
    pub most_steps: usize,
    /// Most halvings of one step.
    pub most_halvings: usize,
    /// Rise of [`Linearised::left`] from which a step is a wrong one.
    pub worse: f64,
    /// Whether [`Problem::spread_left`] is asked before a regression is formed: where most steps are wrong ones, that is cheaper.
    pub asks_first: bool,
    /// Covariance of each step's solution.
    pub errors: Errors,
}

impl Rule {
    /// Steps that are all taken as they are, with errors for coloured residuals.
    pub const fn of_steps(most_steps: usize) -> Self {
        let errors = Errors::Coloured;
        Self { most_steps, most_halvings: 0, worse: f64::INFINITY, asks_first: false, errors }
    }
}

/// Takes steps until one is the last. Nothing where none of them was.
pub fn solve<P: Problem>(problem: &mut P, rule: Rule) -> Result<Option<P::End>, P::Error> {
    let mut left_before: Option<f64> = None;
    let mut halvings = 0;
    for _ in 0..rule.most_steps {
        let may_halve = halvings < rule.most_halvings;
        let is_worse = |left: Option<f64>| {
            may_halve && left_before.zip(left).is_some_and(|(before, left)| left > before + rule.worse)
        };
        let is_wrong = rule.asks_first && is_worse(problem.spread_left());
        let linearised = if is_wrong { None } else { Some(problem.linearise()?) };
        let Some(linearised) = linearised.filter(|at| !is_worse(at.left)) else {
            halvings += 1;
            problem.halve();
            continue;
        };
        halvings = 0;
        left_before = linearised.left;
        let solved = match rule.errors {
            Errors::White => least_squares::solve_without_errors,
            Errors::Coloured => least_squares::solve,
        };
        let solution =
            solved(&linearised.rows, &linearised.priors).map_err(|why| problem.unidentifiable(why))?;
        if let ControlFlow::Break(end) = problem.step(linearised, solution)? {
            return Ok(Some(end));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = a exp(b t) without noise, on one axis.
    struct Decay {
        t: Vec<f64>,
        y: Vec<f64>,
        a: f64,
        b: f64,
        last_step: [f64; 2],
        halved: usize,
        linearised: usize,
    }

    impl Decay {
        fn starting_at(a: f64, b: f64) -> Self {
            let t: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
            let y = t.iter().map(|t| 3.0 * (-1.5 * t).exp()).collect();
            Self { t, y, a, b, last_step: [0.0; 2], halved: 0, linearised: 0 }
        }

        fn errors(&self) -> Vec<f64> {
            let predicted = |t: &f64| self.a * (self.b * t).exp();
            self.t.iter().zip(&self.y).map(|(t, y)| y - predicted(t)).collect()
        }

        fn spread(&self) -> f64 {
            0.5 * self.errors().iter().map(|e| e * e).sum::<f64>().max(f64::MIN_POSITIVE).ln()
        }
    }

    impl Problem for Decay {
        type End = [f64; 2];
        type Error = Unidentifiable;

        fn linearise(&mut self) -> Result<Linearised, Unidentifiable> {
            self.linearised += 1;
            let (target, left) = (self.errors(), self.spread());
            let by_a = self.t.iter().map(|t| (self.b * t).exp()).collect();
            let by_b = self.t.iter().map(|t| t * self.a * (self.b * t).exp()).collect();
            let rest = || vec![0.0; target.len()];
            let columns = [by_a, by_b].map(|c| [Some(c), None, None, None, None, None]).to_vec();
            let targets = [target.clone(), rest(), rest(), rest(), rest(), rest()];
            let rows = FlightRows { targets, columns, starts: vec![0], period_s: 0.01 };
            Ok(Linearised { left: Some(left), ..Linearised::without_priors(vec![rows]) })
        }

        fn unidentifiable(&self, why: Unidentifiable) -> Unidentifiable {
            why
        }

        fn step(
            &mut self,
            _: Linearised,
            solution: Solution,
        ) -> Result<ControlFlow<[f64; 2]>, Unidentifiable> {
            self.last_step = [solution.value[0], solution.value[1]];
            self.a += self.last_step[0];
            self.b += self.last_step[1];
            let is_last = self.last_step.iter().all(|s| s.abs() < 1e-10);
            Ok(if is_last { ControlFlow::Break([self.a, self.b]) } else { ControlFlow::Continue(()) })
        }

        fn spread_left(&mut self) -> Option<f64> {
            Some(self.spread())
        }

        fn halve(&mut self) {
            self.halved += 1;
            self.last_step = self.last_step.map(|s| 0.5 * s);
            self.a -= self.last_step[0];
            self.b -= self.last_step[1];
        }
    }

    #[test]
    fn an_exponential_is_found_to_the_last_digits() {
        let mut problem = Decay::starting_at(2.0, -1.0);
        let [a, b] = solve(&mut problem, Rule::of_steps(20)).unwrap().expect("it settles");
        assert!((a - 3.0).abs() < 1e-9 && (b + 1.5).abs() < 1e-9, "{a} {b}");
    }

    #[test]
    fn halved_steps_reach_what_whole_ones_overshoot() {
        let start = || Decay::starting_at(0.05, 1.0);
        let rule = Rule { most_halvings: 8, worse: 0.0, ..Rule::of_steps(60) };
        let mut halving = start();
        let [a, b] = solve(&mut halving, rule).unwrap().expect("it settles");
        assert!((a - 3.0).abs() < 1e-9 && (b + 1.5).abs() < 1e-9, "{a} {b}");
        assert!(halving.halved > 0, "the start was meant to be a bad one");
    }

    #[test]
    fn no_regression_is_formed_where_a_wrong_step_is_asked_for_first() {
        let rule = Rule { most_halvings: 8, worse: 0.0, ..Rule::of_steps(60) };
        let ended = |asks_first: bool| {
            let mut problem = Decay::starting_at(0.05, 1.0);
            let end = solve(&mut problem, Rule { asks_first, ..rule }).unwrap().expect("it settles");
            (end, problem.halved, problem.linearised)
        };
        let ((end, halved, linearised), (same, as_often, fewer)) = (ended(false), ended(true));
        assert_eq!((end, halved), (same, as_often));
        assert_eq!(linearised - halved, fewer);
        assert!(halved > 0, "the start was meant to be a bad one");
    }

    #[test]
    fn steps_that_run_out_are_no_end() {
        let mut problem = Decay::starting_at(2.0, -1.0);
        assert_eq!(solve(&mut problem, Rule::of_steps(2)).unwrap(), None);
        let before = [problem.a, problem.b];
        assert_eq!(solve(&mut problem, Rule::of_steps(0)).unwrap(), None);
        assert_eq!([problem.a, problem.b], before);
    }

    #[test]
    fn a_column_of_zeros_is_the_problems_error() {
        // Where a is zero, nothing depends on b.
        let why = solve(&mut Decay::starting_at(0.0, -1.0), Rule::of_steps(5)).unwrap_err();
        assert_eq!(why, Unidentifiable::NotExcited(1));
    }
}
