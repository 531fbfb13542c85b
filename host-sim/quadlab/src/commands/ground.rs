//! `quadlab ground`: the ground station, with a simulated laboratory for those who have none at
//! hand.

use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use ::ground::link::{CraftLink, LinkSettings, PORT};
use ::ground::mission::{MissionStep, read_script};
use ::ground::mocap::Replay;
use ::ground::mocap::frames::{Axes, Frames};
use ::ground::mocap::optitrack::{COMMAND_PORT, OptiTrack};
use ::ground::mocap::{MocapReceiver, Vicon, vicon_stream};
use ::ground::recording::{Completeness, Finished, Recorder, finish, part_of};
use ::ground::run::{RunResult, RunUntil, View, catch_interrupts, connect, run as fly};
use ::ground::station::{Settings, Station};
use ::ground::view::{Live, Plain};
use anyhow::Context;
use model::Model;
use pattern::Pattern;
use serde::Serialize;
use sil::FlightPlan;

use crate::cli::next_flight::predictor;
use crate::cli::output::Outcome;
use crate::commands::simulated_laboratory::Simulated;

/// Fly a craft: send poses and commands, show and record its telemetry.
///
/// Keys in the live view: a arm, t take off, p pattern, l land, D disarm, space CUT, q quit
/// (landing first). Ctrl-C lands a flying craft and then exits; a second Ctrl-C exits at once. Exit
/// status 1 if a request was not carried out, or the craft's clock or the recording failed.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    quadlab ground --simulated\n  \
    quadlab ground --craft 192.168.7.2:14650 --key craft.key --vicon 192.168.7.3 --record flights/monday\n  \
    quadlab ground --craft 192.168.7.2:14650 --key craft.key --natnet 192.168.7.9 --script tour.toml --plain\n  \
    quadlab ground --simulated --pattern excite.csv --arm --land-after --record out/a\n  \
    quadlab ground --simulated --model model.toml --gains gains.toml\n  \
    quadlab ground --recover flights/monday")]
pub(crate) struct Options {
    /// The craft's program, for example: --craft 192.168.7.2:14650
    #[arg(long, value_name = "HOST:PORT", required_unless_present_any = ["simulated", "recover"])]
    craft: Option<String>,

    /// Fly the simulated laboratory instead: plant, craft's program and tracker on this machine
    #[arg(long, conflicts_with_all = ["craft", "key", "vicon", "natnet", "replay", "no_tracker", "recover"])]
    simulated: bool,

    /// Model of the simulated craft, from quadlab identify [default: the thesis' craft]
    #[arg(long, value_name = "TOML", requires = "simulated")]
    model: Option<PathBuf>,

    /// Gains that the simulated craft flies with [default: gains that suit the model, for
    /// identification flights]
    #[arg(long, value_name = "TOML", requires = "simulated")]
    gains: Option<PathBuf>,

