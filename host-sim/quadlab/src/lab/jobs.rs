//! Long work: one job at a time, on a thread of its own, so that looking is never blocked.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use diagnosis::workflow::{self, Explanation, FlightSets, FlightsOfOneKind, Reading};
use diagnosis::{Diagnosis, Discovery, EffectFinding, Options};
use model::user_effects::file_of;
use model::{Effect, Model, Vehicle};
use serde::Deserialize;
use serde_json::{Value, json};

use super::flights::Use;
use super::node::Node;
use super::refused::Refused;
use super::session::{Job, Session, Telling};
use super::terminal::names;
use crate::cli::effect_names::known_effect;
use crate::render::discovery;

/// What the page asks for.
#[derive(Debug, Deserialize)]
#[serde(tag = "do", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum Task {
    /// Fit the basic model.
    Identify,
    /// Which effect does a model lack?
    Diagnose { model: u32 },
    /// Add an effect to a model.
    Add { model: u32, effect: String },
    /// What has changed since a model was good?
    Changed { model: u32 },
    /// What does the unknown effect look like that a model lacks?
    Discover { model: u32 },
    /// All of it, until nothing supported is missing.
    Explain,
}

impl Task {
    fn kind(&self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Diagnose { .. } => "diagnose",
            Self::Add { .. } => "add",
            Self::Changed { .. } => "changed",
            Self::Discover { .. } => "discover",
            Self::Explain => "explain",
        }
    }
}

/// Starts a job; another one may not be running.
pub(super) fn start(session: &Arc<Session>, task: Task) -> Result<(), Refused> {
    let kind = task.kind();
    let cancel = Arc::new(AtomicBool::new(false));
    let vehicle = {
        let mut state = session.lock();
        state.has_no_job()?;
        state.has_read()?;
        if let Some(problem) = &state.problem {
            return Err(Refused::new(problem));
        }
        let Some(vehicle) = state.craft.as_ref().map(|craft| craft.vehicle.clone()) else {
            return Err(Refused::new("there is no flight in this folder yet: drop flights on the page"));
        };
        state.job = Some(Job { kind, activity: "starting".into(), steps: None, cancel: cancel.clone() });
        vehicle
    };
    session.events.changed();
    let (session, stopped, cancel) = (session.clone(), cancel.clone(), Some(cancel));
    std::thread::spawn(move || {
        let work = Work {
            session: &session,
            vehicle: &vehicle,
            telling: Telling { session: &session, kind, cancel },
        };
        // A bug in the work must not leave a page that waits for ever.
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work.run(task)));
        let done = done
            .unwrap_or_else(|_| Err(Refused::new(format!("{kind} has failed: this is a bug of quadlab"))));
        // Who cancels knows why nothing came.
        let error = done.err().filter(|_| !stopped.load(Ordering::Relaxed)).map(Refused::into_sentence);
        session.lock().job = None;
        session.events.changed();
        session.events.tell("finished", json!({ "do": kind, "error": error }));
    });
    Ok(())
}

/// Asks the job that runs to stop.
pub(super) fn cancel(session: &Session) {
    if let Some(job) = &session.lock().job {
        job.cancel.store(true, Ordering::Relaxed);
    }
}

struct Work<'a> {
    session: &'a Session,
    vehicle: &'a Vehicle,
    telling: Telling<'a>,
}

