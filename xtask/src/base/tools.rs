//! The programs that developer commands use besides cargo: how to find each and how to install it.

use std::process::Command;

use crate::base::process::{cargo, output_of};

/// An outside program.
pub(crate) struct Tool {
    pub(crate) name: &'static str,
    /// The command that prints its version.
    version: &'static [&'static str],
    /// The line that installs it on Debian, Ubuntu or any machine with rustup.
    pub(crate) install: &'static str,
}

/// Formats sources.
pub(crate) const RUSTFMT: Tool = Tool {
    name: "rustfmt",
    version: &["cargo", "fmt", "--version"],
    install: "rustup component add rustfmt",
};
/// Finds suspicious code.
pub(crate) const CLIPPY: Tool = Tool {
    name: "clippy",
    version: &["cargo", "clippy", "--version"],
    install: "rustup component add clippy",
};
/// Runs tests in parallel, each in its own process.
pub(crate) const NEXTEST: Tool = Tool {
    name: "cargo-nextest",
    version: &["cargo", "nextest", "--version"],
    install: "cargo install --locked cargo-nextest",
};
/// Looks for inputs that do harm, guided by which code they reach. It needs a nightly compiler.
pub(crate) const CARGO_FUZZ: Tool = Tool {
    name: "cargo-fuzz",
    version: &["rustup", "run", "nightly", "cargo", "fuzz", "--version"],
    install: "rustup toolchain install nightly && cargo install --locked cargo-fuzz",
};
/// Holds dependencies to `deny.toml`.
pub(crate) const CARGO_DENY: Tool = Tool {
    name: "cargo-deny",
    version: &["cargo", "deny", "--version"],
    install: "cargo install --locked cargo-deny",
};
/// Knows what a bill of materials has to say of each package.
pub(crate) const CARGO_CYCLONEDX: Tool = Tool {
    name: "cargo-cyclonedx",
    version: &["cargo", "cyclonedx", "--version"],
    install: "cargo install --locked cargo-cyclonedx",
};
/// Runs programs on an abstract machine that knows undefined behaviour.
pub(crate) const MIRI: Tool = Tool {
    name: "miri",
    version: &["rustup", "run", "nightly", "cargo", "miri", "--version"],
    install: "rustup toolchain install nightly -c miri,rust-src",
};
/// Changes the code a little, and looks whether a test notices.
pub(crate) const CARGO_MUTANTS: Tool = Tool {
    name: "cargo-mutants",
    version: &["cargo", "mutants", "--version"],
    install: "cargo install --locked cargo-mutants",
};
/// Knows which files belong to the project.
pub(crate) const GIT: Tool =
    Tool { name: "git", version: &["git", "--version"], install: "apt-get install --yes git" };
/// Makes web pages of the book. Without its server and its watcher it builds in half the time.
pub(crate) const MDBOOK: Tool = Tool {
    name: "mdbook",
    version: &["mdbook", "--version"],
    install: "cargo install --locked mdbook --no-default-features --features search",
};
/// Counts instructions.
pub(crate) const VALGRIND: Tool =
    Tool { name: "valgrind", version: &["valgrind", "--version"], install: "apt-get install --yes valgrind" };
