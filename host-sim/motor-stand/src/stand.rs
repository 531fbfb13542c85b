//! Logs of a motor test stand (thesis 3.3, 4.2.5): what the craft sent, and what another computer saw of the rotors.
//!
//! Two CSV files, each with a header and a time of its own; columns by name, in any order, others left alone, an empty field
//! is a missing value:
//!
//! | file | columns |
//! |---|---|
//! | craft | `t` in s; `cmd`, or `cmd1..cmd4`, in the vehicle file's unit; `vbat` in V. A flight file will do |
//! | tachometer | `t` in s; `omega`, or some of `omega1..omega4`, in rad/s |
//!
//! Deliberately absent: what they say together ([`crate::motor_map`]).

use std::path::{Path, PathBuf};

use flights::median_step;
use model::Vehicle;

/// Tip speeds above this, m/s, are no rotor's: air is hit at the speed of sound at 340.
const FASTEST_TIP_M_S: f64 = 290.0;
/// No rotor has a larger thrust coefficient, in terms of (4.3): the thesis' has 0.018.
const LARGEST_THRUST_COEFFICIENT: f64 = 0.1;
/// A command that moves by less than this part of its range is constant.
const LEAST_COMMAND_SPREAD: f64 = 0.01;
/// Longest run, s: a battery lasts for minutes, and what is longer is a clock that leaps.
const LONGEST_RUN_S: f64 = 3600.0;
/// Steps of a log's time that are seconds: from those of a fast pulse counter to those of a slow telemetry.
const STEPS_S: std::ops::Range<f64> = 1e-5..1.0;
/// Fewer values than this are no log.
const FEWEST_ROWS: usize = 100;

/// Why logs of a test stand were refused.
#[derive(Debug, thiserror::Error)]
pub enum StandError {
    /// The file cannot be read.
    #[error("{}: cannot read the log: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not CSV.
    #[error("{}: {message}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A column is missing.
    #[error("{}: row 1: {what}; the header has {found}", path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// Which, and how to mend it.
        what: String,
        /// The header.
        found: String,
    },
    /// A field that is not a number, or a time that does not rise.
    #[error("{}: row {row}: {column} is \"{text}\": {expected}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Row, the header is 1.
        row: usize,
        /// The column.
        column: String,
        /// What stands there.
        text: String,
        /// What it may be.
        expected: &'static str,
    },
    /// Too few values.
    #[error("{}: column \"{column}\" has {values} values; at least {FEWEST_ROWS} are needed", path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// Values found.
        values: usize,
    },
    /// Values that are in another unit, or do not move.
    #[error("{}: column \"{column}\" {observed}: {advice}", path.display())]
    Values {
        /// The file.
        path: PathBuf,
        /// The column.
        column: String,
        /// What was seen.
        observed: String,
        /// What to do.
        advice: String,
    },
    /// Four commands and one rotor.
    #[error("{}: has one rotor and {} four commands that differ: say which motor is on the stand with --motor 1..4", rotor.display(), craft.display())]
    WhichMotor {
        /// The craft's log.
        craft: PathBuf,
        /// The tachometer's.
        rotor: PathBuf,
    },
    /// No command for a rotor.
    #[error("{}: has no command for motor {motor}, whose speed is in {}", craft.display(), rotor.display())]
    NoCommand {
        /// The craft's log.
        craft: PathBuf,
        /// The tachometer's.
        rotor: PathBuf,
        /// The motor.
        motor: usize,
    },
}

/// A motor of a test run: what it was sent, and how fast it turned.
#[derive(Debug, Clone, PartialEq)]
pub struct Motor {
    /// 1 to 4; 0 where the logs do not say.
    pub number: usize,
    /// At the craft's times, command units; NaN where missing.
    pub command: Vec<f64>,
    /// At the tachometer's times, rad/s; NaN where missing.
    pub speed_rad_s: Vec<f64>,
}

