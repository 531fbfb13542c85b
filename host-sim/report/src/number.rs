//! Numbers as people read them: the one place where text for people is made of them.
//!
//! A value goes as far as its standard error tells it, the error to two digits. Very large and very small numbers have a power of ten
//! that is a multiple of three. A unit of 1 is not written. A p-value below a millionth is only bounded: what lies below says more of
//! the tails of a distribution than of the flights.

/// Smaller p-values are written as their bound.
const LEAST_P: f64 = 1e-6;
/// From here on percentages have a power of ten.
const LARGE_PERCENT: f64 = 1e4;
/// More digits behind the point than a value of this program can mean.
const MOST_DECIMALS: u32 = 12;
/// What stands for a number that is not known.
const UNKNOWN: &str = "-";

/// Writes `value` with `digits` significant digits (at least 1, at most 15).
///
/// Between 0.001 and a million the number is written out (`0.0123`, `9.81`, `123000`); outside, the exponent is a multiple of three
/// (`12.3e-6`). Trailing zeros are kept because they tell the precision. The text parses back to the rounded number. NaN is `NaN`,
/// infinity `inf`, and zero of either sign `0`.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = digits.clamp(1, 15);
    // The formatter of the standard library rounds correctly, so the exponent is the one after rounding: 9.99 to two digits is 1.0e1.
    let scientific = format!("{:.*e}", digits - 1, value);
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return scientific };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let negative = mantissa.starts_with('-');
    let figures: String = mantissa.chars().filter(char::is_ascii_digit).collect();
    let text = if (-3..6).contains(&exponent) {
        place_point(&figures, exponent)
    } else {
        let engineering = exponent.div_euclid(3) * 3;
        format!("{}e{engineering}", place_point(&figures, exponent - engineering))
    };
    if negative { format!("-{text}") } else { text }
}

/// Puts the decimal point so that the first of `figures` counts 10^`exponent`.
fn place_point(figures: &str, exponent: i32) -> String {
    if exponent < 0 {
        let zeros = "0".repeat((-exponent - 1).unsigned_abs() as usize);
        return format!("0.{zeros}{figures}");
    }
    let whole = exponent.unsigned_abs() as usize + 1;
    if figures.len() <= whole {
        format!("{figures}{}", "0".repeat(whole - figures.len()))
    } else {
        format!("{}.{}", &figures[..whole], &figures[whole..])
    }
}

/// Unit for people: none for a pure number, whose unit is `1`.
#[must_use]
pub fn unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// A value and its standard error to the same decimal and with the same power of ten; the error has two significant digits.
///
/// Without an error the value has four significant digits, and the error reads `-`.
#[must_use]
pub fn value_and_error(value: f64, std_error: Option<f64>) -> [String; 2] {
    let Some(error) = std_error.filter(|e| e.is_finite()) else {
        return [significant(value, 4), UNKNOWN.to_owned()];
    };
    if !value.is_finite() || error <= 0.0 {
        return [significant(value, 4), significant(error, 2)];
    }
    let largest = exponent(value.abs().max(error));
    let power = if (-3..6).contains(&largest) { 0 } else { largest.div_euclid(3) * 3 };
    // Two digits of the error as it is after rounding: 0.0996 is 0.10.
    let last = exponent(error) - 1 - power;
    let suffix = if power == 0 { String::new() } else { format!("e{power}") };
    [value, error].map(|v| format!("{}{suffix}", rounded_to(v / 10_f64.powi(power), last)))
}

