//! `quadlab motor-map`: motor map and lag from a test stand into the vehicle file.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use model::{Vehicle, VehicleError};
use motor_stand::motor_map::{Estimated, Judged, Map, StandResult, motor_map};
use motor_stand::stand::Stand;
use report::number::{fixed, percent, with_error};
use report::{Axis, Figure, Page, Panels, Section, Series, Style, significant};
use schemars::JsonSchema;
use serde::Serialize;
use toml_edit::{DocumentMut, Item, RawString, TableLike, value};

use crate::cli::output::{Outcome, OutputOptions, provenance};

/// Find the motor map (command and voltage to rotor speed) and the motors' lag on a test stand.
///
/// The craft logs commands and voltage; another computer logs the rotor speed on a clock of its own.
/// One fit estimates the offset and drift between the clocks, the map and the lag, with standard
/// errors. Maps with more and with fewer terms are compared on held-out parts of the run.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  quadlab motor-map --vehicle vehicle.toml --craft craft.csv --rotor tachometer.csv --out vehicle.toml\n\nThe craft's log has the columns t (s), cmd or cmd1..cmd4, vbat (V); the tachometer's t (s) and omega,\nor omega1..omega4 (rad/s). Each has a header and its own clock. --out keeps everything else in the vehicle\nfile, including comments; it may be the same file."
)]
pub(crate) struct Options {
    /// Vehicle file: rotor radius, mass and command range of the craft on the stand
    #[arg(long, value_name = "TOML")]
    vehicle: PathBuf,

    /// Log of the craft: commands and voltage
    #[arg(long, value_name = "CSV")]
    craft: PathBuf,

    /// Log of the tachometer: rotor speeds
    #[arg(long, value_name = "CSV")]
    rotor: PathBuf,

    /// Which motor is on the stand; needed if one rotor was measured and the four commands differ
    #[arg(long, value_name = "1..4", value_parser = clap::value_parser!(u8).range(1..=4))]
    motor: Option<u8>,

    /// Fit command and offset only, for a supply of constant voltage
    #[arg(long)]
    without_voltage: bool,

    /// Vehicle file to write, for example: --out vehicle.toml
    #[arg(long, value_name = "TOML")]
    out: Option<PathBuf>,

    /// Write a page with figures, for example: --html stand.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Serialize, JsonSchema)]
pub(crate) struct Document<'a> {
    #[serde(flatten)]
    result: &'a StandResult,
    /// Whether (4.10), or it without voltage, is what the data support.
    file_can_hold_it: bool,
    vehicle: Option<String>,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    options.output.check(options.out.iter().chain(&options.html), &[&options.craft, &options.rotor])?;
    let text = std::fs::read_to_string(&options.vehicle)
        .map_err(|source| VehicleError::Read { path: options.vehicle.clone(), source })?;
    let vehicle = Vehicle::parse(&text, &options.vehicle)?;
    let stand = Stand::read(&options.craft, &options.rotor, &vehicle, options.motor.map(usize::from))?;
    let result = motor_map(&stand, !options.without_voltage)
        .map_err(|why| anyhow::Error::new(why).context(both(options)))?;
    if let Some(out) = &options.out {
        report::write_atomic(out, completed(&text, &result.map, &options.vehicle)?)?;
    }
    if let Some(html) = &options.html {
        let files: [&Path; 3] = [&options.vehicle, &options.craft, &options.rotor];
        page(&result, &vehicle).provenance(provenance(&files, [])).write(html)?;
    }
    if options.output.json {
        let written = options.out.as_ref().map(|path| path.display().to_string());
        let document = Document { file_can_hold_it: holds(&result), result: &result, vehicle: written };
        return Outcome::json(&document);
    }
    Ok(Outcome::done(described(&result, &vehicle, options.out.as_deref())))
}

fn both(options: &Options) -> String {
    format!("{} and {}", options.craft.display(), options.rotor.display())
}

/// Whether the vehicle file's map has every term that the data support.
fn holds(result: &StandResult) -> bool {
    result.maps[usize::from(result.map.voltage.is_some())].terms == result.supported
}

