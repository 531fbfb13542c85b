//! Gauss and Newton's steps: map, lag and clock of motors that share a map.

use sysid::fit::least_squares;

use super::error::MotorMapError;
use super::problem::{Fitted, Free, Problem};
use super::result::Estimated;
use super::rows::Shape;
use super::terms::Terms;

/// What lags motors have, rad/s.
pub(super) const LAGS: (f64, f64) = (0.5, 400.0);
const MOST_STEPS: usize = 40;

impl Problem<'_> {
    /// Gauss and Newton's steps for some motors with one map.
    pub(super) fn fit(
        &self,
        motors: &[usize],
        terms: Terms,
        start: Shape,
        free: Free,
    ) -> Result<Fitted, MotorMapError> {
        let mut shape = start;
        let mut coefficients: Vec<f64> = Vec::new();
        for step in 0..MOST_STEPS {
            let (flights, rows) = self.assemble(motors, terms, shape, &coefficients, free);
            if rows < 100 {
                return Err(self.too_short());
            }
            let count = terms.of(0.0, 0.0).len();
            // The first pass knows no coefficients, and so no slopes.
            let unknowns = if step == 0 { count } else { flights[0].columns.len() };
            let solution =
                least_squares::solve(&flights, &vec![None; unknowns]).map_err(|why| unexcited(why, terms))?;
            coefficients = solution.value.rows(0, count).iter().copied().collect();
            if step == 0 {
                continue;
            }
            let by: Vec<f64> = solution.value.rows(count, unknowns - count).iter().copied().collect();
            let error = |k: usize| {
                if k < unknowns { solution.covariance[(k, k)].max(0.0).sqrt() } else { f64::NAN }
            };
            let before = shape;
            shape.lag = (shape.lag + by[0]).clamp(0.6 * shape.lag, 1.6 * shape.lag).clamp(LAGS.0, LAGS.1);
            if free == Free::LagAndClock {
                shape.offset_s += by[1].clamp(-0.1, 0.1);
                shape.skew = (shape.skew + by[2].clamp(-0.005, 0.005)).clamp(-0.1, 0.1);
            }
            let moved = [
                (shape.lag - before.lag).abs() / error(count),
                (shape.offset_s - before.offset_s).abs() / error(count + 1),
                (shape.skew - before.skew).abs() / error(count + 2),
            ];
            let last = moved.iter().all(|m| !(*m > 0.01)) || step + 1 == MOST_STEPS;
            if last {
                let estimates = coefficients.iter().enumerate();
                return Ok(Fitted {
                    coefficients: estimates
                        .map(|(k, &value)| Estimated { value, std_error: error(k) })
                        .collect(),
                    shape,
                    errors: [error(count), error(count + 1), error(count + 2)],
                    rms: solution.sigma[0],
                    rows,
                });
            }
        }
        Err(MotorMapError::NotExcited { what: "the lag and the clocks together".into() })
    }
}

pub(super) fn unexcited(why: least_squares::Unidentifiable, terms: Terms) -> MotorMapError {
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
        least_squares::Unidentifiable::NotExcited(k) => name(k),
        least_squares::Unidentifiable::Collinear(all) => {
            all.into_iter().map(name).collect::<Vec<_>>().join(" apart from ")
        }
    };
    MotorMapError::NotExcited { what }
}
