//! The whole loop: identify, diagnose, add what is found, until nothing that the flights support is left.

use diagnosis::{Addition, Diagnosis, Verdict};
use model::{Effect, Model, Vehicle};
use sysid::Comparison;

use crate::cli::flights::Sets;
use crate::commands::{add, diagnose, identify};

/// One round: a diagnosis and the effect that was added after it.
pub(crate) struct Step {
    /// What was found before the effect joined.
    pub(crate) diagnosis: Diagnosis,
    /// The effect.
    pub(crate) effect: Effect,
    /// Its evidence and the errors without and with it.
    pub(crate) addition: Addition,
    /// The model with it.
    pub(crate) model: Model,
    /// The model with it against the held-out flights.
    pub(crate) comparison: Comparison,
}

/// From the basic model to one in which nothing supported is missing.
pub(crate) struct Story {
    /// The basic model.
    pub(crate) basic: Model,
    /// The basic model against the held-out flights.
    pub(crate) basic_comparison: Comparison,
    /// Effects in the order they were added.
    pub(crate) steps: Vec<Step>,
    /// What is found in the last model.
    pub(crate) last_diagnosis: Diagnosis,
}

impl Story {
    /// The model at the end.
    pub(crate) fn last_model(&self) -> &Model {
        self.steps.last().map_or(&self.basic, |step| &step.model)
    }

    /// The model at the end against the held-out flights.
    pub(crate) fn last_comparison(&self) -> &Comparison {
        self.steps.last().map_or(&self.basic_comparison, |step| &step.comparison)
    }

    /// What was found, in a sentence, and what was not.
    pub(crate) fn conclusion(&self) -> String {
        let found: Vec<&str> = self.found().iter().map(|e| e.id()).collect();
        match found.as_slice() {
            [] => format!("Found: nothing. {}", self.last_diagnosis.summary),
            names => format!("Found: {}.", names.join(", then ")),
        }
    }

    /// The conclusion of the whole loop: was anything missing, and is anything left?
    pub(crate) fn verdict(&self) -> Verdict {
        match (self.steps.is_empty(), self.last_diagnosis.verdict) {
            (false, Verdict::Adequate) => Verdict::MissingEffect,
            (_, last) => last,
        }
    }

    /// Effects in the order they were added.
    pub(crate) fn found(&self) -> Vec<Effect> {
        self.steps.iter().map(|step| step.effect).collect()
    }
}

/// Goes through the loop. It ends: every round adds an effect that the model does not have.
pub(crate) fn tell(
    vehicle: &Vehicle,
    sets: &mut Sets,
    options: &diagnosis::Options,
    json: bool,
) -> anyhow::Result<Story> {
    let basic = identify::identify(vehicle, sets, json)?.model;
    let basic_comparison = sysid::compare(&basic, &sets.validate());
    let mut steps: Vec<Step> = Vec::new();
    loop {
        let model = steps.last().map_or(&basic, |step| &step.model);
        let diagnosis = diagnose::diagnose(model, sets, options, json)?;
        let Some(effect) = diagnosis.best() else {
            return Ok(Story { basic, basic_comparison, steps, last_diagnosis: diagnosis });
        };
        let (better, addition) = add::add(model, effect, sets, json)?;
        let comparison = sysid::compare(&better, &sets.validate());
        steps.push(Step { diagnosis, effect, addition, model: better, comparison });
    }
}
