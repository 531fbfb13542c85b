//! The named flights of the thesis' chapter 5: what each has to fulfil, the reference responses,
//! and the page of a run.

mod judge;
pub mod page;
pub mod reference;
mod scenario;
mod suite;

pub use judge::{Judge, Judged};
pub use scenario::{RequirementCheck, Scenario, Settings};
pub use suite::{ScenarioResult, Suite, Transport};
