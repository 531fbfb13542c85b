//! What a step response is judged by: flights and linear loops by the same definitions, those of crate `design`.

pub use design::analysis::{StepMetrics, step_metrics, value_at};
