//! Clocks that stamp no row together, but see the same motion: a tracker's and those of the sensors on board.

use std::path::Path;

use flights::{Flight, StandIn};
use logs::{ClockPair, Import};
use model::Vehicle;
use sysid::Prepared;
use sysid::checks::clocks::{self, Clock};

/// Offset and skew of attitude against rates, and of position against specific force, in each flight of a log that tells.
pub(crate) fn of(import: &Import) -> Vec<ClockPair> {
    let Ok(Some(draft)) = logs::draft(std::slice::from_ref(import)) else { return Vec::new() };
    let flights = import.flights.iter().filter(|part| is_measured(&part.flight));
    flights.flat_map(|part| of_flight(&part.flight, &draft.vehicle, import)).collect()
}

/// Whether attitude and rates are columns of the log, not one made of the other.
fn is_measured(flight: &Flight) -> bool {
    let has = |columns: &[flights::Column]| columns.iter().all(|column| flight.column(*column).is_some());
    has(StandIn::AnglesOfGyro.columns()) && has(StandIn::RatesOfAttitude.columns())
}

fn of_flight(flight: &Flight, vehicle: &Vehicle, import: &Import) -> Vec<ClockPair> {
    let name = Path::new(&flight.name);
    let Ok(whole) = flight.completed(name) else { return Vec::new() };
    let Ok(prepared) = Prepared::new(&whole, vehicle) else { return Vec::new() };
    let pair = |clock: Clock, [of, against]: [(&str, &Option<String>); 2]| {
        let named = |(quantity, source): (&str, &Option<String>)| match source {
            Some(source) => format!("{quantity} ({source})"),
            None => quantity.to_owned(),
        };
        let known = |value: f64| value.is_finite().then_some(value);
        ClockPair {
            of: flight.name.clone(),
            clock: named(of),
            reference: named(against),
            rows: flight.len(),
            offset_ms: 1e3 * clock.offset_s,
            offset_std_error_ms: known(1e3 * clock.offset_std_error_s),
            skew_ppm: known(1e6 * clock.skew),
            skew_std_error_ppm: known(1e6 * clock.skew_std_error),
            scatter_ms: None,
            furthest_ms: None,
        }
    };
    let sources = &import.sources;
    let attitude = clocks::of_attitude(&prepared)
        .map(|clock| pair(clock, [("attitude", &sources.attitude), ("rates", &sources.rates)]));
    let position = clocks::of_position(&prepared).map(|clock| {
        pair(clock, [("position", &sources.position), ("specific force", &sources.specific_force)])
    });
    attitude.into_iter().chain(position).collect()
}
