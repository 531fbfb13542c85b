//! A formula of a user's effect with the row that it acts on.

use crate::axis::{AXES, Axis};
use crate::sample::Sample;
use crate::user_effects::formula::Formula;
use crate::user_effects::input::Input;
use crate::user_effects::tape::Tape;

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

#[derive(Debug)]
pub(super) struct RowFormula {
    pub(super) row: Row,
    pub(super) formula: Formula,
    pub(super) inputs: Vec<Input>,
    /// Of this formula alone.
    tape: Tape,
}

impl RowFormula {
    pub(super) fn new(row: Row, formula: Formula, inputs: Vec<Input>) -> Self {
        let tape = Tape::new(&[(formula.recorded(), &inputs)]);
        Self { row, formula, inputs, tape }
    }

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
        let mut found = f64::NAN;
        self.tape.evaluate(sample, coefficients, |_, value| found = value);
        found
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
