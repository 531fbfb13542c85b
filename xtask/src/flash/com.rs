//! Flashing a computer on module: Linux, reached with the system's `ssh`.
//!
//! On the craft a release is a folder of its own, named by what is in it; `current` and `previous` are symbolic links that
//! are replaced by renaming, so there is at every moment one whole program to start:
//!
//! ```text
//! FOLDER/releases/3f9c0a6e1b2d/{com, com.toml, vehicle.toml, gains.toml}
//! FOLDER/current -> releases/3f9c0a6e1b2d        FOLDER/previous -> releases/...
//! ```
//!
//! Order: build; ask the craft what it is doing (its own program asks, over its link) and leave it alone unless it is
//! disarmed; copy; compare SHA-256; let the new program check its files there; ask once more, there, and stop it in the same
//! moment; switch, start; ask again, and go back to the release before if another answers than was flashed.
//!
//! Absent: keys. A key is put on the craft once, by hand, mode 0600; its configuration names it.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use super::destination::Destination;
use super::release::{CONFIG, PROGRAM, Release, files_of, hash, stripped};
use crate::arm::{self, Target};
use crate::base::process::shown;
use crate::base::workspace::Workspace;

/// One flash.
pub(crate) struct Flash {
    pub(crate) destination: Destination,
    pub(crate) config: Option<PathBuf>,
    pub(crate) folder: String,
    pub(crate) ssh_config: Option<PathBuf>,
    pub(crate) runner: String,
    pub(crate) program: Option<PathBuf>,
    pub(crate) rollback: bool,
}

const SERVICE: &str = "quadlab-com";

/// What to do with a program that runs and does not say whether it is armed.
#[derive(Clone, Copy)]
enum IfSilent {
    Refuse,
    /// One that has just been started, and has never answered.
    Stop,
}

/// What the unit says beside its programs: when it is started anew, as whom it runs, and what it may touch. It is a user without
/// rights but three: to be scheduled in real time, to keep its memory, and to write the outputs, which are files of root. The kernel's
/// tunables are not closed (`ProtectKernelTunables`), because the outputs are among them, in `/sys`.
const GUARDED: &str = "\
Restart=on-failure
RestartSec=1
WatchdogSec=2
KillMode=mixed
TimeoutStopSec=3
LimitRTPRIO=99
LimitMEMLOCK=infinity
User=quadlab
StateDirectory=quadlab
AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK CAP_DAC_OVERRIDE
CapabilityBoundingSet=CAP_SYS_NICE CAP_IPC_LOCK CAP_DAC_OVERRIDE
NoNewPrivileges=yes
DevicePolicy=closed
DeviceAllow=/dev/watchdog rw
DeviceAllow=char-watchdog rw
DeviceAllow=char-ttyS rw
DeviceAllow=char-ttyO rw
DeviceAllow=char-ttyAMA rw
DeviceAllow=char-ttymxc rw
DeviceAllow=char-ttyUSB rw
DeviceAllow=char-ttyACM rw
ProtectSystem=full
ProtectHome=yes
PrivateTmp=yes
ProtectClock=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectControlGroups=yes
ProtectProc=invisible
RestrictNamespaces=yes
RestrictSUIDSGID=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6
LockPersonality=yes
MemoryDenyWriteExecute=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallFilter=~@privileged
RemoveIPC=yes
UMask=0077
";

impl Flash {
    /// The steps, in words.
    fn steps(&self) -> Vec<String> {
        let Self { folder, config, program, .. } = self;
        let craft = &self.destination.user_at_host;
        let ask = format!(
            "ask the craft over its link what it is doing ({folder}/current/com who); go on only if it is disarmed, or nothing runs there"
        );
        let start = format!(
            "ask once more, there, and stop what runs if it is still disarmed; switch {folder}/current by renaming, start it: systemd unit \
             {SERVICE}, or directly where there is no systemd"
        );
        let answer = "ask again; version and vehicle hash have to be those of this release".to_owned();
        if self.rollback {
            return vec![
                ask,
                format!("exchange {folder}/current and {folder}/previous on {craft}"),
                start,
                answer,
            ];
        }
        let build = match program {
            Some(program) => format!("take the program {}", program.display()),
            None => "build com for armv7, release".into(),
        };
        let files = match config {
            Some(config) => {
                format!("with {} and the vehicle and gains files that it names", config.display())
            }
            None => "with the configuration that the craft has".into(),
        };
        vec![
            build,
            ask,
            format!(
                "copy the program {files} over ssh into a folder of its own in {craft}:{folder}/releases"
            ),
            "compare the SHA-256 of every file there, and let the new program check its configuration there"
                .into(),
            start,
            format!("{answer}; otherwise go back to {folder}/previous"),
        ]
    }

