//! Figures in sentences: as many digits as they deserve.

use model::Axis;

/// Chances below this are not told apart: the tails of no distribution are known so far out.
const SMALLEST_CHANCE: f64 = 1e-6;

/// "p = 0.012", or "p < 1e-6".
pub(crate) fn probability(p: f64) -> String {
    if p < SMALLEST_CHANCE { "p < 1e-6".into() } else { format!("p = {}", significant(p, 2)) }
}

/// "0.140 +- 0.012 N/m": the error with two digits and the value to the same place; the value alone where there is no error.
pub(crate) fn with_error(value: f64, std_error: f64, unit: &str) -> String {
    if !(std_error > 0.0 && std_error.is_finite()) {
        return with_unit(&significant(value, 4), unit);
    }
    let places = (1.0 - std_error.log10().floor()).clamp(0.0, 12.0) as usize;
    with_unit(&format!("{value:.places$} +- {std_error:.places$}"), unit)
}

/// A number with its unit; "1" is none.
pub(crate) fn with_unit(number: &str, unit: &str) -> String {
    if unit.is_empty() || unit == "1" { number.to_owned() } else { format!("{number} {unit}") }
}

/// A number with so many significant digits: written out, or with an exponent where that takes more than four zeros.
pub(crate) fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{:.0}", value.abs());
    }
    let exponent = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&exponent) {
        return format!("{value:.*e}", digits - 1);
    }
    let places = (digits as f64 - 1.0 - exponent).max(0.0) as usize;
    format!("{value:.places$}")
}

/// Percent by which a root mean square falls whose square falls by `percent`.
pub(crate) fn rms_fall_percent(percent: f64) -> f64 {
    100.0 * (1.0 - (1.0 - percent / 100.0).max(0.0).sqrt())
}

/// "rms error of u, v and w": of several axes, each counts in units of its noise.
pub(crate) fn rms_of(axes: &[Axis]) -> String {
    let names: Vec<&str> = axes.iter().map(|axis| axis.name()).collect();
    match names.as_slice() {
        all if all.len() == model::AXES.len() => "rms error of all axes".into(),
        [first @ .., last] if !first.is_empty() => format!("rms error of {} and {last}", first.join(", ")),
        few => format!("rms error of {}", few.concat()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_have_the_digits_that_they_deserve() {
        assert_eq!(probability(5.9e-104), "p < 1e-6");
        assert_eq!(probability(0.01234), "p = 0.012");
        assert_eq!(probability(0.5), "p = 0.50");
        assert_eq!(with_error(0.14, 0.0, "1"), "0.1400");
        assert_eq!(with_error(0.14036, 0.0123, "N/m"), "0.140 +- 0.012 N/m");
        assert_eq!(with_error(-1234.5, 310.0, "1"), "-1234 +- 310");
        assert_eq!(with_error(-2.5e-5, 3.0e-6, "s"), "-0.0000250 +- 0.0000030 s");
        assert_eq!(significant(-80_562_395.451_4, 4), "-8.056e7");
        assert_eq!(significant(-0.0, 3), "0");
        assert_eq!(significant(12.345, 3), "12.3");
    }

    #[test]
    fn a_root_falls_less_than_its_square_and_rises_with_it() {
        for (squared, root) in [(0.0, 0.0), (75.0, 50.0), (100.0, 100.0), (-300.0, -100.0)] {
            assert!((rms_fall_percent(squared) - root).abs() < 1e-12, "{squared}");
        }
    }
}
