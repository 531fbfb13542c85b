//! Logs as they really are: clocks apart by a time of their own in each flight, trim that changes from run to run,
//! coefficients that must predict. Everything is put into simulated flights, so the truth is known.

mod common;

use common::{NONE, Noise, ORDINARY, fly, truth};
use flights::{Column, Flight};
use model::{Effect, Estimate, Model, MotorMapKind, RotorQuantity, Spin, Vehicle};
use sysid::fit::output_error::{RefineError, Rows};
use sysid::{Prepared, Reference, align, align_to, compare, fit, motors_of_flights, refine, rotation_doubts};

const PERIOD_S: f64 = 0.01;
const COMMANDS: [Column; 4] = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];
const SPEEDS: [Column; 4] = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];

fn basic() -> Vec<Effect> {
    Effect::basic().collect()
}

fn zeros(vehicle: &Vehicle, effects: &[Effect]) -> Model {
    let mut model = Model::new(vehicle.clone());
    effects.iter().for_each(|e| model.set(*e, &vec![0.0; e.info().coefficients.len()]));
    model
}

fn prepare(flights: &[Flight], vehicle: &Vehicle) -> Vec<Prepared> {
    flights.iter().map(|f| Prepared::new(f, vehicle).unwrap()).collect()
}

fn references(flights: &[Prepared]) -> Vec<&Prepared> {
    flights.iter().collect()
}

fn align_all(flights: &mut [Prepared], model: &Model) {
    align(&mut flights.iter_mut().collect::<Vec<_>>(), model);
}

