//! What loops are judged by: margins, step responses, frequency responses, root loci, and the tilt
//! that a craft can hold.

mod frequency;
mod margins;
mod response;
mod root_locus;
mod steady_tilt;
mod study;

pub use frequency::{FrequencyPoint, actuator_bode, bode, closed_bode, loop_bode};
pub use margins::{
    Band, GainCrossing, LoopMargins, Margins, PhaseCrossing, delay_margin_s, phase_margin_deg,
};
pub(crate) use response::least_damped_seen;
pub use response::{
    LONG_S, Mode, Response, StepMetrics, bare_step, commanded, commanded_step, disturbance_step,
    least_damped, step_metrics, value_at,
};
pub use root_locus::root_locus;
pub(crate) use steady_tilt::extrapolated;
pub use steady_tilt::{Direction, SteadyTilt, steady_tilts};
pub use study::{Study, Together};
