//! What a craft or its air remembers at one instant: values of the lags that formulas look back at (`lags.rs`).

/// Most lags in one model.
pub const MAX_LAGS: usize = 16;
/// No lag.
const NONE: u16 = u16::MAX;

/// A lag of this program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LagId(pub(crate) u16);

/// Values of lags at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Memory {
    pub(crate) lags: [u16; MAX_LAGS],
    pub(crate) values: [f64; MAX_LAGS],
}

/// Of nothing.
impl Default for Memory {
    fn default() -> Self {
        Self { lags: [NONE; MAX_LAGS], values: [0.0; MAX_LAGS] }
    }
}

impl Memory {
    /// The value of a lag; NaN where it is not remembered.
    #[inline]
    pub fn of(&self, lag: LagId) -> f64 {
        self.lags.iter().position(|own| *own == lag.0).map_or(f64::NAN, |place| self.values[place])
    }

    /// Halfway to another one.
    pub fn middle(&self, other: &Self) -> Self {
        let mut middle = *self;
        middle.values.iter_mut().zip(other.values).for_each(|(value, other)| *value = 0.5 * (*value + other));
        middle
    }

    /// Whether every value is finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.values.iter().sum::<f64>().is_finite()
    }
}
