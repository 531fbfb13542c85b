//! Flights of a model under its gains.

use std::path::PathBuf;

use model::Effect;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sil::{Fault, FaultKind, FlightPlan, GustModel, NoiseModel, Script, Waypoint, for_identification};

use crate::QuadlabError;
use crate::flights::columns;
use crate::waiting::beside;

/// Craft and air of a flight, as Python hands them over.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Conditions {
    model: PathBuf,
    gains: Option<PathBuf>,
    delay_samples: usize,
    noise: f64,
    /// Standard deviation, m/s, and correlation time, s.
    gusts: Option<[f64; 2]>,
    /// North and east.
    wind_m_s: Option<[f64; 2]>,
    motor_faults: Vec<MotorFault>,
}

/// What is flown in them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Wanted {
    /// Time, north, east, down and yaw of each; a tour of the cage where there are none.
    waypoints: Option<Vec<[f64; 5]>>,
    duration_s: f64,
    start_m: [f64; 3],
    excitation: bool,
    seed: u64,
}

/// Flies a model: name and columns of the flight file, as the motion capture and the craft would record it.
#[pyfunction]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    wanted: &Bound<'py, PyAny>,
) -> PyResult<(String, Bound<'py, PyDict>)> {
    let (flight, conditions): (Wanted, Conditions) = (wanted.extract()?, wanted.extract()?);
    let flown = beside(py, move |_| {
        let recording = sil::fly(&flight.plan(&conditions)?).map_err(|why| why.to_string())?;
        let name = conditions.model.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        Ok(recording.to_flight(format!("{name}.csv"), true))
    })?;
    columns(py, flown.map_err(QuadlabError::new_err::<String>)?)
}

impl Conditions {
    /// A flight of the model with gains that were designed for it, or with the thesis', without excitation.
    pub(crate) fn plan(&self) -> Result<FlightPlan, String> {
        let (model, config) = quadlab::craft_to_fly(&self.model, self.gains.as_deref())?;
        let mut plan = FlightPlan {
            config,
            excitation: false,
            delay_samples: self.delay_samples,
            noise: (self.noise > 0.0).then(|| NoiseModel::default().times(self.noise)),
            gusts: self.gusts.map(|[deviation_m_s, time_s]| GustModel { deviation_m_s, time_s }),
            faults: self.motor_faults.iter().map(fault).collect::<Result<_, String>>()?,
            ..FlightPlan::identification(model, 0, 1.0)
        };
        if let Some(wind_m_s) = &self.wind_m_s {
            plan.model.set(Effect::SteadyWind, wind_m_s);
        }
        Ok(plan)
    }
}

impl Wanted {
    fn plan(&self, conditions: &Conditions) -> Result<FlightPlan, String> {
        let plan = conditions.plan()?;
        let script = match &self.waypoints {
            None => Script::tour(self.seed, self.duration_s),
            Some(list) => Script::Waypoints { list: list.iter().map(waypoint).collect(), repeat_s: None },
        };
        Ok(FlightPlan {
            config: for_identification(plan.config),
            script,
            duration_s: self.duration_s,
            start_m: self.start_m,
            excitation: self.excitation,
            seed: self.seed,
            ..plan
        })
    }
}

fn waypoint(row: &[f64; 5]) -> Waypoint {
    let [from_s, north, east, down, yaw_rad] = *row;
    Waypoint { from_s, position_m: [north, east, down], yaw_rad }
}

/// Motor from 1, what happens to it, since when, s, and by how many command units.
type MotorFault = (usize, String, f64, f64);

fn fault((motor, what, from_s, size): &MotorFault) -> Result<Fault, String> {
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
