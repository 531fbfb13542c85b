//! A form as an effect of a user: formulas with units, coefficients with where they may lie.

use std::collections::BTreeMap;

use model::user_effects::{CoefficientDefinition, ColumnDefinition, ConstantDefinition, Definition};

use crate::discovery::form::Form;
use crate::discovery::refine::Refined;
use crate::discovery::shapes::Role;
use crate::discovery::variables::Variable;

/// An amplitude may be so many times what was found.
const AMPLITUDE_REACH: f64 = 20.0;

/// Forms that act together, as one effect, and the values that were found of its coefficients.
pub(crate) struct Defined {
    pub(crate) definition: Definition,
    /// In the order of its coefficients.
    pub(crate) values: Vec<f64>,
}

/// The effect that acts as forms do together.
pub(crate) fn define(id: &str, sentence: String, terms: &[Refined], variables: &[Variable]) -> Defined {
    let mut names = Names { taken: Vec::new() };
    let mut rows: BTreeMap<String, String> = BTreeMap::new();
    let (mut coefficient, mut values) = (Vec::new(), Vec::new());
    for term in terms {
        let form = &term.form;
        let amplitudes: Vec<String> =
            form.channel.amplitude_names().iter().map(|name| names.new_one(name)).collect();
        for (name, value) in amplitudes.iter().zip(&term.amplitudes) {
            let reach = AMPLITUDE_REACH * value.abs();
            coefficient.push(CoefficientDefinition {
                name: name.clone(),
                unit: amplitude_unit(form, variables),
                possible: [-reach, reach],
                typical: value.abs(),
            });
            values.push(*value);
        }
        let mut shapes = String::new();
        for (index, factor) in form.factors.iter().enumerate() {
            let variable = &variables[factor.variable];
            let parameters: Vec<String> =
                factor.shape.family.parameters().iter().map(|(name, _)| names.new_one(name)).collect();
            for (k, name) in parameters.iter().enumerate() {
                let value = form.value((index, k));
                coefficient.push(CoefficientDefinition {
                    name: name.clone(),
                    unit: variable.unit.clone(),
                    possible: form.possible(variables, (index, k)),
                    typical: typical(form, variables, (index, k)),
                });
                values.push(value);
            }
            shapes.push_str(" * ");
            shapes.push_str(&factor.shape.formula(variable.formula, &parameters));
        }
        for row in form.channel.rows() {
            let text = format!("{}{}{shapes}{}", row.before, amplitudes[row.amplitude], row.after);
            rows.entry(row.row.to_owned()).and_modify(|sum| sum.push_str(&joined(&text))).or_insert(text);
        }
    }
    let definition = Definition {
        id: id.to_owned(),
        sentence: Some(sentence),
        excitation: None,
        acceleration: rows,
        confused_with: BTreeMap::new(),
        coefficient,
        constant: constants(terms),
        column: columns(terms, variables),
    };
    Defined { definition, values }
}

/// A further term of a row.
fn joined(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(rest) => format!(" - {rest}"),
        None => format!(" + {text}"),
    }
}

/// Constants of the ways to act, each once.
fn constants(terms: &[Refined]) -> Vec<ConstantDefinition> {
    let mut all: Vec<ConstantDefinition> = Vec::new();
    for (name, unit, value) in terms.iter().flat_map(|term| term.form.channel.constants()) {
        if !all.iter().any(|constant| constant.name == name) {
            all.push(ConstantDefinition { name, unit: unit.into(), value });
        }
    }
    all
}

/// Columns that have to be declared.
fn columns(terms: &[Refined], variables: &[Variable]) -> Vec<ColumnDefinition> {
    let mut all: Vec<ColumnDefinition> = Vec::new();
    for variable in terms.iter().flat_map(|term| term.form.variables()).map(|index| &variables[index]) {
        if variable.declared && !all.iter().any(|column| column.name == variable.name) {
            all.push(ColumnDefinition { name: variable.name.to_owned(), unit: variable.unit.clone() });
        }
    }
    all
}

/// An ordinary magnitude of a parameter: that which was found, or a part of where its quantity goes.
fn typical(form: &Form, variables: &[Variable], parameter: (usize, usize)) -> f64 {
    let value = form.value(parameter).abs();
    match form.role(parameter) {
        Role::Length => value,
        Role::Place => value.max(1e-3 * variables[form.factors[parameter.0].variable].span.length()),
    }
}

/// Names that are not given twice.
struct Names {
    taken: Vec<String>,
}

impl Names {
    fn new_one(&mut self, name: &str) -> String {
        let numbered = (2..).map(|k| format!("{name}_{k}"));
        let free = std::iter::once(name.to_owned()).chain(numbered).find(|name| !self.taken.contains(name));
        let name = free.unwrap_or_else(|| name.to_owned());
        self.taken.push(name.clone());
        name
    }
}

/// Unit of the amplitudes of a form: that of its way to act over those of its shapes.
pub(crate) fn amplitude_unit(form: &Form, variables: &[Variable]) -> String {
    let (mut above, mut below) = (String::from(form.channel.unit()), String::new());
    for factor in &form.factors {
        let (unit, power) = (&variables[factor.variable].unit, factor.shape.family.power());
        if unit == "1" || power == 0 {
            continue;
        }
        let plain = if unit.contains([' ', '/', '^']) { format!("({unit})") } else { unit.clone() };
        let raised = if power.abs() == 1 { plain } else { format!("{plain}^{}", power.abs()) };
        match power > 0 {
            true => below.push_str(&format!("/{raised}")),
            false => above.push_str(&format!(" {raised}")),
        }
    }
    format!("{above}{below}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_not_given_twice() {
        let mut names = Names { taken: Vec::new() };
        let given: Vec<String> =
            ["k", "width", "k", "k"].into_iter().map(|name| names.new_one(name)).collect();
        assert_eq!(given, ["k", "width", "k_2", "k_3"]);
    }

    #[test]
    fn a_term_that_is_taken_away_is_joined_with_its_sign() {
        assert_eq!(joined("-u * k / mass"), " - u * k / mass");
        assert_eq!(joined("k / mass"), " + k / mass");
    }
}
