//! From figures to one SVG element.
//!
//! `plotters` places on whole units and has no dashes. The drawing is therefore made ten times larger than shown ([`UNITS`] per CSS
//! pixel, undone by the `viewBox`), and the dash pattern of a role is added to its lines afterwards, found by colour and width.

use plotters::element::Text;
use plotters::prelude::{IntoDrawingArea, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{RGBColor, WHITE};

use super::canvas::{Outcome, UNITS, text, units};
use super::data::data;
use super::layout::{Layout, RIGHT_PX};
use super::legend::draw_header;
use super::plot::draw_plot;
use super::text::{TEXT_PX, escape, printable, shorten};
use crate::axis::Axis;
use crate::figure::{Figure, Panels};
use crate::style::{Look, Style};

impl Figure {
    /// Draws the figure, `width` by `height` CSS pixels (kept between 240 and 8000, and more where the texts need it).
    #[must_use]
    pub fn to_svg(&self, width: u32, height: u32) -> String {
        draw(std::slice::from_ref(self), width, height).svg
    }
}

impl Panels {
    /// Draws the stack, `width` by `height` CSS pixels in all (kept between 240 and 8000, and more where the texts need it).
    #[must_use]
    pub fn to_svg(&self, width: u32, height: u32) -> String {
        draw(&self.figures, width, height).svg
    }
}

/// A drawing, and what is known of it.
pub(crate) struct Drawn {
    pub(crate) svg: String,
    /// Where its axes lie and the numbers behind its lines, as JSON.
    pub(crate) data: String,
}

/// Draws `figures` stacked over one x axis into one SVG element, `width` by `height` CSS pixels.
pub(crate) fn draw(figures: &[Figure], width: u32, height: u32) -> Drawn {
    let nothing = [Figure::new("", Axis::new("", ""), Axis::new("", ""))];
    let figures = if figures.is_empty() { &nothing } else { figures };
    let layout = Layout::new(figures, width.clamp(240, 8000) as i32, height.clamp(240, 8000) as i32);
    let mut drawing = String::new();
    let body = match draw_all(&mut drawing, figures, &layout) {
        Ok(()) => drawing.split_once('\n').map_or("", |(_, body)| body).to_owned(),
        // Writing to a string cannot fail; should a new version of the library disagree, the reader is told.
        Err(error) => {
            format!("<text x=\"20\" y=\"300\" font-size=\"130\">{}</text></svg>", escape(&error.to_string()))
        }
    };
    let titles: Vec<_> = figures.iter().map(|f| f.title.as_str()).filter(|title| !title.is_empty()).collect();
    let label = if titles.is_empty() { "figure".to_owned() } else { titles.join("; ") };
    let data = data(figures, &layout);
    let Layout { width, height, .. } = layout;
    let head = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {} {}\" \
         role=\"img\" aria-label=\"{}\">\n",
        width * UNITS,
        height * UNITS,
        escape(&label),
    );
    Drawn { svg: printable(&(head + &dashed(&body))), data }
}

/// Adds the dash pattern to each line of a dashed role.
fn dashed(drawing: &str) -> String {
    let mut result = drawing.to_owned();
    for Look { colour: RGBColor(r, g, b), width, dash, .. } in Style::all().map(Style::look) {
        if !dash.is_empty() {
            // Quotation marks are escaped in text, so only attributes can match.
            let plain = format!("stroke=\"#{r:02X}{g:02X}{b:02X}\" stroke-width=\"{width}\"");
            let lengths = dash.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
            result = result.replace(&plain, &format!("{plain} stroke-dasharray=\"{lengths}\""));
        }
    }
    result
}

fn draw_all(target: &mut String, figures: &[Figure], layout: &Layout) -> Outcome {
    let size = ((layout.width * UNITS) as u32, (layout.height * UNITS) as u32);
    let root = SVGBackend::with_string(target, size).into_drawing_area();
    root.fill(&WHITE)?;
    for (i, figure) in figures.iter().enumerate() {
        let (header, top) = (&layout.headers[i], layout.top(i));
        draw_header(&root, header, top - header.height())?;
        draw_plot(&root, figure, layout, i, top)?;
    }
    let centre = (layout.left + layout.width - RIGHT_PX) / 2;
    let label = shorten(&layout.x.title(), layout.width - 20, TEXT_PX);
    let style = text(TEXT_PX).pos(Pos::new(HPos::Center, VPos::Bottom));
    root.draw(&Text::new(label, units(centre, layout.height - 4), style))?;
    root.present()
}
