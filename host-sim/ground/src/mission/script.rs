//! Mission scripts: what they may ask for, and reading them.
//!
//! A script is TOML, one `[[step]]` a table:
//!
//! ```toml
//! [[step]]
//! do = "gains"              # of one loop, in the gains file's units; accepted while disarmed
//! of = "Roll"
//! kp = 27.0
//! ki = 4.0
//! kd = 8.0
//! [[step]]
//! do = "arm"
//! [[step]]
//! do = "take-off"           # straight up from where it stands
//! height_m = 1.0
//! [[step]]
//! do = "go-to"              # stays where a number is left out
//! x = 0.5
//! z = -1.2                  # north-east-down
//! yaw = 0.0                 # rad
//! for_s = 4.0
//! [[step]]
//! do = "step"               # roll, pitch, yaw in rad; x, y, z in m; from where it is
//! axis = "x"
//! size = 1.0
//! for_s = 8.0
//! [[step]]
//! do = "pattern"            # a pattern file (crate `pattern`), as often as wanted
//! file = "tour.csv"
//! times = 2
//! excite = 7                # seed of thesis 4.2.1's excitation, added to the pattern's own injections
//! [[step]]
//! do = "hold"
//! for_s = 5.0
//! excite = 8
//! [[step]]
//! do = "land"
//! ```
//!
//! `disarm` and `cut` are steps too. Paths are relative to the script. A step that is not done in
//! time, or a craft whose supervisor takes over, ends the mission with the step's name; a flying
//! craft is then landed.

use std::path::{Path, PathBuf};

use pattern::{Pattern, PatternError};
use proto::Loop;
use serde::Deserialize;

/// A quantity that steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "said in the module's head")]
pub enum Axis {
    Roll,
    Pitch,
    Yaw,
    X,
    Y,
    Z,
}

/// One thing to do.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
#[expect(missing_docs, reason = "said in the module's head")]
pub enum MissionStep {
    Gains {
        of: Loop,
        kp: f32,
        ki: f32,
        kd: f32,
    },
    Arm {},
    TakeOff {
        height_m: f64,
    },
    GoTo {
        x: Option<f64>,
        y: Option<f64>,
        z: Option<f64>,
        yaw: Option<f64>,
        for_s: f64,
    },
    Step {
        axis: Axis,
        size: f64,
        for_s: f64,
    },
    Hold {
        for_s: f64,
        excite: Option<u64>,
    },
    #[serde(skip_deserializing)]
    Fly {
        pattern: Box<Pattern>,
        times: u32,
        excite: Option<u64>,
    },
    Pattern {
        file: PathBuf,
        #[serde(default = "once")]
        times: u32,
        excite: Option<u64>,
    },
    Land {},
    Disarm {},
    Cut {},
}

impl MissionStep {
    /// The step in a few words.
    pub(super) fn describe(&self) -> String {
        match self {
            Self::Gains { of, .. } => format!("gains of {of:?}"),
            Self::Arm {} => "arm".into(),
            Self::TakeOff { height_m } => format!("take off to {height_m} m"),
            Self::GoTo { .. } => "go to a place".into(),
            Self::Step { axis, size, .. } => format!("step of {size} in {axis:?}"),
            Self::Hold { .. } => "hold".into(),
            Self::Fly { .. } | Self::Pattern { .. } => "pattern".into(),
            Self::Land {} => "land".into(),
            Self::Disarm {} => "disarm".into(),
            Self::Cut {} => "cut".into(),
        }
    }
}

