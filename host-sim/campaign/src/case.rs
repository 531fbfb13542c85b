//! One flight of a campaign, and what came of it.

use control::state_machine::{Action, action};
use control::{Condition, Conditions, State};
use sil::endurance::{Crash, Feasibility, Watched, fly_watched};
use sil::{FlightPlan, Recording, Row, ScenarioResult, SilError};

use crate::draw::{Drawn, Flies};
use crate::error::CampaignError;
use crate::plan::{Case, Plan, Ready};

/// State of the supervisor in a flight that was flown as commanded.
pub(crate) const FLYING: &str = "flying";
/// Between names of conditions.
pub(crate) const SEPARATOR: &str = "; ";

/// What came of a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Flown {
    /// Which.
    pub case: Case,
    /// What was drawn for it.
    pub drawn: Drawn,
    /// How long it was to be, s.
    pub duration_s: f64,
    /// How the craft was lost, and after how many s: a crash, the motors cut, or upside down. A reason of physics does not count.
    pub lost: Option<(String, f64)>,
    /// Why no gains could fly this craft in this air: it cannot hover.
    pub impossible: Option<String>,
    /// Who had the craft at the end: the state of the supervisor.
    pub ended: String,
    /// Conditions that the supervisor saw in the flight.
    pub events: String,
    /// Whether the scenario's requirements hold; nothing of a tour.
    pub requirements_hold: Option<bool>,
    /// Overshoot of a step, percent.
    pub overshoot_percent: f64,
    /// Rise time of a step, s.
    pub rise_s: f64,
    /// Greatest tilt, deg.
    pub tilt_deg: f64,
    /// Root mean square of the distance from the commanded height, m.
    pub height_error_m: f64,
    /// Share of the ticks with a motor at an end of its range, percent.
    pub saturated_percent: f64,
}

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

    /// Flies a case with other numbers than were drawn for it.
    pub(crate) fn fly_as(&self, case: Case, drawn: Drawn) -> Result<CaseFlight, CampaignError> {
        let mut flown = self.fly_with(vec![(case, drawn)], |flown, recording| ((flown, recording), vec![]));
        let none = CampaignError::NoSuchCase { case: case.number, cases: self.plan.cases() };
        let (plan, (flown, recording)) = flown.next().unwrap_or(Err(none))?;
        Ok(CaseFlight { flown: flown.judged(&plan, &mut Feasibility::default()), plan, recording })
    }

    /// What comes of cases with these numbers, flown side by side, each as if it was alone.
    pub(crate) fn fly_all(
        &self,
        cases: Vec<(Case, Drawn)>,
    ) -> impl Iterator<Item = Result<Flown, CampaignError>> {
        let mut feasibility = Feasibility::default();
        let all = self.fly_with(cases, |flown, recording| (flown, recording.rows));
        all.map(move |one| one.map(|(plan, flown)| flown.judged(&plan, &mut feasibility)))
    }

    /// Flies them, and makes something of each while its recording is at hand; with the rows that it gives back the next is flown.
    fn fly_with<T>(
        &self,
        cases: Vec<(Case, Drawn)>,
        mut make: impl FnMut(Flown, Recording) -> (T, Vec<Row>),
    ) -> impl Iterator<Item = Result<(FlightPlan, T), CampaignError>> {
        let flights: Vec<Planned> =
            cases.into_iter().map(|(case, drawn)| Planned::new(self, case, drawn)).collect();
        let plans: Vec<&FlightPlan> = flights.iter().map(|flight| &flight.plan).collect();
        let made = fly_watched(&plans, |number, watched| {
            let (flown, recording) = flights[number].came_of(watched);
            make(flown, recording)
        });
        flights.into_iter().zip(made).map(|(flight, made)| {
            let refused =
                |why: SilError| CampaignError::Flight { case: flight.case.number, why: why.to_string() };
            let made = made.map_err(refused)?;
            Ok((flight.plan, made))
        })
    }
}

