//! Craft to learn on, many at once.

use numpy::{PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2, PyUntypedArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use sil::SilError;
use sil::environment::{ACTIONS, ActionKind, Environment, ObservationKind, Stepped, Task};

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
    all: Vec<One>,
    numbers: usize,
}

struct One {
    environment: Environment,
    /// Seed of its next episode.
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
        let all = py.detach(|| {
            let environment = Environment::new(task, 0)?;
            // What they have in common is worked out once.
            let make = |seed| {
                let mut one = One { environment: environment.clone(), seed, is_over: false };
                one.environment.reset(seed);
                one
            };
            Ok((0..count as u64).map(make).collect())
        });
        Ok(Self { all: all.map_err(refused)?, numbers })
    }

    /// Numbers in an observation.
    #[getter]
    fn numbers(&self) -> usize {
        self.numbers
    }

    /// Time of a tick, s.
    #[getter]
    fn period_s(&self) -> f64 {
        self.all.first().map_or(0.0, |one| one.environment.task().plan.config.sample_time_s)
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
        if seeds.len() != self.all.len() || which.len() != self.all.len() {
            return Err(PyValueError::new_err(format!(
                "give a seed and a mark for each of the {} craft",
                self.all.len()
            )));
        }
        let all = &mut self.all;
        py.detach(|| {
            let each = all.iter_mut().zip(rows).zip(seeds).zip(which);
            for (((one, row), seed), _) in each.filter(|(_, begins)| *begins) {
                one.seed = seed;
                one.begin();
                one.environment.observe(row);
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
        let count = self.all.len();
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
        let all = &mut self.all;
        py.detach(|| {
            let (actions, _) = actions.as_chunks::<ACTIONS>();
            let results = rewards.iter_mut().zip(terminated).zip(truncated);
            for (((one, row), action), ((reward, terminated), truncated)) in
                all.iter_mut().zip(rows).zip(actions).zip(results)
            {
                (*reward, *terminated, *truncated) = one.step(action, autoreset);
                one.environment.observe(row);
            }
        });
        Ok(())
    }
}

impl Crafts {
    fn rows<'a>(&self, observations: &'a mut [f32]) -> PyResult<std::slice::ChunksExactMut<'a, f32>> {
        if observations.len() != self.numbers * self.all.len() {
            return Err(PyValueError::new_err(format!(
                "observations: have {} numbers, expected ({}, {})",
                observations.len(),
                self.all.len(),
                self.numbers
            )));
        }
        Ok(observations.chunks_exact_mut(self.numbers))
    }
}

impl One {
    fn begin(&mut self) {
        self.environment.reset(self.seed);
        // The next episode is another one, and the same whenever the first was.
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        self.is_over = false;
    }

    fn step(&mut self, action: &[f32; ACTIONS], autoreset: bool) -> (f64, bool, bool) {
        if self.is_over && autoreset {
            self.begin();
            return (0.0, false, false);
        }
        let Stepped { reward, terminated, truncated } = self.environment.step(action);
        self.is_over = terminated || truncated;
        (reward, terminated, truncated)
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
