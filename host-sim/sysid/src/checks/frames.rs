//! Frames and signs: do attitude, rates, position and acceleration describe one motion in the axes
//! they claim?
//!
//! A log in other axes (front-left-up, east-north-up, a quaternion read in another order, a gyro
//! mounted a quarter turn round) fits no model, but a regression always returns something.
//! Kinematics tell, without any model of the craft:
//!
//! 1. the gyro is the rate of the tracked attitude;
//! 2. the tracked point accelerates by gravity and by a thrust along the tracked -z axis of the
//!    body, less a drag along its velocity;
//! 3. the IMU's specific force is that acceleration less gravity, in body axes
//!    ([`crate::checks::imu`], once clocks agree).
//!
//! Every single fault of a list (24 rotations of an axis system and their mirror images,
//! quaternions in other orders, conjugated or swapped angles, the conventions of other programs,
//! wrong units) is undone in turn. A fault is named only where the log as it is clearly contradicts
//! a relation and undoing that fault makes all of them hold; where nothing mends a contradiction,
//! that is said. Clocks may be off by up to a quarter of a second: each hypothesis gets the best of
//! all shifts.
//!
//! Deliberately absent: faults in two streams at once other than whole conventions, and small
//! misalignments, which are effects (`attitude-offset`).

use flights::{Column, Mend};
use model::Vehicle;

use crate::checks::frame_hypotheses::{ATTITUDES, CONVENTIONS, as_logged};
use crate::checks::frame_relations::{MENDED, Relation, Seen, below};
use crate::checks::tracks::Axes;
use crate::prepare::Prepared;

/// Correlation under which a relation is in doubt, so that other axes are tried.
const IN_DOUBT: f64 = 0.6;
/// Correlation under which a relation is contradicted, whether something mends it or not.
const CONTRADICTED: f64 = 0.25;
/// How much more than before the correlation of a relation that is mended has to be.
const MENDED_BY: f64 = 0.3;
/// How much better than a simpler fault a later one of the list has to be.
pub(crate) const BETTER_BY: f64 = 0.02;

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameFault {
    /// For people: what it looks like and how to mend it.
    pub sentence: String,
    /// Whether one fault explains it.
    pub named: bool,
    /// What undoes it, where a map of columns can say that.
    pub mend: Option<Mend>,
}

const POSITION: [Column; 3] = [Column::X, Column::Y, Column::Z];

/// What it looks like and how to mend it, for people; and for a map of columns, where that can say it.
type Remedy = (String, Option<Mend>);

/// Whether a relation that was `old` is right, or no worse than it was, when it is `new`.
fn is_mended(old: Relation, new: Relation) -> bool {
    match (old, new) {
        (Some(old), Some(new)) if old < IN_DOUBT => new >= MENDED.max(old + MENDED_BY),
        (Some(old), Some(new)) => new >= old - 0.1,
        (None, new) => new.is_none_or(|new| new >= IN_DOUBT),
        // What was excited is excited in any axes.
        (Some(_), None) => false,
    }
}

/// Checks relations 1 and 2.
pub fn check(flight: &Prepared, vehicle: &Vehicle) -> Option<FrameFault> {
    let as_is = Seen::new(flight, vehicle, as_logged);
    let rates = as_is.rates(&[Axes::SAME])[0];
    // Without a position, the gyro is all there is to hold an attitude against.
    let force_of =
        |seen: &Seen, axes: Axes, scale: f64| flight.has_position.then(|| seen.force(axes, scale)).flatten();
    let force = force_of(&as_is, Axes::SAME, 1.0);
    if !below(rates, IN_DOUBT) && !below(force, IN_DOUBT) {
        return None;
    }
    let mut best: Option<(f64, Remedy)> = None;
    let mut consider = |new_rates: Relation, new_force: Relation, remedy: &dyn Fn() -> Remedy| {
        let score = new_rates.unwrap_or(0.0) + new_force.unwrap_or(0.0);
        let better = best.as_ref().is_none_or(|(s, _)| score > s + BETTER_BY);
        if better && is_mended(rates, new_rates) && is_mended(force, new_force) {
            best = Some((score, remedy()));
        }
    };
    let axes = Axes::all();
    for (axes, new) in axes.iter().zip(as_is.rates(&axes)).skip(1) {
        consider(new, force, &|| {
            let Axes { from, sign } = axes.inverse();
            (gyro_sentence(*axes), Some(Mend::axes([Column::P, Column::Q, Column::R], from, sign)))
        });
    }
    for hypothesis in &ATTITUDES {
        let seen = Seen::new(flight, vehicle, hypothesis.undo);
        consider(seen.rates(&[Axes::SAME])[0], force_of(&seen, Axes::SAME, 1.0), &|| {
            let angles = hypothesis.angles.to_vec();
            let mend = (!angles.is_empty()).then_some(Mend::Columns(angles));
            (format!("{}: {}", hypothesis.looks_like, hypothesis.mend), mend)
        });
    }
    // Before mirrored positions: a log that is upside down in all streams looks the same as a
    // position mirrored in all axes.
    for c in &CONVENTIONS {
        let seen = Seen::new(flight, vehicle, c.undo);
        consider(seen.rates(&[c.gyro])[0], force_of(&seen, c.position, 1.0), &|| {
            (format!("{}: {}", c.looks_like, c.mend), Some((c.undone_by)()))
        });
    }
    for axes in axes.iter().skip(1) {
        consider(rates, force_of(&as_is, *axes, 1.0), &|| {
            (position_sentence(*axes), Some(Mend::axes(POSITION, axes.from, axes.sign)))
        });
    }
    for (unit, scale) in [("millimetres", 1e-3), ("centimetres", 1e-2)] {
        consider(rates, force_of(&as_is, Axes::SAME, scale), &|| {
            let sentence = format!("x, y, z look like {unit}: multiply by {scale}");
            (sentence, Some(Mend::scaled(&POSITION, scale)))
        });
    }
    match best {
        Some((_, (sentence, mend))) => Some(FrameFault { sentence, named: true, mend }),
        None if below(rates, CONTRADICTED) || below(force, CONTRADICTED) => {
            Some(FrameFault { sentence: unnamed(rates, force), named: false, mend: None })
        }
        None => None,
    }
}

