//! Range checks of single numbers, with errors that name the parameter.

use crate::config::error::{ConfigError, Parameter};

/// Checks the numbers of one table of the configuration, and names the first bad one.
pub(crate) struct RangeCheck {
    pub(crate) group: &'static str,
}

impl RangeCheck {
    pub(crate) fn within(
        &self,
        name: &'static str,
        value: f64,
        minimum: f64,
        maximum: f64,
    ) -> Result<(), ConfigError> {
        let parameter = Parameter { group: self.group, name };
        if !value.is_finite() {
            return Err(ConfigError::NotFinite { parameter, value });
        }
        if value < minimum || value > maximum {
            return Err(ConfigError::OutOfRange { parameter, value, minimum, maximum });
        }
        Ok(())
    }

    pub(crate) fn optional(
        &self,
        name: &'static str,
        value: Option<f64>,
        minimum: f64,
        maximum: f64,
    ) -> Result<(), ConfigError> {
        value.map_or(Ok(()), |value| self.within(name, value, minimum, maximum))
    }

    pub(crate) fn all(
        &self,
        name: &'static str,
        values: &[f64],
        minimum: f64,
        maximum: f64,
    ) -> Result<(), ConfigError> {
        values.iter().try_for_each(|value| self.within(name, *value, minimum, maximum))
    }

    pub(crate) fn range(&self, name: &'static str, [low, high]: [f64; 2]) -> Result<(), ConfigError> {
        self.all(name, &[low, high], -1e5, 1e5)?;
        if low < high {
            return Ok(());
        }
        Err(ConfigError::EmptyRange { parameter: Parameter { group: self.group, name }, low, high })
    }
}
