//! Where Gauss and Newton's steps start.
//!
//! From zero, mostly. Two kinds of effects need more:
//! - Where a coefficient qualifies another one (a height offset, a voltage shift), the way from zero can end in a side
//!   valley: an ordinary value is a second start.
//! - Where the residual is not convex in a coefficient (the length of a pendulum), or at zero there is no way to
//!   go (a decay length), the effect names starts of its shape ([`model::Effect::starts`]). At each of them the remaining
//!   coefficients follow from one least squares on the axes that the effect acts on. If the best of them explains
//!   anything, its shape is improved by trying ever nearer neighbours: Gauss and Newton's steps go on from where they
//!   converge.

use model::{Effect, Model};

use crate::fit::assembly::less_added;
use crate::fit::error::{FitError, check_scales};
use crate::fit::least_squares::RowColumn;
use crate::fit::least_squares::{self, FlightRows};
use crate::fit::linearise::step_scale;
use crate::fit::load_shapes::LoadShapes;
use crate::fit::parameters::{Layout, step_end};
use crate::fit::predicted::measured_less_predicted;
use crate::fit::shapes::{End, Shapes};
use crate::fit::slow;
use crate::fit::wide_swings;
use crate::prepare::Prepared;

/// The starts of a fit, and the flights that it goes on with. `model` has the linear coefficients of a fit without the adjusting effects
/// that are unknown.
pub(crate) fn of<'a>(
    flights: &[&'a Prepared],
    mut model: Model,
    layout: &Layout,
    is_unknown: impl Fn(Effect) -> bool,
    demand: Demand,
) -> Result<(Vec<Model>, Vec<&'a Prepared>), FitError> {
    let unknown: Vec<Effect> = layout.adjusting.iter().copied().filter(|e| is_unknown(*e)).collect();
    let (searched, ordinary): (Vec<Effect>, Vec<Effect>) =
        unknown.into_iter().partition(|effect| !effect.starts().is_empty());
    let mut flights = flights.to_vec();
    for effect in searched {
        flights = search(&flights, &mut model, layout, effect, demand)?;
    }
    let second = second(&model, &ordinary);
    Ok((std::iter::once(model).chain(second).collect(), flights))
}

/// The model with ordinary values for effects that have a qualifying coefficient.
fn second(model: &Model, unknown: &[Effect]) -> Option<Model> {
    let mut second = model.clone();
    let mut any = false;
    let qualified = |effect: &&Effect| effect.info().coefficients.iter().any(|c| c.prior.is_some());
    for effect in unknown.iter().filter(qualified) {
        let values: Vec<f64> = (0..effect.info().coefficients.len())
            .map(|k| {
                // A height that is too large leaves the formula smooth, one that is too small ends where it ends.
                let qualifies = effect.info().coefficients[k].prior;
                qualifies.unwrap_or_else(|| step_scale(model.vehicle.has_rotor_map(), *effect, k))
            })
            .collect();
        second.set(*effect, &values);
        any = true;
    }
    any.then_some(second)
}

/// Parts of themselves (for a scale) or of an ordinary value by which the coefficients of a shape are changed in turn.
const CHANGES: [f64; 4] = [0.1, 0.05, 0.025, 0.0125];
/// Starts whose shape is improved: the valley of the best one need not be the deepest.
const IMPROVED: usize = 3;
/// One that leaves more than the best so far by this (of the logarithm of the spread) is not worth it.
const HOPELESS: f64 = 0.3;
/// Rounds with one change.
const ROUNDS: usize = 3;
/// A start explains something when it lowers the logarithm of the residual's spread by this: 0.2 % of it.
const EXPLAINS: f64 = 0.002;
/// Flights are left out for a load that lowers it in the others by this: no chance, and no other effect that a load passes for in part.
const CLEAR: f64 = 0.1;

/// What a search over shapes must find for a fit to go on from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Demand {
    /// Whatever is best.
    Best,
    /// Something possible that explains anything.
    Promising,
}

