//! Samples as a file: text, and Parquet for programs that read it faster and without rounding.

use std::fmt::Write as _;
use std::sync::Arc;

use parquet::basic::{Repetition, Type as Kind};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::refused::Refused;

/// Columns of one length, with their names. Names end with the unit.
#[derive(Debug, Default)]
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) columns: Vec<Vec<f64>>,
}

impl Table {
    pub(super) fn push(&mut self, name: impl Into<String>, column: Vec<f64>) {
        self.names.push(name.into());
        self.columns.push(column);
    }

    /// Comma-separated text with a header.
    pub(super) fn to_csv(&self) -> String {
        let mut text = format!("{}\n", self.names.join(","));
        let rows = self.columns.first().map_or(0, Vec::len);
        for row in 0..rows {
            for (place, column) in self.columns.iter().enumerate() {
                let comma = if place > 0 { "," } else { "" };
                let _ = write!(text, "{comma}{}", column[row]);
            }
            text.push('\n');
        }
        text
    }

    /// A Parquet file; `about` goes into it as key and value.
    pub(super) fn to_parquet(&self, about: &[(&str, String)]) -> Result<Vec<u8>, Refused> {
        self.parquet(about).map_err(|error| Refused::new(format!("the Parquet file cannot be made: {error}")))
    }

    fn parquet(&self, about: &[(&str, String)]) -> Result<Vec<u8>, ParquetError> {
        let field = |name: &String| {
            let number = Type::primitive_type_builder(name, Kind::DOUBLE);
            number.with_repetition(Repetition::REQUIRED).build().map(Arc::new)
        };
        let fields = self.names.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Arc::new(Type::group_type_builder("samples").with_fields(fields).build()?);
        let about =
            about.iter().map(|(key, value)| KeyValue::new((*key).to_owned(), value.clone())).collect();
        let properties = WriterProperties::builder().set_key_value_metadata(Some(about)).build();
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
        let mut rows = writer.next_row_group()?;
        let mut columns = self.columns.iter();
        while let (Some(mut into), Some(values)) = (rows.next_column()?, columns.next()) {
            into.typed::<DoubleType>().write_batch(values, None, None)?;
            into.close()?;
        }
        rows.close()?;
        writer.close()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn table() -> Table {
        let mut table = Table::default();
        table.push("t_s", (0..1000).map(|k| f64::from(k) * 0.01).collect());
        table.push("u_measured_m_s2", (0..1000).map(|k| (f64::from(k) * 0.1).sin() / 3.0).collect());
        table.push("u_residual_m_s2", (0..1000).map(|k| if k == 7 { f64::NAN } else { -1e-300 }).collect());
        table
    }

    /// Our own reader of logs finds the names and the very numbers.
    #[test]
    fn a_parquet_file_is_read_back_bit_by_bit() {
        let table = table();
        let bytes = table.to_parquet(&[("model", "2".into())]).unwrap();
        let log = logs::decode(&bytes, Path::new("samples.parquet")).unwrap();
        let [rows] = &log.tables[..] else { panic!("{} tables", log.tables.len()) };
        assert_eq!((rows.rows, rows.columns.len()), (1000, 3));
        for ((name, column), read) in table.names.iter().zip(&table.columns).zip(&rows.columns) {
            assert_eq!(name, &read.name);
            let same = column.iter().zip(read.values.to_f64()).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same, "{name}");
        }
    }

    #[test]
    fn text_has_a_name_for_each_column_and_a_line_for_each_sample() {
        let text = table().to_csv();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("t_s,u_measured_m_s2,u_residual_m_s2"));
        let row: Vec<f64> = lines.nth(3).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(row, [0.03, (3.0 * 0.1_f64).sin() / 3.0, -1e-300]);
        assert_eq!(lines.count(), 996);
    }
}