    /// `--dry-run`.
    pub(crate) fn print_steps(&self) -> Result<ExitCode> {
        let example = shown(&self.ssh("..."));
        println!("would flash {} ({example}):", self.destination.user_at_host);
        for (number, step) in self.steps().iter().enumerate() {
            println!("  {}. {step}", number + 1);
        }
        Ok(ExitCode::SUCCESS)
    }

    pub(crate) fn run(&self) -> Result<ExitCode> {
        self.check_folder()?;
        if self.rollback {
            return self.roll_back();
        }
        let release = self.release()?;
        println!("release {}: {}", release.id, release.files.keys().cloned().collect::<Vec<_>>().join(", "));
        self.leave_alone_unless_disarmed()?;
        self.copy(&release)?;
        self.check_there(&release)?;
        let expected = self.identity(&format!("releases/{}", release.id))?;
        self.stop(IfSilent::Refuse)?;
        self.switch_to(&format!("releases/{}", release.id))?;
        if let Err(why) = self.start().and_then(|()| self.answers_as(&expected)) {
            print!("{}", self.last_words()?);
            println!("{why:#}");
            self.go_back()?;
            bail!("the craft is back at the previous release, which answers");
        }
        Ok(ExitCode::SUCCESS)
    }

    /// It goes into shell lines between quotes.
    fn check_folder(&self) -> Result<()> {
        let plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
        ensure!(
            self.folder.starts_with('/') && self.folder.chars().all(plain) && !self.folder.contains(".."),
            "--folder {:?}: give an absolute path of letters, digits and ._-",
            self.folder
        );
        ensure!(!self.runner.contains('\''), "--runner: without quotes, please");
        Ok(())
    }

    /// Reads everything that goes onto the craft.
    fn release(&self) -> Result<Release> {
        let files = match &self.config {
            Some(config) => files_of(config)?,
            None => self.files_on_the_craft()?,
        };
        let program = match &self.program {
            Some(program) => program.clone(),
            None => stripped(
                &arm::build(&Workspace::load()?, Target::Armv7, PROGRAM, &[PROGRAM], &[])?.remove(0),
            )?,
        };
        Release::new(files, &program)
    }

    /// The configuration that is there, to go along with a new program.
    fn files_on_the_craft(&self) -> Result<BTreeMap<String, Vec<u8>>> {
        let list = self.remote(&format!("cd {}/current 2>/dev/null && ls", self.folder), None)?;
        let list = list.context("the craft has no configuration yet: give one with --config com.toml")?;
        let mut files = BTreeMap::new();
        for name in list.lines().filter(|name| *name != PROGRAM) {
            let bytes = self.remote(&format!("cat {}/current/{name}", self.folder), None)?;
            files.insert(
                name.to_owned(),
                bytes.with_context(|| format!("cannot read {name} there"))?.into_bytes(),
            );
        }
        Ok(files)
    }

    /// A craft that flies, or may be about to, is not touched.
    fn leave_alone_unless_disarmed(&self) -> Result<()> {
        if !self.is_running()? {
            println!("nothing runs there");
            return Ok(());
        }
        let answer = self.ask(2)?;
        let answer = answer.context(
            "a program runs on the craft and does not answer on its link, so nobody knows whether it flies; look at it, and stop it yourself",
        )?;
        let state = answer["state"].as_str().unwrap_or("unknown");
        ensure!(state == "disarmed", "the craft is {state}: disarm it first");
        println!("the craft is disarmed; program {}", answer["program"].as_str().unwrap_or("unknown"));
        Ok(())
    }

    fn copy(&self, release: &Release) -> Result<()> {
        let there = format!("{}/releases/{}", self.folder, release.id);
        self.must(&format!("mkdir -p {there}"), None)?;
        for (name, bytes) in &release.files {
            // Under another name until it is whole.
            let put = format!("cat > {there}/{name}.new && mv {there}/{name}.new {there}/{name}");
            self.must(&put, Some(bytes))?;
        }
        self.must(&format!("chmod 755 {there}/{PROGRAM} && sync"), None)?;
        Ok(())
    }

