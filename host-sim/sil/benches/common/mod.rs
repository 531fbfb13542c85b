//! The flight that the benches of the loop share.

use sil::{FlightPlan, Scenario, Settings};

/// The repeating pattern: outer and inner loops, four terms of aerodynamics, never at rest. Ideal
/// sensors, no delay, one Runge-Kutta step a tick.
pub(crate) fn plan(duration_s: f64) -> FlightPlan {
    let settings = Settings { delay_samples: 0, substeps: Some(1), ..Settings::default() };
    FlightPlan { duration_s, ..Scenario::Pattern.plan(&settings) }
}
