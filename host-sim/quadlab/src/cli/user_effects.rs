//! Users' effects on the command line: files of definitions.

use std::path::PathBuf;

use model::{Effect, UserEffectError};

/// Files of effects as given on the command line.
#[derive(clap::Args)]
pub(crate) struct EffectOptions {
    /// Files with effects of your own, written as formulas, for example: --effects my-effects.toml
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
