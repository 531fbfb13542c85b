//! A flight about a model: what the model leaves of it, and the columns by which coefficients change that.
//!
//! The columns of linear effects come from the states alone. Those of adjusting effects are derivatives of the residual: forward
//! differences, for which the model is evaluated once more for each coefficient. Models that see the same states (another wind,
//! another ground effect) are evaluated side by side in one pass over them.

use model::user_effects::User;
use model::{Effect, Kind, Model};

use crate::fit::least_squares::RowColumn;
use crate::fit::predicted::{self, less, measured};
use crate::fit::residuals::Residuals;
use crate::fit::rows::Hung;
use crate::fit::slow;
use crate::fit::slung_load::{self, Carried};
use crate::fit::swing::{Followed, Known};
use crate::fit::terms::{Changes, coefficient_count};
use crate::fit::unloaded::{Beginning, Unloaded};
use crate::prepare::Prepared;

/// Step of a derivative, part of an ordinary magnitude. Effects act smoothly: a forward difference over it is off by about
/// this part of the derivative; rounding, 1e-15 of the residual, matters less still.
const DERIVATIVE_STEP: f64 = 1e-5;

/// A flight about a model.
pub struct About {
    /// What was measured, and what the model leaves of it.
    pub residuals: Residuals,
    /// How a load begins each piece, where there is one.
    pub begun: Vec<Beginning>,
    /// Those of the linear effects, then minus the residual's derivatives with respect to the coefficients of the adjusting ones.
    pub columns: Vec<RowColumn>,
}

impl About {
    /// Over the rows at every `stride`th sample. A linear effect need not be in the model; an adjusting one that is not is
    /// linearised where it is not there. `known` is of a load that was followed before.
    pub fn new(
        flight: &Prepared,
        model: &Model,
        (linear, adjusting): (&[Effect], &[Effect]),
        stride: usize,
        known: &Known,
    ) -> Self {
        let steps: Vec<Step> = adjusting.iter().flat_map(|effect| Step::all(model, *effect)).collect();
        match slung_load::of_model(model) {
            Some(carried) => Self::with_load(flight, (model, carried), linear, &steps, stride, known),
            None => Self::without_load(flight, model, linear, &steps, stride),
        }
    }

    fn without_load(
        flight: &Prepared,
        model: &Model,
        linear: &[Effect],
        steps: &[Step],
        stride: usize,
    ) -> Self {
        let measured = measured(flight, model, stride);
        let ahead = steps.iter().filter(|step| step.user().is_none()).map(|step| &step.ahead);
        let models: Vec<&Model> = std::iter::once(model).chain(ahead).collect();
        let changes = Step::changes(model, steps);
        let (mut columns, predicted) =
            flight.columns_and_predicted_by((linear, &changes), &models, stride, None);
        let mut changed = columns.split_off(linear.iter().map(|e| coefficient_count(*e)).sum()).into_iter();
        let mut predicted = predicted.into_iter();
        let base = predicted.next().unwrap_or_default();
        let adjust = model.adjustments();
        columns.extend(steps.iter().map(|step| {
            if step.user().is_some() {
                return felt(changed.next().unwrap_or_default());
            }
            let predicted = predicted.next().unwrap_or_default();
            let ahead = step.ahead.adjustments();
            if ahead.load().is_some() {
                // Nothing hangs there yet: the derivative is that of a load without mass.
                let mut hanging = model.clone();
                hanging.set(step.effect, &step.base);
                let alone = Self::new(flight, &hanging, (&[], &[step.effect]), stride, &Known::default());
                return alone.columns.into_iter().nth(step.coefficient).unwrap_or_default();
            }
            // Most effects change what is predicted, not what was measured.
            if ahead.track_alike(&adjust) {
                return slope(&predicted, &base, step.size);
            }
            let moved = predicted::measured(flight, &step.ahead, stride);
            let left = |measured: &[Vec<f64>; 6], predicted: &RowColumn| less(measured, predicted).map(Some);
            slope(&left(&measured, &base), &left(&moved, &predicted), step.size)
        }));
        let residual = less(&measured, &base);
        Self { residuals: Residuals { measured, residual }, begun: Vec::new(), columns }
    }

