//! The model of a quadcopter: one equation of motion, physical effects as its terms, and the files that hold them.
//!
//! Everything in the project turns around one value, the [`Model`]: a [`Vehicle`] (what the operator measured), a
//! list of [`Effect`]s, and a value with unit and standard error for each coefficient of each effect. Identification
//! writes it; comparison, simulation and design read it.
//!
//! Conventions (thesis chapter 2, with the resolutions of its misprints written where they matter):
//! - SI units, radians. Inertial frame north-east-down (z down, height = -z). Body frame front-right-down.
//! - Euler angles Z-Y-X: yaw psi, pitch theta, roll phi. The direction cosine matrix of (2.2) takes *inertial*
//!   components to *body* components; its transpose takes body to inertial.
//! - Rotors, seen from above: 1 front-left, 2 front-right, 3 rear-right, 4 rear-left.
//! - Every term is `+ coefficient x regressor`, as in (4.3): a drag has a negative coefficient.
//!
//! What is deliberately absent: sensors, noise and delay (crate `sil`), and everything that estimates (crate `sysid`).
#![forbid(unsafe_code)]

mod axis;
mod battery;
mod effect;
pub mod effects;
mod fit_record;
pub mod frames;
mod lags;
mod log_columns;
mod memory;
mod model;
mod model_file;
mod pendulum;
mod physical;
mod plant;
mod quantity;
pub mod rotor_lag;
mod rotor_quantity;
mod sample;
pub mod user_effects;
mod vehicle;
mod verdict;

pub use axis::{AXES, Axis, PerAxis};
pub use battery::Battery;
pub use effect::{Coefficient, EffectInfo, Estimate, Kind, Question, Requirement, Sign, Sink, Special};
pub use effects::slung_load::cable::SlungLoad;
pub use effects::{Adjustments, Effect, THRUST_DIFFERENCES, Untilt, thrust_shares};
pub use fit_record::{
    AxisError, BalanceRecord, BalanceRow, ChangeScatter, ConstantForceRecord, FitRecord, FlightRecord,
    FlightRole, HistoryEntry, MotorAnswer, OpenLoopSums, ReferenceValues, RefinementRecord,
    TrackerMountRecord,
};
pub use lags::{Followed, LAG_TIMES_S, Lag, Lags};
pub use log_columns::{
    BodyFrame, LogColumn, LogColumns, LogFrames, QuaternionTurn, ScaledColumn, WorldFrame,
};
pub use memory::{LagId, MAX_LAGS, Memory};
pub use model::{Correlation, Model, Term};
pub use model_file::ModelError;
pub use pendulum::Pendulum;
pub use physical::{PhysicalParameter, physical_parameters};
pub use plant::{Abreast, DelayLine, Hold, Holds, LANES, Plant, State, Substeps};
pub use quantity::{COMBINATIONS, QUANTITIES, Quantity};
pub use rotor_quantity::RotorQuantity;
pub use sample::{Further, MAX_FURTHER, NO_FURTHER, Sample, SampleInput, Surroundings};
pub use user_effects::UserEffectError;
pub use vehicle::{
    LONGEST_TOML_BYTES, MotorMapKind, Motors, Pack, RotorMap, Spin, Vehicle, VehicleError, too_long,
};
pub use verdict::{GROUPS, Group, NotIdentified, PerGroup, Verdict};
