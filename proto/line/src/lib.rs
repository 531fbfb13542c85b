//! Words for people as one line: what comes out of a file, a name or a network cannot steer a terminal or a page with it.
//!
//! Errors quote what they found: a field, a file's name, a header. Where they reach a person, and nowhere else, they go through
//! [`error_line`]: one line of at most [`LONGEST_ERROR`] characters, without control characters (which move a terminal's cursor and
//! change its title) and without those that change the direction of writing (which let a text read otherwise than it is).
#![forbid(unsafe_code)]

/// Longest line that tells of an error, characters.
pub const LONGEST_ERROR: usize = 399;

/// Stands for what was cut out.
const CUT: &str = " ... ";

/// A text as one line: breaks and control characters become spaces, characters that change the direction of writing U+FFFD.
pub fn plain_line(text: &str) -> String {
    text.chars().map(shown).collect()
}

/// An error as one line of at most [`LONGEST_ERROR`] characters. A longer one keeps its beginning, which says where, and its end,
/// which says what to do.
pub fn error_line(text: &str) -> String {
    let line = plain_line(text.trim());
    let length = line.chars().count();
    if length <= LONGEST_ERROR {
        return line;
    }
    let kept = LONGEST_ERROR - CUT.len();
    let (head, tail) = (kept - kept / 2, kept / 2);
    line.chars().take(head).chain(CUT.chars()).chain(line.chars().skip(length - tail)).collect()
}

fn shown(character: char) -> char {
    match character {
        '\u{2028}' | '\u{2029}' => ' ',
        character if character.is_control() => ' ',
        character if changes_direction(character) => char::REPLACEMENT_CHARACTER,
        character => character,
    }
}

/// Unicode's `Bidi_Control` (UAX 9, section 2).
fn changes_direction(character: char) -> bool {
    matches!(
        character,
        '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_good_error_stays_as_it_is() {
        let said = "flight.csv: row 3: column \"t\" has \"ä\", which is not a number; mend it";
        assert_eq!(error_line(said), said);
        assert_eq!(error_line(&"x".repeat(LONGEST_ERROR)), "x".repeat(LONGEST_ERROR));
    }

    #[test]
    fn neither_a_terminal_nor_a_reader_is_led_astray() {
        let said = "\u{1b}]0;title\u{7}a\r\nb\u{2028}c\u{202e}vsc.exe\u{2066}\u{200f}\u{85}";
        assert_eq!(error_line(said), " ]0;title a  b c\u{fffd}vsc.exe\u{fffd}\u{fffd}");
    }

    #[test]
    fn a_long_error_keeps_where_and_what_to_do() {
        let line = error_line(&format!("a.csv: row 1: {}; sort the rows", "x,".repeat(5000)));
        assert_eq!(line.chars().count(), LONGEST_ERROR);
        assert!(line.starts_with("a.csv: row 1: x,") && line.ends_with("; sort the rows"), "{line}");
        assert!(line.contains("x ... ") || line.contains(", ... "), "{line}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn whatever_is_said_is_one_short_line_that_steers_nothing(
            parts in prop::collection::vec(
                prop_oneof![".{0,80}", "[\\x00-\\x1f\\x7f-\\x9f\u{2028}\u{2029}\u{200e}\u{200f}\u{61c}]{1,9}", "[\u{202a}-\u{202e}\u{2066}-\u{2069}]{1,5}"],
                0..20,
            ),
        ) {
            let line = error_line(&parts.concat());
            prop_assert!(line.chars().count() <= LONGEST_ERROR);
            prop_assert_eq!(line.lines().count().max(1), 1);
            let breaks = ['\u{2028}', '\u{2029}'];
            prop_assert!(!line.contains(char::is_control) && !line.contains(breaks), "{:?}", line);
            prop_assert!(!line.contains(changes_direction), "{:?}", line);
            prop_assert_eq!(error_line(&line), line.trim());
        }
    }
}
