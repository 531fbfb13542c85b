//! A craft for programs that learn to fly it: actions go in, what is seen and a reward come out, tick by tick.
//!
//! The craft is the [`SimulatedCraft`] of every other flight: sensors, delay, battery, gusts and faults of a [`FlightPlan`]. Actions
//! are commands of the motors, or set points for the flight law, which then flies as in [`crate::ClosedLoop`].

use control::gains::PositionLimits;
use control::supervision_limits::Fence;
use control::{Command, Mode, Pose, Readings};
use design::plant::{Linear, TrimTarget};
use model::{Plant, State, frames};
use nalgebra::{Vector3, Vector4};
use pattern::random::{Purpose, stream};
use rand::RngExt;

use crate::craft::{Delay, Faults, SimulatedCraft, Team};
use crate::flight::{FlightPlan, SilError};
use crate::flight_computer::{FlightComputer, InProcess};

/// Numbers in an action.
pub const ACTIONS: usize = 4;
/// Numbers in an observation of the state: position from the target (north, east, down, m), velocity (north, east, down, m/s),
/// attitude (quaternion w, x, y, z with w >= 0), body rates (rad/s), and rotor speeds as a part of those in hover.
pub const STATE_NUMBERS: usize = 17;
/// Numbers in an observation by the sensors: position from the target and attitude as old as the link makes them, gyro, voltage (V).
pub const SENSOR_NUMBERS: usize = 11;
/// Largest roll and pitch that an action can ask for, rad.
const MOST_TILT_RAD: f64 = 0.35;
/// What losing the craft costs.
const LOST: f64 = 100.0;

/// What the numbers of an action mean; each goes from -1 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActionKind {
    /// Commands of the motors over their range.
    Motors,
    /// Roll and pitch up to 0.35 rad, yaw up to pi, and height within the room, for the flight law.
    Attitude,
    /// North, east and down from the target within the room, and yaw up to pi, for the flight law.
    Position,
}

/// What an observation is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ObservationKind {
    /// The true state now.
    State,
    /// What the sensors say, with their noise and delay.
    Sensors,
}

impl ObservationKind {
    /// Numbers in it.
    pub const fn numbers(self) -> usize {
        match self {
            Self::State => STATE_NUMBERS,
            Self::Sensors => SENSOR_NUMBERS,
        }
    }
}

/// What is learned.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Craft, law, sensors, battery, air and faults; its start is the target, its duration an episode.
    pub plan: FlightPlan,
    /// What actions are.
    pub action: ActionKind,
    /// What is seen.
    pub observation: ObservationKind,
    /// The craft is lost farther than this from the target along any axis, m.
    pub room_m: f64,
    /// Episodes start as far from the target as this along each axis, m, ...
    pub start_m: f64,
    /// ... as fast as this, m/s, ...
    pub start_m_s: f64,
    /// ... and tilted as much as this, rad.
    pub start_rad: f64,
}

/// What came of an action.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepped {
    /// Minus the squares of distance (m), a tenth of velocity (m/s), a tenth of rates (rad/s) and a hundredth of the action, over the
    /// time of a tick; less 100 where the craft is lost.
    pub reward: f64,
    /// The craft is lost.
    pub terminated: bool,
    /// The episode is over.
    pub truncated: bool,
}

/// What an action does to the motors.
struct Motors {
    action: [f32; ACTIONS],
    /// What they get, command units.
    motors: [f32; 4],
    voltage_v: f64,
}

/// Many craft of one task, each in an episode of its own. They are advanced side by side: the same bits as each by itself, sooner.
#[derive(Debug, Clone)]
pub struct Environments {
    all: Vec<Environment>,
    team: Team,
    /// Their plant can be advanced with others.
    with_others: bool,
}

impl Environments {
    /// So many, each at the start of the episode whose seed is its number.
    ///
    /// # Errors
    /// As [`Environment::new`].
    pub fn new(task: Task, count: usize) -> Result<Self, SilError> {
        // What they have in common is worked out once.
        let first = Environment::new(task, 0)?;
        let make = |seed| {
            let mut one = first.clone();
            one.reset(seed);
            one
        };
        let mut team = Team::new();
        let with_others = (0..Team::SIZE).all(|lane| team.enter(lane, &first.episode.craft));
        Ok(Self { all: (0..count as u64).map(make).collect(), team, with_others })
    }