    /// Rate error of the simulated craft's clock, as a fraction, for example 1 % fast: --clock-skew 0.01
    #[arg(
        long,
        value_name = "FRACTION",
        default_value_t = 0.0,
        requires = "simulated",
        allow_negative_numbers = true
    )]
    clock_skew: f64,

    /// Seed of the simulated sensors' noise
    #[arg(long, value_name = "N", default_value_t = 1, requires = "simulated")]
    seed: u64,

    /// Key file, the craft's own
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,

    /// Number of the link, where several craft share a key
    #[arg(long, value_name = "N", default_value_t = 0)]
    link: u16,

    /// Talk to a craft on another machine without a key: anyone who can reach its port can fly it
    #[arg(long)]
    allow_open: bool,

    /// This machine's address on the network of Vicon Tracker, to receive its UDP object stream, for example: --vicon 192.168.7.3
    #[arg(long, value_name = "ADDRESS[:PORT]", conflicts_with_all = ["natnet", "replay", "no_tracker"])]
    vicon: Option<String>,

    /// Address of the machine that runs Vicon Tracker: no other is heard [default: the first one that is heard]
    #[arg(long, value_name = "ADDRESS", requires = "vicon")]
    tracker: Option<IpAddr>,

    /// OptiTrack Motive's address instead (NatNet 3 and 4), for example: --natnet 192.168.7.9
    #[arg(long, value_name = "ADDRESS[:PORT]", conflicts_with_all = ["replay", "no_tracker"])]
    natnet: Option<String>,

    /// This machine's address on the tracker's network, for NatNet's multicast
    #[arg(long, value_name = "ADDRESS", default_value = "0.0.0.0")]
    interface: Ipv4Addr,

    /// Send the poses of a flight file, or of the longest flight in a log, instead of a tracker's
    #[arg(long, value_name = "FLIGHT", conflicts_with = "no_tracker")]
    replay: Option<PathBuf>,

    /// Speed of the replay: 2 is twice as fast as it was flown
    #[arg(long, value_name = "TIMES", default_value_t = 1.0, requires = "replay")]
    speed: f64,

    /// Send no poses
    #[arg(long)]
    no_tracker: bool,

    /// The craft's name in the tracker; not needed if it is the only object
    #[arg(long, value_name = "NAME")]
    object: Option<String>,

    /// North, east, down as axes of the tracker's room [default: x,-y,-z; with --natnet x,z,-y]
    #[arg(long, value_name = "AXES", allow_hyphen_values = true)]
    room: Option<Axes>,

    /// Front, right, down as axes of the tracked object [default: those of the room]
    #[arg(long, value_name = "AXES", allow_hyphen_values = true)]
    body: Option<Axes>,

    /// Position of the origin in the tracker's room: north, east, down, m, for example: --origin 0.5,0,0
    #[arg(long, value_name = "N,E,D", value_parser = three, default_value = "0,0,0", allow_hyphen_values = true)]
    origin: Three,

    /// Small rotation of the body relative to the tracked object: roll, pitch, yaw, degrees
    #[arg(long, value_name = "R,P,Y", value_parser = three, default_value = "0,0,0", allow_hyphen_values = true)]
    turn_deg: Three,

    /// Commands per second, at least 4
    #[arg(long, value_name = "HZ", default_value_t = 50.0)]
    command_hz: f64,

    /// Script with the steps to fly, TOML; the program ends when they are done
    #[arg(long, value_name = "TOML", conflicts_with_all = ["pattern", "arm", "land_after"])]
    script: Option<PathBuf>,

    /// Pattern file to fly, CSV (quadlab excite writes them)
    #[arg(long, value_name = "CSV")]
    pattern: Option<PathBuf>,

    /// How many times the pattern is flown
    #[arg(long, value_name = "N", default_value_t = 1, requires = "pattern", value_parser = clap::value_parser!(u32).range(1..=1000))]
    times: u32,

    /// Add the excitation of thesis 4.2.1 with this seed
    #[arg(long, value_name = "SEED", requires = "pattern")]
    excite: Option<u64>,

    /// Arm, take off and fly the pattern automatically; the program ends when it is done
    #[arg(long)]
    arm: bool,

    /// Land when the pattern is done
    #[arg(long, requires = "arm")]
    land_after: bool,

    /// Height of a take-off, m
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    take_off: f64,

    /// Land at once when the craft's clock is found to be wrong
    #[arg(long)]
    land_on_clock_fault: bool,

    /// Name of the recording's files, without extension [default: the first free out/ground/flight-N]
    #[arg(long, value_name = "NAME")]
    record: Option<PathBuf>,

    /// Record nothing
    #[arg(long, conflicts_with = "record")]
    no_record: bool,

    /// Plain lines on standard error instead of the live view; the default without a terminal
    #[arg(long)]
    plain: bool,

    /// Finish a recording that a crash left incomplete, and exit
    #[arg(long, value_name = "NAME", conflicts_with_all = ["craft", "record"])]
    recover: Option<PathBuf>,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    json: bool,
}

/// Three numbers with commas between them.
type Three = [f64; 3];

fn three(text: &str) -> Result<Three, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    let finite = |numbers: &Vec<f64>| numbers.iter().all(|v| v.is_finite());
    numbers
        .filter(finite)
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("{text:?} is not three numbers such as 0.5,0,0"))
}

/// What the command cannot do.
#[derive(Debug, thiserror::Error)]
enum GroundError {
    #[error("{option} {text}: {why}; give an address such as 192.168.7.2:{port}")]
    Address { option: &'static str, text: String, why: String, port: u16 },
    #[error(
        "no tracker is named: give this machine's address on its network, such as --vicon 192.168.7.3, or OptiTrack's with --natnet, \
         or --no-tracker"
    )]
    NoTracker,
    #[error("{}: cannot search for a free name: {source}; give one with --record", folder.display())]
    Names { folder: PathBuf, source: std::io::Error },
}

