//! What flights do not determine of a model, each with the reason and with what to fly.
//!
//! - **Nothing is modelled**: a model of forces says nothing of the rotation.
//! - **Not above a mean**: on the flights held out, an axis is predicted no better than by the mean of what was measured there
//!   (R2 not above zero). Either the coefficients are not the craft's, or there was nothing to predict: then what was measured
//!   varies no more than the sensors' noise, and the axis was not excited.
//! - **Impossible signs**: a motor that pushes the wrong way, a drag that accelerates.
//! - **Motors too weak**: at several hertz, the motors turn the craft more than twice as strongly as the model says, or by the model the
//!   craft would resist them more than four times as much as if all its mass were in the motors. Effects that are found stand: one that is
//!   missing can make motors look weak.
//! - **Saturated motors**: commands at an end of their range for most of the flight are not what the motors did.
//!
//! Judged is the model with everything that is supported in place, and with what its residual is found to depend on taken away:
//! what is missing can flip a sign, or make a model worse than a mean, and is then the finding, with a name or without.

use model::{Axis, Effect, GROUPS, Group, Model, NotIdentified, PerGroup, Verdict};
use report::number::{fixed, significant};
use sysid::prepare::Prepared;
use sysid::{
    MotorResponse, Residuals, errors, has_rotation, inertia_ratios, motor_responses, sign_doubts,
    turns_too_weakly,
};

use crate::criteria::ABOVE_NOISE;
use crate::finding::Unexplained;
use crate::noise;

/// Part of the samples with a motor at an end of its range from which on its commands are not what it did: for most of the
/// time then, a motor may turn at another speed than the row says.
const SATURATED: f64 = 0.5;
/// Standard errors beyond which the wrong sign of a drag counts. Thrust and moments of rotors are hundreds of errors
/// from zero where flights determine them, and two the wrong way are a contradiction; the drag of a small craft is next to zero,
/// and real flights without load give 2.1 to 2.5 (crazyswarm2, C_dw).
const SMALL_SIGN_ERRORS: f64 = 4.0;
/// Part of the command range that counts as its end.
const END: f64 = 1e-3;

/// What of `model`, with its residuals on the flights held out, is not identified. `refused` says why it has no rotation,
/// and `left` what the residuals depend on.
pub(crate) fn unidentified(
    model: &Model,
    refused: &[String],
    left: &[Unexplained],
    train: &[&Prepared],
    (validate, held_out): (&[&Prepared], &[Residuals]),
) -> Vec<NotIdentified> {
    let mut found = Vec::new();
    if !has_rotation(model) {
        found.push(no_rotation(refused));
    }
    found.extend(of_signs(model));
    found.extend(worse_than_a_mean(model, left, validate, held_out));
    found.extend(too_weak(model, train).or_else(|| too_inert(model)));
    found.extend(saturated(model, &[train, validate].concat()));
    found
}

/// What a model file says is not identified. Files from before that was kept say it by their errors on the flights held out and
/// by the signs of their coefficients.
pub fn recorded(model: &Model) -> Vec<NotIdentified> {
    let Some(fit) = &model.fit else { return Vec::new() };
    if !fit.not_identified.is_empty() {
        return fit.not_identified.clone();
    }
    let mut found = Vec::new();
    if !has_rotation(model) {
        found.push(no_rotation(&fit.rotation_refused));
    }
    found.extend(of_signs(model));
    let is_worse = |axis: &Axis| fit.held_out[*axis].samples > 0 && fit.held_out[*axis].r2 <= 0.0;
    found.extend(spoken_of(model).filter(is_worse).map(|axis| no_better(axis, fit.held_out[axis].r2)));
    found
}

