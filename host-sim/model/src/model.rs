//! The model: vehicle, effects with the values of their coefficients, and how it came to be.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::effect::Estimate;
use crate::effects::{Adjustments, Effect};
use crate::fit_record::{FitRecord, HistoryEntry, ReferenceValues};
use crate::rotor_quantity::RotorQuantity;
use crate::vehicle::Vehicle;

/// An effect in a model with the values of its coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// The effect.
    pub effect: Effect,
    /// One estimate for each of its coefficients, in order.
    pub coefficients: Vec<Estimate>,
}

/// A model.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// What the operator measured.
    pub vehicle: Vehicle,
    /// Effects and their coefficients.
    pub terms: Vec<Term>,
    /// Constants of the fit.
    pub reference: ReferenceValues,
    /// The fit, where there was one.
    pub fit: Option<FitRecord>,
    /// Effects added to the basic model, in order.
    pub history: Vec<HistoryEntry>,
    /// Correlations of the coefficients' errors; absent: not known, and taken for independent.
    pub correlation: Option<Correlation>,
}

/// Correlations of the coefficients' errors. With the standard errors they make the covariance ([`Model::covariance`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correlation {
    /// Which coefficients, as `effect.coefficient`.
    pub coefficients: Vec<String>,
    /// For each coefficient its correlation with each one before it: a triangle, the first row empty.
    pub rows: Vec<Vec<f64>>,
}

impl Term {
    /// The values of its coefficients.
    pub fn values(&self) -> Vec<f64> {
        self.coefficients.iter().map(|c| c.value).collect()
    }
}

impl Model {
    /// A model without effects.
    pub fn new(vehicle: Vehicle) -> Self {
        Self {
            vehicle,
            terms: Vec::new(),
            reference: ReferenceValues::default(),
            fit: None,
            history: Vec::new(),
            correlation: None,
        }
    }

    /// The term of an effect.
    pub fn term(&self, effect: Effect) -> Option<&Term> {
        self.terms.iter().find(|term| term.effect == effect)
    }

    /// Whether the effect is in the model.
    pub fn has(&self, effect: Effect) -> bool {
        self.term(effect).is_some()
    }

    /// The effects in order.
    pub fn effects(&self) -> Vec<Effect> {
        self.terms.iter().map(|term| term.effect).collect()
    }

    /// Sets an effect's coefficients to known values without error, adding the effect if it is not there.
    ///
    /// # Panics
    /// When the number of values is not the effect's: a mistake in the program, not in its input.
    pub fn set(&mut self, effect: Effect, values: &[f64]) {
        assert_eq!(values.len(), effect.info().coefficients.len(), "{effect}");
        let coefficients = values.iter().map(|&value| Estimate { value, std_error: None }).collect();
        match self.terms.iter_mut().find(|term| term.effect == effect) {
            Some(term) => term.coefficients = coefficients,
            None => self.terms.push(Term { effect, coefficients }),
        }
    }

    /// What stands for the speed of a rotor in its equations: units of its coefficients depend on it.
    pub fn rotor_quantity(&self) -> RotorQuantity {
        self.vehicle.rotor_quantity(self.reference.rotor_speeds_logged)
    }

    /// Whether its rotors can be commanded, as a simulated flight must: by a motor map, or by commands that stand for the speeds in all its
    /// coefficients. Coefficients of logged speeds say nothing of commands.
    pub fn can_be_commanded(&self) -> bool {
        let stand_in = !self.reference.rotor_speeds_logged;
        self.vehicle.can_map_commands() && (self.vehicle.has_rotor_map() || stand_in)
    }

    /// What the adjusting effects change.
    pub fn adjustments(&self) -> Adjustments {
        let mut adjust = Adjustments::default();
        for term in &self.terms {
            adjust.take_up(term.effect, &term.values(), self.reference.battery_v);
        }
        adjust
    }

