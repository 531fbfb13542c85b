//! What the demonstration hides: one effect drawn by chance, as strong as crafts of this size have it.

use std::path::Path;

use model::{Coefficient, Effect, Model};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use sil::FlightPlan;

use crate::cli::next_flight::without_cancellers;

/// A coefficient's range; with `either_sign` the sign is drawn too.
struct Strength {
    range: (f64, f64),
    either_sign: bool,
}

const fn within(low: f64, high: f64) -> Strength {
    Strength { range: (low, high), either_sign: false }
}

const fn either_way(low: f64, high: f64) -> Strength {
    Strength { range: (low, high), either_sign: true }
}

/// Effects that can be hidden and how strong they are, in the order and units of their coefficients. Flapping and rate
/// coupling are about what the thesis identified (tables 4.2, 4.4, 4.8, 4.10), the tracked point about its 5.4 cm below the
/// centre of mass (4.7); a map without voltage misses its 44.65 rad/s/V (4.11). Ground effect is two to three times that of a
/// single rotor (Cheeseman and Bennett), the wind a draught, the tilt one to two degrees.
const HIDDEN: &[(Effect, &[Strength])] = &[
    (Effect::QuadraticDrag, &[within(-0.32, -0.22), within(-0.32, -0.22)]),
    (Effect::FlappingMoment, &[within(-4.5, -3.0), within(2.4, 3.6)]),
    (Effect::RateCoupling, &[within(-0.3, -0.17), within(0.17, 0.3)]),
    (Effect::GroundEffect, &[within(1.5, 2.5), within(0.0, 0.02)]),
    (Effect::SteadyWind, &[either_way(0.7, 1.4), either_way(0.7, 1.4)]),
    (Effect::BatteryVoltage, &[within(35.0, 50.0), within(-0.2, 0.2)]),
    (Effect::TrackingOffset, &[either_way(0.01, 0.02), either_way(0.01, 0.02), within(0.04, 0.07)]),
    (Effect::AttitudeOffset, &[either_way(0.018, 0.035), either_way(0.018, 0.035)]),
];

/// The craft of the demonstration with nothing missing from its basic model.
pub(crate) fn craft() -> Model {
    Model::parse(include_str!("../../data/craft.toml"), Path::new("craft.toml"))
        .expect("the model file in the source tree is tested")
}

/// A flight to identify the craft from. The thesis' law with one change: no zero-cancellers in roll and pitch. They cancel
/// a zero at the drag's rate that shows only where flapping moments couple speed to attitude (5.20); on a craft without
/// them the position loops swing out of the cage. Without the cancellers it stays inside with every hidden effect.
pub(crate) fn flight_plan(craft: &Model, seed: u64, duration_s: f64) -> FlightPlan {
    let mut plan = FlightPlan::identification(craft.clone(), seed, duration_s);
    without_cancellers(&mut plan.config);
    plan
}

/// The craft with one effect more, and that effect.
pub(crate) fn draw(seed: u64) -> (Model, Effect) {
    let mut generator = Pcg64::seed_from_u64(seed);
    let (effect, strengths) = &HIDDEN[generator.random_range(0..HIDDEN.len())];
    let values: Vec<f64> = strengths
        .iter()
        .map(|s| {
            let size = generator.random_range(s.range.0..s.range.1);
            if s.either_sign && generator.random_bool(0.5) { -size } else { size }
        })
        .collect();
    let mut model = craft();
    model.set(*effect, &values);
    (model, *effect)
}

/// Values of an effect's coefficients that a craft of this size can have: the middle of what can be hidden, or the
/// ordinary magnitudes with a possible sign; for an effect with one coefficient a rotor, one rotor's.
pub(crate) fn typical(effect: Effect) -> Vec<f64> {
    if let Some((_, strengths)) = HIDDEN.iter().find(|(hidden, _)| *hidden == effect) {
        return strengths.iter().map(|s| 0.5 * (s.range.0 + s.range.1)).collect();
    }
    let info = effect.info();
    let value = |(index, c): (usize, &Coefficient)| match c.possible {
        _ if info.special.per_rotor > 0 && index >= info.special.per_rotor => 0.0,
        (_, high) if high <= 0.0 => -c.typical,
        _ => c.typical,
    };
    info.coefficients.iter().enumerate().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_can_be_drawn_and_is_possible() {
        let mut drawn: Vec<Effect> = Vec::new();
        for seed in 0..200 {
            let (model, effect) = draw(seed);
            let term = model.term(effect).expect("the effect was set");
            for (estimate, c) in term.coefficients.iter().zip(effect.info().coefficients) {
                assert!(
                    (c.possible.0..=c.possible.1).contains(&estimate.value),
                    "seed {seed}: {effect} {}",
                    c.name
                );
            }
            assert_eq!(model.terms.len(), craft().terms.len() + 1, "seed {seed}");
            if !drawn.contains(&effect) {
                drawn.push(effect);
            }
        }
        assert_eq!(drawn.len(), HIDDEN.len());
    }

    #[test]
    fn the_craft_is_the_basic_model_and_a_possible_body() {
        let craft = craft();
        assert_eq!(craft.effects(), Effect::basic().collect::<Vec<_>>());
        let values =
            |effect| craft.term(effect).unwrap().coefficients.iter().map(|c| c.value).collect::<Vec<_>>();
        // Ratios of three moments of inertia obey a + b + c + a b c = 0. The printed three digits leave 0.001.
        let [a, b, c] = values(Effect::InertiaCoupling)[..] else { panic!("three ratios") };
        assert!((a + b + c + a * b * c).abs() < 2e-3, "{}", a + b + c + a * b * c);
        assert!(values(Effect::AngularDamping).iter().all(|d| *d < 0.0));
        assert_eq!(craft.vehicle.motors, model::Vehicle::thesis().motors);
    }
}