    /// The files arrived, and the new program can use them.
    fn check_there(&self, release: &Release) -> Result<()> {
        let there = format!("{}/releases/{}", self.folder, release.id);
        for (name, bytes) in &release.files {
            let line = self.must(&format!("sha256sum {there}/{name}"), None)?;
            let found = line.split_whitespace().next().unwrap_or_default();
            ensure!(
                found == hash(bytes),
                "{there}/{name}: SHA-256 {found}, not {}: the copy is damaged",
                hash(bytes)
            );
        }
        println!("{} files copied and compared (SHA-256)", release.files.len());
        let said = self.must(&self.com(&format!("releases/{}", release.id), "check", CONFIG), None)?;
        print!("{said}");
        Ok(())
    }

    /// A command of the program in a release, with one of its files.
    fn com(&self, release: &str, command: &str, file: &str) -> String {
        let there = format!("{}/{release}", self.folder);
        format!("{} {there}/{PROGRAM} {command} {there}/{file}", self.runner)
    }

    /// Who the program in a release says that it is.
    fn identity(&self, release: &str) -> Result<Value> {
        let said = self.must(&self.com(release, "identity", CONFIG), None)?;
        serde_json::from_str(&said).context("the program there does not say who it is")
    }

    /// What runs says over the link who it is and what it does.
    fn ask(&self, seconds: u32) -> Result<Option<Value>> {
        let question = format!("{} --wait {seconds}", self.com("current", "who --config", CONFIG));
        let Some(said) = self.remote(&question, None)? else { return Ok(None) };
        Ok(Some(serde_json::from_str(&said).context("the answer over the link cannot be read")?))
    }

    fn is_running(&self) -> Result<bool> {
        Ok(self.remote(&format!("{}\nrunning", self.functions()), None)?.is_some())
    }

