//! What can go wrong in a flight: each fault begins at a time, lasts a while, and changes what
//! reaches the autopilot or the motors. The craft itself and the sensors' noise do not change.

use std::collections::VecDeque;
use std::fmt;

use control::{Command, Pose, Readings, Request};

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FaultKind {
    /// No command comes.
    LinkSilent,
    /// Commands are not numbers.
    LinkGarbage,
    /// The ground asks for something, once.
    Asks(Request),
    /// The pilot's command is cut-off.
    CutOff,
    /// No pose comes.
    PoseSilent,
    /// Poses come so much later than they did, us: at first, none; then each with its age.
    PoseOld(u32),
    /// The last pose comes again and again.
    PoseFrozen,
    /// Poses are off by so much, m.
    PoseShifted([f32; 3]),
    /// Heading is off by so much, rad.
    PoseTurned(f32),
    /// Positions are not numbers.
    PoseNotANumber,
    /// No gyro sample comes.
    ImuMissing,
    /// The last gyro sample comes again and again.
    ImuStuck,
    /// The gyro is off by so much on each axis, rad/s.
    ImuBiased(f32),
    /// The gyro is off by so much on each axis to and fro from tick to tick, rad/s.
    ImuShaken(f32),
    /// The gyro's scale is wrong by this factor.
    ImuScaled(f32),
    /// The gyro says nonsense.
    ImuGarbage,
    /// The voltage is measured lower by so much, V.
    VoltageLower(f32),
    /// The voltage cannot be measured.
    VoltageNotANumber,
    /// A motor stands still (0 to 3).
    MotorDead(usize),
    /// A motor (0 to 3) gets so much less than its command, command units.
    MotorWeak(usize, f32),
    /// A motor (0 to 3) goes on as it did, whatever it is told, and nobody says so.
    MotorStuck(usize),
    /// The craft hangs in a net or a hand, or lies: it stays where it is, with so much roll, rad.
    Hangs(f64),
    /// An output takes no command any more: its motor (0 to 3) goes on with the last.
    OutputDead(usize),
    /// Every motor gets so much less than its command, command units.
    MotorsWeak(f32),
    /// The clock is off by so much from here on, us; modulo 2^32.
    ClockOff(u32),
    /// The control loop does not run; the motors go on.
    LoopStalled,
}

impl FaultKind {
    /// For people and tables, without its numbers.
    pub const fn name(self) -> &'static str {
        match self {
            Self::LinkSilent => "link silent",
            Self::LinkGarbage => "garbage on the link",
            Self::Asks(_) => "a request from the ground",
            Self::CutOff => "cut-off by the pilot",
            Self::PoseSilent => "no poses",
            Self::PoseOld(_) => "late poses",
            Self::PoseFrozen => "frozen pose",
            Self::PoseShifted(_) => "shifted pose",
            Self::PoseTurned(_) => "turned pose",
            Self::PoseNotANumber => "poses that are no numbers",
            Self::ImuMissing => "no gyro samples",
            Self::ImuStuck => "stuck gyro",
            Self::ImuBiased(_) => "biased gyro",
            Self::ImuShaken(_) => "shaken gyro",
            Self::ImuScaled(_) => "wrong scale of the gyro",
            Self::ImuGarbage => "garbage from the gyro",
            Self::VoltageLower(_) => "voltage measured too low",
            Self::VoltageNotANumber => "voltage that is no number",
            Self::MotorDead(_) => "dead motor",
            Self::MotorWeak(..) => "weak motor",
            Self::MotorStuck(_) => "stuck motor",
            Self::Hangs(_) => "craft held fast",
            Self::OutputDead(_) => "dead motor output",
            Self::MotorsWeak(_) => "weak motors",
            Self::ClockOff(_) => "clock jump",
            Self::LoopStalled => "stalled control loop",
        }
    }

    /// How large it is, with its unit; nothing where it has no size.
    fn size(self) -> Option<String> {
        Some(match self {
            Self::Asks(request) => format!("{request:?}").to_lowercase(),
            Self::PoseShifted(by) => {
                let [x, y, z] = by.map(|m| format!("{m:.2}"));
                format!("by ({x}, {y}, {z}) m")
            }
            Self::PoseOld(us) => format!("by {:.2} s", f64::from(us) * 1e-6),
            Self::PoseTurned(rad) => format!("by {rad:.2} rad"),
            Self::ImuBiased(rad_s) | Self::ImuShaken(rad_s) => format!("by {rad_s:.3} rad/s"),
            Self::ImuScaled(factor) => format!("times {factor:.2}"),
            Self::VoltageLower(volts) => format!("by {volts:.2} V"),
            Self::MotorDead(motor) | Self::MotorStuck(motor) | Self::OutputDead(motor) => {
                format!("number {}", motor + 1)
            }
            Self::MotorWeak(motor, by) => format!("number {}, by {by:.0} command units", motor + 1),
            Self::MotorsWeak(by) => format!("by {by:.0} command units"),
            _ => return None,
        })
    }
}

