//! What is commanded when.

use std::f64::consts::PI;

use control::{Command, Mode};
use pattern::Pattern;
use rand::RngExt;

use pattern::random::{Purpose, stream};

/// The quantity that steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepAxis {
    /// Roll phi, rad.
    Roll,
    /// Pitch theta, rad.
    Pitch,
    /// Yaw psi, rad.
    Yaw,
    /// Inertial z (down), m.
    Z,
    /// Inertial x, m, in position mode.
    X,
    /// Inertial y, m, in position mode.
    Y,
}

/// A step of one commanded quantity from where the craft starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepCommand {
    /// What steps.
    pub axis: StepAxis,
    /// By how much, rad or m.
    pub size: f64,
    /// When, s.
    pub at_s: f64,
}

/// Where to be from a time on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// From when on, s.
    pub from_s: f64,
    /// Where, inertial NED, m.
    pub position_m: [f64; 3],
    /// Heading, rad.
    pub yaw_rad: f64,
}

/// What is commanded when.
#[derive(Debug, Clone, PartialEq)]
pub enum Script {
    /// Level, at the height and heading of the start.
    Hold,
    /// One step; position is held where the axis is X or Y, attitude level otherwise.
    Step(StepCommand),
    /// Way-points in position mode, in order of time; with `repeat_s` the list starts over after
    /// that time.
    Waypoints {
        /// The list.
        list: Vec<Waypoint>,
        /// Length of one round, s.
        repeat_s: Option<f64>,
    },
    /// A pattern file, with what it adds to the motors.
    Pattern(Pattern),
}

/// Start of a flight: the rest that commands are relative to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Start {
    pub(crate) position_m: [f64; 3],
    pub(crate) yaw_rad: f64,
}

/// Times are compared with this margin, so that a time computed as `k Ts` meets one written as a
/// decimal, s.
const SAME_TIME_S: f64 = 1e-9;

impl Script {
    /// The command at `time_s`.
    #[inline]
    pub(crate) fn command(&self, start: &Start, time_s: f64) -> Command {
        match self {
            Self::Hold => level(start),
            Self::Step(step) => stepped(start, step, time_s + SAME_TIME_S >= step.at_s),
            Self::Waypoints { list, repeat_s } => {
                let time_s = repeat_s.map_or(time_s, |round_s| (time_s + SAME_TIME_S) % round_s);
                let passed = list.partition_point(|w| w.from_s <= time_s + SAME_TIME_S);
                let waypoint = passed.checked_sub(1).and_then(|last| list.get(last));
                let (position_m, yaw_rad) =
                    waypoint.map_or((start.position_m, start.yaw_rad), |w| (w.position_m, w.yaw_rad));
                let [x, y, z] = position_m.map(|v| v as f32);
                let base = Command { yaw_rad: yaw_rad as f32, z_m: z, ..Command::default() };
                Command { mode: Mode::Position, position_m: [x, y], ..base }
            }
            Self::Pattern(pattern) => command_of(&pattern.at(time_s)),
        }
    }

    /// The script as rows of a pattern every `period_s`, with `injection` added to the motors. The
    /// start is where a flight begins: `start_m`, inertial NED, m, and heading, rad.
    pub fn rows(
        &self,
        (start_m, start_yaw_rad): ([f64; 3], f64),
        period_s: f64,
        duration_s: f64,
        mut injection: impl FnMut(f64) -> [f64; 4],
    ) -> Vec<pattern::Row> {
        let start = Start { position_m: start_m, yaw_rad: start_yaw_rad };
        let ticks = (duration_s / period_s).round() as u32;
        let row = |tick: u32| {
            let t_s = (f64::from(tick) * period_s * 1e8).round() / 1e8;
            let added = if tick < ticks { injection(t_s) } else { [0.0; 4] };
            row_of(t_s, &self.command(&start, t_s), added)
        };
        (0..=ticks).map(row).collect()
    }

