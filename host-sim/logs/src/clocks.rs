//! Clocks: two stamps on the same rows tell how far their clocks are apart, and how fast one runs against the other.
//!
//! A log's rows carry the time at which they were written and often another one: when the sensor measured, when another
//! computer sent, UTC. The difference of the two is a straight line in time but for delays, which are late for a while
//! and never early. So the line goes through the medians of blocks of rows, its slope is the median of all slopes between two
//! of these (Theil and Sen), and their scatter about it is what both are worth. A block that was late as a whole, or a
//! third of them, does not move it.

use proto::Unwrapped;

use crate::format::Format;
use crate::log::{Log, Table, TimeUnit, Values};

/// Fewer rows tell nothing of a clock.
const FEWEST: usize = 20;
/// Rows of a block at least, and blocks at most.
const BLOCK_ROWS: usize = 5;
const MOST_BLOCKS: usize = 50;

/// What is known of one clock against another.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct ClockPair {
    /// The rows that both stamp, or the signals that both show: a table of the log.
    pub of: String,
    /// The clock that is told of.
    pub clock: String,
    /// The clock it is compared with.
    pub reference: String,
    /// Rows that were compared.
    pub rows: usize,
    /// By how much `clock` is ahead of `reference` in the middle of the log, ms: where `reference` is when something was
    /// measured, this is how late it was.
    pub offset_ms: f64,
    /// Standard error of `offset_ms`.
    pub offset_std_error_ms: Option<f64>,
    /// By how much `clock` runs fast against `reference`, millionths.
    pub skew_ppm: Option<f64>,
    /// Standard error of `skew_ppm`.
    pub skew_std_error_ppm: Option<f64>,
    /// Standard deviation of single rows about the line, by the median, ms.
    pub scatter_ms: Option<f64>,
    /// Furthest row from the line, ms.
    pub furthest_ms: Option<f64>,
}

/// Columns of stamps by their names, in any format, and their unit.
const STAMPS: [(&str, Unit); 14] = [
    // ROS.
    ("header.stamp", Unit::Nanoseconds),
    // PX4, in its own logs and over ROS.
    ("timestamp", Unit::Microseconds),
    ("timestamp_sample", Unit::Microseconds),
    ("time_utc_usec", Unit::Microseconds),
    ("remote_timestamp", Unit::Microseconds),
    // ArduPilot: sensors, and positions that another computer sends.
    ("SampleUS", Unit::Microseconds),
    ("RTimeUS", Unit::Microseconds),
    ("RemTimeUS", Unit::Microseconds),
    ("CTimeMS", Unit::Milliseconds),
    // quadlab's ground station.
    ("craft_us", Unit::Microseconds),
    ("ground_us", Unit::Microseconds),
    // Crazyflie.
    ("timestamp_ms", Unit::Milliseconds),
    ("timestamp_us", Unit::Microseconds),
    ("timestamp_ns", Unit::Nanoseconds),
];

/// Units of stamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Unit {
    Nanoseconds,
    Microseconds,
    Milliseconds,
}

impl Unit {
    fn nanoseconds(self) -> i64 {
        match self {
            Self::Nanoseconds => 1,
            Self::Microseconds => 1_000,
            Self::Milliseconds => 1_000_000,
        }
    }
}

/// A clock with the time of each row; nothing where it did not stamp one.
struct Clock {
    name: String,
    ns: Vec<Option<i64>>,
    /// Its smallest step, ns.
    step_ns: i64,
}

/// All pairs of clocks that stamp the same rows.
pub(crate) fn pairs(log: &Log) -> Vec<ClockPair> {
    let mut all = Vec::new();
    for table in &log.tables {
        let clocks = clocks(table, log.format);
        for (k, clock) in clocks.iter().enumerate() {
            all.extend(
                clocks[k + 1..].iter().filter_map(|reference| compared(&table.name, clock, reference)),
            );
        }
    }
    all
}

