//! Damaged files, streams and datagrams through every reader: nothing panics, hangs, or takes much more memory than it is given.
//!
//! The corpora and harnesses are those of the coverage-guided fuzz targets in `tests/fuzz` (packets: `proto/fuzz`). Flight files are
//! damaged in `host-sim/flights/tests/fuzz.rs`, logs of other programs in `host-sim/logs/tests/logs/fuzz`, record by record.
//! `QUADLAB_FUZZ_CASES=100000` runs more cases; what fails prints the variables that run it again.

#[path = "../../host-sim/flights/tests/common/fuzzing.rs"]
mod fuzzing;
#[path = "../../proto/fuzz/harness.rs"]
mod packets;
#[path = "../fuzz/harness/script.rs"]
mod script;
#[path = "../fuzz/harness/stand.rs"]
mod stand;
#[path = "../fuzz/harness/streams.rs"]
mod streams;
#[path = "../fuzz/harness/texts.rs"]
mod texts;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use fuzzing::{Base, Outcome, cut_before, fuzz, joined, take};

/// A file that once did harm begins so: it is no good file to begin with, and has to be refused or read for ever after.
const HARMED: &str = "bad-";

fn folder(corpus: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(corpus)
}

/// The files of a corpus, cut into what is dropped, repeated and swapped.
fn bases(corpus: &str, cut: fn(&[u8]) -> Vec<Vec<u8>>, read: fn(&str, &[u8]) -> Outcome) -> Vec<Base> {
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder(corpus)).expect(corpus).map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let mut bases = Vec::new();
    for path in paths {
        let bytes = std::fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with(HARMED) {
            take(&name, &bytes, read);
        } else {
            bases.push(Base { name: name.leak(), records: cut(&bytes), seal: joined });
        }
    }
    bases
}

fn lines(bytes: &[u8]) -> Vec<Vec<u8>> {
    cut_before(bytes, b"\n")
}

fn words(bytes: &[u8]) -> Vec<Vec<u8>> {
    bytes.chunks(8).map(<[u8]>::to_vec).collect()
}

/// So that some of a disk's pages are zeroed, swapped or repeated.
fn sectors(bytes: &[u8]) -> Vec<Vec<u8>> {
    bytes.chunks(512).map(<[u8]>::to_vec).collect()
}

fn outcome(read: Result<(), String>) -> Outcome {
    if read.is_ok() { Outcome::Flown } else { Outcome::Refused }
}

macro_rules! fuzzed {
    ($($test:ident: $cases:literal of $corpus:literal in $cut:ident by $harness:expr;)*) => {
        $(
            #[test]
            fn $test() {
                fn read(_: &str, bytes: &[u8]) -> Outcome {
                    ($harness)(bytes)
                }
                fuzz($cases, bases($corpus, $cut, read), read);
            }
        )*
    };
}

// As many as take some seconds of processor time.
fuzzed! {
    vehicle: 100_000 of "fuzz/corpus/vehicle" in lines by |bytes: &[u8]| outcome(texts::vehicle(bytes));
    model: 100_000 of "fuzz/corpus/model" in lines by |bytes: &[u8]| outcome(texts::model(bytes));
    gains: 100_000 of "fuzz/corpus/gains" in lines by |bytes: &[u8]| outcome(texts::gains(bytes));
    effects: 100_000 of "fuzz/corpus/effects" in lines by |bytes: &[u8]| outcome(texts::effects(bytes));
    pattern: 100_000 of "fuzz/corpus/pattern" in lines by |bytes: &[u8]| outcome(texts::pattern(bytes));
    script: 100_000 of "fuzz/corpus/script" in lines by |bytes: &[u8]| outcome(script::script(bytes));
    stand: 20_000 of "fuzz/corpus/stand" in lines by |bytes: &[u8]| outcome(stand::stand(bytes));
    imu: 100_000 of "fuzz/corpus/imu" in words by |bytes: &[u8]| outcome(streams::imu(bytes));
    vicon: 100_000 of "fuzz/corpus/vicon" in words by |bytes: &[u8]| outcome(streams::vicon(bytes));
    optitrack: 100_000 of "fuzz/corpus/optitrack" in words by |bytes: &[u8]| outcome(streams::optitrack(bytes));
    recording: 20_000 of "fuzz/corpus/recording" in sectors by |bytes: &[u8]| outcome(streams::recording(bytes));
    packets: 100_000 of "../proto/fuzz/corpus/decode" in words by |bytes: &[u8]| {
        packets::run(bytes);
        Outcome::Flown
    };
}

