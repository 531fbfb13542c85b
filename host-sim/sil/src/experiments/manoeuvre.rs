//! Manoeuvres that excite the physical effects, and what is added to the motors, as pattern files.
//!
//! The library holds what the effects ask for (`quadlab effects`): turns on the spot, heights,
//! dashes, climbs. Each stays in the cage of the thesis and begins and ends in hover; way-points
//! move no faster than the position loop's reference.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use pattern::{Excitation, Multisine, MultisineError, Pattern, PatternError, Spacing, Sweep, SweepError};

use crate::flight::{Script, Waypoint};

/// A path to fly.
#[derive(Debug, Clone, PartialEq)]
pub struct Manoeuvre {
    /// Its word in commands.
    pub name: &'static str,
    /// What to fly, in words.
    pub words: &'static str,
    script: Script,
}

/// What is added to the motors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// Nothing.
    None,
    /// The thesis' random sines (4.2.1).
    Thesis,
    /// Orthogonal multisines with small peaks.
    Multisine,
    /// A sweep of each motor in turn, in equal steps of hertz.
    LinearSweep,
    /// A sweep of each motor in turn, in equal steps of octaves.
    LogSweep,
}

/// What is added to the motors, and how much of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Injection {
    /// Which.
    pub signal: Signal,
    /// Amplitude of a sine of the same power, command units. The thesis' sines have 15 us in a
    /// range of 1000.
    pub amplitude: f64,
    /// Lowest and highest frequency, Hz; the thesis' sines have their own.
    pub band_hz: [f64; 2],
    /// Seed of random sines and of the search for phases.
    pub seed: u64,
}

