//! Commands that are logged in coarse steps.
//!
//! A logger that rounds what the motors are told hides up to half a step from the model. Where a step is a noticeable part of a
//! motor's thrust, the craft's answers to what was rounded away look like unknown moments that depend on nothing.

use flights::{Column, Flight};
use model::{RotorMap, Vehicle};
use report::number::{fixed, significant};

use crate::checks::bench::SPEEDS;
use crate::checks::channels::COMMANDS;
use crate::statistics::{mean, median};

/// Part of a motor's thrust that a step must be worth: less than that is hidden by the noise of good sensors.
const MATTERS: f64 = 0.02;
/// Levels of a command at least, so that steps are told from a few chosen values, ...
const FEWEST_LEVELS: usize = 5;
/// ... and at most: of finer ones no step matters.
const MOST_LEVELS: usize = 1000;
/// Part of a step by which levels may be off the even ladder: a text has a few digits.
const EVEN: f64 = 0.02;

/// What to say where the commands are logged in steps that matter. Where rotor speeds were measured they do not.
pub fn check(flight: &Flight, vehicle: &Vehicle) -> Option<String> {
    if flight.group(SPEEDS).is_some() {
        return None;
    }
    let battery_v =
        mean(&flight.required(Column::Vbat).iter().copied().filter(|v| v.is_finite()).collect::<Vec<_>>());
    let map = vehicle.has_rotor_map().then(|| vehicle.rotor_map());
    let mut coarsest: Option<(f64, f64)> = None;
    for column in COMMANDS {
        let commands = flight.required(column);
        let Some(step) = step(commands) else { continue };
        let part = part_of_thrust(&mut commands.to_vec(), step, map.as_ref(), battery_v);
        if part > coarsest.map_or(MATTERS, |(_, part)| part) {
            coarsest = Some((step, part));
        }
    }
    let (step, part) = coarsest?;
    let unit = &vehicle.motors.command_unit;
    Some(format!(
        "the motor commands are logged in steps of {} {unit}, each {} % of a motor's thrust: where the motors were given finer commands, \
         what was rounded away leaves roll, pitch and yaw unexplained; log the commands as they are sent",
        significant(step, 3),
        fixed(100.0 * part, 1)
    ))
}

/// The step of the ladder that all values stand on; nothing where there is none, or one that is too fine to matter.
fn step(values: &[f64]) -> Option<f64> {
    let mut levels: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    levels.sort_unstable_by(f64::total_cmp);
    levels.dedup();
    if !(FEWEST_LEVELS..=MOST_LEVELS).contains(&levels.len()) {
        return None;
    }
    let gaps = || levels.windows(2).map(|pair| pair[1] - pair[0]);
    let step = gaps().fold(f64::INFINITY, f64::min);
    let is_even = |gap: f64| (gap / step - (gap / step).round()).abs() < EVEN;
    gaps().all(is_even).then_some(step)
}

/// What a step changes of a motor's thrust, as a part of it, about the middle of its commands.
fn part_of_thrust(commands: &mut Vec<f64>, step: f64, map: Option<&RotorMap>, battery_v: f64) -> f64 {
    commands.retain(|command| command.is_finite());
    let Some(command) = median(commands) else { return 0.0 };
    // Without a map the command stands for the speed.
    let speed = |command: f64| map.map_or(command.abs(), |map| map.speed_rad_s(command, battery_v));
    let (below, above) = (speed(command - 0.5 * step), speed(command + 0.5 * step));
    let middle = 0.5 * (below + above);
    if middle > 0.0 { 2.0 * (above - below).abs() / middle } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn logged_in_steps_of(step_us: f64) -> Option<String> {
        let model = truth();
        let mut flight = fly(&model, 1, 20.0, &NONE);
        for column in COMMANDS {
            let rounded = flight.required(column).iter().map(|command| (command / step_us).round() * step_us);
            flight.replace(column, rounded.collect());
        }
        check(&flight, &model.vehicle)
    }

    /// Of the thesis' map, 1 us is worth 1.28 rad/s, and about 0.4 % of the thrust at some 630 rad/s.
    #[test]
    fn steps_that_matter_are_named_with_their_part_of_the_thrust() {
        assert_eq!(logged_in_steps_of(1.0), None);
        assert_eq!(logged_in_steps_of(1e-3), None);
        let told = logged_in_steps_of(16.0).unwrap();
        assert!(told.starts_with("the motor commands are logged in steps of 16.0 us, each "), "{told}");
        let part: f64 = told.split("each ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        let expected = 100.0 * 2.0 * 16.0 * truth().vehicle.motors.command.unwrap() / 630.0;
        assert!((part / expected - 1.0).abs() < 0.1, "{part} {expected}");
    }

    #[test]
    fn a_few_chosen_values_and_a_crooked_ladder_are_no_steps() {
        assert_eq!(step(&[1000.0, 1200.0, 1400.0, 1000.0]), None);
        assert_eq!(step(&[0.0, 1.0, 2.0, 3.0, 4.5, 6.0]), None);
        assert_eq!(step(&[0.0, 3.0, 2.0, 5.0, 4.0, f64::NAN]), Some(1.0));
    }
}