/// The verdicts on a change since a model was good, of the whole and of each part: an effect is named, or something is left
/// unexplained, or neither. Nothing can be said of a part that the model's own flights did not determine, unless the steady balance
/// of the rotors speaks for the rotation: what it found or would have seen is then the answer.
pub(crate) fn verdicts_of_change(
    model: &Model,
    (named, left): (&[Effect], &[Unexplained]),
    balance_speaks: bool,
) -> (Verdict, PerGroup<Verdict>) {
    let unknown = recorded(model);
    let of_group = |group| unknown.iter().filter(move |reason| reason.group == group);
    let speaks = |group| balance_speaks && group == Group::Rotation;
    let is_unknown = |group| !speaks(group) && of_group(group).next().is_some();
    let hides = |group| !speaks(group) && of_group(group).any(|reason| !reason.leaves_findings);
    let acts_on = |group| named.iter().any(|e| e.info().axes.iter().any(|axis| Group::of(*axis) == group));
    let verdicts = PerGroup::from_fn(|group| match group {
        _ if acts_on(group) && !hides(group) => Verdict::MissingEffect,
        _ if left.iter().any(|u| Group::of(u.axis) == group) => Verdict::Unexplained,
        _ if is_unknown(group) => Verdict::NotIdentified,
        _ => Verdict::Adequate,
    });
    let verdict = match (named, left) {
        ([_, ..], _) => Verdict::MissingEffect,
        ([], [_, ..]) => Verdict::Unexplained,
        // What the balance would have seen is not there, whatever is unknown of the air.
        ([], []) if balance_speaks || GROUPS.iter().all(|group| !is_unknown(*group)) => Verdict::Adequate,
        ([], []) => Verdict::NotIdentified,
    };
    (verdict, verdicts)
}

fn no_rotation(refused: &[String]) -> NotIdentified {
    let why = match refused {
        [] => "the model has forces only and says nothing of p, q and r".to_owned(),
        reasons => format!("the model has forces only, because {}", reasons.join("; ")),
    };
    NotIdentified::of_group(Group::Rotation, why, to_excite(Axis::P))
}

fn of_signs(model: &Model) -> impl Iterator<Item = NotIdentified> {
    let counts = |doubt: &sysid::SignDoubt| {
        match doubt.effect {
            Effect::Thrust | Effect::RotorMoments => true,
            // A warning tells: it is a small part of the rotation, and the first that follows what is missing.
            Effect::AngularDamping => false,
            _ => doubt.errors > SMALL_SIGN_ERRORS,
        }
    };
    let of = |doubt: sysid::SignDoubt| of_part(doubt.axis, doubt.sentence, doubt.effect.info().excitation);
    sign_doubts(model).into_iter().filter(counts).map(of)
}

/// Motors that turn the craft more strongly than the model says, where nothing but they acts. Gains designed from such a model
/// are too large by as much.
fn too_weak(model: &Model, train: &[&Prepared]) -> Option<NotIdentified> {
    let contradicting = motor_responses(model, train).into_iter().filter(MotorResponse::contradicts);
    let worst = contradicting.max_by(|a, b| a.lower.total_cmp(&b.lower))?;
    Some(NotIdentified::of_group(Group::Rotation, worst.sentence(), to_excite(worst.axis)))
}

/// Moments of inertia that no craft of this mass and arm has.
fn too_inert(model: &Model) -> Option<NotIdentified> {
    let [roll, pitch] = inertia_ratios(model).filter(|_| turns_too_weakly(model))?;
    let reason = format!(
        "its moments of inertia in roll and pitch come out as {} and {} times mass times arm_length squared, while real craft have 0.25 \
         to 0.45: the motors turn the craft much more strongly than the model says, or the vehicle file is wrong",
        significant(roll, 2),
        significant(pitch, 2)
    );
    let worst = if roll.abs() > pitch.abs() { Axis::P } else { Axis::Q };
    Some(NotIdentified {
        leaves_findings: true,
        ..NotIdentified::of_group(Group::Rotation, reason, to_excite(worst))
    })
}

/// An axis of the translation, or the whole rotation: a force is measured on each axis by itself, but the same four rotors on
/// the same clock turn the craft about all three, so what contradicts one axis of the rotation leaves none of them known.
fn of_part(axis: Axis, reason: String, fly: &str) -> NotIdentified {
    match Group::of(axis) {
        Group::Translation => NotIdentified::of_axis(axis, reason, fly),
        Group::Rotation => NotIdentified::of_group(Group::Rotation, reason, fly),
    }
}

/// Axes that a model says anything about.
fn spoken_of(model: &Model) -> impl Iterator<Item = Axis> {
    let with_rotation = has_rotation(model);
    model::AXES.into_iter().filter(move |axis| axis.is_force() || with_rotation)
}

