//! A recording in progress.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use proto::Pose;

use super::disk_writer::{DiskWriter, Growing, MOST_WAITING, Queued};
use super::entry::{Entry, Level, TOPICS};
use super::error::{RecordError, mcap_error};
use super::log::begin_mcap;
use super::scene::{Trail, is_known};

/// A recording in progress. A thread of its own writes it: nothing here waits for a disk.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    disk: DiskWriter,
    channels: Vec<u16>,
    sequences: [u32; TOPICS.len()],
    trail: Trail,
    /// Wall clock at the ground's time zero, ns since 1970.
    epoch_ns: u64,
    told: Told,
}

/// What people were told of the disk last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Told {
    /// It takes everything; this many messages were left out by then.
    Fine(u64),
    /// It takes nothing; messages wait. So many were left out before.
    Waits(u64),
    /// Messages are left out. So many were before.
    Loses(u64),
}

/// The file that a recording of this name grows in.
pub fn part_of(name: &Path) -> PathBuf {
    with_ending(name, ".mcap.part")
}

pub(super) fn with_ending(name: &Path, ending: &str) -> PathBuf {
    let mut path = name.as_os_str().to_owned();
    path.push(ending);
    path.into()
}

impl Recorder {
    /// Begins `NAME.mcap.part`; its first line of `/log` says what it is `about`.
    ///
    /// # Errors
    /// A recording of that name that exists, finished or not; a folder that cannot be written.
    pub fn begin(name: &Path, epoch_ns: u64, about: &BTreeMap<String, String>) -> Result<Self, RecordError> {
        Self::begin_with(name, epoch_ns, about, MOST_WAITING)
    }

    /// As [`Self::begin`]; no more than so many bytes wait for the disk.
    fn begin_with(
        name: &Path,
        epoch_ns: u64,
        about: &BTreeMap<String, String>,
        most_waiting: usize,
    ) -> Result<Self, RecordError> {
        let path = part_of(name);
        if let Some(there) = [with_ending(name, ".mcap"), path.clone()].into_iter().find(|p| p.exists()) {
            return Err(RecordError::Exists(there));
        }
        if let Some(folder) = name.parent().filter(|p| !p.as_os_str().is_empty()) {
            fs::create_dir_all(folder).map_err(|source| RecordError::File {
                path: folder.into(),
                what: "make the folder",
                source,
            })?;
        }
        let file = File::create_new(&path).map_err(|source| RecordError::File {
            path: path.clone(),
            what: "begin the recording",
            source,
        })?;
        let refuse = |source| mcap_error(&path, "begin the recording")(source);
        let options = WriteOptions::new().use_chunks(false).disable_seeking(true);
        let (mut log, channels) = begin_mcap(NoSeek::new(Growing::new(file)), options).map_err(refuse)?;
        log.flush().map_err(refuse)?;
        let disk = DiskWriter::start(log, most_waiting).map_err(|source| refuse(source.into()))?;
        let mut recorder = Self {
            path: path.clone(),
            disk,
            channels,
            sequences: [0; TOPICS.len()],
            trail: Trail::default(),
            epoch_ns,
            told: Told::Fine(0),
        };
        if !about.is_empty() {
            let words: Vec<String> = about.iter().map(|(name, value)| format!("{name} {value}")).collect();
            recorder.write(0, &Entry::Log(Level::Info, &words.join(", ")));
        }
        Ok(recorder)
    }

    /// Records something at this time of the ground's clock. It is with the system within milliseconds, or as soon as the disk takes it.
    pub fn write(&mut self, now_us: u64, entry: &Entry<'_>) {
        self.put(now_us, entry);
        if let Entry::Pose(timed) = entry
            && is_known(&timed.pose)
        {
            self.show(now_us, timed.pose);
        }
    }

    /// Where the craft is, for those who look at it in space.
    fn show(&mut self, now_us: u64, pose: Pose) {
        self.put(now_us, &Entry::Transform(&pose));
        if let Some(track) = self.trail.push(now_us, pose).map(<[Pose]>::to_vec) {
            self.put(now_us, &Entry::Track(&track));
        }
    }

