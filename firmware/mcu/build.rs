//! What a chip without files has to have built in: the gains, and where its memory is.
//!
//! `QUADLAB_GAINS` names the gains file and `QUADLAB_VEHICLE` the vehicle file, from the top folder
//! of the repository or absolute; the thesis' if neither is set. `QUADLAB_KEY` names the link's key
//! file, mode 0600; without it the link is open.
#![forbid(unsafe_code)]

use std::error::Error;
use std::path::{Path, PathBuf};

use craft::image::{MAX_IMAGE_LEN, encode};
use gains_file::CraftFiles;

/// Variables, and the thesis' files.
const FILES: [(&str, &str); 2] = [
    ("QUADLAB_GAINS", "host-sim/model/vehicles/f330-gains.toml"),
    ("QUADLAB_VEHICLE", "host-sim/model/vehicles/f330.toml"),
];

fn main() {
    if let Err(error) = run() {
        println!("cargo::error={error}");
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let [gains, vehicle] = FILES.map(|(variable, thesis)| {
        println!("cargo::rerun-if-env-changed={variable}");
        let file = std::env::var(variable).unwrap_or_else(|_| thesis.to_owned());
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(&file);
        println!("cargo::rerun-if-changed={}", path.display());
        path
    });
    if std::env::var_os("QUADLAB_GAINS").is_some() != std::env::var_os("QUADLAB_VEHICLE").is_some() {
        return Err("gains belong to a vehicle: set QUADLAB_GAINS and QUADLAB_VEHICLE, or neither".into());
    }
    std::fs::write(out.join("gains.image"), image(&gains, &vehicle)?)?;
    std::fs::write(out.join("link_key.rs"), key()?)?;
    if std::env::var("CARGO_CFG_TARGET_OS")? == "none" {
        let board = if std::env::var_os("CARGO_FEATURE_STM32F405").is_some() { "stm32f405" } else { "mps2" };
        let memory = format!("memory/{board}.x");
        println!("cargo::rerun-if-changed={memory}");
        std::fs::copy(&memory, out.join("memory.x"))?;
        println!("cargo::rustc-link-search={}", out.display());
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
        // Sections in the file need no alignment to pages: there are none.
        println!("cargo::rustc-link-arg-bins=--nmagic");
    }
    Ok(())
}

/// The link's key as an expression.
fn key() -> Result<String, Box<dyn Error>> {
    println!("cargo::rerun-if-env-changed=QUADLAB_KEY");
    let Some(file) = std::env::var_os("QUADLAB_KEY") else { return Ok("None".into()) };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(file);
    println!("cargo::rerun-if-changed={}", path.display());
    Ok(format!("Some(proto::Key::new({:?}))", proto_files::read_key_bytes(&path)?))
}

fn image(gains: &Path, vehicle: &Path) -> Result<Vec<u8>, Box<dyn Error>> {
    let files = CraftFiles::read(gains, vehicle, None)?.with_battery_levels(None);
    let mut buffer = [0; MAX_IMAGE_LEN];
    let image =
        encode(&files.config, &files.sha256, &mut buffer).ok_or("the gains do not fit into an image")?;
    Ok(image.to_vec())
}
