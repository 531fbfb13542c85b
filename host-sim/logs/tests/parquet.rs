//! Parquet: what pyarrow finds in it.

mod common;

use common::{expected, expected_sum};
use logs::Format;

#[test]
fn columns_hold_what_pyarrow_finds() {
    let Some((log, expected)) = expected("crazyflie_log203.parquet") else { return };
    assert_eq!(log.format, Format::Parquet);
    assert_eq!(log.losses.damage, Vec::<String>::new());
    let table = log.table("rows").unwrap();
    assert_eq!(table.rows as u64, expected["rows"].as_u64().unwrap());
    let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
    let told: Vec<&str> = expected["columns"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(names, told);
    for (name, sum) in expected["sums"].as_object().unwrap() {
        expected_sum(table, name, sum.as_f64().unwrap(), 10);
    }
}
