//! What is asked of the craft at which time: steps one after the other, from a script file, a
//! pattern or the keyboard.
//!
//! Pure: time comes in, commands come out. Before and after flight the command is cut-off; in
//! flight it never is, because a cut-off in the air is a crash.

use std::collections::VecDeque;

use pattern::Excitation;
use proto::{Command, Gains, Request, State};

use super::active_step::{ActiveStep, Commanded};
use super::script::MissionStep;
use super::status::{Ask, CraftStatus, Progress};

/// The steps, and the command of now.
#[derive(Debug, Clone)]
pub struct Mission {
    steps: VecDeque<MissionStep>,
    active: Option<ActiveStep>,
    commanded: Commanded,
    progress: Progress,
    period_s: f64,
    /// Command units for one microsecond of the thesis' excitation.
    excitation_gain: f64,
}

impl Mission {
    /// Steps to be flown with a command every `period_s`. `excitation_gain` is command units for
    /// one microsecond of PWM.
    pub fn new(steps: impl IntoIterator<Item = MissionStep>, period_s: f64, excitation_gain: f64) -> Self {
        Self {
            steps: steps.into_iter().collect(),
            active: None,
            commanded: Commanded { command: Command::IDLE, flying: false },
            progress: Progress::Going,
            period_s,
            excitation_gain,
        }
    }

    /// Drops what is left and does this instead.
    pub fn instead(&mut self, steps: impl IntoIterator<Item = MissionStep>) {
        self.steps = steps.into_iter().collect();
        self.active = None;
        self.commanded.command.injection = [0.0; 4];
        self.progress = Progress::Going;
    }

    /// How it goes.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Does the craft fly, as far as this side has asked for?
    pub fn is_flying(&self) -> bool {
        self.commanded.flying
    }

    /// The step that is being done, for people.
    pub fn describe(&self) -> String {
        match (&self.active, &self.progress) {
            (_, Progress::Failed(why)) => format!("failed: {why}"),
            (Some(active), _) => active.step.describe(),
            (None, Progress::Done) => "nothing left to do".into(),
            (None, _) => "waiting for the craft".into(),
        }
    }

    /// The craft was found in this state when it was first heard. A craft that flies already is
    /// taken over where it is and not cut.
    pub fn adopt(&mut self, craft: &CraftStatus) {
        if matches!(craft.state, State::Flying | State::Hold | State::Land) {
            let [x, y, z] = craft.pose.position_m;
            let [_, _, yaw_rad] = craft.pose.attitude_rad;
            let command = Command { cut_off: false, position_m: [x, y], z_m: z, yaw_rad, ..Command::IDLE };
            self.commanded = Commanded { command, flying: true };
        }
    }

    /// Gains were answered.
    pub fn answered(&mut self, done: bool) {
        if let Some(active) = &mut self.active {
            active.answered = Some(done);
        }
    }

    /// What of the present step has to be asked for.
    pub fn ask(&self) -> Option<Ask> {
        let active = self.active.as_ref()?;
        Some(match active.step {
            MissionStep::Arm {} => Ask::Request(Request::Arm),
            MissionStep::Land {} => Ask::Request(Request::Land),
            MissionStep::Disarm {} => Ask::Request(Request::Disarm),
            MissionStep::Cut {} => Ask::Request(Request::Cut),
            MissionStep::Gains { of, kp, ki, kd } => Ask::Gains(Gains { of, kp, ki, kd }),
            _ => return None,
        })
    }

    /// The command of now, once in each command period.
    pub fn command(&mut self, now_s: f64, craft: &CraftStatus) -> Command {
        if matches!(craft.state, State::Disarmed | State::Cut) && self.commanded.flying && !self.takes_off() {
            self.commanded = Commanded { command: Command::IDLE, flying: false };
        }
        while self.progress == Progress::Going {
            let Some(active) = &mut self.active else {
                match self.steps.pop_front() {
                    Some(step) => self.begin(step, now_s, craft),
                    None => self.progress = Progress::Done,
                }
                continue;
            };
            match active.advance(&mut self.commanded, now_s, craft) {
                Progress::Done => self.active = None,
                Progress::Going => break,
                failed @ Progress::Failed(_) => {
                    (self.progress, self.active) = (failed, None);
                    self.steps.clear();
                    self.commanded.command.injection = [0.0; 4];
                }
            }
        }
        Command { cut_off: !self.commanded.flying, ..self.commanded.command }
    }