    fn with_load(
        flight: &Prepared,
        (model, carried): (&Model, Carried),
        linear: &[Effect],
        steps: &[Step],
        stride: usize,
        known: &Known,
    ) -> Self {
        let followed = Followed::new(Unloaded::new(flight, model, stride), carried, known);
        let parts = if linear.is_empty() && steps.is_empty() { Vec::new() } else { followed.parts(flight) };
        let hung = Hung { parts: &parts, part: carried.part() };
        let adjust = model.adjustments();
        // What leaves the load where it is moves it with the craft, as the forces of linear effects do.
        let leaves_load = |step: &&Step| {
            let ahead = step.ahead.adjustments();
            !step.effect.info().special.hangs_load
                && ahead.track_alike(&adjust)
                && ahead.extra_mass_kg() == adjust.extra_mass_kg()
        };
        let models: Vec<&Model> =
            std::iter::once(model).chain(steps.iter().filter(leaves_load).map(|step| &step.ahead)).collect();
        let (mut columns, predicted) = match models.len() {
            1 if linear.is_empty() => Default::default(),
            1 => (flight.columns(linear, model, stride, Some(&hung)), Vec::new()),
            _ => flight.columns_and_predicted_by((linear, &[]), &models, stride, Some(&hung)),
        };
        let mut predicted = predicted.into_iter();
        let base = predicted.next().unwrap_or_default();
        columns.iter_mut().for_each(|column| followed.take_out(column));
        for step in steps {
            columns.push(if leaves_load(&step) {
                let mut column = slope(&predicted.next().unwrap_or_default(), &base, step.size);
                followed.take_out(&mut column);
                column
            } else if step.effect.info().special.hangs_load {
                followed.slope_of_load(&slung_load::of_model(&step.ahead).unwrap_or(carried), step.size)
            } else {
                followed.slope(flight, &step.ahead, step.size)
            });
        }
        Self { residuals: followed.residuals(), begun: followed.begun, columns }
    }
}

/// A model with one coefficient of an adjusting effect a little further.
struct Step {
    effect: Effect,
    coefficient: usize,
    /// The effect's coefficients without the step.
    base: Vec<f64>,
    size: f64,
    ahead: Model,
}

impl Step {
    fn all(model: &Model, effect: Effect) -> Vec<Self> {
        let zeros = vec![0.0; effect.info().coefficients.len()];
        let known = model.term(effect).map(|term| term.coefficients.iter().map(|c| c.value).collect());
        let base: Vec<f64> = known.unwrap_or(zeros);
        let step = |coefficient: usize| {
            let has_map = model.vehicle.has_rotor_map();
            let scale = || local_scale(has_map, effect, coefficient, base[coefficient]);
            let own = effect.info().coefficients[coefficient].derivative_step;
            let size = own.unwrap_or_else(|| DERIVATIVE_STEP * scale());
            let mut values = base.clone();
            values[coefficient] += size;
            let mut ahead = model.clone();
            ahead.set(effect, &values);
            Self { effect, coefficient, base: base.clone(), size, ahead }
        };
        (0..base.len()).map(step).collect()
    }

    /// The users' effect that is moved, where it is one of theirs.
    fn user(&self) -> Option<User> {
        match self.effect {
            Effect::User(user) => Some(user),
            _ => None,
        }
    }

    /// What the users' effects among these change by, effect by effect.
    fn changes(model: &Model, steps: &[Self]) -> Vec<Changes> {
        let of_effect = |own: &[Self]| {
            let [first, ..] = own else { return None };
            let values = |model: &Model| model.term(first.effect).map(|term| term.values());
            let ahead = own.iter().filter_map(|step| Some((values(&step.ahead)?, step.size)));
            Some(Changes::new(first.user()?, values(model), ahead.collect()))
        };
        steps.chunk_by(|one, other| one.effect == other.effect).filter_map(of_effect).collect()
    }
}

/// Magnitude of a coefficient for differences about a value: a length or another scale goes by itself.
fn local_scale(has_rotor_map: bool, effect: Effect, coefficient: usize, value: f64) -> f64 {
    let is_scale = effect.info().coefficients[coefficient].possible.0 > 0.0 && value > 0.0;
    if is_scale { value } else { step_scale(has_rotor_map, effect, coefficient) }
}

/// Ordinary magnitude of a coefficient; rotor "speeds" are commands near 1 where the map is unknown.
pub fn step_scale(has_rotor_map: bool, effect: Effect, coefficient: usize) -> f64 {
    effect.info().coefficients[coefficient].ordinary(has_rotor_map)
}

/// From one to another over a step.
fn slope(ahead: &RowColumn, here: &RowColumn, step: f64) -> RowColumn {
    let slope = std::array::from_fn(|axis| {
        let (ahead, here) = (ahead[axis].as_ref()?, here[axis].as_ref()?);
        Some(ahead.iter().zip(here).map(|(a, h)| (a - h) / step).collect())
    });
    felt(slope)
}

