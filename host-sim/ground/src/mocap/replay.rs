//! A flight file, or a log of another program, as a tracker: its poses at the times they were taken, as fast as they were or
//! faster.
//!
//! For trying a ground station, a craft on the bench with its propellers off, or a recorded failure
//! again. Rows without a pose are frames in which the craft was not seen.

use std::path::Path;
use std::time::{Duration, Instant};

use flights::{Column, ColumnMap, Flight};
use proto::Pose;

use super::receiver::{MocapError, MocapReceiver, Sighting, TrackerEvent};

/// A flight that is replayed.
#[derive(Debug)]
pub struct Replay {
    name: String,
    /// Times from the first row, s, and poses.
    rows: Vec<(f64, Option<Pose>)>,
    speed: f64,
    next: usize,
    started: Option<Instant>,
}

impl Replay {
    /// Reads a flight file, or the longest flight of a log; `speed` 1 is as it was flown, 10 ten times as fast.
    ///
    /// # Errors
    /// A file in which there is no flight, or a speed that is not above zero.
    pub fn open(path: &Path, speed: f64) -> Result<Self, MocapError> {
        let refuse = |problem: String| MocapError::Replay { file: path.display().to_string(), problem };
        if !(speed > 0.0 && speed <= 1e6) {
            return Err(refuse(format!("a speed of {speed}; 1 is real time, at most 1e6")));
        }
        let flight = match logs::format_of(path) {
            Some(_) => longest_of_log(path).map_err(|error| refuse(error.to_string()))?,
            None => Flight::read(path).map_err(|error| refuse(error.to_string()))?,
        };
        Self::of(&flight, speed).ok_or_else(|| refuse("it has no poses".into()))
    }

    /// The poses of a flight; none if it has none.
    pub fn of(flight: &Flight, speed: f64) -> Option<Self> {
        let columns = [Column::T, Column::X, Column::Y, Column::Z, Column::Phi, Column::Theta, Column::Psi];
        let [t, x, y, z, phi, theta, psi] = columns.map(|column| flight.column(column));
        let (t, x, y, z, phi, theta, psi) = (t?, x?, y?, z?, phi?, theta?, psi?);
        let start_s = *t.first()?;
        let rows: Vec<_> = (0..t.len())
            .map(|k| {
                let single = |v: [f64; 3]| v.map(|v| v as f32);
                let pose = Pose {
                    position_m: single([x[k], y[k], z[k]]),
                    attitude_rad: single([phi[k], theta[k], psi[k]]),
                };
                let numbers = pose.position_m.iter().chain(&pose.attitude_rad).all(|v| v.is_finite());
                (t[k] - start_s, numbers.then_some(pose))
            })
            .collect();
        rows.iter().any(|(_, pose)| pose.is_some()).then(|| Self {
            name: flight.name.clone(),
            rows,
            speed,
            next: 0,
            started: None,
        })
    }
}

fn longest_of_log(path: &Path) -> Result<Flight, logs::LogError> {
    let flights = logs::import(path, &ColumnMap::beside(path)?)?.flights.into_iter();
    let longest = flights.map(|part| part.flight).max_by_key(Flight::len);
    let longest = longest.ok_or_else(|| logs::LogError::nothing_flown(path))?;
    // A log has its attitude in its own form, a pose in angles; no place may stand in for one that was not logged.
    let has_place = longest.column(Column::X).is_some();
    Ok(if has_place { longest.completed(path)?.into_owned() } else { longest })
}