    fn takes_off(&self) -> bool {
        matches!(&self.active, Some(ActiveStep { step: MissionStep::TakeOff { .. }, .. }))
    }

    fn begin(&mut self, step: MissionStep, now_s: f64, craft: &CraftStatus) {
        let excitation = match step {
            MissionStep::Hold { excite, .. } | MissionStep::Fly { excite, .. } => {
                excite.map(|seed| Excitation::new(seed, self.period_s, self.excitation_gain))
            }
            _ => None,
        };
        self.commanded.command.injection = [0.0; 4];
        let command = self.commanded.command;
        self.active = Some(ActiveStep::new(step, now_s, command, craft.pose, excitation));
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use control::Condition;
    use control::Preflight;
    use pattern::Pattern;
    use proptest::prelude::*;
    use proto::Pose;

    use super::super::script::{ScriptError, parse_script};
    use super::*;

    const PERIOD_S: f64 = 0.02;

    fn known(state: State, position_m: [f32; 3]) -> CraftStatus {
        CraftStatus {
            state,
            pose: Pose { position_m, attitude_rad: [0.0, 0.0, 0.5] },
            preflight: Preflight::ALL.bits(),
            found: 0,
        }
    }

    fn parse(text: &str) -> Result<Vec<MissionStep>, ScriptError> {
        parse_script(text, Path::new("s.toml"))
    }

    /// A craft without inertia: it is where it is told to be, and does what it is asked for.
    struct Ideal {
        mission: Mission,
        known: CraftStatus,
        now_s: f64,
        log: Vec<(f64, Command)>,
    }

    impl Ideal {
        fn new(steps: Vec<MissionStep>) -> Self {
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
            MissionStep::Arm {},
            MissionStep::TakeOff { height_m: 1.0 },
            MissionStep::Fly { pattern, times: 3, excite: None },
            MissionStep::Land {},
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
        let mut mission = Mission::new([MissionStep::Arm {}], PERIOD_S, 1.0);
        let known =
            CraftStatus { preflight: Preflight::ALL.bits() & !0b110, ..known(State::Disarmed, [0.0; 3]) };
        for k in 0..300 {
            assert!(mission.command(f64::from(k) * PERIOD_S, &known).cut_off);
        }
        let Progress::Failed(why) = mission.progress() else { panic!("goes on") };
        assert!(why.contains("pose, IMU") && why.starts_with("arm"), "{why}");
    }

    /// A check that comes and goes is good when the time is over, more often than not.
    #[test]
    fn a_check_that_comes_and_goes_is_named_too() {
        let mut mission = Mission::new([MissionStep::Arm {}], PERIOD_S, 1.0);
        for k in 0..300 {
            let preflight =
                if k % 4 == 0 { Preflight::ALL.bits() & !Preflight::TIMING } else { Preflight::ALL.bits() };
            mission.command(
                f64::from(k) * PERIOD_S,
                &CraftStatus { preflight, ..known(State::Disarmed, [0.0; 3]) },
            );
        }
        let Progress::Failed(why) = mission.progress() else { panic!("goes on") };
        assert!(why.ends_with("these checks fail: timing (25 % of the time)"), "{why}");
        let mut cut = Mission::new([MissionStep::Arm {}], PERIOD_S, 1.0);
        for k in 0..300 {
            cut.command(
                f64::from(k) * PERIOD_S,
                &CraftStatus { preflight: 0, ..known(State::Cut, [0.0; 3]) },
            );
        }
        let Progress::Failed(why) = cut.progress() else { panic!("goes on") };
        assert!(why.contains("disarm it first"), "{why}");
    }

    #[test]
    fn what_ended_a_flight_is_named() {
        let mut mission = Mission::new([MissionStep::TakeOff { height_m: 1.0 }], PERIOD_S, 1.0);
        mission.command(0.0, &known(State::Armed, [0.0; 3]));
        let found = Condition::LinkLate.bit() | Condition::LandRequested.bit();
        mission.command(PERIOD_S, &CraftStatus { found, ..known(State::Disarmed, [0.0; 3]) });
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

    proptest! {
        /// Whatever the craft does: in the air commands are never cut off, and all are finite.
        #[test]
        fn commands_stay_sane(states in prop::collection::vec(0usize..6, 1..200), seed: u64) {
            let all = [State::Disarmed, State::Armed, State::Flying, State::Hold, State::Land, State::Cut];
            let mut steps = parse(WHOLE).unwrap();
            steps.push(MissionStep::Hold { for_s: 5.0, excite: Some(seed) });
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
