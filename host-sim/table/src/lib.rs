//! Tables of columns of several kinds, as Parquet and as comma-separated text.
//!
//! Equal tables give equal bytes, and real numbers come back bit by bit.
#![forbid(unsafe_code)]

use std::fmt::Write as _;
use std::sync::Arc;

pub use parquet::errors::ParquetError;

use parquet::basic::{LogicalType, Repetition, Type as Kind};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{ChunkReader, FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{ColumnPath, Type};

/// Numbers of a column that are made room for before they are read.
const MOST_RESERVED: usize = 1 << 24;

/// The values of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Whole numbers.
    Whole(Vec<i64>),
    /// Real numbers; NaN where there is none.
    Real(Vec<f64>),
    /// Yes or no.
    Flag(Vec<bool>),
    /// Words.
    Text(Vec<String>),
    /// Real numbers, any number of them in a row; shared, as they may be many.
    Lists(Vec<Arc<[f64]>>),
}

/// A column with its name, which ends with the unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Values.
    pub values: Values,
}

/// Columns of one length, and what is said about them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Table {
    /// Columns.
    pub columns: Vec<Column>,
    /// Keys and values.
    pub about: Vec<(String, String)>,
}

impl Values {
    /// How many there are.
    pub const fn len(&self) -> usize {
        match self {
            Self::Whole(values) => values.len(),
            Self::Real(values) => values.len(),
            Self::Flag(values) => values.len(),
            Self::Text(values) => values.len(),
            Self::Lists(values) => values.len(),
        }
    }

    /// Whether there is none.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    const fn kind(&self) -> Kind {
        match self {
            Self::Whole(_) => Kind::INT64,
            Self::Real(_) | Self::Lists(_) => Kind::DOUBLE,
            Self::Flag(_) => Kind::BOOLEAN,
            Self::Text(_) => Kind::BYTE_ARRAY,
        }
    }

    /// Appends the values of a column of the same kind; whether it was.
    fn append(&mut self, other: Self) -> bool {
        match (self, other) {
            (Self::Whole(all), Self::Whole(more)) => all.extend(more),
            (Self::Real(all), Self::Real(more)) => all.extend(more),
            (Self::Flag(all), Self::Flag(more)) => all.extend(more),
            (Self::Text(all), Self::Text(more)) => all.extend(more),
            (Self::Lists(all), Self::Lists(more)) => all.extend(more),
            _ => return false,
        }
        true
    }
}

impl Table {
    /// Adds a column.
    pub fn push(&mut self, name: impl Into<String>, values: Values) {
        self.columns.push(Column { name: name.into(), values });
    }

    /// How many rows there are.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// What is said about it under a key.
    pub fn says(&self, key: &str) -> Option<&str> {
        self.about.iter().find(|(own, _)| own == key).map(|(_, value)| value.as_str())
    }

    /// A column of real numbers by its name.
    pub fn real(&self, name: &str) -> Option<&[f64]> {
        match &self.column(name)?.values {
            Values::Real(values) => Some(values),
            _ => None,
        }
    }

    /// A column of whole numbers by its name.
    pub fn whole(&self, name: &str) -> Option<&[i64]> {
        match &self.column(name)?.values {
            Values::Whole(values) => Some(values),
            _ => None,
        }
    }

    /// A column of words by its name.
    pub fn text(&self, name: &str) -> Option<&[String]> {
        match &self.column(name)?.values {
            Values::Text(values) => Some(values),
            _ => None,
        }
    }

    /// A column of yes and no by its name.
    pub fn flag(&self, name: &str) -> Option<&[bool]> {
        match &self.column(name)?.values {
            Values::Flag(values) => Some(values),
            _ => None,
        }
    }

    /// A column of lists by its name.
    pub fn lists(&self, name: &str) -> Option<&[Arc<[f64]>]> {
        match &self.column(name)?.values {
            Values::Lists(values) => Some(values),
            _ => None,
        }
    }

    fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Puts the rows of another table with the same columns below; whether it had them.
    pub fn append(&mut self, other: Self) -> bool {
        if self.columns.is_empty() {
            self.columns = other.columns;
            return true;
        }
        let same = self.columns.len() == other.columns.len()
            && self.columns.iter().zip(&other.columns).all(|(own, other)| own.name == other.name);
        same && self.columns.iter_mut().zip(other.columns).all(|(own, other)| own.values.append(other.values))
    }

    /// As a Parquet file: equal tables give equal bytes.
    ///
    /// # Errors
    /// What the library refuses.
    pub fn to_parquet(&self) -> Result<Vec<u8>, ParquetError> {
        let field = |column: &Column| {
            let text = matches!(column.values, Values::Text(_)).then_some(LogicalType::String);
            let several = matches!(column.values, Values::Lists(_));
            let repetition = if several { Repetition::REPEATED } else { Repetition::REQUIRED };
            let builder = Type::primitive_type_builder(&column.name, column.values.kind());
            builder.with_repetition(repetition).with_logical_type(text).build().map(Arc::new)
        };
        let fields = self.columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Arc::new(Type::group_type_builder("rows").with_fields(fields).build()?);
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::new(self.properties()))?;
        let mut rows = writer.next_row_group()?;
        let mut columns = self.columns.iter();
        while let (Some(mut into), Some(column)) = (rows.next_column()?, columns.next()) {
            write(&mut into, &column.values)?;
            into.close()?;
        }
        rows.close()?;
        writer.close()?;
        Ok(bytes)
    }

    fn properties(&self) -> WriterProperties {
        let about = self.about.iter().map(|(key, value)| KeyValue::new(key.clone(), value.clone())).collect();
        let mut properties = WriterProperties::builder().set_key_value_metadata(Some(about));
        // Numbers that hardly ever repeat gain nothing from a dictionary.
        for column in self.columns.iter().filter(|column| matches!(column.values, Values::Lists(_))) {
            let path = ColumnPath::from(column.name.as_str());
            properties = properties.set_column_dictionary_enabled(path, false);
        }
        properties.build()
    }

    /// As comma-separated text with a header: numbers with all their digits, nothing for NaN, words in quotes where they need them,
    /// the numbers of a list with spaces between them.
    pub fn to_csv(&self) -> String {
        let names: Vec<String> = self.columns.iter().map(|column| quoted(&column.name)).collect();
        let mut text = names.join(",") + "\n";
        for row in 0..self.rows() {
            for (place, column) in self.columns.iter().enumerate() {
                if place > 0 {
                    text.push(',');
                }
                write_cell(&mut text, &column.values, row);
            }
            text.push('\n');
        }
        text
    }

    /// Reads what [`Self::to_parquet`] wrote.
    ///
    /// # Errors
    /// Bytes that are no such file.
    pub fn from_parquet(bytes: Vec<u8>) -> Result<Self, ParquetError> {
        Self::read(bytes::Bytes::from(bytes))
    }

    /// Reads such a file, a column at a time.
    ///
    /// # Errors
    /// A file that is none.
    pub fn from_file(file: std::fs::File) -> Result<Self, ParquetError> {
        Self::read(file)
    }

    fn read(from: impl ChunkReader + 'static) -> Result<Self, ParquetError> {
        let reader = SerializedFileReader::new(from)?;
        let meta = reader.metadata().file_metadata();
        let keys = meta.key_value_metadata().into_iter().flatten();
        let about = keys.map(|own| (own.key.clone(), own.value.clone().unwrap_or_default())).collect();
        let names: Vec<String> =
            meta.schema_descr().columns().iter().map(|column| column.name().to_owned()).collect();
        let mut all = Self { columns: Vec::new(), about };
        for group in 0..reader.num_row_groups() {
            let rows = reader.get_row_group(group)?;
            let count = usize::try_from(rows.metadata().num_rows())
                .map_err(|_| ParquetError::General("a negative number of rows".into()))?;
            let mut part = Self::default();
            for (place, name) in names.iter().enumerate() {
                let repeated = meta.schema_descr().column(place).max_rep_level() > 0;
                let reader = rows.get_column_reader(place)?;
                // What a damaged file says is no reason to ask for memory.
                let numbers = usize::try_from(rows.metadata().column(place).num_values()).unwrap_or(0);
                let numbers = numbers.min(MOST_RESERVED);
                part.push(
                    name,
                    if repeated { lists(reader, count, numbers)? } else { values(reader, count)? },
                );
            }
            if !all.append(part) {
                return Err(ParquetError::General("row groups of different columns".into()));
            }
        }
        Ok(all)
    }
}

