//! Damaged logs of every format through the whole import, up to flights and the draft of a vehicle.

#[path = "../../../../flights/tests/common/fuzzing.rs"]
mod fuzzing;
mod programs;
mod ros;

use std::path::Path;

use flights::Column;
use fuzzing::{Outcome, fuzz};
use logs::import_bytes;

fn look(name: &str, bytes: &[u8]) -> Outcome {
    let import = match import_bytes(bytes.to_vec(), Path::new(name), &flights::ColumnMap::default()) {
        Ok(import) => import,
        Err(error) => {
            let text = error.to_string();
            assert!(text.len() < 1000 && !text.contains(char::is_control), "{text:?}");
            return Outcome::Refused;
        }
    };
    assert!(import.losses.damage.len() <= 9, "{:?}", import.losses.damage);
    for sentence in import.losses.damage.iter().chain(&import.limits).chain(&import.notes) {
        assert!(sentence.len() < 2000 && !sentence.contains(char::is_control), "{sentence:?}");
    }
    for part in &import.flights {
        let t = part.flight.column(Column::T).expect("a flight has times");
        assert!(t.len() > 1 && t.windows(2).all(|pair| pair[0] < pair[1]), "times do not rise");
    }
    let has_flights = !import.flights.is_empty();
    let _ = logs::draft(&[import]);
    if has_flights { Outcome::Flown } else { Outcome::Read }
}

macro_rules! fuzzed {
    ($($test:ident: $cases:literal of $bases:expr;)*) => {
        $(
            #[test]
            fn $test() {
                fuzz($cases, $bases, look);
            }
        )*
    };
}

// As many as take no more than 20 s of processor time; `QUADLAB_FUZZ_CASES=100000` runs more of the others.
fuzzed! {
    ulog: 100_000 of programs::ulog();
    dataflash_binary: 100_000 of programs::dataflash_binary();
    dataflash_text: 100_000 of programs::dataflash_text();
    blackbox: 50_000 of programs::blackbox();
    crazyflie: 100_000 of programs::crazyflie();
    parquet: 100_000 of programs::parquet();
    rosbag1: 50_000 of ros::rosbag1();
    mcap: 50_000 of ros::mcap();
    rosbag2: 20_000 of ros::rosbag2();
}

/// A few kilobytes that become a hundred megabytes.
#[test]
fn what_grows_without_end_is_cut() {
    for (name, bytes) in ros::bombs() {
        fuzzing::take(name, &bytes, look);
    }
    fuzzing::take("long.parquet", &programs::long_parquet(), look);
}
