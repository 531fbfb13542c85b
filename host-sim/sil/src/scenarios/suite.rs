//! Flying a set of scenarios and judging them.

use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

use design::analysis::{StepMetrics, value_at};

use super::judge::{Judge, Judged, passes};
use super::scenario::{RequirementCheck, Scenario, Settings};
use crate::flight::{FlightPlan, Recording, SilError, fly, fly_over};
use crate::flight_computer::Emulation;
#[cfg(feature = "shared-memory")]
use crate::flight_computer::Iceoryx2;

/// Times after the step at which JSON gives the response, s.
const SAMPLE_TIMES_S: [f64; 14] = [0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 10.0, 20.0, 30.0];

/// How plant and controller are joined.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Transport {
    /// In one process.
    InProcess,
    /// In two, over shared memory.
    #[cfg(feature = "shared-memory")]
    Iceoryx2 {
        /// The program that serves as controller when it is started with `--controller`.
        program: std::path::PathBuf,
    },
    /// The controller on an emulated processor of the craft.
    Emulated(Emulation),
}

/// A flown and judged scenario.
#[derive(Debug, Clone)]
pub struct ScenarioResult {
    /// Which.
    pub scenario: Scenario,
    /// What was flown.
    pub plan: FlightPlan,
    /// What happened.
    pub recording: Recording,
    /// The response divided by the step, from the step on; empty without a step.
    pub response: Vec<f64>,
    /// Its numbers; `None` without a step.
    pub metrics: Option<StepMetrics>,
    /// More than 50 % overshoot, upside down, or not finite.
    pub lost_control: bool,
    /// Ticks with a motor command at an end of its range.
    pub saturated_ticks: usize,
    /// Requirements.
    pub checks: Vec<RequirementCheck>,
}

/// All results of a run.
#[derive(Debug, Clone)]
pub struct Suite {
    /// In the order flown.
    pub outcomes: Vec<ScenarioResult>,
    /// SHA-256 of all motor commands.
    pub pwm_sha256: String,
}

impl ScenarioResult {
    /// Checks a flight against its requirements.
    pub fn new(scenario: Scenario, plan: FlightPlan, recording: Recording) -> Self {
        let mut judge = Judge::new(scenario, &plan);
        recording.rows.iter().for_each(|row| judge.tick(row));
        let Judged { response, metrics, lost_control, saturated_ticks, checks } =
            judge.end(recording.complete);
        Self { scenario, plan, recording, response, metrics, lost_control, saturated_ticks, checks }
    }

    /// Whether control was kept and every requirement holds.
    pub fn pass(&self) -> bool {
        passes(self.lost_control, &self.checks)
    }

    /// Time after the step in s and response, at the times that JSON gives.
    pub fn samples(&self) -> Vec<(f64, f64)> {
        let at = |time_s| Some((time_s, value_at(&self.response, self.recording.period_s, time_s)?));
        SAMPLE_TIMES_S.into_iter().filter_map(at).collect()
    }
}

fn fly_by(transport: &Transport, plan: &FlightPlan) -> Result<Recording, SilError> {
    match transport {
        Transport::InProcess => fly(plan),
        #[cfg(feature = "shared-memory")]
        Transport::Iceoryx2 { program } => fly_over(plan, Iceoryx2::start(program, &plan.config)?),
        Transport::Emulated(emulation) => fly_over(plan, emulation.link(&plan.config)?),
    }
}

/// SHA-256, hexadecimal, of the motor commands as f32 little endian, in order of flight, time and
/// motor.
fn pwm_sha256<'a>(recordings: impl Iterator<Item = &'a Recording>) -> String {
    let mut hash = Sha256::new();
    for row in recordings.flat_map(|recording| &recording.rows) {
        for pwm in row.output.pwm {
            hash.update(pwm.to_le_bytes());
        }
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

#[derive(Serialize)]
struct SuiteJson<'a> {
    scenarios: Vec<OutcomeJson<'a>>,
    pwm_sha256: &'a str,
}

#[derive(Serialize)]
struct OutcomeJson<'a> {
    name: &'static str,
    pass: bool,
    lost_control: bool,
    overshoot_percent: Option<f64>,
    rise_s: Option<f64>,
    settling_5_s: Option<f64>,
    settling_2_s: Option<f64>,
    steady_state_error: Option<f64>,
    saturated_ticks: usize,
    samples: Vec<(f64, f64)>,
    checks: Vec<CheckJson<'a>>,
}

#[derive(Serialize)]
struct CheckJson<'a> {
    requirement: &'a str,
    found: &'a str,
    holds: bool,
}

impl Suite {
    /// Flies `scenarios` one after the other; `progress` is called with each before it starts.
    ///
    /// # Errors
    /// What keeps a flight from being flown. A flight that ends badly is an outcome, not an error.
    pub fn fly(
        scenarios: &[Scenario],
        settings: &Settings,
        transport: &Transport,
        mut progress: impl FnMut(Scenario),
    ) -> Result<Self, SilError> {
        let mut outcomes = Vec::with_capacity(scenarios.len());
        for &scenario in scenarios {
            progress(scenario);
            let plan = scenario.plan(settings);
            let recording = fly_by(transport, &plan)?;
            outcomes.push(ScenarioResult::new(scenario, plan, recording));
        }
        let pwm_sha256 = pwm_sha256(outcomes.iter().map(|outcome| &outcome.recording));
        Ok(Self { outcomes, pwm_sha256 })
    }

    /// Whether every scenario passes.
    pub fn pass(&self) -> bool {
        self.outcomes.iter().all(ScenarioResult::pass)
    }

    /// The JSON document of `--json`, one line.
    pub fn to_json(&self) -> String {
        let scenarios = self.outcomes.iter().map(OutcomeJson::new).collect();
        let document = SuiteJson { scenarios, pwm_sha256: &self.pwm_sha256 };
        serde_json::to_string(&document).expect("numbers, strings and lists always become JSON")
    }

    /// Writes one flight file a scenario into `folder`.
    ///
    /// # Errors
    /// What the file system refuses.
    pub fn write_flights(&self, folder: &Path) -> Result<(), SilError> {
        for outcome in &self.outcomes {
            let name = format!("{}.csv", outcome.scenario);
            report::write_atomic(folder.join(&name), outcome.recording.to_flight(&*name, true).to_csv())?;
        }
        Ok(())
    }
}

impl<'a> OutcomeJson<'a> {
    fn new(outcome: &'a ScenarioResult) -> Self {
        let metrics = outcome.metrics.as_ref();
        let check = |c: &'a RequirementCheck| CheckJson {
            requirement: &c.requirement,
            found: &c.found,
            holds: c.holds,
        };
        Self {
            name: outcome.scenario.name(),
            pass: outcome.pass(),
            lost_control: outcome.lost_control,
            overshoot_percent: metrics.map(|m| m.overshoot_percent),
            rise_s: metrics.and_then(|m| m.rise_s),
            settling_5_s: metrics.and_then(|m| m.settling_5_s),
            settling_2_s: metrics.and_then(|m| m.settling_2_s),
            steady_state_error: metrics.map(|m| m.steady_state_error),
            saturated_ticks: outcome.saturated_ticks,
            samples: outcome.samples(),
            checks: outcome.checks.iter().map(check).collect(),
        }
    }
}
