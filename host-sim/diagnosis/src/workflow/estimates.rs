//! Bearings and times of lags: numbers in the formulas of forms that are no coefficients, estimated beside these.
//!
//! A search takes them from a grid. A bearing can be a coefficient, and so can the time of a lag where the lag is taken for straight from
//! one time to another. A fit with these among the coefficients gives better values, their standard errors, and those of the
//! coefficients where bearings and times are not known beforehand.

use crate::discovery::FormNumber;
use crate::discovery::chosen::{Chosen, rounded};
use crate::discovery::define::{Defined, define_free};
use crate::discovery::refine::Refined;
use crate::discovery::variables::Variable;
use crate::finding::CoefficientFigures;

/// Fits, each from where the last one led: a lag is not straight over its time.
const PASSES: usize = 2;
/// Parts of a degree of a bearing: finer than these are known.
const PARTS_OF_DEGREE: f64 = 100.0;

/// Forms with their bearings and times of lags as estimated.
pub(super) struct Estimated {
    pub(super) terms: Vec<Refined>,
    /// Those that the terms are over.
    pub(super) variables: Vec<Variable>,
    /// The bearings and times of lags.
    pub(super) constants: Vec<FormNumber>,
    /// Of the coefficients, in the order of their definition.
    pub(super) std_errors: Vec<f64>,
}

/// Estimates the bearings and times of lags of some terms together, by fits that give the coefficients of an effect; nothing where there
/// are none, or where the flights do not determine them.
pub(super) fn estimated(
    terms: &[Refined],
    variables: &[Variable],
    fit: impl Fn(&Defined) -> Option<Vec<CoefficientFigures>>,
) -> Option<Estimated> {
    let mut own = Estimated {
        terms: terms.to_vec(),
        variables: variables.to_vec(),
        constants: vec![],
        std_errors: vec![],
    };
    for _ in 0..PASSES {
        let defined = define_free("chosen", "Estimates.".into(), &own.terms, &own.variables);
        if defined.chosen.is_empty() {
            return None;
        }
        own = own.with(&defined, &fit(&defined)?)?;
    }
    Some(own)
}

impl Estimated {
    /// With what a fit gave.
    fn with(mut self, defined: &Defined, figures: &[CoefficientFigures]) -> Option<Self> {
        self.constants.clear();
        for chosen in &defined.chosen {
            let (found, [term, factor]) = (figures.get(chosen.place)?, chosen.of);
            let is_told = found.std_error.is_finite() && found.std_error > 0.0;
            let [low, high] = defined.definition.coefficient[chosen.place].possible;
            if !is_told || found.value <= low || found.value >= high {
                return None;
            }
            let time = |lags: fn(f64) -> Chosen| {
                let time_s = rounded(found.value);
                (lags(time_s), (time_s, found.std_error, "s"))
            };
            let place = &mut self.terms[term].form.factors[factor].variable;
            let variable = &self.variables[*place];
            let (number, constant) = match variable.chosen()? {
                Chosen::BearingDeg(_) => {
                    let degrees = (PARTS_OF_DEGREE * found.value.to_degrees()).round() / PARTS_OF_DEGREE;
                    (Chosen::BearingDeg(degrees), (degrees, found.std_error.to_degrees(), "deg"))
                }
                Chosen::LagS(_) => time(Chosen::LagS),
                Chosen::TwoLagsS(_) => time(Chosen::TwoLagsS),
            };
            let (value, std_error, unit) = constant;
            let (name, unit) = (found.name.to_owned(), unit.to_owned());
            self.constants.push(FormNumber { name, value, std_error, unit });
            let better = variable.with_chosen(number)?;
            *place = self.variables.len();
            self.variables.push(better);
        }
        let is_chosen = |place: &usize| defined.chosen.iter().any(|chosen| chosen.place == *place);
        let others = || figures.iter().enumerate().filter(|(place, _)| !is_chosen(place)).map(|(_, own)| own);
        self.terms = with_values(&self.terms, others().map(|own| own.value));
        self.std_errors = others().map(|own| own.std_error).collect();
        Some(self)
    }
}