    /// A different tour of the cage for every seed, for identification flights: long dashes along x
    /// and y at up to 2 to 3 m/s, turns, climbs and descents between 0.6 m and 1.7 m, and slow
    /// passes low over the floor.
    pub fn tour(seed: u64, duration_s: f64) -> Self {
        let mut generator = stream(seed, Purpose::Waypoints);
        let mut list = Vec::new();
        let (mut time_s, mut yaw_rad, mut side) = (1.0, 0.0, 1.0_f64);
        let mut round = generator.random_range(0..4);
        while time_s < duration_s {
            let mut between = |low: f64, high: f64| generator.random_range(low..high);
            let (x, y, z, turn, leg_s) = match round % 4 {
                // A dash along x, one along y, a turn while the craft crosses, a pass low over the
                // floor.
                0 => {
                    (side * between(1.0, 1.6), between(-0.4, 0.4), between(0.6, 1.7), 0.0, between(1.6, 2.4))
                }
                1 => {
                    (between(-0.5, 0.5), side * between(0.6, 1.0), between(0.6, 1.7), 0.0, between(1.6, 2.4))
                }
                2 => {
                    let turn = between(0.3, 1.0) * PI * if between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
                    (
                        -side * between(0.8, 1.5),
                        between(-0.8, 0.8),
                        between(0.7, 1.4),
                        turn,
                        between(1.8, 2.6),
                    )
                }
                _ => (
                    side * between(0.2, 0.9),
                    between(-0.4, 0.4),
                    between(0.15, 0.24),
                    0.0,
                    between(2.8, 3.6),
                ),
            };
            yaw_rad += turn;
            side = -side;
            list.push(Waypoint { from_s: time_s, position_m: [x, y, -z], yaw_rad });
            time_s += leg_s;
            round += 1;
        }
        Self::Waypoints { list, repeat_s: None }
    }
}

fn command_of(row: &pattern::Row) -> Command {
    let [roll, pitch, yaw] = row.attitude_rad.map(|v| v as f32);
    let [x, y, z] = row.position_m.map(|v| v as f32);
    Command {
        mode: match row.mode {
            pattern::Mode::Attitude => Mode::Attitude,
            pattern::Mode::Position => Mode::Position,
        },
        attitude_rad: [roll, pitch],
        yaw_rad: yaw,
        z_m: z,
        position_m: [x, y],
        injection: row.injection.map(|v| v as f32),
        ..Command::default()
    }
}

fn row_of(t_s: f64, command: &Command, injection: [f64; 4]) -> pattern::Row {
    let ([roll, pitch], [x, y]) = (command.attitude_rad.map(f64::from), command.position_m.map(f64::from));
    pattern::Row {
        t_s,
        mode: match command.mode {
            Mode::Attitude => pattern::Mode::Attitude,
            Mode::Position => pattern::Mode::Position,
        },
        attitude_rad: [roll, pitch, f64::from(command.yaw_rad)],
        position_m: [x, y, f64::from(command.z_m)],
        injection,
    }
}

fn level(start: &Start) -> Command {
    let [x, y, z] = start.position_m.map(|v| v as f32);
    Command { yaw_rad: start.yaw_rad as f32, z_m: z, position_m: [x, y], ..Command::default() }
}