/// Sets an effect to the best of its starts: of those where its coefficients are possible, if there are any. Returns the flights that say
/// so: all but those in which a load would swing too wide to be followed, if the others say more without them.
fn search<'a>(
    flights: &[&'a Prepared],
    model: &mut Model,
    layout: &Layout,
    effect: Effect,
    demand: Demand,
) -> Result<Vec<&'a Prepared>, FitError> {
    let starts = effect.starts();
    let mut found = (flights.to_vec(), best_of(flights, model, layout, effect, &starts));
    if effect.info().special.hangs_load {
        for (steady, starts) in wide_swings::steady(flights, model, effect, &starts) {
            let best = best_of(&steady, model, layout, effect, &starts);
            let is_clear = best.as_ref().is_some_and(|best| best.score < best.without - CLEAR);
            if is_clear && gain(effect, &steady, &best) > gain(effect, &found.0, &found.1) {
                found = (steady, best);
            }
        }
    }
    let (flights, best) = found;
    let info = effect.info();
    let Some(best) = best else {
        return Err(FitError::NotExcited {
            effect: info.id,
            coefficient: info.coefficients[0].name,
            excitation: info.excitation,
        });
    };
    if demand == Demand::Promising && !explains(effect, &best) {
        return Err(FitError::ExplainsNothing { effect: info.id, excitation: info.excitation });
    }
    model.set(effect, &best.values);
    // No step would lead away from there.
    check_scales(model, &[effect])?;
    Ok(flights)
}

/// The best of the shapes near some starts; nothing where none is determined.
fn best_of(
    flights: &[&Prepared],
    model: &Model,
    layout: &Layout,
    effect: Effect,
    starts: &[Vec<Option<f64>>],
) -> Option<End> {
    let is_shape: Vec<bool> =
        starts.iter().flatten().take(effect.info().coefficients.len()).map(Option::is_some).collect();
    let solver: Box<dyn Shapes> = if effect.info().special.hangs_load {
        Box::new(LoadShapes::new(flights, model, &layout.linear, effect))
    } else {
        Box::new(AnyShapes::new(flights, model, layout, effect, is_shape.clone()))
    };
    let has_map = model.vehicle.has_rotor_map();
    let mut problem = Problem { effect, is_shape, has_map, solver };
    let shapes =
        starts.iter().map(|start| start.iter().map(|value| value.unwrap_or(0.0)).collect::<Vec<_>>());
    let mut ends: Vec<End> = shapes.filter_map(|shape| problem.solver.solve(&shape)).collect();
    ends.sort_by(|a, b| a.score.total_cmp(&b.score));
    if ends.iter().any(|end| is_possible(effect, end)) {
        ends.retain(|end| is_possible(effect, end));
    }
    let mut best: Option<End> = None;
    for (place, end) in ends.into_iter().take(IMPROVED).enumerate() {
        let is_hopeless = best.as_ref().is_some_and(|best| end.score > best.score + HOPELESS);
        if place > 0 && (!explains(effect, &end) || is_hopeless) {
            break;
        }
        let end = if explains(effect, &end) { problem.improve(end) } else { end };
        better(&mut best, Some(end));
    }
    best
}

/// Whether an end is possible and explains anything.
fn explains(effect: Effect, end: &End) -> bool {
    is_possible(effect, end) && end.score < end.without - EXPLAINS
}

/// What an end explains, as the logarithm of a likelihood ratio: so much of each row.
fn gain(effect: Effect, flights: &[&Prepared], end: &Option<End>) -> f64 {
    let rows: usize = flights.iter().map(|flight| flight.rows()).sum();
    let of = |end: &End| rows as f64 * (end.without - end.score);
    end.as_ref().filter(|end| is_possible(effect, end)).map_or(0.0, of)
}

/// Whether all coefficients are physically possible.
fn is_possible(effect: Effect, end: &End) -> bool {
    let within = |(value, c): (&f64, &model::Coefficient)| (c.possible.0..=c.possible.1).contains(value);
    end.values.iter().zip(effect.info().coefficients).all(within)
}

/// Keeps the better of two; whether that is the new one.
fn better(best: &mut Option<End>, new: Option<End>) -> bool {
    match (&best, new) {
        (Some(known), Some(new)) if new.score >= known.score => false,
        (_, None) => false,
        (_, new) => {
            *best = new;
            true
        }
    }
}

/// A search over the shapes of an effect.
struct Problem<'a> {
    effect: Effect,
    is_shape: Vec<bool>,
    has_map: bool,
    solver: Box<dyn Shapes + 'a>,
}

impl Problem<'_> {
    /// The best of ever nearer neighbours.
    fn improve(&mut self, start: End) -> End {
        let info = self.effect.info();
        let shape: Vec<usize> = (0..self.is_shape.len()).filter(|k| self.is_shape[*k]).collect();
        // What was no better than the best of then is no better than one that is better still.
        let shape_of = |values: &[f64]| shape.iter().map(|&k| values[k]).collect::<Vec<f64>>();
        let mut tried = vec![shape_of(&start.values)];
        let mut best = Some(start);
        for change in CHANGES {
            for _ in 0..ROUNDS {
                let mut moved = false;
                for (&k, sign) in shape.iter().flat_map(|k| [(k, 1.0), (k, -1.0)]) {
                    let Some(End { values, .. }) = &best else { continue };
                    let mut values = values.clone();
                    let (low, high) = info.coefficients[k].possible;
                    let scale =
                        if low > 0.0 { values[k] } else { 4.0 * step_scale(self.has_map, self.effect, k) };
                    values[k] = (values[k] + sign * change * scale).clamp(low, high);
                    if tried.contains(&shape_of(&values)) {
                        continue;
                    }
                    tried.push(shape_of(&values));
                    let end = self.solver.solve(&values).filter(|end| is_possible(self.effect, end));
                    moved |= better(&mut best, end);
                }
                if !moved {
                    break;
                }
            }
        }
        best.unwrap_or(End { score: f64::INFINITY, without: f64::INFINITY, values: Vec::new() })
    }
}

