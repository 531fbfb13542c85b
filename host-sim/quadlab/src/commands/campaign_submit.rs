//! `quadlab campaign submit`: the few lines that hand a plan's shards to an engine that exists.

use std::path::{Path, PathBuf};
use std::process::Command;

use campaign::Plan;
use clap::ValueEnum;

use crate::cli::output::Outcome;
use crate::render::campaign::shards;

/// Hand the shards of a plan to an engine, which runs them: writes its script beside the parts, and starts it
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Folder for the parts, which every machine sees under this path
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// What runs the shards
    #[arg(long, value_enum)]
    engine: Engine,

    /// Image with quadlab, for Kubernetes; the folder with the parts has to be mounted where it is here
    #[arg(long, value_name = "IMAGE", required_if_eq("engine", "k8s"))]
    image: Option<String>,

    /// Write the script, and start nothing
    #[arg(long)]
    dry_run: bool,
}

/// The plan beside its parts.
const PLAN: &str = "plan.json";

/// What runs tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// One process after the other on this machine, each on all cores
    Local,
    /// HyperQueue's Python package: a server of yours (HQ_SERVER_DIR), else one on this machine
    Hq,
    /// A Slurm array
    Slurm,
    /// A Kubernetes indexed job
    K8s,
    /// GNU parallel on this machine
    Parallel,
}

impl Engine {
    /// Name of its script, and what starts it.
    const fn script(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Local => ("submit-local.sh", &["sh"]),
            Self::Hq => ("submit-hq.py", &["python3"]),
            Self::Slurm => ("submit-slurm.sh", &["sbatch"]),
            Self::K8s => ("submit-k8s.yaml", &["kubectl", "create", "-f"]),
            Self::Parallel => ("submit-parallel.sh", &["sh"]),
        }
    }

    /// Whether the shards are flown when its program ends.
    const fn waits(self) -> bool {
        matches!(self, Self::Local | Self::Hq | Self::Parallel)
    }
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    let plan = Plan::read(&options.plan)?;
    std::fs::create_dir_all(&options.out)
        .map_err(|why| anyhow::anyhow!("{}: cannot be made: {why}", options.out.display()))?;
    let absolute = |path: &Path| {
        path.canonicalize().map_err(|why| anyhow::anyhow!("{}: cannot be found: {why}", path.display()))
    };
    let parts = absolute(&options.out)?;
    // One folder is all that the machines have to share.
    put_plan(&plan, &options.out)?;
    let program = std::env::current_exe()?;
    let task = Task { program, plan: parts.join(PLAN), parts, shards: plan.shards };
    let (name, starter) = options.engine.script();
    let script = task.parts.join(name);
    report::write_atomic(&script, task.script(options.engine, options.image.as_deref()))?;
    if options.dry_run {
        return Ok(Outcome::done(format!(
            "script written to {}; nothing was started\nto start {}: {} {}\n",
            script.display(),
            shards(plan.shards),
            starter.join(" "),
            script.display()
        )));
    }
    start(starter, &script)?;
    let told = if options.engine.waits() { "flown" } else { "submitted" };
    let (file, folder) = (options.plan.display(), options.out.display());
    Ok(Outcome::done(format!(
        "{} {told}; next: quadlab campaign report {file} --parts {folder}\n",
        shards(plan.shards)
    )))
}

/// Puts a plan into the folder of its parts. Nothing is overwritten there: tasks of an earlier one may still read it.
fn put_plan(plan: &Plan, folder: &Path) -> anyhow::Result<()> {
    let path = folder.join(PLAN);
    if path.exists() {
        match Plan::read(&path) {
            Ok(own) if own == *plan => (),
            Ok(own) if own.campaign_sha256 == plan.campaign_sha256 => anyhow::bail!(
                "{}: is a plan of this campaign in {}, not {}; submit that one, or choose another folder with --out",
                path.display(),
                shards(own.shards),
                plan.shards
            ),
            _ => anyhow::bail!(
                "{}: is there already and is not the plan of this campaign; choose another folder with --out",
                path.display()
            ),
        }
    }
    campaign::claim(plan, folder)?;
    if !path.exists() {
        report::write_atomic(&path, plan.to_json())?;
    }
    Ok(())
}

/// Starts a script and waits until its program ends.
fn start(starter: &[&str], script: &Path) -> anyhow::Result<()> {
    let Some((program, arguments)) = starter.split_first() else { return Ok(()) };
    let shown = script.display();
    let ran = Command::new(program).args(arguments).arg(script).output().map_err(|why| {
        anyhow::anyhow!("{program}: cannot be started: {why}; the script for it is {shown}")
    })?;
    if ran.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&ran.stderr);
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it says nothing");
    anyhow::bail!("{program} {shown}: {}: {last}", ran.status)
}

