//! Channels that lie: a tracker that freezes or jumps, commands at their ends, motors that never move.
//!
//! A frozen tracker repeats its last pose while the gyro goes on; a teleport (a swapped marker, a lost track) is a jump that no
//! craft flies. Their samples are taken out like missing values (`mask`), so that what is left is a flight with gaps
//! and nothing is fitted to them. Commands at an end of their range are kept, and told: there the controller asked
//! for more than the motors gave.

use model::{Vehicle, frames};
use nalgebra::Vector3;
use report::number::fixed;

use flights::{COLUMNS, Column, Flight, median_step};

const POSE: [Column; 6] = [Column::X, Column::Y, Column::Z, Column::Phi, Column::Theta, Column::Psi];
const GYRO: [Column; 3] = [Column::P, Column::Q, Column::R];
pub(super) const COMMANDS: [Column; 4] = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];

/// Equal samples in a row from which a stream is frozen, as time, s, and as samples.
const FROZEN_S: f64 = 0.12;
const FROZEN_SAMPLES: usize = 6;
/// A jump out of the straight line through its neighbours, m, and as an acceleration, m/s^2: no craft pulls 40 g.
const JUMP_M: f64 = 0.05;
const JUMP_M_S2: f64 = 400.0;
/// A turn between two samples beyond what the gyro can have seen, rad.
const JUMP_RAD: f64 = 0.3;
/// Part of the samples with a jump from which it is no fault of a moment.
const MOST_JUMPS: f64 = 0.02;
/// Between two jumps closer than this the tracker was elsewhere, s.
const EXCURSION_S: f64 = 0.6;
/// Samples taken out about a jump: more than what is bridged.
const ABOUT_JUMP: usize = 2;
/// Part of the samples at an end of the range that is worth a word.
const SATURATED: f64 = 0.05;

/// What channels do that they should not.
#[derive(Debug, Clone, PartialEq)]
pub struct Lie {
    /// For people.
    pub sentence: String,
    /// First and last time of each place where they do, s; none where it is the flight as a whole.
    pub places_s: Vec<[f64; 2]>,
}

impl From<String> for Lie {
    fn from(sentence: String) -> Self {
        Self { sentence, places_s: Vec::new() }
    }
}

/// What a flight's channels do, in sentences, and the flight without the samples that lie.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Channels {
    /// Streams that froze.
    pub frozen: Vec<Lie>,
    /// Jumps of the tracker.
    pub jumps: Vec<Lie>,
    /// Whether jumps were told only.
    pub jumps_kept: bool,
    /// Commands at their ends.
    pub saturated: Vec<Lie>,
    /// The flight with what lies taken out, if anything does.
    pub masked: Option<Flight>,
}

/// Looks at every channel of a flight.
pub fn check(flight: &Flight, vehicle: &Vehicle) -> Channels {
    let mut found = Channels::default();
    let mut masked = flight.clone();
    let t = flight.required(Column::T);
    let period_s = median_step(t);
    let streams = [
        ("the tracker (x, y, z, phi, theta, psi)", &POSE[..], &GYRO[..]),
        ("the gyro (p, q, r)", &GYRO, &POSE),
    ];
    for (name, stream, witness) in streams {
        let runs = frozen_runs(flight, stream, witness, period_s);
        if runs.is_empty() {
            continue;
        }
        let samples: usize = runs.iter().map(|r| r.len()).sum();
        let sentence = format!(
            "{name} repeats its values {} for {} s in all, first at t = {} s: these {samples} samples are left out",
            times(runs.len()),
            fixed(samples as f64 * period_s, 2),
            fixed(t[runs[0].start], 2)
        );
        let places_s = runs.iter().map(|run| [t[run.start], t[run.end - 1]]).collect();
        found.frozen.push(Lie { sentence, places_s });
        for run in runs {
            mask(&mut masked, stream, run);
        }
    }
    found.frozen.extend(dead_columns(flight).into_iter().map(Lie::from));
    tell_jumps(flight, &mut masked, &mut found);
    found.saturated = saturated(flight, vehicle).into_iter().map(Lie::from).collect();
    let is_masked = POSE.iter().chain(&GYRO).any(|&c| missing(&masked, c) != missing(flight, c));
    found.masked = is_masked.then_some(masked);
    found
}

