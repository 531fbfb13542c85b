//! Do the motors still answer their commands as they did? Where a log has rotor speeds, forces and moments follow from these, and a motor
//! that has become slow, or turns faster at the same command, changes nothing of them. Whoever flies or simulates commands motors.

use std::fmt::Write;

use model::{FitRecord, Model, MotorAnswer};
use report::number::fixed;
use sysid::Prepared;
use sysid::checks::rotor_response::{Response, of_flight};

/// Standard deviations between flights from which on a motor answers in another way.
const DEVIATIONS: f64 = 6.0;
/// Least deviation between flights: of the speed, as a part of it, and of the time constant, as a part of it and in s.
const SPEED: f64 = 0.003;
const LAG: f64 = 0.03;
const LAG_S: f64 = 0.0003;
/// Fewest flights of a model that tell a deviation.
const FEWEST: usize = 3;
/// Largest ratio of two changes that are alike.
const ALIKE: f64 = 1.3;

/// How the motors answered in the flights of a model; empty where these do not tell it.
pub(crate) fn record(model: &Model, flights: &[&Prepared]) -> Vec<MotorAnswer> {
    let all: Vec<[Response; 4]> = flights.iter().filter_map(|f| of_flight(f, &model.vehicle)).collect();
    if all.len() < FEWEST {
        return Vec::new();
    }
    let of_motor = |motor: usize| {
        let ratios = all.iter().map(|of| of[motor].speed_ratio);
        let (speed_ratio, speed_ratio_deviation) = mean_and_deviation(&ratios.collect::<Vec<_>>());
        let lags: Vec<f64> = all.iter().filter_map(|of| of[motor].time_constant_s).collect();
        let lag = (lags.len() >= FEWEST).then(|| mean_and_deviation(&lags));
        MotorAnswer {
            speed_ratio,
            speed_ratio_deviation,
            time_constant_s: lag.map(|lag| lag.0),
            time_constant_deviation_s: lag.map(|lag| lag.1),
        }
    };
    (0..4).map(of_motor).collect()
}

/// What is to be said of new flights whose motors answer in another way; nothing where they answer as before.
pub(crate) fn changed(model: &Model, flights: &[&Prepared]) -> Option<String> {
    let record = model.fit.as_ref().map(|fit: &FitRecord| fit.motor_answers.as_slice())?;
    let all: Vec<[Response; 4]> = flights.iter().filter_map(|f| of_flight(f, &model.vehicle)).collect();
    if record.len() != 4 || all.is_empty() {
        return None;
    }
    let now = |of: &dyn Fn(&Response) -> Option<f64>, motor: usize| {
        let values: Vec<f64> = all.iter().filter_map(|flight| of(&flight[motor])).collect();
        (!values.is_empty()).then(|| mean_and_deviation(&values).0)
    };
    let speeds: Vec<(usize, f64)> = (0..4)
        .filter_map(|motor| {
            let was = &record[motor];
            let change = now(&|of| Some(of.speed_ratio), motor)? / was.speed_ratio - 1.0;
            let usual = (was.speed_ratio_deviation / was.speed_ratio).max(SPEED);
            (change.abs() > DEVIATIONS * usual).then_some((motor, 100.0 * change))
        })
        .collect();
    let lags: Vec<(usize, f64, f64)> = (0..4)
        .filter_map(|motor| {
            let was = &record[motor];
            let (before_s, deviation_s) = was.time_constant_s.zip(was.time_constant_deviation_s)?;
            let now_s = now(&|of| of.time_constant_s, motor)?;
            let usual_s = deviation_s.max(LAG * before_s).max(LAG_S);
            ((now_s - before_s).abs() > DEVIATIONS * usual_s).then_some((motor, now_s, before_s))
        })
        .collect();
    said(&speeds, &lags)
}

/// "the motors respond to their commands differently than in the model's flights: motor 2 has a time constant of 69 ms (before: 46 ms); ..."
fn said(speeds: &[(usize, f64)], lags: &[(usize, f64, f64)]) -> Option<String> {
    if speeds.is_empty() && lags.is_empty() {
        return None;
    }
    let mut sentence =
        "the motors respond to their commands differently than in the model's flights:".to_owned();
    let turns = |percent: f64| if percent > 0.0 { "faster" } else { "slower" };
    let changes: Vec<f64> = speeds.iter().map(|(_, percent)| *percent).collect();
    let mut parts: Vec<String> = match are_alike(&changes) {
        true => {
            let mean = changes.iter().sum::<f64>() / changes.len() as f64;
            vec![format!("all motors turn {} % {} at the same command", fixed(mean.abs(), 1), turns(mean))]
        }
        false => speeds
            .iter()
            .map(|(motor, percent)| {
                let by = fixed(percent.abs(), 1);
                format!("motor {} turns {by} % {} at the same command", motor + 1, turns(*percent))
            })
            .collect(),
    };
    parts.extend(lags.iter().map(|(motor, now_s, before_s)| {
        let [now, before] = [now_s, before_s].map(|s| fixed(1e3 * s, 0));
        format!("motor {} has a time constant of {now} ms (before: {before} ms)", motor + 1)
    }));
    let _ = write!(
        sentence,
        " {}; the verdict is about forces and moments at the logged rotor speeds and does not cover this, but simulation and control design do depend on it",
        parts.join(", ")
    );
    Some(sentence)
}

/// Whether all four motors have changed by nearly the same.
fn are_alike(changes: &[f64]) -> bool {
    let (least, most) =
        changes.iter().fold((f64::MAX, f64::MIN), |(low, high), c| (low.min(*c), high.max(*c)));
    changes.len() == 4 && (least > 0.0 && most < ALIKE * least || most < 0.0 && least > ALIKE * most)
}

/// The mean of some values, and the deviation of a new one from it.
pub(crate) fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (squares / (count - 1.0).max(1.0) * (1.0 + 1.0 / count)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_motors_do_is_said_once_and_what_one_does_of_that_one() {
        let all = said(&[(0, 3.9), (1, 4.1), (2, 4.0), (3, 4.0)], &[]).unwrap();
        assert!(
            all.contains("flights: all motors turn 4.0 % faster at the same command; the verdict"),
            "{all}"
        );
        let one = said(&[(2, -5.0)], &[(1, 0.0694, 0.0462)]).unwrap();
        let both = "motor 3 turns 5.0 % slower at the same command, motor 2 has a time constant of 69 ms (before: 46 ms);";
        assert!(one.contains(both), "{one}");
        assert_eq!(said(&[], &[]), None);
    }

    /// Of 1, 2 and 3 the variance is 1, and a fourth scatters by that and by what their mean does.
    #[test]
    fn a_new_value_deviates_by_itself_and_by_the_mean() {
        let (mean, deviation) = mean_and_deviation(&[1.0, 2.0, 3.0]);
        assert!(mean == 2.0 && (deviation - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(mean_and_deviation(&[5.0]), (5.0, 0.0));
    }
}
