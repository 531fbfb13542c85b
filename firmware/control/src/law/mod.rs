//! The control law: estimators, loops, and the [`Controller`](controller::Controller) that ticks
//! them.

pub mod altitude;
pub mod attitude;
pub(crate) mod carried;
pub mod controller;
pub mod estimator;
pub(crate) mod height;
pub mod pid;
pub mod position;
pub mod terms;
