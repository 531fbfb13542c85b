//! The Python package, tested from Python by tests of its own.
//!
//! The compiled module is the one that cargo built for this test; with `QUADLAB_WHEEL` set, as at night, maturin builds a wheel, which
//! compiles everything once more. Where Python's packages are not installed (`cargo xtask setup` puts them into `target/peers`), the story
//! is skipped by name.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

/// The folder of the package.
fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The root of the repository.
fn root() -> PathBuf {
    package().join("../..").canonicalize().unwrap()
}

/// Where cargo puts what it builds for tests.
fn built() -> PathBuf {
    std::env::current_exe().unwrap().parent().unwrap().to_owned()
}

/// Runs a program to its end: it succeeds, or the test fails with all that it said.
fn succeeds(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()).concat();
    assert!(output.status.success(), "{command:?}\n{said}");
    said
}

/// Installs a wheel that maturin builds.
fn install_wheel(bin: &Path, folder: &Path) -> PathBuf {
    let (wheels, installed) = (folder.join("wheels"), folder.join("installed"));
    let python = bin.join("python");
    let build = ["build", "--quiet", "--offline", "--profile", "dev", "--interpreter"];
    let mut maturin = Command::new(bin.join("maturin"));
    succeeds(maturin.args(build).arg(&python).arg("--out").arg(&wheels).current_dir(package()));
    let wheel = std::fs::read_dir(&wheels).unwrap().next().unwrap().unwrap().path();
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    assert!(
        name.starts_with("quadlab-") && name.contains("-cp310-abi3-"),
        "one wheel for every Python from 3.10 on: {name}"
    );
    let install = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target"];
    succeeds(Command::new(&python).args(install).arg(&installed).arg(&wheel));
    installed
}

/// Puts the sources and the compiled module together.
fn put_together(folder: &Path) -> PathBuf {
    let installed = folder.join("installed");
    let own = installed.join("quadlab");
    std::fs::create_dir_all(&own).unwrap();
    for source in std::fs::read_dir(package().join("python/quadlab")).unwrap() {
        let source = source.unwrap().path();
        if source.is_file() {
            std::fs::copy(&source, own.join(source.file_name().unwrap())).unwrap();
        }
    }
    let module = [built(), built().join("..")].map(|folder| folder.join("lib_quadlab.so"));
    let module = module.iter().find(|module| module.exists()).expect("cargo has built the module");
    std::fs::copy(module, own.join("_quadlab.abi3.so")).unwrap();
    installed
}

#[test]
fn the_package_passes_its_own_tests() {
    let bin = root().join("target/peers/bin");
    let python = bin.join("python");
    if !bin.join("maturin").exists() {
        println!(
            "SKIPPED: maturin is not in {}: python3 tests/peers/tools/install.py target/peers",
            bin.display()
        );
        return;
    }
    let folder = TempDir::new().unwrap();
    let installed = match std::env::var_os("QUADLAB_WHEEL") {
        Some(_) => install_wheel(&bin, folder.path()),
        None => put_together(folder.path()),
    };
    let within = |arguments: &[&str]| {
        let mut command = Command::new(&python);
        command.args(arguments).current_dir(package());
        command.env("PYTHONPATH", &installed).env("PYTHONDONTWRITEBYTECODE", "1");
        command.env("QUADLAB_PROGRAM", built().join("../quadlab"));
        if let Ok(shared) = root().join("../shared/data").canonicalize() {
            command.env("QUADLAB_SHARED_DATA", shared);
        }
        command
    };
    succeeds(&mut within(&["generate.py", "--check"]));
    let cache = folder.path().join("mypy").display().to_string();
    let types = ["-m", "mypy", "--config-file", "pyproject.toml", "--cache-dir", &cache, "-p", "quadlab"];
    succeeds(&mut within(&types));
    let said = succeeds(&mut within(&["-m", "pytest", "-q", "-p", "no:cacheprovider", "-rs", "tests"]));
    println!("{said}");
    assert!(said.contains(" passed"), "{said}");
}
