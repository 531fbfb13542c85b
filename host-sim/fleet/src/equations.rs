//! What is kept of a flight: its normal equations, so that no later question reads its log again.
//!
//! A flight is looked at about a reference model of its craft, whose lag of the motors, dead time, wind and the like are held. There
//! it has a column for each coefficient of the basic model and of every effect of the catalogue that can be had linearly: those of
//! adjusting effects are the derivatives of the residual at the reference. Kept are, for each axis,
//!
//! - the triangle R of [columns | target]: any set of these effects is fitted from it as from all rows, and triangles of flights merge
//!   (least squares is a monoid). The target is such that the coefficients come out as they are, not as steps from the reference;
//! - the covariance of the scores X'e about the flight's own fit of the reference's effects, coloured residuals accounted for (Newey
//!   and West): standard errors of any set of effects follow from it, in proportion to what that set leaves;
//! - what a jitter of the log's times does to X'y.

use std::sync::Arc;

use model::{Effect, Kind, Model};
use nalgebra::{DMatrix, DVector};
use sysid::Prepared;
use sysid::fit::least_squares::{AxisTriangle, FlightRows, RowColumn, axis_triangle, scores_covariance};
use sysid::fit::linearise::About;
use sysid::fit::swing::Known;
use sysid::fit::timing;

/// A coefficient that flights have a column for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its effect.
    pub effect: Effect,
    /// Its place among the effect's coefficients.
    pub coefficient: usize,
    /// Its value in the reference model; zero where that lacks the effect.
    pub reference: f64,
}

impl Parameter {
    /// "thrust.C_T".
    pub fn name(&self) -> String {
        format!("{}.{}", self.effect.id(), self.effect.info().coefficients[self.coefficient].name)
    }
}

/// The coefficients that the flights of a craft have columns for, in order: linear effects first.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// All of them.
    pub parameters: Vec<Parameter>,
    linear: Vec<Effect>,
    adjusting: Vec<Effect>,
}

impl Columns {
    /// Whether flights have columns for an effect at all.
    pub fn have(effect: Effect) -> bool {
        let special = || effect.info().special;
        !matches!(effect, Effect::User(_)) && !special().hangs_load && !special().adds_accelerations
    }

    /// Those about a reference model.
    pub fn about(reference: &Model) -> Self {
        let all = Effect::all().filter(|effect| Self::have(*effect));
        let (adjusting, linear): (Vec<Effect>, Vec<Effect>) =
            all.partition(|effect| effect.info().kind == Kind::Adjusting);
        let of = |effect: &Effect| {
            let effect = *effect;
            let values = reference.term(effect).map(model::Term::values).unwrap_or_default();
            (0..effect.info().coefficients.len()).map(move |coefficient| {
                let reference = values.get(coefficient).copied().unwrap_or(0.0);
                Parameter { effect, coefficient, reference }
            })
        };
        let parameters = linear.iter().chain(&adjusting).flat_map(of).collect();
        Self { parameters, linear, adjusting }
    }

    /// The places of the coefficients of some effects.
    pub fn of(&self, effects: &[Effect]) -> Vec<usize> {
        let is_of = |k: &usize| effects.contains(&self.parameters[*k].effect);
        (0..self.parameters.len()).filter(is_of).collect()
    }
}

/// The normal equations of a flight on one axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AxisEquations {
    /// Coefficients that act there, by their place among the craft's columns.
    pub parameters: Vec<usize>,
    /// Upper triangle of [columns | target], column by column.
    pub triangle: Arc<[f64]>,
    /// Upper triangle of the covariance of the scores, column by column.
    pub scores: Arc<[f64]>,
    /// What a jitter of the times does to the scores; empty where there is none.
    pub timing: Arc<[f64]>,
    /// Standard deviation of what the flight's own fit of the reference's effects leaves.
    pub sigma: f64,
}

/// The normal equations of a flight.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Equations {
    /// Of u v w p q r.
    pub axes: [AxisEquations; 6],
    /// Rows behind them.
    pub rows: usize,
    /// Time behind them, s.
    pub record_s: f64,
}

impl Equations {
    /// Of a flight that was lined up with the reference model.
    pub fn of(flight: &Prepared, reference: &Model, columns: &Columns) -> Self {
        let stride = flight.fit_stride();
        let effects = (&columns.linear[..], &columns.adjusting[..]);
        let About { residuals, columns: found, .. } =
            About::new(flight, reference, effects, stride, &Known::default());
        let mut targets = residuals.residual;
        for (parameter, column) in columns.parameters.iter().zip(&found) {
            if parameter.reference != 0.0 {
                add(&mut targets, column, parameter.reference);
            }
        }
        let off = timing(&[flight], reference).pop().flatten();
        let rows = flight.rows_of_fit(targets, found);
        let own = columns.of(&reference.effects());
        let axes = std::array::from_fn(|axis| on_axis(&rows, axis, &own, off.as_ref()));
        Self { axes, rows: rows.rows(), record_s: rows.rows() as f64 * rows.period_s }
    }
}