/// The clocks of a table: the one of the log first, then each that was nearer to the sensor or further away.
fn clocks(table: &Table, format: Format) -> Vec<Clock> {
    let written = match format {
        Format::Ulog => "timestamp",
        Format::Rosbag1 | Format::Rosbag2 | Format::Mcap => "time of writing",
        _ => "time of the log",
    };
    let unit = match table.time_unit {
        TimeUnit::Nanoseconds => Unit::Nanoseconds,
        TimeUnit::Microseconds => Unit::Microseconds,
        TimeUnit::Milliseconds => Unit::Milliseconds,
    };
    let times = Clock {
        name: written.into(),
        ns: table.times.iter().map(|&time| time.checked_mul(unit.nanoseconds())).collect(),
        step_ns: unit.nanoseconds(),
    };
    // Elsewhere than with PX4, a column of this name can be in any unit.
    let is_px4 = table.message_type.as_deref().is_some_and(|name| name.starts_with("px4_msgs/"));
    let stamped =
        STAMPS.iter().filter(|(name, _)| is_px4 || *name != "timestamp").filter_map(|&(name, unit)| {
            let ns = stamps(table.column(name)?, unit);
            Some(Clock { name: name.into(), ns, step_ns: unit.nanoseconds() })
        });
    let mut all = vec![times];
    all.extend(stamped.chain(gps_time(table)).chain(relative(table)));
    all.retain(|clock| !clock.ns.is_empty());
    all
}

/// Stamps in whole numbers; 0 and less is no stamp.
fn stamps(values: &Values, unit: Unit) -> Vec<Option<i64>> {
    let scaled = |ticks: i64| if ticks > 0 { ticks.checked_mul(unit.nanoseconds()) } else { None };
    let mut ramp = Unwrapped::default();
    match values {
        // Microseconds of 32 bits begin anew after 71 minutes.
        Values::U32(ticks) if unit == Unit::Microseconds => {
            ticks.iter().map(|&us| scaled(ramp.push(us))).collect()
        }
        Values::U32(ticks) => ticks.iter().map(|&ticks| scaled(i64::from(ticks))).collect(),
        Values::I32(ticks) => ticks.iter().map(|&ticks| scaled(i64::from(ticks))).collect(),
        Values::I64(ticks) => ticks.iter().map(|&ticks| scaled(ticks)).collect(),
        Values::U64(ticks) => ticks.iter().map(|&ticks| scaled(i64::try_from(ticks).unwrap_or(0))).collect(),
        _ => Vec::new(),
    }
}

/// ArduPilot's GPS time: week and milliseconds in it.
fn gps_time(table: &Table) -> Option<Clock> {
    const WEEK_MS: i64 = 604_800_000;
    let [weeks, ms] = table.group(["GWk", "GMS"]).or_else(|| table.group(["Week", "TimeMS"]))?;
    let ns = weeks.iter().zip(ms).map(|(week, ms)| {
        let valid = *week > 0.0 && *week < 1e4 && (0.0..=WEEK_MS as f64).contains(&ms);
        valid.then(|| (*week as i64 * WEEK_MS + ms as i64) * Unit::Milliseconds.nanoseconds())
    });
    Some(Clock { name: "GPS time".into(), ns: ns.collect(), step_ns: Unit::Milliseconds.nanoseconds() })
}

/// PX4's accelerometer, whose time is given from that of the gyro.
fn relative(table: &Table) -> Option<Clock> {
    const FURTHEST_US: f64 = 1e6;
    let relative = table.column("accelerometer_timestamp_relative")?.to_f64();
    let ns = table.times.iter().zip(relative).map(|(time, us)| {
        (us.abs() < FURTHEST_US).then(|| time.checked_add(us as i64)?.checked_mul(1_000)).flatten()
    });
    Some(Clock { name: "accelerometer".into(), ns: ns.collect(), step_ns: 1_000 })
}

