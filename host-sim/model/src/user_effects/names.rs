//! What the names in the formulas of one effect mean, and how its coefficients enter them.

use crate::lags::{Followed, LAG_TIMES_S, Lag};
use crate::quantity::QUANTITIES;
use crate::sample::MAX_FURTHER;
use crate::user_effects::columns::{USUAL_COLUMNS, placed, usual_unit};
use crate::user_effects::definition::{Definition, MAX_NAME};
use crate::user_effects::dimension::Dimension;
use crate::user_effects::formula::{Formula, dimension_of};
use crate::user_effects::input::Input;
use crate::user_effects::row::{MAX_NAMES, Row, RowFormula, rows_known};
use crate::user_effects::scanner::{INTEGRAL, LAG};
use crate::user_effects::trace::{Entry, Trace};

/// What formulas of one effect can name.
pub(super) struct Names<'a> {
    pub(super) definition: &'a Definition,
    pub(super) coefficients: &'a [Dimension],
    pub(super) constants: &'a [Dimension],
    pub(super) columns: &'a [Dimension],
}

impl Names<'_> {
    pub(super) fn formula(&self, row: &str, text: &str) -> Result<RowFormula, String> {
        let row = Row::parse(row).ok_or_else(|| format!("unknown row; rows are {}", rows_known()))?;
        let formula = Formula::parse(text)?;
        if formula.names().len() > MAX_NAMES {
            return Err(format!(
                "has {} different names, at most {MAX_NAMES} are possible",
                formula.names().len()
            ));
        }
        let inputs = formula.names().iter().map(|name| self.input(name)).collect::<Result<Vec<_>, _>>()?;
        if !inputs.iter().any(|input| matches!(input, Input::Coefficient(_))) {
            return Err("names none of the effect's coefficients: there is nothing to identify".into());
        }
        let trace = formula.trace(|name| self.trace(name, &|_| Entry::Free))?;
        let expected = dimension_of(row.unit())?;
        if !trace.dimension.is(expected) {
            return Err(format!("has the unit {}, the row needs {}", trace.dimension, row.unit()));
        }
        Ok(RowFormula::new(row, formula, inputs))
    }

    fn input(&self, name: &str) -> Result<Input, String> {
        let Definition { coefficient, constant, column, .. } = self.definition;
        if let Some(k) = coefficient.iter().position(|c| c.name == name) {
            return Ok(Input::Coefficient(k));
        }
        if let Some(constant) = constant.iter().find(|c| c.name == name) {
            return Ok(Input::Constant(constant.value));
        }
        if let Some(quantity) = QUANTITIES.iter().find(|q| q.name == name) {
            return Ok(Input::Quantity(quantity));
        }
        if column.iter().any(|c| c.name == name) || usual_unit(name).is_some() {
            let too_many = || format!("more than {MAX_FURTHER} different columns of flight files");
            return placed(name).map(Input::Further).ok_or_else(too_many);
        }
        if let Some(looked_back) = looked_back(name) {
            return self.lagged(looked_back?);
        }
        let own = coefficient.iter().map(|c| c.name.as_str()).chain(constant.iter().map(|c| c.name.as_str()));
        let columns =
            column.iter().map(|c| c.name.as_str()).chain(USUAL_COLUMNS.iter().map(|(name, _)| *name));
        let known: Vec<&str> = own.chain(QUANTITIES.iter().map(|q| q.name)).chain(columns).collect();
        let short: String = name.chars().take(MAX_NAME).collect();
        Err(format!(
            "unknown name \"{short}\"; known are {}; a column of the flights is declared with its unit: column = [{{ name = \
             \"{short}\", unit = \"N\" }}]",
            known.join(", ")
        ))
    }

    /// `lag(of, time)` or `integral(of)`.
    fn lagged(&self, (of, time): LookedBack<'_>) -> Result<Input, String> {
        let of = match self.input(of)? {
            Input::Quantity(quantity) => Followed::Quantity(quantity),
            Input::Further(column) => Followed::Further(column.place),
            Input::Lagged(lag) => Followed::Lag(lag),
            Input::Coefficient(_) | Input::Constant(_) => {
                let function = if time.is_some() { LAG } else { INTEGRAL };
                return Err(format!(
                    "\"{of}\" does not change: {function}(...) takes a measured quantity first"
                ));
            }
        };
        let time_s = time.map(|time| self.lag_time_s(time)).transpose()?;
        let too_many = || "there are too many different lags in this program".to_owned();
        Lag { of, time_s }.id().map(Input::Lagged).ok_or_else(too_many)
    }

    fn lag_time_s(&self, name: &str) -> Result<f64, String> {
        let own = self.definition.constant.iter().position(|constant| constant.name == name);
        let (Some(k), Ok(second)) = (own, dimension_of("s")) else {
            return Err(format!(
                "\"{name}\" is no constant of the effect; the time of a lag is one: constant = [{{ name = \"memory\", unit = \"s\", \
                 value = 0.3 }}]"
            ));
        };
        let time_s = self.definition.constant[k].value;
        let [shortest, longest] = LAG_TIMES_S;
        if !self.constants[k].is(second) || !(shortest..=longest).contains(&time_s) {
            return Err(format!("\"{name}\" is the time of a lag: {shortest} to {longest} s"));
        }
        Ok(time_s)
    }

    fn trace(&self, name: &str, entry: &dyn Fn(usize) -> Entry) -> Trace {
        if let Some(Ok((of, time))) = looked_back(name) {
            let of = self.trace(of, entry);
            let second = dimension_of("s").unwrap_or(Dimension::NONE);
            let dimension = if time.is_some() { of.dimension } else { of.dimension.times(second) };
            return Trace { dimension, value: None, ..of };
        }
        let Definition { coefficient, constant, column, .. } = self.definition;
        if let Some(k) = coefficient.iter().position(|c| c.name == name) {
            return Trace { dimension: self.coefficients[k], entry: entry(k), value: None };
        }
        if let Some(k) = constant.iter().position(|c| c.name == name) {
            return Trace {
                dimension: self.constants[k],
                entry: Entry::Free,
                value: Some(constant[k].value),
            };
        }
        if let Some(k) = column.iter().position(|c| c.name == name) {
            return Trace { dimension: self.columns[k], entry: Entry::Free, value: None };
        }
        let quantity = QUANTITIES.iter().find(|q| q.name == name).map(|q| q.unit);
        let unit = quantity.or_else(|| usual_unit(name)).unwrap_or("1");
        let dimension = dimension_of(unit).unwrap_or(Dimension::NONE);
        Trace { dimension, entry: Entry::Free, value: None }
    }

    /// Whether all coefficients enter linearly, and which have to be given so that the rest does: those that do not by
    /// themselves, then, where coefficients multiply each other, one after the other until they no longer do.
    pub(super) fn shapes(&self, formulas: &[RowFormula]) -> (bool, Vec<bool>) {
        let enter = |given: &[bool], ways: &[Entry]| {
            formulas.iter().all(|f| {
                let entry = |k: usize| if given[k] { Entry::Free } else { Entry::Linear };
                f.formula.trace(|name| self.trace(name, &entry)).is_ok_and(|t| ways.contains(&t.entry))
            })
        };
        let at_most_linearly = [Entry::Free, Entry::Linear, Entry::Affine];
        let count = self.coefficients.len();
        let alone = |k: usize| (0..count).map(|other| other != k).collect::<Vec<bool>>();
        let mut given: Vec<bool> = (0..count).map(|k| !enter(&alone(k), &at_most_linearly)).collect();
        for k in (0..count).rev() {
            if enter(&given, &at_most_linearly) {
                break;
            }
            given[k] = true;
        }
        (enter(&vec![false; count], &[Entry::Linear]), given)
    }
}