/// What to fly so that an axis moves by what the basic model has on it.
fn to_excite(axis: Axis) -> &'static str {
    let effect = match axis {
        Axis::U | Axis::V => Effect::LinearDrag,
        Axis::W => Effect::Thrust,
        Axis::P | Axis::Q | Axis::R => Effect::RotorMoments,
    };
    effect.info().excitation
}

/// Part of an axis' squared error that goes with what its residual is found to depend on. A measured quantity alone is a
/// dependence on something: a constant that differs between flights, or an answer to the past of a prediction that is
/// worthless, is a part of not being identified.
fn explicable(axis: Axis, left: &[Unexplained]) -> f64 {
    let of_axis = left.iter().filter(|u| u.axis == axis && u.depends_on.quantity().is_some());
    of_axis.map(|u| 0.01 * u.share_percent).fold(0.0, f64::max)
}

/// Axes that are predicted no better than by a mean.
fn worse_than_a_mean(
    model: &Model,
    left: &[Unexplained],
    validate: &[&Prepared],
    held_out: &[Residuals],
) -> Vec<NotIdentified> {
    let errors = errors(held_out);
    let is_worse = |axis: &Axis| {
        let error = &errors[*axis];
        // Of the squared error over the squares about the mean, what is left once that has been taken away.
        error.samples > 0 && error.r2 <= 0.0 && (1.0 - error.r2) * (1.0 - explicable(*axis, left)) >= 1.0
    };
    let worse: Vec<Axis> = spoken_of(model).filter(is_worse).collect();
    if worse.is_empty() {
        return Vec::new();
    }
    let motion = noise::excess(validate, &about_mean(held_out), None);
    let reason = |axis: Axis| match motion[axis.index()] {
        Some(ratio) if ratio < ABOVE_NOISE => not_excited(axis, ratio),
        _ => no_better(axis, errors[axis].r2),
    };
    worse.into_iter().map(reason).collect()
}

fn not_excited(axis: Axis, ratio: f64) -> NotIdentified {
    let why = format!(
        "{axis} is not excited: on the held-out flights, the variance of what was measured is {} times that of the sensors' \
         noise alone",
        significant(ratio, 2)
    );
    NotIdentified::of_axis(axis, why, to_excite(axis))
}

fn no_better(axis: Axis, r2: f64) -> NotIdentified {
    // Two digits, and of one next to zero its sign.
    let digits = if r2 > -0.0095 { 5 } else { 2 };
    let why = format!(
        "{axis} is predicted no better than by its mean on the held-out flights (R2 = {})",
        fixed(r2, digits)
    );
    of_part(axis, why, to_excite(axis))
}

/// What was measured, about its mean over all flights, in the place of residuals: as R2 has it.
fn about_mean(held_out: &[Residuals]) -> Vec<Residuals> {
    let mean: [f64; 6] = std::array::from_fn(|axis| {
        let all = || held_out.iter().flat_map(|r| &r.measured[axis]);
        all().sum::<f64>() / all().count().max(1) as f64
    });
    let of_flight = |r: &Residuals| Residuals {
        measured: r.measured.clone(),
        residual: std::array::from_fn(|axis| r.measured[axis].iter().map(|y| y - mean[axis]).collect()),
    };
    held_out.iter().map(of_flight).collect()
}

/// Motors whose commands are at an end of their range for most of the flights. Forces along u and v come from the air.
fn saturated(model: &Model, flights: &[&Prepared]) -> Vec<NotIdentified> {
    let share = saturated_share(model, flights);
    if share < SATURATED {
        return Vec::new();
    }
    let why = format!(
        "in {} % of the samples, a motor command is at an end of command_range, where the motor need not follow it",
        fixed(100.0 * share, 0)
    );
    let fly = "fly more gently, or with a lighter craft, so that no motor is at its limit";
    let thrust = NotIdentified::of_axis(Axis::W, why.clone(), fly);
    let rotation = has_rotation(model).then(|| NotIdentified::of_group(Group::Rotation, why, fly));
    std::iter::once(thrust).chain(rotation).collect()
}

