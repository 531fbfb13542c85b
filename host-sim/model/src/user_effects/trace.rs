//! Numbers that know their unit and how an effect's coefficients enter them, instead of a value.

use std::str::FromStr;

use crate::user_effects::arithmetic::Arithmetic;
use crate::user_effects::dimension::Dimension;

/// How coefficients enter a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Entry {
    /// Not at all.
    Free,
    /// A sum of coefficients times what is free of them.
    Linear,
    /// Such a sum and something free.
    Affine,
    /// In another way.
    Other,
}

/// A number with its unit, how coefficients enter it, and its value where that is known beforehand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Trace {
    pub(super) dimension: Dimension,
    pub(super) entry: Entry,
    pub(super) value: Option<f64>,
}

/// A traced number, or what is wrong with it.
#[derive(Debug, Clone)]
pub(super) struct Traced(pub(super) Result<Trace, String>);

impl Default for Traced {
    fn default() -> Self {
        Self(Ok(Trace { dimension: Dimension::NONE, entry: Entry::Free, value: Some(0.0) }))
    }
}

impl FromStr for Traced {
    type Err = std::num::ParseFloatError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let value = Some(text.parse()?);
        Ok(Self(Ok(Trace { dimension: Dimension::NONE, entry: Entry::Free, value })))
    }
}

impl Trace {
    /// A zero has any unit.
    fn is_zero(&self) -> bool {
        self.value == Some(0.0) && self.dimension.is(Dimension::NONE)
    }

    fn known(&self, other: &Self, f: fn(f64, f64) -> f64) -> Option<f64> {
        Some(f(self.value?, other.value?))
    }
}

impl Traced {
    fn with(self, other: Self, f: impl FnOnce(Trace, Trace) -> Result<Trace, String>) -> Self {
        // The first mistake is the one to tell.
        Self(self.0.and_then(|a| other.0.and_then(|b| f(a, b))))
    }

    /// Values of one unit.
    fn alike(
        self,
        other: Self,
        what: &str,
        f: fn(f64, f64) -> f64,
        entry: fn(Entry, Entry) -> Entry,
    ) -> Self {
        self.with(other, |a, b| {
            let dimension = match (a.is_zero(), b.is_zero()) {
                (true, _) => b.dimension,
                (_, true) => a.dimension,
                _ if a.dimension.is(b.dimension) => a.dimension,
                _ => {
                    return Err(format!(
                        "{what} {} and {}, which must have the same unit",
                        a.dimension, b.dimension
                    ));
                }
            };
            let entry = match (a.is_zero(), b.is_zero()) {
                (true, _) => b.entry,
                (_, true) => a.entry,
                _ => entry(a.entry, b.entry),
            };
            Ok(Trace { dimension, entry, value: a.known(&b, f) })
        })
    }

    /// A pure number of a value of any unit.
    fn pure(self, f: fn(f64) -> f64) -> Self {
        Self(self.0.map(|a| Trace {
            dimension: Dimension::NONE,
            entry: unless_free(a.entry, Entry::Free),
            value: a.value.map(f),
        }))
    }
}

fn sum_of(a: Entry, b: Entry) -> Entry {
    match (a, b) {
        _ if a == b => a,
        (Entry::Other, _) | (_, Entry::Other) => Entry::Other,
        _ => Entry::Affine,
    }
}

fn unless_free(a: Entry, b: Entry) -> Entry {
    if a == Entry::Free && b == Entry::Free { Entry::Free } else { Entry::Other }
}

impl Arithmetic for Traced {
    fn add(self, other: Self) -> Self {
        self.alike(other, "adds", |a, b| a + b, sum_of)
    }
    fn subtract(self, other: Self) -> Self {
        self.alike(other, "takes the difference of", |a, b| a - b, sum_of)
    }
    fn multiply(self, other: Self) -> Self {
        self.with(other, |a, b| {
            let entry = match (a.entry, b.entry) {
                (Entry::Free, entry) | (entry, Entry::Free) => entry,
                _ => Entry::Other,
            };
            Ok(Trace { dimension: a.dimension.times(b.dimension), entry, value: a.known(&b, |a, b| a * b) })
        })
    }
    fn divide(self, other: Self) -> Self {
        self.with(other, |a, b| {
            let entry = if b.entry == Entry::Free { a.entry } else { Entry::Other };
            Ok(Trace { dimension: a.dimension.over(b.dimension), entry, value: a.known(&b, |a, b| a / b) })
        })
    }
    fn power(self, other: Self) -> Self {
        self.with(other, |a, b| {
            if !b.dimension.is(Dimension::NONE) {
                return Err(format!("has an exponent in {}, which must be a pure number", b.dimension));
            }
            let dimension = match b.value {
                Some(power) => a.dimension.to_the(power),
                None if a.dimension.is(Dimension::NONE) => Dimension::NONE,
                None => {
                    return Err(format!("raises {} to a power that is not a fixed number", a.dimension));
                }
            };
            let entry = if b.value == Some(1.0) { a.entry } else { unless_free(a.entry, b.entry) };
            Ok(Trace { dimension, entry, value: a.known(&b, f64::powf) })
        })
    }
    fn minimum(self, other: Self) -> Self {
        self.alike(other, "takes the minimum of", f64::min, unless_free)
    }
    fn maximum(self, other: Self) -> Self {
        self.alike(other, "takes the maximum of", f64::max, unless_free)
    }
    fn angle(self, other: Self) -> Self {
        let angle = self.alike(other, "takes atan2 of", f64::atan2, unless_free);
        Self(angle.0.map(|a| Trace { dimension: Dimension::NONE, ..a }))
    }
    fn root(self) -> Self {
        Self(self.0.map(|a| Trace {
            dimension: a.dimension.to_the(0.5),
            entry: unless_free(a.entry, Entry::Free),
            value: a.value.map(f64::sqrt),
        }))
    }
    fn absolute(self) -> Self {
        Self(self.0.map(|a| Trace {
            entry: unless_free(a.entry, Entry::Free),
            value: a.value.map(f64::abs),
            ..a
        }))
    }
    fn sign(self) -> Self {
        self.pure(Arithmetic::sign)
    }
    fn step(self) -> Self {
        self.pure(Arithmetic::step)
    }
    fn of_pure(self, function: &'static str, f: fn(f64) -> f64) -> Self {
        Self(self.0.and_then(|a| {
            if !a.dimension.is(Dimension::NONE) {
                return Err(format!(
                    "takes {function} of {}, which must be a pure number: divide it by a constant with that unit (a bare \
                     number in it has none)",
                    a.dimension
                ));
            }
            Ok(Trace { entry: unless_free(a.entry, Entry::Free), value: a.value.map(f), ..a })
        }))
    }
}
