//! Gains from a model and specifications: `quadlab design`.
//!
//! Two methods share one set of steps, inner loops before outer ones ([`design`]):
//!
//! - [`Method::Thesis`]: chapter 5 step by step, on the continuous loops: roll and pitch (5.3.1),
//!   yaw and altitude (5.3.2), position (5.4). Where the thesis reads a root locus by eye, a rule
//!   stands here (each is given with its step), so the gains come out near Tables 5.1 to 5.3 and
//!   not equal to them.
//! - [`Method::Delay`] (default): starts from those gains and searches, on the loops as they fly
//!   (100 Hz, matched-Z filters, a late pose), for gains that keep the margins, stay stable with a
//!   pose that is later still, and answer fast without a dip. The search is the simplex of Nelder
//!   and Mead (crate argmin) on the logarithms of the gains: deterministic, without derivatives.
//!
//! Deliberately absent: the nonlinear flight with the result (crate `sil`).

mod attitude;
mod damping;
mod draft;
mod flown;
mod judging;
mod position;
mod procedure;
mod scan;
mod search;
mod shortfall;
mod specs;
mod yaw_altitude;

pub use draft::Step;
pub use procedure::{Designed, design};
pub use shortfall::shortfalls;
pub use specs::{AttitudeSpecs, Method, PositionSpecs, SlowSpecs, Specs};

pub use crate::error::{Criterion, Shortfall, SpecKey};
