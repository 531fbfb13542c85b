//! What the user's commands do: flights in, models and findings out.
//!
//! Every program, page and test that states a verdict goes through these functions, so that a published figure is the
//! product's own: reading and checking flights ([`FlightSets`]), setting their clocks and trim, fitting, judging on
//! flights held out, refinement, and the records in the model file.
//!
//! A caller passes an [`Observer`], which hears of progress and warnings and may cancel. Nothing here prints.

mod add;
mod asked;
mod by_flight;
mod changed;
mod compare;
mod corrections;
mod diagnose;
mod discover;
mod error;
mod estimates;
mod explain;
mod faults;
mod headings;
mod identify;
mod loaded;
mod mends;
mod own_winds;
mod record;
mod refinement;
mod revealed;
mod sets;
mod split;
mod unlike_rotors;
mod winds;

pub use crate::observer::{Observer, Progress, Silent};
pub use add::{Added, add};
pub use by_flight::{FlightFit, flight_by_flight};
pub use changed::{changed, changed_why};
pub use compare::{compare, line_up};
pub use diagnose::{diagnose, why};
pub use discover::{can_discover, discover, discover_after, effects_file, prepare_to_discover};
pub use error::WorkflowError;
pub use explain::{Explanation, Step, TakenOut, explain};
pub use faults::{Faults, Listed};
pub use identify::{Identified, identify};
pub use loaded::{LoadedFlight, Reading, import_log, names, sha256};
pub use mends::{MapToWrite, mends};
pub use record::{rotation_refused, shown_record};
pub use sets::{FlightSets, FlightsOfOneKind, HeldOutFlights, TrainingFlights};
pub use split::is_held_out;
