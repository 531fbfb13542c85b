//! Model and vehicle files as they are named on the command line; one given for the other is recognised.

use std::path::{Path, PathBuf};

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
}

/// Reads a model file.
pub(crate) fn read_model(path: &Path) -> Result<Model, WrongKindError> {
    Model::read(path).map_err(|error| match Vehicle::read(path) {
        Ok(_) => WrongKindError::VehicleForModel(path.into()),
        Err(_) => error.into(),
    })
}

/// Reads a vehicle file.
pub(crate) fn read_vehicle(path: &Path) -> Result<Vehicle, WrongKindError> {
    Vehicle::read(path).map_err(|error| match Model::read(path) {
        Ok(_) => WrongKindError::ModelForVehicle(path.into()),
        Err(_) => error.into(),
    })
}
