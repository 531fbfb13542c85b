//! Files that people write: what is read can be written and read again, what is not is refused with a sentence.

use std::path::Path;

use gains_file::Gains;
use model::{Model, Vehicle};
use pattern::Pattern;

fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|error| error.to_string())
}

/// A vehicle file.
pub(crate) fn vehicle(bytes: &[u8]) -> Result<(), String> {
    Vehicle::parse(text(bytes)?, Path::new("vehicle.toml")).map_err(|error| error.to_string()).map(drop)
}

/// A model file.
pub(crate) fn model(bytes: &[u8]) -> Result<(), String> {
    let path = Path::new("model.toml");
    let model = Model::parse(text(bytes)?, path).map_err(|error| error.to_string())?;
    let again = Model::parse(&model.to_toml(), path);
    assert!(again.is_ok(), "what was read is read again: {}", again.unwrap_err());
    Ok(())
}

/// A gains file.
pub(crate) fn gains(bytes: &[u8]) -> Result<(), String> {
    Gains::parse(text(bytes)?, Path::new("gains.toml")).map_err(|error| error.to_string()).map(drop)
}

/// Effects of a user, with their formulas.
pub(crate) fn effects(bytes: &[u8]) -> Result<(), String> {
    let path = Path::new("effects.toml");
    model::effects::parse(text(bytes)?, path).map_err(|error| error.to_string()).map(drop)
}

/// A pattern to fly.
pub(crate) fn pattern(bytes: &[u8]) -> Result<(), String> {
    let path = Path::new("pattern.csv");
    let pattern = Pattern::parse(bytes, path).map_err(|error| error.to_string())?;
    let middle = pattern.at(0.5 * pattern.duration_s());
    assert!(middle.t_s.is_finite() && pattern.rows().iter().all(|row| row.t_s <= pattern.duration_s()));
    Ok(())
}
