//! Decimal numbers in flight files, exact to the last bit, at gigabytes a second.
//!
//! Clinger's fast path: up to 19 digits into an integer below 2^53 and a power of ten up to 10^22 are both exact in
//! an f64, so one multiplication or division rounds once and correctly. Everything else (about one number in a
//! million in real logs) goes to the standard library.
//!
//! Most numbers in logs are short, such as `-12.3456`: up to seven digits, a point, up to seven digits. Their decimals
//! are read eight bytes at once.

/// 10^0 to 10^22, all exact.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// 10^0 to 10^7.
const WHOLE_POWERS: [u64; 8] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000];

const EXACT: u64 = 1 << 53;

/// Reads the number that starts at `start` and ends before a comma, a line end or the end of `bytes`.
///
/// Returns the value and where it ends. An empty field and the words nan and inf (any case, signed) are missing
/// values: NaN. Blanks around the number are allowed. `None` when it is no number.
#[inline]
pub fn read(bytes: &[u8], start: usize) -> Option<(f64, usize)> {
    read_short(bytes, start).or_else(|| read_any(bytes, start))
}

/// Reads up to seven digits, a point and up to seven digits, which make an integer below 2^53. `None` for anything else.
#[inline]
fn read_short(bytes: &[u8], start: usize) -> Option<(f64, usize)> {
    let negative = bytes.get(start) == Some(&b'-');
    let first = start + usize::from(negative);
    let mut point = first;
    let mut whole = 0;
    // How many digits there are is well predicted, which keeps the next number from waiting for this one.
    while let Some(digit) = digit(bytes, point) {
        whole = 10 * whole + digit;
        point += 1;
        if point > first + 7 {
            return None;
        }
    }
    if point == first || bytes.get(point) != Some(&b'.') {
        return None;
    }
    let (part, decimals) = leading_digits(bytes, point + 1)?;
    let end = point + 1 + decimals;
    if decimals == 0 || !is_end(bytes, end) {
        return None;
    }
    let mantissa = whole * WHOLE_POWERS[decimals] + part;
    let magnitude = mantissa as f64 / POWERS[decimals];
    Some((if negative { -magnitude } else { magnitude }, end))
}

/// The number that the digits at `at` make and how many there are. `None` when there are eight or more, or when fewer
/// than eight bytes are left.
#[inline]
fn leading_digits(bytes: &[u8], at: usize) -> Option<(u64, usize)> {
    let eight = u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?);
    // Digits become 0 to 9. Adding 0x76 sets the top bit of every larger byte; what it carries goes to later bytes.
    let values = eight ^ 0x3030_3030_3030_3030;
    let others = (values.wrapping_add(0x7676_7676_7676_7676) | values) & 0x8080_8080_8080_8080;
    if others == 0 {
        return None;
    }
    let count = others.trailing_zeros() / 8;
    // Zeros in front, the last digit in the last byte; then neighbours make pairs, and pairs the number.
    let digits = (values << 8) << (56 - 8 * count);
    let pairs = digits.wrapping_mul(10).wrapping_add(digits >> 8);
    let first_and_third = (pairs & 0xFF_0000_00FF).wrapping_mul(100 + (1_000_000 << 32));
    let second_and_fourth = ((pairs >> 16) & 0xFF_0000_00FF).wrapping_mul(1 + (10_000 << 32));
    Some((first_and_third.wrapping_add(second_and_fourth) >> 32, count as usize))
}

/// Reads a number in any form.
fn read_any(bytes: &[u8], start: usize) -> Option<(f64, usize)> {
    let mut at = start;
    let negative = bytes.get(at) == Some(&b'-');
    at += usize::from(negative);
    let digits_start = at;
    let mut mantissa: u64 = 0;
    while let Some(digit) = digit(bytes, at) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    let mut digits = at - digits_start;
    let mut decimals = 0;
    if bytes.get(at) == Some(&b'.') {
        at += 1;
        let fraction_start = at;
        while let Some(digit) = digit(bytes, at) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
            at += 1;
        }
        decimals = at - fraction_start;
        digits += decimals;
    }
    if digits == 0 || digits > 19 || mantissa >= EXACT || decimals > 22 || !is_end(bytes, at) {
        return read_slowly(bytes, start);
    }
    let magnitude = mantissa as f64 / POWERS[decimals];
    Some((if negative { -magnitude } else { magnitude }, at))
}