#[derive(Serialize)]
struct Document<'a> {
    well: bool,
    why: &'a Option<String>,
    mcap: Option<&'a Path>,
    flights: &'a [PathBuf],
    messages: u64,
    /// How much of the recording is left; none where nothing was recorded.
    completeness: Option<&'a Completeness>,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    if let Some(name) = &options.recover {
        let well = RunResult { well: true, why: None };
        return outcome(options, &well, Some(&finish(name)?));
    }
    let (steps, pattern) = steps(options)?;
    let until =
        if options.script.is_some() || options.arm { RunUntil::MissionOver } else { RunUntil::Interrupted };
    let plan = options.simulated.then(|| plan(options)).transpose()?;
    let lab = plan.map(|plan| Simulated::start(&plan, options.clock_skew)).transpose()?;
    let craft = match (&lab, &options.craft) {
        (Some(lab), _) => lab.craft,
        (None, Some(craft)) => address("--craft", craft, PORT)?,
        (None, None) => unreachable!("clap asks for one of them"),
    };
    let link =
        LinkSettings { number: options.link, key: options.key.clone(), allow_open: options.allow_open };
    let link = CraftLink::open(&link, craft.ip())?;
    let tracker = tracker(options, lab.as_ref())?;
    let name = (!options.no_record).then(|| name(options)).transpose()?;
    let start = Instant::now();
    let recorder = name.as_deref().map(|name| begin(name, craft, tracker.as_deref())).transpose()?;
    let settings = Settings {
        command_hz: options.command_hz,
        steps,
        pattern,
        take_off_m: options.take_off,
        excitation_gain: 1.0,
        land_on_clock_fault: options.land_on_clock_fault,
    };
    let mut station = Station::new(settings, link, recorder)?;
    // Two users of one signal would be a mistake of this program; without it Ctrl-C ends at once,
    // as ever.
    let _ = catch_interrupts();
    let ended = with_view(options, |view, inputs| {
        fly(&mut station, connect(craft)?, tracker, inputs, view, until, start)
    })?;
    let ended = match station.end_recording() {
        Err(error) if ended.well => RunResult { well: false, why: Some(error.to_string()) },
        _ => ended,
    };
    let finished = name.as_deref().map(finish_later).transpose()?;
    outcome(options, &ended, finished.as_ref())
}

/// Finishes a recording; where that cannot be done now, says how it is done later.
fn finish_later(name: &Path) -> anyhow::Result<Finished> {
    let later = || {
        format!("the recording is kept; free some space, then: quadlab ground --recover {}", name.display())
    };
    finish(name).with_context(later)
}

/// The simulated craft, with noisy sensors and a battery that falls, and what it flies with: gains
/// that are given fly as they are.
fn plan(options: &Options) -> anyhow::Result<FlightPlan> {
    let model = match &options.model {
        Some(path) => Model::read_to_simulate(path)?,
        None => Model::thesis(),
    };
    let config = match (&options.gains, &options.model) {
        (Some(gains), _) => Some(design::gains_match::read_for(gains, &model)?.config),
        (None, Some(path)) => Some(*predictor(&model, path, None, options.seed)?.config()),
        (None, None) => None,
    };
    let plan = FlightPlan::identification(model, options.seed, 1.0);
    Ok(FlightPlan { config: config.unwrap_or(plan.config), ..plan })
}

/// Flies with lines or with the live view, whichever fits.
fn with_view(
    options: &Options,
    fly: impl FnOnce(
        &mut dyn View,
        Option<std::sync::mpsc::Receiver<::ground::run::Input>>,
    ) -> std::io::Result<RunResult>,
) -> std::io::Result<RunResult> {
    if options.plain || !std::io::stdout().is_terminal() {
        return fly(&mut Plain::new(std::io::stderr()), None);
    }
    let (keys, inputs) = std::sync::mpsc::channel();
    let mut live = Live::start(keys)?;
    fly(&mut live, Some(inputs))
}

fn steps(options: &Options) -> anyhow::Result<(Vec<MissionStep>, Vec<MissionStep>)> {
    if let Some(script) = &options.script {
        return Ok((read_script(script)?, Vec::new()));
    }
    let pattern = match &options.pattern {
        Some(path) => {
            let pattern = Box::new(Pattern::read(path)?);
            vec![MissionStep::Fly { pattern, times: options.times, excite: options.excite }]
        }
        None => Vec::new(),
    };
    if !options.arm {
        return Ok((Vec::new(), pattern));
    }
    let mut steps = vec![MissionStep::Arm {}, MissionStep::TakeOff { height_m: options.take_off }];
    steps.extend(pattern);
    if options.land_after {
        steps.push(MissionStep::Land {});
    }
    Ok((steps, Vec::new()))
}

/// The first address of a name; the port may be left out.
fn address(option: &'static str, text: &str, port: u16) -> Result<SocketAddr, GroundError> {
    let refuse = |why: String| GroundError::Address { option, text: text.into(), why, port };
    let found = match text.to_socket_addrs() {
        Ok(found) => Ok(found),
        Err(_) => (text, port).to_socket_addrs(),
    };
    let mut found = found.map_err(|error| refuse(error.to_string()))?;
    found.next().ok_or_else(|| refuse("the name has no address".into()))
}