/// Ten megabytes of a table take hundreds in memory: files of people end far below. The longest that are read are lists of numbers.
#[test]
fn long_files_cost_no_more_than_short_ones_did() {
    type Read = fn(&str, &[u8]) -> Outcome;
    let list = |bytes: usize| format!("mass = [{}]\n", "1,".repeat(bytes / 2 - 20)).into_bytes();
    let readers: [(&str, Read); 4] = [
        ("vehicle.toml", |_, bytes| outcome(texts::vehicle(bytes))),
        ("model.toml", |_, bytes| outcome(texts::model(bytes))),
        ("gains.toml", |_, bytes| outcome(texts::gains(bytes))),
        ("effects.toml", |_, bytes| outcome(texts::effects(bytes))),
    ];
    for (name, read) in readers {
        take(name, &list(model::LONGEST_TOML_BYTES), read);
        take(name, &list(LONG), read);
    }
}

const LONG: usize = 10 << 20;

/// Ten megabytes of what is logged in earnest, whole, damaged throughout, and of nothing.
#[test]
fn ten_megabytes_take_no_two_seconds_and_little_memory() {
    let row = |k: u32| format!("{:.2},position,0,0,0.1,0,0,-1.5,0,0,0,0\n", f64::from(k) * 0.01);
    let rows: String = (0..LONG as u32 / 40).map(row).collect();
    let pattern = format!("t,mode,roll,pitch,yaw,x,y,z,inj1,inj2,inj3,inj4\n{rows}");
    take("pattern.csv", pattern.as_bytes(), |_, bytes| outcome(texts::pattern(bytes)));
    let mut recordings = recorded(false).repeat(LONG / recorded(false).len());
    let read = |_: &str, bytes: &[u8]| outcome(streams::recording(bytes));
    take("whole.mcap", &recordings, read);
    recordings.chunks_mut(700).for_each(|chunk| chunk[0] ^= 0xff);
    take("damaged.mcap", &recordings, read);
    for byte in [0, 1, 5, 0xff] {
        take("nothing.mcap", &vec![byte; LONG], read);
        take("nothing.imu", &vec![byte; LONG], |_, bytes| outcome(streams::imu(bytes)));
    }
    take("long.imu", &imu_frames().repeat(LONG / imu_frames().len()), |_, bytes| {
        outcome(streams::imu(bytes))
    });
}

/// Run it after a format has changed: `cargo test --workspace --test fuzz corpus -- --ignored`.
#[test]
#[ignore = "writes corpora anew"]
fn the_corpus_is_written_by_those_who_send() {
    let write = |target: &str, name: &str, bytes: &[u8]| {
        std::fs::write(folder("fuzz/corpus").join(target).join(name), bytes).unwrap();
    };
    write("imu", "frames", &imu_frames());
    write("stand", "one-motor", &stand_logs());
    write("vicon", "block", &vicon_block());
    for (major, minor) in [(3, 1), (4, 0), (4, 1)] {
        let version = natnet::Version { major, minor, build: 0, revision: 0 };
        write("optitrack", &format!("frame-{major}.{minor}"), &motive_frame().to_datagram(version).unwrap());
    }
    write("recording", "unclosed", &recorded(false));
    write("recording", "closed", &recorded(true));
}

fn imu_frames() -> Vec<u8> {
    use proto::ImuSample;
    use proto::imu_frame::{ImuFrame, MAX_STUFFED_LEN, encode};
    let frame = |sequence: u16| {
        let sample = ImuSample {
            gyro_rad_s: [0.5, -1.0, 2.0],
            attitude_rad: sequence.is_multiple_of(2).then_some([0.1, -0.2, 3.0]),
            acceleration_m_s2: Some([0.1, 0.2, -9.8]),
        };
        ImuFrame {
            sequence,
            board_us: u32::from(sequence) * 10_000,
            sample,
            battery_v: Some(11.1),
            current_a: None,
        }
    };
    (0..6).flat_map(|k| encode(&frame(k), &mut [0; MAX_STUFFED_LEN]).unwrap().to_vec()).collect()
}

