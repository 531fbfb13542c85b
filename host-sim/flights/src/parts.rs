//! Which parts of a flight to use, as its operator says: `A.use.toml` beside `A.csv`.
//!
//! ```toml
//! use = [[3.2, 41.0], [55.0, 80.5]]   # s, times of the log's column t
//! ```

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml_edit::{Array, DocumentMut, Item, Value};

use crate::error::FlightError;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartsFile {
    #[serde(rename = "use")]
    parts: Vec<Vec<f64>>,
}

/// The file beside a flight that says which parts of it to use.
pub fn parts_file(flight: &Path) -> PathBuf {
    flight.with_extension("use.toml")
}

/// First and last time, s, of each part of a flight that its operator wants used; nothing where there is no such file.
pub fn parts_to_use(flight: &Path) -> Result<Option<Vec<[f64; 2]>>, FlightError> {
    let path = parts_file(flight);
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(FlightError::Read { path, source }),
    };
    let refuse = |what: String| FlightError::Parts { path: path.clone(), what };
    let PartsFile { parts } = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| text[..span.start].lines().count().max(1));
        refuse(format!("line {line}: {}", error.message()))
    })?;
    if parts.is_empty() {
        return Err(refuse("use: is empty, so nothing of the flight would be used".into()));
    }
    let checked = parts.iter().enumerate().map(|(index, part)| match part[..] {
        [from, to] if from.is_finite() && to.is_finite() && from < to => Ok([from, to]),
        _ => {
            Err(refuse(format!("use: part {} is {part:?}, not a first time and a later last one", index + 1)))
        }
    });
    checked.collect::<Result<_, _>>().map(Some)
}

/// The text of such a file for these parts, to the millisecond; the comments of `old`, if there is one, stay.
pub fn parts_text(parts: &[[f64; 2]], old: Option<&str>) -> String {
    let millisecond = |time_s: &f64| (1e3 * time_s).round() / 1e3;
    let part = |part: &[f64; 2]| part.iter().map(millisecond).collect::<Array>();
    let mut parts = Value::from(parts.iter().map(part).collect::<Array>());
    let mut document: DocumentMut = old.and_then(|old| old.parse().ok()).unwrap_or_default();
    match document.get_mut("use") {
        Some(Item::Value(old)) => {
            *parts.decor_mut() = old.decor().clone();
            *old = parts;
        }
        _ => {
            parts.decor_mut().set_suffix("   # s, times of the log's column t");
            document.insert("use", Item::Value(parts));
        }
    }
    document.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<Vec<[f64; 2]>>, String> {
        let folder = tempfile::tempdir().unwrap();
        let flight = folder.path().join("A.csv");
        std::fs::write(folder.path().join("A.use.toml"), text).unwrap();
        parts_to_use(&flight).map_err(|error| {
            error
                .to_string()
                .replace(&folder.path().display().to_string(), "")
                .trim_start_matches('/')
                .to_owned()
        })
    }

    #[test]
    fn a_flight_without_such_a_file_is_left_to_what_is_found_in_it() {
        assert_eq!(parts_to_use(Path::new("no-such-folder/A.csv")).unwrap(), None);
    }

    #[test]
    fn parts_are_read_in_seconds_whole_numbers_too() {
        assert_eq!(read("use = [[3, 41.5], [55.0, 80]]").unwrap().unwrap(), [[3.0, 41.5], [55.0, 80.0]]);
    }

    #[test]
    fn parts_are_written_to_the_millisecond_and_read_back() {
        let text = parts_text(&[[3.0, 41.000_49], [55.1, 80.123_6]], None);
        assert_eq!(text, "use = [[3.0, 41.0], [55.1, 80.124]]   # s, times of the log's column t\n");
        assert_eq!(read(&text).unwrap().unwrap(), [[3.0, 41.0], [55.1, 80.124]]);
    }

    #[test]
    fn comments_stay_where_other_parts_are_written() {
        let old = "# gusty after 40 s\nuse = [[1, 2]] # mine\n";
        assert_eq!(parts_text(&[[0.5, 2.0]], Some(old)), "# gusty after 40 s\nuse = [[0.5, 2.0]] # mine\n");
        assert!(parts_text(&[[0.5, 2.0]], Some("use = [[")).starts_with("use = [[0.5, 2.0]]"));
    }

    #[test]
    fn bad_parts_are_refused_with_file_and_field() {
        let said = |text: &str| read(text).unwrap_err();
        let mend = "; write for example use = [[3.2, 41.0], [55.0, 80.5]], in seconds of the column t";
        assert_eq!(
            said("use = [[3.0, 41.0],\n [9.0, 5.0]]"),
            format!("A.use.toml: use: part 2 is [9.0, 5.0], not a first time and a later last one{mend}")
        );
        assert_eq!(
            said("use = []"),
            format!("A.use.toml: use: is empty, so nothing of the flight would be used{mend}")
        );
        for text in ["use = [[1.0, nan]]", "use = [[-inf, 2.0]]", "use = [[1.0, 2.0, 3.0]]", "use = [[1.0]]"]
        {
            assert!(said(text).contains("use: part 1 is ["), "{text}");
        }
        for text in ["used = [[1.0, 2.0]]", "use = 3", "use = [[\"a\", 1.0]]", "use ="] {
            assert!(said(text).starts_with("A.use.toml: line 1: "), "{text}: {}", said(text));
        }
    }
}
