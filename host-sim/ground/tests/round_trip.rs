//! What the ground station writes is read back as every other log is, with the digits that were written.

use std::collections::BTreeMap;
use std::path::Path;

use flights::{Column, Flight};
use ground::recording::{Entry, Recorder, finish, part_of};
use proto::{Counters, ImuSample, Mode, Pose, Refusal, Request, State, Supervision, Telemetry, TimedPose};
use rand::{Rng, RngExt, SeedableRng};

const TICKS: u32 = 300;
/// Rows in the air: from tick 30 to tick 279.
const FLOWN: std::ops::Range<u32> = 30..280;

/// Any numbers of any size, for it is digits that are compared; the craft's clock wraps on the way.
fn telemetry(tick: u32, rng: &mut impl Rng) -> Telemetry {
    let mut any = |largest: f32| {
        let magnitude = 10_f32.powi(rng.random_range(-8..=0));
        rng.random_range(-1.0..1.0_f32) * magnitude * largest
    };
    let flies = FLOWN.contains(&tick);
    let height_m = if flies { -1.5 + any(1.0) } else { 0.0 };
    let position_m = [any(3.0), any(3.0), height_m];
    let imu = ImuSample {
        gyro_rad_s: [any(5.0), any(5.0), any(5.0)],
        attitude_rad: None,
        acceleration_m_s2: Some([any(3.0), any(3.0), any(20.0)]),
    };
    Telemetry {
        tick,
        craft_us: (u32::MAX - 1_000_000).wrapping_add(tick * 10_000 + tick % 7),
        ground_us: tick * 10_000,
        supervision: Supervision {
            state: if flies { State::Flying } else { State::Disarmed },
            conditions: 0,
            preflight: 0,
        },
        mode: Mode::Position,
        attitude_command_rad: [0.0; 3],
        z_command_m: 0.0,
        tracked: Pose { position_m, attitude_rad: [any(0.5), any(0.5), any(3.0)] },
        tracked_rates_rad_s: [any(5.0), any(5.0), any(5.0)],
        imu: (tick % 40 != 5).then_some(imu),
        thrust: any(9.0),
        // A list with a number that is none, and one of none.
        torque: [any(1.0), if tick % 30 == 3 { f32::NAN } else { any(1.0) }, any(1.0)],
        pwm: [1500.0 + any(400.0), 1500.0 + any(400.0), 1500.0 + any(400.0), 1500.0 + any(400.0)],
        refused: Refusal::default(),
        battery_v: if tick % 50 == 7 { f32::NAN } else { 11.1 + any(1.0) },
        current_a: None,
        counters: Counters::default(),
    }
}

/// The flight with a pose that was flown with twice.
fn flown(seed: u64) -> Vec<Telemetry> {
    let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
    let mut all: Vec<Telemetry> = (0..TICKS).map(|tick| telemetry(tick, &mut rng)).collect();
    all[100].tracked = all[99].tracked;
    all
}

fn write(name: &Path, flight: &[Telemetry]) {
    let about = BTreeMap::from([("craft".to_owned(), "made".to_owned())]);
    let mut recorder = Recorder::begin(name, 1_700_000_000_000_000_000, &about).unwrap();
    for row in flight {
        let now_us = u64::from(row.ground_us) + 3_000;
        recorder.write(now_us, &Entry::Telemetry(row));
        let pose = TimedPose { frame: row.tick, ground_us: row.ground_us, pose: row.tracked };
        recorder.write(now_us, &Entry::Pose(&pose));
    }
    recorder.write(9_000_000, &Entry::Request(Request::Land));
}

/// Whether a value has the digits of the number that was written; NaN is missing.
fn is_same(read: f64, written: Option<f32>) -> bool {
    match written.filter(|written| written.is_finite()) {
        Some(written) => read.to_string() == written.to_string(),
        None => read.is_nan(),
    }
}

