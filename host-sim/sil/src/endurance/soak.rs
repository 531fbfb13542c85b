//! A soak: one craft's program, never switched off, flies [`Missions`] for hours of its own time. The
//! first thing that must not be ends the run.

use std::fmt;

use ::craft::LinkStatus;
use control::Config;
use model::Model;
use proto::Message;

use super::error::LongRunError;
use super::memory::{Memory, resident};
use super::missions::{Missions, Seen};
use crate::flight::FlightPlan;
use crate::laboratory::Laboratory;

/// How long, and with which seed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Soak {
    /// Simulated time, s.
    pub duration_s: f64,
    /// What flies.
    pub config: Config,
    /// Seed of the noise and of the first tour.
    pub seed: u64,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct SoakReport {
    /// Missions that were flown to their end.
    pub missions: u64,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// Of which in the air, s.
    pub flown_s: f64,
    /// What ended the run before its time.
    pub problem: Option<String>,
    /// Memory at its half and its end.
    pub memory: Memory,
}

impl SoakReport {
    /// Nothing happened, and the memory did not grow.
    pub fn holds(&self) -> bool {
        self.problem.is_none() && self.memory.is_flat()
    }
}

impl fmt::Display for SoakReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hours = |seconds: f64| seconds / 3600.0;
        let (simulated, flown) = (hours(self.simulated_s), hours(self.flown_s));
        writeln!(
            f,
            "{simulated:.2} h simulated, {flown:.2} h of them in flight, {} missions",
            self.missions
        )?;
        match &self.problem {
            Some(problem) => writeln!(f, "ENDED: {problem}")?,
            None => writeln!(f, "no crash, and nothing found but low batteries")?,
        }
        writeln!(f, "memory: {}", self.memory)
    }
}

/// Flies for so long.
///
/// # Errors
/// A flight plan that cannot be flown, or memory that cannot be measured.
pub fn soak(plan: &Soak) -> Result<SoakReport, LongRunError> {
    let flight =
        FlightPlan { config: plan.config, ..FlightPlan::identification(Model::thesis(), plan.seed, 1.0) };
    let mut lab = Laboratory::new(&flight, 0.0)?;
    let mut missions = Missions::new(Missions::tours, plan.seed, lab.period_s());
    let ticks = (plan.duration_s / lab.period_s()).ceil() as u64;
    let (mut half, mut problem) = (None, None);
    for tick in 1..=ticks {
        problem = fly_tick(&mut lab, &mut missions).err();
        if tick * 2 >= ticks && half.is_none() {
            half = Some(resident()?);
        }
        if problem.is_some() {
            break;
        }
    }
    let end = resident()?;
    let [simulated_s, flown_s] = missions.times_s();
    let memory = Memory { half: half.unwrap_or(end), end };
    Ok(SoakReport { missions: missions.flown(), simulated_s, flown_s, problem, memory })
}

/// One tick of the craft, and the ground's answer to it.
fn fly_tick(lab: &mut Laboratory, missions: &mut Missions) -> Result<(), String> {
    let pose = lab.tick();
    let mut supervision = None;
    while let Some(message) = lab.next_message(&LinkStatus::default()) {
        if let Message::Telemetry(telemetry) = message {
            supervision = Some(telemetry.supervision);
        }
    }
    let said = missions.tick(&Seen { pose, position_m: lab.position_m(), supervision })?;
    said.iter().for_each(|message| lab.hear(0, message));
    if missions.battery_is_due() {
        lab.change_battery();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::designed_config;

    /// Ten minutes: four missions, both ways of coming down.
    #[test]
    fn missions_follow_each_other_and_leave_nothing_behind() {
        let plan = Soak { duration_s: 600.0, config: designed_config().unwrap(), seed: 5 };
        let found = soak(&plan).unwrap();
        // What other tests of this process do to its memory is not this run's.
        assert!(found.problem.is_none() && found.missions >= 3, "{found}");
        assert!(found.flown_s > 0.9 * found.simulated_s, "{found}");
    }

    /// It would see a crash: the thesis' gains under a rate that they are not for.
    #[test]
    fn a_craft_that_cannot_be_flown_ends_the_run() {
        let mut config = designed_config().unwrap();
        if let control::gains::Law::ModelBased(law) = &mut config.law {
            law.loops.roll.kp *= 8.0;
        }
        let found = soak(&Soak { duration_s: 60.0, config, seed: 5 }).unwrap();
        assert!(found.problem.is_some() && !found.holds() && found.simulated_s < 60.0, "{found}");
    }
}