fn stepped(start: &Start, step: &StepCommand, now: bool) -> Command {
    let mut command = level(start);
    let add = |start: f64| if now { (start + step.size) as f32 } else { start as f32 };
    let [x, y, z] = start.position_m;
    match step.axis {
        StepAxis::Roll => command.attitude_rad[0] = add(0.0),
        StepAxis::Pitch => command.attitude_rad[1] = add(0.0),
        StepAxis::Yaw => command.yaw_rad = add(start.yaw_rad),
        StepAxis::Z => command.z_m = add(z),
        StepAxis::X => (command.mode, command.position_m[0]) = (Mode::Position, add(x)),
        StepAxis::Y => (command.mode, command.position_m[1]) = (Mode::Position, add(y)),
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: Start = Start { position_m: [0.5, -0.5, -1.0], yaw_rad: 0.1 };

    #[test]
    fn a_step_comes_exactly_at_its_tick() {
        for axis in [StepAxis::Roll, StepAxis::Pitch, StepAxis::Yaw, StepAxis::Z, StepAxis::X, StepAxis::Y] {
            let script = Script::Step(StepCommand { axis, size: 0.25, at_s: 1.0 });
            let command = |tick: u32| script.command(&START, f64::from(tick) * 0.01);
            assert_eq!(command(0), command(99), "{axis:?}");
            assert_ne!(command(99), command(100), "{axis:?}");
            assert_eq!(command(100), command(4000), "{axis:?}");
            let position_mode = matches!(axis, StepAxis::X | StepAxis::Y);
            assert_eq!(command(0).mode == Mode::Position, position_mode, "{axis:?}");
        }
        let x = Script::Step(StepCommand { axis: StepAxis::X, size: 1.0, at_s: 1.0 });
        assert_eq!(x.command(&START, 2.0).position_m, [1.5, -0.5]);
    }

    #[test]
    fn way_points_hold_and_repeat() {
        let at = |from_s, x| Waypoint { from_s, position_m: [x, 0.0, -1.0], yaw_rad: 0.0 };
        let script = Script::Waypoints { list: vec![at(1.0, 1.0), at(2.0, 2.0)], repeat_s: Some(3.0) };
        let x = |time_s| script.command(&START, time_s).position_m[0];
        assert_eq!([x(0.0), x(0.99), x(1.0), x(1.99), x(2.0), x(2.99)], [0.5, 0.5, 1.0, 1.0, 2.0, 2.0]);
        assert_eq!([x(3.0), x(4.0), x(5.5)], [0.5, 1.0, 2.0]);
    }

    /// A tour and its pattern file command the same, to the millionth that is written.
    #[test]
    fn a_script_reads_back_from_its_pattern() {
        let tour = Script::tour(3, 20.0);
        let rows = tour.rows((START.position_m, START.yaw_rad), 0.01, 20.0, |t_s| [t_s, -t_s, 0.5, 0.0]);
        let text = Pattern::new(rows, std::path::Path::new("p.csv")).unwrap().to_csv();
        let back = Script::Pattern(Pattern::parse(text.as_bytes(), std::path::Path::new("p.csv")).unwrap());
        for tick in 0..2000 {
            let time_s = f64::from(tick) * 0.01;
            let (one, two) = (tour.command(&START, time_s), back.command(&START, time_s));
            assert_eq!(one.mode, two.mode);
            let close = |a: f32, b: f32| (a - b).abs() < 1e-6;
            assert!(close(one.z_m, two.z_m) && close(one.yaw_rad, two.yaw_rad), "{tick}");
            assert!((0..2).all(|k| close(one.position_m[k], two.position_m[k])), "{tick}");
            assert!((f64::from(two.injection[0]) - time_s).abs() < 2e-6 && two.injection[2] == 0.5, "{tick}");
        }
    }

    #[test]
    fn tours_differ_and_go_everywhere() {
        let points = |seed| match Script::tour(seed, 60.0) {
            Script::Waypoints { list, .. } => list,
            other => panic!("{other:?}"),
        };
        for seed in 0..20 {
            let list = points(seed);
            assert_ne!(list, points(seed + 1), "seed {seed}");
            let heights: Vec<f64> = list.iter().map(|w| -w.position_m[2]).collect();
            let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
            let highest = heights.iter().copied().fold(0.0, f64::max);
            assert!((0.15..0.25).contains(&lowest) && highest > 1.2, "seed {seed}: {lowest} to {highest} m");
            let yaw: Vec<f64> = list.iter().map(|w| w.yaw_rad).collect();
            assert!(yaw.windows(2).any(|w| (w[1] - w[0]).abs() > 0.9), "seed {seed}: no turn");
        }
    }
}