/// "shifted pose by (0.10, 0.00, -0.10) m, from 4.26 s to the end".
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        /// Nothing that is simulated takes a day.
        const END_S: f64 = 86_400.0;
        f.write_str(self.kind.name())?;
        if let Some(size) = self.kind.size() {
            write!(f, " {size}")?;
        }
        match self.from_s + self.for_s {
            until_s if until_s > END_S => write!(f, ", from {:.2} s to the end", self.from_s),
            until_s => write!(f, ", from {:.2} to {until_s:.2} s", self.from_s),
        }
    }
}

/// A fault and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// What goes wrong.
    pub kind: FaultKind,
    /// From when on, s.
    pub from_s: f64,
    /// For how long, s.
    pub for_s: f64,
}

/// A margin so that a time computed as `k Ts` meets one written as a decimal, s.
const SAME_TIME_S: f64 = 1e-9;

impl Fault {
    fn is_on(&self, time_s: f64) -> bool {
        let since_s = time_s + SAME_TIME_S - self.from_s;
        since_s >= 0.0 && since_s < self.for_s
    }
}

/// What faults remember.
#[derive(Debug, Clone)]
pub(crate) struct Faults {
    last_pose: Option<Pose>,
    last_gyro: Option<[f32; 3]>,
    /// Poses on their way, and when each was taken, s.
    on_their_way: VecDeque<(f64, Pose)>,
    asked: bool,
    last_motors: Option<[f32; 4]>,
    /// Changes its sign from tick to tick.
    shaken: f32,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            last_pose: None,
            last_gyro: None,
            on_their_way: VecDeque::new(),
            asked: false,
            last_motors: None,
            shaken: 1.0,
        }
    }
}

impl Faults {
    /// Changes what reaches the autopilot; returns whether its loop stalls.
    pub(crate) fn distort(&mut self, faults: &[Fault], time_s: f64, readings: &mut Readings) -> bool {
        let (last_pose, last_gyro) = (self.last_pose, self.last_gyro);
        let mut stalled = false;
        let late = |fault: &Fault| matches!(fault.kind, FaultKind::PoseOld(_)) && fault.is_on(time_s);
        if !faults.iter().any(late) {
            self.on_their_way.clear();
        }
        for fault in faults.iter().filter(|fault| fault.is_on(time_s)) {
            match fault.kind {
                FaultKind::LoopStalled => stalled = true,
                FaultKind::PoseOld(age_us) => self.delay(age_us, time_s, readings),
                kind => self.distort_by(kind, readings, last_pose, last_gyro),
            }
        }
        // A frozen value is the last one, so it stays the same.
        (self.last_pose, self.last_gyro) = (readings.pose.or(last_pose), readings.gyro_rad_s.or(last_gyro));
        stalled
    }

    /// Holds the pose back, and hands out the one whose time has come.
    fn delay(&mut self, age_us: u32, time_s: f64, readings: &mut Readings) {
        self.on_their_way.extend(readings.pose.take().map(|pose| (time_s, pose)));
        let taken_s = time_s - f64::from(age_us) * 1e-6 + SAME_TIME_S;
        while let Some((_, pose)) = self.on_their_way.front().filter(|(at_s, _)| *at_s <= taken_s) {
            (readings.pose, readings.pose_age_us) = (Some(*pose), age_us);
            self.on_their_way.pop_front();
        }
    }