/// The vehicle file with the map and, where it is known, the lag. Everything else stays, comments
/// too.
fn completed(text: &str, map: &Map, path: &Path) -> anyhow::Result<String> {
    let mut document: DocumentMut = text.parse()?;
    let Some(motors) = document.get_mut("motors").and_then(Item::as_table_like_mut) else {
        anyhow::bail!("{}: has no table [motors]", path.display());
    };
    remove(motors, "map", "command");
    set(motors, "command", Some(map.command));
    set(motors, "voltage", map.voltage);
    set(motors, "offset", Some(map.offset));
    if map.lag_is_known {
        set(motors, "lag", Some(map.lag));
    }
    let text = document.to_string();
    // What is written must be read by everything else.
    Vehicle::parse(&text, path)?;
    Ok(text)
}

/// Sets a key to the digits that its error leaves, and keeps the comment behind it.
fn set(table: &mut dyn TableLike, key: &str, estimate: Option<Estimated>) {
    let Some(estimate) = estimate else {
        remove(table, key, "offset");
        return;
    };
    let mut item = value(rounded(estimate));
    // `insert` would take the comments above the key away.
    let Some(old) = table.get_mut(key) else {
        table.insert(key, item);
        return;
    };
    if let (Some(old), Some(new)) = (old.as_value(), item.as_value_mut()) {
        *new.decor_mut() = old.decor().clone();
    }
    *old = item;
}

/// Removes a key; comments above it and behind it then stand above another one.
fn remove(table: &mut dyn TableLike, key: &str, heir: &str) {
    let text = |raw: Option<&RawString>| raw.and_then(RawString::as_str).unwrap_or_default().to_owned();
    let above = table.key(key).map(|key| text(key.leaf_decor().prefix())).unwrap_or_default();
    let behind = table.get(key).and_then(Item::as_value).map(|value| text(value.decor().suffix()));
    table.remove(key);
    let mut comments = if above.contains('#') { above } else { String::new() };
    if let Some(behind) = behind.filter(|behind| behind.contains('#')) {
        comments += &format!("{}\n", behind.trim());
    }
    if comments.is_empty() {
        return;
    }
    if !table.contains_key(heir) {
        table.insert(heir, value(0.0));
    }
    if let Some(mut key) = table.key_mut(heir) {
        let own = text(key.leaf_decor().prefix());
        key.leaf_decor_mut().set_prefix(comments + &own);
    }
}

/// To a hundredth of the standard error.
fn rounded(estimate: Estimated) -> f64 {
    let digits = (2.0 - estimate.std_error.max(1e-9).log10().floor()).clamp(0.0, 12.0);
    let scale = 10_f64.powi(digits as i32);
    (estimate.value * scale).round() / scale
}

fn plus_minus(e: Estimated, unit: &str) -> String {
    with_error(e.value, e.std_error, unit)
}

fn described(result: &StandResult, vehicle: &Vehicle, out: Option<&Path>) -> String {
    let mut text = described_map(result, vehicle);
    let clock = &result.clock;
    let _ = writeln!(
        text,
        "\nClocks: the craft's is {} s ahead of the tachometer's and runs {} ms a minute fast",
        plus_minus(clock.offset_s, ""),
        with_error(6e4 * clock.skew.value, 6e4 * clock.skew.std_error, "")
    );
    let _ = writeln!(
        text,
        "Left out: {} missed pulses, {} samples in gaps, missing, or of a rotor at rest or starting",
        result.missed_pulses, result.left_out
    );
    describe_support(&mut text, result);
    for motor in &result.motors {
        let _ = writeln!(
            text,
            "motor {}: {} than the common map says; by itself command {}, lag {}",
            motor.motor,
            difference(motor.faster_rad_s),
            plus_minus(motor.map.command, ""),
            plus_minus(motor.map.lag, "rad/s"),
        );
    }
    if let Some(out) = out {
        let _ = writeln!(text, "\nvehicle file: {}", out.display());
    }
    text
}

