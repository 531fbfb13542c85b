//! A flight as recorded: its columns in memory, and as the text of a flight file.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::columns::{COLUMNS, Column};
use crate::stand_in::StandIn;

/// A flight as recorded: one vector a column, NaN where a value is missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flight {
    /// File name, for people and for records.
    pub name: String,
    pub(crate) columns: [Option<Vec<f64>>; COLUMNS.len()],
    /// Columns of other names, for formulas of users.
    pub(crate) further: BTreeMap<String, Vec<f64>>,
    /// What was not logged.
    pub(crate) stand_ins: Vec<StandIn>,
}

impl Flight {
    /// A flight from columns, for programs that record one.
    ///
    /// # Panics
    /// When the columns differ in length: a mistake in the program.
    pub fn from_columns(
        name: impl Into<String>,
        columns: impl IntoIterator<Item = (Column, Vec<f64>)>,
    ) -> Self {
        let mut flight = Self { name: name.into(), ..Self::default() };
        for (column, values) in columns {
            flight.columns[column as usize] = Some(values);
        }
        let rows = flight.len();
        assert!(flight.columns.iter().flatten().all(|c| c.len() == rows), "columns differ in length");
        flight
    }

    /// Samples.
    pub fn len(&self) -> usize {
        self.columns[0].as_ref().map_or(0, Vec::len)
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A column, if the log has it.
    pub fn column(&self, column: Column) -> Option<&[f64]> {
        self.columns[column as usize].as_deref()
    }

    /// A column of another name, if it was read.
    pub fn further(&self, name: &str) -> Option<&[f64]> {
        self.further.get(name).map(Vec::as_slice)
    }

    /// The flight with a further column, which formulas can name.
    ///
    /// # Panics
    /// When it is not as long as the others or has the name of one of them: a mistake in the program.
    #[must_use]
    pub fn with_further(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        let name = name.into();
        assert!(values.len() == self.len() && !COLUMNS.contains(&name.as_str()), "{name}: no further column");
        self.further.insert(name, values);
        self
    }

    /// Puts other values into a column.
    pub fn replace(&mut self, column: Column, values: Vec<f64>) {
        debug_assert_eq!(values.len(), self.len(), "columns differ in length");
        self.columns[column as usize] = Some(values);
    }

    /// The flight with some of its rows only.
    pub fn with_rows(&self, keep: &[bool]) -> Self {
        let kept = |values: &Vec<f64>| -> Vec<f64> {
            values.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
        };
        Self {
            name: self.name.clone(),
            columns: self.columns.each_ref().map(|c| c.as_ref().map(kept)),
            further: self.further.iter().map(|(name, values)| (name.clone(), kept(values))).collect(),
            stand_ins: self.stand_ins.clone(),
        }
    }

    /// A column that every flight has, once it is complete.
    pub fn required(&self, column: Column) -> &[f64] {
        self.column(column).unwrap_or(&[])
    }

    /// Three columns, if the log has all of them with values.
    pub fn group<const N: usize>(&self, columns: [Column; N]) -> Option<[&[f64]; N]> {
        let mut found = [[].as_slice(); N];
        for (slot, column) in found.iter_mut().zip(columns) {
            *slot = self.column(column).filter(|values| values.iter().any(|v| v.is_finite()))?;
        }
        Some(found)
    }

    /// Names of the columns that were logged, in the order they are written.
    pub fn logged_columns(&self) -> impl Iterator<Item = &str> {
        self.logged().map(|column| COLUMNS[column]).chain(self.further.keys().map(String::as_str))
    }

    /// The columns that were logged, by name, in the order they are written.
    pub fn into_logged_columns(mut self) -> impl Iterator<Item = (String, Vec<f64>)> {
        let logged: Vec<usize> = self.logged().collect();
        let further = std::mem::take(&mut self.further);
        let own = logged
            .into_iter()
            .filter_map(move |column| Some((COLUMNS[column].to_owned(), self.columns[column].take()?)));
        own.chain(further)
    }

    fn logged(&self) -> impl Iterator<Item = usize> {
        let stands_in = |c: usize| {
            self.stand_ins.iter().flat_map(|what| what.columns()).any(|column| *column as usize == c)
        };
        (0..COLUMNS.len()).filter(move |c| self.columns[*c].is_some() && !stands_in(*c))
    }

    /// The text of the flight file: what was logged. Values are written with the shortest digits that read back to
    /// the same bits.
    pub fn to_csv(&self) -> String {
        let own = self.logged().filter_map(|column| self.columns[column].as_ref());
        let present: Vec<&Vec<f64>> = own.chain(self.further.values()).collect();
        let mut text = self.logged_columns().collect::<Vec<_>>().join(",");
        text.push('\n');
        for row in 0..self.len() {
            for (k, values) in present.iter().enumerate() {
                if k > 0 {
                    text.push(',');
                }
                let value = values[row];
                if value.is_finite() {
                    let _ = write!(text, "{value}");
                }
            }
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// A craft at rest, with these values of x.
    fn resting(x: Vec<f64>) -> Flight {
        use Column::*;
        let others = [Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
        let others = others.map(|column| (column, vec![0.25; x.len()]));
        let t = (0..x.len()).map(|k| 0.01 * k as f64).collect();
        Flight::from_columns("resting", [(T, t), (X, x)].into_iter().chain(others))
    }

    /// The shortest digits are enough also where decimal fractions have no end.
    #[test]
    fn values_are_written_with_all_their_bits() {
        let x = vec![0.1 + 0.2, 1.0 / 3.0, -2.5e-300, 1e-17, 0.0, f64::MIN_POSITIVE, 1.0 + f64::EPSILON];
        let again = Flight::parse(resting(x.clone()).to_csv().as_bytes(), Path::new("resting")).unwrap();
        let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(again.required(Column::X)), bits(&x));
    }

    #[test]
    fn a_missing_value_is_written_as_an_empty_field() {
        let text = resting(vec![1.0, f64::NAN, 2.0]).to_csv();
        let row: Vec<&str> = text.lines().nth(2).unwrap().split(',').collect();
        assert_eq!(row[..3], ["0.01", "", "0.25"]);
    }

    #[test]
    fn rows_that_are_left_out_are_gone_from_every_column() {
        let some = resting(vec![1.0, 2.0, 3.0, 4.0]).with_rows(&[false, true, false, true]);
        assert_eq!(
            (some.required(Column::X), some.required(Column::T)),
            (&[2.0, 4.0][..], &[0.01, 0.03][..])
        );
        assert_eq!((some.len(), some.column(Column::Vx)), (2, None));
    }

    #[test]
    fn a_group_needs_values_in_each_of_its_columns() {
        let mut flight = resting(vec![1.0, 2.0]);
        assert!(flight.group([Column::X, Column::Vx]).is_none(), "there is no vx");
        flight.replace(Column::Vx, vec![f64::NAN, f64::NAN]);
        assert!(flight.group([Column::X, Column::Vx]).is_none(), "vx has no value");
        flight.replace(Column::Vx, vec![f64::NAN, 0.5]);
        let [x, vx] = flight.group([Column::X, Column::Vx]).unwrap();
        assert_eq!((x, vx[1]), (&[1.0, 2.0][..], 0.5));
    }

    #[test]
    #[should_panic(expected = "columns differ in length")]
    fn columns_of_different_lengths_are_a_mistake_of_the_program() {
        let columns = [(Column::T, vec![0.0, 0.01]), (Column::X, vec![1.0])];
        let _ = Flight::from_columns("uneven", columns);
    }
}