/// A derivative without the axes that do not feel the step: these stay out of the problem.
fn felt(slope: RowColumn) -> RowColumn {
    slope.map(|axis| axis.filter(|slope| slope.iter().any(|d| *d != 0.0)))
}

/// What each coefficient of an effect does to the accelerations at the rows, at its ordinary size: its column of the regression
/// times that. An adjusting effect that the model does not have is taken about ordinary coefficients.
pub fn contributions(flight: &Prepared, model: &Model, effect: Effect) -> Vec<RowColumn> {
    let has_map = model.vehicle.has_rotor_map();
    let sizes: Vec<f64> =
        (0..effect.info().coefficients.len()).map(|k| step_scale(has_map, effect, k)).collect();
    let mut there = model.clone();
    let effects: (&[Effect], &[Effect]) = match effect.info().kind {
        Kind::Adjusting => (&[], &[effect]),
        _ => (&[effect], &[]),
    };
    if effect.info().kind == Kind::Adjusting && !model.has(effect) {
        there.set(effect, &sizes);
    }
    let mut columns = About::new(flight, &there, effects, 1, &Known::default()).columns;
    for (column, size) in columns.iter_mut().zip(&sizes) {
        column.iter_mut().flatten().flatten().for_each(|value| *value *= size);
    }
    columns
}

/// Measured and measured-minus-predicted of all six axes over the rows of a flight.
/// Where the slow part of the horizontal forces is none of the model's, it is taken from both.
pub fn residuals(flight: &Prepared, model: &Model) -> Residuals {
    let mut all = residuals_at_rows(flight, model, 1);
    if slow::is_taken(flight) {
        slow::take_from_targets(flight, 1, &mut all.measured);
        slow::take_from_targets(flight, 1, &mut all.residual);
    }
    all
}

/// The same over the rows at every `stride`th sample.
pub fn residuals_at_rows(flight: &Prepared, model: &Model, stride: usize) -> Residuals {
    About::new(flight, model, (&[], &[]), stride, &Known::default()).residuals
}

