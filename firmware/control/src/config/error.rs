//! What can be wrong with a configuration, by name.

use core::fmt;

/// A parameter's place in the configuration, for example `roll.kp`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// The table it stands in; empty at the top level.
    pub group: &'static str,
    /// Its key.
    pub name: &'static str,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.group.is_empty() { f.write_str(self.name) } else { write!(f, "{}.{}", self.group, self.name) }
    }
}

/// Why a configuration cannot fly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ConfigError {
    /// A number is NaN or infinite.
    NotFinite {
        /// The parameter.
        parameter: Parameter,
        /// Its value.
        value: f64,
    },
    /// A number lies outside what makes sense.
    OutOfRange {
        /// The parameter.
        parameter: Parameter,
        /// Its value.
        value: f64,
        /// Least allowed value.
        minimum: f64,
        /// Greatest allowed value.
        maximum: f64,
    },
    /// The first end of a range is not below the second.
    EmptyRange {
        /// The parameter.
        parameter: Parameter,
        /// First end.
        low: f64,
        /// Second end.
        high: f64,
    },
    /// A parameter stands where there is no use for it.
    NotApplicable {
        /// The parameter.
        parameter: Parameter,
    },
    /// The mixing matrix has no inverse: some axis cannot be commanded.
    SingularMixing,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotFinite { parameter, value } => write!(f, "{parameter} is {value}: give a finite number"),
            Self::OutOfRange { parameter, value, minimum, maximum } => {
                write!(f, "{parameter} is {value}: give a number from {minimum} to {maximum}")
            }
            Self::EmptyRange { parameter, low, high } => {
                write!(f, "{parameter} is [{low}, {high}]: the first number must be less than the second")
            }
            Self::NotApplicable { parameter } => write!(f, "{parameter} has no effect here: leave it out"),
            Self::SingularMixing => f.write_str(
                "mixing: the matrix has no usable inverse, so some axis cannot be commanded; check the rotor coefficients and their signs",
            ),
        }
    }
}

impl core::error::Error for ConfigError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// One line each: which parameter, what is wrong, what to do.
    #[test]
    fn messages_name_the_parameter_and_the_remedy() {
        let parameter = Parameter { group: "roll", name: "kp" };
        let cases = [
            (ConfigError::NotFinite { parameter, value: f64::NAN }, "roll.kp is NaN: give a finite number"),
            (
                ConfigError::OutOfRange { parameter, value: -1.0, minimum: 0.0, maximum: 1e6 },
                "roll.kp is -1: give a number from 0 to 1000000",
            ),
            (
                ConfigError::EmptyRange { parameter, low: 2.0, high: 1.0 },
                "roll.kp is [2, 1]: the first number must be less than the second",
            ),
            (ConfigError::NotApplicable { parameter }, "roll.kp has no effect here: leave it out"),
        ];
        for (error, message) in cases {
            assert_eq!(error.to_string(), message);
        }
        assert_eq!(Parameter { group: "", name: "sample_time_s" }.to_string(), "sample_time_s");
        assert!(ConfigError::SingularMixing.to_string().starts_with("mixing: "));
    }
}
