//! Flights in which a slung load swings too wide to be followed.
//!
//! Beyond the horizontal a cable goes slack, and long before that the smallest difference in how the craft went decides where the load goes:
//! what is predicted of such a swing is wrong by more than what no load at all leaves. One such flight would outweigh several in which the
//! load is followed to a hundredth of its pull, so it is left out where others remain, and told.

use model::{Effect, Model};
use nalgebra::Vector3;

use crate::fit::slung_load::{Carried, of_model};
use crate::fit::unloaded::{body_dcm, places_m};
use crate::prepare::Prepared;

/// From the vertical, degrees: wider is too wide.
const WIDE_DEG: f64 = 75.0;
/// Part of a flight's samples with a wider swing from which on the flight is left out.
const WIDE_PART: f64 = 0.02;
/// Damping of the loads that flights are asked for before any is known: a swing that is damped more is narrower.
const LITTLE_DAMPING: f64 = 0.01;

/// How wide a load swings in a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WideSwing {
    /// The widest swing, from the vertical, degrees.
    pub widest_deg: f64,
    /// Part of the samples with a swing too wide to be followed.
    pub part: f64,
}

impl WideSwing {
    /// Of the load that a model carries, where it swings too wide to be followed.
    pub fn too_wide(flight: &Prepared, model: &Model) -> Option<Self> {
        let carried = of_model(model).filter(|carried| carried.load.cable_length_m > 0.0)?;
        Self::on(&places_m(flight, model, &body_dcm(flight, model)), flight.period_s, &carried)
    }

    /// The same where the craft goes from place to place, the load hanging still at the beginning of each stretch.
    fn on(places_m: &[Vec<Vector3<f64>>], period_s: f64, carried: &Carried) -> Option<Self> {
        let wide_cosine = WIDE_DEG.to_radians().cos();
        let (mut widest, mut wide, mut samples) = (1.0_f64, 0, 0);
        for places in places_m {
            for swing in carried.load.driven(places, [0.0; 4], period_s, carried.gravity_m_s2) {
                let cosine = swing.direction.z;
                widest = widest.min(cosine);
                wide += usize::from(cosine < wide_cosine);
                samples += 1;
            }
        }
        let widest_deg = widest.clamp(-1.0, 1.0).acos().to_degrees();
        let part = wide as f64 / samples.max(1) as f64;
        (part > WIDE_PART).then_some(Self { widest_deg, part })
    }
}

/// The flights in which the load of a model is followed; all, where it has none or is followed in none.
pub(crate) fn followable<'a>(flights: &[&'a Prepared], model: &Model) -> Vec<&'a Prepared> {
    let steady: Vec<&Prepared> =
        flights.iter().copied().filter(|flight| WideSwing::too_wide(flight, model).is_none()).collect();
    if steady.is_empty() { flights.to_vec() } else { steady }
}

/// A shape of a load to start from: values of its coefficients, where they are given.
type Start = Vec<Option<f64>>;

/// Flights without those in which a load on cables of some lengths would swing too wide, with the starts of these lengths. Nothing for
/// lengths that swing too wide in no flight, or in all.
pub(crate) fn steady<'a>(
    flights: &[&'a Prepared],
    model: &Model,
    effect: Effect,
    starts: &[Start],
) -> Vec<(Vec<&'a Prepared>, Vec<Start>)> {
    // Where the craft goes is the same for every load.
    let places = |flight: &&Prepared| (places_m(flight, model, &body_dcm(flight, model)), flight.period_s);
    let ways: Vec<_> = flights.iter().map(places).collect();
    let mut groups: Vec<(Vec<bool>, Vec<Start>)> = Vec::new();
    let mut hung = model.clone();
    for start in starts {
        // Its mass does not change how it swings.
        hung.set(effect, &[0.0, start[1].unwrap_or_default(), LITTLE_DAMPING]);
        let Some(carried) = of_model(&hung) else { continue };
        let is_steady: Vec<bool> =
            ways.iter().map(|(way, period_s)| WideSwing::on(way, *period_s, &carried).is_none()).collect();
        match groups.iter_mut().find(|(known, _)| *known == is_steady) {
            Some((_, starts)) => starts.push(start.clone()),
            None => groups.push((is_steady, vec![start.clone()])),
        }
    }
    groups.retain(|(is_steady, _)| is_steady.contains(&true) && is_steady.contains(&false));
    let chosen = |(is_steady, starts): (Vec<bool>, Vec<Start>)| {
        let steady = flights.iter().zip(is_steady).filter(|(_, is_steady)| *is_steady).map(|(f, _)| *f);
        (steady.collect(), starts)
    };
    groups.into_iter().map(chosen).collect()
}

