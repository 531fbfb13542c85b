//! The rows of a fit about a model, from all its flights.

use model::{Effect, Model};

use crate::fit::least_squares::FlightRows;
use crate::fit::least_squares::RowColumn;
use crate::fit::linearise::{About, residuals_at_rows};
use crate::fit::parameters::Layout;
use crate::fit::residuals::Residuals;
use crate::fit::rotation::has_rotation;
use crate::fit::slow;
use crate::fit::swing::Known;
use crate::fit::terms::coefficient_count;
use crate::prepare::Prepared;

/// How far the moments at which commands took effect may lie from the middle of a log's jittering times, in standard deviations of
/// the jitter: a logger that is only ever late is 1 of them off (exponential lateness) to 1.7 (even).
const LATENESS: f64 = 1.4;

/// By what the residual of each flight changes if its commands took effect one such deviation away; nothing where times are even or
/// the clock of measured rotor speeds was found.
pub fn timing(flights: &[&Prepared], model: &Model) -> Vec<Option<RowColumn>> {
    let of = |flight: &&Prepared| {
        let is_known = flight.has_rotor_speeds() && flight.alignment.is_some();
        (flight.jitter_s > 0.0 && !is_known).then(|| {
            let stride = flight.fit_stride();
            let about = About::new(flight, model, (&[], &[Effect::InputDelay]), stride, &Known::default());
            let mut off: RowColumn = about.columns.into_iter().next().unwrap_or_default();
            let deviation_s = LATENESS * flight.jitter_s;
            off.iter_mut().flatten().flatten().for_each(|value| *value *= deviation_s);
            if slow::is_taken(flight) {
                slow::take_from_column(flight, stride, &mut off);
            }
            off
        })
    };
    flights.iter().map(of).collect()
}

/// Rows of the regression about a model: columns of the linear effects, then residual derivatives of the adjusting
/// ones, whose targets are shifted so that the solution gives values for the former and steps for the latter. With the logarithm
/// of the spread of what the model leaves, over all axes, where any effect is adjusting. `begun` is how a load was found to begin in
/// each flight, to go on from.
pub(crate) fn assemble(
    flights: &[&Prepared],
    model: &Model,
    linear: &[Effect],
    adjusting: &[Effect],
    begun: &mut [Known],
) -> (Vec<FlightRows>, f64) {
    let adds = adjusting.iter().any(|effect| effect.info().special.adds_accelerations);
    let mut sums = Squares::default();
    let rows = flights
        .iter()
        .zip(begun)
        .map(|(flight, begun)| {
            let stride = flight.fit_stride();
            let all_targets = || flight.targets(&model.vehicle, &model.adjustments(), stride);
            let (targets, columns) = if adjusting.is_empty() {
                (all_targets(), flight.columns(linear, model, stride, None))
            } else {
                let about = About::new(flight, model, (linear, adjusting), stride, begun);
                let Residuals { measured, residual } = about.residuals;
                sums.add(&slow::less(flight, stride, &residual), model);
                begun.begun = about.begun;
                let targets = match adds {
                    true => less_added(residual, model, linear, &about.columns),
                    // A model that says nothing of the rotation is fitted to it all the same.
                    false if !has_rotation(model) => all_targets(),
                    false => measured,
                };
                (targets, about.columns)
            };
            flight.rows_of_fit(targets, columns)
        })
        .collect();
    (rows, sums.spread())
}

/// Sums of squares of what is left on each axis that the model speaks of.
#[derive(Default)]
struct Squares([f64; 6]);

impl Squares {
    fn add(&mut self, residual: &[Vec<f64>; 6], model: &Model) {
        let axes = if has_rotation(model) { 6 } else { 3 };
        let left = residual[..axes].iter().map(|r| r.iter().map(|e| e * e).sum::<f64>());
        self.0.iter_mut().zip(left).for_each(|(sum, left)| *sum += left);
    }

