//! `cargo xtask flash` against a real sshd on this machine, whose craft is an ARM program under
//! qemu-arm.
//!
//! Everything is real but the processor: Debian's sshd with keys of its own on a port of the
//! loopback, the program built for armv7, its link, its guardian, a pseudo terminal for its IMU,
//! files for its PWM. Without one of the means it is skipped.
#![forbid(unsafe_code)]

#[path = "../../firmware/com/tests/whole/common/mod.rs"]
mod common;

use std::fs;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use common::{Bench, Ground, Held, IDLE, PATIENCE, patient_law};
use control::Config;
use proto::{Request, State};
use sil::{FlightComputer, FlightPlan, InProcess, NoiseModel, Recording, StepAxis, Udp};
use stories::program;

const RUNNER: &str = "qemu-arm -L /usr/arm-linux-gnueabihf";
/// The program for ARM Linux, which `cargo xtask test` has built.
const BUILT: &str = "QUADLAB_ARMV7_COM";

fn has(program: &str, argument: &str) -> bool {
    // sshd knows no such argument and says so; that it starts is enough.
    Command::new(program).arg(argument).stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

/// What is missing on this machine, if so.
fn missing() -> Option<String> {
    let needed = [
        ("/usr/sbin/sshd", "-V", "openssh-server"),
        ("ssh", "-V", "openssh-client"),
        ("qemu-arm", "--version", "qemu-user"),
    ];
    let absent = needed.into_iter().find(|(program, argument, _)| !has(program, argument));
    absent.map(|(program, _, package)| format!("{program} is not installed: apt-get install --yes {package}"))
}

/// A free port, which the next program takes.
fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn free_udp_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A machine that is reached over ssh: this one.
struct Machine {
    folder: tempfile::TempDir,
    sshd: Child,
    port: u16,
    user: String,
}

impl Machine {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["host", "user"] {
            let made = Command::new("ssh-keygen")
                .args(["-q", "-t", "ed25519", "-N", "", "-f"])
                .arg(at(name))
                .status();
            assert!(made.unwrap().success(), "ssh-keygen");
        }
        let port = free_port();
        // As root, sshd wants this folder for its unprivileged half.
        let _ = fs::create_dir_all("/run/sshd");
        fs::copy(at("user.pub"), at("authorized_keys")).unwrap();
        let config = format!(
            "Port {port}\nListenAddress 127.0.0.1\nHostKey {0}/host\nAuthorizedKeysFile {0}/authorized_keys\nPidFile none\n\
             StrictModes no\nUsePAM no\nPasswordAuthentication no\nPermitRootLogin prohibit-password\n",
            folder.path().display()
        );
        fs::write(at("sshd_config"), config).unwrap();
        let public = fs::read_to_string(at("host.pub")).unwrap();
        fs::write(at("known_hosts"), format!("[127.0.0.1]:{port} {public}")).unwrap();
        let client = format!(
            "Host *\n IdentityFile {0}/user\n IdentitiesOnly yes\n UserKnownHostsFile {0}/known_hosts\n StrictHostKeyChecking yes\n",
            folder.path().display()
        );
        fs::write(at("ssh_config"), client).unwrap();
        let sshd = Command::new("/usr/sbin/sshd")
            .args(["-D", "-e", "-f"])
            .arg(at("sshd_config"))
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let started = Instant::now();
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(started.elapsed() < PATIENCE, "sshd does not listen");
            std::thread::sleep(Duration::from_millis(20));
        }
        let id = Command::new("id").arg("-un").output().unwrap();
        let user = String::from_utf8(id.stdout).unwrap().trim().to_owned();
        Self { folder, sshd, port, user }
    }

    fn craft(&self) -> PathBuf {
        self.folder.path().join("craft")
    }

    fn flash(&self, more: &[&str]) -> Output {
        self.flash_by(RUNNER, more)
    }

    fn flash_by(&self, runner: &str, more: &[&str]) -> Output {
        let destination = format!("{}@127.0.0.1:{}", self.user, self.port);
        let mut command = Command::new(program("xtask"));
        command.args(["flash", "--com", &destination, "--runner", runner, "--folder"]).arg(self.craft());
        command.arg("--ssh-config").arg(self.folder.path().join("ssh_config")).args(more);
        command.output().unwrap()
    }

    fn current(&self) -> PathBuf {
        fs::canonicalize(self.craft().join("current")).unwrap()
    }

    fn process(&self) -> u32 {
        fs::read_to_string(self.craft().join("com.pid")).unwrap().trim().parse().unwrap()
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        if self.craft().join("com.pid").exists() {
            let _ = Command::new("kill").arg(self.process().to_string()).stderr(Stdio::null()).status();
        }
        let _ = self.sshd.kill();
        let _ = self.sshd.wait();
    }
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn succeeded(output: &Output) -> String {
    let said = said(output);
    assert!(output.status.success(), "{said}");
    said
}

