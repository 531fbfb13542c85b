//! Parquet tables: one table `rows` with a column for each column of numbers, truth values (0, 1) or
//! times.
//!
//! A time column stays a column; its unit, where the schema has one, is in the log's information as
//! `unit of NAME`. Integers with missing values become floating-point numbers. Text and lists are left
//! out.

mod pages;
mod values;

use std::path::Path;

use bytes::Bytes;
use parquet::basic::{LogicalType, TimeUnit as ParquetUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::file::metadata::{KeyValue, RowGroupMetaData};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::common::budget::Budget;
use super::common::faults::{Faults, guarded};
use crate::error::LogError;
use crate::format::Format;
use crate::log::{Column, Log, Table, TimeUnit, Values};
use values::Numbers;

/// Rows that are read at once.
const BATCH: usize = 65_536;

pub(crate) fn decode(bytes: Bytes, path: &Path) -> Result<Log, LogError> {
    let refuse =
        |what: String| LogError::Format { path: path.into(), what, mend: "write or copy it again".into() };
    if bytes.len() < 12 || !bytes.ends_with(b"PAR1") {
        return Err(refuse("is a Parquet file without its end, which says what is in it".into()));
    }
    let mut faults = Faults::default();
    let opened = guarded(|| SerializedFileReader::new(bytes.clone()));
    let reader = match opened {
        Some(Ok(reader)) => reader,
        Some(Err(error)) => {
            let why: String = error.to_string().chars().filter(|c| !c.is_control()).take(120).collect();
            return Err(refuse(format!("is a damaged Parquet file: {why}")));
        }
        None => return Err(refuse("is a damaged Parquet file".into())),
    };
    let mut budgets =
        Budgets { pages: Budget::for_decompression(bytes.len()), columns: Budget::for_columns(bytes.len()) };
    let log = File { bytes: &bytes, reader }.read(&mut budgets, &mut faults);
    let mut log = log.ok_or_else(|| refuse("is a damaged Parquet file".into()))?;
    log.losses.damage = faults.into_sentences();
    Ok(log)
}

struct File<'a> {
    bytes: &'a [u8],
    reader: SerializedFileReader<Bytes>,
}

struct Budgets {
    pages: Budget,
    columns: Budget,
}

impl File<'_> {
    fn read(&self, budgets: &mut Budgets, faults: &mut Faults) -> Option<Log> {
        let mut log = Log::new(Format::Parquet);
        let metadata = self.reader.metadata();
        let schema = metadata.file_metadata().schema_descr();
        let kinds: Vec<(usize, Values)> = (0..schema.num_columns())
            .filter_map(|number| Some((number, guarded(|| kind(&schema.column(number)))??)))
            .collect();
        let mut table = Table {
            name: "rows".into(),
            message_type: None,
            time_unit: TimeUnit::Nanoseconds,
            times: Vec::new(),
            rows: 0,
            columns: Vec::new(),
        };
        for (number, values) in &kinds {
            let descriptor = schema.column(*number);
            let name = descriptor.path().string();
            if let Some(unit) = unit(&descriptor) {
                log.information.insert(format!("unit of {name}"), unit.into());
            }
            table.columns.push(Column { name, values: values.clone() });
        }
        for (group_number, group) in metadata.row_groups().iter().enumerate() {
            let mut damaged = Vec::new();
            let mut rows = 0;
            for ((number, kind), column) in kinds.iter().zip(&mut table.columns) {
                let before = column.values.len();
                let unsigned = matches!(kind, Values::U32(_));
                let place = (group_number, *number, unsigned);
                if self.read_column(group, place, &mut column.values, budgets).is_none() {
                    damaged.push(column.name.clone());
                }
                values::narrow(&mut column.values);
                rows = rows.max(column.values.len() - before);
            }
            table.rows += rows;
            for column in &mut table.columns {
                let missing = table.rows - column.values.len();
                if missing > 0 {
                    // Numbers so far may have to become wider to have a NaN.
                    budgets.columns.take((table.rows).saturating_mul(8)).then_some(())?;
                    values::pad(&mut column.values, missing);
                }
            }
            if !damaged.is_empty() {
                faults.say(format!("row group {group_number} is damaged in {}", damaged.join(", ")));
            }
        }
        for pair in metadata.file_metadata().key_value_metadata().into_iter().flatten() {
            information(pair, &mut log);
        }
        log.tables.push(table);
        Some(log)
    }

    /// Adds the rows of a group to a column; nothing where it is damaged, behind the rows before the
    /// damage.
    fn read_column(
        &self,
        group: &RowGroupMetaData,
        (group_number, number, unsigned): (usize, usize, bool),
        values: &mut Values,
        budgets: &mut Budgets,
    ) -> Option<()> {
        let (start, length) = guarded(|| group.column(number).byte_range())?;
        let (start, length) = (usize::try_from(start).ok()?, usize::try_from(length).ok()?);
        let chunk = self.bytes.get(start..start.checked_add(length)?)?;
        pages::check(chunk, &mut budgets.pages)?;
        let rows = usize::try_from(group.num_rows()).ok()?;
        let (reader, columns) = (&self.reader, &mut budgets.columns);
        guarded(|| match reader.get_row_group(group_number).ok()?.get_column_reader(number).ok()? {
            ColumnReader::BoolColumnReader(reader) => add(reader, rows, columns, values, Numbers::Bool),
            ColumnReader::Int32ColumnReader(reader) if unsigned => {
                add(reader, rows, columns, values, |bits| {
                    Numbers::I64(bits.into_iter().map(|bits| bits.cast_unsigned().into()).collect())
                })
            }
            ColumnReader::Int32ColumnReader(reader) => add(reader, rows, columns, values, Numbers::I32),
            ColumnReader::Int64ColumnReader(reader) => add(reader, rows, columns, values, Numbers::I64),
            ColumnReader::FloatColumnReader(reader) => add(reader, rows, columns, values, Numbers::F32),
            ColumnReader::DoubleColumnReader(reader) => add(reader, rows, columns, values, Numbers::F64),
            ColumnReader::Int96ColumnReader(reader) => add(reader, rows, columns, values, |days| {
                Numbers::I64(days.iter().map(parquet::data_type::Int96::to_nanos).collect())
            }),
            ColumnReader::ByteArrayColumnReader(_) | ColumnReader::FixedLenByteArrayColumnReader(_) => None,
        })?
    }
}

