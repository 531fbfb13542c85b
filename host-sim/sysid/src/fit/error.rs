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
    #[error("the flights cannot tell apart {}; fly so that each is excited by itself", coefficients.join(", "))]
    Collinear {
        /// "effect coefficient" of each.
        coefficients: Vec<String>,
    },
    /// A user's formula without a finite value at a sample that was not left out beforehand.
    #[error(
        "{flight}: the model has no finite prediction: a formula of {effect} evaluates a root, logarithm or quotient outside its domain"
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
    /// The iteration for an adjusting effect came to no end.
    #[error("{}", does_not_converge(effect, excitation))]
    NotConverged {
        /// The effect.
        effect: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
    /// A scale of an adjusting effect, such as a length, ended where the possible ends.
    #[error("{}", does_not_converge(effect, excitation))]
    RanAway {
        /// The effect.
        effect: &'static str,
        /// What to fly.
        excitation: &'static str,
    },
}

impl FitError {
    /// The identifier of the effect that it is about, where it is about one.
    pub fn effect(&self) -> Option<&str> {
        match self {
            Self::NotExcited { effect, .. }
            | Self::NoRotation { effect }
            | Self::ExplainsNothing { effect, .. }
            | Self::NotConverged { effect, .. }
            | Self::RanAway { effect, .. } => Some(effect),
            Self::NotFinite { effect, .. } => Some(effect),
            Self::NoFlights | Self::Collinear { .. } => None,
        }
    }
}

fn does_not_converge(effect: &str, excitation: &str) -> String {
    format!(
        "the fit of {effect} does not converge: these flights do not determine it; to see it: {excitation}"
    )
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
        Some(effect) => Err(FitError::RanAway { effect: effect.id(), excitation: effect.info().excitation }),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{prepared, truth};

    /// Thrust has one coefficient and drag three, so the third parameter is the drag's second.
    #[test]
    fn a_parameter_is_named_by_its_effect_and_its_coefficient() {
        let order = [Effect::Thrust, Effect::LinearDrag];
        assert_eq!(
            unidentifiable(Unidentifiable::NotExcited(2), &order).to_string(),
            "the flights do not excite C_dv of linear-drag: fly forward, sideways, up and down at several \
             speeds"
        );
        let thrust = Effect::Thrust.info().coefficients[0].name;
        assert_eq!(
            unidentifiable(Unidentifiable::Collinear(vec![0, 1, 3]), &order).to_string(),
            format!(
                "the flights cannot tell apart {thrust} of thrust, C_du of linear-drag, C_dw of \
                 linear-drag; fly so that each is excited by itself"
            )
        );
    }

    #[test]
    fn a_length_at_an_end_of_the_possible_was_not_found() {
        // 0.08 to 10 m are possible.
        let checked = |length: f64| {
            let mut model = truth();
            model.set(Effect::SlungLoad, &[0.1, length, 0.0]);
            check_scales(&model, &[Effect::MassChange, Effect::SlungLoad])
        };
        assert_eq!((checked(0.081), checked(9.9)), (Ok(()), Ok(())));
        for length in [0.08, 10.0, 12.0] {
            let why = checked(length).expect_err("it ran away");
            assert!(matches!(why, FitError::RanAway { effect: "slung-load", .. }), "{length} m: {why:?}");
            // To whoever flies, it is a fit that does not converge.
            assert_eq!(why.to_string(), not_converged(&[Effect::SlungLoad]).to_string());
        }
        // A damping of zero is a damping, and what is not in the model has no scale.
        assert_eq!(check_scales(&truth(), &[Effect::SlungLoad]), Ok(()));
    }

    #[test]
    fn what_does_not_settle_says_what_to_fly() {
        assert_eq!(
            not_converged(&[Effect::SlungLoad, Effect::MassChange]).to_string(),
            "the fit of slung-load does not converge: these flights do not determine it; to see it: start, \
             stop and reverse quickly, so that the load swings, then hover until the swing has died away"
        );
    }

    /// Without a formula of a user there is nobody to blame: the effects of the catalogue are
    /// finite everywhere.
    #[test]
    fn residuals_that_are_not_finite_are_blamed_on_users_formulas_only() {
        let flight = prepared(200, |_, _| {});
        let mut residuals = Residuals::default();
        residuals.residual[0] = vec![f64::NAN];
        assert_eq!(check_residuals(&[&flight], &[residuals.clone()], &truth()), Ok(()));
        let path = tempfile::NamedTempFile::new().unwrap();
        let text = "[[effect]]\nid = \"root-of-error\"\nacceleration.u = \"k * sqrt(height)\"\n\
                    coefficient = [{ name = \"k\", unit = \"m^0.5/s^2\", possible = [-1.0, 1.0], typical = 0.1 }]\n";
        std::fs::write(path.path(), text).unwrap();
        let user = model::effects::read(path.path()).unwrap()[0];
        let mut model = truth();
        model.set(user, &[0.1]);
        let refused = check_residuals(&[&flight], &[residuals], &model).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "made-up.csv: the model has no finite prediction: a formula of root-of-error evaluates a root, \
             logarithm or quotient outside its domain"
        );
        assert_eq!(check_residuals(&[&flight], &[Residuals::default()], &model), Ok(()));
    }
}