fn unnamed(rates: Relation, force: Relation) -> String {
    let which = match (below(rates, CONTRADICTED), below(force, CONTRADICTED)) {
        (true, true) => {
            "the rates are not those of the attitude, and the acceleration is not along its thrust axis"
        }
        (true, false) => "the gyro does not show the rates of the attitude",
        _ => "the acceleration of the position is not along the thrust axis of the attitude",
    };
    format!(
        "attitude, rates and acceleration do not fit together ({which}), and no single wrong axis, sign or unit explains it: \
         check how the log was converted"
    )
}

fn gyro_sentence(axes: Axes) -> String {
    let names = ["p", "q", "r"];
    format!(
        "p, q, r look like {} of this craft's attitude: write {} into p, q, r{}",
        axes.named(names),
        axes.inverse().named(names),
        axes.inverse().mapped(names)
    )
}

/// `axes` undoes the fault.
fn position_sentence(axes: Axes) -> String {
    let names = ["x", "y", "z"];
    let (is, mend) = (axes.inverse().named(names), axes.named(names));
    let up = if axes == (Axes { from: [0, 1, 2], sign: [1.0, 1.0, -1.0] }) { " (z points up)" } else { "" };
    format!(
        "x, y, z look like {is} of the frame of the attitude{up}: write {mend} into x, y, z{}",
        axes.mapped(names)
    )
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};
    use model::frames;
    use nalgebra::Vector3;

    use super::*;

    const PERIOD_S: f64 = 0.01;

    /// Half a minute of flight with thrust along the body's -z axis and nothing else: attitude,
    /// rates and position that belong together.
    fn columns() -> Vec<(Column, Vec<f64>)> {
        use Column::*;
        let names = [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
        let mut columns = names.map(|name| (name, Vec::new()));
        let (mut position, mut velocity) = (Vector3::new(0.0, 0.0, -1.0), Vector3::zeros());
        for k in 0..3000 {
            let t = PERIOD_S * f64::from(k);
            let sine = |size: f64, hz: f64| {
                let w = std::f64::consts::TAU * hz;
                (size * (w * t).sin(), size * w * (w * t).cos())
            };
            let [phi, theta, psi] = [sine(0.15, 0.53), sine(0.15, 0.71), sine(0.4, 0.31)];
            let euler = Vector3::new(phi.0, theta.0, psi.0);
            let rate = frames::body_rates_from_euler(euler, Vector3::new(phi.1, theta.1, psi.1));
            let down = frames::dcm_from_euler(euler).row(2).transpose();
            let row = [position.x, position.y, position.z, euler.x, euler.y, euler.z, rate.x, rate.y, rate.z];
            let row = std::iter::once(t).chain(row).chain([1500.0; 4]).chain([11.5]);
            columns.iter_mut().zip(row).for_each(|((_, column), value)| column.push(value));
            // The thrust that keeps the height.
            let thrust = 9.81 / down.z;
            let acceleration = Vector3::new(0.0, 0.0, 9.81) - down * thrust;
            position += PERIOD_S * velocity + 0.5 * PERIOD_S * PERIOD_S * acceleration;
            velocity += PERIOD_S * acceleration;
        }
        columns.into()
    }

    fn checked(edit: impl Fn(&mut Vec<(Column, Vec<f64>)>)) -> Option<FrameFault> {
        let mut columns = columns();
        edit(&mut columns);
        let vehicle = Vehicle::thesis();
        let flight = Flight::from_columns("made up", columns);
        check(&Prepared::new(&flight, &vehicle).unwrap(), &vehicle)
    }

    fn named(edit: impl Fn(&mut Vec<(Column, Vec<f64>)>)) -> String {
        let fault = checked(edit).expect("a fault");
        assert!(fault.named, "{}", fault.sentence);
        fault.sentence
    }

    #[test]
    fn a_log_that_describes_one_motion_has_no_fault() {
        assert_eq!(checked(|_| {}), None);
    }

    #[test]
    fn a_gyro_with_a_wrong_sign_is_named_with_what_to_write() {
        let sentence = named(|columns| columns[8].1.iter_mut().for_each(|q| *q = -*q));
        assert!(sentence.contains("write p, -q, r into p, q, r"), "{sentence}");
    }

    #[test]
    fn exchanged_positions_are_named_with_what_to_write() {
        let sentence = named(|columns| {
            let x = std::mem::take(&mut columns[1].1);
            columns[1].1 = std::mem::replace(&mut columns[2].1, x);
        });
        assert!(sentence.contains("write y, x, z into x, y, z"), "{sentence}");
    }

    #[test]
    fn a_theta_of_the_wrong_sign_is_named() {
        let sentence = named(|columns| columns[5].1.iter_mut().for_each(|theta| *theta = -*theta));
        assert!(sentence.starts_with("theta has the wrong sign"), "{sentence}");
    }
}
