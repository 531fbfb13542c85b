//! What is asked of the craft when: steps one after the other, from a script file, a pattern or the keyboard.
//!
//! A script is TOML, one `[[step]]` a table:
//!
//! ```toml
//! [[step]]
//! do = "gains"              # of one loop, in the gains file's units; heard while disarmed
//! of = "Roll"
//! kp = 27.0
//! ki = 4.0
//! kd = 8.0
//! [[step]]
//! do = "arm"
//! [[step]]
//! do = "take-off"           # straight up from where it stands
//! height_m = 1.0
//! [[step]]
//! do = "go-to"              # stays where a number is left out
//! x = 0.5
//! z = -1.2                  # north-east-down
//! yaw = 0.0                 # rad
//! for_s = 4.0
//! [[step]]
//! do = "step"               # roll, pitch, yaw in rad; x, y, z in m; from where it is
//! axis = "x"
//! size = 1.0
//! for_s = 8.0
//! [[step]]
//! do = "pattern"            # a pattern file (crate `pattern`), as often as wanted
//! file = "tour.csv"
//! times = 2
//! excite = 7                # seed of thesis 4.2.1's excitation, added to the pattern's own injections
//! [[step]]
//! do = "hold"
//! for_s = 5.0
//! excite = 8
//! [[step]]
//! do = "land"
//! ```
//!
//! `disarm` and `cut` are steps too. Paths are relative to the script. A step that does not come about in time, or a craft that
//! goes another way (its supervisor lands it), ends the mission by name; a flying craft is then landed.
//!
//! Pure: time comes in, commands come out. Before and after flight the command is cut-off; in flight it never is, because a
//! cut-off in the air is a crash.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use control::condition::Conditions;
use control::supervisor::Preflight;
use pattern::{Excitation, Pattern, PatternError};
use proto::{Command, Gains, Loop, Mode, Pose, Request, State};
use serde::Deserialize;

/// How fast a take-off rises, m/s.
const CLIMB_M_S: f64 = 0.5;
/// A place is reached when the craft is this close, m.
const CLOSE_M: f64 = 0.25;
/// How long arming, a change of gains or a disarming may take, s.
const PROMPT_S: f64 = 5.0;
/// How long a take-off, a way to a pattern's start or a landing may take beyond what it should, s.
const PATIENT_S: f64 = 20.0;

/// A quantity that steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "said in the module's head")]
pub enum Axis {
    Roll,
    Pitch,
    Yaw,
    X,
    Y,
    Z,
}

/// One thing to do.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
#[expect(missing_docs, reason = "said in the module's head")]
pub enum Step {
    Gains {
        of: Loop,
        kp: f32,
        ki: f32,
        kd: f32,
    },
    Arm {},
    TakeOff {
        height_m: f64,
    },
    GoTo {
        x: Option<f64>,
        y: Option<f64>,
        z: Option<f64>,
        yaw: Option<f64>,
        for_s: f64,
    },
    Step {
        axis: Axis,
        size: f64,
        for_s: f64,
    },
    Hold {
        for_s: f64,
        excite: Option<u64>,
    },
    #[serde(skip_deserializing)]
    Fly {
        pattern: Box<Pattern>,
        times: u32,
        excite: Option<u64>,
    },
    Pattern {
        file: PathBuf,
        #[serde(default = "once")]
        times: u32,
        excite: Option<u64>,
    },
    Land {},
    Disarm {},
    Cut {},
}