/// Says where the tracker jumps, and takes the samples about the jumps out.
fn tell_jumps(flight: &Flight, masked: &mut Flight, found: &mut Channels) {
    let t = flight.required(Column::T);
    let jumps = jumps(masked, median_step(t));
    // A tracker that always jumps is one in other units or axes, which other checks name.
    let always = jumps.len() as f64 > MOST_JUMPS * flight.len() as f64;
    let Some(first) = jumps.first().filter(|_| !always) else { return };
    // A logged velocity is the target then, and the position beside it an estimate that was corrected.
    let kept = flight.group([Column::Vx, Column::Vy, Column::Vz]).is_some();
    let (what, done) = if kept {
        (
            "position or attitude estimate",
            "(corrections by an estimator?): velocities are logged, so these samples are kept",
        )
    } else {
        ("tracker", "(lost or swapped markers?): samples around the jumps are left out")
    };
    let place = format!("{}, first at t = {} s", times(jumps.len()), fixed(t[*first], 2));
    let sentence = format!("the {what} jumps as no craft can fly, {place} {done}");
    let places_s = jumps.iter().map(|&k| [t[k], t[k + 1]]).collect();
    found.jumps.push(Lie { sentence, places_s });
    found.jumps_kept = kept;
    if !kept {
        mask_jumps(masked, &jumps);
    }
}

fn missing(flight: &Flight, column: Column) -> usize {
    flight.required(column).iter().filter(|v| v.is_nan()).count()
}

fn times(count: usize) -> String {
    if count == 1 { "once".into() } else { format!("{count} times") }
}

fn mask(flight: &mut Flight, stream: &[Column], samples: std::ops::Range<usize>) {
    for &column in stream {
        let mut values = flight.required(column).to_vec();
        values[samples.clone()].fill(f64::NAN);
        flight.replace(column, values);
    }
}

/// Runs in which every column of a stream repeats its value while the witness moves.
fn frozen_runs(
    flight: &Flight,
    stream: &[Column],
    witness: &[Column],
    period_s: f64,
) -> Vec<std::ops::Range<usize>> {
    let same = |columns: &[Column], k: usize| {
        columns.iter().all(|&c| flight.required(c)[k] == flight.required(c)[k - 1])
    };
    let longest = ((FROZEN_S / period_s).ceil() as usize).max(FROZEN_SAMPLES);
    let mut runs = Vec::new();
    let mut k = 1;
    while k < flight.len() {
        let start = k;
        while k < flight.len() && same(stream, k) {
            k += 1;
        }
        // Most of the witness's samples differ: the log goes on, and the craft with it.
        if k - start >= longest && (start..k).filter(|&k| !same(witness, k)).count() * 2 > k - start {
            runs.push(start..k);
        }
        k += 1;
    }
    runs
}

/// Columns that never change though the craft moves: motors, and sensors that were not logged.
fn dead_columns(flight: &Flight) -> Vec<String> {
    let moves = |column: Column| {
        let values = flight.required(column);
        values.windows(2).filter(|w| w[0].is_finite() && w[1].is_finite() && w[0] != w[1]).count()
    };
    let mut found = Vec::new();
    for (stream, advice) in [
        (
            &COMMANDS[..],
            "while other commands do: a stuck motor, or a column with another signal; correct the log",
        ),
        (&POSE, "though the craft moves: not logged, or a dead sensor; a model needs it"),
        (&GYRO, "though the craft moves: not logged, or a dead sensor; a model needs it"),
    ] {
        let most = stream.iter().map(|&c| moves(c)).max().unwrap_or(0);
        let stands_in = |c: Column| flight.stand_ins().iter().any(|what| what.columns().contains(&c));
        let dead = stream.iter().filter(|&&c| moves(c) == 0 && most > flight.len() / 20 && !stands_in(c));
        found.extend(dead.map(|&c| format!("{} never changes {advice}", COLUMNS[c as usize])));
    }
    found
}