    fn put(&mut self, now_us: u64, entry: &Entry<'_>) {
        let channel = entry.channel();
        let log_time = self.epoch_ns.saturating_add(now_us.saturating_mul(1000));
        let header = MessageHeader {
            channel_id: self.channels.get(channel).copied().unwrap_or_default(),
            sequence: self.sequences[channel],
            log_time,
            publish_time: log_time,
        };
        self.sequences[channel] = self.sequences[channel].wrapping_add(1);
        self.disk.push(Queued { header, data: entry.json(log_time).into_bytes() });
    }

    /// What people should be told of the disk since they were last.
    pub fn news(&mut self) -> Option<(Level, String)> {
        let (trouble, left_out) = (self.disk.trouble(), self.disk.left_out());
        let (Told::Fine(before) | Told::Waits(before) | Told::Loses(before)) = self.told;
        let path = self.path.display();
        let (told, level, text) = match (self.told, trouble) {
            (Told::Fine(_) | Told::Waits(_), why) if left_out > before => {
                let why = why.unwrap_or_else(|| "its disk is too slow".into());
                (
                    Told::Loses(before),
                    Level::Error,
                    format!("messages are missing from the recording: {path}: {why}"),
                )
            }
            (Told::Fine(_), Some(why)) => {
                let text = format!("the recording waits for its disk, nothing is lost yet: {path}: {why}");
                (Told::Waits(before), Level::Warning, text)
            }
            (Told::Waits(_), None) => {
                (Told::Fine(before), Level::Info, "the recording goes on, nothing was lost".into())
            }
            (Told::Loses(_), None) if self.disk.is_idle() => {
                let text = format!("the recording goes on, messages lost: {}", left_out - before);
                (Told::Fine(left_out), Level::Warning, text)
            }
            _ => return None,
        };
        self.told = told;
        Some((level, text))
    }

    /// Until all that was recorded is with the system.
    #[cfg(test)]
    pub(super) fn wait_for_disk(&self) {
        while !self.disk.is_idle() {
            std::thread::sleep(std::time::Duration::from_micros(10));
        }
    }

    /// The file that grows.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Ends the recording when everything is with the system.
    ///
    /// # Errors
    /// Messages that are missing: the disk was full or too slow, or still is.
    pub fn close(mut self) -> Result<(), RecordError> {
        self.disk.close().map_err(mcap_error(&self.path, "write to the recording"))?;
        match self.disk.left_out() {
            0 => Ok(()),
            messages => Err(RecordError::LeftOut { path: self.path.clone(), messages }),
        }
    }
}

