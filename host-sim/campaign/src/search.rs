//! The worst that what is not known can do, by search: a swarm of flights looks for numbers that lose the craft, beside as many flights
//! that are drawn.
//!
//! A loss that is rare among the draws, in a corner of what is not known, is found in some hundred flights; that none is found shows
//! nothing. The swarm is that of the crate argmin (Zambrano-Bigiarini and others, IEEE CEC 2013).

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::particleswarm::ParticleSwarm;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::causes::{Causes, Needed, is_whole};
use crate::definition::{Samples, Spread, Unknown, limits};
use crate::draw::{DELAY, Drawn, Input, parts};
use crate::error::CampaignError;
use crate::flown::Flown;
use crate::normal::Normal;
use crate::part::together;
use crate::plan::{Case, Plan, Ready};

/// Flights that go together.
const SWARM: usize = 24;
/// How far the search goes into a normal distribution, standard deviations.
const DEVIATIONS: f64 = 3.0;

/// What is searched.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Name of the gains; the first of the plan without.
    pub gains: Option<String>,
    /// Name of the scenario; the first of the plan without.
    pub scenario: Option<String>,
    /// Flights of the search, and as many that are drawn.
    pub flights: u64,
    /// Seed of the swarm.
    pub seed: u64,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Found {
    /// Under which gains.
    pub gains: String,
    /// In which scenario.
    pub scenario: String,
    /// Flights of the search.
    pub flights: u64,
    /// Of them lost.
    pub lost: u64,
    /// Of as many flights with drawn numbers and the same tour and noise, without faults, lost.
    pub sampled_lost: u64,
    /// How the worst flight was lost; absent where none was.
    pub lost_by: Option<String>,
    /// After how many s.
    pub after_s: Option<f64>,
    /// Greatest tilt of the worst flight, deg.
    pub tilt_deg: f64,
    /// The numbers of the worst flight.
    pub worst: Vec<Needed>,
    /// The fewest of its conditions that lose it.
    pub causes: Option<Causes>,
    /// The worst after each flight: -1 less the share of the flight that was left when the craft was lost; above -1, minus half the
    /// greatest tilt over 90 deg and half the error of height in m.
    pub searched: Vec<f64>,
    /// The same of the flights that were drawn.
    pub sampled: Vec<f64>,
}

impl Found {
    /// Whether the worst flight is lost only with this number as it is; nothing where it was not lost.
    pub fn needs(&self, name: &str) -> Option<bool> {
        let causes = self.causes.as_ref()?;
        Some(causes.needed.iter().any(|needed| needed.name == name))
    }
}

/// A number that is searched, between its ends.
struct Dimension {
    name: &'static str,
    ends: [f64; 2],
}

/// Flights at points of the search.
struct Trials<'a> {
    ready: &'a Ready<'a>,
    case: Case,
    nominal: &'a Drawn,
    dimensions: &'a [Dimension],
    /// Badness of every flight, in the order of the search.
    all: Mutex<Vec<f64>>,
}

impl Trials<'_> {
    fn at(&self, point: &[f64]) -> Drawn {
        let value = |input: &Input| {
            let found = self.dimensions.iter().zip(point).find(|(dimension, _)| dimension.name == input.name);
            found.map_or(input.usual, |(_, value)| if is_whole(input) { value.round() } else { *value })
        };
        self.nominal.changed(value, false, &self.ready.model)
    }

    fn fly(&self, drawn: Drawn) -> Result<Flown, CampaignError> {
        self.ready.flown_as(self.case, drawn)
    }
}

impl CostFunction for &Trials<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, point: &Vec<f64>) -> Result<f64, Error> {
        Ok(badness(&self.fly(self.at(point))?))
    }

    fn bulk_cost<P>(&self, points: &[P]) -> Result<Vec<f64>, Error>
    where
        P: std::borrow::Borrow<Vec<f64>> + argmin::core::SyncAlias,
        Vec<f64>: argmin::core::SendAlias,
        f64: argmin::core::SendAlias,
        Self: argmin::core::SyncAlias,
    {
        let points: Vec<&Vec<f64>> = points.iter().map(std::borrow::Borrow::borrow).collect();
        let drawn = |points: &[&Vec<f64>]| points.iter().map(|point| self.at(point)).collect();
        let fly = |points: &[&Vec<f64>]| badnesses(self.ready, self.case, drawn(points));
        let found: Vec<Vec<f64>> = points.par_chunks(SWARM / 3).map(fly).collect::<Result<_, _>>()?;
        let found = found.concat();
        self.all.lock().unwrap_or_else(PoisonError::into_inner).extend(&found);
        Ok(found)
    }
}

