//! Crazyflie logs: what the firmware's own decoder finds in them, and the flights that were made from them.

mod common;

use common::{expected, expected_sum};
use logs::{Format, TimeUnit};

const LOGS: [&str; 5] = [
    "crazyflie_sd_load_log201",
    "crazyflie_sd_log10",
    "crazyflie_sd_log16",
    "crazyflie_sd_old",
    "crazyflie_sd_two_events",
];

/// Counts, first and last times and sums of every variable.
#[test]
fn logs_hold_what_the_firmwares_decoder_finds() {
    for name in LOGS {
        let Some((log, expected)) = expected(name) else { return };
        assert_eq!(log.format, Format::Crazyflie);
        assert_eq!(log.information["version"], expected["version"].to_string());
        assert_eq!(log.losses.damage.is_empty(), expected["crc_ok"].as_bool().unwrap());
        let events = expected["events"].as_object().unwrap();
        assert_eq!(log.tables.len(), events.len());
        for (event, found) in events {
            let table = log.table(event).unwrap();
            assert_eq!(table.rows as u64, found["count"].as_u64().unwrap(), "{name} {event}");
            let (first, last) = (table.times[0] as f64, *table.times.last().unwrap() as f64);
            let times = match table.time_unit {
                TimeUnit::Microseconds if found.get("first_ms").is_some() => ["first_ms", "last_ms"],
                _ => ["first_us", "last_us"],
            };
            let ticks = if times[0] == "first_ms" { 1e3 } else { 1.0 };
            for (time, key) in [first, last].into_iter().zip(times) {
                // Ten digits are written.
                let told = found[key].as_f64().unwrap() * ticks;
                assert!((time - told).abs() <= 1e-9 * told, "{name} {event} {key}: {time} {told}");
            }
            let sums = found["sums"].as_object().unwrap();
            assert_eq!(table.columns.len(), sums.len());
            for (variable, sum) in sums {
                expected_sum(table, variable, sum.as_f64().unwrap());
            }
        }
    }
}
