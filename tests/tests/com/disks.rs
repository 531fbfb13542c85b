//! Drill: the disks of both programs are slow all the time and full for a while, and the craft flies on as if nothing were.
//!
//! The disks are real file systems of a few megabytes, which no other program sees; a library loaded before the system's makes each
//! fsync and each write take 600 ms. The minute of the drill is a few seconds in the usual tests, `QUADLAB_FULL_DISK_S` in the night;
//! with `QUADLAB_ALONE` set, as then, the craft has the thesis' supervision as well, that forgives no machine for standing still.

use std::fs::{self, File};
use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use model::Model;
use proto::State;
use serde_json::Value;
use sil::{FlightPlan, for_identification};
use stories::program;

use crate::PERIOD_S;
use crate::common::{PATIENCE, Program, compile, is_alone, patient_law};
use crate::hall::{Hall, free_udp_address, keyed_bench, write_key};

/// What each fsync and each write takes, ms.
const SLOW_MS: u32 = 600;
/// Time between two packets of the ground that a busy machine is forgiven; one fsync would be longer.
const LONGEST_GAP: Duration = Duration::from_millis(SLOW_MS as u64 / 2);

/// A slow file system of some megabytes.
struct SmallDisk {
    folder: tempfile::TempDir,
    unshare: &'static str,
}

impl SmallDisk {
    /// Nothing where the system lets nobody mount one. With root's rights that needs no namespace of users, and the craft's program
    /// keeps its real-time priority.
    fn new() -> Option<Self> {
        let can = |unshare: &&str| {
            let mount =
                Command::new("unshare").args([unshare, "mount", "-t", "tmpfs", "none", "/mnt"]).output();
            mount.is_ok_and(|output| output.status.success())
        };
        let Some(unshare) = ["-m", "-rm"].into_iter().find(can) else {
            println!("SKIPPED: no file systems of one's own here (unshare -rm mount -t tmpfs none /mnt)");
            return None;
        };
        let disk = Self { folder: tempfile::tempdir().unwrap(), unshare };
        fs::create_dir(disk.path()).unwrap();
        compile(env!("CARGO_MANIFEST_DIR"), "tests/com/slow_disk.c", &disk.beside("slow_disk.so"));
        Some(disk)
    }

    fn path(&self) -> PathBuf {
        self.beside("disk")
    }

