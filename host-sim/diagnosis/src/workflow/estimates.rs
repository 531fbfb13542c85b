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
