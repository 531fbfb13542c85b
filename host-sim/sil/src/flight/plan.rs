//! Everything about a flight before it is flown.

use control::supervision_limits::Fence;
use control::{Config, Controller};
use model::{Battery, Model, Plant, State, frames};
use nalgebra::Vector3;
use pattern::Pattern;

use super::battery::{FLIGHT_BATTERY, THESIS_BATTERY_V, battery_of};
use super::configuration::for_identification;
use super::error::SilError;
use super::script::{Script, Start, StepAxis, StepCommand};
use crate::craft::{Fault, GustModel, NoiseModel, Sensors, SimulatedCraft};

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
    /// Gusts; absent: still air, but for the winds of the model.
    pub gusts: Option<GustModel>,
    /// The battery.
    pub battery: Battery,
    /// Seed of the noise, of the gusts and of the excitation.
    pub seed: u64,
    /// Runge-Kutta steps in a tick; absent: as many as the model needs ([`Plant::enough_substeps`]).
    pub substeps: Option<u32>,
    /// Inertial z of a floor under the craft, m; absent: it may fall for ever.
    pub floor_m: Option<f64>,
    /// The craft stands on the floor under its start, disarmed, instead of flying.
    pub on_the_floor: bool,
    /// What goes wrong during the flight.
    pub faults: Vec<Fault>,
    /// The craft's clock at the start, us.
    pub clock_us: u32,
}

impl FlightPlan {
    /// Hover of the thesis' craft under the thesis' law: 1 m high, 2 samples of delay, 11.1 V,
    /// ideal sensors, 10 s.
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
            gusts: None,
            battery: Battery::constant(THESIS_BATTERY_V),
            seed: 0,
            substeps: None,
            floor_m: None,
            on_the_floor: false,
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
        let step = StepCommand { axis, size, at_s: 1.0 };
        let mut plan = Self { script: Script::Step(step), duration_s: step.at_s + after_s, ..Self::thesis() };
        if matches!(axis, StepAxis::Roll | StepAxis::Pitch) {
            // A held angle flies tens of metres in 10 s; the reference has no walls.
            plan.config.supervision.fence = Fence::NONE;
        }
        plan
    }

    /// A flight to identify `model` from (thesis 4.2.1): a tour of the cage that differs from seed
    /// to seed, excited motors, noisy sensors, a battery that falls and sags.
    ///
    /// It is flown with the model-based law and three changes, each needed to fly 2 to 3 m/s on any
    /// craft near the thesis': the reference may move at 2.5 m/s instead of 0.5; angles are limited
    /// to 20 degrees (held roll of 30 degrees loses control, see `roll-30` in crate `sil`'s tests);
    /// rates come from the gyro above 5 rad/s, thesis (4.6), because from the delayed pose alone
    /// the pitch loop keeps 8.5 % of gain margin.
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

    /// A pattern flown by `model` under `config` with the sensors, battery and pose delay of an
    /// identification flight, from rest where the pattern begins.
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

    pub(crate) fn check(&self) -> Result<(), SilError> {
        let refuse = |field, value: String, expected| Err(SilError::Plan { field, value, expected });
        let period_s = self.config.sample_time_s;
        if !(self.duration_s >= period_s && self.duration_s <= 86_400.0) {
            return refuse("duration_s", self.duration_s.to_string(), "one tick to a day");
        }
        if let Some(substeps) = self.substeps.filter(|substeps| !(1..=1000).contains(substeps)) {
            return refuse("substeps", substeps.to_string(), "1 to 1000 integration steps in a tick");
        }
        if self.gusts.is_some_and(|gusts| !(gusts.deviation_m_s >= 0.0 && gusts.time_s > 0.0)) {
            return refuse(
                "gusts",
                format!("{:?}", self.gusts),
                "a deviation of 0 m/s or more and a time above 0 s",
            );
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
    pub(crate) fn ticks(&self) -> u32 {
        (self.duration_s / self.config.sample_time_s).round() as u32
    }

    pub(super) fn start(&self) -> Start {
        Start { position_m: self.start_m, yaw_rad: self.start_yaw_rad }
    }

    /// The craft at its start, with rotors at the speeds that the controller's first tick asks for.
    pub(super) fn craft(&self) -> Result<SimulatedCraft, SilError> {
        self.craft_with_period(self.config.sample_time_s)
    }

    /// The craft at its start, to be advanced in ticks of another length.
    pub(crate) fn craft_with_period(&self, period_s: f64) -> Result<SimulatedCraft, SilError> {
        self.check()?;
        let plant = Plant::new(&self.model);
        let mut state = State::at_rest(Vector3::from(self.start_m), [0.0; 4]);
        state.attitude = frames::quaternion_from_euler(Vector3::new(0.0, 0.0, self.start_yaw_rad));
        let mut ideal = Sensors::new(&self.model, None, period_s, 0);
        let command = Script::Hold.command(&self.start(), 0.0);
        // The voltage sags with the speeds and the speeds follow the voltage: three rounds settle
        // both.
        for _ in 0..3 {
            let voltage_v = self.battery.voltage_v(0.0, &state.rotor_rad_s);
            let mut controller = Controller::new(&self.config)?;
            let pwm = controller.tick(&ideal.sense(&state, voltage_v), &command).pwm;
            state.rotor_rad_s = plant.commanded_rad_s(&pwm.map(f64::from), voltage_v);
        }
        if self.on_the_floor {
            state.position_ned_m.z = self.floor_m.unwrap_or(0.0);
            state.rotor_rad_s = [0.0; 4];
        }
        Ok(self.craft_in(plant, state, period_s, self.seed))
    }

    /// The craft of a plan that can be flown, with its plant, in some state, to be advanced in ticks of `period_s`; the seed is of its
    /// noise and gusts.
    pub(crate) fn craft_in(&self, plant: Plant, state: State, period_s: f64, seed: u64) -> SimulatedCraft {
        let sensors = Sensors::new(&self.model, self.noise, period_s, seed);
        let substeps = self.substeps.unwrap_or_else(|| plant.enough_substeps(period_s));
        SimulatedCraft::new(plant, self.battery, sensors, state, period_s, substeps)
            .with_gusts(self.gusts, seed)
    }
}
