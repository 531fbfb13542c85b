//! What the server knows: flights, models that came of each other, the job that runs.

use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use diagnosis::workflow::{
    self, Faults, FlightSets, FlightsOfOneKind, LoadedFlight, Observer, Progress, Reading, Silent,
    is_held_out,
};
use model::{Model, Vehicle};
use serde_json::{Value, json};
use sysid::Comparison;

use super::events::Events;
use super::flights::{FlightFile, Use};
use super::node::Node;
use super::own_effect::OwnEffect;
use super::refused::Refused;
use super::store::{LONGEST_NOTE, Saved, Store, StoreError};
use super::timeline;
use super::trials::{Eye, Trials};
use super::vehicle::Craft;
use super::views::Seen;
use crate::render::pages;

/// Rows of flights seen by models that are held ready to be looked at: some 0.9 kB each.
const MOST_ROWS: usize = 1_500_000;

/// The job that runs, and how far it is.
#[derive(Debug, Clone)]
pub(super) struct Job {
    pub(super) kind: &'static str,
    pub(super) activity: String,
    pub(super) steps: Option<(usize, usize)>,
    pub(super) cancel: Arc<AtomicBool>,
}

#[derive(Default)]
pub(super) struct State {
    pub(super) craft: Option<Craft>,
    /// Why nothing can be fitted.
    pub(super) problem: Option<String>,
    pub(super) reading: bool,
    pub(super) files: Vec<FlightFile>,
    /// What the user chose for flights, by file name.
    pub(super) chosen: BTreeMap<String, Use>,
    /// What the user wrote about flights, by file name.
    pub(super) notes: BTreeMap<String, String>,
    pub(super) nodes: Vec<Node>,
    /// Effects of the user's own.
    pub(super) own: Vec<OwnEffect>,
    /// Further columns of flights that were known when the flights were read.
    pub(super) columns: usize,
    /// How often flights were read: what was made of them before is no longer true.
    readings: u64,
    pub(super) current: Option<u32>,
    pub(super) job: Option<Job>,
    /// Flights by what sees them: a model, or a trial of it by its number. The newest first.
    seen: VecDeque<((Eye, String), Arc<Seen>)>,
    pub(super) trials: Trials,
    comparisons: BTreeMap<u32, Arc<Comparison>>,
    timelines: BTreeMap<u32, Value>,
}

/// A folder of flights that is open.
pub(super) struct Session {
    pub(super) folder: PathBuf,
    pub(super) events: Events,
    pub(super) store: Store,
    state: Mutex<State>,
    /// Held while a model is held against a flight: a page that asks for several things at once waits for one.
    pub(super) seeing: Mutex<()>,
    /// The same of all flights.
    comparing: Mutex<()>,
    /// Held while an effect is tried.
    pub(super) trying: Mutex<()>,
}

impl Session {
    /// Opens a folder, with what was done in it before.
    pub(super) fn open(folder: &Path) -> Result<Self, StoreError> {
        let store = Store::open(folder)?;
        let (saved, nodes) = store.read()?;
        // After the models: what one of them has must go on to mean the same.
        let own = OwnEffect::all(&store.read_effects()?);
        let current = saved.current.filter(|id| nodes.iter().any(|node| node.id == *id));
        let Saved { chosen, notes, .. } = saved;
        let state = State { chosen, notes, nodes, own, current, reading: true, ..State::default() };
        Ok(Self {
            folder: folder.to_owned(),
            events: Events::new(),
            store,
            state: Mutex::new(state),
            seeing: Mutex::new(()),
            comparing: Mutex::new(()),
            trying: Mutex::new(()),
        })
    }

    /// Nothing is left half-done where a thread ended early: what it holds is replaced whole.
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A file to write to until it is whole.
    pub(super) fn temporary(&self) -> Result<tempfile::NamedTempFile, Refused> {
        Ok(self.store.temporary()?)
    }

    /// What the page shows.
    pub(super) fn document(&self) -> Value {
        let state = self.lock();
        let usable = state.files.iter().filter(|file| file.is_usable()).count();
        let problem = state.problem.clone().or_else(|| {
            (!state.reading && usable == 0)
                .then(|| "none of the files in this folder is a flight that can be used".into())
        });
        json!({
            "folder": self.folder.display().to_string(),
            "vehicle": state.craft.as_ref().map(Craft::entry),
            "problem": problem,
            "reading": state.reading,
            "readings": state.readings,
            "longest_note": LONGEST_NOTE,
            "first": state.first_flight(),
            "flights": state.files.iter().map(|file| state.entry(file)).collect::<Vec<_>>(),
            "models": state.nodes.iter().map(Node::entry).collect::<Vec<_>>(),
            "own": state.own.iter().map(|own| own.entry(&state.nodes)).collect::<Vec<_>>(),
            "current": state.current,
            "job": state.job.as_ref().map(Job::entry),
        })
    }

