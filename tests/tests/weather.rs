//! A wind that wanders within each flight hides nothing of the craft, and is told itself.
#![forbid(unsafe_code)]

use diagnosis::workflow::{self, FlightSets, Reading, Silent};
use diagnosis::{Options, Verdict};
use model::Effect;
use stories::world::{Pattern, Sensors, Size, World};
use sysid::{FaultKind, fit::gusts};

/// Flights of a craft in a wind of 1 m/s north and east (standard deviation) that wanders within 4 s.
fn in_gusts(mut world: World) -> FlightSets {
    world.craft.strange.wandering_m_s = 1.0;
    let fly = |pattern: Pattern| world.fly(pattern, 24.0, &Sensors::default(), 0).expect("the pilot copes");
    let (train, validate) = (Pattern::TRAIN.map(fly), Pattern::VALIDATE.map(fly));
    FlightSets::from_flights(&train, &validate, &world.vehicle, Reading::default(), &Silent).unwrap()
}

#[test]
fn nothing_of_the_craft_is_missing_in_a_wind_that_wanders() {
    for (size, seed) in [(Size::F330, 2), (Size::Small, 3)] {
        let world = World::new(size, seed);
        let vehicle = world.vehicle.clone();
        let mut sets = in_gusts(world);
        let basic = workflow::identify(&vehicle, &[], &mut sets, None, &Silent).unwrap().model;
        let found = workflow::diagnose(&basic, &[], &mut sets, &Options::default(), &Silent).unwrap();
        assert_eq!(found.verdict, Verdict::Adequate, "{}", found.summary);
        assert!(sets.faults.has(FaultKind::WanderingWind));
        // Of both axes together 1.4 m/s; in flights of 24 s, six times the 4 s, it comes out so within half of it. What was
        // there all the time is the mean's.
        for flight in sets.all() {
            let rms_m_s = gusts::rms_m_s(&flight.prepared);
            assert!((0.7..2.8).contains(&rms_m_s), "{rms_m_s}");
        }
    }
}

#[test]
fn what_is_missing_is_found_beside_a_wind_that_wanders() {
    for (id, effect, seed) in
        [("flapping-moment", Effect::FlappingMoment, 4), ("ground-effect", Effect::GroundEffect, 5)]
    {
        let world = World::new(Size::F330, seed).with(id, 1.0).unwrap();
        let vehicle = world.vehicle.clone();
        let mut sets = in_gusts(world);
        let explained =
            workflow::explain(&vehicle, &[], &mut sets, &Options::default(), None, &Silent).unwrap();
        assert_eq!(explained.found(), [effect], "{}", explained.conclusion());
        assert!(sets.faults.has(FaultKind::WanderingWind));
    }
}