    /// Logarithm of the spread over all axes.
    fn spread(&self) -> f64 {
        self.0.iter().map(|sum| 0.5 * sum.max(f64::MIN_POSITIVE).ln()).sum()
    }
}

/// Logarithm of the spread of what a model leaves, over all axes.
pub(crate) fn left_by(flights: &[&Prepared], model: &Model) -> f64 {
    let mut sums = Squares::default();
    for flight in flights {
        let stride = flight.fit_stride();
        let residual = residuals_at_rows(flight, model, stride).residual;
        sums.add(&slow::less(flight, stride, &residual), model);
    }
    sums.spread()
}

/// Rows that were formed about a model near this one: the derivatives of adjusting effects stay, the rest moves with the model. `begun` as
/// in [`assemble`], whose second value this hands over.
pub(crate) fn follow_up(
    rows: &mut [FlightRows],
    flights: &[&Prepared],
    model: &Model,
    layout: &Layout,
    begun: &mut [Known],
) -> f64 {
    let mut sums = Squares::default();
    let count: usize = layout.linear.iter().map(|e| coefficient_count(*e)).sum();
    for ((rows, flight), begun) in rows.iter_mut().zip(flights).zip(begun) {
        let stride = flight.fit_stride();
        if layout.adds() {
            let about = About::new(flight, model, (&[], &[]), stride, begun);
            // The columns are those of rows already.
            let residual = slow::less(flight, stride, &about.residuals.residual).into_owned();
            sums.add(&residual, model);
            begun.begun = about.begun;
            rows.targets = less_added(residual, model, &layout.linear, &rows.columns);
        } else {
            let targets = flight.targets(&model.vehicle, &model.adjustments(), stride);
            let anew = flight.rows_of_fit(targets, flight.columns(&layout.linear, model, stride, None));
            rows.targets = anew.targets;
            rows.columns.splice(..count, anew.columns);
            sums.add(&added(rows.targets.clone(), model, &layout.linear, &rows.columns, -1.0), model);
        }
    }
    sums.spread()
}

/// The targets less what effects add that have no columns: the residual plus what the linear effects predict.
pub(crate) fn less_added(
    residual: [Vec<f64>; 6],
    model: &Model,
    linear: &[Effect],
    columns: &[RowColumn],
) -> [Vec<f64>; 6] {
    added(residual, model, linear, columns, 1.0)
}

