//! The craft's program for its processor: `com` for ARM Linux (armv7, hard float).
//!
//! A rustup toolchain that has the target builds it; otherwise Debian's cross packages do, with the standard library from
//! source (`rust-web-src`). Either way the linker is Debian's `arm-linux-gnueabihf-gcc`.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::process::{cargo, output_of, shown, succeeds};
use crate::workspace::{self, Workspace};

const TARGET: &str = "armv7-unknown-linux-gnueabihf";
const LINKER: &str = "arm-linux-gnueabihf-gcc";
/// Debian's compiler and the source of its standard library.
const DEBIAN: [&str; 3] = ["/usr/bin/cargo", "/usr/bin/rustc", "/usr/lib/rustlib/src/rust/library"];

/// What is installed where rustup has no standard library for the target.
pub(crate) const INSTALL: &str = "apt-get install --yes rustc-web cargo-web rust-web-src gcc-arm-linux-gnueabihf libc6-dev-armhf-cross qemu-user";

/// Why it cannot be built here, with the line that mends it.
pub(crate) fn obstacle() -> Option<String> {
    let linker = output_of(Command::new(LINKER).arg("--version")).is_some();
    let compiler = rustup_has_it() || DEBIAN.iter().all(|path| Path::new(path).exists());
    (!linker || !compiler).then(|| format!("nothing here builds for {TARGET}: {INSTALL}"))
}

fn rustup_has_it() -> bool {
    let library = output_of(Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]));
    library.is_some_and(|folder| Path::new(folder.trim()).is_dir())
}

/// Builds `com`, release; where it is.
pub(crate) fn build() -> Result<PathBuf> {
    if let Some(obstacle) = obstacle() {
        bail!(obstacle);
    }
    let mut command = if rustup_has_it() { cargo(["build"]) } else { debian() };
    command.args(["--release", "--package", "com", "--bin", "com", "--target", TARGET]);
    command.env("CARGO_TARGET_ARMV7_UNKNOWN_LINUX_GNUEABIHF_LINKER", LINKER);
    ensure!(succeeds(&mut command)?, "`{}` failed", shown(&command));
    let target = Workspace::load()?.metadata.target_directory.into_std_path_buf();
    let program = target.join(TARGET).join("release/com");
    program.exists().then_some(program).context("cargo built no com")
}

fn debian() -> Command {
    let [cargo, rustc, _] = DEBIAN;
    let mut command = Command::new(cargo);
    command.args(["build", "-Zbuild-std=std,panic_abort"]).current_dir(workspace::root());
    // Building the standard library is a nightly option; Debian's compiler is told that it may.
    command.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", rustc).env_remove("RUSTUP_TOOLCHAIN");
    command
}
