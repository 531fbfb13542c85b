//! A model's coefficients, each flight by itself: whether they are the craft's, and whether they stay.

use model::{Model, Term};
use rayon::prelude::*;
use sysid::{FitError, Prepared};

/// A flight and what it alone gives.
pub struct FlightFit {
    /// Name of the flight.
    pub flight: String,
    /// The model's effects fitted to it alone, or why it does not determine them.
    pub terms: Result<Vec<Term>, FitError>,
}

/// Fits all effects of a model to each flight alone. The flights are lined up with the model ([`super::line_up`]).
pub fn flight_by_flight(model: &Model, flights: &[&Prepared]) -> Vec<FlightFit> {
    let effects = model.effects();
    let alone = |flight: &&Prepared| FlightFit {
        flight: flight.name.clone(),
        terms: sysid::fit(&[flight], &model.vehicle, &effects, Some(model)).map(|fit| fit.model.terms),
    };
    flights.par_iter().map(alone).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};
    use model::Effect;

    /// Each is within its errors of what was flown, and the heavier craft of the last flight shows in its thrust alone.
    #[test]
    fn each_flight_gives_the_coefficients_that_it_was_flown_with() {
        let mut heavier = truth();
        heavier.vehicle.mass *= 1.1;
        let mut flights = prepared(&truth(), 40..42, 8.0, &ORDINARY);
        flights.extend(prepared(&heavier, 42..43, 8.0, &ORDINARY));
        let flights: Vec<&Prepared> = flights.iter().collect();
        let fits = flight_by_flight(&truth(), &flights);
        let thrust = |fit: &FlightFit| {
            let terms = fit.terms.as_ref().unwrap();
            assert_eq!(terms.len(), truth().terms.len());
            terms.iter().find(|term| term.effect == Effect::Thrust).unwrap().coefficients[0]
        };
        let real = truth().term(Effect::Thrust).unwrap().coefficients[0].value;
        for (fit, expected) in fits.iter().zip([real, real, real / 1.1]) {
            let found = thrust(fit);
            let error = found.std_error.unwrap();
            assert!((found.value - expected).abs() < 6.0 * error, "{}: {found:?}, {expected}", fit.flight);
            assert!(error < 0.05 * expected, "{found:?}");
        }
    }

    #[test]
    fn a_flight_that_determines_nothing_says_why() {
        let short = prepared(&truth(), 43..44, 10.0, &ORDINARY);
        let mut still = short[0].clone();
        still.name = "still".into();
        let mut with_no_flight = truth();
        with_no_flight.terms.retain(|term| term.effect == Effect::AngularDamping);
        let [fit] = &flight_by_flight(&with_no_flight, &[&still])[..] else { panic!("one flight") };
        assert!(fit.flight == "still" && fit.terms.as_ref().is_err_and(|why| !why.to_string().is_empty()));
    }
}