/// Part of the samples in which any motor's command is at an end of its range; of flights with measured rotor speeds, none.
fn saturated_share(model: &Model, flights: &[&Prepared]) -> f64 {
    let [low, high] = model.vehicle.motors.command_range;
    let slack = END * (high - low);
    let at_end = |command: f64| command >= high - slack || command <= low + slack;
    let (mut all, mut there) = (0, 0);
    for flight in flights {
        for stretch in &flight.stretches {
            let samples = stretch.command[0].len();
            all += samples;
            if !flight.has_rotor_speeds() {
                there += (0..samples).filter(|k| stretch.command.iter().any(|c| at_end(c[*k]))).count();
            }
        }
    }
    there as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};
    use model::{AxisError, FitRecord};
    use sysid::residuals;

    use super::*;
    use crate::dependence::Dependence;
    use crate::testing::{NONE, ORDINARY, prepared, truth};

    fn found(model: &Model, flights: &[Prepared]) -> Vec<NotIdentified> {
        let flights: Vec<&Prepared> = flights.iter().collect();
        let held_out: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, model)).collect();
        unidentified(model, &[], &[], &flights, (&flights, &held_out))
    }

    fn axes(found: &[NotIdentified]) -> Vec<(Group, Option<Axis>)> {
        found.iter().map(|reason| (reason.group, reason.axis)).collect()
    }

    fn forces_only() -> Model {
        let mut model = truth();
        model.terms.retain(|term| [Effect::Thrust, Effect::LinearDrag].contains(&term.effect));
        model
    }

    /// A craft that hangs in the air with constant commands: every sensor has its noise and nothing else.
    fn hover(commands: [f64; 4]) -> Prepared {
        use Column::*;
        // Numbers without a pattern, of mean 0 and variance 1: three uniform ones have a variance of 1/4.
        let noise = |k: usize, channel: usize| -> f64 {
            let uniform = |n: f64| {
                let x = (12.9898 * (k + 1) as f64 + 78.233 * (channel + 1) as f64 + 37.719 * n).sin()
                    * 43_758.545_3;
                x - x.floor() - 0.5
            };
            2.0 * (uniform(1.0) + uniform(2.0) + uniform(3.0))
        };
        let channel = |index: usize, mean: f64, deviation: f64| -> Vec<f64> {
            (0..2000).map(|k| mean + deviation * noise(k, index)).collect()
        };
        let mut columns: Vec<(Column, Vec<f64>)> = vec![(T, (0..2000).map(|k| 0.01 * k as f64).collect())];
        for (index, (column, mean, deviation)) in [
            (X, 0.0, 2.5e-4),
            (Y, 0.0, 2.5e-4),
            (Z, -1.0, 2.5e-4),
            (Phi, 0.0, 7e-4),
            (Theta, 0.0, 7e-4),
            (Psi, 0.0, 7e-4),
            (P, 0.0, 0.012),
            (Q, 0.0, 0.012),
            (R, 0.0, 0.012),
            (Vbat, 11.5, 0.0),
        ]
        .into_iter()
        .enumerate()
        {
            columns.push((column, channel(index, mean, deviation)));
        }
        for (column, command) in [Cmd1, Cmd2, Cmd3, Cmd4].into_iter().zip(commands) {
            columns.push((column, vec![command; 2000]));
        }
        Prepared::new(&Flight::from_columns("hover.csv", columns), &truth().vehicle).unwrap()
    }

    /// A third of the strength may be a wrong arm in the vehicle file; a sixth is no craft.
    #[test]
    fn motors_that_hardly_turn_the_craft_leave_the_rotation_unknown_and_findings_stand() {
        let mut model = truth();
        let moments = model.term(Effect::RotorMoments).unwrap().values();
        for (weaker, is_unknown) in [(1.0, false), (3.0, false), (6.0, true)] {
            model.set(Effect::RotorMoments, &moments.iter().map(|c| c / weaker).collect::<Vec<_>>());
            let unknown = too_inert(&model);
            assert_eq!(unknown.is_some(), is_unknown, "{weaker}");
            assert!(
                unknown.is_none_or(|unknown| unknown.leaves_findings && unknown.group == Group::Rotation)
            );
        }
    }

    #[test]
    fn flights_that_move_in_every_axis_determine_the_true_model() {
        assert_eq!(found(&truth(), &prepared(&truth(), 30..32, 10.0, &ORDINARY)), []);
    }

    #[test]
    fn an_axis_that_is_predicted_worse_than_by_its_mean_is_named_with_its_figure() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.6]);
        let flights = prepared(&truth(), 30..32, 10.0, &ORDINARY);
        let found = found(&heavy, &flights);
        assert_eq!(axes(&found), [(Group::Translation, Some(Axis::W))], "{found:?}");
        let said = &found[0].reason;
        let first = "w is predicted no better than by its mean on the held-out flights (R2 = -";
        assert!(said.starts_with(first), "{said}");
        assert_eq!(found[0].fly, "climb and descend");
    }

    #[test]
    fn motors_that_several_hertz_show_to_be_stronger_are_not_identified() {
        let flights = prepared(&truth(), 1..2, 24.0, &NONE);
        let says = |found: &[NotIdentified]| {
            let stronger = "between 4 and 16 Hz the motors turn the craft 3.";
            found.iter().any(|reason| reason.group == Group::Rotation && reason.reason.contains(stronger))
        };
        assert!(!says(&found(&truth(), &flights)));
        let mut weak = truth();
        let third: Vec<f64> =
            truth().term(Effect::RotorMoments).unwrap().values().iter().map(|value| value / 3.0).collect();
        weak.set(Effect::RotorMoments, &third);
        let found = found(&weak, &flights);
        assert!(says(&found), "{found:?}");
    }

    /// The weight that the model lacks is a constant; had it depended on the height, that would be told instead.
    #[test]
    fn an_axis_whose_residual_depends_on_something_is_unexplained_and_not_unidentified() {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.6]);
        let flights = prepared(&truth(), 30..32, 10.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let held_out: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, &heavy)).collect();
        let r2 = errors(&held_out).w.r2;
        assert!(r2 < 0.0, "{r2}");
        // Taking this part away leaves an R2 of zero.
        let enough = 100.0 * (1.0 - 1.0 / (1.0 - r2));
        let found = |share_percent, depends_on| {
            let left = [Unexplained { axis: Axis::W, depends_on, share_percent, p_value: 0.0 }];
            axes(&unidentified(&heavy, &[], &left, &flights, (&flights, &held_out)))
        };
        let height = Dependence::Quantity("height");
        assert_eq!(found(enough + 0.01, height), []);
        assert_eq!(found(enough - 0.01, height), [(Group::Translation, Some(Axis::W))]);
        assert_eq!(found(enough + 0.01, Dependence::Past).len(), 1);
        assert_eq!(found(enough + 0.01, Dependence::Constant).len(), 1);
    }

    #[test]
    fn what_varies_no_more_than_the_sensors_noise_is_not_excited() {
        let map = truth().vehicle.rotor_map();
        let flight = hover([map.command_for(635.0, 11.5); 4]);
        let found = found(&truth(), std::slice::from_ref(&flight));
        assert!(!found.is_empty());
        for reason in &found {
            let axis = reason.axis.expect("one axis each");
            assert!(reason.reason.starts_with(&format!("{axis} is not excited: ")), "{}", reason.reason);
            assert_eq!(reason.fly, to_excite(axis));
        }
    }

    #[test]
    fn a_model_of_forces_says_nothing_of_the_rotation_and_why() {
        let flights = prepared(&truth(), 30..31, 6.0, &ORDINARY);
        let found = found(&forces_only(), &flights);
        assert_eq!(axes(&found), [(Group::Rotation, None)], "{found:?}");
        let refused = no_rotation(&["clocks drift".into(), "nothing moves".into()]);
        assert_eq!(refused.reason, "the model has forces only, because clocks drift; nothing moves");
    }

    #[test]
    fn a_drag_that_accelerates_is_impossible_on_its_axis() {
        let mut model = truth();
        let mut drag = model.term(Effect::LinearDrag).unwrap().values();
        drag[1] *= -0.1;
        model.set(Effect::LinearDrag, &drag);
        let found: Vec<NotIdentified> = of_signs(&model).collect();
        assert_eq!(axes(&found), [(Group::Translation, Some(Axis::V))]);
        assert!(found[0].reason.contains("C_dv") && found[0].fly.contains("several speeds"), "{found:?}");
    }

    #[test]
    fn a_drag_next_to_zero_may_come_out_with_either_sign_and_a_motor_may_not() {
        let with_error = |effect: Effect, k: usize, errors: f64| {
            let mut model = truth();
            let term = model.terms.iter_mut().find(|term| term.effect == effect).unwrap();
            let estimate = &mut term.coefficients[k];
            estimate.std_error = Some(0.1 * estimate.value.abs());
            estimate.value *= -0.1 * errors;
            of_signs(&model).map(|reason| (reason.group, reason.axis)).collect::<Vec<_>>()
        };
        assert_eq!(with_error(Effect::LinearDrag, 2, 3.9), []);
        assert_eq!(with_error(Effect::LinearDrag, 2, 4.1), [(Group::Translation, Some(Axis::W))]);
        assert_eq!(with_error(Effect::RotorMoments, 5, 1.9), []);
        assert_eq!(with_error(Effect::RotorMoments, 5, 2.1), [(Group::Rotation, None)]);
    }

    #[test]
    fn motors_at_their_limit_for_most_of_the_time_determine_neither_thrust_nor_moments() {
        let [low, high] = truth().vehicle.motors.command_range;
        let flight = |command| hover([0.5 * (low + high), 0.5 * (low + high), command, 0.5 * (low + high)]);
        let limited = saturated(&truth(), &[&flight(high)]);
        assert_eq!(axes(&limited), [(Group::Translation, Some(Axis::W)), (Group::Rotation, None)]);
        assert!(limited[0].reason.starts_with("in 100 % of the samples"), "{limited:?}");
        assert_eq!(saturated(&forces_only(), &[&flight(low)]).len(), 1);
        let free = flight(high - 2.0 * END * (high - low));
        assert_eq!(saturated(&truth(), &[&free]), []);
        // One flight of three.
        assert_eq!(saturated(&truth(), &[&flight(high), &free, &free]), []);
    }

    #[test]
    fn a_file_that_does_not_keep_what_is_identified_says_it_by_its_errors() {
        let mut model = truth();
        assert_eq!(recorded(&model), [], "without a fit nothing was judged");
        let error = |r2| AxisError { sse: 1.0, rms: 0.1, r2, samples: 100 };
        let mut record =
            FitRecord { held_out: model::PerAxis::from_fn(|_| error(0.5)), ..FitRecord::default() };
        model.fit = Some(record.clone());
        assert_eq!(recorded(&model), []);
        record.held_out.q = error(-0.2);
        model.fit = Some(record.clone());
        assert_eq!(axes(&recorded(&model)), [(Group::Rotation, None)]);
        record.not_identified = vec![no_rotation(&[])];
        model.fit = Some(record.clone());
        assert_eq!(recorded(&model), record.not_identified);
    }

    #[test]
    fn of_what_the_models_flights_did_not_determine_no_change_is_denied() {
        let of = |model: &Model, named: &[Effect], balance| verdicts_of_change(model, (named, &[]), balance);
        let (adequate, missing, unknown) =
            (Verdict::Adequate, Verdict::MissingEffect, Verdict::NotIdentified);
        let told = |(whole, parts): (Verdict, PerGroup<Verdict>)| [whole, parts.translation, parts.rotation];
        assert_eq!(told(of(&truth(), &[], false)), [adequate; 3]);
        let mut forces = forces_only();
        forces.fit = Some(FitRecord::default());
        assert_eq!(told(of(&forces, &[], false)), [unknown, adequate, unknown]);
        let heavier = &[Effect::MassChange];
        assert_eq!(told(of(&forces, heavier, false)), [missing, missing, unknown]);
        assert_eq!(told(of(&truth(), heavier, false)), [missing, missing, adequate]);
        let twice = &[Effect::MassChange, Effect::ComOffset];
        assert_eq!(told(of(&truth(), twice, false)), [missing; 3]);
        // The balance speaks for a rotation that its rows do not know.
        assert_eq!(told(of(&forces, &[], true)), [adequate; 3]);
        let weak = &[Effect::MotorEfficiency];
        assert_eq!(told(of(&forces, weak, true)), [missing; 3]);
        let left = [Unexplained {
            axis: Axis::P,
            depends_on: Dependence::Constant,
            share_percent: 62.0,
            p_value: 0.0,
        }];
        let shifted = verdicts_of_change(&forces, (&[], &left), true);
        assert_eq!(told(shifted), [Verdict::Unexplained, adequate, Verdict::Unexplained]);
    }
}
