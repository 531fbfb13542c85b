//! Why there is nothing to refine.

/// Why there is nothing to refine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RefineError {
    /// No coefficient acts on the rows that are to be refined.
    #[error("the model has no coefficient to refine")]
    NothingToRefine,
    /// Half a second without the rotation says nothing.
    #[error("the model has no rotation to predict with: these flights did not determine it")]
    NoRotation,
    /// Too short for a rollout.
    #[error("the training flights have no stretch long enough to predict 50 samples ahead")]
    TooShort,
    /// The loss does not depend on a coefficient.
    #[error("the training flights do not determine the coefficients over half a second")]
    Singular,
}
