//! From figure to SVG, with `plotters` for everything inside the axes.
//!
//! `plotters` places on whole units and has no dashes. The drawing is therefore made ten times larger than shown ([`UNITS`] per CSS
//! pixel, undone by the `viewBox`), and the dash pattern of a role is added to its lines afterwards, found by colour and width.
//! Titles and legend stand above the plot, so that they never cover data.

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::element::{Circle, Cross, PathElement, Rectangle, Text, TriangleMarker};
use plotters::prelude::{DrawingBackend, IntoDrawingArea, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, FontTransform, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

use crate::axis::{Extent, Scale};
use crate::decimate;
use crate::figure::{Figure, Kind, Mark, Series};
use crate::style::{Look, Marker, Style};

/// Drawing units per CSS pixel.
const UNITS: i32 = 10;
/// More markers than this cannot be told apart and make the file heavy.
const MOST_MARKERS: usize = 1500;

const TEXT_PX: f64 = 13.0;
const TITLE_PX: f64 = 15.0;
const LINE_PX: i32 = 18;
const SWATCH_PX: i32 = 28;
/// Width of an average sans-serif character over its height, rounded up: no font is at hand to measure with.
const CHARACTER: f64 = 0.58;

const BAR_OPACITY: f64 = 0.8;
const BAND_OPACITY: f64 = 0.2;
const MARKER_UNITS: i32 = 30;
/// No line of a dashed role has this width: crosses are not dashed.
const MARKER_STROKE_UNITS: u32 = 13;

const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
const GRID: RGBColor = RGBColor(0xDD, 0xDD, 0xDD);
const FINE_GRID: RGBColor = RGBColor(0xF0, 0xF0, 0xF0);

type Backend<'a> = SVGBackend<'a>;
type Area<'a> = DrawingArea<Backend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'b, Backend<'a>, Cartesian2d<Scale, Scale>>;
type Outcome = Result<(), DrawingAreaErrorKind<<Backend<'static> as DrawingBackend>::ErrorType>>;

/// Draws `figures` stacked over one x axis into one SVG element, `width` by `height` CSS pixels.
pub(crate) fn svg(figures: &[Figure], width: u32, height: u32) -> String {
    let nothing = [Figure::new("", crate::Axis::new("", ""), crate::Axis::new("", ""))];
    let figures = if figures.is_empty() { &nothing } else { figures };
    let layout = Layout::new(figures, width.clamp(240, 8000) as i32, height.clamp(240, 8000) as i32);
    let mut drawing = String::new();
    let body = match draw(&mut drawing, figures, &layout) {
        Ok(()) => drawing.split_once('\n').map_or("", |(_, body)| body).to_owned(),
        // Writing to a string cannot fail; should a new version of the library disagree, the reader is told.
        Err(error) => {
            format!("<text x=\"20\" y=\"300\" font-size=\"130\">{}</text></svg>", escape(&error.to_string()))
        }
    };
    let titles: Vec<_> = figures.iter().map(|f| f.title.as_str()).filter(|title| !title.is_empty()).collect();
    let label = if titles.is_empty() { "figure".to_owned() } else { titles.join("; ") };
    let Layout { width, height, .. } = layout;
    let head = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {} {}\" \
         role=\"img\" aria-label=\"{}\">\n",
        width * UNITS,
        height * UNITS,
        escape(&label),
    );
    printable(&(head + &dashed(&body)))
}