/// The map and lag beside those of the vehicle file, and what they leave.
fn described_map(result: &StandResult, vehicle: &Vehicle) -> String {
    let mut text = String::new();
    let map = &result.map;
    let unit = &vehicle.motors.command_unit;
    let before = &vehicle.motors;
    let mut line = |name: &str, estimate: Estimated, unit: &str, was: Option<f64>| {
        let was = was.map_or_else(String::new, |w| format!("   (file: {})", significant(w, 5)));
        let _ = writeln!(text, "  {name:<9}{}{was}", plus_minus(estimate, unit));
    };
    line("command", map.command, &format!("rad/s/{unit}"), before.command);
    if let Some(voltage) = map.voltage {
        line("voltage", voltage, "rad/s/V", before.voltage);
    }
    line("offset", map.offset, "rad/s", before.offset);
    line("lag", map.lag, if map.lag_is_known { "rad/s" } else { "rad/s: not determined" }, before.lag);
    let head = format!(
        "rotor speed = command * cmd{} + offset, then a first-order lag\n",
        if map.voltage.is_some() { " + voltage * vbat" } else { "" }
    );
    text.insert_str(0, &head);
    let _ = writeln!(
        text,
        "  residual {} rad/s root mean square of {} samples, {} to {} V",
        significant(map.rms_rad_s, 3),
        result.samples,
        fixed(result.battery_v[0], 2),
        fixed(result.battery_v[1], 2)
    );
    text
}

/// Which map the data support.
fn describe_support(text: &mut String, result: &StandResult) {
    let _ = writeln!(text, "\n{:<36}{:>10}{:>10}   support", "map", "fitted", "held out");
    for judged in &result.maps {
        let _ = writeln!(
            text,
            "{:<36}{:>10}{:>10}   {}",
            judged.terms,
            significant(judged.fitted_rad_s, 3),
            significant(judged.held_out_rad_s, 3),
            support(judged)
        );
    }
    let _ = writeln!(text, "(root mean square error, rad/s)\n\nThe data support: {}.", result.supported);
    if !holds(result) {
        text.push_str("The vehicle file's map has no such term: it holds the best map without it.\n");
    }
}

fn difference(faster: Estimated) -> String {
    let order = if faster.value < 0.0 { "slower" } else { "faster" };
    format!("{} {order}", with_error(faster.value.abs(), faster.std_error, "rad/s"))
}

fn support(judged: &Judged) -> String {
    match (judged.against, judged.drop_percent, judged.deviations) {
        (Some(against), Some(drop), Some(deviations)) => format!(
            "{}: squared error {} % {} than with {against}, {} standard deviations",
            if judged.supported { "yes" } else { "no" },
            percent(drop.abs()),
            if drop < 0.0 { "more" } else { "less" },
            fixed(deviations.abs(), 1)
        ),
        _ => "the simplest".into(),
    }
}

