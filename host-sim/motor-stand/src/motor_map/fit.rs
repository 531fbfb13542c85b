//! Gauss and Newton's steps: map, lag and clock of motors that share a map.

use std::ops::ControlFlow;

use sysid::fit::gauss_newton::{self, Linearised, Problem, Rule};
use sysid::fit::least_squares::{self, FlightRows, Solution, Unidentifiable};

use super::error::MotorMapError;
use super::result::Estimated;
use super::rows::Shape;
use super::run::{Fitted, Free, Run};
use super::terms::Terms;

/// What lags motors have, rad/s.
pub(super) const LAGS: (f64, f64) = (0.5, 400.0);
/// Most steps, the first one without slopes included.
const MOST_STEPS: usize = 40;
/// A step of less than this part of its standard error is the last.
const CONVERGED: f64 = 0.01;
/// Fewest rows that are worth a fit.
const FEWEST_ROWS: usize = 100;

impl Run<'_> {
    /// Map, lag and clock of some motors with one map.
    pub(super) fn fit(
        &self,
        motors: &[usize],
        terms: Terms,
        start: Shape,
        free: Free,
    ) -> Result<Fitted, MotorMapError> {
        let mut fit =
            ShapeFit { run: self, motors, terms, free, shape: start, coefficients: Vec::new(), fitted: None };
        // Without coefficients there are no slopes.
        let rows = fit.rows()?;
        let unknowns = vec![None; fit.count()];
        let first = least_squares::solve(&rows, &unknowns).map_err(|why| unexcited(why, terms))?;
        fit.coefficients = first.value.iter().copied().collect();
        // The best there is where they do not settle: the errors say how good that is.
        gauss_newton::solve(&mut fit, Rule::of_steps(MOST_STEPS - 1))?;
        let not_excited = MotorMapError::NotExcited { what: "the lag and the clocks together".into() };
        fit.fitted.ok_or(not_excited)
    }
}

/// Coefficients, lag and clock that steps lead to what a run shows.
struct ShapeFit<'a> {
    run: &'a Run<'a>,
    motors: &'a [usize],
    terms: Terms,
    free: Free,
    shape: Shape,
    /// Of the map; none before the first fit.
    coefficients: Vec<f64>,
    fitted: Option<Fitted>,
}

impl ShapeFit<'_> {
    /// How many coefficients the map has.
    fn count(&self) -> usize {
        self.terms.of(0.0, 0.0).len()
    }

    fn rows(&self) -> Result<Vec<FlightRows>, MotorMapError> {
        let Self { run, motors, terms, free, shape, coefficients, .. } = self;
        let rows = run.assemble(motors, *terms, *shape, coefficients, *free);
        if number_of(&rows) < FEWEST_ROWS { Err(run.too_short()) } else { Ok(rows) }
    }
}

fn number_of(rows: &[FlightRows]) -> usize {
    rows.iter().map(FlightRows::rows).sum()
}

impl Problem for ShapeFit<'_> {
    type End = ();
    type Error = MotorMapError;

    fn linearise(&mut self) -> Result<Linearised, MotorMapError> {
        self.rows().map(Linearised::without_priors)
    }

    fn unidentifiable(&self, why: Unidentifiable) -> MotorMapError {
        unexcited(why, self.terms)
    }

    fn step(&mut self, at: Linearised, solution: Solution) -> Result<ControlFlow<()>, MotorMapError> {
        let (count, unknowns) = (self.count(), at.priors.len());
        self.coefficients = solution.value.rows(0, count).iter().copied().collect();
        let by: Vec<f64> = solution.value.rows(count, unknowns - count).iter().copied().collect();
        let error = |k: usize| {
            if k < unknowns { solution.covariance[(k, k)].max(0.0).sqrt() } else { f64::NAN }
        };
        let (before, shape) = (self.shape, &mut self.shape);
        shape.lag = (shape.lag + by[0]).clamp(0.6 * shape.lag, 1.6 * shape.lag).clamp(LAGS.0, LAGS.1);
        if self.free == Free::LagAndClock {
            shape.offset_s += by[1].clamp(-0.1, 0.1);
            shape.skew = (shape.skew + by[2].clamp(-0.005, 0.005)).clamp(-0.1, 0.1);
        }
        let errors = [error(count), error(count + 1), error(count + 2)];
        let moved = [
            (shape.lag - before.lag).abs(),
            (shape.offset_s - before.offset_s).abs(),
            (shape.skew - before.skew).abs(),
        ];
        // What is not looked for has no error, and did not move.
        let is_settled = moved.iter().zip(errors).all(|(moved, error)| !(moved / error > CONVERGED));
        let estimates = self.coefficients.iter().enumerate();
        self.fitted = Some(Fitted {
            coefficients: estimates.map(|(k, &value)| Estimated { value, std_error: error(k) }).collect(),
            shape: self.shape,
            errors,
            rms: solution.sigma[0],
            rows: number_of(&at.rows),
        });
        Ok(if is_settled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }
}

pub(super) fn unexcited(why: Unidentifiable, terms: Terms) -> MotorMapError {
    let names = ["the command's coefficient", "the voltage's coefficient"];
    let constant = terms.of(0.0, 0.0).len() - 1;
    let name = |k: usize| match k {
        k if k < constant.min(2) => names[k].to_owned(),
        k if k == constant => "the map's offset".into(),
        k if k < constant => "the map's third term".into(),
        k => ["the lag", "the clocks' offset", "the clocks' skew"]
            .get(k - constant - 1)
            .unwrap_or(&"the lag")
            .to_string(),
    };
    let what = match why {
        Unidentifiable::NotExcited(k) => name(k),
        Unidentifiable::Collinear(all) => all.into_iter().map(name).collect::<Vec<_>>().join(" apart from "),
    };
    MotorMapError::NotExcited { what }
}
