//! A table that is both printed and shown on a page: built once, of words and of numbers that are already written out.

use std::fmt::Write as _;

use report::number::unit;

use crate::cli::colour;

/// Printed lines are at most this long where a word allows it.
const LINE_LENGTH: usize = 100;
/// Narrowest last column that is worth breaking into lines.
const NARROWEST: usize = 20;

#[derive(Clone, Copy, PartialEq)]
enum Content {
    Text,
    Number,
    /// "yes" or "no".
    Verdict,
}

/// Heading, unit and kind of a column.
pub(crate) struct Heading {
    name: &'static str,
    unit: &'static str,
    content: Content,
}

/// Words.
pub(crate) const fn text(name: &'static str) -> Heading {
    Heading { name, unit: "", content: Content::Text }
}

/// Numbers, aligned right.
pub(crate) const fn number(name: &'static str, unit: &'static str) -> Heading {
    Heading { name, unit, content: Content::Number }
}

/// "yes" or "no", with a colour.
pub(crate) const fn verdict(name: &'static str) -> Heading {
    Heading { name, unit: "", content: Content::Verdict }
}

/// A table of words and numbers that are already written out.
pub(crate) struct Grid {
    caption: String,
    headings: Vec<Heading>,
    rows: Vec<Vec<String>>,
}

impl Grid {
    pub(crate) fn new(caption: impl Into<String>, headings: impl Into<Vec<Heading>>) -> Self {
        Self { caption: caption.into(), headings: headings.into(), rows: Vec::new() }
    }

    pub(crate) fn push(&mut self, row: impl IntoIterator<Item = String>) {
        self.rows.push(row.into_iter().collect());
    }

    /// Whether there is a row.
    pub(crate) fn has_rows(&self) -> bool {
        !self.rows.is_empty()
    }

    /// Aligned columns for a terminal; a last column of words is broken into lines.
    pub(crate) fn to_text(&self) -> String {
        let headings: Vec<String> = self.headings.iter().map(Heading::label).collect();
        let mut widths: Vec<usize> = headings.iter().map(|h| h.chars().count()).collect();
        for row in &self.rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = (*width).max(cell.chars().count());
            }
        }
        let last = widths.len().saturating_sub(1);
        let before: usize = widths.iter().take(last).map(|w| w + 2).sum::<usize>() + 2;
        if self.headings.last().is_some_and(|h| h.content == Content::Text) {
            widths[last] = widths[last].min(LINE_LENGTH.saturating_sub(before).max(NARROWEST));
        }
        let mut result = String::new();
        if !self.caption.is_empty() {
            result = format!("{}\n", self.caption);
        }
        self.line(&mut result, &headings, &widths);
        for row in &self.rows {
            self.line(&mut result, row, &widths);
        }
        result
    }

    fn line(&self, result: &mut String, cells: &[String], widths: &[usize]) {
        let mut line = String::new();
        let mut broken = Vec::new();
        for (index, ((cell, heading), width)) in cells.iter().zip(&self.headings).zip(widths).enumerate() {
            let mut shown = cell.as_str();
            if index + 1 == widths.len() && cell.chars().count() > *width {
                broken = wrap(cell, *width);
                shown = broken.first().map_or("", String::as_str);
            }
            let _ = match heading.content {
                Content::Number => write!(line, "  {shown:>width$}"),
                Content::Text => write!(line, "  {shown:<width$}"),
                Content::Verdict => write!(line, "  {}", colour::verdict(&format!("{shown:<width$}"))),
            };
        }
        let _ = writeln!(result, "{}", line.trim_end());
        let indent: usize = widths[..widths.len() - 1].iter().map(|w| w + 2).sum::<usize>() + 2;
        for more in broken.iter().skip(1) {
            let _ = writeln!(result, "{:indent$}{more}", "");
        }
    }

    /// The table of a page.
    pub(crate) fn to_table(&self) -> report::Table {
        let columns: Vec<report::Column> = self
            .headings
            .iter()
            .map(|h| match h.content {
                Content::Number => report::Column::number(h.name, h.unit),
                Content::Text | Content::Verdict => report::Column::text(h.name),
            })
            .collect();
        let mut table = report::Table::new(self.caption.clone(), columns);
        for row in &self.rows {
            table.push(row.iter().zip(&self.headings).map(|(cell, heading)| {
                let shown = report::Cell::from(cell.as_str());
                match (heading.content, cell.as_str()) {
                    (Content::Verdict, "yes") => shown.verdict(report::Verdict::Good),
                    (Content::Verdict, _) => shown.verdict(report::Verdict::Neutral),
                    _ => shown,
                }
            }));
        }
        table
    }
}

impl Heading {
    fn label(&self) -> String {
        match unit(self.unit) {
            "" => self.name.into(),
            unit => format!("{} [{unit}]", self.name),
        }
    }
}

/// Breaks a text at spaces into lines of at most `width` characters; a longer word stays whole.
pub(crate) fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

/// A sentence on lines of at most 100 characters.
pub(crate) fn paragraph(text: &str) -> String {
    wrap(text, LINE_LENGTH).join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_align_and_the_last_is_broken_at_words() {
        let mut grid = Grid::new("Things", [text("name"), number("size", "m"), text("why")]);
        grid.push(["a".into(), "1.5".into(), "short".into()]);
        grid.push(["long name".into(), "123".into(), "word ".repeat(30)]);
        let lines: Vec<String> = grid.to_text().lines().map(str::to_owned).collect();
        assert_eq!(lines[1], "  name       size [m]  why");
        assert_eq!(lines[2], "  a               1.5  short");
        assert!(lines.len() > 4 && lines.iter().all(|line| line.len() <= LINE_LENGTH), "{lines:#?}");
        assert!(lines[4].starts_with(&" ".repeat(lines[1].find("why").unwrap())), "{lines:#?}");
    }
}
