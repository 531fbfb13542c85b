//! A flight: what is flown ([`FlightPlan`]), flying it ([`fly`]), and what was recorded ([`Recording`]).

use control::supervision::Fence;
use control::{Config, Controller, Measurement, Pose, Readings};
use flights::{Column, Flight};
use model::{Battery, Model, Plant, State, frames};
use nalgebra::Vector3;

use crate::craft::Craft;
use crate::delay::Delay;
use crate::fault::{Fault, Faults};
use crate::link::{InProcess, Link, LinkError};
use crate::noise::NoiseModel;
use crate::script::{Script, Start, Step, StepAxis};
use crate::sensors::Sensors;
use pattern::{Excitation, Pattern};

/// The cage of the thesis' laboratory (chapter 3): 7.6 m x 5.2 m, 2.8 m high, centred on the origin. Greatest |x|, |y|
/// and height, m.
pub const CAGE_M: [f64; 3] = [3.8, 2.6, 2.8];

/// Why a flight cannot be flown.
#[derive(Debug, thiserror::Error)]
pub enum SilError {
    /// The controller's configuration.
    #[error("controller configuration: {0}")]
    Config(#[from] control::ConfigError),
    /// A gains file.
    #[error(transparent)]
    Gains(#[from] design::GainsError),
    /// A number of the plan.
    #[error("flight plan: {field} is {value}: {expected}")]
    Plan {
        /// Which.
        field: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: &'static str,
    },
    /// The link between plant and controller.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A user's formula without a value where the craft flew to: the flight ends there.
    #[error("the simulated flight ends after {time_s:.2} s: {undefined}")]
    Undefined {
        /// Which.
        undefined: model::user_effects::Undefined,
        /// When, s.
        time_s: f64,
    },
    /// An output file.
    #[error(transparent)]
    File(#[from] report::Error),
}

/// Everything about a flight before it is flown. Equal plans give equal bits.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightPlan {
    /// The craft: any model, with whatever effects.
    pub model: Model,
    /// The controller.
    pub config: Config,
    /// What is commanded.
    pub script: Script,
    /// Add the excitation of thesis 4.2.1 to the motor commands.
    pub excitation: bool,
    /// How long, s.
    pub duration_s: f64,
    /// Where it starts, at rest and level, inertial NED, m.
    pub start_m: [f64; 3],
    /// Heading at the start, rad.
    pub start_yaw_rad: f64,
    /// Age of the pose that the controller gets, samples (thesis 5.5: about 2).
    pub delay_samples: usize,
    /// Noise of the sensors; absent: ideal sensors.
    pub noise: Option<NoiseModel>,
    /// The battery.
    pub battery: Battery,
    /// Of noise and excitation.
    pub seed: u64,
    /// Runge-Kutta steps in a tick (reference: 4).
    pub substeps: u32,
    /// What goes wrong on the way.
    pub faults: Vec<Fault>,
    /// The craft's clock at the start, us.
    pub clock_us: u32,
}

impl FlightPlan {
    /// Hover of the thesis' craft under the thesis' law: 1 m high, 2 samples of delay, 11.1 V, ideal sensors, 10 s.
    pub fn thesis() -> Self {
        Self {
            model: Model::thesis(),
            config: Config::thesis(),
            script: Script::Hold,
            excitation: false,
            duration_s: 10.0,
            start_m: [0.0, 0.0, -1.0],
            start_yaw_rad: 0.0,
            delay_samples: 2,
            noise: None,
            battery: Battery::constant(THESIS_BATTERY_V),
            seed: 0,
            substeps: 4,
            faults: Vec::new(),
            clock_us: 0,
        }
    }

    /// A step of the thesis' craft at t = 1 s, recorded as long as the reference does.
    pub fn thesis_step(axis: StepAxis, size: f64) -> Self {
        let after_s = match axis {
            StepAxis::Roll | StepAxis::Pitch => 10.0,
            StepAxis::Yaw => 15.0,
            StepAxis::Z => 20.0,
            StepAxis::X | StepAxis::Y => 40.0,
        };
        let step = Step { axis, size, at_s: 1.0 };
        let mut plan = Self { script: Script::Step(step), duration_s: step.at_s + after_s, ..Self::thesis() };
        if matches!(axis, StepAxis::Roll | StepAxis::Pitch) {
            // A held angle flies tens of metres in 10 s; the reference has no walls.
            plan.config.supervision.fence = Fence::NONE;
        }
        plan
    }

    /// A flight to identify `model` from (thesis 4.2.1): a tour of the cage that differs from seed to seed, excited
    /// motors, noisy sensors, a battery that falls and sags.
    ///
    /// It is flown with the model-based law and three changes, each needed to fly 2 to 3 m/s on any craft near the
    /// thesis': the reference may move at 2.5 m/s instead of 0.5; angles are limited to 20 degrees (held roll of 30
    /// degrees loses control, reference section 6); rates come from the gyro above 5 rad/s, thesis (4.6), because from
    /// the delayed pose alone the pitch loop keeps 8.5 % of gain margin (reference 2.5).
    pub fn identification(model: Model, seed: u64, duration_s: f64) -> Self {
        let battery = battery_of(&model, FLIGHT_BATTERY).unwrap_or(FLIGHT_BATTERY);
        Self {
            model,
            config: for_identification(Config::thesis()),
            script: Script::tour(seed, duration_s),
            excitation: true,
            duration_s,
            noise: Some(NoiseModel::default()),
            battery,
            seed,
            ..Self::thesis()
        }
    }

    /// A pattern flown by `model` under `config` with the sensors, battery and pose delay of an identification flight,
    /// from rest where the pattern begins.
    pub fn pattern(model: Model, config: Config, pattern: Pattern, seed: u64) -> Self {
        let first = pattern.at(0.0);
        Self {
            duration_s: pattern.duration_s(),
            start_m: first.position_m,
            start_yaw_rad: first.attitude_rad[2],
            script: Script::Pattern(pattern),
            excitation: false,
            config,
            ..Self::identification(model, seed, 1.0)
        }
    }

    fn check(&self) -> Result<(), SilError> {
        let refuse = |field, value: String, expected| Err(SilError::Plan { field, value, expected });
        let period_s = self.config.sample_time_s;
        if !(self.duration_s >= period_s && self.duration_s <= 86_400.0) {
            return refuse("duration_s", self.duration_s.to_string(), "one tick to a day");
        }
        if !(1..=1000).contains(&self.substeps) {
            return refuse("substeps", self.substeps.to_string(), "1 to 1000 integration steps in a tick");
        }
        if self.delay_samples > 1000 {
            return refuse("delay_samples", self.delay_samples.to_string(), "at most 1000");
        }
        if !(self.start_m.iter().all(|x| x.is_finite()) && self.start_yaw_rad.is_finite()) {
            return refuse("start_m, start_yaw_rad", format!("{:?}", self.start_m), "finite numbers");
        }
        Ok(())
    }

    /// Ticks after the first.
    fn ticks(&self) -> u32 {
        (self.duration_s / self.config.sample_time_s).round() as u32
    }

    fn start(&self) -> Start {
        Start { position_m: self.start_m, yaw_rad: self.start_yaw_rad }
    }

    /// The craft at its start, with rotors at the speeds that the controller's first tick asks for.
    fn craft(&self) -> Result<Craft, SilError> {
        self.craft_with_period(self.config.sample_time_s)
    }

    /// The same, to be advanced in ticks of another length.
    pub(crate) fn craft_with_period(&self, period_s: f64) -> Result<Craft, SilError> {
        self.check()?;
        let plant = Plant::new(&self.model);
        let mut state = State::at_rest(Vector3::from(self.start_m), [0.0; 4]);
        state.attitude = frames::quaternion_from_euler(Vector3::new(0.0, 0.0, self.start_yaw_rad));
        let mut ideal = Sensors::new(&self.model, None, period_s, 0);
        let command = Script::Hold.command(&self.start(), 0.0);
        // The voltage sags with the speeds and the speeds follow the voltage: three rounds settle both.
        for _ in 0..3 {
            let voltage_v = self.battery.voltage_v(0.0, &state.rotor_rad_s);
            let mut controller = Controller::new(&self.config)?;
            let pwm = controller.tick(&ideal.sense(&state, voltage_v), &command).pwm;
            state.rotor_rad_s = plant.commanded_rad_s(&pwm.map(f64::from), voltage_v);
        }
        let sensors = Sensors::new(&self.model, self.noise, period_s, self.seed);
        Ok(Craft::new(plant, self.battery, sensors, state, period_s, self.substeps))
    }
}

/// The thesis' battery, V.
const THESIS_BATTERY_V: f64 = 11.1;
/// A lithium-polymer pack of three cells in mid-discharge that ends near the thesis' 11.1 V: its fall of 0.2 V a minute
/// and its sag of half a volt are assumed (the thesis gives neither).
const FLIGHT_BATTERY: Battery =
    Battery { full_v: 12.1, decay_v_per_s: 0.008, hover_sag_v: 0.5, hover_speed_rad_s: 635.0 };

/// The battery of a craft with another voltage than the thesis': the thesis' for this flight, scaled from its 11.1 V to what the
/// model was made at. A constant one stays constant; one that falls and sags does so by the same shares. Absent: the model
/// does not say at which voltage it was made.
///
/// A model file holds no battery: it says what the craft does at a voltage, and flights' voltages come with the flights. The
/// shares (a fall of 4 % a minute, 4 % of sag in hover) are those of a lithium-polymer pack of any number of cells.
pub(crate) fn battery_of(model: &Model, thesis: Battery) -> Option<Battery> {
    let made_at_v = model.reference.battery_v;
    if !(made_at_v > 0.0) {
        return None;
    }
    let share = made_at_v / THESIS_BATTERY_V;
    if share == 1.0 {
        return Some(thesis);
    }
    let hover_speed_rad_s = match design::trim::equilibrium(model, &design::trim::TrimTarget::default()) {
        Ok(hover) => hover.rotor_rad_s.iter().sum::<f64>() / 4.0,
        Err(_) => thesis.hover_speed_rad_s,
    };
    Some(Battery {
        full_v: share * thesis.full_v,
        decay_v_per_s: share * thesis.decay_v_per_s,
        hover_sag_v: share * thesis.hover_sag_v,
        hover_speed_rad_s,
    })
}

/// For flights with ideal sensors: a craft at rest without noise gives the same pose to the last bit for seconds, which on a
/// real one only a frozen tracker does, so that it is not judged how often a reading repeats.
pub(crate) fn with_still_sensors(mut config: Config) -> Config {
    const ANY: u32 = 1_000_000;
    (config.supervision.pose.repeats, config.supervision.imu.repeats) = (ANY, ANY);
    config
}

/// Gains with what an identification flight needs beside them ([`FlightPlan::identification`] says why): references that move at
/// 2.5 m/s, angles up to 20 degrees, the whole cage, and rates from the gyro.
pub fn for_identification(mut config: Config) -> Config {
    use control::gains::{Complement, GyroFusion, Law, PositionLimits};
    config.position_limits = PositionLimits { x_m: [-2.0, 2.0], y_m: [-1.2, 1.2], z_m: [-2.0, -0.1] };
    // Up to the walls: what a hidden effect does to the flight is what is wanted.
    let [x, y, ceiling] = CAGE_M;
    let fence = &mut config.supervision.fence;
    (fence.x_m, fence.y_m, fence.z_m[0]) = ([-x, x], [-y, y], -ceiling);
    config.estimation.gyro = Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::Exact });
    if let Law::ModelBased(law) = &mut config.law {
        for position in [&mut law.loops.x, &mut law.loops.y] {
            position.rate_limit_m_s = 2.5;
            position.output_limit_rad = Some(20_f64.to_radians());
        }
    }
    config
}

