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
const COMMANDS: [Column; 4] = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];

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

/// What a flight's channels do, in sentences, and the flight without the samples that lie.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Channels {
    /// Streams that froze.
    pub frozen: Vec<String>,
    /// Jumps of the tracker.
    pub jumps: Vec<String>,
    /// Whether jumps were told only.
    pub jumps_kept: bool,
    /// Commands at their ends.
    pub saturated: Vec<String>,
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
        found.frozen.push(format!(
            "{name} repeats its values {} for {} s in all, first at t = {} s: these {samples} samples are left out",
            times(runs.len()),
            fixed(samples as f64 * period_s, 2),
            fixed(t[runs[0].start], 2)
        ));
        for run in runs {
            mask(&mut masked, stream, run);
        }
    }
    found.frozen.extend(dead_columns(flight));
    let jumps = jumps(&masked, period_s);
    // A tracker that always jumps is one in other units or axes, which other checks name.
    let always = jumps.len() as f64 > MOST_JUMPS * flight.len() as f64;
    if let Some(first) = jumps.first().filter(|_| !always) {
        // A logged velocity is the target then, and the position beside it an estimate that was corrected.
        let kept = flight.group([Column::Vx, Column::Vy, Column::Vz]).is_some();
        let (what, done) = if kept {
            (
                "position or attitude estimate",
                "(corrections of an estimator?): velocities are logged, so these samples are kept",
            )
        } else {
            ("tracker", "(lost or exchanged markers?): samples about the jumps are left out")
        };
        let place = format!("{}, first at t = {} s", times(jumps.len()), fixed(t[*first], 2));
        found.jumps.push(format!("the {what} jumps as no craft flies {place} {done}"));
        found.jumps_kept = kept;
        if !kept {
            mask_jumps(&mut masked, &jumps);
        }
    }
    found.saturated = saturated(flight, vehicle);
    let is_masked = POSE.iter().chain(&GYRO).any(|&c| missing(&masked, c) != missing(flight, c));
    found.masked = is_masked.then_some(masked);
    found
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
            "while other commands do: a stuck motor, or the column of another signal; mend the log",
        ),
        (&POSE, "though the craft moves: not logged, or a dead sensor; a model cannot do without it"),
        (&GYRO, "though the craft moves: not logged, or a dead sensor; a model cannot do without it"),
    ] {
        let most = stream.iter().map(|&c| moves(c)).max().unwrap_or(0);
        let dead = stream.iter().filter(|&&c| moves(c) == 0 && most > flight.len() / 20);
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
        if step_s > 3.5 * period_s {
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
            "commands are at the {end} value of command_range: {}; motors may give less than asked there, so cut the log to \
             the flight itself or fly more gently",
            list.join(", ")
        ));
    }
    found
}
