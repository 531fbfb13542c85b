//! Forms that are hidden in flights of the product's own plant, as effects of users: a search finds them again.

mod common;

use std::path::Path;

use common::{ORDINARY, fly, truth};
use diagnosis::workflow::{FlightSets, Reading, Silent, discover, prepare_to_discover};
use diagnosis::{Discovery, DiscoveryVerdict, Options};
use flights::Flight;
use model::{Effect, Model};

/// What is discovered of flights of a world about a model that is fitted to them without what is hidden.
fn discovered(world: &Model) -> Discovery {
    prepare_to_discover();
    let flown = |seed: u64| -> Flight { fly(world, seed, 15.0, &ORDINARY) };
    let (train, validate) = ([1, 2, 3].map(flown), [4, 5].map(flown));
    let vehicle = truth().vehicle;
    let mut sets =
        FlightSets::from_flights(&train, &validate, &vehicle, Reading::default(), &Silent).unwrap();
    let model = sysid::fit(&sets.train(), &vehicle, &truth().effects(), None).unwrap().model;
    discover(&model, &[], &mut sets, &Options::default(), &Silent).unwrap()
}

/// The true model with an effect of a user hidden in it.
fn world(text: &str, values: &[f64]) -> Model {
    let [user] = model::effects::draft(text, Path::new("hidden.toml")).unwrap()[..] else {
        panic!("one effect")
    };
    let mut world = truth();
    world.set(Effect::User(user), values);
    world
}

#[test]
fn a_hidden_jet_of_air_is_found_where_it_blows() {
    let text = "[[effect]]\nid = \"jet\"\nacceleration.north = \"k * exp(-((east - at) / wide)^2 / 2) / mass\"\ncoefficient = [\
                {name = \"k\", unit = \"N\", possible = [-9.0, 9.0], typical = 0.5}, \
                {name = \"at\", unit = \"m\", possible = [-9.0, 9.0], typical = 0.3}, \
                {name = \"wide\", unit = \"m\", possible = [0.01, 9.0], typical = 0.3}]\n";
    let hidden = [0.6, 0.25, 0.35];
    let discovery = discovered(&world(text, &hidden));
    assert_eq!(discovery.verdict, DiscoveryVerdict::Proposed);
    let best = &discovery.proposals[0];
    assert_eq!(best.quantities, ["east"], "{}", best.formula);
    assert_eq!(best.formula, "north: k * exp(-((east - center) / width)^2 / 2) / mass");
    for (found, expected) in best.coefficients.iter().zip(hidden) {
        let off = (found.value - expected).abs();
        assert!(off < 4.0 * found.std_error && found.std_error < 0.05 * expected.abs(), "{found:?}");
    }
    assert!(best.share_of_structure_percent > 80.0 && best.p_value < 1e-3, "{best:?}");
    assert!(
        best.sentence.starts_with("A force along north acts where the place east is near 0.2"),
        "{}",
        best.sentence
    );
    assert!(discovery.model.effects().len() > truth().effects().len());
}

#[test]
fn nothing_is_proposed_where_nothing_is_hidden() {
    let discovery = discovered(&truth());
    assert!(discovery.proposals.is_empty(), "{:?}", discovery.proposals[0].formula);
    assert_eq!(discovery.verdict, DiscoveryVerdict::Nothing);
}

/// A known effect comes first, under its own name.
#[test]
fn what_is_known_is_not_discovered() {
    let mut world = truth();
    world.set(Effect::QuadraticDrag, &[-0.25; 2]);
    let discovery = discovered(&world);
    assert_eq!(discovery.known, [Effect::QuadraticDrag]);
    assert_eq!(
        discovery.verdict,
        DiscoveryVerdict::Nothing,
        "{:?}",
        discovery.proposals.first().map(|p| &p.formula)
    );
}