/// The craft as it is, in single precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Centre of mass, inertial NED, m.
    pub position_m: [f32; 3],
    /// Unit quaternion (w, x, y, z), body to inertial.
    pub attitude: [f32; 4],
    /// Velocity over ground, body components, m/s.
    pub velocity_m_s: [f32; 3],
    /// Body rates p, q, r, rad/s.
    pub rate_rad_s: [f32; 3],
    /// Rotor speeds, rad/s.
    pub rotor_rad_s: [f32; 4],
    /// Voltage at the battery's terminals, V.
    pub battery_v: f32,
}

/// One tick of a flight. Single precision is what sensors and controller have, and fresh memory for rows is a third of
/// the cost of a fast flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// The craft as it is.
    pub truth: Truth,
    /// What the sensors said of it, before the delay.
    pub sensed: Measurement,
    /// Commanded inertial x and y, m.
    pub position_command_m: [f32; 2],
    /// What the controller made of it.
    pub output: proto::Output,
    /// What the supervisor made of it.
    pub supervision: proto::Supervision,
}

impl Truth {
    #[inline]
    fn new(state: &State, battery_v: f64) -> Self {
        let three = |v: &Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        Self {
            position_m: three(&state.position_ned_m),
            attitude: <[f64; 4]>::from(state.attitude).map(|q| q as f32),
            velocity_m_s: three(&state.velocity_m_s),
            rate_rad_s: three(&state.rate_rad_s),
            rotor_rad_s: state.rotor_rad_s.map(|w| w as f32),
            battery_v: battery_v as f32,
        }
    }