/// Samples after which the tracker is somewhere else.
fn jumps(flight: &Flight, period_s: f64) -> Vec<usize> {
    let t = flight.required(Column::T);
    let position = [Column::X, Column::Y, Column::Z].map(|c| flight.required(c));
    let euler = [Column::Phi, Column::Theta, Column::Psi].map(|c| flight.required(c));
    let gyro = GYRO.map(|c| flight.required(c));
    let at = |columns: &[&[f64]; 3], k: usize| Vector3::from(columns.each_ref().map(|c| c[k]));
    let mut found: Vec<usize> = Vec::new();
    for k in 1..flight.len().saturating_sub(2) {
        let step_s = t[k + 1] - t[k];
        if step_s > flights::GAP_PERIODS * period_s {
            continue;
        }
        // The step between two samples against those before and after it, for equal times.
        let step = |k: usize| (at(&position, k + 1) - at(&position, k)) * (step_s / (t[k + 1] - t[k]));
        let out = (step(k) - step(k - 1)).norm().min((step(k) - step(k + 1)).norm());
        let far = JUMP_M.max(JUMP_M_S2 * step_s * step_s);
        let turned = frames::geodesic_angle_rad(
            &frames::quaternion_from_euler(at(&euler, k)),
            &frames::quaternion_from_euler(at(&euler, k + 1)),
        );
        let seen = at(&gyro, k).norm().max(at(&gyro, k + 1).norm()) * step_s;
        if out > far || turned > JUMP_RAD + 2.0 * seen {
            found.push(k);
        }
    }
    found
}

fn mask_jumps(flight: &mut Flight, jumps: &[usize]) {
    let t = flight.required(Column::T).to_vec();
    let last = flight.len();
    let about = |k: usize| k.saturating_sub(ABOUT_JUMP - 1)..(k + 1 + ABOUT_JUMP).min(last);
    for &k in jumps {
        mask(flight, &POSE, about(k));
    }
    for pair in jumps.windows(2) {
        if t[pair[1]] - t[pair[0]] < EXCURSION_S {
            mask(flight, &POSE, pair[0] + 1..pair[1] + 1);
        }
    }
}

