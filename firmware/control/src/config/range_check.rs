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

#[cfg(test)]
mod tests {
    use super::*;

    const CHECK: RangeCheck = RangeCheck { group: "table" };

    #[test]
    fn the_ends_of_a_range_belong_to_it() {
        assert_eq!([1.0, 2.0, 1.5].map(|value| CHECK.within("key", value, 1.0, 2.0)), [Ok(()); 3]);
        for (value, message) in [
            (0.9, "table.key is 0.9: give a number from 1 to 2"),
            (2.1, "table.key is 2.1: give a number from 1 to 2"),
            (f64::NAN, "table.key is NaN: give a finite number"),
        ] {
            assert_eq!(CHECK.within("key", value, 1.0, 2.0).unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn what_is_absent_is_not_checked() {
        assert_eq!(CHECK.optional("key", None, 1.0, 2.0), Ok(()));
        assert!(CHECK.optional("key", Some(3.0), 1.0, 2.0).is_err());
    }

    #[test]
    fn one_bad_number_spoils_an_array() {
        assert_eq!(CHECK.all("key", &[1.0, 2.0], 1.0, 2.0), Ok(()));
        assert!(CHECK.all("key", &[1.0, f64::INFINITY], 1.0, 2.0).is_err());
    }

    #[test]
    fn a_range_goes_upwards() {
        assert_eq!(CHECK.range("key", [-1.0, 1.0]), Ok(()));
        for ends in [[1.0, 1.0], [1.0, -1.0], [f64::NAN, 1.0]] {
            assert!(CHECK.range("key", ends).is_err(), "{ends:?}");
        }
    }
}