    /// Each of them.
    pub fn all(&self) -> &[Environment] {
        &self.all
    }

    /// Begins the episode of a seed with one of them, by its number.
    pub fn reset(&mut self, number: usize, seed: u64) {
        self.all[number].reset(seed);
    }

    /// One tick, as [`Environment::step`], of those that there is an action for; what came of each.
    pub fn step<'a>(
        &mut self,
        action: impl Fn(usize) -> Option<&'a [f32; ACTIONS]>,
        mut came: impl FnMut(usize, Stepped),
    ) {
        let Self { all, team, with_others } = self;
        for (chunk, some) in all.chunks_mut(Team::SIZE).enumerate() {
            let mut begun = [const { None }; Team::SIZE];
            for (lane, one) in some.iter_mut().enumerate() {
                let Some(action) = action(chunk * Team::SIZE + lane) else { continue };
                let motors = one.motors(action);
                let craft = &mut one.episode.craft;
                if *with_others {
                    team.begin_tick(lane, craft, &motors.motors, motors.voltage_v);
                } else {
                    craft.advance(&motors.motors, motors.voltage_v);
                }
                begun[lane] = Some(motors);
            }
            team.advance();
            for (lane, one) in some.iter_mut().enumerate() {
                let Some(Motors { action, .. }) = &begun[lane] else { continue };
                if *with_others {
                    team.end_tick(lane, &mut one.episode.craft);
                }
                came(chunk * Team::SIZE + lane, one.end_tick(action));
            }
        }
    }
}

/// A craft that flies one episode after the other.
#[derive(Debug, Clone)]
pub struct Environment {
    task: Task,
    plant: Plant,
    /// Rotor speeds in hover, rad/s.
    hover_rad_s: [f64; 4],
    /// As every episode begins; present where actions are set points.
    fresh_law: Option<InProcess>,
    episode: Episode,
}

/// What changes from tick to tick.
#[derive(Debug, Clone)]
struct Episode {
    craft: SimulatedCraft,
    law: Option<InProcess>,
    delay: Delay<([f32; 3], [f32; 3])>,
    faults: Faults,
    sensed: ([f32; 3], [f32; 3]),
    gyro_rad_s: [f32; 3],
    measured_v: f32,
    tick: u32,
}

impl Environment {
    /// For a task, at the start of the episode of `seed`.
    ///
    /// # Errors
    /// A craft that cannot hover, or a plan or configuration that cannot be flown.
    pub fn new(mut task: Task, seed: u64) -> Result<Self, SilError> {
        // The room is the environment's own, and so is what ends an episode.
        task.plan.config.supervision.fence = Fence::NONE;
        let around = |axis: usize| [-task.room_m, task.room_m].map(|end| task.plan.start_m[axis] + end);
        task.plan.config.position_limits = PositionLimits { x_m: around(0), y_m: around(1), z_m: around(2) };
        task.plan.check()?;
        let law = InProcess::new(&task.plan.config)?;
        let fresh_law = (task.action != ActionKind::Motors).then_some(law);
        let plant = Plant::new(&task.plan.model);
        let hover_rad_s = Linear::new(&task.plan.model, &TrimTarget::default())?.equilibrium.rotor_rad_s;
        let episode = Episode::new((&task, &plant, hover_rad_s), fresh_law.clone(), seed);
        Ok(Self { task, plant, hover_rad_s, fresh_law, episode })
    }

    /// What it is for.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// The episode of `seed` begins: equal seeds and actions give equal episodes.
    pub fn reset(&mut self, seed: u64) {
        self.episode =
            Episode::new((&self.task, &self.plant, self.hover_rad_s), self.fresh_law.clone(), seed);
    }

    /// One tick with an action; parts of it beyond -1 and 1 count as these, and what is no number as 0.
    pub fn step(&mut self, action: &[f32; ACTIONS]) -> Stepped {
        let Motors { action, motors, voltage_v } = self.motors(action);
        self.episode.craft.advance(&motors, voltage_v);
        self.end_tick(&action)
    }

