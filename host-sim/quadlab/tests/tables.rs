//! Tables that the program writes, read by the program's own reader of logs.
#![forbid(unsafe_code)]

use std::path::Path;

use table::{Column, Table, Values};

/// The names and the very numbers.
#[test]
fn a_parquet_file_is_read_back_bit_by_bit() {
    let real = |name: &str, value: &dyn Fn(f64) -> f64| Column {
        name: name.into(),
        values: Values::Real((0..1000).map(|k| value(f64::from(k))).collect()),
    };
    let columns = vec![
        real("t_s", &|k| k * 0.01),
        real("u_measured_m_s2", &|k| (k * 0.1).sin() / 3.0),
        real("u_residual_m_s2", &|k| if k == 7.0 { f64::NAN } else { -1e-300 }),
    ];
    let table = Table { columns, about: vec![("model".into(), "2".into())] };
    let bytes = table.to_parquet().unwrap();
    let log = logs::decode(&bytes, Path::new("samples.parquet")).unwrap();
    let [rows] = &log.tables[..] else { panic!("{} tables", log.tables.len()) };
    assert_eq!((rows.rows, rows.columns.len()), (1000, 3));
    for (written, read) in table.columns.iter().zip(&rows.columns) {
        assert_eq!(written.name, read.name);
        let Values::Real(own) = &written.values else { panic!("numbers") };
        let same = own.iter().zip(read.values.to_f64()).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{}", written.name);
    }
}
