//! Which parts of a flight are used: the file `NAME.use.toml` beside it, that every command honours, written for the page.

use std::path::{Path, PathBuf};

use flights::{parts_file, parts_text};
use model::Vehicle;
use report::number::fixed;
use serde::Deserialize;

use super::flights::{FlightFile, Use};
use super::links;
use super::refused::Refused;
use super::session::{Session, State, Telling};

/// Parts of one flight at most.
const MOST_PARTS: usize = 1000;
/// Times are written to the millisecond, so the ends of a flight may lie by so much outside of it, s.
const ROUNDED_S: f64 = 1e-3;

/// What the page asks for.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UsedParts {
    /// The flight's name.
    name: String,
    /// First and last time of each part, s; `null` for all that flies. It must be there: a request that lacks it removes no file.
    #[serde(deserialize_with = "Option::deserialize")]
    parts: Option<Vec<[f64; 2]>>,
}

/// The flight of a request, and the file that is written.
struct Target {
    /// The file that holds the flight.
    flight: PathBuf,
    parts: PathBuf,
    vehicle: Vehicle,
}

impl Session {
    /// Writes which parts of a flight are used, and reads the flight again. Where it cannot be used then, all stays as it was.
    pub(super) fn use_parts(&self, asked: &UsedParts) -> Result<(), Refused> {
        let target = self.begin_reading(|state| state.target(asked))?;
        // A bug in the reading must not leave a page that waits for ever.
        let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            self.write_and_read(&target, asked.parts.as_deref())
        }));
        self.lock().reading = false;
        self.events.changed();
        done.unwrap_or_else(|_| Err(Refused::new("the flight could not be read: a bug of quadlab")))
    }

    fn write_and_read(&self, target: &Target, parts: Option<&[[f64; 2]]>) -> Result<(), Refused> {
        links::check(&self.folder, &target.flight)?;
        links::check(&self.folder, &target.parts)?;
        let old = read(&target.parts)?;
        put(&target.parts, parts.map(|parts| parts_text(parts, old.as_deref())).as_deref())?;
        let telling = Telling { session: self, kind: "reading", cancel: None };
        let file = FlightFile::read(&target.flight, &target.vehicle, Use::None, &telling);
        if let Err(why) = &*file.flights {
            let why = Refused::new(format!("{why}; the parts stay as they were"));
            put(&target.parts, old.as_deref())?;
            return Err(why);
        }
        self.lock().replace(file);
        Ok(())
    }
}

impl State {
    fn target(&self, asked: &UsedParts) -> Result<Target, Refused> {
        let UsedParts { name, parts } = asked;
        let mut known = self.files.iter().flat_map(|file| file.known().map(move |flight| (file, flight)));
        let Some((file, flight)) = known.find(|(_, flight)| flight.prepared.name == *name) else {
            return Err(Refused::new(format!("{name}: there is no such flight in this folder")));
        };
        let path = parts_file(&flight.path);
        let shares = |other: &FlightFile| other.known().any(|other| parts_file(&other.path) == path);
        if let Some(other) = self.files.iter().find(|other| other.path != file.path && shares(other)) {
            let (one, other, path) = (&file.name, &other.name, path.display());
            return Err(Refused::new(format!(
                "{one} and {other} share the file {path}: rename one of the two"
            )));
        }
        if let Some(parts) = parts {
            check(parts, flight.taken.span_s).map_err(|why| Refused::new(format!("{name}: {why}")))?;
        }
        let craft = self.craft.as_ref().ok_or_else(|| Refused::new("there is no flight yet"))?;
        Ok(Target { flight: file.path.clone(), parts: path, vehicle: craft.vehicle.clone() })
    }
}