#[cfg(test)]
mod tests {
    use flights::Column;
    use model::Effect;

    use super::*;
    use crate::fit::identification::fit;
    use crate::testing::{NONE, fly, prepared, truth};

    const GRAVITY_M_S2: f64 = 9.81;

    fn carrying(length_m: f64, damping_ratio: f64) -> Model {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.1, length_m, damping_ratio]);
        model
    }

    /// North, as a craft goes that shakes a load on a cable of `length_m` at its own frequency.
    fn shaken_m(time_s: f64, length_m: f64) -> f64 {
        0.15 * (time_s * (GRAVITY_M_S2 / length_m).sqrt()).sin()
    }

    #[test]
    fn a_load_that_is_shaken_at_its_own_frequency_swings_too_wide_unless_it_is_damped() {
        let hover = prepared(3000, |_, _| {});
        assert_eq!(WideSwing::too_wide(&hover, &carrying(0.6, 0.01)), None);
        assert_eq!(WideSwing::too_wide(&hover, &truth()), None);
        let shaken = prepared(3000, |t, row| row.position_ned_m[0] = shaken_m(t, 0.6));
        let swing = WideSwing::too_wide(&shaken, &carrying(0.6, 0.01)).unwrap();
        assert!(swing.widest_deg > 75.0 && swing.part > 0.02, "{swing:?}");
        // It ends at 0.15 / 0.6 / (2 * 0.3) rad.
        assert_eq!(WideSwing::too_wide(&shaken, &carrying(0.6, 0.3)), None);
        assert_eq!(WideSwing::too_wide(&shaken, &carrying(2.4, 0.01)), None);
    }

    #[test]
    fn flights_are_left_out_for_the_lengths_that_swing_too_wide_in_them_where_others_remain() {
        let hover = prepared(3000, |_, _| {});
        let shaken = prepared(3000, |t, row| row.position_ned_m[0] = shaken_m(t, 1.14));
        let flights = [&hover, &shaken];
        let groups = steady(&flights, &truth(), Effect::SlungLoad, &Effect::SlungLoad.starts());
        let [(steady_ones, shapes)] = &groups[..] else { panic!("{} groups", groups.len()) };
        assert_eq!(steady_ones.len(), 1);
        assert!(std::ptr::eq(steady_ones[0], &hover));
        assert!(shapes.iter().any(|shape| shape[1] == Some(1.14)));
        assert!(shapes.iter().all(|shape| (0.9..1.5).contains(&shape[1].unwrap())), "{shapes:?}");
        assert!(steady(&[&shaken], &truth(), Effect::SlungLoad, &Effect::SlungLoad.starts()).is_empty());
        let model = carrying(1.14, 0.01);
        assert_eq!(followable(&flights, &model).len(), 1);
        assert_eq!(followable(&[&shaken], &model).len(), 1);
        assert_eq!(followable(&flights, &truth()).len(), 2);
    }

    /// Nothing that is predicted of the third flight's load is right; the two others say what it is, with it and without it.
    #[test]
    fn one_flight_with_a_wide_swing_hides_no_load_of_the_others() {
        let model = carrying(0.6, 0.02);
        let flown = |seed: u64| fly(&model, seed, 20.0, &NONE);
        let mut wild = flown(5);
        let north_m = wild.required(Column::T).iter().zip(wild.required(Column::X));
        let north_m = north_m.map(|(t, x)| x + shaken_m(*t, 0.6)).collect();
        wild.replace(Column::X, north_m);
        let flights = [flown(3), flown(4), wild].map(|f| Prepared::new(&f, &model.vehicle).unwrap());
        let [a, b, wild] = &flights;
        let effects: Vec<Effect> = Effect::basic().chain([Effect::SlungLoad]).collect();
        assert!(WideSwing::too_wide(wild, &model).is_some() && WideSwing::too_wide(a, &model).is_none());
        for start in [None, Some(&model)] {
            let fitted = fit(&[a, b, wild], &model.vehicle, &effects, start).unwrap().model;
            let load = fitted.term(Effect::SlungLoad).unwrap().values();
            assert!((load[0] / 0.1 - 1.0).abs() < 0.1 && (load[1] / 0.6 - 1.0).abs() < 0.03, "{load:?}");
        }
    }
}
