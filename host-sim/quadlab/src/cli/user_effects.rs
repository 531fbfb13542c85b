//! Users' effects on the command line: files of definitions, and flights without the samples at which formulas have no value.

use std::path::PathBuf;

use model::{Effect, Model, UserEffectError};

use crate::cli::flights::{FlightsError, Loaded, Sets};

/// Files of effects as given on the command line.
#[derive(clap::Args)]
pub(crate) struct EffectOptions {
    /// Effects of your own, by name and formula, for example: --effects my-effects.toml
    #[arg(long = "effects", value_name = "TOML", num_args = 1..)]
    files: Vec<PathBuf>,
}

impl EffectOptions {
    /// Reads the files; their effects are then known everywhere.
    pub(crate) fn read(&self) -> Result<Vec<Effect>, UserEffectError> {
        let all: Result<Vec<Vec<Effect>>, _> =
            self.files.iter().map(|path| model::effects::read(path)).collect();
        Ok(all?.concat())
    }

    /// The files.
    pub(crate) fn paths(&self) -> &[PathBuf] {
        &self.files
    }
}

/// Leaves out the samples at which a formula of `effects` or of the model's own has no finite value.
pub(crate) fn leave_out_undefined(
    flights: &mut [Loaded],
    model: &Model,
    effects: &[Effect],
) -> Result<(), FlightsError> {
    let mut all = effects.to_vec();
    all.extend(model.effects().into_iter().filter(|own| !effects.contains(own)));
    for flight in flights {
        let before = flight.prepared.notes.len();
        flight
            .prepared
            .leave_out_undefined(model, &all)
            .map_err(|why| FlightsError::Unusable { path: flight.path.clone(), why })?;
        for note in &flight.prepared.notes[before..] {
            eprintln!("warning: {}: {note}", flight.path.display());
        }
    }
    Ok(())
}

impl Sets {
    /// The same for all flights.
    pub(crate) fn leave_out_undefined(
        &mut self,
        model: &Model,
        effects: &[Effect],
    ) -> Result<(), FlightsError> {
        leave_out_undefined(&mut self.train, model, effects)?;
        leave_out_undefined(&mut self.validate, model, effects)
    }
}