/// Of a flight: columns of the linear effects, and which of them act where an effect does.
struct LinearColumns {
    acts: Vec<bool>,
    all: Vec<RowColumn>,
}

fn linear_columns(
    flights: &[&Prepared],
    model: &Model,
    layout: &Layout,
    effect: Effect,
) -> Vec<LinearColumns> {
    let acts = |column: &RowColumn| effect.info().axes.iter().any(|axis| column[axis.index()].is_some());
    let of = |flight: &&Prepared| {
        let all = flight.columns(&layout.linear, model, flight.fit_stride(), None);
        LinearColumns { acts: all.iter().map(acts).collect(), all }
    };
    flights.iter().map(of).collect()
}

/// Any effect's shapes: the residual is formed anew for each.
struct AnyShapes<'a> {
    flights: &'a [&'a Prepared],
    model: Model,
    layout: &'a Layout,
    effect: Effect,
    is_shape: Vec<bool>,
    linear: Vec<LinearColumns>,
}

impl<'a> AnyShapes<'a> {
    fn new(
        flights: &'a [&'a Prepared],
        model: &Model,
        layout: &'a Layout,
        effect: Effect,
        is_shape: Vec<bool>,
    ) -> Self {
        let linear = linear_columns(flights, model, layout, effect);
        Self { flights, model: model.clone(), layout, effect, is_shape, linear }
    }
}

impl Shapes for AnyShapes<'_> {
    fn solve(&mut self, shape: &[f64]) -> Option<End> {
        let Self { flights, model, layout, effect, is_shape, linear } = self;
        let given = shape.iter().zip(&*is_shape);
        let mut values: Vec<f64> =
            given.map(|(value, is_shape)| if *is_shape { *value } else { 0.0 }).collect();
        let free: Vec<usize> = (0..values.len()).filter(|k| !is_shape[*k]).collect();
        model.set(*effect, &values);
        let axes = effect.info().axes;
        let mut squares = [(0.0, 0); 6];
        let rows: Vec<FlightRows> = flights
            .iter()
            .zip(linear)
            .map(|(flight, linear)| {
                let stride = flight.fit_stride();
                let here = measured_less_predicted(flight, model, stride).1;
                let mut columns = linear.all.clone();
                columns.extend(slopes(flight, model, *effect, &free, &here));
                for (sum, residual) in squares.iter_mut().zip(slow::less(flight, stride, &here).iter()) {
                    *sum = (sum.0 + residual.iter().map(|e| e * e).sum::<f64>(), sum.1 + residual.len());
                }
                let mut targets = less_added(here, model, &layout.linear, &columns);
                let mut acts = linear.acts.iter();
                columns.retain(|_| acts.next().copied().unwrap_or(true));
                for axis in model::AXES.into_iter().filter(|axis| !axes.contains(axis)) {
                    targets[axis.index()].fill(0.0);
                    columns.iter_mut().for_each(|column| column[axis.index()] = None);
                }
                flight.rows_of_fit(targets, columns)
            })
            .collect();
        let count = rows.first()?.columns.len();
        let solution = least_squares::solve(&rows, &vec![None; count]).ok()?;
        let on_axes = |sigma: [f64; 6]| axes.iter().map(|axis| sigma[axis.index()].ln()).sum::<f64>();
        let score = on_axes(solution.sigma);
        let without = on_axes(squares.map(|(sum, count)| (sum / f64::from(count.max(1) as u32)).sqrt()));
        for (k, step) in free.iter().zip(solution.value.iter().skip(count - free.len())) {
            values[*k] = step_end(values[*k], *step, &effect.info().coefficients[*k]);
        }
        (score.is_finite() && values.iter().all(|v| v.is_finite())).then_some(End { score, without, values })
    }
}