fn assert_is_what_was_written(flight: &Flight, written: &[Telemetry], what: &str) {
    use Column::*;
    let rows = &written[FLOWN.start as usize..FLOWN.end as usize];
    assert_eq!(flight.len(), rows.len(), "{what}");
    type Of = fn(&Telemetry, usize) -> Option<f32>;
    let columns: [([Column; 3], Of); 5] = [
        ([X, Y, Z], |row, k| Some(row.tracked.position_m[k])),
        ([Phi, Theta, Psi], |row, k| Some(row.tracked.attitude_rad[k])),
        ([P, Q, R], |row, k| row.imu.map(|imu| imu.gyro_rad_s[k])),
        ([Ax, Ay, Az], |row, k| row.imu.and_then(|imu| imu.acceleration_m_s2).map(|force| force[k])),
        ([Cmd1, Cmd2, Vbat], |row, k| Some([row.pwm[0], row.pwm[1], row.battery_v][k])),
    ];
    for (names, of) in columns {
        for (k, name) in names.into_iter().enumerate() {
            for (row, (read, sent)) in flight.column(name).unwrap().iter().zip(rows).enumerate() {
                let is_pose = [X, Y, Z, Phi, Theta, Psi].contains(&name);
                let is_repeated = is_pose && row > 0 && sent.tracked == rows[row - 1].tracked;
                let sent = of(sent, k).filter(|_| !is_repeated);
                assert!(
                    is_same(*read, sent),
                    "{what}: {name:?} of row {row} is {read}, was written as {sent:?}"
                );
            }
        }
    }
    for (read, sent) in flight.column(T).unwrap().iter().zip(rows) {
        let us = sent.craft_us.wrapping_sub(rows[0].craft_us);
        assert_eq!(*read, f64::from(us) / 1e6, "{what}");
    }
}

#[test]
fn every_recording_reads_back_with_the_digits_that_were_written() {
    let folder = tempfile::tempdir().unwrap();
    for seed in 1..=3 {
        println!("seed {seed}");
        let written = flown(seed);
        let name = folder.path().join(format!("flight{seed}"));
        write(&name, &written);
        // A recording that is not finished, as a crash would leave it, then the finished one and its flight file.
        let unfinished = logs::import(&part_of(&name), &flights::ColumnMap::default()).unwrap();
        let finished = finish(&name).unwrap();
        let imported = logs::import(&finished.mcap, &flights::ColumnMap::default()).unwrap();
        for (import, what) in [(&unfinished, "part"), (&imported, "mcap")] {
            let [part] = &import.flights[..] else { panic!("{what}: {} flights", import.flights.len()) };
            assert_is_what_was_written(&part.flight, &written, what);
            assert_eq!(import.sources.rates.as_deref(), Some("/telemetry imu.gyro_rad_s"));
            let start_s = f64::from(written[FLOWN.start as usize].craft_us) / 1e6;
            assert_eq!(part.span[0], start_s, "{what}");
        }
        let beside = Flight::read(&finished.flights[0]).unwrap();
        assert_is_what_was_written(&beside, &written, "csv");
        assert_eq!(
            imported.flights[0].flight.to_csv(),
            std::fs::read_to_string(&finished.flights[0]).unwrap()
        );
        // A flight file is what was imported.
        let csv = imported.flights[0].flight.to_csv();
        let again = Flight::parse(csv.as_bytes(), Path::new("again")).unwrap();
        assert_is_what_was_written(&again, &written, "imported csv");
    }
}

/// The recorder's clock is 3 ms late by construction, and the craft's ticks are as fast as the ground's.
#[test]
fn the_clocks_of_a_recording_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("flight");
    write(&name, &flown(4));
    let import = logs::import(&finish(&name).unwrap().mcap, &flights::ColumnMap::default()).unwrap();
    let pair = |clock: &str, reference: &str| {
        let mut pairs = import.clocks.iter();
        pairs
            .find(|p| p.clock == clock && p.reference == reference)
            .unwrap_or_else(|| panic!("{:?}", import.clocks))
    };
    let written = pair("time of writing", "ground_us");
    assert!((written.offset_ms - (1.7e12 + 3.0)).abs() < 0.01, "{written:?}");
    assert!(written.skew_ppm.unwrap().abs() < 0.1, "{written:?}");
    let craft = pair("craft_us", "ground_us");
    assert!(craft.skew_ppm.unwrap().abs() < 10.0 && craft.scatter_ms.unwrap() < 0.01, "{craft:?}");
}

#[test]
fn a_recording_without_a_flight_has_none() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("ground");
    write(&name, &flown(5)[..20]);
    assert_eq!(logs::import(&part_of(&name), &flights::ColumnMap::default()).unwrap().flights.len(), 0);
}
