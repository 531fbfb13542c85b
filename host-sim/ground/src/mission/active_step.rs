//! The step that a mission is at: its command in each period, and when it is over.

use pattern::{Excitation, Pattern};
use proto::{Command, Mode, Pose, State};

use super::preflight::PreflightHistory;
use super::script::{Axis, MissionStep};
use super::status::{CraftStatus, Progress};

/// How fast a take-off rises, m/s.
const CLIMB_M_S: f64 = 0.5;
/// A place is reached when the craft is this close, m.
const CLOSE_M: f64 = 0.25;
/// How long arming, a change of gains or a disarming may take, s.
const PROMPT_S: f64 = 5.0;
/// How long a take-off, a way to a pattern's start or a landing may take beyond what it should, s.
const PATIENT_S: f64 = 20.0;

/// The command of now, and whether this side has asked the craft to fly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Commanded {
    pub(super) command: Command,
    pub(super) flying: bool,
}

/// A step that has begun.
#[derive(Debug, Clone)]
pub(super) struct ActiveStep {
    pub(super) step: MissionStep,
    started_s: f64,
    /// Command and pose when it began.
    command: Command,
    pose: Pose,
    excitation: Option<Excitation>,
    /// When a pattern really began, after the way to its start.
    pattern_since_s: Option<f64>,
    /// The craft's answer to new gains.
    pub(super) answered: Option<bool>,
    preflight: PreflightHistory,
}

impl ActiveStep {
    /// Begins `step` with this command and the craft at this pose. `excitation` is what a step that
    /// asks for it adds to the motors.
    pub(super) fn new(
        step: MissionStep,
        now_s: f64,
        command: Command,
        pose: Pose,
        excitation: Option<Excitation>,
    ) -> Self {
        Self {
            step,
            started_s: now_s,
            command,
            pose,
            excitation,
            pattern_since_s: None,
            answered: None,
            preflight: PreflightHistory::default(),
        }
    }

    /// One period of the step.
    pub(super) fn advance(&mut self, commanded: &mut Commanded, now_s: f64, craft: &CraftStatus) -> Progress {
        match self.step {
            MissionStep::Arm {} => self.arm(now_s, craft),
            MissionStep::Gains { .. } => self.wait_for_gains(now_s),
            MissionStep::Disarm {} => {
                let disarmed = craft.state == State::Disarmed;
                self.until(disarmed, now_s, PROMPT_S, "the craft does not disarm")
            }
            MissionStep::Cut {} => {
                self.until(craft.state == State::Cut, now_s, PROMPT_S, "the craft does not cut its motors")
            }
            MissionStep::Land {} => self.land(now_s, craft),
            MissionStep::TakeOff { height_m } => self.take_off(height_m, commanded, now_s, craft),
            _ if !matches!(craft.state, State::Flying | State::Hold) => self.failed(&format!(
                "the craft no longer flies, its state is {:?}{}",
                craft.state,
                craft.because()
            )),
            _ => self.fly(&mut commanded.command, now_s, craft),
        }
    }

    /// One period of a step in the air.
    fn fly(&mut self, command: &mut Command, now_s: f64, craft: &CraftStatus) -> Progress {
        let since_s = now_s - self.started_s;
        let lasts = |for_s: f64| if since_s >= for_s { Progress::Done } else { Progress::Going };
        match &self.step {
            MissionStep::Hold { for_s, .. } => {
                if let Some(excitation) = &mut self.excitation {
                    command.injection = excitation.next_sample();
                }
                lasts(*for_s)
            }
            MissionStep::GoTo { x, y, z, yaw, for_s } => {
                *command = moved(&self.command, [*x, *y, *z, *yaw]);
                lasts(*for_s)
            }
            MissionStep::Step { axis, size, for_s } => {
                *command = stepped(&self.command, *axis, *size as f32);
                lasts(*for_s)
            }
            MissionStep::Fly { pattern, times, .. } => {
                let (progress, pattern_since_s) = match self.pattern_since_s {
                    None => self.go_to_start(pattern, command, now_s, craft),
                    begun => {
                        let flown_s = now_s - begun.unwrap_or(now_s);
                        (fly_pattern(pattern, *times, flown_s, self.excitation.as_mut(), command), begun)
                    }
                };
                self.pattern_since_s = pattern_since_s;
                progress
            }
            // The script's reader has replaced it; a pattern that was not read cannot be flown.
            _ => self.failed("its file was not read"),
        }
    }

    fn arm(&mut self, now_s: f64, craft: &CraftStatus) -> Progress {
        self.preflight.look(craft.preflight);
        let armed = !matches!(craft.state, State::Disarmed | State::Cut);
        self.until(armed, now_s, PROMPT_S, &self.preflight.why(craft.state))
    }

    fn wait_for_gains(&self, now_s: f64) -> Progress {
        match self.answered {
            Some(true) => Progress::Done,
            Some(false) => self.failed("the craft refuses them: out of range, or it is not disarmed"),
            None => self.until(false, now_s, PROMPT_S, "no answer"),
        }
    }

    fn land(&self, now_s: f64, craft: &CraftStatus) -> Progress {
        let height_m = f64::from(-self.pose.position_m[2]).max(0.0);
        let within_s = PATIENT_S + height_m / 0.1;
        let down = matches!(craft.state, State::Disarmed | State::Cut);
        self.until(down, now_s, within_s, "it does not come down")
    }