/// Power of ten of the first of two significant digits.
fn exponent(value: f64) -> i32 {
    let scientific = format!("{value:.1e}");
    scientific.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

/// `value` rounded to a multiple of 10^`last`.
fn rounded_to(value: f64, last: i32) -> String {
    if last <= 0 {
        return fixed(value, last.unsigned_abs().min(MOST_DECIMALS) as usize);
    }
    let multiple = 10_f64.powi(last);
    fixed((value / multiple).round() * multiple, 0)
}

/// `0.1400 ± 0.0021 m`: a value, its standard error and the unit of both; the value alone where no error is known.
#[must_use]
pub fn with_error(value: f64, std_error: f64, unit_of_both: &str) -> String {
    if !(std_error > 0.0 && std_error.is_finite()) {
        return with_unit(&significant(value, 4), unit_of_both);
    }
    // Lengths have a unit of their own for what is small.
    let is_small = unit_of_both == "m" && value.abs().max(std_error) < 1e-3;
    let (scale, unit_of_both) = if is_small { (1e3, "mm") } else { (1.0, unit_of_both) };
    let [value, error] = value_and_error(scale * value, Some(scale * std_error));
    // A table keeps the power of ten of both; in a sentence a zero needs none.
    let is_zero = |mantissa: &str| mantissa.chars().all(|c| matches!(c, '0' | '.'));
    let value = value.split_once('e').map(|(mantissa, _)| mantissa).filter(|m| is_zero(m)).unwrap_or(&value);
    with_unit(&format!("{value} ± {error}"), unit_of_both)
}

/// `9.81 m/s^2`: a number that is written out, and its unit.
#[must_use]
pub fn with_unit(number: &str, of: &str) -> String {
    match unit(of) {
        "" => number.to_owned(),
        unit => format!("{number} {unit}"),
    }
}

/// Writes `value` with `decimals` digits behind the point; what rounds to zero has no sign. NaN reads `-`.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_nan() {
        return UNKNOWN.to_owned();
    }
    without_sign_of_zero(format!("{value:.decimals$}"))
}

fn without_sign_of_zero(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        _ => text,
    }
}

/// A percentage with one digit behind the point, without the sign `%`; those from 10000 on have a power of ten.
#[must_use]
pub fn percent(value: f64) -> String {
    if value.abs() < LARGE_PERCENT || !value.is_finite() { fixed(value, 1) } else { significant(value, 3) }
}

/// A p-value for a table: `0.012`, `4e-5`, and `<1e-6` for all that are smaller.
#[must_use]
pub fn p_value(p: f64) -> String {
    if p < LEAST_P {
        format!("<{LEAST_P:.0e}")
    } else if p < 0.001 {
        format!("{p:.0e}")
    } else {
        fixed(p, 3)
    }
}

/// A p-value for a sentence: `p = 0.012`, `p < 1e-6`.
#[must_use]
pub fn p_equation(p: f64) -> String {
    match p_value(p).strip_prefix('<') {
        Some(bound) => format!("p < {bound}"),
        None => format!("p = {}", p_value(p)),
    }
}