/// Writes the values of a column.
fn write(into: &mut SerializedColumnWriter<'_>, values: &Values) -> Result<(), ParquetError> {
    match values {
        Values::Whole(values) => into.typed::<Int64Type>().write_batch(values, None, None)?,
        Values::Real(values) => into.typed::<DoubleType>().write_batch(values, None, None)?,
        Values::Flag(values) => into.typed::<BoolType>().write_batch(values, None, None)?,
        Values::Text(values) => {
            let values: Vec<ByteArray> = values.iter().map(|text| text.as_str().into()).collect();
            into.typed::<ByteArrayType>().write_batch(&values, None, None)?
        }
        Values::Lists(lists) => {
            let (mut all, mut there, mut goes_on) = (Vec::new(), Vec::new(), Vec::new());
            for list in lists {
                all.extend_from_slice(list);
                // One entry stands for a row even if its list is empty.
                for place in 0..list.len().max(1) {
                    there.push(i16::from(!list.is_empty()));
                    goes_on.push(i16::from(place > 0));
                }
            }
            into.typed::<DoubleType>().write_batch(&all, Some(&there), Some(&goes_on))?
        }
    };
    Ok(())
}

/// A word as a cell of comma-separated text (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn write_cell(text: &mut String, values: &Values, row: usize) {
    // Writing to a string cannot fail.
    let _ = match values {
        Values::Whole(values) => write!(text, "{}", values[row]),
        Values::Real(values) if values[row].is_nan() => Ok(()),
        Values::Real(values) => write!(text, "{}", values[row]),
        Values::Flag(values) => write!(text, "{}", values[row]),
        Values::Text(values) => write!(text, "{}", quoted(&values[row])),
        Values::Lists(values) => {
            let numbers: Vec<String> = values[row].iter().map(f64::to_string).collect();
            write!(text, "{}", numbers.join(" "))
        }
    };
}

/// The lists of a column of a row group; room is made for so many numbers in all.
fn lists(reader: ColumnReader, count: usize, numbers: usize) -> Result<Values, ParquetError> {
    let ColumnReader::DoubleColumnReader(mut reader) = reader else {
        return Err(ParquetError::General("a list of a kind that no table of quadlab has".into()));
    };
    let mut all = Vec::with_capacity(numbers);
    let (mut there, mut goes_on) = (Vec::with_capacity(numbers), Vec::with_capacity(numbers));
    reader.read_records(count, Some(&mut there), Some(&mut goes_on), &mut all)?;
    let ends_early = || ParquetError::General("a column ends early".into());
    let mut lists: Vec<Arc<[f64]>> = Vec::with_capacity(count);
    let (mut rest, mut entries) = (&all[..], there.iter().zip(&goes_on).peekable());
    while let Some((first, _)) = entries.next() {
        let mut length = usize::from(*first > 0);
        while entries.next_if(|(_, goes_on)| **goes_on > 0).is_some() {
            length += 1;
        }
        let (own, others) = rest.split_at_checked(length).ok_or_else(ends_early)?;
        lists.push(own.into());
        rest = others;
    }
    if lists.len() != count {
        return Err(ends_early());
    }
    Ok(Values::Lists(lists))
}