    /// What a flight is used for from now on.
    pub(super) fn choose(&self, name: &str, used: Use) -> Result<(), Refused> {
        {
            let mut state = self.lock();
            let Some(file) = state.files.iter_mut().find(|file| file.name == name) else {
                return Err(Refused::new(format!("{name}: there is no such flight in this folder")));
            };
            file.used = used;
            state.chosen.insert(name.to_owned(), used);
            state.trials.forget();
        }
        self.save()?;
        self.events.changed();
        Ok(())
    }

    /// Looks at another model.
    pub(super) fn go_to(&self, id: u32) -> Result<(), Refused> {
        {
            let mut state = self.lock();
            if !state.nodes.iter().any(|node| node.id == id) {
                return Err(Refused::new(format!("there is no model {id}: load the page again")));
            }
            state.current = Some(id);
        }
        self.save()?;
        self.events.changed();
        Ok(())
    }

    /// A model.
    pub(super) fn node(&self, id: u32) -> Result<Node, Refused> {
        let state = self.lock();
        let node = state.nodes.iter().find(|node| node.id == id).cloned();
        node.ok_or_else(|| Refused::new(format!("there is no model {id}: load the page again")))
    }

    /// Keeps a new model, and looks at it.
    pub(super) fn add_node(&self, node: impl FnOnce(u32) -> Node) -> Result<u32, Refused> {
        let id = {
            let mut state = self.lock();
            let id = state.nodes.iter().map(|node| node.id).max().unwrap_or(0) + 1;
            let node = node(id);
            self.store.write_node(&node)?;
            state.nodes.push(node);
            state.current = Some(id);
            id
        };
        self.save()?;
        Ok(id)
    }

    /// Keeps what was found of a model.
    pub(super) fn tell_of(&self, id: u32, tell: impl FnOnce(&mut Node)) -> Result<(), Refused> {
        let mut state = self.lock();
        if let Some(node) = state.nodes.iter_mut().find(|node| node.id == id) {
            tell(node);
            self.store.write_node(node)?;
        }
        Ok(())
    }

    /// Keeps all but the models.
    pub(super) fn save(&self) -> Result<(), Refused> {
        let state = self.lock();
        let models = state.nodes.iter().map(Into::into).collect();
        let (chosen, notes) = (state.chosen.clone(), state.notes.clone());
        Ok(self.store.write(&Saved { chosen, notes, models, current: state.current })?)
    }

    /// Files of a use.
    pub(super) fn files(&self, used: Use) -> Vec<PathBuf> {
        let state = self.lock();
        let of = state.files.iter().filter(|file| file.used == used && file.is_usable());
        of.map(|file| file.path.clone()).collect()
    }

    /// The flights of a job; a single one is split by blocks of time, as by every command.
    pub(super) fn sets(&self, vehicle: &Vehicle, observer: &dyn Observer) -> Result<FlightSets, Refused> {
        let [train, validate] = [Use::Train, Use::Validate].map(|used| self.files(used));
        match (&train[..], &validate[..]) {
            ([only], []) | ([], [only]) => {
                let only = std::slice::from_ref(only);
                return Ok(FlightSets::split(only, vehicle, Reading::default(), observer)?);
            }
            ([], _) => return Err(Refused::new("no flight is chosen to fit on: choose one in the table")),
            (_, []) => {
                return Err(Refused::new("no flight is held out to test the model: choose one in the table"));
            }
            _ => {}
        }
        let [train, validate] = [Use::Train, Use::Validate].map(|used| self.loaded(used));
        Ok(FlightSets::from_loaded(train, validate, vehicle, Reading::default())?)
    }

    /// Flights of a use, as they were read.
    pub(super) fn loaded(&self, used: Use) -> Vec<LoadedFlight> {
        let state = self.lock();
        let files = state.files.iter().filter(|file| file.used == used);
        files.filter_map(|file| file.flights.as_ref().as_ref().ok()).flatten().cloned().collect()
    }

