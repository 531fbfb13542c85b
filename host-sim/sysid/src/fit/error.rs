//! Why a fit is refused.

use model::{Effect, Model};

use crate::fit::least_squares::{FlightRows, Unidentifiable};
use crate::fit::residuals::Residuals;
use crate::prepare::Prepared;

/// Why a fit was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FitError {
    /// No flight to fit on.
    #[error("no flights to fit on")]
    NoFlights,
    /// A coefficient that the flights never excited.
    #[error("the flights do not excite {coefficient} of {effect}: {excitation}")]
    NotExcited {
        /// The effect.
        effect: &'static str,
        /// The coefficient.
        coefficient: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
    /// Coefficients that the flights cannot tell apart.
    #[error("the flights cannot tell apart {}; fly so that they move separately", coefficients.join(", "))]
    Collinear {
        /// "effect coefficient" of each.
        coefficients: Vec<String>,
    },
    /// A user's formula without a finite value at a sample that was not left out beforehand.
    #[error(
        "{flight}: the model has no finite prediction: a formula of {effect} takes a root, a logarithm or a quotient of what they do not exist for"
    )]
    NotFinite {
        /// The flight.
        flight: String,
        /// Users' effects in the model.
        effect: String,
    },
    /// A moment without the rotors' moments.
    #[error(
        "{effect} acts on the rotation alone, which this model does not have: these flights did not determine it \
         (see `rotation_refused` in the model file)"
    )]
    NoRotation {
        /// The effect.
        effect: &'static str,
    },
    /// An effect of which no shape explains anything.
    #[error("no possible {effect} of any shape lowers the error of these flights; to see one: {excitation}")]
    ExplainsNothing {
        /// The effect.
        effect: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
    /// The iteration for an adjusting effect ran away.
    #[error(
        "the fit of {effect} does not settle, these flights do not determine it; to see it: {excitation}"
    )]
    NotConverged {
        /// The effect.
        effect: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
}

pub(crate) fn not_converged(adjusting: &[Effect]) -> FitError {
    FitError::NotConverged { effect: adjusting[0].id(), excitation: adjusting[0].info().excitation }
}

/// A length or another scale that ended where the possible ends was not found but ran away.
pub(crate) fn check_scales(model: &Model, adjusting: &[Effect]) -> Result<(), FitError> {
    let ran_away = |effect: &&Effect| {
        let values = model.term(**effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value);
        values.zip(effect.info().coefficients).any(|(value, c)| {
            let (low, high) = c.possible;
            c.prior.is_some() && low > 0.0 && (value <= low || value >= high)
        })
    };
    match adjusting.iter().find(ran_away) {
        None => Ok(()),
        Some(effect) => {
            Err(FitError::NotConverged { effect: effect.id(), excitation: effect.info().excitation })
        }
    }
}

/// A formula of a user may have no value at a state that nobody thought of.
pub(crate) fn check_finite(
    flights: &[&Prepared],
    rows: &[FlightRows],
    model: &Model,
) -> Result<(), FitError> {
    let finite = |rows: &FlightRows| {
        rows.columns.iter().flatten().flatten().chain(&rows.targets).flatten().all(|value| value.is_finite())
    };
    blame_users(model, flights.iter().zip(rows).find(|(_, rows)| !finite(rows)).map(|(flight, _)| *flight))
}

/// The same for residuals of flights.
pub fn check_residuals(
    flights: &[&Prepared],
    residuals: &[Residuals],
    model: &Model,
) -> Result<(), FitError> {
    let finite = |r: &Residuals| r.residual.iter().flatten().all(|value| value.is_finite());
    blame_users(model, flights.iter().zip(residuals).find(|(_, r)| !finite(r)).map(|(flight, _)| *flight))
}

fn blame_users(model: &Model, not_finite: Option<&Prepared>) -> Result<(), FitError> {
    let users: Vec<&str> =
        model.effects().iter().filter(|e| matches!(e, Effect::User(_))).map(|e| e.id()).collect();
    match not_finite {
        Some(flight) if !users.is_empty() => {
            Err(FitError::NotFinite { flight: flight.name.clone(), effect: users.join(", ") })
        }
        _ => Ok(()),
    }
}

pub(crate) fn unidentifiable(why: Unidentifiable, order: &[Effect]) -> FitError {
    let find = |parameter: usize| {
        let mut left = parameter;
        for effect in order {
            let info = effect.info();
            if left < info.coefficients.len() {
                return (info, info.coefficients[left].name);
            }
            left -= info.coefficients.len();
        }
        unreachable!("a parameter beyond the last coefficient")
    };
    match why {
        Unidentifiable::NotExcited(k) => {
            let (info, coefficient) = find(k);
            FitError::NotExcited { effect: info.id, coefficient, excitation: info.excitation }
        }
        Unidentifiable::Collinear(all) => {
            let coefficients = all.into_iter().map(|k| {
                let (info, name) = find(k);
                format!("{name} of {}", info.id)
            });
            FitError::Collinear { coefficients: coefficients.collect() }
        }
    }
}
