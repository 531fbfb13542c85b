//! Plays the IMU board on a pseudo terminal: `cargo run -p com --example imu_board [FLIGHT.csv]`.
//!
//! It prints the terminal's path, which goes into `[imu] port`, and sends a frame every 10 ms: the
//! gyro, acceleration, attitude and voltage of a flight file's rows, one after the other, or a
//! board at rest with a little noise. A flight file is the project's: columns by name, `p,q,r` and
//! `vbat`, and `ax,ay,az` and `phi,theta,psi` where there are any.
#![forbid(unsafe_code)]

use std::error::Error;
use std::os::fd::AsFd;

use com::clock::Ticker;
use proto::ImuSample;
use proto::imu_frame::{ImuFrame, MAX_STUFFED_LEN, encode};
use serial2::SerialPort;

/// What a row of the file says, each if it is there.
type Row = (Option<[f32; 3]>, Option<[f32; 3]>, Option<[f32; 3]>, Option<f32>);

fn main() -> Result<(), Box<dyn Error>> {
    let rows = match std::env::args().nth(1) {
        Some(path) => read(&path)?,
        None => Vec::new(),
    };
    let (board, line) = SerialPort::pair()?;
    println!("{}", rustix::termios::ttyname(line.as_fd(), Vec::new())?.to_string_lossy());
    let mut ticker = Ticker::start(10_000_000);
    let rest = std::iter::repeat_with(|| None);
    let played: Box<dyn Iterator<Item = Option<Row>>> = match rows.is_empty() {
        true => Box::new(rest),
        false => Box::new(rows.into_iter().map(Some)),
    };
    for (sequence, row) in (0..=u16::MAX).cycle().zip(played) {
        let beat = ticker.wait();
        let row = row.unwrap_or_else(|| at_rest(sequence));
        let (gyro, acceleration_m_s2, attitude_rad, battery_v) = row;
        // A missing rate is no number, as from a sensor that failed.
        let sample = ImuSample { gyro_rad_s: gyro.unwrap_or([f32::NAN; 3]), attitude_rad, acceleration_m_s2 };
        let frame = ImuFrame { sequence, board_us: beat.time_us, sample, battery_v, current_a: None };
        let mut buffer = [0; MAX_STUFFED_LEN];
        if let Some(bytes) = encode(&frame, &mut buffer) {
            board.write_all(bytes)?;
        }
    }
    Ok(())
}

/// A board on a table. Rates that never change would be taken for a stuck sensor.
fn at_rest(sequence: u16) -> Row {
    let ripple = 0.002 * (f32::from(sequence % 11) - 5.0);
    (Some([ripple, -ripple, 0.5 * ripple]), Some([0.0, 0.0, -9.81]), Some([0.0; 3]), Some(11.8))
}

fn read(path: &str) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut reader = csv::Reader::from_path(path)?;
    let headers = reader.headers()?.clone();
    let column = |name: &str| headers.iter().position(|header| header.trim() == name);
    let three = |names: [&str; 3]| names.map(column);
    let columns = [three(["p", "q", "r"]), three(["ax", "ay", "az"]), three(["phi", "theta", "psi"])];
    let battery = column("vbat");
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let number = |at: Option<usize>| record.get(at?)?.trim().parse::<f32>().ok();
        let [gyro, acceleration, attitude] =
            columns.map(|[a, b, c]| Some([number(a)?, number(b)?, number(c)?]));
        rows.push((gyro, acceleration, attitude, number(battery)));
    }
    Ok(rows)
}