    /// A flight seen by a model.
    pub(super) fn seen(&self, id: u32, flight: &str) -> Result<Arc<Seen>, Refused> {
        self.seen_by((id, None), flight, || Ok(self.node(id)?.model))
    }

    /// The same with what it is seen by.
    pub(super) fn seen_by(
        &self,
        eye: Eye,
        flight: &str,
        model: impl FnOnce() -> Result<Arc<Model>, Refused>,
    ) -> Result<Arc<Seen>, Refused> {
        let _seeing = self.seeing.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (eye, flight.to_owned());
        let known = |state: &mut State| {
            let place = state.seen.iter().position(|(known, _)| *known == key)?;
            let (_, seen) = state.seen.remove(place)?;
            state.seen.push_front((key.clone(), seen.clone()));
            Some(seen)
        };
        if let Some(seen) = known(&mut self.lock()) {
            return Ok(seen);
        }
        let (loaded, whole, readings) = self.lock().read_of(flight)?;
        let model = model()?;
        let seen = Arc::new(Seen::new(&model, loaded, whole)?);
        let mut state = self.lock();
        if state.readings != readings {
            return Ok(seen);
        }
        state.seen.push_front((key, seen.clone()));
        let mut rows = 0;
        let fit = state.seen.iter().take_while(|(_, seen)| {
            rows += seen.rows();
            rows <= MOST_ROWS
        });
        let most = fit.count().max(1);
        state.seen.truncate(most);
        Ok(seen)
    }

    /// Holds the chosen model against the flight that a page shows first, so that both are there when it asks for them. What
    /// goes wrong it hears when it asks.
    pub(super) fn look_ahead(&self) {
        let first = {
            let state = self.lock();
            state.current.zip(state.first_flight().map(str::to_owned))
        };
        if let Some((model, flight)) = first {
            let _ = self.seen(model, &flight);
        }
    }

    /// Names of all flights that can be used, and whether any of them says where it was.
    pub(super) fn flight_names(&self) -> (Vec<String>, bool) {
        let state = self.lock();
        let names = state.loaded().map(|loaded| loaded.prepared.name.clone()).collect();
        (names, state.loaded().any(|loaded| loaded.prepared.has_position))
    }

    /// A model held against all flights that can be used, together: what `quadlab compare` says of them.
    pub(super) fn comparison(&self, id: u32) -> Result<Arc<Comparison>, Refused> {
        let _comparing = self.comparing.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(comparison) = self.lock().comparisons.get(&id) {
            return Ok(comparison.clone());
        }
        let readings = self.lock().readings;
        let (model, mut flights) = self.held(id)?;
        let comparison = Arc::new(workflow::compare(&model, &mut flights, &Silent)?);
        let mut state = self.lock();
        if state.readings == readings {
            state.comparisons.insert(id, comparison.clone());
        }
        Ok(comparison)
    }

    /// The coefficients of a model, each flight by itself.
    pub(super) fn timeline(&self, id: u32) -> Result<Value, Refused> {
        let _comparing = self.comparing.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(timeline) = self.lock().timelines.get(&id) {
            return Ok(timeline.clone());
        }
        let readings = self.lock().readings;
        let (model, mut flights) = self.held(id)?;
        workflow::line_up(&model, &mut flights, &Silent)?;
        let fits = workflow::flight_by_flight(&model, &flights.prepared());
        let document = timeline::document(&model, &fits);
        let mut state = self.lock();
        if state.readings == readings {
            state.timelines.insert(id, document.clone());
        }
        Ok(document)
    }

    /// The page of `quadlab compare --html`.
    pub(super) fn report(&self, id: u32) -> Result<String, Refused> {
        let comparison = self.comparison(id)?;
        let (model, mut flights) = self.held(id)?;
        workflow::line_up(&model, &mut flights, &Silent)?;
        Ok(pages::compare(&model, &flights.flights, &comparison).render())
    }

    fn held(&self, id: u32) -> Result<(Arc<Model>, FlightsOfOneKind), Refused> {
        let model = self.node(id)?.model;
        let flights = self.lock().loaded().cloned().collect();
        Ok((model, FlightsOfOneKind { flights, faults: Faults::default() }))
    }
}

impl State {
    /// Refuses to change what a job works with.
    pub(super) fn has_no_job(&self) -> Result<(), Refused> {
        match &self.job {
            Some(job) => Err(Refused::new(format!("{} is running: wait for it or cancel it", job.kind))),
            None => Ok(()),
        }
    }