/// Refuses parts that are none of a flight from one time to another, s.
fn check(parts: &[[f64; 2]], [first, last]: [f64; 2]) -> Result<(), String> {
    if parts.is_empty() {
        return Err("nothing of it would be used: choose a part that flies".into());
    }
    if parts.len() > MOST_PARTS {
        return Err(format!("{} parts are too many: choose {MOST_PARTS} at most", parts.len()));
    }
    let said = |[from, to]: [f64; 2]| format!("{} to {} s", fixed(from, 3), fixed(to, 3));
    let mut end = f64::NEG_INFINITY;
    for &[from, to] in parts {
        let part = said([from, to]);
        // Not a number is none of them.
        if !(from.is_finite() && to.is_finite() && to - from > ROUNDED_S) {
            return Err(format!("{part} is no part: its last time must be later than its first"));
        }
        if from < end {
            return Err(format!("{part} begins before the part in front of it ends: put them in order"));
        }
        if from < first - ROUNDED_S || to > last + ROUNDED_S {
            return Err(format!("{part} is not within the flight, which goes from {}", said([first, last])));
        }
        end = to;
    }
    Ok(())
}

/// A file's text, if it is there.
fn read(path: &Path) -> Result<Option<String>, Refused> {
    match std::fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Refused::new(format!("{}: cannot be read: {error}", path.display()))),
    }
}

/// Writes a file whole, or removes it.
fn put(path: &Path, text: Option<&str>) -> Result<(), Refused> {
    match text {
        Some(text) => Ok(report::write_atomic(path, text)?),
        None => match std::fs::remove_file(path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                Err(Refused::new(format!("{}: cannot be removed: {error}", path.display())))
            }
            _ => Ok(()),
        },
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::lab::session::Job;

    const SPAN_S: [f64; 2] = [0.0, 23.9999];

    #[test]
    fn parts_within_the_flight_in_their_order_are_taken() {
        for parts in [&[[0.0, 24.0]][..], &[[0.5, 3.0], [3.0, 4.0], [20.0, 23.5]]] {
            assert_eq!(check(parts, SPAN_S), Ok(()));
        }
    }

    #[test]
    fn other_parts_are_refused_with_what_is_wrong() {
        for (parts, expected) in [
            (&[][..], "nothing of it would be used"),
            (&[[3.0, 2.0]], "3.000 to 2.000 s is no part"),
            (&[[3.0, 3.0]], "is no part"),
            (&[[f64::NAN, 2.0]], "is no part"),
            (&[[0.0, f64::INFINITY]], "is no part"),
            (&[[0.0, 3.0], [2.0, 4.0]], "2.000 to 4.000 s begins before the part in front of it ends"),
            (&[[0.0, 24.1]], "is not within the flight, which goes from 0.000 to 24.000 s"),
            (&[[-0.1, 3.0]], "is not within the flight"),
            (&[[0.0, 1.0]; 1001], "1001 parts are too many"),
        ] {
            let why = check(parts, SPAN_S).unwrap_err();
            assert!(why.contains(expected), "{why}");
        }
    }

    #[test]
    fn nothing_is_changed_under_a_job_or_while_flights_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::open(folder.path()).unwrap();
        let asked = UsedParts { name: "A.csv".into(), parts: None };
        let why = || session.use_parts(&asked).unwrap_err().into_sentence();
        assert!(why().contains("the flights are being read"));
        session.lock().reading = false;
        assert!(why().contains("A.csv: there is no such flight"));
        let job = Job { kind: "diagnose", activity: String::new(), steps: None, cancel: Arc::default() };
        session.lock().job = Some(job);
        assert!(why().contains("diagnose is running"));
    }

    #[test]
    fn a_request_without_parts_is_none_for_all_that_flies() {
        let asked = |text: &str| serde_json::from_str::<UsedParts>(text);
        assert!(asked(r#"{"name":"A.csv"}"#).is_err());
        assert!(asked(r#"{"name":"A.csv","parts":[[1,null]]}"#).is_err());
        assert_eq!(asked(r#"{"name":"A.csv","parts":null}"#).unwrap().parts, None);
        assert_eq!(asked(r#"{"name":"A.csv","parts":[[1,2.5]]}"#).unwrap().parts.unwrap(), [[1.0, 2.5]]);
    }
}