fn once() -> u32 {
    1
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptFile {
    step: Vec<Step>,
}

/// Why a script cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum ScriptError {
    /// The file.
    #[error("{}: {problem}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// A step.
    #[error("{}: step {number}: {problem}", path.display())]
    Step {
        /// The script.
        path: PathBuf,
        /// Which step, from 1.
        number: usize,
        /// What is wrong and how to mend it.
        problem: String,
    },
    /// A pattern file.
    #[error(transparent)]
    Pattern(#[from] PatternError),
}

/// Reads and checks a script and the pattern files that it names.
///
/// # Errors
/// What is wrong: file, step, how to mend it.
pub fn read_script(path: &Path) -> Result<Vec<Step>, ScriptError> {
    let refuse = |problem: String| ScriptError::File { path: path.into(), problem };
    let text = std::fs::read_to_string(path).map_err(|e| refuse(format!("cannot read the script: {e}")))?;
    parse_script(&text, path)
}

/// The same from the file's text.
///
/// # Errors
/// As [`read_script`].
pub fn parse_script(text: &str, path: &Path) -> Result<Vec<Step>, ScriptError> {
    let file: ScriptFile = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(0, |span| text[..span.start].lines().count().max(1));
        ScriptError::File { path: path.into(), problem: format!("line {line}: {}", error.message()) }
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut steps = Vec::new();
    for (k, step) in file.step.into_iter().enumerate() {
        check(&step).map_err(|problem| ScriptError::Step { path: path.into(), number: k + 1, problem })?;
        steps.push(match step {
            Step::Pattern { file, times, excite } => {
                let pattern = Box::new(Pattern::read(&folder.join(file))?);
                Step::Fly { pattern, times, excite }
            }
            other => other,
        });
    }
    Ok(steps)
}

/// Numbers that make no sense for any craft. What this craft may do, its own supervisor knows.
fn check(step: &Step) -> Result<(), String> {
    let within = |name: &str, value: f64, low: f64, high: f64| match value >= low && value <= high {
        true => Ok(()),
        false => Err(format!("{name} is {value}: from {low} to {high}")),
    };
    match *step {
        Step::TakeOff { height_m } => within("height_m", height_m, 0.1, 100.0),
        Step::Hold { for_s, .. } => within("for_s", for_s, 0.0, 3600.0),
        Step::Step { axis, size, for_s } => {
            within("for_s", for_s, 0.0, 3600.0)?;
            let limit = if matches!(axis, Axis::Roll | Axis::Pitch) { 1.05 } else { 100.0 };
            within("size", size, -limit, limit)
        }
        Step::GoTo { x, y, z, yaw, for_s } => {
            within("for_s", for_s, 0.0, 3600.0)?;
            for (name, value) in [("x", x), ("y", y), ("yaw", yaw)] {
                within(name, value.unwrap_or(0.0), -1000.0, 1000.0)?;
            }
            within("z", z.unwrap_or(0.0), -1000.0, 0.0)
        }
        Step::Gains { kp, ki, kd, .. } => [("kp", kp), ("ki", ki), ("kd", kd)]
            .iter()
            .try_for_each(|(n, v)| within(n, f64::from(*v), -1e9, 1e9)),
        Step::Pattern { times, .. } => within("times", f64::from(times), 1.0, 1000.0),
        _ => Ok(()),
    }
}

/// What is known of the craft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// What it is doing.
    pub state: State,
    /// Where it is.
    pub pose: Pose,
    /// Which preflight checks are good, one bit each.
    pub preflight: u16,
    /// What was found in the tick in which it went into this state, one bit each.
    pub found: u32,
}

impl Known {
    /// The faults that brought the craft into its state, for people; nothing if there were none.
    fn because(&self) -> String {
        let faults = Conditions::from_bits(self.found);
        let names: Vec<_> =
            faults.iter().filter(|fault| !fault.is_asked_for()).map(|fault| fault.name()).collect();
        if names.is_empty() { String::new() } else { format!(", because of {}", names.join(", ")) }
    }
}

/// Preflight checks while the craft is asked to arm: what comes and goes is not good either.
#[derive(Debug, Clone, Copy, Default)]
struct Looks {
    count: u32,
    /// How often each was not good, in the order of [`Preflight::NAMES`].
    missing: [u32; Preflight::NAMES.len()],
}

