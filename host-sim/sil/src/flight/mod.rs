//! One flight: its plan, the loop that flies it, and its recording.

mod battery;
mod closed_loop;
mod configuration;
mod error;
mod plan;
mod recording;
mod script;
mod side_by_side;

pub(crate) use battery::battery_of;
pub(crate) use closed_loop::fly_and_ask;
pub use closed_loop::{ClosedLoop, fly, fly_over};
pub(crate) use configuration::with_still_sensors;
pub use configuration::{CAGE_M, designed_config, flyable, for_identification};
pub use error::SilError;
pub use plan::FlightPlan;
pub(crate) use recording::Follower;
pub use recording::{Recording, Row, Truth, time_of_row_s};
pub(crate) use script::Start;
pub use script::{Script, StepAxis, StepCommand, Waypoint};
pub(crate) use side_by_side::fly_side_by_side;