/// Replaces characters that neither XML nor HTML can hold.
pub(crate) fn printable(text: &str) -> String {
    let bad = |c: char| (c.is_control() && c != '\n' && c != '\t') || matches!(c, '\u{FFFE}' | '\u{FFFF}');
    text.chars().map(|c| if bad(c) { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

fn escape(text: &str) -> String {
    maud::html! { (text) }.into_string()
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

/// Room right of the plot, for the half of the last tick label that sticks out.
const RIGHT_PX: i32 = 24;
/// Tick labels below the last plot.
const TICKS_PX: i32 = 24;
/// Label of the x axis below the tick labels.
const X_LABEL_PX: i32 = 22;
/// Space below each plot of a stack but the last.
const BETWEEN_PX: i32 = 12;
/// Space above the title.
const ABOVE_PX: i32 = 8;
const SMALLEST_PLOT_PX: i32 = 90;

/// Sizes in CSS pixels and the scales, for all panels of a stack.
struct Layout {
    width: i32,
    height: i32,
    /// Left edge of every plot.
    left: i32,
    plot_height: i32,
    headers: Vec<Header>,
    /// Lines of the y labels.
    y_titles: Vec<Vec<String>>,
    x: Scale,
    y: Vec<Scale>,
}

impl Layout {
    fn new(figures: &[Figure], width: i32, height: i32) -> Self {
        let headers: Vec<_> = figures.iter().map(|figure| Header::new(figure, width)).collect();
        let count = figures.len() as i32;
        let around = headers.iter().map(Header::height).sum::<i32>()
            + BETWEEN_PX * (count - 1)
            + TICKS_PX
            + X_LABEL_PX;
        let plot_height = ((height - around) / count).max(SMALLEST_PLOT_PX);
        let (x_extent, y_extents) = extents(figures);
        let y_target = (plot_height / 42).clamp(2, 8) as usize;
        let mut y: Vec<_> = std::iter::zip(figures, &y_extents)
            .map(|(figure, extent)| Scale::new(&figure.y, *extent, y_margin(figure, *extent), y_target))
            .collect();
        let y_titles: Vec<_> = y.iter().map(|scale| wrap(&scale.title(), plot_height, TEXT_PX)).collect();
        let title_lines = y_titles.iter().map(Vec::len).max().unwrap_or(0) as i32;
        let tick_width =
            y.iter().flat_map(Scale::tick_labels).map(|label| text_width(&label, TEXT_PX)).max().unwrap_or(0);
        let left = title_lines * LINE_PX + tick_width + 18;
        let plot_width = (width - left - RIGHT_PX).max(SMALLEST_PLOT_PX);
        let mut x = fitting_x_scale(figures, x_extent, plot_width);
        if let [figure] = figures
            && figure.equal_scale
            && !figure.x.logarithmic
            && !figure.y.logarithmic
        {
            equalise(&mut x, &mut y[0], plot_width, plot_height, y_target);
        }
        if x_extent.is_empty() {
            x.remove_ticks();
        }
        y.iter_mut()
            .zip(&y_extents)
            .filter(|(_, extent)| extent.is_empty())
            .for_each(|(scale, _)| scale.remove_ticks());
        let (width, height) = (left + plot_width + RIGHT_PX, around + plot_height * count);
        Self { width, height, left, plot_height, headers, y_titles, x, y }
    }
}

/// Ranges of the data and marks: x over all figures, y for each.
fn extents(figures: &[Figure]) -> (Extent, Vec<Extent>) {
    let x_axis = &figures[0].x;
    let mut x = Extent::default();
    let mut all_y = vec![];
    for figure in figures {
        let mut y = Extent::default();
        for series in &figure.series {
            let points = corners(series, |x| x_axis.can_draw(x))
                .filter(|(x, y)| x_axis.can_draw(*x) && figure.y.can_draw(*y));
            let half = if series.kind == Kind::Bars { half_bar_width(&series.data) } else { 0.0 };
            for point in points {
                [point.0 - half, point.0 + half]
                    .into_iter()
                    .filter(|v| x_axis.can_draw(*v))
                    .for_each(|v| x.add(v));
                y.add(point.1);
            }
            if series.kind == Kind::Bars && !y.is_empty() && !figure.y.logarithmic {
                y.add(0.0);
            }
        }
        // A mark alone does not make a range: limits without data would look like data that stays within them.
        if !y.is_empty() {
            let (mark_x, mark_y) = mark_extents(figure);
            mark_x.into_iter().filter(|v| x_axis.can_draw(*v)).for_each(|v| x.add(v));
            mark_y.into_iter().filter(|v| figure.y.can_draw(*v)).for_each(|v| y.add(v));
        }
        all_y.push(y);
    }
    (x, all_y)
}

/// Shares of the range added below and above the data; bars that all rise stand on the axis.
fn y_margin(figure: &Figure, extent: Extent) -> (f64, f64) {
    let has_bars = figure.series.iter().any(|series| series.kind == Kind::Bars);
    let below = if has_bars && extent.low() == Some(0.0) { 0.0 } else { 0.05 };
    (below, 0.05)
}

fn mark_extents(figure: &Figure) -> (Vec<f64>, Vec<f64>) {
    let (mut xs, mut ys) = (vec![], vec![]);
    for mark in &figure.marks {
        match mark {
            Mark::Horizontal { y, .. } => ys.push(*y),
            Mark::Vertical { x, .. } => xs.push(*x),
            Mark::HorizontalBand { y, .. } => ys.extend([y.0, y.1]),
            Mark::VerticalBand { x, .. } => xs.extend([x.0, x.1]),
        }
    }
    (xs, ys)
}

/// Half the smallest distance between neighbours in x; half a unit for a single bar.
fn half_bar_width(data: &[(f64, f64)]) -> f64 {
    let linear = crate::Axis::new("", "");
    let mut xs: Vec<_> = data.iter().map(|p| p.0).filter(|x| linear.can_draw(*x)).collect();
    xs.sort_by(f64::total_cmp);
    let smallest = xs.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { 0.5 * smallest } else { 0.5 }
}

/// As many ticks as their labels leave room for.
fn fitting_x_scale(figures: &[Figure], extent: Extent, plot_width: i32) -> Scale {
    let on_the_edge = |s: &Series| s.kind == Kind::Points;
    let needs_margin = figures.iter().any(|f| f.equal_scale || f.series.iter().any(on_the_edge));
    let margin = if needs_margin { (0.03, 0.03) } else { (0.0, 0.0) };
    let most = (plot_width / 80).clamp(2, 12);
    let scales = (2..=most).rev().map(|target| Scale::new(&figures[0].x, extent, margin, target as usize));
    let fits = |scale: &Scale| {
        let widths: Vec<_> = scale.tick_labels().map(|label| text_width(&label, TEXT_PX) + 14).collect();
        widths.iter().max().unwrap_or(&0) * widths.len() as i32 <= plot_width
    };
    let fewest = Scale::new(&figures[0].x, extent, margin, 2);
    let mut scales = scales;
    scales.find(fits).unwrap_or(fewest)
}

/// Lengthens the range of one axis until a unit is equally long on both.
fn equalise(x: &mut Scale, y: &mut Scale, plot_width: i32, plot_height: i32, y_target: usize) {
    let x_px_per_unit = f64::from(plot_width) / x.length();
    let y_px_per_unit = f64::from(plot_height) / y.length();
    if x_px_per_unit > y_px_per_unit {
        *x = x.stretched(x_px_per_unit / y_px_per_unit, (plot_width / 90).clamp(2, 10) as usize);
    } else {
        *y = y.stretched(y_px_per_unit / x_px_per_unit, y_target);
    }
}

/// Title and legend above a plot.
struct Header {
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
    fn new(figure: &Figure, width: i32) -> Self {
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

    fn height(&self) -> i32 {
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

fn text_width(text: &str, size_px: f64) -> i32 {
    (text.chars().count() as f64 * CHARACTER * size_px).ceil() as i32
}

fn characters_in(room_px: i32, size_px: f64) -> usize {
    (f64::from(room_px) / (CHARACTER * size_px)).max(4.0) as usize
}

fn shorten(text: &str, room_px: i32, size_px: f64) -> String {
    let most = characters_in(room_px, size_px);
    if text.chars().count() <= most {
        return text.to_owned();
    }
    text.chars().take(most - 1).chain(['…']).collect()
}

/// Breaks `text` at spaces into lines that fit; more than three lines are cut.
fn wrap(text: &str, room_px: i32, size_px: f64) -> Vec<String> {
    const MOST_LINES: usize = 3;
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

fn draw(target: &mut String, figures: &[Figure], layout: &Layout) -> Outcome {
    let size = ((layout.width * UNITS) as u32, (layout.height * UNITS) as u32);
    let root = SVGBackend::with_string(target, size).into_drawing_area();
    root.fill(&WHITE)?;
    let mut top = 0;
    for (i, figure) in figures.iter().enumerate() {
        let header = &layout.headers[i];
        draw_header(&root, header, top)?;
        top += header.height();
        draw_plot(&root, figure, layout, i, top)?;
        top += layout.plot_height + BETWEEN_PX;
    }
    let centre = (layout.left + layout.width - RIGHT_PX) / 2;
    let label = shorten(&layout.x.title(), layout.width - 20, TEXT_PX);
    let style = text(TEXT_PX).pos(Pos::new(HPos::Center, VPos::Bottom));
    root.draw(&Text::new(label, units(centre, layout.height - 4), style))?;
    root.present()
}

fn units(x_px: i32, y_px: i32) -> (i32, i32) {
    (x_px * UNITS, y_px * UNITS)
}

fn text(size_px: f64) -> TextStyle<'static> {
    // The backend divides font sizes by 1.24 on output.
    ("sans-serif", size_px * f64::from(UNITS) * 1.24).into_font().color(&INK)
}

fn stroke(style: Style) -> ShapeStyle {
    let Look { colour, width, .. } = style.look();
    ShapeStyle { color: colour.to_rgba(), filled: false, stroke_width: width }
}

fn fill(style: Style, opacity: f64) -> ShapeStyle {
    style.look().colour.mix(opacity).filled()
}

fn draw_header(root: &Area<'_>, header: &Header, top: i32) -> Outcome {
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

/// Axes, grid, marks and series of panel `i`, the plot starting `top` pixels down.
fn draw_plot(root: &Area<'_>, figure: &Figure, layout: &Layout, i: usize, top: i32) -> Outcome {
    draw_y_title(root, &layout.y_titles[i], top + layout.plot_height / 2)?;
    let last = i + 1 == layout.y.len();
    let below = if last { TICKS_PX } else { 0 };
    let frame = root.clone().shrink(
        units(0, top),
        ((layout.width * UNITS) as u32, ((layout.plot_height + below) * UNITS) as u32),
    );
    let mut chart = ChartBuilder::on(&frame)
        .margin_right(RIGHT_PX * UNITS)
        .y_label_area_size(layout.left * UNITS)
        .x_label_area_size(below * UNITS)
        .build_cartesian_2d(layout.x.clone(), layout.y[i].clone())?;
    draw_grid(&mut chart)?;
    let area = chart.plotting_area().strip_coord_spec();
    Plot { area, x: &layout.x, y: &layout.y[i], figure }.draw()
}

fn draw_y_title(root: &Area<'_>, lines: &[String], middle: i32) -> Outcome {
    let style = text(TEXT_PX).transform(FontTransform::Rotate270).pos(Pos::new(HPos::Center, VPos::Center));
    for (i, line) in lines.iter().enumerate() {
        root.draw(&Text::new(
            line.as_str(),
            units(LINE_PX * i as i32 + LINE_PX / 2 + 3, middle),
            style.clone(),
        ))?;
    }
    Ok(())
}

fn draw_grid(chart: &mut Chart<'_, '_>) -> Outcome {
    chart
        .configure_mesh()
        .light_line_style(FINE_GRID.stroke_width(UNITS as u32))
        .bold_line_style(GRID.stroke_width(UNITS as u32))
        .axis_style(INK.stroke_width(UNITS as u32))
        .set_all_tick_mark_size(4 * UNITS)
        .label_style(text(TEXT_PX))
        .draw()
}

/// The area inside the axes, with drawing units from its upper left corner as coordinates.
struct Plot<'a, 'b> {
    area: Area<'b>,
    x: &'a Scale,
    y: &'a Scale,
    figure: &'a Figure,
}

impl Plot<'_, '_> {
    fn draw(&self) -> Outcome {
        if self.is_empty() {
            let style = text(TITLE_PX).pos(Pos::new(HPos::Center, VPos::Center));
            let (width, height) = self.size_px();
            return self.area.draw(&Text::new("no data", to_units((width / 2.0, height / 2.0)), style));
        }
        for mark in &self.figure.marks {
            self.draw_mark(mark)?;
        }
        for series in &self.figure.series {
            match series.kind {
                Kind::Line | Kind::Step => self.draw_line(series)?,
                Kind::Points => self.draw_points(series)?,
                Kind::Bars => self.draw_bars(series)?,
            }
        }
        Ok(())
    }

    fn is_empty(&self) -> bool {
        self.figure.series.iter().all(|series| series.data.iter().all(|point| self.place(*point).is_none()))
    }

    fn size_px(&self) -> (f64, f64) {
        let (width, height) = self.area.dim_in_pixel();
        (f64::from(width) / f64::from(UNITS), f64::from(height) / f64::from(UNITS))
    }

    fn x_px(&self, x: f64) -> Option<f64> {
        self.x.can_draw(x).then(|| self.x.fraction(x) * self.size_px().0)
    }

    fn y_px(&self, y: f64) -> Option<f64> {
        self.y.can_draw(y).then(|| (1.0 - self.y.fraction(y)) * self.size_px().1)
    }

    /// CSS pixels from the upper left corner of the plot; `None` for a gap.
    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.x_px(x)?, self.y_px(y)?))
    }

    fn draw_mark(&self, mark: &Mark) -> Outcome {
        let (width, height) = self.size_px();
        let corners = match mark {
            Mark::Horizontal { y, .. } => self.y_px(*y).map(|y| ((0.0, y), (width, y))),
            Mark::Vertical { x, .. } => self.x_px(*x).map(|x| ((x, 0.0), (x, height))),
            Mark::HorizontalBand { y, .. } => self
                .y_px(y.0.max(y.1))
                .zip(self.y_px(y.0.min(y.1)))
                .map(|(top, bottom)| ((0.0, top), (width, bottom))),
            Mark::VerticalBand { x, .. } => self
                .x_px(x.0.min(x.1))
                .zip(self.x_px(x.0.max(x.1)))
                .map(|(left, right)| ((left, 0.0), (right, height))),
        };
        let Some((from, to)) = corners.map(|(from, to)| (to_units(from), to_units(to))) else {
            return Ok(());
        };
        match mark {
            Mark::Horizontal { style, .. } | Mark::Vertical { style, .. } => {
                self.area.draw(&PathElement::new(vec![from, to], stroke(*style)))
            }
            Mark::HorizontalBand { style, .. } | Mark::VerticalBand { style, .. } => {
                self.area.draw(&Rectangle::new([from, to], fill(*style, BAND_OPACITY)))
            }
        }
    }

    fn draw_line(&self, series: &Series) -> Outcome {
        let style = series.style;
        let points = corners(series, |x| self.x.can_draw(x));
        for run in decimate::line(points.map(|point| self.place(point))) {
            match run.as_slice() {
                // A lone point between two gaps has no line to be seen by.
                [point] => self.area.draw(&Circle::new(to_units(*point), UNITS * 3 / 2, fill(style, 1.0)))?,
                run => self.area.draw(&PathElement::new(
                    run.iter().copied().map(to_units).collect::<Vec<_>>(),
                    stroke(style),
                ))?,
            }
        }
        Ok(())
    }

    fn draw_points(&self, series: &Series) -> Outcome {
        let places: Vec<_> = series.data.iter().filter_map(|point| self.place(*point)).collect();
        let places = decimate::cloud(&places, MOST_MARKERS);
        let radius_units = if places.len() > 300 { UNITS * 3 / 2 } else { MARKER_UNITS };
        places
            .into_iter()
            .try_for_each(|place| draw_marker(&self.area, to_units(place), series.style, radius_units))
    }

    fn draw_bars(&self, series: &Series) -> Outcome {
        let half = half_bar_width(&series.data);
        let (width, height) = self.size_px();
        let base = self.y_px(0.0).unwrap_or(height);
        // More bars than pixel columns: those that reach furthest in each column stand for the others.
        let tops = decimate::line(series.data.iter().map(|point| self.place(*point)));
        let half_px = series
            .data
            .iter()
            .find_map(|(x, _)| Some(0.48 * (self.x_px(x + half)? - self.x_px(x - half)?)))
            .unwrap_or(1.0)
            .max(0.4);
        for (x, top) in tops.into_iter().flatten() {
            let (left, right) = ((x - half_px).max(0.0), (x + half_px).min(width));
            let corners = [to_units((left, top.min(base))), to_units((right, top.max(base)))];
            self.area.draw(&Rectangle::new(corners, fill(series.style, BAR_OPACITY)))?;
        }
        Ok(())
    }
}

fn to_units((x_px, y_px): (f64, f64)) -> (i32, i32) {
    let units = f64::from(UNITS);
    ((x_px * units).round() as i32, (y_px * units).round() as i32)
}

/// The points a line goes through: those of the series, for a step also the end of each tread.
fn corners(series: &Series, x_can_draw: impl Fn(f64) -> bool) -> impl Iterator<Item = (f64, f64)> {
    let next = series.data.iter().skip(1).map(Some).chain([None]);
    series.data.iter().zip(next).flat_map(move |(&(x, y), next)| {
        let tread = next.filter(|_| series.kind == Kind::Step && x_can_draw(x)).map(|next| (next.0, y));
        [Some((x, y)), tread].into_iter().flatten()
    })
}

fn draw_marker(area: &Area<'_>, at: (i32, i32), style: Style, radius_units: i32) -> Outcome {
    let Look { colour, marker, .. } = style.look();
    match marker {
        Marker::Disc => area.draw(&Circle::new(at, radius_units, colour.filled())),
        Marker::Triangle => area.draw(&TriangleMarker::new(at, radius_units * 3 / 2, colour.filled())),
        Marker::Cross => area.draw(&Cross::new(at, radius_units, colour.stroke_width(MARKER_STROKE_UNITS))),
    }
}
