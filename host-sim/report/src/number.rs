//! Numbers as people read them.

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

    proptest! {
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
