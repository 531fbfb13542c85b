//! Programs of others that do the same work as a throughput bench: `cargo xtask bench --against FOLDER`.
//!
//! The folder holds reference programs; what they build and write goes to a temporary folder. Readers of CSV are
//! asked for the file that `read_throughput` has just read. A peer that is not on this machine is skipped aloud.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};
use serde_json::Value;
use tempfile::TempDir;

use crate::base::process::shown;
use crate::base::tally::SKIP_MARK;
use crate::base::tools::PEERS_PYTHON;
use crate::base::workspace::root;
use crate::bench::figures::Throughput;

/// The flight file that ours leaves for the others, in the folder named by [`FLIGHT_FILE_FOLDER`].
const FLIGHT_FILE: &str = "flight.csv";
/// The variable that tells `read_throughput` where to leave its file.
pub(crate) const FLIGHT_FILE_FOLDER: &str = "FLIGHT_FILE_FOLDER";

/// Reads the file that the first argument names, on one thread.
const PYARROW: &str = "\
import json, sys, time
import pyarrow, pyarrow.csv
pyarrow.set_cpu_count(1)
options = pyarrow.csv.ReadOptions(use_threads=False)
start = time.process_time()
pyarrow.csv.read_csv(sys.argv[1], read_options=options)
print(json.dumps({'peer': 'pyarrow', 'cpu': time.process_time() - start}))
";
const PANDAS: &str = "\
import json, sys, time
import pandas
start = time.process_time()
pandas.read_csv(sys.argv[1])
print(json.dumps({'peer': 'pandas', 'cpu': time.process_time() - start}))
";

/// Another program for a bench's work.
struct Peer {
    name: &'static str,
    /// The throughput bench it stands beside.
    bench: &'static str,
    /// Builds what it needs; an error is why it cannot run here.
    prepare: fn(&Peers) -> Result<()>,
    /// The program, ready to run.
    command: fn(&Peers) -> Command,
    /// Reads its output as work and time; the work of a round is ours.
    read: fn(&str, &Throughput) -> Option<Throughput>,
}

const ALL: [Peer; 5] = [
    Peer {
        name: "C, another plant and controller (gcc -O3 -march=native)",
        bench: "flight_throughput",
        prepare: compile_reference,
        command: |peers| Command::new(peers.made("w1_c")),
        read: |output, ours| {
            let line = line_of(output, "C reference")?;
            let amount = line.get("steps")?.as_f64()?;
            Some(Throughput { work: ours.work.clone(), amount, cpu_s: line.get("cpu")?.as_f64()? })
        },
    },
    Peer {
        name: "C++ with vector instructions in f64, another plant and controller (g++ -O3 -march=native -ffast-math)",
        bench: "many_flights_throughput",
        prepare: compile_vector_reference,
        command: |peers| Command::new(peers.made("w2_simd")),
        read: |output, ours| {
            let line = line_of(output, "C++ AVX-512")?;
            let cpu_s = line.get("cpu")?.as_f64()?;
            let amount = line.get("flight_s_per_cpu_s")?.as_f64()? * cpu_s;
            Some(Throughput { work: ours.work.clone(), amount, cpu_s })
        },
    },
    Peer {
        name: "numpy, which also searches 8,100 subsets of terms",
        bench: "identification_throughput",
        prepare: |peers| {
            let program = peers.reference("w3_gen.py")?;
            output_of(peers.python().arg(program)).map(drop)
        },
        command: |peers| {
            let mut command = peers.python();
            command.arg(peers.folder.join("w3_numpy.py")).arg("gram");
            command
        },
        read: |output, ours| same_work(output, "numpy total", ours),
    },
    Peer {
        name: "pyarrow, one thread",
        bench: "read_throughput",
        prepare: |peers| importable(peers, "pyarrow.csv"),
        command: |peers| reader(peers, PYARROW),
        read: |output, ours| same_work(output, "pyarrow", ours),
    },
    Peer {
        name: "pandas",
        bench: "read_throughput",
        prepare: |peers| importable(peers, "pandas"),
        command: |peers| reader(peers, PANDAS),
        read: |output, ours| same_work(output, "pandas", ours),
    },
];

/// The peers that run here.
pub(crate) struct Peers {
    folder: PathBuf,
    made: TempDir,
    ready: Vec<&'static Peer>,
    /// A line for each peer that cannot run here.
    pub(crate) skipped: Vec<String>,
}

impl Peers {
    /// Builds the peers of `benches` from the reference programs in `folder`.
    pub(crate) fn prepare(folder: &Path, benches: &[&str]) -> Result<Self> {
        let made = tempfile::tempdir().context("cannot make a temporary folder")?;
        let folder = std::path::absolute(folder).context("the folder of --against has no path")?;
        let mut peers = Self { folder, made, ready: Vec::new(), skipped: Vec::new() };
        for peer in ALL.iter().filter(|peer| benches.contains(&peer.bench)) {
            match (peer.prepare)(&peers) {
                Ok(()) => peers.ready.push(peer),
                Err(why) => {
                    peers.skipped.push(format!("{SKIP_MARK} {} beside {}, {why:#}", peer.name, peer.bench));
                }
            }
        }
        Ok(peers)
    }

    /// Where our programs leave what the peers read.
    pub(crate) fn working_folder(&self) -> &Path {
        self.made.path()
    }