impl MocapReceiver for Replay {
    fn next(&mut self, patience: Duration) -> Result<TrackerEvent, MocapError> {
        let Some(&(time_s, pose)) = self.rows.get(self.next) else { return Ok(TrackerEvent::End) };
        let started = *self.started.get_or_insert_with(Instant::now);
        let due = started + Duration::from_secs_f64(time_s.max(0.0) / self.speed);
        let wait = due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(patience));
        if wait > patience {
            return Ok(TrackerEvent::Nothing);
        }
        let frame = self.next as u32;
        self.next += 1;
        Ok(match pose {
            Some(pose) => TrackerEvent::Seen(Sighting { frame, pose, age: Duration::ZERO }),
            None => TrackerEvent::NotSeen { frame },
        })
    }

    fn describe(&self) -> String {
        format!("replay of {} at {} times its speed", self.name, self.speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLIGHT: &str = "t,x,y,z,phi,theta,psi,p,q,r,cmd1,cmd2,cmd3,cmd4,vbat\n\
                          5.00,1,2,-1,0.1,0.2,3,0,0,0,1500,1500,1500,1500,11\n\
                          5.01,,2,-1,0.1,0.2,3,0,0,0,1500,1500,1500,1500,11\n\
                          5.03,1.5,2,-1,0.1,0.2,3,0,0,0,1500,1500,1500,1500,11\n";

    fn flight() -> Flight {
        Flight::parse(FLIGHT.as_bytes(), Path::new("f.csv")).unwrap()
    }

    #[test]
    fn poses_come_as_they_were_and_when_they_were() {
        let mut replay = Replay::of(&flight(), 1.0).unwrap();
        let started = Instant::now();
        let mut heard = Vec::new();
        loop {
            match replay.next(Duration::from_millis(4)).unwrap() {
                TrackerEvent::Nothing => {}
                TrackerEvent::End => break,
                other => heard.push((other, started.elapsed())),
            }
        }
        let [
            (TrackerEvent::Seen(first), at0),
            (TrackerEvent::NotSeen { frame: 1 }, at1),
            (TrackerEvent::Seen(last), at3),
        ] = &heard[..]
        else {
            panic!("{heard:?}");
        };
        assert_eq!(first.pose, Pose { position_m: [1.0, 2.0, -1.0], attitude_rad: [0.1, 0.2, 3.0] });
        assert_eq!((last.frame, last.pose.position_m[0]), (2, 1.5));
        // Never early; how late is the machine's affair.
        assert!(at1.as_secs_f64() >= 0.0099 && at3.as_secs_f64() >= 0.0299, "{at0:?} {at1:?} {at3:?}");
    }

    #[test]
    fn fast_is_fast() {
        let mut replay = Replay::of(&flight(), 1e6).unwrap();
        let started = Instant::now();
        for _ in 0..3 {
            assert!(!matches!(
                replay.next(Duration::from_secs(1)).unwrap(),
                TrackerEvent::Nothing | TrackerEvent::End
            ));
        }
        assert_eq!(replay.next(Duration::ZERO).unwrap(), TrackerEvent::End);
        assert!(started.elapsed() < Duration::from_millis(500));
    }

    #[test]
    fn what_cannot_be_replayed_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.csv");
        std::fs::write(&path, FLIGHT).unwrap();
        assert!(Replay::open(&path, 1.0).is_ok());
        for speed in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let message = Replay::open(&path, speed).unwrap_err().to_string();
            assert!(message.contains("f.csv") && message.contains("speed"), "{message}");
        }
        let log = folder.path().join("f.ulg");
        std::fs::write(&log, b"ULog\x01\x12\x35\x01").unwrap();
        let message = Replay::open(&log, 1.0).unwrap_err().to_string();
        assert!(message.contains("f.ulg") && message.lines().count() == 1, "{message}");
        let message = Replay::open(&folder.path().join("none.csv"), 1.0).unwrap_err().to_string();
        assert!(message.contains("none.csv") && message.lines().count() == 1, "{message}");
    }

    /// A log of PX4's, where it is there.
    #[test]
    fn the_longest_flight_of_a_log_is_replayed() {
        let log =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/logs/px4_indoor_vision.ulg");
        if !log.is_file() {
            println!("SKIPPED: {} is not there", log.display());
            return;
        }
        let replay = Replay::open(&log, 1.0).unwrap();
        let (last_s, _) = replay.rows[replay.rows.len() - 1];
        assert!(
            last_s > 10.0 && replay.rows.iter().filter(|(_, pose)| pose.is_some()).count() > 1000,
            "{last_s}"
        );
    }
}