/// Eight seconds of the thesis' motor (4.11) with a lag of 1/20 s, whose tachometer's clock is 3 s late.
fn stand_logs() -> Vec<u8> {
    const STEP_S: f64 = 0.001;
    let (mut craft, mut rotor) = ("t,cmd,vbat\n".to_owned(), "t,omega\n".to_owned());
    let mut speed_rad_s = 500.0;
    for k in 0..8_000_u32 {
        let t = f64::from(k) * STEP_S;
        // Steps of half a second, of sizes that do not repeat.
        let command = 1500.0 + 200.0 * (7.0 * (2.0 * t).floor()).sin();
        let volts = 12.3 - 0.05 * t + 0.1 * (3.0 * t).sin();
        let asked = 0.785 * command + 44.6505 * volts - 1205.1;
        speed_rad_s += STEP_S * 20.0 * (asked - speed_rad_s);
        if k % 40 == 0 {
            craft += &format!("{t:.3},{command:.1},{volts:.3}\n");
        }
        if k % 50 == 7 {
            rotor += &format!("{:.4},{speed_rad_s:.2}\n", t + 3.0);
        }
    }
    format!("{craft}--\n{rotor}").into_bytes()
}

fn vicon_block() -> Vec<u8> {
    use ground::mocap::vicon_stream::{Block, Object};
    let object = |name: &str| Object {
        name: name.into(),
        translation_mm: [100.0, -200.0, 1500.0],
        rotation_rad: [0.01, -0.02, 3.1],
    };
    Block { frame: 4711, objects: vec![object("quad"), object("wand"), object("")] }.to_bytes()
}

fn motive_frame() -> natnet::FrameOfData {
    use natnet::frame::{FrameTiming, MarkerSet, RawSection, RigidBody};
    let none = || RawSection { count: 0, payload: Vec::new() };
    natnet::FrameOfData {
        frame_number: 4711,
        marker_sets: vec![MarkerSet { name: "quad".into(), markers: vec![[0.9, 0.7, -0.9]; 3] }],
        other_markers: vec![[1.0, 2.0, 3.0]],
        rigid_bodies: vec![RigidBody {
            id: 3,
            position: [0.9, 0.7, -0.9],
            orientation: [0.0, 0.0, 0.0, 1.0],
            mean_marker_error: 0.0,
            params: 1,
        }],
        skeletons: none(),
        assets: none(),
        labeled_markers: Vec::new(),
        force_plates: none(),
        devices: none(),
        timing: FrameTiming {
            timecode: 0,
            timecode_subframe: 0,
            timestamp: 131.5,
            camera_mid_exposure: 1000,
            camera_data_received: 2000,
            transmit: 3000,
            precision_timestamp_secs: 0,
            precision_timestamp_fractional_secs: 0,
        },
        params: 0,
    }
}

/// Some seconds of what a ground station says and hears.
fn recorded(closed: bool) -> Vec<u8> {
    use ground::recording::{Entry, Level, Recorder};
    use proto::{Answer, Pose, Request, TimedPose};
    let folder = tempfile::tempdir().unwrap();
    let about = BTreeMap::from([("craft".to_owned(), "127.0.0.1:14650".to_owned())]);
    let mut recorder = Recorder::begin(&folder.path().join("a"), 1_700_000_000_000_000_000, &about).unwrap();
    for frame in 0..20_u32 {
        let pose = Pose { position_m: [0.1, 0.2, -1.0], attitude_rad: [0.01, f32::NAN, 3.1] };
        let pose = TimedPose { frame, ground_us: frame * 10_000, pose };
        recorder.write(u64::from(frame) * 10_000, &Entry::Pose(&pose));
    }
    recorder.write(250_000, &Entry::Request(Request::Arm));
    recorder.write(260_000, &Entry::Answer(&Answer { to: 0, done: true, preflight: 0 }));
    recorder.write(270_000, &Entry::Log(Level::Warning, "the link is late"));
    let path = recorder.path().to_owned();
    recorder.close().unwrap();
    let mut bytes = std::fs::read(path).unwrap();
    // As a kill leaves it: without the end of the data and what follows it.
    let data_end = [&[mcap::records::op::DATA_END][..], &4_u64.to_le_bytes()].concat();
    let end = bytes.windows(data_end.len()).position(|window| window == data_end).unwrap();
    if !closed {
        bytes.truncate(end);
    }
    bytes
}
