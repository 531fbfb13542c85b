//! A Slurm of one node, of Debian's packages `slurmctld`, `slurmd` and `slurm-client`, as long as a test runs.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Its two daemons, which end with it.
pub(crate) struct Slurm {
    daemons: [Child; 2],
    _folder: tempfile::TempDir,
    configuration: std::path::PathBuf,
}

fn said_by(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).stderr(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn free_port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

impl Slurm {
    /// Starts one; nothing where it is not installed.
    pub(crate) fn start() -> Option<Self> {
        for program in ["slurmctld", "slurmd"] {
            said_by(program, &["-V"])?;
        }
        let (host, user) = (said_by("hostname", &["-s"])?, said_by("id", &["-un"])?);
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().display();
        let (controller, node) = (free_port(), free_port());
        let text = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nAuthType=auth/none\nCredType=cred/none\nSlurmUser={user}\n\
             SlurmdUser={user}\nSlurmctldPort={controller}\nSlurmdPort={node}\nStateSaveLocation={place}/state\n\
             SlurmdSpoolDir={place}/spool\nSlurmctldPidFile={place}/controller.pid\nSlurmdPidFile={place}/node.pid\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nSelectType=select/cons_tres\n\
             SelectTypeParameters=CR_Core\nNodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN\n\
             PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP\n"
        );
        for name in ["state", "spool"] {
            std::fs::create_dir(folder.path().join(name)).unwrap();
        }
        let configuration = folder.path().join("slurm.conf");
        std::fs::write(&configuration, text).unwrap();
        let daemon = |program: &str| {
            let mut command = Command::new(program);
            command.args(["-D", "-c", "-f"]).arg(&configuration).env("SLURM_CONF", &configuration);
            command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
        };
        let daemons = [daemon("slurmctld"), daemon("slurmd")];
        let slurm = Self { daemons, _folder: folder, configuration };
        slurm.waits_until_idle().then_some(slurm)
    }

    /// What tells its programs where it is.
    pub(crate) fn environment(&self) -> (&'static str, &Path) {
        ("SLURM_CONF", &self.configuration)
    }

    /// Whether its node takes jobs and there are none, within a minute.
    pub(crate) fn waits_until_idle(&self) -> bool {
        let (variable, value) = self.environment();
        let told = |program: &str, arguments: &[&str]| {
            let output = Command::new(program).args(arguments).env(variable, value).output().unwrap();
            String::from_utf8_lossy(&output.stdout).trim().to_owned()
        };
        let end = Instant::now() + Duration::from_secs(60);
        while Instant::now() < end {
            if told("sinfo", &["-h", "-o", "%t"]) == "idle" && told("squeue", &["-h"]).is_empty() {
                return true;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        false
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        for daemon in &mut self.daemons {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}
