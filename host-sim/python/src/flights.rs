//! Flights as arrays.

use std::path::PathBuf;

use diagnosis::workflow::LoadedFlight;
use flights::Flight;
use model::Model;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::QuadlabError;
use crate::waiting::beside;

/// Axes of the equations of motion.
const AXES: [&str; 6] = ["u", "v", "w", "p", "q", "r"];

/// The flights of a flight file or log: name and columns of each.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: PathBuf) -> PyResult<Vec<(String, Bound<'_, PyDict>)>> {
    let flights = beside(py, move |_| quadlab::read_flights(&path))?.map_err(QuadlabError::new_err)?;
    flights.into_iter().map(|flight| columns(py, flight)).collect()
}

/// Name and columns of a flight. The arrays own what was read: nothing is copied.
pub(crate) fn columns(py: Python<'_>, flight: Flight) -> PyResult<(String, Bound<'_, PyDict>)> {
    let name = flight.name.clone();
    Ok((name, arrays(py, flight.into_logged_columns())?))
}

/// Arrays by name, which own the values.
fn arrays(
    py: Python<'_>,
    columns: impl IntoIterator<Item = (String, Vec<f64>)>,
) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for (name, values) in columns {
        all.set_item(name, PyArray1::from_vec(py, values))?;
    }
    Ok(all)
}

/// Measured and predicted accelerations of a flight under a model: `t`, `u`, `u_predicted`, ... in m/s^2 and rad/s^2.
#[pyfunction]
pub(crate) fn residuals(py: Python<'_>, model: PathBuf, flight: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let found = beside(py, move |_| compared(&model, &flight))?.map_err(QuadlabError::new_err)?;
    arrays(py, found)
}

fn compared(model: &std::path::Path, flight: &std::path::Path) -> Result<Vec<(String, Vec<f64>)>, String> {
    let model = Model::read(model).map_err(|why| why.to_string())?;
    let flights = quadlab::read_flights(flight)?;
    let [flight] = &flights[..] else {
        return Err(format!(
            "{}: holds {} flights; cut it with quadlab.import_log and name one of them",
            flight.display(),
            flights.len()
        ));
    };
    let loaded = LoadedFlight::from_flight(flight, &model.vehicle).map_err(|why| why.to_string())?;
    let prepared = loaded.prepared;
    let found = sysid::residuals(&prepared, &model);
    let mut all = vec![("t".to_owned(), prepared.row_times_s(1))];
    for ((axis, measured), residual) in AXES.iter().zip(found.measured).zip(found.residual) {
        let predicted =
            measured.iter().zip(residual).map(|(measured, residual)| measured - residual).collect();
        all.push(((*axis).to_owned(), measured));
        all.push((format!("{axis}_predicted"), predicted));
    }
    Ok(all)
}
