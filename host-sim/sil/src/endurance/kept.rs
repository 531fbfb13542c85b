//! Ends of flights in a file, so that a survey goes on where it was when it was ended, however that was.
//!
//! The first line says whose flights they are; then comes a line for each flight in the order of the seeds: how it ended, and the last of
//! its state. What a power cut left of a line, and all that follows it, is flown again. So is a flight that crashed, whose line says only
//! that it did: there are few, and to fly one takes some ms.

use std::fmt::Write as _;
use std::fs::{File, TryLockError};
use std::io::{Error, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::drawn_flights::{End, Last, MonteCarlo};

/// Why a file cannot keep the ends of flights.
#[derive(Debug, thiserror::Error)]
pub enum KeptError {
    /// It cannot be read or written.
    #[error("{}: cannot keep the flights: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: Error,
    },
    /// Another survey has it.
    #[error("{}: another survey keeps its flights there: wait for it, or name another file", .0.display())]
    Taken(PathBuf),
    /// It is of something else.
    #[error("{}: holds no flights of this survey (other gains, another count, seed or delay, or another file): name another file", .0.display())]
    Other(PathBuf),
}

/// The file, open for more.
#[derive(Debug)]
pub(super) struct Kept {
    path: PathBuf,
    file: File,
    /// Flights that it held when it was opened.
    known: Vec<Option<(End, Last)>>,
}

impl Kept {
    /// Opens or begins the file of a survey.
    pub(super) fn open(path: &Path, plan: &MonteCarlo) -> Result<Self, KeptError> {
        let failed = |source| KeptError::Io { path: path.to_owned(), source };
        let mut file =
            File::options().create(true).truncate(false).read(true).write(true).open(path).map_err(failed)?;
        // Two that write one file would each spoil the other's.
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => KeptError::Taken(path.to_owned()),
            TryLockError::Error(source) => failed(source),
        })?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed)?;
        let head = head(plan);
        let mut kept = Self { path: path.to_owned(), file, known: Vec::new() };
        if head.as_bytes().starts_with(&bytes) {
            kept.cut(0)?;
            kept.write(&head)?;
        } else if let Some(lines) = bytes.strip_prefix(head.as_bytes()) {
            let whole = lines.split_inclusive(|byte| *byte == b'\n');
            let whole = whole
                .zip(0..plan.flights)
                .map_while(|(line, k)| Some((line.len(), read(line, plan.seed.wrapping_add(k))?)));
            let (lengths, known): (Vec<usize>, Vec<_>) = whole.unzip();
            kept.known = known;
            kept.cut(head.len() + lengths.into_iter().sum::<usize>())?;
        } else {
            return Err(KeptError::Other(kept.path));
        }
        Ok(kept)
    }

    /// Flights that it held when it was opened.
    pub(super) fn known(&self) -> u64 {
        self.known.len() as u64
    }

    /// How the flight of this place ended, if that need not be flown again.
    pub(super) fn end(&self, place: u64) -> Option<(End, Last)> {
        self.known.get(usize::try_from(place).ok()?)?.clone()
    }

    /// Keeps those of these flights that are not in the file; the first of them has this place.
    pub(super) fn add(&mut self, place: u64, seeds: &[u64], ends: &[(End, Last)]) -> Result<(), KeptError> {
        let known = self.known().saturating_sub(place) as usize;
        let new = seeds.iter().zip(ends).skip(known);
        self.write(&new.map(|(seed, (end, last))| line(*seed, end, last)).collect::<String>())
    }

    /// Leaves so much of the file, and goes on behind it.
    fn cut(&mut self, length: usize) -> Result<(), KeptError> {
        let cut = self.file.set_len(length as u64).and_then(|()| self.file.seek(SeekFrom::End(0)));
        cut.map(|_| ()).map_err(|source| self.failed(source))
    }

    fn write(&mut self, text: &str) -> Result<(), KeptError> {
        self.file.write_all(text.as_bytes()).map_err(|source| self.failed(source))
    }

    fn failed(&self, source: Error) -> KeptError {
        KeptError::Io { path: self.path.clone(), source }
    }
}

/// The first line: equal for surveys that fly the same flights with the same program.
fn head(plan: &MonteCarlo) -> String {
    let gains = serde_json::to_vec(&plan.config).unwrap_or_default();
    let (flights, seed, version) = (plan.flights, plan.seed, env!("CARGO_PKG_VERSION"));
    let delay = plan.delay_samples.map_or(String::new(), |delay| format!(", poses {delay} samples old"));
    format!(
        "sil {version}: {flights} flights from seed {seed}{delay}, gains {}\n",
        hex(&Sha256::digest(gains))
    )
}

fn line(seed: u64, end: &End, last: &Last) -> String {
    let mark = match end {
        End::Flying => "flying",
        End::Supervised => "supervised",
        End::Impossible(_) | End::Crashed(..) => "down",
    };
    format!("{seed} {mark} {}\n", hex(last))
}

/// What a whole line of this seed says: the inner nothing is of a flight that has to be flown again.
fn read(line: &[u8], seed: u64) -> Option<Option<(End, Last)>> {
    let text = std::str::from_utf8(line.strip_suffix(b"\n")?).ok()?;
    let mut words = text.split(' ');
    let (of, mark, hex) = (words.next()?, words.next()?, words.next()?);
    let mut last = [0; 16];
    for (byte, digits) in last.iter_mut().zip(hex.as_bytes().chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
    }
    let end = match mark {
        "flying" => Some(End::Flying),
        "supervised" => Some(End::Supervised),
        "down" => None,
        _ => return None,
    };
    let is_whole = hex.len() == 2 * last.len() && words.next().is_none() && of.parse() == Ok(seed);
    is_whole.then(|| end.map(|end| (end, last)))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::super::monte_carlo::survey;
    use super::*;
    use crate::flight::designed_config;
    use rand::{RngExt, SeedableRng};

    /// Wherever it was cut, and whatever a power cut left behind the cut: the same file and the same survey.
    #[test]
    fn a_survey_goes_on_wherever_it_was_ended() {
        let mut config = designed_config().unwrap();
        if let control::gains::Law::ModelBased(law) = &mut config.law {
            // Some of its flights crash.
            law.loops.pitch.kp *= 4.0;
        }
        let plan = MonteCarlo { flights: 8, config, seed: 40, delay_samples: None };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flights");
        let whole = survey(&plan, Some(&path)).unwrap();
        let text = std::fs::read(&path).unwrap();
        assert_eq!(whole.sha256, survey(&plan, None).unwrap().sha256);
        assert!(whole.flying + whole.supervised > 0 && !whole.crashes.is_empty(), "{whole}");
        let seed = 7;
        let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
        for round in 0..40 {
            let mut left = text[..random.random_range(0..=text.len())].to_vec();
            let is_in_the_head = !left.contains(&b'\n');
            if round % 2 == 1 && !is_in_the_head {
                left.resize(text.len() + 100, 0);
            }
            std::fs::write(&path, &left).unwrap();
            let again = survey(&plan, Some(&path)).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), text, "seed {seed}, round {round}");
            assert_eq!(
                (&again.sha256, again.flying, &again.crashes),
                (&whole.sha256, whole.flying, &whole.crashes)
            );
        }
        for other in [
            MonteCarlo { seed: 41, ..plan },
            MonteCarlo { flights: 9, ..plan },
            MonteCarlo { delay_samples: Some(2), ..plan },
        ] {
            let why = survey(&other, Some(&path)).unwrap_err().to_string();
            assert!(why.contains("no flights of this survey") && why.lines().count() == 1, "{why}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), text, "what is of another is left alone");
    }
}
