//! What the names in formulas of users' effects stand for.

use crate::memory::LagId;
use crate::quantity::Quantity;
use crate::sample::Sample;
use crate::user_effects::columns::FurtherColumn;

/// Where a name's value comes from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Input {
    Quantity(&'static Quantity),
    Further(FurtherColumn),
    Lagged(LagId),
    Coefficient(usize),
    Constant(f64),
}

impl Input {
    #[inline]
    pub(super) fn at(&self, sample: &Sample, coefficients: &[f64]) -> f64 {
        match self {
            Self::Quantity(quantity) => quantity.at(sample),
            Self::Further(column) => sample.input.further[column.place],
            Self::Lagged(lag) => sample.input.remembered(*lag),
            Self::Coefficient(k) => coefficients.get(*k).copied().unwrap_or(0.0),
            Self::Constant(value) => *value,
        }
    }

    /// Whether they have the same value at every sample.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Quantity(own), Self::Quantity(other)) => own.name == other.name,
            (Self::Further(own), Self::Further(other)) => own.place == other.place,
            (Self::Lagged(own), Self::Lagged(other)) => own == other,
            (Self::Coefficient(own), Self::Coefficient(other)) => own == other,
            (Self::Constant(own), Self::Constant(other)) => own.to_bits() == other.to_bits(),
            _ => false,
        }
    }
}