impl Looks {
    fn look(&mut self, preflight: u16) {
        self.count += 1;
        for (missing, (bit, _)) in self.missing.iter_mut().zip(Preflight::NAMES) {
            *missing += u32::from(preflight & bit == 0);
        }
    }

    /// Why it does not arm, for people.
    fn why(&self, state: State) -> String {
        if state == State::Cut {
            return "the craft was cut: disarm it first".into();
        }
        let mut names: Vec<_> =
            self.missing.iter().zip(Preflight::NAMES).filter(|(missing, _)| **missing > 0).collect();
        names.sort_by_key(|(missing, _)| std::cmp::Reverse(*missing));
        let said: Vec<_> = names
            .into_iter()
            .map(|(missing, (_, name))| match 100 * missing / self.count.max(1) {
                100 => name.to_owned(),
                percent => format!("{name} ({} % of the time)", percent.max(1)),
            })
            .collect();
        match said.as_slice() {
            [] => "its checks are good, and it does not arm: do packets get through to it?".into(),
            names => format!("the craft refuses, its checks are not all good: {}", names.join(", ")),
        }
    }
}

/// What is to be sent beside the command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ask {
    /// A request; it is sent again until its state is there.
    Request(Request),
    /// Gains; sent again until they are answered.
    Gains(Gains),
}

/// How the mission goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Progress {
    /// Steps are left.
    Going,
    /// All is done.
    Done,
    /// It came to nothing, for this reason.
    Failed(String),
}

/// A step that has begun.
#[derive(Debug, Clone)]
struct Begun {
    step: Step,
    at_s: f64,
    /// Command and place when it began.
    command: Command,
    place: Pose,
    excitation: Option<Excitation>,
    /// Of a pattern: when it really began, after the way to its start.
    flies_since_s: Option<f64>,
    answered: Option<bool>,
    looks: Looks,
}

/// The steps, and the command of now.
#[derive(Debug, Clone)]
pub struct Mission {
    steps: VecDeque<Step>,
    begun: Option<Begun>,
    command: Command,
    flying: bool,
    progress: Progress,
    period_s: f64,
    /// Command units for one microsecond of the thesis' excitation.
    excitation_gain: f64,
}

impl Mission {
    /// Steps to be flown with a command every `period_s`. `excitation_gain` is command units for one microsecond of PWM.
    pub fn new(steps: impl IntoIterator<Item = Step>, period_s: f64, excitation_gain: f64) -> Self {
        Self {
            steps: steps.into_iter().collect(),
            begun: None,
            command: Command::IDLE,
            flying: false,
            progress: Progress::Going,
            period_s,
            excitation_gain,
        }
    }

    /// Drops what is left and does this instead.
    pub fn instead(&mut self, steps: impl IntoIterator<Item = Step>) {
        self.steps = steps.into_iter().collect();
        self.begun = None;
        self.command.injection = [0.0; 4];
        self.progress = Progress::Going;
    }

    /// How it goes.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Does the craft fly, as far as this side has asked for?
    pub fn is_flying(&self) -> bool {
        self.flying
    }

    /// The step that is being done, for people.
    pub fn describe(&self) -> String {
        match (&self.begun, &self.progress) {
            (_, Progress::Failed(why)) => format!("failed: {why}"),
            (Some(begun), _) => name_of(&begun.step),
            (None, Progress::Done) => "nothing left to do".into(),
            (None, _) => "waiting for the craft".into(),
        }
    }

    /// The craft was found in this state when it was first heard. One that flies already is taken over where it is, not cut.
    pub fn adopt(&mut self, known: &Known) {
        if matches!(known.state, State::Flying | State::Hold | State::Land) {
            let [x, y, z] = known.pose.position_m;
            let [_, _, yaw_rad] = known.pose.attitude_rad;
            self.command = Command { cut_off: false, position_m: [x, y], z_m: z, yaw_rad, ..Command::IDLE };
            self.flying = true;
        }
    }