/// The configuration of a craft whose devices are a bench's, with a port that stays.
fn settle_ports(bench: &Bench) -> u16 {
    let port = free_udp_port();
    let path = bench.path("com.toml");
    let text = fs::read_to_string(&path).unwrap();
    let text = text.replace("127.0.0.1:0", &format!("127.0.0.1:{port}"));
    fs::write(path, text.replace("root = 'pwm'", &format!("root = '{}'", bench.path("pwm").display())))
        .unwrap();
    port
}

/// A minute in noise with a step of a metre, with the law wherever `link` leads.
fn minute(link: impl FlightComputer, law: &Config) -> Recording {
    let plan = FlightPlan {
        config: *law,
        noise: Some(NoiseModel::default()),
        duration_s: 60.0,
        ..FlightPlan::thesis_step(StepAxis::X, 1.0)
    };
    sil::fly_over(&plan, link).unwrap()
}

#[test]
fn a_craft_is_flashed_flown_flashed_again_and_rolled_back() {
    let Some(built) = std::env::var(BUILT).ok() else {
        println!(
            "SKIPPED: {BUILT} is not set: `cargo xtask test` builds the ARM programs where `cargo xtask setup` was run"
        );
        return;
    };
    if let Some(missing) = missing() {
        println!("SKIPPED: {missing}");
        return;
    }
    let machine = Machine::start();
    let bench = Bench::new(&patient_law(), "[guardian]\nsilence_s = 2.0\nwatchdog = 'none'\n");
    let port = settle_ports(&bench);
    let config = bench.path("com.toml");
    let config = config.to_str().unwrap();

    // Steps are printed, and nothing is done.
    let steps = succeeded(&machine.flash(&["--config", config, "--dry-run"]));
    assert!(
        steps.contains("would flash") && steps.contains("SHA-256") && !machine.craft().exists(),
        "{steps}"
    );

    let first = succeeded(&machine.flash(&["--config", config, "--program", &built]));
    assert!(
        first.contains("nothing runs there") && first.contains("over the link: program 0.1.0"),
        "{first}"
    );
    let (release, process) = (machine.current(), machine.process());
    let elf = fs::read(release.join("com")).unwrap();
    assert_eq!(elf[18..20], [40, 0], "the machine of the program is ARM");
    assert!(bench.is_idle());

    // A minute against the plant: every bit is that of the host's build.
    let law = patient_law();
    let began = Instant::now();
    let there = minute(Udp::start(&release.join("com"), &law).unwrap(), &law);
    println!("a minute flown in {:?} on an emulated ARM", began.elapsed());
    let here = minute(InProcess::new(&law).unwrap(), &law);
    assert_eq!(there.rows.len(), 6001, "both ends of a minute");
    let bits = |recording: &Recording| -> Vec<u32> {
        recording.rows.iter().flat_map(|row| row.output.pwm.map(f32::to_bits)).collect()
    };
    assert!(bits(&there) == bits(&here), "the two builds command different motors");

    // Armed it is left alone.
    let mut held = Held::new(Ground::new(format!("127.0.0.1:{port}").parse().unwrap()));
    held.until(&bench, IDLE, "ready", |held| {
        held.ground
            .telemetry
            .is_some_and(|telemetry| telemetry.supervision.preflight == control::Preflight::ALL.bits())
    });
    held.ground.request(Request::Arm);
    held.until(&bench, IDLE, "armed", |held| held.ground.state() == State::Armed);
    let refused = std::thread::scope(|scope| {
        let flash = scope.spawn(|| machine.flash(&["--config", config, "--program", &built]));
        while !flash.is_finished() {
            held.tick(&bench, IDLE);
        }
        flash.join().unwrap()
    });
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("the craft is armed: disarm it first"), "{}", said(&refused));
    held.ground.request(Request::Disarm);
    held.until(&bench, IDLE, "disarmed", |held| held.ground.state() == State::Disarmed);
    assert_eq!((machine.current(), machine.process()), (release.clone(), process));

    // Armed after it was asked, while the files were checked there: the old release runs on.
    let mut law = patient_law();
    law.anti_windup = !law.anti_windup;
    bench.write_gains(&law);
    let (checking, armed) = (bench.path("checking"), bench.path("armed"));
    let runner = bench.path("runner");
    let waits = format!(
        "#!/bin/sh\ncase \"$*\" in *' check '*) touch {}; while [ ! -e {} ]; do sleep 0.05; done;; esac\nexec {RUNNER} \"$@\"\n",
        checking.display(),
        armed.display()
    );
    fs::write(&runner, waits).unwrap();
    let runner = format!("sh {}", runner.display());
    let refused = std::thread::scope(|scope| {
        let flash = scope.spawn(|| machine.flash_by(&runner, &["--config", config, "--program", &built]));
        held.until(&bench, IDLE, "checking", |_| checking.exists());
        held.ground.request(Request::Arm);
        held.until(&bench, IDLE, "armed", |held| held.ground.state() == State::Armed);
        fs::write(&armed, "").unwrap();
        while !flash.is_finished() {
            held.tick(&bench, IDLE);
        }
        flash.join().unwrap()
    });
    assert_eq!(refused.status.code(), Some(2));
    let why = said(&refused);
    assert!(
        why.contains("the craft is disarmed") && why.contains("no longer disarmed, so its program runs on"),
        "{why}"
    );
    assert_eq!((machine.current(), machine.process()), (release.clone(), process));
    assert_eq!(held.ground.state(), State::Armed);
    held.ground.request(Request::Disarm);
    held.until(&bench, IDLE, "disarmed", |held| held.ground.state() == State::Disarmed);

    // Other gains are another release.
    let second = succeeded(&machine.flash(&["--config", config, "--program", &built]));
    assert!(second.contains("the craft is disarmed"), "{second}");
    let hash = |said: &str| said.split("vehicle hash ").nth(1).unwrap()[..64].to_owned();
    assert_ne!(hash(&first), hash(&second));
    assert_ne!(machine.current(), release);
    assert_ne!(machine.process(), process);

    // Files that cannot be flown never become the current ones.
    let good = machine.current();
    fs::write(
        bench.path("vehicle.toml"),
        "name = 'another'\n[motors]\ncommand_unit = 'us'\ncommand_range = [1000.0, 2000.0]\n",
    )
    .unwrap();
    let refused = machine.flash(&["--config", config, "--program", &built]);
    assert!(said(&refused).contains("these gains belong to another vehicle"), "{}", said(&refused));
    assert_eq!((refused.status.code(), machine.current()), (Some(2), good));

    let back = succeeded(&machine.flash(&["--rollback"]));
    assert_eq!(hash(&back), hash(&first));
    assert_eq!(machine.current(), release);
}
