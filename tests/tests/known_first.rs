//! A known effect that flights hide is named by `discover` before any formula, under its name in the catalogue.
#![forbid(unsafe_code)]

use diagnosis::workflow::{self, FlightSets, Reading, Silent};
use diagnosis::{Discovery, Options};
use model::Effect;
use stories::world::{PLANTED, Pattern, Sensors, Size, World, changes, draws};

/// What is discovered of five flights of a craft with an effect of the catalogue in it.
fn discovered(id: &str, strength: f64, size: Size, seed: u64) -> Discovery {
    workflow::prepare_to_discover();
    let sensors = Sensors::noisy(1.0);
    let flights = |seed: u64| {
        let world = World::new(size, seed).with(id, strength).unwrap();
        let fly = |pattern: Pattern| world.fly(pattern, 24.0, &sensors, 0).ok();
        let all = Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE).map(fly).collect::<Option<Vec<_>>>()?;
        Some((world, all))
    };
    let (world, all) = draws(seed).find_map(flights).expect("a craft that its pilot can keep");
    let (train, validate) = all.split_at(Pattern::TRAIN.len());
    let mut sets =
        FlightSets::from_flights(train, validate, &world.vehicle, Reading::default(), &Silent).unwrap();
    let model = workflow::identify(&world.vehicle, &[], &mut sets, None, &Silent).unwrap().model;
    workflow::discover(&model, &[], &mut sets, &Options::default(), &Silent).unwrap()
}

/// Whether an effect that is hidden is the first that is named; what is said instead is printed.
fn is_first((id, strength, size, seed): (&str, f64, Size, u64)) -> bool {
    let found = discovered(id, strength, size, seed);
    let is_first = found.known.first().is_some_and(|first| first.id() == id);
    let proposed = found.proposals.first().map_or("nothing", |best| &best.formula);
    println!("{id:22} {strength:4} {:5} {seed}: {:?}, then {proposed}", size.name(), found.known);
    is_first
}

/// Effects of the catalogue that single flights can hide, not such as happen between flights.
fn hidden() -> impl Iterator<Item = &'static str> {
    PLANTED.iter().map(|seedling| seedling.id).filter(|id| !changes().any(|change| change == *id))
}

#[test]
fn known_effects_come_before_any_formula() {
    let trials = [
        ("ground-effect", 1.0, Size::F330, 1),
        ("quadratic-drag", 1.0, Size::Small, 2),
        ("motor-lag", 1.0, Size::F330, 3),
        ("tether", 1.0, Size::Small, 4),
    ];
    for trial in trials {
        assert!(Effect::from_id(trial.0).is_some_and(|effect| Effect::candidates().any(|own| own == effect)));
        assert!(is_first(trial), "{trial:?}");
    }
}

/// Every effect of the catalogue on two craft, at two strengths.
#[test]
#[ignore = "minutes: part `forms` of the night"]
fn every_known_effect_comes_before_any_formula() {
    let of =
        |id| Size::MAIN.into_iter().flat_map(move |size| [1.0, 0.5].map(|strength| (id, strength, size, 1)));
    let trials: Vec<_> = hidden().flat_map(of).collect();
    let first = trials.iter().filter(|trial| is_first(**trial)).count();
    println!("named first: {first} of {}", trials.len());
    assert_eq!(first, trials.len());
}