    /// Gains were answered.
    pub fn answered(&mut self, done: bool) {
        if let Some(begun) = &mut self.begun {
            begun.answered = Some(done);
        }
    }

    /// What of the present step has to be asked for.
    pub fn ask(&self) -> Option<Ask> {
        let begun = self.begun.as_ref()?;
        Some(match begun.step {
            Step::Arm {} => Ask::Request(Request::Arm),
            Step::Land {} => Ask::Request(Request::Land),
            Step::Disarm {} => Ask::Request(Request::Disarm),
            Step::Cut {} => Ask::Request(Request::Cut),
            Step::Gains { of, kp, ki, kd } => Ask::Gains(Gains { of, kp, ki, kd }),
            _ => return None,
        })
    }

    /// The command of now, once in each command period.
    pub fn command(&mut self, now_s: f64, known: &Known) -> Command {
        if matches!(known.state, State::Disarmed | State::Cut) && self.flying && !self.takes_off() {
            (self.flying, self.command) = (false, Command::IDLE);
        }
        while self.progress == Progress::Going {
            if self.begun.is_none() {
                match self.steps.pop_front() {
                    Some(step) => self.begin(step, now_s, known),
                    None => self.progress = Progress::Done,
                }
                continue;
            }
            match self.advance(now_s, known) {
                Progress::Done => self.begun = None,
                Progress::Going => break,
                failed @ Progress::Failed(_) => {
                    (self.progress, self.begun) = (failed, None);
                    self.steps.clear();
                    self.command.injection = [0.0; 4];
                }
            }
        }
        Command { cut_off: !self.flying, ..self.command }
    }

    fn takes_off(&self) -> bool {
        matches!(&self.begun, Some(Begun { step: Step::TakeOff { .. }, .. }))
    }

    fn begin(&mut self, step: Step, now_s: f64, known: &Known) {
        let excitation = match step {
            Step::Hold { excite, .. } | Step::Fly { excite, .. } => {
                excite.map(|seed| Excitation::new(seed, self.period_s, self.excitation_gain))
            }
            _ => None,
        };
        self.command.injection = [0.0; 4];
        self.begun = Some(Begun {
            step,
            at_s: now_s,
            command: self.command,
            place: known.pose,
            excitation,
            flies_since_s: None,
            answered: None,
            looks: Looks::default(),
        });
    }

