//! `real`: what the product finds in real flights of others, as one table, with published numbers beside its own.
//!
//! Runs the program `quadlab` as a user would (built beside this one) on the folders `nanodrone`, `nanobench` and `crazypad`, and writes
//! `real.md`. Published numbers are those of the data's authors (Busetto et al., Control Engineering Practice 172 (2026)
//! 106871) on a trajectory shape that is not public, so they are an order of size and not the same judge.
#![forbid(unsafe_code)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};
use clap::Parser;
use flights::Flight;
use model::{Effect, Model, Vehicle};
use serde_json::Value;
use sysid::{Prepared, compare, fit};

/// Measure what the product finds in real flights; prints a table and writes real.md.
#[derive(Parser)]
#[command(name = "real", version, after_help = "Example:\n  cargo xtask bench real --data ../shared/data")]
struct Arguments {
    /// Folder with nanodrone, nanobench and crazypad
    #[arg(long, value_name = "FOLDER", default_value = "../shared/data")]
    data: PathBuf,

    /// Folder for real.md and the models
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(table) => {
            print!("{table}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<String> {
    std::fs::create_dir_all(&arguments.out)
        .with_context(|| format!("{}: cannot make the folder", arguments.out.display()))?;
    let bench = Bench { quadlab: quadlab()?, data: arguments.data.clone(), out: arguments.out.clone() };
    let mut table = String::from("# What quadlab finds in real flights\n");
    bench.nanodrone(&mut table)?;
    bench.nanobench(&mut table)?;
    bench.crazypad(&mut table)?;
    let path = arguments.out.join("real.md");
    let draft = path.with_extension("md.tmp");
    std::fs::write(&draft, &table)
        .and_then(|()| std::fs::rename(&draft, &path))
        .with_context(|| format!("{}: cannot be written", path.display()))?;
    Ok(table)
}

/// Builds the user's program; cargo puts it beside this one.
fn quadlab() -> Result<PathBuf> {
    let here = std::env::current_exe().context("this program does not know where it is")?;
    let folder = here.parent().context("this program is in no folder")?;
    let path = folder.join(format!("quadlab{}", std::env::consts::EXE_SUFFIX));
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--quiet", "-p", "quadlab", "--manifest-path"]);
    cargo.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml"));
    if !cfg!(debug_assertions) {
        cargo.arg("--release");
    }
    if !cargo.status().context("cannot start cargo to build quadlab")?.success() {
        bail!("quadlab does not build");
    }
    Ok(path)
}

struct Bench {
    quadlab: PathBuf,
    data: PathBuf,
    out: PathBuf,
}

impl Bench {
    /// The document of a command with `--json`.
    fn json(&self, arguments: &[&str], lists: &[(&str, &[PathBuf])]) -> Result<Value> {
        let mut command = Command::new(&self.quadlab);
        command.args(arguments).arg("--json");
        for (option, paths) in lists {
            command.arg(option).args(*paths);
        }
        let output = command.output().context("cannot start quadlab")?;
        // 1: the flights do not determine the model, and the document says so.
        if !matches!(output.status.code(), Some(0 | 1)) {
            bail!("quadlab {arguments:?}: {}", String::from_utf8_lossy(&output.stderr).trim());
        }
        serde_json::from_slice(&output.stdout)
            .with_context(|| format!("quadlab {arguments:?} prints no JSON"))
    }

    /// The flights of a folder whose names are picked, in order.
    fn flights(&self, folder: &str, pick: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>> {
        let folder = self.data.join(folder);
        let entries = std::fs::read_dir(&folder)
            .with_context(|| format!("{}: cannot be read; give --data FOLDER", folder.display()))?;
        let mut all: Vec<PathBuf> = Vec::new();
        for entry in entries {
            let path = entry?.path();
            let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            if name.ends_with(".csv") && pick(&name) {
                all.push(path);
            }
        }
        all.sort();
        if all.is_empty() {
            bail!("{}: has none of the flights that are looked for", folder.display());
        }
        Ok(all)
    }

    fn model(&self, name: &str) -> String {
        self.out.join(name).display().to_string()
    }

    fn vehicle(&self, folder: &str) -> String {
        self.data.join(folder).join("vehicle.toml").display().to_string()
    }

    fn nanodrone(&self, table: &mut String) -> Result<()> {
        table.push_str(
            "\n## nanodrone: a Crazyflie 2.1 Brushless with measured rotor speeds\n\nMean norm of the open-loop error, summed over \
             horizons of 1 to 50 samples, from every sample on, with nothing known but the start's logged state and the rotor speeds.\n\n\
             | model and what judges it | position m | velocity m/s | attitude rad | rate rad/s | motors' signs | drag 1/s |\n\
             |---|---|---|---|---|---|---|\n\
             | published physics, unseen shape | 2.32 | 10.62 | 5.10 | 29.1 | | |\n\
             | published physics and neural residual, unseen shape | 2.36 | 10.40 | 6.15 | 29.0 | | |\n\
             | published LSTM, unseen shape | 5.97 | 16.7 | 5.65 | 35.8 | | |\n",
        );
        let shape = |name: &str| name.split('_').next().unwrap_or_default().to_owned();
        let fourth = |name: &str| name.contains("_run4");
        for (what, apart) in [
            ("runs 4 of the shapes that were fitted", ""),
            ("random2, held out whole", "random2"),
            ("square, held out whole", "square"),
        ] {
            let train = self.flights("nanodrone", |n| !fourth(n) && shape(n) != apart)?;
            let validate = self.flights("nanodrone", |n| fourth(n) && shape(n) != apart)?;
            let judge = match apart {
                "" => validate.clone(),
                _ => self.flights("nanodrone", |n| shape(n) == apart)?,
            };
            let path = self.model(&format!("nanodrone{apart}.toml"));
            let vehicle = self.vehicle("nanodrone");
            let explain = ["explain", "--vehicle", &vehicle, "--out", &path, "--refine"];
            self.json(&explain, &[("--train", &train), ("--validate", &validate)])?;
            let compared = self.json(&["compare", "--model", &path], &[("--flights", &judge)])?;
            let sum = |of: &str| compared["horizons"]["sum_1_50"][of].as_f64().unwrap_or(f64::NAN);
            let model = Model::read(Path::new(&path))?;
            let signs = if sysid::impossible_signs(&model).is_empty() { "right" } else { "wrong" };
            let drag = model.term(Effect::LinearDrag).context("the model has no drag")?;
            let per_s = |k: usize| -drag.coefficients[k].value / model.vehicle.mass;
            writeln!(
                table,
                "| quadlab explain --refine, {what} | {:.2} | {:.2} | {:.2} | {:.1} | {signs} | {:.2}, {:.2} |",
                sum("position_m"),
                sum("velocity_m_s"),
                sum("attitude_rad"),
                sum("rate_rad_s"),
                per_s(0),
                per_s(1)
            )?;
        }
        Ok(())
    }

    fn nanobench(&self, table: &mut String) -> Result<()> {
        let paths = self.flights("nanobench", |_| true)?;
        let vehicle = Vehicle::read(Path::new(&self.vehicle("nanobench")))?;
        let mut flights: Vec<Prepared> = Vec::new();
        for path in &paths {
            flights.push(Prepared::new(&Flight::read(path)?, &vehicle)?);
        }
        let basic: Vec<Effect> = Effect::basic().collect();
        let forces = sysid::without_rotation(&basic);
        let with_voltage: Vec<Effect> = forces.iter().copied().chain([Effect::BatteryVoltage]).collect();
        // Each flight with coefficients of all others.
        let error = |effects: &[Effect]| -> Result<[f64; 2]> {
            let (mut squares, mut rows, mut lateral) = (0.0, 0.0, 0.0);
            for (k, flight) in flights.iter().enumerate() {
                let others: Vec<&Prepared> =
                    flights.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, f)| f).collect();
                let total = compare(&fit(&others, &vehicle, effects, None)?.model, &[flight]).total;
                squares += total.w.sse;
                rows += flight.rows() as f64;
                lateral += 0.5 * (total.u.r2 + total.v.r2) / flights.len() as f64;
            }
            Ok([(squares / rows).sqrt(), lateral])
        };
        let ([without, _], [with, lateral]) = (error(&forces)?, error(&with_voltage)?);
        let all: Vec<&Prepared> = flights.iter().collect();
        let doubts = sysid::rotation_doubts(&fit(&all, &vehicle, &basic, None)?.model, &all);
        write!(
            table,
            "\n## nanobench: a Crazyflie 2.1 with brushed motors, commands and battery voltage\n\n\
             | each flight with coefficients of the others | |\n|---|---|\n\
             | thrust error without a voltage term, m/s^2 | {without:.3} |\n\
             | thrust error with `battery-voltage`, m/s^2 | {with:.3} |\n\
             | lateral drag, R^2 | {lateral:.2} |\n\
             | rotation | {} |\n",
            if doubts.is_empty() { "fitted".into() } else { format!("refused: {}", doubts.join("; ")) }
        )?;
        Ok(())
    }

    fn crazypad(&self, table: &mut String) -> Result<()> {
        table.push_str(
            "\n## crazypad: a Crazyflie 2.1 with known changes, against its normal flights\n\n\
             | what changed | verdict | first finding | as likely |\n|---|---|---|---|\n",
        );
        let normal = self.flights("crazypad", |n| n.contains("normal_flight__E9"))?;
        let vehicle = self.vehicle("crazypad");
        for (what, part) in [
            ("nothing (one log against the others)", "normal_flight__E9_log03"),
            ("weight W3 near motor 4", "add_weight_W3_near_M3__E9"),
            ("propellers of motors 2 and 3 cut by 1.5 mm", "cut_M2_1.5mm"),
            ("propellers of motors 2 and 3 cut by 3.5 mm", "cut_M2_3.5mm"),
        ] {
            let apart = self.flights("crazypad", |n| n.contains(part))?;
            let base: Vec<PathBuf> = normal.iter().filter(|p| !apart.contains(p)).cloned().collect();
            let (train, validate) = base.split_at(base.len() - 2);
            let path = self.model("crazypad.toml");
            let identify = ["identify", "--vehicle", &vehicle, "--out", &path];
            self.json(&identify, &[("--train", train), ("--validate", validate)])?;
            let found = self.json(&["diagnose", "--model", &path], &[("--changed", &apart)])?;
            let best =
                found["effects"].as_array().and_then(|all| all.iter().find(|e| e["supported"] == true));
            let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
            let first = best.map_or("-".into(), |best| {
                let motor = best["motor"].as_u64().map_or(String::new(), |m| format!(" of motor {m}"));
                let size = &best["coefficients"][0];
                let value = size["value"].as_f64().unwrap_or(f64::NAN);
                format!("{}{motor}, {value:.3} {}", text(&best["effect"]), text(&size["unit"]))
            });
            let with: Vec<String> = best
                .and_then(|best| best["confounded_with"].as_array())
                .map_or_else(Vec::new, |all| all.iter().map(text).collect());
            writeln!(table, "| {what} | {} | {first} | {} |", text(&found["verdict"]), with.join(", "))?;
        }
        Ok(())
    }
}