    fn take_off(
        &self,
        height_m: f64,
        commanded: &mut Commanded,
        now_s: f64,
        craft: &CraftStatus,
    ) -> Progress {
        if craft.state == State::Disarmed || craft.state == State::Cut {
            return self.failed(&format!("the craft is not armed{}", craft.because()));
        }
        let [x, y, z] = self.pose.position_m;
        let top_m = f64::from(z) - height_m;
        let z_m = (f64::from(z) - CLIMB_M_S * (now_s - self.started_s)).max(top_m) as f32;
        let [_, _, yaw_rad] = self.pose.attitude_rad;
        commanded.command = Command { position_m: [x, y], z_m, yaw_rad, cut_off: false, ..Command::IDLE };
        commanded.flying = true;
        let left_m = f64::from(craft.pose.position_m[2]) - top_m;
        if craft.state == State::Flying && left_m < CLOSE_M {
            // The craft climbs the rest by itself while the next step begins.
            commanded.command.z_m = top_m as f32;
            return Progress::Done;
        }
        self.until(false, now_s, PATIENT_S + height_m / CLIMB_M_S, "it does not rise")
    }

    /// The way to a pattern's start; gives the time at which the pattern begins, once the craft is
    /// there.
    fn go_to_start(
        &self,
        pattern: &Pattern,
        command: &mut Command,
        now_s: f64,
        craft: &CraftStatus,
    ) -> (Progress, Option<f64>) {
        *command = command_of(&pattern::Row { injection: [0.0; 4], ..pattern.at(0.0) });
        if command.mode == Mode::Attitude || is_close(&craft.pose, command) {
            return (Progress::Going, Some(now_s));
        }
        let why = "it does not come to the pattern's start";
        (self.until(false, now_s, PATIENT_S + 20.0, why), None)
    }

    /// Done once `there`; failed for this reason if that takes longer than `within_s`.
    fn until(&self, there: bool, now_s: f64, within_s: f64, why: &str) -> Progress {
        match (there, now_s - self.started_s > within_s) {
            (true, _) => Progress::Done,
            (false, true) => self.failed(why),
            (false, false) => Progress::Going,
        }
    }

    fn failed(&self, why: &str) -> Progress {
        Progress::Failed(format!("{}: {why}", self.step.describe()))
    }
}

/// One period of a pattern that began `flown_s` ago and is flown so many times.
fn fly_pattern(
    pattern: &Pattern,
    times: u32,
    flown_s: f64,
    excitation: Option<&mut Excitation>,
    command: &mut Command,
) -> Progress {
    let round_s = pattern.duration_s();
    let over = flown_s >= round_s * f64::from(times);
    let row = pattern.at(if over { round_s } else { flown_s % round_s });
    *command = command_of(&row);
    if over {
        return Progress::Done;
    }
    if let Some(excitation) = excitation {
        let added = excitation.next_sample();
        command.injection = std::array::from_fn(|k| command.injection[k] + added[k]);
    }
    Progress::Going
}

/// To this x, y, z and yaw; what is not given stays.
fn moved(before: &Command, [x, y, z, yaw]: [Option<f64>; 4]) -> Command {
    let or = |new: Option<f64>, old: f32| new.map_or(old, |v| v as f32);
    Command {
        mode: Mode::Position,
        position_m: [or(x, before.position_m[0]), or(y, before.position_m[1])],
        z_m: or(z, before.z_m),
        yaw_rad: or(yaw, before.yaw_rad),
        ..*before
    }
}

fn is_close(pose: &Pose, command: &Command) -> bool {
    let [x, y, z] = pose.position_m;
    let away = [x - command.position_m[0], y - command.position_m[1], z - command.z_m];
    f64::from(away.iter().map(|d| d * d).sum::<f32>().sqrt()) < CLOSE_M
}

fn stepped(before: &Command, axis: Axis, size: f32) -> Command {
    let mut command = *before;
    match axis {
        Axis::Roll => (command.mode, command.attitude_rad) = (Mode::Attitude, [size, 0.0]),
        Axis::Pitch => (command.mode, command.attitude_rad) = (Mode::Attitude, [0.0, size]),
        Axis::Yaw => command.yaw_rad += size,
        Axis::X => (command.mode, command.position_m[0]) = (Mode::Position, before.position_m[0] + size),
        Axis::Y => (command.mode, command.position_m[1]) = (Mode::Position, before.position_m[1] + size),
        Axis::Z => command.z_m += size,
    }
    command
}

fn command_of(row: &pattern::Row) -> Command {
    let [roll, pitch, yaw] = row.attitude_rad.map(|v| v as f32);
    let [x, y, z] = row.position_m.map(|v| v as f32);
    let mode = match row.mode {
        pattern::Mode::Attitude => Mode::Attitude,
        pattern::Mode::Position => Mode::Position,
    };
    Command {
        mode,
        attitude_rad: [roll, pitch],
        yaw_rad: yaw,
        z_m: z,
        position_m: [x, y],
        cut_off: false,
        injection: row.injection.map(|v| v as f32),
    }
}