    /// What an action does to the motors.
    fn motors(&mut self, action: &[f32; ACTIONS]) -> Motors {
        let action = action.map(|part| if part.is_nan() { 0.0 } else { part.clamp(-1.0, 1.0) });
        let plan = &self.task.plan;
        let time_s = f64::from(self.episode.tick) * plan.config.sample_time_s;
        let [low, high] = plan.config.command_range.map(|end| end as f32);
        let pwm = match &self.episode.law {
            None => action.map(|part| low + 0.5 * (part + 1.0) * (high - low)),
            Some(_) => self.flown(&action, time_s),
        };
        let plan = &self.task.plan;
        let motors = self.episode.faults.motors(&plan.faults, time_s, pwm, plan.config.command_range);
        Motors { action, motors, voltage_v: self.episode.craft.voltage_v() }
    }

    /// What comes after the craft has advanced.
    fn end_tick(&mut self, action: &[f32; ACTIONS]) -> Stepped {
        self.episode.tick += 1;
        self.episode.sense();
        self.judged(action)
    }

    /// What the flight law makes of an action.
    fn flown(&mut self, action: &[f32; ACTIONS], time_s: f64) -> [f32; 4] {
        let (position_m, attitude_rad) = self.episode.sensed;
        let mut readings = Readings {
            time_us: (time_s * 1e6).round() as u32,
            pose: Some(Pose { position_m, attitude_rad }),
            pose_age_us: 0,
            gyro_rad_s: Some(self.episode.gyro_rad_s),
            battery_v: self.episode.measured_v,
            command: Some(self.command(action)),
            request: None,
            outputs_ready: true,
        };
        let plan = &self.task.plan;
        if !plan.faults.is_empty() {
            self.episode.faults.distort(&plan.faults, time_s, &mut readings);
        }
        let idle = [plan.config.command_range[0] as f32; 4];
        // The law in this process always answers.
        let answer = self.episode.law.as_mut().and_then(|law| law.tick(self.episode.tick, &readings).ok());
        answer.map_or(idle, |answer| answer.output.pwm)
    }

    fn command(&self, action: &[f32; ACTIONS]) -> Command {
        let plan = &self.task.plan;
        let [north, east, down] = plan.start_m.map(|place| place as f32);
        let (room, tilt) = (self.task.room_m as f32, MOST_TILT_RAD as f32);
        let yaw_of = |part: f32| plan.start_yaw_rad as f32 + part * std::f32::consts::PI;
        match self.task.action {
            ActionKind::Position => Command {
                mode: Mode::Position,
                position_m: [north + room * action[0], east + room * action[1]],
                z_m: down + room * action[2],
                yaw_rad: yaw_of(action[3]),
                ..Command::default()
            },
            _ => Command {
                mode: Mode::Attitude,
                attitude_rad: [tilt * action[0], tilt * action[1]],
                yaw_rad: yaw_of(action[2]),
                z_m: down + room * action[3],
                ..Command::default()
            },
        }
    }

    /// From the target, north, east, down, m.
    fn away_m(&self) -> Vector3<f64> {
        self.episode.craft.state.position_ned_m - Vector3::from(self.task.plan.start_m)
    }

    fn judged(&self, action: &[f32; ACTIONS]) -> Stepped {
        let period_s = self.task.plan.config.sample_time_s;
        let state = &self.episode.craft.state;
        let away_m = self.away_m();
        let upright = frames::dcm_from_quaternion(&state.attitude)[(2, 2)];
        let terminated = !self.episode.craft.is_there() || away_m.amax() > self.task.room_m || upright <= 0.0;
        let effort: f32 = action.iter().map(|part| part * part).sum();
        let cost = away_m.norm_squared()
            + 0.1 * state.velocity_m_s.norm_squared()
            + 0.1 * state.rate_rad_s.norm_squared()
            + 0.01 * f64::from(effort);
        let cost = if terminated { LOST } else { cost * period_s };
        let truncated = f64::from(self.episode.tick) * period_s >= self.task.plan.duration_s - 0.5 * period_s;
        Stepped { reward: -cost, terminated, truncated: truncated && !terminated }
    }