    /// Phi, theta, psi, rad.
    pub fn euler_rad(&self) -> [f64; 3] {
        frames::euler_from_quaternion(&self.attitude.map(f64::from).into()).into()
    }

    /// Cosine of the angle between the body's and the inertial z axis: 1 level, -1 upside down.
    pub fn upright(&self) -> f64 {
        let [_, x, y, _] = self.attitude.map(f64::from);
        1.0 - 2.0 * (x * x + y * y)
    }
}

/// A flight as flown.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// One row a tick, from t = 0.
    pub rows: Vec<Row>,
    /// Time between rows, s.
    pub period_s: f64,
    /// Whether the craft's state stayed finite to the end; otherwise the recording ends where it did not.
    pub complete: bool,
}

/// Controller and craft in lockstep, to be stepped one tick at a time.
#[derive(Debug, Clone)]
pub struct ClosedLoop<'a, L> {
    plan: &'a FlightPlan,
    link: L,
    craft: Craft,
    start: Start,
    delay: Delay<([f32; 3], [f32; 3])>,
    excitation: Option<Excitation>,
    faults: Faults,
    /// What was answered last: what the motors go on doing while the loop stalls.
    answered: Option<proto::Outcome>,
    tick: u32,
}

impl<'a> ClosedLoop<'a, InProcess> {
    /// The start of `plan` with the controller in this process.
    ///
    /// # Errors
    /// A plan or configuration that cannot be flown.
    pub fn in_process(plan: &'a FlightPlan) -> Result<Self, SilError> {
        Self::new(plan, InProcess::new(&plan.config)?)
    }
}