/// Exponent as superscript digits: `-6` is `⁻⁶`.
pub(crate) fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            '0' | '4'..='9' => char::from_u32(0x2070 + c as u32 - '0' as u32).unwrap_or(c),
            other => other,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn written_as_people_write() {
        for (value, digits, text) in [
            (0.1 + 0.2, 3, "0.300"),
            (9.81, 3, "9.81"),
            (-9.81, 2, "-9.8"),
            (0.0, 4, "0"),
            (-0.0, 4, "0"),
            (123_456.0, 3, "123000"),
            (999_999.0, 3, "1.00e6"),
            (9.99, 2, "10"),
            (0.001, 2, "0.0010"),
            (0.000_999_4, 3, "999e-6"),
            (1.234e-5, 3, "12.3e-6"),
            (1.0e-17, 3, "10.0e-18"),
            (1.5e6, 1, "2e6"),
            (4.0e8, 1, "400e6"),
            (f64::NAN, 3, "NaN"),
            (f64::NEG_INFINITY, 3, "-inf"),
        ] {
            assert_eq!(significant(value, digits), text, "{value:e} with {digits} digits");
        }
    }

    #[test]
    fn superscript_covers_every_digit() {
        assert_eq!(superscript(-1_234_567_890), "⁻¹²³⁴⁵⁶⁷⁸⁹⁰");
    }

    #[test]
    fn a_value_goes_as_far_as_its_error() {
        for (value, error, text) in [
            (1.234567, Some(0.0123), "1.235 0.012"),
            (0.14, Some(0.0000034), "0.1400000 0.0000034"),
            (0.01803252, Some(0.0000021), "0.0180325 0.0000021"),
            (0.1, Some(3.0), "0.1 3.0"),
            (1234.5, Some(123.0), "1230 120"),
            (-0.001, Some(0.5), "0.00 0.50"),
            (9.81, Some(0.0996), "9.81 0.10"),
            (12.3456e-6, Some(2.1e-6), "12.3e-6 2.1e-6"),
            (-80_562_395.451_4, Some(120_000.0), "-80.56e6 0.12e6"),
            (5.0, Some(2.0e7), "0e6 20e6"),
            (0.25, None, "0.2500 -"),
            (0.25, Some(f64::NAN), "0.2500 -"),
            (0.0, Some(0.0), "0 0"),
        ] {
            assert_eq!(value_and_error(value, error).join(" "), text, "{value:e} {error:?}");
        }
        assert_eq!(with_error(0.14, 0.002, "1"), "0.1400 ± 0.0020");
        assert_eq!(with_error(0.14, 0.002, "m"), "0.1400 ± 0.0020 m");
        assert_eq!(with_error(-491e-6, 91e-6, "m"), "-0.491 ± 0.091 mm");
        assert_eq!(with_error(1.2e5, 1.1e8, "1"), "0 ± 110e6");
        for unknown in [0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(with_error(0.14, unknown, "1"), "0.1400");
            assert_eq!(with_error(0.14, unknown, "m"), "0.1400 m");
        }
    }

    #[test]
    fn p_values_are_bounded_by_one_rule() {
        for (p, text) in [(1.0, "1.000"), (0.0125, "0.013"), (3.6e-5, "4e-5"), (1e-6, "1e-6")] {
            assert_eq!(p_value(p), text);
            assert_eq!(p_equation(p), format!("p = {text}"));
        }
        for p in [9.9e-7, 5.9e-104, 0.0] {
            assert_eq!(p_value(p), "<1e-6");
            assert_eq!(p_equation(p), "p < 1e-6");
        }
    }

    #[test]
    fn percentages_have_one_digit_and_no_sign_of_zero() {
        for (value, text) in [
            (64.66, "64.7"),
            (-0.04, "0.0"),
            (-0.06, "-0.1"),
            (-80_562_395.451_4, "-80.6e6"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(percent(value), text);
        }
    }

    proptest! {
        #[test]
        fn value_and_error_agree_in_decimals_and_power(
            value in -1e12_f64..1e12,
            log_error in -12_f64..12.0,
        ) {
            let error = 10_f64.powf(log_error);
            let [v, e] = value_and_error(value, Some(error));
            let split = |text: &str| {
                let (number, power) = text.split_once('e').unwrap_or((text, ""));
                (number.split_once('.').map_or(0, |(_, decimals)| decimals.len()), power.to_owned())
            };
            prop_assert_eq!(split(&v), split(&e), "{} {}", v, e);
            let (back, back_error): (f64, f64) = (v.parse().unwrap(), e.parse().unwrap());
            // Half a unit of the second digit is at most 5 % of the error; at most twelve decimals are written.
            let power = e.split_once('e').map_or(0, |(_, p)| p.parse().unwrap());
            let written = 0.5 * 10_f64.powi(power - 12);
            prop_assert!((back_error - error).abs() <= 0.0501 * error + written, "{e} for {error:e}");
            prop_assert!((back - value).abs() <= 0.0501 * error + written + 1e-15 * value.abs(), "{v} for {value:e}");
        }

        #[test]
        fn parses_back_within_half_a_digit(value in proptest::num::f64::NORMAL, digits in 0_usize..20) {
            let text = significant(value, digits);
            let back: f64 = text.parse().unwrap();
            // Half a unit of the last kept digit, relative to a leading digit of 1: 0.5 · 10^(1 - digits); the rest is f64 rounding.
            let tolerance = 0.5 * 10_f64.powi(1 - digits.clamp(1, 15) as i32) * (1.0 + 1e-12) + 1e-15;
            // Rounding the largest f64 up overflows when read back; the text itself is right.
            prop_assert!(back.is_infinite() || (back / value - 1.0).abs() <= tolerance, "{value:e} -> {text}");
        }
    }
}