    /// What is seen now, as far as `out` goes; see [`ObservationKind::numbers`].
    pub fn observe(&self, out: &mut [f32]) {
        let mut numbers = out.iter_mut();
        let mut put = |parts: &[f64]| numbers.by_ref().zip(parts).for_each(|(out, part)| *out = *part as f32);
        match self.task.observation {
            ObservationKind::State => {
                let state = &self.episode.craft.state;
                put(self.away_m().as_slice());
                put(frames::dcm_from_quaternion(&state.attitude).tr_mul(&state.velocity_m_s).as_slice());
                put(one_branch(state.attitude).as_slice());
                put(state.rate_rad_s.as_slice());
                put(&std::array::from_fn::<f64, 4, _>(|k| state.rotor_rad_s[k] / self.hover_rad_s[k]));
            }
            ObservationKind::Sensors => {
                let (position_m, euler_rad) = self.episode.sensed;
                let target_m = self.task.plan.start_m;
                put(&std::array::from_fn::<f64, 3, _>(|axis| f64::from(position_m[axis]) - target_m[axis]));
                let attitude = frames::quaternion_from_euler(Vector3::from(euler_rad.map(f64::from)));
                put(one_branch(attitude).as_slice());
                put(&self.episode.gyro_rad_s.map(f64::from));
                put(&[f64::from(self.episode.measured_v)]);
            }
        }
    }
}

impl Episode {
    fn new((task, plant, hover_rad_s): (&Task, &Plant, [f64; 4]), law: Option<InProcess>, seed: u64) -> Self {
        let Task { plan, start_m, start_m_s, start_rad, .. } = task;
        let period_s = plan.config.sample_time_s;
        let mut generator = stream(seed, Purpose::Conditions);
        let mut within = |most: f64| Vector3::from_fn(|_, _| most * generator.random_range(-1.0..=1.0));
        let mut state = State::at_rest(Vector3::from(plan.start_m) + within(*start_m), hover_rad_s);
        let velocity = within(*start_m_s);
        let tilt = within(*start_rad);
        state.attitude =
            frames::quaternion_from_euler(Vector3::new(tilt.x, tilt.y, plan.start_yaw_rad + tilt.z));
        state.velocity_m_s = frames::dcm_from_quaternion(&state.attitude) * velocity;
        let mut new = Self {
            craft: plan.craft_in(plant.clone(), state, period_s, seed),
            law,
            delay: Delay::new(plan.delay_samples),
            faults: Faults::default(),
            sensed: Default::default(),
            gyro_rad_s: [0.0; 3],
            measured_v: 0.0,
            tick: 0,
        };
        new.sense();
        new
    }

    fn sense(&mut self) {
        let voltage_v = self.craft.voltage_v();
        let sensed = self.craft.sense(voltage_v);
        self.sensed = self.delay.push((sensed.position_m, sensed.attitude_rad));
        self.gyro_rad_s = sensed.gyro_rad_s.unwrap_or([0.0; 3]);
        self.measured_v = sensed.battery_v;
    }
}

