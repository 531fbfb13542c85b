//! How a form remembers: for how long, and by one lag or by two in a row.
//!
//! A search tries one lag at times far apart. Two lags of a time between those fit better than one of the wrong time, so both are held
//! against each other at the times that fit each best, with the noise that the flights have once the form is known.

use std::collections::BTreeMap;

use crate::discovery::form::Form;
use crate::discovery::problem::Problem;
use crate::discovery::refine::{Refined, gain_of, refine};
use crate::discovery::variables::Variable;

/// From one time that is tried to the next.
const RATIO: f64 = 1.06;
/// Times that a search goes on by, one after the other.
const STRIDES: [i32; 3] = [5, 2, 1];
/// Times from the first one at most, shorter or longer.
const FARTHEST: i32 = 30;
/// Two lags must take so many variances of the noise more than one, so that they are e^5 times as likely: else the simpler is told.
const MARGIN: f64 = 10.0;

/// What a factor remembers where it fits best.
struct Best {
    variable: Variable,
    gain: f64,
}

/// Whether a form looks back at a quantity.
pub(crate) fn remembers(form: &Form, variables: &[Variable]) -> bool {
    form.factors.iter().any(|factor| variables[factor.variable].behind_two_lags().is_some())
}

/// A form with each lag at the time that fits best, and two in a row where these are far likelier; nothing where it cannot be fitted so.
/// Variables that it is over then join the others.
pub(crate) fn remembering(
    problem: &Problem<'_>,
    form: &Form,
    variables: &mut Vec<Variable>,
) -> Option<Refined> {
    let mut better = form.clone();
    for factor in 0..form.factors.len() {
        let one = variables[better.factors[factor].variable].clone();
        let Some(two) = one.behind_two_lags() else { continue };
        let at = Place { problem, form: &better, factor, variables };
        let (one, two) = (at.best(&one)?, at.best(&two));
        let found = two.filter(|two| two.gain > one.gain + MARGIN).unwrap_or(one);
        better.factors[factor].variable = variables.len();
        variables.push(found.variable);
    }
    refine(problem, &better, variables)
}

/// A factor of a form whose lag is searched.
struct Place<'a> {
    problem: &'a Problem<'a>,
    form: &'a Form,
    factor: usize,
    variables: &'a [Variable],
}

impl Place<'_> {
    /// The time of a lag that fits best near that of a variable.
    fn best(&self, begin: &Variable) -> Option<Best> {
        let mut gains: BTreeMap<i32, f64> = BTreeMap::new();
        let mut gain =
            |place: i32| *gains.entry(place).or_insert_with(|| self.gain(begin, RATIO.powi(place)));
        let mut here = 0;
        for stride in STRIDES {
            while let Some(next) = [here - stride, here + stride]
                .into_iter()
                .filter(|place| place.abs() <= FARTHEST)
                .max_by(|one, other| gain(*one).total_cmp(&gain(*other)))
                .filter(|next| gain(*next) > gain(here))
            {
                here = next;
            }
        }
        let (ahead, most) = vertex([gain(here - 1), gain(here), gain(here + 1)]);
        let variable = begin.with_time_times(RATIO.powf(f64::from(here) + ahead))?;
        most.is_finite().then_some(Best { variable, gain: most })
    }

    /// What the form takes with the time of a variable's lag times a factor.
    fn gain(&self, begin: &Variable, times: f64) -> f64 {
        let Some(variable) = begin.with_time_times(times) else { return f64::NEG_INFINITY };
        let mut form = self.form.clone();
        let mut variables = self.variables.to_vec();
        form.factors[self.factor].variable = variables.len();
        variables.push(variable);
        gain_of(self.problem, &form, &variables).unwrap_or(f64::NEG_INFINITY)
    }
}

/// Where a parabola through values at -1, 0 and 1 is highest, and how high; the middle where the ends are higher or not known.
fn vertex([before, at, after]: [f64; 3]) -> (f64, f64) {
    let (slope, bend) = (0.5 * (after - before), after - 2.0 * at + before);
    if !(bend < 0.0 && bend.is_finite()) {
        return (0.0, at);
    }
    let ahead = (-slope / bend).clamp(-1.0, 1.0);
    (ahead, at + slope * ahead + 0.5 * bend * ahead * ahead)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_highest_at_its_vertex() {
        let parabola = |x: f64| 7.0 - 2.0 * (x - 0.3).powi(2);
        let (ahead, most) = vertex([-1.0, 0.0, 1.0].map(parabola));
        assert!((ahead - 0.3).abs() < 1e-12 && (most - 7.0).abs() < 1e-12);
        assert_eq!(vertex([1.0, 1.0, 1.0]), (0.0, 1.0));
        assert_eq!(vertex([f64::NEG_INFINITY, 1.0, 0.0]), (0.0, 1.0));
    }
}
