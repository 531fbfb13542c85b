//! A formula of a user's effect with the row that it acts on.

use crate::axis::{AXES, Axis};
use crate::memory::LagId;
use crate::quantity::Quantity;
use crate::sample::Sample;
use crate::user_effects::columns::FurtherColumn;
use crate::user_effects::formula::Formula;

/// A row of a formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Row {
    Body(Axis),
    /// North, east or down.
    Inertial(usize),
}

pub(super) const INERTIAL: [&str; 3] = ["north", "east", "down"];

impl Row {
    pub(super) fn parse(name: &str) -> Option<Self> {
        let body = AXES.into_iter().find(|axis| axis.name() == name).map(Row::Body);
        body.or_else(|| INERTIAL.iter().position(|row| *row == name).map(Row::Inertial))
    }

    pub(super) const fn unit(self) -> &'static str {
        match self {
            Row::Body(axis) => axis.unit(),
            Row::Inertial(_) => "m/s^2",
        }
    }

    pub(super) fn acts_on(self, axis: Axis) -> bool {
        match self {
            Row::Body(own) => own == axis,
            Row::Inertial(_) => axis.is_force(),
        }
    }
}

/// Where a name's value comes from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Input {
    Quantity(&'static Quantity),
    Further(FurtherColumn),
    Lagged(LagId),
    Coefficient(usize),
    Constant(f64),
}

#[derive(Debug)]
pub(super) struct RowFormula {
    pub(super) row: Row,
    pub(super) formula: Formula,
    pub(super) inputs: Vec<Input>,
}

impl RowFormula {
    /// Whether it looks at the rotors, whose unit depends on the vehicle.
    pub(super) fn has_rotors(&self) -> bool {
        self.inputs.iter().any(|input| {
            let quantity = match input {
                Input::Quantity(quantity) => Some(*quantity),
                Input::Lagged(lag) => lag.quantity(),
                _ => None,
            };
            quantity.is_some_and(|quantity| quantity.unit_in_commands.is_some())
        })
    }

    pub(super) fn value(&self, sample: &Sample, coefficients: &[f64]) -> f64 {
        let mut values = [0.0; MAX_NAMES];
        for (value, input) in values.iter_mut().zip(&self.inputs) {
            *value = match input {
                Input::Quantity(quantity) => quantity.at(sample),
                Input::Further(column) => sample.input.further[column.place],
                Input::Lagged(lag) => sample.input.remembered(*lag),
                Input::Coefficient(k) => coefficients.get(*k).copied().unwrap_or(0.0),
                Input::Constant(value) => *value,
            };
        }
        self.formula.value(&values[..self.inputs.len()])
    }

    pub(super) fn names(&self, coefficient: usize) -> bool {
        self.inputs.iter().any(|input| matches!(input, Input::Coefficient(k) if *k == coefficient))
    }
}

/// Most different names in one formula.
pub(super) const MAX_NAMES: usize = 40;

pub(super) fn rows_known() -> String {
    let axes = AXES.map(Axis::name).join(", ");
    format!("{axes} (body), {} (inertial)", INERTIAL.join(", "))
}
