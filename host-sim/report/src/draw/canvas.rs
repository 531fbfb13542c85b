//! Pens, units and markers of a drawing.

use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::element::{Circle, Cross, TriangleMarker};
use plotters::prelude::{DrawingBackend, SVGBackend};
use plotters::style::{Color, IntoFont, RGBColor, ShapeStyle, TextStyle};

use crate::style::{Look, Marker, Style};

/// Drawing units per CSS pixel.
pub(super) const UNITS: i32 = 10;
pub(super) const BAR_OPACITY: f64 = 0.8;
pub(super) const BAND_OPACITY: f64 = 0.2;
pub(super) const MARKER_UNITS: i32 = 30;
/// No line of a dashed role has this width: crosses are not dashed.
const MARKER_STROKE_UNITS: u32 = 13;

pub(super) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);

pub(super) type Backend<'a> = SVGBackend<'a>;
pub(super) type Area<'a> = DrawingArea<Backend<'a>, Shift>;
pub(super) type Outcome = Result<(), DrawingAreaErrorKind<<Backend<'static> as DrawingBackend>::ErrorType>>;

pub(super) fn units(x_px: i32, y_px: i32) -> (i32, i32) {
    (x_px * UNITS, y_px * UNITS)
}

pub(super) fn text(size_px: f64) -> TextStyle<'static> {
    // The backend divides font sizes by 1.24 on output.
    ("sans-serif", size_px * f64::from(UNITS) * 1.24).into_font().color(&INK)
}

pub(super) fn stroke(style: Style) -> ShapeStyle {
    let Look { colour, width, .. } = style.look();
    ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: width }
}

pub(super) fn fill(style: Style, opacity: f64) -> ShapeStyle {
    style.look().colour.mix(opacity).filled()
}

pub(super) fn to_units((x_px, y_px): (f64, f64)) -> (i32, i32) {
    let units = f64::from(UNITS);
    ((x_px * units).round() as i32, (y_px * units).round() as i32)
}

pub(super) fn draw_marker(area: &Area<'_>, at: (i32, i32), style: Style, radius_units: i32) -> Outcome {
    let Look { colour, marker, .. } = style.look();
    match marker {
        Marker::Disc => area.draw(&Circle::new(at, radius_units, colour.filled())),
        Marker::Triangle => area.draw(&TriangleMarker::new(at, radius_units * 3 / 2, colour.filled())),
        Marker::Cross => area.draw(&Cross::new(at, radius_units, colour.stroke_width(MARKER_STROKE_UNITS))),
    }
}