    /// `current` is this release from now on, and `previous` what it was before.
    fn switch_to(&self, release: &str) -> Result<()> {
        let folder = &self.folder;
        let script = format!(
            "cd {folder}
             old=$(readlink current || true)
             if [ -n \"$old\" ] && [ \"$old\" != {release} ]; then ln -sfn \"$old\" previous.new && mv -T previous.new previous; fi
             ln -sfn {release} current.new && mv -T current.new current"
        );
        self.must(&script, None)?;
        Ok(())
    }

    /// Stops what runs, unless it is armed: copying takes a while, and the craft may be about to fly by now.
    fn stop(&self, silent: IfSilent) -> Result<()> {
        let policy = match silent {
            IfSilent::Refuse => "refuse",
            IfSilent::Stop => "stop",
        };
        self.must(&format!("{}\nleave_armed_alone {policy}\nstop", self.functions()), None)?;
        Ok(())
    }

    /// Starts `current`.
    fn start(&self) -> Result<()> {
        let said = self.must(&format!("{}\nstart", self.functions()), None)?;
        print!("{said}");
        Ok(())
    }

    fn answers_as(&self, expected: &Value) -> Result<()> {
        let answer = self
            .ask(10)?
            .context("the new program does not answer on its link; above is what it said last")?;
        for field in ["program", "vehicle_sha256"] {
            ensure!(
                answer[field] == expected[field],
                "over the link the craft says {field} {}, but {} was flashed",
                answer[field],
                expected[field]
            );
        }
        println!(
            "over the link: program {}, vehicle hash {}, {}",
            text(&answer, "program"),
            text(&answer, "vehicle_sha256"),
            text(&answer, "state")
        );
        Ok(())
    }

    fn previous(&self) -> Result<String> {
        let release = self.remote(&format!("readlink {}/previous", self.folder), None)?;
        Ok(release.context("there is no earlier release on the craft")?.trim().to_owned())
    }

    /// What the program there said last.
    fn last_words(&self) -> Result<String> {
        let folder = &self.folder;
        let words = format!(
            "if [ -d /run/systemd/system ]; then journalctl --quiet -u {SERVICE} -n 3 -o cat; else tail -n 3 {folder}/com.log; fi"
        );
        Ok(self.remote(&words, None)?.unwrap_or_default())
    }

    /// To the release before, because the new one does not work. That one stays `previous` too: what failed is not to be come back to.
    fn go_back(&self) -> Result<()> {
        let previous = self.previous()?;
        self.stop(IfSilent::Stop)?;
        self.must(
            &format!("cd {} && ln -sfn {previous} current.new && mv -T current.new current", self.folder),
            None,
        )?;
        self.start()?;
        self.answers_as(&self.identity("current")?)
    }

    fn roll_back(&self) -> Result<ExitCode> {
        let previous = self.previous()?;
        self.leave_alone_unless_disarmed()?;
        self.stop(IfSilent::Refuse)?;
        self.switch_to(&previous)?;
        self.start()?;
        self.answers_as(&self.identity("current")?)?;
        println!("back at {previous}");
        Ok(ExitCode::SUCCESS)
    }

    /// Shell functions `running`, `leave_armed_alone`, `stop` and `start`, with systemd or without.
    fn functions(&self) -> String {
        let Self { folder, runner, .. } = self;
        let unit = self.unit();
        let command = format!("{runner} {folder}/current/{PROGRAM} run {folder}/current/{CONFIG}");
        let ask = format!("{} --wait 2", self.com("current", "who --config", CONFIG));
        format!(
            "systemd() {{ [ -d /run/systemd/system ]; }}
             pid() {{ cat {folder}/com.pid 2>/dev/null; }}
             direct() {{ p=$(pid) && [ -n \"$p\" ] && tr '\\0' ' ' < /proc/$p/cmdline 2>/dev/null | grep -q '{folder}/current/{PROGRAM} run'; }}
             running() {{ direct || {{ systemd && systemctl --quiet is-active {SERVICE}; }}; }}
             leave_armed_alone() {{
               running || return 0
               if ! answer=$({ask}); then
                 [ $1 = refuse ] || return 0
                 echo 'the program there no longer answers on its link, so nobody knows whether it flies; it runs on' >&2
                 return 1
               fi
               case $answer in
                 *'\"state\":\"disarmed\"'*) ;;
                 *) echo \"the craft is no longer disarmed, so its program runs on: disarm it and flash again; it says $answer\" >&2; return 1 ;;
               esac
             }}
             stop() {{
               if direct; then
                 kill -TERM $(pid)
                 n=0; while direct && [ $n -lt 50 ]; do sleep 0.1; n=$((n + 1)); done
                 ! direct || {{ echo 'what runs does not stop' >&2; return 1; }}
               fi
               if systemd && systemctl --quiet is-active {SERVICE}; then systemctl stop {SERVICE}; fi
             }}
             start() {{
               if systemd; then
                 cat > /etc/systemd/system/{SERVICE}.service.new <<'UNIT'
{unit}UNIT
                 mv /etc/systemd/system/{SERVICE}.service.new /etc/systemd/system/{SERVICE}.service
                 id -u quadlab > /dev/null 2>&1 || useradd --system --no-create-home --shell /bin/false quadlab ||
                   adduser -S -D -H quadlab || {{ echo 'the user quadlab cannot be made' >&2; return 1; }}
                 systemctl daemon-reload && systemctl --quiet enable {SERVICE} && systemctl start {SERVICE} && echo 'started by systemd'
               else
                 setsid {command} >> {folder}/com.log 2>&1 < /dev/null &
                 echo $! > {folder}/com.pid
                 echo 'started directly: there is no systemd'
               fi
             }}"
        )
    }

    /// The systemd unit. The guardian is the main process: it alone is told to stop, and gives the signs of life.
    fn unit(&self) -> String {
        let Self { folder, runner, .. } = self;
        let mut unit = String::new();
        let _ = write!(
            unit,
            "[Unit]\nDescription=quadlab: flight program of the craft\nAfter=network.target\n\n\
             [Service]\nType=notify\nExecStart={runner}{space}{folder}/current/{PROGRAM} run {folder}/current/{CONFIG}\n\
             ExecStopPost={runner}{space}{folder}/current/{PROGRAM} idle {folder}/current/{CONFIG}\n\
             {GUARDED}\n\
             [Install]\nWantedBy=multi-user.target\n",
            space = if runner.is_empty() { "" } else { " " },
        );
        unit
    }

    fn ssh(&self, script: &str) -> Command {
        let mut command = Command::new("ssh");
        if let Some(config) = &self.ssh_config {
            command.arg("-F").arg(config);
        }
        command.args(["-o", "BatchMode=yes", "-o", "ConnectTimeout=10"]);
        if let Some(port) = self.destination.port {
            command.args(["-p", &port.to_string()]);
        }
        command.args([self.destination.user_at_host.as_str(), script]);
        command
    }

    /// Runs a shell script on the craft: what it printed, or nothing if it failed. An error is a craft that cannot be reached.
    fn remote(&self, script: &str, input: Option<&[u8]>) -> Result<Option<String>> {
        let (succeeded, stdout, _) = self.execute(script, input)?;
        Ok(succeeded.then_some(stdout))
    }

    /// The same for a script that has to succeed.
    fn must(&self, script: &str, input: Option<&[u8]>) -> Result<String> {
        let (succeeded, stdout, stderr) = self.execute(script, input)?;
        let why = stderr.lines().last().unwrap_or("it says nothing");
        ensure!(succeeded, "on the craft: {why}");
        Ok(stdout)
    }

    fn execute(&self, script: &str, input: Option<&[u8]>) -> Result<(bool, String, String)> {
        let mut command = self.ssh(&format!("set -e\n{script}"));
        command.stdin(if input.is_some() { Stdio::piped() } else { Stdio::null() });
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().context("cannot start ssh: apt-get install openssh-client")?;
        if let (Some(mut stdin), Some(bytes)) = (child.stdin.take(), input) {
            // A script that fails closes its input; its status and words say why.
            let _ = stdin.write_all(bytes);
        }
        let output = child.wait_with_output().context("ssh cannot be waited for")?;
        let stderr = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        // ssh's own failures have this status.
        if output.status.code() == Some(255) {
            bail!(
                "{} cannot be reached: {}",
                self.destination.user_at_host,
                stderr.lines().last().unwrap_or("ssh says nothing")
            );
        }
        Ok((output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned(), stderr))
    }
}

fn text<'a>(answer: &'a Value, field: &str) -> &'a str {
    answer[field].as_str().unwrap_or("unknown")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flash() -> Flash {
        Flash {
            destination: "root@craft:2222".parse().unwrap(),
            config: None,
            folder: "/opt/quadlab".into(),
            ssh_config: None,
            runner: String::new(),
            program: None,
            rollback: false,
        }
    }

