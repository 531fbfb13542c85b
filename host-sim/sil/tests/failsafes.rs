//! Every rule of the supervisor with a flight that sets it off and one that just does not, over
//! hover, climb and pattern with noise; and flights in which nothing is wrong, which no rule may
//! disturb.

use control::{Condition, Config};
use model::Model;
use proto::State;
use sil::failsafe::ExpectedResponse;
use sil::{Fault, FaultKind, FlightPlan, NoiseModel, Scenario, Settings, designed_config, drills, fly};

/// Under the thesis' gains and under designed ones, with twenty seeds each. (Under others:
/// `cargo xtask sil --failsafes --seeds 20 --gains FILE`.)
#[test]
fn every_drill_ends_as_expected() {
    for (gains, config) in [("thesis", Config::thesis()), ("designed", designed_config().unwrap())] {
        for drill in drills() {
            for seed in 1..=20 {
                for found in drill.fly(seed, &config).unwrap() {
                    assert!(
                        found.holds,
                        "{} ({gains} gains, seed {seed}): expected {:?} within {} m, found {found:?}",
                        drill.name, drill.expected, drill.within_m
                    );
                    // Gains that know the end of a motor hold the craft for long enough to tell which it is.
                    if let ("designed", ExpectedResponse::NamesOrIsCut(motor, _)) = (gains, drill.expected) {
                        assert_eq!(
                            found.failed_motor,
                            Some(motor),
                            "{} (seed {seed}): {found:?}",
                            drill.name
                        );
                    }
                }
            }
        }
    }
}

/// Nothing is left out: each condition that does something has a drill that sets it off and one
/// that does not.
#[test]
fn every_rule_has_both_drills() {
    let list = drills();
    // Not from a sensor of a craft in the air: forced in the autopilot's own tests.
    let elsewhere = [Condition::FlightRequested, Condition::NotANumber];
    // Whether a craft stands down in the air is checked in every drill.
    let landing = Condition::Landed;
    // Requests need no near miss: a request is or is not.
    let requests = [
        Condition::DisarmRequested,
        Condition::LandRequested,
        Condition::CutRequested,
        Condition::ArmRequested,
    ];
    for rule in Condition::ALL.into_iter().filter(|rule| !elsewhere.contains(rule)) {
        let of_rule = || list.iter().filter(|drill| drill.rule == rule);
        let goes = |drill: &&sil::Drill| {
            use ExpectedResponse::{Goes, GoesAndMayCrash, NamesOrIsCut};
            matches!(drill.expected, Goes(_) | GoesAndMayCrash(_) | NamesOrIsCut(..))
        };
        let nearly = |drill: &&sil::Drill| {
            use ExpectedResponse::{Flies, Short, Survives};
            matches!(drill.expected, Flies | Short(_) | Survives)
        };
        assert!(
            of_rule().any(|drill| goes(&drill))
                || [Condition::BatteryLow, Condition::ArmRequested].contains(&rule),
            "{rule:?} is not set off"
        );
        let warns_only = rule == Condition::BatteryLow;
        assert!(
            warns_only
                || rule == landing
                || requests.contains(&rule)
                || of_rule().any(|drill| nearly(&drill)),
            "{rule:?} has no near miss"
        );
    }
}

/// Without a fault no drill's flight leaves the pilot's hands, or the drills would prove little.
#[test]
fn without_a_fault_every_drill_flies_on() {
    for seed in 1..=4 {
        for flight in 0..3 {
            let (mut plan, _) = drills()[0].plan(flight, seed, &Config::thesis());
            plan.faults.clear();
            let recording = fly(&plan).unwrap();
            assert!(
                recording.complete && recording.rows.iter().all(|row| row.supervision.state == State::Flying)
            );
        }
    }
}

/// The named flights and 40 identification flights raise no condition at all (a pilot's command for
/// flight aside).
#[test]
fn normal_flights_raise_nothing() {
    let mut plans: Vec<(String, FlightPlan)> = Vec::new();
    for noise in [None, Some(NoiseModel::default())] {
        for scenario in Scenario::standard() {
            plans.push((scenario.name().into(), scenario.plan(&Settings { noise, ..Settings::default() })));
        }
    }
    for seed in 0..40 {
        plans.push((
            format!("identification {seed}"),
            FlightPlan::identification(Model::thesis(), seed, 30.0),
        ));
    }
    for (name, plan) in plans {
        let recording = fly(&plan).unwrap();
        for (k, row) in recording.rows.iter().enumerate() {
            assert_eq!(
                (row.supervision.state, row.supervision.conditions),
                (State::Flying, 0),
                "{name} at {} s",
                recording.time_s(k)
            );
        }
    }
}

/// Ten minutes from 30 s before the 32-bit clock wraps, and before half of it, are, bit for bit, those from zero.
#[test]
fn the_wrap_of_the_clock_is_no_event() {
    let mut plan =
        Scenario::Pattern.plan(&Settings { noise: Some(NoiseModel::default()), ..Settings::default() });
    plan.duration_s = 600.0;
    // A silence across the wrap, so that a timer runs through it.
    plan.faults = vec![Fault { kind: FaultKind::LinkSilent, from_s: 29.7, for_s: 0.6 }];
    let from_zero = fly(&plan).unwrap();
    for wrap_us in [0_u32, 1 << 31] {
        plan.clock_us = wrap_us.wrapping_sub(30_000_000);
        assert!(fly(&plan).unwrap() == from_zero, "from {} us", plan.clock_us);
    }
    let held = from_zero.rows.iter().filter(|row| row.supervision.state == State::Hold).count();
    assert!((50..80).contains(&held), "0.6 s of silence hold from 0.5 s until 0.5 s after: {held} ticks");
}

/// A configuration without the table of the supervisor flies the same flight: thesis and defaults
/// differ in the battery only.
#[test]
fn defaults_fly_as_the_thesis_does() {
    let mut plan = FlightPlan::thesis();
    let with = fly(&plan).unwrap();
    plan.config = Config { supervision: control::Supervision::default(), ..plan.config };
    assert_eq!(fly(&plan).unwrap(), with);
}
