//! A checked definition: its formulas, and what they add to the equations.

use std::path::Path;

use crate::axis::{AXES, Axis};
use crate::effect::{Coefficient, EffectInfo, Kind, Question, Special};
use crate::lags::Lags;
use crate::memory::{LagId, MAX_LAGS};
use crate::sample::Sample;
use crate::user_effects::check::{
    Known, Problem, check_coefficients, check_columns, check_constants, check_words,
};
use crate::user_effects::definition::{Definition, MAX_NAME, UserEffectError};
use crate::user_effects::input::Input;
use crate::user_effects::names::Names;
use crate::user_effects::row::{Row, RowFormula, rows_known};
use crate::user_effects::tape::{Recorded, Tape};

/// A checked definition.
#[derive(Debug)]
pub struct UserEffect {
    pub(super) definition: Definition,
    pub(super) formulas: Vec<RowFormula>,
    /// Of all formulas together.
    tape: Tape,
    /// Whether every formula is linear in the coefficients and vanishes with them.
    is_linear: bool,
    /// Coefficients that have to be given so that the rest enters linearly.
    pub(super) is_shape: Vec<bool>,
}

impl UserEffect {
    /// Adds all accelerations.
    pub(super) fn add(&self, sample: &Sample, coefficients: &[f64], sum: &mut [f64; 6]) {
        let mut rows = Rows::new(sum);
        self.tape.evaluate(sample, coefficients, |k, value| rows.add(self.formulas[k].row, value));
        rows.turn(sample);
    }

    /// Adds those of the formulas that name a coefficient.
    pub(super) fn add_naming(&self, coefficient: usize, sample: &Sample, values: &[f64], sum: &mut [f64; 6]) {
        let mut rows = Rows::new(sum);
        for formula in self.formulas.iter().filter(|f| f.names(coefficient)) {
            rows.add(formula.row, formula.value(sample, values));
        }
        rows.turn(sample);
    }

    /// Its identifier.
    pub fn id(&self) -> &str {
        &self.definition.id
    }

    /// As it was defined.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// The rows that it acts on.
    pub fn axes(&self) -> Vec<Axis> {
        AXES.into_iter().filter(|axis| self.formulas.iter().any(|f| f.row.acts_on(*axis))).collect()
    }

    /// Whether every formula is linear in the coefficients.
    pub fn is_linear(&self) -> bool {
        self.is_linear
    }

    pub(super) fn check(definition: Definition, path: &Path, known: &Known) -> Result<Self, UserEffectError> {
        let id: String = definition.id.chars().take(MAX_NAME).collect();
        Self::checked(definition, known).map_err(|(field, problem)| UserEffectError::Field {
            path: path.to_owned(),
            effect: id,
            field,
            problem,
        })
    }

    fn checked(definition: Definition, known: &Known) -> Result<Self, Problem> {
        check_words(&definition, known)?;
        let coefficients = check_coefficients(&definition)?;
        let constants = check_constants(&definition)?;
        if definition.acceleration.is_empty() {
            return Err(("acceleration".into(), format!("has no row; rows are {}", rows_known())));
        }
        let columns = check_columns(&definition)?;
        let names = Names {
            definition: &definition,
            coefficients: &coefficients,
            constants: &constants,
            columns: &columns,
        };
        let mut formulas = Vec::new();
        for (row, text) in &definition.acceleration {
            let field = format!("acceleration.{row}");
            formulas.push(names.formula(row, text).map_err(|problem| (field, problem))?);
        }
        for (k, coefficient) in definition.coefficient.iter().enumerate() {
            if !formulas.iter().any(|f| f.names(k)) {
                return Err((format!("coefficient {}", coefficient.name), "is in no formula".into()));
            }
        }
        let (is_linear, is_shape) = names.shapes(&formulas);
        let all: Vec<(&Recorded, &[Input])> =
            formulas.iter().map(|f| (f.formula.recorded(), &f.inputs[..])).collect();
        let tape = Tape::new(&all);
        let effect = Self { formulas, tape, is_linear, is_shape, definition };
        if Lags::new(effect.lags()).ids().count() >= MAX_LAGS {
            return Err((
                "acceleration".into(),
                format!("looks back by {MAX_LAGS} lags or more; fewer are possible"),
            ));
        }
        Ok(effect)
    }

