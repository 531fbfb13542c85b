//! What a residual depends on, turned into words where it is shown.

use std::borrow::Cow;
use std::fmt;

use report::number::fixed;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Serialize, Serializer};

/// What the residual of an axis depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Dependence {
    /// Nothing measured: it is off by a constant.
    Constant,
    /// A measured quantity, by the name of its condition.
    Quantity(&'static str),
    /// What the axis was predicted to do shortly before.
    Past,
    /// Nothing measured: it oscillates.
    Oscillation {
        /// Frequency, Hz.
        frequency_hz: f64,
    },
    /// Nothing measured: it changes slowly.
    SlowChanges,
    /// Nothing measured: it comes in bursts, beyond anything in the flights of the model.
    Bursts,
}

impl Dependence {
    /// What it says of a residual: "depends on the height".
    pub(crate) fn predicate(self) -> String {
        match self {
            Self::Constant => format!("has a {self}"),
            Self::Oscillation { .. } | Self::SlowChanges | Self::Bursts => format!("shows {self}"),
            Self::Quantity(_) | Self::Past => format!("depends on the {self}"),
        }
    }

    /// The name of the measured quantity, where it is one.
    pub fn quantity(self) -> Option<&'static str> {
        match self {
            Self::Quantity(name) => Some(name),
            _ => None,
        }
    }
}

impl fmt::Display for Dependence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant => f.write_str("constant offset"),
            Self::Quantity(name) => f.write_str(name),
            Self::Past => f.write_str("accelerations of the last half second"),
            Self::Oscillation { frequency_hz } => {
                write!(f, "an oscillation at {} Hz", fixed(*frequency_hz, 2))
            }
            Self::SlowChanges => f.write_str("slow changes in time"),
            Self::Bursts => f.write_str("bursts far above those of the model's own flights"),
        }
    }
}

impl Serialize for Dependence {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl JsonSchema for Dependence {
    fn schema_name() -> Cow<'static, str> {
        "Dependence".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "description": "What a residual depends on, in words." })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_residual_depends_on_is_said_of_it() {
        let said = |of: Dependence| format!("w {}", of.predicate());
        assert_eq!(said(Dependence::Constant), "w has a constant offset");
        assert_eq!(said(Dependence::Quantity("height")), "w depends on the height");
        assert_eq!(said(Dependence::Oscillation { frequency_hz: 2.5 }), "w shows an oscillation at 2.50 Hz");
        assert_eq!(Dependence::Quantity("height").quantity(), Some("height"));
        assert_eq!(Dependence::Past.quantity(), None);
    }
}