    /// A file that is not on it.
    fn beside(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs a program in the folder of this disk, which it alone sees: `run` is what the shell does.
    fn command(&self, run: &str, program: &Path) -> Command {
        let script = format!("mount -t tmpfs -o size=64m none \"$SLOW_DISK\" && cd \"$SLOW_DISK\" && {run}");
        let mut command = Command::new("unshare");
        command.args([self.unshare, "sh", "-c", &script]).arg(program);
        command.env("SLOW_DISK", self.path()).env("SLOW_DISK_MS", SLOW_MS.to_string());
        command.env("SLOW_DISK_UNTIL", self.beside("fast")).env("SLOW_LIBRARY", self.beside("slow_disk.so"));
        command
    }

    /// Takes all that is left of the disk of this process, to the last byte.
    fn fill(&self, process: u32) -> Filler {
        let path = PathBuf::from(format!("/proc/{process}/root{}/filler", self.path().display()));
        let mut file = File::create(&path).unwrap();
        for block in [&[0; 65_536][..], &[0]] {
            while file.write_all(block).is_ok() {}
        }
        assert!(fs::metadata(&path).unwrap().len() > 1 << 20, "nothing was free");
        Filler(path)
    }
}

/// What fills a disk until it goes.
struct Filler(PathBuf);

impl Drop for Filler {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

/// How long the disks are full.
fn full_time() -> Duration {
    Duration::from_secs(std::env::var("QUADLAB_FULL_DISK_S").map_or(4, |s| s.parse().expect("seconds")))
}

/// The law that flies; where nothing else runs, under the thesis' supervision.
fn law() -> control::Config {
    let mut law = for_identification(control::Config::thesis());
    let supervision = law.supervision;
    law.supervision = patient_law().supervision;
    if is_alone() {
        law.supervision = supervision;
    }
    law.supervision.fence = supervision.fence;
    law.supervision.landing.descent_m_s = 0.6;
    law
}

/// `quadlab ground` with everything that it writes on this disk: it takes off, stays in the air for so long, and lands.
fn start_ground(disk: &SmallDisk, hall: &Hall, vicon: SocketAddr, hold: Duration) -> Child {
    write_key(&disk.beside("craft.key"));
    let hold = format!("'hold'\nfor_s = {}", hold.as_secs_f64());
    let steps = ["'arm'", "'take-off'\nheight_m = 0.6", &hold, "'land'"];
    fs::write(disk.beside("hold.toml"), steps.map(|step| format!("[[step]]\ndo = {step}\n")).concat())
        .unwrap();
    // The disk goes with its last process, so what is on it is copied.
    let run =
        "LD_PRELOAD=\"$SLOW_LIBRARY\" \"$0\" \"$@\" 2>told.txt; ended=$?; cp told.txt a.mcap ..; exit $ended";
    let mut command = disk.command(run, &program("quadlab"));
    command.args(["ground", "--link", "5", "--object", "quad", "--record", "a", "--command-hz", "100"]);
    command.arg("--key").arg(disk.beside("craft.key")).arg("--script").arg(disk.beside("hold.toml"));
    command.args([
        "--craft",
        &hall.air.address().to_string(),
        "--vicon",
        &vicon.to_string(),
        "--plain",
        "--json",
    ]);
    command.stdout(Stdio::piped()).spawn().unwrap()
}

/// Lines of a recording's log.
fn log_lines(recording: &Path) -> Vec<String> {
    let bytes = fs::read(recording).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(|message| message.unwrap());
    let lines = messages.filter(|message| message.channel.topic == "/log").map(|message| {
        let line: Value = serde_json::from_slice(&message.data).unwrap();
        line["message"].as_str().unwrap().to_owned()
    });
    lines.collect()
}

#[test]
fn full_and_slow_disks_are_not_noticed_in_the_air() {
    let (Some(of_ground), Some(of_craft)) = (SmallDisk::new(), SmallDisk::new()) else { return };
    let full = full_time();
    let plan = FlightPlan { config: law(), ..FlightPlan::identification(Model::thesis(), 12, 1.0) };
    let bench = keyed_bench(&plan.config);
    let config = fs::read_to_string(bench.path("com.toml")).unwrap();
    let last_end = format!("[guardian]\nlast_end = '{}'\n", of_craft.path().join("last-end.toml").display());
    fs::write(bench.path("com.toml"), config.replace("[guardian]\n", &last_end)).unwrap();
    let mut craft = Program::start(&program("com"), &bench, |command| {
        let run = "LD_PRELOAD=\"$SLOW_LIBRARY\" exec \"$0\" \"$@\"";
        let mut on_disk = of_craft.command(run, Path::new(command.get_program()));
        on_disk.args(command.get_args()).stderr(Stdio::piped()).stdin(Stdio::null());
        *command = on_disk;
    });
    let vicon = free_udp_address();
    let mut hall = Hall::open(bench, craft.address(), &plan, vicon);
    let mut ground = start_ground(&of_ground, &hall, vicon, full + Duration::from_secs(4));
    let begun = Instant::now();
    while hall.state() != Some(State::Flying) || hall.reached_m[0] < 0.5 {
        assert!(begun.elapsed() < PATIENCE && ground.try_wait().unwrap().is_none(), "{:?}", hall.heard);
        hall.turn();
    }

    let (ground_pid, craft_pid) = (ground.id(), craft.child.id());
    let fillers = std::thread::scope(|scope| {
        // The laboratory goes on meanwhile.
        let filling = scope.spawn(|| [of_ground.fill(ground_pid), of_craft.fill(craft_pid)]);
        while !filling.is_finished() {
            hall.turn();
        }
        filling.join().unwrap()
    });
    let before = hall.heard.unwrap();
    let (filled, _) = (Instant::now(), hall.air.longest_gap());
    while filled.elapsed() < full {
        hall.turn();
        assert_eq!(hall.state(), Some(State::Flying), "{:?}", hall.heard);
    }
    let (gap, after) = (hall.air.longest_gap(), hall.heard.unwrap());
    // To free what they hold takes longer than the laboratory may stand still.
    std::thread::spawn(move || drop(fillers));
    let overruns = after.counters.overruns - before.counters.overruns;
    println!(
        "full for {:?}: {} ticks, {overruns} late, at most {gap:?} without a packet",
        filled.elapsed(),
        after.tick - before.tick
    );
    assert!(gap < LONGEST_GAP, "{gap:?}");
    let ticks = filled.elapsed().as_secs_f64() / PERIOD_S;
    assert!((f64::from(after.tick - before.tick) / ticks - 1.0).abs() < 0.02, "{ticks}");
    // Beside other tests a machine may be late by itself.
    assert!(overruns < if is_alone() { 1 } else { 5 }, "{overruns}");

    while ground.try_wait().unwrap().is_none() {
        assert!(begun.elapsed() < full + 3 * PATIENCE, "does not end: {:?}", hall.heard);
        hall.turn();
        if hall.state() == Some(State::Disarmed) {
            fs::write(of_ground.beside("fast"), "").unwrap();
        }
    }
    let output = ground.wait_with_output().unwrap();
    let told = fs::read_to_string(of_ground.beside("told.txt")).unwrap_or_default();
    assert!(output.status.success(), "{told}");
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&document["well"], &document["completeness"]["left_out_messages"]),
        (&true.into(), &0.into())
    );
    assert_eq!(document["completeness"]["closed"], true);
    let lines = log_lines(&of_ground.beside("a.mcap"));
    let at = |words: &str| lines.iter().position(|line| line.contains(words));
    let (waits, goes_on) = (at("waits for its disk"), at("goes on, nothing was lost"));
    assert!(waits.is_some() && waits < goes_on, "{lines:?}");
}
