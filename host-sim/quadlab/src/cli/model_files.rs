//! Model and vehicle files as they are named on the command line; one given for the other is recognised.

use std::path::{Path, PathBuf};

use diagnosis::workflow::{Observer, import_log};
use flights::{ColumnMap, FlightError};
use model::{Model, ModelError, Vehicle, VehicleError};

/// Why there is no model or no vehicle.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WrongKindError {
    #[error(
        "{path}: is a vehicle file, and this command needs a model; make one with `quadlab identify --vehicle {path} ... --out \
         model.toml`", path = .0.display()
    )]
    VehicleForModel(PathBuf),
    #[error("{}: is a model file, and this command needs a vehicle file (what was measured before any flight)", .0.display())]
    ModelForVehicle(PathBuf),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    #[error(transparent)]
    Columns(#[from] FlightError),
}

/// Reads a model file.
pub(crate) fn read_model(path: &Path) -> Result<Model, WrongKindError> {
    Model::read(path).map_err(|error| match Vehicle::read(path) {
        Ok(_) => WrongKindError::VehicleForModel(path.into()),
        Err(_) => error.into(),
    })
}

/// The vehicle of a command: the file given, else the `vehicle.toml` beside the first of the flights or in the folder that is
/// named, else what the logs among the flights tell. With the file, where there is one.
pub(crate) fn vehicle_of<'a>(
    given: Option<&PathBuf>,
    named: impl Iterator<Item = &'a PathBuf>,
    flights: &[&PathBuf],
    observer: &dyn Observer,
) -> anyhow::Result<(Vehicle, Option<PathBuf>)> {
    let beside = |path: &PathBuf| match path.is_dir() {
        true => path.join(VEHICLE),
        false => path.with_file_name(VEHICLE),
    };
    let found = given.cloned().or_else(|| named.map(beside).find(|path| path.is_file()));
    if let Some(path) = found {
        return Ok((read_vehicle(&path)?, Some(path)));
    }
    let is_log = |path: &&&PathBuf| logs::format_of(path).is_some();
    let import = |path: &&PathBuf| import_log(path, &ColumnMap::beside(path)?, observer);
    let imports: Result<Vec<_>, logs::LogError> = flights.iter().filter(is_log).map(import).collect();
    let imports = imports?;
    match (logs::draft(&imports).map_err(anyhow::Error::msg)?, imports.first()) {
        (Some(draft), _) => Ok((draft.vehicle, None)),
        (None, Some(log)) => anyhow::bail!(
            "{}: nothing in this log is long enough in the air to be a flight",
            log.path.display()
        ),
        (None, None) => anyhow::bail!(
            "no vehicle file: give --vehicle, or put a {VEHICLE} beside the flights (quadlab init makes one from logs)"
        ),
    }
}

/// Name of a vehicle file beside flights.
pub(crate) const VEHICLE: &str = "vehicle.toml";

/// Reads a vehicle file.
pub(crate) fn read_vehicle(path: &Path) -> Result<Vehicle, WrongKindError> {
    let vehicle = Vehicle::read(path).map_err(|error| match Model::read(path) {
        Ok(_) => WrongKindError::ModelForVehicle(path.into()),
        Err(_) => error.into(),
    })?;
    // What it says of columns is refused with the file's own name.
    ColumnMap::of_vehicle(&vehicle, path)?;
    Ok(vehicle)
}