impl<'a, L: Link> ClosedLoop<'a, L> {
    /// The start of `plan` with the controller behind `link`, which must be fresh and built from the plan's configuration.
    ///
    /// # Errors
    /// A plan or configuration that cannot be flown.
    pub fn new(plan: &'a FlightPlan, link: L) -> Result<Self, SilError> {
        plan.check()?;
        let [low, high] = plan.config.command_range;
        // The thesis' amplitudes are for a range of 1000 us.
        let excitation = Excitation::new(plan.seed, plan.config.sample_time_s, (high - low) / 1000.0);
        Ok(Self {
            link,
            craft: plan.craft()?,
            start: plan.start(),
            delay: Delay::new(plan.delay_samples),
            excitation: plan.excitation.then_some(excitation),
            faults: Faults::default(),
            answered: None,
            tick: 0,
            plan,
        })
    }

    /// One tick, and what was seen, commanded and done in it.
    ///
    /// # Errors
    /// What goes wrong on the link; never in process.
    #[inline]
    pub fn step(&mut self) -> Result<Row, LinkError> {
        let battery_v = self.craft.voltage_v();
        let sensed = self.craft.sense(battery_v);
        let (position_m, attitude_rad) = self.delay.push((sensed.position_m, sensed.attitude_rad));
        let time_s = f64::from(self.tick) * self.plan.config.sample_time_s;
        let mut command = self.plan.script.command(&self.start, time_s);
        if let Some(excitation) = &mut self.excitation {
            command.injection = excitation.next_sample();
        }
        let mut readings = Readings {
            time_us: self.plan.clock_us.wrapping_add((time_s * 1e6).round() as u32),
            pose: Some(Pose { position_m, attitude_rad }),
            gyro_rad_s: sensed.gyro_rad_s,
            battery_v: sensed.battery_v,
            command: Some(command),
            request: None,
            outputs_ready: true,
        };
        let stalled =
            !self.plan.faults.is_empty() && self.faults.distort(&self.plan.faults, time_s, &mut readings);
        let outcome = match self.answered {
            Some(answered) if stalled => answered,
            _ => self.link.tick(self.tick, &readings)?,
        };
        self.answered = Some(outcome);
        let proto::Outcome { output, supervision } = outcome;
        let truth = Truth::new(&self.craft.state, battery_v);
        let row = Row { truth, sensed, position_command_m: command.position_m, output, supervision };
        let motors =
            self.faults.motors(&self.plan.faults, time_s, output.pwm, self.plan.config.command_range);
        self.craft.advance(&motors, battery_v);
        self.tick += 1;
        Ok(row)
    }
}