fn saturated(flight: &Flight, vehicle: &Vehicle) -> Vec<String> {
    let [low, high] = vehicle.motors.command_range;
    let slack = 1e-3 * (high - low);
    let mut found = Vec::new();
    for (end, at_end) in [
        ("largest", Box::new(|v: f64| v >= high - slack) as Box<dyn Fn(f64) -> bool>),
        ("smallest", Box::new(|v| v <= low + slack)),
    ] {
        let shares: Vec<(Column, f64)> = COMMANDS
            .into_iter()
            .map(|c| {
                let values = flight.required(c);
                let count = values.iter().filter(|v| at_end(**v)).count();
                (c, count as f64 / values.len().max(1) as f64)
            })
            .filter(|(_, share)| *share > SATURATED)
            .collect();
        if shares.is_empty() {
            continue;
        }
        let list: Vec<String> = shares
            .iter()
            .map(|(c, share)| {
                format!("{} in {} % of the samples", COLUMNS[*c as usize], fixed(100.0 * share, 0))
            })
            .collect();
        found.push(format!(
            "commands are at the {end} value of command_range: {}; the motors may deliver less than commanded there; cut \
             the log to the flight itself or fly more gently",
            list.join(", ")
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Row, flight};

    fn waving(samples: usize, edit: impl Fn(f64, &mut Row)) -> Flight {
        flight(samples, |t, row| {
            row.wave();
            // Commands of a craft that is flown.
            row.command = std::array::from_fn(|i| 1600.0 + 30.0 * (3.0 * t + i as f64).sin());
            edit(t, row);
        })
    }

    fn said(lies: &[Lie]) -> Vec<&str> {
        lies.iter().map(|lie| lie.sentence.as_str()).collect()
    }

    fn masked(found: &Channels, column: Column) -> Vec<usize> {
        let values = found.masked.as_ref().unwrap().required(column);
        (0..values.len()).filter(|&k| values[k].is_nan()).collect()
    }

    #[test]
    fn a_flight_that_waves_has_no_fault() {
        let found = check(&waving(400, |_, _| {}), &Vehicle::thesis());
        assert_eq!(found, Channels::default());
    }

    /// The pose of sample 100 is repeated up to sample 130: thirty samples lie.
    #[test]
    fn a_frozen_tracker_is_left_out_from_its_first_repeated_sample_on() {
        let flight = waving(400, |t, row| {
            if (1.005..1.305).contains(&t) {
                let mut then = Row::hover(1.0);
                then.wave();
                (row.position_ned_m, row.euler_rad) = (then.position_ned_m, then.euler_rad);
            }
        });
        let found = check(&flight, &Vehicle::thesis());
        assert_eq!(
            said(&found.frozen),
            ["the tracker (x, y, z, phi, theta, psi) repeats its values once for 0.30 s in all, first at \
                 t = 1.01 s: these 30 samples are left out"]
        );
        let [[from_s, to_s]] = found.frozen[0].places_s[..] else { panic!("one place") };
        assert!((from_s - 1.01).abs() < 1e-9 && (to_s - 1.30).abs() < 1e-9, "{from_s} to {to_s}");
        let samples = masked(&found, Column::Theta);
        assert!((101..131).all(|k| samples.contains(&k)), "{samples:?}");
        assert!(!samples.contains(&100) && masked(&found, Column::P).is_empty());
    }

    #[test]
    fn a_craft_at_rest_and_a_short_repetition_are_not_frozen() {
        let at_rest = check(&flight(300, |_, _| {}), &Vehicle::thesis());
        assert_eq!((at_rest.frozen, at_rest.masked), (Vec::new(), None));
        // Eleven repeated samples of the gyro; from twelve, 0.12 s, it counts as frozen.
        for (repeated, count) in [(11, 0), (12, 1)] {
            let flight = waving(300, |t, row| {
                if (1.005..1.005 + 0.01 * f64::from(repeated)).contains(&t) {
                    let mut then = Row::hover(1.0);
                    then.wave();
                    row.rate_rad_s = then.rate_rad_s;
                }
            });
            assert_eq!(check(&flight, &Vehicle::thesis()).frozen.len(), count, "{repeated}");
        }
    }

    #[test]
    fn a_lost_marker_is_left_out_until_it_is_found_again() {
        let flight = waving(400, |t, row| {
            if (1.995..2.295).contains(&t) {
                row.position_ned_m[1] += 0.5;
            }
        });
        let found = check(&flight, &Vehicle::thesis());
        assert_eq!(
            said(&found.jumps),
            [
                "the tracker jumps as no craft can fly, 2 times, first at t = 1.99 s (lost or swapped markers?): samples around the jumps are left out"
            ]
        );
        let places: Vec<i64> =
            found.jumps[0].places_s.iter().flatten().map(|t| (100.0 * t).round() as i64).collect();
        assert_eq!(places, [199, 200, 229, 230]);
        let samples = masked(&found, Column::Y);
        // One sample before the jump, all of the excursion, and two after it.
        assert_eq!(samples, (198..232).collect::<Vec<_>>());
    }

    #[test]
    fn corrections_of_an_estimator_are_told_and_kept() {
        let mut flight = waving(400, |t, row| {
            if t > 1.995 {
                row.position_ned_m[1] += 0.5;
            }
        });
        for column in [Column::Vx, Column::Vy, Column::Vz] {
            flight.replace(column, vec![0.1; 400]);
        }
        let found = check(&flight, &Vehicle::thesis());
        assert!(found.jumps_kept && found.masked.is_none());
        assert_eq!(
            said(&found.jumps),
            ["the position or attitude estimate jumps as no craft can fly, once, first at t = 1.99 s \
                 (corrections by an estimator?): velocities are logged, so these samples are kept"]
        );
    }

    #[test]
    fn a_tracker_that_always_jumps_is_left_to_other_checks() {
        // In millimetres every step is one.
        let flight = waving(400, |_, row| row.position_ned_m = row.position_ned_m.map(|x| 1e3 * x));
        let found = check(&flight, &Vehicle::thesis());
        assert_eq!((found.jumps, found.masked), (Vec::new(), None));
    }

    #[test]
    fn a_command_that_never_moves_is_named_while_others_do() {
        let found = check(&waving(400, |_, row| row.command[2] = 1500.0), &Vehicle::thesis());
        assert_eq!(
            said(&found.frozen),
            [
                "cmd3 never changes while other commands do: a stuck motor, or a column with another signal; correct the log"
            ]
        );
        let all_still = check(&waving(400, |_, row| row.command = [1500.0; 4]), &Vehicle::thesis());
        assert!(all_still.frozen.is_empty());
    }

    #[test]
    fn commands_at_an_end_of_their_range_are_told_from_one_in_twenty_on() {
        let at_top = |count: usize| {
            let flight = waving(100, |t, row| {
                if t < 0.01 * count as f64 - 0.005 {
                    row.command[1] = 2000.0;
                }
            });
            check(&flight, &Vehicle::thesis()).saturated
        };
        assert!(at_top(5).is_empty());
        assert_eq!(
            said(&at_top(6)),
            [
                "commands are at the largest value of command_range: cmd2 in 6 % of the samples; the motors may deliver less than commanded there; cut the log to the flight itself or fly more gently"
            ]
        );
    }
}