/// Forms with the values of a fit of them all, in the order of its coefficients.
pub(super) fn with_values(terms: &[Refined], mut values: impl Iterator<Item = f64>) -> Vec<Refined> {
    let mut fitted = terms.to_vec();
    for term in &mut fitted {
        for amplitude in &mut term.amplitudes {
            *amplitude = values.next().unwrap_or(*amplitude);
        }
        for parameter in term.form.parameters() {
            let value = values.next().unwrap_or_else(|| term.form.value(parameter));
            term.form = term.form.with(parameter, value);
        }
    }
    fitted
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discovery::form::Form;
    use crate::testing::{ORDINARY, prepared, truth};

    /// A form that has two amplitudes, and a place and a length of its shape.
    fn term(variable: usize) -> Refined {
        Refined { form: Form::made_up(variable), amplitudes: vec![1.0, 2.0], gain_left_out: 1.0, improved: 2 }
    }

    /// A form over the place along a bearing, and one over the airspeed behind a lag.
    fn along_a_bearing_and_behind_a_lag() -> ([Refined; 2], Vec<Variable>) {
        let flights = prepared(&truth(), 1..2, 4.0, &ORDINARY);
        let variables = Variable::all(&flights.iter().collect::<Vec<_>>(), &truth());
        let with = |name: &str, chosen: Chosen| {
            variables.iter().position(|own| own.name == name && own.chosen() == Some(chosen)).unwrap()
        };
        let terms = [with("place", Chosen::BearingDeg(30.0)), with("u", Chosen::LagS(0.4))].map(term);
        (terms, variables)
    }

    /// A fit that gives values and standard errors of a bearing and of a lag, behind the four coefficients of each form.
    fn fit(bearing: (f64, f64), lag: (f64, f64)) -> Option<Vec<CoefficientFigures>> {
        let all = [(10.0, 0.1), (20.0, 0.2), (30.0, 0.3), (40.0, 0.4), bearing].into_iter().chain([
            (50.0, 0.5),
            (60.0, 0.6),
            (70.0, 0.7),
            (80.0, 0.8),
            lag,
        ]);
        let figures = |(value, std_error)| CoefficientFigures {
            name: "found",
            value,
            std_error,
            unit: "1",
            possible: (-100.0, 100.0),
        };
        Some(all.map(figures).collect())
    }

    /// 0.6457718 rad are 37 degrees, and 0.01 rad are 0.573 degrees. Times have four digits.
    #[test]
    fn a_bearing_is_told_in_degrees_and_a_lag_in_seconds() {
        let (terms, variables) = along_a_bearing_and_behind_a_lag();
        let found = estimated(&terms, &variables, |_| fit((0.645_771_8, 0.01), (0.423_46, 0.03))).unwrap();
        let [bearing, lag] = &found.constants[..] else { panic!("{:?}", found.constants) };
        assert_eq!((bearing.value, &*bearing.unit), (37.0, "deg"));
        assert!((bearing.std_error - 0.572_957_8).abs() < 1e-6);
        assert_eq!((lag.value, lag.std_error, &*lag.unit), (0.4235, 0.03, "s"));
        let chosen = |term: &Refined| found.variables[term.form.factors[0].variable].chosen();
        assert_eq!(chosen(&found.terms[0]), Some(Chosen::BearingDeg(37.0)));
        assert_eq!(chosen(&found.terms[1]), Some(Chosen::LagS(0.4235)));
        assert_eq!(found.terms[1].amplitudes, [50.0, 60.0]);
        assert_eq!(found.std_errors, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]);
    }

    /// A bearing without an error, and one that has turned by more than a right angle. A form without either has nothing to fit.
    #[test]
    fn what_the_flights_do_not_determine_is_not_estimated() {
        let (terms, variables) = along_a_bearing_and_behind_a_lag();
        let is_told = |bearing| estimated(&terms, &variables, |_| fit(bearing, (0.4, 0.03))).is_some();
        assert!(is_told((0.6, 0.01)) && !is_told((2.2, 0.01)));
        assert!(!is_told((0.6, 0.0)) && !is_told((0.6, f64::INFINITY)));
        assert!(estimated(&terms, &variables, |_| None).is_none());
        let height = variables.iter().position(|own| own.name == "height").unwrap();
        assert!(estimated(&[term(height)], &variables, |_| panic!("there is nothing to fit")).is_none());
    }

    /// Two amplitudes and the place and width of a bump, then as many of the next; what there is no value for stays.
    #[test]
    fn values_go_to_amplitudes_and_shapes_term_by_term() {
        let fitted = with_values(&[term(0), term(1)], [1.5, 2.5, 3.5, 4.5, 5.5].into_iter());
        let numbers = |term: &Refined| (term.amplitudes.clone(), term.form.factors[0].shape.parameters);
        assert_eq!(numbers(&fitted[0]), (vec![1.5, 2.5], [3.5, 4.5]));
        assert_eq!(numbers(&fitted[1]), (vec![5.5, 2.0], [0.5, 0.5]));
    }
}
