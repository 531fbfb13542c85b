//! Battery.

use crate::log::Log;
use crate::recording::{Recording, Signal};

use super::rows::signal;
use super::topics::{instances, topic};

/// Without a sensor PX4 logs a tenth of a volt.
const NO_SENSOR_V: f64 = 1.0;

/// The voltage of the first battery that has a sensor. Where none has, the topic is named without a value.
pub(super) fn voltage(log: &Log, recording: &mut Recording) {
    let mut highest: Option<f64> = None;
    for table in instances(log, "battery_status") {
        let Some(voltage) = signal(table, ["voltage_v"], &mut recording.notes) else { continue };
        let top = voltage.values[0].iter().copied().fold(0.0, f64::max);
        if top >= NO_SENSOR_V {
            recording.signals.voltage = Some(voltage);
            return;
        }
        highest = Some(highest.map_or(top, |highest| highest.max(top)));
        recording.signals.voltage = Some(Signal { t: Vec::new(), values: [Vec::new()], ..voltage });
    }
    recording.limits.push(match highest {
        Some(top) => format!(
            "battery voltage is logged as {top:.2} V at most: there is no sensor; \
             set BAT1_SOURCE and calibrate BAT1_V_DIV"
        ),
        None => "battery voltage is not logged: set BAT1_SOURCE".into(),
    });
}

/// Cells of the battery.
pub(super) fn cells(log: &Log) -> Option<u32> {
    let parameter =
        ["BAT1_N_CELLS", "BAT_N_CELLS"].iter().find_map(|name| log.parameters.get(*name).copied());
    let told = || topic(log, "battery_status")?.column("cell_count")?.to_f64().last().copied();
    let cells = parameter.filter(|cells| *cells > 0.0).or_else(told)?;
    (1.0..=100.0).contains(&cells).then_some(cells as u32)
}
