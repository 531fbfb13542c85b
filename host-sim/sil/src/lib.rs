//! Software in the loop: the controller that flies against the identified plant, 100 times a
//! second.
//!
//! A [`FlightPlan`] says everything about a flight: the [`model::Model`] that stands for the craft
//! (any model, with whatever effects), the controller's configuration, what is commanded at which
//! time ([`Script`], [`pattern::Excitation`]), the sensors' noise, delay and seed, and the battery.
//! [`fly`] turns it into a [`Recording`]; equal plans give equal bits. [`Scenario`] names the
//! flights of the thesis' chapter 5, each with its requirements.
//!
//! Order of a tick, as in the program that recomputed the thesis' responses ([`mod@reference`]):
//! 1. the sensors look at the craft; the pose enters a first-in-first-out line of
//!    [`FlightPlan::delay_samples`],
//! 2. the controller gets the oldest pose of the line, the gyro and the voltage as they are now,
//!    and the command,
//! 3. its motor commands become commanded rotor speeds at the voltage of now, held for the tick,
//! 4. the plant advances by one tick in [`FlightPlan::substeps`] Runge-Kutta steps.
//!
//! What flies is the whole [`control::Autopilot`], supervisor included, starting in the air.
//! [`Fault`]s break links, sensors, motors and clock; [`drills`] is the list of flights that set
//! off each failsafe, and of those that just do not.
//!
//! Controller and plant may be one process or two ([`FlightComputer`]): the messages are those of
//! crate `proto`, and the recordings do not differ in a single bit. The controller may also run on
//! the craft's own processors, emulated ([`Emulation`]); [`same_bits`] compares everything that it
//! computes there.
//!
//! Conventions: SI, inertial frame north-east-down, body frame front-right-down, Euler angles Z-Y-X
//! in radians.
//!
//! Deliberately absent: a floor (a craft that sinks below z = 0 flies on).
#![forbid(unsafe_code)]

mod craft;
pub mod endurance;
pub mod environment;
mod experiments;
pub mod failsafe;
mod flight;
mod flight_computer;
mod laboratory;
pub mod same_bits;
mod scenarios;

pub use craft::{Coloured, Fault, FaultKind, GustModel, NoiseModel, Sensors, SimulatedCraft};
pub use experiments::{manoeuvre, next_flight, predict};
pub use failsafe::{Drill, DrillResult, ExpectedResponse, drills};
pub use flight::{
    CAGE_M, ClosedLoop, FlightPlan, Recording, Row, Script, SilError, StepAxis, StepCommand, Truth, Waypoint,
    designed_config, fly, fly_over, flyable, for_identification, time_of_row_s,
};
pub use flight_computer::{
    Emulated, Emulation, FlightComputer, FlightComputerError, InProcess, Processor, Udp,
};
#[cfg(feature = "shared-memory")]
pub use flight_computer::{Iceoryx2, serve};
pub use laboratory::{Laboratory, Radio, Room};
pub use scenarios::{
    Judge, Judged, RequirementCheck, Scenario, ScenarioResult, Settings, Suite, Transport, page, reference,
};