fn add(targets: &mut [Vec<f64>; 6], column: &RowColumn, times: f64) {
    for (target, column) in targets.iter_mut().zip(column) {
        let Some(column) = column else { continue };
        target.iter_mut().zip(column).for_each(|(t, c)| *t += times * c);
    }
}

fn on_axis(rows: &FlightRows, axis: usize, own: &[usize], off: Option<&RowColumn>) -> AxisEquations {
    let AxisTriangle { parameters, triangle } =
        axis_triangle(std::slice::from_ref(rows), axis, rows.columns.len());
    let width = parameters.len();
    let mut value = DVector::zeros(width);
    let fitted: Vec<usize> = (0..width).filter(|k| own.contains(&parameters[*k])).collect();
    if !fitted.is_empty() {
        let x = triangle.select_columns(&fitted);
        // Columns that a flight does not tell apart leave the same residual however they share it.
        let solved = x.svd(true, true).solve(&triangle.column(width), 1e-12 * triangle.norm());
        let solved = solved.iter().flat_map(|solved| solved.iter());
        fitted.iter().zip(solved).for_each(|(&k, v)| value[k] = *v);
    }
    let left = AxisTriangle { parameters: (0..width).collect(), triangle };
    let sigma = left.left(&value) / (rows.rows().max(1) as f64).sqrt();
    let column = |k: &usize| rows.columns[*k][axis].clone();
    let alone = FlightRows {
        targets: std::array::from_fn(|a| if a == axis { rows.targets[axis].clone() } else { Vec::new() }),
        columns: parameters
            .iter()
            .map(|k| std::array::from_fn(|a| if a == axis { column(k) } else { None }))
            .collect(),
        starts: rows.starts.clone(),
        period_s: rows.period_s,
    };
    let scores = scores_on(alone, axis, &value);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum();
    let timing = off.and_then(|off| off[axis].as_ref()).map_or_else(Arc::default, |off| {
        parameters.iter().map(|k| rows.columns[*k][axis].as_ref().map_or(0.0, |c| product(c, off))).collect()
    });
    AxisEquations { parameters, triangle: packed(&left.triangle), scores: packed(&scores), timing, sigma }
}

/// Covariance of the scores of one axis, unweighted.
fn scores_on(mut alone: FlightRows, axis: usize, value: &DVector<f64>) -> DMatrix<f64> {
    // Rows are counted by the first axis.
    if axis > 0 {
        alone.targets.swap(0, axis);
        alone.columns.iter_mut().for_each(|column| column.swap(0, axis));
    }
    let parameters = alone.columns.len();
    scores_covariance(&[alone], value, &[1.0; 6], parameters)
}

/// The upper triangle of a square matrix, column by column.
fn packed(square: &DMatrix<f64>) -> Arc<[f64]> {
    (0..square.ncols()).flat_map(|c| (0..=c).map(move |r| square[(r, c)])).collect()
}

/// Where an entry of an upper triangle lies.
pub(crate) const fn place(row: usize, column: usize) -> usize {
    column * (column + 1) / 2 + row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_triangle_has_its_entries_where_they_are_looked_for() {
        let square = DMatrix::from_fn(4, 4, |r, c| (10 * r + c) as f64);
        let packed = packed(&square);
        assert_eq!(packed.len(), place(0, 4));
        for c in 0..4 {
            assert!((0..=c).all(|r| packed[place(r, c)] == (10 * r + c) as f64));
        }
    }

    #[test]
    fn every_coefficient_of_the_basic_model_has_a_column_and_its_reference_value() {
        let thesis = Model::thesis();
        let columns = Columns::about(&thesis);
        let basic: Vec<Effect> = Effect::basic().collect();
        let found: Vec<f64> =
            columns.of(&basic).into_iter().map(|k| columns.parameters[k].reference).collect();
        let count: usize = basic.iter().map(|effect| effect.info().coefficients.len()).sum();
        assert_eq!(found.len(), count);
        let thrust = columns.parameters.iter().find(|p| p.name() == "thrust.C_T").unwrap();
        assert_eq!(thrust.reference, thesis.term(Effect::Thrust).unwrap().coefficients[0].value);
        assert!(columns.parameters.iter().all(|p| !p.name().contains(' ')));
        assert!(columns.parameters.iter().all(|p| p.effect != Effect::SlungLoad));
    }
}
