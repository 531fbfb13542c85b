//! Tables of other programs: text that is known by its names, and any names through a map of columns.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use flights::{Column, ColumnMap};
use logs::{Format, Import, import_bytes};
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// Five seconds at 100 Hz.
const ROWS: usize = 500;

fn text(header: &str, row: impl Fn(usize) -> Vec<f64>) -> String {
    let mut text = header.to_owned();
    for k in 0..ROWS {
        let _ = write!(text, "\n{}", row(k).iter().map(f64::to_string).collect::<Vec<_>>().join(","));
    }
    text + "\n"
}

fn imported(text: &str, map: &str) -> Result<Import, String> {
    let map = ColumnMap::parse(map, Path::new("columns.toml")).unwrap();
    import_bytes(text.as_bytes().to_vec(), Path::new("a/table.csv"), &map).map_err(|why| why.to_string())
}

/// What `blackbox_decode` writes: axes front, left, up; motors rear right, front right, rear left, front left.
fn decoded(gyro: &str) -> String {
    let header = format!(
        "loopIteration, time (us), gyroADC[0]{gyro}, gyroADC[1]{gyro}, gyroADC[2]{gyro}, accSmooth[0] (g), \
         accSmooth[1] (g), accSmooth[2] (g), motor[0], motor[1], motor[2], motor[3], vbatLatest (V)"
    );
    text(&header, |k| {
        let t = 1e4 * k as f64;
        vec![k as f64, t, 90.0, 45.0, -90.0, 0.1, 0.2, 1.0, 1100.0, 1200.0, 1300.0, 1400.0, 165.3]
    })
}

#[test]
fn what_blackbox_decode_writes_is_a_flight_where_its_units_are_told() {
    let import = imported(&decoded(" (deg/s)"), "").unwrap();
    assert_eq!((import.format, import.flights.len()), (Format::Csv, 1));
    let flight = &import.flights[0].flight;
    let at = |column| flight.column(column).unwrap()[7];
    let turn = std::f64::consts::FRAC_PI_2;
    for (column, value) in [(Column::P, turn), (Column::Q, -turn / 2.0), (Column::R, turn)] {
        assert!((at(column) - value).abs() < 1e-6, "{column:?}: {}", at(column));
    }
    assert_eq!([at(Column::Ax), at(Column::Ay), at(Column::Az)], [0.981, -1.962, -9.81]);
    let commands = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4].map(at);
    assert_eq!(commands, [1400.0, 1200.0, 1100.0, 1300.0]);
    // Its volts are ten times too many in some versions.
    assert_eq!(flight.column(Column::Vbat), None);
    let why = imported(&decoded(""), "").unwrap_err();
    assert!(
        why.contains("a/table.csv: gyroADC is in counts") && why.contains("--unit-rotation deg/s"),
        "{why}"
    );
}

/// World z up, body forward-left-up, metres and degrees; time in ms.
#[test]
fn what_bitcrazes_client_writes_is_a_flight_with_columns_of_someones_own() {
    let header = "timestamp,stateEstimate.x,stateEstimate.y,stateEstimate.z,gyro.x,gyro.y,gyro.z,\
                  motor.m1,motor.m2,motor.m3,motor.m4,payload_kg,note";
    let table = text(header, |k| {
        let k = k as f64;
        vec![10.0 * k, 1.0, 2.0, 3.0, 90.0, 45.0, 90.0, 1e4, 2e4, 3e4, 4e4, 0.25, 0.5]
    });
    let import = imported(&table, "").unwrap();
    let flight = &import.flights[0].flight;
    let at = |column| flight.column(column).unwrap()[7];
    assert_eq!([at(Column::X), at(Column::Y), at(Column::Z)], [1.0, -2.0, -3.0]);
    assert!(
        (at(Column::T) - 0.07).abs() < 1e-9 && (at(Column::Q) + std::f64::consts::FRAC_PI_4).abs() < 1e-6
    );
    assert_eq!(flight.further("payload_kg").unwrap()[7], 0.25);
    // A map says otherwise.
    let mapped = imported(
        &table,
        "[columns]\nt = { column = \"timestamp\", scale = 1e-3 }\nx = \"stateEstimate.x\"\n",
    );
    assert!(mapped.unwrap_err().contains("column \"phi\" is missing"));
}

const OURS: &str = "stamp,n,e,d,roll,pitch,yaw,wx,wy,wz,cmd1,cmd2,cmd3,cmd4,weight";

fn ours(k: usize) -> Vec<f64> {
    let t = 10.0 * k as f64;
    vec![t, 1.0, 2.0, -3.0, 0.1, 0.2, 0.3, 0.01, 0.02, 0.03, 1.0, 1.0, 1.0, 1.0, 250.0]
}

const MAP: &str = "[columns]\nt = { column = \"stamp\", scale = 1e-3 }\nx = \"n\"\ny = \"e\"\nz = \"d\"\n\
                   payload_kg = { column = \"weight\", scale = 1e-3 }\n";

fn is_ours(import: &Import) {
    let flight = &import.flights[0].flight;
    let at = |column| flight.column(column).unwrap()[7];
    assert!((at(Column::T) - 0.07).abs() < 1e-12);
    assert_eq!([at(Column::Z), at(Column::Psi), at(Column::R)], [-3.0, 0.3, 0.03]);
    assert_eq!(flight.further("payload_kg").unwrap()[7], 0.25);
    assert_eq!(import.sources.position.as_deref(), Some("n"));
    assert_eq!((flight.name.as_str(), import.flights[0].rate_hz.round()), ("table.csv", 100.0));
}

#[test]
fn a_text_of_any_names_is_a_flight_through_a_map() {
    is_ours(&imported(&text(OURS, ours), MAP).unwrap());
    let why = imported(&text("alpha,beta", |_| vec![1.0, 2.0]), "").unwrap_err();
    assert!(
        why.contains("(alpha, beta)") && why.contains("columns.toml") && why.lines().count() == 1,
        "{why}"
    );
}

#[test]
fn a_parquet_file_of_any_names_is_a_flight_through_a_map() {
    let names: Vec<&str> = OURS.split(',').collect();
    let fields: String = names.iter().map(|name| format!("required double {name};")).collect();
    let schema = Arc::new(parse_message_type(&format!("message rows {{ {fields} }}")).unwrap());
    let mut file = Vec::new();
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(&mut file, schema, properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for place in 0..names.len() {
        let values: Vec<f64> = (0..ROWS).map(|k| ours(k)[place]).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&values, None, None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
    let map = ColumnMap::parse(MAP, Path::new("columns.toml")).unwrap();
    is_ours(&import_bytes(file.clone(), Path::new("table.parquet"), &map).unwrap());
    let why = import_bytes(file, Path::new("table.parquet"), &ColumnMap::default()).unwrap_err().to_string();
    assert!(why.contains("table.parquet: "), "{why}");
}
