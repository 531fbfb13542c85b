//! Craft to learn on, many at once.

use numpy::{PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sil::SilError;
use sil::environment::{ACTIONS, ActionKind, Environments, ObservationKind, Stepped, Task};

use crate::QuadlabError;
use crate::simulation::Conditions;

/// What is learned, as Python hands it over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Wanted {
    action: String,
    observation: String,
    duration_s: f64,
    target_m: [f64; 3],
    room_m: f64,
    start_m: f64,
    start_m_s: f64,
    start_rad: f64,
}

/// Craft of one model, each in an episode of its own.
#[pyclass(module = "quadlab._quadlab")]
pub(crate) struct Crafts {
    all: Environments,
    episodes: Vec<Episode>,
    numbers: usize,
}

struct Episode {
    /// Seed of the next one.
    seed: u64,
    is_over: bool,
}

#[pymethods]
impl Crafts {
    /// So many craft for a task.
    #[new]
    fn new(py: Python<'_>, wanted: &Bound<'_, PyAny>, count: usize) -> PyResult<Self> {
        let (task, conditions): (Wanted, Conditions) = (wanted.extract()?, wanted.extract()?);
        let task = task.with(&conditions).map_err(QuadlabError::new_err)?;
        let numbers = task.observation.numbers();
        let all = py.detach(|| Environments::new(task, count)).map_err(refused)?;
        let episodes = (0..count as u64).map(|seed| Episode { seed, is_over: false }).collect();
        Ok(Self { all, episodes, numbers })
    }

    /// Numbers in an observation.
    #[getter]
    fn numbers(&self) -> usize {
        self.numbers
    }

    /// Time of a tick, s.
    #[getter]
    fn period_s(&self) -> f64 {
        self.all.all().first().map_or(0.0, |one| one.task().plan.config.sample_time_s)
    }

    /// Begins new episodes where `which` is not 0, with these seeds.
    fn reset(
        &mut self,
        py: Python<'_>,
        seeds: Vec<u64>,
        which: Vec<bool>,
        mut observations: PyReadwriteArray2<'_, f32>,
    ) -> PyResult<()> {
        let rows = self.rows(observations.as_slice_mut()?)?;
        let count = self.episodes.len();
        if seeds.len() != count || which.len() != count {
            return Err(PyValueError::new_err(format!(
                "give a seed and a mark for each of the {count} craft"
            )));
        }
        let Self { all, episodes, .. } = self;
        py.detach(|| {
            let each = episodes.iter_mut().enumerate().zip(rows).zip(seeds).zip(which);
            for ((((number, episode), row), seed), _) in each.filter(|(_, begins)| *begins) {
                episode.seed = seed;
                all.reset(number, episode.begin());
                all.all()[number].observe(row);
            }
        });
        Ok(())
    }

    /// One tick of all craft. With `autoreset`, one whose episode is over begins the next instead.
    #[expect(clippy::too_many_arguments, reason = "the arrays of Gymnasium's step, filled in place")]
    fn step(
        &mut self,
        py: Python<'_>,
        actions: PyReadonlyArray2<'_, f32>,
        mut observations: PyReadwriteArray2<'_, f32>,
        mut rewards: PyReadwriteArray1<'_, f64>,
        mut terminated: PyReadwriteArray1<'_, bool>,
        mut truncated: PyReadwriteArray1<'_, bool>,
        autoreset: bool,
    ) -> PyResult<()> {
        let count = self.episodes.len();
        if actions.shape() != [count, ACTIONS] {
            return Err(PyValueError::new_err(format!(
                "actions: have the shape {:?}, expected ({count}, {ACTIONS})",
                actions.shape()
            )));
        }
        let (actions, rows) = (actions.as_slice()?, self.rows(observations.as_slice_mut()?)?);
        let (rewards, terminated, truncated) =
            (rewards.as_slice_mut()?, terminated.as_slice_mut()?, truncated.as_slice_mut()?);
        if [rewards.len(), terminated.len(), truncated.len()] != [count; 3] {
            return Err(PyValueError::new_err(format!(
                "results: give arrays of {count}, one number for each craft"
            )));
        }
        let Self { all, episodes, .. } = self;
        py.detach(|| {
            let (actions, _) = actions.as_chunks::<ACTIONS>();
            let begins: Vec<bool> = episodes.iter().map(|episode| episode.is_over && autoreset).collect();
            let action = |number: usize| (!begins[number]).then_some(&actions[number]);
            all.step(action, |number, Stepped { reward, terminated: lost, truncated: ended }| {
                (rewards[number], terminated[number], truncated[number]) = (reward, lost, ended);
                episodes[number].is_over = lost || ended;
            });
            for (number, row) in rows.enumerate() {
                if begins[number] {
                    all.reset(number, episodes[number].begin());
                    (rewards[number], terminated[number], truncated[number]) = (0.0, false, false);
                }
                all.all()[number].observe(row);
            }
        });
        Ok(())
    }
}

impl Crafts {
    fn rows<'a>(&self, observations: &'a mut [f32]) -> PyResult<std::slice::ChunksExactMut<'a, f32>> {
        let count = self.episodes.len();
        if observations.len() != self.numbers * count {
            return Err(PyValueError::new_err(format!(
                "observations: have {} numbers, expected ({count}, {})",
                observations.len(),
                self.numbers
            )));
        }
        Ok(observations.chunks_exact_mut(self.numbers))
    }
}

impl Episode {
    /// The next one begins: its seed.
    fn begin(&mut self) -> u64 {
        let own = self.seed;
        // The next episode is another one, and the same whenever the first was.
        self.seed = own.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        self.is_over = false;
        own
    }
}

impl Wanted {
    fn with(&self, conditions: &Conditions) -> Result<Task, String> {
        let action = match self.action.as_str() {
            "motors" => ActionKind::Motors,
            "attitude" => ActionKind::Attitude,
            "position" => ActionKind::Position,
            other => return Err(format!("action: is {other:?}, expected motors, attitude or position")),
        };
        let observation = match self.observation.as_str() {
            "state" => ObservationKind::State,
            "sensors" => ObservationKind::Sensors,
            other => return Err(format!("observation: is {other:?}, expected state or sensors")),
        };
        let mut plan = conditions.plan()?;
        plan.duration_s = self.duration_s;
        plan.start_m = self.target_m;
        plan.excitation = false;
        let Self { room_m, start_m, start_m_s, start_rad, .. } = *self;
        Ok(Task { plan, action, observation, room_m, start_m, start_m_s, start_rad })
    }
}

fn refused(why: SilError) -> PyErr {
    QuadlabError::new_err(why.to_string())
}