/// Sums of squares of what a model leaves along the six axes, over the rows of a flight that a fit takes.
pub fn squares_left(flight: &Prepared, model: &Model) -> [f64; 6] {
    let left = residuals_at_rows(flight, model, flight.fit_stride()).residual;
    left.each_ref().map(|axis| axis.iter().map(|r| r * r).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn flown(model: &Model) -> Prepared {
        Prepared::new(&fly(model, 1, 6.0, &NONE), &model.vehicle).unwrap()
    }

    /// A users' effect that is not linear, as a model has it: along an axis of the craft and along one of the room.
    fn of_a_user() -> (Effect, [f64; 2]) {
        let text = r#"
[[effect]]
id = "fades"
acceleration.u = "k * exp(-(a * v)^2)"
acceleration.down = "k * tanh(a * u)"
coefficient = [
    { name = "k", unit = "m/s^2", possible = [-5.0, 5.0], typical = 0.3 },
    { name = "a", unit = "s/m", possible = [-5.0, 5.0], typical = 0.8 },
]
"#;
        let effects = model::effects::draft(text, std::path::Path::new("fades.toml")).unwrap();
        (Effect::User(effects[0]), [0.4, 0.7])
    }

    /// By central differences of the residual, over steps a thousand times as long.
    #[test]
    fn the_columns_of_adjusting_effects_are_minus_the_derivatives_of_the_residual() {
        let mut model = truth();
        let flight = flown(&model);
        let (own, has) = of_a_user();
        model.set(own, &has);
        let effects =
            [Effect::MassChange, Effect::SteadyWind, Effect::TrackingOffset, Effect::InputDelay, own];
        for effect in effects {
            let about = About::new(&flight, &model, (&[], &[effect]), 3, &Known::default());
            assert_eq!(about.columns.len(), effect.info().coefficients.len());
            for (k, column) in about.columns.iter().enumerate() {
                let step = 1e-2 * step_scale(true, effect, k);
                let moved = |way: f64| {
                    let known = model.term(effect).map(|term| term.values());
                    let mut values = known.unwrap_or_else(|| vec![0.0; about.columns.len()]);
                    values[k] += way * step;
                    let mut moved = model.clone();
                    moved.set(effect, &values);
                    residuals_at_rows(&flight, &moved, 3).residual
                };
                let (ahead, behind) = (moved(1.0), moved(-1.0));
                for axis in 0..6 {
                    let slope: Vec<f64> =
                        ahead[axis].iter().zip(&behind[axis]).map(|(a, b)| -(a - b) / (2.0 * step)).collect();
                    let zeros = vec![0.0; slope.len()];
                    let column = column[axis].as_ref().unwrap_or(&zeros);
                    let norm = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
                    let difference: Vec<f64> = column.iter().zip(&slope).map(|(a, b)| a - b).collect();
                    assert!(
                        norm(&difference) <= 0.01 * norm(&slope) + 1e-6,
                        "{effect} {k}, axis {axis}: {} of {}",
                        norm(&difference),
                        norm(&slope)
                    );
                }
            }
        }
    }

    #[test]
    fn what_was_measured_is_what_is_predicted_and_what_is_left() {
        let model = truth();
        let flight = flown(&model);
        let Residuals { measured, residual } = residuals_at_rows(&flight, &model, 3);
        let predicted = flight.predicted_by(&[&model], 3, None).pop().unwrap();
        for axis in 0..6 {
            let predicted = predicted[axis].as_ref().unwrap();
            for ((m, r), p) in measured[axis].iter().zip(&residual[axis]).zip(predicted) {
                assert!((m - p - r).abs() < 1e-12);
            }
        }
        assert_eq!(residuals(&flight, &model).residual[0].len(), flight.rows());
    }

    /// By what two models predict.
    #[test]
    fn contributions_are_what_the_prediction_changes_by() {
        let model = truth();
        let flight = flown(&model);
        let predicted = |model: &Model| flight.predicted_by(&[model], 1, None).pop().unwrap();
        let norm = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
        for effect in [Effect::QuadraticDrag, Effect::GroundEffect] {
            let is_linear = effect.info().kind == Kind::Linear;
            let typical: Vec<f64> = effect.info().coefficients.iter().map(|c| c.typical).collect();
            let columns = contributions(&flight, &model, effect);
            assert_eq!(columns.len(), typical.len());
            for (k, column) in columns.iter().enumerate() {
                let size = if is_linear { 1.0 } else { 1e-3 };
                let at = |part: f64| {
                    let mut values = if is_linear { vec![0.0; typical.len()] } else { typical.clone() };
                    values[k] += part * typical[k];
                    let mut with = model.clone();
                    with.set(effect, &values);
                    predicted(&with)
                };
                let (from, to) = (at(0.0), at(size));
                for axis in 0..6 {
                    let Some(column) = &column[axis] else { continue };
                    let (from, to) = (from[axis].as_ref().unwrap(), to[axis].as_ref().unwrap());
                    let change: Vec<f64> = from.iter().zip(to).map(|(a, b)| (b - a) / size).collect();
                    let off: Vec<f64> = change.iter().zip(column).map(|(a, b)| a - b).collect();
                    assert!(norm(&change) > 0.0 && norm(&off) < 0.01 * norm(&change), "{effect} {k} {axis}");
                }
            }
        }
    }

    #[test]
    fn a_slope_is_over_the_step_and_rows_that_feel_nothing_stay_out() {
        let column = |u: Option<Vec<f64>>, v: Option<Vec<f64>>| {
            let mut column = RowColumn::default();
            (column[0], column[1]) = (u, v);
            column
        };
        let here = column(Some(vec![1.0, 2.0]), Some(vec![3.0]));
        let ahead = column(Some(vec![1.5, 1.0]), Some(vec![3.0]));
        assert_eq!(slope(&ahead, &here, 0.5), column(Some(vec![1.0, -2.0]), None));
        assert_eq!(slope(&ahead, &RowColumn::default(), 0.5), RowColumn::default());
    }

    #[test]
    fn a_length_is_stepped_by_itself_and_what_is_not_there_by_an_ordinary_size() {
        let length = Effect::SlungLoad.info().coefficients[1];
        assert_eq!(local_scale(true, Effect::SlungLoad, 1, 3.0), 3.0);
        assert_eq!(local_scale(true, Effect::SlungLoad, 1, 0.0), length.typical);
        assert_eq!(
            local_scale(true, Effect::MassChange, 0, 3.0),
            Effect::MassChange.info().coefficients[0].typical
        );
    }

    #[test]
    fn rotor_speeds_that_are_commands_are_counted_near_one() {
        // A correction of the speed by 40 rad/s per volt is a twentieth of such a command.
        assert_eq!(step_scale(true, Effect::BatteryVoltage, 0), 40.0);
        assert_eq!(step_scale(false, Effect::BatteryVoltage, 0), 0.05);
    }
}