/// Flies `plan` in this process.
///
/// # Errors
/// A plan or configuration that cannot be flown.
pub fn fly(plan: &FlightPlan) -> Result<Recording, SilError> {
    record(ClosedLoop::in_process(plan)?)
}

/// Flies `plan` with the controller behind `link`, as [`ClosedLoop::new`] wants it.
///
/// # Errors
/// A plan or configuration that cannot be flown, or what goes wrong on the link.
pub fn fly_over(plan: &FlightPlan, link: impl Link) -> Result<Recording, SilError> {
    record(ClosedLoop::new(plan, link)?)
}

fn record<L: Link>(mut flight: ClosedLoop<'_, L>) -> Result<Recording, SilError> {
    let plan = flight.plan;
    let count = plan.ticks() as usize + 1;
    let mut rows = Vec::with_capacity(count);
    while rows.len() < count && flight.craft.is_there() {
        rows.push(flight.step()?);
    }
    if let Some(undefined) = flight.craft.fault {
        let time_s = rows.len() as f64 * plan.config.sample_time_s;
        return Err(SilError::Undefined { undefined, time_s });
    }
    Ok(Recording { complete: rows.len() == count, rows, period_s: plan.config.sample_time_s })
}

impl Recording {
    /// Time of a row, s.
    pub fn time_s(&self, row: usize) -> f64 {
        // Through the nearest hundredth of a microsecond: 0.29 instead of 0.29000000000000004.
        (row as f64 * self.period_s * 1e8).round() / 1e8
    }

    /// Phi, theta, psi of the craft in each row, rad; yaw runs on through a turn.
    pub fn euler_rad(&self) -> Vec<[f64; 3]> {
        let mut turns = 0.0;
        let mut before: Option<f64> = None;
        let angles = self.rows.iter().map(|row| {
            let [roll, pitch, yaw] = row.truth.euler_rad();
            if let Some(before) = before {
                turns -= ((yaw - before) / std::f64::consts::TAU).round();
            }
            before = Some(yaw);
            [roll, pitch, yaw + turns * std::f64::consts::TAU]
        });
        angles.collect()
    }

    /// One quantity of the craft in each row.
    pub fn series(&self, axis: StepAxis) -> Vec<f64> {
        let position = |k: usize| self.rows.iter().map(|row| f64::from(row.truth.position_m[k])).collect();
        let angle = |k: usize| self.euler_rad().iter().map(|euler| euler[k]).collect();
        match axis {
            StepAxis::Roll => angle(0),
            StepAxis::Pitch => angle(1),
            StepAxis::Yaw => angle(2),
            StepAxis::X => position(0),
            StepAxis::Y => position(1),
            StepAxis::Z => position(2),
        }
    }

    /// Ticks in which a motor command stood at an end of its range.
    pub fn saturated_ticks(&self, command_range: [f64; 2]) -> usize {
        let [low, high] = command_range.map(|v| v as f32);
        self.rows.iter().filter(|row| row.output.pwm.iter().any(|&pwm| pwm <= low || pwm >= high)).count()
    }

    /// How far the craft stayed inside the cage at its closest, m; negative if it left it or hit the floor.
    pub fn cage_margin_m(&self) -> f64 {
        let margin = |row: &Row| {
            let [x, y, z] = row.truth.position_m.map(f64::from);
            let [x_limit, y_limit, ceiling] = CAGE_M;
            (x_limit - x.abs()).min(y_limit - y.abs()).min(ceiling + z).min(-z)
        };
        self.rows.iter().map(margin).fold(f64::INFINITY, f64::min)
    }

