//! One flight of a campaign, and what came of it.

use sil::endurance::{Crashed, Feasibility, Observer, Watched, fly_watched, until_crash};
use sil::{FlightPlan, Recording, Row};

use crate::draw::Drawn;
use crate::error::CampaignError;
use crate::flown::{Flown, Planned};
use crate::plan::{Case, Plan, Ready};
use crate::seen::Seen;

/// A flight of a campaign with all that was recorded of it.
#[derive(Debug, Clone)]
pub struct CaseFlight {
    /// What came of it.
    pub flown: Flown,
    /// What was flown.
    pub plan: FlightPlan,
    /// Every tick.
    pub recording: Recording,
}

impl Plan {
    /// Flies one case again, as a shard did.
    ///
    /// # Errors
    /// A case that there is not, or a plan that cannot be flown.
    pub fn replay(&self, case: u64, path: &std::path::Path) -> Result<CaseFlight, CampaignError> {
        self.ready(path)?.fly(self.case(case)?)
    }
}

impl Ready<'_> {
    /// Flies a case.
    pub(crate) fn fly(&self, case: Case) -> Result<CaseFlight, CampaignError> {
        self.fly_as(case, self.plan.drawn(case.draw, &self.model))
    }

    /// What comes of cases, by their numbers.
    pub(crate) fn flown(&self, numbers: &[u64]) -> Result<Vec<Flown>, CampaignError> {
        let case = |number: &u64| {
            let case = self.plan.case(*number)?;
            Ok((case, self.plan.drawn(case.draw, &self.model)))
        };
        let cases = numbers.iter().map(case).collect::<Result<_, CampaignError>>()?;
        self.fly_all(cases).collect()
    }

    /// Flies a case with other numbers than were drawn for it, and records it.
    fn fly_as(&self, case: Case, drawn: Drawn) -> Result<CaseFlight, CampaignError> {
        let planned = Planned::new(self, case, drawn);
        let record = |_, Watched { recording, crash }| {
            let mut seen = Seen::new(&planned);
            recording.rows.iter().for_each(|row| seen.tick(row));
            ((seen.end(crash), recording), vec![])
        };
        let flown = fly_watched(&[&planned.plan], record).pop();
        let none = CampaignError::NoSuchCase { case: case.number, cases: self.plan.cases() };
        let (flown, recording) = flown.ok_or(none)?.map_err(|why| planned.refused(&why))?;
        Ok(CaseFlight {
            flown: planned.judged(flown, &mut Feasibility::default()),
            plan: planned.plan,
            recording,
        })
    }

    /// What comes of a case with other numbers than were drawn for it.
    pub(crate) fn flown_as(&self, case: Case, drawn: Drawn) -> Result<Flown, CampaignError> {
        let none = CampaignError::NoSuchCase { case: case.number, cases: self.plan.cases() };
        self.fly_all(vec![(case, drawn)]).next().unwrap_or(Err(none))
    }

    /// What comes of cases with these numbers, flown side by side, each as if it was alone. Nothing is recorded: what comes of a flight is
    /// gathered while it lasts.
    pub(crate) fn fly_all(
        &self,
        cases: Vec<(Case, Drawn)>,
    ) -> impl Iterator<Item = Result<Flown, CampaignError>> {
        let planned: Vec<Planned> =
            cases.into_iter().map(|(case, drawn)| Planned::new(self, case, drawn)).collect();
        let plans: Vec<&FlightPlan> = planned.iter().map(|planned| &planned.plan).collect();
        let mut outcomes = Outcomes { planned: &planned, seen: planned.iter().map(|_| None).collect() };
        let made = until_crash(&plans, &mut outcomes);
        let mut feasibility = Feasibility::default();
        planned.into_iter().zip(made).map(move |(planned, made)| match made {
            Ok(flown) => Ok(planned.judged(flown, &mut feasibility)),
            Err(why) => Err(planned.refused(&why)),
        })
    }
}

/// Gathers what comes of flights while they last.
struct Outcomes<'a> {
    planned: &'a [Planned],
    /// Of each that has begun and not ended.
    seen: Vec<Option<Seen<'a>>>,
}

impl Observer for Outcomes<'_> {
    type Made = Flown;

    #[inline]
    fn tick(&mut self, number: usize, row: &Row) {
        self.seen[number].get_or_insert_with(|| Seen::new(&self.planned[number])).tick(row);
    }

    fn end(&mut self, number: usize, crash: Crashed) -> Flown {
        self.seen[number].take().unwrap_or_else(|| Seen::new(&self.planned[number])).end(crash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::definition::Definition;

    /// Two scenarios under two gains over everything that is not known: of each flight comes what comes of it alone.
    #[test]
    fn cases_flown_together_are_those_that_each_is_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        let text = "name = \"all\"\ndraws = 9\nscenarios = [\"tour\", \"roll-10\"]\n[unknown]\nmass_kg = [-0.1, 0.3]\n\
                    center_of_mass_m = [-0.004, 0.004]\nthrust_loss = [-0.03, 0.05]\nrotor_lag_s = [-0.008, 0.008]\n\
                    dead_time_s = [0.0, 0.015]\nwind_m_s = [-0.5, 0.5]\nwind_shear_per_s = [-0.3, 0.3]\ngust_m_s = [0.0, 0.5]\n\
                    battery_v = [-0.6, 0.5]\ndelay_samples = [0, 3]\nnoise = [0.5, 2.0]\nstart_m = [-0.5, 0.5]\nfault = 0.5\n";
        std::fs::write(&path, text).unwrap();
        let plan = Plan::new(&Definition::read(&path).unwrap(), &path, None).unwrap();
        let ready = plan.ready(&path).unwrap();
        let numbers: Vec<u64> = (0..plan.cases()).collect();
        let together = ready.flown(&numbers).unwrap();
        assert_eq!(together.len(), 36);
        for (number, one) in numbers.iter().zip(&together) {
            let alone = ready.fly(plan.case(*number).unwrap()).unwrap().flown;
            // Text, because there are quantities without a value.
            assert_eq!(format!("{alone:?}"), format!("{one:?}"));
        }
        let lost = together.iter().filter(|one| one.lost.is_some()).count();
        assert!((1..36).contains(&lost), "{lost} lost: some flights end early");
    }
}