/// One that nobody asks for errors is closed all the same.
impl Drop for Recorder {
    fn drop(&mut self) {
        let _ = self.disk.close();
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::path::Path;
    use std::process::Command;
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    use super::super::finish::finish;
    use super::*;

    /// Names the folder of a small file system to a test that runs in it.
    const SMALL_DISK: &str = "QUADLAB_SMALL_DISK";
    /// Most that waits for the disk in these tests, bytes: a hundred lines.
    const WAITING: usize = 110_000;

    /// Lines of a kilobyte, so many of them.
    fn write(recorder: &mut Recorder, lines: u64) {
        for k in 0..lines {
            recorder.write(k * 10_000, &Entry::Log(Level::Info, &"x".repeat(1000)));
        }
    }

    /// A recording of fifty lines, which the disk has.
    fn begun(name: &Path) -> Recorder {
        let mut recorder = Recorder::begin_with(name, 0, &BTreeMap::new(), WAITING).unwrap();
        write(&mut recorder, 50);
        recorder.wait_for_disk();
        recorder
    }

    /// What is told until a line has these words.
    fn told_until(recorder: &mut Recorder, words: &str) -> Vec<String> {
        let (since, mut told) = (Instant::now(), Vec::new());
        while !told.last().is_some_and(|text: &String| text.contains(words)) {
            assert!(since.elapsed() < Duration::from_secs(10), "never {words:?}: {told:?}");
            told.extend(recorder.news().map(|(_, text)| text));
            sleep(Duration::from_millis(1));
        }
        told
    }

    /// Runs a test of this module once more with a file system of a megabyte in a folder, seen by nobody else. A system
    /// may not let its users mount anything: then it says so.
    fn on_small_disk(test: &str) {
        let may_mount =
            Command::new("unshare").args(["-rm", "mount", "-t", "tmpfs", "none", "/tmp"]).output();
        if !may_mount.is_ok_and(|output| output.status.success()) {
            println!("SKIPPED: no file systems of one's own here (unshare -rm mount -t tmpfs none /tmp)");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let script = format!(
            "mount -t tmpfs -o size=1m none \"${SMALL_DISK}\" && exec \"$0\" --exact \"$1\" --nocapture"
        );
        let ran = Command::new("unshare")
            .args(["-rm", "sh", "-c", &script])
            .arg(std::env::current_exe().unwrap())
            .arg(format!("recording::recorder::tests::{test}"))
            .env(SMALL_DISK, folder.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ran.stdout) + String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success() && said.contains("1 passed"), "{said}");
    }

    /// Takes all that is left of a disk; how much.
    fn fill(filler: &Path) -> usize {
        let mut file = File::create(filler).unwrap();
        (0..1 << 20).take_while(|_| file.write_all(&[0; 64]).is_ok()).count() * 64
    }

    /// Full, then full for too long, then free again: who records is never held up, is told, and the log says what it lacks.
    #[test]
    fn a_full_disk_holds_nobody_up_and_what_is_lost_is_said() {
        let Some(folder) = std::env::var_os(SMALL_DISK).map(PathBuf::from) else {
            return on_small_disk("a_full_disk_holds_nobody_up_and_what_is_lost_is_said");
        };
        let (name, filler) = (folder.join("a"), folder.join("filler"));
        let mut recorder = begun(&name);
        assert!(recorder.news().is_none());

        assert!(fill(&filler) > 500_000);
        write(&mut recorder, 50);
        let told = told_until(&mut recorder, "nothing is lost yet");
        assert!(
            told.len() == 1 && told[0].contains("a.mcap.part") && told[0].contains("No space"),
            "{told:?}"
        );
        fs::remove_file(&filler).unwrap();
        assert_eq!(told_until(&mut recorder, "goes on"), ["the recording goes on, nothing was lost"]);

        fill(&filler);
        write(&mut recorder, 300);
        told_until(&mut recorder, "messages are missing");
        fs::remove_file(&filler).unwrap();
        let told = told_until(&mut recorder, "goes on").pop().unwrap();
        let lost = recorder.disk.left_out();
        assert!((150..=250).contains(&lost) && told.ends_with(&format!("messages lost: {lost}")), "{told}");
        write(&mut recorder, 10);
        let error = recorder.close().unwrap_err();
        assert!(matches!(error, RecordError::LeftOut { messages, .. } if messages == lost), "{error}");

        let complete = finish(&name).unwrap().completeness;
        assert_eq!((complete.messages, complete.left_out_messages), (410 - lost, lost));
        assert!(complete.closed && !complete.is_complete() && complete.damaged_places == 0);
        let missing = complete.missing().unwrap();
        assert!(missing.contains("full or too slow") && missing.contains(&lost.to_string()), "{missing}");
    }

    /// A disk that stays full ends the recording with an error, and soon; what was written before is there.
    #[test]
    fn a_disk_that_stays_full_is_an_error_at_the_end() {
        let Some(folder) = std::env::var_os(SMALL_DISK).map(PathBuf::from) else {
            return on_small_disk("a_disk_that_stays_full_is_an_error_at_the_end");
        };
        let (name, filler) = (folder.join("a"), folder.join("filler"));
        let mut recorder = begun(&name);
        fill(&filler);
        write(&mut recorder, 50);
        let message = recorder.close().unwrap_err().to_string();
        assert!(message.contains("a.mcap.part") && message.contains("No space"), "{message}");
        fs::remove_file(&filler).unwrap();
        let complete = finish(&name).unwrap().completeness;
        assert!(complete.messages >= 50 && !complete.closed, "{complete:?}");
    }
}
