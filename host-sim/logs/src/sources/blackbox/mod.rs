//! Betaflight and INAV blackbox fields. Their axes are front, left, up: pitch and yaw rates change sign.

mod scales;

use std::path::Path;

use crate::error::LogError;
use crate::log::{Log, Table};
use crate::recording::{Hints, Recording, Signal, Signals, Span};

use super::common::series::quaternions;
use crate::spans::{both, where_holds};
use scales::Scales;

/// Our order in that of the mixer: rear right, front right, rear left, front left.
const MOTORS: [usize; 4] = [3, 1, 0, 2];
/// Front, left, up to front, right, down.
const FLIP: [f64; 3] = [1.0, -1.0, -1.0];
const GRAVITY: f64 = 9.81;
/// Motors turn above this part of their range in flight.
const ABOVE_IDLE: f64 = 0.02;
/// Throttle that is more than a stick at rest, thousandths.
const RAISED: f64 = 20.0;
/// Motors that are slower for less than this still carry a craft that falls, s.
const SHORT_IDLE_S: f64 = 2.0;

/// Whether a text is a log that `blackbox_decode` has written.
pub(crate) fn is_decoded(log: &Log) -> bool {
    log.tables.iter().any(|table| table.column("motor[0]").is_some() || table.column("gyroADC[0]").is_some())
}

/// One recording for each log that holds anything.
pub(crate) fn record(log: &Log, path: &Path) -> Result<Vec<Recording>, LogError> {
    let refused = |reason: String| LogError::Refused { path: path.into(), reason };
    let filled: Vec<&Table> = log.tables.iter().filter(|table| table.rows > 0).collect();
    if filled.is_empty() {
        let count = log.tables.len();
        let logs = if count == 1 {
            "its only log is empty".into()
        } else {
            format!("all its {count} logs are empty")
        };
        let why = log
            .losses
            .damage
            .first()
            .map_or("nothing was logged between arming and disarming", String::as_str);
        return Err(refused(format!(
            "{logs} ({why}): download it from the craft again, or log another flight"
        )));
    }
    filled.into_iter().map(|table| one(log, table).map_err(refused)).collect()
}

/// The recording of one log.
fn one(log: &Log, table: &Table) -> Result<Recording, String> {
    refuse_other_craft(table)?;
    let scales = Scales::new(log, &table.name);
    let rows = Rows::new(log, table);
    let signals = signals(&rows, &scales);
    if signals.rates.is_none() && signals.commands.is_none() {
        return Err(format!(
            "{} holds neither gyro (gyroADC) nor motors: switch them on in blackbox_disable_*",
            table.name
        ));
    }
    let throttle = rows.signal("setpoint", [3], [1.0]);
    let airborne = airborne(signals.commands.as_ref(), throttle.as_ref(), scales.motor_range);
    let name = log.information.get(&format!("{}: Craft name", table.name)).filter(|name| !name.is_empty());
    let hints = Hints {
        name: name.cloned(),
        command_range: scales.motor_range,
        command_unit: scales.motor_unit().map(str::to_owned),
        ..Hints::default()
    };
    let notes = if log.tables.len() > 1 {
        vec![format!("{} of the {} in the file", table.name, log.tables.len())]
    } else {
        Vec::new()
    };
    let mut recording = Recording { signals, airborne, hints, notes, ..Recording::default() };
    limits(&scales, &mut recording);
    if throttle.is_some_and(|throttle| throttle.values[0].iter().all(|&throttle| throttle < RAISED)) {
        recording.limits.push(
            "the throttle (setpoint[3]) was never raised: the craft may have stood on the ground".into(),
        );
    }
    Ok(recording)
}

/// When the motors turned faster than idle and, if it ever was, the throttle was raised, s.
fn airborne(commands: Option<&Signal<4>>, throttle: Option<&Signal<1>>, range: Option<Span>) -> Vec<Span> {
    let (Some(commands), Some([low, high])) = (commands, range) else { return Vec::new() };
    let mean = |row: usize| commands.values.iter().map(|motor| motor[row]).sum::<f64>() / 4.0;
    let turning = where_holds(&commands.t, |row| mean(row) > low + ABOVE_IDLE * (high - low), SHORT_IDLE_S);
    let raised = throttle
        .map(|throttle| where_holds(&throttle.t, |row| throttle.values[0][row] >= RAISED, SHORT_IDLE_S));
    match raised {
        Some(raised) if !raised.is_empty() => both(&turning, &raised),
        _ => turning,
    }
}

/// Refuses what has not four motors.
fn refuse_other_craft(table: &Table) -> Result<(), String> {
    let motors = table.columns.iter().filter(|column| column.name.starts_with("motor[")).count();
    match motors {
        // Motors can be left out of a log.
        0 | 4 => Ok(()),
        _ => Err(format!(
            "{} comes from a craft with {motors} motors; quadlab reads only quadcopters",
            table.name
        )),
    }
}

/// Rows of a log with strictly rising times.
struct Rows<'log> {
    table: &'log Table,
    kept: Vec<usize>,
    t: Vec<f64>,
}

