//! Motor commands: ROS has no message for them. An array of four numbers on a topic that is named after
//! motors is taken, and which motor is which is found from how the craft turns.
//!
//! Each motor's thrust turns the craft about its front and right axes with its own pair of signs:
//! front-left (+, +), front-right (-, +), rear-right (-, -), rear-left (+, -). In steady flight these
//! are seen in the controller, which asks less of a motor the faster the craft turns the way that it
//! turns it: least squares of each command on rates and tilt. In lively flight they are seen in the
//! craft: least squares of the angular acceleration on the four commands some ten milliseconds before.

use super::super::common::series::interpolate;
use super::bag::{Bag, Topic};
use crate::recording::{Recording, Signal};

/// Fields of arrays of commands in messages that are used for it.
const ARRAYS: [&str; 4] = ["data", "normalized", "velocity", "angular_velocities"];
/// Grid on which accelerations are compared with commands, s.
const STEP_S: f64 = 0.01;
/// Rows of the grid over which both are averaged.
const WINDOW: usize = 9;
/// Longest time from a command to its acceleration, in rows of the grid.
const MOST_LAG: usize = 16;
/// Fewest rows that a fit is made of.
const FEWEST: f64 = 500.0;
/// Longest gap that is bridged, s.
const LONGEST_GAP_S: f64 = 0.1;
/// Share of the largest coefficient below which a sign is not certain.
const CERTAIN: f64 = 0.2;
/// Share of the accelerations that the commands have to explain.
const LEAST_R2: f64 = 0.2;
/// Signs of front-left, front-right, rear-right, rear-left on roll and pitch.
const SIGNS: [[bool; 2]; 4] = [[true, true], [false, true], [false, false], [true, false]];

/// Whether a topic has motors in its name.
pub(super) fn is_named_so(topic: &Topic<'_>) -> bool {
    let last = topic.table.name.rsplit('/').next().unwrap_or("").to_lowercase();
    ["motor", "rotor", "actuator", "pwm"].iter().any(|name| last.contains(name))
}

/// Finds the commands of the craft, or says why there are none.
pub(super) fn commands(recording: &mut Recording, bag: &Bag<'_>, namespace: &str) {
    let array = |topic: &Topic<'_>| {
        ARRAYS.iter().find_map(|array| {
            let is_four = topic.table.column(&format!("{array}[4]")).is_none();
            let signal = is_four.then(|| topic.signal([0, 1, 2, 3].map(|k| format!("{array}[{k}]"))))??;
            Some((signal, topic.note.clone()))
        })
    };
    let named = |topic: &&Topic<'_>| is_named_so(topic);
    let mut own = bag.topics.iter().filter(|topic| topic.namespace() == namespace).filter(named);
    let found = own.find_map(array).or_else(|| bag.topics.iter().filter(named).find_map(array));
    let Some((mut signal, note)) = found else {
        let topics: Vec<&str> = bag.topics.iter().map(|topic| topic.table.name.as_str()).collect();
        recording.limits.push(format!(
            "no motor commands, for which ROS has no message: record a std_msgs/Float32MultiArray of four \
             named .../motors; topics are {}",
            crate::error::plain_list(&topics)
        ));
        return;
    };
    recording.notes.extend(note);
    let source = crate::error::plain_list(&[&signal.source]);
    match recording
        .signals
        .rates
        .as_ref()
        .and_then(|rates| order(&signal, rates, recording.signals.attitude.as_ref()))
    {
        Some(order) => {
            let [a, b, c, d] = order;
            signal.values = order.map(|number| std::mem::take(&mut signal.values[number]));
            recording.notes.push(format!(
                "{source}: front-left, front-right, rear-right, rear-left are elements {a}, {b}, {c}, {d}, \
                 by how the craft turns"
            ));
        }
        None => recording.limits.push(format!(
            "which element of {source} is which motor could not be found: taken as front-left, front-right, \
             rear-right, rear-left"
        )),
    }
    recording.limits.push(format!("{source}: ROS does not say the unit of its numbers"));
    recording.signals.commands = Some(signal);
}

/// Numbers of the elements that are front-left, front-right, rear-right, rear-left.
fn order(commands: &Signal<4>, rates: &Signal<3>, attitude: Option<&Signal<4>>) -> Option<[usize; 4]> {
    let begin = commands.t.first()?.max(*rates.t.first()?);
    let end = commands.t.last()?.min(*rates.t.last()?);
    // A flight of hours says no more than its first minutes.
    let rows = ((end - begin) / STEP_S).clamp(0.0, 30_000.0);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 30000, or NaN, which is 0"
    )]
    let grid: Vec<f64> = (0..rows as u32).map(|k| begin + f64::from(k) * STEP_S).collect();
    let on_grid = |t: &[f64], values: &[f64]| -> Vec<f64> {
        grid.iter().map(|&time| interpolate(t, values, time, LONGEST_GAP_S)).collect()
    };
    let motors = commands.values.each_ref().map(|values| on_grid(&commands.t, values));
    let rates = rates.values.each_ref().map(|values| on_grid(&rates.t, values));
    let tilts = attitude.map(|attitude| [1, 2].map(|part| on_grid(&attitude.t, &attitude.values[part])));
    let signs = tilts.and_then(|tilts| by_feedback(&motors, &rates, tilts));
    places(signs.or_else(|| by_acceleration(&motors, &rates))?)
}