    /// What it says of itself, for the rest of the program.
    pub(super) fn info(&self) -> EffectInfo {
        let definition = &self.definition;
        let coefficients: Vec<Coefficient> = definition
            .coefficient
            .iter()
            .zip(&self.is_shape)
            .enumerate()
            .map(|(k, (c, is_shape))| {
                let [low, high] = c.possible;
                let mut own = Coefficient::new(forever(&c.name), forever(&c.unit), (low, high), c.typical);
                if self.formulas.iter().any(|f| f.names(k) && f.has_rotors()) {
                    own = own.in_commands(forever(&format!("{}, with cmd for rad/s", c.unit)));
                }
                // A shape only means something together with the rest: zero is no hypothesis about it. What is known of it is
                // hardly more than what is possible.
                if *is_shape { own.known_to(3.0 * low.abs().max(high.abs())) } else { own }
            })
            .collect();
        let sentence = definition.sentence.clone().unwrap_or_else(|| "Defined by the user.".into());
        let excitation = definition.excitation.clone().unwrap_or_else(|| self.excitation());
        let confused: Vec<(&str, &str)> =
            definition.confused_with.iter().map(|(id, how)| (forever(id), forever(how))).collect();
        EffectInfo {
            id: forever(&definition.id),
            sentence: forever(&sentence),
            kind: if self.is_linear() { Kind::Linear } else { Kind::Adjusting },
            question: if self.is_linear() { Question::Both } else { Question::Structure },
            axes: Vec::leak(self.axes()),
            coefficients: Vec::leak(coefficients),
            excitation: forever(&excitation),
            confused_with: Vec::leak(confused),
            equation: forever(&self.equation()),
            source: None,
            through: Vec::leak(self.quantities().into_iter().take(1).collect()),
            special: Special { adds_accelerations: !self.is_linear(), ..Special::NOTHING },
        }
    }

    /// Names of the measured quantities in its formulas, further columns of flight files among them.
    pub(super) fn quantities(&self) -> Vec<&'static str> {
        self.names(|input| match input {
            Input::Quantity(quantity) => Some(quantity.name),
            Input::Further(column) => Some(column.name),
            Input::Lagged(lag) => lag.quantity().map(|quantity| quantity.name),
            Input::Coefficient(_) | Input::Constant(_) => None,
        })
    }

    /// What its formulas look back at.
    pub(super) fn lags(&self) -> Vec<LagId> {
        let of = |input: &Input| match input {
            Input::Lagged(lag) => Some(*lag),
            _ => None,
        };
        self.formulas.iter().flat_map(|f| &f.inputs).filter_map(of).collect()
    }

    /// Names of the further columns of flight files in its formulas.
    pub(super) fn columns(&self) -> Vec<&'static str> {
        self.names(|input| match input {
            Input::Further(column) => Some(column.name),
            _ => None,
        })
    }

    fn names(&self, of: impl Fn(&Input) -> Option<&'static str>) -> Vec<&'static str> {
        let mut names: Vec<&str> = Vec::new();
        for name in self.formulas.iter().flat_map(|f| &f.inputs).filter_map(of) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    fn excitation(&self) -> String {
        format!("fly so that {} vary", self.quantities().join(", "))
    }

    fn equation(&self) -> String {
        let rows = self.definition.acceleration.iter().map(|(row, formula)| format!("{row}: {formula}"));
        rows.collect::<Vec<_>>().join("; ")
    }
}

/// Sums of rows, those of the room apart until they are turned.
struct Rows<'a> {
    sum: &'a mut [f64; 6],
    inertial: Option<nalgebra::Vector3<f64>>,
}

impl<'a> Rows<'a> {
    fn new(sum: &'a mut [f64; 6]) -> Self {
        Self { sum, inertial: None }
    }

    fn add(&mut self, row: Row, value: f64) {
        match row {
            Row::Body(axis) => self.sum[axis.index()] += value,
            Row::Inertial(k) => self.inertial.get_or_insert_default()[k] += value,
        }
    }

    fn turn(self, sample: &Sample) {
        if let Some(inertial) = self.inertial {
            let body = sample.input.dcm * inertial;
            self.sum.iter_mut().zip(body.iter()).for_each(|(s, b)| *s += b);
        }
    }
}

fn forever(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}