fn tracker(options: &Options, lab: Option<&Simulated>) -> anyhow::Result<Option<Box<dyn MocapReceiver>>> {
    let usual = if options.natnet.is_some() { Axes::Y_UP } else { Axes::Z_UP };
    let room = options.room.unwrap_or(usual);
    let frames = Frames {
        room,
        object: options.body.unwrap_or(room),
        origin_m: options.origin,
        turn_rad: options.turn_deg.map(f64::to_radians),
    };
    if let Some(lab) = lab {
        return Ok(Some(Box::new(lab.tracker()?)));
    }
    if options.no_tracker {
        return Ok(None);
    }
    if let Some(path) = &options.replay {
        return Ok(Some(Box::new(Replay::open(path, options.speed)?)));
    }
    let object = options.object.as_deref();
    if let Some(server) = &options.natnet {
        let server = match address("--natnet", server, COMMAND_PORT)? {
            SocketAddr::V4(server) => server,
            SocketAddr::V6(server) => SocketAddrV4::new(
                server.ip().to_ipv4().ok_or_else(|| GroundError::Address {
                    option: "--natnet",
                    text: server.to_string(),
                    why: "NatNet is IPv4".into(),
                    port: COMMAND_PORT,
                })?,
                server.port(),
            ),
        };
        return Ok(Some(Box::new(OptiTrack::connect(server, options.interface, object, frames)?)));
    }
    let here = options.vicon.as_deref().ok_or(GroundError::NoTracker)?;
    let here = address("--vicon", here, vicon_stream::PORT)?;
    Ok(Some(Box::new(Vicon::listen(here, options.tracker, options.object.clone(), frames)?)))
}

/// Where to record: the name given, or the first that is free.
fn name(options: &Options) -> Result<PathBuf, GroundError> {
    if let Some(name) = &options.record {
        return Ok(name.clone());
    }
    let folder = PathBuf::from("out/ground");
    let free = |name: &PathBuf| -> Result<bool, GroundError> {
        let taken = |path: &Path| {
            path.try_exists().map_err(|source| GroundError::Names { folder: folder.clone(), source })
        };
        Ok(!taken(&part_of(name))? && !taken(&name.with_extension("mcap"))?)
    };
    let mut number = 1;
    loop {
        let name = folder.join(format!("flight-{number}"));
        if free(&name)? {
            return Ok(name);
        }
        number += 1;
    }
}

fn begin(name: &Path, craft: SocketAddr, tracker: Option<&dyn MocapReceiver>) -> anyhow::Result<Recorder> {
    // Before 1970 and after 2554 the log begins at zero.
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let epoch_ns = u64::try_from(since_1970.as_nanos()).unwrap_or_default();
    let about = BTreeMap::from([
        ("craft".to_owned(), craft.to_string()),
        ("tracker".to_owned(), tracker.map_or("none".into(), MocapReceiver::describe)),
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
    ]);
    Ok(Recorder::begin(name, epoch_ns, &about)?)
}

fn outcome(options: &Options, ended: &RunResult, finished: Option<&Finished>) -> anyhow::Result<Outcome> {
    let document = Document {
        well: ended.well,
        why: &ended.why,
        mcap: finished.map(|finished| finished.mcap.as_path()),
        flights: finished.map_or(&[], |finished| &finished.flights),
        messages: finished.map_or(0, |finished| finished.completeness.messages),
        completeness: finished.map(|finished| &finished.completeness),
    };
    if options.json {
        return Ok(Outcome { holds: ended.well, ..Outcome::json(&document)? });
    }
    let mut text = String::new();
    if let Some(why) = &ended.why {
        text.push_str(&format!("not well: {why}\n"));
    }
    if let Some(finished) = finished {
        let messages = finished.completeness.messages;
        text.push_str(&format!("log: {} ({messages} messages)\n", finished.mcap.display()));
        if let Some(missing) = finished.completeness.missing() {
            text.push_str(&format!("not complete: {missing}\n"));
        }
        for flight in &finished.flights {
            text.push_str(&format!("flight: {}\n", flight.display()));
        }
    }
    Ok(Outcome { holds: ended.well, ..Outcome::done(text) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_may_be_left_out() {
        assert_eq!(address("--natnet", "127.0.0.1", 1510).unwrap(), "127.0.0.1:1510".parse().unwrap());
        assert_eq!(address("--natnet", "127.0.0.1:99", 1510).unwrap(), "127.0.0.1:99".parse().unwrap());
        let message = address("--craft", "127.0.0.1:x", PORT).unwrap_err().to_string();
        assert!(message.contains("--craft 127.0.0.1:x") && message.contains("14650"), "{message}");
    }

    #[test]
    fn three_numbers_are_three() {
        assert_eq!(three("1, -2,0.5"), Ok([1.0, -2.0, 0.5]));
        for text in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,nan"] {
            assert!(three(text).is_err(), "{text}");
        }
    }
}
