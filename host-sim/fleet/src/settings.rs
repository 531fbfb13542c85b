//! What the user says of flights in `fleet.toml`: which battery was flown, and when.
//!
//! ```toml
//! [batteries]                       # patterns of paths in the fleet's folder
//! B7 = ["quad-1/2026-03-*.csv", "*/b7/**"]
//!
//! [dates]                           # where neither the log nor the file's name tells
//! "quad-1/test.csv" = "2026-03-04T15:30"
//!
//! exclude = ["*/crashes/**"]        # at the top of the file: never used
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use glob::{MatchOptions, Pattern};
use serde::Deserialize;

use crate::error::FleetError;
use crate::when::{When, WhenFrom};

/// Name of the file.
pub(crate) const SETTINGS: &str = "fleet.toml";

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default)]
    exclude: Vec<String>,
    #[serde(default)]
    batteries: BTreeMap<String, Vec<String>>,
    #[serde(default)]
    dates: BTreeMap<String, String>,
}

/// What the user says of flights.
#[derive(Debug, Default)]
pub(crate) struct Settings {
    exclude: Vec<Pattern>,
    batteries: Vec<(Pattern, String)>,
    dates: BTreeMap<String, When>,
}

impl Settings {
    /// Reads the file, where there is one.
    pub(crate) fn read(path: &Path) -> Result<Self, FleetError> {
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, path),
            Err(why) if why.kind() == std::io::ErrorKind::NotFound => Ok(Self::default()),
            Err(why) => Err(FleetError::Read { path: path.into(), why }),
        }
    }

    fn parse(text: &str, path: &Path) -> Result<Self, FleetError> {
        let wrong = |why: String| FleetError::content(path, report::error_line(&why));
        let written: Written = toml::from_str(text).map_err(|why| wrong(why.to_string()))?;
        let pattern = |text: &String| {
            Pattern::new(text).map_err(|why| wrong(format!("\"{text}\" is no pattern of paths: {why}")))
        };
        let exclude = written.exclude.iter().map(pattern).collect::<Result<_, _>>()?;
        let mut batteries = Vec::new();
        for (battery, patterns) in &written.batteries {
            for text in patterns {
                batteries.push((pattern(text)?, battery.clone()));
            }
        }
        let date = |(file, date): (&String, &String)| {
            let unix_s = crate::when::of_text(date).ok_or_else(|| {
                wrong(format!(
                    "dates: \"{date}\" of \"{file}\" is no date: write 2026-03-04 or 2026-03-04T15:30"
                ))
            })?;
            Ok((file.clone(), When { unix_s, from: WhenFrom::Settings }))
        };
        let dates = written.dates.iter().map(date).collect::<Result<_, FleetError>>()?;
        Ok(Self { exclude, batteries, dates })
    }

    /// What is said of none of some files, one sentence each.
    pub(crate) fn unmatched(&self, files: &[String]) -> Vec<String> {
        let Some(example) = files.first() else { return Vec::new() };
        let none = |pattern: &Pattern| !files.iter().any(|file| matches(pattern, file));
        let told = |what: String| {
            format!(
                "{SETTINGS}: {what} is the path of no flight; write paths in the fleet's folder, such as {example}"
            )
        };
        let excluded = self.exclude.iter().filter(|own| none(own));
        let batteries = self.batteries.iter().filter(|(own, _)| none(own));
        let dates = self.dates.keys().filter(|file| !files.contains(file));
        excluded
            .map(|own| told(format!("exclude: \"{own}\"")))
            .chain(batteries.map(|(own, battery)| told(format!("[batteries] {battery}: \"{own}\""))))
            .chain(dates.map(|file| told(format!("[dates] \"{file}\""))))
            .collect()
    }

    /// Whether a file is never used.
    pub(crate) fn excludes(&self, file: &str) -> bool {
        self.exclude.iter().any(|pattern| matches(pattern, file))
    }

    /// The battery of a file: what the user says, else the word after `battery-` in its path.
    pub(crate) fn battery(&self, file: &str) -> Option<String> {
        let said = self.batteries.iter().find(|(pattern, _)| matches(pattern, file));
        said.map(|(_, battery)| battery.clone()).or_else(|| named(file))
    }

    /// When a file was flown, where the user says.
    pub(crate) fn date(&self, file: &str) -> Option<When> {
        self.dates.get(file).copied()
    }
}

fn matches(pattern: &Pattern, file: &str) -> bool {
    let options = MatchOptions { require_literal_separator: true, ..MatchOptions::new() };
    pattern.matches_with(file, options)
}

/// The word after "battery-" or "battery_" in a path.
fn named(file: &str) -> Option<String> {
    let lower = file.to_ascii_lowercase();
    let at = lower.find("battery")? + "battery".len();
    let rest = file.get(at..)?.strip_prefix(['-', '_'])?;
    let end = rest.find(|letter: char| !letter.is_alphanumeric()).unwrap_or(rest.len());
    (end > 0).then(|| rest[..end].to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Result<Settings, FleetError> {
        Settings::parse(text, Path::new("fleet.toml"))
    }

    #[test]
    fn batteries_are_said_or_named() {
        let own = settings("[batteries]\nB7 = [\"quad-1/*.csv\", \"*/b7/**\"]\n").unwrap();
        assert_eq!(own.battery("quad-1/3.csv").as_deref(), Some("B7"));
        assert_eq!(own.battery("quad-2/b7/x/3.csv").as_deref(), Some("B7"));
        assert_eq!(own.battery("quad-2/3.csv"), None);
        assert_eq!(own.battery("quad-2/Battery-12/3.csv").as_deref(), Some("12"));
        assert_eq!(own.battery("quad-2/3_battery_A4_hover.csv").as_deref(), Some("A4"));
        assert_eq!(own.battery("quad-2/battery.csv"), None);
    }

    #[test]
    fn what_cannot_be_right_is_refused_with_the_file() {
        for (text, said) in [
            ("batteries = 3", "batteries"),
            ("[dates]\n\"a.csv\" = \"yesterday\"", "is no date"),
            ("[batteries]\nA = [\"a[\"]", "is no pattern"),
            ("colour = 1", "unknown field"),
        ] {
            let why = settings(text).unwrap_err().to_string();
            assert!(why.starts_with("fleet.toml: ") && why.contains(said) && !why.contains('\n'), "{why}");
        }
    }

    #[test]
    fn what_is_said_of_no_flight_is_named() {
        let text = "exclude = [\"b/**\", \"a/x*\"]\n[batteries]\nB7 = [\"a/2.csv\", \"a/b/*.csv\"]\n[dates]\n\"a/3.csv\" = \"2026-03-04\"\n";
        let files = ["a/1.csv", "a/2.csv", "a/x1.csv"].map(String::from);
        let found = settings(text).unwrap().unmatched(&files);
        for (told, what) in
            found.iter().zip(["exclude: \"b/**\"", "[batteries] B7: \"a/b/*.csv\"", "[dates] \"a/3.csv\""])
        {
            assert!(told.starts_with(&format!("fleet.toml: {what} is the path of no flight")), "{told}");
        }
        assert_eq!(found.len(), 3);
    }

    #[test]
    fn dates_and_what_is_left_out() {
        let own = settings("exclude = [\"*/crash/**\"]\n[dates]\n\"a/1.csv\" = \"2026-03-04\"\n").unwrap();
        assert!(own.excludes("a/crash/1.csv") && !own.excludes("a/1.csv"));
        assert_eq!(own.date("a/1.csv").unwrap().to_string(), "2026-03-04 00:00");
    }
}