impl Work<'_> {
    fn run(&self, task: Task) -> Result<(), Refused> {
        match task {
            Task::Identify => self.identify(),
            Task::Diagnose { model } => self.diagnose(model),
            Task::Add { model, effect } => self.add(model, &effect),
            Task::Changed { model } => self.changed(model),
            Task::Discover { model } => self.discover(model),
            Task::Explain => self.explain(),
        }
    }

    fn sets(&self) -> Result<FlightSets, Refused> {
        self.session.sets(self.vehicle, &self.telling)
    }

    fn identify(&self) -> Result<(), Refused> {
        let mut sets = self.sets()?;
        let identified =
            workflow::identify(self.vehicle, &self.session.own_effects(), &mut sets, None, &self.telling)?;
        let before = format!("identify{}", self.session.vehicle_option());
        self.keep(None, None, identified.model, &self.session.command(&before))?;
        Ok(())
    }

    fn diagnose(&self, id: u32) -> Result<(), Refused> {
        let model = self.session.node(id)?.model;
        let mut sets = self.sets()?;
        let own = self.session.own_effects();
        let diagnosis = workflow::diagnose(&model, &own, &mut sets, &Options::default(), &self.telling)?;
        self.session.tell_of(id, |node| node.diagnosis = Some(document(&diagnosis)))
    }

    fn changed(&self, id: u32) -> Result<(), Refused> {
        let model = self.session.node(id)?.model;
        let files = self.session.files(Use::Later);
        if files.is_empty() {
            return Err(Refused::new("no flight is marked as flown later: choose one in the table"));
        }
        let flights = self.session.loaded(Use::Later);
        let mut flights = FlightsOfOneKind::from_loaded(flights, &model.vehicle, Reading::default())?;
        let own = self.session.own_effects();
        let found = workflow::changed(&model, &own, &mut flights, &Options::default(), &self.telling);
        let mut changes = document(&found?);
        let command = format!(
            "quadlab diagnose --model lab/model-{id}.toml --changed {}{}",
            names(&files),
            self.session.effects_option()
        );
        changes["command"] = json!(command);
        let of = flights.flights.iter().map(|flight| flight.prepared.name.as_str());
        changes["flights"] = of.collect::<Vec<_>>().into();
        self.session.tell_of(id, |node| node.changes = Some(changes))
    }

    fn discover(&self, id: u32) -> Result<(), Refused> {
        workflow::prepare_to_discover();
        self.session.read_further_columns()?;
        let model = self.session.node(id)?.model;
        let mut sets = self.sets()?;
        let own = self.session.own_effects();
        let found = workflow::discover(&model, &own, &mut sets, &Options::default(), &self.telling)?;
        let command = self.session.command(&format!("discover --model lab/model-{id}.toml"));
        self.session.tell_of(id, |node| node.discovery = Some(discovered(id, &found, &command)))
    }

    fn add(&self, id: u32, effect: &str) -> Result<(), Refused> {
        let (parent, effect) = (self.session.node(id)?, known_effect(effect)?);
        let added = self.session.fit_with(&parent.model, effect, self.vehicle, &self.telling)?;
        let before = format!("add {effect} --model lab/model-{id}.toml");
        let supported = Some(added.addition.finding.supported);
        self.keep(Some((id, effect)), supported, added.model, &self.session.command(&before))?;
        Ok(())
    }

    fn keep(
        &self,
        from: Option<(u32, Effect)>,
        supported: Option<bool>,
        model: Model,
        command: &str,
    ) -> Result<u32, Refused> {
        self.session.add_node(|id| Node {
            supported,
            command: format!("{command} --out lab/model-{id}.toml"),
            ..Node::of(id, from, model)
        })
    }

    fn explain(&self) -> Result<(), Refused> {
        let mut sets = self.sets()?;
        let own = self.session.own_effects();
        let explanation =
            workflow::explain(self.vehicle, &own, &mut sets, &Options::default(), None, &self.telling)?;
        let before = format!("explain{}", self.session.vehicle_option());
        self.keep_steps(explanation, &sets, &self.session.command(&before))
    }

    /// Each step as a model, with what was found in it.
    fn keep_steps(
        &self,
        mut explanation: Explanation,
        sets: &FlightSets,
        command: &str,
    ) -> Result<(), Refused> {
        explanation.on_the_way_mut().for_each(|model| sets.record_for_changes(model));
        let mut id = self.keep(None, None, explanation.basic, command)?;
        for step in explanation.steps {
            self.session.tell_of(id, |node| node.diagnosis = Some(document(&step.diagnosis)))?;
            let supported = Some(step.addition.finding.supported);
            id = self.keep(Some((id, step.effect)), supported, step.model, command)?;
        }
        self.session.tell_of(id, |node| node.diagnosis = Some(document(&explanation.last_diagnosis)))
    }
}

/// A discovery as `quadlab discover --json` gives it, with its conclusion, and each proposal as a file of an effect of the user's own.
fn discovered(id: u32, found: &Discovery, command: &str) -> Value {
    let mut document = serde_json::to_value(discovery::document(found)).unwrap_or_default();
    document["conclusion"] = json!(discovery::conclusion(found));
    document["command"] = json!(command);
    for (place, proposal) in found.proposals.iter().enumerate() {
        // Of several models each has its own first proposal.
        let mut definition = proposal.definition.clone();
        definition.id = format!("discovered-{id}-{}", place + 1);
        document["proposals"][place]["own"] = json!(definition.id);
        document["proposals"][place]["text"] = json!(file_of(vec![definition]));
    }
    document
}

/// A diagnosis as `quadlab diagnose --json` gives it, with what each effect is.
fn document(diagnosis: &Diagnosis) -> Value {
    let mut document = serde_json::to_value(diagnosis).unwrap_or_default();
    let sentence = |finding: &EffectFinding| (finding.effect.id().to_owned(), json!(finding.sentence()));
    document["sentences"] = diagnosis.effects.iter().map(sentence).collect();
    document
}