/// Lets others in over ssh. It has no option for its version and lies outside most users' path.
pub(crate) const SSHD: Tool = Tool {
    name: "sshd",
    version: &["sh", "-c", "test -x /usr/sbin/sshd && echo /usr/sbin/sshd"],
    install: "apt-get install --yes openssh-server",
};
/// The browser in which pages are tested.
pub(crate) const CHROMIUM: Tool = Tool {
    name: "chromium",
    version: &["chromium", "--version"],
    install: "apt-get install --yes --no-install-recommends chromium",
};
/// Steers that browser.
pub(crate) const CHROMEDRIVER: Tool = Tool {
    name: "chromedriver",
    version: &["chromedriver", "--version"],
    install: "apt-get install --yes --no-install-recommends chromium-driver",
};
/// Brings the type checker below.
pub(crate) const NPM: Tool = Tool {
    name: "npm",
    version: &["npm", "--version"],
    install: "apt-get install --yes --no-install-recommends npm",
};
/// Checks the types of the page's scripts. A newer one finds more: the version is raised by hand.
pub(crate) const TYPESCRIPT: Tool = Tool {
    name: "tsc",
    version: &["tsc", "--version"],
    install: "npm install --global --no-fund --no-audit typescript@7.0.2",
};
/// The Python that has them, in the workspace's top folder.
pub(crate) const PEERS_PYTHON: &str = "target/peers/bin/python";
/// Other people's simulators and design tools, in which exported models are flown, and what builds and tests the Python package.
pub(crate) const PEERS: Tool = Tool {
    name: "mujoco, rotorpy, drake, python-control and Python's tools",
    version: &[
        PEERS_PYTHON,
        "-c",
        "import control, gymnasium, hyperqueue, ipykernel, matplotlib, maturin, mujoco, mypy, nbclient, pandas, polars, pyarrow, pydrake, pytest, rotorpy; \
         print(mujoco.__version__, control.__version__, pandas.__version__)",
    ],
    install: "python3 tests/peers/tools/install.py target/peers",
};
/// The free relative of MATLAB, which exported models answer in.
pub(crate) const OCTAVE: Tool = Tool {
    name: "octave",
    version: &["octave-cli", "--version"],
    install: "apt-get install --yes --no-install-recommends octave octave-control",
};
/// An engine of clusters; with its daemons, a node of its own flies campaigns in a test.
pub(crate) const SLURM: Tool = Tool {
    name: "slurm",
    version: &["slurmctld", "-V"],
    install: "apt-get install --yes --no-install-recommends slurmctld slurmd slurm-client",
};
/// Runs shards of campaigns.
pub(crate) const PARALLEL: Tool = Tool {
    name: "parallel",
    version: &["parallel", "--version"],
    install: "apt-get install --yes --no-install-recommends parallel",
};
/// Name of the program that starts instruction-count benches under valgrind. Its version has to be that
/// of the library `gungraun`, so its installation line depends on the lock file.
pub(crate) const GUNGRAUN_RUNNER: &str = "gungraun-runner";

impl Tool {
    /// A tool by name, the command that prints its version, and the line that installs it.
    pub(crate) const fn of(
        name: &'static str,
        version: &'static [&'static str],
        install: &'static str,
    ) -> Self {
        Self { name, version, install }
    }

    /// First line of what the tool says of its version; nothing when it is not installed.
    pub(crate) fn found(&self) -> Option<String> {
        let (program, arguments) = self.version.split_first()?;
        let mut command =
            if *program == "cargo" { cargo(arguments) } else { command_with(program, arguments) };
        first_line(&mut command)
    }
}

/// Version of the installed `gungraun-runner`.
pub(crate) fn gungraun_runner_version() -> Option<String> {
    let line = first_line(&mut command_with(GUNGRAUN_RUNNER, &["--version"]))?;
    line.split_whitespace().last().map(|version| version.trim_start_matches('v').to_owned())
}

/// The line that installs the runner that belongs to a version of `gungraun`.
pub(crate) fn gungraun_runner_install(version: &str) -> String {
    format!("cargo install {GUNGRAUN_RUNNER} --version ={version}")
}

fn command_with(program: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(arguments);
    command
}

fn first_line(command: &mut Command) -> Option<String> {
    let text = output_of(command)?;
    text.lines().map(str::trim).find(|line| !line.is_empty()).map(ToOwned::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_does_not_exist_is_not_found() {
        let missing = Tool { name: "none", version: &["no-such-program-here", "--version"], install: "" };
        assert_eq!(missing.found(), None);
        let refuses = Tool { name: "none", version: &["cargo", "no-such-subcommand"], install: "" };
        assert_eq!(refuses.found(), None);
    }

    #[test]
    fn cargo_is_found_by_its_version() {
        let cargo = Tool { name: "cargo", version: &["cargo", "--version"], install: "" };
        assert!(cargo.found().is_some_and(|line| line.starts_with("cargo 1.")));
    }
}
