//! What an effect says of itself, and how it hands over its columns.

use crate::Axis;

/// One coefficient of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficient {
    /// Name in files and JSON, after the thesis where it has one.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Smallest and largest physically possible value. Judged only where rotor speeds are real rad/s.
    pub possible: (f64, f64),
    /// An ordinary magnitude, the scale of search steps for effects that act through [`crate::Adjustments`].
    pub typical: f64,
    /// Standard deviation about zero of what is known before any flight, for coefficients that only mean something
    /// together with another one (the height offset of a ground effect that may not be there).
    pub prior: Option<f64>,
}

/// How an effect enters the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Part of the basic model (4.3): always there.
    Basic,
    /// Linear in its coefficients: each is a column of the regression and a term of the plant.
    Linear,
    /// Changes what the other terms see (wind, thrust near the floor, rotor speed, tracked point). Its regression
    /// columns are the derivatives of the residual with respect to its coefficients.
    Adjusting,
}

/// Which question an effect can answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// What does the model lack?
    Structure,
    /// Either: it may have been overlooked, or come about.
    Both,
    /// What changed since the model was good? A fit of everything absorbs it: a heavier craft has a smaller thrust
    /// coefficient, a shifted centre of mass other rotor moments.
    Change,
}

/// What an effect says of itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectInfo {
    /// The word for it in commands, files, JSON and pages.
    pub id: &'static str,
    /// One sentence for people.
    pub sentence: &'static str,
    /// How it enters the equations.
    pub kind: Kind,
    /// Which question it can answer.
    pub question: Question,
    /// Rows it acts on.
    pub axes: &'static [Axis],
    /// Its coefficients, in order.
    pub coefficients: &'static [Coefficient],
    /// The manoeuvre that shows it.
    pub excitation: &'static str,
    /// Effects that look alike, each with the manoeuvre that separates the two.
    pub confused_with: &'static [(&'static str, &'static str)],
}

/// Takes the entries of an effect's columns at one sample.
///
/// The same `columns` function of an effect feeds the regression (a sink that stores entries) and the plant (a sink
/// that multiplies by the coefficients and sums): an effect has one definition.
pub trait Sink {
    /// Coefficient `coefficient` (index within the effect) contributes `value` per unit to the row `axis`.
    fn add(&mut self, axis: Axis, coefficient: usize, value: f64);
}
