//! Body rates. Two variables have the pitch rate with a sign that changed with the firmware: there the
//! attitude decides.

use super::super::common::series::{flip, interpolate, rates_of_attitude, scale};
use super::tables::Tables;
use crate::recording::Signal;

/// The name that they are known by, the variables, their unit in rad/s, and whether pitch may be nose up.
const RATES: [(&str, [&str; 3], f64, bool); 5] = [
    ("gyro.x", ["gyro.x", "gyro.y", "gyro.z"], std::f64::consts::PI / 180.0, false),
    (
        "stateEstimateZ.rateRoll",
        ["stateEstimateZ.rateRoll", "stateEstimateZ.ratePitch", "stateEstimateZ.rateYaw"],
        1e-3,
        true,
    ),
    ("ctrlLee.omegax", ["ctrlLee.omegax", "ctrlLee.omegay", "ctrlLee.omegaz"], 1.0, false),
    ("ctrlLeeP.omegax", ["ctrlLeeP.omegax", "ctrlLeeP.omegay", "ctrlLeeP.omegaz"], 1.0, false),
    ("controller.r_roll", ["controller.r_roll", "controller.r_pitch", "controller.r_yaw"], 1.0, true),
];
/// Steps of attitude that are compared are no longer than this, s.
const LONGEST_STEP_S: f64 = 0.1;
/// Correlation from which on a sign is certain.
const CERTAIN: f64 = 0.3;

/// The first rates that are logged, in our frame.
pub(super) fn rates(
    tables: &Tables<'_>,
    attitude: Option<&Signal<4>>,
    notes: &mut Vec<String>,
) -> Option<Signal<3>> {
    RATES.iter().find_map(|(source, names, unit, may_be_nose_up)| {
        let (rising, values) = tables.group(*names)?;
        let mut signal = rising.signal(source, &values);
        if *may_be_nose_up {
            signal.values[1].iter_mut().for_each(|q| *q = -*q);
            let likeness = attitude.and_then(|attitude| likeness(&signal, attitude));
            let found = likeness.filter(|likeness| likeness.abs() > CERTAIN);
            // As logged by firmware of the last years: nose up; before the format had a magic number:
            // nose down.
            let nose_up = found.map_or(!tables.is_old(), |likeness| likeness > 0.0);
            if !nose_up {
                signal.values[1].iter_mut().for_each(|q| *q = -*q);
            }
            let sign = if nose_up { "nose up" } else { "nose down" };
            let how =
                if found.is_some() { "by the attitude" } else { "as firmware of that age has it: check it" };
            notes.push(format!("{} is positive {sign}, {how}", names[1]));
        }
        signal.values = flip(scale(signal.values, *unit));
        Some(signal)
    })
}

/// Correlation of minus the pitch rate with that of the attitude (nose up).
fn likeness(rates: &Signal<3>, attitude: &Signal<4>) -> Option<f64> {
    let (times, of_attitude) = rates_of_attitude(attitude);
    let (mut both, mut own, mut other) = (0.0, 0.0, 0.0);
    for (time, expected) in times.iter().zip(&of_attitude[1]) {
        let measured = -interpolate(&rates.t, &rates.values[1], *time, LONGEST_STEP_S);
        if measured.is_finite() && expected.is_finite() {
            both += measured * expected;
            own += measured * measured;
            other += expected * expected;
        }
    }
    (own > 0.0 && other > 0.0).then(|| both / (own * other).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Format;
    use crate::log::{Column, Log, Table, TimeUnit, Values};

    /// A craft that pitches by a sine of 0.2 rad, with a pitch rate of either sign, nose down as the frames of the firmware have it.
    fn log(sign: f64, with_attitude: bool) -> Log {
        let t = |k: u32| f64::from(k) * 0.01;
        let column = |name: &str, value: &dyn Fn(f64) -> f64| Column {
            name: name.into(),
            values: Values::F64((0..500).map(|k| value(t(k))).collect()),
        };
        let mut columns = vec![
            column("stateEstimateZ.rateRoll", &|_| 1.0),
            column("stateEstimateZ.ratePitch", &|t| sign * 1000.0 * 0.6 * (3.0 * t).cos()),
            column("stateEstimateZ.rateYaw", &|_| 2.0),
        ];
        if with_attitude {
            columns.push(column("ctrlLee.rpyx", &|_| 0.0));
            columns.push(column("ctrlLee.rpyy", &|t| 0.2 * (3.0 * t).sin()));
            columns.push(column("ctrlLee.rpyz", &|_| 0.0));
        }
        let mut log = Log::new(Format::Crazyflie);
        log.tables.push(Table {
            name: "fixedFrequency".into(),
            message_type: None,
            time_unit: TimeUnit::Milliseconds,
            times: (0..500).map(|k| k * 10).collect(),
            rows: 500,
            columns,
        });
        log
    }

    fn pitch_rate(log: &Log) -> (f64, Vec<String>) {
        let mut notes = Vec::new();
        let tables = Tables::of(log, &mut notes);
        let attitude = super::super::attitude::attitude(&tables);
        let rates = rates(&tables, attitude.as_ref(), &mut notes).unwrap();
        assert_eq!((rates.values[0][3], rates.values[2][3]), (0.001, -0.002));
        (rates.values[1][0], notes)
    }

    /// Nose down is a negative rate here, whichever sign the log has.
    #[test]
    fn the_attitude_tells_the_sign_of_pitch() {
        for sign in [1.0, -1.0] {
            let (q, notes) = pitch_rate(&log(sign, true));
            assert!((q + 0.6).abs() < 1e-12, "{q}");
            assert!(notes[0].contains("by the attitude"), "{notes:?}");
        }
        let (q, notes) = pitch_rate(&log(1.0, false));
        assert!((q - 0.6).abs() < 1e-12 && notes[0].contains("nose up, as firmware"), "{notes:?}");
    }
}