/// Reads so many rows of a column in batches.
fn add<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
    budget: &mut Budget,
    values: &mut Values,
    numbers: impl Fn(Vec<T::T>) -> Numbers,
) -> Option<()> {
    let mut left = rows;
    while left > 0 {
        let (mut batch, mut levels) = (Vec::new(), Vec::new());
        let (read, ..) = reader.read_records(left.min(BATCH), Some(&mut levels), None, &mut batch).ok()?;
        // Twice: the numbers so far may become wider when the first is missing.
        if read == 0 || !budget.take(read * 16) {
            return None;
        }
        values::reserve(values, read);
        let most = levels.iter().copied().max().filter(|_| batch.len() < levels.len());
        let present = most.map(|_| {
            // A value is there at the highest level; if none is, no level is high enough.
            let highest = if batch.is_empty() { i16::MAX } else { most.unwrap_or(0) };
            levels.iter().map(|&level| level == highest).collect::<Vec<bool>>()
        });
        values::append(values, &numbers(batch), present.as_deref())?;
        left -= read;
    }
    Some(())
}

/// Values of the type of a column; none if it holds no numbers, or several a row.
fn kind(column: &ColumnDescriptor) -> Option<Values> {
    if column.max_rep_level() > 0 {
        return None;
    }
    let logical = column.logical_type_ref();
    if matches!(logical, Some(LogicalType::Decimal { .. })) {
        return None;
    }
    let integer = match logical {
        Some(LogicalType::Integer(integer)) => Some((integer.bit_width, integer.is_signed)),
        _ => None,
    };
    Some(match (column.physical_type(), integer) {
        (Type::BOOLEAN, _) => Values::U8(Vec::new()),
        (Type::INT32, Some((8, true))) => Values::I8(Vec::new()),
        (Type::INT32, Some((8, false))) => Values::U8(Vec::new()),
        (Type::INT32, Some((16, true))) => Values::I16(Vec::new()),
        (Type::INT32, Some((16, false))) => Values::U16(Vec::new()),
        (Type::INT32, Some((32, false))) => Values::U32(Vec::new()),
        (Type::INT32, _) => Values::I32(Vec::new()),
        (Type::INT64, Some((_, false))) => Values::U64(Vec::new()),
        (Type::INT64 | Type::INT96, _) => Values::I64(Vec::new()),
        (Type::FLOAT, _) => Values::F32(Vec::new()),
        (Type::DOUBLE, _) => Values::F64(Vec::new()),
        (Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY, _) => return None,
    })
}

/// Unit of a column of times.
fn unit(column: &ColumnDescriptor) -> Option<&'static str> {
    let unit = match (column.logical_type_ref(), column.physical_type()) {
        (Some(LogicalType::Timestamp(time)), _) => time.unit,
        (Some(LogicalType::Time(time)), _) => time.unit,
        (_, Type::INT96) => ParquetUnit::NANOS,
        _ => return None,
    };
    Some(match unit {
        ParquetUnit::MILLIS => "ms",
        ParquetUnit::MICROS => "us",
        ParquetUnit::NANOS => "ns",
    })
}

/// Keeps what the writer said of the file, but for long texts that describe the schema once more.
fn information(pair: &KeyValue, log: &mut Log) {
    const LONGEST: usize = 1000;
    if let Some(value) = pair.value.as_ref().filter(|value| value.len() < LONGEST && pair.key.len() < LONGEST)
    {
        log.information.insert(pair.key.clone(), value.clone());
    }
}