/// A run on a test stand.
#[derive(Debug, Clone, PartialEq)]
pub struct Stand {
    /// Times of the craft's rows on its own clock, s.
    pub craft_s: Vec<f64>,
    /// Battery voltage at the craft's times, V; NaN where missing.
    pub battery_v: Vec<f64>,
    /// Times of the tachometer's rows on its own clock, s.
    pub rotor_s: Vec<f64>,
    /// Motors with both command and speed.
    pub motors: Vec<Motor>,
}

/// What is in a file, and where it comes from.
pub type Source<'a> = (&'a [u8], &'a Path);

/// One file: header and columns.
struct Log {
    path: PathBuf,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Log {
    fn parse((bytes, path): Source<'_>) -> Result<Self, StandError> {
        let message = |error: &csv::Error| match error.kind() {
            csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
                let row = pos.as_ref().map_or(0, |p| p.record() + 1);
                format!("row {row}: has {len} fields, the header has {expected_len}; mend or delete the row")
            }
            _ => error.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).collect(),
        };
        let refuse = |error: csv::Error| StandError::Csv { path: path.into(), message: message(&error) };
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
        let header = reader.headers().map_err(refuse)?.clone();
        let names: Vec<String> =
            header.iter().map(|name| name.trim_start_matches('\u{feff}').to_owned()).collect();
        let mut log = Self { path: path.into(), columns: vec![Vec::new(); names.len()], names };
        let wanted: Vec<bool> = log.names.iter().map(|name| is_known(name)).collect();
        for (index, record) in reader.records().enumerate() {
            let record = record.map_err(refuse)?;
            for (k, field) in record.iter().enumerate().filter(|(k, _)| wanted[*k]) {
                let value = match field {
                    "" => f64::NAN,
                    _ => field.parse().map_err(|_| {
                        log.field(k, index + 2, field, "not a number; leave the field empty if it is missing")
                    })?,
                };
                log.columns[k].push(value);
            }
        }
        log.check_times()?;
        Ok(log)
    }

    fn field(&self, column: usize, row: usize, text: &str, expected: &'static str) -> StandError {
        let (path, column) = (self.path.clone(), self.names[column].clone());
        StandError::Field { path, row, column, text: text.into(), expected }
    }

    fn check_times(&self) -> Result<(), StandError> {
        let Some(place) = self.names.iter().position(|name| name == "t") else {
            return Err(self.missing("column \"t\" (seconds) is missing"));
        };
        let t = &self.columns[place];
        if let Some(k) = t.iter().position(|t| !t.is_finite()) {
            return Err(self.field(place, k + 2, "", "a time in seconds"));
        }
        if let Some(k) = t.windows(2).position(|w| w[1] <= w[0]) {
            let text = t[k + 1].to_string();
            return Err(self.field(place, k + 3, &text, "not after the row before; sort the rows"));
        }
        self.check_unit_of_time(t)
    }

    /// Refuses times that are no seconds of one run: clocks are laid side by side in steps of theirs.
    fn check_unit_of_time(&self, t: &[f64]) -> Result<(), StandError> {
        let [Some(first), Some(last)] = [t.first(), t.last()] else { return Ok(()) };
        let step = median_step(t);
        if t.len() > 1 && !STEPS_S.contains(&step) {
            let advice =
                "seconds are expected; divide milliseconds by 1000, microseconds by 1e6, nanoseconds by 1e9";
            return Err(self.values("t", format!("steps by {step}"), advice));
        }
        if !(last - first <= LONGEST_RUN_S) {
            return Err(self.values(
                "t",
                format!("goes from {first} to {last} s"),
                "a run on a stand lasts an hour at most; mend the clock, or cut the log to the run",
            ));
        }
        Ok(())
    }

    fn missing(&self, what: impl Into<String>) -> StandError {
        StandError::Column { path: self.path.clone(), what: what.into(), found: self.names.join(",") }
    }

    fn column(&self, name: &str) -> Option<&Vec<f64>> {
        self.names.iter().position(|n| n == name).map(|k| &self.columns[k])
    }

    /// A column with enough values.
    fn filled(&self, name: &str) -> Result<Option<&Vec<f64>>, StandError> {
        let Some(column) = self.column(name) else { return Ok(None) };
        let values = column.iter().filter(|v| v.is_finite()).count();
        if values < FEWEST_ROWS {
            return Err(StandError::TooShort { path: self.path.clone(), column: name.into(), values });
        }
        Ok(Some(column))
    }

    fn values(&self, column: &str, observed: String, advice: impl Into<String>) -> StandError {
        StandError::Values { path: self.path.clone(), column: column.into(), observed, advice: advice.into() }
    }
}

