//! What the motors were told, and how fast they turned.

use std::f64::consts::PI;

use crate::log::Log;
use crate::recording::{Signal, Span};

use super::rows::Rows;
use super::vehicle::Layout;

/// How outputs are named: now, before 3.6, before 3.3.
const NAMES: [&str; 3] = ["C", "Ch", "Chan"];

/// Commands of the motors in our order, us.
pub(super) fn commands(rows: &Rows, layout: &Layout) -> Option<Signal<4>> {
    NAMES.iter().find_map(|name| {
        let names = layout.outputs.map(|output| format!("{name}{output}"));
        rows.signal("RCOU", names.each_ref().map(String::as_str))
    })
}

/// Lowest and highest command, us; 1000 to 2000 where the log does not say.
pub(super) fn range(log: &Log) -> Span {
    let both = |low: &str, high: &str| {
        let range = [*log.parameters.get(low)?, *log.parameters.get(high)?];
        (range[0] > 0.0 && range[1] > range[0]).then_some(range)
    };
    both("MOT_PWM_MIN", "MOT_PWM_MAX").or_else(|| both("RC3_MIN", "RC3_MAX")).unwrap_or([1000.0, 2000.0])
}

/// Rotor speeds in our order, rad/s, at the times of the first rotor's. `ESC` counts from 0
/// (`libraries/AP_ESC_Telem/LogStructure.h` of ArduPilot/ardupilot); older logs have a table each, from 1.
pub(super) fn speeds(log: &Log, layout: &Layout) -> Option<Signal<4>> {
    // Outputs are counted from the first, or, where a second processor has the first eight, from behind those
    // (`chan_offset` in `libraries/AP_BLHeli/AP_BLHeli.cpp`); before 4.1 only those that have a controller are.
    let outputs = layout.outputs;
    let behind = |before: usize| outputs.map(|output| output.checked_sub(before + 1));
    let ranks = outputs.map(|output| Some(outputs.iter().filter(|other| **other < output).count()));
    let each = [behind(0), behind(8), ranks].into_iter().find_map(|numbers| {
        numbers.iter().map(|number| speed_of(log, (*number)?)).collect::<Option<Vec<_>>>()
    })?;
    let t = each.first()?.1.clone();
    let speed = |(rpm, times): &(Vec<f64>, Vec<f64>)| {
        nearest(&t, times, rpm).into_iter().map(|rpm| rpm * 2.0 * PI / 60.0).collect()
    };
    let values = <[Vec<f64>; 4]>::try_from(each.iter().map(speed).collect::<Vec<_>>()).ok()?;
    values.iter().flatten().any(|&speed| speed > 0.0).then(|| Signal { source: "ESC".into(), t, values })
}

/// Speeds and their times of a controller, numbered from 0.
fn speed_of(log: &Log, number: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let rows = match log.table("ESC") {
        Some(table) => Rows::instance(table, number as f64),
        None => Rows::first_instance(log.table(&format!("ESC{}", number + 1))?),
    };
    (!rows.t.is_empty()).then_some((rows.column("RPM")?, rows.t))
}

/// The values nearest to times; none further away than half a second.
fn nearest(t: &[f64], times: &[f64], values: &[f64]) -> Vec<f64> {
    const FURTHEST_S: f64 = 0.5;
    t.iter()
        .map(|&t| {
            let after = times.partition_point(|&time| time < t);
            let near =
                [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|&row| row < times.len());
            near.map(|row| ((times[row] - t).abs(), row))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|(distance, _)| *distance < FURTHEST_S)
                .and_then(|(_, row)| values.get(row).copied())
                .unwrap_or(f64::NAN)
        })
        .collect()
}
