//! The motor map and lag from a test stand: thesis 3.3, 4.2.5, equations (4.10) and (4.11).
//!
//! The craft records command and battery voltage, another computer the rotor's speed, each by its
//! own clock; the thesis synchronised the two by hand. Here both clocks, the map and the lag come
//! out of one least squares:
//!
//! ```text
//! speed(t) = G( command * cmd + voltage * vbat + offset )(t + clock + skew (t - middle)),   G = lag / (s + lag)
//! ```
//!
//! with t on the tachometer's clock and G exact for commands held over a sample. The map's
//! coefficients are linear, the rest enters by Gauss and Newton's steps from the best of all
//! offsets at which the logs overlap by half. Standard errors hold for coloured residuals
//! (`sysid::fit::least_squares`). Pulses that a tachometer missed stand out and are left out.
//!
//! **Which map?** Maps with fewer and with more terms than (4.10) are fitted to parts of the run
//! and judged on the others; a longer one is supported where the error it was not fitted to falls
//! by more than chance and enough to matter.
//!
//! **Noise of the voltmeter** makes the voltage's coefficient too small, by the part of the voltage's
//! variance that it is. A voltage that hardly varies beyond its noise is refused, and so is one whose
//! coefficient the comparison of maps does not support.
//!
//! **What cannot be told apart.** A dead time of the speed controller, and half the interval over
//! which a pulse counter averages, are in the clock's offset. An average over a long interval also
//! looks like a slower rotor.

mod clock;
mod compare;
mod craft_log;
mod error;
mod figures;
mod fit;
mod motors;
mod quality;
mod result;
mod rows;
mod run;
mod terms;
mod voltage_noise;

pub use error::MotorMapError;
pub use result::{Estimated, Judged, Map, MotorMap, Samples, StandClock, StandResult};

use clock::synchronise;
use compare::compare;
use craft_log::{CraftLog, range};
use figures::figures;
use motors::{each_motor, map_of};
use quality::{check, leave_out_missed, not_excited};
use rows::{Point, points_of};
use run::{Free, NEEDED_S, Run};
use terms::Terms;

use crate::stand::Stand;

/// A voltage that moves by less than this is constant, V.
const LEAST_VOLTS: f64 = 0.01;

/// Clocks, map and lag of a run. `with_voltage` fits (4.10), otherwise its voltage is left out.
///
/// # Errors
/// Logs that do not overlap or fit at several offsets, and what the run does not excite.
pub fn motor_map(stand: &Stand, with_voltage: bool) -> Result<StandResult, MotorMapError> {
    let craft = CraftLog::new(stand);
    let points: Vec<Vec<Point>> =
        stand.motors.iter().map(|m| points_of(&stand.rotor_s, &m.speed_rad_s)).collect();
    let given: usize = stand.motors.iter().map(|m| m.speed_rad_s.len()).sum();
    let span = |p: &Vec<Point>| Some((p.first()?.time_s, p.last()?.time_s));
    let (from, to) = points
        .iter()
        .filter_map(span)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let mut run = Run { craft: &craft, points, middle_s: 0.5 * (from + to) };
    if !(craft.duration_s() >= NEEDED_S && to - from >= NEEDED_S) {
        return Err(run.too_short());
    }
    let terms = if with_voltage { Terms::Voltage } else { Terms::Command };
    let (low_v, high_v) = range(&craft.volts);
    if with_voltage && high_v - low_v < LEAST_VOLTS {
        return Err(not_excited(&craft, "which is constant".into()));
    }
    let all: Vec<usize> = (0..run.points.len()).collect();
    let start = synchronise(&run, terms)?;
    let mut fitted = run.fit(&all, terms, start, Free::LagAndClock)?;
    let mut missed_pulses = 0;
    // Twice: what a missed pulse pulls aside hides others.
    for _ in 0..2 {
        missed_pulses += leave_out_missed(&mut run, terms, &fitted);
        fitted = run.fit(&all, terms, fitted.shape, Free::LagAndClock)?;
    }
    check(&craft, &run, &fitted, terms)?;
    let maps = compare(&run, fitted.shape, with_voltage)?;
    let map = map_of(&fitted, terms);
    if let Some(Estimated { value, std_error: error }) = map.voltage
        && maps.iter().any(|m| m.terms == terms.name() && !m.supported)
    {
        return Err(MotorMapError::VoltageNotSupported { value, error });
    }
    let motors = if all.len() > 1 { each_motor(&run, terms, &fitted, stand)? } else { Vec::new() };
    let supported = maps.iter().rev().find(|m| m.supported).map_or(Terms::Command.name(), |m| m.terms);
    Ok(StandResult {
        clock: StandClock {
            offset_s: Estimated { value: fitted.shape.offset_s, std_error: fitted.errors[1] },
            skew: Estimated { value: fitted.shape.skew, std_error: fitted.errors[2] },
            middle_s: run.middle_s,
        },
        map,
        motors,
        maps,
        supported,
        samples: fitted.rows,
        missed_pulses,
        left_out: given - fitted.rows - missed_pulses,
        battery_v: [low_v, high_v],
        figures: figures(&run, terms, &fitted, stand),
    })
}
