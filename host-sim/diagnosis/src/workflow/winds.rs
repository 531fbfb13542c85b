//! Constant winds of the flights' own: what each flight is in, what a model file says of it, and winds put aside while the flights are in
//! others.

use model::Model;
use nalgebra::Vector3;

use crate::finding::EffectFinding;
use crate::workflow::loaded::LoadedFlight;

/// A wind of each flight, in the order of the flights, NED m/s.
pub(crate) struct Winds(pub(crate) Vec<Vector3<f64>>);

impl Winds {
    /// Those that flights are in.
    pub(crate) fn of<'a>(flights: impl Iterator<Item = &'a LoadedFlight>) -> Self {
        Self(flights.map(|flight| flight.prepared.wind_ned_m_s).collect())
    }

    /// Lets them blow in flights.
    pub(crate) fn blow<'a>(&self, flights: impl Iterator<Item = &'a mut LoadedFlight>) {
        flights.zip(&self.0).for_each(|(flight, wind)| flight.prepared.wind_ned_m_s = *wind);
    }
}

/// An effect that the winds reveal that the flights are in.
pub(crate) struct Revealed {
    /// Its evidence against the winds that the flights have without it.
    pub(crate) finding: EffectFinding,
    /// Those.
    pub(crate) without: Winds,
}

/// Lets the winds blow beside which a model was fitted, in those of some flights that it was fitted to or judged by, and none in others:
/// how many have one.
pub(crate) fn recall(model: &Model, flights: &mut [LoadedFlight]) -> usize {
    let record = model.fit.iter().flat_map(|fit| &fit.flights);
    let known: Vec<_> = record.filter_map(|flight| Some((&flight.sha256, flight.wind_m_s?))).collect();
    let mut recalled = 0;
    for flight in flights {
        let own = known.iter().find(|(sha256, _)| **sha256 == flight.sha256);
        flight.prepared.wind_ned_m_s =
            own.map_or_else(Vector3::zeros, |(_, [north, east])| Vector3::new(*north, *east, 0.0));
        recalled += usize::from(own.is_some());
    }
    recalled
}

#[cfg(test)]
mod tests {
    use model::{FitRecord, FlightRecord, FlightRole};

    use super::*;
    use crate::testing::{loaded, truth};

    #[test]
    fn only_flights_that_a_model_was_fitted_in_wind_to_are_in_that_wind() {
        let mut flights = loaded([1, 2, 3]);
        let of = |flight: &LoadedFlight, wind_m_s| FlightRecord {
            name: "another name".into(),
            sha256: flight.sha256.clone(),
            role: FlightRole::Train,
            samples: 1,
            wind_m_s,
        };
        let record = vec![of(&flights[2], Some([3.0, -1.0])), of(&flights[1], None)];
        let mut model = truth();
        model.fit = Some(FitRecord { flights: record, ..FitRecord::default() });
        assert_eq!(recall(&model, &mut flights), 1);
        let winds = Winds::of(flights.iter());
        assert_eq!(winds.0, [Vector3::zeros(), Vector3::zeros(), Vector3::new(3.0, -1.0, 0.0)]);
        Winds(vec![Vector3::x(); 3]).blow(flights.iter_mut());
        assert!(flights.iter().all(|flight| flight.prepared.has_own_wind()));
        winds.blow(flights.iter_mut());
        assert_eq!(Winds::of(flights.iter()).0, winds.0);
        assert_eq!(recall(&truth(), &mut flights), 0);
        assert!(flights.iter().all(|flight| !flight.prepared.has_own_wind()));
    }
}
