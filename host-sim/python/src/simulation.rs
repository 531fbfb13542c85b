//! Flights of a model under its gains.

use std::path::{Path, PathBuf};

use model::Effect;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sil::{Fault, FaultKind, FlightPlan, GustModel, NoiseModel, Script, Waypoint, for_identification};

use crate::QuadlabError;
use crate::flights::columns;
use crate::waiting::beside;

/// What is flown, as Python hands it over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Wanted {
    model: PathBuf,
    gains: Option<PathBuf>,
    /// Time, north, east, down and yaw of each; a tour of the cage where there are none.
    waypoints: Option<Vec<[f64; 5]>>,
    duration_s: f64,
    start_m: [f64; 3],
    delay_samples: usize,
    noise: f64,
    /// Standard deviation, m/s, and correlation time, s.
    gusts: Option<[f64; 2]>,
    /// North and east.
    wind_m_s: Option<[f64; 2]>,
    motor_faults: Vec<MotorFault>,
    excitation: bool,
    seed: u64,
}

/// Flies a model: name and columns of the flight file, as the motion capture and the craft would record it.
#[pyfunction]
pub(crate) fn simulate(py: Python<'_>, wanted: Wanted) -> PyResult<(String, Bound<'_, PyDict>)> {
    let flown = beside(py, move |_| {
        let recording = sil::fly(&wanted.plan()?).map_err(|why| why.to_string())?;
        let name = wanted.model.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(recording.to_flight(format!("{name}.csv"), true))
    })?;
    columns(py, flown.map_err(QuadlabError::new_err::<String>)?)
}

impl Wanted {
    fn plan(&self) -> Result<FlightPlan, String> {
        let mut plan = plan_of(&self.model, self.gains.as_deref())?;
        plan.config = for_identification(plan.config);
        plan.script = match &self.waypoints {
            None => Script::tour(self.seed, self.duration_s),
            Some(list) => Script::Waypoints { list: list.iter().map(waypoint).collect(), repeat_s: None },
        };
        plan.duration_s = self.duration_s;
        plan.start_m = self.start_m;
        plan.delay_samples = self.delay_samples;
        plan.noise = (self.noise > 0.0).then(|| NoiseModel::default().times(self.noise));
        plan.gusts = self.gusts.map(|[deviation_m_s, time_s]| GustModel { deviation_m_s, time_s });
        set_wind(&mut plan, self.wind_m_s);
        plan.faults = self.motor_faults.iter().map(fault).collect::<Result<_, String>>()?;
        plan.excitation = self.excitation;
        plan.seed = self.seed;
        Ok(plan)
    }
}

fn waypoint(row: &[f64; 5]) -> Waypoint {
    let [from_s, north, east, down, yaw_rad] = *row;
    Waypoint { from_s, position_m: [north, east, down], yaw_rad }
}

/// A model with gains that were designed for it, or with the thesis'.
pub(crate) fn plan_of(model: &Path, gains: Option<&Path>) -> Result<FlightPlan, String> {
    let (model, config) = quadlab::craft_to_fly(model, gains)?;
    Ok(FlightPlan { config, ..FlightPlan::identification(model, 0, 1.0) })
}

/// A wind in the place of the model's.
pub(crate) fn set_wind(plan: &mut FlightPlan, wind_m_s: Option<[f64; 2]>) {
    if let Some(wind_m_s) = wind_m_s {
        plan.model.set(Effect::SteadyWind, &wind_m_s);
    }
}

/// Motor from 1, what happens to it, since when, s, and by how many command units.
pub(crate) type MotorFault = (usize, String, f64, f64);

pub(crate) fn fault((motor, what, from_s, size): &MotorFault) -> Result<Fault, String> {
    let Some(index) = motor.checked_sub(1).filter(|index| *index < 4) else {
        return Err(format!("motor_faults: motor {motor}, expected 1 to 4"));
    };
    let kind = match what.as_str() {
        "dead" => FaultKind::MotorDead(index),
        "weak" => FaultKind::MotorWeak(index, *size as f32),
        "stuck" => FaultKind::MotorStuck(index),
        other => return Err(format!("motor_faults: is {other:?}, expected dead, weak or stuck")),
    };
    Ok(Fault { kind, from_s: *from_s, for_s: f64::INFINITY })
}
