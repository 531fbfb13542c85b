//! Title and legend above a plot, so that they never cover data.

use plotters::element::{PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, IntoFont};

use super::canvas::{
    Area, BAND_OPACITY, BAR_OPACITY, INK, MARKER_UNITS, Outcome, UNITS, draw_marker, fill, stroke, text,
    units,
};
use super::text::{LINE_PX, TEXT_PX, TITLE_PX, shorten, text_width, wrap};
use crate::figure::{Figure, Kind, Mark};
use crate::style::Style;

const SWATCH_PX: i32 = 28;
/// Space above the title.
const ABOVE_PX: i32 = 8;

/// Title and legend above a plot.
pub(super) struct Header {
    title: Vec<String>,
    rows: Vec<Vec<Entry>>,
}

struct Entry {
    text: String,
    swatch: Swatch,
    style: Style,
    /// Left edge within its row, CSS pixels.
    x: i32,
}

#[derive(Clone, Copy)]
enum Swatch {
    Line,
    Marker,
    Box,
    Band,
}

impl Header {
    pub(super) fn new(figure: &Figure, width: i32) -> Self {
        let room = width - 2 * ABOVE_PX;
        let mut title = wrap(&figure.title, room, TITLE_PX);
        if title.iter().all(String::is_empty) {
            title.clear();
        }
        let mut rows: Vec<Vec<Entry>> = vec![];
        let mut x = room;
        for (text, swatch, style) in entries(figure) {
            let text = shorten(&text, room - SWATCH_PX - 8, TEXT_PX);
            let length = SWATCH_PX + 6 + text_width(&text, TEXT_PX) + 18;
            if x + length > room || rows.is_empty() {
                rows.push(vec![]);
                x = 0;
            }
            if let Some(row) = rows.last_mut() {
                row.push(Entry { text, swatch, style, x });
            }
            x += length;
        }
        Self { title, rows }
    }

    /// CSS pixels.
    pub(super) fn height(&self) -> i32 {
        ABOVE_PX + (self.title.len() as i32 * (LINE_PX + 2)) + self.rows.len() as i32 * LINE_PX + 6
    }
}

/// Legend entries of what has a name, marks last; what cannot be drawn says so.
fn entries(figure: &Figure) -> Vec<(String, Swatch, Style)> {
    let named = |name: &str, drawn: bool| if drawn { name.to_owned() } else { format!("{name} (no data)") };
    let mut all = vec![];
    for series in figure.series.iter().filter(|series| !series.name.is_empty()) {
        let swatch = match series.kind {
            Kind::Line | Kind::Step => Swatch::Line,
            Kind::Points => Swatch::Marker,
            Kind::Bars => Swatch::Box,
        };
        let drawn = series.data.iter().any(|(x, y)| figure.x.can_draw(*x) && figure.y.can_draw(*y));
        all.push((named(&series.name, drawn), swatch, series.style));
    }
    for mark in &figure.marks {
        let (name, drawn, swatch, style) = match mark {
            Mark::Horizontal { name, y, style } => (name, figure.y.can_draw(*y), Swatch::Line, *style),
            Mark::Vertical { name, x, style } => (name, figure.x.can_draw(*x), Swatch::Line, *style),
            Mark::HorizontalBand { name, y, style } => {
                (name, figure.y.can_draw(y.0) && figure.y.can_draw(y.1), Swatch::Band, *style)
            }
            Mark::VerticalBand { name, x, style } => {
                (name, figure.x.can_draw(x.0) && figure.x.can_draw(x.1), Swatch::Band, *style)
            }
        };
        if !name.is_empty() {
            all.push((named(name, drawn), swatch, style));
        }
    }
    all
}

/// Draws a header `top` pixels down.
pub(super) fn draw_header(root: &Area<'_>, header: &Header, top: i32) -> Outcome {
    let mut y = top + ABOVE_PX;
    for line in &header.title {
        let bold =
            ("sans-serif", TITLE_PX * f64::from(UNITS) * 1.24, FontStyle::Bold).into_font().color(&INK);
        root.draw(&Text::new(line.as_str(), units(ABOVE_PX, y), bold.pos(Pos::new(HPos::Left, VPos::Top))))?;
        y += LINE_PX + 2;
    }
    for row in &header.rows {
        for entry in row {
            draw_entry(root, entry, ABOVE_PX + entry.x, y + LINE_PX / 2)?;
        }
        y += LINE_PX;
    }
    Ok(())
}

fn draw_entry(root: &Area<'_>, entry: &Entry, x: i32, y: i32) -> Outcome {
    let (left, right) = (x, x + SWATCH_PX);
    match entry.swatch {
        Swatch::Line => {
            root.draw(&PathElement::new(vec![units(left, y), units(right, y)], stroke(entry.style)))?
        }
        Swatch::Marker => draw_marker(root, units((left + right) / 2, y), entry.style, MARKER_UNITS)?,
        Swatch::Box => root.draw(&Rectangle::new(
            [units(left, y - 5), units(right, y + 5)],
            fill(entry.style, BAR_OPACITY),
        ))?,
        Swatch::Band => root.draw(&Rectangle::new(
            [units(left, y - 5), units(right, y + 5)],
            fill(entry.style, BAND_OPACITY),
        ))?,
    }
    let style = text(TEXT_PX).pos(Pos::new(HPos::Left, VPos::Center));
    root.draw(&Text::new(entry.text.as_str(), units(right + 6, y), style))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Axis;
    use crate::figure::Series;

    #[test]
    fn what_cannot_be_drawn_says_so_and_what_has_no_name_is_left_out() {
        let figure = Figure::new("", Axis::new("", ""), Axis::new("", ""))
            .with(Series::line("flown", Style::Measured, [(0.0, 1.0)]))
            .with(Series::line("lost", Style::Measured, [(0.0, f64::NAN)]))
            .with(Series::line("", Style::Measured, [(0.0, 1.0)]))
            .mark(Mark::limit("limit", f64::NAN));
        let names: Vec<String> = entries(&figure).into_iter().map(|(name, ..)| name).collect();
        assert_eq!(names, ["flown", "lost (no data)", "limit (no data)"]);
    }

    #[test]
    fn a_full_row_goes_on_in_the_next() {
        let named = |n: usize| Series::line("n".repeat(n), Style::Measured, [(0.0, 1.0)]);
        let figure = Figure::new("", Axis::new("", ""), Axis::new("", "")).with(named(30)).with(named(30));
        assert_eq!(Header::new(&figure, 800).rows.len(), 1);
        assert_eq!(Header::new(&figure, 400).rows.len(), 2);
        assert!(Header::new(&figure, 400).height() > Header::new(&figure, 800).height());
    }
}