/// Why a pattern cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ManoeuvreError {
    /// Its multisine.
    #[error(transparent)]
    Multisine(#[from] MultisineError),
    /// Its sweep.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// Its rows.
    #[error(transparent)]
    Pattern(#[from] PatternError),
}

/// Where manoeuvres begin and end, inertial NED, m.
const START_M: [f64; 3] = [0.0, 0.0, -1.0];
/// Hover before and after, s.
const REST_S: f64 = 1.0;

/// Every manoeuvre, `duration_s` long; `seed` draws the tour.
pub fn library(duration_s: f64, seed: u64) -> Vec<Manoeuvre> {
    let end_s = duration_s - REST_S;
    let tour = Manoeuvre {
        name: "tour",
        words: "tour the cage: dashes, turns, climbs, and slow passes low over the floor",
        script: Script::tour(seed, end_s),
    };
    let mut all = on_the_spot(end_s);
    all.extend(heights(end_s));
    all.extend(dashes(end_s));
    all.extend(even_speeds(end_s));
    all.push(tour);
    all
}

fn on_the_spot(end_s: f64) -> Vec<Manoeuvre> {
    let twice_round: Vec<Waypoint> = steps(0.1, end_s)
        .map(|(_, from_s)| at(from_s, (START_M, 2.0 * TAU * (from_s - REST_S) / (end_s - REST_S))))
        .collect();
    vec![
        make("hover", "hover at 1 m, heading north", Vec::new(), end_s),
        make("yaw-round", "hover at 1 m and turn round twice, slowly and evenly", twice_round, end_s),
        make(
            "yaw-swings",
            "hover at 1 m and swing the heading quickly by 60 degrees to either side, every 2 s",
            in_turn(2.0, &[(START_M, PI / 3.0), (START_M, -PI / 3.0)], end_s),
            end_s,
        ),
    ]
}

fn heights(end_s: f64) -> Vec<Manoeuvre> {
    let heights = |leg_s: f64, all: &[f64]| {
        in_turn(leg_s, &all.iter().map(|h| north([0.0, 0.0, -h])).collect::<Vec<_>>(), end_s)
    };
    vec![
        make(
            "height-steps",
            "hover at 1.6, 1.0, 0.5, 0.25 and 0.15 m over the floor, some seconds each",
            heights((end_s - REST_S) / 5.0, &[1.6, 1.0, 0.5, 0.25, 0.15]),
            end_s,
        ),
        make(
            "low-flight",
            "sink to 0.15 m over the floor, stay for 3 s, climb to 1 m for 2 s, and again",
            heights(2.5, &[0.15, 0.15, 1.0]),
            end_s,
        ),
        make("climbs", "climb and sink between 0.5 and 1.8 m every 2 s", heights(2.0, &[1.8, 0.5]), end_s),
    ]
}

fn dashes(end_s: f64) -> Vec<Manoeuvre> {
    let headings = |k: usize| 0.5 * PI * k as f64;
    let yawed: Vec<([f64; 3], f64)> =
        (0..8).map(|k| ([if k % 2 == 0 { 1.3 } else { -1.3 }, 0.0, -1.0], headings(k / 2))).collect();
    vec![
        make(
            "dashes-forward",
            "dash forward and back over 3 m as fast as it flies, heading north",
            in_turn(2.0, &[north([1.5, 0.0, -1.0]), north([-1.5, 0.0, -1.0])], end_s),
            end_s,
        ),
        make(
            "dashes-sideways",
            "dash to the right and left over 2 m as fast as it flies, heading north",
            in_turn(1.8, &[north([0.0, 1.0, -1.0]), north([0.0, -1.0, -1.0])], end_s),
            end_s,
        ),
        make(
            "dashes-yawed",
            "dash over 2.6 m to and fro with the nose north, then east, south and west",
            in_turn(2.0, &yawed, end_s),
            end_s,
        ),
    ]
}

fn even_speeds(end_s: f64) -> Vec<Manoeuvre> {
    let over_time = |place: fn(f64) -> [f64; 3]| -> Vec<Waypoint> {
        steps(0.1, end_s).map(|(_, from_s)| at(from_s, north(place(from_s - REST_S)))).collect()
    };
    let shuttle = over_time(|since_s| {
        // Half a metre a second, to and fro.
        let way = (0.5 * since_s) % 6.0;
        let x = if way < 1.5 {
            way
        } else if way < 4.5 {
            3.0 - way
        } else {
            way - 6.0
        };
        [x, 0.0, -1.0]
    });
    let circle = over_time(|since_s| {
        let angle = 1.2 * since_s;
        [1.0 - angle.cos(), angle.sin(), -1.0]
    });
    vec![
        make("shuttle", "fly 3 m to and fro at an even 0.5 m/s, heading north", shuttle, end_s),
        make("circle", "circle at 1 m radius and 1.2 m/s, heading north", circle, end_s),
    ]
}

fn make(name: &'static str, words: &'static str, list: Vec<Waypoint>, end_s: f64) -> Manoeuvre {
    Manoeuvre { name, words, script: path(list, end_s) }
}

/// The places and headings of a list in turn, each for `leg_s`, round and round.
fn in_turn(leg_s: f64, places: &[([f64; 3], f64)], end_s: f64) -> Vec<Waypoint> {
    steps(leg_s, end_s).map(|(k, from_s)| at(from_s, places[k % places.len()])).collect()
}

/// A place, heading north.
fn north(position_m: [f64; 3]) -> ([f64; 3], f64) {
    (position_m, 0.0)
}

/// The steps from rest to the end.
fn steps(leg_s: f64, end_s: f64) -> impl Iterator<Item = (usize, f64)> {
    (0..).map(move |k: u32| (k as usize, REST_S + f64::from(k) * leg_s)).take_while(move |(_, s)| *s < end_s)
}

fn at(from_s: f64, (position_m, yaw_rad): ([f64; 3], f64)) -> Waypoint {
    Waypoint { from_s, position_m, yaw_rad }
}

/// Way-points between rests; the last heading is kept.
fn path(mut list: Vec<Waypoint>, end_s: f64) -> Script {
    let yaw_rad = list.last().map_or(0.0, |w| w.yaw_rad);
    list.insert(0, at(0.0, (START_M, 0.0)));
    list.push(at(end_s, (START_M, yaw_rad)));
    Script::Waypoints { list, repeat_s: None }
}

impl Manoeuvre {
    /// The pattern of the manoeuvre with an injection; `path` is for messages.
    ///
    /// # Errors
    /// An injection that cannot be made.
    pub fn pattern(
        &self,
        injection: &Injection,
        period_s: f64,
        duration_s: f64,
        path: &Path,
    ) -> Result<Pattern, ManoeuvreError> {
        let added = injection.over(period_s, duration_s)?;
        Ok(self.pattern_with(added, period_s, duration_s, path)?)
    }

    /// The pattern of the manoeuvre with what `added` gives at each tick, command units.
    ///
    /// # Errors
    /// Values that a pattern may not have.
    pub fn pattern_with(
        &self,
        added: impl FnMut(f64) -> [f64; 4],
        period_s: f64,
        duration_s: f64,
        path: &Path,
    ) -> Result<Pattern, PatternError> {
        Pattern::new(self.script.rows((START_M, 0.0), period_s, duration_s, added), path)
    }
}

impl Injection {
    /// The injection as a function of rising time, called once a tick.
    fn over(
        &self,
        period_s: f64,
        duration_s: f64,
    ) -> Result<Box<dyn FnMut(f64) -> [f64; 4]>, ManoeuvreError> {
        let amplitude = self.amplitude;
        let scaled = move |values: [f64; 4]| values.map(|v| amplitude * v);
        Ok(match self.signal {
            Signal::None => Box::new(|_| [0.0; 4]),
            Signal::Thesis => {
                // Its mean amplitude is 15 times its gain.
                let mut sines = Excitation::new(self.seed, period_s, amplitude / 15.0);
                Box::new(move |_| sines.next_sample().map(f64::from))
            }
            Signal::Multisine => {
                let sines = Multisine::new(duration_s, self.band_hz, self.seed)?;
                Box::new(move |time_s| scaled(sines.at(time_s)))
            }
            Signal::LinearSweep | Signal::LogSweep => {
                let spacing = match self.signal {
                    Signal::LogSweep => Spacing::Logarithmic,
                    _ => Spacing::Linear,
                };
                let sweep = Sweep::new(spacing, self.band_hz, duration_s)?;
                Box::new(move |time_s| scaled(sweep.at(time_s)))
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::CAGE_M;

    const GENTLE: Injection =
        Injection { signal: Signal::Multisine, amplitude: 15.0, band_hz: [0.2, 5.0], seed: 1 };

    #[test]
    fn every_manoeuvre_stays_in_the_cage_and_ends_in_hover() {
        let names: Vec<&str> = library(20.0, 1).iter().map(|m| m.name).collect();
        let unique: std::collections::BTreeSet<&&str> = names.iter().collect();
        assert_eq!(unique.len(), names.len());
        for manoeuvre in library(20.0, 1) {
            let pattern = manoeuvre
                .pattern(&Injection { signal: Signal::None, ..GENTLE }, 0.01, 20.0, Path::new("p"))
                .unwrap();
            assert_eq!((pattern.duration_s(), pattern.rows().len()), (20.0, 2001), "{}", manoeuvre.name);
            for row in pattern.rows() {
                let [x, y, z] = row.position_m;
                let inside = x.abs() <= 2.0 && y.abs() <= 1.2 && -z <= CAGE_M[2] - 0.7 && -z >= 0.1;
                assert!(inside, "{}: {row:?}", manoeuvre.name);
            }
        }
    }

    #[test]
    fn injections_have_their_amplitude() {
        let hover = &library(20.0, 1)[0];
        for signal in [Signal::Thesis, Signal::Multisine, Signal::LinearSweep, Signal::LogSweep] {
            let pattern = hover.pattern(&Injection { signal, ..GENTLE }, 0.01, 20.0, Path::new("p")).unwrap();
            let power: f64 = pattern.rows().iter().flat_map(|r| r.injection).map(|v| v * v).sum();
            // A sine of 15 has a mean square of 112.5; a sweep is on a quarter of the time and
            // rises and falls.
            let sine = power / (4.0 * 2000.0) / 112.5;
            let expected = match signal {
                Signal::Multisine => 0.999..1.001,
                Signal::Thesis => 0.7..1.5,
                _ => 0.2..0.26,
            };
            assert!(expected.contains(&sine), "{signal:?}: {sine}");
        }
    }
}
