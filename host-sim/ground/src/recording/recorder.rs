//! A recording in progress.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use proto::Pose;

use super::entry::{Entry, Level, TOPICS};
use super::error::{RecordError, mcap_error};
use super::log::begin_mcap;
use super::scene::{Trail, is_known};

/// A recording in progress.
pub struct Recorder {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    channels: Vec<u16>,
    sequences: [u32; TOPICS.len()],
    trail: Trail,
    /// Wall clock at the ground's time zero, ns since 1970.
    epoch_ns: u64,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("path", &self.path).finish_non_exhaustive()
    }
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
        let (mut writer, channels) =
            begin_mcap(BufWriter::new(file), WriteOptions::new().use_chunks(false)).map_err(refuse)?;
        writer.flush().map_err(refuse)?;
        let mut recorder = Self {
            path: path.clone(),
            writer,
            channels,
            sequences: [0; TOPICS.len()],
            trail: Trail::default(),
            epoch_ns,
        };
        if !about.is_empty() {
            let words: Vec<String> = about.iter().map(|(name, value)| format!("{name} {value}")).collect();
            recorder.write(0, &Entry::Log(Level::Info, &words.join(", ")))?;
        }
        Ok(recorder)
    }

    /// Records something at this time of the ground's clock. It is with the system when this
    /// returns.
    ///
    /// # Errors
    /// A disk that is full or gone.
    pub fn write(&mut self, now_us: u64, entry: &Entry<'_>) -> Result<(), RecordError> {
        self.put(now_us, entry)?;
        match entry {
            Entry::Pose(timed) if is_known(&timed.pose) => self.show(now_us, timed.pose),
            _ => Ok(()),
        }
    }

    /// Where the craft is, for those who look at it in space.
    fn show(&mut self, now_us: u64, pose: Pose) -> Result<(), RecordError> {
        self.put(now_us, &Entry::Transform(&pose))?;
        let track = self.trail.push(now_us, pose).map(<[Pose]>::to_vec);
        track.map_or(Ok(()), |track| self.put(now_us, &Entry::Track(&track)))
    }

    fn put(&mut self, now_us: u64, entry: &Entry<'_>) -> Result<(), RecordError> {
        let channel = entry.channel();
        let log_time = self.epoch_ns.saturating_add(now_us.saturating_mul(1000));
        let header = MessageHeader {
            channel_id: self.channels.get(channel).copied().unwrap_or_default(),
            sequence: self.sequences[channel],
            log_time,
            publish_time: log_time,
        };
        self.sequences[channel] = self.sequences[channel].wrapping_add(1);
        let data = entry.json(log_time);
        let written = self.writer.write_to_known_channel(&header, data.as_bytes());
        written.and_then(|()| self.writer.flush()).map_err(mcap_error(&self.path, "write to the recording"))
    }

    /// The file that grows.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
