//! Identifications of five 60 s flights in a second of processor time, preprocessing and regression together.
//!
//! The aim is 167, which is 6 ms each. `cargo xtask bench` runs it several times in fresh processes and takes the
//! median; in each, the first identification only warms up.

#[expect(dead_code, reason = "no file is needed here")]
mod common;

use cpu_time::ProcessTime;

fn main() {
    let flights = common::flights();
    let warm = common::fit(&common::prepare(&flights));
    let start = ProcessTime::now();
    let fit = common::fit(&common::prepare(&flights));
    let cpu_s = start.elapsed().as_secs_f64();
    assert_eq!(fit.covariance, warm.covariance, "equal flights give equal bits");
    println!(r#"{{"work":"identifications of five flights","amount":1,"cpu_s":{cpu_s}}}"#);
}