/// The lower, the worse: see [`Found::searched`]. Flights that nobody could fly do not count.
fn badness(flown: &Flown) -> f64 {
    match (&flown.impossible, &flown.lost) {
        (Some(_), _) => 0.0,
        (None, Some((_, after_s))) => -1.0 - (1.0 - after_s / flown.duration_s).clamp(0.0, 1.0),
        (None, None) => -0.5 * (flown.tilt_deg / 90.0).min(1.0) - 0.5 * flown.height_error_m.min(1.0),
    }
}

/// How bad flights of a case with these numbers are.
fn badnesses(ready: &Ready<'_>, case: Case, drawn: Vec<Drawn>) -> Result<Vec<f64>, CampaignError> {
    let cases = drawn.into_iter().map(|drawn| (case, drawn)).collect();
    ready.fly_all(cases).map(|flown| Ok(badness(&flown?))).collect()
}

impl Plan {
    /// Searches what is not known for what is worst.
    ///
    /// # Errors
    /// Gains or a scenario that there are not, nothing to search, or a flight that cannot be flown.
    pub fn search(&self, wanted: &Wanted, path: &Path) -> Result<Found, CampaignError> {
        let ready = self.ready(path)?;
        let case = self.searched_case(wanted, path)?;
        let nominal = self.drawn(case.draw, &ready.model);
        let dimensions = dimensions(&self.campaign.unknown, &ready);
        if dimensions.is_empty() {
            let why = "unknown: names no number that a search could change; coefficients are drawn only";
            return Err(CampaignError::content(path, why));
        }
        let trials =
            Trials { ready: &ready, case, nominal: &nominal, dimensions: &dimensions, all: Mutex::default() };
        let best = swarm(&trials, wanted).map_err(|why| CampaignError::content(path, why.to_string()))?;
        let worst = trials.at(&best);
        let flown = trials.fly(worst.clone())?;
        let searched = trials.all.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let sampled = self.sampled(&trials, searched.len() as u64)?;
        let causes = flown.lost.is_some().then(|| ready.causes(case, worst)).transpose()?.flatten();
        Ok(Found {
            gains: self.campaign.gains[case.gains].name.clone(),
            scenario: self.campaign.scenarios[case.scenario].clone(),
            flights: searched.len() as u64,
            lost: lost(&searched),
            sampled_lost: lost(&sampled),
            lost_by: flown.lost.as_ref().map(|(why, _)| why.clone()),
            after_s: flown.lost.as_ref().map(|(_, after_s)| *after_s),
            tilt_deg: flown.tilt_deg,
            worst: flown.drawn.inputs.into_iter().map(Needed::from).collect(),
            causes,
            searched: so_far(&searched),
            sampled: so_far(&sampled),
        })
    }

    /// The first draw's case under the gains and in the scenario.
    fn searched_case(&self, wanted: &Wanted, path: &Path) -> Result<Case, CampaignError> {
        let place = |kind: &str, names: Vec<&str>, name: &Option<String>| match name {
            None => Ok(0),
            Some(name) => names.iter().position(|own| own == name).ok_or_else(|| {
                CampaignError::content(
                    path,
                    format!("has no {kind} named '{name}'; it has: {}", names.join(", ")),
                )
            }),
        };
        let campaign = &self.campaign;
        let gains =
            place("gains", campaign.gains.iter().map(|one| one.name.as_str()).collect(), &wanted.gains)?;
        let scenarios = campaign.scenarios.iter().map(String::as_str).collect();
        let scenario = place("scenario", scenarios, &wanted.scenario)?;
        self.case((scenario * campaign.gains.len() + gains) as u64)
    }

    /// How bad as many draws of the same numbers are, in the same flight.
    fn sampled(&self, trials: &Trials<'_>, flights: u64) -> Result<Vec<f64>, CampaignError> {
        let Trials { ready, case, nominal, dimensions, .. } = *trials;
        let numbers = |draw: &u64| {
            let own = self.drawn(*draw, &ready.model);
            let is_searched = |input: &Input| dimensions.iter().any(|dimension| dimension.name == input.name);
            let value = |input: &Input| match own.value(&input.name) {
                Some(value) if is_searched(input) => value,
                _ => input.usual,
            };
            nominal.changed(value, false, &ready.model)
        };
        let fly = |draws: &[u64]| badnesses(ready, case, draws.iter().map(numbers).collect());
        let draws: Vec<u64> = (0..flights).collect();
        let together = together(draws.len(), rayon::current_num_threads());
        let found: Vec<Vec<f64>> =
            draws.par_chunks(together).map(fly).collect::<Result<_, CampaignError>>()?;
        Ok(found.concat())
    }
}