/// What every engine runs, for each shard.
struct Task {
    program: PathBuf,
    plan: PathBuf,
    parts: PathBuf,
    shards: u64,
}

impl Task {
    /// Program and arguments but for the shard.
    fn words(&self) -> [String; 6] {
        let [program, plan, parts] =
            [&self.program, &self.plan, &self.parts].map(|path| path.display().to_string());
        [program, "campaign".into(), "run".into(), plan, "--out".into(), parts]
    }

    /// As a line of a shell.
    fn command(&self) -> String {
        self.words().map(|word| format!("'{}'", word.replace('\'', r"'\''"))).join(" ")
    }

    fn script(&self, engine: Engine, image: Option<&str>) -> String {
        let (command, last, shards) = (self.command(), self.shards - 1, self.shards);
        match engine {
            Engine::Local => format!("#!/bin/sh\nexec {command}\n"),
            Engine::Parallel => {
                format!(
                    "#!/bin/sh\nseq 0 {last} | RAYON_NUM_THREADS=1 parallel -q --halt soon,fail=10% {command} --shard {{}}\n"
                )
            }
            Engine::Slurm => format!(
                "#!/bin/sh\n#SBATCH --job-name=campaign\n#SBATCH --array=0-{last}\n#SBATCH --cpus-per-task=1\n\
                 #SBATCH --output='{}/slurm-%a.log'\nRAYON_NUM_THREADS=1 exec {command}\n",
                self.parts.display()
            ),
            Engine::Hq => {
                let words = serde_json::json!(self.words());
                format!(
                    "import os, sys\nfrom hyperqueue import Client, Job, LocalCluster\n\
                     job = Job(max_fails=None)\nfor shard in range({shards}):\n    \
                     job.program({words} + [\"--shard\", str(shard)], env={{\"RAYON_NUM_THREADS\": \"1\"}}, stdout=None, stderr=None)\n\
                     def flown(client):\n    \
                     return client.wait_for_jobs([client.submit(job)], raise_on_error=False)\n\
                     if os.environ.get(\"HQ_SERVER_DIR\"):\n    \
                     sys.exit(0 if flown(Client(os.environ[\"HQ_SERVER_DIR\"])) else \"some shards failed\")\n\
                     with LocalCluster() as cluster:\n    cluster.start_worker()\n    \
                     done = flown(cluster.client())\nsys.exit(0 if done else \"some shards failed\")\n"
                )
            }
            Engine::K8s => {
                let [_, arguments @ ..] = self.words();
                let (words, parts) = (serde_json::json!(arguments), serde_json::json!(self.parts));
                let image = serde_json::json!(image.unwrap_or_default());
                format!(
                    "apiVersion: batch/v1\nkind: Job\nmetadata: {{ generateName: campaign- }}\nspec:\n  completionMode: Indexed\n  \
                     completions: {shards}\n  parallelism: {shards}\n  template:\n    spec:\n      restartPolicy: OnFailure\n      \
                     containers:\n        - name: quadlab\n          image: {image}\n          command: [quadlab]\n          \
                     args: {words}\n          volumeMounts: [{{ name: parts, mountPath: {parts} }}]\n      \
                     volumes: [{{ name: parts, hostPath: {{ path: {parts} }} }}]\n"
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task() -> Task {
        Task { program: "/opt/quad lab".into(), plan: "/a/p.json".into(), parts: "/a/it's".into(), shards: 7 }
    }

    /// Twenty lines at most, and every shard in them.
    #[test]
    fn glue_is_short_and_names_every_shard() {
        for engine in Engine::value_variants() {
            let script = task().script(*engine, Some("quadlab:1"));
            assert!(script.lines().count() <= 20, "{engine:?}");
            let all = match engine {
                Engine::Local => "exec '/opt/quad lab' 'campaign' 'run'",
                Engine::Hq => "range(7)",
                Engine::Slurm => "--array=0-6",
                Engine::K8s => "completions: 7",
                Engine::Parallel => "seq 0 6 |",
            };
            assert!(script.contains(all), "{script}");
        }
    }

    #[test]
    fn a_shell_reads_the_paths_as_they_are() {
        assert!(task().command().ends_with(r"'/a/it'\''s'"), "{}", task().command());
    }
}