#[inline]
fn digit(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(u64::from(digit))
}

#[inline]
fn is_end(bytes: &[u8], at: usize) -> bool {
    matches!(bytes.get(at), None | Some(b',' | b'\n' | b'\r'))
}

#[cold]
fn read_slowly(bytes: &[u8], start: usize) -> Option<(f64, usize)> {
    let length = bytes[start..].iter().position(|b| matches!(b, b',' | b'\n' | b'\r'));
    let end = length.map_or(bytes.len(), |n| start + n);
    let field = bytes[start..end].trim_ascii();
    if field.is_empty() {
        return Some((f64::NAN, end));
    }
    let value: f64 = std::str::from_utf8(field).ok()?.parse().ok()?;
    Some((if value.is_finite() { value } else { f64::NAN }, end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ordinary_and_odd_numbers() {
        for (text, expected) in [
            ("0.010", 0.01),
            ("-1205.1", -1205.1),
            ("1e3", 1000.0),
            (" 7 ", 7.0),
            ("+2.5", 2.5),
            ("5.", 5.0),
            (".5", 0.5),
        ] {
            assert_eq!(read(text.as_bytes(), 0), Some((expected, text.len())), "{text}");
        }
        assert!(read(b"", 0).unwrap().0.is_nan() && read(b"NaN,1", 0).unwrap().0.is_nan());
        assert!(read(b"-inf", 0).unwrap().0.is_nan());
        for text in ["abc", "1.2.3", "--1", "1-", "0x10", "-", ".", "1 2"] {
            assert_eq!(read(text.as_bytes(), 0), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_library(value in any::<f64>(), decimals in 0_usize..25) {
            for text in [format!("{value}"), format!("{value:.decimals$}"), format!("{value:e}")] {
                let expected: f64 = text.parse().unwrap();
                let (read, end) = read(text.as_bytes(), 0).unwrap();
                if expected.is_finite() {
                    prop_assert_eq!(read.to_bits(), expected.to_bits(), "{}", text);
                } else {
                    prop_assert!(read.is_nan());
                }
                prop_assert_eq!(end, text.len());
            }
        }

        /// With what follows in a row, so that eight bytes are there to be read at once.
        #[test]
        fn short_numbers_agree(text in "-?[0-9]{0,9}\\.?[0-9]{0,9}", after in "(,|\r|\n|,-?[0-9.]{1,9}[,x]| |x|e2,)[0-9,]{0,9}") {
            let row = format!("{text}{after}");
            let alone = read_any(row.as_bytes(), 0).map(|(value, end)| (value.to_bits(), end));
            prop_assert_eq!(read(row.as_bytes(), 0).map(|(value, end)| (value.to_bits(), end)), alone, "{}", row);
            if let (Some((bits, end)), Ok(expected)) = (alone, text.parse::<f64>()) && end == text.len() {
                prop_assert_eq!(bits, expected.to_bits(), "{}", row);
            }
        }

        #[test]
        fn small_decimals_agree(mantissa in any::<i64>(), places in 0_u32..22) {
            let scale = 10_i128.pow(places);
            let whole = i128::from(mantissa) / scale;
            let part = (i128::from(mantissa) % scale).abs();
            let sign = if mantissa < 0 && whole == 0 { "-" } else { "" };
            let text = format!("{sign}{whole}.{part:0width$}", width = places as usize);
            let expected: f64 = text.parse().unwrap();
            prop_assert_eq!(read(text.as_bytes(), 0).unwrap().0.to_bits(), expected.to_bits(), "{}", text);
        }

        #[test]
        fn never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = read(&bytes, 0);
        }
    }
}