/// Every number of a plan with its ends.
fn dimensions(unknown: &Unknown, ready: &Ready<'_>) -> Vec<Dimension> {
    let mut all = Vec::new();
    for (quantity, spread) in unknown.spreads() {
        let [least, most] = limits(quantity, &ready.model);
        let ends = match spread {
            None => continue,
            Some(Spread::Range(ends)) => ends,
            Some(Spread::Normal(Normal { mean, deviation })) => {
                [-DEVIATIONS, DEVIATIONS].map(|times| mean + times * deviation)
            }
        };
        let ends = ends.map(|end| end.clamp(least, most));
        all.extend(parts(quantity).iter().map(|name| Dimension { name, ends }));
    }
    if let Some(Samples::Range(ends)) = unknown.delay_samples {
        all.push(Dimension { name: DELAY, ends: ends.map(f64::from) });
    }
    all.retain(|dimension| dimension.ends[0] < dimension.ends[1]);
    all
}

/// The worst point that a swarm finds.
fn swarm(trials: &Trials<'_>, wanted: &Wanted) -> Result<Vec<f64>, Error> {
    let end = |k: usize| trials.dimensions.iter().map(|dimension| dimension.ends[k]).collect::<Vec<f64>>();
    let solver = ParticleSwarm::new((end(0), end(1)), SWARM)
        .with_rng_generator(Xoshiro256PlusPlus::seed_from_u64(wanted.seed));
    // The first round is that of the start.
    let rounds = wanted.flights.div_ceil(SWARM as u64).max(2) - 1;
    let found = Executor::new(trials, solver).configure(|state| state.max_iters(rounds)).run()?;
    let best = found.state.best_individual.map(|particle| particle.position);
    Ok(best.unwrap_or_else(|| end(0)))
}

fn lost(all: &[f64]) -> u64 {
    all.iter().filter(|badness| **badness <= -1.0).count() as u64
}

/// The lowest of the values up to each.
fn so_far(all: &[f64]) -> Vec<f64> {
    let mut lowest = f64::INFINITY;
    all.iter()
        .map(|badness| {
            lowest = lowest.min(*badness);
            lowest
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::definition::Definition;

    /// Mass and weak motors lose the craft only where both are near their ends: some thousandths of the draws.
    #[test]
    fn a_corner_that_draws_miss_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        let text = "name = \"corner\"\ndraws = 10\nscenarios = [\"hover\"]\n[unknown]\nmass_kg = [0.0, 0.45]\n\
                    thrust_loss = [0.0, 0.28]\n";
        std::fs::write(&path, text).unwrap();
        let plan = Plan::new(&Definition::read(&path).unwrap(), &path, None).unwrap();
        let wanted = Wanted { gains: Some("designed".into()), scenario: None, flights: 240, seed: 1 };
        let found = plan.search(&wanted, &path).unwrap();
        println!(
            "{} of {} lost, sampled {}: {:?}",
            found.lost, found.flights, found.sampled_lost, found.worst
        );
        assert_eq!((found.flights, found.searched.len(), found.sampled.len()), (240, 240, 240));
        assert!(found.lost > 3 * found.sampled_lost.max(1), "{found:?}");
        assert!(found.searched.last() <= found.sampled.last());
        let causes = found.causes.clone().unwrap();
        assert!(causes.needed.iter().all(|needed| needed.value >= needed.usual), "{causes:?}");
        // Equal seeds find the same, whatever the number of threads.
        let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(again.install(|| plan.search(&wanted, &path).unwrap()), found);
    }

    #[test]
    fn what_cannot_be_searched_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        std::fs::write(&path, "name = \"none\"\ndraws = 10\nscenarios = [\"hover\"]\n").unwrap();
        let plan = Plan::new(&Definition::read(&path).unwrap(), &path, None).unwrap();
        let refused = |gains: Option<&str>, scenario: Option<&str>| {
            let wanted = Wanted {
                gains: gains.map(str::to_owned),
                scenario: scenario.map(str::to_owned),
                flights: 10,
                seed: 1,
            };
            plan.search(&wanted, &path).unwrap_err().to_string()
        };
        assert!(refused(None, None).contains("names no number"));
        assert!(refused(Some("mine"), None).contains("has no gains named 'mine'; it has: designed, thesis"));
        assert!(refused(None, Some("tour")).contains("has no scenario named 'tour'; it has: hover"));
    }
}