/// Minus the derivative of the residual with respect to coefficients that enter linearly.
fn slopes(
    flight: &Prepared,
    model: &Model,
    effect: Effect,
    free: &[usize],
    here: &[Vec<f64>; 6],
) -> Vec<RowColumn> {
    let base: Vec<f64> =
        model.term(effect).into_iter().flat_map(|t| &t.coefficients).map(|c| c.value).collect();
    let mut moved = model.clone();
    free.iter()
        .map(|&k| {
            let step = 0.01 * step_scale(model.vehicle.has_rotor_map(), effect, k);
            let mut values = base.clone();
            values[k] += step;
            moved.set(effect, &values);
            let ahead = measured_less_predicted(flight, &moved, flight.fit_stride()).1;
            std::array::from_fn(|axis| {
                let slope: Vec<f64> =
                    here[axis].iter().zip(&ahead[axis]).map(|(h, a)| (h - a) / step).collect();
                slope.iter().any(|d| *d != 0.0).then_some(slope)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn end(score: f64) -> End {
        End { score, without: 0.0, values: vec![score] }
    }

    #[test]
    fn the_better_of_two_is_kept_and_the_first_of_equals() {
        let mut best = None;
        assert!(!better(&mut best, None) && best.is_none());
        assert!(better(&mut best, Some(end(2.0))));
        assert!(!better(&mut best, Some(End { values: vec![9.0], ..end(2.0) })));
        assert_eq!(best.as_ref().unwrap().values, [2.0]);
        assert!(better(&mut best, Some(end(1.0))) && !better(&mut best, Some(end(1.5))));
        assert!(!better(&mut best, None));
        assert_eq!(best.unwrap().score, 1.0);
    }

    #[test]
    fn a_shape_is_possible_up_to_the_ends_of_its_range() {
        let possible =
            |values: &[f64]| is_possible(Effect::SlungLoad, &End { values: values.to_vec(), ..end(0.0) });
        assert!(possible(&[0.0, 0.08, 0.0]) && possible(&[100.0, 10.0, 0.5]));
        assert!(!possible(&[-1e-9, 1.0, 0.0]) && !possible(&[0.1, 10.1, 0.0]));
        assert!(!possible(&[0.1, f64::NAN, 0.0]));
    }

    #[test]
    fn only_effects_with_a_qualifying_coefficient_have_a_second_start() {
        let model = truth();
        assert!(second(&model, &[Effect::MassChange]).is_none() && second(&model, &[]).is_none());
        // 40 rad/s per volt, qualified by a shift of 1.5 V.
        let second = second(&model, &[Effect::MassChange, Effect::BatteryVoltage]).unwrap();
        assert_eq!(second.term(Effect::BatteryVoltage).unwrap().values(), [40.0, 1.5]);
        assert!(!second.has(Effect::MassChange));
    }

    fn layout(adjusting: Vec<Effect>) -> Layout {
        let linear: Vec<Effect> = Effect::basic().collect();
        Layout { order: [&linear[..], &adjusting].concat(), linear, adjusting, is_searched: false }
    }

    #[test]
    fn what_is_known_already_starts_where_it_is() {
        let model = truth();
        let adjusting = layout(vec![Effect::SlungLoad, Effect::BatteryVoltage]);
        let (starts, _) = of(&[], model.clone(), &adjusting, |_| false, Demand::Best).unwrap();
        assert_eq!(starts, [model]);
    }

    /// A search finds some shape that takes a little of the rounding away, or none at all.
    #[test]
    fn a_flight_without_a_load_has_next_to_none_on_its_cable() {
        let model = truth();
        let flight = Prepared::new(&fly(&model, 4, 8.0, &NONE), &model.vehicle).unwrap();
        let layout = layout(vec![Effect::SlungLoad]);
        match of(&[&flight], model, &layout, |_| true, Demand::Promising) {
            Ok((starts, _)) => {
                let mass_kg = starts[0].term(Effect::SlungLoad).unwrap().coefficients[0].value;
                assert!(mass_kg < 1e-3, "{mass_kg} kg");
            }
            Err(refused) => assert!(matches!(refused, FitError::ExplainsNothing { .. }), "{refused}"),
        }
    }

    #[test]
    fn a_load_that_is_there_starts_near_its_mass_and_its_cable() {
        let model = truth();
        let mut loaded = model.clone();
        loaded.set(Effect::SlungLoad, &[0.12, 0.6, 0.05]);
        let flight = Prepared::new(&fly(&loaded, 4, 12.0, &NONE), &loaded.vehicle).unwrap();
        let layout = layout(vec![Effect::SlungLoad]);
        let (starts, flights) = of(&[&flight], model, &layout, |_| true, Demand::Promising).unwrap();
        assert_eq!(flights.len(), 1);
        let values = starts[0].term(Effect::SlungLoad).unwrap().values();
        assert!((values[0] - 0.12).abs() < 0.02 && (values[1] - 0.6).abs() < 0.1, "{values:?}");
    }
}