    /// Refuses to work with flights that are being read.
    pub(super) fn has_read(&self) -> Result<(), Refused> {
        if self.reading {
            return Err(Refused::new("the flights are being read: wait for it"));
        }
        Ok(())
    }

    /// What was made of flights that are read anew.
    pub(super) fn forget_seen(&mut self) {
        self.readings += 1;
        self.seen.clear();
        self.trials.forget();
        self.comparisons.clear();
        self.timelines.clear();
    }

    /// What a file is used for, as the user chose, or by its place among those that can be used.
    pub(super) fn use_of(&self, name: &str, index: usize) -> Use {
        let automatic = if is_held_out(index) { Use::Validate } else { Use::Train };
        self.chosen.get(name).copied().unwrap_or(automatic)
    }

    /// Puts a file that was read anew in the place of what it was, and forgets what was made of that.
    pub(super) fn replace(&mut self, file: FlightFile) {
        let Some(place) = self.files.iter().position(|old| old.path == file.path) else { return };
        let index = self.files[..place].iter().filter(|file| file.is_usable()).count();
        let used = self.use_of(&file.name, index);
        let old = std::mem::replace(&mut self.files[place], file);
        self.files[place].used = if old.is_usable() { old.used } else { used };
        let mut seen = std::mem::take(&mut self.seen);
        seen.retain(|((_, name), _)| old.known().all(|flight| flight.prepared.name != *name));
        self.forget_seen();
        self.seen = seen;
    }

    /// The flight that a page shows first: one that is to judge by, where there is one.
    fn first_flight(&self) -> Option<&str> {
        let usable = || self.files.iter().filter(|file| file.is_usable());
        let file = usable().find(|file| file.used == Use::Validate).or_else(|| usable().next());
        file.and_then(|file| file.known().next()).map(|flight| flight.prepared.name.as_str())
    }

    /// What the page shows of a file.
    fn entry(&self, file: &FlightFile) -> Value {
        let mut entry = file.entry();
        entry["note"] = json!(self.notes.get(&file.name).map_or("", String::as_str));
        entry
    }

    /// A flight by its name, all that flies of it where only parts of it are used, and at which reading that is so.
    fn read_of(&self, flight: &str) -> Result<(LoadedFlight, Option<LoadedFlight>, u64), Refused> {
        let is_meant = |loaded: &&LoadedFlight| loaded.prepared.name == flight;
        let loaded = self.loaded().find(is_meant).cloned();
        let loaded = loaded
            .ok_or_else(|| Refused::new(format!("{flight}: there is no such flight in this folder")))?;
        let whole = self.files.iter().flat_map(|file| file.whole.iter()).find(is_meant).cloned();
        Ok((loaded, whole, self.readings))
    }

    /// All flights that can be used.
    fn loaded(&self) -> impl Iterator<Item = &LoadedFlight> {
        self.files.iter().filter_map(|file| file.flights.as_ref().as_ref().ok()).flatten()
    }
}

impl Job {
    fn entry(&self) -> Value {
        progress_entry(self.kind, &self.activity, self.steps)
    }
}

fn progress_entry(kind: &str, activity: &str, steps: Option<(usize, usize)>) -> Value {
    let [done, all] = [steps.map(|(done, _)| done), steps.map(|(_, all)| all)];
    json!({ "do": kind, "activity": activity, "done": done, "all": all })
}

/// Tells the pages how far a job is, and the job whether to stop.
pub(super) struct Telling<'a> {
    pub(super) session: &'a Session,
    pub(super) kind: &'static str,
    pub(super) cancel: Option<Arc<AtomicBool>>,
}

impl Observer for Telling<'_> {
    fn progress(&self, progress: Progress<'_>) {
        let told = progress_entry(self.kind, progress.activity, progress.steps);
        self.session.events.tell("progress", told);
        // Looking for evidence runs beside the job.
        if let Some(job) = self.session.lock().job.as_mut().filter(|job| job.kind == self.kind) {
            (job.activity, job.steps) = (progress.activity.to_owned(), progress.steps);
        }
    }

    fn warning(&self, sentence: &str) {
        self.session.events.tell("warning", json!({ "sentence": report::plain_line(sentence) }));
    }

    fn is_cancelled(&self) -> bool {
        self.cancel.as_ref().is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }
}