/// Numbers of the motors with the signs of front-left, front-right, rear-right, rear-left.
fn places(signs: [[bool; 2]; 4]) -> Option<[usize; 4]> {
    let mut order = [0; 4];
    for (place, expected) in order.iter_mut().zip(SIGNS) {
        *place = (0..4).find(|&motor| signs[motor] == expected)?;
    }
    Some(order)
}

/// Whether each motor raises roll and pitch: the controller asks less of it the faster the craft turns
/// that way.
fn by_feedback(
    motors: &[Vec<f64>; 4],
    [p, q, r]: &[Vec<f64>; 3],
    [roll, pitch]: [Vec<f64>; 2],
) -> Option<[[bool; 2]; 4]> {
    let causes = [p.clone(), q.clone(), r.clone(), roll, pitch];
    let mut coefficients = [[0.0; 2]; 4];
    for (motor, coefficients) in motors.iter().zip(&mut coefficients) {
        let mean = |k: usize| motors.iter().map(|motor| motor[k]).sum::<f64>() / 4.0;
        let differences: Vec<f64> = motor.iter().enumerate().map(|(k, command)| command - mean(k)).collect();
        let ([on_p, on_q, ..], r2) = fit(&causes, &differences, 0)?;
        if r2 < LEAST_R2 {
            return None;
        }
        *coefficients = [-on_p, -on_q];
    }
    certain_signs(coefficients)
}

/// Whether each motor raises roll and pitch: by the angular acceleration that follows its command.
fn by_acceleration(motors: &[Vec<f64>; 4], rates: &[Vec<f64>; 3]) -> Option<[[bool; 2]; 4]> {
    let motors = motors.each_ref().map(|motor| average(motor));
    let accelerations = [0, 1].map(|axis| slope(&average(&rates[axis])));
    let fits = (0..=MOST_LAG).filter_map(|lag| {
        let [roll, pitch] = [fit(&motors, &accelerations[0], lag)?, fit(&motors, &accelerations[1], lag)?];
        Some((roll.1.min(pitch.1), std::array::from_fn(|motor| [roll.0[motor], pitch.0[motor]])))
    });
    let (r2, coefficients) = fits.max_by(|a, b| a.0.total_cmp(&b.0))?;
    if r2 < LEAST_R2 { None } else { certain_signs(coefficients) }
}

/// Signs of coefficients that are all large enough to have one.
fn certain_signs(coefficients: [[f64; 2]; 4]) -> Option<[[bool; 2]; 4]> {
    let certain = |axis: usize| {
        let largest = coefficients.iter().map(|pair| pair[axis].abs()).fold(0.0, f64::max);
        coefficients.iter().all(|pair| pair[axis].abs() > CERTAIN * largest)
    };
    (certain(0) && certain(1)).then(|| coefficients.map(|pair| pair.map(|coefficient| coefficient > 0.0)))
}

/// Mean over a window; NaN where one of its rows is.
fn average(values: &[f64]) -> Vec<f64> {
    let half = WINDOW / 2;
    let mean = |k: usize| {
        let window = k.checked_sub(half).and_then(|begin| values.get(begin..=k + half));
        window.map_or(f64::NAN, |window| window.iter().sum::<f64>() / WINDOW as f64)
    };
    (0..values.len()).map(mean).collect()
}

/// Slope by the rows before and behind.
fn slope(values: &[f64]) -> Vec<f64> {
    let at = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
    let slope =
        |k: usize| k.checked_sub(1).map_or(f64::NAN, |before| (at(k + 1) - at(before)) / (2.0 * STEP_S));
    (0..values.len()).map(slope).collect()
}

/// Coefficients of causes, so many rows before, on an effect, and the share of it that they explain;
/// means are left out of both.
fn fit<const N: usize>(causes: &[Vec<f64>; N], effect: &[f64], lag: usize) -> Option<([f64; N], f64)> {
    let rows = || {
        (lag..effect.len()).filter_map(|k| {
            let row = causes.each_ref().map(|cause| cause[k - lag]);
            (effect[k].is_finite() && row.iter().all(|x| x.is_finite())).then_some((row, effect[k]))
        })
    };
    let count = rows().count() as f64;
    if count < FEWEST {
        return None;
    }
    let mut mean = ([0.0; N], 0.0);
    for (row, y) in rows() {
        mean.0.iter_mut().zip(row).for_each(|(mean, x)| *mean += x / count);
        mean.1 += y / count;
    }
    let (mut normal, mut right, mut total) = ([[0.0; N]; N], [0.0; N], 0.0);
    for (row, y) in rows() {
        let x: [f64; N] = std::array::from_fn(|k| row[k] - mean.0[k]);
        let y = y - mean.1;
        for i in 0..N {
            (0..N).for_each(|j| normal[i][j] += x[i] * x[j]);
            right[i] += x[i] * y;
        }
        total += y * y;
    }
    let coefficients = solve(normal, right)?;
    let explained: f64 = coefficients.iter().zip(right).map(|(c, r)| c * r).sum();
    (total > 0.0).then_some((coefficients, explained / total))
}