    /// One period of the present step.
    fn advance(&mut self, now_s: f64, known: &Known) -> Progress {
        let Some(begun) = &mut self.begun else { return Progress::Done };
        let since_s = now_s - begun.at_s;
        let failed = |why: &str| Progress::Failed(format!("{}: {why}", name_of(&begun.step)));
        let in_the_air = matches!(known.state, State::Flying | State::Hold);
        let until = |there: bool, within_s: f64, why: &str| match (there, since_s > within_s) {
            (true, _) => Progress::Done,
            (false, true) => failed(why),
            (false, false) => Progress::Going,
        };
        match &begun.step {
            Step::Arm {} => {
                begun.looks.look(known.preflight);
                let there = !matches!(known.state, State::Disarmed | State::Cut);
                until(there, PROMPT_S, &begun.looks.why(known.state))
            }
            Step::Gains { .. } => match begun.answered {
                Some(true) => Progress::Done,
                Some(false) => failed("the craft refuses them: out of range, or it is not disarmed"),
                None => until(false, PROMPT_S, "no answer"),
            },
            Step::Disarm {} => until(known.state == State::Disarmed, PROMPT_S, "the craft does not disarm"),
            Step::Cut {} => until(known.state == State::Cut, PROMPT_S, "the craft does not cut"),
            Step::Land {} => {
                let height_m = f64::from(-begun.place.position_m[2]).max(0.0);
                let within_s = PATIENT_S + height_m / 0.1;
                until(matches!(known.state, State::Disarmed | State::Cut), within_s, "it does not come down")
            }
            Step::TakeOff { height_m } => {
                if known.state == State::Disarmed || known.state == State::Cut {
                    return failed(&format!("the craft is not armed{}", known.because()));
                }
                let [x, y, z] = begun.place.position_m;
                let top_m = f64::from(z) - height_m;
                let z_m = (f64::from(z) - CLIMB_M_S * since_s).max(top_m) as f32;
                let [_, _, yaw_rad] = begun.place.attitude_rad;
                self.command = Command { position_m: [x, y], z_m, yaw_rad, cut_off: false, ..Command::IDLE };
                self.flying = true;
                let left_m = f64::from(known.pose.position_m[2]) - top_m;
                if known.state == State::Flying && left_m < CLOSE_M {
                    // What is left of the way it goes by itself, while the next step begins.
                    self.command.z_m = top_m as f32;
                    return Progress::Done;
                }
                until(false, PATIENT_S + height_m / CLIMB_M_S, "it does not rise")
            }
            _ if !in_the_air => failed(&format!(
                "the craft does not fly any more, its state is {:?}{}",
                known.state,
                known.because()
            )),
            Step::Hold { for_s, .. } => {
                if let Some(excitation) = &mut begun.excitation {
                    self.command.injection = excitation.next_sample();
                }
                until(since_s >= *for_s, f64::INFINITY, "")
            }
            Step::GoTo { x, y, z, yaw, for_s } => {
                let before = begun.command;
                let or = |new: &Option<f64>, old: f32| new.map_or(old, |v| v as f32);
                self.command = Command {
                    mode: Mode::Position,
                    position_m: [or(x, before.position_m[0]), or(y, before.position_m[1])],
                    z_m: or(z, before.z_m),
                    yaw_rad: or(yaw, before.yaw_rad),
                    ..before
                };
                until(since_s >= *for_s, f64::INFINITY, "")
            }
            Step::Step { axis, size, for_s } => {
                self.command = stepped(&begun.command, *axis, *size as f32);
                until(since_s >= *for_s, f64::INFINITY, "")
            }
            Step::Fly { pattern, times, .. } => {
                let start = pattern.at(0.0);
                let Some(flies_since_s) = begun.flies_since_s else {
                    let to_start = command_of(&pattern::Row { injection: [0.0; 4], ..start });
                    self.command = to_start;
                    if to_start.mode == Mode::Attitude || is_close(&known.pose, &to_start) {
                        begun.flies_since_s = Some(now_s);
                        return Progress::Going;
                    }
                    return until(false, PATIENT_S + 20.0, "it does not come to the pattern's start");
                };
                let flown_s = now_s - flies_since_s;
                let round_s = pattern.duration_s();
                let over = flown_s >= round_s * f64::from(*times);
                let row = pattern.at(if over { round_s } else { flown_s % round_s });
                self.command = command_of(&row);
                if let (Some(excitation), false) = (&mut begun.excitation, over) {
                    let added = excitation.next_sample();
                    self.command.injection = std::array::from_fn(|k| self.command.injection[k] + added[k]);
                }
                until(over, f64::INFINITY, "")
            }
            // Read away when the script is; a pattern that is not is no flight.
            Step::Pattern { .. } => failed("its file was not read"),
        }
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

fn name_of(step: &Step) -> String {
    match step {
        Step::Gains { of, .. } => format!("gains of {of:?}"),
        Step::Arm {} => "arm".into(),
        Step::TakeOff { height_m } => format!("take off to {height_m} m"),
        Step::GoTo { .. } => "go to a place".into(),
        Step::Step { axis, size, .. } => format!("step of {size} in {axis:?}"),
        Step::Hold { .. } => "hold".into(),
        Step::Fly { .. } | Step::Pattern { .. } => "pattern".into(),
        Step::Land {} => "land".into(),
        Step::Disarm {} => "disarm".into(),
        Step::Cut {} => "cut".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::condition::Condition;
    use proptest::prelude::*;

    const PERIOD_S: f64 = 0.02;

    fn known(state: State, position_m: [f32; 3]) -> Known {
        Known { state, pose: Pose { position_m, attitude_rad: [0.0, 0.0, 0.5] }, preflight: 0x3ff, found: 0 }
    }

    fn parse(text: &str) -> Result<Vec<Step>, ScriptError> {
        parse_script(text, Path::new("s.toml"))
    }

    /// A craft without inertia: it is where it is told to be, and does what it is asked for.
    struct Ideal {
        mission: Mission,
        known: Known,
        now_s: f64,
        log: Vec<(f64, Command)>,
    }

    impl Ideal {
        fn new(steps: Vec<Step>) -> Self {
            let mission = Mission::new(steps, PERIOD_S, 1.0);
            Self { mission, known: known(State::Disarmed, [0.3, 0.2, 0.0]), now_s: 0.0, log: Vec::new() }
        }

        fn period(&mut self) {
            let command = self.mission.command(self.now_s, &self.known);
            self.log.push((self.now_s, command));
            let (known, now_s) = (&mut self.known, &mut self.now_s);
            *now_s += PERIOD_S;
            if command.cut_off && matches!(known.state, State::Flying | State::Hold | State::Land) {
                known.state = State::Cut;
            }
            match (known.state, self.mission.ask()) {
                (State::Disarmed, Some(Ask::Request(Request::Arm))) => known.state = State::Armed,
                (State::Armed, _) if !command.cut_off => known.state = State::Flying,
                (State::Flying, Some(Ask::Request(Request::Land))) => known.state = State::Land,
                (State::Land, _) if known.pose.position_m[2] > -0.05 => known.state = State::Disarmed,
                (State::Land, _) => known.pose.position_m[2] += 0.02,
                (_, Some(Ask::Gains(_))) => self.mission.answered(true),
                _ => {}
            }
            if known.state == State::Flying {
                let [x, y] = command.position_m;
                known.pose.position_m = [x, y, command.z_m];
            }
        }

        fn fly(mut self) -> Self {
            while *self.mission.progress() == Progress::Going && self.now_s < 300.0 {
                self.period();
            }
            self
        }
    }

    const WHOLE: &str = r#"
        [[step]]
        do = "gains"
        of = "Roll"
        kp = 1.0
        ki = 2.0
        kd = 3.0
        [[step]]
        do = "arm"
        [[step]]
        do = "take-off"
        height_m = 1.0
        [[step]]
        do = "go-to"
        x = 1.0
        for_s = 2.0
        [[step]]
        do = "step"
        axis = "z"
        size = -0.5
        for_s = 1.0
        [[step]]
        do = "hold"
        for_s = 3.0
        excite = 5
        [[step]]
        do = "land"
    "#;

    #[test]
    fn a_script_is_flown_from_the_floor_to_the_floor() {
        let flight = Ideal::new(parse(WHOLE).unwrap()).fly();
        assert_eq!(*flight.mission.progress(), Progress::Done, "{:?}", flight.known);
        assert_eq!(flight.known.state, State::Disarmed);
        let commands = || flight.log.iter().map(|(_, command)| command);
        // Never cut off in the air: idle, then not, then idle.
        let changes = flight.log.windows(2).filter(|w| w[0].1.cut_off != w[1].1.cut_off).count();
        assert_eq!(changes, 2);
        let lowest_z = commands().map(|c| c.z_m).fold(0.0, f32::min);
        assert!((lowest_z + 1.5).abs() < 1e-5, "{lowest_z}");
        assert!(commands().any(|c| c.position_m == [1.0, 0.2]));
        let excited: Vec<_> = commands().filter(|c| c.injection != [0.0; 4]).collect();
        // The first sample of four sines is zero.
        assert_eq!(excited.len(), 149 + 1, "3 s of 50 Hz, and the period in which they are over");
        let mut same = Excitation::new(5, PERIOD_S, 1.0);
        same.next_sample();
        assert_eq!(excited[0].injection, same.next_sample());
        // Half a metre a second up.
        let climb = commands().filter(|c| !c.cut_off && c.z_m > -0.99).count() as f64 * PERIOD_S;
        assert!((climb - 1.5).abs() < 0.6, "{climb}");
    }

    #[test]
    fn patterns_begin_at_their_start_and_repeat() {
        let text = "t,mode,roll,pitch,yaw,x,y,z,inj1,inj2,inj3,inj4\n\
                    0,position,,,0,1,1,-1,1,0,0,0\n1,position,,,0,0,1,-1,2,0,0,0\n2,position,,,0,0,0,-1,0,0,0,0\n";
        let pattern = Box::new(Pattern::parse(text.as_bytes(), Path::new("p.csv")).unwrap());
        let steps = vec![
            Step::Arm {},
            Step::TakeOff { height_m: 1.0 },
            Step::Fly { pattern, times: 3, excite: None },
            Step::Land {},
        ];
        let flight = Ideal::new(steps).fly();
        assert_eq!(*flight.mission.progress(), Progress::Done);
        let x: Vec<f32> =
            flight.log.iter().filter(|(_, c)| c.injection[0] > 0.0).map(|(_, c)| c.position_m[0]).collect();
        let mut changes = x.clone();
        changes.dedup();
        assert_eq!(changes, [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        assert!((x.len() as f64 * PERIOD_S - 6.0).abs() < 0.1, "{}", x.len());
    }

    #[test]
    fn a_craft_that_goes_its_own_way_ends_the_mission_by_name() {
        let mut flight = Ideal::new(parse(WHOLE).unwrap());
        while flight.known.state != State::Flying || flight.now_s < 4.0 {
            flight.period();
        }
        flight.known.state = State::Land;
        flight.period();
        let Progress::Failed(why) = flight.mission.progress() else { panic!("goes on") };
        assert!(why.contains("Land"), "{why}");
        // It comes down by itself; cutting the motors in the air would be a crash.
        assert!(!flight.log.last().unwrap().1.cut_off);
        flight.known.state = State::Disarmed;
        flight.period();
        assert!(flight.log.last().unwrap().1.cut_off);
    }

    #[test]
    fn a_craft_that_does_not_arm_says_which_checks_are_not_good() {
        let mut mission = Mission::new([Step::Arm {}], PERIOD_S, 1.0);
        let known = Known { preflight: 0x3ff & !0b110, ..known(State::Disarmed, [0.0; 3]) };
        for k in 0..300 {
            assert!(mission.command(f64::from(k) * PERIOD_S, &known).cut_off);
        }
        let Progress::Failed(why) = mission.progress() else { panic!("goes on") };
        assert!(why.contains("pose, IMU") && why.starts_with("arm"), "{why}");
    }

    /// A check that comes and goes is good when the time is over, more often than not.
    #[test]
    fn a_check_that_comes_and_goes_is_named_too() {
        let mut mission = Mission::new([Step::Arm {}], PERIOD_S, 1.0);
        for k in 0..300 {
            let preflight = if k % 4 == 0 { 0x3ff & !Preflight::TIMING } else { 0x3ff };
            mission
                .command(f64::from(k) * PERIOD_S, &Known { preflight, ..known(State::Disarmed, [0.0; 3]) });
        }
        let Progress::Failed(why) = mission.progress() else { panic!("goes on") };
        assert!(why.ends_with("not all good: timing (25 % of the time)"), "{why}");
        let mut cut = Mission::new([Step::Arm {}], PERIOD_S, 1.0);
        for k in 0..300 {
            cut.command(f64::from(k) * PERIOD_S, &Known { preflight: 0, ..known(State::Cut, [0.0; 3]) });
        }
        let Progress::Failed(why) = cut.progress() else { panic!("goes on") };
        assert!(why.contains("disarm it first"), "{why}");
    }

    #[test]
    fn what_ended_a_flight_is_named() {
        let mut mission = Mission::new([Step::TakeOff { height_m: 1.0 }], PERIOD_S, 1.0);
        mission.command(0.0, &known(State::Armed, [0.0; 3]));
        let found = Condition::LinkLate.bit() | Condition::LandRequested.bit();
        mission.command(PERIOD_S, &Known { found, ..known(State::Disarmed, [0.0; 3]) });
        let Progress::Failed(why) = mission.progress() else { panic!("goes on") };
        assert!(why.ends_with("not armed, because of link late"), "{why}");
    }

    #[test]
    fn a_craft_that_flies_already_is_taken_over_where_it_is() {
        for state in [State::Flying, State::Hold, State::Land] {
            let mut mission = Mission::new([], PERIOD_S, 1.0);
            let known = known(state, [1.0, 2.0, -1.5]);
            mission.adopt(&known);
            let command = mission.command(0.0, &known);
            assert!(!command.cut_off);
            assert_eq!((command.position_m, command.z_m, command.yaw_rad), ([1.0, 2.0], -1.5, 0.5));
        }
        let mut mission = Mission::new([], PERIOD_S, 1.0);
        mission.adopt(&known(State::Armed, [0.0; 3]));
        assert!(mission.command(0.0, &known(State::Armed, [0.0; 3])).cut_off);
    }

    #[test]
    fn what_cannot_be_flown_is_refused_by_file_and_step() {
        for (text, wanted) in [
            ("", "step"),
            ("[[step]]\ndo = \"jump\"", "jump"),
            ("[[step]]\ndo = \"arm\"\nnow = 1", "now"),
            ("[[step]]\ndo = \"arm\"\n[[step]]\ndo = \"take-off\"\nheight_m = -1", "step 2: height_m is -1"),
            ("[[step]]\ndo = \"step\"\naxis = \"roll\"\nsize = 30\nfor_s = 1", "size is 30"),
            ("[[step]]\ndo = \"go-to\"\nz = 1.0\nfor_s = 1", "z is 1"),
            ("[[step]]\ndo = \"hold\"\nfor_s = nan", "for_s is NaN"),
            ("[[step]]\ndo = \"pattern\"\nfile = \"none.csv\"", "none.csv"),
            ("[[step]]\ndo = \"fly\"", "fly"),
        ] {
            let message = parse(text).unwrap_err().to_string();
            assert!(
                message.contains(wanted) && message.contains(".toml") | message.contains(".csv"),
                "{message}"
            );
            assert_eq!(message.lines().count(), 1, "{message}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "\\PC{0,200}", line in "(\\[\\[step\\]\\]\ndo = \"(hold|go-to|step|gains)\"\n(for_s|x|size|of) = [-0-9.e]{1,8}\n){0,4}") {
            let _ = parse(&text);
            let _ = parse(&line);
        }

        /// Whatever the craft does: in the air commands are never cut off, and all are finite.
        #[test]
        fn commands_stay_sane(states in prop::collection::vec(0usize..6, 1..200), seed: u64) {
            let all = [State::Disarmed, State::Armed, State::Flying, State::Hold, State::Land, State::Cut];
            let mut steps = parse(WHOLE).unwrap();
            steps.push(Step::Hold { for_s: 5.0, excite: Some(seed) });
            let mut mission = Mission::new(steps, PERIOD_S, 1.0);
            let mut flew = false;
            for (k, state) in states.into_iter().enumerate() {
                let known = known(all[state], [0.0, 0.0, -0.5]);
                let command = mission.command(k as f64 * 0.1, &known);
                let numbers = [command.z_m, command.yaw_rad, command.position_m[0], command.injection[3]];
                prop_assert!(numbers.iter().all(|v| v.is_finite()));
                if matches!(known.state, State::Disarmed | State::Cut) {
                    flew = false;
                }
                prop_assert!(!(flew && command.cut_off && all[state] == State::Flying));
                flew |= !command.cut_off;
            }
        }
    }
}
