//! A wind is told from what is fixed to the craft by flying at several headings.
//!
//! At one heading, a wind from ahead and whatever else pushes the craft backwards are the same: a tracked attitude that leans, an uneven
//! body, air that the craft itself moves. The data cannot say which it is, however small the error of its estimate.

use model::Effect;
use report::number::fixed;
use sysid::Prepared;

use crate::discovery::form::Form;
use crate::observer::Observer;
use crate::workflow::sets::FlightSets;

/// Spread of the headings under which they count as one, rad: that of headings 40 degrees apart. From one of these to the other, the
/// craft sees a wind turn by so much that two thirds of its strength come from another side.
const LEAST_SPREAD_RAD: f64 = 0.35;

/// Warns where effects that stay with the room, such as a wind, were found in flights at one heading.
pub(crate) fn warn_of_one_heading(found: &[Effect], sets: &FlightSets, observer: &dyn Observer) {
    let winds = found.iter().filter(|effect| effect.info().special.fixed_to_room);
    warn_of(&winds.map(|effect| effect.id()).collect::<Vec<_>>(), sets, observer);
}

/// Warns where forms that push along directions of the room were found in flights at one heading.
pub(crate) fn warn_of_forms_at_one_heading(found: &[Form], sets: &FlightSets, observer: &dyn Observer) {
    let any = found.iter().any(|form| form.channel.is_fixed_to_room());
    warn_of(if any { &["a force along directions of the room"] } else { &[] }, sets, observer);
}

fn warn_of(found: &[&str], sets: &FlightSets, observer: &dyn Observer) {
    let flights: Vec<&Prepared> = sets.all().map(|flight| &flight.prepared).collect();
    if let Some(warning) = one_heading(found, &flights) {
        observer.warning(&warning);
    }
}

fn one_heading(found: &[&str], flights: &[&Prepared]) -> Option<String> {
    if found.is_empty() {
        return None;
    }
    let stretches = flights.iter().flat_map(|flight| &flight.stretches);
    let spread_rad = spread_rad(stretches.flat_map(|stretch| &stretch.euler_rad[2]));
    (spread_rad < LEAST_SPREAD_RAD).then(|| {
        format!(
            "flights: all at one heading (to {} deg), so {} may be fixed to the craft and not to the room, such as a tracked attitude \
             that leans; to tell, fly the same patterns at a heading 90 deg away",
            fixed(spread_rad.to_degrees(), 1),
            found.join(" and ")
        )
    })
}

/// Standard deviation of angles about their mean direction, rad (K. Mardia, P. Jupp, Directional Statistics, 2000, (2.3.11)): the same for
/// angles that differ by whole turns.
fn spread_rad<'a>(angles_rad: impl Iterator<Item = &'a f64>) -> f64 {
    let (mut sine, mut cosine, mut count) = (0.0, 0.0, 0.0);
    for angle in angles_rad {
        sine += angle.sin();
        cosine += angle.cos();
        count += 1.0;
    }
    let length: f64 = f64::hypot(sine, cosine) / count;
    // Equal angles may have a mean that is longer than 1 by rounding.
    (-2.0 * length.min(1.0).ln()).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::loaded;
    use crate::workflow::LoadedFlight;

    /// Of a uniform spread of half width w the mean is sin(w) / w long; of all around, 0.
    #[test]
    fn the_spread_of_angles_does_not_count_turns() {
        let even =
            |half: f64| -> Vec<f64> { (0..=2000).map(|k| half * (f64::from(k) / 1000.0 - 1.0)).collect() };
        for half in [0.01_f64, 0.3, 1.0, 3.0] {
            let expected = (-2.0 * (half.sin() / half).ln()).sqrt();
            let turned: Vec<f64> = even(half)
                .iter()
                .zip((0..3).cycle())
                .map(|(a, k)| a + 7.0 + f64::from(k) * std::f64::consts::TAU)
                .collect();
            for angles in [even(half), turned] {
                assert!((spread_rad(angles.iter()) - expected).abs() < 0.01 * expected, "{half}");
            }
        }
        assert_eq!(spread_rad([2.0; 5].iter()), 0.0);
    }

    #[test]
    fn what_stays_with_the_room_is_doubted_at_one_heading() {
        let mut flights = loaded(1..3);
        let said = |flights: &[LoadedFlight], found: &[&str]| {
            one_heading(found, &flights.iter().map(|flight| &flight.prepared).collect::<Vec<_>>())
        };
        let mut head = |heading_rad: [f64; 2]| {
            for (flight, heading_rad) in flights.iter_mut().zip(heading_rad) {
                for stretch in &mut flight.prepared.stretches {
                    stretch.euler_rad[2].fill(heading_rad);
                }
            }
            flights.clone()
        };
        let one = head([0.5, 0.6]);
        let warning = said(&one, &["wind-shear", "steady-wind"]).unwrap();
        assert!(warning.contains("(to 2.9 deg), so wind-shear and steady-wind may be fixed"), "{warning}");
        assert_eq!(said(&one, &[]), None);
        assert_eq!(said(&head([0.5, 2.1]), &["wind-shear"]), None);
    }
}
