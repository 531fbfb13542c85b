//! Text in a drawing: how wide it is, where it breaks, and what of it can be shown.

/// Height of ordinary text, CSS pixels.
pub(super) const TEXT_PX: f64 = 13.0;
/// Height of a title, CSS pixels.
pub(super) const TITLE_PX: f64 = 15.0;
/// From one line to the next, CSS pixels.
pub(super) const LINE_PX: i32 = 18;
/// Width of an average sans-serif character over its height, rounded up: no font is at hand to measure with.
const CHARACTER: f64 = 0.58;
/// More lines are cut.
const MOST_LINES: usize = 3;

/// Replaces characters that neither XML nor HTML can hold.
pub(crate) fn printable(text: &str) -> String {
    let bad = |c: char| (c.is_control() && c != '\n' && c != '\t') || matches!(c, '\u{FFFE}' | '\u{FFFF}');
    text.chars().map(|c| if bad(c) { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// Text between tags or in an attribute.
pub(super) fn escape(text: &str) -> String {
    maud::html! { (text) }.into_string()
}

/// Width of a line, CSS pixels.
pub(super) fn text_width(text: &str, size_px: f64) -> i32 {
    (text.chars().count() as f64 * CHARACTER * size_px).ceil() as i32
}

fn characters_in(room_px: i32, size_px: f64) -> usize {
    (f64::from(room_px) / (CHARACTER * size_px)).max(4.0) as usize
}

/// Cuts a line that does not fit.
pub(super) fn shorten(text: &str, room_px: i32, size_px: f64) -> String {
    let most = characters_in(room_px, size_px);
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most - 1).chain(['…']).collect()
}

/// Breaks `text` at spaces into lines that fit.
pub(super) fn wrap(text: &str, room_px: i32, size_px: f64) -> Vec<String> {
    let most = characters_in(room_px, size_px);
    let mut lines: Vec<String> = vec![];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    if lines.len() > MOST_LINES {
        let rest = lines.split_off(MOST_LINES - 1).join(" ");
        lines.push(rest);
    }
    lines.iter().map(|line| shorten(line, room_px, size_px)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_at_spaces_and_the_rest_is_cut() {
        let room = text_width("twelve chars", TEXT_PX);
        assert_eq!(wrap("a bc def", room, TEXT_PX), ["a bc def"]);
        assert_eq!(wrap("twelve chars and more", room, TEXT_PX), ["twelve chars", "and more"]);
        let many = wrap(&"twelve chars ".repeat(9), room, TEXT_PX);
        assert_eq!(many.len(), MOST_LINES);
        assert_eq!(many[2], "twelve char…");
    }

    #[test]
    fn what_no_document_can_hold_is_replaced() {
        assert_eq!(printable("a\u{0}b\u{1b}c\n\td\u{FFFE}"), "a\u{FFFD}b\u{FFFD}c\n\td\u{FFFD}");
        assert_eq!(escape("<a href=\"x\"> & b"), "&lt;a href=&quot;x&quot;&gt; &amp; b");
    }
}