    /// Covariance of all coefficients in the model's order, units of the coefficients. A coefficient without a standard
    /// error counts as exact; without correlations the errors count as independent.
    pub fn covariance(&self) -> DMatrix<f64> {
        let errors: Vec<f64> =
            self.terms.iter().flat_map(|t| &t.coefficients).map(|c| c.std_error.unwrap_or(0.0)).collect();
        let names = coefficient_names(&self.terms);
        let mut covariance = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(errors.clone()));
        covariance.component_mul_assign(&covariance.clone());
        let Some(correlation) = &self.correlation else { return covariance };
        let place = |name: &String| names.iter().position(|n| n == name);
        let places: Vec<Option<usize>> = correlation.coefficients.iter().map(place).collect();
        for (i, row) in places.iter().zip(&correlation.rows) {
            for (j, r) in places.iter().zip(row) {
                // A coefficient whose effect has been taken out of the model is no longer there.
                if let (Some(i), Some(j)) = (*i, *j) {
                    let shared = r * errors[i] * errors[j];
                    (covariance[(i, j)], covariance[(j, i)]) = (shared, shared);
                }
            }
        }
        covariance
    }

    /// Sets standard errors and correlations of some coefficients, given by their places in the model's order, from their
    /// covariance. With the other coefficients they are taken to be uncorrelated.
    ///
    /// # Panics
    /// When the matrix is not as large as the list, or a place is beyond the last: mistakes in the program.
    pub fn set_covariance(&mut self, places: &[usize], covariance: &DMatrix<f64>) {
        assert_eq!(
            covariance.shape(),
            (places.len(), places.len()),
            "a row and a column for each coefficient"
        );
        let mut all = self.covariance();
        for (i, &place) in places.iter().enumerate() {
            all.row_mut(place).fill(0.0);
            all.column_mut(place).fill(0.0);
            for (j, &other) in places.iter().enumerate().take(i + 1) {
                (all[(place, other)], all[(other, place)]) = (covariance[(i, j)], covariance[(i, j)]);
            }
        }
        let errors: Vec<f64> = all.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
        let mut estimates: Vec<&mut Estimate> =
            self.terms.iter_mut().flat_map(|t| &mut t.coefficients).collect();
        for &place in places {
            estimates[place].std_error = Some(errors[place]);
        }
        let known: Vec<usize> = (0..estimates.len()).filter(|&k| estimates[k].std_error.is_some()).collect();
        let names = coefficient_names(&self.terms);
        let one = |i: usize, j: usize| {
            let scale = errors[i] * errors[j];
            if scale > 0.0 { (all[(i, j)] / scale).clamp(-1.0, 1.0) } else { 0.0 }
        };
        self.correlation = Some(Correlation {
            coefficients: known.iter().map(|&k| names[k].clone()).collect(),
            rows: (0..known.len()).map(|i| (0..i).map(|j| one(known[i], known[j])).collect()).collect(),
        });
    }
}

/// Names of all coefficients in the model's order, as `effect.coefficient`.
pub(crate) fn coefficient_names(terms: &[Term]) -> Vec<String> {
    let of = |term: &Term| {
        let info = term.effect.info();
        info.coefficients.iter().map(move |c| format!("{}.{}", info.id, c.name)).collect::<Vec<_>>()
    };
    terms.iter().flat_map(of).collect()
}

impl Correlation {
    /// What is wrong with the table of a file, on one line.
    pub(crate) fn mistake(&self, terms: &[Term]) -> Option<String> {
        let names = coefficient_names(terms);
        if let Some(stranger) = self.coefficients.iter().find(|name| !names.contains(name)) {
            return Some(format!("there is no coefficient \"{stranger}\""));
        }
        if let Some(twice) =
            (1..self.coefficients.len()).find(|&k| self.coefficients[..k].contains(&self.coefficients[k]))
        {
            return Some(format!("\"{}\" is there twice", self.coefficients[twice]));
        }
        let count = self.coefficients.len();
        if self.rows.len() != count || (0..count).any(|k| self.rows[k].len() != k) {
            return Some(format!(
                "rows: {count} coefficients need rows of 0 to {} numbers",
                count.max(1) - 1
            ));
        }
        let bad = self.rows.iter().flatten().find(|r| !(-1.0..=1.0).contains(*r));
        bad.map(|r| format!("rows: {r} is no correlation, which is from -1 to 1"))
    }
}