    fn distort_by(
        &mut self,
        kind: FaultKind,
        readings: &mut Readings,
        last_pose: Option<Pose>,
        last_gyro: Option<[f32; 3]>,
    ) {
        let pose = |change: &dyn Fn(&mut Pose), readings: &mut Readings| {
            if let Some(pose) = &mut readings.pose {
                change(pose);
            }
        };
        match kind {
            FaultKind::LinkSilent => readings.command = None,
            FaultKind::LinkGarbage => {
                readings.command = readings.command.map(|c| Command { z_m: f32::NAN, ..c });
            }
            FaultKind::Asks(request) => {
                readings.request = (!self.asked).then_some(request);
                self.asked = true;
            }
            FaultKind::CutOff => {
                readings.command = readings.command.map(|c| Command { cut_off: true, ..c });
            }
            FaultKind::PoseSilent => readings.pose = None,
            FaultKind::PoseFrozen => readings.pose = last_pose,
            FaultKind::PoseShifted(by_m) => {
                pose(&|pose| pose.position_m.iter_mut().zip(by_m).for_each(|(x, by)| *x += by), readings)
            }
            FaultKind::PoseTurned(by_rad) => pose(&|pose| pose.attitude_rad[2] += by_rad, readings),
            FaultKind::PoseNotANumber => pose(&|pose| pose.position_m = [f32::NAN; 3], readings),
            FaultKind::ImuMissing => readings.gyro_rad_s = None,
            FaultKind::ImuStuck => readings.gyro_rad_s = last_gyro,
            FaultKind::ImuBiased(by) => readings.gyro_rad_s = readings.gyro_rad_s.map(|g| g.map(|x| x + by)),
            FaultKind::ImuShaken(by) => {
                self.shaken = -self.shaken;
                let by = by.copysign(self.shaken);
                readings.gyro_rad_s = readings.gyro_rad_s.map(|g| g.map(|x| x + by));
            }
            FaultKind::ImuScaled(by) => readings.gyro_rad_s = readings.gyro_rad_s.map(|g| g.map(|x| x * by)),
            FaultKind::ImuGarbage => readings.gyro_rad_s = Some([f32::NAN, 1e9, f32::INFINITY]),
            FaultKind::VoltageLower(by_v) => readings.battery_v -= by_v,
            FaultKind::VoltageNotANumber => readings.battery_v = f32::NAN,
            FaultKind::ClockOff(by_us) => readings.time_us = readings.time_us.wrapping_add(by_us),
            FaultKind::OutputDead(_) => readings.outputs_ready = false,
            FaultKind::MotorDead(_)
            | FaultKind::MotorStuck(_)
            | FaultKind::MotorWeak(..)
            | FaultKind::MotorsWeak(_)
            | FaultKind::LoopStalled
            | FaultKind::PoseOld(_)
            | FaultKind::Hangs(_) => {}
        }
    }

    /// With how much roll the craft hangs, rad, if it does.
    pub(crate) fn hangs(faults: &[Fault], time_s: f64) -> Option<f64> {
        faults.iter().filter(|fault| fault.is_on(time_s)).find_map(|fault| match fault.kind {
            FaultKind::Hangs(roll_rad) => Some(roll_rad),
            _ => None,
        })
    }

