//! When did a change begin that the rows of every sample show? How much of it each second of the flights shows, from the residual
//! of the model as it was, along the columns of the change.

use std::ops::Range;

use model::Model;
use sysid::fit::linearise::About;
use sysid::fit::swing::Known;
use sysid::prepare::Prepared;

use crate::beginning::{Share, since};
use crate::change::Change;
use crate::change_scatter::scatter_of;
use crate::finding::{CoefficientFigures, EffectFinding, Since};

/// Length of a window, s: longer than what the filters of a row reach over.
const WINDOW_S: f64 = 1.0;

/// When a change began that was found with such coefficients; nothing where it may have been there from the first second.
pub(crate) fn onset(
    model: &Model,
    (change, finding): (Change, &EffectFinding),
    flights: &[&Prepared],
) -> Option<Since> {
    let size: Vec<f64> = finding.coefficients.iter().map(|c| c.value).collect();
    let squares: f64 = size.iter().map(|value| value * value).sum();
    if !(squares > 0.0) {
        return None;
    }
    let scatter = |name: &str| scatter_of(model, change.effect, name).map_or(0.0, |s| s.deviation);
    let along = |c: &CoefficientFigures| (scatter(c.name) * c.value).powi(2);
    let between = finding.coefficients.iter().map(along).sum::<f64>().sqrt() / squares;
    let of_flight = |flight: &&Prepared| (flight.name.clone(), shares(model, change, &size, flight));
    since(&flights.iter().map(of_flight).collect::<Vec<_>>(), between)
}

/// How much of a change of the given size each window of a flight shows.
fn shares(model: &Model, change: Change, size: &[f64], flight: &Prepared) -> Vec<Share> {
    let stride = flight.fit_stride();
    let About { residuals, columns, .. } =
        About::new(flight, model, (&[], &[change.effect]), stride, &Known::default());
    let rows = residuals.residual[0].len();
    let (mut shown, mut whole) = (vec![0.0; rows], vec![0.0; rows]);
    for axis in change.effect.info().axes.iter().map(|axis| axis.index()) {
        let residual = &residuals.residual[axis];
        let variance = residual.iter().map(|e| e * e).sum::<f64>() / rows.max(1) as f64;
        for row in 0..rows {
            let of_change = change.coefficients().into_iter().zip(size);
            let made: f64 =
                of_change.filter_map(|(k, value)| Some(columns[k][axis].as_ref()?[row] * value)).sum();
            shown[row] += made * residual[row] / variance.max(f64::MIN_POSITIVE);
            whole[row] += made * made / variance.max(f64::MIN_POSITIVE);
        }
    }
    let length = (WINDOW_S / (flight.period_s * stride as f64)).round().max(1.0) as usize;
    let (times, starts) = (flight.fit_row_times_s(), flight.starts_of_rows(stride));
    let ends = starts.iter().skip(1).copied().chain([rows]);
    let pieces = starts.iter().zip(ends).flat_map(|(&start, end)| {
        (start..end)
            .step_by(length)
            .map(|first| first..first + length)
            .take_while(move |rows| rows.end <= end)
    });
    let sum = |of: &[f64], rows: &Range<usize>| of[rows.clone()].iter().sum::<f64>();
    let window = |rows: Range<usize>| {
        let all = sum(&whole, &rows);
        let time_s = sum(&times, &rows) / rows.len() as f64;
        (all > 0.0).then(|| Share { time_s, share: sum(&shown, &rows) / all })
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
}
