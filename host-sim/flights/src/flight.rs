//! A flight as recorded: its columns in memory, and as the text of a flight file.

use std::fmt::Write as _;

use crate::columns::{COLUMNS, Column, REQUIRED};

/// A flight as recorded: one vector a column, NaN where a value is missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Flight {
    /// File name, for people and for records.
    pub name: String,
    pub(crate) columns: [Option<Vec<f64>>; COLUMNS.len()],
}

impl Flight {
    /// A flight from columns, for programs that record one.
    ///
    /// # Panics
    /// When the columns differ in length or a required one is missing: a mistake in the program.
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
        assert!(flight.columns[..REQUIRED].iter().all(Option::is_some), "a required column is missing");
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

    /// Puts other values into a column.
    pub fn replace(&mut self, column: Column, values: Vec<f64>) {
        debug_assert_eq!(values.len(), self.len(), "columns differ in length");
        self.columns[column as usize] = Some(values);
    }

    /// A column that every flight has.
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

    /// The text of the flight file. Values are written with the shortest digits that read back to
    /// the same bits.
    pub fn to_csv(&self) -> String {
        let present: Vec<usize> = (0..COLUMNS.len()).filter(|&c| self.columns[c].is_some()).collect();
        let mut text = present.iter().map(|&c| COLUMNS[c]).collect::<Vec<_>>().join(",");
        text.push('\n');
        for row in 0..self.len() {
            for (k, &c) in present.iter().enumerate() {
                if k > 0 {
                    text.push(',');
                }
                let value = self.columns[c].as_ref().map_or(f64::NAN, |values| values[row]);
                if value.is_finite() {
                    let _ = write!(text, "{value}");
                }
            }
            text.push('\n');
        }
        text
    }
}