fn is_known(name: &str) -> bool {
    matches!(name, "t" | "vbat" | "cmd" | "omega")
        || ["cmd", "omega"]
            .iter()
            .any(|p| name.strip_prefix(p).is_some_and(|rest| matches!(rest, "1" | "2" | "3" | "4")))
}

impl Stand {
    /// Reads the logs of a run with motors of `vehicle`. `motor` (1 to 4) says which command belongs to a single rotor.
    ///
    /// # Errors
    /// Files that cannot be read, columns that are missing, units that cannot be right, commands that do not move.
    pub fn read(
        craft: &Path,
        rotor: &Path,
        vehicle: &Vehicle,
        motor: Option<usize>,
    ) -> Result<Self, StandError> {
        let load = |path: &Path| {
            std::fs::read(path).map_err(|source| StandError::Read { path: path.into(), source })
        };
        Self::parse((&load(craft)?, craft), (&load(rotor)?, rotor), vehicle, motor)
    }

    /// The same of logs that have been read.
    ///
    /// # Errors
    /// As [`Stand::read`].
    pub fn parse(
        craft: Source<'_>,
        rotor: Source<'_>,
        vehicle: &Vehicle,
        motor: Option<usize>,
    ) -> Result<Self, StandError> {
        let (craft, rotor) = (Log::parse(craft)?, Log::parse(rotor)?);
        let volts =
            craft.filled("vbat")?.ok_or_else(|| craft.missing("column \"vbat\" (volts) is missing"))?;
        if volts.iter().filter(|v| v.is_finite()).any(|v| !(0.5..200.0).contains(v)) {
            return Err(craft.values(
                "vbat",
                "has values outside 0.5 to 200".into(),
                "volts are expected; divide millivolts by 1000",
            ));
        }
        let mut motors = Vec::new();
        for (number, name) in rotors(&rotor)? {
            let speed = rotor.filled(&name)?.cloned().unwrap_or_default();
            check_speed(&rotor, &name, &speed, vehicle)?;
            let (number, command) = command_of(&craft, &rotor, number, motor)?;
            motors.push(Motor { number, command, speed_rad_s: speed });
        }
        let time = |log: &Log| log.column("t").cloned().unwrap_or_default();
        let (craft_s, rotor_s) = (time(&craft), time(&rotor));
        let stand = Self { craft_s, battery_v: volts.clone(), rotor_s, motors };
        for motor in &stand.motors {
            check_command(&craft, motor, vehicle)?;
        }
        Ok(stand)
    }
}

/// Rotors in a tachometer's log: number (0 unknown) and column.
fn rotors(log: &Log) -> Result<Vec<(usize, String)>, StandError> {
    let numbered = (1..=4).map(|k| (k, format!("omega{k}"))).filter(|(_, name)| log.column(name).is_some());
    let found: Vec<(usize, String)> = match log.column("omega") {
        Some(_) => vec![(0, "omega".to_owned())],
        None => numbered.collect(),
    };
    if found.is_empty() {
        let rpm = log.names.iter().any(|name| name.to_lowercase().contains("rpm"));
        return Err(log.missing(if rpm {
            "column \"omega\" is missing; multiply revolutions a minute by 2 pi / 60 and call them omega"
        } else {
            "column \"omega\" (rad/s), or omega1..omega4, is missing"
        }));
    }
    Ok(found)
}

