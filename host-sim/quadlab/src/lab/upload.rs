//! Files that are dropped on the page: into the folder, under their own names, whole or not at all.

use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

use axum::body::{Body, Bytes};
use futures_util::StreamExt as _;
use tempfile::NamedTempFile;
use tokio::sync::mpsc;

use super::refused::Refused;
use super::session::Session;
use crate::cli::flights::has_flight_ending;
use crate::cli::model_files::VEHICLE;

/// The longest file that is taken, bytes.
const LONGEST: u64 = 4 << 30;
/// Letters of a name at most, as of most file systems.
const LONGEST_NAME: usize = 200;

/// Takes a file under a name; one that is there already is not replaced.
pub(super) async fn take(session: Arc<Session>, name: String, body: Body) -> Result<(), Refused> {
    check_name(&name)?;
    let target = session.folder.join(&name);
    // A link that leads nowhere is there, too.
    if target.symlink_metadata().is_ok() {
        return Err(Refused::new(format!("{name}: is in the folder already: rename one of the two")));
    }
    let (chunks, arriving) = mpsc::channel(16);
    let writing = tokio::task::spawn_blocking(move || write(&session, &name, &target, arriving));
    let mut body = body.into_data_stream();
    let whole = loop {
        let Some(chunk) = body.next().await else { break true };
        let Ok(chunk) = chunk else { break false };
        if chunks.send(Some(chunk)).await.is_err() {
            break false;
        }
    };
    // Where the connection ends early the writer hears of no end, and what it has goes away.
    if whole {
        let _ = chunks.send(None).await;
    }
    drop(chunks);
    writing.await.unwrap_or_else(|_| Err(Refused::new("the file could not be kept: a bug of quadlab")))
}

/// Writes what arrives beside its place until the end is told.
fn write(
    session: &Session,
    name: &str,
    target: &Path,
    mut arriving: mpsc::Receiver<Option<Bytes>>,
) -> Result<(), Refused> {
    let mut file = session.temporary()?;
    let mut length = 0;
    loop {
        match arriving.blocking_recv() {
            Some(Some(chunk)) => {
                length += chunk.len() as u64;
                if length > LONGEST {
                    let most = LONGEST >> 30;
                    return Err(Refused::new(format!(
                        "{name}: is longer than {most} GB: put it into the folder"
                    )));
                }
                file.write_all(&chunk)?;
            }
            Some(None) => return keep(file, name, target),
            None => return Err(Refused::new(format!("{name}: has not arrived whole: drop it again"))),
        }
    }
}

fn check_name(name: &str) -> Result<(), Refused> {
    let is_one = Path::new(name).file_name().is_some_and(|own| own == name);
    let is_plain =
        !name.starts_with('.') && !name.contains(['/', '\\', ':']) && !name.contains(char::is_control);
    if is_one && is_plain && name.len() <= LONGEST_NAME {
        return Ok(());
    }
    Err(Refused::new(format!("{name:?}: is no name that a file of the folder can have: rename it")))
}

/// Whether a file of this name says how flights are read.
pub(super) fn is_settings(name: &str) -> bool {
    [VEHICLE, flights::MAP_FILE].contains(&name) || name.ends_with(".use.toml")
}

/// Puts a file that has arrived whole in its place, if it is one that the lab reads.
fn keep(file: NamedTempFile, name: &str, target: &Path) -> Result<(), Refused> {
    file.as_file().sync_all()?;
    if !is_settings(name) && !has_flight_ending(Path::new(name)) && logs::format_of(file.path()).is_none() {
        return Err(Refused::new(format!(
            "{name}: is neither a flight (CSV) nor a log of a format that quadlab reads"
        )));
    }
    file.persist_noclobber(target)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::check_name;

    #[test]
    fn a_name_stays_within_the_folder() {
        for good in ["A.csv", "flight 3 (windy).ulg", "köln.bbl", "vehicle.toml"] {
            assert!(check_name(good).is_ok(), "{good}");
        }
        let long = "a".repeat(201);
        for bad in
            ["", ".", "..", "../A.csv", "a/b.csv", r"a\b.csv", "C:x.csv", ".profile", "a\nb.csv", &long]
        {
            assert!(check_name(bad).is_err(), "{bad:?}");
        }
    }
}