/// Deepest nesting of what looks back.
const MAX_ORDER: usize = 2;

/// What is looked back at, and the name of the time of a lag: nothing of an integral.
type LookedBack<'a> = (&'a str, Option<&'a str>);

/// What a name of the form `lag(of, time)` or `integral(of)` looks back at; nothing of other names.
fn looked_back(name: &str) -> Option<Result<LookedBack<'_>, String>> {
    let inside = |function| name.strip_prefix(function)?.strip_prefix('(')?.strip_suffix(')');
    let (inside, is_lag) = inside(LAG).map(|own| (own, true)).or_else(|| Some((inside(INTEGRAL)?, false)))?;
    if inside.matches('(').count() >= MAX_ORDER {
        return Some(Err(format!("lags are nested deeper than {MAX_ORDER}")));
    }
    if !is_lag {
        let comma_outside = !inside.ends_with(')') && inside.contains(',');
        let missing = || "integral(...) takes a quantity, such as integral(power)".to_owned();
        return Some(if inside.is_empty() || comma_outside { Err(missing()) } else { Ok((inside, None)) });
    }
    let missing = || "lag(...) takes a quantity and a constant, such as lag(w, memory)".to_owned();
    let parts = inside.rsplit_once(',').filter(|(of, _)| !of.is_empty());
    Some(parts.map(|(of, time)| (of, Some(time))).ok_or_else(missing))
}
