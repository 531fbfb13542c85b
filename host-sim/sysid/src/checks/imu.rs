//! Does the IMU feel what the tracker sees?
//!
//! The specific force in body axes is the tracked acceleration less gravity, turned into the body. Along the thrust
//! axis that is about -9.81 m/s^2 with all of the climbing on top; to the sides it is the drag alone. Axes that are turned or
//! mirrored, gravity that is missing or has the wrong sign, and accelerations in the inertial frame or in g are undone in
//! turn, as [`crate::checks::frames`] does it for the other streams.

use flights::{Column, Mend};
use model::Vehicle;
use nalgebra::{Matrix3, Vector3};

use crate::checks::frame_relations::{LEAST_ROWS, MENDED, ROW_PERIOD_S, Relation, below};
use crate::checks::frame_taps::Taps;
use crate::checks::frames::{BETTER_BY, FrameFault};
use crate::checks::tracks::Axes;
use crate::prepare::{Prepared, push, vector};
use crate::statistics::{correlation, deviation, mean};

/// Correlation under which an IMU is in doubt, and forces under which it tells nothing, m/s^2. To the sides a craft feels its
/// drag only, so both are lower than for the rest.
const IN_DOUBT: f64 = 0.2;
const EXCITED_M_S2: f64 = 0.1;
/// Correlation up to which an IMU is in doubt where other axes are clearly better: along a diagonal, axes that are exchanged agree a
/// little, too.
const EXCHANGED: f64 = 0.6;
const CLEARLY: f64 = 0.3;
/// Correlation under which an IMU contradicts the tracked motion, whether something mends it or not.
const CONTRADICTED: f64 = -0.4;

/// Ways an IMU may have been written wrongly: what it looks like, how to mend it, and the specific force in body axes
/// from what was logged, the attitude (inertial to body) and gravity.
type Hypothesis = (String, Option<Mend>, Box<Undo>);

const FORCE: [Column; 3] = [Column::Ax, Column::Ay, Column::Az];

type Undo = dyn Fn(Vector3<f64>, &Matrix3<f64>, f64) -> Vector3<f64>;

fn hypotheses() -> Vec<Hypothesis> {
    let names = ["ax", "ay", "az"];
    let mut all: Vec<Hypothesis> = Vec::new();
    for axes in Axes::all().into_iter().skip(1) {
        let turned = axes.sign == [-1.0; 3] && axes.from == [0, 1, 2];
        let is = if turned { " (gravity included with the wrong sign)" } else { "" };
        let sentence = format!(
            "ax, ay, az look like {} of this craft{is}: write {} into ax, ay, az{}",
            axes.inverse().named(names),
            axes.named(names),
            axes.mapped(names)
        );
        let mend = Mend::axes(FORCE, axes.from, axes.sign);
        all.push((sentence, Some(mend), Box::new(move |f, _, _| axes.of(f))));
    }
    all.push((
        "ax, ay, az look like multiples of g: multiply by 9.81".into(),
        Some(Mend::scaled(&FORCE, 9.81)),
        Box::new(|f, _, g| g * f),
    ));
    all.push((
        "ax, ay, az look like accelerations without gravity, but the specific force of an IMU is needed (0, 0, -9.81 at rest): \
         subtract gravity in body axes"
            .into(),
        None,
        Box::new(|f, dcm, g| f - g * dcm.column(2)),
    ));
    all.push((
        "az has gravity with the wrong sign: subtract it twice in body axes".into(),
        None,
        Box::new(|f, dcm, g| f - 2.0 * g * dcm.column(2)),
    ));
    all.push((
        "ax, ay, az look like accelerations in the inertial frame: subtract gravity and rotate them into the body frame"
            .into(),
        None,
        Box::new(|f, dcm, g| dcm * (f - Vector3::new(0.0, 0.0, g))),
    ));
    all
}

/// Checks a flight whose gyro and attitude share a clock; nothing without an IMU, and without a position to hold it against.
pub fn check(flight: &Prepared, vehicle: &Vehicle) -> Option<FrameFault> {
    if !flight.has_position {
        return None;
    }
    let as_logged = relation(flight, vehicle, &|f, _, _| f);
    if !below(as_logged, EXCHANGED) {
        return None;
    }
    let mut best: Option<(f64, String, Option<Mend>)> = None;
    for (sentence, mend, undo) in hypotheses() {
        if let Some(quality) = relation(flight, vehicle, &*undo)
            && quality >= MENDED
            && best.as_ref().is_none_or(|(b, ..)| quality > b + BETTER_BY)
        {
            best = Some((quality, sentence, mend));
        }
    }
    let least = if below(as_logged, IN_DOUBT) { MENDED } else { as_logged? + CLEARLY };
    match best.filter(|(quality, ..)| *quality >= least) {
        Some((_, sentence, mend)) => Some(FrameFault { sentence, named: true, mend }),
        // Small forces to the sides drown in a tilted tracker.
        None if !below(as_logged, CONTRADICTED) => None,
        None => Some(FrameFault {
            sentence: "the specific force ax, ay, az is not that of the tracked motion, and no single wrong axis, sign or \
                       unit explains it: check how the log was converted"
                .into(),
            named: false,
            mend: None,
        }),
    }
}

