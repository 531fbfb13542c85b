//! Parquet: what pyarrow finds in it.

use std::path::Path;
use std::sync::Arc;

use crate::common::flight::{Reference, smoothed_agrees};
use crate::common::mutations::survives;
use crate::common::{expected, expected_sum, recorded, shared};
use logs::{Format, Values, decode};
use parquet::basic::Compression;
use parquet::data_type::{BoolType, DoubleType, Int32Type, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

#[test]
fn columns_hold_what_pyarrow_finds() {
    let Some((log, expected)) = expected("crazyflie_log203.parquet") else { return };
    assert_eq!(log.format, Format::Parquet);
    assert_eq!(log.losses.damage, Vec::<String>::new());
    let table = log.table("rows").unwrap();
    assert_eq!(table.rows as u64, expected["rows"].as_u64().unwrap());
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    let told: Vec<&str> =
        expected["columns"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(names, told);
    for (name, sum) in expected["sums"].as_object().unwrap() {
        expected_sum(table, name, sum.as_f64().unwrap(), 10);
    }
}

/// Names and units are the firmware's, its slow clock too.
#[test]
fn log203_is_its_flight() {
    let Some((log, _)) = expected("crazyflie_log203.parquet") else { return };
    let Some(path) = shared("data/crazyswarm2/log203.csv") else { return };
    let recording = recorded(&log, Path::new("log203")).unwrap();
    assert!(recording.notes[0].contains("85/84"), "{:?}", recording.notes);
    smoothed_agrees(&recording, &Reference::read(&path));
}

/// What an import takes beside the bytes of the file: its columns unpacked, and the quantities made of them.
#[test]
fn memory_of_an_import() {
    let Some(path) = shared("data/logs/crazyflie_log203.parquet") else { return };
    let file = std::fs::metadata(&path).unwrap().len();
    let with_file =
        allocation_counter::measure(|| _ = logs::import(&path, &flights::ColumnMap::default())).bytes_max;
    println!("{file} bytes: importing takes {with_file} with them");
    assert!(with_file < 3 * file, "{with_file} bytes for {file}");
}

#[test]
fn damaged_files_do_no_harm() {
    let Some(path) = shared("data/logs/crazyflie_log203.parquet") else { return };
    survives("log203.parquet", &std::fs::read(path).unwrap(), 1500);
}

/// Two groups of 100 rows; every third `count` is missing.
pub(crate) fn made(compression: Compression) -> Vec<u8> {
    let schema = "message rows {
        required int64 time (TIMESTAMP(MICROS, true));
        optional int32 count (INTEGER(16, false));
        required boolean armed;
        optional double height;
        required binary text (UTF8);
    }";
    let properties = WriterProperties::builder().set_compression(compression).build();
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let mut file = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut file, schema, Arc::new(properties)).unwrap();
    for group in 0..2_i64 {
        let mut rows = writer.next_row_group().unwrap();
        let levels: Vec<i16> = (0..100).map(|k| i16::from(k % 3 != 0)).collect();
        let mut column = rows.next_column().unwrap().unwrap();
        let times: Vec<i64> = (0..100).map(|k| (group * 100 + k) * 1000).collect();
        column.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let counts: Vec<i32> = (0..100).filter(|k| k % 3 != 0).map(|k| 65_535 - k).collect();
        column.typed::<Int32Type>().write_batch(&counts, Some(&levels), None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        column.typed::<BoolType>().write_batch(&[true; 100], None, None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let heights: Vec<f64> = (0..100).map(f64::from).collect();
        column.typed::<DoubleType>().write_batch(&heights, Some(&[1; 100]), None).unwrap();
        column.close().unwrap();
        let mut column = rows.next_column().unwrap().unwrap();
        let texts = vec!["text".into(); 100];
        column.typed::<parquet::data_type::ByteArrayType>().write_batch(&texts, None, None).unwrap();
        column.close().unwrap();
        rows.close().unwrap();
    }
    writer.close().unwrap();
    file
}

pub(crate) const CODECS: [fn() -> Compression; 5] = [
    || Compression::UNCOMPRESSED,
    || Compression::SNAPPY,
    || Compression::LZ4_RAW,
    || Compression::GZIP(Default::default()),
    || Compression::ZSTD(Default::default()),
];

#[test]
fn types_and_codecs() {
    for codec in CODECS {
        let log = decode(&made(codec()), Path::new("made")).unwrap();
        assert_eq!(log.losses.damage, Vec::<String>::new());
        assert_eq!(log.information["unit of time"], "us");
        let table = log.table("rows").unwrap();
        assert_eq!((table.rows, table.columns.len()), (200, 4));
        assert!(matches!(table.column("time"), Some(Values::I64(times)) if times[199] == 199_000));
        let Some(Values::F32(counts)) = table.column("count") else { panic!("{:?}", table.column("count")) };
        assert!(counts.iter().enumerate().all(|(row, count)| match row % 100 {
            k if k % 3 == 0 => count.is_nan(),
            k => *count == 65_535.0 - k as f32,
        }));
        assert!(
            matches!(table.column("armed"), Some(Values::U8(armed)) if armed.iter().all(|flag| *flag == 1))
        );
        assert_eq!(table.column("height").unwrap().to_f64()[150], 50.0);
    }
}

/// A column that is damaged in one group keeps its rows of the other, and the other columns theirs.
#[test]
fn damage_costs_a_column_of_a_group() {
    let mut bytes = made(Compression::SNAPPY);
    bytes[20..60].fill(0xff);
    let log = decode(&bytes, Path::new("made")).unwrap();
    assert_eq!(log.losses.damage, ["row group 0 is damaged in time"]);
    let table = log.table("rows").unwrap();
    let times = table.column("time").unwrap().to_f64();
    assert_eq!((table.rows, times[150]), (200, 150_000.0));
    assert!(times[..100].iter().all(|time| time.is_nan()));
    assert_eq!(table.column("height").unwrap().to_f64()[50], 50.0);
}

#[test]
fn damaged_made_files_do_no_harm() {
    for codec in CODECS {
        survives("made.parquet", &made(codec()), 1000);
    }
}