impl<'log> Rows<'log> {
    fn new(log: &Log, table: &'log Table) -> Self {
        let times = table.times_s();
        // A last frame that is cut off has only part of its fields.
        let cut = usize::from(log.information.contains_key(&format!("{}: last row", table.name)));
        let (mut kept, mut t) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
        for (row, &time) in times.iter().enumerate().take(times.len() - cut) {
            if t.last().is_none_or(|&last| time > last) {
                kept.push(row);
                t.push(time);
            }
        }
        Self { table, kept, t }
    }

    /// A field of several numbers, each with a factor.
    fn signal<const N: usize>(&self, field: &str, order: [usize; N], factors: [f64; N]) -> Option<Signal<N>> {
        let mut values = [const { Vec::new() }; N];
        for ((values, index), factor) in values.iter_mut().zip(order).zip(factors) {
            let column = self.table.column(&format!("{field}[{index}]"))?.to_f64();
            *values = self
                .kept
                .iter()
                .map(|&row| column.get(row).map_or(f64::NAN, |value| value * factor))
                .collect();
        }
        (!self.t.is_empty()).then(|| Signal {
            source: format!("{}: {field}", self.table.name),
            t: self.t.clone(),
            values,
        })
    }
}

/// The quantities of a log.
fn signals(rows: &Rows, scales: &Scales) -> Signals {
    const AXES: [usize; 3] = [0, 1, 2];
    const CENTI: f64 = 0.01;
    let gyro = scales.gyro_rad_s;
    let acceleration = scales.acceleration_per_g.map(|per_g| FLIP.map(|sign| sign * GRAVITY / per_g));
    Signals {
        // INAV: north, east, up in cm (`updateActualAltitudeAndClimbRate` and its like in
        // `src/main/navigation/navigation.c` of iNavFlight/inav).
        position: rows.signal("navPos", AXES, [CENTI, CENTI, -CENTI]),
        velocity: rows.signal("navVel", AXES, [CENTI, CENTI, -CENTI]),
        attitude: turned(rows),
        rates: gyro.and_then(|scale| rows.signal("gyroADC", AXES, FLIP.map(|sign| sign * scale))),
        specific_force: acceleration.and_then(|factors| rows.signal("accSmooth", AXES, factors)),
        commands: rows.signal("motor", MOTORS, [1.0; 4]),
        rotor_speed: scales.speed_rad_s.and_then(|scale| rows.signal("eRPM", MOTORS, [scale; 4])),
        voltage: voltage(rows, scales),
        extra: Vec::new(),
    }
}

/// INAV's attitude: roll right, pitch down, heading clockwise, 0.1 degrees (`imuUpdateEulerAngles` in its
/// `src/main/flight/imu.c`).
fn turned(rows: &Rows) -> Option<Signal<4>> {
    let tenth = 0.1_f64.to_radians();
    let angles = rows.signal("attitude", [0, 1, 2], [tenth, -tenth, tenth])?;
    let values = quaternions(angles.values.each_ref().map(Vec::as_slice));
    Some(Signal { source: angles.source, t: angles.t, values })
}

/// Battery voltage; none if no sensor is there.
fn voltage(rows: &Rows, scales: &Scales) -> Option<Signal<1>> {
    const LEAST_V: f64 = 1.0;
    let fields = ["vbatLatest", "vbat"].into_iter().zip(scales.volts);
    let (field, scale, column) = fields
        .into_iter()
        .find_map(|(field, scale)| Some((field, scale, rows.table.column(field)?.to_f64())))?;
    let values: Vec<f64> =
        rows.kept.iter().map(|&row| column.get(row).map_or(f64::NAN, |raw| raw * scale)).collect();
    let measured = values.iter().any(|&volts| volts > LEAST_V);
    measured.then(|| Signal {
        source: format!("{}: {field}", rows.table.name),
        t: rows.t.clone(),
        values: [values],
    })
}

/// What the log cannot tell.
fn limits(scales: &Scales, recording: &mut Recording) {
    let signals = &recording.signals;
    let mut limits = Vec::new();
    let mut say = |missing: bool, sentence: &str| {
        if missing {
            limits.push(sentence.to_owned());
        }
    };
    say(
        signals.position.is_none() && signals.attitude.is_none(),
        "attitude and position are not logged by Betaflight: rotation can be fitted, forces only from the \
         accelerometer",
    );
    say(
        signals.attitude.is_some() && signals.position.is_none(),
        "position and velocity are not logged: forces can be fitted only from the accelerometer",
    );
    say(
        true,
        "which way the motors turn is not logged: give it in the vehicle file (props in: cw ccw cw \
         ccw, front left first)",
    );
    say(signals.rates.is_none(), "gyro (gyroADC) is not logged: set blackbox_disable_gyro = OFF");
    say(
        signals.specific_force.is_none(),
        "the accelerometer (accSmooth) is not logged: set blackbox_disable_acc = OFF",
    );
    say(signals.commands.is_none(), "motor commands are not logged: set blackbox_disable_motors = OFF");
    say(
        signals.rotor_speed.is_none(),
        "rotor speeds (eRPM) are not logged: Betaflight 4.5 logs them with dshot_bidir = ON and \
         blackbox_disable_rpm = OFF",
    );
    say(signals.voltage.is_none(), "the battery's voltage is not logged: set blackbox_disable_bat = OFF");
    say(
        signals.commands.is_some() && scales.motor_range.is_none(),
        "the range of the motor commands is not logged: give it in the vehicle file",
    );
    recording.limits = limits;
}