/// One clock against another; nothing where there are too few rows, or one of them stands still.
fn compared(of: &str, clock: &Clock, reference: &Clock) -> Option<ClockPair> {
    let both: Vec<[i64; 2]> =
        clock.ns.iter().zip(&reference.ns).filter_map(|(a, b)| Some([(*a)?, (*b)?])).collect();
    // The time of an event that is told again and again is none of these rows.
    let stands_still = |which: usize| {
        2 * both.windows(2).filter(|pair| pair[0][which] == pair[1][which]).count() > both.len()
    };
    if both.len() < FEWEST || stands_still(0) || stands_still(1) {
        return None;
    }
    // What a number of 53 bits does not hold is taken off first.
    let (&[_, start_ns], first_ns) = (both.first()?, both[0][0].checked_sub(both[0][1])?);
    let mut rows: Vec<[f64; 2]> = Vec::with_capacity(both.len());
    for [a, b] in &both {
        let apart_ns = a.checked_sub(*b)?.checked_sub(first_ns)?;
        rows.push([b.checked_sub(start_ns)? as f64 * 1e-9, apart_ns as f64 * 1e-9]);
    }
    let step_s = clock.step_ns.max(reference.step_ns) as f64 * 1e-9;
    let line = Line::through(rows, step_s);
    let offset_s = first_ns as f64 * 1e-9 + line.middle_s;
    let finite = |value: f64| value.is_finite().then_some(value);
    Some(ClockPair {
        of: of.into(),
        clock: clock.name.clone(),
        reference: reference.name.clone(),
        rows: both.len(),
        offset_ms: 1e3 * offset_s,
        offset_std_error_ms: finite(1e3 * line.middle_std_error_s),
        skew_ppm: finite(1e6 * line.slope),
        skew_std_error_ppm: finite(1e6 * line.slope_std_error),
        scatter_ms: finite(1e3 * line.scatter_s),
        furthest_ms: finite(1e3 * line.furthest_s),
    })
}

/// A line through rows of time and value, both s.
struct Line {
    /// Value in the middle of the time.
    middle_s: f64,
    middle_std_error_s: f64,
    slope: f64,
    slope_std_error: f64,
    scatter_s: f64,
    furthest_s: f64,
}

impl Line {
    fn through(mut rows: Vec<[f64; 2]>, step_s: f64) -> Self {
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let middle_time_s = f64::midpoint(rows[0][0], rows[rows.len() - 1][0]);
        rows.iter_mut().for_each(|row| row[0] -= middle_time_s);
        // The median of a block that drifts is not that of its delays: the second line goes through what the first one leaves.
        let first = slope_of(&blocks_of(&rows));
        let drift = if first.is_finite() { first } else { 0.0 };
        rows.iter_mut().for_each(|row| row[1] -= drift * row[0]);
        let blocks = blocks_of(&rows);
        let left = slope_of(&blocks);
        let flat = |[t, value]: &[f64; 2]| if left.is_finite() { value - left * t } else { *value };
        let middle_s = median(blocks.iter().map(flat).collect());
        let residuals: Vec<f64> = blocks.iter().map(|block| flat(block) - middle_s).collect();
        // Of blocks that follow each other, a late one is often followed by another: then there are fewer of them.
        let squares: f64 = residuals.iter().map(|r| r * r).sum();
        let following: f64 = residuals.windows(2).map(|r| r[0] * r[1]).sum();
        let alike = if squares > 0.0 { (following / squares).clamp(0.0, 0.9) } else { 0.0 };
        // Medians are worth less than means, and no clock more than its step.
        let one_s = 1.25
            * deviation(&residuals).hypot(step_s / 12_f64.sqrt())
            * ((1.0 + alike) / (1.0 - alike)).sqrt();
        let mean_t = blocks.iter().map(|[t, _]| t).sum::<f64>() / blocks.len() as f64;
        let spread = blocks.iter().map(|[t, _]| (t - mean_t).powi(2)).sum::<f64>().sqrt();
        let of_rows: Vec<f64> = rows.iter().map(|row| flat(row) - middle_s).collect();
        Self {
            middle_s,
            middle_std_error_s: one_s / (blocks.len() as f64).sqrt(),
            slope: first + left,
            slope_std_error: if spread > 0.0 { one_s / spread } else { f64::NAN },
            scatter_s: deviation(&of_rows),
            furthest_s: of_rows.iter().fold(0.0, |most, residual| f64::max(most, residual.abs())),
        }
    }
}

/// Medians of rows that follow each other.
fn blocks_of(rows: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let block_rows = rows.len().div_ceil(MOST_BLOCKS).max(BLOCK_ROWS);
    let of = |block: &[[f64; 2]]| [0, 1].map(|part| median(block.iter().map(|row| row[part]).collect()));
    rows.chunks(block_rows).map(of).collect()
}

/// The median of the slopes between all pairs of blocks; NaN where time stands still.
fn slope_of(blocks: &[[f64; 2]]) -> f64 {
    let mut slopes = Vec::new();
    for (k, [t, value]) in blocks.iter().enumerate() {
        let later = blocks[k + 1..].iter().filter(|[other, _]| other > t);
        slopes.extend(later.map(|[other, other_value]| (other_value - value) / (other - t)));
    }
    median(slopes)
}

