//! Does the tracker still see the body as it did? Forces that are fitted to an accelerometer follow from it, and so hardly notice a tracked
//! attitude that is turned, or another tracked point: both show against the accelerometer itself.

use model::{FitRecord, Model, TrackerMountRecord};
use report::number::fixed;
use sysid::Prepared;
use sysid::checks::tracker_mount::{Lever, TrackerMount, of_flight};

use crate::motor_answers::mean_and_deviation;

/// Standard deviations between flights from which on it is another one.
const DEVIATIONS: f64 = 6.0;
/// Least deviation between flights: an accelerometer's offset changes by 0.015 m/s^2 from day to day, rad; and of the lever, m.
const TILT_RAD: f64 = 0.0015;
const LEVER_M: f64 = 0.001;
/// Fewest flights of a model that tell a deviation.
const FEWEST: usize = 4;
/// And of a lever, which not every flight tells.
const FEWEST_LEVERS: usize = 3;

/// How the tracker saw the body in the flights of a model; nothing where these do not tell.
pub(crate) fn record(model: &Model, flights: &[&Prepared]) -> Option<TrackerMountRecord> {
    let all = mounts(model, flights);
    if all.len() < FEWEST {
        return None;
    }
    let tilt = each_axis(&all, |of| of.tilt_rad, mean_and_deviation);
    let levers = levers(&all);
    let lever =
        (levers.len() >= FEWEST_LEVERS).then(|| each_axis(&levers, |of| of.value_m, mean_and_deviation));
    Some(TrackerMountRecord {
        tilt_rad: tilt.map(|of| of.0),
        tilt_deviation_rad: tilt.map(|of| of.1),
        lever_m: lever.map(|lever| lever.map(|of| of.0)),
        lever_deviation_m: lever.map(|lever| lever.map(|of| of.1)),
    })
}

/// Of the flights that tell.
pub(crate) fn mounts(model: &Model, flights: &[&Prepared]) -> Vec<TrackerMount> {
    flights.iter().filter_map(|flight| of_flight(flight, &model.vehicle)).collect()
}

/// Of the flights whose lever is known.
fn levers(all: &[TrackerMount]) -> Vec<Lever> {
    all.iter().filter_map(|of| of.lever).collect()
}

/// A statistic of the flights along each axis.
pub(crate) fn each_axis<Flight, Statistic, const N: usize>(
    flights: &[Flight],
    value: impl Fn(&Flight) -> [f64; N],
    statistic: impl Fn(&[f64]) -> Statistic,
) -> [Statistic; N] {
    std::array::from_fn(|k| statistic(&flights.iter().map(|of| value(of)[k]).collect::<Vec<_>>()))
}

/// Standard error of a mean of values with these standard errors.
pub(crate) fn mean_error(errors: &[f64]) -> f64 {
    errors.iter().map(|error| error * error).sum::<f64>().sqrt() / errors.len() as f64
}

/// What is to be said of new flights in which the tracker sees the body in another way; nothing where it sees it as before.
pub(crate) fn changed(model: &Model, flights: &[&Prepared]) -> Option<String> {
    let was = model.fit.as_ref().and_then(|fit: &FitRecord| fit.tracker_mount)?;
    let all = mounts(model, flights);
    if all.is_empty() {
        return None;
    }
    let counts_from = |deviation: f64, least: f64, error: f64| DEVIATIONS * deviation.max(least).hypot(error);
    let tilt_rad = each_axis(&all, |of| of.tilt_rad, mean_and_deviation);
    let tilt_error_rad = each_axis(&all, |of| of.tilt_error_rad, mean_error);
    let turned_rad = [0, 1].map(|k| {
        let least_rad = counts_from(was.tilt_deviation_rad[k], TILT_RAD, tilt_error_rad[k]);
        (tilt_rad[k].0 - was.tilt_rad[k], least_rad)
    });
    let levers = levers(&all);
    let known = was.lever_m.zip(was.lever_deviation_m).filter(|_| !levers.is_empty());
    let moved_m = known.map(|(mean_m, deviation_m)| {
        let lever_m = each_axis(&levers, |of| of.value_m, mean_and_deviation);
        let error_m = each_axis(&levers, |of| of.error_m, mean_error);
        [0, 1, 2].map(|k| (lever_m[k].0 - mean_m[k], counts_from(deviation_m[k], LEVER_M, error_m[k])))
    });
    said(turned_rad, moved_m)
}

/// "against the accelerometer, the tracked attitude is turned by 1.5 deg in roll and -1.0 deg in pitch ...": changes, each with that from
/// which on it counts.
fn said(turned_rad: [(f64, f64); 2], moved_m: Option<[(f64, f64); 3]>) -> Option<String> {
    let counts = |of: &(f64, f64)| of.0.abs() > of.1;
    let turned = turned_rad.iter().any(counts).then(|| {
        let [roll, pitch] = turned_rad.map(|of| fixed(of.0.to_degrees(), 1));
        format!("the tracked attitude is turned by {roll} deg in roll and {pitch} deg in pitch")
    });
    let moved = moved_m.filter(|moved| moved.iter().any(counts)).map(|moved| {
        let [x, y, z] = moved.map(|of| fixed(1e3 * of.0, 0));
        format!("the tracked point has moved by {x} mm forward, {y} mm right and {z} mm down")
    });
    let parts: Vec<String> = [turned, moved].into_iter().flatten().collect();
    (!parts.is_empty()).then(|| {
        format!(
            "against the accelerometer, {} since the model's flights: the tracked body was probably defined anew, or its markers or the \
             sensor were moved, or the accelerometer's offset has changed; the verdict is about forces and moments and does not cover this, but a controller sees the tracked attitude and position",
            parts.join(" and ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_mean_falls_with_the_root_of_the_count() {
        assert!((mean_error(&[0.3]) - 0.3).abs() < 1e-15);
        assert!((mean_error(&[0.3; 9]) - 0.1).abs() < 1e-15);
    }

    #[test]
    fn a_turn_and_a_move_are_told_where_they_stand_out() {
        let still = [(0.001, 0.006); 2];
        assert_eq!(said(still, None), None);
        assert_eq!(said(still, Some([(0.002, 0.006); 3])), None);
        let turned = [(1.5_f64.to_radians(), 0.006), (-0.001, 0.006)];
        let told = said(turned, None).unwrap();
        assert!(told.contains("turned by 1.5 deg in roll and -0.1 deg in pitch since"), "{told}");
        let told = said(still, Some([(0.03, 0.006), (-0.02, 0.006), (0.0, 0.006)])).unwrap();
        assert!(told.contains("moved by 30 mm forward, -20 mm right and 0 mm down since"), "{told}");
    }
}
