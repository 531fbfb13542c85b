//! The coefficients of a model, flight by flight, as the page draws them.

use diagnosis::workflow::FlightFit;
use model::{Estimate, Model};
use serde_json::{Value, json};

use crate::render::documents::coefficient_entries;

/// Each coefficient of the model with what every flight alone gives for it; flights that do not determine the model say why.
pub(super) fn document(model: &Model, fits: &[FlightFit]) -> Value {
    let places = model.terms.iter().enumerate();
    let places = places.flat_map(|(term, of)| (0..of.coefficients.len()).map(move |place| (term, place)));
    let coefficients = coefficient_entries(model).into_iter().zip(places).map(|(entry, (term, place))| {
        let mut entry = serde_json::to_value(entry).unwrap_or_default();
        let all: Vec<(&str, Estimate)> = fits.iter().filter_map(|fit| alone(fit, term, place)).collect();
        entry["scatter"] = json!(scatter(&all, model.terms[term].coefficients[place].value));
        let flight = |(flight, Estimate { value, std_error }): &(&str, Estimate)| {
            json!({ "flight": flight, "value": value, "std_error": std_error })
        };
        entry["flights"] = all.iter().map(flight).collect();
        entry
    });
    let flights = fits.iter().map(|fit| {
        let problem = fit.terms.as_ref().err().map(|why| report::error_line(&why.to_string()));
        json!({ "flight": fit.flight, "problem": problem })
    });
    json!({ "coefficients": coefficients.collect::<Vec<_>>(), "flights": flights.collect::<Vec<_>>() })
}

/// What a flight alone gives for a coefficient.
fn alone(fit: &FlightFit, term: usize, place: usize) -> Option<(&str, Estimate)> {
    let estimate = fit.terms.as_ref().ok()?.get(term)?.coefficients.get(place)?;
    Some((&fit.flight, *estimate))
}

/// Root mean square of the differences from the model's value over the flights' own standard errors: 1 where there is nothing
/// but error. Nothing for fewer than two flights.
fn scatter(all: &[(&str, Estimate)], of_model: f64) -> Option<f64> {
    let square = |(_, estimate): &(&str, Estimate)| {
        let error = estimate.std_error.filter(|error| *error > 0.0)?;
        Some(((estimate.value - of_model) / error).powi(2))
    };
    let squares: Vec<f64> = all.iter().filter_map(square).collect();
    (squares.len() > 1).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_flight_has_its_place_under_each_coefficient() {
        let model = Model::thesis();
        let mut terms = model.terms.clone();
        terms[1].coefficients[0] = Estimate { value: 42.0, std_error: Some(0.5) };
        let fits = [
            FlightFit { flight: "A.csv".into(), terms: Ok(terms) },
            FlightFit { flight: "B.csv".into(), terms: Err(sysid::FitError::NoFlights) },
        ];
        let document = document(&model, &fits);
        let rows = document["coefficients"].as_array().unwrap();
        assert_eq!(rows.len(), model.terms.iter().map(|term| term.coefficients.len()).sum::<usize>());
        let first_of_second = &rows[model.terms[0].coefficients.len()];
        assert_eq!(first_of_second["effect"], model.terms[1].effect.id());
        assert_eq!(
            first_of_second["flights"],
            json!([{ "flight": "A.csv", "value": 42.0, "std_error": 0.5 }])
        );
        assert_eq!(first_of_second["scatter"], Value::Null, "one flight scatters about nothing");
        let of = |value: f64| ("A.csv", Estimate { value, std_error: Some(0.5) });
        assert_eq!(scatter(&[of(11.0), of(8.0)], 10.0), Some(10_f64.sqrt()));
        assert_eq!(document["flights"][0]["problem"], Value::Null);
        assert_eq!(document["flights"][1]["problem"], "no flights to fit on");
    }
}