/// NaN of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if below.len() * 2 != values.len() {
        return upper;
    }
    let lower = values[..middle].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    f64::midpoint(lower, upper)
}

/// Standard deviation about zero by the median.
fn deviation(values: &[f64]) -> f64 {
    1.4826 * median(values.iter().map(|value| value.abs()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Column;

    /// Pseudo-random numbers in 0..1 of a seed (splitmix64).
    fn chance(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = *seed;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A topic whose messages are written late: by `late_ms` in the middle, growing by `skew`, and by up to 3 ms more now and
    /// then; for two seconds by 80 ms.
    fn topic(seed: u64, late_ms: f64, skew: f64) -> Log {
        let mut seed = seed;
        let (mut written, mut stamps) = (Vec::new(), Vec::new());
        for k in 0..3000_i64 {
            let stamp_ns = 1_700_000_000_000_000_000 + k * 10_000_000;
            let from_middle_s = (k as f64 - 1499.5) * 0.01;
            let jam_ms = if (2000..2200).contains(&k) { 80.0 } else { 0.0 };
            let late_ms = late_ms + 1e3 * skew * from_middle_s + 3.0 * chance(&mut seed).powi(4) + jam_ms;
            written.push(stamp_ns + (1e6 * late_ms) as i64);
            stamps.push(if k == 7 { 0 } else { stamp_ns });
        }
        let mut log = Log::new(Format::Mcap);
        log.tables.push(Table {
            name: "/cf/pose".into(),
            message_type: None,
            time_unit: TimeUnit::Nanoseconds,
            rows: written.len(),
            times: written,
            columns: vec![Column { name: "header.stamp".into(), values: Values::I64(stamps) }],
        });
        log
    }

    #[test]
    fn offsets_and_skews_are_found_within_their_errors_whatever_is_late() {
        for (seed, late_ms, skew) in
            [(1, 12.0, 0.0), (2, -150.0, 40e-6), (3, 0.0, -0.0125), (4, 7.5e6, 3e-6), (5, 1.0, 1.0 / 84.0)]
        {
            let [pair] = &pairs(&topic(seed, late_ms, skew))[..] else { panic!("seed {seed}") };
            println!("seed {seed}: {pair:?}");
            assert_eq!(
                (pair.of.as_str(), pair.reference.as_str(), pair.rows),
                ("/cf/pose", "header.stamp", 2999)
            );
            let (skew_ppm, skew_error) = (pair.skew_ppm.unwrap(), pair.skew_std_error_ppm.unwrap());
            // The median of the delay that comes and goes.
            let expected_ms = late_ms + 3.0 * 0.5_f64.powi(4);
            let error_ms = pair.offset_std_error_ms.unwrap();
            assert!((pair.offset_ms - expected_ms).abs() < 4.0 * error_ms, "seed {seed}: {pair:?}");
            assert!((skew_ppm - 1e6 * skew).abs() < 4.0 * skew_error, "seed {seed}: {pair:?}");
            assert!(error_ms < 0.1 && skew_error < 10.0, "seed {seed}: {pair:?}");
            assert!((80.0..84.0).contains(&pair.furthest_ms.unwrap()) && pair.scatter_ms.unwrap() < 1.0);
        }
    }

    #[test]
    fn a_clock_of_32_bits_goes_on_and_one_that_stands_still_is_none() {
        let mut log = topic(1, 0.0, 0.0);
        let us: Vec<u32> = (0..3000_u32).map(|k| (u32::MAX - 4_000_000).wrapping_add(k * 10_001)).collect();
        log.tables[0].columns = vec![
            Column { name: "craft_us".into(), values: Values::U32(us) },
            Column { name: "ground_us".into(), values: Values::U32(vec![0; 3000]) },
            Column { name: "remote_timestamp".into(), values: Values::U64(vec![5_000_000; 3000]) },
        ];
        let [pair] = &pairs(&log)[..] else { panic!("{:?}", pairs(&log)) };
        assert!((pair.skew_ppm.unwrap() + 100.0).abs() < 5.0, "{pair:?}");
    }
}
