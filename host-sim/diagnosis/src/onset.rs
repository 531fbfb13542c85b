//! When did a change begin that the rows of every sample show? How much of it each second of the flights shows, from the residual
//! of the model as it was, against what the change makes of it.

use std::ops::Range;

use model::{Axis, Model};
use sysid::prepare::Prepared;
use sysid::residuals;

use crate::beginning::{Share, since};
use crate::change::Change;
use crate::change_scatter::scatter_of;
use crate::finding::{CoefficientFigures, EffectFinding, Since};
use crate::significance::rows_of_stretches;

/// Length of a window, s: longer than what the filters of a row reach over.
const WINDOW_S: f64 = 1.0;

/// When a change began that was found with such coefficients; nothing where it may have been there from the first second.
pub(crate) fn onset(
    model: &Model,
    (change, finding): (Change, &EffectFinding),
    flights: &[&Prepared],
) -> Option<Since> {
    let size: Vec<f64> = finding.coefficients.iter().map(|c| c.value).collect();
    // Coefficients of one effect may have different units: each counts in ordinary magnitudes.
    let info = change.effect.info();
    let ordinary = change.coefficients().into_iter().map(|k| info.coefficients[k].typical);
    let sized: Vec<(&CoefficientFigures, f64)> = finding.coefficients.iter().zip(ordinary).collect();
    let squares: f64 = sized.iter().map(|(c, ordinary)| (c.value / ordinary).powi(2)).sum();
    if !(squares > 0.0) {
        return None;
    }
    let scatter = |name: &str| scatter_of(model, change.effect, name).map_or(0.0, |s| s.deviation);
    let along = |(c, ordinary): &(&CoefficientFigures, f64)| {
        (scatter(c.name) * c.value / (ordinary * ordinary)).powi(2)
    };
    let between = sized.iter().map(along).sum::<f64>().sqrt() / squares;
    let (after, axes) = (with(model, change, &size), finding.judged_axes());
    let of_flight = |flight: &&Prepared| (flight.name.clone(), shares([model, &after], axes, flight));
    since(&flights.iter().map(of_flight).collect::<Vec<_>>(), between)
}

/// The model with a change of the given size.
fn with(model: &Model, change: Change, size: &[f64]) -> Model {
    let mut changed = model.clone();
    change.add(&mut changed, size);
    changed
}

/// How much of a change each window of a flight shows: of what the residual would fall by with all of it. Not of what slopes promise: a
/// battery's voltage may be shifted and its slope another, and then each acts as much as the other lets it.
fn shares([before, after]: [&Model; 2], axes: &[Axis], flight: &Prepared) -> Vec<Share> {
    let [without, with] = [before, after].map(|model| residuals(flight, model));
    let rows = flight.rows();
    let (mut shown, mut whole) = (vec![0.0; rows], vec![0.0; rows]);
    for axis in axes.iter().map(|axis| axis.index()) {
        let left = &without.residual[axis];
        let variance = left.iter().map(|e| e * e).sum::<f64>() / rows.max(1) as f64;
        for (row, (left, with)) in left.iter().zip(&with.residual[axis]).enumerate() {
            let made = left - with;
            shown[row] += made * left / variance.max(f64::MIN_POSITIVE);
            whole[row] += made * made / variance.max(f64::MIN_POSITIVE);
        }
    }
    let length = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
    let times = flight.row_times_s(1);
    let pieces = rows_of_stretches(flight).into_iter().flat_map(|of_stretch| {
        let end = of_stretch.end;
        of_stretch.step_by(length).map(|first| first..first + length).take_while(move |rows| rows.end <= end)
    });
    let sum = |of: &[f64], rows: &Range<usize>| of[rows.clone()].iter().sum::<f64>();
    let window = |rows: Range<usize>| {
        let all = sum(&whole, &rows);
        let time_s = sum(&times, &rows) / rows.len() as f64;
        (all > 0.0).then(|| Share { time_s, share: sum(&shown, &rows) / all, weight: all })
    };
    pieces.filter_map(window).collect()
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::reason::Reason;
    use crate::testing::{ORDINARY, prepared, truth};

    fn heavier() -> Model {
        let mut heavy = truth();
        heavy.set(Effect::MassChange, &[0.15]);
        heavy
    }

    fn found() -> (Change, EffectFinding) {
        let mut finding = EffectFinding::unsupported(Effect::MassChange, 3, Reason::LikeChance);
        let (name, unit) = ("extra_mass", "kg");
        finding.coefficients =
            vec![CoefficientFigures { name, value: 0.1, std_error: 0.01, unit, possible: (-1.0, 1.0) }];
        (Change { effect: Effect::MassChange, motor: None }, finding)
    }

    #[test]
    fn a_load_that_is_carried_from_the_third_flight_on_begins_with_it() {
        let mut flights = prepared(&truth(), 80..82, 8.0, &ORDINARY);
        flights.extend(prepared(&heavier(), 82..84, 8.0, &ORDINARY));
        let flights: Vec<&Prepared> = flights.iter().collect();
        let (change, finding) = found();
        let since = onset(&truth(), (change, &finding), &flights).unwrap();
        assert_eq!(since.flight, flights[2].name);
        assert_eq!(onset(&truth(), (change, &finding), &flights[2..]), None);
    }
    /// The speed per volt has changed by 30 rad/s, about 12.0 V and not the model's 11.9 V, in a flight whose battery falls through both. It
    /// was there from the first second.
    #[test]
    fn a_change_that_passes_through_zero_has_no_beginning() {
        let mut before = truth();
        before.reference.battery_v = 11.9;
        let mut world = before.clone();
        world.set(Effect::BatteryVoltage, &[30.0, 0.1]);
        let flights = prepared(&world, 80..81, 25.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let change = Change { effect: Effect::BatteryVoltage, motor: None };
        let mut finding = EffectFinding::unsupported(change.effect, 1, Reason::LikeChance);
        let figures = |(value, c)| CoefficientFigures::new(c, value, 0.1, &before);
        let coefficients = change.effect.info().coefficients;
        finding.coefficients = [30.0, 0.1].into_iter().zip(coefficients).map(figures).collect();
        assert_eq!(onset(&before, (change, &finding), &flights), None);
    }
}