/// The one of both quaternions of an attitude that has w >= 0.
fn one_branch(attitude: Vector4<f64>) -> Vector4<f64> {
    if attitude[0] < 0.0 { -attitude } else { attitude }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Fault, FaultKind, NoiseModel};

    fn task(action: ActionKind) -> Task {
        let plan = FlightPlan { duration_s: 3.0, ..FlightPlan::thesis() };
        Task {
            plan,
            action,
            observation: ObservationKind::State,
            room_m: 1.0,
            start_m: 0.0,
            start_m_s: 0.0,
            start_rad: 0.0,
        }
    }

    /// Flies an action to the end of an episode: the last observation, the ticks and the last judgement.
    fn episode(environment: &mut Environment, action: [f32; 4]) -> (Vec<f32>, usize, Stepped) {
        let mut seen = vec![0.0; environment.task().observation.numbers()];
        for ticks in 1.. {
            let stepped = environment.step(&action);
            if stepped.terminated || stepped.truncated {
                environment.observe(&mut seen);
                return (seen, ticks, stepped);
            }
        }
        unreachable!()
    }

    /// The law holds the target, and flies where an action says; a room and an episode end where the task says.
    #[test]
    fn the_law_flies_where_an_action_says() {
        let mut environment = Environment::new(task(ActionKind::Position), 1).unwrap();
        let (seen, ticks, last) = episode(&mut environment, [0.0; 4]);
        assert_eq!(ticks, 300);
        assert!(last.truncated && !last.terminated);
        assert!(seen[..3].iter().all(|away| away.abs() < 0.05), "{seen:?}");
        assert!(last.reward > -1e-3 && last.reward <= 0.0, "{last:?}");

        let mut far = task(ActionKind::Position);
        far.plan.duration_s = 20.0;
        let mut environment = Environment::new(far, 1).unwrap();
        let (seen, _, last) = episode(&mut environment, [0.5, 0.0, -0.5, 0.0]);
        assert!(last.truncated, "{last:?}");
        assert!((seen[0] - 0.5).abs() < 0.1 && (seen[2] + 0.5).abs() < 0.1, "{seen:?}");
    }

    /// Idle motors lose the craft after the time of a fall through the room, sqrt(2 s / g), and the lag of the rotors.
    #[test]
    fn idle_motors_fall_out_of_the_room() {
        let mut environment = Environment::new(task(ActionKind::Motors), 1).unwrap();
        let (seen, ticks, last) = episode(&mut environment, [-1.0; 4]);
        assert!(last.terminated && !last.truncated && last.reward == -LOST);
        assert!((45..75).contains(&ticks), "{ticks}");
        assert!(seen[2] > 1.0);
    }

    #[test]
    fn equal_seeds_give_equal_episodes_and_others_do_not() {
        let mut drawn = task(ActionKind::Attitude);
        drawn.plan.noise = Some(NoiseModel::default());
        (drawn.start_m, drawn.start_m_s, drawn.start_rad) = (0.3, 0.5, 0.2);
        drawn.observation = ObservationKind::Sensors;
        let mut environment = Environment::new(drawn, 7).unwrap();
        let mut first = vec![0.0; SENSOR_NUMBERS];
        environment.observe(&mut first);
        let flown = episode(&mut environment, [0.1, -0.1, 0.0, 0.2]);
        let mut again = vec![0.0; SENSOR_NUMBERS];
        environment.reset(8);
        environment.observe(&mut again);
        assert_ne!(again, first);
        environment.reset(7);
        environment.observe(&mut again);
        assert_eq!(again, first);
        assert_eq!(episode(&mut environment, [0.1, -0.1, 0.0, 0.2]), flown);
    }

    /// Many step as each by itself, also where some wait.
    #[test]
    fn many_craft_step_as_each_by_itself() {
        let mut drawn = task(ActionKind::Position);
        drawn.plan.noise = Some(NoiseModel::default());
        (drawn.start_m, drawn.start_m_s, drawn.start_rad) = (0.3, 0.5, 0.2);
        let mut many = Environments::new(drawn.clone(), 11).unwrap();
        let mut alone: Vec<Environment> =
            (0..11).map(|seed| Environment::new(drawn.clone(), seed).unwrap()).collect();
        let action = |number: usize| [0.1 * number as f32 - 0.5, 0.2, -0.1, 0.0];
        let actions: Vec<[f32; 4]> = (0..11).map(action).collect();
        let waits = |number: usize, tick: usize| number == 4 && tick.is_multiple_of(3);
        for tick in 0..100 {
            let mut came = [None; 11];
            let given = |number: usize| (!waits(number, tick)).then_some(&actions[number]);
            many.step(given, |number, stepped| came[number] = Some(stepped));
            for (number, one) in alone.iter_mut().enumerate() {
                let expected = (!waits(number, tick)).then(|| one.step(&actions[number]));
                assert_eq!(came[number], expected, "{number}, {tick}");
                assert_eq!(one.episode.craft.state, many.all()[number].episode.craft.state);
            }
        }
    }

    /// A craft with a dead motor tumbles under the law that holds it otherwise; numbers that are none count as 0.
    #[test]
    fn a_dead_motor_loses_the_craft() {
        let mut broken = task(ActionKind::Position);
        broken.plan.faults = vec![Fault { kind: FaultKind::MotorDead(1), from_s: 0.5, for_s: 1e9 }];
        let mut environment = Environment::new(broken, 1).unwrap();
        let (_, ticks, last) = episode(&mut environment, [f32::NAN; 4]);
        assert!(last.terminated && ticks > 50, "{ticks}");
    }
}