fn relation(flight: &Prepared, vehicle: &Vehicle, undo: &Undo) -> Relation {
    let taps = Taps::new(flight.period_s);
    let stride = ((ROW_PERIOD_S / flight.period_s).round() as usize).max(1);
    let gravity = Vector3::new(0.0, 0.0, vehicle.gravity);
    let (mut sensed, mut tracked): ([Vec<f64>; 3], [Vec<f64>; 3]) = Default::default();
    for stretch in &flight.stretches {
        let imu = stretch.imu_m_s2.as_ref()?;
        let count = stretch.time_s.len();
        if count <= 2 * taps.half() {
            continue;
        }
        let mut turned: [Vec<f64>; 3] = Default::default();
        for k in 0..count {
            let dcm = &stretch.dcm[k];
            let force = dcm.tr_mul(&undo(vector(imu, k), dcm, vehicle.gravity));
            push(&mut turned, force);
        }
        for k in (taps.half()..count - taps.half()).step_by(stride) {
            let dcm = &stretch.dcm[k];
            let a = dcm * taps.at(&taps.smooth, &turned, k);
            let b = dcm * (taps.at(&taps.second, &stretch.position_ned_m, k) - gravity);
            for i in 0..3 {
                sensed[i].push(a[i]);
                tracked[i].push(b[i]);
            }
        }
    }
    if sensed[0].len() < LEAST_ROWS {
        return None;
    }
    let off = Vector3::from_fn(|i, _| mean(&sensed[i]) - mean(&tracked[i])).norm() / vehicle.gravity;
    if off > 0.5 {
        return Some(-1.0);
    }
    let mut worst: f64 = if off < 0.2 { 1.0 } else { 0.5 };
    for i in 0..3 {
        if deviation(&tracked[i]).max(deviation(&sensed[i])) < EXCITED_M_S2 {
            continue;
        }
        worst = worst.min(correlation(&sensed[i], &tracked[i]));
    }
    Some(worst)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{prepared, waving_with_imu};

    fn fault(told: impl Fn(Vector3<f64>, Matrix3<f64>) -> Vector3<f64>) -> Option<FrameFault> {
        let vehicle = Vehicle::thesis();
        let flight = waving_with_imu(1000, told);
        check(&Prepared::new(&flight, &vehicle).unwrap(), &vehicle)
    }

    fn named(told: impl Fn(Vector3<f64>, Matrix3<f64>) -> Vector3<f64>) -> String {
        let fault = fault(told).expect("a fault");
        assert!(fault.named, "{}", fault.sentence);
        fault.sentence
    }

    #[test]
    fn an_imu_that_feels_what_the_tracker_sees_has_no_fault() {
        assert!(fault(|f, _| f).is_none());
        // Nor has one with a bias: a tenth of gravity is not another frame.
        assert!(fault(|f, _| f + Vector3::new(0.3, -0.2, 0.5)).is_none());
    }

    #[test]
    fn without_an_imu_there_is_nothing_to_say() {
        let flight = prepared(1000, |_, row| {
            row.wave();
        });
        assert!(check(&flight, &Vehicle::thesis()).is_none());
    }

    #[test]
    fn multiples_of_g_are_named() {
        assert_eq!(named(|f, _| f / 9.81), "ax, ay, az look like multiples of g: multiply by 9.81");
    }

    #[test]
    fn each_way_to_write_gravity_wrongly_is_named() {
        assert_eq!(
            named(|f, dcm| f + 9.81 * dcm.column(2)),
            "ax, ay, az look like accelerations without gravity, but the specific force of an IMU is needed (0, 0, -9.81 at rest): subtract gravity in body axes"
        );
        assert_eq!(
            named(|f, dcm| f + 2.0 * 9.81 * dcm.column(2)),
            "az has gravity with the wrong sign: subtract it twice in body axes"
        );
        assert!(named(|f, _| -f).contains("(gravity included with the wrong sign)"));
        assert_eq!(
            named(|f, dcm| dcm.tr_mul(&f) + Vector3::new(0.0, 0.0, 9.81)),
            "ax, ay, az look like accelerations in the inertial frame: subtract gravity and rotate them into the body frame"
        );
    }

    /// Forward is logged as minus y and right as x: to mend it, minus ay is written into ax.
    #[test]
    fn turned_axes_are_named_with_what_to_write_instead() {
        assert_eq!(
            named(|f, _| Vector3::new(f.y, -f.x, f.z)),
            "ax, ay, az look like ay, -ax, az of this craft: write -ay, ax, az into ax, ay, az (or leave the log as it is and say so \
             in columns.toml beside it, under [columns]: ax = \"-ay\"; ay = \"ax\")"
        );
    }

    #[test]
    fn an_imu_that_contradicts_the_motion_in_no_simple_way_is_refused_without_a_name() {
        let fault = fault(|f, _| Vector3::new(0.5 * f.x, f.y, f.z) + Vector3::new(40.0, 0.0, 25.0));
        assert!(fault.is_some_and(|fault| !fault.named));
    }
}
