//! What a search over the shapes of an effect asks of it.

/// Where a least squares ended: all coefficients, and how much is left with them and with the free ones at zero.
pub(crate) struct End {
    /// The error of the training flights from these values on.
    pub(crate) score: f64,
    /// Their error without the effect.
    pub(crate) without: f64,
    /// Coefficients of the effect.
    pub(crate) values: Vec<f64>,
}

/// An effect at given shapes.
pub(crate) trait Shapes {
    /// The coefficients that the shape leaves free together with the linear ones, on the axes that the effect acts on. Nothing
    /// where they are not determined or not finite.
    fn solve(&mut self, shape: &[f64]) -> Option<End>;
}