    /// Runs each peer of `bench` once: its name, and the work of `ours` in its time.
    pub(crate) fn run(&self, bench: &str, ours: &Throughput) -> Result<Vec<(&'static str, Throughput)>> {
        let mut runs = Vec::new();
        for peer in self.ready.iter().filter(|peer| peer.bench == bench) {
            let output = output_of(&mut (peer.command)(self))?;
            let read = (peer.read)(&output, ours);
            runs.push((peer.name, read.with_context(|| format!("{} prints no time: {output}", peer.name))?));
        }
        Ok(runs)
    }

    fn made(&self, name: &str) -> PathBuf {
        self.made.path().join(name)
    }

    fn reference(&self, name: &str) -> Result<PathBuf> {
        let path = self.folder.join(name);
        if path.is_file() { Ok(path) } else { bail!("{} is not there", path.display()) }
    }

    /// Python, that of `cargo xtask setup` where it is, that leaves nothing in the folder of reference programs, on one thread.
    fn python(&self) -> Command {
        let own = root().join(PEERS_PYTHON);
        let mut command = if own.is_file() { Command::new(own) } else { Command::new("python3") };
        command.current_dir(self.made.path()).env("PYTHONDONTWRITEBYTECODE", "1");
        command.env("W3DATA", self.made("data")).env("OMP_NUM_THREADS", "1");
        command
    }
}

fn compile_reference(peers: &Peers) -> Result<()> {
    let source = peers.reference("w1_c.c")?;
    let mut gcc = Command::new("gcc");
    gcc.args(["-O3", "-march=native", "-o"]).arg(peers.made("w1_c")).arg(source).arg("-lm");
    output_of(&mut gcc).map(drop)
}

fn compile_vector_reference(peers: &Peers) -> Result<()> {
    let source = peers.reference("w2_simd.cpp")?;
    let mut compiler = Command::new("g++");
    compiler.args(["-w", "-O3", "-march=native", "-ffast-math", "-mprefer-vector-width=512", "-o"]);
    output_of(compiler.arg(peers.made("w2_simd")).arg(source).args(["-lmvec", "-lm"])).map(drop)
}

fn importable(peers: &Peers, module: &str) -> Result<()> {
    output_of(peers.python().arg("-c").arg(format!("import {module}"))).map(drop)
}

fn reader(peers: &Peers, program: &str) -> Command {
    let mut command = peers.python();
    command.args(["-c", program]).arg(peers.made(FLIGHT_FILE));
    command
}

/// The line of JSON whose `peer` begins with `name`.
fn line_of(output: &str, name: &str) -> Option<Value> {
    let lines = output.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let is_it = |line: &Value| line.get("peer").and_then(Value::as_str).is_some_and(|p| p.starts_with(name));
    lines.into_iter().find(is_it)
}

/// The work of ours in the time that the line of `name` states.
fn same_work(output: &str, name: &str, ours: &Throughput) -> Option<Throughput> {
    let cpu_s = line_of(output, name)?.get("cpu")?.as_f64()?;
    Some(Throughput { cpu_s, ..ours.clone() })
}

/// What a program prints; an error is the last line it complains with.
fn output_of(command: &mut Command) -> Result<String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("`{program}` does not start; is it installed?"))?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = complaint.lines().last().unwrap_or_default().trim();
    bail!("`{}` says: {last}", shown(command).lines().next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ours() -> Throughput {
        Throughput { work: "MB".to_owned(), amount: 100.0, cpu_s: 0.1 }
    }

    #[test]
    fn the_time_of_a_peer_is_found_among_its_lines() {
        let output =
            "noise\n{\"peer\":\"numpy prep\",\"cpu\":0.01}\n{\"peer\":\"numpy total\",\"cpu\":0.03}\n";
        let read = same_work(output, "numpy total", &ours()).expect("it is the last line");
        assert_eq!((read.cpu_s, read.amount), (0.03, 100.0));
        assert_eq!(same_work(output, "pandas", &ours()), None);
        // A line of the C reference.
        let output =
            r#"{"peer":"C reference quad (gcc -O3 -march=native)","cpu":0.015,"steps":60000,"rms":0.1}"#;
        let read = (ALL[0].read)(output, &ours()).expect("it has steps and time");
        assert_eq!(read.rate(), 4e6);
    }

    #[test]
    fn a_peer_that_cannot_run_is_left_out() {
        let empty = tempfile::tempdir().expect("a folder");
        let peers = Peers::prepare(empty.path(), &["flight_throughput"]).expect("nothing to build");
        assert!(peers.ready.is_empty());
        assert_eq!(peers.skipped.len(), 1);
        assert!(peers.skipped[0].ends_with("w1_c.c is not there"), "{:?}", peers.skipped);
        assert!(peers.run("flight_throughput", &ours()).expect("nothing to run").is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn a_complaint_is_handed_on() {
        let error = output_of(Command::new("sh").args(["-c", "echo first >&2; echo last >&2; exit 1"]));
        let error = error.expect_err("it failed").to_string();
        assert!(error.ends_with("says: last"), "{error}");
        let error = output_of(&mut Command::new("no-such-program-here")).expect_err("not a program");
        assert!(error.to_string().contains("is it installed?"));
    }
}
