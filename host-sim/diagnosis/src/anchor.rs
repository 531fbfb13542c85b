//! Where does the cable end that an effect would be? Something must hold it: nothing does metres under the floor, or far from all that was
//! flown. A force that grows with the height is no cable then, and what makes it is not known.
//!
//! Both distances are given the benefit of the doubt: two standard errors of the anchor's place.

use nalgebra::Vector3;
use sysid::prepare::Prepared;

use crate::finding::{Anchor, EffectFinding};

/// Standard errors by which an anchor may be nearer.
const DOUBT: f64 = 2.0;
/// Least reach of a cable, m, and its reach in diagonals of the space that was flown: who flies on a cable flies about its end.
const LEAST_REACH_M: f64 = 5.0;
const REACH: f64 = 2.0;

/// Of an effect that pulls to a point, as it was estimated; nothing of one that pushes.
pub(crate) fn anchor_of(finding: &EffectFinding, flights: &[&Prepared]) -> Option<Anchor> {
    let [stiffness, pull @ ..] = &finding.coefficients[..] else { return None };
    if !finding.effect.info().special.is_anchored || pull.len() != 3 || !(stiffness.value > 0.0) {
        return None;
    }
    let place_ned_m: [f64; 3] = std::array::from_fn(|k| pull[k].value / stiffness.value);
    let doubt_m: [f64; 3] = std::array::from_fn(|k| {
        DOUBT * pull[k].std_error.hypot(place_ned_m[k] * stiffness.std_error) / stiffness.value
    });
    let (low, high) = flown(flights)?;
    let nearest = |k: usize| {
        let outside = (low[k] - place_ned_m[k]).max(place_ned_m[k] - high[k]);
        (outside - doubt_m[k]).max(0.0)
    };
    Some(Anchor {
        place_ned_m,
        distance_m: Vector3::new(nearest(0), nearest(1), nearest(2)).norm(),
        reach_m: LEAST_REACH_M.max(REACH * (high - low).norm()),
        depth_m: place_ned_m[2] - doubt_m[2] - high[2].max(0.0),
    })
}

/// Corners of the space that was flown.
fn flown(flights: &[&Prepared]) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let of_axis = |k: usize| {
        let all = flights.iter().flat_map(|flight| &flight.stretches).flat_map(move |s| &s.position_ned_m[k]);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
    };
    let ends = [0, 1, 2].map(of_axis);
    let (low, high) = (Vector3::from(ends.map(|e| e.0)), Vector3::from(ends.map(|e| e.1)));
    (high - low).iter().all(|extent| extent.is_finite()).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::finding::CoefficientFigures;
    use crate::reason::Reason;
    use crate::testing::{ORDINARY, prepared, truth};

    /// A cable of 0.06 N/m to a place, told as well as by flights through a wake (an error of 18 %).
    fn to(place_ned_m: [f64; 3], flights: &[Prepared]) -> Option<Anchor> {
        let mut finding = EffectFinding::unsupported(Effect::Tether, 2, Reason::LikeChance);
        let pulls = place_ned_m.map(|x| 0.06 * x);
        let values = [(0.06, 0.011), (pulls[0], 0.007), (pulls[1], 0.013), (pulls[2], 0.09)];
        let figures = |((value, error), c)| CoefficientFigures::new(c, value, error, &truth());
        finding.coefficients =
            values.into_iter().zip(Effect::Tether.info().coefficients).map(figures).collect();
        anchor_of(&finding, &flights.iter().collect::<Vec<_>>())
    }

    /// Flights of some two metres about (0, 0, -1).
    #[test]
    fn an_anchor_on_the_floor_or_under_the_ceiling_can_be_and_one_far_below_or_above_cannot() {
        let flights = prepared(&truth(), 1..3, 8.0, &ORDINARY);
        let at = |place| to(place, &flights).unwrap();
        for place in [[1.0, 0.5, 0.0], [0.0, 0.0, -4.0], [3.0, 0.0, 0.0]] {
            let anchor = at(place);
            assert!(anchor.depth_m < 0.0 && anchor.distance_m < anchor.reach_m, "{place:?}: {anchor:?}");
        }
        // 13.9 m less two errors of 2.96 m.
        let below = at([0.15, -0.16, 13.9]);
        assert!((below.depth_m - 8.0).abs() < 0.3, "{below:?}");
        let above = at([0.0, 0.0, -40.0]);
        assert!(above.depth_m < 0.0 && above.distance_m > above.reach_m, "{above:?}");
        assert_eq!(to([f64::NAN; 3], &[]), None, "nothing was flown");
    }
}