/// The flight with some of its columns replaced.
fn with(flight: &Flight, replaced: Vec<(Column, Vec<f64>)>) -> Flight {
    use Column::*;
    let names = [T, X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
    let kept = names
        .into_iter()
        .filter(|name| replaced.iter().all(|(new, _)| new != name))
        .map(|name| (name, flight.column(name).unwrap().to_vec()))
        .collect::<Vec<_>>();
    Flight::from_columns(flight.name.clone(), kept.into_iter().chain(replaced))
}

/// Commands logged `samples` later than they were given.
fn commands_late(flight: &Flight, samples: isize) -> Flight {
    let late = |name: Column| {
        let logged = flight.column(name).unwrap();
        let last = logged.len() as isize - 1;
        (name, (0..=last).map(|k| logged[(k - samples).clamp(0, last) as usize]).collect())
    };
    with(flight, COMMANDS.map(late).to_vec())
}

/// The rotors' speeds as the simulated craft had them, logged `late(t)` seconds late: first-order lags of what the map
/// makes of the commands, exact between samples. For flights without noise on the battery.
fn with_speeds(flight: &Flight, vehicle: &Vehicle, late: impl Fn(f64) -> f64) -> Flight {
    let battery = flight.column(Column::Vbat).unwrap();
    let (map, lag) = (vehicle.rotor_map(), vehicle.motors.lag.unwrap());
    let speeds = COMMANDS.into_iter().zip(SPEEDS).map(|(command, speed)| {
        let asked: Vec<f64> = flight
            .column(command)
            .unwrap()
            .iter()
            .zip(battery)
            .map(|(command, volts)| map.speed_rad_s(*command, *volts))
            .collect();
        let mut now = 635.0;
        let at_samples: Vec<f64> = asked
            .iter()
            .map(|target| {
                let before = now;
                now = target + (now - target) * (-lag * PERIOD_S).exp();
                before
            })
            .collect();
        let last = asked.len() - 1;
        let logged = (0..=last)
            .map(|k| {
                let place = (k as f64 - late(k as f64 * PERIOD_S) / PERIOD_S).clamp(0.0, last as f64);
                let (at, part) = (place.floor() as usize, place.fract());
                asked[at] + (at_samples[at] - asked[at]) * (-lag * part * PERIOD_S).exp()
            })
            .collect();
        (speed, logged)
    });
    with(flight, speeds.collect())
}

/// Ordinary noise, but none on the battery: rotor speeds are made from it.
const QUIET_BATTERY: Noise = Noise { battery_v: 0.0, ..ORDINARY };

fn assert_recovered(flights: &[Prepared], late_samples: &[f64]) {
    for (flight, expected) in flights.iter().zip(late_samples) {
        let found = flight.alignment.as_ref().unwrap();
        let error_s = found.late_s - expected * PERIOD_S;
        // Five errors, plus a hundredth of a sample for straight lines between samples.
        assert!(error_s.abs() < 5.0 * found.std_error_s + 1e-4, "{expected} samples: {found:?}");
        // Sharp: a tenth of a sample.
        assert!(found.std_error_s < 1e-3, "{found:?}");
        assert_eq!(found.corrected, *expected != 0.0, "{expected} samples: {found:?}");
        assert!(found.wandering.is_empty(), "{found:?}");
    }
}

#[test]
fn measured_rotor_speeds_are_aligned_flight_by_flight() {
    let mut truth = truth();
    truth.set(Effect::RotorInertia, &[0.0016]);
    let late = [-2.0, 0.0, 1.5, 3.0];
    let flights: Vec<Flight> = late
        .iter()
        .zip(60..)
        .map(|(samples, seed)| {
            let flight = fly(&truth, seed, 25.0, &QUIET_BATTERY);
            with_speeds(&flight, &truth.vehicle, |_| samples * PERIOD_S)
        })
        .collect();
    let mut prepared = prepare(&flights, &truth.vehicle);
    let effects: Vec<Effect> = basic().into_iter().chain([Effect::RotorInertia]).collect();
    // The rotors' inertia is not in the model yet when flights are aligned.
    align_all(&mut prepared, &zeros(&truth.vehicle, &basic()));
    assert_recovered(&prepared, &late);

    let model = fit(&references(&prepared), &truth.vehicle, &effects, None).unwrap().model;
    for effect in [Effect::RotorMoments, Effect::Thrust, Effect::RotorInertia] {
        let (found, expected) = (model.term(effect).unwrap(), truth.term(effect).unwrap());
        for (f, t) in found.coefficients.iter().zip(&expected.coefficients) {
            // Beyond five errors (and half a percent for straight lines between samples) one in a million by chance.
            let distance = (f.value - t.value).abs() - 0.005 * t.value.abs();
            assert!(distance < 5.0 * f.std_error.unwrap(), "{effect}: {f:?}, true {t:?}");
        }
    }
    // A held-out flight, with the coefficients as they are.
    let flight = fly(&truth, 70, 25.0, &QUIET_BATTERY);
    let flight = with_speeds(&flight, &truth.vehicle, |_| -1.2 * PERIOD_S);
    let mut held_out = prepare(&[flight], &truth.vehicle);
    align_to(&model, &mut held_out.iter_mut().collect::<Vec<_>>(), Reference::Model(None));
    assert_recovered(&held_out, &[-1.2]);
}

/// Without a motor map, commands stand in for rotor speeds, unless every flight logged them.
#[test]
fn units_are_those_of_commands_unless_all_flights_log_their_rotors() {
    let truth = truth();
    let mut vehicle = truth.vehicle.clone();
    let motors = &mut vehicle.motors;
    (motors.map, motors.command, motors.voltage, motors.offset) =
        (Some(MotorMapKind::Identify), None, None, None);
    let commands: Vec<Flight> = (71..73).map(|seed| fly(&truth, seed, 15.0, &QUIET_BATTERY)).collect();
    let speeds: Vec<Flight> = commands.iter().map(|f| with_speeds(f, &truth.vehicle, |_| 0.0)).collect();
    let mixed = [commands[0].clone(), speeds[1].clone()];
    let thrust = |flights: &[Flight], vehicle: &Vehicle| {
        let prepared = prepare(flights, vehicle);
        let model = fit(&references(&prepared), vehicle, &basic(), None).unwrap().model;
        let rotors = model.rotor_quantity();
        let conditions = prepared[0].conditions(vehicle, &model.adjustments()).all();
        let drawn = conditions.iter().find(|c| c.name == "rotor speed").unwrap().unit;
        let logged = model.to_toml().contains("rotor_speeds_logged = true");
        (rotors, Effect::Thrust.info().coefficients[0].unit_for(rotors), drawn, logged)
    };
    let in_commands = (RotorQuantity::Command, "1/(s^2 cmd^2)", "cmd", false);
    assert_eq!(thrust(&commands, &vehicle), in_commands);
    assert_eq!(thrust(&mixed, &vehicle), in_commands);
    assert_eq!(thrust(&speeds, &vehicle), (RotorQuantity::Speed, "1", "rad/s", true));
    assert_eq!(thrust(&speeds, &truth.vehicle), (RotorQuantity::Speed, "1", "rad/s", false));
}

#[test]
fn commands_are_aligned_where_flights_differ() {
    let truth = truth();
    let late = [0, -2, 0, 3, 0];
    let flights: Vec<Flight> = late
        .iter()
        .zip(80..)
        .map(|(samples, seed)| commands_late(&fly(&truth, seed, 25.0, &ORDINARY), *samples))
        .collect();
    let mut prepared = prepare(&flights, &truth.vehicle);
    align_all(&mut prepared, &zeros(&truth.vehicle, &basic()));
    assert_recovered(&prepared, &late.map(|samples| samples as f64));
}

/// The same dead time in every flight is the craft's: no clock is blamed, and it is found as what it is.
#[test]
fn a_delay_of_all_flights_stays_an_input_delay() {
    let truth = truth();
    let flights: Vec<Flight> =
        (90..93).map(|seed| commands_late(&fly(&truth, seed, 25.0, &ORDINARY), -2)).collect();
    let mut prepared = prepare(&flights, &truth.vehicle);
    align_all(&mut prepared, &zeros(&truth.vehicle, &basic()));
    assert!(prepared.iter().all(|f| !f.alignment.as_ref().unwrap().corrected));
    let effects: Vec<Effect> = basic().into_iter().chain([Effect::InputDelay]).collect();
    let fitted = fit(&references(&prepared), &truth.vehicle, &effects, None).unwrap();
    let found = fitted.model.term(Effect::InputDelay).unwrap().coefficients[0];
    assert!((found.value - 0.02).abs() < 5.0 * found.std_error.unwrap(), "{found:?}");

    // A flight to compare with has it too, and is not corrected for it: the model's file says what is common.
    let basic_model = fit(&references(&prepared), &truth.vehicle, &basic(), None).unwrap().model;
    let delay = sysid::fit::alignment::common_delay_s(&basic_model, &references(&prepared));
    let flight = commands_late(&fly(&truth, 95, 25.0, &ORDINARY), -2);
    let mut held_out = prepare(&[flight], &truth.vehicle);
    align_to(&basic_model, &mut held_out.iter_mut().collect::<Vec<_>>(), Reference::Model(delay));
    assert!(!held_out[0].alignment.as_ref().unwrap().corrected, "{:?}", held_out[0].alignment);
}

#[test]
fn a_clock_that_wanders_within_a_flight_is_named() {
    let truth = truth();
    let flight = |seed, late: &dyn Fn(f64) -> f64| {
        with_speeds(&fly(&truth, seed, 40.0, &QUIET_BATTERY), &truth.vehicle, late)
    };
    // From three samples early to one late.
    let flights =
        [flight(100, &|t| (-3.0 + 4.0 * t / 40.0) * PERIOD_S), flight(101, &|_| 0.0), flight(102, &|_| 0.0)];
    let mut prepared = prepare(&flights, &truth.vehicle);
    align_all(&mut prepared, &zeros(&truth.vehicle, &basic()));
    let wandering: Vec<usize> =
        prepared.iter().map(|f| f.alignment.as_ref().unwrap().wandering.len()).collect();
    assert_eq!(wandering[1..], [0, 0]);
    assert!(wandering[0] >= 3);
    let pieces = &prepared[0].alignment.as_ref().unwrap().wandering;
    let (first, last) = (pieces[0].late_s, pieces[pieces.len() - 1].late_s);
    // From the middle of the first piece of 8 s to that of the last: 3.2 of the 4 samples.
    assert!((last - first - 0.032).abs() < 0.005, "{pieces:?}");
    assert!(prepared[0].alignment.as_ref().unwrap().note().unwrap().contains("wanders"));
}

/// A centre of mass that is elsewhere in each flight is trim; one that is off in all of them is the craft's.
#[test]
fn trim_is_what_flights_differ_by() {
    let flights = |forward_m: [f64; 3]| -> Vec<Prepared> {
        let one = |(forward, seed): (f64, u64)| {
            let mut truth = truth();
            truth.set(Effect::ComOffset, &[forward, 0.0]);
            with_speeds(&fly(&truth, seed, 25.0, &QUIET_BATTERY), &truth.vehicle, |_| 0.0)
        };
        prepare(&forward_m.into_iter().zip(110..).map(one).collect::<Vec<_>>(), &truth().vehicle)
    };
    let vehicle = truth().vehicle;
    let mut differing = flights([0.004, -0.004, 0.0]);
    sysid::fit::trim::estimate(&mut differing.iter_mut().collect::<Vec<_>>(), &zeros(&vehicle, &basic()));
    let pitch: Vec<f64> = differing.iter().map(|f| f.trim.map_or(0.0, |t| t.value[4])).collect();
    // The moment of the hover thrust on the lever, -4 mm * m g / Iyy, for Iyy = 0.0150 kg m^2; the fit's own levers
    // and manoeuvres move it by a few percent.
    let expected = -0.004 * vehicle.mass * vehicle.gravity / 0.015;
    assert!((pitch[0] / expected - 1.0).abs() < 0.15, "{pitch:?}, expected {expected}");
    assert!((pitch[1] / expected + 1.0).abs() < 0.15, "{pitch:?}, expected {expected}");
    assert!(pitch[2].abs() < 0.15 * expected.abs(), "{pitch:?}");
    assert!(differing.iter().all(|f| f.trim.is_none_or(|t| t.value[3] == 0.0)));

    let mut alike = flights([0.004; 3]);
    sysid::fit::trim::estimate(&mut alike.iter_mut().collect::<Vec<_>>(), &zeros(&vehicle, &basic()));
    assert!(alike.iter().all(|f| f.trim.is_none()), "{:?}", alike.iter().map(|f| f.trim).collect::<Vec<_>>());
}

/// Coefficients that are off are brought back, and predict better on a flight held out.
#[test]
fn refinement_brings_wrong_coefficients_back() {
    let truth = truth();
    let train = common::prepared(&truth, 120..122, 20.0, &ORDINARY);
    let validate = common::prepared(&truth, 125..126, 20.0, &ORDINARY);
    let mut wrong = fit(&references(&train), &truth.vehicle, &basic(), None).unwrap().model;
    for term in wrong.terms.iter_mut().filter(|t| t.effect == Effect::RotorMoments) {
        for (k, c) in term.coefficients.iter_mut().enumerate() {
            *c = Estimate { value: c.value * (0.9 + 0.02 * (k % 4) as f64), std_error: None };
        }
    }
    let refinement = refine(&wrong, &references(&train), &references(&validate), Rows::Moments).unwrap();
    assert!(refinement.outcome.kept, "{}", refinement.outcome.reason);
    let sums = |model: &Model| compare(model, &references(&validate)).horizons.sum_1_50;
    let (before, after) = (sums(&wrong), sums(&refinement.model));
    assert_eq!((before, after), (refinement.outcome.before, refinement.outcome.after));
    // Ten percent of the motors' moments is most of the error.
    assert!(after.rate_rad_s < 0.5 * before.rate_rad_s, "{before:?} {after:?}");
    // Forces are not touched.
    for effect in [Effect::Thrust, Effect::LinearDrag] {
        assert_eq!(refinement.model.term(effect), wrong.term(effect));
    }
    // Once right, there is little left to gain: errors are counted in units of a smaller start now, which weighs them anew.
    let again =
        refine(&refinement.model, &references(&train), &references(&validate), Rows::Moments).unwrap();
    assert!(again.outcome.after.rate_rad_s > 0.9 * after.rate_rad_s, "{:?}", again.outcome);
}

/// Flights of a craft with other motors lead away from the model; flights of its own craft say so, and it stays as it was.
#[test]
fn a_refinement_that_does_not_help_is_not_kept() {
    let truth = truth();
    let mut other = truth.clone();
    for term in other.terms.iter_mut().filter(|t| t.effect == Effect::RotorMoments) {
        term.coefficients.iter_mut().for_each(|c| c.value *= 1.3);
    }
    let strangers = common::prepared(&other, 130..132, 20.0, &ORDINARY);
    let own = common::prepared(&truth, 135..136, 20.0, &ORDINARY);
    let refinement = refine(&truth, &references(&strangers), &references(&own), Rows::Moments).unwrap();
    let outcome = &refinement.outcome;
    assert!(!outcome.kept && outcome.reason.starts_with("did not help"), "{}", outcome.reason);
    assert!(outcome.after.rate_rad_s > 1.5 * outcome.before.rate_rad_s, "{outcome:?}");
    assert_eq!(refinement.model, truth);
}

/// Motors that turn the other way than the vehicle file says: flights pull the reaction torques to their true sign, and a
/// model whose signs its vehicle cannot have is refused however well it predicts.
#[test]
fn a_refinement_to_impossible_signs_is_refused() {
    let truth = truth();
    let flights = common::prepared(&truth, 140..143, 20.0, &ORDINARY);
    let mut reversed = truth.clone();
    for spin in &mut reversed.vehicle.motors.spin {
        *spin = if *spin == Spin::Ccw { Spin::Cw } else { Spin::Ccw };
    }
    for term in reversed.terms.iter_mut().filter(|t| t.effect == Effect::RotorMoments) {
        term.coefficients[8..].iter_mut().for_each(|c| c.value = -c.value);
    }
    let all = references(&flights);
    let refinement = refine(&reversed, &all[..2], &all[2..], Rows::Moments).unwrap();
    let outcome = &refinement.outcome;
    assert!(!outcome.kept && outcome.reason.starts_with("refused: "), "{}", outcome.reason);
    assert!(outcome.after.rate_rad_s < outcome.before.rate_rad_s, "{outcome:?}");
    assert_eq!(refinement.model, reversed);
}

/// 95 % intervals of refined coefficients hold the truth in about 95 % of simulated identifications, though errors along
/// a rollout and of overlapping rollouts are anything but independent.
#[test]
fn refined_intervals_cover_the_truth() {
    let truth = truth();
    let runs = 24;
    let (mut inside, mut intervals) = (0, 0);
    let mut zs = [(0.0, 0.0); 15];
    for run in 0..runs {
        let train = common::prepared(&truth, 200 + 2 * run..202 + 2 * run, 20.0, &ORDINARY);
        let start = fit(&references(&train), &truth.vehicle, &basic(), None).unwrap().model;
        // Judged on itself: only the estimate matters here, not whether it is kept.
        let problem = sysid::fit::output_error::refined(&start, &references(&train), Rows::Moments).unwrap();
        for effect in [Effect::RotorMoments, Effect::AngularDamping] {
            let (found, expected) = (problem.term(effect).unwrap(), truth.term(effect).unwrap());
            for (f, t) in found.coefficients.iter().zip(&expected.coefficients) {
                inside += usize::from((f.value - t.value).abs() < 1.96 * f.std_error.unwrap());
                let z = (f.value - t.value) / f.std_error.unwrap();
                let i = (intervals % 15) as usize;
                zs[i].0 += z;
                zs[i].1 += z * z;
                intervals += 1;
            }
        }
    }
    for (k, (m, v)) in zs.iter().enumerate() {
        println!(
            "Z {k} mean {:.2} sd {:.2}",
            m / runs as f64,
            ((v - m * m / runs as f64) / runs as f64).sqrt()
        );
    }
    let covered = 100.0 * f64::from(inside as u32) / f64::from(intervals);
    assert!((90.0..98.0).contains(&covered), "{covered:.1} % of {intervals}");
}

#[test]
fn without_rotation_there_is_nothing_to_refine() {
    let truth = truth();
    let flights = common::prepared(&truth, 130..132, 15.0, &NONE);
    let forces = sysid::without_rotation(&basic());
    let model = fit(&references(&flights), &truth.vehicle, &forces, None).unwrap().model;
    let refused = refine(&model, &references(&flights), &references(&flights), Rows::All).unwrap_err();
    assert_eq!(refused, RefineError::NoRotation);
    // Predictions take the logged attitude: there is no error of it, and that of the position is small.
    let sums = compare(&model, &references(&flights)).horizons.sum_1_50;
    assert!(sums.attitude_rad.is_nan() && sums.rate_rad_s.is_nan() && sums.position_m < 1.0, "{sums:?}");
    let lone = fit(&references(&flights), &truth.vehicle, &[Effect::Thrust, Effect::FlappingMoment], None);
    assert!(lone.unwrap_err().to_string().contains("flapping-moment acts on the rotation alone"));
}

/// Motors in the wrong order push the wrong way: the rotation is refused. In the right order it is not, and single
/// flights have the same motors.
#[test]
fn impossible_motors_are_refused_and_good_ones_agree_between_flights() {
    let truth = truth();
    let flights: Vec<Flight> = (140..143).map(|seed| fly(&truth, seed, 25.0, &ORDINARY)).collect();
    let prepared = prepare(&flights, &truth.vehicle);
    let good = fit(&references(&prepared), &truth.vehicle, &basic(), None).unwrap().model;
    assert_eq!(rotation_doubts(&good, &references(&prepared)), Vec::<String>::new());
    for motors in motors_of_flights(&good, &references(&prepared)) {
        // 12 values less 4: the spread of a root mean square of 8 is 0.25.
        assert!((0.3..1.8).contains(&motors.spread), "{motors:?}");
        assert_eq!(motors.warning, None);
        assert_eq!(motors.flights.len(), 3);
    }

    let swapped = |flight: &Flight| {
        let column = |name| flight.column(name).unwrap().to_vec();
        with(flight, vec![(Column::Cmd1, column(Column::Cmd3)), (Column::Cmd3, column(Column::Cmd1))])
    };
    let wrong = prepare(&flights.iter().map(swapped).collect::<Vec<_>>(), &truth.vehicle);
    let model = fit(&references(&wrong), &truth.vehicle, &basic(), None).unwrap().model;
    let doubts = rotation_doubts(&model, &references(&wrong));
    assert!(doubts.iter().any(|d| d.contains("should be positive")), "{doubts:?}");
}
