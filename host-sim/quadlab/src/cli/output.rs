//! What a command leaves: text on standard output, files, and whether what it checks holds.

use std::path::{Path, PathBuf};

use report::Provenance;
use serde::Serialize;

use diagnosis::workflow::{LoadedFlight, sha256};

use crate::cli::invocation;

/// What a command that ran hands back.
pub(crate) struct Outcome {
    /// For standard output, with its last line break.
    pub(crate) text: String,
    /// Whether what the command checks holds.
    pub(crate) holds: bool,
    /// Why inputs were refused while the job was done with the others, one line each.
    pub(crate) refused: Vec<String>,
}

impl Outcome {
    /// The job is done.
    pub(crate) fn done(text: String) -> Self {
        Self { text, holds: true, refused: Vec::new() }
    }

    /// The job is done; its result is one JSON document.
    pub(crate) fn json(document: &impl Serialize) -> anyhow::Result<Self> {
        Ok(Self::done(serde_json::to_string_pretty(document)? + "\n"))
    }
}

/// An output file that would take the place of an input.
#[derive(Debug, thiserror::Error)]
#[error("{}: is read by this command and would be overwritten; give another name for the output", .0.display())]
pub(crate) struct OverwritesInput(pub(crate) PathBuf);

/// An output file that is there already.
#[derive(Debug, thiserror::Error)]
#[error("{}: already exists; give --force to overwrite it, or choose another name", .0.display())]
pub(crate) struct AlreadyThere(PathBuf);

/// Two outputs that are one file.
#[derive(Debug, thiserror::Error)]
#[error("{}: is given for two outputs; give each a name of its own", .0.display())]
struct SameOutput(PathBuf);

/// How a command that writes files gives its result.
#[derive(clap::Args, Clone, Copy)]
pub(crate) struct OutputOptions {
    /// Overwrite existing output files
    #[arg(long)]
    force: bool,

    /// Print one JSON document on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

impl OutputOptions {
    /// Checks, before any work, that outputs have a place and take the place of no input, of no other output, and of no other
    /// file unless forced.
    pub(crate) fn check<'a>(
        self,
        outputs: impl IntoIterator<Item = &'a PathBuf>,
        inputs: &[&PathBuf],
    ) -> anyhow::Result<()> {
        let mut places = Vec::new();
        for output in outputs {
            report::check_writable(output)?;
            // Of a device or a pipe each output takes its part.
            if let Some(place) = place_of(output) {
                if places.contains(&place) {
                    return Err(SameOutput(output.clone()).into());
                }
                places.push(place);
            }
            let Ok(there) = output.canonicalize() else { continue };
            if inputs.iter().any(|input| input.canonicalize().is_ok_and(|input| input == there)) {
                return Err(OverwritesInput(output.clone()).into());
            }
            // A device or a pipe holds nothing that could be lost.
            if there.is_file() && !self.force {
                return Err(AlreadyThere(output.clone()).into());
            }
        }
        Ok(())
    }
}

/// Where a file is or will be, whatever way leads there; nothing of what is no file.
fn place_of(output: &Path) -> Option<PathBuf> {
    if let Ok(there) = output.canonicalize() {
        return there.is_file().then_some(there);
    }
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(folder.canonicalize().ok()?.join(output.file_name()?))
}

/// The footer of a page: command, version and the files behind it.
pub(crate) fn provenance<'a>(
    files: &[&Path],
    flights: impl IntoIterator<Item = &'a LoadedFlight>,
) -> Provenance {
    let hashed = |path: &Path, hash: &str| report::InputFile {
        path: path.display().to_string(),
        hash: format!("sha256:{hash}"),
    };
    let mut inputs: Vec<_> = files
        .iter()
        .map(|path| hashed(path, &std::fs::read(path).map(|bytes| sha256(&bytes)).unwrap_or_default()))
        .collect();
    inputs.extend(flights.into_iter().map(|flight| hashed(&flight.path, &flight.sha256)));
    let arguments: Vec<String> =
        invocation::words().iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let (program, rest) = arguments.split_first().map_or(("quadlab", [].as_slice()), |(p, r)| {
        (Path::new(p).file_name().and_then(|n| n.to_str()).unwrap_or("quadlab"), r)
    });
    Provenance {
        command_line: std::iter::once(program)
            .chain(rest.iter().map(String::as_str))
            .collect::<Vec<_>>()
            .join(" "),
        version: format!("quadlab {}", env!("CARGO_PKG_VERSION")),
        inputs,
        ..Provenance::default()
    }
}
