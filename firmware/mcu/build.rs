//! What a chip without files has to have built in: the gains, and where its memory is.
//!
//! `QUADLAB_GAINS` names the gains file, from the top folder of the repository or absolute; the thesis' if it is not set.
#![forbid(unsafe_code)]

use std::error::Error;
use std::path::{Path, PathBuf};

use craft::image::{MAX_IMAGE_LEN, encode};
use gains_file::Gains;
use sha2::{Digest, Sha256};

const THESIS: &str = "host-sim/model/vehicles/f330-gains.toml";

fn main() {
    if let Err(error) = run() {
        println!("cargo::error={error}");
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    println!("cargo::rerun-if-env-changed=QUADLAB_GAINS");
    let file = std::env::var("QUADLAB_GAINS").unwrap_or_else(|_| THESIS.to_owned());
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(&file);
    println!("cargo::rerun-if-changed={}", path.display());
    std::fs::write(out.join("gains.image"), image(&path)?)?;
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

fn image(path: &Path) -> Result<Vec<u8>, Box<dyn Error>> {
    let gains = Gains::read(path)?;
    let hash = Sha256::digest(std::fs::read(path)?).into();
    let mut buffer = [0; MAX_IMAGE_LEN];
    let image = encode(&gains.config, &hash, &mut buffer).ok_or("the gains do not fit into an image")?;
    Ok(image.to_vec())
}
