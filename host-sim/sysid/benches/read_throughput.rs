//! Megabytes of flight file read in a second of processor time, in a fresh process: 100 MB, which the system still
//! holds in memory because they have just been written.
//!
//! The aim is 1,000 MB. `cargo xtask bench` runs it several times and takes the median; with `--against` it hands the
//! same file to other readers, for which it names the folder in `FLIGHT_FILE_FOLDER`.

#[expect(dead_code, reason = "a file is all that is needed here")]
mod common;

use std::fmt::Write as _;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use cpu_time::ProcessTime;
use flights::Flight;

const BYTES: usize = 100_000_000;

fn main() {
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = std::env::var_os("FLIGHT_FILE_FOLDER");
    let path = folder.as_deref().map_or(temporary.path(), Path::new).join("flight.csv");
    let bytes = write_long_flight(&path).expect("100 MB fit on the disk");
    let start = ProcessTime::now();
    let flight = Flight::read(&path).expect("a good file");
    let cpu_s = start.elapsed().as_secs_f64();
    assert!(!flight.is_empty());
    println!(r#"{{"work":"MB of flight file","amount":{},"cpu_s":{cpu_s}}}"#, bytes as f64 * 1e-6);
}

/// Repeats the rows of a flight with rising time. Its size in bytes.
fn write_long_flight(path: &Path) -> std::io::Result<usize> {
    let text = common::text(&common::flight(0));
    let (header, rows) = text.split_once('\n').expect("a header and rows");
    let rows: Vec<&str> = rows.lines().map(|row| row.split_once(',').expect("several fields").1).collect();
    let mut file = BufWriter::new(std::fs::File::create(path)?);
    let mut line = format!("{header}\n");
    let mut written = 0;
    for k in 0_u32.. {
        file.write_all(line.as_bytes())?;
        written += line.len();
        if written >= BYTES {
            break;
        }
        line.clear();
        let row = rows[k as usize % rows.len()];
        writeln!(line, "{:.6},{row}", f64::from(k) * 0.01).expect("strings grow");
    }
    file.flush()?;
    Ok(written)
}
