//! Battery voltage: from the IMU board's frames, as in the thesis, or from a converter of the board
//! that Linux knows (industrial I/O, `/sys/bus/iio/devices/iio:deviceN/in_voltageM_raw`; or hwmon,
//! `inK_input`).
//!
//! A converter is a file, and files are read by a thread of their own. A value that is older than
//! [`STALE`] becomes NaN, whichever way it came: the supervisor then neither arms nor trusts it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

use crate::clock::monotonic_ms;
use crate::error::{Error, Result, access, system};

/// How long a voltage is valid.
pub const STALE: Duration = Duration::from_millis(500);
/// Between two readings of a converter.
const READ_EVERY: Duration = Duration::from_millis(20);

/// The newest voltage and when it came: milliseconds of the clock above, the f32's bits below.
#[derive(Debug, Clone, Default)]
pub struct Battery {
    newest: Arc<AtomicU64>,
}

impl Battery {
    /// Starts to read a converter.
    ///
    /// # Errors
    /// A file that cannot be read now, or holds no number.
    pub fn from_converter(path: PathBuf, volt_per_count: f64) -> Result<Self> {
        let battery = Self::default();
        battery.store(read(&path, volt_per_count)?);
        let writer = battery.clone();
        let watch = move || loop {
            sleep(READ_EVERY);
            if let Ok(voltage_v) = read(&path, volt_per_count) {
                writer.store(voltage_v);
            }
        };
        thread::Builder::new()
            .name("battery".into())
            .spawn(watch)
            .map_err(system("start the thread of the battery"))?;
        Ok(battery)
    }

    /// Stores a voltage that arrived now.
    pub fn store(&self, voltage_v: f32) {
        self.newest.store(packed(monotonic_ms(), voltage_v), Ordering::Relaxed);
    }

    /// The voltage in V; NaN if none is valid.
    pub fn voltage_v(&self) -> f32 {
        unpacked(self.newest.load(Ordering::Relaxed), monotonic_ms())
    }
}

/// A voltage and when it came, by a clock that wraps after 49 days.
fn packed(now_ms: u32, voltage_v: f32) -> u64 {
    u64::from(now_ms) << 32 | u64::from(voltage_v.to_bits())
}

/// The voltage, V, if it came and is not stale.
fn unpacked(packed: u64, now_ms: u32) -> f32 {
    let age_ms = now_ms.wrapping_sub((packed >> 32) as u32);
    if packed != 0 && u128::from(age_ms) <= STALE.as_millis() {
        f32::from_bits(packed as u32)
    } else {
        f32::NAN
    }
}

fn read(path: &Path, volt_per_count: f64) -> Result<f32> {
    let text = fs::read_to_string(path).map_err(access(path, "read the battery's converter"))?;
    let counts: f64 = text.trim().parse().map_err(|_| Error::Content {
        path: path.to_owned(),
        message: format!(
            "{:?} is not a number; [battery] converter must name a file with a converter's raw value",
            text.trim()
        ),
    })?;
    Ok((counts * volt_per_count) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residues::{TURN, residues};

    #[test]
    fn a_converter_is_read_again_and_again_and_grows_stale() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in_voltage3_raw");
        fs::write(&path, "1500\n").unwrap();
        let battery = Battery::from_converter(path.clone(), 0.0074).unwrap();
        assert!((battery.voltage_v() - 11.1).abs() < 1e-5);
        fs::write(&path, "1400\n").unwrap();
        let wait = |done: &dyn Fn(f32) -> bool| {
            for _ in 0..1000 {
                if done(battery.voltage_v()) {
                    return true;
                }
                sleep(Duration::from_millis(10));
            }
            false
        };
        assert!(wait(&|voltage_v| (voltage_v - 10.36).abs() < 1e-5));
        fs::remove_file(&path).unwrap();
        assert!(wait(&f32::is_nan), "what cannot be read is no voltage after a while");
    }

    /// From every residue of 2^32 with a boundary to every other one, against wide integers.
    #[test]
    fn a_voltage_is_valid_for_half_a_second_wherever_the_clock_wraps() {
        for came_ms in residues() {
            for age_ms in residues().into_iter().chain(495..505) {
                let now = i128::from(came_ms) + i128::from(age_ms);
                let voltage_v = unpacked(packed(came_ms, 11.1), (now % TURN) as u32);
                assert_eq!(voltage_v.is_nan(), age_ms > 500, "{age_ms} ms after {came_ms}");
                assert!(voltage_v.is_nan() || voltage_v == 11.1);
            }
        }
    }

    #[test]
    fn nothing_is_known_before_something_came() {
        assert!(Battery::default().voltage_v().is_nan());
        let missing = Battery::from_converter("/nonexistent/raw".into(), 1.0).unwrap_err().to_string();
        assert!(missing.contains("/nonexistent/raw"), "{missing}");
    }
}