/// The command of a rotor and the motor's number.
fn command_of(
    craft: &Log,
    rotor: &Log,
    number: usize,
    motor: Option<usize>,
) -> Result<(usize, Vec<f64>), StandError> {
    let number = if number == 0 { motor.unwrap_or(0) } else { number };
    if let Some(shared) = craft.filled("cmd")? {
        return Ok((number, shared.clone()));
    }
    if number > 0 {
        let own = craft.filled(&format!("cmd{number}"))?;
        return own.map(|c| (number, c.clone())).ok_or_else(|| StandError::NoCommand {
            craft: craft.path.clone(),
            rotor: rotor.path.clone(),
            motor: number,
        });
    }
    let all: Vec<&Vec<f64>> = (1..=4).filter_map(|k| craft.column(&format!("cmd{k}"))).collect();
    let same = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    match all.as_slice() {
        [] => Err(craft.missing("column \"cmd\", or cmd1..cmd4, is missing")),
        [first, rest @ ..] if rest.iter().all(|other| same(first, other)) => Ok((0, (*first).clone())),
        _ => Err(StandError::WhichMotor { craft: craft.path.clone(), rotor: rotor.path.clone() }),
    }
}

/// Units of a rotor's speed, by what the rotor would do at it.
fn check_speed(log: &Log, name: &str, speed: &[f64], vehicle: &Vehicle) -> Result<(), StandError> {
    if let Some(k) = speed.iter().position(|w| *w < 0.0) {
        return Err(log.values(name, format!("is {} in row {}", speed[k], k + 2), "speeds are not negative"));
    }
    // One pulse too many is no unit: the speed that nineteen of twenty values keep below.
    let mut sorted: Vec<f64> = speed.iter().copied().filter(|w| w.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let fast = sorted.get(sorted.len() * 19 / 20).copied().unwrap_or(0.0);
    let tip_m_s = fast * vehicle.rotor_radius;
    if tip_m_s > FASTEST_TIP_M_S {
        return Err(log.values(
            name,
            format!("reaches {fast:.0}, at which tips of {} m fly at {tip_m_s:.0} m/s", vehicle.rotor_radius),
            "rad/s are expected; these look like revolutions a minute: multiply by 2 pi / 60 = 0.10472",
        ));
    }
    let lift_n = 4.0 * LARGEST_THRUST_COEFFICIENT * vehicle.beta_kg_m() * fast * fast;
    if lift_n < vehicle.mass * vehicle.gravity {
        return Err(log.values(
            name,
            format!("reaches only {fast:.0}, too slow for four such rotors to lift {} kg", vehicle.mass),
            "rad/s are expected; multiply revolutions a second by 2 pi, or run the motor up to hover and above",
        ));
    }
    Ok(())
}

fn check_command(log: &Log, motor: &Motor, vehicle: &Vehicle) -> Result<(), StandError> {
    let (low, high) = motor
        .command
        .iter()
        .filter(|c| c.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(*c), high.max(*c)));
    let name = match log.column("cmd") {
        Some(_) => "cmd".to_owned(),
        None => format!("cmd{}", motor.number.max(1)),
    };
    let [from, to] = vehicle.motors.command_range;
    let (range, unit) = (to - from, &vehicle.motors.command_unit);
    if low < from - 0.25 * range || high > to + 0.25 * range {
        return Err(log.values(
            &name,
            format!(
                "goes from {low} to {high}, the vehicle \"{}\" takes {from} to {to} {unit}",
                vehicle.name
            ),
            "give commands in the vehicle file's command_unit",
        ));
    }
    if high - low < LEAST_COMMAND_SPREAD * range {
        return Err(log.values(
            &name,
            format!("is constant, {low} to {high} {unit}"),
            "the map needs commands that move: a saw-tooth and sines over the range that is flown",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(path: &str, columns: &[(&str, Vec<f64>)]) -> Log {
        Log {
            path: path.into(),
            names: columns.iter().map(|(name, _)| (*name).to_owned()).collect(),
            columns: columns.iter().map(|(_, values)| values.clone()).collect(),
        }
    }

    fn rising(from: f64, to: f64) -> Vec<f64> {
        (0..200).map(|k| from + (to - from) * f64::from(k) / 199.0).collect()
    }

    #[test]
    fn equal_commands_of_four_motors_belong_to_the_one_rotor() {
        let same: Vec<_> = ["cmd1", "cmd2", "cmd3", "cmd4"].map(|name| (name, rising(1300.0, 1700.0))).into();
        let rotor = log("rotor.csv", &[("omega", rising(400.0, 700.0))]);
        assert_eq!(
            command_of(&log("craft.csv", &same), &rotor, 0, None).unwrap(),
            (0, rising(1300.0, 1700.0))
        );
        let mut different = same;
        different[2].1 = rising(1300.0, 1600.0);
        let craft = log("craft.csv", &different);
        assert!(matches!(command_of(&craft, &rotor, 0, None), Err(StandError::WhichMotor { .. })));
        assert_eq!(command_of(&craft, &rotor, 0, Some(3)).unwrap(), (3, rising(1300.0, 1600.0)));
    }

    /// 635 rad/s, at which the thesis' craft hovers, are 6064 revolutions a minute and 101 a second.
    #[test]
    fn speeds_in_other_units_are_refused_and_radians_are_not() {
        let vehicle = Vehicle::thesis();
        let rotor = log("rotor.csv", &[]);
        let check = |factor: f64| {
            let speed = rising(500.0 * factor, 700.0 * factor);
            check_speed(&rotor, "omega", &speed, &vehicle).map_err(|error| error.to_string())
        };
        assert_eq!(check(1.0), Ok(()));
        let per_minute = check(60.0 / std::f64::consts::TAU).unwrap_err();
        assert!(per_minute.contains("revolutions a minute"), "{per_minute}");
        let per_second = check(1.0 / std::f64::consts::TAU).unwrap_err();
        assert!(per_second.contains("revolutions a second"), "{per_second}");
    }

    #[test]
    fn one_pulse_too_many_is_no_other_unit() {
        let mut speed = rising(500.0, 700.0);
        speed[50] = 6000.0;
        check_speed(&log("rotor.csv", &[]), "omega", &speed, &Vehicle::thesis()).unwrap();
    }

    #[test]
    fn a_time_that_falls_is_named_with_its_row() {
        let mut t = rising(0.0, 2.0);
        t[10] = t[8];
        let error = log("craft.csv", &[("t", t)]).check_times().unwrap_err().to_string();
        // The header is row 1, so that sample 10, counted from 0, is row 12.
        assert!(error.starts_with("craft.csv: row 12: t is "), "{error}");
    }

    #[test]
    fn times_in_another_unit_or_of_a_clock_that_leaps_are_refused() {
        let check = |t: Vec<f64>| log("craft.csv", &[("t", t)]).check_times().map_err(|e| e.to_string());
        assert_eq!(check(rising(0.0, 2.0)), Ok(()));
        assert_eq!(check(rising(1.7e9, 1.7e9 + 2.0)), Ok(()), "seconds since 1970");
        for per_second in [1e3, 1e6, 1e9] {
            let error = check(rising(0.0, 40.0 * per_second)).unwrap_err();
            assert!(error.starts_with("craft.csv: column \"t\" steps by "), "{error}");
        }
        for leap_s in [3601.0, 1e6, 1e9, 1e300] {
            let mut t = rising(0.0, 2.0);
            t[100..].iter_mut().for_each(|t| *t += leap_s);
            // In 1e300 s nothing is left of the steps.
            let error = check(t).unwrap_err();
            assert!(error.contains("an hour at most") || error.contains("sort the rows"), "{error}");
        }
    }
}
