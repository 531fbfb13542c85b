//! Physical dimensions: which powers of metre, second, kilogram, volt and kelvin a quantity has.
//!
//! Angles have none, as everywhere in this project. Units are coherent SI: a metre, never a millimetre, so that a unit is
//! its dimension and no number hides in it.

use std::fmt;

/// The base units, in the order of the powers.
const BASE: [&str; 5] = ["kg", "m", "V", "K", "s"];

/// Powers of the base units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dimension([f64; 5]);

/// Units by name with the powers of kg, m, V, K, s.
const UNITS: [(&str, [f64; 5]); 14] = [
    ("kg", [1.0, 0.0, 0.0, 0.0, 0.0]),
    ("m", [0.0, 1.0, 0.0, 0.0, 0.0]),
    ("V", [0.0, 0.0, 1.0, 0.0, 0.0]),
    ("K", [0.0, 0.0, 0.0, 1.0, 0.0]),
    ("s", [0.0, 0.0, 0.0, 0.0, 1.0]),
    ("rad", [0.0; 5]),
    ("Hz", [0.0, 0.0, 0.0, 0.0, -1.0]),
    ("N", [1.0, 1.0, 0.0, 0.0, -2.0]),
    ("Nm", [1.0, 2.0, 0.0, 0.0, -2.0]),
    ("J", [1.0, 2.0, 0.0, 0.0, -2.0]),
    ("W", [1.0, 2.0, 0.0, 0.0, -3.0]),
    ("Pa", [1.0, -1.0, 0.0, 0.0, -2.0]),
    // A watt is a volt ampere.
    ("A", [1.0, 2.0, -1.0, 0.0, -3.0]),
    ("Ohm", [-1.0, -2.0, 2.0, 0.0, 3.0]),
];

impl Dimension {
    /// Of a pure number or an angle.
    pub(super) const NONE: Self = Self([0.0; 5]);

    /// Of a unit by its name.
    pub(super) fn of_unit(name: &str) -> Option<Self> {
        UNITS.iter().find(|(known, _)| *known == name).map(|(_, powers)| Self(*powers))
    }

    /// The names that [`Self::of_unit`] knows.
    pub(super) fn known_units() -> String {
        UNITS.map(|(name, _)| name).join(", ")
    }

    pub(super) fn times(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }

    pub(super) fn over(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }

    pub(super) fn to_the(self, power: f64) -> Self {
        Self(self.0.map(|p| p * power))
    }

    /// Powers may be roots: equal but for rounding is equal.
    pub(super) fn is(self, other: Self) -> bool {
        self.0.iter().zip(other.0).all(|(a, b)| (a - b).abs() < 1e-9)
    }
}

/// "kg m/s^2"; "1" for a pure number.
impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let factors =
            |sign: f64| -> Vec<String> {
                let present = BASE.iter().zip(self.0).map(|(name, power)| (name, sign * power));
                present
                    .filter(|(_, power)| *power > 1e-9)
                    .map(|(name, power)| {
                        if (power - 1.0).abs() < 1e-9 {
                            (*name).to_owned()
                        } else {
                            format!("{name}^{power}")
                        }
                    })
                    .collect()
            };
        let (above, below) = (factors(1.0), factors(-1.0));
        f.write_str(&if above.is_empty() { "1".to_owned() } else { above.join(" ") })?;
        match below.as_slice() {
            [] => Ok(()),
            [one] => write!(f, "/{one}"),
            several => write!(f, "/({})", several.join(" ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derived_units_are_products_of_base_units() {
        let unit = |name| Dimension::of_unit(name).unwrap();
        assert!(unit("N").times(unit("m")).is(unit("J")));
        assert!(unit("J").over(unit("s")).is(unit("V").times(unit("A"))));
        assert!(unit("V").over(unit("A")).is(unit("Ohm")));
        assert!(unit("N").over(unit("m").to_the(2.0)).is(unit("Pa")));
        assert!(unit("Hz").times(unit("s")).is(Dimension::NONE) && unit("rad").is(Dimension::NONE));
        assert!(Dimension::of_unit("mm").is_none());
    }

    #[test]
    fn units_are_written_as_people_write_them() {
        let unit = |name| Dimension::of_unit(name).unwrap();
        assert_eq!(unit("N").to_string(), "kg m/s^2");
        assert_eq!(unit("Pa").to_string(), "kg/(m s^2)");
        assert_eq!(unit("Hz").to_string(), "1/s");
        assert_eq!(unit("m").to_the(0.5).to_string(), "m^0.5");
        assert_eq!(Dimension::NONE.to_string(), "1");
    }
}