/// A flight before it is flown.
struct Planned {
    case: Case,
    drawn: Drawn,
    flies: Flies,
    plan: FlightPlan,
}

impl Planned {
    fn new(ready: &Ready<'_>, case: Case, drawn: Drawn) -> Self {
        let flies = ready.flies[case.scenario];
        Self { case, flies, plan: drawn.plan(flies, &ready.configs[case.gains]), drawn }
    }

    /// What came of it, but for whether anybody could have flown it, and its recording.
    fn came_of(&self, watched: Watched) -> (Flown, Recording) {
        let mut recording = watched.recording;
        let mut lost = watched.crash.map(|(crash, at_s)| (told(&crash), at_s));
        let tilted = recording.rows.iter().position(|row| row.truth.upright() <= 0.0);
        if let Some(row) = tilted.filter(|_| lost.is_none()) {
            lost = Some(("upside down".into(), recording.time_s(row)));
        }
        let (mut requirements_hold, mut overshoot_percent, mut rise_s) = (None, f64::NAN, f64::NAN);
        if let Flies::Scenario(scenario) = self.flies {
            let result = ScenarioResult::new(scenario, self.plan.clone(), recording);
            requirements_hold = Some(result.pass());
            if let Some(metrics) = result.metrics {
                overshoot_percent = metrics.overshoot_percent;
                rise_s = metrics.rise_s.unwrap_or(f64::NAN);
            }
            recording = result.recording;
        }
        let flown = Flown {
            case: self.case,
            drawn: self.drawn.clone(),
            duration_s: self.plan.duration_s,
            lost,
            impossible: None,
            ended: recording
                .rows
                .last()
                .map_or(String::new(), |row| format!("{:?}", row.supervision.state).to_lowercase()),
            events: events(&recording),
            requirements_hold,
            overshoot_percent,
            rise_s,
            tilt_deg: tilt_deg(&recording),
            height_error_m: height_error_m(&recording),
            saturated_percent: 100.0 * recording.saturated_ticks(self.plan.config.command_range) as f64
                / recording.rows.len().max(1) as f64,
        };
        (flown, recording)
    }
}

impl Flown {
    /// The same with whether anybody could have flown it, which is no matter of how it was flown.
    fn judged(mut self, plan: &FlightPlan, feasibility: &mut Feasibility) -> Self {
        self.impossible = feasibility.impossible(plan).map(|why| why.to_string());
        self.lost = self.lost.filter(|_| self.impossible.is_none());
        self
    }
}

/// A crash in words without numbers, so that equal ones can be counted.
fn told(crash: &Crash) -> String {
    match crash {
        Crash::Cut(conditions) => {
            let cuts = |condition: &&Condition| {
                action(State::Flying, Conditions::from_bits(condition.bit())) >= Action::Cut
            };
            let names: Vec<&str> = conditions.iter().filter(cuts).map(|condition| condition.name()).collect();
            format!("motors cut: {}", names.join(", "))
        }
        Crash::DisarmedAt(_) => "disarmed in the air".into(),
        Crash::Floor(_) => "hit the floor".into(),
        Crash::Cage(_) => "left the cage".into(),
        Crash::Lost => "not finite".into(),
    }
}

/// The names of all conditions that the supervisor saw.
fn events(recording: &Recording) -> String {
    let seen = recording.rows.iter().fold(0, |seen, row| seen | row.supervision.conditions);
    let names: Vec<&str> = Conditions::from_bits(seen).iter().map(|condition| condition.name()).collect();
    names.join(SEPARATOR)
}

fn tilt_deg(recording: &Recording) -> f64 {
    let least = recording.rows.iter().map(|row| row.truth.upright()).fold(1.0, f64::min);
    least.clamp(-1.0, 1.0).acos().to_degrees()
}

fn height_error_m(recording: &Recording) -> f64 {
    let square = |row: &sil::Row| f64::from(row.truth.position_m[2] - row.output.z_command_m).powi(2);
    (recording.rows.iter().map(square).sum::<f64>() / recording.rows.len().max(1) as f64).sqrt()
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
