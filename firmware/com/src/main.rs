//! `com`: flies a craft, and a few small things around that. `com --help` lists them.
//!
//! Exit status: 0 done, 1 the craft's program ended without being asked to, or nobody answers, 2
//! bad usage or bad input.
#![forbid(unsafe_code)]

use std::io::{BufRead, Read};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, Subcommand};
use com::ask::{Question, who};
use com::config::{Setup, read_gains};
use com::error::{Error, Result, log};
use com::guardian::{End, Terms, watch};
use com::last_end::LastEnd;
use com::pwm::{Idled, Motors};
use com::watchdog::Watchdogs;
use com::{flight, jitter, lockstep};
use proto::{Identity, State};

/// The program of the craft's computer on module.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Fly: the loop, and a guardian that idles the motors when it ends. The craft starts disarmed
    Run {
        /// Configuration file
        config: PathBuf,
    },
    /// Check a configuration file and the files it names, without opening any device
    Check {
        /// Configuration file
        config: PathBuf,
    },
    /// Set all motors to idle, and switch off what does not obey: for what comes after a program
    /// that died
    Idle {
        /// Configuration file
        config: PathBuf,
    },
    /// Print which program and which craft a configuration describes
    Identity {
        /// Configuration file
        config: PathBuf,
    },
    /// Ask a craft who it is and what it is doing
    Who(Asking),
    /// Answer a simulator tick by tick; no motor turns
    Lockstep {
        /// Gains file; without it the configuration is one line of JSON on standard input, and the
        /// program ends when that closes
        #[arg(long)]
        gains: Option<PathBuf>,
        /// Address to listen on; printed once the port is open
        #[arg(long, default_value = "127.0.0.1:0")]
        listen: SocketAddr,
        /// Accept a simulator on another machine
        #[arg(long)]
        open: bool,
    },
    /// Measure how late the loop's ticks come on this machine
    MeasureJitter {
        /// How long to measure, in seconds
        seconds: f64,
        /// How many threads keep the processors busy meanwhile
        #[arg(long, default_value_t = 0)]
        busy: usize,
        /// Real-time priority
        #[arg(long, default_value_t = 80)]
        priority: u8,
    },
}

#[derive(clap::Args)]
struct Asking {
    /// Address and port of the craft's link
    #[arg(required_unless_present = "config")]
    craft: Option<String>,
    /// Ask the craft of this configuration, on this machine
    #[arg(long, conflicts_with_all = ["craft", "key", "number"])]
    config: Option<PathBuf>,
    /// Key file of the link
    #[arg(long)]
    key: Option<PathBuf>,
    /// Number of the link
    #[arg(long, default_value_t = 0)]
    number: u16,
    /// How long to wait for an answer, in seconds
    #[arg(long, default_value_t = 3.0)]
    wait: f64,
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Run { config } => run(&config),
        Command::Check { config } => check(&config),
        Command::Idle { config } => idle(&config),
        Command::Identity { config } => identity(&config),
        Command::Who(asking) => ask(&asking),
        Command::Lockstep { gains, listen, open } => serve(gains.as_deref(), listen, open),
        Command::MeasureJitter { seconds, busy, priority } => measure(seconds, busy, priority),
    };
    outcome.unwrap_or_else(|error| {
        log(&error.to_string());
        ExitCode::from(2)
    })
}

fn run(config: &Path) -> Result<ExitCode> {
    let mut setup = Setup::read(config)?;
    let last_end = LastEnd::new(setup.last_end.clone());
    log(&format!(
        "version {}, vehicle {:?}, sha256 {}",
        env!("CARGO_PKG_VERSION"),
        setup.vehicle,
        hex(&setup.vehicle_sha256)
    ));
    let (sentence, ending) = last_end.begin()?;
    log(&sentence);
    setup.ended = ending;
    if !setup.law.supervision.battery.are_given() {
        log(
            "no battery levels: the craft will not land before its battery is empty; say in the vehicle file how many [battery] cells it has",
        );
    }
    let open = || Motors::open(&setup.pwm_root, &setup.outputs, setup.pulses);
    // Each process has its own hold on the outputs.
    let (mut guarded, flown) = (open()?, open()?);
    let watchdogs = Watchdogs::open(&setup.watchdog)?;
    let terms = Terms { silence: setup.silence, priority: setup.priority, last_end };
    let end = watch(
        terms,
        watchdogs,
        move || guarded.idle() != Idled::OutOfControl,
        |heart| flight::fly(&setup, flown, heart),
    )?;
    Ok(ExitCode::from(match end {
        End::Stopped => 0,
        End::Returned(2) => 2,
        _ => 1,
    }))
}