    /// What the motors get of their commands.
    pub(crate) fn motors(
        &mut self,
        faults: &[Fault],
        time_s: f64,
        mut pwm: [f32; 4],
        command_range: [f64; 2],
    ) -> [f32; 4] {
        let idle = command_range[0] as f32;
        let last = self.last_motors.unwrap_or(pwm);
        for fault in faults.iter().filter(|fault| fault.is_on(time_s)) {
            match fault.kind {
                FaultKind::MotorDead(motor) => {
                    if let Some(command) = pwm.get_mut(motor) {
                        *command = idle;
                    }
                }
                FaultKind::OutputDead(motor) | FaultKind::MotorStuck(motor) => {
                    if let (Some(command), Some(last)) = (pwm.get_mut(motor), last.get(motor)) {
                        *command = *last;
                    }
                }
                FaultKind::MotorWeak(motor, by) => {
                    if let Some(command) = pwm.get_mut(motor) {
                        *command = (*command - by).max(idle);
                    }
                }
                FaultKind::MotorsWeak(by) => pwm = pwm.map(|command| (command - by).max(idle)),
                _ => {}
            }
        }
        self.last_motors = Some(pwm);
        pwm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn readings(x_m: f32) -> Readings {
        Readings {
            time_us: 0,
            pose: Some(Pose { position_m: [x_m, 0.0, -1.0], attitude_rad: [0.0; 3] }),
            pose_age_us: 0,
            gyro_rad_s: Some([0.1; 3]),
            battery_v: 11.1,
            command: Some(Command::default()),
            request: None,
            outputs_ready: true,
        }
    }

    /// What comes to the autopilot in tick `k` of 10 ms; x grows by 1 m a tick.
    fn distorted(list: &[Fault], faults: &mut Faults, k: u32) -> (Readings, bool) {
        let mut readings = readings(k as f32);
        let stalled = faults.distort(list, f64::from(k) * 0.01, &mut readings);
        (readings, stalled)
    }

    #[test]
    fn a_frozen_pose_is_the_last_one_and_ends_with_the_fault() {
        let list = [Fault { kind: FaultKind::PoseFrozen, from_s: 0.03, for_s: 0.02 }];
        let mut faults = Faults::default();
        let x: Vec<f32> = (0..7)
            .map(|k| distorted(&list, &mut faults, k).0.pose.map_or(f32::NAN, |pose| pose.position_m[0]))
            .collect();
        // From the tick at 0.03 s on, up to but not with the one at 0.05 s.
        assert_eq!(x, [0.0, 1.0, 2.0, 2.0, 2.0, 5.0, 6.0]);
    }

    /// Late by 0.03 s in two spells: for so long none comes, then that of three ticks ago with its age; what is late when a spell ends has
    /// been overtaken.
    #[test]
    fn a_late_pose_comes_with_its_age() {
        let late = |from_s| Fault { kind: FaultKind::PoseOld(30_000), from_s, for_s: 0.05 };
        let mut faults = Faults::default();
        let came: Vec<Option<(f32, u32)>> = (0..14)
            .map(|k| {
                let readings = distorted(&[late(0.02), late(0.08)], &mut faults, k).0;
                readings.pose.map(|pose| (pose.position_m[0], readings.pose_age_us))
            })
            .collect();
        let fresh = |x| Some((x, 0));
        let spell = |x| [None, None, None, Some((x, 30_000)), Some((x + 1.0, 30_000))];
        let want: Vec<_> = [fresh(0.0), fresh(1.0)]
            .into_iter()
            .chain(spell(2.0))
            .chain([fresh(7.0)])
            .chain(spell(8.0))
            .collect();
        assert_eq!(came, [want, vec![fresh(13.0)]].concat());
    }

    #[test]
    fn a_request_comes_once_however_long_its_fault_lasts() {
        let list = [Fault { kind: FaultKind::Asks(Request::Land), from_s: 0.0, for_s: 1.0 }];
        let mut faults = Faults::default();
        let requests: Vec<_> = (0..5).map(|k| distorted(&list, &mut faults, k).0.request).collect();
        assert_eq!(requests, [Some(Request::Land), None, None, None, None]);
    }

    #[test]
    fn faults_at_once_all_act_and_a_stall_is_reported() {
        let on = |kind| Fault { kind, from_s: 0.0, for_s: 1.0 };
        let list = [on(FaultKind::PoseSilent), on(FaultKind::VoltageLower(1.0)), on(FaultKind::LoopStalled)];
        let (seen, stalled) = distorted(&list, &mut Faults::default(), 0);
        assert!(stalled && seen.pose.is_none() && (seen.battery_v - 10.1).abs() < 1e-6, "{seen:?}");
    }

    #[test]
    fn a_dead_motor_idles_and_weak_ones_never_fall_below_idle() {
        let on = |kind| Fault { kind, from_s: 0.0, for_s: 1.0 };
        let mut faults = Faults::default();
        let mut motors =
            |kind| faults.motors(&[on(kind)], 0.0, [1500.0, 1200.0, 1500.0, 1500.0], [1000.0, 2000.0]);
        assert_eq!(motors(FaultKind::MotorDead(0)), [1000.0, 1200.0, 1500.0, 1500.0]);
        assert_eq!(motors(FaultKind::MotorDead(7)), [1500.0, 1200.0, 1500.0, 1500.0]);
        assert_eq!(motors(FaultKind::MotorsWeak(300.0)), [1200.0, 1000.0, 1200.0, 1200.0]);
        assert_eq!(motors(FaultKind::OutputDead(1)), [1500.0, 1000.0, 1500.0, 1500.0]);
        assert_eq!(motors(FaultKind::MotorStuck(1)), [1500.0, 1000.0, 1500.0, 1500.0]);
    }
}
