//! PID with velocity feedback.

/// The parts of one loop's output, in the loop's output unit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PidTerms {
    /// Proportional part.
    pub p: f32,
    /// Integral part.
    pub i: f32,
    /// Velocity feedback, sign included.
    pub d: f32,
    /// The loop's output: lag canceller applied to `p + i` where there is one, plus `d`, limited.
    pub output: f32,
}
