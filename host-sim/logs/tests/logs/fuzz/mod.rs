//! Damaged logs of every format through the whole import, up to flights and the draft of a vehicle.

#[path = "../../../../flights/tests/common/fuzzing.rs"]
mod fuzzing;
mod programs;
mod ros;

use std::path::Path;

use flights::Column;
use fuzzing::{Outcome, fuzz};
use logs::import_bytes;

/// Files that the tests run on; `QUADLAB_FUZZ_CASES` runs more.
const CASES: u64 = 10_000;

fn look(name: &str, bytes: &[u8]) -> Outcome {
    let import = match import_bytes(bytes, Path::new(name)) {
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
    ($($test:ident: $bases:expr;)*) => {
        $(
            #[test]
            fn $test() {
                fuzz(CASES, $bases, look);
            }
        )*
    };
}

fuzzed! {
    ulog: programs::ulog();
    dataflash_binary: programs::dataflash_binary();
    dataflash_text: programs::dataflash_text();
    blackbox: programs::blackbox();
    crazyflie: programs::crazyflie();
    parquet: programs::parquet();
    rosbag1: ros::rosbag1();
    mcap: ros::mcap();
    rosbag2: ros::rosbag2();
}