    #[test]
    fn ssh_asks_no_questions_and_takes_the_port() {
        assert_eq!(
            shown(&flash().ssh("ls")),
            "ssh -o BatchMode=yes -o ConnectTimeout=10 -p 2222 root@craft ls"
        );
    }

    #[test]
    fn folders_that_a_shell_would_take_apart_are_refused() {
        let check = |folder: &str| Flash { folder: folder.into(), ..flash() }.check_folder();
        assert!(check("/opt/quadlab").is_ok());
        for folder in ["opt", "/opt/quad lab", "/opt/$(reboot)", "/opt;ls", "/opt/../etc", "/o'p"] {
            assert!(check(folder).is_err(), "{folder}");
        }
    }

    #[test]
    fn the_shell_can_read_the_functions() {
        let script = flash().functions();
        let mut sh = Command::new("sh").arg("-n").stdin(Stdio::piped()).spawn().unwrap();
        sh.stdin.take().unwrap().write_all(script.as_bytes()).unwrap();
        assert!(sh.wait().unwrap().success(), "{script}");
        let unit = flash().unit();
        assert!(
            unit.contains("\nExecStart=/opt/quadlab/current/com run /opt/quadlab/current/com.toml\n"),
            "{unit}"
        );
        assert!(
            unit.contains("\nExecStopPost=/opt/quadlab/current/com idle /opt/quadlab/current/com.toml\n"),
            "{unit}"
        );
    }

    /// By systemd's own measure, from 0 (safe) to 10; a unit that says nothing has 9.6.
    #[test]
    fn the_unit_is_exposed_little() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("quadlab.service");
        std::fs::write(&path, flash().unit()).unwrap();
        let analysed = Command::new("systemd-analyze")
            .args(["security", "--no-pager", "--offline=true"])
            .arg(&path)
            .output();
        let said =
            analysed.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default();
        let level =
            said.lines().find_map(|line| line.split_once("Overall exposure level for quadlab.service: "));
        let Some((_, level)) = level else {
            println!(
                "SKIPPED: the exposure of the unit, because there is no systemd-analyze of systemd 250 or later"
            );
            return;
        };
        let level: f64 = level.split(' ').next().unwrap().parse().unwrap();
        assert!(level < 3.0, "{said}");
    }
}