/// Signals plus a number of times what the linear effects predict.
fn added(
    signals: [Vec<f64>; 6],
    model: &Model,
    linear: &[Effect],
    columns: &[RowColumn],
    times: f64,
) -> [Vec<f64>; 6] {
    let mut targets = signals;
    let values = linear.iter().flat_map(|e| model.term(*e)).flat_map(|t| &t.coefficients).map(|c| c.value);
    for (value, column) in values.zip(columns) {
        for (target, column) in targets.iter_mut().zip(column) {
            let Some(column) = column else { continue };
            target.iter_mut().zip(column).for_each(|(t, c)| *t += times * value * c);
        }
    }
    targets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::gusts;
    use crate::testing::{NONE, fly, truth};

    fn flown(model: &Model) -> Prepared {
        Prepared::new(&fly(model, 2, 6.0, &NONE), &model.vehicle).unwrap()
    }

    #[test]
    fn targets_are_what_is_left_and_what_the_linear_effects_predict() {
        // Drag of 2, 3, 4 over columns of their own axes.
        let mut model = truth();
        model.set(Effect::LinearDrag, &[2.0, 3.0, 4.0]);
        let columns: Vec<RowColumn> = (0..3)
            .map(|axis| {
                let mut column = RowColumn::default();
                column[axis] = Some(vec![1.0, -1.0]);
                column
            })
            .collect();
        let residual: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.5, 0.5]);
        let targets = less_added(residual, &model, &[Effect::LinearDrag], &columns);
        assert_eq!(targets[..4], [vec![2.5, -1.5], vec![3.5, -2.5], vec![4.5, -3.5], vec![0.5, 0.5]]);
    }

    #[test]
    fn the_spread_is_of_the_axes_that_a_model_speaks_of() {
        let residual: [Vec<f64>; 6] = std::array::from_fn(|axis| vec![1.0 + axis as f64]);
        let mut forces = truth();
        forces.terms.retain(|term| term.effect != Effect::RotorMoments);
        let spread = |model: &Model| {
            let mut sums = Squares::default();
            sums.add(&residual, model);
            sums.spread()
        };
        assert!((spread(&truth()) - 720.0_f64.ln()).abs() < 1e-12);
        let silent = 3.0 * 0.5 * f64::MIN_POSITIVE.ln();
        assert!((spread(&forces) - (6.0_f64.ln() + silent)).abs() < 1e-9);
    }

    #[test]
    fn a_worse_model_leaves_more_of_both_flights() {
        let model = truth();
        let flight = flown(&model);
        let mut worse = model.clone();
        worse.set(Effect::LinearDrag, &[0.0; 3]);
        assert!(left_by(&[&flight, &flight], &worse) > left_by(&[&flight, &flight], &model) + 0.5);
        // Twice the flight is twice the squares of six axes.
        let (once, twice) = (left_by(&[&flight], &model), left_by(&[&flight, &flight], &model));
        assert!((twice - once - 3.0 * 2.0_f64.ln()).abs() < 1e-9);
    }

    /// Rows carried over from a neighbour have its derivatives and nothing else of it.
    #[test]
    fn rows_that_follow_a_model_are_those_formed_about_it() {
        let model = truth();
        let calm = flown(&model);
        let mut in_gusts = calm.clone();
        gusts::expect(&mut [&mut in_gusts]);
        for flight in [calm, in_gusts] {
            rows_follow(&model, &flight);
        }
    }

    fn rows_follow(model: &Model, flight: &Prepared) {
        let linear: Vec<Effect> = Effect::basic().collect();
        let layout = Layout {
            order: [&linear[..], &[Effect::MassChange]].concat(),
            linear,
            adjusting: vec![Effect::MassChange],
            is_searched: false,
        };
        let with_mass = |extra_kg: f64| {
            let mut model = model.clone();
            model.set(Effect::MassChange, &[extra_kg]);
            model
        };
        let (near, here) = (with_mass(0.05), with_mass(0.06));
        let flights = [flight];
        let assembled = |model: &Model| {
            assemble(&flights, model, &layout.linear, &layout.adjusting, &mut [Known::default()])
        };
        let (mut followed, _) = assembled(&near);
        let spread = follow_up(&mut followed, &flights, &here, &layout, &mut [Known::default()]);
        let (anew, spread_anew) = assembled(&here);
        assert!((spread - spread_anew).abs() < 1e-9, "{spread} {spread_anew}");
        assert_eq!(followed[0].targets, anew[0].targets);
        let count = anew[0].columns.len() - 1;
        assert_eq!(followed[0].columns[..count], anew[0].columns[..count]);
        assert_ne!(followed[0].columns[count], anew[0].columns[count]);
    }

    #[test]
    fn even_times_leave_nothing_unknown_of_when_commands_took_effect() {
        let model = truth();
        let mut flight = flown(&model);
        assert_eq!(timing(&[&flight], &model), [None]);
        flight.jitter_s = 0.001;
        let [Some(off)] = &timing(&[&flight], &model)[..] else { panic!("jitter tells nothing") };
        flight.jitter_s = 0.002;
        let [Some(twice)] = &timing(&[&flight], &model)[..] else { panic!("jitter tells nothing") };
        let (off, twice) = (off[3].as_ref().unwrap(), twice[3].as_ref().unwrap());
        assert!(off.iter().any(|v| *v != 0.0));
        assert!(off.iter().zip(twice).all(|(a, b)| (2.0 * a - b).abs() <= 1e-9 * b.abs()));
    }
}