/// The values of a column of a row group.
fn values(reader: ColumnReader, count: usize) -> Result<Values, ParquetError> {
    let read = match reader {
        ColumnReader::Int64ColumnReader(mut reader) => {
            let mut all = Vec::with_capacity(count);
            reader.read_records(count, None, None, &mut all)?;
            Values::Whole(all)
        }
        ColumnReader::DoubleColumnReader(mut reader) => {
            let mut all = Vec::with_capacity(count);
            reader.read_records(count, None, None, &mut all)?;
            Values::Real(all)
        }
        ColumnReader::BoolColumnReader(mut reader) => {
            let mut all = Vec::with_capacity(count);
            reader.read_records(count, None, None, &mut all)?;
            Values::Flag(all)
        }
        ColumnReader::ByteArrayColumnReader(mut reader) => {
            let mut all: Vec<ByteArray> = Vec::with_capacity(count);
            reader.read_records(count, None, None, &mut all)?;
            let texts = all.iter().map(|bytes| bytes.as_utf8().map(str::to_owned));
            Values::Text(texts.collect::<Result<_, _>>()?)
        }
        _ => return Err(ParquetError::General("a column of a kind that no table of quadlab has".into())),
    };
    if read.len() != count {
        return Err(ParquetError::General("a column ends early".into()));
    }
    Ok(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table { about: vec![("campaign".into(), "7".into())], ..Table::default() };
        table.push("case", Values::Whole((0..500).collect()));
        table.push(
            "wind_m_s",
            Values::Real((0..500).map(|k| if k == 3 { f64::NAN } else { 0.1 * f64::from(k) }).collect()),
        );
        table.push("lost", Values::Flag((0..500).map(|k| k % 7 == 0).collect()));
        table.push("why", Values::Text((0..500).map(|k| format!("reason {}", k % 3)).collect()));
        table.push(
            "triangle",
            Values::Lists((0..500).map(|k| vec![f64::from(k) / 3.0; (k % 4) as usize].into()).collect()),
        );
        table
    }

    #[test]
    fn a_table_is_read_back_and_equal_ones_give_equal_bytes() {
        let bytes = table().to_parquet().unwrap();
        assert_eq!(bytes, table().to_parquet().unwrap());
        let back = Table::from_parquet(bytes).unwrap();
        assert_eq!((back.whole("case"), back.flag("lost")), (table().whole("case"), table().flag("lost")));
        assert_eq!((back.text("why"), back.says("campaign")), (table().text("why"), Some("7")));
        assert_eq!(back.lists("triangle"), table().lists("triangle"));
        let bits = |table: &Table| -> Vec<u64> {
            table.real("wind_m_s").unwrap().iter().map(|v| v.to_bits()).collect()
        };
        assert_eq!(bits(&back), bits(&table()));
    }

    #[test]
    fn only_tables_of_the_same_columns_are_joined() {
        let mut all = table();
        assert!(all.append(table()) && all.rows() == 1000);
        let mut other = Table::default();
        other.push("case", Values::Real(vec![0.0]));
        assert!(!all.append(other));
    }

    #[test]
    fn text_has_a_name_for_each_column_and_a_line_for_each_row() {
        let mut table = Table::default();
        table.push("t_s", Values::Real(vec![0.03, f64::NAN, -1e-300]));
        table.push("why, or why not", Values::Text(vec!["a".into(), "b \"c\"".into(), "d,e".into()]));
        table.push("r", Values::Lists(vec![[1.5, -2.0].into(), [].into(), [0.1].into()]));
        let csv = table.to_csv();
        let lines: Vec<&str> = csv.lines().collect();
        assert_eq!(lines[0], "t_s,\"why, or why not\",r");
        assert_eq!(lines[1..3], ["0.03,a,1.5 -2", ",\"b \"\"c\"\"\","]);
        assert_eq!(lines[3].split(',').next().unwrap().parse::<f64>().unwrap(), -1e-300);
        assert_eq!(lines.len(), 4);
    }
}