fn once() -> u32 {
    1
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptFile {
    step: Vec<MissionStep>,
}

/// Why a script cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum ScriptError {
    /// The file.
    #[error("{}: {problem}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A step.
    #[error("{}: step {number}: {problem}", path.display())]
    Step {
        /// The script.
        path: PathBuf,
        /// Which step, from 1.
        number: usize,
        /// What is wrong and how to mend it.
        problem: String,
    },
    /// A pattern file.
    #[error(transparent)]
    Pattern(#[from] PatternError),
}

/// Reads and checks a script and the pattern files that it names.
///
/// # Errors
/// What is wrong: file, step, how to mend it.
pub fn read_script(path: &Path) -> Result<Vec<MissionStep>, ScriptError> {
    let refuse = |problem: String| ScriptError::File { path: path.into(), problem };
    let text = std::fs::read_to_string(path).map_err(|e| refuse(format!("cannot read the script: {e}")))?;
    parse_script(&text, path)
}

/// Checks a script given as text; `path` is where it comes from.
///
/// # Errors
/// As [`read_script`].
pub fn parse_script(text: &str, path: &Path) -> Result<Vec<MissionStep>, ScriptError> {
    let file: ScriptFile = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(0, |span| text[..span.start].lines().count().max(1));
        ScriptError::File { path: path.into(), problem: format!("line {line}: {}", error.message()) }
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut steps = Vec::new();
    for (k, step) in file.step.into_iter().enumerate() {
        check(&step).map_err(|problem| ScriptError::Step { path: path.into(), number: k + 1, problem })?;
        steps.push(match step {
            MissionStep::Pattern { file, times, excite } => {
                let pattern = Box::new(Pattern::read(&folder.join(file))?);
                MissionStep::Fly { pattern, times, excite }
            }
            other => other,
        });
    }
    Ok(steps)
}

/// Refuses numbers that make no sense for any craft. The craft's own supervisor knows what it may
/// do.
fn check(step: &MissionStep) -> Result<(), String> {
    let within = |name: &str, value: f64, low: f64, high: f64| match value >= low && value <= high {
        true => Ok(()),
        false => Err(format!("{name} is {value}: from {low} to {high}")),
    };
    match *step {
        MissionStep::TakeOff { height_m } => within("height_m", height_m, 0.1, 100.0),
        MissionStep::Hold { for_s, .. } => within("for_s", for_s, 0.0, 3600.0),
        MissionStep::Step { axis, size, for_s } => {
            within("for_s", for_s, 0.0, 3600.0)?;
            let limit = if matches!(axis, Axis::Roll | Axis::Pitch) { 1.05 } else { 100.0 };
            within("size", size, -limit, limit)
        }
        MissionStep::GoTo { x, y, z, yaw, for_s } => {
            within("for_s", for_s, 0.0, 3600.0)?;
            for (name, value) in [("x", x), ("y", y), ("yaw", yaw)] {
                within(name, value.unwrap_or(0.0), -1000.0, 1000.0)?;
            }
            within("z", z.unwrap_or(0.0), -1000.0, 0.0)
        }
        MissionStep::Gains { kp, ki, kd, .. } => [("kp", kp), ("ki", ki), ("kd", kd)]
            .iter()
            .try_for_each(|(n, v)| within(n, f64::from(*v), -1e9, 1e9)),
        MissionStep::Pattern { times, .. } => within("times", f64::from(times), 1.0, 1000.0),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<Vec<MissionStep>, ScriptError> {
        parse_script(text, Path::new("s.toml"))
    }

    #[test]
    fn what_cannot_be_flown_is_refused_by_file_and_step() {
        for (text, wanted) in [
            ("", "step"),
            ("[[step]]\ndo = \"jump\"", "jump"),
            ("[[step]]\ndo = \"arm\"\nnow = 1", "now"),
            ("[[step]]\ndo = \"arm\"\n[[step]]\ndo = \"take-off\"\nheight_m = -1", "step 2: height_m is -1"),
            ("[[step]]\ndo = \"step\"\naxis = \"roll\"\nsize = 30\nfor_s = 1", "size is 30"),
            ("[[step]]\ndo = \"go-to\"\nz = 1.0\nfor_s = 1", "z is 1"),
            ("[[step]]\ndo = \"hold\"\nfor_s = nan", "for_s is NaN"),
            ("[[step]]\ndo = \"pattern\"\nfile = \"none.csv\"", "none.csv"),
            ("[[step]]\ndo = \"fly\"", "fly"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(
                message.contains(wanted) && message.contains(".toml") | message.contains(".csv"),
                "{message}"
            );
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC{0,200}", line in "(\\[\\[step\\]\\]\ndo = \"(hold|go-to|step|gains)\"\n(for_s|x|size|of) = [-0-9.e]{1,8}\n){0,4}") {
            let _ = parse(&text);
            let _ = parse(&line);
        }
    }
}
