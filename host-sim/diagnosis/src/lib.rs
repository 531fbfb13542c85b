//! Which physical effect does a model lack, or what has changed since it was good? With the evidence, and what to fly next.
#![forbid(unsafe_code)]

mod addition;
mod balance;
mod beginning;
mod change;
mod change_conclusion;
mod change_evidence;
mod change_fit;
mod change_scatter;
mod change_structure;
pub mod changes;
mod columns;
mod conclusion;
mod criteria;
mod diagnose;
mod discovery;
pub mod evidence;
mod figures;
mod finding;
mod held_out;
mod mending;
mod noise;
mod not_logged;
mod observer;
mod onset;
mod options;
mod other_splits;
pub mod planning;
mod ranking;
mod reason;
mod residual_tests;
mod screen;
mod search;
mod search_error;
mod significance;
mod stand_ins;
pub mod subsets;
#[cfg(test)]
mod testing;
mod unidentified;
mod wander;
pub mod workflow;

pub use addition::{Addition, add};
pub use change::Change;
pub use change_evidence::{ChangeEvidence, WhyChanged, why_changed};
pub use criteria::{AS_GOOD, rank_of_change};
pub use diagnose::{diagnose, diagnose_with};
pub use discovery::{Discovery, DiscoveryVerdict, FlightFall, FormNumber, Proposal};
pub use evidence::{Why, WhyError, why};
pub use finding::{AxisDrop, CoefficientFigures, Diagnosis, EffectFinding, Since, Unexplained, Verdict};
pub use observer::{Observer, Progress, Silent};
pub use options::Options;
pub use ranking::separating_manoeuvre;
pub use reason::{Dependence, Reason};
pub use search_error::SearchError;
pub use unidentified::recorded;
