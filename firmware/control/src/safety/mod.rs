//! The supervisor: what keeps a flight safe.
//!
//! | file | question |
//! |---|---|
//! | [`detectors`] | what is wrong in this tick? ([`aftermath`], [`limits`], [`timers`], [`plausibility`],
//! | | [`second_opinion`], [`standing`], [`touchdown`] and
//! | | [`hover_thrust`] help) |
//! | [`conditions`] | what can be wrong at all? One bit each, for telemetry and logs |
//! | [`state_machine`] | what does the craft do about it? |
//! | [`preflight`] | may it be armed? |
//!
//! From when on something counts as wrong is
//! [`supervision_limits`](crate::config::supervision_limits), in the gains file.

pub(crate) mod aftermath;
pub mod conditions;
pub(crate) mod detectors;
pub(crate) mod hover_thrust;
pub(crate) mod limits;
pub(crate) mod plausibility;
pub mod preflight;
pub(crate) mod second_opinion;
pub(crate) mod standing;
pub mod state_machine;
pub(crate) mod timers;
pub(crate) mod touchdown;
