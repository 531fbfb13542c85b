//! Looks at what an effect would do to a model: fitted as the job "add" fits it, and nothing is kept in the folder.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};

use diagnosis::workflow::{self, Added, Observer, WorkflowError};
use model::{Effect, Model, Vehicle};

use super::refused::Refused;
use super::session::Session;
use super::trials::Trial;
use super::views::Seen;
use crate::cli::effect_names::known_effect;

/// Hears nothing, and stops work for which nobody waits any longer: a look is no job, and its warnings come with the job.
struct Unheard(Arc<AtomicBool>);

impl Observer for Unheard {
    fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl Session {
    /// A flight seen by a model, fitted with one effect more where one is named.
    pub(super) fn seen_with(
        &self,
        model: u32,
        effect: Option<&str>,
        flight: &str,
        cancel: &Arc<AtomicBool>,
    ) -> Result<Arc<Seen>, Refused> {
        let Some(effect) = effect else { return self.seen(model, flight) };
        let trial = self.trial(model, known_effect(effect)?, cancel)?;
        self.seen_by((model, Some(trial.number)), flight, || Ok(trial.with))
    }

    /// Fits a model with one effect more to the flights that are chosen.
    pub(super) fn fit_with(
        &self,
        model: &Model,
        effect: Effect,
        vehicle: &Vehicle,
        observer: &dyn Observer,
    ) -> Result<Added, Refused> {
        if model.has(effect) {
            return Err(Refused::new(format!("the model has {effect} already")));
        }
        let mut sets = self.sets(vehicle, observer)?;
        Ok(workflow::add(model, effect, &mut sets, None, observer)?)
    }

    /// The trial, fitted if it was not yet: one at a time, and nothing else waits for it.
    fn trial(&self, id: u32, effect: Effect, cancel: &Arc<AtomicBool>) -> Result<Trial, Refused> {
        if let Some(trial) = self.lock().trials.of(id, effect) {
            return Ok(trial);
        }
        let _trying = self.trying.lock().unwrap_or_else(PoisonError::into_inner);
        let (vehicle, forgotten) = {
            let state = self.lock();
            // Who had it before may have fitted it.
            if let Some(trial) = state.trials.of(id, effect) {
                return Ok(trial);
            }
            state.has_no_job()?;
            state.has_read()?;
            let craft = state.craft.as_ref();
            let craft = craft.ok_or_else(|| Refused::new("there is no flight in this folder yet"))?;
            (craft.vehicle.clone(), state.trials.forgotten)
        };
        let unheard = Unheard(cancel.clone());
        if unheard.is_cancelled() {
            return Err(WorkflowError::Cancelled.into());
        }
        let with = self.fit_with(&self.node(id)?.model, effect, &vehicle, &unheard)?.model;
        let mut state = self.lock();
        if state.trials.forgotten != forgotten {
            return Err(Refused::new("flights or effects have changed meanwhile: point at the card again"));
        }
        Ok(state.trials.keep(id, effect, with))
    }
}