/// Solves symmetric positive definite equations by elimination; nothing if they are nearly singular.
fn solve<const N: usize>(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> Option<[f64; N]> {
    let diagonal: [f64; N] = std::array::from_fn(|k| matrix[k][k]);
    for pivot in 0..N {
        let (above, below) = matrix.split_at_mut(pivot + 1);
        let pivot_row = &above[pivot];
        if !(pivot_row[pivot] > 1e-9 * diagonal[pivot]) {
            return None;
        }
        let (solved, rest) = right.split_at_mut(pivot + 1);
        for (row, value) in below.iter_mut().zip(rest) {
            let factor = row[pivot] / pivot_row[pivot];
            row.iter_mut().zip(pivot_row).for_each(|(part, known)| *part -= factor * known);
            *value -= factor * solved[pivot];
        }
    }
    for row in (0..N).rev() {
        let known: f64 = (row + 1..N).map(|column| matrix[row][column] * right[column]).sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four commands that change on their own; elements 2, 0, 3, 1 are front-left, front-right,
    /// rear-right, rear-left.
    #[test]
    fn the_order_is_found_from_how_the_craft_turns() {
        let t: Vec<f64> = (0..4000).map(|k| f64::from(k) * 0.005).collect();
        let wave = |time: f64, k: f64| (2.0 * time * (1.0 + 0.37 * k) + k).sin();
        let place = [1, 3, 0, 2];
        let signs = |k: usize| SIGNS[place[k]].map(|positive| if positive { 1.0 } else { -1.0 });
        let values: [Vec<f64>; 4] =
            std::array::from_fn(|k| t.iter().map(|time| wave(*time, k as f64)).collect());
        let mut rates = [vec![0.0], vec![0.0], vec![0.0; t.len()]];
        for row in 1..t.len() {
            for (axis, rate) in rates.iter_mut().take(2).enumerate() {
                let acceleration: f64 = (0..4).map(|k| 20.0 * signs(k)[axis] * values[k][row - 1]).sum();
                rate.push(rate[row - 1] + acceleration * 0.005);
            }
        }
        let commands = Signal { source: String::new(), t: t.clone(), values };
        let rates = Signal { source: String::new(), t, values: rates };
        assert_eq!(order(&commands, &rates, None), Some([2, 0, 3, 1]));
        // Commands that all move together say nothing.
        let same = Signal { values: std::array::from_fn(|_| commands.values[0].clone()), ..commands };
        assert_eq!(order(&same, &rates, None), None);
    }

    #[test]
    fn equations_are_solved() {
        let matrix = [[4.0, 1.0, 0.0, 0.0], [1.0, 3.0, 1.0, 0.0], [0.0, 1.0, 2.0, 0.5], [0.0, 0.0, 0.5, 1.0]];
        let x = [1.0, -2.0, 3.0, 4.0];
        let right = std::array::from_fn(|i| (0..4).map(|j| matrix[i][j] * x[j]).sum());
        let solved = solve(matrix, right).unwrap();
        assert!(solved.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-12), "{solved:?}");
        assert_eq!(solve([[1.0; 4]; 4], [1.0; 4]), None);
    }

    /// On flights whose motors are known: right, or nothing.
    #[test]
    fn the_order_of_known_motors() {
        let mut found = 0;
        for name in [
            "crazyflie_log203.parquet",
            "crazyflie_sd_load_log201",
            "crazyflie_sd_old",
            "crazyflie_sd_two_events",
            "crazyflie_sd_log10",
            "crazyflie_sd_log16",
        ] {
            let path =
                std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/logs").join(name);
            let Ok(bytes) = std::fs::read(&path) else {
                println!("SKIPPED: {} is not there", path.display());
                return;
            };
            let signals =
                crate::record(&crate::decode(&bytes, &path).unwrap(), &path).unwrap().remove(0).signals;
            let order = order(&signals.commands.unwrap(), &signals.rates.unwrap(), signals.attitude.as_ref());
            println!("{name} {order:?}");
            assert!(order.is_none_or(|order| order == [0, 1, 2, 3]), "{name}: {order:?}");
            found += usize::from(order.is_some());
        }
        assert!(found >= 3, "{found}");
    }
}
