//! What is in the folder: reading it, again when it has changed, and flights to try the lab on.

use std::path::PathBuf;
use std::sync::{Arc, PoisonError};

use diagnosis::workflow::Observer as _;
use rayon::prelude::*;

use super::flights::{FlightFile, Use};
use super::links;
use super::refused::Refused;
use super::session::{Session, State, Telling};
use super::upload::is_settings;
use super::vehicle::{Craft, Measured};
use crate::cli::demo_flights::{self, seed_from_clock};
use crate::cli::flights::flights_in;
use crate::cli::model_files::VEHICLE;

impl Session {
    /// Reads vehicle and flights of the folder, and forgets what was made of those that were read before.
    pub(super) fn read_flights(&self) {
        let problem = self.try_read_flights().err().map(|error| report::error_line(&format!("{error:#}")));
        {
            let mut state = self.lock();
            state.problem = problem;
            state.forget_seen();
        }
        self.look_ahead();
        self.lock().reading = false;
        self.events.changed();
    }

    /// Begins to read, where nothing else is done with flights and `check` allows it; gives what that found.
    pub(super) fn begin_reading<T>(
        &self,
        check: impl FnOnce(&State) -> Result<T, Refused>,
    ) -> Result<T, Refused> {
        let found = {
            let mut state = self.lock();
            state.has_no_job()?;
            state.has_read()?;
            let found = check(&state)?;
            state.reading = true;
            found
        };
        self.events.changed();
        Ok(found)
    }

    /// Reads them again, beside the page.
    pub(super) fn read_again(self: &Arc<Self>) -> Result<(), Refused> {
        self.begin_reading(|_| Ok(()))?;
        let session = self.clone();
        std::thread::spawn(move || session.read_flights());
        Ok(())
    }

    /// Flies the demonstration into a folder without flights, and reads it.
    pub(super) fn fly_demo(self: &Arc<Self>) -> Result<(), Refused> {
        self.begin_reading(|state| {
            links::check_all(&self.folder, |_| true)?;
            if state.files.is_empty() && !self.folder.join(VEHICLE).exists() {
                return Ok(());
            }
            Err(Refused::new("the demonstration flies in an empty folder: start quadlab lab in one"))
        })?;
        let session = self.clone();
        std::thread::spawn(move || {
            let telling = Telling { session: &session, kind: "reading", cancel: None };
            let seed = seed_from_clock();
            let told = match demo_flights::fly(seed, &session.folder, &telling) {
                Ok(_) => {
                    format!("`quadlab demo --seed {seed}` flies the same craft, and says what is hidden")
                }
                Err(error) => format!("{error:#}"),
            };
            telling.warning(&told);
            session.read_flights();
        });
        Ok(())
    }

    /// Reads the flights again, where formulas have come to name columns of them since they were read.
    pub(super) fn read_further_columns(&self) -> Result<(), Refused> {
        let _seeing = self.seeing.lock().unwrap_or_else(PoisonError::into_inner);
        if self.lock().columns == model::user_effects::columns().len() {
            return Ok(());
        }
        self.try_read_flights().map_err(|error| Refused::new(format!("{error:#}")))?;
        self.lock().forget_seen();
        Ok(())
    }

    fn try_read_flights(&self) -> anyhow::Result<()> {
        let columns = model::user_effects::columns().len();
        let paths = flights_in(&self.folder)?;
        links::check_all(&self.folder, is_settings)?;
        let telling = Telling { session: self, kind: "reading", cancel: None };
        let within: Vec<PathBuf> =
            paths.iter().filter(|path| links::check(&self.folder, path).is_ok()).cloned().collect();
        let craft = Craft::of(&self.folder, &within, &telling)?;
        let vehicle = craft.vehicle.clone();
        let is_blocked = !craft.is_written && paths.iter().any(|path| logs::format_of(path).is_none());
        self.lock().craft = Some(craft);
        let read = |path: &PathBuf| match links::check(&self.folder, path) {
            Ok(()) => FlightFile::read(path, &vehicle, Use::None, &telling),
            Err(why) => FlightFile::unread(path, &vehicle, &why.to_string()),
        };
        let mut files: Vec<FlightFile> = paths.par_iter().map(read).collect();
        let mut state = self.lock();
        for (index, file) in files.iter_mut().filter(|file| file.is_usable()).enumerate() {
            file.used = state.use_of(&file.name, index);
        }
        (state.files, state.columns) = (files, columns);
        // As every command, which takes the vehicle of logs from them, and of flight files from a file of its own.
        anyhow::ensure!(
            !is_blocked,
            "there is no {VEHICLE} yet: press Vehicle, check what is guessed, and save it"
        );
        Ok(())
    }

    /// Writes the vehicle file, and reads the flights again with it.
    pub(super) fn write_vehicle(self: &Arc<Self>, measured: &Measured) -> Result<(), Refused> {
        let craft = self.lock().craft.clone();
        let craft = craft.ok_or_else(|| Refused::new("there is no flight yet: drop flights on the page"))?;
        links::check(&self.folder, &self.folder.join(VEHICLE))?;
        craft.write(&self.folder, measured)?;
        self.read_again()
    }
}
