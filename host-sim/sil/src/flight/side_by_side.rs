//! Many flights side by side: each as if it was flown by itself, to the bit, but their craft advance together.

use std::cmp::Reverse;

use super::closed_loop::{ClosedLoop, Decided};
use super::error::SilError;
use super::plan::FlightPlan;
use super::recording::Row;
use crate::craft::Team;
use crate::flight_computer::InProcess;

/// A flight in its lane.
struct Aboard<'a> {
    /// Of all flights, which.
    number: usize,
    flight: ClosedLoop<'a, InProcess>,
    ticks_left: u32,
    /// Its plant can be advanced with those of others.
    with_others: bool,
}

/// Flies plans to their ends. `see` is shown each tick of each flight, by its number, and says whether that flight goes on. What comes of
/// each is an error where its plan or configuration cannot be flown.
pub(crate) fn fly_side_by_side(
    plans: &[&FlightPlan],
    mut see: impl FnMut(usize, &Row) -> bool,
) -> Vec<Result<(), SilError>> {
    let mut results: Vec<Result<(), SilError>> = plans.iter().map(|_| Ok(())).collect();
    // The longest first: at the end few lanes are without a flight, and memory of one flight is enough for the next.
    let mut order: Vec<usize> = (0..plans.len()).collect();
    order.sort_by_key(|&number| Reverse(plans[number].ticks()));
    let mut waiting = order.into_iter();
    let mut team = Team::new();
    let mut lanes: [Option<Aboard>; Team::SIZE] = [const { None }; Team::SIZE];
    loop {
        for (lane, place) in lanes.iter_mut().enumerate() {
            while place.is_none() {
                let Some(number) = waiting.next() else { break };
                match ClosedLoop::in_process(plans[number]) {
                    Ok(flight) => *place = Some(Aboard::new(number, flight, &mut team, lane)),
                    Err(why) => results[number] = Err(why),
                }
            }
            let Some(aboard) = place else { continue };
            match aboard.begin_tick(&mut team, lane, &mut see) {
                Ok(true) => {}
                Ok(false) => *place = None,
                Err(why) => {
                    results[aboard.number] = Err(why);
                    *place = None;
                }
            }
        }
        if lanes.iter().all(Option::is_none) && waiting.len() == 0 {
            return results;
        }
        team.advance();
        for (lane, aboard) in lanes.iter_mut().enumerate() {
            if let Some(aboard) = aboard {
                aboard.end_tick(&team, lane);
            }
        }
    }
}

impl<'a> Aboard<'a> {
    fn new(number: usize, flight: ClosedLoop<'a, InProcess>, team: &mut Team, lane: usize) -> Self {
        let with_others = team.enter(lane, &flight.craft);
        Self { number, ticks_left: flight.plan.ticks(), flight, with_others }
    }

    /// Whether the flight goes on.
    fn begin_tick(
        &mut self,
        team: &mut Team,
        lane: usize,
        see: &mut impl FnMut(usize, &Row) -> bool,
    ) -> Result<bool, SilError> {
        let Decided { row, motors, battery_v } = self.flight.decide()?;
        if !see(self.number, &row) || self.ticks_left == 0 {
            return Ok(false);
        }
        self.ticks_left -= 1;
        let craft = &mut self.flight.craft;
        if self.with_others {
            team.begin_tick(lane, craft, &motors, battery_v);
        } else {
            craft.advance(&motors, battery_v);
        }
        Ok(true)
    }

    fn end_tick(&mut self, team: &Team, lane: usize) {
        if self.with_others {
            team.end_tick(lane, &mut self.flight.craft);
        }
        self.flight.settle();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::craft::{Fault, FaultKind, GustModel};
    use model::{Effect, Model};

    /// More flights than lanes, of all lengths, each with something that the others have not.
    fn plans() -> Vec<FlightPlan> {
        let mut all: Vec<FlightPlan> = (0..12)
            .map(|seed| {
                FlightPlan::identification(Model::thesis(), seed, 1.0 + 0.37 * (seed * 7 % 12) as f64)
            })
            .collect();
        all[1].gusts = Some(GustModel { deviation_m_s: 0.7, time_s: 0.5 });
        all[2].model.set(Effect::InputDelay, &[0.0043]);
        all[3].model.set(Effect::InputDelay, &[0.0131]);
        all[4].model.set(Effect::MotorEfficiency, &[0.1, 0.0, 0.05, 0.0]);
        all[5].model.set(Effect::SteadyWind, &[0.5, -0.4]);
        all[6].model.set(Effect::SlungLoad, &[0.05, 0.4, 0.05]);
        all[7].faults = vec![Fault { kind: FaultKind::MotorDead(2), from_s: 0.4, for_s: 1e9 }];
        (all[7].floor_m, all[7].substeps) = (Some(0.0), Some(3));
        all[8].model.set(Effect::QuadraticDrag, &[-0.1, -0.1]);
        all[9].substeps = Some(0);
        all[10].model.set(Effect::MassChange, &[0.1]);
        all[11].model.set(Effect::GroundEffect, &[1.0, 0.0]);
        all
    }

    fn alone(plan: &FlightPlan) -> Option<Vec<Row>> {
        let mut flight = ClosedLoop::in_process(plan).ok()?;
        Some((0..=plan.ticks()).map(|_| flight.step().unwrap()).collect())
    }

    #[test]
    fn flights_side_by_side_are_those_that_each_is_alone() {
        let plans = plans();
        let mut seen: Vec<Vec<Row>> = vec![Vec::new(); plans.len()];
        let results = fly_side_by_side(&plans.iter().collect::<Vec<_>>(), |number, row| {
            seen[number].push(*row);
            true
        });
        for (number, (plan, rows)) in plans.iter().zip(&seen).enumerate() {
            let expected = alone(plan);
            assert_eq!(results[number].is_ok(), expected.is_some(), "{number}");
            assert_eq!(expected.unwrap_or_default(), *rows, "{number}");
        }
        assert!(matches!(&results[9], Err(SilError::Plan { field: "substeps", .. })));
        assert!(seen[0] != seen[10]);
    }

    /// One that is ended leaves its lane to the next.
    #[test]
    fn a_flight_ends_where_it_is_told_to() {
        let plans = plans();
        let mut ticks = vec![0; plans.len()];
        fly_side_by_side(&plans.iter().collect::<Vec<_>>(), |number, _| {
            ticks[number] += 1;
            ticks[number] < 10 + number
        });
        let expected: Vec<usize> =
            (0..plans.len()).map(|number| if number == 9 { 0 } else { 10 + number }).collect();
        assert_eq!(ticks, expected);
    }
}