fn page(result: &StandResult, vehicle: &Vehicle) -> Page {
    let samples = &result.figures;
    let first = samples.motor.first().copied();
    let of_first: Vec<usize> =
        (0..samples.motor.len()).filter(|&k| Some(samples.motor[k]) == first).collect();
    let pairs = |x: &[f64], y: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        of_first.iter().map(|&k| (x[k], y(k))).collect()
    };
    let (time, residual) =
        (&samples.time_s, |k: usize| samples.measured_rad_s[k] - samples.predicted_rad_s[k]);
    let unit = vehicle.motors.command_unit.as_str();
    let clock = || Axis::new("tachometer's time", "s");
    let speed = Figure::new("Rotor speed", clock(), Axis::new("rotor speed", "rad/s"))
        .with(Series::points("measured", Style::Measured, pairs(time, &|k| samples.measured_rad_s[k])))
        .with(Series::line(
            "map and lag",
            Style::PredictedAfter,
            pairs(time, &|k| samples.predicted_rad_s[k]),
        ));
    let command = Figure::new("Command", clock(), Axis::new("command", unit)).with(Series::step(
        "",
        Style::Reference,
        pairs(time, &|k| samples.command[k]),
    ));
    let volts = Figure::new("Battery", clock(), Axis::new("voltage", "V")).with(Series::line(
        "",
        Style::Reference,
        pairs(time, &|k| samples.battery_v[k]),
    ));
    let against = |title: &str, x: Axis, values: &[f64]| {
        Figure::new(title, x, Axis::new("measured minus predicted", "rad/s")).with(Series::points(
            "",
            Style::Measured,
            pairs(values, &residual),
        ))
    };
    let lead = format!(
        "Map and lag of “{}”, found on a test stand; the data support a map of {}.",
        vehicle.name, result.supported
    );
    Page::new("Motor test stand", lead)
        .section(
            Section::new("What was found")
                .preformatted(described(result, vehicle, None))
                .figure(Panels::new([speed, command, volts]), "On one clock. Missed pulses are left out."),
        )
        .section(
            Section::new("What is left")
                .figure(
                    against("Against the command", Axis::new("command", unit), &samples.command),
                    "A curve would mean that the map needs more terms.",
                )
                .figure(
                    against("Against the voltage", Axis::new("voltage", "V"), &samples.battery_v),
                    "A slope would mean that the voltage acts differently than the map says.",
                ),
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimated(value: f64, std_error: f64) -> Estimated {
        Estimated { value, std_error }
    }

    fn map(lag_is_known: bool) -> Map {
        Map {
            command: estimated(0.785_012_345, 0.0021),
            voltage: Some(estimated(44.651_234, 0.62)),
            offset: estimated(-1_205.123_456, 9.1),
            lag: estimated(21.512_345, 0.31),
            lag_is_known,
            rms_rad_s: 3.0,
        }
    }

    const STAND_LESS: &str = "# measured on a Monday\nname = \"a craft\" # of mine\nmass = 1.2\narm_length = 0.17\n\
        rotor_radius = 0.1\nair_density = 1.2\ngravity = 9.81\n\n[motors]\nspin = [\"ccw\", \"cw\", \"ccw\", \"cw\"]\n\
        command_unit = \"us\"\ncommand_range = [1000.0, 2000.0]\nmap = \"identify\"\nlag = 18.0 # a guess\n";

    #[test]
    fn the_vehicle_file_is_completed_and_keeps_the_rest() {
        let text = completed(STAND_LESS, &map(true), Path::new("v.toml")).unwrap();
        let expected = STAND_LESS.replace("map = \"identify\"\n", "").replace("lag = 18.0", "lag = 21.512")
            + "command = 0.78501\nvoltage = 44.651\noffset = -1205.12\n";
        assert_eq!(text, expected);
        let vehicle = Vehicle::parse(&text, Path::new("v.toml")).unwrap();
        assert!(vehicle.has_rotor_map() && vehicle.motors.lag == Some(21.512));
        let unknown = completed(STAND_LESS, &map(false), Path::new("v.toml")).unwrap();
        assert!(unknown.contains("lag = 18.0 # a guess"), "{unknown}");
    }

    /// Comments above and behind keys, of those that are removed, too.
    #[test]
    fn every_comment_of_the_vehicle_file_stays() {
        let old = "# by hand\n# for now\nmap = \"identify\" # later a map\n\n# rotor speed = ...\n# my note\ncommand = 0.7 # by Ann\n\
            # sags\nvoltage = 40.0 # Tuesday\n# last\noffset = -1000.0 # rounded\n# and the lag\n";
        let comments = |text: &str| -> Vec<String> {
            text.lines().filter_map(|line| Some(line.split_once('#')?.1.trim().to_owned())).collect()
        };
        for own in [old, "# by hand\nmap = \"identify\" # for now\n", "# cells\nvoltage = 40.0 # Tuesday\n"] {
            let text = STAND_LESS.replace("map = \"identify\"\n", own);
            for map in [map(true), Map { voltage: None, ..map(true) }] {
                let written = completed(&text, &map, Path::new("v.toml")).unwrap();
                let sorted = |mut all: Vec<String>| {
                    all.sort();
                    all
                };
                assert_eq!(sorted(comments(&written)), sorted(comments(&text)), "{written}");
            }
        }
        let written =
            completed(&STAND_LESS.replace("map = \"identify\"\n", old), &map(true), Path::new("v.toml"));
        let written = written.unwrap();
        assert!(
            written.contains("# rotor speed = ...\n# my note\ncommand = 0.78501 # by Ann\n"),
            "{written}"
        );
    }

    #[test]
    fn a_map_without_voltage_takes_the_old_one_out() {
        let text = completed(STAND_LESS, &map(true), Path::new("v.toml")).unwrap();
        let without = completed(&text, &Map { voltage: None, ..map(true) }, Path::new("v.toml")).unwrap();
        assert_eq!(Vehicle::parse(&without, Path::new("v.toml")).unwrap().motors.voltage, None);
    }
}