fn check(config: &Path) -> Result<ExitCode> {
    let setup = Setup::read(config)?;
    println!("{}: valid, for {:?}", config.display(), setup.vehicle);
    Ok(ExitCode::SUCCESS)
}

fn idle(config: &Path) -> Result<ExitCode> {
    let setup = Setup::read(config)?;
    let idled = Motors::open(&setup.pwm_root, &setup.outputs, setup.pulses)?.idle();
    log(match idled {
        Idled::Pulses => "the outputs are idle",
        Idled::SwitchedOff => "an output takes no pulse and is switched off; the others are idle",
        Idled::OutOfControl => "NOT ALL OUTPUTS COULD BE IDLED: disconnect the battery",
    });
    Ok(ExitCode::from(u8::from(idled == Idled::OutOfControl)))
}

fn identity(config: &Path) -> Result<ExitCode> {
    let setup = Setup::read(config)?;
    println!(
        "{}",
        serde_json::json!({
            "program": env!("CARGO_PKG_VERSION"),
            "protocol": [proto::MIN_VERSION, proto::VERSION],
            "vehicle": setup.vehicle,
            "vehicle_sha256": hex(&setup.vehicle_sha256),
            "listen": setup.link.listen.to_string(),
            "link": setup.link.number,
            "has_key": setup.link.key.is_some(),
        })
    );
    Ok(ExitCode::SUCCESS)
}

fn ask(asking: &Asking) -> Result<ExitCode> {
    let wait = asking.wait;
    if !(0.0..=3600.0).contains(&wait) {
        return Err(Error::Other(format!("--wait is {wait}: give a number of seconds from 0 to 3600")));
    }
    let patience = Duration::from_secs_f64(wait);
    let question = match &asking.config {
        Some(config) => Question::of(&Setup::read(config)?.link, patience),
        None => asked(asking, patience)?,
    };
    let craft = question.craft;
    match who(&question)? {
        None => {
            log(&format!("no answer from {craft}"));
            Ok(ExitCode::FAILURE)
        }
        Some(identity) => {
            println!("{}", shown(&identity));
            Ok(ExitCode::SUCCESS)
        }
    }
}

fn asked(asking: &Asking, patience: Duration) -> Result<Question> {
    let Asking { craft, key, number, .. } = asking;
    let craft = craft.as_deref().unwrap_or_default();
    let address = craft.to_socket_addrs().ok().and_then(|mut addresses| addresses.next());
    let address = address.ok_or_else(|| {
        Error::Other(format!("{craft:?} is not a known address; write HOST:PORT, such as 192.168.1.10:14650"))
    })?;
    let key = key.as_deref().map(proto_files::read_key).transpose()?;
    Ok(Question { craft: address, number: *number, key, patience })
}

fn shown(identity: &Identity) -> serde_json::Value {
    let [major, minor, patch] = identity.program;
    serde_json::json!({
        "program": format!("{major}.{minor}.{patch}"),
        "protocol": identity.versions,
        "vehicle_sha256": hex(&identity.vehicle_sha256),
        "state": match identity.state {
            State::Disarmed => "disarmed",
            State::Armed => "armed",
            State::Flying => "flying",
            State::Hold => "hold",
            State::Land => "land",
            State::Cut => "cut",
        },
    })
}

fn serve(gains: Option<&Path>, listen: SocketAddr, open: bool) -> Result<ExitCode> {
    let config = match gains {
        Some(path) => read_gains(path)?,
        None => {
            let mut line = String::new();
            let read = std::io::stdin().lock().read_line(&mut line);
            read.map_err(|error| {
                Error::Other(format!("the configuration cannot be read from standard input: {error}"))
            })?;
            let config = serde_json::from_str(&line);
            config.map_err(|error| Error::Other(format!("the configuration on standard input: {error}")))?
        }
    };
    let mut server = lockstep::Server::open(&config, listen, open)?;
    println!("{}", server.address()?);
    if gains.is_none() {
        std::thread::spawn(|| {
            // Nothing more is read; only the end matters.
            let _ = std::io::stdin().lock().read_to_end(&mut Vec::new());
            std::process::exit(0)
        });
    }
    match server.serve()? {}
}

fn measure(seconds: f64, busy: usize, priority: u8) -> Result<ExitCode> {
    const PERIOD_NS: u64 = 10_000_000;
    if !(0.1..=86_400.0).contains(&seconds) {
        return Err(Error::Other(format!("{seconds} seconds: give a number from 0.1 to 86400 (a day)")));
    }
    println!("{}", jitter::measure(PERIOD_NS, (seconds * 100.0) as usize, priority, busy));
    Ok(ExitCode::SUCCESS)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