    /// The flight file of contract columns: poses as the sensors took them, gyro with its bias, measured voltage; with
    /// `rotor_speeds` the rotor speeds too, which a craft without tachometers does not log.
    pub fn to_flight(&self, name: impl Into<String>, rotor_speeds: bool) -> Flight {
        let column = |value: &dyn Fn(&Row) -> f64| -> Vec<f64> {
            self.rows.iter().map(|row| rounded(value(row))).collect()
        };
        let of = |pick: fn(&Row) -> f32| column(&|row| f64::from(pick(row)));
        let gyro =
            |k: usize| column(&|row| row.sensed.gyro_rad_s.map_or(f64::NAN, |rates| f64::from(rates[k])));
        let motor = |k: usize| column(&|row| f64::from(row.output.pwm[k]));
        let rotor = |k: usize| column(&|row| f64::from(row.truth.rotor_rad_s[k]));
        let time = (0..self.rows.len()).map(|row| self.time_s(row)).collect();
        let mut columns = vec![
            (Column::T, time),
            (Column::X, of(|row| row.sensed.position_m[0])),
            (Column::Y, of(|row| row.sensed.position_m[1])),
            (Column::Z, of(|row| row.sensed.position_m[2])),
            (Column::Phi, of(|row| row.sensed.attitude_rad[0])),
            (Column::Theta, of(|row| row.sensed.attitude_rad[1])),
            (Column::Psi, of(|row| row.sensed.attitude_rad[2])),
            (Column::P, gyro(0)),
            (Column::Q, gyro(1)),
            (Column::R, gyro(2)),
            (Column::Cmd1, motor(0)),
            (Column::Cmd2, motor(1)),
            (Column::Cmd3, motor(2)),
            (Column::Cmd4, motor(3)),
            (Column::Vbat, of(|row| row.sensed.battery_v)),
        ];
        if rotor_speeds {
            let omega = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];
            columns.extend(omega.into_iter().enumerate().map(|(k, column)| (column, rotor(k))));
        }
        Flight::from_columns(name, columns)
    }
}

/// To nine decimals: finer than any sensor, and free of the digits that widening an f32 brings.
fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_plans_give_equal_bits_and_seeds_differ() {
        let plan = |seed| FlightPlan::identification(Model::thesis(), seed, 5.0);
        let one = fly(&plan(1)).unwrap();
        assert_eq!(one, fly(&plan(1)).unwrap());
        assert_ne!(one, fly(&plan(2)).unwrap());
    }

    #[test]
    fn impossible_plans_are_refused_by_name() {
        type Edit = fn(&mut FlightPlan);
        let edits: [(Edit, &str); 5] = [
            (|p| p.duration_s = f64::NAN, "duration_s"),
            (|p| p.duration_s = 0.0, "duration_s"),
            (|p| p.substeps = 0, "substeps"),
            (|p| p.start_m[1] = f64::INFINITY, "start_m"),
            (|p| p.config.sample_time_s = -0.01, "sample_time_s"),
        ];
        for (edit, field) in edits {
            let mut plan = FlightPlan::thesis();
            edit(&mut plan);
            let error = fly(&plan).unwrap_err().to_string();
            assert!(error.contains(field), "{field}: {error}");
            assert_eq!(error.lines().count(), 1);
        }
    }

    #[test]
    fn yaw_runs_on_through_a_turn() {
        let mut plan = FlightPlan::thesis();
        plan.script = Script::Waypoints {
            list: (0..9)
                .map(|k| crate::Waypoint {
                    from_s: f64::from(k),
                    position_m: [0.0, 0.0, -1.0],
                    yaw_rad: f64::from(k) * 0.8,
                })
                .collect(),
            repeat_s: None,
        };
        let yaw: Vec<f64> = fly(&plan).unwrap().euler_rad().iter().map(|e| e[2]).collect();
        assert!(yaw.windows(2).all(|w| (w[1] - w[0]).abs() < 0.1));
        assert!((yaw.last().unwrap() - 6.4).abs() < 0.3, "{:?}", yaw.last());
    }

    #[test]
    fn a_flight_file_reads_back() {
        let recording = fly(&FlightPlan::identification(Model::thesis(), 3, 3.0)).unwrap();
        let flight = recording.to_flight("f.csv", true);
        let back = Flight::parse(flight.to_csv().as_bytes(), std::path::Path::new("f.csv")).unwrap();
        assert_eq!(back, flight);
        assert_eq!(back.len(), 301);
        assert_eq!(back.column(Column::T).unwrap()[29], 0.29);
        assert!(recording.to_flight("f.csv", false).column(Column::Omega1).is_none());
    }
}
